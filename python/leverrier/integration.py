"""Motions into the past: extrapolation of the modified midpoint rule (Gragg, Bulirsch, Stoer)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .errors import NoResultError

#: Numbers of midpoint steps whose results are extrapolated.
_COUNTS = (2, 4, 6, 8, 10, 12, 14, 16)
#: The error of a step, as a share of the size of the state.
_TOLERANCE = 1e-13
#: So many steps do not lead anywhere.
_MOST = 200_000


def followed(
    field: Callable[[float, np.ndarray], np.ndarray], start: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """States at the times, which rise or fall from that of the start: shape (times, components).

    Raises :class:`leverrier.NoResultError` where the motion leaves the finite numbers.
    """
    states = [np.array(start)]
    step = times[1] - times[0] if len(times) > 1 else 0.0
    spent = 0
    for now, end in zip(times[:-1], times[1:]):
        state, t = states[-1], now
        while t != end:
            step = np.sign(end - now) * min(abs(step) or abs(end - t), abs(end - t))
            moved, error = _extrapolated(field, t, state, step)
            spent += 1
            if not np.isfinite(error) or error > 1.0:
                step *= 0.5 if not np.isfinite(error) else max(0.2, 0.9 * error ** (-1 / 15))
                if spent > _MOST or t + step == t:
                    raise NoResultError(
                        f"the motion cannot be followed back beyond t = {t:.6g}",
                        "give times that reach less far",
                        kind="Diverged",
                    )
                continue
            state, t = moved, (end if step == end - t else t + step)
            step *= min(4.0, 0.9 * max(error, 1e-10) ** (-1 / 15))
        states.append(state)
    return np.asarray(states)


def _extrapolated(
    field: Callable[[float, np.ndarray], np.ndarray], t: float, state: np.ndarray, step: float
) -> tuple[np.ndarray, float]:
    """The state after a step, and its error in units of the tolerance."""
    rows: list[list[np.ndarray]] = []
    slope = field(t, state)
    error = np.inf
    for count in _COUNTS:
        h = step / count
        before, here = state, state + h * slope
        for at in range(1, count):
            before, here = here, before + 2 * h * field(t + at * h, here)
        row = [(here + before + h * field(t + step, here)) / 2]
        # Neville's scheme in the squares of the steps, of which the error is a power series.
        for back, older in enumerate(reversed(_COUNTS[: len(rows)])):
            ratio = (count / older) ** 2
            row.append(row[back] + (row[back] - rows[-1][back]) / (ratio - 1))
        if not np.all(np.isfinite(row[-1])):
            return state, np.inf
        if rows:
            scale = np.maximum(np.abs(state), np.abs(row[-1])).max() + 1e-300
            error = float(np.abs(row[-1] - row[-2]).max() / (scale * _TOLERANCE))
            if error <= 1.0:
                return row[-1], error
        rows.append(row)
    return rows[-1][-1], error
