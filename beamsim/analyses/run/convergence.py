"""How much every figure of a run changes when the case is solved again with a finer model.

The finer model has half as many modes more and, where a body has a mesh, twice the elements. A figure that changes by
more than `ALLOWED_CHANGE` is doubtful: it belongs to the model and not to the structure. Motions that bounce on and on
may be so sensitive that the sequences of contacts part although both models are good. Up to there the figures are
compared as they are. What comes after is compared statistically if the excitation goes on: each figure is taken in
`WINDOWS` equal parts of the rest, and the change is that of its mean; it is doubtful if it exceeds the scatter of the
differences too.

After the sequences have parted the motion is one of many. Figures that what follows can change are marked
(`after_parting`), even where a finer model happens to give the same number: shares and means, and extremes that are not
above everything that follows by more than its own spread. Small disturbances of the stiffness say whether the motion is
that sensitive or only the models differ.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.run.derived import DerivedFigures, Figures, OutputSamples, SpectrumKey, line_changes
from beamsim.analyses.run.figures import deflection_size, extremes_of, motion_figures, static_figures
from beamsim.analyses.run.filtered_motion import FilteredMotion, filtered
from beamsim.analyses.run.outputs import exact_flow
from beamsim.analyses.run.parting import LONGER, ContactEvents, PartingTimes, parting, sensitivity
from beamsim.analyses.run.result import ALLOWED_CHANGE, MAIN_QUANTITY, RunResult, Work
from beamsim.analyses.values import ACCELERATION, DISPLACEMENT, searched
from beamsim.errors import ScenarioError
from beamsim.fields import changed, figure_in_words
from beamsim.flow.channels import Observed
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem

if TYPE_CHECKING:
    from beamsim.scenario import Run, Scenario
    from beamsim.system.shared import SharedBuilds

WORTHLESS = 0.5  # relative change of the displacements beyond which the default model is not to be used
MORE_MODES = 1.5
WINDOWS = 8  # parts of the motion after the sequences have parted
FREQUENCIES = 6  # natural frequencies that are compared
COUNTED = ("contact_share", "contacts")  # of the whole motion; all other figures of motions are extremes
SAME_VALUE = 1e-6  # relative: an extreme of a part of the motion is that of the whole
ROUND_OFF = 1e-9  # of the largest figure of its kind, which a smaller one is compared with

Changes = Figures  # relative, by entry of the summary


@dataclass(frozen=True)
class Solution:
    """The figures of a model, and its motion where it is known in closed form."""

    system: StructuralSystem
    settings: Run
    figures: Mapping[str, Any]
    events: ContactEvents
    trajectory: Trajectory | None = None
    sampled: OutputSamples | None = None  # from time stepping
    filtered: FilteredMotion | None = None  # accelerations behind run.low_pass

    @property
    def end(self) -> float:
        """Time that was reached, s."""
        return self.events.end


@dataclass(frozen=True)
class Convergence:
    """Relative changes of the figures of a run with a finer model."""

    changes: Changes
    doubtful: tuple[str, ...] = ()  # ``figure.name`` of those that change by more than `ALLOWED_CHANGE`
    modes: int = 0  # of the finer model; 0 where the first leaves out nothing
    parted_s: float = math.inf  # time at which the sequences of contacts part
    after_parting: tuple[str, ...] = ()  # ``figure.name`` of those that depend on the motion after that
    sensitivity: PartingTimes = field(default_factory=PartingTimes)
    processor_time_s: float = 0.0
    reason: str = field(default="")  # why there is no comparison
    lines: Mapping[SpectrumKey, tuple[float, ...]] = field(default_factory=dict)  # of each line of each spectrum
    compared_s: float = math.inf  # length of the first part that is compared, where the motion is not kept as a whole

    @property
    def largest_displacement_change(self) -> float:
        """Largest change of a peak displacement."""
        changes = self.changes.get("peak_displacement_m", {})
        return max(changes.values(), default=0.0) if isinstance(changes, dict) else changes

    def summary(self) -> dict[str, Any]:
        """Entries of the summary of a run."""

        def finite(time: float) -> float | None:
            return time if math.isfinite(time) else None

        model: dict[str, Any] = {
            "modes": self.modes, "sequences_part_s": finite(self.parted_s),
            "disturbance_parts_s": finite(self.sensitivity.small_s),
            "round_off_parts_s": finite(self.sensitivity.round_off_s),
            "processor_time_s": self.processor_time_s, "reason": self.reason,
        }  # fmt: skip
        if math.isfinite(self.compared_s):
            model["compared_s"] = self.compared_s
        doubtful, after = list(self.doubtful), list(self.after_parting)
        return {"convergence": self.changes, "doubtful": doubtful, "after_parting": after, "convergence_model": model}


def check_convergence(
    scenario: Scenario,
    first: Solution,
    derived: DerivedFigures,
    shared: SharedBuilds,
    solve: Callable[[StructuralSystem], Solution | None] | None,
    disturbed: Callable[[float, float], ContactEvents] | None,
) -> Convergence:
    """Solve the case again with a finer model and compare the figures.

    Parameters
    ----------
    first : the solution whose figures are reported.
    derived : its spectra and statistics.
    shared : what its system was built from.
    solve : solves the finer model, or returns None where that is interrupted; None where there can be none.
    disturbed : see `sensitivity`; None of a motion from time stepping.
    """
    begin = clock.process_time()
    modes = first.system.modes.kept_modes
    counts = [body.mode_count for body in scenario.all_bodies.values()]
    everything = None not in counts and modes >= sum(count for count in counts if count is not None)
    if solve is None or everything:
        checked = Convergence({}, reason="the run starts from a state of this model, which a finer one does not share")
        if everything:
            changes, lines = _with_lines(derived, _no_changes(_compared(first.figures) | derived.reported()))
            checked = Convergence(changes, lines=lines)
        return _disturbed_alone(checked, first, derived, disturbed, begin)
    first = replace(first, figures=_of_modes(first.figures, modes))
    finer = scenario.refined(math.ceil(MORE_MODES * modes))
    try:
        second = solve(build_system(finer, shared, assessed=False))
    except ScenarioError as error:
        return Convergence({}, reason="; ".join(problem.message for problem in error.problems))
    if second is None:
        return Convergence({}, reason="interrupted")
    parted = parting(first.events, second.events)
    end = min(first.end, second.end)
    scatter: Changes = {}
    early: Changes | None = None
    windows: list[Changes] = []
    after: tuple[str, ...] = ()
    felt = PartingTimes()
    if parted < end:
        early, windows = _until(parted, first), list(_windows(first, parted, end))
        felt = PartingTimes() if disturbed is None else sensitivity(first.events, parted, disturbed)
        if felt.sensitive or disturbed is None:
            after = tuple(_after_parting(first, early, windows, derived))
    lasting = scenario.excitation.kind != "none" and not scenario.excitation.shock
    if lasting and early is not None and (later := _until(parted, second)) is not None:
        changes, scatter = _statistical(first, early, later, windows, list(_windows(second, parted, end)))
        parts = derived.parts(WINDOWS)
        one, other = (derived.again(s.system, s.trajectory, parts) for s in (first, second) if s.trajectory)
        changes |= _changes(one, other)
        if parts > 1:
            scatter |= _with_lines(derived, _changes(one, other, scatter=True))[0]
    else:
        changes = _changes([_compared(first.figures)], [_compared(second.figures)])
        if (motion := second.trajectory or second.sampled) is not None:
            changes |= _changes([derived.reported()], derived.again(second.system, motion))
    changes, lines = _with_lines(derived, changes)
    for entry, quantity in (("rms_displacement_m", "displacement"), ("rms_acceleration_g", MAIN_QUANTITY)):
        if isinstance(of_probes := changes.get(entry), dict):
            moving = {probe: x for probe, x in of_probes.items() if not resting(probe, quantity, first.figures)}
            changes[entry] = moving
    doubtful = tuple(_doubtful(changes, scatter))
    return Convergence(
        changes, doubtful, second.system.modes.kept_modes, parted, after, felt, clock.process_time() - begin,
        lines=lines,
    )  # fmt: skip


def _disturbed_alone(
    checked: Convergence,
    first: Solution,
    derived: DerivedFigures,
    disturbed: Callable[[float, float], ContactEvents] | None,
    begin: float,
) -> Convergence:
    """What is known without a finer model: whether a small disturbance gives other contacts."""
    if disturbed is None or first.events.time.size == 0:
        return checked
    felt = sensitivity(first.events, first.end / LONGER, disturbed)
    if not felt.sensitive:
        return replace(checked, processor_time_s=clock.process_time() - begin)
    early, windows = _until(felt.small_s, first), list(_windows(first, felt.small_s, first.end))
    after = tuple(_after_parting(first, early, windows, derived))
    spent = clock.process_time() - begin
    return replace(checked, parted_s=felt.small_s, after_parting=after, sensitivity=felt, processor_time_s=spent)


def followed_to_the_end(
    checked: Convergence,
    compared_s: float,
    events: ContactEvents,
    disturbed: Callable[[float, float], ContactEvents],
    figures: Mapping[str, Any],
) -> Convergence:
    """A comparison of the first part of a motion with the sensitivity of the whole.

    The motion goes on long after the parting, with higher extremes by chance: each of its figures depends on that.

    Parameters
    ----------
    compared_s : s, length of the first part.
    events, figures : of the whole motion; no figures of the model itself.
    disturbed : see `sensitivity`.
    """
    felt = checked.sensitivity
    if not felt.sensitive:
        felt = sensitivity(events, compared_s, disturbed)
    checked = replace(checked, compared_s=compared_s)
    if not felt.sensitive:
        return replace(checked, after_parting=())
    after = [
        f"{name}.{place}" if place else name
        for name, value in _compared(figures).items()
        for place, _ in _places(value)
    ]
    parted = min(checked.parted_s, felt.small_s)
    return replace(checked, parted_s=parted, after_parting=tuple(after), sensitivity=felt)


def _until(parted: float, solution: Solution) -> Changes | None:
    """The figures of the motion before the sequences part; None of a motion from time stepping."""
    trajectory, settings = solution.trajectory, solution.settings
    if trajectory is None:
        return None
    figures = _compared(solution_figures(solution.system, settings, trajectory.until(parted), solution.filtered))
    shares = figures["contact_share"]
    assert isinstance(shares, dict)
    figures["contact_share"] = {name: share * parted / solution.end for name, share in shares.items()}  # of the whole
    return figures


def _after_parting(
    first: Solution, early: Changes | None, windows: Sequence[Changes], derived: DerivedFigures
) -> Iterator[str]:
    """``figure.name`` of what the motion after the parting can change.

    Parameters
    ----------
    early : the figures of the motion before.
    windows : those of equal parts of the motion after; an extreme before has to exceed them by their spread.
    """
    known = static_figures(first.system)
    for name, value in _compared(first.figures).items():
        if name in known:
            continue
        for place, whole in _places(value):
            if early is not None:
                part, *later = (dict(_places(figures[name]))[place] for figures in (early, *windows))
                sign = -1.0 if name.startswith("min_") else 1.0
                highest, lowest = max(sign * x for x in later), min(sign * x for x in later)
                exceeded = name not in COUNTED and 2.0 * highest - lowest > sign * whole
                if not exceeded and abs(whole - part) <= SAME_VALUE * max(abs(whole), abs(part)):
                    continue
            yield f"{name}.{place}" if place else name
    lines: Changes = {"spectral_lines": {" ".join(key): 0.0 for key in derived.spectra}}
    taken = {name: value for name, value in derived.reported().items() if not name.startswith("line_")}
    for name, value in (lines | taken).items():
        yield from (f"{name}.{place}" for place, _ in _places(value))


def resting(probe: str, quantity: str, figures: Mapping[str, Any]) -> bool:
    """Whether a quantity of a probe is 0 but for round-off, of which lines and root mean squares say nothing."""
    peak = {"displacement": "peak_displacement_m", MAIN_QUANTITY: "peak_acceleration_g"}.get(quantity)
    return peak is not None and figures[peak].get(probe) == 0.0


def _places(value: dict[str, float] | float) -> list[tuple[str, float]]:
    return list(value.items()) if isinstance(value, dict) else [("", value)]


def _with_lines(derived: DerivedFigures, changes: Changes) -> tuple[Changes, dict[SpectrumKey, tuple[float, ...]]]:
    """The changes with those of lines by spectrum, and those of each line apart."""
    apart = ("line_amplitude", "line_frequency")
    each = {name: value for name, value in changes.items() if name in apart and isinstance(value, dict)}
    lines, largest = line_changes(derived.spectra, each)
    kept = {name: value for name, value in changes.items() if name not in apart}
    return {**kept, "spectral_lines": largest}, lines


def solve_exactly(
    system: StructuralSystem,
    settings: Run,
    work: Work,
    stop: Callable[[], bool],
) -> Solution | None:
    """The figures of a finer model; None where its march is interrupted.

    Parameters
    ----------
    work : of the first model, which bounds that of this one.
    stop : see `simulate`.
    """
    trajectory = march_again(system, settings, settings.duration, work, stop)
    if trajectory.outcome.interrupted:
        return None
    events = ContactEvents.of(trajectory, len(system.snubbers))
    behind = behind_filter(system, settings, trajectory)
    figures = solution_figures(system, settings, trajectory, behind)
    return Solution(system, settings, figures, events, trajectory, filtered=behind)


def behind_filter(system: StructuralSystem, settings: Run, trajectory: Trajectory | None) -> FilteredMotion | None:
    """Accelerations behind the filter of a run, at any time of its motion; None where there is no filter or motion."""
    if settings.low_pass is None or trajectory is None:
        return None
    acceleration = Observed(trajectory.flow, system.channels.of_keys(ACCELERATION)).linear
    return filtered(trajectory, acceleration, settings.low_pass, np.zeros(0))


def _observed(system: StructuralSystem, flow: ExactFlow, behind: FilteredMotion | None) -> Observed:
    """What is searched for extremes: not the accelerations, where they are taken behind a filter."""
    channels = searched(system.channels)
    return Observed(flow, channels if behind is None else channels.without(ACCELERATION))


def march_again(
    system: StructuralSystem, settings: Run, duration: float, work: Work, stop: Callable[[], bool]
) -> Trajectory:
    """The motion of a model that is nearly that of the run; parameters as of `solve_exactly`."""
    flow = exact_flow(system, duration, settings.most_contact_states, memory=settings.memory)
    return simulate(
        flow, system.initial_state, max_events=4 * work.events + 1000, stop=stop,
        max_evaluations=10 * work.evaluations + 1_000_000,
    )  # fmt: skip


def solution_figures(
    system: StructuralSystem,
    settings: Run,
    trajectory: Trajectory,
    behind: FilteredMotion | None = None,
) -> dict[str, Any]:
    """The figures of a motion.

    Parameters
    ----------
    behind : the accelerations of the same motion, or of a longer one, behind the filter of `run.low_pass`.
    """
    extremes = extremes_of(trajectory, _observed(system, trajectory.flow, behind))
    if behind is not None:
        extremes[ACCELERATION] = behind.extremes(0.0, trajectory.end)
    _, lowest, _, highest = extremes[DISPLACEMENT]
    size = deflection_size(system, trajectory.states_at(np.sort([lowest[0], highest[0]])))
    figures = motion_figures(system, extremes, trajectory.contact_share(), _closings(trajectory), size)
    return {**figures, **static_figures(system)}


def with_convergence(result: RunResult, checked: Convergence) -> RunResult:
    """A result whose histories, and whose outcome, say which of its peaks do not converge."""

    def change(figure: str, name: str) -> float | None:
        changes = checked.changes.get(figure, {})
        return changes.get(name) if isinstance(changes, dict) else changes

    probes = {
        name: changed(
            probe,
            displacement_change=change("peak_displacement_m", name),
            acceleration_change=change("peak_acceleration_g", name),
            displacement_after_parting=f"peak_displacement_m.{name}" in checked.after_parting,
            acceleration_after_parting=f"peak_acceleration_g.{name}" in checked.after_parting,
        )
        for name, probe in result.probes.items()
    }
    snubbers = {
        name: changed(
            snubber,
            force_change=change("peak_force_n", name),
            force_after_parting=f"peak_force_n.{name}" in checked.after_parting,
        )
        for name, snubber in result.snubbers.items()
    }
    spectra = {
        key: changed(
            s,
            rms_change=change("rms_acceleration_g" if key[1] == MAIN_QUANTITY else "rms_displacement_m", key[0]),
            lines=tuple(
                replace(line, relative_change=x)
                for line, x in zip(s.lines, checked.lines.get(key, [None] * len(s.lines)), strict=True)
            ),
        )
        for key, s in result.spectra.items()
    }
    outputs = {
        name: changed(
            output,
            value_change=change("peak_output", name),
            value_after_parting=f"peak_output.{name}" in checked.after_parting,
        )
        for name, output in result.outputs.items()
    }
    result = changed(result, probes=probes, snubbers=snubbers, spectra=spectra, outputs=outputs)
    parted = [_parted(checked)] if checked.after_parting else []
    if not checked.doubtful:
        return changed(result, outcome=parted[0]) if parted else result
    sizes = {name: change(*name.partition(".")[::2]) or 0.0 for name in checked.doubtful}
    worst = sorted(sizes, key=lambda name: -sizes[name])
    automatic = result.scenario.reduction is None and checked.parted_s == math.inf
    worthless = automatic and checked.largest_displacement_change > WORTHLESS
    code = OutcomeCode.FIGURES_WORTHLESS if worthless else OutcomeCode.FIGURES_DOUBTFUL
    outcome = Outcome.of(
        code, *parted, percent=100 * ALLOWED_CHANGE,
        figures=[f"{figure_in_words(name)} by {100 * sizes[name]:.2g} %" for name in worst],
        remedy=_remedy(result, checked.doubtful),
        elements="twice the elements of every mesh" if result.scenario.has_mesh else "",
    )  # fmt: skip
    return changed(result, outcome=outcome)


def _parted(checked: Convergence) -> Outcome:
    """Which figures depend on the motion after the sequences of contacts part, and why they part."""
    felt = checked.sensitivity
    figures = list(dict.fromkeys(figure_in_words(name.partition(".")[0]) for name in checked.after_parting))
    if felt.sensitive:
        times = {"small_s": felt.small_s, "round_off_s": felt.round_off_s}
        times = {name: time for name, time in times.items() if math.isfinite(time)}
        return Outcome.of(OutcomeCode.MOTION_SENSITIVE, time=checked.parted_s, figures=figures, **times)
    return Outcome.of(OutcomeCode.CONTACTS_PART, time=checked.parted_s, figures=figures)


def _remedy(result: RunResult, doubtful: Sequence[str]) -> str:
    """What makes the doubtful figures converge."""
    accelerations = [name for name in doubtful if name.startswith("peak_acceleration_g")]
    remedies = []
    if len(accelerations) < len(doubtful):
        remedies.append("raise reduction.modes" + (" and the number of elements" if result.scenario.has_mesh else ""))
    if accelerations:
        dashpot = any(snubber.dashpot for snubber in result.snubbers.values())
        contact = ", give the structure a point mass at the contact, or leave out the contact's dashpot"
        remedies.append(
            f"for accelerations give the band of the accelerometer (run.low_pass: 2 kHz){contact if dashpot else ''}"
        )
    return "; ".join(remedies)


def _closings(trajectory: Trajectory) -> Any:
    count = trajectory.flow.system.contacts.count
    return np.bincount(trajectory.event_contact[trajectory.event_closing], minlength=count)


def _statistical(first: Solution, early: Changes, finer: Changes, *after: Sequence[Changes]) -> tuple[Changes, Changes]:
    """Changes before the sequences part and of means after it, the larger of the two; and the scatter of the latter.

    Parameters
    ----------
    early, finer : the figures of both models before the sequences part.
    after : of both models those of equal parts of the motion that follows.
    """
    changes = _changes([early], [finer], whole=_compared(first.figures))
    means, scatter = _changes(*after), _changes(*after, scatter=True)
    return _larger(changes, means), scatter


def _windows(solution: Solution, begin: float, end: float) -> Iterator[Changes]:
    """The values of equal parts of a motion. None of a motion from time stepping.

    Extremes are those of the continuous motion: a force that a dashpot or a stiff stop makes for an instant lies
    between samples, and chance would decide which part has it.
    """
    system, trajectory, behind = solution.system, solution.trajectory, solution.filtered
    if trajectory is None:
        return
    observed, closing = _observed(system, trajectory.flow, behind), trajectory.event_closing
    edges = np.linspace(begin, end, WINDOWS + 1).tolist()
    for first, last in pairwise(edges):
        motion = trajectory.between(first, last)
        extremes = extremes_of(motion, observed)
        if behind is not None:
            extremes[ACCELERATION] = behind.extremes(first, last)
        inside = closing & (trajectory.event_time >= motion.time[0]) & (trajectory.event_time < motion.end)
        closings = np.bincount(trajectory.event_contact[inside], minlength=motion.flow.system.contacts.count)
        yield _compared(motion_figures(system, extremes, motion.contact_share(), closings))


def _compared(figures: Mapping[str, Any]) -> Changes:
    """Figures as numbers or numbers by name; natural frequencies by their number."""
    compared: Changes = {}
    for name, value in figures.items():
        if isinstance(value, Sequence):
            compared[name] = {str(k): float(x) for k, x in enumerate(value[:FREQUENCIES], 1)}
        else:
            compared[name] = dict(value) if isinstance(value, Mapping) else float(value)
    return compared


def _of_modes(figures: Mapping[str, Any], modes: int) -> dict[str, Any]:
    """The figures without the frequencies that static vectors add, which are not those of the structure."""
    return {name: value[:modes] if isinstance(value, Sequence) else value for name, value in figures.items()}


def _no_changes(figures: Changes) -> Changes:
    return {name: dict.fromkeys(value, 0.0) if isinstance(value, dict) else 0.0 for name, value in figures.items()}


def _changes(
    first: Sequence[Changes], second: Sequence[Changes], *, scatter: bool = False, whole: Changes | None = None
) -> Changes:
    """Relative change of the means of figures, or two standard errors of it.

    Parameters
    ----------
    first, second : the figures of parts of two motions, or of the whole of each.
    whole : figures that the changes are relative to if they are larger.
    """
    changes: Changes = {}
    for name, value in first[0].items():
        places = list(value) if isinstance(value, dict) else [""]
        one, other = (np.array([_row(part[name], places) for part in parts]) for parts in (first, second))
        of_scale = (one, other)
        if name.startswith(("min_", "max_")):  # either may be zero
            peaks = [[_row(part[f"peak{name[3:]}"], places) for part in parts] for parts in (first, second)]
            of_scale = (np.array(peaks[0]), np.array(peaks[1]))
        scale = np.maximum(*(np.abs(x).mean(axis=0) for x in of_scale))
        if whole is not None:
            of_whole = whole[f"peak{name[3:]}" if name.startswith(("min_", "max_")) else name]
            scale = np.maximum(scale, np.abs(_row(of_whole, places)))
        if not name.endswith("_output"):  # which have units of their own
            scale = np.maximum(scale, ROUND_OFF * np.nanmax(scale, initial=0.0))
        difference = one - other
        size = np.abs(difference.mean(axis=0))
        if scatter:
            size = 2 * difference.std(axis=0, ddof=1) / math.sqrt(len(first))
        relative = np.divide(size, scale, out=np.zeros_like(size), where=size > 0)
        by_place = {place: float(x) for place, x in zip(places, relative, strict=True) if not math.isnan(x)}
        changes[name] = by_place if isinstance(value, dict) else by_place.get("", 0.0)
    return changes


def _row(value: dict[str, float] | float, places: Sequence[str]) -> list[float]:
    return [value.get(place, math.nan) for place in places] if isinstance(value, dict) else [value]


def _larger(one: Changes, other: Changes) -> Changes:
    larger = dict(one)
    for name, value in other.items():
        present = larger.get(name, value)
        if isinstance(value, dict) and isinstance(present, dict):
            larger[name] = {place: max(x, present.get(place, 0.0)) for place, x in value.items()}
        elif not isinstance(value, dict) and not isinstance(present, dict):
            larger[name] = max(value, present)
    return larger


def _doubtful(changes: Changes, scatter: Changes) -> Iterator[str]:
    """``figure.name`` of the figures that change by more than is allowed, and than their scatter explains."""
    for name, value in changes.items():
        explained = scatter.get(name, 0.0)
        for place, change in value.items() if isinstance(value, dict) else [("", value)]:
            chance = explained.get(place, 0.0) if isinstance(explained, dict) else explained
            if change > ALLOWED_CHANGE + chance:
                yield f"{name}.{place}" if place else name
