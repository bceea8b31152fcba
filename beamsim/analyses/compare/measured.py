"""Harmonics of measured signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.analyses.run.records import project
from beamsim.measurements.signal import MeasuredSignal, MeasurementError
from beamsim.typing import Complexes, Floats, Ints

_PHASES = 720  # grid for the initial guess of Newton's method


@dataclass(frozen=True)
class Harmonics:
    """Harmonics of a steady vibration: x = Im sum_k value_k e^{2 pi i k f t}."""

    order: Ints  # (h,)
    value: Complexes  # (h,)
    noise: Floats  # (h,) standard deviation of real and imaginary part; zero when unknown
    has_phase: bool


def harmonics_of(signal: MeasuredSignal, frequency_hz: float, count: int, last: float | None = None) -> Harmonics:
    r"""The first `count` harmonics of a frequency, by least squares on the signal or from a spectrum's lines.

    All harmonics of a time history up to half the sample rate (60 at most) are fitted; the scatter of the residual,
    assumed white, gives the noise :math:`s \sqrt{2 / N}` of each part.

    Raises
    ------
    MeasurementError
        If the record is too short or its spectrum too coarse.
    """
    orders = np.arange(1, count + 1)
    if signal.of_frequency:
        return _of_spectrum(signal, frequency_hz, orders)
    t, x = signal.x, np.asarray(signal.y, dtype=float)
    if last is not None:
        kept = t >= t[-1] - last
        t, x = t[kept], x[kept]
    if t.size < 4:
        raise _short(f"has {t.size} samples in the part used")
    rate = (t.size - 1) / (t[-1] - t[0])
    if (t[-1] - t[0]) * frequency_hz < 1 - 1e-3:
        raise _short(f"lasts {t[-1] - t[0]:.4g} s, less than a period of {frequency_hz:g} Hz")
    highest = int(0.499 * rate / frequency_hz)
    if highest < count:
        raise _short(
            f"is sampled at {rate:.5g} Hz, too slowly for {count} harmonics of {frequency_hz:g} Hz (it has {highest})"
        )
    # 60: fitted to a signal; the residual counts as noise
    taken = min(highest, 60, max(count, (t.size - 2) // 4))
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


def _short(message: str) -> MeasurementError:
    return MeasurementError(message, "use a longer record or a higher sample rate, or fewer harmonics")


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
    # the amplitude of noise with standard deviation s in both parts has the median 1.1774 s
    noise = float(np.median(between)) / 1.1774 if between.size > 8 else 0.0
    return Harmonics(orders, value, np.full(orders.size, noise), complex_values)


def settled_from(time: Floats, x: Floats, period: float) -> tuple[float, float]:
    """Start of the longest last part of a history whose periods repeat, s, and the largest relative difference in it.

    Periods are compared with the last one or the last but one (a period-doubled motion), in the rms. Where the last
    periods already differ by more, the part is the last half.
    """
    from scipy.interpolate import CubicSpline

    count = int(np.floor((time[-1] - time[0]) / period * (1 + 1e-9)))
    if count < 4:
        return float(time[0]), 0.0
    phases = np.linspace(0.0, 1.0, 64, endpoint=False)
    starts = time[-1] - period * np.arange(count, 0, -1)
    periods = CubicSpline(time, x)(starts[:, None] + period * phases)
    periods = periods - periods[-2:].mean()
    size = max(float(np.sqrt(np.mean(periods[-2:] ** 2))), 1e-300)
    rms = np.sqrt(np.mean((periods[:, None, :] - periods[None, -2:, :]) ** 2, axis=2)) / size  # (count, 2)
    rms[-1, 1] = rms[-2, 0] = np.inf  # not with themselves
    difference = np.minimum(rms[:, 0], rms[:, 1])
    difference[-1] = difference[-2] = min(float(rms[-1, 0]), float(difference[-4:-2].max()))
    # 0.01: of the rms: periods that differ by less are alike
    moving = np.flatnonzero(difference > 0.01)
    first = int(moving[-1]) + 1 if moving.size else 0
    if count - first < 4:
        half = count // 2
        return float(starts[half]), float(difference[half:].max())
    return float(max(starts[first], time[0])), float(difference[first:].max())


def best_phase(measured: Harmonics, predicted: Complexes, sigma: Floats) -> float:
    """The phase psi that brings predicted e^{i k psi} closest to the measured harmonics."""
    psi = np.arange(_PHASES) * (2 * np.pi / _PHASES)
    weight = np.conj(measured.value) * predicted / sigma**2

    gain = (np.exp(1j * np.multiply.outer(psi, measured.order)) @ weight).real
    best = float(psi[int(np.argmax(gain))])
    for _ in range(30):
        turned = weight * np.exp(1j * measured.order * best)
        slope = float(-np.sum(measured.order * turned.imag))
        curvature = float(-np.sum(measured.order**2 * turned.real))
        if curvature >= 0:
            break
        step = -slope / curvature
        best += float(np.clip(step, -0.01, 0.01))
        if abs(step) < 1e-14:
            break
    return best
