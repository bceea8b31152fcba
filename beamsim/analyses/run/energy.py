"""The energy balance of a run: work in = dissipated + change of the stored energy.

The three are computed from each other's independent expressions, so their difference measures the error of
the motion. Relative frame; what the motion of a ground-mounted snubber does to the structure counts as work in.
"""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.outputs import OutputSet, stack, velocities
from beamsim.analyses.run.result import EnergyHistory
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Bools, Floats


def stored_energy(flow: ExactFlow, y: Floats, penetration: Floats, closed: Bools, face: Floats) -> Floats:
    """(nt,) kinetic and strain energy of the structure and of its snubbers, J.

    ``y`` is (nt, 2n), the others (nt, m); a released ``no_tension`` snubber stores what its face keeps.
    """
    n = flow.system.size
    k = flow.system.contacts.stiffness
    compression = np.where(closed, penetration, np.where(flow.has_face, face, 0.0))
    return np.asarray(
        0.5 * np.einsum("ti,ti->t", y[:, n:], y[:, n:])
        + 0.5 * (y[:, :n] ** 2) @ flow.system.stiffness
        + 0.5 * compression**2 @ k
    )


def energy_history(trajectory: Trajectory, times: Floats) -> tuple[EnergyHistory, float]:
    """Energies at the output times and the relative error of their balance.

    The error is the largest imbalance over max(stored energy, integral of |power in|).
    """
    flow = trajectory.flow
    left, right, weight = _products(flow)
    integral = trajectory.product_integrals(times, left, right, weight)
    stored = np.empty(times.size)
    power = np.empty(times.size)
    states = _states(flow)
    chunk = max(1, 2_000_000 // (4 * flow.system.size + 1))
    for first in range(0, times.size, chunk):
        part = slice(first, first + chunk)
        closed = trajectory.closed_at(times[part])
        values = states.split(trajectory.sample(times[part], states), closed[0])
        stored[part] = stored_energy(flow, values["state"], values["penetration"], closed, values["face"])
        power[part] = (trajectory.sample(times[part], left) * trajectory.sample(times[part], right)) @ weight[:, 1]
    history = EnergyHistory(work_in=integral[:, 1], dissipated=integral[:, 0], stored=stored)
    return history, balance_error(times, history, power)


def balance_error(times: Floats, history: EnergyHistory, power: Floats) -> float:
    """Largest imbalance relative to max(stored energy, integral of |power in|); 0 for a motionless structure."""
    imbalance = history.work_in - history.dissipated - (history.stored - history.stored[0])
    scale = max(float(history.stored.max()), float(np.trapezoid(np.abs(power), times)))
    return float(np.abs(imbalance).max() / scale) if scale > 0 else 0.0


def _states(flow: ExactFlow) -> OutputSet:
    n = flow.system.size
    whole = flow.empty_output(2 * n)
    whole.row[:] = np.eye(2 * n)
    delta, _ = flow.penetrations()

    def faces(closed: Bools) -> LinearOutput:
        output = flow.empty_output(closed.size)
        output.face[:] = np.diag((flow.has_face & ~closed).astype(float))
        return output

    return OutputSet({"state": lambda closed: whole, "penetration": lambda closed: delta, "face": faces})


def _products(flow: ExactFlow):  # type: ignore[no-untyped-def]
    """Factors of the dissipated power (column 0 of the weights) and of the power in (column 1)."""
    system, contacts, sources = flow.system, flow.system.contacts, flow.sources
    m, loads = contacts.count, flow.forcing.load
    rate_of_damping, direction = np.linalg.eigh(system.damping)
    used = np.flatnonzero(np.abs(rate_of_damping) > 0)
    moving = velocities(flow, direction[:, used].T)
    with np.errstate(divide="ignore", invalid="ignore"):
        relaxing = np.where(flow.has_face, contacts.stiffness**2 / contacts.dashpot, 0.0)
    signals = flow.empty_output(loads.shape[0] + 1)
    signals.direct[0, 0] = 1.0
    for index in range(loads.shape[0]):
        signals.direct[index + 1, sources.channel == index] = 1.0
    loaded = velocities(flow, np.vstack([system.constant_load, loads]))
    base_rate = flow.empty_output(m)
    if flow.base_channel >= 0:
        base_rate.direct_slope[np.ix_(contacts.on_ground, sources.channel == flow.base_channel)] = 1.0

    def rates_and_faces(closed: Bools) -> tuple[LinearOutput, LinearOutput]:
        _, rate = flow.penetrations()
        on = closed[:, None].astype(float)
        face = flow.empty_output(m)
        face.face[:] = np.diag((flow.has_face & ~closed).astype(float))
        return LinearOutput(rate.row * on, rate.direct * on, rate.direct_slope * on, rate.face * on), face

    def left(closed: Bools) -> LinearOutput:
        return stack(moving, *rates_and_faces(closed), signals, flow.contact_forces(closed))

    def right(closed: Bools) -> LinearOutput:
        return stack(moving, *rates_and_faces(closed), loaded, base_rate)

    weight = np.zeros((used.size + 3 * m + loads.shape[0] + 1, 2))
    weight[: used.size + 2 * m, 0] = np.concatenate([rate_of_damping[used], contacts.dashpot, relaxing])
    weight[used.size + 2 * m :, 1] = np.concatenate([np.ones(loads.shape[0] + 1), -contacts.sign])
    return left, right, weight
