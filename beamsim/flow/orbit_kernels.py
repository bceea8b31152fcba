"""Compiled kernels of the variational flow: forced responses by frequency, transition and saltation matrices.

The motion itself comes from :func:`beamsim.flow.march_kernels.march`; a second pass over its log carries the
sensitivity :math:`S = \\partial y/\\partial(y_0, p)` along, one column an initial value or a parameter:

* on a segment :math:`S_1 = \\Phi(\\tau)\\,(S_0 - \\partial y_f(t_0)) + \\partial y_f(t_1)` with
  :math:`\\Phi = \\mathrm{Re}\\, \\sum_t u_t e_t(\\tau)\\, P_{src(t)}` and the forced response's own derivative;
* a contact's stiffness, dashpot, gap or place p, and the structure's matrices and loads, add
  :math:`\\int \\Phi(\\tau-\\sigma) h(\\sigma) d\\sigma`, in closed
  form by the divided differences :math:`(e^{\\lambda_b\\tau} - e^{\\lambda_i\\tau}) / (\\lambda_b - \\lambda_i)`;
* at an event with the reset R :math:`S^+ = R' S^- + (R' f^- - f^+)\\, \\partial t_e`,
  :math:`\\partial t_e = -(\\nabla g\\, S^- + \\partial_p g) / \\dot g^-` (the saltation matrix applied to S).

Internal states of the contacts appear here where they move by themselves (``Phase.coupled`` is false); passages with
others take :mod:`beamsim.flow.resonant_passage`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import allocating, inner, kernel
from beamsim.flow.kernels import _exp, _fill_basis, _fill_sources, _state_at
from beamsim.flow.linear_kernels import eliminate, substitute


class Variation(NamedTuple):
    """What the second pass needs of the contact states beyond the kernels' tables."""

    left: Any  # (S, 2 Z, N) real and imaginary rows of the projector
    right: Any  # (S, N, 2 T) real columns of the free terms: Re u, -Im u
    n_terms: Any  # (S,) free terms
    term_basis: Any  # (S, T)
    term_source: Any  # (S, T) counted from the first free amplitude
    first_forced: Any  # (S,) term of the first periodic source
    multiple: Any  # (H,) of the fundamental frequency
    base: Any  # (H,) complex amplitude of the base displacement


class Parameters(NamedTuple):
    """P parameters: derivatives of the periodic terms, and directions in the space of the contacts' numbers and of the
    structure's matrices and loads (these last of length zero where no parameter moves them)."""

    moves_frequency: Any  # (P,) bool
    terms: Any  # (P, S, H, N) derivative of the periodic sources' term vectors
    base: Any  # (P, H) derivative of the base displacement's amplitude
    moves_contacts: Any  # (P,) bool
    law: Any  # (P, m, phases, 3) of the force's factors of penetration, rate and 1
    decay: Any  # (P, m, phases) of the rate at which a single internal state moves by itself
    gap: Any  # (P, m)
    shape: Any  # (P, m, n)
    moves_structure: Any  # (P,) bool
    structure_stiffness: Any  # (P, n, n)
    structure_damping: Any  # (P, n, n)
    structure_mass: Any  # (P, n, n)
    load: Any  # (P, n)
    force: Any  # (P, H, n) complex amplitudes


class PeriodicLoads(NamedTuple):
    """H loads (see :class:`beamsim.flow.passage.PeriodicForcing`), and arrays for derivatives of their responses."""

    force: Any  # (H, n) complex
    force_power: Any  # (H,)
    base: Any  # (H,) complex
    base_power: Any  # (H,)
    reference: float  # rad/s
    first_basis: Any  # (S,) basis function of the first load's response
    stiffness: Any  # (S, n, n) of the contact states
    damping: Any  # (S, n, n)
    derivative: Any  # (2, S, H, N) complex, by frequency and level
    base_derivative: Any  # (2, H) complex


