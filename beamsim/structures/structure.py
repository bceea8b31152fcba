"""What a structure is asked for, before reduction: sparse matrices, rows of places, stations, what can be recovered.

Beams, chains and assemblies of them answer alike; nothing above this package asks which of them it has.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.structures.places import Link, Place, Site, SpringEnd
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.stations import Recovery

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Part:
    """One of the bodies of an assembly, and which of the assembly's degrees of freedom are its own."""

    structure: Structure
    dofs: slice


@dataclass(frozen=True)
class Structure(ABC):
    """M u'' + C u' + K u = f on the N degrees of freedom that the supports leave.

    Every degree of freedom is a deflection in metres. M and K are scaled: the physical matrices
    are ``mass_scale * mass`` and ``stiffness_scale * factor.T @ factor``.
    """

    name: str  # of the body in the scenario; empty for an assembly
    mass: Any  # (N, N) sparse
    factor: Any  # (p, N) sparse B with K = B^T B
    damping: Any  # (N, N) sparse, N s/m (physical): dashpots or uniform viscous damping; None without
    inertia: Floats  # (N,) (M_full r) on the free dofs, r = 1 on every deflection, before the supports were applied
    ground: Floats  # (N,) N/m (physical): force on each dof for a unit displacement of the ground
    rigid: Floats  # (N, r) rigid-body modes, orthonormal in `mass`
    mass_scale: float  # kg
    stiffness_scale: float  # N/m
    deflection_dofs: Ints  # dofs that are deflections, in order of the stations: they fix the sign of modes

    @property
    def size(self) -> int:
        """N."""
        return int(self.inertia.size)

    @property
    def frequency_scale(self) -> float:
        """Physical over scaled angular frequency, rad/s."""
        return float(np.sqrt(self.stiffness_scale / self.mass_scale))

    @cached_property
    def factorised_stiffness(self) -> Any:
        """LU factors (SuperLU) of K; with rigid-body modes bordered by them."""
        from scipy.sparse import block_array, csc_array
        from scipy.sparse.linalg import splu

        stiffness: Any = csc_array(self.factor.T @ self.factor)
        if self.rigid.shape[1]:
            border = csc_array(self.mass @ self.rigid)
            stiffness = block_array([[stiffness, border], [border.T, None]], format="csc")
        return splu(csc_array(stiffness))

    @property
    def parts(self) -> tuple[Part, ...]:
        """Bodies that nothing linear couples, each with its own modes; none for a single body."""
        return ()

    def row(self, site: Site) -> Floats:
        """(N,) deflection there for a unit of each degree of freedom; of a link how far its ends draw apart."""
        if isinstance(site, Link):
            return np.asarray(self.deflection_row(site.second) - self.deflection_row(site.first))
        return self.deflection_row(site)

    def rows(self, sites: Sequence[Site]) -> Floats:
        """(m, N) rows of m sites."""
        return np.array([self.row(site) for site in sites]).reshape(len(sites), self.size)

    def loaded_sites(self, sites: Sequence[Site]) -> list[Site]:
        """Sites of the unit forces whose static deflections a reduced model needs, each once."""
        return list(dict.fromkeys(sites))

    @property
    def most_modes(self) -> int | None:
        """Number of flexible modes that the discretisation carries; None where all of them are kept by default."""
        return None

    @abstractmethod
    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""

    @abstractmethod
    def deflection_row(self, place: Place) -> Floats:
        """(N,) deflection at a place for a unit of each degree of freedom."""

    @abstractmethod
    def deflection_and_slope(self, vectors: Floats, place: Place) -> tuple[Floats, Floats]:
        """(k,) deflections of k fields (N, k) at a place, and their derivatives by its coordinate.

        Raises
        ------
        ValueError
            Where places are not on a continuous axis.
        """

    @abstractmethod
    def unit_stiffness(self, site: Site) -> float:
        """Stiffness, N/m, that those of snubbers at a site are compared with."""

    @abstractmethod
    def reduced_damping(self, basis: ReducedBasis, omega: Floats) -> Floats:
        """(n, n) symmetric C of the reduced model, 1/s; ``omega`` (n,) rad/s are the coordinates' frequencies."""

    @abstractmethod
    def recoveries(self, basis: ReducedBasis, sites: Sequence[Site], base_moves: bool) -> tuple[Recovery, ...]:
        """What can be recovered along each body, with stations at the sites where forces act."""

    @abstractmethod
    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,)."""

    @abstractmethod
    def project(self, basis: ReducedBasis, numbers: Sequence[float], quantity: str) -> tuple[Floats, float]:
        """Coordinates (n,) of a field given by numbers, as the kind of body reads them, and the relative error.

        ``quantity`` is "displacement" or "velocity".
        """

    @abstractmethod
    def sensitivities(
        self, path: Path, ends: Sequence[SpringEnd], v: Floats, k: float, squared: float
    ) -> dict[Path, float]:
        """d ln k / d ln p of every number of the body; see `beamsim.structures.point_sensitivity`.

        Parameters
        ----------
        path : where the body is in the scenario.
        ends : places of the spring that are on the body.
        v : (N,) mode, scaled to a stretch of -1 at the spring.
        k, squared : scaled stiffness, scaled omega^2.
        """
