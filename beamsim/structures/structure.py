"""What a structure is asked for, before reduction: sparse matrices, rows of places, stations, what can be recovered.

Beams, chains and assemblies of them answer alike; nothing above this package asks which of them it has.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.matrix_files.matrix import MODAL
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.distributed import Distributed
from beamsim.structures.dof_table import DofTable, NamedDofs
from beamsim.structures.named_matrices import NamedMatrices, with_base_node
from beamsim.structures.places import DEFLECTION, Link, LoadSite, Place, Site, ends_of
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.file_summary import FileSummary
    from beamsim.structures.stations import Recovery
    from beamsim.structures.supports import Support

Path = tuple[str | int, ...]


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


class GivenField(Protocol):
    """A displacement or velocity of a body that is to be met by the coordinates of a reduced model."""

    def products(self, vectors: Floats) -> Floats:
        """(n,) its products with fields (N, n) of the body in the scaled mass matrix."""

    def error(self, vectors: Floats, q: Floats, quantity: str) -> float:
        """Relative error of ``vectors @ q`` as a displacement or velocity, in the norm of that quantity."""


@dataclass(frozen=True)
class Part:
    """A part of a structure that nothing linear couples to the others, and which of the dofs are its own."""

    structure: Structure
    dofs: slice


@dataclass(frozen=True)
class MemberBody:
    """A body, and how its fields follow from those of the structure that it belongs to."""

    body: BodyStructure
    whole: Structure
    expansion: Any = None  # (N of the body, N of the whole) sparse; None where the body is the whole structure

    def field(self, vectors: Floats) -> Floats:
        """Fields (N,) or (N, k) of the whole structure on the dofs of the body."""
        return vectors if self.expansion is None else np.asarray(self.expansion @ vectors)

    def on_whole(self, row: Floats) -> Floats:
        """A row (N of the body,) on the dofs of the whole structure."""
        return row if self.expansion is None else np.asarray(self.expansion.T @ row)

    @property
    def mass_ratio(self) -> float:
        """Unit of mass of the body over that of the whole structure."""
        return self.body.mass_scale / self.whole.mass_scale

    @property
    def stiffness_ratio(self) -> float:
        """Unit of stiffness of the body over that of the whole structure."""
        return self.body.stiffness_scale / self.whole.stiffness_scale


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
    # where bodies begin on the common axis, m, as their joints place them; a body that is not in it begins at 0
    origins: tuple[tuple[str, float], ...] = field(default=(), kw_only=True)

    @property
    def size(self) -> int:
        """N."""
        return int(self.inertia.size)

    @property
    def frequency_scale(self) -> float:
        """Physical over scaled angular frequency, rad/s."""
        return float(np.sqrt(self.stiffness_scale / self.mass_scale))

    @cached_property
    def stiffness(self) -> Any:
        """(N, N) scaled K, sparse."""
        return (self.factor.T @ self.factor).tocsc()

    def factorise(self, matrix: Any) -> Any:
        """LU factors (SuperLU) of a symmetric combination (N, N) of K and M."""
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        return splu(csc_array(matrix))

    @property
    def elimination_order(self) -> Ints | None:
        """(N,) rows in the order in which factorisations take least; None where they find one themselves."""
        return None

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was done to the data of the bodies that a user should know."""
        return tuple(remark for member in self.members if member.body is not self for remark in member.body.remarks)

    @cached_property
    def factorised_stiffness(self) -> Any:
        """LU factors (SuperLU) of K; with rigid-body modes bordered by them."""
        from scipy.sparse import block_array, csc_array
        from scipy.sparse.linalg import splu

        stiffness: Any = self.stiffness
        if self.rigid.shape[1]:
            border = csc_array(self.mass @ self.rigid)
            stiffness = block_array([[stiffness, border], [border.T, None]], format="csc")
        return splu(csc_array(stiffness))

    @property
    def parts(self) -> tuple[Part, ...]:
        """Parts that nothing linear couples, each with its own modes; none where all is coupled."""
        return ()

    @property
    @abstractmethod
    def members(self) -> tuple[MemberBody, ...]:
        """The bodies."""

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """What joins the bodies to one another, to the base and to the ground."""
        return ()

    def member(self, name: str) -> MemberBody:
        """The body of this name; of a single body that body, whatever the name."""
        members = self.members
        return members[0] if len(members) == 1 else next(each for each in members if each.body.name == name)

    def deflections(self, vectors: Floats) -> Floats:
        """Those of the values (N,) or (N, k) that are deflections, in order of the stations."""
        return np.asarray(vectors[self.deflection_dofs])

    def row(self, site: LoadSite) -> Floats:
        """(N,) motion there for a unit of each degree of freedom; of a link how far its ends draw apart.

        Of a distributed load what the work of its unit level is: the load vector, as it is of a unit point force.
        """
        if isinstance(site, Distributed):
            return self.distributed_row(site)
        if isinstance(site, Link):
            return np.asarray(self.place_row(site.second) - self.place_row(site.first))
        return self.place_row(site)

    def rows(self, sites: Sequence[LoadSite]) -> Floats:
        """(m, N) rows of m sites."""
        return np.array([self.row(site) for site in sites]).reshape(len(sites), self.size)

    def loaded_sites(self, sites: Sequence[LoadSite]) -> list[LoadSite]:
        """Sites of the unit forces whose static deflections a reduced model needs, each once."""
        return list(dict.fromkeys(sites))

    @property
    def most_modes(self) -> int | None:
        """Number of flexible modes that the discretisation carries; None where all of them are kept by default."""
        return None

    @abstractmethod
    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""

    @property
    def counted(self) -> Mapping[float, int]:
        """Scaled angular frequencies below which modes were counted exactly, rigid motions included, and the counts."""
        return {}

    @abstractmethod
    def place_row(self, place: Place) -> Floats:
        """(N,) motion at a place in its direction, m or rad, for a unit of each degree of freedom.

        Raises
        ------
        ValueError
            Where a place of the body does not move in that direction.
        """

    def distributed_row(self, load: Distributed) -> Floats:
        """(N,) consistent load vector of a distributed load of unit level, m or m^2: the work on each dof.

        Raises
        ------
        ValueError
            Where the body has no extent that a load could be spread over.
        """
        raise ValueError(f"{load.label} takes no distributed load")  # which the scenario refuses

    @abstractmethod
    def unit_stiffness(self, site: Site) -> float:
        """Stiffness, N/m, that those of snubbers at a site are compared with."""

    @abstractmethod
    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) scaled inertia and (N,) physical force of springs to the ground under a unit motion of the base.

        The first belongs to a unit acceleration, kg in units of mass, and acts against it; the second to a unit
        displacement. For ``UPWARDS`` they are `inertia` and `ground`.

        Raises
        ------
        MethodError
            Where a body cannot move so.
        """

    def seen_from(self, body: str, motion: BaseDirection) -> BaseDirection:
        """A motion of the base in the coordinates of a body."""
        return motion.moved(dict(self.origins).get(body, 0.0))

    def base_motion_at(self, place: Place, motion: BaseDirection) -> float:
        """Motion of a place in its direction, m or rad, when the base moves by one unit and nothing deforms."""
        return self.member(place.body).body.base_motion_of(place, self.seen_from(place.body, motion))

    def recoveries(
        self, basis: ReducedBasis, sites: Sequence[LoadSite], base: BaseDirection | None
    ) -> tuple[Recovery, ...]:
        """What can be recovered along each body, with stations at the sites where forces act.

        ``base`` is how the base moves, None where it is at rest.
        """
        ends = [end for site in sites for end in ends_of(site)]
        return tuple(
            member.body.recovery(
                member, basis, [end for end in ends if self.member(end.body).body is member.body], base
            )
            for member in self.members
        )

    @abstractmethod
    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,)."""


