r"""Fourier integrals of motions at equally spaced frequencies, free of aliasing.

The integrals :math:`X(\omega) = \int x(t) e^{-i \omega t} dt` up to a frequency are what an ideal low-pass filter
leaves of a motion. On a segment an output is a sum of functions :math:`\tau^p e^{\lambda \tau}`:

- Functions that are not much faster than the highest frequency, on this segment, are sampled at the nodes of a
  Gauss-Legendre rule. Panels are so short that the rule integrates them times :math:`e^{-i \omega \tau}` to round-off.
- The integrals of all others follow from their values at both ends, by parts.

Both give sums :math:`\sum_i v_i e^{-i k \delta t_i}` over uneven times, which are spread to an even grid, transformed
there by the fast Fourier transform and divided by the transform of the spreading function. See A. H. Barnett et al.,
SIAM J. Sci. Comput. 41 (2019) C479.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import factorial

import numpy as np
from scipy.fft import next_fast_len, rfft

from beamsim.flow.contact_state import GROWTH, ContactState
from beamsim.flow.kernels import spread_to_grid
from beamsim.flow.moments import SegmentOutputs
from beamsim.flow.state_tables import visited_states
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

SPREAD = 15  # points of the grid that a value is spread to
SHARPNESS = 2.3 * SPREAD  # of the spreading function exp(SHARPNESS (sqrt(1 - z^2) - 1)), -1 < z < 1
OVERSAMPLING = 2  # of the grid
FAST = 1.5  # times the highest frequency: faster functions are integrated by parts ...
LONG = 20.0  # ... where a segment is longer than so many of their time constants
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
        points = next_fast_len(max(2 * OVERSAMPLING * count, 2 * SPREAD), real=True)
        self._grid, self._count = np.zeros((points, columns)), count
        self._position = step * points / (2.0 * np.pi)  # of a time on the grid, 1/s

    def add(self, times: Floats, values: Floats) -> None:
        """Include values (n, K) at times (n,), s, within one period ``2 pi / step``."""
        spread_to_grid(self._position * times, np.ascontiguousarray(values), SPREAD, SHARPNESS, self._grid)

    def totals(self) -> Complexes:
        """(count, K) the sums."""
        return np.asarray(rfft(self._grid, axis=0)[: self._count] / _spread(self._count, self._grid.shape[0])[:, None])


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
    by_parts = np.zeros((count, table.shape[2]), dtype=complex)
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
                by_parts += _by_parts(motion, state, some, (coefficients, fast), (step, count))
    return np.asarray((sampled.totals() + by_parts).T)


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


def _by_parts(
    motion: Trajectory, state: ContactState, segments: Ints, outputs: tuple[Complexes, Ints],
    frequencies: tuple[float, int],
) -> Complexes:  # fmt: skip
    r"""Integrals of some terms of outputs over segments of one contact state, from their values at both ends.

    With :math:`\rho = \lambda - i \omega` the integral of :math:`\tau^p e^{\rho \tau}` is that of
    :math:`e^{\rho \tau} \sum_j (-1)^j p! / (p - j)! \, \tau^{p - j} / \rho^{j + 1}`, j = 0 ... p.

    Parameters
    ----------
    motion, state, segments : the motion, a contact state and segments in it.
    outputs : coefficients (T, K) of the terms, and numbers of those that count.
    frequencies : step, rad/s, and number.

    Returns
    -------
    (count, K).
    """
    (step, count), length, elapsed = frequencies, motion.length[segments], motion.time[segments] - motion.time[0]
    coefficients, terms = outputs
    omega, out = step * np.arange(count), np.zeros((count, coefficients.shape[1]), dtype=complex)
    amplitudes = motion.source_amplitudes(state, segments)
    for term in terms.tolist():
        check_stop()
        amplitude, c = amplitudes[:, state.term_source[term]], coefficients[term]
        exponent, power = state.exponent[state.term_basis[term]], int(state.power[state.term_basis[term]])
        at_end = amplitude * _exponentials(length, np.array([exponent]))[:, 0]
        factors = [(-1.0) ** j * factorial(power) / factorial(power - j) for j in range(power + 1)]
        ends = np.stack([f * length ** (power - j) * at_end for j, f in enumerate(factors)], axis=1)
        begins = np.zeros_like(ends)
        begins[:, power] = -factors[power] * amplitude
        sums = FourierSums(step, count, 2 * (power + 1))
        sums.add(elapsed + length, ends.view(float))
        sums.add(elapsed, begins.view(float))
        real, imaginary = sums.totals().reshape(count, power + 1, 2).transpose(2, 0, 1)
        orders = -np.arange(1, power + 2)
        one = ((real + 1j * imaginary) * (exponent - 1j * omega)[:, None] ** orders).sum(axis=1)
        conjugate = ((real - 1j * imaginary) * (np.conj(exponent) - 1j * omega)[:, None] ** orders).sum(axis=1)
        out += 0.5 * (np.multiply.outer(one, c) + np.multiply.outer(conjugate, c.conj()))
    return out
