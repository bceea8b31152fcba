"""Modes of a contact state from those of a state that differs in few contacts.

A spring and a dashpot change the matrices by one dyad each, and the modes by :mod:`beamsim.flow.secular_kernels`: n^2
operations for the eigenvalues and one product of matrices for the vectors, against some 25 n^3 for the eigenvalue
problem of order 2n. What comes out is checked with two motions and not used where it isn't exact.
"""

from __future__ import annotations

import numpy as np

from beamsim.flow.invariant_blocks import SimpleModes
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats, Ints

SMALLEST = 24  # coordinates, below which a fresh eigenvalue problem is as fast
MOST_CHANGES = 4  # contacts by which two states may differ
INEXACT = 1e-11  # relative error of a motion and its rate, at which the eigenvalue problem is solved anew


def can_update(system: PiecewiseLinearSystem, before: Ints, phases: Ints) -> bool:
    """Whether the modes with the contacts in given phases may follow from those with the phases ``before``.

    Undamped modes don't: their eigenvalues have no real part, and round-off would give them one.
    """
    n, contacts = system.size, system.contacts
    if n < SMALLEST or contacts.coupled(before) or contacts.coupled(phases):
        return False
    diagonal = not np.any(system.damping.reshape(-1)[:-1].reshape(n - 1, n + 1)[:, 1:])
    damped = bool(system.damping.any() or contacts.damped)
    return bool(diagonal and damped and np.count_nonzero(before != phases) <= MOST_CHANGES)


def neighbouring_modes(
    system: PiecewiseLinearSystem, known: SimpleModes, before: Ints, phases: Ints
) -> SimpleModes | None:
    """Modes of (q, q') with the contacts in given phases, one of each conjugate pair, from those ``known`` with the
    phases ``before`` (see `can_update`); None where they have to be computed anew."""
    from beamsim.flow.secular_kernels import update

    n, contacts = system.size, system.contacts
    upper = known.eigenvalue.imag > 0.0
    if np.count_nonzero(upper) < n:
        return None
    old, new = contacts.force_rows(before)[0], contacts.force_rows(phases)[0]
    change = (new - old)[:, :2]
    changed = np.flatnonzero(change.any(axis=1))
    pole = known.eigenvalue[upper]
    order = np.argsort(pole.imag)
    pole, right, left = pole[order], known.right[:n, upper][:, order], known.left[upper, n : 2 * n][order].T
    largest = np.argmax(np.abs(right), axis=0)[None]
    scale = np.take_along_axis(left, largest, 0) / np.take_along_axis(right, largest, 0)
    vectors = right * np.sqrt(scale)
    zero, weight = np.empty(n, dtype=complex), np.empty((2 * n, 2 * n))
    for j in changed:
        p = contacts.shape[j] @ vectors
        if not update(pole, p, float(change[j, 0]), float(change[j, 1]), zero, weight):
            return None
        scaled = vectors * p
        parts = np.hstack([scaled.real, (scaled * pole.conj()).real]) @ weight
        vectors = np.where(p == 0.0, vectors, parts[:, :n] + 1j * parts[:, n:])
        order = np.argsort(zero.imag)
        pole, vectors = zero[order], vectors[:, order]
    acting = np.flatnonzero(new[:, :2].any(axis=1))
    k, c, shape = new[acting, 0], new[acting, 1], contacts.shape[acting]
    own = np.diag(system.damping)
    _refine_stiff(system.stiffness, own, k, c, shape, pole, vectors)
    damped = own[:, None] * vectors + shape.T @ (c[:, None] * (shape @ vectors))
    modes = SimpleModes(np.vstack([vectors, vectors * pole]), np.hstack([(vectors * pole + damped).T, vectors.T]), pole)
    return modes if _error(system, k, c, shape, modes) < INEXACT else None


def _refine_stiff(
    stiffness: Floats, damping: Floats, k: Floats, c: Floats, shape: Floats, pole: Complexes, vectors: Complexes
) -> None:
    """Small components of the stiff modes' vectors, in place, from the contacts' forces on them.

    They are sums in which a pair of conjugate poles cancels. ``u_i = -sum_j phi_ji z_j (phi_j u) / (lambda^2 + d_i
    lambda + omega_i^2)`` gives them without, where no contact is stiff against lambda^2 and errors don't grow.
    """
    z = k[:, None] + c[:, None] * pole
    divisor = (pole + damping[:, None]) * pole + stiffness[:, None]
    near = np.abs(divisor) < 0.5 * (np.abs(pole) ** 2 + stiffness[:, None])
    size = np.where(near, 0.0, 1.0 / np.abs(divisor))
    stiff = np.sum(np.abs(z) * (shape**2 @ size), axis=0) < 0.5
    divisor[near] = 1.0
    u = vectors[:, stiff]
    vectors[:, stiff] = np.where(near[:, stiff], u, shape.T @ (z[:, stiff] * -(shape @ u)) / divisor[:, stiff])


def _error(system: PiecewiseLinearSystem, k: Floats, c: Floats, shape: Floats, modes: SimpleModes) -> float:
    """Relative error, in the norm of the energy, of two motions and their rates from the modes."""
    n = system.size
    omega = np.sqrt(np.maximum(system.stiffness, 1e-300))[:, None]
    motion = np.array([[1.0, 1.0], [1.0, -1.0]])[np.arange(2 * n) * (np.arange(2 * n) + 1) // 2 % 2]
    motion[:n] /= omega
    amplitude = modes.left @ motion
    back, rate = (2.0 * (modes.right @ a).real for a in (amplitude, amplitude * modes.eigenvalue[:, None]))
    q, v = motion[:n], motion[n:]
    force = system.stiffness[:, None] * q + np.diag(system.damping)[:, None] * v
    force += shape.T @ (k[:, None] * (shape @ q) + c[:, None] * (shape @ v))
    lost, late = back - motion, rate - np.vstack([v, -force])
    for part in (lost, late):
        part[:n] *= omega
    return float(max(np.abs(lost).max(), np.abs(late).max() / max(np.abs(force).max(), float(omega.max()))))
