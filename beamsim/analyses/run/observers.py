"""What is taken of a motion chunk by chunk, while it is marched: histories, and what takes long.

Every chunk is seen once and may be forgotten.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from beamsim.flow.channels import channel_values
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import Interrupted, Stop, asked_by, check_stop
from beamsim.responses.energies import EnergyHistory, sampled_stored_energy, work_factors
from beamsim.system.equations import ChannelSet, Key
from beamsim.typing import Bools, Floats

VALUES_AT_ONCE = 2**22  # outputs and states at the times that are computed together
FEWEST_SAMPLES = 1000  # that are evaluated whatever time that takes
ROUND_OFF = 1e-12  # relative, of the last output time


class ChunkObserver(ABC):
    """Evaluates chunk after chunk, the latest one when the next comes or when the result is asked for.

    What takes long is so computed after the values of the motion itself, if the motion is one chunk.

    Parameters
    ----------
    stop : asked during a march whether to end; there is no result then.
    """

    def __init__(self, stop: Stop) -> None:
        self._stop, self._interrupted = stop, False
        self._latest: Trajectory | None = None

    def add(self, chunk: Trajectory) -> None:
        """Take the next chunk."""
        try:
            with asked_by(self._stop, at_once=True):
                self.finish()
        except Interrupted:
            self._interrupted = True
        self._latest = chunk

    def finish(self) -> None:
        """Evaluate the latest chunk.

        Raises
        ------
        Interrupted
            If this or an earlier chunk is not evaluated.
        """
        if self._interrupted:
            raise Interrupted
        if self._latest is not None:
            check_stop()
            self.evaluate(self._latest)
        self._latest = None

    @abstractmethod
    def evaluate(self, chunk: Trajectory) -> None:
        """Include a chunk, as the one after those before."""


def samples_until(end: float, rate: float) -> int:
    """Number of samples from 0 to an end, s, which the last one may pass by round-off."""
    return int(end * rate * (1.0 + ROUND_OFF)) + 1


def reached(end: float, times: Floats) -> Floats:
    """The times up to the end of a motion, s."""
    return times[: np.searchsorted(times, end * (1.0 + ROUND_OFF), side="right")]


@dataclass(frozen=True)
class Histories:
    """A motion at the output times."""

    time: Floats  # (nt,) s
    channels: ChannelSet
    values: Floats  # (nt, C) of the channels
    touching: Bools  # (nt, m) whether each contact touches
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
    """

    histories: Histories  # at the output times up to which the motion was evaluated

    def __init__(self, flow: ExactFlow, channels: ChannelSet, times: Floats, overdue: Stop) -> None:
        self._channels, self._contacts, self._times = channels, flow.system.contacts, times
        self._overdue, self._ended, self._filled = overdue, False, 0
        self._values = np.empty((channels.order.size, times.size)).T  # each column in one piece
        self._touching = np.empty((flow.system.contacts.count, times.size), dtype=bool).T
        self._energy, self._work = np.empty((3, times.size)), 0.0
        self._factors = work_factors(flow)
        self._at_once = max(VALUES_AT_ONCE // (channels.order.size + flow.size), 1)

    def add(self, chunk: Trajectory) -> None:
        """Sample the next chunk, unless an earlier one was left out."""
        if not self._ended:
            last = reached(chunk.end, self._times).size
            try:
                with asked_by(self._overdue, at_once=True):
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

    def record(self, chunk: Trajectory, last: int) -> None:
        """Values at the next output times, up to a number of all, and the work until the end of the chunk."""
        begin, first = float(chunk.time[0]), self._filled
        for number in range(first, max(last, first + 1), self._at_once):
            part = slice(number, min(number + self._at_once, last))
            at = np.minimum(self._times[part], chunk.end)
            self._values[part] = channel_values(chunk, self._channels, at)
            self._touching[part] = self._contacts.touching(chunk.phases[chunk.segments_at(at)])
            end = at[-1:] if part.stop < last else [chunk.end]
            work = self._work + chunk.product_integrals(np.append(at, end), *self._factors, begin)[:, 0]
            self._energy[0, part], self._energy[2, part] = work[:-1], sampled_stored_energy(chunk, at)
            self._energy[1, part] = work[:-1] - (self._energy[2, part] - self._energy[2, 0])
            begin, self._work = float(end[0]), float(work[-1])
            self._filled = part.stop
