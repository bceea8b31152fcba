"""Pseudo-arclength continuation as a generator, for any residual that returns its Jacobian.

A *problem* has unknowns :math:`u = (x, \\lambda)` with :math:`k` equations :math:`R(u) = 0` and a one-dimensional
kernel of :math:`\\partial R/\\partial u` (k = size of u less one, or more equations that are consistent). From a
point with unit tangent
:math:`t` the predictor is :math:`u + t\\,ds`, the corrector Newton's method with the row :math:`t^T (u - u_{pred}) =
0`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Branch", "BranchPoint", "Problem", "Settings", "correct", "locate", "solve_at", "tangent_at"]

Floats = NDArray[np.float64]


class Problem(Protocol):
    """A residual with its Jacobian."""

    def residual(self, u: Floats) -> tuple[Floats, Floats, Any]:
        """R (k,), its Jacobian (k, size of u), and what was computed with them (kept with the point).

        Raises
        ------
        ArithmeticError : where the residual cannot be computed; the step is then shortened.
        """

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Typical sizes of the unknowns (size of u,) and of the residuals (k,)."""


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


@dataclass(frozen=True)
class BranchPoint:
    """A converged point of a branch."""

    u: Floats
    tangent: Floats  # unit vector in scaled unknowns
    scale: Floats  # of the unknowns, to which the tangent refers
    residual: float  # largest, against its scale
    orientation: float  # sign of det [J; tangent]
    iterations: int
    data: Any  # what the problem computed there

    @property
    def parameter(self) -> float:
        """The last unknown."""
        return float(self.u[-1])


def _null_vector(J: Floats, previous: Floats | None) -> tuple[Floats, float]:
    """Unit kernel vector and the sign of det [J; t]; a square bordered solve where a previous vector is known."""
    k, n = J.shape
    if k == n - 1:
        if previous is not None:
            bordered = np.vstack([J, previous])
            try:
                t = np.linalg.solve(bordered, np.concatenate([np.zeros(k), [1.0]]))
            except np.linalg.LinAlgError:
                t = np.full(n, np.nan)
            size = float(np.linalg.norm(t))
            if np.isfinite(size) and size < 1e6:
                t = t / size
                return t, float(np.sign(np.linalg.det(np.vstack([J / np.abs(J).max(axis=1, keepdims=True), t]))))
        t = np.linalg.svd(J)[2][-1]
        return t, float(np.sign(np.linalg.det(np.vstack([J / np.abs(J).max(axis=1, keepdims=True), t]))))
    return np.linalg.svd(J)[2][n - 1], 0.0


def _newton_step(J: Floats, row: Floats, R: Floats, r: float) -> Floats:
    A, b = np.vstack([J, row]), -np.concatenate([R, [r]])
    if A.shape[0] == A.shape[1]:
        return np.asarray(np.linalg.solve(A, b))
    return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])


def correct(
    problem: Problem,
    guess: Floats,
    row: Floats,
    target: float,
    scale: Floats,
    settings: Settings,
    reference: Floats | None = None,
    orient: float = 0.0,
    furthest: float = np.inf,
) -> BranchPoint | None:
    """Newton's method on ``R(u) = 0, row . (u / scale) = target``; None where it does not converge.

    ``reference`` (scaled) orients the tangent; with ``orient`` not zero the determinant does. ``furthest`` limits the
    distance from the guess.
    """
    w = guess / scale
    start = w.copy()
    last = np.inf
    for iteration in range(settings.iterations + 1):
        u = w * scale
        try:
            R, J, data = problem.residual(u)
        except (ArithmeticError, np.linalg.LinAlgError):
            return None
        rs = problem.scale(u)[1]
        size = float(np.max(np.abs(R) / rs, initial=0.0))
        if not np.isfinite(size):
            return None
        Jw = J * scale / rs[:, None]
        off = float(row @ w - target)
        # at the tolerance, or at round-off: no longer decreasing though small
        if size <= settings.tolerance and abs(off) <= 1e-9 + settings.tolerance:
            tangent, sign = _null_vector(Jw, reference)
            if reference is not None and orient == 0.0:
                flip = float(tangent @ reference) < 0
            else:
                flip = orient != 0.0 and sign * orient < 0
            if flip:
                tangent, sign = -tangent, -sign
            return BranchPoint(u, tangent, scale, size, sign, iteration, data)
        if iteration == settings.iterations or (
            iteration > 2 and size > 2.0 * last and size > 1e3 * settings.tolerance
        ):
            return None
        try:
            step = _newton_step(Jw, row, R / rs, off)
        except np.linalg.LinAlgError:
            return None
        if not np.all(np.isfinite(step)):
            return None
        w = w + step
        if float(np.linalg.norm(w - start)) > furthest:
            return None
        last = size
    return None


