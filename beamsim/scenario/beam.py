"""The beam: geometry, material, supports, damping, point masses."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Tag

from beamsim.errors import Problem
from beamsim.scenario.base import BY_KIND, Path, Schema, Variants, fail, path_text
from beamsim.scenario.body import Body
from beamsim.scenario.damping import BeamDamping, ModalDamping
from beamsim.scenario.place import AtPlace
from beamsim.scenario.quantities import (
    Area,
    BendingStiffness,
    Density,
    Elements,
    Length,
    MassPerLength,
    Modulus,
    PointMassValue,
    PositionOrShare,
    SecondMoment,
    Share,
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


Section = Annotated[RectangleSection | TubeSection | GeneralSection, BY_KIND]


class Supports(Schema):
    """How the two ends are held."""

    left: Support = "clamped"
    """The end at x = 0: clamped, pinned, free, or guided (slides without rotation)."""
    right: Support = "free"
    """The end at x = length."""


class PointMass(Schema):
    """A lumped mass on the beam, such as an accelerometer; a node is placed there."""

    position: PositionOrShare
    """Distance from the left end, or the share of the length: 60 %."""
    mass: PointMassValue
    """The mass; it has no rotary inertia."""


_HOLDS_DEFLECTION = ("clamped", "pinned")


class BeamBody(Body):
    """What beams answer, whatever their bending stiffness was given by."""

    body_kind: ClassVar[str] = "beam"
    has_slope: ClassVar[bool] = True

    length: Length
    """Length."""
    elements: Elements = 20
    """Number of finite elements (cubic Hermite), before nodes are added at point masses."""
    supports: Supports = Supports()
    """How the two ends are held; clamped and free by default."""
    damping: BeamDamping = ModalDamping()
    """Damping; none by default."""
    point_masses: tuple[PointMass, ...] = ()
    """Lumped masses."""

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
    def gives_stress(self) -> bool:
        """Whether a bending stress can be recovered."""
        return self.stress_per_moment is not None

    @property
    def rough_frequency_hz(self) -> float:
        """That of the first mode, about, Hz."""
        return math.pi / 2.0 * math.sqrt(self.bending_stiffness / self.mass_per_length) / self.length**2

    @property
    def depth(self) -> float | None:
        """Twice the distance of the outermost fibre, m; None where that is unknown."""
        return None

    @property
    def largest_gap(self) -> float:
        """A fifth of the length, or ten times the depth if that is less."""
        return min(self.length / 5.0, math.inf if self.depth is None else 10.0 * self.depth)

    def refined(self) -> Self:
        """The beam with twice the elements."""
        return self.model_copy(update={"elements": 2 * self.elements})

    def default_probe(self) -> tuple[str, AtPlace]:
        """A free end, else the middle."""
        moving = ("free", "guided")
        if self.supports.right in moving:
            return "right_end", AtPlace(position=self.length)
        if self.supports.left in moving:
            return "left_end", AtPlace(position=0.0)
        return "middle", AtPlace(position=self.length / 2.0)

    def on_the_body(self, position: float) -> float:
        """The position, of a share that of the length, moved to the end if it is beyond it by round-off only."""
        if isinstance(position, Share):
            return self.length * position
        return self.length if self.length < position <= self.length * (1.0 + 1e-12) else position

    def problems(self, where: Path) -> Iterator[Problem]:
        """Nothing left to move; point masses beyond the ends."""
        inside = [mass for mass in self.point_masses if 0.0 < mass.position < self.length]
        if self.elements == 1 and self.supports.left == self.supports.right == "clamped" and not inside:
            yield Problem(
                path_text((*where, "elements")),
                "= 1 leaves no degree of freedom between two clamped ends",
                "use 2 or more",
            )
        for index, mass in enumerate(self.point_masses):
            yield from self.position_problems(where, (*where, "point_masses", index, "position"), mass.position, "")

    def held_end(self, position: float) -> tuple[str, str] | None:
        """(end, support) if no deflection is possible at the position."""
        for end, x in (("left", 0.0), ("right", self.length)):
            support = getattr(self.supports, end)
            if position == x and support in _HOLDS_DEFLECTION:
                return end, support
        return None

    def holds(self, position: float) -> bool:
        """Whether a support is at a position."""
        return self.held_end(position) is not None

    def position_problems(self, where: Path, at: Path, position: float, what: str) -> Iterator[Problem]:
        """What is wrong with a position; ``what`` does nothing on a support, and is empty for what may stand there."""
        if position > self.length:
            given = _distinct(position, self.length)
            yield Problem(
                path_text(at),
                f"= {given[0]} m lies beyond {path_text((*where, 'length'))} = {given[1]} m",
                f"positions run from 0 to {given[1]} m, from the left end",
            )
        elif what and (held := self.held_end(position)) is not None:
            yield Problem(
                path_text(at),
                f"= {position:g} m is the {held[1]} {held[0]} end, which cannot deflect: {what} has no effect there",
                f"move it along the beam, or change {path_text((*where, 'supports', held[0]))}",
            )

    def movable_problems(self, where: Path, at: Path, position: float) -> Iterator[Problem]:
        """Why no snubber can move to a position of the beam."""
        if self.on_the_body(position) > self.length:
            yield from self.position_problems(where, at, position, "")
        if (held := self.held_end(position)) is not None:
            yield Problem(
                path_text(at),
                f"= {position:g} m is the {held[1]} {held[0]} end, which cannot deflect",
                "begin or end a little beside it",
            )

    def start_problems(self, where: Path, at: Path, numbers: tuple[float, ...]) -> Iterator[Problem]:
        """A polynomial with a deflection or slope that the supports prevent."""
        supports = self.supports
        for end, support, x in (("left", supports.left, 0.0), ("right", supports.right, self.length)):
            for what, order, held in (
                ("deflection", 0, support in _HOLDS_DEFLECTION),
                ("slope", 1, support in ("clamped", "guided")),
            ):
                terms = [c * (j if order else 1) * x ** (j - order) for j, c in enumerate(numbers) if j >= order]
                scale = sum(
                    abs(c) * (j if order else 1) * self.length ** (j - order) for j, c in enumerate(numbers) if j
                )
                scale += 0.0 if order or not numbers else abs(numbers[0])
                if held and abs(sum(terms)) > 1e-9 * scale:
                    of = what if at[-1] == "displacement" else f"{what} velocity"
                    yield Problem(
                        path_text(at),
                        f"= [{', '.join(f'{c:g}' for c in numbers)}] has the {of} {sum(terms):g} "
                        f"at the {support} {end} end, where it must be 0",
                        "choose a polynomial in x that the supports allow (coefficients of 1, x, x^2, ...)",
                    )

    def doubts(self, where: Path, highest_hz: float) -> Iterator[str]:
        """Too few elements for the excitation."""
        if highest_hz > 0.0:
            omega = 2.0 * math.pi * highest_hz
            wavelength = 2.0 * math.pi * (self.bending_stiffness / self.mass_per_length / omega**2) ** 0.25
            per_wave = wavelength / (self.length / self.elements)
            if per_wave < 6.0:
                yield (
                    f"{path_text((*where, 'elements'))} = {self.elements} gives {per_wave:.1f} elements a bending "
                    f"wavelength at {highest_hz:g} Hz: use 6 or more"
                )


def _distinct(a: float, b: float) -> tuple[str, str]:
    """Print two numbers with enough digits to distinguish them."""
    for digits in range(6, 18):
        texts = f"{a:.{digits}g}", f"{b:.{digits}g}"
        if texts[0] != texts[1]:
            return texts
    return repr(a), repr(b)


class Beam(BeamBody):
    """A uniform Euler-Bernoulli beam along x from 0 (left) to `length` (right)."""

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

    def doubts(self, where: Path, highest_hz: float) -> Iterator[str]:
        """Moduli of no solid, depth, too few elements."""
        at = path_text(where)
        if not 1e5 <= self.youngs_modulus <= 2e12:
            yield (
                f"{at}.youngs_modulus = {self.youngs_modulus:g} Pa is that of no solid: "
                "a unit such as GPa may be missing"
            )
        if not 1.0 <= self.density <= 25_000.0:
            yield (f"{at}.density = {self.density:g} kg/m^3 is that of no solid: a unit such as g/cm^3 may be missing")
        if self.depth > self.length / 10.0:
            yield (
                f"the beam is {self.depth:g} m deep and {self.length:g} m long: Euler-Bernoulli theory (no shear) is "
                "doubtful when the depth is more than a tenth of the length"
            )
        yield from super().doubts(where, highest_hz)


class StiffnessBeam(BeamBody):
    """A uniform beam by its bending stiffness and mass per length, such as a sandwich panel."""

    bending_stiffness: BendingStiffness
    """Bending stiffness E I."""
    mass_per_length: MassPerLength
    """Mass per unit length."""
    extreme_fibre: Length | None = None
    """Distance of the outermost fibre from the neutral axis, for the bending stress."""
    youngs_modulus: Modulus | None = None
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

    def doubts(self, where: Path, highest_hz: float) -> Iterator[str]:
        """Half of what the bending stress needs; too few elements."""
        given = {"extreme_fibre": self.extreme_fibre, "youngs_modulus": self.youngs_modulus}
        missing = [name for name, value in given.items() if value is None]
        if len(missing) == 1:
            (alone,) = given.keys() - missing
            yield (
                f"{path_text((*where, alone))} has no effect without {missing[0]}: the bending stress needs both; "
                f"give {missing[0]} too, or leave {alone} out"
            )
        yield from super().doubts(where, highest_hz)


def by_stiffness(value: Any) -> bool:
    """Whether a raw beam is given by its bending stiffness."""
    return isinstance(value, StiffnessBeam) or (isinstance(value, dict) and "bending_stiffness" in value)


AnyBeam = Annotated[
    Annotated[Beam, Tag("<section>")] | Annotated[StiffnessBeam, Tag("<stiffness>")],
    Variants(lambda value: "<stiffness>" if by_stiffness(value) else "<section>"),
]
