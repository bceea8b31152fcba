"""Sums of products of outputs as quadratic forms of the exponential terms that a motion is made of.

Outputs ``a = Re sum a_i u_i`` and b of the terms ``u_i`` have the product ``a b = Re sum plus_ij u_i u_j + minus_ij u_i
conj(u_j)`` over pairs i <= j; :mod:`beamsim.flow.term_integrals` integrates such forms on
many segments, :func:`beamsim.flow.integral_kernels.form_integrals` on the few of a periodic motion.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from beamsim.typing import Complexes, Floats


def forms(products: Iterable[tuple[Complexes, Complexes]]) -> Complexes:
    """(2, ..., T, T) plus and minus of a sum of products, of coefficients (..., T, k) of k outputs each."""
    left, right = (_parts(np.concatenate(factors, axis=-1)) for factors in zip(*products, strict=True))
    count = left.shape[-2] // 2
    both = left @ right.swapaxes(-1, -2)  # of real and imaginary parts, in one real product
    both = both + both.swapaxes(-1, -2)  # of i, j and of j, i
    one, two = both[..., :count, :count], both[..., count:, count:]
    across, back = both[..., :count, count:], both[..., count:, :count]
    out = np.empty((2, *one.shape), dtype=complex)
    plus, minus = out
    plus.real, plus.imag, minus.real, minus.imag = one - two, across + back, one + two, back - across
    out *= _once(count)
    return out


def _parts(factor: Complexes) -> Floats:
    """(..., 2 T, k) real parts, then imaginary parts."""
    return np.concatenate([factor.real, factor.imag], axis=-2)


@lru_cache(maxsize=8)
def _once(count: int) -> Floats:
    """(T, T) so that each pair of terms counts once."""
    once = np.full((count, count), 0.5)
    np.fill_diagonal(once, 0.25)
    return once
