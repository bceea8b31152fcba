"""What is computed of a run: everything, or as much as some entries of its summary take.

How a run is judged does not depend on it: outcome, warnings and margins are the same whatever is needed.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from beamsim.results.values import ALWAYS_THERE, BY_ENTRY, PENETRATION, VALUES, limited, searched
from beamsim.scenario import Scenario
from beamsim.system.equations import ChannelSet
from beamsim.typing import Floats, not_none

STRESS_ENTRIES = ("largest_bending_stress_pa", "largest_bending_stress_position_m")
ROOT_MEAN_SQUARES = tuple(entry for entry, value in BY_ENTRY.items() if value.quantity and entry.startswith("rms_"))


@dataclass(frozen=True)
class Needed:
    """Which parts of a run are computed.

    Parameters
    ----------
    entries : of the summary, those that limits are compared with among them; None for everything, with histories,
        spectra and shapes.
    statistics : whether the statistics of a stationary response are.
    root_mean_squares : whether those of any other response, which belong to its spectra, are.
    every_station : whether the largest stress of every station is, not only the largest of all.
    derived : whether what is taken of the motion while it is marched is: histories, impacts, fatigue, plates.
    state_times : (nt,) s, increasing, at which states are; none by default.
    """

    entries: frozenset[str] | None = None
    statistics: bool = True
    root_mean_squares: bool = True
    every_station: bool = True
    derived: bool = True
    state_times: Floats = field(default_factory=lambda: np.zeros(0), compare=False)

    @classmethod
    def of(cls, scenario: Scenario, entries: Collection[str] | None = None) -> Self:
        """What some entries of the summary take, and the limits and settings of the scenario.

        Parameters
        ----------
        scenario : with a ``run`` section.
        entries : of the summary; None for everything.
        """
        if entries is None:
            return cls()
        settings, stationary = not_none(scenario.run), scenario.excitation.stationary
        limits = {} if scenario.limits is None else scenario.limits.given
        over_curves = {"srs_over_limit", "psd_over_limit"}  # which only limits have
        needed = (frozenset(entries) - over_curves) | {limited(name)[0].entry for name in limits}
        if settings.fatigue is not None:
            needed |= set(STRESS_ENTRIES)
        of_records = needed & {*ROOT_MEAN_SQUARES, "psd_over_limit"}
        statistics = stationary and (bool(of_records) or settings.test_duration is not None)
        return cls(
            needed,
            statistics,
            not stationary and not needed.isdisjoint(ROOT_MEAN_SQUARES),
            settings.fatigue is not None,
        )

    @property
    def everything(self) -> bool:
        """Whether nothing is left out."""
        return self.entries is None

    @property
    def histories(self) -> bool:
        """Whether histories are."""
        return self.derived and (self.everything or self.statistics)

    def has(self, *entries: str) -> bool:
        """Whether one of some entries of the summary is needed."""
        return self.entries is None or not self.entries.isdisjoint(entries)

    def searched(self, channels: ChannelSet) -> ChannelSet:
        """The channels whose extremes are searched for; warnings need those of probes and snubbers in any case."""
        if self.entries is None:
            return searched(channels)
        entries = self.entries | ({STRESS_ENTRIES[0]} if self.has(*STRESS_ENTRIES) else set())
        values = [value for value in VALUES if value.section in ALWAYS_THERE or value.entry in entries]
        return channels.only(lambda each: each.key == PENETRATION or any(value.takes(each) for value in values))


EVERYTHING = Needed()
MOTION_ALONE = Needed(derived=False)
