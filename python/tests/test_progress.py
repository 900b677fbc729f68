"""What is shown while the program runs: bars on a terminal, lines elsewhere."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

import truetwin

LINES = "warning: row 3 is an outlier\nfit: 2 of 5 done, 30 s elapsed\ntruetwin 0.1.0, seed 1; call: truetwin fit\n"


@pytest.fixture
def slow(monkeypatch, tmp_path):
    """A program that shows its lines at once and ends when it is told to."""
    go = tmp_path / "go"
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\nprintf '{LINES}' >&2\nwhile ! [ -e {go} ]; do sleep 0.05; done\necho 'error: wrong; right' >&2\nexit 2\n")
    program.chmod(0o755)
    monkeypatch.setattr("truetwin._binary.find", lambda: str(program))
    return go


class Stream:
    """A standard error that is no terminal; its text may release the program."""

    def __init__(self, go) -> None:
        self.text, self.go = "", go

    def isatty(self) -> bool:
        return False

    def write(self, text: str) -> None:
        self.text += text
        self.go.touch()

    def flush(self) -> None:
        pass


def test_a_log_gets_lines_of_progress_as_they_come(slow, monkeypatch):
    stream = Stream(slow)
    monkeypatch.setattr(sys, "stderr", stream)
    # Without a line while it runs the program never ends.
    watch = threading.Timer(20, slow.touch)
    watch.start()
    with pytest.raises(truetwin.TruetwinError) as caught:
        truetwin.Twin.named("tanks").fit("record.csv")
    assert watch.is_alive()
    watch.cancel()
    assert caught.value.line == "wrong; right"
    assert stream.text == "fit: 2 of 5 done, 30 s elapsed\n"


@pytest.mark.parametrize("stream", [None, "closed"])
def test_standard_error_may_be_missing(slow, monkeypatch, tmp_path, stream):
    """As in a program without a console; a program that writes much does not wait for ever."""
    closed = open(tmp_path / "log", "w")
    closed.close()
    monkeypatch.setattr(sys, "stderr", closed if stream else None)
    program = tmp_path / "program"
    program.write_text("#!/bin/sh\nfor k in $(seq 5000); do echo 'fit: 2 of 5 done, 30 s elapsed' >&2; done\n" + program.read_text())
    slow.touch()
    with pytest.raises(truetwin.TruetwinError, match="wrong; right"):
        truetwin.Twin.named("tanks").fit("record.csv")


def test_a_notebook_gets_progress_and_warnings(slow, tmp_path):
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    slow.touch()
    code = (
        f"import sys; sys.path[:0] = {sys.path!r}\n"
        f"import truetwin; truetwin._binary.find = lambda: {str(tmp_path / 'program')!r}\n"
        "try:\n    truetwin.Twin.named('tanks').fit('record.csv')\n"
        "except truetwin.TruetwinError as error:\n    print(error)\n"
    )
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    nbclient.NotebookClient(notebook, timeout=60).execute()
    shown = {output["name"]: output["text"] for output in notebook.cells[0].outputs}
    assert shown["stderr"] == "warning: row 3 is an outlier\nfit: 2 of 5 done, 30 s elapsed\n"
    assert shown["stdout"] == "wrong; right\n"


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs pseudo-terminals")
def test_a_terminal_shows_the_name_of_a_record(tmp_path):
    script = tmp_path / "twice.py"
    script.write_text(
        "import numpy as np, truetwin\n"
        "record = {'t': np.arange(50.0), 'u': np.ones(50), 'y': np.sin(np.arange(50.0))}\n"
        "study = dict(parameters={'k': (0.1, 1)}, states={'h': 'u - k*h'}, inputs='u', outputs={'y': 'h'}, noise=0.1)\n"
        "truetwin.Twin(**study).fit([record, record])\n"
    )
    ours, end = os.openpty()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.DEVNULL, stderr=end, env=environment)
    os.close(end)
    shown = b""
    try:
        while piece := os.read(ours, 4096):
            shown += piece
    except OSError:
        pass
    assert process.wait() == 0
    assert b"warning: record 1 and record 2 hold the same record" in shown, shown


@pytest.mark.skipif("TRUETWIN_SLOW" not in os.environ, reason="takes half a minute; set TRUETWIN_SLOW=1")
def test_the_lines_are_those_of_the_program(tmp_path):
    """A training is stopped after its first line."""
    code = (
        "import truetwin\n"
        f"truetwin.Twin.named('tanks').pretrain({str(tmp_path / 'tanks.est')!r}, bank_size=2_000_000)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, env=environment, text=True)
    line = process.stderr.readline()
    process.send_signal(2)
    process.communicate(timeout=20)
    assert " of " in line and line.endswith(" s elapsed\n"), line
