"""Special points of branches of periodic motions, and the branches that leave there, from any method."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from beamsim.orbits.branch import BranchPoint, FailedSearch, SpecialPoint, recorded
from beamsim.orbits.continuation import (
    ContinuationProblem,
    Settings,
    between,
    branch_point_between,
    correct,
    locate,
)
from beamsim.orbits.grazing import OrbitProblem, grazings, smooth_pieces, turned_at, without_borders
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.typing import Complexes, Floats, Ints

AT_BOUNDARY = 1e-5  # distance of a multiplier from where a located point says that it is
FIRST_AMPLITUDE = 0.01  # of a motion of another branch beside the one that it leaves, over that one's size


def _doubling(mu: Complexes) -> float:
    """Vanishes where a multiplier is -1."""
    return float(np.prod((1.0 + mu) / (1.0 + np.abs(mu))).real)


def _turning(mu: Complexes) -> float:
    """Vanishes where two multipliers have the product 1."""
    i, j = np.triu_indices(mu.size, 1)
    pair = mu[i] * mu[j]
    return float(np.prod((pair - 1.0) / (1.0 + np.abs(pair))).real)


def special_points(
    problem: OrbitProblem, a: BranchPoint, b: BranchPoint, settings: Settings, failed: list[FailedSearch] | None = None
) -> list[SpecialPoint]:
    """Folds, period doublings, Neimark–Sacker points, branch points and grazings between two neighbours.

    A change of stability at a corner of the branch (grazing) is no bifurcation of a smooth family and is left to the
    grazing point. A grazing at which the branch turns back, without a multiplier 1, is a nonsmooth fold. Among free
    motions there are no period doublings and Neimark–Sacker points in this sense.

    Parameters
    ----------
    problem, settings : the residual, and tolerances of its points.
    a, b : the neighbours.
    failed : searches that end in a numerical error are appended to it, and the others go on.

    Returns
    -------
    The points, grazings first.

    Raises
    ------
    ArithmeticError : where a search fails, and there is no list for it.
    """
    special: list[SpecialPoint] = []
    smooth = problem.same_events(a, b)
    if not smooth:
        with recorded("grazing", a, failed):
            special.extend(grazings(problem, a, b, settings))
            if _in_one_alone(problem, a, b) - {point.contact for point in special}:
                raise ArithmeticError("a contact begins between two neighbours, and no grazing was found")
    parts: list[tuple[tuple[BranchPoint, BranchPoint], BranchPoint, BranchPoint]] = []
    for x, y in smooth_pieces(a, b, special):
        with recorded("neimark_sacker", a, failed):
            parts += [((x, y), *part) for part in _parts(problem, x, y, settings, (x is not a, y is not b))]
    for piece, left, right in parts:
        if left.tangent[-1] * right.tangent[-1] < 0:
            with recorded("fold", a, failed):
                fold = locate(problem, left, right, lambda p: float(p.tangent[-1]), settings)
                if fold is not None:
                    ends = min(abs(float(left.tangent[-1])), abs(float(right.tangent[-1])))
                    # 1e-3: of the tangent's part along the parameter at the neighbours: what a fold leaves of it
                    if abs(float(fold.tangent[-1])) <= 1e-3 * ends:
                        special.append(SpecialPoint("fold", fold.parameter, fold))
                    elif not turned_at(special, piece, fold):
                        raise ArithmeticError("the branch turns back at a corner that was not found")
        if smooth:
            with recorded("branch_point", a, failed):
                crossing = branch_point_between(problem, left, right, settings)
                if crossing is not None:
                    special.append(SpecialPoint("branch_point", crossing.parameter, crossing))
        if problem.bifurcates:
            with recorded("period_doubling", a, failed):  # or Neimark–Sacker point
                special += _changes_of_stability(problem, left, right, settings)
    return special


def _in_one_alone(problem: OrbitProblem, a: BranchPoint, b: BranchPoint) -> set[int]:
    """One-sided contacts that are made and lost in one motion and not in the other."""
    made = (set(problem.cycle(point)[1].event_contact.tolist()) for point in (a, b))
    return set.symmetric_difference(*made) - without_borders(problem.cycle(a)[0].system.contacts)


def _changes_of_stability(
    problem: OrbitProblem, left: BranchPoint, right: BranchPoint, settings: Settings
) -> Iterator[SpecialPoint]:
    """Period doublings and Neimark–Sacker points between two motions with the same contacts."""
    change = _outside(problem.multipliers(right)) - _outside(problem.multipliers(left))
    if change[0] % 2:
        point = locate(problem, left, right, lambda p: _doubling(problem.multipliers(p)), settings)
        if point is not None and np.min(np.abs(problem.multipliers(point) + 1.0)) < AT_BOUNDARY:
            yield SpecialPoint("period_doubling", point.parameter, point)
    if change[1:].any():
        point = locate(problem, left, right, lambda p: _turning(problem.multipliers(p)), settings)
        if point is not None:
            mu = problem.multipliers(point)
            circle = np.abs(np.abs(mu) - 1.0) < 0.1 * AT_BOUNDARY
            if np.any(circle & (np.abs(mu.imag) > 0.1 * AT_BOUNDARY)):
                yield SpecialPoint("neimark_sacker", point.parameter, point)


def _outside(mu: Complexes) -> Ints:
    """(3,) numbers of multipliers outside the unit circle: real negative ones, complex ones, all."""
    out, turning = np.abs(mu) > 1.0, mu.imag != 0.0
    return np.array([(out & ~turning & (mu.real < 0)).sum(), (out & turning).sum(), out.sum()])


def _parts(
    problem: OrbitProblem, a: BranchPoint, b: BranchPoint, settings: Settings, corner: tuple[bool, bool]
) -> Iterator[tuple[BranchPoint, BranchPoint]]:
    """A step, or two parts of it where a pair of special points may hide between its ends.

    Two folds: where the parameter's cubic through both ends with their tangents turns, though both ends point the same
    way. Two period doublings, or two Neimark–Sacker points: where a multiplier close to -1, or a complex one to the
    unit circle, stays inside, or outside, at both ends. Beside a grazing point (``corner``, for either end) multipliers
    change with the square root of the distance: the motion a quarter away is half-way between them.
    """
    if a is b:
        return
    share, corner = _hidden_turn(a, b), corner if problem.bifurcates else (False, False)
    if share is None and any(corner):
        share = 0.5 if all(corner) else 0.25 if corner[0] else 0.75
    elif share is None and problem.bifurcates:
        for mu in (problem.multipliers(a), problem.multipliers(b)):
            turning = mu[np.abs(mu.imag) > AT_BOUNDARY]
            # 0.1: distance of a multiplier within which a step is looked into for a pair of period doublings
            # 0.02: relative distance of complex multipliers and of two Neimark–Sacker points
            if np.any(np.abs(mu + 1.0) < 0.1) or np.any(np.abs(np.abs(turning) - 1.0) < 0.02):
                share = 0.5
    middle = None if share is None else between(problem, a, b, share, settings)
    if middle is None:
        yield a, b
    elif any(corner):
        yield from _parts(problem, a, middle, settings, (False, False))
        yield from _parts(problem, middle, b, settings, (False, False))
    else:
        yield a, middle
        yield middle, b


def _hidden_turn(a: BranchPoint, b: BranchPoint) -> float | None:
    """Where the parameter's cubic over a step has its extreme slope, if that is of another sign than both ends'."""
    scale = a.scale
    at_a, at_b = float(a.tangent[-1]), float(b.tangent[-1] * b.scale[-1] / scale[-1])
    if at_a * at_b <= 0:
        return None
    mean = float((b.u[-1] - a.u[-1]) / scale[-1]) / float(np.linalg.norm((b.u - a.u) / scale))
    bend = 3.0 * (at_a + at_b) - 6.0 * mean  # the slope is left + (…) x + bend x^2
    if bend == 0.0:
        return None
    x = (2.0 * at_a + at_b - 3.0 * mean) / bend
    if not 0.0 < x < 1.0 or (at_a - bend * x**2) * at_a > 0:
        return None
    return x


def beside(
    problem: ContinuationProblem, u: Floats, row: Floats, sizes: Sequence[float], settings: Settings
) -> Iterator[BranchPoint]:
    """Motions of another branch, at given distances from a motion in a direction; their tangents point away from it.

    Parameters
    ----------
    problem : of the other branch.
    u : (n,) unknowns of the motion, as a point of this problem.
    row : (n,) unit vector in scaled unknowns.
    sizes : distances to try in turn, in scaled unknowns; where Newton's method does not converge, there is no motion.
    settings : tolerances.

    Returns
    -------
    The motions, for one size after the other.
    """
    scale = problem.scale(u)[0]
    for size in sizes:
        guess = u + size * row * scale
        # 10.0: how far the unknowns may move while the first amplitude is held, in units of it
        point = correct(problem, guess, row, scale, settings, reference=row, furthest=10.0 * size)
        if point is not None:
            yield point


def switch_at_period_doubling(problem: ForcedOrbits, special: SpecialPoint) -> tuple[ForcedOrbits, BranchPoint] | None:
    """The first motion of the branch of doubled period that leaves at a period doubling.

    The eigenvector of the multiplier -1, `FIRST_AMPLITUDE` times the motion's size, is added to the state; Newton then
    finds the parameter that belongs to this distance from the old branch. Its tangent points away from the old
    branch.
    """
    doubled = problem.with_multiple(2 * problem.multiple)
    mu, vectors = np.linalg.eig(problem.monodromy(special.point))
    v = vectors[:, int(np.argmin(np.abs(mu + 1.0)))].real
    row = np.append(v, 0.0) / doubled.scale(special.point.u)[0]
    sizes = [factor * FIRST_AMPLITUDE for factor in (1.0, 0.1, 0.01, 5.0)]
    first = beside(doubled, special.point.u, row / np.linalg.norm(row), sizes, Settings(iterations=15))
    return next(((doubled, point) for point in first), None)


def switch_at_branch_point(problem: ForcedOrbits, special: SpecialPoint, chord: Floats) -> list[BranchPoint]:
    """The first motions to both sides of the branch that crosses at a branch point, with tangents that point away.

    There the Jacobian has a kernel of two dimensions: the tangent, and the direction in which the other branch leaves.
    No tangent is defined by the Jacobian alone.

    Parameters
    ----------
    problem : of both branches.
    special : the branch point.
    chord : (n,) difference of the unknowns between its neighbours on the branch that is known.

    Returns
    -------
    Up to two motions.
    """
    u = special.point.u
    scale, residual_scale = problem.scale(u)
    kernel = np.linalg.svd(problem.residual(u)[1] * scale / residual_scale[:, None])[2][-2:]
    along = kernel @ (chord / scale)
    across = np.array([-along[1], along[0]]) @ kernel
    across /= np.linalg.norm(across)
    sizes = [factor * FIRST_AMPLITUDE for factor in (1.0, 0.1, 5.0)]
    sides = (beside(problem, u, row, sizes, Settings(iterations=15)) for row in (across, -across))
    return [point for first in sides if (point := next(first, None)) is not None]
