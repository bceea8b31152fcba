r"""Time stepping with SciPy, restarted at contact events and breakpoints: the independent check of the exact flow.

It takes every contact law, and smooth nonlinearities (cubic springs), which have no closed form.

**Events.** Between two steps the state is the integrator's dense output, a polynomial in time, and so is each guard, as
no step is longer than `RADIANS` of the fastest input that moves one: there a polynomial of degree `DEGREE` is the input
to round-off. Its coefficients in Chebyshev polynomials bound it from below,

.. math:: g \ge c_0 - \sum_{k \ge 1} |c_k| ,

which shows most guards to be positive on the whole step; of the others all roots are computed. So nothing that the
integrator's solution does between two steps is missed. What remains is the error of that solution, which ``rtol`` and
``atol`` limit. None of this is used by the exact flow, whose search it checks.

**After an event** the integrator starts anew from the state after it, with which its next dense output begins, to
round-off. A guard that is below zero there acts at once. At one instant a contact does not return to a phase that it
has left: if a guard asks for that it must rise at once. The integration ends with an outcome, and not in silence, where
a guard is below zero at the end of a step.

**Faces that hold.** What an integrator adds to the velocity of a face that sticks is removed at each of its events.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import too_many_events
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Where, interruption, never, report_progress
from beamsim.system.equations import RowsOf
from beamsim.typing import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.integrate import DenseOutput, OdeSolution

DEGREE = 16  # of the polynomials that guards are, above that of any integrator's dense output (12)
RADIANS = 1.0  # of the fastest input that moves a guard, in a step
ROUND_OFF = 1e-14  # of the parts of a guard on a step: within it a guard is zero
AT_EVENT = 1e-9  # of its parts: how far after an event a guard may be below zero if it rises
SAME_INSTANT = 16.0 * float(np.finfo(float).eps)  # of a time: shorter pieces have no length
DECAYED = 1e-16  # of the amplitude of an input: what has decayed to that moves nothing
REAL_ROOT = 1e-6  # imaginary part: a double root is known to the root of round-off; a cut at no root does no harm
PEAKS = 1e-10  # of the value, to which peaks are located
STEPS_AT_ONCE = 256  # whose outputs are evaluated together
_POINTS = chebyshev.chebpts2(DEGREE + 1)  # from -1 to 1
_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_POINTS, DEGREE))

Powers = tuple[RowsOf, RowsOf, Floats]  # two factors (k,) and weights (k, 2): dissipated power and power in


@dataclass(frozen=True)
class ReferenceTrajectory:
    """A time-stepped motion at chosen output times, with its events."""

    flow: ExactFlow
    time: Floats  # (nt,) output times, s
    y: Floats  # (nt, N)
    phases: Ints  # (nt, m)
    input_work: Floats  # (nt,) J, integrated along
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


@dataclass(frozen=True)
class TimeStepping:
    """What is stepped in time, and how."""

    flow: ExactFlow
    integrator: str = "BDF"  # a method of ``solve_ivp``; the thesis used a stiff BDF
    rtol: float = 1e-8
    atol: float = 1e-12  # of mass-normalised displacements and velocities alike
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
    outcome: Outcome  # of the integration


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
        report_progress(progress, t / duration)
        return stop()

    while record.t < duration and outcome.complete:
        until = float(breaks[np.searchsorted(breaks, record.t, side="right")])
        equations.begin(record.t, record.phases, record.left)
        guard = equations.guard_below_zero(record.t, record.y)
        if guard is not None:
            record.meet(equations, guard)
        else:
            piece = _integrate(stepping, equations, (record.t, until), record.y, stopped)
            if piece.sol is not None:
                if observe is not None:
                    observe(piece, record.phases)
                record.advance(piece)
            if piece.outcome.complete and piece.guard is not None:
                record.meet(equations, piece.guard)
            outcome = piece.outcome
        if outcome.complete and len(record.events) > stepping.max_events:
            outcome = too_many_events(record.t, stepping.max_events)
    return record.trajectory(equations.count, outcome)


def _integrate(
    stepping: TimeStepping,
    equations: _Equations,
    span: tuple[float, float],
    y: Floats,
    must_stop: Callable[[float], bool],
) -> Piece:
    """The motion from a state (N + 2,) on, to the first event within a span, s."""
    import scipy.integrate

    solver = getattr(scipy.integrate, stepping.integrator)(
        equations, span[0], y, span[1], rtol=stepping.rtol, atol=stepping.atol, max_step=equations.longest_step
    )
    times, dense, guard, outcome = [span[0]], [], None, COMPLETE
    while solver.status == "running" and guard is None and outcome.complete:
        failure = solver.step()
        if failure:
            outcome = Outcome.of(
                OutcomeKind.STOPPED, "integrator_failed", f"the {stepping.integrator} integrator: {failure}",
                at=Where(times[-1], "s"),
            )  # fmt: skip
            break
        step = solver.dense_output()
        end, guard = equations.first_event(step)
        y = np.array(solver.y if guard is None else step(end))
        if end > times[-1]:
            times.append(end)
            dense.append(step)
        if must_stop(end):
            outcome = interruption(at=Where(end, "s"))
        elif guard is None:
            outcome = equations.check_guards(end, y)
    sol = scipy.integrate.OdeSolution(times, dense) if dense else None
    return Piece(np.array(times), sol, y, guard, outcome)


class _Record:
    """A motion while it is stepped: where it is, its outputs, and its events."""

    def __init__(self, flow: ExactFlow, initial_state: Floats, times: Floats) -> None:
        self.begun, self.restarts = processor_time(), 0
        self.flow, self.times, self.contacts = flow, times, flow.system.contacts
        N, m = flow.size, self.contacts.count
        self.y = np.pad(np.asarray(initial_state, dtype=float), (0, N - np.size(initial_state) + 2))
        begin = flow.begin(self.y[:N])
        self.phases, self.y[:N] = begin.phases, begin.state
        self.states, self.all_phases = np.empty((times.size, N + 2)), np.zeros((times.size, m), dtype=np.int64)
        self.states[0], self.all_phases[0] = self.y, self.phases
        self.done, self.t = int(times[0] == 0.0), 0.0  # outputs; s
        self.touched = np.zeros(m)  # s that each contact has touched
        made = np.flatnonzero(begin.contact_made).tolist()
        self.events = [(0.0, j, int(begin.phases_before[j]), int(self.phases[j])) for j in made]
        self.left: set[tuple[int, int]] = set()  # contacts and the phases that they have left at this instant

    def advance(self, piece: Piece) -> None:
        """Go to the end of a piece of the motion, with the outputs on the way."""
        assert piece.sol is not None
        end, self.restarts = float(piece.t[-1]), self.restarts + 1
        self.touched += self.contacts.closed(self.phases) * (end - self.t)
        last = int(np.searchsorted(self.times, end, side="right" if end >= self.times[-1] else "left"))
        if last > self.done:
            self.states[self.done : last] = piece.sol(self.times[self.done : last]).T
            self.all_phases[self.done : last] = self.phases
            self.done = last
        if end - self.t > SAME_INSTANT * end:
            self.left.clear()
        self.y, self.t = piece.y, end

    def meet(self, equations: _Equations, guard: int) -> None:
        """The event of a guard takes its contact to another phase."""
        contact, following = int(equations.events.contact[guard]), int(equations.events.next[guard])
        equations.reset(guard, self.t, self.y)
        before, self.phases = self.phases, self.contacts.phases_after(self.phases, contact, following)
        equations.stop(self.contacts.sticks_rigidly(before) | self.contacts.sticks_rigidly(self.phases), self.t, self.y)
        self.y[-2] += equations.lost(before, self.phases, self.t, self.y)
        self.events.append((self.t, contact, int(before[contact]), following))
        self.left.update((j, int(before[j])) for j in np.flatnonzero(before != self.phases).tolist())

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
        self.flow, self.powers, self.cubic = stepping.flow, stepping.powers, stepping.cubic
        self.count = 0
        base = [self.flow.forcing.signal[k] for k in self.flow.forcing.base_displacements]
        self.base = (base, [of.derivative() for of in base])

    def begin(self, t: float, phases: Ints, phases_left: set[tuple[int, int]]) -> None:
        """Go to the piece of the inputs that begins at a time or lasts then, and to phases of the contacts.

        Parameters
        ----------
        t : s.
        phases : (m,) of the contacts.
        phases_left : contacts and the phases that they have left at this instant, to which they do not return at once.
        """
        flow, sources = self.flow, self.flow.sources
        piece = max(int(np.searchsorted(sources.start, t, side="right")) - 1, 0)
        self.since, self.amplitude = sources.start[piece], sources.amplitude[piece]
        self.at = flow.at(phases)
        self.events, factors = self.at.events, [] if self.powers is None else [of(phases) for of in self.powers[:2]]
        self.rates = np.vstack([self.at.rates, *factors])
        self.weight = np.zeros((0, 2)) if self.powers is None else self.powers[2]
        following = zip(self.events.contact.tolist(), self.events.next.tolist(), strict=True)
        self.waiting = np.array([each in phases_left for each in following], dtype=bool)
        self.floor = np.zeros(self.events.count)  # of guards that wait until they have risen above zero
        self.longest_step = self._longest_step(t)

    def _longest_step(self, t: float) -> float:
        """s, in which the inputs that move a guard, themselves or through the state, turn by `RADIANS`."""
        exponent = self.flow.sources.exponent
        inputs = slice(self.flow.size, self.flow.size + exponent.size)
        slopes = slice(inputs.stop, None)
        rows = np.vstack([self.events.guards, self.rates[: self.flow.size]])
        moves = rows[:, inputs].any(axis=0) | rows[:, slopes].any(axis=0)
        moves &= (self.amplitude != 0.0) & (exponent.real * (t - self.since) > np.log(DECAYED))
        fastest = float(np.abs(exponent[moves]).max(initial=0.0)) if self.events.count else 0.0
        return RADIANS / fastest if fastest else np.inf

    def _known(self, times: Floats, y: Floats) -> Floats:
        """(nt, N + 2 F) what outputs are linear in: states (nt, N), inputs and their slopes."""
        tau, exponent, power = (times - self.since)[:, None], self.flow.sources.exponent, self.flow.sources.power
        growth = self.amplitude * np.exp(exponent * tau)
        if power.any():
            inputs = growth * tau**power
            slopes = exponent * inputs + power * growth * tau ** np.maximum(power - 1, 0)
        else:
            inputs, slopes = growth, exponent * growth
        return np.concatenate([y[:, : self.flow.size], inputs.real, slopes.real], axis=1)

    def _pulls(self, t: float, y: Floats) -> tuple[Floats, float]:
        """Forces of the cubic springs, N, and the power, W, that the base's motion puts into them."""
        assert self.cubic is not None
        extension = self.cubic.shape @ y[: self.flow.system.size]
        if not self.base[0]:
            return self.cubic.stiffness * extension**3, 0.0
        displacement, velocity = (np.array([float(of(t)) for of in motions]) for motions in self.base)
        pulls = self.cubic.stiffness * (extension + self.cubic.base_influence @ displacement) ** 3
        return pulls, float(pulls @ self.cubic.base_influence @ velocity)

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

    def guards(self, times: Floats, y: Floats) -> tuple[Floats, Floats]:
        """(nt, g) guards in states (nt, N), which fall through zero at events, and (g,) the size of their parts."""
        rows, known = self.events.guards, self._known(times, y)
        return known @ rows.T, (np.abs(known) @ np.abs(rows).T).max(axis=0)

    def guard_below_zero(self, t: float, y: Floats) -> int | None:
        """The guard that acts at once in a state (N + 2,), as that of a face which stops and cannot hold; None where
        none does.

        Of several it is the lowest. One that is below zero by what an event is known to, and rises, has to rise above
        zero before it acts; so has one that would lead back to a phase that was left at this instant, or
        one that is zero at the start.
        """
        values, parts = self.guards(np.array([t]), y[None])
        value = values[0]
        below = value < -ROUND_OFF * parts
        if t == 0.0:  # the phases are those in which the motion goes on: a guard that is zero is about to rise
            self.waiting |= np.abs(value) <= ROUND_OFF * parts
        if not below.any():
            return None
        inputs = self.flow.inputs_at(np.array([t]), 2, np.array([self.since]))[0, 1]
        rises = self.events.guards @ np.append(self(t, y)[: self.flow.size], inputs) > 0.0
        self.waiting |= below & rises & (value >= -AT_EVENT * parts)
        self.floor = np.where(self.waiting, np.minimum(value, 0.0), 0.0)
        acting = np.where(below & ~self.waiting, value, 0.0)
        joining = acting[: self.events.joining_count]
        acting = joining if joining.any() else acting
        return int(acting.argmin()) if acting.any() else None

    def first_event(self, step: DenseOutput) -> tuple[float, int | None]:
        """Time of the first event in a step of the integrator, s, with its guard; the end of the step if none."""
        if not self.events.count:
            return float(step.t), None
        half = 0.5 * (step.t - step.t_old)
        times = step.t_old + half * (1.0 + _POINTS)
        times[-1] = step.t
        values, parts = self.guards(times, step(times).T)
        round_off = ROUND_OFF * parts
        coefficient = _COEFFICIENTS @ (values + round_off)
        doubtful = np.flatnonzero(coefficient[0] <= np.abs(coefficient[1:]).sum(axis=0)).tolist()
        found = [(falls_through_zero(coefficient[:, g], after_rise=bool(self.waiting[g])), g) for g in doubtful]
        share, guard = min(found, default=(np.inf, -1))
        if share <= 1.0:
            return float(step.t_old + half * (1.0 + share)), guard
        self.waiting &= values[-1] <= round_off
        self.floor[~self.waiting] = 0.0
        return float(step.t), None

    def check_guards(self, t: float, y: Floats) -> Outcome:
        """What comes of a state (N + 2,) at the end of a step in which no event was found: no guard is below zero."""
        values, parts = self.guards(np.array([t]), y[None])
        below = np.where(values[0] < self.floor - ROUND_OFF * parts, values[0], 0.0)
        if not below.any():
            return COMPLETE
        contact = int(self.events.contact[below.argmin()])
        return Outcome.of(
            OutcomeKind.STOPPED, "guard_below_zero",
            f"contact {contact + 1} is past a border of its phase by {-below.min():.2g}, and no event was found",
            at=Where(t, "s"), remedy="compare again with a smaller tolerance",
        )  # fmt: skip

    def stop(self, sticking: Bools, t: float, y: Floats) -> None:
        """Remove what the integrator has left of the velocities of contacts (m,) that stick rigidly, in y."""
        held, n = np.flatnonzero(sticking), self.flow.system.size
        if held.size:
            rows = self.flow.equations.penetration_rate[held]
            left = rows @ self._known(np.array([t]), y[None])[0]
            y[n : 2 * n] -= np.linalg.pinv(rows[:, n : 2 * n], rcond=1e-10) @ left

    def reset(self, guard: int, t: float, y: Floats) -> None:
        """Start the internal states of a guard's contact anew, in y, where its event does so."""
        if self.events.reset_row[guard] >= 0:
            y[: self.flow.size] = self.at.state_after(guard) @ self._known(np.array([t]), y[None])[0]

    def lost(self, phases_before: Ints, phases_after: Ints, t: float, y: Floats) -> float:
        """Energy that the contacts lose at once where their phases change, J."""
        contacts = self.flow.system.contacts
        lost = contacts.event_losses(phases_before[None], phases_after[None]).sum()
        if contacts.pressed_contacts.size:
            normal = self.flow.at(phases_after).normal_force @ self._known(np.array([t]), y[None])[0]
            lost += (contacts.pressing_losses(phases_before[None], phases_after[None]) * normal**2).sum()
        return float(lost)


