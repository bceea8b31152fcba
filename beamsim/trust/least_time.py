"""The least time that a computation takes, from what is counted before it starts; what would take too long is refused.

The time for one of what is counted is a lower bound: three to ten times less than was measured with the smallest models
(one mass, no contact) in November 2026. What is longer than allowed by this bound is longer on any present machine.
Contacts, modes, probes and harmonics add to it, so that a computation may take much longer; see its progress.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING

from beamsim.errors import ScenarioError, TooLongError, allowed_hours
from beamsim.scenario import Scenario
from beamsim.scenario.base import count_text
from beamsim.scenario.studies import Reliability
from beamsim.scenario.sweep import SteppedSine, SweptSine

if TYPE_CHECKING:  # a run alone needs no studies
    from beamsim.analyses.studies.plan import StudyPlan
    from beamsim.scenario.studies import VariedParameter

PERIOD_S = 1e-7  # of a run: a period of the highest excitation frequency
CYCLE_S = 5e-6  # of a swept sine
STEADY_S = 1e-3  # a steady motion of a stepped sine, settled and measured
CURVE_S = 5e-3  # a curve of periodic motions at one level
CASE_S = 2e-3  # of a study: its scenario, equations, motion and values

_SEEN_CASES = 20  # of a study that varies what is counted
_COUNTED_IN = ("run", "sweep", "excitation")


@dataclass(frozen=True)
class Count:
    """Number of equal steps of a computation, and the keys of the scenario that set it."""

    number: float
    noun: str
    keys: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.number:,.0f} {self.noun}"


@dataclass(frozen=True)
class LeastTime:
    """Least processor time of a computation: a product of counts, times the least time, s, of one step."""

    counts: tuple[Count, ...]
    unit_s: float

    @property
    def seconds(self) -> float:
        """Least time on one processor, s."""
        return prod(count.number for count in self.counts) * self.unit_s

    def demand_allowed(self, processors: int = 1) -> None:
        """Refuse a computation that takes longer than `beamsim.errors.allowing_hours` allows.

        Parameters
        ----------
        processors : that share the work evenly.

        Raises
        ------
        TooLongError
            With the counts, the time and the keys to change.
        """
        hours = self.seconds / processors / 3600.0
        if hours > allowed_hours.get():
            on = f" on {count_text(processors, 'processor')}" if processors > 1 else ""
            counts = " x ".join(map(str, self.counts))
            keys = [key for count in self.counts for key in count.keys if count.number > 1]
            estimate = f"{counts}, at least {1e3 * self.unit_s:g} ms each{on}, would take at least"
            raise TooLongError(estimate, hours, keys)


def least_time_of_run(scenario: Scenario) -> LeastTime:
    """Least time of a run in a study, by the periods of its excitation; a free motion counts as one period.

    A run alone has at most 25 million periods, as it has at most 50 million samples.
    """
    run, hz = scenario.run, scenario.excitation.highest_frequency_hz
    periods = 1.0 if run is None else max(run.duration * hz, 1.0)
    return LeastTime((Count(periods, "periods of the excitation", ("run.duration",)),), PERIOD_S)


def least_time_of_sweep(scenario: Scenario) -> LeastTime:
    """Least time of a swept or stepped sine, or of a continuation."""
    sweep = scenario.sweep
    levels = Count(max(1, len(getattr(sweep, "levels", ()))), "levels", ("sweep.levels",))
    if not isinstance(sweep, SweptSine | SteppedSine):
        return LeastTime((levels,), CURVE_S)
    directions = 2 if sweep.direction == "both" else 1
    if isinstance(sweep, SteppedSine):
        return LeastTime((levels, Count(directions * sweep.points, "frequencies", ("sweep.points",))), STEADY_S)
    return LeastTime((levels, Count(sweep.cycles, "cycles", ("sweep.rate",))), CYCLE_S)


def least_time_of_study(plan: StudyPlan, solved_cases: int = 0) -> LeastTime:
    """Least time of a study; a search or a study of reliability may end after its first cases.

    Parameters
    ----------
    plan : of the study.
    solved_cases : number of cases that an earlier command has solved.
    """
    vary = plan.scenario.study
    each, number = plan.study.realisations.count, len(plan.cases)
    section = "vary" if vary is None else vary.section
    keys: tuple[str, ...] = ("draws",) if vary is None else (f"{section}.parameters",)
    if isinstance(vary, Reliability):
        number = 1 if vary.method == "form" else min(vary.samples, vary.most_cases)
        keys = ("vary.samples",)
    elif plan.searches:
        number = each
    elif hasattr(vary, "samples"):
        keys = ("vary.samples",)
    if each > 1:
        keys = (*keys, f"{section}.tolerances.samples")
    cases, case = Count(max(number - solved_cases, 0), "cases", keys), _least_of_cases(plan)
    if case is None or case.seconds < CASE_S:
        return LeastTime((cases,), CASE_S)
    return LeastTime((cases, *case.counts), case.unit_s)


def _least_of_cases(plan: StudyPlan) -> LeastTime | None:
    """Least time of all cases, estimated from some if their counts differ; None if unknown."""
    if plan.study.analysis == "static":
        return None
    least = least_time_of_run if plan.study.analysis == "run" else least_time_of_sweep
    tolerated = [parameter.parameter for parameter in plan.study.realisations.parameters]
    if not any(_varies_counts(parameter) for parameter in (*plan.study.parameters, *tolerated)):
        return least(plan.study.case)
    if plan.searches:
        return None
    found = []
    for case in plan.cases[:: max(1, len(plan.cases) // _SEEN_CASES)]:
        try:
            found.append(least(plan.study.scenario(case)))
        except ScenarioError:  # costs nothing
            return None
    return min(found, key=lambda each: each.seconds)


def _varies_counts(parameter: VariedParameter) -> bool:
    """Whether a varied number may change the counts; levels and seeds do not."""
    return any(path[0] in _COUNTED_IN and path[-1] not in ("level", "seed") for path in parameter.dependent_places)
