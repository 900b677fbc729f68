"""Times of records as seconds: arrays of time stamps, and objects of datetime, numpy and pandas."""

from __future__ import annotations

import datetime
from typing import Any

import numpy as np

from ._numbers import Array, is_missing, shown

#: Kinds of times, as a message says them; one column has one kind.
NAIVE, AWARE, DURATION = "has no time zone", "has a time zone", "is a duration"


def is_timed(values: Any) -> bool:
    """Tell whether values of pandas or numpy are times, each or one of the objects among them."""
    kind = getattr(values.dtype, "kind", "O")
    return kind in "mM" or hasattr(values.dtype, "tz") or kind == "O" and any(_kind(value) for value in values)


def seconds(values: Any) -> Array | None:
    """Return times as seconds from the first, nan where one is missing; None if the values are no times.

    Raises
    ------
    ValueError
        Times of several kinds, or times beside other values; the message names the first row of another kind.
    """
    dtype = getattr(values, "dtype", None)
    if hasattr(dtype, "tz"):
        # Series and indices of pandas with a time zone, as UTC.
        values = values.to_numpy(dtype=f"datetime64[{getattr(dtype, 'unit', 'ns')}]")
    # np.asarray drops the zones of a list.
    moments = np.asarray(values, dtype=object if isinstance(values, (list, tuple)) else None)
    if isinstance(values, np.ma.MaskedArray):
        moments = np.where(np.ma.getmaskarray(values), _nothing(moments.dtype), moments)
    if moments.dtype == object:
        moments = _moments(moments)
    if moments.dtype.kind not in "mM":
        return None
    given = moments[~np.isnat(moments)]
    return np.asarray((moments - given[:1]) / np.timedelta64(1, "s"), dtype=float) if given.size else np.full(moments.shape, np.nan)


def _nothing(dtype: Any) -> Any:
    """Return what stands for a missing value in an array."""
    return np.array("NaT", dtype) if dtype.kind in "mM" else None if dtype == object else np.nan


def _moments(objects: Any) -> Any:
    """Return objects as an array of moments of one clock, or of durations; the objects themselves if none is a time."""
    first = next(((row, kind) for row, value in enumerate(objects) if (kind := _kind(value))), None)
    if first is None:
        return objects
    for row, value in enumerate(objects):
        kind = _kind(value)
        if kind != first[1] and not is_missing(value):
            this, other = (f"row {at} {told}" for at, told in ((row, kind or f"holds {shown(value)}"), first))
            raise ValueError(f"{this}, {other} (counted from 0); give times of one kind")
    nothing = np.timedelta64("NaT") if first[1] == DURATION else np.datetime64("NaT")
    return np.array([nothing if is_missing(value) else _moment(value) for value in objects])


def _kind(value: object) -> str:
    """Return the kind of a time; empty if the value is none."""
    if not isinstance(value, (datetime.date, datetime.timedelta, np.datetime64, np.timedelta64)) or is_missing(value):
        return ""
    if isinstance(value, (datetime.timedelta, np.timedelta64)):
        return DURATION
    return AWARE if isinstance(value, datetime.datetime) and value.utcoffset() is not None else NAIVE


def _moment(value: Any) -> Any:
    """Return a time in numpy's type, one with a zone as UTC."""
    for exact in ("to_datetime64", "to_timedelta64"):
        # Those of pandas have nanoseconds.
        if hasattr(value, exact):
            return getattr(value, exact)()
    if isinstance(value, (datetime.timedelta, np.timedelta64)):
        return np.timedelta64(value)
    if isinstance(value, datetime.datetime) and (offset := value.utcoffset()) is not None:
        value = value.replace(tzinfo=None) - offset
    return np.datetime64(value)
