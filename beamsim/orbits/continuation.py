"""Pseudo-arclength continuation as a generator, for any residual that returns its Jacobian.

A *problem* has unknowns :math:`u = (x, \\lambda)` with :math:`k` equations :math:`R(u) = 0` and a one-dimensional
kernel of :math:`\\partial R/\\partial u` (k = size of u less one, or more equations that are consistent). From a point
with unit tangent :math:`t` the predictor is :math:`u + t\\,ds`, the corrector Newton's method with the row :math:`t^T
(u - u_{pred}) = 0`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import field
from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.passage import NotFinite
from beamsim.orbits.branch import INTERRUPTED, NOT_BEGUN, BranchPoint
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.typing import Floats

UNTOUCHED = 0.01  # of the tolerance, at which a first guess needs no correction
SETTLED = 1e-13  # a Newton step shorter than this is round-off
STIFF = 1e3  # times the tolerance, up to which a residual may then be round-off
SAME_SCALE = 0.05  # a Newton step shorter than this leaves the residuals' scale as it is
LEAST_ALONG = 0.1  # cosine of a tangent and the chord, below which the tangent is no guess of what lies ahead
CLOSE = 1e-6  # shares of a chord below which a cubic between two points is a straight line
ROUND_OFF = 1e-14  # smallest change of a share that means anything
MOST_BISECTIONS = 60
MOST_ASTRAY = 0.1  # of a step, outside the span of both tangents: beyond it lies another branch
FEWEST_IN_A_RING = 5  # points of a closed curve
RANK_LOST = 1e-5  # smallest singular value of the Jacobian against its largest at a crossing of branches
RANK_HALVINGS, RANK_FALLS = 8, 0.1  # of a step, within which that value must fall, and to which part at least
RING = 0.1  # of a step, how far beside it the first point may lie that it passes
AT_REST = 1e-13  # of a tangent: unknowns below it do not change along the branch
FARTHEST_EXTRAPOLATION = 2.0  # of a cubic through two neighbours, in lengths between them


class ContinuationProblem(Protocol):
    """A residual with its Jacobian."""

    def residual(self, u: Floats) -> tuple[Floats, Floats, Any]:
        """R (k,), its Jacobian (k, size of u), and what was computed with them (kept with the point).

        Raises
        ------
        ArithmeticError : where the residual cannot be computed; the step is then shortened.
        """

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Typical sizes of the unknowns (size of u,) and of the residuals (k,)."""


class OrbitContinuation(ContinuationProblem, Protocol):
    """A continuation problem whose points are periodic orbits."""

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether two motions have the same order of contacts."""


@dataclass(frozen=True)
class Settings:
    """Sizes of steps (in units of the problem's scale) and tolerances."""

    step: float = 0.02
    smallest_step: float = 1e-7
    largest_step: float = 0.05
    tolerance: float = 1e-11  # of the residual against its scale
    iterations: int = 8
    wanted_iterations: int = 3
    smallest_cosine: float = 0.9  # between neighbouring tangents, unless the step is short: corners exist
    most_points: int = 10_000
    stall: int = 150  # points within which the branch must get ahead by a largest step


@cache
def _lapack() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """LU factorisation and solution: called directly, they cost a fifth of NumPy's ``solve`` at these sizes."""
    from scipy.linalg.lapack import dgetrf, dgetrs

    return dgetrf, dgetrs


def _null_vector(J: Floats, previous: Floats | None) -> tuple[Floats, float]:
    """Unit kernel vector t and the sign of det [J; t]; a bordered solve where a previous vector is known.

    ``[J; p] x = e_n`` gives ``t = x / |x|``, and ``det [J; t] = |x| det [J; p]`` by Cramer's rule: one factorisation
    serves both.
    """
    k, n = J.shape
    if k != n - 1:
        return np.linalg.svd(J)[2][n - 1], 0.0
    if previous is not None:
        factorise, solve = _lapack()
        lu, pivots, _ = factorise(np.vstack([J, previous]))
        diagonal = lu.diagonal()
        if diagonal.all():
            last = np.zeros(n)
            last[-1] = 1.0
            x = solve(lu, pivots, last)[0]
            size = float(np.linalg.norm(x))
            if np.isfinite(size) and size < 1e6:
                swaps = np.count_nonzero(pivots != np.arange(n)) + np.count_nonzero(diagonal < 0)
                return x / size, -1.0 if swaps % 2 else 1.0
    t = np.linalg.svd(J)[2][-1]
    size = np.abs(J).max(axis=1, keepdims=True)
    return t, float(np.sign(np.linalg.det(np.vstack([J / np.where(size > 0, size, 1.0), t]))))


def _newton_step(J: Floats, row: Floats, R: Floats, r: float) -> Floats | None:
    A, b = np.vstack([J, row]), -np.append(R, r)
    if A.shape[0] != A.shape[1]:
        return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])
    factorise, solve = _lapack()
    lu, pivots, info = factorise(A)
    return None if info else np.asarray(solve(lu, pivots, b)[0])


