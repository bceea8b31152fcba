"""How much every figure of a run changes when the case is solved again with a finer model.

The finer model has half as many modes more and, where a body has a mesh, twice the elements. A figure that changes by
more than `ALLOWED_CHANGE` is doubtful: it belongs to the model and not to the structure. Motions that bounce on and on
may be so sensitive that the sequences of contacts part although both models are good. Up to there the figures are
compared as they are. What comes after is compared statistically if the excitation goes on: each figure is taken in
`WINDOWS` equal parts of the rest, and the change is that of its mean; it is doubtful if it exceeds the scatter of the
differences too.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.run.derived import DerivedFigures, Figures, OutputSamples, SpectrumKey, line_changes
from beamsim.analyses.run.figures import (
    SEEDS,
    Extremes,
    energy_extremes,
    motion_figures,
    refine_extremes,
    sampled_extremes,
    static_figures,
)
from beamsim.analyses.run.low_pass import filtered
from beamsim.analyses.run.outputs import bending_stress, energies_of_rows, exact_flow, in_every_state, output_groups
from beamsim.analyses.run.result import ALLOWED_CHANGE, MAIN_QUANTITY, RunResult, Work
from beamsim.errors import ScenarioError
from beamsim.fields import changed
from beamsim.flow.stopping import check_stop
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Run, Scenario

WORTHLESS = 0.5  # relative change of the displacements beyond which the default model is not to be used
MORE_MODES = 1.5
SAME_EVENT = 0.1  # of the mean time between a contact's closings: two events further apart are not the same
WINDOWS = 8  # parts of the motion after the sequences have parted
SAMPLES = 512  # in each of them
FREQUENCIES = 6  # natural frequencies that are compared
ROUND_OFF = 1e-9  # of the largest figure of its kind, which a smaller one is compared with
SEARCHED = (  # for their extremes
    "displacement", "acceleration", "force", "penetration", "stretch", "spring_force", "output",
)  # fmt: skip

Changes = Figures  # relative, by entry of the summary


@dataclass(frozen=True)
class Solution:
    """The figures of a model, and its motion where it is known in closed form."""

    system: StructuralSystem
    figures: Mapping[str, Any]
    end: float  # s, reached
    trajectory: Trajectory | None = None
    sampled: OutputSamples | None = None  # from time stepping


@dataclass(frozen=True)
class Convergence:
    """Relative changes of the figures of a run with a finer model."""

    changes: Changes
    doubtful: tuple[str, ...] = ()  # ``figure.name`` of those that change by more than `ALLOWED_CHANGE`
    modes: int = 0  # of the finer model; 0 where the first leaves out nothing
    parted_s: float = math.inf  # time at which the sequences of contacts part
    processor_time_s: float = 0.0
    reason: str = field(default="")  # why there is no comparison
    lines: Mapping[SpectrumKey, tuple[float, ...]] = field(default_factory=dict)  # of each line of each spectrum

    @property
    def largest_displacement_change(self) -> float:
        """Largest change of a peak displacement."""
        changes = self.changes.get("peak_displacement_m", {})
        return max(changes.values(), default=0.0) if isinstance(changes, dict) else changes

    def summary(self) -> dict[str, Any]:
        """Entries of the summary of a run."""
        model = {
            "modes": self.modes, "sequences_part_s": self.parted_s if math.isfinite(self.parted_s) else None,
            "processor_time_s": self.processor_time_s, "reason": self.reason,
        }  # fmt: skip
        return {"convergence": self.changes, "doubtful": list(self.doubtful), "convergence_model": model}


def check_convergence(
    scenario: Scenario,
    first: Solution,
    derived: DerivedFigures,
    solve: Callable[[StructuralSystem], Solution],
) -> Convergence:
    """Solve the case again with a finer model and compare the figures.

    Parameters
    ----------
    first : the solution whose figures are reported.
    derived : its spectra and statistics.
    solve : solves the finer model.
    """
    modes = first.system.modes.kept_modes
    counts = [body.mode_count for body in scenario.all_bodies.values()]
    if None not in counts and modes >= sum(count for count in counts if count is not None):
        changes, lines = _with_lines(derived, _no_changes(_compared(first.figures) | derived.reported()))
        return Convergence(changes, lines=lines)
    begin = clock.process_time()
    finer = scenario.refined(math.ceil(MORE_MODES * modes))
    try:
        second = solve(build_system(finer))
    except ScenarioError as error:
        return Convergence({}, reason="; ".join(problem.message for problem in error.problems))
    parted = math.inf
    if first.trajectory is not None and second.trajectory is not None:
        parted = parting(first.trajectory, second.trajectory, len(first.system.snubbers))
    end = min(first.end, second.end)
    scatter: Changes = {}
    if parted < end and scenario.excitation.kind != "none" and not scenario.excitation.shock:
        changes, scatter = _statistical(scenario, first, second, parted, end)
        assert first.trajectory is not None
        assert second.trajectory is not None
        parts = derived.parts(WINDOWS)
        one, other = (derived.again(s.system, s.trajectory, parts) for s in (first, second) if s.trajectory)
        check_stop()
        changes |= _changes(one, other)
        if parts > 1:
            scatter |= _with_lines(derived, _changes(one, other, scatter=True))[0]
    else:
        changes = _changes([_compared(first.figures)], [_compared(second.figures)])
        if (motion := second.trajectory or second.sampled) is not None:
            changes |= _changes([derived.reported()], derived.again(second.system, motion))
    check_stop()
    changes, lines = _with_lines(derived, changes)
    return Convergence(
        changes, tuple(_doubtful(changes, scatter)), second.system.modes.kept_modes, parted,
        clock.process_time() - begin, lines=lines,
    )  # fmt: skip


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
    seeds: Floats,
    work: Work,
    stop: Callable[[], bool],
) -> Solution:
    """The figures of a finer model.

    Parameters
    ----------
    seeds : times of the first model's extremes.
    work : of the first model, which bounds that of this one.
    stop : see `simulate`.
    """
    flow = exact_flow(system, settings.duration, settings.most_contact_states, memory=settings.memory)
    trajectory = simulate(
        flow, system.initial_state, max_events=4 * work.events + 1000, stop=stop,
        max_evaluations=10 * work.evaluations + 1_000_000,
    )  # fmt: skip
    check_stop()
    return Solution(system, solution_figures(system, settings, trajectory, seeds), trajectory.end, trajectory)


def solution_figures(system: StructuralSystem, settings: Run, trajectory: Trajectory, seeds: Floats) -> dict[str, Any]:
    """The figures of a motion; ``seeds`` are times at which extremes are likely."""
    flow = trajectory.flow
    groups = output_groups(system, flow)
    searched = {name: groups.groups[name] for name in SEARCHED if name in groups.groups}
    if system.stress is not None:
        searched["stress"] = in_every_state(bending_stress(flow, system.stress))
    if settings.low_pass is not None:
        del searched["acceleration"]
    times = np.unique(np.concatenate([seeds[seeds <= trajectory.end], np.linspace(0.0, trajectory.end, SEEDS)]))
    extremes = refine_extremes(trajectory, searched, times)
    if settings.low_pass is not None:
        _, extremes["acceleration"] = filtered(trajectory, groups.groups["acceleration"], settings.low_pass, times)
    if system.energy_outputs:
        extremes["energy"] = energy_extremes(trajectory, system.energy_outputs, groups.groups["energy"])
    figures = motion_figures(system, extremes, trajectory.contact_share(), _closings(trajectory))
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
        )
        for name, probe in result.probes.items()
    }
    snubbers = {
        name: changed(snubber, force_change=change("peak_force_n", name)) for name, snubber in result.snubbers.items()
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
        name: changed(output, value_change=change("peak_output", name)) for name, output in result.outputs.items()
    }
    result = changed(result, probes=probes, snubbers=snubbers, spectra=spectra, outputs=outputs)
    if not checked.doubtful:
        return result
    sizes = {name: change(*name.partition(".")[::2]) or 0.0 for name in checked.doubtful}
    worst = sorted(sizes, key=lambda name: -sizes[name])
    automatic = result.scenario.reduction is None and checked.parted_s == math.inf
    worthless = automatic and checked.largest_displacement_change > WORTHLESS
    code = OutcomeCode.FIGURES_WORTHLESS if worthless else OutcomeCode.FIGURES_DOUBTFUL
    outcome = Outcome.of(
        code, percent=100 * ALLOWED_CHANGE, figures=[f"{name} by {100 * sizes[name]:.2g} %" for name in worst],
        remedy=_remedy(result, checked.doubtful),
    )  # fmt: skip
    return changed(result, outcome=outcome)


def _remedy(result: RunResult, doubtful: Sequence[str]) -> str:
    """What makes the doubtful figures converge."""
    accelerations = [name for name in doubtful if name.startswith("peak_acceleration_g")]
    remedies = []
    if len(accelerations) < len(doubtful):
        remedies.append("raise reduction.modes and the number of elements")
    if accelerations:
        dashpot = any(snubber.dashpot for snubber in result.snubbers.values())
        contact = ", give the structure a point mass at the contact, or leave out the contact's dashpot"
        remedies.append(
            f"for accelerations give the band of the accelerometer (run.low_pass: 2 kHz){contact if dashpot else ''}"
        )
    return "; ".join(remedies)


def parting(first: Trajectory, second: Trajectory, snubbers: int) -> float:
    """Time at which the contact sequences of two motions part, s; infinite if they do not."""
    end = min(first.end, second.end)
    one, other = (_events(trajectory, snubbers) for trajectory in (first, second))
    closings = np.bincount(one[1], minlength=snubbers)
    apart = SAME_EVENT * end / np.maximum(closings / 2, 1.0)  # by contact
    common = min(one[0].size, other[0].size)
    same = (one[1][:common] == other[1][:common]) & (one[2][:common] == other[2][:common])
    same &= np.abs(one[0][:common] - other[0][:common]) <= apart[one[1][:common]]
    if not same.all():
        k = int(np.argmin(same))
        return float(min(one[0][k], other[0][k]))
    rest = one if one[0].size > common else other
    if rest[0].size > common and rest[0][common] < end - apart[rest[1][common]]:
        return float(rest[0][common])
    return math.inf


def _events(trajectory: Trajectory, snubbers: int) -> tuple[Floats, Any, Any]:
    of_snubber = trajectory.event_contact < snubbers
    return (
        trajectory.event_time[of_snubber], trajectory.event_contact[of_snubber], trajectory.event_phase[of_snubber],
    )  # fmt: skip


def _closings(trajectory: Trajectory) -> Any:
    count = trajectory.flow.system.contacts.count
    return np.bincount(trajectory.event_contact[trajectory.event_closing], minlength=count)


def _statistical(
    scenario: Scenario, first: Solution, second: Solution, parted: float, end: float
) -> tuple[Changes, Changes]:
    """Changes before the sequences part and of means after it, the larger of the two; and the scatter of the latter."""
    settings = scenario.run
    assert settings is not None
    before, after = [], []
    for solution in (first, second):
        assert solution.trajectory is not None
        early = solution.trajectory.until(parted)
        seeds = np.linspace(0.0, parted, SEEDS)
        before.append(_compared(solution_figures(solution.system, settings, early, seeds)))
        after.append(list(_windows(solution.system, settings, solution.trajectory, parted, end)))
    for figures in before:  # as parts of those of the whole motion
        shares = figures["contact_share"]
        figures["contact_share"] = {name: share * parted / end for name, share in shares.items()}  # type: ignore[union-attr]
    changes = _changes([before[0]], [before[1]], whole=_compared(first.figures))
    means, scatter = _changes(*after), _changes(*after, scatter=True)
    return _larger(changes, means), scatter


def _windows(
    system: StructuralSystem, settings: Run, trajectory: Trajectory, begin: float, end: float
) -> Iterator[Changes]:
    """The figures of equal parts of a motion, from samples; contact exactly."""
    times = np.linspace(begin, end, WINDOWS * SAMPLES + 1)[:-1]
    flow = trajectory.flow
    groups = output_groups(system, flow)
    values = groups.split(trajectory.sample(times, groups), flow.system.contacts.start)
    if system.stress is not None:
        values["stress"] = trajectory.sample(times, in_every_state(bending_stress(flow, system.stress)))
    if settings.low_pass is not None:
        values["acceleration"], _ = filtered(trajectory, groups.groups["acceleration"], settings.low_pass, times)
    if system.energy_outputs:
        values["energy"] = energies_of_rows(system.energy_outputs, values["energy"])
    closing = trajectory.event_closing
    bounds = np.linspace(begin, end, WINDOWS + 1)
    in_contact = np.array([time * trajectory.until(time).contact_share() for time in bounds])  # s, from the start
    shares = np.diff(in_contact, axis=0) / np.diff(bounds)[:, None]
    for k in range(WINDOWS):
        part = slice(k * SAMPLES, (k + 1) * SAMPLES)
        inside = closing & (trajectory.event_time >= bounds[k]) & (trajectory.event_time < bounds[k + 1])
        closings = np.bincount(trajectory.event_contact[inside], minlength=shares.shape[1])
        extremes: Extremes = {name: sampled_extremes(times[part], x[part]) for name, x in values.items()}
        yield _compared(motion_figures(system, extremes, shares[k], closings))


def _compared(figures: Mapping[str, Any]) -> Changes:
    """Figures as numbers or numbers by name; natural frequencies by their number."""
    compared: Changes = {}
    for name, value in figures.items():
        if isinstance(value, Sequence):
            compared[name] = {str(k): float(x) for k, x in enumerate(value[:FREQUENCIES], 1)}
        else:
            compared[name] = dict(value) if isinstance(value, Mapping) else float(value)
    return compared


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
