"""Requests to stop, checked inside long searches and evaluations.

Loops between calls of compiled kernels call `check_stop`. The caller that holds the partial result sets what is checked
with `heeding`, and catches `Stopped`. Outside of `heeding` nothing is checked, so that the partial result can be
evaluated.

The compilation of a kernel takes seconds and checks nothing. A signal that arrives there raises `CompilationStopped`:
within `heeding` that is `Stopped`, elsewhere an interruption that keeps nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import FrameType


class Stopped(Exception):
    """A search or an evaluation was given up on request."""


def never() -> bool:
    """No request to stop."""
    return False


_request: ContextVar[Callable[[], bool]] = ContextVar("request", default=never)


class CompilationStopped(KeyboardInterrupt):
    """A compilation was given up on request."""

    caught = False  # whether it has become `Stopped`


COMPILER = "numba.core.compiler"  # module, with others of that beginning, that compiles every kernel
LOSES_EXCEPTIONS = "_raw_object_cache"  # begin of the names of functions that LLVM calls: what they raise is dropped

between_compilations: list[Callable[[], None]] = []
"""Called before and after each compilation; what they raise ends it."""


def check_compilation() -> None:
    """Raise `CompilationStopped` where a stop is requested, whatever time remains for what is compiled."""
    for check in between_compilations:
        check()
    request = _request.get()
    if getattr(request, "requested", request)():
        raise CompilationStopped


def is_compiling(frame: FrameType | None) -> bool:
    """Whether a kernel is being compiled where a signal arrived."""
    return any(name.startswith(COMPILER) for name, _ in _callers(frame))


def loses_exceptions(frame: FrameType | None) -> bool:
    """Whether what is raised there would be dropped."""
    return any(function.startswith(LOSES_EXCEPTIONS) for _, function in _callers(frame))


def _callers(frame: FrameType | None) -> Iterator[tuple[str, str]]:
    """Modules and names of the functions that are being executed, the innermost first."""
    while frame is not None:
        yield frame.f_globals.get("__name__", ""), frame.f_code.co_name
        frame = frame.f_back


@contextmanager
def heeding(stop: Callable[[], bool]) -> Iterator[None]:
    """Let `check_stop` ask ``stop`` within the block."""
    before = _request.set(stop)
    try:
        yield
    except CompilationStopped as error:
        error.caught = True
        raise Stopped from None
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
