"""A reduced basis for a point that moves along a body.

All positions must share one set of coordinates, so the basis cannot depend on the position. Residual vectors for the
ends of the range alone would leave the compliance in between wrong. Vectors are therefore added where the compliance
is least accurate, until it is accurate at all positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beamsim.structures.basis import ReducedBasis
from beamsim.structures.places import Place
from beamsim.structures.reduction import static_deflections
from beamsim.structures.structure import Structure
from beamsim.typing import Floats

ACCURATE = 3e-5  # of the compliance; the default reduction has an error of this size


def compliance_defect(structure: Structure, basis: ReducedBasis, places: Sequence[Place]) -> Floats:
    """(p,) fraction of the static compliance at each place that the reduced model does not represent.

    Parameters
    ----------
    structure, basis : full model and its reduced coordinates.
    places : p of its places.

    Returns
    -------
    (p,) array
        0 where the reduced model is as soft as the full one.
    """
    rows = structure.rows(places)
    full = np.sum(rows.T * static_deflections(structure, rows.T), axis=0)
    moving = basis.omega > 0
    reduced = np.sum((rows @ basis.vectors[:, moving] / basis.omega[moving]) ** 2, axis=1)
    return np.asarray(np.where(full > 0, (full - reduced) / np.where(full > 0, full, 1.0), 0.0))


def places_needed(
    structure: Structure, basis: ReducedBasis, first: Place, last: Place, known: Sequence[Place]
) -> list[Place]:
    """Where to add a static vector next; empty if the compliance is accurate from the first place to the last.

    Parameters
    ----------
    structure, basis : full model and its reduced coordinates.
    first, last : ends of the range.
    known : places that have a static vector.

    Returns
    -------
    list
        One place or none.
    """
    places = [replace(first, point=float(x)) for x in np.linspace(first.coordinate, last.coordinate, 41)]
    defect = compliance_defect(structure, basis, places)
    worst = int(np.argmax(defect))
    return [] if defect[worst] <= ACCURATE or places[worst] in known else [places[worst]]
