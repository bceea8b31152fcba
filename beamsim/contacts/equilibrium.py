r"""Static equilibrium: the minimum of a convex, piecewise quadratic energy.

.. math:: E(q) = \tfrac12 q^T K q + \tfrac12 \sum_i k_i [\delta_i(q)]_+^2 - f^T q,
          \qquad \delta_i = -g_i - s_i \phi_i q .

Eliminating the flexible coordinates leaves the contact forces N >= 0, which minimise a strictly convex quadratic
function subject to the balance of the rigid-body modes, :math:`\Phi_R^T s N + f_R = 0`; its multipliers are the
rigid-body coordinates. An active-set method finds the closed contacts, and a linear solve for this set gives the forces
to machine precision.

Cubic springs, and one-sided springs of negative stiffness (a piecewise-linear spring that softens; the total energy is
still convex), have no such dual: they are solved by Newton's method on the energy.
"""

from __future__ import annotations

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.errors import NotTrustedError
from beamsim.typing import Bools, Floats, Ints

# Relative size of what counts as round-off in loads and gaps.
NODE = 1e-13  # of a contact's shape: a deflection in a rigid-body motion that is zero
_ROUND_OFF = 1e-10
_CANCELLED = 1e-13  # of the parts of a sum: what is left where they cancel
_STEPS = 500  # of Newton's method
# Method of multipliers for the balance of rigid-body modes: weight of each pass (compliance of the contacts = 1). It
# has to grow: soft contacts that carry the load alone converge as one over weight times their share of the stiffness.
_PENALTIES = (*(10.0**p for p in range(3, 11)), *(1e10,) * 20)

_REFINEMENTS = 3  # steps of the refinement

UNBALANCED = "the loads are not in balance: no support or snubber can hold the structure against them"
FLOATS = "the structure floats: it has rigid-body motions that no support or closed snubber holds in place"


@dataclass(frozen=True)
class Springs:
    """One-sided springs, as far as statics needs them."""

    shape: Floats  # (m, n)
    sign: Floats  # (m,) +1 below, -1 above
    stiffness: Floats  # (m,) N/m; negative where a piecewise-linear spring softens
    gap: Floats  # (m,) m
    contact: Ints | None = None  # (m,) contact that each is a part of; None: one each

    def take(self, index: Ints | Bools) -> Springs:
        """A selection of the springs."""
        contact = None if self.contact is None else self.contact[index]
        return Springs(self.shape[index], self.sign[index], self.stiffness[index], self.gap[index], contact)

    def by_contact(self, force: Floats, sign: Floats) -> Floats:
        """Forces of contacts with the given signs, N, from those of their parts (m,)."""
        if self.contact is None:
            return force
        return sign * np.bincount(self.contact, weights=self.sign * force, minlength=sign.size)


@dataclass(frozen=True)
class CubicSprings:
    """Cubic springs to the ground, force -stiffness * (shape @ q + d(t))**3 along shape; between masses without d."""

    shape: Floats  # (nc, n)
    stiffness: Floats  # (nc,) N/m^3
    on_ground: Bools | None = None  # (nc,) whether the stretch includes the base's displacement d(t); None: all
    lever: Floats | None = None  # (nc,) displacement of its place for a unit displacement of the base; None: 1

    @property
    def count(self) -> int:
        """Number of springs."""
        return int(self.stiffness.size)

    @property
    def felt(self) -> Floats:
        """(nc,) stretch for a unit displacement of the base: the lever of a spring to the ground, 0 between masses."""
        lever = np.ones(self.count) if self.lever is None else self.lever
        return lever if self.on_ground is None else self.on_ground * lever


@dataclass(frozen=True)
class Equilibrium:
    """The outcome: coordinates and contact forces, or the reason why there are none."""

    q: Floats | None  # (n,)
    force: Floats  # (m,) N, contact forces (nan without equilibrium)
    reason: str = ""  # empty if q exists and is unique
    one_of_many: Floats | None = None  # (n,) where it exists and is not unique


