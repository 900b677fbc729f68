"""Texts of the program in the words of the user: what was passed in place of temporary files, positions in place of their rows."""

from __future__ import annotations

import html
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ._numbers import one_line, shown

#: Rows of a file in a finding, which shows the first of many.
_ROWS = re.compile(r"(?P<before>\bin rows |: row )(?P<rows>\d+(?:, \d+)*(?:, …)?)")


@dataclass(frozen=True)
class Rows:
    """Rows of a written file.

    Parameters
    ----------
    first : int
        Row of the file, from 1, that has the first sample.
    samples : int
        Number of samples.
    index : index of a data frame, optional
        Its labels belong to the rows, unless they are their positions.
    """

    first: int
    samples: int
    index: Any = None

    def positions(self, rows: str) -> str:
        """Return rows as positions in the data; a row of the header stays as it is."""
        positions = [int(row) - self.first for row in re.findall(r"\d+", rows)]
        if not all(0 <= position < self.samples for position in positions):
            return rows
        more = ", …" if rows.endswith("…") else ""
        labels = [one_line(str(self.index[position])) for position in positions] if self.index is not None else []
        index = f"; index {', '.join(labels)}" if labels and labels != [str(position) for position in positions] else ""
        return f"{', '.join(map(str, positions))}{more} (counted from 0{index})"


#: What the program says of its description, which the user gave as arguments.
_DESCRIPTION = re.compile(r"the program (`.*?`) answered \".*\": (.*?)(?: at line \d+ column \d+)?; asked to describe itself, it must answer .*")
#: Options of the program, as arguments say them.
_OPTIONS = {
    r" \(--columns t=NAME.*? takes other names\)": " (columns={name: column} takes other names)",
    r" \(--timeout SECONDS allows more\)": " (timeout=seconds allows more)",
    r"flush each answer, or allow more time for one": "allow more time for one",
    r" \(`truetwin resample R\.csv --step S --out R2\.csv` closes short gaps.*?\)": " (`truetwin resample` closes short gaps of a file)",
    r" \(`truetwin resample R\.csv --step S --out R2\.csv`(.*?)\)": r" (`truetwin resample` does it for a file\1)",
    r"leave the cell of an output empty if it was not measured": "give nan in an output that was not measured",
    r" \(`truetwin resample R\.csv --step \S+ --out R2\.csv`.*?\)": " (`truetwin resample` does it for a file)",
    r"`truetwin resample R\.csv --step \S+ --out R2\.csv`": "`truetwin resample` for a file",
    r"--step-of-record": "step_of_record=True",
    r"invalid value '(.*?)' for '--([a-z-]+) <.*?>': (.*?); see `truetwin --help`.*": r"\2 = \1: \3",
    r" \(`truetwin pretrain` makes one; --program or --fmu names the twin that it was made for\)": "",
    r"--estimator names the twin (\S+), --program or --fmu the twin (\S+); give one of them": r"the estimator is of the twin \1, this twin is \2; give one of this twin",
    r"; use the program that has this twin\b": "; give an estimator of this twin",
    r"; make a bank on disk, then pretrain from it \(`truetwin bank` makes one\)": "; give fewer, or use `truetwin bank` and `truetwin pretrain`",
    r" \(`truetwin effects` lists them, with .*? of this call\)": " (effects() lists them)",
    r"\(--kinds; .*? of the study file\)": "(kinds=[...])",
    r"choose another --out": "choose another out",
    r"--timeout (\S+): ": r"timeout = \1: ",
    r"--theta": "parameters",
}
#: Keys of study files, as arguments say them.
_KEYS = {
    r" \(\[record\] input = .*? in the study file\)": " (levels=(low, high), or a plan for each input)",
    r" \((?:all of them in )?\[\w+\] of the study file\)": "",
    r"; \[record\] step of the study file": "; step of the twin",
    r"; \[record\] step = (\S+) in the twin file": r"; step=\1",
    r"\banother setting: other study; name .* or the twin alone": "another setting of the twin; give the twin that it was trained with",
    r", the study's (?=\S+ s;)": ", the twin's ",
    r"\[record\] substeps or integrator of the study file": "record={'substeps': n} or another integrator",
    r"\bthe study('s step| has no plan)": r"the twin\1",
    r"\b(in|step of) the study\b": r"\1 the twin",
}


