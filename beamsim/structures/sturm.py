r"""How many natural frequencies of a full model lie below a given one: Sturm counts.

By Sylvester's law of inertia, :math:`K - \Omega^2 M = L D L^T` has as many negative entries in D as there are natural
frequencies below :math:`\Omega`, whatever an eigenvalue solver found or missed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import ldl

from beamsim.structures.structure import Structure
from beamsim.structures.symmetric_lu import symmetric_lu, unit_diagonal
from beamsim.typing import Floats, Ints

# Above this size a matrix whose factors are not accurate without pivoting is not factorised densely.
_DENSE = 3000
# Relative distance that a limit is moved by where the matrix is singular at it.
_ASIDE = 1e-7
# Where between the last kept frequency and the guess for the next one frequencies are counted, until it is the next.
_SHARES = (0.97, 0.9, 0.7, 0.4)


def negative_eigenvalues(matrix: Any, order: Ints | None = None) -> int | None:
    """Number of negative eigenvalues of a symmetric sparse matrix; None where round-off leaves it unknown.

    ``order`` may be the rows in the order of elimination.

    The sparse factorisation keeps to the diagonal, so its error is checked; a small matrix for which that fails is
    factorised densely with pivoting (Bunch and Kaufman).
    """
    try:
        factors = symmetric_lu(matrix, order)
    except RuntimeError:  # exactly singular
        factors = None
    if factors is not None and factors.signs_are_certain:
        return int(np.sum(factors.pivots < 0))
    if matrix.shape[0] > _DENSE:
        return None

    _, d, _ = ldl(unit_diagonal(matrix)[0].toarray())
    return int(np.sum(np.linalg.eigvalsh(d) < 0))


def frequency_beyond(model: Structure, kept: Floats, guess: float) -> float:
    """A lower bound of the natural frequencies that are not among the lowest, ``kept`` ones (scaled, ascending).

    Certified by Sturm counts, up to round-off of their factorisations: below the value returned there are no natural
    frequencies but those kept. Zero where the kept ones are not the lowest; nan where no count is known.

    Parameters
    ----------
    guess : an upper bound of the first of the others, such as a Ritz value beyond the kept modes.

    Returns
    -------
    float
        Scaled angular frequency; zero or nan as said above.
    """
    stiffness = model.stiffness
    last = float(kept[-1]) if kept.size else 0.0
    between = last + (guess - last) * np.array(_SHARES)
    limits = [*between[between > last], last * (1 + _ASIDE), last * (1 - _ASIDE)]
    undecided = False
    while limits:
        omega = limits.pop(0)
        count = negative_eigenvalues(stiffness - omega**2 * model.mass, model.order)
        known = int(np.sum(kept < omega))
        if count == known:
            return float(omega)
        undecided |= count is None
        if model.size > _DENSE and count is not None and count > known + 3 and omega > last:
            # Of a large model counts are dear, and its modes come about evenly: where the next one is expected.
            expected = (omega - last) / (count - known)
            limits = [last + expected / 2, *(limit for limit in limits if limit < last + expected / 2)]
    return np.nan if undecided else 0.0
