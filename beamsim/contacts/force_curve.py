r"""Force over deflection as a rising piecewise-linear curve through zero, given or fitted to measured points.

The curve of segments with slopes :math:`s_i \ge 0` between knots :math:`0 = b_0 < b_1 < \dots` is
:math:`N(x) = \sum_i s_i \min(\max(x - b_i, 0), b_{i+1} - b_i)`, the last slope going on. For given knots the slopes
that fit best follow from non-negative least squares. The knots begin as those of a dynamic programme (independent
straight lines on stretches of the points) or evenly among the points, and move together to where the squared misfit is
least near there. Up to ten segments every knot then looks for a better place between its neighbours, until
none finds one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.typing import Floats


@dataclass(frozen=True)
class ForceCurve:
    """A continuous rising curve from zero; the last slope goes on."""

    deflection: Floats  # (p,) m, increasing, the first zero
    force: Floats  # (p,) N, not falling, the first zero

    @classmethod
    def line(cls, stiffness: float) -> ForceCurve:
        """That of a spring, N/m."""
        return cls(np.array([0.0, 1.0]), np.array([0.0, stiffness]))

    @property
    def slopes(self) -> Floats:
        """(p - 1,) N/m."""
        return np.asarray(np.diff(self.force) / np.diff(self.deflection))

    @property
    def stiffness(self) -> float:
        """N/m, the first slope that is not zero."""
        return float(self.slopes[self.slopes > 0][0])

    def at(self, deflection: Floats) -> Floats:
        """Forces at deflections; zero at negative ones."""
        beyond = np.maximum(deflection - self.deflection[-1], 0.0) * self.slopes[-1]
        return np.asarray(np.interp(deflection, self.deflection, self.force) + beyond)


def fit_curve(deflection: Floats, force: Floats, segments: int) -> tuple[ForceCurve, float]:
    """The rising curve through zero that is closest to points in the mean square.

    Parameters
    ----------
    deflection, force : (p,) points, m and N; those at negative deflections are points without contact.
    segments : largest number of them.

    Returns
    -------
    ForceCurve, float
        The curve, and the root mean square of the points' distances from it, N.

    Raises
    ------
    ValueError
        Where no force is positive, or the force does not rise.
    """
    used = deflection > 0.0
    x, y = deflection[used], force[used]
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    if not x.size or not np.any(y > 0.0):
        raise ValueError("no point has a positive deflection and a positive force")
    knots = _best_knots(x, y, segments)
    slopes, square = _slopes(x, y, knots)
    edges = np.append(knots, x[-1])
    curve = ForceCurve(edges, np.concatenate([[0.0], np.cumsum(slopes * np.diff(edges))]))
    if curve.force[-1] <= 0.0:
        raise ValueError("the force does not rise with the deflection")
    return _merged(curve), float(np.sqrt(square / x.size))


def _best_knots(x: Floats, y: Floats, segments: int) -> Floats:
    """Knots of at most so many segments, the first at zero."""
    places = np.unique(x)
    if places.size <= segments:  # no rising curve is closer than one that bends at the points
        return np.concatenate([[0.0], places[:-1]])
    even = np.concatenate([[0.0], places[np.arange(1, segments) * places.size // segments]])
    starts = [_moved_together(x, y, knots) for knots in (_starting_knots(x, y, segments), even)]
    knots = min(starts, key=lambda knots: _slopes(x, y, knots)[1])
    return _moved_one_by_one(x, y, knots) if knots.size <= 10 else knots


def _merged(curve: ForceCurve) -> ForceCurve:
    """Without points between segments of one slope."""
    slopes = curve.slopes
    bends = np.flatnonzero(np.abs(np.diff(slopes)) > 1e-9 * slopes.max()) + 1
    kept = np.concatenate([[0], bends, [slopes.size]])
    return ForceCurve(curve.deflection[kept], curve.force[kept])


def hinges(x: Floats, knots: Floats) -> Floats:
    """(points, knots) stretch of each segment at deflections: what the slopes multiply."""
    width = np.append(np.diff(knots), np.inf)
    return np.asarray(np.clip(x[:, None] - knots, 0.0, width))


def fitted_numbers(matrix: Floats, target: Floats) -> tuple[Floats, float]:
    """Numbers, none negative, whose combination of columns is closest to a target, and the squared misfit."""
    from scipy.optimize import nnls

    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    numbers = nnls(matrix / scale, target)[0] / scale
    return numbers, float(np.sum((matrix @ numbers - target) ** 2))


def _slopes(x: Floats, y: Floats, knots: Floats) -> tuple[Floats, float]:
    """Slopes that fit best, and the squared misfit."""
    return fitted_numbers(hinges(x, knots), y)


def _starting_knots(x: Floats, y: Floats, segments: int) -> Floats:
    """Knots between the stretches of points on which independent straight lines fit best, the first knot at zero."""
    edge = np.unique(np.linspace(0, x.size, min(120, x.size) + 1).astype(int))  # ends of stretches to choose from
    count = edge.size - 1
    segments = min(segments, count)
    # sums up to each edge give the misfit of a line on any stretch
    total = np.vstack([np.zeros(6), np.cumsum(np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1), axis=0)])
    total = total[edge]
    n, sx, sy, sxx, sxy, syy = np.moveaxis(total[None] - total[:, None], 2, 0)  # [first, last]
    with np.errstate(divide="ignore", invalid="ignore"):
        cxx, cxy, cyy = sxx - sx**2 / n, sxy - sx * sy / n, syy - sy**2 / n
        misfit = np.where(cxx > 1e-12 * sxx, cyy - cxy**2 / cxx, cyy)
    misfit = np.where(np.triu(np.ones_like(misfit), 1) > 0, np.maximum(np.nan_to_num(misfit), 0.0), np.inf)
    best = misfit[0].copy()
    chosen = []
    for _ in range(segments - 1):
        through = best[:, None] + misfit
        chosen.append(np.argmin(through, axis=0))
        best = through[chosen[-1], np.arange(count + 1)]
    at, knots = count, [0.0]
    for last in reversed(chosen):
        at = int(last[at])
        if 0 < edge[at] < x.size:
            knots.append(0.5 * float(x[edge[at] - 1] + x[edge[at]]))
    return np.unique(knots)


def _moved_together(x: Floats, y: Floats, knots: Floats) -> Floats:
    """Knots and slopes at a minimum of the squared misfit near the given knots."""
    from scipy.optimize import least_squares

    if knots.size == 1:
        return knots
    reach, top = float(x[-1]), float(np.abs(y).max())
    count = knots.size - 1

    def parts(unknowns: Floats) -> tuple[Floats, Floats]:
        return np.concatenate([[0.0], np.cumsum(unknowns[:count])]), unknowns[count:]

    def residual(unknowns: Floats) -> Floats:
        at, slopes = parts(unknowns)
        return np.asarray(hinges(x / reach, at) @ slopes - y / top)

    def jacobian(unknowns: Floats) -> Floats:
        at, slopes = parts(unknowns)
        by_knot = (slopes[:-1] - slopes[1:]) * (x[:, None] / reach > at[1:])
        return np.hstack([np.cumsum(by_knot[:, ::-1], axis=1)[:, ::-1], hinges(x / reach, at)])

    slopes, square = _slopes(x, y, knots)
    start = np.concatenate([np.diff(knots) / reach, slopes * reach / top])
    low = np.concatenate([np.full(count, 1e-9), np.zeros(count + 1)])
    fit = least_squares(residual, np.maximum(start, low + 1e-12), jacobian, bounds=(low, np.inf), max_nfev=200)
    moved = parts(fit.x)[0] * reach
    moved = moved[moved < reach]
    return moved if _slopes(x, y, moved)[1] < square else knots


def _moved_one_by_one(x: Floats, y: Floats, knots: Floats) -> Floats:
    """Knots moved between their neighbours until the misfit no longer becomes less."""
    from scipy.optimize import minimize_scalar

    square = _slopes(x, y, knots)[1]
    floor = 1e-24 * float(y @ y)
    for _ in range(20):
        before = square
        for i in range(1, knots.size):
            low = knots[i - 1]
            high = knots[i + 1] if i + 1 < knots.size else x[-1]

            def misfit(at: float, below: Floats = knots[:i], above: Floats = knots[i + 1 :]) -> float:
                return _slopes(x, y, np.concatenate([below, [at], above]))[1]

            # the misfit has a minimum for each gap between points: look at a few places before going downhill
            places = np.linspace(low, high, 12)[1:-1]
            values = [misfit(place) for place in places]
            k = int(np.argmin(values))
            bounds = (low if k == 0 else places[k - 1], high if k == places.size - 1 else places[k + 1])
            lowest = minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-9 * x[-1]})
            for at, value in ((places[k], values[k]), (float(lowest.x), float(lowest.fun))):
                if value < square and low < at < high:
                    knots, square = np.concatenate([knots[:i], [at], knots[i + 1 :]]), value
        if square <= floor or before - square <= 1e-7 * before:
            break
    return knots
