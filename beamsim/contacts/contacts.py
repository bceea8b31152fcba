"""The contacts of a system: where they act, and their laws."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from beamsim.contacts.laws import ContactLaw, Phase, kelvin_voigt
from beamsim.dataclass import dataclass
from beamsim.typing import Bools, Complexes, Floats, Ints


class PhaseArrays(NamedTuple):
    """The contacts and their laws as padded arrays, for compiled code: m contacts, P phases, G guards, R states.

    A row of 3 + R factors multiplies the penetration, its rate, 1, and the contact's own internal states.
    """

    shape: Any  # (m, n)
    sign: Any  # (m,)
    gap: Any  # (m,)
    felt: Any  # (m,) displacement of the ground contacts for a unit displacement of the base
    start: Any  # (m,) phase from which the search for the current one starts
    first: Any  # (m,) index of the contact's first internal state among those of all contacts
    states: Any  # (m,) number of its internal states
    touching: Any  # (m, P) bool
    force: Any  # (m, P, 3 + R) the force's row
    dynamics: Any  # (m, P, R, 3 + R) rows of the rates of the internal states
    stored: Any  # (m, P, 1 + R, 1 + R) Q of the energy z^T Q z / 2 at zero penetration, z = (1, internal states)
    losses: Any  # (m, P, R) power lost with the square of the internal states' rates, N s/m
    guards: Any  # (m, P) number of guards
    guard: Any  # (m, P, G, 3 + R) their rows
    next: Any  # (m, P, G) phase that follows
    resets: Any  # (m, P, G) bool
    reset: Any  # (m, P, G, R, 3 + R) rows of the internal states after the event
    jumps: Any  # (m, P, G) bool, whether the force jumps
    jump: Any  # (m, P, G, 3 + R) row of the jump, see `ContactLaw.jump`


@dataclass(frozen=True)
class Watched:
    """Functions monitored in one contact state: g guards, then the internal states after events that reset them."""

    contact: Ints  # (w,) contact that each function belongs to
    row: Floats  # (w, 3) factors of the penetration, its rate, and 1
    internal: Floats  # (w, r) factors of all internal states
    guards: int  # g
    following: Ints  # (g,) phase of the guard's contact after its event
    reaction: Floats  # (w,) factor of the contact's force, where it holds
    reset: Ints  # (g,) first of the rows that give the internal states after the event, -1 without a reset
    pressing: Floats  # (w,) factor of the force of the contact that presses the function's own
    pressing_rate: Floats  # (w,) s, factor of that force's rate


@dataclass(frozen=True)
class Contacts:
    """m contacts with penetration ``delta = -gap - sign * (shape @ q + felt d)``.

    The push on the structure along ``shape`` is ``sign * force``, the force being that of the law's phase.
    """

    shape: Floats  # (m, n) deflection at the contact for a unit of each coordinate
    sign: Floats  # (m,) +1 below the structure (resists negative deflection), -1 above
    gap: Floats  # (m,) m; clearance positive, prestress negative
    on_ground: Bools  # (m,) whether it depends on the absolute deflection
    laws: tuple[ContactLaw, ...]  # (m,)
    lever: Floats | None = None  # (m,) displacement of its place for a unit displacement d of the base; None: 1
    pressed_by: Ints | None = None  # (m,) contact whose force presses each, -1 where there is none; None: nowhere

    @property
    def count(self) -> int:
        """m."""
        return len(self.laws)

    @cached_property
    def felt(self) -> Floats:
        """(m,) displacement by a unit displacement of the base of what is on the ground; 0 of what is on the base."""
        return self.on_ground * self.levers

    @property
    def levers(self) -> Floats:
        """(m,) displacement of each place for a unit displacement of the base."""
        return np.ones(self.count) if self.lever is None else self.lever

    @cached_property
    def internal_states(self) -> int:
        """r, number of internal states of all contacts; they follow (q, q') in the state vector, contact by contact."""
        return sum(law.internal_states for law in self.laws)

    @cached_property
    def _with_states(self) -> list[int]:
        """The contacts whose laws have internal states."""
        return [j for j, law in enumerate(self.laws) if law.internal_states]

    @cached_property
    def sliders(self) -> Ints:
        """Numbers of the internal states that rest but where a contact slides or yields."""
        a = self.arrays
        rubbing = [j for j, law in enumerate(self.laws) if law.rubs and law.internal_states]
        return np.array([a.first[j] + i for j in rubbing for i in range(a.states[j])], dtype=np.int64)

    @cached_property
    def stiffness(self) -> Floats:
        """(m,) N/m, of laws made of one stiffness and one dashpot; ValueError if there are others."""
        return self._numbers("stiffness")

    @cached_property
    def dashpot(self) -> Floats:
        """(m,) N s/m, likewise."""
        return self._numbers("dashpot")

    def _numbers(self, name: str) -> Floats:
        if any(law.family is None for law in self.laws):
            raise ValueError("a contact law is not made of one stiffness and one dashpot")
        return np.array([getattr(law, name) for law in self.laws], dtype=float)

    @property
    def slow(self) -> tuple[Floats, Floats]:
        """(m,) stiffness, N/m, and dashpot, N s/m, for slow motion in contact; nan for a law that gives none."""
        return np.array([law.stiffness for law in self.laws]), np.array([law.dashpot for law in self.laws])

    @cached_property
    def damped(self) -> bool:
        """Whether any phase dissipates."""
        resisted = any(p.dashpot != 0.0 for law in self.laws for p in law.phases)
        return resisted or self.internal_states > 0 or any(law.rubs for law in self.laws)

    @property
    def one_sided(self) -> bool:
        """Whether every law is a sum of one-sided springs: no internal states, and no phase that ends at zero force."""
        return all(law.parts is not None for law in self.laws)

    def one_sided_parts(self) -> Contacts:
        """The same forces by one-sided springs alone; each contact is replaced by its parts.

        Raises ValueError if a law is not such a sum (see `one_sided`).
        """
        if not self.one_sided:
            raise ValueError("a contact law with internal states is not a sum of one-sided springs")
        return self.split()

    def split(self) -> Contacts:
        """One contact for each part of a law that is a sum of one-sided springs; other laws are unchanged."""
        if all(law.family is not None for law in self.laws):
            return self
        owner: list[int] = []
        direction, gap, laws = [], [], []
        for j, law in enumerate(self.laws):
            if law.family is not None or law.parts is None:
                owner.append(j)
                direction.append(1.0)
                gap.append(self.gap[j])
                laws.append(law)
                continue
            for part in law.parts:
                owner.append(j)
                direction.append(part.direction)
                gap.append(part.direction * self.gap[j] + part.offset)
                laws.append(kelvin_voigt(part.stiffness, part.dashpot))
        d = np.array(direction)
        return Contacts(self.shape[owner], d * self.sign[owner], np.array(gap), self.on_ground[owner], tuple(laws),
            self.levers[owner])  # fmt: skip

    @property
    def owners_of_parts(self) -> tuple[Ints, Floats]:
        """Of each contact of `split` which one it is a part of, and the direction of its force in that one's."""
        if all(law.family is not None for law in self.laws):
            return np.arange(self.count), np.ones(self.count)
        parts = [
            (j, part.direction if part is not None else 1.0)
            for j, law in enumerate(self.laws)
            for part in ((None,) if law.family is not None or law.parts is None else law.parts)
        ]
        return np.array([j for j, _ in parts], dtype=np.int64), np.array([sign for _, sign in parts])

    @property
    def clearances(self) -> Floats:
        """Gaps of all one-sided springs, m: one per breakpoint of a piecewise-linear law."""
        return self.split().gap

    def take(self, which: slice) -> Contacts:
        """A selection of the contacts."""
        return Contacts(
            self.shape[which], self.sign[which], self.gap[which], self.on_ground[which], self.laws[which],
            self.levers[which],
        )  # fmt: skip

    def with_others(self, others: Contacts) -> Contacts:
        """These contacts followed by the others."""
        return Contacts(
            np.concatenate([self.shape, others.shape]), np.concatenate([self.sign, others.sign]),
            np.concatenate([self.gap, others.gap]), np.concatenate([self.on_ground, others.on_ground]),
            self.laws + others.laws, np.concatenate([self.levers, others.levers]),
        )  # fmt: skip

    def with_numbers(self, contact: int, stiffness: float, dashpot: float) -> Contacts:
        """The contacts with another stiffness and dashpot of one contact, whose law is made of these."""
        law = self.laws[contact].with_numbers(stiffness, dashpot)
        return replace(self, laws=(*self.laws[:contact], law, *self.laws[contact + 1 :]))

    def undamped(self) -> Contacts:
        """Without dashpots."""
        return replace(self, laws=tuple(law.undamped() for law in self.laws))

    def scaled(self, factor: float) -> Contacts:
        """All forces multiplied by a positive factor."""
        return replace(self, laws=tuple(law.scaled(factor) for law in self.laws))

    # -- phases --------------------------------------------------------------------------------------------------

    @property
    def start(self) -> Ints:
        """(m,) phases from which the search for those of a given motion starts."""
        return self.arrays.start.copy()  # type: ignore[no-any-return]

    @cached_property
    def pressed(self) -> Ints:
        """Contacts that the force of another one presses."""
        return np.zeros(0, dtype=np.int64) if self.pressed_by is None else np.flatnonzero(self.pressed_by >= 0)

    @cached_property
    def pressing(self) -> Ints:
        """Of each of `pressed` the contact that presses it."""
        return np.zeros(0, dtype=np.int64) if self.pressed_by is None else self.pressed_by[self.pressed]

    def pressing_factors(self, phases: Ints) -> Floats:
        """Of each of `pressed` the factor of the pressing force in its own, in phases (..., m)."""
        return np.asarray(self._pressing_factors[self.pressed, phases[..., self.pressed]])

    def presses(self, phases: Ints) -> bool:
        """Whether a force of one contact depends on that of another in these phases."""
        return self.pressed.size > 0 and bool(self.pressing_factors(phases).any())

    def pushes(self, phases: Ints) -> Floats:
        """(m, n) generalised force for a unit of each contact's own force, friction that it presses included."""
        push = self.sign[:, None] * self.shape
        if self.presses(phases):
            rubbing = self.pressing_factors(phases)[:, None] * push[self.pressed]
            np.add.at(push, self.pressing, rubbing)
        return np.asarray(push)

    def touching(self, phases: Ints) -> Bools:
        """Whether each contact touches; ``phases`` is (..., m)."""
        return np.asarray(self.arrays.touching[np.arange(self.count), phases])

    def touch_changes(self, initial: Ints, time: Floats, contact: Ints, phase: Ints) -> Ints:
        """(E,) what each event changes: 1 where contact is made, -1 where it ends, 0 between phases of one kind.

        ``initial`` (m,) are the phases at the beginning, ``time``, ``contact`` and ``phase`` (E,) the events. An event
        at the very beginning that leads to the phase there stands for entering it: contact was not there before.
        """
        after = np.asarray(self.arrays.touching[contact, phase], dtype=np.int64)
        changes = np.zeros(contact.size, dtype=np.int64)
        for j in range(self.count):
            of_contact = np.flatnonzero(contact == j)
            if not of_contact.size:
                continue
            first = of_contact[0]
            entered = time[first] == 0.0 and phase[first] == initial[j]
            begin = 0 if entered else int(self.arrays.touching[j, initial[j]])
            changes[of_contact] = np.diff(after[of_contact], prepend=begin)
        return changes

    def after(self, phases: Ints, contact: int, following: int) -> Ints:
        """The phases after one contact has changed its phase, and those that it presses where it touches or lets go."""
        before, phases = phases[contact], phases.copy()
        phases[contact] = following
        if self.pressed.size:
            touches = self.arrays.touching[contact, following]
            if touches != self.arrays.touching[contact, before]:
                for j in self.pressed[self.pressing == contact].tolist():
                    now = self.laws[j].phases[phases[j]]
                    then = now.when_pressed if touches else now.when_released
                    phases[j] = phases[j] if then is None else then
        return phases

    def pressed_at_start(self, phases: Ints, start: Ints) -> Ints:
        """The phases from which the search starts, with ``start`` (m,) of the contacts that a touching one presses."""
        if not self.pressed.size:
            return phases
        phases, touches = phases.copy(), self.touching(phases)
        for j, i in zip(self.pressed.tolist(), self.pressing.tolist(), strict=True):
            released = self.laws[j].phases[start[j]].when_released
            phases[j] = start[j] if touches[i] or released is None else released
        return phases

    def border(self, contact: int, before: int, after: int) -> tuple[float, bool]:
        """Penetration at which a contact changes from one phase to another, m, and whether it is larger afterwards.

        If the border does not depend on the penetration alone: zero, and whether the contact touches afterwards.
        """
        a = self.arrays
        guards = a.next[contact, before, : a.guards[contact, before]]
        row = a.guard[contact, before, int(np.flatnonzero(guards == after)[0])]
        if row[1] != 0.0 or row[3:].any() or row[0] == 0.0:
            return 0.0, bool(a.touching[contact, after])
        return float(-row[2] / row[0]) + 0.0, bool(row[0] < 0.0)

    def force_rows(self, phases: Ints) -> tuple[Floats, Floats]:
        """Forces in given phases (m,): (m, 3) factors of penetration, rate and 1; (m, r) of all internal states."""
        rows = self.arrays.force[np.arange(self.count), phases]
        internal = np.zeros((self.count, self.internal_states))
        for j in self._with_states:
            first, r = self.arrays.first[j], self.arrays.states[j]
            internal[j, first : first + r] = rows[j, 3 : 3 + r]
        return rows[:, :3], internal

    def own_internal(self, internal: Floats) -> Floats:
        """(nt, m, R) internal states of each contact from all of them (nt, r)."""
        a = self.arrays
        out = np.zeros((internal.shape[0], self.count, a.dynamics.shape[2]))
        for j in self._with_states:
            out[:, j, : a.states[j]] = internal[:, a.first[j] : a.first[j] + a.states[j]]
        return out

    def forces(self, phases: Ints, penetration: Floats, rate: Floats, internal: Floats) -> Floats:
        """(nt, m) forces, N, without what others press; ``internal`` is (nt, r), the others (nt, m)."""
        row = self.arrays.force[np.arange(self.count), phases]
        force = row[..., 0] * penetration + row[..., 1] * rate + row[..., 2]
        return np.asarray(force + np.sum(row[..., 3:] * self.own_internal(internal), axis=-1))

    def stored_energy(self, phases: Ints, penetration: Floats, internal: Floats) -> Floats:
        """(nt,) energy stored in all contacts, J; arrays as for `forces`."""
        contact, p = np.arange(self.count), self.own_internal(internal)
        row, stored = self.arrays.force[contact, phases], self.arrays.stored[contact, phases]
        constant = row[..., 2] - self.friction(phases)
        by_penetration = 0.5 * row[..., 0] * penetration + constant + np.sum(row[..., 3:] * p, axis=-1)
        z = np.concatenate([np.ones((*p.shape[:2], 1)), p], axis=2)
        energy = by_penetration * penetration + 0.5 * np.einsum("tji,tjik,tjk->tj", z, stored, z)
        if self.pressed.size:
            normal = self.forces(phases, penetration, np.zeros_like(penetration), internal)[:, self.pressing]
            strained = self.pressing_factors(phases) * normal
            energy[:, self.pressed] += 0.5 * self._compliances[self.pressed, phases[..., self.pressed]] * strained**2
        return np.asarray(energy.sum(axis=1))

    def losses(self, phases: Ints) -> tuple[Floats, Floats]:
        """Dissipated power in given phases: (m,) per squared penetration rate, (r,) per squared rate of a state."""
        a, contact = self.arrays, np.arange(self.count)
        losses = a.losses[contact, phases]
        internal = [losses[j, : a.states[j]] for j in self._with_states]
        return a.force[contact, phases, 1], np.concatenate([np.zeros(0), *internal])

    def friction(self, phases: Ints) -> Floats:
        """(..., m) constant part of each force whose work is lost, N, in phases (..., m)."""
        return np.asarray(self._friction[np.arange(self.count), phases])

    def holds(self, phases: Ints) -> Bools:
        """(m,) whether the force of each contact is what keeps its penetration."""
        return np.asarray(self._holding[np.arange(self.count), phases])

    @cached_property
    def may_hold(self) -> Bools:
        """(m,) whether a phase of each contact holds."""
        return np.asarray(self._holding.any(axis=1))

    @cached_property
    def ever_hold(self) -> bool:
        """Whether any phase of any contact holds."""
        return bool(self.may_hold.any())

    def starting_at(self, rate: Floats, least: Floats) -> Ints:
        """(m,) phases from which the search starts at penetration rates, m/s; those below ``least`` are none."""
        phases = self.start
        for j, law in enumerate(self.laws):
            if law.sliding is not None and abs(rate[j]) > least[j]:
                phases[j] = law.sliding[0 if rate[j] > 0.0 else 1]
        return phases

    def event_losses(self, before: Ints, after: Ints) -> Floats:
        """(n, m) energy lost, J, where the phases change from ``before`` to ``after``, (n, m) each."""
        return np.asarray(self._losing_events[0][np.arange(self.count), before, after])

    def pressing_losses(self, before: Ints, after: Ints) -> Floats:
        """The same of each of `pressed` for a unit of the pressing force squared, m/N."""
        return np.asarray(self._losing_events[1][self.pressed, before[:, self.pressed], after[:, self.pressed]])

    @cached_property
    def _losing_events(self) -> Floats:
        """(2, m, P, P) energy lost when a contact changes from one phase to another, J, and for a unit of the pressing
        force squared, m/N."""
        most = self.arrays.touching.shape[1]
        out = np.zeros((2, self.count, most, most))
        for j, law in enumerate(self.laws):
            for k, phase in enumerate(law.phases):
                for guard in phase.guards:
                    out[:, j, k, guard.next] = guard.loss, guard.pressing_loss
        return out

    def energy_slopes(self, phases: Ints) -> tuple[Floats, Floats]:
        """Derivatives of the energy at zero penetration by all internal states: (r, r) factors of these, and (r,) at
        zero."""
        a, r = self.arrays, self.internal_states
        by_states, constant = np.zeros((r, r)), np.zeros(r)
        for j in self._with_states:
            states = slice(a.first[j], a.first[j] + a.states[j])
            stored = a.stored[j, phases[j], : 1 + a.states[j], : 1 + a.states[j]]
            by_states[states, states], constant[states] = stored[1:, 1:], stored[1:, 0]
        return by_states, constant

    def resting_phases(self, penetration: Floats) -> Ints:
        """(m,) phases after a long rest at penetrations (m,), m."""
        phases = [law.resting_phase(float(x)) for law, x in zip(self.laws, penetration, strict=True)]
        return np.array(phases, dtype=np.int64)

    def dynamic_stiffness(self, phases: Ints, omega: Floats) -> Complexes:
        """(w, m) forces per penetration of small motions within phases at frequencies, rad/s."""
        columns = [law.dynamic_stiffness(int(k), omega) for law, k in zip(self.laws, phases, strict=True)]
        return np.array(columns, dtype=complex).reshape(self.count, omega.size).T

    def settled_states(self, penetration: Floats) -> Floats:
        """(r,) internal states after a long rest at penetrations (m,), m."""
        states = [law.settled_states(float(x)) for law, x in zip(self.laws, penetration, strict=True)]
        return np.concatenate([np.zeros(0), *states])

    @property
    def resting_load(self) -> Floats:
        """(n,) generalised force of the contacts after a long rest that does not depend on where they rest."""
        return np.asarray((self.sign * [law.resting_force for law in self.laws]) @ self.shape)

    def internal_rates(self, phases: Ints) -> tuple[Floats, Floats]:
        """Rates of all internal states in given phases.

        Returns (r, r) factors of the states themselves, and (r, m, 3) factors of each contact's penetration, its rate,
        and 1.
        """
        a, r = self.arrays, self.internal_states
        dynamics, drive = np.zeros((r, r)), np.zeros((r, self.count, 3))
        for j in self._with_states:
            first, count = a.first[j], a.states[j]
            rows = a.dynamics[j, phases[j], :count]
            dynamics[first : first + count, first : first + count] = rows[:, 3 : 3 + count]
            drive[first : first + count, j] = rows[:, :3]
        return dynamics, drive

    def coupled(self, phases: Ints) -> bool:
        """Whether internal states and structure drive each other in these phases."""
        return self.internal_states > 0 and bool(self._coupled[np.arange(self.count), phases].any())

    @cached_property
    def _coupled(self) -> Bools:
        """(m, P) phases in which a contact's internal states and the structure drive each other."""
        return self._of_phases(lambda phase: phase.coupled) > 0.0

    @cached_property
    def _holding(self) -> Bools:
        """(m, P) `holds` of each phase."""
        return self._of_phases(lambda phase: phase.holds) > 0.0

    @cached_property
    def _reactions(self) -> Floats:
        """(m, P, G) `reaction` of each guard."""
        out = np.zeros(self.arrays.next.shape)
        for j, law in enumerate(self.laws):
            for k, phase in enumerate(law.phases):
                out[j, k, : len(phase.guards)] = [guard.reaction for guard in phase.guards]
        return out

    @cached_property
    def _friction(self) -> Floats:
        """(m, P) `friction` of each phase."""
        return self._of_phases(lambda phase: phase.friction)

    @cached_property
    def _pressing_factors(self) -> Floats:
        """(m, P) `pressing` of each phase."""
        return self._of_phases(lambda phase: phase.pressing)

    @cached_property
    def _compliances(self) -> Floats:
        """(m, P) `compliance` of each phase."""
        return self._of_phases(lambda phase: phase.compliance)

    def pressing_compliances(self, phases: Ints) -> Floats:
        """Of each of `pressed` the `compliance` of its phase, m/N."""
        return np.asarray(self._compliances[self.pressed, phases[self.pressed]])

    def kept(self, phases: Ints) -> tuple[Ints, Floats]:
        """The contacts (k,) whose internal state is to be written anew in these phases, and `kept` of each (k, 2)."""
        given = [(j, self.laws[j].phases[phases[j]].kept) for j in self._with_states]
        of = [(j, kept) for j, kept in given if kept is not None]
        return np.array([j for j, _ in of], dtype=np.int64), np.array([kept for _, kept in of]).reshape(-1, 2)

    @property
    def jointly_acting(self) -> bool:
        """Whether reactions, or forces that other contacts press, act between contacts and structure."""
        return self.ever_hold or self.pressed.size > 0

    def _of_phases(self, number: Callable[[Phase], float]) -> Floats:
        """(m, P) a number of each phase of each contact."""
        out = np.zeros(self.arrays.touching.shape)
        for j, law in enumerate(self.laws):
            out[j, : len(law.phases)] = [number(phase) for phase in law.phases]
        return out

    def watched(self, phases: Ints) -> Watched:
        """What ends a contact state: the guards of its phases, contact by contact."""
        a = self.arrays
        number = a.guards[np.arange(self.count), phases]
        contact = np.repeat(np.arange(self.count), number)
        place = contact, phases[contact], np.arange(contact.size) - np.repeat(np.cumsum(number) - number, number)
        table, first = a.guard[place], np.full(contact.size, -1)
        for g in np.flatnonzero(a.resets[place]):
            j = contact[g]
            first[g] = contact.size
            table = np.vstack([table, a.reset[j, phases[j], place[2][g], : a.states[j]]])
            contact = np.append(contact, np.full(a.states[j], j))
        internal = np.zeros((contact.size, self.internal_states))
        for g in np.flatnonzero(a.states[contact]):
            j = contact[g]
            internal[g, a.first[j] : a.first[j] + a.states[j]] = table[g, 3 : 3 + a.states[j]]
        reaction, pressing, pressing_rate = np.zeros((3, contact.size))
        reaction[: first.size] = self._reactions[place]
        for rubbing in self.pressed.tolist():
            for i in np.flatnonzero(contact[: first.size] == rubbing).tolist():
                guard = self.laws[rubbing].phases[phases[rubbing]].guards[place[2][i]]
                pressing[i], pressing_rate[i] = guard.pressing, guard.pressing_rate
                if guard.reset_pressing:
                    pressing[first[i]] = guard.reset_pressing
        return Watched(
            contact, table[:, :3], internal, place[2].size, a.next[place], reaction, first, pressing, pressing_rate
        )

    @cached_property
    def arrays(self) -> PhaseArrays:
        """The laws as padded arrays."""
        m = self.count
        P = max((len(law.phases) for law in self.laws), default=1)
        G = max((len(p.guards) for law in self.laws for p in law.phases), default=1)
        states = np.array([law.internal_states for law in self.laws], dtype=np.int64)
        R = int(states.max(initial=0))
        out = PhaseArrays(
            np.ascontiguousarray(self.shape), np.asarray(self.sign, dtype=float), np.asarray(self.gap, dtype=float),
            np.asarray(self.felt, dtype=float), np.array([law.start for law in self.laws], dtype=np.int64),
            np.cumsum(states) - states, states, np.zeros((m, P), dtype=bool), np.zeros((m, P, 3 + R)),
            np.zeros((m, P, R, 3 + R)), np.zeros((m, P, 1 + R, 1 + R)), np.zeros((m, P, R)),
            np.zeros((m, P), dtype=np.int64), np.zeros((m, P, G, 3 + R)),
            np.zeros((m, P, G), dtype=np.int64), np.zeros((m, P, G), dtype=bool), np.zeros((m, P, G, R, 3 + R)),
            np.zeros((m, P, G), dtype=bool), np.zeros((m, P, G, 3 + R)),
        )  # fmt: skip
        for j, law in enumerate(self.laws):
            r = law.internal_states
            for k, phase in enumerate(law.phases):
                out.touching[j, k] = phase.touching
                out.force[j, k, : 3 + r] = phase.row(r)
                out.stored[j, k, 0, 0] = 2.0 * phase.energy
                if r:
                    out.dynamics[j, k, :r, :3] = phase.drive or 0.0
                    out.dynamics[j, k, :r, 3 : 3 + r] = phase.dynamics or 0.0
                    out.stored[j, k, 1 : 1 + r, 1 : 1 + r] = phase.stored or 0.0
                    out.stored[j, k, 0, 1 : 1 + r] = out.stored[j, k, 1 : 1 + r, 0] = phase.stored_linear or 0.0
                    out.losses[j, k, :r] = phase.losses or 0.0
                out.guards[j, k] = len(phase.guards)
                for i, guard in enumerate(phase.guards):
                    out.guard[j, k, i, : 3 + r] = guard.row(r)
                    out.next[j, k, i] = guard.next
                    if guard.reset is not None:
                        out.resets[j, k, i] = True
                        out.reset[j, k, i, :r, : 3 + r] = guard.reset
                    jump = law.jump(k, i)
                    out.jump[j, k, i, : 3 + r] = jump
                    out.jumps[j, k, i] = bool(jump.any())
        return out
