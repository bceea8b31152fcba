"""Snubbers: where they act, their dashpots, and the gaps that follow from preloads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings, Equilibrium, Springs, find_equilibrium
from beamsim.contacts.force_curve import ForceCurve
from beamsim.contacts.hardening import hardening_law
from beamsim.contacts.laws import ContactLaw, kelvin_voigt
from beamsim.contacts.pads import MaxwellBranch, no_tension, recovering_law, table_law
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Located
from beamsim.scenario.base import path_text
from beamsim.structures.modes import closed_frequencies
from beamsim.typing import Floats

LAWS = {"kelvin_voigt": kelvin_voigt, "no_tension": no_tension}  # by their names in a scenario


def dashpot_from_ratio(ratio: float, stiffness: float, omega: Floats, shape: Floats, rigid: int) -> float:
    """The dashpot of a damping ratio, ``c = 2 xi k / Omega``.

    Omega is the first natural frequency with only this snubber closed; rigid-body modes are skipped.

    Parameters
    ----------
    ratio : xi.
    stiffness : k, N/m.
    omega : (n,) rad/s, open structure, the first ``rigid`` of them zero.
    shape : (n,) deflection at the snubber for a unit of each coordinate.
    rigid : number of rigid-body coordinates.

    Returns
    -------
    N s/m.

    Raises
    ------
    ValueError
        If there is no mode but rigid-body modes.
    """
    closed = closed_frequencies(omega, shape[None, :], np.array([stiffness]), rigid)
    moving = closed[closed > 0]
    if moving.size == 0:
        raise ValueError("no natural frequency differs from zero with this snubber closed")
    return float(2 * ratio * stiffness / moving[0])


def build_contacts(
    located: Sequence[Located], curves: Sequence[ForceCurve | None], shape: Floats, omega: Floats, rigid: int
) -> Contacts:
    """Contacts with dashpots resolved; gaps are those given, 0 where a preload is given instead.

    Parameters
    ----------
    located : the scenario's snubbers and where they are written.
    curves : of those that have a force-deflection table.
    shape : (m, n) deflection at each for a unit of each coordinate.
    omega : (n,) rad/s, open structure.
    rigid : number of rigid-body coordinates.

    Returns
    -------
    Contacts
        One for each snubber.

    Raises
    ------
    ScenarioError
        Where a damping ratio has no meaning.
    """
    snubbers = [item for _, _, item, _ in located]
    stiffness = [s.stiffness if curve is None else curve.stiffness for s, curve in zip(snubbers, curves, strict=True)]
    dashpot = [_dashpot(at, k, omega, row, rigid) for at, k, row in zip(located, stiffness, shape, strict=True)]
    return Contacts(
        shape=shape,
        sign=np.array([1.0 if resists(s) in ("below", "approach") else -1.0 for s in snubbers]),
        gap=np.array([0.0 if s.gap is None else s.gap for s in snubbers], dtype=float),
        on_ground=np.array([getattr(s, "mounted_on", "") == "ground" for s in snubbers], dtype=bool),
        laws=tuple(
            _law(s, float(k), curve, c) for s, k, curve, c in zip(snubbers, stiffness, curves, dashpot, strict=True)
        ),
    )


def _dashpot(located: Located, stiffness: float, omega: Floats, shape: Floats, rigid: int) -> float:
    damping = located.item.damping
    if damping is None or damping.kind == "viscous":
        return 0.0 if damping is None else float(damping.coefficient)
    try:
        return dashpot_from_ratio(damping.ratio, stiffness, omega, shape, rigid)
    except ValueError as error:
        at = f"{path_text(located.path)}.damping.ratio"
        raise ScenarioError(Problem(at, f"has no meaning here: {error}", "give the dashpot in N s/m")) from None


def _law(snubber: Any, stiffness: float, curve: ForceCurve | None, dashpot: float) -> ContactLaw:
    if snubber.hardening is not None:
        return hardening_law(stiffness, snubber.hardening.yield_force, snubber.hardening.stiffness, dashpot)
    branches = tuple(MaxwellBranch(b.stiffness, b.relaxation_time) for b in snubber.maxwell if b.stiffness > 0.0)
    if not branches and (curve is None or curve.slopes.size == 1):
        return LAWS[snubber.law](stiffness, dashpot)
    if curve is None:
        curve = ForceCurve.line(stiffness)
    if snubber.law == "no_tension" and (dashpot > 0.0 or branches):
        return recovering_law(curve, dashpot, branches)
    return table_law(curve, dashpot)


def resists(snubber: Any) -> str:
    """The motion it resists: "below" or "above", between two masses "approach" or "separation"."""
    return str(getattr(snubber, "side", "") or snubber.resists)


def springs_of(contacts: Contacts) -> Springs:
    """The static part of the contacts: one-sided springs, one for each part of a law."""
    parts = [(j, part) for j, law in enumerate(contacts.laws) for part in law.static_springs]
    contact = np.array([j for j, _ in parts], dtype=np.int64)
    direction = np.array([part.direction for _, part in parts])
    offset = np.array([part.offset for _, part in parts])
    return Springs(
        contacts.shape[contact],
        direction * contacts.sign[contact],
        np.array([part.stiffness for _, part in parts]),
        direction * contacts.gap[contact] + offset,
        contact,
    )


def _balancing(normal: Floats, force: Floats, push: Floats) -> str:
    """What to do about preloads that do not balance the loads on rigid-body motions: the nearest ones that do.

    ``normal`` is (p, r), ``force`` (p,), ``push`` (r,).
    """
    scale = np.linalg.norm(normal, axis=0) + np.abs(push)
    scale = np.where(scale > 0, scale, 1.0)
    away = normal / scale
    nearest = force - np.linalg.lstsq(away.T, away.T @ force + push / scale, rcond=1e-10)[0]
    imbalance = np.abs(away.T @ nearest + push / scale).max(initial=0.0)
    if imbalance > 1e-9 * np.abs(nearest).max(initial=0.0) or np.any(nearest <= 0):
        return "add a snubber against which the loads push: no preloads of these snubbers balance them"
    return "balance the loads: the nearest preloads that do are " + ", ".join(f"{x:.6g} N" for x in nearest)


def _unreached(located: Located, equilibrium: Equilibrium, remedy: str) -> Problem:
    return Problem(
        f"{path_text(located.path)}.preload",
        f"= {located.item.preload:g} N cannot be reached: with it, {equilibrium.reason}",
        f"give a gap instead, hold the structure, or {remedy}",
    )


def resolve_preloads(
    contacts: Contacts,
    located: Sequence[Located],
    stiffness: Floats,
    rigid: int,
    loads: Floats,
    cubic: CubicSprings,
) -> Contacts:
    """Contacts whose gaps give the specified preloads as contact forces at static equilibrium.

    At that equilibrium a preloaded snubber is a constant force s phi P, so the other contacts determine the shape; its
    gap then follows from the penetration at which its law pushes with P, P / k of a spring. A structure that floats
    between preloaded snubbers stays where it is drawn: any rigid-body motion would only shift their gaps.

    Parameters
    ----------
    contacts : the first of them snubbers.
    located : the snubbers, some with a preload, N.
    stiffness : (n,) diagonal of K, rad^2/s^2, the first ``rigid`` of them zero.
    rigid : number of rigid-body coordinates.
    loads : (L, n) constant loads.
    cubic : cubic springs.

    Returns
    -------
    Contacts

    Raises
    ------
    ScenarioError
        If no such equilibrium exists: on a structure that only the stops hold the preloads have to balance the loads.
    """
    preload = [item.preload for _, _, item, _ in located] + [None] * (contacts.count - len(located))
    given = np.array([p is not None for p in preload], dtype=bool)
    if not given.any():
        return contacts
    force = np.array([0.0 if p is None else p for p in preload])
    forces = (contacts.sign * force)[:, None] * contacts.shape
    springs = springs_of(contacts)
    rest = springs.take(~given[springs.contact])
    equilibrium = find_equilibrium(stiffness, rigid, rest, np.vstack([loads, forces[given]]), cubic)
    q = equilibrium.one_of_many if equilibrium.q is None else equilibrium.q
    if q is None:
        normal = (contacts.sign[:, None] * contacts.shape)[given, :rigid]
        remedy = _balancing(normal, force[given], loads[:, :rigid].sum(axis=0))
        raise ScenarioError([_unreached(located[i], equilibrium, remedy) for i in np.flatnonzero(given).tolist()])
    w = contacts.shape @ q
    pressed = np.array(
        [law.static_penetration(p) if p > 0.0 else 0.0 for law, p in zip(contacts.laws, force, strict=True)]
    )
    return replace(contacts, gap=np.where(given, -contacts.sign * w - pressed, contacts.gap))
