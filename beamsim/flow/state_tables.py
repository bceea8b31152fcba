"""The contact states' tables side by side in padded arrays that grow as states are built."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace
from operator import lt
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from beamsim.contacts.contacts import Contacts, Watched
from beamsim.flow.contact_state import ContactState
from beamsim.typing import Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.kernels import Tables

GROWTH = 4  # of the rows that there is room for; memory is taken when a row is written
FEWEST = 8  # rows that there is room for
LARGE = 2**17  # bytes of a state's array that is not kept twice
Number = TypeVar("Number", bound=np.generic)


class StateTables:
    """Padded arrays with spare rows, so that a new state seldom moves the others.

    Of all combinations of the contacts' phases few are visited; a state is built when it is first visited.
    ``follower[s, g]`` is the state after the event of guard g in state s, -1 where that one is not built or was
    dropped. With ``most`` states built, the least recently used one is replaced by the next.
    """

    def __init__(self, contacts: Contacts, most: int | None = None) -> None:
        self.contacts = contacts
        self.most = most
        self._used: list[int] = []
        self._uses = 0
        self.watched: list[Watched] = []
        self._phases: list[Ints] = []
        self._index: dict[bytes, int] = {}
        self._arrays: dict[str, NDArray[np.generic]] = {}
        self._tables: Tables | None = None  # of the arrays as they are now
        self._before = [  # of every contact and phase: the phases that have a guard to it
            [[i for i, phase in enumerate(law.phases) if any(g.next == k for g in phase.guards)]
             for k in range(len(law.phases))]
            for law in contacts.laws
        ]  # fmt: skip

    @property
    def count(self) -> int:
        """States so far."""
        return len(self.watched)

    def index(self, phases: Ints) -> int | None:
        """Number of a state, None where it is not built."""
        return self._index.get(phases.tobytes())

    def nearest(self, phases: Ints) -> int | None:
        """Number of a state that differs in fewest contacts, None where there is none yet."""
        if self.count < 2:
            return 0 if self.count else None
        return int(np.argmin(np.count_nonzero(self._arrays["phase"][: self.count] != phases, axis=1)))

    def following(self, state: int, guard: int) -> Ints:
        """Phases after the event of a guard."""
        watched = self.watched[state]
        return self.contacts.after(self._phases[state], int(watched.contact[guard]), int(watched.following[guard]))

    def use(self, states: Ints) -> None:
        """Note that these were used, the last one last."""
        for state in states:
            self._uses += 1
            self._used[state] = self._uses

    def append(self, state: ContactState, watched: Watched, watch: Complexes, roughness: Floats) -> int:
        """Add a state with the coefficients of its watched functions (T, w) and the guards' round-off scale (T, g).

        Its number may be that of one that is dropped for it.
        """
        guards = watched.guards
        if self.most is not None and self.count >= self.most:
            index = int(np.argmin(self._used))
            self._drop(index)
            self.watched[index], self._phases[index] = watched, state.phases
        else:
            index = self.count
            self.watched.append(watched)
            self._phases.append(state.phases)
            self._used.append(0)
        self.use(np.array([index]))
        self._index[state.phases.tobytes()] = index
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
            "roughness": roughness,
            "horizon": np.array(state.horizon),
            "phase": state.phases,
            "touching": self.contacts.touching(state.phases),
            "n_guards": np.array(guards),
            "guard_contact": watched.contact[:guards],
            "reset": watched.reset,
            "follower": np.full(guards, -1, dtype=np.int64),
        }
        for name, row in rows.items():
            old = self._arrays.get(name, np.zeros((0, *row.shape), dtype=row.dtype))
            need = (index + 1, *row.shape)
            if any(map(lt, old.shape, need)):
                self._arrays[name] = old = self._grown(old, need)
                self._tables = None
            if row.shape != old.shape[1:]:
                old[index] = 0
            place: tuple[int | slice, ...] = (index, *map(slice, row.shape))
            old[place] = row
        self._link(index)
        return index

    def _grown(self, old: NDArray[Number], need: tuple[int, ...]) -> NDArray[Number]:
        """An array with more rows, or wider ones. Rows that no state has yet are zeros; large ones, of which kernels
        read those of states alone, are left as memory is found."""
        rows = old.shape[0]
        if rows < need[0]:
            rows = max(GROWTH * need[0], FEWEST)
            if self.most is not None and GROWTH * rows >= self.most:
                rows = self.most  # the next growth would move all for few more
        shape = tuple(map(max, old.shape, (rows, *need[1:])))
        large = math.prod(shape[1:]) * old.itemsize >= LARGE
        grown = np.empty(shape, dtype=old.dtype) if large else np.zeros(shape, dtype=old.dtype)
        known = min(old.shape[0], self.count)
        if large and grown.shape[1:] != old.shape[1:]:
            grown[:known] = 0
        grown[(slice(known), *map(slice, old.shape[1:]))] = old[:known]
        return grown

    def retuned(self, states: list[ContactState], watches: list[Complexes], roughness: list[Floats]) -> StateTables:
        """The same states with other responses to the loads, and their watched functions as `append` takes them."""
        tables = copy(self)
        tables._tables = None
        tables.watched, tables._phases, tables._used = list(self.watched), list(self._phases), list(self._used)
        tables._index = dict(self._index)
        tables._arrays = {name: array.copy() for name, array in self._arrays.items()}
        for index, (state, watch, size) in enumerate(zip(states, watches, roughness, strict=True)):
            rows = {"exponent": state.exponent, "term_vector": state.term_vector, "watch": watch, "roughness": size}
            for name, row in rows.items():
                place: tuple[int | slice, ...] = (index, *map(slice, row.shape))
                tables._arrays[name][place] = row
        return tables

    def kept_once(self, index: int, state: ContactState) -> ContactState:
        """A state whose large arrays are those of the tables, which hold them anyhow."""
        if state.term_vector.nbytes < LARGE:
            return state
        tables, terms, free = self.arrays(), state.term_vector.shape[0], state.projector.shape[0]
        vector, projector = tables.term_vector[index, :terms], tables.projector[index, :free]
        return replace(state, term_vector=vector, projector=projector)

    def _drop(self, index: int) -> None:
        del self._index[self._phases[index].tobytes()]
        for array in self._arrays.values():
            array[index] = 0
        self._lead_to(index, -1)

    def _link(self, index: int) -> None:
        """Enter a new state as follower of its neighbours, which differ in one contact, and these as its own."""
        follower = self._arrays["follower"]
        for guard in range(self.watched[index].guards):
            follower[index, guard] = self._index.get(self.following(index, guard).tobytes(), -1)
        self._lead_to(index, index)

    def _lead_to(self, index: int, follower: int) -> None:
        """Number that a state has as follower of its neighbours."""
        phases = self._phases[index]
        if self.contacts.pressed.size:  # several contacts change at once: neighbours are found from their side
            for neighbour, watched in enumerate(self.watched):
                for guard in range(watched.guards):
                    if np.array_equal(self.following(neighbour, guard), phases):
                        self._arrays["follower"][neighbour, guard] = follower
            return
        for contact, before in enumerate(self._before):
            for phase in before[phases[contact]]:
                other = self.index(self.contacts.after(phases, contact, phase))
                if other is not None:
                    watched = self.watched[other]
                    leads = (watched.contact[: watched.guards] == contact) & (watched.following == phases[contact])
                    self._arrays["follower"][other, np.flatnonzero(leads)] = follower

    def arrays(self) -> Tables:
        """The tables as the kernels take them; rows beyond ``count`` are unused."""
        from beamsim.flow.kernels import Tables

        if self._tables is None:
            self._tables = Tables(first=self.contacts.arrays.first, states=self.contacts.arrays.states, **self._arrays)
        return self._tables

    def arrays_of(self, state: int) -> Tables:
        """The same of one state alone."""
        from beamsim.flow.kernels import Tables

        rows = {name: array[state : state + 1] for name, array in self._arrays.items()}
        return Tables(first=self.contacts.arrays.first, states=self.contacts.arrays.states, **rows)


def visited_states(states: Ints) -> list[int]:
    """The different numbers (of contact states) in an array, in order."""
    seen: list[int] = np.bincount(states).nonzero()[0].tolist()
    return seen


def pad(arrays: list[NDArray[Number]]) -> NDArray[Number]:
    """Stack arrays of different sizes, filled up with zeros."""
    out = np.zeros((len(arrays), *np.max([a.shape for a in arrays], axis=0)), dtype=arrays[0].dtype)
    for row, a in zip(out, arrays, strict=True):
        row[tuple(slice(0, d) for d in a.shape)] = a
    return out
