"""Sweeps, continuations and modes, as the commands and the package call them: with the errors of their values.

A swept or stepped sine is compared with a finer model unless that is switched off, a continuation and a nonlinear
normal mode where it is asked for. Without a comparison the summary says so. Runs are in `beamsim.trust.runs`.
"""

from __future__ import annotations

import math
import time as clock
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np

from beamsim.errors import ScenarioError
from beamsim.flow.compiled import processor_time
from beamsim.flow.swept_motion import CLOSE
from beamsim.outcomes import Progress, Stop, never, part_of, stop_requested, stop_requests
from beamsim.responses.gapping import finite
from beamsim.results.values import VALUES, largest_in, peaks_in
from beamsim.scenario import Scenario, Source, scenario_of
from beamsim.system.reduced_model import SharedBuilds
from beamsim.trust.convergence import (
    COMPARISON,
    NOT_ASKED,
    Changes,
    Convergence,
    Errors,
    Values,
    comparable_values,
    errors_of,
    exact,
    finer_case,
    keeps_all,
    largest_errors,
    relative_changes,
    unconverged_values,
    with_convergence,
)
from beamsim.trust.least_time import least_time_of_sweep
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.analyses.coexisting.result import CoexistingResult
    from beamsim.analyses.continuation.result import ContinuationResult
    from beamsim.analyses.nnm.result import NormalModeResult
    from beamsim.analyses.statics.result import StaticResult
    from beamsim.analyses.sweep.result import SweepResult


_Result = TypeVar(
    "_Result", "CoexistingResult", "ContinuationResult", "NormalModeResult", "StaticResult", "SweepResult"
)
HIGHEST = 5  # number of cycles with the largest values of a sweep that are compared (docs/theory.md, section 7) ...
NEARLY = 0.9  # ... if they reach this share of the largest one


class _ComparedValues(NamedTuple, Generic[_Result]):
    """Functions that give the compared values of two results."""

    values: Callable[[_Result], Values]
    cycles: Callable[[_Result, _Result], Changes] | None = None  # changes of the cycles behind the values
    lower_bounds: Callable[[_Result], Errors] | None = None  # errors of the values of a model, which no finer one shows


def sweep(
    scenario: Source,
    progress: Progress = None,
    *,
    stop: Stop = never,
    save: Callable[[SweepResult], object] | None = None,
    resume: SweepResult | None = None,
) -> SweepResult:
    """Compute the sweeps of a scenario at all its levels, and compare their values with those of a finer model.

    Parameters
    ----------
    scenario : with a ``sweep`` section of kind swept_sine or stepped and a harmonic excitation, or what
        `beamsim.load_scenario` reads, such as the path of its file.
    progress : called with the fraction done.
    stop : asked between cycles, frequencies and levels whether to end; the result then holds those up to there,
        which may be none.
    save : called with the partial result after the first level and repeatedly later, and before the comparison.
    resume : partial result of an interrupted sweep of the same scenario; its levels are not computed again.

    Returns
    -------
    SweepResult
        With ``convergence`` and ``doubtful`` in its summary, unless it was cut short.

    Raises
    ------
    ScenarioError
        If the scenario cannot be swept.
    TooLongError
        If it would take longer than `beamsim.allowing_hours` allows.

    Examples
    --------
    >>> import beamsim
    >>> stepped = {"sweep": {"kind": "stepped", "from": "14 Hz", "to": "16 Hz", "points": 2}}
    >>> result = beamsim.sweep(beamsim.load_scenario("configs/stops/chain_bumpers.yaml", stepped))
    >>> result["steady_states"]["kind"].values.tolist()
    ['periodic', 'periodic']
    """
    scenario = scenario_of(scenario, "sweep")
    least_time_of_sweep(scenario).demand_allowed()
    from beamsim.analyses.sweep.analysis import sweep as compute

    asked = scenario.sweep is not None and scenario.sweep.convergence != "off"

    def first(progress_of_part: Progress) -> SweepResult:
        result = compute(scenario, progress_of_part, save=save, resume=resume)
        if save is not None and asked and not result.outcome.cut_short:
            save(result)
        return result

    with stop_requests(stop):
        return _with_convergence_errors(
            first, compute, asked, _ComparedValues(_of_sweep, _changes_of_cycles, _least_of_level), progress
        )


