"""The interface of structures before reduction: sparse matrices, rows of places, stations, recovery.

Beams, chains and assemblies share it; code above this package does not distinguish them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import eye_array

from beamsim.structures.named_matrices import DofTable, FileSummary, NamedDofs, NamedMatrices, with_base_node
from beamsim.structures.places import (
    DEFLECTION,
    ROTATIONS,
    UPWARDS,
    BaseDirection,
    Link,
    LoadedRegion,
    LoadSite,
    Place,
    PlaneDirection,
    Recovery,
    Site,
    ends_of,
    signed_ends,
)
from beamsim.structures.symmetric_lu import SymmetricLU, factors_with_rigid_motions
from beamsim.typing import Floats, Ints


@dataclass(frozen=True)
class Coupling:
    """A connection between two places, or a place and the base or the ground, in one direction of motion."""

    name: str  # of the joint or spring
    site: Site  # a single place is coupled to the base or the ground
    stiffness: float | None  # N/m or N m/rad; None for a rigid connection
    dashpot: float = 0.0  # N s/m or N m s/rad
    to_ground: bool = False  # whether it is coupled to the fixed ground instead of the base

    @property
    def ends(self) -> tuple[Place, ...]:
        """One place or two."""
        return ends_of(self.site)


@dataclass(frozen=True)
class Restraint:
    """A restraint of one direction of motion of a body: fixed degrees of freedom, or a spring."""

    name: str  # left, right, bottom, top, point 1, node 3, base
    direction: str  # direction of the motion; its reaction is a force for a displacement, a moment for a rotation
    base_motion: float  # its motion for a unit motion of the base
    motion: Floats | None = None  # (all dofs of the body,) fields for its unit motion with free dofs at zero
    spring: Coupling | None = None  # between the body and the moving part


@dataclass(frozen=True)
class UnitMotion:
    """Fields of the bodies for a unit motion of a support, with all free degrees of freedom at zero."""

    fields: Mapping[str, Floats]  # (all dofs,) of each body, including fixed dofs


@dataclass(frozen=True)
class LoadPattern:
    """A load whose static deflection the reduced model must represent: a unit force, or a uniform inertia load."""

    vector: Floats  # (N,) scaled load on the free dofs
    # place of the unit force; direction of an inertia load (gravity); unit motion of a support; or a dashpot, whose
    # force acts on nodes
    site: LoadSite | BaseDirection | UnitMotion | Coupling


@dataclass(frozen=True, eq=False)
class ReducedBasis:
    """n mass-normalised coordinates: modes first (beginning with rigid-body modes), then static vectors.

    Every column v satisfies K v = M a + sum_i p_i f_i, from which bending moments are recovered by equilibrium:
    ``acceleration_modes`` and ``pattern`` give a and p.
    """

    omega: Floats  # (n,) scaled angular frequencies; exact zeros for rigid-body modes
    vectors: Floats  # (N, n) orthonormal in the scaled mass matrix
    rigid_count: int
    modes: int  # number of kept modes, including rigid-body modes; the other columns are static vectors
    patterns: tuple[LoadPattern, ...]
    pattern: Floats  # (patterns, n): p
    acceleration_modes: Floats  # (modes, n): a = vectors[:, :modes] @ acceleration_modes
    highest_frequency: float  # scaled angular frequency for which the reduction was made
    # for several substructures: the basis of each, and the indices of its coordinates; patterns are there
    blocks: tuple[tuple[ReducedBasis, Ints], ...] = ()

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return int(self.omega.size)

    def omitted_response(self, load: Floats, rows: Floats, exact: Floats) -> Floats:
        """Contribution of the omitted modes to static values under a load, to which they respond statically.

        Under base motion, moments need many more modes than deflections (mode-acceleration method).

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
        flexible = slice(self.rigid_count, None)
        coordinates = self.vectors[:, flexible].T @ load / self.omega[flexible] ** 2
        return np.asarray(exact - rows[:, flexible] @ coordinates)


