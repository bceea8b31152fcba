"""From a scenario to its structure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from beamsim.structures.beam import assemble_beam
from beamsim.structures.chain import assemble_chain
from beamsim.structures.places import Site, site_of
from beamsim.structures.several import assemble_bodies

if TYPE_CHECKING:
    from beamsim.scenario import Located, Scenario
    from beamsim.structures.structure import Structure

ASSEMBLE: dict[str, Callable[[Any, str], Structure]] = {"beam": assemble_beam, "chain": assemble_chain}
"""A line a kind of body."""


def assemble(scenario: Scenario, names: Sequence[str] | None = None) -> Structure:
    """The structure without snubbers; of several bodies only those with these names, where given."""
    sections = scenario.all_bodies
    chosen = list(sections) if names is None else names
    bodies = [ASSEMBLE[sections[name].body_kind](sections[name], name) for name in chosen]
    return bodies[0] if len(bodies) == 1 else assemble_bodies(bodies)


def site_in(scenario: Scenario, item: Any) -> Site:
    """Where something of a scenario sits that stands at its top level: a probe, a force, the excitation."""
    return site_of(item, scenario.default_body)


def snubber_site(contact: Located) -> Site:
    """Where a snubber or spring of a scenario sits."""
    return site_of(contact.item, contact.body)
