"""Likeness of shapes and responses: the assurance criteria."""

from __future__ import annotations

import numpy as np

from beamsim.typing import Complexes, Floats


def modal_assurance(first: Floats | Complexes, second: Floats | Complexes) -> Floats:
    r"""(m, n) of vectors (p, m) and (p, n): 1 where they differ by a factor alone, 0 where they are orthogonal.

    :math:`|a^H b|^2 / (a^H a\, b^H b)`, nan where one of them vanishes. Of mode shapes it is the modal assurance
    criterion (R. J. Allemang, D. L. Brown, A correlation coefficient for modal vector analysis, IMAC 1982), of a
    response over frequency the FRAC (W. Heylen, S. Lammens, FRAC: a consistent way of comparing frequency response
    functions, 1996), of the responses of several channels at two frequencies the FDAC (R. Pascual, J. C. Golinval,
    M. Razeto, A frequency domain correlation technique for model correlation and updating, IMAC 1997).
    """
    sizes = np.outer(np.sum(np.abs(first) ** 2, axis=0), np.sum(np.abs(second) ** 2, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.abs(first.conj().T @ second) ** 2 / sizes)
