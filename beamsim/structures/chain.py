"""A chain of lumped masses between walls, as a structure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array

from beamsim.scenario.chain import Chain
from beamsim.structures.places import DEFLECTION, MASSES, BaseDirection, LoadedRegion, Place, Recovery, Site
from beamsim.structures.structure import (
    BodyField,
    BodyStructure,
    Coupling,
    MemberBody,
    ReducedBasis,
    Restraint,
    WeightedValues,
)
from beamsim.structures.symmetric_lu import blocks_of
from beamsim.typing import Floats, Ints


def _extension_rows(count: int, ends: Sequence[tuple[int, int]]) -> Floats:
    """(links, count) extension of links for a unit displacement of each mass (from 0); an index outside is a wall."""
    masses = np.arange(count)
    return np.array([1.0 * (masses == b) - (masses == a) for a, b in ends]).reshape(-1, count)


def floating_groups(rows: Floats) -> list[Ints]:
    """Groups of masses (from 0) that springs connect to each other but not to a wall or the ground.

    ``rows`` (springs, masses) is the extension of each spring for a unit displacement of each mass.
    """
    joined = (rows != 0).astype(float)
    held = joined[joined.sum(axis=1) == 1].any(axis=0)
    return [group for group in blocks_of(joined.T @ joined) if not held[group].any()]


@dataclass(frozen=True)
class ChainStructure(BodyStructure):
    """Masses in a row; places are their numbers, from 1."""

    section: Chain

    def frequency_count(self, omega: float) -> int:
        """The number of masses."""
        return self.size

    def unsupported_row(self, place: Place | LoadedRegion) -> Floats:
        """(N,) displacement of a mass for a unit of each degree of freedom."""
        assert isinstance(place, Place)  # the scenario refuses other places
        if place.direction != DEFLECTION:
            raise ValueError(f"the masses of a chain have no motion {place.direction}")
        return np.asarray(np.eye(self.size)[round(place.coordinate) - 1])

    def unit_stiffness(self, site: Site) -> float:
        """The stiffest spring of the chain, N/m."""
        return max(self.section.springs)

    def reassemble(self, section: Chain) -> ChainStructure:
        """A chain with other numbers."""
        return assemble_chain(section, self.name)

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """The displacements of all masses.

        Parameters
        ----------
        member, basis, sites, base : see `BodyStructure.recovery`.

        Returns
        -------
        Recovery
            At the masses.
        """
        shapes = (member.expansion @ basis.vectors) * (1 / np.sqrt(member.structure.mass_scale))
        return Recovery(self.name, MASSES, np.arange(1.0, self.size + 1), shapes)

    def restraints(self, base: BaseDirection) -> Sequence[Restraint]:
        """The walls, and the ground if springs are connected to it."""
        chain, size = self.section, self.size
        springs = []
        for name, link, mass in (("left", 0, 1), ("right", size, size)):
            spring, dashpot = (of[link] if link < len(of) else 0.0 for of in (chain.springs, chain.dashpots))
            springs.append(Coupling(name, Place(self.name, mass), spring, dashpot))
        springs += [
            Coupling(s.name, Place(self.name, _mass(s)), s.linear_stiffness, to_ground=True)
            for s in chain.springs_to_ground
        ]
        return [
            Restraint(each.name, DEFLECTION, 0.0 if each.to_ground else 1.0, spring=each)
            for each in springs
            if each.stiffness or each.dashpot
        ]

    def given_field(self, numbers: Sequence[float]) -> BodyField:
        """One number for each mass."""
        weights = self.mass.diagonal()
        return BodyField(WeightedValues(np.eye(self.size), weights, np.asarray(numbers, dtype=float)))

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) inertia and (N,) force of springs to the ground, for a unit motion of the base."""
        ground = np.zeros(self.size)
        for spring in self.section.springs_to_ground:
            ground[_mass(spring) - 1] -= spring.linear_stiffness
        return super().base_load(motion)[0], ground


def _mass(spring: Any, end: int = 0) -> int:
    """Number of the mass at an end of a spring."""
    return int(spring.places[end].mass)


def assemble_chain(chain: Chain, name: str = "chain", nodes: Sequence[float] = ()) -> ChainStructure:
    """Matrices of a chain: dashpots and springs between neighbours and walls, and the linear part of all other springs.

    The walls move with the base; the ground does not, so a spring to the ground acts with -k d(t) on the relative
    coordinates. Nonlinear parts of springs are not included; see `beamsim.contacts.snubbers`.

    Parameters
    ----------
    chain : the section of the scenario.
    name : name of the body.
    nodes : not used, since every mass is a node.

    Returns
    -------
    ChainStructure
        Scaled by the mean mass and the largest spring.
    """
    masses = np.array(chain.masses, dtype=float)
    count = masses.size
    row = [(i - 1, i) for i in range(count + 1)]
    springs = [(*ends, k) for ends, k in zip(row, chain.springs, strict=False)]
    springs += [(count, _mass(spring) - 1, spring.linear_stiffness) for spring in chain.springs_to_ground]
    springs += [(_mass(spring) - 1, _mass(spring, 1) - 1, spring.linear_stiffness) for spring in chain.springs_between]
    springs = [spring for spring in springs if spring[2] > 0]
    stiffness = np.array([k for _, _, k in springs], dtype=float)
    mass_scale = float(np.mean(masses))
    stiffness_scale = float(stiffness.max(initial=0.0)) or 1.0
    rows = _extension_rows(count, [(a, b) for a, b, _ in springs])
    damping: Any = None
    if any(chain.dashpots):
        rates = _extension_rows(count, row[: len(chain.dashpots)])
        damping = csc_array(rates.T @ (np.array(chain.dashpots, dtype=float)[:, None] * rates))
    groups = floating_groups(rows)
    rigid = np.zeros((count, len(groups)))
    for j, group in enumerate(groups):
        rigid[group, j] = 1.0 / np.sqrt(masses[group].sum() / mass_scale)

    mass = csc_array(np.diag(masses / mass_scale))
    factor = csr_array(rows * np.sqrt(stiffness / stiffness_scale)[:, None])
    return ChainStructure(
        name=name,
        mass=mass,
        factor=factor,
        damping=damping,
        stated_damping=chain.damping,
        all_dofs_map=eye_array(count, format="csr"),
        unsupported=(mass, factor, damping),
        rigid=rigid,
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        section=chain,
    )
