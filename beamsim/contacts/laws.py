r"""Contact laws as sets of phases.

While a phase lasts, the normal force is linear in the penetration :math:`\delta`, its rate and the law's internal
states p,

.. math:: N = k\,\delta + c\,\dot\delta + N_0 + h^T p, \qquad \dot p = A\,p + b_\delta\,\delta + b_r\,\dot\delta + b_0 .

The energy stored is :math:`k\delta^2/2 + (N_0 - R)\delta + \delta\,h^T p + p^T S p/2 + s^T p + E_0`, the power lost
:math:`c\,\dot\delta^2 + R\,\dot\delta + \sum_i l_i \dot p_i^2`, R being the part of N_0 whose work is lost. A phase
lasts while its guards, linear in :math:`\delta`, :math:`\dot\delta`, p and 1, stay positive. The guard that reaches
zero first names the phase that follows; where the law needs it, the internal states start there from an affine
function of the same quantities. A law of another kind is another list of phases, nothing else changes:

* a *table* of forces: one phase a segment, as in :func:`piecewise_linear`, with the offset N_0;
* a *Maxwell branch* of stiffness k and relaxation time tau: one internal state with A = -1/tau, b_delta = 1/tau,
  and a force k (delta - p), so h = -k and k is added to the phase's stiffness; S = k, l = k tau;
* a law that *never pulls*: one more guard on each phase that touches, the force itself;
* *friction* with a tangential spring (:mod:`beamsim.contacts.friction`): delta is the tangential motion; sticking is a
  phase with a stiffness (the slider is an internal state that rests), sliding in either direction one with a constant
  force, whose work is lost;
* *friction* without one: sticking is a phase that holds, whatever its force has to be, and its guards are those of the
  force;
* friction under the *force of another contact*: what is proportional to that force is written as ``pressing``, and the
  phases say which one follows where the other contact ends and begins;
* *kinematic hardening* (:mod:`beamsim.contacts.hardening`): the two together, an elastic phase and one for yielding in
  either direction, whose resets set the slider where yielding ends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.typing import Complexes, Floats

SMALLEST_JUMP = 1e-12  # of the terms it is made of: a smaller jump of the force at a guard is round-off


@dataclass(frozen=True)
class Guard:
    """A function that is positive while its phase lasts, and the phase that follows.

    It is ``penetration * delta + rate * delta' + internal @ p + constant``. ``reset`` gives the internal states with
    which the next phase starts: one row (penetration, rate, 1, then one factor for each internal state) for each of
    them; None where they go on as they are. ``loss`` is the energy that is lost at the event, J, and ``reaction`` the
    factor of the force in a phase that holds.

    Of a contact that another one presses: the function has ``pressing`` times that one's force besides, and
    ``pressing_rate`` times its rate; the first internal state starts with ``reset_pressing`` times it besides, and
    ``pressing_loss`` times its square is lost.
    """

    next: int
    penetration: float = 0.0
    rate: float = 0.0
    constant: float = 0.0
    internal: tuple[float, ...] = ()
    reset: tuple[tuple[float, ...], ...] | None = None
    loss: float = 0.0
    reaction: float = 0.0
    pressing: float = 0.0
    pressing_rate: float = 0.0  # s
    reset_pressing: float = 0.0  # m/N
    pressing_loss: float = 0.0  # m/N

    def row(self, internal_states: int) -> Floats:
        """(3 + r,) factors of the penetration, its rate, 1, and the internal states."""
        return _row(self.penetration, self.rate, self.constant, self.internal, internal_states)


@dataclass(frozen=True)
class Phase:
    """One phase of a law; see the module's equations."""

    name: str
    guards: tuple[Guard, ...]
    touching: bool  # shown to users as closed; of friction whether it sticks
    stiffness: float = 0.0  # N/m
    dashpot: float = 0.0  # N s/m
    force: float = 0.0  # N, at zero penetration
    internal: tuple[float, ...] = ()  # (r,) h
    dynamics: tuple[tuple[float, ...], ...] = ()  # (r, r) A, 1/s
    drive: tuple[tuple[float, float, float], ...] = ()  # (r, 3) b_delta, b_r, b_0
    stored: tuple[tuple[float, ...], ...] = ()  # (r, r) S, N/m, symmetric
    stored_linear: tuple[float, ...] = ()  # (r,) s, N
    losses: tuple[float, ...] = ()  # (r,) l, N s/m
    energy: float = 0.0  # J, E_0
    friction: float = 0.0  # N, R
    holds: bool = False  # the force is what keeps the penetration at its value, and the numbers above are zero
    pressing: float = 0.0  # factor of the force of the contact that presses it, whose work is lost
    compliance: float = 0.0  # m/N, of a spring that this force strains
    kept: tuple[float, float] | None = None  # m, m/N: a state to be started from again has its internal state at the
    # penetration plus the first plus so much of the pressing force, which tells the phase; None: it tells it as it is
    when_pressed: int | None = None  # phase that follows where the contact that presses it begins to touch
    when_released: int | None = None  # and where that ends

    def row(self, internal_states: int) -> Floats:
        """(3 + r,) factors of the force, as those of a guard."""
        return _row(self.stiffness, self.dashpot, self.force, self.internal, internal_states)

    @property
    def coupled(self) -> bool:
        """Whether internal states and structure move together: one drives the other."""
        return any(self.internal) or any(any(row[:2]) for row in self.drive)


