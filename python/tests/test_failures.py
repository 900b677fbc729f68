"""Wrong calls, failing simulators, and the end of the program."""

from __future__ import annotations

import io
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import truetwin
from conftest import SETTING, heater
from truetwin import _process, _server


def test_a_wrong_record_is_one_line(twin, tmp_path):
    with pytest.raises(truetwin.TruetwinError, match=r"missing\.csv") as caught:
        twin.fit(tmp_path / "missing.csv")
    assert caught.value.exit_code == 2 and "\n" not in caught.value.line
    assert not caught.value.line.startswith("error")


def test_wrong_arguments_are_refused_before_the_program_starts(record):
    with pytest.raises(ValueError, match="needs parameters="):
        truetwin.Twin(heater)
    with pytest.raises(ValueError, match="give a callable, study=FILE"):
        truetwin.Twin()
    with pytest.raises(ValueError, match=r"gain = 3; give \(low, high\)"):
        truetwin.Twin(heater, **{**SETTING, "parameters": {"gain": 3}})
    with pytest.raises(ValueError, match="noise of speed; the outputs are temperature"):
        truetwin.Twin(heater, **SETTING, noise={"speed": 1.0})
    twin = truetwin.Twin(heater, **SETTING)
    with pytest.raises(ValueError, match="different lengths .*power: 99"):
        twin.fit({**record, "power": record["power"][:99]})
    with pytest.raises(ValueError, match=r"record 1, column temperature: 'warm' in row 0 \(counted from 0\), which is no number"):
        twin.fit({**record, "temperature": ["warm"] * 100})
    with pytest.raises(TypeError, match="record 1: a record of type int"):
        twin.fit([3])
    with pytest.raises(TypeError, match="records of type NoneType; give a path"):
        twin.fit(None)


def test_masked_samples_are_missing(twin, record):
    bad = record["temperature"].copy()
    bad[20:30] = 99.0
    masked = np.ma.masked_greater(bad, 50.0)
    filled = twin.fit({**record, "temperature": masked.filled(np.nan)})
    assert twin.fit({**record, "temperature": masked}).parameters == filled.parameters
    pandas = pytest.importorskip("pandas")
    nullable = pandas.array(np.where(masked.mask, 0.0, bad), dtype="Float64")
    nullable[masked.mask] = pandas.NA
    frame = pandas.DataFrame({"t": record["t"], "power": record["power"], "temperature": nullable})
    assert twin.fit(frame).parameters == filled.parameters


def test_numbers_that_mean_nothing_are_refused(twin, record):
    with pytest.raises(ValueError, match="temperature: complex values; give real ones"):
        twin.fit({**record, "temperature": record["temperature"] + 1j})
    for noise in (-1.0, float("nan"), float("inf"), {"temperature": -0.1}):
        with pytest.raises(ValueError, match="give a standard deviation, 0 or more"):
            truetwin.Twin(heater, **SETTING, noise=noise)
    for hold in (0, -3, 2.5):
        with pytest.raises(ValueError, match=f"hold = {hold}; give a whole number"):
            truetwin.Twin(heater, **SETTING, levels=(-1, 1), hold=hold)
    twisted = truetwin.Twin(lambda parameters, inputs, time: np.ones(time.size) * 1j, **SETTING)
    with pytest.raises(truetwin.TruetwinError, match="the simulator returned complex values"):
        twisted.simulate({"gain": 2.0, "tau": 10.0}, {"t": record["t"], "power": record["power"]})


def test_a_wrong_description_is_named():
    infinite = {"gain": (0.0, float("inf"))}
    for wrong, part in [
        ({"gain": (3.0, 1.0)}, "gain = .*low below high"), ({"gain": (1.0, 1.0)}, "gain = .*low below high"), (infinite, "gain = .*finite"),
        ({"gain": (float("nan"), 1.0)}, "gain"), ({"gain": truetwin.Parameter((0, 1), unit=5)}, "gain, unit = 5"), ({3: (0, 1)}, "name = 3"),
        (["gain"], "a dict of"),
    ]:  # fmt: skip
        with pytest.raises((ValueError, TypeError), match=f"parameters.*{part}"):
            truetwin.Twin(heater, **{**SETTING, "parameters": wrong})
    # What the program finds is said of the twin, and not of the JSON that describes it.
    for other, part in [({"outputs": "t"}, "is called t, which is the time"), ({"levels": {"v": (0, 1)}}, 'has no input "v"'), ({"name": "a b"}, "name")]:
        twisted = truetwin.Twin(heater, **{**SETTING, **other})
        with pytest.raises(truetwin.TruetwinError, match=f"^the twin `.*`: .*{part}") as caught:
            twisted.simulate({"gain": 2.0})
        assert "{" not in caught.value.line


