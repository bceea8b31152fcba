"""What a sweep hands back: a curve for every direction and level, the peaks in them, and a summary."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from beamsim.analyses.result import Result
from beamsim.outcomes import Outcome
from beamsim.system.structural import ModeTable
from beamsim.typing import Bools, Complexes, Floats, Ints


@dataclass(frozen=True)
class Envelope:
    """One quantity at one place, cycle by cycle (or frequency by frequency)."""

    quantity: str  # "displacement", "absolute_acceleration" or "force"
    unit: str
    maximum: Floats  # (C,) largest value within the cycle
    minimum: Floats  # (C,) smallest
    rms: Floats  # (C,) root of the mean square over the cycle, mean included
    mean: Floats  # (C,) over the phase
    harmonics: Complexes  # (R, C) amplitude of cos(order phase) - i that of sin, zero to peak

    @property
    def peak(self) -> Floats:
        """(C,) largest absolute value."""
        return np.maximum(np.abs(self.maximum), np.abs(self.minimum))


@dataclass(frozen=True)
class SteadyStates:
    """What the stepped sweep found at every frequency."""

    kind: tuple[str, ...]  # "periodic", "quasi-periodic", "chaotic" or "not settled"
    period_cycles: Ints  # cycles of the excitation after which the motion repeats; 0 where it doesn't
    cycles: Ints  # cycles computed
    change: Floats  # of the state over one period, over its size, when the frequency was left
    lyapunov_exponent: Floats  # 1/s, largest; nan where the motion is periodic
    poincare_frequency_hz: Floats  # (Q,) frequency of each point of the Poincare sections
    poincare_displacement: Floats  # (Q, probes) m, at phase 0
    poincare_velocity: Floats  # (Q, probes) m/s


@dataclass(frozen=True)
class SweepCurve:
    """One way through the frequencies at one level."""

    name: str  # "<direction>_<level index>"
    direction: str  # "up" or "down"
    level_index: int
    level: float  # amplitude in SI; with a profile the factor on it
    quantity: str
    frequency_hz: Floats  # (C,) in the middle of each cycle
    time: Floats  # (C,) s, at its start
    excitation_amplitude: Floats  # (C,) m/s^2 of the base or N, zero to peak
    orders: Floats  # (R,)
    displacement: dict[str, Envelope]  # by probe
    acceleration: dict[str, Envelope]  # by probe; empty where not asked for
    force: dict[str, Envelope]  # by snubber
    contact_share: dict[str, Floats]  # by snubber, (C,)
    contacts: dict[str, Ints]  # by snubber, (C,) closings
    steady: SteadyStates | None = None  # of a stepped sweep
    # largest value of each cycle, (C,), of what limits ask for beyond the above: "bending_stress" Pa, "gap <snubber>" m
    limited: dict[str, Floats] = field(default_factory=dict)
    bent: Bools | None = None  # (C,) whether a piecewise-linear spring met a breakpoint; not stored


@dataclass(frozen=True)
class LinearCurve:
    """Steady response of the structure without its snubbers to a unit of the excitation's amplitude."""

    frequency_hz: Floats  # (F,)
    displacement: dict[str, Complexes]  # by probe, m per m/s^2 or per N
    acceleration: dict[str, Complexes]  # by probe, absolute
    contact: dict[str, ContactLevels] = field(default_factory=dict)  # by snubber


@dataclass(frozen=True)
class ContactLevels:
    """What keeps or breaks one contact under a steady sine while the motion is linear, at each frequency.

    A snubber that is open at equilibrium first touches at ``onset``; one that is closed first lifts off at ``loss``.
    """

    onset: Floats  # (F,) level at which contact begins; nan where the snubber is closed at equilibrium
    loss: Floats  # (F,) level at which contact is lost; nan where the snubber is open at equilibrium
    preload_needed: Floats  # (F,) N per unit of level: the preload that just keeps contact, all snubbers closed


@dataclass(frozen=True)
class ResponsePeak:
    """A local maximum of a response curve, and what it is."""

    curve: str
    probe: str
    direction: str
    level: float
    frequency_hz: float
    value_m: float  # peak displacement
    kind: str  # "linear resonance", "nonlinear resonance", "superharmonic", "subharmonic"
    order: float  # of the harmonic that resonates there
    share: float  # of that harmonic's amplitude in the peak displacement


@dataclass(frozen=True)
class SweepHistory:
    """The time history of one sweep."""

    time: Floats  # (nt,) s
    displacement: dict[str, Floats]
    acceleration: dict[str, Floats]
    force: dict[str, Floats]


@dataclass(frozen=True)
class SweepWork:
    """What the solver did."""

    cycles: int
    events: int
    segments: int
    evaluations: int
    states: int
    processor_time_s: float


@dataclass(frozen=True)
class LevelWork:
    """One level that was computed."""

    level: float
    outcome: Outcome
    truncation: float
    work: SweepWork


@dataclass(frozen=True)
class SweepResult(Result):
    """Everything one `beamsim sweep` of one design computes."""

    kind: str  # "swept_sine" or "stepped"
    curves: dict[str, SweepCurve]
    linear: LinearCurve
    peaks: tuple[ResponsePeak, ...]
    modes: ModeTable
    work: SweepWork
    levels: dict[int, LevelWork] = field(default_factory=dict)  # the levels that were computed, by index
    histories: dict[int, SweepHistory] = field(default_factory=dict)  # by level index
    truncation: float = 0.0  # bound on what the expansion of the sine leaves out, of its amplitude
