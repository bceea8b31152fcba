"""A periodic motion as a sum of harmonics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.orbits.condensation import Condensation
from beamsim.typing import Complexes, Floats, Ints


@dataclass(frozen=True, eq=False)
class HarmonicMotion:
    """A periodic motion as a sum of harmonics; what a balance keeps with each point."""

    fundamental: float  # rad/s
    structure: Condensation
    load: Complexes  # (H + 1, n) on the structure, its springs' forces excepted
    deflections: Complexes  # (H + 1, r) of the springs, one-sided ones first
    forces: Complexes  # (H + 1, r) their forces on the structure
    closed: tuple[Floats, ...]  # (c, 2) of every one-sided spring, the phases during which it is closed, rad
    tangent: Complexes  # (r, 2H + 1) two-sided coefficients of the contact's indicator, or of a cubic spring's 3 w²
    springs: Contacts  # (m,) the one-sided springs
    owner: Ints  # (m,) contact that each is a part of
    direction: Floats  # (m,) of its force in that of the contact

    @cached_property
    def coordinates(self) -> Complexes:
        """(H + 1, n) Q: q(t) = Re sum Q_h e^{i h fundamental t}; of the model's size, so only on request."""
        return self.structure.coordinates(self.fundamental, self.load, self.forces, self.deflections)

    @cached_property
    def edges(self) -> Floats:
        """(G + 1,) s, from 0 to the period, between which no spring opens or closes."""
        cut = [phases[phases[:, 1] - phases[:, 0] < 2 * np.pi].ravel() for phases in self.closed]
        within = np.mod(np.concatenate([np.zeros(0), *cut]) / self.fundamental, self.period)
        return np.unique(np.concatenate([[0.0], within, [self.period]]))

    @cached_property
    def phases(self) -> Ints:
        """(G, m) phases of the springs between the edges, 1 where one is closed."""
        middle = 0.5 * self.fundamental * (self.edges[1:] + self.edges[:-1])
        closed = np.zeros((middle.size, self.springs.count), dtype=np.int64)
        for j, phases in enumerate(self.closed):
            for begin, end in phases:
                closed[:, j] |= (middle - begin) % (2 * np.pi) < end - begin
        return closed

    @property
    def period(self) -> float:
        """s."""
        return 2 * np.pi / self.fundamental

    @property
    def highest(self) -> int:
        """H."""
        return int(self.deflections.shape[0]) - 1

    def states(self, times: Floats) -> Floats:
        """(nt, 2n) displacements and velocities."""
        iw = 1j * np.arange(self.highest + 1) * self.fundamental
        e = np.exp(np.multiply.outer(np.asarray(times, dtype=float), iw))
        return np.hstack([(e @ self.coordinates).real, (e @ (iw[:, None] * self.coordinates)).real])
