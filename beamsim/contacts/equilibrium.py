r"""Static equilibrium: the minimum of a convex, piecewise quadratic energy.

.. math:: E(q) = \tfrac12 q^T K q + \tfrac12 \sum_i k_i [\delta_i(q)]_+^2 - f^T q,
          \qquad \delta_i = -g_i - s_i \phi_i q .

Cubic springs add :math:`\tfrac14 c\,(b^T q)^4`. One-sided springs with negative stiffness represent a softening spring;
the total energy is still convex. Newton's method with an exact line search finds the minimum: between contact changes
the energy is quadratic, so that a few steps suffice. Then the solution is refined with residuals that are rounded once,
and checked for uniqueness.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
from scipy.linalg import block_diag, null_space, qr, solve_triangular

from beamsim.contacts.pads import fitted_numbers
from beamsim.errors import NotTrustedError
from beamsim.typing import Bools, Floats, Ints

_ROUND_OFF = 1e-10  # relative, of loads and gaps
_ON_NODE = 1e-13  # relative; a smaller deflection in a rigid-body motion is zero
_CANCELLATION = 1e-13  # relative to the terms of a sum that cancel
_SPLIT = 2.0**27 + 1.0  # factor that splits a number into two halves of its digits

UNBALANCED_MESSAGE = "the loads are not in balance: no support or snubber can hold the structure against them"
FLOATING_MESSAGE = "the structure floats: it has rigid-body motions that no support or closed snubber holds in place"


@dataclass(frozen=True)
class Springs:
    """One-sided springs of a static problem."""

    shape: Floats  # (m, n)
    sign: Floats  # (m,) +1 below, -1 above
    stiffness: Floats  # (m,) N/m; negative where a piecewise-linear spring softens
    gap: Floats  # (m,) m
    contact: Ints | None = None  # (m,) contact of each spring; None: one spring for each contact

    def take(self, index: Ints | Bools) -> Springs:
        """A selection of the springs."""
        contact = None if self.contact is None else self.contact[index]
        return Springs(self.shape[index], self.sign[index], self.stiffness[index], self.gap[index], contact)

    def contact_forces(self, force: Floats, sign: Floats) -> Floats:
        """Forces of contacts with the given signs, N, from the forces of their springs (m,)."""
        if self.contact is None:
            return force
        return sign * np.bincount(self.contact, weights=self.sign * force, minlength=sign.size)


@dataclass(eq=False)
class CubicSprings:
    """Cubic springs, force ``-stiffness * (shape @ q + base_influence @ d(t))**3`` along shape."""

    shape: Floats  # (nc, n)
    stiffness: Floats  # (nc,) N/m^3
    # (nc, K) extension for a unit of each displacement of the base, 0 between masses; None: 1 for the only one
    base_participation: Floats | None = None
    count: int = field(init=False)
    base_influence: Floats = field(init=False)  # (nc, K) as ``base_participation``

    def __post_init__(self) -> None:
        self.count = int(self.stiffness.size)
        given = self.base_participation
        self.base_influence = np.ones((self.count, 1)) if given is None else given

    def extension(self, q: Floats, base: Floats | None) -> Floats:
        """(..., nc) m, with coordinates (..., n) and displacements of the base (..., K), m; None if it is at rest."""
        own = q @ self.shape.T
        return np.asarray(own if base is None else own + base @ self.base_influence.T)


@dataclass(frozen=True)
class Equilibrium:
    """A static equilibrium: coordinates and contact forces, or the reason why there is none."""

    q: Floats | None  # (n,)
    force: Floats  # (m,) N, of springs or contacts (nan without equilibrium)
    reason: str = ""  # empty if q exists and is unique
    nonunique_q: Floats | None = None  # (n,) an equilibrium that is not unique


def find_equilibrium(
    stiffness: Floats, rigid_count: int, springs: Springs, loads: Floats, cubic: CubicSprings | None = None
) -> Equilibrium:
    """Find the static equilibrium of a structure with one-sided springs.

    Parameters
    ----------
    stiffness : (n,) diagonal of K, the first `rigid` entries zero, rad^2/s^2.
    rigid_count : number of rigid-body coordinates.
    springs : the one-sided springs.
    loads : (L, n) constant loads, separate so that a balance can be distinguished from round-off.
    cubic : cubic springs; None without.

    Returns
    -------
    Equilibrium
        Coordinates and forces, or the reason why there are none.

    Raises
    ------
    NotTrustedError
        If the contact conditions are not met within round-off (a relative 1e-9).
    """
    cubic = CubicSprings(np.zeros((0, stiffness.size)), np.zeros(0)) if cubic is None else cubic
    shape, load = springs.shape.copy(), loads.sum(axis=0)
    # a stop at a node of a rigid-body motion does not restrain it, whatever the round-off
    nodes = np.abs(shape) <= _ON_NODE * np.linalg.norm(shape, axis=1)[:, None]
    shape[:, :rigid_count][nodes[:, :rigid_count]] = 0.0
    load[:rigid_count][np.abs(load[:rigid_count]) <= _ROUND_OFF * np.abs(loads[:, :rigid_count]).sum()] = 0.0
    energy = _Energy(stiffness, replace(springs, shape=shape), cubic, load)
    found = np.zeros(stiffness.size), np.zeros(springs.stiffness.size)
    nothing = np.full(springs.stiffness.size, np.nan)
    if load.any() or np.any(springs.gap < 0.0):  # else it stays undeformed
        reached = _energy_minimum(energy, rigid_count)
        if reached is None:
            return Equilibrium(None, nothing, UNBALANCED_MESSAGE)
        found = reached
    if (rigid_count or energy.softens) and not _unique(energy, *found):  # else every motion is resisted by a stiffness
        return Equilibrium(None, nothing, FLOATING_MESSAGE, found[0])
    return Equilibrium(*found)


def _energy_minimum(energy: _Energy, rigid_count: int) -> tuple[Floats, Floats] | None:
    """Coordinates (n,) and spring forces (m,) at the minimum of an energy; None if there is no minimum."""
    bounded = not energy.softens and not energy.cubic.count
    if bounded and rigid_count and not _can_balance(energy.normal[:, :rigid_count], energy.load[:rigid_count]):
        return None
    q = _minimum(energy)
    if energy.is_minimum(q):
        return _refine(energy, q)
    if bounded:
        raise NotTrustedError("static equilibrium: the contact conditions could not be met within round-off")
    return None


def _minimum(energy: _Energy) -> Floats:
    """(n,) coordinates at the minimum, by Newton's method."""
    q, settled = np.zeros_like(energy.stiffness), 0
    for _ in range(200):
        gradient, size, _ = energy.slope(q)
        if settled == 3 or np.abs(gradient).max(initial=0.0) <= _CANCELLATION * size:
            break
        closed = energy.penetration(q) > 0
        step = _Newton(energy, q, closed).step(gradient, np.zeros(int(closed.sum())))[: q.size]
        along = energy.slope_along(q, step)
        before, behind = along(0.0), along(1.0)
        if before >= 0.0:
            break
        share = 1.0 if behind <= 0.0 else _zero(along)
        q = q + share * step
        # a full step without contact change that leaves a small gradient ends at the minimum, up to round-off
        still = share > 0.9 and behind > 0.5 * before and np.array_equal(closed, energy.penetration(q) > 0)
        still &= not energy.cubic.count or bool(np.abs(step).max() <= 1e-9 * np.abs(q).max())
        settled = settled + 1 if still else 0
    return q


