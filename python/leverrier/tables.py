"""Measurements from whatever holds a table: NumPy, pandas, polars, pyarrow, dictionaries, files."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from .columns import as_numpy, cells, index_of, named_columns
from .errors import DataError, InvalidArgumentError
from .results import Record, Table, record
from .shown import html_table, short, text_table
from .times import Names, numbers_of

if TYPE_CHECKING:
    from .spec import Spec


class Data:
    """Measurements of a spec's observables: runs of samples with true times.

    Made by :meth:`leverrier.Spec.data`; nothing is resampled or filled in, and what was not
    measured is NaN.

    >>> import leverrier
    >>> data = leverrier.open("examples/damped-pendulum/fit.ham").data()
    >>> data.samples, len(data.runs), data.observables
    (968, 8, ['q', 'p'])
    """

    def __init__(self, native: _native.Data, spec: Spec, kept: Any = None) -> None:
        self._native = native
        self._spec = spec
        # What it was made of, where the library does not give it back.
        self._kept = kept
        self._warnings: list[str] | None = None

    @property
    def samples(self) -> int:
        """Samples of all runs."""
        return self._native.samples

    @property
    def runs(self) -> list[str]:
        """Names of the runs."""
        return self._native.runs

    @property
    def observables(self) -> list[str]:
        """Coordinates, then momenta or velocities."""
        return self._native.observables

    @property
    def warnings(self) -> list[str]:
        """What deserves a look before a fit, and what was put right, as sentences."""
        return self._native.warnings if self._warnings is None else self._warnings

    @property
    def report(self) -> Record:
        """The data report of ``docs/formats.md``."""
        return record(self._native.report_json())

    def split(self, held_out: float = 0.25, seed: int = 0) -> tuple[Data, Data]:
        """Training and held-out measurements: whole runs where there are several, else stretches
        of one. The same seed makes the same choice."""
        held_out, seed = number(held_out, "held_out"), _seed(seed)
        both = self._native.split(held_out, seed)
        parts = [
            Data(
                native,
                self._spec,
                None if self._kept is None else ("part", self, held_out, seed, at),
            )
            for at, native in enumerate(both)
        ]
        return parts[0], parts[1]

    def to_pandas(self) -> Any:
        """One row a sample: run, time and observables."""
        return self.table().to_pandas()

    def table(self) -> Table:
        """One row a sample: run, time and observables."""
        native, count = self._native, range(len(self.runs))
        times = [native.times(run) for run in count]
        runs = [name for name, of in zip(self.runs, times) for _ in of]
        columns: dict[str, Any] = {"run": runs, "t": np.concatenate(times)}
        for name in self.observables:
            columns[name] = np.concatenate([native.values(run, name) for run in count])
        return Table(columns)

    def only(self, *runs: Any) -> Data:
        """The measurements of these runs alone, by name.

        >>> import leverrier
        >>> data = leverrier.open("examples/damped-pendulum/fit.ham").data()
        >>> data.only(3, 5).runs
        ['3', '5']
        """
        names = [str(run) for run in runs]
        unknown = [name for name in names if name not in self.runs]
        if unknown or not names:
            told = f"there is no run {', '.join(unknown)}" if unknown else "no run is named"
            raise InvalidArgumentError(told, f"the runs are {', '.join(self.runs[:30])}")
        if self._kept is not None:
            raise InvalidArgumentError(
                "runs of measurements with inputs or groups are not taken apart",
                "give the measurements of these runs to spec.data",
            )
        return self._rebuilt(names)

    def _rebuilt(self, runs: list[str] | None = None) -> Data:
        """The same from its values: those of some runs, or of all."""
        table = self.table()
        mask = np.isin(table["run"], self.runs if runs is None else runs)
        columns = [np.ascontiguousarray(table[name][mask]) for name in self.observables]
        names = [str(one) for one in table["run"][mask]]
        native = _native.Data.from_samples(self._spec._native, table["t"][mask], names, columns)
        return Data(native, self._spec)

    def __reduce__(self) -> tuple[Any, ...]:
        if self._kept is None:
            table = self.table()
            columns = [table[name] for name in self.observables]
            kept: Any = ("samples", table["t"], [str(one) for one in table["run"]], columns)
        elif self._kept[0] == "file":
            raise InvalidArgumentError(
                "measurements of a file with inputs or groups are not pickled",
                "pickle the name of the file, or give spec.data a table (pandas.read_csv reads one)",
            )
        else:
            kept = self._kept
        return _again, (self._spec, kept, self._kept is not None, self.warnings)

    def __repr__(self) -> str:
        runs = len(self.runs)
        of = ", ".join(self.observables)
        head = f"<leverrier.Data: {self.samples} samples of {of} in {runs} run{'s'[: runs != 1]}>"
        return "\n".join([head, text_table(*self._columns()), *self.warnings])

    def _repr_html_(self) -> str:
        return html_table(*self._columns()) + self.table().head(10)._repr_html_()

    def _columns(self) -> tuple[list[str], list[list[str]]]:
        """What the columns hold: names, and cells."""
        names = ["measured", "missing", "minimum", "maximum", "mean", "spread"]
        rows = [[one.name, *(short(one[name]) for name in names)] for one in self.report.columns]
        return ["column", *names], rows


def number(value: Any, name: str) -> float:
    """A single number."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InvalidArgumentError(f"{name} is {value!r}", "give a number") from None


