r"""Which segments may hold the largest value of which output, by products of matrices over all of both.

Between two points a term :math:`\zeta e^{\lambda \tau}` leaves the straight line by no more than an eighth of its
largest curvature times the square of their distance, and by no more than twice its largest size. The sum over the terms
of an output bounds the output by its values at a few points. What may exceed the largest value known is left to the
search of :mod:`beamsim.flow.peak_search`, or, on segments with huge terms, of :func:`beamsim.flow.kernels.extremes`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import ContactState, OutputOf
from beamsim.flow.equal_pieces import Segments
from beamsim.flow.peak_search import PARTS, Intervals, Sums, powers
from beamsim.flow.state_tables import visited_states
from beamsim.flow.stopping import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

LARGEST = 1e100  # amplitude; segments with larger ones are left to the search
VALUES_AT_ONCE = 2_000_000  # of outputs or terms, at the points of some segments


class Exponentials(Segments, Protocol):
    """Segments whose terms have no power of time."""

    def amplitudes(self, state: ContactState, segments: Ints) -> Complexes:
        """(n, T) of the terms where segments of one contact state begin."""


@dataclass(frozen=True)
class Candidates:
    """Pairs of a segment and an output that may exceed what was known, all of one contact state."""

    state: int
    segment: Ints  # (n,)
    output: Ints  # (n,) among the outputs, then their negatives
    bound: Floats  # (n,) no value on the segment is larger; infinite where its terms are huge
    table: Complexes  # (T, u) coefficients of the outputs in `used`
    used: Ints  # (u,) increasing

    def above(self, highest: Floats) -> Candidates:
        """Those that may still exceed ``highest`` (signs * k,)."""
        return self.some(self.bound > highest[self.output])

    def some(self, which: Bools | slice) -> Candidates:
        """Some of the pairs."""
        return replace(self, segment=self.segment[which], output=self.output[which], bound=self.bound[which])

    def coefficients(self, outputs: Ints, count: int) -> Complexes:
        """(T, n) of some of ``count`` outputs and their negatives."""
        column = np.searchsorted(self.used, outputs % count)
        return np.ascontiguousarray(np.where(outputs < count, 1.0, -1.0) * self.table[:, column])


def candidates(motion: Exponentials, output_of: OutputOf, highest: Floats, when: Floats) -> list[Candidates]:
    """Pairs that may hold a larger value than ``highest``, which first rises to the largest one at a point.

    Parameters
    ----------
    output_of : k outputs in a contact state.
    highest, when : (signs, k) largest values known, of the outputs and, with two signs, of their negatives; and their
        times, s. Both are changed.
    """
    flow, (signs, count) = motion.flow, highest.shape
    possible = []
    for number in visited_states(motion.state):
        state, segments = flow.states[number], np.flatnonzero(motion.state == number)
        output, used = output_of(state.phases), np.arange(count)
        acts = output.acts
        if not acts.all():
            _reach_zero(highest, when, ~acts, float(motion.time[segments[0]]))
            output, used = output.some(acts), used[acts]
        if not used.size:
            continue
        table = state.coefficients(output, flow.sources)
        pairs = []
        for part in _parts(segments, max(table.shape)):
            begin = motion.amplitudes(state, part)
            rising = np.maximum(state.exponent.real[state.term_basis], 0.0) * motion.length[part, None]
            moderate = np.all(np.log(LARGEST) - rising > np.log(np.abs(begin) + 1.0), axis=1)
            if moderate.any():
                pairs.append(_pairs(motion, state, part[moderate], begin[moderate], table, used, highest, when))
            large = part[~moderate]
            if large.size:
                every = (np.arange(signs)[:, None] * count + used).ravel()
                each = np.repeat(large, every.size), np.tile(every, large.size)
                pairs.append((*each, np.full(each[0].size, np.inf)))
        segment, column, bound = (np.concatenate(values) for values in zip(*pairs, strict=True))
        left = np.unique(column % count)
        possible.append(Candidates(number, segment, column, bound, table[:, np.searchsorted(used, left)], left))
    return possible


def peak_searches(
    motion: Exponentials, possible: list[Candidates], highest: Floats
) -> Iterator[tuple[Sums, Intervals]]:
    """What `beamsim.flow.peak_search.search` takes, of all contact states together, some of the pairs at a time.

    Pairs without a finite bound are left out. ``highest`` (signs, k) are the largest values known, which rise between
    two of the searches.
    """
    waiting: list[Candidates] = []
    room = VALUES_AT_ONCE
    for of_state in possible:
        above, terms = of_state.above(highest.ravel()), of_state.table.shape[0]
        above, first = above.some(np.isfinite(above.bound)), 0
        while first < above.segment.size:
            last = first + max(1, room // terms)
            waiting.append(above.some(slice(first, last)))
            room -= waiting[-1].segment.size * terms
            first = last
            if room < terms:
                yield _sums(motion, waiting, highest.shape[1])
                waiting, room = [], VALUES_AT_ONCE
    if waiting:
        yield _sums(motion, waiting, highest.shape[1])


def _sums(motion: Exponentials, possible: list[Candidates], count: int) -> tuple[Sums, Intervals]:
    """Sums on whole segments; ``count`` outputs have two signs."""
    segments = [np.unique(c.segment, return_inverse=True) for c in possible]
    first = np.cumsum([0, *(different.size for different, _ in segments)])
    output, bound = np.concatenate([c.output for c in possible]), np.concatenate([c.bound for c in possible])
    states = [motion.flow.states[c.state] for c in possible]
    longest = max(state.exponent.size for state in states)
    exponent = np.zeros((first[-1], longest), dtype=complex)
    coefficient, row = np.zeros((output.size, longest), dtype=complex), 0
    for c, state, (different, at_different), begin in zip(possible, states, segments, first, strict=False):
        exponent[begin : begin + different.size, : state.exponent.size] = state.exponent
        terms = motion.amplitudes(state, different)[at_different] * c.coefficients(c.output, count).T
        np.add.at(coefficient[row : row + c.output.size].T, state.term_basis, terms.T)
        row += c.output.size
    every = np.concatenate([different for different, _ in segments])
    at = np.concatenate([begin + inverse for begin, (_, inverse) in zip(first, segments, strict=False)])
    whole = Intervals(np.arange(output.size), np.zeros(output.size), motion.length[every][at], bound)
    return Sums(exponent, motion.time[every], at, output, coefficient), whole


def _reach_zero(highest: Floats, when: Floats, outputs: Bools, time: float) -> None:
    """Raise the largest values known of outputs (k,) that are zero in a contact state, begun at a time, s."""
    for known, at in zip(highest, when, strict=True):
        better = outputs & (known < 0.0)
        known[better], at[better] = 0.0, time


def _parts(segments: Ints, size: int) -> Iterator[Ints]:
    count = max(1, VALUES_AT_ONCE // ((PARTS + 1) * size))
    for first in range(0, segments.size, count):
        check_stop()
        yield segments[first : first + count]


def _pairs(
    motion: Exponentials, state: ContactState, segments: Ints, begin: Complexes, table: Complexes, used: Ints,
    highest: Floats, when: Floats,
) -> tuple[Ints, Ints, Floats]:  # fmt: skip
    """Segments, outputs and bounds of the pairs that are not ruled out, of segments of one contact state.

    ``begin`` (n, T) are the terms where the segments begin, ``table`` (T, u) their coefficients in the outputs, those
    in ``used`` (u,).
    """
    exponent, count = state.exponent[state.term_basis], table.shape[1]
    step = motion.length[segments] / PARTS
    tau = step[:, None] * np.arange(PARTS + 1)
    rate = step[:, None] * exponent
    turn = np.exp(rate)
    terms = powers(begin, turn)  # (n, points, T)
    parts = np.stack([table.real, -table.imag], axis=1).reshape(-1, count)
    values = (terms.view(float).reshape(-1, 2 * exponent.size) @ parts).reshape(*tau.shape, count)
    growth = np.exp(rate.real)
    bend = np.minimum((rate.real**2 + rate.imag**2) / 8.0, 2.0) * np.maximum(growth, 1.0)
    bent = powers(np.abs(begin) * bend, growth)[:, :-1]
    over = (bent.reshape(-1, exponent.size) @ np.abs(table)).reshape(segments.size, PARTS, count)
    time = (motion.time[segments, None] + tau).ravel()
    pairs = []
    for k in range(highest.shape[0]):
        signed = -values if k else values
        flat = signed.reshape(-1, count)
        best = flat.argmax(axis=0)
        reached = flat[best, np.arange(count)]
        better = reached > highest[k, used]
        highest[k, used[better]], when[k, used[better]] = reached[better], time[best[better]]
        bound = (np.maximum(signed[:, :-1], signed[:, 1:]) + over).max(axis=1)
        row, column = np.nonzero(bound > highest[k, used])
        pairs.append((segments[row], used[column] + k * highest.shape[1], bound[row, column]))
    segment, output, bounds = (np.concatenate(x) for x in zip(*pairs, strict=True))
    return segment, output, bounds
