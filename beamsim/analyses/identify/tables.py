"""Force-deflection tables in an identification: their slope at rest, and segments that are sought one by one.

Natural frequencies with permanent contact give the slope of a table where it rests; vibrations give the stiffness of
each segment that they reach.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamsim.analyses.identify.fit import Sought
from beamsim.analyses.identify.result import TableSlope
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.parameters import with_values
from beamsim.system.build import build_system
from beamsim.system.force_tables import curves_of
from beamsim.typing import Floats


def table_slope(scenario: Scenario, snubber: str) -> TableSlope | None:
    """The slope of a snubber's table at static equilibrium, with the factor of an estimate still to come.

    None of a snubber that has a stiffness.

    Raises
    ------
    ScenarioError
        Where the snubber is open at rest: its slope there is not that of a permanent contact.
    """
    names = [item.name for _, _, item, _ in scenario.located_snubbers]
    index = names.index(snubber)
    curve = curves_of(scenario)[index]
    if curve is None:
        return None
    force = build_system(scenario, assessed=False).snubbers[index].preload
    if not force > 0.0:
        raise ScenarioError(
            Problem(
                "identify_stiffness.measured_with",
                f"gives the slope of the table of {snubber} where it rests, and the snubber is open at rest",
                f"give {path_text(scenario.located_snubber(snubber).path)} the preload of the test, or measure "
                "vibrations (nonlinear)",
            )
        )
    knots = curve.force[:-1]
    segment = int(np.searchsorted(knots, force, side="left"))
    slope = float(curve.slopes[segment - 1])
    deflection = float(curve.deflection[segment - 1] + (force - curve.force[segment - 1]) / slope)
    bends = curve.deflection[1:-1]
    return TableSlope(
        force=force, deflection=deflection, segment=segment, segments=curve.slopes.size, slope=slope, factor=np.nan,
        at_a_bend=bool(np.any(np.abs(bends - deflection) < 1e-3 * deflection)),
    )  # fmt: skip


def with_factor(scenario: Scenario, snubber: str, factor: float) -> Scenario:
    """The scenario with all forces of a snubber's table multiplied by a factor."""
    path, _, item, _ = scenario.located_snubber(snubber)
    assert item.table is not None
    scaled = item.table.model_copy(update={"scale": factor * item.table.scale})
    return with_values(scenario, {(*path, "force_deflection"): scaled})


def compared(scenario: Scenario, snubber: str, resting: TableSlope, stiffness: float) -> tuple[TableSlope, list[str]]:
    """The slope of the table beside the identified one, and what there is to say about it."""
    resting = replace(resting, factor=stiffness / resting.slope)
    warnings = []
    if resting.at_a_bend:
        warnings.append(
            f"{snubber} rests at a bend of its table, {1e3 * resting.deflection:.4g} mm: its slope is that of the "
            "segment below, and a vibration is on both"
        )
    if 0.0 < stiffness < np.inf:
        scaled = table_slope(with_factor(scenario, snubber, resting.factor), snubber)
        if scaled is None or scaled.segment != resting.segment:
            warnings.append(
                f"with all forces of the table multiplied by {resting.factor:.4g} {snubber} would rest on another "
                "segment: the identified stiffness is not that of a table of this shape"
            )
    return resting, warnings


@dataclass(frozen=True)
class SoughtSegment:
    """A segment whose stiffness is sought."""

    number: int  # of the parameter
    parameter: str
    contacts: tuple[int, ...]  # numbers of the snubbers that have the table
    segment: int  # from 1
    begin: float  # m, deflection

    def remark(self, penetration: Floats) -> str | None:
        """What to do if no test reaches it; (tests, m) the largest penetration of each contact, m."""
        largest = max(float(penetration[:, list(self.contacts)].max()), 0.0)
        if largest > self.begin * (1.0 + 1e-9):  # a motion that ends at the beginning is in no later segment
            return None
        return (
            f"{self.parameter}: no test reaches segment {self.segment}, which begins at {1e3 * self.begin:.4g} mm "
            f"(largest penetration {1e3 * largest:.4g} mm): it keeps its value; add a test at a higher level, or leave "
            "it out"
        )


def sought_segments(scenario: Scenario, numbers: Sequence[Sought]) -> Iterator[SoughtSegment]:
    """The parameters that are factors of one segment.

    Raises
    ------
    ScenarioError
        For a segment without slope, which no factor changes.
    """
    for index, number in enumerate(numbers):
        if len(number.places) > 1 or number.places[0][-3:-1] != ("force_deflection", "segment_factors"):
            continue
        *path, _, _, segment = number.places[0]
        snubbers = scenario.located_snubbers
        contacts = tuple(j for j, located in enumerate(snubbers) if located.path == tuple(path))
        curve = curves_of(scenario)[contacts[0]]
        assert curve is not None
        assert isinstance(segment, int)
        if curve.slopes[segment] == 0.0:
            raise ScenarioError(
                Problem(
                    "identify_stiffness.nonlinear.estimate",
                    f"names {number.parameter}, a segment without slope, which no factor changes",
                    "leave it out, or give the table a small slope there",
                )
            )
        yield SoughtSegment(index, number.parameter, contacts, segment + 1, float(curve.deflection[segment]))
