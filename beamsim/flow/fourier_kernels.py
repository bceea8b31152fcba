r"""Fourier integrals of a logged motion, segment by segment.

On a segment every output is :math:`\mathrm{Re} \sum_b \gamma_b \tau^{p_b} e^{\lambda_b \tau}`, so its Fourier integral
is a sum of :math:`\int_0^T \tau^p e^{s \tau} d\tau` with :math:`s = \lambda_b \mp i \omega`, known in closed form.

Symbols are those of :mod:`beamsim.flow.kernels`.
"""

from __future__ import annotations

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.integral_kernels import moments
from beamsim.flow.kernels import _coefficients, _exp, _fill_sources


@kernel
def _exponential_integral(s, T, e):  # type: ignore[no-untyped-def]
    """``int_0^T e^{s tau} d tau`` with e = e^{sT}; a series where the difference would cancel."""
    x = s * T
    if abs(x.real) + abs(x.imag) > 0.5:
        return (e - 1.0) / s
    term = complex(T, 0.0)
    total = term
    for i in range(2, 20):
        term = term * x / i
        total += term
        if abs(term.real) + abs(term.imag) < 1e-17 * T:
            break
    return total


@kernel
def fourier_integrals(  # type: ignore[no-untyped-def]
    tables, inputs, table, seg_time, seg_length, seg_state, seg_piece, seg_y, omega, first, last, out
):
    """``out[j, w] += int x_j(t) e^{-i omega_w (t - t_0)} dt`` over segments, t_0 being the start of the first of all.

    ``table`` is (S, T, k), ``omega`` (W,) rad/s, ``out`` (k, W); the segments are those from ``first`` up to ``last``.
    """
    k, count = table.shape[2], omega.size
    zeta = np.zeros(inputs.exponent.size + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    gamma = np.zeros((tables.exponent.shape[1], k), dtype=np.complex128)
    shift = np.zeros(count, dtype=np.complex128)
    turn = np.zeros(count, dtype=np.complex128)
    most = 0
    for s in range(tables.power.shape[0]):
        for b in range(tables.power.shape[1]):
            most = max(most, tables.power[s, b])
    moment = np.zeros(1 + most, dtype=np.complex128)
    for g in range(first, last):
        s, T = seg_state[g], seg_length[g]
        _fill_sources(tables, s, inputs, seg_piece[g], seg_time[g], seg_y[g], rest, zeta)
        _coefficients(tables, s, table, zeta, k, gamma)
        for w in range(count):
            shift[w] = _exp(0.0, -omega[w], seg_time[g] - seg_time[0])
            turn[w] = _exp(0.0, -omega[w], T)
        for b in range(tables.n_basis[s]):
            largest = 0.0
            for j in range(k):
                largest = max(largest, abs(gamma[b, j]))
            if largest == 0.0:
                continue
            lam, p = tables.exponent[s, b], tables.power[s, b]
            grown = _exp(lam.real, lam.imag, T)
            for w in range(count):
                below, above = lam - 1j * omega[w], lam + 1j * omega[w]
                if p == 0:
                    first = _exponential_integral(below, T, grown * turn[w])
                    second = _exponential_integral(above, T, grown * np.conj(turn[w]))
                else:
                    scale = T ** (p + 1)
                    moments(below * T, grown * turn[w], p, moment)
                    first = scale * moment[p]
                    moments(above * T, grown * np.conj(turn[w]), p, moment)
                    second = scale * moment[p]
                for j in range(k):
                    c = gamma[b, j]
                    out[j, w] += 0.5 * (c * first + np.conj(c * second)) * shift[w]
