"""Twins and records that the tests share. The environment variable TRUETWIN names the program."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import truetwin


def pytest_configure() -> None:
    if "TRUETWIN" not in os.environ:
        pytest.exit("set TRUETWIN to the program, as in TRUETWIN=target/debug/truetwin", returncode=2)


def heater(parameters, inputs, time):
    """A first-order lag: the temperature of a heater."""
    keep = np.exp(-time[1] / parameters["tau"])
    temperature, measured = 0.0, []
    for power in inputs["power"].tolist():
        measured.append(temperature)
        temperature = keep * temperature + (1 - keep) * parameters["gain"] * power
    return measured


SETTING = {
    "parameters": {
        "gain": truetwin.Parameter((1.0, 3.0), bounds=(0.1, 10.0), unit="K/W"),
        "tau": truetwin.Parameter((5.0, 20.0), bounds=(1.0, 100.0), unit="s"),
    },
    "inputs": {"power": "W"},
    "outputs": {"temperature": "K"},
    "step": 1.0,
}


@pytest.fixture
def twin() -> truetwin.Twin:
    return truetwin.Twin(heater, **SETTING, noise=0.02, samples=100, levels=(-1, 1), hold=10)


@pytest.fixture(scope="session")
def record() -> dict[str, np.ndarray]:
    """A record of the heater with gain 2 and tau 10."""
    rng = np.random.default_rng(1)
    time = np.arange(100.0)
    power = np.repeat(rng.uniform(-1, 1, 10), 10)
    temperature = np.array(heater({"gain": 2.0, "tau": 10.0}, {"power": power}, time))
    return {"t": time, "power": power, "temperature": temperature + rng.normal(0, 0.02, 100)}


@pytest.fixture
def csv(record, tmp_path: Path) -> Path:
    path = tmp_path / "record.csv"
    table = np.column_stack(list(record.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(record), comments="", fmt="%.17g")
    return path
