"""A twin in Python: a pendulum that is pushed. Nothing but the standard library; a template for a simulator of your own.

    truetwin check    --program 'python3 examples/pendulum.py'
    truetwin pretrain --program 'python3 examples/pendulum.py' --out pendulum.est
    truetwin estimate record.csv --program 'python3 examples/pendulum.py' --estimator pendulum.est

It reads one request a line and writes one answer a line, until its input ends (docs/external-programs.md).
"""

import json
import math
import random
import sys

DESCRIPTION = {
    "name": "pendulum",
    "parameters": [
        # prior: where training simulations are drawn from; bounds: what is physically possible.
        {"name": "length", "unit": "m", "prior": [0.5, 1.5], "bounds": [0.1, 4.0]},
        {"name": "damping", "unit": "1/s", "prior": [0.1, 0.6], "bounds": [0.0, 3.0]},
    ],
    "inputs": [{"name": "push", "unit": "rad/s^2"}],
    "outputs": [{"name": "angle", "unit": "rad"}],
    "record": {"step": 0.05, "samples": 300, "input": {"levels": [-2, 2], "hold": 20}},
}
NOISE = 0.02  # of the angle sensor, rad


def simulate(theta, step, inputs, seed):
    """The measured angle at times 0, step, 2 step, …; push[k] acts from sample k to sample k + 1."""
    # All randomness comes from the seed, one draw a sample whatever theta is; without a seed there is none.
    noise = random.Random(seed) if seed is not None else None
    stiffness, damping = 9.81 / theta["length"], theta["damping"]
    angle, speed = 0.0, 0.0
    measured = []
    for push in inputs["push"]:
        # Row k is what is measured at time k: first measure, then move.
        measured.append(angle + (NOISE * noise.gauss(0.0, 1.0) if noise else 0.0))
        acceleration = lambda a, v: push - stiffness * math.sin(a) - damping * v
        # One step of Runge and Kutta's method of order four.
        a1, v1 = speed, acceleration(angle, speed)
        a2, v2 = speed + step / 2 * v1, acceleration(angle + step / 2 * a1, speed + step / 2 * v1)
        a3, v3 = speed + step / 2 * v2, acceleration(angle + step / 2 * a2, speed + step / 2 * v2)
        a4, v4 = speed + step * v3, acceleration(angle + step * a3, speed + step * v3)
        angle += step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        speed += step / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    return {"angle": measured}


for line in sys.stdin:
    request = json.loads(line)
    if request["request"] == "describe":
        answer = DESCRIPTION
    else:
        outputs = simulate(request["theta"], request["step"], request["inputs"], request["seed"])
        answer = {"id": request["id"], "outputs": outputs}
    print(json.dumps(answer), flush=True)  # Without the flush, the answer waits in a buffer. Messages go to sys.stderr.
