"""Comparison of a run with the reference integrator: the same equations, integrated in time by SciPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.analyses.run.motion import RunMotion, output_times, steps_in_time
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.run.stepped_motion import stepped_motion_of
from beamsim.analyses.run.summary import values_of_motion
from beamsim.errors import Problem, ScenarioError
from beamsim.labelled import Dataset
from beamsim.outcomes import Outcome, OutcomeKind, never
from beamsim.results.result import ALLOWED_ERROR
from beamsim.results.values import DISPLACEMENT, VALUES
from beamsim.system.build import build_system
from beamsim.trust.convergence import ContactEvents, divergence, places
from beamsim.typing import not_none

RTOL = 1e-8  # by default
ATOL_OF_RTOL = 1e-4  # absolute tolerance, m sqrt(kg), for a relative one of 1
COMPARED = (  # entry of the summary, its name in the comparison and its unit, empty where each place has its own
    *((value.entry, value.label, value.summary_entry().unit) for value in VALUES if value.label),
    ("contacts", "contacts", "1"),
)


def tolerance_of(text: str) -> float:
    """The relative tolerance in ``reference`` (the default) or ``reference:1e-10``.

    Raises
    ------
    ScenarioError
        If it is not the reference integrator that is named, or the tolerance is not a number between 0 and 1.
    """
    method, _, number = text.strip().lower().partition(":")
    remedy = "write reference, or reference:1e-10 with the relative tolerance"
    if method != "reference":
        raise ScenarioError(Problem("--against", f"= {text} is not the reference integrator", remedy))
    try:
        rtol = float(number) if number else RTOL
    except ValueError:
        rtol = np.nan
    if not 0.0 < rtol < 1.0:
        raise ScenarioError(Problem("--against", f"= {text}: {number!r} is no relative tolerance", remedy))
    return rtol


def compare_with_reference(result: RunResult, rtol: float = RTOL, stop: Callable[[], bool] = never) -> RunResult:
    """Add a comparison with the reference integrator to the summary of a run.

    If one of the two ends early there is a warning instead. The result is not reliable if its displacements differ from
    those of the reference; a warning states the time from which the two have different contacts.

    Parameters
    ----------
    result : of a run.
    rtol : relative tolerance of the integration. The absolute one of modal displacements and velocities falls with it,
        to `ATOL_OF_RTOL` of it at most: an error in the displacement of a mode counts in accelerations by the square
        of its angular frequency, and high modes move so little that the absolute tolerance alone limits their errors.
    stop : called after every step; returns whether to omit the comparison, which marks the result as interrupted.

    Returns
    -------
    RunResult : the same result with ``summary["against"]``.
    """
    if result.outcome.ended_early:
        return _with_warning(result, f"the run is {result.status}")
    system = build_system(result.scenario)
    settings = not_none(result.scenario.run)
    # if the run itself is integrated in time, use a method of another family
    integrator = "LSODA" if steps_in_time(system, settings) else "DOP853"
    stepped = settings.model_copy(
        update={
            "method": "reference", "integrator": integrator, "rtol": rtol,
            "atol": min(ATOL_OF_RTOL * rtol, settings.atol),
        }
    )  # fmt: skip
    motion = stepped_motion_of(system, stepped, output_times(result.scenario), None, stop)
    if motion.outcome.interrupted:
        return result.interrupted("the comparison with the reference integrator")
    if motion.outcome.ended_early:
        return _with_warning(result, f"the reference integrator is {motion.outcome.text}")
    compared = _comparison_summary(result, motion)
    return _with_comparison(replace(result, summary={**result.summary, "against": compared}), compared)


def _with_comparison(result: RunResult, comparison: Mapping[str, Any]) -> RunResult:
    """The result with its outcome and warnings after the comparison."""
    until, outcome, warnings = comparison["agrees_until_s"], result.outcome, result.warnings
    if (difference := comparison["largest_state_difference"]) > ALLOWED_ERROR:
        apart = f"displacements differ by {100 * difference:.2g} % from the {comparison['method']}"
        remedy = (
            "compare again with a smaller tolerance, reference:1e-10; a difference that remains is an error of the run"
        )
        outcome = outcome.copy_with(Outcome.of(OutcomeKind.UNTRUSTED, "differs_from_reference", apart, remedy=remedy))
    if until < result["histories"]["time"].values[-1]:
        warnings += (
            f"--against: from {until:.4g} s on, run and reference have different contacts; compare again with a "
            "smaller tolerance, reference:1e-10: with a sensitive motion they agree longer, with an error they do not",
        )
    return replace(result, warnings=warnings).with_outcome(outcome)


def _with_warning(result: RunResult, reason: str) -> RunResult:
    """The result with a warning in place of a comparison."""
    return replace(result, warnings=(*result.warnings, f"no comparison with the reference integrator: {reason}"))


def _comparison_summary(result: RunResult, motion: RunMotion) -> dict[str, Any]:
    """The comparison for the summary: by quantity and place the value of the run and of the reference."""
    exact, stepped = result.summary, values_of_motion(motion)
    histories, end = not_none(motion.histories), motion.source_motion.end
    ours, theirs = _events(result["events"], end), _events(motion.events, end)
    diverged = min(divergence(ours, theirs), end)
    count = int(np.searchsorted(result["histories"]["time"].values, diverged, side="right"))
    difference = 0.0
    for i, displacement in enumerate(result["histories"].by_label("displacement").values()):
        known = displacement.values[:count]
        apart = np.abs(histories.of(DISPLACEMENT)[: known.size, i] - known).max(initial=0.0)
        difference = max(difference, float(apart) / max(float(np.abs(displacement.values).max()), 1e-300))
    values: dict[str, dict[str, Any]] = {}
    for name, label, unit in COMPARED:
        if name in exact and name in stepped:
            both = zip(places(exact[name]), places(stepped[name]), strict=True)
            values[label.replace(" ", "_")] = {
                place: {"exact": float(value), "stepped": float(other), "unit": unit or exact["output_unit"][place]}
                for (place, value), (_, other) in both
            }
    return {
        "method": motion.method,
        "evaluations": motion.work.evaluations,
        "agrees_until_s": diverged,
        "largest_state_difference": difference,
        "largest_time_difference_s": _largest_time_difference(ours.until(diverged), theirs.until(diverged)),
        "processor_time_s": motion.work.processor_time_s,
        "exact_processor_time_s": exact["processor_time_s"],
        "values": values,
    }


def _events(events: Dataset, end: float) -> ContactEvents:
    """The events of a run; a phase is whether a snubber is closed."""
    time, snubber, closing = (events[name].values for name in ("time", "snubber", "closing"))
    return ContactEvents(end, time, snubber, closing.astype(np.int64))


def _largest_time_difference(events: ContactEvents, reference: ContactEvents) -> float:
    """Largest difference of the times of common events, s."""
    pairs = [
        (events.time[events.contact == k], reference.time[reference.contact == k]) for k in np.unique(events.contact)
    ]
    common = [(a[: min(a.size, b.size)], b[: min(a.size, b.size)]) for a, b in pairs]
    return max((float(np.abs(a - b).max(initial=0.0)) for a, b in common), default=0.0)