def test_arguments_are_checked_where_they_are_given(record, tmp_path):
    sympy = pytest.importorskip("sympy")
    pandas = pytest.importorskip("pandas")
    equations = {"parameters": {"k": (0.1, 2.0)}, "states": {"x": {"rate": "-k*x", "start": 1.0}}, "outputs": {"y": "x"}, "step": 0.1}

    def text(**changed):
        return truetwin.Twin(**{**equations, **changed})

    x, t = sympy.symbols("x t")
    for call, part in [
        (lambda: truetwin.Twin(heater, **{**SETTING, "outputs": [3]}), "outputs: a name = 3; give a text"),
        (lambda: truetwin.Twin(heater, **{**SETTING, "outputs": b"y"}), "outputs = b'y'; give names"),
        (lambda: truetwin.Twin(heater, **{**SETTING, "outputs": {"y": 1}}), "outputs: y, unit = 1; give a text"),
        (lambda: truetwin.Twin(heater, **SETTING, levels={"power": float("nan")}), "levels: power = nan; give"),
        (lambda: truetwin.Twin(heater, **SETTING, samples=10**30), "samples = .*below 2\\*\\*53"),
        (lambda: truetwin.Twin(heater, **SETTING, study=5), "study of type int; give a path"),
        (lambda: text(states={1: "-x"}), "a name = 1; give a text"),
        (lambda: text(states={"x": sympy.Derivative(x, t)}), "x, rate: Derivative of sympy is unknown"),
        (lambda: text(states={"x": sympy.Matrix([x])}), "x, rate: .*Matrix of sympy is unknown"),
        (lambda: text(states={"x": "\ud800"}), "x, rate = .*a character that no file holds"),
        (lambda: text(levels=(-1, 1), step=None), "levels are those of simulated records.*give step=seconds"),
        (lambda: text(record={"step": 0.2}), "step is given twice"),
        (lambda: text(samples=40, record={"samples": 10}), "samples is given twice"),
        (lambda: text(outputs={"y": {"value": "x", "noise": 0.1}}, noise={"y": 0.5}), "noise of y is given twice"),
        (lambda: text(drift="f", states=["x"]), "drift of type str; give a function"),
        (lambda: text(states=["x", "x"], drift=abs), "states: x appears twice"),
        (lambda: text().simulate({"k": 1.0}, noise_free="no"), "noise_free = 'no'; give True or False"),
        (lambda: text().fit(""), "record 1 = ''; give the path"),
        (lambda: text().fit("a\0"), "record 1 = .*; give the path"),
        (lambda: text().fit(pandas.Series([1.0])), "records of type Series"),
        (lambda: text().fit(b"r.csv"), "records of type bytes"),
        (lambda: text().fit(io.StringIO("t,y")), "records of type StringIO"),
        (lambda: text().fit({"t": None, "y": [1.0]}), "record 1, column t: None; give one value per sample"),
    ]:
        with pytest.raises((ValueError, TypeError), match=part):
            call()
    # A symbol is a name, several times of an event are an array, and a name may begin like an option.
    assert "x = { rate" in text(states={sympy.Symbol("x"): {"rate": "-k*x", "start": 1.0}}, events=None).toml()
    assert "at = [1.0, 2.0]" in text(events=[{"at": np.array([1.0, 2.0]), "add": {"x": 1.0}}]).toml()
    odd = truetwin.Twin(lambda p, u, t: np.exp(-p["-x"] * t), parameters={"-x": (0.1, 2.0)}, outputs="y", step=0.1)
    assert odd.simulate({"-x": 0.5})["y"].size == 300


