"""Expressions of the JSON export as those of SymPy."""

from __future__ import annotations

from typing import Any

from .results import Record

#: Functions of the mini-language that SymPy calls otherwise.
_NAMES = {"abs": "Abs"}


def equations(exported: dict[str, Any]) -> Record:
    """Energy, velocities, accelerations and forces of an export (``docs/export-json.md``)."""
    import sympy

    variables = exported["coordinates"] + exported["momenta"] + [exported["time"]]
    symbols = {one["name"]: sympy.Symbol(one["name"], real=True) for one in variables}
    numbers = {
        one["name"]: sympy.Float(one["value"])
        for one in exported["coefficients"] + exported["parameters"]
    }

    def of(expression: dict[str, Any]) -> Any:
        return _expression(expression["tree"], symbols | numbers, sympy)

    source = exported["equations"]
    return Record(
        {
            "symbols": symbols,
            "energy": of(source["energy"]),
            "velocities": [of(one) for one in source["velocities"]],
            "accelerations": [of(one) for one in source["accelerations"]],
            "forces": [of(one) for one in source["forces"]],
        }
    )


def _number(value: float, sympy: Any) -> Any:
    return sympy.Integer(int(value)) if float(value).is_integer() else sympy.Float(value)


def _expression(node: dict[str, Any], known: dict[str, Any], sympy: Any) -> Any:
    if "number" in node:
        return _number(node["number"], sympy)
    if "symbol" in node:
        return known.get(node["symbol"], sympy.Symbol(node["symbol"], real=True))
    if "sum" in node:
        parts = [
            _number(one["factor"], sympy) * _expression(one["of"], known, sympy)
            for one in node["sum"]
        ]
        return sympy.Add(_number(node.get("constant", 0.0), sympy), *parts)
    if "product" in node:
        parts = [
            _expression(one["base"], known, sympy) ** _number(one["exponent"], sympy)
            for one in node["product"]
        ]
        return sympy.Mul(*parts)
    if "power" in node:
        exponent = _expression(node["exponent"], known, sympy)
        return _expression(node["power"], known, sympy) ** exponent
    name = node["function"]
    return getattr(sympy, _NAMES.get(name, name))(_expression(node["of"], known, sympy))
