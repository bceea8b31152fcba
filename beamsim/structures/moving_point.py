"""A point that moves along a body: a reduced basis that serves everywhere on its way.

Residual vectors for the way's ends alone would leave the compliance in between wrong; a basis of its own at every
position would change what the coordinates mean. So vectors are added where the compliance is worst until it is right
everywhere: one set of coordinates for all positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.structures.places import Place
from beamsim.structures.reduction import static_deflections
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.structure import Structure

CHECKED = 41  # positions on the way at which the compliance is compared
ACCURATE = 3e-5  # of the compliance: what the default reduction leaves out of a motion is of this size


def compliance_defect(structure: Structure, basis: ReducedBasis, places: Sequence[Place]) -> Floats:
    """(p,) share of the static compliance at each place that the reduced model lacks."""
    rows = structure.rows(places)
    full = np.sum(rows.T * static_deflections(structure, rows.T), axis=0)
    moving = basis.omega > 0
    reduced = np.sum((rows @ basis.vectors[:, moving] / basis.omega[moving]) ** 2, axis=1)
    return np.asarray(np.where(full > 0, (full - reduced) / np.where(full > 0, full, 1.0), 0.0))


def places_needed(
    structure: Structure, basis: ReducedBasis, first: Place, last: Place, known: Sequence[Place]
) -> list[Place]:
    """Where to add a static vector next; none where the compliance is right from the first place to the last."""
    places = [replace(first, point=float(x)) for x in np.linspace(first.point, last.point, CHECKED)]
    defect = compliance_defect(structure, basis, places)
    worst = int(np.argmax(defect))
    return [] if defect[worst] <= ACCURATE or places[worst] in known else [places[worst]]
