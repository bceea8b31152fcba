"""Derivatives of peaks and of the time in contact along more than a hundred contacts, against differences in 50 digits.

The oscillator with a stop is simulated here in decimal arithmetic: closed forms between contacts, which are found by
Newton's method. The differences of two such motions, 1e-18 apart, are exact to 20 digits.
"""

import math
from decimal import Decimal, localcontext

import pytest

import beamsim
from beamsim import load_scenario

STEP = Decimal("1e-18")
PATHS = {
    "mass": "chain.masses[0]", "spring": "chain.springs[0]", "dashpot": "chain.dashpots[0]",
    "stop": "chain.snubbers.stop.stiffness", "damper": "chain.snubbers.stop.damping.coefficient",
    "gap": "chain.snubbers.stop.gap",
    "force": "excitation.level", "frequency": "excitation.frequency", "start": "run.start.displacement[0]",
    "gravity": "gravity",
}  # fmt: skip
SOFT = {
    "mass": "2", "spring": "8000", "dashpot": "30", "stop": "60000", "damper": "20", "gap": "0.001",
    "force": "40", "frequency": "12", "start": "0.004",
}  # fmt: skip
# begins at rest on the stop, which the weight closes
RESTING = {name: number for name, number in SOFT.items() if name != "start"} | {"gravity": "9.8"}
HARD = SOFT | {"damper": "300", "stop": "20000"}  # whose largest force is that of the dashpot at a touch-down


def turn(angle):
    """Cosine and sine: of a small part of the angle by their series, doubled back."""
    halvings = max(0, math.ceil(math.log2(abs(float(angle)) + 1e-30)) + 10)
    x = angle / 2**halvings
    c, s, term, k = Decimal(1), x, x, 1
    while abs(term) > Decimal("1e-52"):
        k += 1
        term *= -x / k if k % 2 == 0 else x / k
        c, s = (c + term, s) if k % 2 == 0 else (c, s + term)
    for _ in range(halvings):
        c, s = c * c - s * s, 2 * c * s
    return c, s


class Phase:
    """x'' of the oscillator with the stop open or closed, in closed form from a state at a time."""

    def __init__(self, p, pi, closed, t, x, v):
        m, k, c = p["mass"], p["spring"] + closed * p["stop"], p["dashpot"] + closed * p["damper"]
        self.p, self.closed, self.t = p, closed, t
        self.w = 2 * pi * p["frequency"]
        real, imaginary = k - m * self.w**2, c * self.w
        size = real**2 + imaginary**2
        self.ps, self.pc = p["force"] * real / size, -p["force"] * imaginary / size
        self.rest = -(closed * p["stop"] * p["gap"] + p["mass"] * p.get("gravity", 0)) / k
        self.a = c / (2 * m)
        self.wd = (k / m - self.a**2).sqrt()
        given = self.forced(t)
        self.A = x - given[0]
        self.B = (v - given[1] + self.a * self.A) / self.wd
        numbers = self.w, self.ps, self.pc, self.rest, self.a, self.wd, self.A, self.B, t
        self.floats = [float(each) for each in numbers]

    def forced(self, t):
        c, s = turn(self.w * t)
        x = self.ps * s + self.pc * c
        return x + self.rest, self.w * (self.ps * c - self.pc * s), -(self.w**2) * x

    def at(self, t):
        """Displacement, velocity, acceleration and its rate."""
        tau = t - self.t
        c, s = turn(self.wd * tau)
        e = (-self.a * tau).exp()
        free = [e * (self.A * c + self.B * s)]
        free.append(e * self.wd * (self.B * c - self.A * s) - self.a * free[0])
        for _ in range(2):
            free.append(-2 * self.a * free[-1] - (self.a**2 + self.wd**2) * free[-2])
        x, v, acceleration = self.forced(t)
        return [x + free[0], v + free[1], acceleration + free[2], -(self.w**2) * v + free[3]]

    def about(self, t):
        """Displacement, velocity and acceleration to sixteen digits."""
        w, ps, pc, rest, a, wd, A, B, begin = self.floats
        tau = t - begin
        c, s, e = math.cos(wd * tau), math.sin(wd * tau), math.exp(-a * tau)
        x = e * (A * c + B * s)
        v = e * wd * (B * c - A * s) - a * x
        X, V = ps * math.sin(w * t) + pc * math.cos(w * t), w * (ps * math.cos(w * t) - pc * math.sin(w * t))
        return x + X + rest, v + V, -2 * a * v - (a**2 + wd**2) * x - w**2 * X


def newton(value_and_rate, t):
    for _ in range(40):
        value, rate = value_and_rate(t)
        t -= value / rate
        if abs(value / rate) < Decimal("1e-42"):
            return t
    raise AssertionError("no root")


