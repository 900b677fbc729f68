"""Numbers that users give: masks, missing values and other kinds of objects in records, results and arguments."""

from __future__ import annotations

import warnings
from decimal import Decimal

import numpy as np
import pytest

import truetwin
from conftest import SETTING, heater

TANK = {
    "parameters": {"k": (0.2, 1.0)},
    "states": {"h": {"rate": "u - k*h", "start": 0.5}},
    "inputs": "u",
    "outputs": {"y": "h"},
    "step": 0.2,
    "levels": (0.0, 1.0),
}


def refused(part: str, call) -> str:
    """Return the message of a call that is refused: one line with this part."""
    with pytest.raises((TypeError, ValueError, truetwin.TruetwinError)) as caught:
        call()
    message = str(caught.value)
    assert part in message and "\n" not in message, message
    return message


def test_masked_values_of_a_function_are_not_numbers():
    """As nan, they are a divergence, and named where the point is finite."""

    def hidden(t, x, u, theta):
        return np.ma.array(x * 0 + 50.0, mask=True)

    def seen(t, x, u, theta):
        return np.ma.array(x, mask=x > -1)

    twin = {"parameters": {"k": (0.2, 1.0)}, "states": {"h": {"start": 0.5}}, "inputs": "u", "outputs": {"y": {"value": "h"}}, "step": 0.2}
    for record, verb in [({"integrator": "euler"}, "drift"), ({"integrator": "discrete"}, "next")]:
        masked = truetwin.Twin(**twin, drift=hidden, levels=(0, 1), record=record)
        refused(f"`hidden` answered {verb} with NaN for h at t = 0 s", lambda: masked.simulate({"k": 0.6}))
    shown = truetwin.Twin(**{**twin, "outputs": {"y": "m"}}, drift=lambda t, x, u, theta: u - x, observe=seen, levels=(0, 1), name="seen")
    refused("`seen` answered observe with NaN for y", lambda: shown.simulate({"k": 0.6}))


@pytest.mark.parametrize("kind", ["constant", "columns", "list"])
def test_masked_outputs_of_a_simulator_are_not_numbers(record, kind):
    columns = {
        "constant": lambda n: [np.ma.masked] + [0.0] * (n - 1),
        "columns": lambda n: [np.ma.array([0.0], mask=True)] + [[0.0]] * (n - 1),
        "list": lambda n: np.ma.array([None] + [0.0] * (n - 1), dtype=object, mask=[True] + [False] * (n - 1)),
    }
    twin = truetwin.Twin(lambda parameters, inputs, time: columns[kind](len(time)), **SETTING)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refused("diverged at t = 0 s", lambda: twin.simulate({"gain": 2, "tau": 9}, {"t": record["t"], "power": record["power"]}))


def test_objects_are_numbers_or_missing_or_refused(twin, record):
    pandas = pytest.importorskip("pandas")
    measured = record["temperature"]
    expected = twin.fit(record).parameters
    assert twin.fit({**record, "temperature": [Decimal(str(float(value))) for value in measured]}).parameters == pytest.approx(expected)
    missing = twin.fit({**record, "temperature": [np.nan, *measured[1:]]}).parameters
    for nothing in (None, pandas.NA, np.ma.masked, pandas.NaT):
        assert twin.fit({**record, "temperature": [nothing, *measured[1:]]}).parameters == missing
    for wrong, part in [
        ([*measured[:7], "warm", *measured[8:]], "record 1, column temperature: 'warm' in row 7 (counted from 0), which is no number"),
        (measured.astype(str), "in row 0 (counted from 0), which is no number; give numbers, nan where missing"),
        (pandas.Series(measured).astype("string"), "in row 0 (counted from 0), which is no number"),
        (np.array([1j, *measured[1:]], dtype=object), "complex values; give real ones"),
        ([10**400, *measured[1:]], "a number beyond those of floats"),
        ([[1.0], [1.0, 2.0]], "parts of different lengths"),
        (np.arange(100).astype("m8[s]"), "times; give numbers"),
    ]:
        refused(part, lambda: twin.fit({**record, "temperature": wrong}))


