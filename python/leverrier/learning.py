"""The first law in one call: from arrays in memory, without a spec of one's own."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from . import columns, tables
from .errors import (
    DataError,
    InvalidArgumentError,
    LeverrierWarning,
    NoResultError,
    SpecError,
)
from .first_spec import System, potential
from .law import Law
from .progress import Progress
from .spec import Spec, parse

#: The error over whole runs, in units of the noise, from which on a law is said to miss something.
_MISFIT = 2.0
#: So many times the noise that the user knows of is more than an estimate of it may be off.
_LOUD = 1.5
#: A mass with a larger error, as a share of itself, is one that the data do not tell.
_TOLD = 0.25
#: So many measured numbers for an unknown one are few, and so many are enough.
_MEASURED = 3
_ENOUGH = 10
#: A coefficient that is so few standard errors from zero is not known.
_KNOWN = 2.0
#: Noise that is so large a share of the spread of a column leaves nothing that is explained.
_BURIED = 0.7
#: Of more runs each by itself is not looked at.
_RUNS = 50
_INTERRUPTED = "the search was interrupted: this law is the best so far"
#: A name that may stand in a spec.
_NAME = re.compile(r"[^\W\d]\w*")


def learn(
    t: Any,
    x: Any,
    *,
    v: Any = None,
    p: Any = None,
    u: Any = None,
    run: Any = None,
    names: str | Sequence[str] | None = None,
    masses: float | Sequence[float] | None = None,
    degree: int | None = None,
    harmonics: int | None = None,
    drag: bool = True,
    noise: float | Sequence[float] | None = None,
    seed: int = 0,
    threads: int | None = None,
    progress: bool | Progress | None = None,
) -> Law:
    """The law behind measured positions, in one call.

    The kinetic energy is known up to masses, the potential is a polynomial of the coordinates with
    their sines and cosines, and each coordinate may have a drag in proportion to its velocity;
    what of it the data ask for is chosen. The spec that says so is ``law.spec``: its ``text`` is
    there to be read, edited and saved, for :func:`leverrier.parse` and the program.

    Parameters
    ----------
    t : float, or array of shape (n,)
        Times of the samples, or the time step; dates count in seconds from the first. For many
        runs a list with the times of each, or times that all runs have in common. With a table
        the name of its column, or None: its column ``t`` or ``time``, or its index.
    x : array of shape (n,) or (n, d), or several
        Positions: n samples of d coordinates. For many runs a list of such arrays, or one of
        shape (runs, n, d). Or a table (pandas, polars, pyarrow, a dictionary) with a column for
        each coordinate. NaN where nothing was measured.
    v, p : like x, optional
        Measured velocities, or measured momenta.
    u : array of shape (n,) or (n, k), or a list with one for each run, optional
        Measured inputs that may drive every coordinate.
    run : array of n names, or a name for each run, optional
        Which run each sample is of; a name alone is a column of a table, as ``run`` is in any case.
    names : str or list of str, optional
        Names of the coordinates: ``x``, ``y``, ``z``, or ``x1`` and so on, where none are given.
    masses : float or list of float, optional
        Known masses (moments of inertia, of angles). Where they are not known, momenta tell them;
        of positions and velocities the mass of the first coordinate is 1, as a unit, and the
        others are told in it where forces couple the coordinates. Of one that none couples to the
        first, the mass is 1, too: its motion tells the force on a unit of mass alone.
    degree : int, optional
        Degree of the polynomial; 4 up to three coordinates, 3 up to five, else 2.
    harmonics : int, optional
        Sines and cosines of so many multiples of each coordinate, 0 for none; 1 of those whose
        range is over 1 (radian, where they are angles), unless half the way of a turn lies between
        two samples, where nothing is said.
    drag : bool
        Whether there may be a drag.
    noise : float or list of float, optional
        Standard deviation of the measurements, as far as it is known, of all columns or of each of
        x, then v or p. It is estimated in any case, and one that is far above this is told.
    seed, threads, progress
        As in :meth:`leverrier.Spec.fit`.

    Returns
    -------
    Law
        Printed, it shows its coefficients with their errors. ``law.warnings`` has what deserves a
        look, which is also told by ``LeverrierWarning``: a law that fails over whole runs, masses
        that the data do not tell, a search that Ctrl-C ended (the law is then the best so far).

    Raises
    ------
    InvalidArgumentError, DataError
        Shapes that do not go together, names that cannot be used, too few measurements.
    NoResultError
        No law of this kind follows the measurements.

    Examples
    --------
    >>> import numpy as np
    >>> import leverrier
    >>> t = np.arange(300) * 0.05
    >>> law = leverrier.learn(t, np.cos(2 * t), names="angle")
    >>> print(law)
    H = p_angle^2/2 + 2 angle^2
    >>> print(law.spec.text)
    # Written by leverrier.learn, and yours to edit.
    coordinates angle
    momenta     p_angle
    T = p_angle^2/2          # the mass of angle is the unit of mass
    V = span{ poly(angle; 4), trig(angle; 1) }
    force angle += span{ drag_angle: -rate(angle) }
    <BLANKLINE>
    """
    if v is not None and p is not None:
        raise InvalidArgumentError("v and p are both given", "give velocities or momenta")
    positions, t, run = _measured(t, x, run)
    named = positions.named if names is None else [names] if isinstance(names, str) else list(names)
    rest = v if v is not None else p
    blocks = [positions.runs]
    if rest is not None:
        blocks.append(
            _alike(_runs(rest, "v" if v is not None else "p"), positions.runs, v is not None)
        )
    count = positions.runs[0].shape[1]
    system = System(
        _named(named, count), "velocities" if v is not None else "momenta", p is not None,
        _masses(masses, count), _inputs(u),
    )  # fmt: skip
    space = potential(system.names, positions.runs, degree, harmonics)
    X: Any = [np.hstack(parts) for parts in zip(*blocks)]
    if not positions.several:
        X, u = X[0], u[0] if isinstance(u, list) and len(u) == 1 else u
    sigmas = _sigmas(noise, count * len(blocks))
    options = {"seed": seed, "threads": threads, "progress": progress}

    def fitted(fixed: set[str]) -> Law:
        spec = _parsed(system.text(space, drag, fixed))
        data = spec.data(X, t=t, run=run, u=u)
        try:
            return _best(spec, data, options)
        except DataError as error:
            if error.kind != "InsufficientData" or not _is_enough(spec, data):
                raise
            # The library counts what is left where predictions overflow.
            raise NoResultError(
                "no law of this kind follows these measurements from sample to sample",
                "give a spec with other terms to leverrier.parse, or measure more often",
                kind="NoLaw",
            ) from error

    law, untold = _with_masses(fitted, system)
    if untold:
        of = ", ".join(untold)
        law._told.append(
            f"the data do not tell the mass of {of} in that of {system.names[0]}: it is taken as 1, "
            "and forces are those on a unit of mass; give masses= where they are known"
        )
    _look(law, sigmas)
    for one in law._told:
        warnings.warn(one, LeverrierWarning, stacklevel=2)
    return law


class _Columns:
    """Positions by run, and what a table called them."""

    def __init__(self, runs: list[np.ndarray], several: bool, named: list[str] | None) -> None:
        self.runs, self.several, self.named = runs, several, named


def _measured(t: Any, x: Any, run: Any) -> tuple[_Columns, Any, Any]:
    """Positions, times and runs, whatever holds them."""
    found = columns.named_columns(x)
    if found is not None:
        index = {name or "t": values for name, values in columns.index_of(x).items()}
        positions = list(found)
        found = index | found
        if t is None or isinstance(t, str):
            t = found.pop(_chosen(found, t, ("t", "time"), "t"))
        if run is None:
            run = next((name for name in found if name.lower() == "run"), None)
        if isinstance(run, str):
            run = found.pop(_chosen(found, run, (), "run"))
        # An index has times and runs, or numbers of rows, and no positions.
        found = {name: found[name] for name in positions if name in found}
        if not found:
            raise InvalidArgumentError("the table has no column of positions", "give one for each")
        array = np.column_stack([_column(values, name) for name, values in found.items()])
        return _Columns([array], False, list(found)), t, run
    if t is None:  # perhaps a series of pandas
        t = next(iter(columns.index_of(x).values()), None)
    if t is None:
        raise InvalidArgumentError(
            "the times of the samples are missing", "give t as an array, or as the time step"
        )
    for name, given in (("t", t), ("x", x)):
        if isinstance(given, (str, bytes)):
            raise InvalidArgumentError(
                f"{name} is {given!r}, a text, and x is no table"
                if name == "t"
                else f"x is {given!r}, a text",
                "give arrays, or a table (pandas.read_csv reads one); a file is learned from by a "
                "spec, which `leverrier new` writes",
            )
    runs = _runs(x, "x")
    several = _is_several(x)
    apart = _is_several(t) or _ragged(t)
    if several and not apart and np.ndim(t) == 1:
        if len({len(one) for one in runs} | {len(t)}) != 1:
            raise InvalidArgumentError(
                f"t has {len(t)} times for runs of {', '.join(str(len(one)) for one in runs[:8])} "
                "samples",
                "give a list with the times of each run",
            )
        t = [t] * len(runs)
    elif several and not apart and np.ndim(t) == 2:
        t = list(np.asarray(t))
    return _Columns(runs, several, None), t, run


def _column(values: Any, name: str) -> np.ndarray:
    """A column of positions."""
    read = columns.cells(values)
    if not isinstance(read, np.ndarray):
        kind = read[0] if isinstance(read, tuple) else "text"
        raise DataError(
            f"the column holds {kind}",
            "give the columns of positions alone; run= names that of the runs, t that of the times",
            kind="Data",
            column=name,
        )
    return read


def _chosen(found: dict[str, Any], given: str | None, usual: Iterable[str], what: str) -> str:
    for name in [given] if given is not None else usual:
        if name in found:
            return name
    known = ", ".join(f"`{name}`" for name in list(found)[:30])
    missing = f"`{given}`" if given is not None else "of the times"
    raise DataError(
        f"there is no column {missing}; there are {known}",
        f"give {what} as the name of a column, or as an array",
        kind="Data",
    )


def _is_several(x: Any) -> bool:
    """Whether it holds runs: a list of arrays (or of lists of different lengths), or three axes."""
    if isinstance(x, (list, tuple)):
        return bool(x) and (all(hasattr(one, "ndim") and one.ndim for one in x) or _ragged(x))
    return np.ndim(x) == 3


def _ragged(x: Any) -> bool:
    return (
        isinstance(x, (list, tuple))
        and all(isinstance(one, (list, tuple)) for one in x)
        and len({len(one) for one in x}) > 1
    )


def _runs(x: Any, name: str) -> list[np.ndarray]:
    """Arrays of samples by coordinates, one for each run."""
    runs = [tables._numbers(one, name) for one in (x if _is_several(x) else [x])]
    runs = [one[:, None] if one.ndim == 1 else one for one in runs]
    shapes = [one.shape for one in runs]
    fitting = bool(shapes) and all(len(shape) == 2 and 0 not in shape for shape in shapes)
    if not fitting or len({shape[1:] for shape in shapes}) != 1:
        told = ", ".join(str(shape) for shape in shapes[:5])
        raise InvalidArgumentError(
            f"{name} has the shape {told}",
            "give samples by coordinates: (n,) or (n, d), or a list of such arrays with the same "
            "coordinates, one for each run",
        )
    return runs


def _alike(rest: list[np.ndarray], runs: list[np.ndarray], velocities: bool) -> list[np.ndarray]:
    if [one.shape for one in rest] != [one.shape for one in runs]:
        name = "v" if velocities else "p"
        told = ", ".join(str(one.shape) for one in rest[:5])
        wanted = ", ".join(str(one.shape) for one in runs[:5])
        raise InvalidArgumentError(
            f"{name} has the shape {told}, and x {wanted}", f"give {name} in the shape of x"
        )
    return rest


def _named(names: Sequence[str] | None, count: int) -> list[str]:
    if names is None:
        return list("xyz"[:count]) if count <= 3 else [f"x{i}" for i in range(1, count + 1)]
    names = [str(name) for name in names]
    if len(names) != count or len(set(names)) != count:
        raise InvalidArgumentError(
            f"the names {', '.join(names)} are not those of {count} coordinate{'s'[: count != 1]}",
            "give names= one for each, no two alike",
        )
    for name in names:
        if not _NAME.fullmatch(name):
            raise InvalidArgumentError(
                f"`{name}` cannot name a coordinate",
                "give names= of letters, digits and underscores, such as angle_1",
            )
    return names


def _masses(masses: Any, count: int) -> list[float] | None:
    if masses is None:
        return None
    array = tables._numbers(masses, "masses")
    if array.shape not in ((), (1,), (count,)) or not (np.isfinite(array) & (array > 0)).all():
        raise InvalidArgumentError(
            f"masses is {masses!r}", f"give one positive mass, or {count}: one for each coordinate"
        )
    return [float(one) for one in np.broadcast_to(array, (count,))]


def _sigmas(noise: Any, count: int) -> list[float] | None:
    if noise is None:
        return None
    array = tables._numbers(noise, "noise")
    if array.shape not in ((), (1,), (count,)) or not (np.isfinite(array) & (array > 0)).all():
        raise InvalidArgumentError(
            f"noise is {noise!r}",
            f"give a positive standard deviation, or {count}: one for each measured column",
        )
    return [float(one) for one in np.broadcast_to(array, (count,))]


def _inputs(u: Any) -> int:
    """How many inputs there are."""
    if u is None:
        return 0
    first = tables._numbers(u[0] if _is_several(u) else u, "u")
    if first.ndim not in (1, 2):
        raise InvalidArgumentError(f"u has the shape {first.shape}", "give a column for each input")
    return 1 if first.ndim == 1 else first.shape[1]


def _parsed(text: str) -> Spec:
    try:
        return parse(text)
    except SpecError as error:
        raise InvalidArgumentError(
            f"no spec can be written with these names: {error.message}", "give others as names="
        ) from error


def _best(spec: Spec, data: tables.Data, options: dict[str, Any]) -> Law:
    """The law; where Ctrl-C ends the search, the best so far."""
    try:
        law = spec.fit(data, **options)
    except KeyboardInterrupt as interrupt:
        if not isinstance(best := getattr(interrupt, "best", None), Law):
            raise
        law = best
        law._told.append(_INTERRUPTED)
    return law


def _is_enough(spec: Spec, data: tables.Data) -> bool:
    """Whether the measurements are many beside all that may be unknown."""
    unknown = len(spec.terms) + 2 * len(spec.coordinates) * len(data.runs)
    observed = set(spec.observables)
    values = sum(one.measured for one in data.report.columns if one.name in observed)
    return values >= _ENOUGH * unknown


def _with_masses(fitted: Any, system: System) -> tuple[Law, list[str]]:
    """The law with those masses that the data tell, and the names of the others."""
    untold: list[str] = []
    try:
        law = fitted(set())
    except (DataError, NoResultError):
        # Perhaps a mass was too much to ask for; what else is wrong comes again.
        if not system.open_masses:
            raise
        untold = list(system.open_masses)
        return fitted(set(untold)), untold
    if law.stop.reason == "interrupted":
        return law, []
    # Of coordinates that no force couples only the force on a unit of mass acts on the motion.
    # No error tells it: nothing at all depends on such a mass.
    units = set() if system.are_momenta else _units(law, system.names) & set(system.open_masses)
    untold = [name for name in _uncertain(law) if name not in units]
    if units or untold:
        try:
            law = fitted(units | set(untold))
        except KeyboardInterrupt:
            law._told.append(f"{_INTERRUPTED}, with masses that nothing tells")
            return law, []
    return law, untold


def _units(law: Law, names: list[str]) -> set[str]:
    """The first coordinate of each group of those that the terms of a law couple."""
    group = {name: {name} for name in names}
    for term in law.terms:
        together = set(re.findall(r"[^\W\d]\w*", term.term)) & set(names)
        joined = set().union(*(group[name] for name in together)) if together else set()
        for name in joined:
            group[name] = joined
    return {min(group[name], key=names.index) for name in names}


def _uncertain(law: Law) -> list[str]:
    """Coordinates whose mass has an error of its own size."""
    found = []
    for one in law.parameters:
        error = one.standard_error
        if error is None or not error < _TOLD * abs(one.value):
            found.append(one.name.removeprefix("m_"))
    return found


def _look(law: Law, sigmas: list[float] | None) -> None:
    """Notes what hides behind a fit that looks good."""
    data = law._data
    assert data is not None
    # Times that are no times, as those of exchanged arguments, would be put in order.
    law._told += [one for one in data.warnings if "out of order" in one]
    told = {one.name: one for one in data.report.columns}
    seen = [one for one in law.noise if told[one.observable].measured]
    values = sum(told[one.observable].measured for one in seen)
    unknown = (
        len(law.terms) + len(law.parameters) + 2 * len(law.spec.coordinates) * law.evidence.runs
    )
    if values < _MEASURED * unknown:
        law._told.append(
            f"{values} measured numbers stand against {unknown} unknown ones (starts of runs and "
            "coefficients): almost any law would fit; measure more"
        )
    for one in seen:
        if one.standard_deviation > _BURIED * told[one.observable].spread:
            law._told.append(
                f"what this law takes for noise of {one.observable} ({one.standard_deviation:.2g}) is "
                f"as large as its motion ({told[one.observable].spread:.2g}): it explains nothing"
            )
    vague = [
        f"`{one.term}`"
        for one in law.terms
        if one.standard_error is not None and abs(one.coefficient) < _KNOWN * one.standard_error
    ]
    if vague:
        law._told.append(
            f"the coefficient of {', '.join(vague)} is not known: its error is as large as itself; "
            "measure more, or offer fewer terms (degree=, harmonics=)"
        )
    if sigmas is not None:
        known = dict(zip(law.spec.observables, sigmas))
        for one in seen:
            sigma = known[one.observable]
            if one.standard_deviation > _LOUD * sigma:
                law._told.append(
                    f"the noise of {one.observable} is {one.standard_deviation:.2g} by this law, "
                    f"and {sigma:.2g} as you say: the law may miss something; law.diagnose() "
                    "looks for it"
                )
    misfit = law._misfit()
    if misfit is not None and misfit > _MISFIT:
        law._told.append(
            f"over whole runs the law errs by {misfit:.1f} times the noise: something is missing; "
            "law.diagnose() looks for it"
        )
    else:
        law._told += _odd_runs(law, data)


def _odd_runs(law: Law, data: tables.Data) -> list[str]:
    """A sentence about runs that the law fails, which the many that it does not would hide."""
    if not 1 < len(data.runs) <= _RUNS or law.spec.inputs:
        return []
    errors = {name: law._misfit(data.only(name)) for name in data.runs}
    odd = [f"`{name}` by {error:.1f}" for name, error in errors.items() if (error or 0) > _MISFIT]
    if not odd:
        return []
    told = ", ".join(odd[:5])
    return [
        f"of {len(errors)} runs the law fails {len(odd)}: it errs over run {told} times the noise; "
        "law.data.only(...) takes runs apart"
    ]
