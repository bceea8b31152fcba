"""Intervals of figures of a random input, from sums over equal blocks of the run without its first part.

The interval of each figure is the jackknife's over the blocks (B. Efron, The Jackknife, SIAM 1982, ch. 3), with
Student's t. It assumes a stationary motion whose blocks are long against its memory.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from beamsim.fields import dataset, declared
from beamsim.typing import Floats

SKIPPED = 0.1  # share of a run that is left out at its beginning
CONFIDENCE = 0.95
BLOCKS = 20
LEAST = 40  # impacts, or slides, in these for an interval

Sums = Mapping[str, Floats]  # (BLOCKS,) by name


@declared
class FigureInterval:
    """One figure of a random input with its interval."""

    figure: str = dataset("1", "name of the figure")
    value: float = dataset("", "its value without the first part of the run, in its SI unit")
    low: float = dataset("", "lower end of the interval, 95 %")
    high: float = dataset("", "upper end of the interval, 95 %")


def jackknife(blocks: Sums, figures: Mapping[str, Callable[[Sums], Floats]]) -> tuple[FigureInterval, ...]:
    """Intervals of figures, each a function of sums over blocks of time."""
    from scipy.special import stdtrit

    whole = {name: values.sum(keepdims=True) for name, values in blocks.items()}
    without = {name: whole[name] - values for name, values in blocks.items()}
    quantile = float(stdtrit(BLOCKS - 1, 0.5 * (1.0 + CONFIDENCE)))
    rows = []
    for figure, of in figures.items():
        value, left_out = float(of(whole)[0]), of(without)
        error = float(np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((left_out - left_out.mean()) ** 2)))
        rows.append(FigureInterval(figure, value, value - quantile * error, value + quantile * error))
    return tuple(rows)
