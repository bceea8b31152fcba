"""Noise of a record, from the record alone."""

from __future__ import annotations

import numpy as np

from beamsim.typing import Floats

FEWEST_VALUES = 7  # of a sixth difference


def white_noise(values: Floats) -> float:
    """Standard deviation of white noise in samples of a smooth function at equal steps.

    It follows from the median of the squared sixth differences, whose mean is 924 times the variance of the noise, and
    whose median is 0.4549 of that if it is normally distributed.

    Parameters
    ----------
    values : (n,), at least `FEWEST_VALUES`.

    Returns
    -------
    float

    >>> noise = np.random.default_rng(1).normal(0.0, 0.01, 2000)
    >>> print(f"{white_noise(np.sin(np.arange(2000) / 30) + noise):.2g}")
    0.01
    """
    return float(np.sqrt(np.median(np.diff(values, 6) ** 2) / (0.4549 * 924)))