@pytest.mark.parametrize("level", ["a", 1 + 0j, np.complex128(1), float("nan"), True, [0.1], -0.1, np.ma.masked])
def test_a_wrong_noise_level_names_the_output(level):
    part = f"noise of temperature = {level!r}; give a standard deviation, 0 or more, in the unit of the output"
    refused(part, lambda: truetwin.Twin(heater, **SETTING, noise=level))
    refused(part, lambda: truetwin.Twin(heater, **SETTING, noise={"temperature": level}))
    refused(part.replace("temperature", "y"), lambda: truetwin.Twin(**TANK, noise=level))


def test_noise_of_equations_may_be_an_expression_by_name():
    assert 'noise = "0.1*abs(h)"' in truetwin.Twin(**TANK, noise={"y": "0.1*abs(h)"}).toml()
    assert "noise = 0.1" in truetwin.Twin(**TANK, noise={"h": Decimal("0.1")}).toml()
    refused("noise of z; the outputs are y", lambda: truetwin.Twin(**TANK, noise={"z": 0.1}))


@pytest.mark.parametrize("value", ["x", float("nan"), float("inf"), 2.5, True, 1j, 0])
def test_wrong_numbers_of_samples_are_named(value):
    part = f"hold = {value!r}; give a whole number of samples, at least 1"
    refused(part, lambda: truetwin.Twin(heater, **SETTING, hold=value))
    refused(f"samples = {value!r}; give a whole number", lambda: truetwin.Twin(heater, **SETTING, samples=value))
    levels = {"power": {"levels": (-1, 1), "hold": value}}
    refused("levels: power, " + part, lambda: truetwin.Twin(heater, **SETTING, levels=levels))


@pytest.mark.parametrize("value", [-1, 1.5, 1.0, True, "1", 1j])
def test_wrong_whole_numbers_are_named(twin, record, tmp_path, value):
    for name, call in {
        "seed": lambda: twin.fit(record, seed=value),
        "threads": lambda: truetwin.Twin(heater, **SETTING, threads=value),
        "workers": lambda: truetwin.Twin(heater, **SETTING, workers=value),
        "calibrate": lambda: twin.diagnose(record, calibrate=value),
        "trials": lambda: twin.withheld(value),
        "bank_size": lambda: twin.pretrain(tmp_path / "e.est", bank_size=value),
        "epochs": lambda: twin.pretrain(tmp_path / "e.est", epochs=value),
    }.items():
        refused(f"{name} = {value!r}; give a whole number, ", call)


def test_wrong_numbers_of_other_arguments_are_named(twin, record):
    inputs = {"t": record["t"], "power": record["power"]}
    refused("parameters: gain = 'a'; give a number", lambda: twin.simulate({"gain": "a", "tau": 10}, inputs))
    refused("parameters: no value for tau; give tau", lambda: twin.simulate({"gain": 2}, inputs))
    refused("seed = None; give a whole number, from 0 to", lambda: twin.fit(record, seed=None))
    for name in ("step", "timeout"):
        for value in ("x", float("nan"), 0, True, 1j):
            refused(f"{name} = {value!r}; give a number of seconds above 0", lambda: truetwin.Twin(heater, **{**SETTING, name: value}))
    for value in (3, ("a", 1), "ab", (1j, 2), (True, False)):
        refused(f"parameters: k = {value!r}; give (low, high)", lambda: truetwin.Twin(**{**TANK, "parameters": {"k": value}}))
    bounds = truetwin.Parameter((0, 1), bounds=(0, None))
    refused("parameters: k, bounds = (0, None); give", lambda: truetwin.Twin(**{**TANK, "parameters": {"k": bounds}}))
    for changes, part in [
        ({"constants": {"g": 1j}}, "constants: g = 1j; give a text"),
        ({"states": {"h": {"rate": "u - k*h", "start": None}}}, "h, start = None; give a text"),
        ({"record": {"substeps": 1j}}, "substeps = 1j; give a number"),
        ({"levels": {"u": 1j}}, "levels: u = 1j; give (low, high)"),
    ]:
        refused(part, lambda: truetwin.Twin(**{**TANK, **changes}))
    with pytest.raises(ValueError, match="time of the divergence = nan; give the time"):
        truetwin.Diverged(float("nan"))


def test_a_description_is_refused_before_the_program_starts():
    """In a thread of the server it would be no error of the call."""
    twin = {"drift": lambda t, x, u, theta: u - x, "parameters": {"k": (0.2, 1.0)}, "states": ["h"], "inputs": "u", "outputs": {"y": "h"}}
    refused("substeps = 1j; give a number or a text", lambda: truetwin.Twin(**twin, record={"substeps": 1j}))
