"""Sweeps, continuations and modes as the commands and the package call them: with what says how sure their values are.

A swept or stepped sine is compared with a finer model unless that is switched off, a continuation and a nonlinear
normal mode where it is asked for. Without a comparison the summary says so. Runs are in `beamsim.trust.runs`.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from beamsim.errors import ScenarioError
from beamsim.flow.compiled import processor_time
from beamsim.outcomes import Progress, Stop, asked_by, asked_to_stop, never, part_of
from beamsim.responses.gapping import finite
from beamsim.results.values import largest_in
from beamsim.scenario import Scenario, Source, scenario_of
from beamsim.trust.convergence import (
    COMPARISON,
    NOT_ASKED,
    Convergence,
    Values,
    compared,
    doubtful,
    errors_of,
    exact,
    finer_modes,
    keeps_all,
    relative_changes,
    with_convergence,
)
from beamsim.trust.least_time import least_time_of_sweep

if TYPE_CHECKING:
    from beamsim.analyses.coexisting.result import CoexistingResult
    from beamsim.analyses.continuation.result import ContinuationResult
    from beamsim.analyses.nnm.result import NormalModeResult
    from beamsim.analyses.sweep.result import SweepResult


_Result = TypeVar("_Result", "CoexistingResult", "ContinuationResult", "NormalModeResult", "SweepResult")


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
    """
    scenario = scenario_of(scenario, "sweep")
    least_time_of_sweep(scenario).demand_allowed()
    from beamsim.analyses.sweep.analysis import sweep as compute

    asked = scenario.sweep is not None and scenario.sweep.convergence != "off"

    def first(done: Progress) -> SweepResult:
        result = compute(scenario, done, save=save, resume=resume)
        if save is not None and asked and not result.outcome.cut_short:
            save(result)
        return result

    with asked_by(stop):
        return _with_convergence_errors(first, compute, asked, _of_sweep, progress)


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
    """
    scenario = scenario_of(scenario, "sweep")
    least_time_of_sweep(scenario).demand_allowed()
    from beamsim.analyses.continuation.analysis import continuation as compute

    asked = scenario.sweep is not None and scenario.sweep.convergence == "on"
    with asked_by(stop):
        return _with_convergence_errors(partial(compute, scenario), compute, asked, _of_continuation, progress)


def coexisting(
    scenario: Source, progress: Progress = None, stop: Stop = never, *, workers: int = 1,
    scheduler: str | None = None, **kept: Any,
) -> CoexistingResult:  # fmt: skip
    """Find coexisting motions; compare their peaks with those of a finer model where ``sweep.convergence: on``.

    Parameters
    ----------
    scenario : with a ``sweep`` section of kind coexisting, or what `beamsim.load_scenario` reads.
    progress : called with the fraction done.
    stop : asked between starts and points whether to end; the result then holds those up to there.
    workers, scheduler, kept : as of `beamsim.analyses.coexisting.analysis.coexisting`; ``known`` and ``each`` are not
        for the finer model.

    Returns
    -------
    CoexistingResult
        With ``convergence`` and ``doubtful`` in its summary, unless it was cut short.

    Raises
    ------
    ScenarioError
        If there are no motions to be found in the scenario.
    """
    scenario = scenario_of(scenario, "sweep")
    from beamsim.analyses.coexisting.analysis import coexisting as compute

    asked = scenario.sweep is not None and scenario.sweep.convergence == "on"
    again = partial(compute, workers=workers, scheduler=scheduler)
    with asked_by(stop):
        return _with_convergence_errors(partial(again, scenario, **kept), again, asked, _of_continuation, progress)


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
    """
    scenario = scenario_of(scenario, "nnm")
    from beamsim.analyses.nnm.analysis import nnm as compute

    asked = scenario.nnm is not None and scenario.nnm.convergence == "on"
    with asked_by(stop):
        return _with_convergence_errors(partial(compute, scenario, compare=compare), compute, asked, _of_mode, progress)


def _with_convergence_errors(
    first: Callable[[Progress], _Result],
    again: Callable[[Scenario, Progress], _Result],
    asked: bool,
    values: Callable[[_Result], Values],
    progress: Progress,
) -> _Result:
    """A result with its comparison, where it is asked for and nothing is missing of the result.

    Parameters
    ----------
    first : computes the result.
    again : the same of another case, without what is not compared.
    asked : whether the comparison is asked for.
    values : of a result, which are compared.
    progress : called with the fraction of both that is done.
    """
    share = 0.4 if asked else 1.0  # of the progress
    result = first(part_of(progress, 0.0, share))
    if not asked:
        return with_convergence(result, Convergence(reason=NOT_ASKED))
    if result.outcome.cut_short:
        return result
    if asked_to_stop():
        return result.interrupted(COMPARISON)
    begin, wall, own = processor_time(), clock.perf_counter(), values(result)
    checked = _convergence(values, own, result, lambda case: again(case, part_of(progress, share, 1.0)))
    if asked_to_stop():
        return result.interrupted(COMPARISON)
    checked = replace(checked, processor_time_s=processor_time() - begin)
    result = with_convergence(result, checked, own)
    return replace(result, wall_time_s=result.wall_time_s + clock.perf_counter() - wall)


def _convergence(
    values: Callable[[_Result], Values],
    own: Values,
    result: _Result,
    solve: Callable[[Scenario], _Result],
) -> Convergence:
    """The errors of a result's own values, from a finer model."""
    modes = result["modes"]["kept_modes"].item()
    if keeps_all(result["modes"]):
        return Convergence(exact(own))
    try:
        second = solve(result.scenario.refined(finer_modes(result["modes"])))
    except ScenarioError as error:
        return Convergence(reason="; ".join(problem.message for problem in error.problems))
    if not second.outcome.trusted:
        return Convergence(reason=f"the finer model is {second.outcome.text}")
    errors = errors_of(relative_changes([own], [values(second)]), result.scenario, keeps_all(second["modes"]))
    return Convergence(errors, tuple(doubtful(errors, {})), second["modes"]["kept_modes"].item(), modes)


def _frequencies(result: _Result) -> Values:
    modes = result["modes"]
    kept, names = modes["kept_modes"].item(), ("open_frequencies_hz", "closed_frequencies_hz")
    return compared({name: modes[name].values[:kept].tolist() for name in names})


def _of_sweep(result: SweepResult) -> Values:
    """Largest values of all curves; natural frequencies."""
    entries: dict[str, dict[str, float]] = {}
    for curve in result.curves.values():
        for value, name, largest, _ in curve.largest():
            entries.setdefault(value.entry, {})[f"{curve.name} {name}".strip()] = largest / value.scale
    of_model = {"contact_share": result.summary["contact_share"]}
    of_model |= {"gapping_ratio": finite(result.summary.get("gapping_ratio", {}))}
    return compared(of_model | entries) | _frequencies(result)


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
    return compared(entries | ({"peak_frequency_hz": frequency} if frequency else {})) | _frequencies(result)


def _of_mode(result: NormalModeResult) -> Values:
    """Frequencies of the mode at the ends of its backbone and at the points asked for; natural frequencies."""
    s = result.summary
    at = {"start": s["start"], "end": s["end"]}
    at |= {f"{p['quantity']} {p['value']:.6g} branch {p['branch']}": p for p in s.get("requested_points") or ()}
    return {"frequency_hz": {name: float(p["frequency_hz"]) for name, p in at.items()}} | _frequencies(result)
