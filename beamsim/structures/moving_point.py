"""A point that moves along the beam: its deflection and slope, and a reduced basis that serves everywhere on its way.

Residual vectors for the way's ends alone would leave the compliance in between wrong; a basis of its own at every
position would change what the coordinates mean. So vectors are added where the compliance is worst until it is right
everywhere: one set of coordinates for all positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.structures.hermite import shape_functions
from beamsim.structures.reduction import static_deflections
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.full import FullModel
    from beamsim.structures.reduction import ReducedBasis

CHECKED = 41  # positions on the way at which the compliance is compared
ACCURATE = 3e-5  # of the compliance: what the default reduction leaves out of a motion is of this size


def deflection_and_slope(model: FullModel, vectors: Floats, x: float) -> tuple[Floats, Floats]:
    """(k,) deflections of k fields (N, k) at x / L, and their slopes by x / L."""
    assert model.mesh is not None
    field = np.zeros((2 * model.mesh.nodes.size, vectors.shape[1]))
    field[model.free] = vectors
    element, xi = model.mesh.locate(x)
    local, h = field[model.mesh.dofs[element]], model.mesh.lengths[element]
    return shape_functions(xi, h) @ local, shape_functions(xi, h, 1) @ local


def compliance_defect(model: FullModel, basis: ReducedBasis, positions: Floats) -> Floats:
    """(p,) share of the static compliance at each position (m) that the reduced model lacks."""
    rows = model.rows(positions)
    full = np.sum(rows.T * static_deflections(model, rows.T), axis=0)
    moving = basis.omega > 0
    reduced = np.sum((rows @ basis.vectors[:, moving] / basis.omega[moving]) ** 2, axis=1)
    return np.asarray(np.where(full > 0, (full - reduced) / np.where(full > 0, full, 1.0), 0.0))


def places_needed(
    model: FullModel, basis: ReducedBasis, low: float, high: float, known: Sequence[float]
) -> list[float]:
    """Where to add a static vector next, m; none where the compliance is right from `low` to `high`."""
    positions = np.linspace(low, high, CHECKED)
    defect = compliance_defect(model, basis, positions)
    worst = int(np.argmax(defect))
    place = float(positions[worst])
    return [] if defect[worst] <= ACCURATE or place in known else [place]
