"""What the functions return: records with attributes named as in ``docs/formats.md``, tables."""

from __future__ import annotations

import base64
import html
import json
import os
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import LeverrierError
from .shown import html_table, p_value_text, short, text_table, with_error

if TYPE_CHECKING:
    from .law import Law
    from .spec import Spec


def record(text: str) -> Record:
    """A record of a JSON object."""
    return Record(json.loads(text))


def _wrapped(value: Any) -> Any:
    if isinstance(value, dict):
        return Record(value)
    if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        return Rows(Record(one) for one in value)
    if isinstance(value, list):
        return [_wrapped(one) for one in value]
    return value


class Record(Mapping[str, Any]):
    """A JSON object whose fields are attributes, too.

    >>> from leverrier.results import record
    >>> one = record('{"effect": "viscous_drag(q)", "terms": [{"coefficient": 0.5}]}')
    >>> one.effect, one["effect"] == one.effect, one.terms[0].coefficient
    ('viscous_drag(q)', True, 0.5)
    """

    def __init__(self, fields: dict[str, Any]) -> None:
        self._fields = fields

    def __getitem__(self, name: str) -> Any:
        return _wrapped(self._fields[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError:
            known = ", ".join(self._fields)
            raise AttributeError(f"there is no field {name!r}; there are {known}") from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._fields]

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    def to_dict(self) -> dict[str, Any]:
        """The same in dictionaries and lists, as JSON has it."""
        return self._fields

    def __repr__(self) -> str:
        def shown(value: Any) -> str:
            if isinstance(value, Mapping):
                return f"Record({', '.join(value)})"
            if isinstance(value, list):
                return f"[{len(value)} entries]" if value else "[]"
            return repr(value) if isinstance(value, str) else short(value) or "None"

        fields = ", ".join(f"{name}={shown(self[name])}" for name in self)
        return f"{type(self).__name__}({fields})"

    def _repr_html_(self) -> str:
        return html_table(["field", "value"], [[name, short(self[name])] for name in self])


class Rows(list[Record]):
    """A list of records that is a table."""

    def to_pandas(self) -> Any:
        """One row a record, as a ``pandas.DataFrame``."""
        import pandas

        return pandas.DataFrame([one.to_dict() for one in self])

    def __repr__(self) -> str:
        names = list(self[0]) if self else []
        return text_table(names, [[short(one.get(name)) for name in names] for one in self], 60)

    def _repr_html_(self) -> str:
        names = list(self[0]) if self else []
        return html_table(names, [[short(one.get(name)) for name in names] for one in self])


class Table:
    """Columns of the same length, by name.

    >>> from leverrier import Table
    >>> Table({"t": [0.0, 0.1], "q": [1.0, 0.9]})["q"]
    array([1. , 0.9])
    """

    def __init__(self, columns: Mapping[str, Any]) -> None:
        self.columns: dict[str, np.ndarray] = {k: np.asarray(v) for k, v in columns.items()}

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.columns[name]
        except KeyError:
            raise KeyError(f"{name!r}; there are {', '.join(self.columns)}") from None

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def head(self, rows: int = 5) -> Table:
        """The first rows."""
        return Table({name: values[:rows] for name, values in self.columns.items()})

    def to_pandas(self) -> Any:
        """The same as a ``pandas.DataFrame``."""
        import pandas

        return pandas.DataFrame(self.columns)

    def __repr__(self) -> str:
        rows = [[short(x) for x in row] for row in zip(*self.head(10).columns.values())]
        more = f"\n{len(self)} rows" if len(self) > len(rows) else ""
        return text_table(list(self.columns), rows) + more

    def _repr_html_(self) -> str:
        head = self.head(10)
        rows = [[short(x) for x in row] for row in zip(*head.columns.values())]
        more = f"<p>{len(self)} rows</p>" if len(self) > len(head) else ""
        return html_table(list(self.columns), rows) + more


class _Result(Record):
    """A record that was made from measurements in two parts."""

    @property
    def law(self) -> Law:
        """The law that was judged: it was learned from the training part alone."""
        return self._law

    def __init__(
        self,
        fields: dict[str, Any],
        law: Law,
        draw: Callable[[], list[tuple[str, str, str, str]]] | None = None,
    ) -> None:
        super().__init__(fields)
        self._law = law
        self._draw = draw
        self._figures: list[Figure] | None = None

    @property
    def figures(self) -> list[Figure]:
        """The figures of ``leverrier report``, drawn when they are first asked for; none where the
        measurements are too few, or gone (they do not pickle)."""
        if self._figures is None:
            self._figures = []
            if self._draw is not None:
                self._figures = [Figure(*one) for one in self._draw()]
        return self._figures

    def _drawn(self, *plots: str) -> str:
        """Figures of these kinds; what cannot be drawn is no reason to show nothing."""
        try:
            return "".join(one._repr_html_() for one in self.figures if one.plot in plots)
        except LeverrierError as error:
            return f"<p>{html.escape(str(error))}</p>"

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_draw": None, "_figures": None}


class Figure:
    """A figure of the report, as SVG: ``plot`` is its kind, ``caption`` says how to read it.

    >>> import leverrier
    >>> comparison = leverrier.open("examples/damped-pendulum/fit.ham").fit().compare()
    >>> sorted({figure.plot for figure in comparison.figures})
    ['energy', 'force-map', 'forces', 'horizons', 'portrait', 'predictions']
    """

    def __init__(self, plot: str, title: str, caption: str, svg: str) -> None:
        self.plot, self.title, self.caption, self.svg = plot, title, caption, svg

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the SVG."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.svg)

    def __repr__(self) -> str:
        return f"<leverrier.Figure: {self.title}>"

    def _repr_html_(self) -> str:
        # As an image: its style sheet and names are then its own.
        image = base64.b64encode(self.svg.encode()).decode()
        title, caption = html.escape(self.title), html.escape(self.caption)
        return (
            f'<figure><img alt="{title}" src="data:image/svg+xml;base64,{image}"/>'
            f"<figcaption>{caption}</figcaption></figure>"
        )


class Comparison(_Result):
    """Where a law fails: ``compare`` in ``docs/formats.md``.

    ``horizons`` has the error by length of prediction, ``maps`` the force that is missing,
    ``energy`` its drift, ``findings`` the worst as sentences.
    """

    def to_pandas(self) -> Any:
        """The errors by length of prediction."""
        return self.horizons.to_pandas()

    def __repr__(self) -> str:
        names = ["samples", "duration", "training", "held_out"]
        rows = [[short(one[name]) for name in names] for one in self.horizons]
        head = "\n".join(f"- {one}" for one in self.findings)
        return f"{head}\nerror in units of the noise, by length of prediction\n{text_table(names, rows)}"

    def _repr_html_(self) -> str:
        return self._told_html() + self._drawn("horizons", "predictions", "forces", "force-map")

    def _told_html(self) -> str:
        items = "".join(f"<li>{html.escape(one)}</li>" for one in self.findings)
        return f"<ul>{items}</ul>{self.horizons._repr_html_()}"


def unfinished(fields: dict[str, Any]) -> dict[str, Any]:
    """The fields of a diagnosis that Ctrl-C ended: no verdict follows from what was not tried."""
    reason = "interrupted before all was tried, so nothing follows yet"
    if ranking := fields["ranking"]:
        best = ranking[0]
        reason += f"; the first of the ranking so far is {best['effect']}"
        before, after = best["held_out_error_before"], best["held_out_error_after"]
        if before is not None and after is not None:
            reason += f", which takes the error on held-out runs from {before:.2f} to {after:.2f}"
    return fields | {"verdict": "interrupted", "reason": reason, "interrupted": True}


class Diagnosis(_Result):
    """Which physical effect a law lacks: ``diagnose`` in ``docs/formats.md``.

    ``verdict`` is ``missing``, ``explained_in_part``, ``nothing_missing``, ``unexplained`` or
    ``too_little_data``, or ``interrupted`` where Ctrl-C came before the end (``interrupted`` is
    then true); ``reason`` says why in a sentence; ``ranking`` has what was found, the best first,
    ``story`` what explains all, ``partial`` what is clear of a part.
    """

    @property
    def missing(self) -> str | None:
        """The effect that is missing, as :meth:`leverrier.Law.add` takes it; None where nothing
        is, or where it has no name."""
        found = self.verdict == "missing" and bool(self.ranking)
        return self.ranking[0].effect if found else None

    def to_pandas(self) -> Any:
        """The ranking."""
        return Rows(self.ranking).to_pandas()

    def _ranked(self) -> tuple[list[str], list[list[str]]]:
        """The ranking: names of columns, and cells."""

        def cells(one: Record) -> list[str]:
            pairs = [with_error(*both) for both in zip(one.coefficient, one.standard_error)]
            numbers = ", ".join(f"{value} ± {error}" if error else value for value, error in pairs)
            errors = [one.held_out_error_before, one.held_out_error_after]
            return [one.effect, numbers, p_value_text(one.p_value), *(short(error) for error in errors)]

        names = [
            "effect",
            "coefficient",
            "p_value",
            "held_out_error_before",
            "held_out_error_after",
        ]
        return names, [cells(one) for one in self.ranking]

    def __repr__(self) -> str:
        names, rows = self._ranked()
        table = "\n" + text_table(names, rows, most=8) if rows else ""
        return f"{self.verdict}: {self.reason}{table}"

    def _repr_html_(self) -> str:
        names, rows = self._ranked()
        head = f"<p><b>{html.escape(self.verdict)}</b>: {html.escape(self.reason)}</p>"
        return head + (html_table(names, rows) if rows else "") + self._drawn("ranking", "forces")


class Design(_Result):
    """The next run worth measuring: ``design`` in ``docs/formats.md``.

    ``why`` says what it is for; ``best`` is the run, ``alternatives`` others that would do.
    """

    @property
    def start(self) -> dict[str, float]:
        """Where the run starts, by component of the state."""
        return {one.name: one.value for one in self.best.start}

    @property
    def times(self) -> np.ndarray:
        """The times of its samples."""
        best = self.best
        return getattr(best, "from") + best.step * np.arange(best.samples)

    def to_pandas(self) -> Any:
        """The run and its alternatives, one in a row."""
        return self._rows().to_pandas()

    def _rows(self) -> Rows:
        runs = [self.best, *self.alternatives]
        names = ["from", "duration", "step", "samples"]

        def row(run: Record) -> Record:
            start = {one.name: one.value for one in run.start}
            return Record(start | {name: run[name] for name in names})

        return Rows(row(run) for run in runs)

    def __repr__(self) -> str:
        return f"{self.why}\n{self._rows()!r}"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(self.why)}</p>{self._rows()._repr_html_()}"


