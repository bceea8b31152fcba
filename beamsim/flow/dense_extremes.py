"""Extremes of a time-stepped motion between its steps, on the integrator's dense output.

On a step an output is interpolated through Chebyshev points, ``p(theta) = sum_k c_k cos(k theta)`` with
``t = mid + half cos(theta)``. A polynomial of degree d sampled at ``cos(i pi / M)`` does not exceed
``max / cos(d pi / 2M)`` (H. Ehlich and K. Zeller, *Math. Z.* 86, 1964): steps whose bound lies below the
largest value so far are skipped; on the others Newton's method on ``p'(theta) = 0`` polishes the highest of a fine
grid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.typing import Floats

NODES = 16  # intervals of the Chebyshev points, above the degree of any integrator's dense output (12)
GRID = 128  # intervals of the fine grid
NEWTON = 5
STEPS = 256  # that are evaluated together
_DEGREE = 12.0
_ORDER = np.arange(NODES + 1)
_ANGLE = np.pi * np.arange(GRID + 1) / GRID
_FINE = np.cos(np.multiply.outer(_ANGLE, _ORDER))  # (GRID + 1, NODES + 1)


def _interpolation() -> Floats:
    """(NODES + 1, NODES + 1) from values at the Chebyshev points to coefficients."""
    halved = np.ones(NODES + 1)
    halved[[0, -1]] = 0.5
    matrix = 2.0 / NODES * np.cos(np.pi * np.multiply.outer(_ORDER, _ORDER) / NODES) * halved
    return np.asarray(matrix * halved[:, None])


_COEFFICIENTS = _interpolation()

Outputs = Callable[[Floats, Floats], dict[str, Floats]]


@dataclass
class Highest:
    """Largest values so far of some outputs."""

    value: Floats  # (k,)
    when: Floats  # (k,) s

    def add(self, values: Floats, start: Floats, length: Floats) -> None:
        """Outputs (S, NODES + 1, k) at the Chebyshev points of steps, latest first."""
        self._take(values.max(axis=1), start, length, np.pi * values.argmax(axis=1) / NODES)
        step, column = np.nonzero(_bound(values, NODES, axis=1) > self.value)
        if not step.size:
            return
        c = values[step, :, column] @ _COEFFICIENTS.T
        fine = c @ _FINE.T
        kept = _bound(fine, GRID, axis=1) > self.value[column]
        c, step, column, angle = c[kept], step[kept], column[kept], _ANGLE[fine[kept].argmax(axis=1)]
        low, high = angle - np.pi / GRID, angle + np.pi / GRID
        for _ in range(NEWTON):
            turned = np.multiply.outer(angle, _ORDER)
            slope = -(c * _ORDER * np.sin(turned)).sum(axis=1)
            bend = -(c * _ORDER**2 * np.cos(turned)).sum(axis=1)
            angle = np.clip(angle - np.divide(slope, bend, out=np.zeros_like(slope), where=bend < 0), low, high)
        top = (c * np.cos(np.multiply.outer(angle, _ORDER))).sum(axis=1)
        for j in np.unique(column):
            of_column = np.flatnonzero(column == j)
            best = of_column[top[of_column].argmax()]
            if top[best] > self.value[j]:
                self.value[j] = top[best]
                self.when[j] = _time(start[step[best]], length[step[best]], angle[best])

    def _take(self, top: Floats, start: Floats, length: Floats, angle: Floats) -> None:
        """Values (S, k) that are reached at angles of steps."""
        step, column = top.argmax(axis=0), np.arange(top.shape[1])
        better = top[step, column] > self.value
        self.value = np.where(better, top[step, column], self.value)
        self.when = np.where(better, _time(start[step], length[step], angle[step, column]), self.when)


def _bound(values: Floats, intervals: int, axis: int) -> Floats:
    """Upper bound of a polynomial with given values at Chebyshev points."""
    low, high = values.min(axis=axis), values.max(axis=axis)
    return np.asarray(0.5 * (high + low) + 0.5 * (high - low) / np.cos(0.5 * np.pi * _DEGREE / intervals))


def _time(start: Any, length: Any, angle: Any) -> Any:
    return start + 0.5 * length * (1.0 + np.cos(angle))


@dataclass
class DenseExtremes:
    """Lowest and highest values of groups of outputs over the steps added so far."""

    low: dict[str, Highest] = field(default_factory=dict)  # of the negative outputs
    high: dict[str, Highest] = field(default_factory=dict)

    def add(self, solution: Any, outputs: Outputs) -> None:
        """The steps of a solution of ``solve_ivp`` with dense output.

        ``outputs`` takes times (nt,) and states (nt, N) and returns values (nt, k) by group.
        """
        pieces = solution.sol.interpolants
        for first in range(0, len(pieces), STEPS):
            part = pieces[first : first + STEPS]
            start = solution.t[first : first + len(part)]
            length = np.diff(solution.t[first : first + len(part) + 1])
            times = _time(start[:, None], length[:, None], np.pi * _ORDER / NODES)
            y = np.concatenate([piece(row).T for piece, row in zip(part, times, strict=True)])
            for name, value in outputs(times.ravel(), y).items():
                shaped = value.reshape(start.size, NODES + 1, -1)
                for highest, sign in ((self.low, -1.0), (self.high, 1.0)):
                    if name not in highest:
                        highest[name] = Highest(np.full(shaped.shape[2], -np.inf), np.zeros(shaped.shape[2]))
                    highest[name].add(sign * shaped, start, length)

    def extremes(self) -> dict[str, tuple[Floats, Floats, Floats, Floats]]:
        """By group the lowest values (k,), their times, the highest values, their times."""
        return {
            name: (-low.value, low.when, self.high[name].value, self.high[name].when) for name, low in self.low.items()
        }
