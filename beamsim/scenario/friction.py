"""Dry friction at a place against the base or the ground, or between two places."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from beamsim.scenario import units
from beamsim.scenario.base import BY_FORM, Schema, fail
from beamsim.scenario.place import AtPlace, BetweenPlaces, Named, Sited, TwoPlaces
from beamsim.scenario.quantities import Force, PositiveForce, PositiveNumber, Quantity, Ratio, Stiffness

WearRate = Annotated[float, Quantity(units.WEAR_RATE, above=0.0)]


class FrictionCoefficients(Schema):
    """Friction force over normal force."""

    static: PositiveNumber
    """Coefficient up to which the contact sticks."""
    sliding: Ratio
    """Coefficient while it slides; not above the static one."""

    def check(self) -> None:
        """Demand an order."""
        if self.sliding > self.static:
            raise fail(
                f"= {self.sliding:g} is above static = {self.static:g}", "exchange them, or give one coefficient",
                ("sliding",),
            )  # fmt: skip


class SnubberForce(Schema):
    """The force of a snubber, which varies with the motion and is zero where the snubber is open."""

    snubber: str
    """Name of the snubber."""


class FrictionBase(Named):
    """Common part of all friction contacts: |T| = coefficient times normal force at most."""

    kind: ClassVar[str] = "friction"

    normal_force: Annotated[PositiveForce | SnubberForce, BY_FORM]
    """Force that presses the faces together: a constant one, or {snubber: NAME}, that of a snubber."""
    coefficient: Annotated[
        PositiveNumber | FrictionCoefficients,
        BY_FORM,
    ]
    """Friction force over normal force: one number, or {static: 0.3, sliding: 0.2}."""
    stiffness: Stiffness | None = None
    """Tangential stiffness of the contact while it sticks; by default it does not move at all."""
    start: Annotated[Literal["unstressed"] | Force, BY_FORM] = "unstressed"
    """Friction force at the start of a motion, which the past decides: unstressed, or a force that resists a positive
    displacement. Static equilibrium is that under this force."""
    wear_rate: WearRate | None = None
    """Volume worn per normal force and sliding distance (Archard); unknown by default."""

    @property
    def pressed_by(self) -> str | None:
        """Name of the snubber whose force presses; None where the force is constant."""
        return self.normal_force.snubber if isinstance(self.normal_force, SnubberForce) else None

    @property
    def constant_force(self) -> float:
        """The constant normal force, N; nan where it is that of a snubber."""
        return math.nan if isinstance(self.normal_force, SnubberForce) else self.normal_force

    @property
    def static_coefficient(self) -> float:
        """Friction force over normal force up to which it sticks."""
        return self.coefficient.static if isinstance(self.coefficient, FrictionCoefficients) else self.coefficient

    @property
    def sliding_coefficient(self) -> float:
        """Friction force over normal force while it slides."""
        return self.coefficient.sliding if isinstance(self.coefficient, FrictionCoefficients) else self.coefficient

    @property
    def static_force(self) -> float:
        """Largest friction force while it sticks, N; nan where the normal force is that of a snubber."""
        return self.constant_force * self.static_coefficient

    @property
    def sliding_force(self) -> float:
        """Friction force while it slides, N, likewise."""
        return self.constant_force * self.sliding_coefficient

    @property
    def start_force(self) -> float:
        """Friction force at the start of a motion, N."""
        return 0.0 if isinstance(self.start, str) else self.start

    def check(self) -> None:
        """Demand a force at the start that sticks."""
        super().check()
        if self.pressed_by is not None:
            if self.start != "unstressed":
                raise fail(
                    "does not go with the normal force of a snubber, which may be open at the start",
                    "leave start out", ("start",),
                )  # fmt: skip
        elif abs(self.start_force) >= self.static_force:
            limit = "coefficient times normal_force"
            raise fail(
                f"= {self.start_force:g} N is not held: the contact sticks below {limit} = {self.static_force:g} N",
                "give a smaller force, or unstressed", ("start",),
            )  # fmt: skip

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The place, or both places."""
        raise NotImplementedError


class FrictionAtPlace(Sited, FrictionBase):
    """Dry friction at a place, which rubs on the base or the ground in the direction of its displacement."""

    mounted_on: Literal["base", "ground"] = "base"
    """Base: what it rubs on moves with the base excitation; ground: fixed."""


class FrictionBetween(BetweenPlaces, FrictionBase):
    """Dry friction between places of two bodies or of one."""

    between: TwoPlaces
    """The two places; the friction force of a positive stretch holds the second back."""


AnyFriction = Annotated[FrictionAtPlace | FrictionBetween, BY_FORM]
