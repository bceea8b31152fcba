"""Beams: bending stiffness and mass of their segments, supports, damping, point masses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import BY_FORM, InvalidValueError, Path, Problems, Schema, Whole, path_text, problem
from beamsim.scenario.body import AtPlace, BeamDamping, Body, ModalDamping, WrittenPosition, coarse_mesh


class CrossSection(NamedTuple):
    """A cross-section of one material, with its bending stiffness and mass."""

    area: float  # m^2
    second_moment: float  # about the bending axis, m^4
    extreme_fibre: float  # distance of the outermost fibre from the neutral axis, m


def _rectangle(width: float, thickness: float) -> CrossSection:
    """A rectangle, with the second moment b h^3 / 12."""
    return CrossSection(width * thickness, width * thickness**3 / 12.0, thickness / 2.0)


class RectangleSection(Schema):
    """Solid rectangle, bending about the axis along its width."""

    kind: Literal["rectangle"] = "rectangle"
    """Solid rectangle."""
    width: q.Length
    """Size perpendicular to the motion."""
    thickness: q.Length
    """Size in the direction of the motion."""

    @property
    def values(self) -> CrossSection:
        """Area, second moment and outermost fibre."""
        return _rectangle(self.width, self.thickness)


class SquareSection(Schema):
    """Solid square, bending about an axis parallel to a side."""

    kind: Literal["square"] = "square"
    """Solid square."""
    side: q.Length
    """Length of a side."""

    @property
    def values(self) -> CrossSection:
        """A square, with the second moment a^4 / 12."""
        return _rectangle(self.side, self.side)


def _without_section(missing_keys: Sequence[str]) -> InvalidValueError:
    """The error of a beam without section and without width or thickness."""
    remedy = "give width and thickness, for example width: 50 mm, thickness: 5 mm, or a section"
    if len(missing_keys) == 1:
        return InvalidValueError("is missing", remedy, tuple(missing_keys))
    return InvalidValueError("has no cross-section", remedy)


def _ring(outer_diameter: float, inner_diameter: float) -> CrossSection:
    """The ring between two diameters."""
    area = math.pi / 4.0 * (outer_diameter**2 - inner_diameter**2)
    second_moment = math.pi / 64.0 * (outer_diameter**4 - inner_diameter**4)
    return CrossSection(area, second_moment, outer_diameter / 2.0)


class CircleSection(Schema):
    """Solid round bar."""

    kind: Literal["circle"] = "circle"
    """Solid round bar."""
    diameter: q.Length
    """Diameter."""

    @property
    def values(self) -> CrossSection:
        """A circle, with the second moment pi d^4 / 64."""
        return _ring(self.diameter, 0.0)


class TubeSection(Schema):
    """Round tube; with a wall of half the diameter it is a solid rod."""

    kind: Literal["tube"] = "tube"
    """Round tube."""
    outer_diameter: q.Length
    """Outer diameter."""
    wall_thickness: q.Length
    """Thickness of the wall, at most half the outer diameter."""

    def check(self) -> None:
        """Refuse a wall that is thicker than half the diameter."""
        if self.wall_thickness > self.outer_diameter / 2.0:
            raise InvalidValueError(
                f"= {self.wall_thickness:g} m is more than half of outer_diameter = {self.outer_diameter:g} m",
                "half the diameter is a solid rod",
                ("wall_thickness",),
            )

    @property
    def values(self) -> CrossSection:
        """A ring, with the second moment pi (D^4 - d^4) / 64."""
        return _ring(self.outer_diameter, max(self.outer_diameter - 2.0 * self.wall_thickness, 0.0))


class ISection(Schema):
    """I-section with two equal flanges; the web is parallel to the motion."""

    kind: Literal["I"] = "I"
    """Two equal flanges and a web."""
    height: q.Length
    """Total size in the direction of the motion."""
    width: q.Length
    """Width of the flanges."""
    web_thickness: q.Length
    """Thickness of the web, at most the width."""
    flange_thickness: q.Length
    """Thickness of each flange, at most half the height."""

    def check(self) -> None:
        """Refuse a web or flanges that do not fit into the section."""
        for key, largest, what in (
            ("web_thickness", self.width, "width"),
            ("flange_thickness", self.height / 2.0, "half of height"),
        ):
            if getattr(self, key) > largest:
                raise InvalidValueError(
                    f"= {getattr(self, key):g} m is more than {what} = {largest:g} m", "check the two sizes", (key,)
                )

    @property
    def values(self) -> CrossSection:
        """Second moment (b H^3 - (b - t_w) h^3) / 12, with the web height h between the flanges."""
        web = self.height - 2.0 * self.flange_thickness
        area = 2.0 * self.width * self.flange_thickness + self.web_thickness * web
        second_moment = (self.width * self.height**3 - (self.width - self.web_thickness) * web**3) / 12.0
        return CrossSection(area, second_moment, self.height / 2.0)


class GeneralSection(Schema):
    """Any cross-section, given by its properties."""

    kind: Literal["general"] = "general"
    """Section given by its area and second moment."""
    area: q.Area
    """Cross-sectional area."""
    second_moment: q.SecondMoment
    """Second moment of area about the bending axis."""
    extreme_fibre: q.Length
    """Distance of the outermost fibre from the neutral axis, for the bending stress."""

    @property
    def values(self) -> CrossSection:
        """The given properties."""
        return CrossSection(self.area, self.second_moment, self.extreme_fibre)


SolidSection = RectangleSection | SquareSection | CircleSection | TubeSection | ISection | GeneralSection
Section = Annotated[SolidSection, BY_FORM]


class Faces(Schema):
    """The two equal faces of a sandwich."""

    thickness: q.Length
    """Thickness of each face."""
    youngs_modulus: q.Modulus
    """Young's modulus."""
    density: q.Density
    """Density."""


