"""``beamsim sweep`` of kind continuation: curves of periodic motions against a parameter, stable and unstable.

Swept and stepped sines are overlaid on them: computed with them, or taken from stored sweeps.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from itertools import count, pairwise
from typing import Any

import numpy as np

from beamsim.analyses.continuation.folds import follow_folds
from beamsim.analyses.continuation.motion import MeasuredMotion, Measurement, measured
from beamsim.analyses.continuation.result import ContinuationResult, OverlayCurve
from beamsim.analyses.sweep.analysis import sweep
from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.errors import ScenarioError
from beamsim.flow.compiled import processor_time
from beamsim.orbits.branch import INTERRUPTED, SEARCH_FAILED, OrbitBranch
from beamsim.orbits.harmonic_balance import truncation
from beamsim.orbits.shooting import STABLE
from beamsim.orbits.tracing import (
    COVERED,
    Budget,
    Tracer,
    coexisting_branches,
    coincides,
    gaps_between,
    leavings,
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
    asked_to_stop,
    interruption,
    part_of,
)
from beamsim.responses.orbit_energies import balanced, largest_error
from beamsim.responses.parameters import ResponseModel, response_model
from beamsim.responses.points import ReportedMaximum, Wanted, cut, with_maxima, with_points_at
from beamsim.results.branch import (
    ChannelExtremes,
    FoldBranch,
    OutputExtremes,
    ResponseBranch,
    of_states,
    special_result,
)
from beamsim.results.result import curve_warnings, dashpots_of, reduction_checked
from beamsim.results.values import (
    DISPLACEMENT,
    LIMITED,
    OPENING,
    OUTPUT,
    STRESS,
    Value,
    largest_along,
    limited,
    margins_along,
)  # fmt: skip
from beamsim.scenario import Scenario
from beamsim.scenario.sweep import Continuation, FrequencyPath, HarmonicBalance, SweptSine
from beamsim.system.equations import ChannelSet
from beamsim.typing import Floats, Ints, not_none, of_kind

NO_STABLE_MOTION = "no_stable_motion"
SHARE_OF_BRANCHES = 0.8  # of the progress, where a sweep is overlaid

WITHOUT_CERTIFICATE = (
    "cubic springs have no closed-form motion: contacts are found by sign changes on sums of harmonics, without "
    "certificate"
)


def continuation(scenario: Scenario, progress: Progress = None) -> ContinuationResult:
    """Follow the periodic motions of a scenario through its parameter, at all its levels.

    Parameters
    ----------
    scenario : with a ``sweep`` section of kind continuation and a harmonic excitation.
    progress : called with the fraction that is done, which never falls.

    Returns
    -------
    ContinuationResult
        The branches of all levels that were followed, and the curves of their folds where these are asked for.

    Raises
    ------
    ScenarioError
        Where the scenario asks for none, or no periodic motion is found at all.
    KeyboardInterrupt
        Where it was time to stop before any was found.
    """
    begin, processor = clock.perf_counter(), processor_time()
    model = response_model(scenario)
    settings, grown = model.settings, progress_that_grows(progress)
    curves_share = 1.0 if settings.overlay is None else SHARE_OF_BRANCHES
    branches, folds, remarks, left = _follow_levels(model, part_of(grown, 0.0, curves_share))
    outcome = _outcome(model, branches, remarks)
    overlay: dict[str, OverlayCurve] | None = {}
    interrupted = asked_to_stop()
    missing = [f"level {level:.4g} {scenario.level_unit}" for level in left]
    if settings.overlay is not None:
        part = part_of(grown, curves_share, 1.0)
        overlay = None if interrupted else swept_overlay(scenario, part)
        if overlay is None:
            missing.append("sweep.overlay")
    if interrupted or missing:
        outcome = _cut_short(outcome, missing)
    f, second = model.followed, model.second
    result = ContinuationResult(
        scenario=scenario,
        outcome=outcome,
        branches=tuple(branches),
        datasets={"modes": model.system.modes},
        warnings=_warnings(model, branches),
        wall_time_s=clock.perf_counter() - begin,
        parameter=f.kind,
        unit=f.unit,
        snubber=f.snubber,
        level_unit=scenario.level_unit or "1",
        method=settings.method.kind,
        fold_curves=tuple(folds),
        second_parameter="" if second is None else second.kind,
        second_unit="" if second is None else second.unit,
        second_snubber="" if second is None else second.snubber,
        overlay=overlay or {},
    )
    return result.with_summary(
        **_summary(model, outcome, branches, folds, processor_time() - processor),
        followed=[_followed(result, branch) for branch in branches],
        overlay=_described(result.overlay),
        dashpots=dashpots_of(result["modes"]),
    )


def _cut_short(outcome: Outcome, missing: Sequence[str]) -> Outcome:
    """The outcome of what was interrupted, with what is missing."""
    parts = outcome.parts if outcome.code == COMPLETE.code else (outcome,)
    return interruption(f"before {', '.join(missing)}" if missing else "", *parts)


def _follow_levels(
    model: ResponseModel, report: Progress
) -> tuple[list[ResponseBranch], list[FoldBranch], list[Outcome], Sequence[float]]:
    """Branches and folds of one level after the other, remarks on them, and the levels that are left.

    Raises
    ------
    KeyboardInterrupt
        Where it was time to stop before any was found.
    """
    settings = model.settings
    levels = model.levels if model.followed.kind != "level" else (model.levels[0],)
    branches: list[ResponseBranch] = []
    folds: list[FoldBranch] = []
    remarks: list[Outcome] = []
    for index, level in enumerate(levels):
        if branches and asked_to_stop():
            return branches, folds, remarks, levels[index:]
        budget = Budget(
            settings.most_points, settings.longest_time, settings.most_branch_points, settings.most_side_points,
            settings.most_branches,
        )  # fmt: skip
        traced = _trace(model, level, budget, part_of(report, index / len(levels), (index + 1) / len(levels)))
        if not traced:
            if not branches:
                raise KeyboardInterrupt
            return branches, folds, remarks, levels[index:]
        remarks += _remarks(model, traced, budget, level if len(levels) > 1 else None)
        if model.second is not None:
            folds += follow_folds(model, traced, level, budget)
        branches += [response(model, branch, level) for branch in traced]
    return branches, folds, remarks, ()


def _warnings(model: ResponseModel, branches: list[ResponseBranch]) -> tuple[str, ...]:
    """What is doubtful in a scenario, its system and the motions."""
    scenario, system = model.scenario, model.system
    by_balance = isinstance(model.settings.method, HarmonicBalance)
    uncertified = by_balance and system.cubic.count and system.dynamics.contacts.count
    return (
        *scenario.warnings,
        *system.warnings,
        *((WITHOUT_CERTIFICATE,) if uncertified else ()),
        *curve_warnings(scenario, system.modes, branches),
    )


def _outcome(model: ResponseModel, branches: list[ResponseBranch], remarks: Sequence[Outcome]) -> Outcome:
    """How it ended, by the first remark on what is incomplete, and how sure the motions are."""
    remarks, settings = list(remarks), model.settings
    if isinstance(settings.method, HarmonicBalance):
        remarks += _doubt(branches, settings.method, model.followed.unit)
    worst = next((remark for remark in remarks if not remark.complete), COMPLETE)
    outcome = worst.but(*(remark for remark in remarks if remark is not worst))
    return reduction_checked(balanced(outcome, branches, model.followed.unit), model.scenario, model.system.modes)


def _trace(model: ResponseModel, level: float, budget: Budget, report: Progress) -> list[OrbitBranch]:
    """The branches of one level, those of the excitation's own period first; none where it was time to end."""
    f, settings = model.followed, model.settings
    first, last = f.inward(f.first), f.inward(f.last)
    reach, beside = reaches_of(first, last, beyond=f.moved is None)
    tracer = Tracer(model.problem(level), reach)
    branches = trace_range(tracer, first, last, budget, report)
    if not branches and budget.spent() is not INTERRUPTED:
        at = "sweep.from" if settings.continue_in is None else "sweep.continue_in.from"
        raise model.scenario.located(
            ScenarioError.at(
                at,
                f"= {f.first:g} {f.unit} has no periodic motion that a transient comes to, nor has any other value "
                "that was tried",
                "begin elsewhere, or sweep with kind: stepped to see what the motions are",
            )
        )
    if settings.side_branches != "none":
        if settings.seek_at and (model.system.dynamics.contacts.count or model.system.cubic.count):
            values = np.linspace(first, last, settings.seek_at) if settings.seek_at > 1 else [0.5 * (first + last)]
            branches += coexisting_branches(replace(tracer, reach=beside), list(values), branches, budget)
        if not isinstance(settings.method, HarmonicBalance):
            branches += side_branches(branches, beside, settings.longest_period, budget)
    values_at = [f.inward(value) for value in f.points_at]
    wanted = [Wanted(f.kind, value, lambda point: point.parameter, value) for value in values_at]
    pieces: list[OrbitBranch] = []
    for branch in branches:
        for piece in cut(branch, min(first, last), max(first, last)):
            # a branch that comes back into the range along another one ends there after a few points
            alike = [other for other in pieces if other.problem.multiple == piece.problem.multiple]
            if len(piece.points) > 4 or not all(coincides(point, alike) for point in piece.points):
                pieces.append(piece)
    return [with_points_at(piece, wanted)[0] for piece in pieces]


