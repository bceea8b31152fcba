"""The contacts of a system: places, gaps and laws."""

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
    """The m contacts of a system, with penetration ``delta = -gap - sign * (shape @ q + base_influence @ d)``.

    d are the displacements of the base, one for each of its K motions.

    The force on the structure along ``shape`` is ``sign * force``, with the force from the current phase of the law.

    Raises
    ------
    MethodError
        If a contact with a dashpot is the normal contact of friction with a tangential spring.
    """

    shape: Floats  # (m, n) deflection at each contact for a unit of each coordinate
    sign: Floats  # (m,) +1 below the structure (resists negative deflection), -1 above
    gap: Floats  # (m,) m; clearance positive, prestress negative
    on_ground: Bools  # (m,) whether it depends on the absolute deflection
    laws: tuple[ContactLaw, ...]  # (m,)
    # (m, K) displacement of its place for a unit of each displacement of the base; None: 1 for the only one
    base_participation: Floats | None = None
    # (m,) normal contact of each friction contact, -1 for others; None: no such contacts
    pressed_by: Ints | None = None

    # derived fields
    count: int = field(init=False)  # m
    base_participations: Floats = field(init=False)  # (m, K) as ``base_participation``
    # (m, K) ``base_participations`` of contacts on the ground; 0 for those on the base
    base_influence: Floats = field(init=False)
    normal_contact: Ints = field(init=False)  # (m,) as ``pressed_by``, -1 everywhere if that is None
    pressed_contacts: Ints = field(init=False)  # friction contacts with a normal contact
    pressing_contacts: Ints = field(init=False)  # normal contact of each of them
    # r, number of internal states of all contacts; they follow (q, q') in the state, by contact
    internal_states: int = field(init=False)
    state_counts: Ints = field(init=False)  # (m,) number of internal states of each contact
    first_state: Ints = field(init=False)  # (m,) index of the first internal state of each contact
    state_owner: Ints = field(init=False)  # (r,) contact of each internal state
    state_column: Ints = field(init=False)  # (r,) column of each internal state in the rows of its contact's law
    may_stick_rigidly: Bools = field(init=False)  # (m,) whether a phase of each contact sticks rigidly
    any_sticks_rigidly: bool = field(init=False)  # whether any phase of any contact sticks rigidly
    start: Ints = field(init=False)  # (m,) phases in which the search for the phases of a given motion starts
    jointly_acting: bool = field(init=False)  # whether contacts stick rigidly or have a normal contact

    def __post_init__(self) -> None:
        self.count = m = len(self.laws)
        self.base_participations = np.ones((m, 1)) if self.base_participation is None else self.base_participation
        self.base_influence = np.asarray(self.on_ground)[:, None] * self.base_participations
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
        """Refuse friction whose limit would depend on the rate of a force that depends on accelerations."""
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
        """The arrays of all laws, stacked (m, ...) and padded with zeros."""
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
        """Indices of internal states that change only during sliding or yielding."""
        return np.flatnonzero(np.array([law.slides_or_yields for law in self.laws], dtype=bool)[self.state_owner])

    @cached_property
    def stiffness(self) -> Floats:
        """(m,) stiffness, N/m; ValueError if a law is more than a stiffness and a dashpot."""
        return self._numbers("stiffness")

    @cached_property
    def dashpot(self) -> Floats:
        """(m,) dashpot, N s/m; ValueError if a law is more than a stiffness and a dashpot."""
        return self._numbers("dashpot")

    def _numbers(self, name: str) -> Floats:
        if any(law.rebuild is None for law in self.laws):
            raise ValueError("a contact law is not made of one stiffness and one dashpot")
        return np.array([getattr(law, name) for law in self.laws], dtype=float)

    @property
    def quasi_static(self) -> tuple[Floats, Floats]:
        """(m,) stiffness, N/m, and dashpot, N s/m, for slow motion in contact; nan if a law has no such value."""
        return np.array([law.stiffness for law in self.laws]), np.array([law.dashpot for law in self.laws])

    @cached_property
    def damped(self) -> bool:
        """Whether any phase dissipates."""
        resisted = any(p.dissipative_force.rate != 0.0 for law in self.laws for p in law.phases)
        return resisted or self.internal_states > 0 or any(law.slides_or_yields for law in self.laws)

    @property
    def one_sided(self) -> bool:
        """Whether all laws are sums of one-sided springs, without internal states or phases that end at zero force."""
        return all(law.one_sided_springs is not None for law in self.laws)

    def one_sided_springs(self) -> Contacts:
        """The same contacts, each replaced by one-sided springs with the same total force.

        Raises ValueError if a law is not a sum of one-sided springs (see `one_sided`).
        """
        if not self.one_sided:
            raise ValueError("a contact law with internal states is not a sum of one-sided springs")
        return self.split()

    def split(self) -> Contacts:
        """Replace each law that is a sum of one-sided springs by one contact for each spring.

        Other laws, and contacts that are normal contacts of friction, are unchanged.
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
        """The one-sided springs of each contact; None for a contact that is not split."""
        whole = set(self.pressing_contacts.tolist())
        return [
            (None,) if law.rebuild is not None or law.one_sided_springs is None or j in whole else law.one_sided_springs
            for j, law in enumerate(self.laws)
        ]

    @property
    def owners_of_springs(self) -> tuple[Ints, Floats]:
        """For each contact of `split` the original contact, and the sign of its force in it."""
        owner = np.repeat(np.arange(self.count), [len(parts) for parts in self._parts])
        directions = [1.0 if part is None else part.direction for parts in self._parts for part in parts]
        return owner, np.array(directions)

    @property
    def clearances(self) -> Floats:
        """Gaps of all one-sided springs, m: one for each breakpoint of a piecewise-linear law."""
        return self.split().gap

    def first_with_others(self, others: Contacts) -> Contacts:
        """These contacts followed by others."""
        theirs = np.where(others.normal_contact < 0, -1, others.normal_contact + self.count)
        return Contacts(
            np.concatenate([self.shape, others.shape]), np.concatenate([self.sign, others.sign]),
            np.concatenate([self.gap, others.gap]), np.concatenate([self.on_ground, others.on_ground]),
            self.laws + others.laws, np.concatenate([self.base_participations, others.base_participations]),
            np.concatenate([self.normal_contact, theirs]),
        )  # fmt: skip

    def with_numbers(self, contact: int, stiffness: float, dashpot: float) -> Contacts:
        """A copy with another stiffness and dashpot for one contact.

        Parameters
        ----------
        contact : index of the contact.
        stiffness, dashpot : new values, N/m and N s/m.

        Returns
        -------
        Contacts
            With a law of the same kind.

        Raises
        ------
        ValueError
            If the law is more than a stiffness and a dashpot.
        """
        family = self.laws[contact].rebuild
        if family is None:
            raise ValueError("this contact law is not made of one stiffness and one dashpot")
        return replace(self, laws=(*self.laws[:contact], family(stiffness, dashpot), *self.laws[contact + 1 :]))

    def undamped(self) -> Contacts:
        """A copy without dashpots; ValueError if a law has no such form."""
        laws = tuple(each for law in self.laws if (each := law.undamped()) is not None)
        if len(laws) < self.count:
            raise ValueError("a contact law has no undamped form")
        return replace(self, laws=laws)

    def scaled(self, factor: float) -> Contacts:
        """A copy with all forces multiplied by a positive factor."""
        return replace(self, laws=tuple(law.scaled(factor) for law in self.laws))

    # -- phases --------------------------------------------------------------------------------------------------

    def pressing_extensions(self, phases: Ints) -> Floats:
        """(..., p) spring extension of each friction contact with a normal contact, for a unit normal force, m/N."""
        place = self.pressed_contacts, phases[..., self.pressed_contacts]
        strained, factor = (
            self.arrays.energy[(*place, NORMAL_FORCE, NORMAL_FORCE)],
            self.arrays.dissipative_force[(*place, NORMAL_FORCE)],
        )
        return np.asarray(np.divide(strained, factor, out=np.zeros_like(factor), where=factor != 0.0))

    def presses(self, phases: Ints) -> bool:
        """Whether the force of one contact depends on that of another in these phases."""
        pressed = self.pressed_contacts
        return bool(self.arrays.dissipative_force[pressed, phases[pressed], NORMAL_FORCE].any())

    def closed(self, phases: Ints) -> Bools:
        """(..., m) whether each contact is closed, for phases (..., m)."""
        return np.asarray(self.arrays.closed[np.arange(self.count), phases])

    def touch_changes(self, contact: Ints, before: Ints, after: Ints) -> Ints:
        """Whether each event closes or opens its contact.

        Parameters
        ----------
        contact, before, after : (E,) contact of each event, and its phases before and after.

        Returns
        -------
        (E,) 1 if the contact closes, -1 if it opens, 0 otherwise.
        """
        touching = self.arrays.closed.astype(np.int64)
        return np.asarray(touching[contact, after] - touching[contact, before])

    def phases_after(self, phases: Ints, contact: int, new_phase: int) -> Ints:
        """The phases after an event.

        Parameters
        ----------
        phases : (m,) phases before the event.
        contact : contact that changes its phase; friction contacts of which it is the normal contact may change too.
        new_phase : the new phase of the contact.

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
        """(m,) phases in which the search starts, from ``start`` (m,) for friction under closed normal contacts."""
        phases, touches = phases.copy(), self.closed(phases)
        for j, i in zip(self.pressed_contacts.tolist(), self.pressing_contacts.tolist(), strict=True):
            released = self.laws[j].phases[start[j]].phase_when_normal_contact_changes
            phases[j] = start[j] if touches[i] or released is None else released
        return phases

    def guard(self, contact: int, before: int, after: int) -> Floats:
        """(C,) guard function of a phase change, as factors in the order of `LawRow.array`."""
        a = self.arrays
        following = a.next[contact, before, : a.guards[contact, before]]
        return np.asarray(a.guard[contact, before, int(np.flatnonzero(following == after)[0])])

    def boundary(self, contact: int, before: int, after: int) -> tuple[float, bool]:
        """Penetration at which a contact changes from one phase to another.

        Parameters
        ----------
        contact : index of the contact.
        before, after : the two phases.

        Returns
        -------
        Penetration there, m, and whether it is larger afterwards. If the phase change does not depend on the
        penetration alone: zero, and whether the contact is closed afterwards.
        """
        row, a = self.guard(contact, before, after), self.arrays
        if row[1] != 0.0 or row[3:].any() or row[0] == 0.0:
            return 0.0, bool(a.closed[contact, after])
        return float(-row[2] / row[0]) + 0.0, bool(row[0] < 0.0)

    def forces(self, phases: Ints, penetration: Floats, rate: Floats, internal: Floats) -> Floats:
        """Forces of all contacts, without the contribution of normal forces.

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
        """(m,) whether each contact sticks rigidly."""
        return np.asarray(self.arrays.sticks_rigidly[np.arange(self.count), phases])

    def sliding_directions(self, phases: Ints) -> Floats:
        """(..., m) direction of sliding in phases (..., m): +1 or -1, 0 for contacts that do not slide."""
        return np.asarray(self.arrays.sliding_direction[np.arange(self.count), phases])

    @cached_property
    def lossy(self) -> Ints:
        """Contacts that dissipate energy by yielding, or by friction that falls with speed."""
        a = self.arrays
        own = (
            (a.dissipative_force[:, :, 0] != 0.0)
            | (a.dissipative_force[:, :, 1] < 0.0)
            | ((a.dissipative_force[:, :, 2] != 0.0) & (a.sliding_direction == 0.0))
        )
        return np.flatnonzero(own.any(axis=1))

    def starting_phases(self, rate: Floats, smallest_rate: Floats) -> Ints:
        """(m,) phases in which the search starts; rates, m/s, below ``smallest_rate`` count as zero.

        A face that sticks at rest starts to slide against its friction force.
        """
        phases = self.start.copy()
        for j in np.flatnonzero(self.may_stick_rigidly & (np.abs(rate) > smallest_rate)).tolist():
            start = self.laws[j].phases[phases[j]]
            if start.sticks_rigidly:
                phases[j] = next(guard.next for guard in start.guards if guard.row.reaction * rate[j] < 0.0)
        return phases

    def event_losses(self, before: Ints, after: Ints) -> Floats:
        """(n, m) energy loss, J, at phase changes from ``before`` to ``after``, each (n, m)."""
        return np.asarray(self.arrays.event_loss[np.arange(self.count), before, after, 0])

    def pressing_losses(self, before: Ints, after: Ints) -> Floats:
        """(n, p) energy loss of friction contacts at phase changes, for a unit squared normal force, m/N."""
        return np.asarray(
            self.arrays.event_loss[
                self.pressed_contacts, before[:, self.pressed_contacts], after[:, self.pressed_contacts], 1
            ]
        )

    def penetrations(self, y: Floats, base: tuple[Floats, Floats] | None) -> tuple[Floats, Floats]:
        """(nt, m) penetrations, m, and their rates, m/s.

        Parameters
        ----------
        y : (nt, N) states.
        base : (nt, K) displacements, m, and velocities, m/s, of the base; None if it is at rest.

        Returns
        -------
        tuple
        """
        n, shape = self.shape.shape[1], -self.sign[:, None] * self.shape
        depth, rate = y[:, :n] @ shape.T - self.gap, y[:, n : 2 * n] @ shape.T
        if base is not None:
            by_base = -(self.sign[:, None] * self.base_influence).T
            depth, rate = depth + base[0] @ by_base, rate + base[1] @ by_base
        return depth, rate

    def resting_phases(self, penetration: Floats) -> Ints:
        """(m,) phases after a long rest at penetrations (m,), m."""
        phases = [law.resting_phase(float(x)) for law, x in zip(self.laws, penetration, strict=True)]
        return np.array(phases, dtype=np.int64)

    def dynamic_stiffness(self, phases: Ints, omega: Floats) -> Complexes:
        """(w, m) dynamic stiffness of each contact within its phase at angular frequencies, rad/s."""
        columns = [law.dynamic_stiffness(int(k), omega) for law, k in zip(self.laws, phases, strict=True)]
        return np.array(columns, dtype=complex).reshape(self.count, omega.size).T

    def relaxed_states(self, penetration: Floats) -> Floats:
        """(r,) internal states after a long rest at penetrations (m,), m."""
        states = [law.relaxed_states(float(x)) for law, x in zip(self.laws, penetration, strict=True)]
        return np.concatenate([np.zeros(0), *states])

    def couples_states(self, phases: Ints) -> bool:
        """Whether internal states and structure are coupled in these phases."""
        return self.internal_states > 0 and bool(self.arrays.coupled[np.arange(self.count), phases].any())

    def states_to_rewrite(self, phases: Ints) -> tuple[Ints, Floats]:
        """Contacts (k,) whose internal state must be reset before a motion is restarted, and (k, 2) the new values.

        The new state is the penetration minus an extension: a constant, m, plus a factor of the normal force, m/N.
        """
        given = [(j, law.phases[phases[j]].restart_extension) for j, law in enumerate(self.laws)]
        of = [(j, row.constant, row.normal_force) for j, row in given if row is not None]
        return np.array([j for j, *_ in of], dtype=np.int64), np.array([row for _, *row in of]).reshape(-1, 2)
