r"""How many natural frequencies of a full model lie below a given one: Sturm counts.

By Sylvester's law of inertia, :math:`K - \Omega^2 M = L D L^T` has as many negative entries in D as there are natural
frequencies below :math:`\Omega`, whatever an eigenvalue solver found or missed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.structure import Structure

# Largest residual of a factorisation, beside the largest diagonal entry, for which its signs are counted.
_RESIDUAL = 1e-12
# Above this size a matrix whose factors are not accurate without pivoting is not factorised densely.
_DENSE = 3000
# Relative distance that a limit is moved by where the matrix is singular at it.
_ASIDE = 1e-7
# Where between the last kept frequency and the guess for the next one frequencies are counted, until it is the next.
_SHARES = (0.97, 0.9, 0.7, 0.4)


def negative_eigenvalues(matrix: Any) -> int | None:
    """Number of negative eigenvalues of a symmetric sparse matrix; None where round-off leaves it unknown.

    The sparse factorisation keeps to the diagonal, so its error is checked; a small matrix for which that fails is
    factorised densely with pivoting (Bunch and Kaufman).
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    size = np.sqrt(np.maximum(np.abs(matrix.diagonal()), np.finfo(float).tiny))
    scaled: Any = csc_array(matrix / size[:, None] / size[None, :])
    try:
        lu = splu(scaled, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # exactly singular
        lu = None
    if lu is not None and np.array_equal(lu.perm_r, lu.perm_c) and _residual(lu, scaled) <= _RESIDUAL:
        return int(np.sum(lu.U.diagonal() < 0))
    if scaled.shape[0] > _DENSE:
        return None
    from scipy.linalg import ldl

    _, d, _ = ldl(scaled.toarray())
    return int(np.sum(np.linalg.eigvalsh(d) < 0))


def _residual(lu: Any, matrix: Any) -> float:
    """Largest error of the factors; of a large matrix as it shows in 8 products with vectors of random signs.

    Their product with each other would take as long as the factorisation many times over. An entry of the error shows
    in each product with its own size at least with a chance of one half.
    """
    from scipy.sparse import csc_array

    entries = matrix.tocoo()
    permuted = csc_array((entries.data, (lu.perm_r[entries.row], lu.perm_c[entries.col])), shape=matrix.shape)
    if matrix.shape[0] <= _DENSE:
        return float(abs(lu.L @ lu.U - permuted).max())
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(matrix.shape[0], 8))
    return float(np.abs(lu.L @ (lu.U @ signs) - permuted @ signs).max())


def frequency_beyond(model: Structure, kept: Floats, guess: float) -> float:
    """A lower bound of the natural frequencies that are not among the lowest, ``kept`` ones (scaled, ascending).

    Certified by Sturm counts, up to round-off of their factorisations: below the value returned there are no natural
    frequencies but those kept. Zero where the kept ones are not the lowest; nan where no count is known.

    Parameters
    ----------
    guess : an upper bound of the first of the others, such as a Ritz value beyond the kept modes.
    """
    stiffness = model.stiffness
    last = float(kept[-1]) if kept.size else 0.0
    between = last + (guess - last) * np.array(_SHARES)
    counts = []
    for omega in (*between[between > last], last * (1 + _ASIDE), last * (1 - _ASIDE)):
        counts.append(negative_eigenvalues(stiffness - omega**2 * model.mass))
        if counts[-1] == int(np.sum(kept < omega)):
            return float(omega)
    return np.nan if None in counts else 0.0
