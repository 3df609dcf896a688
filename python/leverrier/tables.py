"""Measurements from whatever holds a table: NumPy, pandas, polars, pyarrow, dictionaries, files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from .errors import DataError, InvalidArgumentError
from .results import Record, Table, record
from .shown import html_table, short, text_table

if TYPE_CHECKING:
    from .spec import Spec

#: A column on its way to the library: numbers, text, or a kind that is not read and a count.
Cells = Any


class Data:
    """Measurements of a spec's observables: runs of samples with true times.

    Made by :meth:`leverrier.Spec.data`; nothing is resampled or filled in, and what was not
    measured is NaN.

    >>> import leverrier
    >>> data = leverrier.open("examples/damped-pendulum/fit.ham").data()
    >>> data.samples, len(data.runs), data.observables
    (968, 8, ['q', 'p'])
    """

    def __init__(self, native: _native.Data) -> None:
        self._native = native

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
        return self._native.warnings

    @property
    def report(self) -> Record:
        """The data report of ``docs/formats.md``."""
        return record(self._native.report_json())

    def split(self, held_out: float = 0.25, seed: int = 0) -> tuple[Data, Data]:
        """Training and held-out measurements: whole runs where there are several, else stretches
        of one. The same seed makes the same choice."""
        training, unseen = self._native.split(number(held_out, "held_out"), _seed(seed))
        return Data(training), Data(unseen)

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
        return Data(_native.Data.open(native, None if X is None else path_text(X)))
    columns = named_columns(X)
    if columns is not None:
        return _of_columns(spec, columns, t, run)
    if _is_list_of_runs(X):
        if u is not None:
            u = np.concatenate([np.asarray(one) for one in u])
        X, t, run = _joined(X, t, run)
    return _of_array(spec, X, t, run, u)


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


def _of_columns(spec: Spec, columns: dict[str, Any], t: Any, run: Any) -> Data:
    for name, values in columns.items():
        if np.ndim(values) == 0:
            raise DataError(
                f"the column is {values!r:.40}",
                "give one value for each sample",
                kind="Data",
                column=name,
            )
    rows = len(next(iter(columns.values()), ()))
    time_name = _column(columns, t, "t", rows)
    run_name = _column(columns, run, "run", rows)
    read = [(name, cells(values)) for name, values in columns.items()]
    return Data(_native.Data.from_columns(spec._native, read, time_name, run_name))


def _column(columns: dict[str, Any], given: Any, name: str, rows: int) -> str | None:
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
    columns[name] = _times(given, rows, None) if name.startswith("t") else np.asarray(given)
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
    times = _times(t, array.shape[0], run)
    columns = [array[:, at] for at in range(array.shape[1])]
    if u is None and spec.inputs:
        raise InvalidArgumentError(
            f"the measured inputs {', '.join(spec.inputs)} are missing",
            "give u= with a column for each",
        )
    columns += [] if u is None else inputs_of(spec, u, array.shape[0])
    return Data(_native.Data.from_samples(spec._native, times, runs, columns))


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


def _times(t: Any, rows: int, run: Any) -> np.ndarray:
    array = np.asarray(t)
    if array.dtype.kind in "mM":
        raise DataError(
            "the times are dates" if array.dtype.kind == "M" else "the times are durations",
            "give numbers: (t - t[0]) / np.timedelta64(1, 's') are seconds since the start",
            kind="Data",
            column="t",
        )
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


def _is_list_of_runs(X: Any) -> bool:
    return isinstance(X, Sequence) and bool(X) and all(getattr(one, "ndim", 0) == 2 for one in X)


def _joined(X: Any, t: Any, run: Any) -> tuple[Any, Any, Any]:
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
        if len(t) != len(X):
            raise InvalidArgumentError(
                f"times of {len(t)} runs for {len(X)} runs",
                "give t= as a list with the times of each run, or as the time step",
            )
        for at, (times, length) in enumerate(zip(t, lengths)):
            if np.shape(times) != (length,):
                raise InvalidArgumentError(
                    f"run {at + 1} has {length} samples and times of shape {np.shape(times)}",
                    "give one time for each sample",
                )
        t = np.concatenate([np.asarray(times) for times in t])
    return np.concatenate(X), t, runs


def named_columns(X: Any) -> dict[str, Any] | None:
    """The columns of a table by name; None for what has no names."""
    if isinstance(X, Mapping):
        return {str(name): values for name, values in X.items()}
    if isinstance(X, np.ndarray):
        return {name: X[name] for name in X.dtype.names} if X.dtype.names else None
    if hasattr(type(X), "collect_schema") and not hasattr(type(X), "get_column"):  # lazy, of polars
        return named_columns(X.collect())
    if hasattr(X, "column_names") and hasattr(X, "column"):  # a table of pyarrow
        return {str(name): X.column(at) for at, name in enumerate(X.column_names)}
    if hasattr(X, "columns") and hasattr(X, "iloc"):  # pandas
        if X.columns.nlevels > 1 or not X.columns.is_unique:
            raise InvalidArgumentError(
                "the columns of the table have no names of their own",
                "rename them: every column needs one name that no other has",
            )
        return {str(name): X[name] for name in X.columns}
    if hasattr(X, "columns") and hasattr(X, "get_column"):  # polars
        return {str(name): X.get_column(name) for name in X.columns}
    if hasattr(X, "__arrow_c_stream__") and not hasattr(X, "__array__"):
        return named_columns(_imported(X))
    return None


def index_of(X: Any) -> dict[str, Any]:
    """The index of a table of pandas, as columns by name: ``t`` where it has none and is no count."""
    index = getattr(X, "index", None)
    if not hasattr(X, "iloc") or index is None:
        return {}
    if index.nlevels > 1:
        return {str(name): index.get_level_values(name) for name in index.names if name is not None}
    if index.name is not None:
        return {str(index.name): index}
    return {} if index.dtype.kind in "iuO" else {"t": index}


def _imported(stream: Any) -> Any:
    """A table of whatever speaks the Arrow PyCapsule interface, through whoever is installed."""
    try:
        import pyarrow

        return pyarrow.table(stream)
    except ImportError:
        pass
    try:
        import polars

        return polars.DataFrame(stream)
    except ImportError:
        raise InvalidArgumentError(
            f"a {type(stream).__name__} is read through pyarrow or polars, and neither is installed",
            "install one of them, or give a dictionary of NumPy arrays",
        ) from None


def cells(values: Any) -> Cells:
    """A column as the library takes it: NumPy's own memory where it holds doubles."""
    array = _as_numpy(values)
    if array.ndim != 1:
        return ("lists", len(array))
    kind = array.dtype.kind
    if kind in "fiub":
        return np.asarray(array, dtype=np.float64)
    if kind in "mMc":
        return ({"m": "durations", "M": "dates", "c": "complex"}[kind], len(array))
    if kind in "US":
        return [str(value) for value in array.astype(str)]
    return _of_objects(array)


