"""Figures of sweeps, each computed again apart: steady motions and profiles.

Steady motions are integrated again by `own_chain`. The motion under a profile is integrated by SciPy's DOP853 from the
level and the phase that the profile means; a second one with a looser tolerance says how far it can be trusted.
"""

from itertools import pairwise

import numpy as np
from figure_comparison import CLOSE, JUMPY, Compared
from own_chain import OwnChain, peaks, random_chain
from own_structure import OwnStructure, random_structure
from scipy.integrate import simpson, solve_ivp

from beamsim.analyses.sweep.analysis import sweep as sweep_alone

NEWTON = 12  # steps from where a motion is nearly steady
TRIES = 4  # starts of other motions beside the one that a sweep settled on
TABLE = ("frequency", "level")
LATE = 1e-5  # of the largest displacement: what the integration of a profile is compared to
SAMPLES = 256  # of a cycle


def stepped_sine(seed):
    """Envelopes, means, rms and contact shares at six frequencies of a stepped sine."""
    return _stepped(random_chain(seed), OwnChain, np.random.default_rng([seed, 5]), 6)


def structure(seed):
    """The same of beams and of two bodies."""
    return _stepped(random_structure(seed), OwnStructure, np.random.default_rng([seed, 16]), 2, 80)


def _stepped(case, own_of, rng, points, cycles=300):
    import beamsim

    first = case["excitation"]["frequency"]
    low, high = first * rng.uniform(0.4, 0.9), first * rng.uniform(1.1, 3)
    case["sweep"] = {
        "kind": "stepped", "from": low, "to": high, "points": points, "steady_to": 1e-11, "most_cycles": 5000,
        "direction": str(rng.choice(["up", "down"])),
    }  # fmt: skip
    compared = Compared()
    for curve in sweep_alone(beamsim.Scenario.model_validate(case)).curves.values():
        at_level, state = {**case, "excitation": {**case["excitation"], "level": curve.level}}, None
        for k, frequency in enumerate(curve.frequency_hz):
            if curve.steady.kind[k] == "periodic":
                own = own_of(at_level, 2 * np.pi * frequency)
                state, found = _same_motion(own, state, curve, k, cycles)
                compared.add(found)
    return compared.count, compared.differences


def _same_motion(own, state, curve, k, cycles):
    """State of a steady motion, and what was compared: of the first motion that agrees, else of the first one."""
    rng, first = np.random.default_rng(k), None
    period = int(curve.steady.period_cycles[k]) * 2 * np.pi / own.omega
    starts = [np.zeros(2 * own.n) if state is None else state, np.zeros(2 * own.n)]
    while len(starts) < TRIES:  # of the size of the motion that is looked for
        size = max(row.peak[k] for row in curve.displacement.values()) / np.abs(own.probes).max()
        starts.append(size * rng.standard_normal(2 * own.n) * np.repeat([1.0, own.omega], own.n))
    for start in starts:
        y = steady(own, start, period, cycles)
        z = own.state(*np.split(y, 2))
        if np.abs(np.linalg.eigvals(own.monodromy(z, period))).max() > 1:
            continue  # Newton's method has left the motion that the sweep settled on
        found = Compared(f"{curve.name}, {own.omega / (2 * np.pi):.6g} Hz")
        _figures(found, own, own.figures(z, period), curve, k)
        if not found.differences:
            return y, found
        first = first or (y, found)
    return first or (None, Compared())


def _figures(compared, own, figures, curve, k):
    stiffest = max(stop[3] for stop in own.stops)  # of a grazing's force less is known than of a force
    for name, envelopes in (
        ("displacement", curve.displacement),
        ("acceleration", curve.acceleration),
        ("force", curve.force),
    ):
        scale, close = figures.peak(name).max(), JUMPY if name == "acceleration" else CLOSE
        if name == "force":
            scale = max(scale, 1e-3 * stiffest * figures.peak("displacement").max())
        rows = list(envelopes.values())
        compared(f"largest {name}", [row.maximum[k] for row in rows], figures.high[name], scale, close)
        compared(f"smallest {name}", [row.minimum[k] for row in rows], figures.low[name], scale, close)
        compared(f"mean {name}", [row.mean[k] for row in rows], figures.mean[name], scale)
        compared(f"rms {name}", [row.rms[k] for row in rows], figures.rms[name], scale)
    compared("contact share", [share[k] for share in curve.contact_share.values()], figures.share, 1.0)


def steady(own, y, period, cycles):
    """(2 n,) state at phase zero of the motion on which y settles."""
    z = own.state(*np.split(y, 2))
    for _ in range(cycles):
        _, z = own.move(z, period)
        z[-2:] = 0.0, 1.0
    y, size = z[: 2 * own.n], np.repeat([1.0, 1.0 / own.omega], own.n)
    for _ in range(NEWTON):
        z = own.state(*np.split(y, 2))
        error = own.move(z, period)[1][: 2 * own.n] - y
        if np.abs(error * size).max() < 1e-13 * np.abs(y * size).max():
            break
        y = y - np.linalg.solve(own.monodromy(z, period) - np.eye(2 * own.n), error)
    return y


