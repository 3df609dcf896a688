"""Motions: the equations as a function, what they predict, and whose numbers they take."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from . import _native
from .errors import InvalidArgumentError
from .results import Record, Table
from .tables import number


def of_group(one: Record, run: Any) -> Record:
    """The value that a run, or a group of runs, has of a number of its own."""
    by = "run" if one.per == "run" else f"group of `{one.per}`"
    groups = [value.group for value in one["values"]]
    shown = ", ".join(groups[:12]) + (", ..." if len(groups) > 12 else "")
    given = run.get(one.per) if isinstance(run, Mapping) else run
    hint = f"give run= as one of {shown}"
    if given is None:
        raise InvalidArgumentError(f"`{one.name}` has another value in every {by}", hint)
    for value in one["values"]:
        if value.group == str(given):
            return value
    raise InvalidArgumentError(f"`{one.name}` has no value of the {by} {given!r}", hint)


class VectorField:
    """The equations of motion as a function, compiled: ``field(t, z)`` is dz/dt.

    ``z`` has coordinates, then momenta; an array of shape (2n, m) has m states in its columns, as
    ``scipy.integrate.solve_ivp(..., vectorized=True)`` gives them.
    """

    def __init__(self, native: _native.VectorField, size: int) -> None:
        self._native = native
        self._size = size

    def __call__(self, t: float, z: Any) -> np.ndarray:
        return self._of(t, z, self._native.rates, True)

    def energy(self, t: float, z: Any) -> Any:
        """H of a state, or of many in columns."""
        return self._of(t, z, self._native.energies, False)

    def _of(self, t: float, z: Any, function: Any, vector: bool) -> Any:
        t = number(t, "t")
        try:
            states = np.asarray(z, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidArgumentError(f"z must be numbers ({error})", "give a state") from error
        if states.ndim not in (1, 2) or states.shape[0] != self._size:
            raise InvalidArgumentError(
                f"z has the shape {states.shape}",
                f"give {self._size} numbers, coordinates before momenta, or columns of them",
            )
        flat = np.ascontiguousarray(states.T).reshape(-1)
        if flat.size == 0:
            return np.zeros(states.shape if vector else states.shape[1:])
        out = function(t, flat)
        if vector:
            return out if states.ndim == 1 else out.reshape(states.shape[1], -1).T
        return out if states.ndim == 2 else float(out[0])


class Trajectory(Table):
    """A predicted motion: ``t`` and the components of the state by name, ``states`` as an array
    of samples by components, ``method`` and ``energy_drift`` of the integration."""

    def __init__(self, t: np.ndarray, states: np.ndarray, names: list[str]) -> None:
        super().__init__({"t": t} | {name: states[:, at] for at, name in enumerate(names)})
        self.t = t
        self.states = states
        self.names = names
        self.method = ""
        self.energy_drift = 0.0
