"""What ``beamsim nnm`` hands back: branches of nonlinear normal modes and a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.analyses.result import Result
from beamsim.structures.stations import Stations
from beamsim.system.structural import ModeTable
from beamsim.typing import Bools, Complexes, Floats, Ints

SAFELY = 3.0  # factors this much below the expansion's reach count as small
FATES = {
    "same": "Newton's method leads from it to the backbone's motion",
    "other": "Newton's method leads from it to another motion",
    "none": "there is no periodic motion near it",
    "between": "the backbone has no motion there (a tongue cuts it)",
}


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
class PredictedLevels:
    """The level that energy balance asks for along a backbone."""

    energy: Floats  # (np,) J, from static equilibrium
    frequency_hz: Floats  # (np,)
    level: Floats  # (np,) SI unit of the excitation
    dissipated: Floats  # (np,) J a period, by structure and contacts
    contact_share: Floats  # (np,) of it that the contacts' dashpots take
    amplitude: dict[str, Floats]  # probe -> (np,) m, largest deflection of a period


@dataclass(frozen=True)
class ResponseCurve:
    """Forced periodic motions about a resonance."""

    status: str
    frequency_hz: Floats  # (np,)
    amplitude: dict[str, Floats]  # probe -> (np,) m, largest deflection of a period
    stable: Bools  # (np,)


@dataclass(frozen=True)
class HeldMotion:
    """The damped structure carried from the mode's own state, under the force predicted."""

    time: Floats  # (nt,) s, whole periods, the end left out
    displacement: dict[str, Floats]  # probe -> (nt,) m
    frequency_hz: Floats  # (nf,) lines over all these periods
    amplitude: dict[str, Floats]  # probe -> (nf,) m, zero to peak
    departure: Floats  # (N,) largest distance from the mode in each period, in the norm of energy, against the mode's
    instants: Floats  # (2,) s, in the last period, at which the mode is at rest
    shapes: Floats  # (2, nx) m, deflection then
    mode_shapes: Floats  # (2, nx) m, the mode's


@dataclass(frozen=True)
class ResonantMotion:
    """One level: the mode it should hold, and the forced motion that is found."""

    level: float  # SI unit of the excitation
    predicted_frequency_hz: float
    predicted_energy: float  # J
    predicted_amplitude: dict[str, float]  # probe -> m
    found: bool  # whether the exact motion was found; what follows of it is nan where not
    frequency_hz: float
    amplitude: dict[str, float]  # probe -> m
    level_for_amplitude: float  # level predicted for the amplitude found at `PhaseResonance.probe`
    stable: bool
    floquet_multipliers: Complexes  # (N,)
    residual: float  # of the periodicity, against the motion's size
    quadrature: float  # cosine of the lag between force and deflection
    curve: ResponseCurve | None
    held: HeldMotion | None


@dataclass(frozen=True)
class PhaseResonance:
    """A nonlinear mode held by a force, at several levels."""

    status: str  # "complete" or what was not found
    quantity: str  # of the level: force, acceleration, velocity or displacement
    unit: str  # SI, of the level
    probe: str  # whose amplitude is compared: the one that moves most
    scales: bool  # no gap, no load: the level is proportional to the amplitude, the frequency does not change
    predicted: PredictedLevels
    motions: tuple[ResonantMotion, ...]  # one a level

    @property
    def complete(self) -> bool:
        """Whether every level's motion was found."""
        return self.status == "complete"


@dataclass(frozen=True)
class ExpansionPath:
    """Frequency and initial condition of a nonlinear normal mode against the stiffness factor, to orders 0, 1 and 2."""

    mode: int  # from 1
    energy: float  # J, from static equilibrium
    linear_frequency_hz: float
    first_hz: float  # change of the frequency per factor, Hz, at the linear mode's amplitude
    second_hz: float  # per squared factor
    factor: Floats  # (E,)
    frequency_hz: Floats  # (E, 3) to order 0, 1, 2
    coordinates: Floats  # (E, 3, n) initial vector: the shape at rest at t = 0
    initial_displacement: Floats  # (E, 3, nx) m, at the stations
    stations: Stations  # nx of them
    partner: int  # mode (from 1) with the largest first-order component
    harmonic: int  # and its harmonic
    reach: float  # factors should be well below this one
    uniform_coordinates: Floats  # (E, 3, n) initial vector of the uniform expansion
    pole: float  # factor above which the initial vector is not yet at its asymptotic order
    pole_mode: int  # the mode (from 1; 0 for none) whose coordinate it is
    pole_harmonic: int  # and the harmonic that is close to it

    @property
    def small(self) -> float:
        """Factors up to this one count as small."""
        return self.reach / SAFELY * (1.0 + 1e-9)


@dataclass(frozen=True)
class ExactModes:
    """Exact motions at the same energy (shooting); nan where none was found near the expansion."""

    factor: Floats  # (E,)
    frequency_hz: Floats  # (E,)
    coordinates: Floats  # (E, n)
    initial_displacement: Floats  # (E, nx) m, at the stations
    residual: Floats  # (E,)


@dataclass(frozen=True)
class ExpansionComparison:
    """Expansion against exact motion."""

    path: ExpansionPath
    exact: ExactModes
    frequency_difference: Floats  # (E, 3) relative to the exact frequency
    initial_difference: Floats  # (E, 3) relative, in the norm of the linear strain energy
    frequency_orders: Floats  # (E - 1, 3) observed, between neighbouring factors
    initial_orders: Floats  # (E - 1, 3)
    expected_orders: Floats  # (E - 1, 3) of the initial vector, from the uniform expansion instead of the exact motion
    uniform_difference: Floats  # (E, 3) of the uniform expansion's initial vector
    uniform_orders: Floats  # (E - 1, 3)


@dataclass(frozen=True)
class RelaxedComparison:
    """A path of relaxed minimisation, step by step, and the exact motions at the same factors."""

    steps: int  # asked for
    tolerance: float  # of the functional
    status: str  # "complete" or why it ended early
    factor: Floats  # (S,) of the steps taken; the last one may not have been reached
    frequency_hz: Floats  # (S,)
    functional: Floats  # (S,) what was minimised, at its end
    passages: Ints  # (S,) motions computed
    processor_time_s: Floats  # (S,)
    reached: Bools  # (S,) whether the functional fell below the tolerance
    coordinates: Floats  # (S, n) shape at rest
    initial_displacement: Floats  # (S, nx) m
    exact_frequency_hz: Floats  # (S,) of the backbone; nan where a tongue cuts it
    frequency_difference: Floats  # (S,) relative to the exact one
    shape_difference: Floats  # (S,) relative, in the norm of the linear strain energy
    fate: tuple[str, ...]  # (S,) one of FATES
    jumped: Bools  # (S,) steps that left the motion which the step before was on
    shooting_passages: int  # motions computed for the backbone, its tongues and the same factors
    shooting_processor_time_s: float

    @property
    def steps_reached(self) -> int:
        """Number of steps whose functional fell below the tolerance."""
        return int(np.count_nonzero(self.reached))

    @property
    def cost_ratio(self) -> float:
        """Processor time over that of shooting."""
        return float(self.processor_time_s.sum() / max(self.shooting_processor_time_s, 1e-9))


@dataclass(frozen=True)
class NormalModeResult(Result):
    """Everything `beamsim nnm` computes."""

    mode: int  # from 1
    parameter: str  # stiffness_factor, energy or frequency
    method: str  # shooting, full_period, multiple_scales or thesis
    branches: tuple[ModeBranch, ...]  # the backbone first
    jumps: tuple[BranchJump, ...]
    stations: Stations  # nx of them
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