def _remarks(model: ResponseModel, traced: list[OrbitBranch], budget: Budget, level: float | None) -> list[Outcome]:
    """What was not reached and why, and where no stable motion was found."""
    f = model.followed
    first, last = f.inward(f.first), f.inward(f.last)
    within = "" if level is None else Where(level, model.scenario.level_unit, "level")

    def ranges(stretches: list[tuple[float, float]]) -> Where:
        return Where([(float(f.outward(a)), float(f.outward(b))) for a, b in stretches], f.unit)

    parts: list[Outcome] = []
    gaps = missing([t for t in traced if t.problem.multiple == 1], first, last)
    if gaps:
        why = next((t.outcome for t in reversed(traced) if not t.outcome.complete), traced[0].outcome)
        uncovered = Outcome.of(
            OutcomeKind.INCOMPLETE, "not_covered", "no motion was followed", f.shown(why), at=ranges(gaps)
        )
        parts.append(uncovered)
    failed = [f.shown(part) for t in traced for part in t.outcome.all_of(SEARCH_FAILED)]
    parts += [part for part in failed if not any(part in known.parts for known in parts)]
    exceeded = budget.exceeded(incomplete=bool(gaps) or model.settings.side_branches == "required")
    if exceeded is not None:
        parts.append(exceeded)
    parts += _left_out(model, traced)
    bands: list[tuple[float, float]] = []
    stable = [
        (min(a, b), max(a, b))
        for branch in traced
        for (a, one), (b, other) in pairwise(zip(branch.values.tolist(), branch.orbits, strict=True))
        if one.stable and other.stable
    ]
    for a, b in gaps_between(stable, min(first, last), max(first, last)):
        if bands and a - bands[-1][1] < COVERED * abs(last - first):
            a = bands.pop()[0]
        bands.append((a, b))
    if bands:
        parts.append(Outcome.of(OutcomeKind.NOTED, NO_STABLE_MOTION, "no stable motion was found", at=ranges(bands)))
    return [part.but(within=within) for part in parts]