@dataclass(frozen=True)
class WeightedValues:
    """Prescribed values of a field, with weights for their squares in a norm."""

    rows: Any  # (k, N) rows that give the values for a field of the body
    weights: Floats  # (k,) scaled
    values: Floats  # (k,)

    def products(self, vectors: Floats) -> Floats:
        """(n,) weighted products of the values with those of fields (N, n)."""
        return np.asarray((self.rows @ vectors).T @ (self.weights * self.values))

    def error(self, field: Floats) -> float:
        """Relative error of a field (N,) in the norm."""
        whole = float(self.weights @ self.values**2)
        missed = float(self.weights @ (self.values - self.rows @ field) ** 2)
        return float(np.sqrt(missed / whole)) if whole > 0 else 0.0


@dataclass(frozen=True)
class BodyField:
    """A prescribed displacement or velocity field of a body."""

    kinetic: WeightedValues  # norm of the kinetic energy
    bending: WeightedValues | None = None  # curvatures, in the norm of the bending energy

    def error(self, field: Floats, quantity: str) -> float:
        """Relative error of a field (N,) as a displacement or velocity."""
        if self.bending is None or quantity == "velocity":  # a velocity has only kinetic energy
            return self.kinetic.error(field)
        return max(self.kinetic.error(field), self.bending.error(field))


@dataclass(frozen=True)
class Substructure:
    """A part of a structure without linear coupling to the rest, with its slice of dofs."""

    structure: Structure
    dofs: slice


@dataclass(frozen=True)
class MemberBody:
    """A body, with the map from fields of its structure to its own fields."""

    body: BodyStructure
    structure: Structure
    expansion: Any  # (N of the body, N of the structure) sparse map of fields
    mass_ratio: float = 1.0  # unit of mass of the body over that of the structure
    stiffness_ratio: float = 1.0  # unit of stiffness of the body over that of the structure


