r"""Fourier integrals of a logged motion, segment by segment, and the bound on what its samples fold.

On a segment every output is :math:`\mathrm{Re} \sum_b \gamma_b \tau^{p_b} e^{\lambda_b \tau}`, so its Fourier integral
is a sum of :math:`\int_0^T \tau^p e^{s \tau} d\tau` with :math:`s = \lambda_b \mp i \omega`, known in closed form.

Symbols are those of :mod:`beamsim.flow.kernels`.
"""

from __future__ import annotations

import math

import numpy as np

from beamsim.flow.compiled import inner, kernel
from beamsim.flow.integral_kernels import moments
from beamsim.flow.kernels import _coefficients, _exp, _fill_sources

ORDERS = 8  # of the terms of the Euler-Maclaurin series in which jumps are evaluated
# Largest |B_k(theta)| / k! of the Bernoulli polynomials on [0, 1]: 1/2, 1/12, then at most 2.05 / (2 pi)^k
BERNOULLI = (0.5, 1.0 / 12.0, *(2.05 / (2.0 * math.pi) ** k for k in range(3, ORDERS + 1)))
CONVERGENT = 0.9  # |s| step / 2 pi below which the series is used


@inner
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


@inner
def _jets(exponent, power, nb, gamma, tau, step, reach, out):  # type: ignore[no-untyped-def]
    """Derivatives of order 0 to ORDERS - 1 at tau, into ``out``; returns the bound on the terms beyond them.

    Exponentials too fast for the series are left out of the derivatives and bounded by their size.
    """
    for i in range(ORDERS):
        out[i] = 0.0
    beyond = 0.0
    for b in range(nb):
        if gamma[b] == 0.0:
            continue
        lam, p = exponent[b], power[b]
        e = gamma[b] * _exp(lam.real, lam.imag, tau)
        size = abs(e) * (tau**p if p > 0 else 1.0)
        ratio = (abs(lam) + reach) * step / (2.0 * math.pi)
        if ratio >= CONVERGENT:
            beyond += 1.2 * size
            continue
        beyond += size * ratio**ORDERS / (1.0 - ratio) / 3.0
        # Leibniz: the derivative of an order has binomial(order, i) (tau^p)^(i) lam^(order - i) e^(lam tau)
        for i in range(min(p, ORDERS - 1) + 1):
            factor = 1.0  # p! / (p - i)! tau^(p - i): of the i-th derivative of tau^p
            for q in range(i):
                factor *= p - q
            factor *= tau ** (p - i) if p > i else 1.0
            if factor == 0.0:
                continue
            grown = factor * e
            binomial = 1.0
            for order in range(i, ORDERS):
                out[order] += binomial * grown.real
                grown *= lam
                binomial = binomial * (order + 1) / (order + 1 - i)
    return beyond


@kernel
def folded(  # type: ignore[no-untyped-def]
    tables,
    inputs,
    table,
    dropped,
    seg_time,
    seg_length,
    seg_state,
    seg_piece,
    seg_y,
    step,
    reach,
    open_ends,
    first,
    until,
    before,
    beyond,
    out,
):
    r"""Bound, per output, on the difference between samples' Fourier sum and the integral, at \|omega\| <= ``reach``.

    The sum over the samples of an exponential that begins or ends at a time theta steps from a sample differs from
    its integral by ``-step sum_k B_k(theta) / k! (s step)^(k - 1)`` (Euler-Maclaurin). Over an event only the jumps
    of the output and its derivatives remain: those of the first orders are evaluated, the rest bounded by the sizes of
    the exponentials (none where the contacts stay as they are).

    Parameters
    ----------
    table : (S, T, k) of the outputs as they are sampled; ``dropped`` that of the terms left out of the samples, whose
        own integrals are bounded.
    step : s, between samples. reach : rad/s.
    open_ends : whether the ends of the first and of the last segment count, where the window is not zero.
    first, until : the ends of segments that are looked at, of 0 up to the number of segments: one call goes on where
        the one before it ended.
    before, beyond : (k, ORDERS) and (k,) of the segment before, zero at first; replaced.
    out : (k,) added to; unit of the output times s.
    """
    k = table.shape[2]
    B = tables.exponent.shape[1]
    zeta = np.zeros(inputs.exponent.size + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    gamma = np.zeros((B, k), dtype=np.complex128)
    missing = np.zeros((B, k), dtype=np.complex128)
    after = np.zeros((k, ORDERS))
    last = seg_time.size - 1
    s = seg_state[last]
    for g in range(first, until):
        if g <= last:
            s, T = seg_state[g], seg_length[g]
            nb = tables.n_basis[s]
            _fill_sources(tables, s, inputs, seg_piece[g], seg_time[g], seg_y[g], rest, zeta)
            _coefficients(tables, s, table, zeta, k, gamma)
            _coefficients(tables, s, dropped, zeta, k, missing)
        exponent, power = tables.exponent[s], tables.power[s]
        inside = 0 < g <= last
        smooth = inside and seg_state[g] == seg_state[g - 1]
        for j in range(k):
            more = 0.0
            if g <= last:
                more = _jets(exponent, power, nb, gamma[:, j], 0.0, step, reach, after[j])
                for b in range(nb):
                    if missing[b, j] != 0.0:
                        size = abs(missing[b, j]) * (1.0 + abs(_exp(exponent[b].real, 0.0, T)))
                        out[j] += size / (abs(exponent[b]) - reach)
            else:
                after[j] = 0.0
            if inside or open_ends:
                scale = step
                for order in range(ORDERS):
                    # of (d/dt - i omega)^order
                    jump = 0.0
                    factor = 1.0
                    for i in range(order + 1):
                        jump += factor * abs(after[j, order - i] - before[j, order - i])
                        factor = factor * reach * (order - i) / (i + 1)
                    if order > 0 or inside:  # at open ends the samples are halved
                        out[j] += BERNOULLI[order] * scale * jump
                    scale *= step
                if not smooth:
                    out[j] += step * (beyond[j] + more)
            if g <= last:
                beyond[j] = _jets(exponent, power, nb, gamma[:, j], T, step, reach, before[j])
