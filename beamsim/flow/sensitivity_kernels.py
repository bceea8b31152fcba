"""The compiled pass of :mod:`beamsim.flow.sensitivity` along the segments and events of a motion.

N is the size of the state, F the number of sources, P that of parameters, V = N + 2 F the size of the state, the inputs
and their slopes together.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.kernels import _exp, _fill_basis

ROUND_OFF = 1e-14  # of the terms that make up two rates: a smaller difference of them is none
SMALLEST_TERM = 1e-18  # relative size at which the power series of an integral is cut


class Exponentials(NamedTuple):
    """Sources that are exponentials from t = 0 on."""

    amplitude: Any  # (F,)
    exponent: Any  # (F,) 1/s


class Parameters(NamedTuple):
    """What P parameters change: the sources, and the rate of the state in S contact states."""

    amplitude: Any  # (P, F)
    exponent: Any  # (P, F)
    rates: Any  # (P, S, N, V), of which P may be 0 where none changes them


class Crossings(NamedTuple):
    """E events of K kinds, as factors (V,) and what P parameters change of these."""

    kind: Any  # (E,)
    guard: Any  # (K, V)
    reset: Any  # (K, N, V) the state after the event
    guard_rates: Any  # (P, K, V), of which P may be 0
    reset_rates: Any  # (P, K, N, V)


@kernel
def unit_integral(q, p, x):  # type: ignore[no-untyped-def]
    """``int_0^1 (1 - s)^q s^p e^(x s) ds``: by parts where x is large, else by its power series.

    Parameters
    ----------
    q, p : powers.
    x : complex, with Re x <= 0.
    """
    if abs(x) < 0.5 * (p + q + 1.0):
        factor = 1.0  # q! p! / (p + q + 1)!
        for k in range(1, q + 1):
            factor *= k / (p + k)
        term = complex(factor / (p + q + 1.0), 0.0)
        total = term
        k = 0
        while abs(term) > SMALLEST_TERM * abs(total):
            term = term * x * ((p + k + 1.0) / ((k + 1.0) * (p + q + k + 2.0)))
            total += term
            k += 1
        return total
    total = complex(-1.0 if p == 0 else 0.0, 0.0)
    if q == 0:
        total += _exp(x.real, x.imag, 1.0)
    if p > 0:
        total -= p * unit_integral(q, p - 1, x)
    if q > 0:
        total += q * unit_integral(q - 1, p, x)
    return total / x


@kernel
def exponential_integral(a, q, b, p, tau):  # type: ignore[no-untyped-def]
    """``int_0^tau (tau - s)^q e^(a (tau - s)) s^p e^(b s) ds``.

    With x = (b - a) tau it is ``tau^(p + q + 1) e^(a tau) J_qp(x)``, ``J_qp(x) = int_0^1 (1 - s)^q s^p e^(x s) ds``;
    that of the pairs exchanged where Re x > 0.
    """
    x = (b - a) * tau
    factor = tau ** (p + q + 1)
    if x.real > 0.0:
        return factor * _exp(b.real, b.imag, tau) * unit_integral(p, q, -x)
    return factor * _exp(a.real, a.imag, tau) * unit_integral(q, p, x)


@kernel
def _fill_inputs(sources, t, inputs, slopes):  # type: ignore[no-untyped-def]
    """Inputs and their slopes at a time (2 F,), and the time derivatives of both."""
    F = sources.exponent.size
    for f in range(F):
        nu = sources.exponent[f]
        u = sources.amplitude[f] * _exp(nu.real, nu.imag, t)
        inputs[f], inputs[F + f] = u.real, (nu * u).real
        slopes[f], slopes[F + f] = (nu * u).real, (nu * nu * u).real


@kernel
def _fill_moved(sources, parameters, p, t, moved):  # type: ignore[no-untyped-def]
    """Change of the inputs and their slopes (2 F,) with a parameter."""
    F = sources.exponent.size
    for f in range(F):
        nu, change = sources.exponent[f], parameters.exponent[p, f]
        turned = _exp(nu.real, nu.imag, t)
        rising = sources.amplitude[f] * change * turned
        u = parameters.amplitude[p, f] * turned + rising * t
        moved[f], moved[F + f] = u.real, (nu * u + rising).real


@kernel
def _fill_amplitudes(tables, s, sources, t, y, rest, zeta):  # type: ignore[no-untyped-def]
    """Amplitudes of the sources, and of the free motions, in a segment that starts from y (N,)."""
    F = sources.exponent.size
    for f in range(F):
        nu = sources.exponent[f]
        zeta[f] = sources.amplitude[f] * _exp(nu.real, nu.imag, t)
    rest[:] = y
    for q in range(tables.n_terms[s]):
        f = tables.term_source[s, q]
        if f < F and tables.power[s, tables.term_basis[s, q]] == 0:
            for i in range(y.size):
                rest[i] -= (tables.term_vector[s, q, i] * zeta[f]).real
    for z in range(tables.n_free[s]):
        total = 0.0j
        for i in range(y.size):
            total += tables.projector[s, z, i] * rest[i]
        zeta[F + z] = total


@kernel
def _fill_load(tables, s, sources, parameters, p, t, zeta, load):  # type: ignore[no-untyped-def]
    """The load (B + 2 F, N) that a change is: on a state's basis functions, on the sources, and on these times time."""
    F, N, B = sources.exponent.size, load.shape[1], tables.n_basis[s]
    load[:] = 0.0
    if parameters.rates.shape[0] > 0:
        rates = parameters.rates[p, s]
        for q in range(tables.n_terms[s]):
            b, z = tables.term_basis[s, q], zeta[tables.term_source[s, q]]
            for i in range(N):
                for k in range(N):
                    if rates[i, k] != 0.0:
                        load[b, i] += rates[i, k] * tables.term_vector[s, q, k] * z
        for f in range(F):
            for i in range(N):
                load[B + f, i] += (rates[i, N + f] + sources.exponent[f] * rates[i, N + F + f]) * zeta[f]


