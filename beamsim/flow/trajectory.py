"""A computed motion: what happened between the events, from which every output follows exactly."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import ContactState, OutputOf
from beamsim.flow.equal_pieces import FEWEST, integrals_alike, many_pieces, sample_alike
from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import Extrema, Search, Waves, turning_points
from beamsim.flow.moments import weighted_moments
from beamsim.flow.quadratic_forms import forms
from beamsim.flow.state_tables import pad, visited_states
from beamsim.flow.stopping import check_stop
from beamsim.flow.term_integrals import AT_ONCE, IntegratedForm, products_on_segments, summed_products
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.typing import Bools, Complexes, Floats, Ints

LARGEST = 1e50  # of a state; where it is larger, extremes are searched for in another unit
EVEN = 16  # samples, from which on equal steps are exploited
WORK_A_CALL = 20_000_000  # of a kernel, in products; about a tenth of a second
FEW_EVEN = 4096  # samples at equal steps, up to which exponentials of each cost no more than making use of the steps
MOST_EVEN = 2**16  # ... up to which products of matrices do, and the kernel for them need not be compiled
EVEN_A_SEGMENT = 16  # ... on the average of the segments, or of outputs, at least
FEW_TIMES = 8  # for each contact state, below which no tables of outputs are made to sample them
VALUES_A_CALL = 20_000_000  # of terms times outputs, in sampling
# Gauss-Legendre rules for products of two outputs: points, and how far the fastest motion may turn on a panel, rad; the
# rule's error on exp(i 2 turn t), the product's fastest part, is then below 2e-13
GAUSS_RULES = ((8, 2.0), (12, 5.75), (20, 15.25))


class TurningPoints(NamedTuple):
    """Values at both ends of segments (limits from within) and at the maxima and minima between them, in order."""

    segment: Ints  # (n,)
    time: Floats  # (n,) s
    value: Floats  # (n,)


@dataclass(frozen=True)
class Trajectory:
    """Segments of closed-form motion in order of time."""

    flow: ExactFlow
    end: float  # s, reached
    time: Floats  # (S,) start of each segment, s
    length: Floats  # (S,) s
    state: Ints  # (S,) contact state, among those that the flow visited
    piece: Ints  # (S,) of the sources
    y: Floats  # (S, N) at the start
    event_time: Floats  # (E,) s
    event_contact: Ints  # (E,)
    event_phase: Ints  # (E,) of the contact after the event
    final_y: Floats  # (N,)
    evaluations: int
    outcome: Outcome
    processor_time_s: float

    @property
    def segments(self) -> int:
        """S, between events, breakpoints of the inputs and horizons."""
        return int(self.time.size)

    @cached_property
    def touch_changes(self) -> Ints:
        """(E,) 1 where contact is made, -1 where it ends, 0 at other changes of phase."""
        return self.flow.system.contacts.touch_changes(
            self.phases_of(self.state[:1]).reshape(-1), self.event_time, self.event_contact, self.event_phase
        )

    @property
    def event_closing(self) -> Bools:
        """(E,) whether contact is made at the event."""
        return np.asarray(self.touch_changes > 0)

    def up_to_finite(self) -> Trajectory:
        """The motion up to the first segment that does not start from finite numbers, with an outcome that says so."""
        finite = np.append(np.all(np.isfinite(self.y), axis=1), np.all(np.isfinite(self.final_y)))
        kept = max(int(np.argmin(finite)) - 1, 0)  # its end is where the next one starts
        if finite[-1] and finite.all():
            return self
        end = float(self.time[kept])
        before = self.event_time < end
        kept_segments = slice(0, max(kept, 1))
        return replace(
            self,
            end=end,
            time=self.time[kept_segments], length=self.length[kept_segments] * (kept > 0),
            state=self.state[kept_segments], piece=self.piece[kept_segments], y=self.y[kept_segments],
            event_time=self.event_time[before], event_contact=self.event_contact[before],
            event_phase=self.event_phase[before],
            final_y=self.y[kept],
            outcome=Outcome.of(OutcomeCode.NOT_FINITE, time=end),
        )  # fmt: skip

    def sample(self, times: Floats, output_of: OutputOf) -> Floats:
        """Outputs (nt, k) at increasing times; at an event the state after it counts."""
        if not self.flow.dropped:
            if times.size < FEW_TIMES * len(self.flow.states):
                return self._sample_few(times, output_of)
            return self.sample_table(times, self.flow.output_table(output_of))
        parts, first = [], 0
        for part in self.parts():
            last = times.size if part.end >= self.end else int(np.searchsorted(times, part.end))
            parts.append(part.sample_table(times[first:last], part.flow.output_table(output_of)))
            first = last
        return np.concatenate(parts)

    def _sample_few(self, times: Floats, output_of: OutputOf) -> Floats:
        """The same from the states at these times, which are fewer than a table of each contact state pays for."""
        sources, segment = self.flow.sources, np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, None)
        out = np.empty((times.size, output_of(self.flow.states[0].phases).row.shape[0]))
        for number in np.unique(self.state[segment]):
            check_stop()
            state, at = self.flow.states[number], np.flatnonzero(self.state[segment] == number)
            begun, tau = segment[at], times[at] - self.time[segment[at]]
            given = sources.amplitudes_at(self.time[begun], self.piece[begun])
            y = self.y[begun]
            if tau.any():  # not where segments begin, as at events
                y = state.states_after(state.amplitudes(given, y), tau)
            out[at] = output_of(state.phases).values(y, *sources.values_after(given, tau))
        return out

    def sample_table(self, times: Floats, table: Complexes) -> Floats:
        """The same from the coefficients (S, T, k) of the outputs, all states being kept."""
        out = np.empty((times.size, table.shape[2]))
        if times.size < FEWEST or not many_pieces(self):
            self._sample(times, table, out)
            return out
        single = sample_alike(self, times, table, out)
        others = np.empty((single.size, table.shape[2]))
        self._sample(times[single], table, others)
        out[single] = others
        return out

    def _sample(self, times: Floats, table: Complexes, out: Floats) -> None:
        from beamsim.flow.march_kernels import sample, sample_evenly

        if not times.size:
            return
        in_a_row = np.ascontiguousarray(times)  # the kernels are compiled for these alone
        step = float(times[-1] - times[0]) / (times.size - 1) if times.size >= EVEN else 0.0
        even = times[0] + step * np.arange(times.size) if step > 0.0 else times[:0]
        evenly = even.size > 0 and np.abs(times - even).max() <= 4.0 * np.finfo(float).eps * abs(times[-1])
        if self.exponentials and (not evenly or times.size <= FEW_EVEN):
            return self._sample_by_products(times, table, out)
        spacious = EVEN_A_SEGMENT * self.segments <= times.size or table.shape[2] >= EVEN_A_SEGMENT
        if self.exponentials and spacious and times.size <= MOST_EVEN:
            return self._sample_equal_steps(times, step, table, out)
        rows = max(1, VALUES_A_CALL // max(table.shape[1] * table.shape[2], 1))
        for first in range(0, times.size, rows):
            check_stop()
            part = slice(first, first + rows)
            logged = (self.time, self.state, self.piece, self.y, in_a_row[part])
            if evenly:
                sample_evenly(self.flow.tables(), self.flow.inputs(), table, *logged, step, out[part])
            else:
                sample(*self.flow.kernel_arguments(), table, *logged, out[part])

    def _sample_by_products(self, times: Floats, table: Complexes, out: Floats) -> None:
        """Outputs at any times into ``out`` (nt, k), without powers of time."""
        segment = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, None)
        of_time = self.state[segment]
        for number in np.unique(of_time):
            state, entries = self.flow.states[number], np.flatnonzero(of_time == number)
            exponent = state.exponent[state.term_basis]
            rows = max(1, VALUES_A_CALL // max(exponent.size, table.shape[2], 1))
            for first in range(0, entries.size, rows):
                check_stop()
                part = entries[first : first + rows]
                visits, at = np.unique(segment[part], return_inverse=True)
                tau = times[part] - self.time[segment[part]]
                begun = self.amplitudes(state, visits)
                acts = begun.any(axis=0)  # what rests may grow without bound
                terms = begun[:, acts][at] * np.exp(tau[:, None] * exponent[acts])
                out[part] = (terms @ table[number, : exponent.size][acts]).real

    def _sample_equal_steps(self, times: Floats, step: float, table: Complexes, out: Floats) -> None:
        """The same with equal steps, whose exponentials all segments of a contact state share."""
        first = np.append(np.searchsorted(times, self.time[1:]), times.size)  # of the next segment
        begin = np.concatenate([[0], first[:-1]])
        for number in np.unique(self.state):
            check_stop()
            state, segments = self.flow.states[number], np.flatnonzero((self.state == number) & (first > begin))
            if not segments.size:
                continue
            begun = self.amplitudes(state, segments)
            acts = begun.any(axis=0)  # what rests may grow without bound
            exponent = state.exponent[state.term_basis][acts]
            counts = (first - begin)[segments]
            turned = np.exp(step * np.arange(int(counts.max()))[:, None] * exponent)
            tau = times[begin[segments]] - self.time[segments]
            terms = begun[:, acts] * np.exp(tau[:, None] * exponent)
            of_terms = table[number, : acts.size][acts]
            if out.shape[1] * segments.size > counts.sum():  # coefficients of each segment would cost more than samples
                which = np.repeat(np.arange(segments.size), counts)
                at = np.arange(which.size) - np.repeat(np.cumsum(counts) - counts, counts)
                samples = terms[which] * turned[at]
                out[begin[segments][which] + at] = samples.view(float) @ _real_parts(of_terms)
                continue
            for segment, amplitude in zip(segments.tolist(), terms, strict=True):
                parts = _real_parts(amplitude[:, None] * of_terms)
                steps = turned[: first[segment] - begin[segment]].view(float)
                np.matmul(steps, parts, out=out[begin[segment] : first[segment]])

    def states_at(self, times: Floats) -> Floats:
        """(nt, N) the state: (q, q') and the contacts' internal states."""
        output = self.flow.empty_output(self.flow.size)
        output.row[:] = np.eye(self.flow.size)
        return self.sample(times, lambda phases: output)

    def phases_at(self, times: Floats) -> Ints:
        """(nt, m) phases of the contacts."""
        segment = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, None)
        return self.phases_of(self.state[segment])

    def phases_of(self, states: Ints) -> Ints:
        """(..., m) phases of the contacts in contact states."""
        return self._phases[states]

    def event_losses(self) -> Floats:
        """(S, m) energy that a contact loses at once where each segment begins, J; none where the first does."""
        contacts, phases = self.flow.system.contacts, self.phases_of(self.state)
        before = np.concatenate([phases[:1], phases[:-1]])
        losses = contacts.event_losses(before, phases)
        if contacts.pressed.size:
            normal = self.sample(self.time, self.flow.pressing_forces)
            losses[:, contacts.pressed] += contacts.pressing_losses(before, phases) * normal**2
        return losses

    def until(self, end: float) -> Trajectory:
        """The motion up to a time."""
        kept = max(1, int(np.searchsorted(self.time, end)))
        early = self.event_time < end
        return replace(
            self, end=min(end, self.end), time=self.time[:kept], state=self.state[:kept], piece=self.piece[:kept],
            length=np.clip(end - self.time[:kept], 0.0, self.length[:kept]), y=self.y[:kept],
            event_time=self.event_time[early], event_contact=self.event_contact[early],
            event_phase=self.event_phase[early], final_y=self.states_at(np.array([min(end, self.end)]))[0],
        )  # fmt: skip

    def within(self, begin: float, end: float) -> Trajectory:
        """The segments of a part of the motion; the first begins at or before ``begin``, the last ends at ``end``."""
        first = max(int(np.searchsorted(self.time, begin, side="right")) - 1, 0)
        last = max(int(np.searchsorted(self.time, end, side="right")), first + 1)
        part = slice(first, last)
        length = self.length[part].copy()
        length[-1] = min(length[-1], max(end - float(self.time[last - 1]), 0.0))
        return replace(
            self, end=min(end, self.end), time=self.time[part], length=length, state=self.state[part],
            piece=self.piece[part], y=self.y[part],
        )  # fmt: skip

    def between(self, begin: float, end: float) -> Trajectory:
        """The same, whose first segment begins at ``begin``."""
        part = self.within(begin, end)
        late = max(begin - float(part.time[0]), 0.0)
        time, length, y = part.time.copy(), part.length.copy(), part.y.copy()
        time[0], length[0], y[0] = time[0] + late, max(length[0] - late, 0.0), self.states_at(np.array([begin]))[0]
        return replace(part, time=time, length=length, y=y)

    @property
    def _phases(self) -> Ints:
        """(states, m)."""
        return np.array(self.flow.visited, dtype=np.int64).reshape(len(self.flow.visited), -1)

    def parts(self) -> Iterator[Trajectory]:
        """One after the other, with no more states each than the flow keeps at once; their flows hold these alone."""
        if not self.flow.dropped:
            yield self
            return
        most, first = self.flow.most_states or 1, 0
        while first < self.state.size:
            known: set[int] = set()
            last = first
            while last < self.state.size and (len(known) < most or int(self.state[last]) in known):
                known.add(int(self.state[last]))
                last += 1
            yield self._holding(slice(first, last))
            first = last

    def held(self) -> Trajectory:
        """The same with a flow that keeps all its states, whatever their number."""
        return self._holding(slice(0, self.state.size)) if self.flow.dropped else self

    def _holding(self, segments: slice) -> Trajectory:
        visited, state = np.unique(self.state[segments], return_inverse=True)
        last = segments.stop >= self.state.size
        return replace(
            self, flow=self.flow.holding(visited), state=state, time=self.time[segments], length=self.length[segments],
            piece=self.piece[segments], y=self.y[segments], end=self.end if last else float(self.time[segments.stop]),
            final_y=self.final_y if last else self.y[segments.stop],
        )  # fmt: skip

    def only(self, segments: Ints) -> Trajectory:
        """Some of the segments, in order; times are those of the whole motion."""
        return replace(
            self, time=self.time[segments], length=self.length[segments], state=self.state[segments],
            piece=self.piece[segments], y=self.y[segments],
        )  # fmt: skip

    def contact_share(self) -> Floats:
        """(m,) share of the time during which each contact touches."""
        flags = self.flow.system.contacts.touching(self._phases)
        total = float(self.length.sum())
        return np.asarray(self.length @ flags[self.state] / total) if total > 0 else np.zeros(flags.shape[1])

    @property
    def lasting(self) -> Trajectory:
        """The segments that last where contacts may hold, all where none does. In the others a face would have to stick
        with more than it can: it lets go at the same instant, and that force is not reached."""
        lasts = self.length > 0.0
        if not self.flow.system.contacts.ever_hold or lasts.all() or not lasts.any():
            return self
        return self.only(np.flatnonzero(lasts))

    def extrema(
        self, output_of: OutputOf, edges: Floats | None = None, share: Ints | None = None, squares: Ints | None = None
    ) -> Extrema:
        """Smallest and largest values of K outputs over the continuous motion, with their times.

        They are reached, limits from within at both ends of a segment included, and certified to 1e-10 of their size.

        Parameters
        ----------
        output_of : the outputs, by the phases of the contacts.
        edges : (W + 1,) s, increasing: the extremes between each two of them, (W, K) in place of (K,). Where there is
            no motion they are infinite. All are searched together, so that there may be very many, such as the
            cycles of a sweep.
        share : (K,) of outputs with equal numbers only the smallest and the largest value of all is sought; the others
            keep values that they reach.
        squares : (j,) first of each group of consecutive outputs, where half the sums of their squares are asked for:
            j of them in place of K.

        Returns
        -------
        Values in the units of the outputs (K,) or (W, K), and times, s.

        Raises
        ------
        Stopped
            Where a stop is requested.
        """
        outputs = output_of(self.flow.system.contacts.start).row.shape[0]
        largest = max(float(np.abs(self.y).max(initial=0.0)), float(np.abs(self.final_y).max(initial=0.0)))
        scale = 2.0 ** max(0.0, np.ceil(np.log2(largest / LARGEST))) if largest > LARGEST else 1.0
        search = Search.of(outputs, 1 if edges is None else edges.size - 1, share, squares)
        for part in self.lasting.parts():
            search.add(part._waves(output_of, edges, scale))
        found = search.extrema()
        unit = scale if squares is None else scale**2
        low, high = unit * found.low, unit * found.high
        if edges is None:
            return Extrema(low[0], found.when_low[0], high[0], found.when_high[0], found.evaluations)
        return replace(found, low=low, high=high)

    def turning_points(self, output_of: OutputOf, segments: Ints) -> TurningPoints:
        """All maxima and minima of one output, certified to 1e-10 of its largest value, and its values at the ends.

        Parameters
        ----------
        output_of : the output, by the phases of the contacts.
        segments : increasing numbers of those that are looked at.

        Raises
        ------
        Stopped
            Where a stop is requested.
        """
        found = [(segments[:0], segments[:0], np.zeros(0), np.zeros(0))]  # segment, order in it, time, value
        first = 0
        for part in self.parts():
            last = first + part.time.size
            inside = segments[(segments >= first) & (segments < last)]
            if inside.size:
                some = part.only(inside - first)
                waves = some._waves(output_of, None, 1.0)
                of_wave = [inside[some.state == number] for number in visited_states(some.state)]
                wave, row, time, value = turning_points(waves)
                starts = np.cumsum([0, *(each.size for each in of_wave)])[:-1]
                found.append((np.concatenate(of_wave)[starts[wave] + row], np.ones_like(row), time, value))
                for owner, of in zip(of_wave, waves, strict=True):
                    begin, end = of.at_ends().T
                    found.append((owner, np.zeros_like(owner), of.time, begin))
                    found.append((owner, np.full_like(owner, 2), of.time + of.length, end))
            first = last
        segment, place, time, value = (np.concatenate([part[k] for part in found]) for k in range(4))
        order = np.lexsort((time, place, segment))
        return TurningPoints(segment[order], time[order], value[order])

    def _waves(self, output_of: OutputOf, edges: Floats | None, scale: float) -> list[Waves]:
        """What is searched, by contact state."""
        segment, begin, end, window = self._cut(edges)
        of_state, waves = self.state[segment], []
        for number in visited_states(of_state):
            state, parts = self.flow.states[number], np.flatnonzero(of_state == number)

            def amplitude(rows: Ints, of: Ints = segment[parts], state: ContactState = state) -> Complexes:
                given = self.flow.sources.amplitudes_at(self.time[of[rows]], self.piece[of[rows]])
                return state.amplitudes(given, self.y[of[rows]]) / scale

            table = state.coefficients(output_of(state.phases), self.flow.sources)
            waves.append(Waves(
                state.exponent, state.power, state.term_basis, state.term_source, table, amplitude,
                self.time[segment[parts]], self.length[segment[parts]], begin[parts], end[parts], window[parts],
            ))  # fmt: skip
        return waves

    def _cut(self, edges: Floats | None) -> tuple[Ints, Floats, Floats, Ints]:
        """Parts (n,) of segments between edges: the segment, begin and end as shares of it, and between which edges."""
        count = self.time.size
        if edges is None:
            return np.arange(count), np.zeros(count), np.ones(count), np.zeros(count, dtype=np.int64)
        stop = self.time + self.length
        first = np.searchsorted(edges, self.time, side="right") - 1
        last = np.maximum(np.searchsorted(edges, stop, side="left"), first + 1)
        segment: Ints = np.repeat(np.arange(count), last - first)
        begun = np.cumsum(last - first) - last
        window: Ints = np.arange(segment.size) - begun[segment]
        inside = (window >= 0) & (window < edges.size - 1)
        segment, window = segment[inside], window[inside]
        length = np.where(self.length > 0.0, self.length, 1.0)[segment]
        begin = np.clip((edges[window] - self.time[segment]) / length, 0.0, 1.0)
        end = np.clip((edges[window + 1] - self.time[segment]) / length, 0.0, 1.0)
        end = np.where(stop[segment] <= edges[window + 1], 1.0, end)
        apart = 4.0 * np.finfo(float).eps * np.abs(stop[segment]) / length  # less is round-off of an edge
        kept = (end - begin > apart) | ((begin == 0.0) & (end == 1.0))
        return segment[kept], begin[kept], end[kept], window[kept]

    def product_integrals(
        self,
        times: Floats,
        left_of: OutputOf,
        right_of: OutputOf,
        weight: Floats,
        begin: float = 0.0,
    ) -> Floats:
        """(nt, Q) integrals from ``begin`` to ``times`` of ``sum_k weight[k, q] left_k right_k``.

        In closed form; where powers of time are long and the times close together (sampled inputs), by
        Gauss-Legendre panels short against the motion.
        """
        parts: list[Floats] = []
        first, before = 0, np.zeros(weight.shape[1])
        for part in self.parts():
            table = np.concatenate([part.flow.output_table(left_of), part.flow.output_table(right_of)], axis=2)
            last = times.size if part.end >= self.end else int(np.searchsorted(times, part.end))
            ends = times[first:last] if last == times.size else np.append(times[first:last], part.end)
            after = 0.0 if parts else begin - float(part.time[0])
            integrals = before + part.integrals(ends, table, weight, after)
            parts.append(integrals[: last - first])
            first = last
            if last < times.size:
                before = integrals[-1]
        return np.concatenate(parts)

    def integrals(self, times: Floats, table: Complexes, weight: Floats, after: float = 0.0) -> Floats:
        """The same of outputs in a table (S, T, 2 K), the left factors first, from ``after`` the first segment began.

        Times must not lie before that.
        """
        if not (self.exponentials or many_pieces(self)):
            return self._integrals(times, table, weight, after)
        if after > 0.0:
            since = self.integrals(np.append(self.time[0] + after, times), table, weight)
            return np.asarray(since[1:] - since[0])
        sums = np.cumsum(self.segment_integrals(table, weight).astype(np.longdouble), axis=0)
        before = np.vstack([np.zeros(weight.shape[1]), sums]).astype(float)
        segment = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, None)
        tau = np.minimum(times - self.time[segment], self.length[segment])
        out = np.empty((times.size, weight.shape[1]))
        single = self._by_products(segment, tau, table, weight, out)
        if single.size:
            few, number = np.unique(segment[single], return_inverse=True)
            starts = self.time[few]
            inside = _not_beyond(times[single], starts[number], self.length[few][number])
            at = np.sort(np.concatenate([starts, inside]))
            values = self.only(few)._integrals(at, table, weight)
            out[single] = values[np.searchsorted(at, inside)] - values[np.searchsorted(at, starts)][number]
        return np.asarray(out + before[segment])

    def segment_integrals(self, table: Complexes, weight: Floats) -> Floats:
        """(S, Q) integrals over each segment of outputs in a table, see `integrals`."""
        out = np.empty((self.time.size, weight.shape[1]))
        single = self._by_products(np.arange(self.time.size), self.length, table, weight, out)
        if single.size:
            few = self.only(single)
            ends = _not_beyond(few.time + few.length, few.time, few.length)
            out[single] = np.diff(few._integrals(ends, table, weight), axis=0, prepend=0.0)
        return out

    @property
    def exponentials(self) -> bool:
        """Whether no term of the motion has a power of time."""
        return all(state.exponential for state in self.flow.states)

    def _by_products(self, segment: Ints, tau: Floats, table: Complexes, weight: Floats, out: Floats) -> Ints:
        """Integrals over the first tau of segments into ``out`` (nt, Q); returns the entries outside of groups."""
        if not self.exponentials:
            every = np.arange(tau.size)
            return integrals_alike(self, segment, tau, table, weight, out) if many_pieces(self) else every
        of_entry = self.state[segment]
        for number in visited_states(of_entry):
            state, entries = self.flow.states[number], np.flatnonzero(of_entry == number)
            visits = segment[entries]
            if np.all(visits[1:] > visits[:-1]):  # whole segments, one after the other
                at = np.arange(visits.size)
            else:
                visits, at = np.unique(visits, return_inverse=True)
            begin = self.amplitudes(state, visits)
            factors = table[number, : state.term_basis.size]
            left, right = factors[:, : weight.shape[0]], factors[:, weight.shape[0] :]
            acting = left.any(axis=0) & right.any(axis=0)  # open contacts have no force
            columns = ((acting & (w != 0.0)).nonzero()[0] for w in weight.T)
            of_sums = [forms([(left[:, c] * w[c], right[:, c])]) for c, w in zip(columns, weight.T, strict=True)]
            longest = float(tau[entries].max())
            form = IntegratedForm.of(state.exponent[state.term_basis], np.stack(of_sums, axis=1), longest)
            out[entries] = form(begin, at, tau[entries])
        return np.zeros(0, dtype=np.int64)

    def work_of_segments(self, left_of: OutputOf, right_of: OutputOf, weight: Floats) -> Floats:
        """(S, Q) integrals over each segment of ``sum_k weight[k, q] left_k right_k``.

        Without powers of time coefficients are worked out one contact state after the other, once where both factors
        are equal, and not of products that are zero, as those of open contacts are.
        """
        if not self.exponentials:
            table = self.flow.output_table(lambda phases: left_of(phases).above(right_of(phases)))
            return self.segment_integrals(table, weight)
        out, sources = np.empty((self.time.size, weight.shape[1])), self.flow.sources
        for number in visited_states(self.state):
            state, segments = self.flow.states[number], np.flatnonzero(self.state == number)
            left, right = left_of(state.phases), right_of(state.phases)
            acting = (left.acts & right.acts).nonzero()[0]
            left, right = left.some(acting), right.some(acting)
            of_left = of_right = state.coefficients(left, sources)
            other = (~left.equal(right)).nonzero()[0]
            if other.size:
                of_right = of_left.copy()
                of_right[:, other] = state.coefficients(right.some(other), sources)
            products = [(w, w.nonzero()[0]) for w in weight[acting].T]
            factors = [(of_left[:, c] * w[c], of_right[:, c]) for w, c in products]
            for first in range(0, segments.size, AT_ONCE):
                check_stop()
                some = segments[first : first + AT_ONCE]
                motion = state.exponent[state.term_basis], self.amplitudes(state, some), self.length[some]
                for q, (one, two) in enumerate(factors):
                    out[some, q] = products_on_segments(*motion, one, two)
        return out

    def amplitudes(self, state: ContactState, segments: Ints) -> Complexes:
        """(n, T) amplitudes of the terms where segments of one contact state begin; without powers of time."""
        given = self.flow.sources.amplitudes_at(self.time[segments], self.piece[segments])
        return state.amplitudes(given, self.y[segments])[:, state.term_source]

    def weighted_integrals(self, output_of: OutputOf, exponent: Complexes, polynomial: Complexes) -> Complexes:
        r"""Integrals of K outputs times W polynomials and exponentials of their own, over each segment.

        Parameters
        ----------
        output_of : outputs x.
        exponent : (W, S) :math:`\nu`, 1/s.
        polynomial : (W, S, D) coefficients of P, the lowest first, of the time since the segment began.

        Returns
        -------
        (W, S, K) integrals :math:`\int_0^L x(\tau) e^{\nu \tau} P(\tau) d\tau`.
        """
        outputs = output_of(self.flow.system.contacts.start).row.shape[0]
        out = np.zeros((*exponent.shape, outputs), dtype=complex)
        for number in visited_states(self.state):
            check_stop()
            state, some = self.flow.states[number], np.flatnonzero(self.state == number)
            output = output_of(state.phases)
            acting = np.flatnonzero(output.acts)  # open contacts have no force
            table = state.coefficients(output.some(acting), self.flow.sources)
            half = 0.5 * self._coefficients(state, some, table)
            rates, power = np.concatenate([state.exponent, state.exponent.conj()]), np.tile(state.power, 2)
            weights = exponent[:, some].ravel(), polynomial[:, some].reshape(-1, polynomial.shape[2])
            moments = weighted_moments(rates, power, np.tile(self.length[some], exponent.shape[0]), *weights)
            moments = moments.reshape(exponent.shape[0], some.size, rates.size).swapaxes(0, 1)
            integrals = moments @ np.hstack([half, half.conj()])
            out[np.ix_(np.arange(exponent.shape[0]), some, acting)] = integrals.swapaxes(0, 1)
        return out

    def _coefficients(self, state: ContactState, segments: Ints, table: Complexes) -> Complexes:
        """(n, B, K) of the basis functions in outputs of coefficients (T, K), on segments of one contact state."""
        given = self.flow.sources.amplitudes_at(self.time[segments], self.piece[segments])
        zeta = state.amplitudes(given, self.y[segments])
        of_unit = np.zeros((zeta.shape[1], state.exponent.size, table.shape[1]), dtype=complex)
        of_unit[state.term_source, state.term_basis] = table
        return np.asarray((zeta @ of_unit.reshape(zeta.shape[1], -1)).reshape(segments.size, *of_unit.shape[1:]))

    def square_integrals(self, *tables: Complexes) -> Floats:
        """(k,) integrals over the whole motion of the squares of outputs whose coefficients (S, T, k) are the sum of
        tables; without powers of time."""
        total = np.zeros(tables[0].shape[2])
        for number in np.unique(self.state):
            check_stop()
            state, segments = self.flow.states[number], np.flatnonzero(self.state == number)
            coefficients = sum(table[number, : state.term_basis.size] for table in tables)
            exponent = state.exponent[state.term_basis]
            sums = summed_products(exponent, self.amplitudes(state, segments), self.length[segments])
            c = np.concatenate([coefficients.real, -coefficients.imag])
            total += np.einsum("ik,ik->k", sums @ c, c)
        return total

    def _integrals(self, times: Floats, table: Complexes, weight: Floats, after: float = 0.0) -> Floats:
        from beamsim.flow.integral_kernels import product_integrals

        flow, out, weight = self.flow, np.empty((times.size, weight.shape[1])), np.ascontiguousarray(weight)
        group, degree = zip(*(_groups(s.exponent, s.power) for s in flow.states), strict=True)
        at, total, lost = np.array([0.0, 0.0, after]), np.zeros(weight.shape[1]), np.zeros(weight.shape[1])
        arguments = (
            flow.tables(), flow.inputs(), table, weight, self.time, self.length, self.state, self.piece, self.y,
            np.ascontiguousarray(times), pad(list(group)), pad(list(degree)), *_gauss_rules(), at, total, lost, out,
        )  # fmt: skip
        check_stop()
        while not product_integrals(*arguments, WORK_A_CALL):
            check_stop()
        return out


def _not_beyond(times: Floats, start: Floats, length: Floats) -> Floats:
    """Times that round-off does not put behind the ends of their segments, where there may be none."""
    return np.where(times - start > length, np.nextafter(times, start), times)


def _groups(exponent: Complexes, power: Ints) -> tuple[Ints, Ints]:
    """Group of every basis function (those of equal exponents share one), and the largest power in each group."""
    values: dict[complex, int] = {}
    group = np.array([values.setdefault(complex(e), len(values)) for e in exponent], dtype=np.int64)
    degree = np.zeros(len(values), dtype=np.int64)
    np.maximum.at(degree, group, power)
    return group, degree


def _real_parts(table: Complexes) -> Floats:
    """(2 T, k) what real and imaginary parts of terms in turn give of the real parts of outputs (T, k) of them."""
    return np.stack([table.real, -table.imag], axis=1).reshape(-1, table.shape[1])


@cache
def _gauss_rules() -> tuple[Floats, Floats, Floats]:
    """Longest panel of each rule in radians, nodes and weights (rules, points), padded with zeros."""
    most = max(points for points, _ in GAUSS_RULES)
    node, weight = np.zeros((len(GAUSS_RULES), most)), np.zeros((len(GAUSS_RULES), most))
    for r, (points, _) in enumerate(GAUSS_RULES):
        node[r, :points], weight[r, :points] = np.polynomial.legendre.leggauss(points)
    return np.array([radians for _, radians in GAUSS_RULES]), node, weight
