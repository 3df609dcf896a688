"""Laws that measured inputs drive, as functions of time, state and inputs."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InvalidArgumentError
from .tables import _numbers, number

if TYPE_CHECKING:
    from .law import Law
    from .spec import Spec

#: Functions of the mini-language that NumPy calls otherwise.
_NAMES = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh"}


class DrivenField:
    """The equations of motion of a driven law: ``field(t, z, u)`` is dz/dt."""

    def __init__(self, law: Law) -> None:
        exported = json.loads(law.to_json())
        source = exported["equations"]
        self._names = [one["name"] for one in exported["coordinates"] + exported["momenta"]]
        self._time = exported["time"]["name"]
        self._inputs = law.spec.inputs
        self._known = {
            one["name"]: one["value"] for one in exported["coefficients"] + exported["parameters"]
        }
        self._rates = [one["tree"] for one in source["velocities"] + source["accelerations"]]
        self._energy = source["energy"]["tree"]
        known = {*self._names, self._time, *self._inputs, *self._known}
        for one in [*self._rates, self._energy]:
            for symbol in _symbols(one):
                if symbol not in known:
                    raise InvalidArgumentError(
                        f"the law depends on `{symbol}`, which the inputs at one time do not tell",
                        "predict(...) follows the motion under inputs of many times",
                    )

    def __call__(self, t: float, z: Any, u: Any) -> np.ndarray:
        values, shape = self._values(t, z, u)
        rates = [np.broadcast_to(_value(one, values), shape[1:]) for one in self._rates]
        return np.array(rates, dtype=np.float64)

    def energy(self, t: float, z: Any, u: Any) -> Any:
        """H of a state, or of many in columns."""
        values, shape = self._values(t, z, u)
        found = np.array(np.broadcast_to(_value(self._energy, values), shape[1:]), dtype=np.float64)
        return found if len(shape) == 2 else float(found)

    def _values(self, t: float, z: Any, u: Any) -> tuple[dict[str, Any], tuple[int, ...]]:
        t = number(t, "t")
        state = _numbers(z, "z")
        if state.ndim not in (1, 2) or state.shape[0] != len(self._names):
            raise InvalidArgumentError(
                f"z has the shape {state.shape}",
                f"give {len(self._names)} numbers, coordinates before momenta, or columns of them",
            )
        given = _numbers(u(t) if callable(u) else u, "u")
        given = given[None] if given.ndim == 0 else given
        alike = given.ndim == 1 or given.shape[1:] == state.shape[1:]
        if given.shape[0] != len(self._inputs) or not alike or given.ndim > state.ndim:
            raise InvalidArgumentError(
                f"u has the shape {given.shape}",
                f"give a number for each of {', '.join(self._inputs)} at this time, or a function "
                "of time that gives them",
            )
        values = self._known | dict(zip(self._names, state)) | dict(zip(self._inputs, given))
        return values | {self._time: t}, state.shape


def between_samples(spec: Spec, name: str) -> str:
    """What an input does between its samples: ``hold``, ``linear``, ``spline``, ``band_limited``."""
    text = re.sub(r"#[^\n]*", "", spec.text)
    found = re.search(rf"\binput\s+{re.escape(name)}\s*(?:\[[^\]]*\])?\s*\{{\s*(\w+)\s*\}}", text)
    return found.group(1) if found else "linear"


def inputs_at(
    spec: Spec, times: np.ndarray, at: np.ndarray, columns: list[np.ndarray]
) -> np.ndarray:
    """Values of the inputs at the times, a row for each."""
    if np.array_equal(times, at):
        return np.column_stack(columns)
    found = []
    for name, values in zip(spec.inputs, columns):
        kind = between_samples(spec, name)
        if kind == "hold":
            index = np.clip(np.searchsorted(at, times, side="right") - 1, 0, len(at) - 1)
            found.append(values[index])
        elif kind == "linear":
            found.append(np.interp(times, at, values))
        else:
            raise InvalidArgumentError(
                f"`{name}` is {kind} between its samples, which is not computed here",
                "give u at the times that are asked for, and leave t_u= out",
            )
    return np.column_stack(found)


def _symbols(node: Any) -> set[str]:
    if isinstance(node, list):
        return set().union(*(_symbols(one) for one in node))
    if not isinstance(node, dict):
        return set()
    if "symbol" in node:
        return {node["symbol"]}
    return set().union(*(_symbols(one) for one in node.values()))


def _value(node: dict[str, Any], values: dict[str, Any]) -> Any:
    if "number" in node:
        return node["number"]
    if "symbol" in node:
        return values[node["symbol"]]
    if "sum" in node:
        parts = (one["factor"] * _value(one["of"], values) for one in node["sum"])
        return sum(parts, node.get("constant", 0.0))
    if "product" in node:
        found: Any = 1.0
        for one in node["product"]:
            base = _value(one["base"], values)
            found = found * (base if one["exponent"] == 1.0 else np.power(base, one["exponent"]))
        return found
    if "power" in node:
        return np.power(_value(node["power"], values), _value(node["exponent"], values))
    function = getattr(np, _NAMES.get(node["function"], node["function"]))
    return function(_value(node["of"], values))
