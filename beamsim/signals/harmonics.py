"""Harmonics of steady vibrations, measured or computed: amplitudes and phases, period, settled part, delay."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from beamsim.errors import InputFileError
from beamsim.measurements.signal import MeasuredSignal
from beamsim.signals.records import project
from beamsim.typing import TINY, Complexes, Floats, Ints

LONGEST_MOTION = 4  # periods of the excitation, of motions that are distinguished
ROUNDED = 1e-3  # of a period, by which times in files are rounded
BELOW_NYQUIST = 0.499  # of the sample rate, up to which harmonics are fitted
MEDIAN_OF_NOISE = 1.1774  # median amplitude of noise over the standard deviation of its real and imaginary parts
LINE_OVER_NOISE = 6.0  # amplitude of a line over that standard deviation
LEAST_LINE = 0.01  # amplitude of a line over that of the largest
FEW_LINES = 8  # lines between harmonics: of so few or fewer no noise is estimated
SAMPLES_OF_PERIOD = 64  # at which periods are compared
PHASES = 720  # of a turn that are tried: the best one is between the neighbours of the best of these


@dataclass(frozen=True)
class Harmonics:
    """Harmonics of a steady vibration: x = Im sum_k value_k e^{2 pi i k f t}."""

    order: Ints  # (h,)
    value: Complexes  # (h,)
    noise: Floats  # (h,) standard deviation of real and imaginary part; zero when unknown
    has_phase: bool


MOST_HARMONICS = 60  # fitted to a signal; the residual counts as noise


def harmonics_of(signal: MeasuredSignal, frequency_hz: float, count: int, last_s: float | None = None) -> Harmonics:
    r"""The first `count` harmonics of a frequency, by least squares on the signal or from a spectrum's lines.

    All harmonics of a time history up to half the sample rate (60 at most) are fitted; the scatter of the residual,
    assumed white, gives the noise :math:`s \sqrt{2 / N}` of each part.

    Parameters
    ----------
    signal : a time history, or a spectrum.
    frequency_hz : of the first harmonic.
    count : number of harmonics.
    last_s : use only this last part of a time history, s; by default all of it.

    Returns
    -------
    Harmonics

    Raises
    ------
    InputFileError
        If the record is too short or its spectrum too coarse.
    """
    orders = np.arange(1, count + 1)
    if signal.is_over_frequency:
        return _of_spectrum(signal, frequency_hz, orders)
    part = signal.last(last_s)
    t, x = part.x, np.asarray(part.y, dtype=float)
    if t.size < 4:
        raise _short(f"has {t.size} samples in the part used")
    rate = (t.size - 1) / (t[-1] - t[0])
    if (t[-1] - t[0]) * frequency_hz < 1 - ROUNDED:
        raise _short(f"lasts {t[-1] - t[0]:.4g} s, less than a period of {frequency_hz:g} Hz")
    highest = int(BELOW_NYQUIST * rate / frequency_hz)
    if highest < count:
        raise _short(
            f"is sampled at {rate:.5g} Hz, too slowly for {count} harmonics of {frequency_hz:g} Hz (it has {highest})"
        )
    taken = min(highest, MOST_HARMONICS, max(count, (t.size - 2) // 4))
    every = frequency_hz * np.arange(1, taken + 1, dtype=np.float64)
    mean, value = project(t, x, every)
    phase = np.exp(2j * np.pi * frequency_hz * t)
    fitted = np.full(t.size, mean)
    power = np.ones(t.size, dtype=complex)
    for c in value:
        power = power * phase
        fitted += (c * power).imag
    freedom = t.size - 1 - 2 * taken
    scatter = np.sqrt(np.sum((x - fitted) ** 2) / freedom) if freedom > 0 else 0.0
    return Harmonics(orders, value[:count], np.full(count, scatter * np.sqrt(2.0 / t.size)), True)


def period_multiple(signal: MeasuredSignal, frequency_hz: float) -> int:
    """How many periods of the excitation, up to `LONGEST_MOTION`, one period of a steady vibration has.

    It is the smallest number whose harmonics are all the lines below twice the frequency of the excitation. A record of
    fewer than twelve of its periods, or a spectrum with fewer than four lines in a twelfth of its frequency, does not
    tell.

    Parameters
    ----------
    signal : a time history, or a spectrum.
    frequency_hz : of the excitation; not finite where there is none.

    Returns
    -------
    int
    """
    parts = math.lcm(*range(1, LONGEST_MOTION + 1))
    fundamental = frequency_hz / parts
    if signal.is_over_frequency:
        tells = signal.x.size > 1 and 4 * float(np.median(np.diff(signal.x))) <= fundamental
    else:
        tells = (signal.x[-1] - signal.x[0]) * fundamental >= 1 - ROUNDED
    if not tells:
        return 1
    whole = (
        None
        if signal.is_over_frequency
        else np.floor((signal.x[-1] - signal.x[0]) * fundamental + ROUNDED) / fundamental
    )
    try:
        size = np.abs(harmonics_of(signal, fundamental, 2 * parts, whole).value)
    except InputFileError:
        return 1
    order = np.arange(1, size.size + 1)
    noise = float(np.median(size[order % parts != 0])) / MEDIAN_OF_NOISE
    lines = order[size > max(LINE_OVER_NOISE * noise, LEAST_LINE * size.max())]
    each = range(1, LONGEST_MOTION + 1)
    return next((multiple for multiple in each if not np.any(lines % (parts // multiple))), 1)


def _short(message: str) -> InputFileError:
    return InputFileError(message, "use a longer record or a higher sample rate, or fewer harmonics")


def _of_spectrum(signal: MeasuredSignal, frequency_hz: float, orders: Ints) -> Harmonics:
    step = float(np.median(np.diff(signal.x))) if signal.x.size > 1 else np.inf
    if step > 0.5 * frequency_hz:
        raise _short(f"has a line every {step:g} Hz, which is too coarse for harmonics of {frequency_hz:g} Hz")
    if orders[-1] * frequency_hz > signal.x[-1] + 0.5 * step:
        raise _short(f"ends at {signal.x[-1]:g} Hz, below harmonic {orders[-1]} of {frequency_hz:g} Hz")
    nearest = np.array([int(np.argmin(np.abs(signal.x - k * frequency_hz))) for k in orders])
    complex_values = bool(np.iscomplexobj(signal.y))
    value = signal.y[nearest].astype(complex)
    if complex_values:
        value = 1j * value  # from cosines to sines
    # the lines between the harmonics are noise
    distance = np.abs(signal.x / frequency_hz - np.round(signal.x / frequency_hz)) * frequency_hz
    between = np.abs(signal.y[distance > max(4 * step, 0.1 * frequency_hz)])
    noise = float(np.median(between)) / MEDIAN_OF_NOISE if between.size > FEW_LINES else 0.0
    return Harmonics(orders, value, np.full(orders.size, noise), complex_values)


ALIKE = 0.01  # of the rms: periods that differ by less are alike


def steady_part(time: Floats, x: Floats, period: float) -> tuple[float, float]:
    """The longest last part of a history whose periods repeat.

    Periods are compared, in the rms, with the last one of a motion that repeats after one, two, three or four of them.
    Where the last periods already differ by more than 1 %, the part is the last half.

    Parameters
    ----------
    time, x : (nt,) the history, time in s.
    period : of the excitation, s.

    Returns
    -------
    float, float
        Start of the part, s, and the largest relative difference of its periods; of fewer than four periods the start
        of the history, and 0.
    """
    count = int(np.floor((time[-1] - time[0]) / period * (1 + 1e-9)))
    if count < 4:
        return float(time[0]), 0.0
    phases = np.linspace(0.0, 1.0, SAMPLES_OF_PERIOD, endpoint=False)
    starts = time[-1] - period * np.arange(count, 0, -1)
    periods = CubicSpline(time, x)(starts[:, None] + period * phases)
    periods = periods - periods[-2:].mean()
    size = max(float(np.sqrt(np.mean(periods[-2:] ** 2))), TINY)
    half, unsettled = count // 2, np.inf
    for multiple in range(1, min(LONGEST_MOTION, half) + 1):
        behind = np.arange(count - 1, -1, -1)  # periods until the last one
        alike = count - 1 - behind % multiple
        alike[-multiple:] -= multiple  # not with themselves
        difference = np.sqrt(np.mean((periods - periods[alike]) ** 2, axis=1)) / size
        moving = np.flatnonzero(difference > ALIKE)
        first = int(moving[-1]) + 1 if moving.size else 0
        if count - first >= max(4, 2 * multiple):
            return float(max(starts[first], time[0])), float(difference[first:].max())
        unsettled = min(unsettled, float(difference[half:].max()))
    return float(starts[half]), unsettled


def best_phase(measured: Harmonics, predicted: Complexes, sigma: Floats) -> float:
    """The phase psi that brings predicted e^{i k psi} closest to the measured harmonics.

    Parameters
    ----------
    measured : h harmonics.
    predicted : (h,) those of the prediction.
    sigma : (h,) standard deviations of the measured ones.

    Returns
    -------
    float
        rad.
    """
    from scipy.optimize import brentq

    step = 2 * np.pi / PHASES
    weight = np.conj(measured.value) * predicted / sigma**2
    gain = (np.exp(1j * np.multiply.outer(step * np.arange(PHASES), measured.order)) @ weight).real
    best = step * int(np.argmax(gain))

    def slope(psi: float) -> float:
        return float(-np.sum(measured.order * (weight * np.exp(1j * measured.order * psi)).imag))

    around = best - step, best + step
    return float(brentq(slope, *around, xtol=1e-15)) if slope(around[0]) > 0.0 > slope(around[1]) else best
