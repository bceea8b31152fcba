"""Compiled search for the extremes of outputs over a periodic motion whose segments are sums of exponentials."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.kernels import _coefficients, _exp, _fill_sources
from beamsim.flow.peak_kernels import make_peaks, search_peaks, size


class ExponentialGroups(NamedTuple):
    """Outputs on a segment as `beamsim.flow.peak_kernels.search_peaks` takes them: K of them, B exponentials."""

    poly: Any  # (K, 1, B) coefficients
    degree: Any  # (B,) zero
    exponent: Any  # (B,) times the segment's length
    end: Any  # (B,) exp of it
    live: Any  # (B,)
    length: Any  # (K, B, 5) size of the coefficients, and zeros
    peaks: Any  # see `beamsim.flow.peak_kernels.Peaks`


@kernel
def _fill(work, tables, s, gamma, T):  # type: ignore[no-untyped-def]
    """The segment of length T in state s whose outputs have the coefficients gamma (B, K)."""
    for b in range(tables.n_basis[s]):
        lam = tables.exponent[s, b]
        work.exponent[b] = lam * T
        work.end[b] = _exp(lam.real, lam.imag, T)
        largest = 0.0
        for j in range(gamma.shape[1]):
            work.poly[j, 0, b] = gamma[b, j]
            work.length[j, b, 0] = size(gamma[b, j])
            largest = max(largest, work.length[j, b, 0])
        work.live[b] = largest > 0.0


@kernel
def periodic_extremes(tables, inputs, table, seg_time, seg_length, seg_state, seg_y, high, low):  # type: ignore[no-untyped-def]
    """Raise ``high`` and lower ``low`` (K,) to the extremes of outputs over segments, their ends included.

    ``table`` (S, T, K) are their coefficients by term; no term has a power of time. A segment's sources are those of
    the first piece of the inputs.
    """
    B, K = tables.exponent.shape[1], table.shape[2]
    zeta = np.zeros(inputs.exponent.size + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    gamma = np.zeros((B, K), dtype=np.complex128)
    scale = np.zeros(K)
    work = ExponentialGroups(
        np.zeros((K, 1, B), dtype=np.complex128),
        np.zeros(B, dtype=np.int64),
        np.zeros(B, dtype=np.complex128),
        np.zeros(B, dtype=np.complex128),
        np.zeros(B, dtype=np.bool_),
        np.zeros((K, B, 5)),
        make_peaks(B, 1, K),
    )
    for g in range(seg_time.size):
        s = seg_state[g]
        _fill_sources(tables, s, inputs, 0, seg_time[g], seg_y[g], rest, zeta)
        _coefficients(tables, s, table, zeta, K, gamma)
        _fill(work, tables, s, gamma, seg_length[g])
        search_peaks(work, tables.n_basis[s], K, scale, high, low)
