"""The contact states' tables, in padded arrays that grow as states are built, and derivatives where a motion starts.

At a border the first of them that is not zero decides to which side the motion goes.
"""

from __future__ import annotations

from collections import OrderedDict
from operator import lt
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from beamsim.contacts.contacts import Contacts
from beamsim.flow.contact_state import ContactState
from beamsim.flow.kernels import Tables
from beamsim.flow.sources import ORDERS, Sources
from beamsim.system.state_equations import StateEquations
from beamsim.typing import Floats, Ints

ROUND_OFF = 1e-12  # of the terms of a derivative: below it the derivative counts as zero
EPS = 1e-15  # round-off of a state and of what makes up its rate
HIGHEST_DERIVATIVE = ORDERS - 2  # that is looked at: with the slope of its inputs, from order 0 on
USUAL_DERIVATIVE = 3  # that decides under most loads: higher ones are computed where it does not


class InputsAtStart(NamedTuple):
    """Derivatives of the inputs and, beside them, of their slopes, from order 0 on: (orders, 2 F) each."""

    value: Floats
    size: Floats  # before parts cancel
    fit: Floats  # round-off of fitted ones


def first_signs(rows: Floats, rates: Floats, inputs: InputsAtStart, state: Floats) -> tuple[Floats, Ints]:
    """Signs and orders of the first derivatives of functions that are beyond their round-off, see `decisive`.

    Parameters
    ----------
    rows : (k, V) the functions.
    rates : (N, V) the time derivative of the state; (0, V): of the functions themselves the signs alone.
    inputs : with as many derivatives as are looked at.
    state : (N,).

    Returns
    -------
    signs, orders : (k,).
    """
    N, count, orders = state.size, rows.shape[0], inputs.value.shape[0] if rates.size else 1
    every = np.vstack([rows, rates])
    sizes, load_size = np.abs(every[:, :N]), np.abs(every[:, N:]).T
    driven = inputs.value[:orders] @ every[:, N:].T
    y = np.empty((orders, N))  # the state and its derivatives
    y[0] = state
    for order in range(1, orders):
        y[order] = rates[:, :N] @ y[order - 1] + driven[order - 1, count:]
    terms = np.abs(y) @ sizes.T + inputs.size[:orders] @ load_size
    hidden = inputs.fit[:orders] @ load_size
    added = EPS * terms + hidden
    doubt = np.empty_like(y)
    doubt[0] = EPS * np.abs(state)
    for order in range(1, orders):
        doubt[order] = sizes[count:] @ doubt[order - 1] + added[order - 1, count:]
    value = y @ rows[:, :N].T + driven[:, :count]
    return decisive(value, (ROUND_OFF * terms + hidden)[:, :count] + doubt @ sizes[:count].T)


def decisive(value: Floats, doubt: Floats) -> tuple[Floats, Ints]:
    """(k,) signs and orders of the first derivatives that are beyond their round-off; a sign is 0 where none is.

    ``value`` and ``doubt`` are (orders, k), from order 0 on.
    """
    beyond = np.abs(value) > doubt
    first = beyond.argmax(axis=0)
    at = first, np.arange(first.size)
    return np.where(beyond[at], np.sign(value[at]), 0.0), first


Number = TypeVar("Number", bound=np.generic)


