"""Springs, joints, one-sided stops ("snubbers") and dry friction, at points of bodies or between them."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Field

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
    count_text,
    demand_rising,
    path_text,
    problem,
    unknown,
)
from beamsim.scenario.body import (
    NUMBERED,
    AtPlace,
    BaseOrPlace,
    BetweenPlaces,
    Body,
    Named,
    PlacedItem,
    RatioDamping,
    SupportMounting,
    TwoPlaces,
    refuse_unlike_directions,
)
from beamsim.scenario.files import DecimalMark

SHOCK_ARRESTOR = "shock_arrestor"  # kind of spring

Extension = Annotated[float, q.Quantity(replace(units.LENGTH, name="displacement", example="0.1 mm"))]


class Maxwell(Schema):
    """A spring and a dashpot in series, parallel to another element."""

    stiffness: q.NonNegativeStiffness
    """Stiffness of its spring: the additional stiffness at a sudden deflection."""
    relaxation_time: q.Duration
    """Time constant of its force at a constant deflection: dashpot over stiffness."""
    start: Literal["relaxed", "just_mounted"] = "relaxed"
    """State at the start of a motion: relaxed (no force), or just_mounted, with the force of a sudden deflection, which
    then also counts in the static equilibrium at the start."""


class SpringToGround(PlacedItem, Named):
    """A spring from a point of a body, or a mass of a chain, to the fixed ground."""


class SpringBetween(BetweenPlaces, Named):
    """A spring between points of two bodies or of one, or between any two masses of a chain."""

    between: TwoPlaces = ()
    """The two places; the extension is positive when the second moves up from the first."""
    masses: Annotated[tuple[q.Count, ...], TWO_ITEMS] = ()
    """Numbers of two masses of a chain, instead of between; the extension is positive when they separate."""

    @property
    def ends(self) -> tuple[str, TwoPlaces]:
        """The key that gives both places, and its value."""
        return ("masses", self.masses) if self.masses else super().ends

    def check(self) -> None:
        """Refuse places that are given twice."""
        self.exclude("masses", "between")
        if not self.ends[1]:
            raise InvalidValueError("names no places", "give between, or on a chain masses: [1, 2]")
        super().check()


def has_own_law(item: Schema) -> bool:
    """Whether a spring or joint is nonlinear or has Maxwell branches."""
    kind = getattr(item, "kind", "")
    branches = getattr(item, "maxwell", ())
    return kind in ("cubic", "piecewise_linear", SHOCK_ARRESTOR) or any(branch.stiffness > 0.0 for branch in branches)


class LinearSpring(Schema):
    """Force = stiffness times extension."""

    kind: Literal["linear"] = "linear"
    """Force = stiffness times extension."""
    stiffness: q.NonNegativeStiffness
    """Stiffness."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches parallel to it, any number of them."""

    @property
    def linear_stiffness(self) -> float:
        """Stiffness in the linear model, N/m."""
        return self.stiffness


class CubicSpring(Schema):
    """Force = stiffness times extension cubed."""

    kind: Literal["cubic"] = "cubic"
    """Force = stiffness times extension cubed."""
    stiffness: q.CubicStiffness
    """Coefficient of the cubed extension; negative softens."""

    linear_stiffness: ClassVar[float] = 0.0
    """Stiffness in the linear model: 0."""


class PiecewiseLinearSpring(Schema):
    """A continuous piecewise-linear force through the origin."""

    kind: Literal["piecewise_linear"] = "piecewise_linear"
    """Piecewise-linear force, continuous, zero at zero extension."""
    breakpoints: Annotated[tuple[Extension, ...], Field(min_length=1)]
    """Extensions at which the slope changes, increasing."""
    stiffnesses: tuple[q.NonNegativeStiffness, ...]
    """Slope below the first breakpoint, between the first two, ..., above the last: one more than breakpoints."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches parallel to it, any number of them."""

    def check(self) -> None:
        """Check the lengths and the order."""
        bends, slopes = len(self.breakpoints), len(self.stiffnesses)
        if slopes != bends + 1:
            raise InvalidValueError(
                f"has {count_text(slopes, 'value')} for {count_text(bends, 'breakpoint')}",
                f"give {bends + 1} slopes: below the first breakpoint, between neighbours, above the last",
                ("stiffnesses",),
            )
        demand_rising(self.breakpoints, "m", lambda k: ("breakpoints", k))
        super().check()

    @property
    def number_at_rest(self) -> int:
        """Index of the slope at zero extension; of the smaller slope if zero is a breakpoint."""
        at = bisect_left(self.breakpoints, 0.0)
        on_it = at < len(self.breakpoints) and self.breakpoints[at] == 0.0
        return at + 1 if on_it and self.stiffnesses[at + 1] < self.stiffnesses[at] else at

    @property
    def linear_stiffness(self) -> float:
        """Stiffness in the linear model, N/m: the slope at zero extension."""
        return self.stiffnesses[self.number_at_rest]


class BleedRate(Schema):
    """How fast a locked shock arrestor gives way: the speed under a constant force."""

    force: q.PositiveForce
    """Constant force, as a rule the rated one."""
    speed: q.Speed
    """Speed with which the locked arrestor moves under this force; proportional to the force."""


class ShockArrestor(Schema):
    """A device that is free while it moves slowly and locks when it moves fast, in both directions."""

    kind: Literal["shock_arrestor"] = "shock_arrestor"
    """Free below a speed, a spring that bleeds above it: a shock arrestor, which nuclear piping calls a snubber."""
    locking_speed: q.Speed
    """Speed of extension or compression at which it locks: its locking velocity."""
    stiffness: q.Stiffness
    """Stiffness while it is locked."""
    bleed: BleedRate
    """Bleed rate while it is locked: {force: 10 kN, speed: 1 mm/s}."""

    linear_stiffness: ClassVar[float] = 0.0
    """Stiffness in the linear model: 0, since it is free at rest."""


