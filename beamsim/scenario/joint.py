"""Joints between two points of bodies, or between a point and the base."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario.base import BY_FORM, Variants, counted, fail
from beamsim.scenario.body import Body
from beamsim.scenario.place import AtPlace, BaseOrPlace, Named, refuse_unlike_directions
from beamsim.scenario.spring import Maxwell

JointEnd = Annotated[
    BaseOrPlace,
    Variants(
        "names neither a point of a body nor the base",
        "write {body: panel, position: 0 mm}, {body: chain, mass: 2} or base",
    ),
]


class Joint(Named):
    """Common part of all joints."""

    name: q.Name = ""
    """Name, unique; joint_1, joint_2, ... by default."""
    between: Annotated[tuple[JointEnd, ...], Field(json_schema_extra={"minItems": 2, "maxItems": 2})]
    """Two points of bodies, or a point and base."""

    def check(self) -> None:
        """Demand two different ends, at least one of them on a body."""
        if len(self.between) != 2:
            remedy = "name the two that it joins: [{body: yoke, position: 300 mm}, {body: panel, position: 0 mm}]"
            raise fail(f"names {counted(len(self.between), 'end')}", remedy, ("between",))
        if self.between[0] == self.between[1]:
            raise fail("joins a point to itself", "name two different points", ("between",))
        refuse_unlike_directions(self.places)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The points of bodies, one or two."""
        return tuple(end for end in self.between if isinstance(end, AtPlace))

    @property
    def turns_against(self) -> bool:
        """Whether a rotation of one end acts on the other."""
        return False


class RigidJoint(Joint):
    """Deflection and slope are the same on both sides."""

    kind: Literal["rigid"] = "rigid"
    """Holds deflection and slope."""

    @property
    def turns_against(self) -> bool:
        """Always."""
        return True


class _Turning(Joint):
    rotational_stiffness: q.RotationalStiffness = 0.0
    """Moment per difference of the slopes; none by default."""
    rotational_dashpot: q.RotationalDashpot = 0.0
    """Moment per difference of their rates; none by default."""

    @property
    def turns_against(self) -> bool:
        """Where it has a rotational spring or dashpot."""
        return self.rotational_stiffness > 0.0 or self.rotational_dashpot > 0.0


class HingeJoint(_Turning):
    """The deflection is the same on both sides; the slopes differ."""

    kind: Literal["hinge"] = "hinge"
    """Holds the deflection."""


class SpringJoint(_Turning):
    """Springs and dashpots between deflections and between slopes."""

    kind: Literal["spring"] = "spring"
    """Holds nothing; springs act."""
    stiffness: q.NonNegativeStiffness = 0.0
    """Force per difference of the deflections; none by default."""
    dashpot: q.Dashpot = 0.0
    """Force per difference of the velocities; none by default."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches between the deflections, any number of them."""

    def check(self) -> None:
        """Demand something that acts."""
        super().check()
        if not (self.stiffness or self.dashpot or self.turns_against or self.maxwell):
            raise fail("has neither a stiffness nor a dashpot", "give stiffness: 10 kN/m, or leave the joint out")


AnyJoint = Annotated[RigidJoint | HingeJoint | SpringJoint, BY_FORM]


@dataclass(frozen=True)
class Apart:
    """A joint whose points do not lie together, as the joints before it place the bodies."""

    index: int  # of the joint
    distance: float  # m along the bodies' common axis
    through: str  # body of the second point


def points_apart(joints: Sequence[Joint], bodies: Mapping[str, Body], default_body: str) -> Iterator[Apart]:
    """Joints that close a loop between bodies whose positions do not fit; all bodies lie along one axis.

    Bodies have no place of their own: the first joint between two of them puts its points together.
    """
    origin: dict[str, float] = {}
    group: dict[str, int] = {}
    for index, joint in enumerate(joints):
        ends = _ends(joint, bodies, default_body)
        if len(ends) != 2 or ends[0][0] == ends[1][0]:
            continue
        (first, x), (second, y) = ends
        for number, name in enumerate((first, second)):
            origin.setdefault(name, 0.0)
            group.setdefault(name, 2 * index + number)
        gap = origin[first] + x - origin[second] - y
        if group[first] == group[second]:
            if abs(gap) > 1e-6 * max(x, y):
                yield Apart(index, abs(gap), second)
            continue
        merged = group[second]
        for name in [name for name, label in group.items() if label == merged]:
            origin[name] += gap
            group[name] = group[first]


def _ends(joint: Joint, bodies: Mapping[str, Body], default_body: str) -> list[tuple[str, float]]:
    """The bodies that a joint joins and its positions along them, m; of other places none."""
    named = [(place.body or default_body, place.position) for place in joint.places]
    return [
        (name, bodies[name].metres(position))
        for name, position in named
        if name in bodies and position is not None and not isinstance(position, tuple)
    ]


def origins(
    joints: Sequence[Joint], bodies: Mapping[str, Body], default_body: str
) -> tuple[dict[str, float], dict[str, str]]:
    """Where bodies begin, m, on the common axis of those that joints connect, and the first body of each such group."""
    origin: dict[str, float] = {}
    group: dict[str, str] = {}
    for joint in joints:
        ends = _ends(joint, bodies, default_body)
        if len(ends) != 2:
            continue
        (first, x), (second, y) = ends
        for name in (first, second):
            origin.setdefault(name, 0.0)
            group.setdefault(name, name)
        gap, merged = origin[first] + x - origin[second] - y, group[second]
        if group[first] == merged:
            continue
        for name in [name for name, label in group.items() if label == merged]:
            origin[name] += gap
            group[name] = group[first]
    return origin, group


def body_origins(joints: Sequence[Joint], bodies: Mapping[str, Body], default_body: str) -> dict[str, float]:
    """Where the bodies that joints link to the first one of them begin, m; that one begins at 0."""
    origin, group = origins(joints, bodies, default_body)
    leading = next(iter(origin), "")
    return {name: x - origin[leading] for name, x in origin.items() if group[name] == group[leading]}
