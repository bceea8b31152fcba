"""Compiled update of a symmetric damped structure's modes by one spring and dashpot.

With the modes of :math:`Q(\\lambda) = \\lambda^2 + C\\lambda + K`, scaled such that
:math:`Q^{-1} = \\sum_j u_j u_j^T / (\\lambda - \\mu_j)` over all 2n eigenvalues, those of
:math:`Q + z \\phi\\phi^T`, :math:`z = k + c\\lambda`, are the zeros of the secular function

.. math:: f(\\lambda) = 1 + z(\\lambda) \\sum_j \\frac{p_j^2}{\\lambda - \\mu_j}, \\qquad p_j = \\phi^T u_j,
          \\qquad u' = \\sum_j \\frac{p_j u_j}{\\lambda - \\mu_j} \\Big/ \\sqrt{\\sum_j
          \\frac{p_j^2}{(\\lambda - \\mu_j)^2} + \\frac{c}{z^2}} .

All zeros are searched for at once (O. Aberth, Math. Comp. 27, 1973). A zero is held as the distance from its nearest
pole, and the vectors take the p of which the zeros found are exact (M. Gu and S. C. Eisenstat, SIAM J. Matrix Anal.
Appl. 15, 1994): so they stay orthogonal where zeros crowd or hardly move.
"""

from __future__ import annotations

import numpy as np

from beamsim.flow.compiled import kernel, summing

MOST_ITERATIONS = 60
COINCIDENT = 1e-10  # relative distance below which two poles count as one
CONVERGED = 4e-16  # of a zero's distance from its pole
SETTLED = 1e-12  # of the same: below it a step that no longer shrinks is round-off


@summing
def _sums(pole_re, pole_im, res_re, res_turned, zero_re, zero_im, near, x, y, this, out):  # type: ignore[no-untyped-def]
    """Into ``out``: sums over all poles of residue / (lambda - mu), its derivative, and of 1 / (lambda - mu), less that
    of 1 / (lambda - zero) over all zeros but ``this``; lambda lies (x, y) from pole ``near``.

    Conjugate poles are added as 2 (lambda Re r - Re(r conj(mu))) / (lambda - mu) / (lambda - conj(mu)); the parts of
    the residues r are ``res_re`` and ``res_turned``.
    """
    s_re = s_im = d_re = d_im = n_re = n_im = 0.0
    a, b = pole_re[near], pole_im[near]
    for j in range(pole_re.size):
        dx = (a - pole_re[j]) + x
        dy = (b - pole_im[j]) + y
        other = (b + pole_im[j]) + y
        re, im = dx * dx - dy * other, dx * (dy + other)
        q = 2.0 / (re * re + im * im)
        gx, gy = re * q, -im * q
        top_re, top_im = (a + x) * res_re[j] - res_turned[j], (b + y) * res_re[j]
        tx, ty = top_re * gx - top_im * gy, top_re * gy + top_im * gx
        s_re += tx
        s_im += ty
        mx, my = dx * gx - (b + y) * gy, dx * gy + (b + y) * gx
        n_re += mx
        n_im += my
        d_re += res_re[j] * gx - (tx * mx - ty * my)
        d_im += res_re[j] * gy - (tx * my + ty * mx)
    c, d = a + x, b + y
    for j in range(zero_re.size):
        dx = c - zero_re[j]
        dy = d - zero_im[j]
        q = dx * dx + dy * dy
        q = 0.0 if j == this or q == 0.0 else 1.0 / q
        n_re -= dx * q
        n_im += dy * q
        dy = d + zero_im[j]
        q = 1.0 / (dx * dx + dy * dy)
        n_re -= dx * q
        n_im += dy * q
    out[0], out[1], out[2] = complex(s_re, s_im), complex(d_re, d_im), complex(n_re, n_im)


