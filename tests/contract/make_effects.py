"""Writes effects/*.toml and the noise-free records that they must give: the laws of docs/choosing-effects.md once more,
in plain Python, so that two independent programs agree. Standard library only: python3 make_effects.py"""
import cmath, math, os

HERE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "effects")
DT = {"tanks": 0.5, "van-der-pol": 0.05}
N = 120
THETA = {"tanks": dict(k1=0.6, k2=0.5, k3=0.55, k4=1.0), "van-der-pol": dict(nu=1.5)}
INPUT = [level for level in (2.6, 0.4, 1.7, 0.0, 3.0, 1.1) for _ in range(20)]
clamp = lambda v, lo, hi: min(max(v, lo), hi)
sign = lambda v: (v > 0) - (v < 0)

def delayed(past, dt, delay):
    """value `delay` seconds before the last entry of `past`, linear between samples, held at the first before the start"""
    q = len(past) - 1 - delay / dt
    if q <= 0:
        return past[0]
    i = int(math.floor(q))
    f = q - i
    return past[i] if f == 0 else (1 - f) * past[i] + f * past[i + 1]

def rung(mem, m, dt, s):
    """z'' + 2 damping w z' + w^2 z = w^2 s over a step, s held, from rest at the first s: two complex modes"""
    w, d = 2 * math.pi * m["frequency"], m["damping"]
    p = complex(-d * w, w * math.sqrt(1 - d * d))
    z, v = mem.get("z", s), mem.get("v", 0.0)
    # z - s = 2 Re(c e^(p t)), z' = 2 Re(c p e^(p t))
    c = complex((z - s) / 2, 0)
    c += 1j * (2 * (c * p).real - v) / (2 * p.imag)
    e = c * cmath.exp(p * dt)
    mem["z"], mem["v"] = s + 2 * e.real, 2 * (e * p).real
    return mem["z"]

def bouc_wen(z, dv, width):
    """z' = (v' - |v'| z / 2 - v' |z| / 2) / width where v moves by dv on a line: back to zero on a line, then on an exponential"""
    s, way = (1 if dv > 0 else -1), abs(dv) / width
    if way == 0: return z
    if s * z < 0:
        if way <= abs(z): return z + s * way
        way, z = way - abs(z), 0.0
    return z + (s - z) * -math.expm1(-way)

def actuator(kind, m, u, dt, mem):
    """one sample of the input; `mem` holds what the law remembers"""
    if kind == "actuator-gain": return u * (1 + m["error"])
    if kind == "actuator-bias": return u + m["offset"]
    if kind == "actuator-dead-zone": return u - clamp(u, -m["width"] / 2, m["width"] / 2)
    if kind == "actuator-backlash":
        mem["v"] = clamp(mem.get("v", u), u - m["width"] / 2, u + m["width"] / 2); return mem["v"]
    if kind == "actuator-saturation": return clamp(u, m["low"], m["high"])
    if kind == "actuator-rate-limit":
        v = mem.get("v", u); mem["v"] = v + clamp(u - v, -m["rate"] * dt, m["rate"] * dt); return mem["v"]
    if kind == "actuator-lag":
        a = math.exp(-dt / m["tau"]); mem["v"] = a * mem.get("v", u) + (1 - a) * u; return mem["v"]
    if kind == "actuator-mode": return rung(mem, m, dt, u)
    if kind == "actuator-delay":
        mem.setdefault("past", []).append(u); return delayed(mem["past"], dt, m["delay"])
    return u

