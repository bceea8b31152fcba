"""Rectangular thin plates: geometry, stiffness, edges, point supports, point masses, stiffeners."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import InvalidValueError, Path, Problems, Schema, Whole, path_text, problem
from beamsim.scenario.body import (
    AtPlace,
    Body,
    ChainDamping,
    ModalDamping,
    PlacedForce,
    PlatePoint,
    WrittenPosition,
    coarse_mesh,
    same_position,
)

Edge = Literal["clamped", "pinned", "free"]
SMALLEST_ELEMENT = 5e-4
"""Of a side; frequencies of a clamped plate have been seen to lose digits below 3e-4."""

_INCOMPRESSIBLE = 0.5  # Poisson's ratio
EDGES = ("left", "right", "bottom", "top")


class PointSupport(Schema):
    """A point that cannot deflect but can rotate; mesh lines run through it."""

    position: PlatePoint
    """Distances from the left and bottom edges, or shares of length and width."""


class PlateSupports(Schema):
    """How the edges are held."""

    left: Edge = "free"
    """The edge at x = 0: clamped, pinned or free."""
    right: Edge = "free"
    """The edge at x = length."""
    bottom: Edge = "free"
    """The edge at y = 0."""
    top: Edge = "free"
    """The edge at y = width."""
    points: tuple[PointSupport, ...] = ()
    """Points that cannot deflect."""


class PlatePointMass(Schema):
    """A lumped mass on the plate; mesh lines run through it."""

    position: PlatePoint
    """Distances from the left and bottom edges, or shares of length and width."""
    mass: q.PointMassValue
    """The mass; without rotary inertia."""


class Stiffener(Schema):
    """A uniform beam that is attached to the plate along a straight line."""

    from_: Annotated[PlatePoint, Field(alias="from")]
    """Its first end."""
    to: PlatePoint
    """Its second end."""
    bending_stiffness: q.BendingStiffness
    """Bending stiffness E I about the middle plane of the plate."""
    torsional_stiffness: q.TorsionalStiffness = 0.0
    """Torsional stiffness G J; none by default."""
    mass_per_length: q.MassPerLength
    """Mass per unit length, without rotary inertia."""


class Rigidity(Schema):
    """Bending stiffnesses per width of an orthotropic plate whose principal axes are x and y.

    Moments per width: Mx = dx w_xx + d1 w_yy, My = d1 w_xx + dy w_yy and Mxy = 2 dxy w_xy, with d1 = nu dy.
    """

    dx: q.PlateStiffness
    """Bending stiffness per width for curvature along x."""
    dy: q.PlateStiffness
    """Bending stiffness per width for curvature along y."""
    nu: q.PoissonsRatio = 0.0
    """Poisson's ratio nu_xy: contraction along y over extension along x; nu_yx = nu dy / dx."""
    dxy_: q.PlateStiffness | None = Field(default=None, alias="dxy")
    """Twisting stiffness, D (1 - nu) / 2 if isotropic; by default this formula with the geometric mean of dx and dy."""

    def check(self) -> None:
        """Refuse stiffnesses whose energy is not positive definite."""
        if self.nu**2 * self.dy >= self.dx:
            raise InvalidValueError(
                f"= {self.nu:g} is too large: nu^2 dy must be less than dx for a positive strain energy",
                f"give at most {math.sqrt(self.dx / self.dy):.4g}; nu_xy belongs to an extension along x",
                ("nu",),
            )

    @property
    def d1(self) -> float:
        """Coupling stiffness of the two curvatures, N m."""
        return self.nu * self.dy

    @property
    def dxy(self) -> float:
        """Twisting stiffness, N m."""
        if self.dxy_ is not None:
            return self.dxy_
        return math.sqrt(self.dx * self.dy) * (1.0 - self.nu * math.sqrt(self.dy / self.dx)) / 2.0


class PlateBending(NamedTuple):
    """Stiffnesses and mass of a plate, however they are given."""

    rigidity: Rigidity  # bending and twisting stiffnesses per width
    mass_per_area: float  # kg/m^2
    stress_per_moment: float | None  # at the surface, for a unit moment per width, Pa per N; None if unknown
    depth: float | None  # thickness, m; None if unknown


