"""What a run reports of a motion that is not kept: gathered from stretches of it, each of which is then forgotten."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field

import numpy as np

from beamsim.analyses.run.energy import LARGEST_ERROR, EnergyBalance, energy_of_segments, unknown_energies
from beamsim.analyses.run.figures import Extreme, Extremes, energy_extremes, sampled_extremes, searched_extremes
from beamsim.analyses.run.histories import SampledHistories
from beamsim.analyses.run.impacts import ImpactRecord
from beamsim.analyses.run.low_pass import LowPassFilter, filtered_part
from beamsim.analyses.run.output_times import OutputTimes
from beamsim.analyses.run.outputs import OutputSet, energies_of_rows
from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.long_motion import LongMotion
from beamsim.flow.stopping import Stopped, check_stop, heeding
from beamsim.flow.trajectory import Trajectory
from beamsim.inputs.signal import Signal
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.system.outputs import OutputRows
from beamsim.typing import Floats

BYTES_A_PIECE = 2000  # that a motion which is kept needs for each piece of its input
STRETCH_SHARE = 0.064  # of the memory, for the pieces of a stretch
COMPARED_SHARE = 0.2  # for those of the first part, which is compared with that of a finer model
SPECTRUM_SHARE = 0.25  # for those of the last part, of which there are spectra
SEEDS_OF_A_STRETCH = 64  # times from which its search for extremes starts
FEW_SAMPLES = 20_000  # of the whole motion, that are kept for an interruption


@dataclass
class _Balance:
    """The energy balance of all stretches so far."""

    initial: float | None = None  # J, stored
    imbalance: float = 0.0  # J, at the end of the latest
    exchanged: float = 0.0
    largest_stored: float = 0.0
    peaks: list[tuple[float, float]] = field(default_factory=list)  # largest imbalance of each stretch and its end, s

    def add(self, stretch: Trajectory) -> None:
        """Include the next stretch."""
        balance = energy_of_segments(stretch)
        history = balance.history
        if self.initial is None:
            self.initial = float(history.stored[0])
        imbalance = self.imbalance + history.work_in - history.dissipated - (history.stored - history.stored[0])
        self.imbalance = float(imbalance[-1])
        self.exchanged += balance.exchanged
        self.largest_stored = max(self.largest_stored, float(history.stored.max()))
        self.peaks.append((float(np.abs(imbalance).max()), stretch.end))

    def whole(self) -> EnergyBalance:
        """That of all; it is lost by the end of a stretch."""
        if not self.peaks:
            return EnergyBalance.unknown()
        scale = max(self.largest_stored, self.exchanged)
        if scale == 0.0:
            return EnergyBalance(unknown_energies(0), 0.0, None, self.exchanged)
        lost = (end for peak, end in self.peaks if not np.isfinite(peak) or peak > LARGEST_ERROR * scale)
        worst = float(np.max([peak for peak, _ in self.peaks])) / scale
        return EnergyBalance(unknown_energies(0), worst, next(lost, None), self.exchanged)


@dataclass(frozen=True)
class StretchFigures:
    """Figures of a motion of which no segments are kept."""

    balance: EnergyBalance
    extremes: Extremes
    few: SampledHistories  # evenly spaced samples
    signals: tuple[Floats, ...]  # inputs at their times
    low_passed: Floats | None  # (nt, probes) at all output times that were reached


class LowPassed:
    """Accelerations behind the filter at all output times, led through it stretch by stretch."""

    def __init__(self, output_of: OutputOf, frequency_hz: float, times: OutputTimes, probes: int) -> None:
        self._output_of, self._times, self._through = output_of, times, LowPassFilter(frequency_hz, probes)
        self.values, self._reached = np.empty((times.size, probes)), 0
        unknown = np.full(probes, np.nan)
        self.extremes: Extreme = unknown, unknown, unknown, unknown

    def add(self, stretch: Trajectory) -> None:
        """Go on through the next stretch."""
        upto = max(self._times.until(stretch.end).size, self._reached)
        times = self._times.rows(self._reached, upto)
        self.values[self._reached : upto] = filtered_part(self._through, stretch, self._output_of, times)
        self._reached, self.extremes = upto, self._through.extremes

    @property
    def reached(self) -> Floats:
        """(nt, probes) up to where the motion is evaluated."""
        return self.values[: self._reached]


def figures_of_stretches(
    motion: LongMotion,
    searched: Mapping[str, OutputOf],
    energies: Sequence[OutputRows],
    groups: OutputSet,
    times: OutputTimes,
    stop: Callable[[], bool],
    signals: Sequence[Signal] = (),
    low_passed: LowPassed | None = None,
    impacts: ImpactRecord | None = None,
) -> StretchFigures:
    """March and evaluate stretch by stretch.

    An interruption during the evaluation of a stretch cuts the motion at its beginning; of the first one samples are
    kept.

    Parameters
    ----------
    searched : outputs by group, of which the extremes are searched for.
    energies : whose rows are the group ``energy`` of ``groups``, where there are any.
    times : of all output times, of which few are sampled.
    stop : says whether to give up an evaluation.
    signals : inputs that are sampled with the motion, while what they are made of is at hand.
    low_passed, impacts : gathered too, where they are asked for.
    """
    few = times.every(max(1, -(-times.size // FEW_SAMPLES)))
    balance, extremes, parts = _Balance(), Extremes(), list[tuple[Floats, ...]]()
    begin, sampled = 0.0, 0
    for stretch in motion.stretches():
        upto = max(few.until(stretch.end).size, sampled)
        at = few.rows(sampled, upto)
        try:
            with heeding(stop):
                check_stop()
                of_stretch = searched_extremes(stretch, searched)
                if energies:
                    of_stretch["energy"] = energy_extremes(stretch, energies, groups.groups["energy"])
                part = _sampled(stretch, at, groups, signals)
                balance.add(stretch)
                if impacts is not None:
                    impacts.add(stretch, of_stretch["force"][2])
                if low_passed is not None:
                    low_passed.add(stretch)
        except Stopped:
            if parts:
                motion.cut(begin)
                break
            of_stretch = _extremes_of_samples(stretch, searched, energies, groups)
            part = _sampled(stretch, at, groups, signals)
            motion.outcome = Outcome.of(OutcomeCode.INTERRUPTED, parameter=motion.end, unit="s")
        extremes = {name: _outer(extremes.get(name), each) for name, each in of_stretch.items()}
        parts.append(part)
        begin, sampled = stretch.end, upto
        if motion.outcome.interrupted:
            break
    at, values, touching, *inputs = (np.concatenate(column) for column in zip(*parts, strict=True))
    by_group = groups.split(values, motion.flow.system.contacts.start)
    histories = SampledHistories(at, by_group, touching.astype(bool), unknown_energies(at.size))
    if low_passed is not None:
        extremes["acceleration"] = low_passed.extremes
    return StretchFigures(
        balance.whole(), extremes, histories, tuple(inputs), None if low_passed is None else low_passed.reached,
    )  # fmt: skip


def _sampled(stretch: Trajectory, at: Floats, groups: OutputSet, signals: Sequence[Signal]) -> tuple[Floats, ...]:
    """Times (nt,), outputs (nt, k), whether contacts touch (nt, m), and inputs (nt,) there."""
    touching = stretch.flow.system.contacts.touching(stretch.phases_at(at)).astype(float)
    return (at, stretch.sample(at, groups), touching, *(signal(at) for signal in signals))


def _extremes_of_samples(
    stretch: Trajectory, searched: Mapping[str, OutputOf], energies: Sequence[OutputRows], groups: OutputSet
) -> Extremes:
    """What is quickly known of a stretch."""
    times = np.linspace(float(stretch.time[0]), stretch.end, SEEDS_OF_A_STRETCH)
    extremes = {name: sampled_extremes(times, stretch.sample(times, of)) for name, of in searched.items()}
    if energies:
        values = energies_of_rows(energies, stretch.sample(times, groups.groups["energy"]))
        extremes["energy"] = sampled_extremes(times, values)
    return extremes


def _outer(before: Extreme | None, new: Extreme) -> Extreme:
    """The lowest and the highest of two extremes, with their times."""
    if before is None:
        return new
    lower, higher = new[0] < before[0], new[2] > before[2]
    return (
        np.where(lower, new[0], before[0]), np.where(lower, new[1], before[1]),
        np.where(higher, new[2], before[2]), np.where(higher, new[3], before[3]),
    )  # fmt: skip


def station_extremes(motion: LongMotion, stress_of: OutputOf, one_figure: Collection[str] = ()) -> Extreme:
    """Extremes of the stress at every station."""
    highest: Extreme | None = None
    for part in motion.again():
        highest = _outer(highest, searched_extremes(part, {"stress": stress_of}, one_figure)["stress"])
    assert highest is not None
    return highest
