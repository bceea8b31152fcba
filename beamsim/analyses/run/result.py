"""What an analysis hands back: frozen dataclasses with shapes and units, ready to store or draw."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from beamsim.analyses.outcome import Outcome
from beamsim.system.structural import ModeTable, SnubberNumbers
from beamsim.typing import Bools, Floats, Ints

if TYPE_CHECKING:
    from beamsim.analyses.run.random_response import RandomResponse


@dataclass(frozen=True)
class ProbeHistory:
    """Motion of one probe at the output times."""

    name: str
    position: float  # m along the beam; the mass number for a chain
    displacement: Floats  # (nt,) m, relative to the base
    absolute_displacement: Floats  # (nt,) m
    velocity: Floats  # (nt,) m/s, relative to the base
    absolute_acceleration: Floats  # (nt,) m/s^2


@dataclass(frozen=True)
class SnubberHistory(SnubberNumbers):
    """One snubber at the output times."""

    force: Floats  # (nt,) N, positive when it pushes
    penetration: Floats  # (nt,) m
    closed: Bools  # (nt,)
    displacement: Floats  # (nt,) m, of the structure at the snubber, relative to the base; the stretch between masses
    velocity: Floats  # (nt,) m/s


@dataclass(frozen=True)
class SpringHistory:
    """One nonlinear spring of a chain at the output times."""

    name: str
    kind: str  # "cubic" or "piecewise_linear"
    masses: tuple[int, ...]  # the one it ties to the ground, or the two it joins
    stretch: Floats  # (nt,) m; to the ground the absolute displacement of the mass
    force: Floats  # (nt,) N, positive where it pulls back a positive stretch


@dataclass(frozen=True)
class EventLog:
    """Contact events of the snubbers in order of time; breakpoints of piecewise-linear springs are not among them."""

    time: Floats  # (ne,) s
    snubber: Ints  # (ne,) index into the scenario's snubbers
    closing: Bools  # (ne,)


@dataclass(frozen=True)
class SpectralLine:
    """One line of the harmonics table."""

    order: float  # frequency over excitation frequency (nan without excitation frequency)
    frequency_hz: float
    amplitude: float  # zero to peak, in the unit of the spectrum's quantity
    amplitude_db: float  # 20 log10(amplitude / max |x|)
    phase_deg: float
    kind: str  # "fundamental", "superharmonic", "subharmonic", "mean" or "other"


@dataclass(frozen=True)
class Spectrum:
    """Single-sided spectrum of one quantity of one probe."""

    probe: str
    quantity: str  # "absolute_acceleration" or "displacement"
    unit: str  # "m/s^2" or "m"
    frequency_hz: Floats  # (nf,)
    amplitude: Floats  # (nf,) single-sided peak amplitude
    amplitude_db: Floats  # (nf,) 20 log10(amplitude / max |x|)
    excitation_hz: float  # nan where there is no single excitation frequency
    window: str
    start_s: float  # beginning of the analysed part
    duration_s: float
    lines: tuple[SpectralLine, ...] = ()


@dataclass(frozen=True)
class BeamResult:
    """What is known along the beam."""

    position: Floats  # (nx,) m
    peak_bending_stress: Floats  # (nx,) Pa, largest absolute value at any time
    extreme_shapes: Floats  # (2, nx) m, deflection at the lowest and highest point of the first probe
    extreme_times: Floats  # (2,) s
    static_shape: Floats  # (nx,) m, at static equilibrium (nan where there is none)


@dataclass(frozen=True)
class EnergyHistory:
    """Energies at the output times, relative frame; work_in = dissipated + stored - stored[0]."""

    work_in: Floats  # (nt,) J
    dissipated: Floats  # (nt,) J
    stored: Floats  # (nt,) J


@dataclass(frozen=True)
class Work:
    """What the solver did."""

    events: int
    evaluations: int  # of the watched functions
    segments: int
    states: int  # contact states that were diagonalised
    processor_time_s: float  # of the solver alone


@dataclass(frozen=True)
class RunResult(Outcome):
    """Everything `beamsim run` computes."""

    method: str  # "exact" or "reference (BDF)" ...
    time: Floats  # (nt,) s
    probes: dict[str, ProbeHistory]
    snubbers: dict[str, SnubberHistory]
    base_acceleration: Floats  # (nt,) m/s^2 (zeros without base motion)
    base_displacement: Floats  # (nt,) m
    events: EventLog
    spectra: dict[tuple[str, str], Spectrum]  # keyed by (probe name, quantity)
    beam: BeamResult | None  # None for a chain
    energy: EnergyHistory
    modes: ModeTable
    work: Work
    random: RandomResponse | None = None  # of a random or sampled input
    springs: dict[str, SpringHistory] = field(default_factory=dict)  # nonlinear springs of a chain
