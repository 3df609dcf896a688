"""Times: steps, numbers, dates and durations, as numbers in a spec's unit of time."""

from __future__ import annotations

import re
from datetime import date, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import DataError

if TYPE_CHECKING:
    from .spec import Spec

#: Seconds in the units of time that dates are turned into.
_SECONDS = {
    "": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0,
    "d": 86400.0, "day": 86400.0,
}  # fmt: skip
#: Names that the time of a table has, where the spec names none.
_USUAL = ("t", "time")


class Names:
    """What a spec's `data` line calls the time and the run of a table, and the units of time."""

    def __init__(self, spec: Spec) -> None:
        # Comments go; a text in quotes is no comment.
        text = re.sub(r'("[^"\n]*")|#[^\n]*', lambda found: found.group(1) or "", spec.text)
        block = re.search(r'\bdata\s+"[^"\n]*"\s*\{([^}]*)\}', text)
        inside = block.group(1) if block else ""
        column = r'("[^"\n]*"|[^\W\d]\w*)'
        time = re.search(rf"\btime\s+{column}\s*(?:\[([^\]]*)\])?", inside)
        run = re.search(rf"\brun\s+{column}", inside)
        outside = text[: block.start()] + text[block.end() :] if block else text
        own = re.search(rf"(?:^|[;\n])\s*time\s+{column}\s*(?:\[([^\]]*)\])?", outside)
        #: Column of the times, or None.
        self.time = time.group(1).strip('"') if time else None
        #: Column of the runs, or None.
        self.run = run.group(1).strip('"') if run else None
        #: Unit of the times of a table.
        self.table_unit = (time.group(2) if time else None) or (own.group(2) if own else None) or ""
        #: Unit of time in the spec.
        self.unit = (own.group(2) if own else None) or (time.group(2) if time else None) or ""

    def time_of(self, columns: Any) -> str | None:
        """The column of the times among those of a table; None where there is none."""
        if self.time is not None:
            return self.time if self.time in columns else None
        for usual in _USUAL:
            for name in columns:
                if str(name).lower() == usual:
                    return name
        return None

    def is_run(self, name: Any) -> bool:
        """Whether a column names the runs: by the spec, or as `run` where that names none."""
        return name == self.run if self.run is not None else str(name).lower() == "run"


def numbers_of(values: Any, unit: str) -> np.ndarray | None:
    """Dates or durations as numbers in a unit, dates from the first of them on; None where they
    are neither."""
    spans = _spans(values)
    if spans is None:
        return None
    if unit.strip() not in _SECONDS:
        raise DataError(
            f"the times are dates, and the spec's unit of time is [{unit}]",
            "give them as numbers in that unit",
            kind="Data",
            column="t",
        )
    # Whole nanoseconds first: a division of large numbers would round.
    seconds = spans.astype("m8[ns]").astype(np.int64) / 1e9
    return np.where(np.isnat(spans), np.nan, seconds) / _SECONDS[unit.strip()]


def _spans(values: Any) -> np.ndarray | None:
    """Durations, of dates since the first of them; None for other values."""
    array = _as_array(values)
    if array.dtype.kind == "m":
        return array
    if array.dtype.kind == "M":
        known = array[~np.isnat(array)]
        return array - (known.min() if known.size else np.datetime64(0, "s"))
    if array.dtype.kind != "O" or array.ndim > 1 or not array.size:
        return None
    if all(isinstance(one, timedelta) for one in array.flat):
        return np.asarray([_span(one) for one in array.flat]).reshape(array.shape)
    if not all(isinstance(one, date) for one in array.flat):
        return None
    try:
        # Of dates with time zones NumPy knows nothing.
        found = np.asarray([_span(one - array.flat[0]) for one in array.flat])
    except TypeError as error:
        raise DataError(
            f"the times are dates of several kinds ({error})",
            "give all of them with a time zone, or none",
            kind="Data",
            column="t",
        ) from None
    known = found[~np.isnat(found)]
    return found - (known.min() if known.size else np.timedelta64(0, "s"))


def _as_array(values: Any) -> np.ndarray:
    dtype = getattr(values, "dtype", None)
    if getattr(dtype, "tz", None) is not None:  # dates of pandas that know their zone
        values = getattr(values, "dt", values).tz_convert("UTC")
        values = getattr(values, "dt", values).tz_localize(None)
    return np.asarray(values.to_numpy() if hasattr(values, "to_numpy") else values)


def _span(one: timedelta) -> np.timedelta64:
    # pandas counts nanoseconds beside what Python knows.
    exact = getattr(one, "to_timedelta64", None)
    return exact() if exact is not None else np.timedelta64(one).astype("m8[ns]")
