"""``beamsim sweep`` of kind continuation: curves of periodic motions over a parameter, stable and unstable.

Swept and stepped sines can be overlaid: computed in the same run, or taken from stored sweeps.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count, pairwise
from typing import Any

import numpy as np

from beamsim.analyses.continuation.overlay import OverlayCurve, overlay_curve, overlay_datasets
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.continuation.special_curves import (
    SpecialCurve,
    follow_special_points,
    omissions,
    special_curve_datasets,
)
from beamsim.analyses.sweep.analysis import sweep
from beamsim.analyses.sweep.result import SweepResult
from beamsim.errors import ScenarioError
from beamsim.flow.compiled import processor_time
from beamsim.labelled import Dataset
from beamsim.orbits.branch import INTERRUPTED, SEARCH_FAILED, OrbitBranch
from beamsim.orbits.tracing import (
    Budget,
    Tracer,
    branching_points,
    coexisting_branches,
    coincides,
    gaps_between,
    missing,
    progress_that_grows,
    reaches_of,
    side_branches,
    trace_range,
)
from beamsim.outcomes import (
    COMPLETE,
    Outcome,
    OutcomeKind,
    Progress,
    Where,
    interruption,
    part_of,
    stop_requested,
)
from beamsim.responses.branches import (
    MeasuredBranch,
    growing_with_modes,
    largest_values,
    response,
    response_datasets,
)
from beamsim.responses.orbit_energies import check_balance
from beamsim.responses.parameters import ResponseModel, response_model
from beamsim.responses.points import TargetPoint, cut, with_points_at
from beamsim.results.result import check_reduction, dashpots_of, warnings_along
from beamsim.scenario import Scenario
from beamsim.scenario.sweep import Continuation, FrequencyPath, HarmonicBalance, SweptSine
from beamsim.typing import Floats, not_none, of_kind

NO_STABLE_MOTION = "no_stable_motion"
SHARE_OF_BRANCHES = 0.8  # of the progress, if a sweep is overlaid

WITHOUT_CERTIFICATE = (
    "cubic springs have no closed-form motion: contact times are found from sign changes of sums of harmonics, without "
    "certificate"
)


def continuation(scenario: Scenario, progress: Progress = None) -> ContinuationResult:
    """Trace the periodic motions of a scenario over its parameter, at all its levels.

    Parameters
    ----------
    scenario : scenario with a ``sweep`` section of kind continuation and a harmonic excitation.
    progress : called with the completed fraction, which never decreases.

    Returns
    -------
    ContinuationResult
        Traced branches of all levels, and curves of their special points if requested.

    Raises
    ------
    ScenarioError
        If the scenario requests no continuation, or no periodic motion is found at all.
    KeyboardInterrupt
        If interrupted before any motion was found.
    """
    begin, processor = clock.perf_counter(), processor_time()
    model = response_model(scenario)
    settings, grown = model.settings, progress_that_grows(progress)
    curves_share = 1.0 if settings.overlay is None else SHARE_OF_BRANCHES
    branches, curves, remarks, left = _follow_levels(model, part_of(grown, 0.0, curves_share))
    datasets = response_datasets(model, branches) | special_curve_datasets(model, curves)
    points = datasets["points"]
    outcome = _outcome(model, points, [*remarks, *omissions(model, curves)])
    overlay: list[OverlayCurve] | None = []
    interrupted = stop_requested()
    missing = [f"level {level:.4g} {scenario.level_unit}" for level in left]
    if settings.overlay is not None:
        part = part_of(grown, curves_share, 1.0)
        overlay = None if interrupted else swept_overlay(scenario, part)
        if overlay is None:
            missing.append("sweep.overlay")
    if interrupted or missing:
        outcome = _with_missing(outcome, missing)
    result = ContinuationResult(
        scenario=scenario,
        outcome=outcome,
        datasets={
            "modes": model.system.modes,
            **datasets,
            **overlay_datasets(overlay or [], scenario.level_unit or "1"),
        },
        warnings=_warnings(model, points),
        wall_time_s=clock.perf_counter() - begin,
    )
    return result.with_summary(
        **_summary(model, result, curves),
        without_limit=growing_with_modes(branches),
        method=settings.method.kind,
        followed=[_branch_summary(result, branch) for branch in result.branches],
        overlay=_overlay_summary(result.overlay),
        dashpots=dashpots_of(result["modes"]),
        processor_time_s=processor_time() - processor,
    )


def _with_missing(outcome: Outcome, missing: Sequence[str]) -> Outcome:
    """Add the missing parts to the outcome of an interrupted computation."""
    parts = outcome.sub_outcomes if outcome.code == COMPLETE.code else (outcome,)
    return interruption(f"before {', '.join(missing)}" if missing else "", *parts)


def _follow_levels(
    model: ResponseModel, report: Progress
) -> tuple[list[MeasuredBranch], list[SpecialCurve], list[Outcome], Sequence[float]]:
    """Trace branches and curves of special points level by level.

    Also returns remarks, and the levels that were not computed.

    Raises
    ------
    KeyboardInterrupt
        If interrupted before any motion was found.
    """
    settings = model.settings
    levels = model.levels if model.followed.kind != "level" else (model.levels[0],)
    branches: list[MeasuredBranch] = []
    curves: list[SpecialCurve] = []
    remarks: list[Outcome] = []
    for index, level in enumerate(levels):
        if branches and stop_requested():
            return branches, curves, remarks, levels[index:]
        budget = Budget(
            settings.most_points, settings.longest_time, settings.most_branch_points, settings.most_side_points,
            settings.most_branches,
        )  # fmt: skip
        traced = _trace(model, level, budget, part_of(report, index / len(levels), (index + 1) / len(levels)))
        if not traced:
            if not branches:
                raise KeyboardInterrupt
            return branches, curves, remarks, levels[index:]
        remarks += _remarks(model, traced, budget, level if len(levels) > 1 else None)
        if model.second is not None:
            of_level = follow_special_points(model, traced, level, budget)
            curves += [replace(curve, branch=len(branches) + curve.branch) for curve in of_level]
        branches += [response(model, branch, level) for branch in traced]
    return branches, curves, remarks, ()


def _warnings(model: ResponseModel, points: Dataset) -> tuple[str, ...]:
    """Warnings about the scenario, its system and the motions."""
    scenario, system = model.scenario, model.system
    by_balance = isinstance(model.settings.method, HarmonicBalance)
    uncertified = by_balance and system.cubic is not None and system.dynamics.contacts.count
    return (
        *scenario.warnings,
        *system.warnings,
        *((WITHOUT_CERTIFICATE,) if uncertified else ()),
        *warnings_along(model.scenario, model.system.modes, points),
    )


def _outcome(model: ResponseModel, points: Dataset, remarks: Sequence[Outcome]) -> Outcome:
    """Outcome: the first remark about something incomplete, then the reliability of the motions."""
    remarks, settings = list(remarks), model.settings
    if isinstance(settings.method, HarmonicBalance):
        remarks += _truncation_outcome(points, settings.method)
    worst = next((remark for remark in remarks if not remark.complete), COMPLETE)
    outcome = worst.copy_with(*(remark for remark in remarks if remark is not worst))
    return check_reduction(check_balance(outcome, points), model.scenario, model.system.modes)


def _trace(model: ResponseModel, level: float, budget: Budget, report: Progress) -> list[OrbitBranch]:
    """Branches of one level, those with the excitation's own period first; empty after an interruption."""
    f, settings = model.followed, model.settings
    first, last = f.to_unknown(f.first), f.to_unknown(f.last)
    reach, wide_reach = reaches_of(first, last, beyond_first=f.moved_snubber is None)
    tracer = Tracer(model.problem(level), reach)
    branches = trace_range(tracer, first, last, budget, report)
    if not branches and budget.exhaustion() is not INTERRUPTED:
        at = "sweep.from" if settings.continue_in is None else "sweep.continue_in.from"
        raise model.scenario.located(
            ScenarioError.at(
                at,
                f"= {f.first:g} {f.unit} leads to no periodic motion in a transient, nor does any other value "
                "that was tried",
                "start at another value, or look at the motions with a sweep of kind: stepped",
            )
        )
    if settings.side_branches != "none":
        if settings.seek_at and (model.system.dynamics.contacts.count or model.system.cubic is not None):
            values = np.linspace(first, last, settings.seek_at) if settings.seek_at > 1 else [0.5 * (first + last)]
            branches += coexisting_branches(replace(tracer, reach=wide_reach), list(values), branches, budget)
        if not isinstance(settings.method, HarmonicBalance):
            branches += side_branches(branches, wide_reach, settings.longest_period, budget)
    values_at = [f.to_unknown(value) for value in f.points_at]
    wanted = [TargetPoint(f.kind, value, lambda point: point.parameter, value) for value in values_at]
    pieces: list[OrbitBranch] = []
    for branch in branches:
        for piece in cut(branch, min(first, last), max(first, last)):
            # a branch that re-enters the range along another one ends there after a few points
            alike = [other for other in pieces if other.problem.multiple == piece.problem.multiple]
            if len(piece.points) > 4 or not all(coincides(point, alike) for point in piece.points):
                pieces.append(piece)
    return [with_points_at(piece, wanted)[0] for piece in pieces]


