"""Channels along a motion: their values and extremes, and Fourier coefficients and means of outputs."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import Extrema
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transforms import NEIGHBOURS, evenly_spaced_sums, interpolated, values_to_sum
from beamsim.outcomes import check_stop
from beamsim.system.equations import ChannelSet, Key, RowsOf, Sizes
from beamsim.typing import Complexes, Floats, Ints

Exponentials = tuple[tuple[int, float], ...]
r"""A window on [0, T] as a sum of :math:`c e^{-i \pi s u / T}`: whole numbers s, and factors c."""
MARGIN = 18  # half steps of frequency beyond the highest, that windows need


def outputs_of(flow: ExactFlow, rows: Floats) -> RowsOf:
    """Rows of channels on the equations of a flow, cubic springs apart.

    Parameters
    ----------
    flow : of the system that the channels belong to.
    rows : (k, W) of them, see `beamsim.system.equations.Sizes`.

    Returns
    -------
    The rows (k, V) by the phases of the contacts.
    """
    equations, system, signals = flow.equations, flow.system, len(flow.forcing.signal)
    parts = Sizes(system.size, system.contacts.count, signals, 0).parts  # those of cubic springs are the last ones
    of = {name: rows[:, columns] for name, columns in parts.items()}
    fixed = equations.rows(rows.shape[0], coordinates=of["displacement"], velocities=of["velocity"])
    fixed += equations.constant(of["constant"][:, 0]) + of["load"] @ equations.signals(np.arange(signals))
    if flow.observers:  # of which the first is the base's acceleration
        fixed += of["base_acceleration"] * equations.signals(np.array([flow.first_observer]))
    if flow.base_channel >= 0:
        fixed += of["base_displacement"] * equations.signals(np.array([flow.base_channel]))
    of_phases = {name: of[name] for name in ("contact", "opening", "acceleration")}
    varying = np.flatnonzero(np.hstack([*of_phases.values()]).any(axis=1))
    contact, opening, acceleration = (part[varying] for part in of_phases.values())

    def rows_of(phases: Ints) -> Floats:
        if not varying.size:
            return fixed
        at, every = flow.at(phases), fixed.copy()
        every[varying] += contact @ at.force
        if opening.any():
            every[varying] += opening @ at.openings
        if acceleration.any():
            every[varying] += acceleration @ at.rates[equations.velocities]
        return every

    return rows_of


def channel_values(motion: Trajectory, channels: ChannelSet, times: Floats) -> Floats:
    """(nt, C) channels of a motion at increasing times, s; at an event the state after it counts."""
    flow = motion.flow
    return channels.values(
        lambda of: motion.sample(times, outputs_of(flow, channels.squared if of else channels.linear))
    )


def channel_extrema(motion: Trajectory, channels: ChannelSet, largest_of: Key | None = None) -> Extrema:
    """(C,) extreme values of channels of the continuous motion and their times, s; see `Trajectory.extrema`.

    Parameters
    ----------
    motion, channels : C columns of values along a motion.
    largest_of : section and quantity of linear channels of whose extremes only the largest magnitude is asked for; of
        the others that is a bound from within.
    """
    order, rivals = channels.order, None if largest_of is None else channels.order[channels.places[largest_of]]
    found = motion.extrema(outputs_of(motion.flow, channels.linear), rivals=rivals)
    values, evaluations = np.array(found[:4]), found.evaluations
    if channels.squares.size:
        squares = motion.extrema(outputs_of(motion.flow, channels.squared), squares=channels.squares)
        values, evaluations = np.hstack([values, squares[:4]]), evaluations + squares.evaluations
    low, when_low, high, when_high = values[:, order]
    return Extrema(low, when_low, high, when_high, evaluations)


class MotionPart:
    """K outputs on a part of a motion, with its Fourier integrals up to a frequency, free of aliasing.

    Parameters
    ----------
    motion : the part.
    rows_of : the outputs.
    highest : rad/s, up to which Fourier integrals are asked for; the side lobes of windows may lie beyond.
    known : of what is known already: (K, count) Fourier integrals at multiples of half the inverse of the duration.
    """

    def __init__(self, motion: Trajectory, rows_of: RowsOf, highest: float, known: Complexes | None = None) -> None:
        self.motion = motion.held() if motion.flow.dropped else motion
        self.rows_of, self.highest, self.begin = rows_of, highest, float(motion.time[0])
        self.duration = motion.end - self.begin  # s
        if known is None:
            step, outputs = np.pi / self.duration, rows_of(motion.flow.system.contacts.start).shape[0]
            count = int(highest / step) + 2 * (MARGIN + NEIGHBOURS)  # twice: every other serves half of the time
            values = values_to_sum(self.motion, rows_of, step * (count - 1))
            known = evenly_spaced_sums(values, step, count, outputs).T
        self.known, self.means = known, known[:, 0].real / self.duration
        self._weighted: dict[Exponentials, Complexes] = {}

    def weighted(self, window: Exponentials) -> Complexes:
        """(K, count) Fourier integrals under a window, at the same frequencies but the last, which it needs."""
        if window not in self._weighted:
            known, reach = self.known, max(abs(steps) for steps, _ in window)
            whole = np.concatenate([known[:, reach:0:-1].conj(), known], axis=1)
            total = np.zeros((known.shape[0], known.shape[1] - reach), dtype=complex)
            for steps, factor in window:
                total += factor * whole[:, reach + steps : reach + steps + total.shape[1]]
            self._weighted[window] = total
        return self._weighted[window]

    def integrals(self, omega: Floats, column: int, window: Exponentials = ((0, 1.0),)) -> Complexes:
        """Fourier integrals of one of the outputs.

        Parameters
        ----------
        omega : (W,) rad/s, up to the highest.
        column : of the K outputs.
        window : that the output is multiplied with.

        Returns
        -------
        (W,) since the begin.
        """
        check_stop()
        position = omega * (self.duration / np.pi)
        whole = np.rint(position)
        known = self.weighted(window)[column]
        if np.all(np.abs(position - whole) < 1e-9):  # of a step: no interpolation changes these
            found = known[np.abs(whole).astype(np.int64)]
        else:
            found = interpolated(known, np.abs(position))
        return np.asarray(np.where(position < 0.0, found.conj(), found))

    @cached_property
    def mean_squares(self) -> Floats:
        """(K,) means of the squares."""
        return np.asarray(self.motion.square_integrals(self.rows_of) / self.duration)

    @cached_property
    def extrema(self) -> Extrema:
        """(K,) extreme values."""
        return self.motion.extrema(self.rows_of)

    @cached_property
    def quarter_deviations(self) -> tuple[Floats, Floats]:
        """(K,) root mean squares about the means, of the first and of the last quarter of the time.

        They are of what the means leave, so that a large one costs no digits.
        """
        constant = self.motion.flow.equations.constant(self.means)
        first, second, *_, third, end = np.linspace(self.begin, self.motion.end, 5).tolist()
        squares = [
            motion.square_integrals(lambda phases: self.rows_of(phases) - constant) / (motion.end - motion.time[0])
            for motion in (self.motion.between(first, second), self.motion.between(third, end))
        ]
        early, late = np.sqrt(np.maximum(squares, 0.0))
        return early, late

    @cached_property
    def halves(self) -> tuple[MotionPart, MotionPart]:
        """Both halves of the time; the second has what the first leaves of the whole, at every other frequency."""
        begin, middle, end = np.linspace(self.begin, self.motion.end, 3).tolist()
        early = MotionPart(self.motion.between(begin, middle), self.rows_of, self.highest)
        whole = self.known[:, ::2]
        left = (whole - early.known[:, : whole.shape[1]]) * (-1.0) ** np.arange(whole.shape[1])
        return early, MotionPart(self.motion.between(middle, end), self.rows_of, self.highest, left)

    def divided(self, parts: int) -> list[MotionPart]:
        """Equal parts of the time, one after the other."""
        edges = np.linspace(self.begin, self.motion.end, parts + 1).tolist()
        return [MotionPart(self.motion.between(*span), self.rows_of, self.highest) for span in pairwise(edges)]
