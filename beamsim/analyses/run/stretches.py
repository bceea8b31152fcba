"""What a run reports of a motion that is not kept: gathered from stretches of it, each of which is then forgotten."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from beamsim.analyses.run.energy import LARGEST_ERROR, EnergyBalance, energy_of_segments, unknown_energies
from beamsim.analyses.run.figures import Extreme, Extremes, energy_extremes, refine_extremes
from beamsim.analyses.run.histories import SampledHistories
from beamsim.analyses.run.output_times import OutputTimes
from beamsim.analyses.run.outputs import OutputOf, OutputSet
from beamsim.flow.long_motion import LongMotion
from beamsim.flow.stopping import Stopped, heeding
from beamsim.flow.trajectory import Trajectory
from beamsim.system.outputs import OutputRows
from beamsim.typing import Bools, Floats

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
        scale = max(self.largest_stored, self.exchanged)
        if scale == 0.0 or not self.peaks:
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


def figures_of_stretches(
    motion: LongMotion,
    searched: Mapping[str, OutputOf],
    energies: Sequence[OutputRows],
    groups: OutputSet,
    times: OutputTimes,
    stop: Callable[[], bool],
) -> StretchFigures:
    """March and evaluate stretch by stretch.

    An interruption during the evaluation of a stretch cuts the motion at its beginning, but for the first.

    Parameters
    ----------
    searched : outputs by group, of which the extremes are searched for.
    energies : whose rows are the group ``energy`` of ``groups``, where there are any.
    times : of all output times, of which few are sampled.
    stop : says whether to give up an evaluation.
    """
    few = times.every(max(1, -(-times.size // FEW_SAMPLES)))
    balance, extremes, parts = _Balance(), Extremes(), list[tuple[Floats, Floats, Bools]]()
    begin, sampled = 0.0, 0
    for stretch in motion.stretches():
        try:
            with heeding(stop if parts else _never):
                of_stretch = refine_extremes(stretch, searched, np.linspace(begin, stretch.end, SEEDS_OF_A_STRETCH))
                if energies:
                    of_stretch["energy"] = energy_extremes(stretch, energies, groups.groups["energy"])
                upto = max(few.until(stretch.end).size, sampled)
                at = few.rows(sampled, upto)
                values = stretch.sample(at, groups)
                touching = motion.flow.system.contacts.touching(stretch.phases_at(at))
                balance.add(stretch)
        except Stopped:
            motion.cut(begin)
            break
        extremes = {name: _outer(extremes.get(name), each) for name, each in of_stretch.items()}
        parts.append((at, values, touching))
        begin, sampled = stretch.end, upto
    at, values, touching = (np.concatenate([part[k] for part in parts]) for k in range(3))
    by_group = groups.split(values, motion.flow.system.contacts.start)
    histories = SampledHistories(at, by_group, touching.astype(bool), unknown_energies(at.size))
    return StretchFigures(balance.whole(), extremes, histories)


def _never() -> bool:
    return False


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
    for begin in np.arange(0.0, motion.end, motion.stretch_s):
        part = motion.within(float(begin), min(float(begin) + motion.stretch_s, motion.end))
        times = np.linspace(float(part.time[0]), part.end, SEEDS_OF_A_STRETCH)
        highest = _outer(highest, refine_extremes(part, {"stress": stress_of}, times, one_figure)["stress"])
    assert highest is not None
    return highest
