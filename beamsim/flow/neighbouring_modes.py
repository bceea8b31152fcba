"""Modes of a contact state from those of a state that differs in few contacts.

A spring and a dashpot change the matrices by one dyad each, and the modes by :mod:`beamsim.flow.secular_kernels`: n^2
operations for the eigenvalues and one product of matrices for the vectors, against some 25 n^3 for the eigenvalue
problem of order 2n. The result is checked with two motions and discarded where it is not exact.
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
    """Whether the modes of a contact state may follow from those of another one.

    Undamped modes may not: their eigenvalues have no real part, and round-off would give them one.

    Parameters
    ----------
    system : the structure.
    before, phases : (m,) of the contacts in the known state and in the new one.
    """
    n, contacts = system.size, system.contacts
    if n < SMALLEST or contacts.coupled(before) or contacts.coupled(phases):
        return False
    if contacts.holds(before).any() or contacts.holds(phases).any():
        return False
    if contacts.presses(before) or contacts.presses(phases):
        return False
    damped = contacts.damped or bool(np.diag(system.damping).any())
    return damped and not system.coupled_by_damping and int(np.count_nonzero(before != phases)) <= MOST_CHANGES


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
    from beamsim.flow.secular_kernels import update

    n, contacts = system.size, system.contacts
    upper = np.flatnonzero(known.eigenvalue.imag > 0.0)
    if upper.size < n:
        return None
    old, new = contacts.force_rows(before)[0], contacts.force_rows(phases)[0]
    change = (new - old)[:, :2]
    upper = upper[np.argsort(known.eigenvalue[upper].imag)]
    pole, rows = known.eigenvalue[upper], known.left[upper, n : 2 * n]  # vectors, one a row
    largest = np.argmax(_squares(rows), axis=1)
    rows *= np.sqrt(known.right[largest, upper] / rows[np.arange(n), largest])[:, None]
    zero, weight, parts = np.empty(n, dtype=complex), np.empty((2 * n, 2 * n)), np.empty((2 * n, n))
    for j in np.flatnonzero(change.any(axis=1)):
        p = rows @ contacts.shape[j]
        if not update(pole, p, float(change[j, 0]), float(change[j, 1]), zero, weight):
            return None
        scaled = p[:, None] * rows
        parts[:n] = scaled.real
        parts[n:] = pole.real[:, None] * scaled.real + pole.imag[:, None] * scaled.imag
        moved = weight @ parts
        still = p == 0.0
        moved[:n][still], moved[n:][still] = rows.real[still], rows.imag[still]
        rows.real, rows.imag = moved[:n], moved[n:]
        pole, order = zero.copy(), np.argsort(zero.imag)
        if np.any(np.diff(order) < 0):
            pole, rows = pole[order], rows[order]
    acting = np.flatnonzero(new[:, :2].any(axis=1))
    k, c, shape = new[acting, 0], new[acting, 1], contacts.shape[acting]
    damping = np.diag(system.damping)
    _refine_stiff(system.stiffness, damping, k, c, shape, pole, rows)
    modes = SimpleModes(np.empty((n, 2 * n), dtype=complex).T, np.empty((n, 2 * n), dtype=complex), pole)
    right = modes.right.T
    right[:, :n], modes.left[:, n:] = rows, rows
    np.multiply(pole[:, None], rows, out=right[:, n:])
    np.multiply(damping, rows, out=modes.left[:, :n])
    modes.left[:, :n] += right[:, n:]
    modes.left[:, :n] += _combined(_combined(rows, shape.T) * c, shape)
    return modes if _error(system, k, c, shape, modes) < INEXACT else None


def _refine_stiff(
    stiffness: Floats, damping: Floats, k: Floats, c: Floats, shape: Floats, pole: Complexes, rows: Complexes
) -> None:
    """Small components of the stiff modes' vectors, one a row, in place, from the contacts' forces on them.

    They are sums in which a pair of conjugate poles cancels. ``u_i = -sum_j phi_ji z_j (phi_j u) / (lambda^2 + d_i
    lambda + omega_i^2)`` gives them without, where no contact is stiff against lambda^2 and errors don't grow.
    """
    z = k + c * pole[:, None]
    divisor = (pole[:, None] + damping) * pole[:, None] + stiffness
    square = _squares(divisor)
    far = square >= (0.5 * (_squares(pole)[:, None] + stiffness)) ** 2
    compliance = np.divide(1.0, np.sqrt(square), out=np.zeros_like(square), where=far) @ (shape**2).T
    stiff = np.flatnonzero(np.sum(np.abs(z) * compliance, axis=1) < 0.5)
    refined = _combined(-z[stiff] * _combined(rows[stiff], shape.T), shape)
    rows[stiff] = np.divide(refined, divisor[stiff], out=rows[stiff], where=far[stiff])


def _combined(vectors: Complexes, matrix: Floats) -> Complexes:
    """Products of vectors, one a row, with a real matrix: that of their real and of their imaginary parts."""
    count = vectors.shape[0]
    both = np.concatenate([vectors.real, vectors.imag]) @ matrix
    out = np.empty((count, matrix.shape[1]), dtype=complex)
    out.real, out.imag = both[:count], both[count:]
    return out


def _squares(z: Complexes) -> Floats:
    """Squared sizes."""
    return np.asarray(z.real**2 + z.imag**2)


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
