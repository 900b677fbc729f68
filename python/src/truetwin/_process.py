"""Runs the program: exit codes become exceptions, Ctrl-C ends it, its progress goes to a terminal."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence

from . import _binary
from ._errors import InternalError, Interrupted, TruetwinError

#: Seconds that a stopped program gets to end by itself.
PATIENCE = 5.0
#: Last bytes of standard error that are kept for the error line.
KEPT = 1 << 16

_ERROR = re.compile(rb"(?:^|[\r\n]|\x1b\[[0-9;?]*[A-Za-z])error: ")


def run(arguments: Sequence[str], environment: Mapping[str, str] | None = None, *, answers: Sequence[int] = (0,)) -> str:
    """Run the program and return its standard output; `answers` are the exit codes of a call that has one.

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
    terminal = _Terminal.open()
    command = [_binary.find(), *arguments]
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=terminal.end if terminal else subprocess.PIPE,
            env={**os.environ, **(environment or {})},
            # Ctrl-C is for this process, which stops the program once.
            start_new_session=os.name == "posix",
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
    except OSError as error:
        if terminal:
            terminal.close()
        raise TruetwinError(f"{command[0]}: cannot be started: {error.strerror}; install truetwin for this machine") from error
    if terminal:
        terminal.forward()
    try:
        output, errors = process.communicate()
    except BaseException:
        _stop(process)
        raise
    finally:
        if terminal:
            terminal.close()
    if process.returncode not in answers or not output and process.returncode != 0:
        raise _failure(process.returncode, terminal.kept if terminal else errors)
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


class _Terminal:
    """A pseudo-terminal as standard error of the program, so that it shows its progress, and its error line can be read."""

    def __init__(self, ours: int, end: int) -> None:
        self.ours, self.end = ours, end
        self.kept = b""
        self._thread: threading.Thread | None = None

    @classmethod
    def open(cls) -> _Terminal | None:
        """Return a pseudo-terminal of the size of the real one; None if standard error is no terminal."""
        try:
            if os.name != "posix" or not sys.stderr.isatty():
                return None
            import fcntl
            import termios

            size = fcntl.ioctl(sys.stderr.fileno(), termios.TIOCGWINSZ, b"\0" * 8)
            ours, end = os.openpty()
            fcntl.ioctl(end, termios.TIOCSWINSZ, size)
            return cls(ours, end)
        except (OSError, ValueError, AttributeError):
            # A replaced sys.stderr, or no pseudo-terminals left: no progress is shown.
            return None

    def forward(self) -> None:
        """Start to show what the program writes, up to its error line, which becomes an exception."""
        os.close(self.end)
        self._thread = threading.Thread(target=self._forward, daemon=True)
        self._thread.start()

    def _forward(self) -> None:
        echo = True
        while True:
            try:
                piece = os.read(self.ours, 1 << 12)
            except OSError:
                return
            if not piece:
                return
            self.kept = (self.kept + piece)[-KEPT:]
            found = _ERROR.search(piece)
            if echo:
                shown = piece[: found.end() - len(b"error: ")] if found else piece
                sys.stderr.write(shown.decode(errors="replace"))
                sys.stderr.flush()
            echo = echo and not found

    def close(self) -> None:
        """Wait for the last words of the program, then close the pseudo-terminal."""
        if self._thread:
            self._thread.join(timeout=1.0)
        else:
            os.close(self.end)
        os.close(self.ours)
