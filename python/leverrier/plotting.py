"""Plots of a law with matplotlib: phase portrait, error by length of prediction, forces."""

from __future__ import annotations

import functools
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InvalidArgumentError, LeverrierError, NoResultError

if TYPE_CHECKING:
    from .law import Law
    from .results import Comparison
    from .tables import Data

#: Points of the phase portrait along an axis.
_GRID = 61
#: So many samples are drawn; more would hide each other.
_SAMPLES = 5000
#: A point that is known so many times worse than most says nothing.
_VAGUE = 20.0
#: How far beyond the measurements it shows, as a share of their range.
_MARGIN = 0.15


def plotted(law: Law, comparison: Comparison | None, coordinate: str | None, run: Any) -> Any:
    """The figure of a law, of what it was compared with, for one of its coordinates."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise NoResultError(
            "matplotlib, which draws the plots, is not installed",
            "pip install matplotlib; law.compare().figures needs nothing else",
            kind="NotInstalled",
        ) from None
    coordinates = law.spec.coordinates
    if coordinate is not None and coordinate not in coordinates:
        raise InvalidArgumentError(
            f"there is no coordinate `{coordinate}`", f"there are {', '.join(coordinates)}"
        )
    at = 0 if coordinate is None else coordinates.index(coordinate)
    told = law._is_fitted and len(law.distributions) > 0
    if told and run is None and law.data is not None:
        run = law.data.runs[0]
    of = law._for_run(run)
    measured = [] if law.data is None else _portraits(of, law.data, run if told else None)
    figure: Any = Figure(figsize=(10, 8), layout="constrained")
    panels = figure.subplots(2, 2)
    title = str(of).strip()
    figure.suptitle(title if len(title) < 300 else law.spec.system)
    window = _window(of, measured, at)
    _portrait(panels[0, 0], of, measured, at, window)
    _horizons(panels[0, 1], comparison)
    _force(panels[1, 0], of, measured, at, window)
    _missing(panels[1, 1], comparison, coordinates[at])
    # A notebook shows figures of pyplot by itself, and this one so.
    figure._repr_png_ = functools.partial(_png, figure)
    return figure


def _png(figure: Any) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=80)
    return buffer.getvalue()


def _rates(law: Law, states: np.ndarray) -> np.ndarray:
    """dz/dt of states in columns; of a driven law without input."""
    inputs = [0.0] * len(law.spec.inputs)
    return law.rhs(0.0, states, u=inputs) if inputs else law.rhs(0.0, states)


def _portraits(law: Law, data: Data, run: Any) -> list[tuple[np.ndarray, np.ndarray, bool]]:
    """Times and states of the longest runs (of one, where a law is that of one), and whether their
    momenta were measured."""
    degrees = len(law.spec.coordinates)
    names = law.spec.observables
    found: list[tuple[np.ndarray, np.ndarray, bool]] = []
    table = data.table()
    runs = table["run"].astype(str)
    names_of_runs, starts, counts = np.unique(runs, return_index=True, return_counts=True)
    drawn = 0
    for one in np.argsort(-counts, kind="stable"):
        name, count = names_of_runs[one], counts[one]
        if drawn + count > _SAMPLES and found or run is not None and name != str(run):
            continue
        drawn += count
        rows = slice(starts[one], starts[one] + count)
        t = table["t"][rows]
        values = np.column_stack([table[one][rows] for one in names[: 2 * degrees]])
        q, rest = values[:, :degrees], values[:, degrees:]
        seen = bool(np.isfinite(rest).any())
        are_momenta = names[degrees : 2 * degrees] == law.spec.momenta
        if not seen and len(t) > 1:
            rest = np.gradient(q, t, axis=0)
        thin = slice(None, None, 1 + count // _SAMPLES)
        t, q, rest = t[thin], q[thin], rest[thin]
        states = np.hstack([q, rest])
        if not seen or not are_momenta:
            states[:, degrees:] = _momenta(law, q, rest)
        found.append((t, states, seen))
    return found


def _momenta(law: Law, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Momenta that go with velocities, which are linear in them at every place."""
    degrees = q.shape[1]
    at = np.vstack([q.T, np.zeros_like(q.T)])
    still = _rates(law, at)[:degrees]
    inverse_masses = np.empty((len(q), degrees, degrees))
    for one in range(degrees):
        pushed = at.copy()
        pushed[degrees + one] = 1.0
        inverse_masses[:, :, one] = (_rates(law, pushed)[:degrees] - still).T
    found = np.full(q.shape, np.nan)
    for row, (matrix, rate) in enumerate(zip(inverse_masses, rates - still.T)):
        if np.isfinite(matrix).all() and np.isfinite(rate).all():
            found[row] = np.linalg.lstsq(matrix, rate, rcond=None)[0]
    return found


def _window(law: Law, measured: list[Any], at: int) -> tuple[np.ndarray, np.ndarray]:
    """The ranges of a coordinate and its momentum that are drawn."""
    degrees = len(law.spec.coordinates)
    axes = []
    for component in (at, degrees + at):
        values = np.concatenate(
            [states[:, component] for _, states, _ in measured] or [np.zeros(0)]
        )
        values = values[np.isfinite(values)]
        low, high = (values.min(), values.max()) if values.size else (-1.0, 1.0)
        margin = _MARGIN * (high - low) or 1.0
        axes.append(np.linspace(low - margin, high + margin, _GRID))
    return axes[0], axes[1]


