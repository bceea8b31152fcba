"""The energy balance of a run: work in = dissipated + change of the stored energy.

From segment to segment the three are computed from each other's independent expressions, so that their difference
measures the error of the motion. Histories are the work and the stored energy, and their difference is the loss.
All energies are in the relative frame; the work of a moving ground-mounted snubber on the structure counts as input.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import NOT_FINITE, Trajectory, not_finite
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.system.equations import PiecewiseLinearSystem, RowsOf
from beamsim.typing import Floats, Ints, not_none

PowerFactors = tuple[RowsOf, RowsOf, Floats]  # left and right factors of powers, and weights of their products
LEAST_SEGMENTS = 8  # smallest number of segments for a balance from segment to segment
FEW_TIMES = np.linspace(0.0, 1.0, 33) ** 1.1  # shares of a motion, uneven so that they do not fall on equal phases
LARGEST_ERROR = 1e-6  # relative error of the balance above which a motion is not reliable


@dataclass(frozen=True)
class EnergyHistory:
    """Energies at some times, J, in the relative frame; work_in = dissipated + stored - stored[0]."""

    input_work: Floats
    dissipated: Floats
    stored: Floats


def stored_energy(system: PiecewiseLinearSystem, y: Floats, penetration: Floats, phases: Ints) -> Floats:
    """Kinetic and strain energy of a structure and of its contacts.

    Parameters
    ----------
    system : the structure.
    y : (nt, N) states.
    penetration : (nt, m) of the contacts, m.
    phases : (nt, m) of the contacts.

    Returns
    -------
    (nt,) J.
    """
    n = system.size
    return np.asarray(
        0.5 * np.einsum("ti,ti->t", y[:, n : 2 * n], y[:, n : 2 * n])
        + 0.5 * (y[:, :n] ** 2) @ system.stiffness
        + system.contacts.stored_energy(phases, penetration, y[:, 2 * n :])
    )


@dataclass
class EnergyBalance:
    """Error of the energy balance of a motion, accumulated chunk by chunk."""

    error: float = 0.0  # largest imbalance over the energy; 0 of a motionless structure
    energy: float = 0.0  # J, the larger one of the stored energy and the integral of |power in|
    _imbalance: float = 0.0  # J, at the end of the latest chunk
    _absolute_work: float = 0.0  # J
    _largest_stored: float = 0.0  # J, the most
    # of each chunk, and when it is lost, s
    _chunk_errors: list[tuple[float, float | None]] = field(default_factory=list)

    def add(self, times: Floats, history: EnergyHistory, absolute_work: float) -> None:
        """Include the next chunk.

        Parameters
        ----------
        times : (nt,) s, from its start to its end.
        history : energies there; work and dissipation since its start.
        absolute_work : J, integral of the loads' power without its sign.
        """
        with np.errstate(invalid="ignore"):
            imbalance = self._imbalance + history.input_work - history.dissipated - (history.stored - history.stored[0])
        size = np.abs(imbalance)
        self._imbalance = float(imbalance[-1])
        self._absolute_work += absolute_work
        self._largest_stored = float(np.maximum(self._largest_stored, history.stored.max()))
        self.energy = max(self._largest_stored, self._absolute_work)
        lost = np.flatnonzero(~np.isfinite(size) | (np.isfinite(self.energy) & (size > LARGEST_ERROR * self.energy)))
        self._chunk_errors.append((float(size.max()), float(times[lost[0]]) if lost.size else None))
        self.error = float(np.max([size for size, _ in self._chunk_errors])) / self.energy if self.energy else 0.0

    def check(self, outcome: Outcome, remedy: str = "") -> Outcome:
        """The outcome of the motion: not reliable if the balance is lost."""
        allowed = min(LARGEST_ERROR * self.energy, np.finfo(float).max)
        lost_at = next((when for size, when in self._chunk_errors if when is not None and not size <= allowed), None)
        kept = lost_at is None or self.energy == 0.0 or outcome.code == NOT_FINITE
        return outcome if kept else self._lost(outcome, remedy, not_none(lost_at))

    def _lost(self, outcome: Outcome, remedy: str, time: float) -> Outcome:
        """The outcome of a motion whose balance is lost from ``time``, s, on."""
        if not np.isfinite(self.error):
            return not_finite(time)
        return Outcome.of(
            OutcomeKind.UNTRUSTED, "energy_not_balanced",
            f"the energy balance is wrong by {self.error:.2g} of the energy, from {time:.6g} s on by more than "
            f"{LARGEST_ERROR:g}",
            *outcome.unless_complete, remedy=remedy, error=self.error, time=time,
        )  # fmt: skip


def sampled_energies(trajectory: Trajectory, times: Floats) -> tuple[Floats, EnergyHistory, float]:
    """Times, energies then, and the integral of the loads' absolute power, J, by a sum over the times."""
    left, right, weight = power_factors(trajectory.flow)
    integral = trajectory.product_integrals(times, left, right, weight, float(trajectory.time[0]))
    power = (trajectory.sample(times, left) * trajectory.sample(times, right)) @ weight[:, 1]
    events = np.cumsum(trajectory.event_losses().sum(axis=1))
    at = np.clip(np.searchsorted(trajectory.time, times, side="right") - 1, 0, None)
    dissipated = integral[:, 0] + (events[at] - events[0])
    history = EnergyHistory(integral[:, 1], dissipated, sampled_stored_energy(trajectory, times))
    return times, history, float(np.trapezoid(np.abs(power), times))