def falls_through_zero(coefficient: Floats, *, after_rise: bool = False) -> float:
    """Where a polynomial first is below zero.

    Parameters
    ----------
    coefficient : (k,) of Chebyshev polynomials on [-1, 1].
    after_rise : whether a root counts only after the polynomial has exceeded zero by more than the integrator's error.

    Returns
    -------
    float
        The root from which it falls, -1 where it is below zero from the start; infinite where it does not fall.

    Examples
    --------
    >>> falls_through_zero(np.array([0.5, -1.0]))  # 0.5 - x
    0.5
    >>> falls_through_zero(np.array([1.0, -1.0])), falls_through_zero(np.array([-2.0, 0.0]), after_rise=True)
    (inf, inf)
    """
    from scipy.optimize import brentq

    size = float(np.abs(coefficient).max())
    roots = chebyshev.chebroots(chebyshev.chebtrim(coefficient, float(np.finfo(float).eps) * size))
    cuts = np.sort(roots.real[(np.abs(roots.imag) < REAL_ROOT) & (np.abs(roots.real) < 1.0)])
    edges = np.concatenate([[-1.0], cuts, [1.0]])
    before, above, risen = -1.0, not after_rise, AT_EVENT * size if after_rise else 0.0
    for x in np.append(0.5 * (edges[1:] + edges[:-1]), 1.0).tolist():
        value = float(chebyshev.chebval(x, coefficient))
        if value < 0.0 and above:
            if chebyshev.chebval(before, coefficient) <= 0.0:
                return before
            return float(brentq(chebyshev.chebval, before, x, args=(coefficient,), xtol=1e-15))
        above |= value > risen
        before = x
    return np.inf