class LinearGroundSpring(LinearSpring, SpringToGround):
    """A linear spring to the fixed ground."""


class CubicGroundSpring(CubicSpring, SpringToGround):
    """A cubic spring to the fixed ground."""


class PiecewiseLinearGroundSpring(PiecewiseLinearSpring, SpringToGround):
    """A piecewise-linear spring to the fixed ground."""


class GroundShockArrestor(ShockArrestor, SpringToGround):
    """A shock arrestor to the fixed ground."""


class LinearLinkSpring(LinearSpring, SpringBetween):
    """A linear spring between two points or masses."""


class CubicLinkSpring(CubicSpring, SpringBetween):
    """A cubic spring between two points or masses."""


class PiecewiseLinearLinkSpring(PiecewiseLinearSpring, SpringBetween):
    """A piecewise-linear spring between two points or masses."""


class LinkShockArrestor(ShockArrestor, SpringBetween):
    """A shock arrestor between two points or masses."""


GroundSpring = Annotated[
    LinearGroundSpring | CubicGroundSpring | PiecewiseLinearGroundSpring | GroundShockArrestor, BY_FORM
]
LinkSpring = Annotated[LinearLinkSpring | CubicLinkSpring | PiecewiseLinearLinkSpring | LinkShockArrestor, BY_FORM]


ForcePoint = tuple[q.Gap, q.Force]
"""Deflection and force."""
ForcePoints = tuple[ForcePoint, ...]

_START = "subtract the gap or the preload from the measured curve, and give it with gap or preload"


class SegmentFit(Schema):
    """A piecewise-linear curve fitted to measured points."""

    segments: Annotated[int, q.WholeNumber(1, 50)]
    """Number of straight lines."""


class GeneratedForces(Schema):
    """A smooth law, computed by a table with a stated error."""

    range: q.Length
    """Penetration up to which the error of the table is stated; a warning says if a motion exceeds it."""
    tolerance: Annotated[float, q.Quantity(units.RATIO, minimum=1e-5, maximum=0.1)] = 0.01
    """Largest error of the force up to the range, relative to the force there; 1 % by default."""
    segments: Annotated[int, q.WholeNumber(1, 200)] | None = None
    """Number of straight lines, instead of tolerance."""

    def check(self) -> None:
        """Refuse a number of segments in addition to a tolerance."""
        self.exclude("segments", "tolerance")

    @property
    def power(self) -> tuple[float, float]:
        """Exponent, and force at the range, N."""
        raise NotImplementedError


class PowerLaw(GeneratedForces):
    """Force proportional to a power of the penetration."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("exponent",)

    exponent: Annotated[float, q.Quantity(units.NUMBER, minimum=0.5, maximum=10.0)]
    """Exponent: 1.5 for spheres, above 1 for a stop that stiffens, below 1 for one that softens."""
    point: ForcePoint
    """A penetration and the force there."""

    def check(self) -> None:
        """Refuse a straight line, and a point without a force."""
        super().check()
        if self.exponent == 1.0:
            raise InvalidValueError("= 1 is a spring", "give stiffness instead", ("exponent",))
        if min(self.point) <= 0.0:
            remedy = "give a penetration and a force that are positive: [0.2 mm, 400 N]"
            raise InvalidValueError("is not on a curve that rises from zero", remedy, ("point",))

    @property
    def power(self) -> tuple[float, float]:
        """Exponent, and force at the range, N."""
        deflection, force = self.point
        return self.exponent, force * (self.range / deflection) ** self.exponent


class HertzLaw(GeneratedForces):
    """Contact of two spheres, or of a sphere and a plane, by Hertz: ``F = 4/3 E* sqrt(R) delta^1.5``."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("radius",)

    radius: q.Length
    """R, the radius of a sphere on a plane; of two spheres 1/R = 1/R1 + 1/R2."""
    modulus: q.Modulus
    """E*, with 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2: 115 GPa for steel on steel."""

    @property
    def power(self) -> tuple[float, float]:
        """Exponent, and force at the range, N."""
        return 1.5, 4.0 / 3.0 * self.modulus * math.sqrt(self.radius) * self.range**1.5


class MeasuredForces(Schema):
    """A force-deflection curve, from a file or from points, optionally fitted, or of a smooth law."""

    file: q.FileName | None = None
    """CSV file, relative to the scenario's folder; its headings contain units: deflection (mm), force (N), time (s)."""
    columns: tuple[q.Text, ...] = ()
    """Headings of the columns to use, if several have the same dimension: [extensometer]."""
    decimal: DecimalMark | None = None
    """Decimal mark in a text file, "." or ","; by default detected from the numbers."""
    points: ForcePoints | None = None
    """Pairs of deflection and force, instead of a file."""
    smooth: Annotated[PowerLaw | HertzLaw, BY_FORM] | None = None
    """A law that is not piecewise linear, instead of a file: {exponent, point} for a power of the penetration, or
    {radius, modulus} for contact by Hertz, each with range and tolerance."""
    fit: SegmentFit | None = None
    """Fit a rising piecewise-linear curve through zero with this number of segments; by default the points are used as
    they are."""
    scale: q.PositiveNumber = 1.0
    """Factor of all forces; studies can vary it, and identify_stiffness.nonlinear can identify it."""
    segment_factors: tuple[q.PositiveNumber, ...] = ()
    """Factor of the stiffness of each segment, from the first; 1 by default. Studies can vary them, and
    identify_stiffness.nonlinear can identify them from vibrations at several levels."""

    def check(self) -> None:
        """Require a file, points or a smooth law; points that are not fitted must be a rising curve from zero."""
        if sum(source is not None for source in (self.file, self.points, self.smooth)) != 1:
            remedy = "give file: pad.csv, points: [[0 mm, 0 N], [1 mm, 9 N]], or smooth: {...}"
            raise InvalidValueError("needs one of file, points and smooth", remedy)
        if self.smooth is not None:
            self.exclude("smooth", "columns", "decimal", "fit")
        if self.points is not None and self.fit is None:
            check_points(self.points, ("points",), may_fall=True)
        elif self.points is not None and len(self.points) < 2:
            raise InvalidValueError("has too few points to fit", "measure more points", ("points",))


