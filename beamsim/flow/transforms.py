r"""Fourier integrals of motions at equally spaced frequencies, free of aliasing.

The integrals :math:`X(\omega) = \int x(t) e^{-i \omega t} dt` up to a frequency are what an ideal low-pass filter
leaves of a motion. On a segment an output is a sum of functions :math:`\tau^p e^{\lambda \tau}`:

- Functions that are not much faster than the highest frequency, on this segment, are sampled at the nodes of a
  Gauss-Legendre rule. Panels are so short that the rule integrates them times :math:`e^{-i \omega \tau}` to round-off.
- The integrals of all others follow from their values at both ends, by parts: with :math:`\rho = \lambda - i \omega`
  that of :math:`\tau^p e^{\rho \tau}` is :math:`e^{\rho \tau} \sum_j (-1)^j p! / (p - j)! \, \tau^{p - j} /
  \rho^{j + 1}`, j = 0 ... p. Up to the highest frequency a power of :math:`1 / \rho` is a sum of a few
  :math:`w_q e^{-i \omega s_q}`, so that an end counts as values at times about it.

All outputs share functions and weights: their values are one product of matrices. Both give sums
:math:`\sum_i v_i e^{-i k \delta t_i}` over uneven times, which are spread to an even grid, transformed there by the
fast Fourier transform and divided by the transform of the spreading function. See A. H. Barnett et al., SIAM J. Sci.
Comput. 41 (2019) C479.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from math import perm

import numpy as np

from beamsim.flow.contact_state import GROWTH, ContactState
from beamsim.flow.kernels import spread_to_grid
from beamsim.flow.moments import MANY_VALUES, blocks
from beamsim.flow.trajectory import Trajectory
from beamsim.system.equations import RowsOf
from beamsim.typing import Complexes, Floats, Ints

SPREAD = 15  # points of the grid that a value is spread to
SHARPNESS = 2.3 * SPREAD  # of the spreading function exp(SHARPNESS (sqrt(1 - z^2) - 1)), -1 < z < 1
OVERSAMPLING = 2  # of the grid
FAST = 2.0  # times the highest frequency: faster functions are integrated by parts ...
LONG = 20.0  # ... where a segment is longer than so many of their time constants
NODES_OF_ENDS, TURN_OF_ENDS = 40, 1.2  # times about an end, and the turn, rad, between two at the highest frequency
_FITTED = np.cos(np.pi * (np.arange(160) + 0.5) / 160)  # shares of it at which the sums are fitted
NODES_OF_RULES = (6, 8, 12, 16, 24, 32, 48, 64)
NEIGHBOURS = 20  # on either side that an integral between two frequencies is interpolated from


# turn of an exponential, rad, over which these rules integrate it to 1e-12
_LONGEST_TURN = 8.0 * np.array(NODES_OF_RULES) / np.exp(1.0) * 10.0 ** (-6.0 / np.array(NODES_OF_RULES))
_rule = lru_cache(np.polynomial.legendre.leggauss)


def evenly_spaced_sums(values: Iterable[tuple[Floats, Floats]], step: float, count: int, columns: int) -> Complexes:
    r"""Sums :math:`\sum_i v_i e^{-i k \delta t_i}` of K real columns for k = 0, 1, ... ; relative error about 1e-12.

    Parameters
    ----------
    values : times (n,), s, within one period :math:`2 \pi / \delta`, and values (n, K) there, part by part.
    step : :math:`\delta`, rad/s.
    count : of the frequencies.
    columns : K.

    Returns
    -------
    (count, K).
    """
    least = max(2 * OVERSAMPLING * count, 2 * SPREAD)
    power = 2 ** ((least - 1).bit_length() - 3)
    points = -(-least // power) * power  # 5 to 8 times a power of two: fast, without importing scipy.fft in each run
    grid, position = np.zeros((points, columns)), step * points / (2.0 * np.pi)
    for times, value in values:
        spread_to_grid(position * times, np.ascontiguousarray(value), SPREAD, SHARPNESS, grid)
    node, weight = _rule(3 * SPREAD)
    spread = 0.5 * SPREAD * weight * np.exp(SHARPNESS * (np.sqrt(1.0 - node**2) - 1.0))
    turn = np.pi * SPREAD / points * np.arange(count)
    transform = np.cos(np.multiply.outer(turn, node)) @ spread  # of the spreading function
    return np.asarray(np.fft.rfft(grid, axis=0)[:count] / transform[:, None])


def interpolated(integrals: Complexes, position: Floats) -> Complexes:
    r"""Fourier integrals between the frequencies at which they are known, to about 1e-13 of the largest.

    A transform of what lasts for :math:`\pi / \delta` has twice as many values as determine it: it is their sum with
    weights sinc times a Kaiser window.

    Parameters
    ----------
    integrals : (count,) at 0, :math:`\delta`, ... of a real signal that lasts for :math:`\pi / \delta`.
    position : (n,) frequencies over :math:`\delta`, up to ``count - 1 - NEIGHBOURS``.

    Returns
    -------
    (n,).
    """
    first = np.floor(position).astype(np.int64) - NEIGHBOURS + 1
    number = first[:, None] + np.arange(2 * NEIGHBOURS)
    distance = position[:, None] - number
    sharpness = 0.5 * np.pi * NEIGHBOURS
    inside = np.sqrt(np.maximum(1.0 - (distance / NEIGHBOURS) ** 2, 0.0))
    weight = np.sinc(distance) * np.i0(sharpness * inside) / np.i0(sharpness)
    known = integrals[np.abs(number)]
    known = np.where(number < 0, known.conj(), known)
    # the phase of the middle of the signal is taken out before and put back after
    turned = np.exp(-0.5j * np.pi * distance)
    return np.asarray((known * turned * weight).sum(axis=1))


def values_to_sum(motion: Trajectory, output_of: RowsOf, highest: float) -> Iterator[tuple[Floats, Floats]]:
    r"""Values whose sums are the Fourier integrals :math:`\int x(t) e^{-i \omega (t - t_0)} dt` of outputs.

    Parameters
    ----------
    motion : from :math:`t_0` on.
    output_of : K outputs, by the phases of the contacts.
    highest : largest :math:`\omega`, rad/s.

    Yields
    ------
    Times (n,) since the motion began, s, and values (n, K) there, part by part.
    """
    lasting = np.flatnonzero(motion.length > 0.0)
    for state, places in motion.by_state(lasting):
        segments, size = lasting[places], np.abs(state.exponent)
        table = state.coefficients(output_of(state.phases), motion.flow.sources)
        order = np.argsort(size, kind="stable")
        limit = np.maximum(FAST * highest, LONG / motion.length[segments])
        slow_functions = np.searchsorted(size[order], limit, side="right")
        for functions in np.unique(slow_functions):
            some, slow = segments[slow_functions == functions], np.zeros(size.size, dtype=bool)
            slow[order[:functions]] = True
            of_terms = slow[state.term_basis, None]
            fastest = float(size[slow].max(initial=0.0)) + highest
            if np.any(table * of_terms):
                yield from _values_at_nodes(motion, state, some, table * of_terms, fastest)
            if np.any(table * ~of_terms):
                yield from _values_about_ends(motion, state, some, table * ~of_terms, highest)


def _values_at_nodes(
    motion: Trajectory, state: ContactState, segments: Ints, table: Complexes, fastest: float
) -> Iterator[tuple[Floats, Floats]]:
    """Values times weights at the nodes of panels, of the rules that take the fewest values.

    Parameters
    ----------
    motion, state, segments : the motion, a contact state and segments in it.
    table : (T, K) coefficients of the terms.
    fastest : rad/s, of these terms and the highest frequency together.

    Yields
    ------
    Times (n,) since the motion began, s, and values (n, K).
    """
    length, nodes = motion.length[segments], np.array(NODES_OF_RULES)
    panels = np.maximum(np.ceil(fastest * length[:, None] / _LONGEST_TURN), 1.0).astype(np.int64)
    best = np.argmin(panels * nodes, axis=1)
    factors = np.stack([table.real, -table.imag], axis=1).reshape(2 * table.shape[0], table.shape[1])
    for rule in np.unique(best).tolist():
        rows, (node, weight) = np.flatnonzero(best == rule), _rule(NODES_OF_RULES[rule])
        count = panels[rows, rule]
        panel = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        row = np.repeat(rows, count)
        width = length[row] / panels[row, rule]
        for part in blocks(row.size, node.size * max(factors.shape), MANY_VALUES):
            tau = width[part, None] * (panel[part, None] + 0.5 + 0.5 * node)
            visits, of = np.unique(row[part], return_inverse=True)
            amplitude = motion.amplitudes(state, segments[visits])[np.repeat(of, node.size)]
            values = state.terms_after(amplitude, tau.ravel()).view(float) @ factors
            values *= (0.5 * np.multiply.outer(width[part], weight)).reshape(-1, 1)
            begun = motion.time[segments[row[part]], None] - motion.time[0]
            yield (begun + tau).ravel(), values


def _values_about_ends(
    motion: Trajectory, state: ContactState, segments: Ints, table: Complexes, highest: float
) -> Iterator[tuple[Floats, Floats]]:
    """What integrals by parts make of the values at both ends of segments.

    Parameters
    ----------
    motion, state, segments : the motion, a contact state and segments in it.
    table : (T, K) coefficients of the terms.
    highest : rad/s, frequency.

    Yields
    ------
    Times (n,) since the motion began, s, and values (n, K).
    """
    terms, count = np.flatnonzero(table.any(axis=1)), table.shape[1]
    basis, source = state.term_basis[terms], state.term_source[terms]
    exponent, power = state.exponent[basis], state.power[basis]
    around = (np.arange(NODES_OF_ENDS) - 0.5 * (NODES_OF_ENDS - 1)) * (TURN_OF_ENDS / highest)
    factors = []  # of an order j, by its terms: (-1)^j p! / (p - j)!, then (terms, nodes, K) of values at the nodes
    for order in range(int(power.max()) + 1):
        weights = _weights_of_ends(exponent / highest, order) * highest ** -(order + 1.0)
        size = np.array([(-1.0) ** order * perm(p, order) for p in power.tolist()])
        factors.append(((size[:, None] * weights)[:, :, None] * table[terms, None]).reshape(terms.size, -1))
    for part in blocks(segments.size, NODES_OF_ENDS * count, MANY_VALUES):
        some = segments[part]
        length, elapsed = motion.length[some, None], motion.time[some] - motion.time[0]
        amplitude, turned = motion.amplitudes(state, some)[:, source], length * exponent
        at_end = amplitude * np.exp(np.where(turned.real < GROWTH, turned, 0.0))  # what would grow beyond it is at rest
        for begun, sizes in (
            (elapsed, [-amplitude * (power == order) for order in range(len(factors))]),
            (elapsed + length[:, 0], [at_end * length ** np.maximum(power - k, 0) for k in range(len(factors))]),
        ):
            values = sum((x.real @ f.real - x.imag @ f.imag for x, f in zip(sizes, factors, strict=True)), np.zeros(()))
            yield np.add.outer(begun, around).ravel(), values.reshape(-1, count)


def _weights_of_ends(rate: Complexes, order: int) -> Complexes:
    r"""(T, nodes) weights :math:`w_q` of rates (T,) and an order j.

    They make :math:`\sum_q w_q e^{-i x s_q} = (\lambda - i x)^{-j - 1}` for frequencies x from -1 to 1.
    """
    left, size, right = _fits_of_ends()
    wanted = (rate - 1j * _FITTED[:, None]) ** -(order + 1)
    return np.asarray((right @ ((left @ wanted) / size[:, None])).T)


@lru_cache(maxsize=1)
def _fits_of_ends() -> tuple[Complexes, Floats, Complexes]:
    """Singular vectors and values of the exponentials at the times about an end, those that are not round-off."""
    place = (np.arange(NODES_OF_ENDS) - 0.5 * (NODES_OF_ENDS - 1)) * TURN_OF_ENDS
    left, size, right = np.linalg.svd(np.exp(-1j * np.multiply.outer(_FITTED, place)), full_matrices=False)
    kept = size > 1e-14 * size[0]
    return left[:, kept].conj().T, size[kept], right[kept].conj().T
