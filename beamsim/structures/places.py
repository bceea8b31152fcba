"""Where something sits on a structure, and the deflection it feels there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.full import FullModel


def pair_of(thing: Any) -> tuple[int, int] | None:
    """Numbers of the two masses that a snubber or spring acts between, the lower one first; None for one place."""
    masses = getattr(thing, "between", None) or getattr(thing, "masses", None)
    return None if masses is None else (min(masses), max(masses))


def place_of(thing: Any) -> float:
    """Position in m along a beam, or mass number in a chain; halfway for what acts between two masses."""
    pair = pair_of(thing)
    if pair is not None:
        return 0.5 * (pair[0] + pair[1])
    position = getattr(thing, "position", None)
    return float(thing.mass if position is None else position)


def row_of(model: FullModel, thing: Any) -> Floats:
    """(N,) deflection there for a unit of each degree of freedom; between two masses how far they draw apart.

    Displacements count from the wall at mass 1, so that the stretch of a link is that of its higher mass less that of
    the lower one, as in the chain's own springs.
    """
    pair = pair_of(thing)
    if pair is None:
        return model.deflection(place_of(thing))
    return np.asarray(model.deflection(float(pair[1])) - model.deflection(float(pair[0])))
