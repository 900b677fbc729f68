"""Records in the words of the user: missing columns, rows of messages, and times."""

from __future__ import annotations

import datetime
import html
import json
import re

import numpy as np
import pandas as pd
import pytest

import truetwin
from conftest import SETTING, heater
from truetwin._names import Names, Rows


def refused(part: str, call) -> str:
    """Return the message of a call that is refused: one line with this part, and no temporary path."""
    with pytest.raises((ValueError, truetwin.TruetwinError)) as caught:
        call()
    message = str(caught.value)
    assert part in message and "\n" not in message and "truetwin-" not in message, message
    return message


def changed(record, name, row, value):
    column = record[name].copy()
    column[row] = value
    return {**record, name: column}


def test_a_missing_column_is_named(twin, record):
    without = {name: values for name, values in record.items() if name != "temperature"}
    refused("record 1 has no column temperature; its columns are t, power: add it", lambda: twin.fit(without))
    refused("record 2 has no column temperature", lambda: twin.fit([record, pd.DataFrame(without)]))
    refused("validation has no column temperature", lambda: twin.diagnose(record, validation=without))
    refused("record has no column temperature", lambda: twin.check(without))
    refused("like has no column temperature", lambda: twin.withheld(1, like=without))
    parameters = {"gain": 2, "tau": 10}
    refused("input has no column power; its columns are t: add it", lambda: twin.simulate(parameters, {"t": record["t"]}))
    assert len(twin.simulate(parameters, without)["temperature"]) == 100
    refused("record 1 has no column W, which columns gives for power; its", lambda: twin.fit(record, columns={"power": "W"}))
    refused("record 1 has no column time, which columns gives for t", lambda: twin.fit(record, columns={"t": "time"}))
    wide = {**without, "power\nin W": record["power"], **{f"x{k}": record["power"] for k in range(30)}}
    refused("its columns are t, power, power in W, x0, x1, x2, x3", lambda: twin.fit(wide))
    refused("x16, …: add it", lambda: twin.fit(wide))
    tanks = truetwin.Twin.named("tanks")
    refused("record 1: no output column; a record needs y", lambda: tanks.fit({"t": record["t"], "u": record["power"]}))


def test_usual_names_stand_for_those_of_the_twin(twin, record):
    usual = dict(zip(["t", "u", "y"], record.values()))
    assert twin.fit(usual).parameters == twin.fit(record).parameters


def test_columns_that_are_not_given_keep_their_names(twin, record):
    frame = pd.DataFrame(record).rename(columns={"t": "time"}).assign(comment="text")
    assert twin.fit(frame, columns={"t": "time"}).parameters == twin.fit(record).parameters


def test_rows_are_positions_in_the_data(twin, record):
    parameters, inputs = {"gain": 2, "tau": 10}, {"t": record["t"], "power": record["power"]}
    for part, call in [
        ("record 1, row 9 (counted from 0), column power: no value", lambda: twin.fit(changed(record, "power", 9, np.nan))),
        ('record 1, row 9 (counted from 0), column temperature: "inf"', lambda: twin.fit(changed(record, "temperature", 9, np.inf))),
        ("record 2, row 9 (counted from 0), column t: 3 s follows 8 s", lambda: twin.fit([record, changed(record, "t", 9, 3.0)])),
        ("validation, row 9 (counted from 0), col", lambda: twin.diagnose(record, validation=changed(record, "power", 9, np.nan))),
        ("input, row 9 (counted from 0), column t", lambda: twin.simulate(parameters, changed(inputs, "t", 9, 3.0))),
        ("like, row 9 (counted from 0), column power", lambda: twin.withheld(1, like=changed(record, "power", 9, np.nan))),
        ("record 1: 1 row of data", lambda: twin.fit({name: values[:1] for name, values in record.items()})),
    ]:
        refused(part, call)
    lines = {"t": record["t"], "power\nin W": changed(record, "power", 9, np.nan)["power"], "temperature": record["temperature"]}
    refused("record 1, row 9 (counted from 0), column power", lambda: twin.fit(lines, columns={"power": "power\nin W"}))