def _left_out(model: ResponseModel, traced: list[OrbitBranch]) -> Iterator[Outcome]:
    """What was not followed or sought because of the method or a setting."""
    settings = model.settings
    by_balance = isinstance(settings.method, HarmonicBalance)
    reason = "sweep.side_branches is none" if settings.side_branches == "none" else "harmonic balance follows none"
    bifurcations = sum(len(leavings(branch, settings.longest_period)) for branch in traced)
    if bifurcations and (by_balance or settings.side_branches == "none"):
        yield Outcome.of(
            OutcomeKind.NOTED, "not_branched", f"from {bifurcations} bifurcations no branch was followed: {reason}",
            bifurcations=bifurcations,
        )  # fmt: skip
    if by_balance and settings.seek_at and settings.side_branches != "none" and model.system.cubic.count:
        sentence = "coexisting motions were not sought: harmonic balance seeks none with cubic springs"
        yield Outcome.of(OutcomeKind.NOTED, "not_sought", sentence)


def _doubt(branches: list[ResponseBranch], method: HarmonicBalance, unit: str) -> Iterator[Outcome]:
    """A word on neglected harmonics where they are worth more than allowed."""
    error = np.concatenate([b.neglected_harmonics for b in branches if b.neglected_harmonics is not None])
    worst = int(np.argmax(error))
    if error[worst] > method.largest_error:
        parameter = float(np.concatenate([b.parameter for b in branches])[worst])
        yield Outcome.of(
            OutcomeKind.UNTRUSTED, "harmonics_neglected",
            f"the neglected harmonics amount to {100 * error[worst]:.3g} % of the motion (sweep.method.largest_error = "
            f"{100 * method.largest_error:g} %)",
            at=Where(parameter, unit), remedy=f"raise sweep.method.harmonics above {method.harmonics}, or use shooting",
        )  # fmt: skip


