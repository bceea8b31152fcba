"""The coordinates of a reduced model: what a reduction gives and what recovers fields from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.places import LoadSite
from beamsim.structures.supports import UnitMotion
from beamsim.typing import Floats, Ints


@dataclass(frozen=True)
class LoadPattern:
    """A load whose static deflection the reduced model has to know: a unit force, or the uniform inertia load."""

    vector: Floats  # (N,) scaled load on the free dofs
    # of the unit force; the direction of an inertia load (gravity); the support that moves by one unit
    site: LoadSite | BaseDirection | UnitMotion


@dataclass(frozen=True)
class ReducedBasis:
    """n mass-normalised coordinates: modes first (rigid-body modes first of all), then static vectors.

    Every column v satisfies K v = M a + sum_i p_i f_i, which is how bending moments are recovered from
    equilibrium: ``acceleration_modes`` and ``pattern`` say what a and p are.
    """

    omega: Floats  # (n,) scaled angular frequencies; exact zeros for rigid-body modes
    vectors: Floats  # (N, n) orthonormal in the scaled mass matrix
    rigid: int
    modes: int  # kept modes, rigid-body modes included; the rest of the n columns are static vectors
    patterns: tuple[LoadPattern, ...]
    pattern: Floats  # (patterns, n): p
    acceleration_modes: Floats  # (modes, n): a = vectors[:, :modes] @ acceleration_modes
    highest_frequency: float  # scaled angular frequency that the reduction was made for
    # of several bodies: each body's own basis, and which of these coordinates are its own; patterns are there
    blocks: tuple[tuple[ReducedBasis, Ints], ...] = ()

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return int(self.omega.size)

    @property
    def static_vectors(self) -> int:
        """Number of static vectors among them."""
        return self.size - self.modes

    def left_out(self, load: Floats, rows: Floats, exact: Floats) -> Floats:
        """What the coordinates leave out of static values under a load, to which the modes left out respond statically.

        Under motion of the base, moments need many more modes than deflections (mode-acceleration method).

        Parameters
        ----------
        load : (N,) scaled.
        rows : (m, n) values for a unit of each coordinate.
        exact : (m,) static values under the load, with inertia relief.

        Returns
        -------
        (m,) array
            Scaled.
        """
        flexible = slice(self.rigid, None)
        coordinates = self.vectors[:, flexible].T @ load / self.omega[flexible] ** 2
        return np.asarray(exact - rows[:, flexible] @ coordinates)