def _remarks(model: ResponseModel, branches: list[OrbitBranch], budget: Budget, level: float | None) -> list[Outcome]:
    """Remarks on ranges that were not reached, with the reason, and on ranges without a stable motion."""
    f = model.followed
    first, last = f.to_unknown(f.first), f.to_unknown(f.last)
    within = "" if level is None else Where(level, model.scenario.level_unit, "level")

    def ranges(intervals: list[tuple[float, float]]) -> Where:
        return Where([(float(f.from_unknown(a)), float(f.from_unknown(b))) for a, b in intervals], f.unit)

    parts: list[Outcome] = []
    gaps = missing([t for t in branches if t.problem.multiple == 1], first, last)
    if gaps:
        why = next((t.outcome for t in reversed(branches) if not t.outcome.complete), branches[0].outcome)
        uncovered = Outcome.of(
            OutcomeKind.INCOMPLETE, "not_covered", "no motion was followed", f.in_user_unit(why), at=ranges(gaps)
        )
        parts.append(uncovered)
    failed = [f.in_user_unit(part) for t in branches for part in t.outcome.outcomes_with_code(SEARCH_FAILED)]
    parts += [part for part in failed if not any(part in known.sub_outcomes for known in parts)]
    exceeded = budget.exceeded(incomplete=bool(gaps) or model.settings.side_branches == "required")
    if exceeded is not None:
        parts.append(exceeded)
    parts += _omitted_outcomes(model, branches)
    stable = [
        (min(a, b), max(a, b)) if one.stable and other.stable else (a, a) if one.stable else (b, b)
        for branch in branches
        for (a, one), (b, other) in pairwise(zip(branch.values.tolist(), branch.orbits, strict=True))
        if one.stable or other.stable
    ]
    if bands := gaps_between([*stable, *gaps], min(first, last), max(first, last)):
        parts.append(Outcome.of(OutcomeKind.NOTED, NO_STABLE_MOTION, "no stable motion was found", at=ranges(bands)))
    return [part.copy_with(context=within) for part in parts]


