"""What a structure is asked for, before reduction: sparse matrices, rows of places, stations, what can be recovered.

Beams, chains and assemblies of them answer alike; nothing above this package asks which of them it has.
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
    Recovery,
    Site,
    ends_of,
    signed_ends,
)
from beamsim.structures.symmetric_lu import SymmetricLU, factors_with_rigid_motions
from beamsim.typing import Floats, Ints


@dataclass(frozen=True)
class Coupling:
    """What acts between two places, or a place and the base or the ground, in one direction of motion."""

    name: str  # of the joint or spring
    site: Site  # a place alone is coupled to the base, or to the ground
    stiffness: float | None  # N/m or N m/rad; None where nothing moves apart
    dashpot: float = 0.0  # N s/m or N m s/rad
    to_ground: bool = False  # which stays where it is when the base moves

    @property
    def ends(self) -> tuple[Place, ...]:
        """One place or two."""
        return ends_of(self.site)


@dataclass(frozen=True)
class Restraint:
    """What holds one direction of motion of a body: degrees of freedom that it fixes, or a spring."""

    name: str  # left, right, bottom, top, point 1, node 3, base
    direction: str  # of the motion: a force of a displacement, a moment of a rotation
    base_motion: float  # how far it moves with a unit motion of the base
    motion: Floats | None = None  # (all dofs of the body,) when it moves by one unit and the free ones stay at zero
    spring: Coupling | None = None  # between the body and what moves


@dataclass(frozen=True)
class UnitMotion:
    """Fields of the bodies when a support moves by one unit and the structure's degrees of freedom stay at zero."""

    fields: Mapping[str, Floats]  # by body (all dofs,), those that supports hold included


@dataclass(frozen=True)
class LoadPattern:
    """A load whose static deflection the reduced model has to know: a unit force, or the uniform inertia load."""

    vector: Floats  # (N,) scaled load on the free dofs
    # of the unit force; the direction of an inertia load (gravity); the support that moves by one unit; a dashpot,
    # whose force acts on nodes
    site: LoadSite | BaseDirection | UnitMotion | Coupling


@dataclass(frozen=True, eq=False)
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

    def omitted_response(self, load: Floats, rows: Floats, exact: Floats) -> Floats:
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
class BodyField:
    """A displacement or velocity of a body."""

    kinetic: WeightedValues  # whose products are those in the scaled mass matrix
    bending: WeightedValues | None = None  # curvatures, in the norm of the bending energy

    def error(self, field: Floats, quantity: str) -> float:
        """Relative error of a field (N,) as a displacement or velocity, in the norms of that quantity."""
        if self.bending is None or quantity == "velocity":  # which has kinetic energy only
            return self.kinetic.error(field)
        return max(self.kinetic.error(field), self.bending.error(field))


@dataclass(frozen=True)
class Substructure:
    """A share of a structure that nothing linear couples to the rest, and the slice of dofs that are its own."""

    structure: Structure
    dofs: slice


