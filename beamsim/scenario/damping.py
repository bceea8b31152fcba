"""Damping of a structure: modal ratios, Rayleigh, or uniform viscous."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from beamsim.scenario.base import BY_KIND, Schema, Variants, number_or_list
from beamsim.scenario.quantities import PerTime, Ratio, Time, ViscousPerLength

Ratios = Annotated[
    Annotated[Ratio, Tag("<number>")] | Annotated[tuple[Ratio, ...], Field(min_length=1), Tag("<list>")],
    Variants(number_or_list),
]


class ModalDamping(Schema):
    """Damping ratios of the modes of the structure without contact."""

    kind: Literal["modal"] = "modal"
    """Modal damping ratios."""
    ratio: Ratios = 0.0
    """Damping ratio of all modes, or a list from the first mode on (the last value applies to all higher modes)."""


class RayleighDamping(Schema):
    """Damping proportional to mass and stiffness: C = mass M + stiffness K."""

    kind: Literal["rayleigh"] = "rayleigh"
    """Proportional (Rayleigh) damping."""
    mass: PerTime = 0.0
    """Factor of the mass matrix."""
    stiffness: Time = 0.0
    """Factor of the stiffness matrix."""


class ViscousDamping(Schema):
    """Uniform viscous damping along the beam: a force per unit length opposite to the velocity."""

    kind: Literal["viscous"] = "viscous"
    """Uniform viscous damping."""
    coefficient: ViscousPerLength
    """Force per unit length and velocity."""


BeamDamping = Annotated[ModalDamping | RayleighDamping | ViscousDamping, BY_KIND]
ChainDamping = Annotated[ModalDamping | RayleighDamping, BY_KIND]