def _omitted_outcomes(model: ResponseModel, branches: list[OrbitBranch]) -> Iterator[Outcome]:
    """Outcomes for branches and motions that the method or a setting excludes."""
    settings = model.settings
    by_balance = isinstance(settings.method, HarmonicBalance)
    reason = "sweep.side_branches is none" if settings.side_branches == "none" else "harmonic balance follows none"
    bifurcations = sum(len(branching_points(branch, settings.longest_period)) for branch in branches)
    if bifurcations and (by_balance or settings.side_branches == "none"):
        yield Outcome.of(
            OutcomeKind.NOTED, "not_branched", f"from {bifurcations} bifurcations no branch was followed: {reason}",
            bifurcations=bifurcations,
        )  # fmt: skip
    if by_balance and settings.seek_at and settings.side_branches != "none" and model.system.cubic is not None:
        sentence = "coexisting motions were not searched: harmonic balance cannot do so with cubic springs"
        yield Outcome.of(OutcomeKind.NOTED, "not_sought", sentence)


def _truncation_outcome(points: Dataset, method: HarmonicBalance) -> Iterator[Outcome]:
    """Yield an outcome if the truncation error exceeds `largest_error`."""
    error, parameter = points["neglected_harmonics"].values, points["parameter"]
    worst = int(np.argmax(error))
    if error[worst] > method.largest_error:
        yield Outcome.of(
            OutcomeKind.UNTRUSTED, "harmonics_neglected",
            f"the neglected harmonics amount to {100 * error[worst]:.3g} % of the motion (sweep.method.largest_error = "
            f"{100 * method.largest_error:g} %)",
            at=Where(float(parameter.values[worst]), parameter.unit),
            remedy=f"raise sweep.method.harmonics above {method.harmonics}, or use shooting",
        )  # fmt: skip


