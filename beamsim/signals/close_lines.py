r"""Lines of a spectrum that share one maximum: what a fit leaves near each line, and pairs of lines that explain it.

Near a line, the curve of a record under a window :math:`w` is the sum of the window's transforms at the frequencies of
all lines, if every line is steady. What is left there after the fitted lines are subtracted shows that there is more:
another line in the same lobe of the window, or an amplitude that changes during the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from beamsim.signals.records import SpectrumRecord, Window
from beamsim.typing import Bools, Complexes, Floats, Ints

LOBE = 4  # half-width of the Blackman-Harris main lobe, bins
_FINER = 3  # times that the search for a pair is repeated around the best one, with a quarter of the step
_STEP = 4**_FINER  # of the frequencies of a pair in the first search, in the last steps
_PLACES_PER_BIN = 4 * _STEP
_REACH = 4 * _PLACES_PER_BIN  # of the two lines of a pair from the maximum that they share, in the last steps
_NEAREST = 0.5  # of the two, bins


@dataclass(frozen=True)
class Remainder:
    """What k fitted lines leave of a record's curve near each of them.

    Parameters
    ----------
    window : two-sided.
    bins, inside : (k, 2 * LOBE + 1) multiples of one over the duration around each line, and whether the curve is known
        there, free of the mean.
    left : (k, 2 * LOBE + 1) complex amplitudes that the lines leave; zero elsewhere.
    of_lines : (k, 2 * LOBE + 1, k) those of each line alone, near each line.
    size : (k,) largest magnitude that is left near each line.
    """

    window: Window
    bins: Ints
    inside: Bools
    left: Complexes
    of_lines: Complexes
    size: Floats

    @classmethod
    def of(
        cls, record: SpectrumRecord, frequency_hz: Floats, amplitude: Complexes, window: Window, curve: Complexes
    ) -> Remainder:
        """Near lines that were fitted together.

        Parameters
        ----------
        record : with the lines.
        frequency_hz, amplitude : (k,) Hz, and amplitudes with their phases in the run's own time.
        window : under which they were fitted.
        curve : (F,) complex amplitudes of the record under the window, see `SpectrumRecord.amplitudes`.

        Returns
        -------
        Remainder
        """
        place = np.asarray(frequency_hz) * record.duration
        bins = np.rint(place).astype(np.int64)[:, None] + np.arange(-LOBE, LOBE + 1)
        inside = (bins >= LOBE) & (bins < curve.size)
        since_start = amplitude * np.exp(2j * np.pi * frequency_hz * record.start)
        distance = bins[:, :, None] - place, bins[:, :, None] + place
        ahead, behind = (_lobe(window, each) for each in distance)
        of_lines = (ahead * since_start - behind * since_start.conj()) / 1j
        left = np.where(inside, curve[np.where(inside, bins, 0)] - of_lines.sum(axis=2), 0.0)
        return cls(window, bins, inside, left, of_lines, np.abs(left).max(axis=1, initial=0.0))

    def best_pair(self, lines: Sequence[int], known: float | None) -> tuple[tuple[float, float], float]:
        """The two frequencies which explain best what lies near a line.

        Parameters
        ----------
        lines : its number, and those of lines that the pair replaces, too.
        known : bins; frequency that the first of the pair has, where it is known.

        Returns
        -------
        pair, ratio : frequencies in bins, and what they leave over what the lines leave, root mean squares.
        """
        line = lines[0]
        inside, middle = self.inside[line], int(self.bins[line, LOBE])
        bins = (self.bins[line, inside] - middle) * _PLACES_PER_BIN
        curve = (self.left[line] + self.of_lines[line][:, list(lines)].sum(axis=1))[inside]
        lobe, least = _tabulated_lobe(self.window), _NEAREST * _PLACES_PER_BIN
        known_place = None if known is None else np.array([(known - middle) * _PLACES_PER_BIN])
        known_lobe = (
            None if known_place is None else _lobe(self.window, (bins - known_place[:, None]) / _PLACES_PER_BIN)
        )
        low, high, step, width = 0.0, 0, _STEP, _REACH  # places of the two from the middle, in shares of a bin
        for _ in range(_FINER + 1):
            offset = np.arange(-width, width + 1, step)
            firsts = round(low) + offset if known_place is None else known_place
            seconds = high + offset
            two = lobe[_FARTHEST + bins - seconds[:, None]]
            one = lobe[_FARTHEST + bins - firsts[:, None]] if known_lobe is None else known_lobe
            remaining = _remaining(curve, one, two)
            remaining[np.abs(np.subtract.outer(firsts, seconds)) < least] = np.inf
            first, second = np.unravel_index(int(remaining.argmin()), remaining.shape)
            low, high = float(firsts[first]), int(seconds[second])
            step, width = step // 4, step
        error = np.sqrt(max(float(remaining[first, second]), 0.0))
        pair = middle + low / _PLACES_PER_BIN, middle + high / _PLACES_PER_BIN
        return pair, error / float(np.linalg.norm(self.left[line]))


# of a line of a pair from a point of the curve that it is to explain, in the last steps
_FARTHEST = LOBE * _PLACES_PER_BIN + _REACH + 2 * _STEP


@lru_cache(maxsize=2)
def _tabulated_lobe(window: Window) -> Complexes:
    """The lobe of a window at all distances that the search for a pair meets."""
    return _lobe(window, np.arange(-_FARTHEST, _FARTHEST + 1) / _PLACES_PER_BIN)


def _remaining(curve: Complexes, one: Complexes, two: Complexes) -> Floats:
    """(n, m) squared norms of what least squares with every pair of shapes (n, b) and (m, b) leaves of a curve (b,)."""
    first, second = (x / np.sqrt(np.einsum("nb,nb->n", x, x.conj()).real)[:, None] for x in (one, two))
    shared = first.conj() @ second.T
    on_first = first.conj() @ curve
    beyond = second.conj() @ curve - shared.conj() * on_first[:, None]  # of the second across the first
    size = np.maximum(1.0 - np.abs(shared) ** 2, np.finfo(float).tiny)
    return np.asarray(np.vdot(curve, curve).real - np.abs(on_first)[:, None] ** 2 - np.abs(beyond) ** 2 / size)


def _lobe(window: Window, bins: Floats) -> Complexes:
    """Transform of a window at frequencies in bins, any shape, over that at zero."""
    omega = 2.0 * np.pi * np.asarray(bins, dtype=float)
    return np.asarray(window.transform(omega, 1.0) / window.cosines[0])
