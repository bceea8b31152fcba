"""Compiled integrals of products of outputs: energies, mean squares.

On a segment every output is a sum of groups, an exponential times a polynomial in time, so that the integral of a
product is a sum over pairs of groups of moments ``int s^q e^{x s} ds``. Its cost does not depend on how fast the motion
is. Between output times that are close together, Gauss-Legendre panels are cheaper where the polynomials are long
(sampled inputs); their length is that of the fastest motion that has not decayed there.
"""

from __future__ import annotations

import math

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.kernels import _exp, _fill_basis, _fill_sources, _outputs, _parts, _rows

DEAD = 45.0  # decay, in powers of e, after which an exponential no longer counts
SMALL = 2.0  # sum of the parts of an exponent, below which its moments are a power series
UPWARD = 8  # powers up to which the recursion from below is stable for other exponents
INVERSE = 1.0 / np.maximum(np.arange(512.0), 1.0)  # of integers beyond any degree here and 60 more
LONG_TURN = 60.0  # rad of the fastest motion that has not decayed: from here on the closed form is cheaper than panels


@kernel
def moments(x, ex, top, out):  # type: ignore[no-untyped-def]
    """``int_0^1 s^q e^{x s} ds`` for q = 0 ... top, with ex = e^x; the direction of recursion that is stable."""
    xr, xi = x.real, x.imag  # parts: dividing a complex number by a real one would cost as much as by a complex one
    if abs(xr) + abs(xi) < SMALL:
        tr, ti = 1.0, 0.0
        total, beside = INVERSE[top + 1], 0.0
        for i in range(1, 60):
            factor = INVERSE[i]
            tr, ti = (tr * xr - ti * xi) * factor, (tr * xi + ti * xr) * factor
            factor = INVERSE[top + 1 + i]
            total += tr * factor
            beside += ti * factor
            if abs(tr) + abs(ti) < 1e-18:
                break
        out[top] = complex(total, beside)
        for q in range(top, 0, -1):
            rest = ex - x * out[q]
            factor = INVERSE[q]
            out[q - 1] = complex(rest.real * factor, rest.imag * factor)
        return
    inverse = 1.0 / x
    out[0] = (ex - 1.0) * inverse
    length = 0 if top <= UPWARD else int(math.sqrt(xr * xr + xi * xi))
    upward = top if top <= UPWARD else min(top, length)
    for q in range(1, upward + 1):
        out[q] = complex(ex.real - q * out[q - 1].real, ex.imag - q * out[q - 1].imag) * inverse
    if upward < top:
        # e^x sum_k (-x)^k q! / (q + 1 + k)!, from an index where it converges quickly
        q = max(top, length + 10)
        term = ex / (q + 1)
        sum_of_terms = term
        for i in range(1, 400):
            factor = -1.0 / (q + 1 + i)
            term = term * x
            term = complex(term.real * factor, term.imag * factor)
            sum_of_terms += term
            here = abs(sum_of_terms.real) + abs(sum_of_terms.imag)
            if abs(term.real) + abs(term.imag) < 1e-18 * here:
                break
        while q > upward:
            if q <= top:
                out[q] = sum_of_terms
            rest = ex - x * sum_of_terms
            factor = 1.0 / q
            sum_of_terms = complex(rest.real * factor, rest.imag * factor)
            q -= 1


@kernel
def _integral(lam, tau, e):  # type: ignore[no-untyped-def]
    """int_0^tau exp(lam s) ds with e = exp(lam tau)."""
    x = lam * tau
    if abs(x.real) + abs(x.imag) < 1e-3:
        return tau * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x / 120.0))))
    return (e - 1.0) / lam


@kernel
def _fill_pairs(rows, group, degree, groups, power, nb, weight, plus, minus):  # type: ignore[no-untyped-def]
    """Coefficients (Q, G, G, R) of ``tau^r e^{(a + b) tau}``, and with b conjugate, in the integrands; a <= b.

    ``rows`` (2, nb, 2 K) are real and imaginary parts of the factors' coefficients, left factors first.
    """
    Q = weight.shape[1]
    K = weight.shape[0]
    for q in range(Q):
        for g in range(groups):
            for h in range(g, groups):
                for r in range(degree[g] + degree[h] + 1):
                    plus[q, g, h, r] = 0.0
                    minus[q, g, h, r] = 0.0
    for b in range(nb):
        for d in range(nb):
            g, h, r = group[b], group[d], power[b] + power[d]
            for k in range(K):
                x = complex(rows[0, b, k], rows[1, b, k])
                if x == 0.0:
                    continue
                y = complex(rows[0, d, K + k], rows[1, d, K + k])
                if y == 0.0:
                    continue
                up, across = 0.5 * x * y, 0.5 * x * y.conjugate()
                for q in range(Q):
                    w = weight[k, q]
                    if w == 0.0:
                        continue
                    if g <= h:
                        plus[q, g, h, r] += w * up
                        minus[q, g, h, r] += w * across
                    else:  # the real part of a product is that of its conjugate
                        plus[q, h, g, r] += w * up
                        minus[q, h, g, r] += w * across.conjugate()


