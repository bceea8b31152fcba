"""Ending early when asked to: an analysis asks between points, where nothing is half done, and keeps what it has.

An exception in the middle of a point could leave a flow at another point's parameter, and what is computed of the
points before it would be wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Stop = Callable[[], bool]  # whether it is time to end
Point = TypeVar("Point")


def never() -> bool:
    """Go on to the end."""
    return False


def until(points: Iterable[Point], stop: Stop) -> Iterator[Point]:
    """The points, at least one, until it is time to end.

    >>> list(until("abc", lambda: True))
    ['a']
    """
    for point in points:
        yield point
        if stop():
            return