def test_remedies_are_arguments(record):
    """Who gave no study file and no options reads of none."""
    without_levels = {key: value for key, value in SETTING.items() if key != "levels"}
    times = np.cumsum(np.linspace(0.5, 1.5, len(record["t"])))
    driven = {"t": record["t"], "power": record["power"]}
    for call, part in [
        (lambda: truetwin.Twin(heater, **without_levels).simulate({"gain": 2.0, "tau": 10.0}), "levels=\\(low, high\\)"),
        (lambda: truetwin.Twin(heater, **SETTING).fit(record, columns={"foo": "power"}), "columns={name: column}"),
        (lambda: truetwin.Twin(heater, **SETTING).fit({**record, "t": times}), "resample"),
        (lambda: truetwin.Twin(lambda p, u, t: np.full(t.size, np.nan), **SETTING).fit(record), "check units, step and bounds"),
        (lambda: truetwin.Twin(lambda p, u, t: 1 / 0, **SETTING, noise=0.1).simulate({"gain": 2.0, "tau": 10.0}, driven), "ZeroDivisionError"),
    ]:
        with pytest.raises((truetwin.TruetwinError, ValueError), match=part) as caught:
            call()
        assert not re.search(r"study|\.toml|--\w|\[record\]", str(caught.value)), caught.value


def test_an_exception_without_words_ends_the_call_too(record):
    class Mute(Exception):
        def __str__(self):
            raise RuntimeError("no words")

    for error, said in ((Mute(), "Mute"), (ValueError("\ud800"), r"ValueError: \?")):
        def broken(parameters, inputs, time):
            raise error

        with pytest.raises(truetwin.TruetwinError, match=said) as caught:
            truetwin.Twin(broken, **SETTING).fit(record)
        assert caught.value.__cause__ is error


def test_an_exception_of_the_simulator_comes_through(record):
    def broken(parameters, inputs, time):
        return inputs["pwoer"]

    twin = truetwin.Twin(broken, **SETTING)
    with pytest.raises(truetwin.TruetwinError) as caught:
        twin.fit(record)
    assert "`broken` says: test_failures.py, line" in caught.value.line and "KeyError: 'pwoer'" in caught.value.line
    assert isinstance(caught.value.__cause__, KeyError)
    frames = caught.value.__cause__.__traceback__
    while frames.tb_next:
        frames = frames.tb_next
    assert frames.tb_frame.f_code.co_name == "broken"
    # A failed call leaves nothing behind in the next one.
    with pytest.raises(truetwin.TruetwinError) as caught:
        twin.fit("missing.csv")
    assert caught.value.__cause__ is None


@pytest.mark.parametrize(
    ("result", "problem"),
    [
        (lambda n: np.zeros(n - 1), r"shape \(99,\) for the output temperature; return shape \(100,\)"),
        (lambda n: 1.0, r"shape \(\) for the output temperature"),
        (lambda n: np.zeros((n, 2)), r"shape \(100, 2\) for the output temperature"),
        (lambda n: {"heat": np.zeros(n)}, "the outputs heat; return temperature"),
        (lambda n: ["warm"] * n, "the simulator returned 'warm' in row 0 "),
        (lambda n: None, "returned None; end it with `return`"),
    ],
)
def test_a_wrong_shape_is_named(record, result, problem):
    twin = truetwin.Twin(lambda parameters, inputs, time: result(len(time)), **SETTING, name="odd")
    with pytest.raises(truetwin.TruetwinError, match="test_failures.py, line .*" + problem):
        twin.fit(record)


def test_a_diverging_simulator_is_tried_elsewhere(record):
    """Beyond tau = 30 nothing works, in one of four ways; the fit stays below."""

    def fragile(parameters, inputs, time):
        if parameters["tau"] > 30:
            way = int(parameters["tau"] * 1e6) % 4
            if way == 0:
                raise truetwin.Diverged(time[-1])
            if way == 1:
                raise OverflowError("math range error")
            return np.full(len(time), np.nan if way == 2 else np.inf)
        return heater(parameters, inputs, time)

    assert truetwin.Twin(fragile, **SETTING).fit(record).parameters["tau"] == pytest.approx(10.0, abs=0.5)


def test_a_late_simulator_ends_the_call(record):
    twin = truetwin.Twin(lambda *call: time.sleep(1.0), **SETTING, name="slow", timeout=0.2)
    with pytest.raises(truetwin.TruetwinError, match="`slow` gave no answer within 0.2 s"):
        twin.fit(record)


def test_exit_codes_are_told_apart(monkeypatch, tmp_path):
    program = tmp_path / "program"
    monkeypatch.setattr("truetwin._binary.find", lambda: str(program))
    twin = truetwin.Twin.named("tanks")
    for script, kind, text in [
        ("echo noise >&2; echo 'error: wrong call; do this' >&2; exit 2", truetwin.TruetwinError, "wrong call; do this"),
        ("echo 'error: disk' >&2; exit 1", truetwin.InternalError, "ended with exit code 1: disk"),
        ("kill -SEGV $$", truetwin.InternalError, "ended by signal 11"),
        ("echo 'error: stopped' >&2; exit 130", truetwin.Interrupted, "stopped"),
    ]:
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        with pytest.raises(truetwin.TruetwinError, match=text) as caught:
            twin.fit("record.csv")
        assert type(caught.value) is kind
    program.write_text("no program")
    with pytest.raises(truetwin.TruetwinError, match="cannot be started"):
        twin.fit("record.csv")