def sensor(kind, m, s, t, dt, mem):
    if kind == "sensor-bias": return s + m["offset"]
    if kind == "sensor-gain": return s * (1 + m["error"])
    if kind == "sensor-drift": return s + m["rate"] * t
    if kind == "sensor-lag":
        a = math.exp(-dt / m["tau"]); mem["z"] = a * mem.get("z", s) + (1 - a) * s; return mem["z"]
    if kind == "sensor-backlash":
        mem["z"] = clamp(mem.get("z", s), s - m["width"] / 2, s + m["width"] / 2); return mem["z"]
    if kind == "sensor-mode": return rung(mem, m, dt, s)
    if kind == "sensor-delay":
        mem.setdefault("past", []).append(s); return delayed(mem["past"], dt, m["delay"])
    if kind == "sensor-rectification": return (1 - m["fraction"]) * s + m["fraction"] * abs(s)
    if kind in ("sensor-saturation", "sensor-clipping"): return clamp(s, m["low"], m["high"])
    if kind == "sensor-quantization": return m["step"] * math.floor(s / m["step"] + 0.5)
    return s

def force(kind, m, x, xfrom, t):
    if kind == "constant-forcing": return m["force"]
    if kind == "coulomb-friction": return -m["force"] * sign(x)
    if kind == "stribeck-friction":
        return -m["force"] * (1 + m["excess"] * math.exp(-(x / m["velocity"]) ** 2)) * sign(x)
    if kind == "linear-loss": return -m["rate"] * x
    if kind == "cross-coupling": return m["rate"] * xfrom
    if kind == "quadratic-drag": return -m["coefficient"] * abs(x) * x
    if kind == "cubic-stiffness": return -m["coefficient"] * xfrom ** 3
    if kind == "power-law": return -m["coefficient"] * abs(x) ** m["exponent"] * sign(x)
    if kind == "periodic-disturbance": return m["amplitude"] * math.sin(2 * math.pi * m["frequency"] * t + m["phase"])
    return 0.0

def run(twin, kind=None, target=None, other=None, m=None):
    dt, th0 = DT[twin], THETA[twin]
    states = ["h1", "h2"] if twin == "tanks" else ["x1", "x2"]
    x = [0.0, 0.0] if twin == "tanks" else [1.0, 0.0]
    ma, ms, mz, rows = {}, {}, {}, []
    for k in range(N):
        t = k * dt
        th = dict(th0)
        if kind == "parameter-drift": th[target] *= 1 + m["rate"] * t
        if kind == "parameter-step": th[target] *= 1 + (m["size"] if t >= m["time"] else 0.0)
        u = INPUT[k]
        rows.append((t, u, sensor(kind, m, x[1] if twin == "tanks" else x[0], t, dt, ms)))
        v = actuator(kind, m, u, dt, ma)
        if twin == "tanks":
            s1, s2 = (math.sqrt(max(abs(h), 1e-6)) for h in x)
            dx = [-th["k1"] * s1 + th["k4"] * v, th["k2"] * s1 - th["k3"] * s2]
        else:
            dx = [x[1], th["nu"] * (1 - x[0] ** 2) * x[1] - x[0]]
        if kind == "state-hysteresis":
            now = x[states.index(other)]
            mz["z"] = bouc_wen(mz.get("z", 0.0), now - mz.get("v", now), m["width"])
            mz["v"] = now
            dx[states.index(target)] -= m["force"] * mz["z"]
        elif target in states:
            i = states.index(target)
            dx[i] += force(kind, m, x[i], x[states.index(other)] if other else 0.0, t)
        x = [a + dt * b for a, b in zip(x, dx)]
        if kind == "state-ceiling":
            i, j = states.index(target), states.index(other)
            e = max(x[i] - m["level"], 0.0)
            x[i] -= e
            x[j] += m["spill"] * e
        if kind == "state-floor":
            i = states.index(target)
            x[i] = max(x[i], m["level"])
        if twin == "tanks":
            x = [clamp(h, 0.0, 10.0) for h in x]
    return rows

