r"""Assembles the structure of a scenario: separate bodies, or bodies connected by joints and springs.

A rigid joint is a linear constraint :math:`G u = 0` on the degrees of freedom u of all bodies. It is eliminated:
:math:`u = T v` with a sparse orthonormal basis T of the null space of G, so that the matrices of the joined structure
are :math:`T^T M T` and :math:`T^T K T`, without penalty or multipliers. Springs and dashpots of joints add their rows
to K and C. All coordinates are relative to the base, so a place that is joined to the base moves with it exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pkgutil import resolve_name
from typing import Any

import numpy as np
from scipy.linalg import block_diag as dense_block_diag
from scipy.sparse import block_diag, coo_array, csc_array, csr_array, eye_array, vstack

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, path_text, walk
from beamsim.scenario.body import LocatedItem, PointOfBody
from beamsim.scenario.connections import HingeElement, place_bodies
from beamsim.scenario.distributed import DistributedLoad
from beamsim.scenario.parameters import replace_values
from beamsim.structures.modes import allowed_rigid_motions, orthonormal_in_mass
from beamsim.structures.places import (
    SLOPE,
    BaseDirection,
    Link,
    LoadedRegion,
    LoadSite,
    Place,
    Recovery,
    Site,
    ends_of,
    load_site_of,
    site_of,
)
from beamsim.structures.structure import BodyStructure, Coupling, MemberBody, ReducedBasis, Structure, Substructure
from beamsim.structures.symmetric_lu import blocks_of
from beamsim.typing import Floats


def assemble(scenario: Scenario, names: Sequence[str] | None = None, nodes: Sequence[Place] = ()) -> Structure:
    """Assemble the structure without snubbers; coupled bodies form one substructure.

    With ``names`` only the parts that hold one of these bodies; ``nodes`` are places where meshes have a node.

    Parameters
    ----------
    scenario : a valid scenario.
    names : include only substructures with one of these bodies; all by default.
    nodes : places at which meshes must have a node.

    Returns
    -------
    Structure
        A single structure, or several uncoupled substructures.
    """
    couplings = couplings_of(scenario) if scenario.joined_by else []
    sections = scenario.all_bodies
    joints = scenario.joints
    origins = place_bodies(joints, sections, scenario.default_body).of_first_group if joints else {}
    # places that only the bodies themselves can check: of imported matrices, and loads with the shape of a mode
    placed_by_bodies = [
        (path, item)
        for path, item in walk(scenario)
        if isinstance(item, DistributedLoad)
        or (isinstance(item, PointOfBody) and (item.node or item.row or item.member))
    ]
    parts: list[Structure] = []
    for group in _groups(list(sections), couplings):
        if names is not None and not set(names) & set(group):
            continue
        within = [coupling for coupling in couplings if coupling.ends[0].body in group]
        bodies = [_body(scenario, name, within, nodes) for name in group]
        if placed_by_bodies:
            _check_places(scenario, placed_by_bodies, bodies)
        parts.append(join(bodies, within, origins) if within else bodies[0])
    return combine_structures(parts)


def couplings_of(scenario: Scenario) -> list[Coupling]:
    """Joints, for each direction, and the linear part of springs that are not listed in a body."""
    couplings = [
        coupling for joint in scenario.joints for coupling in _of_joint(scenario, joint, site_in(scenario, joint))
    ]
    for spring in (*scenario.springs_to_ground, *scenario.springs_between):
        site = site_in(scenario, spring)
        if spring.linear_stiffness:
            couplings.append(Coupling(spring.name, site, spring.linear_stiffness, to_ground=isinstance(site, Place)))
    return couplings


def _of_joint(scenario: Scenario, joint: Any, site: Site) -> list[Coupling]:
    held = joint.kind in ("rigid", "hinge")
    couplings = [Coupling(joint.name, site, None if held else joint.stiffness, 0.0 if held else joint.dashpot)]
    if all(scenario.all_bodies[end.body].has_slope for end in ends_of(site)):
        rigid = joint.kind == "rigid"
        rotation = (None, 0.0) if rigid else (joint.linear_rotation, joint.rotational_dashpot)
        couplings.append(Coupling(joint.name, _slope_of(site), *rotation))
    return couplings


def _slope_of(site: Site) -> Site:
    """The same places, in the direction of the slope."""
    if isinstance(site, Link):
        return Link(replace(site.first, direction=SLOPE), replace(site.second, direction=SLOPE))
    assert isinstance(site, Place)
    return replace(site, direction=SLOPE)


def joined_to(scenario: Scenario, names: Sequence[str]) -> list[str]:
    """These bodies and all that are joined to them, in the order of the scenario."""
    groups = _groups(list(scenario.all_bodies), couplings_of(scenario))
    return [name for name in scenario.all_bodies if any(name in group and set(names) & set(group) for group in groups)]


def _body(scenario: Scenario, name: str, couplings: Sequence[Coupling], nodes: Sequence[Place] = ()) -> BodyStructure:
    """Assemble a body by ``assemble_<kind>`` in the module with the name of its kind, which is imported when needed."""
    kind = scenario.all_bodies[name].body_kind
    assemble_body = resolve_name(f"beamsim.structures.{kind}:assemble_{kind}")
    ends = [*(end for coupling in couplings for end in coupling.ends), *nodes]
    points = [end.point for end in ends if end.body == name]  # points where something is joined to the body
    section = scenario.all_bodies[name]
    body: BodyStructure = assemble_body(
        with_places_of_files(scenario, name) if section.is_read_from_files else section, name, points
    )
    return body


def with_places_of_files(scenario: Scenario, name: str) -> Any:
    """The section of a body that is read from files, with the paths of the files resolved."""
    body = scenario.all_bodies[name]
    return replace_values(body, scenario.whole_paths(body, scenario.body_path(name)))


def bodies_of(scenario: Scenario) -> list[BodyStructure]:
    """The individual bodies, in the order of the scenario."""
    if not scenario.all_bodies:
        raise no_structure()
    couplings = couplings_of(scenario)
    return [_body(scenario, name, couplings) for name in scenario.all_bodies]


def no_structure() -> ScenarioError:
    """Error of what needs a structure, where the scenario compares test data and has none."""
    return ScenarioError.at("before_after", "compares test data, without a structure", "use beamsim compare")


def acting_places(scenario: Scenario) -> list[Place]:
    """Places of all items that act, join or record."""
    places: dict[Place, None] = {}
    for _, item in walk(scenario):
        if getattr(item, "places", ()):
            places |= dict.fromkeys(ends_of(site_in(scenario, item)))
    return list(places)


def _check_places(scenario: Scenario, items: Sequence[tuple[Path, Any]], bodies: Sequence[BodyStructure]) -> None:
    """Refuse places and modes that do not exist; the numbers of nodes and modes are known only now."""
    known = {body.name: body for body in bodies}
    problems = []
    for path, item in items:
        site = load_site_in(scenario, item)
        if not isinstance(site, Place | LoadedRegion) or site.body not in known:
            continue
        for_force = path[0] != "probes" and "outputs" not in path[:2]
        problem = known[site.body].place_problem(site, for_force)
        if problem is not None:
            problems.append(Problem(path_text((*path, *problem[0].split("."))), *problem[1:]))
    if problems:
        raise ScenarioError(problems)


def _groups(names: Sequence[str], couplings: Sequence[Coupling]) -> list[list[str]]:
    """Groups of bodies that are coupled directly or through others, in the order of the scenario."""
    group = {name: name for name in names}
    for coupling in couplings:
        first, last = (group[end.body] for end in (coupling.ends[0], coupling.ends[-1]))
        group = {name: first if of == last else of for name, of in group.items()}
    return [[name for name in names if group[name] == label] for label in dict.fromkeys(group.values())]


def site_in(scenario: Scenario, item: Any) -> Site:
    """Place of an item at the top level of a scenario: a probe, a linear spring."""
    return site_of(item, scenario.default_body, scenario.all_bodies)


def load_site_in(scenario: Scenario, item: Any) -> LoadSite:
    """Place of a load at the top level of a scenario."""
    return load_site_of(item, scenario.default_body, scenario.all_bodies)


def snubber_site(contact: LocatedItem) -> Site:
    """Place of a snubber, spring or friction contact; for those of a hinge the rotations of its two sides."""
    site = site_of(contact.item, contact.body, contact.sections)
    return _slope_of(site) if isinstance(contact.item, HingeElement) else site


@dataclass(frozen=True)
class SeveralBodies(Structure):
    """Several bodies, joined or separate."""

    expansions: tuple[tuple[BodyStructure, Any], ...]  # bodies, and (N of the body, N) expansions from these dofs

    @cached_property
    def members(self) -> tuple[MemberBody, ...]:
        """The bodies."""
        return tuple(
            MemberBody(
                body, self, expansion, body.mass_scale / self.mass_scale, body.stiffness_scale / self.stiffness_scale
            )
            for body, expansion in self.expansions
        )

    @cached_property
    def most_modes(self) -> int | None:
        """Number of modes up to the frequency that the discretisation of every body resolves; None for all."""
        bodies = [member.body for member in self.members]
        if all(body.most_modes is None for body in bodies):
            return None
        highest = min(_highest_of(body) for body in bodies if body.most_modes is not None)
        if np.isinf(highest):
            return None
        counts = [min(body.frequency_count(highest / body.frequency_scale), body.size) for body in bodies]
        return max(sum(counts), 1)

    def deflections(self, vectors: Floats) -> Floats:
        """(d,) or (d, k) deflections of all bodies, in the order of the stations."""
        return np.concatenate([member.body.deflections(member.expansion @ vectors) for member in self.members])

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega; joints only raise frequencies."""
        physical = omega * self.frequency_scale
        return sum(m.body.frequency_count(physical / m.body.frequency_scale) for m in self.members)

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) inertia and (N,) force of springs to the ground, for a unit motion of the base."""
        inertia, ground = np.zeros(self.size), np.zeros(self.size)
        for member in self.members:
            of_body = member.body.base_load(self.base_direction_of(member.body.name, motion))
            inertia += (of_body[0] @ member.expansion) * member.mass_ratio
            ground += of_body[1] @ member.expansion
        for spring in self.couplings:
            if spring.to_ground and spring.stiffness:
                ground -= spring.stiffness * self.base_motion_at(spring.ends[0], motion) * self.row(spring.site)
        return inertia, ground

    def unit_stiffness(self, site: Site) -> float:
        """The reference stiffness of the body; for a link that of the softer body."""
        return min(self.member(end.body).body.unit_stiffness(end) for end in ends_of(site))

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,)."""
        return max(member.body.largest_deflection(member.expansion @ field) for member in self.members)

    def recoveries(
        self, basis: ReducedBasis, sites: Sequence[LoadSite], base: BaseDirection | None
    ) -> tuple[Recovery, ...]:
        """Recovered quantities of all bodies.

        Parameters
        ----------
        basis, sites, base : see `Structure.recoveries`.

        Returns
        -------
        tuple
            One item for each body.
        """
        if not self.substructures:
            return super().recoveries(basis, sites, base)
        recovered: list[Recovery] = []
        for part, (reduced, columns) in zip(self.substructures, basis.blocks, strict=True):
            names, own = {member.body.name for member in part.structure.members}, np.eye(basis.size)[columns]
            on_it = [end for site in sites for end in ends_of(site) if end.body in names]
            for recovery in part.structure.recoveries(reduced, on_it, base):
                moment, in_space = recovery.bending_moment, recovery.in_space
                recovered.append(
                    replace(
                        recovery,
                        deflection=recovery.deflection @ own,
                        in_space=None if in_space is None else in_space @ own,
                        bending_moment=None if moment is None else moment @ own,
                    )
                )
        return tuple(recovered)


