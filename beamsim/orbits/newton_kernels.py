"""Newton's method for periodic motions under harmonic loads, compiled: the motion, its derivatives and the step.

The same method as :func:`beamsim.orbits.continuation.newton` on the residual of
:class:`beamsim.orbits.shooting.ForcedOrbits`; between two passages nothing returns to Python.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from beamsim.flow.compiled import inner, kernel
from beamsim.flow.linear_kernels import eliminate, substitute
from beamsim.flow.march_kernels import DONE, NEED_STATE, march
from beamsim.flow.orbit_kernels import carry_sensitivity, phases_at_start, set_loads

CONVERGED, FAILED, NEW_START, NEW_STATE, BEYOND = 0, 1, 2, 3, 4


class NewtonLimits(NamedTuple):
    """Tolerances of `beamsim.orbits.continuation`."""

    tolerance: float  # of the residual against its scale
    of_guess: float  # the same of a guess that is not corrected
    of_round_off: float  # the same where a step was no longer than `settled`
    settled: float
    same_scale: float  # length of a step beyond which the residual's scale is computed anew
    iterations: int
    furthest: float  # distance from the guess
    smallest: float  # m, size of a motion
    evaluations: int  # of the guards in one passage


@inner
def _number_of(tables, count, phases):  # type: ignore[no-untyped-def]
    """Number of the contact state with given phases among the first; -1 where there is none."""
    for s in range(count):
        same = True
        for j in range(phases.size):
            same = same and tables.phase[s, j] == phases[j]
        if same:
            return s
    return -1


@inner
def _fill_residual_scale(u, n, omega, smallest, out):  # type: ignore[no-untyped-def]
    """Sizes of the equations: the largest displacement, for velocities times omega."""
    total = 0.0
    for i in range(n):
        total += u[i] ** 2 + (u[n + i] / omega) ** 2
    size = max(math.sqrt(total), smallest)
    for i in range(out.size):
        out[i] = size * omega if n <= i < 2 * n else size


@kernel
def solve_periodic(  # type: ignore[no-untyped-def]
    tables, inputs, contacts, variation, parameters, loads, limits, by_frequency, omega, level, current_omega,
    current_level, multiple, guess, row, target, scale, phases, log, u, y, sens, slope, jacobian,
):  # fmt: skip
    """Solve ``z(T) - z(0) = 0, row . (u / scale) = target`` for u = (z, omega), or (z, level).

    ``current_omega`` and ``current_level`` are those of the responses in the tables. The last motion is left in u, y
    (its end), ``log``, ``sens`` (N, N + 1), ``slope``, and its scaled Jacobian.

    Returns (end, iterations, residual, segments, events, state, guard, passages, omega, level of the responses). The
    end is CONVERGED; FAILED; NEW_START where the contact state ``phases`` is not built, and NEW_STATE that after the
    event of a guard: called again with them it starts anew; or BEYOND what is done here.
    """
    N = y.size
    n = contacts.shape.shape[1]
    H, count = loads.force.shape[0], loads.stiffness.shape[0]
    residual_scale, w = np.empty(N), np.empty(N + 1)
    for i in range(N):
        residual_scale[i] = 1.0
    for i in range(N + 1):
        w[i] = guess[i] / scale[i]
    A, b, order = np.empty((N + 1, N + 1)), np.empty(N + 1), np.empty(N + 1, dtype=np.int64)
    last, moved, size, distance = np.inf, np.inf, np.inf, 0.0
    passages, n_seg, n_ev = 0, 0, 0
    state, guard, piece, begin = -1, -1, 0, 0.0
    end, iteration = FAILED, 0
    while iteration <= limits.iterations:
        for i in range(N + 1):
            u[i] = w[i] * scale[i]
        if by_frequency:
            omega = u[N]
            if not omega > 0.0:
                break
        else:
            level = u[N]
        if omega != current_omega or level != current_level:
            if H > 0 and not set_loads(tables, inputs, contacts, variation, loads, omega, level):
                end = BEYOND
                break
            current_omega, current_level = omega, level
        period = 2.0 * math.pi * multiple / omega
        d, dv = 0.0, 0.0
        for h in range(H):
            d += variation.base[h].real
            dv -= variation.multiple[h] * omega * variation.base[h].imag
        clear = phases_at_start(contacts, u[:N], d, dv, phases)
        state, guard = _number_of(tables, count, phases), -1
        if not clear or state < 0:
            end = NEW_START if clear else BEYOND
            break
        for i in range(N):
            y[i] = u[i]
        passages += 1
        waits = state < 0
        code, _, _, state, guard, n_seg, n_ev, _ = march(
            tables, inputs, None, None, begin, piece, period, state, guard, waits, y, log, limits.evaluations
        )
        if code != DONE:
            end = NEW_STATE if code == NEED_STATE else BEYOND
            break
        for i in range(N):
            slope[i] = 0.0
            for k in range(N + 1):
                sens[i, k] = 1.0 if i == k else 0.0
        carry_sensitivity(
            tables, inputs, contacts, variation, parameters, n_seg, log.time, log.length, log.state, log.piece, log.y,
            log.event_contact, sens, slope,
        )  # fmt: skip
        if moved > limits.same_scale:
            _fill_residual_scale(u, n, omega, limits.smallest, residual_scale)
        size = 0.0
        finite = True
        off = -target
        for i in range(N):
            b[i] = (y[i] - u[i]) / residual_scale[i]
            finite = finite and math.isfinite(b[i])
            size = max(size, abs(b[i]))
            for k in range(N + 1):
                a = sens[i, k]
                if i == k:
                    a -= 1.0
                if k == N and by_frequency:
                    a -= slope[i] * (period / omega)
                jacobian[i, k] = A[i, k] = a * scale[k] / residual_scale[i]
        for k in range(N + 1):
            A[N, k] = row[k]
            off += row[k] * w[k]
        if not finite:
            break
        good = size <= (limits.tolerance if iteration > 0 else limits.of_guess)
        good = good or (moved <= limits.settled and size <= limits.of_round_off)
        if good and abs(off) <= 1e-9 + limits.tolerance:
            end = CONVERGED
            break
        if iteration == limits.iterations or (iteration > 2 and size > 2.0 * last and size > 1e3 * limits.tolerance):
            break
        b[N] = off
        if not eliminate(A, order):
            break
        substitute(A, order, b)
        moved, distance = 0.0, 0.0
        for i in range(N + 1):
            w[i] -= b[i]
            moved += b[i] ** 2
            distance += (w[i] - guess[i] / scale[i]) ** 2
        moved, distance = math.sqrt(moved), math.sqrt(distance)
        if not math.isfinite(moved) or distance > limits.furthest:
            break
        last = size
        iteration += 1
    return end, iteration, size, n_seg, n_ev, state, guard, passages, current_omega, current_level
