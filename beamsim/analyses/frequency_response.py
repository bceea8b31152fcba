"""``beamsim sweep`` of kind continuation: the curve of periodic motions against frequency, stable and unstable."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from datetime import UTC, datetime
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.analyses.response_results import FrequencyResponse, ResponseBranch
from beamsim.analyses.run import versions
from beamsim.dynamics.continuation import BranchPoint, Settings
from beamsim.dynamics.shooting import (
    ForcedOrbits,
    find_orbit,
    follow_orbits,
    special_points,
    switch_at_period_doubling,
)
from beamsim.dynamics.smooth_flow import SmoothFlow
from beamsim.dynamics.variational import PeriodicForcing, VariationalFlow
from beamsim.errors import Problem, ScenarioError
from beamsim.model.build import build_system
from beamsim.model.structure import StructuralSystem
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.sweep import Continuation

if TYPE_CHECKING:
    from beamsim.dynamics.grazing import SpecialPoint
    from beamsim.model.signal import Signal
    from beamsim.scenario import Scenario

__all__ = ["frequency_response", "periodic_forcing"]

Floats = NDArray[np.float64]

SAMPLES = 512  # of a period, for peaks and harmonics
ORDERS = 6
MOST_POINTS = 4000
MOST_POINTS_ASIDE = 300  # of a branch of doubled period
EXCURSION = 1.5  # how far beyond the first frequency, as a ratio, a branch may go
SAME = 1e-4  # relative distance within which a period doubling belongs to a branch that is known


def periodic_forcing(scenario: Scenario, system: StructuralSystem) -> PeriodicForcing:
    """The loads of a scenario with harmonic excitation, as functions of frequency, for a level of one.

    The excitation's own quantity is what stays the same: a base acceleration held moves the base by ``A / omega^2``.
    """
    excitation = scenario.excitation
    assert isinstance(excitation, Harmonic)
    omega, level = 2 * np.pi * excitation.frequency, excitation.level
    n = system.dynamics.size
    held = {"acceleration": 0.0, "velocity": 1.0, "displacement": 2.0}.get(str(excitation.quantity), 0.0)
    force, power, base, base_power = [], [], [], []

    def phasor(signal: Signal) -> complex:
        """A of ``Re(A e^{i omega t})``."""
        return complex(sum(c for nu, c in zip(signal.exponent, signal.coefficient[0, :, 0], strict=True) if nu != 0))

    for load, signal in zip(system.forcing.load, system.forcing.signal, strict=True):
        # a displacement (springs to ground) changes by omega^-2 against an acceleration
        is_displacement = system.base_displacement is not None and signal is system.base_displacement
        force.append(load.astype(complex) * phasor(signal) / level)
        power.append(held - 2.0 if is_displacement else held)
        base.append(0j)
        base_power.append(0.0)
    if system.forcing.base_displacement is not None:
        force.append(np.zeros(n, dtype=complex))
        power.append(0.0)
        base.append(phasor(system.forcing.base_displacement) / level)
        base_power.append(held - 2.0)
    return PeriodicForcing(
        np.ones(len(force), dtype=np.int64), np.array(force).reshape(len(force), n), np.array(power), np.array(base),
        np.array(base_power), omega,
    )  # fmt: skip


def frequency_response(scenario: Scenario, progress: Callable[[float], None] | None = None) -> FrequencyResponse:
    """Follow the periodic motions of a scenario through its frequencies, at all its levels.

    Raises
    ------
    ScenarioError
        Where the scenario asks for none, or no periodic motion is found at the first frequency.
    """
    begin, processor = clock.perf_counter(), clock.process_time()
    settings, excitation = scenario.sweep, scenario.excitation
    if not isinstance(settings, Continuation):
        raise ScenarioError(
            Problem("sweep.kind", "is not continuation", "write `sweep: {kind: continuation, from: …, to: …}`")
        )
    if not isinstance(excitation, Harmonic):
        raise ScenarioError(Problem("excitation.kind", "has no frequency to follow", "use a harmonic excitation"))
    highest = max(settings.from_, settings.to)
    at_top = excitation.model_copy(update={"frequency": highest})
    forced = scenario.model_copy(update={"run": None, "excitation": at_top})
    system = build_system(forced)
    loads = periodic_forcing(forced, system)
    levels = settings.levels or (excitation.level,)
    branches: list[ResponseBranch] = []
    status = "complete"
    for index, level in enumerate(levels):
        report = None if progress is None else _part(progress, index, len(levels))
        branches += _level(system, loads, settings, float(level), report)
        if not branches[-1].status.startswith("complete") and branches[-1].period_multiple == 1:
            status = branches[-1].status
    main = [b for b in branches if b.period_multiple == 1]
    for branch in main:
        if not branch.status.startswith("complete"):
            status = branch.status
    summary: dict[str, Any] = {
        "points": int(sum(b.frequency_hz.size for b in branches)),
        "peaks": [
            {
                "frequency_hz": float(b.frequency_hz[k]),
                "value_m": float(values[k]),
                "kind": "stable" if b.stable[k] else "unstable",
                "direction": "continuation",
                "level": b.level,
                "probe": name,
            }
            for b in main
            for name, values in b.peak_displacement.items()
            for k in [int(np.argmax(values))]
        ],
        "special_points": [
            {"kind": e.kind, "frequency_hz": e.frequency_hz, "snubber": e.snubber, "level": b.level,
             "period_multiple": b.period_multiple}
            for b in branches
            for e in b.special
        ],
        "processor_time_s": clock.process_time() - processor,
        "status": status,
    }  # fmt: skip
    return FrequencyResponse(
        scenario=scenario,
        status=status,
        branches=tuple(branches),
        modes=system.modes,
        summary=summary,
        warnings=(*scenario.warnings, *system.warnings),
        wall_time_s=clock.perf_counter() - begin,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        provenance=versions(),
    )


def _part(progress: Callable[[float], None], index: int, count: int) -> Callable[[float], None]:
    return lambda fraction: progress((index + fraction) / count)


def _level(
    system: StructuralSystem,
    loads: PeriodicForcing,
    settings: Continuation,
    level: float,
    progress: Callable[[float], None] | None,
) -> list[ResponseBranch]:
    first, last = 2 * np.pi * settings.from_, 2 * np.pi * settings.to
    low, high = sorted((first, last))
    flow: Any
    if system.cubic.count:
        flow = SmoothFlow(system.dynamics, system.cubic.shape, system.cubic.stiffness, loads, first, level)
    else:
        flow = VariationalFlow(system.dynamics, loads, first, level)
    problem = ForcedOrbits(flow)
    start = find_orbit(problem, forward=last - first)
    if start is None:
        raise ScenarioError(
            Problem(
                "sweep.from",
                f"= {settings.from_:g} Hz has no periodic motion that a transient comes to",
                "begin at another frequency",
            )
        )
    # a loop of the curve may reach back beyond the first frequency before it goes on
    low, high = (low / EXCURSION, high) if last > first else (low, high * EXCURSION)
    branch = follow_orbits(problem, start, low, high, Settings(most_points=MOST_POINTS))
    points: list[BranchPoint] = []
    for point in branch:
        points.append(point)
        if progress is not None:
            progress((point.parameter - first) / (last - first))
    status = branch.status
    if status.startswith("complete: reached") and abs(points[-1].parameter - last) > 1e-9 * last:
        status = (
            f"left the range at its beginning ({points[-1].parameter / (2 * np.pi):.6g} Hz) without reaching "
            f"{settings.to:g} Hz: the motion at {settings.from_:g} Hz belongs to another branch; begin elsewhere"
        )
    elif status.startswith("complete: reached"):
        status = f"complete: reached {settings.to:g} Hz"
    special = [s for a, b in pairwise(points) for s in special_points(problem, a, b, branch.settings)]
    found = [_response(system, problem, points, status, special)]
    for doubling in (s for s in special if s.kind == "period_doubling"):
        if any(_passes(b, doubling.parameter / (2 * np.pi)) for b in found[1:]):
            continue
        switched = switch_at_period_doubling(problem, doubling)
        if switched is None:
            continue
        doubled, begin = switched
        aside = follow_orbits(doubled, begin, low, high, Settings(most_points=MOST_POINTS_ASIDE))
        own = list(aside)
        events = [s for a, b in pairwise(own) for s in special_points(doubled, a, b, aside.settings)]
        found.append(_response(system, doubled, own, aside.status, events))
    return found


def _passes(branch: ResponseBranch, frequency_hz: float) -> bool:
    return bool(np.min(np.abs(branch.frequency_hz - frequency_hz)) < SAME * frequency_hz)


def _response(
    system: StructuralSystem,
    problem: ForcedOrbits,
    points: list[BranchPoint],
    status: str,
    special: list[SpecialPoint],
) -> ResponseBranch:
    """Peaks, harmonics, forces and stability along a branch."""
    n, c = system.dynamics.size, system.dynamics.contacts
    count = len(points)
    probes = {p.name: p.shape for p in system.probes}
    high = {name: np.empty(count) for name in probes}
    low = {name: np.empty(count) for name in probes}
    harmonics = {name: np.empty((count, ORDERS), dtype=complex) for name in probes}
    force = {s.name: np.empty(count) for s in system.snubbers}
    multipliers, stable = [], np.empty(count, dtype=bool)
    for i, point in enumerate(points):
        flow, _ = problem.flow_at(point.parameter)
        orbit = problem.orbit(point)
        time = np.linspace(0.0, orbit.period, SAMPLES, endpoint=False, dtype=np.float64)
        q = flow.states_at(point.data, time)[:, :n]
        for name, shape in probes.items():
            x = q @ shape
            high[name][i], low[name][i] = _refined(x), -_refined(-x)
            coefficients = 2.0 * np.fft.rfft(x)[:ORDERS] / SAMPLES
            coefficients[0] *= 0.5
            harmonics[name][i] = coefficients
        if c.count:
            delta, rate = flow.penetration(point.data, time)
            push = (c.stiffness * delta + c.dashpot * rate) * (delta > 0)
            for j, name in enumerate(force):
                force[name][i] = float(push[:, j].max())
        multipliers.append(orbit.multipliers)
        stable[i] = orbit.stable
    names = [s.name for s in system.snubbers]
    return ResponseBranch(
        level=problem.level,
        period_multiple=problem.multiple,
        status=status,
        frequency_hz=np.array([p.parameter for p in points]) / (2 * np.pi),
        peak_displacement={name: np.maximum(high[name], -low[name]) for name in probes},
        max_displacement=high,
        min_displacement=low,
        harmonics=harmonics,
        peak_force=force,
        stable=stable,
        floquet_multipliers=np.array(multipliers),
        residual=np.array([p.residual for p in points]),
        special=tuple(
            OrbitEvent(
                s.kind, s.parameter / (2 * np.pi), s.parameter / (2 * np.pi), names[s.contact] if s.contact >= 0 else
                "", s.time,
            )
            for s in special
        ),
    )  # fmt: skip


def _refined(x: Floats) -> float:
    """The largest value of periodic samples, by the parabola through the three about it."""
    k = int(np.argmax(x))
    a, b, c = x[k - 1], x[k], x[(k + 1) % x.size]
    bend = a - 2 * b + c
    return float(b) if bend >= 0 else float(b - (c - a) ** 2 / (8 * bend))
