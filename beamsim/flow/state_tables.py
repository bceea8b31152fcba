"""The contact states' tables side by side in padded arrays that grow as states are built."""

from __future__ import annotations

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
Number = TypeVar("Number", bound=np.generic)


class StateTables:
    """Padded arrays with spare rows, so that a new state seldom moves the others.

    Of all combinations of the contacts' phases few are visited; a state is built when it is first visited.
    ``follower[s, g]`` is the state after the event of guard g in state s, -1 until a motion asks for it, and where it
    was dropped. With ``most`` states built, the least recently used one is replaced by the next.
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
        """Add a state; its number may be that of one that is dropped for it.

        Parameters
        ----------
        state, watched : the state, and the functions that are watched in it.
        watch : (T, w) coefficients of these.
        roughness : (T, g) round-off scale of the guards.

        Returns
        -------
        index : of the state.
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
        return index

    def _grown(self, old: NDArray[Number], need: tuple[int, ...]) -> NDArray[Number]:
        """An array with more rows, or wider ones; rows that no state has yet are zeros."""
        rows = old.shape[0]
        if rows < need[0]:
            rows = max(GROWTH * need[0], FEWEST)
            if self.most is not None and GROWTH * rows >= self.most:
                rows = self.most  # the next growth would move all for few more
        grown = np.zeros(tuple(map(max, old.shape, (rows, *need[1:]))), dtype=old.dtype)
        known = (slice(min(old.shape[0], self.count)), *map(slice, old.shape[1:]))
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

    def _drop(self, index: int) -> None:
        del self._index[self._phases[index].tobytes()]
        for array in self._arrays.values():
            array[index] = 0
        follower = self._arrays["follower"]
        follower[follower == index] = -1

    def arrays(self) -> Tables:
        """The tables as the kernels take them; rows beyond ``count`` are unused."""
        from beamsim.flow.kernels import Tables

        if self._tables is None:
            self._tables = Tables(first=self.contacts.first, states=self.contacts.states, **self._arrays)
        return self._tables


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
