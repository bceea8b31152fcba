"""Pseudo-arclength continuation as a generator, for any residual that returns its Jacobian.

A *problem* has unknowns :math:`u = (x, \\lambda)` with :math:`k` equations :math:`R(u) = 0` and a one-dimensional
kernel of :math:`\\partial R/\\partial u` (k = size of u less one, or more equations that are consistent). From a point
with unit tangent :math:`t` the predictor is :math:`u + t\\,ds`, the corrector Newton's method with the row :math:`t^T
(u - u_{pred}) = 0`.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from scipy.linalg import eigvals
from scipy.optimize import brentq

from beamsim.flow.periodic_flow import NotFinite
from beamsim.orbits.branch import INTERRUPTED, NOT_BEGUN, BranchPoint, reached_end, too_many_points
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.typing import Floats

CLOSED_CURVE, NOT_SMOOTH, STEP_TOO_SMALL = "closed_curve", "not_smooth", "step_too_small"

ROUND_OFF_FACTOR = 1e3  # times the tolerance, up to which a residual may then be round-off, and no sign of divergence
MOST_OFF_PLANE = 0.1  # of a step, outside the span of both tangents: beyond it lies another branch
UNCHANGED = 1e-13  # of a tangent: unknowns below it do not change along the branch


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

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether two points have the same sequence of events, so that the branch between them has no corner."""


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


def _kernel(J: Floats) -> tuple[Floats, float]:
    """Unit kernel vector t of a Jacobian (k, n), and the sign of det [J; t]; of more than n - 1 rows it is 0."""
    k, n = J.shape
    t = np.linalg.svd(J)[2][n - 1]
    if k != n - 1:
        return t, 0.0
    size = np.abs(J).max(axis=1, keepdims=True)
    return t, float(np.linalg.slogdet(np.vstack([J / np.where(size > 0, size, 1.0), t]))[0])


def newton_step(J: Floats, row: Floats, R: Floats, r: float) -> Floats:
    """Where the linearised equations vanish; the least-squares solution of more equations than unknowns.

    Parameters
    ----------
    J : (k, n) scaled Jacobian.
    row : (n,) the further equation.
    R : (k,) scaled residual.
    r : residual of the further equation.

    Returns
    -------
    (n,) step of the scaled unknowns.

    Raises
    ------
    LinAlgError : where the equations are singular.
    """
    A, b = np.vstack([J, row]), -np.append(R, r)
    if A.shape[0] == A.shape[1]:
        return np.asarray(np.linalg.solve(A, b))
    return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])


@dataclass(frozen=True)
class Predictor:
    """A guess of a point, and the plane ``row . (u - guess) / scale = ahead`` on which the point is looked for."""

    guess: Floats  # (n,) unknowns
    row: Floats  # (n,) unit normal of the plane, in scaled unknowns
    scale: Floats  # (n,) of the unknowns
    reference: Floats | None = None  # (n,) direction in scaled unknowns that the tangent has a positive part along
    largest_distance: float = np.inf  # distance from the guess, in scaled unknowns, at which Newton's method gives up
    plane_offset: float = 0.0  # of the plane; a guess that is moved there beforehand leaves the curve that it lies on


def correct(problem: ContinuationProblem, predictor: Predictor, settings: Settings) -> BranchPoint | None:
    """The point of a branch near a predictor, by Newton's method.

    Parameters
    ----------
    problem : the residual.
    predictor : the guess, and where the point is looked for.
    settings : tolerance and iterations.

    Returns
    -------
    The point; None where the method does not converge.
    """
    row, scale, reference = predictor.row, predictor.scale, predictor.reference
    w = start = predictor.guess / scale
    last = before = moved = np.inf
    for iteration in range(settings.iterations + 1):
        try:
            R, J, data = problem.residual(u := w * scale)
        except (ArithmeticError, np.linalg.LinAlgError):
            return None
        rs = problem.scale(u)[1]
        Rw = R / rs
        size = float(np.abs(Rw).max()) if Rw.size else 0.0
        if not np.isfinite(size):
            return None
        Jw = J * scale / rs[:, None]
        off = float(row @ (w - start)) - predictor.plane_offset
        if _converged(size, moved, iteration, settings.tolerance) and abs(off) <= 1e-9 + settings.tolerance:
            tangent, sign = _kernel(Jw)
            point = BranchPoint(u, tangent, scale, size, sign, iteration, data)
            return point.reverse() if reference is not None and float(tangent @ reference) < 0 else point
        # five steps that do not halve the residual lead nowhere
        lost = size > 0.5 * before if iteration % 5 == 1 else iteration > 2 and size > 2.0 * last
        if iteration == settings.iterations or (lost and size > ROUND_OFF_FACTOR * settings.tolerance):
            return None
        try:
            step = newton_step(Jw, row, Rw, off)
        except np.linalg.LinAlgError:
            return None
        w = w + step
        moved = float(np.linalg.norm(step))
        if not np.linalg.norm(w - start) <= predictor.largest_distance:  # not a number included
            return None
        last, before = size, size if iteration % 5 == 1 else before
    return None


