"""Twins whose equations are Python functions over arrays of points."""

from __future__ import annotations

import os

import numpy as np
import pytest

import truetwin

SETTING = {
    "parameters": {"k": truetwin.Parameter((0.2, 1.0), bounds=(0.05, 3.0), unit="1/s")},
    "states": {"h": {"unit": "m", "start": 0.5, "noise": 0.002}},
    "inputs": {"u": "m/s"},
    "outputs": {"y": {"value": "h", "noise": 0.02}},
    "step": 0.2,
    "samples": 40,
    "levels": (0.2, 1.0),
    "hold": 8,
    "record": {"integrator": "euler"},
}


def tank(t, x, u, theta):
    return u - theta * x


def tank_twin(**changes) -> truetwin.Twin:
    return truetwin.Twin(**{"drift": tank, **SETTING, **changes})


def text_twin() -> truetwin.Twin:
    states = {"h": {**SETTING["states"]["h"], "rate": "u - k*h"}}
    return truetwin.Twin(**{**SETTING, "states": states, "name": "tank"})


def test_functions_are_the_equations_as_text():
    functions, text = tank_twin(), text_twin()
    record = functions.simulate({"k": 0.6})
    for name, values in text.simulate({"k": 0.6}).items():
        np.testing.assert_allclose(record[name], values, rtol=1e-9)
    assert functions.fit(record).parameters["k"] == pytest.approx(text.fit(record).parameters["k"], rel=1e-4)
    assert functions.check().warnings is not None


def test_outputs_may_be_a_function_and_time_may_be_discrete():
    def decay(t, x, u, theta):
        return x - 0.2 * theta * x + 0.2 * u

    def show(t, x, u, theta):
        return x[0]

    outputs = {"y": {"unit": "m", "noise": 0.02}}
    twin = tank_twin(drift=decay, observe=show, outputs=outputs, record={"integrator": "discrete"})
    record, euler = twin.simulate({"k": 0.6}, noise_free=True), tank_twin().simulate({"k": 0.6}, noise_free=True)
    np.testing.assert_allclose(record["y"], euler["y"], rtol=1e-9)


def test_a_wrong_result_is_one_line_with_the_function_and_both_shapes():
    def listed(t, x, u, theta):
        return [0.0]

    def flat(t, x, u, theta):
        return np.zeros((2, x.shape[1]))

    def broken(t, x, u, theta):
        return x * (1 // len(()))

    def undefined(t, x, u, theta):
        return x * np.nan

    for function, part in [
        (listed, r"listed returned a list; return an array of shape \(1, 1\): h by points"),
        (flat, r"flat returned shape \(2, 1\); return an array of shape \(1, 1\)"),
        (broken, r"test_points\.py, line \d+: ZeroDivisionError"),
        (undefined, r"`undefined` answered drift with NaN for h at t = 0 s, h = 0\.5"),
    ]:
        with pytest.raises(truetwin.TruetwinError, match=part) as caught:
            tank_twin(drift=function).simulate({"k": 0.6})
        assert "\n" not in caught.value.line


def test_wrong_arguments_are_refused():
    with pytest.raises(ValueError, match="give states="):
        tank_twin(states=None, record=None)
    with pytest.raises(ValueError, match="states without rates"):
        truetwin.Twin(observe=tank, parameters={"k": (0.2, 1.0)}, states=["h"], outputs="y")
    with pytest.raises(ValueError, match="only a twin of equations has a text"):
        tank_twin().toml()


@pytest.mark.skipif("TRUETWIN_SLOW" not in os.environ, reason="takes minutes; set TRUETWIN_SLOW=1")
def test_an_effect_inside_is_named():
    """An outflow that begins above a level, which the twin lacks."""
    leaky = truetwin.Twin(**{**SETTING, "states": {"h": {**SETTING["states"]["h"], "rate": "u - k*h - 0.4*(h > 0.8)"}}, "samples": 120})
    diagnosis = tank_twin(samples=120).diagnose(leaky.simulate({"k": 0.4}), quick=True)
    assert diagnosis.verdict == "structural-gap"
    assert any(effect.target == "h" for effect in diagnosis.effects), diagnosis.effects


def test_a_point_that_diverges_takes_no_other_along():
    def fragile(t, x, u, theta):
        if (x > 2.0).any():
            raise truetwin.Diverged
        return u - theta * x

    model = tank_twin(drift=fragile)._model
    table = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.5, 0.5, 0.5], [1.0, 3.0, 2.0]])
    line = b'{"request": "drift", "id": 7, "points": 3, "bytes": 96}'
    answer = model.answer(line, lambda count: table.tobytes())
    values = np.frombuffer(answer.partition(b"\n")[2], "<f8")
    np.testing.assert_array_equal(values, [0.5, np.nan, 0.0])