@allocating
def _force_terms(  # type: ignore[no-untyped-def]
    tables, inputs, contacts, first_forced, first_basis, K, C, omega, multiple, force, base, dforce, dbase, level_force,
    level_base, out,
):  # fmt: skip
    """Write the periodic sources' responses at frequency ``omega`` into the tables, in place.

    ``(K_s - k^2 omega^2 + i k omega C_s) q = force_h - closed ground contacts``; ``out`` (2, S, H, N) receives the
    derivatives by omega and by the level, ``dforce``/``dbase`` and ``level_force``/``level_base`` being those of the
    loads. Returns False where a response is infinite.
    """
    S, n, _ = K.shape
    H = multiple.size
    m = contacts.sign.size
    Z, order = np.empty((n, n), dtype=np.complex128), np.empty(n, dtype=np.int64)
    x, by_level = np.empty(n, dtype=np.complex128), np.empty(n, dtype=np.complex128)
    by_frequency, extra = np.empty(n, dtype=np.complex128), np.empty(n, dtype=np.complex128)
    for s in range(S):
        for h in range(H):
            w = multiple[h] * omega
            for i in range(n):
                for j in range(n):
                    Z[i, j] = complex(K[s, i, j], w * C[s, i, j])
                Z[i, i] -= w * w
                x[i], by_level[i], extra[i] = force[h, i], level_force[h, i], 0.0
            for j in range(m):
                law = contacts.force[j, tables.phase[s, j]]
                if contacts.felt[j] != 0.0 and (law[0] != 0.0 or law[1] != 0.0):
                    z = contacts.felt[j] * complex(law[0], w * law[1])
                    dz = contacts.felt[j] * complex(0.0, multiple[h] * law[1])
                    for i in range(n):
                        x[i] -= z * contacts.shape[j, i] * base[h]
                        by_level[i] -= z * contacts.shape[j, i] * level_base[h]
                        extra[i] -= (dz * base[h] + z * dbase[h]) * contacts.shape[j, i]
            if not eliminate(Z, order):
                return False
            substitute(Z, order, x)
            substitute(Z, order, by_level)
            for i in range(n):
                total = dforce[h, i] + extra[i]
                for j in range(n):
                    total -= multiple[h] * complex(0.0, C[s, i, j]) * x[j]
                by_frequency[i] = total + 2.0 * multiple[h] * w * x[i]
            substitute(Z, order, by_frequency)
            t = first_forced[s] + h
            b = first_basis[s] + h
            iw = complex(0.0, w)
            tables.exponent[s, b] = iw
            inputs.exponent[1 + h] = iw
            for i in range(n):
                tables.term_vector[s, t, i] = x[i]
                tables.term_vector[s, t, n + i] = iw * x[i]
                out[0, s, h, i] = by_frequency[i]
                out[0, s, h, n + i] = iw * by_frequency[i] + complex(0.0, multiple[h]) * x[i]
                out[1, s, h, i] = by_level[i]
                out[1, s, h, n + i] = iw * by_level[i]
            for g in range(tables.n_guards[s]):
                j = tables.guard_contact[s, g]
                delta = 0.0j
                for i in range(n):
                    delta += contacts.shape[j, i] * x[i]
                delta += contacts.felt[j] * base[h]
                delta *= -contacts.sign[j]
                row = contacts.guard[j, tables.phase[s, j], _guard_of_contact(tables, s, g)]
                tables.watch[s, t, g] = complex(row[0], w * row[1]) * delta
                if tables.reset[s, g] >= 0:
                    rows = contacts.reset[j, tables.phase[s, j], _guard_of_contact(tables, s, g)]
                    for i in range(tables.states[j]):
                        tables.watch[s, t, tables.reset[s, g] + i] = complex(rows[i, 0], w * rows[i, 1]) * delta
    return True


