"""Numbers of a shape to start from: of each mass of a chain, or coefficients of a polynomial in x along a beam."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

from pydantic.json_schema import JsonSchemaValue

from beamsim.scenario import units
from beamsim.scenario.quantities import FieldType
from beamsim.scenario.units import Dimension

DISPLACEMENTS = (
    replace(units.LENGTH, name="displacement", example="1 mm"),
    Dimension("slope", "", "1 mm/m"),
    Dimension("coefficient of x^2", "1/m", "3 1/m"),
    Dimension("coefficient of x^3", "1/m^2", "3 1/m^2"),
)
VELOCITIES = (
    units.VELOCITY,
    replace(units.PER_TIME, name="rate of a slope"),
    Dimension("coefficient of x^2", "1/m/s", "3 1/m/s"),
    Dimension("coefficient of x^3", "1/m^2/s", "3 1/m^2/s"),
)


class ShapeNumber(float):
    """A number of a shape, with the power of x that its unit belongs to (None for a bare number)."""

    power: int | None

    def __new__(cls, value: float, power: int | None) -> ShapeNumber:
        """Make a float that carries the power."""
        number = super().__new__(cls, value)
        number.power = power
        return number


@dataclass(frozen=True)
class ShapeNumberType(FieldType):
    """A number in SI units, or a string with the unit of the coefficient of some power of x."""

    dimensions: tuple[Dimension, ...]

    @property
    def example(self) -> str:
        """How to write that of a mass."""
        return self.dimensions[0].example

    def read(self, value: Any) -> ShapeNumber:
        """Return the SI number with the power that its unit belongs to."""
        if isinstance(value, ShapeNumber):
            return value
        number, dimension = units.read_level(value, self.dimensions)
        return ShapeNumber(number + 0.0, None if dimension is None else self.dimensions.index(dimension))

    def json_schema(self) -> JsonSchemaValue:
        """Return number-or-string."""
        text = {"type": "string", "pattern": r"^\s*[+-]?(\d|\.\d)"}
        return {"anyOf": [{"type": "number"}, text], "examples": [self.example]}


ShapeDisplacement = Annotated[float, ShapeNumberType(DISPLACEMENTS)]
ShapeVelocity = Annotated[float, ShapeNumberType(VELOCITIES)]
DIMENSIONS = {"displacement": DISPLACEMENTS, "velocity": VELOCITIES}
