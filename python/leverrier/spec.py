"""Specs: what is known of a system, and what is to be learned."""

from __future__ import annotations

import builtins
import html
import json
import os
from numbers import Integral
from typing import Any

from . import _native, tables
from .errors import FileError, InvalidArgumentError
from .law import Law
from .progress import Progress, finished
from .questions import diagnosis_options
from .results import Discovery
from .tables import Data

#: Bytes, as :func:`leverrier.Spec.fit` takes them.
_UNITS = {"": 1, "B": 1, "KIB": 2**10, "MIB": 2**20, "GIB": 2**30, "TIB": 2**40}


def open(path: str | os.PathLike[str]) -> Spec:
    """The spec in a file, such as ``swings.ham``. The file of measurements that its ``data`` line
    names is looked for beside it.

    >>> import leverrier
    >>> leverrier.open("examples/damped-pendulum/fit.ham").coordinates
    ['q']
    """
    return Spec(_native.Spec.open(tables.path_text(path)))


def parse(text: str) -> Spec:
    """The spec in a text.

    >>> import leverrier
    >>> spec = leverrier.parse('''
    ...     coordinates q
    ...     momenta p
    ...     T = p^2/2
    ...     V = span{ poly(q; 4), cos(q) }
    ... ''')
    >>> spec.terms
    ['q', 'q^2', 'q^3', 'q^4', 'cos(q)']
    """
    if not isinstance(text, str):
        raise InvalidArgumentError(
            f"a {type(text).__name__} is no text of a spec", "open(path) reads a file"
        )
    _text(text, "a text")
    return Spec(_native.Spec.parse(text))