def _highest_of(body: BodyStructure) -> float:
    """Angular frequency, rad/s, up to which the discretisation of a body resolves its modes; inf for all."""
    assert body.most_modes is not None
    from scipy.optimize import bisect

    most, high = body.most_modes, 1.0
    while (count := body.frequency_count(high)) <= most:
        if count >= body.size:
            return np.inf
        high *= 2
    # the count is a bound: it may exceed the number of modes
    highest = bisect(
        lambda omega: (body.frequency_count(omega) if omega > 0.0 else 0) - most - 0.5, 0.0, high, xtol=1e-12 * high
    )
    return float(highest) * (1 - 1e-11) * body.frequency_scale


def combine_structures(structures: Sequence[Structure]) -> Structure:
    """Combine several structures into one; a single one is returned unchanged."""
    return structures[0] if len(structures) == 1 else _blocks_of(structures)


def _blocks_of(structures: Sequence[Structure]) -> SeveralBodies:
    """Block matrices of several structures, scaled by the heaviest and stiffest of them."""
    if not structures:
        raise no_structure()
    mass_scale = max(part.mass_scale for part in structures)
    stiffness_scale = max(part.stiffness_scale for part in structures)
    mass_ratio = [part.mass_scale / mass_scale for part in structures]
    starts = np.cumsum([0, *(part.size for part in structures)]).tolist()
    dofs = [slice(start, end) for start, end in pairwise(starts)]
    damping = None
    if any(part.damping is not None for part in structures):
        drags = [csc_array((part.size, part.size)) if part.damping is None else part.damping for part in structures]
        damping = block_diag(drags, format="csc")
    factors = [part.factor * np.sqrt(part.stiffness_scale / stiffness_scale) for part in structures]
    rigid = [part.rigid / np.sqrt(ratio) for part, ratio in zip(structures, mass_ratio, strict=True)]
    identity: Any = eye_array(starts[-1], format="csr")
    return SeveralBodies(
        name="",
        mass=block_diag([part.mass * ratio for part, ratio in zip(structures, mass_ratio, strict=True)], format="csc"),
        factor=block_diag(factors, format="csr"),
        damping=damping,
        rigid=dense_block_diag(*rigid),
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        expansions=tuple(
            (member.body, member.expansion @ identity[columns])
            for part, columns in zip(structures, dofs, strict=True)
            for member in part.members
        ),
        substructures=tuple(Substructure(part, columns) for part, columns in zip(structures, dofs, strict=True)),
        couplings=tuple(coupling for part in structures for coupling in part.couplings),
        origins=tuple(origin for part in structures for origin in part.origins),
    )


