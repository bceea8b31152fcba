"""Interruption on request: an analysis keeps the points it has.

A search heeds the request between passages, and its last point is given up; what is computed for the points that are
kept is not interrupted. A flow may be left with the parameter of another point: outputs set it again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from beamsim.flow.stopping import Stopped, heeding, never

__all__ = ["Stop", "Stopped", "heeding", "never", "until"]

Stop = Callable[[], bool]  # whether to stop
Point = TypeVar("Point")


def until(points: Iterable[Point], stop: Stop) -> Iterator[Point]:
    """The points until `stop` is true, which the search for each heeds too.

    >>> list(until("abc", lambda: True))
    ['a']
    """
    search = iter(points)
    while True:
        try:
            with heeding(stop):
                point = next(search)
        except (StopIteration, Stopped):
            return
        yield point
        if stop():
            return
