"""Mode shapes as they were measured."""

from __future__ import annotations

from dataclasses import dataclass

from beamsim.scenario.body import AtPlace
from beamsim.typing import Complexes, Floats


@dataclass(frozen=True)
class ShapesAtPlaces:
    """Natural frequencies, and the motion of some places in each mode, in any unit."""

    places: tuple[AtPlace, ...]  # p of them
    frequency_hz: Floats  # (m,)
    shapes: Complexes  # (p, m)
    source: str = ""  # file
    labels: tuple[str, ...] = ()  # where each place is written, for messages
