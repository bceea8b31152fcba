"""One case of a design study, solved where it is sent: from values to responses.

A case travels as plain data (the resolved scenario as a mapping, and what to replace in it), so that any
worker, on this machine or another, computes the same numbers from it.
"""

from __future__ import annotations

import copy
import math
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from beamsim.analyses.designs.result import CaseOutcome
from beamsim.errors import BeamsimError, Problem, ScenarioError
from beamsim.outcomes import Outcome, OutcomeCode

if TYPE_CHECKING:
    from beamsim.analyses.run.result import RunResult
    from beamsim.analyses.sweep.result import SweepResult
    from beamsim.scenario import Scenario

MODES_KEPT = 6
STANDARD_GRAVITY = 9.80665  # m/s^2

Place = tuple[str | int, ...]
Value = float | str
Responses = dict[str, float | list[float]]

QUANTITIES: dict[str, tuple[str, str]] = {
    "peak_displacement": ("m", "largest displacement, relative to the base"),
    "min_displacement": ("m", "lowest displacement, relative to the base"),
    "max_displacement": ("m", "highest displacement, relative to the base"),
    "peak_acceleration": ("m/s^2", "largest absolute acceleration"),
    "peak_force": ("N", "largest contact force"),
    "contact_share": ("1", "share of the time in contact"),
    "contacts": ("1", "number of closings"),
    "largest_gap": ("m", "largest opening between structure and snubber"),
    "static_force": ("N", "contact force at static equilibrium"),
    "bending_stress": ("Pa", "largest bending stress"),
    "bending_stress_position": ("m", "where the bending stress is largest"),
    "open_frequencies_hz": ("Hz", "natural frequencies with every contact open"),
    "closed_frequencies_hz": ("Hz", "natural frequencies with every contact closed"),
    "bilinear_frequency_hz": ("Hz", "2 f F / (f + F) of the first open (f) and closed (F) frequency"),
    "energy_error": ("1", "energy balance error"),
    "resonance_frequency": ("Hz", "frequency of the largest response"),
}
"""Unit and long name of a response, by the last part of its name."""


@dataclass(frozen=True)
class CaseTask:
    """What a worker needs."""

    index: int
    analysis: str
    base: Mapping[str, Any]  # the scenario
    places: tuple[tuple[Place, ...], ...]  # of each parameter
    values: tuple[Value, ...]  # of each parameter


@dataclass(frozen=True)
class Analysis:
    """How one case is solved."""

    solve: Callable[[Scenario], tuple[Responses, Outcome]]  # responses, and how the analysis ended
    rehearse: Callable[[Scenario], object]  # a short case that compiles what a long one needs


def describe(name: str) -> tuple[str, str]:
    """Unit and long name of a response."""
    quantity = name.rpartition("/")[2]
    return QUANTITIES.get(quantity, ("1", quantity.replace("_", " ")))


def analysis_of(scenario: Scenario) -> str:
    """What is done with each case: its sweep, else its run."""
    kind = "run" if scenario.sweep is None else str(scenario.sweep.kind)
    if kind not in ANALYSES:
        raise ScenarioError(
            Problem("sweep.kind", f"= {kind} cannot be combined with vary", f"use one of {', '.join(ANALYSES)}")
        )
    if kind == "run" and scenario.run is None:
        raise ScenarioError(Problem("run", "is missing", "add for example `run: {duration: 1 s}`: every case is a run"))
    return kind


def case_scenario(task: CaseTask) -> Scenario:
    """The scenario of a case, checked like any other.

    Raises
    ------
    ScenarioError
        Where these values together are no scenario.
    """
    from beamsim.scenario import load_scenario

    data = copy.deepcopy(dict(task.base))
    for places, value in zip(task.places, task.values, strict=True):
        for place in places:
            owner: Any = data
            for part in place[:-1]:
                owner = owner[part]
            owner[place[-1]] = value
    return load_scenario(data)


def solve_case(task: CaseTask) -> CaseOutcome:
    """Solve one case; what goes wrong is part of the outcome, so that the other cases go on."""
    begin = clock.process_time()
    try:
        values, outcome = ANALYSES[task.analysis].solve(case_scenario(task))
    except BeamsimError as error:
        values, outcome = {}, Outcome.of(OutcomeCode.FAILED, reason="; ".join(str(error).splitlines()))
    except (ArithmeticError, ValueError, RuntimeError) as error:
        reason = f"internal error ({type(error).__name__}: {error})"
        values, outcome = {}, Outcome.of(OutcomeCode.FAILED, reason=reason)
    return CaseOutcome(task.index, values if outcome.complete else {}, outcome, clock.process_time() - begin)


def warm_up(task: CaseTask | None) -> None:
    """Import all that a case needs and compile it (or read what was compiled before)."""
    import beamsim.analyses.run.analysis
    import beamsim.scenario  # noqa: F401

    if task is not None:
        try:
            ANALYSES[task.analysis].rehearse(case_scenario(task))
        except BeamsimError:
            return  # the case itself will say so


