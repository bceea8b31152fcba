"""Assembly of a chain of lumped masses between walls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamsim.model.full import FullModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamsim.scenario import Chain

__all__ = ["assemble_chain", "floating_groups"]

Floats = NDArray[np.float64]


def _stretch(count: int, links: int) -> Floats:
    """(links, count) elongation of each link: wall to 1, 1 to 2, ..., count to wall when links = count + 1."""
    matrix = np.zeros((links, count))
    for i in range(links):
        if i < count:
            matrix[i, i] = 1.0
        if i > 0:
            matrix[i, i - 1] = -1.0
    return matrix


def floating_groups(count: int, springs: Sequence[float], grounded: Sequence[int]) -> list[list[int]]:
    """Groups of masses (0-based) joined by springs that neither a wall nor the ground holds."""
    groups: list[list[int]] = []
    held: list[bool] = []
    for i in range(count):
        if i == 0 or springs[i] == 0:
            groups.append([])
            held.append(i == 0 and springs[0] > 0)
        groups[-1].append(i)
        held[-1] = held[-1] or i in grounded or (i == count - 1 and len(springs) > count and springs[count] > 0)
    return [group for group, h in zip(groups, held, strict=True) if not h]


def assemble_chain(chain: Chain) -> FullModel:
    """Matrices of a chain: springs and dashpots between neighbours and walls, linear springs to ground in K.

    The walls move with the base; the ground does not, so under base motion a spring to ground pulls
    with -k d(t) on the relative coordinates (field ``ground``). Cubic springs to ground have no place
    in a linear model and are left to the caller.
    """
    from scipy.sparse import csc_array, csr_array

    masses = np.array(chain.masses, dtype=float)
    springs = np.array(chain.springs, dtype=float)
    count = masses.size
    ground = np.zeros(count)
    for spring in chain.springs_to_ground:
        if spring.kind == "linear":
            ground[spring.mass - 1] += spring.stiffness

    mass_scale = float(np.mean(masses))
    stiffness_scale = float(max(springs.max(initial=0.0), ground.max()))
    if stiffness_scale == 0.0:
        stiffness_scale = 1.0
    stretch = _stretch(count, springs.size)
    rows = np.vstack([stretch * np.sqrt(springs)[:, None], np.diag(np.sqrt(ground))])
    rows = rows[np.any(rows != 0, axis=1)] / np.sqrt(stiffness_scale)

    dashpots = np.array(chain.dashpots, dtype=float)
    damping: Any = None
    if dashpots.any():
        links = _stretch(count, dashpots.size)
        damping = csc_array(links.T @ (dashpots[:, None] * links))

    groups = floating_groups(count, [float(k) for k in springs], [int(i) for i in np.flatnonzero(ground)])
    rigid = np.zeros((count, len(groups)))
    for j, group in enumerate(groups):
        rigid[group, j] = 1.0 / np.sqrt(masses[group].sum() / mass_scale)

    return FullModel(
        mass=csc_array(np.diag(masses / mass_scale)),
        factor=csr_array(rows.reshape(-1, count)),
        damping=damping,
        inertia=masses / mass_scale,
        ground=-ground,
        rigid=rigid,
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        deflection=lambda number: np.eye(count)[round(number) - 1],
        frequency_count=lambda omega: count,
        deflection_dofs=np.arange(count),
        free=np.arange(count),
    )
