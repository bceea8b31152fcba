"""The compiled pass along a motion that gives its derivatives; see :mod:`beamsim.flow.variational`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel, summing
from beamsim.flow.kernels import _exp, _fill_basis, _fill_sources, _moments, _state_at

ROUND_OFF = 1e-14  # of the terms that make up two rates: a smaller difference of them is none


class Factors(NamedTuple):
    """Factors of the state (N), the inputs (F) and their slopes (F), V in all, along a motion of G segments.

    The first of each array is that of the flow; the others are what each of P parameters changes.
    """

    rates: Any  # (1 + P, G, N, V) the state's time derivative
    after: Any  # (1 + P, G + 1, N + 1, V) state and guard of the events between segments; ends have no guard
    amplitude: Any  # (P, F) changes of the inputs' amplitudes about t = 0
    exponent: Any  # (P, F) changes of their exponents, 1/s


class Instant(NamedTuple):
    """What a motion and its inputs are at one time."""

    v: Any  # (V,) the state, the inputs and their slopes
    moving: Any  # (V,) their time derivatives
    moved: Any  # (P, 2 F) changes of the inputs and of their slopes by the parameters


class Segment(NamedTuple):
    """A segment of the motion."""

    number: Any
    state: Any  # contact state
    time: Any  # s, when it begins
    length: Any  # s
    zeta: Any  # (F + Z,) amplitudes at its beginning
    basis: Any  # (B,) basis functions at its end


@kernel
def _fill_inputs(inputs, of, t, now):
    """Inputs, exponentials from t = 0 on, with their slopes and changes, into an Instant.

    Parameters
    ----------
    inputs, of : Inputs, Factors.
    t : s.
    now : Instant, written but for the state.
    """
    F = inputs.exponent.size
    N = now.v.size - 2 * F
    for f in range(F):
        nu = inputs.exponent[f]
        turned = _exp(nu.real, nu.imag, t)
        value = inputs.amplitude[0, f] * turned
        now.v[N + f] = value.real
        now.v[N + F + f] = now.moving[N + f] = (nu * value).real
        now.moving[N + F + f] = (nu * nu * value).real
        for p in range(of.exponent.shape[0]):
            rising = value * of.exponent[p, f]
            change = of.amplitude[p, f] * turned + rising * t
            now.moved[p, f] = change.real
            now.moved[p, F + f] = (nu * change + rising).real


@kernel
def _product(matrix, vector, out):
    """The product of a matrix (k, n) and a vector (n,) into ``out`` (k,)."""
    for i in range(out.size):
        total = 0.0
        for k in range(vector.size):
            total += matrix[i, k] * vector[k]
        out[i] = total


@summing
def _differentiate(after, m, now, S, out):
    """Changes of what follows from an Instant.

    Parameters
    ----------
    after : (1 + P, G + 1, k, V) factors, and what the parameters change of them.
    m : number of the event.
    now : Instant.
    S : (N, N + P) change of the state by the start and by the parameters.
    out : (k, N + P); written.
    """
    N, columns = S.shape
    for i in range(out.shape[0]):
        for j in range(columns):
            out[i, j] = 0.0
        for k in range(N):
            factor = after[0, m, i, k]
            if factor != 0.0:
                for j in range(columns):
                    out[i, j] += factor * S[k, j]
        for p in range(columns - N):
            for k in range(now.v.size):
                out[i, N + p] += after[1 + p, m, i, k] * now.v[k]
            for k in range(now.moved.shape[1]):
                out[i, N + p] += after[0, m, i, N + k] * now.moved[p, k]


@summing
def _transit(tables, segment, first, free, S):
    """Carry the change of a state over a segment, in place.

    Parameters
    ----------
    tables, segment : Tables, Segment.
    first : number of the first free amplitude.
    free : (2, Z, N + P) room for changes of the free amplitudes.
    S : (N, N + P).
    """
    s, (N, columns) = segment.state, S.shape
    for z in range(tables.n_free[s]):
        for j in range(columns):
            free[0, z, j] = free[1, z, j] = 0.0
        for k in range(N):
            left = tables.projector[s, z, k]
            for j in range(columns):
                free[0, z, j] += left.real * S[k, j]
                free[1, z, j] += left.imag * S[k, j]
    for k in range(N):
        for j in range(columns):
            S[k, j] = 0.0
    for q in range(tables.n_terms[s]):
        z = tables.term_source[s, q] - first
        if z >= 0:
            for k in range(N):
                right = tables.term_vector[s, q, k] * segment.basis[tables.term_basis[s, q]]
                for j in range(columns):
                    S[k, j] += right.real * free[0, z, j] - right.imag * free[1, z, j]


@kernel
def _fill_load(tables, inputs, of, segment, p, load):
    """The load that a parameter's change is over a segment.

    Parameters
    ----------
    tables, inputs, of, segment : Tables, Inputs, Factors, Segment.
    p : number of the parameter.
    load : (B + 2 F, N) factors of the basis functions, of the sources, and of these times the time since the segment
        began; written.
    """
    s, zeta, F, N = segment.state, segment.zeta, inputs.exponent.size, load.shape[1]
    rates, own, B = of.rates[0, segment.number], of.rates[1 + p, segment.number], load.shape[0] - 2 * F
    for i in range(N):
        acts = False
        for k in range(N):
            acts = acts or own[i, k] != 0.0
        for b in range(B):
            load[b, i] = 0.0
        if acts:
            for q in range(tables.n_terms[s]):
                total = 0.0j
                for k in range(N):
                    total += own[i, k] * tables.term_vector[s, q, k]
                load[tables.term_basis[s, q], i] += total * zeta[tables.term_source[s, q]]
    for f in range(F):
        nu = inputs.exponent[f]
        turned = _exp(nu.real, nu.imag, segment.time)
        rising = turned * inputs.amplitude[0, f] * of.exponent[p, f]
        steady = turned * of.amplitude[p, f] + rising * segment.time
        for i in range(N):
            direct, slope = rates[i, N + f] + nu * rates[i, N + F + f], rates[i, N + F + f]
            load[B + f, i] = steady * direct + rising * slope
            load[B + f, i] += zeta[f] * (own[i, N + f] + nu * own[i, N + F + f])
            load[B + F + f, i] = rising * direct


@kernel
def _convolution(a, q, b, p, tau, moments):
    r"""The integral :math:`\int_0^\tau (\tau - s)^q e^{a (\tau - s)} s^p e^{b s} ds`.

    With x = (b - a) tau it is :math:`\tau^{p + q + 1} e^{a \tau} \int_0^1 (1 - s)^q s^p e^{x s} ds`; where
    Re x > 0 the two factors are exchanged.

    Parameters
    ----------
    a, q : exponent, 1/s, and power.
    b, p : the same of the other factor.
    tau : s.
    moments : room for p + q + 1.

    Returns
    -------
    complex
    """
    if b.real > a.real:
        a, b, q, p = b, a, p, q
    _moments((b - a) * tau, p + q, moments)
    total, factor = 0.0j, 1.0
    for k in range(q + 1):
        total += factor * moments[p + k]
        factor *= (k - q) / (k + 1.0)
    return total * tau ** (p + q + 1) * _exp(a.real, a.imag, tau)


@kernel
def _respond(tables, inputs, segment, load, moments, column):
    """Add the response at the end of a segment to a load.

    Parameters
    ----------
    tables, inputs, segment : Tables, Inputs, Segment.
    load : (B + 2 F, N) see `_fill_load`.
    moments : room for work.
    column : (N,) written to.
    """
    s, tau, F = segment.state, segment.length, inputs.exponent.size
    B = load.shape[0] - 2 * F
    for c in range(load.shape[0]):
        acts = False
        for k in range(column.size):
            acts = acts or load[c, k] != 0.0
        if not acts:
            continue
        b = tables.exponent[s, c] if c < B else inputs.exponent[(c - B) % F]
        p = tables.power[s, c] if c < B else (c - B) // F
        for q in range(tables.n_terms[s]):
            z = tables.term_source[s, q] - F
            if z < 0:
                continue
            push, pull, of = 0.0j, 0.0j, tables.term_basis[s, q]
            for k in range(column.size):
                push += tables.projector[s, z, k] * load[c, k]
                pull += tables.projector[s, z, k] * load[c, k].conjugate()
            a, power = tables.exponent[s, of], tables.power[s, of]
            total = 0.5 * push * _convolution(a, power, b, p, tau, moments)
            total += 0.5 * pull * _convolution(a, power, b.conjugate(), p, tau, moments)
            for k in range(column.size):
                column[k] += (total * tables.term_vector[s, q, k]).real


@kernel
def _fill_jump(of, m, now, after, out):
    """Rate of the state after an event, if it came later, less that of the motion which goes on from it.

    Parameters
    ----------
    of, now : Factors, and the Instant before the event.
    m : number of the segment that begins with it.
    after : (V,) room for what follows.
    out : (N,) written.
    """
    N, reset = out.size, of.after[0, m]
    for k in range(N, after.size):
        after[k] = now.v[k]
    _product(reset, now.v, after[:N])
    for i in range(N):
        change, size = 0.0, 0.0
        for k in range(after.size):
            change += reset[i, k] * now.moving[k] - of.rates[0, m, i, k] * after[k]
        for k in range(N):
            size += abs(of.rates[0, m, i, k] * after[k])
            if reset[i, k] != 0.0:
                for j in range(N):
                    size += abs(reset[i, k] * of.rates[0, m - 1, k, j] * now.v[j])
        out[i] = change if abs(change) > ROUND_OFF * size else 0.0


@kernel
def differentiate(tables, inputs, log, of, S, end, slope):
    """The derivatives of a motion's end.

    Parameters
    ----------
    tables, inputs : Tables of the contact states, Inputs on one piece.
    log : the motion's G segments (see `beamsim.flow.transient.Log`).
    of : Factors.
    S : (N, N + P) by the start and by the parameters; written, as the others.
    end, slope : (N,) the last state and its time derivative.
    """
    (N, columns), F, G, B = S.shape, inputs.exponent.size, log.time.size, tables.exponent.shape[1]
    P, V, Z = columns - N, N + 2 * F, tables.projector.shape[1]
    # each is written before it is read; zeros would take longer to compile
    now = Instant(np.empty(V), np.empty(V), np.empty((P, 2 * F)))
    zeta, basis, rest = np.empty(F + Z, np.complex128), np.empty(B, np.complex128), np.empty(N)
    load, moments = np.empty((B + 2 * F, N), np.complex128), np.empty(2 * B + 2, np.complex128)
    free, change, dt = np.empty((2, Z, columns)), np.empty((N + 1, columns)), np.empty(columns)
    jump, after, t = np.empty(N), np.empty(V), log.time[0]
    for k in range(N):
        now.v[k] = log.y[0, k]
        for j in range(columns):
            S[k, j] = 1.0 if j == k else 0.0
    for m in range(G + 1):
        if m > 0:
            segment = Segment(m - 1, log.state[m - 1], log.time[m - 1], log.length[m - 1], zeta, basis)
            s = segment.state
            _fill_sources(tables, s, inputs, log.piece[m - 1], segment.time, log.y[m - 1], rest, zeta)
            _fill_basis(tables.exponent[s], tables.power[s], tables.n_basis[s], segment.length, basis)
            _state_at(tables, s, zeta, basis, now.v[:N])
            _transit(tables, segment, F, free, S)
            for p in range(P):
                _fill_load(tables, inputs, of, segment, p, load)
                _respond(tables, inputs, segment, load, moments, S[:, N + p])
            t = segment.time + segment.length
        _fill_inputs(inputs, of, t, now)
        _product(of.rates[0, max(m - 1, 0)], now.v, now.moving[:N])
        _differentiate(of.after, m, now, S, change)
        pace = 0.0
        for k in range(V):
            pace += of.after[0, m, N, k] * now.moving[k]
        # what follows at the same instant, since a phase does not last, moves with the event before
        alone, moves = m < 2 or m == G or log.length[m - 1] > 0.0, False
        for j in range(columns):
            if alone:
                dt[j] = -change[N, j] / pace if pace != 0.0 else 0.0  # zero of a contact that begins at rest
            moves = moves or dt[j] != 0.0
        if moves:
            _fill_jump(of, m, now, after, jump)
        for i in range(N):
            for j in range(columns):
                S[i, j] = change[i, j] + jump[i] * dt[j] if moves else change[i, j]
    _product(of.after[0, G], now.v, end)
    _product(of.after[0, G], now.moving, slope)
