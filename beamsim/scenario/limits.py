"""Limits with which results are compared, and to which the level of a swept sine is lowered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

from beamsim.scenario import units
from beamsim.scenario.base import Schema, fail
from beamsim.scenario.body import Body
from beamsim.scenario.output import ReactionOutput
from beamsim.scenario.quantities import Length, LevelType, Name, PositiveForce, Quantity

_STRESS = replace(units.PRESSURE, name="stress", example="80 MPa")
_ACCELERATION = replace(units.ACCELERATION, example="20 g")

Stress = Annotated[float, Quantity(_STRESS, above=0.0)]
PositiveAcceleration = Annotated[float, Quantity(_ACCELERATION, above=0.0)]

OF_OUTPUTS = "outputs."
"""Beginning of the name of a limit on an output."""
_MOMENT = replace(units.ENERGY, name="moment", unit="N m", example="12 N m")
_MOMENT_PER_WIDTH = replace(units.FORCE, name="moment per width", unit="N m/m", example="12 N m/m")
_OUTPUT_DIMENSIONS = {
    "displacement": replace(units.LENGTH, example="2 mm"), "velocity": units.VELOCITY, "acceleration": _ACCELERATION,
    "rotation": units.ANGLE, "bending_moment": _MOMENT, "stress": _STRESS,
    "strain": replace(units.RATIO, name="strain", example="0.1 %"), "reaction_force": units.FORCE,
    "reaction_moment": _MOMENT, "joint_force": units.FORCE, "joint_moment": _MOMENT, "kinetic_energy": units.ENERGY,
    "strain_energy": units.ENERGY,
}  # fmt: skip
"""By kind of output."""


def unit_of_dimension(dimension: units.Dimension) -> str:
    """The unit in which moments are energies, and moments per width forces."""
    return {"N m": "J", "N m/m": "N"}.get(dimension.unit, dimension.unit)


OutputLimit = Annotated[
    float,
    LevelType(
        tuple((unit_of_dimension(each), each) for each in dict.fromkeys(_OUTPUT_DIMENSIONS.values())), "200 N",
        ("200 N", "80 MPa"), above=0.0,
    ),
]  # fmt: skip
"""A limit on an output, in the unit of any kind of output, which it remembers as its SI unit."""


class Limits(Schema):
    """Limits; the summary has the margins, and `--check` exits with code 4 if one is exceeded."""

    peak_force: PositiveForce | None = None
    """Largest contact force of any snubber."""
    bending_stress: Stress | None = None
    """Largest bending stress anywhere on the beam."""
    peak_displacement: Length | None = None
    """Largest displacement of any probe relative to the base."""
    peak_acceleration: PositiveAcceleration | None = None
    """Largest absolute acceleration of any probe."""
    gap: Length | None = None
    """Largest opening between the structure and any snubber (lift-off)."""
    outputs: dict[Name, OutputLimit] | None = None
    """By name the largest magnitude of outputs: {clamp: 200 N, gauge: 0.1 %}; a plain number is in their SI unit."""

    def check(self) -> None:
        """Reject a section that limits nothing."""
        if not self.given:
            raise fail("limit nothing", "give for example limits: {peak_force: 50 N, bending_stress: 80 MPa}")

    @property
    def given(self) -> dict[str, float]:
        """The given limits in SI units, by name."""
        values = {name: getattr(self, name) for name in type(self).model_fields if name != "outputs"}
        of_outputs = {OF_OUTPUTS + name: float(value) for name, value in (self.outputs or {}).items()}
        return {name: value for name, value in values.items() if value is not None} | of_outputs


def output_dimension(output: Any, bodies: Mapping[str, Body], default_body: str) -> units.Dimension | None:
    """Of an output on one of the bodies; None of rows of recovery matrices, which have units of their own."""
    if output.kind == "bending_moment":
        body = bodies.get(output.place.body or default_body)
        return _MOMENT_PER_WIDTH if body is not None and body.body_kind == "plate" else _MOMENT
    return _OUTPUT_DIMENSIONS.get(output.kind)


BASE_FORCE = ReactionOutput.model_construct(
    name="base_force", kind="reaction_force", support="base", body=None, direction=None, about=None
)
"""The output that a limit on the base's force stands for where the scenario has none."""
QUANTITIES_OF = {
    "probes": {"acceleration": units.ACCELERATION, "displacement": units.LENGTH},
    "snubbers": {"force": units.FORCE},
}


@dataclass(frozen=True)
class LimitedQuantity:
    """What a limit applies to."""

    section: str  # probes, snubbers or outputs
    item: str
    quantity: str  # acceleration, displacement or force; empty of an output


def limited_quantity(name: str, base_force: str = BASE_FORCE.name) -> LimitedQuantity | None:
    """What a name stands for; None where it is none of the forms. ``base_force`` is the output of that force.

    >>> limited_quantity("probes.tip.acceleration")
    LimitedQuantity(section='probes', item='tip', quantity='acceleration')
    """
    if name == "base.force":
        return LimitedQuantity("outputs", base_force, "")
    section, _, rest = name.partition(".")
    if section == "outputs" and rest:
        return LimitedQuantity(section, rest, "")
    item, _, quantity = rest.rpartition(".")
    return LimitedQuantity(section, item, quantity) if item and quantity in QUANTITIES_OF.get(section, ()) else None