class Extremes(NamedTuple):
    """Extreme values of K outputs and their times, s."""

    low: Floats  # (K,)
    when_low: Floats
    high: Floats
    when_high: Floats


class StepExtremes:
    r"""Lowest and highest values of outputs over the steps shown so far, of which there is one at least when asked.

    On a step an output is a polynomial, :math:`f \le c_0 + \sum_{k \ge 1} |c_k|`; where that exceeds what is known it
    is evaluated at the roots of its slope.
    """

    def __init__(self) -> None:
        self.found: Extremes | None = None

    def add(self, piece: Piece, outputs: Callable[[Floats, Floats], Floats]) -> None:
        """The steps of a piece that has a length.

        Parameters
        ----------
        piece : of a motion.
        outputs : takes times (nt,) and states (nt, N + 2) and returns values (nt, K).
        """
        assert piece.sol is not None
        for first in range(0, len(piece.sol.interpolants), STEPS_AT_ONCE):
            ends = piece.t[first : first + STEPS_AT_ONCE + 1]
            times = ends[:-1, None] + 0.5 * np.diff(ends)[:, None] * (1.0 + _POINTS)
            steps = piece.sol.interpolants[first : first + STEPS_AT_ONCE]
            y = np.concatenate([step(at).T for step, at in zip(steps, times, strict=True)])
            values = outputs(times.ravel(), y).reshape(*times.shape, -1)
            if self.found is None:
                found = (np.full(values.shape[2], x) for x in (np.inf, ends[0], -np.inf, ends[0]))
                self.found = Extremes(*found)
            low, when_low, high, when_high = self.found
            _raise(-low, when_low, -values, times, low, -1.0)
            _raise(high, when_high, values, times, high, 1.0)


