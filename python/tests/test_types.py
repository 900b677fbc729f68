"""The types of the package, and of user code that uses it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "truetwin"

USE = """
import numpy as np
import numpy.typing as npt
import truetwin

def lag(parameters: dict[str, float], inputs: dict[str, npt.NDArray[np.float64]], time: npt.NDArray[np.float64]) -> list[float]:
    return [parameters["gain"]] * len(time)

twin = truetwin.Twin(lag, parameters={"gain": (0.0, 1.0)}, inputs="u", outputs="y", step=0.1)
fit = twin.fit({"u": [1.0], "y": np.zeros(1)})
reveal_type(fit.parameters)
reveal_type(twin.diagnose("r.csv").verdict)
reveal_type(twin.simulate({"gain": 1.0}))
fit.level = 1.0
"""


@pytest.fixture(scope="session")
def mypy(tmp_path_factory):
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path_factory.mktemp("mypy"))]

    def run(*arguments: str) -> str:
        done = subprocess.run([*command, *arguments], capture_output=True, text=True, cwd=PACKAGE.parent)
        return done.stdout + done.stderr

    return run


def test_the_package_is_typed_strictly(mypy):
    found = mypy("--python-version", "3.10", "truetwin")
    assert "Success" in found, found


def test_users_see_types(mypy, tmp_path):
    (tmp_path / "use.py").write_text(USE)
    found = mypy(str(tmp_path / "use.py"))
    assert 'Mapping[str, float]' in found.replace("typing.", "").replace("builtins.", ""), found
    assert "Literal['no-gap']" in found and "dict[str, " in found, found
    # The one error is the assignment to a frozen field.
    assert found.count(": error:") == 1 and "read-only" in found, found
