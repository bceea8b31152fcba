"""The bound on what samples of a motion of very many pieces fold, see `beamsim.flow.fourier_kernels.folded`.

The derivatives of outputs in a contact state are linear in the amplitudes of the inputs and in the state, so that they
come from products of matrices. Where two segments of one contact state join, the state is the same on both sides, and
only the jumps of the inputs count.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, pi

import numpy as np

from beamsim.flow.basis import as_real, basis_derivatives
from beamsim.flow.contact_state import ContactState
from beamsim.flow.equal_pieces import AT_ONCE, Segments
from beamsim.flow.fourier_kernels import BERNOULLI, CONVERGENT, ORDERS
from beamsim.flow.stopping import check_stop
from beamsim.typing import Complexes, Floats, Ints


@dataclass(frozen=True)
class _Derivatives:
    """What k outputs and their derivatives are made of in a contact state, at a unit of each of X = 2 F + N numbers:
    real and imaginary parts of the inputs' amplitudes in turn, and the state."""

    jets: Floats  # (X, ORDERS k) derivatives, exponentials too fast for the series left out
    beyond: Complexes  # (X, E, k) of each of E exponentials: its size bounds the terms beyond them
    fast: Complexes  # (X, D) free motions left out of the samples
    decay: Floats  # (D,) 1/s, theirs
    left_out: Floats  # (D, k) bounds on their integrals but for what they grow over a segment

    @classmethod
    def of(cls, state: ContactState, table: Complexes, dropped: Complexes, step: float, reach: float) -> _Derivatives:
        """``table`` and ``dropped`` (T, k) as in `folded_by_products`."""
        amplitude, k, of_term = state.amplitude_map(), table.shape[1], state.term_basis
        ratio = (np.abs(state.exponent) + reach) * step / (2.0 * pi)
        slow = ratio < CONVERGENT
        jets = [
            state.of_amplitudes(np.where(slow, of_order, 0.0)[of_term, None] * table)
            for of_order in basis_derivatives(state.exponent, state.power, 0.0, ORDERS)
        ]
        doubt = np.where(slow, ratio**ORDERS / np.where(slow, 1.0 - ratio, 1.0) / 3.0, 1.2)
        begins = np.zeros((amplitude.shape[1], state.exponent.size, k), dtype=complex)
        np.add.at(begins, (state.term_source, of_term), doubt[of_term, None] * table)
        beyond = np.tensordot(amplitude, begins[:, state.power == 0], axes=1)
        terms = np.flatnonzero(np.any(dropped != 0.0, axis=1))
        exponent = state.exponent[of_term[terms]]
        return cls(
            as_real(amplitude) @ np.hstack(jets), beyond, amplitude[:, state.term_source[terms]], -exponent.real,
            np.abs(dropped[terms]) / (np.abs(exponent) - reach)[:, None],
        )  # fmt: skip


def folded_by_products(
    motion: Segments, final: Floats, table: Complexes, dropped: Complexes, step: float, reach: float, open_ends: bool
) -> Floats:
    """(k,) bound, see `beamsim.flow.fourier.MotionPart.folded`; the motion ends in the state ``final`` (N,).

    Events must not reset internal states of the contacts. Joint g is where segment g begins; the last one is the end.
    """
    count, k, inputs = motion.time.size, table.shape[2], 2 * motion.flow.sources.count
    of_state = {}
    for s in np.unique(motion.state):
        state = motion.flow.states[s]
        terms = slice(0, state.term_basis.size)
        of_state[int(s)] = _Derivatives.of(state, table[s, terms], dropped[s, terms], step, reach)

    def given(segments: Ints, time: Floats) -> Floats:
        """(n, 2 F) amplitudes of the inputs in the pieces of segments, about times."""
        return as_real(motion.flow.sources.amplitudes_at(time, motion.piece[segments]))

    bound, jumps, at_ends = np.zeros(k), np.zeros((ORDERS, k)), np.zeros((ORDERS, k))
    for begin in range(0, count, AT_ONCE):
        check_stop()
        part = slice(begin, min(begin + AT_ONCE, count))
        for s in np.unique(motion.state[part]):
            of = of_state[int(s)]
            segments = begin + np.flatnonzero(motion.state[part] == s)
            start = given(segments, motion.time[segments])
            free = np.abs(start @ of.fast[:inputs] + motion.y[segments] @ of.fast[inputs:])
            grown = 1.0 + np.exp(-of.decay * motion.length[segments, None])
            bound += (free * grown).sum(axis=0) @ of.left_out
            on = (segments > 0) & (motion.state[segments - 1] == s)
            jump = start[on] - given(segments[on] - 1, motion.time[segments[on]])
            jumps += np.abs(jump @ of.jets[:inputs]).sum(axis=0).reshape(ORDERS, k)
    inside = 1 + np.flatnonzero(np.diff(motion.state))
    for joints, total in ((inside, jumps), (np.array([0, count]) if open_ends else inside[:0], at_ends)):
        time, y = np.append(motion.time, motion.end)[joints], motion.y[np.minimum(joints, count - 1)]
        y[joints == count] = final
        difference = np.zeros((joints.size, ORDERS * k))
        for sign, side in ((1.0, joints), (-1.0, joints - 1)):
            for s, of in of_state.items():
                at = np.flatnonzero((side >= 0) & (side < count) & (motion.state[np.clip(side, 0, count - 1)] == s))
                x = np.hstack([given(side[at], time[at]), y[at]])
                difference[at] += sign * (x @ of.jets)
                bound += step * np.abs(np.tensordot(x, of.beyond, axes=1)).sum(axis=(0, 1))
        total += np.abs(difference).sum(axis=0).reshape(ORDERS, k)
    return bound + _factors(step, reach, 0) @ jumps + _factors(step, reach, 1) @ at_ends


def _factors(step: float, reach: float, lowest: int) -> Floats:
    """(ORDERS,) of the jumps of each derivative in the terms of the series from an order on."""
    scale = [BERNOULLI[order] * step ** (order + 1) for order in range(ORDERS)]
    return np.array([
        sum(scale[order] * comb(order, m) * reach ** (order - m) for order in range(max(m, lowest), ORDERS))
        for m in range(ORDERS)
    ])  # fmt: skip
