"""One-sided elastic stops ("snubbers") on a beam, on the masses of a chain and between them."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Tag

from beamsim.scenario.base import BY_KIND, Path, Schema, Variants, fail
from beamsim.scenario.force_table import ForceDeflection, MeasuredForces, as_measured, check_points
from beamsim.scenario.maxwell import Maxwell
from beamsim.scenario.names import Named
from beamsim.scenario.place import AtPlace, BetweenPlaces, Sited, TwoPlaces
from beamsim.scenario.quantities import (
    Dashpot,
    Gap,
    MassNumber,
    Name,
    PositiveForce,
    Ratio,
    Stiffness,
)
from beamsim.scenario.spring import Pair, check_pair


class SnubberRatioDamping(Schema):
    """Dashpot by a damping ratio: c = 2 ratio k / Omega.

    Omega is the first natural frequency with only this snubber closed.
    """

    kind: Literal["ratio"] = "ratio"
    """Dashpot by a damping ratio."""
    ratio: Ratio
    """Damping ratio, of the first natural frequency with only this snubber closed."""


class SnubberViscousDamping(Schema):
    """Dashpot by its coefficient."""

    kind: Literal["viscous"] = "viscous"
    """Dashpot by its coefficient."""
    coefficient: Dashpot
    """Force per unit velocity while in contact."""


SnubberDamping = Annotated[SnubberRatioDamping | SnubberViscousDamping, BY_KIND]


class Hardening(Schema):
    """A stop that is crushed: bilinear force with kinematic hardening."""

    yield_force: PositiveForce
    """Contact force at which it begins to yield when it is loaded first."""
    stiffness: Stiffness
    """Stiffness while it yields, below that before."""


class SnubberBase(Named):
    """Common part of all snubbers; N = k delta + c delta' while in contact."""

    name: Name = ""
    """Name, unique; snubber_1, snubber_2, ... by default."""
    stiffness: Stiffness | None = None
    """Stiffness while in contact; this or force_deflection is needed."""
    force_deflection: ForceDeflection | None = None
    """Force over penetration instead of the stiffness: [[0 mm, 0 N], [1 mm, 9 N], ...], a CSV file, or {file: pad.csv,
    fit: {segments: 5}}; the last slope goes on."""
    damping: SnubberDamping | None = None
    """Dashpot parallel to the spring; none by default."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches beside the spring or the table, any number of them; they ask for law: no_tension."""
    hardening: Hardening | None = None
    """Yielding beside the stiffness, which leaves the stop crushed; none by default."""
    gap: Gap | None = None
    """Clearance: positive is backlash, negative prestress; 0 by default."""
    preload: PositiveForce | None = None
    """Contact force at static equilibrium, instead of gap."""
    law: Literal["kelvin_voigt", "no_tension"] = "kelvin_voigt"
    """Kelvin_voigt: contact as long as there is penetration; no_tension: contact until the force would be tensile; by
    default kelvin_voigt, no_tension with Maxwell branches."""

    def settle(self) -> None:
        """Demand a stiffness or a table; reject gap and preload together; the default gap is 0."""
        self._check_force()
        self._check_hardening()
        if self.maxwell and "law" not in self.model_fields_set:
            self.resolve("law", "no_tension")
        if self.maxwell and self.law != "no_tension":
            remedy = "write law: no_tension, or leave law out: a pad that pulls has no face that recovers"
            raise fail(f"= {self.law} does not go with maxwell", remedy, ("law",))
        if self.preload is None:
            if self.gap is None:
                self.resolve("gap", 0.0)
        elif self.gap is not None:
            raise fail(
                "and gap exclude each other", "keep one of the two; the gap follows from the preload", ("preload",)
            )

    def _check_force(self) -> None:
        if self.force_deflection is None:
            if self.stiffness is None:
                raise fail("is missing", "give for example stiffness: 151.1 kN/m, or force_deflection", ("stiffness",))
            return
        if self.stiffness is not None:
            raise fail("and stiffness exclude each other", "keep one of the two", ("force_deflection",))
        if isinstance(self.force_deflection, tuple):
            check_points(self.force_deflection, ("force_deflection",))

    def _check_hardening(self) -> None:
        if self.hardening is None:
            return
        for key, given in (("force_deflection", self.force_deflection), ("maxwell", self.maxwell)):
            if given:
                remedy = "leave one of the two out: a stop that yields has one stiffness before and one after"
                raise fail(f"and {key} exclude each other", remedy, ("hardening",))
        if self.stiffness is not None and self.hardening.stiffness >= self.stiffness:
            raise fail(
                f"= {self.hardening.stiffness:g} N/m is not below the snubber's stiffness, {self.stiffness:g} N/m",
                "give the smaller stiffness beyond the yield force, for example a tenth", ("hardening", "stiffness"),
            )  # fmt: skip
        if self.damping is not None and self.law == "no_tension":
            remedy = "leave damping out, which makes no difference to never pulling, or write law: kelvin_voigt"
            raise fail("does not go with law: no_tension and hardening", remedy, ("damping",))

    @property
    def table(self) -> MeasuredForces | None:
        """The force-deflection curve, where one is given."""
        return None if self.force_deflection is None else as_measured(self.force_deflection)

    @property
    def probed_places(self) -> tuple[AtPlace, ...]:
        """The places in the order in which they are written, where probes are by default."""
        return self.places

    @property
    def stops(self) -> tuple[Self, ...]:
        """Itself."""
        return (self,)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The place, or both places, the lower one first."""
        raise NotImplementedError

    @property
    def place_paths(self) -> tuple[Path, ...]:
        """Where each of the places is written, below the snubber."""
        return tuple(() for _ in self.places)


_SIDES: tuple[Literal["above", "below"], ...] = ("above", "below")


class _Stop(SnubberBase):
    """A snubber mounted on the base or on the ground."""

    side: Literal["below", "above", "both"]
    """Below resists negative displacements, above positive ones; both is a pair of stops, NAME.above and NAME.below."""
    mounted_on: Literal["base", "ground"] = "base"
    """Base: moves with the base excitation; ground: fixed."""

    @property
    def stops(self) -> tuple[Self, ...]:
        """Itself, or both stops of a pair."""
        if self.side != "both":
            return (self,)
        return tuple(self.model_copy(update={"side": side, "name": f"{self.name}.{side}"}) for side in _SIDES)


class Snubber(Sited, _Stop):
    """A one-sided spring, with or without dashpot, between a place of a body and the base or the ground."""

    def settle(self) -> None:
        """Demand exactly one place."""
        super().settle()
        _Stop.settle(self)


class BodySnubber(BetweenPlaces, SnubberBase):
    """A one-sided spring, with or without dashpot, between places of two bodies or of one."""

    between: TwoPlaces
    """The two places; the first lies below the second."""
    resists: Literal["approach", "separation"] = "approach"
    """Approach: a stop, met when the first moves up towards the second; separation: a cable, taut when they part."""


def choose_sites(value: Any) -> str:
    """Tag of a snubber of the scenario: at a place or between two."""
    between = isinstance(value, BodySnubber) or (isinstance(value, dict) and value.get("between") is not None)
    return "<between>" if between else "<place>"


AnySnubber = Annotated[
    Annotated[Snubber, Tag("<place>")] | Annotated[BodySnubber, Tag("<between>")], Variants(choose_sites)
]


class MassSnubber(_Stop):
    """A one-sided spring, with or without dashpot, on a mass of a chain."""

    mass: MassNumber
    """Number of the mass, from 1."""

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The one place."""
        return (AtPlace(mass=self.mass),)


