r"""A structure with a spring at one point: frequencies from the stiffness and stiffness from a frequency.

With the structure's modes (natural angular frequencies :math:`\omega_i`, mass-normalised deflections
:math:`\varphi_i` at the point) a grounded spring of stiffness k changes the eigenvalues to the roots of

.. math:: \frac{1}{k} = g(\lambda) = \sum_i \frac{\varphi_i^2}{\lambda - \omega_i^2} = -H(\sqrt\lambda),

where H is the receptance at the point. g decreases from :math:`+\infty` to :math:`-\infty` between two poles, so there
is one root between neighbouring natural frequencies (interlacing). It does not decrease with k, and its upper limit
is at g = 0, the frequency of the structure with the point pinned. Solved for k, the equation gives the stiffness for
a frequency in closed form (H. Hazim, thesis, 2010, proposition 1.3.1, corrected: :math:`d\lambda/dk = u_r^2` with the
mass-normalised deflection :math:`u_r` at the spring).

Differences :math:`\lambda - \omega_i^2` are computed as products :math:`(\omega - \omega_i)(\omega + \omega_i)`, and
the unknown of a root is its distance from the nearest pole, so accuracy is limited only by the conditioning.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from beamsim.dataclass import dataclass
from beamsim.typing import Bools, Floats

# A mode does not load the spring if its squared deflection at the point is below this fraction of the largest.
_NODE = 1e-26
# The same for the deflection itself, to decide whether the point is a node (finite elements give it to 1e-12).
_NODE_OF_SHAPE = 1e-8
# Natural frequencies closer together than this count as one pole.
_SAME_POLE = 1e-13
_MOST_ITERATIONS = 200
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class SpringPoint:
    """Frequencies of a structure and deflections of its modes at the point where a spring acts.

    Parameters
    ----------
    omega : (n,) natural angular frequencies without the spring, ascending, rad/s; zeros are rigid-body modes.
    shape : (n,) mass-normalised deflections at the point, 1/sqrt(kg).
    """

    omega: Floats
    shape: Floats

    @classmethod
    def of_modes(cls, omega: ArrayLike, shape: ArrayLike) -> SpringPoint:
        """From modes in any order."""
        omega, shape = np.asarray(omega, dtype=float), np.asarray(shape, dtype=float)
        order = np.argsort(omega, kind="stable")
        return cls(omega[order], shape[order])

    @cached_property
    def _poles(self) -> tuple[Floats, Floats, Floats]:
        """Poles of g, their weights, and the natural frequencies that no spring changes (repeated, or with a node)."""
        weight = self.shape**2
        largest = float(weight.max(initial=0.0))
        poles: list[float] = []
        weights: list[float] = []
        fixed: list[float] = []
        for omega, w in zip(self.omega, weight, strict=True):
            if w <= _NODE * largest:
                fixed.append(float(omega))
            elif poles and omega - poles[-1] <= _SAME_POLE * omega:
                weights[-1] += float(w)
                fixed.append(poles[-1])
            else:
                poles.append(float(omega))
                weights.append(float(w))
        return np.array(poles), np.array(weights), np.array(fixed)

    def mode_number(self, omega: float) -> int:
        """Number, from 1, of the mode that a spring can raise to omega: the number of free modes at or below omega.

        It is unique because of interlacing: mode j stays between the free frequencies j and j + 1.
        """
        return int(np.searchsorted(self.omega, omega, side="right"))

    def compliance(self, omega: ArrayLike) -> Floats:
        """g = -H, minus the receptance at the point, m/N, at an array of angular frequencies."""
        poles, weights, _ = self._poles
        omega = np.asarray(omega, dtype=float)[..., None]
        with np.errstate(divide="ignore"):
            return np.asarray(np.sum(weights / ((omega - poles) * (omega + poles)), axis=-1))

    def stiffness(self, omega: ArrayLike) -> Floats:
        """Spring stiffness, N/m, that makes each omega a natural frequency; negative if no positive one does.

        Exact (closed form 1 / g) for the modes given; 0 at a free frequency, infinite at a pinned one.
        """
        poles, weights, _ = self._poles
        omega = np.asarray(omega, dtype=float)
        difference = (omega[..., None] - poles) * (omega[..., None] + poles)
        at_pole = difference == 0
        g = np.sum(weights / np.where(at_pole, 1.0, difference), axis=-1)
        with np.errstate(divide="ignore"):
            return np.where(at_pole.any(axis=-1), 0.0, 1.0 / g)

    def frequencies(self, stiffness: ArrayLike, count: int | None = None) -> Floats:
        """(..., count) natural angular frequencies, ascending, with a spring of each given stiffness (any shape).

        Every root is bracketed by its neighbouring poles and found to machine precision.
        """
        k = np.atleast_1d(np.asarray(stiffness, dtype=float))
        count = self.omega.size if count is None else min(count, self.omega.size)
        poles, _, fixed = self._poles
        with np.errstate(divide="ignore"):
            level = np.where(k > 0, 1.0 / k, np.inf)
        roots = [self._roots(j, level) for j in range(min(count, poles.size))]
        unchanged = [np.full(k.shape, omega) for omega in fixed]
        frequencies = np.sort(np.stack([*roots, *unchanged], axis=-1), axis=-1)[..., :count]
        return np.asarray(frequencies if np.ndim(stiffness) else frequencies[0])

    def pinned(self, count: int | None = None) -> Floats:
        """(count,) natural angular frequencies with the point pinned; infinite for a mode that pinning removes."""
        return self.frequencies(np.inf, count)

    def reach(self, mode: int) -> tuple[float, float]:
        """Lowest and highest angular frequency that a spring can give mode number `mode` (from 1)."""
        return float(self.omega[mode - 1]), float(self.pinned(mode)[mode - 1])

    def on_node(self, mode: int) -> bool:
        """Whether the point is a node of free mode number `mode`, so that a spring does not change the mode."""
        return bool(abs(self.shape[mode - 1]) <= _NODE_OF_SHAPE * np.abs(self.shape).max(initial=0.0))

    def participation(self, omega: ArrayLike) -> Floats:
        """u_r^2, 1/kg: squared mass-normalised deflection at the spring of the mode raised to omega.

        It equals d lambda / dk and is continuous down to the free modes (k = 0). It is 0 at the frequency of a mode
        with a node at the point: a mode that the spring raises to there, in ascending order, stays there.
        """
        poles, weights, fixed = self._poles
        omega = np.asarray(omega, dtype=float)
        difference = (omega[..., None] - poles) * (omega[..., None] + poles)
        nearest = np.min(np.abs(difference), axis=-1, keepdims=True)
        # g^2 / g'^2 with both sums scaled by the distance of the nearest pole: 0 / 0 only at the pole itself.
        scaled = np.where(difference == 0, 1.0, nearest / np.where(difference == 0, 1.0, difference))
        scaled = np.where(nearest == 0, (difference == 0).astype(float), scaled)
        participation = np.sum(weights * scaled, axis=-1) ** 2 / np.sum(weights * scaled**2, axis=-1)
        return np.asarray(np.where(np.isin(omega, np.setdiff1d(fixed, poles)), 0.0, participation))

    def slope(self, omega: ArrayLike) -> Floats:
        """d omega / dk, rad/s per N/m, of the mode that the spring raises to omega (> 0)."""
        return np.asarray(self.participation(omega) / (2 * np.asarray(omega, dtype=float)))

    def _roots(self, j: int, level: Floats) -> Floats:
        """Angular frequencies where g = level between poles j and j + 1 (above the last pole: anywhere above it)."""
        poles, weights, _ = self._poles
        lower = poles[j]
        if j + 1 < poles.size:
            width = (poles[j + 1] - lower) * (poles[j + 1] + lower)
            # (g - level) times the distances to both poles is smooth and changes sign between them.
            middle = _function(0.5 * width, level, (lower - poles) * (lower + poles), weights, width)
            from_above = middle > 0
        else:
            with np.errstate(divide="ignore"):
                width = np.where(level > 0, weights.sum() / np.where(level > 0, level, 1.0), np.inf) * (1 + 4 * _EPS)
            from_above = np.zeros(level.shape, dtype=bool)
            if np.isinf(width).all():
                return np.full(level.shape, np.inf)
        origin = np.where(from_above, poles[min(j + 1, poles.size - 1)], lower)
        offset = (origin[..., None] - poles) * (origin[..., None] + poles)
        span = np.broadcast_to(np.asarray(width, dtype=float), level.shape)
        start = np.where(from_above, -0.5 * span, 0.0)
        stop = np.where(from_above, 0.0, (0.5 if j + 1 < poles.size else 1.0) * span)
        delta = _bracketed(offset, weights, level, start, stop, origin_is_upper=from_above)
        squared = origin**2 + delta
        root = np.where(origin > 0, origin + delta / (origin + np.sqrt(squared)), np.sqrt(squared))
        return np.asarray(np.where(np.isinf(level), lower, root), dtype=float)


def _function(delta: ArrayLike, level: Floats, offset: Floats, weights: Floats, width: float) -> Floats:
    """(g - level) delta (width - delta), with delta the distance of lambda from the lower pole."""
    delta = np.broadcast_to(np.asarray(delta, dtype=float), level.shape)
    return np.asarray((np.sum(weights / (offset + delta[..., None]), axis=-1) - level) * delta * (width - delta))


def _bracketed(
    offset: Floats, weights: Floats, level: Floats, start: Floats, stop: Floats, *, origin_is_upper: Bools
) -> Floats:
    """Roots of (g - level) * delta between start and stop (one end is the pole itself, delta = 0).

    Newton's method on a function that is nearly linear close to the pole, safeguarded by a shrinking bracket: a step
    that would leave it is replaced by bisection (of the logarithm, towards the pole). Vectorised over the roots.
    """
    origin = np.abs(offset) == 0  # the pole from which delta is measured
    finite = np.isfinite(level) & np.isfinite(stop) & np.isfinite(start)
    c = np.where(finite, level, 0.0)
    # With x = |delta| both cases have positive x, with g decreasing in delta.
    side = np.where(origin_is_upper, -1.0, 1.0)
    low, high = np.zeros(level.shape), np.where(finite, np.maximum(np.abs(start), np.abs(stop)), 1.0)
    weight = np.sum(np.where(origin, weights, 0.0), axis=-1)
    x = 0.5 * high
    for _ in range(_MOST_ITERATIONS):
        delta = side * x
        difference = np.where(origin, 1.0, offset + delta[..., None])
        rest = np.sum(np.where(origin, 0.0, weights / difference), axis=-1)
        rest_slope = -np.sum(np.where(origin, 0.0, weights / difference**2), axis=-1)
        # (g - c) x = side w + (rest - c) x: its sign gives the side of the root.
        value = side * weight + (rest - c) * x
        slope = (rest - c) + rest_slope * side * x
        beyond = value * side < 0  # beyond the root, counted from the pole
        high = np.where(beyond, x, high)
        low = np.where(beyond, low, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = x - value / slope
        halfway = np.where(low > 0, np.sqrt(low * high), 0.5 * (low + high))
        inside = np.isfinite(step) & (step > low) & (step < high)
        following = np.where(value == 0, x, np.where(inside, step, halfway))
        done = (np.abs(following - x) <= _EPS * x) | (high - low <= 2 * _EPS * high) | ~finite
        x = np.where(finite, following, x)
        if done.all():
            break
    return np.asarray(side * x)
