"""Channels along a motion: their values and extremes, and Fourier coefficients and means of outputs."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import Extrema
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transforms import NEIGHBOURS, evenly_spaced_integrals, interpolated
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


class Observed:
    """Channels on the motions of one flow, and of those that share its signals.

    Parameters
    ----------
    flow : of the system.
    channels : C columns of values.
    largest_of : section and quantity of linear channels of whose extremes only the largest magnitude is asked for; of
        the others that is a bound from within.
    """

    def __init__(self, flow: ExactFlow, channels: ChannelSet, largest_of: Key | None = None) -> None:
        self.channels = channels
        self._rivals = None if largest_of is None else channels.order[channels.places[largest_of]]
        self.linear, self.squared = outputs_of(flow, channels.linear), outputs_of(flow, channels.squared)

    def values(self, motion: Trajectory, times: Floats) -> Floats:
        """(nt, C) at increasing times, s; at an event the state after it counts."""
        return self.channels.values(lambda squared: motion.sample(times, self.squared if squared else self.linear))

    def extrema(self, motion: Trajectory) -> Extrema:
        """(C,) extreme values of the continuous motion and their times, s; see `Trajectory.extrema`."""
        found, order = motion.extrema(self.linear, rivals=self._rivals), self.channels.order
        values, evaluations = np.array(found[:4]), found.evaluations
        if self.channels.squares.size:
            squares = motion.extrema(self.squared, squares=self.channels.squares)
            values, evaluations = np.hstack([values, squares[:4]]), evaluations + squares.evaluations
        low, when_low, high, when_high = values[:, order]
        return Extrema(low, when_low, high, when_high, evaluations)

    def extremes(self, motion: Trajectory) -> dict[Key, Floats]:
        """By section and quantity (4, k): lowest values of the continuous motion, their times, highest ones, theirs."""
        return self.channels.split(np.array(self.extrema(motion)[:4]))


@dataclass(frozen=True)
class MotionPart:
    """K outputs on a part of a motion, with its Fourier integrals up to a frequency, free of aliasing.

    Parameters
    ----------
    motion : cut to the part; its contact states are all kept.
    rows_of : the outputs.
    highest : rad/s, up to which Fourier integrals are asked for; the side lobes of windows may lie beyond.
    before : of a second half: the whole, and its first half.
    """

    motion: Trajectory
    rows_of: RowsOf
    highest: float
    before: tuple[MotionPart, MotionPart] | None = None
    _weighted: dict[Exponentials, Complexes] = field(default_factory=dict, compare=False)

    @classmethod
    def of(cls, trajectory: Trajectory, rows_of: RowsOf, span: tuple[float, float], highest: float) -> MotionPart:
        """The outputs between two times.

        Parameters
        ----------
        trajectory, rows_of : the motion and K outputs.
        span : s, begin and end, within the motion.
        highest : rad/s, of the Fourier integrals.

        Returns
        -------
        MotionPart
        """
        return cls(trajectory.between(*span).held(), rows_of, highest)

    @property
    def begin(self) -> float:
        """When the part begins, s."""
        return float(self.motion.time[0])

    @property
    def duration(self) -> float:
        """Its length, s."""
        return self.motion.end - self.begin

    @cached_property
    def known(self) -> Complexes:
        """(K, count) Fourier integrals at multiples of half the inverse of the duration."""
        if self.before is not None:  # what the first half leaves of the whole, at every other of its frequencies
            whole, first = self.before[0].known[:, ::2], self.before[1].known
            return np.asarray((whole - first[:, : whole.shape[1]]) * (-1.0) ** np.arange(whole.shape[1]))
        step = np.pi / self.duration
        count = int(self.highest / step) + 2 * (MARGIN + NEIGHBOURS)  # twice: every other serves half of the time
        return evenly_spaced_integrals(self.motion, self.rows_of, step, count)

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
    def means(self) -> Floats:
        """(K,) mean values."""
        return np.asarray(self.known[:, 0].real / self.duration)

    @cached_property
    def mean_squares(self) -> Floats:
        """(K,) means of the squares."""
        return np.asarray(self.motion.square_integrals(self.rows_of) / self.duration)

    def deviations(self, levels: Floats) -> Floats:
        """(K,) root mean squares about levels (K,), without the digits that a large mean costs."""

        constant = self.motion.flow.equations.constant(levels)

        def about(phases: Ints) -> Floats:
            return self.rows_of(phases) - constant

        return np.sqrt(np.maximum(self.motion.square_integrals(about) / self.duration, 0.0))

    @cached_property
    def extrema(self) -> Extrema:
        """(K,) extreme values."""
        return self.motion.extrema(self.rows_of)

    @cached_property
    def quarter_deviations(self) -> tuple[Floats, Floats]:
        """(K,) root mean squares about the means, of the first and of the last quarter of the time."""
        first, *_, last = self.divided(4)
        return first.deviations(self.means), last.deviations(self.means)

    @cached_property
    def halves(self) -> tuple[MotionPart, MotionPart]:
        """Both halves of the time."""
        early, late = self.divided(2)
        return early, MotionPart(late.motion, self.rows_of, self.highest, (self, early))

    def divided(self, parts: int) -> list[MotionPart]:
        """Equal parts of the time, one after the other."""
        edges = np.linspace(self.begin, self.motion.end, parts + 1)
        cut = [self.motion.between(*map(float, span)) for span in pairwise(edges)]
        return [MotionPart(each, self.rows_of, self.highest) for each in cut]
