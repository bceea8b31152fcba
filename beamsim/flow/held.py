"""Contacts that hold: in such a phase the force is whatever keeps the penetration at its value.

With the rows W of the held contacts (penetrations for a unit of each coordinate) and the generalised force f of all
else, the reactions are those :math:`\\lambda` for which :math:`W (f - W^T\\lambda) = 0`. Where several do, since
contacts hold one motion together, they are those of the smallest sum of squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Bools, Floats, Ints

SMALLEST = 1e-10  # of the largest singular value of the rows: smaller ones hold nothing more


@dataclass(frozen=True)
class Held:
    """The h contacts that hold."""

    contact: Ints  # (h,)
    across: Floats  # (n, r) orthonormal basis of the coordinates that do not move
    share: Floats  # (h, n) reactions for a unit of each generalised force

    def free(self, forces: Floats) -> Floats:
        """Generalised forces (..., n) without what the reactions balance; what is left of those that they balance
        whole is round-off, and would move what rests."""
        left = np.asarray(forces - (forces @ self.across) @ self.across.T)
        size = np.linalg.norm(forces, axis=-1, keepdims=True)
        # 1e-14: of a force
        return np.where(np.linalg.norm(left, axis=-1, keepdims=True) <= 1e-14 * size, 0.0, left)

    def resting(self, rows: Floats) -> Bools:
        """(m,) which motions, of rows (m, n), the contacts hold as well: others at the same place, for example."""
        left = np.linalg.norm(self.free(rows), axis=1)
        return np.asarray(left <= SMALLEST * np.linalg.norm(rows, axis=1))


def held_contacts(system: PiecewiseLinearSystem, phases: Ints) -> Held | None:
    """What holds with the contacts in given phases; None where nothing does."""
    contacts = system.contacts
    if not contacts.ever_hold:
        return None
    contact = np.flatnonzero(contacts.holds(phases))
    if not contact.size:
        return None
    rows = -contacts.sign[contact, None] * contacts.shape[contact]
    left, size, right = np.linalg.svd(rows, full_matrices=False)
    rank = int(np.sum(size > SMALLEST * size.max()))
    return Held(contact, right[:rank].T, (left[:, :rank] / size[:rank]) @ right[:rank])