def _zero(slope: Callable[[float], float]) -> float:
    """Root between 0 and 1 of an increasing function."""
    low, high = 0.0, 1.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if slope(middle) < 0.0 else (low, middle)
    return high


_ADDED_STIFFNESS = 1e-15  # relative; keeps a step finite in directions without stiffness


class _Newton:
    """Newton steps at given coordinates with given closed springs.

    Coordinates and forces of closed springs are unknowns together, so that stiff springs cost no accuracy.
    """

    def __init__(self, energy: _Energy, q: Floats, closed: Bools) -> None:
        k = energy.springs.stiffness[closed]
        tangent, normal = energy.open_tangent(q), energy.normal[closed]
        resisting = np.diag(tangent)
        most = energy.stiffness + np.abs(energy.springs.stiffness) @ energy.normal**2
        # largest stiffness that each coordinate may have
        most = most + np.abs(energy.cubic.stiffness) @ energy.cubic.shape**2
        damped = np.where(resisting > 0, resisting, np.where(most > 0, most, 1.0))
        self.scale = np.concatenate([1.0 / np.sqrt(damped + np.abs(k) @ normal**2), np.sqrt(np.abs(k))])
        matrix = np.block([[tangent + np.diag(_ADDED_STIFFNESS * damped), -normal.T], [normal, np.diag(1.0 / k)]])
        self.matrix = matrix * self.scale * self.scale[:, None]

    def step(self, gradient: Floats, misfit: Floats) -> Floats:
        """(n + c,) step of coordinates and forces, from the residuals of forces (n,) and of spring extensions (c,)."""
        return np.asarray(self.scale * np.linalg.solve(self.matrix, -self.scale * np.concatenate([gradient, misfit])))


