"""Laws: what was learned, what it predicts, and what it lacks."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from .errors import InvalidArgumentError
from .motion import Trajectory, VectorField, of_group
from .progress import Progress, finished, shown
from .questions import Judged, diagnosis_options, listed, range_of, ranges, support
from .results import (
    Comparison, Design, Diagnosis, Record, Revision, Rows, Table, record, unfinished,
)  # fmt: skip
from .tables import _numbers, _seed, inputs_of, number, path_text

if TYPE_CHECKING:
    from .spec import Spec
    from .tables import Data


class Law:
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
        self._of_runs: dict[tuple[str, ...], Law] = {}
        self._model: Record | None = None

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

    # What it predicts.

    def predict(
        self, start: Any, times: Any, *, u: Any = None, t_u: Any = None, run: Any = None
    ) -> Trajectory:
        """The motion from a start (coordinates, then momenta; or a dictionary of them) at the
        first of ``times``, to the limit of double precision. ``u`` has the measured inputs that
        drive it, where the spec names some: a column for each, at the times ``t_u`` (none:
        ``times``). ``run`` names the run whose numbers it takes, where runs have numbers of their
        own (``distributions``); where these go by several columns, a dictionary names a group of
        each.

        >>> import leverrier
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = q^2/2")
        >>> motion = spec.known_law().predict({"q": 1.0, "p": 0.0}, [0.0, 3.141592653589793])
        >>> round(float(motion["q"][-1]), 12)
        -1.0
        """
        law = self._for_run(run)
        if u is None:
            self._not_driven("u=, a column for each at the times t_u=")
        names = self._names
        state = [start.get(name) for name in names] if isinstance(start, dict) else start
        try:
            state = np.asarray(state, dtype=np.float64)
            times = np.asarray(times, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidArgumentError(
                f"start and times must be numbers ({error})", f"a start has {', '.join(names)}"
            ) from error
        if state.ndim != 1 or times.ndim != 1:
            raise InvalidArgumentError(
                f"start has the shape {state.shape}, times {times.shape}",
                f"give one start ({', '.join(names)}) and a list of times",
            )
        inputs = None
        if u is not None:
            at = times if t_u is None else np.asarray(t_u, dtype=np.float64)
            inputs = (at.tolist(), [one.tolist() for one in inputs_of(self.spec, u, at.size)])
        t, flat, method, drift = law._native.predict(state.tolist(), times.tolist(), inputs)
        motion = Trajectory(t, flat.reshape(len(t), -1), names)
        motion.method, motion.energy_drift = method, drift
        return motion

    def simulate(
        self,
        starts: Any,
        times: Any,
        *,
        noise: Any = 0.0,
        seed: int = 0,
        u: Any = None,
        t_u: Any = None,
        run: Any = None,
    ) -> Table:
        """Measurements as the law would give them: a table of ``run``, ``t`` and the observables,
        one run for each of ``starts``, with Gaussian noise of the standard deviation ``noise`` (a
        number, or one for each observable). What a spec says of its sensors is not in them. ``u``,
        ``t_u`` and ``run`` are those of :meth:`predict`, the same for all starts.

        The same seed makes the same numbers; they are not those of the program's ``simulate``.

        >>> import leverrier
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = q^2/2")
        >>> made = spec.known_law().simulate([[1, 0], [0, 1]], [0.0, 0.1, 0.2], noise=0.01, seed=3)
        >>> made
        <leverrier.Table: 6 rows of run, t, q, p>
        """
        starts = _numbers(starts, "starts")
        if starts.ndim != 2:
            raise InvalidArgumentError(
                f"starts has the shape {starts.shape}", "give a row for each run"
            )
        observables = self.spec.observables
        if len(observables) > len(self._names):
            raise InvalidArgumentError(
                f"`{observables[len(self._names)]}` is a measure, which is not computed here",
                "simulate with the command `leverrier simulate`, which writes all columns",
            )
        sigma = np.asarray(noise, dtype=np.float64)
        if sigma.ndim > 1 or sigma.size not in (1, len(observables)) or not np.all(sigma >= 0):
            raise InvalidArgumentError(
                f"{noise!r} is no noise of {', '.join(observables)}",
                "give a standard deviation from 0 on, or one for each",
            )
        random = np.random.default_rng(_seed(seed))
        runs, ts, rows = [], [], []
        for number, start in enumerate(starts, start=1):
            motion = self.predict(start, times, u=u, t_u=t_u, run=run)
            states = motion.states
            half = len(observables) // 2
            if observables != self._names:  # velocities are measured, not momenta
                rates = [self.rhs(t, state, run=run)[:half] for t, state in zip(motion.t, states)]
                states = np.column_stack([states[:, :half], rates])
            runs += [str(number)] * len(motion.t)
            ts.append(motion.t)
            rows.append(states)
        if not rows:
            raise InvalidArgumentError("there are no starts", "give one state for each run")
        values = np.concatenate(rows)
        values = values + sigma * random.standard_normal(values.shape)
        columns = {name: values[:, at] for at, name in enumerate(observables)}
        return Table({"run": runs, "t": np.concatenate(ts)} | columns)

    @property
    def vector_field(self) -> VectorField:
        """The equations of motion as a function, compiled once. A law whose runs have numbers of
        their own, or that measured inputs drive, has none."""
        self._for_run(None)
        self._not_driven("u= to `predict`: a function of time and state has no place for them")
        return self._compiled()

    def _compiled(self) -> VectorField:
        if self._field is None:
            self._field = VectorField(self._native.vector_field(), len(self._names))
        return self._field

    def rhs(self, t: float, z: Any, *, run: Any = None) -> np.ndarray:
        """dz/dt at a time and a state, for ``scipy.integrate.solve_ivp`` and the like. ``run`` is
        as in :meth:`predict`; a law that measured inputs drive has none.

        >>> import leverrier
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = cos(q)")
        >>> spec.known_law().rhs(0.0, [0.0, 2.0])
        array([2., 0.])
        """
        return self._for_run(run).vector_field(t, z)

    def energy(self, t: float, z: Any, *, run: Any = None) -> Any:
        """H at a time and a state, or at many states in columns; ``run`` is as in
        :meth:`predict`."""
        return self._for_run(run).vector_field.energy(t, z)

    def _not_driven(self, hint: str) -> None:
        if self.spec.inputs:
            names = ", ".join(self.spec.inputs)
            raise InvalidArgumentError(f"the law is driven by {names}, not given", f"give {hint}")

    def _for_run(self, run: Any) -> Law:
        """The law with the numbers of one run for those that runs have for themselves."""
        own = [] if not self._is_fitted else self.distributions
        if not own:
            if run is not None:
                raise InvalidArgumentError(
                    f"run is {run!r}, but no run has numbers of its own", "leave run= out"
                )
            return self
        chosen = [of_group(one, run) for one in own]
        groups = tuple(one["group"] for one in chosen)
        if groups not in self._of_runs:
            model = json.loads(self._native.model_json())
            for one, value in zip(own, chosen):
                for parameter in model["parameters"]:
                    if parameter["name"] == one.name:
                        parameter["value"] = value["value"]
            model["distributions"] = []
            native = _native.Law.from_model_json(json.dumps(model), self.spec._native)
            self._of_runs[groups] = Law(native, self.spec, self._data)
        return self._of_runs[groups]

    @property
    def _names(self) -> list[str]:
        return self.spec.coordinates + self.spec.momenta

    # What it lacks.

    def compare(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Comparison:
        """Where the law fails: errors by length of prediction, drift of the energy, the force that
        is missing.

        With measurements (as :meth:`leverrier.Spec.data` takes them) the law is held against
        these, which it has not seen. Without, its own are split, its numbers learned anew from
        one part and judged on the other.

        >>> import leverrier
        >>> law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
        >>> law.compare().horizons[-1].held_out > 3
        True
        """
        return self._compared(self._judged(X, t, run, u, held_out, seed, threads, progress), threads)

    def diagnose(
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
    ) -> Diagnosis:
        """Which physical effect the law lacks, or that nothing is missing.

        The arguments are those of :meth:`compare`, whether what is left may be noise with a memory,
        such as that of a filter, how many orbits of a body that nobody measures are fitted where
        bodies attract each other, and whether effects on two of twelve coordinates or more are asked
        for also where nothing in the spec couples the two.
        Ctrl-C raises KeyboardInterrupt with the diagnosis so far as its attribute ``best``; its
        ``verdict`` is ``interrupted``.

        >>> import leverrier
        >>> diagnosis = leverrier.open("examples/damped-pendulum/fit.ham").fit().diagnose()
        >>> diagnosis.verdict, diagnosis.missing
        ('missing', 'viscous_drag(q)')
        """
        options = diagnosis_options(correlated_noise, orbits, all_pairs)
        judged = self._judged(X, t, run, u, held_out, seed, threads, progress)
        native = judged.law._native
        both = (judged.training._native, judged.unseen._native)

        def wrapped(found: _native.Diagnosis) -> Diagnosis:
            fields = judged.fields | json.loads(found.json()) | {"interrupted": False}
            return Diagnosis(fields, judged.law, judged.drawing(found))

        def cut_short(found: _native.Diagnosis) -> Diagnosis:
            fields = judged.fields | unfinished(json.loads(found.json()))
            return Diagnosis(fields, judged.law, judged.drawing(found))

        def work(told: Progress | None) -> _native.Diagnosis:
            return native.diagnose(*both, options, threads, told)

        return finished(progress, work, wrapped, cut_short)

    def design(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        between: Sequence[str] = (),
        coefficient: str | None = None,
        within: Mapping[str, Any] | None = None,
        stay: Mapping[str, Any] | None = None,
        start_time: float | None = None,
        duration: Any = None,
        step: Any = None,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Design:
        """Which run to measure next.

        It is the run that best tells apart the effects ``between`` (or those that a diagnosis
        cannot decide between), or that best measures a ``coefficient`` (or the one that is known
        worst). ``within`` says where it may start, ``stay`` what the motion may not leave: a number
        or (lower, upper) for components of the state. So are ``duration`` and ``step``. What is
        left open is as in the measurements so far. The other arguments are those of
        :meth:`compare`.

        >>> import leverrier
        >>> law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
        >>> design = law.design(within={"q": (-1, 1), "p": 0}, duration=(5, 20))
        >>> design.start["p"], abs(design.start["q"]) <= 1
        (0.0, True)
        """
        options = {
            "between": [str(name) for name in listed(between)],
            "coefficient": None if coefficient is None else str(coefficient),
            "start": ranges(within, "within"),
            "motion": ranges(stay, "stay"),
            "from": None if start_time is None else number(start_time, "start_time"),
            "duration": None if duration is None else range_of(duration, "duration"),
            "step": None if step is None else range_of(step, "step"),
        }
        judged = self._judged(X, t, run, u, held_out, seed, threads, progress)
        native = judged.law._native
        both = (judged.training._native, judged.unseen._native)
        return finished(
            progress,
            lambda told: native.design(*both, options, threads, told),
            lambda text: Design(judged.fields | json.loads(text), judged.law),
        )

    def add(
        self,
        effect: str,
        *,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Revision:
        """The law with an effect, and whether held-out measurements support it.

        The law and its spec stay as they are; ``add(...).law`` is the new one.

        >>> import leverrier
        >>> revision = leverrier.open("examples/damped-pendulum/fit.ham").fit().add("viscous_drag")
        >>> revision.supported, [term.term for term in revision.law.terms]
        (True, ['cos(q)', '-p'])
        """
        return self._revised(f"add {effect}", self.spec.with_effect(effect), held_out, seed,
                             threads, progress)  # fmt: skip

    def remove(
        self,
        effect: str,
        *,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Revision:
        """The law without an effect or without a term that has a name, and whether held-out
        measurements speak for it: whether their error does not rise by more than 2 %."""
        return self._revised(f"remove {effect}", self.spec.without(effect), held_out, seed,
                             threads, progress)  # fmt: skip

    def _revised(
        self,
        action: str,
        spec: Spec,
        held_out: float,
        seed: int,
        threads: int | None,
        progress: bool | Progress | None,
    ) -> Revision:
        judged = self._judged(None, None, None, None, held_out, seed, threads, progress)
        seen = spec.fit(judged.training, threads=threads, progress=progress)
        after = judged._replace_law(seen)
        compared = seen._compared(after, threads)
        noise = [1.0 if one is None else one for _, one in compared.noise_floor]
        before = judged.law._compared(judged, threads, noise)
        law = spec.fit(self._own(), threads=threads, progress=progress)
        known = {(one.place, one.term) for one in judged.law.terms}
        new = [one.to_dict() for one in seen.terms if (one.place, one.term) not in known]
        supported, reason = support(action, new, before, compared)
        fields = judged.fields | {
            "action": action, "effect": new, "supported": supported, "reason": reason,
        }  # fmt: skip
        return Revision(fields, law, before, compared)

    def refit(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Law:
        """The same terms with their numbers learned anew, from other measurements."""
        data = self.spec.data(X, t=t, run=run, u=u)
        with shown(progress) as told:
            return Law(self._native.refit(data._native, threads, told), self.spec, data)

    def _own(self) -> Data:
        # A law from a file has measurements where its spec names them.
        return self._data if self._data is not None else self.spec.data()

    def _judged(
        self,
        X: Any,
        t: Any,
        run: Any,
        u: Any,
        held_out: float,
        seed: int,
        threads: int | None,
        progress: bool | Progress | None,
    ) -> Judged:
        from .spec import split_fields

        if X is not None:
            training, unseen = self._own(), self.spec.data(X, t=t, run=run, u=u)
            law, terms = self, "the law as it is, judged on measurements that were given"
            split = {"training": training.runs, "held_out": unseen.runs}
        else:
            if any(one is not None for one in (t, run, u)):
                raise InvalidArgumentError("t, run and u go with X", "give the measurements, too")
            training, unseen = self._own().split(held_out, seed)
            law = self.refit(training, threads=threads, progress=progress)
            terms = "the terms of the law, their numbers from the training part"
            split = split_fields(training, unseen, held_out, seed)
        fields = {"system": self.spec.system, "split": split, "terms_from": terms}
        return Judged(law, training, unseen, fields)

    def _compared(
        self, judged: Judged, threads: int | None, noise: list[float] | None = None
    ) -> Comparison:
        native = judged.law._native
        text = native.compare(judged.training._native, judged.unseen._native, noise, threads)
        return Comparison(judged.fields | json.loads(text), judged.law, judged.drawing(None))

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
        if self._is_fitted:
            return _again, (self.spec.text, self._native.model_json())
        return _again, (self.spec.text, None)

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
        return f"<leverrier.Law: {self._native.equations().strip()}>".replace("\n", "; ")

    def _repr_latex_(self) -> str:
        readable = json.loads(self.to_json())["readable"]["parts"]
        lines = [f"{_place(one['place'])} &= {one['latex']}" for one in readable]
        return "$$\\begin{aligned}" + r" \\ ".join(lines) + "\\end{aligned}$$"

    def _repr_html_(self) -> str | None:
        if not self._is_fitted:
            return f"<pre>{html.escape(str(self))}</pre>"
        names = ["place", "term", "coefficient", "standard_error", "unit"]
        rows = Rows(Record({name: one.get(name) for name in names}) for one in self.terms)
        return f"<pre>{html.escape(str(self))}</pre>{rows._repr_html_()}"


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
