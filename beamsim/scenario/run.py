"""A simulation in time: duration, output, initial state, method."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import log2
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import (
    InvalidValueError,
    Path,
    Problems,
    Schema,
    ShortFor,
    Variants,
    Whole,
    path_text,
    problem,
    unknown,
)
from beamsim.scenario.body import Body, PlacedForce
from beamsim.scenario.excitation import FrequencyRange
from beamsim.scenario.reporting import INPUT, AnyOutput, Stress, stress_problems
from beamsim.scenario.studies import parameter_problems, resolve_parameter

MOST_OSCILLATORS = 10_000
MOST_PERIODS = 2_000_000  # periods of the highest oscillator in a run; several panels of each are stored
MOST_FILTERED = 100_000_000  # periods of the low-pass frequency in a run, which would take hours
MOST_FREQUENCIES = 50_000  # points of a spectrum
MOST_SAMPLES = 50_000_000
"""Largest number of samples of histories; more would not fit into memory."""
MANY_SAMPLES = 5e6  # samples of histories, above which a result file is larger than about a gigabyte
LEAST_OF_PERIOD = 10.0  # samples per period of the excitation, below which histories are coarse
_COARSE = (
    "samples a period: time histories are coarse, and of a time-stepping method superharmonics fold back into the "
    "spectrum"
)


def closed_form_problems(scenario: Whole, path: Path) -> Problems:
    """A problem if statistics need a motion in closed form and this run does not compute one."""
    if scenario.run.method == "reference":
        yield problem(path, "needs the motion in closed form", "leave run.method: reference out")
    elif scenario.has_cubic_springs:
        yield problem(
            path, "needs the motion in closed form, which cubic springs do not have",
            "leave it out, or replace the cubic springs by piecewise-linear ones",
        )  # fmt: skip


NonNegativeForce = Annotated[float, q.Quantity(units.FORCE, minimum=0.0)]
StressExponent = Annotated[
    float, q.Quantity(replace(units.NUMBER, name="exponent", example="5"), minimum=1.0, maximum=100.0)
]


class ImpactSettings(Schema):
    """Statistics of the impacts at each snubber; an impact lasts from closing to opening."""

    minimum_rest: q.Time = 0.0
    """Contacts of a snubber with a shorter time between them count as one impact."""
    force_threshold: NonNegativeForce = 0.0
    """Impacts with a smaller peak force are not counted; sums over time include them."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: no snubbers, or a method without statistics."""
        yield from closed_form_problems(scenario, path)
        if not (scenario.all_snubbers or scenario.rings):
            yield problem(path, "needs a snubber, but there is none", "leave it out, or add a snubber")


class StressLife(Schema):
    """S-N line of the material: N = cycles (stress_range / S)^exponent, where S is the stress range of a cycle."""

    stress_range: Stress
    """Stress range (twice the amplitude) at which the life is `cycles` cycles."""
    cycles: q.PositiveNumber = 2e6
    """Life at that stress range."""
    exponent: StressExponent
    """Exponent of the line, 1 to 100: about 3 for welds, 5 to 10 for smooth metal."""
    endurance_limit: Stress | None = None
    """Stress range below which a cycle does no damage; none by default."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a structure without stresses, or a method without fatigue."""
        yield from closed_form_problems(scenario, path)
        yield from stress_problems(scenario, path)


class PolynomialStart(Schema):
    """Start with a given shape and velocity: polynomials in x for a beam, one number for each mass of a chain."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("displacement", "velocity")
    displacement: tuple[q.ShapeDisplacement, ...] = ()
    """Beam: coefficients of 1, x, x^2, ... (1 mm, 2 mm/m, 3 1/m); chain: displacement of each mass (1 mm)."""
    velocity: tuple[q.ShapeVelocity, ...] = ()
    """Beam: coefficients of 1, x, x^2, ... (0.2 m/s, 2 1/s); chain: velocity of each mass (0.2 m/s)."""

    def check(self) -> None:
        """Refuse an empty initial state."""
        if not self.displacement and not self.velocity:
            raise InvalidValueError(
                "is an empty initial state", "give displacement, velocity or both, or write start: rest"
            )

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: shapes that do not fit their body, and a single shape although there are several bodies."""
        bodies = scenario.all_bodies
        name = str(path[-1]) if path[-2] == "bodies" else scenario.default_body
        if not name:
            named = f"{{bodies: {{{next(iter(bodies))}: {{displacement: [...]}}}}}}"
            message = f"gives one shape, and there are {len(bodies)} bodies"
            yield problem(path, message, f"name the body: start: {named}")
        elif name in bodies:
            for key, numbers in (("displacement", self.displacement), ("velocity", self.velocity)):
                yield from _units_of_shape(bodies[name], (*path, key), numbers)
                yield from bodies[name].start_problems((*path, key), numbers)


