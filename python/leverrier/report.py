"""A page about a law, for a browser."""

from __future__ import annotations

import html
import os
from typing import TYPE_CHECKING

from .errors import FileError, LeverrierError
from .tables import path_text

if TYPE_CHECKING:
    from .law import Law
    from .results import Comparison, Diagnosis

_STYLE = """
body { font: 16px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; }
table { border-collapse: collapse; } td, th { padding: 0.2em 0.8em; text-align: left; }
tr:nth-child(even) { background: #f3f3f3; } img { max-width: 100%; }
mtd { padding: 0.3em 0; }
pre { background: #f3f3f3; padding: 0.8em; overflow: auto; } figcaption { color: #555; }
"""

#: Kinds of figures in their order; the others follow.
_ORDER = {name: at for at, name in enumerate(["horizons", "forces", "force-map", "portrait"])}


class Report:
    """A page about a law: ``html`` is its text, ``save`` writes it; a notebook shows it."""

    def __init__(self, title: str, sections: list[tuple[str, str]]) -> None:
        self.title = title
        #: Headings, and what stands below them.
        self.sections = sections

    @property
    def html(self) -> str:
        """The whole page; it loads nothing from a network."""
        return (
            f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"/>'
            f"<title>{html.escape(self.title)}</title><style>{_STYLE}</style></head>"
            f"<body><h1>{html.escape(self.title)}</h1>{self._repr_html_()}</body></html>"
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the page."""
        name = path_text(path)
        try:
            with open(name, "w", encoding="utf-8") as file:
                file.write(self.html)
        except (OSError, ValueError) as error:
            raise FileError(
                f"{name!r} cannot be written ({error})", "name a file in a folder that is there",
                kind="File", file=name,
            ) from error  # fmt: skip

    def __repr__(self) -> str:
        return f"<leverrier.Report: {self.title}: {', '.join(name for name, _ in self.sections)}>"

    def _repr_html_(self) -> str:
        return "".join(f"<h2>{html.escape(name)}</h2>{of}" for name, of in self.sections)


def written(law: Law, comparison: Comparison | None, diagnosis: Diagnosis | None) -> Report:
    """The report on a law, with what was asked of it."""
    try:
        equations = law.to_mathml()
    except LeverrierError:  # what has no export has a text
        equations = f"<pre>{html.escape(str(law))}</pre>"
    sections = [("The law", equations + law._numbers_html())]
    if comparison is not None:
        drawn = sorted(comparison.figures, key=lambda one: _ORDER.get(one.plot, len(_ORDER)))
        figures = "".join(one._repr_html_() for one in drawn)
        sections.append(("Where it fails", comparison._told_html() + figures))
    if diagnosis is not None:
        sections.append(("What it lacks", diagnosis._repr_html_()))
    if law.data is not None:
        sections.append(("The measurements", law.data._repr_html_()))
    sections.append(("The spec", law.spec._repr_html_()))
    return Report(law.spec.system, sections)
