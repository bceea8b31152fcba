r"""A structure with a spring at one point: natural frequencies from the secular function, and back.

With the structure's modes (natural angular frequencies :math:`\omega_i`, mass-normalised deflections
:math:`\varphi_i` at the point) a grounded spring of stiffness k changes the eigenvalues to the roots of

.. math:: \frac{1}{k} = g(\lambda) = \sum_i \frac{\varphi_i^2}{\lambda - \omega_i^2} = -H(\sqrt\lambda),

H being the receptance at the point. g falls from :math:`+\infty` to :math:`-\infty` between two poles, so
there is one root between neighbouring natural frequencies (interlacing), it never falls with k, and it ends where
g = 0: at the frequencies of the structure with the point pinned. Read the other way round the
equation gives the stiffness behind a frequency in closed form (thesis, proposition 1.3.1, corrected:
:math:`d\lambda/dk = u_r^2` with the mass-normalised deflection :math:`u_r` at the spring).

Differences :math:`\lambda - \omega_i^2` are formed as products :math:`(\omega - \omega_i)(\omega + \omega_i)`, and
roots are sought as distances from the nearest pole, so that no digit is lost beyond the conditioning of the question.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from beamsim.typing import Bools, Floats

# A mode whose squared deflection at the point is below this part of the largest one does not feel the spring.
_NODE = 1e-26
# The same for the deflection itself, where it is asked whether the point is a node (finite elements know it to 1e-12).
_NODE_OF_SHAPE = 1e-8
# Natural frequencies closer together than this are one pole.
_SAME_POLE = 1e-13
_MOST_ITERATIONS = 200
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class SpringPoint:
    """The modes of a structure, seen from the point where a spring acts.

    Parameters
    ----------
    omega : (n,) natural angular frequencies without the spring, ascending, rad/s; zeros are rigid-body modes.
    shape : (n,) mass-normalised deflections at the point, 1/sqrt(kg).
    """

    omega: Floats
    shape: Floats

    @classmethod
    def of_modes(cls, omega: ArrayLike, shape: ArrayLike) -> SpringPoint:
        """The same with modes in any order."""
        omega, shape = np.asarray(omega, dtype=float), np.asarray(shape, dtype=float)
        order = np.argsort(omega, kind="stable")
        return cls(omega[order], shape[order])

    @cached_property
    def _poles(self) -> tuple[Floats, Floats, Floats]:
        """Poles of g, their weights, and the natural frequencies that no spring moves (repetitions, nodes)."""
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
        """Number, from 1, of the mode that a spring can bring to omega: one more than the free modes left of it are.

        Interlacing makes it unique: mode j moves between free frequencies j and j + 1.
        """
        return int(np.searchsorted(self.omega, omega, side="right"))

    def compliance(self, omega: ArrayLike) -> Floats:
        """g = -H: minus the receptance at the point, m/N, at angular frequencies of any shape."""
        poles, weights, _ = self._poles
        omega = np.asarray(omega, dtype=float)[..., None]
        with np.errstate(divide="ignore"):
            return np.asarray(np.sum(weights / ((omega - poles) * (omega + poles)), axis=-1))

    def stiffness(self, omega: ArrayLike) -> Floats:
        """Spring stiffness, N/m, that makes each omega a natural frequency; negative where only a negative one would.

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
        """(..., count) natural angular frequencies, ascending, with springs of the stiffnesses given (any shape).

        Every root is bracketed by its neighbouring poles and found to machine precision.
        """
        k = np.atleast_1d(np.asarray(stiffness, dtype=float))
        count = self.omega.size if count is None else min(count, self.omega.size)
        poles, _, fixed = self._poles
        with np.errstate(divide="ignore"):
            level = np.where(k > 0, 1.0 / k, np.inf)
        roots = [self._roots(j, level) for j in range(min(count, poles.size))]
        held = [np.full(k.shape, omega) for omega in fixed]
        found = np.sort(np.stack([*roots, *held], axis=-1), axis=-1)[..., :count]
        return np.asarray(found if np.ndim(stiffness) else found[0])

    def pinned(self, count: int | None = None) -> Floats:
        """(count,) natural angular frequencies with the point pinned; infinite for a mode that pinning takes away."""
        return self.frequencies(np.inf, count)

    def reach(self, mode: int) -> tuple[float, float]:
        """Lowest and highest angular frequency that a spring can give mode number `mode` (from 1)."""
        return float(self.omega[mode - 1]), float(self.pinned(mode)[mode - 1])

    def on_node(self, mode: int) -> bool:
        """Whether the point is a node of free mode number `mode`: a spring there leaves that mode as it is."""
        return bool(abs(self.shape[mode - 1]) <= _NODE_OF_SHAPE * np.abs(self.shape).max(initial=0.0))

    def participation(self, omega: ArrayLike) -> Floats:
        """u_r^2, 1/kg: squared mass-normalised deflection at the spring of the mode that the spring brings to omega.

        It is d lambda / dk; continuous down to the free modes (k = 0).
        """
        poles, weights, _ = self._poles
        omega = np.asarray(omega, dtype=float)
        difference = (omega[..., None] - poles) * (omega[..., None] + poles)
        nearest = np.min(np.abs(difference), axis=-1, keepdims=True)
        # g^2 / g'^2 with both sums scaled by the nearest pole's distance: 0 / 0 only on the pole itself.
        scaled = np.where(difference == 0, 1.0, nearest / np.where(difference == 0, 1.0, difference))
        scaled = np.where(nearest == 0, (difference == 0).astype(float), scaled)
        return np.asarray(np.sum(weights * scaled, axis=-1) ** 2 / np.sum(weights * scaled**2, axis=-1))

    def slope(self, omega: ArrayLike) -> Floats:
        """d omega / dk, rad/s per N/m, of the mode that the spring brings to omega (> 0)."""
        return np.asarray(self.participation(omega) / (2 * np.asarray(omega, dtype=float)))

    def _roots(self, j: int, level: Floats) -> Floats:
        """Angular frequencies where g = level between poles j and j + 1 (beyond the last: anywhere above)."""
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
    """(g - level) delta (width - delta), delta being the distance of lambda from the lower pole."""
    delta = np.broadcast_to(np.asarray(delta, dtype=float), level.shape)
    return np.asarray((np.sum(weights / (offset + delta[..., None]), axis=-1) - level) * delta * (width - delta))


