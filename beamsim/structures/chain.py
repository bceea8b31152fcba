"""A chain of lumped masses between walls, and what it answers as a structure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.places import DEFLECTION, Place, Site
from beamsim.structures.stations import MASSES, Recovery
from beamsim.structures.structure import BodyStructure, MemberBody
from beamsim.structures.supports import Support, spring_support
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Chain
    from beamsim.structures.basis import ReducedBasis


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


@dataclass(frozen=True)
class MassField:
    """Displacements or velocities of the masses."""

    structure: ChainStructure
    numbers: Floats  # (N,)

    def products(self, vectors: Floats) -> Floats:
        """(n,) products with fields (N, n) in the scaled mass matrix."""
        return np.asarray(vectors.T @ (self.structure.mass @ self.numbers))

    def error(self, vectors: Floats, q: Floats, quantity: str) -> float:
        """Relative error of ``vectors @ q`` in the kinetic norm."""
        mass, missed = self.structure.mass, self.numbers - vectors @ q
        norm = float(self.numbers @ (mass @ self.numbers))
        return float(np.sqrt(float(missed @ (mass @ missed)) / norm)) if norm > 0 else 0.0


@dataclass(frozen=True)
class ChainStructure(BodyStructure):
    """Masses in a row; places are their numbers from 1."""

    section: Chain

    def frequency_count(self, omega: float) -> int:
        """All of them."""
        return self.size

    def place_row(self, place: Place) -> Floats:
        """(N,) displacement of a mass for a unit of each degree of freedom."""
        if place.direction != DEFLECTION:
            raise ValueError(f"the masses of a chain have no motion {place.direction}")
        return np.asarray(np.eye(self.size)[round(place.coordinate) - 1])

    def unit_stiffness(self, site: Site) -> float:
        """The stiffest spring of the row, N/m."""
        return max(self.section.springs)

    def reassembled(self, section: Chain) -> ChainStructure:
        """The chain with other numbers."""
        return assemble_chain(section, self.name)

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """The displacements of all masses."""
        shapes = member.field(basis.vectors) * (1 / np.sqrt(member.whole.mass_scale))
        return Recovery(self.name, MASSES, np.arange(1.0, self.size + 1), shapes)

    @property
    def supports(self) -> tuple[Support, ...]:
        """The walls, and the ground at springs to it."""
        chain, unit = self.section, np.eye(self.size)
        walls = []
        for name, link, mass in (("left", 0, 0), ("right", self.size, -1)):
            spring, dashpot = (
                numbers[link] if link < len(numbers) else 0.0 for numbers in (chain.springs, chain.dashpots)
            )
            if spring or dashpot:
                walls.append(spring_support(name, DEFLECTION, unit[mass], spring, dashpot, self.name))
        springs = [
            spring_support(s.name, DEFLECTION, unit[s.mass - 1], linear_stiffness(s), 0.0, self.name, to_ground=True)
            for s in chain.springs_to_ground
            if linear_stiffness(s)
        ]
        return (*walls, *springs)

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute displacement of a mass."""
        return float(np.abs(field).max())

    def given_field(self, numbers: Sequence[float]) -> MassField:
        """One number a mass."""
        return MassField(self, np.asarray(numbers, dtype=float))


def assemble_chain(chain: Chain, name: str = "chain", nodes: Sequence[float] = ()) -> ChainStructure:
    """Matrices of a chain: dashpots and springs between neighbours and walls, and the linear part of all other springs.

    The walls move with the base; the ground does not, so under base motion a spring to ground pulls
    with -k d(t) on the relative coordinates (field ``ground``). What is not linear in a spring has no place in this
    model; see `beamsim.contacts.springs`. ``nodes``, where something joins the chain, are masses anyhow.
    """
    from scipy.sparse import csc_array, csr_array

    masses = np.array(chain.masses, dtype=float)
    springs = np.array(chain.springs, dtype=float)
    count = masses.size
    ground = np.zeros(count)
    for spring in chain.springs_to_ground:
        ground[spring.mass - 1] += linear_stiffness(spring)
    between = [(sorted(s.masses), linear_stiffness(s)) for s in chain.springs_between]
    links = [(pair[0] - 1, pair[1] - 1, k) for pair, k in between if k > 0]

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

    return ChainStructure(
        name=name,
        mass=csc_array(np.diag(masses / mass_scale)),
        factor=csr_array(rows.reshape(-1, count)),
        damping=damping,
        inertia=masses / mass_scale,
        ground=-ground,
        rigid=rigid,
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        deflection_dofs=np.arange(count),
        section=chain,
    )