def response(model: ResponseModel, traced: OrbitBranch, level: float) -> ResponseBranch:
    """Peaks, harmonics, forces and stability along a branch.

    Parameters
    ----------
    model : whose motions they are.
    traced : the branch.
    level : of the excitation.

    Returns
    -------
    ResponseBranch
    """
    f, system, problem = model.followed, model.system, traced.problem
    settings, limits = model.settings, model.scenario.limits
    channels = measured(system, () if limits is None else limits.model_fields_set)
    moved = None if f.moved is None else f.system
    measurement = Measurement(system, model.scenario.sine, channels, settings.stored_harmonics, moved)
    traced, motions = with_maxima(
        traced, lambda point: measurement.of(problem, point), _reported_maxima(model, channels)
    )
    spectra = [problem.multipliers(point) for point in traced.points]
    count = min((mu.size for mu in spectra), default=0)
    multipliers = np.array([mu[:count] for mu in spectra])
    unknown = traced.values
    parameter = np.asarray(f.outward(unknown), dtype=float)
    ends = np.array([(m.high, m.low) for m in motions])
    from_balance = None
    if isinstance(settings.method, HarmonicBalance):
        from_balance = np.array([truncation(problem, point) for point in traced.points])
    return ResponseBranch(
        level=float("nan") if f.kind == "level" else level,
        period_multiple=problem.multiple,
        outcome=f.shown(traced.outcome),
        energy_error=np.array([m.energy_error for m in motions]),
        frequency_hz=parameter.copy() if f.kind == "frequency" else np.full(parameter.size, model.frequency_hz),
        **_extremes(model, channels, ends),
        harmonics={p.name: np.array([m.harmonics[k] for m in motions]) for k, p in enumerate(system.probes)},
        stable=np.abs(multipliers).max(axis=1, initial=0.0) <= 1.0 + STABLE,
        floquet_multipliers=multipliers,
        residual=np.array([p.residual for p in traced.points]),
        **of_states(np.array([orbit.state for orbit in traced.orbits]), system.dynamics.size),
        special=tuple(
            special_result(s, value, value if f.kind == "frequency" else model.frequency_hz, system.contact_names)
            for s in traced.special
            for value in [float(f.outward(s.parameter))]
        ),
        parameter=parameter,
        unit=f.unit,
        parameter_meaning=f"what is followed: {f.label}",
        contact_share={s.name: np.array([m.contact_share[k] for m in motions]) for k, s in enumerate(system.snubbers)},
        neglected_harmonics=from_balance,
    )


def _extremes(model: ResponseModel, channels: ChannelSet, ends: Floats) -> dict[str, Any]:
    """The fields of a branch that hold extremes of channels.

    Parameters
    ----------
    model : whose motions they are.
    channels : C columns.
    ends : (points, 2, C) largest and smallest values.
    """
    high = channels.split(ends[:, 0])
    stress = channels.split(np.abs(ends).max(axis=1)).get(STRESS)

    def followed(section: str) -> tuple[ChannelExtremes, ...]:
        return tuple(
            ChannelExtremes(each.name, each.quantity, each.unit, *ends[:, :, k].T)
            for each, k in channels.located
            if each.section == section and each.key != OPENING
        )

    return {
        "probes": followed("probes"),
        "snubbers": followed("snubbers"),
        "peak_gap": {
            s.name: high[OPENING][:, k]
            for k, s in enumerate(model.system.snubbers)
            if OPENING in high and s.gap_unit == "m"
        },
        "peak_bending_stress": None if stress is None else stress.max(axis=1),
        "outputs": {
            each.name: OutputExtremes(each.name, each.quantity, each.unit, each.at, *ends[:, :, k].T)
            for each, k in channels.located
            if each.section == "outputs"
        },
    }


