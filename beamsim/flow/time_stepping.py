"""Time steppers that share nothing with the exact flow: Newmark, HHT and SciPy's DOP853, to compare a run with.

Newmark's method (average acceleration) and its HHT variant with numerical damping (Hilber, Hughes and Taylor, 1977),

.. math:: a_1 + (1+\\alpha)(C v_1 + K q_1 - F_1) - \\alpha(C v_0 + K q_0 - F_0) = (1+\\alpha) f_1 - \\alpha f_0,

solve each step in the space of the contacts: a force there changes the penetrations by a constant matrix, and the
phases of the laws are changed until no guard is violated at the end of the step. Contacts are found with the resolution
of a step.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from typing import Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings
from beamsim.dataclass import dataclass
from beamsim.flow.stopping import check_stop
from beamsim.inputs.signal import Signal
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Bools, Floats, Ints

HHT_ALPHA = -0.05
MOST_STEPS = 5_000_000
STEPS_OF_A_CALL = 1000  # between two looks at a request to stop
RTOL, ATOL = 1e-8, 1e-12  # of DOP853 by default


@dataclass(frozen=True)
class SteppedMotion:
    """A motion at the steps of a time stepper."""

    time: Floats  # (nt,) s
    displacement: Floats  # (nt, k) of the places asked for, relative
    velocity: Floats  # (nt, k)
    acceleration: Floats  # (nt, k)
    force: Floats  # (nt, m) of the contacts, N
    touching: Bools  # (nt, m)
    steps: int
    unsettled: int  # steps in which no phases of the contacts satisfy all guards
    processor_time_s: float
    outcome: Outcome = COMPLETE


@dataclass(frozen=True)
class _Problem:
    """A system as arrays: contacts first, then cubic springs, each a row of ``delta = P q - gap + felt d``."""

    system: PiecewiseLinearSystem
    forcing: Forcing
    cubic: CubicSprings
    base: Signal | None  # displacement
    rows: Floats  # (k, n)

    @property
    def projection(self) -> Floats:
        """(m + mc, n) P."""
        contacts = self.system.contacts
        return np.vstack([-contacts.sign[:, None] * contacts.shape, self.cubic.shape.reshape(-1, self.system.size)])

    @property
    def gap(self) -> Floats:
        """(m + mc,)."""
        return np.concatenate([self.system.contacts.gap, np.zeros(self.cubic.count)])

    @property
    def felt(self) -> Floats:
        """(m + mc,) share of the base's displacement in each penetration or stretch."""
        contacts = self.system.contacts
        return np.concatenate([-(contacts.felt * contacts.sign), self.cubic.felt])

    def loads(self, time: Floats) -> Floats:
        """(nt, n)."""
        total = np.tile(self.system.constant_load, (time.size, 1))
        for load, signal in zip(self.forcing.load, self.forcing.signal, strict=True):
            total += signal(time)[:, None] * load
        return total

    def base_motion(self, time: Floats) -> tuple[Floats, Floats]:
        """Displacement and velocity of the base, (nt,) each."""
        if self.base is None:
            return np.zeros(time.size), np.zeros(time.size)
        return self.base(time), self.base.derivative()(time)


