"""What exciting a damped structure on its nonlinear mode hands back."""

from __future__ import annotations

from dataclasses import dataclass

from beamsim.typing import Bools, Complexes, Floats


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
