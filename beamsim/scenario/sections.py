"""Cross-sections of beams: solid ones of one material, and sandwiches of two."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from beamsim.scenario.base import BY_KIND, Schema, fail
from beamsim.scenario.quantities import Area, Density, Length, Modulus, NonNegativeModulus, SecondMoment


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


class SquareSection(Schema):
    """Solid square, bending about an axis parallel to a side."""

    kind: Literal["square"] = "square"
    """Solid square."""
    side: Length
    """Length of a side."""

    @property
    def area(self) -> float:
        """Cross-sectional area, m^2."""
        return self.side**2

    @property
    def second_moment(self) -> float:
        """Second moment of area, a^4 / 12, m^4."""
        return self.side**4 / 12.0

    @property
    def extreme_fibre(self) -> float:
        """Distance of the outermost fibre from the neutral axis, m."""
        return self.side / 2.0


class CircleSection(Schema):
    """Solid round bar."""

    kind: Literal["circle"] = "circle"
    """Solid round bar."""
    diameter: Length
    """Diameter."""

    @property
    def area(self) -> float:
        """Cross-sectional area, m^2."""
        return math.pi / 4.0 * self.diameter**2

    @property
    def second_moment(self) -> float:
        """Second moment of area, pi d^4 / 64, m^4."""
        return math.pi / 64.0 * self.diameter**4

    @property
    def extreme_fibre(self) -> float:
        """Distance of the outermost fibre from the neutral axis, m."""
        return self.diameter / 2.0


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


class ISection(Schema):
    """I of two equal flanges and a web, which stands in the direction of the motion."""

    kind: Literal["I"] = "I"
    """Two equal flanges and a web."""
    height: Length
    """Whole size in the direction of the motion."""
    width: Length
    """Width of the flanges."""
    web_thickness: Length
    """Thickness of the web, at most the width."""
    flange_thickness: Length
    """Thickness of each flange, at most half the height."""

    def settle(self) -> None:
        """Reject a web or flanges that do not fit in."""
        for key, largest, what in (
            ("web_thickness", self.width, "width"),
            ("flange_thickness", self.height / 2.0, "half of height"),
        ):
            if getattr(self, key) > largest:
                raise fail(
                    f"= {getattr(self, key):g} m is more than {what} = {largest:g} m", "check the two sizes", (key,)
                )

    @property
    def area(self) -> float:
        """Cross-sectional area, m^2."""
        web = self.height - 2.0 * self.flange_thickness
        return 2.0 * self.width * self.flange_thickness + self.web_thickness * web

    @property
    def second_moment(self) -> float:
        """Second moment of area, (b H^3 - (b - t_w) h^3) / 12 with the height h between the flanges, m^4."""
        web = self.height - 2.0 * self.flange_thickness
        return (self.width * self.height**3 - (self.width - self.web_thickness) * web**3) / 12.0

    @property
    def extreme_fibre(self) -> float:
        """Distance of the outermost fibre from the neutral axis, m."""
        return self.height / 2.0


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


SolidSection = RectangleSection | SquareSection | CircleSection | TubeSection | ISection | GeneralSection
Section = Annotated[SolidSection, BY_KIND]


class Faces(Schema):
    """The two equal faces of a sandwich."""

    thickness: Length
    """Thickness of each face."""
    youngs_modulus: Modulus
    """Young's modulus."""
    density: Density
    """Density."""


class Core(Schema):
    """The core between the faces of a sandwich."""

    thickness: Length
    """Thickness of the core alone."""
    youngs_modulus: NonNegativeModulus = 0.0
    """Young's modulus along the beam; 0, as of a honeycomb, by default."""
    density: Density
    """Density."""


class SandwichSection(Schema):
    """Two equal faces on a core, with plane sections: the shear of the core is neglected."""

    kind: Literal["sandwich"] = "sandwich"
    """Two equal faces on a core."""
    width: Length
    """Size across the motion."""
    faces: Faces
    """The faces: thickness of each, youngs_modulus, density."""
    core: Core
    """The core: thickness, youngs_modulus (0 by default), density."""

    @property
    def bending_stiffness(self) -> float:
        """b (E_f (H^3 - h^3) + E_c h^3) / 12 of a core of thickness h in a sandwich of thickness H, N m^2."""
        whole, core = 2.0 * self.extreme_fibre, self.core.thickness
        return (
            self.width / 12.0 * (self.faces.youngs_modulus * (whole**3 - core**3) + self.core.youngs_modulus * core**3)
        )

    @property
    def mass_per_length(self) -> float:
        """Mass of faces and core, kg/m."""
        return self.width * (2.0 * self.faces.density * self.faces.thickness + self.core.density * self.core.thickness)

    @property
    def extreme_fibre(self) -> float:
        """Distance of the outermost fibre from the neutral axis, m."""
        return self.faces.thickness + self.core.thickness / 2.0
