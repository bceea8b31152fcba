"""A built system with other snubbers' numbers or another damping, without assembling anything again."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.contacts.snubbers import build_contacts, resolve_preloads
from beamsim.system.force_tables import curves_of
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

_FREE = ("stiffness", "force_deflection", "damping", "gap", "preload")


def with_changed_contacts(system: StructuralSystem, before: Scenario, after: Scenario) -> StructuralSystem | None:
    """A system made from that of another scenario.

    Where a body's damping is varied, this is many times faster than building: nothing is assembled and reduced again.
    Only ``dynamics`` is brought up to date: what describes the system to people (snubbers, modes, equilibrium) stays.

    Parameters
    ----------
    system : of ``before``.
    before, after : the two scenarios.

    Returns
    -------
    The system of ``after``; None where more than contacts and damping differs.
    """
    if not _same_structure(before, after):
        return None
    damping = _damping(system, before, after)
    if damping is None:
        return None
    dynamics = system.dynamics
    snubbers = after.located_snubbers
    omega = np.sqrt(dynamics.stiffness)
    rigid = int(np.sum(omega == 0))
    count = len(snubbers)
    contacts = build_contacts(snubbers, curves_of(after), dynamics.contacts.shape[:count], omega, rigid)
    contacts = dynamics.contacts.with_first(contacts)
    resting = np.stack([dynamics.constant_load, contacts.resting_load])
    contacts = resolve_preloads(contacts, snubbers, dynamics.stiffness, rigid, resting, system.cubic)
    return replace(system, dynamics=replace(dynamics, damping=damping, contacts=contacts))


def _same_structure(before: Scenario, after: Scenario) -> bool:
    """Whether nothing differs but the bodies' damping and the snubbers' stiffness, table, damping, gap and preload."""
    old_bodies, new_bodies = before.all_bodies, after.all_bodies
    if old_bodies.keys() != new_bodies.keys():
        return False
    sections = set(type(before).model_fields) - {"snubbers", *before.body_sections}
    pairs = [(getattr(before, name), getattr(after, name), name) for name in sections]
    for name, old in old_bodies.items():
        new = new_bodies[name]
        if type(old) is not type(new):
            return False
        pairs += [(getattr(old, field), getattr(new, field), field) for field in type(old).model_fields]
    return _same_places(before.snubbers, after.snubbers) and all(
        a is b or name == "damping" or (_same_places(a, b) if name == "snubbers" else a == b) for a, b, name in pairs
    )


def _same_places(old: Any, new: Any) -> bool:
    """Whether snubbers differ in stiffness, table, damping, gap and preload only."""
    return len(old) == len(new) and all(
        a is b
        or (type(a) is type(b) and all(getattr(a, f) == getattr(b, f) for f in type(a).model_fields if f not in _FREE))
        for a, b in zip(old, new, strict=True)
    )


def _damping(system: StructuralSystem, before: Scenario, after: Scenario) -> Floats | None:
    """(n, n) damping of a single body, changed on the diagonal; None where it has to be built anew."""
    changed = [
        (old.damping, after.all_bodies[name].damping)
        for name, old in before.all_bodies.items()
        if old.damping != after.all_bodies[name].damping
    ]
    if not changed:
        return system.dynamics.damping
    ((old, new), *more) = changed
    if len(before.all_bodies) > 1 or before.joined_by or more or old is None or new is None or old.kind != new.kind:
        return None
    if old.kind == "viscous":
        return None
    omega = np.sqrt(system.dynamics.stiffness)
    change = _diagonal(new, omega, system.modes.kept_modes) - _diagonal(old, omega, system.modes.kept_modes)
    return np.asarray(system.dynamics.damping + np.diag(change))


def _diagonal(damping: Any, omega: Floats, modes: int) -> Floats:
    """Modal or Rayleigh damping as `beamsim.structures.damping` builds it, 1/s."""
    if damping.kind == "rayleigh":
        of_mass, of_stiffness = damping.factors
        return np.asarray(of_mass + of_stiffness * omega**2)
    given = np.atleast_1d(np.asarray(damping.ratio, dtype=float))
    ratio = np.full(omega.size, given[-1])
    count = min(given.size, modes)
    ratio[:count] = given[:count]
    return np.asarray(2 * ratio * omega)
