r"""Contact laws as sets of phases.

A law depends on the penetration :math:`\delta` and its rate, its internal states p and, for friction with a normal
contact, the normal force N and its rate. A phase consists of springs whose extension is linear in these, a dissipative
force, and the rates of p,

.. math:: E = \sum_i \tfrac12 k_i s_i^2 + F_i s_i + E_i, \qquad
          T = \frac{\partial E}{\partial\delta} + c\,\dot\delta + R + r\,\delta + \mu N, \qquad
          \dot p = A\,p + b_\delta\,\delta + b_r\,\dot\delta + b_0 .

The dissipated power is :math:`(c\,\dot\delta + R + r\,\delta + \mu N)\,\dot\delta + \sum_i l_i \dot p_i^2`. A phase
lasts while its guards, linear in all of these quantities, are positive. The guard that reaches zero first determines
the next phase; some guards also reset the internal states to affine functions of the same quantities. A decrease of the
stored energy at an event is dissipated. A new kind of law is a new list of phases; nothing else changes:

* a *table* of forces: one phase a segment, as in :func:`piecewise_linear`, whose spring has a force at zero extension;
* a *Maxwell branch* of stiffness k and relaxation time tau: a spring of extension delta - p, p' = (delta - p) / tau,
  and l = k tau;
* a *no-tension law*: an additional guard on each closed phase, the force itself;
* *friction* with a tangential spring (:mod:`beamsim.contacts.sliders`): delta is the tangential motion; sticking is a
  phase with a spring (the slider is an internal state at rest), sliding in each direction a phase with a constant,
  dissipative force;
* *friction* without a spring: sticking is a phase without motion, whose force is a reaction; its guards depend on this
  force;
* friction with a *normal contact*: its guards, dissipative force and spring extension are proportional to the normal
  force, and each phase names the phase that follows when the normal contact opens or closes;
* *partial dashpots*: phases in which the dashpot acts, is limited to the spring's force (a dissipative force that is
  linear in the penetration), or is absent; guards are the penetration rate and differences of forces;
* a *latch*: a phase without guards, which never ends;
* a *shock arrestor*: a free phase that a speed ends, with a reset of the state of its Maxwell branch;
* *kinematic hardening* (same module): an elastic phase, and a phase of yielding in each direction, whose resets set the
  slider when yielding ends;
* *unloading* along another curve (same module): a slider whose limit follows a table, with three phases per segment.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from beamsim.typing import Bools, Complexes, Floats, Ints

JUST_CLOSED_PENETRATION = 1e-9  # m, penetration of a contact that has just closed
PENETRATION, RATE, CONSTANT, NORMAL_FORCE, NORMAL_FORCE_RATE, REACTION, INTERNAL = range(7)  # columns of `LawRow.array`


class LawRow(NamedTuple):
    """A linear function of the quantities that a law depends on, by its factors."""

    penetration: float = 0.0
    rate: float = 0.0
    constant: float = 0.0
    internal: tuple[float, ...] = ()  # (r,) of the internal states
    normal_force: float = 0.0  # factor of the normal force of a friction contact
    normal_force_rate: float = 0.0  # factor of the rate of that force
    reaction: float = 0.0  # factor of the contact's own reaction, in a phase that sticks rigidly

    def array(self, internal_states: int) -> Floats:
        """(6 + r,) factors: penetration, rate, 1; pressing force, its rate, reaction; internal states."""
        row = np.zeros(INTERNAL + internal_states)
        row[:INTERNAL] = *self[:NORMAL_FORCE], self.normal_force, self.normal_force_rate, self.reaction
        row[INTERNAL : INTERNAL + len(self.internal)] = self.internal
        return row

    def of_scaled_forces(self, factor: float) -> LawRow:
        """The function with the same value after all forces are multiplied by a factor."""
        of_forces = {name: getattr(self, name) for name in ("normal_force", "normal_force_rate", "reaction")}
        return self._replace(**{name: number / factor for name, number in of_forces.items() if number})


class LawSpring(NamedTuple):
    """An elastic element of a phase, with the energy ``stiffness s^2 / 2 + force s + energy`` at the extension s, m."""

    stiffness: float  # N/m
    extension: LawRow
    force: float = 0.0  # N
    energy: float = 0.0  # J


@dataclass(frozen=True)
class Guard:
    """A function that is positive while its phase lasts, with the phase that follows.

    ``reset`` gives the internal states at the start of the next phase; None if they are continuous.
    """

    next: int
    row: LawRow
    reset: tuple[LawRow, ...] | None = None


@dataclass(frozen=True)
class Phase:
    """One phase of a law; see the module's equations."""

    name: str
    guards: tuple[Guard, ...]
    closed: bool  # shown to users as closed; for friction whether it sticks
    springs: tuple[LawSpring, ...] = ()
    dissipative_force: LawRow = field(default_factory=LawRow)  # the terms c, R, r and mu
    rates: tuple[LawRow, ...] = ()  # (r,) time derivatives of the internal states; zero by default
    state_dashpots: tuple[float, ...] = ()  # (r,) l, N s/m
    sticks_rigidly: bool = False  # the force is the reaction that prevents motion
    sliding_direction: float = 0.0  # +1 or -1, the direction of sliding; 0 otherwise
    # m; extension of the spring for a restart in a phase in which the internal state does not determine it
    restart_extension: LawRow | None = None
    # phase that follows when the normal contact opens or closes
    phase_when_normal_contact_changes: int | None = None

    @property
    def stiffness(self) -> float:
        """N/m, force per penetration."""
        return float(sum(s.stiffness * s.extension.penetration**2 for s in self.springs))