def _refine(energy: _Energy, q: Floats) -> tuple[Floats, Floats]:
    """Coordinates and spring forces (m,) with residuals at the round-off level of each coordinate.

    The load on a stiff stop hardly affects soft coordinates; its round-off must not disturb them. Therefore the
    unknowns are sums of two numbers, residuals are rounded once, and deflections of stiff springs are not differences
    of larger numbers. A spring that closed because of round-off, and has no force, is open.
    """
    springs, n = energy.springs, q.size
    force = springs.stiffness * energy.penetration(q)
    closed = force != 0.0
    while True:
        newton, normal, k = _Newton(energy, q, closed), energy.normal[closed], springs.stiffness[closed]
        linear = np.block([[np.diag(energy.stiffness), -normal.T], [normal, np.diag(1.0 / k)]])
        given = np.append(-energy.load, springs.gap[closed])[:, None]
        found, rest = np.append(q, force[closed]), np.zeros(given.size)
        for _ in range(6):
            others = given
            if energy.cubic.count:
                pull = _cubic_forces(energy.cubic, found[:n], rest[:n])
                others = np.hstack([given, np.pad(pull, ((0, k.size), (0, 0)))])
            misfit = _sums(linear, found, rest, others)
            step = newton.step(misfit[:n], misfit[n:])
            if not np.linalg.norm(step / newton.scale) <= 1e-2 * np.linalg.norm(found / newton.scale):
                return q, force  # skip the refinement
            rest += step
            total = found + rest
            found, rest = total, rest - (total - found)
        pushes = found[n:] * k > 0
        if pushes.all():
            force[closed], force[~closed] = found[n:], 0.0
            return found[:n], force
        closed[closed] = pushes


def _sums(matrix: Floats, high_part: Floats, low_part: Floats, terms: Floats) -> Floats:
    """(k,) ``matrix @ (high_part + low_part)`` plus the sums of the rows of ``terms`` (k, any), rounded once."""
    products = np.hstack([*_exact_products(matrix, high_part), matrix * low_part, terms])
    return np.array([math.fsum(row) for row in products])


