"""The result of ``beamsim nnm``: branches of nonlinear normal modes, one motion, and comparisons."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.fields import (
    Counter,
    Entry,
    Flag,
    Number,
    Plain,
    Text,
    attribute,
    axis,
    dataset,
    declared,
    ending,
    group,
    list_of,
    members,
    per_probe,
    record,
    table,
)
from beamsim.outcomes import Outcome
from beamsim.responses.orbit_energies import largest_error
from beamsim.results.branch import STATION, ModeBranch, OrbitMotion
from beamsim.results.result import CONVERGENCE, PROCESSOR_TIME, STATUS, Result
from beamsim.system.structural import MODES
from beamsim.typing import Bools, Complexes, Floats, Ints, not_none

SAFELY = 3.0  # factors this much below the expansion's reach count as small
UNITS = {"stiffness_factor": "1", "energy": "J", "frequency": "Hz"}

_POINT = (Counter("point", "number of the point along the branch"),)
_FACTOR = ("factor",)
_ORDER = ("factor", Counter("order", "order of the expansion", 0))
_COORDINATE = Counter("coordinate", "number of the coordinate")
_STEP = (Counter("step", "number of the step"), _ORDER[1])
_STATIONS = ("instants", STATION)


@declared
class BranchJump:
    """A gap in a backbone where an internal resonance cuts it."""

    start: float = dataset("{unit}", "parameter of the last point before")
    end: float = dataset("{unit}", "parameter of the first point beyond")
    mode: int = dataset("1", "the other mode, from 1; 0 where unknown")
    ratio: int = dataset("1", "n of n:1; 0 where unknown")


# --- The damped structure held on its mode ---------------------------------------------------------------------------


@declared(along=_POINT)
class PredictedLevels:
    """The level that energy balance asks for along a backbone."""

    energy: Floats = dataset("J", "energy from static equilibrium")
    frequency_hz: Floats = dataset("Hz", "frequency of the motion")
    level: Floats = dataset("{unit}", "level of the excitation that holds the motion")
    dissipated: Floats = dataset("J", "energy taken by damping in a period")
    contact_share: Floats = dataset("1", "share of it that the contacts' dashpots take")
    amplitude: dict[str, Floats] = per_probe("m", "largest deflection of a period")


@declared(along=_POINT)
class ResponseAboutResonance:
    """Forced periodic motions about a resonance."""

    outcome: Outcome = ending("how the branch ended")
    frequency_hz: Floats = dataset("Hz", "frequency of the excitation")
    peak_displacement: dict[str, Floats] = per_probe("m", "largest deflection of a period", name="amplitude")
    stable: Bools = dataset("1", "whether the motion is stable", flags=("unstable", "stable"))
    energy_error: Floats = dataset("1", "imbalance of the energies over a period, relative to the energy")


@declared
class HeldMotion:
    """The damped structure from a state of the mode on, under the predicted force."""

    time: Floats = axis("s", "time")  # (nt,) whole periods, the end left out
    displacement: dict[str, Floats] = per_probe("m", "displacement", along=("time",))
    frequency_hz: Floats = axis("Hz", "frequency of the line")  # (nf,) over all these periods
    amplitude: dict[str, Floats] = per_probe(
        "m", "amplitude of the line, zero to peak", along=("frequency_hz",), name="line"
    )
    departure: Floats = dataset(  # in the norm of energy, against the mode's
        "1", "largest distance from the mode in a period, in energy", along=(Counter("period", "number of the period"),)
    )
    instants: Floats = axis("s", "instants in the last period at which the mode is at rest")  # (2,)
    shapes: Floats = dataset("m", "deflection of the held structure at that instant", along=_STATIONS)
    mode_shapes: Floats = dataset("m", "deflection of the mode at that instant", along=_STATIONS)


@declared(kw_only=True)
class ResonantMotion:
    """One level: the mode it should hold, and the forced motion that is found."""

    level: float = attribute("{unit}", "level of the excitation")
    predicted_frequency_hz: float = attribute("Hz", "frequency of the motion predicted")
    predicted_energy: float = attribute("J", "its energy")
    predicted_amplitude: dict[str, float] = per_probe("m", "its largest deflection")
    found: bool = attribute(
        "", "whether the exact motion was found; the fields that derive from it are NaN where it was not"
    )
    frequency_hz: float = attribute("Hz", "frequency of the exact motion")
    amplitude: dict[str, float] = per_probe("m", "its largest deflection")
    level_for_amplitude: float = attribute("{unit}", "level predicted for the amplitude found at the probe")
    stable: bool = attribute("", "whether it is stable")
    floquet_multipliers: Complexes = dataset("1", "Floquet multipliers", along=(Counter("multiplier", "number", 0),))
    residual: float = attribute("1", "largest periodicity error, relative to the size of the motion")
    quadrature: float = attribute("1", "cosine of the lag between force and deflection")
    curve: ResponseAboutResonance | None = group("curve", ResponseAboutResonance, default=None)
    held: HeldMotion | None = group("held", HeldMotion, default=None)
    energy_error: float = attribute(
        "1", "imbalance of the energies over a period, relative to the energy", default=float("nan")
    )


@declared
class PhaseResonanceResult:
    """A nonlinear mode held by a force, at several levels."""

    outcome: Outcome = ending("whether every level's motion was found")
    quantity: str = attribute("", "of the level: force, acceleration, velocity or displacement")
    unit: str = attribute("", "unit of the level")
    probe: str = attribute("", "probe whose amplitude is compared: the one that moves most")
    # no gap, no load
    scales: bool = attribute("", "whether the level is proportional to the amplitude at a constant frequency")
    predicted: PredictedLevels = group("predicted", PredictedLevels)
    motions: tuple[ResonantMotion, ...] = members("levels", ResonantMotion, "level_index")


# --- Other methods beside the exact motions --------------------------------------------------------------------------


@declared
class ExpansionPath:
    """Frequency and initial condition of a nonlinear normal mode against the stiffness factor, to orders 0, 1 and 2."""

    mode: int = attribute("1", "number of the mode")
    energy: float = attribute("J", "energy from static equilibrium")
    linear_frequency_hz: float = attribute("Hz", "natural frequency")
    first_hz: float = attribute("Hz", "change of the frequency per factor, at the linear mode's amplitude")
    second_hz: float = attribute("Hz", "change of the frequency per squared factor")
    factor: Floats = axis("1", "stiffness factor")
    frequency_hz: Floats = dataset("Hz", "frequency to each order", along=_ORDER)  # (E, 3)
    # (E, 3, n) the shape at rest at t = 0
    coordinates: Floats = dataset("kg^0.5 m", "initial vector to each order", along=(*_ORDER, _COORDINATE))
    initial_displacement: Floats = dataset("m", "deflection at rest to each order", along=(*_ORDER, STATION))
    partner: int = attribute("1", "mode with the largest first-order component")
    harmonic: int = attribute("1", "its harmonic")
    reach: float = attribute("1", "factors should be well below this one")
    uniform_coordinates: Floats = dataset(
        "kg^0.5 m", "initial vector of the uniform expansion to each order", along=(*_ORDER, _COORDINATE)
    )
    pole: float = attribute("1", "factor above which the initial vector is not yet at its asymptotic order")
    pole_mode: int = attribute("1", "mode whose coordinate it is; 0 for none")
    pole_harmonic: int = attribute("1", "harmonic that is close to it")

    @property
    def small(self) -> float:
        """Factors up to this one count as small."""
        return self.reach / SAFELY * (1.0 + 1e-9)


@declared(along=_FACTOR)
class ExactModes:
    """Exact motions at the same energy (shooting); nan where none was found near the expansion."""

    frequency_hz: Floats = dataset("Hz", "frequency by shooting")
    coordinates: Floats = dataset("kg^0.5 m", "coordinates at rest", along=("factor", _COORDINATE))
    initial_displacement: Floats = dataset("m", "deflection at rest", along=("factor", STATION))
    residual: Floats = dataset("1", "largest periodicity error, relative to the size of the motion")


@declared(along=_STEP)
class ExpansionComparison:
    """Expansion against exact motion."""

    path: ExpansionPath = group("", ExpansionPath)
    exact: ExactModes = group("exact", ExactModes)
    frequency_difference: Floats = dataset("1", "relative error of the frequency to each order", along=_ORDER)
    initial_difference: Floats = dataset(
        "1", "error of the initial vector to each order, in the norm of the linear strain energy", along=_ORDER
    )
    frequency_orders: Floats = dataset(
        "1", "observed orders of the frequency's difference between neighbouring factors"
    )
    initial_orders: Floats = dataset(
        "1", "observed orders of the initial vector's difference between neighbouring factors"
    )
    expected_orders: Floats = dataset("1", "expected orders of the initial vector, by the uniform expansion")
    uniform_difference: Floats = dataset(
        "1", "error of the uniform expansion's initial vector to each order", along=_ORDER
    )
    uniform_orders: Floats = dataset("1", "observed orders of the uniform expansion's initial vector")


@declared(along=_FACTOR)
class RelaxedComparison:
    """A path of relaxed minimisation, step by step, and the exact motions at the same factors."""

    steps: int = attribute("1", "steps asked for")
    tolerance: float = attribute("1", "tolerance of the functional")
    outcome: Outcome = ending("how the path ended")
    factor: Floats = axis("1", "stiffness factor")  # (S,) of the steps taken; the last may not have been reached
    frequency_hz: Floats = dataset("Hz", "frequency")
    functional: Floats = dataset("1", "functional over twice the energy at the end of its minimisation")
    passages: Ints = dataset("1", "motions computed")
    processor_time_s: Floats = dataset("s", "processor time")
    reached: Bools = dataset("1", "whether the functional fell below the tolerance", flags=("no", "yes"))
    coordinates: Floats = dataset("kg^0.5 m", "coordinates at rest", along=("factor", _COORDINATE))
    initial_displacement: Floats = dataset("m", "deflection at rest", along=("factor", STATION))
    # nan where a tongue cuts it
    exact_frequency_hz: Floats = dataset("Hz", "frequency of the backbone by shooting")
    frequency_difference: Floats = dataset("1", "difference of the frequency from the backbone, relative")
    shape_difference: Floats = dataset(
        "1", "difference of the shape from the backbone, relative, in the norm of the linear strain energy"
    )
    fate: tuple[str, ...] = dataset("1", "exact motion near it: same, other, none or between")
    jumped: Bools = dataset("1", "whether the step left the motion that the one before was on", flags=("no", "yes"))
    shooting_passages: int = attribute("1", "motions computed for the backbone, its tongues and the same factors")
    shooting_processor_time_s: float = attribute("s", "processor time of shooting")

    @property
    def cost_ratio(self) -> float:
        """Processor time over that of shooting."""
        return float(self.processor_time_s.sum() / max(self.shooting_processor_time_s, 1e-9))


# --- The result ------------------------------------------------------------------------------------------------------

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
RELAXED = record(dict.fromkeys(("steps", "steps_reached", "largest_frequency_difference", "cost_ratio"), Number))
PHASE_RESONANCE = record({"quantity": Text, "unit": Text, "probe": Text, "levels": list_of(RESONANCE)})
TONGUE = record(dict.fromkeys(("mode", "ratio", "parameter"), Number))
_SUMMARY = (
    STATUS,
    Entry("mode", of="mode"),
    Entry("continued_in", of="parameter"),
    Entry("points", "1", "points of the backbone"),
    Entry("energy_error", "1", "largest change of the energy along a motion of any branch, relative to the energy",
             "solver"),
    Entry("stable_points", "1", "those of them that are stable"),
    Entry("start", "", "first point of the backbone: parameter, frequency, energy", form=POINT),
    Entry("end", "", "last point of the backbone: parameter, frequency, energy", form=POINT),
    Entry("period_s", "s", "period of the last point"),
    Entry("linear_frequency_hz", "Hz", "frequency of the linear mode"),
    Entry("internal_resonances", "", "by tongue: mode, ratio, parameter where it leaves the backbone, points",
             form=list_of(TONGUE)),
    Entry("jumps", "", "gaps of the backbone at tongues: start and end in the parameter, mode and ratio where known",
             form=list[Plain]),
    Entry("grazings", "1", "grazing contacts along the backbone"),
    Entry("special_points", "", "folds and branch points of the backbone: kind, parameter, frequency",
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
             "what was predicted and found", form=PHASE_RESONANCE),
    Entry("motion_frequency_hz", "Hz", "frequency of the motion that is drawn", "drawn motion"),
    Entry("motion_drift", "1", "how far it is from its start after the periods of its spectrum, relative",
             "drawn motion",
             "motion.drift"),
    Entry("motion_periods", "1", "number of these periods", "drawn motion", of="motion.periods"),
    Entry("largest_residual", "1", "largest residual of the periodicity condition along the backbone",
             "solver"),
    Entry("smallest_share", "1", "smallest share of the energy in the mode at the slowest instant, along the backbone"),
    Entry("smallest_share_at", "", "the parameter there"),
    *CONVERGENCE,
    PROCESSOR_TIME,
)  # fmt: skip


@declared(repr=False)
class NormalModeResult(Result):
    """Everything `beamsim nnm` computes."""

    KIND = "nnm"
    SUMMARY, DATASET, DATASETS = _SUMMARY, "shapes", (MODES,)

    mode: int = attribute("1", "number of the mode")
    parameter: str = attribute("", "stiffness_factor, energy or frequency", name="continued_in")
    method: str = attribute("", "shooting, full_period, multiple_scales or relaxed_minimisation")
    branches: tuple[ModeBranch, ...] = members("branches", ModeBranch, "branch", rows="points")  # the backbone first
    jumps: tuple[BranchJump, ...] = table("jumps", BranchJump, Counter("jump", "number of the jump"))
    linear_shape: Floats = dataset(
        "m", "linear mode with the largest deflection of the motion that is drawn", along=(STATION,)
    )
    motion_branch: int = attribute("1", "branch whose motion is drawn: the backbone, or the first non-brake branch")
    motion_point: int = attribute("1", "point of it: the last, or the furthest from rest")
    phase_resonance: PhaseResonanceResult | None = group(
        "phase_resonance", PhaseResonanceResult, default=None
    )  # where asked for, as the rest
    expansion: ExpansionComparison | None = group("multiple_scales", ExpansionComparison, default=None)
    relaxed: RelaxedComparison | None = group("relaxed_minimisation", RelaxedComparison, default=None)

    @property
    def backbone(self) -> ModeBranch:
        """The branch of the mode itself."""
        return self.branches[0]

    @property
    def tongues(self) -> tuple[ModeBranch, ...]:
        """The branches of internal resonance."""
        return tuple(b for b in self.branches if b.kind == "tongue")

    @property
    def non_brake(self) -> tuple[ModeBranch, ...]:
        """The branches of orbits that are not brake orbits."""
        return tuple(b for b in self.branches if b.kind == "non_brake")

    @property
    def motion(self) -> OrbitMotion:
        """The motion that is drawn."""
        motion = not_none(self.branches[self.motion_branch].motion)
        return motion

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """That of values which the name does not say; see `Result.unit_of`."""
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
        return UNITS[self.parameter]


def nnm_summary(
    result: NormalModeResult,
    linear_frequency_hz: float,
    processor_time_s: float,
    requested: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """The backbone, what leaves it and what it is compared with; not what repeats a field of the result.

    Parameters
    ----------
    result : without a summary.
    linear_frequency_hz : Hz, of the linear mode.
    processor_time_s : s, of the exact motions.
    requested : the points at energies and frequencies that were asked for, as plain values.

    Returns
    -------
    dict
        The entries of the summary; None for what the analysis has not done.
    """
    backbone, resonance = result.backbone, result.phase_resonance
    return {
        "points": int(backbone.parameter.size),
        "energy_error": largest_error(result.branches),
        "start": _end(backbone, 0),
        "end": _end(backbone, -1),
        "period_s": 1.0 / float(backbone.frequency_hz[-1]),
        "stable_points": int(np.count_nonzero(backbone.stable)),
        "largest_residual": float(backbone.residual.max()),
        "smallest_share": float(backbone.share.min()),
        "smallest_share_at": float(backbone.parameter[backbone.share.argmin()]),
        "internal_resonances": [
            {"mode": b.mode, "ratio": b.ratio, "parameter": float(b.parameter[0]), "points": int(b.parameter.size)}
            for b in result.tongues
        ],
        "jumps": [
            {"start": j.start, "end": j.end, "mode": j.mode or None, "ratio": j.ratio or None} for j in result.jumps
        ],
        "grazings": sum(1 for event in backbone.special if event.kind in ("grazing", "nonsmooth_fold")),
        "special_points": [
            {"kind": e.kind, "parameter": e.parameter, "frequency_hz": e.frequency_hz}
            for e in backbone.special
            if e.kind in ("fold", "nonsmooth_fold", "branch_point")
        ],
        "requested_points": [dict(point) for point in requested] or None,
        "linear_frequency_hz": linear_frequency_hz,
        "motion_frequency_hz": 1.0 / float(result.motion.time[-1]),
        "processor_time_s": processor_time_s,
        "full_period": None if backbone.half_period_difference is None else _full_period(result),
        "multiple_scales": None if result.expansion is None else expansion_summary(result.expansion),
        "relaxed_minimisation": None if result.relaxed is None else _relaxed(result.relaxed),
        "phase_resonance": None
        if resonance is None
        else {
            **{name: getattr(resonance, name) for name in ("quantity", "unit", "probe")},
            "status": resonance.outcome.text,
            "levels": list(_level_summaries(resonance)),
        },
    }


def _end(branch: ModeBranch, index: int) -> dict[str, float]:
    return {
        "parameter": float(branch.parameter[index]),
        "frequency_hz": float(branch.frequency_hz[index]),
        "energy_j": float(branch.energy[index]),
    }


def _full_period(result: NormalModeResult) -> dict[str, Any]:
    """Difference of full-period from half-period shooting, and the non-brake orbits."""
    return {
        "largest_difference": float(result.backbone.half_period_difference.max(initial=0.0)),
        "symmetry_breakings": [
            {"parameter": e.parameter, "frequency_hz": e.frequency_hz}
            for e in result.backbone.special
            if e.kind == "symmetry_breaking"
        ],
        "never_at_rest": [
            {
                "mode": b.mode,
                "ratio": b.ratio,
                "points": int(b.parameter.size),
                "stable_points": int(np.count_nonzero(b.stable)),
                "start": _end(b, 0),
                "end": _end(b, -1),
                "largest_least_kinetic": float(b.least_kinetic.max()),
                "status": b.outcome.text,
            }
            for b in result.non_brake
        ],
    }


_SAME_OF_RELAXED = ("steps", "tolerance", "shooting_passages", "shooting_processor_time_s", "cost_ratio")


def _relaxed(relaxed: RelaxedComparison) -> dict[str, Any]:
    """Relaxed minimisation: range, accuracy and cost."""
    known = np.isfinite(relaxed.frequency_difference)
    return {
        **{name: getattr(relaxed, name) for name in _SAME_OF_RELAXED},
        "steps_reached": int(np.count_nonzero(relaxed.reached)),
        "largest_functional": float(relaxed.functional.max(initial=0.0)),
        "end": {
            "parameter": float(relaxed.factor[-1]),
            "frequency_hz": float(relaxed.frequency_hz[-1]),
            "period_s": 1.0 / float(relaxed.frequency_hz[-1]),
            "exact_frequency_hz": float(relaxed.exact_frequency_hz[-1]),
        },
        "largest_frequency_difference": float(relaxed.frequency_difference[known].max(initial=0.0)),
        "largest_shape_difference": float(relaxed.shape_difference[known].max(initial=0.0)),
        "followed": {fate: relaxed.fate.count(fate) for fate in dict.fromkeys(relaxed.fate)},
        "silent_jumps": relaxed.factor[relaxed.jumped].tolist(),
        "passages": int(relaxed.passages.sum()),
        "processor_time_s": float(relaxed.processor_time_s.sum()),
        "status": relaxed.outcome.text,
    }


def expansion_summary(comparison: ExpansionComparison) -> dict[str, Any]:
    """The expansion's coefficients, its errors, and the orders in which they vanish (medians over small factors)."""
    path = comparison.path
    small = path.factor <= path.small
    if small.sum() < 3:
        small[:] = True
    steps = small[:-1]
    return {
        "mode": path.mode,
        "linear_frequency_hz": path.linear_frequency_hz,
        "first_order_hz": path.first_hz,
        "second_order_hz": path.second_hz,
        "factors_well_below": path.reach,
        "factor": path.factor.tolist(),
        "frequency_hz": path.frequency_hz[:, 1:].tolist(),
        "exact_frequency_hz": comparison.exact.frequency_hz.tolist(),
        "frequency_difference": comparison.frequency_difference[:, 1:].tolist(),
        "initial_difference": comparison.initial_difference[:, 1:].tolist(),
        "orders_from": float(path.factor[small].max()),
        "orders_to": float(path.factor[small].min()),
        "observed_order_frequency": [_order(comparison.frequency_orders[:, k], steps) for k in (1, 2)],
        "observed_order_initial": [_order(comparison.initial_orders[:, k], steps) for k in (1, 2)],
        "expected_order_initial": [_order(comparison.expected_orders[:, k], steps) for k in (1, 2)],
        "observed_order_uniform": [_order(comparison.uniform_orders[:, k], steps) for k in (1, 2)],
        "asymptotic_well_below": path.pole,
        "nearest_pole": {"mode": path.pole_mode, "harmonic": path.pole_harmonic},
    }


