"""Channels of a system, written as outputs of a flow, and what a motion makes of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from beamsim.flow.contact_state import LinearOutput, OutputOf
from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import Extrema
from beamsim.flow.trajectory import Trajectory
from beamsim.system.equations import ChannelSet, Key, Rows
from beamsim.typing import Floats, Ints


class Acting(NamedTuple):
    """What acts on a structure, as outputs of a flow."""

    load: LinearOutput  # L signals of the forcing
    base_acceleration: LinearOutput  # 1; zero where the flow has no observer, which is the base's acceleration
    base_displacement: LinearOutput  # 1; zero where no contact feels it

    @classmethod
    def on(cls, flow: ExactFlow) -> Acting:
        """What acts on the structure of a flow."""
        signals = len(flow.forcing.signal)

        def of(numbers: Ints) -> LinearOutput:
            output = flow.empty_output(numbers.size)
            output.direct[:] = numbers[:, None] == flow.sources.channel
            return output

        nothing = flow.empty_output(1)
        base = of(np.array([flow.first_observer])) if flow.observers else nothing
        displaced = of(np.array([flow.base_channel])) if flow.base_channel >= 0 else nothing
        return cls(of(np.arange(signals)), base, displaced)


def outputs_of(flow: ExactFlow, rows: Rows, acting: Acting | None = None) -> OutputOf:
    """Rows of channels as outputs of a flow, cubic springs apart.

    Parameters
    ----------
    flow : of the system that the channels belong to.
    rows : (k,) of them.
    acting : what the signals of the loads and the base's motion are, by default those of the flow.

    Returns
    -------
    The outputs (k,) by the phases of the contacts.
    """
    n, acting = flow.system.size, acting or Acting.on(flow)
    fixed = acting.load.combined(rows.load)
    fixed += acting.base_acceleration.combined(rows.base_acceleration[:, None])
    fixed += acting.base_displacement.combined(rows.base_displacement[:, None])
    fixed.row[:, :n] += rows.displacement
    fixed.row[:, n : 2 * n] += rows.velocity
    fixed.direct[:, 0] += rows.constant
    varying = np.flatnonzero(rows.acceleration.any(axis=1) | rows.contact.any(axis=1))
    of_phases = rows.some(varying)
    shape = of_phases.acceleration

    def output_of(phases: Ints) -> LinearOutput:
        if not varying.size:
            return fixed
        output = LinearOutput(fixed.row.copy(), fixed.direct.copy(), fixed.direct_slope.copy())
        added = flow.contact_forces(phases).combined(of_phases.contact)
        if shape.any():
            stiffness, damping, internal, load, load_slope = flow.equation_of_motion(phases)
            rates = np.hstack([-stiffness, -damping, internal])
            added += LinearOutput(shape @ rates, shape @ load.T, shape @ load_slope.T)
        output.row[varying] += added.row
        output.direct[varying] += added.direct
        output.direct_slope[varying] += added.direct_slope
        return output

    return output_of


class Observed:
    """Channels on the motions of one flow, and of those that share its signals.

    Parameters
    ----------
    flow : of the system.
    channels : C columns of values.
    """

    def __init__(self, flow: ExactFlow, channels: ChannelSet) -> None:
        self.channels = channels
        self.linear, self.squared = outputs_of(flow, channels.linear), outputs_of(flow, channels.squared)

    def values(self, motion: Trajectory, times: Floats) -> Floats:
        """(nt, C) at increasing times, s; at an event the state after it counts."""
        return self.channels.values(lambda squared: motion.sample(times, self.squared if squared else self.linear))

    def extrema(self, motion: Trajectory) -> Extrema:
        """(C,) extreme values of the continuous motion and their times, s; see `Trajectory.extrema`."""
        found, squares = motion.extrema(self.linear), self.channels.squares
        if squares.size:
            found = found.beside(motion.extrema(self.squared, squares=squares))
        return found.some(self.channels.order)

    def extremes(self, motion: Trajectory) -> dict[Key, Floats]:
        """By section and quantity (4, k): lowest values of the continuous motion, their times, highest ones, theirs."""
        return self.channels.split(np.array(self.extrema(motion).extremes))
