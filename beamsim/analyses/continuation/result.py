"""Result of a continuation of forced periodic motions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np

from beamsim.analyses.continuation.overlay import OVERLAY, OVERLAY_CYCLES, OverlayCurve, overlay_curves
from beamsim.labelled import ROW, Dataset, Layout, Variable
from beamsim.results.branch import (
    BRANCHES,
    FLAGS,
    POINTS,
    SPECIAL_CURVE_EVENTS,
    SPECIAL_CURVE_POINTS,
    SPECIAL_CURVES,
    SPECIAL_POINTS,
    harmonics_of,
    is_symmetric,
    rows_by_owner,
)
from beamsim.results.result import CONVERGENCE, MARGINS, OF_MODES, PROCESSOR_TIME, STATUS, Result
from beamsim.results.values import DISPLACEMENT, VALUES
from beamsim.summaries import (
    Entry,
    Flag,
    Number,
    Pair,
    Text,
    by_name,
    list_of,
    record,
)
from beamsim.system.structural import MODES
from beamsim.typing import Floats

NARROW = 1e-3  # relative to the extent of all branches; narrower ranges are omitted


_COMPARISON, _POINT, _FACTOR, _PROBE = ("comparison",), ("point",), ("number",), ("probe",)
MULTIPLE_SCALES = Layout(
    "multiple_scales",
    "Steady motions near a mode by multiple scales and how far they are from the exact ones, a row for each level. The "
    "small factor multiplies springs, dashpots, damping and force together; 1 is the case itself.",
    {
        "comparison": Variable(_COMPARISON, "1", "number of the level, from 0", int),
        "level": Variable(_COMPARISON, "{level_unit}", "level of the excitation"),
        "mode": Variable(_COMPARISON, "1", "number of the mode", int),
        "linear_frequency_hz": Variable(_COMPARISON, "Hz", "its natural frequency"),
    },
    optional=True,
)
MULTIPLE_SCALES_POINTS = Layout(
    "multiple_scales_points",
    "The motions by multiple scales at a factor of one, from one end of the range through the largest to the other, "
    "those of one level after those of another.",
    {
        "point": Variable(_POINT, "1", "number of the point", int),
        "comparison": Variable(_POINT, "1", "number of the level, from 0", int, names="multiple_scales/comparison"),
        "frequency_hz": Variable(_POINT, "Hz", "excitation frequency"),
        "stable": Variable(_POINT, "1", "whether the slow flow contracts", bool, flags=FLAGS),
        "backbone_hz": Variable(_POINT, "Hz", "frequency of the nonlinear mode of the same amplitude, to first order"),
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        "leading": Variable(_PROBE + _POINT, "m", "largest deflection of a period, to leading order"),
        "first": Variable(_PROBE + _POINT, "m", "largest deflection of a period, to first order"),
    },
    optional=True,
)
MULTIPLE_SCALES_FACTORS = Layout(
    "multiple_scales_factors",
    "Differences from the exact motion at falling factors, the detuning falling with them, those of one level after "
    "those of another.",
    {
        "number": Variable(_FACTOR, "1", ROW, int),
        "comparison": Variable(_FACTOR, "1", "number of the level, from 0", int, names="multiple_scales/comparison"),
        "factor": Variable(_FACTOR, "1", "factor of springs, damping and force"),
        "factor_frequency_hz": Variable(_FACTOR, "Hz", "excitation frequency at the factor"),
        "stability_agrees": Variable(
            _FACTOR, "1", "whether the exact stability and that of the slow flow agree", bool, flags=("no", "yes")
        ),
        "order": Variable(("order",), "1", "order of the expansion", int),
        "difference": Variable(
            (*_FACTOR, "order"),
            "1",
            "difference from the exact motion, the largest of a period, relative to its size; NaN where there is none "
            "near",
        ),
        "orders": Variable(
            (*_FACTOR, "order"), "1", "observed order between this factor and the next; NaN of the last"
        ),
    },
    optional=True,
)
EXPANSION = (MULTIPLE_SCALES, MULTIPLE_SCALES_POINTS, MULTIPLE_SCALES_FACTORS)


OF_STABLE = (
    *(value.summary_entry("of all stable motions, ") for value in VALUES
      if value.in_sweeps and value.key != DISPLACEMENT),
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
CURVE_EVENT = record({"kind": Text, "frequency_hz": Number, "parameter": Number})
SPECIAL_CURVE = record(
    dict.fromkeys(("smallest_parameter", "largest_parameter", "smallest_hz", "largest_hz"), Number),
    {"kind": Text, "start_hz": Number, "points": Number, "touching": Text, "status": Text,
     "events": list_of(CURVE_EVENT)},
)  # fmt: skip
FOLLOWED = record(
    {"ended": Text, **dict.fromkeys(("level", "period_multiple", "points", "stable_points"), Number)},
    {"off_centre": Text, "largest_mean_m": Number},
)
OVERLAY_CURVE = record({"direction": Text, "level": Number, "source": Text, "stepped": Flag})
BAND = record({"band": Pair, "level": Number})
_SUMMARY = (
    STATUS,
    Entry("parameter", variable="branches/followed"),
    Entry("method", "", "shooting or harmonic_balance", "solver", form=Text),
    Entry("points", "1", "points of all branches"),
    Entry("branches", "1", "number of branches"),
    Entry("followed", "", "by branch: level, period_multiple, points, stable_points, the largest mean of a probe where "
             "the branch has lost the symmetry of others, and how it ended", form=list_of(FOLLOWED)),
    Entry("overlay", "", "by curve of a sweep that is drawn over the branches: direction, level, source, whether it is "
             "stepped", form=by_name(OVERLAY_CURVE)),
    Entry("energy_error", "1", "largest imbalance of the energies over a period, relative to the energy", "solver"),
    Entry("special_points", "", "folds, bifurcations and grazings: kind, frequency, parameter, snubber, level",
             form=list_of(SPECIAL_POINT)),
    Entry("peaks", "", "by level and probe, the largest displacement: frequency, parameter, value_m, kind, period",
             form=list_of(PEAK)),
    *OF_STABLE,
    Entry("without_stable_motion", "", "bands of the parameter without a stable motion found: band, level",
             form=list_of(BAND)),
    Entry("second_parameter", "", "what special points are followed in", form=Text),
    Entry("special_curves", "", "by curve of special points: kind, start, points, extents in the second parameter and "
             "frequency, and its own special points",
             form=list_of(SPECIAL_CURVE)),
    MARGINS,
    Entry("multiple_scales", "", "by level, of the expansion: points, differences from exact motions, observed orders",
             form=list_of(record({"level": Number, "observed_orders": list[Number]}))),
    Entry("neglected_harmonics", "1", "largest share of the motion that harmonic balance leaves out",
             "solver"),
    *OF_MODES,
    *CONVERGENCE,
    PROCESSOR_TIME,
)  # fmt: skip


class CoexistenceRange(NamedTuple):
    """Range of the parameter with several stable motions."""

    level: float
    low: float
    high: float
    parameter: float  # parameter inside the range
    peaks: tuple[float, ...]  # m, largest displacement of the first probe in each motion there


class _Piece(NamedTuple):
    """Part of a branch with stable motions between folds, by increasing parameter."""

    parameter: Floats
    peak: Floats

    def covers(self, parameter: float) -> bool:
        return bool(self.parameter[0] < parameter < self.parameter[-1])


def _pieces(branch: Dataset) -> Iterator[_Piece]:
    x, stable = branch["parameter"].values, branch["stable"].values
    step = np.sign(np.diff(x))
    step[~(stable[:-1] & stable[1:])] = 0.0
    peak = next((of.values for of in branch.by_label("peak_displacement").values()), np.full(x.size, np.nan))
    edges = np.flatnonzero(np.diff(step, prepend=np.nan, append=np.nan) != 0.0)
    for first, last in pairwise(edges.tolist()):
        if step[first]:
            piece = slice(first, last + 1)
            order = np.argsort(x[piece])
            yield _Piece(x[piece][order], peak[piece][order])


@dataclass(frozen=True, kw_only=True, repr=False)
class ContinuationResult(Result):
    """Result of `beamsim.continuation`: branches of periodic motions, stable and unstable, and their special points.

    Examples
    --------
    >>> import beamsim
    >>> case = beamsim.load_scenario("configs/stops/chain_bumpers.yaml", {"sweep.to": "11 Hz"})
    >>> result = beamsim.continuation(case)
    >>> result.parameter, result.unit, result.level_unit, len(result.branches)
    ('frequency', 'Hz', 'm/s^2', 1)
    >>> branch = result.branches[0]
    >>> branch["parameter"].values[[0, -1]].round(6).tolist(), bool(branch["stable"].values.all())
    ([10.0, 11.0], True)
    >>> branch["peak_displacement"].sel(probe="third").dims
    ('point',)
    >>> [(row["kind"], round(row["parameter"], 2)) for row in result["special_points"].rows("event")]
    [('grazing', 10.72)]
    >>> result.coexisting(), result.special_curves, result.second_unit, result.overlay
    ([], (), '', {})
    """

    KIND = "continuation"
    SUMMARY = _SUMMARY

    DATASETS: ClassVar[tuple[Layout, ...]] = (
        MODES,
        BRANCHES,
        POINTS,
        SPECIAL_POINTS,
        SPECIAL_CURVES,
        SPECIAL_CURVE_POINTS,
        SPECIAL_CURVE_EVENTS,
        OVERLAY,
        OVERLAY_CYCLES,
        *EXPANSION,
    )

    @cached_property
    def overlay(self) -> dict[str, OverlayCurve]:
        """Curves of sweeps that are drawn over the branches, by name; none without ``sweep.overlay``."""
        return overlay_curves(self.datasets)

    @cached_property
    def branches(self) -> tuple[Dataset, ...]:
        """A dataset for each branch: its points, and its row of ``branches`` as variables without dimensions."""
        return rows_by_owner(self["branches"], self["points"], "branch")

    @cached_property
    def special_curves(self) -> tuple[Dataset, ...]:
        """The same for each curve of special points in two parameters; none if it was not asked for."""
        known = "special_curves" in self.datasets
        return rows_by_owner(self["special_curves"], self["special_curve_points"], "special_curve") if known else ()

    @property
    def parameter(self) -> str:
        """Continuation parameter: frequency, level, gap, stiffness or position."""
        return str(self["branches"]["followed"].item())

    @property
    def unit(self) -> str:
        """Unit of the continuation parameter."""
        return self["points"]["parameter"].unit

    @property
    def level_unit(self) -> str:
        """Unit of the branches' levels."""
        return self["branches"]["level"].unit

    @property
    def second_unit(self) -> str:
        """Unit of the second parameter of curves of special points; empty without them."""
        return self["special_curve_points"]["parameter"].unit if "special_curve_points" in self.datasets else ""

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of values whose entry does not name it; see `Result.unit_of`."""
        if keys and keys[-1] in ("parameter", "band"):
            return self.second_unit if entry.name == "special_curves" else self.unit
        if keys and keys[-1] in ("smallest_parameter", "largest_parameter"):
            return self.second_unit
        if keys and keys[-1] == "level" and entry.name != "gapping":
            return self.level_unit
        return super().unit_of(entry, place, keys, record)

    def off_centre(self, branch: Dataset) -> tuple[str, float] | None:
        """Probe with the largest mean displacement, and the mean, m, for a branch that lost its symmetry; else None.

        Motions of a symmetric structure that repeat with opposite sign after half a period have no even harmonics. If a
        branch in contact has none anywhere and this branch has, it is one of two mirror images.
        """
        touching = [b for b in self.branches if "contact_share" in b and np.any(b["contact_share"].values > 0)]
        if is_symmetric(branch) is not False or not any(is_symmetric(other) for other in touching):
            return None
        means = {name: float(np.abs(h[:, 0]).max()) for name, h in harmonics_of(branch).items()}
        name = max(means, key=lambda name: means[name])
        return name, means[name]

    def coexisting(self) -> list[CoexistenceRange]:
        """Ranges with several stable motions at one level, by level and increasing parameter."""
        found: list[CoexistenceRange] = []
        levels = [float(branch["level"].item()) for branch in self.branches]
        for level in {repr(level): level for level in levels}.values():
            of_level = (b for b, other in zip(self.branches, levels, strict=True) if repr(other) == repr(level))
            pieces = [piece for branch in of_level for piece in _pieces(branch)]
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
                    found.append(CoexistenceRange(level, low, high, at, peaks))
        return found