@dataclass(frozen=True)
class MemberBody:
    """A body, and how its fields follow from those of the structure that it belongs to."""

    body: BodyStructure
    structure: Structure
    expansion: Any  # (N of the body, N of the whole) sparse: fields of the body from those of the whole structure
    mass_ratio: float = 1.0  # unit of mass of the body over that of the whole structure
    stiffness_ratio: float = 1.0  # of stiffness


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
    rigid: Floats  # (N, r) rigid-body modes, orthonormal in `mass`
    mass_scale: float  # kg
    stiffness_scale: float  # N/m
    # where bodies begin on the common axis, m, as their joints place them; a body that is not in it begins at 0
    origins: tuple[tuple[str, float], ...] = field(default=(), kw_only=True)
    # what joins the bodies to one another, to the base and to the ground, direction by direction
    couplings: tuple[Coupling, ...] = field(default=(), kw_only=True)
    # what nothing linear couples to the rest, each with its own modes; none where all is coupled
    substructures: tuple[Substructure, ...] = field(default=(), kw_only=True)
    # (N,) rows in the order of elimination; None by minimum degree
    order: Ints | None = field(default=None, kw_only=True)

    @property
    def size(self) -> int:
        """N."""
        return int(self.mass.shape[0])

    @property
    def frequency_scale(self) -> float:
        """Physical over scaled angular frequency, rad/s."""
        return float(np.sqrt(self.stiffness_scale / self.mass_scale))

    @cached_property
    def stiffness(self) -> Any:
        """(N, N) scaled K, sparse."""
        return (self.factor.T @ self.factor).tocsc()

    @cached_property
    def factorised_stiffness(self) -> SymmetricLU:
        """Factors of K, with as many degrees of freedom held as there are rigid-body modes."""
        return factors_with_rigid_motions(self.stiffness, self.rigid, self.order)

    @property
    @abstractmethod
    def members(self) -> tuple[MemberBody, ...]:
        """The bodies."""

    def member(self, name: str) -> MemberBody:
        """The body of this name; of a single body that body, whatever the name."""
        members = self.members
        return members[0] if len(members) == 1 else next(each for each in members if each.body.name == name)

    def deflections(self, vectors: Floats) -> Floats:
        """(d,) or (d, k) deflections, in order of the stations, of fields (N,) or (N, k): the sign of modes."""
        return vectors

    def row(self, site: LoadSite) -> Floats:
        """(N,) motion there for a unit of each degree of freedom; of a link how far its ends draw apart.

        Of a distributed load what the work of its unit level is: the load vector, as it is of a unit point force.

        Raises
        ------
        ValueError
            Where a place of the body does not move in that direction, or no load can be spread over it.
        """
        if isinstance(site, Link):
            return np.asarray(self.row(site.second) - self.row(site.first))
        member = self.member(site.body)
        return np.asarray((member.body.unsupported_row(site) @ member.body.all_dofs_map) @ member.expansion)

    def own_row(self, site: Site) -> Floats:
        """(N,) how far those ends of a site that are on the structure draw apart for a unit of each dof."""
        names = {member.body.name for member in self.members}
        ends = [sign * self.row(end) for sign, end in signed_ends(site) if end.body in names]
        return np.asarray(sum(ends, np.zeros(self.size)))

    def rows(self, sites: Sequence[LoadSite]) -> Floats:
        """(m, N) rows of m sites."""
        return np.array([self.row(site) for site in sites]).reshape(len(sites), self.size)

    def loaded_sites(self, sites: Sequence[LoadSite]) -> list[LoadSite]:
        """Sites of the unit forces whose static deflections a reduced model needs, each once.

        The ends of a link are loaded one at a time where it joins two bodies, or moments are recovered.
        """
        loaded: dict[LoadSite, None] = {}
        for site in sites:
            apart = isinstance(site, Link) and (
                site.first.body != site.second.body or self.member(site.first.body).body.recovers_moments
            )
            loaded |= dict.fromkeys(ends_of(site) if apart else (site,))
        return list(loaded)

    @property
    def most_modes(self) -> int | None:
        """Number of flexible modes that the discretisation carries; None where all of them are kept by default."""
        return None

    @abstractmethod
    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""

    @abstractmethod
    def unit_stiffness(self, site: Site) -> float:
        """Stiffness, N/m, that those of snubbers at a site are compared with."""

    @abstractmethod
    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) scaled inertia and (N,) physical force of springs to the ground under a unit motion of the base.

        The first belongs to a unit acceleration, kg in units of mass, and acts against it; the second to a unit
        displacement.

        Raises
        ------
        MethodError
            Where a body cannot move so.
        """

    def base_direction_of(self, body: str, motion: BaseDirection) -> BaseDirection:
        """A motion of the base in the coordinates of a body."""
        if motion.direction not in ROTATIONS:
            return motion
        x, y, z = motion.axis_point
        return replace(motion, axis_point=(x - dict(self.origins).get(body, 0.0), y, z))

    def base_motion_at(self, place: Place, motion: BaseDirection) -> float:
        """Motion of a place in its direction, m or rad, when the base moves by one unit and nothing deforms."""
        body = self.member(place.body).body
        return float(body.unsupported_row(place) @ body.rigid_motion(self.base_direction_of(place.body, motion)))

    def recoveries(
        self, basis: ReducedBasis, sites: Sequence[LoadSite], base: BaseDirection | None
    ) -> tuple[Recovery, ...]:
        """What can be recovered along each body, with stations at the sites where forces act.

        ``base`` is how the base moves, None where it is at rest.

        Parameters
        ----------
        basis : the reduced coordinates.
        sites : where forces act.
        base : how the base moves; None where it is at rest.

        Returns
        -------
        tuple
            Body by body.
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
        """Kinetic (M-orthogonal) projection of given fields on a basis.

        Parameters
        ----------
        basis : of the structure.
        numbers_by_body : coefficients or values for each body, in the form that its kind takes; zero for other bodies.
        quantity : "displacement" or "velocity".

        Returns
        -------
        (n,) array, dict
            Coordinates, and the relative error on every body that is named.
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
    """One body; a kind of body is a subclass."""

    section: Any  # what describes the body in the scenario; None where that has no number of its matrices
    stated_damping: Any  # what the scenario gives the body; None without
    # (all dofs, N) sparse: values of all dofs, those that supports hold included, from those of the free ones
    all_dofs_map: Any
    # mass and factor of all dofs, scaled, and their damping, N s/m, or None; of imported matrices see `forces_of`
    unsupported: tuple[Any, Any, Any] | None = field(default=None, kw_only=True)
    # springs and dashpots between the ends and the base
    end_springs: tuple[Coupling, ...] = field(default=(), kw_only=True)
    notes: tuple[str, ...] = field(default=(), kw_only=True)  # what was done to its data that a user should know
    file_summary: FileSummary | None = field(default=None, kw_only=True)  # of the files that it was read from

    sides: ClassVar[tuple[str, ...]] = ()
    """Keys of the section that are the extent of the body along each axis."""

    recovers_moments: ClassVar[bool] = False
    """Whether moments are recovered, from one point force at a time."""

    @cached_property
    def members(self) -> tuple[MemberBody, ...]:
        """Itself."""
        return (MemberBody(self, self, eye_array(self.size, format="csr")),)

    @abstractmethod
    def reassemble(self, section: Any) -> BodyStructure:
        """The body with other numbers on the same mesh."""

    @property
    def total_mass(self) -> float:
        """Mass that an upward motion of the base moves, kg."""
        motion = self.rigid_motion(UPWARDS)
        return float(motion @ self.forces_of(motion)[1])

    @property
    def named_dofs(self) -> NamedDofs:
        """Nodes and directions of the degrees of freedom, for other programs; here each is a node that deflects."""
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
        """What holds the body, direction by direction, and how far it moves with the base; none where it is free."""
        return ()

    @abstractmethod
    def unsupported_row(self, place: Place | LoadedRegion) -> Floats:
        """(all dofs,) row of a place, or load vector."""

    def rigid_motion(self, motion: BaseDirection) -> Floats:
        """(all dofs,) displacement when the base moves by one unit and nothing deforms: here upwards alone."""
        return np.ones(self.size)

    def forces_of(self, motion: Floats) -> Floats:
        """(3, all dofs) forces of a displacement, N, acceleration and velocity of all dofs (all dofs,)."""
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
        """Key, message and remedy where there is no such place or shape on the body, or nothing can act there."""
        if isinstance(place, LoadedRegion) and place.mode is not None and place.mode > self.size:
            return "shape.mode", f"= {place.mode}, but {self.name} has {self.size} modes", "choose a lower mode"
        return None

    def largest_at(self, field: Floats) -> str:
        """Where a field (N,) has its largest deflection, for people."""
        named = self.named_dofs
        shifts = np.where([each == DEFLECTION for _, each in named.table.dofs], np.abs(named.scale * field), 0.0)
        row = int(np.argmax(shifts))
        if named.table.coordinates is None:
            return f"mass {named.table.dofs[row][0]}"
        x, y, _ = named.table.coordinates[row].tolist()
        return f"({x:g}, {y:g}) m" if np.any(named.table.coordinates[:, 1]) else f"{x:g} m"

    def point_of(self, place: Place) -> Floats | None:
        """(3,) coordinates of a place in axes of the body, m; None where it has none."""
        return None

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) inertia and (N,) force of springs to the ground under a unit motion of the base."""
        assert self.unsupported is not None
        inertia = (self.unsupported[0] @ self.rigid_motion(motion)) @ self.all_dofs_map
        return np.asarray(inertia), np.zeros(self.size)

    def demand_undamped(self, motion: BaseDirection) -> None:
        """Refuse a motion of the base that dashpots of imported matrices would damp, which others do not have.

        Raises
        ------
        MethodError
            Where there are some.
        """

    def recovery_row(self, number: int, order: int = 0) -> Floats:
        """(all dofs,) another quantity that the body gives, by its number from 0, for a unit of each of its dofs.

        ``order`` is that of the time derivative of the motion that it takes: 1 of velocity, 2 of acceleration.
        """
        raise ValueError(f"{self.name} gives no other quantities")  # which the scenario refuses

    @abstractmethod
    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """What can be recovered along the body, with stations at the sites on it; ``member`` is the body itself.

        Parameters
        ----------
        member : the body, and how it lies in its structure.
        basis : reduced coordinates of the whole structure.
        sites : where forces act on the body.
        base : how the base moves; None where it is at rest.

        Returns
        -------
        Recovery
            For a unit of each coordinate.
        """

    def given_field(self, numbers: Sequence[float]) -> BodyField:
        """A field that a scenario gives by numbers, as the kind of body reads them."""
        raise ValueError(f"{self.name} takes no field to start from")  # which the scenario refuses