def _units_of_shape(body: Body, path: Path, numbers: tuple[float, ...]) -> Problems:
    """Problems of coefficients whose unit belongs to another power of x."""
    dimensions = q.SHAPE_DISPLACEMENTS if path[-1] == "displacement" else q.SHAPE_VELOCITIES
    for index, number in enumerate(numbers):
        stated, power = q.meant(number), body.power_of_start(index)
        if stated is not None and int(stated) != power:
            wanted = dimensions[power] if power < len(dimensions) else None
            yield problem(
                (*path, index),
                f"is {dimensions[int(stated)].with_article}, but must be "
                f"{f'the coefficient of x^{power}' if wanted is None else wanted.with_article}",
                "write a bare number in SI units" if wanted is None else f"write for example {wanted.example}",
            )


class BodiesStart(Schema):
    """Start with given shapes and velocities of several bodies; the others start at rest, undeflected."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("bodies",)
    bodies: Annotated[dict[q.Name, PolynomialStart], Field(min_length=1)]
    """Displacement and velocity of each body, by name."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of unknown bodies."""
        for name in self.bodies:
            yield from unknown((*path, "bodies", name), name, "body", scenario.all_bodies)


class ModeStart(Schema):
    """Start from rest in the shape of a linear mode."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("mode", "amplitude")
    mode: q.Count
    """Number of the mode, from 1."""
    amplitude: q.Amplitude
    """Largest displacement in the shape."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the mode does not exist."""
        yield from mode_problems(scenario, (*path, "mode"), self.mode)


def mode_problems(scenario: Whole, path: Path, mode: int) -> Problems:
    """A problem if there are fewer modes than the number at a path."""
    counts = [body.mode_count for body in scenario.all_bodies.values()]
    known = [count for count in counts if count is not None]
    total = sum(known)
    if len(known) == len(counts) and mode > total:
        what = f"a chain of {total} masses has" if len(counts) == 1 else f"the bodies together have {total} masses and"
        yield problem(path, f"= {mode}, but {what} {total} modes", f"choose a mode from 1 to {total}")


class ReleasedForceStart(Schema):
    """Start from rest in the static shape under a force, which is then released."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("released_force",)
    released_force: PlacedForce
    """The force that acts until t = 0."""


class OrbitStart(Schema):
    """Start on a periodic motion from a result file, with its excitation."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("orbit",)
    orbit: q.FileName
    """Result file of `sweep` with a continuation; the path is relative to the folder of the scenario."""
    branch: q.NotNegativeWhole = 0
    """Number of the branch in the file, from 0."""
    special_curve: q.NotNegativeWhole | None = None
    """Number of a curve of special points in the file, from 0, instead of a branch."""
    point: q.Count
    """Number of the point on the branch in the file, from 1."""
    keep_excitation: bool = False
    """Use the frequency, level and continuation parameter of the scenario instead of those of the point."""
    factor: q.PositiveNumber = 1.0
    """Factor of the state, to test whether a disturbed motion returns."""


Start = Annotated[
    Literal["static_equilibrium", "rest"] | PolynomialStart | BodiesStart | ModeStart | ReleasedForceStart | OrbitStart,
    Variants(
        "is not an initial state",
        "write static_equilibrium, rest, {displacement: [...], velocity: [...]}, {mode: 1, amplitude: 1 mm}, "
        "{released_force: {position: 270 mm, force: 10 N}} or {orbit: case.h5, point: 12}",
    ),
]