def _grid(law: Law, at: int, across: int, window: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Rates over two components of the state, shape (2n, across, at); the others are 0."""
    first, second = np.meshgrid(*window)
    states = np.zeros((2 * len(law.spec.coordinates), first.size))
    states[at], states[across] = first.ravel(), second.ravel()
    return _rates(law, states).reshape(-1, *first.shape)


def _portrait(axes: Any, law: Law, measured: list[Any], at: int, window: Any) -> None:
    degrees = len(law.spec.coordinates)
    if degrees == 1:
        try:
            rates = _grid(law, at, degrees + at, window)
            if np.isfinite(rates).all():
                axes.streamplot(*window, rates[at], rates[degrees + at], color="0.8", linewidth=0.7,
                                arrowsize=0.7)  # fmt: skip
        except LeverrierError:
            pass  # the measurements are shown all the same
    for number, (_, states, seen) in enumerate(measured):
        label = "measured" if seen else "measured (momenta of differences)"
        axes.plot(states[:, at], states[:, degrees + at], ".", color="tab:blue", markersize=2,
                  label=label if number == 0 else None)  # fmt: skip
    motion = _followed(law, measured)
    if motion is not None:
        axes.plot(motion[:, at], motion[:, degrees + at], color="tab:orange", linewidth=1,
                  label="predicted from the start of a run")  # fmt: skip
    if measured:
        axes.legend(loc="upper right", fontsize="small", markerscale=3)
    axes.set(title="Phase portrait", xlabel=law.spec.coordinates[at], ylabel=law.spec.momenta[at])


def _followed(law: Law, measured: list[Any]) -> np.ndarray | None:
    """The motion from the first complete state of the longest run."""
    if law.spec.inputs or not measured or not measured[0][2]:
        return None
    t, states, _ = measured[0]
    known = np.flatnonzero(np.isfinite(states).all(axis=1))
    if known.size < 2:
        return None
    try:
        return law.predict(states[known[0]], np.unique(t[known[0] :])).states
    except LeverrierError:
        return None


def _horizons(axes: Any, comparison: Comparison | None) -> None:
    axes.set(title="Error by length of prediction", xlabel="duration", ylabel="error / noise")
    if comparison is None or not comparison.horizons:
        return _said(axes, "no measurements to compare with")
    for name, label, color in (
        ("training", "training", "tab:blue"), ("held_out", "held out", "tab:orange"),
    ):  # fmt: skip
        points = [(one.duration, one[name]) for one in comparison.horizons if one[name] is not None]
        if points:
            axes.plot(*zip(*points), "o-", color=color, markersize=3, label=label)
    axes.axhline(1.0, color="0.6", linewidth=0.8)
    axes.set(xscale="log", yscale="log")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.5), max(high, 2.0))
    axes.legend(fontsize="small")
    return None


def _force(axes: Any, law: Law, measured: list[Any], at: int, window: Any) -> None:
    """The force over phase space; of several coordinates over two of them, where all is at rest."""
    degrees, name = len(law.spec.coordinates), law.spec.coordinates[at]
    across = degrees + at if degrees == 1 else (at + 1) % degrees
    names = [*law.spec.coordinates, *law.spec.momenta]
    axes.set(title=f"Force on {name}" + ("" if degrees == 1 else " at rest"), xlabel=name)
    axes.set(ylabel=names[across])
    window = window if degrees == 1 else (window[0], _window(law, measured, across)[0])
    try:
        force = _grid(law, at, across, window)[degrees + at]
    except LeverrierError as error:
        return _said(axes, str(error))
    largest = np.nanmax(np.abs(force), initial=0.0, where=np.isfinite(force)) or 1.0
    mesh = axes.pcolormesh(
        *window, force, cmap="RdBu_r", vmin=-largest, vmax=largest, rasterized=True
    )
    axes.figure.colorbar(mesh, ax=axes)
    return None


def _missing(axes: Any, comparison: Comparison | None, name: str) -> None:
    axes.set(title=f"Missing force on {name}")
    maps = [] if comparison is None else [one for one in comparison.maps if one.on == name]
    maps = [one for one in maps if one.points]
    if not maps:
        return _said(axes, "too few measurements to tell a missing force")
    told = min(maps, key=lambda one: 1.0 if one.p_value is None else one.p_value)
    points = np.asarray(told.points, dtype=np.float64)
    value, force, error = points[points[:, 2] < _VAGUE * np.median(points[:, 2])].T
    axes.errorbar(value, force, 2 * error, fmt="o", markersize=3, capsize=2)
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    axes.set(xlabel=told.against, ylabel="force, ± two standard errors")
    return None


def _said(axes: Any, text: str) -> None:
    axes.text(0.5, 0.5, text, ha="center", va="center", wrap=True, transform=axes.transAxes)
    axes.set(xticks=[], yticks=[])
