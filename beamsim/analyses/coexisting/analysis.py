"""``beamsim sweep`` of kind coexisting: all steady motions at a frequency, and the probability of each.

A start is a state at a phase of the excitation. It is marched cycle by cycle until it repeats; a motion that does not
repeat gets its largest Lyapunov exponent. Starts are independent, so workers can share them. The share of random starts
that reach a motion is its basin stability (P. J. Menck et al., Nature Physics 9, 2013).
"""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.coexisting.result import DISTURBANCES, MOTIONS, STARTS, CoexistingResult
from beamsim.cases import Case, CaseOutcome, Evaluator, StopEvaluation, failed_case, probability
from beamsim.errors import NotTrustedError, ScenarioError
from beamsim.flow.compiled import processor_time
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.labelled import Dataset
from beamsim.orbits.branch import BranchPoint, OrbitBranch
from beamsim.orbits.continuation import solve_at
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.steady import largest_exponent, settle, stepper_on, velocity_weights
from beamsim.orbits.tracing import SETTINGS, Budget, Tracer, coincides, follow, join_directions, side_branches
from beamsim.outcomes import (
    COMPLETE,
    Outcome,
    OutcomeKind,
    Progress,
    Where,
    first_with_others,
    interruption,
    stop_requested,
)
from beamsim.parallel import Cluster, Computation, worker_pool
from beamsim.responses.branches import (
    MeasuredBranch,
    growing_with_modes,
    largest_values,
    response,
    response_datasets,
)
from beamsim.responses.orbit_energies import check_balance
from beamsim.responses.parameters import ResponseModel, response_model
from beamsim.responses.points import TargetPoint, with_points_at
from beamsim.results.result import check_reduction, dashpots_of, warnings_along
from beamsim.results.values import peaks_in
from beamsim.scenario import Scenario
from beamsim.scenario.base import count_text
from beamsim.scenario.sweep import BoxCoordinate, Coexisting, Continuation, HistoryStarts, PhaseStarts, StateStarts
from beamsim.typing import TINY, Floats, of_kind

SAME_MOTION = 1e-6  # relative distance within which two converged motions are the same
MEASURED_CYCLES = 256  # of a motion that is not periodic
SHARE_OF_STARTS = 0.6  # of the progress; the rest is for the later steps
MOST_POINTS, MOST_SECONDS = 4000, 300.0  # limits for the branches traced from the motions
LONGEST_SIDE = 4  # longest traced motion, in periods of the excitation


@dataclass
class _Motion:
    """Motion at a frequency; a motion that is not periodic is represented by many cycles."""

    frequency_hz: float
    problem: ForcedOrbits
    point: BranchPoint
    kind: str = "periodic"
    exponent: float = np.nan  # 1/s, of a motion that is not periodic
    starts: list[int] = field(default_factory=list)  # numbers of the starts that reach it

    @cached_property
    def stable(self) -> bool:
        """True if it attracts neighbouring states (always for a motion that is not periodic: marching found it)."""
        return self.kind != "periodic" or self.problem.orbit(self.point).stable

    @cached_property
    def section(self) -> OrbitSection:
        """States at phase zero."""
        flow, flow_map = self.problem.cycle(self.point)
        times = np.linspace(0.0, flow_map.duration, self.problem.multiple, endpoint=False)
        return OrbitSection(flow.states_at(flow_map, times), velocity_weights(flow, flow.omega))

    def importance(self) -> tuple[bool, int, float]:
        """Sort key: motions with most starts first, unstable ones last by their size."""
        return not self.stable, -len(self.starts), float(np.abs(self.point.u[:-1]).max())

    def attracts(self, end: Destination, tolerance: float) -> bool:
        """True if a start has reached this motion."""
        if self.kind != "periodic" or end.kind != "periodic":
            return end.kind == self.kind
        return self.section.contains(end, tolerance)

    def is_same_motion(self, other: _Motion) -> bool:
        """True if two periodic motions are the same."""
        return self.attracts(Destination(other.problem.multiple, 0, other.point.u[:-1]), SAME_MOTION)