def profile(seed):
    """Displacements, cycle by cycle, of a swept sine with a level over frequency and a notch."""
    import beamsim

    case, rng = random_chain(seed), np.random.default_rng([seed, 17])
    sine, first, level = case["excitation"], case["excitation"]["frequency"], case["excitation"]["level"]
    own = OwnChain(case, 1.0)
    low, high = first * rng.uniform(0.5, 0.9), first * rng.uniform(1.2, 2.0)
    rate = float((high - low) / (25 * np.log(2)) if rng.random() < 0.5 else -(high**2 - low**2) / 50)
    section = {"kind": "swept_sine", "from": low, "to": high, "direction": "up"}
    section["rate"] = f"{60 * rate!r} oct/min" if rate > 0 else f"{-rate!r} Hz/s"
    level_at = lambda f: level  # noqa: E731
    if sine["applied_to"] != "base":
        section["between"] = between = str(rng.choice(["held", "log_log"]))
        f = np.array([0.9 * low, *np.sort(rng.uniform(low, high, 2)), 1.1 * high])
        a = level * rng.uniform(0.3, 2, 4)
        section["profile"] = [
            dict(zip(TABLE, point, strict=True)) for point in zip(f.tolist(), a.tolist(), strict=True)
        ]
        start = float(rng.uniform(low, high))
        notch = {"from": start, "to": start * 1.1, "level": float(0.2 * level)}
        section["notches"] = [notch] if rng.random() < 0.5 else []

        def level_at(frequency):
            x = float(np.exp(np.interp(np.log(frequency), np.log(f), np.log(a))))
            x = x if between == "log_log" else a[np.searchsorted(f, frequency, side="right") - 1]
            inside = section["notches"] and notch["from"] <= frequency < notch["to"]
            return min(x, notch["level"]) if inside else x

    elif sine["quantity"] != "acceleration":
        sine["quantity"], sine["level"] = "acceleration", float(level * first ** (1 + (sine["quantity"] != "velocity")))
        level = sine["level"]
    case["sweep"] = section
    (curve,) = sweep_alone(beamsim.Scenario.model_validate(case)).curves.values()

    def load(t):
        f = low * 2 ** (rate * t) if rate > 0 else low - rate * t
        phase = 2 * np.pi * ((f - low) / (rate * np.log(2)) if rate > 0 else low * t - rate * t * t / 2)
        return level_at(f) * np.sin(phase)

    edges = np.append(curve.time, curve.time[-1] + 1 / high)
    exact, loose = (_cycles(own, load, edges[:-1], rtol) for rtol in (1e-10, 1e-8))
    compared = Compared()
    for j, (name, row) in enumerate(curve.displacement.items()):
        scale = max(np.abs(exact[0][:, j]).max(), np.abs(exact[1][:, j]).max())
        for what, theirs, ours, other in zip(
            ("largest", "smallest", "mean", "rms"),
            (row.maximum, row.minimum, row.mean, row.rms),
            exact,
            loose,
            strict=True,
        ):
            sure = np.abs(ours - other)[:, j] < LATE * scale  # before contacts that the last digits decide
            until = int(np.argmin(sure)) if not sure.all() else sure.size
            compared(f"{what} of {name}", theirs[:until], ours[:until, j], scale, 3 * LATE)
    return compared.count, compared.differences


def _cycles(own, load, edges, rtol):
    """Largest and smallest displacements, means and rms (cycles, n) between the edges of cycles; from rest."""
    n, found = own.n, []

    def rate(t, y):
        x, v = y[:n], y[n:]
        push = load(t) * own.load - own.K @ x - own.C @ v
        for row, sign, gap, k, c in own.stops:
            depth = -gap - sign * (row @ x)
            if depth > 0:
                push = push + sign * row * (k * depth - c * sign * (row @ v))
        return np.concatenate([v, push / own.m])

    y, fastest = np.zeros(2 * n), np.abs(np.linalg.eigvals(own.matrix((True,) * len(own.stops))[0])).max()
    for a, b in pairwise(edges):
        times = np.linspace(a, b, SAMPLES + 1)
        size = max(np.abs(y[:n]).max(), 1e-9)
        step = min((b - a) / 20, 2 / fastest)
        solved = solve_ivp(rate, (a, b), y, "DOP853", dense_output=True, rtol=rtol, atol=rtol * size, max_step=step)
        x, y = solved.sol(times)[:n].T, solved.y[:, -1]
        mean, square = simpson(x, times, axis=0) / (b - a), simpson(x**2, times, axis=0) / (b - a)
        high, low = (
            [_extreme(solved.sol, j, times, order(x[:, j])) for j in range(n)] for order in (np.argmax, np.argmin)
        )
        found.append((np.max(high, axis=1), np.min(low, axis=1), mean, np.sqrt(square)))
    return [np.array(part) for part in zip(*found, strict=True)]


def _extreme(motion, j, times, i):
    """Largest and smallest displacement of a mass about a sample: a stiff stop turns a motion within one."""
    fine = np.linspace(times[max(i - 1, 0)], times[min(i + 1, times.size - 1)], 65)
    return np.ravel(peaks(motion(fine)[[j]].T))
