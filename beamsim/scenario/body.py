"""Bodies: places on them, their damping, and the checks and defaults of every kind of body."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Self, overload

from pydantic import BeforeValidator, Field, ValidationInfo

from beamsim.errors import Problem
from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import (
    BY_FORM,
    TWO_ITEMS,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    Variants,
    Whole,
    distinct,
    path_text,
    problem,
    unknown,
    walk,
)

_REMEDY = (
    "give position: 270 mm on a beam, position: [270 mm, 100 mm] on a plate, mass: 2 on a chain, "
    "node: 24 or row: gap of imported matrices, or node: knee of a frame"
)


_PLACES = ("position", "mass", "node", "row")  # keys, of which a place has one
NodeOfBody = Annotated[q.Count | q.Name, BY_FORM]
"""Number of a node of imported matrices, or name of a node of a frame."""

Point = float | tuple[float, float]
"""Metres along a beam, [x, y] on a plate, or the number of a mass or node."""
WrittenPosition = float | q.Share | tuple[float | q.Share, float | q.Share]
"""A position as the user wrote it, possibly a share of a length; `beamsim.scenario.body.Body.point` converts it to
metres."""

PlatePoint = tuple[q.PositionOrShare, q.PositionOrShare]
"""x and y on a plate."""


def same_position(a: float, b: float) -> bool:
    """True if two positions differ only by round-off (55 % of 200 mm is not exactly 110 mm)."""
    return math.isclose(a, b, rel_tol=1e-12)


PointPosition = Annotated[q.PositionOrShare | PlatePoint, BY_FORM]
NodeDirection = Literal["x", "y", "z", "rx", "ry", "rz"]
OwnDirection = Literal["local_x", "local_y", "local_z", "local_rx", "local_ry", "local_rz"]


class PointOfBody(Schema):
    """A point of a body, given by its position, or by the number of a mass or node."""

    position: PointPosition | None = None
    """Distance from the left end of a beam, or from the first end of a member, or share of its length: 60 %; [x, y] on
    a plate."""
    mass: q.Count | None = None
    """Number of the mass of the chain, from 1."""
    node: NodeOfBody | None = None
    """Number of a node of imported matrices, or name of a node of a frame."""
    member: q.Name | None = None
    """Name of a member of a frame, on which the position is."""
    row: q.Name | None = None
    """Name of one of the ``rows`` of imported matrices."""
    direction: NodeDirection | OwnDirection | None = None
    """Direction at the node or on the member, z by default. x, y, z are displacements, rx, ry, rz rotations; local_x
    ... local_rz are the directions of the node's own coordinate system, or of the member."""

    def check(self) -> None:
        """Require exactly one point."""
        super().check()
        if getattr(self, "at", None) is not None:  # the long form, with the key at
            for key in (*_PLACES, "member", "direction"):
                self.exclude(key, "at", remedy="keep at: it names the place")
            return
        if self.member is not None and self.position is None:
            raise InvalidValueError("needs a position", "give position: 1.2 m or position: 50 %", ("member",))
        if all(getattr(self, key) is None for key in _PLACES):
            raise InvalidValueError("names no place", _REMEDY)
        remedy = "position belongs to a beam, mass to a chain, node and row to imported matrices"
        for number in (1, 2, 3):
            self.exclude(_PLACES[number], *_PLACES[:number], remedy=remedy)
        if self.direction is not None and self.node is None and self.member is None:
            raise InvalidValueError("belongs to a node", "leave it out, or give node: 24", ("direction",))


