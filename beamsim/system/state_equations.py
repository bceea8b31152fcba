r"""The equations of a system under its inputs, contact state by contact state, as rows.

While every contact stays in its phase, every quantity of the motion is a row times

.. math:: z = (y, u, u'), \qquad y = (q, q', p),

the state y of N entries (coordinates, their rates, internal states of the contacts), the F inputs u and their slopes
u'; u[0] is 1. Rates of the state, contact forces, event functions, internal states after an event and channels are
arrays (k, V) of such rows, V = N + 2F.

What the law of contact j depends on is ``law[j]``, one row for each column of `beamsim.contacts.laws.LawRow.array`:
penetration, its rate, 1, the force of the contact that presses it, that force's rate, its own reaction, its internal
states. A linear function in a law, times ``law[j]``, is a row on z.

Contacts that stick rigidly: in such a phase the force is whatever keeps the penetration at its value. With the rows W
of the penetrations of these contacts for a unit of each coordinate, and the generalised force f of all else, the
reactions are those :math:`\lambda` for which :math:`W (f - W^T\lambda) = 0`. Where several do, since contacts hold one
motion together, they are those of the smallest sum of squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from beamsim.contacts.laws import CONSTANT, INTERNAL, PENETRATION, PRESSING, PRESSING_RATE, RATE, REACTION
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Bools, Floats, Ints

SMALLEST = 1e-10  # of the largest singular value of the rows: smaller ones hold nothing more
ROUND_OFF = 1e-14  # of a generalised force: what reactions leave below it is round-off, and would move what rests

RowsOf = Callable[[Ints], Floats]  # rows (k, V) in given phases of the contacts (m,)


class Equations:
    """The equations of a system under F inputs, for all phases of its contacts.

    Parameters
    ----------
    system : the structure and its contacts.
    load : (L, n) generalised forces for a unit of each of the first L channels.
    influence : (channels, m) displacement of each contact's mounting by a unit of each channel, m.
    channel : (F,) of each input; -1 for the constant one, which is the first.
    """

    def __init__(self, system: PiecewiseLinearSystem, load: Floats, influence: Floats, channel: Ints) -> None:
        n, r, F = system.size, system.contacts.internal_states, channel.size
        self.system, self.contacts, self.channel = system, system.contacts, channel
        self.states, self.width = 2 * n + r, 2 * n + r + 2 * F  # N, V
        self.coordinates, self.velocities, self.internal = slice(0, n), slice(n, 2 * n), slice(2 * n, 2 * n + r)
        self.inputs, self.slopes = slice(2 * n + r, 2 * n + r + F), slice(2 * n + r + F, self.width)
        of_inputs = (np.arange(influence.shape[0])[:, None] == channel).astype(float)
        self._load = load.T @ of_inputs[: load.shape[0]]
        self._load[:, 0] += system.constant_load
        self._mounting = self.contacts.sign[:, None] * (influence.T @ of_inputs)
        self.penetrations = -self.contacts.sign[:, None] * self.contacts.shape  # (m, n) for a unit of each coordinate

    @classmethod
    def unloaded(cls, system: PiecewiseLinearSystem) -> Equations:
        """Those of free motions under constant loads alone."""
        return cls(system, np.zeros((0, system.size)), np.zeros((0, system.contacts.count)), np.full(1, -1))

    def at(self, phases: Ints) -> StateEquations:
        """The equations with the contacts in given phases (m,)."""
        return StateEquations(self, phases)

    def laws_at(self, z: Any) -> Any:
        """(m, C, k) what the laws depend on, pressing forces and reactions apart, for columns z (V, k)."""
        c, u = self.contacts, z[self.inputs]
        law = np.zeros((c.count, INTERNAL + int(c.states.max(initial=0)), z.shape[1]), dtype=z.dtype)
        law[:, PENETRATION] = self.penetrations @ z[self.coordinates] - self._mounting @ u - np.outer(c.gap, u[0])
        law[:, RATE] = self.penetrations @ z[self.velocities] - self._mounting @ z[self.slopes]
        law[:, CONSTANT] = u[0]
        law[c.owner, c.column] = z[self.internal]
        return law

    def forces_at(self, z: Any) -> Any:
        """(n, k) generalised forces on the structure, those of contacts apart, for columns z (V, k)."""
        q, v = z[self.coordinates], z[self.velocities]
        return self._load @ z[self.inputs] - self.system.stiffness[:, None] * q - self.system.damping @ v

    @cached_property
    def law(self) -> Floats:
        """(m, C, V) what the laws depend on, pressing forces and reactions apart."""
        return np.asarray(self.laws_at(np.eye(self.width)))

    @cached_property
    def free(self) -> Floats:
        """(n, V) generalised forces on the structure, those of contacts apart."""
        return np.asarray(self.forces_at(np.eye(self.width)))

    @property
    def penetration(self) -> Floats:
        """(m, V) m."""
        return np.asarray(self.law[:, PENETRATION])

    @property
    def penetration_rate(self) -> Floats:
        """(m, V) m/s."""
        return np.asarray(self.law[:, RATE])

    @property
    def state(self) -> Floats:
        """(N, V) the state itself."""
        return np.eye(self.states, self.width)

    def rows(self, count: int, **parts: Floats | float) -> Floats:
        """Rows of which some parts are given, the others being zero.

        Parameters
        ----------
        count : k.
        parts : by name of the part of z (``coordinates``, ``velocities``, ``internal``, ``inputs``, ``slopes``), arrays
            of its width, or what broadcasts to it.

        Returns
        -------
        (k, V) array
        """
        rows = np.zeros((count, self.width))
        for name, values in parts.items():
            rows[:, getattr(self, name)] = values
        return rows

    def constant(self, values: Floats) -> Floats:
        """(k, V) quantities (k,) that do not change."""
        rows = self.rows(values.size)
        rows[:, self.inputs.start] = values
        return rows

    def signals(self, channels: Ints) -> Floats:
        """(k, V) signals of channels (k,)."""
        return self.rows(channels.size, inputs=channels[:, None] == self.channel)

    def signal_rates(self, channels: Ints) -> Floats:
        """(k, V) time derivatives of the signals of channels (k,)."""
        return self.rows(channels.size, slopes=channels[:, None] == self.channel)


@dataclass(frozen=True)
class EventFunctions:
    """What ends a contact state: g functions that are positive until then."""

    contact: Ints  # (g,) contact that changes its phase
    next: Ints  # (g,) its phase afterwards
    rows: Floats  # (w, V) the g functions, then the internal states after events that set them anew
    reset: Ints  # (g,) first of the rows that give the contact's internal states after the event; -1: they go on
    joining: int  # how many, the first ones, are of contacts that join others at rest: where one acts, no other does

    @property
    def count(self) -> int:
        """g."""
        return int(self.contact.size)

    @property
    def guards(self) -> Floats:
        """(g, V) the functions."""
        return self.rows[: self.count]

    def of_change(self, contact: int, after: int) -> int:
        """Number of the function whose event takes a contact to a phase."""
        return int(np.flatnonzero((self.contact == contact) & (self.next == after))[0])


class StateEquations:
    """The equations with the contacts in given phases: arrays of rows on z, or their values for given z.

    Parameters
    ----------
    equations : of the system under its inputs.
    phases : (m,) of the contacts.
    z : (V, k) columns, whose values take the place of rows; by default a unit of each entry. Each contact force then
        acts along the contact's own shape, its terms added before: where both sides of a stiff contact move together,
        or follow the base, the round-off of a product with the rates would be a load of slow motions.
    """

    force: Floats  # (m, V) contact forces, reactions included, N
    law: Floats  # (m, C, V) what the laws depend on
    factors: Floats  # (m, C) of ``law`` in the forces, reactions apart
    held: Floats  # (n, h) orthonormal directions that rigidly sticking contacts keep at rest

    def __init__(self, equations: Equations, phases: Ints, z: Any = None) -> None:
        c, every = equations.contacts, np.arange(equations.contacts.count)
        self.equations, self.phases, self._z = equations, phases, z
        self.factors = factors = c.arrays.force[every, phases]
        law = equations.law if z is None else equations.laws_at(z)
        if c.jointly_acting:
            law = law.copy()
        self.law, self.held = law, np.zeros((equations.system.size, 0))
        if c.pressed.size:
            law[c.pressed, PRESSING] = _products(factors[c.pressing], law[c.pressing])
            rate = factors[c.pressing, :1] * law[c.pressing, RATE]
            if c.internal_states:
                own = factors[c.pressing, INTERNAL:, None] * self._internal_rates_by_contact()[c.pressing]
                rate = rate + own.sum(axis=1)
            law[c.pressed, PRESSING_RATE] = rate
        self.force = _products(factors, law)
        sticking = np.flatnonzero(c.holds(phases)) if c.ever_hold else np.zeros(0, dtype=np.int64)
        if sticking.size:
            left, size, right = np.linalg.svd(equations.penetrations[sticking], full_matrices=False)
            rank = int(np.sum(size > SMALLEST * size.max()))
            self.held, share = right[:rank].T, (left[:, :rank] / size[:rank]) @ right[:rank]
            law[sticking, REACTION] = share @ self._applied
            self.force[sticking] += law[sticking, REACTION]

    @cached_property
    def _applied(self) -> Any:
        """(n, V) generalised forces, the reactions of contacts that stick rigidly apart."""
        free = self.equations.free if self._z is None else self.equations.forces_at(self._z)
        return free - self.equations.penetrations.T @ _products(self.factors, self.law)

    @property
    def push(self) -> Floats:
        """(m, n) generalised force for a unit of each contact's own force, friction that it presses included."""
        c, push = self.equations.contacts, -self.equations.penetrations
        np.add.at(push, c.pressing, self.factors[c.pressed, PRESSING, None] * push[c.pressed])
        return np.asarray(push)

    def released(self, forces: Any) -> Any:
        """Generalised forces (n, k) without what reactions balance; what is left of those that they balance wholly is
        set to zero, so that stuck contacts stay at rest."""
        if not self.held.shape[1]:
            return forces
        left, size = forces - self.held @ (self.held.T @ forces), np.linalg.norm(forces, axis=0)
        return np.where(np.linalg.norm(left, axis=0) <= ROUND_OFF * size, 0.0, left)

    @cached_property
    def rates(self) -> Floats:
        """(N, V) time derivative of the state."""
        e = self.equations
        n = e.system.size
        velocities = e.rows(n, velocities=np.eye(n)) if self._z is None else self._z[e.velocities]
        return np.vstack([velocities, self.released(self._applied), self.internal_rates])

    @cached_property
    def internal_rates(self) -> Floats:
        """(r, V) time derivatives of the internal states of all contacts."""
        c = self.equations.contacts
        if not c.internal_states:
            return np.zeros((0, self.law.shape[2]))
        return np.asarray(self._internal_rates_by_contact()[c.owner, c.column - INTERNAL])

    def _internal_rates_by_contact(self) -> Any:
        """(m, R, V) filled up with zeros."""
        c = self.equations.contacts
        return c.arrays.rates[np.arange(c.count), self.phases] @ self.law

    @property
    def internal_factors(self) -> Floats:
        """(r,) of each internal state in the force of its own contact, N per unit."""
        c = self.equations.contacts
        return np.asarray(self.factors[c.owner, c.column])

    @property
    def internal_drive(self) -> Floats:
        """(r, C) factors of what the law of its contact depends on in the rate of each internal state."""
        c = self.equations.contacts
        return np.asarray(c.arrays.rates[c.owner, self.phases[c.owner], c.column - INTERNAL])

    @property
    def pressing(self) -> Floats:
        """(p, V) of each contact that another one presses the force of that one, N."""
        return np.asarray(self.law[self.equations.contacts.pressed, PRESSING])

    @property
    def pressing_rate(self) -> Floats:
        """(p, V) time derivatives of these forces, N/s, of contacts without a dashpot."""
        return np.asarray(self.law[self.equations.contacts.pressed, PRESSING_RATE])

    @property
    def openings(self) -> Floats:
        """(m, V) distances of the contacts to their faces as these are now, m; 0 of what touches or is held."""
        c = self.equations.contacts
        return np.asarray(_products(c.arrays.opening[np.arange(c.count), self.phases], self.law))

    @cached_property
    def events(self) -> EventFunctions:
        """What ends this contact state."""
        c, a, phases = self.equations.contacts, self.equations.contacts.arrays, self.phases
        every = np.arange(c.count)
        contact, place = np.nonzero(np.arange(a.guard.shape[2]) < a.guards[every, phases][:, None])
        rows, after = (a.guard[every, phases] @ self.law)[contact, place], a.next[contact, phases[contact], place]
        joins = self._resting[contact] & (a.guard[contact, phases[contact], place, RATE] != 0.0)
        order, joining = np.argsort(~joins, kind="stable"), int(joins.sum())
        contact, place, rows, after = contact[order], place[order], rows[order], after[order]
        for g in range(joining):
            rows[g] = self._joining(int(contact[g]), int(after[g]))
        reset, fresh, count = np.full(contact.size, -1), [], contact.size
        for g in np.flatnonzero(a.resets[contact, phases[contact], place]).tolist():
            j = contact[g]
            fresh.append(a.reset[j, phases[j], place[g], : c.states[j]] @ self.law[j])
            reset[g], count = count, count + int(c.states[j])
        return EventFunctions(contact, after, np.concatenate([rows, *fresh]), reset, joining)

    @property
    def _resting(self) -> Bools:
        """(m,) contacts whose motion others hold: those at the same place, for example."""
        shape = self.equations.contacts.shape
        if not self.held.shape[1]:
            return np.zeros(shape.shape[0], dtype=bool)
        left = np.linalg.norm(shape - (shape @ self.held) @ self.held.T, axis=1)
        return np.asarray(left <= SMALLEST * np.linalg.norm(shape, axis=1))

    def _joining(self, contact: int, stuck: int) -> Floats:
        """(V,) what ends the sliding of a contact whose motion others hold, so that its rate is zero.

        It sticks where that takes less than its limit: until then this is by how much the limit is exceeded, N.
        """
        c = self.equations.contacts
        limit = next(g.row for g in c.laws[contact].phases[stuck].guards if g.next == self.phases[contact])
        law = self.equations.at(c.after(self.phases, contact, stuck)).law[contact]
        return np.asarray(-limit.reaction * law[REACTION] - limit.constant * law[CONSTANT])

    def state_after(self, event: int) -> Floats:
        """(N, V) the state after an event, by the number of its function."""
        e, c, state = self.equations, self.equations.contacts, self.equations.state
        if self.events.reset[event] >= 0:
            j = int(self.events.contact[event])
            first, row, count = e.internal.start + int(c.first[j]), int(self.events.reset[event]), int(c.states[j])
            state[first : first + count] = self.events.rows[row : row + count]
        return state

    @property
    def lost_by_rate(self) -> Floats:
        """(m + r,) dissipated power per squared rate, of penetrations and of internal states, N s/m."""
        c, every = self.equations.contacts, np.arange(self.equations.contacts.count)
        of_states = c.arrays.losses[c.owner, self.phases[c.owner], c.column - INTERNAL]
        return np.concatenate([c.arrays.lost[every, self.phases, RATE], of_states])

    @cached_property
    def dissipation(self) -> tuple[Floats, Floats]:
        """(m + r, V) dissipative forces in the contacts, N, and the rates on which they act, m/s; what events lose
        comes on top."""
        c, every = self.equations.contacts, np.arange(self.equations.contacts.count)
        lost = c.arrays.lost[every, self.phases]
        moved = self.law[:, RATE].copy()
        if c.pressed.size:  # the spring of a slider gives way
            moved[c.pressed] -= c.pressing_stretches(self.phases)[:, None] * self.law[c.pressed, PRESSING_RATE]
        forces = np.vstack([_products(lost, self.law), self.lost_by_rate[c.count :, None] * self.internal_rates])
        return forces, np.vstack([moved, self.internal_rates])

    @property
    def sliding_speeds(self) -> Floats:
        """(m, V) speeds at which the contacts slide, m/s; 0 of those that do not."""
        c = self.equations.contacts
        return np.asarray(c.slides(self.phases)[:, None] * self.dissipation[1][: c.count])


def _products(rows: Floats, law: Any) -> Any:
    """(k, V) of rows (k, C), each with what its own law depends on, (k, C, V)."""
    return (rows[:, None, :] @ law)[:, 0]