def _as_numpy(values: Any) -> np.ndarray:
    dtype = getattr(values, "dtype", None)
    # Numbers of pandas that may be missing would become objects.
    if getattr(dtype, "_is_numeric", False) and hasattr(values, "to_numpy"):
        return values.to_numpy(dtype=np.float64, na_value=np.nan)
    if hasattr(values, "combine_chunks"):  # pyarrow
        return values.to_numpy()
    if np.ma.isMaskedArray(values) and values.dtype.kind in "fiub":
        return np.ma.filled(values.astype(np.float64), np.nan)
    return values.to_numpy() if hasattr(values, "to_numpy") else np.asarray(values)


def _of_objects(array: np.ndarray) -> Cells:
    missing = [_is_missing(value) for value in array]
    known = [value for value, absent in zip(array, missing) if not absent]
    if all(isinstance(value, str) for value in known):
        return ["" if absent else value for value, absent in zip(array, missing)]
    if all(isinstance(value, (int, float, np.number)) for value in known):
        filled = [np.nan if absent else value for value, absent in zip(array, missing)]
        return np.asarray(filled, dtype=np.float64)
    return ("objects", len(array))


def _is_missing(value: Any) -> bool:
    """Whether it is None, NaN, or the NA of pandas, which is neither equal nor unequal."""
    try:
        return value is None or bool(value != value)
    except TypeError:
        return True
    except ValueError:
        return False
