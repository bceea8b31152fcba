"""The result of a continuation of forced periodic motions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.sweep.result import SweepCurve
from beamsim.fields import (
    Counter,
    Entry,
    Flag,
    Number,
    Pair,
    Text,
    attribute,
    axis,
    by_name,
    dataset,
    declared,
    list_of,
    members,
    per_probe,
    record,
    stored,
)
from beamsim.results.branch import FoldBranch, ResponseBranch
from beamsim.results.result import CONVERGENCE, MARGINS, OF_MODES, PROCESSOR_TIME, STATUS, Result
from beamsim.results.values import DISPLACEMENT, VALUES
from beamsim.system.structural import MODES
from beamsim.typing import Bools, Floats

NARROW = 1e-3  # of the extent of all branches: narrower ranges are left out
_POINT = (Counter("point", "number of the point"),)
_ORDER = Counter("order", "order of the expansion", 0)


@declared
class OverlayCurve(SweepCurve):
    """A swept or stepped sine drawn with the curve."""

    source: str = attribute("", "file it comes from; empty where it was computed with the curve", default="")
    title: str = attribute("", "title of its scenario", default="")


@declared(along=_POINT)
class ForcedExpansionComparison:
    """Steady motions near a mode by multiple scales, at one level, and how far they are from the exact ones.

    The small factor multiplies springs, dashpots, damping and force together; 1 is the case itself.
    """

    level: float = attribute("{level_unit}", "level of the excitation")
    mode: int = attribute("1", "number of the mode")
    linear_frequency_hz: float = attribute("Hz", "its natural frequency")
    frequency_hz: Floats = dataset("Hz", "excitation frequency")  # at a factor of one, through the tip
    stable: Bools = dataset("1", "whether the slow flow contracts", flags=("unstable", "stable"))
    leading: dict[str, Floats] = per_probe("m", "largest deflection of a period, to leading order")
    first: dict[str, Floats] = per_probe("m", "largest deflection of a period, to first order")
    backbone_hz: Floats = dataset("Hz", "frequency of the nonlinear mode of the same amplitude, to first order")
    factor: Floats = axis("1", "factor of springs, damping and force")  # (E,) falling
    # the detuning shrinks with the factor
    factor_frequency_hz: Floats = dataset("Hz", "excitation frequency at the factor", along=("factor",))
    difference: Floats = dataset(  # (E, 2) largest of a period; nan: no exact motion near
        "1", "difference from the exact motion, relative to its size: leading and first order", along=("factor", _ORDER)
    )
    orders: Floats = dataset(  # (E - 1, 2) 1 and 2 expected
        "1", "observed orders between a factor and the next", along=(Counter("step", "number of the step"), _ORDER)
    )
    stability_agrees: Bools = dataset(
        "1", "whether exact and slow stability agree", along=("factor",), flags=("no", "yes")
    )


OF_STABLE = (
    *(value.summary_entry("of all stable motions, ") for value in VALUES
      if value.followed and value.key != DISPLACEMENT),
    Entry("peak_output", "", "by output its largest magnitude in stable motions: value in its output_unit, parameter",
             form=by_name(record({"value": Number, "parameter": Number}))),
    Entry("output_unit", "", "units of the outputs", form=dict[str, Text]),
)  # fmt: skip
SPECIAL_POINT = record(
    {"kind": Text, "parameter": Number, "snubber": Text, "level": Number, "period_multiple": Number},
    {"frequency_hz": Number},
)
PEAK = record(
    {"kind": Text, "probe": Text,
     **dict.fromkeys(("frequency_hz", "parameter", "value_m", "level", "period_multiple"), Number)},
    {"direction": Text},
)  # fmt: skip
FOLD_CURVE = record(
    dict.fromkeys(("smallest_parameter", "largest_parameter", "smallest_hz", "largest_hz"), Number),
    {"start_hz": Number, "points": Number, "touching": Text, "status": Text},
)
FOLLOWED = record(
    {"ended": Text, **dict.fromkeys(("level", "period_multiple", "points", "stable_points"), Number)},
    {"off_centre": Text, "largest_mean_m": Number},
)
OVERLAY = record({"direction": Text, "level": Number, "source": Text, "stepped": Flag})
BAND = record({"band": Pair, "level": Number})
_SUMMARY = (
    STATUS,
    Entry("parameter", of="parameter"),
    Entry("method", of="method", section="solver"),
    Entry("points", "1", "points of all branches"),
    Entry("branches", "1", "number of branches"),
    Entry("followed", "", "by branch: level, period_multiple, points, stable_points, the largest mean of a probe where "
             "the branch has lost the symmetry of others, and how it ended", form=list_of(FOLLOWED)),
    Entry("overlay", "", "by curve of a sweep that is drawn over the branches: direction, level, source, whether it is "
             "stepped", form=by_name(OVERLAY)),
    Entry("energy_error", "1", "largest imbalance of the energies over a period, relative to the energy", "solver"),
    Entry("special_points", "", "folds, bifurcations and grazings: kind, frequency, parameter, snubber, level",
             form=list_of(SPECIAL_POINT)),
    Entry("peaks", "", "by level and probe, the largest displacement: frequency, parameter, value_m, kind, period",
             form=list_of(PEAK)),
    *OF_STABLE,
    Entry("without_stable_motion", "", "bands of the parameter without a stable motion found: band, level",
             form=list_of(BAND)),
    Entry("second_parameter", "", "what folds are followed in", form=Text),
    Entry("fold_curves", "", "by curve of folds: its start, points, extents in the second parameter and frequency",
             form=list_of(FOLD_CURVE)),
    MARGINS,
    Entry("multiple_scales", "", "by level, of the expansion: points, differences from exact motions, observed orders",
             form=list_of(record({"level": Number, "observed_orders": list[Number]}))),
    Entry("neglected_harmonics", "1", "largest share of the motion that harmonic balance leaves out",
             "solver"),
    *OF_MODES,
    *CONVERGENCE,
    PROCESSOR_TIME,
)  # fmt: skip


class Several(NamedTuple):
    """Where several motions are stable."""

    level: float
    low: float
    high: float
    at: float  # between them
    peaks: tuple[float, ...]  # m, of each motion there, the largest displacement of the first probe


class _Piece(NamedTuple):
    """Stable motions of a branch between folds, by increasing parameter."""

    parameter: Floats
    peak: Floats

    def covers(self, parameter: float) -> bool:
        return bool(self.parameter[0] < parameter < self.parameter[-1])


def _pieces(branch: ResponseBranch) -> Iterator[_Piece]:
    x, step = branch.parameter, np.sign(np.diff(branch.parameter))
    step[~(branch.stable[:-1] & branch.stable[1:])] = 0.0
    peak = next((probe.peak for probe in branch.probes if probe.quantity == "displacement"), np.full(x.size, np.nan))
    edges = np.flatnonzero(np.diff(step, prepend=np.nan, append=np.nan) != 0.0)
    for first, last in pairwise(edges.tolist()):
        if step[first]:
            piece = slice(first, last + 1)
            order = np.argsort(x[piece])
            yield _Piece(x[piece][order], peak[piece][order])


@declared(repr=False)
class ContinuationResult(Result):
    """Everything `beamsim sweep` of kind continuation computes."""

    KIND = "continuation"
    SUMMARY, DATASETS = _SUMMARY, (MODES,)

    branches: tuple[ResponseBranch, ...] = members("branches", ResponseBranch, "branch", rows="points")
    parameter: str = attribute("", "what is followed: frequency, level, gap, stiffness or position")
    unit: str = attribute("", "its unit")
    snubber: str = attribute("", "snubber whose number is followed", default="")
    level_unit: str = attribute("", "unit of the branches' levels", default="")
    method: str = attribute("", "shooting or harmonic_balance", default="shooting")
    fold_curves: tuple[FoldBranch, ...] = members(
        "fold_curves", FoldBranch, "fold_curve", rows="fold_points", default=()
    )
    second_parameter: str = attribute("", "what folds are followed in; empty where they are not", default="")
    second_unit: str = attribute("", "its unit", default="")
    second_snubber: str = attribute("", "snubber whose number that is", default="")
    overlay: dict[str, OverlayCurve] = members(
        "overlay", OverlayCurve, "curve", rows="overlay_cycles", default_factory=dict
    )
    # for weak springs, where it was asked for
    expansion: tuple[ForcedExpansionComparison, ...] = members(
        "multiple_scales", ForcedExpansionComparison, "comparison", rows="", default=()
    )

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """That of values which the name does not say; see `Result.unit_of`."""
        if keys and keys[-1] in ("parameter", "band"):
            return self.unit
        if keys and keys[-1] in ("smallest_parameter", "largest_parameter"):
            return self.second_unit
        if keys and keys[-1] == "level" and entry.name != "gapping":
            return self.level_unit
        return super().unit_of(entry, place, keys, record)

    def off_centre(self, branch: ResponseBranch) -> tuple[str, float] | None:
        """Probe and size, m, of the largest mean of a branch that has lost the symmetry of others; None of the others.

        Motions of a symmetric structure that repeat with the other sign after half a period have no even harmonics.
        Where a branch in contact has none anywhere, and this one has, it is one of a pair of mirror images.
        """
        if branch.symmetric is not False or not any(
            b.symmetric and any(np.any(share > 0) for share in b.contact_share.values()) for b in self.branches
        ):
            return None
        means = {name: float(np.abs(h[:, 0]).max()) for name, h in branch.harmonics.items()}
        name = max(means, key=lambda name: means[name])
        return name, means[name]

    def coexisting(self) -> list[Several]:
        """Where several motions of a level are stable, by level and increasing parameter."""
        found: list[Several] = []
        for level in {repr(branch.level): branch.level for branch in self.branches}.values():
            pieces = [piece for b in self.branches if repr(b.level) == repr(level) for piece in _pieces(b)]
            edges = np.unique([piece.parameter[end] for piece in pieces for end in (0, -1)])
            for low, high in pairwise(edges.tolist()):
                at = 0.5 * (low + high)
                there = [piece for piece in pieces if piece.covers(at)]
                if len(there) < 2 or high - low < NARROW * (edges[-1] - edges[0]):
                    continue
                peaks = tuple(sorted(float(np.interp(at, *piece)) for piece in there))
                known = found[-1] if found and repr(found[-1].level) == repr(level) else None
                if known is not None and known.high == low and len(known.peaks) == len(peaks):
                    found[-1] = known._replace(high=high)
                else:
                    found.append(Several(level, low, high, at, peaks))
        return found

    @property
    @stored(attribute("", "kind of sweep", name="kind"))
    def _kind(self) -> str:
        return "continuation"
