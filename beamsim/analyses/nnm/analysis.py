"""``beamsim nnm``: nonlinear normal modes in stiffness factor, energy or frequency, with tongues and bifurcations."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from beamsim.analyses.nnm.comparisons import (
    ExpansionComparison,
    RelaxedComparison,
    compare_expansion,
    compare_relaxed,
    exact_points,
    expansion_path,
)
from beamsim.analyses.nnm.full_period import difference, follow_full_period
from beamsim.analyses.nnm.layouts import JUMPS
from beamsim.analyses.nnm.orbits import ModeBranch, mode_branch, mode_datasets, orbit_motion, special_points
from beamsim.analyses.nnm.paths import UNITS, ModeBranches, ModePath, mode_path
from beamsim.analyses.nnm.phase_resonance import PhaseResonanceLevels, excite_mode
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.analyses.nnm.summary import expansion_summary, nnm_summary, phase_resonance_summary, relaxed_summary
from beamsim.errors import ScenarioError
from beamsim.flow.compiled import processor_time
from beamsim.labelled import Dataset
from beamsim.orbits.branch import BranchPoint, OrbitBranch, with_failed_searches
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.free_orbits import linear_mode
from beamsim.outcomes import (
    COMPLETE,
    Outcome,
    OutcomeKind,
    Progress,
    Where,
    combined,
    interruption,
    stop_requested,
)
from beamsim.responses.orbit_energies import check_balance
from beamsim.responses.points import TargetPoint, with_points_at
from beamsim.results.branch import SpecialRow
from beamsim.results.result import check_reduction, forces_beyond_tables
from beamsim.scenario import Scenario
from beamsim.scenario.connections import SHOCK_ARRESTOR
from beamsim.scenario.excitation import NoExcitation
from beamsim.scenario.sweep import FullPeriodMethod, NonlinearMode, RelaxedMinimisationMethod
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

RequestedPoint = tuple[int, TargetPoint, BranchPoint]  # index of the branch, the request, and the point

COMPARISONS = ("multiple_scales", "relaxed_minimisation")


def conservative_system(scenario: Scenario) -> StructuralSystem:
    """The scenario's structure without excitation, damping and dashpots.

    If the excitation is to sustain the mode (phase resonance), the model keeps the coordinates made for the excitation.
    """
    holds = scenario.nnm is not None and scenario.nnm.phase_resonance is not None
    excitation = scenario.excitation if holds else NoExcitation()
    system = build_system(scenario.model_copy(update={"run": None, "excitation": excitation}))
    dynamics = system.dynamics
    for name, law in zip(system.contact_names, dynamics.contacts.laws, strict=True):
        if law.latches:
            message = f"looks for periodic motions, but {name} has a latch, which never opens again"
            raise ScenarioError.at("nnm", message, f"leave out latch of {name}")
        if law.undamped() is None:
            key = next((stop.memory for stop in scenario.all_snubbers if stop.name == name), "maxwell")
            what = f"the friction contact {name}" if law.slides_or_yields and key == "maxwell" else f"{key} of {name}"
            arrestors = {at.item.name for at in scenario.nonlinear_springs if at.item.kind == SHOCK_ARRESTOR}
            what = f"the shock arrestor {name}" if name in arrestors else what
            raise ScenarioError.at(
                "nnm",
                f"needs contacts without losses, but {name} has friction or internal states",
                f"leave out {what}",
            )
    undamped = replace(
        dynamics,
        damping=np.zeros_like(dynamics.damping),
        contacts=dynamics.contacts.undamped(),
    )
    return replace(system, dynamics=undamped)


def nnm(scenario: Scenario, progress: Progress = None, compare: Collection[str] = ()) -> NormalModeResult:
    """Trace the nonlinear normal mode that a scenario requests.

    Parameters
    ----------
    scenario : scenario with a section ``nnm``.
    progress : called with the completed fraction of the path.
    compare : other methods to compare with it: any of :data:`COMPARISONS`.

    Returns
    -------
    NormalModeResult
        Branches, one motion in time, and the comparisons.

    Raises
    ------
    ScenarioError
        If the scenario requests no mode, one that does not exist, or one that cannot be traced or compared.
    NotTrustedError
        If full-period shooting finds no motion to start from.
    ValueError
        If ``compare`` names another method.
    """
    begin = clock.perf_counter()
    settings = _settings(scenario, compare)
    system = conservative_system(scenario)
    job = mode_path(system)
    work = _solve_path(job, compare, progress)
    followed = work.branches
    special, failed, given_up = special_points(job, followed)
    if given_up and not followed.backbone.outcome.interrupted:
        work.skipped_steps.append("the search for special points")
    branches = _branches(job, work)
    motion = _motion(system, branches, followed.problem.vectors[:, job.mode])
    held = settings.phase_resonance is not None and work.continues("nnm.phase_resonance")
    resonance = excite_mode(system, followed.problem, followed.backbone.points, progress) if held else None
    compared = {"multiple_scales": work.expansion, "relaxed_minimisation": work.relaxed}
    datasets = mode_datasets(job, branches, _special(job, work, special)) | _jumps(job, followed) | {"motion": motion}
    datasets |= {} if resonance is None else resonance.datasets
    datasets |= {name: of.dataset for name, of in compared.items() if of is not None}
    outcome = job.outcome_in_report_unit(with_failed_searches(_outcome(work, resonance), failed))
    forces = {name: of.values for name, of in motion.by_label("force").items()}
    result = NormalModeResult(
        scenario=scenario,
        outcome=check_reduction(check_balance(outcome, datasets["points"]), scenario, system.modes),
        datasets={"modes": system.modes} | datasets,
        warnings=(*scenario.warnings, *system.warnings, *forces_beyond_tables(scenario, [forces])),
        wall_time_s=clock.perf_counter() - begin,
    )
    return result.with_summary(
        **nnm_summary(result),
        mode=job.mode + 1,
        linear_frequency_hz=float(followed.problem.omega[job.mode] / (2 * np.pi)),
        processor_time_s=work.processor_time_s,
        requested_points=_requested_points(branches, work) or None,
        multiple_scales=None if work.expansion is None else expansion_summary(work.expansion),
        relaxed_minimisation=None if work.relaxed is None else relaxed_summary(work.relaxed),
        phase_resonance=None if resonance is None else phase_resonance_summary(resonance),
    )


@dataclass
class _MethodResults:
    """Results of the requested methods."""

    branches: ModeBranches
    processor_time_s: float  # of the exact motions
    full_period: ModeBranches | None = None
    expansion: ExpansionComparison | None = None
    relaxed: RelaxedComparison | None = None
    relaxed_is_method: bool = False  # True if relaxed minimisation is the method itself, not a comparison
    skipped_steps: list[str] = field(default_factory=list)  # steps skipped by an interruption
    requested_points: list[RequestedPoint] = field(default_factory=list)

    def continues(self, step: str) -> bool:
        """True if the next step should run; after an interruption, record it as skipped."""
        if stop_requested():
            self.skipped_steps.append(step)
            return False
        return True


def _settings(scenario: Scenario, compare: Collection[str]) -> NonlinearMode:
    """Settings, checked for the requested comparisons; raises as `nnm`."""
    settings = scenario.nnm
    if settings is None:
        raise ScenarioError.at("nnm", "is missing", "add for example `nnm: {mode: 1}`")
    for name in compare:
        if name not in COMPARISONS:
            raise ValueError(f"unknown comparison {name}; known are {', '.join(COMPARISONS)}")
        if settings.continue_in.kind != "stiffness_factor":
            raise ScenarioError.at(
                "nnm.continue_in.kind",
                f"= {settings.continue_in.kind}, but {name} needs the stiffness factor",
                "use continue_in: {kind: stiffness_factor, from: 0, to: 1}, or leave out the comparison",
            )
    if settings.method.kind == "multiple_scales" and "relaxed_minimisation" in compare:
        raise ScenarioError.at(
            "nnm.method",
            "= multiple_scales traces no backbone for the comparison with relaxed minimisation",
            "use method: shooting; both can be compared with it",
        )
    return settings


def _solve_path(job: ModePath, compare: Collection[str], progress: Progress) -> _MethodResults:
    """Compute the exact motions, then the comparisons."""
    system, solver = job.system, job.settings.method
    begin = processor_time()
    if solver.kind == "multiple_scales":
        return _near_expansion(job)
    followed, requested = _with_points(job, job.follow(progress))
    work = _MethodResults(followed, 0.0, requested_points=requested)
    work.relaxed_is_method = isinstance(solver, RelaxedMinimisationMethod)
    if isinstance(solver, FullPeriodMethod) and work.continues("full-period shooting"):
        work.full_period = follow_full_period(job, work.branches, solver, progress)
        if solver.branches and work.full_period.backbone.outcome.complete:
            work.continues("the end of the search for non-brake orbits")
    work.processor_time_s = processor_time() - begin
    if (work.relaxed_is_method or "relaxed_minimisation" in compare) and work.continues("relaxed minimisation"):
        steps = solver if isinstance(solver, RelaxedMinimisationMethod) else RelaxedMinimisationMethod()
        work.relaxed = compare_relaxed(job, work.branches, work.processor_time_s, steps, progress)
    if "multiple_scales" in compare and work.continues("the expansion"):
        path = expansion_path(system, job.mode + 1, job.settings.energy, largest=job.last)
        work.expansion = compare_expansion(system, path, exact_points(system, path, work.branches))
    return work


def _with_points(job: ModePath, followed: ModeBranches) -> tuple[ModeBranches, list[RequestedPoint]]:
    """Add points at the requested energies and frequencies; the outcome names those that no branch passes."""
    settings = job.settings
    if not (settings.energies or settings.frequencies):
        return followed, []
    problem = followed.problem
    numbers: dict[str, Callable[[BranchPoint], float]] = {
        "energy": lambda p: float(p.data.energy), "frequency": lambda p: 1.0 / problem.split(p.u)[1],
    }  # fmt: skip
    wanted: list[TargetPoint] = []
    for quantity, values in (("energy", settings.energies), ("frequency", settings.frequencies)):
        for value in values:
            unknown = job.to_unknown(float(value)) if quantity == problem.parameter else None
            wanted.append(TargetPoint(quantity, float(value), numbers[quantity], unknown))
    branches: list[OrbitBranch] = []
    requested: list[RequestedPoint] = []
    for index, branch in enumerate((followed.backbone, *followed.tongues)):
        more, passed = with_points_at(branch, wanted, followed.gaps if index == 0 else ())
        branches.append(more)
        requested += [(index, each, point) for each, point in passed]
    outcome = branches[0].outcome
    for quantity, plural, unit in (("energy", "energies", "J"), ("frequency", "frequencies", "Hz")):
        missed = [w.value for w in wanted if w.quantity == quantity and all(w is not each for _, each, _ in requested)]
        if missed:
            part = Outcome.of(
                OutcomeKind.INCOMPLETE, "values_not_passed",
                f"no branch passes the requested {plural}:", at=Where(missed, unit),
                remedy="extend the range, or request values that the backbone passes (summary: start, end, jumps)",
            )  # fmt: skip
            outcome = (
                outcome.copy_with(part)
                if not outcome.complete
                else part.copy_with(*((outcome,) if outcome.sub_outcomes else ()))
            )
    backbone = replace(branches[0], outcome=outcome)
    return replace(followed, backbone=backbone, tongues=tuple(branches[1:])), requested


def _requested_points(branches: Sequence[ModeBranch], work: _MethodResults) -> list[dict[str, Any]]:
    """Requested points as plain values."""
    rows = []
    followed = (work.branches.backbone, *work.branches.tongues)
    for index, asked, passed in work.requested_points:
        branch = branches[index]
        k = next(i for i, point in enumerate(followed[index].points) if point is passed)
        if k < branch.parameter.size:  # a full-period path that ended early has fewer points
            rows.append(
                {
                    "quantity": asked.quantity, "value": asked.value, "branch": index, "point": k + 1,
                    "parameter": float(branch.parameter[k]), "frequency_hz": float(branch.frequency_hz[k]),
                    "energy_j": float(branch.energy[k]), "share": float(branch.share[k]),
                    "stable": bool(branch.stable[k]),
                }
            )  # fmt: skip
    return rows


def _near_expansion(job: ModePath) -> _MethodResults:
    """Expansion at small factors, with the exact motions for comparison."""
    system = job.system
    path = expansion_path(system, job.mode + 1, job.settings.energy, largest=job.last)
    begin = processor_time()
    orbits, exact = exact_points(system, path)
    linear = solve_at(orbits, linear_mode(orbits, job.mode, 0.0, job.away_from), Settings(), 0.0)
    rising = sorted((p for p in exact if p is not None), key=lambda p: p.parameter)
    points = [p for p in (linear, *rising) if p is not None]
    if not points:
        raise ScenarioError.at("nnm.mode", f"= {job.mode + 1} gives no motion to start from", "use another mode")
    small = path.factor <= path.small  # at larger factors an exact motion may well be far away
    missed = [float(f) for f, p, s in zip(path.factor, exact, small, strict=True) if p is None and s]
    outcome = COMPLETE
    if not rising:
        outcome = Outcome.of(
            OutcomeKind.INCOMPLETE, "nothing_near_expansion",
            f"no exact motion was found near the expansion of mode {path.mode}",
            remedy=f"use smaller factors, well below {path.reach:.3g}",
        )  # fmt: skip
    elif missed:
        outcome = Outcome.of(
            OutcomeKind.INCOMPLETE, "partly_near_expansion",
            "no exact motion was found near the expansion (tongues of internal resonance)",
            at=Where(missed, "", "factors"),
        )  # fmt: skip
    spent = processor_time() - begin
    comparison = compare_expansion(system, path, (orbits, exact))
    backbone = OrbitBranch(orbits, points, outcome, kind="backbone")
    return _MethodResults(ModeBranches(backbone), spent, expansion=comparison)


def _branches(job: ModePath, work: _MethodResults) -> list[ModeBranch]:
    """All branches, the backbone first."""
    brake, full, differences = work.branches.problem, work.full_period, None
    if full is not None:
        pairs = zip(full.backbone.points, work.branches.backbone.points, strict=False)
        differences = np.array([difference(full.backbone.problem, *pair) for pair in pairs])
    backbone, *others = (full or work.branches).all_branches
    return [mode_branch(job, brake, backbone, differences), *(mode_branch(job, brake, other) for other in others)]


def _special(job: ModePath, work: _MethodResults, special: Sequence[SpecialRow]) -> list[SpecialRow]:
    """Special points of the backbone, with the origins of non-brake orbits."""
    brake, full = work.branches.problem, work.full_period
    breakings = (
        SpecialRow("symmetry_breaking", job.in_report_unit(at.parameter), 1.0 / brake.split(at.u)[1])
        for at in (() if full is None else full.symmetry_breakings)
    )
    return [*special, *breakings]


def _jumps(job: ModePath, branches: ModeBranches) -> dict[str, Dataset]:
    """Dataset of the gaps in the backbone, by name; empty if there are none."""
    jumps = branches.jumps
    columns = {
        "start": [job.in_report_unit(jump.start) for jump in jumps],
        "end": [job.in_report_unit(jump.end) for jump in jumps],
        "mode": [jump.mode + 1 for jump in jumps],
    }
    return {"jumps": JUMPS.table(jumps, [{"unit": UNITS[job.parameter]}] * len(jumps), **columns)} if jumps else {}


def _motion(system: StructuralSystem, branches: Sequence[ModeBranch], mode: Floats) -> Dataset:
    """Motion in time for the picture, with the linear mode of coordinates (n,).

    It is the last motion of the backbone or, if a non-brake branch exists, its motion furthest from rest.
    """
    shown = next((k for k, each in enumerate(branches) if each.branch.kind == "non_brake"), 0)
    branch = branches[shown]
    point = int(np.argmax(branch.least_kinetic)) if shown else branch.parameter.size - 1
    flow, period = branch.branch.points[point].data.flow, 1.0 / float(branch.frequency_hz[point])
    return orbit_motion(system, flow, branch.states[point], period, mode, shown, point + 1)


def _outcome(work: _MethodResults, resonance: PhaseResonanceLevels | None) -> Outcome:
    """Outcome of the first method that did not end well, or energy shares at the end of the backbone."""
    ends = [work.branches.backbone.outcome]
    if work.full_period is not None:
        ends.append(work.full_period.backbone.outcome)
    if work.relaxed is not None and (work.relaxed_is_method or work.relaxed.outcome.interrupted):
        ends.append(work.relaxed.outcome)
    if resonance is not None:
        ends.append(resonance.outcome)
    if work.skipped_steps:
        ends.append(interruption(f"before {', '.join(work.skipped_steps)}"))
    outcome = combined(ends)
    backbone = work.branches.backbone.outcome
    return backbone if outcome is COMPLETE and backbone.sub_outcomes else outcome