def continuation(scenario: Source, progress: Progress = None, stop: Stop = never) -> ContinuationResult:
    """Follow the periodic motions of a scenario; compare them with a finer model's where ``sweep.convergence: on``.

    Parameters
    ----------
    scenario : with a ``sweep`` section of kind continuation, or what `beamsim.load_scenario` reads.
    progress : called with the fraction done.
    stop : asked between points whether to end; the result then holds those up to there.

    Returns
    -------
    ContinuationResult
        With ``convergence`` and ``doubtful`` in its summary, unless it was cut short.

    Raises
    ------
    ScenarioError
        If the scenario cannot be continued.
    TooLongError
        If it would take longer than `beamsim.allowing_hours` allows.

    Examples
    --------
    >>> import beamsim
    >>> case = beamsim.load_scenario("configs/stops/chain_bumpers.yaml", {"sweep.to": "10.5 Hz"})
    >>> result = beamsim.continuation(case)
    >>> result["points"]["frequency_hz"].values[[0, -1]].round(6).tolist()
    [10.0, 10.5]
    """
    scenario = scenario_of(scenario, "sweep")
    least_time_of_sweep(scenario).demand_allowed()
    from beamsim.analyses.continuation.analysis import continuation as compute

    asked = scenario.sweep is not None and scenario.sweep.convergence == "on"
    with stop_requests(stop):
        return _with_convergence_errors(
            partial(compute, scenario), compute, asked, _ComparedValues(_of_continuation), progress
        )


def coexisting(
    scenario: Source, progress: Progress = None, stop: Stop = never, *, workers: int = 1,
    scheduler: str | None = None, **options: Any,
) -> CoexistingResult:  # fmt: skip
    """Find coexisting motions; compare their peaks with those of a finer model where ``sweep.convergence: on``.

    Parameters
    ----------
    scenario : with a ``sweep`` section of kind coexisting, or what `beamsim.load_scenario` reads.
    progress : called with the fraction done.
    stop : asked between starts and points whether to end; the result then holds those up to there.
    workers, scheduler : processes or a Dask cluster for starts and disturbances, as of `design_study`.
    options : ``known`` and ``each`` as of `design_study`, which do not apply to the finer model.

    Returns
    -------
    CoexistingResult
        With ``convergence`` and ``doubtful`` in its summary, unless it was cut short.

    Raises
    ------
    ScenarioError
        If there are no motions to be found in the scenario.
    NotTrustedError
        If no start settled and no periodic motion was found, or the connection to the cluster is lost.

    Examples
    --------
    >>> import beamsim
    >>> search = {"sweep": {"kind": "coexisting", "at": ["16 Hz"], "starts": {"kind": "phases", "number": 2}}}
    >>> case = beamsim.load_scenario("configs/stops/chain_bumpers.yaml", search)
    >>> beamsim.coexisting(case).summary["motions"][0]["kind"]
    'periodic'
    """
    scenario = scenario_of(scenario, "sweep")
    from beamsim.analyses.coexisting.analysis import coexisting as compute

    asked = scenario.sweep is not None and scenario.sweep.convergence == "on"
    again = partial(compute, workers=workers, scheduler=scheduler)
    of: _ComparedValues[CoexistingResult] = _ComparedValues(_of_continuation)
    with stop_requests(stop):
        return _with_convergence_errors(partial(again, scenario, **options), again, asked, of, progress)