def _summary(model: ResponseModel, result: ContinuationResult, curves: Sequence[SpecialCurve]) -> dict[str, Any]:
    branches, points = result.branches, result["points"]
    level, period = (result["branches"][name].values.tolist() for name in ("level", "period_multiple"))
    special = result["special_points"]
    summary: dict[str, Any] = {
        "energy_error": float(points["energy_error"].values.max()),
        "points": points["point"].values.size,
        "branches": len(branches),
        "peaks": [
            {
                "frequency_hz": float(b["frequency_hz"].values[k]),
                "parameter": float(b["parameter"].values[k]),
                "value_m": float(values[k]),
                "kind": "stable" if b["stable"].values[k] else "unstable",
                "direction": "continuation",
                "level": b["level"].item(),
                "period_multiple": b["period_multiple"].item(),
                "probe": name,
            }
            for b, name, values, k in _highest(branches)
        ],
        "special_points": [
            {"kind": kind, "frequency_hz": hz, "parameter": at, "snubber": snubber, "level": level[number],
             "period_multiple": period[number]}
            for kind, hz, at, snubber, number in zip(
                *(special[name].values.tolist() for name in ("kind", "frequency_hz", "parameter", "snubber", "branch")),
                strict=True,
            )
        ],
        "without_stable_motion": [
            {"band": list(band), "level": part.context.value if isinstance(part.context, Where) else level[0]}
            for part in result.outcome.outcomes_with_code(NO_STABLE_MOTION)
            if part.place is not None
            for band in part.place.value
        ],
        **largest_values(model, points),
    }  # fmt: skip
    if model.second is not None:
        summary["second_parameter"] = model.second.kind
        summary["special_curves"] = [
            {
                "kind": c.kind,
                "start_hz": c.start_hz,
                "touching": c.touching,
                "points": int(c.frequency_hz.size),
                "smallest_parameter": float(c.parameter.min(initial=np.inf)),
                "largest_parameter": float(c.parameter.max(initial=-np.inf)),
                "smallest_hz": float(c.frequency_hz.min(initial=np.inf)),
                "largest_hz": float(c.frequency_hz.max(initial=-np.inf)),
                "status": c.outcome.of_part,
                "events": [dict(zip(("kind", "frequency_hz", "parameter"), of, strict=True)) for of in c.events],
            }
            for c in curves
        ]
    if "neglected_harmonics" in points:
        summary["neglected_harmonics"] = float(points["neglected_harmonics"].values.max())
    return summary


