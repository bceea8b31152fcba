"""What counts as one impact, and the S-N line of the structure's material."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from beamsim.errors import Problem
from beamsim.scenario import units
from beamsim.scenario.base import Schema
from beamsim.scenario.limits import Stress
from beamsim.scenario.quantities import Between, PositiveNumber, Quantity, Time

if TYPE_CHECKING:
    from beamsim.scenario.whole import ScenarioParts

NonNegativeForce = Annotated[float, Quantity(units.FORCE, minimum=0.0)]
StressExponent = Annotated[
    float, Between(replace(units.NUMBER, name="exponent", example="5"), low=1.0, high=100.0, closed=True)
]


class ImpactSettings(Schema):
    """Statistics of the impacts at each snubber; an impact lasts from closing to opening."""

    minimum_rest: Time = 0.0
    """Contacts of one snubber that are less far apart are one impact."""
    force_threshold: NonNegativeForce = 0.0
    """Impacts whose peak force is smaller are not counted; sums over all time keep them."""


class StressLife(Schema):
    """S-N line of the material: N = cycles (stress_range / S)^exponent, S being the range of a cycle (twice its
    amplitude)."""

    stress_range: Stress
    """Stress range (twice the amplitude) that is endured for `cycles` cycles."""
    cycles: PositiveNumber = 2e6
    """Cycles endured at that range."""
    exponent: StressExponent
    """Exponent of the line, 1 to 100: about 3 for welds, 5 to 10 for smooth metal."""
    endurance_limit: Stress | None = None
    """Stress range up to which a cycle does no damage; none by default."""


def impact_problems(
    scenario: ScenarioParts, impacts: ImpactSettings | None, fatigue: StressLife | None, *, stepped: bool
) -> Iterator[Problem]:
    """Statistics of impacts and of stress that this structure, or time stepping, does not have."""
    for where, settings in (("run.impacts", impacts), ("run.fatigue", fatigue)):
        if settings is not None and stepped:
            yield Problem(where, "needs the motion in closed form", "leave run.method: reference out")
        elif settings is not None and any(located.item.kind == "cubic" for located in scenario.nonlinear_springs):
            yield Problem(
                where, "needs the motion in closed form, which cubic springs do not have",
                "leave it out, or replace the cubic springs by piecewise-linear ones",
            )  # fmt: skip
    if impacts is not None and not scenario.all_snubbers:
        yield Problem("run.impacts", "needs a snubber, and there is none", "leave it out, or add a snubber")
    if fatigue is not None and not any(body.gives_stress for body in scenario.all_bodies.values()):
        yield Problem(
            "run.fatigue", "needs a body whose stress is known",
            "leave it out, or give a beam's extreme_fibre and youngs_modulus",
        )  # fmt: skip