def find_equilibrium(
    stiffness: Floats, rigid: int, springs: Springs, loads: Floats, cubic: CubicSprings | None = None
) -> Equilibrium:
    """The static equilibrium of a structure with one-sided springs.

    Parameters
    ----------
    stiffness : (n,) diagonal of K, the first `rigid` entries zero, rad^2/s^2.
    rigid : number of rigid-body coordinates.
    springs : the one-sided springs.
    loads : (L, n) constant loads; kept separate so that a balance can be distinguished from round-off.
    cubic : cubic springs, if any (Newton's method then starts from the equilibrium of the linear springs).

    Returns
    -------
    Equilibrium
        Coordinates and forces, or why there are none.

    Raises
    ------
    NotTrustedError
        If the contact conditions are not met within round-off (a relative 1e-9).
    """
    cubic = CubicSprings(np.zeros((0, stiffness.size)), np.zeros(0)) if cubic is None else cubic
    load = loads.sum(axis=0)
    if np.any(springs.stiffness < 0):
        return _refined(
            _by_newton(stiffness, springs, load, cubic, Equilibrium(None, springs.gap)), stiffness, springs, load, cubic
        )
    linear = _by_forces(stiffness, rigid, springs, loads)
    if cubic.count and (linear.q is None or np.any(cubic.shape @ linear.q)):
        linear = _by_newton(stiffness, springs, load, cubic, linear)
    return _refined(linear, stiffness, springs, load, cubic)


def _refined(
    equilibrium: Equilibrium, stiffness: Floats, springs: Springs, load: Floats, cubic: CubicSprings
) -> Equilibrium:
    """The same with residuals at the round-off of what each coordinate feels, where it is unique.

    A stiff stop carries a load that soft coordinates hardly feel: the round-off of the load is not that of the little
    they feel. Newton's method on coordinates and forces of closed springs together, residuals in extended precision:
    deflections of stiff springs do not have to be differences of others.
    """
    closed = equilibrium.force != 0.0
    if equilibrium.q is None or not (equilibrium.q.any() or closed.any() or load.any()):
        return equilibrium
    normal = springs.sign[closed, None] * springs.shape[closed]
    n = stiffness.size
    exact = np.concatenate([equilibrium.q, equilibrium.force[closed]]).astype(np.longdouble)
    wide = [x.astype(np.longdouble) for x in (stiffness, normal, springs.stiffness[closed], cubic.shape, load)]
    third = 3 * cubic.stiffness * (cubic.shape @ equilibrium.q) ** 2
    tangent = np.diag(stiffness) + cubic.shape.T @ (third[:, None] * cubic.shape)
    compliance = 1.0 / springs.stiffness[closed]
    size = np.diag(tangent) + np.abs(springs.stiffness[closed]) @ normal**2
    if not np.all(size > 0):
        return equilibrium
    scale = np.sqrt(np.concatenate([1.0 / size, 1.0 / np.abs(compliance)]))
    matrix = np.diag(np.concatenate([np.zeros(n), compliance]))
    matrix[:n, :n], matrix[:n, n:], matrix[n:, :n] = tangent, -normal.T, normal
    matrix *= scale * scale[:, None]
    for _ in range(_REFINEMENTS):
        q, force = exact[:n], exact[n:]
        bent = wide[3] @ q
        residual = np.concatenate(
            [
                wide[0] * q + wide[3].T @ (cubic.stiffness * bent**3) - wide[1].T @ force - wide[4],
                springs.gap[closed] + wide[1] @ q + force / wide[2],
            ]
        )
        try:
            step = scale * np.linalg.solve(matrix, scale * -residual.astype(float))
        except np.linalg.LinAlgError:
            return equilibrium
        if not np.linalg.norm(step / scale) <= 1e-2 * np.linalg.norm(exact.astype(float) / scale):
            return equilibrium  # no refinement
        exact += step
    if np.any(exact[n:] * springs.stiffness[closed] <= 0):
        return equilibrium
    pressed = equilibrium.force.copy()
    pressed[closed] = exact[n:]
    return Equilibrium(np.asarray(exact[:n], dtype=float), pressed)


def _by_forces(stiffness: Floats, rigid: int, springs: Springs, loads: Floats) -> Equilibrium:
    m = springs.stiffness.size
    nothing = np.full(m, np.nan)
    load = loads.sum(axis=0)
    load_size = float(np.abs(loads[:, :rigid]).sum()) if rigid else 0.0
    normal = springs.sign[:, None] * springs.shape  # (m, n) opening direction: clearance = gap + normal @ q
    away, push = normal[:, :rigid].copy(), load[:rigid].copy()
    # a stop on a node of a rigid-body motion does not hold it, whatever round-off says
    away[np.abs(away) <= NODE * np.linalg.norm(normal, axis=1)[:, None]] = 0.0
    push[np.abs(push) <= _ROUND_OFF * load_size] = 0.0
    if not _balanced(away, push):
        return Equilibrium(None, nothing, UNBALANCED)

    flexible = np.zeros_like(stiffness)
    flexible[rigid:] = 1.0 / stiffness[rigid:]
    compliance = (normal * flexible) @ normal.T + np.diag(1.0 / springs.stiffness)
    clearance = springs.gap + normal @ (flexible * load)  # with the flexible coordinates under the load alone
    force, drift = _contact_forces(compliance, clearance, away, push)
    q = flexible * (load + normal.T @ force)
    q[:rigid] = drift
    if rigid:
        size = float(np.abs(springs.gap).max(initial=0.0) + np.abs(normal * q).max(initial=0.0))
        clear = springs.gap + normal @ q
        closed = force * np.diag(compliance) > _ROUND_OFF * size
        if not _held(away, closed, clear <= _ROUND_OFF * size):
            return Equilibrium(None, nothing, FLOATS, q)
    return Equilibrium(q, force)


