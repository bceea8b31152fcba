"""A periodic motion in samples, and what a response curve shows of it: extremes, harmonics, forces, allowables.

Extremes are sought among equidistant samples, further ones within short contacts, and the instants at which a contact
opens or closes, taken from both sides, since there the force of a dashpot jumps. About every sample that may be near an
extreme the motion is sampled again, between the events beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from beamsim.analyses.values import ACCELERATION, DISPLACEMENT, FORCE, LIMITED
from beamsim.contacts.contacts import Contacts
from beamsim.flow.passage import PeriodicForcing
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.harmonic_motion import HarmonicMotion
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.system.channels import ChannelSet, Rows
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, Ints

Products = Callable[[Floats], Floats]
Again = Callable[[Floats, Ints], "SampledMotion"]

SAMPLES = 2048  # of a period: enough for the accelerations of the highest modes that are kept
INSIDE = 16  # least number of parts of a segment between two events
POINTS = 32  # about a sample that may be near an extreme
MOST_NEAR = 8  # such samples of an output


@dataclass(frozen=True)
class DrivenSignals:
    """k signals ``level * Re(phasor (omega/reference)^power e^{i omega t})``."""

    phasor: Complexes  # (k,)
    power: Floats  # (k,)
    reference: float  # rad/s

    def amplitude(self, omega: float, level: float) -> Complexes:
        """(k,) at a frequency, rad/s, and level."""
        return np.asarray(level * self.phasor * (omega / self.reference) ** self.power)

    def at(self, motion: SampledMotion) -> Floats:
        """(nt, k) at the times of a motion."""
        return np.asarray(np.multiply.outer(motion.turning(1), self.amplitude(motion.omega, motion.level)).real)


@lru_cache(maxsize=64)
def _circle(turns: int) -> Complexes:
    """(S,) ``e^{i phi}`` at the equidistant samples of a period in which phi grows by so many turns."""
    return np.asarray(np.exp(2j * np.pi / SAMPLES * (np.arange(SAMPLES) * turns % SAMPLES)))


@dataclass(frozen=True)
class SampledMotion:
    """States at times: equidistant ones, if it has any, then in short segments and at both sides of every event."""

    omega: float  # rad/s, of the excitation
    multiple: int  # periods of the excitation in one of the motion
    level: float
    times: Floats  # (T,) s
    even: int  # how many of the times, the first ones, are equidistant over a period
    segment: Ints  # (T,) of the motion between two events
    bounds: Floats  # (G + 1,) s, of the segments
    again: Again  # the same motion at other times within given segments
    q: Products  # (k, n) rows -> (T, k) their products with the displacement
    v: Products  # ... and of the velocity
    force: Floats  # (T, m) N
    contact_share: Floats  # (contacts of the system,)
    contacts: Contacts  # m of them
    owner: Ints  # (m,) contact of the system that each of these is, or is a part of
    direction: Floats  # (m,) of a part's force in that of its contact

    @property
    def by_contact(self) -> Floats:
        """(T, contacts of the system) N, of all parts together."""
        force = np.zeros((self.times.size, int(self.owner.max(initial=-1)) + 1))
        np.add.at(force.T, self.owner, (self.force * self.direction).T)
        return force

    def turning(self, multiple: int) -> Complexes:
        """(T,) ``e^{i multiple omega t}``."""
        others = np.exp(1j * multiple * self.omega * self.times[self.even :])
        return np.concatenate([_circle(multiple * self.multiple)[: self.even], others])


@dataclass(frozen=True)
class MeasuredMotion:
    """Measured quantities of one motion: extremes of the C channels of `measured`, and more."""

    high: Floats  # (C,)
    low: Floats  # (C,)
    harmonics: Complexes  # (probes, H + 1) of the displacements, of the motion's own frequency
    contact_share: Floats  # (snubbers,)
    energy_error: float = math.nan  # relative, of the balance over a period

    def peak(self, columns: Ints) -> float:
        """Largest magnitude of some channels."""
        return float(np.maximum(np.abs(self.high[columns]), np.abs(self.low[columns])).max())


def measured(system: StructuralSystem, limited: Collection[str] = ()) -> ChannelSet:
    """The channels that are measured: what response curves show, what limits ask for, and the outputs.

    Parameters
    ----------
    system : of the channels.
    limited : names of the limits.
    """
    keys = {DISPLACEMENT, ACCELERATION, FORCE, *(LIMITED[name].key for name in limited if name in LIMITED)}
    return system.channels.only(lambda channel: channel.key in keys or channel.section == "outputs")


def _inside(bounds: Floats) -> tuple[Floats, Ints]:
    """Times within segments that hold few equidistant samples, and their segments, in order of time."""
    length = np.diff(bounds)
    short = np.flatnonzero((length > 0.0) & (length * SAMPLES < INSIDE * bounds[-1]))
    times = bounds[short, None] + np.multiply.outer(length[short], np.arange(1, INSIDE) / INSIDE)
    return times.ravel(), np.repeat(short, INSIDE - 1)


def sampled_orbit(problem: ForcedOrbits, point: BranchPoint) -> SampledMotion:
    """An orbit found by shooting."""
    flow, _ = problem.flow_at(point.parameter)
    passage = point.data
    n = flow.system.size
    contacts, phases = flow.system.contacts, passage.phases
    bounds = np.append(passage.time, passage.duration)
    share = passage.length @ contacts.touching(phases) / passage.duration

    def again(times: Floats, segment: Ints) -> SampledMotion:
        order = np.argsort(times)
        y = np.empty((times.size, flow.size))
        y[order] = flow.states_at(passage, times[order])
        return motion(times, segment, y, 0)

    def motion(times: Floats, segment: Ints, y: Floats, even: int) -> SampledMotion:
        force = flow.contact_forces(phases[segment], y, times)
        return SampledMotion(
            flow.omega, problem.multiple, flow.level, times, even, segment, bounds, again,
            lambda rows: y[:, :n] @ rows.T, lambda rows: y[:, n : 2 * n] @ rows.T, force, share, contacts,
            np.arange(contacts.count), np.ones(contacts.count),
        )  # fmt: skip

    even = np.arange(SAMPLES) * (passage.duration / SAMPLES)
    here = np.clip(np.searchsorted(passage.time, even, side="right") - 1, 0, passage.time.size - 1)
    inside, short = _inside(bounds)
    inner = np.arange(1, passage.time.size)  # segments that begin with an event
    known = [flow.states_at(passage, even), flow.states_at(passage, inside), passage.y[inner], passage.y[inner]]
    times = np.concatenate([even, inside, passage.time[inner], passage.time[inner]])
    return motion(times, np.concatenate([here, short, inner - 1, inner]), np.vstack(known), SAMPLES)


def sampled_motion(motion: HarmonicMotion, loads: PeriodicForcing, omega: float, level: float) -> SampledMotion:
    """A motion found by harmonic balance."""
    contacts, owner, direction = motion.springs, motion.owner, motion.direction
    m, owners, w = contacts.count, int(owner.max(initial=-1)) + 1, motion.fundamental
    share = np.zeros(m)
    begins: list[float] = []
    ends: list[float] = []
    for j, phases in enumerate(motion.closed):
        share[j] = float(np.sum(phases[:, 1] - phases[:, 0])) / (2 * np.pi)
        cut = phases[phases[:, 1] - phases[:, 0] < 2 * np.pi]
        begins += (cut[:, 0] / w).tolist()
        ends += (cut[:, 1] / w).tolist()
    edge = np.mod(np.array(begins + ends), motion.period)
    bounds, closed = motion.edges, motion.phases
    after = np.searchsorted(bounds, edge)  # segments that begin there
    begun = np.arange(edge.size) < len(begins)
    iw = 1j * w * np.arange(motion.highest + 1)
    ground = contacts.felt
    parts = [[np.flatnonzero((owner == j) & (direction == sign)) for sign in (1.0, -1.0)] for j in range(owners)]
    touching = np.array([sum(share[of].max(initial=0.0) for of in sides) for sides in parts])

    def at(times: Floats, segment: Ints, even: int) -> SampledMotion:
        elsewhere = np.exp(np.multiply.outer(times[even:], iw))

        def summed(harmonics: Complexes) -> Floats:
            """(T, k) values of harmonics (H + 1, k): by one transform, and elsewhere by summation."""
            others = (elsewhere @ harmonics).real
            if not even:
                return np.asarray(others)
            two_sided = (0.5 * SAMPLES) * harmonics
            two_sided[0] = SAMPLES * harmonics[0]
            return np.vstack([np.fft.irfft(two_sided, SAMPLES, axis=0), others])

        # projected before they are summed, so that the cost does not grow with the model
        def q(rows: Floats) -> Floats:
            return summed(motion.coordinates @ rows.T)

        def v(rows: Floats) -> Floats:
            return summed(iw[:, None] * (motion.coordinates @ rows.T))

        d, dv = loads.base_motion(omega, level, times)
        delta = -contacts.gap - contacts.sign * (q(contacts.shape) + np.multiply.outer(d, ground))
        rate = -contacts.sign * (v(contacts.shape) + np.multiply.outer(dv, ground))
        force = contacts.forces(closed[segment], delta, rate, np.zeros((times.size, 0)))
        return SampledMotion(
            omega, round(omega / w), level, times, even, segment, bounds, lambda t, g: at(t, g, 0), q, v,
            force, touching, contacts, owner, direction,
        )  # fmt: skip

    even = np.arange(SAMPLES) * (motion.period / SAMPLES)
    here = np.searchsorted(bounds, even, side="right") - 1
    inside, short = _inside(bounds)
    outer, inner = np.where(begun, after - 1, after), np.where(begun, after, after - 1)
    beside = np.mod(np.concatenate([outer, inner]), bounds.size - 1)
    times = np.concatenate([even, inside, edge, edge])
    return at(times, np.concatenate([here, short, beside]), SAMPLES)


def measure(
    system: StructuralSystem,
    loads: PeriodicForcing,
    base: DrivenSignals | None,
    signals: DrivenSignals,
    motion: SampledMotion,
    channels: ChannelSet,
    harmonics: int = 5,
) -> MeasuredMotion:
    """Extremes of channels, see `measured`, and harmonics (the mean and as many as asked for) of a motion.

    ``base`` is its acceleration, m/s^2, None where it is at rest; ``signals`` are those of the loads.
    """
    loaded = _Loaded(system, loads, base, signals)

    def rows_of(motion: SampledMotion) -> Floats:
        rows = {False: channels.linear, True: channels.squared}
        return channels.values(lambda squared: loaded.values(motion, rows[squared])).T

    rows = rows_of(motion)
    high, low = _extremes(motion, rows, rows_of)
    spectrum = 2.0 * np.fft.rfft(rows[channels.places[DISPLACEMENT], :SAMPLES])[:, : harmonics + 1] / SAMPLES
    spectrum[:, 0] *= 0.5
    return MeasuredMotion(high, low, spectrum, motion.contact_share[: len(system.snubbers)])


@dataclass(frozen=True)
class _Loaded:
    """A system under periodic loads, whose channels are evaluated where a motion is sampled."""

    system: StructuralSystem
    loads: PeriodicForcing
    base: DrivenSignals | None
    signals: DrivenSignals

    def values(self, motion: SampledMotion, rows: Rows) -> Floats:
        """(T, k) values of rows."""
        carried = np.zeros(motion.times.size) if self.base is None else self.base.at(motion)[:, 0]
        base, _ = self.loads.base_motion(motion.omega, motion.level, motion.times)
        values = (
            motion.q(rows.displacement) + motion.v(rows.velocity) + rows.constant
            + np.multiply.outer(carried, rows.base_acceleration) + np.multiply.outer(base, rows.base_displacement)
            + self.signals.at(motion) @ rows.load.T + motion.by_contact @ rows.contact.T
        )  # fmt: skip
        if rows.cubic.any():
            values = values + _pulls(self.system, self.loads, motion) @ rows.cubic.T
        accelerated = np.flatnonzero(rows.acceleration.any(axis=1))
        if accelerated.size:
            shapes = rows.acceleration[accelerated]
            values[:, accelerated] += _accelerations(self.system, self.loads, motion, shapes)
        return values


def _pulls(system: StructuralSystem, loads: PeriodicForcing, motion: SampledMotion) -> Floats:
    """(T, c) of the cubic springs."""
    cubic = system.cubic
    base, _ = loads.base_motion(motion.omega, motion.level, motion.times)
    stretch = motion.q(cubic.shape) + np.multiply.outer(base, cubic.felt)
    return np.asarray(cubic.stiffness * stretch**3)


def _accelerations(system: StructuralSystem, loads: PeriodicForcing, motion: SampledMotion, shapes: Floats) -> Floats:
    """(T, probes) from the equation of motion."""
    dynamics, c, cubic = system.dynamics, motion.contacts, system.cubic
    force = loads.at(motion.omega, motion.level)[0]
    load = np.zeros((motion.times.size, len(shapes))) + shapes @ dynamics.constant_load
    for multiple, phasor in zip(loads.multiple.tolist(), force @ shapes.T, strict=True):
        load += np.multiply.outer(motion.turning(multiple), phasor).real
    elastic = motion.q(shapes * dynamics.stiffness) + motion.v(shapes @ dynamics.damping)
    if cubic.count:
        elastic = elastic + _pulls(system, loads, motion) @ (cubic.shape @ shapes.T)
    return np.asarray(load - elastic + (motion.force * c.sign) @ (c.shape @ shapes.T))


def _extremes(motion: SampledMotion, rows: Floats, rows_of: Callable[[SampledMotion], Floats]) -> tuple[Floats, Floats]:
    """Largest and smallest values (k,) of rows (k, T), which ``rows_of`` gives of the motion at other times."""
    best = np.concatenate([rows.max(axis=1), -rows.min(axis=1)])
    begin, end, segment = _near(motion, _likely(motion, rows, best))
    if begin.size:
        share = (np.arange(POINTS) + 0.5) / POINTS
        times = begin[:, None] + (end - begin)[:, None] * share
        finer = rows_of(motion.again(times.ravel(), np.repeat(segment, POINTS))).reshape(len(rows), -1, POINTS)
        best = np.maximum(best, _tops(np.concatenate([finer, -finer])).max(axis=1))
    return best[: len(rows)], -best[len(rows) :]


def _likely(motion: SampledMotion, rows: Floats, best: Floats) -> Ints:
    """The times beside which an extreme may lie: a parabola there could exceed the largest sample, ``best`` (2 k,)."""
    count, segment = motion.even, motion.segment[: motion.even]
    beside = np.arange(-1, count + 1) % count
    alone = segment[beside[:-2]] != segment[beside[2:]]  # beside an event: three samples are no parabola
    bend = np.diff(rows[:, beside], 2, axis=1)
    np.abs(bend, out=bend)
    bend[:, alone] = 0.0
    rise = 0.25 * bend.max(axis=1)
    likely = []
    for k, x in enumerate(np.concatenate([rows, -rows])):
        row, top = k % len(rows), best[k]
        j = np.flatnonzero(x[:count] + rise[row] >= top)
        peak = (x[j] >= x[beside[j]]) & (x[j] > x[beside[j + 2]]) & (x[j] + 0.25 * bend[row, j] >= top)
        others = count + np.flatnonzero(x[count:] + np.maximum(rise[row], 0.02 * np.abs(x[count:])) >= top)
        j = np.concatenate([j[peak | alone[j]], others])
        likely.append(j[np.argsort(-x[j], kind="stable")[:MOST_NEAR]])
    return np.unique(np.concatenate(likely))


def _near(motion: SampledMotion, samples: Ints) -> tuple[Floats, Floats, Ints]:
    """Beginning and end of the time about each sample within its segment, and the segment."""
    bounds, period = motion.bounds, float(motion.bounds[-1])
    step, segment, t = period / SAMPLES, motion.segment[samples], motion.times[samples]
    length = np.diff(bounds)
    reach = np.where(length < INSIDE * step, length / INSIDE, step)[segment]
    wrapped = t < reach  # what is before t = 0 is at the end of the period
    begin = np.concatenate([t - reach, np.full(wrapped.sum(), period - step)])
    end = np.concatenate([t + reach, np.full(wrapped.sum(), period)])
    segment = np.concatenate([segment, np.full(wrapped.sum(), length.size - 1)])
    begin, end = np.maximum(begin, bounds[segment]), np.minimum(end, bounds[segment + 1])
    kept = end > begin
    return begin[kept], end[kept], segment[kept]


def _tops(x: Floats) -> Floats:
    """(k, W) largest values of rows (k, W, P) of equidistant samples, refined by the parabola through three of them."""
    k = np.clip(np.argmax(x, axis=2), 1, POINTS - 2)[:, :, None]
    a, b, c = (np.take_along_axis(x, k + of, axis=2)[:, :, 0] for of in (-1, 0, 1))
    bend = a - 2 * b + c
    inner = (bend < 0) & (b >= a) & (b >= c)
    refined = np.where(inner, b - (c - a) ** 2 / (8 * np.where(inner, bend, -1.0)), b)
    return np.asarray(np.maximum(refined, x.max(axis=2)))