def run_responses(result: RunResult) -> Responses:
    """Responses of a run, from its summary."""
    s = result.summary
    values: Responses = {}
    for name in result.probes:
        for quantity in ("peak_displacement", "min_displacement", "max_displacement"):
            values[f"probes/{name}/{quantity}"] = s[f"{quantity}_m"][name]
        values[f"probes/{name}/peak_acceleration"] = s["peak_acceleration_g"][name] * STANDARD_GRAVITY
    for name in result.snubbers:
        values[f"snubbers/{name}/peak_force"] = s["peak_force_n"][name]
        values[f"snubbers/{name}/contact_share"] = s["contact_share"][name]
        values[f"snubbers/{name}/contacts"] = float(s["contacts"][name])
        values[f"snubbers/{name}/largest_gap"] = s["largest_gap_m"][name]
        values[f"snubbers/{name}/static_force"] = s["static_force_n"][name]
    if "largest_bending_stress_pa" in s:
        values["bending_stress"] = s["largest_bending_stress_pa"]
        values["bending_stress_position"] = s["largest_bending_stress_position_m"]
    values |= frequency_responses(s["open_frequencies_hz"], s["closed_frequencies_hz"], bool(result.snubbers))
    values["energy_error"] = s["energy_error"]
    return values


def sweep_responses(result: SweepResult) -> Responses:
    """Responses of a sweep: of every curve (direction and level) the largest values, and where they are."""
    import numpy as np

    values: Responses = {}
    for curve in result.curves.values():
        for name, envelope in curve.displacement.items():
            highest = int(np.argmax(envelope.peak))
            values[f"{curve.name}/probes/{name}/peak_displacement"] = float(envelope.peak[highest])
            values[f"{curve.name}/probes/{name}/resonance_frequency"] = float(curve.frequency_hz[highest])
        for name, envelope in curve.acceleration.items():
            values[f"{curve.name}/probes/{name}/peak_acceleration"] = float(envelope.peak.max())
        for name, envelope in curve.force.items():
            values[f"{curve.name}/snubbers/{name}/peak_force"] = float(envelope.peak.max())
        for name, share in curve.contact_share.items():
            values[f"{curve.name}/snubbers/{name}/contact_share"] = float(np.mean(share))
        for name, reached in curve.limited.items():
            quantity, _, snubber = name.partition(" ")
            place = f"snubbers/{snubber}/largest_gap" if quantity == "gap" else quantity
            values[f"{curve.name}/{place}"] = float(reached.max())
        for name, count in curve.contacts.items():
            values[f"{curve.name}/snubbers/{name}/contacts"] = float(np.sum(count))
    modes = result.modes
    opened, closed = modes.open_frequencies_hz.tolist(), modes.closed_frequencies_hz.tolist()
    return values | frequency_responses(opened, closed, bool(result.scenario.all_snubbers))


def frequency_responses(opened: list[float], closed: list[float], snubbers: bool) -> Responses:
    """The first natural frequencies, and the bilinear one of the first pair."""
    values: Responses = {"open_frequencies_hz": _first(opened)}
    if snubbers:
        values["closed_frequencies_hz"] = _first(closed)
        both = opened[0] + closed[0]
        values["bilinear_frequency_hz"] = 2.0 * opened[0] * closed[0] / both if both else math.nan
    return values


def _first(frequencies: list[float]) -> list[float]:
    kept = [float(f) for f in frequencies[:MODES_KEPT]]
    return kept + [math.nan] * (MODES_KEPT - len(kept))


def _solve_run(scenario: Scenario) -> tuple[Responses, Outcome]:
    from beamsim.analyses.run.analysis import run

    result = run(scenario)
    return run_responses(result), result.outcome


def _rehearse_run(scenario: Scenario) -> object:
    from beamsim.analyses.run.analysis import run
    from beamsim.scenario import SpectrumSettings

    settings = scenario.run
    assert settings is not None
    short = min(settings.duration, max(1e-3 * settings.duration, 50.0 / settings.output_rate))
    settings = settings.model_copy(update={"duration": short, "spectrum": SpectrumSettings()})
    return run(scenario.model_copy(update={"run": settings}))


def _solve_sweep(scenario: Scenario) -> tuple[Responses, Outcome]:
    from beamsim.analyses.sweep.analysis import sweep

    result = sweep(scenario)
    return sweep_responses(result), result.outcome


def _rehearse_sweep(scenario: Scenario) -> object:
    from beamsim.analyses.sweep.analysis import sweep
    from beamsim.scenario.sweep import SteppedSine, SweptSine

    settings = scenario.sweep
    assert isinstance(settings, (SweptSine, SteppedSine))
    change: dict[str, object] = {"to": 1.01 * settings.from_, "levels": settings.levels[:1], "direction": "up"}
    if settings.kind == "stepped":
        change["points"] = 2
    return sweep(scenario.model_copy(update={"sweep": settings.model_copy(update=change)}))


def _solve_response(scenario: Scenario) -> tuple[Responses, Outcome]:
    from beamsim.analyses.designs.response_cases import solve_response

    return solve_response(scenario)


def _rehearse_response(scenario: Scenario) -> object:
    from beamsim.analyses.designs.response_cases import rehearse_response

    return rehearse_response(scenario)


ANALYSES: dict[str, Analysis] = {
    "run": Analysis(_solve_run, _rehearse_run),
    "swept_sine": Analysis(_solve_sweep, _rehearse_sweep),
    "stepped": Analysis(_solve_sweep, _rehearse_sweep),
    "continuation": Analysis(_solve_response, _rehearse_response),
}
"""What can be done with a case, by name: a run, or the kind of sweep."""
