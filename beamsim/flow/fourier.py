"""Fourier analysis of a computed motion in closed form: integrals at given frequencies, samples for a curve."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from beamsim.flow.contact_state import OutputOf
from beamsim.flow.state_tables import visited_states
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Complexes, Floats


@dataclass(frozen=True)
class MotionPart:
    """K outputs on a part of a motion.

    Free oscillations above ``cut`` (rad/s) are left out of the samples and Fourier integrals: the samples would not
    cover them, and the vectors that a reduction adds for static deflections have such frequencies without a meaning.

    Parameters
    ----------
    motion : cut to the part.
    output_of : the outputs, nothing left out.
    table : (S, T, K) their coefficients but for what is left out.
    known : (K,) Fourier integrals so far, by frequency in rad/s.
    """

    motion: Trajectory
    output_of: OutputOf
    table: Complexes
    known: dict[float, Complexes] = field(default_factory=dict)

    @classmethod
    def of(cls, trajectory: Trajectory, output_of: OutputOf, begin: float, end: float, cut: float) -> MotionPart:
        """The outputs between two times.

        Parameters
        ----------
        trajectory, output_of : the motion and K outputs.
        begin, end : s, within the motion.
        cut : rad/s.

        Returns
        -------
        MotionPart
            Without its free motions above the cut.
        """
        part = trajectory.between(begin, end).held()
        table = part.flow.output_table(output_of)
        for s, state in enumerate(part.flow.states):
            free = state.term_source >= part.flow.sources.count
            fast = np.abs(state.exponent.imag[state.term_basis]) > cut
            table[s, : free.size][free & fast & (state.power[state.term_basis] == 0)] = 0.0
        return cls(part, output_of, table)

    @property
    def segments(self) -> int:
        """Number of pieces between events, breakpoints of the inputs and horizons of the tables."""
        return int(self.motion.time.size)

    def samples(self, count: int) -> Floats:
        """(count, K) at equal steps from the beginning of the part; the end would be the next."""
        m = self.motion
        return m.sample_table(m.time[0] + np.arange(count) * ((m.end - m.time[0]) / count), self.table)

    def at_end(self) -> Floats:
        """(K,) at the end of the part."""
        return np.asarray(self.motion.sample_table(np.array([self.motion.end]), self.table)[0])

    @cached_property
    def mean_squares(self) -> Floats:
        """(K,) mean of the square, nothing left out; without powers of time."""
        m, count = self.motion, self.table.shape[2]
        squares = np.zeros(count)
        for number in visited_states(m.state):  # sums of products of terms serve all outputs
            state, segments = m.flow.states[number], np.flatnonzero(m.state == number)
            terms = m.outputs(state, segments, np.ones((state.term_basis.size, 1), dtype=complex))
            c = state.coefficients(self.output_of(state.phases), m.flow.sources)
            products = terms.function_products(m.equal_lengths[segments]) @ np.concatenate([c, c.conj()])
            squares += np.einsum("bk,bk->k", c, products).real
        return np.asarray(squares / (m.end - m.time[0]))

    @cached_property
    def halves(self) -> tuple[MotionPart, MotionPart]:
        """Both halves of the time."""
        begin, end = float(self.motion.time[0]), self.motion.end
        middle = begin + 0.5 * (end - begin)
        first, second = self.motion.between(begin, middle), self.motion.between(middle, end)
        return replace(self, motion=first, known={}), replace(self, motion=second, known={})

    def integrals(self, omega: Floats, column: int) -> Complexes:
        """Fourier integrals (W,) of one of the outputs, see `fourier_integrals`; omega (W,) in rad/s.

        Without powers of time one sum over the segments serves all outputs, which mostly ask for the same frequencies.
        """
        if not self.motion.exponentials:
            return np.asarray(fourier_integrals(self.motion, self.table[:, :, column : column + 1], omega)[0])
        if missing := [w for w in dict.fromkeys(omega.tolist()) if w not in self.known]:
            found = fourier_integrals(self.motion, self.table, np.array(missing))
            self.known.update(zip(missing, found.T, strict=True))
        return np.array([self.known[w][column] for w in omega.tolist()])


def fourier_integrals(motion: Trajectory, table: Complexes, omega: Floats) -> Complexes:
    r"""Fourier integrals of outputs over a motion.

    Parameters
    ----------
    motion : of contact states that are all kept.
    table : (S, T, K) coefficients of the outputs.
    omega : (W,) rad/s.

    Returns
    -------
    (K, W) :math:`\int x(t) e^{-i \omega (t - t_0)} dt`, :math:`t_0` being the start of the motion.
    """
    out = np.zeros((table.shape[2], omega.size), dtype=complex)
    # 2_000_000: which bounds the memory
    columns = max(2_000_000 // max(motion.segments, 1), 1)
    for number in visited_states(motion.state):
        state, segments = motion.flow.states[number], np.flatnonzero(motion.state == number)
        coefficients, elapsed = table[number, : state.term_basis.size], motion.time[segments] - motion.time[0]
        alone = np.ones((coefficients.shape[0], 1), dtype=complex)  # sums of the terms serve all outputs
        functions = motion.outputs(state, segments, alone if state.exponential else coefficients)
        both = functions.with_conjugates()
        for first in range(0, omega.size, columns):
            part = slice(first, first + columns)
            turned = np.exp(np.multiply.outer(elapsed, -1j * omega[part]))
            sums = both.fourier_sums(motion.equal_lengths[segments], omega[part], turned)
            if state.exponential:
                out[:, part] += np.concatenate([coefficients, coefficients.conj()]).T @ sums[:, 0]
            else:
                out[:, part] += sums.sum(axis=0)
    return out
