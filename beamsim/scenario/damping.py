"""Damping of a structure: modal ratios, Rayleigh, or uniform viscous."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from beamsim.scenario.base import BY_FORM, Schema, counted, fail
from beamsim.scenario.quantities import Frequency, PerTime, Ratio, Time, ViscousPerLength

Ratios = Annotated[
    Ratio | Annotated[tuple[Ratio, ...], Field(min_length=1)],
    BY_FORM,
]


class ModalDamping(Schema):
    """Damping ratios of the modes of the structure without contact."""

    kind: Literal["modal"] = "modal"
    """Modal damping ratios."""
    ratio: Ratios = 0.0
    """Damping ratio of all modes, or a list from the first mode on (the last value applies to all higher modes)."""


class RatioAtFrequency(Schema):
    """A damping ratio, and the natural frequency that has it."""

    frequency: Frequency
    """Natural frequency."""
    ratio: Ratio
    """Damping ratio there."""


class RayleighDamping(Schema):
    """Damping proportional to mass and stiffness: C = mass M + stiffness K."""

    kind: Literal["rayleigh"] = "rayleigh"
    """Proportional (Rayleigh) damping."""
    mass: PerTime = 0.0
    """Factor of the mass matrix."""
    stiffness: Time = 0.0
    """Factor of the stiffness matrix."""
    ratios: tuple[RatioAtFrequency, ...] = ()
    """Damping ratios at two frequencies, instead of the factors: [{frequency: 20 Hz, ratio: 1 %}, {...}]."""

    def check(self) -> None:
        """Reject factors beside ratios, and ratios that factors of at least 0 do not give."""
        if not self.ratios:
            return
        if self.mass or self.stiffness:
            raise fail("are given together with factors", "keep ratios, or mass and stiffness, not both", ("ratios",))
        if len(self.ratios) != 2:
            raise fail(f"has {counted(len(self.ratios), 'entry', 'entries')}, where two are needed",
                       "give the ratios at two frequencies: two factors follow from them", ("ratios",))  # fmt: skip
        low, high = sorted(self.ratios, key=lambda at: at.frequency)
        if low.frequency == high.frequency:
            raise fail("has the same frequency twice", "give two different frequencies", ("ratios",))
        slope = high.frequency / low.frequency
        if not low.ratio / slope <= high.ratio <= low.ratio * slope:
            raise fail(
                f"= {high.ratio:g} at {high.frequency:g} Hz beside {low.ratio:g} at {low.frequency:g} Hz needs a "
                "negative factor, and so motions that grow",
                f"give it {low.ratio / slope:.4g} to {low.ratio * slope:.4g} there, or use kind: modal",
                ("ratios",),
            )

    @property
    def factors(self) -> tuple[float, float]:
        """Factors of mass, 1/s, and stiffness, s: the ratio at omega is (mass / omega + stiffness omega) / 2."""
        if not self.ratios:
            return self.mass, self.stiffness
        (a, x), (b, y) = ((2.0 * math.pi * at.frequency, at.ratio) for at in self.ratios)
        determinant = b * b - a * a
        return max(2.0 * a * b * (b * x - a * y) / determinant, 0.0), max(2.0 * (b * y - a * x) / determinant, 0.0)


class ViscousDamping(Schema):
    """Uniform viscous damping along the beam: a force per unit length opposite to the velocity."""

    kind: Literal["viscous"] = "viscous"
    """Uniform viscous damping."""
    coefficient: ViscousPerLength
    """Force per unit length and velocity."""


BeamDamping = Annotated[ModalDamping | RayleighDamping | ViscousDamping, BY_FORM]
ChainDamping = Annotated[ModalDamping | RayleighDamping, BY_FORM]
