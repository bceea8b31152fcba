"""Requests to stop, checked inside long searches and evaluations.

Loops between calls of compiled kernels call `check_stop`. The caller that holds the partial result sets what is checked
with `heeding`, and catches `Stopped`. Outside of `heeding` nothing is checked, so that the partial result can be
evaluated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


class Stopped(Exception):
    """A search or an evaluation was given up on request."""


def never() -> bool:
    """No request to stop."""
    return False


_request: ContextVar[Callable[[], bool]] = ContextVar("request", default=never)


@contextmanager
def heeding(stop: Callable[[], bool]) -> Iterator[None]:
    """Let `check_stop` ask ``stop`` within the block."""
    before = _request.set(stop)
    try:
        yield
    finally:
        _request.reset(before)


def check_stop() -> None:
    """Raise `Stopped` where that is requested; cheap against any call of a kernel.

    >>> with heeding(lambda: True):
    ...     check_stop()
    Traceback (most recent call last):
    beamsim.flow.stopping.Stopped
    """
    if _request.get()():
        raise Stopped
