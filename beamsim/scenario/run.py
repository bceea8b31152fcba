"""A run in time: duration, output, initial state, method."""

from __future__ import annotations

from dataclasses import replace
from math import log2
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import Path, Schema, ShortFor, Unfit, Variants
from beamsim.scenario.body import PlacedForce
from beamsim.scenario.excitation import FrequencyRange
from beamsim.scenario.reporting import AnyOutput, Stress

MOST_OSCILLATORS = 10_000
MOST_PERIODS = 2_000_000  # of the highest oscillator in a run: several panels each are kept
MOST_FILTERED = 100_000_000  # periods of a low-pass's frequency in a run: hours
MOST_FREQUENCIES = 50_000  # of the curve of a spectrum


NonNegativeForce = Annotated[float, q.Quantity(units.FORCE, minimum=0.0)]
StressExponent = Annotated[
    float, q.Quantity(replace(units.NUMBER, name="exponent", example="5"), minimum=1.0, maximum=100.0)
]


class ImpactSettings(Schema):
    """Statistics of the impacts at each snubber; an impact lasts from closing to opening."""

    minimum_rest: q.Time = 0.0
    """Contacts of one snubber that are less far apart are one impact."""
    force_threshold: NonNegativeForce = 0.0
    """Impacts whose peak force is smaller are not counted; sums over all time keep them."""


class StressLife(Schema):
    """S-N line of the material: N = cycles (stress_range / S)^exponent, S being the range of a cycle (twice its
    amplitude)."""

    stress_range: Stress
    """Stress range (twice the amplitude) that is endured for `cycles` cycles."""
    cycles: q.PositiveNumber = 2e6
    """Cycles endured at that range."""
    exponent: StressExponent
    """Exponent of the line, 1 to 100: about 3 for welds, 5 to 10 for smooth metal."""
    endurance_limit: Stress | None = None
    """Stress range up to which a cycle does no damage; none by default."""


class PolynomialStart(Schema):
    """Start from a given shape and velocity: polynomials in x for a beam, one number per mass for a chain."""

    known_by: ClassVar[tuple[str, ...]] = ("displacement", "velocity")
    displacement: tuple[q.ShapeDisplacement, ...] = ()
    """Beam: coefficients of 1, x, x^2, ... (1 mm, 2 mm/m, 3 1/m); chain: displacement of each mass (1 mm)."""
    velocity: tuple[q.ShapeVelocity, ...] = ()
    """Beam: coefficients of 1, x, x^2, ... (0.2 m/s, 2 1/s); chain: velocity of each mass (0.2 m/s)."""

    def check(self) -> None:
        """Reject an empty initial state."""
        if not self.displacement and not self.velocity:
            raise Unfit("is an empty initial state", "give displacement, velocity or both, or write start: rest")


class BodiesStart(Schema):
    """Start from given shapes and velocities of several bodies; those not named begin without either."""

    known_by: ClassVar[tuple[str, ...]] = ("bodies",)
    bodies: Annotated[dict[q.Name, PolynomialStart], Field(min_length=1)]
    """Displacement and velocity by name of the body."""


class ModeStart(Schema):
    """Start from rest in the shape of a linear mode."""

    known_by: ClassVar[tuple[str, ...]] = ("mode", "amplitude")
    mode: q.Count
    """Number of the mode, from 1."""
    amplitude: q.Amplitude
    """Largest displacement of the shape."""


class ReleasedForceStart(Schema):
    """Start from rest in the static shape under a force, which is released."""

    known_by: ClassVar[tuple[str, ...]] = ("released_force",)
    released_force: PlacedForce
    """The force that acts until t = 0."""


class OrbitStart(Schema):
    """Start on a periodic motion of a result file, with its excitation."""

    known_by: ClassVar[tuple[str, ...]] = ("orbit",)
    orbit: q.FileName
    """Result file of `sweep` (continuation); its path is relative to the folder of the scenario."""
    branch: q.NotNegativeWhole = 0
    """Number of the branch, from 0 as in the file."""
    fold_curve: q.NotNegativeWhole | None = None
    """Number of a curve of folds, from 0 as in the file, instead of a branch."""
    point: q.Count
    """Number of the point along the branch, from 1 as in the file."""
    keep_excitation: bool = False
    """Keep the frequency and level of the scenario, and the number that was followed, instead of those of the point."""
    factor: q.PositiveNumber = 1.0
    """Factor of the state, to see whether a disturbed motion returns."""


Start = Annotated[
    Literal["static_equilibrium", "rest"] | PolynomialStart | BodiesStart | ModeStart | ReleasedForceStart | OrbitStart,
    Variants(
        "is not an initial state",
        "write static_equilibrium, rest, {displacement: [...], velocity: [...]}, {mode: 1, amplitude: 1 mm}, "
        "{released_force: {position: 270 mm, force: 10 N}} or {orbit: case.h5, point: 12}",
    ),
]


class SpectrumSettings(Schema):
    """Which part of the run is analysed, and through which window."""

    last: q.Duration | None = None
    """Analyse only this last part of the run; the whole run by default."""
    periods: q.Count | None = None
    """Number of periods of the excitation to analyse at the end of the run, instead of last."""
    window: Literal["rectangular", "hann", "hamming", "blackman", "blackmanharris", "flattop", "decaying"] | None = None
    """Window function; decaying, the falling half of a Hann window, sees the beginning of a shock. By default decaying
    after a half-sine pulse or a step unless the motion lasts, and for a free or measured motion that dies away; else
    hann."""
    to: q.Frequency | None = None
    """Highest frequency of the spectra; by default that of the modes kept and of the excitation."""
    frequencies: tuple[q.Frequency, ...] = ()
    """Frequencies whose amplitudes are listed among the lines, whether or not there is a line."""

    def check(self) -> None:
        """Reject two lengths, and a frequency given twice."""
        for index, frequency in enumerate(self.frequencies):
            if frequency in self.frequencies[:index]:
                raise Unfit(f"= {frequency:g} Hz is given twice", "remove one of them", ("frequencies", index))
        self.exclude("periods", "last")