def join(
    bodies: Sequence[BodyStructure], couplings: Sequence[Coupling], origins: Mapping[str, float] | None = None
) -> SeveralBodies:
    """Join bodies by couplings; ``origins`` are their starts on the common axis, m.

    Parameters
    ----------
    bodies : the coupled bodies.
    couplings : joints and springs, one for each direction.
    origins : starts of the bodies on their common axis, m.

    Returns
    -------
    SeveralBodies
        On the remaining dofs after the constraints are eliminated.
    """
    apart = combine_structures(bodies)
    held = apart.rows([c.site for c in couplings if c.stiffness is None])
    basis = null_space_basis(held)
    springs = [c for c in couplings if c.stiffness]
    rows = apart.rows([c.site for c in springs])
    stiffness = np.array([c.stiffness for c in springs], dtype=float)
    dashpots = [c for c in couplings if c.dashpot]
    damping: Any = csr_array((apart.size, apart.size)) if apart.damping is None else apart.damping
    rates = csr_array(apart.rows([c.site for c in dashpots]))
    damping = damping + rates.T @ (rates * np.array([c.dashpot for c in dashpots])[:, None])
    scaled = csr_array(rows * np.sqrt(stiffness / apart.stiffness_scale)[:, None])
    mass = (basis.T @ (apart.mass @ basis)).tocsc()
    holding = np.vstack([held, rows])
    holding = holding[np.any(holding != 0, axis=1)]
    kept = allowed_rigid_motions(apart.rigid, holding @ apart.rigid, np.linalg.norm(holding, axis=1))
    return SeveralBodies(
        name="",
        mass=mass,
        factor=vstack([apart.factor, scaled], format="csr") @ basis,
        damping=(basis.T @ damping @ basis).tocsc() if apart.damping is not None or dashpots else None,
        rigid=orthonormal_in_mass(basis.T @ (apart.rigid @ kept), mass),
        mass_scale=apart.mass_scale,
        stiffness_scale=apart.stiffness_scale,
        expansions=tuple((member.body, member.expansion @ basis) for member in apart.members),
        couplings=tuple(couplings),
        origins=tuple((origins or {}).items()),
    )


