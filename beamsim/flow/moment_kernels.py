"""Compiled moments of exponentials; see :mod:`beamsim.flow.moments`."""

from __future__ import annotations

import math

from beamsim.flow.compiled import kernel

LEAST = 1.0  # size of an exponent from which (e^x - 1) / x keeps its digits


@kernel
def _moments(x, top, out):
    """``int_0^1 s^q e^{x s} ds`` for q = 0 ... top: upward while q is no larger than x, then downward from a series.

    Parameters
    ----------
    x : exponent, complex.
    top : highest q.
    out : (top + 1,) complex; written.
    """
    size = math.sqrt(x.real * x.real + x.imag * x.imag)
    grown = math.exp(x.real)
    end = complex(grown * math.cos(x.imag), grown * math.sin(x.imag))
    known = -1
    if size >= LEAST:
        inverse = 1.0 / x
        out[0] = (end - 1.0) * inverse
        known = min(top, int(size))
        for q in range(1, known + 1):
            out[q] = (end - q * out[q - 1]) * inverse
    if known == top:
        return
    total = complex(1.0 / (top + 1), 0.0)
    term, k = total, 0
    while abs(term.real) + abs(term.imag) > 2e-17 * (abs(total.real) + abs(total.imag)):
        k += 1
        term *= -x / (top + 1 + k)
        total += term
    out[top] = end * total
    for q in range(top - 1, known, -1):
        out[q] = (end - x * out[q + 1]) / (q + 1)


@kernel
def fill_moments(x, out):
    """Moments (n, top + 1) of exponents (n,)."""
    for i in range(x.size):
        _moments(x[i], out.shape[1] - 1, out[i])
