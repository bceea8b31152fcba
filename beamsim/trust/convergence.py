"""How much every value changes when the case is solved again with a finer model.

The finer model has 1.5 times the modes and, where a body has a mesh, twice the elements. A value that changes by more
than `ALLOWED_CHANGE` is doubtful: it belongs to the model and not to the structure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from beamsim.analyses.result import Result
from beamsim.analyses.run.result import ALLOWED_CHANGE
from beamsim.errors import ScenarioError
from beamsim.fields import figure_in_words
from beamsim.outcomes import Outcome, OutcomeKind, listed
from beamsim.scenario import Scenario
from beamsim.trust.divergence import DivergenceTimes
from beamsim.trust.values import Changes, named

WORTHLESS = 0.5  # relative change of the displacements beyond which the default model is not to be used
MORE_MODES = 1.5
COMPARISON = "the comparison with a finer model"

_Result = TypeVar("_Result", bound="Result")
_Solved = TypeVar("_Solved")


@dataclass(frozen=True)
class Convergence:
    """Relative changes of the values of a result with a finer model."""

    changes: Changes = field(default_factory=dict)
    doubtful: tuple[str, ...] = ()  # ``entry.place`` of those that change by more than `ALLOWED_CHANGE`
    modes: int = 0  # of the finer model; 0 where the first leaves out nothing
    first_modes: int = 0  # of the first, where it is compared
    diverged_s: float = math.inf  # time at which the sequences of contacts of a run diverge
    after: tuple[str, ...] = ()  # ``entry.place`` of those that depend on the motion after that
    sensitivity: DivergenceTimes = field(default_factory=DivergenceTimes)
    processor_time_s: float = 0.0
    reason: str = ""  # why there is no comparison
    lines: Mapping[tuple[str, str], tuple[float, ...]] = field(default_factory=dict)  # of each line of each spectrum
    compared_s: float = math.inf  # length of the first part that is compared, where a motion is not kept as a whole

    @property
    def largest_displacement_change(self) -> float:
        """Largest change of a peak displacement."""
        return max((x for key, x in named(self.changes) if key.startswith("peak_displacement_m")), default=0.0)

    def summary(self) -> dict[str, Any]:
        """Entries of the summary."""

        def finite(time: float) -> float | None:
            return time if math.isfinite(time) else None

        model: dict[str, Any] = {
            "modes": self.modes, "first_modes": self.first_modes, "sequences_part_s": finite(self.diverged_s),
            "disturbance_parts_s": finite(self.sensitivity.small_s),
            "round_off_parts_s": finite(self.sensitivity.round_off_s),
            "processor_time_s": self.processor_time_s, "reason": self.reason,
        }  # fmt: skip
        if math.isfinite(self.compared_s):
            model["compared_s"] = self.compared_s
        marks = {"doubtful": list(self.doubtful), "after_parting": list(self.after)}
        return {"convergence": self.changes, **marks, "convergence_model": model}


def keeps_all(scenario: Scenario, modes: int) -> bool:
    """Whether a model with so many modes leaves out nothing of the bodies, none of which has a mesh of its own."""
    counts = [body.mode_count for body in scenario.all_bodies.values()]
    return None not in counts and modes >= sum(count for count in counts if count is not None)


def finer(scenario: Scenario, modes: int) -> Scenario:
    """The case with 1.5 times so many modes and twice the elements of every mesh."""
    return scenario.refined(math.ceil(MORE_MODES * modes))


def solved_again(
    solve: Callable[[Scenario], _Solved], scenario: Scenario, modes: int, stop: Callable[[], bool]
) -> _Solved | Convergence:
    """The solution of a finer model, or why there is none.

    Parameters
    ----------
    solve : solves a case.
    scenario : the case whose model has so many modes.
    modes : of that model.
    stop : asked after it whether it was interrupted.
    """
    try:
        second = solve(finer(scenario, modes))
    except ScenarioError as error:
        return Convergence(reason="; ".join(problem.message for problem in error.problems))
    return Convergence(reason="interrupted") if stop() else second


def with_convergence(result: _Result, checked: Convergence) -> _Result:
    """A result whose summary and outcome say which of its values do not converge."""
    summary = result.summary | checked.summary()
    result = replace(result, summary={e.name: summary[e.name] for e in result.SUMMARY if e.name in summary})
    outcome = _outcome(result, checked)
    summary = {**result.summary, "status": outcome.text}
    return replace(result, outcome=outcome, summary=summary)


def _outcome(result: Result, checked: Convergence) -> Outcome:
    """How the computation ended, with the doubts; first what was wrong before them."""
    doubts = [_diverged(checked)] if checked.after else []
    if checked.doubtful:
        doubts = [_doubtful(result, checked, doubts)]
    if not doubts or not result.outcome.complete:
        return result.outcome.but(*doubts)
    return doubts[0].but(result.outcome) if result.outcome.message else doubts[0]


def _doubtful(result: Result, checked: Convergence, parts: Sequence[Outcome]) -> Outcome:
    """Which values do not converge, the worst first, and what helps."""
    sizes = {key: change for key, change in named(checked.changes) if key in checked.doubtful}
    worst = sorted(sizes, key=lambda key: -sizes[key])
    automatic = result.scenario.reduction is None and checked.diverged_s == math.inf
    worthless = automatic and checked.largest_displacement_change > WORTHLESS
    finer = "with 1.5 times the modes" + (" and twice the elements of every mesh" if result.scenario.has_mesh else "")
    figures = tuple(f"{figure_in_words(key)} by {100 * sizes[key]:.2g} %" for key in worst)
    remedy = _remedy(result, checked.doubtful)
    if worthless:
        sentence = f"{finer} values change, displacements among them: {listed(figures)}"
        return Outcome.of(
            OutcomeKind.UNTRUSTED, "figures_worthless", sentence, *parts, remedy=remedy, figures=figures
        )  # fmt: skip
    sentence = f"values change by more than {100 * ALLOWED_CHANGE:g} % {finer}: {listed(figures)}"
    return Outcome.of(OutcomeKind.COMPLETE, "figures_doubtful", sentence, *parts, remedy=remedy, figures=figures)


def _diverged(checked: Convergence) -> Outcome:
    """Which values depend on the motion after the sequences of contacts diverge, and why they do."""
    times, time = checked.sensitivity, checked.diverged_s
    figures = tuple(dict.fromkeys(figure_in_words(x.partition(".")[0]) for x in checked.after))
    if not times.sensitive:
        return Outcome.of(
            OutcomeKind.COMPLETE, "contacts_diverge",
            f"the finer model, stepped in time too, has other contacts from {time:.4g} s on: {listed(figures)} depend "
            "on what follows",
            remedy="lower run.rtol, keep more modes (reduction.modes), or take means of a longer run",
            time=time, figures=figures,
        )  # fmt: skip
    sentence = (
        f"the motion is so sensitive that from {time:.4g} s on it is one of many: {listed(figures)} depend on what "
        "follows"
    )
    if math.isfinite(times.small_s):
        sentence += f"; a change of the stiffness by 1e-9 of itself gives other contacts from {times.small_s:.4g} s on"
    if math.isfinite(times.round_off_s):
        sentence += f", round-off from {times.round_off_s:.4g} s on"
    return Outcome.of(
        OutcomeKind.COMPLETE, "motion_sensitive", sentence,
        remedy="take means of a longer run (rms, contact share, run.impacts), or the spread of peaks over several "
        "cases (vary)",
        time=time, figures=figures,
    )  # fmt: skip


def _remedy(result: Result, keys: Sequence[str]) -> str:
    """What makes the doubtful values converge."""
    accelerations = [key for key in keys if key.startswith("peak_acceleration")]
    remedies = []
    if len(accelerations) < len(keys):
        remedies.append("raise reduction.modes" + (" and the number of elements" if result.scenario.has_mesh else ""))
    if accelerations:
        run = result.scenario.run
        unfiltered = result.scenario.sweep is None and run is not None and run.low_pass is None
        band = "give the band of the accelerometer (run.low_pass: 2 kHz)" if unfiltered else ""
        dashpot = any(located.item.damping is not None for located in result.scenario.located_snubbers)
        contact = (
            "give the structure a point mass at the contact, or leave out the contact's dashpot" if dashpot else ""
        )
        remedies.append(f"for accelerations {', '.join(filter(None, (band, contact))) or 'raise reduction.modes'}")
    return "; ".join(remedies)