@dataclass(frozen=True)
class BodyStructure(Structure, ABC):
    """One body; a kind of body is a subclass."""

    section: Any  # what describes the body in the scenario; None where that has no number of its matrices

    @property
    def file_summary(self) -> FileSummary | None:
        """What the files hold that it was read from; None without files."""
        return None

    @property
    def members(self) -> tuple[MemberBody, ...]:
        """Itself."""
        return (MemberBody(self, self),)

    sides: ClassVar[tuple[str, ...]] = ()
    """Keys of the section that are the extent of the body along each axis."""

    @abstractmethod
    def reassembled(self, section: Any) -> BodyStructure:
        """The body with other numbers on the same mesh."""

    @property
    def stated_damping(self) -> Any:
        """The damping that the scenario gives the body; None without."""
        return self.section.damping

    @property
    def total_mass(self) -> float:
        """Mass of the body, kg."""
        return float(self.inertia[self.deflection_dofs].sum()) * self.mass_scale

    @property
    def named_dofs(self) -> NamedDofs:
        """Nodes and directions of the degrees of freedom, for other programs; here each has a node of its own."""
        deflects = np.isin(np.arange(self.size), self.deflection_dofs)
        names = tuple((i + 1, DEFLECTION if each else MODAL) for i, each in enumerate(deflects))
        return NamedDofs(DofTable(names), np.ones(self.size), deflects.astype(float))

    @property
    def named_matrices(self) -> NamedMatrices:
        """Matrices of the body and its base, for other programs."""
        return with_base_node(
            self.named_dofs, self.mass_scale * self.mass, self.stiffness_scale * self.stiffness, self.damping,
            self.mass_scale * self.inertia, self.total_mass,
        )  # fmt: skip

    @property
    def supports(self) -> tuple[Support, ...]:
        """What holds the body, direction by direction; none where it is free."""
        return ()

    def base_supports(self, motion: BaseDirection) -> tuple[Support, ...]:
        """Supports whose `base_motion` is that of another motion of the base; here it moves upwards alone."""
        return self.supports

    def place_problem(self, place: Place | Distributed, acts: bool) -> tuple[str, str, str] | None:
        """Key, message and remedy where there is no such place or shape on the body, or nothing can act there."""
        if isinstance(place, Distributed) and place.mode is not None and place.mode > self.size:
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
        """(N,) inertia and (N,) force of springs to the ground under a unit motion of the base: here upwards alone."""
        return self.inertia, self.ground

    def base_motion_of(self, place: Place, motion: BaseDirection) -> float:
        """Motion of a place in its direction, m or rad, when the base moves by one unit and nothing deforms."""
        return 1.0

    def recovered(self, number: int, motion: BaseDirection, order: int = 0) -> tuple[Floats, float]:
        """(N,) another quantity that the body gives, by its number, for a unit of each dof, and that of the base.

        ``order`` is that of the time derivative of the motion that it takes: 1 of velocity, 2 of acceleration.
        """
        raise ValueError(f"{self.name} gives no other quantities")  # which the scenario refuses

    def recovered_by(self, number: int, support: Support, order: int = 0) -> float:
        """The same for a unit motion of a support of the body."""
        raise ValueError(f"{self.name} gives no other quantities")

    @abstractmethod
    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """What can be recovered along the body, with stations at the sites on it; ``member`` is the body itself."""

    def given_field(self, numbers: Sequence[float]) -> GivenField:
        """A field that a scenario gives by numbers, as the kind of body reads them."""
        raise ValueError(f"{self.name} takes no field to start from")  # which the scenario refuses
