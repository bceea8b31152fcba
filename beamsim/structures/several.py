"""Several bodies as one structure: block matrices, each block with modes of its own.

Nothing linear couples the bodies, so the modes, static vectors and modal damping of each are its own, whatever
frequencies the others have; equal bodies keep modes that belong to one of them each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from beamsim.structures.basis import ReducedBasis
from beamsim.structures.places import Link, Place, Site, SpringEnd
from beamsim.structures.stations import Recovery
from beamsim.structures.structure import Part, Path, Structure
from beamsim.typing import Floats, Ints


@dataclass(frozen=True)
class Assembly(Structure):
    """Bodies side by side."""

    bodies: tuple[Part, ...]

    @property
    def parts(self) -> tuple[Part, ...]:
        """The bodies."""
        return self.bodies

    def _part(self, name: str) -> Part:
        return next(part for part in self.bodies if part.structure.name == name)

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""
        physical = omega * self.frequency_scale
        return sum(p.structure.frequency_count(physical / p.structure.frequency_scale) for p in self.bodies)

    def deflection_row(self, place: Place) -> Floats:
        """(N,) deflection at a place for a unit of each degree of freedom."""
        part = self._part(place.body)
        row = np.zeros(self.size)
        row[part.dofs] = part.structure.deflection_row(place)
        return row

    def loaded_sites(self, sites: Sequence[Site]) -> list[Site]:
        """Both ends of a link between two bodies; within a body what that body asks for."""
        loaded: list[Site] = []
        for site in sites:
            if isinstance(site, Link) and site.first.body != site.second.body:
                loaded += [site.first, site.second]
            else:
                body = site.first.body if isinstance(site, Link) else site.body
                loaded += self._part(body).structure.loaded_sites([site])
        return list(dict.fromkeys(loaded))

    def deflection_and_slope(self, vectors: Floats, place: Place) -> tuple[Floats, Floats]:
        """(k,) deflections of k fields (N, k) at a place, and their derivatives by its coordinate."""
        part = self._part(place.body)
        return part.structure.deflection_and_slope(vectors[part.dofs], place)

    def unit_stiffness(self, site: Site) -> float:
        """That of the body, of a link that of the softer of its two."""
        ends = (site.first, site.second) if isinstance(site, Link) else (site,)
        return min(self._part(end.body).structure.unit_stiffness(end) for end in ends)

    def reduced_damping(self, basis: ReducedBasis, omega: Floats) -> Floats:
        """(n, n) C of the reduced model, 1/s, body by body."""
        damping = np.zeros((omega.size, omega.size))
        for part, (reduced, columns) in zip(self.bodies, basis.blocks, strict=True):
            damping[np.ix_(columns, columns)] = part.structure.reduced_damping(reduced, omega[columns])
        return damping

    def recoveries(self, basis: ReducedBasis, sites: Sequence[Site], base_moves: bool) -> tuple[Recovery, ...]:
        """Those of every body, with the sites that are on it."""
        recovered: list[Recovery] = []
        for part, (reduced, columns) in zip(self.bodies, basis.blocks, strict=True):
            ends = [end for s in sites for end in ((s.first, s.second) if isinstance(s, Link) else (s,))]
            on_it = [end for end in ends if end.body == part.structure.name]
            for recovery in part.structure.recoveries(reduced, on_it, base_moves):
                moment = recovery.bending_moment
                recovered.append(
                    replace(
                        recovery,
                        deflection=_widened(recovery.deflection, columns, basis.size),
                        bending_moment=None if moment is None else _widened(moment, columns, basis.size),
                    )
                )
        return tuple(recovered)

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,)."""
        return max(part.structure.largest_deflection(field[part.dofs]) for part in self.bodies)

    def project(self, basis: ReducedBasis, numbers: Sequence[float], quantity: str) -> tuple[Floats, float]:
        """No list of numbers describes a field of several bodies."""
        raise ValueError("the shape of several bodies is not given by one list of numbers")

    def sensitivities(
        self, path: Path, ends: Sequence[SpringEnd], v: Floats, k: float, squared: float
    ) -> dict[Path, float]:
        """Each body is asked for its numbers."""
        raise ValueError("several bodies have no common path; ask each of them")


def _widened(rows: Floats, columns: Ints, size: int) -> Floats:
    """(nx, n) rows of a body in all coordinates."""
    wide = np.zeros((rows.shape[0], size))
    wide[:, columns] = rows
    return wide


def assemble_bodies(bodies: Sequence[Structure]) -> Assembly:
    """Block matrices of several bodies, all with the scales of the heaviest and the stiffest of them."""
    from scipy.sparse import block_diag

    mass_scale = max(body.mass_scale for body in bodies)
    stiffness_scale = max(body.stiffness_scale for body in bodies)
    mass_ratio = [body.mass_scale / mass_scale for body in bodies]
    starts = np.cumsum([0, *(body.size for body in bodies)]).tolist()
    dofs = [slice(start, end) for start, end in pairwise(starts)]
    factors = [body.factor * np.sqrt(body.stiffness_scale / stiffness_scale) for body in bodies]
    damping = None
    if any(body.damping is not None for body in bodies):
        damping = block_diag([_zeros(body) if body.damping is None else body.damping for body in bodies], format="csc")
    rigid = block_diag(
        [body.rigid / np.sqrt(ratio) for body, ratio in zip(bodies, mass_ratio, strict=True)], format="csr"
    ).toarray()
    return Assembly(
        name="",
        mass=block_diag([body.mass * ratio for body, ratio in zip(bodies, mass_ratio, strict=True)], format="csc"),
        factor=block_diag(factors, format="csr"),
        damping=damping,
        inertia=np.concatenate([body.inertia * ratio for body, ratio in zip(bodies, mass_ratio, strict=True)]),
        ground=np.concatenate([body.ground for body in bodies]),
        rigid=np.asarray(rigid, dtype=float),
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        deflection_dofs=np.concatenate(
            [body.deflection_dofs + start for body, start in zip(bodies, starts[:-1], strict=True)]
        ),
        bodies=tuple(Part(body, columns) for body, columns in zip(bodies, dofs, strict=True)),
    )


def _zeros(body: Structure) -> Any:
    from scipy.sparse import csc_array

    return csc_array((body.size, body.size))