def _branch_summary(result: ContinuationResult, branch: Dataset) -> dict[str, Any]:
    """Summary of a branch."""
    off = result.off_centre(branch)
    return {
        "level": branch["level"].item(),
        "period_multiple": branch["period_multiple"].item(),
        "points": branch["parameter"].values.size,
        "stable_points": int(branch["stable"].values.sum()),
        **({} if off is None else {"off_centre": off[0], "largest_mean_m": off[1]}),
        "ended": branch["status"].item(),
    }


def _highest(branches: Sequence[Dataset]) -> list[tuple[Dataset, str, Floats, int]]:
    """Highest point of all motions for every level and probe."""
    highest = []
    for level in dict.fromkeys(repr(b["level"].item()) for b in branches):
        at_level = [(b, b.by_label("peak_displacement")) for b in branches if repr(b["level"].item()) == level]
        for probe in at_level[0][1]:
            best, peaks = max(at_level, key=lambda each: float(each[1][probe].values.max()))
            values = peaks[probe].values
            highest.append((best, probe, values, int(np.argmax(values))))
    return highest


def swept_overlay(scenario: Scenario, progress: Progress = None) -> list[OverlayCurve] | None:
    """Swept sine that a continuation's ``overlay`` requests, at the same levels.

    Parameters
    ----------
    scenario : scenario with an ``overlay`` in its continuation.
    progress : called with the completed fraction of the sweep.

    Returns
    -------
    dict | None
        Curves by name; None if the sweep is interrupted.

    Raises
    ------
    ScenarioError
        If the structure or the rate does not allow a sweep, or the sweep ends early.
    """
    settings = of_kind(Continuation, scenario.sweep)
    asked = not_none(settings.overlay)
    path = of_kind(FrequencyPath, settings.parameter)
    low, high = sorted((path.from_, path.to))
    swept = SweptSine.model_construct(
        from_=low, to=high, levels=settings.levels, rate=asked.rate, direction=asked.direction
    )
    result = sweep(scenario.model_copy(update={"sweep": swept, "limits": None}), progress)
    if result.outcome.interrupted:
        return None
    if not result.complete:
        raise ScenarioError.at("sweep.overlay", f"was not computed: {result.status}", "leave it out")
    return [overlay_curve(curve, name, "", result.title) for name, curve in result.curves.items()]


def with_overlay(result: ContinuationResult, sweep_result: SweepResult, source: str) -> ContinuationResult:
    """Add the curves of a stored sweep to a response.

    Parameters
    ----------
    result : response in frequency.
    sweep_result : result of the sweep.
    source : name of the sweep, such as its file name.

    Returns
    -------
    ContinuationResult
        Result with the new curves in addition to earlier ones.

    Raises
    ------
    ScenarioError
        If the two have no probe or parameter in common.
    """
    if result.parameter != "frequency":
        raise ScenarioError.at(
            "--overlay",
            f"overlays a sweep on a curve in frequency, but this one is in {result.parameter}",
            "leave it out, or continue in the frequency",
        )
    probes = set(result["points"].labels("probe"))
    overlay = dict(result.overlay)
    for curve in sweep_result.curves.values():
        if not probes & set(curve.places("displacement")):
            raise ScenarioError.at(
                "--overlay",
                f"{source} has the probes {', '.join(curve.places('displacement'))}, and the curve has "
                f"{', '.join(sorted(probes))}",
                "give a sweep with a probe of the same name",
            )
        names = (f"{curve.direction}_{index}" for index in count(curve.level_index))
        name = next(name for name in names if name not in overlay)
        overlay[name] = overlay_curve(curve, name, source, sweep_result.title)
    datasets = result.datasets | overlay_datasets(list(overlay.values()), result.level_unit or "1")
    return replace(result, datasets=datasets, summary=result.summary | {"overlay": _overlay_summary(overlay)})


def _overlay_summary(overlay: Mapping[str, OverlayCurve]) -> dict[str, Any] | None:
    """Summary of the overlay curves; None without curves."""
    return {
        name: {
            "direction": curve.direction, "level": curve.level, "source": curve.source,
            "stepped": curve.kind == "stepped",
        }
        for name, curve in overlay.items()
    } or None  # fmt: skip
