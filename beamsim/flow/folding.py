r"""The bound on what samples of a motion fold.

The sum over the samples of an exponential that begins or ends at a time theta steps from a sample differs from its
integral by ``-step sum_k B_k(theta) / k! (s step)^(k - 1)`` (Euler-Maclaurin). Where two segments join only the jumps
of the output and its derivatives remain: those of the first orders are taken as they are, the rest by the sizes of the
exponentials (none where the contacts stay as they are).

The derivatives of outputs in a contact state are linear in the amplitudes of the inputs and in the state, so that they
come from products of matrices. Where two segments of one contact state join, the state is the same on both sides, and
only the jumps of the inputs count.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import comb, pi

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.basis import as_real, basis_derivatives
from beamsim.flow.contact_state import ContactState
from beamsim.flow.equal_pieces import AT_ONCE, Segments
from beamsim.flow.stopping import check_stop
from beamsim.typing import Complexes, Floats, Ints

ORDERS = 8  # of the terms of the Euler-Maclaurin series in which jumps are taken as they are
# Largest |B_k(theta)| / k! of the Bernoulli polynomials on [0, 1]: 1/2, 1/12, then at most 2.05 / (2 pi)^k
BERNOULLI = (0.5, 1.0 / 12.0, *(2.05 / (2.0 * pi) ** k for k in range(3, ORDERS + 1)))
CONVERGENT = 0.9  # |s| step / 2 pi below which the series is used


@dataclass(frozen=True)
class _Derivatives:
    """What k outputs and their derivatives are made of in a contact state: of the amplitudes of F inputs and of Z free
    motions, which `amplitude` gives for a unit of each of X = 2 F + N numbers: real and imaginary parts of the inputs'
    amplitudes in turn, and the state."""

    amplitude: Complexes  # (X, F + Z)
    source: Ints  # (T,) amplitude of each term
    order: Complexes  # (ORDERS, T) derivatives at the start of a segment, exponentials too fast for the series left out
    table: Floats  # (2 T, k) real and imaginary parts of the coefficients, see `as_real`
    alone: tuple[Ints, Floats]  # amplitudes, and (., k) bounds on the terms beyond, of exponentials of one term each
    beyond: list[tuple[Ints, Complexes]]  # the same of each other exponential before its terms add up
    fast: Ints  # (D,) free motions left out of the samples
    decay: Floats  # (D,) 1/s, theirs
    left_out: Floats  # (D, k) bounds on their integrals but for what they grow over a segment

    @classmethod
    def of(cls, state: ContactState, table: Complexes, dropped: Complexes, step: float, reach: float) -> _Derivatives:
        """``table`` and ``dropped`` (T, k) as in `folded_by_products`."""
        of_term, source = state.term_basis, state.term_source
        ratio = (np.abs(state.exponent) + reach) * step / (2.0 * pi)
        slow = ratio < CONVERGENT
        orders = np.where(slow, basis_derivatives(state.exponent, state.power, 0.0, ORDERS), 0.0)[:, of_term]
        doubt = np.where(slow, ratio**ORDERS / np.where(slow, 1.0 - ratio, 1.0) / 3.0, 1.2)[of_term]
        start, single = state.power[of_term] == 0, np.bincount(of_term)[of_term] == 1
        alone = np.flatnonzero(start & single)
        together = [np.flatnonzero(of_term == b) for b in np.unique(of_term[start & ~single])]
        terms = np.flatnonzero(np.any(dropped != 0.0, axis=1))
        exponent = state.exponent[of_term[terms]]
        parts = np.stack([table.real, -table.imag], axis=1).reshape(-1, table.shape[1])
        return cls(
            state.amplitude_map(), source, orders, parts,
            (source[alone], doubt[alone, None] * np.abs(table[alone])),
            [(source[some], doubt[some, None] * table[some]) for some in together],
            source[terms], -exponent.real, np.abs(dropped[terms]) / (np.abs(exponent) - reach)[:, None],
        )  # fmt: skip

    def jets(self, zeta: Complexes) -> Floats:
        """(n, ORDERS, k) derivatives where the amplitudes are zeta (n, F + Z)."""
        terms = zeta[:, None, self.source] * self.order
        return (as_real(terms.reshape(-1, self.source.size)) @ self.table).reshape(-1, ORDERS, self.table.shape[1])

    def sizes_beyond(self, zeta: Complexes) -> Floats:
        """(k,) sum over amplitudes (n, F + Z) of the bounds on the terms beyond."""
        sources, weights = self.alone
        total = np.asarray(np.abs(zeta[:, sources]).sum(axis=0) @ weights)
        for source, weight in self.beyond:
            total += np.abs(zeta[:, source] @ weight).sum(axis=0)
        return total


def folded_by_products(
    motion: Segments, table: Complexes, dropped: Complexes, step: float, reach: float, open_ends: bool
) -> Floats:
    """(k,) bound, see `beamsim.flow.fourier.MotionPart.folded`.

    Joint g is where segment g begins; the last one is the end of the motion.
    """
    count, k, inputs = motion.time.size, table.shape[2], 2 * motion.flow.sources.count

    def given(segments: Ints, time: Floats) -> Floats:
        """(n, 2 F) amplitudes of the inputs in the pieces of segments, about times."""
        return as_real(motion.flow.sources.amplitudes_at(time, motion.piece[segments]))

    def amplitudes(of: _Derivatives, segments: Ints, time: Floats, y: Floats) -> Complexes:
        """(n, F + Z) amplitudes about times at which the states are y."""
        return np.asarray(np.hstack([given(segments, time), y]) @ of.amplitude)

    changes = 1 + np.flatnonzero(np.diff(motion.state))
    of_joints = [(joints, np.zeros((joints.size, ORDERS, k))) for joints in (changes, np.array([0, count]))]
    bound, jumps = np.zeros(k), np.zeros((ORDERS, k))
    for s in np.unique(motion.state):
        state = motion.flow.states[s]
        terms = slice(0, state.term_basis.size)
        of = _Derivatives.of(state, table[s, terms], dropped[s, terms], step, reach)
        of_inputs = of.jets(of.amplitude[:inputs])
        for segments in _some(np.flatnonzero(motion.state == s), AT_ONCE):
            loads = given(segments, motion.time[segments])
            free = np.abs(loads @ of.amplitude[:inputs, of.fast] + motion.y[segments] @ of.amplitude[inputs:, of.fast])
            grown = 1.0 + np.exp(-of.decay * motion.length[segments, None])
            bound += (free * grown).sum(axis=0) @ of.left_out
            on = (segments > 0) & (motion.state[segments - 1] == s)
            jump = loads[on] - given(segments[on] - 1, motion.time[segments[on]])
            jumps += np.abs(np.tensordot(jump, of_inputs, axes=1)).sum(axis=0)
        for joints, difference in of_joints if open_ends else of_joints[:1]:
            begins = np.flatnonzero((joints < count) & (motion.state[np.minimum(joints, count - 1)] == s))
            for after in _some(begins, AT_ONCE // ORDERS):
                began = joints[after]
                start = amplitudes(of, began, motion.time[began], motion.y[began])
                difference[after] += of.jets(start)
                bound += step * of.sizes_beyond(start)
            ends = np.flatnonzero((joints > 0) & (motion.state[joints - 1] == s))
            for before in _some(ends, AT_ONCE // ORDERS):
                ended = joints[before] - 1
                at_start = amplitudes(of, ended, motion.time[ended], motion.y[ended])
                y = state.states_after(at_start, motion.length[ended])  # before what an event resets
                end = amplitudes(of, ended, motion.time[ended] + motion.length[ended], y)
                difference[before] -= of.jets(end)
                bound += step * of.sizes_beyond(end)
    jumps, at_ends = (total + np.abs(d).sum(axis=0) for total, (_, d) in zip((jumps, 0.0), of_joints, strict=True))
    return np.asarray(bound + _factors(step, reach, 0) @ jumps + _factors(step, reach, 1) @ at_ends)


def _some(numbers: Ints, at_once: int) -> Iterator[Ints]:
    """Numbers of segments or joints, some at a time."""
    for first in range(0, numbers.size, at_once):
        check_stop()
        yield numbers[first : first + at_once]


def _factors(step: float, reach: float, lowest: int) -> Floats:
    """(ORDERS,) of the jumps of each derivative in the terms of the series from an order on."""
    scale = [BERNOULLI[order] * step ** (order + 1) for order in range(ORDERS)]
    return np.array([
        sum(scale[order] * comb(order, m) * reach ** (order - m) for order in range(max(m, lowest), ORDERS))
        for m in range(ORDERS)
    ])  # fmt: skip