@kernel
def set_loads(tables, inputs, contacts, variation, loads, omega, level):  # type: ignore[no-untyped-def]
    """Rewrite the loads' responses in the tables at a frequency and level; False where they are not finite."""
    H, n = loads.force.shape
    ratio = omega / loads.reference
    unit = np.empty((H, n), dtype=np.complex128)
    force, dforce = np.empty((H, n), dtype=np.complex128), np.empty((H, n), dtype=np.complex128)
    finite = True
    for h in range(H):
        factor, power = ratio ** loads.force_power[h], loads.force_power[h] / omega
        for i in range(n):
            unit[h, i] = loads.force[h, i] * factor
            force[h, i] = level * unit[h, i]
            dforce[h, i] = force[h, i] * power
            finite = finite and math.isfinite(force[h, i].real) and math.isfinite(force[h, i].imag)
        moved = loads.base[h] * ratio ** loads.base_power[h]
        variation.base[h] = level * moved
        loads.base_derivative[0, h] = level * moved * (loads.base_power[h] / omega)
        loads.base_derivative[1, h] = moved
    if finite:
        finite = _force_terms(
            tables, inputs, contacts, variation.first_forced, loads.first_basis, loads.stiffness, loads.damping,
            omega, variation.multiple, force, variation.base, dforce, loads.base_derivative[0], unit,
            loads.base_derivative[1], loads.derivative,
        )  # fmt: skip
    return finite


@inner
def _guard_of_contact(tables, s, g):  # type: ignore[no-untyped-def]
    """Number of a state's guard among those of its contact."""
    number = 0
    while number < g and tables.guard_contact[s, g - 1 - number] == tables.guard_contact[s, g]:
        number += 1
    return number


@kernel
def phases_at_start(contacts, y, base, base_rate, phases):  # type: ignore[no-untyped-def]
    """Phases of the contacts at a motion, into ``phases``; False where a guard is too near zero to tell."""
    m, n = contacts.shape.shape
    clear = True
    for j in range(m):
        w = 0.0
        v = 0.0
        scale = abs(contacts.gap[j])
        for i in range(n):
            w += contacts.shape[j, i] * y[i]
            v += contacts.shape[j, i] * y[n + i]
            scale += abs(contacts.shape[j, i] * y[i])
        w += contacts.felt[j] * base
        v += contacts.felt[j] * base_rate
        scale += abs(contacts.felt[j] * base)
        delta = -contacts.gap[j] - contacts.sign[j] * w
        rate = -contacts.sign[j] * v
        k = contacts.start[j]
        came = -1
        for _ in range(contacts.touching.shape[1]):
            following = -1
            for i in range(contacts.guards[j, k]):
                if contacts.next[j, k, i] == came:
                    continue
                row = contacts.guard[j, k, i]
                g = row[0] * delta + row[1] * rate + row[2]
                size = abs(row[0]) * scale + abs(row[1] * rate) + abs(row[2])
                change = row[0] * rate
                for a in range(contacts.states[j]):
                    p = y[2 * n + contacts.first[j] + a]
                    law = contacts.dynamics[j, k, a]
                    p_rate = law[0] * delta + law[1] * rate + law[2]
                    for b in range(contacts.states[j]):
                        p_rate += law[3 + b] * y[2 * n + contacts.first[j] + b]
                    g += row[3 + a] * p
                    size += abs(row[3 + a] * p)
                    change += row[3 + a] * p_rate
                if abs(g) <= 1e-12 * size:
                    if change == 0.0:
                        clear = False
                    g = change
                if g < 0.0:
                    following = contacts.next[j, k, i]
                    break
            if following < 0:
                break
            came = k
            k = following
        phases[j] = k
    return clear


@inner
def _difference(a, b, ea, eb, tau):  # type: ignore[no-untyped-def]
    """Divided difference (e^{b tau} - e^{a tau}) / (b - a), stable when a and b meet."""
    x = (b - a) * tau
    size = abs(x.real) + abs(x.imag)
    if size < 0.05:
        # tau e^{a tau} (e^x - 1)/x
        return tau * ea * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (
            1.0 + x / 7.0 * (1.0 + x / 8.0 * (1.0 + x / 9.0))))))))  # fmt: skip
    return (eb - ea) / (b - a)