def _bracketed(
    offset: Floats, weights: Floats, level: Floats, start: Floats, stop: Floats, *, origin_is_upper: Bools
) -> Floats:
    """Roots of (g - level) * delta between start and stop (one end is the pole itself, delta = 0).

    Newton's method on a function that is nearly linear close to the pole, kept inside a shrinking bracket and
    replaced by bisection (of the logarithm, towards the pole) whenever it would leave it. Vectorised over the roots.
    """
    own = np.abs(offset) == 0  # the pole that delta is measured from
    finite = np.isfinite(level) & np.isfinite(stop) & np.isfinite(start)
    c = np.where(finite, level, 0.0)
    # In x = |delta| both cases read: positive x, g falling in delta.
    side = np.where(origin_is_upper, -1.0, 1.0)
    low, high = np.zeros(level.shape), np.where(finite, np.maximum(np.abs(start), np.abs(stop)), 1.0)
    weight = np.sum(np.where(own, weights, 0.0), axis=-1)
    x = 0.5 * high
    for _ in range(_MOST_ITERATIONS):
        delta = side * x
        difference = np.where(own, 1.0, offset + delta[..., None])
        rest = np.sum(np.where(own, 0.0, weights / difference), axis=-1)
        rest_slope = -np.sum(np.where(own, 0.0, weights / difference**2), axis=-1)
        # (g - c) x = side w + (rest - c) x: its sign tells on which side of the root we are.
        value = side * weight + (rest - c) * x
        slope = (rest - c) + rest_slope * side * x
        beyond = value * side < 0  # past the root as seen from the pole
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
