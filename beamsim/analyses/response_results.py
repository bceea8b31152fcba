"""What the continuation of forced periodic motions hands back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.model.structure import ModeTable

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

__all__ = ["FrequencyResponse", "ResponseBranch"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class ResponseBranch:
    """A branch of forced periodic motions at one level."""

    level: float  # SI
    period_multiple: int  # periods of the excitation in one of the motion
    status: str
    frequency_hz: Floats  # (np,)
    peak_displacement: dict[str, Floats]  # probe -> (np,) m, largest absolute value
    max_displacement: dict[str, Floats]  # probe -> (np,) m
    min_displacement: dict[str, Floats]  # probe -> (np,) m
    harmonics: dict[str, Complexes]  # probe -> (np, 6) amplitudes at the orders 0 to 5 of the motion's own frequency, m
    peak_force: dict[str, Floats]  # snubber -> (np,) N
    stable: Bools  # (np,)
    floquet_multipliers: Complexes  # (np, N)
    residual: Floats  # (np,)
    special: tuple[OrbitEvent, ...] = ()


@dataclass(frozen=True)
class FrequencyResponse:
    """Everything `beamsim sweep` of kind continuation computes."""

    scenario: Scenario
    status: str
    branches: tuple[ResponseBranch, ...]
    modes: ModeTable
    summary: dict[str, Any]
    warnings: tuple[str, ...] = ()
    wall_time_s: float = 0.0
    created: str = ""
    provenance: dict[str, str] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether every main branch reached its end."""
        return self.status == "complete"

    @property
    def title(self) -> str:
        """The scenario's title."""
        return self.scenario.title
