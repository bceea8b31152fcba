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

from collections.abc import Callable
from functools import lru_cache
from math import perm

import numpy as np

from beamsim.flow.contact_state import GROWTH, ContactState
from beamsim.flow.exact import visited_states
from beamsim.flow.kernels import spread_to_grid
from beamsim.flow.moments import SegmentOutputs
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

SPREAD = 15  # points of the grid that a value is spread to
SHARPNESS = 2.3 * SPREAD  # of the spreading function exp(SHARPNESS (sqrt(1 - z^2) - 1)), -1 < z < 1
OVERSAMPLING = 2  # of the grid
FAST = 2.0  # times the highest frequency: faster functions are integrated by parts ...
LONG = 20.0  # ... where a segment is longer than so many of their time constants
NODES_OF_ENDS, TURN_OF_ENDS = 40, 1.2  # times about an end, and the turn, rad, between two at the highest frequency
_FITTED = np.cos(np.pi * (np.arange(160) + 0.5) / 160)  # shares of it at which the sums are fitted
NODES_OF_RULES = (6, 8, 12, 16, 24, 32, 48, 64)
NEIGHBOURS = 20  # on either side that an integral between two frequencies is interpolated from
VALUES_AT_ONCE = 2_000_000  # which bounds the memory


def longest_turn(nodes: Ints) -> Floats:
    """Turn of an exponential, rad, over which Gauss-Legendre rules of so many nodes integrate it to 1e-12."""
    return np.asarray(8.0 * nodes / np.exp(1.0) * 10.0 ** (-6.0 / nodes))


