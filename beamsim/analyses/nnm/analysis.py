"""``beamsim nnm``: a nonlinear normal mode followed in stiffness, energy or frequency, with all it meets."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.interruption import Stop, never
from beamsim.analyses.nnm.full_period import FreePath, follow_free
from beamsim.analyses.nnm.multiple_scales import (
    compare_expansion,
    exact_points,
    expansion_path,
    modes_of,
    nothing_near,
)
from beamsim.analyses.nnm.orbits import (
    brake_branch,
    free_branch,
    mode_shape,
    orbit_motion,
    special_points,
)
from beamsim.analyses.nnm.paths import Followed, ModePath, alike, mode_path
from beamsim.analyses.nnm.phase_resonance import hold_mode, phase_resonance_summary
from beamsim.analyses.nnm.relaxed import compare_relaxed
from beamsim.analyses.nnm.result import (
    ExpansionComparison,
    ModeBranch,
    NormalModeResult,
    PhaseResonance,
    RelaxedComparison,
)
from beamsim.analyses.nnm.summary import expansion_summary, full_period_summary, nnm_summary, relaxed_summary
from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.errors import Problem, ScenarioError
from beamsim.orbits.continuation import INTERRUPTED, Settings, solve_at
from beamsim.orbits.relaxed_minimisation import CountedFamily
from beamsim.orbits.reversible import linear_mode
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.scenario.excitation import NoExcitation
from beamsim.scenario.nnm_method import FullPeriodMethod, ThesisMethod
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

Progress = Callable[[float], None]

COMPARISONS = ("multiple_scales", "thesis")


def conservative_system(scenario: Scenario) -> StructuralSystem:
    """The scenario's structure without excitation, damping and dashpots.

    Where the excitation is to hold the mode, the model keeps the coordinates that were made for it.
    """
    holds = scenario.nnm is not None and scenario.nnm.phase_resonance is not None
    excitation = scenario.excitation if holds else NoExcitation()
    system = build_system(scenario.model_copy(update={"run": None, "excitation": excitation}))
    dynamics = system.dynamics
    contacts = dynamics.contacts
    none = np.zeros_like(contacts.dashpot)
    undamped = replace(
        dynamics,
        damping=np.zeros_like(dynamics.damping),
        contacts=replace(contacts, dashpot=none, no_tension=np.zeros(contacts.count, dtype=bool)),
    )
    return replace(system, dynamics=undamped)


def nnm(
    scenario: Scenario, progress: Progress | None = None, compare: Collection[str] = (), stop: Stop = never
) -> NormalModeResult:
    """Follow the nonlinear normal mode that a scenario asks for.

    Parameters
    ----------
    scenario : with a section ``nnm``.
    progress : is told the share of the path that is done.
    compare : other methods to lay beside it: any of :data:`COMPARISONS`.
    stop : asked after every point; once it says so, the result holds what there is, and its status "interrupted".

    Raises
    ------
    ScenarioError
        Where the scenario asks for no mode, or for one that doesn't exist.
    """
    begin = clock.perf_counter()
    if scenario.nnm is None:
        raise ScenarioError(Problem("nnm", "is missing", "add for example `nnm: {mode: 1}`"))
    _refuse_comparisons(scenario, compare)
    system = conservative_system(scenario)
    job = mode_path(scenario, system)
    work = _followed(scenario, system, job, compare, progress, stop)
    followed, free = work.followed, work.free
    branches = _branches(system, job, followed, free)
    shown, point = _shown(branches)
    branch = branches[shown]
    state = np.concatenate([branch.coordinates[point], branch.coordinate_velocities[point]])
    motion = orbit_motion(system, work.flow_of(shown, point), state, 1.0 / float(branch.frequency_hz[point]))
    held = None
    if scenario.nnm.phase_resonance is not None and work.goes_on("nnm.phase_resonance", stop):
        held = hold_mode(
            scenario, followed.orbits, followed.points, alike=alike(system), progress=progress, stop=stop
        )  # fmt: skip
    status = _status(work, held)
    summary = nnm_summary(
        job, branches, followed.jumps, status, work.processor_time_s, followed.orbits.omega[job.mode] / (2 * np.pi),
        motion,
    )  # fmt: skip
    if free is not None:
        summary["full_period"] = full_period_summary(branches, free.differences)
    if work.expansion is not None:
        summary["multiple_scales"] = expansion_summary(work.expansion)
    if work.relaxed is not None:
        summary["thesis"] = relaxed_summary(work.relaxed)
    if held is not None:
        summary["phase_resonance"] = phase_resonance_summary(held)
    return NormalModeResult(
        scenario=scenario,
        mode=job.mode + 1,
        parameter=job.parameter,
        method=scenario.nnm.solver.kind,
        outcome=COMPLETE if status == "complete" else Outcome.of(OutcomeCode.STOPPED, text=status),
        branches=branches,
        jumps=followed.jumps,
        stations=system.stations,
        linear_shape=mode_shape(system.deflection, followed.orbits.vectors[:, job.mode], motion.at_rest[0]),
        motion=motion,
        motion_branch=shown,
        motion_point=point,
        modes=system.modes,
        phase_resonance=held,
        half_period_difference=None if free is None else free.differences,
        expansion=work.expansion,
        relaxed=work.relaxed,
        summary=summary,
        warnings=(*scenario.warnings, *system.warnings),
        wall_time_s=clock.perf_counter() - begin,
    )


@dataclass
class _Work:
    """What the methods asked for have found."""

    followed: Followed
    processor_time_s: float  # of the exact motions
    free: FreePath | None = None
    expansion: ExpansionComparison | None = None
    relaxed: RelaxedComparison | None = None
    relaxing: bool = False  # whether the thesis's method is what was asked for, not a comparison
    left_out: list[str] = field(default_factory=list)  # what was not begun any more

    def goes_on(self, to: str, stop: Stop) -> bool:
        """Whether it is not time to end; what would have come is noted where it is."""
        if stop():
            self.left_out.append(to)
            return False
        return True

    def flow_of(self, branch: int, point: int) -> Any:
        """The flow of a point of the result's branches."""
        if self.free is None:
            return self.followed.points[point].data.flow
        tongues = len(self.followed.tongues)
        points = self.free.points if branch == 0 else self.free.branches[branch - 1 - tongues].points
        return points[point].data.flow


