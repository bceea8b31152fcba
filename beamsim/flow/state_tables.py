"""The contact states' tables side by side in padded arrays that grow as states are built."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from beamsim.contacts.contacts import Contacts, Watched
from beamsim.flow.contact_state import ContactState
from beamsim.typing import Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.kernels import Tables

Number = TypeVar("Number", bound=np.generic)


class StateTables:
    """Padded arrays with room for more states than there are, so that a new state seldom moves the others.

    Of all combinations of the contacts' phases few are visited, and each is built when it is; ``follower[s, g]`` is the
    state after the event of guard g in state s, -1 where that one is not built yet.
    """

    def __init__(self, contacts: Contacts) -> None:
        self.contacts = contacts
        self.watched: list[Watched] = []
        self._index: dict[bytes, int] = {}
        self._arrays: dict[str, NDArray[np.generic]] = {}

    @property
    def count(self) -> int:
        """States so far."""
        return len(self.watched)

    def index(self, phases: Ints) -> int | None:
        """Number of a state, None where it is not built."""
        return self._index.get(phases.tobytes())

    def following(self, state: int, guard: int) -> Ints:
        """Phases after the event of a guard."""
        return np.array(self.watched[state].following[guard])

    def append(self, state: ContactState, watched: Watched, watch: Complexes, roughness: Floats) -> int:
        """Add a state with the coefficients of its watched functions (T, w) and the guards' round-off scale (T, g)."""
        index, guards = self.count, watched.guards
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
            "follower": np.array([-1 if f is None else f for f in map(self.index, watched.following)], dtype=np.int64),
        }
        self.watched.append(watched)
        for name, row in rows.items():
            old = self._arrays.get(name, np.zeros((0, *row.shape), dtype=row.dtype))
            need = (index + 1, *row.shape)
            if any(a < b for a, b in zip(old.shape, need, strict=True)):
                room = 2 * need[0] if old.shape[0] < need[0] else old.shape[0]
                grown = np.zeros(np.maximum(old.shape, (room, *row.shape)), dtype=row.dtype)
                grown[tuple(slice(0, d) for d in old.shape)] = old
                self._arrays[name] = old = grown
            place: tuple[int | slice, ...] = (index, *(slice(0, d) for d in row.shape))
            old[place] = row
        follower = self._arrays["follower"]
        for s, other in enumerate(self.watched):
            for g, phases in enumerate(other.following):
                if np.array_equal(phases, state.phases):
                    follower[s, g] = index
        assert guards <= follower.shape[1]
        return index

    def arrays(self) -> Tables:
        """The tables as the kernels take them; rows beyond ``count`` are unused."""
        from beamsim.flow.kernels import Tables

        return Tables(first=self.contacts.arrays.first, states=self.contacts.arrays.states, **self._arrays)


def pad(arrays: list[NDArray[Number]]) -> NDArray[Number]:
    """Stack arrays of different sizes, filled up with zeros."""
    out = np.zeros((len(arrays), *np.max([a.shape for a in arrays], axis=0)), dtype=arrays[0].dtype)
    for row, a in zip(out, arrays, strict=True):
        row[tuple(slice(0, d) for d in a.shape)] = a
    return out
