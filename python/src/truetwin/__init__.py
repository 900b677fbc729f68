"""Calibrate simulators against measured data and diagnose what they are missing.

A simulator is a Python callable, or a twin that the program ``truetwin`` knows. The program does the work; this module
starts it, answers its requests for simulations, and returns results as typed objects.

Examples
--------
>>> import truetwin
>>> twin = truetwin.Twin.named("tanks")
>>> record = twin.simulate({"k1": 0.6, "k2": 0.6, "k3": 0.6, "k4": 1.0})
>>> fit = twin.fit(record)
>>> sorted(fit.parameters)
['k1', 'k2', 'k3', 'k4']
"""

from ._errors import Diverged, Interrupted, InternalError, TruetwinError
from ._report import Report
from ._results import Check, Diagnosis, Effect, Estimate, Estimator, Finding, Fit, Scorecard
from ._simulator import Parameter
from ._twin import Twin

__all__ = [
    "Check",
    "Diagnosis",
    "Diverged",
    "Effect",
    "Estimate",
    "Estimator",
    "Finding",
    "Fit",
    "InternalError",
    "Interrupted",
    "Parameter",
    "Report",
    "Scorecard",
    "TruetwinError",
    "Twin",
]