class PlateBody(Body):
    """Common part of all plates, however their bending stiffness is given; x is along the length, y along the width."""

    base_directions: ClassVar[tuple[str, ...]] = ("z", "rx", "ry")
    body_kind: ClassVar[str] = "plate"
    mesh_order: ClassVar[float] = 2.0
    reaction_order: ClassVar[float] = 1.5  # strains at an edge are of a lower order than inside
    load_remedy: ClassVar[str] = "give area: whole, with a level in Pa"
    place_remedy: ClassVar[str] = "give x and y from its left and bottom edge, position: [270 mm, 100 mm] on a plate"

    kind: Literal["plate"] = "plate"
    """A rectangular thin plate."""
    length: q.BodyLength
    """Size along x, from the left to the right edge."""
    width: q.BodyWidth
    """Size along y, from the bottom to the top edge."""
    elements: q.PlateElements = (12, 12)
    """Numbers of elements (bicubic Hermite) along x and y, before mesh lines are added at points and stiffeners."""
    grading: q.Grading = 1.0
    """Exponent of the mesh grading towards the edges: 1 is uniform, 2 makes elements at the edges much smaller."""
    supports: PlateSupports = Field(default_factory=PlateSupports)  # made where it is needed: it costs a validator
    """Supports of the edges, and points that cannot deflect; by default all edges are free."""
    damping: ChainDamping = ModalDamping.model_construct()
    """Damping; none by default."""
    point_masses: tuple[PlatePointMass, ...] = ()
    """Lumped masses."""
    stiffeners: tuple[Stiffener, ...] = ()
    """Beams along straight lines."""

    @property
    def bending(self) -> PlateBending:
        """Its stiffnesses and mass."""
        raise NotImplementedError

    @property
    def sides(self) -> tuple[float, ...]:
        """Length and width."""
        return self.length, self.width

    @property
    def mass_points(self) -> tuple[tuple[float, float], ...]:
        """Places of the point masses, m."""
        return tuple(self.point(mass.position) for mass in self.point_masses)

    @property
    def supported_points(self) -> tuple[tuple[float, float], ...]:
        """Places of the point supports, m."""
        return tuple(self.point(point.position) for point in self.supports.points)

    def line_of(self, stiffener: Stiffener) -> tuple[tuple[float, float], tuple[float, float]]:
        """The ends of a stiffener, m; exactly parallel to an edge if it is so up to round-off."""
        start, end = self.point(stiffener.from_), self.point(stiffener.to)
        x, y = (a if same_position(a, b) else b for a, b in zip(start, end, strict=True))
        return start, (x, y)

    @property
    def gives_stress(self) -> bool:
        """Whether stresses at the surface can be recovered."""
        return self.bending.stress_per_moment is not None

    @property
    def gives_strain(self) -> bool:
        """Whether the distance of the surface from the middle plane is known."""
        return self.bending.depth is not None

    @property
    def rough_frequency_hz(self) -> float:
        """Approximate frequency of the first mode, Hz."""
        stiffness = max(self.bending.rigidity.dx, self.bending.rigidity.dy)
        return math.pi / 2.0 * math.sqrt(stiffness / self.bending.mass_per_area) / max(self.length, self.width) ** 2

    def refine(self) -> Self:
        """The plate with twice the elements in both directions."""
        return self.model_copy(update={"elements": (2 * self.elements[0], 2 * self.elements[1])})

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Held edges in the side view, and point masses, with their x."""
        edges = ((0.0, self.supports.left), (self.length, self.supports.right))
        held = [(x, kind) for x, kind in edges if kind != "free"]
        return (*held, *((x, "mass") for x, _ in self.mass_points))

    @property
    def depths(self) -> tuple[tuple[float, float, float], ...]:
        """Its thickness."""
        return ((0.0, self.length, self.bending.depth),) if self.bending.depth else ()

    def default_probe(self) -> tuple[str, AtPlace]:
        """A free corner, else the middle of a free edge, else the centre."""
        free = {edge: getattr(self.supports, edge) == "free" for edge in EDGES}
        x = self.length if free["right"] else 0.0 if free["left"] else self.length / 2.0
        y = self.width if free["top"] else 0.0 if free["bottom"] else self.width / 2.0
        return "plate", AtPlace(position=(x, y))

    def support_at(self, position: WrittenPosition) -> str:
        """The edge or point support at a point; empty if the point can deflect."""
        if not isinstance(position, tuple):
            return ""
        x, y = self.point(position)
        at = {"left": x == 0.0, "right": x == self.length, "bottom": y == 0.0, "top": y == self.width}
        for edge, on_it in at.items():
            support = getattr(self.supports, edge)
            if on_it and support != "free":
                return f"on the {support} {edge} edge"
        on_point = any(same_position(x, a) and same_position(y, b) for a, b in self.supported_points)
        return "on the point support" if on_point else ""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: too small elements, points outside the plate, stiffeners of zero length."""
        for index, count in enumerate(self.elements):
            smallest = (2.0 / count) ** self.grading / 2.0
            if count > 2 and smallest < SMALLEST_ELEMENT:
                yield problem(
                    (*path, "grading"),
                    f"= {self.grading:g} with {count} elements along {'xy'[index]} makes one of {smallest:.2g} of the "
                    f"side: below {SMALLEST_ELEMENT:g} round-off shows in the lowest frequencies",
                    "use a smaller grading, or fewer elements: they are small where it matters",
                )
        yield from super().problems(scenario, path)
        for index, stiffener in enumerate(self.stiffeners):
            for key, end in (("from", stiffener.from_), ("to", stiffener.to)):
                yield from self.position_problems(path, (*path, "stiffeners", index, key), end, "")
            if len(set(self.line_of(stiffener))) == 1:
                yield problem((*path, "stiffeners", index), "begins and ends at the same point", "give it a length")

    def shape_problems(self, body_path: Path, path: Path, position: float | q.Share) -> Iterator[Problem]:
        """A problem: measured mode shapes have one coordinate only.

        Parameters
        ----------
        body_path, path, position : see `beamsim.scenario.body.Body.shape_problems`.

        Yields
        ------
        Problem
        """
        yield problem(
            path, "is one coordinate, and the structure is a plate", "give measured frequencies without shapes"
        )

    def _force_warnings(self, scenario: Whole) -> Iterator[str]:
        """Warnings that the stress is infinite under a point force, except at a free corner."""
        forces = [(of.path, of.item.places, of.body) for of in scenario.listed("snubbers") if of.path[0] != "joints"]
        dead_loads = enumerate(scenario.constant_forces)
        forces += [(("constant_forces", k), each.places, "") for k, each in dead_loads if isinstance(each, PlacedForce)]
        driven = [(path, each.applied_to) for path, each in scenario.excitation.items if each.applied_to != "base"]
        forces += [(("excitation", *path, "applied_to"), acted_on.places, "") for path, acted_on in driven]
        for at, places, owner in forces:
            for place in places:
                body = scenario.all_bodies.get(place.body or owner or scenario.default_body)
                if body is not self or not isinstance(place.position, tuple) or self.support_at(place.position):
                    continue
                x, y = self.point(place.position)
                if x not in (0.0, self.length) or y not in (0.0, self.width):
                    yield (
                        f"{path_text(at)} acts at a point inside a plate, where thin-plate theory has no finite "
                        "bending stress: the stress at that point grows with the number of elements; take it a "
                        "thickness or more next to it"
                    )

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Warnings about too few elements for the excitation, and about a plate that is not thin."""
        yield from super().find_warnings(scenario, path)
        depth, side = self.depth, min(self.sides)
        if depth > side / 10.0:
            yield (
                f"{path_text(path)} is {depth:g} m thick and {side:g} m wide: thin-plate theory (no shear) "
                "is doubtful when the thickness is more than a tenth of the shorter side"
            )
        stiffness = self.bending.rigidity
        for axis, d in enumerate((stiffness.dx, stiffness.dy)):
            elements, ratio = self.elements[axis], d / self.bending.mass_per_area
            size, highest_hz = self.sides[axis] / elements, scenario.excitation.highest_tone_hz
            yield from coarse_mesh((*path, "elements", axis), elements, size, ratio, highest_hz)
        if self.gives_stress:
            yield from self._force_warnings(scenario)


class Plate(PlateBody):
    """A rectangular, thin, isotropic plate (Kirchhoff theory)."""

    thickness: q.BodyThickness
    """Thickness."""
    youngs_modulus: q.SolidModulus
    """Young's modulus."""
    poissons_ratio: q.PoissonsRatio
    """Poisson's ratio."""
    density: q.SolidDensity
    """Density."""

    def check(self) -> None:
        """Refuse a Poisson's ratio of an incompressible material."""
        super().check()
        if self.poissons_ratio > _INCOMPRESSIBLE:
            raise InvalidValueError(
                f"= {self.poissons_ratio:g} is above {_INCOMPRESSIBLE:g}, that of an incompressible material",
                "write for example 0.33; of a sandwich or laminate give bending_stiffness: {dx, dy, nu, dxy}",
                ("poissons_ratio",),
            )
        units.demand_in_range(self._rigidity, units.PLATE_STIFFNESS, "check youngs_modulus and thickness")

    @property
    def _rigidity(self) -> float:
        """D = E h^3 / (12 (1 - nu^2)), N m."""
        return self.youngs_modulus * self.thickness**3 / (12.0 * (1.0 - self.poissons_ratio**2))

    @property
    def bending(self) -> PlateBending:
        """D = E h^3 / (12 (1 - nu^2)) in both directions; the stress 6 / h^2 for a unit moment per width."""
        h, d = self.thickness, self._rigidity
        return PlateBending(Rigidity(dx=d, dy=d, nu=self.poissons_ratio), self.density * h, 6.0 / h**2, h)


class StiffnessPlate(PlateBody):
    """A rectangular, thin, orthotropic plate by its stiffnesses and mass per area, such as a sandwich panel."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("bending_stiffness",)

    bending_stiffness: Rigidity
    """Bending stiffnesses per width: {dx, dy, nu, dxy}."""
    mass_per_area: q.MassPerArea
    """Mass per unit area."""
    section_modulus: q.SectionModulusPerLength | None = None
    """Moment per width over the stress at the surface, for stresses; h^2 / 6 for a solid plate, none by default."""
    thickness: q.BodyThickness | None = None
    """Distance between the surfaces, for strains and for pictures; none by default."""

    @property
    def bending(self) -> PlateBending:
        """The given values; the stress is the inverse of the section modulus."""
        stress = None if self.section_modulus is None else 1.0 / self.section_modulus
        return PlateBending(self.bending_stiffness, self.mass_per_area, stress, self.thickness)