def _refuse_comparisons(scenario: Scenario, compare: Collection[str]) -> None:
    assert scenario.nnm is not None
    for name in compare:
        if name not in COMPARISONS:
            raise ValueError(f"no comparison with {name}; there are {', '.join(COMPARISONS)}")
        if scenario.nnm.continue_in.kind != "stiffness_factor":
            raise ScenarioError(
                Problem(
                    "nnm.continue_in.kind",
                    f"= {scenario.nnm.continue_in.kind}, but {name} goes in the stiffness factor",
                    "use continue_in: {kind: stiffness_factor, from: 0, to: 1}, or leave out the comparison",
                )
            )
    if scenario.nnm.solver.kind == "multiple_scales" and "thesis" in compare:
        raise ScenarioError(
            Problem("nnm.method", "= multiple_scales follows no backbone to lay the thesis's method beside",
                    "use method: shooting; both can be compared with it")
        )  # fmt: skip


def _followed(
    scenario: Scenario,
    system: StructuralSystem,
    job: ModePath,
    compare: Collection[str],
    progress: Progress | None,
    stop: Stop,
) -> _Work:
    """Exact motions first, then what is to be laid beside them."""
    assert scenario.nnm is not None
    solver = scenario.nnm.solver
    begin = clock.process_time()
    if solver.kind == "multiple_scales":
        return _near_expansion(scenario, system, job)
    relaxing = solver if isinstance(solver, ThesisMethod) else ThesisMethod() if "thesis" in compare else None
    counted = CountedFamily(job.family)
    work = _Work((job if relaxing is None else replace(job, family=counted)).follow(progress, stop), 0.0)
    work.relaxing = isinstance(solver, ThesisMethod)
    if isinstance(solver, FullPeriodMethod) and work.goes_on("full-period shooting", stop):
        work.free = follow_free(job, work.followed, solver, progress, stop)
    work.processor_time_s = clock.process_time() - begin
    if relaxing is not None and work.goes_on("the thesis's method", stop):
        work.relaxed = compare_relaxed(
            job, work.followed, counted, work.processor_time_s, relaxing, system.deflection, progress, stop
        )  # fmt: skip
    if "multiple_scales" in compare and work.goes_on("the expansion", stop):
        path = expansion_path(system, job.mode + 1, scenario.nnm.energy, largest=job.last)
        work.expansion = compare_expansion(system, path, modes_of(system, path, *exact_points(system, path)))
    return work


