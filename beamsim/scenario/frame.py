"""Frames in space: nodes, straight or curved members between them, cross-sections, supports, point masses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import (
    BY_FORM,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    Variants,
    Whole,
    path_text,
    problem,
    unknown,
)
from beamsim.scenario.beam import CircleSection, GeneralSection, ISection, RectangleSection, SquareSection, TubeSection
from beamsim.scenario.body import AtPlace, Body, ChainDamping, ModalDamping, NodeDirection, NodeOfBody, Point

Vector = tuple[float, float, float]
Coordinates = tuple[q.Coordinate, q.Coordinate, q.Coordinate]
Components = tuple[q.Coefficient, q.Coefficient, q.Coefficient]

DIRECTIONS: tuple[NodeDirection, ...] = ("x", "y", "z", "rx", "ry", "rz")
ROUND_OFF = 1e-9
"""Relative difference below which lengths and directions count as equal."""


class SpatialSection(NamedTuple):
    """Properties of a cross-section about both of its axes y and z; x is along the member."""

    area: float  # m^2
    second_moment_y: float  # m^4, bending in the plane of x and z
    second_moment_z: float  # m^4, bending in the plane of x and y
    torsion_constant: float  # m^4
    shear_area_y: float  # m^2, infinite without shear deformation
    shear_area_z: float  # m^2
    fibre_y: float  # m, distance of the outermost fibre along y
    fibre_z: float  # m


class GeneralFrameSection(GeneralSection):
    """Any cross-section, given by its properties about both axes."""

    second_moment_z: q.SecondMoment
    """Second moment of area about the local z axis; second_moment is that about the local y axis."""
    torsion_constant: q.SecondMoment
    """Torsion constant J: the torsional stiffness is G J."""
    extreme_fibre_y: q.Length | None = None
    """Distance of the outermost fibre along the local y axis; as extreme_fibre by default."""
    shear_area_y: q.Area | None = None
    """Shear area for forces along the local y axis, used by the theory timoshenko; no shear deformation by default."""
    shear_area_z: q.Area | None = None
    """Shear area for forces along the local z axis; no shear deformation by default."""


FrameCrossSection = Annotated[
    RectangleSection | SquareSection | CircleSection | TubeSection | ISection | GeneralFrameSection, BY_FORM
]


def _ring_shear_coefficient(ratio: float, nu: float) -> float:
    """Shear coefficient of a ring with this ratio of the inner to the outer diameter (Cowper 1966)."""
    sum_squared = (1.0 + ratio**2) ** 2
    return 6.0 * (1.0 + nu) * sum_squared / ((7.0 + 6.0 * nu) * sum_squared + (20.0 + 12.0 * nu) * ratio**2)


def _rectangle_torsion_constant(a: float, b: float) -> float:
    """Torsion constant of a rectangle with the sides a and b, by its series, whose terms fall as 1 / n^5."""
    a, b = max(a, b), min(a, b)
    series = sum(math.tanh(n * math.pi * a / (2.0 * b)) / n**5 for n in range(1, 80, 2))
    return a * b**3 / 3.0 * (1.0 - 192.0 * b / (math.pi**5 * a) * series)


def _spatial_i_section(section: ISection, nu: float) -> tuple[float, float, float, float]:
    """Second moment about z, torsion constant (thin walls) and shear areas along y and z of an I-section.

    The shear area along z is that of G. R. Cowper (Journal of Applied Mechanics 33, 1966); along y the flanges act as
    rectangles.
    """
    b, t_f, t_w = section.width, section.flange_thickness, section.web_thickness
    web, h = section.height - 2.0 * t_f, section.height - t_f
    second_moment_z = (2.0 * t_f * b**3 + web * t_w**3) / 12.0
    torsion = (2.0 * b * t_f**3 + h * t_w**3) / 3.0
    m, n = 2.0 * b * t_f / (h * t_w), b / h
    below = 12.0 + 72.0 * m + 150.0 * m**2 + 90.0 * m**3 + nu * (11.0 + 66.0 * m + 135.0 * m**2 + 90.0 * m**3)
    below += 30.0 * n**2 * (m + m**2) + 5.0 * nu * n**2 * (8.0 * m + 9.0 * m**2)
    along_z = 10.0 * (1.0 + nu) * (1.0 + 3.0 * m) ** 2 / below
    of_rectangle = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
    return second_moment_z, torsion, of_rectangle * 2.0 * b * t_f, along_z * section.values.area


def spatial_section(section: FrameCrossSection, nu: float) -> SpatialSection:
    """Properties about both axes; shear coefficients after G. R. Cowper (Journal of Applied Mechanics 33, 1966).

    Parameters
    ----------
    section : cross-section; its thickness or height is along the local z axis.
    nu : Poisson's ratio, for the shear coefficients.

    Returns
    -------
    SpatialSection
    """
    area, along, fibre = section.values
    if isinstance(section, GeneralFrameSection):
        return SpatialSection(
            area, along, section.second_moment_z, section.torsion_constant, section.shear_area_y or math.inf,
            section.shear_area_z or math.inf, section.extreme_fibre_y or fibre, fibre,
        )  # fmt: skip
    if isinstance(section, ISection):
        across, torsion, shear_y, shear_z = _spatial_i_section(section, nu)
        return SpatialSection(area, along, across, torsion, shear_y, shear_z, section.width / 2.0, fibre)
    if isinstance(section, RectangleSection | SquareSection):
        width = section.side if isinstance(section, SquareSection) else section.width
        thickness, shear = 2.0 * fibre, area * 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
        across, torsion = thickness * width**3 / 12.0, _rectangle_torsion_constant(width, thickness)
        return SpatialSection(area, along, across, torsion, shear, shear, width / 2.0, fibre)
    inner = 0.0 if isinstance(section, CircleSection) else max(fibre - section.wall_thickness, 0.0)
    shear = area * _ring_shear_coefficient(inner / fibre, nu)
    return SpatialSection(area, along, along, 2.0 * along, shear, shear, fibre, fibre)


class FrameSection(Schema):
    """A cross-section of one material, which members refer to by its name."""

    section: FrameCrossSection
    """Cross-section: rectangle, square, circle, tube, I or general. Its thickness or height is along the local z axis
    of the member."""
    youngs_modulus: q.SolidModulus
    """Young's modulus."""
    poissons_ratio: q.PoissonsRatio = 0.3
    """Poisson's ratio, for torsion and shear; 0.3 by default."""
    density: q.NonNegativeDensity
    """Density; 0 if the point masses contain all mass."""
    added_mass_per_length: q.NonNegativeMassPerLength = 0.0
    """Mass per length without stiffness, such as water or insulation; none by default."""
    theory: Literal["euler_bernoulli", "timoshenko"] = "euler_bernoulli"
    """euler_bernoulli: no shear deformation, no rotary inertia of bending; timoshenko: with both."""

    def check(self) -> None:
        """Refuse properties beyond the range of numbers, and an incompressible material."""
        super().check()
        if self.poissons_ratio > 0.5:
            message = f"= {self.poissons_ratio:g} is above 0.5, that of an incompressible material"
            raise InvalidValueError(message, "write for example 0.3", ("poissons_ratio",))
        of = self.spatial
        for value, dimension in (
            (of.area, units.AREA), (of.second_moment_y, units.SECOND_MOMENT), (of.second_moment_z, units.SECOND_MOMENT),
            (self.youngs_modulus * of.second_moment_y, units.BENDING_STIFFNESS),
            (self.youngs_modulus * of.second_moment_z, units.BENDING_STIFFNESS),
        ):  # fmt: skip
            units.demand_in_range(value, dimension, "check the section and youngs_modulus")

    @property
    def spatial(self) -> SpatialSection:
        """Properties of the cross-section about both axes."""
        return spatial_section(self.section, self.poissons_ratio)

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)), Pa."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))

    @property
    def mass_per_length(self) -> float:
        """Mass per length of the section and what is added to it, kg/m."""
        return self.density * self.spatial.area + self.added_mass_per_length

    def bend_flexibility(self, radius: float) -> float:
        """Flexibility factor of a pipe bend of this radius, m: 1.65 / h, at least 1; 1 of other sections.

        h = t R / r^2 with the wall t, the radius R of the bend and the mean radius r of the pipe.
        """
        if not isinstance(self.section, TubeSection):
            return 1.0
        mean = (self.section.outer_diameter - self.section.wall_thickness) / 2.0
        return max(1.65 * mean**2 / (self.section.wall_thickness * radius), 1.0)