ROUND_OFF_STEP = 1e-13  # a shorter step of Newton's method, in scaled unknowns, is round-off


def _converged(residual: float, step_size: float, iteration: int, tolerance: float) -> bool:
    """Whether a residual is small enough, after a Newton step that moved the scaled unknowns so far."""
    # a guess that a step would not better is taken as it is: where branches cross, a step may lead off the own one
    # 0.01: of the tolerance, at which a first guess needs no correction
    if residual <= (tolerance if iteration else 0.01 * tolerance):
        return True
    # with stiff contacts round-off alone may exceed the tolerance, although the unknowns no longer change
    return step_size <= ROUND_OFF_STEP and residual <= ROUND_OFF_FACTOR * tolerance


def solve_at(
    problem: ContinuationProblem,
    guess: Floats,
    settings: Settings,
    parameter: float | None = None,
    forward: float = 1.0,
    largest_distance: float = np.inf,
) -> BranchPoint | None:
    """The solution at a fixed parameter.

    Parameters
    ----------
    problem, settings : as those of `correct`.
    guess : (n,) unknowns.
    parameter : its value, by default that of the guess.
    forward : whether the tangent points to larger values (> 0) or smaller ones.
    largest_distance : see `Predictor`.

    Returns
    -------
    The point; None where Newton's method does not converge.
    """
    scale = problem.scale(guess)[0]
    row = np.zeros(guess.size)
    row[-1] = 1.0
    u = guess.astype(float).copy()
    if parameter is not None:
        u[-1] = parameter
    point = correct(problem, Predictor(u, row, scale, largest_distance=largest_distance), settings)
    return None if point is None else point.orient(forward)


def correct_across(problem: ContinuationProblem, guess: Floats, settings: Settings) -> BranchPoint | None:
    """The solution near a guess, across the branch: a fold close by is no obstacle.

    Parameters
    ----------
    problem, settings : as those of `correct`.
    guess : (n,) unknowns.

    Returns
    -------
    The point; None where Newton's method does not converge.
    """
    scale, size = problem.scale(guess)
    try:
        J = problem.residual(guess)[1]
    except (ArithmeticError, np.linalg.LinAlgError):
        return None
    along, _ = _kernel(J * scale / size[:, None])
    return correct(problem, Predictor(guess, along, scale, along), settings)


def interpolate_unknowns(
    a: BranchPoint, b: BranchPoint, s: float, scale: Floats | None = None, arc_length: float | None = None
) -> Floats:
    """The unknowns s of the way from a point to another, on a cubic with both tangents in the length of the chord.

    Beyond b (s > 1) its error is of order ds^4, the tangent's of order ds^2. Where the tangents point back, and where
    the cubic would bend too far, they are on a straight line: the chord, and the tangent of b beyond it.

    Parameters
    ----------
    a, b : two points of a branch.
    s : share of the way, 1 at b.
    scale : (n,) of the unknowns, in which the arc is measured; by default that of a.
    arc_length : length of the arc beyond b, in place of the share.

    Returns
    -------
    (n,) unknowns.
    """
    if s == 0.0:
        return a.u
    scale = a.scale if scale is None else scale
    wb, chord = b.u / scale, (b.u - a.u) / scale
    ta, tb = (p.tangent * p.scale / scale for p in (a, b))
    ta, tb = ta / np.linalg.norm(ta), tb / np.linalg.norm(tb)
    length, turn = float(np.linalg.norm(chord)), ta - tb
    if arc_length is not None:
        length *= 1.0 + float(turn @ turn) / 24.0  # of an arc that turns by this much
    x = s - 1.0 if arc_length is None else arc_length / length
    if float(ta @ chord) <= 0 or float(tb @ chord) <= 0:
        return np.asarray((wb + x * (chord if x <= 0 else length * tb)) * scale)
    bend = x**2 * (length * (ta + 2.0 * tb) - 3.0 * chord) + x**3 * (length * (ta + tb) - 2.0 * chord)
    bend[(np.abs(ta) < UNCHANGED) & (np.abs(tb) < UNCHANGED)] = 0.0  # round-off there would grow from step to step
    # 2.0: of a cubic through two neighbours, in lengths between them
    if x > 2.0:
        bend[:] = 0.0
    return np.asarray((wb + x * length * tb + bend) * scale)