def test_rows_of_files_stay_rows_of_files(twin, csv):
    lines = csv.read_text().split("\n")
    csv.write_text("\n".join([*lines[:10], re.sub(",.*,", ",nan,", lines[10]), *lines[11:]]))
    with pytest.raises(truetwin.TruetwinError, match=r"record\.csv, row 11, column power: no value"):
        twin.fit(csv)


def test_the_index_of_a_frame_names_the_row(twin, record):
    frame = pd.DataFrame(changed(record, "power", 9, np.nan))
    stamped = frame.drop(columns="t").set_index(pd.date_range("2024-01-01", periods=100, freq="s"))
    refused("record 1, row 9 (counted from 0; index 2024-01-01 00:00:09), column power", lambda: twin.fit(stamped))
    refused("record 1, row 9 (counted from 0), column power", lambda: twin.fit(frame))
    refused("record 1, row 9 (counted from 0; index 59), column power", lambda: twin.fit(frame.set_index(np.arange(50, 150))))


def test_findings_of_a_check_name_positions(twin, record):
    wild = changed(changed(record, "temperature", 9, 30.0), "temperature", 40, -30.0)
    check = twin.check(wild)
    assert any("in rows 9, 40 (counted from 0): 2 of them" in warning for warning in check.warnings), check.warnings
    assert "in rows 9, 40 (counted from 0)" in str(check) and "rows 9, 40" in json.dumps(check.raw)


def test_results_show_what_was_passed(twin, record):
    fit, diagnosis = twin.fit([record, record]), twin.diagnose(record, validation=record, quick=True)
    assert "record 1 (sha256" in str(fit) and "call: " in str(fit)
    for text in (str(fit), json.dumps(fit.raw), fit.report._repr_html_(), diagnosis.report.page, json.dumps(diagnosis.raw)):
        assert "truetwin-" not in text and "relay" not in text
    assert [file["path"] for file in diagnosis.raw["provenance"]["files"]] == ["record 1", "validation"]


def test_a_fault_of_equations_is_at_a_line_of_their_text():
    twin = truetwin.Twin(parameters={"k": (0, 1)}, states={"h": "-kk*h"}, outputs={"y": "h"}, step=0.1)
    line = int(re.search(r"^toml\(\), line (\d+), column", refused("unknown name", lambda: twin.simulate({"k": 0.5})))[1])
    assert "kk" in twin.toml().splitlines()[line - 1]


def test_words_stand_in_every_kind_of_text(tmp_path):
    names = Names(tmp_path)
    path = names.write("record 1", Rows(2, 5))
    names.write("record 10", Rows(2, 5))
    names.say('python "relay" <a>', "heater")
    assert names.message(f"{path}0, row 3, column y: bad") == "record 10, row 1 (counted from 0), column y: bad"
    assert names.message(f"{path}: row 4, column y is missing") == "record 1: row 2 (counted from 0), column y is missing"
    # The header and what is no row of the file stay.
    for text in (f"{path}: row 1 holds numbers", f"{path}, row 9, column y", f"{path}, column row 3: bad"):
        assert names.message(text) == text.replace(f"{tmp_path}/", "")
    for written in ('python "relay" <a>', json.dumps('python "relay" <a>')[1:-1], html.escape('python "relay" <a>')):
        assert names.plain(f"`{written}`") == "`heater`"
    for text, shown in [(f"\x1b[2K 3/9{path}, ro", "\x1b[2K 3/9"), (f"3/9\nwarning: {str(path)[:4]}", "3/9\nwarning: "), (f"{path}\n 3/9", None)]:
        assert text[: names.unfinished(text.encode())] == (text if shown is None else shown)


NAIVE = [datetime.datetime(2024, 3, 1) + datetime.timedelta(seconds=second) for second in range(100)]
# Every other row is in another zone.
ZONE = datetime.timezone(datetime.timedelta(hours=5, minutes=30))
AWARE = [time.replace(tzinfo=datetime.timezone.utc).astimezone(ZONE if row % 2 else datetime.timezone.utc) for row, time in enumerate(NAIVE)]


