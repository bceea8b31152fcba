"""From a scenario to its structure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from beamsim.errors import Problem, ScenarioError
from beamsim.kinds import named
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text, walk
from beamsim.scenario.body import Located
from beamsim.scenario.connections import OfHinge, placed
from beamsim.scenario.distributed import DistributedLoad
from beamsim.scenario.parameters import replaced
from beamsim.structures.places import SLOPE, Distributed, Link, LoadSite, Place, Site, ends_of, load_site_of, site_of
from beamsim.structures.several import assemble_side_by_side, join
from beamsim.structures.structure import BodyStructure, Coupling, Structure


def assemble(scenario: Scenario, names: Sequence[str] | None = None, nodes: Sequence[Place] = ()) -> Structure:
    """The structure without snubbers: bodies that are coupled make one part of it.

    With ``names`` only the parts that hold one of these bodies; ``nodes`` are places where meshes have a node.

    Parameters
    ----------
    scenario : validated.
    names : only parts that hold one of these bodies; all without.
    nodes : places where meshes have a node.

    Returns
    -------
    Structure
        One part, or several side by side.
    """
    couplings = couplings_of(scenario)
    sections = scenario.all_bodies
    joints = scenario.joints
    origins = placed(joints, sections, scenario.default_body).of_first_group if joints else {}
    parts: list[Structure] = []
    for group in _groups(list(sections), couplings):
        if names is not None and not set(names) & set(group):
            continue
        within = [coupling for coupling in couplings if coupling.ends[0].body in group]
        bodies = [_body(scenario, name, within, nodes) for name in group]
        if any(_is_known_to_structure(item) for _, item in walk(scenario)):
            _check_places(scenario, bodies)
        parts.append(join(bodies, within, origins) if within else bodies[0])
    return parts[0] if len(parts) == 1 else assemble_side_by_side(parts)


def couplings_of(scenario: Scenario) -> list[Coupling]:
    """Joints, direction by direction, and the linear part of springs that are not listed in a body."""
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
    return replace(site, direction=SLOPE)


def joined_to(scenario: Scenario, names: Sequence[str]) -> list[str]:
    """These bodies and those that they are joined to, in the order of the scenario."""
    groups = _groups(list(scenario.all_bodies), couplings_of(scenario))
    return [name for name in scenario.all_bodies if any(name in group and set(names) & set(group) for group in groups)]


def _body(scenario: Scenario, name: str, couplings: Sequence[Coupling], nodes: Sequence[Place] = ()) -> BodyStructure:
    """By ``assemble_<kind>`` of the module that is called as its kind; only those needed are imported."""
    kind = scenario.all_bodies[name].body_kind
    assemble_body = named(f"beamsim.structures.{kind}:assemble_{kind}")
    ends = [*(end for coupling in couplings for end in coupling.ends), *nodes]
    points = [end.point for end in ends if end.body == name]  # where something joins the body
    body: BodyStructure = assemble_body(with_places_of_files(scenario, name), name, points)
    return body


def with_places_of_files(scenario: Scenario, name: str) -> Any:
    """The section of a body, whose files are where the scenario has them."""
    body, where = scenario.all_bodies[name], scenario.body_path(name)
    return replaced(body, scenario.whole_paths(body, where)) if body.is_read_from_files else body


def bodies_of(scenario: Scenario) -> list[BodyStructure]:
    """The bodies, each by itself, in the order of the scenario."""
    couplings = couplings_of(scenario)
    return [_body(scenario, name, couplings) for name in scenario.all_bodies]


def acting_places(scenario: Scenario) -> list[Place]:
    """Places where something acts, is joined or is recorded, each once."""
    places: dict[Place, None] = {}
    for _, item in walk(scenario):
        if getattr(item, "places", ()):
            places |= dict.fromkeys(ends_of(site_in(scenario, item)))
    return list(places)


def _is_known_to_structure(item: Any) -> bool:
    """Whether the structure alone knows if it has a place: a node of imported matrices, or a load shaped as a mode."""
    return isinstance(item, DistributedLoad) or getattr(item, "node", None) is not None


def _check_places(scenario: Scenario, bodies: Sequence[BodyStructure]) -> None:
    """Refuse places and modes that the bodies do not have; the numbers of nodes and modes are known only now."""
    known = {body.name: body for body in bodies}
    problems = []
    for path, item in walk(scenario):
        site = load_site_in(scenario, item) if _is_known_to_structure(item) else None
        if not isinstance(site, Place | Distributed) or site.body not in known:
            continue
        acts = path[0] != "probes" and "outputs" not in path[:2]
        problem = known[site.body].place_problem(site, acts)
        if problem is not None:
            problems.append(Problem(path_text((*path, *problem[0].split("."))), *problem[1:]))
    if problems:
        raise ScenarioError(problems)


def _groups(names: Sequence[str], couplings: Sequence[Coupling]) -> list[list[str]]:
    """The bodies that are coupled to one another, directly or by others, in the order of the scenario."""
    group = {name: name for name in names}
    for coupling in couplings:
        first, last = (group[end.body] for end in (coupling.ends[0], coupling.ends[-1]))
        group = {name: first if of == last else of for name, of in group.items()}
    return [[name for name in names if group[name] == label] for label in dict.fromkeys(group.values())]


def site_in(scenario: Scenario, item: Any) -> Site:
    """Where something of a scenario sits that stands at its top level: a probe, a linear spring."""
    return site_of(item, scenario.default_body, scenario.all_bodies)


def load_site_in(scenario: Scenario, item: Any) -> LoadSite:
    """Where a load of a scenario acts that stands at its top level."""
    return load_site_of(item, scenario.default_body, scenario.all_bodies)


def snubber_site(contact: Located) -> Site:
    """Where a snubber, spring or friction contact of a scenario sits; between rotations where it belongs to a hinge."""
    site = site_of(contact.item, contact.body, contact.sections)
    return _slope_of(site) if isinstance(contact.item, OfHinge) else site