class StateTables:
    """The contact states that were built, with padded arrays of them; spare rows, so that a new one seldom moves all.

    Of all combinations of the contacts' phases few are visited; a state is built when it is first visited.
    ``follower[s, g]`` is the state after the event of guard g in state s, -1 until a motion asks for it, and where it
    was dropped. With ``most`` states built, the least recently used one is replaced by the next.
    """

    def __init__(self, contacts: Contacts, most: int | None = None, like: StateTables | None = None) -> None:
        self.contacts, self.most = contacts, most
        self.states: list[ContactState] = []
        self.visited: list[Ints] = []  # phases of all states so far, those that were dropped included
        self._visits: dict[bytes, int] = {}  # numbers among these, by the phases
        self._index: OrderedDict[bytes, int] = OrderedDict()  # of states, the least recently used first
        self._used: set[int] = set()  # numbers of states that were asked for, or that a motion visited
        self._arrays: dict[str, NDArray[np.generic]] = {}
        if like is not None:  # there will be as many states again, and as large
            self._arrays = {name: np.zeros(array.shape, array.dtype) for name, array in like._arrays.items()}

    def index(self, phases: Ints) -> int | None:
        """Number of a state, None where it is not built."""
        index = self._index.get(phases.tobytes())
        if index is not None:
            self._used.add(index)
        return index

    def equations(self, phases: Ints) -> StateEquations | None:
        """The equations of a state, None where it is not built; that they were asked for does not count."""
        index = self._index.get(phases.tobytes())
        return None if index is None else self.states[index].equations

    def nearest(self, phases: Ints) -> ContactState | None:
        """A state that differs in fewest contacts, None where there is none yet."""
        if not self.states:
            return None
        differing = np.count_nonzero(self._arrays["phase"][: len(self.states)] != phases, axis=1)
        return self.states[int(np.argmin(differing))]

    def following(self, state: int, guard: int) -> Ints:
        """Phases after the event of a guard of a state, which counts as used."""
        self.use(np.array([state]))
        events = self.states[state].equations.events
        return self.contacts.after(self.states[state].phases, int(events.contact[guard]), int(events.next[guard]))

    def use(self, states: Ints) -> None:
        """Note that these were used, the last one last."""
        for state in states:
            self._index.move_to_end(self.states[state].phases.tobytes())

    def visits(self, states: Ints) -> Ints:
        """Numbers, among all states visited, of states that were used in this order."""
        if len(self.states) == self.most:
            self.use(states)
        self._used.update(states.tolist())
        if len(self.visited) == len(self.states):  # none was dropped: the numbers are the same
            return states
        return np.array([self._visits[self.states[state].phases.tobytes()] for state in states], dtype=np.int64)

    def append(self, state: ContactState, sources: Sources) -> int:
        """Add a state under given sources; its number may be that of one that is dropped for it."""
        events, key = state.equations.events, state.phases.tobytes()
        watch = state.coefficients(events.rows, sources)
        full = self.most is not None and len(self.states) >= self.most
        index = self._drop() if full else len(self.states)
        if key not in self._visits:
            self._visits[key] = len(self.visited)
            self.visited.append(state.phases)
        self.states[index : index + 1] = [state]  # a new place, or that of a state that was dropped
        self._index[key] = index
        self._used.discard(index)
        rows: dict[str, NDArray[np.generic]] = {
            "n_basis": np.array(state.exponent.size),
            "exponent": state.exponent,
            "power": state.power,
            "n_free": np.array(state.projector.shape[0]),
            "projector": state.projector,
            "n_terms": np.array(state.term_basis.size),
            "term_basis": state.term_basis,
            "term_source": state.term_source,
            "term_vector": state.term_vector,
            "watch": watch,
            "roughness": state.roughness(events.guards, watch[:, : events.count]),
            "horizon": np.array(state.horizon),
            "phase": state.phases,
            "n_guards": np.array(events.count),
            "n_joining": np.array(events.joining),
            "guard_contact": events.contact,
            "reset": events.reset,
            "follower": np.full(events.count, -1, dtype=np.int64),
        }
        for name, row in rows.items():
            old = self._arrays.get(name, np.zeros((0, *row.shape), dtype=row.dtype))
            need = (index + 1, *row.shape)
            if any(map(lt, old.shape, need)):
                self._arrays[name] = old = self._grown(old, need)
            if row.shape != old.shape[1:]:
                old[index] = 0
            place: tuple[int | slice, ...] = (index, *map(slice, row.shape))
            old[place] = row
        return index

    def _grown(self, old: NDArray[Number], need: tuple[int, ...]) -> NDArray[Number]:
        """An array with more rows, or wider ones; rows that no state has yet are zeros."""
        most, rows = self.most or np.inf, old.shape[0]
        if rows < need[0]:
            rows = 4 * need[0] + 4  # memory is taken when a row is written
            rows = rows if 4 * rows < most else int(most)  # the next growth would move all for few more
        grown = np.zeros(tuple(map(max, old.shape, (rows, *need[1:]))), dtype=old.dtype)
        known = (slice(min(old.shape[0], len(self.states))), *map(slice, old.shape[1:]))
        grown[known] = old[known]
        return grown

    def lead(self, state: int, guard: int, follower: int) -> None:
        """Note which state follows an event.

        Parameters
        ----------
        state, guard : the event of a guard in a state.
        follower : number of the state after it.
        """
        self._arrays["follower"][state, guard] = follower

    @property
    def used(self) -> list[int]:
        """Numbers of the states that were asked for, or that a motion visited, in order."""
        return sorted(self._used)

    def lead_as(self, before: StateTables) -> None:
        """Note which states follow which, from other tables whose used states are all that is here, in order."""
        old, number = before.used, np.full(len(before.states) + 1, -1)
        number[old] = np.arange(len(old))
        for index, state in enumerate(old):
            self._arrays["follower"][index] = number[before._arrays["follower"][state]]

    def _drop(self) -> int:
        """Remove the least recently used state; returns its number."""
        index = self._index.popitem(last=False)[1]
        for array in self._arrays.values():
            array[index] = 0
        follower = self._arrays["follower"]
        follower[follower == index] = -1
        return index

    def arrays(self) -> Tables:
        """The tables as the kernels take them; rows beyond the states are unused."""
        internal = self._arrays["projector"].shape[2] - self.contacts.internal_states
        return Tables(first=internal + self.contacts.first, states=self.contacts.states, **self._arrays)


def visited_states(states: Ints) -> list[int]:
    """The different numbers (of contact states) in an array, in order."""
    seen: list[int] = np.bincount(states).nonzero()[0].tolist()
    return seen
