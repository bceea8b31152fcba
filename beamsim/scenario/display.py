"""Units in which tables, plots and reports show quantities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from beamsim.scenario import units
from beamsim.scenario.base import Schema
from beamsim.scenario.quantities import UnitType
from beamsim.scenario.units import Dimension

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


def _unit_of(name: str) -> UnitType:
    return UnitType(of=DIMENSIONS[name], example=_EXAMPLES.get(name, DIMENSIONS[name].unit))


_MINUTE = 60.0  # s; shorter times are shown in seconds, with a prefix


class DisplayUnits(Schema):
    """Units of tables, plots and reports; result files and ``--json`` stay in SI units.

    Accelerations, lengths and long times that are not chosen are shown in the unit in which most of them are written.
    """

    acceleration: Annotated[str, _unit_of("acceleration")] | None = None
    """Unit of accelerations, such as m/s^2; by default as they are written, g for bare numbers."""
    length: Annotated[str, _unit_of("length")] | None = None
    """Unit of lengths and displacements, such as mm; by default as they are written, metres with a prefix that suits
    the size where all are in metres."""
    velocity: Annotated[str, _unit_of("velocity")] | None = None
    """Unit of velocities, such as mm/s."""
    force: Annotated[str, _unit_of("force")] | None = None
    """Unit of forces, such as kN."""
    stress: Annotated[str, _unit_of("stress")] | None = None
    """Unit of stresses and moduli, such as MPa."""
    time: Annotated[str, _unit_of("time")] | None = None
    """Unit of times, such as ms or min; by default minutes or hours where times are written so. Times that are shorter
    than the unit chosen are in seconds if that is longer."""
    mass: Annotated[str, _unit_of("mass")] | None = None
    """Unit of masses, such as g."""
    stiffness: Annotated[str, _unit_of("stiffness")] | None = None
    """Unit of stiffnesses, such as N/mm."""
    energy: Annotated[str, _unit_of("energy")] | None = None
    """Unit of energies, such as mJ."""

    named: ClassVar[tuple[str, ...]] = tuple(DIMENSIONS)

    def filled(self, written: Mapping[tuple[Dimension, str], int]) -> DisplayUnits:
        """The same with the units in which quantities are written, for what is not chosen.

        Parameters
        ----------
        written : how often a quantity of that dimension is written in that unit.
        """
        # metres are written for the size of a panel, whose displacements need a prefix
        lengths = {unit: n for (of, unit), n in written.items() if of.unit == units.LENGTH.unit != unit}
        times = {
            unit: n
            for (of, unit), n in written.items()
            if of.unit == units.TIME.unit and units.size_of(unit, units.TIME) >= _MINUTE
        }
        accelerations = {unit: n for (of, unit), n in written.items() if of.unit == units.ACCELERATION.unit}
        densities = [unit for of, unit in written if of.unit == units.ACCELERATION_PSD.unit]
        if not accelerations and densities and not any(map(units.is_in_gravities, densities)):
            accelerations = {_si("acceleration"): 1}
        most = {
            name: max(of, key=lambda unit: (of[unit], -_size(name, unit)))  # of equally many the smallest
            for name, of in (("acceleration", accelerations), ("length", lengths), ("time", times))
            if of and getattr(self, name) is None
        }
        return self.model_copy(update=most)

    @property
    def is_empty(self) -> bool:
        """Whether no unit is chosen."""
        return all(getattr(self, name) is None for name in self.named)

    @property
    def scales(self) -> dict[str, tuple[float, str]]:
        """By SI unit the factor of SI values and the unit that is shown."""
        chosen = {name: getattr(self, name) for name in self.named}
        return {_si(name): (1.0 / _size(name, unit), unit) for name, unit in chosen.items() if unit is not None}


def _size(name: str, unit: str) -> float:
    """SI value of one unit."""
    return units.size_of(unit, DIMENSIONS[name])


def _si(name: str) -> str:
    return DIMENSIONS[name].unit
