"""Special points of branches of periodic motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class OrbitEvent:
    """A special point of a branch."""

    kind: str  # fold, period_doubling, neimark_sacker, branch_point or grazing
    parameter: float  # of the branch
    frequency_hz: float
    snubber: str = ""  # of a grazing
    time_s: float = np.nan  # in the period, of a grazing
