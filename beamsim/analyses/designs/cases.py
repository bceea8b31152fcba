"""Cases of a study, solved in batches by workers that stay: what plain studies, searches and reliability ask.

Of runs in closed form only the figures that are asked for are computed: no histories, spectra or shapes.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from functools import cached_property
from typing import Any, Self

import numpy as np

from beamsim.analyses.designs.plan import Case, Study
from beamsim.analyses.designs.responses import Responses, entries_of, means, responses_of_result, run_responses
from beamsim.analyses.designs.result import CaseOutcome
from beamsim.analyses.gapping import gapping_ratios
from beamsim.analyses.run.exact_motion import VALUES_AT_ONCE, exact_motion_of
from beamsim.analyses.run.impacts import SKIPPED
from beamsim.analyses.run.linear_prediction import gapping_of_sine
from beamsim.analyses.run.motion import RunMotion, samples_until
from beamsim.analyses.run.random_response import LEAST_SAMPLES
from beamsim.analyses.run.summary import by_name, figures_of_motion
from beamsim.analyses.values import BY_ENTRY, STRESS, VALUES, Margins, largest
from beamsim.analyses.values import Value as ReportedValue
from beamsim.errors import BeamsimError
from beamsim.flow.channels import Observed
from beamsim.inputs.measured import highest_excited_hz
from beamsim.kinds import KINDS, named
from beamsim.outcomes import Outcome, OutcomeKind, Stop, never
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import Value
from beamsim.scenario.run import OrbitStart
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import not_none


def unsettled(tried: int) -> Outcome:
    """The outcome of a search that ended while better designs were still found."""
    sentence = f"the search ended after {tried} designs while it still found better ones"
    return Outcome.of(
        OutcomeKind.DOUBTFUL, "search_not_converged", sentence, remedy="give more most_cases", tried=tried
    )


class Ended(Exception):
    """What was asked for is not all known; the block of the `Evaluator` ends."""


class Evaluator:
    """Solves cases in batches, by workers that stay for all of them: a context manager to be called.

    Cases are numbered in the order in which they are asked for, so that a search that depends on nothing but outcomes
    asks for the same ones again when it is resumed. After a stop, or beyond the number of cases that is allowed, the
    call ends the block; what is known by then is in `outcomes`.

    Parameters
    ----------
    solving : gives what solves cases, from `beamsim.analyses.parallel.working`; entered when the first one is solved.
    most : number of cases that are allowed, each with all of its realisations.
    realisations : of each case.
    known, each : as of `beamsim.analyses.designs.analysis.design_study`.
    """

    def __init__(
        self, solving: AbstractContextManager[Callable[[Iterable[Case]], Iterator[CaseOutcome]]], *, most: int,
        realisations: int = 1, known: Iterable[CaseOutcome] = (), each: Callable[[CaseOutcome], None] | None = None,
    ) -> None:  # fmt: skip
        self.most = most
        self.rows: list[tuple[Value, ...]] = []  # the values of every case that was asked for, by its number
        self.outcomes: dict[int, CaseOutcome] = {}  # of these, by index: realisations of a case follow each other
        self.ended = ""  # "interrupted", or "most_cases" where more were asked for than are allowed
        self._known = {outcome.index: outcome for outcome in known}
        self._each, self._count, self._solving, self._open = each, realisations, solving, ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> bool:
        if kind is Ended:
            self._open.close()
            return True
        return bool(self._open.__exit__(kind, error, trace))

    def __call__(self, rows: Sequence[tuple[Value, ...]]) -> list[list[CaseOutcome]]:
        """The outcomes of all realisations of cases, each given by the values of the varied parameters."""
        first, count = len(self.rows), self._count
        self.rows += rows[: self.most - first]
        batch = range(first, len(self.rows))
        cases = [Case(k * count + r, self.rows[k], r) for k in batch for r in range(count)]
        known = [self._known[case.number] for case in cases if case.number in self._known]
        self.outcomes |= {
            outcome.index: outcome for outcome in known if outcome.given == self.rows[outcome.index // count]
        }
        missing = [case for case in cases if case.number not in self.outcomes]
        for outcome in self._solved(missing) if missing else ():
            if outcome.outcome.interrupted:
                continue
            self.outcomes[outcome.index] = outcome
            if self._each is not None:
                self._each(outcome)
        if any(case.number not in self.outcomes for case in cases):
            self.ended = "interrupted"
        elif len(batch) < len(rows):
            self.ended = "most_cases"
        if self.ended:
            raise Ended
        return [[self.outcomes[k * count + r] for r in range(count)] for k in batch]

    @cached_property
    def _solved(self) -> Callable[[Iterable[Case]], Iterator[CaseOutcome]]:
        return self._open.enter_context(self._solving)


class CaseSolver:
    """Solves the cases of one study; what they share is built once."""

    def __init__(self, study: Study, stop: Stop = never) -> None:
        self.study = study
        self.stop = stop
        self.shared = SharedBuilds()

    def __call__(self, case: Case) -> CaseOutcome:
        """Solve one case, unless it is to stop; an error becomes part of the outcome, so that other cases continue."""
        begin = clock.thread_time()
        values: Responses = {}
        ranges: Mapping[str, Sequence[float]] = {}
        try:
            values, outcome, ranges = self._responses(self.study.scenario(case))
        except BeamsimError as error:
            outcome = Outcome.of(OutcomeKind.FAILED, "failed", "; ".join(str(error).splitlines()))
        except (ArithmeticError, ValueError, RuntimeError) as error:
            reason = f"internal error ({type(error).__name__}: {error})"
            outcome = Outcome.of(OutcomeKind.FAILED, "failed", reason)
        if asked := self.study.asked:
            values = {name: x for name, x in values.items() if any(means(each, name) for each in asked)}
        time = clock.thread_time() - begin
        return CaseOutcome(case.number, values if outcome.complete else {}, outcome, time, ranges, case.values)

    def _responses(self, scenario: Scenario) -> tuple[Responses, Outcome, Mapping[str, Sequence[float]]]:
        """Of a run the values that are asked for, if they can be had alone; else those of the whole result."""
        analysis = self.study.analysis
        if analysis == "run" and gives_figures(scenario):
            asked = entries_of(self.study.asked, scenario)
            system = build_system(scenario, self.shared, recovered=needs_recovery(asked))
            figures, outcome = asked_figures(system, asked, self.stop)
            return run_responses(figures), outcome, {}
        kind = analysis if analysis in KINDS else "sweep"
        result: Any = named(KINDS[kind].analysis)(scenario, stop=self.stop)
        margins: Margins = result.summary.get("margins", {})
        ends = {name: (x["lowest"], x["highest"]) for name, x in margins.items() if x["lowest"] != x["highest"]}
        ranges = {name: (low, high) if low < high else (-math.inf, math.inf) for name, (low, high) in ends.items()}
        return responses_of_result(result), result.outcome, ranges


_PLACE = "largest_bending_stress_position_m"


def gives_figures(scenario: Scenario) -> bool:
    """Whether `asked_figures` finds the figures of a run: it is in closed form, unfiltered, and of this model alone."""
    settings = not_none(scenario.run)
    in_closed_form = settings.method != "reference" and all(s.item.kind != "cubic" for s in scenario.nonlinear_springs)
    of_curves = scenario.limits is not None and any(scenario.limits.given_curves())
    plain = settings.low_pass is None and settings.convergence != "on" and not of_curves
    return in_closed_form and plain and not isinstance(settings.start, OrbitStart)


def needs_recovery(asked: Collection[str]) -> bool:
    """Whether one of the entries needs the stress along the bodies, or the outputs of the scenario."""
    return any(value.section in ("bodies", "outputs") for value in _values(asked))


def _values(asked: Collection[str]) -> list[ReportedValue]:
    """The values among the entries, with the stress where its place is asked for, and displacements of probes where
    round-off is told by them."""
    found = [value for value in VALUES if value.entry in asked]
    needed = [BY_ENTRY["largest_bending_stress_pa"]] * (_PLACE in asked)
    needed += [BY_ENTRY["peak_displacement_m"]] * any(value.section in ("probes", "outputs") for value in found)
    return found + needed


def asked_figures(
    system: StructuralSystem, asked: Collection[str], stop: Stop = never
) -> tuple[dict[str, Any], Outcome]:
    """Some entries of the summary of a run, and its outcome.

    The energy balance of the motion is checked, whatever is asked for.

    Parameters
    ----------
    system : of a scenario for which `gives_figures`.
    asked : entries of `beamsim.analyses.values.VALUES`; what the system does not have (a stress, snubbers) is left out.
    stop : asked between blocks of events whether to end.

    Returns
    -------
    figures, outcome
        By entry, as in the summary; how the motion ended.

    Raises
    ------
    ScenarioError
        If the input has too many pieces, see `beamsim.analyses.run.exact_motion.motion_in_stretches`.
    """
    settings = not_none(system.scenario.run)
    motion = exact_motion_of(system, settings, np.zeros(0), None, stop, values=_values(asked))
    found = {**figures_of_motion(motion), "energy_error": motion.balance.error}
    if STRESS in motion.extremes and system.stress is not None:
        found[_PLACE] = float(system.stress.stations.position[largest(motion.extremes[STRESS]).argmax()])
    if motion.outcome.complete:
        found |= _root_mean_squares(motion, asked)
    if "gapping_ratio" in asked:
        found["gapping_ratio"] = gapping_ratios(gapping_of_sine(system))
    return {entry: value for entry, value in found.items() if entry in asked}, motion.outcome


def _root_mean_squares(motion: RunMotion, asked: Collection[str]) -> dict[str, Any]:
    """Those of samples without the first part of a run, as `beamsim.analyses.run.random_response` has them.

    Parameters
    ----------
    motion : of the run.
    asked : entries, of which those of a stationary input count.
    """
    keys = {entry: value.key for entry, value in BY_ENTRY.items() if entry.startswith("rms_") and entry in asked}
    scenario = motion.system.scenario
    rate = scenario.sample_rate_up_to(highest_excited_hz(scenario))
    number = samples_until(not_none(scenario.run).duration, rate)
    first = reached = int(SKIPPED * number)
    if not keys or number - first < LEAST_SAMPLES:
        return {}
    observed = Observed(motion.marched.flow, motion.system.channels.of_keys(*keys.values()))
    squares = np.zeros(observed.channels.order.size)
    at_once = max(VALUES_AT_ONCE // max(squares.size, 1), 1)
    for stretch in motion.parts():
        upto = min(samples_until(stretch.end, rate), number)
        for begin in range(reached, upto, at_once):
            times = np.arange(begin, min(begin + at_once, upto)) / rate
            squares += np.sum(observed.values(stretch, times) ** 2, axis=0)
        reached = max(upto, reached)
    roots = observed.channels.split(np.sqrt(squares / (number - first)))
    names = {key: [c.name for c in observed.channels.channels if c.key == key] for key in roots}
    return {entry: by_name(names[key], roots[key]) for entry, key in keys.items() if key in roots}
