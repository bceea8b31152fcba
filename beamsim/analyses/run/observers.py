"""Histories, states and the last part of a motion that is given chunk by chunk."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.chunks import reached
from beamsim.analyses.run.energy import energies, power_factors
from beamsim.analyses.run.motion import AtContact, Histories, largest_contact
from beamsim.analyses.run.result import EnergyHistory
from beamsim.analyses.values import Extremes, extreme_times
from beamsim.flow.channels import Observed
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import Interrupted, Stop, stopped_by
from beamsim.system.equations import ChannelSet
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

VALUES_AT_ONCE = 2**22  # outputs and states at the times that are computed together
FEWEST_SAMPLES = 1000  # that are evaluated whatever time that takes


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
        self._energy, self._work = np.empty((3, times.size)), np.zeros(2)
        self._factors = power_factors(flow)
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
            found = energies(chunk, np.append(at, end), self._factors, begin, self._work)
            self._energy[:, part] = found.work_in[:-1], found.dissipated[:-1], found.stored[:-1]
            begin, self._work = float(end[0]), np.array([found.dissipated[-1], found.work_in[-1]])
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
