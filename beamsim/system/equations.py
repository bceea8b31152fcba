r"""Equations of motion of a system in mass-normalised coordinates, contact state by contact state, and its channels.

With every contact in one phase of its law, the system is linear,

.. math:: \ddot q + C_s \dot q + K_s q = f_0 + \sum_l L_l\, a_l(t) + \text{contact constants},

where :math:`M = I` and the open structure's stiffness is diagonal. Nothing here knows files, units
or what the coordinates stand for.

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

A channel is an observable, a linear row on the motion and on what acts on it,

.. math:: y = D q + V q' + A q'' + a\, \ddot d + b\, d + F f + G g + S s(t) + c + P p(q)

with the coordinates q relative to the base, the base's displacement d, the forces f of the contacts and their openings
g, the signals s of the loads and the pulls p of cubic springs. Whoever evaluates channels needs to know no more of them
than this.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import CONSTANT, INTERNAL, NORMAL_FORCE, NORMAL_FORCE_RATE, PENETRATION, RATE, REACTION
from beamsim.inputs.signal import Signal
from beamsim.typing import Complexes, Floats, Ints

NEGLIGIBLE_SINGULAR_VALUE = 1e-10  # of the largest singular value of the rows: smaller ones hold nothing more
ROUND_OFF = 1e-14  # of a generalised force: what reactions leave below it is round-off, and would move what rests

Number = TypeVar("Number", np.float64, np.complex128)
RowsOf = Callable[[Ints], Floats]  # rows (k, V) in given phases of the contacts (m,)


@dataclass(frozen=True)
class PiecewiseLinearSystem:
    """A structure in n mass-normalised coordinates (M = I) with m contacts."""

    stiffness: Floats  # (n,) diagonal of K of the open structure, rad^2/s^2; exact zeros for rigid-body modes
    damping: Floats  # (n, n) symmetric C of the open structure, 1/s
    contacts: Contacts
    constant_load: Floats  # (n,) gravity and dead loads, N per sqrt(kg)

    @property
    def size(self) -> int:
        """n."""
        return int(self.stiffness.size)

    @cached_property
    def fastest(self) -> float:
        """rad/s, that no natural frequency with all contacts closed exceeds."""
        contacts = self.contacts
        closed = np.abs(contacts.arrays.force[:, :, 0]).max(axis=1, initial=0.0) @ (contacts.shape**2).sum(axis=1)
        return float(np.sqrt(self.stiffness.max(initial=0.0) + closed))

    @cached_property
    def coupled_by_damping(self) -> bool:
        """Whether C of the open structure has entries off its diagonal."""
        return bool(np.count_nonzero(self.damping) > np.count_nonzero(np.diag(self.damping)))

    def contacts_act(self, phases: Ints) -> bool:
        """True if a contact pushes or sticks in the given phases, or has internal states that move by themselves."""
        arrays, every = self.contacts.arrays, np.arange(self.contacts.count)
        pushing = arrays.force[every, phases, :NORMAL_FORCE].any() or arrays.sticks_rigidly[every, phases].any()
        return self.contacts.internal_states > 0 or bool(pushing)

    def one_sided(self) -> PiecewiseLinearSystem:
        """The same with one-sided springs as the only contacts; see `Contacts.one_sided_springs`."""
        springs = self.contacts.one_sided_springs()
        return self if springs is self.contacts else replace(self, contacts=springs)


@dataclass(frozen=True)
class Forcing:
    """Time-dependent loads: ``sum_l load[l] * signal[l](t)``, and the base's own displacement d(t).

    ``base_displacement`` is needed only by contacts on the ground (``None`` means d = 0), ``influence`` by contacts on
    what moves by signals of its own.
    """

    load: Floats  # (L, n)
    signal: tuple[Signal, ...]  # (L,)
    base_displacement: Signal | None = None
    influence: Floats | None = (
        None  # (m, L) displacement of each contact's place from its stand by a unit of each signal
    )


@dataclass(frozen=True)
class SineLoads:
    """The loads of a forcing as multiples of one sine: load l is ``coefficient[l] (i omega)^power[l]`` times it.

    The sine is the acceleration of the base or of a support that moves, the force, or what multiplies several forces.
    """

    coefficient: Complexes  # (L,)
    power: Ints  # (L,)

    def at(self, omega: Floats) -> Complexes:
        """(F, L) multiples at angular frequencies (F,), rad/s."""
        return np.asarray(self.coefficient * (1j * omega[:, None]) ** self.power)


class Equations:
    """The equations of a system under F inputs, for all phases of its contacts.

    Parameters
    ----------
    system : the structure and its contacts.
    load : (L, n) generalised forces for a unit of each of the first L channels; by default none.
    influence : (channels, m) displacement of each contact's mounting by a unit of each channel, m; by default none.
    channel : (F,) of each input; -1 for the constant one, which is the first and by default the only one.
    """

    def __init__(
        self, system: PiecewiseLinearSystem, load: Floats | None = None, influence: Floats | None = None,
        channel: Ints | None = None,
    ) -> None:  # fmt: skip
        c = system.contacts
        load = np.zeros((0, system.size)) if load is None else load
        influence = np.zeros((0, c.count)) if influence is None else influence
        channel = np.full(1, -1) if channel is None else channel
        n, r, F = system.size, c.internal_states, channel.size
        self.system, self.contacts, self.channel = system, c, channel
        self.states, self.width = 2 * n + r, 2 * n + r + 2 * F  # N, V
        self.coordinates, self.velocities, self.internal = slice(0, n), slice(n, 2 * n), slice(2 * n, 2 * n + r)
        self.inputs, self.slopes = slice(2 * n + r, 2 * n + r + F), slice(2 * n + r + F, self.width)
        of_inputs = (np.arange(influence.shape[0])[:, None] == channel).astype(float)
        self._load = load.T @ of_inputs[: load.shape[0]]
        self._load[:, 0] += system.constant_load
        self._mounting = c.sign[:, None] * (influence.T @ of_inputs)
        self.penetrations = -c.sign[:, None] * c.shape  # (m, n) for a unit of each coordinate
        self.unit = np.eye(self.width)  # (V, V) z for a unit of each of its entries
        self.state = self.unit[: self.states]  # (N, V) the state itself
        self.law = np.zeros((c.count, INTERNAL + int(c.state_counts.max(initial=0)), self.width))
        self.law[:, PENETRATION, self.coordinates] = self.law[:, RATE, self.velocities] = self.penetrations
        self.law[:, PENETRATION, self.inputs] = self.law[:, RATE, self.slopes] = -self._mounting
        self.law[:, PENETRATION, self.inputs.start] -= c.gap
        self.law[:, CONSTANT, self.inputs.start] = 1.0
        self.law[c.state_owner, c.state_column] = self.unit[self.internal]
        self.free = self.rows(  # (n, V) generalised forces on the structure, those of contacts apart
            n, coordinates=-np.diag(system.stiffness), velocities=-system.damping, inputs=self._load
        )
        self.penetration, self.penetration_rate = self.law[:, PENETRATION], self.law[:, RATE]  # (m, V) m and m/s

    def rows(self, count: int, **blocks: Floats | float) -> Floats:
        """Rows of which some blocks are given, the others being zero.

        Parameters
        ----------
        count : k.
        blocks : by name of the block of z (``coordinates``, ``velocities``, ``internal``, ``inputs``, ``slopes``)
            arrays of its width, or what broadcasts to it.

        Returns
        -------
        (k, V) array
        """
        rows = np.zeros((count, self.width))
        for name, values in blocks.items():
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


@dataclass(frozen=True)
class EventFunctions:
    """What ends a contact state: g functions that are positive until then."""

    count: int  # g
    contact: Ints  # (g,) contact that changes its phase
    next: Ints  # (g,) its phase afterwards
    rows: Floats  # (w, V) the g functions, then the internal states after events that set them anew
    guards: Floats  # (g, V) the functions alone
    reset_row: Ints  # (g,) first of the rows that give the contact's internal states after the event; -1: they go on
    joining_count: (
        int  # how many, the first ones, are of contacts that join others at rest: where one acts, no other does
    )

    def of_change(self, contact: int, after: int) -> int:
        """Number of the function whose event takes a contact to a phase."""
        return int(np.flatnonzero((self.contact == contact) & (self.next == after))[0])


class StateEquations:
    """The equations with the contacts in given phases: arrays of rows on z.

    Parameters
    ----------
    equations : of the system under its inputs.
    phases : (m,) of the contacts.
    """

    factors: Floats  # (m, C) of ``law`` in the contact forces, reactions apart
    law: Floats  # (m, C, V) what the laws depend on
    force: Floats  # (m, V) contact forces, reactions included, N
    normal_force: Floats  # (p, V) of each contact that another one presses the force of that one, N
    stuck_directions: Floats  # (n, h) orthonormal directions that rigidly sticking contacts keep at rest
    internal_factors: Floats  # (r,) of each internal state in the force of its own contact, N per unit
    internal_rate_factors: Floats  # (r, C) factors of what the law of its contact depends on in the rate of each
    internal_rates: Floats  # (r, V) time derivatives of the internal states of all contacts
    rates: Floats  # (N, V) time derivative of the state

    def __init__(self, equations: Equations, phases: Ints) -> None:
        e, c, every = equations, equations.contacts, np.arange(equations.contacts.count)
        self.equations, self.phases = equations, phases
        self.law = e.law.copy() if c.jointly_acting else e.law
        self.factors, drive = c.arrays.force[every, phases], c.arrays.rates[every, phases]
        if c.pressed_contacts.size:
            self._add_pressing(drive)
        self.normal_force = self.law[c.pressed_contacts, NORMAL_FORCE]
        self.force = self._own_force = _products(self.factors, self.law)
        applied = e.free - e.penetrations.T @ self.force  # generalised forces, the reactions of those that stick apart
        self.stuck_directions, acceleration = np.zeros((e.system.size, 0)), applied
        sticking = np.flatnonzero(c.arrays.sticks_rigidly[every, phases])
        if sticking.size:
            acceleration = self._accelerations_with_reactions(sticking, applied)
        self.internal_factors = self.factors[c.state_owner, c.state_column]
        self.internal_rate_factors = drive[c.state_owner, c.state_column - INTERNAL]
        self.internal_rates = (drive @ self.law)[c.state_owner, c.state_column - INTERNAL]
        self.rates = np.vstack([e.unit[e.velocities], acceleration, self.internal_rates])

    def rates_at(self, z: Complexes) -> Complexes:
        """(N, k) time derivatives of states, for columns z (V, k).

        The terms of each contact force are added before it acts along the contact's own shape: where both sides of a
        stiff contact move together, or follow the base, the round-off of a product with `rates` would be a load of slow
        motions.
        """
        e = self.equations
        applied = e.free @ z - e.penetrations.T @ (self._own_force @ z)
        return np.concatenate([z[e.velocities], self._without_balanced(applied), self.internal_rates @ z])

    def _add_pressing(self, drive: Floats) -> None:
        """Enter the forces of contacts that press others, and their rates; ``drive`` is (m, R, C) of internal rates."""
        c, law = self.equations.contacts, self.law
        i, factors = c.pressing_contacts, self.factors[c.pressing_contacts]
        law[c.pressed_contacts, NORMAL_FORCE] = _products(factors, law[i])
        of_states = (factors[:, INTERNAL:, None] * (drive[i] @ law[i])).sum(axis=1)
        law[c.pressed_contacts, NORMAL_FORCE_RATE] = factors[:, :1] * law[i, RATE] + of_states

    def _accelerations_with_reactions(self, sticking_contacts: Ints, applied_forces: Floats) -> Floats:
        """(n, V) accelerations under generalised forces with reactions of contacts that stick, which are entered."""
        left, size, right = np.linalg.svd(self.equations.penetrations[sticking_contacts], full_matrices=False)
        rank = int(np.sum(size > NEGLIGIBLE_SINGULAR_VALUE * size.max()))
        self.stuck_directions, share = right[:rank].T, (left[:, :rank] / size[:rank]) @ right[:rank]
        self.law[sticking_contacts, REACTION] = share @ applied_forces
        self.force = self.force.copy()
        self.force[sticking_contacts] += self.law[sticking_contacts, REACTION]
        return self._without_balanced(applied_forces)

    def _without_balanced(self, applied_forces: NDArray[Number]) -> NDArray[Number]:
        """(n, k) accelerations under generalised forces (n, k), the reactions of contacts that stick apart.

        What is left of forces that reactions balance wholly is zero, so that stuck contacts stay at rest.
        """
        if not self.stuck_directions.shape[1]:
            return applied_forces
        acceleration = applied_forces - self.stuck_directions @ (self.stuck_directions.T @ applied_forces)
        balanced = np.linalg.norm(acceleration, axis=0) <= ROUND_OFF * np.linalg.norm(applied_forces, axis=0)
        return np.where(balanced, 0.0, acceleration)

    @property
    def push(self) -> Floats:
        """(m, n) generalised force for a unit of each contact's own force, friction that it presses included."""
        c, push = self.equations.contacts, -self.equations.penetrations
        np.add.at(
            push, c.pressing_contacts, self.factors[c.pressed_contacts, NORMAL_FORCE, None] * push[c.pressed_contacts]
        )
        return np.asarray(push)

    @property
    def openings(self) -> Floats:
        """(m, V) distances of the contacts to their faces as these are now, m; 0 of what touches or is held."""
        c = self.equations.contacts
        return np.asarray(_products(c.arrays.opening[np.arange(c.count), self.phases], self.law))

    @cached_property
    def events(self) -> EventFunctions:
        """What ends this contact state."""
        c, a, phases = self.equations.contacts, self.equations.contacts.arrays, self.phases
        every, joining = np.arange(c.count), 0
        contact, place = np.nonzero(np.arange(a.guard.shape[2]) < a.guards[every, phases][:, None])
        if self.stuck_directions.shape[1]:
            contact, place, joining = self._joining_first(contact, place)
        rows, after = (a.guard[every, phases] @ self.law)[contact, place], a.next[contact, phases[contact], place]
        for g in range(joining):
            rows[g] = self._joining(int(contact[g]), int(after[g]))
        reset, fresh, count = np.full(contact.size, -1), [], contact.size
        for g in np.flatnonzero(a.resets[contact, phases[contact], place]).tolist():
            j = contact[g]
            fresh.append(a.reset[j, phases[j], place[g], : c.state_counts[j]] @ self.law[j])
            reset[g], count = count, count + int(c.state_counts[j])
        all_rows = np.concatenate([rows, *fresh])
        return EventFunctions(contact.size, contact, after, all_rows, all_rows[: contact.size], reset, joining)

    def _joining_first(self, contact: Ints, place: Ints) -> tuple[Ints, Ints, int]:
        """Contacts and guards (g,), and how many, the first ones then, are of contacts that join others at rest."""
        shape, guard = self.equations.contacts.shape, self.equations.contacts.arrays.guard
        left = np.linalg.norm(shape - (shape @ self.stuck_directions) @ self.stuck_directions.T, axis=1)
        resting = left <= NEGLIGIBLE_SINGULAR_VALUE * np.linalg.norm(
            shape, axis=1
        )  # whose motion others hold, at the same place say
        joins = resting[contact] & (guard[contact, self.phases[contact], place, RATE] != 0.0)
        order = np.argsort(~joins, kind="stable")
        return contact[order], place[order], int(joins.sum())

    def _joining(self, contact: int, stick_phase: int) -> Floats:
        """(V,) what ends the sliding of a contact whose motion others hold, so that its rate is zero.

        It sticks where that takes less than its limit: until then this is by how much the limit is exceeded, N.
        """
        c = self.equations.contacts
        limit = next(g.row for g in c.laws[contact].phases[stick_phase].guards if g.next == self.phases[contact])
        law = StateEquations(self.equations, c.phases_after(self.phases, contact, stick_phase)).law[contact]
        return np.asarray(-limit.reaction * law[REACTION] - limit.constant * law[CONSTANT])

    def state_after(self, event: int) -> Floats:
        """(N, V) the state after an event, by the number of its function."""
        state = self.equations.state.copy()
        if self.events.reset_row[event] >= 0:
            self._reset(state, event)
        return state

    def _reset(self, state: Floats, event: int) -> None:
        """Put the rows of the states of a contact that an event sets into those of all states."""
        e, j, row = self.equations, int(self.events.contact[event]), int(self.events.reset_row[event])
        first, count = e.internal.start + int(e.contacts.first_state[j]), int(e.contacts.state_counts[j])
        state[first : first + count] = self.events.rows[row : row + count]

    @property
    def lost_by_rate(self) -> Floats:
        """(m + r,) dissipated power per squared rate, of penetrations and of internal states, N s/m."""
        c, every = self.equations.contacts, np.arange(self.equations.contacts.count)
        of_states = c.arrays.state_dashpots[c.state_owner, self.phases[c.state_owner], c.state_column - INTERNAL]
        return np.concatenate([c.arrays.dissipative_force[every, self.phases, RATE], of_states])

    @cached_property
    def dissipation(self) -> tuple[Floats, Floats]:
        """(m + r, V) dissipative forces in the contacts, N, and the rates on which they act, m/s; what events lose
        comes on top."""
        c, every = self.equations.contacts, np.arange(self.equations.contacts.count)
        moved = self.law[:, RATE].copy()
        if c.pressed_contacts.size:  # the spring of a slider gives way
            moved[c.pressed_contacts] -= (
                c.pressing_extensions(self.phases)[:, None] * self.law[c.pressed_contacts, NORMAL_FORCE_RATE]
            )
        forces = _products(c.arrays.dissipative_force[every, self.phases], self.law)
        of_states = self.lost_by_rate[c.count :, None] * self.internal_rates
        return np.vstack([forces, of_states]), np.vstack([moved, self.internal_rates])

    @property
    def sliding_speeds(self) -> Floats:
        """(m, V) speeds at which the contacts slide, m/s; 0 of those that do not."""
        c = self.equations.contacts
        return np.asarray(c.sliding_directions(self.phases)[:, None] * self.dissipation[1][: c.count])