@kernel
def _closed_form(exponent, degree, groups, plus, minus, tau, e, moment, out):  # type: ignore[no-untyped-def]
    """Integrals (Q,) from 0 to tau of what `_fill_pairs` wrote."""
    Q = out.size
    for q in range(Q):
        out[q] = 0.0
    for g in range(groups):
        e[g] = _exp(exponent[g].real, exponent[g].imag, tau)
    for g in range(groups):
        for h in range(g, groups):
            top = degree[g] + degree[h]
            for conjugate in range(2):
                other, eh = exponent[h], e[h]
                if conjugate == 1:
                    other, eh = other.conjugate(), eh.conjugate()
                lam = exponent[g] + other
                if top == 0:
                    moment[0] = _integral(lam, tau, e[g] * eh)
                else:
                    moments(lam * tau, e[g] * eh, top, moment)
                    factor = tau
                    for r in range(top + 1):
                        moment[r] *= factor
                        factor *= tau
                for q in range(Q):
                    total = 0.0j
                    for r in range(top + 1):
                        c = minus[q, g, h, r] if conjugate == 1 else plus[q, g, h, r]
                        total += c * moment[r]
                    out[q] += total.real


@kernel
def _fastest_alive(exponent, power, nb, tau):  # type: ignore[no-untyped-def]
    """Largest magnitude of an exponent whose basis function has not decayed at tau."""
    fastest = 0.0
    for b in range(nb):
        lam = exponent[b]
        size = lam.real * lam.real + lam.imag * lam.imag
        if size > fastest and -lam.real * tau < DEAD + 8.0 * power[b]:
            fastest = size
    return math.sqrt(fastest)