class AtPlace(PointOfBody):
    """A point of a body, with the body's name."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("position", "mass", "node", "member", "row", "direction", "body")
    level_quantities: ClassVar[tuple[Literal["force"]]] = ("force",)

    body: q.Name | None = None
    """Name of the body; may be omitted if there is only one."""

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The place itself, as a tuple; other items have one or two places."""
        return (self,)

    def problems(self, scenario: Whole, path: Path, number: Path = ()) -> Problems:
        """Problems: an unknown body, a body of another kind, a point that is not on the body or cannot move.

        Parameters
        ----------
        scenario : the scenario with the bodies.
        path : path of the place, or of the item at the place.
        number : path of the number of the mass; by default the key mass below ``path``.

        Yields
        ------
        Problem
        """
        holder = scenario.body_at(path)
        if holder and self.body is not None:
            yield problem((*path, "body"), f"= {self.body} is named in the list of {holder}", "leave it out")
            return
        if not holder and (self.body is not None or len(scenario.all_bodies) > 1):
            yield from body_problems(scenario, path, self.body, "name one: at: {body: BODY, position: 270 mm}")
        name = holder or self.body or scenario.default_body
        if name not in scenario.all_bodies:
            return
        body, where = scenario.all_bodies[name], scenario.body_path(name)
        if self.node is not None:
            yield from body.node_problems(where, (*path, "node"), self.node)
        elif self.row is not None:
            yield from body.row_problems(where, (*path, "row"), self.row)
        elif self.mass is not None:
            yield from body.mass_problems(where, number or (*path, "mass"), self.mass)
        elif self.member is not None:
            yield from body.member_problems(where, path, self)
        elif self.position is not None:
            sits = "" if "outputs" in path[:2] else _MOVING_ITEMS.get(str(path[0]), "a force")
            yield from body.position_problems(where, (*path, "position"), self.position, sits)


_MOVING_ITEMS = {
    "snubbers": "a snubber",
    "springs_to_ground": "a spring",
    "springs_between": "a spring",
    "probes": "",
    "constant_forces": "",
    "joints": "",
    "friction": "a friction contact",
}
"""For each section what its items need a moving point for; empty if they may be at a support."""


def body_problems(scenario: Whole, path: Path, body: str | None, example: str) -> Problems:
    """Problems: an unknown or missing name of a body; ``example`` shows the remedy, with BODY as its name."""
    bodies = scenario.all_bodies
    if body is not None:
        yield from unknown((*path, "body"), body, "body", bodies)
    elif len(bodies) > 1:
        remedy = example.replace("BODY", next(iter(bodies)))
        yield problem(path, f"names no body, and there are several: {', '.join(bodies)}", remedy)


BaseOrPlace = Literal["base"] | AtPlace
"""The base or a point of a body."""