def _balanced(away: Floats, push: Floats) -> bool:
    """Whether some contact forces N >= 0 satisfy away^T N = -push (Farkas: else a rigid-body motion has no bound)."""
    size = float(np.linalg.norm(push))
    if size == 0.0:
        return True
    if away.shape[0] == 0:
        return False
    scale = np.linalg.norm(away, axis=1)
    unit = away / np.where(scale > 0, scale, 1.0)[:, None]
    return bool(_least_residual(unit.T, -push / size) <= _ROUND_OFF)


def _least_residual(matrix: Floats, target: Floats) -> float:
    from scipy.optimize import nnls

    return float(nnls(matrix, target)[1])


def _held(away: Floats, closed: Bools, touching: Bools) -> bool:
    """Whether no rigid-body motion leaves all closed contacts unchanged without compressing a touching one."""
    loose = _loose(away[closed])
    if loose.shape[0] == 0:
        return True
    stops = away[touching & ~closed] @ loose.T
    stops = stops[np.linalg.norm(stops, axis=1) > 1e-12]
    if stops.shape[0] == 0 or np.linalg.matrix_rank(stops) < loose.shape[0]:
        return False
    # Stiemke: only d = 0 satisfies stops @ d >= 0 if a combination of the rows with positive weights is zero.
    stops = stops / np.linalg.norm(stops, axis=1)[:, None]
    target = -stops.sum(axis=0)
    return bool(_least_residual(stops.T, target) <= _ROUND_OFF * stops.shape[0])


def _contact_forces(compliance: Floats, clearance: Floats, away: Floats, push: Floats) -> tuple[Floats, Floats]:
    """Forces N and rigid coordinates d with N >= 0, gap >= 0, N gap = 0 and away^T N + push = 0.

    gap = compliance @ N + clearance + away @ d (the spring's own compliance included). With rigid-body coordinates this
    is the method of multipliers: each pass finds N >= 0 by non-negative least squares with the balance as a penalty,
    and d is corrected by the residual of the balance. The set of closed contacts settles after a few passes; a direct
    solve for this set then meets all conditions to round-off, which ends the iteration.
    """
    m, rigid = away.shape
    if m == 0 or (rigid == 0 and np.all(clearance >= 0.0)):
        return np.zeros(m), np.zeros(rigid)
    from scipy.optimize import nnls

    # Forces are scaled by the compliance of each contact, rigid-body coordinates by the deflection at the contacts.
    s = 1.0 / np.sqrt(np.diag(compliance))
    t = np.linalg.norm(away * s[:, None], axis=0)
    t = 1.0 / np.where(t > 0, t, 1.0)
    compliance, clearance, away, push = compliance * s[:, None] * s, clearance * s, away * s[:, None] * t, push * t
    drift = np.zeros(rigid)
    for weight in _PENALTIES:
        upper = np.asarray(np.linalg.cholesky(compliance + weight * away @ away.T).T, dtype=float)
        linear = clearance + away @ (drift + weight * push)
        force = nnls(upper, -np.linalg.solve(upper.T, linear))[0]
        drift = drift + weight * (away.T @ force + push)
        exact = _meet_conditions(compliance, clearance, away, push, force > 0, drift)
        if exact is not None:
            return np.maximum(exact[0], 0.0) * s, exact[1] * t
    raise NotTrustedError("static equilibrium: the contact conditions could not be met within round-off")


