"""From a scenario to its structure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import path_text, walk
from beamsim.scenario.distributed import DistributedLoad
from beamsim.scenario.joint import body_origins
from beamsim.structures.distributed import Distributed
from beamsim.structures.joined import join
from beamsim.structures.joints import couplings_of
from beamsim.structures.places import LoadSite, Place, Site, ends_of, load_site_of, site_of
from beamsim.structures.several import assemble_side_by_side

if TYPE_CHECKING:
    from beamsim.scenario import Located, Scenario
    from beamsim.structures.file_summary import FileSummary
    from beamsim.structures.structure import BodyStructure, Coupling, Structure


def _assembler(kind: str) -> Callable[[Any, str, Sequence[Any]], BodyStructure]:
    """What makes a structure of a body of this kind; its third argument is where something joins the body.

    A scenario imports those of its own bodies: a plate has twenty modules that a beam does not need.
    """
    match kind:
        case "beam":
            from beamsim.structures.beam import assemble_beam

            return assemble_beam
        case "chain":
            from beamsim.structures.chain import assemble_chain

            return assemble_chain
        case "plate":
            from beamsim.structures.plate import assemble_plate

            return assemble_plate
        case "matrices":
            from beamsim.structures.matrices import assemble_matrices

            return assemble_matrices
        case _:
            raise AssertionError(f"no structure is made of a body of kind {kind}")


def assemble(scenario: Scenario, names: Sequence[str] | None = None, nodes: Sequence[Place] = ()) -> Structure:
    """The structure without snubbers: bodies that are coupled make one part of it.

    With ``names`` only the parts that hold one of these bodies; ``nodes`` are places where meshes have a node.
    """
    couplings = couplings_of(scenario)
    sections, origins = scenario.all_bodies, body_origins(scenario.joints, scenario.default_body)
    parts: list[Structure] = []
    for group in _groups(list(sections), couplings):
        if names is not None and not set(names) & set(group):
            continue
        within = [coupling for coupling in couplings if coupling.ends[0].body in group]
        bodies = [_body(scenario, name, within, nodes) for name in group]
        _check_places(scenario, bodies)
        parts.append(join(bodies, within, origins) if within else bodies[0])
    return parts[0] if len(parts) == 1 else assemble_side_by_side(parts)


def joined_to(scenario: Scenario, names: Sequence[str]) -> list[str]:
    """These bodies and those that they are joined to, in the order of the scenario."""
    groups = _groups(list(scenario.all_bodies), couplings_of(scenario))
    return [name for name in scenario.all_bodies if any(name in group and set(names) & set(group) for group in groups)]


def _body(scenario: Scenario, name: str, couplings: Sequence[Coupling], nodes: Sequence[Place] = ()) -> BodyStructure:
    section = scenario.all_bodies[name]
    return _assembler(section.body_kind)(
        _with_places_of_files(scenario, name),
        name,
        [end.point for end in [*(end for coupling in couplings for end in coupling.ends), *nodes] if end.body == name],
    )


def summaries_of_files(scenario: Scenario) -> tuple[FileSummary, ...]:
    """What the files of imported bodies hold; nothing is assembled.

    Raises
    ------
    ScenarioError
        If a file cannot be read or used.
    """
    from beamsim.structures.matrices import summarise_files

    return tuple(
        summarise_files(_with_places_of_files(scenario, name), name)
        for name, body in scenario.all_bodies.items()
        if body.is_read_from_files
    )


def _with_places_of_files(scenario: Scenario, name: str) -> Any:
    return scenario.all_bodies[name].in_folder(partial(scenario.folder_of, *scenario.body_path(name)))


def bodies_of(scenario: Scenario) -> list[BodyStructure]:
    """The bodies, each by itself, in the order of the scenario."""
    couplings = couplings_of(scenario)
    return [_body(scenario, name, couplings) for name in scenario.all_bodies]


def acting_places(scenario: Scenario) -> list[Place]:
    """Places where something acts, is joined or is recorded, each once."""
    places: dict[Place, None] = {}
    for _, item in walk(scenario):
        if getattr(item, "places", ()):
            places |= dict.fromkeys(ends_of(site_of(item, scenario.default_body)))
    return list(places)


def _check_places(scenario: Scenario, bodies: Sequence[BodyStructure]) -> None:
    """Refuse places and modes that the bodies do not have; the numbers of nodes and modes are known only now."""
    known = {body.name: body for body in bodies}
    problems = []
    for path, item in walk(scenario):
        in_structure = isinstance(item, DistributedLoad) or getattr(item, "node", None) is not None
        site = load_site_of(item, scenario.default_body) if in_structure else None
        if not isinstance(site, Place | Distributed) or site.body not in known:
            continue
        acts = path[0] != "probes" and "outputs" not in path[:2]
        problem = known[site.body].place_problem(site, acts)
        if problem is not None:
            problems.append(Problem(path_text((*path, problem[0])), *problem[1:]))
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
    return site_of(item, scenario.default_body)


def load_site_in(scenario: Scenario, item: Any) -> LoadSite:
    """Where a load of a scenario acts that stands at its top level."""
    return load_site_of(item, scenario.default_body)


def snubber_site(contact: Located) -> Site:
    """Where a snubber or spring of a scenario sits."""
    return site_of(contact.item, contact.body)
