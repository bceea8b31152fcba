"""What friction contacts did in a run: sliding, what it lost and what it wore."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from beamsim.analyses.run.energy import contact_motion
from beamsim.contacts.springs import FRICTION
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
            "wear_power": contact.normal_force * float(distance[k]) / duration,
            "worn_volume": None
            if contact.wear_rate is None
            else contact.wear_rate * contact.normal_force * float(distance[k]),
        }
        for k, contact in enumerate(contacts)
    ]