class ThroughArc(Schema):
    """An arc by a point on it."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("through",)

    through: Coordinates
    """A point of the arc between its ends."""


class CentredArc(Schema):
    """An arc of less than half a circle by its centre."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("centre",)

    centre: Coordinates
    """The centre; both ends have the same distance from it."""


class RadiusArc(Schema):
    """An arc of less than half a circle by its radius."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("radius",)

    radius: q.Length
    """Radius of the bend."""
    towards: Coordinates
    """A point on the side of the centre, in the plane of the arc."""


Arc = Annotated[
    ThroughArc | CentredArc | RadiusArc,
    Variants(
        "does not define an arc", "give {through: [x, y, z]}, {centre: [x, y, z]} or {radius: r, towards: [x, y, z]}"
    ),
]


class Releases(Schema):
    """Directions in which the ends of a member are not connected to their nodes."""

    start: tuple[NodeDirection, ...] = ()
    """Released at the first end, along the member's local axes: [ry, rz] for a hinge."""
    end: tuple[NodeDirection, ...] = ()
    """Released at the second end."""


class Offsets(Schema):
    """Rigid arms from the nodes to the ends of a member."""

    start: Coordinates = (0.0, 0.0, 0.0)
    """From the first node to the first end of the member, along the axes of the frame."""
    end: Coordinates = (0.0, 0.0, 0.0)
    """From the second node to the second end."""


