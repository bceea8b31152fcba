"""Sums of products of outputs as quadratic forms of the exponential terms that a motion is made of.

Outputs ``a = Re sum a_i u_i`` and b of the terms ``u_i`` have the product ``a b = Re sum plus_ij u_i u_j + minus_ij u_i
conj(u_j)`` over pairs i <= j; :mod:`beamsim.flow.term_integrals` integrates such forms on
many segments, :func:`beamsim.flow.integral_kernels.form_integrals` on the few of a periodic motion.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from beamsim.typing import Complexes


def forms(products: Iterable[tuple[Complexes, Complexes]]) -> tuple[Complexes, Complexes]:
    """The two forms (..., T, T) of a sum of products, whose factors are coefficients (..., T, k) of k outputs each."""
    left, right = (np.concatenate(factors, axis=-1) for factors in zip(*products, strict=True))
    plus, minus = left @ right.swapaxes(-1, -2), left @ right.conj().swapaxes(-1, -2)
    once = np.full(plus.shape[-2:], 0.5)  # each pair of terms counts once
    np.fill_diagonal(once, 0.25)
    return once * (plus + plus.swapaxes(-1, -2)), once * (minus + minus.conj().swapaxes(-1, -2))