class Converged(NamedTuple):
    """Where Newton's method ended."""

    u: Floats
    jacobian: Floats  # of the residual, scaled
    residual: float  # largest, against its scale
    iterations: int
    data: Any


def newton(
    problem: ContinuationProblem,
    guess: Floats,
    row: Floats,
    target: float,
    scale: Floats,
    settings: Settings,
    furthest: float = np.inf,
) -> Converged | None:
    """Newton's method on ``R(u) = 0, row . (u / scale) = target``; None where it does not converge.

    ``furthest`` limits the distance from the guess.
    """
    w = guess / scale
    start = w.copy()
    last = moved = np.inf
    for iteration in range(settings.iterations + 1):
        u = w * scale
        try:
            R, J, data = problem.residual(u)
        except (ArithmeticError, np.linalg.LinAlgError):
            return None
        if moved > SAME_SCALE:
            rs = problem.scale(u)[1]
        Rw = R / rs
        size = float(np.abs(Rw).max()) if Rw.size else 0.0
        if not np.isfinite(size):
            return None
        Jw = J * scale / rs[:, None]
        off = float(row @ w - target)
        # a guess is taken as it is only where it is as good as a step of Newton's method would make it
        good = size <= (settings.tolerance if iteration else UNTOUCHED * settings.tolerance)
        # with stiff contacts round-off alone may exceed the tolerance, although the unknowns no longer change
        good = good or (moved <= SETTLED and size <= STIFF * settings.tolerance)
        if good and abs(off) <= 1e-9 + settings.tolerance:
            return Converged(u, Jw, size, iteration, data)
        if iteration == settings.iterations or (
            iteration > 2 and size > 2.0 * last and size > 1e3 * settings.tolerance
        ):
            return None
        step = _newton_step(Jw, row, Rw, off)
        if step is None:
            return None
        w = w + step
        moved = float(np.linalg.norm(step))
        if not np.isfinite(moved):
            return None
        if float(np.linalg.norm(w - start)) > furthest:
            return None
        last = size
    return None


def correct(
    problem: ContinuationProblem,
    guess: Floats,
    row: Floats,
    target: float,
    scale: Floats,
    settings: Settings,
    reference: Floats | None = None,
    orient: float = 0.0,
    furthest: float = np.inf,
) -> BranchPoint | None:
    """The point of the branch with ``row . (u / scale) = target``; None where Newton's method does not converge.

    ``reference`` (scaled) orients the tangent; with ``orient`` not zero the determinant does. ``furthest`` limits the
    distance from the guess.
    """
    converged = newton(problem, guess, row, target, scale, settings, furthest)
    if converged is None:
        return None
    tangent, sign = _null_vector(converged.jacobian, reference)
    if reference is not None and orient == 0.0:
        flip = float(tangent @ reference) < 0
    else:
        flip = orient != 0.0 and sign * orient < 0
    if flip:
        tangent, sign = -tangent, -sign
    return BranchPoint(
        converged.u, tangent, scale, converged.residual, sign, converged.iterations, converged.data
    )  # fmt: skip


def solve_at(
    problem: ContinuationProblem,
    guess: Floats,
    settings: Settings,
    parameter: float | None = None,
    forward: float = 1.0,
) -> BranchPoint | None:
    """The solution at a fixed parameter, its tangent pointing to larger (``forward`` > 0) or smaller values."""
    scale = problem.scale(guess)[0]
    row = np.zeros(guess.size)
    row[-1] = 1.0
    u = guess.astype(float).copy()
    if parameter is not None:
        u[-1] = parameter
    point = correct(problem, u, row, float(u[-1] / scale[-1]), scale, settings)
    return None if point is None else point.towards(forward)


def correct_across(problem: ContinuationProblem, guess: Floats, settings: Settings) -> BranchPoint | None:
    """The solution beside a guess, across the branch: a fold close by is no obstacle."""
    scale, size = problem.scale(guess)
    try:
        J = problem.residual(guess)[1]
    except (ArithmeticError, np.linalg.LinAlgError):
        return None
    along, _ = _null_vector(J * scale / size[:, None], None)
    return correct(problem, guess, along, float(along @ (guess / scale)), scale, settings, along)