def newmark(
    system: PiecewiseLinearSystem,
    forcing: Forcing,
    cubic: CubicSprings,
    base: Signal | None,
    start: Floats,
    duration: float,
    step: float,
    rows: Floats,
    alpha: float = 0.0,
) -> SteppedMotion:
    """Steps of one length to the end of a motion.

    Parameters
    ----------
    base : displacement of the base; None at rest.
    start : (N,) q, q' and internal states of the contacts, which may be left out where they are zero.
    step : s; the last one ends at or after ``duration``.
    rows : (k, n) places whose motion is recorded.
    alpha : of HHT, from -1/3 to 0; 0 is Newmark's average acceleration.

    Raises
    ------
    ValueError
        If the motion takes more than `MOST_STEPS` steps.
    Stopped
        On request, within `beamsim.flow.stopping.heeding`.
    """
    from beamsim.flow.time_stepping_kernels import contact_space, march_in_steps

    count = int(np.ceil(duration / step * (1 - 1e-9)))
    if count > MOST_STEPS:
        raise ValueError(f"takes {count:.3g} steps (at most {MOST_STEPS:.3g})")
    problem = _Problem(system, forcing, cubic, base, rows)
    n, arrays, projection = system.size, system.contacts.arrays, problem.projection
    beta, gamma = (1 - alpha) ** 2 / 4, (1 - 2 * alpha) / 2
    effective = np.eye(n) / (beta * step**2)
    effective += (1 + alpha) * (gamma / (beta * step) * system.damping + np.diag(system.stiffness))
    inverse: Floats = np.asarray(np.linalg.inv(effective), dtype=float)
    space = contact_space(projection, inverse)
    time: Floats = np.asarray(step * np.arange(count + 1), dtype=float)
    loads, (d, rate) = problem.loads(time), problem.base_motion(time)
    phases = system.contacts.resting_phases(_penetrations(problem, start[:n], d[0]))
    m = system.contacts.count
    motion = np.empty((3, count + 1, rows.shape[0]))
    force, record = np.zeros((count + 1, m)), np.zeros((count + 1, m), dtype=np.int64)
    laws = (
        arrays.force,
        arrays.guards,
        arrays.guard,
        arrays.next,
        arrays.resets,
        arrays.reset,
        arrays.dynamics,
        arrays.states,
    )

    every = m + cubic.count

    def march(total: int) -> int:
        carried = (
            start[:n].copy(), start[n : 2 * n].copy(), np.zeros(n), np.zeros(every), np.zeros(every), np.zeros(every),
            _internal(system.contacts, start[2 * n :]),
        )  # fmt: skip
        current, unsettled = phases.copy(), 0
        for first in range(0, total, STEPS_OF_A_CALL):
            check_stop()
            unsettled += march_in_steps(
                system.stiffness, system.damping, inverse, *space, projection, problem.gap, problem.felt, laws,
                cubic.stiffness, step, alpha, loads, d, rate, first, min(first + STEPS_OF_A_CALL, total), carried,
                current, rows, motion, force, record,
            )  # fmt: skip
        return unsettled

    march(2)  # compiles
    begin = clock.process_time()
    unsettled = march(count + 1)
    return SteppedMotion(
        time, motion[0], motion[1], motion[2], force, system.contacts.touching(record), count, unsettled,
        clock.process_time() - begin,
    )  # fmt: skip


def _penetrations(problem: _Problem, q: Floats, d: float) -> Floats:
    """(m,) of the contacts."""
    every = problem.projection @ q - problem.gap + problem.felt * d
    return every[: problem.system.contacts.count]


def _internal(contacts: Contacts, given: Floats) -> Floats:
    """(m, R) internal states of each contact from all of them (r,), zero where none are given."""
    every = given if given.size else np.zeros(contacts.internal_states)
    return np.array(contacts.own_internal(every[None])[0])