class Core(Schema):
    """The core between the faces of a sandwich."""

    thickness: q.Length
    """Thickness of the core alone."""
    youngs_modulus: q.NonNegativeModulus = 0.0
    """Young's modulus along the beam; 0 by default, as for a honeycomb."""
    density: q.Density
    """Density."""


class SandwichSection(Schema):
    """Two equal faces on a core; sections stay plane: the shear deformation of the core is neglected."""

    kind: Literal["sandwich"] = "sandwich"
    """Two equal faces on a core."""
    width: q.Length
    """Size perpendicular to the motion."""
    faces: Faces
    """The faces: thickness of each, youngs_modulus, density."""
    core: Core
    """The core: thickness, youngs_modulus (0 by default), density."""


class Bending(NamedTuple):
    """Bending stiffness and mass of a beam segment, however they are given."""

    bending_stiffness: float  # E I, N m^2
    mass_per_length: float  # kg/m
    stress_per_moment: float | None = None  # at the outermost fibre, Pa per N m; None if unknown
    depth: float | None = None  # twice the distance of the outermost fibre, m; None if unknown


class BendingSource(Schema):
    """Common part of all ways to give the bending stiffness and mass of a segment."""

    @property
    def bending(self) -> Bending:
        """Bending stiffness, mass and stress factor that follow from the section."""
        raise NotImplementedError

    def material_warnings(self, body_path: Path) -> Iterator[str]:
        """A warning for each doubtful number."""
        yield from ()


class SolidBending(BendingSource):
    """One material and a cross-section."""

    width: q.BodyWidth | None = None
    """Width of a rectangular section (perpendicular to the motion)."""
    thickness: q.BodyThickness | None = None
    """Thickness of a rectangular section (in the direction of the motion)."""
    section: Section | None = None
    """Any other cross-section, instead of width and thickness."""
    youngs_modulus: q.SolidModulus
    """Young's modulus."""
    density: q.SolidDensity
    """Density."""

    def check(self) -> None:
        """Refuse a section that is missing or given twice."""
        super().check()
        self.exclude("section", "width", "thickness", remedy="keep section, or width and thickness, not both")
        if self.section is None and (missing := [key for key in ("width", "thickness") if getattr(self, key) is None]):
            raise _without_section(missing)
        area, second_moment, _ = self._section_values
        for value, of in (
            (area, units.AREA), (second_moment, units.SECOND_MOMENT),
            (self.density * area, units.MASS_PER_LENGTH),
            (self.youngs_modulus * second_moment, units.BENDING_STIFFNESS),
        ):  # fmt: skip
            units.demand_in_range(value, of, "check the section, youngs_modulus and density")

    @property
    def _section_values(self) -> tuple[float, float, float]:
        """Area, second moment and distance of the outermost fibre."""
        if self.section is not None:
            area, second_moment, fibre = self.section.values
            return area, second_moment, fibre
        assert self.width is not None
        assert self.thickness is not None
        return _rectangle(self.width, self.thickness)

    @property
    def bending(self) -> Bending:
        """E I, rho S, and the stress c / I of the outermost fibre."""
        area, second_moment, fibre = self._section_values
        return Bending(
            self.youngs_modulus * second_moment, self.density * area, fibre / second_moment, 2.0 * fibre
        )  # fmt: skip


