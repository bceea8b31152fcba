r"""Shooting over the whole period for a nonlinear normal mode, and the non-brake orbits that leave it.

A brake orbit comes to rest twice in a period and retraces its path. With the half period's transition matrix
:math:`\Phi = \begin{pmatrix} a & b
\\ c & d \end{pmatrix}` a pair of multipliers meets at +1 where c or b is singular. A kernel of c (shapes at rest
that come to rest again) leads to other brake orbits: a fold, or the tongue of an internal resonance. A kernel of b is a
kick :math:`\delta v` at the instant of rest after which the *same* place is reached half a period later: the motion
then need not return on its path, and a pair of families branches off, each the time reversal of the other. b always has
one kernel, the shift in time :math:`\delta v = \nabla V(q_0)`; bordering with the gradients at both ends removes it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from beamsim.analyses.nnm.paths import ModeBranches, ModePath
from beamsim.errors import NotTrustedError
from beamsim.orbits.branch import INTERRUPTED, BranchPoint, OrbitBranch, reached_end
from beamsim.orbits.continuation import Branch, BranchStep, Settings, solve_at
from beamsim.orbits.free_orbits import BrakeOrbits, FreeOrbits, free_of, slowest_instant
from beamsim.orbits.special_points import correct_on_other_branch
from beamsim.outcomes import Outcome, OutcomeKind, Progress, report_progress, stop_requested, until_stop
from beamsim.scenario.sweep import FullPeriodMethod
from beamsim.typing import Floats

BACK_TO_BRAKE_ORBITS = Outcome.of(OutcomeKind.COMPLETE, "back_to_brake_orbits", "returned to brake orbits")
BRAKE_ORBIT_ITSELF = Outcome.of(
    OutcomeKind.STOPPED, "brake_orbit_itself", "the orbits found are brake orbits, shifted in time"
)

FIRST_STEP, LARGEST_STEP = 0.01, 0.05  # of a non-brake branch, in scaled unknowns
SAME_ORBIT = 1e-5  # scaled distance within which two orbits are the same
END_DISTANCE = 0.2  # scaled distance within which a symmetry breaking is the other end of a branch
LARGEST_RATIO = 12  # of the frequencies of the mode and the branch
FIRST_KICKS = (0.03, 0.01, 0.003, 0.1)  # initial speed of the branch, over sqrt(2 E)


@dataclass(frozen=True)
class SymmetryBreaking:
    """Brake orbit from which non-brake orbits branch off."""

    point: BranchPoint
    kick: Floats  # (n,) velocities at the instant of rest, unit norm
    mode: int  # linear mode with the largest share of the kick, from 0
    ratio: int  # n of n:1; the mode makes about n oscillations per period


def _bordered_block(orbits: BrakeOrbits, point: BranchPoint) -> tuple[Floats, Floats]:
    """Scaled block b, bordered by its trivial kernels, and the scale w of the coordinates' frequencies."""
    n = orbits.n
    q, period, factor, _ = orbits.split(point.u)
    flow_map = point.data.flow_map
    w = np.maximum(orbits.family.omega, 0.2 * np.pi / period)
    B = np.zeros((n + 1, n + 1))
    B[:n, :n] = flow_map.transition[:n, n : 2 * n] * w[:, None] * w
    gradient_after = orbits.family.potential(flow_map.end[:n], factor)[1] / w
    gradient_before = orbits.family.potential(q, factor)[1] / w
    B[:n, n] = gradient_after / np.linalg.norm(gradient_after)
    B[n, :n] = gradient_before / np.linalg.norm(gradient_before)
    return B, w


def _determinant(orbits: BrakeOrbits, point: BranchPoint) -> float:
    return float(np.linalg.det(_bordered_block(orbits, point)[0]))


SINGULAR_RATIO = 1e-5  # smallest over largest singular value of the scaled b at a located point


def symmetry_breaking(step: BranchStep[BrakeOrbits]) -> SymmetryBreaking | None:
    """Locate the point on a step of a branch where non-brake orbits leave; None if there is none.

    Resonances of a higher order than `LARGEST_RATIO` are excluded.

    Parameters
    ----------
    step : step of a branch of brake orbits.

    Returns
    -------
    The point, or None.
    """
    orbits = step.problem
    values = _determinant(orbits, step.a), _determinant(orbits, step.b)
    if values[0] * values[1] > 0 or min(_kick(orbits, p)[2] for p in (step.a, step.b)) > LARGEST_RATIO:
        return None
    kernel = step.locate(lambda p: _determinant(orbits, p), values)
    if kernel is None:
        return None
    kick, mode, ratio, smallness = _kick(orbits, kernel)
    if smallness > SINGULAR_RATIO or not 1 <= ratio <= LARGEST_RATIO:
        return None
    return SymmetryBreaking(kernel, kick, mode, ratio)


