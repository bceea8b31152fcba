"""What the files of an imported body hold, and whether its size and mass fit the units that they are taken to be in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.scenario.matrices import FileUnits, UnitSystem
from beamsim.structures.dof_table import TRANSLATIONS
from beamsim.structures.named_matrices import NamedMatrices
from beamsim.typing import Floats

# Mass over the cube of the largest dimension, kg/m^3: a wire of 0.2 mm and 10 m has 2e-5, a block of tungsten 2e4, and
# 10 kg on interface nodes 5 mm apart 8e7.
LIGHTEST, HEAVIEST = 1e-6, 1e8


@dataclass(frozen=True)
class SizeAndMass:
    """What of a structure shows mistaken units."""

    mass: float | None  # kg, the largest of the directions; None where nothing is displaced
    extent: Floats | None  # (3,) m, of all nodes along x, y and z; None without coordinates

    @property
    def text(self) -> str:
        """Both in words."""
        mass = "mass unknown (modal coordinates alone)" if self.mass is None else f"{self.mass:.4g} kg"
        if self.extent is None:
            return f"{mass}, size unknown (no coordinates)"
        return f"{mass}, {' x '.join(f'{each:.4g}' for each in self.extent)} m"


def size_and_mass(given: NamedMatrices) -> SizeAndMass:
    """Mass from translations of all nodes, size from their coordinates."""
    moved = [given.table.of_direction(direction) for direction in TRANSLATIONS]
    masses = [float(motion @ (given.mass @ motion)) for motion in moved if motion.any()]
    places = given.table.coordinates
    if places is not None:
        places = places[np.all(np.isfinite(places), axis=1)]
    extent = None if places is None or not places.size else np.ptp(places, axis=0)
    return SizeAndMass(max(masses, default=None), extent)


def doubtful_units(given: NamedMatrices, units: UnitSystem | FileUnits | None) -> list[str]:
    """A warning where size and mass are those of a structure in other units than its files are taken to be in.

    Frequencies do not show it: those in mm, t and s are the same.
    """
    found = size_and_mass(given)
    if found.mass is None or found.extent is None or found.mass <= 0.0:
        return []
    largest = float(found.extent.max())
    density = found.mass / largest**3 if largest > 0.0 else 0.0
    if units is None and 0.0 < density < LIGHTEST:
        return [
            f"the structure has {found.text}, if its files are in SI units: are they in mm or inches? Then give "
            "units: mm-t-s, in-lbf-s or as the model has them; units: SI confirms these"
        ]
    if units not in (None, "SI") and density > HEAVIEST:
        return [
            f"the structure has {found.text}, with its files in {given.units}: are the coordinates of the table in "
            "metres? All files of a body have the same units"
        ]
    return []


@dataclass(frozen=True)
class FileSummary:
    """What the files of a body hold, in SI units, as they are taken."""

    body: str
    degrees_of_freedom: int
    units: str  # of the files
    by_default: bool  # whether the units were not stated
    found: SizeAndMass
    remarks: tuple[str, ...]

    @property
    def text(self) -> str:
        """In words."""
        units = f"{self.units}, the default" if self.by_default else self.units
        return (
            f"{self.body}: {self.degrees_of_freedom} degrees of freedom, {self.found.text}; units of its files: {units}"
        )

    @property
    def as_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return {
            "degrees_of_freedom": self.degrees_of_freedom,
            "units": self.units,
            "units_by_default": self.by_default,
            "mass_kg": self.found.mass,
            "extent_m": None if self.found.extent is None else self.found.extent.tolist(),
        }