class SandwichBending(BendingSource):
    """A sandwich of two materials."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("section: sandwich",)

    section: SandwichSection
    """The sandwich; its faces and core have their own materials."""

    @property
    def bending(self) -> Bending:
        """Sandwich of thickness H with a core of thickness h: E I = b (E_f (H^3 - h^3) + E_c h^3) / 12.

        H^3 - h^3 is computed as (H - h)(H^2 + H h + h^2), which stays accurate for thin faces.
        """
        width, faces, core = self.section.width, self.section.faces, self.section.core
        depth = 2.0 * faces.thickness + core.thickness
        of_faces = 2.0 * faces.thickness * (depth**2 + depth * core.thickness + core.thickness**2)
        of_core = core.youngs_modulus * core.thickness**3
        stiffness = width / 12.0 * (faces.youngs_modulus * of_faces + of_core)
        mass = width * (2.0 * faces.density * faces.thickness + core.density * core.thickness)
        return Bending(stiffness, mass, faces.youngs_modulus * depth / 2.0 / stiffness, depth)


class StatedBending(BendingSource):
    """Bending stiffness and mass per length as numbers, for example those of a sandwich panel."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("bending_stiffness",)

    bending_stiffness: q.BendingStiffness
    """Bending stiffness E I."""
    mass_per_length: q.MassPerLength
    """Mass per unit length."""
    extreme_fibre: q.Length | None = None
    """Distance of the outermost fibre from the neutral axis, for the bending stress."""
    youngs_modulus: q.Modulus | None = None
    """Young's modulus of the outermost fibre; the bending stress needs it, because the section gives only the
    strain."""

    @property
    def bending(self) -> Bending:
        """The given values, and the stress E c / (E I) if the distance and modulus of the fibre are known."""
        fibre, modulus = self.extreme_fibre, self.youngs_modulus
        stress = None if fibre is None or modulus is None else modulus * fibre / self.bending_stiffness
        depth = None if fibre is None else 2.0 * fibre
        return Bending(self.bending_stiffness, self.mass_per_length, stress, depth)

    def material_warnings(self, body_path: Path) -> Iterator[str]:
        """Warn if only one of the two values for the bending stress is given."""
        given = {"extreme_fibre": self.extreme_fibre, "youngs_modulus": self.youngs_modulus}
        missing = [name for name, value in given.items() if value is None]
        if len(missing) == 1:
            (alone,) = given.keys() - missing
            yield (
                f"{path_text((*body_path, alone))} has no effect without {missing[0]}: the bending stress needs both; "
                f"give {missing[0]} too, or leave {alone} out"
            )


class SegmentBase(Schema):
    """Common part of the segments of a beam."""

    from_: q.PositionOrShare = Field(alias="from")
    """Where the segment begins: distance from the left end of the beam, or share of its length: 40 %."""
    to: q.PositionOrShare
    """Where the segment ends; the next one begins there."""
    added_mass_per_length: q.NonNegativeMassPerLength = 0.0
    """Mass per length without stiffness, such as cables; none by default."""


class SolidSegment(SolidBending, SegmentBase):
    """A segment of one material."""


class SandwichSegment(SandwichBending, SegmentBase):
    """A segment that is a sandwich."""


class StatedSegment(StatedBending, SegmentBase):
    """A segment given by its bending stiffness and mass per length."""


Segment = Annotated[SolidSegment | SandwichSegment | StatedSegment, BY_FORM]


class UniformSegment(NamedTuple):
    """A length of a beam along which nothing changes."""

    path: Path  # below the beam
    start: float  # m
    end: float  # m
    length: float  # m
    section: BendingSource
    bending: Bending  # properties that its section gives
    bending_stiffness: float  # E I, N m^2
    mass_per_length: float  # with what is added, kg/m


