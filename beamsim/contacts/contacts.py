"""The contacts of a system: where they act, and their laws."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from beamsim.contacts.laws import (
    CONSTANT,
    INTERNAL,
    NORMAL_FORCE,
    PENETRATION,
    ContactLaw,
    LawArrays,
    OneSidedSpring,
    kelvin_voigt,
)
from beamsim.errors import MethodError
from beamsim.typing import Bools, Complexes, Floats, Ints


@dataclass(eq=False)
class Contacts:
    """m contacts with penetration ``delta = -gap - sign * (shape @ q + base_influence d)``.

    The push on the structure along ``shape`` is ``sign * force``, the force being that of the law's phase.

    Raises
    ------
    MethodError
        Where a contact with a dashpot presses friction with a tangential spring.
    """

    shape: Floats  # (m, n) deflection at the contact for a unit of each coordinate
    sign: Floats  # (m,) +1 below the structure (resists negative deflection), -1 above
    gap: Floats  # (m,) m; clearance positive, prestress negative
    on_ground: Bools  # (m,) whether it depends on the absolute deflection
    laws: tuple[ContactLaw, ...]  # (m,)
    base_participation: Floats | None = (
        None  # (m,) displacement of its place for a unit displacement d of the base; None: 1
    )
    pressed_by: Ints | None = None  # (m,) contact whose force presses each, -1 where there is none; None: nowhere

    # what follows from these
    count: int = field(init=False)  # m
    base_participations: Floats = field(init=False)  # (m,) as ``base_participation``
    base_influence: Floats = field(
        init=False
    )  # (m,) as ``base_participations`` of what is on the ground; 0 of what is on the base
    normal_contact: Ints = field(init=False)  # (m,) as ``pressed_by``
    pressed_contacts: Ints = field(init=False)  # contacts that the force of another one presses
    pressing_contacts: Ints = field(init=False)  # of each of them the contact that presses it
    internal_states: int = field(init=False)  # r, of all contacts; they follow (q, q') in the state, by contact
    state_counts: Ints = field(init=False)  # (m,) number of internal states of each contact
    first_state: Ints = field(init=False)  # (m,) index of each contact's first one among all
    state_owner: Ints = field(init=False)  # (r,) contact of each internal state
    state_column: Ints = field(init=False)  # (r,) column of each internal state in the rows of its contact's law
    may_stick_rigidly: Bools = field(init=False)  # (m,) whether a phase of each contact sticks rigidly
    any_sticks_rigidly: bool = field(init=False)  # whether any phase of any contact sticks rigidly
    start: Ints = field(init=False)  # (m,) phases from which the search for those of a given motion starts
    jointly_acting: bool = field(init=False)  # whether reactions or forces that press others act among them

    def __post_init__(self) -> None:
        self.count = m = len(self.laws)
        self.base_participations = np.ones(m) if self.base_participation is None else self.base_participation
        self.base_influence = self.on_ground * self.base_participations
        self.normal_contact = np.full(m, -1) if self.pressed_by is None else self.pressed_by
        self.pressed_contacts = np.flatnonzero(self.normal_contact >= 0)
        self.pressing_contacts = self.normal_contact[self.pressed_contacts]
        self.state_counts = np.array([law.internal_states for law in self.laws], dtype=np.int64)
        self.internal_states = int(self.state_counts.sum())
        self.first_state = np.asarray(np.cumsum(self.state_counts) - self.state_counts)
        self.state_owner = np.repeat(np.arange(m), self.state_counts)
        self.state_column = INTERNAL + np.arange(self.internal_states) - self.first_state[self.state_owner]
        self.start = np.array([law.start for law in self.laws], dtype=np.int64)
        self.may_stick_rigidly = np.array(
            [any(phase.sticks_rigidly for phase in law.phases) for law in self.laws], dtype=bool
        )
        self.any_sticks_rigidly = bool(self.may_stick_rigidly.any())
        self.jointly_acting = self.any_sticks_rigidly or self.pressed_contacts.size > 0
        if self.pressed_contacts.size:
            self._check_pressing()

    def _check_pressing(self) -> None:
        """Refuse a slider that would have to follow a force whose rate depends on accelerations."""
        for j, i in zip(self.pressed_contacts.tolist(), self.pressing_contacts.tolist(), strict=True):
            follows_rate = any(guard.row.normal_force_rate for phase in self.laws[j].phases for guard in phase.guards)
            if follows_rate and self.laws[i].arrays.force[:, 1].any():
                raise MethodError(
                    f"contact {j + 1}",
                    f"is friction with a tangential spring, and contact {i + 1}, which presses it, has a dashpot: "
                    "where the slider stops depends on the rate of that force, and so on accelerations",
                    "leave out the tangential stiffness, or the dashpot",
                )

    @cached_property
    def arrays(self) -> LawArrays:
        """The laws' arrays side by side, (m, ...), filled up with zeros."""
        sizes = [law.arrays.guard.shape for law in self.laws] or [(1, 1, INTERNAL)]
        phases, guards, columns = map(max, zip(*sizes, strict=True))
        out = LawArrays.zeros((self.count, phases), guards, columns - INTERNAL)
        for j, law in enumerate(self.laws):
            for array, own in zip(out, law.arrays, strict=True):
                place: Any = (j, *(slice(size) for size in own.shape))
                array[place] = own
        return out

    @cached_property
    def sliders(self) -> Ints:
        """Numbers of the internal states that rest but where a contact slides or yields."""
        return np.flatnonzero(np.array([law.slides_or_yields for law in self.laws], dtype=bool)[self.state_owner])

    @cached_property
    def stiffness(self) -> Floats:
        """(m,) N/m, of laws made of one stiffness and one dashpot; ValueError if there are others."""
        return self._numbers("stiffness")

    @cached_property
    def dashpot(self) -> Floats:
        """(m,) N s/m, likewise."""
        return self._numbers("dashpot")

    def _numbers(self, name: str) -> Floats:
        if any(law.rebuild is None for law in self.laws):
            raise ValueError("a contact law is not made of one stiffness and one dashpot")
        return np.array([getattr(law, name) for law in self.laws], dtype=float)

    @property
    def quasi_static(self) -> tuple[Floats, Floats]:
        """(m,) stiffness, N/m, and dashpot, N s/m, for slow motion in contact; nan for a law that gives none."""
        return np.array([law.stiffness for law in self.laws]), np.array([law.dashpot for law in self.laws])

    @cached_property
    def damped(self) -> bool:
        """Whether any phase dissipates."""
        resisted = any(p.dissipative_force.rate != 0.0 for law in self.laws for p in law.phases)
        return resisted or self.internal_states > 0 or any(law.slides_or_yields for law in self.laws)

    @property
    def one_sided(self) -> bool:
        """Whether every law is a sum of one-sided springs: no internal states, and no phase that ends at zero force."""
        return all(law.one_sided_springs is not None for law in self.laws)

    def one_sided_springs(self) -> Contacts:
        """The same forces by one-sided springs alone; each contact is replaced by its parts.

        Raises ValueError if a law is not such a sum (see `one_sided`).
        """
        if not self.one_sided:
            raise ValueError("a contact law with internal states is not a sum of one-sided springs")
        return self.split()

    def split(self) -> Contacts:
        """One contact for each part of a law that is a sum of one-sided springs.

        Other laws are unchanged, and those of contacts that press others.
        """
        if all(law.rebuild is not None for law in self.laws):
            return self
        owner, direction = self.owners_of_springs
        parts = [part for parts in self._parts for part in parts]
        laws = tuple(
            self.laws[j] if part is None else kelvin_voigt(part.stiffness, part.dashpot)
            for j, part in zip(owner.tolist(), parts, strict=True)
        )
        offset = np.array([0.0 if part is None else part.offset for part in parts])
        first = np.append(np.searchsorted(owner, np.arange(self.count)), -1)
        return Contacts(
            self.shape[owner], direction * self.sign[owner], direction * self.gap[owner] + offset,
            self.on_ground[owner], laws, self.base_participations[owner], first[self.normal_contact][owner],
        )  # fmt: skip

    @cached_property
    def _parts(self) -> list[tuple[OneSidedSpring | None, ...]]:
        """Of each contact its one-sided springs; None where it stays as it is."""
        whole = set(self.pressing_contacts.tolist())
        return [
            (None,) if law.rebuild is not None or law.one_sided_springs is None or j in whole else law.one_sided_springs
            for j, law in enumerate(self.laws)
        ]

    @property
    def owners_of_springs(self) -> tuple[Ints, Floats]:
        """Of each contact of `split` which one it is a part of, and the direction of its force in that one's."""
        owner = np.repeat(np.arange(self.count), [len(parts) for parts in self._parts])
        directions = [1.0 if part is None else part.direction for parts in self._parts for part in parts]
        return owner, np.array(directions)

    @property
    def clearances(self) -> Floats:
        """Gaps of all one-sided springs, m: one per breakpoint of a piecewise-linear law."""
        return self.split().gap

    def first_with_others(self, others: Contacts) -> Contacts:
        """These contacts followed by the others."""
        theirs = np.where(others.normal_contact < 0, -1, others.normal_contact + self.count)
        return Contacts(
            np.concatenate([self.shape, others.shape]), np.concatenate([self.sign, others.sign]),
            np.concatenate([self.gap, others.gap]), np.concatenate([self.on_ground, others.on_ground]),
            self.laws + others.laws, np.concatenate([self.base_participations, others.base_participations]),
            np.concatenate([self.normal_contact, theirs]),
        )  # fmt: skip

    def with_numbers(self, contact: int, stiffness: float, dashpot: float) -> Contacts:
        """The contacts with other numbers of one contact.

        Parameters
        ----------
        contact : its number.
        stiffness, dashpot : of its law, N/m and N s/m.

        Returns
        -------
        Contacts
            With a law of the same kind.

        Raises
        ------
        ValueError
            If the law is not made of these two.
        """
        family = self.laws[contact].rebuild
        if family is None:
            raise ValueError("this contact law is not made of one stiffness and one dashpot")
        return replace(self, laws=(*self.laws[:contact], family(stiffness, dashpot), *self.laws[contact + 1 :]))

    def undamped(self) -> Contacts:
        """Without dashpots; ValueError where a law has no such form."""
        laws = tuple(each for law in self.laws if (each := law.undamped()) is not None)
        if len(laws) < self.count:
            raise ValueError("a contact law has no undamped form")
        return replace(self, laws=laws)

    def scaled(self, factor: float) -> Contacts:
        """All forces multiplied by a positive factor."""
        return replace(self, laws=tuple(law.scaled(factor) for law in self.laws))

    # -- phases --------------------------------------------------------------------------------------------------

    def pressing_extensions(self, phases: Ints) -> Floats:
        """Extension of the spring of each of `pressed` for a unit pressing force, m/N, in phases (..., m)."""
        place = self.pressed_contacts, phases[..., self.pressed_contacts]
        strained, factor = (
            self.arrays.energy[(*place, NORMAL_FORCE, NORMAL_FORCE)],
            self.arrays.dissipative_force[(*place, NORMAL_FORCE)],
        )
        return np.asarray(np.divide(strained, factor, out=np.zeros_like(factor), where=factor != 0.0))

    def presses(self, phases: Ints) -> bool:
        """Whether a force of one contact depends on that of another in these phases."""
        return bool(
            self.arrays.dissipative_force[self.pressed_contacts, phases[self.pressed_contacts], NORMAL_FORCE].any()
        )

    def closed(self, phases: Ints) -> Bools:
        """Whether each contact touches; ``phases`` is (..., m)."""
        return np.asarray(self.arrays.closed[np.arange(self.count), phases])

    def touch_changes(self, contact: Ints, before: Ints, after: Ints) -> Ints:
        """What each event changes.

        Parameters
        ----------
        contact, before, after : (E,) of the events: contact, and its phases before and after.

        Returns
        -------
        (E,) 1 where contact is made, -1 where it ends, 0 between phases of one kind.
        """
        touching = self.arrays.closed.astype(np.int64)
        return np.asarray(touching[contact, after] - touching[contact, before])

    def phases_after(self, phases: Ints, contact: int, new_phase: int) -> Ints:
        """The phases after an event.

        Parameters
        ----------
        phases : (m,) before it.
        contact : that changes its phase; where it touches or lets go, those that it presses change theirs.
        new_phase : the contact's new phase.

        Returns
        -------
        (m,) phases.
        """
        phases = phases.copy()
        for j in self.pressed_contacts[self.pressing_contacts == contact].tolist():
            touching, then = (
                self.arrays.closed[contact],
                self.laws[j].phases[phases[j]].phase_when_normal_contact_changes,
            )
            if touching[new_phase] != touching[phases[contact]] and then is not None:
                phases[j] = then
        phases[contact] = new_phase
        return phases

    def pressed_at_start(self, phases: Ints, start: Ints) -> Ints:
        """The phases from which the search starts, with ``start`` (m,) of the contacts that a touching one presses."""
        phases, touches = phases.copy(), self.closed(phases)
        for j, i in zip(self.pressed_contacts.tolist(), self.pressing_contacts.tolist(), strict=True):
            released = self.laws[j].phases[start[j]].phase_when_normal_contact_changes
            phases[j] = start[j] if touches[i] or released is None else released
        return phases

    def guard(self, contact: int, before: int, after: int) -> Floats:
        """(C,) the function, by `LawRow.array`, that is positive until a contact changes from one phase to another."""
        a = self.arrays
        following = a.next[contact, before, : a.guards[contact, before]]
        return np.asarray(a.guard[contact, before, int(np.flatnonzero(following == after)[0])])

    def border(self, contact: int, before: int, after: int) -> tuple[float, bool]:
        """Where a contact changes from one phase to another.

        Parameters
        ----------
        contact : its number.
        before, after : the two phases.

        Returns
        -------
        Penetration there, m, and whether it is larger afterwards. If the border does not depend on the penetration
        alone: zero, and whether the contact touches afterwards.
        """
        row, a = self.guard(contact, before, after), self.arrays
        if row[1] != 0.0 or row[3:].any() or row[0] == 0.0:
            return 0.0, bool(a.closed[contact, after])
        return float(-row[2] / row[0]) + 0.0, bool(row[0] < 0.0)

    def forces(self, phases: Ints, penetration: Floats, rate: Floats, internal: Floats) -> Floats:
        """Forces of all contacts, without what others press.

        Parameters
        ----------
        phases : (m,) or (nt, m).
        penetration, rate : (nt, m), m and m/s.
        internal : (nt, r) internal states of all contacts.

        Returns
        -------
        (nt, m) N.
        """
        row = self.arrays.force[np.arange(self.count), phases]
        own = np.zeros((internal.shape[0], self.count, row.shape[-1] - INTERNAL))
        own[:, self.state_owner, self.state_column - INTERNAL] = internal
        force = row[..., 0] * penetration + row[..., 1] * rate + row[..., 2]
        return np.asarray(force + np.sum(row[..., INTERNAL:] * own, axis=-1))

    def stored_energy(self, phases: Ints, penetration: Floats, internal: Floats) -> Floats:
        """Energy stored in all contacts.

        Parameters
        ----------
        phases, penetration, internal : as for `forces`.

        Returns
        -------
        (nt,) J.
        """
        pressing = np.zeros_like(penetration)
        if self.pressed_contacts.size:
            forces = self.forces(phases, penetration, np.zeros_like(penetration), internal)
            pressing[:, self.pressed_contacts] = forces[:, self.pressing_contacts]
        energy = np.zeros(penetration.shape[0])
        for j, law in enumerate(self.laws):
            own = internal[:, self.first_state[j] : self.first_state[j] + self.state_counts[j]]
            z = np.column_stack([penetration[:, j], np.ones(energy.size), pressing[:, j], own])
            columns = [PENETRATION, CONSTANT, NORMAL_FORCE, *range(INTERNAL, INTERNAL + own.shape[1])]
            for k in range(len(law.phases)):
                now = np.flatnonzero(np.broadcast_to(phases, penetration.shape)[:, j] == k)
                energy[now] += 0.5 * np.sum(z[now] @ law.arrays.energy[k][np.ix_(columns, columns)] * z[now], axis=1)
        return energy

    def sticks_rigidly(self, phases: Ints) -> Bools:
        """(m,) whether the force of each contact is what keeps its penetration."""
        return np.asarray(self.arrays.sticks_rigidly[np.arange(self.count), phases])

    def sliding_directions(self, phases: Ints) -> Floats:
        """(..., m) +1 or -1, the direction in which each contact slides, 0 where it does not, in phases (..., m)."""
        return np.asarray(self.arrays.sliding_direction[np.arange(self.count), phases])

    @cached_property
    def lossy(self) -> Ints:
        """Contacts that lose work otherwise than by dashpots and constant friction: that yield, or fall with speed."""
        a = self.arrays
        own = (
            (a.dissipative_force[:, :, 0] != 0.0)
            | (a.dissipative_force[:, :, 1] < 0.0)
            | ((a.dissipative_force[:, :, 2] != 0.0) & (a.sliding_direction == 0.0))
        )
        return np.flatnonzero(own.any(axis=1))

    def starting_phases(self, rate: Floats, smallest_rate: Floats) -> Ints:
        """(m,) phases from which the search starts at penetration rates, m/s; those below ``smallest_rate`` are none.

        A face that holds at rest and moves slides against its force.
        """
        phases = self.start.copy()
        for j in np.flatnonzero(self.may_stick_rigidly & (np.abs(rate) > smallest_rate)).tolist():
            start = self.laws[j].phases[phases[j]]
            if start.sticks_rigidly:
                phases[j] = next(guard.next for guard in start.guards if guard.row.reaction * rate[j] < 0.0)
        return phases

    def event_losses(self, before: Ints, after: Ints) -> Floats:
        """(n, m) energy lost, J, where the phases change from ``before`` to ``after``, (n, m) each."""
        return np.asarray(self.arrays.event_loss[np.arange(self.count), before, after, 0])

    def pressing_losses(self, before: Ints, after: Ints) -> Floats:
        """The same of each of `pressed` for a unit of the pressing force squared, m/N."""
        return np.asarray(
            self.arrays.event_loss[
                self.pressed_contacts, before[:, self.pressed_contacts], after[:, self.pressed_contacts], 1
            ]
        )

    def penetrations(self, y: Floats, base: tuple[Floats, Floats] | None) -> tuple[Floats, Floats]:
        """(nt, m) m and m/s, penetrations and their rates.

        Parameters
        ----------
        y : (nt, N) states.
        base : (nt,) displacement, m, and velocity, m/s, of the base; None where it rests.

        Returns
        -------
        tuple
        """
        n, shape = self.shape.shape[1], -self.sign[:, None] * self.shape
        depth, rate = y[:, :n] @ shape.T - self.gap, y[:, n : 2 * n] @ shape.T
        if base is not None:
            sign = -self.sign * self.base_influence
            depth, rate = depth + np.multiply.outer(base[0], sign), rate + np.multiply.outer(base[1], sign)
        return depth, rate

    def resting_phases(self, penetration: Floats) -> Ints:
        """(m,) phases after a long rest at penetrations (m,), m."""
        phases = [law.resting_phase(float(x)) for law, x in zip(self.laws, penetration, strict=True)]
        return np.array(phases, dtype=np.int64)

    def dynamic_stiffness(self, phases: Ints, omega: Floats) -> Complexes:
        """(w, m) forces per penetration of small motions within phases at frequencies, rad/s."""
        columns = [law.dynamic_stiffness(int(k), omega) for law, k in zip(self.laws, phases, strict=True)]
        return np.array(columns, dtype=complex).reshape(self.count, omega.size).T

    def relaxed_states(self, penetration: Floats) -> Floats:
        """(r,) internal states after a long rest at penetrations (m,), m."""
        states = [law.relaxed_states(float(x)) for law, x in zip(self.laws, penetration, strict=True)]
        return np.concatenate([np.zeros(0), *states])

    def couples_states(self, phases: Ints) -> bool:
        """Whether internal states and structure drive each other in these phases."""
        return self.internal_states > 0 and bool(self.arrays.coupled[np.arange(self.count), phases].any())

    def states_to_rewrite(self, phases: Ints) -> tuple[Ints, Floats]:
        """The contacts (k,) whose internal state is to be written anew in these phases; (k, 2) how.

        It is the penetration less an extension, whose constant, m, and factor of the pressing force, m/N, are given.
        """
        given = [(j, law.phases[phases[j]].restart_extension) for j, law in enumerate(self.laws)]
        of = [(j, row.constant, row.normal_force) for j, row in given if row is not None]
        return np.array([j for j, *_ in of], dtype=np.int64), np.array([row for _, *row in of]).reshape(-1, 2)