class FourierSums:
    r"""Sums :math:`\sum_i v_i e^{-i k \delta t_i}` of K real columns for k = 0, 1, ... ; relative error about 1e-12.

    Parameters
    ----------
    step : :math:`\delta`, rad/s.
    count : of the frequencies.
    columns : K.
    """

    def __init__(self, step: float, count: int, columns: int) -> None:
        least = max(2 * OVERSAMPLING * count, 2 * SPREAD)
        power = 2 ** ((least - 1).bit_length() - 3)
        points = (
            -(-least // power) * power
        )  # 5 to 8 times a power of two: fast, without importing scipy.fft in each run
        self._grid, self._count = np.zeros((points, columns)), count
        self._position = step * points / (2.0 * np.pi)  # of a time on the grid, 1/s

    def add(self, times: Floats, values: Floats) -> None:
        """Include values (n, K) at times (n,), s, within one period ``2 pi / step``."""
        spread_to_grid(self._position * times, np.ascontiguousarray(values), SPREAD, SHARPNESS, self._grid)

    def totals(self) -> Complexes:
        """(count, K) the sums."""
        transform = np.fft.rfft(self._grid, axis=0)[: self._count]
        return np.asarray(transform / _spread(self._count, self._grid.shape[0])[:, None])


@lru_cache(maxsize=4)
def _spread(count: int, points: int) -> Floats:
    """(count,) transform of the spreading function on a grid of points."""
    node, weight = np.polynomial.legendre.leggauss(3 * SPREAD)
    value = weight * np.exp(SHARPNESS * (np.sqrt(1.0 - node**2) - 1.0))
    turn = np.pi * SPREAD / points * np.arange(count)
    return np.asarray(0.5 * SPREAD * np.cos(np.multiply.outer(turn, node)) @ value)


def evenly_spaced_integrals(motion: Trajectory, table: Complexes, step: float, count: int) -> Complexes:
    r"""Fourier integrals of outputs over a motion at frequencies 0, :math:`\delta`, :math:`2 \delta`, ...

    Parameters
    ----------
    motion : of contact states that are all kept; no longer than :math:`2 \pi / \delta`.
    table : (S, T, K) coefficients of the outputs by contact state.
    step : :math:`\delta`, rad/s.
    count : of the frequencies.

    Returns
    -------
    (K, count) :math:`\int x(t) e^{-i k \delta (t - t_0)} dt`, :math:`t_0` being the start of the motion.
    """
    highest, sampled = step * (count - 1), FourierSums(step, count, table.shape[2])
    for number in visited_states(motion.state):
        state, segments = motion.flow.states[number], np.flatnonzero((motion.state == number) & (motion.length > 0.0))
        coefficients, size = table[number, : state.term_basis.size], np.abs(state.exponent)
        order = np.argsort(size, kind="stable")
        limit = np.maximum(FAST * highest, LONG / motion.length[segments])
        slow_functions = np.searchsorted(size[order], limit, side="right")
        for functions in np.unique(slow_functions):
            some, slow = segments[slow_functions == functions], np.zeros(size.size, dtype=bool)
            slow[order[:functions]] = True
            of_terms = slow[state.term_basis] & coefficients.any(axis=1)
            fastest = float(size[slow].max(initial=0.0)) + highest
            if of_terms.any():
                _sample(motion, state, some, (coefficients, of_terms), fastest, sampled.add)
            fast = np.flatnonzero(~slow[state.term_basis] & coefficients.any(axis=1))
            if fast.size:
                _sample_ends(motion, state, some, (coefficients, fast), highest, sampled.add)
    return np.asarray(sampled.totals().T)


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


def _sample(
    motion: Trajectory, state: ContactState, segments: Ints, outputs: tuple[Complexes, Bools], fastest: float,
    add: Callable[[Floats, Floats], None],
) -> None:  # fmt: skip
    """Add values times weights at the nodes of panels.

    Parameters
    ----------
    motion, state, segments : the motion, a contact state and segments in it.
    outputs : coefficients (T, K) of the terms, and which terms (T,) count.
    fastest : rad/s, of these terms and the highest frequency together.
    add : takes times (n,), s, since the motion began, and values (n, K).
    """
    table, functions = outputs[0] * outputs[1][:, None], state.exponent.size
    lengths, which = np.unique(motion.equal_lengths[segments], return_inverse=True)
    nodes, panels = _rules(fastest * lengths)
    widths = lengths / panels
    for rule in np.unique(nodes).tolist():
        rows = np.flatnonzero(nodes[which] == rule)
        node, weight = _gauss_legendre(rule)
        count = panels[which[rows]]
        row = np.repeat(rows, count)
        place = np.arange(row.size) - np.repeat(np.cumsum(count) - count, count)
        at_once = max(1, VALUES_AT_ONCE // max(rule * functions, rule * table.shape[1], functions * table.shape[1]))
        for first in range(0, row.size, at_once):
            block, number = row[first : first + at_once], place[first : first + at_once]
            check_stop()
            # panels of one number, in segments of one length, share the values of the functions
            kinds, kind = np.unique(number * lengths.size + which[block], return_inverse=True)
            number_of_kind, length_of_kind = np.divmod(kinds, lengths.size)
            width = widths[length_of_kind]
            begun = number_of_kind * width
            visits, visit = np.unique(block, return_inverse=True)
            on_visits = motion.outputs(state, segments[visits], table).acting()
            c = on_visits.coefficient
            factors = np.stack([c.real, -c.imag], axis=2).reshape(visits.size, 2 * c.shape[1], c.shape[2])
            values = _functions(on_visits, begun, width, node).view(float)[kind] @ factors[visit]
            values *= np.multiply.outer(width, weight)[kind, :, None]
            tau = begun[:, None] + np.multiply.outer(width, node)
            times = (motion.time[segments[block]] - motion.time[0])[:, None] + tau[kind]
            add(times.ravel(), values.reshape(times.size, -1))


def _rules(turn: Floats) -> tuple[Ints, Ints]:
    """Nodes (n,) of the rules, and numbers (n,) of panels, that take the fewest values over turns (n,), rad."""
    rules = np.array(NODES_OF_RULES)
    panels = np.maximum(np.ceil(turn[:, None] / longest_turn(rules)), 1.0).astype(np.int64)
    best = np.argmin(panels * rules, axis=1)
    return rules[best], panels[np.arange(turn.size), best]


@lru_cache(maxsize=len(NODES_OF_RULES))
def _gauss_legendre(nodes: int) -> tuple[Floats, Floats]:
    """Nodes and weights of a rule for the integral from 0 to 1."""
    node, weight = np.polynomial.legendre.leggauss(nodes)
    return 0.5 + 0.5 * node, 0.5 * weight


def _functions(outputs: SegmentOutputs, begun: Floats, width: Floats, node: Floats) -> Complexes:
    """(n, N, B) values of the functions of outputs on panels that begin at times (n,), s, of widths (n,), s."""
    widths, which = np.unique(width, return_inverse=True)
    within = _exponentials(np.multiply.outer(widths, node), outputs.exponent)
    values = _exponentials(begun, outputs.exponent)[:, None] * within[which]
    if outputs.power.any():
        powers = np.ones((width.size, node.size, int(outputs.power.max()) + 1))
        powers[..., 1:] = (begun[:, None] + np.multiply.outer(width, node))[..., None]
        values *= np.multiply.accumulate(powers, axis=-1)[..., outputs.power]
    return np.asarray(values)


def _exponentials(tau: Floats, exponent: Complexes) -> Complexes:
    """(..., B) of times (...) since the start of a segment; what would grow without bound has no amplitude."""
    turned = np.multiply.outer(tau, exponent)
    return np.asarray(np.exp(np.where(turned.real < GROWTH, turned, 0.0)))


def _sample_ends(
    motion: Trajectory, state: ContactState, segments: Ints, outputs: tuple[Complexes, Ints], highest: float,
    add: Callable[[Floats, Floats], None],
) -> None:  # fmt: skip
    """Add what integrals by parts make of the values at both ends of segments.

    Parameters
    ----------
    motion, state, segments : the motion, a contact state and segments in it.
    outputs : coefficients (T, K) of the terms, and numbers of those that count.
    highest : rad/s, frequency.
    add : takes times (n,), s, since the motion began, and values (n, K).
    """
    terms, count = outputs[1], outputs[0].shape[1]
    basis, source = state.term_basis[terms], state.term_source[terms]
    exponent, power = state.exponent[basis], state.power[basis]
    around = (np.arange(NODES_OF_ENDS) - 0.5 * (NODES_OF_ENDS - 1)) * (TURN_OF_ENDS / highest)
    factors = []  # of an order j, by its terms: (-1)^j p! / (p - j)!, then (terms, nodes, K) of values at the nodes
    for order in range(int(power.max()) + 1):
        weights = _weights_of_ends(exponent / highest, order) * highest ** -(order + 1.0)
        size = np.array([(-1.0) ** order * perm(p, order) for p in power.tolist()])
        factors.append(((size[:, None] * weights)[:, :, None] * outputs[0][terms, None]).reshape(terms.size, -1))
    at_once = max(1, VALUES_AT_ONCE // (NODES_OF_ENDS * count))
    for first in range(0, segments.size, at_once):
        check_stop()
        some = segments[first : first + at_once]
        length, elapsed = motion.length[some, None], motion.time[some] - motion.time[0]
        amplitude = motion.source_amplitudes(state, some)[:, source]
        at_end = amplitude * _exponentials(length[:, 0], exponent)
        for begun, sizes in (
            (elapsed, [-amplitude * (power == order) for order in range(len(factors))]),
            (elapsed + length[:, 0], [at_end * length ** np.maximum(power - k, 0) for k in range(len(factors))]),
        ):
            values = sum((x.real @ f.real - x.imag @ f.imag for x, f in zip(sizes, factors, strict=True)), np.zeros(()))
            add(np.add.outer(begun, around).ravel(), values.reshape(-1, count))


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