Support = Literal["clamped", "pinned", "free", "guided"]
_DEFLECTION_FIXED = ("clamped", "pinned")
_SLOPE_FIXED = ("clamped", "guided")

SHORTEST_SEGMENT = 1e-3
"""Part of an element below which a segment is too short for the mesh."""
_POSITION_ROUND_OFF = 1e-9  # of the length, within which ends of segments are the same


class ElasticSupport(Schema):
    """An end on springs and dashpots to the base, in addition to what its kind fixes."""

    kind: Support = "free"
    """What is held: nothing by default, the deflection (pinned) or the rotation (guided)."""
    stiffness: q.NonNegativeStiffness = 0.0
    """Force per deflection of the end; none by default."""
    rotational_stiffness: q.RotationalStiffness = 0.0
    """Moment per rotation of the end; none by default."""
    dashpot: q.Dashpot = 0.0
    """Force per velocity of the end; none by default."""
    rotational_dashpot: q.RotationalDashpot = 0.0
    """Moment per rate of rotation of the end; none by default."""

    def check(self) -> None:
        """Reject springs where nothing moves."""
        for what, holding, keys in (
            ("deflect", _DEFLECTION_FIXED, ("stiffness", "dashpot")),
            ("turn", _SLOPE_FIXED, ("rotational_stiffness", "rotational_dashpot")),
        ):
            for key in keys:
                if self.kind in holding and getattr(self, key) > 0.0:
                    raise InvalidValueError(
                        f"has no effect: a {self.kind} end cannot {what}", "leave it out, or change kind", (key,)
                    )


AnySupport = Annotated[Support | ElasticSupport, BY_FORM]


class Supports(Schema):
    """How the two ends are held."""

    left: AnySupport = "clamped"
    """The end at x = 0: clamped, pinned, free, guided (slides without rotation), or springs {stiffness: 10 kN/m}."""
    right: AnySupport = "free"
    """The end at x = length."""

    @property
    def kinds(self) -> tuple[Support, Support]:
        """Kinds of support of the left and the right end."""
        left, right = (end.kind if isinstance(end, ElasticSupport) else end for end in (self.left, self.right))
        return left, right


class PointMass(Schema):
    """A lumped mass on the beam, such as an accelerometer; a node is placed there."""

    position: q.PositionOrShare
    """Distance from the left end, or the share of the length: 60 %."""
    mass: q.PointMassValue
    """The mass."""
    rotary_inertia: q.RotaryInertia = 0.0
    """Its moment of inertia about its place on the beam, against rotation of the beam there; none by default."""


LARGEST_DEPTH_RATIO = 0.1  # depth of a beam over its length, from which on shear counts
_SHEAR_REMEDY = "Euler-Bernoulli theory (no shear) is doubtful when the depth is more than a tenth of the length"