class SpectrumSettings(Schema):
    """The analysed part of the run, and the window function."""

    last: q.Duration | None = None
    """Analyse only this last part of the run; by default all of it."""
    periods: q.Count | None = None
    """Number of excitation periods to analyse at the end of the run, instead of last."""
    window: Literal["rectangular", "hann", "hamming", "blackman", "blackmanharris", "flattop", "decaying"] | None = None
    """Window function. decaying (the falling half of a Hann window) keeps the start of a shock; it is the default for a
    shock or free motion that decays. Otherwise the default is hann."""
    to: q.Frequency | None = None
    """Highest frequency of the spectra; by default that of the modes and of the excitation."""
    frequencies: tuple[q.Frequency, ...] = ()
    """Frequencies whose amplitudes are always listed, even without a spectral line there."""

    def check(self) -> None:
        """Refuse two lengths, and repeated frequencies."""
        if len(set(self.frequencies)) < len(self.frequencies):
            self._refuse_repeated_frequency()
        self.exclude("periods", "last")

    def _refuse_repeated_frequency(self) -> None:
        """Refuse the first repeated frequency."""
        for index, frequency in enumerate(self.frequencies):
            if frequency in self.frequencies[:index]:
                message = f"= {frequency:g} Hz is given twice"
                raise InvalidValueError(message, "remove one of them", ("frequencies", index))

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a part longer than the run, and frequencies outside the spectra."""
        duration = scenario.run.duration
        if self.last is not None and self.last > duration * (1.0 + 1e-12):
            message = f"= {self.last:g} s is longer than run.duration = {duration:g} s"
            yield problem((*path, "last"), message, "analyse a shorter part, or use a longer run")
        if self.periods is not None:
            yield from self._problems_of_periods(scenario, (*path, "periods"), self.periods)
        if self.frequencies or self.to is not None:
            stepped = scenario.run.method == "reference" or scenario.has_cubic_springs
            yield from self._problems_of_frequencies(scenario, path, time_stepping=stepped)

    def _problems_of_periods(self, scenario: Whole, path: Path, periods: int) -> Problems:
        """Problems: no excitation frequency, or more periods than the run has."""
        frequencies, duration = scenario.excitation.frequencies_hz, scenario.run.duration
        if len(frequencies) != 1:
            yield problem(path, "needs an excitation with one frequency", "give last: 0.4 s instead")
        elif periods / frequencies[0] > duration * (1.0 + 1e-12):
            yield problem(
                path,
                f"= {periods} periods of {frequencies[0]:g} Hz take {periods / frequencies[0]:g} s, "
                f"longer than run.duration = {duration:g} s",
                f"analyse at most {int(duration * frequencies[0])} periods, or run longer",
            )

    def _problems_of_frequencies(self, scenario: Whole, path: Path, *, time_stepping: bool) -> Problems:
        """Problems: frequencies that cannot be resolved, or that are above the highest of a spectrum.

        Parameters
        ----------
        scenario : with the run.
        path : path of the settings.
        time_stepping : whether the spectra are computed from samples of a time-stepping method.

        Yields
        ------
        Problem
        """
        if scenario.run.method == "reference" and self.to is not None:
            message = f"= {self.to:g} Hz does nothing: spectra of time stepping go up to half of the sample rate"
            yield problem((*path, "to"), message, "leave it out, or give that run.sample_rate")
        chosen, tones = self.frequencies, scenario.excitation.frequencies_hz
        duration = min(self.last or scenario.run.duration, scenario.run.duration)
        if self.periods is not None and len(tones) == 1:
            duration = min(self.periods / tones[0], duration)
        asked: dict[Path, float] = {(*path, "frequencies", k): value for k, value in enumerate(chosen)}
        for index, (place, frequency) in enumerate(asked.items()):
            near = min(chosen[:index], key=lambda other: abs(other - frequency), default=-1.0 / duration)
            if abs(near - frequency) * duration < 1.0:
                yield problem(
                    place,
                    f"= {frequency:g} Hz cannot be distinguished from {near:g} Hz in the {duration:g} s that are "
                    "analysed",
                    f"keep frequencies {1 / duration:g} Hz apart, or analyse a longer part",
                )
        if self.to is not None and not time_stepping:
            asked[*path, "to"] = self.to
        for place, frequency in asked.items():
            if time_stepping and frequency >= 0.5 * scenario.sample_rate:
                yield problem(
                    place,
                    f"= {frequency:g} Hz is not below half of run.sample_rate = {scenario.sample_rate:g} Hz",
                    "raise run.sample_rate: spectra of a time-stepping method are those of its samples",
                )
            elif not time_stepping and frequency * duration > MOST_FREQUENCIES:
                yield problem(
                    place,
                    f"= {frequency:g} Hz has {frequency * duration:.4g} periods in the {duration:g} s that are "
                    f"analysed (at most {MOST_FREQUENCIES})",
                    f"analyse a shorter part, run.spectrum.last: {0.95 * MOST_FREQUENCIES / frequency:.2g} s",
                )


class ShockSpectrumSettings(FrequencyRange):
    """Shock response spectra: response of oscillators on the base and on each probe."""

    range_noun: ClassVar[str] = "spectrum"
    range_remedy: ClassVar[str] = "give a range, from 10 Hz to 2 kHz"
    falling_range_remedy: ClassVar[str] = "exchange the two"

    quality: q.Quality = 10.0
    """Quality factor Q = 1 / (2 damping ratio) of the oscillators; above 0.5."""
    per_octave: q.Count = 12
    """Oscillators per octave."""

    def check(self) -> None:
        """Refuse a falling range, and too many oscillators."""
        super().check()
        if (oscillators := self.per_octave * log2(self.to / self.from_)) > MOST_OSCILLATORS:
            raise InvalidValueError(
                f"= {self.per_octave} makes {oscillators:.3g} oscillators (at most {MOST_OSCILLATORS})",
                "give fewer per octave, 12 or 24 are usual, or a narrower range", ("per_octave",),
            )  # fmt: skip


class SensitiveParameter(Schema):
    """A parameter for the derivatives of a run's results."""

    path: q.Text
    """Path of the number, for example snubbers.tip.gap."""
    also: tuple[q.Text, ...] = ()
    """Other paths with the same value, such as a probe that moves with a snubber."""
    tolerance: q.AnyValue = "1 %"
    """Deviation for which the change of the results is reported: in percent of the value, or in its own unit."""


