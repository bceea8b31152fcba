"""Dry friction at a place against the base or the ground, or between two places."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Tag

from beamsim.scenario import units
from beamsim.scenario.base import Schema, Variants, fail
from beamsim.scenario.names import Named
from beamsim.scenario.place import AtPlace, BetweenPlaces, Sited, TwoPlaces
from beamsim.scenario.quantities import Force, PositiveForce, PositiveNumber, Quantity, Ratio, Stiffness

WearRate = Annotated[float, Quantity(units.WEAR_RATE, above=0.0)]


class FrictionCoefficients(Schema):
    """Friction force over normal force."""

    static: PositiveNumber
    """Coefficient up to which the contact sticks."""
    sliding: Ratio
    """Coefficient while it slides; not above the static one."""

    def settle(self) -> None:
        """Demand an order."""
        if self.sliding > self.static:
            raise fail(
                f"= {self.sliding:g} is above static = {self.static:g}", "exchange them, or give one coefficient",
                ("sliding",),
            )  # fmt: skip


def _coefficient_form(value: Any) -> str:
    return "<both>" if isinstance(value, (dict, FrictionCoefficients)) else "<number>"


class SnubberForce(Schema):
    """The force of a snubber, which varies with the motion and is zero where the snubber is open."""

    snubber: str
    """Name of the snubber."""


def _normal_form(value: Any) -> str:
    return "<snubber>" if isinstance(value, (dict, SnubberForce)) else "<number>"


def _start_form(value: Any) -> str:
    return "<text>" if value == "unstressed" else "<number>"


class FrictionBase(Named):
    """Common part of all friction contacts: |T| = coefficient times normal force at most."""

    kind: ClassVar[str] = "friction"

    normal_force: Annotated[
        Annotated[PositiveForce, Tag("<number>")] | Annotated[SnubberForce, Tag("<snubber>")], Variants(_normal_form)
    ]
    """Force that presses the faces together: a constant one, or {snubber: NAME}, that of a snubber."""
    coefficient: Annotated[
        Annotated[PositiveNumber, Tag("<number>")] | Annotated[FrictionCoefficients, Tag("<both>")],
        Variants(_coefficient_form),
    ]
    """Friction force over normal force: one number, or {static: 0.3, sliding: 0.2}."""
    stiffness: Stiffness | None = None
    """Tangential stiffness of the contact while it sticks; by default it does not move at all."""
    start: Annotated[
        Annotated[Literal["unstressed"], Tag("<text>")] | Annotated[Force, Tag("<number>")], Variants(_start_form)
    ] = "unstressed"
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

    def settle(self) -> None:
        """Demand a force at the start that sticks."""
        super().settle()
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

    def settle(self) -> None:
        """Demand exactly one place."""
        Sited.settle(self)
        FrictionBase.settle(self)


class FrictionBetween(BetweenPlaces, FrictionBase):
    """Dry friction between places of two bodies or of one."""

    between: TwoPlaces
    """The two places; the friction force of a positive stretch holds the second back."""


def _sites(value: Any) -> str:
    between = isinstance(value, FrictionBetween) or (isinstance(value, dict) and value.get("between") is not None)
    return "<between>" if between else "<place>"


AnyFriction = Annotated[
    Annotated[FrictionAtPlace, Tag("<place>")] | Annotated[FrictionBetween, Tag("<between>")], Variants(_sites)
]
