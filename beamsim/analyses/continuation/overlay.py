"""Swept and stepped sines overlaid on a response curve: computed with it, or taken from stored sweeps."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import count

from beamsim.analyses.continuation.result import ContinuationResult, OverlayCurve
from beamsim.analyses.sweep.analysis import sweep
from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.errors import ScenarioError
from beamsim.outcomes import Progress, Stop, never
from beamsim.scenario import Scenario
from beamsim.scenario.sweep import Continuation, FrequencyPath, SweptSine
from beamsim.typing import not_none, of_kind


def swept_overlay(scenario: Scenario, progress: Progress = None, stop: Stop = never) -> dict[str, OverlayCurve] | None:
    """The swept sine that a continuation's ``overlay`` asks for, at the same levels.

    Parameters
    ----------
    scenario : with an ``overlay`` in its continuation.
    progress : called with the share of the sweep that is done.
    stop : asked between cycles and levels.

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
    result = sweep(scenario.model_copy(update={"sweep": swept, "limits": None}), progress, stop=stop)
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
    return replace(result, overlay=overlay)


def _overlaid(curve: SweepCurve, title: str, source: str) -> OverlayCurve:
    values = {field.name: getattr(curve, field.name) for field in fields(curve)}
    return OverlayCurve(**values, source=source, title=title)