def _kick(orbits: BrakeOrbits, point: BranchPoint) -> tuple[Floats, int, int, float]:
    """Kick closest to a kernel of b.

    Returns its direction, its main mode (from 0), oscillations of that mode per period, and the distance to the kernel.
    """
    B, w = _bordered_block(orbits, point)
    _, sizes, rows = np.linalg.svd(B)
    kick = w * rows[-1][: orbits.n]
    kick /= np.linalg.norm(kick)
    mode = int(np.argmax((orbits.vectors.T @ kick) ** 2))
    ratio = round(float(orbits.omega[mode]) * orbits.split(point.u)[1] / (2 * np.pi))
    return kick, mode, ratio, float(sizes[-1] / sizes[0])


SLOW_SHARE = 0.3  # times the largest minimum speed so far; below it a reversal means a passage through rest


REST_SPEED = 1e-4  # minimum speed that counts as rest


def non_brake_branch(
    brake: BrakeOrbits, origin: SymmetryBreaking, reach: tuple[float, float], settings: Settings
) -> OrbitBranch:
    """Trace the non-brake orbits from a symmetry-breaking point until they are brake orbits again.

    The first point is close to the brake orbit. The two directions of the kick give motions that are time reversals of
    each other; one of them is traced.

    Parameters
    ----------
    brake : half-period shooting problem.
    origin : symmetry-breaking point.
    reach : range of the parameter.
    settings : step sizes and tolerances.

    Returns
    -------
    OrbitBranch
        Without points if no such motion is found within the range.
    """
    n, at, orbits = brake.n, origin.point.u, free_of(brake, origin.point.u)
    row = np.concatenate([np.zeros(n), origin.kick, np.zeros(2)])
    begun = correct_on_other_branch(orbits, np.concatenate([at[:n], np.zeros(n), at[-2:]]), row, FIRST_KICKS, settings)
    start = next((point for point in begun if reach[0] <= point.parameter <= reach[1]), None)
    points: list[BranchPoint] = []
    outcome = Outcome.of(OutcomeKind.STOPPED, "no_orbit_beside", "no non-brake orbit was found near the brake orbit")
    if start is not None:
        branch = Branch(orbits, start, *reach, settings)
        before, fastest = np.zeros(n), 0.0
        for point in until_stop(branch):
            flow_map, flow = point.data.flow_map, point.data.flow
            time, _ = slowest_instant(flow, flow_map, n)
            # velocities then, over sqrt(2 E)
            slowest = flow.states_at(flow_map, np.array([time]))[0, n : 2 * n] / np.sqrt(2.0 * orbits.split(point.u)[3])
            speed = float(np.linalg.norm(slowest))
            fastest = max(fastest, speed)
            turned = speed < SLOW_SHARE * fastest and float(slowest @ before) < 0
            if speed < REST_SPEED or turned:
                outcome = BACK_TO_BRAKE_ORBITS if len(points) > 1 else BRAKE_ORBIT_ITSELF
                break
            points.append(point)
            before = slowest
            orbits.fix_phase(point.u)
        else:
            outcome = branch.outcome
    return OrbitBranch(orbits, points, outcome, kind="non_brake", mode=origin.mode, ratio=origin.ratio)


ONE_MOTION = 1e-6  # relative distance within which two solutions are the same motion


def over_full_period(
    brake: BrakeOrbits, points: Sequence[BranchPoint], gaps: Collection[float] = (), report: Progress = None
) -> OrbitBranch:
    """Trace a path of brake orbits again over the whole period: a check that assumes no instant of rest.

    The half-period path only provides the parameters of the points and the restarts beyond its jumps. Otherwise the
    full-period path is independent: each point is predicted from its own last two.

    Parameters
    ----------
    brake : half-period problem (stiffness factor or energy).
    points : path of the half-period problem.
    gaps : parameters of its points directly before a jump.
    report : called with the completed fraction of the path.

    Returns
    -------
    OrbitBranch
        One point for each point of the path, up to the first where Newton's method reaches another motion.
    """
    orbits, reached, last = free_of(brake, points[0].u), list[BranchPoint](), list[BranchPoint]()
    outcome = reached_end(points[-1].parameter)
    for brake_point in points:
        at_rest = np.concatenate([brake_point.u[: brake.n], np.zeros(brake.n), brake_point.u[-2:]])
        orbits.fix_phase(at_rest)
        guesses = [*(point.u for point in last[-1:]), at_rest]
        if len(last) == 2 and last[1].parameter != last[0].parameter:
            share = (brake_point.parameter - last[1].parameter) / (last[1].parameter - last[0].parameter)
            guesses[0] = last[1].u + share * (last[1].u - last[0].u)
        found = (solve_at(orbits, guess, Settings(iterations=15), brake_point.parameter) for guess in guesses)
        new = next((p for p in found if p is not None and difference(orbits, p, brake_point) < ONE_MOTION), None)
        if new is None:
            outcome = Outcome.of(
                OutcomeKind.STOPPED, "full_period_diverged",
                "Newton's method over the full period does not converge from the half-period solution",
                at=brake_point.parameter,
            )  # fmt: skip
            break
        reached.append(new)
        report_progress(report, len(reached) / len(points))
        if stop_requested():
            outcome = INTERRUPTED
            break
        last = [*last[-1:], new] if brake_point.parameter not in gaps else []
    return OrbitBranch(orbits, reached, outcome, kind="backbone")