_AXES = {  # of the arrays of a law after that of its phases
    "closed": "", "opening": "C", "force": "C", "dissipative_force": "C", "energy": "CC", "rates": "rC",
    "state_dashpots": "r", "coupled": "", "sticks_rigidly": "", "sliding_direction": "", "guards": "", "guard": "GC",
    "next": "G", "resets": "G", "reset": "GrC", "event_loss": "P2",
}  # fmt: skip
_TYPES = {"closed": bool, "coupled": bool, "sticks_rigidly": bool, "resets": bool, "guards": np.int64, "next": np.int64}


class LawArrays(NamedTuple):
    """A law as arrays: P phases, G guards, r states, and the columns of `LawRow.array`; padded with zeros."""

    closed: Bools  # (P,)
    opening: Floats  # (P, C) distance to the face of a stop in its present state, m; the contact closes at zero
    force: Floats  # (P, C) the force's row
    dissipative_force: Floats  # (P, C) row of the dissipative force
    energy: Floats  # (P, C, C) Q of the energy z^T Q z / 2, z as for `LawRow.array`
    rates: Floats  # (P, r, C) rows of the rates of the internal states
    state_dashpots: Floats  # (P, r) dissipated power per squared rate of the internal states, N s/m
    coupled: Bools  # (P,) whether internal states and structure are coupled
    sticks_rigidly: Bools  # (P,)
    sliding_direction: Floats  # (P,)
    guards: Ints  # (P,) number of guards
    guard: Floats  # (P, G, C) their rows
    next: Ints  # (P, G) phase that follows
    resets: Bools  # (P, G)
    reset: Floats  # (P, G, r, C) rows of the internal states after the event
    event_loss: Floats  # (P, P, 2) energy loss at a phase change, J, and m/N for the squared normal force

    @classmethod
    def zeros(cls, phases: tuple[int, ...], guards: int, states: int) -> LawArrays:
        """Zero arrays for P phases (the last entry of ``phases``) of any number of laws."""
        size = {"C": INTERNAL + states, "r": states, "G": guards, "P": phases[-1], "2": 2}
        shapes = {name: (*phases, *(size[axis] for axis in axes)) for name, axes in _AXES.items()}
        return cls(**{name: np.zeros(shape, _TYPES.get(name, float)) for name, shape in shapes.items()})