def _reported_maxima(model: ResponseModel, channels: ChannelSet) -> list[ReportedMaximum[MeasuredMotion]]:
    """Peak displacement of every probe; where there are limits, what they limit, of stable motions."""

    def largest_of(value: Value, columns: Ints) -> Callable[[MeasuredMotion], float]:
        none, of = np.zeros(columns.size), not_none(value.of)
        return lambda m: float(of(np.array([m.low[columns], none, m.high[columns], none])).max())

    displacements, limits = channels.places[DISPLACEMENT], model.scenario.limits
    maxima = [ReportedMaximum(largest_of(LIMITED["peak_displacement"], each), False) for each in displacements[:, None]]
    for name in () if limits is None else limits.given:
        value, place = limited(name)
        columns = [k for each, k in channels.located if value.takes(each) and place in ("", each.name)]
        some = [np.array(columns)] if value.single else [np.array([k]) for k in columns]
        maxima += [ReportedMaximum(largest_of(value, each), True) for each in some if each.size]
    return maxima


def _summary(
    model: ResponseModel,
    outcome: Outcome,
    branches: list[ResponseBranch],
    folds: list[FoldBranch],
    processor_time_s: float,
) -> dict[str, Any]:
    summary: dict[str, Any] = {
        "energy_error": largest_error(branches),
        "points": int(sum(b.parameter.size for b in branches)),
        "branches": len(branches),
        "peaks": [
            {
                "frequency_hz": float(b.frequency_hz[k]),
                "parameter": float(b.parameter[k]),
                "value_m": float(values[k]),
                "kind": "stable" if b.stable[k] else "unstable",
                "direction": "continuation",
                "level": b.level,
                "period_multiple": b.period_multiple,
                "probe": name,
            }
            for b, name, values, k in _highest(model, branches)
        ],
        "special_points": [
            {"kind": e.kind, "frequency_hz": e.frequency_hz, "parameter": e.parameter, "snubber": e.snubber,
             "level": b.level, "period_multiple": b.period_multiple}
            for b in branches
            for e in b.special
        ],
        "without_stable_motion": [
            {"band": list(band), "level": part.within.value if isinstance(part.within, Where) else branches[0].level}
            for part in outcome.all_of(NO_STABLE_MOTION)
            if part.place is not None
            for band in part.place.value
        ],
        **largest_values(model, branches),
        "processor_time_s": processor_time_s,
    }  # fmt: skip
    if model.second is not None:
        summary["second_parameter"] = model.second.kind
        summary["fold_curves"] = [
            {
                "start_hz": c.start_hz,
                "touching": c.touching,
                "points": int(c.frequency_hz.size),
                "smallest_parameter": float(c.parameter.min(initial=np.inf)),
                "largest_parameter": float(c.parameter.max(initial=-np.inf)),
                "smallest_hz": float(c.frequency_hz.min(initial=np.inf)),
                "largest_hz": float(c.frequency_hz.max(initial=-np.inf)),
                "status": c.outcome.text,
            }
            for c in folds
        ]
    worth = [float(b.neglected_harmonics.max()) for b in branches if b.neglected_harmonics is not None]
    if worth:
        summary["neglected_harmonics"] = max(worth)
    return summary


def _followed(result: ContinuationResult, branch: ResponseBranch) -> dict[str, Any]:
    """A branch, for the summary."""
    off = result.off_centre(branch)
    return {
        "level": branch.level,
        "period_multiple": branch.period_multiple,
        "points": branch.parameter.size,
        "stable_points": int(branch.stable.sum()),
        **({} if off is None else {"off_centre": off[0], "largest_mean_m": off[1]}),
        "ended": branch.outcome.text,
    }


