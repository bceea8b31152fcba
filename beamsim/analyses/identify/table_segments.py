"""Segments of force-deflection tables among the parameters of a fit: which of them the measured vibrations reach."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from beamsim.analyses.identify.model_updating import Sought
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Scenario
from beamsim.system.force_tables import curves_of
from beamsim.typing import Bools, Floats

KEYS = ("force_deflection", "segment_factors")
_ROUND_OFF = 1e-9  # of the deflection at which a segment begins: a motion that ends there is in no later segment


@dataclass(frozen=True)
class SoughtSegment:
    """A segment whose stiffness is sought."""

    number: int  # of the parameter
    parameter: str
    contacts: tuple[int, ...]  # numbers of the snubbers that have the table
    segment: int  # from 1
    begin: float  # m, deflection

    def reached(self, penetration: Floats) -> bool:
        """Whether one of these is larger than where the segment begins; (tests, m) the largest of each contact."""
        return bool(np.any(penetration[:, list(self.contacts)] > self.begin * (1.0 + _ROUND_OFF)))


def sought_segments(scenario: Scenario, numbers: Sequence[Sought]) -> tuple[SoughtSegment, ...]:
    """The parameters that are factors of one segment.

    Raises
    ------
    ScenarioError
        For a segment without slope, which no factor changes.
    """
    return tuple(_sought_segments(scenario, numbers))


def _sought_segments(scenario: Scenario, numbers: Sequence[Sought]) -> Iterator[SoughtSegment]:
    curves, snubbers = curves_of(scenario), scenario.located_snubbers
    for index, number in enumerate(numbers):
        if len(number.places) > 1 or number.places[0][-3:-1] != KEYS:
            continue
        *path, _, _, segment = number.places[0]
        contacts = tuple(j for j, located in enumerate(snubbers) if located.path == tuple(path))
        curve = curves[contacts[0]]
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
        begin = float(curve.deflection[segment])
        yield SoughtSegment(index, number.parameter, contacts, segment + 1, begin)


def unreached(segments: Sequence[SoughtSegment], count: int, penetration: Floats) -> Bools:
    """(count,) which of the parameters are those of segments that no test reaches.

    Parameters
    ----------
    penetration : (tests, m) largest one of each contact, m.
    """
    out = np.zeros(count, dtype=bool)
    for item in segments:
        out[item.number] = not item.reached(penetration)
    return out


def segment_warnings(segments: Sequence[SoughtSegment], penetration: Floats) -> list[str]:
    """Which segments no test reaches, and what to do."""
    warnings = []
    for item in segments:
        if item.reached(penetration):
            continue
        largest = max(float(penetration[:, list(item.contacts)].max()), 0.0)
        warnings.append(
            f"{item.parameter}: no test reaches segment {item.segment}, which begins at {1e3 * item.begin:.4g} mm "
            f"(largest penetration {1e3 * largest:.4g} mm): it keeps its value; add a test at a higher level, or leave "
            "it out"
        )
    return warnings
