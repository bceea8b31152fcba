"""Mechanisms: motions that joints leave free, and places that joints make immobile."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise

import numpy as np
from scipy.sparse.csgraph import csgraph_from_dense, shortest_path

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, problem
from beamsim.structures.assembly import site_in
from beamsim.structures.places import SLOPE, LoadSite, ends_of
from beamsim.structures.structure import Coupling, ReducedBasis, Structure
from beamsim.typing import Floats

NEGLIGIBLE_MOTION = 1e-9  # relative to the largest possible motion; less is round-off
COORDINATE_ROUND_OFF = (
    1e-4  # distances of joined points that differ by less, relative to the larger, are those of these
)


def immobile_problems(structure: Structure, loaded_sites: Sequence[tuple[Path, LoadSite, str]]) -> list[Problem]:
    """Problems of items (path, place, name) that act at immobile places."""
    if not structure.couplings:
        return []
    return [
        problem(
            path,
            f"acts at {site.label}, where joints prevent all motion: {what} has no effect there",
            "move it along the body, or change the joint",
        )
        for path, site, what in loaded_sites
        if np.abs(structure.row(site)).max() <= NEGLIGIBLE_MOTION
    ]


def open_loops(scenario: Scenario, structure: Structure) -> Iterator[str]:
    """Warnings about joints that can close a loop of bodies only if they span a distance.

    The distance of two joints on a body cannot exceed the length of the rest of a loop through them. The scenario
    checks loops of beams only.
    """
    if len(scenario.joints) < 2:
        return
    members = {member.body.name: member.body for member in structure.members}
    points: dict[str, dict[int, Floats]] = {}  # points of the joints on each body
    for index, joint in enumerate(scenario.joints):
        for end in ends_of(site_in(scenario, joint)):
            point = members[end.body].point_of(end)
            if point is not None:
                points.setdefault(end.body, {})[index] = point
    count = len(scenario.joints)
    nearest, by = np.full((count, count), np.inf), np.full((count, count), "", dtype=object)
    spans = [
        (float(np.linalg.norm(at[i] - at[j])), name, i, j)
        for name, at in points.items()
        for i, j in combinations(sorted(at), 2)
    ]
    for span, name, i, j in spans:
        if span < nearest[i, j]:
            nearest[i, j] = nearest[j, i] = span
            by[i, j] = by[j, i] = name
    reported = set[frozenset[str]]()
    for span, name, i, j in sorted(spans, reverse=True):
        others = np.where(by == name, np.inf, nearest)
        links = csgraph_from_dense(others, null_value=np.inf)
        reach, before = shortest_path(links, indices=i, return_predecessors=True)
        if not span - reach[j] > COORDINATE_ROUND_OFF * span:
            continue
        path = [j]
        while path[-1] != i:
            path.append(int(before[path[-1]]))
        bodies = [by[a, b] for a, b in pairwise(path)]
        loop, ends = frozenset((name, *bodies)), [place for k in path for place in scenario.joints[k].places]
        if loop in reported or all(
            place.position is not None and not isinstance(place.position, tuple) for place in ends
        ):
            continue
        reported.add(loop)
        yield (
            f"joints[{i}] and joints[{j}] lie {1e3 * span:.4g} mm from each other on {name}, and "
            f"{' and '.join(bodies[::-1])} between them {'reach' if len(bodies) > 1 else 'reaches'} "
            f"{1e3 * reach[j]:.4g} mm: the loop stays open by "
            f"{1e3 * (span - reach[j]):.4g} mm; the joints act as if they fitted, check their positions"
        )


def floating_motions(structure: Structure, basis: ReducedBasis) -> str:
    """Bodies that move without strain energy, and the place of their largest motion."""
    field = basis.vectors[:, : basis.rigid_count]
    largest: dict[str, dict[str, None]] = {}
    for motion in field.T:
        for name in _bodies(structure, motion):
            member = structure.member(name)
            largest.setdefault(name, {})[member.body.largest_at(member.expansion @ motion)] = None
    return "; ".join(f"{name} moves freely, most at {' and '.join(places)}" for name, places in largest.items())


def check_mechanisms(
    joints: Sequence[str], structure: Structure, basis: ReducedBasis, stopping_rows: Floats
) -> list[str]:
    """Warnings about mechanisms that only contacts stop.

    A mechanism is a motion of rigid bodies that rotates or opens a joint. Floating as a whole is not a mechanism.

    Parameters
    ----------
    joints : names of the joints, in the order of the scenario.
    structure, basis : structure with the joints, and its reduced coordinates.
    stopping_rows : (m, n) rows of contacts and nonlinear springs, which can stop a mechanism.

    Returns
    -------
    One sentence for each mechanism.

    Raises
    ------
    ScenarioError
        If nothing stops a mechanism; the error names the joint and the bodies.
    """
    rigid = basis.rigid_count
    if not rigid or not structure.couplings:
        return []
    size = np.linalg.norm(stopping_rows, axis=1, keepdims=True)
    stopped = (stopping_rows / np.where(size > 0, size, 1.0))[:, :rigid]
    _, s, vt = np.linalg.svd(stopped)
    unstopped = vt[int(np.sum(s > NEGLIGIBLE_MOTION)) :].T
    problems = [
        problem(("joints", index), f"{what}, and nothing stops that motion", f"{remedy}, or let a snubber meet it")
        for index, what, remedy in _mechanisms(joints, structure, basis, unstopped)
    ]
    if problems:
        raise ScenarioError(problems)
    return [
        f"joints[{index}] {what}: snubbers or nonlinear springs alone stop that motion"
        for index, what, _ in _mechanisms(joints, structure, basis, np.eye(rigid))
    ]


def _mechanisms(
    joints: Sequence[str], structure: Structure, basis: ReducedBasis, motions: Floats
) -> Iterator[tuple[int, str, str]]:
    """Yield mechanisms in rigid motions (rigid, k): index of the joint, description, and what would prevent it."""
    fields = basis.vectors[:, : basis.rigid_count] @ motions
    for coupling in structure.couplings:
        row = _opening(structure, basis, coupling)[: basis.rigid_count] @ motions
        largest = float(np.linalg.norm(row))
        if coupling.stiffness == 0.0 and coupling.name in joints and largest > NEGLIGIBLE_MOTION:
            turns = coupling.ends[0].direction == SLOPE
            verb, stiffness = ("turn", "rotational_stiffness") if turns else ("move", "stiffness")
            bodies = " and ".join(_bodies(structure, fields @ (row / largest)))
            remedy = f"give the joint a {stiffness}, hold {bodies} by a support or another joint"
            yield joints.index(coupling.name), f"({coupling.name}) leaves {bodies} free to {verb} there", remedy
    names = [coupling.name for coupling in structure.couplings]
    alone = [each for each in structure.couplings if each.name in joints and names.count(each.name) == 1]
    for name, body, where in _turning(structure, alone, fields):
        what = f"({name}) leaves {body} free to turn or slide there, most at {where}"
        yield joints.index(name), what, f"hold {body} by a support or further joints"


def _turning(structure: Structure, couplings: Sequence[Coupling], motions: Floats) -> Iterator[tuple[str, str, str]]:
    """Yield joints without rotational coupling about which rigid motions (N, k) rotate a body.

    Each item is the name of the joint, the body, and the place of its largest motion.
    """
    fields = motions / np.maximum(np.linalg.norm(motions, axis=0), np.finfo(float).tiny)
    for coupling in couplings:
        ends = coupling.ends
        for turning, resting in zip(ends, [*reversed(ends)] if len(ends) == 2 else [None], strict=True):
            body = structure.member(turning.body)
            still = fields
            if resting is not None:
                _, s, vt = np.linalg.svd(structure.member(resting.body).expansion @ fields)
                still = fields @ vt[int(np.sum(s > NEGLIGIBLE_MOTION)) :].T
            moved = body.expansion @ still
            if moved.size and np.abs(moved).max() > NEGLIGIBLE_MOTION:
                k = int(np.argmax(np.abs(moved).max(axis=0)))
                yield coupling.name, turning.body, body.body.largest_at(moved[:, k])


def _opening(structure: Structure, basis: ReducedBasis, coupling: Coupling) -> Floats:
    """(n,) opening of a joint in addition to the motion of its ends, for a unit of each coordinate."""
    largest = float(np.abs(structure.rows(list(coupling.ends)) @ basis.vectors).max())
    return np.asarray(structure.row(coupling.site) @ basis.vectors / max(largest, np.finfo(float).tiny))


def _bodies(structure: Structure, field: Floats) -> list[str]:
    """Names of the bodies that a field (N,) moves."""
    reach = [member.body.largest_deflection(member.expansion @ field) for member in structure.members]
    return [m.body.name for m, x in zip(structure.members, reach, strict=True) if x > NEGLIGIBLE_MOTION * max(reach)]