class Centreline(NamedTuple):
    """The centreline of a member: straight, or an arc about a centre."""

    start: Vector  # m
    end: Vector  # m
    length: float  # m, along the centreline
    angle: float = 0.0  # rad, of an arc
    centre: Vector | None = None  # m, of an arc
    normal: Vector | None = None  # unit vector; the arc turns about it by the right-hand rule


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _plus(a: Vector, b: Vector, factor: float = 1.0) -> Vector:
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _unit(a: Vector) -> Vector:
    return _plus((0.0, 0.0, 0.0), a, 1.0 / math.sqrt(_dot(a, a)))


_ON_LINE = "give a point off the line through both ends"


def _centre_through(start: Vector, end: Vector, through: Vector) -> Vector:
    """Centre of the circle through three points."""
    u, v = _minus(through, start), _minus(end, start)
    w = _cross(u, v)
    if _dot(w, w) <= ROUND_OFF**2 * _dot(u, u) * _dot(v, v):
        raise InvalidValueError("is on the line through both ends", _ON_LINE, ("arc", "through"))
    a = _cross(_minus(_scaled(v, _dot(u, u)), _scaled(u, _dot(v, v))), w)
    return _plus(start, a, 1.0 / (2.0 * _dot(w, w)))


def _scaled(a: Vector, factor: float) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor


def _centre_of_radius(start: Vector, end: Vector, arc: RadiusArc) -> Vector:
    """Centre of an arc of given radius on the side of a point."""
    chord, middle = _minus(end, start), _plus(start, _minus(end, start), 0.5)
    side = _minus(arc.towards, middle)
    side = _plus(side, chord, -_dot(side, chord) / _dot(chord, chord))
    if _dot(side, side) <= ROUND_OFF**2 * _dot(chord, chord):
        raise InvalidValueError("is on the line through both ends", _ON_LINE, ("arc", "towards"))
    height = arc.radius**2 - _dot(chord, chord) / 4.0
    if height <= 0.0:
        half = math.sqrt(_dot(chord, chord)) / 2.0
        message = f"= {arc.radius:g} m is not more than half the distance of the ends, {half:g} m"
        raise InvalidValueError(message, "give a larger radius, or a point with through", ("arc", "radius"))
    return _plus(middle, _unit(side), math.sqrt(height))