@dataclass(frozen=True)
class Structure(ABC):
    """A structure M u'' + C u' + K u = f with N free degrees of freedom.

    Degrees of freedom are in metres. M and K are scaled: the physical matrices are ``mass_scale * mass`` and
    ``stiffness_scale * factor.T @ factor``.
    """

    name: str  # of the body in the scenario; empty for an assembly
    mass: Any  # (N, N) sparse
    factor: Any  # (p, N) sparse B with K = B^T B
    damping: Any  # (N, N) sparse, N s/m (physical): dashpots or uniform viscous damping; None without
    rigid: Floats  # (N, r) rigid-body modes, orthonormal in `mass`
    mass_scale: float  # kg
    stiffness_scale: float  # N/m
    # starts of the bodies on the common axis, m, from their joints; missing bodies start at 0
    origins: tuple[tuple[str, float], ...] = field(default=(), kw_only=True)
    # connections of the bodies with one another, the base and the ground, one for each direction
    couplings: tuple[Coupling, ...] = field(default=(), kw_only=True)
    # uncoupled parts, each with its own modes; empty if all is coupled
    substructures: tuple[Substructure, ...] = field(default=(), kw_only=True)
    # (N,) order of elimination; minimum degree if None
    order: Ints | None = field(default=None, kw_only=True)

    @property
    def size(self) -> int:
        """N."""
        return int(self.mass.shape[0])

    @property
    def frequency_scale(self) -> float:
        """Physical angular frequency of the scaled unit, rad/s."""
        return float(np.sqrt(self.stiffness_scale / self.mass_scale))

    @cached_property
    def stiffness(self) -> Any:
        """(N, N) scaled K, sparse."""
        return (self.factor.T @ self.factor).tocsc()

    @cached_property
    def factorised_stiffness(self) -> SymmetricLU:
        """Factors of K, with one pinned degree of freedom for each rigid-body mode."""
        return factors_with_rigid_motions(self.stiffness, self.rigid, self.order)

    @property
    @abstractmethod
    def members(self) -> tuple[MemberBody, ...]:
        """The bodies."""

    def member(self, name: str) -> MemberBody:
        """The body with a name; for a single body always that body."""
        members = self.members
        return members[0] if len(members) == 1 else next(each for each in members if each.body.name == name)

    def deflections(self, vectors: Floats) -> Floats:
        """(d,) or (d, k) deflections at the stations, for fields (N,) or (N, k); used for the sign of modes."""
        return vectors

    def row(self, site: LoadSite) -> Floats:
        """(N,) motion at a place for a unit of each degree of freedom; for a link its extension.

        For a distributed load the work of its unit level: the load vector.

        Raises
        ------
        ValueError
            If the body has no motion in that direction, or cannot carry a distributed load.
        """
        if isinstance(site, (Link, PlaneDirection)):
            return np.asarray(sum(factor * self.row(end) for factor, end in signed_ends(site)))
        member = self.member(site.body)
        return np.asarray((member.body.unsupported_row(site) @ member.body.all_dofs_map) @ member.expansion)

    def own_row(self, site: Site) -> Floats:
        """(N,) extension of the ends of a site that are on the structure, for a unit of each dof."""
        names = {member.body.name for member in self.members}
        ends = [sign * self.row(end) for sign, end in signed_ends(site) if end.body in names]
        return np.asarray(sum(ends, np.zeros(self.size)))

    def rows(self, sites: Sequence[LoadSite]) -> Floats:
        """(m, N) rows of m sites."""
        return np.array([self.row(site) for site in sites]).reshape(len(sites), self.size)

    def loaded_sites(self, sites: Sequence[LoadSite]) -> list[LoadSite]:
        """Sites of unit forces whose static deflections a reduced model needs.

        The ends of a link are loaded separately if it joins two bodies, or if moments are recovered; so are both
        places of a plane, since its directions share them.
        """
        loaded: dict[LoadSite, None] = {}
        for site in sites:
            apart = isinstance(site, PlaneDirection) or (
                isinstance(site, Link)
                and (site.first.body != site.second.body or self.member(site.first.body).body.recovers_moments)
            )
            loaded |= dict.fromkeys(ends_of(site) if apart else (site,))
        return list(loaded)

    @property
    def most_modes(self) -> int | None:
        """Number of flexible modes that the discretisation resolves; None if the default keeps all."""
        return None

    @abstractmethod
    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""

    @abstractmethod
    def unit_stiffness(self, site: Site) -> float:
        """Reference stiffness, N/m, for snubbers at a site."""

    @abstractmethod
    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) scaled inertia and (N,) physical force of springs to the ground, for a unit motion of the base.

        The inertia belongs to a unit acceleration, in units of mass, and acts against it; the force belongs to a unit
        displacement.

        Raises
        ------
        MethodError
            If a body does not support this motion.
        """

    def base_direction_of(self, body: str, motion: BaseDirection) -> BaseDirection:
        """A motion of the base in the coordinates of a body."""
        if motion.direction not in ROTATIONS:
            return motion
        x, y, z = motion.axis_point
        return replace(motion, axis_point=(x - dict(self.origins).get(body, 0.0), y, z))

    def base_motion_at(self, place: Place | PlaneDirection, motion: BaseDirection) -> float:
        """Rigid motion of a place in its direction, m or rad, for a unit motion of the base."""
        if isinstance(place, PlaneDirection):
            return sum(factor * self.base_motion_at(end, motion) for factor, end in signed_ends(place))
        body = self.member(place.body).body
        return float(body.unsupported_row(place) @ body.rigid_motion(self.base_direction_of(place.body, motion)))

    def recoveries(
        self, basis: ReducedBasis, sites: Sequence[LoadSite], base: BaseDirection | None
    ) -> tuple[Recovery, ...]:
        """Quantities that can be recovered along each body, with stations at the sites of forces.

        ``base`` is how the base moves, None where it is at rest.

        Parameters
        ----------
        basis : the reduced coordinates.
        sites : sites of forces.
        base : motion of the base; None if it is at rest.

        Returns
        -------
        tuple
            One item for each body.
        """
        ends = [end for site in sites for end in ends_of(site)]
        return tuple(
            member.body.recovery(member, basis, [end for end in ends if self.member(end.body) is member], base)
            for member in self.members
        )

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,)."""
        return float(np.abs(self.deflections(field)).max())

    def project(
        self, basis: ReducedBasis, numbers_by_body: Mapping[str, Sequence[float]], quantity: str
    ) -> tuple[Floats, dict[str, float]]:
        """Kinetic (M-orthogonal) projection of fields on a basis.

        Parameters
        ----------
        basis : basis of the structure.
        numbers_by_body : coefficients or values for each body, in the form that its kind takes; zero for other bodies.
        quantity : "displacement" or "velocity".

        Returns
        -------
        (n,) array, dict
            Coordinates, and the relative error of each given field.
        """
        fields = [
            (member, member.expansion @ basis.vectors, member.body.given_field(numbers_by_body[member.body.name]))
            for member in self.members
            if any(numbers_by_body.get(member.body.name, ()))
        ]
        parts = (member.mass_ratio * field.kinetic.products(vectors) for member, vectors, field in fields)
        q = sum(parts, np.zeros(basis.size))
        errors = {member.body.name: field.error(vectors @ q, quantity) for member, vectors, field in fields}
        return q * np.sqrt(self.mass_scale), errors