def nnm(
    scenario: Source, progress: Progress = None, compare: Collection[str] = (), stop: Stop = never
) -> NormalModeResult:
    """Follow a nonlinear normal mode, and compare it with a finer model's where ``nnm.convergence: on``.

    Parameters
    ----------
    scenario : with an ``nnm`` section, or what `beamsim.load_scenario` reads.
    progress : called with the fraction done.
    compare : other methods to compare with it: any of `beamsim.analyses.nnm.analysis.COMPARISONS`.
    stop : asked between points whether to end; the result then holds those up to there.

    Returns
    -------
    NormalModeResult
        With ``convergence`` and ``doubtful`` in its summary, unless it was cut short.

    Raises
    ------
    ScenarioError
        If the mode cannot be followed.

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.nnm("configs/modes/chain_cubic.yaml")
    >>> print(f"{result['points']['frequency_hz'].values[-1]:.5f} Hz")
    0.24945 Hz
    """
    scenario = scenario_of(scenario, "nnm")
    from beamsim.analyses.nnm.analysis import nnm as compute

    asked = scenario.nnm is not None and scenario.nnm.convergence == "on"
    with stop_requests(stop):
        return _with_convergence_errors(
            partial(compute, scenario, compare=compare), compute, asked, _ComparedValues(_of_mode), progress
        )


def static(
    scenario: Source, progress: Progress = None, stop: Stop = never, *, builds: SharedBuilds | None = None
) -> StaticResult:  # fmt: skip
    """Find static equilibrium under weight and dead loads: contact forces, gaps left, deflections, reactions.

    It also gives the natural frequencies about the equilibrium, with friction stuck and sliding. The excitation does
    not act.

    Parameters
    ----------
    scenario : any case, or what `beamsim.load_scenario` reads, such as the path of its file.
    progress : called with the fraction done.
    stop : asked before the comparison whether to end.
    builds : keeps matrices that other cases have in common with this one.

    Returns
    -------
    StaticResult
        With ``convergence`` and ``doubtful`` in its summary.

    Raises
    ------
    ScenarioError
        If there is no static equilibrium (nothing holds the structure against its loads), or many.

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.static("configs/structures/resting_beam.yaml")
    >>> result.summary["touching"]
    {'middle': True, 'tip': False}
    """
    scenario = scenario_of(scenario, "static")
    from beamsim.analyses.statics.analysis import static as compute

    with stop_requests(stop):
        return _with_convergence_errors(
            lambda _: compute(scenario, builds),
            lambda case, _: compute(case, builds),
            True,
            _ComparedValues(_of_static),
            progress,
        )


def _with_convergence_errors(
    first: Callable[[Progress], _Result],
    solve: Callable[[Scenario, Progress], _Result],
    compare: bool,
    compared: _ComparedValues[_Result],
    progress: Progress,
) -> _Result:
    """Compute a result and compare it with a finer model, if that is requested and the result is complete.

    Parameters
    ----------
    first : computes the result.
    solve : computes the compared values of another case.
    compare : whether the comparison is requested.
    compared : gives the compared values.
    progress : called with the completed fraction of both computations together.
    """
    share = 0.4 if compare else 1.0  # of the progress
    result = first(part_of(progress, 0.0, share))
    if not compare:
        return with_convergence(result, Convergence(reason=NOT_ASKED))
    if result.outcome.cut_short:
        return result
    if stop_requested():
        return result.interrupted(COMPARISON)
    begin, wall, own = processor_time(), clock.perf_counter(), compared.values(result)
    checked = _convergence(compared, own, result, lambda case: solve(case, part_of(progress, share, 1.0)))
    if stop_requested():
        return result.interrupted(COMPARISON)
    checked = replace(checked, processor_time_s=processor_time() - begin)
    result = with_convergence(result, checked, own)
    return replace(result, wall_time_s=result.wall_time_s + clock.perf_counter() - wall)