class PlacedItem(PointOfBody):
    """An item at a place: the key ``at``, or its short form ``position`` or ``mass`` if there is only one body."""

    at: AtPlace | None = None
    """The place: {body: panel, position: 270 mm} or {mass: 2}; the body may be omitted if there is only one."""

    @property
    def place(self) -> AtPlace:
        """The place."""
        if self.at is not None:
            return self.at
        return AtPlace.model_construct(**{key: getattr(self, key) for key in PointOfBody.model_fields})

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The place, as a tuple."""
        return (self.place,)

    @property
    def probed_places(self) -> tuple[AtPlace, ...]:
        """Places of the default probes."""
        return self.places

    @property
    def place_paths(self) -> tuple[Path, ...]:
        """Paths of the place below the item."""
        return (() if self.at is None else ("at",),)

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of a place in the short form; a place under the key ``at`` reports its own."""
        yield from super().problems(scenario, path)
        if self.at is None:
            yield from self.place.problems(scenario, path)

    def support_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning if the item is at a support of its body and therefore does not move."""
        place = self.place
        body = scenario.all_bodies.get(place.body or scenario.default_body)
        if body is not None and place.position is not None and not place.member and body.support_at(place.position):
            yield f"{path_text(path)} is at a support, which cannot deflect"


def refuse_unlike_directions(places: tuple[AtPlace, ...]) -> None:
    """Refuse a displacement at one of two places and a rotation at the other."""
    turns = [(place.direction or "z").removeprefix("local_").startswith("r") for place in places]
    if any(turns) and not all(turns):
        directions = " and ".join(place.direction or "z" for place in places)
        raise InvalidValueError(
            f"acts between {directions}, a displacement and a rotation",
            "name displacements (x, y, z) or rotations (rx, ry, rz) at both places", ("between",),
        )  # fmt: skip


TwoPlaces = Annotated[tuple[Annotated[AtPlace | q.Count, Variants("names no place", _REMEDY)], ...], TWO_ITEMS]
"""Two places; a number is that of a mass of the chain."""


def _placed(ends: Iterable[AtPlace | int]) -> tuple[AtPlace, ...]:
    return tuple(AtPlace(mass=end) if isinstance(end, int) else end for end in ends)


class BetweenPlaces(Schema):
    """An item between two places, of two bodies or of one."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("between",)

    between: TwoPlaces
    """The two places; for two masses of a chain their numbers are enough: [1, 2]."""

    @property
    def ends(self) -> tuple[str, TwoPlaces]:
        """The key that gives both places, and its value."""
        return "between", self.between

    def check(self) -> None:
        """Require two different places."""
        super().check()
        key, ends = self.ends
        if ends[0] == ends[1]:
            raise InvalidValueError("joins a place to itself", "name two different places", (key,))
        refuse_unlike_directions(self.places)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """Both places, in the order in which they are written; of two mass numbers the lower one first."""
        _, ends = self.ends
        numbers = [end for end in ends if isinstance(end, int)]
        return _placed(sorted(numbers) if len(numbers) == len(ends) else ends)

    @property
    def probed_places(self) -> tuple[AtPlace, ...]:
        """Both places, in the order in which they are written, for the default probes."""
        return _placed(self.ends[1])

    @property
    def place_paths(self) -> tuple[Path, ...]:
        """Paths of both places below the item."""
        return ("between", 0), ("between", 1)

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of mass numbers; places in the long form report their own."""
        yield from super().problems(scenario, path)
        key, ends = self.ends
        for index, end in enumerate(ends):
            if isinstance(end, int):
                yield from AtPlace(mass=end).problems(scenario, path, (*path, key, index))


class Named(Schema):
    """Something with a name."""

    name: q.Name = ""
    """Unique name; by default the kind of item and its number, for example snubber_1, ground_spring_1 or joint_1."""


DEFAULT_NAMES = {
    "snubbers": "snubber",
    "springs_to_ground": "ground_spring",
    "springs_between": "link_spring",
    "joints": "joint",
    "friction": "friction",
    "stops": "stop",
}
"""Lists whose items have default names: this word and their number."""


def _numbered(items: Any, info: ValidationInfo) -> Any:
    """Add default names to the items of a list in `DEFAULT_NAMES`."""
    if not isinstance(items, (list, tuple)):
        return items
    named = []
    for number, item in enumerate(items, start=1):
        name = f"{DEFAULT_NAMES[str(info.field_name)]}_{number}"
        if isinstance(item, Named):
            item = item if item.name else item.model_copy(update={"name": name})
        elif isinstance(item, dict) and item.get("name") is None:
            item = {**item, "name": name}
        named.append(item)
    return named


NUMBERED = BeforeValidator(_numbered)


class Probe(PlacedItem):
    """A point whose motion is recorded."""

    name: q.Name
    """Unique name; the result file uses it for the probe's data."""

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning if the probe is at a support, which does not move."""
        yield from self.support_warnings(scenario, path)


class PlacedForce(PlacedItem):
    """A constant force at a point."""

    force: q.Force
    """The force, positive upwards (towards positive displacement)."""

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning if the force is at a support, which does not move."""
        if path[0] == "constant_forces":
            yield from self.support_warnings(scenario, path)


Translation = Literal["acceleration", "velocity", "displacement"]
Rotation = Literal["angular_acceleration", "angular_velocity", "rotation"]

TRANSLATION_TAKES: tuple[Translation, ...] = ("acceleration", "velocity", "displacement")
"""Quantities that may give the motion along an axis; the first is the default."""
ROTATION_TAKES: tuple[Rotation, ...] = ("angular_acceleration", "angular_velocity", "rotation")
"""Quantities that may give a rotation; the first is the default."""