REPEATED_CONSTRAINT = 1e-10  # relative to the largest singular value; smaller ones belong to redundant constraints


def null_space_basis(rows: Floats) -> Any:
    """(N, N - rank) sparse orthonormal basis of the null space of constraints (c, N).

    Groups of constraints without a common degree of freedom are treated separately, which keeps the basis sparse: a
    column outside all constraints is a unit vector.
    """
    size = rows.shape[1]
    pattern = csr_array(rows != 0, dtype=float)
    constrained = np.any(rows != 0, axis=0)
    free = np.flatnonzero(~constrained)
    i, j, values = [free], [np.arange(free.size)], [np.ones(free.size)]
    count = free.size
    for dofs in blocks_of(pattern.T @ pattern):
        if not constrained[dofs[0]]:
            continue
        constraints = rows[np.any(rows[:, dofs] != 0, axis=1)][:, dofs]
        _, s, vt = np.linalg.svd(constraints / np.linalg.norm(constraints, axis=1, keepdims=True))
        null = vt[int(np.sum(s > REPEATED_CONSTRAINT * s[0])) :].T
        i.append(np.repeat(dofs, null.shape[1]))
        j.append(np.tile(count + np.arange(null.shape[1]), dofs.size))
        values.append(null.ravel())
        count += null.shape[1]
    entries = (np.concatenate(values), (np.concatenate(i), np.concatenate(j)))
    return coo_array(entries, shape=(size, count)).tocsr()