@kernel
def _find_zeros(pole, residue, k, c, near, offset):  # type: ignore[no-untyped-def]
    """Zeros of the secular function in the upper half-plane, as offsets from poles; whether all were found.

    The poles (n,) are sorted by their imaginary parts.
    """
    n = pole.size
    pole_re, pole_im = pole.real.copy(), pole.imag.copy()
    res_re, res_turned = residue.real.copy(), (residue * pole.conj()).real.copy()
    zero_re, zero_im, last = np.empty(n), np.empty(n), np.full(n, np.inf)
    done = np.zeros(n, dtype=np.bool_)
    out = np.empty(3, dtype=np.complex128)
    for i in range(n - 1):
        if abs(pole[i + 1] - pole[i]) < COINCIDENT * abs(pole[i]):
            return False
    for i in range(n):
        step = -(k + c * pole[i]) * residue[i]
        if step.imag > 0.0:
            space = pole_im[i + 1] - pole_im[i] if i + 1 < n else np.inf
        else:
            space = pole_im[i] - pole_im[i - 1] if i > 0 else pole_im[i]
        size = abs(step)
        if size > 0.4 * space:
            step *= 0.4 * space / size
        near[i] = i
        offset[i] = step
        done[i] = step == 0.0
        zero_re[i], zero_im[i] = pole_re[i] + step.real, pole_im[i] + step.imag
    for _ in range(MOST_ITERATIONS):
        busy = False
        for i in range(n):
            if done[i]:
                continue
            x = offset[i]
            _sums(pole_re, pole_im, res_re, res_turned, zero_re, zero_im, near[i], x.real, x.imag, i, out)
            z = k + c * (pole[near[i]] + x)
            value = 1.0 + z * out[0]
            slope = c * out[0] + z * out[1] + value * out[2]
            if slope == 0.0:
                return False
            step = -value / slope
            size = abs(step)
            if not size < np.inf:
                return False
            x += step
            zero = pole[near[i]] + x
            if zero.imag < 0.0:  # its conjugate is the one that is still missing
                zero = zero.conjugate()
                x, size = zero - pole[near[i]], np.inf
            best = near[i]  # the nearest pole, from which the distance is known best
            for j in (best - 1, best + 1):
                if 0 <= j < n and abs((pole[near[i]] - pole[j]) + x) < abs((pole[near[i]] - pole[best]) + x):
                    best = j
            offset[i] = (pole[near[i]] - pole[best]) + x
            near[i] = best
            zero_re[i], zero_im[i] = zero.real, zero.imag
            scale = abs(offset[i])
            done[i] = size <= CONVERGED * scale or (size <= SETTLED * scale and size >= 0.5 * last[i])
            last[i] = size
            busy = True
        if not busy:
            break
    return bool(np.all(done) and np.all(zero_im > 0.0))


@kernel
def update(pole, participation, k, c, zero, weight):  # type: ignore[no-untyped-def]
    """Modes after a spring and a dashpot were added along one direction.

    The real and then the imaginary parts (2n, n) of the new vectors, one a row, are ``weight @ [Re(p u);
    Re(p conj(mu) u)]``, which adds conjugate poles without cancellation; a vector whose p is zero stays as it is.

    Parameters
    ----------
    pole : (n,) eigenvalues in the upper half-plane, sorted by their imaginary parts.
    participation : (n,) p of their modes, replaced by the one of which the new eigenvalues are exact.
    k, c : stiffness and dashpot.
    zero : (n,) receives the new eigenvalues.
    weight : (2n, 2n) receives the factors above.

    Returns
    -------
    found : whether all modes were found.
    """
    n = pole.size
    near, offset = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.complex128)
    if not _find_zeros(pole, participation * participation, k, c, near, offset):
        return False
    p = participation
    for j in range(n):
        zero[j] = pole[near[j]] + offset[j]
        if p[j] == 0.0:
            continue
        square = 1.0 / (k + c * pole[j])
        for i in range(n):
            to = (pole[j] - pole[near[i]]) - offset[i]
            other = (pole[j] - pole[near[i]].conjugate()) - offset[i].conjugate()
            square *= to * other / (pole[j] - pole[i].conjugate())
            if i != j:
                square /= pole[j] - pole[i]
        root = np.sqrt(square)
        p[j] = root if root.real * p[j].real + root.imag * p[j].imag >= 0.0 else -root
    for i in range(n):
        z = k + c * zero[i]
        total = c / (z * z)
        for j in range(n):
            if p[j] == 0.0:
                weight[i, j], weight[i, n + j], weight[n + i, j], weight[n + i, n + j] = 0.0, 0.0, 0.0, 0.0
                continue
            g = 1.0 / ((pole[near[i]] - pole[j]) + offset[i])
            h = 1.0 / ((pole[near[i]] - pole[j].conjugate()) + offset[i])
            total += (p[j] * g) ** 2 + (p[j].conjugate() * h) ** 2
            g *= 2.0 * h
            h = g * zero[i]
            weight[i, j], weight[n + i, j] = h.real, h.imag
            weight[i, n + j], weight[n + i, n + j] = -g.real, -g.imag
        scale = 1.0 / np.sqrt(total)
        for j in range(2 * n):
            re, im = weight[i, j], weight[n + i, j]
            weight[i, j], weight[n + i, j] = re * scale.real - im * scale.imag, re * scale.imag + im * scale.real
    return True
