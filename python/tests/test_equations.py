"""Twins of equations: texts and expressions of sympy become files, and files become answers."""

from __future__ import annotations

from pathlib import Path

import pytest
import truetwin

TANK = {
    "parameters": {"k": (0.2, 1.0)},
    "inputs": {"u": "m/s"},
    "states": {"h": {"rate": "u - k*h", "start": 0.0, "unit": "m"}},
    "outputs": {"y": {"value": "h", "unit": "m"}},
    "noise": 0.02,
    "step": 0.1,
    "levels": (0.0, 1.0),
    "name": "tank",
}


def test_keywords_are_a_file() -> None:
    text = truetwin.Twin(**TANK).toml()
    for line in ['name = "tank"', "k = { prior = [0.2, 1.0] }", 'h = { rate = "u - k*h", start = 0.0, unit = "m" }', "noise = 0.02"]:
        assert line in text


def test_events_are_tables() -> None:
    ball = {
        "parameters": {"e": (0.5, 0.95)},
        "states": {"h": {"rate": "v", "start": 1.0}, "v": {"rate": "-9.81", "start": 0.0}},
        "outputs": {"y": {"value": "h", "noise": 0.001}},
        "events": [{"when": "h < 0", "set": {"h": 0, "v": "-e*v"}}, {"at": [0.25, "1/e"], "add": {"v": 0}}],
        "step": 0.05,
        "samples": 20,
    }
    twin = truetwin.Twin(**ball)
    assert '[[event]]\nwhen = "h < 0"\nset = { h = 0.0, v = "-e*v" }' in twin.toml()
    assert 'at = [0.25, "1/e"]' in twin.toml()
    heights = twin.simulate({"e": 0.8}, seed=1)["y"]
    assert min(heights) > -0.005 and max(heights[15:]) > 0.3
    with pytest.raises(ValueError, match="events and record belong to equations"):
        truetwin.Twin(lambda parameters, inputs, time: time, parameters={"e": (0, 1)}, outputs="y", step=0.1, events=ball["events"])


def test_each_input_may_have_its_plan(tmp_path: Path) -> None:
    (tmp_path / "w.csv").write_text("t,w\n0,1\n0.1,2\n0.2,4\n", encoding="utf-8")
    three = {
        **TANK,
        "inputs": {"u": "m/s", "v": "m/s", "w": "m/s"},
        "states": {"h": {"rate": "u + v + w - k*h", "start": 0.0}},
        "samples": 3,
        "levels": {"u": {"levels": (0, 1), "hold": 3}, "v": 60, "w": tmp_path / "w.csv"},
    }
    twin = truetwin.Twin(**three)
    assert "u = { levels = [0.0, 1.0], hold = 3 }, v = 60.0, w = " in twin.toml()
    record = twin.simulate({"k": 0.6})
    assert len(set(record["u"])) == 1 and 0 <= record["u"][0] <= 1
    assert list(record["v"]) == [60.0] * 3 and list(record["w"]) == [1.0, 2.0, 4.0]
    with pytest.raises(truetwin.TruetwinError, match="w has no plan"):
        truetwin.Twin(**{**three, "levels": {"u": (0, 1), "v": 60}}).simulate({"k": 0.6})
    for wrong in ({"u": (0, 1, 2)}, {"u": True}, {"u": None}, {"u": {"low": 0}}):
        with pytest.raises(ValueError, match="levels: u .*give"):
            truetwin.Twin(**{**TANK, "levels": wrong})


def test_a_fit_of_equations() -> None:
    twin = truetwin.Twin(**TANK)
    record = twin.simulate({"k": 0.6}, seed=3)
    assert list(record) == ["t", "u", "y"]
    fit = twin.fit(record)
    assert abs(fit.parameters["k"] - 0.6) < 5 * (fit.std_errors["k"] or 0.0)


def test_a_fault_names_its_place() -> None:
    twin = truetwin.Twin(**{**TANK, "states": {"h": "u - kk*h"}})
    with pytest.raises(truetwin.TruetwinError, match='column .*unknown name "kk"'):
        twin.check()


def test_sympy() -> None:
    sympy = pytest.importorskip("sympy")
    k, h, u = sympy.symbols("k h u")
    rate = sympy.Piecewise((u - k * sympy.sqrt(h), h > 0), (u, True))
    text = truetwin.Twin(**{**TANK, "states": {"h": rate}}).toml()
    assert "sqrt(h)" in text and "if((h > 0.0)" in text.replace("(h > 0)", "(h > 0.0)")
    with pytest.raises(TypeError, match="gamma of sympy is unknown"):
        truetwin.Twin(**{**TANK, "states": {"h": sympy.gamma(h)}})


def test_what_does_not_belong_together_is_refused() -> None:
    with pytest.raises(ValueError, match="equations stand alone"):
        truetwin.Twin(lambda parameters, inputs, time: time, **TANK)
    with pytest.raises(ValueError, match="outputs="):
        truetwin.Twin(parameters={"k": (0, 1)}, states={"h": "-k*h"})
    with pytest.raises(ValueError, match="only a twin of equations"):
        truetwin.Twin.named("tanks").toml()
