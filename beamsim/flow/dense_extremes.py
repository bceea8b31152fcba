"""Extremes of a time-stepped motion between its steps, on the integrator's dense output.

On a step an output is interpolated through Chebyshev points, ``sum_k c_k T_k(u)`` with ``t = mid + half u``. In powers
of u it is a sum of terms as those of closed-form motions, and the search of :mod:`beamsim.flow.extrema` takes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from beamsim.flow.extrema import Extrema, Search, Waves
from beamsim.flow.kernels import EPS
from beamsim.typing import Floats

NODES = 16  # degree of the polynomials, above that of any integrator's dense output (12)
STEPS = 256  # that are evaluated together
_POINTS = chebyshev.chebpts2(NODES + 1)
_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_POINTS, NODES))
_POWERS = np.array([np.pad(chebyshev.cheb2poly(row), (0, NODES - k)) for k, row in enumerate(np.eye(NODES + 1))])

Outputs = Callable[[Floats, Floats], Floats]


def polynomials(values: Floats, start: Floats, length: Floats) -> Waves:
    """Outputs on S steps, from their values (S, NODES + 1, k) at the Chebyshev points, the earliest first.

    Parameters
    ----------
    values : (S, NODES + 1, k) in the units of the outputs.
    start, length : (S,) of the steps, s.

    Returns
    -------
    Waves
        A piece a step.
    """
    steps = values.shape[0]
    coefficient = _COEFFICIENTS @ values
    round_off = NODES * EPS * np.abs(values).max(axis=1, keepdims=True)
    coefficient = np.where(np.abs(coefficient) > round_off, coefficient, 0.0)
    number, half = np.arange(NODES + 1), 0.5 * length
    table = (_POWERS.T @ coefficient) * half[:, None, None] ** -number[:, None]
    return Waves(
        np.zeros(NODES + 1, dtype=complex), number, number, np.zeros_like(number), table.astype(complex),
        lambda rows: (np.ones((rows.size, 1), dtype=complex), np.zeros((rows.size, 1))), start + half, half,
        -np.ones(steps), np.ones(steps),
        np.zeros(steps, dtype=np.int64),
    )  # fmt: skip


@dataclass
class DenseExtremes:
    """Lowest and highest values of outputs over the steps added so far."""

    search: Search | None = None

    def add(self, solution: Any, outputs: Outputs) -> None:
        """The steps of a solution of ``solve_ivp`` with dense output.

        ``outputs`` takes times (nt,) and states (nt, N) and returns values (nt, k).
        """
        pieces = solution.sol.interpolants
        for first in range(0, len(pieces), STEPS):
            part = pieces[first : first + STEPS]
            start = solution.t[first : first + len(part)]
            length = np.diff(solution.t[first : first + len(part) + 1])
            times = start[:, None] + 0.5 * length[:, None] * (1.0 + _POINTS)
            y = np.concatenate([piece(row).T for piece, row in zip(part, times, strict=True)])
            values = outputs(times.ravel(), y).reshape(start.size, NODES + 1, -1)
            self.search = self.search or Search.of(values.shape[2])
            self.search.add([polynomials(values, start, length)])

    def extrema(self) -> Extrema:
        """(k,) extreme values and their times; of no steps an error."""
        assert self.search is not None
        return self.search.extrema().window(0)
