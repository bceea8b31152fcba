"""Time stepping with SciPy, restarted at contact events and breakpoints: the independent check of the exact flow.

It also runs smooth nonlinearities (cubic springs), which have no closed form. Unlike the exact flow, it
finds contacts only by sign changes between its steps, so a contact shorter than a step can be missed.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from typing import Any

import numpy as np

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.contacts.laws import Guard
from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.exact import ExactFlow
from beamsim.flow.held import held_contacts
from beamsim.flow.stopping import never
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.typing import Bools, Floats, Ints

ROUND_OFF = 1e-15  # of the parts of a guard, that a sum of them is known to


@dataclass(frozen=True)
class ReferenceTrajectory:
    """A time-stepped motion at chosen output times, with its events."""

    flow: ExactFlow
    time: Floats  # (nt,) output times, s
    y: Floats  # (nt, N)
    phases: Ints  # (nt, m)
    work_in: Floats  # (nt,) J, integrated along
    dissipated: Floats  # (nt,) J, integrated along
    power_in: Floats  # (nt,) W
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

    def sample(self, output_of: OutputOf) -> Floats:
        """Outputs (nt, k) at the output times."""
        return sampled(self.flow, self.time, self.y, self.phases, output_of)


def sampled(
    flow: ExactFlow,
    times: Floats,
    y: Floats,
    phases: Ints,
    output_of: OutputOf,
    since: float | None = None,
) -> Floats:
    """Outputs of a time-stepped motion.

    Parameters
    ----------
    flow : the system and its sources.
    times : (nt,) s.
    y : (nt, N) states.
    phases : (nt, m) of the contacts.
    output_of : the outputs in given phases.
    since : s, time whose sources count; by default those at the times themselves.

    Returns
    -------
    values : (nt, k).

    Raises
    ------
    ValueError
        Without times.
    """
    value, slope = _source_values(flow, times, times if since is None else np.full(times.size, since))
    out: Floats | None = None
    for key in np.unique(phases, axis=0):
        here = np.all(phases == key, axis=1)
        output = output_of(key)
        part = y[here] @ output.row.T + value[here] @ output.direct.T + slope[here] @ output.direct_slope.T
        if out is None:
            out = np.zeros((times.size, part.shape[1]))
        out[here] = part
    if out is None:
        raise ValueError("no output times")
    return out


def integrate(
    flow: ExactFlow,
    initial_state: Floats,
    times: Floats,
    *,
    integrator: str = "BDF",
    rtol: float = 1e-8,
    atol: float = 1e-12,
    max_step: float = np.inf,
    cubic: CubicSprings | None = None,
    max_events: int = 1_000_000,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
    observe: Callable[[Any, Ints], None] | None = None,
) -> ReferenceTrajectory:
    """Integrate from t = 0 through the increasing output ``times`` with ``scipy.integrate.solve_ivp``.

    Parameters
    ----------
    integrator : a method of ``solve_ivp``; the thesis used a stiff BDF.
    rtol, atol : as in SciPy; atol acts on mass-normalised displacements and velocities alike.
    stop : called after every step; the integration ends there if it returns True.
    observe : called with every piece of the solution (``solve_ivp``'s, with dense output) and the contacts' phases.
    """
    from scipy.integrate import solve_ivp

    begin = clock.process_time()
    N, contacts = flow.size, flow.system.contacts
    right_hand_side = _RightHandSide(flow, cubic)
    duration = float(times[-1])
    y = np.concatenate([flow.whole_state(np.asarray(initial_state, dtype=float)), np.zeros(2)])
    phases, entered, y[:N] = flow.begin(y[:N])
    breaks = np.append(flow.sources.start[(flow.sources.start > 0) & (flow.sources.start < duration)], duration)
    Y = np.empty((times.size, N + 2))
    C = np.zeros((times.size, contacts.count), dtype=np.int64)
    done, t, restarts, outcome = 0, 0.0, 0, COMPLETE
    touched = np.zeros(contacts.count)  # s
    first = np.flatnonzero(entered)
    ev_time: list[float] = [0.0] * first.size
    ev_contact: list[int] = first.tolist()
    ev_phase: list[int] = phases[first].tolist()
    while True:
        until = float(breaks[np.searchsorted(breaks, t, side="right")]) if t < duration else duration
        right_hand_side.begin(t, phases)
        solution = solve_ivp(  # type: ignore[call-overload]
            right_hand_side, (t, until), y, method=integrator, rtol=rtol, atol=atol, max_step=max_step,
            events=[*right_hand_side.events(), _stopping(stop, t)], dense_output=True,
        )  # fmt: skip
        restarts += 1
        if solution.status < 0:
            outcome = Outcome.of(
                OutcomeCode.INTEGRATOR_FAILED,
                integrator=integrator, time=float(solution.t[-1]), reason=str(solution.message),
            )  # fmt: skip
        end = float(solution.t[-1])
        if observe is not None and end > t:
            observe(solution, phases)
        touched += contacts.touching(phases) * (end - t)
        last = int(np.searchsorted(times, end, side="right" if end >= duration else "left"))
        if last > done:
            Y[done:last] = solution.sol(times[done:last]).T
            C[done:last] = phases
            done = last
        y = solution.y[:, -1].copy()
        t = end
        if solution.status == 1:
            hit = next(g for g, happened in enumerate(solution.t_events) if happened.size)
            if hit == len(right_hand_side.guards):
                outcome = Outcome.of(OutcomeCode.INTERRUPTED, parameter=t, unit="s")
                break
            contact, guard = right_hand_side.guards[hit]
            right_hand_side.reset(contact, guard, t, y)
            before, phases = phases, contacts.after(phases, contact, guard.next)
            y[-1] += contacts.event_losses(before[None], phases[None]).sum()
            ev_time.append(t)
            ev_contact.append(contact)
            ev_phase.append(guard.next)
            if len(ev_time) > max_events:
                outcome = Outcome.of(OutcomeCode.EVENT_LIMIT, time=t, events=len(ev_time))
        if progress is not None:
            progress(t / duration)
        if t >= duration or not outcome.complete:
            break
    return ReferenceTrajectory(
        flow,
        times[:done],
        Y[:done, :N],
        C[:done],
        Y[:done, -2],
        Y[:done, -1],
        right_hand_side.power_in(times[:done], Y[:done], C[:done]),
        np.array(ev_time),
        np.array(ev_contact, dtype=np.int64),
        np.array(ev_phase, dtype=np.int64),
        right_hand_side.count,
        restarts,
        t,
        touched / t if t > 0 else touched,
        outcome,
        clock.process_time() - begin,
    )


class _RightHandSide:
    """y' of (q, q', internal states) with contacts in given phases; written apart from the exact flow on purpose."""

    def __init__(self, flow: ExactFlow, cubic: CubicSprings | None) -> None:
        self.flow = flow
        self.cubic = cubic
        self.count = 0
        system, sources = flow.system, flow.sources
        self.n = system.size
        self.load = np.zeros((sources.count, self.n))
        for f in range(1, sources.count):
            if sources.channel[f] < len(flow.forcing.signal):
                self.load[f] = flow.forcing.load[sources.channel[f]]
        self.base_displacement = flow.forcing.base_displacement
        self.base_velocity = None if self.base_displacement is None else self.base_displacement.derivative()
        self.base = (sources.channel == flow.base_channel) & (flow.base_channel >= 0)
        self.piece = 0
        self.guards: list[tuple[int, Guard]] = []
        self.reactions = np.zeros(system.contacts.count)  # of those that hold, at the last evaluation

    def begin(self, t: float, phases: Ints) -> None:
        """Change the time from which sources count, and the contacts' phases."""
        starts = self.flow.sources.start
        self.piece = max(int(np.searchsorted(starts, t, side="right")) - 1, 0)
        c = self.flow.system.contacts
        self.guards = [
            (j, guard) for j, (law, k) in enumerate(zip(c.laws, phases, strict=True)) for guard in law.phases[k].guards
        ]
        self.row, self.internal_row = c.force_rows(phases)
        self.own_rates, self.driven_rates = c.internal_rates(phases)
        self.loss, self.internal_loss = c.losses(phases)
        self.friction = c.friction(phases)
        self.held = held_contacts(self.flow.system, phases)

    def _sources(self, t: float) -> tuple[Floats, Floats]:
        """(F,) values of the sources and of their time derivatives, of the piece that acts."""
        sources, piece = self.flow.sources, [self.piece]
        value, slope = sources.values_after(sources.amplitude[piece], t - sources.start[piece])
        return value[0], slope[0]

    def _contact(self, t: float, y: Floats) -> tuple[Floats, Floats]:
        c = self.flow.system.contacts
        value, slope = self._sources(t)
        d, d_rate = float(value[self.base].sum()), float(slope[self.base].sum())
        delta = -c.gap - c.sign * (c.shape @ y[: self.n] + c.felt * d)
        rate = -c.sign * (c.shape @ y[self.n : 2 * self.n] + c.felt * d_rate)
        return delta, rate

    def __call__(self, t: float, y: Floats) -> Floats:
        self.count += 1
        system, c, n = self.flow.system, self.flow.system.contacts, self.n
        q, v, p = y[:n], y[n : 2 * n], y[2 * n : -2]
        value, slope = self._sources(t)
        delta, rate = self._contact(t, y)
        force = self.row[:, 0] * delta + self.row[:, 1] * rate + self.row[:, 2] + self.internal_row @ p
        outside = system.constant_load + value @ self.load
        inside = -system.stiffness * q
        through = 0.0  # power that the base's motion puts into cubic springs to the ground
        if self.cubic is not None and self.cubic.count:
            base = 0.0 if self.base_displacement is None else float(self.base_displacement(t))
            pull = self.cubic.stiffness * (self.cubic.shape @ q + self.cubic.felt * base) ** 3
            inside = inside - pull @ self.cubic.shape
            if self.base_velocity is not None:
                through = float(pull @ self.cubic.felt) * float(self.base_velocity(t))
        resisted = system.damping @ v
        acceleration = inside + outside - resisted + (force * c.sign) @ c.shape
        if self.held is not None:
            self.reactions[self.held.contact] = self.held.share @ acceleration
            acceleration = self.held.free(acceleration)
        drive = self.driven_rates
        p_rate = self.own_rates @ p + drive[:, :, 0] @ delta + drive[:, :, 1] @ rate + drive[:, :, 2].sum(axis=1)
        moved = c.felt * slope[self.base].sum()
        power = outside @ v - (force * c.sign) @ moved + through
        loss = v @ resisted + (self.loss * rate + self.friction) @ rate + self.internal_loss @ p_rate**2
        return np.concatenate([v, acceleration, p_rate, [power, loss]])

    def power_in(self, times: Floats, y: Floats, phases: Ints) -> Floats:
        """(nt,) power of the loads and of the moving base at states (nt, N) with contacts in phases (nt, m)."""
        system, c, n = self.flow.system, self.flow.system.contacts, self.n
        q, v, p = y[:, :n], y[:, n : 2 * n], y[:, 2 * n : -2]
        value, slope = _source_values(self.flow, times, times)
        base, base_rate = (x[:, self.base].sum(axis=1, keepdims=True) * c.felt for x in (value, slope))
        delta, rate = -c.gap - c.sign * (q @ c.shape.T + base), -c.sign * (v @ c.shape.T + base_rate)
        power = ((system.constant_load + value @ self.load) * v).sum(axis=1)
        power -= (c.forces(phases, delta, rate, p) * c.sign * base_rate).sum(axis=1)
        if self.cubic is not None and self.base_displacement is not None and self.base_velocity is not None:
            felt = self.cubic.felt
            stretch = q @ self.cubic.shape.T + felt * self.base_displacement(times)[:, None]
            power += (self.cubic.stiffness * stretch**3) @ felt * self.base_velocity(times)
        return np.asarray(power)

    def _value(self, contact: int, row: Floats, t: float, y: Floats) -> float:
        """A linear function of a contact's penetration, its rate, 1 and its internal states."""
        c = self.flow.system.contacts
        delta, rate = self._contact(t, y)
        first, r = 2 * self.n + c.first[contact], c.states[contact]
        motion = np.concatenate([[delta[contact], rate[contact], 1.0, 0.0, 0.0, 0.0], y[first : first + r]])
        return float(row @ motion)

    def reset(self, contact: int, guard: Guard, t: float, y: Floats) -> None:
        """Start the contact's internal states anew, in y, where the guard says so."""
        if guard.reset is not None:
            first = 2 * self.n + self.flow.system.contacts.first[contact]
            new = [self._value(contact, row.array(len(guard.reset)), t, y) for row in guard.reset]
            y[first : first + len(new)] = new

    def events(self) -> list[Callable[[float, Floats], float]]:
        return [self._event(contact, guard) for contact, guard in self.guards]

    def _event(self, contact: int, guard: Guard) -> Callable[[float, Floats], float]:
        """Passes zero where the guard lies below it by more than the round-off of its parts, so that a contact whose
        two sides move together at no distance does not open and close without end."""
        contacts = self.flow.system.contacts
        row = guard.row.array(contacts.laws[contact].internal_states)
        shape, gap = np.abs(contacts.shape[contact]), abs(float(contacts.gap[contact]))

        def value(t: float, y: Floats) -> float:
            size = np.abs(y[: 2 * self.n]).reshape(2, self.n) @ shape
            parts = abs(row[0]) * (gap + size[0]) + abs(row[1]) * size[1]
            floor = ROUND_OFF * (parts + abs(row[2]))
            if guard.row.reaction:
                self(t, y)
                return float(self._value(contact, row, t, y) + guard.row.reaction * self.reactions[contact] + floor)
            return float(self._value(contact, row, t, y) + floor)

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


def _source_values(flow: ExactFlow, times: Floats, since: Floats) -> tuple[Floats, Floats]:
    """(nt, F) real values of the sources and of their time derivatives, of the pieces at the times ``since``."""
    s = flow.sources
    piece = np.maximum(np.searchsorted(s.start, since, side="right") - 1, 0)
    return s.values_after(s.amplitude[piece], times - s.start[piece])
