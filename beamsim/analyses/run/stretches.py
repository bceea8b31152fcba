"""What a run reports of its motion, gathered stretch by stretch; each may then be forgotten."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.energy import BalanceOfStretches, energies_of_segments
from beamsim.analyses.run.figures import extremes_of
from beamsim.analyses.run.filtered_motion import filtered
from beamsim.analyses.run.histories import reached
from beamsim.analyses.run.impacts import ImpactRecord
from beamsim.analyses.run.low_pass import LowPassFilter
from beamsim.analyses.values import ACCELERATION, Extreme, searched
from beamsim.flow.channels import Observed
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.scenario.run import Run
from beamsim.system.channels import Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats


class StretchFigures:
    """Peaks and energy balance of a motion that is given stretch by stretch.

    Parameters
    ----------
    observed : channels whose extremes are searched for.
    impacts : record that the stretches are added to.
    low_passed : the filter that they are led through; the extremes of accelerations are those behind it.
    """

    def __init__(
        self, observed: Observed, impacts: ImpactRecord | None = None, low_passed: LowPassed | None = None
    ) -> None:
        self.observed, self.impacts, self.low_passed = observed, impacts, low_passed
        self.balance, self.extremes = BalanceOfStretches(), dict[Key, Extreme]()

    @classmethod
    def of_run(cls, system: StructuralSystem, settings: Run, flow: ExactFlow, times: Floats) -> StretchFigures:
        """Those that a run reports.

        Parameters
        ----------
        system, settings : of the run.
        flow : of the motion.
        times : (nt,) s, all output times.
        """
        channels, low_passed = searched(system.channels), None
        if settings.low_pass is not None:
            channels, accelerations = channels.without(ACCELERATION), system.channels.of_keys(ACCELERATION)
            low_passed = LowPassed(Observed(flow, accelerations).linear, settings.low_pass, times, len(system.probes))
        impacts = None if settings.impacts is None else ImpactRecord(system, settings.impacts)
        return cls(Observed(flow, channels), impacts, low_passed)

    def add(self, stretch: Trajectory) -> None:
        """Include the next stretch."""
        balance = energies_of_segments(stretch)
        found = extremes_of(stretch, self.observed) if self.observed.channels.channels else {}
        if self.impacts is not None:
            self.impacts.add(stretch)
        if self.low_passed is not None:
            found[ACCELERATION] = self.low_passed.add(stretch)
        self.balance.add(*balance)
        self.extremes = {name: outer(self.extremes.get(name), each) for name, each in found.items()}


class LowPassed:
    """Accelerations behind the filter at all output times, led through it stretch by stretch.

    Parameters
    ----------
    output_of : accelerations of the probes.
    frequency_hz : of the filter.
    times : (nt,) s, all output times.
    probes : number of accelerations.
    """

    def __init__(self, output_of: OutputOf, frequency_hz: float, times: Floats, probes: int) -> None:
        self._output_of, self._frequency_hz, self._times = output_of, frequency_hz, times
        self._through, self._begin, self._reached = LowPassFilter(frequency_hz, probes), 0.0, 0
        self.values = np.empty((times.size, probes))

    def add(self, stretch: Trajectory) -> Extreme:
        """Go on through the next stretch, and return its lowest and highest values."""
        upto = max(reached(stretch, self._times).size, self._reached)
        times = np.minimum(self._times[self._reached : upto], stretch.end)
        behind = filtered(stretch, self._output_of, self._frequency_hz, times, self._through)
        self.values[self._reached : upto] = behind.at(times)
        begin, self._begin, self._reached = self._begin, stretch.end, upto
        return behind.extremes(begin, stretch.end)

    @property
    def reached(self) -> Floats:
        """(nt, probes) up to where the motion is evaluated."""
        return self.values[: self._reached]


def outer(before: Extreme | None, new: Extreme) -> Extreme:
    """The lowest and the highest of two extremes, with their times."""
    if before is None:
        return new
    lower, higher = new[0] < before[0], new[2] > before[2]
    return (
        np.where(lower, new[0], before[0]), np.where(lower, new[1], before[1]),
        np.where(higher, new[2], before[2]), np.where(higher, new[3], before[3]),
    )  # fmt: skip
