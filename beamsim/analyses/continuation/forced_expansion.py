"""Forced multiple scales for a response curve: steady motions near a mode, stability, observed orders.

With small springs, damping and force, the motion is that of the mode with slowly varying amplitude and phase
(:mod:`beamsim.orbits.expansions.forced`). The error for a given case is found by comparing both while everything small
is multiplied by a decreasing common factor, with the detuning proportional to the factor.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.continuation.result import (
    MULTIPLE_SCALES,
    MULTIPLE_SCALES_FACTORS,
    MULTIPLE_SCALES_POINTS,
    ContinuationResult,
)
from beamsim.errors import ScenarioError, locating
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.labelled import Dataset
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.expansions.forced import ResonantForcing, SteadyMotion
from beamsim.orbits.expansions.free import observed_orders, weaken
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.responses.loads import periodic_forcing
from beamsim.results.branch import rows_by_owner
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import Forces, Harmonic
from beamsim.scenario.sweep import Continuation, FrequencyPath
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem
from beamsim.typing import TINY, Bools, Complexes, Floats

HALVINGS = 24  # largest number of halvings of the factor
EXACT_FACTORS = 7  # factors at which the exact motion must be found
CURVE_POINTS = 61
CURVE_HARMONICS = 48
SAMPLES = 256  # in a period
NEAR_TIP = 0.8  # share of the largest amplitude at which orders are observed
# largest distance from the expansion, relative to the motion, of an exact motion that belongs to it
LARGEST_DISTANCE = 0.5


class _Expansion(NamedTuple):
    """Steady motions by multiple scales at one level, and their differences from exact ones."""

    level: float
    mode: int  # from 1
    linear_frequency_hz: float
    frequency_hz: Floats  # (np,) at a factor of one
    stable: Bools  # (np,)
    leading: list[Floats]  # by probe, (np,) largest deflection in a period, m
    first: list[Floats]
    backbone_hz: Floats  # (np,)
    factor: Floats  # (E,) decreasing
    factor_frequency_hz: Floats  # (E,)
    difference: Floats  # (E, 2)
    orders: Floats  # (E, 2)
    stability_agrees: Bools  # (E,)


def with_forced_expansion(result: ContinuationResult) -> ContinuationResult:
    """Add the expansion near the mode to a response curve; see `compare_forced_expansion`."""
    datasets = compare_forced_expansion(result.scenario)
    levels = datasets["multiple_scales"]
    motions = rows_by_owner(levels, datasets["multiple_scales_points"], "comparison")
    differences = rows_by_owner(levels, datasets["multiple_scales_factors"], "comparison")
    levels_compared = [_summary(*of_level) for of_level in zip(motions, differences, strict=True)]
    summary = {**result.summary, "multiple_scales": levels_compared}
    return replace(result, datasets=result.datasets | datasets, summary=summary)


def _summary(motions: Dataset, differences: Dataset) -> dict[str, Any]:
    """Summary of one level; orders are those between the two smallest factors."""
    orders = [of[np.isfinite(of)] for of in differences["orders"].values.T]
    near = differences["difference"].values[:, 0] < np.inf  # False where no exact motion was found
    return {
        **{name: motions[name].item() for name in ("level", "mode", "linear_frequency_hz")},
        "points": motions["frequency_hz"].values.size,
        "stable_points": int(motions["stable"].values.sum()),
        "largest_first_order_m": {name: float(x.values.max()) for name, x in motions.by_label("first").items()},
        "factor": differences["factor"].values[near].tolist(),
        "difference": differences["difference"].values[near].tolist(),
        "observed_orders": [float(of[-1]) if of.size else np.nan for of in orders],
        "stability_agrees": bool(near.any() and differences["stability_agrees"].values[near].all()),
    }


def compare_forced_expansion(scenario: Scenario) -> dict[str, Dataset]:
    """Expand the response of ``sweep: {kind: continuation}`` by multiple scales, at all its levels.

    Returns
    -------
    Datasets of the levels, their motions and the differences from exact ones, by name.

    Raises
    ------
    ScenarioError
        If the load is not a single harmonic force, or the nonlinearity is not a one-sided spring.
    """
    excitation, settings = scenario.excitation, scenario.sweep
    if isinstance(excitation, Forces):
        raise ScenarioError.at(
            "excitation", "lists several forces, but multiple scales needs a single one", "leave --compare out"
        )
    if not isinstance(excitation, Harmonic) or not isinstance(settings, Continuation):
        raise ScenarioError.at(
            "sweep.kind", "is not followed by continuation", "use --compare with sweep: {kind: continuation}"
        )
    path = settings.parameter
    if not isinstance(path, FrequencyPath):
        raise ScenarioError.at(
            "sweep.continue_in.kind",
            f"= {path.kind}, but multiple scales needs the frequency",
            "leave --compare out, or continue in the frequency",
        )
    system = build_system(scenario.model_copy(update={"run": None}))
    _refuse(system)
    low, high = sorted((path.from_, path.to))
    loads = periodic_forcing(scenario, system)
    levels = settings.levels or (excitation.level,)
    mode = _mode(system, loads, 2 * np.pi * low, 2 * np.pi * high)
    with locating({"mode": "excitation.frequency", "frequency": "excitation.frequency"}):
        found = [_compare(system, loads, float(level), mode, low, high) for level in levels]
    level_unit = scenario.level_unit or "1"
    return _datasets(found, [probe.name for probe in system.probes], level_unit)


def _datasets(expansions: list[_Expansion], probes: list[str], level_unit: str) -> dict[str, Dataset]:
    """Build the datasets of the results of all levels."""

    def concatenate(name: str) -> Any:
        return np.concatenate([getattr(each, name) for each in expansions])

    numbers = np.arange(len(expansions))
    points = [each.frequency_hz.size for each in expansions]
    of_points = {
        "point": np.arange(1, sum(points) + 1),
        "comparison": np.repeat(numbers, points),
        "probe": probes,
        **{name: concatenate(name) for name in ("frequency_hz", "stable", "backbone_hz")},
        **{name: np.hstack([getattr(each, name) for each in expansions]) for name in ("leading", "first")},
    }
    factors = [each.factor.size for each in expansions]
    of_factors = {
        "number": np.arange(1, sum(factors) + 1),
        "comparison": np.repeat(numbers, factors),
        "order": np.arange(2),
        **{
            name: concatenate(name)
            for name in ("factor", "factor_frequency_hz", "difference", "orders", "stability_agrees")
        },
    }
    return {
        "multiple_scales": MULTIPLE_SCALES.table(
            expansions, [{"level_unit": level_unit}] * len(expansions), comparison=numbers
        ),
        "multiple_scales_points": MULTIPLE_SCALES_POINTS.dataset(of_points),
        "multiple_scales_factors": MULTIPLE_SCALES_FACTORS.dataset(of_factors),
    }


def _refuse(system: StructuralSystem) -> None:
    contacts = system.dynamics.contacts
    why = ""
    if system.cubic is not None:
        why = "needs one-sided springs, but this structure has a cubic one"
    elif contacts.count == 0:
        why = "needs a one-sided spring"
    elif system.forcing.base_displacements and np.any(contacts.base_influence):
        why = "needs forces, but the base also pushes through a snubber on the ground"
    elif not contacts.one_sided:
        why = "needs Kelvin-Voigt snubbers, but the dashpot of a snubber never pulls here"
    if why:
        raise ScenarioError.at("sweep", f"--compare multiple_scales {why}", "leave --compare out")


def _mode(system: StructuralSystem, loads: PeriodicForcing, low: float, high: float) -> int:
    """Index of the mode nearest the frequency range; of several inside, the one with the largest resonance peak."""
    omega = np.sqrt(system.dynamics.stiffness[: system.kept_modes])
    best, score = -1, (np.inf, 0.0)
    for j in np.flatnonzero(omega > 0):
        w = float(omega[j])
        away = max(low / w, w / high, 1.0)
        force = abs(complex(loads.at(w, 1.0)[0].sum(axis=0)[j]))
        moved = force / (w * max(float(system.dynamics.damping[j, j]), 1e-12 * w))
        if (away, -moved) < score and force > 0:
            best, score = int(j), (away, -moved)
    if best < 0:
        raise ScenarioError.at("excitation.applied_to", ": the force excites no vibration mode", "apply it elsewhere")
    return best


def _curve(r: ResonantForcing, tip: float, low: float, high: float) -> list[SteadyMotion]:
    """Steady motions at a factor of one, from one end of the range through the peak to the other (rad/s)."""
    force = abs(complex(r.load[r.mode])) / (2 * r.omega)
    smallest = 0.2 * force / max(abs(low - r.omega), abs(high - r.omega), 1e-9 * r.omega)
    near_tip = tip * np.sin(np.linspace(np.arcsin(min(smallest / tip, 0.5)), 0.5 * np.pi, CURVE_POINTS))
    amplitudes = np.unique(np.concatenate([np.geomspace(min(smallest, 0.5 * tip), tip, CURVE_POINTS), near_tip]))
    below, above = [], []
    for a in amplitudes * (1.0 - 1e-12):
        sides = r.detunings(float(a))
        if sides:
            below.append(r.motion(float(a), sides[0]))
            above.append(r.motion(float(a), sides[1]))
    return [m for m in [*below, *reversed(above)] if low <= r.omega + m.sigma <= high]


def _tip(r: ResonantForcing) -> float:
    """Largest amplitude, where damping takes all the power of the force; far beyond the gaps without damping."""
    from scipy.optimize import brentq

    force = abs(complex(r.load[r.mode])) / (2 * r.omega)

    def excess(log_a: float) -> float:
        a = float(np.exp(log_a))
        return float(np.log(max(a * r.backbone(a).imag, TINY) / force))

    start = np.log(force / r.omega)
    if excess(start + 30.0) < 0:
        return float(np.exp(start + 7.0))
    return float(np.exp(brentq(excess, start - 30.0, start + 30.0, xtol=1e-13)))


def _peaks(coefficients: list[Complexes], system: StructuralSystem) -> list[Floats]:
    """(np,) largest deflections in a period at each probe, for motions given by harmonics (H + 1, n)."""
    phase = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    wave = np.exp(1j * np.multiply.outer(phase, np.arange(coefficients[0].shape[0])))
    motions = [(wave @ each).real for each in coefficients]
    return [np.array([np.abs(x @ p.shape).max() for x in motions]) for p in system.probes]


def _compare(
    system: StructuralSystem, loads: PeriodicForcing, level: float, mode: int, low: float, high: float
) -> _Expansion:
    omega = float(np.sqrt(system.dynamics.stiffness[mode]))
    force = loads.at(omega, level)[0].sum(axis=0)
    resonant = ResonantForcing(system.dynamics, mode, force)
    coarse = ResonantForcing(system.dynamics, mode, force, CURVE_HARMONICS)  # for pictures
    tip = _tip(resonant)
    motions = _curve(resonant, tip, 2 * np.pi * low, 2 * np.pi * high)
    if not motions:
        raise ScenarioError.at(
            "sweep",
            f"contains no steady motion of mode {mode + 1} ({omega / (2 * np.pi):.6g} Hz) by multiple scales",
            "sweep about that frequency",
        )
    leading = [coarse.response(m, 1.0, 0) for m in motions]
    first = [coarse.with_correction(m.complex_amplitude, resonant.omega + m.sigma, 1.0) for m in motions]
    amplitude = NEAR_TIP * tip
    reference = resonant.motion(amplitude, resonant.detunings(amplitude)[0])
    # halve the factor from one until enough factors are small enough for an exact motion nearby
    rows: list[tuple[float, float, float, bool]] = []
    for half in 0.5 ** np.arange(HALVINGS):
        positive = resonant.omega + half * reference.sigma > 0
        differences = _difference(system, resonant, reference, float(half)) if positive else None
        rows.append((float(half), *(differences or (np.nan, np.nan, False))))
        if sum(np.isfinite(row[1]) for row in rows) == EXACT_FACTORS:
            break
    table = np.array([row[:3] for row in rows])
    factor, difference = table[:, 0], table[:, 1:]
    return _Expansion(
        level=level,
        mode=mode + 1,
        linear_frequency_hz=omega / (2 * np.pi),
        frequency_hz=np.array([omega + m.sigma for m in motions]) / (2 * np.pi),
        stable=np.array([m.stable for m in motions]),
        leading=_peaks(leading, system),
        first=_peaks(first, system),
        backbone_hz=np.array([omega + resonant.backbone(m.amplitude).real for m in motions]) / (2 * np.pi),
        factor=factor,
        factor_frequency_hz=(omega + factor * reference.sigma) / (2 * np.pi),
        difference=difference,
        orders=np.array([np.append(observed_orders(factor, difference[:, k]), np.nan) for k in (0, 1)]).T,
        stability_agrees=np.array([row[3] for row in rows]),
    )


def _difference(
    system: StructuralSystem, resonant: ResonantForcing, motion: SteadyMotion, factor: float
) -> tuple[float, float, bool] | None:
    """Differences of both orders at one factor; None if there is no exact motion nearby."""
    none, n = np.zeros(1), system.dynamics.size
    omega = resonant.omega + factor * motion.sigma
    load = np.array(factor * resonant.load[None, :], dtype=np.complex128)
    at_rest = np.zeros((1, 0), dtype=np.complex128)
    loads = PeriodicForcing(np.ones(1, dtype=np.int64), load, none, at_rest, none, omega)
    problem = ForcedOrbits(VariationalFlow(weaken(system.dynamics, factor), loads, omega))
    orders = [resonant.response(motion, factor, order) for order in (0, 1)]
    guess = np.zeros(problem.flow.size)
    guess[: 2 * n] = resonant.states(orders[1], omega, none)[0]
    point = solve_at(problem, np.append(guess, omega), Settings(iterations=12), omega)
    if point is None:
        return None
    t = point.data.duration * np.arange(SAMPLES) / SAMPLES
    exact = problem.flow.states_at(point.data, t)[:, :n]
    size = float(np.linalg.norm(exact - exact.mean(axis=0), axis=1).max())
    off = [float(np.linalg.norm(resonant.states(c, omega, t)[:, :n] - exact, axis=1).max()) / size for c in orders]
    if off[0] > LARGEST_DISTANCE:
        return None
    return off[0], off[1], problem.orbit(point).stable == motion.stable