def test_the_program_is_found_or_named(monkeypatch, tmp_path):
    from truetwin import _binary

    given = os.environ["TRUETWIN"]
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr(_binary.sysconfig, "get_path", lambda *_: str(tmp_path / "scripts"))
    assert _binary.find() == given
    monkeypatch.setenv("TRUETWIN", str(tmp_path / "none"))
    with pytest.raises(truetwin.TruetwinError, match="none: not an executable file"):
        _binary.find()
    monkeypatch.delenv("TRUETWIN")
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    with pytest.raises(truetwin.TruetwinError, match="install the wheel"):
        _binary.find()
    for folder in ("bin", "scripts"):
        (tmp_path / folder).mkdir()
        Path(tmp_path, folder, "truetwin").symlink_to(Path(given).resolve())
        assert _binary.find() == str(tmp_path / folder / "truetwin")


@pytest.mark.parametrize("terminal", [False, True])
def test_ctrl_c_ends_the_program(tmp_path, terminal):
    """In a process of its own, with and without a terminal; no process of the call is left."""
    script = tmp_path / "slow.py"
    script.write_text(
        "import signal, sys, time, truetwin\n"
        # A shell's background job ignores the signal, and so would we.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "sys.path.insert(0, sys.argv[1])\n"
        "from conftest import SETTING, heater\n"
        "def slow(*call):\n"
        "    print('called', flush=True)\n"
        "    time.sleep(0.05)\n"
        "    return heater(*call)\n"
        "try:\n"
        "    truetwin.Twin(slow, **SETTING, levels=(-1, 1), workers=2).pretrain('slow.est', bank_size=100000)\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted', flush=True)\n"
    )
    command = [sys.executable, str(script), str(Path(__file__).parent)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "TMPDIR": str(tmp_path)}
    errors = subprocess.PIPE
    if terminal:
        ours, errors = os.openpty()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, cwd=tmp_path, env=environment, text=True)
    if terminal:
        os.close(errors)
        shown = bytearray()
        threading.Thread(target=drain, args=(ours, shown), daemon=True).start()
    assert process.stdout.readline() == "called\n"
    if terminal:
        wait_for(lambda: b"/100000" in shown)
    children = descendants(process.pid)
    assert children, "the program and its relays"
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=20)
    assert output.endswith("interrupted\n") and process.returncode == 0
    wait_for(lambda: not any(alive(child) for child in children))
    assert not list(tmp_path.glob("truetwin-*")), "temporary folders are gone"
    if terminal:
        assert b"error:" not in shown


def drain(terminal: int, shown: bytearray) -> None:
    try:
        while piece := os.read(terminal, 4096):
            shown += piece
    except OSError:
        pass


def wait_for(condition) -> None:
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline, "waited 10 s in vain"
        time.sleep(0.05)


def descendants(pid: int) -> list[int]:
    listed = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    parents = {int(line.split()[0]): int(line.split()[1]) for line in listed.splitlines()}
    found = [pid]
    for parent in found:
        found += [child for child, of in parents.items() if of == parent]
    return found[1:]


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_standard_error_without_a_terminal_stays_empty(twin, csv, capfd):
    twin.fit(csv)
    assert capfd.readouterr() == ("", "")


def test_a_local_socket_asks_for_its_token(record, monkeypatch):
    """The way of systems without Unix sockets."""
    monkeypatch.delattr(_server.socket, "AF_UNIX")
    twin = truetwin.Twin(heater, **SETTING)
    assert twin.fit(record).parameters["gain"] == pytest.approx(2.0, abs=0.05)
    with _server.Server(twin._model) as server:
        command = shlex.split(server.command)
        request = b'{"truetwin": 1, "request": "describe"}\n'
        for token, code in [(server.environment["TRUETWIN_RELAY_TOKEN"], 0), ("wrong", 1)]:
            environment = {**os.environ, "TRUETWIN_RELAY_TOKEN": token}
            relay = subprocess.run(command, input=request, capture_output=True, env=environment, timeout=20)
            assert relay.returncode == code
            assert (b'"name": "heater"' in relay.stdout) == (code == 0)
    with pytest.raises(ConnectionRefusedError):
        _server.socket.create_connection(("127.0.0.1", int(command[-1])))


