"""The beam: geometry, material, supports, damping, point masses."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Tag

from beamsim.scenario.base import BY_KIND, Schema, fail
from beamsim.scenario.body import Body
from beamsim.scenario.damping import BeamDamping, ModalDamping
from beamsim.scenario.quantities import (
    Area,
    Density,
    Elements,
    Length,
    Modulus,
    PointMassValue,
    Position,
    SecondMoment,
)

Support = Literal["clamped", "pinned", "free", "guided"]


class RectangleSection(Schema):
    """Solid rectangle, bending about the axis along its width."""

    kind: Literal["rectangle"] = "rectangle"
    """Solid rectangle."""
    width: Length
    """Size across the motion."""
    thickness: Length
    """Size in the direction of the motion."""

    @property
    def area(self) -> float:
        """Cross-sectional area, m^2."""
        return self.width * self.thickness

    @property
    def second_moment(self) -> float:
        """Second moment of area, b h^3 / 12, m^4."""
        return self.width * self.thickness**3 / 12.0

    @property
    def extreme_fibre(self) -> float:
        """Distance of the outermost fibre from the neutral axis, m."""
        return self.thickness / 2.0


class TubeSection(Schema):
    """Round tube; a wall of half the diameter makes it a rod."""

    kind: Literal["tube"] = "tube"
    """Round tube."""
    outer_diameter: Length
    """Outer diameter."""
    wall_thickness: Length
    """Thickness of the wall, at most half the outer diameter."""

    def settle(self) -> None:
        """Reject a wall thicker than the tube."""
        if self.wall_thickness > self.outer_diameter / 2.0:
            raise fail(
                f"= {self.wall_thickness:g} m is more than half of outer_diameter = {self.outer_diameter:g} m",
                "half the diameter is a solid rod",
                ("wall_thickness",),
            )

    @property
    def _inner_diameter(self) -> float:
        return max(self.outer_diameter - 2.0 * self.wall_thickness, 0.0)

    @property
    def area(self) -> float:
        """Cross-sectional area, m^2."""
        return math.pi / 4.0 * (self.outer_diameter**2 - self._inner_diameter**2)

    @property
    def second_moment(self) -> float:
        """Second moment of area, pi (D^4 - d^4) / 64, m^4."""
        return math.pi / 64.0 * (self.outer_diameter**4 - self._inner_diameter**4)

    @property
    def extreme_fibre(self) -> float:
        """Distance of the outermost fibre from the neutral axis, m."""
        return self.outer_diameter / 2.0


class GeneralSection(Schema):
    """Any section, given by its properties."""

    kind: Literal["general"] = "general"
    """Section given by its area and second moment."""
    area: Area
    """Cross-sectional area."""
    second_moment: SecondMoment
    """Second moment of area about the bending axis."""
    extreme_fibre: Length
    """Distance of the outermost fibre from the neutral axis, for the bending stress."""


Section = Annotated[
    Annotated[RectangleSection, Tag("<rectangle>")]
    | Annotated[TubeSection, Tag("<tube>")]
    | Annotated[GeneralSection, Tag("<general>")],
    BY_KIND,
]


class Supports(Schema):
    """How the two ends are held."""

    left: Support = "clamped"
    """The end at x = 0: clamped, pinned, free, or guided (slides without rotation)."""
    right: Support = "free"
    """The end at x = length."""


class PointMass(Schema):
    """A lumped mass on the beam, such as an accelerometer; a node is placed there."""

    position: Position
    """Distance from the left end."""
    mass: PointMassValue
    """The mass; it has no rotary inertia."""


class Beam(Body):
    """A uniform Euler-Bernoulli beam along x from 0 (left) to `length` (right)."""

    body_kind: ClassVar[str] = "beam"

    length: Length
    """Length."""
    width: Length | None = None
    """Width of a rectangular section (across the motion)."""
    thickness: Length | None = None
    """Thickness of a rectangular section (in the direction of the motion)."""
    section: Section | None = None
    """Any other cross-section, instead of width and thickness."""
    youngs_modulus: Modulus
    """Young's modulus."""
    density: Density
    """Density."""
    elements: Elements = 20
    """Number of finite elements (cubic Hermite), before nodes are added at point masses."""
    supports: Supports = Supports()
    """How the two ends are held; clamped and free by default."""
    damping: BeamDamping = ModalDamping()
    """Damping; none by default."""
    point_masses: tuple[PointMass, ...] = ()
    """Lumped masses."""

    def settle(self) -> None:
        """Reject a section that is missing or given twice."""
        flat = [name for name in ("width", "thickness") if getattr(self, name) is not None]
        if self.section is not None and flat:
            raise fail(
                f"is given together with beam.{flat[0]}", "keep section, or width and thickness, not both", ("section",)
            )
        if self.section is None and len(flat) < 2:
            missing = "thickness" if flat == ["width"] else "width"
            raise fail(
                "is missing" if flat else "has no cross-section",
                "give width and thickness, for example width: 50 mm, thickness: 5 mm, or a section",
                (missing,) if flat else (),
            )

    def on_the_body(self, position: float) -> float:
        """The position, moved to the end if it is beyond it by round-off only."""
        return min(position, self.length)

    @property
    def cross_section(self) -> RectangleSection | TubeSection | GeneralSection:
        """The section, also when it was given by width and thickness."""
        if self.section is not None:
            return self.section
        assert self.width is not None
        assert self.thickness is not None
        return RectangleSection(width=self.width, thickness=self.thickness)

    @property
    def area(self) -> float:
        """Cross-sectional area, m^2."""
        return self.cross_section.area

    @property
    def second_moment(self) -> float:
        """Second moment of area, m^4."""
        return self.cross_section.second_moment

    @property
    def extreme_fibre(self) -> float:
        """Distance of the outermost fibre from the neutral axis, m."""
        return self.cross_section.extreme_fibre

    @property
    def bending_stiffness(self) -> float:
        """E I, N m^2."""
        return self.youngs_modulus * self.second_moment

    @property
    def mass_per_length(self) -> float:
        """Rho S, kg/m."""
        return self.density * self.area
