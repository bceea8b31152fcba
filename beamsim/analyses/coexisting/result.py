"""The result of a search for coexisting motions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from beamsim.analyses.continuation.result import OF_STABLE, ContinuationResult
from beamsim.fields import (
    JSON,
    ByName,
    Counter,
    Entry,
    Flag,
    Number,
    Text,
    attribute,
    axis,
    dataset,
    declared,
    list_of,
    record,
    stored,
    table,
)
from beamsim.results.result import CONVERGENCE, MARGINS, OF_MODES, PROCESSOR_TIME, STATUS
from beamsim.typing import Floats, Ints

_START = Counter("start_number", "number of the start")
_STARTS = ("frequency_hz", _START)


@declared
class CoexistingMotion:
    """A motion found at a frequency."""

    frequency_hz: float = dataset("Hz", "frequency of the excitation")
    number: int = dataset("1", "number at its frequency, from 1: those that most starts come to first")
    kind: str = dataset("1", "periodic, quasi-periodic or chaotic")
    period_cycles: int = dataset("1", "period in cycles of the excitation; 0 of a motion that is not periodic")
    stable: bool = dataset("1", "whether it attracts its neighbours", flags=("unstable", "stable"))
    starts: int = dataset("1", "number of starts that come to it")
    share: float = dataset("1", "share of the starts that come to it; NaN of an unstable motion")
    share_low: float = dataset("1", "lower end of the 95 % interval of that probability (Clopper and Pearson)")
    share_high: float = dataset("1", "upper end")
    lyapunov_exponent: float = dataset("1/s", "largest Lyapunov exponent, of a periodic motion from its multipliers")
    largest_multiplier: float = dataset("1", "modulus of the largest Floquet multiplier over the period")


@declared
class SmallestDisturbance:
    """The smallest disturbance found that leaves a motion."""

    frequency_hz: float = dataset("Hz", "frequency of the excitation")
    number: int = dataset("1", "number of the motion at its frequency")
    kind: str = dataset("1", "impulse or base_pulse")
    probe: str = dataset("1", "probe of the impulse; empty for a pulse of the base")
    unit: str = dataset("1", "unit of the amplitude")
    amplitude: float = dataset("1", "smallest one found that leaves the motion; NaN where none of those tried does")
    time_s: float = dataset("s", "time in the motion's period at which it acts")
    largest_tried: float = dataset("1", "largest amplitude that is tried")


MOTION = record({
    "kind": Text, "stable": Flag,
    **dict.fromkeys(("frequency_hz", "number", "period_cycles", "share", "share_low", "share_high",
                     "largest_multiplier"), Number),
}, dict.fromkeys(("peak_displacement_m", "peak_force_n"), ByName))  # fmt: skip
DISTURBANCE = record({
    "probe": Text, "unit": Text,
    **dict.fromkeys(("frequency_hz", "number", "amplitude", "time_s", "largest_tried"), Number),
})  # fmt: skip


@declared(kw_only=True, repr=False)
class CoexistingResult(ContinuationResult):
    """Everything `beamsim sweep` of kind coexisting computes: each motion is a branch of one point.

    Of a motion that is not periodic the branch has many cycles.
    """

    DATASET = "starts"
    KIND = "coexisting"
    SUMMARY = (
        STATUS,
        Entry("motions", "", "each motion: frequency, kind, period, stability, share of the starts with its interval, "
              "largest multiplier and Lyapunov exponent, largest values by entry and name", form=list_of(MOTION)),
        Entry("not_settled", "1", "by frequency (Hz) the number of starts that are near no motion after the largest "
              "number of cycles", form=ByName),
        Entry("disturbances", "", "the smallest disturbance found that leaves each stable periodic motion: amplitude "
              "(unknown where none leaves), unit, time in its period", form=list_of(DISTURBANCE)),
        Entry("starts", "1", "number of starts at each frequency"),
        *OF_STABLE,
        Entry("energy_error", "1", "largest imbalance of the energies over a period, relative to the energy", "solver"),
        MARGINS, *OF_MODES, *CONVERGENCE, PROCESSOR_TIME,
    )  # fmt: skip

    motions: tuple[CoexistingMotion, ...] = table(
        "motions", CoexistingMotion, Counter("motion", "number of the motion")
    )
    frequency_hz: Floats = axis("Hz", "frequency of the excitation")
    coordinate_names: tuple[str, ...] = attribute("", "what is drawn of each start, JSON list", codec=JSON)
    coordinate_units: tuple[str, ...] = attribute("", "their units, JSON list", codec=JSON)
    start: Floats = dataset(
        "1", "coordinates of each start", along=(_START, Counter("drawn", "number of what is drawn"))
    )
    destination: Ints = dataset(
        "1", "number of the motion at the frequency that a start comes to; 0 where it has not settled", along=_STARTS
    )
    cycles: Ints = dataset("1", "cycles of the excitation until then; 0 of a start that was left out", along=_STARTS)
    disturbances: tuple[SmallestDisturbance, ...] = table(
        "disturbances", SmallestDisturbance, Counter("disturbance", "number of the disturbance"), default=()
    )

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """That of values which the name does not say; see `Result.unit_of`."""
        if entry.name == "disturbances" and keys[0] in ("amplitude", "largest_tried"):
            return str(record["unit"])
        return super().unit_of(entry, place, keys, record)

    @property
    def not_settled(self) -> Ints:
        """(F,) number of starts at each frequency that have not settled."""
        return np.asarray(np.sum((self.destination == 0) & (self.cycles > 0), axis=1))

    @property
    @stored(attribute("", "kind of sweep", name="kind"))
    def _kind(self) -> str:
        return "coexisting"
