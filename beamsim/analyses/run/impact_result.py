"""What a run reports of its impacts and of the fatigue of its bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from beamsim.fields import Counter, attribute, dataset, declared, group, key, named, stored, table
from beamsim.typing import Bools, Floats, Ints

AT_REST = 1e-9  # of the highest approach speed, below which an impact begins at rest
_IMPACT = (Counter("impact", "number of the impact"),)
_CYCLE = (Counter("cycle", "number of the counted cycle"),)


@declared
class FigureInterval:
    """One figure of a random input with its interval."""

    figure: str = dataset("1", "name of the figure")
    value: float = dataset("", "its value without the first part of the run, in its SI unit")
    low: float = dataset("", "lower end of the interval, 95 %")
    high: float = dataset("", "upper end of the interval, 95 %")


@declared(along=_CYCLE)
class Rainflow:
    """Cycles counted as in ASTM E1049, in the order in which they close."""

    unit: str = attribute("", "unit of range and mean")
    range: Floats = dataset("{unit}", "range of the cycle, largest less smallest value")
    mean: Floats = dataset("{unit}", "mean of the two")
    count: Floats = dataset("1", "1 of a whole cycle, 0.5 of a half one")

    def exceedance(self) -> tuple[Floats, Floats]:
        """Ranges, largest first, and the number of cycles that have this range or a larger one."""
        order = np.argsort(-self.range, kind="stable")
        return self.range[order], np.cumsum(self.count[order])


@declared
class SnubberImpacts:
    """Impacts at one snubber; means are over the impacts that are counted, nan without one."""

    name: str = key("name of the snubber")
    number: int = attribute("1", "impacts that are counted")
    cut: int = attribute("1", "of them those that last when the run begins or ends")
    below_threshold: int = attribute("1", "impacts left out, whose peak force is below the threshold")
    rate_hz: float = attribute("Hz", "impacts per second")
    contact_share: float = attribute("1", "share of the time in contact, with the impacts left out")
    mean_contact_time_s: float = attribute("s", "mean time in contact of an impact")
    longest_contact_time_s: float = attribute("s", "longest time in contact of an impact")
    peak_force_n: float = attribute("N", "largest peak force")
    mean_peak_force_n: float = attribute("N", "mean peak force")
    mean_impulse_n_s: float = attribute("N s", "mean impulse of an impact")
    highest_approach_speed_m_s: float = attribute("m/s", "largest approach speed")
    mean_approach_speed_m_s: float = attribute("m/s", "mean approach speed")
    restitution: float = attribute("1", "root of the mean square of separation speeds over that of approach speeds")
    mean_energy_lost_j: float = attribute("J", "mean energy lost in an impact")
    # of all contact, below the threshold or not
    impulse_n_s: float = attribute("N s", "integral of the contact force over the run")
    energy_lost_j: float = attribute("J", "energy lost in the snubber over the run")
    mean_force_n: float = attribute("N", "mean contact force over the run")
    rms_force_n: float = attribute("N", "root mean square of the contact force over the run")
    mean_force_in_contact_n: float = attribute("N", "mean contact force over the time in contact")
    rms_force_in_contact_n: float = attribute("N", "root mean square of the contact force over the time in contact")
    rainflow: Rainflow = group("rainflow", Rainflow)  # of the force
    # of a random input
    intervals: tuple[FigureInterval, ...] = table(
        "intervals", FigureInterval, Counter("number", "number of the figure"), empty=False, default=()
    )

    def summary(self) -> dict[str, Any]:
        """The numbers by name."""
        left_out = ("name", "rainflow", "intervals")
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in left_out}
        if self.intervals:
            values["intervals"] = {row.figure: [row.low, row.high] for row in self.intervals}
        return values


@declared(along=_IMPACT)
class Impacts:
    """Every impact of the run that is counted, in order of time, and the statistics of each snubber."""

    minimum_rest_s: float = attribute("s", "contacts of one snubber that are less far apart are one impact")
    force_threshold_n: float = attribute("N", "impacts with a smaller peak force are left out")
    snubber: Ints = dataset("1", "index of the snubber, from 0")
    begin: Floats = dataset("s", "time at which the impact begins, or the run where it is in contact then")
    end: Floats = dataset("s", "time at which the impact ends, or the run where that is before")
    contact_time: Floats = dataset("s", "time in contact; less than end - begin where contacts are joined")
    contacts: Ints = dataset("1", "contacts that are joined in the impact")
    peak_force: Floats = dataset("N", "largest force")
    peak_time: Floats = dataset("s", "time of the largest force")
    impulse: Floats = dataset("N s", "integral of the force")
    approach_speed: Floats = dataset(
        "m/s", "rate of penetration when the impact begins; NaN where the run begins in contact"
    )
    separation_speed: Floats = dataset(
        "m/s", "separation speed at the end of the impact; NaN where the run ends in contact"
    )
    energy_lost: Floats = dataset(
        "J", "energy lost in the snubber from the beginning of the impact to that of the next"
    )
    cut: Bools = dataset("1", "whether the impact lasts when the run begins or ends", flags=("whole", "cut"))
    snubbers: dict[str, SnubberImpacts] = named("snubbers", SnubberImpacts)

    @property
    @stored(dataset("1", "separation speed over approach speed; NaN where either is unknown or none"))
    def restitution(self) -> Floats:
        """(n,) nan where one is unknown, or the impact begins at rest."""
        begins = self.approach_speed > AT_REST * np.nanmax(self.approach_speed, initial=0.0)
        return np.where(begins, self.separation_speed / np.where(begins, self.approach_speed, 1.0), np.nan)

    def summary(self) -> dict[str, Any]:
        """Statistics by snubber."""
        return {name: snubber.summary() for name, snubber in self.snubbers.items()}

    def total(self) -> dict[str, float]:
        """Those of all snubbers together."""
        each = list(self.snubbers.values())
        return {
            "number": sum(s.number for s in each),
            "rate_hz": sum(s.rate_hz for s in each),
            "peak_force_n": max(s.peak_force_n for s in each),
            "impulse_n_s": sum(s.impulse_n_s for s in each),
            "energy_lost_j": sum(s.energy_lost_j for s in each),
        }


@declared
class Fatigue:
    """Rainflow count of the bending stress of one body where it is largest, and its damage by an S-N line."""

    name: str = key("name of the body")
    position: float = attribute("m", "where the stress is largest, on a plate its x")
    cycles: float = attribute("1", "cycles counted")
    largest_range_pa: float = attribute("Pa", "largest stress range")
    equivalent_range_pa: float = attribute("Pa", "constant range that does the same damage in as many cycles")
    damage: float = attribute("1", "damage of the run by Palmgren and Miner; 1 is failure")
    life_s: float = attribute("s", "time to damage 1 if the run is repeated; infinite without damage")
    rainflow: Rainflow = group("rainflow", Rainflow)
    across: float | None = attribute("m", "on a plate its y", default=None)

    def summary(self) -> Mapping[str, Any]:
        """The numbers by name."""
        left_out = ("name", "rainflow")
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in left_out}
        return {name: value for name, value in values.items() if value is not None}
