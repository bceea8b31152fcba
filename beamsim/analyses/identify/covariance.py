"""What residuals and their derivatives say about the uncertainty of the parameters of a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from beamsim.typing import Floats


def widening(misfit: float, freedom: int) -> float:
    """Factor on a covariance: chi^2 per degree of freedom where noise as given hardly explains it, else 1."""
    from scipy.special import gammaincc

    unexplained = freedom > 0 and float(gammaincc(freedom / 2, misfit / 2)) < 1e-3  # probability of chi^2
    return misfit / freedom if unexplained else 1.0


def inverse_information(jacobian: Floats) -> Floats:
    """(p, p) inverse of ``jacobian.T @ jacobian``, nan for parameters that the residuals do not determine.

    These are parameters without influence, and those of a combination without influence. If a derivative is not known
    (nan), no variance is.
    """
    if not jacobian.size or not np.all(np.isfinite(jacobian)):
        return np.full((jacobian.shape[1],) * 2, np.nan)
    size = np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0, size, 1.0)
    scaled = jacobian / size
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    # 1e-14: ratio of eigenvalues below which a combination of parameters has no influence
    null = values <= 1e-14 * values[-1]
    inverse = np.asarray((vectors[:, ~null] / values[~null]) @ vectors[:, ~null].T / np.outer(size, size))
    undetermined = (vectors[:, null] ** 2).sum(axis=1) > 1e-12
    inverse[undetermined, :] = inverse[:, undetermined] = np.nan
    return inverse


def confounded(names: Sequence[str], jacobian: Floats, covariance: Floats) -> list[str]:
    """Warnings about parameters that the measurements cannot distinguish."""
    if len(names) == 0:
        return []
    size = np.linalg.norm(jacobian, axis=0)
    warnings = [
        f"{name} has no influence on the measured quantities and cannot be identified from them"
        for name, s in zip(names, size, strict=True)
        if s <= 1e-9 * size.max()
    ]
    usable = size > 1e-9 * size.max()
    if usable.sum() > 1:
        kept = [name for name, ok in zip(names, usable, strict=True) if ok]
        _, values, directions = np.linalg.svd(jacobian[:, usable] / size[usable], full_matrices=True)
        values = np.concatenate([values, np.zeros(len(kept) - values.size)])
        for value, direction in zip(values, directions, strict=True):
            if value < 1e-6 * values[0]:
                together = [n for n, d in zip(kept, direction, strict=True) if abs(d) > 0.2]
                warnings.append(
                    f"{' and '.join(together)} cannot be distinguished: the measurements depend only on a "
                    "combination of them; fix one of them, or give it a prior"
                )
        if not any("cannot be distinguished" in w for w in warnings):
            correlation = correlation_of(covariance)
            for i in range(len(names)):
                warnings += [
                    f"{names[j]} and {names[i]} can hardly be distinguished: their correlation is "
                    f"{correlation[i, j]:.4f}; fix one of them, give it a prior, or measure more"
                    for j in range(i)
                    if abs(correlation[i, j]) > 0.995
                ]
    return warnings


def correlation_of(covariance: Floats) -> Floats:
    """(p, p) correlation; nan where it is unknown."""
    with np.errstate(all="ignore"):
        deviation = np.sqrt(np.diag(covariance))
        return np.asarray(covariance / np.outer(deviation, deviation))
