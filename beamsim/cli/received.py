"""Signals received outside of computations, which a library that is being loaded may turn into its own errors."""

from __future__ import annotations

RECEIVED: list[BaseException] = []
"""Exceptions of the signals, latest last."""


def latest_signal() -> BaseException | None:
    """Exception of the latest signal; None without a signal."""
    return RECEIVED[-1] if RECEIVED else None