class Run(Schema):
    """A simulation in time."""

    duration: q.Duration
    """Simulated time."""
    test_duration: q.Duration | None = None
    """Duration of the test with a stationary random input, for which the largest values are estimated; by default the
    duration of the run."""
    test_peak: Literal["interval", "median", "three_sigma"] = "interval"
    """Value that is compared with limits on peaks if test_duration is given: interval, the upper end of the 95 %
    interval of the largest value (undecided if the limit is inside the interval); median; or three_sigma, the mean plus
    three standard deviations. """
    sample_rate: q.Frequency | None = None
    """Sample rate of the output; by default chosen from the excitation and the structure."""
    start: Start = "static_equilibrium"
    """Initial state: static_equilibrium, rest, polynomials, a mode, a released force, or a point of a continuation."""
    outputs: tuple[AnyOutput, ...] = ()
    """Additional results: motion, moments, stresses and strains at points, reactions, forces of joints, energies."""
    spectrum: SpectrumSettings = SpectrumSettings.model_construct()
    """Settings of the spectra."""
    srs: ShockSpectrumSettings | None = None
    """Shock response spectra of the accelerations of the base, of moving supports and of every probe; none by
    default."""
    method: Literal["exact", "reference"] = "exact"
    """exact: closed-form motion between contact events; reference: a time-stepping integrator, for comparison."""
    integrator: Literal["RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA"] = "BDF"
    """SciPy integrator of the reference method."""
    rtol: q.PositiveNumber = 1e-8
    """Relative tolerance of the reference method."""
    atol: q.PositiveNumber = 1e-12
    """Absolute tolerance of the reference method."""
    low_pass: q.LowPass | None = None
    """Bandwidth of the accelerometers: peak accelerations are taken after a 4-pole Butterworth low-pass with -3 dB at
    this frequency."""
    impacts: ImpactSettings | None = None
    """Statistics of the impacts at each snubber; {} counts every contact as an impact. Not computed by default."""
    from_: q.Time = Field(default=0.0, alias="from")
    """Time from which impacts, sliding and wear are counted; the start by default."""
    fatigue: StressLife | None = None
    """Rainflow count of the bending stress of each body where the damage by this S-N line is largest. Not computed by
    default."""
    sensitivities: tuple[Annotated[SensitiveParameter, ShortFor("path")], ...] = ()
    """Parameters, by their paths, for which derivatives of all peaks and contact times are computed, to show which ones
    matter. Not computed by default."""
    convergence: Literal["on", "off"] | None = None
    """Whether results are compared with those of a finer model; by default on in a run, and in a study for the deciding
    cases."""
    max_events: q.Count = 1_000_000
    """Largest number of contact events; the run stops there (chattering)."""
    memory: q.Memory = 2e9
    """Memory limit of a run: half of it for the motion between events (the run ends when this is full), a fifth for the
    tables of contact states, the rest for histories (refused beforehand if they do not fit). A motion under random
    input that does not fit is evaluated in chunks, see docs/performance.md. """
    most_contact_states: Annotated[q.Count, Field(ge=2)] | None = None
    """Number of contact states whose tables are kept at the same time; the least recently used one is replaced. By
    default as many as fit into run.memory."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: too few or too many samples, a too low sample rate, settings without effect."""
        rate, highest = scenario.sample_rate, scenario.excitation.highest_tone_hz
        place = (*path, "duration" if self.sample_rate is None else "sample_rate")
        if not max(1.0 / self.duration, 2.0 * highest) <= rate <= MOST_SAMPLES / self.duration:
            yield from self._problems_of_samples(place, rate, highest)
        if self.method != "reference" and {"integrator", "rtol", "atol"} & self.model_fields_set:
            yield from self._problems_of_stepping(scenario, path)
        if self.from_:
            yield from self._problems_of_counting(scenario, (*path, "from"))
        if self.srs is not None or scenario.excitation.stationary:
            yield from _names_of_input(scenario)
        if self.test_duration is not None:
            yield from self._problems_of_test(scenario, (*path, "test_duration"))
        if self.sensitivities:
            yield from self._problems_of_sensitivities(scenario, (*path, "sensitivities"))

    def _problems_of_samples(self, place: Path, rate: float, highest: float) -> Problems:
        """A problem if a sample rate, Hz, gives too few or too many samples."""
        if rate * self.duration < 1.0:
            message = f"= {rate:g} Hz gives only one sample in run.duration = {self.duration:g} s"
            yield problem(place, message, "use a higher sample rate, or a longer run")
        elif rate * self.duration > MOST_SAMPLES:
            given = f"= {rate:g} Hz over run.duration = {self.duration:g} s"
            if self.sample_rate is None:
                given = f"= {self.duration:g} s at the {rate:g} Hz that the excitation requires"
            yield problem(
                place, f"{given} gives {rate * self.duration:.3g} samples, over the limit of {MOST_SAMPLES:.0e}",
                "contacts are found exactly at any sample rate; use a lower one, or a shorter run",
            )  # fmt: skip
        if rate < 2.0 * highest:
            message = f"= {rate:g} Hz is under twice the excitation frequency of {highest:g} Hz"
            remedy = f"use at least {2 * highest:g} Hz; {20 * highest:g} Hz shows the first harmonics"
            yield problem(place, message, remedy)

    @staticmethod
    def _problems_of_test(scenario: Whole, path: Path) -> Problems:
        """A problem if a test duration is given although the input is not random."""
        if not scenario.excitation.stationary:
            yield problem(path, "applies to a test with a random input, of which the run is a sample",
                          "leave it out, or simulate the whole test by run.duration")  # fmt: skip

    def _problems_of_stepping(self, scenario: Whole, path: Path) -> Problems:
        """Problems of time-stepping settings without effect in this run."""
        cubic = scenario.has_cubic_springs
        does = "which is integrated by DOP853" if cubic else "which is in closed form"
        for key in ("integrator",) if cubic else ("integrator", "rtol", "atol"):
            if getattr(self, key) != type(self).model_fields[key].default:
                message = f"= {getattr(self, key)} does nothing in this run, {does}"
                yield problem((*path, key), message, "leave it out, or give method: reference")

    def _problems_of_counting(self, scenario: Whole, path: Path) -> Problems:
        """Problems of a start of counting without anything to count, or after the end."""
        counts_none = self.impacts is None and not scenario.friction and not scenario.rings
        if self.method == "reference" or scenario.has_cubic_springs or counts_none:
            message = f"= {self.from_:g} s is the time from which impacts and sliding count, and this run counts none"
            yield problem(path, message, "leave it out, or add impacts: {}")
        elif self.from_ >= self.duration:
            message = f"= {self.from_:g} s is not before the end, {self.duration:g} s"
            yield problem(path, message, "give an earlier time")

    def _problems_of_sensitivities(self, scenario: Whole, path: Path) -> Problems:
        """Problems: unknown paths, repeated parameters, and parameters without a derivative."""
        problems = list(parameter_problems(scenario, self.sensitivities, path))
        yield from problems
        for k, asked in enumerate(() if problems else self.sensitivities):
            number = resolve_parameter(scenario, asked)
            settings = any(place[0] == "run" and place[1] != "start" for place in number.places)
            if settings or number.integers_only:
                what = "is a setting of the run" if settings else "is a whole number"
                remedy = "name a number of the structure, the excitation or the start"
                yield problem((*path, k), f"= {number.path} {what}, which has no derivative", remedy)

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Warnings: no motion, a short run, few or many samples."""
        excitation, rate = scenario.excitation, scenario.sample_rate
        if not any(level for _, part in excitation.items for _, level in part.levels() or [((), 1.0)]):
            yield from self._static_warnings(scenario)
        lowest, highest = min(excitation.frequencies_hz, default=math.inf), excitation.highest_tone_hz
        if swept := [(place, part) for place, part in excitation.items if part.kind == "swept_sine"]:
            yield from self._sweep_warnings(swept)
        if self.duration * lowest < 1.0:
            yield f"run.duration = {self.duration:g} s is shorter than one period of the excitation, {1.0 / lowest:g} s"
        if rate < LEAST_OF_PERIOD * highest:
            yield f"run.sample_rate = {rate:g} Hz is {rate / highest:.3g} {_COARSE}"
        if rate * self.duration > MANY_SAMPLES:
            yield f"{rate * self.duration:.3g} output samples make a very large result file"

    def _sweep_warnings(self, sweeps: Iterable[tuple[Path, Any]]) -> Iterator[str]:
        """Warnings about a run that ends within the first cycle of a swept sine; ``sweeps`` has the sines and paths."""
        for path, part in sweeps:
            if part.cycles_in(self.duration) < 1.0:
                yield (
                    f"run.duration = {self.duration:g} s ends within the first cycle of "
                    f"{path_text(('excitation', *path))}, which begins at {part.from_:g} Hz"
                )

    def _static_warnings(self, scenario: Whole) -> Iterator[str]:
        """A warning if nothing moves: no excitation, and a start at static equilibrium."""
        if self.start == "static_equilibrium" and not scenario.starts_unrelaxed:
            none = scenario.excitation.kind == "none"
            why = "there is no excitation" if none else "the level of the excitation is zero"
            yield (
                f"nothing moves: {why}, and the run starts at static equilibrium; give excitation, or "
                "run.start: rest, {mode: 1, amplitude: 1 mm} or another one"
            )

    def check(self) -> None:
        """Refuse filters that need too many steps or too much memory for this run."""
        if self.srs is not None:
            self._check_periods(self.srs.to, MOST_PERIODS, ("srs", "to"))
        if self.low_pass is not None:
            self._check_periods(self.low_pass, MOST_FILTERED, ("low_pass",))

    def _check_periods(self, highest_hz: float, largest_count: int, path: Path) -> None:
        if highest_hz * self.duration > largest_count:
            raise InvalidValueError(
                f"= {highest_hz:g} Hz has {highest_hz * self.duration:.3g} periods in run.duration = "
                f"{self.duration:g} s (at most {largest_count:.0e})",
                "give a lower frequency, 2 kHz for example, or a shorter run", path,
            )  # fmt: skip


def _names_of_input(scenario: Whole) -> Problems:
    """Problems of places called input, the name of the excitation in spectra."""
    for section in ("probes", "snubbers", "outputs"):
        for k, item in enumerate(getattr(scenario, section)):
            if item.name in (INPUT, *scenario.input_names):
                message = f"= {item.name} is the name of the input's own spectrum and statistics"
                yield problem((section, k, "name"), message, "choose another name")


class Reduction(Schema):
    """Number of modes in the reduced model, in addition to static vectors of contacts and loads."""

    modes: q.Modes | None = None
    """Number of modes, or all."""
    highest_frequency: q.Frequency | None = None
    """Highest frequency of interest; the modes needed up to it are kept."""

    def check(self) -> None:
        """Refuse two rules."""
        self.exclude("highest_frequency", "modes")

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning if modes in the frequency range of the excitation are omitted."""
        highest = scenario.excitation.highest_frequency_hz
        if self.highest_frequency is not None and self.highest_frequency < highest:
            key = path_text((*path, "highest_frequency"))
            yield (
                f"{key} = {self.highest_frequency:g} Hz is below the excitation frequency, {highest:g} Hz; the modes "
                "it excites are omitted"
            )
