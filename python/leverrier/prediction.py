"""What a law predicts: motions, simulated measurements, rates of change, energies."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from .errors import InvalidArgumentError
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
    _of_runs: dict[tuple[str, ...], Law]
    _is_fitted: bool
    spec: Spec
    distributions: Rows

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
            self._of_runs[groups] = type(self)(native, self.spec, self._data)
        return self._of_runs[groups]

    @property
    def _names(self) -> list[str]:
        return self.spec.coordinates + self.spec.momenta