@allocating
def _add_forcing(tables, s, inputs, contacts, base, parameters, p, zeta, basis, tau, add):  # type: ignore[no-untyped-def]
    """Add to ``add`` (2n,) the response over a segment to the change of the contacts' forces with parameter p."""
    m, n = contacts.shape.shape
    N = 2 * n
    F = inputs.exponent.size
    nb = tables.n_basis[s]
    direct = np.zeros(nb, dtype=np.complex128)
    through = np.zeros(nb, dtype=np.complex128)
    for j in range(m):
        ph = tables.phase[s, j]
        dk, dc, df = parameters.law[p, j, ph, 0], parameters.law[p, j, ph, 1], parameters.law[p, j, ph, 2]
        dg, sign = parameters.gap[p, j], contacts.sign[j]
        k, c, f = contacts.force[j, ph, 0], contacts.force[j, ph, 1], contacts.force[j, ph, 2]
        if k == 0.0 and c == 0.0 and f == 0.0 and dk == 0.0 and dc == 0.0 and df == 0.0:
            continue
        moves = False
        for i in range(n):
            if parameters.shape[p, j, i] != 0.0:
                moves = True
        if dk == 0.0 and dc == 0.0 and df == 0.0 and dg == 0.0 and not moves:
            continue
        for b in range(nb):
            direct[b] = 0.0
            through[b] = 0.0
        for q in range(tables.n_terms[s]):
            source = tables.term_source[s, q]
            z = zeta[source]
            if z == 0.0 and source != 0:
                continue
            delta = 0.0j
            rate = 0.0j
            along = 0.0j
            constant = 0.0
            for i in range(n):
                u, v = tables.term_vector[s, q, i], tables.term_vector[s, q, n + i]
                delta -= sign * contacts.shape[j, i] * u
                rate -= sign * contacts.shape[j, i] * v
                if moves:
                    along -= sign * parameters.shape[p, j, i] * (k * u + c * v)
            b = tables.term_basis[s, q]
            if source == 0 and tables.power[s, b] == 0:
                delta -= contacts.gap[j]
                along += df - k * dg
                constant = f
            elif 0 < source < F:
                moved = contacts.felt[j] * base[source - 1]
                delta -= sign * moved
                rate -= sign * moved * inputs.exponent[source]
            direct[b] += z * (dk * delta + dc * rate + along)
            through[b] += z * (k * delta + c * rate + constant)
        for q in range(tables.n_terms[s]):
            source = tables.term_source[s, q]
            if source < F:
                continue
            bi = tables.term_basis[s, q]
            lam = tables.exponent[s, bi]
            e = basis[bi]
            push = 0.0j
            push_moved = 0.0j
            for i in range(n):
                push += sign * tables.projector[s, source - F, n + i] * contacts.shape[j, i]
                if moves:
                    push_moved += sign * tables.projector[s, source - F, n + i] * parameters.shape[p, j, i]
            total = 0.0j
            for b in range(nb):
                if direct[b] == 0.0 and through[b] == 0.0:
                    continue
                mu, f = tables.exponent[s, b], basis[b]
                d = _difference(lam, mu, e, f, tau)
                dbar = d if mu.imag == 0.0 else _difference(lam, mu.conjugate(), e, f.conjugate(), tau)
                total += 0.5 * push * (direct[b] * d + direct[b].conjugate() * dbar)
                if moves:
                    total += 0.5 * push_moved * (through[b] * d + through[b].conjugate() * dbar)
            if total != 0.0:
                for i in range(N):
                    u = tables.term_vector[s, q, i]
                    add[i] += u.real * total.real - u.imag * total.imag