@dataclass(frozen=True)
class OneSidedSpring:
    """A spring and dashpot that act while ``direction * delta - offset`` is positive."""

    direction: float  # +1 or -1
    stiffness: float  # N/m; negative where a piecewise-linear force softens
    dashpot: float  # N s/m
    offset: float  # m


class PhaseBoundary(NamedTuple):
    """Boundary of a phase for small motions around a state of rest."""

    is_force: bool  # whether it is at a force, N; else at a penetration, m
    value_at_rest: float  # force or penetration at rest
    direction: float  # +1 or -1, the side on which it lies
    distance: float  # from rest, not negative


@dataclass
class ContactLaw:
    """A contact law: its phases, and properties derived from them.

    Parameters
    ----------
    phases : the phases; guards refer to them by index.
    internal_states : number r of internal states, the same in every phase.
    start : phase in which the search for the phase of a given motion starts.
    one_sided_springs : one-sided springs with the same total force; None if there are none (internal states, phases
        that end at a force).
    stiffness, dashpot : values for slow motion in contact, used for natural frequencies.
    static : one-sided springs with the same force after a long rest; by default `one_sided_springs`, or one spring with
        the stiffness.
    relaxed_states : function that gives the internal states after a long rest at a penetration, m.
    resting_force : force that remains after a long rest in addition to the static springs, N: that of a sticking face.
    undamped_law : the law without dashpots, if it differs; None if there is none.
    as_installed : the law with the `static` and `relaxed_states` of a motion that starts before the branches have
        relaxed.
    rebuild : function that makes a law of this kind from a stiffness and a dashpot; continuations and derivatives need
        it.
    """

    phases: tuple[Phase, ...]
    internal_states: int = 0
    start: int = 0
    one_sided_springs: tuple[OneSidedSpring, ...] | None = None
    stiffness: float = np.nan
    dashpot: float = np.nan
    static: tuple[OneSidedSpring, ...] | None = None
    relaxed_states: Callable[[float], tuple[float, ...]] = lambda penetration: ()
    resting_force: float = 0.0
    undamped_law: ContactLaw | None = None
    as_installed: ContactLaw | None = None
    rebuild: Callable[[float, float], ContactLaw] | None = None

    # derived fields
    # one-sided springs with the same force after a long rest
    static_springs: tuple[OneSidedSpring, ...] = field(init=False)
    # whether its force depends on that of another contact, which presses it
    needs_normal_contact: bool = field(init=False)
    slides_or_yields: bool = field(init=False)  # whether it dissipates energy by sliding or yielding
    yields: bool = field(init=False)  # whether it is a stop that stays crushed: its open face is at its slider
    latches: bool = field(init=False)  # whether it has a phase that never ends
    linear_in_contact: bool = field(init=False)  # whether it is just a stiffness and a dashpot while closed

    def __post_init__(self) -> None:
        for phase in self.phases:
            following = [g.next for g in phase.guards]
            if any(not 0 <= k < len(self.phases) for k in following):
                raise ValueError(f"a guard of phase {phase.name!r} names a phase that the law does not have")
            if len(set(following)) < len(following):
                raise ValueError(f"two guards of phase {phase.name!r} name the same phase")
        springs = self.one_sided_springs if self.static is None else self.static
        self.static_springs = (OneSidedSpring(1.0, self.stiffness, 0.0, 0.0),) if springs is None else springs
        opened = self.phases[0]
        self.needs_normal_contact = any(phase.phase_when_normal_contact_changes is not None for phase in self.phases)
        self.slides_or_yields = self.needs_normal_contact or any(
            p.dissipative_force.constant or p.dissipative_force.penetration or p.sticks_rigidly for p in self.phases
        )
        self.yields = self.slides_or_yields and not opened.closed and bool(opened.guards[0].row.internal)
        self.latches = len(self.phases) > 1 and any(
            not p.guards and p.phase_when_normal_contact_changes is None for p in self.phases
        )
        self.linear_in_contact = self.rebuild is not None or self.latches

    def static_force(self, penetration: Floats) -> Floats:
        """Forces after a long rest at penetrations of any shape, N."""
        delta = np.asarray(penetration, dtype=float)
        force = np.zeros_like(delta)
        for s in self.static_springs:
            force += s.direction * s.stiffness * np.maximum(s.direction * delta - s.offset, 0.0)
        return force

    def static_penetration(self, force: float) -> float:
        """Penetration, m, at which a stop has a positive force, N, after a long rest."""
        springs = sorted(self.static_springs, key=lambda s: s.offset)
        slope, reached, before = 0.0, 0.0, 0.0
        for spring in springs:
            at = reached + slope * (spring.offset - before)
            if at >= force:
                break
            slope, reached, before = slope + spring.stiffness, at, spring.offset
        return before + (force - reached) / slope if slope > 0.0 else np.inf

    @cached_property
    def arrays(self) -> LawArrays:
        """The phases as arrays."""
        r, guards = self.internal_states, [phase.guards for phase in self.phases]
        a = LawArrays.zeros((len(guards),), max(map(len, guards)), r)
        for k, phase in enumerate(self.phases):
            a.closed[k], a.sticks_rigidly[k] = phase.closed, phase.sticks_rigidly
            a.sliding_direction[k] = phase.sliding_direction
            for spring in phase.springs:
                extension = spring.extension.array(r)
                a.energy[k] += spring.stiffness * np.outer(extension, extension)
                a.energy[k, CONSTANT] += spring.force * extension
                a.energy[k, :, CONSTANT] += spring.force * extension
                a.energy[k, CONSTANT, CONSTANT] += 2.0 * spring.energy
            a.dissipative_force[k] = phase.dissipative_force.array(r)
            a.force[k] = a.energy[k, PENETRATION] + a.dissipative_force[k]
            a.state_dashpots[k] = phase.state_dashpots or np.zeros(r)
            for i, row in enumerate(phase.rates):
                a.rates[k, i] = row.array(r)
            a.guards[k] = len(guards[k])
            for g, guard in enumerate(guards[k]):
                a.guard[k, g], a.next[k, g], a.resets[k, g] = guard.row.array(r), guard.next, guard.reset is not None
                for i, row in enumerate(guard.reset or ()):
                    a.reset[k, g, i] = row.array(r)
        a.coupled[:] = a.force[:, INTERNAL:].any(axis=1) | a.rates[..., :CONSTANT].any(axis=(1, 2))
        for k, phase in enumerate(self.phases):
            for g in reversed(range(len(guards[k]))):
                following = a.next[k, g]
                a.event_loss[k, following] = _event_loss(a, k, g)
                if a.closed[following] and not phase.closed:
                    a.opening[k] = a.guard[k, g]
        return a

    def resting_phase(self, penetration: float) -> int:
        """The phase after a long rest at a penetration, m: a negative guard leads to the next phase."""
        a, motion = self.arrays, self._at_rest(penetration)
        phase, visited = self.start, {self.start}
        while True:
            count = a.guards[phase]
            signs = a.guard[phase, :count] @ motion
            following = [k for k, sign in zip(a.next[phase].tolist(), signs, strict=False) if sign < 0.0]
            following = [k for k in following if k not in visited]
            if not following:
                return phase
            phase = following[0]
            visited.add(phase)

    def _at_rest(self, penetration: float) -> Floats:
        """(6 + r,) quantities of the law after a long rest at a penetration, m, without normal force."""
        return np.array([penetration, 0.0, 1.0, 0.0, 0.0, 0.0, *self.relaxed_states(penetration)])

    def boundaries(self, penetration: float) -> list[PhaseBoundary]:
        """Boundaries of small motions around a long rest at a penetration, m: one for each guard."""
        a, phase, rest = self.arrays, self.resting_phase(penetration), self._at_rest(penetration)
        force, moving = a.force[phase], a.rates[phase].any()
        seen = np.r_[0, 1, INTERNAL : rest.size]
        boundaries = []
        for guard in a.guard[phase, : a.guards[phase]]:
            # a guard that depends on a rate or a changing state is the force that vanishes
            of_force = bool(force[seen].any() and (guard[1] != 0.0 or (moving and guard[INTERNAL:].any())))
            with_states = guard[0] + guard[INTERNAL:] @ a.rates[phase, :, RATE]  # of states that follow the penetration
            slope = guard[seen] @ force[seen] / (force[seen] @ force[seen]) if of_force else with_states
            distance = max(float(guard @ rest), 0.0)
            distance = distance / abs(slope) if slope and distance else np.inf if distance else 0.0
            boundaries.append(
                PhaseBoundary(of_force, float(force @ rest) if of_force else penetration, -np.sign(slope), distance)
            )
        return boundaries

    @cached_property
    def closed_phase(self) -> int:
        """The phase of a stop that has just closed."""
        return self.resting_phase(self.static_penetration(JUST_CLOSED_PENETRATION * self.stiffness))

    def dynamic_stiffness(self, phase: int, omega: Floats) -> Complexes:
        """(w,) dynamic stiffness within a phase at angular frequencies, rad/s."""
        force, iw = self.arrays.force[phase], 1j * np.asarray(omega, dtype=float)
        stiffness = np.asarray(force[0] + iw * force[1], dtype=complex)
        return stiffness + self._stiffness_of_states(phase, iw) if force[INTERNAL:].any() else stiffness

    def _stiffness_of_states(self, phase: int, iw: Complexes) -> Complexes:
        """(w,) contribution of internal states p to the dynamic stiffness, with i omega p = A p + b."""
        force, rates = self.arrays.force[phase], self.arrays.rates[phase]
        moving = iw[:, None, None] * np.eye(self.internal_states) - rates[:, INTERNAL:]
        moved = np.linalg.solve(moving, (rates[:, 0] + iw[:, None] * rates[:, 1])[..., None])[..., 0]
        return np.asarray(moved @ force[INTERNAL:])

    def scaled(self, factor: float) -> ContactLaw:
        """The law with all its forces, and its normal force, multiplied by a positive factor.

        Its internal states are unchanged. A law without normal contact may also be multiplied by zero.
        """

        def rows(functions: tuple[LawRow, ...]) -> tuple[LawRow, ...]:
            return tuple(row.of_scaled_forces(factor) for row in functions)

        phases = tuple(
            replace(
                p,
                springs=tuple(
                    LawSpring(
                        factor * s.stiffness, s.extension.of_scaled_forces(factor), factor * s.force, factor * s.energy
                    )
                    for s in p.springs
                ),
                dissipative_force=p.dissipative_force._replace(
                    **{x: factor * getattr(p.dissipative_force, x) for x in ("penetration", "rate", "constant")}
                ),
                rates=rows(p.rates),
                state_dashpots=tuple(factor * x for x in p.state_dashpots),
                restart_extension=None if p.restart_extension is None else p.restart_extension.of_scaled_forces(factor),
                guards=tuple(
                    replace(g, row=g.row.of_scaled_forces(factor), reset=None if g.reset is None else rows(g.reset))
                    for g in p.guards
                ),
            )
            for p in self.phases
        )
        return replace(
            self,
            phases=phases,
            one_sided_springs=_scaled(self.one_sided_springs, factor),
            static=_scaled(self.static, factor),
            stiffness=factor * self.stiffness,
            dashpot=factor * self.dashpot,
            resting_force=factor * self.resting_force,
            undamped_law=None if self.undamped_law is None else self.undamped_law.scaled(factor),
            as_installed=None if self.as_installed is None else self.as_installed.scaled(factor),
        )

    def plus(self, other: ContactLaw, added_multiple: float) -> ContactLaw:
        """A law with a multiple of this law's force, plus ``added_multiple`` of another law's force."""
        if not other.static_springs:
            return self
        ours, theirs = (law.static_springs[0].stiffness for law in (self, other))
        # a spring without force adds none
        return self if theirs == 0.0 else other.scaled(ours / theirs + added_multiple)

    def undamped(self) -> ContactLaw | None:
        """The law without its dashpots; None if it has internal states or other losses."""
        if self.undamped_law is not None:
            return self.undamped_law
        if self.internal_states or self.slides_or_yields:
            return None
        parts = (
            None if self.one_sided_springs is None else tuple(replace(s, dashpot=0.0) for s in self.one_sided_springs)
        )
        phases = tuple(replace(p, dissipative_force=p.dissipative_force._replace(rate=0.0)) for p in self.phases)
        return replace(self, phases=phases, one_sided_springs=parts, dashpot=0.0)


