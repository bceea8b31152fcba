"""What ``beamsim nnm`` hands back: branches of nonlinear normal modes and a motion."""

from __future__ import annotations

from dataclasses import dataclass

from beamsim.analyses.nnm.multiple_scales import ExpansionComparison
from beamsim.analyses.nnm.phase_resonance_results import PhaseResonance
from beamsim.analyses.nnm.thesis_method import RelaxedComparison
from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.analyses.outcome import Outcome
from beamsim.system.structural import ModeTable
from beamsim.typing import Bools, Complexes, Floats


@dataclass(frozen=True)
class BranchJump:
    """A gap in a backbone where an internal resonance cuts it."""

    start: float  # parameter
    end: float
    mode: int  # the other mode, from 1; 0 where it isn't known
    ratio: int  # n of n:1; 0 where it isn't known


@dataclass(frozen=True)
class ModeBranch:
    """A branch of periodic motions: the backbone, a tongue of internal resonance, or motions that are never at rest.

    Each motion is given at its slowest instant, which for all but the last kind is an instant of rest.
    """

    kind: str  # "backbone", "tongue" or "never_at_rest"
    status: str
    parameter: Floats  # (np,) stiffness factor, energy in J, or frequency in Hz
    frequency_hz: Floats  # (np,)
    energy: Floats  # (np,) J, from static equilibrium
    share: Floats  # (np,) of the energy in the mode asked for, at the slowest instant
    residual: Floats  # (np,) of the periodicity, against the motion's speed
    coordinates: Floats  # (np, n) at the slowest instant
    coordinate_velocities: Floats  # (np, n) the same; zero at rest
    least_kinetic: Floats  # (np,) kinetic energy at the slowest instant, share of the energy; zero at rest
    initial_displacement: Floats  # (np, nx) m, deflection at the slowest instant at the stations
    stable: Bools  # (np,)
    floquet_multipliers: Complexes  # (np, 2 n)
    mode: int = 0  # of a tongue and of motions never at rest: the other mode, from 1
    ratio: int = 0  # of the same: n of n:1
    special: tuple[OrbitEvent, ...] = ()


@dataclass(frozen=True)
class OrbitMotion:
    """One period of one motion, from its slowest instant, and its spectrum."""

    time: Floats  # (nt,) s, both ends included
    displacement: dict[str, Floats]  # probe -> (nt,) m
    velocity: dict[str, Floats]  # probe -> (nt,) m/s
    force: dict[str, Floats]  # snubber -> (nt,) N
    stations: Floats  # (nt, nx) m, deflection at the stations
    harmonics: dict[str, Complexes]  # probe -> (21,) amplitude of e^{i k omega t}, order 0 to 20, zero to peak
    periods: int  # that the flow was carried on for the spectrum
    spectrum_frequency_hz: Floats  # (nf,) a step of 1 / (periods x period)
    spectrum: dict[str, Floats]  # probe -> (nf,) m, single-sided amplitude, zero to peak
    drift: float  # relative distance of the state from the first one after these periods

    @property
    def at_rest(self) -> Floats:
        """(2, nx) m, deflection at the slowest instant and half a period later: the extremes of a motion at rest."""
        return self.stations[[0, (self.time.size - 1) // 2]]

    @property
    def underway(self) -> Floats:
        """(2, nx) m, deflection an eighth and three eighths of a period later."""
        return self.stations[[(self.time.size - 1) // 8, 3 * (self.time.size - 1) // 8]]


@dataclass(frozen=True)
class NormalModeResult(Outcome):
    """Everything `beamsim nnm` computes."""

    mode: int  # from 1
    parameter: str  # stiffness_factor, energy or frequency
    method: str  # shooting, full_period, multiple_scales or thesis
    branches: tuple[ModeBranch, ...]  # the backbone first
    jumps: tuple[BranchJump, ...]
    position: Floats  # (nx,) m, or mass numbers
    linear_shape: Floats  # (nx,) the linear mode at the same largest deflection as the motion
    motion: OrbitMotion  # of one point of one branch:
    motion_branch: int  # which branch: the backbone, or the first that is never at rest
    motion_point: int  # which point: the backbone's last, or the furthest from rest
    modes: ModeTable
    phase_resonance: PhaseResonance | None = None  # the damped structure held on the mode, where asked for
    half_period_difference: Floats | None = (
        None  # (np,) full_period: relative, of the backbone from half-period shooting
    )
    expansion: ExpansionComparison | None = None  # by multiple scales, where asked for
    relaxed: RelaxedComparison | None = None  # the thesis's method, where asked for

    @property
    def backbone(self) -> ModeBranch:
        """The branch of the mode itself."""
        return self.branches[0]

    @property
    def tongues(self) -> tuple[ModeBranch, ...]:
        """The branches of internal resonance."""
        return tuple(b for b in self.branches if b.kind == "tongue")

    @property
    def never_at_rest(self) -> tuple[ModeBranch, ...]:
        """The branches of motions that are never at rest all at once."""
        return tuple(b for b in self.branches if b.kind == "never_at_rest")
