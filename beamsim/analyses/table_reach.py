"""Stops that are pressed further than their tables of force and deflection go."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from beamsim.contacts.force_curve import ForceCurve
from beamsim.scenario import Scenario
from beamsim.system.force_tables import curves_of
from beamsim.typing import Floats

_REST = "; the last slope continues beyond it, which may be too soft: measure further, or add points"


def forces_beyond_tables(scenario: Scenario, forces: Iterable[Mapping[str, Floats]]) -> list[str]:
    """A warning for each stop whose force exceeds the last one of its table.

    Parameters
    ----------
    forces : N, largest contact forces by snubber, of each curve, branch or study.
    """
    largest: dict[str, float] = {}
    for curve in forces:
        for name, values in curve.items():
            largest[name] = max(largest.get(name, 0.0), float(np.nanmax(values, initial=0.0)))
    return [
        f"snubbers.{name}: its force reaches {largest[name]:.4g} N, its table ends at {_end(curve)}{_REST}"
        for name, curve in _tables(scenario).items()
        if largest.get(name, 0.0) > curve.force[-1]
    ]


def compressed_beyond_tables(scenario: Scenario, compression: Mapping[str, float]) -> list[str]:
    """A warning for each stop that is compressed further than its table goes.

    Parameters
    ----------
    compression : m, the largest of each snubber.
    """
    return [
        f"snubbers.{name}: it is compressed by up to {1e3 * compression[name]:.4g} mm, its table ends at "
        f"{_end(curve)}{_REST}"
        for name, curve in _tables(scenario).items()
        if compression[name] > curve.deflection[-1]
    ]


def _end(curve: ForceCurve) -> str:
    return f"{1e3 * curve.deflection[-1]:.4g} mm, {curve.force[-1]:.4g} N"


def _tables(scenario: Scenario) -> dict[str, ForceCurve]:
    named = zip(scenario.located_snubbers, curves_of(scenario), strict=True)
    return {snubber.name: curve for (_, _, snubber, _), curve in named if curve is not None}
