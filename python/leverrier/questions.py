"""What a law is asked: options, ranges, the measurements that judge it, and what supports it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from .errors import InvalidArgumentError, LeverrierError
from .results import Comparison
from .tables import number

if TYPE_CHECKING:
    from .law import Law
    from .spec import Spec
    from .tables import Data

#: A coefficient that is so many standard errors from zero supports its effect.
_SIGNIFICANT = 4.0


def diagnosis_options(correlated_noise: Any, orbits: Any, all_pairs: Any) -> dict[str, Any]:
    """What a diagnosis looks for beside the usual."""
    if not isinstance(orbits, Integral) or not 0 <= orbits < 2**32:
        raise InvalidArgumentError(f"orbits is {orbits!r}", "give a whole number from 0 on")
    return {
        "correlated_noise": bool(correlated_noise),
        "orbits": int(orbits),
        "all_pairs": bool(all_pairs),
    }


def listed(names: Any) -> list[Any]:
    """Names; one alone is none of a list of letters."""
    try:
        return [names] if isinstance(names, str) else list(names)
    except TypeError:
        raise InvalidArgumentError(
            f"{names!r} is no list of names", "give a list of texts"
        ) from None


def range_of(given: Any, name: str) -> tuple[float, float]:
    """A number, or the lower and the upper end of a range."""
    ends = list(given) if isinstance(given, (tuple, list, np.ndarray)) else [given, given]
    if len(ends) != 2:
        raise InvalidArgumentError(f"{name} is {given!r}", "give a number, or (lower, upper)")
    return number(ends[0], name), number(ends[1], name)


def ranges(given: Any, name: str) -> list[tuple[str, tuple[float, float]]]:
    """Ranges by component of the state."""
    if given is None:
        return []
    if not isinstance(given, Mapping):
        hint = 'give a dictionary, as {"q": (-1, 1)}'
        raise InvalidArgumentError(f"{name} is {given!r}", hint)
    return [(str(key), range_of(ends, f"{name}[{key!r}]")) for key, ends in given.items()]


def placed(terms: list[str], model: dict[str, Any], spec: Spec) -> list[dict[str, Any]]:
    """Terms of a spec as a model file has them: each with the place where it stands."""
    if not terms:
        raise InvalidArgumentError("no term is named", f"name some of {', '.join(spec.terms)}")
    for at, term in enumerate(terms):
        if term in terms[:at]:
            raise InvalidArgumentError(f"`{term}` is named twice", "name each term once")
        if term not in spec.terms:
            raise InvalidArgumentError(
                f"the spec has no term `{term}`", f"it has {', '.join(spec.terms)}"
            )
    known = {one["term"]: one for one in model["terms"]}
    places = ["T", "V", "H", "L", *(f"force {name}" for name in spec.coordinates)]
    return [known[term] if term in known else _placed(term, model, places, spec) for term in terms]


def _placed(term: str, model: dict[str, Any], places: list[str], spec: Spec) -> dict[str, Any]:
    """The term at the place where the spec takes it."""
    size = 1 + len(model["parameters"])
    taken = []
    for place in places:
        one: dict[str, Any] = {
            "place": place, "term": term, "name": None, "coefficient": 0.0, "standard_error": None,
            "inclusion": None, "unit": None,
        }  # fmt: skip
        tried = model | {"terms": [one], "covariance": [[0.0] * size for _ in range(size)]}
        try:
            _native.Law.from_model_json(json.dumps(tried), spec._native)
        except LeverrierError:
            continue
        taken.append(one)
    if len(taken) != 1:
        where = ", ".join(one["place"] for one in taken) or "no place that is known"
        raise InvalidArgumentError(
            f"`{term}` stands in {where}", "write a spec with the terms that are wanted, and fit it"
        )
    return taken[0]


class Judged:
    """A law with the measurements that it was learned from and those that judge it."""

    def __init__(self, law: Law, training: Data, unseen: Data, fields: dict[str, Any]) -> None:
        self.law, self.training, self.unseen, self.fields = law, training, unseen, fields

    def drawing(self, diagnosis: _native.Diagnosis | None) -> Any:
        """What draws its figures."""
        both = (self.training._native, self.unseen._native)
        return lambda: self.law._native.figures(*both, diagnosis)

    def _replace_law(self, law: Law) -> Judged:
        return Judged(law, self.training, self.unseen, self.fields)


def support(
    action: str, new: list[dict[str, Any]], before: Comparison, after: Comparison
) -> tuple[bool | None, str]:
    was, now = before.horizons[-1].held_out, after.horizons[-1].held_out
    if was is None or now is None:
        return None, "there are no held-out runs to judge by"
    fall = f"the error on held-out runs goes from {was:.2f} to {now:.2f} times the noise"
    if action.startswith("remove"):
        return now <= 1.02 * was, fall
    if not new:
        return False, f"the fit did not choose it; {fall}"
    sure = [
        one["standard_error"] is not None
        and abs(one["coefficient"]) > _SIGNIFICANT * one["standard_error"]
        for one in new
    ]
    if not all(sure):
        return False, f"a coefficient is not {_SIGNIFICANT:g} standard errors from zero; {fall}"
    return now < was, fall