def _convergence(
    compared: _ComparedValues[_Result],
    values: Values,
    result: _Result,
    solve: Callable[[Scenario], _Result],
) -> Convergence:
    """The errors of a result's own values, from a finer model."""
    modes = result["modes"]["kept_modes"].item()
    approximated = bool(result.scenario.rings) or result.scenario.has_smooth_laws
    if keeps_all(result["modes"]) and not approximated:
        return Convergence(exact(values))
    try:
        second = solve(finer_case(result.scenario, result["modes"]))
    except ScenarioError as error:
        return Convergence(reason="; ".join(problem.message for problem in error.problems))
    if not second.outcome.trusted:
        return Convergence(reason=f"the finer model is {second.outcome.text}")
    changes = relative_changes([values], [compared.values(second)])
    if compared.cycles is not None:
        changes = largest_errors(changes, compared.cycles(result, second))
    errors = errors_of(changes, result.scenario, keeps_all(second["modes"]) and not result.scenario.has_smooth_laws)
    if compared.lower_bounds is not None:
        errors = largest_errors(errors, compared.lower_bounds(result))
    return Convergence(errors, tuple(unconverged_values(errors, {})), second["modes"]["kept_modes"].item(), modes)


def _frequencies(result: _Result) -> Values:
    modes = result["modes"]
    kept, names = modes["kept_modes"].item(), ("open_frequencies_hz", "closed_frequencies_hz")
    return comparable_values({name: modes[name].values[:kept].tolist() for name in names})


def _of_sweep(result: SweepResult) -> Values:
    """Largest values of all curves; natural frequencies."""
    entries: dict[str, dict[str, float]] = {}
    for curve in result.curves.values():
        for value, name, largest, _ in curve.largest():
            entries.setdefault(value.entry, {})[f"{curve.name} {name}".strip()] = largest / value.scale
    of_model = {"contact_share": result.summary["contact_share"]}
    of_model |= {"gapping_ratio": finite(result.summary.get("gapping_ratio", {}))}
    return comparable_values(of_model | entries) | _frequencies(result)


def _changes_of_cycles(first: SweepResult, second: SweepResult) -> Changes:
    """Relative changes of the cycles that decide on the largest values, and of the shares of all cycles.

    The largest values of two models may agree by chance where their cycles do not.
    """
    changes: dict[str, dict[str, float]] = {}
    for name, one in first.curves.items():
        if (other := second.curves.get(name)) is None:  # interrupted before
            continue
        peaks = {value.entry: of for value, of in peaks_in(other.cycles)}
        for value, of in peaks_in(one.cycles):
            changes.setdefault(value.entry, {}).update(
                (f"{name} {place}".strip(), _change_of_highest(x, peaks[value.entry][place]))
                for place, x in of.items()
                if place in peaks.get(value.entry, {})
            )
        shares = other.cycles.by_label("contact_share")
        changes.setdefault("contact_share", {}).update(
            (f"{name} {place}", _change_of_share(one.weights, x.values, shares[place].values))
            for place, x in one.cycles.by_label("contact_share").items()
        )
    return dict(changes)


def _change_of_highest(first: Floats, second: Floats) -> float:
    """Largest relative change of the `HIGHEST` largest values (C,), compared in descending order."""
    highest, others = (-np.sort(-of[~np.isnan(of)])[:HIGHEST] for of in (first, second))
    scale = max(highest[:1].sum(), others[:1].sum())
    if scale == 0.0:
        return 0.0
    count = int(np.count_nonzero(highest[: others.size] >= NEARLY * highest[0]))
    return float(np.max(np.abs(highest[:count] - others[:count]), initial=0.0) / scale)


def _change_of_share(weights: Floats, first: Floats, second: Floats) -> float:
    """The relative change of a mean of cycles (C,) and two standard errors of it, the cycles being independent."""
    if second.size != first.size:  # ended by chance in another cycle
        return 0.0
    change = weights * (first - second)
    scale = max(float(weights @ first), float(weights @ second))
    return 0.0 if scale == 0.0 else float(abs(change.sum()) + 2.0 * np.sqrt(change @ change)) / scale


