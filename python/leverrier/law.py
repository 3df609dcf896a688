"""Laws: what was learned, what it predicts, and what it lacks."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from .errors import InvalidArgumentError, LeverrierError
from .judging import Judging
from .prediction import Predicting
from .results import Record, Rows, record
from .shown import html_table, in_html, text_table, with_error
from .tables import path_text

if TYPE_CHECKING:
    from .driven import DrivenField
    from .motion import VectorField
    from .spec import Spec
    from .tables import Data


class Law(Predicting, Judging):
    """A law of motion: a spec with a number for everything in it, learned or known.

    Made by :meth:`leverrier.Spec.fit`. ``terms``, ``parameters``, ``noise``, ``evidence`` and the
    other fields of the model file (``docs/formats.md``) are attributes.

    >>> import leverrier
    >>> law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
    >>> law.terms[0].term, abs(law.terms[0].coefficient + 1) < 0.01
    ('cos(q)', True)
    >>> law.evidence.runs
    8
    """

    def __init__(self, native: _native.Law, spec: Spec, data: Data | None) -> None:
        self._native = native
        self._spec = spec
        self._data = data
        self._field: VectorField | None = None
        self._driven_field: DrivenField | None = None
        self._of_runs: dict[tuple[str, ...], Law] = {}
        self._model: Record | None = None
        #: What was told when it was made.
        self._told: list[str] = []
        #: Makes the law that it came from by a change.
        self._before: Callable[[], Law] | None = None

    # What it is.

    @property
    def spec(self) -> Spec:
        """The spec that it is a law of."""
        return self._spec

    @property
    def data(self) -> Data | None:
        """The measurements that it was learned from; None for a law from a file."""
        return self._data

    @property
    def model(self) -> Record:
        """All that the fit has found: the model file of ``docs/formats.md``."""
        if self._model is None:
            self._model = record(self._native.model_json())
        return self._model

    @property
    def hamiltonian(self) -> Record:
        """The printed form: ``text``, ``digits``, ``parts``, ``snapped``, ``notes``."""
        return record(self._native.hamiltonian_json())

    @property
    def terms(self) -> Rows:
        """The learned terms with their coefficients and standard errors."""
        return Rows(self.model.terms)

    @property
    def distributions(self) -> Rows:
        """Parameters of which every run, or every group of runs, has a value of its own: ``mean``,
        ``spread`` and ``values`` of each; empty where the spec says ``per`` of none.

        >>> import leverrier
        >>> len(leverrier.open("examples/damped-pendulum/fit.ham").fit().distributions)
        0
        """
        return Rows(getattr(self.model, "distributions", []))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the coefficients of ``terms``, then of ``parameters``."""
        return np.asarray(self.model.to_dict()["covariance"], dtype=np.float64)

    @property
    def warnings(self) -> list[str]:
        """What deserves a look, as sentences: what was told when the law was learned, and what its
        measurements cannot tell. What was noticed in these is in ``law.data.warnings``."""
        return [*self._told, *(self.unlearnable if self._is_fitted else [])]

    def coefficient(self, term: str) -> float:
        """The coefficient of a term by its text or its name; 0 for a term that was not chosen.

        >>> import leverrier
        >>> law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
        >>> round(law.coefficient("cos(q)"), 2)
        -1.0
        """
        for one in self.terms:
            if term in (one.term, one.name):
                return one.coefficient
        if term in self.spec.terms:
            return 0.0
        raise InvalidArgumentError(
            f"the law has no term `{term}`", f"it has {', '.join(one.term for one in self.terms)}"
        )

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in _MODEL_FIELDS:
            return getattr(self.model, name)
        raise AttributeError(f"'Law' object has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *_MODEL_FIELDS]

    # What it is written as.

    def to_latex(self, document: bool = False) -> str:
        """The equations with their uncertainties; with ``document`` a document that compiles."""
        return self._native.exported("latex-document" if document else "latex")

    def to_mathml(self) -> str:
        """The equations for a web page."""
        return self._native.exported("mathml")

    def to_python(self) -> str:
        """Source of a module with SymPy expressions and a simulator, which needs no leverrier."""
        return self._native.exported("python")

    def to_json(self) -> str:
        """Everything, for other programs (``docs/export-json.md``)."""
        return self._native.exported("json")

    def to_rust(self, folder: str | os.PathLike[str]) -> None:
        """Writes a cargo project without dependencies: simulator, energy check, tests."""
        self._native.to_rust(path_text(folder))

    def to_c(self, folder: str | os.PathLike[str]) -> None:
        """Writes the same as C source."""
        self._native.to_c(path_text(folder))

    def to_sympy(self) -> Any:
        """The equations as SymPy expressions: ``energy``, ``velocities``, ``accelerations``,
        ``forces``, with the learned numbers in them; ``symbols`` by name.

        >>> import leverrier
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = -cos(q)")
        >>> spec.known_law().to_sympy().accelerations
        [-sin(q)]
        """
        from .sympy import equations

        return equations(json.loads(self.to_json()))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model file."""
        self._native.save(path_text(path))

    def to_pandas(self) -> Any:
        """The learned terms."""
        return self.terms.to_pandas()

    def __reduce__(self) -> tuple[Any, ...]:
        model = self._native.model_json() if self._is_fitted else None
        return _again, (self.spec.text, model), {"_told": self._told}

    @property
    def _is_fitted(self) -> bool:
        try:
            return self.model is not None
        except InvalidArgumentError:
            return False

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Law):
            return NotImplemented
        return self is other or self.__reduce__()[1] == other.__reduce__()[1]

    def __hash__(self) -> int:
        return hash(self.spec)

    def __str__(self) -> str:
        return self._native.equations()

    def __repr__(self) -> str:
        if not self._is_fitted:
            return f"<leverrier.Law: {self._native.equations().strip()}>".replace("\n", "; ")
        return "\n".join([str(self), "", text_table(*self._numbers()), "", self._footing()])

    def _repr_latex_(self) -> str:
        readable = json.loads(self.to_json())["readable"]["parts"]
        lines = [f"{_place(one['place'])} &= {one['latex']}" for one in readable]
        return "$$\\begin{aligned}" + r" \\ ".join(lines) + "\\end{aligned}$$"

    def _repr_html_(self) -> str | None:
        try:
            equations = in_html(self._repr_latex_())
        except LeverrierError:  # what has no export has a text
            equations = f"<pre>{html.escape(str(self))}</pre>"
        if not self._is_fitted:
            return equations
        return equations + self._numbers_html()

    def _numbers_html(self) -> str:
        if not self._is_fitted:
            return ""
        return f"{html_table(*self._numbers())}<p>{html.escape(self._footing())}</p>"

    def _numbers(self) -> tuple[list[str], list[list[str]]]:
        """What was learned, with errors: names of columns, and cells."""
        rows = []
        for one in self.terms:
            term = one.term if one.name is None else f"{one.name}: {one.term}"
            unit = one.unit or ""
            rows.append([one.place, term, *with_error(one.coefficient, one.standard_error), unit])
        for one in self.parameters:
            numbers = with_error(one.value, one.standard_error)
            rows.append(["param", one.name, *numbers, one.unit or ""])
        names = ["place", "term", "coefficient", "standard error", "unit"]
        if not any(row[-1] for row in rows):
            names, rows = names[:-1], [row[:-1] for row in rows]
        return names, rows

    def _footing(self) -> str:
        """What it was learned from, and how well it fits."""
        of = self.evidence
        seen = set(self.spec.observables)
        if self._data is not None:
            seen = {one.name for one in self._data.report.columns if one.measured}
        noise = ", ".join(
            f"{one.observable} {one.standard_deviation:.2g}"
            for one in self.noise
            if one.observable in seen
        )
        runs = f"{of.runs} run{'s'[: of.runs != 1]}"
        lines = [f"learned from {of.samples} samples in {runs}; noise: {noise}", *self._told]
        if self.stop.reason != "converged" and not self._told:
            lines.append(self.stop.sentence)
        return "\n".join(lines)


#: Fields of the model file that a law has as attributes.
_MODEL_FIELDS = (
    "alternatives", "evidence", "fingerprint", "front", "integrator", "noise", "origin",
    "parameters", "path", "runners_up", "stop", "unlearnable", "version",
)  # fmt: skip


def _again(text: str, model: str | None) -> Law:
    from .spec import parse

    spec = parse(text)
    if model is None:
        return spec.known_law()
    return Law(_native.Law.from_model_json(model, spec._native), spec, None)


def _place(place: Any) -> str:
    if isinstance(place, dict):
        (kind, name), *_ = place.items()
        return rf"\text{{{kind} on {name}}}"
    return str(place)