def solve_at(
    problem: Problem, guess: Floats, settings: Settings, parameter: float | None = None, forward: float = 1.0
) -> BranchPoint | None:
    """The solution at a fixed parameter, its tangent pointing to larger (``forward`` > 0) or smaller values."""
    scale = problem.scale(guess)[0]
    row = np.zeros(guess.size)
    row[-1] = 1.0
    u = guess.astype(float).copy()
    if parameter is not None:
        u[-1] = parameter
    point = correct(problem, u, row, float(u[-1] / scale[-1]), scale, settings)
    if point is None:
        return None
    t = point.tangent
    if t[-1] * forward < 0:
        return BranchPoint(point.u, -t, scale, point.residual, -point.orientation, point.iterations, point.data)
    return point


def tangent_at(point: BranchPoint) -> Floats:
    """The tangent in the unknowns' own units, du/ds."""
    return point.tangent * point.scale


def _hermite(a: BranchPoint, b: BranchPoint, s: float) -> Floats:
    """A guess between two points, s in [0, 1] of the way: cubic with both tangents."""
    wa, wb = a.u / a.scale, b.u / a.scale
    tb = b.tangent * b.scale / a.scale
    tb = tb / np.linalg.norm(tb)
    chord = float(np.linalg.norm(wb - wa))
    if float(tb @ (wb - wa)) <= 0 or float(a.tangent @ (wb - wa)) <= 0:
        return np.asarray((wa + s * (wb - wa)) * a.scale)
    h00, h10 = 2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s
    h01, h11 = -2 * s**3 + 3 * s**2, s**3 - s**2
    return np.asarray((h00 * wa + h10 * chord * a.tangent + h01 * wb + h11 * chord * tb) * a.scale)


def between(problem: Problem, a: BranchPoint, b: BranchPoint, s: float, settings: Settings) -> BranchPoint | None:
    """The point of the branch a share s of the way from a to b, measured along their chord."""
    wa, wb = a.u / a.scale, b.u / a.scale
    row = (wb - wa) / np.linalg.norm(wb - wa)
    target = float(row @ (wa + s * (wb - wa)))
    reference = a.tangent
    for guess in (_hermite(a, b, s), (wa + s * (wb - wa)) * a.scale):
        point = correct(problem, guess, row, target, a.scale, settings, reference)
        if point is not None:
            return point
    return None


def locate(
    problem: Problem,
    a: BranchPoint,
    b: BranchPoint,
    test: Callable[[BranchPoint], float],
    settings: Settings,
    values: tuple[float, float] | None = None,
    tolerance: float = 1e-13,
) -> BranchPoint | None:
    """The point between two neighbours at which a test function vanishes (bracketed secants; Illinois, then
    bisection)."""
    fa, fb = values if values is not None else (test(a), test(b))
    if not (np.isfinite(fa) and np.isfinite(fb)) or fa * fb > 0:
        return None
    if fa == 0.0:
        return a
    if fb == 0.0:
        return b
    left, right = 0.0, 1.0
    best: BranchPoint | None = None
    best_value, biggest = np.inf, max(abs(fa), abs(fb))
    side = 0
    for iteration in range(60):
        s = right - fb * (right - left) / (fb - fa)
        if not left < s < right or iteration % 8 == 7:
            s = 0.5 * (left + right)
        point = between(problem, a, b, s, settings)
        if point is None:
            return best
        f = test(point)
        if not np.isfinite(f):
            return best
        if abs(f) < best_value:
            best, best_value = point, abs(f)
        if abs(f) <= tolerance * biggest or right - left < 1e-14:
            return best
        if f * fb < 0:
            left, fa = s, f
            left, right, fa, fb = left, right, fa, fb
            if side == -1:
                fb *= 0.5
            side = -1
        else:
            right, fb = s, f
            if side == 1:
                fa *= 0.5
            side = 1
    return best


