r"""Snubbers, springs and friction contacts of a scenario: their laws, dashpots, and the gaps that follow from preloads.

With the slope :math:`k_0` about zero extension x, breakpoints :math:`b_i` and the changes of slope :math:`\Delta_i` at
them going away from zero, a piecewise-linear force is

.. math:: F(x) = k_0 x + \sum_{b_i > 0} \Delta_i [x - b_i]_+ - \sum_{b_i < 0} \Delta_i [b_i - x]_+ ,

a linear spring, which belongs to the structure, and a contact law with one phase per segment (written as one-sided
springs with clearances, their stiffness is negative where the spring softens). The motion therefore has a closed form
between breakpoints, which are located like contact events. The slope of every segment is not negative, so the strain
energy is convex.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings, Equilibrium, Springs, find_equilibrium
from beamsim.contacts.laws import (
    ContactLaw,
    OneSidedSpring,
    damping_on_approach,
    kelvin_voigt,
    latch,
    limited_damping,
    piecewise_linear,
    shock_arrestor,
)
from beamsim.contacts.pads import ForceCurve, MaxwellBranch, no_tension, recovering_law, relaxing_law, table_law
from beamsim.contacts.sliders import (
    falling_friction_law,
    friction_law,
    hardening_law,
    pressed_friction_law,
    rigid_friction_law,
    unloading_law,
)
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import path_text
from beamsim.scenario.body import LocatedItem
from beamsim.scenario.connections import SHOCK_ARRESTOR, HingeElement
from beamsim.scenario.rings import RING, RingPart
from beamsim.structures.modes import closed_modes
from beamsim.structures.places import ends_of, site_of
from beamsim.typing import Floats, Ints

JOINT, FRICTION = "spring", "friction"  # kinds of the joints that relax, and of friction contacts


@dataclass(frozen=True)
class SpringInfo:
    """One spring with a law of its own: where it acts, and F = linear x + that of the law, or cubic x^3."""

    name: str
    # "linear" (which relaxes), "cubic", "piecewise_linear", "shock_arrestor", "spring" of a joint, "friction", or a
    # part of a ring
    kind: str
    places: tuple[str, ...]  # what it connects to the ground, or the two places that it joins, for people
    masses: tuple[int, ...]  # their numbers where they are masses
    shape: Floats  # (n,) extension for a unit of each coordinate, 1/sqrt(kg)
    on_ground: bool  # whether it depends on the absolute displacement
    base_participation: Floats  # (K,) displacement of its place for a unit of each displacement of the base
    cubic: float  # N/m^3
    linear: float  # N/m, the slope about zero
    law: ContactLaw | None  # the force apart from the linear part and the cubic one, by the extension
    normal_force: float | None = None  # N, of friction where it is constant
    gap_unit: str = "m"  # of the extension; rad in a hinge, whose forces are moments
    gap: float = 0.0  # m, extension at which the law begins
    part: RingPart | None = None  # of a ring

    @property
    def listed_as(self) -> str:
        """Section of results: springs, friction or rings."""
        return "rings" if self.part is not None else "friction" if self.kind == FRICTION else "springs"

    @property
    def base_influence(self) -> Floats:
        """(K,) How much of each displacement of the base adds to its extension."""
        return self.on_ground * self.base_participation

    @property
    def relaxes(self) -> bool:
        """Whether the force depends on more than the extension."""
        return self.law is not None and (self.law.internal_states > 0 or self.law.slides_or_yields)

    def force(self, extension: Floats) -> Floats:
        """N, positive where it pulls back a positive extension (any shape); of one that relaxes after a long rest."""
        force = self.linear * extension + self.cubic * extension**3
        return np.asarray(force if self.law is None else force + self.law.static_force(extension))


def describe_springs(
    springs: Sequence[LocatedItem], shape: Floats, base_participations: Floats
) -> tuple[SpringInfo, ...]:
    """Springs, joints and friction contacts with laws.

    Parameters
    ----------
    springs : and where they are written.
    shape : (count, n) extension of each for a unit of each coordinate.
    base_participations : (count, K) displacement of its place for a unit of each displacement of the base.

    Returns
    -------
    (count,) springs.

    Raises
    ------
    ScenarioError
        If breakpoints do not increase, as cases of a study that varies them may.
    """
    infos: list[SpringInfo] = []
    numbers: tuple[float, float, ContactLaw | None]
    for row, by_base, located in zip(shape, base_participations, springs, strict=True):
        path, spring = located.path, located.item
        places = tuple(end.label for end in ends_of(site_of(spring, located.body, located.sections)))
        masses = tuple(place.mass for place in spring.places if place.mass is not None)
        maxwell = getattr(spring, "maxwell", ())
        branches = _branches(maxwell)
        if spring.kind == "cubic":
            numbers = (float(spring.stiffness), 0.0, None)
        elif spring.kind in ("linear", JOINT):
            numbers = (0.0, float(spring.stiffness), _as_installed(relaxing_law(None, branches), maxwell, (1.0, -1.0)))
        elif spring.kind == SHOCK_ARRESTOR:
            law = shock_arrestor(spring.stiffness, spring.bleed.force / spring.bleed.speed, spring.locking_speed)
            numbers = (0.0, 0.0, law)
        elif spring.kind == FRICTION:
            numbers = (0.0, 0.0, _law_of_friction(spring))
        elif isinstance(spring, RingPart):
            numbers = (0.0, 0.0, _law_of_ring(spring))
        else:
            if any(b <= a for a, b in pairwise(spring.breakpoints)):  # moved by what varies them
                at, why = f"{path_text(path)}.breakpoints", f"= {list(spring.breakpoints)} do not increase"
                raise ScenarioError.at(at, why, "keep their order in every case")
            law = piecewise_linear(spring.breakpoints, spring.stiffnesses, spring.number_at_rest)
            law = _as_installed(relaxing_law(law, branches), maxwell, (1.0, -1.0)) if branches else law
            numbers = (0.0, float(spring.linear_stiffness), law)
        part = spring if isinstance(spring, RingPart) else None
        alone = len(places) == 1 or part is not None
        on_ground = alone and spring.kind != JOINT and getattr(spring, "mounted_on", "ground") == "ground"
        on_ground = on_ground and not isinstance(spring, HingeElement)
        cubic, linear, own = numbers
        infos.append(
            SpringInfo(
                spring.name, spring.kind, places, masses, row, on_ground, by_base, cubic, linear, own,
                _normal_force(spring), gap_unit="rad" if isinstance(spring, HingeElement) else "m",
                gap=part.distance if part else 0.0, part=part,
            )
        )  # fmt: skip
    return tuple(infos)


def _normal_force(spring: Any) -> float | None:
    """That of friction where it is constant, N; 0 of a hinge, where none is known."""
    if spring.kind != FRICTION or spring.pressed_by is not None:
        return None
    return 0.0 if isinstance(spring, HingeElement) else float(spring.constant_force)


def _law_of_friction(contact: Any) -> ContactLaw:
    if contact.pressed_by is not None:
        return pressed_friction_law(contact.stiffness, contact.coefficients.static, contact.coefficients.sliding)
    forces = contact.static_force, contact.sliding_force, contact.start_force
    if (speed := contact.coefficients.stribeck_speed) is not None:
        return falling_friction_law(forces[0], forces[1], speed, forces[2])
    return rigid_friction_law(*forces) if contact.stiffness is None else friction_law(contact.stiffness, *forces)


def _law_of_ring(part: RingPart) -> ContactLaw:
    from beamsim.contacts.rings import acting_sides, side_law

    ring = part.ring
    if part.kind != RING and ring.friction is not None:
        friction, depth = ring.friction, ring.largest_penetration
        active = acting_sides(ring.sides, depth / part.curvature_radius)
        return pressed_friction_law(
            friction.stiffness / active, friction.coefficients.static, friction.coefficients.sliding
        )
    return side_law(ring.sides, part.curvature_radius, ring.largest_penetration, ring.stiffness, ring.dashpot)


def pressed_by(springs: Sequence[LocatedItem], snubbers: Sequence[str]) -> Ints | None:
    """(m,) of all contacts, snubbers first, the one that presses each, -1 where there is none; None without any."""
    items = [spring for _, _, spring, _ in springs if spring.kind != "cubic"]
    names = [getattr(spring, "pressed_by", None) for spring in items]
    sides = [getattr(spring, "sides_before", 0) for spring in items]
    if not any(names) and not any(sides):
        return None
    pressing = [-1] * len(snubbers) + [-1 if name is None else list(snubbers).index(name) for name in names]
    for j, before in enumerate(sides, start=len(snubbers)):
        pressing[j] = j - before if before else pressing[j]
    return np.array(pressing, dtype=np.int64)


def cubic_springs(springs: Sequence[SpringInfo]) -> CubicSprings | None:
    """The cubic springs among them; None where there are none."""
    cubic = [s for s in springs if s.kind == "cubic"]
    if not cubic:
        return None
    return CubicSprings(
        np.array([s.shape for s in cubic]),
        np.array([s.cubic for s in cubic]),
        np.array([s.base_influence for s in cubic], dtype=float),
    )


def spring_contacts(springs: Sequence[SpringInfo], size: int) -> Contacts:
    """Springs with laws of phases as contacts whose penetration is the extension beyond their gap."""
    piecewise = [s for s in springs if s.law is not None]
    count = len(piecewise)
    return Contacts(
        shape=np.array([s.shape for s in piecewise]).reshape(count, size),
        sign=-np.ones(count),
        gap=np.array([s.gap for s in piecewise]),
        on_ground=np.array([s.on_ground for s in piecewise], dtype=bool),
        laws=tuple(s.law for s in piecewise if s.law is not None),
        base_participation=np.array([s.base_participation for s in springs])[[s.law is not None for s in springs]],
    )


LAWS = {  # by their names in a scenario
    "kelvin_voigt": kelvin_voigt, "no_tension": no_tension, "limited_damping": limited_damping,
    "damping_on_approach": damping_on_approach,
}  # fmt: skip


def dashpot_from_ratio(ratio: float, stiffness: float, omega: Floats, shape: Floats, rigid_count: int) -> float:
    """The dashpot of a damping ratio, ``c = 2 xi k / Omega``.

    Omega is the first natural frequency with only this snubber closed; rigid-body modes are skipped.

    Parameters
    ----------
    ratio : xi.
    stiffness : k, N/m.
    omega : (n,) rad/s, open structure, the first ``rigid_count`` of them zero.
    shape : (n,) deflection at the snubber for a unit of each coordinate.
    rigid_count : number of rigid-body coordinates.

    Returns
    -------
    N s/m; nan where there is no mode but rigid-body modes.
    """
    closed, _ = closed_modes(omega, shape[None, :], np.array([stiffness]), rigid_count)
    moving = closed[closed > 0]
    return float(2 * ratio * stiffness / moving[0]) if moving.size else math.nan


def build_contacts(
    snubbers: Sequence[LocatedItem], curves: Sequence[ForceCurve | None], shape: Floats, base_participations: Floats,
    omega: Floats, rigid_count: int,
) -> Contacts:  # fmt: skip
    """Contacts with dashpots resolved; gaps are those given, 0 where a preload is given instead.

    Parameters
    ----------
    snubbers : the scenario's snubbers and where they are written.
    curves : of those that have a force-deflection table.
    shape : (m, n) deflection at each for a unit of each coordinate.
    base_participations : (m, K) displacement of each place for a unit of each displacement of the base.
    omega : (n,) rad/s, open structure.
    rigid_count : number of rigid-body coordinates.

    Returns
    -------
    Contacts
        One for each snubber.

    Raises
    ------
    ScenarioError
        Where a damping ratio has no meaning.
    """
    items = [item for _, _, item, _ in snubbers]
    stiffness = [s.stiffness if curve is None else curve.stiffness for s, curve in zip(items, curves, strict=True)]
    dashpot = []
    for at, k, row in zip(snubbers, stiffness, shape, strict=True):
        damping, c = at.item.damping, 0.0
        if damping is not None and damping.kind == "viscous":
            c = float(damping.coefficient)
        elif damping is not None:
            c = dashpot_from_ratio(damping.ratio, float(k), omega, row, rigid_count)
        if math.isnan(c):
            why = "has no meaning here: every natural frequency is zero with this snubber closed"
            raise ScenarioError(Problem(f"{path_text(at.path)}.damping.ratio", why, "give the dashpot in N s/m"))
        dashpot.append(c)
    return Contacts(
        shape=shape,
        sign=np.array([1.0 if resists(s) in ("below", "approach") else -1.0 for s in items]),
        gap=np.array([0.0 if s.gap is None else s.gap for s in items], dtype=float),
        on_ground=np.array([getattr(s, "mounted_on", "") == "ground" for s in items], dtype=bool),
        laws=tuple(
            _law(at, float(k), curve, c) for at, k, curve, c in zip(snubbers, stiffness, curves, dashpot, strict=True)
        ),
        base_participation=base_participations,
    )


def _law(entry: LocatedItem, stiffness: float, curve: ForceCurve | None, dashpot: float) -> ContactLaw:
    """That of a snubber: a spring and a dashpot, unless it says more."""
    snubber = entry.item
    if snubber.latch:
        return latch(stiffness, dashpot)
    plastic = snubber.hardening is not None or snubber.unloading is not None
    relaxes = any(branch.stiffness > 0.0 for branch in snubber.maxwell)
    if plastic or relaxes or (curve is not None and curve.slopes.size > 1):
        return _law_with_memory(entry, stiffness, curve, dashpot)
    return LAWS[snubber.law](stiffness, dashpot)


def _law_with_memory(entry: LocatedItem, stiffness: float, curve: ForceCurve | None, dashpot: float) -> ContactLaw:
    """That of a snubber which yields or relaxes, or whose force bends."""
    snubber = entry.item
    if snubber.hardening is not None:
        return hardening_law(stiffness, snubber.hardening.yield_force, snubber.hardening.stiffness, dashpot)
    if snubber.unloading is not None:
        points = snubber.unloading.force_deflection
        recovery = None if points is None else ForceCurve(*np.array(points, dtype=float).T)
        loading = ForceCurve.line(stiffness) if curve is None else curve
        try:
            return unloading_law(loading, snubber.unloading.stiffness, recovery, dashpot)
        except ValueError as error:
            at, remedy = f"{path_text(entry.path)}.unloading", "compare both curves, and the units"
            raise ScenarioError(Problem(at, str(error), remedy)) from None
    maxwell = [branch for branch in snubber.maxwell if branch.stiffness > 0.0]
    curve = ForceCurve.line(stiffness) if curve is None else curve
    if snubber.law == "no_tension" and (dashpot > 0.0 or maxwell):
        return _as_installed(recovering_law(curve, dashpot, _branches(maxwell)), maxwell, (1.0,))
    return table_law(curve, dashpot)


def _branches(maxwell: Sequence[Any]) -> tuple[MaxwellBranch, ...]:
    return tuple(MaxwellBranch(b.stiffness, b.relaxation_time) for b in maxwell)


def _as_installed(law: ContactLaw, maxwell: Sequence[Any], sides: tuple[float, ...]) -> ContactLaw:
    """A law with the beginning of motions where branches were just mounted, which then are springs.

    Parameters
    ----------
    law : whose last internal states are those of the branches.
    maxwell : the branches as they are written.
    sides : to which they push, +1 and -1.

    Returns
    -------
    ContactLaw
        The law itself where all of them are relaxed.
    """
    stiffness = [branch.stiffness for branch in maxwell if branch.start == "just_mounted"]
    if not stiffness:
        return law
    relaxed = np.ones(law.internal_states)
    relaxed[law.internal_states - len(maxwell) :] = [branch.start == "relaxed" for branch in maxwell]
    static = (*law.static_springs, *(OneSidedSpring(side, sum(stiffness), 0.0, 0.0) for side in sides))

    def relax(penetration: float) -> tuple[float, ...]:
        return tuple((relaxed * law.relaxed_states(penetration)).tolist())

    return replace(law, as_installed=replace(law, static=static, relaxed_states=relax))


def resists(snubber: Any) -> str:
    """The motion it resists: "below" or "above", between two masses "approach" or "separation"."""
    return str(getattr(snubber, "side", "") or snubber.resists)


def springs_of(contacts: Contacts) -> Springs:
    """The static part of the contacts: one-sided springs, one for each part of a law."""
    parts = [(j, part) for j, law in enumerate(contacts.laws) for part in law.static_springs]
    contact = np.array([j for j, _ in parts], dtype=np.int64)
    direction = np.array([part.direction for _, part in parts])
    offset = np.array([part.offset for _, part in parts])
    stiffness = np.array([part.stiffness for _, part in parts])
    gap = direction * contacts.gap[contact] + offset
    return Springs(contacts.shape[contact], direction * contacts.sign[contact], stiffness, gap, contact)


def _balance_remedy(normal: Floats, force: Floats, load: Floats) -> str:
    """What to do about preloads that do not balance the loads on rigid-body motions: the nearest ones that do.

    ``normal`` is (p, r), ``force`` (p,), ``load`` (r,).
    """
    scale = np.linalg.norm(normal, axis=0) + np.abs(load)
    scale = np.where(scale > 0, scale, 1.0)
    away = normal / scale
    nearest = force - np.linalg.lstsq(away.T, away.T @ force + load / scale, rcond=1e-10)[0]
    imbalance = np.abs(away.T @ nearest + load / scale).max(initial=0.0)
    if imbalance > 1e-9 * np.abs(nearest).max(initial=0.0) or np.any(nearest <= 0):
        return "add a snubber against which the loads push: no preloads of these snubbers balance them"
    return "balance the loads: the nearest preloads that do are " + ", ".join(f"{x:.6g} N" for x in nearest)


def _unreached_problem(entry: LocatedItem, equilibrium: Equilibrium, remedy: str) -> Problem:
    return Problem(
        f"{path_text(entry.path)}.preload",
        f"= {entry.item.preload:g} N cannot be reached: with it, {equilibrium.reason}",
        f"give a gap instead, hold the structure, or {remedy}",
    )


def resolve_preloads(
    contacts: Contacts,
    snubbers: Sequence[LocatedItem],
    stiffness: Floats,
    rigid_count: int,
    loads: Floats,
    cubic: CubicSprings | None,
) -> Contacts:
    """Contacts whose gaps give the specified preloads as contact forces at static equilibrium.

    At that equilibrium a preloaded snubber is a constant force s phi P, so the other contacts determine the shape; its
    gap then follows from the penetration at which its law pushes with P, P / k of a spring. A structure that floats
    between preloaded snubbers stays where it is drawn: any rigid-body motion would only shift their gaps.

    Parameters
    ----------
    contacts : the first of them snubbers.
    snubbers : the snubbers, at least one with a preload, N.
    stiffness : (n,) diagonal of K, rad^2/s^2, the first ``rigid_count`` of them zero.
    rigid_count : number of rigid-body coordinates.
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
    preload = [item.preload for _, _, item, _ in snubbers] + [None] * (contacts.count - len(snubbers))
    given = np.array([p is not None for p in preload], dtype=bool)
    force = np.array([0.0 if p is None else p for p in preload])
    forces = (contacts.sign * force)[:, None] * contacts.shape
    springs = springs_of(contacts)
    rest = springs.take(~given[springs.contact])
    equilibrium = find_equilibrium(stiffness, rigid_count, rest, np.vstack([loads, forces[given]]), cubic)
    q = equilibrium.nonunique_q if equilibrium.q is None else equilibrium.q
    if q is None:
        normal = (contacts.sign[:, None] * contacts.shape)[given, :rigid_count]
        remedy = _balance_remedy(normal, force[given], loads[:, :rigid_count].sum(axis=0))
        raise ScenarioError(
            [_unreached_problem(snubbers[i], equilibrium, remedy) for i in np.flatnonzero(given).tolist()]
        )
    w = contacts.shape @ q
    pressed = np.array(
        [law.static_penetration(p) if p > 0.0 else 0.0 for law, p in zip(contacts.laws, force, strict=True)]
    )
    return replace(contacts, gap=np.where(given, -contacts.sign * w - pressed, contacts.gap))
