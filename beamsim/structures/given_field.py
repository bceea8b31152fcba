"""Displacements or velocities of a body that are to be met by the coordinates of a reduced model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.typing import Floats


@dataclass(frozen=True)
class WeightedValues:
    """Values that a field is to have, and the weights of their squares in a norm."""

    rows: Any  # (k, N) that give the values of a field of the body
    weights: Floats  # (k,) scaled
    values: Floats  # (k,)

    def products(self, vectors: Floats) -> Floats:
        """(n,) products of the values with those of fields (N, n)."""
        return np.asarray((self.rows @ vectors).T @ (self.weights * self.values))

    def error(self, field: Floats) -> float:
        """Relative error of a field (N,) in the norm."""
        whole = float(self.weights @ self.values**2)
        missed = float(self.weights @ (self.values - self.rows @ field) ** 2)
        return float(np.sqrt(missed / whole)) if whole > 0 else 0.0


@dataclass(frozen=True)
class GivenField:
    """A displacement or velocity of a body."""

    kinetic: WeightedValues  # whose products are those in the scaled mass matrix
    bending: WeightedValues | None = None  # curvatures, in the norm of the bending energy

    def error(self, field: Floats, quantity: str) -> float:
        """Relative error of a field (N,) as a displacement or velocity, in the norms of that quantity."""
        if self.bending is None or quantity == "velocity":  # which has kinetic energy only
            return self.kinetic.error(field)
        return max(self.kinetic.error(field), self.bending.error(field))
