r"""Extremes of a motion: in closed form, or of polynomials on pieces of time.

On a segment of length H an output is a sum of terms :math:`\mathrm{Re}\, c\, u^p e^{\lambda H u}`, with the time u on
the segment over its length. An interval of length h is looked at by the values and slopes at its ends. The sizes of the
terms bound the fourth derivative, and so how far the output leaves the cubic through them:

.. math:: h^4 \max|f''''| / 384, \quad \text{and its slope that of the cubic:}\quad \sqrt 3\, h^3 \max|f''''| / 216

(Hermite interpolation; the kernels of its error by Peano). Terms that turn too far on the interval to be part of the
cubic are bounded by their sizes. Intervals on which no value can exceed the largest one known are left out, the others
divided: a whole segment at once into parts on which no term turns far, whose exponentials all outputs share; a part
about the top of its cubic where the true one is certain to be near it, else into equal parts. The smallest value is the
largest one of the negative.

Half the sum of the squares of outputs, such as an energy, is searched in the same way: the bounds on the outputs bound
it and its derivatives.

On a step an output is interpolated through Chebyshev points, ``sum_k c_k T_k(u)`` with ``t = mid + half u``. In powers
of u it is a sum of terms as those of closed-form motions, and the search of :mod:`beamsim.flow.extrema` takes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from beamsim.flow.contact_state import GROWTH
from beamsim.flow.extrema_kernels import Known, Sums, search
from beamsim.flow.kernels import EPS
from beamsim.outcomes import check_stop
from beamsim.typing import Floats, Ints

PARTS_AT_ONCE = 256  # of segments in a batch, which bounds the memory


class Extrema(NamedTuple):
    """Extreme values of K outputs in W windows and their times, s."""

    low: Floats  # (W, K)
    when_low: Floats
    high: Floats
    when_high: Floats
    evaluations: int  # of an output at one time


def search_extrema(
    batches: Iterable[Sums], outputs: int, windows: int = 1, squares: Ints | None = None, rivals: Ints | None = None
) -> Extrema:
    """The largest and smallest values of outputs in windows.

    They are values that are reached, and no other is beyond them by more than `TOLERANCE` of their size; of sums of
    squares of that of their largest value. Of rivals this holds of the largest magnitude of all.

    Parameters
    ----------
    batches : the outputs on all parts of a motion, in seconds.
    outputs : number of them.
    windows : number W.
    squares : (K,) first of each group of consecutive outputs, where half the sums of their squares are asked for.
    rivals : those of the K of which only the largest magnitude of all is asked for.

    Returns
    -------
    Extrema
        Of the K groups; without groups K is the number of outputs. Infinite in windows of which nothing is known.
    """
    known, evaluations = nothing_known(outputs, windows, squares, rivals), 0
    for sums in batches if known.rank.size else ():
        check_stop()
        evaluations += search(in_shares(sums), known, -1.0)[1]
    high, low = np.where(np.isnan(known.when), -np.inf, known.value)
    when_high, when_low = known.when
    return Extrema(-low, when_low, high, when_high, evaluations)


def nothing_known(outputs: int, windows: int = 1, squares: Ints | None = None, rivals: Ints | None = None) -> Known:
    """What a search knows at its beginning; see `search_extrema` for the parameters."""
    first = np.append(np.arange(outputs) if squares is None else squares, outputs)
    shape, least = (2, windows, first.size - 1), np.finfo(float).min
    rank = np.arange(2 * shape[2]).reshape(2, -1)
    if rivals is not None:
        rank[:, rivals] = rank[0, rivals[:1]]
    best = np.full((windows, rank.size), least)
    return Known(np.full(shape, least), np.full(shape, np.nan), first, squares is not None, rank, best)


def in_shares(sums: Sums) -> Sums:
    """Sums of functions of time in s, with complex coefficients (T, K) or (n, T, K), as the kernels take them.

    The time is counted from where `Sums.place` has the segment begin, in their lengths.
    """
    length, table = sums.place[3, :, None], sums.table if sums.table.ndim == 3 else sums.table[None]
    rate = sums.rate * length
    scale = (length**sums.power)[:, sums.basis]
    return sums._replace(
        rate=np.where(rate.real < GROWTH, rate, 0.0),  # what rests may grow beyond all numbers
        amplitude=sums.amplitude * scale, noise=sums.noise * scale,
        table=np.stack([table.real, table.imag, np.abs(table)], axis=1),
    )  # fmt: skip


def values_in_shares(sums: Sums, rows: Ints, u: Floats) -> Floats:
    """(m,) the only output on some parts, at one time (m,) each, a share of the segment."""
    functions = np.exp(sums.rate[rows] * u[:, None]) * u[:, None] ** sums.power
    terms, table = functions[:, sums.basis] * sums.amplitude[rows], sums.table[rows if sums.table.shape[0] > 1 else 0]
    return np.asarray((terms.real * table[..., 0, :, 0] - terms.imag * table[..., 1, :, 0]).sum(axis=1))


NODES = 16  # degree of the polynomials, above that of any integrator's dense output (12)
_POINTS = chebyshev.chebpts2(NODES + 1)
_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_POINTS, NODES))
_POWERS = np.array([np.pad(chebyshev.cheb2poly(row), (0, NODES - k)) for k, row in enumerate(np.eye(NODES + 1))])


def polynomials(values: Floats, start: Floats, length: Floats, window: Ints | None = None) -> Iterator[Sums]:
    """Outputs on S steps, from their values (S, NODES + 1, k) at the Chebyshev points, the earliest first.

    Parameters
    ----------
    values : (S, NODES + 1, k) in the units of the outputs.
    start, length : (S,) of the steps, s.
    window : (S,) numbers of the windows that the steps belong to; one by default.

    Yields
    ------
    Sums
        In seconds since the middle of each step.
    """
    coefficient = _COEFFICIENTS @ values
    round_off = NODES * EPS * np.abs(values).max(axis=1, keepdims=True)
    coefficient = np.where(np.abs(coefficient) > round_off, coefficient, 0.0)
    number, half = np.arange(NODES + 1), 0.5 * length
    table = (_POWERS.T @ coefficient) * half[:, None, None] ** -number[:, None]
    place, window = (
        np.stack([-np.ones(half.size), np.ones(half.size), start + half, half]),
        np.zeros(half.size, dtype=np.int64) if window is None else window,
    )
    for first in range(0, half.size, PARTS_AT_ONCE):
        rows = slice(first, first + PARTS_AT_ONCE)
        one = np.ones((place[0, rows].size, NODES + 1), dtype=complex)
        yield Sums(
            np.zeros(NODES + 1, dtype=complex), number, number, one, np.zeros(one.shape), table[rows].astype(complex),
            place[:, rows], window[rows],
        )  # fmt: skip
