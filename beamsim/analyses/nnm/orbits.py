"""Branches of periodic motions as tables, and one motion in time: the numbers of ``beamsim nnm``."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from beamsim.analyses.branch import ModeBranch, OrbitMotion, SpecialPointResult
from beamsim.analyses.nnm.paths import ModeBranches, ModePath
from beamsim.analyses.nnm.result import UNITS
from beamsim.analyses.run.orbit_energy import energy_error
from beamsim.interrupts import Stop, never
from beamsim.orbits.branch import FailedSearch, OrbitBranch
from beamsim.orbits.continuation import Settings
from beamsim.orbits.free_orbits import slowest_instant
from beamsim.orbits.reversible import BrakeOrbits
from beamsim.orbits.special_points import special_points as special_between
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

SAMPLES = 1024  # of a period, in the stored motion
HARMONICS = 20
PERIODS = 50  # of the spectrum, as in the thesis
RATE = 512  # samples a period of the spectrum


def mode_shape(field: Floats, vector: Floats, like: Floats) -> Floats:
    """(nx,) a linear mode at the stations, with the largest deflection of another shape, and its sign."""
    shape = field @ vector
    return np.asarray(
        shape / np.abs(shape).max() * float(np.abs(like).max()) * np.sign(float(shape @ like) or 1.0), dtype=float
    )


def branch_result(
    system: StructuralSystem,
    job: ModePath,
    brake: BrakeOrbits,
    branch: OrbitBranch,
    special: tuple[SpecialPointResult, ...] = (),
    **more: Any,
) -> ModeBranch:
    """A branch in SI numbers; ``brake`` is the problem of the backbone, ``more`` are further fields.

    Brake orbits, and those found over the whole period with their phase held, are given as they begin; a non-brake
    orbit at its slowest instant.
    """
    n, orbits = brake.n, branch.orbits
    states = np.array([orbit.state[: 2 * n] for orbit in orbits])
    least = np.zeros(len(orbits))
    if branch.problem is brake:
        shares = [brake.share_at(point) for point in branch.points]
    else:
        for k, point in enumerate(branch.points):
            time, kinetic = slowest_instant(point.data.flow, point.data.passage, n)
            instant = np.array([time if branch.kind == "non_brake" else 0.0])
            states[k] = point.data.flow.states_at(point.data.passage, instant)[0, : 2 * n]
            least[k] = kinetic / point.data.energy
        factors = [branch.problem.split(point.u)[2] for point in branch.points]
        shares = [brake.share(state[:n], factor, state[n:]) for state, factor in zip(states, factors, strict=True)]
    return ModeBranch(
        outcome=branch.outcome,
        kind=branch.kind,
        mode=branch.mode + 1,
        ratio=branch.ratio,
        parameter=np.array([job.shown(p.parameter) for p in branch.points]),
        unit=UNITS[job.parameter],
        parameter_meaning=job.parameter.replace("_", " "),
        frequency_hz=np.array([orbit.frequency_hz for orbit in orbits]),
        energy=np.array([orbit.energy for orbit in orbits]),
        share=np.array([share[job.mode] for share in shares]),
        residual=np.array([orbit.residual for orbit in orbits]),
        energy_error=np.array([energy_error(p.data.flow, p.data.passage) for p in branch.points]),
        coordinates=states[:, :n],
        coordinate_velocities=states[:, n:],
        least_kinetic=least,
        initial_displacement=states[:, :n] @ system.deflection.T,
        stable=np.array([orbit.stable for orbit in orbits]),
        floquet_multipliers=np.array([orbit.multipliers for orbit in orbits]),
        special=special,
        **more,
    )


def special_points(
    system: StructuralSystem, job: ModePath, branches: ModeBranches, stop: Stop = never
) -> tuple[tuple[SpecialPointResult, ...], list[FailedSearch], bool]:
    """Folds, branch points and grazings along a backbone, but not across its jumps; the searches that failed.

    The last value says whether ``stop`` ended the search.
    """
    special: list[SpecialPointResult] = []
    failed: list[FailedSearch] = []
    names, orbits = system.contact_names, branches.problem
    cut, settings = {jump.start for jump in branches.jumps}, Settings(iterations=10)
    for a, b in pairwise(branches.backbone.points):
        if job.shown(a.parameter) in cut:
            continue
        if stop():
            return tuple(special), failed, True
        for located in special_between(orbits, a, b, settings, failed):
            period = orbits.split(located.point.u)[1]
            name = names[located.contact] if located.contact >= 0 else ""
            special.append(
                SpecialPointResult(located.kind, job.shown(located.parameter), 1.0 / period, name, located.time)
            )
    return tuple(special), failed, False


def orbit_motion(system: StructuralSystem, flow: Any, state: Floats, period: float) -> OrbitMotion:
    """One motion over a period from a state, and its spectrum over 50 periods of the exact flow.

    ``state`` is (2n,). The flow is carried on from period to period without being put back on the periodic motion: an
    unstable one drifts away, and the spectrum then shows it.
    """
    n = system.dynamics.size
    start = np.zeros(flow.size)
    start[: 2 * n] = state
    whole = flow.carry(start, period)
    time = np.linspace(0.0, period, SAMPLES + 1)
    states = flow.states_at(whole, time)
    q, v = states[:, :n], states[:, n : 2 * n]
    delta = flow.penetration_of(states, time)[0]
    probes = {p.name: p.shape for p in system.probes}
    harmonics = {}
    for name, shape in probes.items():
        c = 2.0 * np.fft.rfft(q[:-1] @ shape)[: HARMONICS + 1] / SAMPLES
        c[0] *= 0.5
        harmonics[name] = c
    frequency, lines, drift = _spectrum(flow, start, period, PERIODS, probes, n)
    return OrbitMotion(
        time=time,
        displacement={name: q @ shape for name, shape in probes.items()},
        velocity={name: v @ shape for name, shape in probes.items()},
        force={s.name: flow.system.contacts.laws[i].static_force(delta[:, i]) for i, s in enumerate(system.snubbers)},
        stations=q @ system.deflection.T,
        harmonics=harmonics,
        periods=PERIODS,
        spectrum_frequency_hz=frequency,
        spectrum=lines,
        drift=drift,
    )


def _spectrum(
    flow: Any, start: Floats, period: float, periods: int, probes: dict[str, Floats], n: int
) -> tuple[Floats, dict[str, Floats], float]:
    """Frequencies, amplitudes (zero to peak) and the drift of the state, relative, over so many periods."""
    times = period * np.arange(RATE) / RATE
    history = {name: np.empty(periods * RATE) for name in probes}
    z = start.copy()
    for k in range(periods):
        passage = flow.carry(z, period)
        q = flow.states_at(passage, times)[:, :n]
        for name, shape in probes.items():
            history[name][k * RATE : (k + 1) * RATE] = q @ shape
        z = passage.end.copy()
    lines = {}
    for name, x in history.items():
        a = 2.0 * np.abs(np.fft.rfft(x)) / x.size
        a[0] *= 0.5
        lines[name] = a
    frequency = np.arange(periods * RATE // 2 + 1) / (periods * period)
    w = np.concatenate([np.maximum(np.sqrt(flow.system.stiffness), 0.2 * np.pi / period), np.ones(n)])
    off = np.linalg.norm(w * (z - start)[: 2 * n]) / np.linalg.norm(w * start[: 2 * n])
    return frequency, lines, float(off)
