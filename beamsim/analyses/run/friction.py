"""What friction contacts did in a run: sliding, what it lost and what it wore."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from beamsim.analyses.run.energy import contact_motion
from beamsim.contacts.friction import DIRECTION, STICK
from beamsim.contacts.springs import FRICTION
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.trajectory import Trajectory
from beamsim.scenario.friction import FrictionBase
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints


def friction_contacts(system: StructuralSystem) -> Ints:
    """(f,) numbers of the friction contacts among all contacts, in the order of the scenario."""
    of_springs = [spring.kind for spring in system.springs if spring.law is not None]
    return len(system.snubbers) + np.flatnonzero(np.array(of_springs) == FRICTION)


def sliding_figures(
    system: StructuralSystem, trajectory: Trajectory, contacts: Sequence[FrictionBase]
) -> list[dict[str, Any]]:
    """Of each friction contact its sliding distance, m, slides, energy and power lost, J and W, wear power, W, and worn
    volume, m^3.

    Where sliding begins under less than the static force the slider moves by what the tangential spring springs back;
    this counts as sliding.
    """
    figures = _under_constant_forces(system, trajectory, contacts)
    if system.dynamics.contacts.pressed.size:
        pressed = iter(_under_forces_of_snubbers(system, trajectory, contacts))
        figures = [own if c.pressed_by is None else next(pressed) for own, c in zip(figures, contacts, strict=True)]
    return figures


def _under_constant_forces(
    system: StructuralSystem, trajectory: Trajectory, contacts: Sequence[FrictionBase]
) -> list[dict[str, Any]]:
    which = friction_contacts(system)
    of_flow = trajectory.flow.system.contacts
    phases = trajectory.phases_of(trajectory.state)
    moved = np.diff(contact_motion(trajectory)[1][:, which], axis=0)
    slides = ~of_flow.touching(phases)[:, which]
    lost = (of_flow.friction(phases)[:, which] * moved).sum(axis=0) + trajectory.event_losses()[:, which].sum(axis=0)
    begun = np.sum(slides[1:] & ~slides[:-1], axis=0)
    snaps: Floats = np.array([(c.static_force - c.sliding_force) / (c.stiffness or np.inf) for c in contacts])
    distance = np.where(slides, np.abs(moved), 0.0).sum(axis=0) + begun * snaps
    duration = trajectory.end if trajectory.end > 0.0 else np.inf
    return [
        {
            "sliding_distance": float(distance[k]),
            "slides": int(begun[k] + slides[0, k]),
            "dissipated_energy": float(lost[k]),
            "dissipated_power": float(lost[k]) / duration,
            "wear_power": contact.constant_force * float(distance[k]) / duration,
            "worn_volume": None
            if contact.wear_rate is None
            else contact.wear_rate * contact.constant_force * float(distance[k]),
        }
        for k, contact in enumerate(contacts)
    ]


def _under_forces_of_snubbers(
    system: StructuralSystem, trajectory: Trajectory, contacts: Sequence[FrictionBase]
) -> list[dict[str, Any]]:
    """The same of contacts that the force of a snubber presses, by integrals of sliding speed times 1 and that force.

    The share of sliding leaves out the time in which the snubber is open.
    """
    flow, of_flow = trajectory.flow, trajectory.flow.system.contacts
    which, count = of_flow.pressed, of_flow.pressed.size
    phases = trajectory.phases_of(trajectory.state)
    direction = DIRECTION[phases[:, which]]
    own = [c for c in contacts if c.pressed_by is not None]

    def force(state: Ints) -> LinearOutput:
        one = flow.empty_output(count)
        one.direct[:, 0] = 1.0
        return one.above(flow.pressing_forces(state))

    def speed(state: Ints) -> LinearOutput:
        along = flow.penetrations[1].some(which)
        turning = of_flow.pressing_factors(state) * of_flow.pressing_compliances(state)
        if turning.any():
            along += flow.pressing_force_rates(state).scaled(-turning[:, None])
        along = along.scaled(DIRECTION[state[which]][:, None])
        return along.above(along)

    end = np.array([trajectory.end])
    distance, work = trajectory.product_integrals(end, force, speed, np.eye(2 * count))[0].reshape(2, count)
    begun = (direction[1:] != 0.0) & (direction[:-1] == 0.0) & (phases[:-1, which] == STICK)
    snap = np.array([(c.static_coefficient - c.sliding_coefficient) / (c.stiffness or np.inf) for c in own])
    normal = trajectory.sample(trajectory.time, flow.pressing_forces)[1:]
    distance += (begun * snap * normal).sum(axis=0)
    work += (begun * snap * normal**2).sum(axis=0)
    sliding = np.array([c.sliding_coefficient for c in own])
    lost = sliding * work + trajectory.event_losses()[:, which].sum(axis=0)
    lost -= sliding * (begun * snap * normal**2).sum(axis=0)
    duration = trajectory.end if trajectory.end > 0.0 else np.inf
    starts = np.sum((direction[1:] != 0.0) & (direction[:-1] == 0.0), axis=0) + (direction[0] != 0.0)
    return [
        {
            "sliding_share": float(trajectory.length @ (direction[:, k] != 0.0)) / duration,
            "sliding_distance": float(distance[k]),
            "slides": int(starts[k]),
            "dissipated_energy": float(lost[k]),
            "dissipated_power": float(lost[k]) / duration,
            "wear_power": float(work[k]) / duration,
            "worn_volume": None if contact.wear_rate is None else contact.wear_rate * float(work[k]),
        }
        for k, contact in enumerate(own)
    ]
