"""Peaks of a response over frequency with Q from their half-power bands, and pairs of peaks of two responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beamsim.typing import TINY, Bools, Floats

FASTEST = 0.3
"""Sweep rate times Q squared over the frequency squared, above which the half-power band is that of the sweep.

Of a linear resonance that is passed at a constant rate, in Hz/s, in either direction, the Q of the band is then 4.6 %
below that of the damping. The number is formed with the Q of the band: at any higher rate it is larger.
"""
LEAST_PROMINENCE = 1.3  # smallest ratio of a peak to its surroundings
MOST_PEAKS = 6  # of a response, the highest
SAME_PEAK = 0.15
"""Relative frequency difference up to which peaks of two responses can be the same resonance."""


class QualityPeak(NamedTuple):
    """A peak of a response."""

    frequency_hz: float
    level: float
    quality: float
    """Q; nan where the band is open, ends at the peak (the response jumps, or samples are too few) or contains another
    peak, and where the sweep was too fast for it."""
    too_fast: bool = False  # whether the rate of the sweep is why Q is not known
    prominence: float = float("nan")  # level over the higher of the lowest values that separate it from higher peaks


def peaks_of(
    frequency: Floats, amplitude: Floats, rate: Floats | None = None, *, most: int = MOST_PEAKS
) -> list[QualityPeak]:
    """The highest peaks of a response over increasing frequencies, by frequency.

    Frequency and level are those of the parabola through the three highest points.

    Parameters
    ----------
    frequency, amplitude : (n,) Hz, and of the response.
    rate : (n,) Hz/s, magnitude of the sweep rate there; None of steady responses.
    most : number of peaks, at most.

    Returns
    -------
    list of QualityPeak
        A sweep widens a resonance: Q is given where that is less than 5 % (see `FASTEST`).
    """
    from scipy import signal

    positive = np.maximum(amplitude, TINY + 1e-12 * float(np.max(amplitude, initial=0.0)))
    logarithm = np.log(positive)
    at, _ = signal.find_peaks(logarithm, prominence=np.log(LEAST_PROMINENCE))
    prominence = dict(zip(at.tolist(), np.exp(signal.peak_prominences(logarithm, at)[0]).tolist(), strict=True))
    highest = sorted(at, key=lambda k: -amplitude[k])[:most]
    peaks = []
    for k in sorted(int(k) for k in highest):
        f, level = _vertex(frequency[k - 1 : k + 2], amplitude[k - 1 : k + 2])
        below = _crossing(frequency, amplitude < level / np.sqrt(2), amplitude, level / np.sqrt(2), k, -1)
        above = _crossing(frequency, amplitude < level / np.sqrt(2), amplitude, level / np.sqrt(2), k, 1)
        alone = not np.any((at != k) & (frequency[at] > below) & (frequency[at] < above))
        quality = f / (above - below) if alone else np.nan
        too_fast = rate is not None and bool(rate[k] * quality**2 > FASTEST * f**2)
        peaks.append(QualityPeak(f, level, np.nan if too_fast else quality, too_fast, prominence[k]))
    return peaks


def pair_peaks(first: Sequence[float], second: Sequence[float], same: float = SAME_PEAK) -> dict[int, int]:
    """Pair the peaks of two responses by their frequencies: as many as possible, as close as possible, in their order.

    Of all pairings the one with the smallest sum of squared logarithms of frequency ratios is chosen, where a peak that
    has no partner counts half the square of the largest one.

    Parameters
    ----------
    first, second : Hz, increasing frequencies of the peaks.
    same : relative frequency difference up to which two peaks can be paired.

    Returns
    -------
    dict
        Index of the second peak by that of the first; peaks without partner are left out.

    >>> pair_peaks([50.0, 55.0, 90.0], [54.0, 59.4])
    {0: 0, 1: 1}
    """
    from scipy.optimize import linear_sum_assignment

    if not len(first) or not len(second):
        return {}
    distance = np.log(np.asarray(second) / np.asarray(first)[:, None]) ** 2
    gain = np.minimum(distance - np.log1p(same) ** 2, 0.0)  # over leaving both alone
    pairs = zip(*linear_sum_assignment(gain), strict=True)
    return {int(i): int(j) for i, j in pairs if gain[i, j] < 0.0}


def _vertex(x: Floats, y: Floats) -> tuple[float, float]:
    """Of the parabola through three points."""
    a, b, c = np.polyfit(x - x[1], y, 2)
    if not a < 0.0:
        return float(x[1]), float(y[1])
    shift = float(np.clip(-b / (2 * a), x[0] - x[1], x[2] - x[1]))
    return float(x[1] + shift), float(c + b * shift + a * shift**2)


def _crossing(frequency: Floats, lower: Bools, amplitude: Floats, half_power: float, peak: int, step: int) -> float:
    """Where the amplitude first falls below half the power on one side of a peak, interpolated; nan if nowhere."""
    side = np.flatnonzero(lower[peak:]) + peak if step > 0 else np.flatnonzero(lower[:peak])[::-1]
    if not side.size:
        return float("nan")
    k = int(side[0])
    if k == peak + step:
        return float("nan")
    share = (half_power - amplitude[k]) / (amplitude[k - step] - amplitude[k])
    return float(frequency[k] + share * (frequency[k - step] - frequency[k]))