def difference(orbits: FreeOrbits, point: BranchPoint, brake_point: BranchPoint) -> float:
    """Largest difference of period and state between a motion and the same motion by half-period shooting.

    Parameters
    ----------
    orbits : shooting over the whole period.
    point : motion over the whole period.
    brake_point : motion by half-period shooting.

    Returns
    -------
    float
        Relative; for the state, relative to the scale of the unknowns.
    """
    n = orbits.n
    state = point.u[: 2 * n] - np.concatenate([brake_point.u[:n], np.zeros(n)])
    period = abs(float(point.u[-2] / brake_point.u[-2]) - 1.0)
    return max(float(np.linalg.norm(state / orbits.scale(point.u)[0][: 2 * n])), period)


def follow_full_period(
    job: ModePath,
    branches: ModeBranches,
    settings: FullPeriodMethod,
    report: Progress = None,
) -> ModeBranches:
    """Trace a half-period backbone again over the whole period, and the non-brake orbits that branch off.

    Parameters
    ----------
    job : path with the parameter of the backbone.
    branches : the backbone with its tongues and jumps, by half-period shooting.
    settings : number of non-brake branches, and of their points.
    report : called with the completed fraction of the backbone.

    Returns
    -------
    ModeBranches
        Backbone over the whole period, non-brake branches, and the brake orbits from which these leave.

    Raises
    ------
    NotTrustedError
        If not even the first motion of the backbone is found over the whole period.
    """
    points = branches.backbone.points
    backbone = over_full_period(branches.problem, points, branches.gaps, report)
    if not backbone.points:
        raise NotTrustedError(f"full-period shooting found no motion to start from: {backbone.outcome}")
    breakings: list[SymmetryBreaking] = []  # along the backbone and its tongues, each once
    for a, b in until_stop(_steps(branches) if settings.branches and not stop_requested() else ()):
        origin = symmetry_breaking(BranchStep(branches.problem, a, b))
        if origin is not None and not any(_same_orbit(branches.problem, origin, known) for known in breakings):
            breakings.append(origin)
    reach = min(points[0].parameter, points[-1].parameter), max(points[0].parameter, points[-1].parameter)
    non_brake: list[OrbitBranch] = []
    steps = Settings(step=FIRST_STEP, largest_step=LARGEST_STEP, most_points=settings.points)
    for origin in breakings:
        if len(non_brake) == settings.branches or any(_ends_at_origin(branch, origin) for branch in non_brake):
            continue
        if stop_requested():
            break
        branch = non_brake_branch(branches.problem, origin, reach, steps)
        if branch.points:
            non_brake.append(replace(branch, outcome=job.outcome_in_report_unit(branch.outcome, branch.points[-1])))
    backbone = replace(backbone, outcome=job.outcome_in_report_unit(backbone.outcome, backbone.points[-1]))
    left_at = tuple(origin.point for origin in breakings)
    return replace(branches, backbone=backbone, non_brake=tuple(non_brake), symmetry_breakings=left_at)


def _steps(branches: ModeBranches) -> Iterator[tuple[BranchPoint, BranchPoint]]:
    """Neighbouring points along the backbone, its tongues, and the returns into a tongue from beyond a jump."""
    points = branches.backbone.points
    low, high = sorted((points[0].parameter, points[-1].parameter))
    for a, b in pairwise(points):
        if a.parameter not in branches.gaps:
            yield a, b
    for tongue in branches.tongues:
        yield from pairwise(tongue.points)
    for a, b in pairwise(points):
        if a.parameter in branches.gaps:
            start = b.orient(a.parameter - b.parameter)
            yield from pairwise(Branch(branches.problem, start, low, high, Settings(most_points=60)))


def _same_orbit(orbits: BrakeOrbits, a: SymmetryBreaking, b: SymmetryBreaking) -> bool:
    """True if two symmetry breakings are one orbit, at either of its instants of rest."""
    u, v = a.point.u, b.point.u
    if a.mode != b.mode or not np.allclose(u[-2:], v[-2:], rtol=SAME_ORBIT, atol=SAME_ORBIT):
        return False
    scale = orbits.scale(v)[0][: orbits.n]
    ends = (v[: orbits.n], b.point.data.flow_map.end[: orbits.n])
    return any(float(np.linalg.norm((u[: orbits.n] - q) / scale)) < SAME_ORBIT for q in ends)


def _ends_at_origin(branch: OrbitBranch, origin: SymmetryBreaking) -> bool:
    """True if a traced branch ends at the origin of another, which would be the same branch backwards."""
    if branch.outcome.code != BACK_TO_BRAKE_ORBITS.code:
        return False
    n, last, there = branch.problem.n, branch.points[-1].u, origin.point.u
    if abs(float(last[-2] / there[-2]) - 1.0) > END_DISTANCE:
        return False
    scale = branch.problem.scale(last)[0][:n]
    flow_map = branch.points[-1].data.flow_map
    times = np.linspace(0.0, flow_map.duration, 257)
    q = branch.points[-1].data.flow.states_at(flow_map, times)[:, :n]
    return bool(np.min(np.linalg.norm((q - there[:n]) / scale, axis=1)) < END_DISTANCE)
