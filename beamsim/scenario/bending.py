"""What makes a stretch of a beam stiff and heavy: a section of one material, a sandwich, or the numbers themselves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, Tag

from beamsim.scenario import quantities as q
from beamsim.scenario.base import BY_FORM, Path, Schema, Variants, fail, path_text


class RectangleSection(Schema):
    """Solid rectangle, bending about the axis along its width."""

    kind: Literal["rectangle"] = "rectangle"
    """Solid rectangle."""
    width: q.Length
    """Size across the motion."""
    thickness: q.Length
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
    side: q.Length
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
    diameter: q.Length
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
    outer_diameter: q.Length
    """Outer diameter."""
    wall_thickness: q.Length
    """Thickness of the wall, at most half the outer diameter."""

    def check(self) -> None:
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
    height: q.Length
    """Whole size in the direction of the motion."""
    width: q.Length
    """Width of the flanges."""
    web_thickness: q.Length
    """Thickness of the web, at most the width."""
    flange_thickness: q.Length
    """Thickness of each flange, at most half the height."""

    def check(self) -> None:
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
    area: q.Area
    """Cross-sectional area."""
    second_moment: q.SecondMoment
    """Second moment of area about the bending axis."""
    extreme_fibre: q.Length
    """Distance of the outermost fibre from the neutral axis, for the bending stress."""


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
    """Young's modulus along the beam; 0, as of a honeycomb, by default."""
    density: q.Density
    """Density."""


class SandwichSection(Schema):
    """Two equal faces on a core, with plane sections: the shear of the core is neglected."""

    kind: Literal["sandwich"] = "sandwich"
    """Two equal faces on a core."""
    width: q.Length
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


@lru_cache(maxsize=64)
def _rectangle(width: float, thickness: float) -> RectangleSection:
    return RectangleSection(width=width, thickness=thickness)


class Bending(Schema):
    """Bending stiffness and mass of a stretch of a beam, whatever they are given by."""

    if TYPE_CHECKING:

        @property
        def bending_stiffness(self) -> float:
            """E I, N m^2."""

        @property
        def mass_per_length(self) -> float:
            """Mass per length, kg/m."""

    @property
    def stress_per_moment(self) -> float | None:
        """Stress at the extreme fibre for a unit moment, Pa per N m; None where that is unknown."""
        raise NotImplementedError

    @property
    def depth(self) -> float | None:
        """Twice the distance of the outermost fibre, m; None where that is unknown."""
        raise NotImplementedError

    def material_doubts(self, where: Path) -> Iterator[str]:
        """A sentence for each doubtful number."""
        yield from ()


class SolidBending(Bending):
    """A section of one material."""

    width: q.Length | None = None
    """Width of a rectangular section (across the motion)."""
    thickness: q.Length | None = None
    """Thickness of a rectangular section (in the direction of the motion)."""
    section: Section | None = None
    """Any other cross-section, instead of width and thickness."""
    youngs_modulus: q.Modulus
    """Young's modulus."""
    density: q.Density
    """Density."""

    def check(self) -> None:
        """Reject a section that is missing or given twice."""
        super().check()
        flat = [name for name in ("width", "thickness") if getattr(self, name) is not None]
        if self.section is not None and flat:
            raise fail(
                f"is given together with {flat[0]}", "keep section, or width and thickness, not both", ("section",)
            )
        if self.section is None and len(flat) < 2:
            missing = "thickness" if flat == ["width"] else "width"
            raise fail(
                "is missing" if flat else "has no cross-section",
                "give width and thickness, for example width: 50 mm, thickness: 5 mm, or a section",
                (missing,) if flat else (),
            )

    @property
    def cross_section(self) -> SolidSection:
        """The section, also when it was given by width and thickness."""
        if self.section is not None:
            return self.section
        assert self.width is not None
        assert self.thickness is not None
        return _rectangle(self.width, self.thickness)

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
    def depth(self) -> float:
        """Twice the distance of the outermost fibre, m."""
        return 2.0 * self.extreme_fibre

    @property
    def bending_stiffness(self) -> float:
        """E I, N m^2."""
        return self.youngs_modulus * self.second_moment

    @property
    def mass_per_length(self) -> float:
        """Rho S, kg/m."""
        return self.density * self.area

    @property
    def stress_per_moment(self) -> float:
        """Stress at the extreme fibre for a unit moment, Pa per N m."""
        return self.extreme_fibre / self.second_moment

    def material_doubts(self, where: Path) -> Iterator[str]:
        """Moduli and densities of no solid."""
        at = path_text(where)
        if not 1e5 <= self.youngs_modulus <= 2e12:
            yield (
                f"{at}.youngs_modulus = {self.youngs_modulus:g} Pa is outside the range of solids: "
                "a unit such as GPa may be missing"
            )
        if not 1.0 <= self.density <= 25_000.0:
            yield (
                f"{at}.density = {self.density:g} kg/m^3 is outside the range of solids: "
                "a unit such as g/cm^3 may be missing"
            )


