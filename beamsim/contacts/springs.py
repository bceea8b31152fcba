r"""Springs other than those of a chain's row, as used by the linear model, statics and the exact flow.

With the slope :math:`k_0` about zero stretch x, breakpoints :math:`b_i` and the changes of slope :math:`\Delta_i` at
them going away from zero, a piecewise-linear force is

.. math:: F(x) = k_0 x + \sum_{b_i > 0} \Delta_i [x - b_i]_+ - \sum_{b_i < 0} \Delta_i [b_i - x]_+ ,

a linear spring, which belongs to the structure, and a contact law with one phase per segment (written as one-sided
springs with clearances, their stiffness is negative where the spring softens). The motion therefore has a closed form
between breakpoints, which are located like contact events. The slope of every segment is not negative, so the strain
energy is convex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings
from beamsim.contacts.friction import friction_law, pressed_friction_law, rigid_friction_law
from beamsim.contacts.laws import ContactLaw, piecewise_linear
from beamsim.contacts.pads import MaxwellBranch, relaxing_law
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Located
from beamsim.scenario.base import path_text
from beamsim.structures.places import ends_of, site_of
from beamsim.typing import Floats, Ints

JOINT, FRICTION = "spring", "friction"  # kinds of the joints that relax, and of friction contacts


@dataclass(frozen=True)
class SpringInfo:
    """One spring with a law of its own: where it acts, and F = linear x + that of the law, or cubic x^3."""

    name: str
    kind: str  # "linear" (which relaxes), "cubic", "piecewise_linear", "spring" of a joint, or "friction"
    places: tuple[str, ...]  # what it connects to the ground, or the two places that it joins, for people
    masses: tuple[int, ...]  # their numbers where they are masses
    shape: Floats  # (n,) stretch for a unit of each coordinate, 1/sqrt(kg)
    on_ground: bool  # whether it depends on the absolute displacement
    lever: float  # displacement of its place for a unit displacement of the base
    cubic: float  # N/m^3
    linear: float  # N/m, the slope about zero
    law: ContactLaw | None  # the force apart from the linear part and the cubic one, by the stretch
    normal_force: float | None = None  # N, of friction where it is constant

    @property
    def felt(self) -> float:
        """How much of the base's displacement adds to its stretch."""
        return self.lever if self.on_ground else 0.0

    @property
    def relaxes(self) -> bool:
        """Whether the force depends on more than the stretch."""
        return self.law is not None and (self.law.internal_states > 0 or self.law.rubs)

    def force(self, stretch: Floats) -> Floats:
        """N, positive where it pulls back a positive stretch (any shape); of one that relaxes after a long rest."""
        force = self.linear * stretch + self.cubic * stretch**3
        return np.asarray(force if self.law is None else force + self.law.static_force(stretch))


def describe_springs(springs: Sequence[Located], shape: Floats, levers: Floats) -> tuple[SpringInfo, ...]:
    """Springs, joints and friction contacts with laws.

    Parameters
    ----------
    springs : and where they are written.
    shape : (count, n) stretch of each for a unit of each coordinate.
    levers : (count,) displacement of its place for a unit displacement of the base.

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
    for row, lever, located in zip(shape, levers, springs, strict=True):
        path, spring = located.path, located.item
        places = tuple(end.label for end in ends_of(site_of(spring, located.body, located.sections)))
        masses = tuple(place.mass for place in spring.places if place.mass is not None)
        branches = [MaxwellBranch(b.stiffness, b.relaxation_time) for b in getattr(spring, "maxwell", ())]
        if spring.kind == "cubic":
            numbers = (float(spring.stiffness), 0.0, None)
        elif spring.kind in ("linear", JOINT):
            numbers = (0.0, float(spring.stiffness), relaxing_law(None, branches))
        elif spring.kind == FRICTION:
            numbers = (0.0, 0.0, _law_of_friction(spring))
        else:
            if any(b <= a for a, b in pairwise(spring.breakpoints)):
                raise ScenarioError(
                    Problem(
                        f"{path_text(path)}.breakpoints",
                        f"= {list(spring.breakpoints)} do not increase",
                        "keep their order in every case",
                    )
                )
            law = piecewise_linear(spring.breakpoints, spring.stiffnesses, spring.number_at_rest)
            numbers = (0.0, float(spring.slope_at_rest), relaxing_law(law, branches) if branches else law)
        on_ground = len(places) == 1 and spring.kind != JOINT and getattr(spring, "mounted_on", "ground") == "ground"
        cubic, linear, own = numbers
        infos.append(
            SpringInfo(
                spring.name, spring.kind, places, masses, row, on_ground, float(lever), cubic, linear, own,
                spring.constant_force if spring.kind == FRICTION and spring.pressed_by is None else None,
            )
        )  # fmt: skip
    return tuple(infos)


def _law_of_friction(contact: Any) -> ContactLaw:
    if contact.pressed_by is not None:
        return pressed_friction_law(contact.stiffness, contact.static_coefficient, contact.sliding_coefficient)
    forces = contact.static_force, contact.sliding_force, contact.start_force
    return rigid_friction_law(*forces) if contact.stiffness is None else friction_law(contact.stiffness, *forces)


def pressed_by(springs: Sequence[Located], snubbers: Sequence[str]) -> Ints | None:
    """(m,) of all contacts, snubbers first, the one that presses each, -1 where there is none; None without any."""
    names = [getattr(spring, "pressed_by", None) for _, _, spring, _ in springs if spring.kind != "cubic"]
    if not any(names):
        return None
    pressing = [-1] * len(snubbers) + [-1 if name is None else list(snubbers).index(name) for name in names]
    return np.array(pressing, dtype=np.int64)


def cubic_springs(springs: Sequence[SpringInfo], size: int) -> CubicSprings:
    """The cubic springs among them."""
    cubic = [s for s in springs if s.kind == "cubic"]
    return CubicSprings(
        np.array([s.shape for s in cubic]).reshape(-1, size),
        np.array([s.cubic for s in cubic]),
        np.array([s.felt for s in cubic], dtype=float),
    )


def spring_contacts(springs: Sequence[SpringInfo], size: int) -> Contacts:
    """Springs with laws of phases as contacts whose penetration is the stretch."""
    piecewise = [s for s in springs if s.law is not None]
    count = len(piecewise)
    return Contacts(
        shape=np.array([s.shape for s in piecewise]).reshape(count, size),
        sign=-np.ones(count),
        gap=np.zeros(count),
        on_ground=np.array([s.on_ground for s in piecewise], dtype=bool),
        laws=tuple(s.law for s in piecewise if s.law is not None),
        lever=np.array([s.lever for s in piecewise]),
    )