@dataclass
class Branch:
    """Iterate over it to follow a branch; ``status`` then says why it ended.

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

    problem: Problem
    start: BranchPoint
    low: float
    high: float
    settings: Settings = field(default_factory=Settings)
    same_kind: Callable[[BranchPoint, BranchPoint], bool] = lambda a, b: True
    status: str = "not begun"
    rejected: int = 0

    def __iter__(self) -> Iterator[BranchPoint]:
        s = self.settings
        point = self.start
        yield point
        ds = s.step
        steps: list[float] = []
        for count in range(1, s.most_points):
            new = None
            while new is None:
                new = self._step(point, ds)
                if new is None:
                    self.rejected += 1
                    ds *= 0.4
                    if ds < s.smallest_step:
                        self.status = (
                            f"stopped at parameter {point.parameter:.9g} after {count} points: no solution within the "
                            f"smallest step of {s.smallest_step:g}; a smaller one or another starting point may go on"
                        )
                        return
            if not self.low <= new.parameter <= self.high:
                edge = self.low if new.parameter < self.low else self.high
                last = self._at_edge(point, new, edge)
                if last is not None:
                    yield last
                self.status = f"complete: reached {edge:.9g}"
                return
            point = new
            yield point
            steps.append(ds)
            if sum(steps[-s.stall :]) < s.largest_step and len(steps) >= s.stall:
                self.status = (
                    f"stopped at parameter {point.parameter:.9g}: the last {s.stall} steps together are shorter than "
                    f"the largest step of {s.largest_step:g}; it is not smooth here (grazing, or a fold beside it)"
                )
                return
            distance = np.linalg.norm((point.u - self.start.u) / self.start.scale)
            if count > 10 and distance < 0.5 * ds and float(point.tangent @ self.start.tangent) > 0.9:
                self.status = "complete: closed curve"
                return
            ds = min(
                s.largest_step, ds * float(np.clip((s.wanted_iterations + 0.5) / (point.iterations + 0.5), 0.5, 1.6))
            )
        self.status = f"stopped after {s.most_points} points, the most allowed"

    def _step(self, point: BranchPoint, ds: float) -> BranchPoint | None:
        s = self.settings
        scale = self.problem.scale(point.u)[0]
        t = point.tangent * point.scale / scale
        t = t / np.linalg.norm(t)
        w = point.u / scale + ds * t
        new = correct(self.problem, w * scale, t, float(t @ w), scale, s, t, furthest=2.0 * ds + 1e-12)
        if new is None:
            return None
        if self.same_kind(point, new):
            if float(new.tangent @ t) < s.smallest_cosine and ds > 30 * s.smallest_step:
                return None
            return new
        if new.orientation * point.orientation < 0:
            new = BranchPoint(
                new.u, -new.tangent, new.scale, new.residual, -new.orientation, new.iterations, new.data
            )  # fmt: skip
        return new

    def _at_edge(self, a: BranchPoint, b: BranchPoint, edge: float) -> BranchPoint | None:
        share = (edge - a.parameter) / (b.parameter - a.parameter)
        guess = _hermite(a, b, float(np.clip(share, 0.0, 1.0)))
        guess[-1] = edge
        return solve_at(self.problem, guess, self.settings, edge, b.parameter - a.parameter)
