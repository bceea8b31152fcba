r"""A structure with a spring at one point: frequencies from the stiffness and stiffness from a frequency.

With the structure's modes (natural angular frequencies :math:`\omega_i`, mass-normalised deflections
:math:`\varphi_i` at the point) a grounded spring of stiffness k changes the eigenvalues to the roots of

.. math:: \frac{1}{k} = g(\lambda) = \sum_i \frac{\varphi_i^2}{\lambda - \omega_i^2} = -H(\sqrt\lambda),

where H is the receptance at the point. g decreases from :math:`+\infty` to :math:`-\infty` between two poles, so there
is one root between neighbouring natural frequencies (interlacing). It does not decrease with k, and its upper limit
is at g = 0, the frequency of the structure with the point pinned. Solved for k, the equation gives the stiffness for
a frequency in closed form (H. Hazim, thesis, 2010, proposition 1.3.1, corrected: :math:`d\lambda/dk = u_r^2` with the
mass-normalised deflection :math:`u_r` at the spring).

Differences :math:`\lambda - \omega_i^2` are computed as products :math:`(\omega - \omega_i)(\omega + \omega_i)`, so
accuracy is limited only by the conditioning.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from beamsim.typing import Floats

_EPS = float(np.finfo(float).eps)
ONE_POLE = 1e-13  # relative distance of natural frequencies that count as one pole
NODE = 1e-26  # share of the largest weight of a mode that the spring does not reach


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
            # a mode with a node there does not load the spring
            if w <= NODE * largest:
                fixed.append(float(omega))
            elif poles and omega - poles[-1] <= ONE_POLE * omega:
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
        shape, k = np.shape(stiffness), np.asarray(stiffness, dtype=float).ravel()
        count = self.omega.size if count is None else min(count, self.omega.size)
        poles, _, fixed = self._poles
        with np.errstate(divide="ignore"):
            level = np.where(k > 0, 1.0 / k, np.inf)
        roots = [self._roots(j, level) for j in range(min(count, poles.size))]
        unchanged = [np.full(k.shape, omega) for omega in fixed]
        return np.sort(np.stack([*roots, *unchanged], axis=-1), axis=-1)[:, :count].reshape(*shape, count)

    def pinned(self, count: int | None = None) -> Floats:
        """(count,) natural angular frequencies with the point pinned; infinite for a mode that pinning removes."""
        return self.frequencies(np.inf, count)

    def reach(self, mode: int) -> tuple[float, float]:
        """Lowest and highest angular frequency that a spring can give mode number `mode` (from 1)."""
        return float(self.omega[mode - 1]), float(self.pinned(mode)[mode - 1])

    def on_node(self, mode: int) -> bool:
        """Whether the point is a node of free mode number `mode`, so that a spring does not change the mode."""
        # finite elements give nodes to 1e-12
        return bool(abs(self.shape[mode - 1]) <= 1e-8 * np.abs(self.shape).max(initial=0.0))

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
        """Angular frequencies where g = level (s,) between poles j and j + 1, or above the last pole."""
        from scipy.optimize.elementwise import find_root

        poles, weights, _ = self._poles
        lower, last = poles[j], j + 1 == poles.size
        rest, others = np.delete(poles, [j] if last else [j, j + 1]), np.delete(weights, [j] if last else [j, j + 1])
        with np.errstate(divide="ignore"):
            reach = np.sqrt(lower**2 + weights.sum() / level * (1 + 4 * _EPS))  # no root is further above the last pole
        upper = reach if last else np.full(level.shape, poles[j + 1])
        known = np.isfinite(level) & np.isfinite(upper)

        def value(omega: Floats, level: Floats) -> Floats:
            """(level - g) times the distances from the poles in lambda: negative at the lower end, then positive."""
            below = (omega - lower) * (omega + lower)
            g = np.sum(others / ((omega[..., None] - rest) * (omega[..., None] + rest)), axis=-1)
            least = (level - g) * below - weights[j]
            if last:
                return np.asarray(least)
            return np.asarray(least * (poles[j + 1] - omega) * (poles[j + 1] + omega) + weights[j + 1] * below)

        bracket = (np.full(level.shape, lower), np.where(known, upper, lower + 1.0))
        found = find_root(value, bracket, args=(np.where(known, level, 0.0),))
        root = np.where(found.success, found.x, upper)
        return np.asarray(np.where(np.isinf(level), lower, np.where(known, root, np.inf)), dtype=float)
