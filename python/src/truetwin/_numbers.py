"""Numbers that users give: single ones, counts, and arrays. Each is checked before it is used."""

from __future__ import annotations

import operator
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Characters of a value that a message shows.
LONGEST = 60
COMPLEX = "complex values; give real ones, such as their real parts or magnitudes"


def shown(value: object) -> str:
    """Return a value as a message shows it: in one line, and cut if it is long."""
    line = one_line(repr(value))
    return line if len(line) <= LONGEST else line[:LONGEST] + "…"


def one_line(lines: str) -> str:
    """Return a text without ends of lines, which a message has not."""
    return " ".join(lines.split())


def number(what: str, value: object, remedy: str) -> float:
    """Return one real number as a float; nan and inf are such numbers.

    Raises
    ------
    ValueError
        Anything else; the message is ``what = value; remedy``.
    """
    if _is_real(value):
        try:
            return float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            pass
    raise ValueError(f"{what} = {shown(value)}; {remedy}") from None


def whole(name: str, value: object) -> int:
    """Return a number of samples, which may be a float such as 300.0; refuse one that is not whole, below 1, or beyond exact floats."""
    remedy = "give a whole number of samples, at least 1 and below 2**53"
    samples = number(name, value, remedy)
    if not samples.is_integer() or not 1 <= samples < 2**53:
        raise ValueError(f"{name} = {shown(value)}; {remedy}")
    return int(samples)


def count(name: str, value: object, least: int, most: int | None = None) -> int:
    """Return an integer from `least` to `most`; refuse others, and floats and truth values."""
    try:
        integer = None if isinstance(value, (bool, np.bool_)) else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        integer = None
    if integer is None or integer < least or most is not None and integer > most:
        largest = most if most is None or most < 10**8 else f"2**{most.bit_length()} - 1"
        limits = f"at least {least}" if most is None else f"from {least} to {largest}"
        raise ValueError(f"{name} = {shown(value)}; give a whole number, {limits}")
    return integer


def flag(name: str, value: object) -> bool:
    """Return True or False; refuse anything else, whose truth may not be what it says."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} = {shown(value)}; give True or False")
    return bool(value)


def interval(what: str, value: Any, remedy: str = "give (low, high)") -> tuple[float, float]:
    """Return two finite numbers of which the first is smaller; refuse anything else."""
    try:
        low, high = value
        ends = number(what, low, remedy), number(what, high, remedy)
    except (TypeError, ValueError):
        raise ValueError(f"{what} = {shown(value)}; {remedy}") from None
    if not (ends[0] < ends[1] and np.isfinite(ends[1] - ends[0])):
        raise ValueError(f"{what} = {shown(value)}; {remedy}, low below high, both finite")
    return ends


def mapping(what: str, value: Any, of: str) -> Mapping[str, Any]:
    """Return a dict, an empty one for None; refuse anything else."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise TypeError(f"{what} of type {type(value).__name__}; give a dict of {of}")
    return value


def text(what: str, value: Any) -> str:
    """Return a text that a file can hold, or the name of a symbol of sympy; refuse anything else."""
    value = getattr(value, "name", value) if hasattr(value, "free_symbols") else value
    if not isinstance(value, str):
        raise TypeError(f"{what} = {shown(value)}; give a text")
    if "\0" in value or any("\ud800" <= c <= "\udfff" for c in value):
        raise ValueError(f"{what} = {shown(value)}: a character that no file holds; leave it out")
    return value


def named(what: str, value: Any, of: str) -> dict[str, Any]:
    """Return a dict whose keys are texts; refuse anything else."""
    return {text(f"{what}: a name", name): entry for name, entry in mapping(what, value, of).items()}


def reals(values: Any, remedy: str) -> Array:
    """Return an array, a list or a column of pandas as floats; nan where a value is masked or missing.

    Raises
    ------
    ValueError
        Complex values, texts, times or other objects; the message says which, and ends with `remedy`.
    OverflowError
        An integer that no float holds.
    """
    dtype = getattr(values, "dtype", None)
    if hasattr(dtype, "na_value") and hasattr(values, "to_numpy") and getattr(dtype, "kind", "") in "biuf":
        # The nullable numbers of pandas.
        values = values.to_numpy(dtype=float, na_value=np.nan)
    if isinstance(values, (list, tuple)):
        # np.asarray would drop their masks.
        values = [reals(value, remedy) if isinstance(value, np.ma.MaskedArray) else value for value in values]
    try:
        array = np.asarray(values)
    except ValueError:
        raise ValueError(f"parts of different lengths; {remedy}") from None
    if array.dtype.kind in "mM":
        raise ValueError(f"times; {remedy}")
    if array.dtype.kind not in "fiubcO":
        # Numbers beside a text are texts in such an array; the objects tell which is which.
        array = np.asarray(values, dtype=object)
    if isinstance(values, np.ma.MaskedArray):
        array = np.where(np.ma.getmaskarray(values), np.nan, array)
    if array.dtype.kind == "c":
        raise ValueError(COMPLEX)
    if array.dtype.kind == "O":
        array = _of_objects(array, remedy)
    return np.asarray(array, dtype=float)


def _of_objects(array: npt.NDArray[Any], remedy: str) -> Array:
    floats = np.full(array.shape, np.nan)
    for at, value in np.ndenumerate(array):
        if is_missing(value):
            continue
        if np.iscomplexobj(value):
            raise ValueError(COMPLEX)
        try:
            real = float(value) if _is_real(value) else None
        except (TypeError, ValueError):
            real = None
        if real is None:
            where = f" in row {at[0]} (counted from 0)" if at else ""
            raise ValueError(f"{shown(value)}{where}, which is no number; {remedy}")
        floats[at] = real
    return floats


def is_missing(value: object) -> bool:
    """Tell whether an object stands for a missing value: None, a masked one, NaT, or NA of pandas."""
    if value is None or value is np.ma.masked or isinstance(value, (np.datetime64, np.timedelta64)) and bool(np.isnat(value)):
        return True
    pandas = sys.modules.get("pandas")
    return pandas is not None and (value is pandas.NA or value is pandas.NaT)


def _is_real(value: object) -> bool:
    """Tell whether a value may be one real number. float() also takes texts, truth values, and the real parts of some complex values."""
    if isinstance(value, (bool, str, bytes, bytearray)) or np.ma.is_masked(value):
        return False
    dtype = getattr(value, "dtype", None)
    return dtype is None or getattr(dtype, "kind", "f") in "fiu" and np.ndim(value) == 0  # type: ignore[arg-type]
