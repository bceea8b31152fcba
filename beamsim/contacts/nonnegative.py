"""Least squares with non-negative unknowns (Lawson and Hanson, *Solving Least Squares Problems*, chapter 23)."""

from __future__ import annotations

import numpy as np

from beamsim.typing import Floats


def nonnegative_least_squares(a: Floats, b: Floats) -> Floats:
    """argmin ||a x - b|| over x >= 0, by the active-set method; inactive unknowns come out exactly zero.

    Each pass strictly lowers the residual, so no set of unknowns occurs twice and the method ends; the bound on the
    number of passes only guards against round-off.
    """
    rows, count = a.shape
    x = np.zeros(count)
    passive = np.zeros(count, dtype=bool)
    tolerance = (
        10 * np.finfo(float).eps * max(rows, count) * np.abs(a).sum(axis=0) * max(float(np.abs(b).max()), 1e-300)
    )
    for _ in range(10 * count + 10):
        gradient = a.T @ (b - a @ x)
        candidates = ~passive & (gradient > tolerance)
        if not candidates.any():
            break
        entering = int(np.argmax(np.where(candidates, gradient, -np.inf)))
        passive[entering] = True
        for _ in range(count + 1):
            trial = np.zeros(count)
            trial[passive] = np.linalg.lstsq(a[:, passive], b, rcond=None)[0]
            if trial[entering] <= 0 and x[entering] == 0:
                # Its gradient is round-off: it is excluded from now on.
                passive[entering] = False
                tolerance[entering] = np.inf
                trial = x
            blocked = passive & (trial <= 0)
            if not blocked.any():
                x = trial
                break
            step = np.min(x[blocked] / (x[blocked] - trial[blocked]))
            x = x + step * (trial - x)
            passive &= ~(blocked & (x <= 1e-15 * np.abs(x).max())) & (x > 0)
            x[~passive] = 0.0
    return x