class MovedSupport(Schema):
    """A support or joint that the excitation moves relative to the base."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("support", "joint")

    support: q.Name | None = None
    """The support: left or right end of a beam or wall of a chain; left, right, bottom, top or point 1 of a plate;
    node 15 of imported matrices."""
    joint: q.Name | None = None
    """A joint, or a linear spring between points, instead of a support: its second point moves relative to its
    first."""
    body: q.Name | None = None
    """The body with this support; may be omitted if there is only one."""
    direction: Literal["x", "y", "z", "rx", "ry", "rz", "slope"] | None = None
    """z, the deflection, by default; slope is the rotation dw/dx; at a node of imported matrices any of x to rz."""

    def check(self) -> None:
        """Require a support or a joint."""
        if (self.support is None) == (self.joint is None):
            raise InvalidValueError("names neither a support nor a joint, or both", "give one of them: {support: left}")
        if self.joint is not None and self.body is not None:
            raise InvalidValueError("belongs to a support", "leave it out: a joint has its own name", ("body",))

    @property
    def label(self) -> str:
        """Text for messages and tables: support left."""
        holder = f"support {self.support}" if self.joint is None else f"joint {self.joint}"
        of = f" of {self.body}" if self.body else ""
        return holder + of + (f" {self.direction}" if self.direction not in (None, "z") else "")

    @property
    def rotates(self) -> bool:
        """Whether the motion is a rotation."""
        return self.direction is not None and self.direction not in ("x", "y", "z")

    @property
    def level_quantities(self) -> tuple[Translation, ...] | tuple[Rotation, ...]:
        """Quantities that its levels may have, the default first."""
        return ROTATION_TAKES if self.rotates else TRANSLATION_TAKES

    places: ClassVar[tuple[AtPlace, ...]] = ()
    """None: it does not act on a free point."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown joint or body. The supports of a body are known only to its model.

        A sine must have a constant frequency: in a sweep the motion of the support would drift.
        """
        if self.joint is not None:
            linear = (
                each.name
                for each in scenario.joined_by
                if each.kind not in ("cubic", "piecewise_linear", "shock_arrestor")
            )
            yield from unknown((*path, "joint"), self.joint, "joint", linear)
        else:
            yield from body_problems(scenario, path, self.body, f"name one: {{body: BODY, support: {self.support}}}")
        sine = "phase resonance" if "nnm.phase_resonance" in _sections_of_orbits(scenario) else ""
        sine = "a swept sine" if getattr(scenario.sweep, "kind", "") == "swept_sine" else sine
        if path[0] == "excitation" and sine:
            yield problem(
                path, f"is a support that moves, which {sine} does not follow",
                "use sweep.kind: stepped or continuation, move the base (applied_to: base), or model what moves the "
                "support as a body",
            )  # fmt: skip


def _sections_of_orbits(scenario: Whole) -> list[str]:
    """Sections of the scenario that compute periodic motions."""
    given = {"sweep": scenario.sweep, "identify_stiffness": scenario.identify_stiffness}
    given["nnm.phase_resonance"] = None if scenario.nnm is None else scenario.nnm.phase_resonance
    return [name for name, section in given.items() if section is not None]


def _fixed_stop_remedy(sections: list[str]) -> str:
    """The remedy for a stop that moves."""
    return f"leave {' and '.join(sections)} out, or mount it on the base"


class MovedStop(Schema):
    """A stop that the excitation moves relative to what it is mounted on."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("snubber",)

    snubber: q.Name
    """Name of the snubber; both stops of a pair move together."""

    @property
    def label(self) -> str:
        """Text for messages and tables: stop bumper."""
        return f"stop {self.snubber}"

    rotates: ClassVar[bool] = False
    level_quantities: ClassVar[tuple[Translation, ...]] = TRANSLATION_TAKES
    places: ClassVar[tuple[AtPlace, ...]] = ()

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown snubber, and commands other than run, which do not support a moving stop."""
        movable = [each.item.name for each in scenario.listed("snubbers") if hasattr(each.item, "mounted_on")]
        yield from unknown((*path, "snubber"), self.snubber, "snubber", movable)
        if path[0] == "excitation" and (following := _sections_of_orbits(scenario)):
            yield problem(
                path, f"is a stop that moves, which {following[0]} does not follow", _fixed_stop_remedy(following)
            )


class SupportMounting(Schema):
    """Mounting of a stop on a support that the excitation moves."""

    support: q.Name
    """The support: left or right end of a beam or wall of a chain; left, right, bottom, top or point 1 of a plate;
    node 15 of imported matrices."""
    body: q.Name | None = None
    """The body with this support; may be omitted if there is only one."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown body, and commands other than run, which do not support a stop on a moving support."""
        yield from body_problems(scenario, path, self.body, f"name one: {{body: BODY, support: {self.support}}}")
        moves = any(isinstance(each.applied_to, MovedSupport) for _, each in scenario.excitation.items)
        if moves and (following := _sections_of_orbits(scenario)):
            message = f"= {self.support} carries the stop along, which {following[0]} does not follow"
            yield problem((*path, "support"), message, _fixed_stop_remedy(following))


