"""Runs the program: exit codes become exceptions, Ctrl-C ends it, its progress goes to standard error."""

from __future__ import annotations

import codecs
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from typing import TextIO

from . import _binary
from ._errors import InternalError, Interrupted, TruetwinError
from ._names import Names

#: Seconds that a stopped program gets to end by itself.
PATIENCE = 5.0
#: Last bytes of standard error that are kept for the error line.
KEPT = 1 << 16

_ERROR = re.compile(rb"(?:^|[\r\n]|\x1b\[[0-9;?]*[A-Za-z])error: ")
#: Lines of the program in a log: those of progress come each half minute.
_PROGRESS, _WARNING = re.compile(r"[^:\n]+: \d+ of \d+ done, \d+ s elapsed\n"), re.compile(r"warning: .*\n")


def run(arguments: Sequence[str], environment: Mapping[str, str], names: Names, *, answers: Sequence[int] = (0,)) -> str:
    """Run the program and return its standard output; `answers` are the exit codes of a call that has one.

    `names` are the words for what the program shows meanwhile; the output and the errors are as the program wrote them.

    Raises
    ------
    TruetwinError
        Exit code 2: wrong call or file.
    InternalError
        Another exit code, or the end by a signal.
    Interrupted
        Exit code 130 without a Ctrl-C in this process.
    KeyboardInterrupt
        Ctrl-C; the program has ended.
    """
    errors = _Errors.open(names)
    command = [_binary.find(), *arguments]
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=errors.end,
            env={**os.environ, **environment},
            # Ctrl-C is for this process, which stops the program once.
            start_new_session=os.name == "posix",
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
    except OSError as error:
        errors.close()
        raise TruetwinError(f"{command[0]}: cannot be started: {error.strerror}; install truetwin for this machine") from error
    errors.forward()
    try:
        output, _ = process.communicate()
    except BaseException:
        _stop(process)
        raise
    finally:
        errors.close()
    if process.returncode not in answers or not output and process.returncode != 0:
        raise _failure(process.returncode, errors.kept)
    return output.decode()


def _stop(process: subprocess.Popen[bytes]) -> None:
    """Ask the program to stop, then kill it; a second Ctrl-C kills it at once."""
    try:
        process.send_signal(signal.SIGINT if os.name == "posix" else getattr(signal, "CTRL_BREAK_EVENT"))
        # Its pipes are read on, so that it never waits for this process.
        process.communicate(timeout=PATIENCE)
    except (subprocess.TimeoutExpired, KeyboardInterrupt, OSError):
        process.kill()
        process.communicate()


def _failure(code: int, errors: bytes) -> TruetwinError:
    lines = errors.decode(errors="replace").replace("\r", "\n").split("\n")
    texts = [line.partition("error: ")[2] for line in lines if "error: " in line]
    line = texts[-1] if texts else " | ".join(line for line in lines if line.strip())
    if code == 2:
        return TruetwinError(line or "the program gave no reason", code)
    if code == 130:
        return Interrupted(line or "stopped", code)
    how = f"was ended by signal {-code}" if code < 0 else f"ended with exit code {code}"
    return InternalError(f"the program {how}: {line}" if line else f"the program {how}", code)


class _Errors:
    """Standard error of the program: its error line is kept, and what comes before is shown.

    On a terminal, a pseudo-terminal gets the bars of the program as they come. Elsewhere a pipe gets whole lines: a notebook shows those of
    progress and the warnings, a log those of progress alone.
    """

    def __init__(self, ours: int, end: int, names: Names, terminal: bool) -> None:
        self.ours, self.end = ours, end
        self.kept = b""
        self._names = names
        self._terminal = terminal
        self._shown: TextIO | None = sys.stderr
        notebook = type(sys.stderr).__module__.partition(".")[0] == "ipykernel"
        self._lines = (_PROGRESS, _WARNING) if notebook else (_PROGRESS,)
        self._thread: threading.Thread | None = None

    @classmethod
    def open(cls, names: Names) -> _Errors:
        """Return a pseudo-terminal of the size of the real one; a pipe if standard error is no terminal."""
        try:
            if os.name == "posix" and sys.stderr.isatty():
                import fcntl
                import termios

                size = fcntl.ioctl(sys.stderr.fileno(), termios.TIOCGWINSZ, b"\0" * 8)
                ours, end = os.openpty()
                fcntl.ioctl(end, termios.TIOCSWINSZ, size)
                return cls(ours, end, names, True)
        except (OSError, ValueError, AttributeError):
            # A replaced sys.stderr, or no pseudo-terminals left: no bars are shown.
            pass
        return cls(*os.pipe(), names, False)

    def forward(self) -> None:
        """Start to show what the program writes, up to its error line, which becomes an exception."""
        os.close(self.end)
        self._thread = threading.Thread(target=self._forward, daemon=True)
        self._thread.start()

    def _forward(self) -> None:
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        waiting, echo = b"", True
        while piece := self._read():
            self.kept = (self.kept + piece)[-KEPT:]
            if not echo:
                continue
            waiting += piece
            found = _ERROR.search(waiting)
            ready = found.end() - len(b"error: ") if found else self._ready(waiting)
            self._show(decoder.decode(waiting[:ready]))
            waiting, echo = waiting[ready:], not found
        if echo:
            self._show(decoder.decode(waiting, final=True))

    def _read(self) -> bytes:
        try:
            return os.read(self.ours, 1 << 12)
        except OSError:
            # The end of a pseudo-terminal.
            return b""

    def _ready(self, text: bytes) -> int:
        """Return how much of a text can be shown before the rest is known: what has words of the user is whole."""
        return self._names.unfinished(text) if self._terminal else text.rfind(b"\n") + 1

    def _show(self, text: str) -> None:
        if not self._terminal:
            text = "".join(line for line in text.splitlines(True) if any(kind.fullmatch(line) for kind in self._lines))
        # There is no standard error in a program without a console.
        if not text or self._shown is None:
            return
        try:
            self._shown.write(self._names.message(text))
            self._shown.flush()
        except (OSError, ValueError):
            # It is closed. The pipe is read on: the program would wait for that.
            self._shown = None

    def close(self) -> None:
        """Wait for the last words of the program, then close both ends."""
        if self._thread:
            self._thread.join(timeout=PATIENCE)
        else:
            os.close(self.end)
        os.close(self.ours)
