"""Records of users as files of the program, and back."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np
import numpy.typing as npt

from ._names import Names, Rows, word
from ._numbers import Array, named, one_line, reals, shown
from ._times import is_timed, seconds

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped, unused-ignore]

#: A record: the path of a file, a data frame, or arrays by column.
Record = Union[str, "os.PathLike[str]", "pd.DataFrame", Mapping[str, npt.ArrayLike]]
#: One record, or several of one system.
Records = Union[Record, Sequence[Record]]

#: Columns that a message lists.
NAMED = 20


def is_frame(record: object) -> bool:
    """Tell whether a record is a pandas data frame, without importing pandas."""
    pandas = sys.modules.get("pandas")
    return pandas is not None and isinstance(record, pandas.DataFrame)


def as_list(records: Records) -> list[Record]:
    """Return one or several records as a list."""
    if isinstance(records, (str, os.PathLike, Mapping)) or is_frame(records):
        return [records]  # type: ignore[list-item, unused-ignore]
    # Arrays have a dtype; an open file gives its lines.
    if not isinstance(records, Iterable) or isinstance(records, (bytes, bytearray)) or hasattr(records, "dtype") or hasattr(records, "read"):
        raise TypeError(f"records of type {type(records).__name__}; give a path, a DataFrame, a dict of arrays, or a list of these")
    given: list[Record] = list(records)  # type: ignore[arg-type, unused-ignore]
    if not given:
        raise ValueError("records: none is given; pass at least one")
    return given


class Writer:
    """Writes records that are not files into a folder.

    Parameters
    ----------
    names : Names
        Words of the call, which get those of the written records.
    columns : mapping, optional
        Column of the record for each name in the twin, as in ``{"t": "time", "push": "torque"}``.
    inputs, outputs : sequence of str, optional
        Names of the twin; other columns are left out. None: they are unknown, and all columns are written.
    step : float, optional
        Step in seconds of records without times.
    """

    def __init__(
        self,
        names: Names,
        columns: Mapping[str, str] | None,
        inputs: Sequence[str] | None,
        outputs: Sequence[str] | None,
        step: float | None,
    ) -> None:
        self._names = names
        given = named("columns", columns, "name in the twin: column")
        # A data frame may have any labels.
        self._columns = {name: str(column) for name, column in given.items() if column is not None and str(column).strip()}
        if odd := [name for name in given if name not in self._columns]:
            raise ValueError(f"columns: {odd[0]} = {given[odd[0]]!r}; give the name of a column")
        self._inputs = inputs
        self._outputs = outputs
        self._step = step

    def path(self, name: str, record: Record, driven: bool = False) -> str:
        """Return the path of a record, after writing it if it is no file yet; `name` is that of messages.

        A record that is `driven` needs no outputs.
        """
        if isinstance(record, (str, os.PathLike)):
            return word(record, name)
        if not (isinstance(record, Mapping) or is_frame(record)):
            raise TypeError(f"{name}: a record of type {type(record).__name__}; give a path, a DataFrame or a dict of arrays")
        columns = self._chosen(name, record, driven)
        header = header_of(columns)
        # The names of columns may have more than one line.
        first = 2 + len(re.findall("\r\n?|\n", header))
        index = getattr(record, "index", None) if is_frame(record) else None
        path = self._names.write(name, Rows(first, len(next(iter(columns.values()))), index))
        write(path, header, columns)
        return str(path)

    def _chosen(self, label: str, record: Any, driven: bool) -> dict[str, Array]:
        names = list(record.columns if is_frame(record) else record)
        self._check(label, [str(name) for name in names], driven)
        time = self._columns.get("t", "t")
        if twice := [name for at, name in enumerate(names) if self._wanted(str(name)) and str(name) in map(str, names[:at])]:
            raise ValueError(f"{label} has two columns {one_line(str(twice[0]))}; rename or remove one")
        columns = {
            str(name): _column(f"{label}, column {name}", record[name], str(name) == time) for name in names if self._wanted(str(name))
        }
        if time not in columns:
            times = self._times(label, record, len(next(iter(columns.values()), np.empty(0))))
            columns = {**({} if times is None else {time: times}), **columns}
        _check_lengths(label, columns)
        return columns

    def _wanted(self, name: str) -> bool:
        if name in self._columns.values():
            return True
        # The usual names u, u1, y, y2 stand for inputs and outputs in their order.
        usual = name == "t" or _is_usual("u", name) or _is_usual("y", name)
        if self._inputs is None or self._outputs is None:
            return usual or not self._columns
        return usual or name in (*self._inputs, *self._outputs) and name not in self._columns

    def _check(self, label: str, given: Sequence[str], driven: bool) -> None:
        """Refuse a record that lacks an input, or all outputs, in the words of the user; the program knows its own file alone."""
        missing = self._missing("u", self._inputs or (), given)
        outputs = self._missing("y", self._outputs or (), given)
        if not driven and self._outputs and len(outputs) == len(self._outputs):
            missing += outputs[:1]
        for name, column in missing:
            asked = f", which columns gives for {name}" if name in self._columns else ""
            other = "" if driven else f", or name another with columns={{{name!r}: ...}}"
            remedy = "correct columns" if asked else f"add it{other}"
            raise ValueError(f"{label} has no column {one_line(column)}{asked}; its columns are {_listed(given)}: {remedy}")

    def _missing(self, letter: str, names: Sequence[str], given: Sequence[str]) -> list[tuple[str, str]]:
        """Return inputs or outputs without a column, and its name; none where usual names stand for them."""
        if any(_is_usual(letter, name) and name not in names for name in (*given, *self._columns)):
            return []
        columns = [(name, self._columns.get(name, name)) for name in names]
        return [(name, column) for name, column in columns if column not in given]

    def _times(self, label: str, record: Any, samples: int) -> Array | None:
        """Return the times of a record without a column for them; None if nothing gives them."""
        if is_frame(record):
            index = record.index
            if index.name is not None and index.name in ("t", "time", self._columns.get("t")) or is_timed(index):
                return _column(f"{label}, index", index, True)
        if "t" in self._columns:
            raise ValueError(f"{label} has no column {self._columns['t']}, which columns gives for t; correct columns")
        others = [str(name) for name in record if not self._wanted(str(name))]
        if self._step is not None and others:
            raise ValueError(
                f"{label} has no column t, and others that the twin has not: {_listed(others)}; name its times with columns={{'t': ...}}, "
                "or leave these out for rows of the twin's step"
            )
        return None if self._step is None else np.arange(samples, dtype=float) * self._step


def _listed(names: Sequence[str]) -> str:
    """Return names in one line, the first of many."""
    more = ", …" if len(names) > NAMED else ""
    return one_line(", ".join(names[:NAMED]) or "none") + more


def _is_usual(letter: str, name: str) -> bool:
    return name[:1] == letter and (name[1:].isdecimal() or not name[1:])


def _column(what: str, values: Any, timed: bool) -> Array:
    """Return a column as floats, nan where it is masked or missing; times as seconds from the first if it is the column of times."""
    what = one_line(what)
    if values is None or np.isscalar(values):
        raise ValueError(f"{what}: {shown(values)}; give one value per sample")
    try:
        moments = seconds(values) if timed else None
        remedy = "give seconds, or times, as pandas.to_datetime reads them from texts" if timed else "give numbers, nan where missing"
        column = reals(values, remedy) if moments is None else moments
    except OverflowError:
        beyond = "times beyond those of the clock" if timed else "a number beyond those of floats"
        raise ValueError(f"{what}: {beyond}; correct it{'' if timed else ', or give nan where an output is missing'}") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{what}: {one_line(str(error))}") from None
    if column.ndim != 1:
        raise ValueError(f"{what}: shape {column.shape}; give one value per sample")
    return column


def _check_lengths(label: str, columns: Mapping[str, Array]) -> None:
    if not columns:
        raise ValueError(f"{label}: no column of the twin; give t, the inputs and the outputs")
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        given = _listed([f"{name}: {length}" for name, length in lengths.items()])
        raise ValueError(f"{label}: columns of different lengths ({given}); give one value per sample in each")


def header_of(columns: Iterable[str]) -> str:
    """Return the header of a CSV file."""
    return ",".join(_cell(name) for name in columns)


def write(path: Path, header: str, columns: Mapping[str, Array]) -> None:
    """Write columns of one length as a CSV file; no number loses a digit."""
    rows = zip(*(values.tolist() for values in columns.values()))
    with open(path, "w", encoding="utf-8") as file:
        file.write(header + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def _cell(text: str, odd: str = ',"\r\n;\t#') -> str:
    if any(c in text for c in odd):
        return '"' + text.replace('"', '""') + '"'
    return text


def columns_of(columns: Mapping[str, str]) -> str:
    """Return names of columns as the program takes them."""
    return ",".join(f"{name}={_cell(str(column), ',' + chr(34))}" for name, column in columns.items())


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
