r"""Power spectral density of a random input: straight lines on logarithmic axes, with steps.

Between two points of the table the density is a power of the frequency, :math:`S(f) = S_1 (f/f_1)^s`, whose integral is

.. math:: \int_{a}^{b} S\, df = a\, S(a)\, \frac{(b/a)^{s+1} - 1}{s + 1},

and :math:`a\,S(a) \ln(b/a)` for s = -1. A record of period T is a sum of sines at the frequencies k / T, its lines.
Half the squared amplitude of each is the integral of the density over the line's share of the axis, from
:math:`(k - 1/2)/T` to :math:`(k + 1/2)/T`, so that the mean square of the record equals the area under the density for
any number of lines. A band or plateau with fewer than `FEWEST_LINES` lines is refused: such a record would not be
Gaussian noise with the given density.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from beamsim.errors import ScenarioError
from beamsim.inputs.measured import read_density
from beamsim.scenario.excitation import RandomInput
from beamsim.scenario.files import CurveFile
from beamsim.typing import Floats, Ints

FEWEST_LINES = 8  # lines in a band, plateau or peak
MEASURED_CURVE_POINTS = 20  # evenly spaced points, above which a table is taken for a measured curve
HALF_POWER = 0.5  # density relative to a peak, at the ends of the peak


@dataclass(frozen=True)
class SpectralDensity:
    """A one-sided power spectral density, zero outside its table.

    Parameters
    ----------
    frequency_hz : (p,) Hz, not decreasing; a step has two points at one frequency.
    value : (p,) positive, unit^2/Hz.
    """

    frequency_hz: Floats
    value: Floats

    @classmethod
    def from_points(cls, points: Sequence[tuple[float, float]]) -> SpectralDensity:
        """The density through points (frequency in Hz, density in unit^2/Hz)."""
        frequency, value = np.transpose(points)
        return cls(np.asarray(frequency, dtype=float), np.asarray(value, dtype=float))

    @property
    def lowest_hz(self) -> float:
        """Lowest frequency of the band, Hz."""
        return float(self.frequency_hz[0])

    @property
    def highest_hz(self) -> float:
        """Highest frequency of the band, Hz."""
        return float(self.frequency_hz[-1])

    def __call__(self, frequency_hz: Floats) -> Floats:
        """Density at frequencies (n,), Hz, in unit^2/Hz; at a step the value above it."""
        low, high = self.lowest_hz * (1 - 1e-12), self.highest_hz * (1 + 1e-12)
        inside = (frequency_hz >= low) & (frequency_hz <= high)
        out = np.zeros(frequency_hz.shape)
        f = np.clip(frequency_hz[inside], self.lowest_hz, self.highest_hz)
        k, slope = self._segments(f)
        out[inside] = self.value[k] * (f / self.frequency_hz[k]) ** slope
        return out

    def _segments(self, frequency_hz: Floats) -> tuple[Ints, Floats]:
        """(n,) index of the segment at each frequency within the band, and its exponent of the frequency."""
        last = int(np.flatnonzero(np.diff(self.frequency_hz))[-1])  # segment that is not a step
        k = np.clip(np.searchsorted(self.frequency_hz, frequency_hz, side="right") - 1, 0, last)
        ratio = np.log(self.value[k + 1] / self.value[k])
        return k, ratio / np.log(self.frequency_hz[k + 1] / self.frequency_hz[k])

    def mean_squares(self, edges_hz: Floats) -> Floats:
        """Mean square (n - 1,) between neighbouring frequencies (n,), Hz, increasing, in unit^2."""
        ends = np.unique(np.concatenate([edges_hz, self.frequency_hz]))
        low, high = ends[:-1], ends[1:]
        inside = (low >= self.lowest_hz) & (high <= self.highest_hz) & (low >= edges_hz[0]) & (high <= edges_hz[-1])
        low, high = low[inside], high[inside]
        k, slope = self._segments(np.sqrt(low * high))
        octaves, power = np.log(high / low), slope + 1.0
        # expm1(x) / x -> 1, which it is to round-off below 1e-16
        growth = np.where(
            np.abs(power * octaves) > 1e-16, np.expm1(power * octaves) / np.where(power, power, 1.0), octaves
        )
        parts = self.value[k] * (low / self.frequency_hz[k]) ** slope * low * growth
        of_edge = np.clip(np.searchsorted(edges_hz, low, side="right") - 1, 0, edges_hz.size - 2)
        return np.asarray(np.bincount(of_edge, parts, minlength=edges_hz.size - 1), dtype=float)

    @property
    def rms(self) -> float:
        """Root mean square: the square root of the area under the density."""
        return float(np.sqrt(self.mean_squares(self.frequency_hz[[0, -1]])[0]))

    def lines(self, period: float, count: int) -> Floats:
        """Amplitudes of the sines of a record.

        Parameters
        ----------
        period : period of the record, s.
        count : number of lines, including 0 and the highest one; the band ends below the highest.

        Returns
        -------
        (count,) array
            Amplitudes at the frequencies k / period. The density below half a spacing belongs to line 1.
        """
        first = max(int(np.floor(self.lowest_hz * period + 0.5)), 1)
        last = min(max(int(np.floor(self.highest_hz * period + 0.5)), first), count - 1)
        edges: Floats = (np.arange(first, last + 2, dtype=float) - 0.5) / period
        edges[0], edges[-1] = min(edges[0], self.lowest_hz), max(edges[-1], self.highest_hz)
        amplitude = np.zeros(count)
        amplitude[first : last + 1] = np.sqrt(2.0 * self.mean_squares(edges))
        return amplitude

    def features(self) -> Iterator[tuple[str, float, float]]:
        """Yield the features that a record must resolve: name, and lower and upper frequency in Hz.

        The features are the band; plateaus, where neighbouring points have equal densities; and peaks between lower
        points, down to half of their density. A table with many evenly spaced points, as from an analyser, has only the
        band.
        """
        f, value = self.frequency_hz, self.value
        yield "band", self.lowest_hz, self.highest_hz
        if f.size >= MEASURED_CURVE_POINTS and np.ptp(np.diff(f)) <= 0.01 * (f[-1] - f[0]) / (f.size - 1):
            return
        flat = np.isclose(value[1:], value[:-1], rtol=1e-9, atol=0.0) & (np.diff(f) > 0)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], flat, [False]]).astype(int)))
        for first, last in edges.reshape(-1, 2):
            yield "plateau", float(f[first]), float(f[last])
        for k in range(1, f.size - 1):
            if value[k - 1] < value[k] > value[k + 1]:
                ends = [self._half_power(k, step) for step in (-1, 1)]
                if all(ends):
                    yield "peak", ends[0], ends[1]

    def _half_power(self, peak: int, step: int) -> float:
        """Frequency, Hz, at which the density falls to half of a point's value; 0 if it rises before that."""
        k, level = peak, HALF_POWER * self.value[peak]
        while 0 <= k + step < self.value.size and self.value[k + step] <= self.value[k]:
            ahead = k + step
            if self.value[ahead] <= level:
                share = np.log(level / self.value[k]) / np.log(self.value[ahead] / self.value[k])
                return float(self.frequency_hz[k] * (self.frequency_hz[ahead] / self.frequency_hz[k]) ** share)
            k = ahead
        return 0.0

    def demand_resolved(self, period: float, key: str) -> None:
        """Refuse a record with too few lines in the band, a plateau or a peak.

        Parameters
        ----------
        period : period of the record, s.
        key : key that gives the period, for the message.

        Raises
        ------
        ScenarioError
            With the duration that would be enough.
        """
        few = []
        for what, low, high in self.features():
            lines = np.floor(high * period * (1 + 1e-9)) - np.ceil(low * period * (1 - 1e-9)) + 1
            if lines < FEWEST_LINES:
                few.append((FEWEST_LINES / (high - low), what, low, high, int(lines)))
        if few:
            enough, what, low, high, lines = max(few, key=lambda feature: feature[0])
            given = f"= {period:g} s gives the random input {lines or 'no'} line{'s' * (lines != 1)}"
            raise ScenarioError.at(
                key,
                f"{given} in the {what} of its density from {low:g} to {high:g} Hz (at least {FEWEST_LINES}): its "
                f"sines are {1.0 / period:.4g} Hz apart",
                f"{_round_up(enough):g} s or more suffices; excitation.period may be longer than the run",
            )