def test_a_socket_has_a_short_path(twin, csv, monkeypatch, tmp_path):
    deep = tmp_path / ("deep" * 30)
    deep.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(deep))
    assert twin.fit(csv).converged


def test_progress_ends_where_the_error_begins():
    shown = b"\r\x1b[2K   simulating 3/9\r\x1b[2Kerror: wrong\r\n"
    found = _process._ERROR.search(shown)
    assert shown[: found.end() - 7].endswith(b"3/9\r\x1b[2K")


def test_results_and_options_are_refused_in_words_of_arguments(twin, record, tmp_path):
    fit = twin.fit(record)
    for path in (1, True, "", tmp_path, tmp_path / "missing" / "page.html"):
        with pytest.raises((TypeError, ValueError, truetwin.TruetwinError), match="give (a|the) ") as caught:
            fit.report.save(path)
        assert "\n" not in str(caught.value)
    for call, part in [
        (lambda: twin.fit(record, out=tmp_path), "choose another out"),
        (lambda: twin.fit(record, out=""), "out = ''; give the path"),
        (lambda: twin.fit(record, out=5), "out of type int; give a path"),
        (lambda: twin.withheld(None), "trials = None; give a whole number"),
        (lambda: twin.withheld(10**9), "trials = 1000000000: choose at most"),
        (lambda: twin.withheld(1, columns={"t": "time"}), "columns are those of the record `like`"),
        (lambda: twin.withheld(1, kinds="odd"), "odd"),
        (lambda: twin.check(columns={"t": "time"}), "columns are those of a record"),
        (lambda: twin.diagnose(record, calibrate=10**30), "calibrate = .*smaller whole number"),
        (lambda: twin.diagnose(record, without="sensor-biass"), r"effects\(\) lists them"),
        (lambda: twin.diagnose(record, without=""), "without: an empty text"),
        (lambda: truetwin.Twin(heater, **SETTING, timeout=1e300).fit(record), "timeout = 1e300"),
    ]:
        with pytest.raises((TypeError, ValueError, truetwin.TruetwinError), match=part) as caught:
            call()
        assert not re.search(r"--\w|study", str(caught.value)), caught.value
    assert "sensor-bias@sensor" in twin.effects()

    def late(parameters, inputs, time):
        raise truetwin.Diverged(1e6)

    with pytest.raises(truetwin.TruetwinError, match=r"Diverged\(1e\+06\): give a time of this run, which ends at"):
        truetwin.Twin(late, **SETTING).fit(record)


def test_a_simulator_that_follows_nothing_is_no_all_clear(tmp_path):
    """A jump of the sensor as large as the signal: the noise of a callable may take it, and the answer says so."""
    def decay(parameters, inputs, time):
        return np.exp(-parameters["rate"] * time)

    twin = truetwin.Twin(decay, parameters={"rate": (0.1, 2.0)}, outputs="y", step=0.1, samples=60, noise=0.02)
    record = twin.simulate({"rate": 0.5})
    jump = {**record, "y": record["y"] + 0.8 * (record["t"] > 3.0)}
    found = twin.diagnose(jump, quick=True)
    assert found.verdict == "structural-gap" or any("no better than a constant" in warning for warning in found.warnings), found
    # Of another noise than the declared one, errors that simulations tell are too small; the estimate says so.
    estimator = twin.pretrain(tmp_path / "decay.est", bank_size=300, epochs=20)
    loud = {**record, "y": record["y"] + 0.1 * np.random.default_rng(1).standard_normal(60)}
    told = [any("the simulator's own noise" in warning for warning in twin.estimate(given, estimator).warnings) for given in (record, loud)]
    assert told == [False, True]
    louder = truetwin.Twin(decay, parameters={"rate": (0.1, 2.0)}, outputs="y", step=0.1, samples=60, noise=0.5)
    with pytest.raises(truetwin.TruetwinError, match="made for another setting of the twin; give the twin that it was trained with"):
        louder.estimate(record, estimator)
    gap = {**record, "t": record["t"] + 0.3 * (np.arange(60) >= 9)}
    assert any("row 9 (counted from 0)" in finding.message for finding in twin.check(gap).findings)