class BeamBody(Body):
    """Common part of all beams, however their bending stiffness is given."""

    body_kind: ClassVar[str] = "beam"
    load_remedy: ClassVar[str] = "give line: whole, with a level in N/m"
    has_slope: ClassVar[bool] = True
    base_directions: ClassVar[tuple[str, ...]] = ("z", "ry")

    length: q.BodyLength
    """Length."""
    elements: q.Elements = 20
    """Number of finite elements (cubic Hermite), before nodes are added at point masses."""
    supports: Supports = Supports.model_construct()
    """How the two ends are held; clamped and free by default."""
    damping: BeamDamping = ModalDamping.model_construct()
    """Damping; none by default."""
    point_masses: tuple[PointMass, ...] = ()
    """Lumped masses."""
    nodes: tuple[q.PositionOrShare, ...] = ()
    """Positions, or shares of the length, at which the mesh is to have a node."""
    kind: Literal["beam"] = "beam"
    """A beam, straight along x from 0 (left) to length (right)."""

    @property
    def bending(self) -> Bending:
        """Bending properties of the whole beam; with segments the largest stiffness and the mean mass."""
        raise NotImplementedError

    @property
    def uniform_segments(self) -> tuple[UniformSegment, ...]:
        """The uniform segments of the beam, from left to right."""
        raise NotImplementedError

    @property
    def mass_points(self) -> tuple[float, ...]:
        """Positions of the point masses, m."""
        return tuple(self.metres(mass.position) for mass in self.point_masses)

    @property
    def sides(self) -> tuple[float, ...]:
        """The length."""
        return (self.length,)

    @property
    def gives_stress(self) -> bool:
        """Whether a bending stress can be recovered."""
        return all(segment.bending.stress_per_moment is not None for segment in self.uniform_segments)

    @property
    def rough_frequency_hz(self) -> float:
        """Approximate frequency of the first mode, Hz."""
        return math.pi / 2.0 * math.sqrt(self.bending.bending_stiffness / self.bending.mass_per_length) / self.length**2

    @property
    def elastic_supports(self) -> tuple[tuple[float, ElasticSupport], ...]:
        """Ends on springs, with their positions, m."""
        ends = (0.0, self.supports.left), (self.length, self.supports.right)
        return tuple((x, end) for x, end in ends if isinstance(end, ElasticSupport))

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Ends that are held, and point masses."""
        ends = zip((0.0, self.length), self.supports.kinds, strict=True)
        marks: list[tuple[float, str]] = [(x, kind) for x, kind in ends if kind != "free"]
        for x, spring in self.elastic_supports:
            turns, moves = spring.rotational_stiffness > 0.0, spring.stiffness > 0.0 or spring.dashpot > 0.0
            marks += [(x, "springs")] * moves + [(x, "rotational spring")] * turns
        return (*marks, *((x, "mass") for x in self.mass_points))

    @property
    def depths(self) -> tuple[tuple[float, float, float], ...]:
        """Depths of the segments."""
        return tuple((each.start, each.end, each.bending.depth) for each in self.uniform_segments if each.bending.depth)

    def refine(self) -> Self:
        """The beam with twice the elements."""
        return self.model_copy(update={"elements": 2 * self.elements})

    def default_probe(self) -> tuple[str, AtPlace]:
        """A free end, else the middle."""
        moving = ("free", "guided")
        left, right = self.supports.kinds
        if right in moving:
            return "right_end", AtPlace(position=self.length)
        if left in moving:
            return "left_end", AtPlace(position=0.0)
        return "middle", AtPlace(position=self.length / 2.0)

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Nothing left to move; points beyond the ends."""
        yield from super().problems(scenario, path)
        if self.elements == 1 and self.supports.kinds == ("clamped", "clamped"):
            yield from self._problem_of_one_element((*path, "elements"))
        for index, x in enumerate(self.nodes):
            yield from self.position_problems(path, (*path, "nodes", index), x, "")

    def _problem_of_one_element(self, path: Path) -> Problems:
        """A problem if the beam is one element between two clamped ends, which cannot move."""
        inside = any(0.0 < x < self.length for x in self.mass_points)
        if not inside and len(self.uniform_segments) == 1 and not self.nodes:
            yield problem(path, "= 1 leaves no degree of freedom between two clamped ends", "use 2 or more")

    def support_at(self, position: WrittenPosition) -> str:
        """The end at a position, where its deflection is held."""
        at = self.point(position)
        for end, support, x in zip(("left", "right"), self.supports.kinds, (0.0, self.length), strict=True):
            if at == x and support in _DEFLECTION_FIXED:
                return f"the {support} {end} end"
        return ""

    def start_problems(self, path: Path, numbers: tuple[float, ...]) -> Iterator[Problem]:
        """A polynomial with a deflection or slope that the supports prevent.

        Parameters
        ----------
        path, numbers : see `beamsim.scenario.body.Body.start_problems`.

        Yields
        ------
        Problem
        """
        slopes = tuple(j * c for j, c in enumerate(numbers))[1:]
        for end, support, x in zip(("left", "right"), self.supports.kinds, (0.0, self.length), strict=True):
            for what, terms, holding in (("deflection", numbers, _DEFLECTION_FIXED), ("slope", slopes, _SLOPE_FIXED)):
                value = sum(c * x**j for j, c in enumerate(terms))
                scale = sum(abs(c) * self.length**j for j, c in enumerate(terms))
                if support in holding and abs(value) > 1e-9 * scale:
                    of = what if path[-1] == "displacement" else f"{what} velocity"
                    yield problem(
                        path,
                        f"= [{', '.join(f'{c:g}' for c in numbers)}] has the {of} {value:g} "
                        f"at the {support} {end} end, where it must be 0",
                        "choose a polynomial in x that the supports allow (coefficients of 1, x, x^2, ...)",
                    )

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Numbers of no solid, depth, too few elements."""
        yield from super().find_warnings(scenario, path)
        for segment in self.uniform_segments:
            yield from segment.section.material_warnings((*path, *segment.path))
        if self.depth > LARGEST_DEPTH_RATIO * self.length:
            yield f"{path_text(path)} is {self.depth:g} m deep and {self.length:g} m long: {_SHEAR_REMEDY}"
        ratio = min(segment.bending_stiffness / segment.mass_per_length for segment in self.uniform_segments)
        highest_hz = scenario.excitation.highest_tone_hz
        yield from coarse_mesh((*path, "elements"), self.elements, self.length / self.elements, ratio, highest_hz)


class UniformBeam(BendingSource, BeamBody):
    """A beam along which nothing changes but point masses."""

    @property
    def uniform_segments(self) -> tuple[UniformSegment, ...]:
        """The whole beam."""
        of = self.bending
        return (UniformSegment((), 0.0, self.length, self.length, self, of, of.bending_stiffness, of.mass_per_length),)


class Beam(SolidBending, UniformBeam):
    """A uniform Euler-Bernoulli beam along x from 0 (left) to `length` (right)."""


class StiffnessBeam(StatedBending, UniformBeam):
    """A uniform beam by its bending stiffness and mass per length, such as a sandwich panel."""


class SandwichBeam(SandwichBending, UniformBeam):
    """A uniform beam of two faces and a core."""


class SegmentedBeam(BeamBody):
    """A beam of segments, each with properties of its own."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("segments",)

    segments: Annotated[tuple[Segment, ...], Field(min_length=1)]
    """The segments from left to right; together they cover the beam."""

    @property
    def uniform_segments(self) -> tuple[UniformSegment, ...]:
        """The segments."""
        segments = []
        for index, segment in enumerate(self.segments):
            start, end, of = self.metres(segment.from_), self.metres(segment.to), segment.bending
            mass = of.mass_per_length + segment.added_mass_per_length
            segments.append(
                UniformSegment(("segments", index), start, end, end - start, segment, of, of.bending_stiffness, mass)
            )
        return tuple(segments)

    @property
    def bending(self) -> Bending:
        """The largest E I and the mean mass per length."""
        mass = sum(segment.mass_per_length * segment.length for segment in self.uniform_segments)
        return Bending(max(segment.bending_stiffness for segment in self.uniform_segments), mass / self.length)

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Segments that leave a part of the beam out, overlap, or are too short for the mesh."""
        yield from super().problems(scenario, path)
        shortest, segments = SHORTEST_SEGMENT * self.length / self.elements, self.uniform_segments
        ends = [(each.path, key, x) for each in segments for key, x in (("from", each.start), ("to", each.end))]
        for place, key, x in ends:
            if x > self.length * (1.0 + _POSITION_ROUND_OFF):
                yield from self.position_problems_of_side(path, (*path, *place, key), x)
                return
        for segment in segments:
            if segment.length <= shortest:
                yield problem(
                    (*path, *segment.path, "to"),
                    f"= {segment.end:g} m is not beyond its from = {segment.start:g} m by more than "
                    f"{SHORTEST_SEGMENT:g} of an element",
                    "give from < to",
                )
        bounds = [("from", 0.0, segments[0].start, segments[0])]
        bounds += [("from", before.end, after.start, after) for before, after in pairwise(segments)]
        bounds += [("to", self.length, segments[-1].end, segments[-1])]
        for key, expected, given, segment in bounds:
            if abs(given - expected) > _POSITION_ROUND_OFF * self.length:
                yield problem(
                    (*path, *segment.path, key),
                    f"= {given:g} m, where {expected:g} m is expected",
                    "segments follow one another from 0 to length without gap or overlap",
                )

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Segments that keep the others' stress from being given, in addition to the warnings of every beam."""
        known = [segment.bending.stress_per_moment is not None for segment in self.uniform_segments]
        if any(known) and not all(known):
            section = self.uniform_segments[known.index(False)].section
            needed = ("extreme_fibre", "youngs_modulus")
            missing = " and ".join(name for name in needed if getattr(section, name, None) is None)
            yield (
                f"{path_text((*path, 'segments', known.index(False)))} gives no bending stress, so none is given for "
                f"the beam: add {missing}"
            )
        yield from super().find_warnings(scenario, path)


AnyBeam = Beam | StiffnessBeam | SandwichBeam | SegmentedBeam