def _products(rows: Floats, law: Any) -> Any:
    """(k, V) of rows (k, C), each with what its own law depends on, (k, C, V)."""
    return (rows[:, None, :] @ law)[:, 0]


Key = tuple[str, str]  # section and quantity


class Sizes(NamedTuple):
    """Numbers of coordinates, contacts, signals and cubic springs, which give the columns of the rows of channels.

    The parts of a row, by name: ``displacement``, ``velocity`` and ``acceleration`` for a unit of each coordinate;
    ``contact`` for the force of each contact, N; ``opening`` for the distance of each contact to its face as it is now,
    m, 0 while it touches; ``load`` for each signal of the forcing; ``base_acceleration`` and ``base_displacement``, for
    m/s^2 and m of the base; ``constant``; ``cubic`` for the pull of each cubic spring, N, in addition
    to what that does to the acceleration.
    """

    coordinates: int  # n
    contacts: int  # m
    signals: int  # L
    cubic: int  # c

    @property
    def slices(self) -> dict[str, slice]:
        """Columns of each part."""
        n, m, signals, cubic = self
        sizes = {
            "displacement": n, "velocity": n, "acceleration": n, "contact": m, "opening": m, "load": signals,
            "base_acceleration": 1, "base_displacement": 1, "constant": 1, "cubic": cubic,
        }  # fmt: skip
        ends = np.cumsum([0, *sizes.values()]).tolist()
        return {name: slice(first, last) for name, first, last in zip(sizes, ends, ends[1:], strict=False)}

    def rows(self, count: int, **blocks: Floats | float) -> Floats:
        """Rows of channels of which some parts are given, the others being zero.

        Parameters
        ----------
        count : k.
        blocks : by name of the part, arrays (k, width of the part) or what broadcasts to it; (k,) of a part of one
            column.

        Returns
        -------
        (k, W) array
        """
        slices = self.slices
        rows = np.zeros((count, slices["cubic"].stop))
        for name, values in blocks.items():
            part = rows[:, slices[name]]
            part[:] = np.reshape(values, (-1, 1)) if part.shape[1] == 1 else values
        return rows

    def part(self, rows: Floats, name: str) -> Floats:
        """(k, width) one part of rows (k, W), a view."""
        return rows[:, self.slices[name]]