def check_points(
    points: ForcePoints, path: Path = (), units: tuple[str, str] = ("m", "N"), *, may_fall: bool = False
) -> None:
    """Refuse points that are not a curve from zero, which rises unless it may fall.

    Parameters
    ----------
    points : (k,) deflections and forces.
    path : path of the points.
    units : of both, for messages.
    may_fall : whether the force may fall, to a positive one with which the curve goes on.
    """
    way, push = units
    if len(points) < 2:
        raise InvalidValueError(
            f"has {count_text(len(points), 'point')}",
            "give zero and at least one more: [[0 mm, 0 N], [1 mm, 9 N]]",
            path,
        )
    if points[0] != (0.0, 0.0):
        near = abs(points[0][0]) <= 0.05 * points[-1][0] and abs(points[0][1]) <= 0.05 * points[-1][1]
        falls = any(x >= after or force > rising for (x, force), (after, rising) in pairwise(points))
        remedy = "where it is noise, add fit: {segments: 5}" if near or falls else _START
        raise InvalidValueError(
            f"starts at {points[0][0]:g} {way}, {points[0][1]:g} {push} instead of zero", remedy, (*path, 0)
        )
    demand_rising(
        (x for x, _ in points), way, lambda k: (*path, k, 0),
        "list the points by increasing deflection, each once; give measured loops with fit: {segments: 5}",
    )  # fmt: skip
    for index, ((_, force), (_, following)) in enumerate(pairwise(points), start=1):
        remedy = "a force that falls needs unloading: {stiffness: ...} without a curve; where it is noise, add fit"
        if may_fall and following > 0.0:
            remedy = "add a last point with the same force: the curve continues with its last slope"
        elif may_fall:
            remedy = "give the force that remains, above zero; where it is noise, add fit: {segments: 5}"
        refused = not may_fall or following <= 0.0 or index == len(points) - 1
        if following < force and refused:
            raise InvalidValueError(
                f"= {following:g} {push} falls below the one before, {force:g} {push}", remedy, (*path, index, 1)
            )
    if points[-1][1] == 0.0:
        raise InvalidValueError(
            "has no force at all", "give the force at the largest deflection", (*path, len(points) - 1, 1)
        )


ForceDeflection = Annotated[
    ForcePoints | q.FileName | MeasuredForces,
    BY_FORM,
]
"""Pairs, the name of a file, or either of them with a fit."""


class SnubberRatioDamping(RatioDamping):
    """Dashpot given by a damping ratio: c = 2 ratio k / Omega.

    Omega is the first natural frequency with only this snubber closed. The closed mode has this damping ratio only if
    the snubber stores all of its energy; docs/stops.md explains which form suits which stop.
    """

    kind: Literal["ratio"] = "ratio"
    """Dashpot given by a damping ratio."""
    ratio: q.Ratio
    """Damping ratio of the first natural frequency with only this snubber closed."""


class SnubberViscousDamping(Schema):
    """Dashpot given by its coefficient."""

    kind: Literal["viscous"] = "viscous"
    """Dashpot given by its coefficient."""
    coefficient: q.Dashpot
    """Force per unit velocity while in contact."""


SnubberDamping = Annotated[SnubberRatioDamping | SnubberViscousDamping, BY_FORM]


class Hardening(Schema):
    """A stop that stays crushed: bilinear force with kinematic hardening."""

    yield_force: q.PositiveForce
    """Contact force at which it first yields."""
    stiffness: q.Stiffness
    """Stiffness while it yields; smaller than the elastic stiffness."""


class Unloading(Schema):
    """A stop whose force is smaller on unloading than on loading."""

    stiffness: q.Stiffness
    """Stiffness at the beginning of unloading and of reloading, until the force reaches the other curve."""
    force_deflection: ForcePoints | None = None
    """Force-deflection curve of unloading, from zero: [[0 mm, 0 N], [1 mm, 4 N], ...]. Without it the stop does not
    recover: it stays crushed by the deflection at which the unloading force reaches zero."""


StopLaw = Literal["kelvin_voigt", "no_tension", "limited_damping", "damping_on_approach"]


