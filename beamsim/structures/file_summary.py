"""What the files of an imported body hold, for those who read a case before they trust it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from beamsim.dataclass import dataclass
from beamsim.structures.plausible_units import SizeAndMass, size_and_mass

if TYPE_CHECKING:
    from beamsim.scenario.matrices import MatricesBody
    from beamsim.structures.named_matrices import NamedMatrices


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


def summary_of(given: NamedMatrices, section: MatricesBody, name: str) -> FileSummary:
    """Summary of the matrices that were read from the files of a body."""
    count = len(given.table.dofs)
    return FileSummary(name, count, given.units, section.units is None, size_and_mass(given), given.remarks)
