"""What signals raised outside of computations: a library that is being loaded may make an error of its own of it."""

from __future__ import annotations

RECEIVED: list[BaseException] = []
"""The latest is last."""


def latest_signal() -> BaseException | None:
    """The latest of them, None where no signal came."""
    return RECEIVED[-1] if RECEIVED else None