class SandwichBending(Bending):
    """A sandwich of two materials."""

    section: SandwichSection
    """The sandwich; its faces and core have their own materials."""

    @property
    def depth(self) -> float:
        """Twice the distance of the outermost fibre, m."""
        return 2.0 * self.section.extreme_fibre

    @property
    def bending_stiffness(self) -> float:
        """E I of faces and core, N m^2."""
        return self.section.bending_stiffness

    @property
    def mass_per_length(self) -> float:
        """Mass of faces and core, kg/m."""
        return self.section.mass_per_length

    @property
    def stress_per_moment(self) -> float:
        """E_f c / (E I) of the faces' outer fibre, Pa per N m."""
        return self.section.faces.youngs_modulus * self.section.extreme_fibre / self.section.bending_stiffness


class StatedBending(Bending):
    """Bending stiffness and mass per length as they are stated, such as those of a sandwich panel."""

    bending_stiffness: q.BendingStiffness
    """Bending stiffness E I."""
    mass_per_length: q.MassPerLength
    """Mass per unit length."""
    extreme_fibre: q.Length | None = None
    """Distance of the outermost fibre from the neutral axis, for the bending stress."""
    youngs_modulus: q.Modulus | None = None
    """Young's modulus of the outermost fibre, for the bending stress: a strain alone gives none."""

    @property
    def stress_per_moment(self) -> float | None:
        """E c / (E I) of the extreme fibre, Pa per N m; None where its distance or modulus is unknown."""
        if self.extreme_fibre is None or self.youngs_modulus is None:
            return None
        return self.youngs_modulus * self.extreme_fibre / self.bending_stiffness

    @property
    def depth(self) -> float | None:
        """Twice the distance of the outermost fibre, m; None where that is not given."""
        return None if self.extreme_fibre is None else 2.0 * self.extreme_fibre

    def material_doubts(self, where: Path) -> Iterator[str]:
        """Half of what the bending stress needs."""
        given = {"extreme_fibre": self.extreme_fibre, "youngs_modulus": self.youngs_modulus}
        missing = [name for name, value in given.items() if value is None]
        if len(missing) == 1:
            (alone,) = given.keys() - missing
            yield (
                f"{path_text((*where, alone))} has no effect without {missing[0]}: the bending stress needs both; "
                f"give {missing[0]} too, or leave {alone} out"
            )


class SegmentBase(Schema):
    """A stretch of a beam with properties of its own."""

    from_: q.PositionOrShare = Field(alias="from")
    """Where it begins: distance from the left end of the beam, or the share of its length: 40 %."""
    to: q.PositionOrShare
    """Where it ends; the next segment begins there."""
    added_mass_per_length: q.NonNegativeMassPerLength = 0.0
    """Mass per length that adds no stiffness, such as cables or cells; none by default."""


class SolidSegment(SolidBending, SegmentBase):
    """A segment of one material."""


class SandwichSegment(SandwichBending, SegmentBase):
    """A segment that is a sandwich."""


class StatedSegment(StatedBending, SegmentBase):
    """A segment by its bending stiffness and mass per length."""


def bending_tag(value: Any) -> str:
    """Which variant a raw beam or segment is, by what it gives."""
    if isinstance(value, dict):
        section = value.get("section")
        if "bending_stiffness" in value:
            return "<stiffness>"
        sandwich = isinstance(section, SandwichSection) or (
            isinstance(section, dict) and section.get("kind") == "sandwich"
        )
        return "<sandwich>" if sandwich else "<section>"
    if isinstance(value, StatedBending):
        return "<stiffness>"
    return "<sandwich>" if isinstance(value, SandwichBending) else "<section>"


Segment = Annotated[
    Annotated[SolidSegment, Tag("<section>")]
    | Annotated[SandwichSegment, Tag("<sandwich>")]
    | Annotated[StatedSegment, Tag("<stiffness>")],
    Variants(choose=bending_tag),
]


@dataclass(frozen=True)
class Stretch:
    """A stretch of a beam along which nothing changes."""

    path: Path  # below the beam
    start: float  # m
    end: float  # m
    bending: Bending
    added_mass_per_length: float = 0.0  # kg/m

    @property
    def bending_stiffness(self) -> float:
        """E I, N m^2."""
        return self.bending.bending_stiffness

    @property
    def mass_per_length(self) -> float:
        """Mass per length with what is added, kg/m."""
        return self.bending.mass_per_length + self.added_mass_per_length

    @property
    def length(self) -> float:
        """Its length, m."""
        return self.end - self.start
