"""What systems that differ in contacts, loads or times alone have in common, built once for all of them."""

from __future__ import annotations

from collections import OrderedDict, defaultdict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import field
from functools import cached_property
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.structures.damping import reduced_damping
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.base_motion import BaseDirection
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.places import LoadSite
    from beamsim.structures.stations import Recovery
    from beamsim.structures.structure import Structure

MOST_KEPT = 8  # of each sort; the one not used for longest is dropped

Built = TypeVar("Built")


class SharedBuilds:
    """Structures, reduced structures and signals by what each depends on; may be used by several threads."""

    def __init__(self) -> None:
        self._kept: defaultdict[str, OrderedDict[Hashable, Any]] = defaultdict(OrderedDict)
        self._lock = RLock()

    def once(self, sort: str, key: Hashable, build: Callable[[], Built]) -> Built:
        """What ``build`` gives for a key; threads that need the same wait for the one that builds it.

        Parameters
        ----------
        sort : what is built; of each sort the `MOST_KEPT` used last are kept.
        key : all that it depends on; if it has no hash, nothing is kept.
        build : makes it.

        Returns
        -------
        What was built, now or before.
        """
        try:
            hash(key)
        except TypeError:
            return build()
        with self._lock:
            kept = self._kept[sort]
            if key not in kept:
                kept[key] = build()
            kept.move_to_end(key)
            if len(kept) > MOST_KEPT:
                kept.popitem(last=False)
            known: Built = kept[key]
        return known


@dataclass(frozen=True)
class ReducedStructure:
    """A structure in reduced, mass-normalised coordinates; what follows from it is kept for the systems that share it.

    May be used by several threads.
    """

    structure: Structure
    basis: ReducedBasis
    kept: SharedBuilds = field(default_factory=SharedBuilds)

    @cached_property
    def omega(self) -> Floats:
        """(n,) rad/s."""
        return np.asarray(self.basis.omega * self.structure.frequency_scale)

    @cached_property
    def damping(self) -> Floats:
        """(n, n) C, 1/s."""
        return reduced_damping(self.structure, self.basis, self.omega)

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(n,) modal inertia, sqrt(kg), and force of springs to the ground, N/(m sqrt(kg)), of a unit base motion."""

        def built() -> tuple[Floats, Floats]:
            inertia, ground = self.structure.base_load(motion)
            scale = np.sqrt(self.structure.mass_scale)
            return np.asarray((inertia @ self.basis.vectors) * scale), np.asarray(ground @ self.basis.vectors) / scale

        return self.kept.once("base load", motion, built)

    def shapes(self, sites: Sequence[LoadSite]) -> Floats:
        """(m, n) deflection, of links stretch, at sites for a unit of each coordinate, 1/sqrt(kg)."""

        def built() -> Floats:
            return np.asarray(self.structure.rows(sites) @ self.basis.vectors / np.sqrt(self.structure.mass_scale))

        return self.kept.once("shapes", tuple(sites), built).copy()

    def recoveries(self, sites: Sequence[LoadSite], base: BaseDirection | None) -> tuple[Recovery, ...]:
        """What can be recovered along each body, see `Structure.recoveries`."""
        key = (tuple(sites), base)
        return self.kept.once("recoveries", key, lambda: self.structure.recoveries(self.basis, tuple(sites), base))