def _near_expansion(scenario: Scenario, system: StructuralSystem, job: ModePath) -> _Work:
    """The expansion at small factors and the exact motions beside it, from the linear mode on."""
    assert scenario.nnm is not None
    path = expansion_path(system, job.mode + 1, scenario.nnm.energy, largest=job.last)
    begin = clock.process_time()
    orbits, found = exact_points(system, path)
    linear = solve_at(orbits, linear_mode(orbits, job.mode, 0.0, job.away_from), Settings(), 0.0)
    rising = sorted((p for p in found if p is not None), key=lambda p: p.parameter)
    points = [p for p in (linear, *rising) if p is not None]
    if not points:
        raise ScenarioError(Problem("nnm.mode", f"= {job.mode + 1} gives no motion to begin with", "ask for another"))
    small = path.factor <= path.small  # beyond, that no exact motion is near is no surprise
    missed = [float(f) for f, p, s in zip(path.factor, found, small, strict=True) if p is None and s]
    status = "complete" if rising else nothing_near(path)
    if rising and missed:
        status = (
            f"no exact motion was found near the expansion at the factors {', '.join(f'{f:.4g}' for f in missed)}: "
            "tongues of internal resonance; the others are compared"
        )
    spent = clock.process_time() - begin
    comparison = compare_expansion(system, path, modes_of(system, path, orbits, found))
    return _Work(Followed(orbits, points, status), spent, expansion=comparison)


def _branches(
    system: StructuralSystem, job: ModePath, followed: Followed, free: FreePath | None
) -> tuple[ModeBranch, ...]:
    special = special_points(system, job, followed, (jump.start for jump in followed.jumps))
    orbits = followed.orbits
    if free is None:
        backbone = brake_branch(
            system, job, orbits, followed.points, followed.status, kind="backbone", special=special
        )  # fmt: skip
    else:
        special += tuple(
            OrbitEvent("symmetry_breaking", job.shown(b.parameter), 1.0 / orbits.split(b.point.u)[1])
            for b in free.breakings
        )
        backbone = free_branch(
            system, job, orbits, free.orbits, free.points, free.status, turned=False, kind="backbone", special=special
        )  # fmt: skip
    tongues = (
        brake_branch(system, job, orbits, t.points, t.status, kind="tongue", mode=t.mode + 1, ratio=t.ratio)
        for t in followed.tongues
    )
    wandering = () if free is None else (
        free_branch(
            system, job, orbits, b.orbits, b.points, b.status, turned=True, kind="never_at_rest",
            mode=b.origin.mode + 1, ratio=b.origin.ratio,
        )
        for b in free.branches
    )  # fmt: skip
    return backbone, *tongues, *wandering


def _shown(branches: tuple[ModeBranch, ...]) -> tuple[int, int]:
    """Branch and point of the motion to be shown: the backbone's last, or the furthest from rest where there is one."""
    for k, branch in enumerate(branches):
        if branch.kind == "never_at_rest":
            return k, int(np.argmax(branch.least_kinetic))
    return 0, branches[0].parameter.size - 1


def _status(work: _Work, held: PhaseResonance | None) -> str:
    """ "complete", or why the first of the methods that didn't end well didn't."""
    ends = [work.followed.status]
    if work.left_out:
        ends.append(f"{INTERRUPTED} before {', '.join(work.left_out)}")
    if work.free is not None:
        ends.append(work.free.status)
    if work.relaxed is not None and (work.relaxing or work.relaxed.status.startswith(INTERRUPTED)):
        ends.append(work.relaxed.status)
    if held is not None:
        ends.append("complete" if held.complete else held.status)
    return next((end for end in ends if not end.startswith("complete")), "complete")