def _order(orders: Floats, small: Bools) -> float:
    """Median of the observed orders at small factors; if round-off dominates there, the last one above it."""
    known = np.isfinite(orders)
    if np.any(known & small):
        return float(np.median(orders[known & small]))
    return float(orders[known][-1]) if np.any(known) else float("nan")


_SAME_OF_LEVELS = (
    "level", "predicted_frequency_hz", "found", "frequency_hz", "level_for_amplitude", "energy_error", "stable",
)  # fmt: skip


def _level_summaries(result: PhaseResonanceResult) -> Iterator[dict[str, Any]]:
    """Forced motions at phase resonance, level by level."""
    for m in result.motions:
        peak, at = np.nan, np.nan
        if m.curve is not None:
            k = int(np.argmax(m.curve.peak_displacement[result.probe]))
            peak, at = float(m.curve.peak_displacement[result.probe][k]), float(m.curve.frequency_hz[k])
        yield {
            **{name: getattr(m, name) for name in _SAME_OF_LEVELS},
            "predicted_energy_j": m.predicted_energy,
            "predicted_amplitude_m": m.predicted_amplitude[result.probe],
            "amplitude_m": m.amplitude[result.probe],
            "peak_frequency_hz": at,
            "peak_amplitude_m": peak,
            "curve": "" if m.curve is None else m.curve.outcome.text,
            "periods": 0 if m.held is None else int(m.held.departure.size),
            "departure_first_period": np.nan if m.held is None else float(m.held.departure[0]),
            "departure_last_period": np.nan if m.held is None else float(m.held.departure[-1]),
            "departure_largest": np.nan if m.held is None else float(m.held.departure.max()),
        }