@pytest.mark.parametrize(
    "times",
    [
        NAIVE,
        AWARE,
        [pd.Timestamp(time) for time in NAIVE],
        [pd.Timestamp(time) for time in AWARE],
        [np.datetime64(time) for time in NAIVE],
        [pd.Timestamp(NAIVE[0]), np.datetime64(NAIVE[1]), *NAIVE[2:]],
        np.array(NAIVE, dtype=object),
        pd.Series(AWARE, dtype=object),
        pd.to_datetime(pd.Series(AWARE), utc=True),
        [time - NAIVE[0] for time in NAIVE],
        np.ma.array(np.array(NAIVE, dtype="M8[us]"), mask=False),
    ],
    ids=lambda times: f"{type(times).__name__} of {type(times[0]).__name__}",
)
def test_times_are_seconds(twin, record, times):
    expected = twin.fit(record).parameters
    assert twin.fit({**record, "t": times}).parameters == expected
    frame = pd.DataFrame({name: values for name, values in record.items() if name != "t"})
    if isinstance(times, list):
        assert twin.fit(frame.set_index(pd.Index(times, dtype=object))).parameters == expected


def test_times_of_several_kinds_are_refused(twin, record):
    none = "row 0 has no time zone (counted from 0); give times of one kind"
    for times, part in [
        ([*NAIVE[:5], *AWARE[5:]], f"record 1, column t: row 5 has a time zone, {none}"),
        ([*AWARE[:5], *NAIVE[5:]], "record 1, column t: row 5 has no time zone, row 0 has a time zone"),
        ([np.datetime64(NAIVE[0]), *AWARE[1:]], f"row 1 has a time zone, {none}"),
        ([*NAIVE[:5], *record["t"][5:].tolist()], f"row 5 holds 5.0, {none}"),
        ([3, *NAIVE[1:]], "row 0 holds 3, row 1 has no time zone"),
        ([*NAIVE[:5], NAIVE[5] - NAIVE[0], *NAIVE[6:]], f"row 5 is a duration, {none}"),
        ([*NAIVE[:5], None, *NAIVE[6:]], "record 1, row 5 (counted from 0), column t: no value"),
        ([str(time) for time in NAIVE], "which is no number; give seconds, or times, as pandas.to_datetime reads them from texts"),
        (pd.Series(pd.period_range("2024-03-01", periods=100, freq="s")), "record 1, column t: Period("),
    ]:
        refused(part, lambda: twin.fit({**record, "t": times}))
    refused("record 1, column power: ", lambda: twin.fit({**record, "power": NAIVE}))
    refused("record 1, column power: times; give numbers", lambda: twin.fit({**record, "power": np.array(NAIVE, dtype="M8[s]")}))
    frame = pd.DataFrame({name: values for name, values in record.items() if name != "t"})
    mixed = frame.set_index(pd.Index([*NAIVE[:5], *AWARE[5:]], dtype=object))
    refused(f"record 1, index: row 5 has a time zone, {none}", lambda: twin.fit(mixed))


def test_rows_without_times_have_the_twins_step_or_are_refused(twin, record):
    """The index of a frame counts rows, unless it is named as times; a column that the twin has not may be the times."""
    pandas = pytest.importorskip("pandas")
    rows = {name: values for name, values in record.items() if name != "t"}
    fits = [twin.fit(given).parameters for given in (rows, pandas.DataFrame(rows), pandas.DataFrame(rows, index=[f"r{k}" for k in range(100)]))]
    assert fits[0] == fits[1] == fits[2]
    for given in ({**rows, "time": record["t"]}, pandas.DataFrame({**rows, "time": record["t"]})):
        with pytest.raises(ValueError, match="no column t, and others that the twin has not: time; name its times with columns"):
            twin.fit(given)
        assert twin.fit(given, columns={"t": "time"}).parameters == twin.fit(record).parameters
    # Labels of a frame need be no texts.
    numbered = pandas.DataFrame({0: record["t"], 1: record["power"], 2: record["temperature"]})
    assert twin.fit(numbered, columns={"t": 0, "power": 1, "temperature": 2}).parameters == twin.fit(record).parameters
    twice = pandas.DataFrame(np.column_stack([record["t"], record["power"], record["power"], record["temperature"]]))
    twice.columns = ["t", "power", "power", "temperature"]
    with pytest.raises(ValueError, match="record 1 has two columns power; rename or remove one"):
        twin.fit(twice)