def _raise(
    largest: Floats, largest_times: Floats, values: Floats, times: Floats, values_of_sign: Floats, sign: float
) -> None:
    """Take the largest values of some steps into those known.

    Parameters
    ----------
    largest : (K,) largest values so far.
    largest_times : (K,) s, their times; written.
    values, times : (steps, DEGREE + 1, K) at the Chebyshev points, and (steps, DEGREE + 1) s.
    values_of_sign, sign : (K,) written with the sign.
    """
    samples = values.reshape(-1, values.shape[2])
    best = samples.argmax(axis=0)
    top = np.take_along_axis(samples, best[None], axis=0)[0]
    coefficient = _COEFFICIENTS @ values
    bound = coefficient[:, 0] + np.abs(coefficient[:, 1:]).sum(axis=1)
    higher = np.flatnonzero(top > largest)
    largest[higher], largest_times[higher] = top[higher], times.ravel()[best[higher]]
    for step, k in np.argwhere(bound > largest + PEAKS * np.abs(largest)).tolist():
        if bound[step, k] <= largest[k] + PEAKS * abs(largest[k]):  # another step has a higher value
            continue
        slope = chebyshev.chebder(coefficient[step, :, k])
        roots = chebyshev.chebroots(chebyshev.chebtrim(slope, float(np.finfo(float).eps) * np.abs(slope).max()))
        inside = roots.real[np.abs(roots.real) < 1.0]
        tops = chebyshev.chebval(inside, coefficient[step, :, k])
        if tops.size and tops.max() > largest[k]:
            largest[k] = tops.max()
            begin, end = times[step, [0, -1]]
            largest_times[k] = begin + 0.5 * (end - begin) * (1.0 + inside[tops.argmax()])
    values_of_sign[:] = sign * largest