class Member(Schema):
    """A member between two nodes."""

    nodes: tuple[q.Name, q.Name]
    """Names of its two nodes: [foot, knee]. The local x axis is from the first to the second."""
    section: q.Name | None = None
    """Name of its section; may be omitted if there is only one."""
    arc: Arc | None = None
    """Shape of a bend; straight by default."""
    flexibility_factor: q.PositiveNumber | None = None
    """Factor of both bending flexibilities of a bend; 1.65 / h for a tube by default, with h = t R / r^2, but at least
    1; 1 for other sections."""
    orientation: Components | None = None
    """A vector: the local z axis is its part across the member. By default z of the frame for straight members, x for
    members along z, and the normal of the plane for bends."""
    elements: q.Elements | None = None
    """Number of finite elements; as for the whole frame by default."""
    added_mass_per_length: q.NonNegativeMassPerLength = 0.0
    """Further mass per length without stiffness; none by default."""
    releases: Releases | None = None
    """Ends with hinges: {end: [ry, rz]}; none by default."""
    offsets: Offsets | None = None
    """Rigid arms between the nodes and the ends: {start: [0, 0, 50 mm]}; none by default."""

    def check(self) -> None:
        """Refuse one node twice, and a factor of a straight member."""
        super().check()
        if self.nodes[0] == self.nodes[1]:
            raise InvalidValueError("names one node twice", "name two nodes", ("nodes",))
        if self.flexibility_factor is not None and self.arc is None:
            raise InvalidValueError("belongs to a bend", "leave it out, or give arc", ("flexibility_factor",))

    def curve(self, nodes: Mapping[str, Vector]) -> Centreline:
        """The centreline between the ends, with offsets.

        Raises
        ------
        InvalidValueError
            If the member has no length, or no arc fits.
        """
        offsets = self.offsets or Offsets.model_construct()
        start, end = (_plus(nodes[name], by) for name, by in zip(self.nodes, (offsets.start, offsets.end), strict=True))
        chord = _minus(end, start)
        length = math.sqrt(_dot(chord, chord))
        if length <= ROUND_OFF * max(map(abs, (*start, *end))):
            raise InvalidValueError("has no length", "move one of its nodes, or join them with rigid_links", ("nodes",))
        if self.arc is None:
            return self._with_z_axis(Centreline(start, end, length))
        if isinstance(self.arc, ThroughArc):
            centre = _centre_through(start, end, self.arc.through)
        elif isinstance(self.arc, CentredArc):
            centre = self.arc.centre
        else:
            centre = _centre_of_radius(start, end, self.arc)
        return self._with_z_axis(self._bend(start, end, centre))

    def _bend(self, start: Vector, end: Vector, centre: Vector) -> Centreline:
        """The arc between two points about a centre."""
        a, b = _minus(start, centre), _minus(end, centre)
        radius, other = math.sqrt(_dot(a, a)), math.sqrt(_dot(b, b))
        if abs(radius - other) > 1e-6 * max(radius, other):
            message = f"has distances {radius:g} m and {other:g} m from the ends"
            raise InvalidValueError(message, "give the point with equal distances from both", ("arc", "centre"))
        w = _cross(a, b)
        if isinstance(self.arc, ThroughArc):
            w = _cross(_minus(self.arc.through, start), _minus(end, start))
        elif math.sqrt(_dot(w, w)) <= ROUND_OFF * radius**2:
            remedy = "give arc: {through: [x, y, z]}"
            raise InvalidValueError("is on the line through both ends", remedy, ("arc", "centre"))
        normal = _unit(w)
        angle = math.atan2(_dot(_cross(a, b), normal), _dot(a, b)) % (2.0 * math.pi)
        return Centreline(start, end, radius * angle, angle, centre, normal)

    def _with_z_axis(self, curve: Centreline) -> Centreline:
        """The curve, after a check that the orientation is nowhere along it."""
        if self.orientation is None:
            return curve
        o, count = self.orientation, 1 if curve.centre is None else 33
        size = math.sqrt(_dot(o, o))
        for k in range(count):
            t = tangent_at(curve, curve.length * k / max(count - 1, 1))
            across = _cross(o, t)
            if math.sqrt(_dot(across, across)) <= 1e-6 * size:
                raise InvalidValueError("is along the member", "give a vector across it", ("orientation",))
        return curve