def dop853(
    system: PiecewiseLinearSystem,
    forcing: Forcing,
    cubic: CubicSprings,
    base: Signal | None,
    start: Floats,
    times: Floats,
    rows: Floats,
    rtol: float = RTOL,
    max_step: float = np.inf,
) -> SteppedMotion:
    """SciPy's DOP853, restarted where a guard changes sign and where a piece of the inputs begins.

    Parameters
    ----------
    times : (nt,) of the record, increasing from 0; the events are added to it.
    max_step : s. The others are those of `newmark`.

    Raises
    ------
    Stopped
        On request, within `beamsim.flow.stopping.heeding`.
    """
    from scipy.integrate import solve_ivp

    begin = clock.process_time()
    problem = _Problem(system, forcing, cubic, base, rows)
    n, contacts, arrays = system.size, system.contacts, system.contacts.arrays
    projection, gap, felt = problem.projection, problem.gap, problem.felt
    m, width = contacts.count, arrays.dynamics.shape[2]
    signals = (*forcing.signal, *(() if base is None else (base,)))
    end = float(times[-1])
    breaks = np.unique(np.concatenate([[end], *(s.start[(s.start > 0) & (s.start < end)] for s in signals)]))
    velocity_of_base = None if base is None else base.derivative()

    def quantities(t: float, y: Floats) -> Floats:
        """(m, 3 + R) penetration, its rate, 1 and internal states of each contact; and the stretch of cubic springs."""
        d = 0.0 if base is None else float(base(t))
        rate = 0.0 if velocity_of_base is None else float(velocity_of_base(t))
        out = np.ones((projection.shape[0], 3 + width))
        out[:, 0] = projection @ y[:n] - gap + felt * d
        out[:, 1] = projection @ y[n : 2 * n] + felt * rate
        out[:m, 3:] = y[2 * n :].reshape(m, width)
        return out

    def forces(x: Floats, phases: Ints) -> Floats:
        contact = np.sum(arrays.force[np.arange(m), phases] * x[:m], axis=1)
        return np.concatenate([contact, cubic.stiffness * x[m:, 0] ** 3])

    def slope(t: float, y: Floats, phases: Ints) -> Floats:
        check_stop()
        x = quantities(t, y)
        load = system.constant_load - system.stiffness * y[:n] - system.damping @ y[n : 2 * n]
        for row, signal in zip(forcing.load, forcing.signal, strict=True):
            load = load + float(signal(t)) * row
        inside = np.einsum("jrk,jk->jr", arrays.dynamics[np.arange(m), phases], x[:m])
        return np.concatenate([y[n : 2 * n], load - forces(x, phases) @ projection, inside.ravel()])

    def guard(j: int, i: int) -> Callable[..., float]:
        def value(t: float, y: Floats, phases: Ints) -> float:
            return float(arrays.guard[j, phases[j], i] @ quantities(t, y)[j])

        value.terminal = True  # type: ignore[attr-defined]
        value.direction = -1.0  # type: ignore[attr-defined]
        return value

    y = np.concatenate([start[: 2 * n], _internal(contacts, start[2 * n :]).ravel()])
    phases = contacts.resting_phases(quantities(0.0, y)[:m, 0])
    parts: list[tuple[Floats, Floats, Ints]] = []
    t, evaluations, outcome = 0.0, 0, COMPLETE
    while t < end and outcome.complete:
        watched = [(j, i) for j in range(m) for i in range(arrays.guards[j, phases[j]])]
        done: Any = solve_ivp(
            slope, (t, float(breaks[np.searchsorted(breaks, t, side="right")])), y, method="DOP853", rtol=rtol,
            atol=ATOL, max_step=max_step, events=[guard(*pair) for pair in watched] or None, args=(phases,),
            dense_output=True,
        )  # fmt: skip
        evaluations += int(done.nfev)
        at = np.unique(np.concatenate([times[(times >= t) & (times <= done.t[-1])], done.t]))
        parts.append((at, done.sol(at).T, np.tile(phases, (at.size, 1))))
        t, y = float(done.t[-1]), done.y[:, -1].copy()
        if done.status < 0:
            outcome = Outcome.of(
                OutcomeCode.INTEGRATOR_FAILED, integrator="DOP853", time=t, reason=str(done.message)
            )  # fmt: skip
        if done.status == 1:
            hit = next(g for g, instants in enumerate(done.t_events) if instants.size)
            j, i = watched[hit]
            if arrays.resets[j, phases[j], i]:
                y[2 * n + j * width : 2 * n + (j + 1) * width] = arrays.reset[j, phases[j], i] @ quantities(t, y)[j]
            phases = contacts.after(phases, j, int(arrays.next[j, phases[j], i]))
    time, states, record = (np.concatenate(column) for column in zip(*parts, strict=True))
    acceleration = np.array([slope(a, b, c)[n : 2 * n] for a, b, c in zip(time, states, record, strict=True)])
    force = np.array([forces(quantities(a, b), c)[:m] for a, b, c in zip(time, states, record, strict=True)])
    return SteppedMotion(
        time, states[:, :n] @ rows.T, states[:, n : 2 * n] @ rows.T, acceleration @ rows.T, force.reshape(-1, m),
        contacts.touching(record), evaluations, 0, clock.process_time() - begin, outcome,
    )  # fmt: skip
