"""Limits with which results are compared."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from beamsim.errors import Problem
from beamsim.scenario import units
from beamsim.scenario.base import Schema, fail
from beamsim.scenario.quantities import Length, PositiveForce, Quantity

if TYPE_CHECKING:
    from beamsim.scenario.whole import ScenarioParts

_STRESS = replace(units.PRESSURE, name="stress", example="80 MPa")
_ACCELERATION = replace(units.ACCELERATION, example="20 g")

Stress = Annotated[float, Quantity(_STRESS, above=0.0)]
PositiveAcceleration = Annotated[float, Quantity(_ACCELERATION, above=0.0)]


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

    def settle(self) -> None:
        """Reject a section that limits nothing."""
        if not self.given:
            raise fail("limit nothing", "give for example limits: {peak_force: 50 N, bending_stress: 80 MPa}")

    @property
    def given(self) -> dict[str, float]:
        """The given limits in SI units, by name."""
        values = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: value for name, value in values.items() if value is not None}


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