class Discovery(_Result):
    """What was added until what is left is noise: ``discover`` in ``docs/formats.md``.

    ``steps`` has the additions, each with what these data cannot tell from it in
    ``indistinguishable``; ``instead`` says what does as well in the place of several of them.
    ``stop`` says why it ended, ``text`` is the longer spec; ``law`` is its law, learned from the
    training part.
    """

    def __init__(self, fields: dict[str, Any], law: Law, spec: Spec) -> None:
        super().__init__(fields, law)
        self._spec = spec

    @property
    def spec(self) -> Spec:
        """The spec with all that was added."""
        return self._spec

    def to_pandas(self) -> Any:
        """The additions."""
        return Rows(self.steps).to_pandas()

    def __repr__(self) -> str:
        steps = ", ".join(step.effect for step in self.steps) or "nothing"
        return f"added {steps}: {self.stop}\n{self.law!r}"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(self.stop)}</p>" + Rows(self.steps)._repr_html_()


class Revision(Record):
    """What an effect did to a law: ``before`` and ``after`` are comparisons of laws that saw the
    training part alone, in units of the same noise; ``law`` is learned from all measurements.

    ``supported`` says whether the held-out error falls and the coefficient is more than four
    standard errors from zero (None without held-out runs), ``reason`` why.
    """

    def __init__(
        self, fields: dict[str, Any], law: Law, before: Comparison, after: Comparison
    ) -> None:
        super().__init__(fields)
        self._law, self._before, self._after = law, before, after

    @property
    def law(self) -> Law:
        """The law with the effect, learned from all measurements."""
        return self._law

    @property
    def before(self) -> Comparison:
        """The law without the effect, on held-out measurements."""
        return self._before

    @property
    def after(self) -> Comparison:
        """The law with the effect, on held-out measurements."""
        return self._after

    def __repr__(self) -> str:
        return f"{self.action}: {self.reason}\n{self.law!r}"

    def _repr_html_(self) -> str:
        head = f"<p>{html.escape(self.action)}: {html.escape(self.reason)}</p>"
        return head + Rows(self.effect)._repr_html_() + (self.law._repr_html_() or "")
