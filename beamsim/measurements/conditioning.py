r"""Preparation of a time history: rounded time stamps, offsets, filters, another sampling rate.

Nothing is done in silence: what was done is added to `MeasuredSignal.scaling`, what is doubtful to its warnings.

*Time stamps.* Stamps :math:`t_k` that are written to last digits :math:`q_k`, of equal decimals or of equal significant
digits, belong to samples at :math:`t_0 + k h` for every step h with
:math:`\max_k (t_k - q_k / 2 - k h) \le \min_k (t_k + q_k / 2 - k h)`. That is a convex condition, so that the steps
that fit all stamps are an interval. The sampling rate is the number in it that has only the factors 2, 3 and 5, as
those of data acquisition systems have, and that is nearest to the best fit; else the best fit.

*Filters.* A record is low-pass filtered by a symmetric FIR filter (Kaiser window) before its sampling rate is lowered,
so that nothing above half of the new rate is aliased: -6 dB at 0.45 of the new rate, -100 dB from 0.5 on, without
delay. At each end the record is continued by its mirror image or by its point reflection, whichever makes the smoother
end. A pulse of eight samples at the start of an acceleration or load makes its first and second integral, the velocity
and displacement of a base that starts from rest, those of the filtered record that is zero before. The high-pass
filter is a Butterworth filter of second order, forward and backward.

*Derivatives.* Rounding of a displacement to steps q is like white noise of variance :math:`q^2 / 12`. The second
derivative of the cubic spline through the samples multiplies it by
:math:`(3 (2 - 2 \cos \omega) / (2 + \cos \omega))^2` over :math:`h^4` at each frequency :math:`\omega / h`, the first
by :math:`(3 \sin \omega / (2 + \cos \omega))^2` over :math:`h^2`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np

from beamsim.errors import InputFileError
from beamsim.measurements.signal import LARGEST_VALUE, MeasuredSignal
from beamsim.scenario import units
from beamsim.scenario.files import RecordPreparation
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.typing import TINY, Floats

EVEN = 1e-6  # of the step, by which steps of an even record differ at most
WARNED_STEPS = 1e-3  # of the step: a larger difference of steps by rounding is warned of
FEWEST_ODD_STEPS = 0.01  # share of steps that are shorter or longer by half, above which they are no gaps
PASS, STOP, ATTENUATION_DB = 0.4, 0.5, 100.0  # of the low-pass filter; frequencies over the new sampling rate
MOST_RESAMPLED = 50_000_000  # samples
MOST_FINER = 20  # times as many samples of an uneven record that is made even
PULSE, MATCHED = 8, 40  # new samples: length of the pulse at the start, and where integrals are those of the record
INTEGRATED = tuple(each.unit for each in (units.LENGTH, units.VELOCITY, units.ANGLE, units.ANGULAR_VELOCITY))
WARNED_REMOVAL = 0.01  # of the mean square, that a low-pass filter takes away
WARNED_START, WARNED_OFFSET = 0.02, 0.01  # of the largest value
LIKE_GRAVITY = 0.03  # of standard gravity, by which an offset differs from it at most
FLAT_SAMPLES, FLAT_TOPS = 3, 2  # samples at exactly the end of a sensor's range, and number of such tops
FLAT_SHARE = 0.5  # of all samples, above which a record rests or switches there
WARNED_ROUNDING = 0.05  # of the derived acceleration
FLOAT32_DIGITS = 9  # with which every number in single precision can be written
PERIODS_OF_FILTER = 2  # of a high-pass filter, that a record lasts at least


def with_even_times(signal: MeasuredSignal) -> MeasuredSignal:
    """A time history at its sampling rate where its time stamps are those of even samples but for their last digit.

    Parameters
    ----------
    signal : as read from a file, over times in the unit of the file.

    Returns
    -------
    MeasuredSignal
        The signal itself where its stamps are even, or are not explained by one sampling rate.
    """
    x = np.asarray(signal.x, dtype=float)
    if signal.is_over_frequency or not signal.axis or x.size < 8 or not np.abs(x).max() <= LARGEST_VALUE:
        return signal
    steps = np.diff(x)
    mean = float(x[-1] - x[0]) / steps.size
    if mean <= 0.0 or np.ptp(steps) <= EVEN * mean:
        return signal
    digits = _last_digits(x)
    digit = float(digits.max())
    typical = float(np.median(steps))
    odd = np.abs(steps - typical) >= 0.5 * abs(typical)
    few = 0 < odd.sum() <= max(FEWEST_ODD_STEPS * odd.size, 2.0)  # gaps, or lines that stand twice
    if few or np.ptp(steps) > 1.001 * digit:
        return signal
    bounds = _fitting_steps(x, mean, digits)
    if bounds is None:
        return signal
    try:
        second = units.read_quantity(f"1 {signal.axis_unit}", units.TIME)
    except units.UnitError:
        second = 1.0
    rate = _sampling_rate(*(1.0 / (step * second) for step in bounds)) * second
    offsets, half = x - np.arange(x.size) / rate, 0.5 * (1 + 1e-6) * digits
    fits = bool(np.all(np.abs(offsets - x[0]) <= half))
    first = x[0] if fits else 0.5 * ((offsets - half).max() + (offsets + half).min())
    unit, hertz = signal.axis_unit or "s", f"{rate / second:.7g} Hz"
    warning = (
        f"time stamps are rounded to {digit:g} {unit}, so that their steps are {steps.min():.4g} to {steps.max():.4g} "
        f"{unit}; the sampling rate is taken as {hertz}, which fits all of them within half their last digit"
    )
    even = replace(signal, x=first + np.arange(x.size) / rate)
    if np.ptp(steps) <= WARNED_STEPS * mean:
        return even
    statement = f"time stamps rounded to {digit:g} {unit}: sampled at {hertz}"
    return replace(even, scaling=(*signal.scaling, statement), warnings=(*signal.warnings, warning))


def _last_digits(x: Floats) -> Floats:
    """(n,) the last digit of each of some numbers, which have a number of decimals or of significant digits."""
    largest = float(np.abs(x).max())
    some = np.unique(np.append(x[:: max(x.size // 2000, 1)], x[-1]))
    significant = max(len(_digits(value)) for value in some[some != 0.0].tolist())
    if significant > FLOAT32_DIGITS and np.array_equal(x, x.astype(np.float32)):
        return np.spacing(np.abs(x).astype(np.float32)).astype(float)
    size = np.floor(np.log10(np.where(x == 0.0, largest, np.abs(x)) * (1 + 1e-12))) + 1
    of_significant = np.where(x == 0.0, 0.0, 10.0 ** (size - significant))
    for power in range(int(np.floor(np.log10(largest))), -13, -1):
        for times in (5.0, 2.0, 1.0):
            ratio = x / (times * 10.0**power)
            if np.abs(ratio - np.round(ratio)).max() < 1e-3 and np.abs(ratio).max() < 1e12:
                return np.maximum(of_significant, times * 10.0**power)
    return of_significant


def _digits(value: float) -> str:
    """The significant digits of a number as it is written shortest."""
    return f"{value!r}".lower().partition("e")[0].replace(".", "").strip("-").strip("0")


def _fitting_steps(x: Floats, mean: float, digits: Floats) -> tuple[float, float, float] | None:
    """The shortest, the best and the longest step that fits all time stamps within half a digit; None without any."""
    from scipy.optimize import brentq, minimize_scalar

    number, half = np.arange(x.size), 0.5 * (1 + 1e-6) * digits
    reach = float(digits.max()) / (x.size - 1)  # no other step has both ends within half a digit

    def excess(change: float) -> float:  # over what rounding allows
        offsets = x - number * (mean + change * reach)
        return float((offsets - half).max() - (offsets + half).min())

    best = float(minimize_scalar(excess, bounds=(-1.0, 1.0), method="bounded", options={"xatol": 1e-6}).x)
    if excess(best) > 0.0:
        return None
    ends = [end if excess(end) <= 0.0 else brentq(excess, best, end, xtol=1e-9) for end in (-1.001, 1.001)]
    return mean + ends[0] * reach, mean + best * reach, mean + ends[1] * reach


def _sampling_rate(highest: float, fitted: float, lowest: float) -> float:
    """The sampling rate between two bounds, Hz, that a data acquisition system would have; else the best one."""
    regular = [
        float(2**a * 3**b * 5**c)
        for c in range(10)
        for b in range(4)
        for a in range(25)
        if lowest <= 2**a * 3**b * 5**c <= highest
    ]
    whole = [float(np.round(fitted))] if lowest <= np.round(fitted) <= highest else []
    return min(regular or whole or [fitted], key=lambda rate: abs(rate - fitted))


def is_even(time: Floats) -> bool:
    """Whether times (n,) are at equal steps."""
    steps = np.diff(time)
    return bool(np.ptp(steps) <= EVEN * float(np.mean(steps)) + 8 * np.spacing(np.abs(time).max()))


def condition(signal: MeasuredSignal, preparation: RecordPreparation, resample: float | None = None) -> MeasuredSignal:
    """A record with its factor, without mean or trend, at another sampling rate and high-pass filtered, in this order.

    Parameters
    ----------
    signal : in SI units.
    preparation : from the scenario.
    resample : sampling rate, Hz, to which it is filtered and resampled; by default it keeps its own.

    Returns
    -------
    MeasuredSignal

    Raises
    ------
    InputFileError
        If it is no time history, not even, or too short for a filter.
    """
    if preparation.factor != 1.0:
        signal = replace(
            signal, y=preparation.factor * signal.y, scaling=(*signal.scaling, f"times {preparation.factor:g}")
        )
    if (preparation.remove or preparation.high_pass or resample) and (
        signal.is_over_frequency or np.iscomplexobj(signal.y)
    ):
        raise InputFileError("is no time history, which could be filtered", "leave out remove and high_pass")
    given = signal
    if preparation.remove is not None:
        signal = _remove_trend(signal, preparation.remove)
    if resample is not None:
        signal = resample_signal(signal, resample)
    if preparation.high_pass is not None:
        signal = high_pass(signal, preparation.high_pass)
    if signal.unit != units.ACCELERATION.unit or (preparation.remove is None and preparation.high_pass is None):
        return signal
    (speed, way), (left, short) = _ends_of_motion(given), _ends_of_motion(signal)
    text = f"from rest it ends at {left:.3g} m/s and {short:.3g} m, without this at {speed:.3g} m/s and {way:.3g} m"
    return replace(signal, scaling=(*signal.scaling, text))


def _ends_of_motion(acceleration: MeasuredSignal) -> tuple[float, float]:
    """Velocity, m/s, and displacement, m, at the end of an acceleration in m/s^2 that is linear between its samples."""
    y, steps = np.asarray(acceleration.y, dtype=float), np.diff(acceleration.x)
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * steps * (y[1:] + y[:-1]))])
    return float(velocity[-1]), float(np.sum(steps * (velocity[:-1] + steps * (2.0 * y[:-1] + y[1:]) / 6.0)))


def _remove_trend(signal: MeasuredSignal, component: str) -> MeasuredSignal:
    """A time history without its mean or trend."""
    degree = 1 if component == "trend" else 0
    line = np.polynomial.Polynomial.fit(signal.x, signal.y, degree)
    removed = line(signal.x)
    size = f"{removed[0]:.4g}" if degree == 0 else f"{removed[0]:.4g} to {removed[-1]:.4g}"
    text = f"{component} of {size} {signal.unit} removed"
    return replace(signal, y=signal.y - removed, scaling=(*signal.scaling, text))


def resample_signal(signal: MeasuredSignal, rate: float) -> MeasuredSignal:
    """A time history at another sampling rate, low-pass filtered before where that is lower.

    Parameters
    ----------
    signal : over times in s.
    rate : Hz; the nearest ratio of whole numbers up to 1000 to that of the record is taken.

    Returns
    -------
    MeasuredSignal

    Raises
    ------
    InputFileError
        If the steps of an uneven record are too different, or few samples are left.
    """
    from scipy.interpolate import CubicSpline

    time, values = signal.x, np.asarray(signal.y, dtype=float)
    old = (time.size - 1) / float(time[-1] - time[0])
    count = rate * float(time[-1] - time[0])
    if count > MOST_RESAMPLED:
        raise InputFileError(
            f"would have {count:.3g} samples at resample = {rate:g} Hz (at most {MOST_RESAMPLED:.0e})",
            "give a lower rate, or a shorter record",
        )
    if not is_even(time):
        finest = 1.0 / float(np.diff(time).min())
        if finest > MOST_FINER * old:
            raise InputFileError(
                f"is unevenly sampled: steps are {np.diff(time).min():.3g} to {np.diff(time).max():.3g} s",
                "export it at one sampling rate",
            )
        spline, old = CubicSpline(time, values), finest
        time = _even_times(time, old)
        values = np.asarray(spline(time))
    if rate >= old * (1 - 1e-9):
        even = _even_times(time, rate)
        text = f"interpolated from {old:.6g} to {rate:.6g} Hz"
        return replace(signal, x=even, y=np.asarray(CubicSpline(time, values)(even)), scaling=(*signal.scaling, text))
    ratio = Fraction(rate / old).limit_denominator(1000) or Fraction(1, round(old / rate))
    if ratio == 1:
        return signal
    return _decimate(replace(signal, x=time, y=values), old, ratio, rate)


def _even_times(time: Floats, rate: float) -> Floats:
    """Times in s at an even rate, Hz, within those of a record."""
    return np.asarray(time[0] + np.arange(int(np.floor((time[-1] - time[0]) * rate * (1 + 1e-12))) + 1) / rate)


def _decimate(signal: MeasuredSignal, present_rate: float, ratio: Fraction, rate: float) -> MeasuredSignal:
    """An evenly sampled history, low-pass filtered and at a lower sampling rate.

    Parameters
    ----------
    signal : over times in s.
    present_rate : its sampling rate, Hz.
    ratio : of the new rate to this one.
    rate : Hz, that was asked for.

    Raises
    ------
    InputFileError
        If few samples are left.
    """
    time, values = signal.x, np.asarray(signal.y, dtype=float)
    new = present_rate * float(ratio)
    cutoff = 0.5 * (PASS + STOP) * new
    left_over = math.ceil(values.size * ratio)
    if left_over < 2 * MATCHED:
        raise InputFileError(
            f"would have {left_over} samples at resample = {rate:g} Hz (at least {2 * MATCHED})",
            "give a higher rate, or a longer record",
        )
    filtered = _low_pass(values, ratio)
    if signal.unit not in INTEGRATED:
        filtered[: PULSE + 1] += _start_pulse(values, filtered, float(ratio))
    even = time[0] + np.arange(filtered.size) / new
    kept = even <= time[-1] + 1e-9 / new
    left, size = float(np.std(filtered[kept])), float(np.std(values))
    share = max(1.0 - (left / size) ** 2, 0.0) if size > 0.0 else 0.0
    text = (
        f"low-pass filtered without phase (-6 dB at {cutoff:.4g} Hz, -{ATTENUATION_DB:g} dB from {STOP * new:.4g} Hz) "
        f"and resampled from {present_rate:.6g} to {new:.6g} Hz, {100.0 * share:.3g} % of the mean square removed"
    )
    warning = (
        f"the low-pass filter of resample takes away {100.0 * share:.3g} % of the mean square of {signal.source}, "
        f"which lies above {PASS * new:.4g} Hz: give a higher resample if the structure responds there"
    )
    return replace(
        signal, x=even[kept], y=filtered[kept], scaling=(*signal.scaling, text),
        warnings=(*signal.warnings, *([warning] if share > WARNED_REMOVAL else [])),
    )  # fmt: skip


def _filter(rate: float) -> Floats:
    """Taps, odd in number, of the low-pass filter for a record with a sampling rate, in terms of the new one."""
    from scipy.signal import firwin, kaiserord

    taps, beta = kaiserord(ATTENUATION_DB, 2.0 * (STOP - PASS) / rate)
    return np.asarray(firwin(taps | 1, 0.5 * (PASS + STOP), window=("kaiser", beta), fs=rate), dtype=float)


def _low_pass(values: Floats, ratio: Fraction) -> Floats:
    """A record (n,) at a lower rate, low-pass filtered; a ratio is that of the new rate to its own."""
    from scipy.signal import resample_poly

    taps, size = _filter(float(ratio.denominator)), values.size
    reach = min(taps.size // (2 * ratio.numerator) + 1, size - 1)
    before, behind = _continuation_before(values, reach), _continuation_before(values[::-1], reach)[::-1]
    # as long as whole steps of the new rate, so that the first sample of the record is one of the result
    before = np.pad(before, (-before.size % ratio.denominator, 0), mode="edge")
    continued: Floats = np.concatenate([before, values, behind])
    whole = resample_poly(continued, *ratio.as_integer_ratio(), window=taps)  # type: ignore[call-overload,unused-ignore]
    first = before.size * ratio.numerator // ratio.denominator
    return np.array(whole[first : first + (size - 1) * ratio.numerator // ratio.denominator + 1], dtype=float)


def _continuation_before(values: Floats, size: int) -> Floats:
    """What is put before a record, (reach,) samples: its mirror image where that has the smoother join, else its point
    reflection. The one has a kink of the slope, the other of the curvature."""
    slopes, curvatures = np.diff(values), np.diff(values, 2)
    frequency = np.sqrt(np.mean(curvatures**2) / max(float(np.mean(slopes**2)), TINY))  # of most of it, per sample
    image = values[size:0:-1]
    mirrored = abs(float(slopes[0])) * frequency < 1.1 * abs(float(curvatures[0]))
    return np.asarray(image if mirrored else 2.0 * values[0] - image, dtype=float)


def _start_pulse(values: Floats, filtered: Floats, ratio: float) -> Floats:
    """What is added to the first samples (PULSE + 1,) of a filtered record to keep the integrals of the record.

    Parameters
    ----------
    values : (n,) the record.
    filtered : (m,) at the new rate, in whose steps times are here.
    ratio : of the new rate to that of the record.
    """
    from scipy.interpolate import CubicSpline
    from scipy.signal import oaconvolve

    number = np.arange(PULSE + 1)
    taps = _filter(1.0 / ratio)
    end = int(MATCHED / ratio)  # in steps of the record
    first = values[: end + taps.size].copy()
    first[0] *= 0.5  # of the trapezoidal rule: the record is zero before
    weight = ratio * oaconvolve(first, taps)[: end + taps.size // 2 + 1]
    weight[-1] *= 0.5
    left = ratio * np.arange(weight.size - 1, -1, -1)  # time until the end
    target = np.array([weight.sum(), weight @ left])

    def integrals(samples: Floats) -> Floats:
        velocity = CubicSpline(np.arange(samples.size), samples).antiderivative()
        return np.array([velocity(ratio * end), velocity.antiderivative()(ratio * end)])

    pulses = np.zeros((2, 2 * MATCHED))
    pulses[:, : number.size] = 1.0 - np.cos(2 * np.pi * number / PULSE), np.sin(2 * np.pi * number / PULSE)
    effect = np.transpose([integrals(pulse) for pulse in pulses])
    missing = target - integrals(filtered[: 2 * MATCHED])
    return np.asarray(np.linalg.solve(effect, missing) @ pulses[:, : number.size], dtype=float)


def high_pass(signal: MeasuredSignal, frequency: float) -> MeasuredSignal:
    """A time history through a high-pass filter without phase.

    Parameters
    ----------
    signal : over times in s.
    frequency : Hz, at which it has -3 dB.

    Returns
    -------
    MeasuredSignal

    Raises
    ------
    InputFileError
        If it is uneven, or shorter than two periods of the filter, or sampled too slowly for it.
    """
    from scipy.signal import butter, sosfiltfilt

    time, values = signal.x, np.asarray(signal.y, dtype=float)
    rate, duration = (time.size - 1) / float(time[-1] - time[0]), float(time[-1] - time[0])
    if not is_even(time):
        raise InputFileError("is unevenly sampled, and a filter needs even samples", "export it at one sampling rate")
    if duration * frequency < PERIODS_OF_FILTER or frequency > 0.2 * rate:
        low, high = PERIODS_OF_FILTER / duration, 0.2 * rate
        raise InputFileError(
            f"lasts {duration:.4g} s at {rate:.4g} Hz, which high_pass = {frequency:g} Hz does not suit",
            f"filter from {low:.3g} to {high:.3g} Hz, or use remove: trend",
        )
    # two passes of second order have -3 dB where each has -1.5 dB
    sections = butter(2, frequency * (np.sqrt(2.0) - 1.0) ** 0.25, "highpass", fs=rate, output="sos")
    filtered = sosfiltfilt(sections, values, padlen=min(values.size - 1, int(np.ceil(3.0 * rate / frequency))))
    size, removed = float(np.sqrt(np.mean(values**2))), float(np.sqrt(np.mean((values - filtered) ** 2)))
    text = (
        f"high-pass filtered without phase (-3 dB at {frequency:g} Hz), {removed:.3g} of {size:.3g} {signal.unit} rms "
        "removed"
    )
    return replace(signal, y=np.asarray(filtered), scaling=(*signal.scaling, text))


def offset_warnings(signal: MeasuredSignal, *, starts: bool) -> list[str]:
    """Warnings of a time history that stays at a value that is not zero, or begins with one.

    Parameters
    ----------
    signal : in SI units.
    starts : whether what it prescribes is at rest before it, so that a first value is a jump.
    """
    y = np.asarray(signal.y, dtype=float)
    largest, level, first = float(np.abs(y).max(initial=0.0)), float(np.median(y)), float(y[0])
    if largest == 0.0:
        return []
    unit = signal.unit
    blocks = np.array([np.median(part) for part in np.array_split(y, min(10, y.size))])
    acceleration = unit == units.ACCELERATION.unit
    gravity = acceleration and abs(abs(level) / STANDARD_GRAVITY - 1.0) < LIKE_GRAVITY
    stays = bool(np.all(blocks * level > 0.0)) and float(np.abs(blocks).min()) > 0.5 * abs(level)
    in_g = f" ({level / STANDARD_GRAVITY:.4g} g)" if acceleration else ""
    if stays and (gravity or abs(level) > WARNED_OFFSET * largest):
        contains = "gravity" if gravity else "an offset"
        jump = f", and begins with a jump of {first:.4g} {unit}" if starts else ""
        return [
            f"{signal.source} stays about {level:.4g} {unit}{in_g}, {100.0 * abs(level) / largest:.3g} % of its "
            f"largest value: it contains {contains}{jump}; take it away by remove: mean"
        ]
    if starts and abs(first) > WARNED_START * largest:
        return [
            f"{signal.source} begins with {first:.4g} {unit}, {100.0 * abs(first) / largest:.3g} % of its largest "
            "value, as a jump at t = 0: begin the record at rest, or take an offset away by remove: mean"
        ]
    return []


def clipping_warnings(signal: MeasuredSignal) -> list[str]:
    """A warning of a time history whose largest or smallest value is the end of a sensor's range.

    The record reaches exactly that value several times, from farther below than its last digit, and keeps it for three
    samples or more. One that is at it half of the time rests or switches there.

    >>> sine = np.sin(np.arange(200) / 5.0)
    >>> of = MeasuredSignal("tip", np.arange(200.0), np.minimum(sine, 0.8), unit="g")
    >>> clipping_warnings(of), clipping_warnings(replace(of, y=sine))
    (['tip stays at exactly 0.8 g 6 times, for up to 7 samples: the sensor or amplifier was at the end of its range, and
    the true values are beyond'], [])
    """
    if signal.is_over_frequency or np.iscomplexobj(signal.y):
        return []
    y, warnings = np.asarray(signal.y, dtype=float), []
    for level in (float(y.max()), float(y.min())):
        there = np.flatnonzero(np.diff(np.pad((y == level).astype(np.int8), 1)))
        begin, end = there[::2], there[1::2]
        flat = (end - begin >= FLAT_SAMPLES) & (begin > 0) & (end < y.size)
        if flat.sum() < FLAT_TOPS or np.sum(end - begin) > FLAT_SHARE * y.size:
            continue
        step = np.abs(level - y[begin[flat] - 1])
        if float(np.median(step)) > 1.5 * float(np.abs(level - y[y != level]).min()):
            warnings.append(
                f"{signal.name} stays at exactly {level:.4g} {signal.unit} {flat.sum()} times, for up to "
                f"{(end - begin)[flat].max()} samples: the sensor or amplifier was at the end of its range, and the "
                "true values are beyond"
            )
    return warnings


def resolution(values: Floats) -> float:
    """Root mean square of the steps in which values (n,) are given: their last digit; 0 of full precision."""
    levels = np.unique(values)
    if levels.size < 3:
        return 0.0
    step = float(np.diff(levels).min())
    multiples = (levels - levels[0]) / step
    if np.abs(multiples - np.round(multiples)).max() < 1e-2:
        return step
    given = values[values != 0.0]
    some = given[:: max(given.size // 2000, 1)]
    digits = max(len(_digits(value)) for value in some.tolist())
    if np.array_equal(given, given.astype(np.float32)):
        return float(np.sqrt(np.mean(np.spacing(np.abs(given).astype(np.float32)).astype(float) ** 2)))
    if digits >= 15:
        return 0.0
    return float(np.sqrt(np.mean(10.0 ** (2 * (np.floor(np.log10(np.abs(given))) + 1 - digits)))))


def rounding_warnings(raw: MeasuredSignal, signal: MeasuredSignal, size: float, integrals: int) -> list[str]:
    """A warning where an acceleration that is derived from a record consists of the rounding of its values.

    Parameters
    ----------
    raw : as read, in the unit of the file, over times in that of the file.
    signal : as it is used, in SI units: filters take away part of the rounding.
    size : of a unit of the file, in those of ``signal``.
    integrals : how often the acceleration is integrated to the record: 1 of a velocity, 2 of a displacement.
    """
    from scipy.interpolate import CubicSpline

    step = size * resolution(np.asarray(raw.y, dtype=float)) if integrals else 0.0
    if step == 0.0 or signal.x.size < 4:
        return []
    length = float(signal.x[-1] - signal.x[0])
    steps = length / (signal.x.size - 1), length / (raw.x.size - 1)
    omega = np.linspace(0.0, np.pi, 1001)
    gain = (6.0 * (1.0 - np.cos(omega)) if integrals == 2 else 3.0 * np.sin(omega)) / (2.0 + np.cos(omega))
    noise = step / np.sqrt(12.0) * np.sqrt(np.mean(gain**2)) / steps[0] ** integrals
    noise *= np.sqrt(min(steps[1] / steps[0], 1.0))
    derived = float(np.sqrt(np.mean(CubicSpline(signal.x, signal.y)(signal.x, integrals) ** 2)))
    if noise <= WARNED_ROUNDING * derived:
        return []
    kind = "displacement" if integrals == 2 else "velocity"
    return [
        f"the acceleration is derived from the {kind} in {raw.source}, whose last digit is {step:.3g} {signal.unit}; "
        f"its rounding alone gives {noise:.3g} m/s^2 rms of the {derived:.3g} m/s^2 rms derived: give the acceleration "
        "or more digits, or filter it by resample"
    ]