def interpolated(a: BranchPoint, b: BranchPoint, s: float) -> Floats:
    """The unknowns between two points, s in [0, 1] of the way along a cubic with both tangents.

    Where the tangents point back, along the chord.
    """
    wa, wb = a.u / a.scale, b.u / a.scale
    tb = b.tangent * b.scale / a.scale
    tb = tb / np.linalg.norm(tb)
    chord = float(np.linalg.norm(wb - wa))
    if float(tb @ (wb - wa)) <= 0 or float(a.tangent @ (wb - wa)) <= 0:
        return np.asarray((wa + s * (wb - wa)) * a.scale)
    h00, h10 = 2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s
    h01, h11 = -2 * s**3 + 3 * s**2, s**3 - s**2
    return np.asarray((h00 * wa + h10 * chord * a.tangent + h01 * wb + h11 * chord * tb) * a.scale)


def _extrapolated(a: BranchPoint, b: BranchPoint, scale: Floats, tb: Floats, ds: float, along: Floats) -> Floats:
    """A guess ``ds`` beyond b: on the cubic in arclength through a and b with their tangents; ``along`` the tangent of
    b where that cubic would be stretched too far.

    Its error is of order ds^4, the tangent's of order ds^2.
    """
    wb = b.u / scale
    ta = a.tangent * a.scale / scale
    ta /= np.linalg.norm(ta)
    chord = wb - a.u / scale
    turn = ta - tb
    length = float(np.linalg.norm(chord)) * (1.0 + float(turn @ turn) / 24.0)  # of an arc that turns by this much
    if length == 0.0 or ds > FARTHEST_EXTRAPOLATION * length:
        return along
    r = ds / length
    bend = r**2 * (length * (ta + 2.0 * tb) - 3.0 * chord) + r**3 * (length * (ta + tb) - 2.0 * chord)
    bend[(np.abs(ta) < AT_REST) & (np.abs(tb) < AT_REST)] = 0.0  # round-off there would grow from step to step
    return along + bend


def between(
    problem: ContinuationProblem,
    a: BranchPoint,
    b: BranchPoint,
    s: float,
    settings: Settings,
    known: tuple[float, BranchPoint, float, BranchPoint] | None = None,
) -> BranchPoint | None:
    """The point of the branch a share s of the way from a to b, measured along their chord.

    ``known`` are two points of it with their shares, on either side of s, to guess from (a and b by default).
    """
    wa, wb = a.u / a.scale, b.u / a.scale
    row = (wb - wa) / np.linalg.norm(wb - wa)
    target = float(row @ (wa + s * (wb - wa)))
    sl, left, sr, right = (0.0, a, 1.0, b) if known is None else known
    share = (s - sl) / (sr - sl)
    straight = left.u + share * (right.u - left.u)
    guesses = [straight] if sr - sl < CLOSE else [interpolated(left, right, share), straight]
    nearest_first = (left, right) if share < 0.5 else (right, left)
    for guess in (*guesses, *(_ahead(end, row, target, a.scale) for end in nearest_first)):
        point = correct(problem, guess, row, target, a.scale, settings, a.tangent)
        if point is not None:
            return point
    return None


def _ahead(point: BranchPoint, row: Floats, target: float, scale: Floats) -> Floats:
    """A guess on a point's tangent, at ``row . (u / scale) = target``; beside a corner it is closer than the chord."""
    t = point.tangent * point.scale / scale
    w, along = point.u / scale, float(row @ t)
    if abs(along) < LEAST_ALONG * float(np.linalg.norm(t)):
        return point.u
    return np.asarray((w + (target - float(row @ w)) / along * t) * scale)


def at_parameter(
    problem: ContinuationProblem, a: BranchPoint, b: BranchPoint, value: float, settings: Settings
) -> BranchPoint | None:
    """The point between two neighbours (or beyond them) at a value of the parameter; None where none is found."""
    share = (value - a.parameter) / (b.parameter - a.parameter)
    guess = interpolated(a, b, float(np.clip(share, 0.0, 1.0)))
    guess[-1] = value
    return solve_at(problem, guess, settings, value, b.parameter - a.parameter)


