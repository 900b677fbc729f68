"""Results as typed objects. ``raw`` is the JSON object of the program, with every number."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ._report import Report

Json = dict[str, Any]
Verdict = Literal["no-gap", "parameter-gap", "structural-gap"]
Decision = Literal["named", "class", "partial", "none-of-these", "absorbed", "not-needed"]


@dataclass(frozen=True, repr=False)
class Result:
    """Common part of results.

    Attributes
    ----------
    raw : dict
        The JSON object of the program.
    report : Report
        The same for people.
    """

    raw: Json = field(compare=False)
    report: Report = field(compare=False)

    def __repr__(self) -> str:
        return self.report.text

    def _repr_html_(self) -> str:
        return self.report._repr_html_()


def _texts(raw: Json) -> tuple[str, ...]:
    return tuple(f"{warning['what']}; {warning['remedy']}" for warning in raw.get("warnings", ()))


@dataclass(frozen=True, repr=False)
class Fit(Result):
    """Fitted parameters.

    Attributes
    ----------
    parameters : dict of str to float
        Most probable values.
    std_errors : dict of str to float or None
        Standard errors; None where the record gives none.
    intervals : dict of str to (float, float)
        Intervals of probability `level`; a parameter has none where the search has not arrived.
    level : float
        Probability that an interval holds the parameter.
    profiles : dict of str to (list of float, list of float)
        Profile likelihoods: values of a parameter, and the log-likelihood at each below the highest.
    noise : dict of str to float
        Fitted standard deviations of process and measurement noise.
    at_bound : tuple of str
        Parameters at an end of their bounds: the interval is not trustworthy.
    converged : bool
        Whether the optimisation met its certificate.
    warnings : tuple of str
        Doubts about the result.
    """

    parameters: Mapping[str, float]
    std_errors: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float]]
    level: float
    profiles: Mapping[str, tuple[list[float], list[float]]]
    noise: Mapping[str, float]
    at_bound: tuple[str, ...]
    converged: bool
    warnings: tuple[str, ...]

    @classmethod
    def _of(cls, raw: Json, report: Report) -> Fit:
        fitted = raw["parameters"]
        return cls(
            raw=raw,
            report=report,
            parameters={p["name"]: p["value"] for p in fitted},
            std_errors={p["name"]: p["std_error"] for p in fitted},
            intervals={p["name"]: (p["low"], p["high"]) for p in fitted if p["low"] is not None},
            level=raw["level"],
            profiles={p["name"]: (p["values"], p["log_likelihoods"]) for p in raw["profiles"]},
            noise={n["name"]: n["value"] for n in raw["noise"]},
            at_bound=tuple(p["name"] for p in fitted if p["at_bound"] is not None),
            converged=raw["convergence"]["converged"],
            warnings=_texts(raw),
        )


@dataclass(frozen=True, repr=False)
class Estimate(Result):
    """Parameters from a trained estimator.

    Attributes
    ----------
    parameters, std_errors : dict of str to float
        Estimates and their standard errors.
    intervals : dict of str to (float, float)
        Intervals of probability `level`.
    level : float
        Probability that an interval holds the parameter.
    initial : dict of str to float
        The network's estimate before any refinement.
    p_value : float or None
        p-value of the consistency test of the initial estimate.
    consistent : bool or None
        Whether the calibrated twin is consistent with the record; None if this could not be tested.
    refitted : bool
        Whether the estimate was refined on this record.
    warnings : tuple of str
        Doubts about the result.
    """

    parameters: Mapping[str, float]
    std_errors: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    level: float
    initial: Mapping[str, float]
    p_value: float | None
    consistent: bool | None
    refitted: bool
    warnings: tuple[str, ...]

    @classmethod
    def _of(cls, raw: Json, report: Report) -> Estimate:
        names, interval = raw["names"], raw["interval"]
        after = raw["after"]
        return cls(
            raw=raw,
            report=report,
            parameters=dict(zip(names, raw["theta"]["final"])),
            std_errors=dict(zip(names, raw["std_error"])),
            intervals=dict(zip(names, zip(interval["low"], interval["high"]))),
            level=interval["level"],
            initial=dict(zip(names, raw["theta"]["initial"])),
            p_value=raw["gate"]["p_value"],
            consistent=after["consistent"] if after else not raw["gate"]["out_of_distribution"],
            refitted=after is not None,
            warnings=_texts(raw),
        )


@dataclass(frozen=True)
class Effect:
    """An effect that the twin may lack.

    Attributes
    ----------
    id, target : str
        Kind of effect, and the place where it acts.
    probability : float
        Probability that the twin lacks it.
    log_evidence : float or None
        Evidence for it over the twin without effects, in nats; 3 nats are odds of 20 to 1.
    magnitudes : dict of str to float or None
        Fitted magnitudes.
    also : tuple of str
        Other effects that do the same in this twin, as ``id@target``; they share the probability.
    """

    id: str
    target: str
    probability: float
    log_evidence: float | None
    magnitudes: Mapping[str, float | None]
    also: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.id}@{self.target}"


@dataclass(frozen=True, repr=False)
class Diagnosis(Result):
    """What the twin lacks.

    Attributes
    ----------
    verdict : str
        ``"no-gap"``, ``"parameter-gap"`` (parameters outside the prior explain the records) or ``"structural-gap"``.
    decision : str
        ``"named"``: an effect or a pair is accepted. ``"class"``: rivals that the data cannot tell apart. ``"partial"``: effects
        explain most, something remains. ``"none-of-these"``: no listed effect. ``"absorbed"``: parameters outside the prior explain
        the records, and so does an effect. ``"not-needed"``: no gap.
    accepted : tuple of str
        Accepted effects as ``id@target``.
    rivals : tuple of str
        Effects that the data cannot tell apart.
    effects : tuple of Effect
        Weighed effects, most probable first.
    places : dict of str to float
        Probability that the gap is at a place.
    log_evidence : float or None
        Evidence for a gap in nats.
    parameters : dict of str to float
        Refitted parameters.
    std_errors : dict of str to float or None
        Standard errors of the refitted parameters.
    probabilities : dict of str to float
        Probabilities of the kinds of answer: listed, partial, unknown, nothing.
    warnings : tuple of str
        Doubts about the result.
    """

    verdict: Verdict
    decision: Decision
    accepted: tuple[str, ...]
    rivals: tuple[str, ...]
    effects: tuple[Effect, ...]
    places: Mapping[str, float]
    log_evidence: float | None
    parameters: Mapping[str, float]
    std_errors: Mapping[str, float | None]
    probabilities: Mapping[str, float]
    warnings: tuple[str, ...]

    @classmethod
    def _of(cls, raw: Json, report: Report) -> Diagnosis:
        which, where = raw["which"], raw["where"]
        return cls(
            raw=raw,
            report=report,
            verdict=raw["verdict"],
            decision=which["decision"],
            accepted=tuple(which["accepted"]),
            rivals=tuple(which["class"]),
            effects=tuple(
                Effect(
                    e["id"], e["target"], e["probability"], e["log_evidence"], e["magnitudes"], tuple(e["also"])
                )
                for e in which["effects"]
            ),
            places={place["target"]: place["probability"] for place in where["targets"]},
            log_evidence=raw["detection"]["log_evidence"],
            parameters={p["name"]: p["refitted"] for p in raw["parameters"]},
            std_errors={p["name"]: p["std_error"] for p in raw["parameters"]},
            probabilities=which["probabilities"] or {},
            warnings=_texts(raw),
        )


@dataclass(frozen=True, repr=False)
class Scorecard(Result):
    """Scores of diagnoses of trials with known truth.

    Attributes
    ----------
    trials : int
        Number of trials.
    false_alarms, detected : (int, int)
        Count and number of trials: a gap stated where nothing is missing, and where something is.
    seal : str
        SHA-256 of the key file, printed before the first diagnosis.
    """

    trials: int
    false_alarms: tuple[int, int]
    detected: tuple[int, int]
    seal: str

    @classmethod
    def _of(cls, raw: Json, report: Report) -> Scorecard:
        return cls(
            raw=raw,
            report=report,
            trials=raw["trials"],
            false_alarms=_share(raw["false_alarms"]),
            detected=_share(raw["detected"]),
            seal=raw["seal"],
        )


def _share(raw: Json) -> tuple[int, int]:
    return raw["count"], raw["of"]


@dataclass(frozen=True)
class Finding:
    """One line of a check.

    Attributes
    ----------
    check : str
        Name of the check.
    severity : str
        ``"pass"``, or how bad the finding is.
    message : str
        What was found, and the remedy.
    """

    check: str
    severity: str
    message: str


@dataclass(frozen=True, repr=False)
class Check(Result):
    """Findings about a twin, or about a record and a twin.

    Attributes
    ----------
    findings : tuple of Finding
        All findings.
    warnings : tuple of str
        Messages of the findings that are no pass.
    """

    findings: tuple[Finding, ...]
    warnings: tuple[str, ...]

    @classmethod
    def _of(cls, raw: Json) -> Check:
        findings = tuple(Finding(f["check"], f["severity"], f["message"]) for f in raw["findings"])
        text = "\n".join(f"{f.severity:7}  {f.check:12}  {f.message}" for f in findings)
        return cls(
            raw=raw,
            report=Report(text),
            findings=findings,
            warnings=tuple(f.message for f in findings if f.severity != "pass"),
        )


@dataclass(frozen=True)
class Estimator(os.PathLike[str]):
    """A trained estimator in a file.

    Attributes
    ----------
    path : Path
        The file.
    bank_size : int
        Number of training simulations.
    loss : float
        Loss at the end of the training.
    raw : dict
        The JSON object of the program.
    """

    path: Path
    bank_size: int
    loss: float
    raw: Json = field(compare=False, repr=False)

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    @classmethod
    def _of(cls, raw: Json, path: Path) -> Estimator:
        return cls(path=path, bank_size=raw["bank_size"], loss=raw["loss"], raw=raw)
