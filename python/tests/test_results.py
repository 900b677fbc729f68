"""What a user asks, and the objects that come back."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import truetwin
from conftest import SETTING, heater


def test_a_fit_recovers_the_parameters(twin, csv):
    fit = twin.fit(csv)
    assert fit.parameters["gain"] == pytest.approx(2.0, abs=0.05)
    assert fit.parameters["tau"] == pytest.approx(10.0, abs=0.5)
    assert fit.noise["temperature"] == pytest.approx(0.02, rel=0.3)
    low, high = fit.intervals["tau"]
    assert low < fit.parameters["tau"] < high and fit.level == 0.9
    assert fit.converged and fit.warnings == () and fit.at_bound == ()
    assert fit.raw["schema"] == "truetwin.fit/1"
    assert str(fit).startswith("2 parameters fitted to 100 samples:")
    with pytest.raises(dataclasses.FrozenInstanceError):
        fit.level = 0.5


def test_doubts_are_texts(record):
    """The truth, tau = 10, is out of bounds."""
    setting = {**SETTING, "parameters": {"gain": (1.0, 3.0), "tau": (12.0, 20.0)}}
    fit = truetwin.Twin(heater, **setting).fit(record)
    assert fit.at_bound == ("tau",)
    assert any("tau" in warning and "; " in warning for warning in fit.warnings)


def test_a_diagnosis_names_a_biased_sensor(twin, record):
    biased = {**record, "temperature": record["temperature"] + 0.5}
    diagnosis = twin.diagnose(biased, without=["sensor-drift", "actuator-bias@actuator"])
    assert diagnosis.verdict == "structural-gap" and diagnosis.decision == "named"
    assert diagnosis.accepted == ("sensor-bias@sensor",)
    best = diagnosis.effects[0]
    assert str(best) == "sensor-bias@sensor" and best.magnitudes["offset"] == pytest.approx(0.5, abs=0.02)
    assert diagnosis.places["sensor"] > 0.9
    assert not {"sensor-drift", "actuator-bias"} & {effect.id for effect in diagnosis.effects}
    assert {"sensor-drift@sensor", "actuator-bias@actuator"} <= set(diagnosis.raw["not_tested"])


def test_nothing_is_missing_in_a_record_of_the_twin(twin, csv, record):
    diagnosis = twin.diagnose(csv, validation=record)
    assert diagnosis.verdict == "no-gap" and diagnosis.decision == "not-needed" and diagnosis.accepted == ()
    assert diagnosis.raw["shrinkage"]["held_out"] != "last third of the record"
    # Its level is fitted.
    assert "sensor-noise@sensor" in diagnosis.raw["not_tested"]


def test_frames_dicts_and_files_are_the_same_record(twin, record, csv):
    frame = pd.DataFrame(record)
    stamped = frame.drop(columns="t").set_index(pd.date_range("2024-01-01", periods=100, freq="s", tz="UTC"))
    expected = twin.fit(csv).parameters
    for given in (record, frame, stamped, frame.assign(comment="not a number"), {k: list(v) for k, v in record.items() if k != "t"}):
        assert twin.fit(given).parameters == expected
    several = twin.fit([record, csv])
    assert several.raw["samples"] == 200 and len(several.report.pictures) == 2


def test_columns_have_other_names(twin, record, tmp_path, monkeypatch):
    frame = pd.DataFrame({"time": record["t"], "power, W": record["power"], "T": record["temperature"], "x": "text"})
    with pytest.raises(ValueError, match="give the name of a column"):
        twin.fit(frame, columns={"t": "time", "u": "", "y": "T"})
    with pytest.raises(ValueError, match="pass at least one"):
        twin.fit([])
    frame = frame.rename(columns={"T": 'T "in"'})
    columns = {"t": "time", "power": "power, W", "temperature": 'T "in"'}
    frame.to_csv(tmp_path / "log.csv", index=False)
    fitted = twin.fit(tmp_path / "log.csv", columns=columns).parameters
    assert twin.fit(frame, columns=columns).parameters == fitted
    frame.to_csv(tmp_path / "-e.csv", index=False)
    monkeypatch.chdir(tmp_path)
    assert twin.fit("-e.csv", columns=columns).parameters == fitted


def test_missing_outputs_are_skipped(twin, record):
    measured = record["temperature"].copy()
    measured[10:20] = np.nan
    assert twin.fit({**record, "temperature": measured}).parameters["gain"] == pytest.approx(2.0, abs=0.1)


def test_an_estimator_is_trained_and_used(twin, record, tmp_path):
    estimator = twin.pretrain(tmp_path / "heater.est", bank_size=300, epochs=20)
    assert estimator.path.exists() and estimator.bank_size == 300
    estimate = twin.estimate(record, estimator)
    assert estimate.parameters.keys() == {"gain", "tau"} == estimate.intervals.keys()
    assert estimate.parameters["gain"] == pytest.approx(2.0, abs=0.3)
    assert estimate.consistent is True and estimate.warnings == ()
    refined = twin.estimate(record, tmp_path / "heater.est", always_refine=True)
    assert refined.refitted and refined.consistent is True
    assert refined.parameters["tau"] == pytest.approx(10.0, abs=1.0)
    assert estimate.report._repr_html_().startswith("<svg")


def test_simulated_records_have_the_type_of_the_inputs(twin):
    planned = twin.simulate({"gain": 2.0, "tau": 10.0})
    assert list(planned) == ["t", "power", "temperature"] and len(planned["t"]) == 100
    inputs = {"t": np.arange(5.0), "power": np.ones(5)}
    exact = twin.simulate({"gain": 2.0, "tau": 10.0}, inputs, noise_free=True)
    expected = heater({"gain": 2.0, "tau": 10.0}, inputs, inputs["t"])
    assert exact["temperature"].tolist() == expected
    noisy = twin.simulate({"gain": 2.0, "tau": 10.0}, pd.DataFrame(inputs))
    assert isinstance(noisy, pd.DataFrame) and noisy["temperature"].tolist() != expected


def test_twins_of_the_program(tmp_path):
    twin = truetwin.Twin.named("tanks")
    theta = {"k1": 0.6, "k2": 0.5, "k3": 0.55, "k4": 1.0}
    record = twin.simulate(theta, seed=3)
    assert list(record) == ["t", "u", "y"]
    (tmp_path / "tanks.toml").write_text('twin = "tanks"\n[fixed]\nk4 = 1.0\n')
    fit = truetwin.Twin(study=tmp_path / "tanks.toml").fit(record)
    assert fit.parameters.keys() == {"k1", "k2", "k3"}


def test_a_study_file_changes_a_callable(record, tmp_path):
    (tmp_path / "study.toml").write_text('twin = "heater"\n[fixed]\ntau = 10.0\n')
    fit = truetwin.Twin(heater, **SETTING, study=tmp_path / "study.toml").fit(record)
    assert fit.parameters.keys() == {"gain"}


def test_several_outputs_in_every_shape(record):
    def rows(parameters, inputs, time):
        one = np.asarray(heater(parameters, inputs, time))
        return np.column_stack([one, 2 * one])

    setting = {**SETTING, "outputs": ["a", "b"]}
    theta, inputs = {"gain": 2.0, "tau": 10.0}, {"t": record["t"], "power": record["power"]}
    forms = [rows, lambda *call: tuple(rows(*call).T), lambda *call: dict(zip("ab", rows(*call).T))]
    runs = [truetwin.Twin(form, **setting, name="rows").simulate(theta, inputs) for form in forms]
    for run in runs:
        assert list(run) == ["t", "power", "a", "b"]
        np.testing.assert_array_equal(run["b"], 2 * runs[0]["a"])
    # Noise of one output alone.
    noisy = truetwin.Twin(rows, **setting, noise={"b": 0.1}).simulate(theta, inputs)
    np.testing.assert_array_equal(noisy["a"], runs[0]["a"])
    assert np.std(noisy["b"] - runs[0]["b"]) == pytest.approx(0.1, rel=0.3)


def test_a_simulator_may_ask_for_step_and_seed(record):
    seen = []

    def noisy(parameters, inputs, time, *, step, seed):
        seen.append((step, seed))
        return np.zeros(len(time)) if seed is None else np.random.default_rng(seed).normal(size=len(time))

    twin = truetwin.Twin(noisy, **SETTING)
    inputs = {"t": record["t"], "power": record["power"]}
    assert twin.simulate({"gain": 1, "tau": 9}, inputs)["temperature"].std() > 0.5
    assert not twin.simulate({"gain": 1, "tau": 9}, inputs, noise_free=True)["temperature"].any()
    assert {step for step, _ in seen} == {1.0} and seen[-1][1] is None


def test_a_simulator_without_inputs():
    twin = truetwin.Twin(lambda p, u, t: np.exp(-p["rate"] * t), parameters={"rate": (0.1, 2.0)}, outputs="y", step=0.1, samples=50)
    record = twin.simulate({"rate": 0.7})
    record["y"] += np.random.default_rng(2).normal(0, 0.01, 50)
    assert twin.fit(record).parameters["rate"] == pytest.approx(0.7, abs=0.05)


def test_workers_give_the_same_bits(record):
    fits = [truetwin.Twin(heater, **SETTING, workers=workers).fit(record).raw for workers in (1, 3)]
    for raw in fits:
        del raw["seconds"], raw["provenance"]
    assert fits[0] == fits[1]


def test_a_check_lists_findings(twin, record):
    assert twin.check(record).warnings == ()
    about = twin.check()
    assert {"finite", "repeatable", "identifiable"} <= {finding.check for finding in about.findings}
    drifting = iter(range(10**6))
    changing = truetwin.Twin(lambda p, u, t: heater(p, u, t + 0) + np.full(len(t), next(drifting)), **SETTING, levels=(-1, 1), samples=50)
    failed = changing.check()
    assert failed.raw["passed"] is False and failed.warnings


def test_trials_are_scored():
    card = truetwin.Twin.named("van-der-pol").withheld(1, detection_only=True)
    assert card.trials == 1 and len(card.seal) == 64
    assert card.false_alarms[1] + card.detected[1] <= 1
    assert "iframe" in card._repr_html_()


def test_reports_show_in_notebooks(twin, csv, tmp_path):
    fit = twin.fit(csv)
    shown = fit.report._repr_html_()
    assert shown.startswith("<svg") and "<pre>2 parameters fitted" in shown
    diagnosis = twin.diagnose(csv, out=tmp_path / "gap")
    shown = diagnosis._repr_html_()
    # The page is data of one attribute: nothing of it ends the attribute early.
    assert shown.startswith('<iframe srcdoc="&lt;!doctype html&gt;') and shown.count('"') == 8
    diagnosis.report.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text() == diagnosis.report.page
    assert (tmp_path / "gap" / "report.html").read_text().startswith("<!doctype html>")
    fit.report.save(tmp_path / "fit.html")
    assert "<svg" in (tmp_path / "fit.html").read_text()


def test_pandas_is_not_imported(csv):
    code = (
        "import sys, truetwin; assert 'pandas' not in sys.modules\n"
        "record = truetwin.Twin.named('tanks').simulate(dict(k1=.6, k2=.6, k3=.6, k4=1))\n"
        "assert 'pandas' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})


def test_the_example_of_the_readme(tmp_path, record, monkeypatch):
    text = (Path(__file__).parents[1] / "README.md").read_text()
    example = re.search(r"```python\n(.*?)```", text, re.S).group(1)
    lines = [line for line in example.splitlines() if line.strip()]
    assert len(lines) <= 15, "aim: a CSV is diagnosed with a callable in 15 lines"
    columns = dict(zip(["t", "push", "angle"], (values[:50] for values in record.values())))
    columns["t"] = 0.05 * columns["t"]  # the step of the example's twin
    pd.DataFrame(columns).to_csv(tmp_path / "record.csv", index=False)
    monkeypatch.chdir(tmp_path)
    spaces = {"__name__": "example"}
    exec(compile(example, "README.md", "exec"), spaces)
    assert spaces["diagnosis"].verdict in ("no-gap", "parameter-gap", "structural-gap")
    assert json.dumps(spaces["diagnosis"].raw)


def test_outputs_of_a_frame_go_by_name():
    def rig(parameters, inputs, time):
        return pd.DataFrame({"speed": 0 * time + 2.0, "angle": parameters["a"] * time})

    twin = truetwin.Twin(rig, parameters={"a": (0.5, 2.0)}, outputs=["angle", "speed"], step=0.1, samples=4)
    record = twin.simulate({"a": 1.0})
    assert list(record["speed"]) == [2.0] * 4 and record["angle"][3] == pytest.approx(0.3)


def test_an_estimator_is_that_of_its_equations(tmp_path):
    def lag(rate, name="lag"):
        return truetwin.Twin(
            name=name, parameters={"τ": (0.5, 1.0)}, states={"θ": {"rate": rate, "start": 0.0}}, inputs=["push"],
            outputs={"y": {"value": "θ", "noise": 0.02}}, step=0.1, samples=np.int64(40), levels=(-1, 1), record={"substeps": np.int64(2)},
        )  # fmt: skip

    own = lag("(push - θ)/τ")
    estimator = own.pretrain(tmp_path / "lag.est", bank_size=200, epochs=1)
    record = own.simulate({"τ": 0.7})
    assert 0.5 < own.estimate(record, estimator).parameters["τ"] < 1.0
    with pytest.raises(truetwin.TruetwinError, match="made for another setting"):
        lag("(push - θ)/(3*τ)").estimate(record, estimator)
    with pytest.raises(truetwin.TruetwinError, match="made for twin lag"):
        lag("(push - θ)/τ", "other").estimate(record, estimator)