def _in_arguments(words: Mapping[str, str], text: str) -> str:
    for pattern, argument in words.items():
        text = re.sub(pattern, argument, text)
    return text


def word(path: str | os.PathLike[str], what: str = "path") -> str:
    """Return a path as a word of a call, which is no option.

    Raises
    ------
    TypeError, ValueError
        No path, an empty one, or one that no file has.
    """
    try:
        name = os.fspath(path)
    except TypeError:
        raise TypeError(f"{what} of type {type(path).__name__}; give a path") from None
    if not isinstance(name, str):
        raise TypeError(f"{what} of type {type(path).__name__}; give a path as a text")
    try:
        is_whole = b"\0" not in os.fsencode(name)
    except UnicodeEncodeError:
        is_whole = False
    if not name or not is_whole:
        raise ValueError(f"{what} = {shown(name)}; give the path of a file")
    return f".{os.sep}{name}" if name.startswith("-") else name


class Names:
    """The words for the files and the simulator of one call.

    Parameters
    ----------
    folder : Path
        Temporary folder of the call; its files have the names that the user reads.
    in_arguments : bool
        Whether the twin is given as arguments; otherwise it has a study file.
    """

    def __init__(self, folder: Path, in_arguments: bool = False) -> None:
        self._folder = folder
        self._in_arguments = in_arguments
        self._words: dict[str, str] = {}
        self._rows: dict[str, Rows] = {}
        self.hide(folder)

    def hide(self, folder: str | os.PathLike[str]) -> None:
        """Leave a folder out before the names of its files."""
        self.say(f"{os.fspath(folder)}{os.sep}", "")

    def say(self, text: str, word: str) -> None:
        """Say a word in place of a text, as it is in messages, in JSON and in pages."""
        self._words |= dict.fromkeys((text, json.dumps(text, ensure_ascii=False)[1:-1], html.escape(text)), one_line(word))

    def write(self, name: str, rows: Rows) -> Path:
        """Return the path of a new file of a record."""
        self._rows[name] = rows
        return self._folder / name

    def plain(self, text: str) -> str:
        """Return a result in the words of the user."""
        # The longest first: a file of its own word is in a folder that is left out.
        for part in sorted(self._words, key=len, reverse=True):
            text = text.replace(part, self._words[part])
        return text

    def message(self, text: str) -> str:
        """Return messages in the words of the user, with positions for the rows of written records."""
        for name, rows in self._rows.items():
            place = re.escape(str(self._folder / name))
            text = _moved(rf"(?P<before>{place}(?:, |: )row )(?P<rows>\d+)", rows, text)
        return self.argued(_DESCRIPTION.sub(r"the twin \1: \2", self.plain(text)))

    def argued(self, text: str) -> str:
        """Return a message with arguments in place of options, and of keys of a study file where the user has none."""
        text = _in_arguments(_OPTIONS, text)
        return _in_arguments(_KEYS, text) if self._in_arguments else text

    def finding(self, name: str, text: str) -> str:
        """Return a message about the record `name`, which does not name it."""
        rows = self._rows.get(name)
        return self.argued(text if rows is None else _moved(_ROWS, rows, text))

    def unfinished(self, text: bytes) -> int:
        """Return where a path of the temporary folder begins at the end of a text; its length if none does."""
        folder = os.fsencode(self._folder)
        line = text.rfind(b"\n") + 1
        whole = text.find(folder, line)
        begins = (at for at in range(max(line, len(text) - len(folder)), len(text)) if folder.startswith(text[at:]))
        return whole if whole >= 0 else next(begins, len(text))


def _moved(place: str | re.Pattern[str], rows: Rows, text: str) -> str:
    """Return a text with positions in place of rows."""
    return re.sub(place, lambda found: found["before"] + rows.positions(found["rows"]), text)
