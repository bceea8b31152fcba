"""Result of a search for coexisting motions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.analyses.continuation.result import OF_STABLE, ContinuationResult
from beamsim.labelled import Layout, Variable
from beamsim.results.branch import BRANCHES, FLAGS, POINTS, SPECIAL_POINTS
from beamsim.results.result import CONVERGENCE, MARGINS, OF_MODES, PROCESSOR_TIME, STATUS
from beamsim.summaries import ByName, Entry, Flag, Number, Text, list_of, record
from beamsim.system.structural import MODES
from beamsim.typing import Ints

_MOTION, _FREQUENCY, _START, _DRAWN, _DISTURBANCE = (
    ("motion",), ("frequency_hz",), ("start_number",), ("drawn",), ("disturbance",)
)  # fmt: skip
_HZ = "frequency of the excitation"
MOTIONS = Layout(
    "motions",
    "The motions found at each frequency, a row for each; each is the branch of the same number.",
    {
        "motion": Variable(_MOTION, "1", "number of the motion", int),
        "frequency_hz": Variable(_MOTION, "Hz", _HZ),
        "number": Variable(
            _MOTION, "1", "number of the motion at its frequency, from 1, the one that most starts lead to first", int
        ),
        "kind": Variable(_MOTION, "", "periodic, quasi-periodic or chaotic", str),
        "period_cycles": Variable(
            _MOTION, "1", "period in cycles of the excitation; 0 of a motion that is not periodic", int
        ),
        "stable": Variable(_MOTION, "1", "whether it attracts its neighbours", bool, flags=FLAGS),
        "starts": Variable(_MOTION, "1", "number of starts that lead to it", int),
        "share": Variable(_MOTION, "1", "share of the starts that lead to it; NaN for an unstable motion"),
        "share_low": Variable(_MOTION, "1", "lower end of the 95 % interval of that probability (Clopper and Pearson)"),
        "share_high": Variable(_MOTION, "1", "upper end"),
        "lyapunov_exponent": Variable(
            _MOTION, "1/s", "largest Lyapunov exponent, of a periodic motion from its multipliers"
        ),
        "largest_multiplier": Variable(_MOTION, "1", "modulus of the largest Floquet multiplier over the period"),
    },
)
STARTS = Layout(
    "starts",
    "Where each start ends at each frequency; the starts are the same at all frequencies.",
    {
        "frequency_hz": Variable(_FREQUENCY, "Hz", _HZ),
        "start_number": Variable(_START, "1", "number of the start", int),
        "drawn": Variable(_DRAWN, "1", "number of the drawn quantity", int),
        "coordinate_name": Variable(_DRAWN, "", "quantity of each start that is drawn", str),
        "coordinate_unit": Variable(_DRAWN, "", "its unit", str),
        "start": Variable(_START + _DRAWN, "", "coordinates of each start"),
        "destination": Variable(
            _FREQUENCY + _START, "1",
            "number of the motion at the frequency that a start leads to; 0 if it has not settled", int,
        ),
        "cycles": Variable(
            _FREQUENCY + _START, "1", "cycles of the excitation until then; 0 of a start that was left out", int
        ),
    },
)  # fmt: skip
DISTURBANCES = Layout(
    "disturbances",
    "The smallest disturbance found that leaves each stable periodic motion.",
    {
        "disturbance": Variable(_DISTURBANCE, "1", "number of the disturbance", int),
        "frequency_hz": Variable(_DISTURBANCE, "Hz", _HZ),
        "number": Variable(_DISTURBANCE, "1", "number of the motion at its frequency", int),
        "kind": Variable(_DISTURBANCE, "", "impulse or base_pulse", str),
        "probe": Variable(_DISTURBANCE, "", "probe of the impulse; empty for a pulse of the base", str),
        "unit": Variable(_DISTURBANCE, "", "unit of the amplitude", str),
        "amplitude": Variable(
            _DISTURBANCE, "{unit}", "smallest disturbance found that ends the motion; NaN if none that was tried does"
        ),
        "time_s": Variable(_DISTURBANCE, "s", "time in the motion's period at which it acts"),
        "largest_tried": Variable(_DISTURBANCE, "{unit}", "largest amplitude that is tried"),
    },
    optional=True,
)


MOTION = record({
    "kind": Text, "stable": Flag,
    **dict.fromkeys(("frequency_hz", "number", "period_cycles", "share", "share_low", "share_high",
                     "largest_multiplier"), Number),
}, dict.fromkeys(("peak_displacement_m", "peak_force_n"), ByName))  # fmt: skip
DISTURBANCE = record({
    "probe": Text, "unit": Text,
    **dict.fromkeys(("frequency_hz", "number", "amplitude", "time_s", "largest_tried"), Number),
})  # fmt: skip


@dataclass(frozen=True, kw_only=True, repr=False)
class CoexistingResult(ContinuationResult):
    """Result of `beamsim.coexisting`: the motions found, each a branch of one point, and where every start ended.

    A motion that is not periodic is represented by many cycles.

    Examples
    --------
    >>> import beamsim
    >>> found = {"sweep": {"kind": "coexisting", "at": ["16 Hz"], "starts": {"kind": "phases", "number": 3}}}
    >>> result = beamsim.coexisting(beamsim.load_scenario("configs/stops/chain_bumpers.yaml", found))
    >>> result["motions"].rows("motion", "kind", "period_cycles", "stable", "starts")
    [{'kind': 'periodic', 'period_cycles': 1, 'stable': True, 'starts': 3}]
    >>> result["starts"]["destination"].values.tolist(), result.not_settled.tolist()
    ([[1, 1, 1]], [0])
    """

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

    DATASETS = (MODES, BRANCHES, POINTS, SPECIAL_POINTS, MOTIONS, STARTS, DISTURBANCES)

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of values whose entry does not name it; see `Result.unit_of`."""
        if entry.name == "disturbances" and keys[0] in ("amplitude", "largest_tried"):
            return str(record["unit"])
        return super().unit_of(entry, place, keys, record)

    @property
    def not_settled(self) -> Ints:
        """(F,) number of starts at each frequency that did not settle."""
        starts = self["starts"]
        return np.asarray(np.sum((starts["destination"].values == 0) & (starts["cycles"].values > 0), axis=1))
