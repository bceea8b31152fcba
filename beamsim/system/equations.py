r"""Equations of motion of a system in mass-normalised coordinates, contact state by contact state, and its channels.

With every contact in one phase of its law, the system is linear,

.. math:: \ddot q + C_s \dot q + K_s q = f_0 + \sum_l L_l\, a_l(t) + \text{contact constants},

where :math:`M = I` and the stiffness of the open structure is diagonal. This module knows no files, no units and no
meaning of the coordinates.

While every contact stays in its phase, every quantity of the motion is a row times

.. math:: z = (y, u, u'), \qquad y = (q, q', p),

the state y with N entries (coordinates, their rates, internal states of the contacts), the F inputs u, and their slopes
u'; u[0] is 1. Rates of the state, contact forces, event functions, internal states after an event and channels are
arrays (k, V) of such rows, V = N + 2F.

The quantities that the law of contact j depends on are ``law[j]``, one row for each column of
`beamsim.contacts.laws.LawRow.array`: penetration, its rate, 1, the normal force, its rate, the own reaction, the
internal states. A linear function in a law, multiplied by ``law[j]``, is a row on z.

Contacts that stick rigidly: the force in such a phase is a reaction that keeps the penetration constant. Let W be the
penetrations of these contacts for a unit of each coordinate, and f the generalised force of everything else. The
reactions satisfy :math:`W (f - W^T\lambda) = 0`; if they are not unique, because contacts restrain the same motion,
those with the smallest sum of squares are used.

A channel is an observable: a linear row on the motion and on the loads,

.. math:: y = D q + V q' + A q'' + F f + G g + S s(t) + c + P p(q)

with the coordinates q relative to the base, the contact forces f and openings g, the load signals s, among them the
motions of the base, and the forces p of cubic springs.
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

NEGLIGIBLE_SINGULAR_VALUE = 1e-10  # relative to the largest singular value of the rows; smaller ones are dependent
ROUND_OFF = 1e-14  # relative to a generalised force; smaller remainders after subtracting reactions are set to zero

Number = TypeVar("Number", np.float64, np.complex128)
RowsOf = Callable[[Ints], Floats]  # gives rows (k, V) for phases of the contacts (m,)


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
        """A bound, rad/s, of the natural frequencies with all contacts closed."""
        contacts = self.contacts
        closed = np.abs(contacts.arrays.force[:, :, 0]).max(axis=1, initial=0.0) @ (contacts.shape**2).sum(axis=1)
        return float(np.sqrt(self.stiffness.max(initial=0.0) + closed))

    @cached_property
    def coupled_by_damping(self) -> bool:
        """Whether C of the open structure has entries off its diagonal."""
        return bool(np.count_nonzero(self.damping) > np.count_nonzero(np.diag(self.damping)))

    def contacts_act(self, phases: Ints) -> bool:
        """Whether a contact acts in these phases: it pushes, sticks, or has internal states that move by themselves."""
        arrays, every = self.contacts.arrays, np.arange(self.contacts.count)
        pushing = arrays.force[every, phases, :NORMAL_FORCE].any() or arrays.sticks_rigidly[every, phases].any()
        return self.contacts.internal_states > 0 or bool(pushing)

    def one_sided(self) -> PiecewiseLinearSystem:
        """The same system with one-sided springs only; see `Contacts.one_sided_springs`."""
        springs = self.contacts.one_sided_springs()
        return self if springs is self.contacts else replace(self, contacts=springs)


@dataclass(frozen=True)
class Forcing:
    """Time-dependent loads ``sum_l load[l] * signal[l](t)``.

    The displacements of the base, one for each of its motions, are signals that need not load the structure: contacts
    and cubic springs on the ground follow them. ``influence`` is needed only by contacts whose mounting moves.
    """

    load: Floats  # (L, n)
    signal: tuple[Signal, ...]  # (L,)
    base_displacements: tuple[int, ...] = ()  # (K,) index of the signal of each; none if nothing follows them
    # (m, L) displacement of each contact point relative to its mounting for a unit of each signal
    influence: Floats | None = None

    def base_at(self, times: Floats) -> Floats | None:
        """(nt, K) displacements of the base, m, at times (nt,), s; None if nothing follows them."""
        moved = [self.signal[k](times) for k in self.base_displacements]
        return np.stack(moved, axis=-1) if moved else None


@dataclass(frozen=True)
class SineLoads:
    """Loads as multiples of one sine: load l is ``coefficient[l] (i omega)^power[l]`` times the sine.

    The sine is the acceleration of the base or a moving support, the force, or the common factor of several forces.
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
    load : (L, n) generalised forces for a unit of each of the first L channels; none by default.
    influence : (channels, m) displacement of each contact's mounting for a unit of each channel, m; none by default.
    channel : (F,) channel of each input; -1 for the constant one, which comes first and is the default.
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
        self.penetrations = -c.sign[:, None] * c.shape  # (m, n) penetration for a unit of each coordinate
        self.unit = np.eye(self.width)  # (V, V) z with one unit entry each
        self.state = self.unit[: self.states]  # (N, V) the state itself
        self.law = np.zeros((c.count, INTERNAL + int(c.state_counts.max(initial=0)), self.width))
        self.law[:, PENETRATION, self.coordinates] = self.law[:, RATE, self.velocities] = self.penetrations
        self.law[:, PENETRATION, self.inputs] = self.law[:, RATE, self.slopes] = -self._mounting
        self.law[:, PENETRATION, self.inputs.start] -= c.gap
        self.law[:, CONSTANT, self.inputs.start] = 1.0
        self.law[c.state_owner, c.state_column] = self.unit[self.internal]
        self.free = self.rows(  # (n, V) generalised forces on the structure, without contact forces
            n, coordinates=-np.diag(system.stiffness), velocities=-system.damping, inputs=self._load
        )
        self.penetration, self.penetration_rate = self.law[:, PENETRATION], self.law[:, RATE]  # (m, V) m and m/s

    def rows(self, count: int, **blocks: Floats | float) -> Floats:
        """Rows from blocks; other blocks are zero.

        Parameters
        ----------
        count : number of rows k.
        blocks : for each name of a block of z (``coordinates``, ``velocities``, ``internal``, ``inputs``, ``slopes``)
            an array of its width, or one that broadcasts to it.

        Returns
        -------
        (k, V) array
        """
        rows = np.zeros((count, self.width))
        for name, values in blocks.items():
            rows[:, getattr(self, name)] = values
        return rows

    def constant(self, values: Floats) -> Floats:
        """(k, V) rows of constant quantities (k,)."""
        rows = self.rows(values.size)
        rows[:, self.inputs.start] = values
        return rows

    def signals(self, channels: Ints) -> Floats:
        """(k, V) rows of the signals of channels (k,)."""
        return self.rows(channels.size, inputs=channels[:, None] == self.channel)


