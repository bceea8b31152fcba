"""Figures of sweeps, continuations and nonlinear modes, each computed again apart from them.

A check takes the seed of a random chain and returns the number of figures compared and what differs. Steady motions
are integrated again from their states by `own_chain`.
"""

import numpy as np
from figure_comparison import CLOSE, JUMPY, Compared
from own_chain import OwnChain, random_chain
from sweep_figures import profile, stepped_sine, structure

MARGIN = 1e-5  # multipliers closer to the unit circle are neither stable nor unstable


def continuation(seed):
    """Points and special points of all branches of a continuation, their multipliers, and the peaks reported."""
    import beamsim

    case, rng = random_chain(seed), np.random.default_rng([seed, 6])
    first = case["excitation"]["frequency"]
    low, high = first * rng.uniform(0.4, 0.9), first * rng.uniform(1.1, 2.5)
    case["sweep"] = {"kind": "continuation", "from": low, "to": high, "seek_at": 1, "most_points": 600}
    scenario = beamsim.Scenario.model_validate(case)
    result, rows = beamsim.continuation(scenario), _rows(scenario)
    compared = Compared()
    for branch in result.branches:
        special = {int(np.argmin(np.abs(branch.parameter - e.parameter))): e for e in branch.special}
        for k in sorted({*np.linspace(0, branch.parameter.size - 1, 8).astype(int).tolist(), *special}):
            compared.what = f"period {branch.period_multiple}, {branch.frequency_hz[k]:.8g} Hz"
            _point(compared, case, rows, branch, k, special.get(k))
    for peak in result.summary["peaks"]:
        of_all = [branch.peak_displacement[peak["probe"]].max() for branch in result.branches]
        compared(f"reported peak of {peak['probe']}", peak["value_m"], max(of_all), close=1e-12)
    return compared.count, compared.differences


def _rows(scenario):
    """(n, n) masses from coordinates."""
    from beamsim.system.build import build_system

    return np.array([probe.shape for probe in build_system(scenario).probes])


def _point(compared, case, rows, branch, k, special):
    own = OwnChain(case, 2 * np.pi * branch.frequency_hz[k])
    period = branch.period_multiple / branch.frequency_hz[k]
    x, v = rows @ branch.coordinates[k], rows @ branch.coordinate_velocities[k]
    z = own.state(x, v)
    figures, multipliers = own.figures(z, period), np.linalg.eigvals(own.monodromy(z, period))
    size, largest = figures.peak("displacement").max(), np.abs(multipliers).max()
    grows = max(largest, 1.0)
    compared("end of the period", figures.end[: own.n], x, size, CLOSE * grows)
    compared("its velocity", figures.end[own.n : 2 * own.n], v, size * own.omega, CLOSE * grows)
    highest = [values[k] for values in branch.max_displacement.values()]
    lowest = [values[k] for values in branch.min_displacement.values()]
    compared("largest displacement", highest, figures.high["displacement"], size, CLOSE * grows)
    compared("smallest displacement", lowest, figures.low["displacement"], size, CLOSE * grows)
    accelerations = [values[k] for values in branch.peak_acceleration.values()]
    compared("acceleration", accelerations, figures.peak("acceleration"), close=JUMPY * grows)
    forces, stiffest = [values[k] for values in branch.peak_force.values()], max(stop[3] for stop in own.stops)
    kind = "" if special is None else special.kind
    touches = kind in (
        "grazing",
        "nonsmooth_fold",
    )  # where force is what is left of a penetration, and multipliers jump
    scale = max(figures.peak("force").max(), (1.0 if touches else 1e-3) * size * stiffest)
    compared("force", forces, np.maximum(figures.high["force"], 0.0), scale, CLOSE * grows)
    shares = [values[k] for values in branch.contact_share.values()]
    compared("contact share", shares, figures.share, 1.0, CLOSE * grows)
    if not touches:
        compared("multiplier", np.abs(branch.floquet_multipliers[k]).max(), largest, grows, 1e-4)
        if abs(largest - 1) > MARGIN:
            compared("stable", branch.stable[k], largest < 1)
    circle = {"fold": 1.0, "branch_point": 1.0, "period_doubling": -1.0}
    if kind in circle:
        compared(f"multiplier at a {kind}", np.abs(multipliers - circle[kind]).min(), 0.0, 1.0, 1e-4)


def nonlinear_mode(seed):
    """States, periods, energies and multipliers of a nonlinear mode and its branches."""
    import beamsim
    from beamsim.analyses.nnm.analysis import nnm
    from beamsim.errors import ScenarioError

    case, rng = random_chain(seed), np.random.default_rng([seed, 8])
    first, chain = case.pop("excitation")["frequency"], case["chain"]
    chain.pop("dashpots")
    for stop in chain["snubbers"]:
        stop.pop("damping", None)
    energy = 0.5 * np.mean(chain["masses"]) * (2 * np.pi * first) ** 2 * 1e-6
    path = {"kind": "energy", "from": float(0.05 * energy), "to": float(20 * energy)}
    case["nnm"] = {"mode": int(rng.integers(1, len(chain["masses"]) + 1)), "continue_in": path}
    scenario = beamsim.Scenario.model_validate(case)
    try:
        result = nnm(scenario)
    except ScenarioError as error:
        return 0, [] if "with every gap zero" in str(error) else [str(error)]
    compared, rows = Compared(), _rows(scenario)
    for branch in result.branches:
        for k in {*np.linspace(0, branch.frequency_hz.size - 1, 10).astype(int).tolist()}:
            own = OwnChain(case, 2 * np.pi * branch.frequency_hz[k], free=True)
            x, v = rows @ branch.coordinates[k], rows @ branch.coordinate_velocities[k]
            z, period = own.state(x, v), 1 / branch.frequency_hz[k]
            _, end = own.move(z, period)
            largest = np.abs(np.linalg.eigvals(own.monodromy(z, period))).max()
            compared.what = f"{branch.kind}, {branch.frequency_hz[k]:.8g} Hz"
            compared("end of the period", end[: own.n], x, close=CLOSE * max(largest, 1.0))
            stops = sum(0.5 * stop[3] * max(own.penetration(i, z), 0.0) ** 2 for i, stop in enumerate(own.stops))
            compared("energy", branch.energy[k], 0.5 * v @ (own.m * v) + 0.5 * x @ own.K @ x + stops)
            if branch.floquet_multipliers is not None:
                compared("multiplier", np.abs(branch.floquet_multipliers[k]).max(), largest, close=1e-2)
    return compared.count, compared.differences


CHECKS = (stepped_sine, structure, profile, continuation, nonlinear_mode)


def attack(count, seed, say=lambda *_: None):
    """Lines about ``count`` chains from a seed on in every check, and what differs."""
    lines, found = [], []
    for check in CHECKS:
        figures = 0
        for number in range(count):
            try:
                compared, differences = check(seed + number)
            except Exception as error:
                compared, differences = 0, [f"{type(error).__name__}: {error}"]
            figures += compared
            found += [f"{check.__name__} {seed + number}: {text}" for text in differences]
            say(check.__name__, number + 1, count)
        lines.append(f"  {check.__name__:<20} {count} chains, {figures} figures")
    return lines, found