def largest_values(model: ResponseModel, branches: list[ResponseBranch]) -> dict[str, Any]:
    """Largest values of all stable motions by name (peaks have the displacements), and margins, for the summary."""
    entries: dict[str, Any] = {}
    found = list(largest_along(branches))
    for value, name, largest, parameter in found:
        if value is OUTPUT:
            entries.setdefault(value.entry, {})[name] = {"value": largest, "parameter": parameter}
        elif value.followed and value.key != DISPLACEMENT:
            entries.setdefault(value.entry, {})[name] = largest / value.scale
    if model.system.outputs:
        entries["output_unit"] = {rows.name: rows.unit for rows in model.system.outputs}
    limits, unit = model.scenario.limits, model.followed.unit
    margins = margins_along(limits, ((value, name, size, f"{at:.4g} {unit}") for value, name, size, at in found))
    return {**entries, "margins": margins}


def _highest(model: ResponseModel, branches: list[ResponseBranch]) -> list[tuple[ResponseBranch, str, Floats, int]]:
    """Of every level and probe the highest point of all motions."""
    highest = []
    for level in dict.fromkeys(repr(b.level) for b in branches):
        at_level = [b for b in branches if repr(b.level) == level]
        for probe in model.system.probes:
            best = max(at_level, key=lambda b: float(b.displacement[probe.name].peak.max()))
            values = best.displacement[probe.name].peak
            highest.append((best, probe.name, values, int(np.argmax(values))))
    return highest


def swept_overlay(scenario: Scenario, progress: Progress = None) -> dict[str, OverlayCurve] | None:
    """The swept sine that a continuation's ``overlay`` asks for, at the same levels.

    Parameters
    ----------
    scenario : with an ``overlay`` in its continuation.
    progress : called with the share of the sweep that is done.

    Returns
    -------
    dict | None
        The curves by name; None where the sweep is interrupted.

    Raises
    ------
    ScenarioError
        Where the structure or the rate cannot be swept, or the sweep ends early.
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
    return {name: _overlaid(curve, result.title, "") for name, curve in result.curves.items()}


def with_overlay(result: ContinuationResult, stored: SweepResult, source: str) -> ContinuationResult:
    """The response with the curves of a stored sweep overlaid.

    Parameters
    ----------
    result : in frequency.
    stored : the sweep.
    source : what it is called, such as the name of its file.

    Returns
    -------
    ContinuationResult
        With the new curves beside those that were overlaid before.

    Raises
    ------
    ScenarioError
        Where the two have nothing in common to draw.
    """
    if result.parameter != "frequency":
        raise ScenarioError.at(
            "--overlay",
            f"overlays a sweep on a curve in frequency, and this one is in {result.parameter}",
            "leave it out, or follow the frequency",
        )
    probes = {name for branch in result.branches for name in branch.displacement}
    overlay = dict(result.overlay)
    for curve in stored.curves.values():
        if not probes & set(curve.displacement):
            raise ScenarioError.at(
                "--overlay",
                f"{source} has the probes {', '.join(curve.displacement)}, and the curve has "
                f"{', '.join(sorted(probes))}",
                "give a sweep with a probe of the same name",
            )
        names = (f"{curve.direction}_{index}" for index in count(curve.level_index))
        name = next(name for name in names if name not in overlay)
        overlay[name] = replace(_overlaid(curve, stored.title, source), name=name)
    return replace(result, overlay=overlay, summary=result.summary | {"overlay": _described(overlay)})


def _described(overlay: Mapping[str, OverlayCurve]) -> dict[str, Any] | None:
    """The curves over the branches, for the summary; None without any."""
    return {
        name: {
            "direction": curve.direction, "level": curve.level, "source": curve.source,
            "stepped": curve.steady is not None,
        }
        for name, curve in overlay.items()
    } or None  # fmt: skip


def _overlaid(curve: SweepCurve, title: str, source: str) -> OverlayCurve:
    values = {field.name: getattr(curve, field.name) for field in fields(curve)}
    return OverlayCurve(**values, source=source, title=title)
