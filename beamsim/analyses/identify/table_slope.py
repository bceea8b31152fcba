"""Natural frequencies with permanent contact beside a force-deflection table: they give its slope where it rests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from beamsim.analyses.identify.result import TableSlope
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.parameters import with_values
from beamsim.system.build import build_system
from beamsim.system.force_tables import curves_of

_AT_A_BEND = 1e-3  # of the deflection at rest: closer to a bend a vibration is on both segments


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
        at_a_bend=bool(np.any(np.abs(bends - deflection) < _AT_A_BEND * deflection)),
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
