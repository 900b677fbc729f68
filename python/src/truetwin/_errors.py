"""Exceptions of this package."""

from __future__ import annotations

import math

from ._numbers import number, shown


class TruetwinError(Exception):
    """A wrong call, file or record; the message is the line that the program printed.

    If a Python simulator raised an exception, that exception is the ``__cause__``.

    Attributes
    ----------
    line : str
        One line: what is wrong, where, and what to do.
    exit_code : int or None
        Exit code of the program: 2 for a wrong call or file. None if the program did not run.
    """

    def __init__(self, line: str, exit_code: int | None = None) -> None:
        super().__init__(line)
        self.line = line
        self.exit_code = exit_code


class InternalError(TruetwinError):
    """The program failed for another reason than the call (exit code 1), or was killed (negative: the signal)."""


class Interrupted(TruetwinError):
    """The program was stopped from outside this process (exit code 130)."""


class Diverged(Exception):
    """Raise this in a simulator if a run leaves the finite numbers; the program then tries other parameters.

    Parameters
    ----------
    time : float
        Time of the divergence in seconds, between the first time and the end of the record.
    """

    def __init__(self, time: float = 0.0) -> None:
        remedy = "give the time in seconds"
        self.time = number("time of the divergence", time, remedy)
        if not math.isfinite(self.time):
            raise ValueError(f"time of the divergence = {shown(time)}; {remedy}")
        super().__init__(f"diverged at {time} s")
