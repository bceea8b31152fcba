"""Extremes of channels along the motion of a run that compete for its values, and their derivatives.

A value is the largest (or smallest) of all extremes of one or several channels. The deciding extreme is certified; the
others are the turning points of the channels and the ends of the record.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from beamsim.flow.channels import outputs_of
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import Log
from beamsim.flow.variational import Differences, FlowOutputs, MotionDerivative
from beamsim.results.competition import Competition, compete
from beamsim.results.values import OPENING, Value
from beamsim.system.equations import Channel, ChannelSet
from beamsim.typing import Bools, Floats, Ints, not_none

AT_END = 1e-9  # of a segment: closer instants count as its end
ROUND_OFF = 1e-12  # relative to a peak
CONSTANT_VARIATION = 1e-9  # relative variation up to which a channel is constant
SAME_EXTREME = 1e-11  # relative to the largest value of a channel; closer neighbouring values are the same
MISSED = 2
MOST_MISSES = 8  # closest misses of each snubber that are considered
MOST_ROWS = 8  # extremes of a channel with many places: the largest ones are kept
MOST_COMPETITORS = 500  # largest number of extremes that compete for a value


class Variation(NamedTuple):
    """Effect of a change of one number of the scenario; see `sensitivities_of`."""

    rates: Differences
    rows: dict[FlowOutputs, Floats]  # rows of the channels for the systems on both sides
    start: Floats  # (N,) change of the initial state


class Peak(NamedTuple):
    """Extreme of a channel, and its time."""

    row: int  # row of the channel
    high: int  # 1 highest, 0 lowest; `MISSED` for a contact that does not close
    segment: int
    time: float  # s
    later: int  # 0 if the segment ends there, else 1


class Turns(NamedTuple):
    """Local extremes of a channel and the ends of the record, with their values."""

    peaks: list[Peak]
    value: Floats  # (n,)
    high: Bools  # (n,) True for local maxima
    low: Bools  # (n,) True for local minima
    end: Bools  # (n,) True for an end of the record


class Contest(NamedTuple):
    """Value with the extremes that compete for it; the first one decides."""

    name: str  # as in studies
    unit: str
    sign: float  # 1 if the largest decides, -1 if the smallest does
    scale: float  # largest magnitude of the channels
    values: Floats  # (k,) value if an extreme decides
    peaks: list[Peak]
    factors: Floats  # (k,) derivatives by the extremes

    def contenders(self, slope_of: Mapping[Peak, Floats]) -> Contenders:
        """Derivatives of the value by numbers, from those (P,) of the extremes."""
        slopes = np.array([slope_of[peak] for peak in self.peaks])
        times = np.array([peak.time for peak in self.peaks])
        return Contenders(
            self.name, self.unit, self.sign, self.scale, self.values, times, self.factors[:, None] * slopes
        )


class Contenders(NamedTuple):
    """Value and its derivatives by P numbers for each of k extremes that may decide it; the first one does."""

    name: str  # as in studies
    unit: str
    sign: float  # 1 if the largest decides, -1 if the smallest does
    scale: float  # largest magnitude of the channels
    values: Floats  # (k,)
    times: Floats  # (k,) s
    slopes: Floats  # (k, P)

    def competition(self, p: int, tolerance: float) -> Competition:
        """Change of the value with a number within its tolerance."""
        sign = self.sign
        return compete(sign * self.values, sign * self.slopes[:, p], tolerance, self.scale).times(sign)


class LocalExtremes:
    """Extremes of linear channels along the motion of a run."""

    def __init__(self, motion: Trajectory, channels: ChannelSet) -> None:
        self.motion, self.channels, self.outputs = motion, channels, FlowOutputs(motion.flow)
        self.output_of = outputs_of(motion.flow, channels.linear)
        low, when_low, high, when_high = motion.extrema(self.output_of)[:4]
        self.extremes, self.when = np.array([low, when_low, high, when_high]), (when_low, when_high)
        self._known = dict[int, Turns]()

    def contests(self, values: Iterable[Value], limited_values: Container[Value]) -> list[Contest]:
        """Values of channels, and the largest over all places for limited values."""
        found = list[Contest]()
        for value in values:
            at = [(channel, first) for channel, first in self.channels.first_columns if value.is_extreme_of(channel)]
            groups = {value.name: at} if at and (value.single or (value in limited_values and len(at) > 1)) else {}
            for channel, first in () if value.single else at:
                groups.setdefault(f"{value.section}/{channel.name}/{value.name}", []).append((channel, first))
            found += [self._contest(name, value, columns) for name, columns in groups.items()]
        return found

    def _contest(self, name: str, value: Value, columns: Sequence[tuple[Channel, int]]) -> Contest:
        """Extremes of some channels, each with its first row, that compete for a value."""
        sign = float(np.sign(not_none(value.from_extreme)(np.array([[-1.0], [0.0], [2.0], [0.0]]))[0]))
        best, scale, first = -np.inf, 0.0, (Peak(0, 1, 0, 0.0, 1), 0.0)
        peaks, values, factors = list[Peak](), list[Floats](), list[Floats]()
        for channel, row in columns:
            extreme = self.extremes[:, row : row + channel.columns]
            numbers, scale = sign * value.of_channels([channel], extreme), max(scale, np.abs(extreme[::2]).max())
            if numbers.max() > best:
                k, best = int(numbers.argmax()), float(numbers.max())
                of, slope = _single_extreme_value(value, channel, extreme[::2, k])
                high = int(sign * of[1] >= sign * of[0])  # of equal magnitudes the highest counts
                first = self.peak(row + k, high), float(slope[high]) if best else 0.0
            for k in _largest_rows(numbers):
                turns = self._turns(row + k)
                of, slope = _single_extreme_value(value, channel, turns.value)
                which = np.where(sign * slope > 0.0, turns.high, (slope != 0.0) & turns.low) | turns.end
                peaks += [turns.peaks[i] for i in np.flatnonzero(which)]
                values.append(of[which])
                factors.append(slope[which])
        every, order = (
            np.concatenate(values),
            np.argsort(-sign * np.concatenate(values), kind="stable")[:MOST_COMPETITORS],
        )
        return Contest(
            name, columns[0][0].unit, sign, float(scale), np.append(sign * best, every[order]),
            [first[0], *(peaks[i] for i in order)], np.append(first[1], np.concatenate(factors)[order]),
        )  # fmt: skip

    def _turns(self, row: int) -> Turns:
        """Local extremes of a channel; each channel is searched once."""
        if row not in self._known:
            self._known[row] = self._find_turns(row)
        return self._known[row]

    def _find_turns(self, row: int) -> Turns:
        """Find the local extremes of a channel."""
        motion = self.motion

        def output(phases: Ints) -> Floats:
            return self.output_of(phases)[row : row + 1]

        segment, time, value = motion.turning_points(output, np.flatnonzero(motion.length > 0.0))
        near = SAME_EXTREME * float(np.abs(self.extremes[::2, row]).max(initial=0.0))
        here = np.flatnonzero(np.append(True, np.abs(np.diff(value)) > near))  # both sides of an event are one extreme
        here[-1] = value.size - 1 if here.size > 1 else 0
        value = value[here]
        before, after = np.append(np.nan, value[:-1]), np.append(value[1:], np.nan)
        high, low = ~(before > value) & ~(after > value), ~(before < value) & ~(after < value)
        begin, length = motion.time[segment[here]], motion.length[segment[here]]
        share = (time[here] - begin) / length
        later = share < 1.0 - AT_END
        at = np.where(share < AT_END, begin, np.where(later, time[here], begin + length))
        columns = (each.tolist() for each in (high.astype(int), segment[here], at, later.astype(int)))
        peaks = [Peak(row, *each) for each in zip(*columns, strict=True)]
        end = np.isin(np.arange(value.size), (0, value.size - 1))
        return Turns(peaks, value, high, low, end)

    def constant_channel_warnings(self, contests: Iterable[Contest]) -> list[str]:
        """Warnings about values whose channel is constant, so that any change of a number may raise them."""
        low, _, high, _ = self.extremes
        flat = high - low <= CONSTANT_VARIATION * np.maximum(np.abs(low), np.abs(high))
        names = [of.name for of in contests if of.values[0] and of.factors[0] and flat[of.peaks[0].row]]
        message = (
            "does not change along the motion: its derivatives are those of one instant, and any change may raise it"
        )
        return [f"run.sensitivities: {name} {message}" for name in names]

    def output(self, row: int, segment: int, time: float) -> Floats:
        """(3,) channel on a segment, with its first and second time derivative."""
        motion, flow, values = self.motion, self.motion.flow, np.empty(3)
        phases, part = flow.states[motion.state[segment]].phases, motion.select(slice(segment, segment + 1))
        factors, rates = self.outputs.outputs(self.output_of, phases)[row], self.outputs.rates(phases)
        inputs, y = flow.inputs_at(np.array([time]), 3, part.time)[0], part.states_at(np.array([time]))[0]
        for order in range(3):
            v = np.append(y, inputs[order])
            values[order], y = factors @ v, rates @ v
        return values

    def distance(self, miss: Peak) -> float:
        """Closest distance of an open contact, m; its round-off if the contact just touches."""
        opening = self.output(miss.row, miss.segment, miss.time)[0]
        return float(max(abs(opening), ROUND_OFF * np.abs(self.extremes[::2, miss.row]).max()))

    def peak(self, row: int, high: int) -> Peak:
        """Extreme of a channel; inside a segment its rate is zero up to round-off."""
        motion, time, sign = self.motion, float(self.when[high][row]), 2 * high - 1
        ends, near = motion.time + motion.length, 1e-12 * motion.end
        here = np.flatnonzero((motion.time <= time + near) & (ends >= time - near) & (motion.length > 0.0)).tolist()
        within = {g: min(max(time, float(motion.time[g])), float(ends[g])) for g in here}
        segment = max(here, key=lambda g: sign * self.output(row, g, within[g])[0])
        begin, end, at = float(motion.time[segment]), float(ends[segment]), within[segment]
        value = sign * float(self.output(row, segment, at)[0])
        least = value - ROUND_OFF * abs(value)
        for _ in range(8):
            _, rate, turn = self.output(row, segment, at)
            moved = at - rate / turn if sign * turn < 0.0 else np.nan
            if not begin <= moved <= end or sign * self.output(row, segment, moved)[0] < least:
                break
            at = moved
        if min(at - begin, end - at) > AT_END * (end - begin):
            return Peak(row, high, segment, at, 1)
        later = int(at - begin < end - at)
        return Peak(row, high, segment, begin if later else end, later)

    def misses(self) -> list[Peak]:
        """Closest approaches of open snubbers to the structure without contact."""
        motion, found = self.motion, list[Peak]()
        touching = motion.flow.system.contacts.closed(motion.phases)
        for j, row in enumerate(self.channels.places.get(OPENING, ())):

            def opening(phases: Ints, row: int = row) -> Floats:
                return self.output_of(phases)[row : row + 1]

            segment, time, value = motion.turning_points(opening, np.flatnonzero(~touching[:, j]))
            least = -ROUND_OFF * float(np.abs(value).max(initial=0.0))  # round-off of a contact that just touches
            inner = 1 + np.flatnonzero((value[1:-1] < value[:-2]) & (value[1:-1] < value[2:]) & (value[1:-1] > least))
            inner = inner[(segment[inner - 1] == segment[inner]) & (segment[inner + 1] == segment[inner])]
            nearest = inner[np.argsort(value[inner])[:MOST_MISSES]]
            found += [Peak(int(row), MISSED, int(segment[k]), float(time[k]), 1) for k in nearest]
        return found

    def ends(self) -> list[Peak]:
        """Beginning and end of the record, where changes of contacts may enter it."""
        motion = self.motion
        first, last = np.flatnonzero(motion.length > 0.0)[[0, -1]].tolist()
        end = float(motion.time[last] + motion.length[last])
        return [Peak(0, MISSED, first, float(motion.time[first]), 1), Peak(0, MISSED, last, end, 0)]

    def entering(
        self,
        ends: Sequence[Peak],
        indices: Sequence[int],
        variations: Sequence[Variation],
        derivative: MotionDerivative,
    ) -> Iterator[tuple[float, float, Floats]]:
        """Changes of contacts just before the beginning or after the end of the record.

        Parameters
        ----------
        ends : beginning and end of the record.
        indices : their numbers among the stored instants.
        variations : (P,) changes of numbers.
        derivative : derivatives of the motion.

        Yields
        ------
        Time, s; event function, and its derivatives (P,). At the end of the record it decreases towards zero.
        """
        motion, flow, of = self.motion, self.motion.flow, derivative.stored
        for peak, k in zip(ends, indices, strict=True):
            at = flow.states[motion.state[peak.segment]]
            events, v, moving = at.equations.events, of.instant.v[k], of.instant.rate[k]
            value, rate = events.guards @ v, events.guards @ moving
            terms = np.abs(events.guards) @ np.abs(v)
            for g in np.flatnonzero((value > ROUND_OFF * terms) & ((rate < 0.0) | bool(peak.later))).tolist():
                key = at.phases, int(events.contact[g]), int(events.next[g])
                row, n = events.guards[g], flow.size
                changed = np.array([each.rates.event(key)[-1] for each in variations]) @ v
                yield peak.time, float(value[g]), row[:n] @ of.S[k] + of.instant.input_change[k] @ row[n:] + changed

    def cut(self, peaks: Sequence[Peak]) -> tuple[Log, list[tuple[int, int]]]:
        """Motion with a segment that begins at each peak, and the positions of the peaks for `sensitivity`."""
        motion = self.motion
        inner = sorted({p[2:4] for p in peaks if motion.time[p.segment] < p.time and p.later})
        segments, times = (np.array([each[k] for each in inner]) for k in (0, 1))
        of = np.concatenate([np.arange(motion.time.size), segments]).astype(np.int64)
        time = np.concatenate([motion.time, times])
        y = np.concatenate([motion.y, motion.states_at(times) if inner else motion.y[:0]])
        order = np.lexsort((time, of))
        of, time = of[order], time[order]
        last = np.append(of[1:] != of[:-1], True)
        length = np.where(last, motion.time[of] + motion.length[of], np.append(time[1:], 0.0)) - time
        log = Log(
            time, length, motion.state[of], motion.piece[of], y[order], motion.event_time, motion.event_contact,
            motion.event_before, motion.event_phase,
        )  # fmt: skip
        number = {key: k for k, key in enumerate(zip(of.tolist(), time.tolist(), strict=True))}
        after = np.searchsorted(of, [p.segment for p in peaks], side="right").tolist()
        instants = [
            (number[p.segment, p.time] if p.later else next_one, p.later)
            for p, next_one in zip(peaks, after, strict=True)
        ]
        return log, instants

    def slopes(self, peaks: Sequence[Peak], variations: Sequence[Variation], derivative: MotionDerivative) -> Floats:
        """(M, P) derivatives of extremes.

        Parameters
        ----------
        peaks : (M,) extremes, in the order of the stored instants.
        variations : (P,) changes of numbers.
        derivative : derivatives of the motion.
        """
        flow, kept, slopes = self.motion.flow, derivative.stored, np.empty((len(peaks), len(variations)))
        used, number = np.unique([peak.row for peak in peaks], return_inverse=True)
        states = self.motion.state[[peak.segment for peak in peaks]]
        for state in np.unique(states):
            phases = flow.states[state].phases

            def factors(side: FlowOutputs, rows: Mapping[FlowOutputs, Floats], phases: Ints = phases) -> Floats:
                return side.outputs(outputs_of(side.flow, rows[side][used]), phases)

            own = factors(self.outputs, {self.outputs: self.channels.linear})
            changed = np.array([each.rates.of(partial(factors, rows=each.rows)) for each in variations])
            for k in np.flatnonzero(states == state).tolist():
                row, n = own[number[k]], flow.size
                fixed = row[:n] @ kept.S[k] + kept.instant.input_change[k] @ row[n:]
                moves = row @ kept.instant.rate[k] * kept.dt[kept.event[k]]
                slopes[k] = fixed + changed[:, number[k]] @ kept.instant.v[k] + moves
        return slopes


def _single_extreme_value(value: Value, channel: Channel, extreme: Floats) -> tuple[Floats, Floats]:
    """Value of a channel with a single extreme, and its derivative by that extreme: 1, -1 or 0.

    Parameters
    ----------
    value, channel : value, and channel of the extremes.
    extreme : (n,) extremes.
    """

    def of(number: Floats) -> Floats:
        zero = np.zeros_like(number)
        return not_none(value.from_extreme)(
            np.array([number, zero, np.abs(number) if channel.counts_pulling else number, zero])
        )

    step = 2.0**-20 * np.where(extreme == 0.0, np.abs(extreme).max(initial=0.0) or 1.0, np.abs(extreme))
    return of(extreme), np.round((of(extreme + step) - of(extreme - step)) / (2.0 * step))


def _largest_rows(numbers: Floats) -> list[int]:
    """Indices of the largest local maxima of the values (n,) along the places of a channel."""
    padded = np.pad(numbers, 1, constant_values=-np.inf)
    tops = np.flatnonzero((numbers >= padded[:-2]) & (numbers > padded[2:]))
    return tops[np.argsort(-numbers[tops], kind="stable")][:MOST_ROWS].tolist() or [int(numbers.argmax())]
