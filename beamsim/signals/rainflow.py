"""Rainflow count of a sequence of turning points, and damage by an S-N line.

Counted as in ASTM E1049-85 (2017), section 5.4.4, in one pass; the few lines are written here because the packages that
offer them take sampled signals and count half cycles in different ways.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from beamsim.typing import Floats

ROUND_OFF = 1e-11  # of the largest value, up to which a range is that of round-off


def reversals(values: Floats) -> Floats:
    """First and last value of a sequence, and those at which it turns.

    >>> reversals(np.array([0.0, 1.0, 2.0, 2.0, -1.0, 0.5])).tolist()
    [0.0, 2.0, -1.0, 0.5]
    """
    x = np.asarray(values, dtype=float)
    if x.size < 2:
        return x
    x = x[np.append(True, np.diff(x) != 0.0)]
    turns = np.diff(x[:-1]) * np.diff(x[1:]) < 0.0
    return np.asarray(x[np.concatenate([[True], turns, [True]])] if x.size > 1 else x)


def rainflow(values: Floats) -> Floats:
    """(n, 3) range, mean and count (1 or 0.5) of the cycles of a sequence of turning points.

    >>> rainflow(np.array([-2.0, 1, -3, 5, -1, 3, -4, 4, -2]))[:, [0, 2]].tolist()
    [[3.0, 0.5], [4.0, 0.5], [4.0, 1.0], [8.0, 0.5], [9.0, 0.5], [8.0, 0.5], [6.0, 0.5]]
    """
    cycles: list[tuple[float, float, float]] = []
    stack: list[float] = []
    for value in reversals(values).tolist():
        stack.append(value)
        while len(stack) >= 3:
            last, before = abs(stack[-1] - stack[-2]), abs(stack[-2] - stack[-3])
            if last < before:
                break
            mean = 0.5 * (stack[-2] + stack[-3])
            if len(stack) == 3:  # it holds the start of the history
                cycles.append((before, mean, 0.5))
                del stack[0]
            else:
                cycles.append((before, mean, 1.0))
                del stack[-3:-1]
    cycles += [(abs(b - a), 0.5 * (a + b), 0.5) for a, b in pairwise(stack)]
    return np.array(cycles).reshape(-1, 3)


def distinct_cycles(values: Floats) -> Floats:
    """Rainflow count (n, 3) without the cycles that round-off makes where parts of a motion join."""
    cycles = rainflow(values)
    return np.asarray(cycles[cycles[:, 0] > ROUND_OFF * np.abs(values).max(initial=0.0)])


def damage(cycles: Floats, stress_range: float, at_cycles: float, exponent: float, limit: float = 0.0) -> float:
    """Sum of n / N of counted cycles by Palmgren and Miner.

    The S-N line is ``N = at_cycles (stress_range / S)^exponent`` with the range S of a cycle.

    Parameters
    ----------
    cycles : (n, 3) range, mean and count of each.
    stress_range, at_cycles : a point of the line: a range in the unit of the cycles, and how many of these are failure.
    exponent : of the line.
    limit : range up to which cycles do no damage.

    Returns
    -------
    Share of the life that is used up; 1 is failure.
    """
    counted = cycles[cycles[:, 0] > limit]
    with np.errstate(over="ignore"):  # a stress range in the wrong unit
        return float(counted[:, 2] @ (counted[:, 0] / stress_range) ** exponent / at_cycles)


def equivalent_range(cycles: Floats, exponent: float, limit: float = 0.0) -> float:
    """The one range of which as many cycles as were counted do the same damage.

    Parameters
    ----------
    cycles : (n, 3) range, mean and count of each.
    exponent : of the S-N line.
    limit : range up to which cycles do no damage.

    Returns
    -------
    In the unit of the cycles; 0 where no cycle does damage.
    """
    span, count = cycles[:, 0], cycles[:, 2]
    largest, total = float(span.max(initial=0.0)), float(count.sum())
    if largest <= limit or total == 0.0:
        return 0.0
    harmful = np.where(span > limit, span / largest, 0.0)
    return float(largest * (count @ harmful**exponent / total) ** (1.0 / exponent))
