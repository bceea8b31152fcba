"""Natural modes of a full model, precise at the low end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.structures.structure import Structure

# Above this size the lowest modes come from shift-invert Lanczos instead of a dense decomposition.
DENSE_LIMIT = 400


@dataclass(frozen=True)
class Modes:
    """Lowest natural modes in scaled units; rigid-body modes first, their frequencies exactly zero."""

    omega: Floats  # (k,) scaled natural angular frequencies, ascending
    vectors: Floats  # (N, k) orthonormal in the mass matrix

    def first(self, count: int) -> Modes:
        """The lowest `count` of them."""
        return Modes(self.omega[:count], self.vectors[:, :count])


def orient(vectors: Floats, deflection_dofs: Ints) -> Floats:
    """Columns with the sign that lifts the last point deflected by more than a tenth of the largest deflection.

    A cantilever's free end moves up in every mode. Choosing the point by a threshold, not by the
    maximum, keeps the sign of symmetric shapes independent of round-off.
    """
    w = vectors[deflection_dofs]
    moved = np.abs(w) > 0.1 * np.abs(w).max(axis=0)
    last = w.shape[0] - 1 - np.argmax(moved[::-1], axis=0)
    sign = np.where(w[last, np.arange(w.shape[1])] < 0, -1.0, 1.0)
    return np.asarray(vectors * sign)


def _dense(model: Structure) -> tuple[Floats, Floats]:
    """All flexible modes: the singular values of B L^{-T} (M = L L^T) are the frequencies."""
    from scipy.linalg import solve_triangular, svd

    lower = np.linalg.cholesky(model.mass.toarray())
    x = solve_triangular(lower, model.factor.toarray().T, lower=True).T
    flexible = model.size - model.rigid.shape[1]
    _, omega, vt = svd(x, full_matrices=False)
    order = np.arange(flexible)[::-1]
    vectors = solve_triangular(lower, vt[order].T, lower=True, trans="T")
    return omega[order], vectors


def _sparse(model: Structure, count: int) -> tuple[Floats, Floats]:
    """The lowest `count` flexible modes by shift-invert Lanczos, then one Rayleigh-Ritz step through B."""
    from scipy.sparse.linalg import eigsh

    rigid = model.rigid.shape[1]
    stiffness = (model.factor.T @ model.factor).tocsc()
    # K alone is singular where rigid-body modes exist; the shift is far below the flexible eigenvalues.
    _, vectors = eigsh(
        stiffness, k=count + rigid, M=model.mass, sigma=-1e-3 if rigid else 0.0, v0=np.linspace(1.0, 2.0, model.size)
    )
    return _rayleigh_ritz(model, vectors, count)


def _rayleigh_ritz(model: Structure, vectors: Floats, count: int) -> tuple[Floats, Floats]:
    """The lowest `count` flexible modes within span(vectors)."""
    v = vectors - model.rigid @ (model.rigid.T @ (model.mass @ vectors))
    # Orthonormal basis in M, without the directions that were rigid.
    mu, y = np.linalg.eigh(_gram(model, v))
    keep = np.argsort(mu)[-count:]
    q = v @ (y[:, keep] / np.sqrt(mu[keep]))
    _, omega, vt = np.linalg.svd(model.factor @ q, full_matrices=False)
    return omega[::-1], q @ vt[::-1].T


def _gram(model: Structure, v: Any) -> Floats:
    return np.asarray(v.T @ (model.mass @ v))


def natural_modes(model: Structure, count: int | None = None, below: float | None = None) -> Modes:
    """The lowest modes, rigid-body modes included and first.

    Parameters
    ----------
    model : the full model.
    count : at least this many modes (all of them where it exceeds the model's size).
    below : at least all modes with scaled angular frequency up to this. Neither: all modes.

    Notes
    -----
    Frequencies are singular values of B L^{-T} (or of B on the Ritz vectors), not roots of
    eigenvalues of K: their absolute error is machine precision times the *highest frequency*, not its square.
    """
    rigid = model.rigid.shape[1]
    wanted = model.size
    if count is not None or below is not None:
        wanted = max(count or 0, 0 if below is None else model.frequency_count(below) + 1, rigid)
    wanted = min(wanted, model.size)
    if model.size <= DENSE_LIMIT or wanted > model.size // 4:
        omega, vectors = _dense(model)
    elif wanted > rigid:
        omega, vectors = _sparse(model, wanted - rigid)
    else:
        omega, vectors = np.zeros(0), np.zeros((model.size, 0))
    vectors = np.hstack([model.rigid, vectors])
    return Modes(np.concatenate([np.zeros(rigid), omega]), orient(vectors, model.deflection_dofs))


def closed_frequencies(omega: Floats, shape: Floats, stiffness: Floats, rigid: int) -> Floats:
    """(n,) angular frequencies of the open structure (diagonal omega^2, M = I) with springs closed.

    Parameters
    ----------
    omega : (n,) natural angular frequencies, the first `rigid` of them zero.
    shape : (m, n) deflection at each spring for a unit of each coordinate.
    stiffness : (m,) spring stiffnesses.
    rigid : number of rigid-body coordinates; those that no spring holds keep exactly zero frequency.
    """
    n = omega.size
    x = np.vstack([np.diag(omega), shape * np.sqrt(stiffness)[:, None]])
    closed = np.linalg.svd(x, compute_uv=False)[::-1].copy()
    if rigid:
        scale = np.linalg.norm(shape, axis=1, keepdims=True)
        held = int(np.linalg.matrix_rank(shape[:, :rigid] / np.where(scale > 0, scale, 1.0), tol=1e-12 * np.sqrt(n)))
        closed[: rigid - held] = 0.0
    return np.asarray(closed, dtype=float)
