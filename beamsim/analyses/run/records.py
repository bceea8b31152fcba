r"""Records that a spectrum is made of: samples, or a motion in closed form.

Both are projected on sinusoids of known frequencies by least squares, with a window as weight. Of samples the sums are
taken as they are. Of a motion in closed form they are integrals: those of the sinusoids are transforms of the window,
those of the motion are Fourier integrals over the pieces between its events. The curve of a spectrum consists of the
same integrals at multiples of one over the duration. Nothing is aliased, and no sampling rate enters. Windows are sums
of cosines, whose transforms are known in closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np

from beamsim.flow.channels import MotionPart
from beamsim.typing import Complexes, Floats

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
    """A sum of cosines on [0, T].

    Parameters
    ----------
    name : of a cosine sum, or ``decaying``.
    one_sided : the falling half of the window alone, largest at the beginning: what happens first counts.
    """

    name: str
    one_sided: bool = False

    @classmethod
    def named(cls, name: str) -> Window:
        """By the name in a scenario; ``decaying`` is the falling half of a Hann window."""
        return cls("hann", one_sided=True) if name == "decaying" else cls(name)

    @cached_property
    def cosines(self) -> Floats:
        """Factor of ``cos(j kappa u)``, j = 0, 1, ..."""
        a = np.array(_COSINE_SUMS[self.name])
        return a if self.one_sided else a * (-1.0) ** np.arange(a.size)

    def turn(self, duration: float) -> float:
        """kappa, rad/s."""
        return float((1.0 if self.one_sided else 2.0) * np.pi / duration)

    def values(self, share: Floats) -> Floats:
        """w at times given as shares of the duration."""
        angle = self.turn(1.0) * share
        return np.asarray(sum(c * np.cos(j * angle) for j, c in enumerate(self.cosines)))

    def amplitudes(self, x: Floats) -> Complexes:
        r"""(N // 2 + 1,) single-sided amplitudes of N samples, the weighted mean first; see `spectrum_of`."""
        window, total = _sampled(self, x.size)
        mean = float(window @ x) / total
        out = np.fft.rfft(window * (x - mean)) * (2.0 / total)
        if x.size % 2 == 0:
            out[-1] /= 2.0  # the line at half the rate is not doubled
        out[0] = mean
        return np.asarray(out)

    def weigh(self, integrals: Callable[[Floats], Complexes], omega: Floats, duration: float) -> Complexes:
        r"""Fourier integrals of a signal under the window, :math:`\int w x e^{-i\omega u} du`.

        Parameters
        ----------
        integrals : angular frequencies (F,), rad/s -> the same integrals (F,) without the window.
        omega : (W,) rad/s.
        duration : of the window, s.

        Returns
        -------
        (W,) in the unit of the signal times s.
        """
        shifts, factor = self._exponentials(duration)
        return np.asarray(factor @ integrals(np.add.outer(shifts, omega).ravel()).reshape(shifts.size, omega.size))

    def transform(self, omega: Floats, duration: float) -> Complexes:
        r"""(W,) :math:`\int_0^T w e^{-i\omega u} du`."""
        (shifts, factor), half = self._exponentials(duration), 0.5 * duration
        sincs = np.sinc(np.add.outer(shifts, omega) * (half / np.pi))
        return np.asarray(duration * np.exp(-1j * half * omega) * ((factor * np.exp(-1j * half * shifts)) @ sincs))

    def _exponentials(self, duration: float) -> tuple[Floats, Floats]:
        """Angular frequencies, rad/s, and factors, of the window as a sum of exponentials ``e^(-i shift u)``."""
        j = np.arange(self.cosines.size)
        shifts = self.turn(duration) * np.concatenate([-j[:0:-1], j])
        factor = 0.5 * np.concatenate([self.cosines[:0:-1], self.cosines])
        factor[j.size - 1] *= 2.0
        return shifts, factor


@lru_cache(maxsize=4)
def _sampled(window: Window, size: int) -> tuple[Floats, float]:
    """A window at equal steps, and the sum of its values; the records of one part of a motion share them."""
    values = window.values(np.arange(size) / size)
    if window.one_sided:
        values[0] *= 0.5  # the beginning is a jump
    total = float(np.sum(values))
    if total <= 0:  # a window of one or two samples may be nothing but its zero
        values, total = np.ones(size), float(size)
    values.flags.writeable = False
    return values, total


RECTANGULAR = Window("rectangular")


class SpectrumRecord(Protocol):
    """What a spectrum is made of."""

    @property
    def start(self) -> float:
        """When it begins, s."""

    @property
    def duration(self) -> float:
        """Its length, s; the curve of the spectrum is known at multiples of its inverse."""

    @property
    def size(self) -> int:
        """Number of samples, or of those that would cover the curve."""

    @property
    def highest_hz(self) -> float:
        """Frequency, Hz, up to which a sinusoid's amplitude and phase are known."""

    @property
    def peak(self) -> float:
        """Largest magnitude."""

    @property
    def deviation(self) -> float:
        """Largest deviation from the mean."""

    @property
    def rms(self) -> float:
        """Root mean square, mean included."""

    def amplitudes(self, window: Window) -> Floats:
        """(F,) single-sided amplitudes under a window, the weighted mean first; see `spectrum_of`."""

    def refined(self, frequency_hz: float, window: Window) -> float:
        """Frequency, Hz, of the maximum of the amplitude under a window, from that between the points of the curve."""

    def project(self, frequency_hz: Floats, window: Window | None = None) -> tuple[float, Complexes]:
        """Mean and complex amplitudes (k,) of sinusoids (k,) by least squares, see `project`."""

    def residual(self, frequency_hz: Floats) -> float:
        """Root mean square of what the projection on sinusoids (k,) leaves."""

    def halves(self) -> tuple[SpectrumRecord, SpectrumRecord]:
        """The first and the second half of the time."""


@dataclass(frozen=True)
class SampledRecord:
    """Equally spaced samples."""

    time: Floats  # (N,) s
    x: Floats  # (N,) unit of the signal
    rate: float  # samples per second

    @property
    def start(self) -> float:
        """See `SpectrumRecord`."""
        return float(self.time[0])

    @property
    def duration(self) -> float:
        """See `SpectrumRecord`."""
        return self.x.size / self.rate

    @property
    def size(self) -> int:
        """See `SpectrumRecord`."""
        return int(self.x.size)

    @property
    def highest_hz(self) -> float:
        """See `SpectrumRecord`; below half the rate, at which a sine and a cosine are one sinusoid."""
        return 0.49 * self.rate

    @property
    def peak(self) -> float:
        """See `SpectrumRecord`."""
        return float(np.max(np.abs(self.x)))

    @property
    def deviation(self) -> float:
        """See `SpectrumRecord`."""
        return float(np.max(np.abs(self.x - np.mean(self.x))))

    @property
    def rms(self) -> float:
        """See `SpectrumRecord`."""
        size = float(np.abs(self.x).max(initial=0.0))  # a motion without bound has squares beyond all numbers
        return size * float(np.sqrt(np.mean((self.x / size) ** 2))) if size else 0.0

    def amplitudes(self, window: Window) -> Floats:
        """See `SpectrumRecord`; up to half the rate."""
        return np.abs(window.amplitudes(self.x))

    def refined(self, frequency_hz: float, window: Window) -> float:
        """See `SpectrumRecord`; samples give no better one."""
        return frequency_hz

    def project(self, frequency_hz: Floats, window: Window | None = None) -> tuple[float, Complexes]:
        """See `SpectrumRecord`; by sums over the samples."""
        weight = None if window is None else window.values(np.arange(self.x.size) / self.x.size)
        return project(self.time, self.x, frequency_hz, weight)

    def residual(self, frequency_hz: Floats) -> float:
        """See `SpectrumRecord`."""
        mean, c = self.project(frequency_hz)
        fit = mean + (np.exp(2j * np.pi * np.outer(self.time, frequency_hz)) @ c).imag
        return float(np.sqrt(np.mean((self.x - fit) ** 2)))

    def halves(self) -> tuple[SampledRecord, SampledRecord]:
        """See `SpectrumRecord`; half of the samples each."""
        half = self.x.size // 2
        early = replace(self, time=self.time[:half], x=self.x[:half])
        return early, replace(self, time=self.time[half:], x=self.x[half:])


@dataclass(frozen=True)
class MotionRecord:
    """One output of a motion in closed form.

    Parameters
    ----------
    part : outputs on the part that is analysed, of which this is number ``column``.
    highest_hz : end of the spectrum.
    size : number of samples that would cover it.
    """

    part: MotionPart
    column: int
    highest_hz: float
    size: int

    @property
    def start(self) -> float:
        """See `SpectrumRecord`."""
        return self.part.begin

    @property
    def duration(self) -> float:
        """See `SpectrumRecord`."""
        return self.part.duration

    @property
    def peak(self) -> float:
        """See `SpectrumRecord`."""
        return float(max(-self.part.extrema.low[self.column], self.part.extrema.high[self.column]))

    @property
    def deviation(self) -> float:
        """See `SpectrumRecord`."""
        mean, found = self.part.means[self.column], self.part.extrema
        return float(max(mean - found.low[self.column], found.high[self.column] - mean))

    @property
    def rms(self) -> float:
        """See `SpectrumRecord`."""
        return float(np.sqrt(max(self.part.mean_squares[self.column], 0.0)))

    def deviations_of_quarters(self) -> tuple[float, float]:
        """Root mean squares of the first and the last quarter of the time, about the mean of all."""
        first, last = self.part.quarter_deviations
        return float(first[self.column]), float(last[self.column])

    def amplitudes(self, window: Window) -> Floats:
        """See `SpectrumRecord`; up to the highest frequency."""
        count = int(self.highest_hz * self.duration * (1 + 1e-12)) + 1
        omega = 2.0 * np.pi / self.duration * np.arange(count, dtype=np.float64)
        mean, amplitude = self._seen(window, omega)
        amplitude[0] = abs(mean)
        return amplitude

    def _seen(self, window: Window, omega: Floats) -> tuple[float, Floats]:
        """Weighted mean, and single-sided amplitudes (W,) of what is beside it, at angular frequencies (W,), rad/s."""
        total = float(window.transform(np.zeros(1), self.duration)[0].real)
        seen = window.weigh(lambda nu: self.part.integrals(nu, self.column), np.append(0.0, omega), self.duration)
        mean = float(seen[0].real) / total
        rest = seen[1:] - mean * window.transform(omega, self.duration)
        return mean, np.abs(rest) * (2.0 / total)

    def refined(self, frequency_hz: float, window: Window) -> float:
        """See `SpectrumRecord`; of the continuous motion."""
        place = frequency_hz * self.duration
        for width in (0.1, 0.01):  # of a parabola, over one over the duration
            around = place + width * np.array([-1.0, 0.0, 1.0])
            place += width * parabola_top(self._seen(window, 2.0 * np.pi / self.duration * around)[1])
        return place / self.duration

    def project(self, frequency_hz: Floats, window: Window | None = None) -> tuple[float, Complexes]:
        """See `SpectrumRecord`; by integrals."""
        omega, (fit, _) = 2.0 * np.pi * np.asarray(frequency_hz, dtype=float), self._fit(frequency_hz, window)
        c = fit[1 : 1 + omega.size] + 1j * fit[1 + omega.size :]
        return float(fit[0]), c * np.exp(-1j * omega * self.start)

    def _fit(self, frequency_hz: Floats, window: Window | None) -> tuple[Floats, Floats]:
        """(2 k + 1,) factors of 1, sines and cosines since the start of the record, and what they are fitted to."""
        window, omega = window or RECTANGULAR, 2.0 * np.pi * np.asarray(frequency_hz, dtype=float)
        gram, total = _normal_equations(window, omega.tobytes(), self.duration)
        moved = window.weigh(lambda nu: self.part.integrals(nu, self.column), np.append(0.0, omega), self.duration)
        right = np.concatenate([moved[:1].real, -moved[1:].imag, moved[1:].real]) / total
        return np.asarray(np.linalg.lstsq(gram, right, rcond=None)[0]), np.asarray(
            right
        )  # of least norm where two lines have one frequency

    def residual(self, frequency_hz: Floats) -> float:
        """See `SpectrumRecord`."""
        fit, right = self._fit(frequency_hz, None)
        return float(np.sqrt(max(self.part.mean_squares[self.column] - fit @ right, 0.0)))

    def halves(self) -> tuple[MotionRecord, MotionRecord]:
        """See `SpectrumRecord`."""
        early, late = self.part.halves
        return replace(self, part=early, size=self.size // 2), replace(self, part=late, size=self.size // 2)


def parabola_top(around: Floats) -> float:
    """Offset of the top of a parabola through three logarithms of equally spaced amplitudes, in their spacing."""
    a, b, c = np.log(np.maximum(around, np.finfo(float).tiny))
    curvature = a - 2 * b + c
    return float(0.5 * (a - c) / curvature) if curvature < 0 else 0.0


@lru_cache(maxsize=4)
def _normal_equations(window: Window, omega_bytes: bytes, duration: float) -> tuple[Floats, float]:
    """Those of a mean and sinusoids of angular frequencies (k,) under a window, over its integral, and that.

    Records of one part of a motion share them, as far as they have the same lines.
    """
    omega = np.frombuffer(omega_bytes)

    def transform(nu: Floats) -> Complexes:
        return window.transform(nu.ravel(), duration).reshape(nu.shape)

    across, along = transform(np.subtract.outer(omega, omega)), transform(np.add.outer(omega, omega))
    alone = transform(omega)
    total = float(transform(np.zeros(1))[0].real)
    gram = np.block(
        [
            [np.array([[total]]), -alone.imag[None], alone.real[None]],
            [-alone.imag[:, None], 0.5 * (across - along).real, -0.5 * (along + across).imag],
            [alone.real[:, None], -0.5 * (along - across).imag, 0.5 * (across + along).real],
        ]
    )
    return gram / total, total


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
    size = 1 + 2 * frequency.size
    gram = np.zeros((size, size))
    right = np.zeros(size)
    block = max(1, 4_000_000 // size)  # bounds the memory of a long record
    for first in range(0, x.size, block):
        angle = 2.0 * np.pi * (time[first : first + block, None] - time[0]) * frequency
        basis = np.concatenate([np.ones((angle.shape[0], 1)), np.sin(angle), np.cos(angle)], axis=1)
        weighted = basis if weight is None else basis * weight[first : first + block, None]
        gram += weighted.T @ basis
        right += weighted.T @ x[first : first + block]
    fit = np.linalg.lstsq(gram, right, rcond=None)[0]
    c = fit[1 : 1 + frequency.size] + 1j * fit[1 + frequency.size :]
    return float(fit[0]), c * np.exp(-2j * np.pi * frequency * time[0])