class SnubberBase(Named):
    """Common part of all snubbers; by default N = k delta + c delta' while in contact."""

    units: ClassVar[tuple[str, str]] = ("m", "N")
    stiffness_example: ClassVar[str] = "151.1 kN/m"

    stiffness: q.StopStiffness | None = None
    """Stiffness in contact; either this or force_deflection is required."""
    force_deflection: ForceDeflection | None = None
    """Force over penetration, instead of stiffness: [[0 mm, 0 N], [1 mm, 9 N], ...], a CSV file, {file: pad.csv,
    fit: {segments: 5}}, or {smooth: {...}} for Hertz and other powers; the curve continues with its last slope."""
    damping: SnubberDamping | None = None
    """Dashpot parallel to the spring; none by default."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches parallel to the spring or the curve, any number of them; they require law: no_tension."""
    hardening: Hardening | None = None
    """Yielding of the spring, after which the stop stays crushed; none by default."""
    unloading: Unloading | None = None
    """Separate unloading: with a stiffness alone the stop stays crushed, and the force of its table may fall; with a
    curve it recovers; none by default."""
    gap_: q.Gap | None = Field(default=None, alias="gap")
    """Clearance: positive is play, negative is prestress; 0 by default."""
    preload: q.PositiveForce | None = None
    """Contact force at static equilibrium, instead of gap."""
    law_: StopLaw | None = Field(default=None, alias="law")
    """kelvin_voigt: in contact while there is penetration; no_tension: in contact until the force would become tensile;
    limited_damping: the force of the dashpot is at most that of the spring; damping_on_approach: the dashpot acts only
    while the penetration grows. kelvin_voigt by default, no_tension with Maxwell branches."""
    latch: bool = False
    """If true, the stop locks permanently at its first contact and then resists in both directions."""

    def check(self) -> None:
        """Require a stiffness or a curve; refuse gap together with preload."""
        super().check()
        if self.stiffness is None or self.force_deflection is not None:
            self._check_force()
        if self.hardening is not None or self.unloading is not None:
            self._check_yielding()
        if self.limits_dashpot:
            self._check_dashpot()
        if self.maxwell:
            self._check_relaxing()
        if self.latch:
            self._check_latch()
        if self.preload is not None:
            gap = self.key_of("gap_")
            self.exclude("preload", gap, remedy=f"keep one of the two; the {gap} follows from the preload")

    def _check_dashpot(self) -> None:
        if self.damping is None:
            raise InvalidValueError(
                "is missing",
                f"law: {self.law} says how the dashpot acts: give damping, or leave the law out",
                ("damping",),
            )
        used = [key for key in ("force_deflection", "maxwell", "hardening", "unloading", "latch") if getattr(self, key)]
        if used:
            raise InvalidValueError(
                f"= {self.law} does not go with {self.key_of(used[0])}",
                "this law has a stiffness and damping only: leave one of the two out", ("law",),
            )  # fmt: skip

    def _check_relaxing(self) -> None:
        if self.law != "no_tension":
            remedy = "write law: no_tension, or leave law out: a pad that pulls has no face that recovers"
            raise InvalidValueError(f"= {self.law} does not go with maxwell", remedy, ("law",))

    def _check_latch(self) -> None:
        if self.law == "no_tension":
            raise InvalidValueError(
                "does not go with law: no_tension", "leave one of the two out: a latch pulls as well", ("latch",)
            )
        remedy = "leave one of the two out: a latch is a spring that acts in both directions"
        self.exclude("latch", self.key_of("force_deflection"), "maxwell", "hardening", "unloading", remedy=remedy)

    def _check_force(self) -> None:
        table = self.key_of("force_deflection")
        if self.force_deflection is None:
            if self.stiffness is None:
                example = f"give for example stiffness: {self.stiffness_example}, or {table}"
                raise InvalidValueError("is missing", example, ("stiffness",))
            return
        self.exclude(table, "stiffness")
        given = self.force_deflection
        if isinstance(given, tuple):
            check_points(given, (table,), self.units, may_fall=self.may_fall)
        elif isinstance(given, MeasuredForces) and given.points is not None and given.fit is None:
            check_points(given.points, (table, "points"), self.units, may_fall=self.may_fall)

    def _check_yielding(self) -> None:
        if self.hardening is not None:
            self._check_hardening(self.hardening)
        if self.yields and self.damping is not None and self.law == "no_tension":
            remedy = "leave damping out, which makes no difference to never pulling, or write law: kelvin_voigt"
            raise InvalidValueError(f"does not go with law: no_tension and {self.memory}", remedy, ("damping",))
        if self.unloading is not None:
            self._check_unloading(self.unloading)

    def _check_hardening(self, hardening: Hardening) -> None:
        remedy = "leave one of the two out: a stop that yields has one stiffness before and one after"
        self.exclude("hardening", self.key_of("force_deflection"), "maxwell", remedy=remedy)
        unit, after = "/".join(reversed(self.units)), hardening.stiffness
        if self.stiffness is not None and after >= self.stiffness:
            raise InvalidValueError(
                f"= {after:g} {unit} is not below the snubber's stiffness, {self.stiffness:g} {unit}",
                "give the smaller stiffness beyond the yield force, for example a tenth", ("hardening", "stiffness"),
            )  # fmt: skip

    def _check_unloading(self, unloading: Unloading) -> None:
        self.exclude("unloading", "maxwell", "hardening", remedy="keep one: each is another loss of the same stop")
        if unloading.force_deflection is not None:
            key = unloading.key_of("force_deflection")
            check_points(unloading.force_deflection, ("unloading", key), self.units)

    @property
    def memory(self) -> str:
        """The key that makes the force depend on the history of the motion; empty if there is none."""
        return next((key for key in ("maxwell", "hardening", "unloading") if getattr(self, key)), "")

    @property
    def yields(self) -> bool:
        """Whether it dissipates energy even in slow motion."""
        return self.hardening is not None or self.unloading is not None

    @property
    def may_fall(self) -> bool:
        """Whether the force of the table may fall: where the stop stays crushed."""
        return self.unloading is not None and self.unloading.force_deflection is None

    @property
    def gap(self) -> float | None:
        """Clearance, m or rad; None if it follows from the preload."""
        return None if self.preload is not None else self.gap_ or 0.0

    @property
    def law(self) -> StopLaw:
        """How the dashpot acts, and the condition that ends contact."""
        return self.law_ or ("no_tension" if self.maxwell else "kelvin_voigt")

    @property
    def limits_dashpot(self) -> bool:
        """Whether the dashpot acts in part only."""
        return self.law_ is not None and self.law_ not in ("kelvin_voigt", "no_tension")

    @property
    def table(self) -> MeasuredForces:
        """The force-deflection curve in its long form, of a stop that has one."""
        given = self.force_deflection
        assert given is not None
        if isinstance(given, MeasuredForces):
            return given
        return MeasuredForces(file=given) if isinstance(given, str) else MeasuredForces(points=given)

    @property
    def stops(self) -> tuple[Self, ...]:
        """The stop itself, as a tuple."""
        return (self,)


