"""Computed deflections that are too large for the theory they are computed with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from beamsim.scenario import Scenario
from beamsim.scenario.scenario import large_deflections
from beamsim.system.structural import ModeTable
from beamsim.typing import Floats


def deflection_warnings(scenario: Scenario, modes: ModeTable, motions: Iterable[Mapping[str, Floats]]) -> list[str]:
    """A warning for each body whose deflection is not small; none where rigid-body modes carry it as far as they like.

    Parameters
    ----------
    motions : m, largest displacements by probe, of each curve or branch.
    """
    if np.isnan(modes.damping_ratios).any():
        return []
    peaks: dict[str, float] = {}
    for motion in motions:
        for probe, values in motion.items():
            peaks[probe] = max(peaks.get(probe, 0.0), float(np.nanmax(values, initial=0.0)))
    return large_deflections(scenario, peaks)
