"""Common part of all excitations: where they act, and the quantity of their levels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal

from beamsim.scenario.base import Schema, Variants, fail
from beamsim.scenario.place import BaseOrPlace, choose_base_or_place
from beamsim.scenario.quantities import LevelValue

Quantity = Literal["acceleration", "velocity", "displacement", "force"]


AppliedTo = Annotated[
    BaseOrPlace,
    Variants(
        choose_base_or_place,
        "names neither the base nor a point",
        "write base, {position: 270 mm} for a force on the beam, or {mass: 2} for a force on a chain",
    ),
]


def agree_on_quantity(
    levels: Sequence[tuple[tuple[str | int, ...], float]], given: str | None, on_base: bool
) -> Quantity:
    """Return the quantity of the levels: as given, otherwise from their units, otherwise the default of the place.

    Raises what `fail` builds when units, quantity and place contradict each other.
    """
    quantity = given
    for path, level in levels:
        meant = level.quantity if isinstance(level, LevelValue) else None
        if meant is None:
            continue
        if quantity is not None and meant != quantity:
            article = "an" if quantity[0] == "a" else "a"
            raise fail(
                f"is given in a unit of {meant}, where {article} {quantity} is meant",
                "give the level in another unit, or set quantity",
                path,
            )
        quantity = meant
    quantity = quantity or ("acceleration" if on_base else "force")
    at = ("quantity",) if given is not None else levels[0][0]
    if on_base and quantity == "force":
        raise fail(
            "is a force, but the base moves and takes no force",
            "give an acceleration (2 g), velocity (0.2 m/s) or displacement (0.1 mm), "
            "or apply the force to {position: ...} or {mass: ...}",
            at,
        )
    if not on_base and quantity != "force":
        raise fail(
            f"is {'an' if quantity[0] == 'a' else 'a'} {quantity}, but a point takes a force",
            "give a force (1.5 N), or apply it to base",
            at,
        )
    return quantity  # type: ignore[return-value]


class Driven(Schema):
    """Common part of all excitations."""

    applied_to: AppliedTo
    """Base, or a place: {position: 270 mm} of a beam, {mass: 2} of a chain, with the body where there are several."""
    quantity: Quantity | None = None
    """Acceleration, velocity or displacement of the base, or force at a point; by default as the unit of the level."""

    shock: ClassVar[bool] = False
    """Whether it begins at a time and leaves a free motion: the beginning counts, and there are no statistics."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the levels with their paths."""
        raise NotImplementedError

    def plain_levels(self) -> None:
        """Forget the units of the levels once `quantity` holds what they said."""
        self.resolve("level", float(self.levels()[0][1]))

    def settle(self) -> None:
        """Settle what the level is."""
        self.resolve("quantity", agree_on_quantity(self.levels(), self.quantity, self.on_base))
        self.plain_levels()

    @property
    def on_base(self) -> bool:
        """Whether the base moves (otherwise a force acts at a point)."""
        return self.applied_to == "base"

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of the tones, Hz."""
        return ()

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the excitation, Hz; a pulse of duration T counts as 1/(2 T)."""
        return max(self.frequencies_hz, default=0.0)
