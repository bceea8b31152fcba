r"""A frame in space as matrices with named degrees of freedom; it is then treated as imported matrices are.

Each node has six degrees of freedom. What is fixed at a support moves with the base: a clamped node belongs to the
base as a whole; the fixed directions of another support, and the far ends of its springs, belong to an additional node
at the same place. Nodes in a rigid group follow the first of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.sparse import block_diag, coo_array, csc_array, csr_array, eye_array, hstack, vstack

from beamsim.dofs import DIRECTIONS, Dof
from beamsim.errors import MethodError, ScenarioError
from beamsim.scenario.frame import FrameBody, SectionForce, support_of
from beamsim.structures.frame_elements import MemberElements, rigid_transfer
from beamsim.structures.matrices import MatricesStructure, structure_of
from beamsim.structures.named_matrices import DofTable, NamedMatrices
from beamsim.structures.places import NODES, BaseDirection, LoadedRegion, Place, Recovery
from beamsim.structures.structure import MemberBody, ReducedBasis
from beamsim.typing import Floats, Ints

_UNUSED = 1e-14  # relative to the largest entry; smaller rows have neither stiffness nor mass


@dataclass(frozen=True)
class FrameMesh:
    """Nodes and elements of a frame, before supports and rigid groups."""

    section: FrameBody
    points: Floats  # (nodes, 3) m; the nodes of the section first
    members: tuple[MemberElements, ...]
    nodes: tuple[Ints, ...]  # for each member (n + 1,) its nodes in order, from 0

    @classmethod
    def of(cls, section: FrameBody) -> FrameMesh:
        """The mesh of a section: equal elements, with further nodes at point masses."""
        points = [np.array(list(section.nodes.values()))]
        number, count = {name: k for k, name in enumerate(section.nodes)}, len(section.nodes)
        members, nodes = [], []
        for name, member in section.members.items():
            elements = _elements_of(section, name)
            inner = elements.bounds[1:-1]
            between = count + np.arange(inner.size)
            points.append(elements.points(inner))
            count += inner.size
            nodes.append(np.array([number[member.nodes[0]], *between, number[member.nodes[1]]]))
            members.append(elements)
        return cls(section, np.vstack(points), tuple(members), tuple(nodes))

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return 6 * len(self.points)

    def dofs_of(self, member: int, element: int) -> Ints:
        """(12,) degrees of freedom of an element."""
        pair = self.nodes[member][element : element + 2]
        return np.asarray((6 * pair[:, None] + np.arange(6)).ravel())

    def matrix(self, of_elements: Sequence[Floats]) -> Any:
        """(N, N) sparse sum of the matrices (n, 12, 12) of the elements of each member."""
        rows, columns, values = [], [], []
        for nodes, matrices in zip(self.nodes, of_elements, strict=True):
            dofs = (6 * np.stack([nodes[:-1], nodes[1:]], axis=1)[:, :, None] + np.arange(6)).reshape(-1, 12)
            rows.append(np.repeat(dofs, 12, axis=1).ravel())
            columns.append(np.tile(dofs, (1, 12)).ravel())
            values.append(matrices.ravel())
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return coo_array(entries, shape=(self.size, self.size)).tocsc()

    def rows_at(self, member: int, s: float) -> Any:
        """(6, N) sparse displacements and rotations at a distance along a member, m, for a unit of each dof."""
        elements = self.members[member]
        return self._spread(member, s, elements.shapes(np.array([s]))[0])

    def force_rows(self, member: int, s: float) -> Any:
        """(6, N) sparse local forces and moments at a distance along a member, m, for a unit of each dof."""
        return self._spread(member, s, self.members[member].forces(np.array([s]))[0])

    def _spread(self, member: int, s: float, rows: Floats) -> Any:
        element = int(self.members[member].locate(np.array([s]))[0])
        dofs = self.dofs_of(member, element)
        at = (np.repeat(np.arange(6), 12), np.tile(dofs, 6))
        return coo_array((rows.ravel(), at), shape=(6, self.size)).tocsr()

    def member_motion(self, member: int, s: Floats) -> list[Any]:
        """(k, N) sparse x, then y and z of points at distances (k,) along a member, m, for a unit of each dof."""
        elements = self.members[member]
        nodes = self.nodes[member][elements.locate(s)[:, None] + np.arange(2)]
        at = np.repeat(np.arange(s.size), 12), (6 * nodes[:, :, None] + np.arange(6)).ravel()
        shapes = elements.shapes(s)
        return [coo_array((shapes[:, i].ravel(), at), shape=(s.size, self.size)).tocsr() for i in range(3)]

    def node_motion(self, count: int) -> list[Any]:
        """(count, N) sparse x, then y and z of the first nodes for a unit of each dof."""
        number = np.arange(count)
        ones = np.ones(count)
        return [coo_array((ones, (number, 6 * number + i)), shape=(count, self.size)).tocsr() for i in range(3)]

    def node_rows(self, node: int) -> Any:
        """(6, N) sparse rows of a node."""
        at = (np.arange(6), 6 * node + np.arange(6))
        return coo_array((np.ones(6), at), shape=(6, self.size)).tocsr()

    def point_masses(self) -> Any:
        """(N, N) sparse mass matrix of the point masses."""
        total = csc_array((self.size, self.size))
        for mass, point in zip(self.section.point_masses, self.section.mass_points, strict=True):
            rows = (
                self.rows_at(int(point[0]) - 1, point[1])
                if isinstance(point, tuple)
                else self.node_rows(int(point) - 1)
            )
            at_centre = csr_array(rigid_transfer(np.array(mass.offset))) @ rows
            values = np.diag([*(mass.mass,) * 3, *mass.rotary_inertia])
            total = total + at_centre.T @ csr_array(values) @ at_centre
        return total.tocsc()

    @property
    def rigid_groups(self) -> tuple[Any, Ints]:
        """Motion of all degrees of freedom, (N, n) sparse, for a unit of each that follows no other; and these (n,)."""
        names, follow = list(self.section.nodes), eye_array(self.size, format="lil")
        followers = []
        for first, *others in self.section.link_groups:
            lead = names.index(first)
            for other in map(names.index, others):
                part = slice(6 * other, 6 * other + 6)
                follow[part, part] = 0.0
                follow[part, 6 * lead : 6 * lead + 6] = rigid_transfer(self.points[other] - self.points[lead])
                followers.append(6 * other + np.arange(6))
        kept = np.setdiff1d(np.arange(self.size), np.concatenate([np.zeros(0, dtype=np.int64), *followers]))
        return csr_array(follow.tocsc()[:, kept]), kept


def _elements_of(section: FrameBody, name: str) -> MemberElements:
    """The elements of a member."""
    member = section.members[name]
    curve, of = member.curve(section.nodes), section.section_of(member)
    count = member.elements or section.elements
    if curve.centre is not None:
        count = max(count, int(np.ceil(curve.angle / (np.pi / 2) - 1e-9)))  # an element turns by at most 90 degrees
    masses = [
        section.distance_along(name, m.position)
        for m in section.point_masses
        if m.member == name and m.position is not None
    ]
    bounds = np.linspace(0.0, curve.length, count + 1)
    for s in masses:
        if np.min(np.abs(bounds - s)) > 1e-6 * curve.length:
            bounds = np.sort(np.append(bounds, s))
    factor = member.flexibility_factor
    if factor is None:
        factor = 1.0 if curve.centre is None else of.bend_flexibility(curve.length / curve.angle)
    offsets, releases = member.offsets, member.releases
    return MemberElements(
        name, curve, of, member.orientation, factor, of.mass_per_length + member.added_mass_per_length, bounds,
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) if offsets is None else (offsets.start, offsets.end),
        ((), ()) if releases is None else (releases.start, releases.end),
    )  # fmt: skip


@dataclass(frozen=True)
class NamedFrame:
    """Matrices of a frame with names, and the map from its rows to all degrees of freedom of the mesh."""

    mesh: FrameMesh
    matrices: NamedMatrices
    motion: Any  # (N of the mesh, rows) sparse: all degrees of freedom for a unit of each row
    supports: Mapping[int, str]  # name of the support by the number of its node in the matrices


def named_frame(section: FrameBody) -> NamedFrame:
    """The matrices of a frame; the base is its clamped nodes, and a node for each other support.

    Raises
    ------
    MethodError
        About ``members``: something can move without force.
    """
    mesh = FrameMesh.of(section)
    stiffness = mesh.matrix([member.stiffness for member in mesh.members])
    mass = mesh.matrix([member.mass for member in mesh.members]) + mesh.point_masses()
    follow, kept = mesh.rigid_groups
    stiffness, mass = ((follow.T @ matrix @ follow).tocsc() for matrix in (stiffness, mass))
    dofs: list[Dof] = [(int(k) // 6 + 1, DIRECTIONS[k % 6]) for k in kept]
    springs: list[SupportSpring] = []
    supports: dict[int, str] = {}
    for name, support in ((name, support_of(each)) for name, each in section.supports.items()):
        node = list(section.nodes).index(name)
        clamped = len(set(support.fixed)) == len(DIRECTIONS)
        number = node + 1 if clamped else len(mesh.points) + len(supports) + 1
        supports[number] = name
        for direction in () if clamped else support.fixed:
            dofs[dofs.index((node + 1, direction))] = (number, direction)
        rows = (mesh.node_rows(node) @ follow).tocsr()
        for each, (elastic, viscous) in support.springs.items():
            row = rows[[DIRECTIONS.index(each)]].toarray()[0]
            springs.append(SupportSpring(row, (number, each), mesh.points[node], elastic, viscous))
    points = np.array([mesh.points[k // 6] for k in kept] + [each.point for each in springs])
    damping = None
    if springs:
        stiffness, mass, damping = _with_springs(stiffness, mass, springs)
    table = DofTable((*dofs, *(each.dof for each in springs)), points)
    motion = csr_array((follow.data, follow.indices, follow.indptr), shape=(mesh.size, len(table.dofs)))
    used = _rows_in_use(stiffness, mass)
    stiffness, mass, damping = (
        None if matrix is None else matrix[used][:, used].tocsc() for matrix in (stiffness, mass, damping)
    )
    named = NamedMatrices(table.part(used), mass, stiffness, damping, tuple(supports))
    return NamedFrame(mesh, named, csr_array(motion[:, used]), supports)


def _rows_in_use(stiffness: Any, mass: Any) -> Ints:
    """Rows with stiffness or mass; a node whose members are all released there keeps none in some directions."""
    held, heavy = (np.asarray(abs(matrix).max(axis=1).toarray()).ravel() for matrix in (stiffness, mass))
    return np.flatnonzero((held > _UNUSED * held.max(initial=0.0)) | (heavy > _UNUSED * heavy.max(initial=0.0)))


class SupportSpring(NamedTuple):
    """A spring and dashpot between a node and the base, in one direction."""

    row: Floats  # (N,) motion of the node for a unit of each degree of freedom
    dof: Dof  # its far end, which moves with the base
    point: Floats  # (3,) m
    stiffness: float  # N/m or N m/rad
    dashpot: float  # N s/m or N m s/rad


def _with_springs(stiffness: Any, mass: Any, springs: Sequence[SupportSpring]) -> tuple[Any, Any, Any]:
    """The matrices with a further row for the far end of each spring, and their damping or None."""
    count = len(springs)
    extension = hstack([csr_array(np.array([each.row for each in springs])), -eye_array(count)], format="csr")
    nothing = csc_array((count, count))
    elastic, viscous = (
        (extension.T @ (extension * np.array(of)[:, None])).tocsc()
        for of in ([each.stiffness for each in springs], [each.dashpot for each in springs])
    )
    stiffness, mass = (block_diag([matrix, nothing], format="csc") for matrix in (stiffness, mass))
    return (stiffness + elastic).tocsc(), mass, viscous if any(each.dashpot for each in springs) else None


@dataclass(frozen=True)
class DrawnPoints:
    """The named nodes of a frame, then points along its members, with the lines between them and their motion."""

    points: Floats  # (k, 3) m
    lines: Ints  # (m, 2) points that are joined
    motion: tuple[Any, Any, Any]  # (k, rows) sparse x, y and z of the points for a unit of each row of the body


@dataclass(frozen=True)
class FrameStructure(MatricesStructure):
    """A frame; places are nodes with a direction and points of members."""

    frame: NamedFrame = field(kw_only=True)
    has_base_nodes: ClassVar[bool] = True

    @property
    def mesh(self) -> FrameMesh:
        """Nodes and elements."""
        return self.frame.mesh

    def unsupported_row(self, place: Place | LoadedRegion) -> Floats:
        """(rows,) row of a place, along an axis of the frame, or a local axis of a member."""
        assert isinstance(place, Place)  # the scenario refuses the others
        number, direction = round(place.coordinate) - 1, place.direction
        rows = self.mesh.node_rows(number) if place.along is None else self.mesh.rows_at(number, place.along)
        six = (rows @ self.frame.motion).toarray()
        index = DIRECTIONS.index(direction.removeprefix("local_"))
        if not direction.startswith("local_"):
            return np.asarray(six[index])
        assert place.along is not None
        axes = self.mesh.members[number].axes(np.array([place.along]))[0]
        return np.asarray(axes[index % 3] @ six[3 * (index // 3) : 3 * (index // 3) + 3])

    def place_problem(self, place: Place | LoadedRegion, for_force: bool) -> tuple[str, str, str] | None:
        """Key, message and remedy if the place does not move, or nothing can act there; else None."""
        assert isinstance(place, Place)  # the scenario refuses other places
        key = "node" if place.along is None else "member"
        if place.along is None and place.direction.startswith("local_"):
            remedy = f"use {place.direction.removeprefix('local_')}, or name a member and a position"
            return "direction", f"= {place.direction} belongs to a member", remedy
        row = self.unsupported_row(place)[self._rows[1]]
        row = np.where(np.abs(row) > 1e-9 * max(float(np.abs(row).max()), 1e-9), row, 0.0)
        if not row.any():
            return (
                key,
                f"is at {place.label}, which moves with the base alone",
                "choose a place or direction that moves",
            )
        if for_force and self.massless[row != 0.0].max() > 1e-6:
            return (
                key, f"is at {place.label}, which has no mass: a force there would move it without inertia",
                "give the section a density, or act at a node with a point mass",
            )  # fmt: skip
        return None

    def support_name(self, node: int) -> str:
        """Name of the node of the section with this support."""
        return self.frame.supports[node]

    def point_of(self, place: Place) -> Floats:
        """(3,) coordinates of a place, m."""
        number = round(place.coordinate) - 1
        if place.along is None:
            return np.asarray(self.mesh.points[number])
        return np.asarray(self.mesh.members[number].points(np.array([place.along]))[0])

    def largest_at(self, field: Floats) -> str:
        """Node and direction of the largest displacement of a field (N,)."""
        node, direction = self._largest_row(field)
        return f"{self._node_name(node - 1)} {direction}"

    def _node_name(self, node: int) -> str:
        """Name of a node, or member and distance of a node inside a member."""
        if node < len(self.mesh.section.nodes):
            return f"node {list(self.mesh.section.nodes)[node]}"
        for elements, nodes in zip(self.mesh.members, self.mesh.nodes, strict=True):
            for s, each in zip(elements.bounds, nodes, strict=True):
                if each == node:
                    return f"{elements.name} {s:.4g} m"
        return f"support {self.frame.supports[node + 1]}"

    def reassemble(self, section: FrameBody) -> FrameStructure:
        """A frame with other numbers and the same numbers of elements."""
        return assemble_frame(section, self.name)

    def recovery_row(self, number: int, order: int = 0) -> Floats:
        """(rows,) a force, moment or stress in a member, by its number in the section."""
        asked = list(self.mesh.section.recovered.values())[number]
        return np.asarray(self._section_row(asked))

    def _section_row(self, asked: SectionForce) -> Floats:
        """(rows,) a force, moment or stress for a unit of each row."""
        member = list(self.mesh.section.members).index(asked.member)
        s = self.mesh.section.distance_along(asked.member, asked.position)
        forces = (self.mesh.force_rows(member, s) @ self.frame.motion).toarray()
        names = ("axial_force", "shear_y", "shear_z", "torque", "moment_y", "moment_z")
        if asked.quantity != "stress":
            return np.asarray(forces[names.index(asked.quantity)])
        of = self.mesh.members[member].section.spatial
        y, z = (0.0, of.fibre_z) if asked.point is None else asked.point
        return np.asarray(forces[0] / of.area + forces[4] * z / of.second_moment_y - forces[5] * y / of.second_moment_z)

    @cached_property
    def drawn_points(self) -> DrawnPoints:
        """Points that show the shape of the members between their nodes, with rigid arms and links."""
        mesh, names = self.mesh, list(self.mesh.section.nodes)
        intervals = [_intervals(elements.count, len(mesh.members)) for elements in mesh.members]
        points, motion, lines = [mesh.points[: len(names)]], [mesh.node_motion(len(names))], []
        last = len(names)
        for k, (elements, per_element) in enumerate(zip(mesh.members, intervals, strict=True)):
            share = np.arange(per_element * elements.count + 1) / per_element
            s = np.interp(share, np.arange(elements.count + 1), elements.bounds)
            s = s[0 if any(elements.arms[0]) else 1 : None if any(elements.arms[1]) else -1]
            points.append(elements.points(s))
            motion.append(mesh.member_motion(k, s))
            chain = np.array([mesh.nodes[k][0], *(last + np.arange(s.size)), mesh.nodes[k][-1]])
            lines.append(np.stack([chain[:-1], chain[1:]], axis=1))
            last += s.size
        for first, *others in mesh.section.link_groups:
            lines.append(np.array([(names.index(first), names.index(other)) for other in others]))
        x, y, z = (vstack([part[i] for part in motion], format="csr") @ self.frame.motion for i in range(3))
        return DrawnPoints(np.vstack(points), np.vstack(lines), (x, y, z))

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """Displacements in the direction of the base, and in space, of the points that are drawn.

        Parameters
        ----------
        member, basis, sites, base : see `BodyStructure.recovery`.

        Returns
        -------
        Recovery
            At named nodes, then along the members.
        """
        drawn, direction = self.drawn_points, self.source_matrices.direction
        vectors = self.all_dofs_map @ (member.expansion @ basis.vectors) / np.sqrt(member.structure.mass_scale)
        shapes = np.stack([rows @ vectors for rows in drawn.motion], axis=1)
        return Recovery(
            self.name, NODES, np.arange(1, len(drawn.points) + 1, dtype=float), shapes[:, DIRECTIONS.index(direction)],
            points=drawn.points, lines=drawn.lines, direction=direction, in_space=shapes,
        )  # fmt: skip


SMOOTH, MANY_MEMBERS = 8, 200
"""Intervals of a member that draw its shape smoothly, and number of members beyond which only elements are drawn."""


def _intervals(elements: int, members: int) -> int:
    """Number of intervals of each element of a member that is drawn."""
    return 1 if members > MANY_MEMBERS else -(-SMOOTH // elements)


def assemble_frame(section: FrameBody, name: str = "", nodes: Sequence[Any] = ()) -> FrameStructure:
    """Assemble the matrices of a frame and treat them as imported matrices.

    Parameters
    ----------
    section : section of the body.
    name : name of the body.
    nodes : not used: places on members need no node.

    Returns
    -------
    FrameStructure

    Raises
    ------
    ScenarioError
        At the invalid key of the body.
    """
    try:
        frame = named_frame(section)
        general = structure_of(frame.matrices, section.damping, name)
    except MethodError as error:
        about, message, remedy = error.about, error.message, error.remedy
        if about in ("stiffness", "mass"):  # of the matrices
            about, message = "members", f"form a mechanism, or have no mass: the {about} {message}"
            remedy = "release fewer directions, add supports, or give the sections a density"
        raise ScenarioError.at(f"bodies.{name}.{about}", message, remedy) from None
    given = {each.name: getattr(general, each.name) for each in fields(general) if each.init}
    return FrameStructure(**{**given, "section": section}, frame=frame)
