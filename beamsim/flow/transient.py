"""The exact transient: the compiled march from contact to contact, without time-stepping error."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Floats

LOG_LENGTH = 2048  # segments between two reports of progress


def simulate(
    flow: ExactFlow,
    initial_state: Floats,
    *,
    duration: float | None = None,
    max_events: int = 1_000_000,
    max_evaluations: int = 2_000_000_000,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """The motion from a state at t = 0, (q, q') and any internal states of the contacts, without time-stepping error.

    Contacts are found by the certified march of :mod:`beamsim.flow.kernels`. The work is bounded: a motion
    with more than ``max_events`` events or ``max_evaluations`` evaluations of the watched functions ends early,
    with an outcome that says so.

    Returns
    -------
    Trajectory : segments, events and counters; sample it for outputs.
    """
    from beamsim.flow import kernels

    _load_kernels()
    begin = clock.process_time()
    duration = flow.duration if duration is None else duration
    y = flow.whole_state(np.asarray(initial_state, dtype=float))
    state = flow.state_index(flow.starting_state(y))
    logs: list[tuple[NDArray[np.generic], ...]] = []
    events: list[tuple[NDArray[np.generic], ...]] = []
    t, n_events, evaluations, outcome = 0.0, 0, 0, COMPLETE
    length, guard = 64, -1
    while t < duration:
        length = min(length, max_events + 1 - n_events)
        code, t, state, guard, n_eval, seg, ev = _advance(
            flow, t, duration, state, guard, y, length, max_evaluations - evaluations
        )
        evaluations += n_eval
        logs.append(seg)
        events.append(ev)
        n_events += ev[0].size
        if code == kernels.BUDGET:
            outcome = Outcome.of(OutcomeCode.EVALUATION_LIMIT, time=t, evaluations=evaluations)
            break
        if n_events > max_events:
            outcome = Outcome.of(OutcomeCode.EVENT_LIMIT, time=t, events=n_events)
            break
        if progress is not None:
            progress(t / duration)
        length = min(max(64, 2 * length), LOG_LENGTH)
    processor = clock.process_time() - begin
    if not any(seg[0].size for seg in logs):  # out of budget within the first segment: at least the start is known
        one = np.zeros(1, dtype=np.int64)
        logs.append((np.zeros(1), np.zeros(1), one + state, one, y[None, :].copy()))
    merged = [np.concatenate(column) for column in zip(*logs, strict=True)]
    happened = [np.concatenate(column) for column in zip(*events, strict=True)]
    return Trajectory(flow, t, *merged, *happened, y, evaluations, outcome, processor)  # type: ignore[call-arg, arg-type]


def _advance(
    flow: ExactFlow,
    t: float,
    t_end: float,
    state: int,
    guard: int,
    y: Floats,
    length: int,
    most_evaluations: int,
) -> tuple[int, float, int, int, int, tuple[NDArray[np.generic], ...], tuple[NDArray[np.generic], ...]]:
    """One call of the kernel with logs of ``length`` segments; builds the next contact state where it is missing."""
    from beamsim.flow import kernels

    seg = (
        np.empty(length), np.empty(length), np.empty(length, np.int64), np.empty(length, np.int64),
        np.empty((length, y.size)),
    )  # fmt: skip
    ev = (np.empty(length + 1), np.empty(length + 1, np.int64), np.empty(length + 1, np.int64))
    tables = flow.tables()
    code, t, state, n_seg, n_ev, n_eval, guard = kernels.advance(
        tables, flow.inputs(), t, t_end, state, guard, y, *seg, *ev, most_evaluations
    )
    if code == kernels.NEED_STATE:
        contact = tables.guard_contact[state, guard]
        state = flow.follow(state, guard)
        ev[0][n_ev], ev[1][n_ev], ev[2][n_ev] = t, contact, flow.states[state].phases[contact]
        n_ev += 1
    return code, t, state, guard, n_eval, tuple(a[:n_seg] for a in seg), tuple(a[:n_ev] for a in ev)


@cache
def _load_kernels() -> None:
    """Compile the kernels, or load them from the cache, once per process and outside every measured time."""
    from beamsim.contacts.contacts import Contacts
    from beamsim.contacts.laws import kelvin_voigt

    one = np.ones(1)
    contacts = Contacts(np.ones((1, 1)), one, one, np.zeros(1, dtype=bool), (kelvin_voigt(1.0),))
    system = PiecewiseLinearSystem(one, np.zeros((1, 1)), contacts, np.zeros(1))
    flow = ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 1.0)
    y = np.zeros(2)
    _advance(flow, 0.0, 0.0, flow.state_index(flow.starting_state(y)), -1, y, 1, 1)