def _least_of_level(result: SweepResult) -> Errors:
    """Lower bounds of errors where a level is lowered to meet limits: by how much these limits are exceeded.

    Levels that meet the limits equally well are equivalent, and each model finds another one.
    """
    from beamsim.analyses.sweep.swept_sine import LEVEL_TOLERANCE, values_that_lower_level

    held, least = values_that_lower_level(result.scenario), dict[str, dict[str, float]]()
    for name, curve in result.curves.items():
        if curve.notching is None:
            continue
        excess = max([CLOSE, *(limit.share - 1.0 for limit in curve.notching.limits)])
        for value, of in peaks_in(curve.cycles):
            least.setdefault(value.entry, {}).update(
                (f"{name} {place}".strip(), LEVEL_TOLERANCE if (value.limit, place) in held else excess) for place in of
            )
        least.setdefault("contact_share", {}).update(
            (f"{name} {place}", excess if 0.0 < curve.weights @ x.values < 1.0 else 0.0)
            for place, x in curve.cycles.by_label("contact_share").items()
        )
    return dict(least)


def _of_continuation(result: ContinuationResult) -> Values:
    """Largest displacements with their frequencies by probe, level and period; largest values of all stable motions;
    frequencies."""
    peaks: list[dict[str, Any]] = result.summary.get("peaks", [])  # coexisting motions have none of a curve
    names = [f"{p['probe']} level {p['level']:.6g} period {p['period_multiple']}" for p in peaks]
    displacement = {name: float(p["value_m"]) for name, p in zip(names, peaks, strict=True)}
    entries: dict[str, dict[str, float]] = {"peak_displacement_m": displacement}
    for value, name, largest, _ in largest_in([result["points"]], "parameter", "stable"):
        entries.setdefault(value.entry, {})[name] = largest / value.scale
    frequency = {name: float(p["frequency_hz"]) for name, p in zip(names, peaks, strict=True)}
    entries |= ({"peak_frequency_hz": frequency} if frequency else {}) | _of_special_curves(result)
    return comparable_values(entries) | _frequencies(result)


def _of_special_curves(result: ContinuationResult) -> dict[str, dict[str, float]]:
    """Frequencies and second parameters of curves of special points and of their own special points, by kind."""
    hz, parameter, counts = dict[str, float](), dict[str, float](), Counter[str]()
    for curve in result.summary.get("special_curves", ()):
        if not curve["points"]:
            continue
        counts[curve["kind"]] += 1
        name, of_events = f"{curve['kind']} {counts[curve['kind']]}", Counter[str]()
        hz |= {f"{name} {end}": float(curve[f"{end}_hz"]) for end in ("start", "smallest", "largest")}
        for event in curve["events"]:
            of_events[event["kind"]] += 1
            place = f"{name} {event['kind']} {of_events[event['kind']]}"
            hz[place], parameter[place] = float(event["frequency_hz"]), float(event["parameter"])
    entries = {"special_curve_hz": hz, "special_curve_parameter": parameter}
    return {entry: values for entry, values in entries.items() if values}


def _of_static(result: StaticResult) -> Values:
    """All values at static equilibrium, and natural frequencies; NaN are frequencies of motions that friction holds."""
    compared = (value.entry for value in VALUES if value.entry in result.summary)
    kept, values = result["modes"]["kept_modes"].item(), dict[str, Any]()
    for entry in compared:
        value = result.summary[entry]
        values[entry] = [x for x in value[:kept] if not math.isnan(x)] if isinstance(value, list) else value
    return comparable_values(values)


def _of_mode(result: NormalModeResult) -> Values:
    """Frequencies of the mode at the ends of its backbone and at the points asked for; natural frequencies."""
    s = result.summary
    at = {"start": s["start"], "end": s["end"]}
    at |= {f"{p['quantity']} {p['value']:.6g} branch {p['branch']}": p for p in s.get("requested_points") or ()}
    return {"frequency_hz": {name: float(p["frequency_hz"]) for name, p in at.items()}} | _frequencies(result)
