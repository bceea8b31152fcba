"""The result of ``beamsim nnm``: branches of nonlinear normal modes, one motion, and comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from beamsim.analyses.nnm.layouts import (
    BRANCHES,
    JUMPS,
    MOTION,
    MULTIPLE_SCALES,
    PHASE_RESONANCE,
    POINTS,
    PREDICTED_LEVELS,
    RELAXED_MINIMISATION,
    RESONANCE_CURVES,
    UNCONTROLLED,
    UNCONTROLLED_SPECTRA,
)
from beamsim.labelled import Dataset
from beamsim.results.branch import SPECIAL_POINTS, rows_by_owner
from beamsim.results.result import CONVERGENCE, PROCESSOR_TIME, STATUS, Result
from beamsim.summaries import Entry, Flag, Number, Plain, Text, list_of, record
from beamsim.system.structural import MODES

POINT = record(dict.fromkeys(("parameter", "frequency_hz", "energy_j"), Number))
REQUESTED_POINT = record(
    {"quantity": Text, **dict.fromkeys(("value", "branch", "parameter", "frequency_hz", "energy_j"), Number)},
    {"stable": Flag},
)
RESONANCE = record(
    {"found": Flag, "level": Number, "predicted_frequency_hz": Number, "predicted_amplitude_m": Number},
    {"stable": Flag, **dict.fromkeys(("frequency_hz", "amplitude_m", "level_for_amplitude"), Number)},
)
FULL_PERIOD = record({"symmetry_breakings": list[Plain], "never_at_rest": list[Plain]})
RELAXED = record(dict.fromkeys(("steps", "steps_converged", "largest_frequency_difference", "cost_ratio"), Number))
OF_LEVELS = record({"quantity": Text, "unit": Text, "probe": Text, "levels": list_of(RESONANCE)})
TONGUE = record(dict.fromkeys(("mode", "ratio", "parameter"), Number))
_SUMMARY = (
    STATUS,
    Entry("mode", "1", "number of the mode", form=Number),
    Entry("continued_in", variable="branches/continued_in"),
    Entry("points", "1", "points of the backbone"),
    Entry("energy_error", "1", "largest change of the energy along a motion of any branch, relative to the energy",
             "solver"),
    Entry("stable_points", "1", "number of stable ones"),
    Entry("start", "", "first point of the backbone: parameter, frequency, energy", form=POINT),
    Entry("end", "", "last point of the backbone: parameter, frequency, energy", form=POINT),
    Entry("period_s", "s", "period of the last point"),
    Entry("linear_frequency_hz", "Hz", "frequency of the linear mode"),
    Entry("internal_resonances", "", "by tongue: mode, ratio, parameter where it leaves the backbone, points",
             form=list_of(TONGUE)),
    Entry("jumps", "", "gaps of the backbone at tongues: start and end in the parameter, mode and ratio where known",
             form=list[Plain]),
    Entry("special_points", "", "folds, branch points and grazings of the backbone: kind, parameter, frequency",
             form=list[Plain]),
    Entry("requested_points", "", "points at the energies and frequencies asked for: quantity, value, branch and point "
             "(from 1), parameter, frequency, energy, share, stable or not",
             form=list_of(REQUESTED_POINT)),
    Entry("full_period", "", "of full-period shooting: difference from half-period shooting, symmetry breakings and "
             "branches of non-brake orbits", form=FULL_PERIOD),
    Entry("multiple_scales", "", "of the expansion: frequencies, differences from exact motions and observed orders",
             form=record({"observed_order_frequency": list[Number]})),
    Entry("relaxed_minimisation", "", "steps, functional, differences from exact motions and cost", form=RELAXED),
    Entry("phase_resonance", "", "of forced motions at phase resonance: quantity, unit, probe, and level by level "
             "what was predicted and found", form=OF_LEVELS),
    Entry("motion_frequency_hz", "Hz", "frequency of the motion that is drawn", "drawn motion"),
    Entry("motion_drift", "1", "relative change of the state over the periods of its spectrum",
             "drawn motion",
             "motion/drift"),
    Entry("motion_periods", "1", "number of these periods", "drawn motion", variable="motion/periods"),
    Entry("method", section="solver", variable="branches/method"),
    Entry("largest_residual", "1", "largest residual of the periodicity condition along the backbone",
             "solver"),
    Entry("smallest_share", "1", "smallest share of the energy in the mode at the slowest instant, along the backbone"),
    Entry("smallest_share_at", "", "value of the parameter at that point"),
    *CONVERGENCE,
    PROCESSOR_TIME,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, repr=False)
class NormalModeResult(Result):
    """Result of `beamsim.nnm`: the backbone of a nonlinear normal mode, and what was compared with it.

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.nnm("configs/modes/chain_cubic.yaml")
    >>> result.parameter, result.unit, len(result.branches)
    ('stiffness_factor', '1', 1)
    >>> result.branches[0]["frequency_hz"].values[[0, -1]].round(5).tolist()
    [0.24886, 0.24945]
    """

    KIND = "nnm"
    SUMMARY = _SUMMARY
    DATASETS = (
        MODES, BRANCHES, POINTS, SPECIAL_POINTS, JUMPS, MOTION, PHASE_RESONANCE, PREDICTED_LEVELS, RESONANCE_CURVES,
        UNCONTROLLED, UNCONTROLLED_SPECTRA, MULTIPLE_SCALES, RELAXED_MINIMISATION,
    )  # fmt: skip

    @cached_property
    def branches(self) -> tuple[Dataset, ...]:
        """A dataset for each branch: its points, and its row of ``branches``; the backbone first."""
        return rows_by_owner(self["branches"], self["points"], "branch")

    @property
    def parameter(self) -> str:
        """Continuation parameter: stiffness_factor, energy or frequency."""
        return str(self["branches"]["continued_in"].item())

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of values whose entry does not name it; see `Result.unit_of`."""
        if keys and (keys[-1] == "parameter" or (entry.name == "jumps" and keys[-1] in ("start", "end"))):
            return self.unit
        if entry.name == "smallest_share_at":
            return self.unit
        if entry.name == "phase_resonance" and keys[-1] in ("level", "level_for_amplitude"):
            return str(self.summary[entry.name]["unit"])
        return super().unit_of(entry, place, keys, record)

    @property
    def unit(self) -> str:
        """Unit of the branches' parameter."""
        return self["points"]["parameter"].unit