class Spec:
    """What is known of a system, and what is to be learned: made by :func:`leverrier.open` and
    :func:`leverrier.parse`, and never changed."""

    def __init__(self, native: _native.Spec) -> None:
        self._native = native

    @property
    def text(self) -> str:
        """Its text."""
        return self._native.text

    @property
    def system(self) -> str:
        """Name of the system."""
        return self._native.system

    @property
    def coordinates(self) -> list[str]:
        """Names of the coordinates."""
        return self._native.coordinates

    @property
    def momenta(self) -> list[str]:
        """Names of the momenta."""
        return self._native.momenta

    @property
    def observables(self) -> list[str]:
        """What columns of measurements may be, in order: coordinates, then momenta or
        velocities."""
        return self._native.observables

    @property
    def inputs(self) -> list[str]:
        """Names of the measured inputs that drive it."""
        return self._native.inputs

    @property
    def terms(self) -> list[str]:
        """The function space: a coefficient of each term is to be learned."""
        return self._native.terms

    @property
    def warnings(self) -> list[str]:
        """What deserves a look in the text, as sentences."""
        return self._native.warnings

    def data(self, X: Any = None, *, t: Any = None, run: Any = None, u: Any = None) -> Data:
        """Measurements for this spec.

        ``X`` is a file name (none: the file that the spec names); a table with named columns
        (pandas, polars, pyarrow, a dictionary, a structured array, whatever has
        ``__arrow_c_stream__``), whose columns are found as those of a file are; an array of
        samples by coordinates, or by coordinates and momenta, in the spec's units; or many runs:
        a list of such arrays (of one coordinate they may have one axis), or an array of three
        axes, runs by samples by columns.

        ``t`` has the time of every sample, or is the time step; dates and durations are turned
        into the spec's unit of time (seconds, where it has none), dates from the first of them
        on. For many runs it is a list with the times of each, or times that they have in common.
        ``run`` has the run of every sample, or a name for each run. With a table both may be names
        of columns; without, the columns are those that the spec names, else ``t`` or ``time`` and
        ``run``, and an index of pandas counts as a column (as the times, if it has no name and
        does not just number the rows). ``u`` has the measured inputs beside an array, a column for
        each that the spec names; a table has them among its own. NaN is a missing value. Rows of a
        run may stand in any order of time.

        >>> import leverrier, numpy as np
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = span{ q^2 }")
        >>> t = np.arange(60) * 0.1
        >>> spec.data(np.column_stack([np.cos(t), -np.sin(t)]), t=t)
        <leverrier.Data: 60 samples of q, p in 1 run>
        column  measured  missing    minimum   maximum         mean    spread
        q             60        0  -0.999135         1   -0.0461985  0.690097
        p             60        0  -0.999574  0.999923  -0.00896122  0.722185
        """
        return tables.data(self, X, t, run, u)

    def fit(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        select: str = "information",
        loss: str = "squares",
        method: str | None = None,
        step: float | None = None,
        window: int | None = None,
        starts: int = 8,
        seed: int = 0,
        sparse: bool = True,
        trainer: str = "gauss-newton",
        memory: int | str | None = None,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Law:
        """Learns which terms the law has, and their coefficients.

        ``X``, ``t``, ``run`` and ``u`` are as in :meth:`data`; the other arguments as the options of
        ``leverrier fit --help``. The result does not depend on ``threads``. ``progress`` is
        called with a few words and a fraction; None shows a bar of tqdm, where it is installed,
        for what takes over a second, and False shows none.

        Ctrl-C raises KeyboardInterrupt, with the best law so far as its attribute ``best`` where
        there is one.

        >>> import leverrier, numpy as np
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = span{ poly(q; 4) }")
        >>> t = np.arange(60) * 0.1
        >>> law = spec.fit(np.column_stack([np.cos(t), -np.sin(t)]), t=t)
        >>> [(term.term, round(term.coefficient, 6)) for term in law.terms]
        [('q^2', 0.5)]
        """
        data = self.data(X, t=t, run=run, u=u)
        options = fit_options(
            select=select, loss=loss, method=method, step=step, window=window, starts=starts,
            seed=seed, sparse=sparse, trainer=trainer, memory=memory,
        )  # fmt: skip
        threads = threads_of(threads)
        return finished(
            progress,
            lambda told: self._native.fit(data._native, options, threads, told),
            lambda native: Law(native, self, data),
        )

    def discover(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        held_out: float = 0.25,
        seed: int = 0,
        correlated_noise: bool = True,
        orbits: int = 0,
        all_pairs: bool = False,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Discovery:
        """Fits, asks what is missing, adds it and fits again, until what is left is noise.

        The spec stays as it is: ``discover(...).spec`` is the longer one, ``.law`` its law. Where no
        explanation reaches the noise, what is clear of it is added. The options behind ``seed`` are
        those of :meth:`Law.diagnose`.

        >>> import leverrier
        >>> found = leverrier.open("examples/damped-pendulum/fit.ham").discover()
        >>> [step.effect for step in found.steps]
        ['viscous_drag(q)']
        """
        training, unseen = self.data(X, t=t, run=run, u=u).split(held_out, seed)
        options = (fit_options(), diagnosis_options(correlated_noise, orbits, all_pairs))
        threads = threads_of(threads)

        def wrapped(found: tuple[str, _native.Law, _native.Spec]) -> Discovery:
            text, law, longer = found
            spec = Spec(longer)
            fields = {
                "system": self.system,
                "split": split_fields(training, unseen, held_out, seed),
            }
            made = Law(law, spec, training)
            made._before = lambda: self.fit(training, threads=threads, progress=progress)
            return Discovery(fields | json.loads(text), made, spec)

        both = (training._native, unseen._native)
        return finished(
            progress, lambda told: self._native.discover(*both, options, threads, told), wrapped
        )

    def known_law(self) -> Law:
        """The law of a spec in which no term is to be learned.

        >>> import leverrier
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = q^2/2")
        >>> spec.known_law().rhs(0.0, [1.0, 0.0])
        array([ 0., -1.])
        """
        return Law(self._native.known_law(), self, None)

    def law(self, path: str | os.PathLike[str]) -> Law:
        """The law in a model file that was fitted to this spec."""
        return Law(_native.Law.open(tables.path_text(path), self._native), self, None)

    def with_effect(self, effect: str) -> Spec:
        """The spec with an effect of the catalogue in its text, as ``viscous_drag(q)``.

        >>> import leverrier
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = span{ q^2 }")
        >>> len(spec.with_effect("viscous_drag(q)").terms)
        2
        """
        return Spec(self._native.with_effect(_text(effect, "an effect")))

    def without(self, effect: str) -> Spec:
        """The spec without an effect, or without a term that has a name."""
        return Spec(self._native.without(_text(effect, "an effect")))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes its text, for :func:`leverrier.open` and the program, which need a ``data`` line
        in it to know of measurements."""
        name = tables.path_text(path)
        try:
            with builtins.open(name, "w", encoding="utf-8") as file:
                file.write(self.text)
        except (OSError, ValueError) as error:
            raise FileError(
                f"{name!r} cannot be written ({error})", "name a file in a folder that is there",
                kind="File", file=name,
            ) from error  # fmt: skip

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Spec) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)

    def __reduce__(self) -> tuple[Any, ...]:
        return parse, (self.text,)

    def __repr__(self) -> str:
        count = len(self.terms)
        of = ", ".join(self.coordinates)
        return (
            f"<leverrier.Spec: {self.system!r}, {count} term{'s'[: count != 1]} to learn, of {of}>"
        )

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.text)}</pre>"


def _text(value: object, what: str) -> str:
    if not isinstance(value, str):
        raise InvalidArgumentError(f"{value!r} is not {what}", "give it as text")
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise InvalidArgumentError(
            f"the text has half a character at {error.start}", "read it anew as UTF-8"
        ) from error
    return value


def fit_options(**given: Any) -> dict[str, Any]:
    """The options of a fit, those that are not given as they are by default."""
    options: dict[str, Any] = {
        "select": "information", "loss": "squares", "method": None, "step": None, "window": None,
        "starts": 8, "seed": 0, "sparse": True, "trainer": "gauss-newton", "memory": None,
    }  # fmt: skip
    options |= given
    options["seed"] = tables._seed(options["seed"])
    options["memory"] = _bytes(options["memory"])
    for name in ("window", "starts"):
        value = options[name]
        if value is None and name == "window":
            continue
        if not isinstance(value, Integral) or not 0 <= value < 2**32:
            raise InvalidArgumentError(f"{name} is {value!r}", "give a whole number from 0 on")
        options[name] = int(value)
    for name in ("select", "loss", "trainer"):
        _text(options[name], name)
    if options["method"] is not None:
        _text(options["method"], "an integrator")
    if options["step"] is not None:
        options["step"] = tables.number(options["step"], "step")
    return options


def _bytes(memory: int | str | None) -> int | None:
    if memory is None:
        return None
    text = str(memory).strip().upper()
    number = text.rstrip("BIKMGT ")
    try:
        found = int(float(number) * _UNITS[text[len(number) :].strip()])
    except (ValueError, KeyError, OverflowError):
        found = 0
    if not 0 < found < 2**63:
        raise InvalidArgumentError(
            f"{memory!r} is no amount of memory", "give bytes, or a text such as '2GiB'"
        )
    return found


def threads_of(threads: int | None) -> int | None:
    """A number of threads that can be started."""
    if threads is None:
        return None
    if isinstance(threads, bool) or not isinstance(threads, Integral) or not 1 <= threads <= 4096:
        raise InvalidArgumentError(f"{threads!r} threads cannot be started", "give 1 or more")
    return int(threads)


def split_fields(training: Data, unseen: Data, held_out: float, seed: int) -> dict[str, Any]:
    """How measurements were split, as in ``docs/formats.md``."""
    return {
        "fraction": held_out,
        "seed": seed,
        "training": training.runs,
        "held_out": unseen.runs,
    }
