"""What a law predicts: motions, simulated measurements, rates of change, energies."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from . import _native
from .driven import DrivenField, inputs_at
from .errors import InvalidArgumentError
from .integration import followed
from .motion import Trajectory, VectorField, of_group
from .results import Table
from .tables import _numbers, _seed, inputs_of

if TYPE_CHECKING:
    from .law import Law
    from .results import Rows
    from .spec import Spec
    from .tables import Data


class Predicting:
    """The part of :class:`leverrier.Law` that predicts."""

    _native: _native.Law
    _data: Data | None
    _field: VectorField | None
    _driven_field: DrivenField | None
    _of_runs: dict[tuple[str, ...], Law]

    if TYPE_CHECKING:

        @property
        def _is_fitted(self) -> bool: ...
        @property
        def spec(self) -> Spec: ...
        @property
        def distributions(self) -> Rows: ...

    def predict(
        self, start: Any, times: Any, *, u: Any = None, t_u: Any = None, run: Any = None
    ) -> Any:
        """The motion from a start (coordinates, then momenta; or a dictionary of them) at the
        first of ``times``, to the limit of double precision: a :class:`leverrier.Trajectory`. Of
        many starts, in rows (or with arrays in the dictionary), a list of them. Times that fall
        lead into the past.

        ``u`` has the measured inputs that drive it, where the spec names some: a column for each,
        at the times ``t_u`` (none: ``times``). ``run`` names the run whose numbers it takes, where
        runs have numbers of their own (``distributions``); where these go by several columns, a
        dictionary names a group of each.

        >>> import leverrier
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = q^2/2")
        >>> law = spec.known_law()
        >>> motion = law.predict({"q": 1.0, "p": 0.0}, [0.0, 3.141592653589793])
        >>> round(float(motion["q"][-1]), 12)
        -1.0
        >>> back = law.predict(motion.states[-1], [3.141592653589793, 0.0])
        >>> round(float(back["q"][-1]), 12)
        1.0
        >>> len(law.predict([[1, 0], [0, 1], [1, 1]], [0.0, 0.1]))
        3
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
        if isinstance(start, dict) and state.ndim == 2:
            state = state.T
        if state.ndim not in (1, 2) or times.ndim != 1:
            raise InvalidArgumentError(
                f"start has the shape {state.shape}, times {times.shape}",
                f"give one start ({', '.join(names)}) or many in rows, and a list of times",
            )
        inputs = None
        if u is not None:
            at, columns = self._driving(times, u, t_u)
            inputs = (at.tolist(), [one.tolist() for one in columns])
        if state.ndim == 1:
            return law._moved(state, times, inputs)
        return [law._moved(one, times, inputs) for one in state]

    def _driving(self, times: np.ndarray, u: Any, t_u: Any) -> tuple[np.ndarray, list[np.ndarray]]:
        """Times of the inputs, and their columns."""
        at = times if t_u is None else _numbers(t_u, "t_u")
        if at.ndim != 1:
            raise InvalidArgumentError(f"t_u has the shape {at.shape}", "give a list of times")
        return at, inputs_of(self.spec, u, at.size)

    def _moved(self, state: np.ndarray, times: np.ndarray, inputs: Any) -> Trajectory:
        names = self._names
        if times.size > 1 and np.isfinite(times).all() and (np.diff(times) < 0).all():
            return self._back(state, times, inputs)
        t, flat, method, drift = self._native.predict(state.tolist(), times.tolist(), inputs)
        motion = Trajectory(t, flat.reshape(len(t), -1), names)
        motion.method, motion.energy_drift = method, drift
        return motion

    def _back(self, state: np.ndarray, times: np.ndarray, inputs: Any) -> Trajectory:
        """The motion into the past, which the library does not follow."""
        if inputs is not None:
            raise InvalidArgumentError(
                "a motion that inputs drive is not followed into the past", "give rising times"
            )
        if state.size != len(self._names) or not np.isfinite(state).all():
            raise InvalidArgumentError(
                f"the start is {state.tolist()}", f"give finite numbers: {', '.join(self._names)}"
            )
        field = self._compiled()
        states = followed(field, state, times)
        motion = Trajectory(times, states, self._names)
        motion.method = "gragg-bulirsch-stoer"
        energies = [field.energy(t, one) for t, one in zip(times, states)]
        motion.energy_drift = float(np.max(np.abs(np.subtract(energies, energies[0]))))
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
        >>> len(made), list(made.columns)
        (6, ['run', 't', 'q', 'p'])
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
        driving = None
        for number, start in enumerate(starts, start=1):
            motion = self.predict(start, times, u=u, t_u=t_u, run=run)
            states = motion.states
            half = len(observables) // 2
            if observables != self._names:  # velocities are measured, not momenta
                if u is not None and driving is None:
                    driving = inputs_at(self.spec, motion.t, *self._driving(motion.t, u, t_u))
                given = [None] * len(motion.t) if driving is None else driving
                each = zip(motion.t, states, given)
                rates = [self.rhs(t, state, u=at, run=run)[:half] for t, state, at in each]
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
        self._not_driven(
            "u= to `predict` or `rhs`: a function of time and state has no place for it"
        )
        return self._compiled()

    def _compiled(self) -> VectorField:
        if self._field is None:
            self._field = VectorField(self._native.vector_field(), len(self._names))
        return self._field

    def rhs(self, t: float, z: Any, *, u: Any = None, run: Any = None) -> np.ndarray:
        """dz/dt at a time and a state, for ``scipy.integrate.solve_ivp`` and the like. ``u`` has
        the value of each measured input that drives the law at that time, or is a function of time
        that gives them; ``run`` is as in :meth:`predict`.

        >>> import leverrier
        >>> spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = cos(q)")
        >>> spec.known_law().rhs(0.0, [0.0, 2.0])
        array([2., 0.])
        """
        law = self._for_run(run)
        return law.vector_field(t, z) if u is None else law._driven()(t, z, u)

    def energy(self, t: float, z: Any, *, u: Any = None, run: Any = None) -> Any:
        """H at a time and a state, or at many states in columns; ``u`` and ``run`` are as in
        :meth:`rhs`."""
        law = self._for_run(run)
        return law.vector_field.energy(t, z) if u is None else law._driven().energy(t, z, u)

    def _driven(self) -> DrivenField:
        if not self.spec.inputs:
            raise InvalidArgumentError("u is given, and no input drives the law", "leave u= out")
        if self._driven_field is None:
            self._driven_field = DrivenField(cast("Law", self))
        return self._driven_field

    def _not_driven(self, hint: str) -> None:
        if self.spec.inputs:
            names = ", ".join(self.spec.inputs)
            raise InvalidArgumentError(f"the law is driven by {names}, not given", f"give {hint}")

    def _for_run(self, run: Any) -> Law:
        """The law with the numbers of one run for those that runs have for themselves."""
        law = cast("Law", self)
        own = [] if not self._is_fitted else self.distributions
        if not own:
            if run is not None:
                raise InvalidArgumentError(
                    f"run is {run!r}, but no run has numbers of its own", "leave run= out"
                )
            return law
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
            self._of_runs[groups] = type(law)(native, self.spec, self._data)
        return self._of_runs[groups]

    @property
    def _names(self) -> list[str]:
        return self.spec.coordinates + self.spec.momenta