def sampled_stored_energy(trajectory: Trajectory, times: Floats) -> Floats:
    """(nt,) stored energy of a motion at increasing times (nt,), s; J."""
    flow = trajectory.flow
    states = np.vstack([flow.equations.state, flow.equations.penetration])
    y, penetration = np.split(trajectory.sample(times, lambda _: states), [flow.size], axis=1)
    return stored_energy(flow.system, y, penetration, trajectory.phases[trajectory.segments_at(times)])


def energies_of_segments(trajectory: Trajectory) -> tuple[Floats, EnergyHistory, float]:
    """Times, energies at the ends of segments, and the integral of the loads' absolute power, J.

    Motions of few segments are evaluated at `FEW_TIMES`.
    """
    flow = trajectory.flow
    with np.errstate(over="ignore", invalid="ignore"):
        if trajectory.time.size < LEAST_SEGMENTS:
            begin = float(trajectory.time[0])
            return sampled_energies(trajectory, begin + (trajectory.end - begin) * FEW_TIMES)
        integrals = trajectory.segment_integrals(*power_factors(flow))
        sums = np.vstack([np.zeros(2), np.cumsum(integrals, axis=0)])
        events = np.cumsum(trajectory.event_losses().sum(axis=1))
        sums[:, 0] += np.append(events, events[-1:])
        times = np.append(trajectory.time, trajectory.end)
        history = EnergyHistory(sums[:, 1], sums[:, 0], stored_at_ends(trajectory))
        return times, history, float(np.abs(integrals[:, 1]).sum())


def stored_at_ends(trajectory: Trajectory) -> Floats:
    """(S + 1,) stored energy where the segments begin, and at the end, J."""
    flow, times = trajectory.flow, np.append(trajectory.time, trajectory.end)
    y = np.vstack([trajectory.y, trajectory.final_y])
    contacts = flow.system.contacts
    penetration = contacts.penetrations(y, None)[0] - contacts.sign * flow.mounting_displacements(times)
    phases = np.concatenate([trajectory.phases, trajectory.phases[-1:]])
    return stored_energy(flow.system, y, penetration, phases)


def power_factors(flow: ExactFlow) -> PowerFactors:
    """Factors of the dissipated power (column 0 of the weights) and of the power in (column 1)."""
    system, contacts, equations = flow.system, flow.system.contacts, flow.equations
    rate_of_damping, direction = np.linalg.eigh(system.damping)
    used = np.flatnonzero(rate_of_damping)
    moving = equations.rows(used.size, velocities=direction[:, used].T)
    signals, responses, each = work_factors(flow)

    inside = contacts.count + contacts.internal_states
    weight = np.zeros((used.size + inside + each.size, 2))
    weight[: used.size + inside, 0] = np.concatenate([rate_of_damping[used], np.ones(inside)])
    weight[used.size + inside :, 1:] = each
    return (
        lambda phases: np.vstack([moving, flow.at(phases).dissipation[0], signals(phases)]),
        lambda phases: np.vstack([moving, flow.at(phases).dissipation[1], responses(phases)]),
        weight,
    )


def work_factors(flow: ExactFlow) -> PowerFactors:
    """Factors of the input power: signals, and the velocities and forces on which they act."""
    system, equations, loads, stands = flow.system, flow.equations, flow.forcing.load, flow.stands
    given = np.vstack([
        equations.constant(np.ones(1)), equations.signals(np.arange(loads.shape[0])),
        equations.rows(stands.size, slopes=stands[:, None] == equations.channel),
    ])  # fmt: skip
    loaded = equations.rows(loads.shape[0] + 1, velocities=np.vstack([system.constant_load, loads]))
    push = -flow.influence[stands] * system.contacts.sign  # of contacts on what they stand on
    ones = np.ones((given.shape[0], 1))
    return lambda phases: given, lambda phases: np.vstack([loaded, push @ flow.at(phases).force]), ones
