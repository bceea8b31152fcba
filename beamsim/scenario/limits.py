"""Limits with which results are compared."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from pydantic.json_schema import JsonSchemaValue

from beamsim.errors import Problem
from beamsim.scenario import units
from beamsim.scenario.base import Schema, fail, path_text, suggestion
from beamsim.scenario.quantities import FieldType, Length, LevelValue, Name, PositiveForce, Quantity

if TYPE_CHECKING:
    from beamsim.scenario.whole import ScenarioParts

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


@dataclass(frozen=True)
class OutputLimitType(FieldType):
    """A limit on an output, in the unit of any kind of output: a float that remembers its SI unit."""

    example = "200 N"

    def read(self, value: Any) -> LevelValue:
        """Return the SI number with the unit of its dimension; None of a plain number."""
        if isinstance(value, LevelValue):
            return value
        number, dimension = units.read_level(value, tuple(dict.fromkeys(_OUTPUT_DIMENSIONS.values())))
        if not number > 0.0:
            raise units.UnitError("must be positive", f"write for example {self.example}")
        return LevelValue(number, None if dimension is None else unit_of_dimension(dimension))

    def json_schema(self) -> JsonSchemaValue:
        """Return number-or-string."""
        text = {"type": "string", "pattern": r"^\s*[+]?(\d|\.\d)"}
        return {"anyOf": [{"type": "number", "exclusiveMinimum": 0.0}, text], "examples": [self.example, "80 MPa"]}


def unit_of_dimension(dimension: units.Dimension) -> str:
    """The unit in which moments are energies, and moments per width forces."""
    return {"N m": "J", "N m/m": "N"}.get(dimension.unit, dimension.unit)


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
    outputs: dict[Name, Annotated[float, OutputLimitType()]] | None = None
    """By name the largest magnitude of outputs: {clamp: 200 N, gauge: 0.1 %}; a plain number is in their SI unit."""

    def settle(self) -> None:
        """Reject a section that limits nothing."""
        if not self.given:
            raise fail("limit nothing", "give for example limits: {peak_force: 50 N, bending_stress: 80 MPa}")

    @property
    def given(self) -> dict[str, float]:
        """The given limits in SI units, by name."""
        values = {name: getattr(self, name) for name in type(self).model_fields if name != "outputs"}
        of_outputs = {OF_OUTPUTS + name: float(value) for name, value in (self.outputs or {}).items()}
        return {name: value for name, value in values.items() if value is not None} | of_outputs


def limit_problems(scenario: ScenarioParts, limits: Limits) -> Iterator[Problem]:
    """Limits on quantities that this structure does not have."""
    bodies = scenario.all_bodies.values()
    if limits.bending_stress is not None and not any(body.gives_stress for body in bodies):
        if all(body.body_kind == "chain" for body in bodies):
            yield Problem("limits.bending_stress", "applies to a beam, but the structure is a chain", "leave it out")
        else:
            yield Problem(
                "limits.bending_stress",
                "needs a beam whose section is known",
                "give its extreme_fibre and youngs_modulus",
            )
    for name in ("peak_force", "gap"):
        if getattr(limits, name) is not None and not scenario.all_snubbers:
            yield Problem(f"limits.{name}", "limits the snubbers, and there are none", "add a snubber, or leave it out")
    outputs = {output.name: output for _, output in scenario.requested_outputs}
    for name, limit in (limits.outputs or {}).items():
        path = path_text(("limits", "outputs", name))
        if name not in outputs:
            known = suggestion(name, outputs, "the outputs are") if outputs else "list it in outputs, or leave it out"
            yield Problem(path, "is no output", known)
            continue
        dimension = output_dimension(scenario, outputs[name])
        meant = limit.quantity if isinstance(limit, LevelValue) else None
        if dimension is None and meant is not None:
            yield Problem(path, "has a unit, and the output has one of its own", "give a plain number in that unit")
        elif dimension is not None and meant not in (None, unit_of_dimension(dimension)):
            kind = outputs[name].kind.replace("_", " ")
            yield Problem(path, f"is in {meant or 'no unit'}, and the output is a {kind}", f"write {dimension.example}")


def output_dimension(scenario: ScenarioParts, output: Any) -> units.Dimension | None:
    """Of an output; None of rows of recovery matrices, which have units of their own."""
    if output.kind == "bending_moment":
        body = scenario.all_bodies.get(output.place.body or scenario.default_body)
        return _MOMENT_PER_WIDTH if body is not None and body.body_kind == "plate" else _MOMENT
    return _OUTPUT_DIMENSIONS.get(output.kind)