@dataclass(frozen=True)
class BodyStructure(Structure, ABC):
    """A single body; each kind of body is a subclass."""

    section: Any  # section of the scenario; None if it contains no numbers of the matrices
    stated_damping: Any  # damping of the body in the scenario; None without
    # (all dofs, N) sparse map from free dofs to all dofs, including fixed ones
    all_dofs_map: Any
    # mass and factor of all dofs, scaled, and their damping, N s/m, or None; for imported matrices see `forces_of`
    unsupported: tuple[Any, Any, Any] | None = field(default=None, kw_only=True)
    # springs and dashpots between the ends and the base
    end_springs: tuple[Coupling, ...] = field(default=(), kw_only=True)
    notes: tuple[str, ...] = field(default=(), kw_only=True)  # remarks for the user on the treatment of its data
    file_summary: FileSummary | None = field(default=None, kw_only=True)  # of a body that is read from files

    sides: ClassVar[tuple[str, ...]] = ()
    """Keys of the section with the size of the body along each axis."""

    has_base_nodes: ClassVar[bool] = False
    """Whether `named_matrices` have its supports as nodes with all directions in which they act."""

    recovers_moments: ClassVar[bool] = False
    """Whether moments are recovered, from one point force at a time."""

    @cached_property
    def members(self) -> tuple[MemberBody, ...]:
        """The body itself, as a tuple."""
        return (MemberBody(self, self, eye_array(self.size, format="csr")),)

    @abstractmethod
    def reassemble(self, section: Any) -> BodyStructure:
        """A body with other numbers on the same mesh."""

    @property
    def total_mass(self) -> float:
        """Mass that moves with a vertical motion of the base, kg."""
        motion = self.rigid_motion(UPWARDS)
        return float(motion @ self.forces_of(motion)[1])

    @property
    def named_dofs(self) -> NamedDofs:
        """Names of the degrees of freedom for other programs; here each is a node with a deflection."""
        names = tuple((i + 1, DEFLECTION) for i in range(self.size))
        return NamedDofs(DofTable(names), np.ones(self.size), np.ones(self.size))

    @property
    def named_matrices(self) -> NamedMatrices:
        """Matrices of the body and its base, for other programs."""
        return with_base_node(
            self.named_dofs, self.mass_scale * self.mass, self.stiffness_scale * self.stiffness, self.damping,
            self.mass_scale * self.base_load(UPWARDS)[0], self.total_mass,
        )  # fmt: skip

    def restraints(self, base: BaseDirection) -> Sequence[Restraint]:
        """All restraints of the body, with their motion for a unit motion of the base; empty if it is free."""
        return ()

    @abstractmethod
    def unsupported_row(self, place: Place | LoadedRegion) -> Floats:
        """(all dofs,) row of a place, or load vector of a region."""

    def rigid_motion(self, motion: BaseDirection) -> Floats:
        """(all dofs,) rigid displacement for a unit motion of the base; here only upwards."""
        return np.ones(self.size)

    def forces_of(self, motion: Floats) -> Floats:
        """(3, all dofs) forces for a displacement, N, acceleration and velocity of all dofs."""
        assert self.unsupported is not None
        mass, factor, damping = self.unsupported
        dragged = np.zeros(motion.size) if damping is None else damping @ motion
        return np.array(
            [self.stiffness_scale * (factor.T @ (factor @ motion)), self.mass_scale * (mass @ motion), dragged]
        )

    def work(self, motion: Floats, forces: Floats) -> Floats:
        """(3,) work of forces (3, all dofs) along a motion (all dofs,)."""
        return forces @ motion

    def place_problem(self, place: Place | LoadedRegion, for_force: bool) -> tuple[str, str, str] | None:
        """Key, message and remedy if a place or shape does not exist, or nothing can act there; else None."""
        if isinstance(place, LoadedRegion) and place.mode is not None and place.mode > self.size:
            return "shape.mode", f"= {place.mode}, but {self.name} has {self.size} modes", "choose a lower mode"
        return None

    def largest_at(self, field: Floats) -> str:
        """Place of the largest deflection of a field (N,), as text."""
        named = self.named_dofs
        shifts = np.where([each == DEFLECTION for _, each in named.table.dofs], np.abs(named.scale * field), 0.0)
        row = int(np.argmax(shifts))
        if named.table.coordinates is None:
            return f"mass {named.table.dofs[row][0]}"
        x, y, _ = named.table.coordinates[row].tolist()
        return f"({x:g}, {y:g}) m" if np.any(named.table.coordinates[:, 1]) else f"{x:g} m"

    def point_of(self, place: Place) -> Floats | None:
        """(3,) coordinates of a place in the axes of the body, m; None if unknown."""
        return None

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) inertia and (N,) force of springs to the ground, for a unit motion of the base."""
        assert self.unsupported is not None
        inertia = (self.unsupported[0] @ self.rigid_motion(motion)) @ self.all_dofs_map
        return np.asarray(inertia), np.zeros(self.size)

    def demand_undamped(self, motion: BaseDirection) -> None:
        """Refuse a motion of the base that dashpots of imported matrices would damp; other bodies accept all motions.

        Raises
        ------
        MethodError
            If there are such dashpots.
        """

    def recovery_row(self, number: int, order: int = 0) -> Floats:
        """(all dofs,) row of another quantity of the body, by its index from 0.

        ``order`` is the time derivative of the motion that it multiplies: 1 for velocity, 2 for acceleration.
        """
        raise ValueError(f"{self.name} gives no other quantities")  # which the scenario refuses

    @abstractmethod
    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """Quantities that can be recovered along the body, with stations at the sites on it.

        Parameters
        ----------
        member : the body and its map from the structure.
        basis : reduced coordinates of the whole structure.
        sites : where forces act on the body.
        base : motion of the base; None if it is at rest.

        Returns
        -------
        Recovery
            For a unit of each coordinate.
        """

    def given_field(self, numbers: Sequence[float]) -> BodyField:
        """A field given by numbers in the form that this kind of body takes."""
        raise ValueError(f"{self.name} takes no field to start from")  # which the scenario refuses
