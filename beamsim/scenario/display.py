"""Units in which tables, plots and reports show quantities."""

from __future__ import annotations

from typing import ClassVar

from beamsim.scenario import units
from beamsim.scenario.base import Schema, fail
from beamsim.scenario.quantities import Text
from beamsim.scenario.units import Dimension, UnitError

DIMENSIONS: dict[str, Dimension] = {
    "acceleration": units.ACCELERATION,
    "length": units.LENGTH,
    "velocity": units.VELOCITY,
    "force": units.FORCE,
    "stress": units.PRESSURE,
    "time": units.TIME,
    "mass": units.MASS,
    "stiffness": units.STIFFNESS,
    "energy": units.ENERGY,
}
_EXAMPLES = {"acceleration": "g", "length": "mm", "stress": "MPa", "time": "min", "stiffness": "N/mm"}


class DisplayUnits(Schema):
    """Units of tables, plots and reports; result files and ``--json`` stay in SI units."""

    acceleration: Text | None = None
    """Unit of accelerations, such as m/s^2; g by default."""
    length: Text | None = None
    """Unit of lengths and displacements, such as mm; metres with a prefix that suits the size by default."""
    velocity: Text | None = None
    """Unit of velocities, such as mm/s."""
    force: Text | None = None
    """Unit of forces, such as kN."""
    stress: Text | None = None
    """Unit of stresses and moduli, such as MPa."""
    time: Text | None = None
    """Unit of times, such as ms or min."""
    mass: Text | None = None
    """Unit of masses, such as g."""
    stiffness: Text | None = None
    """Unit of stiffnesses, such as N/mm."""
    energy: Text | None = None
    """Unit of energies, such as mJ."""

    named: ClassVar[tuple[str, ...]] = tuple(DIMENSIONS)

    def settle(self) -> None:
        """Refuse units that there are not, or that measure something else."""
        for name in self.named:
            unit = getattr(self, name)
            if unit is None:
                continue
            try:
                self._size(name, unit)
            except UnitError as error:
                raise fail(
                    f"= {unit} is no unit of it: {error.message}", f"write {_EXAMPLES.get(name, _si(name))}", (name,)
                ) from None

    @property
    def scales(self) -> dict[str, tuple[float, str]]:
        """By SI unit the factor of SI values and the unit that is shown."""
        chosen = {name: getattr(self, name) for name in self.named}
        return {_si(name): (1.0 / self._size(name, unit), unit) for name, unit in chosen.items() if unit is not None}

    @staticmethod
    def _size(name: str, unit: str) -> float:
        """SI value of one unit."""
        if not unit.strip():
            raise UnitError("it is empty", "")
        return units.read_quantity(f"1 {unit}", DIMENSIONS[name])


def _si(name: str) -> str:
    return DIMENSIONS[name].unit
