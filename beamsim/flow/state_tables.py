"""The contact states' tables side by side in padded arrays that grow as states are built."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beamsim.flow.contact_state import ContactState
from beamsim.typing import Complexes, Floats

if TYPE_CHECKING:
    from beamsim.flow.kernels import Tables


class StateTables:
    """Padded arrays with room for more states than there are, so that a new state seldom moves the others.

    Of 2^m contact states few are visited, and each is built when it is; ``follower[s, j]`` is the state after
    contact j toggles in state s, -1 where that one is not built yet.
    """

    def __init__(self, contacts: int) -> None:
        self.count = 0
        self.follower = np.full((0, contacts), -1, dtype=np.int64)
        self._arrays: dict[str, NDArray[np.generic]] = {}

    def append(self, state: ContactState, watch: Complexes, roughness: Floats) -> int:
        """Add a state with the coefficients of its watched functions (T, 2 m) and their round-off scale (T, m)."""
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
            "closed": state.closed,
        }
        index = self.count
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
        if index >= self.follower.shape[0]:
            self.follower = np.vstack([self.follower, np.full((index + 1, self.follower.shape[1]), -1)])
        self.count += 1
        return index

    def join(self, state: int, contact: int, following: int) -> None:
        """Note that two states differ by one contact."""
        self.follower[state, contact] = following
        self.follower[following, contact] = state

    def arrays(self) -> Tables:
        """The tables as the kernels take them; rows beyond ``count`` are unused."""
        from beamsim.flow.kernels import Tables

        return Tables(follower=self.follower, **self._arrays)


def pad(arrays: list[Complexes]) -> Complexes:
    """Stack arrays of different sizes, filled up with zeros."""
    out = np.zeros((len(arrays), *np.max([a.shape for a in arrays], axis=0)), dtype=complex)
    for row, a in zip(out, arrays, strict=True):
        row[tuple(slice(0, d) for d in a.shape)] = a
    return out
