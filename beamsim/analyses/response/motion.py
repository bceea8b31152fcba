"""A periodic motion in samples, and what a response curve shows of it: extremes, harmonics, forces, allowables.

Extremes are those of equidistant samples, refined by the parabola through the three about them, and of the instants at
which a contact opens or closes, taken from both sides: there the force of a dashpot jumps.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from beamsim.typing import Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.contacts.contacts import Contacts
    from beamsim.flow.passage import PeriodicForcing
    from beamsim.orbits.branch import BranchPoint
    from beamsim.orbits.harmonic_motion import HarmonicMotion
    from beamsim.orbits.shooting import ForcedOrbits
    from beamsim.system.structural import StructuralSystem

Rows = Callable[[Floats], Floats]

SAMPLES = 2048  # of a period: enough for the accelerations of the highest modes that are kept


@dataclass(frozen=True)
class DrivenSignals:
    """k signals ``level * Re(phasor (omega/reference)^power e^{i omega t})``."""

    phasor: Complexes  # (k,)
    power: Floats  # (k,)
    reference: float  # rad/s

    def at(self, motion: SampledMotion) -> Floats:
        """(nt, k) at the times of a motion."""
        amplitude = motion.level * self.phasor * (motion.omega / self.reference) ** self.power
        return np.asarray(np.multiply.outer(motion.turning(1), amplitude).real)


@lru_cache(maxsize=64)
def _circle(turns: int) -> Complexes:
    """(S,) ``e^{i phi}`` at the equidistant samples of a period in which phi grows by so many turns."""
    return np.asarray(np.exp(2j * np.pi / SAMPLES * (np.arange(SAMPLES) * turns % SAMPLES)))


@dataclass(frozen=True)
class SampledMotion:
    """States at equidistant times, then at both sides of every contact event."""

    omega: float  # rad/s, of the excitation
    multiple: int  # periods of the excitation in one of the motion
    level: float
    times: Floats  # (S + E,) s, the first S equidistant over a period
    q: Rows  # (k, n) rows -> (S + E, k) their products with the displacement
    v: Rows  # ... and of the velocity
    penetration: Floats  # (S + E, contacts of the system) m
    force: Floats  # (S + E, m) N
    contact_share: Floats  # (contacts of the system,)
    contacts: Contacts  # m of them
    owner: Ints  # (m,) contact of the system that each of these is, or is a part of
    direction: Floats  # (m,) of a part's force in that of its contact

    @property
    def by_contact(self) -> Floats:
        """(S + E, contacts of the system) N, of all parts together."""
        force = np.zeros((self.times.size, int(self.owner.max(initial=-1)) + 1))
        np.add.at(force.T, self.owner, (self.force * self.direction).T)
        return force

    def turning(self, multiple: int) -> Complexes:
        """(S + E,) ``e^{i multiple omega t}``."""
        edges = np.exp(1j * multiple * self.omega * self.times[SAMPLES:])
        return np.concatenate([_circle(multiple * self.multiple), edges])


@dataclass(frozen=True)
class MeasuredMotion:
    """Measured quantities of one motion."""

    high: Floats  # (probes,) m
    low: Floats  # (probes,)
    harmonics: Complexes  # (probes, H + 1) of the motion's own frequency
    acceleration: Floats  # (probes,) m/s^2, largest absolute
    force: Floats  # (m,) N, largest
    contact_share: Floats  # (m,)
    gap: dict[str, float]  # m, largest opening of each snubber, where limits ask for it
    stress: float | None  # Pa, largest bending stress, likewise
    highest_output: Floats  # (k,) of the outputs of the system
    lowest_output: Floats  # (k,)


def sampled_orbit(problem: ForcedOrbits, point: BranchPoint) -> SampledMotion:
    """An orbit found by shooting."""
    flow, _ = problem.flow_at(point.parameter)
    passage = point.data
    n = flow.system.size
    even = np.arange(SAMPLES) * (passage.duration / SAMPLES)
    contacts, phases = flow.system.contacts, flow.phases_in(passage)
    here = np.clip(np.searchsorted(passage.time, even, side="right") - 1, 0, passage.time.size - 1)
    inner = np.arange(1, passage.time.size)  # segments that begin with an event
    edge = passage.time[inner]
    y = np.vstack([flow.states_evenly(passage, SAMPLES), passage.y[inner], passage.y[inner]])
    times = np.concatenate([even, edge, edge])
    delta, rate = flow.penetration_of(y, times)
    share = passage.length @ contacts.touching(phases) / passage.duration
    each = np.vstack([phases[here], phases[inner - 1], phases[inner]])
    force = contacts.forces(each, delta, rate, y[:, 2 * n :])
    return SampledMotion(
        flow.omega, problem.multiple, flow.level, times, lambda rows: y[:, :n] @ rows.T,
        lambda rows: y[:, n : 2 * n] @ rows.T, delta, force, share, contacts,
        np.arange(contacts.count), np.ones(contacts.count),
    )  # fmt: skip


def sampled_motion(motion: HarmonicMotion, loads: PeriodicForcing, omega: float, level: float) -> SampledMotion:
    """A motion found by harmonic balance."""
    balanced = motion.contacts
    contacts, owner, direction = balanced.springs, balanced.owner, balanced.direction
    m, owners, w = contacts.count, int(owner.max(initial=-1)) + 1, motion.fundamental
    even = np.arange(SAMPLES) * (motion.period / SAMPLES)
    closed = np.zeros((SAMPLES, m), dtype=bool)
    share = np.zeros(m)
    edges: list[float] = []
    for j, phases in enumerate(motion.closed):
        share[j] = float(np.sum(phases[:, 1] - phases[:, 0])) / (2 * np.pi)
        for begin, end in phases:
            inside = (w * even - begin) % (2 * np.pi) < end - begin
            closed[:, j] |= inside
            if end - begin < 2 * np.pi:
                edges += [begin / w, end / w]
    edge = np.mod(np.array(edges), motion.period)
    times = np.concatenate([even, edge, edge])
    d, dv = loads.base_motion(omega, level, times)
    iw = 1j * w * np.arange(motion.highest + 1)
    at_edges = np.exp(np.multiply.outer(edge, iw))

    def summed(harmonics: Complexes) -> Floats:
        """(S + E, k) values of harmonics (H + 1, k): by one transform, and at the edges by summation."""
        two_sided = (0.5 * SAMPLES) * harmonics
        two_sided[0] = SAMPLES * harmonics[0]
        inside = (at_edges @ harmonics).real
        return np.vstack([np.fft.irfft(two_sided, SAMPLES, axis=0), inside, inside])

    # projected before they are summed, so that the cost does not grow with the model
    def q(rows: Floats) -> Floats:
        return summed(motion.coordinates @ rows.T)

    def v(rows: Floats) -> Floats:
        return summed(iw[:, None] * (motion.coordinates @ rows.T))

    ground = contacts.felt
    delta = -contacts.gap - contacts.sign * (q(contacts.shape) + np.multiply.outer(d, ground))
    rate = -contacts.sign * (v(contacts.shape) + np.multiply.outer(dv, ground))
    felt = delta  # by the springs, of which those of pads are not at the structure
    if balanced.pads:
        of_springs = summed(motion.deflections[:, :m]) + np.multiply.outer(d, ground)
        felt = -contacts.gap - contacts.sign * of_springs
    both = np.zeros((2 * edge.size, m), dtype=bool)
    both[edge.size :] = True  # the force just inside; just outside it is zero
    both &= np.abs(felt[SAMPLES:]) <= 1e-6 * np.abs(felt).max(axis=0, initial=0.0)
    force = contacts.forces(np.vstack([closed, both]).astype(np.int64), felt, rate, np.zeros((times.size, 0)))
    for spring in balanced.relaxing:
        force[:, spring.row] = contacts.sign[spring.row] * summed(motion.forces[:, [spring.row]])[:, 0]
    parts = [[np.flatnonzero((owner == j) & (direction == sign)) for sign in (1.0, -1.0)] for j in range(owners)]
    touching = np.array([sum(share[of].max(initial=0.0) for of in sides) for sides in parts])
    deepest = np.array([delta[:, np.concatenate(sides)[0]] for sides in parts]).reshape(owners, times.size).T
    return SampledMotion(
        omega, round(omega / w), level, times, q, v, deepest, force, touching, contacts, owner, direction
    )  # fmt: skip


def measure(
    system: StructuralSystem,
    loads: PeriodicForcing,
    base: DrivenSignals | None,
    signals: DrivenSignals,
    motion: SampledMotion,
    limited: Collection[str] = (),
    harmonics: int = 5,
) -> MeasuredMotion:
    """Extremes, harmonics (the mean and as many as asked for), forces and outputs of a motion.

    ``base`` is its acceleration, m/s^2, None where it is at rest; ``signals`` are those of the loads.
    """
    shapes = np.array([p.shape for p in system.probes]).reshape(-1, system.dynamics.size)
    x = motion.q(shapes)
    carried = np.zeros(motion.times.size) if base is None else base.at(motion)[:, 0]
    acceleration = _accelerations(system, loads, motion, shapes) + np.multiply.outer(carried, system.carried)
    parts = {"x": x, "acceleration": acceleration, "force": motion.by_contact}
    if "gap" in limited:
        parts["penetration"] = motion.penetration
    if "bending_stress" in limited and system.stress is not None:
        parts["bending"] = motion.q(system.stress.row) + np.multiply.outer(carried, system.stress.base)
    if system.outputs:
        parts["outputs"] = _outputs(system, loads, motion, carried, signals.at(motion))
    rows = np.concatenate([part.T for part in parts.values()])
    ends = np.cumsum([part.shape[1] for part in parts.values()])[:-1]
    high, low = (dict(zip(parts, np.split(top, ends), strict=True)) for top in (_top(rows), -_top(-rows)))
    gap = {s.name: -float(low["penetration"][j]) for j, s in enumerate(system.snubbers)} if "gap" in limited else {}
    stress = float(max(high["bending"].max(), -low["bending"].min())) if "bending" in parts else None
    spectrum = 2.0 * np.fft.rfft(rows[: x.shape[1], :SAMPLES])[:, : harmonics + 1] / SAMPLES
    spectrum[:, 0] *= 0.5
    none = np.zeros(0)
    return MeasuredMotion(
        high["x"], low["x"], spectrum, np.maximum(high["acceleration"], -low["acceleration"]),
        np.maximum(high["force"], 0.0), motion.contact_share, gap, stress, high.get("outputs", none),
        low.get("outputs", none),
    )  # fmt: skip


def _outputs(
    system: StructuralSystem, loads: PeriodicForcing, motion: SampledMotion, carried: Floats, signals: Floats
) -> Floats:
    """(S + E, k) what the scenario asks for; energies are half the sums of the squares of their rows."""
    columns = [np.zeros((motion.times.size, 0))]
    for rows in system.outputs:
        values = (
            motion.q(rows.displacement) + motion.v(rows.velocity) + rows.constant
            + np.multiply.outer(carried, rows.base_acceleration) + signals @ rows.load.T
            + motion.by_contact @ rows.contact.T
        )  # fmt: skip
        if rows.acceleration.any():
            values = values + _accelerations(system, loads, motion, rows.acceleration)
        if rows.cubic.any():
            values = values + _pulls(system, loads, motion) @ rows.cubic.T
        columns.append(0.5 * np.sum(values**2, axis=1, keepdims=True) if rows.squared else values)
    return np.hstack(columns)


def _pulls(system: StructuralSystem, loads: PeriodicForcing, motion: SampledMotion) -> Floats:
    """(S + E, c) of the cubic springs."""
    cubic = system.cubic
    base, _ = loads.base_motion(motion.omega, motion.level, motion.times)
    stretch = motion.q(cubic.shape) + np.multiply.outer(base, cubic.felt)
    return np.asarray(cubic.stiffness * stretch**3)


def _accelerations(system: StructuralSystem, loads: PeriodicForcing, motion: SampledMotion, shapes: Floats) -> Floats:
    """(S + E, probes) from the equation of motion."""
    dynamics, c, cubic = system.dynamics, motion.contacts, system.cubic
    force = loads.at(motion.omega, motion.level)[0]
    load = np.zeros((motion.times.size, len(shapes))) + shapes @ dynamics.constant_load
    for multiple, phasor in zip(loads.multiple.tolist(), force @ shapes.T, strict=True):
        load += np.multiply.outer(motion.turning(multiple), phasor).real
    elastic = motion.q(shapes * dynamics.stiffness) + motion.v(shapes @ dynamics.damping)
    if cubic.count:
        elastic = elastic + _pulls(system, loads, motion) @ (cubic.shape @ shapes.T)
    return np.asarray(load - elastic + (motion.force * c.sign) @ (c.shape @ shapes.T))


def _top(x: Floats) -> Floats:
    """(k,) largest values of rows (k, S + E): of the samples, refined by a parabola, and of the edges behind them."""
    even = x[:, :SAMPLES]
    k = np.argmax(even, axis=1)
    row = np.arange(x.shape[0])
    a, b, c = even[row, k - 1], even[row, k], even[row, (k + 1) % SAMPLES]
    bend = a - 2 * b + c
    refined = np.where(bend < 0, b - (c - a) ** 2 / (8 * np.where(bend < 0, bend, -1.0)), b)
    # a corner between two samples is no parabola
    refined = np.where(refined - b > np.abs(bend), b, refined)
    return np.asarray(np.maximum(refined, x[:, SAMPLES:].max(axis=1, initial=-np.inf)))
