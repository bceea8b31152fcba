"""What the checks between sections may ask of the scenario that they stand in."""

from __future__ import annotations

from typing import Any, Protocol

from beamsim.scenario.base import Path
from beamsim.scenario.body import Body, Located
from beamsim.scenario.excitation import Excitation
from beamsim.scenario.place import Probe


class ScenarioParts(Protocol):
    """A scenario, seen from one of its sections."""

    @property
    def excitation(self) -> Excitation:
        """What drives the structure."""

    @property
    def all_bodies(self) -> dict[str, Body]:
        """The bodies by name."""

    @property
    def default_body(self) -> str:
        """The body that a place without one means; empty where there are several."""

    def body_path(self, name: str) -> Path:
        """Where a body is written."""

    @property
    def located_snubbers(self) -> tuple[Located, ...]:
        """The snubbers with their paths and bodies."""

    @property
    def all_snubbers(self) -> tuple[Any, ...]:
        """The snubbers."""

    @property
    def nonlinear_springs(self) -> tuple[Located, ...]:
        """The nonlinear springs of all bodies, with their paths."""

    @property
    def requested_outputs(self) -> tuple[tuple[Path, Any], ...]:
        """The outputs with their paths."""

    @property
    def effective_probes(self) -> tuple[Probe, ...]:
        """The probes, those by default included."""
