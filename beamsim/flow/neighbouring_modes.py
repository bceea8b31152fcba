r"""Modes of a contact state from those of a state that differs in few contacts.

A spring and a dashpot change the matrices by one dyad each. With the modes of
:math:`Q(\lambda) = \lambda^2 + C\lambda + K`, scaled such that
:math:`Q^{-1} = \sum_j u_j u_j^T / (\lambda - \mu_j)` over all 2n eigenvalues, those of
:math:`Q + z \phi\phi^T`, :math:`z = k + c\lambda`, are the zeros of the secular function

.. math:: f(\lambda) = 1 + z(\lambda) \sum_j \frac{p_j^2}{\lambda - \mu_j}, \qquad p_j = \phi^T u_j,
          \qquad u' = \sum_j \frac{p_j u_j}{\lambda - \mu_j} \Big/ \sqrt{\sum_j
          \frac{p_j^2}{(\lambda - \mu_j)^2} + \frac{c}{z^2}} .

All zeros are searched for at once (O. Aberth, Math. Comp. 27, 1973). A zero is held as the distance from its nearest
pole, and the vectors take the p of which the zeros found are exact (M. Gu and S. C. Eisenstat, SIAM J. Matrix Anal.
Appl. 15, 1994): so they stay orthogonal where zeros crowd or hardly move. Conjugate poles are added as one fraction,
without cancellation. That takes some n^2 operations and one product of matrices, against some 25 n^3 for the eigenvalue
problem of order 2n. The result is checked with two motions and discarded where it is not exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from beamsim.flow.invariant_blocks import SimpleModes
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats, Ints


def can_update(system: PiecewiseLinearSystem, before: Ints, phases: Ints) -> bool:
    """Whether the modes of a contact state may follow from those of another one.

    Undamped modes may not: their eigenvalues have no real part, and round-off would give them one.

    Parameters
    ----------
    system : the structure.
    before, phases : (m,) of the contacts in the known state and in the new one.

    Returns
    -------
    bool
    """
    n, contacts = system.size, system.contacts
    # 24: coordinates, below which a fresh eigenvalue problem is as fast
    if n < 24 or contacts.coupled(before) or contacts.coupled(phases):
        return False
    if contacts.holds(before).any() or contacts.holds(phases).any():
        return False
    if contacts.presses(before) or contacts.presses(phases):
        return False
    damped = contacts.damped or bool(np.diag(system.damping).any())
    few = int(np.count_nonzero(before != phases)) <= 4  # contacts by which the two states differ
    return damped and not system.coupled_by_damping and few


def neighbouring_modes(
    system: PiecewiseLinearSystem, known: SimpleModes, before: Ints, phases: Ints
) -> SimpleModes | None:
    """Modes of (q, q') in a contact state from those of another one, see `can_update`.

    Parameters
    ----------
    system : the structure.
    known : modes with the phases ``before``, one of each conjugate pair.
    before, phases : (m,) of the contacts in the known state and in the new one.

    Returns
    -------
    modes : one of each conjugate pair; None where they have to be computed anew.
    """
    n, contacts = system.size, system.contacts
    upper = np.flatnonzero(known.eigenvalue.imag > 0.0)
    if upper.size < n:
        return None
    old, new = contacts.force_rows(before)[0], contacts.force_rows(phases)[0]
    change = (new - old)[:, :2]
    upper = upper[np.argsort(known.eigenvalue[upper].imag)]
    pole, rows = known.eigenvalue[upper], known.left[upper, n : 2 * n]  # vectors, one a row
    largest = np.argmax(np.abs(rows), axis=1)
    rows *= np.sqrt(known.right[largest, upper] / rows[np.arange(n), largest])[:, None]
    for j in np.flatnonzero(change.any(axis=1)):
        p = rows @ contacts.shape[j]
        some = np.flatnonzero(p)
        found = _with_dyad(pole[some], rows[some], p[some], *change[j].tolist())
        if found is None:
            return None
        pole[some], rows[some] = found
        order = np.argsort(pole.imag)
        pole, rows = pole[order], rows[order]
    acting = np.flatnonzero(new[:, :2].any(axis=1))
    k, c, shape = new[acting, 0], new[acting, 1], contacts.shape[acting]
    left = (pole[:, None] + np.diag(system.damping)) * rows + ((rows @ shape.T) * c) @ shape
    modes = SimpleModes(np.hstack([rows, pole[:, None] * rows]).T, np.hstack([left, rows]), pole)
    # 1e-11: relative error of a motion and its rate, at which the eigenvalue problem is solved anew
    return modes if _error(system, k, c, shape, modes) < 1e-11 else None


def _with_dyad(
    pole: Complexes, rows: Complexes, p: Complexes, k: float, c: float
) -> tuple[Complexes, Complexes] | None:
    """Modes after a spring k and a dashpot c were added along one direction.

    Parameters
    ----------
    pole : (n,) eigenvalues in the upper half-plane, sorted by their imaginary parts.
    rows, p : (n, n') their vectors u, and (n,) what these have of the direction.
    k, c : N/m and N s/m.

    Returns
    -------
    pole, rows : the same after the change; None where not all were found.
    """
    found = _zeros(pole, p * p, k, c)
    if found is None:
        return None
    near, offset = found
    zero, pairs = pole[near] + offset, _Pairs.of(pole[near], offset, pole)
    apart = pole[:, None] - pole
    np.fill_diagonal(apart, 1.0)
    squares = np.prod(pairs.to * pairs.other.conj() / (apart.T * (pole - pole.conj()[:, None])), axis=0)
    exact = np.sqrt(squares / (k + c * pole))
    exact *= np.where((exact * p.conj()).real < 0.0, -1.0, 1.0)
    total = c / (k + c * zero) ** 2 + np.sum((exact / pairs.to) ** 2 + (exact.conj() / pairs.other) ** 2, axis=1)
    moved = exact[:, None] * rows
    parts = np.concatenate([moved.real, (moved * pole.conj()[:, None]).real])
    factors = pairs.both / np.sqrt(total)[:, None]
    return zero, np.hstack([factors * zero[:, None], -factors]) @ parts


class _Pairs(NamedTuple):
    """Differences of numbers (m,) from poles (n,) and from their conjugates."""

    to: Complexes  # (m, n)
    other: Complexes  # (m, n)
    both: Complexes  # (m, n) 2 over their products

    @classmethod
    def of(cls, near: Complexes, offset: Complexes, pole: Complexes) -> _Pairs:
        """Of the numbers ``near + offset``, which stand apart because the differences are to keep their digits."""
        to = (near[:, None] - pole) + offset[:, None]
        other = (near[:, None] - pole.conj()) + offset[:, None]
        return cls(to, other, 2.0 / (to * other))


def _zeros(pole: Complexes, residue: Complexes, k: float, c: float) -> tuple[Ints, Complexes] | None:
    """Zeros of the secular function in the upper half-plane, as offsets from poles; None where not all were found.

    The poles (n,) are sorted by their imaginary parts.
    """
    n = pole.size
    if np.any(np.abs(np.diff(pole)) < 1e-10 * np.abs(pole[:-1])):
        return None  # two count as one
    offset = -(k + c * pole) * residue
    space = np.diff(pole.imag, prepend=0.0, append=np.inf)
    offset *= np.minimum(1.0, 0.4 * np.where(offset.imag > 0.0, space[1:], space[:-1]) / np.abs(offset))
    near, last, turned = np.arange(n), np.full(n, np.inf), (residue * pole.conj()).real
    busy = np.arange(n)
    for _ in range(60):
        zeros = pole[near] + offset
        zero = zeros[busy]
        pairs = _Pairs.of(pole[near[busy]], offset[busy], pole)
        part = (zero[:, None] * residue.real - turned) * pairs.both
        inverse = (pairs.to.real + 1j * zero.imag[:, None]) * pairs.both
        apart = zero[:, None] - zeros
        apart[np.arange(busy.size), busy] = np.inf
        others = (inverse - 1.0 / apart - 1.0 / (zero[:, None] - zeros.conj())).sum(axis=1)
        total, z = part.sum(axis=1), k + c * zero
        value = 1.0 + z * total
        step = -value / (c * total + z * (residue.real * pairs.both - part * inverse).sum(axis=1) + value * others)
        if not np.all(np.isfinite(step)):
            return None
        new = offset[busy] + step
        below = (pole[near[busy]] + new).imag < 0.0  # its conjugate is the one that is still missing
        new = np.where(below, (pole[near[busy]] + new).conj() - pole[near[busy]], new)
        size = np.where(below, np.inf, np.abs(step))
        beside = np.clip(near[busy] + np.array([[0], [-1], [1]]), 0, n - 1)
        offsets = (pole[near[busy]] - pole[beside]) + new
        nearest = np.argmin(np.abs(offsets), axis=0), np.arange(busy.size)  # from which the distance is known best
        near[busy], offset[busy] = beside[nearest], offsets[nearest]
        scale = np.abs(offset[busy])
        # 4e-16: of a zero's distance from its pole
        # 1e-12: of a zero's distance from its pole, below which a step that no longer shrinks is round-off
        done = (size <= 4e-16 * scale) | ((size <= 1e-12 * scale) & (size >= 0.5 * last[busy]))
        last[busy] = size
        busy = busy[~done]
        if not busy.size:
            return (near, offset) if np.all((pole[near] + offset).imag > 0.0) else None
    return None


def _error(system: PiecewiseLinearSystem, k: Floats, c: Floats, shape: Floats, modes: SimpleModes) -> float:
    """Relative error, in the norm of the energy, of two motions and their rates from the modes."""
    n = system.size
    omega = np.sqrt(np.maximum(system.stiffness, 1e-300))[:, None]
    motion = np.array([[1.0, 1.0], [1.0, -1.0]])[np.arange(2 * n) * (np.arange(2 * n) + 1) // 2 % 2]
    motion[:n] /= omega
    amplitude = modes.left @ motion
    both = 2.0 * (modes.right @ np.hstack([amplitude, amplitude * modes.eigenvalue[:, None]])).real
    back, rate = both[:, :2], both[:, 2:]
    q, v = motion[:n], motion[n:]
    force = system.stiffness[:, None] * q + np.diag(system.damping)[:, None] * v
    force += shape.T @ (k[:, None] * (shape @ q) + c[:, None] * (shape @ v))
    lost, late = back - motion, rate - np.vstack([v, -force])
    for part in (lost, late):
        part[:n] *= omega
    return float(max(np.abs(lost).max(), np.abs(late).max() / max(np.abs(force).max(), float(omega.max()))))