@dataclass(frozen=True)
class Channel:
    """One observable: of which item of which section of the scenario, what it is, in which unit.

    The value is that of its row; of an energy, half the sum of the squares of several; along a body there are many.
    """

    section: str
    name: str
    quantity: str
    unit: str
    rows: Floats  # (k, W), see `Sizes`
    at: str = ""  # for people
    squared: bool = False
    counts_pulling: bool = False  # a contact force that counts where it pulls as where it pushes: what it met is held

    @property
    def key(self) -> Key:
        """Section and quantity, which channels that are alike have in common."""
        return self.section, self.quantity

    @property
    def columns(self) -> int:
        """Number of its values at one time."""
        return 1 if self.squared else int(self.rows.shape[0])


class Places(dict[Key, Ints]):
    """Columns by section and quantity; none of what there is not."""

    def __missing__(self, key: Key) -> Ints:
        return np.zeros(0, dtype=np.int64)


@dataclass(eq=False)
class ChannelSet:
    """Some channels of a system, which are evaluated together; C columns of values."""

    channels: tuple[Channel, ...]
    sizes: Sizes
    linear: Floats = field(init=False)  # rows of the linear channels, of which each is a value
    squared: Floats = field(init=False)  # rows of the energies
    rows: Floats = field(init=False)  # all of them, those of the linear channels first
    squares: Ints = field(init=False)  # first of the rows of each energy
    order: Ints = field(init=False)  # (C,) numbers of the columns among those of linear channels, then of energies
    first_columns: list[tuple[Channel, int]] = field(init=False)  # each channel with its first column
    places: Places = field(init=False)  # columns of the values by section and quantity

    def __post_init__(self) -> None:
        none, energies = self.sizes.rows(0), [channel for channel in self.channels if channel.squared]
        self.linear = np.concatenate([none, *(channel.rows for channel in self.channels if not channel.squared)])
        self.squared = np.concatenate([none, *(channel.rows for channel in energies)])
        self.rows = np.vstack([self.linear, self.squared])
        self.squares = np.cumsum([0, *(channel.rows.shape[0] for channel in energies)])[:-1]
        ends = np.cumsum([0, *(channel.columns for channel in self.channels)])
        self.first_columns = list(zip(self.channels, ends.tolist(), strict=False))
        places: dict[Key, list[int]] = {}
        squared = np.zeros(ends[-1], dtype=bool)
        for channel, first in self.first_columns:
            squared[first : first + channel.columns] = channel.squared
            places.setdefault(channel.key, []).extend(range(first, first + channel.columns))
        self.order = np.argsort(np.argsort(squared, kind="stable"), kind="stable")
        self.places = Places({key: np.array(columns, dtype=np.int64) for key, columns in places.items()})

    def select(self, predicate: Callable[[Channel], bool]) -> ChannelSet:
        """The channels for which `wanted` returns True."""
        return ChannelSet(tuple(filter(predicate, self.channels)), self.sizes)

    def of_keys(self, *keys: Key) -> ChannelSet:
        """Those of some sections and quantities, key after key."""
        return ChannelSet(tuple(c for key in keys for c in self.channels if c.key == key), self.sizes)

    def without(self, *keys: Key) -> ChannelSet:
        """All but those of some sections and quantities."""
        return self.select(lambda channel: channel.key not in keys)

    def values(self, row_values: Floats) -> Floats:
        """(nt, C) values from those of the rows (nt, k): of the linear channels, then of the energies."""
        linear, squared = np.split(row_values, [self.linear.shape[0]], axis=1)
        if self.squares.size:
            linear = np.hstack([linear, np.add.reduceat(0.5 * squared**2, self.squares, axis=1)])
        return np.asarray(linear[:, self.order])

    def split(self, values: Floats) -> dict[Key, Floats]:
        """Values (..., C) by section and quantity."""
        return {key: values[..., columns] for key, columns in self.places.items()}
