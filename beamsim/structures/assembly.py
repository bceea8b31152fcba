"""From a scenario to the full model of its structure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from beamsim.structures.beam import assemble_beam
from beamsim.structures.chain import assemble_chain

if TYPE_CHECKING:
    from beamsim.scenario import Scenario
    from beamsim.structures.full import FullModel


def assemble(scenario: Scenario) -> FullModel:
    """The full model of the structure without snubbers."""
    if scenario.beam is not None:
        return assemble_beam(scenario.beam)
    assert scenario.chain is not None
    return assemble_chain(scenario.chain)