class SnubberAtPlaces(SnubberBase):
    """A snubber with a place of its own."""

    if TYPE_CHECKING:
        places: Any

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning if the gap is larger than the structure can deflect."""
        owner, all_bodies = scenario.body_at(path) or scenario.default_body, scenario.all_bodies
        named = [place.body or owner for place in self.places]
        bodies = [all_bodies[name] for name in named if name in all_bodies]
        largest = min((min(of.largest_deflection, 10.0 * of.depth or math.inf) for of in bodies), default=math.inf)
        if self.gap is not None and abs(self.gap) > largest:
            meant = scenario.unit_written((*path, "gap"), self.gap, units.LENGTH) in ("", "m")
            yield _large_gap((*path, "gap"), self.gap, largest) + (f"; was {self.gap:g} mm meant?" if meant else "")


def _large_gap(path: Path, gap: float, largest: float) -> str:
    """A warning that a gap, m, is larger than structures usually deflect."""
    return (
        f"{path_text(path)} = {gap:g} m is a large {'gap' if gap > 0 else 'prestress'} for a structure of this size "
        f"(more than {largest:.3g} m)"
    )


_SIDES: tuple[Literal["above", "below"], ...] = ("above", "below")


class Snubber(PlacedItem, SnubberAtPlaces):
    """A one-sided spring, optionally with a dashpot, between a point of a body and the base or the ground."""

    side: Literal["below", "above", "both"]
    """below resists negative displacements, above positive ones; both makes a pair of stops, NAME.above and
    NAME.below."""
    mounted_on: Annotated[Literal["base", "ground"] | SupportMounting, BY_FORM] = "base"
    """base: moves with the base excitation; ground: fixed; {support: left}: moves with this support of a body, in the
    direction of the stop, if the excitation moves the support."""

    @property
    def stops(self) -> tuple[Self, ...]:
        """The stop itself, or both stops of a pair."""
        if self.side != "both":
            return (self,)
        return tuple(self.model_copy(update={"side": side, "name": f"{self.name}.{side}"}) for side in _SIDES)


class LinkSnubber(BetweenPlaces, SnubberAtPlaces):
    """A one-sided spring, optionally with a dashpot, between points of two bodies or of one."""

    between: TwoPlaces
    """The two places. The first lies below the second; for masses of a chain the first is the lower number."""
    resists: Literal["approach", "separation"] = "approach"
    """approach: a stop, which closes when the first place moves up towards the second; separation: a cable, which
    becomes taut when they move apart."""


AnySnubber = Annotated[Snubber | LinkSnubber, BY_FORM]


WearRate = Annotated[float, q.Quantity(units.WEAR_RATE, above=0.0)]


class FrictionCoefficients(Schema):
    """Coefficients of friction (friction force over normal force)."""

    static: q.PositiveNumber
    """Static coefficient, up to which the contact sticks."""
    sliding: q.Ratio
    """Coefficient during sliding; not larger than the static one."""
    stribeck_speed: q.Speed | None = None
    """Sliding speed above which the coefficient is the sliding one; below it falls linearly from the static one. By
    default it drops at once."""

    def check(self) -> None:
        """Require that the sliding coefficient is not larger than the static one."""
        if self.sliding > self.static:
            raise InvalidValueError(
                f"= {self.sliding:g} is above static = {self.static:g}", "exchange them, or give one coefficient",
                ("sliding",),
            )  # fmt: skip


class SnubberForce(Schema):
    """The force of a snubber as normal force: it varies with the motion and is zero while the snubber is open."""

    snubber: q.Name
    """Name of the snubber."""


class FrictionBase(Named):
    """Common part of all friction contacts: friction force at most the coefficient times the normal force."""

    kind: ClassVar[str] = "friction"

    normal_force: Annotated[q.PositiveForce | SnubberForce, BY_FORM]
    """Normal force: a constant, or {snubber: NAME} for the force of a snubber."""
    coefficient: Annotated[
        q.PositiveNumber | FrictionCoefficients,
        BY_FORM,
    ]
    """Coefficient of friction: one number, or {static: 0.3, sliding: 0.2}."""
    stiffness: q.Stiffness | None = None
    """Tangential stiffness while it sticks; rigid by default."""
    start: Annotated[Literal["unstressed"] | q.Force, BY_FORM] = "unstressed"
    """Friction force at the start of a motion, which depends on the history: unstressed, or a force that resists a
    positive displacement. The static equilibrium includes this force."""
    wear_rate: WearRate | None = None
    """Worn volume per normal force and sliding distance (Archard); no wear is computed by default."""

    @property
    def pressed_by(self) -> str | None:
        """Name of the snubber that gives the normal force; None if the normal force is constant."""
        return self.normal_force.snubber if isinstance(self.normal_force, SnubberForce) else None

    @property
    def constant_force(self) -> float:
        """The constant normal force, N; nan if a snubber gives it."""
        return math.nan if isinstance(self.normal_force, SnubberForce) else self.normal_force

    @property
    def coefficients(self) -> FrictionCoefficients:
        """The coefficients in their long form."""
        given = self.coefficient
        return given if isinstance(given, FrictionCoefficients) else FrictionCoefficients(static=given, sliding=given)

    @property
    def static_force(self) -> float:
        """Largest friction force while it sticks, N; nan if a snubber gives the normal force."""
        return self.constant_force * self.coefficients.static

    @property
    def sliding_force(self) -> float:
        """Friction force during sliding, N; nan if a snubber gives the normal force."""
        return self.constant_force * self.coefficients.sliding

    @property
    def start_force(self) -> float:
        """Friction force at the start of a motion, N."""
        return 0.0 if isinstance(self.start, str) else self.start

    def check(self) -> None:
        """Refuse a start force above the static limit, and invalid combinations with a variable friction force."""
        super().check()
        if self.coefficients.stribeck_speed is not None and (self.pressed_by is not None or self.stiffness is not None):
            other = "the normal force of a snubber" if self.stiffness is None else "stiffness"
            remedy = "leave it out: the coefficient then falls at once"
            raise InvalidValueError(f"does not go with {other}", remedy, ("coefficient", "stribeck_speed"))
        if self.pressed_by is not None:
            if self.start != "unstressed":
                raise InvalidValueError(
                    "does not go with the normal force of a snubber, which may be open at the start",
                    "leave start out", ("start",),
                )  # fmt: skip
        elif abs(self.start_force) >= self.static_force:
            limit = "coefficient times normal_force"
            raise InvalidValueError(
                f"= {self.start_force:g} N is too large: the contact sticks only below "
                f"{limit} = {self.static_force:g} N",
                "give a smaller force, or unstressed", ("start",),
            )  # fmt: skip

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The place, or both places."""
        raise NotImplementedError

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown snubber as normal force, or one that can pull."""
        yield from super().problems(scenario, path)
        if self.pressed_by is not None:
            yield from self._problems_of_pressing(scenario, path, self.pressed_by)

    def _problems_of_pressing(self, scenario: Whole, path: Path, name: str) -> Problems:
        snubbers = {snubber.name: snubber for snubber in scenario.all_snubbers}
        where = (*path, "normal_force")
        yield from unknown((*where, "snubber"), name, "snubber", snubbers, "there is no snubber: give a force")
        if name not in snubbers:
            return
        damped = snubbers[name].damping is not None
        if damped and snubbers[name].law != "no_tension":
            remedy = "leave the snubber's damping out" if snubbers[name].yields else "give the snubber law: no_tension"
            why = "may pull, since its dashpot acts while it opens"
            if snubbers[name].limits_dashpot:
                why = f"has law: {snubbers[name].law}, which is not available as a normal force"
            yield problem(where, f"= the force of {name} {why}", remedy)
        elif damped and self.stiffness is not None:
            yield problem(
                (*path, "stiffness"),
                f"does not go with the force of {name}: the slider behind a tangential spring follows the rate of the "
                "force, and that of a dashpot depends on accelerations",
                "leave stiffness out, or give the snubber maxwell branches instead of its damping",
            )  # fmt: skip
        rigid = [contact.name for _, _, contact, _ in scenario.listed("friction") if contact.stiffness is None]
        if self.stiffness is None and len(rigid) > 1:
            others = ", ".join(other for other in rigid if other != self.name)
            yield problem(
                (*path, "stiffness"), f"is missing, and {others} sticks without a spring as well",
                "give the contact a tangential stiffness",
            )  # fmt: skip


class FrictionAtPlace(PlacedItem, FrictionBase):
    """Dry friction at a place, against the base or the ground, in the direction of the place's displacement."""

    mounted_on: Literal["base", "ground"] = "base"
    """base: the counterface moves with the base excitation; ground: it is fixed."""