class LinkSnubber(SnubberBase):
    """A one-sided spring, with or without dashpot, between two masses of a chain."""

    between: Pair
    """Numbers of the two masses, neighbours or not."""
    resists: Literal["approach", "separation"] = "approach"
    """Approach: a bumper that acts when the masses approach; separation: a cable that acts when they separate."""

    def settle(self) -> None:
        """Demand two different masses."""
        check_pair(self.between, "between")
        super().settle()

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """Both places, the mass with the lower number first."""
        return tuple(AtPlace(mass=number) for number in sorted(self.between))

    @property
    def probed_places(self) -> tuple[AtPlace, ...]:
        """The masses in the order in which they are written."""
        return tuple(AtPlace(mass=number) for number in self.between)


def choose_place(value: Any) -> str | None:
    """Tag of the place a raw value means; none where it means no place or two."""
    if isinstance(value, MassSnubber):
        return "<mass>"
    if isinstance(value, LinkSnubber):
        return "<between>"
    if isinstance(value, dict):
        on, between = value.get("mass") is not None, value.get("between") is not None
        if on != between:
            return "<mass>" if on else "<between>"
    return None


ChainSnubber = Annotated[
    Annotated[MassSnubber, Tag("<mass>")] | Annotated[LinkSnubber, Tag("<between>")],
    Variants(
        choose_place,
        "must name one mass or the two it acts between",
        "give mass: 1 with side: below or above, or between: [1, 2] with resists: approach or separation, not both",
    ),
]
