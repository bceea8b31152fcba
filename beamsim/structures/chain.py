"""Assembly of a chain of lumped masses between walls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.structures.full import FullModel
from beamsim.structures.places import pair_of
from beamsim.typing import Floats

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamsim.scenario import Chain


def _stretch(count: int, links: int) -> Floats:
    """(links, count) elongation of each link: wall to 1, 1 to 2, ..., count to wall when links = count + 1."""
    matrix = np.zeros((links, count))
    for i in range(links):
        if i < count:
            matrix[i, i] = 1.0
        if i > 0:
            matrix[i, i - 1] = -1.0
    return matrix


def floating_groups(
    count: int, springs: Sequence[float], grounded: Sequence[int], links: Sequence[tuple[int, int]] = ()
) -> list[list[int]]:
    """Groups of masses (0-based) joined by springs that neither a wall nor the ground holds.

    ``springs`` are those of the row; ``links`` are pairs of masses that further springs join.
    """
    label = list(range(count))

    def join(a: int, b: int) -> None:
        old, new = label[b], label[a]
        label[:] = [new if x == old else x for x in label]

    for a, b in [(i - 1, i) for i in range(1, count) if springs[i] > 0] + list(links):
        join(a, b)
    held = {label[i] for i in grounded}
    held |= {label[0]} if springs[0] > 0 else set()
    held |= {label[-1]} if len(springs) > count and springs[count] > 0 else set()
    groups: dict[int, list[int]] = {}
    for i, x in enumerate(label):
        if x not in held:
            groups.setdefault(x, []).append(i)
    return list(groups.values())


def linear_stiffness(spring: Any) -> float:
    """The part of a spring that belongs to the linear model, N/m."""
    if spring.kind == "linear":
        return float(spring.stiffness)
    return float(spring.slope_at_rest) if spring.kind == "piecewise_linear" else 0.0


def assemble_chain(chain: Chain) -> FullModel:
    """Matrices of a chain: dashpots and springs between neighbours and walls, and the linear part of all other springs.

    The walls move with the base; the ground does not, so under base motion a spring to ground pulls
    with -k d(t) on the relative coordinates (field ``ground``). What is not linear in a spring has no place in this
    model; see `beamsim.contacts.springs`.
    """
    from scipy.sparse import csc_array, csr_array

    masses = np.array(chain.masses, dtype=float)
    springs = np.array(chain.springs, dtype=float)
    count = masses.size
    ground = np.zeros(count)
    for spring in chain.springs_to_ground:
        ground[spring.mass - 1] += linear_stiffness(spring)
    between = [(pair_of(s), linear_stiffness(s)) for s in chain.springs_between]
    links = [(pair[0] - 1, pair[1] - 1, k) for pair, k in between if pair is not None and k > 0]

    mass_scale = float(np.mean(masses))
    stiffness_scale = float(max(springs.max(initial=0.0), ground.max(), *(k for _, _, k in links), 0.0))
    if stiffness_scale == 0.0:
        stiffness_scale = 1.0
    stretch = _stretch(count, springs.size)
    linked = np.zeros((len(links), count))
    for row, (a, b, k) in zip(linked, links, strict=True):
        row[[a, b]] = -np.sqrt(k), np.sqrt(k)
    rows = np.vstack([stretch * np.sqrt(springs)[:, None], np.diag(np.sqrt(ground)), linked])
    rows = rows[np.any(rows != 0, axis=1)] / np.sqrt(stiffness_scale)

    dashpots = np.array(chain.dashpots, dtype=float)
    damping: Any = None
    if dashpots.any():
        beside = _stretch(count, dashpots.size)
        damping = csc_array(beside.T @ (dashpots[:, None] * beside))

    groups = floating_groups(
        count, [float(k) for k in springs], [int(i) for i in np.flatnonzero(ground)], [(a, b) for a, b, _ in links]
    )
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