LOSS_ROUND_OFF = 1e-12  # relative to the terms of an energy loss; a smaller result is round-off


def _event_loss(a: LawArrays, phase: int, guard: int) -> Floats:
    """(2,) energy loss when a guard ends a phase, J, and for the squared normal force, m/N.

    It is the decrease of the stored energy, with the first quantity of the guard eliminated.
    """
    old, new, function = a.energy[phase], a.energy[a.next[phase, guard]], a.guard[phase, guard]
    reset = np.eye(function.size)  # quantities after the event as functions of those before it
    if a.resets[phase, guard]:
        reset[INTERNAL:] = a.reset[phase, guard]
    at_guard = np.eye(function.size)
    pivots = [column for column in (PENETRATION, *range(INTERNAL, function.size)) if function[column] != 0.0]
    if pivots:
        at_guard[pivots[0]] -= function / function[pivots[0]]
    lost = at_guard.T @ (old - reset.T @ new @ reset) @ at_guard
    size = np.abs(at_guard).T @ (np.abs(old) + np.abs(reset).T @ np.abs(new) @ np.abs(reset)) @ np.abs(at_guard)
    lost[np.abs(lost) <= LOSS_ROUND_OFF * size] = 0.0
    return np.array([0.5 * lost[CONSTANT, CONSTANT], 0.5 * lost[NORMAL_FORCE, NORMAL_FORCE]])


