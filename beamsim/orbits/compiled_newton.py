"""Newton's method for periodic motions under harmonic loads by :mod:`beamsim.orbits.newton_kernels`."""

from __future__ import annotations

import numpy as np

from beamsim.flow.march import EVALUATIONS_A_CALL, Log
from beamsim.flow.passage import Frequency, Level, Passage
from beamsim.flow.stopping import check_stop
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.continuation import SAME_SCALE, SETTLED, STIFF, UNTOUCHED, Converged, Settings
from beamsim.typing import Floats

MOST_SEGMENTS = 512  # of a motion; others are left to Python


class NotCompiled(Exception):
    """The motion is beyond the compiled method."""


def compiled_newton(
    flow: VariationalFlow,
    kind: Frequency | Level,
    omega: float,
    level: float,
    multiple: int,
    smallest: float,
    guess: Floats,
    row: Floats,
    target: float,
    scale: Floats,
    settings: Settings,
    furthest: float = np.inf,
) -> Converged | None:
    """The motion of ``multiple`` periods with ``row . (u / scale) = target``; None where the method does not converge.

    Parameters
    ----------
    kind : what the last unknown is.
    omega, level : rad/s, and factor of the loads, of which the last unknown takes the place of one.
    smallest : m, least size of a motion, in which the residual is measured.

    Raises
    ------
    NotCompiled
        Where a load may be in resonance, a motion has very many events, or begins on the border of two contact states.
    """
    from beamsim.orbits.newton_kernels import BEYOND, CONVERGED, NEW_START, NEW_STATE, NewtonLimits, solve_periodic

    check_stop()
    N = flow.size
    limits = NewtonLimits(
        settings.tolerance, UNTOUCHED * settings.tolerance, STIFF * settings.tolerance, SETTLED, SAME_SCALE,
        settings.iterations, float(furthest), smallest, EVALUATIONS_A_CALL,
    )  # fmt: skip
    phases, log = flow.system.contacts.start, Log.sized(MOST_SEGMENTS, N)
    u, y, slope = np.empty(N + 1), np.empty(N), np.empty(N)
    sens, jacobian = np.empty((N, N + 1)), np.empty((N, N + 1))
    while True:
        tables = flow.shooting_tables(kind)
        if tables is None:
            raise NotCompiled
        ended, iterations, residual, segments, events, state, guard, passages, at_omega, at_level = solve_periodic(
            *tables, limits, isinstance(kind, Frequency), omega, level, flow.omega, flow.level, multiple,
            np.ascontiguousarray(guess), row, target, scale, phases, log, u, y, sens, slope, jacobian,
        )  # fmt: skip
        flow.passages += passages
        flow.note_loads(at_omega, at_level)
        if ended == NEW_START:
            flow.state_index(phases)
        elif ended == NEW_STATE:
            flow.follow(state, guard)
        elif ended == BEYOND:
            raise NotCompiled
        elif ended != CONVERGED:
            return None
        else:
            break
    kept = log.first(segments, events)
    period = 2 * np.pi * multiple / (u[N] if isinstance(kind, Frequency) else omega)
    passage = Passage(
        u[:N].copy(), y, np.ascontiguousarray(sens[:, :N]), sens[:, N:], slope, float(period), kept.time.copy(),
        kept.length.copy(), kept.state.copy(), kept.y.copy(), kept.event_time.copy(), kept.event_contact.copy(),
        kept.event_phase.copy(),
    )  # fmt: skip
    return Converged(u, jacobian, float(residual), iterations, passage)