class FrictionBetween(BetweenPlaces, FrictionBase):
    """Dry friction between points of two bodies or of one."""

    between: TwoPlaces
    """The two places; at a positive extension the friction force on the second points to the first."""


AnyFriction = Annotated[FrictionAtPlace | FrictionBetween, BY_FORM]


JointEnd = Annotated[
    BaseOrPlace,
    Variants(
        "names neither a point of a body nor the base",
        "write {body: panel, position: 0 mm}, {body: chain, mass: 2} or base",
    ),
]


class Joint(Named):
    """Common part of all joints."""

    between: Annotated[tuple[JointEnd, ...], TWO_ITEMS]
    """Two points of bodies, or a point and base."""

    def check(self) -> None:
        """Require two different ends, at least one of them on a body."""
        if self.between[0] == self.between[1]:
            raise InvalidValueError("joins a point to itself", "name two different points", ("between",))
        refuse_unlike_directions(self.places)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The points on bodies, one or two."""
        return tuple(end for end in self.between if isinstance(end, AtPlace))

    @property
    def transmits_moment(self) -> bool:
        """Whether the joint transmits a moment between its ends."""
        return False

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a rotation of points that have no slope; a body that is joined to itself."""
        bodies = scenario.all_bodies
        names = [place.body or scenario.default_body for place in self.places]
        for name in names:
            if name in bodies and not bodies[name].has_slope and self.transmits_moment:
                yield problem(
                    path,
                    f"acts on the rotation of {name}, but the points of a {bodies[name].body_kind} only deflect",
                    "use kind: hinge, or kind: spring with stiffness alone",
                )
        itself = len(names) == 2 and names[0] == names[1] and names[0] in bodies
        if itself and getattr(self, "kind", "") != "spring" and bodies[names[0]].has_slope:
            message = f"joins {names[0]} to itself: its two points cannot move relative to each other"
            yield problem(path, message, "use kind: spring")

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning if the joined points do not coincide."""
        for apart in place_bodies(scenario.joints, scenario.all_bodies, scenario.default_body).joint_gaps:
            if ("joints", apart.index) == path:
                yield (
                    f"{path_text(path)} joins points {1e3 * apart.distance:g} mm apart, since the joints before it "
                    f"place {apart.second_body}: it acts as if they coincided; check its positions"
                )


class HingeMaxwell(Maxwell):
    """A Maxwell branch of a hinge, between rotations."""

    stiffness: q.RotationalStiffness
    """Stiffness of its spring: the additional stiffness at a sudden rotation."""


class HingeViscousDamping(SnubberViscousDamping):
    """Dashpot given by its coefficient."""

    coefficient: q.RotationalDashpot
    """Moment per angular velocity in contact."""


class HingeHardening(Hardening):
    """A stop that stays crushed: bilinear moment with kinematic hardening."""

    yield_force: q.PositiveMoment = Field(alias="yield_moment")
    """Contact moment at which it first yields."""
    stiffness: q.RotationalStiffness
    """Stiffness while it yields; smaller than the elastic stiffness."""


class HingeUnloading(Unloading):
    """A stop whose moment is smaller on unloading than on loading."""

    stiffness: q.RotationalStiffness
    """Stiffness at the beginning of unloading and of reloading, until the moment reaches the other curve."""
    force_deflection: tuple[tuple[q.Angle, q.Moment], ...] | None = Field(default=None, alias="moment_angle")
    """Moment-angle curve of unloading, from zero. Without it the stop stays crushed."""


class HingeElement(Schema):
    """Common part of stops and friction of a hinge, which act between the rotations of its two sides."""

    units: ClassVar[tuple[str, str]] = ("rad", "N m")
    _places: tuple[AtPlace, ...] = ()

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The places of the hinge."""
        return self._places

    probed_places: ClassVar[tuple[AtPlace, ...]] = ()
    """None: a probe records displacements."""

    def place_bodies(self, name: str, places: tuple[AtPlace, ...]) -> Self:
        """A copy with a name, at the places of its hinge."""
        copy = self.model_copy(update={"name": name})
        copy._places = places
        return copy


