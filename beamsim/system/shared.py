"""What systems that differ in contacts, loads or times alone have in common, built once for all of them."""

from __future__ import annotations

from collections import OrderedDict, defaultdict
from collections.abc import Callable, Hashable
from threading import RLock
from typing import Any, TypeVar

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
