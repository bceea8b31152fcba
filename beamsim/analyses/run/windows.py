"""Windows of the spectra: sums of cosines, whose transforms are known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

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
        out[0] = mean
        return np.asarray(out)

    def weigh(self, integrals: Callable[[Floats], Complexes], omega: Floats, duration: float) -> Complexes:
        r"""(W,) :math:`\int w x e^{-i\omega u} du` from ``integrals``, which gives the same without the window."""
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