@dataclass(frozen=True)
class OneSidedSpring:
    """A spring and dashpot that push while ``direction * delta - offset`` is positive."""

    direction: float  # +1 or -1
    stiffness: float  # N/m; negative where a piecewise-linear force softens
    dashpot: float  # N s/m
    offset: float  # m


@dataclass(frozen=True)
class ContactLaw:
    """Phases, and what follows from them.

    Parameters
    ----------
    phases : all of them; guards name them by their place here.
    internal_states : r, the same in every phase.
    start : phase from which the one that belongs to a given motion is looked for.
    sliding : where `start` holds, the phases in which motions begin whose penetration rises, and falls.
    parts : one-sided springs whose forces add up to the law's; None where there are none (internal states, phases that
        end by the force).
    stiffness, dashpot : those of slow motions in contact, from which natural frequencies follow.
    static : one-sided springs that push as the law does after a long rest; by default `parts`, or else one spring of
        the stiffness.
    settled : the internal states after a long rest at a penetration, m; zero by default.
    resting_force : force that does not fade in a long rest and that no static spring gives, N: that of a face that
        sticks.
    undamped_law : the law without its dashpots, where it is another one; None where there is none.
    family : makes a law of this kind from other numbers, where it is made of these two; then paths and derivatives may
        change them.
    """

    phases: tuple[Phase, ...]
    internal_states: int = 0
    start: int = 0
    sliding: tuple[int, int] | None = None
    parts: tuple[OneSidedSpring, ...] | None = None
    stiffness: float = np.nan
    dashpot: float = np.nan
    static: tuple[OneSidedSpring, ...] | None = None
    settled: Callable[[float], tuple[float, ...]] | None = None
    resting_force: float = 0.0
    undamped_law: ContactLaw | None = None
    family: Callable[[float, float], ContactLaw] | None = None

    def __post_init__(self) -> None:
        for phase in self.phases:
            following = [g.next for g in phase.guards]
            if any(not 0 <= k < len(self.phases) for k in following):
                raise ValueError(f"a guard of phase {phase.name!r} names a phase that the law does not have")
            if len(set(following)) < len(following):
                raise ValueError(f"two guards of phase {phase.name!r} name the same phase")

    @property
    def static_springs(self) -> tuple[OneSidedSpring, ...]:
        """One-sided springs that push as the law does after a long rest at any penetration."""
        if self.static is not None:
            return self.static
        return self.parts if self.parts is not None else (OneSidedSpring(1.0, self.stiffness, 0.0, 0.0),)

    def static_force(self, penetration: Floats) -> Floats:
        """Forces after a long rest at penetrations, N, of any shape."""
        delta = np.asarray(penetration, dtype=float)
        force = np.zeros_like(delta)
        for s in self.static_springs:
            force += s.direction * s.stiffness * np.maximum(s.direction * delta - s.offset, 0.0)
        return force

    def static_penetration(self, force: float) -> float:
        """m, at which the law of a stop pushes with a positive force, N, after a long rest."""
        springs = sorted(self.static_springs, key=lambda s: s.offset)
        slope, reached, before = 0.0, 0.0, 0.0
        for spring in springs:
            at = reached + slope * (spring.offset - before)
            if at >= force:
                break
            slope, reached, before = slope + spring.stiffness, at, spring.offset
        return before + (force - reached) / slope if slope > 0.0 else np.inf

    def settled_states(self, penetration: float) -> tuple[float, ...]:
        """(r,) internal states after a long rest at a penetration, m."""
        return (0.0,) * self.internal_states if self.settled is None else self.settled(penetration)

    @property
    def has_undamped_form(self) -> bool:
        """Whether it keeps no internal state and loses nothing without its dashpots."""
        memory = self.internal_states > 0 or self.rubs
        return self.family is not None or self.undamped_law is not None or not memory

    @property
    def recovers(self) -> bool:
        """Whether its released face moves by itself, so that contact depends on internal states."""
        guarded = any(any(guard.internal) for phase in self.phases for guard in phase.guards)
        return guarded and not self.rubs

    @property
    def yields(self) -> bool:
        """Whether it is a stop that loses work in a phase of its own, and stays crushed."""
        return any(phase.friction != 0.0 and phase.stiffness > 0.0 for phase in self.phases)

    @property
    def rubs(self) -> bool:
        """Whether it loses work in a phase of its own, as dry friction does."""
        return any(phase.friction != 0.0 or phase.holds for phase in self.phases) or self.needs_pressing

    @property
    def needs_pressing(self) -> bool:
        """Whether its force depends on that of another contact, which presses it."""
        return any(phase.when_released is not None for phase in self.phases)

    def resting_phase(self, penetration: float) -> int:
        """The phase after a long rest at a penetration, m: a guard that is negative hands over to the one it names."""
        r = self.internal_states
        motion = np.array([penetration, 0.0, 1.0, *self.settled_states(penetration)])
        phase, visited = self.start, {self.start}
        while True:
            guards = self.phases[phase].guards
            following = [g.next for g in guards if g.row(r) @ motion < 0.0 and g.next not in visited]
            if not following:
                return phase
            phase = following[0]
            visited.add(phase)

    def dynamic_stiffness(self, phase: int, omega: Floats) -> Complexes:
        """(w,) force per penetration of small motions within a phase at frequencies, rad/s."""
        now, r = self.phases[phase], self.internal_states
        iw: Complexes = np.asarray(1j * np.asarray(omega), dtype=complex)
        stiffness = np.asarray(now.stiffness + iw * now.dashpot, dtype=complex)
        if not r or not any(now.internal):
            return stiffness
        return np.asarray(stiffness + self._moved(now, iw)[..., 0] @ np.array(now.internal))

    def dynamic_stiffness_slope(self, phase: int, omega: Floats) -> Complexes:
        """(w,) derivative of `dynamic_stiffness` by the frequency, N s/m."""
        now, r = self.phases[phase], self.internal_states
        iw: Complexes = np.asarray(1j * np.asarray(omega), dtype=complex)
        slope = np.full(iw.shape, 1j * now.dashpot, dtype=complex)
        if not r or not any(now.internal):
            return slope
        driven = np.array(now.drive, dtype=float).reshape(r, 3)[:, 1, None]
        turned = np.linalg.solve(iw[:, None, None] * np.eye(r) - np.array(now.dynamics), driven - self._moved(now, iw))
        return np.asarray(slope + 1j * turned[..., 0] @ np.array(now.internal))

    def relaxation(self, omega: Floats) -> tuple[Complexes, Complexes]:
        """(w,) dynamic stiffness of the branches of a two-sided law, N/m, and its derivative by the frequency."""
        static = self.dynamic_stiffness(self.start, np.zeros(1))[0]
        return self.dynamic_stiffness(self.start, omega) - static, self.dynamic_stiffness_slope(self.start, omega)

    def _moved(self, now: Phase, iw: Complexes) -> Complexes:
        """(w, r, 1) internal states per penetration of small motions within a phase."""
        r = self.internal_states
        drive = np.array(now.drive, dtype=float).reshape(r, 3)
        driven = (drive[:, 0] + iw[:, None] * drive[:, 1])[..., None]
        return np.linalg.solve(iw[:, None, None] * np.eye(r) - np.array(now.dynamics), driven)

    def with_numbers(self, stiffness: float, dashpot: float) -> ContactLaw:
        """The same kind of law with other numbers."""
        if self.family is None:
            raise ValueError("this contact law is not made of one stiffness and one dashpot")
        return self.family(stiffness, dashpot)

    def scaled(self, factor: float) -> ContactLaw:
        """The law with its force multiplied by a positive factor; its internal states move as before."""
        if self.family is not None:
            return self.family(factor * self.stiffness, factor * self.dashpot)
        phases = tuple(
            replace(
                p,
                stiffness=factor * p.stiffness,
                dashpot=factor * p.dashpot,
                force=factor * p.force,
                energy=factor * p.energy,
                friction=factor * p.friction,
                internal=tuple(factor * x for x in p.internal),
                stored=tuple(tuple(factor * x for x in row) for row in p.stored),
                stored_linear=tuple(factor * x for x in p.stored_linear),
                losses=tuple(factor * x for x in p.losses),
                guards=tuple(replace(g, loss=factor * g.loss) for g in p.guards),
            )
            for p in self.phases
        )
        return replace(
            self,
            phases=phases,
            parts=_scaled(self.parts, factor),
            static=_scaled(self.static, factor),
            stiffness=factor * self.stiffness,
            dashpot=factor * self.dashpot,
            undamped_law=None if self.undamped_law is None else self.undamped_law.scaled(factor),
        )

    def plus(self, other: ContactLaw, amount: float) -> ContactLaw:
        """The force of this law and ``amount`` of another's, which has the same phases."""
        if self.family is not None and other.family is not None:
            return self.family(self.stiffness + amount * other.stiffness, self.dashpot + amount * other.dashpot)
        if self.internal_states or self.parts is None or other.parts is None:
            raise ValueError("only sums of one-sided springs can be added")
        phases = tuple(
            replace(
                a,
                stiffness=a.stiffness + amount * b.stiffness,
                force=a.force + amount * b.force,
                energy=a.energy + amount * b.energy,
            )
            for a, b in zip(self.phases, other.phases, strict=True)
        )
        parts = tuple(
            replace(a, stiffness=a.stiffness + amount * b.stiffness)
            for a, b in zip(self.parts, other.parts, strict=True)
        )
        return replace(self, phases=phases, parts=parts)

    def undamped(self) -> ContactLaw:
        """The law without its dashpots, which keeps no internal state then."""
        if self.family is not None:
            return self.family(self.stiffness, 0.0)
        if self.undamped_law is not None:
            return self.undamped_law
        if not self.has_undamped_form:
            raise ValueError("this contact law has no undamped form")
        parts = None if self.parts is None else tuple(replace(s, dashpot=0.0) for s in self.parts)
        return replace(self, phases=tuple(replace(p, dashpot=0.0) for p in self.phases), parts=parts, dashpot=0.0)

    def jump(self, phase: int, guard: int) -> Floats:
        """(3 + r,) factors of the force's jump at a guard, before the event's quantities.

        At the event the guard is zero, so that a multiple of it may be taken away: what is left vanishes exactly where
        the force is continuous.
        """
        r = self.internal_states
        now, g = self.phases[phase], self.phases[phase].guards[guard]
        after = self.phases[g.next].row(r)
        row = after.copy()
        if g.reset is not None:
            row[3:] = 0.0
            row += after[3:] @ np.array(g.reset, dtype=float).reshape(r, 3 + r)
        row -= now.row(r)
        function = g.row(r)
        size = np.abs(after) + np.abs(now.row(r))
        if not function.any():  # it depends on other forces alone
            return row
        pivot = int(np.flatnonzero(function)[0])
        factor = row[pivot] / function[pivot]
        row -= factor * function
        size += abs(factor) * np.abs(function)
        row[pivot] = 0.0
        row[np.abs(row) <= SMALLEST_JUMP * size] = 0.0
        return row


