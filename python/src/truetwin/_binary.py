"""Finds the program ``truetwin``."""

from __future__ import annotations

import os
import shutil
import sys
import sysconfig
from pathlib import Path

from ._errors import TruetwinError


def find() -> str:
    """Return the path of the program.

    The scripts folder of this Python comes first, where the wheel puts the program; then the environment variable TRUETWIN;
    then PATH.
    """
    name = "truetwin.exe" if os.name == "nt" else "truetwin"
    folders = [Path(sys.executable).parent, Path(sysconfig.get_path("scripts"))]
    user_scheme = sysconfig.get_preferred_scheme("user")
    folders.append(Path(sysconfig.get_path("scripts", user_scheme)))
    for folder in folders:
        if _is_program(folder / name):
            return str(folder / name)
    if named := os.environ.get("TRUETWIN"):
        if not _is_program(Path(named)):
            raise TruetwinError(f"TRUETWIN={named}: not an executable file; set it to the program truetwin, or remove it")
        return named
    if on_path := shutil.which("truetwin"):
        return on_path
    raise TruetwinError(
        "the program truetwin was not found beside this Python, in TRUETWIN or on PATH; "
        "install the wheel, or set TRUETWIN to the program"
    )


def _is_program(path: Path) -> bool:
    return path.is_file() and os.access(path, os.X_OK)
