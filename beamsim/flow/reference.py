"""Time stepping with SciPy, restarted at contact events and breakpoints: the independent check of the exact flow.

It also runs smooth nonlinearities (cubic springs), which have no closed form. Unlike the exact flow, it
finds contacts only by sign changes between its steps, so a contact shorter than a step can be missed.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.flow.contact_state import LinearOutput, OutputOf, held_contacts
from beamsim.flow.exact import ExactFlow
from beamsim.flow.march import too_many_events
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Where, interruption, never
from beamsim.typing import Bools, Floats, Ints

Powers = tuple[OutputOf, OutputOf, Floats]  # two factors (k,) and weights (k, 2): dissipated power and power in


@dataclass(frozen=True)
class ReferenceTrajectory:
    """A time-stepped motion at chosen output times, with its events."""

    flow: ExactFlow
    time: Floats  # (nt,) output times, s
    y: Floats  # (nt, N)
    phases: Ints  # (nt, m)
    work_in: Floats  # (nt,) J, integrated along
    dissipated: Floats  # (nt,) J, integrated along
    event_time: Floats  # (E,)
    event_contact: Ints  # (E,)
    event_phase: Ints  # (E,) of the contact after the event
    evaluations: int  # of the right-hand side
    restarts: int
    end: float
    contact_share: Floats  # (m,) of the time up to there, from the located events
    outcome: Outcome
    processor_time_s: float

    @property
    def touch_changes(self) -> Ints:
        """(E,) 1 where contact is made, -1 where it ends, 0 at other changes of phase."""
        return self.flow.system.contacts.touch_changes(
            self.phases[:1].reshape(-1), self.event_time, self.event_contact, self.event_phase
        )

    @property
    def event_closing(self) -> Bools:
        """(E,) whether contact is made at the event."""
        return np.asarray(self.touch_changes > 0)


@dataclass(frozen=True)
class TimeStepping:
    """What is stepped in time, and how."""

    flow: ExactFlow
    integrator: str = "BDF"  # a method of ``solve_ivp``; the thesis used a stiff BDF
    rtol: float = 1e-8
    atol: float = 1e-12  # of mass-normalised displacements and velocities alike
    max_step: float = np.inf  # s
    cubic: CubicSprings | None = None  # smooth springs
    powers: Powers | None = None  # integrated along
    max_events: int = 1_000_000


def integrate(
    stepping: TimeStepping,
    initial_state: Floats,
    times: Floats,
    *,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
    observe: Callable[[Any, Ints], None] | None = None,
) -> ReferenceTrajectory:
    """Integrate from t = 0 through the increasing output ``times`` with ``scipy.integrate.solve_ivp``.

    Parameters
    ----------
    stepping : what is stepped, and how.
    initial_state : (N,) or without the internal states.
    times : (nt,) output times, s.
    progress : called with the share of the duration that is done.
    stop : called after every step; the integration ends there if it returns True.
    observe : called with every piece of the solution (``solve_ivp``'s, with dense output) and the contacts' phases.

    Returns
    -------
    ReferenceTrajectory
        Up to where it ended, with its outcome.
    """
    from scipy.integrate import solve_ivp

    duration, sources, outcome = float(times[-1]), stepping.flow.sources, COMPLETE
    right_hand_side, record = _RightHandSide(stepping), _Record(stepping.flow, initial_state, times)
    breaks = np.append(sources.start[(sources.start > 0) & (sources.start < duration)], duration)
    while True:
        t = record.t
        until = float(breaks[np.searchsorted(breaks, t, side="right")]) if t < duration else duration
        right_hand_side.begin(t, record.phases)
        solution = solve_ivp(  # type: ignore[call-overload]
            right_hand_side, (t, until), record.y, method=stepping.integrator, rtol=stepping.rtol, atol=stepping.atol,
            max_step=stepping.max_step, events=[*right_hand_side.events(), _stopping(stop, t)], dense_output=True,
        )  # fmt: skip
        if solution.status < 0:
            outcome = Outcome.of(
                OutcomeKind.STOPPED, "integrator_failed", f"the {stepping.integrator} integrator: {solution.message}",
                at=Where(float(solution.t[-1]), "s"),
            )  # fmt: skip
        if observe is not None and solution.t[-1] > t:
            observe(solution, record.phases)
        record.advance(solution)
        if solution.status == 1:
            hit = next(g for g, happened in enumerate(solution.t_events) if happened.size)
            if hit == right_hand_side.watched.guards:
                outcome = interruption(at=Where(record.t, "s"))
                break
            right_hand_side.reset(hit, record.t, record.y)
            record.meet(int(right_hand_side.watched.contact[hit]), int(right_hand_side.watched.following[hit]))
            if len(record.events) > stepping.max_events:
                outcome = too_many_events(record.t, len(record.events))
        if progress is not None:
            progress(record.t / duration)
        if record.t >= duration or not outcome.complete:
            break
    return record.trajectory(right_hand_side.count, outcome)


class _Record:
    """A motion while it is stepped: where it is, its outputs, and its events."""

    def __init__(self, flow: ExactFlow, initial_state: Floats, times: Floats) -> None:
        self.begun, self.restarts = clock.process_time(), 0
        self.flow, self.times, self.contacts = flow, times, flow.system.contacts
        N, m = flow.size, self.contacts.count
        self.y = np.concatenate([flow.whole_state(np.asarray(initial_state, dtype=float)), np.zeros(2)])
        self.phases, entered, self.y[:N] = flow.begin(self.y[:N])
        self.states, self.all_phases = np.empty((times.size, N + 2)), np.zeros((times.size, m), dtype=np.int64)
        self.done, self.t, self.touched = 0, 0.0, np.zeros(m)  # outputs; s; s that each contact has touched
        self.events = [(0.0, j, int(self.phases[j])) for j in np.flatnonzero(entered).tolist()]

    def advance(self, solution: Any) -> None:
        """Go to the end of a piece of the solution, with the outputs on the way."""
        end, self.restarts = float(solution.t[-1]), self.restarts + 1
        self.touched += self.contacts.touching(self.phases) * (end - self.t)
        last = int(np.searchsorted(self.times, end, side="right" if end >= self.times[-1] else "left"))
        if last > self.done:
            self.states[self.done : last] = solution.sol(self.times[self.done : last]).T
            self.all_phases[self.done : last] = self.phases
            self.done = last
        self.y, self.t = solution.y[:, -1].copy(), end

    def meet(self, contact: int, following: int) -> None:
        """An event takes a contact to another phase."""
        before, self.phases = self.phases, self.contacts.after(self.phases, contact, following)
        self.y[-2] += self.contacts.event_losses(before[None], self.phases[None]).sum()
        self.events.append((self.t, contact, following))

    def trajectory(self, evaluations: int, outcome: Outcome) -> ReferenceTrajectory:
        """What there is of the motion."""
        time, contact, phase = (list(of) for of in zip(*self.events, strict=True)) if self.events else ([], [], [])
        return ReferenceTrajectory(
            self.flow,
            self.times[: self.done],
            self.states[: self.done, : self.flow.size],
            self.all_phases[: self.done],
            self.states[: self.done, -1],
            self.states[: self.done, -2],
            np.array(time, dtype=float),
            np.array(contact, dtype=np.int64),
            np.array(phase, dtype=np.int64),
            evaluations,
            self.restarts,
            self.t,
            self.touched / self.t if self.t > 0 else self.touched,
            outcome,
            clock.process_time() - self.begun,
        )


class _RightHandSide:
    """Rates of (q, q', internal states), and dissipated power and power in, with contacts in given phases."""

    def __init__(self, stepping: TimeStepping) -> None:
        cubic = stepping.cubic
        self.flow, self.powers = stepping.flow, stepping.powers
        self.cubic = None if cubic is None or not cubic.count else cubic
        self.count = 0
        base = self.flow.forcing.base_displacement
        self.base = None if base is None else (base, base.derivative())

    def begin(self, t: float, phases: Ints) -> None:
        """Change the time from which sources count, and the contacts' phases."""
        flow, contacts = self.flow, self.flow.system.contacts
        self.since = np.array([t])
        self.watched = contacts.watched(phases)
        self.functions = flow.watched(self.watched, phases)
        self.rates = flow.rates(phases)
        self.factors = None if self.powers is None else tuple(of(phases) for of in self.powers[:2])
        if self.cubic is not None:
            held, pushes = held_contacts(flow.system, phases), -self.cubic.shape
            reactions = np.zeros((pushes.shape[0], contacts.count))
            if held is not None:
                reactions[:, held.contact] = pushes @ held.share.T
                pushes = held.free(pushes)
            self.pushes, self.reactions = pushes, reactions[:, self.watched.contact] * self.watched.joint[:, 2]

    def _values(self, output: LinearOutput, t: float, y: Floats) -> Floats:
        values, slopes = np.split(self.flow.inputs_at(np.array([t]), since=self.since)[:, 0], 2, axis=1)
        return np.asarray(output.values(y[None, : self.flow.size], values, slopes)[0])

    def _pulls(self, t: float, y: Floats) -> tuple[Floats, float]:
        """Forces of the cubic springs, N, and the power, W, that the base's motion puts into them."""
        assert self.cubic is not None
        stretch = self.cubic.shape @ y[: self.flow.system.size]
        if self.base is None:
            return self.cubic.stiffness * stretch**3, 0.0
        displacement, velocity = (float(of(t)) for of in self.base)
        pulls = self.cubic.stiffness * (stretch + self.cubic.felt * displacement) ** 3
        return pulls, float(pulls @ self.cubic.felt) * velocity

    def __call__(self, t: float, y: Floats) -> Floats:
        self.count += 1
        n, rates, power = self.flow.system.size, self._values(self.rates, t, y), np.zeros(2)
        if self.powers is not None and self.factors is not None:
            left, right = (self._values(factor, t, y) for factor in self.factors)
            power = (left * right) @ self.powers[2]
        if self.cubic is not None:
            pulls, through = self._pulls(t, y)
            rates[n : 2 * n] += pulls @ self.pushes
            power[1] += through
        return np.concatenate([rates, power])

    def reset(self, guard: int, t: float, y: Floats) -> None:
        """Start the internal states of a guard's contact anew, in y, where its event does so."""
        column, contacts, contact = self.watched.reset[guard], self.flow.system.contacts, self.watched.contact[guard]
        if column >= 0:
            first, count = 2 * self.flow.system.size + contacts.first[contact], contacts.states[contact]
            y[first : first + count] = self._values(self.functions.some(slice(column, column + count)), t, y)

    def events(self) -> list[Callable[[float, Floats], float]]:
        return [self._event(guard) for guard in range(self.watched.guards)]

    def _event(self, guard: int) -> Callable[[float, Floats], float]:
        """Passes zero where the guard lies below it by more than the round-off of its parts, so that a contact whose
        two sides move together at no distance does not open and close without end."""
        function = self.functions.some(slice(guard, guard + 1))
        parts = np.abs(np.concatenate([function.row, function.direct, function.direct_slope], axis=1)[0])

        def value(t: float, y: Floats) -> float:
            inputs = self.flow.inputs_at(np.array([t]), since=self.since)[0, 0]
            # 1e-15: of the parts of a guard, that a sum of them is known to
            floor = 1e-15 * float(parts @ np.abs(np.concatenate([y[: self.flow.size], inputs])))
            pulled = 0.0 if self.cubic is None else float(self._pulls(t, y)[0] @ self.reactions[:, guard])
            return float(self._values(function, t, y)[0]) + pulled + floor

        value.terminal = True  # type: ignore[attr-defined]
        value.direction = -1.0  # type: ignore[attr-defined]
        return value


def _stopping(stop: Callable[[], bool], begin: float) -> Callable[[float, Floats], float]:
    """An event within the step after which ``stop`` says so."""
    before, cut = begin, np.inf

    def value(t: float, _: Floats) -> float:
        nonlocal before, cut
        if cut == np.inf:
            if t > before and stop():
                cut = 0.5 * (before + t)
            else:
                before = t
                return 1.0
        return cut - t

    value.terminal = True  # type: ignore[attr-defined]
    value.direction = -1.0  # type: ignore[attr-defined]
    return value
