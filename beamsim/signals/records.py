r"""Records for spectra, of samples or of a motion in closed form, and pairs of lines that share one maximum.

Both are projected on sinusoids of known frequencies by least squares, with a window as weight. Of samples the sums are
taken as they are. Of a motion in closed form they are integrals: those of the sinusoids are transforms of the window,
those of the motion are Fourier integrals over the pieces between its events. The curve of a spectrum consists of the
same integrals at multiples of one over the duration. Nothing is aliased, and no sampling rate enters. Windows are sums
of cosines, whose transforms are known in closed form.

Near a line, the curve of a record under a window :math:`w` is the sum of the window's transforms at the frequencies of
all lines, if every line is steady. What is left there after the fitted lines are subtracted (`Remainder`) shows that
there is more: another line in the same lobe of the window, or an amplitude that changes during the record.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from beamsim.flow.channels import Exponentials, MotionPart
from beamsim.typing import Bools, Complexes, Floats, Ints

NEXT_TO_ZERO = 1e-20  # of a period, in place of zero, where its square does not underflow
_DIFFERENCE = 1e-3  # of frequencies, over one over the duration, for derivatives by the frequency
_MOST_STEPS = 24  # to the frequencies of lines
_NEAR = 0.02  # change of a frequency over one over the duration, below which curvature of the misfit is trusted
_AT_REST = 1e-5  # change of a frequency over one over the duration
_DEPENDENT = 1e-5  # share of a function that the ones before it do not explain
_NEAREST = 0.5  # of two lines, bins (over one over the duration), that a fit can separate
FLOOR_DB = -400.0  # what stands for the level of a zero amplitude, far below round-off (about -310 dB)
LOBE = 4  # half-width of the Blackman-Harris main lobe, bins
_FINER = 3  # times that the search for a pair is repeated around the best one, with a quarter of the step
_STEP = 4**_FINER  # of the frequencies of a pair in the first search, in the last steps
_PLACES_PER_BIN = 4 * _STEP
_REACH = 4 * _PLACES_PER_BIN  # of the two lines of a pair from the maximum that they share, in the last steps

# Coefficients of w(u) = sum_j (-1)^j a_j cos(2 pi j u / T); importing scipy.signal would cost most of a second.
_COSINE_SUMS = {
    "rectangular": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 0.46),
    "blackman": (0.42, 0.50, 0.08),
    "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168),
    "flattop": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
}


@dataclass(frozen=True)
class Window:
    r"""A sum of cosines on [0, T].

    Parameters
    ----------
    cosines : factors of :math:`\cos(j \kappa u)`, j = 0, 1, ...; the first is the mean.
    exponentials : the same sum as one of :math:`c e^{-i \pi s u / T}`.
    one_sided : the falling half of the window alone, largest at the beginning: what happens first counts.
    """

    cosines: tuple[float, ...]
    exponentials: Exponentials
    one_sided: bool = False

    @classmethod
    def of_name(cls, name: str, one_sided: bool = False) -> Window:
        """By the name in a scenario, or of a sum of cosines; ``decaying`` is the falling half of a Hann window."""
        if name == "decaying":
            name, one_sided = "hann", True
        cosines, each = _COSINE_SUMS[name], 1 if one_sided else 2
        if not one_sided:
            cosines = tuple(c * (-1.0) ** j for j, c in enumerate(cosines))
        sides = [(each * j, 0.5 * c) for j, c in enumerate(cosines) if j]
        return cls(cosines, ((0, cosines[0]), *sides, *((-s, c) for s, c in sides)), one_sided)

    def values(self, share: Floats) -> Floats:
        """w at times given as shares of the duration."""
        angle = (1.0 if self.one_sided else 2.0) * np.pi * share
        return np.asarray(sum(c * np.cos(j * angle) for j, c in enumerate(self.cosines)))

    def amplitudes(self, x: Floats) -> Complexes:
        r"""(N // 2 + 1,) single-sided amplitudes of N samples, the weighted mean first; see `spectra_of` of runs."""
        window, total = _sample_window(self, x.size)
        mean = float(window @ x) / total
        out = np.fft.rfft(window * (x - mean)) * (2.0 / total)
        if x.size % 2 == 0:
            out[-1] /= 2.0  # the line at half the rate is not doubled
        out[0] = mean
        return np.asarray(out)

    def transform(self, omega: Floats, duration: float) -> Complexes:
        r"""Fourier integrals :math:`\int_0^T w e^{-i\omega u} du` of the window, of the shape of omega, rad/s.

        With :math:`x = \omega T / 2 \pi` an exponential of the window contributes
        :math:`(T / \pi) E(x + s / 2) / (x + s / 2)`, where :math:`E(z) = e^{-i \pi z} \sin \pi z` has the period 1.
        """
        x = np.asarray(omega, dtype=float) * (duration / (2.0 * np.pi))
        out = np.zeros(x.shape, dtype=complex)
        for odd in (0, 1) if self.one_sided else (0,):
            place = x + 0.5 * odd
            whole = np.rint(place)
            rest = place - whole  # which keeps the digits of the sine near its zeros
            rest[rest == 0.0] = NEXT_TO_ZERO  # sin(z) / z is 1 there
            sums = np.zeros(x.shape)
            for steps, factor in self.exponentials:
                if steps % 2 == odd:
                    sums += factor / ((whole + steps // 2) + rest)
            rest *= np.pi
            sine = np.sin(rest)
            sums *= sine * (duration / np.pi)
            out.real += np.cos(rest) * sums
            out.imag -= sine * sums
        return out


@lru_cache(maxsize=4)
def _sample_window(window: Window, size: int) -> tuple[Floats, float]:
    """A window at equal steps, and the sum of its values; the records of one part of a motion share them."""
    values = window.values(np.arange(size) / size)
    if window.one_sided:
        values[0] *= 0.5  # the beginning is a jump
    total = float(np.sum(values))
    if total <= 0:  # a window of one or two samples may be nothing but its zero
        values, total = np.ones(size), float(size)
    values.flags.writeable = False
    return values, total


RECTANGULAR = Window.of_name("rectangular")


class Levels(NamedTuple):
    """Size of a record."""

    peak: float  # largest magnitude
    deviation: float  # largest one from the mean
    rms: float  # root mean square, mean included


class SpectrumRecord(ABC):
    """A record from which spectra are computed."""

    start: float  # s
    duration: float  # s; the curve of the spectrum is known at multiples of its inverse
    size: int  # number of samples, or of those that would cover the curve
    highest_hz: float  # Hz, up to which a sinusoid's amplitude and phase are known

    @abstractmethod
    def levels(self) -> Levels:
        """Peak, deviation and root mean square."""

    @abstractmethod
    def rms(self) -> float:
        """The root mean square alone, mean included."""

    @abstractmethod
    def amplitudes(self, window: Window) -> Complexes:
        """(F,) single-sided amplitudes under a window, phases since the start, the weighted mean first.

        See `beamsim.analyses.run.spectra.spectra_of`.
        """

    @abstractmethod
    def normal_equations(self, frequency_hz: Floats, window: Window) -> tuple[Floats, Floats]:
        """Normal equations of a least-squares fit, under a window, of 1, sines (k,) and cosines (k,) since the start.

        Returns
        -------
        matrix, right : (2 k + 1, 2 k + 1) weighted mean products of these functions, and (2 k + 1,) of each with the
            record.
        """

    @abstractmethod
    def residual(self, frequency_hz: Floats) -> float:
        """Root mean square of the residual of the projection on sinusoids (k,)."""

    @abstractmethod
    def halves(self) -> tuple[SpectrumRecord, SpectrumRecord]:
        """The first and the second half of the time."""

    def project(self, frequency_hz: Floats, window: Window | None = None) -> tuple[float, Complexes]:
        """Mean and complex amplitudes (k,) of sinusoids (k,), and under a window of a slope, by least squares."""
        if window is None:
            fit = _solve_normal_equations(*self.normal_equations(frequency_hz, RECTANGULAR))[0]
            return float(fit[0]), _complex(fit[1:], frequency_hz, self.start)
        matrix, right = self.normal_equations(np.append(_DIFFERENCE / self.duration, frequency_hz), window)
        kept = np.delete(np.eye(right.size), 2 + np.size(frequency_hz), axis=0)  # a sine of no frequency is a slope
        kept[1] /= 2.0 * np.pi * _DIFFERENCE
        matrix = kept @ matrix @ kept.T
        fit = _solve_normal_equations(matrix, kept @ right)[0]
        return float(fit[0] + matrix[0, 1] * fit[1]), _complex(fit[2:], frequency_hz, self.start)


class SampledRecord(SpectrumRecord):
    """Equally spaced samples, of which all sums are taken as they are.

    Parameters
    ----------
    time, x : (N,) s, and unit of the signal.
    rate : samples per second.
    """

    def __init__(self, time: Floats, x: Floats, rate: float) -> None:
        self.time, self.x, self.rate = time, x, rate
        self.start, self.size, self.duration = float(time[0]), int(x.size), x.size / rate
        self.highest_hz = 0.49 * rate  # below half the rate, at which a sine and a cosine are one sinusoid

    def levels(self) -> Levels:
        """See `SpectrumRecord`."""
        return Levels(float(np.max(np.abs(self.x))), float(np.max(np.abs(self.x - np.mean(self.x)))), self.rms())

    def rms(self) -> float:
        """See `SpectrumRecord`."""
        peak = float(np.max(np.abs(self.x)))  # a motion without bound has squares beyond all numbers
        return peak * float(np.sqrt(np.mean((self.x / peak) ** 2))) if peak else 0.0

    def amplitudes(self, window: Window) -> Complexes:
        """See `SpectrumRecord`; up to half the rate."""
        return window.amplitudes(self.x)

    def normal_equations(self, frequency_hz: Floats, window: Window) -> tuple[Floats, Floats]:
        """See `SpectrumRecord`."""
        weight = window.values(np.arange(self.x.size) / self.x.size)
        matrix, right = _sums(self.time - self.time[0], self.x, frequency_hz, weight)
        total = float(np.sum(weight))
        return matrix / total, right / total

    def residual(self, frequency_hz: Floats) -> float:
        """See `SpectrumRecord`."""
        mean, c = self.project(frequency_hz)
        fit = mean + (np.exp(2j * np.pi * np.outer(self.time, frequency_hz)) @ c).imag
        return float(np.sqrt(np.mean((self.x - fit) ** 2)))

    def halves(self) -> tuple[SampledRecord, SampledRecord]:
        """See `SpectrumRecord`; half of the samples each."""
        half = self.x.size // 2
        early, late = slice(0, half), slice(half, None)
        return SampledRecord(self.time[early], self.x[early], self.rate), SampledRecord(
            self.time[late], self.x[late], self.rate
        )


class MotionRecord(SpectrumRecord):
    """One output of a motion in closed form; all sums are integrals.

    Parameters
    ----------
    part : outputs on the part that is analysed, of which this is number ``column``.
    highest_hz : end of the spectrum.
    size : number of samples that would cover it.
    """

    def __init__(self, part: MotionPart, column: int, highest_hz: float, size: int) -> None:
        self.part, self.column, self.highest_hz, self.size = part, column, highest_hz, size
        self.start, self.duration = part.begin, part.duration

    def levels(self) -> Levels:
        """See `SpectrumRecord`."""
        part, column = self.part, self.column
        low, high, mean = part.extrema.low[column], part.extrema.high[column], part.means[column]
        return Levels(float(max(-low, high)), float(max(mean - low, high - mean)), self.rms())

    def rms(self) -> float:
        """See `SpectrumRecord`."""
        return float(np.sqrt(max(self.part.mean_squares[self.column], 0.0)))

    def deviations_of_quarters(self) -> tuple[float, float]:
        """Standard deviations in the first and the last quarter of the time."""
        first, last = self.part.quarter_deviations
        return float(first[self.column]), float(last[self.column])

    def amplitudes(self, window: Window) -> Complexes:
        """See `SpectrumRecord`; up to the highest frequency."""
        count = int(self.highest_hz * self.duration * (1 + 1e-12)) + 1
        total = window.cosines[0] * self.duration
        seen = self.part.windowed_integrals(window.exponentials)[self.column, : 2 * count : 2]
        mean = float(seen[0].real) / total
        out = (seen - mean * self.duration * _transform_on_bins(window, count)) * (2.0 / total)
        out[0] = mean
        return np.asarray(out)

    def normal_equations(self, frequency_hz: Floats, window: Window) -> tuple[Floats, Floats]:
        """See `SpectrumRecord`."""
        omega = 2.0 * np.pi * np.asarray(frequency_hz, dtype=float)
        matrix, total = _normal_equations(window, omega.tobytes(), self.duration)
        moved = self.part.integrals(np.append(0.0, omega), self.column, window.exponentials)
        return matrix, np.concatenate([moved[:1].real, -moved[1:].imag, moved[1:].real]) / total

    def residual(self, frequency_hz: Floats) -> float:
        """See `SpectrumRecord`."""
        matrix, right = self.normal_equations(frequency_hz, RECTANGULAR)
        left = self.part.mean_squares[self.column] - _solve_normal_equations(matrix, right)[0] @ right
        return float(np.sqrt(max(left, 0.0)))

    def halves(self) -> tuple[MotionRecord, MotionRecord]:
        """See `SpectrumRecord`."""
        early, late = (MotionRecord(half, self.column, self.highest_hz, self.size // 2) for half in self.part.halves)
        return early, late


def sampled_records(
    time: Floats, samples: Floats, excitation_hz: float, last_s: float | None = None, periods: int | None = None
) -> list[SampledRecord]:  # fmt: skip
    """Records of the last part of sampled signals, for spectra.

    Samples are taken as they are: content beyond half the sample rate is aliased, and shows as lines of the kind
    "other".

    Parameters
    ----------
    time : (n,) s, equally spaced.
    samples : (K, n) the signals, in their units.
    excitation_hz : Hz, nan where there is no single excitation frequency.
    last_s, periods : length of the part, see `analysed_duration`.

    Raises
    ------
    ValueError
        When the records are empty or of another length than the time.
    """
    time, samples = np.asarray(time, dtype=float), np.asarray(samples, dtype=float)
    if samples.ndim != 2 or time.shape != samples.shape[1:] or not time.size:
        raise ValueError(f"a spectrum needs a time history, got shapes {time.shape} and {samples.shape}")
    rate = float((time.size - 1) / (time[-1] - time[0])) if time.size > 1 else 1.0
    length = _samples_analysed(time.size, rate, excitation_hz, last_s, periods)
    return [SampledRecord(time[-length:], x[-length:], rate) for x in samples]


def _samples_analysed(
    available: int, rate: float, excitation_hz: float, last_s: float | None, periods: int | None
) -> int:  # fmt: skip
    duration = analysed_duration(available / rate, excitation_hz, last_s, periods)
    length = min(max(round(rate * duration), 1), available)
    forced = np.isfinite(excitation_hz) and excitation_hz > 0
    if length < available or last_s is not None or not forced or available == 1:
        return length
    # A record sampled at both of its ends holds one sample more than its periods do.
    in_periods = excitation_hz / rate
    return min((available - 1, available), key=lambda n: abs(n * in_periods - round(n * in_periods)))


def analysed_duration(available: float, excitation_hz: float, last_s: float | None, periods: int | None) -> float:
    """Length, s, of the part at the end of a motion that is analysed.

    Parameters
    ----------
    available : s, length of the whole.
    excitation_hz : Hz, nan where there is no single excitation frequency.
    last_s : s, requested length; by default the whole.
    periods : requested length in periods of the excitation, in place of ``last_s``.
    """
    if last_s is not None:
        return min(last_s, available)
    if periods is not None and np.isfinite(excitation_hz) and excitation_hz > 0:
        whole = min(periods, int(available * excitation_hz * (1 + 1e-12)))
        if whole >= 1:
            return min(available, whole / excitation_hz)
    return available


def amplitude_db(amplitude: Floats, peak: float) -> Floats:
    """``20 log10(amplitude / peak)``, dB; `FLOOR_DB` where the amplitude (or the whole signal) is zero."""
    ratio = np.asarray(amplitude, dtype=float) / peak if peak > 0 else np.zeros_like(amplitude, dtype=float)
    level: Floats = 20.0 * np.log10(np.maximum(ratio, 10.0 ** (FLOOR_DB / 20.0)))
    return level


def refine_frequencies(record: SpectrumRecord, frequency_hz: Floats, is_free: Bools, window: Window) -> Floats:
    r"""Frequencies of lines that fit a record best, together with a mean and a slope.

    The maximum of a curve is not the frequency of a line: the lines near it, its own image at the negative frequency,
    a drift, and in one half of a window the jump at the beginning shift it. A fit of all lines together is exact for a
    sum of sinusoids and a slope, however few periods there are. It is found from the maxima by the Gauss-Newton method:
    with the derivative of each sinusoid by its frequency among the functions of the fit, the factor of this derivative
    is the correction. Small steps follow Newton's method, with what the fit leaves times the second derivatives of the
    sinusoids; where a record is no sum of sinusoids, the others would converge slowly. In one half of a window, which
    is for what decays, the amplitude of each line may also change linearly in time; a pure change of the amplitude is
    no change of the frequency.

    Parameters
    ----------
    record : with the lines.
    frequency_hz : (k,) Hz, of all its lines.
    is_free : (k,) whether a frequency is fitted; the others are known.
    window : weight of the fit.

    Returns
    -------
    (k,) Hz; unchanged where the fit would move a line far from its maximum or onto another line.
    """
    start, fixed = np.asarray(frequency_hz, dtype=float), ~np.asarray(is_free, dtype=bool)
    reach = (1.5 if window.one_sided else 0.5) / record.duration  # lines that decay are broad, and their maxima shifted
    while not fixed.all():
        place, step = start.copy(), np.full(start.size, np.inf)
        for _ in range(_MOST_STEPS):
            near = float(np.abs(step).max()) * record.duration < _NEAR
            step = _correction(record, place, np.flatnonzero(~fixed), window, near) / record.duration
            place[~fixed] += step
            between = np.abs(np.subtract.outer(place, place)) + np.diag(np.full(place.size, np.inf))
            astray = ~(np.abs(place - start) <= reach) | (between < _NEAREST / record.duration).any(axis=0)
            if astray.any() or float(np.abs(step).max()) * record.duration < _AT_REST:
                break
        else:
            astray = np.ones_like(fixed)
        if not (astray & ~fixed).any():
            return place
        fixed |= astray
    return start


def _correction(
    record: SpectrumRecord, frequency_hz: Floats, free_lines: Ints, window: Window, near: bool
) -> Floats:  # fmt: skip
    """Changes of the frequencies of the free lines, times the duration, see `refine_frequencies`."""
    k, n, turn = frequency_hz.size, free_lines.size, 2.0 * np.pi * _DIFFERENCE
    shift, lines = _DIFFERENCE / record.duration, frequency_hz[free_lines]
    # a sine of nearly no frequency is a slope
    plain = np.concatenate([[shift], frequency_hz, lines + shift, lines - shift])
    matrix, right = record.normal_equations(plain, window)
    sines, cosines = np.split(np.arange(1, right.size), 2)  # places of these functions
    fitted = np.concatenate([[0], sines[: 1 + k], cosines[1 : 1 + k]])
    ahead, behind = np.hstack([sines[1 + k :].reshape(2, n), cosines[1 + k :].reshape(2, n)])
    of_fitted = matrix[fitted]
    fit = _solve_normal_equations(of_fitted[:, fitted], right[fitted])[0]
    left = right - fit @ of_fitted  # products of all functions with the residual
    sine, cosine = fit[2 : 2 + k][free_lines], fit[2 + k :][free_lines]
    by_frequency = np.hstack([np.diag(sine), np.diag(cosine)])
    if window.one_sided:  # the sinusoids times the time
        by_frequency = np.vstack([by_frequency, np.hstack([np.diag(cosine), -np.diag(sine)])])
    slopes = (matrix[ahead] - matrix[behind]) / (2.0 * turn)
    left_of_slopes = (left[ahead] - left[behind]) / (2.0 * turn)
    mixed = by_frequency @ slopes[:, fitted]
    pure = by_frequency @ ((slopes[:, ahead] - slopes[:, behind]) / (2.0 * turn)) @ by_frequency.T
    wanted = np.append(np.zeros(fitted.size), by_frequency @ left_of_slopes)
    normal = np.block([[of_fitted[:, fitted], mixed.T], [mixed, pure]])
    if near and not window.one_sided:
        bent = (sine * (left[ahead] + left[behind])[:n] + cosine * (left[ahead] + left[behind])[n:]) / turn**2
        newton, regular = _solve_normal_equations(
            _with_second_derivatives(normal, bent, left_of_slopes, free_lines), wanted
        )
        if regular:
            return newton[-n:] / (2.0 * np.pi)
    change = _solve_normal_equations(normal, wanted)[0]
    c = (fit + change[: fit.size])[2:]
    c = c[:k][free_lines] + 1j * c[k:][free_lines]
    turning, swelling = change[fit.size : fit.size + n], change[fit.size + n :] if window.one_sided else 0.0
    by_time = (sine + 1j * cosine) * (1j * turning - swelling)
    size = np.maximum(np.abs(c) ** 2, np.finfo(float).tiny)
    return np.asarray((np.conj(c) * by_time).imag / size / (2.0 * np.pi))


def _with_second_derivatives(
    normal: Floats, curvature_products: Floats, slope_products: Floats, free_lines: Ints
) -> Floats:
    """Normal equations with the curvature terms of Newton's method: the residual times the sinusoids' second
    derivatives.

    Parameters
    ----------
    normal : of a mean, a slope, sines and cosines of k lines, and of changes of n frequencies.
    curvature_products : (n,) products of the residual with the second derivatives by the frequency.
    slope_products : (2 n,) products of the residual with the derivatives by frequency and amplitude of sine and cosine.
    free_lines : (n,) indices of the lines whose frequencies change.
    """
    n, curved = free_lines.size, normal.copy()
    changes = np.arange(normal.shape[0] - n, normal.shape[0])
    lines = (normal.shape[0] - n - 2) // 2
    curved[changes, changes] -= curvature_products
    for of_amplitude, left in ((2 + free_lines, slope_products[:n]), (2 + lines + free_lines, slope_products[n:])):
        curved[changes, of_amplitude] -= left
        curved[of_amplitude, changes] -= left
    return curved


def _solve_normal_equations(matrix: Floats, right: Floats) -> tuple[Floats, bool]:
    """Solution of normal equations, and whether they are positive definite and far from singular.

    It is that of least norm where they are not, as where two lines have one frequency.
    """
    size = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    factor, failed = dpotrf(matrix / np.multiply.outer(size, size), lower=1)
    if failed or float(np.diag(factor).min()) < _DEPENDENT:
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0]), False
    return np.asarray(dpotrs(factor, right / size, lower=1)[0] / size), True


def _complex(fit: Floats, frequency_hz: Floats, start: float) -> Complexes:
    """(k,) complex amplitudes in the run's own time from factors (2 k,) of sines and cosines since the start, s."""
    sines, cosines = np.split(fit, 2)
    return np.asarray((sines + 1j * cosines) * np.exp(-2j * np.pi * np.asarray(frequency_hz) * start))


def parabola_top(logarithms: Floats) -> float:
    """Offset of the top of a parabola through three logarithms of equally spaced amplitudes, in their spacing."""
    a, b, c = np.log(np.maximum(logarithms, np.finfo(float).tiny))
    curvature = a - 2 * b + c
    return float(0.5 * (a - c) / curvature) if curvature < 0 else 0.0


@lru_cache(maxsize=4)
def _transform_on_bins(window: Window, count: int) -> Complexes:
    """(count,) transform of a window of length one at multiples of 2 pi, shared by records of one length."""
    return window.transform(2.0 * np.pi * np.arange(count, dtype=np.float64), 1.0)


@lru_cache(maxsize=4)
def _normal_equations(window: Window, omega_bytes: bytes, duration: float) -> tuple[Floats, float]:
    """Normal matrix of a mean and sinusoids of angular frequencies (k,) under a window, over its integral, and that
    integral.

    Cached: records of one part of a motion share it if they have the same lines.
    """
    omega = np.frombuffer(omega_bytes)
    total, k = window.cosines[0] * duration, omega.size
    pairs = np.concatenate([np.subtract.outer(omega, omega), np.add.outer(omega, omega), omega[None]])
    across, along, alone = np.split(window.transform(pairs, duration), [k, 2 * k])
    alone = alone[0]
    gram, sines, cosines = np.empty((2 * k + 1, 2 * k + 1)), slice(1, k + 1), slice(k + 1, None)
    gram[0, 0], gram[0, sines], gram[0, cosines] = total, -alone.imag, alone.real
    gram[1:, 0] = gram[0, 1:]
    gram[sines, sines], gram[sines, cosines] = 0.5 * (across - along).real, -0.5 * (along + across).imag
    gram[cosines, sines], gram[cosines, cosines] = -0.5 * (along - across).imag, 0.5 * (across + along).real
    gram /= total
    return gram, total


def project(time: Floats, x: Floats, frequency_hz: Floats, weight: Floats | None = None) -> tuple[float, Complexes]:
    r"""Least-squares projection on a mean and sinusoids of known frequencies, without leakage.

    Minimises :math:`\sum w (x - m - \sum_k \mathrm{Im}\, c_k e^{2 \pi i f_k t})^2`, so that
    :math:`c_k = A_k e^{i \varphi_k}` stands for :math:`A_k \sin(2 \pi f_k t + \varphi_k)`.

    Parameters
    ----------
    time, x : (n,) s, any unit.
    frequency_hz : (k,) distinct, above zero, below half the sample rate.
    weight : (n,) 1 by default.

    Returns
    -------
    mean, c : the mean and (k,) complex amplitudes in the unit of x.
    """
    frequency = np.asarray(frequency_hz, dtype=float)
    fit = _solve_normal_equations(*_sums(time - time[0], x, frequency, weight))[0]
    return float(fit[0]), _complex(fit[1:], frequency, float(time[0]))


def _sums(time: Floats, x: Floats, frequency_hz: Floats, weight: Floats | None = None) -> tuple[Floats, Floats]:
    """Normal equations of 1, sines and cosines at times from zero (n,), s, as weighted sums over samples (n,)."""
    size = 1 + 2 * np.size(frequency_hz)
    matrix, right = np.zeros((size, size)), np.zeros(size)
    block = max(1, 4_000_000 // size)  # bounds the memory of a long record
    for first in range(0, x.size, block):
        angle = 2.0 * np.pi * time[first : first + block, None] * frequency_hz
        basis = np.concatenate([np.ones((angle.shape[0], 1)), np.sin(angle), np.cos(angle)], axis=1)
        weighted = basis if weight is None else basis * weight[first : first + block, None]
        matrix += weighted.T @ basis
        right += weighted.T @ x[first : first + block]
    return matrix, right


@dataclass(frozen=True)
class Remainder:
    """Residual of a record's curve near each of k fitted lines.

    Parameters
    ----------
    window : two-sided.
    bins : (k, 2 * LOBE + 1) multiples of one over the duration around each line.
    is_known : (k, 2 * LOBE + 1) whether the curve is known there, free of the mean.
    residual : (k, 2 * LOBE + 1) complex amplitudes without the fitted lines; zero where unknown.
    lobes : (k, 2 * LOBE + 1, k) complex amplitudes of each single line, near each line.
    size : (k,) largest magnitude of the residual near each line.
    """

    window: Window
    bins: Ints
    is_known: Bools
    residual: Complexes
    lobes: Complexes
    size: Floats

    @classmethod
    def of(
        cls, record: SpectrumRecord, frequency_hz: Floats, amplitude: Complexes, window: Window, curve: Complexes,
        near_hz: Floats | None = None,
    ) -> Remainder:  # fmt: skip
        """The residual near lines that were fitted together.

        Parameters
        ----------
        record : with the lines.
        frequency_hz, amplitude : (k,) Hz, and amplitudes with their phases in the run's own time.
        window : under which they were fitted.
        curve : (F,) complex amplitudes of the record under the window, see `SpectrumRecord.amplitudes`.
        near_hz : lines near which it is computed; all by default.

        Returns
        -------
        Remainder
        """
        place, near = frequency_hz * record.duration, frequency_hz if near_hz is None else near_hz
        bins = np.rint(near * record.duration).astype(np.int64)[:, None] + np.arange(-LOBE, LOBE + 1)
        inside = (bins >= LOBE) & (bins < curve.size)
        since_start = amplitude * np.exp(2j * np.pi * frequency_hz * record.start)
        ahead, behind = (_lobe(window, bins[:, :, None] + to) for to in (-place, place))
        of_lines = (ahead * since_start - behind * since_start.conj()) / 1j
        left = np.where(inside, curve[np.where(inside, bins, 0)] - of_lines.sum(axis=2), 0.0)
        return cls(window, bins, inside, left, of_lines, np.abs(left).max(axis=1, initial=0.0))

    def best_pairs(self, lines: Sequence[Sequence[int]], first_bins: Sequence[float]) -> tuple[Floats, Floats]:
        """For each of several lines, the two frequencies that fit the curve near it best.

        Parameters
        ----------
        lines : (P,) the number of the line, and those of lines that the pair replaces, too.
        first_bins : (P,) bins; frequency of the first of the pair, nan if it is searched too.

        Returns
        -------
        pairs, ratios : (P, 2) frequencies in bins, and (P,) what they leave over what the lines leave, root mean
            squares.
        """
        line = np.array([numbers[0] for numbers in lines], dtype=np.int64)
        inside, middle = self.is_known[line], self.bins[line, LOBE]
        replaced = [self.lobes[numbers[0]][:, list(numbers)].sum(axis=1) for numbers in lines]
        curve = np.where(inside, self.residual[line] + np.reshape(replaced, inside.shape), 0.0)
        bins, offset = np.arange(-LOBE, LOBE + 1) * _PLACES_PER_BIN, np.arange(-_REACH, _REACH + 1, _STEP)
        lobe, least = _tabulated_lobe(self.window), _NEAREST * _PLACES_PER_BIN
        own, given = np.arange(line.size), np.flatnonzero(~np.isnan(first_bins))
        of_known = (np.asarray(first_bins)[given] - middle[given]) * _PLACES_PER_BIN  # places from the middle
        lobe_of_known = _lobe(self.window, (bins - of_known[:, None]) / _PLACES_PER_BIN)
        best, error = np.zeros((line.size, 2)), np.zeros(line.size)
        for step in _STEP // 4 ** np.arange(_FINER + 1):
            firsts, seconds = (np.rint(of)[:, None].astype(np.int64) + offset for of in best.T)
            one, two = (lobe[_FARTHEST + bins - each[:, :, None]] for each in (firsts, seconds))
            places = firsts.astype(float)
            one[given], places[given] = lobe_of_known[:, None], of_known[:, None]
            remaining = _remaining(curve, one * inside[:, None], two * inside[:, None])
            remaining[np.abs(places[:, :, None] - seconds[:, None]) < least] = np.inf
            first, second = np.unravel_index(remaining.reshape(line.size, -1).argmin(axis=1), remaining.shape[1:])
            best = np.stack([firsts[own, first], seconds[own, second]], axis=1).astype(float)
            error, offset = remaining[own, first, second], np.arange(-step, step + 1, step // 4 or 1)
            best[given, 0] = 0.0
        best[given, 0] = of_known
        ratios = np.sqrt(np.maximum(error, 0.0)) / np.linalg.norm(self.residual[line], axis=1)
        return middle[:, None] + best / _PLACES_PER_BIN, ratios


# of a line of a pair from a point of the curve that it is to explain, in the last steps
_FARTHEST = LOBE * _PLACES_PER_BIN + _REACH + 2 * _STEP


@lru_cache(maxsize=2)
def _tabulated_lobe(window: Window) -> Complexes:
    """The lobe of a window at all distances that the search for a pair meets."""
    return _lobe(window, np.arange(-_FARTHEST, _FARTHEST + 1) / _PLACES_PER_BIN)


def _remaining(curve: Complexes, first: Complexes, second: Complexes) -> Floats:
    """(P, n, m) squared residual norms of curves (P, b) after a fit of pairs of shapes (P, n, b) and (P, m, b)."""
    first, second = (x / np.linalg.norm(x, axis=2)[:, :, None] for x in (first, second))
    shared = first.conj() @ second.transpose(0, 2, 1)
    on_first, on_second = ((x.conj() @ curve[:, :, None]) for x in (first, second))
    beyond = on_second.transpose(0, 2, 1) - shared.conj() * on_first  # of the second across the first
    size = np.maximum(1.0 - np.abs(shared) ** 2, np.finfo(float).tiny)
    whole = np.linalg.norm(curve, axis=1)[:, None, None] ** 2
    return np.asarray(whole - np.abs(on_first) ** 2 - np.abs(beyond) ** 2 / size)


def _lobe(window: Window, bins: Floats) -> Complexes:
    """Transform of a window at frequencies in bins, any shape, over that at zero."""
    omega = 2.0 * np.pi * np.asarray(bins, dtype=float)
    return np.asarray(window.transform(omega, 1.0) / window.cosines[0])
