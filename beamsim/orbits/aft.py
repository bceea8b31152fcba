r"""Harmonics of the forces of nonlinear springs and their derivatives: alternating frequency–time without aliasing.

A deflection is :math:`w(\tau) = \mathrm{Re} \sum_{h=0}^{H} W_h e^{ih\tau}`. A one-sided spring is closed where the
trigonometric polynomial :math:`\delta(\tau)` is positive. Its zeros are found in time, and between them the integrals

.. math:: \chi_k = \frac1{2\pi} \int_{\delta > 0} e^{-ik\tau} d\tau, \qquad
          [\delta_+]_h = \sum_l \chi_{h-l}\, [\delta]_l

(two-sided coefficients) are exact, and so is the derivative, the Toeplitz matrix of :math:`\chi`. Products of
polynomials (cubic springs) are exact on enough samples. So the balance is Galerkin's: its only error is the number of
harmonics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.typing import Complexes, Floats


def to_complex(x: Floats) -> Complexes:
    """(H + 1, …) harmonics from the real coefficients (2 H + 1, …) ordered 0, Re 1, Im 1, Re 2, …."""
    out = np.empty(((x.shape[0] + 1) // 2, *x.shape[1:]), dtype=complex)
    out[0] = x[0]
    out[1:] = x[1::2] + 1j * x[2::2]
    return out


def to_real(W: Complexes) -> Floats:
    """The reverse of :func:`to_complex` along the first axis (the imaginary part of harmonic 0 is dropped)."""
    out = np.empty((2 * W.shape[0] - 1, *W.shape[1:]))
    out[0] = W[0].real
    out[1::2], out[2::2] = W[1:].real, W[1:].imag
    return out


@dataclass(frozen=True)
class PositivePart:
    """The positive part of a trigonometric polynomial."""

    positive: Complexes  # (Hout + 1,) one-sided harmonics of delta_+
    chi: Complexes  # (Hout + H + 1,) two-sided coefficients 0, 1, … of the indicator of delta > 0
    closed_intervals: Floats  # (c, 2) intervals in which delta > 0, radians; the end may exceed 2 pi


def _value(D: Complexes, tau: Floats) -> tuple[Floats, Floats]:
    """A polynomial and its derivative at angles."""
    h = np.arange(D.size)
    e = D * np.exp(1j * np.multiply.outer(tau, h))
    return e.sum(axis=-1).real, (1j * h * e).sum(axis=-1).real


def _samples(D: Complexes, count: int) -> Floats:
    """Values at ``count`` equidistant angles."""
    two_sided = D * (0.5 * count)
    two_sided[0] = D[0] * count
    return np.asarray(np.fft.irfft(two_sided, count))


def _polish(D: Complexes, left: Floats, right: Floats, f_low: Floats, f_high: Floats) -> Floats:
    """Zeros of a polynomial in brackets, given its values there: Newton's method from the secant, kept inside by
    bisection."""
    left, right = left.copy(), right.copy()
    x = left + (right - left) * np.clip(f_low / (f_low - f_high), 0.01, 0.99)
    floor = 4e-16 * float(np.abs(D).sum())
    for _ in range(60):
        f, slope = _value(D, x)
        below = f * f_low > 0
        left, right = np.where(below, x, left), np.where(below, right, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = x - f / slope
        bad = ~((new > left) & (new < right))
        new = np.where(np.abs(f) <= floor, x, np.where(bad, 0.5 * (left + right), new))
        if np.all(np.abs(new - x) <= 1e-15 * (1.0 + np.abs(x))):
            return new
        x = new
    return x


def close_intervals(D: Complexes) -> Floats:
    """(c, 2) the intervals of angle in which ``Re sum D_h e^{ih tau}`` is positive.

    Samples bracket the zeros; between samples that come close to zero the extreme is looked up as well, so a contact
    shorter than a sample is seen.
    """
    count = max(128, 1 << int(np.ceil(np.log2(max(8 * D.size, 2)))))
    values = _samples(D, count)
    step = 2 * np.pi / count
    angle = np.arange(count) * step
    before, after = np.roll(values, 1), np.roll(values, -1)
    positive = values > 0
    # extremes towards zero that the samples show but do not cross
    near = (
        (positive == (before > 0)) & (positive == (after > 0)) & (np.abs(values) <= np.abs(before))
        & (np.abs(values) < np.abs(after)) & (np.abs(values) < np.abs(before - 2 * values + after))
    )  # fmt: skip
    points, heights = angle, values
    if np.any(near):
        a: Floats = np.asarray(angle[near] - step, dtype=float)
        slopes = _value(D, a)[1], _value(D, a + 2 * step)[1]
        turns = slopes[0] * slopes[1] < 0
        rate = 1j * np.arange(D.size) * D
        extreme = _polish(rate, a[turns], a[turns] + 2 * step, slopes[0][turns], slopes[1][turns])
        height = _value(D, extreme)[0]
        crossed = (height > 0) != positive[near][turns]
        if np.any(crossed):
            order = np.concatenate([angle, extreme[crossed] % (2 * np.pi)])
            sorting = np.argsort(order, kind="stable")
            points, heights = order[sorting], np.concatenate([values, height[crossed]])[sorting]
    signs = heights > 0
    change = np.flatnonzero(signs != np.roll(signs, -1))
    if change.size == 0:
        return np.array([[0.0, 2 * np.pi]]) if signs[0] else np.zeros((0, 2))
    ends = np.append(points[1:], points[0] + 2 * np.pi)
    after_change = np.roll(heights, -1)[change]
    zeros = _polish(D, np.asarray(points[change], dtype=float), ends[change], heights[change], after_change)
    opening = signs[change]  # positive before the zero
    if opening[0]:
        zeros = np.append(zeros[1:], zeros[0] + 2 * np.pi)
    return np.asarray(zeros.reshape(-1, 2))


def indicator(intervals: Floats, highest: int) -> Complexes:
    """(highest + 1,) two-sided Fourier coefficients of the indicator of some intervals of angle."""
    k = np.arange(1, highest + 1)
    out = np.zeros(highest + 1, dtype=complex)
    out[0] = float(np.sum(intervals[:, 1] - intervals[:, 0])) / (2 * np.pi)
    for a, b in intervals:
        # by sin(k (b - a) / 2) to keep short intervals precise
        out[1:] += np.sin(0.5 * k * (b - a)) * np.exp(-0.5j * k * (a + b)) / (np.pi * k)
    return out


def product(two_sided: Complexes, x: Complexes, highest: int) -> Complexes:
    """Harmonics 0 … highest of the product of a real function, given two-sidedly (0, 1, …), and one of harmonics x.

    Parameters
    ----------
    two_sided : (K,) coefficients 0, 1, … of the real function.
    x : (H + 1,) harmonics of the other one.
    highest : harmonic of the product.

    Returns
    -------
    (highest + 1,) complex amplitudes.
    """
    from scipy.fft import fft, ifft, next_fast_len  # importing scipy.signal takes most of a second

    a = np.concatenate([np.conj(two_sided[:0:-1]), two_sided])
    b = np.concatenate([0.5 * np.conj(x[:0:-1]), [x[0]], 0.5 * x[1:]])
    middle = two_sided.size - 1 + x.size - 1
    size = next_fast_len(a.size + b.size - 1)
    p = 2.0 * ifft(fft(a, size) * fft(b, size))[middle : middle + highest + 1]
    p[0] = 0.5 * p[0].real
    return np.asarray(p)


def one_sided(D: Complexes, highest: int | None = None) -> PositivePart:
    """The positive part of ``delta = Re sum D_h e^{ih tau}``.

    Parameters
    ----------
    D : (H + 1,) harmonics of the penetration (that of harmonic 0 real).
    highest : highest harmonic wanted of the positive part (default H).
    """
    H = D.size - 1
    highest = H if highest is None else highest
    closed = close_intervals(D)
    chi = indicator(closed, highest + H)
    return PositivePart(product(chi, D, highest), chi, closed)


def cubic(W: Complexes, highest: int | None = None) -> tuple[Complexes, Complexes]:
    """Harmonics of w³ and two-sided coefficients of its derivative 3 w², both exact.

    Parameters
    ----------
    W : (H + 1,) harmonics of w.
    highest : highest harmonic wanted of w³ (default H).
    """
    H = W.size - 1
    highest = H if highest is None else highest
    count = 1 << int(np.ceil(np.log2(max(3 * H + highest, 2 * highest + H, 4) + 4)))
    w = _samples(W, count)
    force = np.fft.rfft(w**3)[: highest + 1] * (2.0 / count)
    force[0] = 0.5 * force[0].real
    slope = np.zeros(highest + H + 1, dtype=complex)
    spectrum = np.fft.rfft(3.0 * w**2) / count
    used = min(slope.size, 2 * H + 1, spectrum.size)
    slope[:used] = spectrum[:used]
    return force, slope


def toeplitz(e: Complexes, rows: int, columns: int) -> Complexes:
    r"""(rows + 1, 2 columns + 1) harmonics of :math:`e(\tau) x(\tau)` by the real coefficients of x.

    ``e`` holds two-sided coefficients 0, 1, … (at least rows + columns of them) of a real function.

    Parameters
    ----------
    e : (at least rows + columns + 1,) two-sided coefficients.
    rows, columns : highest harmonics of the product and of x.

    Returns
    -------
    Complex harmonics of the product for each real coefficient of x, as of :func:`to_complex`.
    """
    h = np.arange(rows + 1)[:, None]
    col = np.arange(1, columns + 1)[None, :]
    difference = h - col
    below = np.where(difference >= 0, e[np.abs(difference)], np.conj(e[np.abs(difference)]))
    above = e[h + col]
    out = np.empty((rows + 1, 2 * columns + 1), dtype=complex)
    out[:, 0] = 2.0 * e[: rows + 1]
    out[:, 1::2] = below + above
    out[:, 2::2] = 1j * (below - above)
    out[0] = 0.5 * out[0].real
    return out