Ratios = Annotated[
    q.Ratio | Annotated[tuple[q.Ratio, ...], Field(min_length=1)],
    BY_FORM,
]


class RatioDamping(Schema):
    """Common part of damping that is given by ratios."""

    if TYPE_CHECKING:
        ratio: Any  # one ratio, or a list

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning for a damping ratio of 1 (critical) or more."""
        ratio = max(self.ratio) if isinstance(self.ratio, tuple) else self.ratio
        if ratio >= 1.0:
            known = scenario.unit_written((*path, "ratio"), ratio, units.RATIO)  # of one ratio
            meant = "" if known == "%" else f"; was {ratio:g} % meant?"
            yield f"{path_text((*path, 'ratio'))} = {ratio:g} is critical damping or more{meant}"


class ModalDamping(RatioDamping):
    """Damping ratios of the modes of the structure without contact."""

    kind: Literal["modal"] = "modal"
    """Modal damping ratios."""
    ratio: Ratios = 0.0
    """Damping ratio of all modes, or a list from the first mode on (the last value applies to all higher modes)."""


class RatioAtFrequency(Schema):
    """A natural frequency and its damping ratio."""

    frequency: q.Frequency
    """Natural frequency."""
    ratio: q.Ratio
    """Damping ratio at this frequency."""


class RayleighDamping(Schema):
    """Damping proportional to mass and stiffness: C = mass M + stiffness K."""

    kind: Literal["rayleigh"] = "rayleigh"
    """Proportional (Rayleigh) damping."""
    mass: q.PerTime = 0.0
    """Factor of the mass matrix."""
    stiffness: q.Time = 0.0
    """Factor of the stiffness matrix."""
    ratios: Annotated[tuple[RatioAtFrequency, ...], TWO_ITEMS] = ()
    """Damping ratios at two frequencies, instead of the factors: [{frequency: 20 Hz, ratio: 1 %}, {...}]."""

    def check(self) -> None:
        """Refuse factors together with ratios, and ratios that would need a negative factor."""
        self.exclude("ratios", "mass", "stiffness", remedy="keep ratios, or mass and stiffness, not both")
        if not self.ratios:
            return
        low, high = sorted(self.ratios, key=lambda at: at.frequency)
        if low.frequency == high.frequency:
            raise InvalidValueError("has the same frequency twice", "give two different frequencies", ("ratios",))
        slope = high.frequency / low.frequency
        if not low.ratio / slope <= high.ratio <= low.ratio * slope:
            raise InvalidValueError(
                f"= {high.ratio:g} at {high.frequency:g} Hz with {low.ratio:g} at {low.frequency:g} Hz needs a "
                "negative factor, and so motions that grow",
                f"give it {low.ratio / slope:.4g} to {low.ratio * slope:.4g} there, or use kind: modal",
                ("ratios",),
            )

    @property
    def factors(self) -> tuple[float, float]:
        """Factors of mass, 1/s, and stiffness, s; the ratio at omega is (mass / omega + stiffness omega) / 2."""
        if not self.ratios:
            return self.mass, self.stiffness
        (a, x), (b, y) = ((2.0 * math.pi * at.frequency, at.ratio) for at in self.ratios)
        determinant = b * b - a * a
        return max(2.0 * a * b * (b * x - a * y) / determinant, 0.0), max(2.0 * (b * y - a * x) / determinant, 0.0)


class ViscousDamping(Schema):
    """Uniform viscous damping along the beam: a force per unit length opposite to the velocity."""

    kind: Literal["viscous"] = "viscous"
    """Uniform viscous damping."""
    coefficient: q.ViscousPerLength
    """Force per unit length and velocity."""


BeamDamping = Annotated[ModalDamping | RayleighDamping | ViscousDamping, BY_FORM]
ChainDamping = Annotated[ModalDamping | RayleighDamping, BY_FORM]


class LocatedItem(NamedTuple):
    """A snubber or spring with its path in the scenario, its default body, and all bodies."""

    path: Path
    body: str
    item: Any
    sections: Mapping[str, Body]

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that it acts on."""
        return tuple(dict.fromkeys(place.body or self.body for place in self.item.places))

    @property
    def label(self) -> str:
        """Its path with its name, as messages show it: snubbers.tip, chain.snubbers.tip."""
        return path_text((*self.path[:-1], self.item.name))


