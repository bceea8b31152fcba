"""Branches of periodic motions as tables, and one motion in time: the numbers of ``beamsim nnm``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.nnm.result import ModeBranch, OrbitMotion
from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.orbits.continuation import BranchPoint, Settings
from beamsim.orbits.free_orbits import FreeOrbits, slowest_instant
from beamsim.orbits.reversible import BrakeOrbits, mode_points
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.analyses.nnm.paths import Followed, ModePath
    from beamsim.system.structural import StructuralSystem

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


def brake_branch(
    system: StructuralSystem, job: ModePath, orbits: BrakeOrbits, points: list[BranchPoint], status: str, **kind: Any
) -> ModeBranch:
    """Motions at rest twice a period."""
    modes = [orbits.mode(point) for point in points]
    shapes = np.array([m.shape for m in modes])
    return ModeBranch(
        status=status,
        parameter=np.array([job.shown(p.parameter) for p in points]),
        frequency_hz=np.array([m.frequency for m in modes]),
        energy=np.array([m.energy for m in modes]),
        share=np.array([m.share[job.mode] for m in modes]),
        residual=np.array([m.residual for m in modes]),
        coordinates=shapes,
        coordinate_velocities=np.zeros_like(shapes),
        least_kinetic=np.zeros(len(modes)),
        initial_displacement=shapes @ system.deflection.T,
        stable=np.array([m.stable for m in modes]),
        floquet_multipliers=np.array([m.multipliers for m in modes]),
        **kind,
    )


def free_branch(
    system: StructuralSystem,
    job: ModePath,
    brake: BrakeOrbits,
    orbits: FreeOrbits,
    points: list[BranchPoint],
    status: str,
    *,
    turned: bool,
    **kind: Any,
) -> ModeBranch:
    """Motions found over the whole period, begun where their phase was held, or ``turned`` to the slowest instant."""
    n = orbits.n
    states = np.empty((len(points), 2 * n))
    least, share = np.empty(len(points)), np.empty(len(points))
    for k, point in enumerate(points):
        time, kinetic = slowest_instant(point.data.flow, point.data.passage, n)
        begun = np.array([time if turned else 0.0])
        states[k] = point.data.flow.states_at(point.data.passage, begun)[0, : 2 * n]
        least[k] = kinetic / point.data.energy
        share[k] = _share(brake, states[k], orbits.split(point.u)[2])[job.mode]
    multipliers = [orbits.multipliers(point) for point in points]
    return ModeBranch(
        status=status,
        parameter=np.array([job.shown(p.parameter) for p in points]),
        frequency_hz=np.array([1.0 / float(p.u[-2]) for p in points]),
        energy=np.array([p.data.energy for p in points]),
        share=share,
        residual=np.array([p.residual for p in points]),
        coordinates=states[:, :n],
        coordinate_velocities=states[:, n:],
        least_kinetic=least,
        initial_displacement=states[:, :n] @ system.deflection.T,
        stable=np.array([orbits.stable(m) for m in multipliers]),
        floquet_multipliers=np.array(multipliers),
        **kind,
    )


def _share(brake: BrakeOrbits, state: Floats, factor: float) -> Floats:
    """(n,) share of each linear mode in the energy of the structure without its contacts."""
    rest = getattr(brake.family, "rest", None)
    x = state[: brake.n] if rest is None else state[: brake.n] - rest(factor)
    parts = (brake.omega * (brake.vectors.T @ x)) ** 2 + (brake.vectors.T @ state[brake.n :]) ** 2
    return np.asarray(parts / max(float(parts.sum()), 1e-300))


def special_points(
    system: StructuralSystem, job: ModePath, followed: Followed, gaps: Iterable[float]
) -> tuple[OrbitEvent, ...]:
    """Folds, branch points and grazings along a backbone; ``gaps`` are the parameters that jumps begin at."""
    special: list[OrbitEvent] = []
    names = system.contact_names
    cut, settings = set(gaps), Settings(iterations=10)
    for a, b in zip(followed.points[:-1], followed.points[1:], strict=True):
        if job.shown(a.parameter) in cut or followed.orbits.same_events(a, b):
            continue
        for found in mode_points(followed.orbits, a, b, settings):
            period = followed.orbits.split(found.point.u)[1]
            name = names[found.contact] if found.contact >= 0 else ""
            special.append(OrbitEvent(found.kind, job.shown(found.parameter), 1.0 / period, name, found.time))
    return tuple(special)


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
    delta = np.maximum(flow.penetration(whole, time)[0], 0.0) * flow.system.contacts.stiffness
    probes = {p.name: p.shape for p in system.probes}
    harmonics = {}
    for name, shape in probes.items():
        c = 2.0 * np.fft.rfft(q[:-1] @ shape)[: HARMONICS + 1] / SAMPLES
        c[0] *= 0.5
        harmonics[name] = c
    frequency, lines, drift = _spectrum(flow, start, period, probes, n)
    return OrbitMotion(
        time,
        {name: q @ shape for name, shape in probes.items()},
        {name: v @ shape for name, shape in probes.items()},
        {s.name: delta[:, i] for i, s in enumerate(system.snubbers)},
        q @ system.deflection.T,
        harmonics,
        periods=PERIODS,
        spectrum_frequency_hz=frequency,
        spectrum=lines,
        drift=drift,
    )


def _spectrum(
    flow: Any, start: Floats, period: float, probes: dict[str, Floats], n: int
) -> tuple[Floats, dict[str, Floats], float]:
    """Frequencies, amplitudes (zero to peak) and the drift of the state, relative, over 50 periods."""
    times = period * np.arange(RATE) / RATE
    history = {name: np.empty(PERIODS * RATE) for name in probes}
    z = start.copy()
    for k in range(PERIODS):
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
    frequency = np.arange(PERIODS * RATE // 2 + 1) / (PERIODS * period)
    w = np.concatenate([np.maximum(np.sqrt(flow.system.stiffness), 0.2 * np.pi / period), np.ones(n)])
    off = np.linalg.norm(w * (z - start)[: 2 * n]) / np.linalg.norm(w * start[: 2 * n])
    return frequency, lines, float(off)
