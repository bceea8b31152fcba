"""A built system with other snubbers' numbers or another damping, without assembling anything again."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.contacts.snubbers import build_contacts, resolve_preloads
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

_FREE = ("stiffness", "damping", "gap", "preload")


def with_changed_contacts(system: StructuralSystem, before: Scenario, after: Scenario) -> StructuralSystem | None:
    """The system of `after`, made from that of `before`; None where more than contacts and damping differs.

    Only ``dynamics`` is brought up to date: what describes the system to people (snubbers, modes, equilibrium) stays.
    """
    if not _same_structure(before, after):
        return None
    damping = _damping(system, before, after)
    if damping is None:
        return None
    dynamics = system.dynamics
    snubbers = after.all_snubbers
    omega = np.sqrt(dynamics.stiffness)
    rigid = int(np.sum(omega == 0))
    path = "snubbers" if after.beam is not None else "chain.snubbers"
    count = len(snubbers)
    contacts = build_contacts(snubbers, dynamics.contacts.shape[:count], omega, rigid, path)
    contacts = contacts.with_others(dynamics.contacts.take(slice(count, None)))
    contacts = resolve_preloads(
        contacts,
        [s.preload for s in snubbers],
        dynamics.stiffness,
        rigid,
        dynamics.constant_load[None, :],
        system.cubic,
        path,
    )
    return replace(system, dynamics=replace(dynamics, damping=damping, contacts=contacts))


def _same_structure(before: Scenario, after: Scenario) -> bool:
    for name in type(before).model_fields:
        old, new = getattr(before, name), getattr(after, name)
        if old is new:
            continue
        if name == "snubbers":
            if not _same_places(old, new):
                return False
        elif name in ("beam", "chain") and old is not None and new is not None:
            for field in type(old).model_fields:
                a, b = getattr(old, field), getattr(new, field)
                if field == "damping" or a is b:
                    continue
                if field == "snubbers":
                    if not _same_places(a, b):
                        return False
                elif a != b:
                    return False
        elif old != new:
            return False
    return True


def _same_places(old: Any, new: Any) -> bool:
    """Whether snubbers differ in stiffness, damping, gap and preload only."""
    return len(old) == len(new) and all(
        a is b
        or (type(a) is type(b) and all(getattr(a, f) == getattr(b, f) for f in type(a).model_fields if f not in _FREE))
        for a, b in zip(old, new, strict=True)
    )


def _damping(system: StructuralSystem, before: Scenario, after: Scenario) -> Floats | None:
    old = (before.beam or before.chain).damping  # type: ignore[union-attr]
    new = (after.beam or after.chain).damping  # type: ignore[union-attr]
    if old == new:
        return system.dynamics.damping
    if old is None or new is None or old.kind != new.kind or old.kind == "viscous":
        return None
    omega = np.sqrt(system.dynamics.stiffness)
    change = _diagonal(new, omega, system.modes.kept_modes) - _diagonal(old, omega, system.modes.kept_modes)
    return np.asarray(system.dynamics.damping + np.diag(change))


def _diagonal(damping: Any, omega: Floats, modes: int) -> Floats:
    """Modal or Rayleigh damping as `beamsim.structures.damping` builds it, 1/s."""
    if damping.kind == "rayleigh":
        return np.asarray(damping.mass + damping.stiffness * omega**2)
    given = np.atleast_1d(np.asarray(damping.ratio, dtype=float))
    ratio = np.full(omega.size, given[-1])
    count = min(given.size, modes)
    ratio[:count] = given[:count]
    return np.asarray(2 * ratio * omega)