def _on_tangent(point: BranchPoint, row: Floats, target: float, scale: Floats) -> Floats:
    """A guess on a point's tangent, at ``row . (u / scale) = target``; next to a corner it is closer than the chord."""
    t = point.tangent * point.scale / scale
    w, along = point.u / scale, float(row @ t)
    # 0.1: cosine of a tangent and the chord, below which the tangent is no guess of what lies ahead
    if abs(along) < 0.1 * float(np.linalg.norm(t)):
        return point.u
    return np.asarray((w + (target - float(row @ w)) / along * t) * scale)


ProblemT_co = TypeVar("ProblemT_co", bound=ContinuationProblem, covariant=True)


BRANCHING_STEP = 1e-6  # in scaled unknowns, of differences at a branch point


@dataclass(frozen=True, eq=False)
class BranchStep(Generic[ProblemT_co]):
    """Two neighbours on a branch, and how points between them are found."""

    problem: ProblemT_co
    a: BranchPoint
    b: BranchPoint
    settings: Settings = field(default_factory=Settings)  # tolerance and iterations of the points

    @property
    def same_events(self) -> bool:
        """Whether both ends have the same sequence of events."""
        return self.problem.same_events(self.a, self.b)

    def sub_step(self, a: BranchPoint, b: BranchPoint) -> BranchStep[ProblemT_co]:
        """The part of the step between two of its points."""
        return replace(self, a=a, b=b)

    def share(self, point: BranchPoint) -> float:
        """Share of the way from a to b at which a point lies, along their chord."""
        chord = (self.b.u - self.a.u) / self.a.scale
        return float(((point.u - self.a.u) / self.a.scale) @ chord) / float(chord @ chord)

    def point_at(
        self, share: float, bracket: tuple[float, BranchPoint, float, BranchPoint] | None = None
    ) -> BranchPoint | None:
        """The point of the branch at a share of the way from a to b, measured along their chord.

        Parameters
        ----------
        share : of the chord.
        bracket : the shares and points of two known points on either side, to guess from; a and b by default.

        Returns
        -------
        The point; None where none is found.
        """
        a, wa, wb = self.a, self.a.u / self.a.scale, self.b.u / self.a.scale
        row = (wb - wa) / np.linalg.norm(wb - wa)
        target = float(row @ (wa + share * (wb - wa)))
        begin, left, end, right = (0.0, a, 1.0, self.b) if bracket is None else bracket
        s = (share - begin) / (end - begin)
        guesses = [interpolate_unknowns(left, right, s), left.u + s * (right.u - left.u)]
        nearest_first = (left, right) if s < 0.5 else (right, left)
        for guess in (*guesses, *(_on_tangent(end, row, target, a.scale) for end in nearest_first)):
            missing = target - float(row @ (guess / a.scale))
            predictor = Predictor(guess, row, a.scale, a.tangent, plane_offset=missing)
            point = correct(self.problem, predictor, self.settings)
            if point is not None:
                return point
        return None

    def at_parameter(self, value: float) -> BranchPoint | None:
        """The point between a and b, or beyond them, at a value of the parameter; None where none is found."""
        share = (value - self.a.parameter) / (self.b.parameter - self.a.parameter)
        guess = interpolate_unknowns(self.a, self.b, float(np.clip(share, 0.0, 1.0)))
        guess[-1] = value
        return solve_at(self.problem, guess, self.settings, value, self.b.parameter - self.a.parameter)

    def locate(
        self, test: Callable[[BranchPoint], float], values: tuple[float, float] | None = None
    ) -> BranchPoint | None:
        """The point at which a test function vanishes, to the tolerance of the points.

        The tolerance is that of the points, of their place on the step, and of values against the larger one at its
        ends. Where a test has several zeros, it is the sequence of Brent's method that decides on one.

        Parameters
        ----------
        test : the function.
        values : of the function at a and b, where they are known.

        Returns
        -------
        The point; None where the function does not change its sign, or no point in between is found.
        """
        fa, fb = values if values is not None else (test(self.a), test(self.b))
        if not (np.isfinite(fa) and np.isfinite(fb)) or fa * fb > 0:
            return None
        if fa == 0.0 or fb == 0.0:
            return self.a if fa == 0.0 else self.b
        known = [(0.0, self.a), (1.0, self.b)]  # shares in order, with their points; guesses are made from the closest
        tried: list[tuple[float, BranchPoint]] = []  # sizes of the values, the latest first
        biggest = max(abs(fa), abs(fb))

        def value(share: float) -> float:
            if share in (0.0, 1.0):
                return fb if share else fa
            at = bisect(known, share, key=lambda each: each[0])
            point = self.point_at(share, (*known[at - 1], *known[at]))
            found = np.nan if point is None else test(point)
            if point is None or not np.isfinite(found):
                raise ArithmeticError("no point was found")
            known.insert(at, (share, point))
            tried.insert(0, (abs(found), point))
            return found if abs(found) > self.settings.tolerance * biggest else 0.0

        with suppress(ArithmeticError):
            brentq(value, 0.0, 1.0, xtol=self.settings.tolerance, disp=False)
        # of equal values, such as signs, the latest
        return min(tried, key=lambda each: each[0])[1] if tried else None

    def branch_point(self) -> BranchPoint | None:
        """The point where branches cross; None where there is none.

        There the Jacobian has a kernel of two dimensions, along and across. With a further unknown :math:`\\beta` in
        :math:`R + \\beta c = 0` there is a solution for any place in this plane (Lyapunov and Schmidt); branches are
        :math:`\\beta = 0`, and where they cross its slopes vanish, too: two equations that are regular there.

        Returns
        -------
        The point; None where branches do not cross.
        """
        a, b, problem = self.a, self.b, self.problem
        if a.orientation * b.orientation >= 0:
            return None
        scale, size = problem.scale(a.u)
        begin, chord = a.u / scale, (b.u - a.u) / scale
        row = chord / np.linalg.norm(chord)
        c, plane = np.zeros((size.size, 1)), row[None]

        def equations(w: Floats) -> tuple[Floats, Floats, Any]:
            """R, its Jacobian by w and beta above the rows of the plane, and what was computed with it."""
            R, J, data = problem.residual(w * scale)
            return R / size, np.block([[J * scale / size[:, None], c], [plane, np.zeros((len(plane), 1))]]), data

        with suppress(ArithmeticError, np.linalg.LinAlgError):
            A, B = (equations(w)[1][:, :-1] for w in (begin, begin + chord))
            real = [x.real for x in eigvals(A, A - B).tolist() if x.imag == 0.0 and 0.0 <= x.real <= 1.0]
            for share in real[:1]:  # where a Jacobian that is linear in between is singular
                left, _, right = np.linalg.svd(A + share * (B - A))
                c, plane = left[:-1, -1:], np.vstack([row, right[-1]])
                y = np.append(interpolate_unknowns(a, b, share) / scale, 0.0)
                at, *shifted = (
                    np.linalg.inv(equations(y[:-1] + d)[1])[-1, -2:] for d in (0.0 * row, *(BRANCHING_STEP * plane))
                )
                bend = (np.array(shifted).T - at[:, None]) / BRANCHING_STEP
                # 20: steps of Newton's method, with one derivative of the slopes
                for count in range(20):
                    R, A, data = equations(y[:-1])
                    inverse = np.linalg.inv(A)
                    moved = np.linalg.solve(bend, -inverse[-1, -2:])
                    residual, t = float(np.abs(R).max()), inverse[:-1, -2]  # in the kernel, along the chord
                    # 1e-3, 0.1: the slopes vanish last
                    if max(1e-3 * residual, 0.1 * float(np.abs(moved).max())) <= self.settings.tolerance:
                        inside = 0.0 < float((y[:-1] - begin) @ row) < float(chord @ row)
                        point = BranchPoint(y[:-1] * scale, t / np.linalg.norm(t), scale, residual, 0.0, count, data)
                        return point if inside else None
                    missing, beta = R + y[-1] * c[:, 0], abs(float(y[-1]))
                    # where beta is stationary without being zero, branches pass each other
                    # 0.01: of beta, by which the next move may still change it
                    if max(float(np.abs(missing).max()), abs(float(moved @ bend @ moved))) < 0.01 * beta:
                        return None
                    y = y + inverse @ np.append(-missing, moved)
                    # 2.0: lengths of the step, beyond which the search has left it
                    if float(np.linalg.norm(y[:-1] - begin)) > 2.0 * float(np.linalg.norm(chord)):
                        return None
        return None