def path_text(path: Any) -> str:
    """The name of a file, in text that can be written."""
    try:
        text = os.fsdecode(path)
        text.encode()
    except (TypeError, UnicodeEncodeError):
        raise InvalidArgumentError(f"{path!r} is no name of a file", "give it as text") from None
    return text


def _seed(seed: int) -> int:
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or not 0 <= seed < 2**64:
        raise InvalidArgumentError(
            f"{seed!r} is no seed", "give a whole number from 0 on: the same makes the same result"
        )
    return int(seed)


def data(spec: Spec, X: Any, t: Any, run: Any, u: Any = None) -> Data:
    """Measurements for a spec, from whatever the user has."""
    native = spec._native
    is_array = not (X is None or isinstance(X, (Data, str, os.PathLike)))
    if u is not None and (not is_array or named_columns(X) is not None):
        raise InvalidArgumentError(
            "u does not go with these data: a table has the inputs among its columns",
            "leave it out, or give X as an array",
        )
    if isinstance(X, Data):
        _no_more(t, run, "the data have their times and runs")
        return X
    if X is None or isinstance(X, (str, os.PathLike)):
        _no_more(t, run, "the spec's `data` line names the columns of a file")
        file = _native.Data.open(native, None if X is None else path_text(X))
        return Data(file, spec, ("file",) if _is_kept(spec) else None)
    columns = named_columns(X)
    if columns is not None:
        return _of_columns(spec, columns, index_of(X), t, run)
    if _is_list_of_runs(X, len(spec.observables)):
        X, t, run, u = _joined(list(X), t, run, u)
    return _of_array(spec, X, t, run, u)


def _is_kept(spec: Spec) -> bool:
    """Whether measurements have columns that the library does not give back."""
    groups = re.search(r"\bper\s+(?!run\b)\w", re.sub(r"#[^\n]*", "", spec.text))
    return bool(spec.inputs) or groups is not None


def _again(spec: Spec, kept: tuple[Any, ...], keep: bool, warnings: list[str]) -> Data:
    """Measurements from what was pickled."""
    kind, *rest = kept
    if kind == "part":
        whole, held_out, seed, at = rest
        made = whole.split(held_out, seed)[at]
    elif kind == "columns":
        made = Data(_native.Data.from_columns(spec._native, *rest), spec, kept)
    else:
        made = Data(_native.Data.from_samples(spec._native, *rest), spec, kept if keep else None)
    # What was put right before is told still.
    made._warnings = warnings
    return made


def inputs_of(spec: Spec, u: Any, rows: int) -> list[np.ndarray]:
    """The columns of the measured inputs that a spec names."""
    array = _numbers(u, "u")
    array = array[:, None] if array.ndim == 1 else array
    if not spec.inputs or array.shape != (rows, len(spec.inputs)):
        names = ", ".join(spec.inputs) or "none"
        raise InvalidArgumentError(
            f"u has the shape {array.shape}; the spec's inputs are: {names}",
            f"give an array of {rows} samples by {len(spec.inputs)} columns",
        )
    return [array[:, at] for at in range(array.shape[1])]


def _no_more(t: Any, run: Any, why: str) -> None:
    if t is not None or run is not None:
        raise InvalidArgumentError(f"t and run do not go with these data: {why}", "leave them out")