@allocating
def _add_structure(tables, s, first, variation, parameters, p, t0, zeta, basis, tau, add):  # type: ignore[no-untyped-def]
    """Add to ``add`` (2n,) the response over a segment to the change of the structure's matrices and loads.

    The motion being ``Re sum_b q_b e^(lambda_b tau)``, the change of the equations is the load
    ``-Re sum_b (lambda_b^2 dM + lambda_b dC + dK) q_b e^(lambda_b tau)``. ``first`` is the first free amplitude.
    """
    N = add.size
    n = N // 2
    nb = tables.n_basis[s]
    load = np.zeros((nb, n), dtype=np.complex128)
    for q in range(tables.n_terms[s]):
        source = tables.term_source[s, q]
        b = tables.term_basis[s, q]
        z = zeta[source]
        lam = tables.exponent[s, b]
        if source == 0:
            for i in range(n):
                load[b, i] += parameters.load[p, i]
        for j in range(n):
            u, v = z * tables.term_vector[s, q, j], z * tables.term_vector[s, q, n + j]
            a = lam * v
            for i in range(n):
                load[b, i] -= (
                    parameters.structure_stiffness[p, i, j] * u
                    + parameters.structure_damping[p, i, j] * v
                    + parameters.structure_mass[p, i, j] * a
                )
    for h in range(variation.multiple.size):
        b = tables.term_basis[s, variation.first_forced[s] + h]
        iw = tables.exponent[s, b]
        e = _exp(iw.real, iw.imag, t0)
        for i in range(n):
            load[b, i] += parameters.force[p, h, i] * e
    for q in range(tables.n_terms[s]):
        source = tables.term_source[s, q]
        if source < first:
            continue
        bi = tables.term_basis[s, q]
        lam, e = tables.exponent[s, bi], basis[bi]
        total = 0.0j
        for b in range(nb):
            push = 0.0j
            pull = 0.0j
            for i in range(n):
                row = tables.projector[s, source - first, n + i]
                push += row * load[b, i]
                pull += row * load[b, i].conjugate()
            if push == 0.0 and pull == 0.0:
                continue
            mu, f = tables.exponent[s, b], basis[b]
            d = _difference(lam, mu, e, f, tau)
            dbar = d if mu.imag == 0.0 else _difference(lam, mu.conjugate(), e, f.conjugate(), tau)
            total += 0.5 * (push * d + pull * dbar)
        for i in range(N):
            u = tables.term_vector[s, q, i]
            add[i] += u.real * total.real - u.imag * total.imag


@inner
def _change_of_penetration(contacts, base, exponents, multiple, parameters, p, j, t, y):  # type: ignore[no-untyped-def]
    """Explicit derivative of contact j's penetration and of its rate by parameter p, the state held."""
    n = contacts.shape.shape[1]
    sign = contacts.sign[j]
    delta = -parameters.gap[p, j]
    rate = 0.0
    for i in range(n):
        delta -= sign * parameters.shape[p, j, i] * y[i]
        rate -= sign * parameters.shape[p, j, i] * y[n + i]
    felt = contacts.felt[j]
    if felt != 0.0:
        for h in range(multiple.size):
            iw = exponents[1 + h]
            e = _exp(iw.real, iw.imag, t)
            d = parameters.base[p, h]
            dv = d * iw
            if parameters.moves_frequency[p]:
                ik = complex(0.0, multiple[h])
                d += ik * t * base[h]
                dv = d * iw + ik * base[h]
            delta -= sign * felt * (d * e).real
            rate -= sign * felt * (dv * e).real
    return delta, rate


@inner
def _rate_at(tables, s, zeta, basis, tau, out):  # type: ignore[no-untyped-def]
    """Time derivative of the state at tau, where ``basis`` was evaluated."""
    N = out.size
    for i in range(N):
        out[i] = 0.0
    for q in range(tables.n_terms[s]):
        b = tables.term_basis[s, q]
        power = tables.power[s, b]
        ds = tables.exponent[s, b] * basis[b]
        if power > 0:
            lam = tables.exponent[s, b]
            ds += power * _exp(lam.real, lam.imag, tau) * tau ** (power - 1)
        a = zeta[tables.term_source[s, q]] * ds
        if a != 0.0:
            for i in range(N):
                u = tables.term_vector[s, q, i]
                out[i] += u.real * a.real - u.imag * a.imag


