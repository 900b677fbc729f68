"""Records of users as files of the program, and back."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np
import numpy.typing as npt

from ._simulator import Array

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped, unused-ignore]

#: A record: the path of a file, a data frame, or arrays by column.
Record = Union[str, "os.PathLike[str]", "pd.DataFrame", Mapping[str, npt.ArrayLike]]
#: One record, or several of one system.
Records = Union[Record, Sequence[Record]]


def is_frame(record: object) -> bool:
    """Tell whether a record is a pandas data frame, without importing pandas."""
    pandas = sys.modules.get("pandas")
    return pandas is not None and isinstance(record, pandas.DataFrame)


def as_list(records: Records) -> list[Record]:
    """Return one or several records as a list."""
    if isinstance(records, (str, os.PathLike, Mapping)) or is_frame(records):
        return [records]  # type: ignore[list-item, unused-ignore]
    if not isinstance(records, Iterable):
        raise TypeError(f"records of type {type(records).__name__}; give a path, a DataFrame, a dict of arrays, or a list of these")
    return list(records)  # type: ignore[arg-type, unused-ignore]


class Writer:
    """Writes records that are not files into a folder.

    Parameters
    ----------
    folder : Path
        Existing folder for the files.
    columns : mapping, optional
        Column of the record for each name in the twin, as in ``{"t": "time", "push": "torque"}``.
    known : sequence of str, optional
        Names of the twin's inputs and outputs; other columns are left out. None: all columns are written.
    step : float, optional
        Step in seconds of records without times.
    """

    def __init__(self, folder: Path, columns: Mapping[str, str] | None, known: Sequence[str] | None, step: float | None) -> None:
        self._folder = folder
        self._columns = columns
        self._known = known
        self._step = step
        self._count = 0

    def path(self, record: Record) -> str:
        """Return the path of a record, after writing it if it is no file yet."""
        if isinstance(record, (str, os.PathLike)):
            return os.fspath(record)
        if not (isinstance(record, Mapping) or is_frame(record)):
            raise TypeError(f"a record of type {type(record).__name__}; give a path, a DataFrame or a dict of arrays")
        self._count += 1
        path = self._folder / f"record-{self._count}.csv"
        write(path, self._chosen(record))
        return str(path)

    def _chosen(self, record: Any) -> dict[str, Array]:
        names = list(record.columns) if is_frame(record) else list(record)
        columns = {str(name): _numbers(str(name), record[name]) for name in names if self._wanted(str(name))}
        time = self._columns.get("t", "t") if self._columns else "t"
        if time not in columns:
            times = self._times(record, len(next(iter(columns.values()), np.empty(0))))
            columns = {**({} if times is None else {time: times}), **columns}
        return columns

    def _wanted(self, name: str) -> bool:
        if self._columns is not None:
            return name == "t" and "t" not in self._columns or name in self._columns.values()
        if self._known is None:
            return True
        # The usual names u, u1, y, y2 stand for inputs and outputs in their order.
        usual = name[:1] in ("u", "y") and (name[1:].isdecimal() or not name[1:])
        return name == "t" or usual or name in self._known

    def _times(self, record: Any, samples: int) -> Array | None:
        """Return the times of a record without a column for them; None if nothing gives them."""
        if is_frame(record):
            index = record.index
            if index.name in ("t", "time") or index.dtype.kind in "mM" or hasattr(index.dtype, "tz"):
                return _numbers("index", index)
        return None if self._step is None else np.arange(samples, dtype=float) * self._step


def _numbers(name: str, values: Any) -> Array:
    """Return a column as floats, nan where it is masked; time stamps as seconds from the first."""
    dtype = getattr(values, "dtype", None)
    if hasattr(dtype, "tz"):
        values = values.to_numpy(dtype="datetime64[ns]")
    elif hasattr(dtype, "na_value") and hasattr(values, "to_numpy") and getattr(dtype, "kind", "") in "biuf":
        # The nullable numbers of pandas.
        values = values.to_numpy(dtype=float, na_value=np.nan)
    array = np.asarray(values)
    mask = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    if array.dtype.kind == "c":
        raise ValueError(f"record, column {name}: complex values; give real ones, such as their real parts or magnitudes")
    if array.ndim != 1:
        raise ValueError(f"record, column {name}: shape {array.shape}; give one value per sample")
    if array.dtype.kind in "mM" and array.size:
        array = np.asarray((array - array[0]) / np.timedelta64(1, "s"), dtype=float)
    try:
        floats = np.asarray(array, dtype=float)
        return floats if mask is None else np.where(mask, np.nan, floats)
    except (TypeError, ValueError):
        raise ValueError(f"record, column {name}: {array.dtype} holds other values than numbers; give numbers, nan where missing") from None


def write(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns as a CSV file; no number loses a digit."""
    if not columns:
        raise ValueError("record: no column of the twin; give t, the inputs and the outputs")
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        given = ", ".join(f"{name}: {length}" for name, length in lengths.items())
        raise ValueError(f"record: columns of different lengths ({given}); give one value per sample in each")
    rows = zip(*(values.tolist() for values in columns.values()))
    with open(path, "w", encoding="utf-8") as file:
        file.write(",".join(_cell(name) for name in columns) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def _cell(text: str) -> str:
    if any(c in text for c in ',"\n;\t'):
        return '"' + text.replace('"', '""') + '"'
    return text


def read(path: Path, inputs: Sequence[str], outputs: Sequence[str]) -> dict[str, Array]:
    """Read a record that the program wrote; its columns get the given names where these are known."""
    with open(path, encoding="utf-8") as file:
        header = file.readline().strip().split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    if len(header) == 1 + len(inputs) + len(outputs) and outputs:
        header = ["t", *inputs, *outputs]
    return {name: np.array(table[:, k]) for k, name in enumerate(header)}


def as_frame(columns: Mapping[str, Array]) -> Any:
    """Return columns as a data frame; pandas is imported already."""
    return sys.modules["pandas"].DataFrame(dict(columns))