class HingeStop(HingeElement, SnubberBase):
    """A stop of a hinge: the laws of snubbers, with moment over angle."""

    stiffness_example: ClassVar[str] = "2 kN m/rad"

    gap_: q.Angle | None = Field(default=None, alias="angle")
    """Angle of the hinge at which the stop closes, 0 by default. The angle is the slope of the second point minus that
    of the first; for a hinge to the base it is the slope of the point."""
    side_: Literal["above", "below"] | None = Field(default=None, alias="side")
    """above resists larger angles, below smaller ones; by default below for a negative angle, else above."""
    stiffness: q.RotationalStiffness | None = None
    """Moment per angle in contact; either this or moment_angle is required."""
    force_deflection: tuple[tuple[q.Angle, q.Moment], ...] | None = Field(default=None, alias="moment_angle")
    """Moment over the angle beyond contact, instead of stiffness: [[0 deg, 0 N m], [1 deg, 9 N m], ...]; the curve
    continues with its last slope."""
    damping: Annotated[SnubberRatioDamping | HingeViscousDamping, BY_FORM] | None = None
    """Dashpot parallel to the spring; none by default."""
    maxwell: tuple[HingeMaxwell, ...] = ()
    """Maxwell branches parallel to the spring or the curve, any number of them; they require law: no_tension."""
    hardening: HingeHardening | None = None
    """Yielding of the spring, after which the stop stays crushed; none by default."""
    unloading: HingeUnloading | None = None
    """Separate unloading: with a stiffness alone the stop stays crushed, with a curve it recovers; none by default."""
    preload: q.PositiveMoment | None = None
    """Contact moment at static equilibrium, instead of angle."""

    @property
    def side(self) -> Literal["above", "below"]:
        """The direction that it resists."""
        return self.side_ or ("below" if (self.gap_ or 0.0) < 0.0 else "above")

    @property
    def gap(self) -> float | None:
        """Angle of the clearance, rad; None if it follows from the preload."""
        gap = super().gap
        return -gap if gap and self.side == "below" else gap


class HingeFrictionMoments(Schema):
    """Dry friction of a hinge."""

    moment: q.PositiveMoment
    """Static friction moment, up to which the hinge sticks."""
    sliding: Annotated[float, q.Quantity(units.MOMENT, minimum=0.0)] | None = None
    """Friction moment during rotation, not larger than the static one; equal to it by default."""
    stiffness: q.RotationalStiffness | None = None
    """Rotational stiffness while it sticks; rigid by default."""

    def check(self) -> None:
        """Require that the sliding moment is not larger than the static one."""
        if self.sliding is not None and self.sliding > self.moment:
            remedy = "exchange them, or give one moment"
            raise InvalidValueError(
                f"= {self.sliding:g} N m is above moment = {self.moment:g} N m", remedy, ("sliding",)
            )


class HingeFriction(HingeElement, FrictionBase):
    """The friction of a hinge as a contact; its moment replaces the product of coefficient and normal force."""

    @classmethod
    def of(cls, moments: HingeFrictionMoments) -> Self:
        """The contact of a hinge's friction, unstressed at the start."""
        sliding = moments.moment if moments.sliding is None else moments.sliding
        coefficient = FrictionCoefficients(static=1.0, sliding=sliding / moments.moment)
        return cls.model_construct(normal_force=moments.moment, coefficient=coefficient, stiffness=moments.stiffness)


class RigidJoint(Joint):
    """Deflection and slope are equal on both sides."""

    kind: Literal["rigid"] = "rigid"
    """Couples deflection and slope."""

    transmits_moment: ClassVar[bool] = True
    """Always."""


class _RotatingJoint(Joint):
    rotational_stiffness: q.RotationalStiffness = 0.0
    """Moment per difference of the slopes; none by default."""
    rotational_dashpot: q.RotationalDashpot = 0.0
    """Moment per difference of their rates; none by default."""

    @property
    def linear_rotation(self) -> float:
        """Rotational stiffness that acts at any angle, N m/rad."""
        return self.rotational_stiffness

    @property
    def transmits_moment(self) -> bool:
        """Whether it has a rotational spring or dashpot."""
        return self.rotational_stiffness > 0.0 or self.rotational_dashpot > 0.0


_LARGEST_ANGLE = 0.35  # rad, of a hinge