_Order = Sequence[tuple[int, _Motion]]  # each with its number at its frequency


def coexisting(
    scenario: Scenario, progress: Progress = None, *, workers: int | None = 1,
    scheduler: str | Cluster | None = None, solved_before: Iterable[CaseOutcome] = (),
    on_outcome: Callable[[CaseOutcome], None] | None = None,
) -> CoexistingResult:  # fmt: skip
    """Find the motions at each frequency of a scenario, and the share of the starts that reach each.

    The result does not depend on the number or kind of workers, or on the given outcomes.

    Parameters
    ----------
    scenario : scenario with a ``sweep`` section of kind coexisting and a harmonic excitation.
    progress : called with the completed fraction.
    workers, scheduler : workers for starts and disturbances, as in `beamsim.trust.studies.design_study`.
    solved_before : outcomes of starts and disturbances from an earlier, interrupted call.
    on_outcome : called with every new outcome, in the order of completion.

    Returns
    -------
    CoexistingResult

    Raises
    ------
    ScenarioError
        If the scenario does not allow the search.
    KeyboardInterrupt
        If interrupted before any motion was found.
    NotTrustedError
        If no motion is found, or the connection to the cluster is lost.
    """
    begin, processor = clock.perf_counter(), processor_time()
    marches = Marches(scenario)
    hz, rows, budget = marches.settings.frequencies, marches.drawn_states(), Budget(MOST_POINTS, MOST_SECONDS)
    starts = [(f, 0, *row) for f in hz for row in rows.tolist()]
    computation = Computation(partial(Marches, scenario), failed_case)

    def solved(outcome: CaseOutcome) -> None:
        if on_outcome is not None:
            on_outcome(outcome)
        if progress is not None and outcome.index < len(starts):
            progress(SHARE_OF_STARTS * len(evaluate.outcomes) / len(starts))

    solving = worker_pool(computation, sys.maxsize, workers=workers, scheduler=scheduler)
    with Evaluator(solving, most_cases=sys.maxsize, solved_before=solved_before, on_outcome=solved) as evaluate:
        with suppress(StopEvaluation):
            evaluate(starts)
        ends: dict[float, dict[int, Destination]] = {f: {} for f in hz}
        for index, outcome in evaluate.outcomes.items():
            if not outcome.failed:
                ends[hz[index // len(rows)]][index % len(rows)] = Destination.of(outcome)
        motions = {f: _attracting_motions(marches, f, of) for f, of in ends.items()}
        if marches.settings.unstable and not stop_requested():
            _add_unstable(marches, motions, budget)
        order = _number_motions(motions)
        branches = [_measure(marches, motion) for _, motion in order]
        result = _result_of_starts(marches, order, branches, rows, ends)
        result = replace(result, datasets=result.datasets | _disturbances(marches, order, evaluate))
    ended = _outcome(marches, result, budget, [case for case in evaluate.outcomes.values() if case.failed])
    result = replace(result, outcome=ended, wall_time_s=clock.perf_counter() - begin)
    return result.with_summary(**_summary(marches, result, branches), processor_time_s=processor_time() - processor)


def _number_motions(motions: Mapping[float, list[_Motion]]) -> _Order:
    """Number all motions.

    Raises
    ------
    KeyboardInterrupt, NotTrustedError
        If there are no motions.
    """
    order = [each for of in motions.values() for each in enumerate(sorted(of, key=_Motion.importance), 1)]
    if not order and stop_requested():
        raise KeyboardInterrupt
    if not order:
        raise NotTrustedError("no start settled, and no periodic motion was found; raise sweep.most_cycles")
    return order


def _attracting_motions(marches: Marches, hz: float, ends: Mapping[int, Destination]) -> list[_Motion]:
    """Motions that starts have reached; periodic ones are computed by shooting from there."""
    motions: list[_Motion] = []
    flow = marches.flow_at(hz)
    for number, end in sorted(ends.items()):
        motion = next((m for m in motions if m.attracts(end, NEAR_FACTOR * marches.settings.steady_to)), None)
        if motion is None and end.period:
            problem = ForcedOrbits(flow, "frequency", end.period)
            point = solve_at(problem, np.append(end.state, flow.omega), SETTINGS, flow.omega)
            found = None if point is None else _Motion(hz, problem, point)
            motion = found and next((m for m in motions if m.is_same_motion(found)), found)
        elif motion is None and end.kind != "not settled":
            u = np.append(end.state, flow.omega)
            flow_map = flow.flow_map(end.state, MEASURED_CYCLES / hz)
            point = BranchPoint(u, np.zeros(u.size), np.ones(u.size), np.nan, 1.0, 0, flow_map)
            motion = _Motion(hz, ForcedOrbits(flow, "frequency"), point, end.kind, end.exponent)
        if motion is not None and motion.stable:
            motions += [] if any(motion is m for m in motions) else [motion]
            motion.starts.append(number)
    return motions


def _add_unstable(marches: Marches, motions: Mapping[float, list[_Motion]], budget: Budget) -> None:
    """Trace branches from the periodic motions over all frequencies, and add motions that the starts did not find."""
    low, high = marches.settings.ends
    reach = (2.0 * np.pi * low / RANGE_FACTOR, 2.0 * np.pi * high * RANGE_FACTOR)
    branches: list[OrbitBranch] = []
    followed = [m for of in motions.values() for m in of if m.kind == "periodic" and m.problem.multiple <= LONGEST_SIDE]
    for m in followed:
        alike = [b for b in branches if b.problem.multiple == m.problem.multiple]
        if not coincides(m.point, alike) and budget.allows_another(len(branches)):
            halves = [follow(Tracer(m.problem, reach), m.point, way, budget, alike) for way in (1.0, -1.0)]
            branches.append(join_directions(*halves))
    branches += side_branches(branches, reach, min(LONGEST_SIDE, marches.settings.longest_period), budget)
    for hz, of in motions.items():
        wanted = [TargetPoint("frequency", 2.0 * np.pi * hz, lambda point: point.parameter, 2.0 * np.pi * hz)]
        for branch in branches:
            for _, point in with_points_at(branch, wanted)[1]:
                motion = _Motion(hz, branch.problem, point)
                of += [] if any(m.is_same_motion(motion) for m in of) else [motion]


class _Disturbance(NamedTuple):
    """Smallest disturbance that makes a motion leave; see `DISTURBANCES`."""

    frequency_hz: float
    number: int
    kind: str
    probe: str
    unit: str
    amplitude: float
    time_s: float
    largest_tried: float


def _disturbances(marches: Marches, order: _Order, evaluate: Evaluator) -> dict[str, Dataset]:
    """Dataset of the smallest disturbance of each kind for each stable periodic motion, by its name."""
    asked = [
        (number, m, k)
        for number, m in order
        for k in range(len(marches.settings.disturbances))
        if m.stable and m.kind == "periodic"
    ]
    first, smallest = len(evaluate.rows), list[_Disturbance]()
    with suppress(StopEvaluation):
        evaluate([(m.frequency_hz, k + 1, *m.section.states.ravel().tolist()) for _, m, k in asked])
    for index, (number, m, k) in enumerate(asked, first):
        if index in evaluate.outcomes and not evaluate.outcomes[index].failed:
            each, found = marches.settings.disturbances[k], dict[str, Any](evaluate.outcomes[index].values)
            about = m.frequency_hz, number, each.kind, each.probe, "N s" if each.probe else "m/s"
            smallest.append(_Disturbance(*about, found["amplitude"], found["time"], each.to))
    units = [{"unit": each.unit} for each in smallest]
    return {"disturbances": DISTURBANCES.table(smallest, units)} if smallest else {}


def _measure(marches: Marches, motion: _Motion) -> MeasuredBranch:
    """Measure a motion as a branch of one point."""
    traced = OrbitBranch(motion.problem, (motion.point,), COMPLETE)
    branch = response(marches.model, traced, marches.model.levels[0])
    if motion.kind == "periodic":
        return branch
    none = np.full_like(branch.multipliers, np.nan)
    return replace(branch, stable=np.ones(1, dtype=bool), multipliers=none, period_multiple=MEASURED_CYCLES)


class _MotionRow(NamedTuple):
    """Motion at a frequency; see `MOTIONS`."""

    frequency_hz: float
    number: int
    kind: str
    period_cycles: int
    stable: bool
    starts: int
    share: float
    share_low: float
    share_high: float
    lyapunov_exponent: float
    largest_multiplier: float


def _result_of_starts(
    marches: Marches, order: _Order, branches: Sequence[MeasuredBranch], rows: Floats,
    ends: Mapping[float, Mapping[int, Destination]],
) -> CoexistingResult:  # fmt: skip
    """Result without its outcome, summary and disturbances."""
    scenario, system, hz = marches.scenario, marches.model.system, list(ends)
    destination, cycles = np.zeros((2, len(hz), len(rows)), dtype=np.int64)
    for at, of in enumerate(ends.values()):
        cycles[at, list(of)] = [end.cycles for end in of.values()]
    motions = list[_MotionRow]()
    for (number, m), branch in zip(order, branches, strict=True):
        at = hz.index(m.frequency_hz)
        destination[at, m.starts] = number
        share = probability(destination[at, cycles[at] > 0] == number) if m.stable and cycles[at].any() else {}
        part, low, high = (float(share.get(name, np.nan)) for name in ("share", "low", "high"))
        size, period = (
            float(np.abs(branch.multipliers[0, 0])),
            m.problem.multiple if m.kind == "periodic" else 0,
        )
        exponent = m.exponent if period == 0 else float(np.log(max(size, TINY))) * m.frequency_hz / period
        found = len(m.starts), part, low, high, exponent, size
        motions.append(_MotionRow(m.frequency_hz, number, m.kind, period, m.stable, *found))
    names, units, *_ = zip(*marches.settings.starts.ranges, strict=True)
    starts = {
        "frequency_hz": np.array(hz), "start_number": np.arange(1, len(rows) + 1),
        "drawn": np.arange(1, len(names) + 1), "coordinate_name": names, "coordinate_unit": units, "start": rows,
        "destination": destination, "cycles": cycles,
    }  # fmt: skip
    datasets = {"modes": system.modes} | response_datasets(marches.model, branches)
    datasets |= {"motions": MOTIONS.table(motions), "starts": STARTS.dataset(starts)}
    return CoexistingResult(
        scenario=scenario, outcome=COMPLETE, datasets=datasets,
        warnings=(*scenario.warnings, *system.warnings, *warnings_along(scenario, system.modes, datasets["points"])),
    )  # fmt: skip


def _summary(marches: Marches, result: CoexistingResult, branches: Sequence[MeasuredBranch]) -> dict[str, Any]:
    """Summary entries that do not repeat a field of the result."""
    peaks = (
        {value.entry: {name: float(sizes[0]) / value.scale for name, sizes in of.items()} for value, of in peaks_in(b)}
        for b in result.branches
    )
    hz = result["starts"]["frequency_hz"].values
    motions, disturbances = result["motions"], result.datasets.get("disturbances")
    return {
        "motions": [row | of for row, of in zip(_rows_as_dicts(motions, "motion"), peaks, strict=True)],
        "not_settled": dict(zip(map("{:g}".format, hz), result.not_settled.tolist(), strict=True)),
        "disturbances": [] if disturbances is None else _rows_as_dicts(disturbances, "disturbance"),
        "starts": len(result["starts"]["start"].values),
        "energy_error": float(result["points"]["energy_error"].values.max()),
        **largest_values(marches.model, result["points"]),
        "without_limit": growing_with_modes(branches),
        "dashpots": dashpots_of(result["modes"]),
    }


def _rows_as_dicts(table: Dataset, dim: str) -> list[dict[str, Any]]:
    """Rows of a table along a dimension, without their numbers."""
    return table.rows(dim, *(name for name in table if name != dim))


def _outcome(
    marches: Marches, result: CoexistingResult, budget: Budget, failed_cases: Sequence[CaseOutcome]
) -> Outcome:
    """Outcome: incomplete or unreliable parts, and starts that did not settle."""
    left, exceeded = result.not_settled, budget.exceeded(incomplete=False)
    fewer = "request fewer frequencies at once, or exclude unstable motions (sweep.unstable: false)"
    remarks = [] if exceeded is None else [exceeded.copy_with(remedy=fewer)]
    modes = result["modes"]
    endless = modes["open_frequencies_hz"].values[modes["damping_ratios"].values == 0.0]
    if endless.size and (left.any() or not result["motions"]["period_cycles"].values.all()):
        sentence = (
            f"the mode at {endless[0]:.4g} Hz has no damping with every stop open, so starts need not settle: motions "
            "that do not repeat, and their shares, depend on how long they were followed"
        )
        remedy = "give each body damping, for example {kind: modal, ratio: 1 %}"
        remarks.append(Outcome.of(OutcomeKind.UNTRUSTED, "undamped", sentence, remedy=remedy))
    elif left.any():
        at = Where(result["starts"]["frequency_hz"].values[left > 0], "Hz")
        remedy = "raise sweep.most_cycles or sweep.longest_period"
        sentence = f"{count_text(int(left.sum()), 'start')} did not settle"
        remarks.append(Outcome.of(OutcomeKind.NOTED, "not_settled", sentence, at=at, remedy=remedy))
    if failed_cases:
        of = "1 start or disturbance" if len(failed_cases) == 1 else f"{len(failed_cases)} starts or disturbances"
        sentence = f"{of} could not be computed; the first: {failed_cases[0].outcome.text}"
        remarks.append(Outcome.of(OutcomeKind.INCOMPLETE, "cases_failed", sentence))
    outcome = first_with_others(remarks)
    if stop_requested():
        waiting = int(np.sum(result["starts"]["cycles"].values == 0))
        outcome = interruption(f"with {waiting} starts left", *outcome.unless_complete)
    return check_reduction(check_balance(outcome, result["points"]), marches.scenario, modes)


RANGE_FACTOR = 1.15  # ratio by which branches are traced beyond the frequencies
NEAR_FACTOR = 100.0  # times the tolerance of a settled motion, within which states belong to the same motion
EXPONENT_CYCLES = 400
PHASE_COUNT = 8  # phases of a cycle at which a motion is disturbed
AMPLITUDE_RATIO, AMPLITUDE_COUNT = 2.0**0.5, 13  # ratio of successive disturbance amplitudes, and their number
DISTURBANCE_TOLERANCE = 0.01  # relative accuracy of the smallest disturbance


class Destination(NamedTuple):
    """Final motion of a start."""

    period: int  # cycles; 0 if the motion is not periodic
    cycles: int  # number until it settled
    state: Floats  # (N,) at phase zero
    kind: str = "periodic"  # or the kind that follows from its exponent
    exponent: float = np.nan  # 1/s, of a motion that is not periodic

    @classmethod
    def of(cls, outcome: CaseOutcome) -> Destination:
        """Destination from the outcome of a case."""
        values: dict[str, Any] = {**outcome.values, "state": np.array(outcome.values["state"])}
        return cls(**values)


class OrbitSection(NamedTuple):
    """Periodic motion by its states (period, N) at phase zero of every cycle."""

    states: Floats
    weight: Floats  # (N,) factors that make the entries of a state comparable

    def contains(self, end: Destination, tolerance: float) -> bool:
        """True if a start has reached this motion: within a distance relative to the size of the motion."""
        away = np.abs((self.states - end.state) * self.weight).max(axis=1).min()
        size = max(float(np.abs(self.states * self.weight).max()), TINY)
        return end.period == self.states.shape[0] and bool(away <= tolerance * size)


@dataclass(frozen=True)
class Marches:
    """Marches of a scenario that workers compute, from starts and after disturbances; each is a case.

    Parameters
    ----------
    scenario : scenario with a ``sweep`` section of kind coexisting.
    """

    scenario: Scenario

    @property
    def settings(self) -> Coexisting:
        """Section ``sweep`` of the scenario."""
        if not isinstance(self.scenario.sweep, Coexisting):
            example = "write `sweep: {kind: coexisting, at: [68 Hz], starts: {kind: phases, number: 100}}`"
            raise ScenarioError.at("sweep.kind", "is not coexisting", example)
        return self.scenario.sweep

    @cached_property
    def model(self) -> ResponseModel:
        """Structure under its loads, for all frequencies over which branches may be traced."""
        low, high = self.settings.ends
        followed = Continuation.model_construct(from_=low / RANGE_FACTOR, to=high * RANGE_FACTOR)
        return response_model(self.scenario.model_copy(update={"sweep": followed, "run": None}))

    @cached_property
    def flow(self) -> PeriodicFlow:
        """Flow of the structure at the first of these frequencies."""
        problem = of_kind(ForcedOrbits, self.model.problem(self.model.levels[0]))
        return problem.flow

    def flow_at(self, hz: float) -> PeriodicFlow:
        """Flow at a frequency, Hz."""
        return self.flow.with_loads(2.0 * np.pi * hz)

    def drawn_states(self) -> Floats:
        """(starts, coordinates) random starts, the same at every frequency."""
        starts = self.settings.starts
        low, high = np.array([ends for _, _, *ends in starts.ranges]).T
        u = np.random.default_rng(starts.seed).random((starts.number, low.size))
        return np.asarray(low + u * (high - low))

    def __call__(self, case: Case) -> CaseOutcome:
        """Compute a case at a frequency: the destination of a start, or the smallest disturbance of a motion.

        Its values are the frequency, Hz, and either 0 and the coordinates of the start, or the number of the
        disturbance from 1 and the states of the motion at phase zero.
        """
        hz, number, *values = case.values
        flow, begin, found = self.flow_at(float(hz)), clock.thread_time(), dict[str, Any]()
        if number:
            known = OrbitSection(np.reshape(values, (-1, flow.size)), velocity_weights(flow, flow.omega))
            amplitude, time = self._smallest_disturbance(flow, known, self.settings.disturbances[int(number) - 1])
            found = {"amplitude": amplitude, "time": time}
        else:
            end = self._destination_of_start(flow, np.array(values, dtype=float))
            found = end._asdict() | {"state": end.state.tolist()}
        outcome = interruption("before it was known") if stop_requested() else COMPLETE
        return CaseOutcome(case.number, found, outcome, clock.thread_time() - begin, given=case.values)

    def _destination_of_start(self, flow: PeriodicFlow, row: Floats) -> Destination:
        """Destination of a start with these coordinates."""
        starts, y = self.settings.starts, np.zeros(flow.size)
        y[: self.model.system.initial_state.size] = self.model.system.initial_state
        if isinstance(starts, HistoryStarts):
            y = self._state_after_sweep(flow, y, starts, float(row[0]))
        if isinstance(starts, StateStarts):
            for moved, each in zip(row.reshape(-1, 2), starts.box, strict=True):
                y[: 2 * flow.system.size] += np.outer(moved, self._unit_displacement(flow, each)).ravel()
        return self.destination(flow, y, float(row[0]) / flow.omega if isinstance(starts, PhaseStarts) else 0.0)

    def _unit_displacement(self, flow: PeriodicFlow, coordinate: BoxCoordinate) -> Floats:
        """(n,) coordinates that displace a probe by one unit, in a mode or by a static force.

        Raises
        ------
        ScenarioError
            If no such coordinates exist.
        """
        row, stiffness = self._row(coordinate.probe), flow.system.stiffness
        with np.errstate(divide="ignore", invalid="ignore"):
            shape = (
                row / stiffness if coordinate.mode is None else 1.0 * (np.arange(1, row.size + 1) == coordinate.mode)
            )
        if not abs(row @ shape) > 1e-6 * np.linalg.norm(row) * np.linalg.norm(shape) or np.isinf(shape).any():
            where = "the static deflection" if coordinate.mode is None else f"mode {coordinate.mode}"
            remedy = f"give a mode from 1 to {row.size} in which the probe moves, or another probe"
            raise ScenarioError.at("sweep.starts.box", f"has {coordinate.probe}, which {where} does not move", remedy)
        return np.asarray(shape / (row @ shape))

    def _row(self, probe: str) -> Floats:
        return next(each.shape for each in self.model.system.probes if each.name == probe)

    def _state_after_sweep(self, flow: PeriodicFlow, y: Floats, starts: HistoryStarts, hz: float) -> Floats:
        """Final state of a stepped sweep with one cycle per frequency and a continuous phase."""
        last = flow.omega / (2.0 * np.pi)
        sign = 1.0 if last > hz else -1.0
        while sign * (last - hz) > 0.0 and not stop_requested():
            stepper, motion = stepper_on(flow.with_loads(2.0 * np.pi * hz), y)
            y = stepper.march_cycles(motion, 1)[0]
            change = sign * starts.rate.value / hz
            hz = hz * 2.0**change if starts.rate.unit == "oct/s" else hz + change
        return y

    def destination(
        self, flow: PeriodicFlow, y: Floats, time: float = 0.0, *, with_exponent: bool = True
    ) -> Destination:
        """March a state until it settles.

        Parameters
        ----------
        flow : flow at the frequency.
        y : (N,) initial state.
        time : time of that state in the excitation's cycle, s.
        with_exponent : True to compute the exponent of a motion that is not periodic.

        Returns
        -------
        Destination
        """
        s, period = self.settings, 2.0 * np.pi / flow.omega
        if time % period:
            y = flow.end(y, period - time % period, time % period)
        stepper, motion = stepper_on(flow, y)
        found = settle(
            stepper, motion, tolerance=s.steady_to, longest_period=s.longest_period, most_cycles=s.most_cycles
        )
        state = motion.y.copy()
        if found.period or not with_exponent:
            return Destination(found.period, found.cycles, state)
        exponent = largest_exponent(stepper, motion, EXPONENT_CYCLES)
        return Destination(found.period, found.cycles, state, exponent.kind, exponent.value)

    def _smallest_disturbance(self, flow: PeriodicFlow, section: OrbitSection, disturbance: Any) -> tuple[float, float]:
        """Smallest disturbance over phases of the motion and both signs, by increasing amplitudes and then bisection.

        A disturbance is an instantaneous change of the velocities. If basins are fractal, smaller disturbances between
        the tested amplitudes may also make the motion leave.
        """
        n, period, change = flow.system.size, 2.0 * np.pi / flow.omega, np.zeros(flow.size)
        probe = disturbance.probe
        change[n : 2 * n] = self._row(probe) if probe else self.model.system.forcing.load[0]
        times = [(k, j * period / PHASE_COUNT) for k in range(len(section.states)) for j in range(PHASE_COUNT)]
        states = [(k * period + t, flow.end(section.states[k], t) if t else section.states[k]) for k, t in times]

        def phases_that_leave(amplitude: float) -> Iterator[tuple[float, float]]:
            for t, z in states:
                for size in (amplitude, -amplitude):
                    end = self.destination(flow, z + size * change, t, with_exponent=False)
                    if not stop_requested() and not section.contains(end, NEAR_FACTOR * self.settings.steady_to):
                        yield size, t

        amplitudes = (disturbance.to * AMPLITUDE_RATIO ** np.arange(1.0 - AMPLITUDE_COUNT, 1.0)).tolist()
        low, found = next(
            ((low, first) for low, high in pairwise([0.0, *amplitudes]) for first in phases_that_leave(high)),
            (0.0, (np.nan, np.nan)),
        )
        while abs(found[0]) - low > DISTURBANCE_TOLERANCE * abs(found[0]) and not stop_requested():
            middle = 0.5 * (low + abs(found[0]))
            first = next(phases_that_leave(middle), None)
            low, found = (middle, found) if first is None else (low, first)
        return found
