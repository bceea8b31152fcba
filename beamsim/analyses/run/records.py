r"""Records that a spectrum is made of: samples, or a motion in closed form.

Both are projected on sinusoids of known frequencies by least squares, with a window as weight. Of samples the sums are
taken as they are. Of a motion in closed form they are integrals: those of the sinusoids are transforms of the window,
those of the motion are Fourier integrals over the pieces between its events, so that nothing is folded and no sampling
rate enters. Windows are sums of cosines, whose transforms are known in closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

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
MOST_TERMS = 5_000_000  # segments x basis functions x frequencies, above which a projection takes the samples


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
        j = np.arange(self.cosines.size)
        shifts = self.turn(duration) * np.concatenate([-j[:0:-1], j])
        factor = 0.5 * np.concatenate([self.cosines[:0:-1], self.cosines])
        factor[j.size - 1] *= 2.0
        return np.asarray(factor @ integrals(np.add.outer(shifts, omega).ravel()).reshape(shifts.size, omega.size))

    def transform(self, omega: Floats, duration: float) -> Complexes:
        r"""(W,) :math:`\int_0^T w e^{-i\omega u} du`."""

        def rectangle(nu: Floats) -> Complexes:
            half = 0.5 * nu * duration
            return np.asarray(duration * np.exp(-1j * half) * np.sinc(half / np.pi))

        return self.weigh(rectangle, omega, duration)


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


@dataclass(frozen=True)
class SampledRecord:
    """Equally spaced samples."""

    time: Floats  # (N,) s
    x: Floats  # (N,) unit of the signal
    rate: float  # samples per second

    def project(self, frequency_hz: Floats, window: Window | None = None) -> tuple[float, Complexes]:
        """Mean and complex amplitudes of sinusoids, see `project`: by sums over the samples."""
        weight = None if window is None else window.values(np.arange(self.x.size) / self.x.size)
        return project(self.time, self.x, frequency_hz, weight)

    def halves(self) -> tuple[SampledRecord, SampledRecord]:
        """Half of the samples each."""
        half = self.x.size // 2
        early = replace(self, time=self.time[:half], x=self.x[:half])
        return early, replace(self, time=self.time[half:], x=self.x[half:])

    def band(self, lines: int) -> int:
        """How many of the lines from 0 to half the rate belong to the spectrum: all."""
        return lines

    def rms(self) -> float:
        """Root mean square of the samples, mean included."""
        size = float(np.abs(self.x).max(initial=0.0))  # a motion without bound has squares beyond all numbers
        return size * float(np.sqrt(np.mean((self.x / size) ** 2))) if size else 0.0


@dataclass(frozen=True)
class MotionRecord(SampledRecord):
    """One output of a motion in closed form, with samples for the curve, which divide its duration.

    Parameters
    ----------
    part : outputs on the part that is analysed, of which this is number ``column``.
    highest_hz : end of the spectrum.
    """

    part: MotionPart
    column: int
    highest_hz: float

    @property
    def duration(self) -> float:
        """Of the part, s."""
        return self.x.size / self.rate

    def project(self, frequency_hz: Floats, window: Window | None = None) -> tuple[float, Complexes]:
        """The same by integrals; by sums over the samples where a motion has very many pieces (a sampled input)."""
        window = window or RECTANGULAR
        frequencies = (2 * window.cosines.size - 1) * (1 + np.size(frequency_hz))
        if self.part.segments * self.part.table.shape[1] * frequencies > MOST_TERMS:
            return super().project(frequency_hz, window)
        omega = 2.0 * np.pi * np.asarray(frequency_hz, dtype=float)
        gram, total = _normal_equations(window, omega.tobytes(), self.duration)
        moved = window.weigh(lambda nu: self.part.integrals(nu, self.column), np.append(0.0, omega), self.duration)
        right = np.concatenate([moved[:1].real, -moved[1:].imag, moved[1:].real])
        fit = np.linalg.lstsq(gram, right / total, rcond=None)[0]  # of least norm where two lines have one frequency
        c = fit[1 : 1 + omega.size] + 1j * fit[1 + omega.size :]
        return float(fit[0]), c * np.exp(-1j * omega * self.time[0])

    def halves(self) -> tuple[MotionRecord, MotionRecord]:
        """Both halves of the duration."""
        (early, late), half = self.part.halves, self.x.size // 2
        return (
            replace(self, part=early, time=self.time[:half], x=self.x[:half]),
            replace(self, part=late, time=self.time[half:], x=self.x[half:]),
        )

    def band(self, lines: int) -> int:
        """Up to the highest frequency."""
        return min(lines, int(self.highest_hz * self.duration * (1 + 1e-12)) + 1)

    def rms(self) -> float:
        """In closed form, free motions that the samples leave out included."""
        return float(np.sqrt(max(self.part.mean_squares[self.column], 0.0)))


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
