"""The exact transient: the compiled march from contact to contact, without time-stepping error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.march import Log, March, Motion
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import never
from beamsim.typing import Floats


def simulate(
    flow: ExactFlow,
    initial_state: Floats,
    *,
    duration: float | None = None,
    max_events: int = 1_000_000,
    max_evaluations: int = 2_000_000_000,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
) -> Trajectory:
    """The motion from a state at t = 0, (q, q') and any internal states of the contacts, without time-stepping error.

    Contacts are found by the certified march of :mod:`beamsim.flow.march_kernels`. The work is bounded: a motion
    with more than ``max_events`` events or ``max_evaluations`` evaluations of the watched functions ends early,
    with an outcome that says so, as does one that ``stop`` ends, which is asked several times a second.

    A contact that begins at t = 0, where its gap is just closed, is the first event. One that is pressed there was in
    contact before and has none.

    Parameters
    ----------
    flow : the system under its forcing.
    initial_state : (2n,) at least; internal states that are left out are zero.
    duration : s; that of the flow by default.
    max_events, max_evaluations : where it ends early.
    progress : called with the share that is done.
    stop : asked whether to end.

    Returns
    -------
    Trajectory : segments and events; sample it for outputs.
    """
    end = float(flow.duration if duration is None else duration)
    march = March(
        max_events=max_events, max_evaluations=max_evaluations, stop=stop,
        progress=None if progress is None else lambda t: progress(t / end),
    )  # fmt: skip
    motion, begun = start(flow, initial_state)
    return motion_of(flow, motion, Log.join([begun, march.on(flow, motion, end)]), march)


def start(flow: ExactFlow, initial_state: Floats) -> tuple[Motion, Log]:
    """A motion at t = 0, and the events of the contacts that begin at this very time."""
    y = flow.whole_state(np.asarray(initial_state, dtype=float))
    phases, entered, y = flow.begin(y)
    first = np.flatnonzero(entered)
    begun = Log.sized(0, y.size)._replace(
        event_time=np.zeros(first.size), event_contact=first, event_phase=phases[first]
    )  # fmt: skip
    return Motion.beginning(y, flow.state_index(phases)), begun


def motion_of(flow: ExactFlow, motion: Motion, log: Log, march: March) -> Trajectory:
    """The trajectory of a motion up to where it got.

    Parameters
    ----------
    flow, motion : the motion after the march.
    log : its segments and events.
    march : how it ended, and what it took.

    Returns
    -------
    The motion up to its end, or up to where it leaves the range of floating-point numbers.
    """
    if not log.time.size:  # out of budget within the first segment: at least the start is known
        one = np.zeros(1, dtype=np.int64)
        log = log._replace(
            time=np.array([motion.time]), length=np.zeros(1), state=flow.visits(one + motion.state), piece=one,
            y=motion.y[None, :].copy(),
        )  # fmt: skip
    trajectory = Trajectory(flow, motion.time, *log, motion.y, march.evaluations, march.outcome)
    return trajectory if np.all(np.isfinite(motion.y)) else trajectory.up_to_finite()