def _chord_error(a: BranchPoint, b: BranchPoint) -> float:
    """Relative distance of the chord from a to b from the plane of the two tangents.

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
    chord, offset = (b.u - a.u) / start.scale, (start.u - a.u) / start.scale
    length = float(np.linalg.norm(chord))
    share = float(offset @ chord) / length**2
    # 0.1: of a step, how far from it the first point may lie that it passes
    if not 0.0 <= share <= 1.0 or float(np.linalg.norm(offset - share * chord)) > 0.1 * length:
        return False
    return float(chord @ start.tangent) > 0.8 * length


@dataclass
class Branch:
    """Iterate over it to follow a branch; ``outcome`` then says how it ended.

    Between neighbours with other sequences of events the branch may have a corner, and the determinant, which no corner
    changes, orients the tangent.

    Parameters
    ----------
    problem : the residual.
    start : a converged point, whose tangent gives the direction.
    low, high : the parameter's range; the branch ends on the first end it reaches.
    settings : steps and tolerances.
    """

    problem: ContinuationProblem
    start: BranchPoint
    low: float
    high: float
    settings: Settings = field(default_factory=Settings)
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
                        self.outcome = self._step_failure(point, failed, count)
                        return
            if not self.low <= new.parameter <= self.high:
                edge = self.low if new.parameter < self.low else self.high
                last = BranchStep(self.problem, point, new, self.settings).at_parameter(edge)
                if last is not None:
                    yield last
                self.outcome = reached_end(edge)
                return
            if count > 1 and _passes(point, new, self.start):
                yield self.start
                self.outcome = Outcome.of(OutcomeKind.COMPLETE, CLOSED_CURVE, "closed curve")
                return
            before = point if self.problem.same_events(point, new) else None
            point = new
            yield point
            steps.append(ds)
            if sum(steps[-s.stall :]) < s.largest_step and len(steps) >= s.stall:
                self.outcome = Outcome.of(
                    OutcomeKind.STOPPED, NOT_SMOOTH,
                    f"the last {s.stall} steps together are shorter than the largest step of {s.largest_step:g}; the "
                    "branch is not smooth there (grazing, or a fold close to it)",
                    at=point.parameter,
                    remedy="follow it from its other end, or look at the motion there with a stepped sine",
                )  # fmt: skip
                return
            ds = min(
                s.largest_step, ds * float(np.clip((s.wanted_iterations + 0.5) / (point.iterations + 0.5), 0.5, 1.6))
            )
        self.outcome = too_many_points(s.most_points, point.parameter)

    def _step_failure(self, point: BranchPoint, failed: float, count: int) -> Outcome:
        """Why even the smallest step, ``failed``, was not possible."""
        finite = True
        for times in (1, 4, 16, 64):  # Newton's method may leave the predictor by some steps
            try:
                R, J, _ = self.problem.residual(point.u + failed * times * point.tangent * point.scale)
                finite = finite and bool(np.all(np.isfinite(R)) and np.all(np.isfinite(J)))
            except NotFinite:
                finite = False
            except (ArithmeticError, np.linalg.LinAlgError):
                continue
        if finite:
            return Outcome.of(
                OutcomeKind.STOPPED, STEP_TOO_SMALL,
                f"no solution even with the smallest step of {self.settings.smallest_step:g}, after {count} points",
                at=point.parameter, remedy="try a smaller step or another starting point",
            )  # fmt: skip
        return Outcome.of(
            OutcomeKind.STOPPED, "orbit_not_finite",
            f"beyond it the motion leaves the range of floating-point numbers, after {count} points",
            at=point.parameter, remedy="check the size of the loads and stiffnesses",
        )  # fmt: skip

    def _step(self, point: BranchPoint, previous: BranchPoint | None, ds: float) -> BranchPoint | None:
        s = self.settings
        scale = self.problem.scale(point.u)[0]
        t = point.tangent * point.scale / scale
        t = t / np.linalg.norm(t)
        w = along = point.u / scale + ds * t
        if previous is not None:
            w = interpolate_unknowns(previous, point, 1.0, scale, arc_length=ds) / scale
        missing, furthest = float(t @ (along - w)), 2.0 * ds + 1e-12
        new = correct(self.problem, Predictor(w * scale, t, scale, t, furthest, missing), s)
        if new is None:
            return None
        same = self.problem.same_events(point, new)
        if not same and new.orientation * point.orientation < 0:
            new = new.reverse()
        if ds <= 30 * s.smallest_step:
            return new
        if same and float(new.tangent @ t) < s.smallest_cosine:
            return None
        return new if _chord_error(point, new) < MOST_OFF_PLANE else None
