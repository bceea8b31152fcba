"""What every analysis hands back beside its own numbers."""

from __future__ import annotations

import platform
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

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


@dataclass(frozen=True, kw_only=True)
class Result:
    """Base of the results of all commands: where they come from, how they ended, what is printed of them."""

    scenario: Scenario  # resolved
    outcome: Outcome  # how the computation ended
    summary: dict[str, Any]  # plain Python values; names as fixed in RESULTS.md
    warnings: tuple[str, ...] = ()
    wall_time_s: float = 0.0
    created: str = field(default_factory=_now)  # ISO 8601, UTC
    provenance: dict[str, str] = field(default_factory=_versions)  # of Python and the packages

    @property
    def status(self) -> str:
        """How the computation ended, as text: "complete", or why it stopped early and what to try."""
        return self.outcome.text

    @property
    def complete(self) -> bool:
        """Whether everything asked for was computed and can be trusted."""
        return self.outcome.complete

    @property
    def title(self) -> str:
        """The scenario's title."""
        return self.scenario.title
