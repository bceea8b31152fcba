"""What a run reports at its output times, computed when it is first read."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from beamsim.analyses.run.energy import energy_history, unknown_energies
from beamsim.analyses.run.figures import Extreme, Extremes, refine_extremes, sampled_extremes
from beamsim.analyses.run.outputs import OutputOf, OutputSet
from beamsim.analyses.run.result import EnergyHistory
from beamsim.flow.stopping import Stopped, heeding
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Bools, Floats

GRACE_S = 0.3  # of processor time, for the evaluation of a motion that is stopped
SAMPLES_TO_SEED_STRESS = 2000  # values from which the search for the largest stress of every station starts


class Grace:
    """Time that remains for evaluating a motion once it is to be stopped."""

    def __init__(self, stop: Callable[[], bool]) -> None:
        self.stop = stop
        self.since: float | None = None  # s of processor time, when that was first seen

    def __call__(self) -> bool:
        """Whether the time is over."""
        if self.since is None and self.stop():
            self.since = clock.process_time()
        return self.since is not None and clock.process_time() - self.since >= GRACE_S


class Histories(Protocol):
    """A motion at the output times."""

    @property
    def time(self) -> Floats:
        """(nt,) s."""

    @property
    def values(self) -> Mapping[str, Floats]:
        """(nt, k) by group of outputs."""

    @property
    def closed(self) -> Bools:
        """(nt, m) whether each contact touches."""

    @property
    def energy(self) -> EnergyHistory:
        """Energies, nan where their computation was interrupted."""


@dataclass(frozen=True)
class SampledHistories:
    """Those of a motion from time stepping."""

    time: Floats
    values: Mapping[str, Floats]
    closed: Bools
    energy: EnergyHistory


class ExactHistories:
    """Those of a motion in closed form, each computed on first use.

    Parameters
    ----------
    groups : the outputs.
    time : (nt,) s, output times.
    stop : asked several times a second whether to give up the energies and peaks.
    """

    def __init__(self, trajectory: Trajectory, groups: OutputSet, time: Floats, stop: Callable[[], bool]) -> None:
        self._trajectory, self._groups, self._stop, self.time = trajectory, groups, stop, time

    @cached_property
    def values(self) -> Mapping[str, Floats]:
        """(nt, k) by group of outputs."""
        sampled = self._trajectory.sample(self.time, self._groups)
        return self._groups.split(sampled, self._trajectory.flow.system.contacts.start)

    @cached_property
    def closed(self) -> Bools:
        """(nt, m) whether each contact touches."""
        return self._trajectory.flow.system.contacts.touching(self._trajectory.phases_at(self.time))

    @cached_property
    def energy(self) -> EnergyHistory:
        """Energies, nan where their computation was interrupted."""
        try:
            with heeding(self._stop):
                return energy_history(self._trajectory, self.time).history
        except Stopped:
            return unknown_energies(self.time.size)

    def extremes(self, searched: Mapping[str, OutputOf]) -> Extremes:
        """Extremes of the samples of some outputs."""
        return {
            name: sampled_extremes(self.time, self._trajectory.sample(self.time, output_of))
            for name, output_of in searched.items()
        }

    def station_extremes(self, stress_of: OutputOf) -> Extreme:
        """Extremes of the stress at every station; those of samples where the search was interrupted."""
        few = self.time[:: max(1, self.time.size // SAMPLES_TO_SEED_STRESS)]
        try:
            with heeding(self._stop):
                return refine_extremes(self._trajectory, {"stress": stress_of}, few, one_figure=())["stress"]
        except Stopped:
            return sampled_extremes(few, self._trajectory.sample(few, stress_of))
