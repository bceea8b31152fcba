"""A computed motion: what happened between the events, from which every output follows exactly."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.contact_state import ContactState
from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import (
    PARTS_AT_ONCE,
    TOLERANCE,
    Extrema,
    Sums,
    in_shares,
    nothing_known,
    search,
    search_extrema,
    values_in_shares,
    variation,
)
from beamsim.flow.moments import (
    MANY_VALUES,
    blocks,
    equal_times,
    fourier_sums,
    moments_by_time,
    products_of_exponentials,
    summed_products,
    sums_of_products,
    weighted_moments,
)
from beamsim.outcomes import Outcome, OutcomeKind, Where, check_stop
from beamsim.system.equations import RowsOf
from beamsim.typing import Bools, Complexes, Floats, Ints, not_none

LARGEST = 1e50  # of a state; where it is larger, extremes are searched for in another unit
SEGMENTS_AT_ONCE = 4096  # whose values at both ends are kept together
ROUND_OFF = 4.0 * float(np.finfo(float).eps)  # of times, relative to the end of the motion
ROUND_OFF_OF_SUMS = 1e-12  # of times that were added up, likewise
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
    time: Floats  # (S,) start of each segment, between events, breakpoints of the inputs and horizons; s
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

    @cached_property
    def touch_changes(self) -> Ints:
        """(E,) 1 where contact is made, -1 where it ends, 0 at other changes of phase."""
        return self.flow.system.contacts.touch_changes(self.event_contact, self.event_before, self.event_phase)

    def up_to_finite(self) -> Trajectory:
        """The motion up to the first segment that does not start from finite numbers, with an outcome that says so."""
        finite = np.append(np.all(np.isfinite(self.y), axis=1), np.all(np.isfinite(self.final_y)))
        kept = max(int(np.argmin(finite)) - 1, 0)  # its end is where the next one starts
        if finite[-1] and finite.all():
            return self
        end = float(self.time[kept])
        part = self.select(slice(0, max(kept, 1)))
        return replace(part, end=end, length=part.length * (kept > 0), final_y=self.y[kept], outcome=not_finite(end))

    @classmethod
    def join(cls, chunks: Sequence[Trajectory]) -> Trajectory:
        """Consecutive chunks of a motion under a record, each in a flow on its pieces, as one trajectory."""
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

    def sample(
        self, times: Floats, output_of: RowsOf, gain: Callable[[ContactState], Complexes] | None = None
    ) -> Floats:
        """Outputs at increasing times; at an event the state after it counts.

        Parameters
        ----------
        times : (nt,) s.
        output_of : k outputs, by the phases of the contacts.
        gain : (T,) factors of the terms in the outputs; 1 by default.

        Returns
        -------
        (nt, k).
        """
        segment = self.segments_at(times)
        after = times - self.time[segment]
        out = np.empty((times.size, output_of(self.flow.system.contacts.start).shape[0]))
        for state, entries in self.by_state(segment):
            table = state.coefficients(output_of(state.phases), self.flow.sources)
            table = table if gain is None else table * gain(state)[:, None]
            factors = np.stack([table.real, -table.imag], axis=1).reshape(2 * table.shape[0], out.shape[1])
            for rows in blocks(entries.size, max(factors.shape)):
                at = entries[rows]
                visits, of = np.unique(segment[at], return_inverse=True)
                out[at] = state.terms_after(self.amplitudes(state, visits)[of], after[at]).view(float) @ factors
        return out

    def segments_at(self, times: Floats) -> Ints:
        """(nt,) the segments at times, s; times outside of the motion by more than round-off are refused."""
        segment = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, None)
        after = times - self.time[segment]
        round_off = ROUND_OFF_OF_SUMS * max(abs(self.end), abs(float(self.time[0])))
        outside = np.maximum(after - self.length[segment], -after) > round_off
        if outside.any():
            at, reached = float(times[np.flatnonzero(outside)[0]]), (float(self.time[0]), self.end)
            raise ValueError(f"the motion is not known at {at:.9g} s; its segments lie between {reached} s")
        return segment

    def states_at(self, times: Floats) -> Floats:
        """(nt, N) the state: (q, q') and the contacts' internal states."""
        state = self.flow.equations.state
        return self.sample(times, lambda phases: state)

    @cached_property
    def phases(self) -> Ints:
        """(S, m) phases of the contacts on the segments."""
        return np.array(self.flow.visited_phases, dtype=np.int64).reshape(len(self.flow.visited_phases), -1)[self.state]

    def event_losses(self) -> Floats:
        """(S, m) energy that a contact loses at once where each segment begins, J; none where the first does."""
        contacts, phases = self.flow.system.contacts, self.phases
        before = np.concatenate([phases[:1], phases[:-1]])
        losses = contacts.event_losses(before, phases)
        if contacts.pressed_contacts.size:
            normal = self.sample(self.time, lambda of: self.flow.at(of).normal_force)
            losses[:, contacts.pressed_contacts] += contacts.pressing_losses(before, phases) * normal**2
        return losses

    def truncate(self, end: float) -> Trajectory:
        """The motion up to a time."""
        part = self.select(slice(0, max(1, int(np.searchsorted(self.time, end)))))
        return replace(
            part, end=min(end, self.end), length=np.clip(end - part.time, 0.0, part.length),
            final_y=self.states_at(np.array([min(end, self.end)]))[0],
        )  # fmt: skip

    def extract(self, begin: float, end: float) -> Trajectory:
        """The motion between two times, as far as it goes; its first segment begins at ``begin``.

        The events are those after ``begin``, up to ``end``; where the motion begins those at this time, too.
        """
        first = max(int(np.searchsorted(self.time, begin, side="right")) - 1, 0)
        last = max(int(np.searchsorted(self.time, end, side="right")), first + 1)
        time, length, y = self.time[first:last].copy(), self.length[first:last].copy(), self.y[first:last].copy()
        inside = self.event_time <= end
        late = max(begin - float(time[0]), 0.0)
        if late > 0.0:
            time[0], length[0], y[0] = begin, max(length[0] - late, 0.0), self.states_at(np.array([begin]))[0]
        if begin > self.time[0]:
            inside &= self.event_time > begin
        length[-1] = min(length[-1], max(end - float(time[-1]), 0.0))
        reached = float(np.clip(end, time[-1], self.end))
        return replace(
            self, end=reached, time=time, length=length, y=y, state=self.state[first:last],
            piece=self.piece[first:last], event_time=self.event_time[inside], event_contact=self.event_contact[inside],
            event_before=self.event_before[inside], event_phase=self.event_phase[inside],
            final_y=self.states_at(np.array([reached]))[0],
        )  # fmt: skip

    def with_all_states(self) -> Trajectory:
        """The same with a flow that keeps all its states, whatever their number."""
        if not self.flow.has_dropped_states:
            return self
        visited, state = np.unique(self.state, return_inverse=True)
        return replace(self, flow=self.flow.with_states(visited), state=state)

    def select(self, segments: Ints | slice) -> Trajectory:
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
        inside = np.zeros(self.event_time.size, dtype=bool)
        if kept.size and kept[-1] + 1 < count:
            part = replace(part, end=float(self.time[kept[-1] + 1]), final_y=self.y[kept[-1] + 1])
        if kept.size:
            lasting = np.cumsum(np.append(0, self.length > 0.0))  # segments that last, before each
            place = np.searchsorted(kept, self._begun_by_events)
            before = np.where(place > 0, kept[place - 1] + 1, 0)
            after = np.append(kept, count if kept[-1] == count - 1 else -1)[place]
            inside = (after >= 0) & (lasting[after] == lasting[before])
        return replace(
            part, event_time=self.event_time[inside], event_contact=self.event_contact[inside],
            event_before=self.event_before[inside], event_phase=self.event_phase[inside],
        )  # fmt: skip

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
        touching, total = self.flow.system.contacts.closed(self.phases), float(self.length.sum())
        return np.asarray(self.length @ touching / total) if total > 0 else np.zeros(touching.shape[1])

    def by_state(self, segments: Ints | None = None) -> Iterator[tuple[ContactState, Ints]]:
        """Each contact state of some segments (n,), all by default, with the places of its segments among them."""
        states = self.state if segments is None else self.state[segments]
        for number in np.bincount(states).nonzero()[0].tolist():
            yield self.flow.visited_state(number), np.flatnonzero(states == number)

    def extrema(
        self, output_of: RowsOf, edges: Floats | None = None, squares: Ints | None = None,
        competitors: Ints | None = None,
    ) -> Extrema:  # fmt: skip
        """Smallest and largest values of K outputs over the continuous motion, and their times.

        The values are reached (one-sided limits at the ends of segments included) and certified to 1e-10 of their size.
        Segments of zero length are left out if contacts may stick: the face would exceed its friction there and lets go
        at the same instant, so that its force is not reached.

        Parameters
        ----------
        output_of : the outputs, by the phases of the contacts.
        edges : (W + 1,) s, increasing: the extremes between each two of them, (W, K) in place of (K,). Where there is
            no motion they are infinite. All are searched together.
        squares : (j,) first of each group of consecutive outputs, where half the sums of their squares are asked for:
            j of them in place of K.
        competitors : outputs of which only the largest magnitude of all is asked for; of the others what is met
            on the way.

        Returns
        -------
        Values in the units of the outputs (K,) or (W, K), and times, s.
        """
        largest = max(float(np.abs(self.y).max(initial=0.0)), float(np.abs(self.final_y).max(initial=0.0)))
        scale = 2.0 ** max(0.0, np.ceil(np.log2(largest / LARGEST))) if largest > LARGEST else 1.0
        lasts = (self.length > 0.0) | (not self.flow.system.contacts.any_sticks_rigidly)
        sums = (sums for _, sums in self.sums(output_of, lasts if lasts.any() else ~lasts, edges, scale))
        outputs = output_of(self.flow.system.contacts.start).shape[0]
        found = search_extrema(sums, outputs, 1 if edges is None else edges.size - 1, squares, competitors)
        low, when_low, high, when_high = (x if edges is not None else x[0] for x in found[:4])
        unit = scale if squares is None else scale**2
        return Extrema(unit * low, when_low, unit * high, when_high, found.evaluations)

    def sums(
        self, output_of: RowsOf, searched: Bools, edges: Floats | None = None, scale: float = 1.0,
        gain: Callable[[ContactState], Complexes] | None = None,
    ) -> Iterator[tuple[Ints, Sums]]:  # fmt: skip
        """Outputs on segments as the search for extremes takes them, in seconds.

        Parameters
        ----------
        output_of : K outputs, by the phases of the contacts.
        searched : (S,) whether each segment is looked at.
        edges : (W + 1,) s, between which they are cut, see `cut`.
        scale : that the outputs are divided by.
        gain : (T,) factors of the terms in the outputs; 1 by default.

        Yields
        ------
        The segment of each of some parts (n,), no more than `PARTS_AT_ONCE`, and the outputs on them.
        """
        segment, done = np.flatnonzero(searched), 0
        begin, end, window = np.zeros(segment.size), np.ones(segment.size), np.zeros_like(segment)
        if edges is not None:
            segment, begin, end, window = self.cut(edges)
            kept = searched[segment]
            segment, begin, end, window = segment[kept], begin[kept], end[kept], window[kept]
        for state, parts in self.by_state(segment):
            table = state.coefficients(output_of(state.phases), self.flow.sources)
            table = table if gain is None else table * gain(state)[:, None]
            for first in range(0, parts.size, PARTS_AT_ONCE):
                check_stop(done / segment.size)
                rows = parts[first : first + PARTS_AT_ONCE]
                of, done = segment[rows], done + rows.size
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

        Those that are left out differ from their neighbours by less than `TOLERANCE` of the largest value.

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
            scaled, every = in_shares(sums), np.arange(segment.size)
            turns, _ = search(scaled, np.full((2, segment.size, 1), np.inf), known, resolution)
            inside = turns[:, 0].astype(np.int64)
            for place, rows, u in ((0, every, sums.span[0]), (1, inside, turns[:, 1]), (2, every, sums.span[1])):
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
        motion = self.extract(begin, float(times[-1]))  # what came before is not subtracted again, with its digits
        segment = np.clip(np.searchsorted(motion.time, times, side="right") - 1, 0, None)
        tau = np.minimum(times - motion.time[segment], motion.length[segment])
        every = np.append(np.arange(motion.time.size), segment)
        integrals = motion.segment_integrals(left_of, right_of, weight, every, np.append(motion.length, tau))
        whole, inside = np.split(integrals, [motion.time.size])
        before = np.vstack([np.zeros((1, weight.shape[1])), np.cumsum(whole[:-1], axis=0)])
        return before[segment] + inside

    def segment_integrals(
        self, left_of: RowsOf, right_of: RowsOf, weight: Floats, segment: Ints | None = None, tau: Floats | None = None
    ) -> Floats:
        """Integrals over segments of sums of products of K outputs.

        Parameters
        ----------
        left_of, right_of : the factors.
        weight : (K, Q) of the products in the sums.
        segment : (n,) of each integral; all S by default.
        tau : (n,) s, since the segments began, up to which they are integrated; their lengths by default.

        Returns
        -------
        (n, Q) integrals of ``sum_k weight[k, q] left_k right_k``.
        """
        segment = np.arange(self.time.size) if segment is None else segment
        tau = equal_times(self.length[segment] if tau is None else tau, ROUND_OFF * abs(self.end))
        out = np.empty((tau.size, weight.shape[1]))
        for state, entries in self.by_state(segment):
            left, right = left_of(state.phases), right_of(state.phases)
            acting = np.flatnonzero(left.any(axis=1) & right.any(axis=1))  # open contacts have no force
            one, other = (state.coefficients(factor[acting], self.flow.sources) for factor in (left, right))
            if not state.exponential:
                factors = one, other, weight[acting]
                out[entries] = self._products_by_time(state, segment[entries], tau[entries], factors)
                continue
            visits, at = np.unique(segment[entries], return_inverse=True)
            amplitude = self.amplitudes(state, visits)[:, state.term_source]
            some = amplitude.any(axis=0) & (one.any(axis=1) | other.any(axis=1))  # what rests may grow without bound
            exponent, factors = state.exponent[state.term_basis[some]], (one[some], other[some], weight[acting])
            out[entries] = products_of_exponentials(exponent, factors, amplitude[:, some], at, tau[entries])
        return out

    def _products_by_time(
        self, state: ContactState, segment: Ints, tau: Floats, factors: tuple[Complexes, Complexes, Floats]
    ) -> Floats:
        """(n, Q) the same in a contact state with powers of time, from the factors as sums of functions of time.

        Over equal times they are one quadratic form of the amplitudes: pieces of a random input have the same length.
        Left factors that are inputs, as those of work are, have few functions and sources.
        """
        amplitude, weight = self.amplitudes(state, segment), factors[2]
        F, B, (K, Q) = amplitude.shape[1], state.exponent.size, weight.shape
        of_sources = np.zeros((2, F * B, K), dtype=complex)
        for of, table in zip(of_sources, factors[:2], strict=True):
            np.add.at(of, state.term_source * B + state.term_basis, table)
        left, right = of_sources.reshape(2, F, B, K).swapaxes(2, 3)  # outputs of a unit of each amplitude
        acting, rows = np.flatnonzero(left.any(axis=(1, 2))), np.flatnonzero(left.any(axis=(0, 1)))
        left = left[acting][:, :, rows]
        both_of_units, real = np.stack([right, right.conj()]).reshape(2, F, K * B), not state.exponent[rows].imag.any()
        of_left, of_right = left.reshape(acting.size, K * rows.size), right.reshape(F, K * B)
        out = np.empty((tau.size, Q))
        for groups, moments in moments_by_time(state.exponent, state.power, rows, tau):
            many = [k for k, entries in enumerate(groups) if entries.size >= F]
            for k in many:
                integrals = left @ (np.hstack([moments[k], moments[k].conj()]) if real else moments[k])
                integrals = integrals.reshape(acting.size, K, 2, B).transpose(2, 0, 1, 3)
                weighted = (integrals * weight.T[:, None, None, :, None]).reshape(Q, 2, acting.size, K * B)
                forms = np.concatenate([*(weighted @ both_of_units.swapaxes(1, 2)).swapaxes(0, 1)], axis=2)
                out[groups[k]] = 0.5 * sums_of_products(amplitude[groups[k]], acting, forms)
            at = np.repeat(np.arange(len(groups)), [entries.size for entries in groups])
            some = ~np.isin(at, many)
            entries, at = np.concatenate(groups)[some], at[some]
            one = (amplitude[np.ix_(entries, acting)] @ of_left).reshape(at.size, K, rows.size)
            other = (amplitude[entries] @ of_right).reshape(at.size, K, B)
            if real:
                out[entries] = ((one.real @ moments[at]) * other).sum(axis=2).real @ weight
            else:
                both = np.concatenate([other, other.conj()], axis=2)
                out[entries] = 0.5 * ((one @ moments[at]) * both).sum(axis=2).real @ weight
        return out

    def square_integrals(self, output_of: RowsOf) -> Floats:
        """Integrals of the squares of K outputs over all segments, in closed form.

        Parameters
        ----------
        output_of : the outputs, by the phases of the contacts.

        Returns
        -------
        (K,) squares of the units of the outputs times s.
        """
        out = np.zeros(output_of(self.flow.system.contacts.start).shape[0])
        for state, segments in self.by_state():
            table, length = state.coefficients(output_of(state.phases), self.flow.sources), self.equal_lengths[segments]
            if not state.exponential:
                out += self._squares_by_time(state, segments, length, table)
                continue
            products = self._squares_of_exponentials(state, segments, length)
            both = 0.5 * np.concatenate([table, table.conj()])
            out += (table * (products @ both)).sum(axis=0).real
        return out

    def _squares_of_exponentials(self, state: ContactState, segments: Ints, length: Floats) -> Complexes:
        """(T, 2 T) integrals of products of the terms with each other and with their conjugates, over segments."""
        basis, source = state.term_basis, state.term_source
        products = np.zeros((basis.size, 2 * basis.size), dtype=complex)
        for part in blocks(segments.size, basis.size):
            amplitude = self.amplitudes(state, segments[part])[:, source]
            some = np.flatnonzero(amplitude.any(axis=0))  # what rests may grow without bound
            found = summed_products(state.exponent[basis[some]], amplitude[:, some], length[part])
            products[some[:, None], np.append(some, basis.size + some)] += found
        return products

    def _squares_by_time(self, state: ContactState, segments: Ints, length: Floats, table: Complexes) -> Floats:
        """(K,) the integrals of squares in a contact state with powers of time, of outputs (T, K) of its terms.

        On each segment outputs are sums of functions of time, of which there are far fewer than terms.
        """
        zeta, (B, K) = self.amplitudes(state, segments), (state.exponent.size, table.shape[1])
        of_units = np.zeros((zeta.shape[1] * B, K), dtype=complex)
        np.add.at(of_units, state.term_source * B + state.term_basis, table)
        of_units = of_units.reshape(-1, B, K).swapaxes(1, 2).reshape(-1, K * B)
        real, out = not state.exponent.imag.any(), np.zeros(K)
        for groups, integrals in moments_by_time(state.exponent, state.power, np.arange(B), length):
            for entries, moments in zip(groups, integrals, strict=True):
                for part in blocks(entries.size, 2 * K * B):
                    one = (zeta[entries[part]] @ of_units).reshape(-1, K, B)
                    other = one.real if real else 0.5 * np.concatenate([one, one.conj()], axis=2)
                    out += (((one.real if real else one) @ moments) * other).sum(axis=(0, 2)).real
        return out

    @cached_property
    def equal_lengths(self) -> Floats:
        """(S,) lengths, of which those that differ by round-off are made equal, s."""
        return equal_times(self.length, ROUND_OFF * abs(self.end))

    @property
    def exponentials(self) -> bool:
        """Whether no term of the motion has a power of time."""
        return all(state.exponential for state, _ in self.by_state())

    def amplitudes(self, state: ContactState, segments: Ints) -> Complexes:
        """(n, F + Z) amplitudes of the inputs and of the free motions where segments of a contact state begin."""
        given = self.flow.sources.amplitudes_at(self.time[segments], self.piece[segments])
        return state.amplitudes(given, self.y[segments])

    def fourier_integrals(self, output_of: RowsOf, omega: Floats) -> Complexes:
        r"""Fourier integrals of K outputs over the motion.

        Parameters
        ----------
        output_of : the outputs, by the phases of the contacts.
        omega : (W,) rad/s.

        Returns
        -------
        (K, W) :math:`\int x(t) e^{-i \omega (t - t_0)} dt`, :math:`t_0` being the start of the motion.
        """
        out = np.zeros((output_of(self.flow.system.contacts.start).shape[0], omega.size), dtype=complex)
        for state, segments in self.by_state():
            table = state.coefficients(output_of(state.phases), self.flow.sources)
            amplitude = self.amplitudes(state, segments)[:, state.term_source]
            some = amplitude.any(axis=0) & table.any(axis=1)  # what rests may grow without bound
            basis, elapsed = np.tile(state.term_basis[some], 2), self.time[segments] - self.time[0]
            exponent, half = state.exponent[state.term_basis[some]], 0.5 * amplitude[:, some]
            exponent, half = np.append(exponent, exponent.conj()), np.hstack([half, half.conj()])
            both = np.concatenate([table[some], table[some].conj()])
            for part in blocks(omega.size, segments.size, MANY_VALUES):
                out[:, part] += both.T @ fourier_sums(
                    exponent, state.power[basis], half, self.equal_lengths[segments], omega[part], elapsed
                )
        return out

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
        outputs, count = output_of(self.flow.system.contacts.start).shape[0], exponent.shape[0]
        out = np.zeros((*exponent.shape, outputs), dtype=complex)
        for state, some in self.by_state():
            table = state.coefficients(output_of(state.phases), self.flow.sources)
            functions = np.append(state.exponent, state.exponent.conj()), np.tile(state.power, 2)
            weights = exponent[:, some].ravel(), polynomial[:, some].reshape(-1, polynomial.shape[2])
            moments = weighted_moments(*functions, np.tile(self.length[some], count), *weights)
            each, other = np.split(moments.reshape(count, some.size, functions[0].size), 2, axis=2)
            half = 0.5 * self.amplitudes(state, some)[:, state.term_source]
            terms, conjugates = each[..., state.term_basis] * half, other[..., state.term_basis] * half.conj()
            out[:, some] = terms @ table + conjugates @ table.conj()
        return out