@kernel
def product_integrals(  # type: ignore[no-untyped-def]
    tables, inputs, table, weight, seg_time, seg_length, seg_state, seg_piece, seg_y, time, group, degree,
    radians, node, gauss, at, total, lost, out, most_work,
):  # fmt: skip
    """Cumulative integrals of sums of products: out[i, q] = int_0^time[i] sum_k weight[k, q] left_k right_k dt.

    ``table`` (S, T, 2 K) holds the left factors, then the right ones; ``weight`` is (K, Q); ``time`` increases.
    ``group`` (S, B) numbers the basis functions of equal exponents and ``degree`` (S, G) is the largest power in each.
    Rule r, ``node[r]`` and ``gauss[r]`` on [-1, 1] up to the first zero weight, is for panels up to ``radians[r]``.

    Returns whether it is done. If not, ``most_work`` was used: called again it goes on from ``at`` (segment, output,
    time within the segment) with the sums ``total`` and their round-off ``lost``.
    """
    K2 = table.shape[2]
    K = K2 // 2
    Q = weight.shape[1]
    B, G = tables.exponent.shape[1], degree.shape[1]
    R = 1
    for s in range(degree.shape[0]):
        for b in range(G):
            R = max(R, 2 * degree[s, b] + 1)
    zeta = np.zeros(inputs.exponent.size + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    rows = np.zeros((2, B, K2))
    real, imag = _parts(table)
    basis, e = np.zeros(B, dtype=np.complex128), np.zeros(G, dtype=np.complex128)
    exponents = np.zeros(G, dtype=np.complex128)
    plus = np.zeros((Q, G, G, R), dtype=np.complex128)
    minus = np.zeros((Q, G, G, R), dtype=np.complex128)
    moment = np.zeros(R + 1, dtype=np.complex128)
    x = np.zeros(K2)
    part, here, before = np.zeros(Q), np.zeros(Q), np.zeros(Q)
    work = 0
    i = int(at[1])
    last = seg_time.size - 1
    for g in range(int(at[0]), seg_time.size):
        s = seg_state[g]
        nb = tables.n_basis[s]
        exponent, power = tables.exponent[s], tables.power[s]
        done = at[2]
        at[0], at[2] = g, 0.0
        _fill_sources(tables, s, inputs, seg_piece[g], seg_time[g], seg_y[g], rest, zeta)
        _rows(tables, s, real, imag, zeta, rows[0], rows[1])
        groups = int(nb > 0)
        longest = 0
        for b in range(nb):
            exponents[group[s, b]] = exponent[b]
            groups = max(groups, group[s, b] + 1)
            longest = max(longest, power[b])
        paired = False  # whether the pairs' coefficients are there
        known = done == 0.0  # whether ``before`` is the closed form at ``done``
        for q in range(Q):
            before[q] = 0.0
        while True:
            reached = i >= time.size or time[i] - seg_time[g] > seg_length[g]
            reached = reached or (g < last and time[i] >= seg_time[g + 1])
            tau = seg_length[g] if reached else time[i] - seg_time[g]
            if work > most_work:
                at[1], at[2] = i, done
                return False
            if longest == 0 or (tau - done) * _fastest_alive(exponent, power, nb, tau) > LONG_TURN:
                if not paired:
                    _fill_pairs(rows, group[s], degree[s], groups, power, nb, weight, plus, minus)
                    work += nb * nb * K
                    paired = True
                if not known:
                    _closed_form(exponents, degree[s], groups, plus, minus, done, e, moment, before)
                _closed_form(exponents, degree[s], groups, plus, minus, tau, e, moment, here)
                work += 20 * groups * groups
                for q in range(Q):
                    part[q] = here[q] - before[q]
                    before[q] = here[q]
                known = True
            elif tau > done:
                known = False
                for q in range(Q):
                    part[q] = 0.0
                now = done
                while now < tau:
                    turn = (tau - now) * _fastest_alive(exponent, power, nb, now)
                    rule = 0
                    while rule < radians.size - 1 and turn > radians[rule]:
                        rule += 1
                    width = (tau - now) / math.ceil(turn / radians[rule]) if turn > radians[rule] else tau - now
                    if now + width <= now:
                        break
                    for r in range(node.shape[1]):
                        factor = 0.5 * gauss[rule, r] * width
                        if factor == 0.0:
                            break
                        _fill_basis(exponent, power, nb, now + 0.5 * width * (1.0 + node[rule, r]), basis)
                        _outputs(rows[0], rows[1], basis, nb, x)
                        for j in range(K):
                            product = x[j] * x[K + j] * factor
                            for q in range(Q):
                                part[q] += weight[j, q] * product
                    work += node.shape[1] * nb * K
                    now = now + width if turn > radians[rule] else tau
            else:
                for q in range(Q):
                    part[q] = 0.0
            for q in range(Q):
                # the sum of very many small parts, compensated (W. Kahan, Comm. ACM 8, 1965)
                more = part[q] - lost[q]
                grown = total[q] + more
                lost[q] = (grown - total[q]) - more
                total[q] = grown
            done = tau
            if reached:
                break
            for q in range(Q):
                out[i, q] = total[q]
            i += 1
    while i < time.size:
        for q in range(Q):
            out[i, q] = total[q]
        i += 1
    return True


@kernel
def form_integrals(  # type: ignore[no-untyped-def]
    tables, inputs, plus, minus, seg_time, seg_length, seg_state, seg_piece, seg_y, out
):
    """Integrals (G, Q) over each segment of quadratic forms of the motion, where no term has a power of time.

    In state s the integrand is ``Re sum plus[s, q, i, j] u_i u_j + minus[s, q, i, j] u_i conj(u_j)`` over pairs
    i <= j of terms, ``u_i`` being a term's amplitude times its exponential.
    """
    Q = plus.shape[1]
    T = plus.shape[2]
    zeta = np.zeros(inputs.exponent.size + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    lam, e = np.zeros(T, dtype=np.complex128), np.zeros(T, dtype=np.complex128)
    for g in range(seg_time.size):
        s = seg_state[g]
        tau = seg_length[g]
        _fill_sources(tables, s, inputs, seg_piece[g], seg_time[g], seg_y[g], rest, zeta)
        count = tables.n_terms[s]
        for i in range(count):
            lam[i] = tables.exponent[s, tables.term_basis[s, i]]
            e[i] = _exp(lam[i].real, lam[i].imag, tau)
        for q in range(Q):
            out[g, q] = 0.0
        for i in range(count):
            a = zeta[tables.term_source[s, i]]
            if a == 0.0:
                continue
            for j in range(i, count):
                b = zeta[tables.term_source[s, j]]
                if b == 0.0:
                    continue
                with_itself = a * b * _integral(lam[i] + lam[j], tau, e[i] * e[j])
                crossed = a * b.conjugate() * _integral(lam[i] + lam[j].conjugate(), tau, e[i] * e[j].conjugate())
                for q in range(Q):
                    out[g, q] += (plus[s, q, i, j] * with_itself + minus[s, q, i, j] * crossed).real