def coarse_mesh(body_path: Path, elements: int, size: float, ratio: float, highest_hz: float) -> Iterator[str]:
    """A warning about a mesh with fewer than six elements per bending wavelength.

    Parameters
    ----------
    body_path : path of the number of elements.
    elements : number of elements.
    size : length of an element, m.
    ratio : bending stiffness over mass, m^4/s^2.
    highest_hz : frequency of the excitation; 0 for none.

    Yields
    ------
    str
    """
    per_wave = math.inf if highest_hz <= 0.0 else math.sqrt(2.0 * math.pi / highest_hz) * ratio**0.25 / size
    if per_wave < 6.0:
        gives = f"gives {per_wave:.1f} elements a bending wavelength at {highest_hz:g} Hz"
        yield f"{path_text(body_path)} = {elements} {gives}: use 6 or more"


class Body(Schema):
    """Common part of all kinds of bodies; each kind is a subclass.

    The methods here are the defaults for a body without snubbers, springs or ends of its own.
    """

    body_kind: ClassVar[str] = ""
    """Name of the module in `beamsim.structures` that assembles this kind of body."""

    if TYPE_CHECKING:
        damping: Any  # every kind of body has its own type

    place_remedy: ClassVar[str] = "give a position on the beam, position: 270 mm"
    """Remedy that shows how to write a place on it."""

    load_remedy: ClassVar[str] = "list forces at its nodes: excitation: {kind: forces, forces: [...]}"
    """What to use instead of a distributed load that belongs to another kind of body."""

    has_slope: ClassVar[bool] = False
    """Whether its points have a slope as well as a deflection."""

    base_directions: ClassVar[tuple[str, ...]] = ("z",)
    """Directions of base motion or gravity that move its points. The first is used if no direction is given; it is
    empty if the body itself names the direction."""

    has_default_probe: ClassVar[bool] = True
    """Whether `default_probe` names a place."""

    has_members: ClassVar[bool] = False
    """Whether it consists of members between nodes."""

    keys_of_shape: ClassVar[tuple[str, ...]] = ()
    """Keys of its items with points and directions, which cannot change one by one."""

    is_read_from_files: ClassVar[bool] = False
    """Whether its matrices are read from files."""

    reduced_by_default: ClassVar[bool] = True
    """Whether the default reduction omits some of its modes."""

    @property
    def called(self) -> str:
        """Its kind, as messages call it."""
        return "imported matrices" if self.is_read_from_files else f"a {self.body_kind}"

    @property
    def mode_count(self) -> int | None:
        """Number of modes; None if that depends on the mesh."""
        return None

    @property
    def gives_stress(self) -> bool:
        """Whether a bending stress can be recovered."""
        return False

    @property
    def gives_strain(self) -> bool:
        """Whether a strain of its surface can be recovered."""
        return self.gives_stress

    @property
    def recovered_rows(self) -> tuple[str, ...]:
        """Names of the other quantities that it can report."""
        return ()

    @property
    def rough_frequency_hz(self) -> float:
        """Order of magnitude of its lowest natural frequency, Hz."""
        return 0.0

    mesh_order: ClassVar[float] = 4.0
    reaction_order: ClassVar[float] = 4.0  # of forces and moments at supports
    """Order of convergence of its results with the element size."""

    def refine(self) -> Self:
        """The body with twice as many elements; unchanged if it has no mesh."""
        return self

    @property
    def mass_points(self) -> tuple[Point, ...]:
        """Positions of the point masses, m."""
        return ()

    @property
    def depth(self) -> float:
        """Largest thickness in the direction of the motion, m; 0 if unknown."""
        return max((depth for _, _, depth in self.depths), default=0.0)

    @property
    def largest_deflection(self) -> float:
        """Deflection above which small-deflection theory does not hold, m: a fifth of the longest side."""
        return max(self.sides, default=math.inf) / 5.0

    @property
    def elastic_supports(self) -> tuple[tuple[float, Any], ...]:
        """Coordinates and sections of elastic supports."""
        return ()

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Coordinates and kinds of the symbols in a sketch of the body: clamped, springs, mass, ..."""
        return ()

    @property
    def depths(self) -> tuple[tuple[float, float, float], ...]:
        """First and last coordinate, and depth, m, of each segment whose depth is known."""
        return ()

    @property
    def spring_links(self) -> tuple[tuple[float | None, float | None], ...]:
        """Pairs of coordinates that springs of the body connect; None is a wall."""
        return ()

    def default_probe(self) -> tuple[str, AtPlace]:
        """Name and place of the probe if the scenario has none."""
        raise NotImplementedError

    @property
    def sides(self) -> tuple[float, ...]:
        """Lengths, m, of the axes along which positions are given."""
        return ()

    def metres(self, position: float | q.Share, axis: int = 0) -> float:
        """A position along an axis in m; exactly its end if only round-off is between them (3 ft and 36 in)."""
        if axis >= len(self.sides):
            return math.nan if isinstance(position, q.Share) else position
        side = self.sides[axis]
        x = side * position.value if isinstance(position, q.Share) else position
        return side if same_position(x, side) else x

    def distance_along(self, member: str, position: float | q.Share) -> float:
        """Distance along a member of a frame, m; other bodies have no members."""
        raise NotImplementedError

    @overload
    def point(self, position: float | q.Share) -> float: ...
    @overload
    def point(self, position: tuple[float | q.Share, float | q.Share]) -> tuple[float, float]: ...
    @overload
    def point(self, position: WrittenPosition) -> Point: ...
    def point(self, position: WrittenPosition) -> Point:
        """A position on the body, converted to m."""
        if not isinstance(position, tuple):
            return self.metres(position)
        return self.metres(position[0], 0), self.metres(position[1], 1)

    def point_of(self, place: AtPlace) -> Point:
        """Position of a place on the body, m, or the number of the mass or node."""
        if place.position is not None:
            return self.point(place.position)
        number = place.mass if place.node is None else place.node
        assert isinstance(number, int)
        return float(number)

    def coordinates_of(self, place: AtPlace) -> tuple[float, float, float] | None:
        """Coordinates of a place in space, m; None if the body is not in space, or they are only in its files."""
        return None

    def support_at(self, position: WrittenPosition) -> str:
        """The support that prevents a deflection at a point, such as "the clamped left end"; empty if there is none."""
        return ""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of the body alone, such as points that are not on it."""
        for place, part in walk(self, path) if self.sides else ():
            if (position := getattr(part, "position", None)) is not None:
                yield from self.position_problems(path, (*place, "position"), position, "")

    def position_problems(self, body_path: Path, path: Path, position: WrittenPosition, item: str) -> Iterator[Problem]:
        """Problems of a position on the body.

        Parameters
        ----------
        body_path : path of the body.
        path : path at which the position is written.
        position : as it is written.
        item : what is at the position and has no effect at a support; empty if it may be at a support.

        Yields
        ------
        Problem
        """
        along = position if isinstance(position, tuple) else (position,)
        if len(along) != len(self.sides):
            yield self._dimension_problem(body_path, path, position)
            return
        for axis, x in enumerate(along):
            yield from self.position_problems_of_side(body_path, (*path, axis) if len(along) > 1 else path, x, axis)
        if item and (held := self.support_at(position)):
            yield self._without_effect(body_path, path, position, f"{held}, which cannot deflect: {item}")

    def _without_effect(self, body_path: Path, path: Path, position: WrittenPosition, item: str) -> Problem:
        """The problem of an item without effect, because the body is supported there."""
        point = self.point(position)
        shown = f"[{point[0]:g}, {point[1]:g}]" if isinstance(point, tuple) else f"{point:g}"
        remedy = f"move it, or change {path_text((*body_path, 'supports'))}"
        return problem(path, f"= {shown} m is {item} has no effect there", remedy)

    def _dimension_problem(self, body_path: Path, path: Path, position: WrittenPosition) -> Problem:
        """The problem of a position with a wrong number of coordinates."""
        if not self.sides:
            return self._other_kind_problem(body_path, path, "a beam")
        given = "is a point [x, y]" if isinstance(position, tuple) else f"= {position} is one number"
        return problem(path, f"{given}, but {path_text(body_path)} is {self.called}", self.place_remedy)

    def position_problems_of_side(
        self, body_path: Path, path: Path, position: float | q.Share, axis: int = 0
    ) -> Iterator[Problem]:
        """A problem if a position lies beyond the end of an axis.

        Parameters
        ----------
        body_path, path : see `position_problems`.
        position : along the side.
        axis : number of the side, from 0.

        Yields
        ------
        Problem
        """
        x, side = self.metres(position, axis), self.sides[axis]
        if x > side:
            yield self._too_far(body_path, path, distinct(x, side), axis)

    def _too_far(self, body_path: Path, path: Path, numbers: tuple[str, str], axis: int) -> Problem:
        """The problem of a position beyond the end of an axis; both numbers as text."""
        (given, last), (key, begins) = numbers, (("length", "left"), ("width", "bottom"))[axis]
        return problem(
            path,
            f"= {given} m lies beyond {path_text((*body_path, key))} = {last} m",
            f"positions run from 0 to {last} m, from the {begins} {'end' if len(self.sides) == 1 else 'edge'}",
        )

    def mass_problems(self, body_path: Path, path: Path, mass: int) -> Iterator[Problem]:
        """Problems of the number of a mass of the body.

        Parameters
        ----------
        body_path : path of the body.
        path : path at which the number is written.
        mass : the number, from 1.

        Yields
        ------
        Problem
        """
        yield self._other_kind_problem(body_path, path, "a chain")

    def node_problems(self, body_path: Path, path: Path, node: int | str) -> Iterator[Problem]:
        """A problem: the body has no nodes.

        Parameters
        ----------
        body_path : path of the body.
        path : path at which the node is written.
        node : number or name of the node.

        Yields
        ------
        Problem
        """
        yield self._other_kind_problem(body_path, path, "a frame" if isinstance(node, str) else "imported matrices")

    def node_of_number(self, number: int) -> int | str | None:
        """The node with a number in files of other programs, as a place names it; None if the body has none."""
        return None

    def member_problems(self, body_path: Path, path: Path, place: AtPlace) -> Iterator[Problem]:
        """A problem: the body has no members.

        Parameters
        ----------
        body_path : path of the body.
        path : path of the place.
        place : with a member and a position.

        Yields
        ------
        Problem
        """
        yield self._other_kind_problem(body_path, (*path, "member"), "a frame")

    def row_problems(self, body_path: Path, path: Path, name: str) -> Iterator[Problem]:
        """A problem: the body has no rows with names."""
        yield self._other_kind_problem(body_path, path, "imported matrices")

    def _other_kind_problem(self, body_path: Path, path: Path, other_kind: str) -> Problem:
        """The problem of a place that is written for another kind of body."""
        this = "the structure" if len(body_path) == 1 else path_text(body_path)
        return problem(path, f"applies to {other_kind}, but {this} is {self.called}", self.place_remedy)

    def shape_problems(self, body_path: Path, path: Path, position: float | q.Share) -> Iterator[Problem]:
        """Problems of a position at which a mode shape was measured.

        Parameters
        ----------
        body_path : path of the body.
        path : path at which the position is written.
        position : along the body, as it is written, or the number of a mass.

        Yields
        ------
        Problem
        """
        yield from self.position_problems(body_path, path, position, "")

    def power_of_start(self, index: int) -> int:
        """Power of x that belongs to a coefficient of an initial displacement or velocity."""
        return index

    def start_problems(self, path: Path, numbers: tuple[float, ...]) -> Iterator[Problem]:
        """Problems of the numbers of an initial displacement or velocity; by default none are allowed.

        Parameters
        ----------
        path : path at which the numbers are written.
        numbers : as they are written, in SI units: coefficients of 1, x, x^2, ..., or one for each mass.

        Yields
        ------
        Problem
        """
        if numbers:
            remedy = "start from rest, the static equilibrium, a mode, or a released force"
            yield problem(path, f"gives a shape of a beam or chain, but the structure is {self.called}", remedy)