@kernel
def _add_driven(rates, sources, parameters, p, t, B, load):  # type: ignore[no-untyped-def]
    """Add to a load what a change of the sources drives; ``rates`` (N, V) are the factors in the state's rate."""
    F, N = sources.exponent.size, load.shape[1]
    for f in range(F):
        if parameters.amplitude[p, f] == 0.0 and parameters.exponent[p, f] == 0.0:
            continue
        nu = sources.exponent[f]
        turned = _exp(nu.real, nu.imag, t)
        rising = turned * sources.amplitude[f] * parameters.exponent[p, f]
        steady = turned * parameters.amplitude[p, f] + rising * t
        for i in range(N):
            direct = rates[i, N + f] + nu * rates[i, N + F + f]
            load[B + f, i] += steady * direct + rising * rates[i, N + F + f]
            load[B + F + f, i] += rising * direct


@kernel
def _add_response(tables, s, sources, load, tau, column):  # type: ignore[no-untyped-def]
    """Add to ``column`` (N,) the response at the end of a segment to the load of `_fill_load`."""
    F, N, B = sources.exponent.size, column.size, tables.n_basis[s]
    for q in range(tables.n_terms[s]):
        z = tables.term_source[s, q] - F
        if z < 0:
            continue
        b = tables.term_basis[s, q]
        lam, power = tables.exponent[s, b], tables.power[s, b]
        total = 0.0j
        for c in range(B + 2 * F):
            push, pull = 0.0j, 0.0j
            for i in range(N):
                push += tables.projector[s, z, i] * load[c, i]
                pull += tables.projector[s, z, i] * load[c, i].conjugate()
            if push == 0.0 and pull == 0.0:
                continue
            if c < B:
                mu, rises = tables.exponent[s, c], tables.power[s, c]
            else:
                mu, rises = sources.exponent[(c - B) % F], (c - B) // F
            integral = exponential_integral(lam, power, mu, rises, tau)
            total += 0.5 * push * integral
            if mu.imag != 0.0:
                integral = exponential_integral(lam, power, mu.conjugate(), rises, tau)
            total += 0.5 * pull * integral
        for i in range(N):
            column[i] += (tables.term_vector[s, q, i] * total).real


@kernel
def _carry_over(tables, s, first, basis, before, after):  # type: ignore[no-untyped-def]
    """``after`` = the transition matrix of a segment times ``before`` (N, C); ``first`` is the first free amplitude."""
    N, C = before.shape
    after[:] = 0.0
    for q in range(tables.n_terms[s]):
        z = tables.term_source[s, q] - first
        if z < 0:
            continue
        e = basis[tables.term_basis[s, q]]
        for k in range(C):
            total = 0.0j
            for i in range(N):
                total += tables.projector[s, z, i] * before[i, k]
            total *= e
            for i in range(N):
                u = tables.term_vector[s, q, i]
                after[i, k] += u.real * total.real - u.imag * total.imag


