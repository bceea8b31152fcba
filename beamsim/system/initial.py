"""Where a motion starts, and whether anything holds the structure there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, pairwise

import numpy as np
from scipy.sparse.csgraph import csgraph_from_dense, shortest_path

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings, Equilibrium, find_equilibrium
from beamsim.contacts.snubbers import springs_of
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import Path, problem
from beamsim.scenario.run import BodiesStart, ModeStart, OrbitStart, PolynomialStart, ReleasedForceStart
from beamsim.structures.assembly import site_in
from beamsim.structures.places import SLOPE, LoadSite, ends_of
from beamsim.structures.structure import Coupling
from beamsim.system.parts import Parts, start_of
from beamsim.typing import Floats

# A motion below this fraction of the largest possible one is round-off.
_NOTHING = 1e-9


def held_problems(parts: Parts, acting: Sequence[tuple[Path, LoadSite, str]]) -> list[Problem]:
    """What acts (path, where, its name) where joints leave no motion."""
    if not parts.structure.couplings:
        return []
    return [
        problem(
            path,
            f"acts at {site.label}, where a joint leaves no motion: {what} has no effect there",
            "move it along the body, or change the joint",
        )
        for path, site, what in acting
        if np.abs(parts.structure.row(site)).max() <= _NOTHING
    ]


def open_loops(parts: Parts) -> Iterator[str]:
    """Warnings about joints that close a loop of bodies, whatever their angles, only across a distance.

    Two joints of a body may lie no further apart than the other bodies of any loop through them reach. Loops of beams
    alone are those of the scenario.
    """
    scenario = parts.scenario
    if len(scenario.joints) < 2:
        return

    members = {member.body.name: member.body for member in parts.structure.members}
    points: dict[str, dict[int, Floats]] = {}  # by body, of its joints
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
        # 1e-4: distances of joined points that differ by less, relative to the larger, are those of rounded
        # coordinates.
        if not span - reach[j] > 1e-4 * span:
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


def floating_motions(parts: Parts) -> str:
    """Bodies that move without strain energy, and where most."""
    field = parts.basis.vectors[:, : parts.basis.rigid]
    largest: dict[str, dict[str, None]] = {}
    for motion in field.T:
        for name in _bodies(parts, motion):
            member = parts.structure.member(name)
            largest.setdefault(name, {})[member.body.largest_at(member.field(motion))] = None
    return "; ".join(f"{name} moves freely, most at {' and '.join(places)}" for name, places in largest.items())


def check_mechanisms(parts: Parts, stopping: Floats) -> list[str]:
    """Warnings about motions that joints leave free and contacts stop.

    A motion of the bodies as rigid ones that turns or opens a joint is a mechanism. Floating as a whole is none.

    Parameters
    ----------
    stopping : (m, n) rows of contacts and nonlinear springs, the only things that can stop such a motion.

    Raises
    ------
    ScenarioError
        If nothing stops it; it names joint and bodies.
    """
    rigid, couplings = parts.basis.rigid, parts.structure.couplings
    if not rigid or not couplings:
        return []
    opening = np.array([_opening(parts, coupling) for coupling in couplings])[:, :rigid]
    size = np.linalg.norm(stopping, axis=1, keepdims=True)
    felt = (stopping / np.where(size > 0, size, 1.0))[:, :rigid]
    _, s, vt = np.linalg.svd(felt)
    unstopped = vt[int(np.sum(s > _NOTHING)) :].T
    problems = [
        problem(("joints", index), f"{what}, and nothing stops that motion", f"{remedy}, or let a snubber meet it")
        for index, what, remedy in _mechanisms(parts, opening, unstopped)
    ]
    if problems:
        raise ScenarioError(problems)
    return [
        f"joints[{index}] {what}: snubbers or nonlinear springs alone stop that motion"
        for index, what, _ in _mechanisms(parts, opening, np.eye(rigid))
    ]


def _mechanisms(parts: Parts, opening: Floats, motions: Floats) -> Iterator[tuple[int, str, str]]:
    """What joints leave free in rigid motions (rigid, k): number of the joint, the motion, and what would hold it."""
    couplings = parts.structure.couplings
    for index, coupling, bodies in _opened(parts, opening, motions):
        turns = coupling.ends[0].direction == SLOPE
        verb, stiffness = ("turn", "rotational_stiffness") if turns else ("move", "stiffness")
        remedy = f"give the joint a {stiffness}, hold {bodies} by a support or another joint"
        yield index, f"({coupling.name}) leaves {bodies} free to {verb} there", remedy
    names = [coupling.name for coupling in couplings]
    joints = {joint.name for joint in parts.scenario.joints}
    alone = [coupling for coupling in couplings if coupling.name in joints and names.count(coupling.name) == 1]
    for index, name, body, where in _turning(parts, alone, motions):
        what = f"({name}) leaves {body} free to turn or slide there, most at {where}"
        yield index, what, f"hold {body} by a support or further joints"


def _turning(parts: Parts, couplings: Sequence[Coupling], motions: Floats) -> Iterator[tuple[int, str, str, str]]:
    """Joints without slopes about which the rigid motions (rigid, k) turn a body while what it is joined to rests.

    Number and name of the joint, the body, and where it moves most.
    """
    indices = {joint.name: index for index, joint in enumerate(parts.scenario.joints)}
    fields = parts.basis.vectors[:, : motions.shape[0]] @ motions
    fields = fields / np.maximum(np.linalg.norm(fields, axis=0), np.finfo(float).tiny)
    for coupling in couplings:
        ends = coupling.ends
        for turning, resting in zip(ends, [*reversed(ends)] if len(ends) == 2 else [None], strict=True):
            body = parts.structure.member(turning.body)
            still = fields
            if resting is not None:
                _, s, vt = np.linalg.svd(parts.structure.member(resting.body).field(fields))
                still = fields @ vt[int(np.sum(s > _NOTHING)) :].T
            moved = body.field(still)
            if moved.size and np.abs(moved).max() > _NOTHING:
                k = int(np.argmax(np.abs(moved).max(axis=0)))
                yield indices[coupling.name], coupling.name, turning.body, body.body.largest_at(moved[:, k])


def _opening(parts: Parts, coupling: Coupling) -> Floats:
    """(n,) how far a joint opens, beside the motion of its ends, for a unit of each coordinate."""
    ends = parts.shapes(list(coupling.ends))
    return np.asarray(parts.shapes([coupling.site])[0] / max(float(np.abs(ends).max()), np.finfo(float).tiny))


def _opened(parts: Parts, opening: Floats, motions: Floats) -> Iterator[tuple[int, Coupling, str]]:
    """Number and coupling of every joint that the rigid motions (rigid, k) open, and the bodies that move."""
    names = [joint.name for joint in parts.scenario.joints]
    for coupling, row in zip(parts.structure.couplings, opening @ motions, strict=True):
        largest = float(np.linalg.norm(row))
        if coupling.stiffness == 0.0 and coupling.name in names and largest > _NOTHING:
            moving = parts.basis.vectors[:, : motions.shape[0]] @ (motions @ (row / largest))
            yield names.index(coupling.name), coupling, " and ".join(_bodies(parts, moving))


def _bodies(parts: Parts, field: Floats) -> list[str]:
    """Names of the bodies that a field (N,) moves."""
    reach = [member.body.largest_deflection(member.field(field)) for member in parts.structure.members]
    return [m.body.name for m, x in zip(parts.structure.members, reach, strict=True) if x > _NOTHING * max(reach)]


_FIELDS = ("displacement", "velocity")


def initial_state(
    parts: Parts, contacts: Contacts, loads: Floats, cubic: CubicSprings, equilibrium: Equilibrium
) -> tuple[Floats, list[str]]:
    """The state from which a motion starts.

    Parameters
    ----------
    parts : of the scenario.
    contacts, cubic : its contacts and cubic springs.
    loads : (L, n) constant loads.
    equilibrium : static equilibrium under these, or why there is none.

    Returns
    -------
    (2 n,) q then q' at t = 0, relative to the base; and warnings.

    Raises
    ------
    ScenarioError
        Where the start needs a static shape that does not exist, or a mode that the reduction does not keep.
    """
    n = parts.basis.size
    q, v = np.zeros(n), np.zeros(n)
    warnings: list[str] = []
    start = start_of(parts.scenario)
    if start is None:
        q = q if equilibrium.q is None else equilibrium.q
    elif start == "static_equilibrium":
        remedy = "start from rest, or hold the structure with a support, a preload or a load towards a snubber"
        q = _static_shape(parts, equilibrium, "run.start", "= static_equilibrium does not exist", remedy)
    elif isinstance(start, OrbitStart):
        raise ScenarioError(
            Problem("run.start.orbit", "starts a run, and no other command", "leave run.start out, or `beamsim run`")
        )
    elif isinstance(start, ReleasedForceStart):
        extra = (start.released_force.force * parts.shape(start.released_force))[None, :]
        held = find_equilibrium(
            parts.stiffness, parts.basis.rigid, springs_of(contacts), np.vstack([loads, extra]), cubic
        )
        remedy = "let it push towards a snubber, or support the structure"
        q = _static_shape(parts, held, "run.start.released_force", "holds no static shape", remedy)
    elif isinstance(start, ModeStart):
        q = _mode_shape(parts, start.mode, start.amplitude)
    elif isinstance(start, PolynomialStart):
        q, v = (_given_field(parts, {parts.scenario.default_body: start}, name, warnings) for name in _FIELDS)
    elif isinstance(start, BodiesStart):
        q, v = (_given_field(parts, start.bodies, name, warnings) for name in _FIELDS)
    return np.concatenate([q, v]), warnings


def _static_shape(parts: Parts, equilibrium: Equilibrium, path: str, problem: str, remedy: str) -> Floats:
    """(n,) coordinates of an equilibrium; ScenarioError says why there is none and, where something floats, what."""
    if equilibrium.q is None:
        floats = f" ({floating_motions(parts)})" if parts.basis.rigid else ""
        raise ScenarioError(Problem(path, f"{problem}: {equilibrium.reason}{floats}", remedy))
    return equilibrium.q


def _mode_shape(parts: Parts, mode: int, amplitude: float) -> Floats:
    """Open mode `mode` (numbered from 1, rigid-body modes included) with its largest deflection equal to amplitude."""
    if mode > parts.basis.modes:
        raise ScenarioError(
            Problem(
                "run.start.mode",
                f"= {mode} is not among the {parts.basis.modes} modes of the model",
                "choose a lower mode, or raise reduction.modes or beam.elements",
            )
        )
    largest = parts.structure.largest_deflection(parts.basis.vectors[:, mode - 1])
    q = np.zeros(parts.basis.size)
    q[mode - 1] = amplitude / largest * np.sqrt(parts.structure.mass_scale)
    return q


def _given_field(parts: Parts, given: Mapping[str, PolynomialStart], quantity: str, warnings: list[str]) -> Floats:
    """Coordinates of fields given body by body: a polynomial in x along a beam, one number a mass of a chain."""
    numbers = {name: getattr(start, quantity) for name, start in given.items()}
    field, errors = parts.structure.project(parts.basis, numbers, quantity)
    for name, error in errors.items():
        if error > 1e-6:
            where = f"bodies.{name}.{quantity}" if len(parts.structure.members) > 1 else quantity
            warnings.append(
                f"run.start.{where} is met by the reduced model to a relative error of {error:.2g} only: "
                "it breaks the supports' conditions or needs more modes (reduction: {modes: all})"
            )
    return field