def point_at(curve: Centreline, s: float) -> Vector:
    """Point of a curve at the distance s from its start, m."""
    if curve.centre is None or curve.normal is None:
        return _plus(curve.start, _minus(curve.end, curve.start), s / curve.length)
    radial, angle = _minus(curve.start, curve.centre), curve.angle * s / curve.length
    across = _scaled(_cross(curve.normal, radial), math.sin(angle))
    return _plus(_plus(curve.centre, across), radial, math.cos(angle))


def tangent_at(curve: Centreline, s: float) -> Vector:
    """Unit vector along a curve at the distance s from its start, m."""
    if curve.centre is None or curve.normal is None:
        return _unit(_minus(curve.end, curve.start))
    radial = _minus(curve.start, curve.centre)
    angle = curve.angle * s / curve.length
    first = _cross(curve.normal, radial)
    return _unit(_plus(_scaled(first, math.cos(angle)), radial, -math.sin(angle)))


class DirectionStiffness(Schema):
    """Stiffness of springs in each direction."""

    x: q.NonNegativeStiffness = 0.0
    """Along x."""
    y: q.NonNegativeStiffness = 0.0
    """Along y."""
    z: q.NonNegativeStiffness = 0.0
    """Along z."""
    rx: q.RotationalStiffness = 0.0
    """About x."""
    ry: q.RotationalStiffness = 0.0
    """About y."""
    rz: q.RotationalStiffness = 0.0
    """About z."""


class DirectionDashpot(Schema):
    """Coefficients of dashpots in each direction."""

    x: q.Dashpot = 0.0
    """Along x."""
    y: q.Dashpot = 0.0
    """Along y."""
    z: q.Dashpot = 0.0
    """Along z."""
    rx: q.RotationalDashpot = 0.0
    """About x."""
    ry: q.RotationalDashpot = 0.0
    """About y."""
    rz: q.RotationalDashpot = 0.0
    """About z."""


class NodeSupport(Schema):
    """What connects a node to the base."""

    fixed: tuple[NodeDirection, ...] = ()
    """Directions in which the node moves with the base: [x, y, z]."""
    stiffness: DirectionStiffness | None = None
    """Springs to the base in other directions: {z: 20 kN/m, rx: 200 N m/rad}; none by default."""
    dashpot: DirectionDashpot | None = None
    """Dashpots to the base in other directions; none by default."""

    def check(self) -> None:
        """Refuse springs where nothing moves, and a support that does not act."""
        super().check()
        for key, given in (("stiffness", self.stiffness), ("dashpot", self.dashpot)):
            for direction in DIRECTIONS if given is not None else ():
                if direction in self.fixed and getattr(given, direction) > 0.0:
                    message = f"has no effect: the node is fixed in {direction}"
                    raise InvalidValueError(message, "leave it out, or the direction of fixed", (key, direction))
        if not self.fixed and not any(self.springs.values()):
            raise InvalidValueError("supports nothing", "give fixed: [x, y, z] or stiffness: {z: 20 kN/m}")

    @property
    def springs(self) -> dict[str, tuple[float, float]]:
        """Stiffness and dashpot of each direction that has one."""
        stiffness, dashpot = self.stiffness or DirectionStiffness(), self.dashpot or DirectionDashpot()
        both = {each: (getattr(stiffness, each), getattr(dashpot, each)) for each in DIRECTIONS}
        return {direction: values for direction, values in both.items() if any(values)}


AnyNodeSupport = Annotated[
    Literal["clamped", "pinned"] | NodeSupport,
    Variants("is not a support", "write clamped, pinned, or {fixed: [x, z], stiffness: {y: 20 kN/m}}"),
]


def support_of(support: Literal["clamped", "pinned"] | NodeSupport) -> NodeSupport:
    """The support in its long form: clamped holds all six directions, pinned the three displacements."""
    if isinstance(support, NodeSupport):
        return support
    return NodeSupport.model_construct(fixed=DIRECTIONS if support == "clamped" else DIRECTIONS[:3])


