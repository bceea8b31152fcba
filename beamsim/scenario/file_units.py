"""Units of the files of a body: the consistent systems of finite-element programs by name, or units one by one."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple, get_args

from pydantic import Tag

from beamsim.scenario import units
from beamsim.scenario.base import Schema, Variants, fail
from beamsim.scenario.quantities import Text
from beamsim.scenario.units import Dimension, UnitError

_INCH, _FOOT, _POUND_FORCE = 0.0254, 0.3048, 4.4482216152605


class UnitSizes(NamedTuple):
    """SI sizes of the units of a file."""

    length: float  # m
    mass: float  # kg
    force: float  # N
    time: float  # s


def _consistent(length: float, mass: float, time: float) -> UnitSizes:
    """With the force that gives a unit of mass a unit of acceleration."""
    return UnitSizes(length, mass, mass * length / time**2, time)


UnitSystem = Literal["SI", "mm-t-s", "mm-kg-ms", "mm-g-ms", "mm-kg-s", "cm-g-s", "in-lbf-s", "ft-lbf-s"]
SYSTEMS: dict[str, UnitSizes] = {
    "SI": _consistent(1.0, 1.0, 1.0),
    "mm-t-s": _consistent(1e-3, 1e3, 1.0),
    "mm-kg-ms": _consistent(1e-3, 1.0, 1e-3),
    "mm-g-ms": _consistent(1e-3, 1e-3, 1e-3),
    "mm-kg-s": _consistent(1e-3, 1.0, 1.0),
    "cm-g-s": _consistent(1e-2, 1e-3, 1.0),
    "in-lbf-s": _consistent(_INCH, _POUND_FORCE / _INCH, 1.0),
    "ft-lbf-s": _consistent(_FOOT, _POUND_FORCE / _FOOT, 1.0),
}
"""Consistent systems: length, mass and time in their names; of the last two length, force and time."""
assert set(SYSTEMS) == set(get_args(UnitSystem))

_MEASURES: dict[str, Dimension] = {
    "length": units.LENGTH, "mass": units.MASS, "force": units.FORCE, "time": units.TIME,
}  # fmt: skip


class FileUnits(Schema):
    """Units of a file one by one: of lengths, masses, forces and times."""

    length: Text
    """Unit of displacements and coordinates: mm, in."""
    mass: Text
    """Unit of the mass matrix: kg, t, lb where weights were given and WTMASS was left out."""
    force: Text
    """Unit of forces; those of the stiffness matrix are this over the length: N, lbf."""
    time: Text = "s"
    """Unit of times, of velocities in the viscous matrix: s, ms."""

    def settle(self) -> None:
        """Refuse what is no unit of its quantity."""
        for name in _MEASURES:
            try:
                _size(name, getattr(self, name))
            except UnitError as error:
                raise fail(f"= {getattr(self, name)} is no unit of it: {error.message}",
                           f"write for example {_EXAMPLES[name]}", (name,)) from None  # fmt: skip


_EXAMPLES = {"length": "mm", "mass": "kg", "force": "N", "time": "s"}


def _size(name: str, unit: str) -> float:
    if not unit.strip():
        raise UnitError("it is empty", "")
    return units.read_quantity(f"1 {unit}", _MEASURES[name])


def _choose(value: Any) -> str | None:
    if isinstance(value, str):
        return "<name>" if value in SYSTEMS else None
    return "<units>" if isinstance(value, (dict, FileUnits)) else None


AnyFileUnits = Annotated[
    Annotated[UnitSystem, Tag("<name>")] | Annotated[FileUnits, Tag("<units>")],
    Variants(
        _choose, "is no system of units", f"write {', '.join(SYSTEMS)}, or {{length: mm, mass: kg, force: N, time: s}}"
    ),
]
"""A system by its name, or units one by one."""


def sizes_of(given: UnitSystem | FileUnits | None) -> UnitSizes:
    """SI sizes of the units; SI units where none are given."""
    if isinstance(given, FileUnits):
        return UnitSizes(**{name: _size(name, getattr(given, name)) for name in UnitSizes._fields})
    return SYSTEMS[given or "SI"]


def name_of(given: UnitSystem | FileUnits | None) -> str:
    """The units in words."""
    if isinstance(given, FileUnits):
        return ", ".join(getattr(given, name) for name in UnitSizes._fields)
    return given or "SI"
