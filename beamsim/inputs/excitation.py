r"""Signals of an excitation: force or base motion, deterministic or random.

Harmonic base motions are integrated without drift: an acceleration A sin has d = -A / omega^2 sin. Pulses and steps
start from d = d' = 0.

A random input follows from a table of power spectral density,

.. math:: s(t) = \sum_k r_k a_k \cos(2\pi f_k t + \varphi_k), \qquad f_k = k \Delta f, \qquad
          \tfrac{1}{2} a_k^2 = \int_{f_k - \Delta f/2}^{f_k + \Delta f/2} S\, df,

with independent uniform phases. With fixed amplitudes, :math:`r_k = 1`, every realisation has exactly the given
density; the sum is Gaussian by the central limit theorem, but its mean square over a period is always the same. With
:math:`r_k^2` exponentially distributed with unit mean, the sum is a Gaussian process, and the mean square over a period
T has the relative variance :math:`\int S^2 df / (T (\int S df)^2)` (S. O. Rice, Bell System Technical Journal 23,
1944). Samples of a clipped input are limited to a number of standard deviations; the resulting content below the band
is removed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from beamsim.errors import ScenarioError, prefix_problems
from beamsim.inputs.density import SpectralDensity, clipped_mean_square, density_of
from beamsim.inputs.drift import Correction, jumps
from beamsim.inputs.measured import read_density, sampled_signal, target_curve
from beamsim.inputs.profiles import Leg, make_leg, make_profile, phase_of_acceleration
from beamsim.inputs.signal import MARGIN, MOST_PIECES, CubicRecord, Signal, StreamedSignal
from beamsim.inputs.statements import InputAccount, InputStatement
from beamsim.inputs.swept import SweepWindows, cut_into_windows, swept_signals
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path as Keys
from beamsim.scenario.base import path_text
from beamsim.scenario.body import ROTATION_TAKES, TRANSLATION_TAKES
from beamsim.scenario.excitation import MatchedInput, RandomInput, SingleExcitation, SweptSineInput
from beamsim.scenario.files import CurveFile
from beamsim.scenario.quantities import amplitude_unit, power_of, shares_of_seeds
from beamsim.typing import Complexes, Floats, Ints

MOST_RAMPED = 50_000_000  # samples of a random input with a ramp

SAMPLES_OF_CYCLE = 20  # samples per cycle of the highest frequency of a random input
CLIPPINGS = 8  # repetitions of clipping a record and removing the content below its band
MOST_UNROUNDED_SAMPLES = (
    4_000_000  # samples of a period; larger numbers are rounded up to fast transform lengths, which need less memory
)


def _spectrum(density: SpectralDensity, period: float, count: int, seed: int | str, gaussian: bool) -> Complexes:
    """(count // 2 + 1,) complex amplitudes of the sines, at multiples of 1 / period."""
    amplitude = density.lines(period, count // 2 + 1)
    used = np.flatnonzero(amplitude)
    out = np.zeros(amplitude.size, dtype=complex)
    for each, share in shares_of_seeds(seed):
        generator = np.random.default_rng(each)
        phase, size = generator.uniform(0, 2 * np.pi, amplitude.size)[used], amplitude[used]
        if gaussian:
            size = size * np.sqrt(generator.standard_exponential(amplitude.size))[used]
        out[used] += share * np.exp(1j * phase) * size
    return out


def _clip_record(amplitude: Complexes, count: int, limit: float) -> Complexes:
    """Amplitudes of a record after clipping its samples, without content below its lowest sine.

    Clipping adds content below the band, with which a base would drift. Removing it moves samples beyond the limit
    again, so both steps alternate; each is a projection on a convex set, and the excess decreases quickly.

    Parameters
    ----------
    amplitude : (count // 2 + 1,) amplitudes of the record.
    count : number of samples per period.
    limit : largest magnitude.
    """
    lowest = int(np.flatnonzero(amplitude)[0])
    spectrum = 0.5 * count * amplitude
    for _ in range(CLIPPINGS):
        spectrum = np.fft.rfft(np.clip(np.fft.irfft(spectrum, count), -limit, limit))
        spectrum[:lowest] = 0.0
    if count % 2 == 0:
        spectrum[-1] = 0.0  # half of the sampling rate, which has no phase
    return np.asarray(spectrum / (0.5 * count), dtype=complex)


def random_signals(
    excitation: RandomInput, duration: float | None, folder: Path | None = None
) -> tuple[Signal, Signal, Signal]:
    """Random input as a smooth piecewise cubic, with its integrals; it does not depend on the end of the run.

    A base motion does not drift. The displacement starts at that of the integrated sines, or at 0 with a ramp. The
    initial velocity makes the mean slope of the displacement over a period zero, after a ramp. The displacement then
    changes from period to period only by round-off: less than 1e-14 n^2 of its rms in n cycles of the lowest frequency,
    1e-6 in 10,000 cycles.

    Parameters
    ----------
    excitation, duration, folder : see `level_signal`.

    Returns
    -------
    tuple
        The input in SI units, and its first and second integrals over time.

    Raises
    ------
    ScenarioError
        If its sines are too far apart for its density, or it has too many samples.
    """
    density = density_of(excitation, folder)
    period = excitation.period or duration or 1.0
    if excitation.period is not None or duration is not None:  # otherwise nothing is simulated
        density.demand_resolved(period, "run.duration" if excitation.period is None else "excitation.period")
    rate = excitation.sample_rate or SAMPLES_OF_CYCLE * density.highest_hz
    total = duration if duration is not None else period
    count = _count_of_samples(period, total, rate)
    amplitude = _spectrum(density, period, count, excitation.seed, excitation.amplitudes == "random")
    amplitude *= np.exp(1j * excitation.phase)
    limit = np.inf if excitation.clip is None else excitation.clip * density.rms
    amplitude = _clip_record(amplitude, count, limit) if limit < np.inf else amplitude
    step = period / count
    pieces = int(np.ceil(total / step)) + 1
    displacement_0 = 0.0
    if excitation.ramp == 0:
        used = np.flatnonzero(amplitude)
        displacement_0 = float(np.sum(-amplitude[used] / (2 * np.pi * used / period) ** 2).real)
    amplitude *= 0.5 * count
    one_period = np.fft.irfft(amplitude, count)
    del amplitude

    def samples_at(index: Ints) -> Floats:
        samples = np.asarray(one_period[index % count], dtype=float)
        if excitation.ramp > 0:
            x = np.clip(index * step / excitation.ramp, 0, 1)
            samples = samples * x**2 * (3 - 2 * x)
        return samples

    if excitation.ramp > MOST_RAMPED * step:
        message = f"= {excitation.ramp:g} s has {excitation.ramp / step:.2g} samples (at most {MOST_RAMPED:.0e})"
        raise ScenarioError.at("excitation.ramp", message, "give a shorter ramp")
    repeats = int(np.ceil(excitation.ramp / step)) + MARGIN if excitation.ramp > 0 else 0  # first sample after the ramp
    begun_at_rest = CubicRecord(samples_at, step, repeats + count, (0.0, 0.0), limit)
    velocity_0 = -begun_at_rest.mean_slope(repeats)
    record = CubicRecord(samples_at, step, pieces, (velocity_0, displacement_0), limit)
    return StreamedSignal(record, 0), StreamedSignal(record, 1), StreamedSignal(record, 2)


MOST_SAMPLES_OF_PERIOD, MOST_SAMPLES_OF_MOTION = 50_000_000, 1_000_000_000  # samples of the noise


def _count_of_samples(period: float, total: float, rate: float) -> int:
    """Number of samples in a period, s, of a random input of a total duration, s, at a sample rate, Hz.

    Raises
    ------
    ScenarioError
        If there are too many.
    """
    for samples, most, remedy in (
        (period * rate, MOST_SAMPLES_OF_PERIOD, "give a shorter excitation.period, after which the noise repeats"),
        (total * rate, MOST_SAMPLES_OF_MOTION, "shorten run.duration, or give a lower excitation.sample_rate"),
    ):
        if samples > most:
            raise ScenarioError.at("excitation", f"needs {samples:.3g} samples (at most {most:.0e})", remedy)
    count = int(np.ceil(period * rate))
    if count > MOST_UNROUNDED_SAMPLES:
        from scipy.fft import next_fast_len

        count = int(next_fast_len(count, real=True))
    return count


def _statement(excitation: RandomInput, duration: float | None, folder: Path | None) -> InputStatement:
    """Size and sampling of a random input; the arguments are those of `random_signals`."""
    density = density_of(excitation, folder)
    rms, clip = density.rms, excitation.clip
    clipped_rms = rms * clipped_mean_square(clip) ** 0.5
    unit = amplitude_unit(excitation.quantity)
    treatment = "" if clip is None else (
        f"clipped at {clip:g} sigma, {clip * rms:.4g} {unit}: the rms falls from {rms:.4g} to {clipped_rms:.4g} {unit}"
    )  # fmt: skip
    return InputStatement(
        path="", quantity=excitation.quantity, unit=unit, rms=clipped_rms,
        sample_rate_hz=excitation.sample_rate or SAMPLES_OF_CYCLE * density.highest_hz, treatment=treatment,
        from_hz=density.lowest_hz, to_hz=density.highest_hz,
        line_spacing_hz=1.0 / (excitation.period or duration or 1.0),
    )  # fmt: skip


class PrescribedInput(NamedTuple):
    """A prescribed quantity in time, with its description for results."""

    signal: Signal  # SI
    account: InputAccount


@dataclass(frozen=True)
class BaseMotion:
    """Acceleration, velocity and displacement of the base; exact derivatives of each other."""

    acceleration: Signal  # m/s^2
    velocity: Signal  # m/s
    displacement: Signal  # m
    corrections: tuple[Correction, ...] | None = None  # for a swept sine, corrections of jumps of its velocity
    account: InputAccount = field(default_factory=InputAccount)


def step(level: float, rise: float, fall_after: float | None, time: float) -> Signal:
    """0 before `time`, then rising to `level` as (1 - cos) / 2, and optionally falling in the same way.

    Parameters
    ----------
    level : in SI units.
    rise : rise time, s; 0 for a sudden step.
    fall_after : s, from ``time`` to the start of the fall; None if the level stays.
    time : start, s.

    Returns
    -------
    Signal
        Of a constant and a cosine.
    """
    pieces = [(0.0, 0.0, 0.0), (time, 0.5 * level, -0.5 * level), (time + rise, level, 0.0)]
    if fall_after is not None:
        down = time + fall_after
        pieces += [(down, 0.5 * level, 0.5 * level), (down + rise, 0.0, 0.0)]
    kept = [piece for piece, (end, _, _) in pairwise(pieces) if end > piece[0]]
    start, constant, cosine = np.array([*kept, pieces[-1]]).T
    exponent = np.array([0.0, 1j * np.pi / rise] if rise else [0j])
    return Signal(start, exponent, np.stack([constant, cosine], axis=1)[:, : exponent.size, None].astype(complex))


def linear_pieces(time: float, *pieces: tuple[float, float, float]) -> Signal:
    """A pulse from pieces (duration, first value, last value), starting at ``time``; 0 before and after."""
    pieces = tuple(piece for piece in pieces if piece[0] > 0)
    before = [(time, 0.0, 0.0)] if time > 0 else []
    start = np.cumsum([0.0, *(piece[0] for piece in (*before, *pieces))])
    coefficient = [[first, (last - first) / duration] for duration, first, last in (*before, *pieces)]
    return Signal.polynomial_pieces(start, [*coefficient, [0.0, 0.0]])


def half_sine(level: float, duration: float, time: float) -> Signal:
    """``level * sin(pi (t - time) / duration)`` during the pulse, 0 outside.

    Parameters
    ----------
    level : peak, in SI units.
    duration, time : duration of the pulse and its start, s.

    Returns
    -------
    Signal
        Of three pieces, or of two from t = 0 on.
    """
    start = np.array([0.0, time, time + duration]) if time > 0 else np.array([0.0, duration])
    coefficient = np.zeros((start.size, 1, 1), dtype=complex)
    coefficient[-2] = -1j * level
    return Signal(start, np.array([1j * np.pi / duration]), coefficient)


def sweep_windows(
    excitation: SweptSineInput, duration: float | None
) -> tuple[SweepWindows, tuple[Correction, ...] | None]:
    """The windows of a swept sine up to a duration, s, and the corrections of the base acceleration.

    Raises
    ------
    ScenarioError
        If the sweep ends before the run, or has too many cycles.
    """
    quantity = excitation.quantity or "acceleration"
    level = 1.0 if excitation.level is None else excitation.level
    profile = make_profile(level, quantity, excitation.profile, excitation.between, excitation.notches)
    phase = excitation.phase + phase_of_acceleration(quantity, level, excitation.profile)
    leg = make_leg(excitation.from_, excitation.to, excitation.rate)
    moves = excitation.level_quantities in (TRANSLATION_TAKES, ROTATION_TAKES)  # the base, a support or a stop
    corrections = jumps([leg], profile, phase) if moves else None  # independent of the duration of the run
    if duration is not None:
        if duration > leg.duration * (1 + 1e-9):
            raise ScenarioError.at(
                "run.duration",
                f"= {duration:g} s is longer than the sweep, which ends at {leg.duration:g} s",
                f"use at most {np.floor(leg.duration * 1e4) / 1e4:g} s, or a wider or slower sweep",
            )
        turns = float(leg.turns_after(np.array(leg.first_hz), np.array(duration)))
        last = float(leg.frequency(np.array(min(turns + 1.0, leg.cycles))))
        leg = Leg(leg.first_hz, last, leg.rate, leg.logarithmic)
    if leg.cycles * 8 > MOST_PIECES:
        raise ScenarioError.at(
            "excitation", f"has {leg.cycles:.3g} cycles, too many for a run", "use `beamsim sweep` or a shorter run"
        )
    return cut_into_windows([leg], profile, phase=phase, corrections=corrections), corrections


def level_signal(
    excitation: SingleExcitation, duration: float | None = None, folder: Path | None = None
) -> PrescribedInput:
    """The prescribed quantity as a signal.

    Parameters
    ----------
    excitation : section of the scenario.
    duration : duration of the run, s, which a time signal must cover; by default that of the signal.
    folder : folder of the scenario, base of relative paths.

    Returns
    -------
    PrescribedInput
        In SI units.

    Raises
    ------
    ScenarioError
        If a swept or measured input ends before the run, or its file cannot be read.
    """
    if excitation.kind == "harmonic":
        signal = Signal.harmonic(excitation.level, 2 * np.pi * excitation.frequency, excitation.phase)
        return PrescribedInput(signal, InputAccount())
    if excitation.kind == "multi_tone":
        level, frequency, phase = np.array([(tone.level, tone.frequency, tone.phase) for tone in excitation.tones]).T
        return PrescribedInput(Signal.harmonic(level, 2 * np.pi * frequency, phase), InputAccount())
    return _level_in_time(excitation, duration, folder)


def _level_in_time(excitation: Any, duration: float | None, folder: Path | None) -> PrescribedInput:
    """The prescribed quantity of excitations other than sums of sines."""
    if excitation.kind == "swept_sine":
        return PrescribedInput(swept_signals(sweep_windows(excitation, duration)[0])[0], InputAccount())
    if excitation.kind == "sampled":
        return PrescribedInput(*sampled_signal(excitation, duration, folder))
    if excitation.kind == "random":
        account = InputAccount(_statement(excitation, duration, folder))
        return PrescribedInput(random_signals(excitation, duration, folder)[0], account)
    if excitation.kind == "matched":
        from beamsim.inputs.matched import matched_signal

        return PrescribedInput(matched_signal(excitation, folder), InputAccount())
    return PrescribedInput(_pulse(excitation), InputAccount())


def _pulse(excitation: Any) -> Signal:
    """The signal of a step or shock."""
    level = excitation.level
    if excitation.kind == "step":
        rise, duration = excitation.rise or 0.0, excitation.duration
        return step(level, rise, None if duration is None else duration - rise, excitation.time)
    if excitation.kind == "sawtooth":
        return linear_pieces(excitation.time, (excitation.duration, 0.0, level))
    if excitation.kind == "trapezoid":
        rise, fall = excitation.rise, excitation.fall
        flat = max(excitation.duration - rise - fall, 0.0)
        return linear_pieces(excitation.time, (rise, 0.0, level), (flat, level, level), (fall, level, 0.0))
    return half_sine(level, excitation.duration, excitation.time)


def _motion_in_pieces(excitation: SingleExcitation, duration: float | None, folder: Path | None) -> BaseMotion:
    """Motion for a swept sine or a random input, with integrals that are made together; see `base_motion`."""
    if excitation.kind == "swept_sine":
        windows, corrections = sweep_windows(excitation, duration)
        acceleration, velocity, displacement = swept_signals(windows)
        return BaseMotion(acceleration, velocity, displacement, corrections)
    assert excitation.kind == "random"
    statement = _statement(excitation, duration, folder)
    return BaseMotion(*random_signals(excitation, duration, folder), account=InputAccount(statement))


def base_motion(excitation: SingleExcitation, duration: float | None = None, folder: Path | None = None) -> BaseMotion:
    """Motion of the base from the prescribed quantity.

    The scenario refuses inputs with infinite acceleration, such as a sudden step of the displacement.

    Parameters
    ----------
    excitation, duration, folder : see `level_signal`.

    Returns
    -------
    BaseMotion
        Harmonic motions have zero mean; a motion that begins during the run starts at rest.

    Raises
    ------
    ScenarioError
        As `level_signal`.
    """
    if excitation.kind in ("swept_sine", "random"):
        return _motion_in_pieces(excitation, duration, folder)
    given, account = level_signal(excitation, duration, folder)
    integrals = power_of(excitation.quantity)
    motion = [given]  # acceleration, velocity and displacement
    for _ in range(integrals):
        motion.insert(0, motion[0].derivative())
    for _ in range(2 - integrals):
        last = motion[-1]
        if excitation.kind in ("harmonic", "multi_tone"):  # with zero mean
            motion.append(Signal(last.start, last.exponent, last.coefficient / last.exponent[None, :, None]))
        else:
            motion.append(last.antiderivative())
    acceleration, velocity, displacement = motion
    return BaseMotion(acceleration, velocity, displacement, account=account)


def highest_excited_hz(scenario: Scenario) -> float:
    """Highest frequency of the excitation, Hz, also for a curve in a file.

    Raises
    ------
    ScenarioError
        As `target_curve` and `read_density`.
    """
    highest: float = scenario.excitation.highest_frequency_hz
    for path, each in scenario.excitation.items:
        if isinstance(each, MatchedInput | RandomInput):
            highest = max(highest, _highest_of_curve(scenario, ("excitation", *path), each))
    return highest


def _highest_of_curve(scenario: Scenario, path: Keys, excitation: MatchedInput | RandomInput) -> float:
    """Highest frequency, Hz, of the curve in a file at a path; 0 if the scenario contains the points."""
    with prefix_problems("excitation", path_text(path)):
        if isinstance(excitation, MatchedInput):
            return float(target_curve(excitation, scenario.folder_of(*path, "srs", "file"))[0][-1])
        if isinstance(excitation.psd, CurveFile):
            return float(read_density(excitation, excitation.psd, scenario.folder_of(*path, "psd", "file"))[0][-1])
    return 0.0