class FramePointMass(Schema):
    """A lumped mass at a node or on a member."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("node", "member")

    node: NodeOfBody | None = None
    """Name of the node."""
    member: q.Name | None = None
    """Name of a member, instead of a node."""
    position: q.PositionOrShare | None = None
    """Distance along the member from its first end, or share of its length: 60 %."""
    mass: q.PointMassValue
    """The mass."""
    rotary_inertia: tuple[q.RotaryInertia, q.RotaryInertia, q.RotaryInertia] = (0.0, 0.0, 0.0)
    """Moments of inertia about axes along x, y and z through its centre; none by default."""
    offset: Coordinates = (0.0, 0.0, 0.0)
    """From the node or member to its centre, along the axes of the frame; a rigid arm. None by default."""

    def check(self) -> None:
        """Require a node, or a position on a member."""
        super().check()
        self.exclude("member", "node")
        if self.node is None and (self.member is None or self.position is None):
            raise InvalidValueError("names no place", "give node: knee, or member: leg with position: 1.2 m")
        if self.node is not None and self.position is not None:
            raise InvalidValueError("belongs to a member", "leave it out", ("position",))


class RigidLink(Schema):
    """Nodes that move together as one rigid body."""

    nodes: Annotated[tuple[q.Name, ...], Field(min_length=2)]
    """Names of the nodes."""


class SectionForce(Schema):
    """A force, moment or stress in a member, for outputs of the kind recovered."""

    member: q.Name
    """Name of the member."""
    position: q.PositionOrShare
    """Distance along the member from its first end, or share of its length."""
    quantity: Literal["axial_force", "shear_y", "shear_z", "torque", "moment_y", "moment_z", "stress"]
    """axial_force, positive in tension; shear forces, torque and moments of the part beyond on the part before, along
    and about the local axes; stress: axial and bending stress at a point of the section, without torsion."""
    point: tuple[q.Coordinate, q.Coordinate] | None = None
    """Local y and z of the point of a stress; the outermost fibre along z by default."""

    def check(self) -> None:
        """Refuse a point of a force."""
        super().check()
        if self.point is not None and self.quantity != "stress":
            raise InvalidValueError("belongs to a stress", "leave it out", ("point",))


class FrameBody(Body):
    """A frame in space of straight and curved members."""

    body_kind: ClassVar[str] = "frame"
    has_default_probe: ClassVar[bool] = False
    has_members: ClassVar[bool] = True
    keys_of_shape: ClassVar[tuple[str, ...]] = ("arc", "orientation", "offsets", "offset", "point")
    mesh_order: ClassVar[float] = 2.0  # of extension, torsion and shear; bending alone has 4
    reaction_order: ClassVar[float] = 2.0
    base_directions: ClassVar[tuple[str, ...]] = ("", *DIRECTIONS)
    place_remedy: ClassVar[str] = (
        "name a node, {node: knee, direction: z}, or {member: leg, position: 1.2 m, direction: z}"
    )

    kind: Literal["frame"]
    """A frame in space."""
    nodes: Annotated[Mapping[q.Name, Coordinates], Field(min_length=2)]
    """Nodes by name, with their coordinates: {foot: [0, 0, 0], knee: [0, 0, 3 m]}."""
    sections: Annotated[Mapping[q.Name, FrameSection], Field(min_length=1)]
    """Cross-sections with their material, by name."""
    members: Annotated[Mapping[q.Name, Member], Field(min_length=1)]
    """Members by name: {leg: {nodes: [foot, knee]}}."""
    supports: Mapping[q.Name, AnyNodeSupport] = {}
    """Supports by the name of their node: {foot: clamped, knee: {fixed: [y]}}; none by default."""
    elements: q.Elements = 4
    """Number of finite elements of each member that gives none."""
    rigid_links: tuple[RigidLink, ...] = ()
    """Groups of nodes that are connected rigidly."""
    point_masses: tuple[FramePointMass, ...] = ()
    """Lumped masses."""
    recovered: Mapping[q.Name, SectionForce] = {}
    """Forces, moments and stresses in members by name, for ``run.outputs`` of the kind ``recovered``."""
    damping: ChainDamping = ModalDamping.model_construct()
    """Damping of the body as a whole: modal ratios or Rayleigh; none by default."""

    @property
    def curves(self) -> dict[str, Centreline]:
        """Centreline of each member."""
        return {name: member.curve(self.nodes) for name, member in self.members.items()}

    def section_of(self, member: Member) -> FrameSection:
        """The section of a member."""
        return next(iter(self.sections.values())) if member.section is None else self.sections[member.section]

    @property
    def recovered_rows(self) -> tuple[str, ...]:
        """Names of the forces, moments and stresses in members."""
        return tuple(self.recovered)

    @property
    def largest_deflection(self) -> float:
        """A fifth of the longest member."""
        return max(curve.length for curve in self.curves.values()) / 5.0

    @property
    def mass_points(self) -> tuple[Point, ...]:
        """Points of the point masses, as `point_of` gives them."""
        places = (AtPlace.model_construct(node=m.node, member=m.member, position=m.position) for m in self.point_masses)
        return tuple(self.point_of(place) for place in places)

    def refine(self) -> Self:
        """The frame with twice the elements."""
        finer = {
            name: member if member.elements is None else member.model_copy(update={"elements": 2 * member.elements})
            for name, member in self.members.items()
        }
        return self.model_copy(update={"elements": 2 * self.elements, "members": finer})

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Numbers of the supported nodes and kinds of their supports."""
        numbers, kinds = {name: float(k) for k, name in enumerate(self.nodes, 1)}, []
        for name, support in self.supports.items():
            fixed = support_of(support).fixed
            kind = "clamped" if len(fixed) == len(DIRECTIONS) else "pinned" if fixed else "springs"
            kinds.append((numbers[name], kind))
        return tuple(kinds)

    def point_of(self, place: AtPlace) -> Point:
        """Number of a node, from 1; or the number of a member, from 1, and the distance along it, m."""
        if place.member is None:
            return float(list(self.nodes).index(str(place.node)) + 1)
        assert place.position is not None
        assert not isinstance(place.position, tuple)
        number = list(self.members).index(place.member) + 1
        return float(number), self.distance_along(place.member, place.position)

    def coordinates_of(self, place: AtPlace) -> Vector:
        """Coordinates of a place, m."""
        if place.member is None:
            return self.nodes[str(place.node)]
        assert place.position is not None
        assert not isinstance(place.position, tuple)
        return point_at(self.members[place.member].curve(self.nodes), self.distance_along(place.member, place.position))

    def distance_along(self, member: str, position: float | q.Share) -> float:
        """Distance along a member, m; exactly its length if only round-off is between them."""
        length = self.members[member].curve(self.nodes).length
        s = length * position.value if isinstance(position, q.Share) else position
        return length if math.isclose(s, length, rel_tol=1e-9) else s

    def node_of_number(self, number: int) -> str | None:
        """Name of a node by its order, from 1; None of points inside members."""
        names = list(self.nodes)
        return names[number - 1] if 1 <= number <= len(names) else None

    def node_problems(self, body_path: Path, path: Path, node: int | str) -> Iterator[Problem]:
        """A problem if no node has this name.

        Parameters
        ----------
        body_path, path, node : see `beamsim.scenario.body.Body.node_problems`.

        Yields
        ------
        Problem
        """
        yield from unknown(path, str(node), "node", self.nodes)

    def member_problems(self, body_path: Path, path: Path, place: AtPlace) -> Iterator[Problem]:
        """Problems of a place on a member.

        Parameters
        ----------
        body_path, path, place : see `beamsim.scenario.body.Body.member_problems`.

        Yields
        ------
        Problem
        """
        assert place.member is not None
        if isinstance(place.position, tuple):
            yield problem((*path, "position"), "is a point [x, y] of a plate", self.place_remedy)
            return
        yield from self._on_member_problems(path, place.member, place.position)

    def _on_member_problems(self, path: Path, member: str, position: float | q.Share | None) -> Iterator[Problem]:
        """Problems of a position along a member."""
        if member not in self.members or position is None:
            yield from unknown((*path, "member"), member, "member", self.members)
            return
        try:
            length = self.members[member].curve(self.nodes).length
        except (InvalidValueError, KeyError):
            return  # a problem of the member
        if (s := self.distance_along(member, position)) > length:
            message = f"= {s:g} m lies beyond the end of {member}, which is {length:g} m long"
            yield problem((*path, "position"), message, f"positions run from 0 to {length:g} m, from its first node")

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Names that do not exist, members without length or arc, nodes without members."""
        yield from super().problems(scenario, path)
        for name, member in self.members.items():
            yield from self._member_problems((*path, "members", name), member)
        used = {node for member in self.members.values() for node in member.nodes}
        for index, link in enumerate(self.rigid_links):
            used |= set(link.nodes)
            for k, node in enumerate(link.nodes):
                yield from unknown((*path, "rigid_links", index, "nodes", k), node, "node", self.nodes)
        for node in self.nodes:
            if node not in used:
                yield problem((*path, "nodes", node), "belongs to no member", "leave it out, or give a member there")
        for node in self.supports:
            yield from unknown((*path, "supports", node), node, "node", self.nodes)
        for index, mass in enumerate(self.point_masses):
            at = (*path, "point_masses", index)
            if mass.node is not None:
                yield from unknown((*at, "node"), str(mass.node), "node", self.nodes)
            elif mass.member is not None:
                yield from self._on_member_problems(at, mass.member, mass.position)
        for name, row in self.recovered.items():
            yield from self._on_member_problems((*path, "recovered", name), row.member, row.position)
        yield from self._link_problems((*path, "rigid_links"))
        weightless = [self.section_of(m).mass_per_length + m.added_mass_per_length == 0.0 for m in self._known_members]
        if all(weightless) and not any(mass.mass for mass in self.point_masses):
            yield problem(path, "has no mass", "give a section a density, or point_masses")

    @property
    def _known_members(self) -> list[Member]:
        """Members whose section exists."""
        return [m for m in self.members.values() if m.section is None or m.section in self.sections]

    def _member_problems(self, path: Path, member: Member) -> Problems:
        """Problems of one member."""
        for k, node in enumerate(member.nodes):
            yield from unknown((*path, "nodes", k), node, "node", self.nodes)
        if member.section is not None:
            yield from unknown((*path, "section"), member.section, "section", self.sections)
        elif len(self.sections) > 1:
            yield problem(path, "names no section, and there are several", f"add section: {next(iter(self.sections))}")
        if all(node in self.nodes for node in member.nodes):
            try:
                member.curve(self.nodes)
            except InvalidValueError as error:
                yield error.problem(path)

    @property
    def link_groups(self) -> list[tuple[str, ...]]:
        """Rigid groups of nodes, those that share a node together; a node that is fixed first."""
        groups: list[set[str]] = []
        for link in self.rigid_links:
            joined = set(link.nodes)
            for group in [group for group in groups if group & joined]:
                joined |= group
                groups.remove(group)
            groups.append(joined)
        fixed = {name for name, support in self.supports.items() if support_of(support).fixed}
        order = {name: (name not in fixed, k) for k, name in enumerate(self.nodes)}
        return [tuple(sorted(group, key=lambda name: order.get(name, (True, 0)))) for group in groups]

    def _link_problems(self, path: Path) -> Problems:
        """Problems: two nodes of a rigid group that are fixed."""
        for group in self.link_groups:
            fixed = [name for name in group if name in self.supports and support_of(self.supports[name]).fixed]
            for first, second in pairwise(fixed):
                yield problem(
                    path, f"connect {first} and {second} rigidly, and both are fixed",
                    "fix one of them, and give the other springs",
                )  # fmt: skip

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Members whose shear deformation counts and is neglected."""
        yield from super().find_warnings(scenario, path)
        for name, member in self.members.items():
            section, length = self.section_of(member), member.curve(self.nodes).length
            depth = 2.0 * max(section.spatial.fibre_y, section.spatial.fibre_z)
            if section.theory == "euler_bernoulli" and depth > 0.5 * length and member.arc is None:
                yield (
                    f"{path_text((*path, 'members', name))} is {depth:.3g} m deep and {length:.3g} m long: without "
                    "shear deformation it is too stiff; use theory: timoshenko"
                )
