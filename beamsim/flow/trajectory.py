"""A computed motion: what happened between the events, from which every output follows exactly."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.contact_state import ContactState
from beamsim.flow.exact import ExactFlow, visited_states
from beamsim.flow.extrema import PARTS_AT_ONCE, Extrema, in_shares, nothing_known, search_extrema, values_in_shares
from beamsim.flow.extrema_kernels import TOLERANCE, Sums, search, variation
from beamsim.flow.moments import (
    VALUES_AT_ONCE,
    SegmentOutputs,
    blocks,
    equal_times,
    exponential_products,
    weighted_moments,
)
from beamsim.outcomes import Outcome, OutcomeKind, Where, check_stop
from beamsim.system.equations import RowsOf
from beamsim.typing import Bools, Complexes, Floats, Ints, not_none

LARGEST = 1e50  # of a state; where it is larger, extremes are searched for in another unit
SEGMENTS_AT_ONCE = 4096  # whose values at both ends are kept together
EVENT_LIMIT, NOT_FINITE = "event_limit", "not_finite"  # codes of the outcomes of motions that end early


def too_many_events(time: float, events: int) -> Outcome:
    """The outcome of a motion that has more than the largest number of contact events at a time in s."""
    sentence = f"there are more than {events} contact events"
    return Outcome.of(OutcomeKind.STOPPED, EVENT_LIMIT, sentence, at=Where(time, "s"), events=events)


def not_finite(time: float) -> Outcome:
    """The outcome of a motion that cannot be represented after a time in s."""
    return Outcome.of(
        OutcomeKind.STOPPED, NOT_FINITE, "the motion leaves the range of floating-point numbers", at=Where(time, "s"),
        remedy="check the initial motion and the size of the loads",
    )  # fmt: skip


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
    event_before: Ints  # (E,) phase of the contact before the event
    event_phase: Ints  # (E,) after it
    final_y: Floats  # (N,)
    evaluations: int  # of the guards
    outcome: Outcome

    @property
    def segments(self) -> int:
        """S, between events, breakpoints of the inputs and horizons."""
        return int(self.time.size)

    @cached_property
    def touch_changes(self) -> Ints:
        """(E,) 1 where contact is made, -1 where it ends, 0 at other changes of phase."""
        return self.flow.system.contacts.touch_changes(self.event_contact, self.event_before, self.event_phase)

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
        part = self.only(slice(0, max(kept, 1)))
        return replace(part, end=end, length=part.length * (kept > 0), final_y=self.y[kept], outcome=not_finite(end))

    def _with_events(self, which: Bools) -> Trajectory:
        return replace(
            self, event_time=self.event_time[which], event_contact=self.event_contact[which],
            event_before=self.event_before[which], event_phase=self.event_phase[which],
        )  # fmt: skip

    @classmethod
    def joined(cls, chunks: Sequence[Trajectory]) -> Trajectory:
        """Consecutive chunks of a motion under a record, each in a flow on its pieces, as one trajectory."""
        if len(chunks) == 1:
            return chunks[0]
        spans = [not_none(chunk.flow.pieces) for chunk in chunks]
        first = spans[0][0]

        def column(name: str) -> Any:
            return np.concatenate([getattr(chunk, name) for chunk in chunks])

        pieces = [chunk.piece + span[0] - first for chunk, span in zip(chunks, spans, strict=True)]
        columns = ("time", "length", "state", "y", "event_time", "event_contact", "event_before", "event_phase")
        return replace(
            chunks[-1], flow=chunks[-1].flow.on_pieces(first, spans[-1][1]), piece=np.concatenate(pieces),
            **{name: column(name) for name in columns},
        )  # fmt: skip

    def sample(self, times: Floats, output_of: RowsOf) -> Floats:
        """Outputs (nt, k) at increasing times; at an event the state after it counts."""
        parts, first = [], 0
        outputs = output_of(self.flow.system.contacts.start).shape[0]

        def coefficients(_: int, state: ContactState) -> Complexes:
            return state.coefficients(output_of(state.phases), self.flow.sources)

        for part in self.parts():
            last = times.size if part.end >= self.end else int(np.searchsorted(times, part.end))
            parts.append(part._sampled(times[first:last], outputs, coefficients))
            first = last
        return np.concatenate(parts)

    def sample_table(self, times: Floats, table: Complexes) -> Floats:
        """The same from the coefficients (S, T, k) of the outputs, all states being kept."""
        return self._sampled(times, table.shape[2], lambda number, state: table[number, : state.term_basis.size])

    def _sampled(self, times: Floats, outputs: int, coefficients: Callable[[int, ContactState], Complexes]) -> Floats:
        """The same from the coefficients of the terms; the states that are not visited at these times need none.

        Parameters
        ----------
        times : (nt,) s, increasing.
        outputs : number k.
        coefficients : (T, k) of a contact state, by its number.

        Returns
        -------
        (nt, k).
        """
        out = np.empty((times.size, outputs))
        segment = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, None)
        self._check_reached(times, segment)
        of_time = self.state[segment]
        for number in visited_states(of_time):
            state, entries = self.flow.states[number], np.flatnonzero(of_time == number)
            table = coefficients(int(number), state)
            factors = np.stack([table.real, -table.imag], axis=1).reshape(2 * table.shape[0], outputs)
            rows = max(1, VALUES_AT_ONCE // max(factors.shape))
            for first in range(0, entries.size, rows):
                check_stop()
                part = entries[first : first + rows]
                visits, at = np.unique(segment[part], return_inverse=True)
                given = self.flow.sources.amplitudes_at(self.time[visits], self.piece[visits])
                amplitudes = state.amplitudes(given, self.y[visits])[at]
                terms = state.terms_after(amplitudes, times[part] - self.time[segment[part]])
                out[part] = terms.view(float) @ factors
        return out

    def _check_reached(self, times: Floats, segment: Ints) -> None:
        """Refuse times (nt,) outside of the segments (nt,) before them, by more than round-off."""
        after = times - self.time[segment]
        # 1e-12: round-off of times that were added up
        round_off = 1e-12 * max(abs(self.end), abs(float(self.time[0])))
        outside = np.maximum(after - self.length[segment], -after) > round_off
        if outside.any():
            at, reached = float(times[np.flatnonzero(outside)[0]]), (float(self.time[0]), self.end)
            raise ValueError(f"the motion is not known at {at:.9g} s; its segments lie between {reached} s")

    def states_at(self, times: Floats) -> Floats:
        """(nt, N) the state: (q, q') and the contacts' internal states."""
        state = self.flow.equations.state
        return self.sample(times, lambda phases: state)

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
            normal = self.sample(self.time, lambda of: self.flow.at(of).pressing)
            losses[:, contacts.pressed] += contacts.pressing_losses(before, phases) * normal**2
        return losses

    def until(self, end: float) -> Trajectory:
        """The motion up to a time."""
        part = self.only(slice(0, max(1, int(np.searchsorted(self.time, end)))))
        return replace(
            part, end=min(end, self.end), length=np.clip(end - part.time, 0.0, part.length),
            final_y=self.states_at(np.array([min(end, self.end)]))[0],
        )  # fmt: skip

    def within(self, begin: float, end: float) -> Trajectory:
        """The segments of a part of the motion; the first begins at or before ``begin``, the last ends at ``end``.

        The motion itself ends the part that is asked for beyond it. The events are those between these segments; one
        at ``end`` is among them.
        """
        first = max(int(np.searchsorted(self.time, begin, side="right")) - 1, 0)
        last = max(int(np.searchsorted(self.time, end, side="right")), first + 1)
        part = self.only(slice(first, last))
        length = part.length.copy()
        length[-1] = min(length[-1], max(end - float(part.time[-1]), 0.0))
        reached = float(np.clip(end, part.time[-1], self.end))
        return replace(part, end=reached, length=length, final_y=part.states_at(np.array([reached]))[0])

    def between(self, begin: float, end: float) -> Trajectory:
        """The same, whose first segment begins at ``begin``; of the events those after it."""
        if begin <= self.time[0]:
            return self.within(begin, end)
        part = self.within(begin, end)
        part = part._with_events(part.event_time > begin)
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
        return replace(self.only(segments), flow=self.flow.holding(visited), state=state)

    def only(self, segments: Ints | slice) -> Trajectory:
        """Some of the segments, in order; times are those of the whole motion.

        They end where the last of them does. The events are those that lead from one of them to the next, segments of
        no length left out, and those at either end of the motion itself where its first or last segment is among them.
        """
        count = self.time.size
        kept = np.arange(count)[segments]
        part = replace(
            self, time=self.time[kept], length=self.length[kept], state=self.state[kept], piece=self.piece[kept],
            y=self.y[kept],
        )  # fmt: skip
        if not kept.size:
            return part._with_events(np.zeros(self.event_time.size, dtype=bool))
        if kept[-1] + 1 < count:
            part = replace(part, end=float(self.time[kept[-1] + 1]), final_y=self.y[kept[-1] + 1])
        lasting = np.cumsum(np.append(0, self.length > 0.0))  # segments that last, before each
        place = np.searchsorted(kept, self._begun_by_events)
        before = np.where(place > 0, kept[place - 1] + 1, 0)
        after = np.append(kept, count if kept[-1] == count - 1 else -1)[place]
        inside = (after >= 0) & (lasting[after] == lasting[before])
        return part._with_events(inside)

    @cached_property
    def _begun_by_events(self) -> Ints:
        """(E,) number of the segment that each event leads to; 0 at the beginning of the motion, S at its end."""
        changed = np.flatnonzero(np.append(True, np.diff(self.state) != 0))
        begun = self.time[changed]
        # of several events at one instant the last leads to the last segment that begins then
        later = np.searchsorted(self.event_time, self.event_time, side="right") - 1 - np.arange(self.event_time.size)
        place = np.searchsorted(begun, self.event_time, side="right") - 1 - later
        found = (place >= 0) & (begun[place] == self.event_time)
        by_time = np.searchsorted(self.time, self.event_time)
        return np.asarray(np.where(found, changed[place], by_time))

    def contact_share(self) -> Floats:
        """(m,) share of the time during which each contact touches."""
        flags = self.flow.system.contacts.touching(self._phases)
        total = float(self.length.sum())
        return np.asarray(self.length @ flags[self.state] / total) if total > 0 else np.zeros(flags.shape[1])

    def by_state(self, segments: Ints) -> Iterator[tuple[ContactState, Ints]]:
        """Each contact state of segments (n,), with the places of these segments among them, in order."""
        states = self.state[segments]
        for number in visited_states(states):
            yield self.flow.visited_state(number), np.flatnonzero(states == number)

    def extrema(
        self, output_of: RowsOf, edges: Floats | None = None, squares: Ints | None = None, rivals: Ints | None = None
    ) -> Extrema:
        """Smallest and largest values of K outputs over the continuous motion, with their times.

        They are reached, limits from within at both ends of a segment included, and certified to 1e-10 of their size.
        Segments that do not last are left out where contacts may hold: a face would have to stick with more than it
        can there, it lets go at the same instant, and that force is not reached.

        Parameters
        ----------
        output_of : the outputs, by the phases of the contacts.
        edges : (W + 1,) s, increasing: the extremes between each two of them, (W, K) in place of (K,). Where there is
            no motion they are infinite. All are searched together.
        squares : (j,) first of each group of consecutive outputs, where half the sums of their squares are asked for:
            j of them in place of K.
        rivals : outputs of which only the largest magnitude of all is asked for; of the others what is met on the way.

        Returns
        -------
        Values in the units of the outputs (K,) or (W, K), and times, s.
        """
        largest = max(float(np.abs(self.y).max(initial=0.0)), float(np.abs(self.final_y).max(initial=0.0)))
        scale = 2.0 ** max(0.0, np.ceil(np.log2(largest / LARGEST))) if largest > LARGEST else 1.0
        lasts = (self.length > 0.0) | (not self.flow.system.contacts.ever_hold)
        sums = (sums for _, sums in self.sums(output_of, lasts if lasts.any() else ~lasts, edges, scale))
        outputs = output_of(self.flow.system.contacts.start).shape[0]
        found = search_extrema(sums, outputs, 1 if edges is None else edges.size - 1, squares, rivals)
        low, when_low, high, when_high = (x if edges is not None else x[0] for x in found[:4])
        unit = scale if squares is None else scale**2
        return Extrema(unit * low, when_low, unit * high, when_high, found.evaluations)

    def sums(
        self, output_of: RowsOf, which: Bools, edges: Floats | None = None, scale: float = 1.0
    ) -> Iterator[tuple[Ints, Sums]]:
        """Outputs on segments as the search for extremes takes them, in seconds.

        Parameters
        ----------
        output_of : K outputs, by the phases of the contacts.
        which : (S,) whether each segment is looked at.
        edges : (W + 1,) s, between which they are cut, see `cut`.
        scale : that the outputs are divided by.

        Yields
        ------
        The segment of each of some parts (n,), no more than `PARTS_AT_ONCE`, and the outputs on them.
        """
        segment = np.flatnonzero(which)
        begin, end, window = np.zeros(segment.size), np.ones(segment.size), np.zeros_like(segment)
        if edges is not None:
            segment, begin, end, window = self.cut(edges)
            kept = which[segment]
            segment, begin, end, window = segment[kept], begin[kept], end[kept], window[kept]
        for state, parts in self.by_state(segment):
            table = state.coefficients(output_of(state.phases), self.flow.sources)
            for first in range(0, parts.size, PARTS_AT_ONCE):
                rows = parts[first : first + PARTS_AT_ONCE]
                of = segment[rows]
                given, y = self.flow.sources.amplitudes_at(self.time[of], self.piece[of]), self.y[of]
                amplitude, noise = (
                    x[:, state.term_source] / scale
                    for x in (state.amplitudes(given, y), state.amplitude_noise(given, y))
                )
                place = np.stack([begin[rows], end[rows], self.time[of], self.equal_lengths[of]])
                yield of, Sums(
                    state.exponent, state.power, state.term_basis, amplitude, noise, table, place, window[rows]
                )  # fmt: skip

    def turning_points(self, output_of: RowsOf, segments: Ints) -> TurningPoints:
        """All maxima and minima of one output, certified to 1e-10 of its largest value, and its values at the ends.

        Those that are left out differ from what is beside them by less than `TOLERANCE` of the largest value.

        Parameters
        ----------
        output_of : the output, by the phases of the contacts.
        segments : increasing numbers of those that are looked at.
        """
        which = np.isin(np.arange(self.time.size), segments)
        largest = search_extrema((sums for _, sums in self.sums(output_of, which)), 1)
        known, resolution = nothing_known(1), TOLERANCE * float(np.abs([largest.low, largest.high]).max())
        found = [(segments[:0], segments[:0], np.zeros(0), np.zeros(0))]  # segment, order in it, time, value
        for segment, sums in self.sums(output_of, which):
            check_stop()
            scaled, every = in_shares(sums), np.arange(segment.size)
            turns, _ = search(scaled, known, resolution)
            inside = turns[:, 0].astype(np.int64)
            for place, rows, u in ((0, every, sums.place[0]), (1, inside, turns[:, 1]), (2, every, sums.place[1])):
                of = segment[rows]
                time, value = self.time[of] + u * self.length[of], values_in_shares(scaled, rows, u)
                found.append((of, np.full_like(of, place), time, value))
        segment, places, time, value = (np.concatenate([part[k] for part in found]) for k in range(4))
        order = np.lexsort((time, places, segment))
        return TurningPoints(segment[order], time[order], value[order])

    def variation(self, output_of: RowsOf) -> Floats:
        """(K,) bounds on the total variation of K outputs, jumps between segments included.

        The bound of an output is no less than the sum of the changes between its turning points.

        Parameters
        ----------
        output_of : the outputs, by the phases of the contacts.
        """
        total: Floats = np.zeros(output_of(self.flow.system.contacts.start).shape[0])
        before: Floats | None = None  # where the segment before ends
        for first in range(0, self.time.size, SEGMENTS_AT_ONCE):
            which = np.zeros(self.time.size, dtype=bool)
            which[first : first + SEGMENTS_AT_ONCE] = True
            ends = np.empty((2, np.count_nonzero(which), total.size))
            for segment, sums in self.sums(output_of, which):
                check_stop()
                bound, ends[:, segment - first] = variation(in_shares(sums))
                total += bound.sum(axis=0)
            begin, end = ends
            total += np.abs(begin - np.vstack([begin[:1] if before is None else before, end[:-1]])).sum(axis=0)
            before = end[-1:]
        return total

    def cut(self, edges: Floats | None) -> tuple[Ints, Floats, Floats, Ints]:
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
        self, times: Floats, left_of: RowsOf, right_of: RowsOf, weight: Floats, begin: float = 0.0
    ) -> Floats:
        """Integrals of sums of products of K outputs up to times, in closed form.

        Parameters
        ----------
        times : (nt,) increasing, s, not before ``begin``.
        left_of, right_of : the factors.
        weight : (K, Q) of the products in the sums.
        begin : s, from when on; not before the first segment.

        Returns
        -------
        (nt, Q) integrals from ``begin`` to ``times`` of ``sum_k weight[k, q] left_k right_k``.
        """
        motion = self.between(begin, float(times[-1]))  # what came before is not subtracted again, with its digits
        segment = np.clip(np.searchsorted(motion.time, times, side="right") - 1, 0, None)
        tau = np.minimum(times - motion.time[segment], motion.length[segment])
        whole, inside = np.empty((motion.time.size, weight.shape[1])), np.empty((times.size, weight.shape[1]))
        first = 0
        for part in motion.parts():
            last = first + part.time.size
            here = np.flatnonzero((segment >= first) & (segment < last))
            of_part = np.append(np.arange(part.time.size), segment[here] - first)
            integrals = part._products(of_part, np.append(part.length, tau[here]), left_of, right_of, weight)
            whole[first:last], inside[here] = integrals[: part.time.size], integrals[part.time.size :]
            first = last
        before = np.vstack([np.zeros((1, weight.shape[1])), np.cumsum(whole[:-1], axis=0)])
        return before[segment] + inside

    def segment_integrals(self, left_of: RowsOf, right_of: RowsOf, weight: Floats) -> Floats:
        """Integrals over each segment of sums of products of K outputs.

        Parameters
        ----------
        left_of, right_of : the factors.
        weight : (K, Q) of the products in the sums.

        Returns
        -------
        (S, Q) integrals of ``sum_k weight[k, q] left_k right_k``.
        """
        return np.concatenate([
            part._products(np.arange(part.time.size), part.length, left_of, right_of, weight) for part in self.parts()
        ])  # fmt: skip

    def square_integrals(self, output_of: RowsOf) -> Floats:
        """Integrals of the squares of K outputs over all segments, in closed form.

        Parameters
        ----------
        output_of : the outputs, by the phases of the contacts.

        Returns
        -------
        (K,) squares of the units of the outputs times s.
        """
        outputs = output_of(self.flow.system.contacts.start).shape[0]
        return np.asarray(sum((part._squares(output_of) for part in self.parts()), np.zeros(outputs)))

    def _squares(self, output_of: RowsOf) -> Floats:
        """(K,) the same of a motion whose contact states are all kept."""
        out = np.zeros(output_of(self.flow.system.contacts.start).shape[0])
        for number in visited_states(self.state):
            state, segments = self.flow.states[number], np.flatnonzero(self.state == number)
            table, length = state.coefficients(output_of(state.phases), self.flow.sources), self.equal_lengths[segments]
            if state.exponential:  # the terms are few: their products serve all outputs
                terms = self.outputs(state, segments, np.ones((table.shape[0], 1), dtype=complex))
                products = terms.function_products(length) @ np.concatenate([table, table.conj()])
                out += np.einsum("bk,bk->k", table, products).real
                continue
            for some, alike in _alike(length, 2 * state.amplitude_count):
                if alike:  # forms of the amplitudes, whose products are summed first
                    products = np.zeros(1)
                    for block in blocks(some.size, 3 * state.amplitude_count):
                        zeta = self.source_amplitudes(state, segments[some[block]])
                        products = products + zeta.T @ np.concatenate([zeta, zeta.conj()], axis=1)
                    for k in range(out.size):
                        unit = state.unit_outputs(table[:, k : k + 1])
                        (form,) = unit.product_forms(unit, float(length[some[0]]), np.ones((1, 1)))
                        out[k] += np.einsum("rs,rs->", form, products).real
                else:
                    each = self._single_products(state, segments[some], length[some], table, table, np.eye(out.size))
                    out += each.sum(axis=0)
        return out

    def _products(self, segment: Ints, tau: Floats, left_of: RowsOf, right_of: RowsOf, weight: Floats) -> Floats:
        """(n, Q) the same over the first tau of segments."""
        tau = equal_times(tau, self._resolution)
        of_entry, out = self.state[segment], np.empty((tau.size, weight.shape[1]))
        for number in visited_states(of_entry):
            state, entries = self.flow.states[number], np.flatnonzero(of_entry == number)
            left, right = left_of(state.phases), right_of(state.phases)
            acting = np.flatnonzero(left.any(axis=1) & right.any(axis=1))  # open contacts have no force
            one, other = (state.coefficients(factor[acting], self.flow.sources) for factor in (left, right))
            if state.exponential:
                out[entries] = self._exponential_products(
                    state, segment[entries], tau[entries], one, other, weight[acting]
                )  # fmt: skip
                continue
            for some, alike in _alike(tau[entries], 2 * state.amplitude_count):
                of_group = entries[some]
                integrals = self._alike_products if alike else self._single_products
                out[of_group] = integrals(state, segment[of_group], tau[of_group], one, other, weight[acting])
        return out

    def _exponential_products(
        self, state: ContactState, segment: Ints, tau: Floats, left: Complexes, right: Complexes, weight: Floats
    ) -> Floats:
        """(n, Q) integrals over the first tau of segments of a contact state without powers of time."""
        visits, at = np.unique(segment, return_inverse=True)
        amplitude = self.amplitudes(state, visits)
        some = amplitude.any(axis=0) & (left.any(axis=1) | right.any(axis=1))  # what rests may grow without bound
        factors = left[some], right[some], weight
        return exponential_products(state.exponent[state.term_basis[some]], factors, amplitude[:, some], at, tau)

    def _alike_products(
        self, state: ContactState, segment: Ints, tau: Floats, left: Complexes, right: Complexes, weight: Floats
    ) -> Floats:
        """(n, Q) integrals over the same tau of segments of one contact state: forms of the amplitudes."""
        one, other = state.unit_outputs(left), state.unit_outputs(right)
        forms, out = one.product_forms(other, float(tau[0]), weight), np.empty((tau.size, weight.shape[1]))
        for block in blocks(tau.size, forms.shape[2]):
            zeta = self.source_amplitudes(state, segment[block])
            both = np.concatenate([zeta, zeta.conj()], axis=1)
            out[block] = np.stack([np.einsum("ns,ns->n", zeta @ form, both).real for form in forms], axis=1)
        return out

    def _single_products(
        self, state: ContactState, segment: Ints, tau: Floats, left: Complexes, right: Complexes, weight: Floats
    ) -> Floats:
        """(n, Q) integrals over the first tau of segments of one contact state."""
        functions, out = state.exponent.size, np.empty((tau.size, weight.shape[1]))
        for block in blocks(tau.size, functions * (4 * functions + 3 * left.shape[1])):
            one, other = (self.outputs(state, segment[block], table) for table in (left, right))
            out[block] = one.product_integrals(other, tau[block], weight)
        return out

    @cached_property
    def equal_lengths(self) -> Floats:
        """(S,) lengths, of which those that differ by round-off are made equal, s."""
        return equal_times(self.length, self._resolution)

    @property
    def _resolution(self) -> float:
        """Round-off of times, s."""
        return 4.0 * float(np.finfo(float).eps) * abs(self.end)

    def outputs(self, state: ContactState, segments: Ints, table: Complexes) -> SegmentOutputs:
        """Outputs on segments of one contact state.

        Powers of time have far more terms than basis functions, which are summed; else the terms are as few.

        Parameters
        ----------
        state, segments : the contact state, and numbers (n,) of segments in it.
        table : (T, K) coefficients of the terms in the outputs.

        Returns
        -------
        K outputs on n segments.
        """
        if not state.exponential:
            return state.unit_outputs(table).combined(self.source_amplitudes(state, segments))
        basis, amplitude = state.term_basis, self.amplitudes(state, segments)
        return SegmentOutputs(state.exponent[basis], state.power[basis], amplitude[:, :, None] * table)

    @property
    def exponentials(self) -> bool:
        """Whether no term of the motion has a power of time."""
        return all(state.exponential for state in self.flow.states)

    def amplitudes(self, state: ContactState, segments: Ints) -> Complexes:
        """(n, T) amplitudes of the terms where segments of one contact state begin."""
        return self.source_amplitudes(state, segments)[:, state.term_source]

    def source_amplitudes(self, state: ContactState, segments: Ints) -> Complexes:
        """(n, F + Z) amplitudes of the inputs and of the free motions where segments begin."""
        given = self.flow.sources.amplitudes_at(self.time[segments], self.piece[segments])
        return state.amplitudes(given, self.y[segments])

    def weighted_integrals(self, output_of: RowsOf, exponent: Complexes, polynomial: Complexes) -> Complexes:
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
        outputs = output_of(self.flow.system.contacts.start).shape[0]
        out = np.zeros((*exponent.shape, outputs), dtype=complex)
        for number in visited_states(self.state):
            state, some = self.flow.states[number], np.flatnonzero(self.state == number)
            output = output_of(state.phases)
            acting = np.flatnonzero(output.any(axis=1))  # open contacts have no force
            table = state.coefficients(output[acting], self.flow.sources)
            both = self.outputs(state, some, table).with_conjugates()
            count = exponent.shape[0]
            weights = exponent[:, some].ravel(), polynomial[:, some].reshape(-1, polynomial.shape[2])
            moments = weighted_moments(both.exponent, both.power, np.tile(self.length[some], count), *weights)
            moments = moments.reshape(count, some.size, both.power.size).swapaxes(0, 1)
            integrals = moments @ both.coefficient
            out[np.ix_(np.arange(count), some, acting)] = integrals.swapaxes(0, 1)
        return out


def _alike(tau: Floats, fewest: int) -> Iterator[tuple[Ints, bool]]:
    """Entries of one time each, where no fewer than some have it, each time True; then the others, False."""
    _, which, counts = np.unique(tau, return_inverse=True, return_counts=True)
    order = np.argsort(which, kind="stable")
    ends = np.cumsum(counts)
    for last, count in zip(ends[counts >= fewest], counts[counts >= fewest], strict=True):
        yield order[last - count : last], True
    others = np.flatnonzero(counts[which] < fewest)
    if others.size:
        yield others, False
