"""What is taken of a motion chunk by chunk, while it is marched: histories, states, its last part.

Every chunk is seen once and may be forgotten.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from beamsim.analyses.run.energy import EnergyHistory, sampled_stored_energy, work_factors
from beamsim.flow.channels import Observed
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import Interrupted, Stop, check_stop, stopped_by
from beamsim.results.values import FORCE, Extremes, by_magnitude, extreme_times
from beamsim.system.equations import ChannelSet, Key
from beamsim.system.structural import StructuralSystem
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
            with stopped_by(self._stop):
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


class AtContact(NamedTuple):
    """A motion at a time."""

    time: float  # s
    state: Floats  # (2n or more,)
    opening: Floats  # (snubbers or more,) m, distances to the faces as they are then


class LargestContact(NamedTuple):
    """The largest contact force of a motion."""

    snubber: int
    force: float  # N
    time: float  # s


def largest_contact(system: StructuralSystem, extremes: Extremes) -> LargestContact | None:
    """That of a structure of several bodies, of which there is a sketch; None without contact."""
    if len(system.bodies) < 2 or not system.snubbers:
        return None
    forces, times = by_magnitude(system.channels.of_keys(FORCE).channels, extremes[FORCE])[2:]
    forces = np.where([s.gap_unit == "m" for s in system.snubbers], forces, 0.0)  # moments have no place in the sketch
    at = int(forces.argmax())
    return LargestContact(at, float(forces[at]), float(times[at])) if forces[at] > 0.0 else None


class HistoryRecorder:
    """Channels, contacts and energies at the output times.

    Parameters
    ----------
    flow : of the motion.
    channels : that are sampled.
    times : (nt,) increasing, s; those after the end of the motion are left out.
    overdue : asked now and then whether to end.
    """

    def __init__(self, flow: ExactFlow, channels: ChannelSet, times: Floats, overdue: Stop) -> None:
        self._observed, self._contacts, self._times = Observed(flow, channels), flow.system.contacts, times
        self._overdue, self._ended, self._filled = overdue, False, 0
        self._values = np.empty((channels.order.size, times.size)).T  # each column in one piece
        self._touching = np.empty((flow.system.contacts.count, times.size), dtype=bool).T
        self._energy, self._work = np.empty((3, times.size)), 0.0
        self._factors = work_factors(flow)
        self._at_once = max(VALUES_AT_ONCE // (channels.order.size + flow.size), 1)

    def add(self, chunk: Trajectory) -> None:
        """Sample the next chunk, unless an earlier one was left out."""
        if self._ended:
            return
        last = reached(chunk.end, self._times).size
        try:
            with stopped_by(self._overdue):
                self.record(chunk, last)
        except Interrupted:
            self._ended = True
            if not self._filled:
                self.record(chunk, min(last, FEWEST_SAMPLES))

    def record(self, chunk: Trajectory, last: int) -> None:
        """Values at the next output times, up to a number of all, and the work until the end of the chunk."""
        begin, first = float(chunk.time[0]), self._filled
        for number in range(first, max(last, first + 1), self._at_once):
            part = slice(number, min(number + self._at_once, last))
            at = np.minimum(self._times[part], chunk.end)
            self._values[part] = self._observed.values(chunk, at)
            self._touching[part] = self._contacts.touching(chunk.phases_at(at))
            end = at[-1:] if part.stop < last else [chunk.end]
            work = self._work + chunk.product_integrals(np.append(at, end), *self._factors, begin)[:, 0]
            self._energy[0, part], self._energy[2, part] = work[:-1], sampled_stored_energy(chunk, at)
            self._energy[1, part] = work[:-1] - (self._energy[2, part] - self._energy[2, 0])
            begin, self._work = float(end[0]), float(work[-1])
            self._filled = part.stop

    def result(self) -> Histories:
        """At the output times up to which the motion was evaluated."""
        part = slice(0, self._filled)
        energy = EnergyHistory(*self._energy[:, part])
        return Histories(
            self._times[part], self._observed.channels, self._values[part], self._touching[part], energy
        )  # fmt: skip


class LatestPart:
    """The end of a motion, of some length, s."""

    def __init__(self, length: float) -> None:
        self._length, self._chunks = length, list[Trajectory]()

    def add(self, chunk: Trajectory) -> None:
        """Keep the next chunk, and forget those that ended before this part."""
        self._chunks = [each for each in (*self._chunks, chunk) if each.end > chunk.end - self._length]
        self._chunks = self._chunks or [chunk]

    def result(self) -> Trajectory:
        """The segments of this part; the first one may begin before it."""
        whole = Trajectory.joined(self._chunks)
        begin = whole.end - self._length
        return whole.within(begin, whole.end) if begin > whole.time[0] else whole


class StatesAtExtremes:
    """States where the first probe has its extremes, and where the largest contact force is.

    Parameters
    ----------
    system : that moves.
    size : N, of its states.
    """

    def __init__(self, system: StructuralSystem, size: int) -> None:
        self._system, self._times = system, np.full(2, np.nan)
        self._states = np.zeros((2, size))
        self.at_contact: AtContact | None = None

    def add(self, chunk: Trajectory, extremes: Extremes) -> None:
        """Include the next chunk; extremes are those of the motion up to its end."""
        times = extreme_times(extremes)
        for k in np.flatnonzero(times != self._times[: times.size]).tolist():
            self._times[k], self._states[k] = times[k], chunk.states_at(times[[k]])[0]
        self._states = self._states[: times.size]
        contact = largest_contact(self._system, extremes)
        if contact is not None and (self.at_contact is None or contact.time != self.at_contact.time):
            at, flow = np.array([contact.time]), chunk.flow
            openings = chunk.sample(at, lambda phases: flow.at(phases).openings)[0]
            self.at_contact = AtContact(contact.time, chunk.states_at(at)[0], openings)

    @property
    def states(self) -> Floats:
        """(2, N) at the lowest and the highest point of the first probe; (0, N) without probes."""
        return self._states


class StatesAtTimes:
    """States (nt, N) at increasing times (nt,), s, as far as the motion goes."""

    def __init__(self, times: Floats, size: int) -> None:
        self._times, self._states = times, [np.zeros((0, size))]
        self._found = 0

    def add(self, chunk: Trajectory) -> None:
        """Include the next chunk."""
        last = reached(chunk.end, self._times).size
        if last > self._found:
            self._states.append(chunk.states_at(np.minimum(self._times[self._found : last], chunk.end)))
            self._found = last

    def result(self) -> Floats:
        """(nt or fewer, N)."""
        return np.concatenate(self._states)