def locate(
    problem: ContinuationProblem,
    a: BranchPoint,
    b: BranchPoint,
    test: Callable[[BranchPoint], float],
    settings: Settings,
    values: tuple[float, float] | None = None,
    tolerance: float = 1e-13,
) -> BranchPoint | None:
    """The point between two neighbours at which a test function vanishes.

    Bracketed inverse quadratic interpolation, or bisection where that is not safe (T. R. Chandrupatla, *Advances in
    Engineering Software* 28, 1997); every guess is interpolated between the two points of the bracket.
    """
    fa, fb = values if values is not None else (test(a), test(b))
    if not (np.isfinite(fa) and np.isfinite(fb)) or fa * fb > 0:
        return None
    if fa == 0.0:
        return a
    if fb == 0.0:
        return b
    # x1 the latest estimate, x2 on the other side of the root, x3 the one before
    x1, f1, p1, x2, f2, p2 = 1.0, fb, b, 0.0, fa, a
    biggest = max(abs(fa), abs(fb))
    best: BranchPoint | None = None
    best_value = np.inf
    share = f1 / (f1 - f2)
    for _ in range(MOST_BISECTIONS):
        x = x1 + share * (x2 - x1)
        bracket = (x1, p1, x2, p2) if x1 < x2 else (x2, p2, x1, p1)
        point = between(problem, a, b, x, settings, bracket)
        if point is None:
            return best
        f = test(point)
        if not np.isfinite(f):
            return best
        if abs(f) <= best_value:  # of equal ones, such as signs, the latest
            best, best_value = point, abs(f)
        if f * f1 > 0:
            x3, f3 = x1, f1
        else:
            x3, f3, x2, f2, p2 = x2, f2, x1, f1, p1
        x1, f1, p1 = x, f, point
        smallest = ROUND_OFF / abs(x2 - x1) if x1 != x2 else 1.0
        if abs(f) <= tolerance * biggest or smallest > 0.5:
            return best
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        share = 0.5
        if phi * phi < xi and (1.0 - phi) ** 2 < 1.0 - xi:
            share = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
        share = min(max(share, smallest), 1.0 - smallest)
    return best


def branch_point_between(
    problem: ContinuationProblem, a: BranchPoint, b: BranchPoint, settings: Settings
) -> BranchPoint | None:
    """The point between two neighbours where branches cross; None where there is none.

    The sign of the determinant changes there, but also from one branch to another that a step has jumped to: only where
    branches cross does the Jacobian lose rank, in proportion to the distance.
    """
    if a.orientation * b.orientation >= 0:
        return None

    def rank(point: BranchPoint) -> float:
        """Smallest singular value of the Jacobian against its largest."""
        scale, size = problem.scale(point.u)
        values = np.linalg.svd(problem.residual(point.u)[1] * scale / size[:, None], compute_uv=False)
        return float(values[-1] / values[0])

    left, right = a, b
    for _ in range(RANK_HALVINGS):
        middle = between(problem, left, right, 0.5, settings)
        if middle is None:
            return None
        left, right = (middle, right) if middle.orientation * left.orientation > 0 else (left, middle)
    if min(rank(left), rank(right)) > RANK_FALLS * max(rank(a), rank(b)):
        return None
    point = locate(problem, left, right, lambda p: p.orientation, settings)
    return point if point is not None and rank(point) < RANK_LOST else None


def _astray(a: BranchPoint, b: BranchPoint) -> float:
    """How far the chord from a to b is from any sum of a stretch along a's tangent and one along b's, against itself.

    A smooth branch, and one with a corner in between, keeps to such sums; a step onto another branch does not.
    """
    chord = (b.u - a.u) / a.scale
    chord /= np.linalg.norm(chord)
    tb = b.tangent * b.scale / a.scale
    tb /= np.linalg.norm(tb)
    along, on, cosine = float(chord @ a.tangent), float(chord @ tb), float(a.tangent @ tb)
    sine2 = 1.0 - cosine**2
    x = (along - cosine * on) / sine2 if sine2 > 1e-12 else -1.0
    y = (on - cosine * along) / sine2 if sine2 > 1e-12 else -1.0
    if x < 0.0 or y < 0.0:
        return float(np.sqrt(max(0.0, 1.0 - max(along, on, 0.0) ** 2)))
    return float(np.sqrt(max(0.0, 1.0 - x * along - y * on)))


def _passes(a: BranchPoint, b: BranchPoint, start: BranchPoint) -> bool:
    """Whether the step from a to b passes the first point of the branch."""
    chord, beside = (b.u - a.u) / start.scale, (start.u - a.u) / start.scale
    length = float(np.linalg.norm(chord))
    share = float(beside @ chord) / length**2
    if not 0.0 <= share <= 1.0 or float(np.linalg.norm(beside - share * chord)) > RING * length:
        return False
    return float(chord @ start.tangent) > 0.8 * length


