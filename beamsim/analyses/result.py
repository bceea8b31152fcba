"""Base class of the results of all analyses."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, ClassVar

from beamsim.fields import Entry, attribute, declared_base, ending, stored
from beamsim.outcomes import Outcome

if TYPE_CHECKING:
    from beamsim.scenario import Scenario


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _versions() -> dict[str, str]:
    """Versions of Python and of the packages that the numbers depend on."""
    from importlib.metadata import version

    packages = {name: version(name) for name in ("numpy", "scipy", "numba")}
    return {"python": platform.python_version(), **packages}


@declared_base
class Result:
    """Base of the results of all commands: scenario, outcome, summary, warnings and provenance."""

    SUMMARY: ClassVar[tuple[Entry, ...]] = ()  # possible entries of the summary, in the order of the printed table

    scenario: Scenario  # resolved
    outcome: Outcome = ending("how the computation ended: complete, or why it stopped early and what to try")
    summary: dict[str, Any]  # plain Python values
    warnings: tuple[str, ...] = attribute("", "warnings, JSON list", codec="json", default=())
    wall_time_s: float = attribute("s", "wall time", default=0.0)
    created: str = attribute("", "when the result was made, ISO 8601, UTC", default_factory=_now)
    provenance: dict[str, str] = attribute(
        "", "versions of Python and of the packages that the numbers depend on, JSON object", codec="json",
        default_factory=_versions,
    )  # fmt: skip

    @property
    def status(self) -> str:
        """How the computation ended, as text: "complete", or why it stopped early and what to try."""
        return self.outcome.text

    @property
    def complete(self) -> bool:
        """Whether everything requested was computed and is reliable."""
        return self.outcome.complete

    @property
    @stored(attribute("", "title of the scenario"))
    def title(self) -> str:
        """The scenario's title."""
        return self.scenario.title
