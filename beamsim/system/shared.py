"""What systems that differ in contacts, loads or times alone have in common, built once for all of them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import field
from functools import cached_property
from threading import Lock, RLock
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.base_motion import BaseDirection
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.places import LoadSite
    from beamsim.structures.stations import Recovery
    from beamsim.structures.structure import Structure

MOST_KEPT = 8  # of each sort; the one not used for longest is dropped

Built = TypeVar("Built")


@dataclass(frozen=True)
class ReducedStructure:
    """A structure in reduced, mass-normalised coordinates; what follows from it is worked out once."""

    structure: Structure
    basis: ReducedBasis
    _known: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def omega(self) -> Floats:
        """(n,) rad/s."""
        return np.asarray(self.basis.omega * self.structure.frequency_scale)

    @cached_property
    def damping(self) -> Floats:
        """(n, n) C, 1/s."""
        return self.structure.reduced_damping(self.basis, self.omega)

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(n,) modal inertia, sqrt(kg), and force of springs to the ground, N/(m sqrt(kg)), of a unit base motion."""
        return self._once(("base load", motion), lambda _: self._base_load(motion))

    def _base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        inertia, ground = self.structure.base_load(motion)
        scale = np.sqrt(self.structure.mass_scale)
        return np.asarray((inertia @ self.basis.vectors) * scale), np.asarray(ground @ self.basis.vectors) / scale

    def shapes(self, sites: Sequence[LoadSite]) -> Floats:
        """(m, n) deflection, of links stretch, at sites for a unit of each coordinate, 1/sqrt(kg)."""
        scale = np.sqrt(self.structure.mass_scale)
        rows = [self._once(site, lambda at: self.structure.row(at) @ self.basis.vectors / scale) for site in sites]
        return np.array(rows).reshape(len(sites), self.basis.size)

    def recoveries(self, sites: Sequence[LoadSite], base: BaseDirection | None) -> tuple[Recovery, ...]:
        """What can be recovered along each body, see `Structure.recoveries`."""
        return self._once(
            (*sites, base), lambda key: self.structure.recoveries(self.basis, key[:-1], base)
        )  # fmt: skip

    def _once(self, key: Any, build: Callable[[Any], Built]) -> Built:
        if key not in self._known:
            self._known[key] = build(key)
        known: Built = self._known[key]
        return known


class SharedBuilds:
    """Structures, reduced structures and signals by what each depends on; may be used by several threads."""

    def __init__(self) -> None:
        self._kept: dict[str, OrderedDict[Hashable, Any]] = {}
        self._looking_up, self._building = Lock(), RLock()

    def once(self, sort: str, key: Hashable, build: Callable[[], Built]) -> Built:
        """What ``build`` gives for the key, a few of each sort being kept; not kept if the key has no hash.

        Threads that need the same wait for the one that builds it.
        """
        try:
            hash(key)
        except TypeError:
            return build()
        known = self._known(sort, key)
        if known:
            return known[0]  # type: ignore[no-any-return]
        with self._building:
            known = self._known(sort, key)
            built: Built = known[0] if known else build()
            with self._looking_up:
                kept = self._kept[sort]
                kept[key] = built
                while len(kept) > MOST_KEPT:
                    kept.popitem(last=False)
        return built

    def _known(self, sort: str, key: Hashable) -> tuple[Any, ...]:
        """What is kept for a key, as the only item; nothing where it is not."""
        with self._looking_up:
            kept = self._kept.setdefault(sort, OrderedDict())
            if key not in kept:
                return ()
            kept.move_to_end(key)
            return (kept[key],)