CASES = [("tanks", "sensor-bias", "sensor", None, dict(offset=0.4)), ("tanks", "sensor-gain", "sensor", None, dict(error=-0.15)),
    ("tanks", "sensor-drift", "sensor", None, dict(rate=0.02)), ("tanks", "sensor-saturation", "sensor", None, dict(low=0.5, high=3.0)),
    ("tanks", "sensor-quantization", "sensor", None, dict(step=0.25)), ("tanks", "sensor-lag", "sensor", None, dict(tau=3.0)),
    ("tanks", "sensor-delay", "sensor", None, dict(delay=1.7)), ("van-der-pol", "sensor-rectification", "sensor", None, dict(fraction=0.7)),
    ("tanks", "actuator-bias", "actuator", None, dict(offset=0.3)), ("tanks", "actuator-gain", "actuator", None, dict(error=0.2)),
    ("tanks", "actuator-dead-zone", "actuator", None, dict(width=1.2)), ("tanks", "actuator-backlash", "actuator", None, dict(width=0.8)),
    ("tanks", "actuator-saturation", "actuator", None, dict(low=0.3, high=1.8)), ("tanks", "actuator-lag", "actuator", None, dict(tau=2.5)),
    ("tanks", "actuator-delay", "actuator", None, dict(delay=3.2)), ("tanks", "actuator-rate-limit", "actuator", None, dict(rate=0.25)),
    ("tanks", "constant-forcing", "h1", None, dict(force=0.2)), ("van-der-pol", "coulomb-friction", "x2", None, dict(force=0.15)),
    ("tanks", "linear-loss", "h1", None, dict(rate=0.2)), ("tanks", "cross-coupling", "h1", "h2", dict(rate=0.05)),
    ("van-der-pol", "quadratic-drag", "x2", None, dict(coefficient=0.1)), ("van-der-pol", "cubic-stiffness", "x2", "x1", dict(coefficient=0.2)),
    ("tanks", "power-law", "h2", None, dict(coefficient=0.1, exponent=1.5)), ("tanks", "state-ceiling", "h1", "h2", dict(level=2.5, spill=0.6)),
    ("tanks", "periodic-disturbance", "h1", None, dict(amplitude=0.4, frequency=0.03, phase=0.5)),
    ("tanks", "sensor-backlash", "sensor", None, dict(width=0.8)), ("tanks", "sensor-mode", "sensor", None, dict(frequency=0.15, damping=0.1)),
    ("tanks", "sensor-clipping", "sensor", None, dict(low=0.5, high=3.0)), ("tanks", "actuator-mode", "actuator", None, dict(frequency=0.1, damping=0.2)),
    ("van-der-pol", "stribeck-friction", "x2", None, dict(force=0.15, excess=0.8, velocity=0.5)),
    ("van-der-pol", "state-hysteresis", "x2", "x1", dict(force=0.4, width=0.3)), ("tanks", "state-hysteresis", "h1", "h1", dict(force=0.2, width=0.5)),
    ("tanks", "state-floor", "h1", None, dict(level=0.6)),
    ("tanks", "parameter-drift", "k3", None, dict(rate=-0.004)), ("van-der-pol", "parameter-step", "nu", None, dict(size=0.6, time=3.0))]

def write(path, twin, rows):
    cols = (0, 1, 2) if twin == "tanks" else (0, 2)
    with open(path, "w") as f:
        f.write("t,u,y\n" if twin == "tanks" else "t,y\n")
        for r in rows:
            f.write(",".join(repr(round(r[c], 12)) for c in cols) + "\n")

if __name__ == "__main__":
    os.makedirs(HERE, exist_ok=True)
    for twin in THETA:
        write(os.path.join(HERE, f"none.{twin}.csv"), twin, run(twin))
    for twin, kind, target, other, m in CASES:
        rows = run(twin, kind, target, other, m)
        write(os.path.join(HERE, f"{kind}.{twin}.csv"), twin, rows)
        extra = "" if other is None else f'{"to" if kind == "state-ceiling" else "from"} = "{other}"\n'
        mags = ", ".join(f"{k} = {float(v)}" for k, v in m.items())
        with open(os.path.join(HERE, f"{kind}.{twin}.toml"), "w") as f:
            f.write(f'[[effect]]\nid = "{kind}"\ntarget = "{target}"\n{extra}magnitudes = {{ {mags} }}\n')
        base = run(twin)
        print(f"{kind:22s} {twin:12s} rms change {math.sqrt(sum((a[2] - b[2]) ** 2 for a, b in zip(rows, base)) / N):.3f}")
