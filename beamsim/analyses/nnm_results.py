"""What ``beamsim nnm`` hands back: branches of nonlinear normal modes and a motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.model.structure import ModeTable

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

__all__ = ["BranchJump", "ModeBranch", "NormalModeResult", "OrbitMotion"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class BranchJump:
    """A gap in a backbone where an internal resonance cuts it."""

    start: float  # parameter
    end: float
    mode: int  # the other mode, from 1; 0 where it isn't known
    ratio: int  # n of n:1; 0 where it isn't known


@dataclass(frozen=True)
class ModeBranch:
    """A branch of nonlinear normal modes: the backbone, or a tongue of internal resonance."""

    kind: str  # "backbone" or "tongue"
    status: str
    parameter: Floats  # (np,) stiffness factor, energy in J, or frequency in Hz
    frequency_hz: Floats  # (np,)
    energy: Floats  # (np,) J, from static equilibrium
    share: Floats  # (np,) of the energy in the mode asked for, at rest
    residual: Floats  # (np,) of the periodicity, against the motion's speed
    coordinates: Floats  # (np, n) at rest
    initial_displacement: Floats  # (np, nx) m, deflection at rest at the stations
    stable: Bools  # (np,)
    floquet_multipliers: Complexes  # (np, 2 n)
    mode: int = 0  # of a tongue: the other mode, from 1
    ratio: int = 0  # of a tongue: n of n:1
    special: tuple[OrbitEvent, ...] = ()


@dataclass(frozen=True)
class OrbitMotion:
    """One period of one motion."""

    time: Floats  # (nt,) s, both ends included
    displacement: dict[str, Floats]  # probe -> (nt,) m
    velocity: dict[str, Floats]  # probe -> (nt,) m/s
    force: dict[str, Floats]  # snubber -> (nt,) N
    stations: Floats  # (nt, nx) m, deflection at the stations
    harmonics: dict[str, Complexes]  # probe -> (21,) amplitude of e^{i k omega t}, order 0 to 20, zero to peak


@dataclass(frozen=True)
class NormalModeResult:
    """Everything `beamsim nnm` computes."""

    scenario: Scenario  # resolved
    mode: int  # from 1
    parameter: str  # stiffness_factor, energy or frequency
    status: str  # "complete" or why the backbone ended early
    branches: tuple[ModeBranch, ...]  # the backbone first
    jumps: tuple[BranchJump, ...]
    position: Floats  # (nx,) m, or mass numbers
    linear_shape: Floats  # (nx,) the linear mode at the same largest deflection as the last motion
    extreme_shapes: Floats  # (2, nx) m, the last motion at both instants of rest
    motion: OrbitMotion  # of the last point of the backbone
    modes: ModeTable
    summary: dict[str, Any]
    warnings: tuple[str, ...] = ()
    wall_time_s: float = 0.0
    created: str = ""
    provenance: dict[str, str] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether the backbone reached its end."""
        return self.status == "complete"

    @property
    def title(self) -> str:
        """The scenario's title."""
        return self.scenario.title
