r"""How much of a motion lies above half the rate of its samples, which a spectrum of them shows at lower frequencies.

The acceleration of a motion with impacts jumps, so that no rate is high enough. What lies above half the rate shows
between the samples. A share :math:`s` of a step after a sample, content below half the rate is a weighted sum of the
samples around; content that :math:`m` times the rate has to be added to is turned by :math:`2 \pi m s`. Its difference
from the sum is :math:`2 |\sin \pi m s|` times its size, which the golden ratio as :math:`s` keeps away from zero. It is
divided by the value of :math:`m = 1`, since most of the content lies there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from beamsim.typing import Floats, Ints

NOTABLE = 1e-3  # share of the root mean square that is named: 60 dB, below which no line is listed
_NEIGHBOURS = 20  # samples on either side that the sum takes
_SHARPNESS = 7.0  # of its Kaiser window: -70 dB, and a transition of a tenth of the rate about half of it
BETWEEN = 0.5 * (3.0 - 5.0**0.5)  # place between two samples at which the motion is compared, of a step
_BLOCKS, _BLOCK = 16, 4096  # parts of a long record that are looked at, evenly spread, and samples in each


def between_samples(time: Floats) -> Floats:
    """(2 n - 1,) s, times of samples (n,), s, with those in between at which `share_above_half_rate` compares."""
    both = np.repeat(time, 2)[:-1]
    both[1::2] += BETWEEN * np.diff(time)
    return both


def share_above_half_rate(values: Floats, place: float = BETWEEN) -> Floats:
    """Root mean square of what lies above half the rate of samples, over the standard deviation.

    Parameters
    ----------
    values : (2 n - 1, k) samples, and the values between each two of them.
    place : of the latter, of a step.

    Returns
    -------
    (k,)
        Zero of what does not move, nan of fewer samples than the sum takes.
    """
    samples = values[::2]
    if samples.shape[0] <= 2 * _NEIGHBOURS:
        return np.full(values.shape[1], np.nan)
    variance = np.var(samples, axis=0)
    ratio = np.divide(_content(values, place), variance, out=np.zeros_like(variance), where=variance > 0.0)
    return np.asarray(np.sqrt(ratio))


def share_of_blocks(time: Floats, samples: Floats, columns: Ints, at: Callable[[Floats], Floats]) -> Floats:
    """Shares (k,) of signals that are known at any times, from blocks of their samples; no copy of all is made.

    Parameters
    ----------
    time : (n,) s, of the samples.
    samples : (n, c) with the signals in some columns (k,).
    columns : (k,).
    at : (k,) signals at times.
    """
    length = min(time.size, _BLOCK)
    if length <= 2 * _NEIGHBOURS:
        return np.full(columns.size, np.nan)
    content = []
    for first in np.linspace(0, time.size - length, min(_BLOCKS, time.size // length)).astype(int).tolist():
        values = np.empty((2 * length - 1, columns.size))
        values[::2] = samples[first : first + length, columns]
        at_samples = time[first : first + length]
        values[1::2] = at(at_samples[:-1] + BETWEEN * np.diff(at_samples))
        content.append(_content(values, BETWEEN))
    variance = np.array([np.var(samples[:, column]) for column in columns])
    ratio = np.divide(np.mean(content, axis=0), variance, out=np.zeros_like(variance), where=variance > 0.0)
    return np.asarray(np.sqrt(ratio))


def _content(values: Floats, place: float) -> Floats:
    """(k,) mean square of what lies above half the rate, from values (2 n - 1, k), see `share_above_half_rate`."""
    samples, between = values[::2], values[1::2]
    distance = np.arange(-_NEIGHBOURS, _NEIGHBOURS) + place
    inside = np.sqrt(np.maximum(1.0 - (distance / _NEIGHBOURS) ** 2, 0.0))
    weight = np.sinc(distance) * np.i0(_SHARPNESS * inside)
    weight /= weight.sum()
    expected = np.array([np.convolve(x, weight, "valid") for x in samples.T]).T
    first = _NEIGHBOURS - 1
    difference = between[first : first + expected.shape[0]] - expected
    return np.asarray(np.mean(difference**2, axis=0) / (2.0 * np.sin(np.pi * place)) ** 2)
