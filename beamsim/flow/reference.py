"""Time stepping with SciPy, restarted at contact events and breakpoints: the independent check of the exact flow.

It takes every contact law, and smooth nonlinearities (cubic springs), which have no closed form. Unlike the exact flow
it looks for events on the integrator's dense output, `LOOKS` times a step: a contact between two looks can be missed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.flow.compiled import processor_time
from beamsim.flow.contact_state import LinearOutput, OutputOf
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import too_many_events
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Where, interruption, never, tell
from beamsim.typing import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.integrate import DenseOutput, OdeSolution

LOOKS = 8  # for events, in a step

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
    event_before: Ints  # (E,) phase of the contact before the event
    event_phase: Ints  # (E,) after it
    evaluations: int  # of the right-hand side
    segments: int  # between events
    end: float
    contact_share: Floats  # (m,) of the time up to there, from the located events
    outcome: Outcome
    processor_time_s: float

    @property
    def states(self) -> int:
        """Number of contact states at the output times."""
        return len(np.unique(self.phases, axis=0))

    @property
    def touch_changes(self) -> Ints:
        """(E,) 1 where contact is made, -1 where it ends, 0 at other changes of phase."""
        return self.flow.system.contacts.touch_changes(self.event_contact, self.event_before, self.event_phase)

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


@dataclass(frozen=True)
class Piece:
    """A motion in one contact state, up to an event, a breakpoint of the inputs, the end of the motion or where it
    failed."""

    t: Floats  # (steps + 1,) s, no step of a motion without length
    sol: OdeSolution | None  # (N + 2,) at times of a motion that has a length
    y: Floats  # (N + 2,) at its end
    guard: int | None  # that ends it
    failure: str  # of the integrator
    interrupted: bool


def integrate(
    stepping: TimeStepping,
    initial_state: Floats,
    times: Floats,
    *,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
    observe: Callable[[Piece, Ints], None] | None = None,
) -> ReferenceTrajectory:
    """Integrate from t = 0 over the duration of the flow with an integrator of `scipy.integrate`.

    Parameters
    ----------
    stepping : what is stepped, and how.
    initial_state : (N,) or without the internal states.
    times : (nt,) output times, s, increasing.
    progress : called with the share of the duration that is done.
    stop : called after every step; the integration ends there if it returns True.
    observe : called with every piece that has a length, and the contacts' phases.

    Returns
    -------
    ReferenceTrajectory
        Up to where it ended, with its outcome.
    """
    duration, sources, outcome = max(stepping.flow.duration, float(times[-1])), stepping.flow.sources, COMPLETE
    equations, record = _Equations(stepping), _Record(stepping.flow, initial_state, times)
    breaks = np.append(sources.start[(sources.start > 0) & (sources.start < duration)], duration)

    def stopped(t: float) -> bool:
        tell(progress, t / duration)
        return stop()

    while record.t < duration and outcome.complete:
        until = float(breaks[np.searchsorted(breaks, record.t, side="right")])
        equations.begin(record.t, record.phases)
        piece = _solved(stepping, equations, (record.t, until), record.y, stopped)
        if piece.sol is not None:
            if observe is not None:
                observe(piece, record.phases)
            record.advance(piece)
        if piece.failure:
            outcome = Outcome.of(
                OutcomeKind.STOPPED, "integrator_failed", f"the {stepping.integrator} integrator: {piece.failure}",
                at=Where(record.t, "s"),
            )  # fmt: skip
        elif piece.interrupted:
            outcome = interruption(at=Where(record.t, "s"))
        elif piece.guard is not None:
            record.meet(equations, piece.guard)
            if len(record.events) > stepping.max_events:
                outcome = too_many_events(record.t, stepping.max_events)
    return record.trajectory(equations.count, outcome)


def _solved(
    stepping: TimeStepping,
    equations: _Equations,
    span: tuple[float, float],
    y: Floats,
    stopped: Callable[[float], bool],
) -> Piece:
    """The motion from a state (N + 2,) on, to the first event within a span, s."""
    import scipy.integrate

    solver = getattr(scipy.integrate, stepping.integrator)(
        equations, span[0], y, span[1], rtol=stepping.rtol, atol=stepping.atol, max_step=stepping.max_step
    )
    times, dense, guard, failure, interrupted = [span[0]], [], None, "", False
    while solver.status == "running" and guard is None and not interrupted:
        failure = solver.step() or ""
        if failure:
            break
        step = solver.dense_output()
        end, guard = equations.first_event(step)
        y = solver.y if guard is None else step(end)
        if end > times[-1]:
            times.append(end)
            dense.append(step)
        interrupted = stopped(end)
    sol = scipy.integrate.OdeSolution(times, dense) if dense else None
    return Piece(np.array(times), sol, np.array(y), guard, failure, interrupted)


class _Record:
    """A motion while it is stepped: where it is, its outputs, and its events."""

    def __init__(self, flow: ExactFlow, initial_state: Floats, times: Floats) -> None:
        self.begun, self.restarts = processor_time(), 0
        self.flow, self.times, self.contacts = flow, times, flow.system.contacts
        N, m = flow.size, self.contacts.count
        self.y = np.concatenate([flow.whole_state(np.asarray(initial_state, dtype=float)), np.zeros(2)])
        begin = flow.begin(self.y[:N])
        self.phases, self.y[:N] = begin.phases, begin.state
        self.states, self.all_phases = np.empty((times.size, N + 2)), np.zeros((times.size, m), dtype=np.int64)
        self.states[0], self.all_phases[0] = self.y, self.phases
        self.done, self.t = int(times[0] == 0.0), 0.0  # outputs; s
        self.touched = np.zeros(m)  # s that each contact has touched
        made = np.flatnonzero(begin.made).tolist()
        self.events = [(0.0, j, int(begin.before[j]), int(self.phases[j])) for j in made]

    def advance(self, piece: Piece) -> None:
        """Go to the end of a piece of the motion, with the outputs on the way."""
        assert piece.sol is not None
        end, self.restarts = float(piece.t[-1]), self.restarts + 1
        self.touched += self.contacts.touching(self.phases) * (end - self.t)
        last = int(np.searchsorted(self.times, end, side="right" if end >= self.times[-1] else "left"))
        if last > self.done:
            self.states[self.done : last] = piece.sol(self.times[self.done : last]).T
            self.all_phases[self.done : last] = self.phases
            self.done = last
        self.y, self.t = piece.y, end

    def meet(self, equations: _Equations, guard: int) -> None:
        """The event of a guard takes its contact to another phase."""
        contact, following = (int(of[guard]) for of in (equations.watched.contact, equations.watched.following))
        equations.reset(guard, self.t, self.y)
        before, self.phases = self.phases, self.contacts.after(self.phases, contact, following)
        self.y[-2] += equations.lost(before, self.phases, self.t, self.y)
        self.events.append((self.t, contact, int(before[contact]), following))

    def trajectory(self, evaluations: int, outcome: Outcome) -> ReferenceTrajectory:
        """What there is of the motion."""
        events = np.array(self.events).reshape(-1, 4)
        contact, before, after = events[:, 1:].T.astype(np.int64)
        return ReferenceTrajectory(
            self.flow,
            self.times[: self.done],
            self.states[: self.done, : self.flow.size],
            self.all_phases[: self.done],
            self.states[: self.done, -1],
            self.states[: self.done, -2],
            events[:, 0],
            contact,
            before,
            after,
            evaluations,
            self.restarts,
            self.t,
            self.touched / self.t if self.t > 0 else self.touched,
            outcome,
            processor_time() - self.begun,
        )


class _Equations:
    """Rates of (q, q', internal states), of what is dissipated and put in, and the guards, in one contact state and on
    one piece of the inputs."""

    def __init__(self, stepping: TimeStepping) -> None:
        cubic = stepping.cubic
        self.flow, self.powers = stepping.flow, stepping.powers
        self.cubic = None if cubic is None or not cubic.count else cubic
        self.count = 0
        base = self.flow.forcing.base_displacement
        self.base = None if base is None else (base, base.derivative())

    def begin(self, t: float, phases: Ints) -> None:
        """Go to the piece of the inputs that begins at a time or lasts then, and to the phases (m,) of the contacts."""
        flow, sources = self.flow, self.flow.sources
        piece = max(int(np.searchsorted(sources.start, t, side="right")) - 1, 0)
        self.since, self.amplitude = sources.start[piece], sources.amplitude[piece]
        self.watched = flow.system.contacts.watched(phases)
        self.functions = _matrix(flow.watched(self.watched, phases))
        factors = [] if self.powers is None else [of(phases) for of in self.powers[:2]]
        self.rates = np.vstack([_matrix(of) for of in (flow.rates(phases), *factors)])
        self.weight = np.zeros((0, 2)) if self.powers is None else self.powers[2]

    def _known(self, times: Floats, y: Floats) -> Floats:
        """(nt, N + 2 F) what outputs are linear in: states (nt, N), inputs and their slopes."""
        tau, exponent, power = (times - self.since)[:, None], self.flow.sources.exponent, self.flow.sources.power
        growth = self.amplitude * np.exp(exponent * tau)
        inputs = growth * tau**power
        slopes = exponent * inputs + power * growth * tau ** np.maximum(power - 1, 0)
        return np.concatenate([y[:, : self.flow.size], inputs.real, slopes.real], axis=1)

    def _pulls(self, t: float, y: Floats) -> tuple[Floats, float]:
        """Forces of the cubic springs, N, and the power, W, that the base's motion puts into them."""
        assert self.cubic is not None
        stretch = self.cubic.shape @ y[: self.flow.system.size]
        if self.base is None:
            return self.cubic.stiffness * stretch**3, 0.0
        displacement, velocity = (float(of(t)) for of in self.base)
        pulls = self.cubic.stiffness * (stretch + self.cubic.base_influence * displacement) ** 3
        return pulls, float(pulls @ self.cubic.base_influence) * velocity

    def __call__(self, t: float, y: Floats) -> Floats:
        self.count += 1
        n, size = self.flow.system.size, self.flow.size
        values = self.rates @ self._known(np.array([t]), y[None])[0]
        left, right = values[size:].reshape(2, -1)
        rates = np.concatenate([values[:size], (left * right) @ self.weight])
        if self.cubic is not None:
            pulls, through = self._pulls(t, y)
            rates[n : 2 * n] -= pulls @ self.cubic.shape
            rates[-1] += through
        return rates

    def guards(self, times: Floats, y: Floats) -> Floats:
        """(nt, g) guards in states (nt, N), which fall through zero at events.

        They do so where they lie below it by more than the round-off of their parts, so that a contact whose two sides
        move together at no distance does not open and close without end.
        """
        rows, known = self.functions[: self.watched.guards], self._known(times, y)
        # 1e-15: of the parts of a guard, that a sum of them is known to
        return np.asarray(known @ rows.T + 1e-15 * np.abs(known) @ np.abs(rows).T)

    def first_event(self, step: DenseOutput) -> tuple[float, int | None]:
        """Time of the first event in a step, s, with its guard; the end of the step where there is none.

        A guard that lies below zero from the start on acts there, that of a face which stops and does not hold, for
        example; of several the lowest.
        """
        from scipy.optimize import brentq

        if not self.watched.guards:
            return float(step.t), None
        times = np.linspace(step.t_old, step.t, LOOKS + 1)
        values = self.guards(times, step(times).T)
        falling = values[1:] <= 0.0
        falling[1:] &= values[1:-1] >= 0.0
        if not falling.any():
            return float(step.t), None
        look = int(falling.any(axis=1).argmax())
        at_once = np.where(falling[0], values[0], 0.0)
        if at_once.min() < 0.0:
            return float(step.t_old), int(at_once.argmin())

        a, b, eps = float(times[look]), float(times[look + 1]), 4.0 * float(np.finfo(float).eps)
        ends = {a: values[look], b: values[look + 1]}  # whose round-off another product of the matrices would change

        def guard(t: float, g: int) -> float:
            return float((ends[t] if t in ends else self.guards(np.array([t]), step(np.array([t])).T)[0])[g])

        fallen = np.flatnonzero(falling[look]).tolist()
        return min((float(brentq(guard, a, b, args=(g,), xtol=eps, rtol=eps)), g) for g in fallen)

    def reset(self, guard: int, t: float, y: Floats) -> None:
        """Start the internal states of a guard's contact anew, in y, where its event does so."""
        column, contacts, contact = self.watched.reset[guard], self.flow.system.contacts, self.watched.contact[guard]
        if column >= 0:
            first, count = 2 * self.flow.system.size + contacts.first[contact], contacts.states[contact]
            y[first : first + count] = self.functions[column : column + count] @ self._known(np.array([t]), y[None])[0]

    def lost(self, before: Ints, after: Ints, t: float, y: Floats) -> float:
        """Energy that the contacts lose at once where their phases change, J."""
        contacts = self.flow.system.contacts
        lost = contacts.event_losses(before[None], after[None]).sum()
        if contacts.pressed.size:
            normal = _matrix(self.flow.pressing_forces(after)) @ self._known(np.array([t]), y[None])[0]
            lost += (contacts.pressing_losses(before[None], after[None]) * normal**2).sum()
        return float(lost)


def _matrix(output: LinearOutput) -> Floats:
    """(k, N + 2 F) an output's factors of the states, the inputs and their slopes."""
    return np.concatenate([output.row, output.direct, output.direct_slope], axis=1)
