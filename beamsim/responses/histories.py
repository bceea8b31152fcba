r"""A motion at the output times: sampling during the march, and an estimate of the aliased content.

In a spectrum of samples, content above half the sampling rate is aliased to lower frequencies. The acceleration of a
motion with impacts jumps, so that no rate is high enough. The aliased content is visible between the samples: at a
share :math:`s` of a step after a sample, content below half the rate equals a weighted sum of the samples around, while
content that is shifted by :math:`m` times the rate is rotated by :math:`2 \pi m s`. The difference from the sum is
:math:`2 |\sin \pi m s|` times its size; with the golden ratio as :math:`s` it is never near zero. It is divided by the
value for :math:`m = 1`, where most of the content lies.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy as copied
from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from beamsim.flow.channels import outputs_of
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import Interrupted, Progress, Stop, check_stop, stop_requests
from beamsim.responses.energies import EnergyHistory, stored_energy, work_factors
from beamsim.results.values import merge_extremes
from beamsim.signals.filters import FilteredMotion, LinearFilter, butterworth
from beamsim.system.equations import ChannelSet, Key
from beamsim.typing import Bools, Floats, Ints

VALUES_AT_ONCE = 2**20  # outputs and states computed at once, in less than a second
FEWEST_SAMPLES = 1000  # evaluated before a time limit counts
ROUND_OFF = 1e-12  # relative, of the last output time
NOTABLE = 1e-3  # aliased share of the root mean square above which a warning is given: -60 dB, as for listed lines
_NEIGHBOURS = 20  # samples on either side in the sum
_SHARPNESS = 7.0  # of its Kaiser window: -70 dB, and a transition of a tenth of the rate about half of it
BETWEEN = 0.5 * (3.0 - 5.0**0.5)  # place between two samples at which the motion is compared, of a step
_BLOCKS, _BLOCK = 16, 4096  # evaluated blocks of a long record, evenly spread, and samples in each


def samples_until(end: float, rate: float) -> int:
    """Number of samples from 0 to an end, s, which the last one may pass by round-off."""
    return int(end * rate * (1.0 + ROUND_OFF)) + 1


def times_reached(end: float, times: Floats) -> Floats:
    """The times up to the end of a motion, s."""
    return times[: np.searchsorted(times, end * (1.0 + ROUND_OFF), side="right")]


@dataclass(frozen=True)
class Histories:
    """A motion at the output times."""

    time: Floats  # (nt,) s
    channels: ChannelSet
    values: Floats  # (nt, C) of the channels
    in_contact: Bools  # (nt, m) whether each contact touches
    energy: EnergyHistory

    def of(self, key: Key) -> Floats:
        """(nt, k) of the channels of a section and quantity: no copy where they are evenly spaced, as most are."""
        columns = self.channels.places[key]
        distance = np.diff(columns)
        if columns.size and np.all(distance == distance[:1]) and np.all(distance > 0):
            return self.values[:, columns[0] : columns[-1] + 1 : distance[0] if distance.size else 1]
        return np.asarray(self.values[:, columns])


class HistoryRecorder:
    """Channels, contacts and energies at the output times.

    Parameters
    ----------
    flow : of the motion.
    channels : that are sampled.
    times : (nt,) increasing, s; those after the end of the motion are left out.
    overdue : asked now and then whether to end.
    progress : called with the share of a chunk that is sampled.
    """

    histories: Histories  # at the output times up to which the motion was evaluated

    def __init__(
        self, flow: ExactFlow, channels: ChannelSet, times: Floats, stop: Stop, progress: Progress = None
    ) -> None:
        self._channels, self._contacts, self._times = channels, flow.system.contacts, times
        self._overdue, self._progress, self._ended, self._filled = stop, progress, False, 0
        self._values = np.empty((channels.order.size, times.size)).T  # each column in one piece
        self._touching = np.empty((flow.system.contacts.count, times.size), dtype=bool).T
        self._energy, self._work = np.empty((3, times.size)), 0.0
        self._factors = work_factors(flow)
        self._at_once = max(VALUES_AT_ONCE // (channels.order.size + flow.size), 1)

    def add(self, chunk: Trajectory) -> None:
        """Sample the next chunk, unless sampling has stopped."""
        if not self._ended:
            last = times_reached(chunk.end, self._times).size
            try:
                with stop_requests(self._overdue, at_once=True, progress=self._progress):
                    self.record(chunk, last)
            except Interrupted:
                self._ended = True
                if not self._filled:
                    self.record(chunk, min(last, FEWEST_SAMPLES))
        part = slice(0, self._filled)
        self.histories = Histories(
            self._times[part], self._channels, self._values[part], self._touching[part],
            EnergyHistory(*self._energy[:, part]),
        )  # fmt: skip

    def record(self, chunk: Trajectory, count: int) -> None:
        """Store values up to output time number ``count``, and the work until the end of the chunk."""
        begin, first, flow, channels = float(chunk.time[0]), self._filled, chunk.flow, self._channels
        output_of, states = outputs_of(flow, channels.rows), [flow.equations.state, flow.equations.penetration]
        for number in range(first, max(count, first + 1), self._at_once):
            check_stop((number - first) / max(count - first, 1))
            part = slice(number, min(number + self._at_once, count))
            at = np.minimum(self._times[part], chunk.end)
            phases = chunk.phases[chunk.segments_at(at)]
            # the terms of the motion are evaluated once at these times, for all linear outputs
            sampled = chunk.sample(at, lambda of: np.vstack([output_of(of), *states]))
            values, y, penetration = np.split(sampled, np.cumsum([channels.rows.shape[0], flow.size]), axis=1)
            self._values[part] = channels.values(values)
            self._touching[part] = self._contacts.closed(phases)
            end = at[-1:] if part.stop < count else [chunk.end]
            work = self._work + chunk.product_integrals(np.append(at, end), *self._factors, begin)[:, 0]
            self._energy[0, part] = work[:-1]
            self._energy[2, part] = stored_energy(flow.system, y, penetration, phases)
            self._energy[1, part] = work[:-1] - (self._energy[2, part] - self._energy[2, 0])
            begin, self._work = float(end[0]), float(work[-1])
            self._filled = part.stop


class LowPassed:
    """Low-pass filtered accelerations at all output times, computed part by part.

    Parameters
    ----------
    frequency_hz : of the filter.
    times : (nt,) s, all output times.
    probes : number of accelerations.
    """

    def __init__(self, frequency_hz: float, times: Floats, probes: int) -> None:
        self.frequency_hz, self.filter = frequency_hz, LinearFilter(*butterworth(frequency_hz), probes)
        self._times, self._begin, self._reached = times, 0.0, 0
        self.values = np.zeros((times.size, probes))  # zero after the end of the motion
        self.extremes: Floats | None = None  # (4, probes) lowest, its time, highest, its time

    def copy(self) -> LowPassed:
        """A copy with a filter state of its own; both write into the same array of values."""
        copy = copied(self)
        copy.filter = deepcopy(self.filter)
        return copy

    def add(self, end: float, filtered_at: Callable[[Floats], FilteredMotion]) -> None:
        """Continue to the end of the next part; ``filtered_at`` returns the filtered motion of it at output times
        (nt,)."""
        upto = max(times_reached(end, self._times).size, self._reached)
        times = np.minimum(self._times[self._reached : upto], end)
        motion = filtered_at(times)
        self.values[self._reached : upto] = motion.at(times)
        self.extremes = merge_extremes(self.extremes, np.array(motion.extremes(self._begin, end)))
        self._begin, self._reached = end, upto


def between_samples(time: Floats) -> Floats:
    """(2 n - 1,) s, times of samples (n,), s, and times between them for `share_above_half_rate`."""
    both = np.repeat(time, 2)[:-1]
    both[1::2] += BETWEEN * np.diff(time)
    return both


def share_above_half_rate(values: Floats, position: float = BETWEEN) -> Floats:
    """Root mean square of the content above half the sampling rate, over the standard deviation.

    Parameters
    ----------
    values : (2 n - 1, k) samples, and the values between each two of them.
    position : of the values between samples, as a share of a step.

    Returns
    -------
    (k,)
        Zero for a constant signal, nan if there are fewer samples than the sum needs.
    """
    samples = values[::2]
    if samples.shape[0] <= 2 * _NEIGHBOURS:
        return np.full(values.shape[1], np.nan)
    variance = np.var(samples, axis=0)
    ratio = np.divide(_content(values, position), variance, out=np.zeros_like(variance), where=variance > 0.0)
    return np.asarray(np.sqrt(ratio))


def share_of_blocks(time: Floats, samples: Floats, columns: Ints, signals_at: Callable[[Floats], Floats]) -> Floats:
    """Shares (k,) as `share_above_half_rate`, from blocks of samples of signals that can be evaluated at any time.

    Parameters
    ----------
    time : (n,) s, of the samples.
    samples : (n, c) with the signals in some columns (k,).
    columns : (k,).
    signals_at : (k,) signals at times.
    """
    length = min(time.size, _BLOCK)
    if length <= 2 * _NEIGHBOURS:
        return np.full(columns.size, np.nan)
    content = []
    for first in np.linspace(0, time.size - length, min(_BLOCKS, time.size // length)).astype(int).tolist():
        values = np.empty((2 * length - 1, columns.size))
        values[::2] = samples[first : first + length, columns]
        at_samples = time[first : first + length]
        values[1::2] = signals_at(at_samples[:-1] + BETWEEN * np.diff(at_samples))
        content.append(_content(values, BETWEEN))
    variance = np.array([np.var(samples[:, column]) for column in columns])
    ratio = np.divide(np.mean(content, axis=0), variance, out=np.zeros_like(variance), where=variance > 0.0)
    return np.asarray(np.sqrt(ratio))


def _content(values: Floats, position: float) -> Floats:
    """(k,) mean square of the content above half the rate, from values (2 n - 1, k), see `share_above_half_rate`."""
    samples, between = values[::2], values[1::2]
    distance = np.arange(-_NEIGHBOURS, _NEIGHBOURS) + position
    inside = np.sqrt(np.maximum(1.0 - (distance / _NEIGHBOURS) ** 2, 0.0))
    weight = np.sinc(distance) * np.i0(_SHARPNESS * inside)
    weight /= weight.sum()
    expected = np.array([np.convolve(x, weight, "valid") for x in samples.T]).T
    first = _NEIGHBOURS - 1
    difference = between[first : first + expected.shape[0]] - expected
    return np.asarray(np.mean(difference**2, axis=0) / (2.0 * np.sin(np.pi * position)) ** 2)
