"""Compiled kernels of the exact flow: the motion on a segment.

The march that joins the segments is in :mod:`beamsim.flow.march_kernels`.

Arrays in, arrays out; nothing is allocated per segment. Symbols: ``tau`` is the time since the start of a
segment, ``gamma[b]`` a complex coefficient of the basis function :math:`\\tau^{p_b} e^{\\lambda_b \\tau}`, so
that a watched quantity is :math:`g(\\tau) = \\mathrm{Re} \\sum_b \\gamma_b \\tau^{p_b} e^{\\lambda_b\\tau}`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from beamsim.flow.compiled import kernel, summing

EPS = 2.220446049250313e-16


class Tables(NamedTuple):
    """Padded tables of S contact states (see :mod:`beamsim.flow.contact_state`)."""

    n_basis: Any  # (S,)
    exponent: Any  # (S, B)
    power: Any  # (S, B)
    n_free: Any  # (S,)
    projector: Any  # (S, Z, N)
    n_terms: Any  # (S,)
    term_basis: Any  # (S, T)
    term_source: Any  # (S, T)
    term_vector: Any  # (S, T, N)
    watch: Any  # (S, T, w) of the state's guards, then of the internal states after the events that reset them
    roughness: Any  # (S, T, g) size of each term's parts before they cancel, which sets the round-off of the guards
    horizon: Any  # (S,)
    phase: Any  # (S, m) of the contacts
    n_guards: Any  # (S,)
    guard_contact: Any  # (S, g) contact of each guard
    reset: Any  # (S, g) column of `watch` with the contact's internal states after the event, -1 where they go on
    follower: Any  # (S, g) state after a guard's event, -1 where it is not built yet
    first: Any  # (m,) of a contact's internal states in the state vector
    states: Any  # (m,) number of a contact's internal states


class Inputs(NamedTuple):
    """Sources on pieces (see :mod:`beamsim.flow.sources`)."""

    start: Any  # (P,)
    amplitude: Any  # (P, F)
    exponent: Any  # (F,)
    power: Any  # (F,)
    group_last: Any  # (F,)


@kernel
def _exp(re: float, im: float, tau: float) -> complex:
    """e^{lambda tau}.

    Parameters
    ----------
    re, im : parts of lambda, 1/s.
    tau : s.

    Returns
    -------
    complex
    """
    size = 1.0 if re == 0.0 else math.exp(re * tau)
    if im == 0.0:
        return complex(size, 0.0)
    angle = im * tau
    return complex(size * math.cos(angle), size * math.sin(angle))


@kernel
def _fill_sources(tables, s, inputs, piece, t, y, rest, zeta):
    """Amplitudes of all sources at the start (time t, state y) of a segment in state s; ``rest`` (N,) is for work.

    Parameters
    ----------
    tables, inputs : Tables of the contact states, Inputs.
    s : number of the state.
    piece : of the inputs.
    t : s.
    y : (N,) state.
    rest : (N,) room for work.
    zeta : (F + Z,) of the inputs, then of the free motions; written.
    """
    F = inputs.exponent.size
    shift = t - inputs.start[piece]
    for f in range(F):
        total = inputs.amplitude[piece, f]
        factor = 1.0
        for q in range(f + 1, inputs.group_last[f] + 1):
            step = q - f
            factor = factor * shift * (inputs.power[f] + step) / step
            total += factor * inputs.amplitude[piece, q]
        nu = inputs.exponent[f]
        if shift != 0.0 and nu != 0.0:
            total *= _exp(nu.real, nu.imag, shift)
        zeta[f] = total
    for k in range(y.size):
        rest[k] = y[k]
    for q in range(tables.n_terms[s]):
        source = tables.term_source[s, q]
        if source < F and tables.power[s, tables.term_basis[s, q]] == 0:
            z = zeta[source]
            for k in range(y.size):
                v = tables.term_vector[s, q, k]
                rest[k] -= v.real * z.real - v.imag * z.imag
    _project(tables.projector[s], tables.n_free[s], rest, zeta[F:])


@summing
def _project(projector, count, y, amplitude):
    """Amplitudes of ``count`` free motions in a state y; sums in an order that suits the processor.

    Parameters
    ----------
    projector : (Z, N).
    count : of free motions.
    y : (N,) state.
    amplitude : (Z,) the first ``count`` are written.
    """
    for i in range(count):
        real = 0.0
        imag = 0.0
        for k in range(y.size):
            real += projector[i, k].real * y[k]
            imag += projector[i, k].imag * y[k]
        amplitude[i] = complex(real, imag)


@kernel
def _fill_basis(exponent, power, nb, tau, value):
    """Basis functions at tau.

    Parameters
    ----------
    exponent, power : (B,) of the functions, 1/s.
    nb : how many of them.
    tau : s, since the start of the segment.
    value : (B,) complex; the first ``nb`` are written.
    """
    for b in range(nb):
        lam = exponent[b]
        if b > 0 and lam == exponent[b - 1] and power[b] == power[b - 1] + 1:
            value[b] = value[b - 1] * tau
        else:
            v = _exp(lam.real, lam.imag, tau)
            for _ in range(power[b]):
                v *= tau
            value[b] = v


@kernel
def _state_at(tables, s, zeta, basis, y):
    """The state from the amplitudes of sources and the values of basis functions.

    Parameters
    ----------
    tables : Tables.
    s : number of the contact state.
    zeta : (F + Z,) amplitudes, see `_fill_sources`.
    basis : (B,) values, see `_fill_basis`.
    y : (N,) written.
    """
    N = y.size
    for k in range(N):
        y[k] = 0.0
    for q in range(tables.n_terms[s]):
        a = zeta[tables.term_source[s, q]] * basis[tables.term_basis[s, q]]
        if a != 0.0:
            for k in range(N):
                v = tables.term_vector[s, q, k]
                y[k] += v.real * a.real - v.imag * a.imag


@kernel
def _reset(tables, s, guard, zeta, basis, y):
    """Write the internal states after a guard's event into y; ``basis`` is evaluated at the event.

    Parameters
    ----------
    tables, s, zeta, basis : as for `_state_at`.
    guard : of state s.
    y : (N,) state, written where the event resets it.
    """
    column = tables.reset[s, guard]
    if column < 0:
        return
    contact = tables.guard_contact[s, guard]
    for i in range(tables.states[contact]):
        total = 0.0
        for q in range(tables.n_terms[s]):
            w = tables.watch[s, q, column + i]
            total += (w * zeta[tables.term_source[s, q]] * basis[tables.term_basis[s, q]]).real
        y[tables.first[contact] + i] = total