def _round_up(duration: float) -> float:
    """A duration rounded up to three digits."""
    scale = 10.0 ** (np.floor(np.log10(duration)) - 2)
    return float(np.ceil(duration / scale * (1 - 1e-12)) * scale)


def clipped_mean_square(sigmas: float | None) -> float:
    """Mean square of a Gaussian signal after clipping at a number of standard deviations, relative to that before.

    >>> clipped_mean_square(None), round(clipped_mean_square(3.0), 6)
    (1.0, 0.995007)
    """
    if sigmas is None:
        return 1.0
    inside = math.erf(sigmas / math.sqrt(2.0))
    within = inside - math.sqrt(2.0 / math.pi) * sigmas * math.exp(-0.5 * sigmas**2)
    return within + sigmas**2 * (1.0 - inside)


def density_of(excitation: RandomInput, folder: Path | None = None) -> SpectralDensity:
    """The density of a random input.

    Parameters
    ----------
    excitation : section of the scenario.
    folder : base folder of relative paths; by default the current one.

    Returns
    -------
    SpectralDensity
        In SI units.

    Raises
    ------
    ScenarioError
        If its file cannot be read, or has no density of the required quantity.
    """
    if isinstance(excitation.psd, CurveFile):
        return SpectralDensity(*read_density(excitation, excitation.psd, folder))
    return SpectralDensity.from_points(excitation.table)
