"""Natural modes of a full model, with high relative accuracy of the lowest frequencies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigh, solve_triangular, svd
from scipy.sparse.linalg import LinearOperator, eigsh

from beamsim.structures.structure import Structure
from beamsim.structures.symmetric_lu import SymmetricLU, symmetric_lu
from beamsim.typing import Floats, Ints

# Larger matrices use shift-invert Lanczos instead of a dense decomposition.
DENSE_LIMIT = 400


@dataclass(frozen=True)
class Modes:
    """Lowest natural modes in scaled units; rigid-body modes first, their frequencies exactly zero."""

    omega: Floats  # (k,) scaled natural angular frequencies, ascending
    vectors: Floats  # (N, k) orthonormal in the mass matrix


NEGLIGIBLE_EXTENSION = 1e-10  # extension of a spring per unit motion; smaller values are round-off


def allowed_rigid_motions(motions: Floats, extension: Floats, length: Floats | float = 1.0) -> Floats:
    """(k, r) rigid-body motions that supports and springs allow.

    They are found from the geometry, so that their frequencies are exactly zero.

    Parameters
    ----------
    motions : (N, k) all rigid-body motions, on all degrees of freedom.
    extension : (c, k) extension of each restraint for each motion.
    length : (c,) length scale of each row of ``extension``.

    Returns
    -------
    (k, r) array
        Coefficients of the k motions in each allowed motion.
    """
    unit = np.linalg.norm(motions, axis=0)
    if not extension.size:
        return np.diag(1 / unit)
    _, s, vt = np.linalg.svd(extension / np.reshape(length, (-1, 1)) / unit)
    return np.asarray(vt[int(np.sum(s > NEGLIGIBLE_EXTENSION)) :].T / unit[:, None])


def orthonormal_in_mass(vectors: Floats, mass: Any) -> Floats:
    """(N, r) basis of the same space, orthonormal in the mass matrix (Gram-Schmidt)."""
    if not vectors.shape[1]:
        return vectors
    lower = np.linalg.cholesky(vectors.T @ (mass @ vectors))
    return np.asarray(np.linalg.solve(lower, vectors.T).T)


def orient(vectors: Floats, deflections: Floats) -> Floats:
    """Flip columns so that the last significant deflection (more than a tenth of the largest) is positive.

    The free end of a cantilever then moves up in every mode. A threshold instead of the maximum makes the sign of
    symmetric shapes independent of round-off. ``deflections`` (d, k) are those of the columns, in the order of the
    stations.
    """
    moved = np.abs(deflections) > 0.1 * np.abs(deflections).max(axis=0)
    last = deflections.shape[0] - 1 - np.argmax(moved[::-1], axis=0)
    sign = np.where(deflections[last, np.arange(vectors.shape[1])] < 0, -1.0, 1.0)
    return np.asarray(vectors * sign)


def lowest_eigenpairs(
    stiffness: Any, mass: Any, count: int, shift: float, factors: SymmetricLU | Ints | None = None
) -> tuple[Floats, Floats]:
    """Lowest eigenvalues of K x = lambda M x: all by a dense method, or by shift-invert Lanczos for large matrices.

    Parameters
    ----------
    stiffness, mass : (N, N) sparse.
    count : number of eigenvalues.
    shift : value below the lowest eigenvalue.
    factors : factors of K - shift M, or (N,) order of elimination.

    Returns
    -------
    (count,), (N, count)
        Ascending; the vectors are orthonormal in M.
    """

    size = mass.shape[0]
    if size <= DENSE_LIMIT or count > size // 4:
        return eigh(stiffness.toarray(), mass.toarray(), subset_by_index=[0, count - 1])
    lu = factors if isinstance(factors, SymmetricLU) else symmetric_lu(stiffness - shift * mass, factors)
    inverse = LinearOperator(mass.shape, matvec=lu.solve)
    squared, vectors = eigsh(stiffness, k=count, M=mass, sigma=shift, OPinv=inverse, v0=np.linspace(1.0, 2.0, size))
    order = np.argsort(squared)
    return squared[order], vectors[:, order]


def _sparse(model: Structure, count: int) -> tuple[Floats, Floats]:
    """The lowest `count` flexible modes by shift-invert Lanczos, followed by a Rayleigh-Ritz step with B."""
    rigid = model.rigid.shape[1]
    # K alone is singular if there are rigid-body modes; the shift is far below the flexible eigenvalues.
    sigma = -1e-3 if rigid else 0.0
    factors = model.order if rigid else model.factorised_stiffness
    _, vectors = lowest_eigenpairs(model.stiffness, model.mass, count + rigid, sigma, factors)
    return _rayleigh_ritz(model, vectors, count)


def _rayleigh_ritz(model: Structure, vectors: Floats, count: int) -> tuple[Floats, Floats]:
    """The lowest `count` flexible modes within span(vectors)."""
    v = vectors - model.rigid @ (model.rigid.T @ (model.mass @ vectors))
    # Orthonormal basis in M, without rigid-body directions.
    mu, y = np.linalg.eigh(v.T @ (model.mass @ v))
    keep = np.argsort(mu)[-count:]
    q = v @ (y[:, keep] / np.sqrt(mu[keep]))
    _, omega, vt = np.linalg.svd(model.factor @ q, full_matrices=False)
    return omega[::-1], q @ vt[::-1].T


def natural_modes(
    model: Structure, count: int | None = None, up_to: float | None = None, most_modes: int | None = None
) -> Modes:
    """The lowest modes, beginning with the rigid-body modes.

    Parameters
    ----------
    model : the full model.
    count : at least this many modes (all modes if it exceeds the size of the model).
    up_to : at least all modes up to this scaled angular frequency. Without `count` and `below`: all modes.
    most_modes : largest number of modes below that frequency.

    Returns
    -------
    Modes
        Scaled, orthonormal in the mass matrix, ascending.

    Notes
    -----
    Frequencies are singular values of B L^{-T} with M = L L^T (or of B on the Ritz vectors), not square roots of
    eigenvalues of K. Their absolute error is machine precision times the *highest frequency*; for eigenvalues it would
    be its square.
    """
    if model.substructures:
        return _modes_of_substructures(model, count, up_to)
    size, rigid = model.rigid.shape
    few = size > DENSE_LIMIT and (count is not None or up_to is not None)
    needed = _number_needed(model, count or 0, up_to, most_modes) if few else size
    omega, vectors = _all_elastic(model) if needed > size // 4 else _lowest_elastic(model, needed - rigid)
    vectors = np.hstack([model.rigid, vectors])
    return Modes(np.concatenate([np.zeros(rigid), omega]), orient(vectors, model.deflections(vectors)))


def _number_needed(model: Structure, count: int, up_to: float | None, most_modes: int | None) -> int:
    """Number of modes to compute; see `natural_modes`."""
    size, rigid = model.rigid.shape
    estimate = 0 if up_to is None else model.frequency_count(up_to) + 1
    return int(min(max(count, estimate if most_modes is None else min(estimate, most_modes), rigid), size))


def _all_elastic(model: Structure) -> tuple[Floats, Floats]:
    """Frequencies and vectors of all flexible modes, by a dense decomposition."""
    size, rigid = model.rigid.shape
    lower = np.linalg.cholesky(model.mass.toarray())
    x = solve_triangular(lower, model.factor.toarray().T, lower=True).T
    _, omega, vt = svd(x, full_matrices=False)
    order = np.arange(size - rigid)[::-1]
    return omega[order], solve_triangular(lower, vt[order].T, lower=True, trans="T")


def _lowest_elastic(model: Structure, count: int) -> tuple[Floats, Floats]:
    """Frequencies and vectors of the lowest flexible modes; empty for a count of zero."""
    return _sparse(model, count) if count > 0 else (np.zeros(0), np.zeros((model.rigid.shape[0], 0)))


def mode_of_unit_deflection(model: Structure, mode: int) -> Floats:
    """(N,) a natural mode, numbered from 1, scaled to a largest nodal deflection of 1."""
    field = natural_modes(model, count=mode).vectors[:, mode - 1]
    deflections = model.deflections(field)
    return np.asarray(field / deflections[np.argmax(np.abs(deflections))])


def _modes_of_substructures(model: Structure, count: int | None, up_to: float | None) -> Modes:
    """The modes of all substructures in order of frequency, each of a single substructure."""
    omega, vectors = [], []
    for structure, dofs in ((part.structure, part.dofs) for part in model.substructures):
        ratio = structure.frequency_scale / model.frequency_scale
        modes = natural_modes(structure, count, None if up_to is None else up_to / ratio)
        widened = np.zeros((model.size, modes.omega.size))
        widened[dofs] = modes.vectors * np.sqrt(model.mass_scale / structure.mass_scale)
        omega.append(modes.omega * ratio)
        vectors.append(widened)
    together = np.concatenate(omega)
    order = np.argsort(together, kind="stable")
    return Modes(together[order], np.hstack(vectors)[:, order])


def closed_modes(omega: Floats, shape: Floats, stiffness: Floats, rigid_count: int) -> tuple[Floats, Floats]:
    """Natural frequencies and modes of a structure (K = diag(omega^2), M = I) with additional springs.

    Parameters
    ----------
    omega : (n,) natural angular frequencies, the first `rigid` of them zero.
    shape : (m, n) deflection at each spring for a unit of each coordinate.
    stiffness : (m,) spring stiffnesses, not negative.
    rigid_count : number of rigid-body coordinates; those without a spring keep a frequency of exactly zero.

    Returns
    -------
    (n,), (n, n)
        rad/s, ascending; the modes are orthonormal columns.
    """
    shape, stiffness = shape[stiffness > 0.0], stiffness[stiffness > 0.0]
    if not stiffness.size:
        return omega, np.eye(omega.size)
    x = np.vstack([np.diag(omega), shape * np.sqrt(stiffness)[:, None]])
    _, closed, modes = np.linalg.svd(x, full_matrices=False)
    closed, modes = closed[::-1].copy(), modes[::-1].T
    if rigid_count:
        closed[: rigid_count - _restrained_count(shape, rigid_count)] = 0.0
    return closed, modes


def _restrained_count(shape: Floats, rigid_count: int) -> int:
    """Number of rigid-body coordinates (the first ones) that springs with shapes (m, n) restrain."""
    scale = np.linalg.norm(shape, axis=1, keepdims=True)
    rows = shape[:, :rigid_count] / np.where(scale > 0, scale, 1.0)
    return int(np.linalg.matrix_rank(rows, tol=1e-12 * np.sqrt(shape.shape[1])))