@dataclass(frozen=True)
class EventFunctions:
    """The events that end a contact state: g functions that are positive until then."""

    count: int  # g
    contact: Ints  # (g,) contact that changes its phase
    next: Ints  # (g,) phase after the event
    rows: Floats  # (w, V) the g functions, then internal states after events with a reset
    guards: Floats  # (g, V) only the functions
    reset_row: Ints  # (g,) index of the first row with the internal states after the event; -1 without reset
    joining_count: (
        int  # how many, the first ones, are of contacts that join others at rest: where one acts, no other does
    )

    def of_change(self, contact: int, after: int) -> int:
        """Index of the function whose event changes a contact to a phase."""
        return int(np.flatnonzero((self.contact == contact) & (self.next == after))[0])


class StateEquations:
    """The equations for given phases of the contacts, as rows on z.

    Parameters
    ----------
    equations : equations of the system with its inputs.
    phases : (m,) phases of the contacts.
    """

    factors: Floats  # (m, C) factors of ``law`` in the contact forces, without reactions
    law: Floats  # (m, C, V) quantities that the laws depend on
    force: Floats  # (m, V) contact forces with reactions, N
    normal_force: Floats  # (p, V) normal force of each friction contact with a normal contact, N
    stuck_directions: Floats  # (n, h) orthonormal directions without motion because of rigidly sticking contacts
    internal_factors: Floats  # (r,) factor of each internal state in the force of its contact, N per unit
    internal_rate_factors: Floats  # (r, C) factors of the quantities of its law in the rate of each internal state
    internal_rates: Floats  # (r, V) time derivatives of all internal states
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
        applied = e.free - e.penetrations.T @ self.force  # without the reactions of sticking contacts
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

        The terms of each contact force are summed before they act along the shape of the contact. Multiplying by
        `rates` instead would turn round-off into a load on slow motions, where both sides of a stiff contact move
        together or follow the base.
        """
        e = self.equations
        applied = e.free @ z - e.penetrations.T @ (self._own_force @ z)
        return np.concatenate([z[e.velocities], self._without_balanced(applied), self.internal_rates @ z])

    def _add_pressing(self, rate_factors: Floats) -> None:
        """Add normal forces and their rates to the laws; ``rate_factors`` (m, R, C): factors of internal rates."""
        c, law = self.equations.contacts, self.law
        i, factors = c.pressing_contacts, self.factors[c.pressing_contacts]
        law[c.pressed_contacts, NORMAL_FORCE] = _products(factors, law[i])
        of_states = (factors[:, INTERNAL:, None] * (rate_factors[i] @ law[i])).sum(axis=1)
        law[c.pressed_contacts, NORMAL_FORCE_RATE] = factors[:, :1] * law[i, RATE] + of_states

    def _accelerations_with_reactions(self, sticking_contacts: Ints, applied_forces: Floats) -> Floats:
        """(n, V) accelerations under generalised forces and reactions of sticking contacts, which are stored."""
        left, size, right = np.linalg.svd(self.equations.penetrations[sticking_contacts], full_matrices=False)
        rank = int(np.sum(size > NEGLIGIBLE_SINGULAR_VALUE * size.max()))
        self.stuck_directions, share = right[:rank].T, (left[:, :rank] / size[:rank]) @ right[:rank]
        self.law[sticking_contacts, REACTION] = share @ applied_forces
        self.force = self.force.copy()
        self.force[sticking_contacts] += self.law[sticking_contacts, REACTION]
        return self._without_balanced(applied_forces)

    def _without_balanced(self, applied_forces: NDArray[Number]) -> NDArray[Number]:
        """(n, k) accelerations under generalised forces (n, k), without the reactions of sticking contacts.

        Remainders below round-off are set to zero, so that stuck contacts stay at rest.
        """
        if not self.stuck_directions.shape[1]:
            return applied_forces
        acceleration = applied_forces - self.stuck_directions @ (self.stuck_directions.T @ applied_forces)
        balanced = np.linalg.norm(acceleration, axis=0) <= ROUND_OFF * np.linalg.norm(applied_forces, axis=0)
        return np.where(balanced, 0.0, acceleration)

    @property
    def push(self) -> Floats:
        """(m, n) generalised force for a unit force of each contact, including the friction that depends on it."""
        c, push = self.equations.contacts, -self.equations.penetrations
        np.add.at(
            push, c.pressing_contacts, self.factors[c.pressed_contacts, NORMAL_FORCE, None] * push[c.pressed_contacts]
        )
        return np.asarray(push)

    @property
    def openings(self) -> Floats:
        """(m, V) distances of the contacts to their faces, m; 0 for closed or sticking contacts."""
        c = self.equations.contacts
        return np.asarray(_products(c.arrays.opening[np.arange(c.count), self.phases], self.law))

    @cached_property
    def events(self) -> EventFunctions:
        """The events that can end this contact state."""
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
        """Contacts and guards (g,), those of contacts that join others at rest first, and their number."""
        shape, guard = self.equations.contacts.shape, self.equations.contacts.arrays.guard
        left = np.linalg.norm(shape - (shape @ self.stuck_directions) @ self.stuck_directions.T, axis=1)
        # whose motion others hold, at the same place say
        resting = left <= NEGLIGIBLE_SINGULAR_VALUE * np.linalg.norm(shape, axis=1)
        joins = resting[contact] & (guard[contact, self.phases[contact], place, RATE] != 0.0)
        order = np.argsort(~joins, kind="stable")
        return contact[order], place[order], int(joins.sum())

    def _joining(self, contact: int, stick_phase: int) -> Floats:
        """(V,) event function of a sliding contact whose motion others prevent, so that its rate is zero.

        It sticks when the required force is below its limit; until then the function is the excess over the limit, N.
        """
        c = self.equations.contacts
        limit = next(g.row for g in c.laws[contact].phases[stick_phase].guards if g.next == self.phases[contact])
        law = StateEquations(self.equations, c.phases_after(self.phases, contact, stick_phase)).law[contact]
        return np.asarray(-limit.reaction * law[REACTION] - limit.constant * law[CONSTANT])

    def state_after(self, event: int) -> Floats:
        """(N, V) the state after an event, by the index of its function."""
        state = self.equations.state.copy()
        if self.events.reset_row[event] >= 0:
            self._reset(state, event)
        return state

    def _reset(self, state: Floats, event: int) -> None:
        """Write the rows of the states that an event resets into those of all states."""
        e, j, row = self.equations, int(self.events.contact[event]), int(self.events.reset_row[event])
        first, count = e.internal.start + int(e.contacts.first_state[j]), int(e.contacts.state_counts[j])
        state[first : first + count] = self.events.rows[row : row + count]

    @property
    def lost_by_rate(self) -> Floats:
        """(m + r,) dissipated power per squared rate, of penetrations and internal states, N s/m."""
        c, every = self.equations.contacts, np.arange(self.equations.contacts.count)
        of_states = c.arrays.state_dashpots[c.state_owner, self.phases[c.state_owner], c.state_column - INTERNAL]
        return np.concatenate([c.arrays.dissipative_force[every, self.phases, RATE], of_states])

    @cached_property
    def dissipation(self) -> tuple[Floats, Floats]:
        """(m + r, V) dissipative forces of the contacts, N, and their rates, m/s; without losses at events."""
        c, every = self.equations.contacts, np.arange(self.equations.contacts.count)
        moved = self.law[:, RATE].copy()
        if c.pressed_contacts.size:  # the spring of the slider extends
            extended = c.pressing_extensions(self.phases)[:, None]
            moved[c.pressed_contacts] -= extended * self.law[c.pressed_contacts, NORMAL_FORCE_RATE]
        forces = _products(c.arrays.dissipative_force[every, self.phases], self.law)
        of_states = self.lost_by_rate[c.count :, None] * self.internal_rates
        return np.vstack([forces, of_states]), np.vstack([moved, self.internal_rates])

    @property
    def sliding_speeds(self) -> Floats:
        """(m, V) sliding speeds of the contacts, m/s; 0 for those that do not slide."""
        c = self.equations.contacts
        return np.asarray(c.sliding_directions(self.phases)[:, None] * self.dissipation[1][: c.count])


def _products(rows: Floats, law: Any) -> Any:
    """(k, V) products of rows (k, C) with the quantities of their laws, (k, C, V)."""
    return (rows[:, None, :] @ law)[:, 0]


Key = tuple[str, str]  # section and quantity


class Sizes(NamedTuple):
    """Numbers of coordinates, contacts, signals and cubic springs, which determine the columns of channel rows.

    The blocks of a row are: ``displacement``, ``velocity`` and ``acceleration`` for a unit of each coordinate;
    ``contact`` for the force of each contact, N; ``opening`` for the distance of each contact to its face, m, 0 if
    closed; ``load`` for each signal of the loads; ``constant``; ``cubic`` for the force of each cubic spring, N, in
    addition to its effect on the acceleration.
    """

    coordinates: int  # n
    contacts: int  # m
    signals: int  # L
    cubic: int  # c

    @property
    def slices(self) -> dict[str, slice]:
        """Columns of each block."""
        n, m, signals, cubic = self
        sizes = {
            "displacement": n, "velocity": n, "acceleration": n, "contact": m, "opening": m, "load": signals,
            "constant": 1, "cubic": cubic,
        }  # fmt: skip
        ends = np.cumsum([0, *sizes.values()]).tolist()
        return {name: slice(first, last) for name, first, last in zip(sizes, ends, ends[1:], strict=False)}

    def rows(self, count: int, **blocks: Floats | float) -> Floats:
        """Rows of channels from blocks; other blocks are zero.

        Parameters
        ----------
        count : number of rows k.
        blocks : for each name of a block an array (k, width of the block) or one that broadcasts to it; (k,) for a
            block with one column.

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
        """(k, width) one block of rows (k, W), as a view."""
        return rows[:, self.slices[name]]


