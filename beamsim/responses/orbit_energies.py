"""The energy balance of periodic motions: work in = dissipated + change of the stored energy, over a period.

A free conservative motion keeps its energy from event to event. For other motions work and dissipation are integrated
in closed form; with cubic springs by Gauss-Legendre rules on panels short compared with the fastest motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from beamsim.contacts.laws import RATE
from beamsim.flow.harmonic_motions import HarmonicMotions
from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.labelled import Dataset
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.harmonic_balance import ForcedBalance, HarmonicMotion
from beamsim.orbits.period import gauss_panels
from beamsim.outcomes import Outcome, OutcomeKind, Where
from beamsim.responses.energies import LARGEST_ERROR, power_factors, stored_energy
from beamsim.typing import Floats, Ints

SAMPLES_A_HARMONIC = 8  # of the stored energy


@dataclass(frozen=True)
class _PiecewiseMotion:
    """States of a motion between its events."""

    edges: Floats  # (G + 1,) s
    phases: Ints  # (G, m) of the contacts
    states: Callable[[Floats], Floats]  # (nt, N) at increasing times

    def segments(self, times: Floats) -> Ints:
        """(nt,) between which edges times lie."""
        return np.clip(np.searchsorted(self.edges, times, side="right") - 1, 0, self.phases.shape[0] - 1)


def energy_error(flow: PeriodicFlow, flow_map: FlowMap) -> float:
    """Largest imbalance over the largest stored energy, or the dissipated one if it is more."""
    if isinstance(flow, VariationalFlow) and not flow.reversible:
        return float(energy_errors(HarmonicMotions(flow.exact, [flow_map], [flow.exact.sources]))[0])
    edges = np.append(flow_map.time, flow_map.time[0] + flow_map.duration)
    y = np.vstack([flow_map.y, flow_map.end])
    phases = flow_map.phases
    stored = _stored_energy(flow, edges, y, np.vstack([phases, phases[-1:]]))
    if flow.reversible:
        potential = stored - y[:, : flow.system.size] @ flow.system.constant_load
        return _relative(float(np.abs(potential - potential[0]).max()), float(stored.max()))
    known = _PiecewiseMotion(edges, phases, lambda times: flow.states_at(flow_map, times))
    work, lost = _by_quadrature(flow, known, flow.fastest)
    return _relative(abs(work - lost - (stored[-1] - stored[0])), max(float(stored.max()), abs(lost)))


def energy_errors(motions: HarmonicMotions) -> Floats:
    """(M,) relative errors of the energy balance of motions in closed form, by integrals in closed form."""
    flow, of, last = motions.flow, motions.motion, np.append(motions.first[1:], motions.motion.size) - 1
    end = motions.time[motions.first] + motions.duration
    time, y = np.append(motions.time, end), np.vstack([motions.y, [each.end for each in motions.maps]])
    phases = np.vstack([motions.phases, motions.phases[last]])
    inputs = motions.inputs(np.append(of, of[last]), time).real
    rows = flow.equations.penetration[:, : y.shape[1] + inputs.shape[1]]
    stored = stored_energy(flow.system, y, np.hstack([y, inputs]) @ rows.T, phases)
    inside, ends = np.split(stored, [of.size])
    lost, work = motions.product_integrals(*power_factors(flow)).T
    lost = lost + motions.event_losses()
    largest = np.maximum(np.maximum.reduceat(inside, motions.first), ends)
    error, size = np.abs(work - lost - (ends - inside[motions.first])), np.maximum(largest, np.abs(lost))
    return np.asarray(np.divide(error, size, out=np.zeros_like(error), where=size > 0.0))


def balance_error(problem: ForcedBalance, point: BranchPoint) -> float:
    """Relative error of the energy balance of a motion found by harmonic balance.

    Galerkin's method makes the residual of the equations of motion orthogonal to every harmonic up to the highest, and
    so to the velocity, which has no others: the work of all forces over a period is zero whatever the number of
    harmonics, if the harmonics of the springs' forces are exact integrals. The balance therefore checks condensation,
    instants of contact and convergence, but not the truncation, whose size is estimated by
    :func:`beamsim.orbits.harmonic_balance.truncation`.
    """
    motion: HarmonicMotion = point.data
    flow, known = problem.flow_at(point.parameter), _PiecewiseMotion(motion.edges, motion.phases, motion.states)
    work, lost = _by_quadrature(flow, known, 2.0 * (motion.highest + 1) * motion.fundamental)
    times = np.linspace(0.0, motion.period, SAMPLES_A_HARMONIC * (motion.highest + 1), endpoint=False)
    stored = _stored_energy(flow, times, known.states(times), known.phases[known.segments(times)])
    return _relative(abs(work - lost), max(float(stored.max()), abs(lost)))


def check_balance(outcome: Outcome, points: Dataset) -> Outcome:
    """The outcome of branches: not reliable if the energy balance of a point is lost.

    Parameters
    ----------
    outcome : of following them.
    points : of all branches.

    Returns
    -------
    Outcome
        The given one if no balance is lost; else one that states the largest error, with the given one as a sub-outcome
        unless that is complete.
    """
    error, parameter = points["energy_error"].values, points["parameter"]
    bad = ~(error <= LARGEST_ERROR)
    if not np.any(bad):
        return outcome
    worst = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
    at = Where(float(parameter.values[worst]), parameter.unit)
    return imbalance_outcome(float(error[worst]), int(bad.sum()), at).copy_with(*outcome.unless_complete)


def imbalance_outcome(error: float, points: int, at: Where) -> Outcome:
    """The outcome of a branch whose energy balance is lost.

    Parameters
    ----------
    error : the largest, relative to the energy.
    points : number of points that have lost it.
    at : where the error is largest.

    Returns
    -------
    Outcome
    """
    return Outcome.of(
        OutcomeKind.UNTRUSTED, "orbit_energy_not_balanced",
        f"the energy balance over a period is wrong by {error:.2g} of the energy, and by more than {LARGEST_ERROR:g} "
        f"at {points} points",
        at=at, remedy="follow a smaller range around it", error=error, points=points,
    )  # fmt: skip


def _relative(difference: float, scale: float) -> float:
    return difference / scale if scale > 0.0 else 0.0


def _stored_energy(flow: PeriodicFlow, times: Floats, y: Floats, phases: Ints) -> Floats:
    """(nt,) kinetic and strain energy, J."""
    delta, _ = flow.penetration_of(y, times)
    energy = stored_energy(flow.system, y, delta, phases)
    if isinstance(flow, SmoothFlow):
        energy += 0.25 * flow.cubic_extension(y, times) ** 4 @ flow.springs.stiffness
    return np.asarray(energy)


def _by_quadrature(flow: PeriodicFlow, motion: _PiecewiseMotion, fastest: float) -> tuple[float, float]:
    """Work in and dissipated energy over a motion, J.

    They come from Gauss-Legendre rules on panels of each segment that are short against a motion of ``fastest`` rad/s.
    """
    times, share = gauss_panels(motion.edges, fastest)
    y, phases, each = motion.states(times), motion.phases, motion.segments(times)
    n, contacts, loads = flow.system.size, flow.system.contacts, flow.loads
    states, of_state = np.unique(phases, axis=0, return_inverse=True)
    dashpots = contacts.arrays.dissipative_force[np.arange(contacts.count), states, RATE][of_state.reshape(-1)]
    delta, rate = flow.penetration_of(y, times)
    push = contacts.sign * contacts.forces(phases[each], delta, rate, y[:, 2 * n :])
    v, force = y[:, n : 2 * n], loads.at(flow.omega, flow.level)[0]
    turning = np.exp(1j * np.multiply.outer(times, loads.multiple * flow.omega))
    outside = flow.system.constant_load + (turning @ force).real
    power = (outside * v).sum(axis=1)
    if loads.base.any():
        through = -push @ contacts.base_influence  # (nt, K) by contacts and springs on the ground
        if isinstance(flow, SmoothFlow):
            pull = flow.springs.stiffness * flow.cubic_extension(y, times) ** 3
            through += pull @ flow.springs.base_influence
        power += (through * loads.base_motion(flow.omega, flow.level, times)[1]).sum(axis=1)
    loss = ((v @ flow.system.damping) * v).sum(axis=1) + (dashpots[each] * rate**2).sum(axis=1)
    return float(share @ power), float(share @ loss)