def _meet_conditions(
    compliance: Floats, clearance: Floats, away: Floats, push: Floats, closed: Bools, drift: Floats
) -> tuple[Floats, Floats] | None:
    """N and d for a closed set, None if they violate a contact condition by more than round-off.

    If the closed contacts leave a rigid-body motion free, d follows the given drift along it.
    """
    m, rigid = away.shape
    c = int(closed.sum())
    a = away[closed]
    matrix = np.block([[compliance[np.ix_(closed, closed)], a], [a.T, np.zeros((rigid, rigid))]])
    rhs = np.concatenate([-clearance[closed] - a @ drift, -push])
    solution = np.linalg.lstsq(matrix, rhs, rcond=1e-13)[0] if rhs.size else rhs
    force = np.zeros(m)
    force[closed] = solution[:c]
    drift = drift + solution[c:]
    bent, moved = compliance @ force, away @ drift
    gap = bent + clearance + moved
    size = float(np.abs(clearance).max() + np.abs(bent).max() + np.abs(moved).max())
    reach = float((np.abs(away.T) @ np.abs(force) + np.abs(push)).max(initial=0.0))
    met = (
        np.all(force >= -_ROUND_OFF * size)
        and np.all(gap[~closed] >= -_ROUND_OFF * size)
        and np.all(np.abs(gap[closed]) <= _ROUND_OFF * size)
        and np.all(np.abs(away.T @ force + push) <= _ROUND_OFF * reach + 1e-13 * size)
    )
    return (force, drift) if met else None


def _loose(away: Floats) -> Floats:
    """(l, r) orthonormal rigid-body motions without deflection at the given contacts."""
    if away.shape[0] == 0:
        return np.eye(away.shape[1])
    _, s, vt = np.linalg.svd(away)
    return np.asarray(vt[int(np.sum(s > _ROUND_OFF * s.max(initial=0.0))) :])


@dataclass(frozen=True)
class _Energy:
    """The energy of a structure, its springs and loads, by the coordinates."""

    stiffness: Floats  # (n,) diagonal of K
    springs: Springs
    cubic: CubicSprings
    load: Floats  # (n,)

    @property
    def normal(self) -> Floats:
        """(m, n) opening of each spring for a unit of each coordinate."""
        return self.springs.sign[:, None] * self.springs.shape

    def penetration(self, q: Floats) -> Floats:
        """(m,) of each spring, 0 where it is open."""
        return np.maximum(-self.springs.gap - self.normal @ q, 0.0)

    def value(self, q: Floats) -> tuple[float, float]:
        """Energy and the size of its parts."""
        parts = (
            0.5 * self.stiffness * q**2,
            0.5 * self.springs.stiffness * self.penetration(q) ** 2,
            0.25 * self.cubic.stiffness * (self.cubic.shape @ q) ** 4,
            -self.load * q,
        )
        return float(sum(p.sum() for p in parts)), float(sum(np.abs(p).sum() for p in parts))

    def slope(self, q: Floats) -> tuple[Floats, float, float]:
        """Gradient, the size of its parts, and their round-off: gaps of stiff springs cancel."""
        delta, k, bent = self.penetration(q), self.springs.stiffness, self.cubic.shape
        terms = (
            self.stiffness * q,
            -self.normal.T @ (k * delta),
            bent.T @ (self.cubic.stiffness * (bent @ q) ** 3),
            -self.load,
        )
        cancelling = np.abs(self.springs.gap) + np.abs(self.normal) @ np.abs(q)
        noise = _CANCELLED * np.abs(self.normal.T) @ np.where(delta > 0, np.abs(k) * cancelling, 0.0)
        size = float(max(np.abs(t).max(initial=0.0) for t in terms))
        return np.asarray(sum(terms)), size, float(noise.max(initial=0.0))

    def tangent(self, q: Floats) -> Floats:
        """(n, n) derivative of the gradient."""
        closed, bent = self.penetration(q) > 0, self.cubic.shape
        normal = self.normal[closed]
        tangent = np.diag(self.stiffness) + normal.T @ (self.springs.stiffness[closed, None] * normal)
        return np.asarray(tangent + bent.T @ ((3 * self.cubic.stiffness * (bent @ q) ** 2)[:, None] * bent))

    @property
    def stiffest(self) -> float:
        """Size of the tangent: of the structure, of all springs closed, and of cubic ones that hold the load."""
        reach = np.abs(self.cubic.shape).max(axis=1)
        reach = np.where(reach > 0, reach, 1.0)
        scales = [
            self.stiffness,
            np.abs(self.springs.stiffness) @ self.normal**2,
            np.cbrt(np.abs(self.cubic.stiffness) * (np.abs(self.load).max() / reach) ** 2) * reach**2,
        ]
        return float(max(np.max(scale, initial=1e-290) for scale in scales))