def _of_columns(
    spec: Spec, columns: dict[str, Any], index: dict[str | None, Any], t: Any, run: Any
) -> Data:
    for name, values in columns.items():
        if np.ndim(values) == 0:
            raise DataError(
                f"the column is {values!r:.40}",
                "give one value for each sample",
                kind="Data",
                column=name,
            )
    names = Names(spec)
    named = {names.time, names.run, *(one for one in (t, run) if isinstance(one, str))}
    for given, values in index.items():
        # An index without a name has the times.
        name = (names.time or "t") if given is None else given
        if name not in columns and (name in named or names.time_of([name]) or names.is_run(name)):
            columns[name] = values
    rows = len(next(iter(columns.values()), ()))
    # Without a word of it in the spec.
    by_name = run is None and names.run is None
    time_name = _column(columns, t, "t", rows, names.table_unit)
    run_name = _column(columns, run, "run", rows)
    when = time_name or names.time_of(columns)
    if by_name and run_name is None and when is not None:
        free = (name for name in columns if name not in spec.observables)
        run_name = next((name for name in free if names.is_run(name)), None)
    if when is not None:
        dates = numbers_of(columns[when], names.table_unit)
        columns[when] = columns[when] if dates is None else dates
    read = [(name, cells(values)) for name, values in columns.items()]
    with _hinted(t is None or run is None):
        native = _native.Data.from_columns(spec._native, read, time_name, run_name)
    kept = ("columns", [(name, _copied(one)) for name, one in read], time_name, run_name)
    return Data(native, spec, kept if _is_kept(spec) else None)


def _copied(values: Any) -> Any:
    return values.copy() if isinstance(values, np.ndarray) else values


@contextmanager
def _hinted(wanted: bool) -> Iterator[None]:
    """Says how the arguments help where the library speaks of the spec's `data` line."""
    try:
        yield
    except DataError as error:
        if wanted and error.hint and "data" in error.hint:
            error.hint += "; or give t= and run= as names of columns or as arrays"
        raise


def _column(
    columns: dict[str, Any], given: Any, name: str, rows: int, unit: str = ""
) -> str | None:
    """The name of the column that is given by its name or by its values."""
    if given is None:
        return None
    if isinstance(given, str):
        if given not in columns:
            known = ", ".join(f"`{one}`" for one in list(columns)[:30])
            raise DataError(
                f"there is no column `{given}`; there are {known}",
                f"give {name} as the name of a column, or as an array",
                kind="Data",
                column=given,
            )
        return given
    while name in columns:
        name += "_"
    columns[name] = _times(given, rows, None, unit) if name.startswith("t") else np.asarray(given)
    return name


def _of_array(spec: Spec, X: Any, t: Any, run: Any, u: Any) -> Data:
    observables = spec.observables
    half = len(observables) // 2
    array = _numbers(X, "X")
    if array.ndim == 1 and half == 1:
        array = array[:, None]
    if array.ndim != 2 or array.shape[1] not in (half, 2 * half):
        raise InvalidArgumentError(
            f"X has the shape {array.shape}, but the spec is about {', '.join(observables)}",
            f"give an array of samples by {half} columns (the coordinates) or {2 * half}, in this "
            "order; for many runs, stack them and name the run of every row with run=",
        )
    if t is None:
        raise InvalidArgumentError(
            "the times of the samples are missing", "give t= as an array, or as the time step"
        )
    runs = None if run is None else cells(_one_dimensional(run, array.shape[0], "run"))
    times = _times(t, array.shape[0], run, Names(spec).unit)
    columns = [array[:, at] for at in range(array.shape[1])]
    if u is None and spec.inputs:
        raise InvalidArgumentError(
            f"the measured inputs {', '.join(spec.inputs)} are missing",
            "give u= with a column for each",
        )
    columns += [] if u is None else inputs_of(spec, u, array.shape[0])
    with _hinted(run is None):
        native = _native.Data.from_samples(spec._native, times, runs, columns)
    kept = ("samples", times.copy(), _copied(runs), [one.copy() for one in columns])
    return Data(native, spec, kept if _is_kept(spec) else None)


def _numbers(values: Any, name: str) -> np.ndarray:
    try:
        array = np.asarray(values)
    except Exception as error:
        raise InvalidArgumentError(
            f"{name} is no array: {error}", "give rows of the same length"
        ) from error
    if np.ma.isMaskedArray(values):
        array = np.ma.filled(values.astype(np.float64), np.nan)
    if array.dtype.kind == "c":
        raise InvalidArgumentError(
            f"{name} has complex numbers (Complex data not supported)",
            "give real and imaginary parts as columns of their own",
        )
    try:
        return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{name} holds what is not numbers ({_first_wrong(array)})",
            "give numbers alone, NaN where nothing was measured",
            kind="Data",
        ) from error


