"""What every kind of body answers about itself, and what sits on bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from beamsim.scenario.base import Path, Schema


class Located(NamedTuple):
    """A snubber or spring, where it is written, and the body it means where it names none."""

    path: Path
    body: str
    item: Any


class Body(Schema):
    """One body of a scenario; a kind of body is a subclass."""

    body_kind: ClassVar[str] = ""
    """Which assembly is its own, see `beamsim.structures.assembly`."""

    if TYPE_CHECKING:
        damping: Any  # every kind of body has its own sort of it

    reduced_by_default: ClassVar[bool] = True
    """Whether it has modes that are left out unless they are asked for."""

    def on_the_body(self, position: float) -> float:
        """The position, moved to the end if it is beyond it by round-off only."""
        return position

    @property
    def own_snubbers(self) -> tuple[Any, ...]:
        """Snubbers listed in the body itself, under ``snubbers``."""
        return ()

    def nonlinear_springs(self) -> list[tuple[Path, Any]]:
        """Springs of the body that are not linear, with their paths below the body."""
        return []