def simulated(p, pi, duration):
    """Largest force, largest displacement, share of time in contact, and number of contacts."""
    t, v, closed = Decimal(0), Decimal(0), int("start" not in p)
    x = p["start"] if not closed else -(p["stop"] * p["gap"] + p["mass"] * p["gravity"]) / (p["spring"] + p["stop"])
    peak_force, peak, contact, contacts, gap = Decimal(0), abs(x), Decimal(0), 0, float(p["gap"])
    stop, damper = float(p["stop"]), float(p["damper"])
    while t < duration:
        phase, begin = Phase(p, pi, closed, t, x, v), float(t)
        step = 1e-5 if begin else 1e-7
        last, before, end, tops = phase.about(begin + 1e-9), begin + 1e-9, duration, []
        while before < float(duration):
            now = before + 40 * step
            values = phase.about(now)
            if last[1] * values[1] < 0:
                tops.append(("x", (before + now) / 2))
            rates = [stop * each[1] + damper * each[2] for each in (last, values)]
            if closed and rates[0] < 0 < rates[1]:
                tops.append(("f", (before + now) / 2))
            if (last[0] + gap) * (values[0] + gap) < 0:
                share = (last[0] + gap) / (last[0] - values[0])
                guess = Decimal(before + share * (now - before))
                end = newton(lambda t, phase=phase: (phase.at(t)[0] + p["gap"], phase.at(t)[1]), guess)
                break
            before, last = now, values

        def force(y):
            return -p["stop"] * (y[0] + p["gap"]) - p["damper"] * y[1]

        for kind, guess in tops:
            if kind == "x":
                at = newton(lambda t, phase=phase: phase.at(t)[1:3], Decimal(guess))
                peak = max(peak, abs(phase.at(at)[0])) if t < at < end else peak
            else:

                def slope(t, phase=phase):
                    y = phase.at(t)
                    return [p["stop"] * y[k] + p["damper"] * y[k + 1] for k in (1, 2)]

                at = newton(slope, Decimal(guess))
                peak_force = max(peak_force, force(phase.at(at))) if t < at < end else peak_force
        end = min(end, duration)
        if closed:
            peak_force = max(peak_force, force(phase.at(t)), force(phase.at(end)))
            contact += end - t
            contacts += 1
        t, (x, v, *_) = end, phase.at(end)
        x, closed = (-p["gap"] if t < duration else x), 1 - closed
    return {
        "snubbers/stop/peak_force": peak_force, "probes/mass/peak_displacement": peak,
        "snubbers/stop/contact_share": contact / duration,
    }, contacts  # fmt: skip


def scenario(numbers, duration, asked):
    n = {name: float(value) for name, value in numbers.items()}
    return load_scenario({
        "chain": {
            "masses": [n["mass"]], "springs": [n["spring"]], "dashpots": [n["dashpot"]],
            "snubbers": [{
                "name": "stop", "mass": 1, "side": "below", "stiffness": n["stop"], "gap": n["gap"],
                "damping": {"kind": "viscous", "coefficient": n["damper"]},
            }],
        },
        "probes": [{"name": "mass", "mass": 1}],
        "excitation": {
            "kind": "harmonic", "applied_to": {"mass": 1}, "level": f"{n['force']} N", "frequency": n["frequency"]
        },
        "gravity": n.get("gravity", 0.0),
        "run": {
            "duration": float(duration), "convergence": "off", "sensitivities": [PATHS[name] for name in asked],
            "start": {"displacement": [n["start"]]} if "start" in n else "static_equilibrium",
        },
    })  # fmt: skip


@pytest.mark.parametrize(
    ("numbers", "duration", "contacts_at_least", "asked"),
    [
        (SOFT, Decimal(9), 100, list(SOFT)),
        (HARD, Decimal(3), 20, ["mass", "stop", "damper", "gap", "start"]),  # what a touch-down adds
        (RESTING, Decimal(3), 20, ["spring", "stop", "gap", "force", "gravity"]),  # what the start depends on
    ],
    ids=["top of the force", "touch-down", "weight on the stop"],
)
def test_derivatives_through_many_contacts(numbers, duration, contacts_at_least, asked):
    result = beamsim.run(scenario(numbers, duration, asked))
    told = result.summary["sensitivities"]
    with localcontext() as context:
        context.prec = 50
        pi = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640629")
        exact = {name: Decimal(float(value)) for name, value in numbers.items()}
        here, contacts = simulated(exact, pi, duration)
        assert contacts >= contacts_at_least
        assert result.summary["contacts"]["stop"] == contacts - ("start" not in numbers)  # those that begin
        values = {row["response"]: row["value"] for row in result["sensitivities"].rows("row")}
        for name, value in here.items():
            assert values[name] == pytest.approx(float(value), rel=1e-10)
        for number, path in ((name, PATHS[name]) for name in asked):
            up, down = (
                simulated(exact | {number: exact[number] * (1 + side * STEP)}, pi, duration)[0] for side in (1, -1)
            )
            for name in here:
                expected = float((up[name] - down[name]) / (2 * STEP * exact[number]))
                scale = float(here[name]) / abs(float(exact[number]))
                derivative = told[name][path]["derivative"]
                assert derivative == pytest.approx(expected, rel=1e-7, abs=1e-11 * scale), (name, path)
