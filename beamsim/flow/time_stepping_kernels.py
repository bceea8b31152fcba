"""Compiled steps of Newmark's method and HHT with contacts (see `beamsim.flow.time_stepping`)."""

from __future__ import annotations

import numpy as np

from beamsim.flow.compiled import allocating, inner, kernel
from beamsim.flow.linear_kernels import eliminate, substitute
from beamsim.typing import Floats

MOST_ITERATIONS = 40  # of the contacts' phases in one step


def contact_space(projection: Floats, inverse: Floats) -> tuple[Floats, Floats]:
    """Change of the coordinates (n, m) and of the penetrations (m, m) by a unit force at each contact."""
    moved = inverse @ projection.T
    return np.ascontiguousarray(moved), np.ascontiguousarray(projection @ moved)


@inner
def _row(row, delta, rate, p):  # type: ignore[no-untyped-def]
    """A linear function of penetration, rate, 1 and internal states."""
    total = row[0] * delta + row[1] * rate + row[2]
    for i in range(p.size):
        total += row[3 + i] * p[i]
    return total


@kernel
def march_in_steps(  # type: ignore[no-untyped-def]
    stiffness, damping, inverse, moved, compliance, projection, gap, felt, laws, cubic, h, alpha, loads, d, base_rate,
    first, end, carried, phases, rows, motion, force, record,
):  # fmt: skip
    """Steps ``first`` to ``end``; returns the number of unsettled steps.

    ``carried`` (q, v, a, forces, penetrations, their rates, internal states) and ``phases`` are changed in place, so
    that a further call goes on; step 0 needs q, v and phases alone.
    """
    force_row, guards, guard, following, resets, reset, dynamics, states = laws
    q, v, a, N, delta, rate, p = carried
    n, m, every = q.size, phases.size, gap.size
    R = dynamics.shape[2]
    beta, gamma = (1.0 - alpha) ** 2 / 4.0, (1.0 - 2.0 * alpha) / 2.0
    share, fast = 1.0 + alpha, gamma / (beta * h)
    new = np.zeros((m, R))
    if first == 0:
        delta[:] = projection @ q - gap + felt * d[0]
        rate[:] = projection @ v + felt * base_rate[0]
        for j in range(m):
            N[j] = _row(force_row[j, phases[j]], delta[j], rate[j], p[j])
        for j in range(m, every):
            N[j] = cubic[j - m] * delta[j] ** 3
        a[:] = loads[0] - stiffness * q - damping @ v - N @ projection
    A, b, order = np.zeros((every, every)), np.zeros(every), np.zeros(every, dtype=np.int64)
    pending = np.zeros(m, dtype=np.int64)  # guard whose reset gives the internal states at the end of the step, plus 1
    origin = phases.copy()
    unsettled = 0
    for step in range(first, end):
        if step > 0:
            before = damping @ v + stiffness * q + N @ projection
            drift = fast * q + (gamma / beta - 1.0) * v + h * (gamma / (2.0 * beta) - 1.0) * a
            right = q / (beta * h * h) + v / (beta * h) + (0.5 / beta - 1.0) * a
            right += share * (damping @ drift) + alpha * before + share * loads[step] - alpha * loads[step - 1]
            free = inverse @ right
            slope = fast * free - drift
            free_delta = projection @ free - gap + felt * d[step]
            free_rate = projection @ slope + felt * base_rate[step]
            for j in range(m):
                pending[j], origin[j] = 0, phases[j]
                for i in range(R):
                    new[j, i] = p[j, i]
            guess = delta.copy()
            settled = False
            for _ in range(MOST_ITERATIONS):
                for j in range(every):
                    if j < m:
                        row = force_row[j, phases[j]]
                        k, c, constant = row[0], row[1], row[2]
                        for i in range(R):
                            constant += row[3 + i] * new[j, i]
                    else:
                        k, c = 3.0 * cubic[j - m] * guess[j] ** 2, 0.0
                        constant = -2.0 * cubic[j - m] * guess[j] ** 3
                    for i in range(every):
                        A[j, i] = share * (k + c * fast) * compliance[j, i]
                    A[j, j] += 1.0
                    b[j] = k * free_delta[j] + c * free_rate[j] + constant
                eliminate(A, order)
                substitute(A, order, b)
                settled = True
                for j in range(every):
                    push = 0.0
                    for i in range(every):
                        push += compliance[j, i] * b[i]
                    was = delta[j] if j < m else guess[j]
                    now = free_delta[j] - share * push
                    if j >= m and abs(now - was) > 1e-12 * (abs(now) + abs(was)):
                        settled = False
                    guess[j] = now
                for j in range(m):
                    push = 0.0
                    for i in range(every):
                        push += compliance[j, i] * b[i]
                    speed = free_rate[j] - share * fast * push
                    if states[j] > 0:
                        settled = _inside(dynamics, reset, j, phases[j], origin[j], pending[j], h, p[j], delta[j],
                                          rate[j], guess[j], speed, new[j]) and settled  # fmt: skip
                    for i in range(guards[j, phases[j]]):
                        if _row(guard[j, phases[j], i], guess[j], speed, new[j]) < 0.0:
                            pending[j] = i + 1 if resets[j, phases[j], i] else 0
                            origin[j] = phases[j]
                            phases[j] = following[j, phases[j], i]
                            settled = False
                            break
                if settled:
                    break
            unsettled += not settled
            new_q = free - share * (moved @ b)
            a[:] = (new_q - q) / (beta * h * h) - v / (beta * h) - (0.5 / beta - 1.0) * a
            v[:] = fast * new_q - drift
            q[:] = new_q
            for j in range(every):
                N[j], delta[j] = b[j], guess[j]
            rate[:] = projection @ v + felt * base_rate[step]
            for j in range(m):
                for i in range(R):
                    p[j, i] = new[j, i]
        for k in range(rows.shape[0]):
            x = y = z = 0.0
            for i in range(n):
                x += rows[k, i] * q[i]
                y += rows[k, i] * v[i]
                z += rows[k, i] * a[i]
            motion[0, step, k], motion[1, step, k], motion[2, step, k] = x, y, z
        for j in range(m):
            force[step, j], record[step, j] = N[j], phases[j]
    return unsettled


@allocating
def _inside(  # type: ignore[no-untyped-def]
    dynamics, reset, j, phase, origin, pending, h, p, delta, rate, new_delta, new_rate, new
):
    """Internal states at the end of a step, into ``new``; whether they are as before.

    A reset gives them where the phase has just changed, otherwise the trapezoidal rule, its equations by iteration.
    """
    same = True
    R = p.size
    if pending > 0:
        for i in range(R):
            value = _row(reset[j, origin, pending - 1, i], new_delta, new_rate, p)
            same = same and abs(value - new[i]) <= 1e-12 * (abs(value) + abs(new[i]))
            new[i] = value
        return same
    A, b, order = np.zeros((R, R)), np.zeros(R), np.zeros(R, dtype=np.int64)
    for i in range(R):
        row = dynamics[j, phase, i]
        b[i] = p[i] + 0.5 * h * (_row(row, delta, rate, p) + row[0] * new_delta + row[1] * new_rate + row[2])
        for k in range(R):
            A[i, k] = -0.5 * h * row[3 + k]
        A[i, i] += 1.0
    eliminate(A, order)
    substitute(A, order, b)
    for i in range(R):
        same = same and abs(b[i] - new[i]) <= 1e-12 * (abs(b[i]) + abs(new[i]))
        new[i] = b[i]
    return same