class HingeJoint(_RotatingJoint):
    """The deflection is equal on both sides; the slopes may differ."""

    kind: Literal["hinge"] = "hinge"
    """Couples the deflection."""
    free_play: q.FreePlay = 0.0
    """Total angle of free play, centred on zero, within which the rotational stiffness does not act; none by
    default."""
    stops: Annotated[tuple[HingeStop, ...], NUMBERED] = ()
    """End stops, each at an angle, with the laws of snubbers."""
    friction: HingeFrictionMoments | None = None
    """Dry friction; none by default."""

    def check(self) -> None:
        """Refuse free play without a spring."""
        super().check()
        if self.free_play and not self.rotational_stiffness:
            remedy = "give the rotational_stiffness that acts beyond the play"
            raise InvalidValueError("needs a spring, but there is none", remedy, ("free_play",))

    @property
    def linear_rotation(self) -> float:
        """Rotational stiffness that acts at any angle, N m/rad."""
        return 0.0 if self.free_play else self.rotational_stiffness

    @property
    def transmits_moment(self) -> bool:
        """Whether anything acts on its rotation."""
        return super().transmits_moment or bool(self.stops) or self.friction is not None

    @property
    def all_stops(self) -> tuple[tuple[Path, HingeStop], ...]:
        """Its stops with their paths below the joint; a spring with free play is a pair of stops."""
        stops: list[tuple[Path, HingeStop]] = [(("stops", k), stop) for k, stop in enumerate(self.stops)]
        for side in _SIDES if self.free_play else ():
            angle = math.copysign(0.5 * self.free_play, 1.0 if side == "above" else -1.0)
            play = {"name": f"play.{side}", "stiffness": self.rotational_stiffness, "angle": angle, "side": side}
            stops.append((("free_play",), HingeStop.model_validate(play)))
        return tuple((path, stop.place_bodies(f"{self.name}.{stop.name}", self.places)) for path, stop in stops)

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning about stops at large angles."""
        yield from super().find_warnings(scenario, path)
        for place, stop in self.all_stops:
            if stop.gap is not None and abs(stop.gap) > _LARGEST_ANGLE:
                meant = scenario.unit_written((*path, *place, "angle"), stop.gap, units.ANGLE) in ("", "rad")
                yield (
                    f"{path_text((*path, *place))} is met at {math.degrees(abs(stop.gap)):.3g} deg, beyond the theory "
                    f"of small rotations (more than {math.degrees(_LARGEST_ANGLE):.3g} deg)"
                    + (f"; was {stop.gap:.3g} deg meant?" if meant else "")
                )

    @property
    def all_friction(self) -> tuple[tuple[Path, HingeFriction], ...]:
        """Its friction contact, if it has one, with the path below the joint."""
        if self.friction is None:
            return ()
        return ((("friction",), HingeFriction.of(self.friction).place_bodies(f"{self.name}.friction", self.places)),)


class SpringJoint(_RotatingJoint):
    """Springs and dashpots between the deflections and between the slopes."""

    kind: Literal["spring"] = "spring"
    """Couples the sides by springs and dashpots only."""
    stiffness: q.NonNegativeStiffness = 0.0
    """Force per difference of the deflections; none by default."""
    dashpot: q.Dashpot = 0.0
    """Force per difference of the velocities; none by default."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches between the deflections, any number of them."""

    def check(self) -> None:
        """Require at least one spring or dashpot."""
        super().check()
        if not (self.stiffness or self.dashpot or self.transmits_moment or self.maxwell):
            raise InvalidValueError(
                "has neither a stiffness nor a dashpot", "give stiffness: 10 kN/m, or leave the joint out"
            )


AnyJoint = Annotated[RigidJoint | HingeJoint | SpringJoint, BY_FORM]


@dataclass(frozen=True)
class JointGap:
    """A joint whose points do not coincide, after the joints before it have placed the bodies."""

    index: int  # number of the joint
    distance: float  # m along the bodies' common axis
    second_body: str  # body of the second point


@dataclass(frozen=True)
class BodyPlacement:
    """Positions of the bodies along one axis, as the joints place them: a joint makes its two points coincide.

    The first joint between two bodies decides; a joint that closes a loop may not fit.
    """

    origins: dict[str, float]  # m, start of each body
    groups: dict[str, str]  # for each body the first of the bodies that joints connect to it
    joint_gaps: tuple[JointGap, ...]

    @property
    def of_first_group(self) -> dict[str, float]:
        """Start, m, of each body that joints connect to the first one, which begins at 0."""
        leading = next(iter(self.origins), "")
        together = (name for name in self.origins if self.groups[name] == self.groups[leading])
        return {name: self.origins[name] - self.origins[leading] for name in together}


def place_bodies(joints: Sequence[Joint], bodies: Mapping[str, Body], default_body: str) -> BodyPlacement:
    """Place the bodies by their joints.

    Parameters
    ----------
    joints : in order.
    bodies : by name.
    default_body : body of places without the name of a body.

    Returns
    -------
    Placed
    """
    origin: dict[str, float] = {}
    group: dict[str, str] = {}
    apart: list[JointGap] = []
    for index, joint in enumerate(joints):
        named = [(place.body or default_body, place.position) for place in joint.places]
        ends = [
            (name, bodies[name].metres(position))
            for name, position in named
            if name in bodies and position is not None and not isinstance(position, tuple)
        ]
        if len(ends) != 2:
            continue
        (first, x), (second, y) = ends
        for name in (first, second):
            origin.setdefault(name, 0.0)
            group.setdefault(name, name)
        gap, merged = origin[first] + x - origin[second] - y, group[second]
        if group[first] != merged:
            for name in [name for name, label in group.items() if label == merged]:
                origin[name] += gap
                group[name] = group[first]
        elif first != second and abs(gap) > 1e-6 * max(x, y):
            apart.append(JointGap(index, abs(gap), second))
    return BodyPlacement(origin, group, tuple(apart))


def base_problems(scenario: Whole, path: Path, direction: str, motion: str) -> Problems:
    """Problems of a motion of the base: no point of a body moves, or a rotation of several bodies without joints.

    Parameters
    ----------
    path : path of the motion.
    path : where the motion is written.
    direction : x, y, z, or rx, ry, rz.
    motion : its name, for the message.

    Yields
    ------
    Problem
    """
    bodies = scenario.all_bodies
    for name, body in bodies.items():
        if direction not in body.base_directions:
            remedy = f"use {' or '.join(filter(None, body.base_directions))}"
            yield problem(path, f"{motion} moves no point of {name}, a {body.body_kind}", remedy)
    known = place_bodies(scenario.joints, bodies, scenario.default_body).of_first_group
    if direction.startswith("r") and len(bodies) > 1 and bodies.keys() - known.keys():
        yield problem(
            path, f"{motion} rotates several bodies, but joints do not define the positions of {', '.join(bodies)}",
            "join them by points of beams, or model them as one body",
        )  # fmt: skip