@dataclass
class Branch:
    """Iterate over it to follow a branch; ``outcome`` then says how it ended.

    Parameters
    ----------
    problem : the residual.
    start : a converged point, whose tangent gives the direction.
    low, high : the parameter's range; the branch ends on the first end it reaches.
    settings : steps and tolerances.
    same_kind : tells whether two neighbours have the same sequence of events; where not, the branch may have a corner
        and the
        determinant, which no corner changes, orients the tangent.
    """

    problem: ContinuationProblem
    start: BranchPoint
    low: float
    high: float
    settings: Settings = field(default_factory=Settings)
    same_kind: Callable[[BranchPoint, BranchPoint], bool] = lambda a, b: True
    outcome: Outcome = NOT_BEGUN

    def __iter__(self) -> Iterator[BranchPoint]:
        s = self.settings
        self.outcome = INTERRUPTED
        point, before = self.start, None
        yield point
        ds = s.step
        steps: list[float] = []
        for count in range(1, s.most_points):
            new = None
            while new is None:
                new, failed = self._step(point, before, ds), ds
                if new is None:
                    ds *= 0.4
                    if ds < s.smallest_step:
                        self.outcome = self._stuck(point, failed, count)
                        return
            if not self.low <= new.parameter <= self.high:
                edge = self.low if new.parameter < self.low else self.high
                last = at_parameter(self.problem, point, new, edge, self.settings)
                if last is not None:
                    yield last
                self.outcome = Outcome.of(OutcomeCode.REACHED_END, parameter=edge)
                return
            if count > FEWEST_IN_A_RING and _passes(point, new, self.start):
                yield self.start
                self.outcome = Outcome.of(OutcomeCode.CLOSED_CURVE)
                return
            before = point if self.same_kind(point, new) else None
            point = new
            yield point
            steps.append(ds)
            if sum(steps[-s.stall :]) < s.largest_step and len(steps) >= s.stall:
                self.outcome = Outcome.of(
                    OutcomeCode.NOT_SMOOTH, parameter=point.parameter, steps=s.stall, step=s.largest_step
                )
                return
            ds = min(
                s.largest_step, ds * float(np.clip((s.wanted_iterations + 0.5) / (point.iterations + 0.5), 0.5, 1.6))
            )
        self.outcome = Outcome.of(OutcomeCode.POINT_LIMIT, parameter=point.parameter, points=s.most_points)

    def _stuck(self, point: BranchPoint, failed: float, count: int) -> Outcome:
        """Why even the smallest step, ``failed``, was not possible."""
        # Newton's method may leave the predictor by some steps
        if all(self._is_finite(point.u + failed * times * point.tangent * point.scale) for times in (1, 4, 16, 64)):
            return Outcome.of(
                OutcomeCode.STEP_TOO_SMALL, parameter=point.parameter, points=count, step=self.settings.smallest_step
            )
        return Outcome.of(OutcomeCode.ORBIT_NOT_FINITE, parameter=point.parameter, points=count)

    def _is_finite(self, u: Floats) -> bool:
        try:
            R, J, _ = self.problem.residual(u)
        except NotFinite:
            return False
        except (ArithmeticError, np.linalg.LinAlgError):
            return True
        return bool(np.all(np.isfinite(R)) and np.all(np.isfinite(J)))

    def _step(self, point: BranchPoint, before: BranchPoint | None, ds: float) -> BranchPoint | None:
        s = self.settings
        scale = self.problem.scale(point.u)[0]
        t = point.tangent * point.scale / scale
        t = t / np.linalg.norm(t)
        along = point.u / scale + ds * t
        w = along if before is None else _extrapolated(before, point, scale, t, ds, along)
        new = correct(self.problem, w * scale, t, float(t @ along), scale, s, t, furthest=2.0 * ds + 1e-12)
        if new is None:
            return None
        same = self.same_kind(point, new)
        if not same and new.orientation * point.orientation < 0:
            new = new.reversed()
        if ds <= 30 * s.smallest_step:
            return new
        if same and float(new.tangent @ t) < s.smallest_cosine:
            return None
        return new if _astray(point, new) < MOST_ASTRAY else None


def follow_orbits(
    problem: OrbitContinuation, start: BranchPoint, low: float, high: float, settings: Settings | None = None
) -> Branch:
    """A branch of periodic orbits, to iterate over."""
    return Branch(problem, start, low, high, Settings() if settings is None else settings, problem.same_events)
