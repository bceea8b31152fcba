"""Relaxed minimisation (Hazim 2010) beside exact shooting: range, accuracy and cost."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.nnm.paths import ModeBranches, ModePath
from beamsim.analyses.nnm.result import RelaxedComparison
from beamsim.flow.compiled import processor_time
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.expansions.relaxed import RelaxedStep, relaxed_path
from beamsim.orbits.free_orbits import BrakeOrbits
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Progress, Stop, Where, interruption, never, until
from beamsim.scenario.sweep import RelaxedMinimisationMethod
from beamsim.typing import Floats

SAME = 1e-6  # relative distance of two shapes that are one motion's
FAR = 0.25  # relative distance between neighbouring steps' exact motions that is no continuation


def compare_relaxed(
    job: ModePath,
    branches: ModeBranches,
    shooting_time_s: float,
    settings: RelaxedMinimisationMethod,
    field: Floats,
    progress: Progress = None,
    stop: Stop = never,
) -> RelaxedComparison:
    """Take steps of relaxed minimisation along a backbone that shooting has followed, and compare.

    Parameters
    ----------
    job, branches : the backbone in the stiffness factor.
    shooting_time_s : processor time of shooting so far, s.
    settings : steps, tolerance and iterations.
    field : (nx, n) deflection at the stations for a unit of each coordinate.
    progress : called with the share of the steps that is done.
    stop : asked after every step.

    Returns
    -------
    RelaxedComparison
        Up to the first step that does not come below the tolerance, which is included, or to where it was stopped.
    """
    orbits, points = branches.problem, branches.backbone.points
    factors = np.linspace(job.first, job.last, settings.steps + 1)[1:]
    begin = processor_time()
    exact = [branches.at_factor(float(factor)) for factor in factors]
    shooting_passages = orbits.family.passages
    shooting_time_s += processor_time() - begin
    steps: list[RelaxedStep] = []
    outcome = COMPLETE
    for step in until(relaxed_path(orbits, points[0].u, factors, settings.tolerance, settings.iterations), stop):
        steps.append(step)
        if progress is not None:
            progress(len(steps) / settings.steps)
        if not step.reached:
            break
    last = Where(steps[-1].factor, "", "stiffness factor")
    if not steps[-1].reached:
        code, sentence, remedy = (
            "too_few_iterations",
            f"the limit of {settings.iterations} iterations is reached",
            ("raise nnm.method.iterations, steps or the tolerance"),
        )
        if steps[-1].stalled:
            code, sentence = "no_descent", "no further descent was found"
            remedy = "use more nnm.method.steps or a larger tolerance"
        outcome = Outcome.of(
            OutcomeKind.STOPPED, code,
            f"the functional of relaxed minimisation is {steps[-1].functional:.3g}, the tolerance "
            f"{settings.tolerance:g}; {sentence}", at=last, remedy=remedy,
        )  # fmt: skip
    elif len(steps) < settings.steps:
        outcome = interruption("during relaxed minimisation", at=last)
    return _compared(orbits, steps, exact[: len(steps)], settings, outcome, field, shooting_passages, shooting_time_s)


def _compared(
    orbits: BrakeOrbits,
    steps: list[RelaxedStep],
    exact: list[BranchPoint | None],
    settings: RelaxedMinimisationMethod,
    outcome: Outcome,
    field: Floats,
    shooting_passages: int,
    shooting_time_s: float,
) -> RelaxedComparison:
    n = orbits.n
    shapes = np.array([s.shape for s in steps]).reshape(len(steps), n)
    frequency = np.array([1.0 / s.period for s in steps])
    known = np.array([np.nan if e is None else 1.0 / float(e.u[-2]) for e in exact])
    apart = np.full(len(steps), np.nan)
    fates: list[str] = []
    moved: list[bool] = []
    last: Floats | None = None  # the exact motion that the step before was beside
    for k, (step, point) in enumerate(zip(steps, exact, strict=True)):
        if point is not None:
            apart[k] = _distance(orbits, step.shape, point.u[:n])
        near = solve_at(orbits, orbits.unknowns(step.shape, step.period, step.factor), Settings(iterations=15))
        fates.append("none" if near is None else "between" if point is None else "other")
        if near is not None and point is not None:
            same = _distance(orbits, near.u[:n], point.u[:n]) < SAME
            fates[-1] = "same" if same and abs(near.u[-2] / point.u[-2] - 1.0) < SAME else "other"
        here = None if near is None else near.u[:n]
        moved.append(fates[-1] in ("other", "none") and (k == 0 or fates[-2] in ("same", "between")))
        if fates[-1] == "other" and not moved[-1] and last is not None and here is not None:
            moved[-1] = _distance(orbits, here, last) > FAR
        last = here
    return RelaxedComparison(
        steps=settings.steps,
        tolerance=settings.tolerance,
        outcome=outcome,
        factor=np.array([s.factor for s in steps]),
        frequency_hz=frequency,
        functional=np.array([s.functional for s in steps]),
        passages=np.array([s.passages for s in steps], dtype=np.int64),
        processor_time_s=np.array([s.processor_time_s for s in steps]),
        reached=np.array([s.reached for s in steps], dtype=bool),
        coordinates=shapes,
        initial_displacement=shapes @ field.T,
        exact_frequency_hz=known,
        frequency_difference=np.abs(frequency / known - 1.0),
        shape_difference=apart,
        fate=tuple(fates),
        jumped=np.array(moved, dtype=bool),
        shooting_passages=shooting_passages,
        shooting_processor_time_s=shooting_time_s,
    )


def _distance(orbits: BrakeOrbits, shape: Floats, other: Floats) -> float:
    """Of two shapes at rest, relative to the second, in the norm of the linear strain energy."""
    w = orbits.family.omega
    return float(np.linalg.norm(w * (shape - other)) / max(float(np.linalg.norm(w * other)), 1e-300))