@inner
def _add_forced_derivative(tables, s, inputs, variation, parameters, t, sign, sens):  # type: ignore[no-untyped-def]
    """Add ``sign`` times the forced response's derivative by each parameter at time t to its column."""
    P = parameters.moves_frequency.size
    first = sens.shape[1] - P
    for p in range(P):
        for h in range(variation.multiple.size):
            iw = inputs.exponent[1 + h]
            e = sign * _exp(iw.real, iw.imag, t)
            term = variation.first_forced[s] + h
            for i in range(sens.shape[0]):
                d = parameters.terms[p, s, h, i]
                if parameters.moves_frequency[p]:
                    d += complex(0.0, variation.multiple[h] * t) * tables.term_vector[s, term, i]
                sens[i, first + p] += (d * e).real


@inner
def _started(contacts, j, k, guard, i, a):  # type: ignore[no-untyped-def]
    """Factor of quantity a in the internal state i with which the phase after a guard's event starts."""
    if contacts.resets[j, k, guard]:
        return contacts.reset[j, k, guard, i, a]
    return 1.0 if a == 3 + i else 0.0


@kernel
def carry_sensitivity(  # type: ignore[no-untyped-def]
    tables, inputs, contacts, variation, parameters, n_seg, seg_time, seg_length, seg_state, seg_piece, seg_y,
    ev_contact, sens, slope,
):  # fmt: skip
    """Carry ``sens`` (N, columns), updated in place, through a log of segments; the last P columns are parameters.

    ``slope`` (N,) receives the time derivative of the state at the end (limit from the left).
    """
    m, n = contacts.shape.shape
    N = sens.shape[0]
    F = inputs.exponent.size
    H = variation.multiple.size
    P = parameters.moves_frequency.size
    columns = sens.shape[1]
    states = columns - P
    zeta = np.zeros(F + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    basis = np.zeros(tables.exponent.shape[1], dtype=np.complex128)
    y = np.zeros(N)
    change = np.zeros(columns)
    motion = np.zeros(3 + contacts.dynamics.shape[2])  # penetration, its rate, 1 and internal states of one contact
    moving = np.zeros(motion.size)  # their rates
    varied = np.zeros((motion.size, columns))  # their derivatives
    add = np.zeros(2 * n)
    T2 = variation.right.shape[2]
    turned = np.zeros((T2, columns))
    event = 0
    for g in range(n_seg):
        s = seg_state[g]
        tau = seg_length[g]
        t0 = seg_time[g]
        t1 = t0 + tau
        nb = tables.n_basis[s]
        _fill_sources(tables, s, inputs, seg_piece[g], t0, seg_y[g], rest, zeta)
        _fill_basis(tables.exponent[s], tables.power[s], nb, tau, basis)
        _add_forced_derivative(tables, s, inputs, variation, parameters, t0, -1.0, sens)
        T = variation.n_terms[s]
        c = np.dot(variation.left[s], sens)
        for q in range(T):
            i = variation.term_source[s, q]
            e = basis[variation.term_basis[s, q]]
            for k in range(columns):
                re, im = c[2 * i, k], c[2 * i + 1, k]
                turned[2 * q, k] = e.real * re - e.imag * im
                turned[2 * q + 1, k] = e.real * im + e.imag * re
        np.dot(variation.right[s], turned, sens)
        _add_forced_derivative(tables, s, inputs, variation, parameters, t1, 1.0, sens)
        for p in range(P):
            if parameters.moves_contacts[p]:
                for i in range(2 * n):
                    add[i] = 0.0
                _add_forcing(tables, s, inputs, contacts, variation.base, parameters, p, zeta, basis, tau, add)
                for i in range(2 * n):
                    sens[i, states + p] += add[i]
                for j in range(m):
                    rate = parameters.decay[p, j, tables.phase[s, j]]
                    if rate != 0.0:
                        i = 2 * n + contacts.first[j]
                        decay = math.exp(contacts.dynamics[j, tables.phase[s, j], 0, 3] * tau)
                        sens[i, states + p] += rate * tau * decay * seg_y[g, i]
            if parameters.moves_structure[p]:
                for i in range(2 * n):
                    add[i] = 0.0
                _add_structure(tables, s, F, variation, parameters, p, t0, zeta, basis, tau, add)
                for i in range(2 * n):
                    sens[i, states + p] += add[i]
        if g == n_seg - 1:
            _rate_at(tables, s, zeta, basis, tau, slope)
            break
        following = seg_state[g + 1]
        if following == s:
            continue
        j = ev_contact[event]
        event += 1
        before, after = tables.phase[s, j], tables.phase[following, j]
        guard = 0
        while contacts.next[j, before, guard] != after:
            guard += 1
        jumps = contacts.jumps[j, before, guard]
        if not jumps and contacts.states[j] == 0:
            continue
        row = contacts.guard[j, before, guard]
        r, first = contacts.states[j], 2 * n + contacts.first[j]
        _state_at(tables, s, zeta, basis, y)
        if r > 0 or row[1] != 0.0:
            _rate_at(tables, s, zeta, basis, tau, slope)
        else:
            slope[:] = 0.0  # only a guard with a rate in it needs accelerations
        sign = contacts.sign[j]
        delta = -contacts.gap[j]
        rate = 0.0
        turn = 0.0
        for i in range(n):
            delta -= sign * contacts.shape[j, i] * y[i]
            rate -= sign * contacts.shape[j, i] * y[n + i]
            turn -= sign * contacts.shape[j, i] * slope[n + i]
        felt = contacts.felt[j]
        if felt != 0.0:
            for h in range(H):
                iw = inputs.exponent[1 + h]
                e = felt * _exp(iw.real, iw.imag, t1)
                delta -= sign * (variation.base[h] * e).real
                rate -= sign * (variation.base[h] * iw * e).real
                turn -= sign * (variation.base[h] * iw * iw * e).real
        motion[0], motion[1], motion[2] = delta, rate, 1.0
        moving[0], moving[1], moving[2] = rate, turn, 0.0
        for k in range(columns):
            total = 0.0
            change_of_rate = 0.0
            for i in range(n):
                total -= sign * contacts.shape[j, i] * sens[i, k]
                change_of_rate -= sign * contacts.shape[j, i] * sens[n + i, k]
            varied[0, k], varied[1, k] = total, change_of_rate
        for i in range(r):
            motion[3 + i], moving[3 + i] = y[first + i], slope[first + i]
            for k in range(columns):
                varied[3 + i, k] = sens[first + i, k]
        for p in range(P):
            d, dv = _change_of_penetration(
                contacts, variation.base, inputs.exponent, variation.multiple, parameters, p, j, t1, y
            )
            varied[0, states + p] += d
            varied[1, states + p] += dv
        # change of the event's time: the guard's change over its rate
        gdot = 0.0
        for k in range(columns):
            change[k] = 0.0
        for a in range(3 + r):
            if row[a] != 0.0:
                gdot += row[a] * moving[a]
                for k in range(columns):
                    change[k] += row[a] * varied[a, k]
        if jumps:
            push = 0.0
            for a in range(3 + r):
                push += contacts.jump[j, before, guard, a] * motion[a]
            # f- - f+ = -sign * shape * push, and dt_e = -change / gdot
            factor = push / gdot * sign if gdot != 0.0 else 0.0  # a contact that begins at rest
            for k in range(columns):
                a = factor * change[k]
                for i in range(n):
                    sens[n + i, k] += contacts.shape[j, i] * a
        for i in range(r):
            drift = 0.0  # rate of what the state starts with after the event, less the rate there
            size = 0.0
            for a in range(3 + r):
                drift += _started(contacts, j, before, guard, i, a) * moving[a]
                size += abs(_started(contacts, j, before, guard, i, a) * moving[a])
                value = motion[a]
                if a > 2:
                    value = 0.0
                    for b in range(3 + r):
                        value += _started(contacts, j, before, guard, a - 3, b) * motion[b]
                value *= contacts.dynamics[j, after, i, a]
                drift -= value
                size += abs(value)
            if abs(drift) <= 1e-12 * size or gdot == 0.0:
                drift = 0.0
            for k in range(columns):
                total = -drift * change[k] / gdot if drift != 0.0 else 0.0
                for a in range(3 + r):
                    total += _started(contacts, j, before, guard, i, a) * varied[a, k]
                sens[first + i, k] = total