def _scaled(springs: tuple[OneSidedSpring, ...] | None, factor: float) -> tuple[OneSidedSpring, ...] | None:
    if springs is None:
        return None
    return tuple(replace(s, stiffness=factor * s.stiffness, dashpot=factor * s.dashpot) for s in springs)


def _row(penetration: float, rate: float, constant: float, internal: tuple[float, ...], r: int) -> Floats:
    row = np.zeros(3 + r)
    row[0], row[1], row[2] = penetration, rate, constant
    if internal:
        row[3:] = internal
    return row


@lru_cache(maxsize=1024)
def kelvin_voigt(stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """Spring and dashpot side by side that push while there is penetration: ``N = k delta + c delta'``.

    Examples
    --------
    >>> [phase.name for phase in kelvin_voigt(1e5, 10.0).phases]
    ['open', 'closed']
    """
    return ContactLaw(
        (
            Phase("open", (Guard(1, penetration=-1.0),), touching=False),
            Phase("closed", (Guard(0, penetration=1.0),), touching=True, stiffness=stiffness, dashpot=dashpot),
        ),
        parts=(OneSidedSpring(1.0, stiffness, dashpot, 0.0),),
        stiffness=stiffness,
        dashpot=dashpot,
        family=kelvin_voigt,
    )


@lru_cache(maxsize=1024)
def no_tension(stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """As :func:`kelvin_voigt`, but the snubber lets go where it would pull, and relaxes until it is met again.

    The internal state p is the compression of the released snubber, ``p' = -(k/c) p``. It begins as the penetration at
    release; contact is made where the penetration reaches it. While closed, the compression is the penetration and p
    means nothing: it starts from zero and decays in the same way. Without a dashpot the law is that of Kelvin–Voigt.
    """
    if dashpot <= 0.0:
        return replace(kelvin_voigt(stiffness, dashpot), family=no_tension)
    relaxing = ((-stiffness / dashpot,),)
    meets = Guard(1, penetration=-1.0, internal=(1.0,), reset=((0.0, 0.0, 0.0, 0.0),))
    lets_go = Guard(0, penetration=stiffness, rate=dashpot, reset=((1.0, 0.0, 0.0, 0.0),))
    return ContactLaw(
        (
            Phase("released", (meets,), touching=False, dynamics=relaxing, stored=((stiffness,),), losses=(dashpot,)),
            Phase("closed", (lets_go,), touching=True, stiffness=stiffness, dashpot=dashpot, dynamics=relaxing),
        ),
        internal_states=1,
        stiffness=stiffness,
        dashpot=dashpot,
        family=no_tension,
    )


def piecewise_linear(breakpoints: Sequence[float], slopes: Sequence[float], at_rest: int) -> ContactLaw:
    """A continuous force with given slopes between breakpoints, less the straight line of the segment ``at_rest``.

    Zero penetration lies in the segment ``at_rest``, whose slope belongs to the linear structure. Neighbours of the
    same slope are one segment.

    Examples
    --------
    >>> law = piecewise_linear([-1.0, 2.0], [5.0, 3.0, 1.0], 1)
    >>> [(phase.stiffness, phase.force) for phase in law.phases]
    [(2.0, 2.0), (0.0, 0.0), (-2.0, 4.0)]
    """
    if len(slopes) != len(breakpoints) + 1 or any(b <= a for a, b in pairwise(breakpoints)):
        raise ValueError("breakpoints increase, and there is one slope more than breakpoints")
    kept = [i for i, (a, b) in enumerate(pairwise(slopes)) if a != b]
    at_rest -= sum(1 for i in range(at_rest) if i not in kept)
    breakpoints, slopes = [breakpoints[i] for i in kept], [slopes[i] for i in kept] + [slopes[-1]]
    force, energy = [0.0] * len(slopes), [0.0] * len(slopes)
    away = [(i, i + 1, breakpoints[i]) for i in range(at_rest, len(breakpoints))]
    away += [(i, i - 1, breakpoints[i - 1]) for i in range(at_rest, 0, -1)]
    for i, k, b in away:  # force and energy go on without a jump
        force[k] = force[i] + (slopes[i] - slopes[k]) * b
        energy[k] = energy[i] + 0.5 * (slopes[i] - slopes[k]) * b**2 + (force[i] - force[k]) * b
    phases = []
    for i, slope in enumerate(slopes):
        guards = []
        if i > 0:
            guards.append(Guard(i - 1, penetration=1.0, constant=-breakpoints[i - 1]))
        if i < len(breakpoints):
            guards.append(Guard(i + 1, penetration=-1.0, constant=breakpoints[i]))
        phases.append(
            Phase(
                f"segment {i + 1}",
                tuple(guards),
                touching=i != at_rest,
                stiffness=slope - slopes[at_rest],
                force=force[i],
                energy=energy[i],
            )
        )
    parts = [OneSidedSpring(-1.0, slopes[i] - slopes[i + 1], 0.0, -breakpoints[i]) for i in range(at_rest)]
    parts += [
        OneSidedSpring(1.0, slopes[i + 1] - slopes[i], 0.0, breakpoints[i]) for i in range(at_rest, len(breakpoints))
    ]
    return ContactLaw(tuple(phases), start=at_rest, parts=tuple(parts))
