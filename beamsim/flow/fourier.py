"""Fourier analysis of a computed motion in closed form: integrals at given frequencies, samples for a curve."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.folding import folded_by_products
from beamsim.flow.stopping import check_stop
from beamsim.flow.term_integrals import summed_integrals
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Complexes, Floats

EXPONENTIALS_A_CALL = 2_000_000  # of a kernel; about a tenth of a second
FEWEST_FREQUENCIES = 64  # of a call, where one segment has many basis functions


def part_of(trajectory: Trajectory, begin: float, end: float) -> Trajectory:
    """The motion from ``begin`` to ``end`` (s, within the trajectory), its segments cut there; events are left out."""
    inside = (trajectory.time + trajectory.length > begin) & (trajectory.time < end)
    time, y = trajectory.time[inside].copy(), trajectory.y[inside].copy()
    stop = np.minimum(trajectory.time[inside] + trajectory.length[inside], end)
    if time.size and time[0] < begin:
        time[0], y[0] = begin, trajectory.states_at(np.array([begin]))[0]
    none = np.zeros(0, dtype=np.int64)
    return replace(
        trajectory, end=end, time=time, length=stop - time, state=trajectory.state[inside],
        piece=trajectory.piece[inside], y=y, event_time=np.zeros(0), event_contact=none, event_phase=none,
    )  # fmt: skip


@dataclass(frozen=True)
class MotionPart:
    """Outputs on a part of a motion, of which one or more are analysed.

    Free oscillations above ``cut`` (rad/s) are left out of the samples and integrals: they would fold, and the
    vectors that a reduction adds for static deflections have such frequencies without a meaning.

    Parameters
    ----------
    motion : cut to the part, see `part_of`.
    table : (S, T, k) coefficients of the outputs; ``dropped`` those of the terms that are left out.
    whole : the part with further outputs of which this is number ``index``: bounds are worked out for all of them.
    """

    motion: Trajectory
    table: Complexes
    dropped: Complexes
    whole: MotionPart | None = None
    index: int = 0
    bounds: dict[tuple[float, float, bool], Floats] = field(default_factory=dict)  # known so far, see `folded`
    # (k,) by frequency, rad/s, of those asked for; see `integrals`
    transforms: dict[float, Complexes | None] = field(default_factory=dict)

    @classmethod
    def of(cls, trajectory: Trajectory, output_of: OutputOf, begin: float, end: float, cut: float) -> MotionPart:
        """The outputs between two times."""
        part = part_of(trajectory, begin, end).held()
        flow = part.flow
        table = flow.output_table(output_of)
        high = np.zeros(table.shape[:2], dtype=bool)
        for s, state in enumerate(flow.states):
            free = state.term_source >= flow.sources.count
            fast = np.abs(state.exponent.imag[state.term_basis]) > cut
            high[s, : free.size] = free & fast & (state.power[state.term_basis] == 0)
        dropped = np.zeros(table.shape, dtype=complex)
        dropped[high], table[high] = table[high], 0.0
        return cls(part, table, dropped)

    def one(self, index: int) -> MotionPart:
        """The output with this number alone."""
        column = slice(index, index + 1)
        return replace(
            self, table=self.table[:, :, column], dropped=self.dropped[:, :, column], whole=self, index=index
        )  # fmt: skip

    def between(self, begin: float, end: float) -> MotionPart:
        """A shorter part."""
        return replace(self, motion=part_of(self.motion, begin, end), whole=None, bounds={}, transforms={})

    @property
    def segments(self) -> int:
        """Number of pieces between events, breakpoints of the inputs and horizons of the tables."""
        return int(self.motion.time.size)

    @property
    def work(self) -> int:
        """Segments times terms times outputs, of all outputs that are worked out together."""
        return self.segments * (self.whole or self)._terms

    def samples(self, count: int) -> Floats:
        """(count, k) at equal steps from the beginning of the part; the end would be the next."""
        m = self.motion
        return m.sample_table(m.time[0] + np.arange(count) * ((m.end - m.time[0]) / count), self.table)

    def at_end(self) -> Floats:
        """(k,) at the end of the part."""
        return np.asarray(self.motion.sample_table(np.array([self.motion.end]), self.table)[0])

    def mean_squares(self) -> Floats | None:
        """(k,) mean of the square, nothing left out; None where the motion holds powers of time."""
        if self.whole is not None:
            squares = self.whole.mean_squares()
            return None if squares is None else squares[self.index : self.index + 1]
        return self._mean_squares

    @cached_property
    def _mean_squares(self) -> Floats | None:
        m = self.motion
        if not m.exponentials:
            return None
        return np.asarray(m.square_integrals(self.table, self.dropped) / (m.end - m.time[0]))

    def integrals(self, omega: Floats) -> Complexes:
        r"""(k, W) :math:`\int x(t) e^{-i \omega (t - t_0)} dt` over the part, t_0 its beginning; omega in rad/s.

        They are worked out for all outputs at once: of motions with powers of time, whose cost grows with the outputs,
        when a second output asks for the same frequencies.
        """
        if self.whole is None:
            return self._integrals(omega)
        known, asked = self.whole.transforms, omega.tolist()
        if not all(w in known for w in asked) and not self.motion.exponentials:
            known.update(dict.fromkeys(asked))
            return self._integrals(omega)
        missing = [w for w in dict.fromkeys(asked) if known.get(w) is None]
        if missing:
            known.update(zip(missing, self.whole._integrals(np.array(missing)).T, strict=True))
        return np.array([[known[w][self.index] for w in asked]])  # type: ignore[index]

    def _integrals(self, omega: Floats) -> Complexes:
        """The same of the outputs of this part alone."""
        if self.motion.exponentials:
            return self._by_products(omega)
        from beamsim.flow.fourier_kernels import fourier_integrals

        m, out = self.motion, np.zeros((self.table.shape[2], omega.size), dtype=complex)
        table = np.ascontiguousarray(self.table)
        logged = (m.flow.tables(), m.flow.inputs(), table, m.time, m.length, m.state, m.piece, m.y)
        columns = max(EXPONENTIALS_A_CALL // self._terms, FEWEST_FREQUENCIES)
        for begin in range(0, omega.size, columns):
            some = np.ascontiguousarray(omega[begin : begin + columns])
            part = np.zeros((out.shape[0], some.size), dtype=complex)
            for first, last in self._ranges(m.time.size, some.size):
                fourier_integrals(*logged, some, first, last, part)
            out[:, begin : begin + columns] = part
        return out

    def _by_products(self, omega: Floats) -> Complexes:
        """The same without powers of time: sums over all segments of one contact state are products of matrices."""
        m, out = self.motion, np.zeros((self.table.shape[2], omega.size), dtype=complex)
        elapsed = (np.append(m.time, m.time[-1:] + m.length[-1:]) - m.time[0])[:, None]
        columns = max(EXPONENTIALS_A_CALL // elapsed.size, FEWEST_FREQUENCIES)
        for first in range(0, omega.size, columns):
            part = slice(first, first + columns)
            turned = np.exp(-1j * omega[part] * elapsed)
            for number in np.unique(m.state):
                check_stop()
                state, segments = m.flow.states[number], np.flatnonzero(m.state == number)
                exponent = state.exponent[state.term_basis]
                begin, length = m.amplitudes(state, segments), m.length[segments]
                end = begin * np.exp(length[:, None] * exponent)
                sides = turned[segments], turned[segments + 1], length
                of_terms = summed_integrals(exponent, begin, end, omega[part], *sides)
                conjugate = summed_integrals(exponent.conj(), begin.conj(), end.conj(), omega[part], *sides)
                c = self.table[number, : exponent.size].T
                out[:, part] += 0.5 * (c @ of_terms + c.conj() @ conjugate)
        return out

    @property
    def _terms(self) -> int:
        """Basis functions of a segment times outputs."""
        return int(self.motion.flow.tables().exponent.shape[1] * self.table.shape[2])

    def _ranges(self, count: int, frequencies: int) -> Iterator[tuple[int, int]]:
        """Numbers 0 to ``count`` in parts for a call each, with a check before each."""
        rows = max(EXPONENTIALS_A_CALL // (self._terms * frequencies), 1)
        for first in range(0, count, rows):
            check_stop()
            yield first, min(first + rows, count)

    def folded(self, step: float, reach: float, *, open_ends: bool) -> Floats:
        """(k,) bound on the difference between Fourier sums of samples and `integrals`, and on what is left out.

        Parameters
        ----------
        step : s, between samples.
        reach : rad/s, highest angular frequency for which it holds; below the ``cut`` of the part.
        open_ends : whether the window of the analysis is not zero at both ends.
        """
        if self.whole is not None:
            return self.whole.folded(step, reach, open_ends=open_ends)[self.index : self.index + 1]
        known = (step, reach, open_ends)
        if known not in self.bounds:
            self.bounds[known] = self._folded(*known)
        return self.bounds[known]

    def _folded(self, step: float, reach: float, open_ends: bool) -> Floats:
        return folded_by_products(self.motion, self.table, self.dropped, step, reach, open_ends)
