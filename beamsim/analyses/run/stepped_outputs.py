"""What a run reports of a time-stepped motion: samples, and extremes on the integrator's dense output."""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.analyses.run.figures import by_key, sampled_extremes
from beamsim.analyses.run.low_pass import LowPassFilter
from beamsim.analyses.values import ACCELERATION, DISPLACEMENT, Extreme, searched
from beamsim.flow.channels import outputs_of
from beamsim.flow.dense_extremes import DenseExtremes
from beamsim.flow.exact import ExactFlow
from beamsim.flow.reference import ReferenceTrajectory
from beamsim.system.channels import ChannelSet, Key, Rows
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints


class SteppedChannels:
    """Channels where the states are known, cubic springs included.

    Parameters
    ----------
    system : of the channels.
    flow : of the system.
    channels : C columns of values.
    """

    def __init__(self, system: StructuralSystem, flow: ExactFlow, channels: ChannelSet) -> None:
        self.channels, self._system, self._flow = channels, system, flow
        self._linear, self._squared = outputs_of(flow, channels.linear), outputs_of(flow, channels.squared)

    def values(self, times: Floats, y: Floats, phases: Ints, since: float | None = None) -> Floats:
        """Values where the states are known.

        Parameters
        ----------
        times : (nt,) s.
        y : (nt, N) states then.
        phases : (nt, m) of the contacts.
        since : s, time whose piece of the inputs counts; by default those at the times themselves.

        Returns
        -------
        (nt, C).
        """

        def of_rows(squared: bool) -> Floats:
            output_of = self._squared if squared else self._linear
            known = self._flow.outputs_of_states(times, y, phases, output_of, since)
            return known + self._beside(self.channels.squared if squared else self.channels.linear, times, y)

        return self.channels.values(of_rows)

    def _beside(self, rows: Rows, times: Floats, y: Floats) -> Floats | float:
        """(nt, k) what the flow does not know: cubic springs, and a motion of the base that no contact feels."""
        system, flow = self._system, self._flow
        base = None if system.base_displacement is None else system.base_displacement(times)
        known = flow.base_channel >= 0
        beside = 0.0 if base is None or known else np.multiply.outer(base, rows.base_displacement)
        if not system.cubic.count:
            return beside
        pull = system.cubic.stiffness * cubic_stretch(system, times, y) ** 3
        return beside + pull @ (rows.cubic - rows.acceleration @ system.cubic.shape.T).T


def cubic_stretch(system: StructuralSystem, times: Floats, y: Floats) -> Floats:
    """(nt, springs) stretches of the cubic springs in states y (nt, N), m."""
    cubic, base = system.cubic, system.base_displacement
    d = np.zeros(times.size) if base is None else base(times)
    return np.asarray(y[:, : system.dynamics.size] @ cubic.shape.T + d[:, None] * cubic.felt)


class SteppedOutputs:
    """Shown a motion piece by piece, it keeps the extremes of the channels.

    Parameters
    ----------
    system : of the channels.
    flow : of the system.
    times : (nt,) s, of the output.
    low_pass : Hz, of the filter of the probes' accelerations.
    """

    def __init__(self, system: StructuralSystem, flow: ExactFlow, times: Floats, low_pass: float | None = None) -> None:
        self.flow, self.times = flow, times
        self.searched = SteppedChannels(system, flow, searched(system.channels))
        self.dense = DenseExtremes()
        self.acceleration = SteppedChannels(system, flow, system.channels.of_keys(ACCELERATION))
        self.filter = None if low_pass is None else LowPassFilter(low_pass, len(system.probes))
        self.low_passed = None if low_pass is None else np.zeros((times.size, len(system.probes)))  # at the times
        self.lowest_state = self.highest_state = np.zeros(flow.size)  # at the extremes of the first probe

    def observe(self, solution: Any, phases: Ints) -> None:
        """Take a piece of the solution into the extremes."""
        begin, end = float(solution.t[0]), float(solution.t[-1])

        def values(times: Floats, y: Floats) -> Floats:
            each = np.broadcast_to(phases, (times.size, phases.size))
            return self.searched.values(times, y[:, : self.flow.size], each, begin)

        self.dense.add(solution, values)
        if self.filter is not None and self.low_passed is not None:
            self._filter_piece(self.filter, self.low_passed, solution, phases)
        found, first = self.dense.extrema(), self.searched.channels.places[DISPLACEMENT][0]
        lowest, highest = found.when_low[first], found.when_high[first]
        if begin <= lowest <= end:
            self.lowest_state = solution.sol(lowest)[: self.flow.size]
        if begin <= highest <= end:
            self.highest_state = solution.sol(highest)[: self.flow.size]

    def _filter_piece(self, low_pass: LowPassFilter, out: Floats, solution: Any, phases: Ints) -> None:
        """Lead the filter through the integrator's dense output; panels end at its steps and at the output times."""
        begin, end = float(solution.t[0]), float(solution.t[-1])

        def acceleration(times: Floats) -> Floats:
            y = solution.sol(times)[: self.flow.size].T
            return self.acceleration.values(times, y, np.broadcast_to(phases, (times.size, phases.size)), begin)

        here = (self.times >= begin) & (self.times <= end)
        known = np.union1d(solution.t, self.times[here])
        history = low_pass.through(known, acceleration)
        out[here] = history[np.searchsorted(known, self.times[here])]

    def extremes(self, trajectory: ReferenceTrajectory) -> dict[Key, Extreme]:
        """Of the continuous motion; of a motion without length those of its start."""
        channels = self.searched.channels
        if self.dense.search is not None:
            of_all = self.dense.extrema().extremes
        else:
            values = self.searched.values(trajectory.time, trajectory.y, trajectory.phases)
            of_all = sampled_extremes(trajectory.time, values)
        extremes = by_key(channels, of_all)
        return extremes if self.filter is None else extremes | {ACCELERATION: self.filter.extremes}