class ShockSpectrumSettings(FrequencyRange):
    """Shock response spectra: oscillators on what moves as the base and as each probe does."""

    changing: ClassVar[str] = "spectrum"
    suitable: ClassVar[str] = "give a range, from 10 Hz to 2 kHz"
    where_it_falls: ClassVar[str] = "exchange the two"

    quality: q.Quality = 10.0
    """Quality factor Q = 1 / (2 damping ratio) of the oscillators, above that of critical damping."""
    per_octave: q.Count = 12
    """Oscillators per octave."""

    def check(self) -> None:
        """Reject a range that falls, and too many oscillators."""
        super().check()
        if (oscillators := self.per_octave * log2(self.to / self.from_)) > MOST_OSCILLATORS:
            raise Unfit(
                f"= {self.per_octave} makes {oscillators:.3g} oscillators (at most {MOST_OSCILLATORS})",
                "give fewer per octave, 12 or 24 are usual, or a narrower range", ("per_octave",),
            )  # fmt: skip


class SensitiveParameter(Schema):
    """A number by which the values of a run are differentiated."""

    path: q.Text
    """Path of the number, for example snubbers.tip.gap."""
    also: tuple[q.Text, ...] = ()
    """Other paths that take the same value, such as a probe that moves with a snubber."""
    tolerance: q.AnyValue = "1 %"
    """Deviation for which the change of the values is told: in percent of the number, or in the quantity's own unit."""


class Run(Schema):
    """A run in time."""

    duration: q.Duration
    """Simulated time."""
    test_duration: q.Duration | None = None
    """How long the test with a stationary random input lasts, for which largest values are expected; by default as long
    as the run."""
    sample_rate: q.Frequency | None = None
    """Sample rate of the output; by default chosen from the excitation and the structure."""
    start: Start = "static_equilibrium"
    """Initial state: static_equilibrium, rest, polynomials, a mode, a force released, or a point of a continuation."""
    outputs: tuple[AnyOutput, ...] = ()
    """Further quantities: motion, moments, stresses and strains at points, reactions, forces of joints, energies."""
    spectrum: SpectrumSettings = SpectrumSettings.model_construct()
    """Settings of the spectra."""
    srs: ShockSpectrumSettings | None = None
    """Shock response spectra of the accelerations of the base, of supports that move and of every probe; by default
    none."""
    method: Literal["exact", "reference"] = "exact"
    """Exact: closed-form flow between contact events; reference: a time-stepping integrator, for comparison."""
    integrator: Literal["RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA"] = "BDF"
    """SciPy integrator of the reference method."""
    rtol: q.PositiveNumber = 1e-8
    """Relative tolerance of the reference method."""
    atol: q.PositiveNumber = 1e-12
    """Absolute tolerance of the reference method."""
    low_pass: q.Frequency | None = None
    """Band of the accelerometers: peak accelerations are those behind a 4-pole Butterworth low-pass, -3 dB here."""
    impacts: ImpactSettings | None = None
    """Statistics of the impacts at each snubber; {} takes every contact as an impact. Not computed by default."""
    from_: q.Time = Field(default=0.0, alias="from")
    """Time from which on impacts, sliding and wear count; the start by default."""
    fatigue: StressLife | None = None
    """Rainflow count of the bending stress of each body where its damage by this S-N line is largest. Not computed by
    default."""
    sensitivities: tuple[Annotated[SensitiveParameter, ShortFor("path")], ...] = ()
    """Numbers of the scenario, by their paths, by which all peaks and times in contact are differentiated: which number
    matters, and how much. Not computed by default."""
    convergence: Literal["on", "off"] | None = None
    """Whether values are compared with those of a finer model; by default on in a run, in a study for the cases that
    decide."""
    max_events: q.Count = 1_000_000
    """Largest number of contact events, after which the run stops (chattering)."""
    memory: q.Memory = 2e9
    """Bound on what a run keeps in memory: half of it for the motion between events (which ends when this is full), a
    fifth for the tables of contact states. Histories at the output times come on top. A motion under random input
    that does not fit is evaluated in stretches, see docs/performance.md."""
    most_contact_states: Annotated[q.Count, Field(ge=2)] | None = None
    """Contact states whose tables are kept at once; the least recently used makes room. By default those that fit
    into run.memory."""

    def check(self) -> None:
        """Refuse filters so fast against the run that they would take hours, or more than the memory."""
        super().check()
        asked: list[tuple[Path, float, int]] = []
        if self.srs is not None:
            asked.append((("srs", "to"), self.srs.to, MOST_PERIODS))
        if self.low_pass is not None:
            asked.append((("low_pass",), self.low_pass, MOST_FILTERED))
        for at, highest_hz, most in asked:
            if highest_hz * self.duration > most:
                raise Unfit(
                    f"= {highest_hz:g} Hz has {highest_hz * self.duration:.3g} periods in run.duration = "
                    f"{self.duration:g} s (at most {most:.0e})",
                    "give a lower frequency, 2 kHz for example, or a shorter run", at,
                )  # fmt: skip


class Reduction(Schema):
    """Number of modes, in addition to the static vectors of contacts and loads."""

    modes: q.Modes | None = None
    """Number of modes, or all."""
    highest_frequency: q.Frequency | None = None
    """Highest frequency of interest; the modes needed up to it are kept."""

    def check(self) -> None:
        """Reject two rules."""
        self.exclude("highest_frequency", "modes")
