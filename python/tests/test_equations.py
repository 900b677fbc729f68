"""Twins of equations: texts and expressions of sympy become files, and files become answers."""

from __future__ import annotations

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
