"""Columns of whatever holds a table: NumPy, pandas, polars, pyarrow, dictionaries."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .errors import InvalidArgumentError

#: A column on its way to the library: numbers, text, or a kind that is not read and a count.
Cells = Any


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


def index_of(X: Any) -> dict[str | None, Any]:
    """The index of a table of pandas, as columns by name; None is that of an index without one,
    unless it only counts."""
    index: Any = getattr(X, "index", None)
    if not hasattr(X, "iloc") or not hasattr(index, "nlevels"):
        return {}
    if index.nlevels > 1:
        levels = [(name, index.get_level_values(name)) for name in index.names if name is not None]
        return {str(name): values for name, values in levels}
    if index.name is not None:
        return {str(index.name): index}
    return {} if index.dtype.kind in "iuO" else {None: index}


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
    array = as_numpy(values)
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


def as_numpy(values: Any) -> np.ndarray:
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