def _exact_products(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Products and their rounding errors (T. J. Dekker, Numer. Math. 18, 1971)."""
    halves = []
    for x in (a, b):
        high = _SPLIT * x
        high = high - (high - x)
        halves.append((high, x - high))
    product, (a1, a2), (b1, b2) = a * b, *halves
    return product, a2 * b2 - (((product - a1 * b1) - a2 * b1) - a1 * b2)


def _cubic_forces(cubic: CubicSprings, q: Floats, low_part: Floats) -> Floats:
    """(n, any) terms whose sums are the forces of cubic springs at the coordinates ``q + low_part``."""
    extension = _sums(cubic.shape, q, low_part, np.zeros((cubic.count, 1)))
    of_extension = _sums(cubic.shape, q, low_part, -extension[:, None])
    exact = [Fraction(k) * (Fraction(x) + Fraction(y)) ** 3 for k, x, y in zip(
        cubic.stiffness.tolist(), extension.tolist(), of_extension.tolist(), strict=True
    )]  # fmt: skip
    force = np.array([float(f) for f in exact])
    of_force = np.array([float(f - Fraction(float(x))) for f, x in zip(exact, force, strict=True)])
    return np.hstack([*_exact_products(cubic.shape.T, force), cubic.shape.T * of_force])


def _can_balance(opening_directions: Floats, load: Floats) -> bool:
    """Whether contact forces N >= 0 exist with opening_directions^T N = -load (Farkas; else a motion is unbounded)."""
    size = float(np.linalg.norm(load))
    if size == 0.0 or opening_directions.shape[0] == 0:
        return size == 0.0
    return fitted_numbers(opening_directions.T, -load / size)[1] <= _ROUND_OFF**2


def _compresses_a_stop(stops: Floats) -> bool:
    """Whether each of l motions, given by how they open closed contacts (m, l), compresses at least one of them."""
    if stops.shape[1] == 0:
        return True
    stops = stops[np.linalg.norm(stops, axis=1) > 1e-12]
    if stops.shape[0] == 0 or np.linalg.matrix_rank(stops) < stops.shape[1]:
        return False
    # Stiemke: only d = 0 satisfies stops @ d >= 0 if a combination of the rows with positive weights is zero.
    stops = stops / np.linalg.norm(stops, axis=1)[:, None]
    return bool(fitted_numbers(stops.T, -stops.sum(axis=0))[1] <= (_ROUND_OFF * stops.shape[0]) ** 2)


def _loose(opening_directions: Floats) -> Floats:
    """(l, r) orthonormal rigid-body motions without deflection at the given contacts."""
    return np.asarray(null_space(opening_directions, rcond=_ROUND_OFF).T)


@dataclass(eq=False)
class _Energy:
    """Potential energy of a structure, its springs and loads, as a function of the coordinates."""

    stiffness: Floats  # (n,) diagonal of K
    springs: Springs
    cubic: CubicSprings
    load: Floats  # (n,)
    normal: Floats = field(init=False)  # (m, n) opening of each spring for a unit of each coordinate
    softens: bool = field(init=False)  # whether a spring softens

    def __post_init__(self) -> None:
        self.normal = self.springs.sign[:, None] * self.springs.shape
        self.softens = bool(np.any(self.springs.stiffness < 0))

    def penetration(self, q: Floats) -> Floats:
        """(m,) penetration of each spring, 0 if it is open."""
        return np.maximum(-self.springs.gap - self.normal @ q, 0.0)

    def slope(self, q: Floats) -> tuple[Floats, float, float]:
        """Gradient, the size of its terms, and their round-off (gaps of stiff springs cancel)."""
        delta, k, bent = self.penetration(q), self.springs.stiffness, self.cubic.shape
        terms = (
            self.stiffness * q,
            -self.normal.T @ (k * delta),
            bent.T @ (self.cubic.stiffness * (bent @ q) ** 3),
            -self.load,
        )
        cancelling = np.abs(self.springs.gap) + np.abs(self.normal) @ np.abs(q)
        noise = _CANCELLATION * np.abs(self.normal.T) @ np.where(delta > 0, np.abs(k) * cancelling, 0.0)
        # a prestress that has vanished leaves round-off
        at_rest = self.normal.T @ (k * np.maximum(-self.springs.gap, 0.0))
        size = float(max(np.abs(t).max(initial=0.0) for t in (*terms, 0.01 * at_rest)))
        return np.asarray(sum(terms)), size, float(noise.max(initial=0.0))

    def open_tangent(self, q: Floats) -> Floats:
        """(n, n) derivative of the gradient without one-sided springs."""
        bent = self.cubic.shape
        return np.asarray(
            np.diag(self.stiffness) + bent.T @ ((3 * self.cubic.stiffness * (bent @ q) ** 2)[:, None] * bent)
        )

    def slope_along(self, q: Floats, step: Floats) -> Callable[[float], float]:
        """Function of the fraction of a step that gives the derivative of the energy along the step."""
        clear, opening, k = self.springs.gap + self.normal @ q, self.normal @ step, self.springs.stiffness
        bent, bending, c = self.cubic.shape @ q, self.cubic.shape @ step, self.cubic.stiffness
        start, rise = float((self.stiffness * q - self.load) @ step), float(self.stiffness @ step**2)

        def derivative(t: float) -> float:
            pushed = k * np.maximum(-clear - t * opening, 0.0) @ opening
            return start + t * rise - float(pushed) + float(c * (bent + t * bending) ** 3 @ bending)

        return derivative

    def is_minimum(self, q: Floats) -> bool:
        """Whether the gradient vanishes."""
        gradient, size, noise = self.slope(q)
        residual = float(np.abs(gradient).max(initial=0.0))
        # far away the forces of a softening spring cancel: compare with loads, which do not grow
        given = float(np.abs(self.load).max(initial=0.0))
        given += float(np.abs((self.springs.stiffness * self.springs.gap) @ self.normal).max(initial=0.0))
        return residual <= 1e-9 * size + noise and not (self.softens and residual > 1e-6 * given)


def _unique(energy: _Energy, q: Floats, force: Floats) -> bool:
    """Whether a minimum of the convex energy is unique: whether every direction from it extends a spring.

    Contacts that just touch count as closed if they soften the structure, and as stops if they stiffen it. A stiff stop
    is closed if the structure would move into it without the stop.
    """
    normal, springs, k = energy.normal, energy.springs, energy.stiffness
    clear = springs.gap + normal @ q
    near = _ROUND_OFF * float(np.abs(springs.gap).max(initial=0.0) + np.abs(normal * q).max(initial=0.0))
    flexible = np.divide(1.0, k, out=np.zeros_like(k), where=k > 0)
    own = np.abs(springs.stiffness)  # a stop without stiffness has no force
    compliance = normal**2 @ flexible + np.divide(1.0, own, out=np.zeros_like(own), where=own > 0)
    softer = springs.stiffness < 0
    closed = np.where(softer, clear <= near, force * compliance > near)
    loose = _unresisted(k, springs.take(closed))
    if energy.cubic.count:  # a cubic spring resists every motion that extends it
        loose = _loose(energy.cubic.shape @ loose.T) @ loose
    stops = normal[(np.abs(clear) <= near) & ~softer & ~closed] @ loose.T
    return _compresses_a_stop(stops)


def _unresisted(stiffness: Floats, closed: Springs) -> Floats:
    r"""(l, n) directions in which closed springs, some of them softening, leave no stiffness.

    The stiffening springs resist with :math:`|G q|^2`, and the softening ones reduce this by :math:`|W q|^2 \le |G
    q|^2`. With :math:`G = Q R` nothing is left in directions for which a singular value of :math:`W R^{-1}` is one.
    Each direction is scaled by its own resistance, so that stiff stops or high modes do not hide soft ones. Sorted rows
    and pivoted columns keep the accuracy of every row of G (Cox and Higham, *BIT* 38, 1998).
    """
    parts = np.arange(closed.stiffness.size) if closed.contact is None else closed.contact
    _, first, contact = np.unique(parts, return_index=True, return_inverse=True)
    both = closed.stiffness, np.abs(closed.stiffness)
    slope, size = (np.bincount(contact, weights=k, minlength=first.size) for k in both)
    slope[np.abs(slope) <= _CANCELLATION * size] = 0.0  # terms of a law that cancel
    shape = closed.shape[first]
    held, softened = shape[slope > 0], shape[slope < 0]
    n, rigid = stiffness.size, int(np.sum(stiffness == 0.0))
    size = np.linalg.norm(held, axis=1)[:, None]
    floating = _loose(held[:, :rigid] / np.where(size > 0, size, 1.0))
    free = np.pad(floating, ((0, 0), (0, n - rigid)))
    if softened.shape[0] == 0:
        return free
    others = block_diag(_loose(floating), np.eye(n - rigid))  # directions with resistance
    resisting = np.vstack([np.diag(np.sqrt(stiffness)), np.sqrt(slope[slope > 0])[:, None] * held]) @ others.T
    scale = 1.0 / np.linalg.norm(resisting, axis=0)
    resisting *= scale
    rows = np.argsort(-np.abs(resisting).max(axis=1))
    _, triangle, columns = qr(resisting[rows], mode="economic", pivoting=True)
    taking = np.sqrt(-slope[slope < 0])[:, None] * softened @ others.T * scale
    _, share, directions = np.linalg.svd(solve_triangular(triangle, taking[:, columns].T, trans="T").T)
    lost = directions[: share.size][1.0 - share**2 <= _ROUND_OFF]
    moved = np.zeros((lost.shape[0], scale.size))
    moved[:, columns] = solve_triangular(triangle, lost.T).T
    moved = moved * scale @ others
    return np.vstack([free, moved / np.linalg.norm(moved, axis=1)[:, None]])
