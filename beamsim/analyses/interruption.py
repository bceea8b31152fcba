"""Interruption on request: an analysis checks between points and keeps the points it has.

An exception during a point could leave a flow with the parameter of another point; outputs computed later for the
earlier points would then be wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Stop = Callable[[], bool]  # whether to stop
Point = TypeVar("Point")


def never() -> bool:
    """Do not stop early."""
    return False


def until(points: Iterable[Point], stop: Stop) -> Iterator[Point]:
    """The points, at least one, until `stop` is true.

    >>> list(until("abc", lambda: True))
    ['a']
    """
    for point in points:
        yield point
        if stop():
            return
