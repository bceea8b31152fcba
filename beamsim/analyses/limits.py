"""Margins against the allowables of a scenario.

The margin of safety is limit / value - 1: zero where the limit is just reached, negative beyond it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from beamsim.analyses.values import LIMITED
from beamsim.scenario import Scenario
from beamsim.scenario.reporting import OF_OUTPUTS, Limits


def limit_unit(scenario: Scenario, name: str) -> str:
    """SI unit of a limit."""
    if name.startswith(OF_OUTPUTS):
        from beamsim.system.outputs import output_units

        return output_units(scenario)[name.removeprefix(OF_OUTPUTS)]
    return LIMITED[name].unit


def limit_label(name: str) -> str:
    """The name for people.

    >>> limit_label("peak_force"), limit_label("outputs.root_moment")
    ('peak force', 'output root_moment')
    """
    return f"output {name.removeprefix(OF_OUTPUTS)}" if name.startswith(OF_OUTPUTS) else name.replace("_", " ")


def margin_of(limit: float, value: float) -> float:
    """Return limit / value - 1, infinite if the value is zero.

    >>> margin_of(50.0, 40.0)
    0.25
    """
    return limit / value - 1.0 if value > 0.0 else math.nan if math.isnan(value) else math.inf


def margins(limits: Limits | None, summary: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Compare the summary of a run with the limits: by limit its limit, value, margin, at and exceeded (SI)."""
    largest = {}
    for name in {} if limits is None else limits.given:
        if name.startswith(OF_OUTPUTS):
            largest[name] = float(summary["peak_output"][name.removeprefix(OF_OUTPUTS)]), ""
            continue
        limited = LIMITED[name]
        given = summary[limited.entry]
        if isinstance(given, Mapping):
            at = max(given, key=lambda place: given[place])
            value = float(given[at])
        else:
            body = f"{summary['largest_bending_stress_body']}, " if "largest_bending_stress_body" in summary else ""
            at, value = f"{body}x = {summary['largest_bending_stress_position_m']:.6g} m", float(given)
        largest[name] = value * limited.scale, at
    return margins_of(limits, largest)


def margins_of(limits: Limits | None, largest: Mapping[str, tuple[float, str]]) -> dict[str, dict[str, Any]]:
    """By limit its limit, value, margin, at and exceeded, of the largest values by limit and where they are (SI)."""
    given = {} if limits is None else limits.given
    return {
        name: {
            "limit": limit,
            "value": largest[name][0],
            "margin": margin_of(limit, largest[name][0]),
            "at": largest[name][1],
            "exceeded": largest[name][0] > limit,
        }
        for name, limit in given.items()
        if name in largest
    }


def exceeded_limits(scenario: Scenario, compared: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A message for every limit that is exceeded."""
    units = {name: limit_unit(scenario, name) for name, item in compared.items() if item["exceeded"]}
    return [
        f"{limit_label(name)} = {compared[name]['value']:.5g} {unit} exceeds limits.{name} = "
        f"{compared[name]['limit']:.5g} {unit}"
        for name, unit in units.items()
    ]
