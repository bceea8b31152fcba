"""Requests to end: an analysis asks between events, points and cases whether to, and returns what it has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Stop = Callable[[], bool]
"""Whether to end."""
Point = TypeVar("Point")


def never() -> bool:
    """No request to end."""
    return False


def until(points: Iterable[Point], stop: Stop) -> Iterator[Point]:
    """The points up to the first one after which ``stop`` is true.

    >>> list(until("abc", lambda: True))
    ['a']
    """
    for point in points:
        yield point
        if stop():
            return