@kernel
def _cross(crossings, c, rates, v, slopes, whole, dt, late, S):  # type: ignore[no-untyped-def]
    """Take S (N, C) across an event of kind c; ``rates`` (2, N, V) are those of the state before and after it.

    ``v`` (V,) are the state, the inputs and their slopes before it, ``slopes`` (2 F,) the latters' time derivatives,
    ``whole`` (V, C) the change of all; ``dt`` (C,) that of its time, known where the event is ``late``.
    """
    N, C = S.shape
    V = v.size
    moving = np.empty(V)
    moving[:N] = rates[0] @ v
    moving[N:] = slopes
    started = v.copy()
    started[:N] = crossings.reset[c] @ v
    flown = crossings.reset[c] @ moving
    onwards = rates[1] @ started
    jump = np.zeros(N)
    for i in range(N):
        size = 0.0
        for k in range(N):
            size += abs(rates[1, i, k] * started[k])
            if crossings.reset[c, i, k] != 0.0:
                for j in range(N):
                    size += abs(crossings.reset[c, i, k] * rates[0, k, j] * v[j])
        change = flown[i] - onwards[i]
        if abs(change) > ROUND_OFF * size:
            jump[i] = change
    states = C - crossings.guard_rates.shape[0]
    if not late:
        pace = 0.0
        for k in range(V):
            pace += crossings.guard[c, k] * moving[k]
        dt[:] = crossings.guard[c] @ whole
        for p in range(crossings.guard_rates.shape[0]):
            for k in range(V):
                dt[states + p] += crossings.guard_rates[p, c, k] * v[k]
        for k in range(C):
            dt[k] = -dt[k] / pace if pace != 0.0 else 0.0  # a contact that begins at rest
    S[:] = crossings.reset[c] @ whole
    for p in range(crossings.guard_rates.shape[0]):
        S[:, states + p] += crossings.reset_rates[p, c] @ v
    for i in range(N):
        for k in range(C):
            S[i, k] += jump[i] * dt[k]


@kernel
def carry_sensitivity(tables, log, sources, rates, crossings, parameters, S, ends):  # type: ignore[no-untyped-def]
    """Carry derivatives along a log of segments.

    Parameters
    ----------
    tables, log : Tables of the contact states, and the Log of the motion.
    sources : Exponentials.
    rates : (S, N, V) factors of the state's rate in each contact state.
    crossings, parameters : Crossings, Parameters.
    S : (N, N + P) derivatives, updated in place.
    ends : (2, 2 F) receives the inputs and their slopes at the end, and the time derivatives of both.
    """
    N, C = S.shape
    F, P = sources.exponent.size, parameters.amplitude.shape[0]
    zeta = np.zeros(F + tables.projector.shape[1], dtype=np.complex128)
    basis = np.zeros(tables.exponent.shape[1], dtype=np.complex128)
    load = np.zeros((tables.exponent.shape[1] + 2 * F, N), dtype=np.complex128)
    rest, v, slopes, dt = np.empty(N), np.empty(N + 2 * F), np.empty(2 * F), np.zeros(C)
    before, whole, both = np.empty((N, C)), np.zeros((N + 2 * F, C)), np.empty((2, N, N + 2 * F))
    event = 0
    for g in range(log.time.size):
        s, tau, t = log.state[g], log.length[g], log.time[g]
        _fill_amplitudes(tables, s, sources, t, log.y[g], rest, zeta)
        _fill_basis(tables.exponent[s], tables.power[s], tables.n_basis[s], tau, basis)
        before[:] = S
        _carry_over(tables, s, F, basis, before, S)
        for p in range(P):
            _fill_load(tables, s, sources, parameters, p, t, zeta, load)
            _add_driven(rates[s], sources, parameters, p, t, tables.n_basis[s], load)
            _add_response(tables, s, sources, load, tau, S[:, N + p])
        if g + 1 == log.time.size:
            _fill_inputs(sources, t + tau, ends[0], ends[1])
        if g + 1 == log.time.size or log.state[g + 1] == s:
            continue
        v[:N] = 0.0
        for q in range(tables.n_terms[s]):
            a = zeta[tables.term_source[s, q]] * basis[tables.term_basis[s, q]]
            for i in range(N):
                v[i] += (tables.term_vector[s, q, i] * a).real
        _fill_inputs(sources, t + tau, v[N:], slopes)
        whole[:N] = S
        for p in range(P):
            _fill_moved(sources, parameters, p, t + tau, whole[N:, N + p])
        both[0], both[1] = rates[s], rates[log.state[g + 1]]
        # what follows at the same instant, since a phase does not last, moves with the event before
        _cross(crossings, crossings.kind[event], both, v, slopes, whole, dt, g > 0 and tau == 0.0, S)
        event += 1