@dataclass(frozen=True)
class Channel:
    """One observable: an item of a section of the scenario, with its quantity and unit.

    Its value is that of its row; an energy is half the sum of squares of several rows; a body has many values.
    """

    section: str
    name: str
    quantity: str
    unit: str
    rows: Floats  # (k, W), see `Sizes`
    at: str = ""  # place, for messages
    squared: bool = False
    counts_pulling: bool = False  # a contact force that may be tensile, of a stop that has locked

    @property
    def key(self) -> Key:
        """Section and quantity, which channels of the same type share."""
        return self.section, self.quantity

    @property
    def columns(self) -> int:
        """Number of its values at one time."""
        return 1 if self.squared else int(self.rows.shape[0])


class Places(dict[Key, Ints]):
    """Columns by section and quantity; empty for unknown keys."""

    def __missing__(self, key: Key) -> Ints:
        return np.zeros(0, dtype=np.int64)


@dataclass(eq=False)
class ChannelSet:
    """Several channels of a system that are evaluated together, with C columns of values."""

    channels: tuple[Channel, ...]
    sizes: Sizes
    linear: Floats = field(init=False)  # rows of the linear channels, one for each value
    squared: Floats = field(init=False)  # rows of the energies
    rows: Floats = field(init=False)  # all rows, first those of the linear channels
    squares: Ints = field(init=False)  # index of the first row of each energy
    order: Ints = field(init=False)  # (C,) index of each column among the linear channels, then energies
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
        """The channels for which a predicate is true."""
        return ChannelSet(tuple(filter(predicate, self.channels)), self.sizes)

    def of_keys(self, *keys: Key) -> ChannelSet:
        """The channels with some sections and quantities, key by key."""
        return ChannelSet(tuple(c for key in keys for c in self.channels if c.key == key), self.sizes)

    def without(self, *keys: Key) -> ChannelSet:
        """All channels except those with some sections and quantities."""
        return self.select(lambda channel: channel.key not in keys)

    def values(self, row_values: Floats) -> Floats:
        """(nt, C) values from the values of the rows (nt, k): linear channels, then energies."""
        linear, squared = np.split(row_values, [self.linear.shape[0]], axis=1)
        if self.squares.size:
            linear = np.hstack([linear, np.add.reduceat(0.5 * squared**2, self.squares, axis=1)])
        return np.asarray(linear[:, self.order])

    def split(self, values: Floats) -> dict[Key, Floats]:
        """Values (..., C) by section and quantity."""
        return {key: values[..., columns] for key, columns in self.places.items()}