def _scaled(springs: tuple[OneSidedSpring, ...] | None, factor: float) -> tuple[OneSidedSpring, ...] | None:
    if springs is None:
        return None
    return tuple(replace(s, stiffness=factor * s.stiffness, dashpot=factor * s.dashpot) for s in springs)


PENETRATION_ROW = LawRow(penetration=1.0)  # the penetration itself
# of the locking speed times the relaxation time: a shock arrestor whose spring extends less is free
FREE_EXTENSION = 1e-9


@lru_cache(maxsize=1024)
def kelvin_voigt(stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """A parallel spring and dashpot that act while there is penetration: ``N = k delta + c delta'``.

    Examples
    --------
    >>> [phase.name for phase in kelvin_voigt(1e5, 10.0).phases]
    ['open', 'closed']
    """
    spring, lost = LawSpring(stiffness, PENETRATION_ROW), LawRow(rate=dashpot)
    opened = Phase("open", (Guard(1, LawRow(penetration=-1.0)),), closed=False)
    closed = Phase("closed", (Guard(0, PENETRATION_ROW),), closed=True, springs=(spring,), dissipative_force=lost)
    parts = (OneSidedSpring(1.0, stiffness, dashpot, 0.0),)
    return ContactLaw(
        (opened, closed), one_sided_springs=parts, stiffness=stiffness, dashpot=dashpot, rebuild=kelvin_voigt
    )


@lru_cache(maxsize=1024)
def latch(stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """A stop that locks at its first contact and then acts in both directions: ``N = k delta + c delta'``.

    Examples
    --------
    >>> [(phase.name, len(phase.guards)) for phase in latch(1e5).phases]
    [('open', 1), ('latched', 0)]
    """
    open_, closed = kelvin_voigt(stiffness, dashpot).phases
    return ContactLaw(
        (open_, replace(closed, name="latched", guards=())),
        static=(OneSidedSpring(1.0, stiffness, dashpot, 0.0),),
        stiffness=stiffness,
        dashpot=dashpot,
    )


@lru_cache(maxsize=1024)
def limited_damping(stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """A spring and a dashpot whose force is at most that of the spring, so that the sum is within 0 and ``2 k delta``.

    The force is continuous at touch and never pulls: ``N = k delta + max(-k delta, min(c delta', k delta))``. It is the
    law of ``ElastoGap`` in the Modelica standard library.

    Examples
    --------
    >>> [(phase.name, phase.dissipative_force.penetration) for phase in limited_damping(1e5, 10.0).phases]
    [('open', 0.0), ('approaching', 100000.0), ('damped', 0.0), ('departing', -100000.0)]
    """
    undamped = replace(kelvin_voigt(stiffness), rebuild=limited_damping)
    if dashpot == 0.0:
        return undamped
    k, springs = stiffness, (LawSpring(stiffness, PENETRATION_ROW),)
    approaching, damped, departing = 1, 2, 3
    phases = (
        Phase("open", (Guard(approaching, LawRow(-1.0)),), closed=False),
        Phase(
            "approaching", (Guard(damped, LawRow(-k, dashpot)),), True, springs, LawRow(penetration=k)
        ),
        Phase(
            "damped",
            (Guard(approaching, LawRow(k, -dashpot)), Guard(departing, LawRow(k, dashpot))),
            True, springs, LawRow(rate=dashpot),
        ),
        Phase(
            "departing", (Guard(0, PENETRATION_ROW), Guard(damped, LawRow(-k, -dashpot))), True, springs,
            LawRow(penetration=-k),
        ),
    )  # fmt: skip
    return ContactLaw(
        phases,
        static=(OneSidedSpring(1.0, stiffness, dashpot, 0.0),),
        stiffness=stiffness,
        dashpot=dashpot,
        undamped_law=undamped,
    )


@lru_cache(maxsize=1024)
def damping_on_approach(stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """A spring, and a dashpot that acts only while the penetration grows: ``N = k delta + c max(delta', 0)``.

    Examples
    --------
    >>> [(phase.name, phase.dissipative_force.rate) for phase in damping_on_approach(1e5, 10.0).phases]
    [('open', 0.0), ('approaching', 10.0), ('departing', 0.0)]
    """
    undamped = replace(kelvin_voigt(stiffness), rebuild=damping_on_approach)
    if dashpot == 0.0:
        return undamped
    springs, approaching, departing = (LawSpring(stiffness, PENETRATION_ROW),), 1, 2
    phases = (
        Phase("open", (Guard(approaching, LawRow(-1.0)),), closed=False),
        Phase("approaching", (Guard(departing, LawRow(rate=1.0)),), True, springs, LawRow(rate=dashpot)),
        Phase("departing", (Guard(0, PENETRATION_ROW), Guard(approaching, LawRow(rate=-1.0))), True, springs),
    )
    return ContactLaw(
        phases,
        static=(OneSidedSpring(1.0, stiffness, dashpot, 0.0),),
        stiffness=stiffness,
        dashpot=dashpot,
        undamped_law=undamped,
    )


@lru_cache(maxsize=1024)
def shock_arrestor(stiffness: float, bleed: float, locking_speed: float) -> ContactLaw:
    """A device that is free while it moves slowly, and a spring in series with a dashpot while it is locked.

    It locks when its speed reaches the locking speed, and is free again when its force returns to zero. While it is
    locked, ``F = k (delta - p)`` with ``p' = F / c``; p is the extension at which it locked, so that F has no jump.

    Parameters
    ----------
    stiffness : k, N/m.
    bleed : c, force over bleed rate, N s/m.
    locking_speed : m/s.

    Examples
    --------
    >>> [phase.name for phase in shock_arrestor(1e7, 1e6, 3e-3).phases[:3]]
    ['free', 'locked in extension', 'locked in extension, returning fast']
    """
    rate, locks = stiffness / bleed, (PENETRATION_ROW,)
    # while it is free, p follows the extension; with a force, a motion starts locked, by the first two guards
    least = FREE_EXTENSION * locking_speed / rate
    free = Phase(
        "free",
        (
            *(Guard(k, LawRow(-sign, constant=least, internal=(sign,))) for k, sign in ((2, 1.0), (4, -1.0))),
            *(Guard(k, LawRow(0.0, -sign, locking_speed), locks) for k, sign in ((1, 1.0), (3, -1.0))),
        ),
        closed=False,
        rates=(LawRow(rate=1.0),),
        restart_extension=LawRow(),
    )
    spring = Phase(
        "", (), True, (LawSpring(stiffness, LawRow(1.0, internal=(-1.0,))),),
        rates=(LawRow(rate, internal=(-rate,)),), state_dashpots=(bleed,),
    )  # fmt: skip
    # one that returns faster than the locking speed locks in the other direction at once: a phase of its own, because
    # the speed decides what follows when the force vanishes
    locked = []
    for name, sign, slow, other in (("extension", 1.0, 1, 3), ("compression", -1.0, 3, 1)):
        force = LawRow(sign, internal=(-sign,))
        ends = Guard(0, force, locks), Guard(slow + 1, LawRow(0.0, sign, locking_speed))
        turns = Guard(other, force), Guard(slow, LawRow(0.0, -sign, -locking_speed))
        locked += [
            replace(spring, name=f"locked in {name}", guards=ends),
            replace(spring, name=f"locked in {name}, returning fast", guards=turns),
        ]
    return ContactLaw((free, *locked), internal_states=1, static=(), relaxed_states=lambda extension: (extension,))


def piecewise_linear(breakpoints: Sequence[float], slopes: Sequence[float], at_rest: int) -> ContactLaw:
    """A continuous force with given slopes between breakpoints, minus the linear force of one segment.

    Parameters
    ----------
    breakpoints : penetrations, m, increasing.
    slopes : slopes of the segments, one more than breakpoints, N/m. Neighbouring segments with equal slopes are merged.
    at_rest : index of the segment with zero penetration, whose slope belongs to the linear structure.

    Returns
    -------
    ContactLaw
        With one phase for each segment.

    Raises
    ------
    ValueError
        If the breakpoints do not increase, or their number is wrong.

    Examples
    --------
    >>> law = piecewise_linear([-1.0, 2.0], [5.0, 3.0, 1.0], 1)
    >>> [(spring.stiffness, spring.force) for phase in law.phases for spring in phase.springs]
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
    for i, k, b in away:  # force and energy are continuous
        force[k] = force[i] + (slopes[i] - slopes[k]) * b
        energy[k] = energy[i] + 0.5 * (slopes[i] - slopes[k]) * b**2 + (force[i] - force[k]) * b
    phases = []
    for i, slope in enumerate(slopes):
        guards = []
        if i > 0:
            guards.append(Guard(i - 1, LawRow(penetration=1.0, constant=-breakpoints[i - 1])))
        if i < len(breakpoints):
            guards.append(Guard(i + 1, LawRow(penetration=-1.0, constant=breakpoints[i])))
        spring = LawSpring(slope - slopes[at_rest], PENETRATION_ROW, force[i], energy[i])
        phases.append(Phase(f"segment {i + 1}", tuple(guards), closed=i != at_rest, springs=(spring,)))
    parts = [OneSidedSpring(-1.0, slopes[i] - slopes[i + 1], 0.0, -breakpoints[i]) for i in range(at_rest)]
    parts += [
        OneSidedSpring(1.0, slopes[i + 1] - slopes[i], 0.0, breakpoints[i]) for i in range(at_rest, len(breakpoints))
    ]
    return ContactLaw(tuple(phases), start=at_rest, one_sided_springs=tuple(parts))
