"""Contact of a motion with a ring: forces, speeds and energies, which are no linear outputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.flow.trajectory import Trajectory
from beamsim.system.rings import RingInfo
from beamsim.typing import Bools, Floats, Ints

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_POINTS = np.concatenate([[-1.0], _NODES, [1.0 - 1e-9]])  # of a segment from -1 to 1: its ends, and Gauss points


@dataclass(frozen=True)
class RingContact:
    """Force and speed of a ring at ten points of each segment in contact, between which both are smooth."""

    touching: Bools  # (S,) whether a side is closed in each segment
    segments: Ints  # (n,) numbers of the segments in contact
    times: Floats  # (n, 10) s
    weights: Floats  # (n, 8) s, of the inner points in integrals
    force: Floats  # (n, 10) N, magnitude of the normal force
    sliding_speed: Floats  # (n, 10) m/s, along the wall

    @classmethod
    def of(cls, trajectory: Trajectory, ring: RingInfo) -> RingContact:
        """Sample a motion.

        Parameters
        ----------
        trajectory : the motion.
        ring : of its system.
        """
        flow, equations = trajectory.flow, trajectory.flow.equations
        touching = flow.system.contacts.closed(trajectory.phases)[:, ring.sides].any(axis=1)
        segments = np.flatnonzero(touching & (trajectory.length > 0.0))
        times = trajectory.time[segments, None] + 0.5 * (1.0 + _POINTS) * trajectory.length[segments, None]
        both = equations.penetration_rate[ring.sides[[0, ring.sides.size // 4]]]
        sampled = trajectory.sample(
            times.ravel(), lambda phases: np.vstack([-ring.normals.T @ flow.at(phases).force[ring.sides], both])
        )
        force, velocity = sampled[:, :2], sampled[:, 2:]
        size = np.hypot(*force.T)
        across = np.abs(force[:, 0] * velocity[:, 1] - force[:, 1] * velocity[:, 0])
        speed = np.divide(across, size, out=np.zeros_like(size), where=size > 0.0)
        weights = 0.5 * trajectory.length[segments, None] * _WEIGHTS
        return cls(touching, segments, times, weights, size.reshape(times.shape), speed.reshape(times.shape))

    def integrals(self, values: Floats) -> Floats:
        """(n,) integrals over the segments of values (n, 10)."""
        return np.asarray((self.weights * values[:, 1:-1]).sum(axis=1))

    def energy_lost(self, trajectory: Trajectory, contacts: Ints) -> Floats:
        """(n,) energy, J, that contacts of the ring lose in the segments.

        Parameters
        ----------
        trajectory : the motion.
        contacts : sides or friction contacts of the ring.
        """
        flow = trajectory.flow
        if not (self.segments.size and contacts.size):
            return np.zeros(self.segments.size)
        return trajectory.segment_integrals(
            lambda phases: flow.at(phases).dissipation[0][contacts],
            lambda phases: flow.at(phases).dissipation[1][contacts], np.ones((contacts.size, 1)), self.segments,
        )[:, 0]  # fmt: skip


def radial_speeds(trajectory: Trajectory, ring: RingInfo, times: Floats) -> Floats:
    """(nt,) rates of the distance from the centre of a ring, m/s, at times (nt,), s."""
    if not times.size:
        return np.zeros(0)
    equations, order, quarter = trajectory.flow.equations, np.argsort(times, kind="stable"), ring.sides.size // 4
    both, out = ring.sides[[0, quarter]], np.empty(times.size)
    rows = np.vstack([equations.penetration[both], equations.penetration_rate[both]])
    sampled = trajectory.sample(times[order], lambda _: rows)
    position = sampled[:, :2] + ring.support[[0, quarter]]
    out[order] = np.sum(position * sampled[:, 2:], axis=1) / np.hypot(*position.T)
    return out


def wear_values(trajectory: Trajectory, ring: RingInfo) -> dict[str, float]:
    """Contact share, sliding distance, work rate, wear and friction loss of a ring, by the names of their variables.

    Parameters
    ----------
    trajectory : the motion that is counted.
    ring : of its system.
    """
    contact, duration = RingContact.of(trajectory, ring), trajectory.end - float(trajectory.time[0])
    work = float(contact.integrals(contact.force * contact.sliding_speed).sum())
    rubbing = np.concatenate([ring.tangents, ring.axials])
    lost = float(contact.energy_lost(trajectory, rubbing).sum())
    if rubbing.size:
        lost += float(trajectory.event_losses()[:, rubbing].sum())
    rate = ring.ring.wear_rate
    return {
        "contact_share": float(trajectory.length[contact.touching].sum()) / duration if duration else np.nan,
        "sliding_distance": float(contact.integrals(contact.sliding_speed).sum()),
        "work_rate": work / duration if duration else np.nan,
        "worn_volume": np.nan if rate is None else rate * work,
        "friction_energy": lost,
    }