def _first_wrong(array: np.ndarray) -> str:
    for at, value in np.ndenumerate(array):
        try:
            float(value)
        except (TypeError, ValueError):
            place = f" at [{', '.join(str(one) for one in at)}]" if at else ""
            return f"{value!r:.40}{place}"
    return f"of type {array.dtype}"


def _one_dimensional(values: Any, rows: int, name: str) -> np.ndarray:
    array = np.asarray(values)
    if array.ndim != 1 or array.shape[0] != rows:
        raise InvalidArgumentError(
            f"{name} has the shape {array.shape}, but there are {rows} samples",
            f"give one value of {name} for each sample",
        )
    return array


def _times(t: Any, rows: int, run: Any, unit: str = "") -> np.ndarray:
    dates = numbers_of(t, unit)
    t = t if dates is None else dates
    times = _numbers(t, "t")
    if times.ndim == 0:
        step = float(times)
        if not (np.isfinite(step) and step > 0):
            raise InvalidArgumentError(
                f"a time step of {step} is none", "give the time between two samples, such as 0.01"
            )
        return step * _position_in_run(rows, run)
    times = _one_dimensional(times, rows, "t")
    wrong = np.flatnonzero(~np.isfinite(times))
    if wrong.size:
        raise DataError(
            f"the time is {times[wrong[0]]}",
            "give the time of every sample, or leave the sample out",
            kind="Data",
            line=int(wrong[0]) + 1,
            column="t",
        )
    return times


def _position_in_run(rows: int, run: Any) -> np.ndarray:
    if run is None:
        return np.arange(rows, dtype=np.float64)
    names = _one_dimensional(run, rows, "run")
    _, member = np.unique(names.astype(str), return_inverse=True)
    order = np.argsort(member, kind="stable")
    position = np.empty(rows)
    counts = np.bincount(member)
    position[order] = np.concatenate([np.arange(count) for count in counts])
    return position


def _is_list_of_runs(X: Any, observables: int) -> bool:
    """Whether it holds an array for each run: a list of them, or an array of three axes."""
    if isinstance(X, np.ndarray):
        return X.ndim == 3
    if not isinstance(X, Sequence) or not X:
        return False
    # Arrays of one axis are runs of one coordinate, or as many numbers as a state has.
    if all(getattr(one, "ndim", 0) == 1 for one in X):
        return observables == 2 and any(one.shape[0] > 2 for one in X)
    return all(getattr(one, "ndim", 0) == 2 for one in X)


def _joined(X: list[Any], t: Any, run: Any, u: Any) -> tuple[Any, Any, Any, Any]:
    """Runs as one array, with the run of every row."""
    X = [np.asarray(one)[:, None] if one.ndim == 1 else one for one in X]
    if len({one.shape[1] for one in X}) != 1:
        shapes = ", ".join(str(one.shape) for one in X[:5])
        raise InvalidArgumentError(
            f"the runs have the shapes {shapes}", "give the same columns for every run"
        )
    lengths = [one.shape[0] for one in X]
    names = range(1, len(X) + 1) if run is None else run
    if len(names) != len(X):
        raise InvalidArgumentError(
            f"{len(names)} names for {len(X)} runs", "give one for each, or leave run= out"
        )
    runs = np.repeat(np.asarray([str(name) for name in names]), lengths)
    if t is not None and (isinstance(t, Sequence) or np.ndim(t) != 0):
        if len(t) == lengths[0] and len(set(lengths)) == 1 and np.ndim(t[0]) == 0:
            t = [t] * len(X)  # times that all runs have in common
        t = np.concatenate([as_numpy(one) for one in _by_run(t, "times", "t", lengths)])
    if u is not None:
        u = np.concatenate([as_numpy(one) for one in _by_run(u, "inputs", "u", lengths)])
    return np.concatenate(X), t, runs, u


def _by_run(values: Any, what: str, name: str, lengths: list[int]) -> list[Any]:
    """What stands beside every run, of the same length."""
    values = list(values)
    if len(values) != len(lengths):
        raise InvalidArgumentError(
            f"{what} of {len(values)} runs for {len(lengths)} runs",
            f"give {name}= as a list with the {what} of each run"
            + (", or as the time step" if name == "t" else ""),
        )
    for at, (one, length) in enumerate(zip(values, lengths)):
        shape = np.shape(one)
        if shape[:1] != (length,) or (name == "t" and len(shape) != 1):
            raise InvalidArgumentError(
                f"run {at + 1} has {length} samples and {what} of shape {shape}",
                f"give one of {name} for each sample",
            )
    return values