def _by_newton(
    stiffness: Floats, springs: Springs, load: Floats, cubic: CubicSprings, start: Equilibrium
) -> Equilibrium:
    """Levenberg-damped Newton's method on the energy of all springs (smooth except at the contacts).

    The minimum of a convex energy is unique unless the energy is constant in some direction from it.
    """
    energy = _Energy(stiffness, springs, cubic, load)
    q = np.zeros_like(stiffness) if start.q is None else start.q
    floor = 1e-12 * energy.stiffest
    damping = floor
    value, parts = energy.value(q)
    for _ in range(_STEPS):
        gradient, size, _ = energy.slope(q)
        if np.abs(gradient).max(initial=0.0) <= _CANCELLED * size:
            break
        step = np.linalg.solve(energy.tangent(q) + damping * np.eye(q.size), -gradient)
        trial, trial_parts = energy.value(q + step)
        better = bool(trial <= value + 1e-15 * abs(value))
        if not better and trial <= value + _ROUND_OFF * parts:  # soft parts are the round-off of stiff ones: by slope
            better = bool(abs(energy.slope(q + step)[0] @ step) <= 0.5 * abs(gradient @ step))
        if better:
            q, value, parts, damping = q + step, trial, trial_parts, max(damping / 10, floor)
        else:
            damping *= 10
    gradient, size, noise = energy.slope(q)
    nothing, softens = np.full(springs.stiffness.size, np.nan), bool(np.any(springs.stiffness < 0))
    residual = float(np.abs(gradient).max(initial=0.0))
    # far away the forces of the parts of a softening spring cancel: their sum is compared with loads that do not grow
    given = float(np.abs(load).max(initial=0.0))
    given += float(np.abs((springs.stiffness * springs.gap) @ energy.normal).max(initial=0.0))
    if residual > 1e-9 * size + noise or (softens and residual > 1e-6 * given):
        return Equilibrium(None, nothing, start.reason or UNBALANCED)
    if softens and not _unique(stiffness, springs, cubic.shape, q):
        return Equilibrium(None, nothing, FLOATS)
    return Equilibrium(q, springs.stiffness * energy.penetration(q))


def _unique(stiffness: Floats, springs: Springs, bent: Floats, q: Floats) -> bool:
    """Whether a minimum of the convex energy is unique: every direction from it stretches a spring.

    Contacts that just touch count as closed if that softens the structure, and as stops if it stiffens it.
    """
    normal = springs.sign[:, None] * springs.shape
    clear = springs.gap + normal @ q
    near = _ROUND_OFF * float(np.abs(springs.gap).max(initial=0.0) + np.abs(normal * q).max(initial=0.0))
    softer = springs.stiffness < 0
    closed = (clear < -near) | (softer & (clear <= near))
    loose = _unresisted(stiffness, springs.take(closed))
    if bent.shape[0]:  # a cubic spring stops every motion that stretches it
        loose = _loose(bent @ loose.T) @ loose
    if loose.shape[0] == 0:
        return True
    touching = normal[(np.abs(clear) <= near) & ~softer]
    return _held(touching @ loose.T, np.zeros(touching.shape[0], dtype=bool), np.ones(touching.shape[0], dtype=bool))


def _unresisted(stiffness: Floats, closed: Springs) -> Floats:
    r"""(l, n) directions in which closed springs, some of which soften, leave no stiffness at all.

    The stiffening parts resist with :math:`|G q|^2`, of which the softening ones take away :math:`|W q|^2 \le |G q|^2`.
    With :math:`G = Q R` that is all of it where a singular value of :math:`W R^{-1}` is one: each direction is measured
    by what resists it, so that neither stiff stops nor high modes hide that soft ones are held. Sorted rows and pivoted
    columns leave every row of G its own accuracy (Cox and Higham, *BIT* 38, 1998).
    """
    from scipy.linalg import block_diag, qr, solve_triangular

    parts = np.arange(closed.stiffness.size) if closed.contact is None else closed.contact
    _, first, contact = np.unique(parts, return_index=True, return_inverse=True)
    both = closed.stiffness, np.abs(closed.stiffness)
    slope, size = (np.bincount(contact, weights=k, minlength=first.size) for k in both)
    slope[np.abs(slope) <= _CANCELLED * size] = 0.0  # parts of a law that cancel
    shape = closed.shape[first]
    held, softened = shape[slope > 0], shape[slope < 0]
    n, rigid = stiffness.size, int(np.sum(stiffness == 0.0))
    away = held[:, :rigid] / np.linalg.norm(held, axis=1)[:, None]
    away[np.abs(away) <= NODE] = 0.0
    floating = _loose(away)
    free = np.pad(floating, ((0, 0), (0, n - rigid)))
    if softened.shape[0] == 0:
        return free
    others = block_diag(_loose(floating), np.eye(n - rigid))  # what is resisted
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
