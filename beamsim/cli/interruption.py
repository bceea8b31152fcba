"""Ctrl-C during an analysis that can end early: once to keep what was found, twice to end at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from beamsim.cli.failures import say


class Interruption:
    """Asked by an analysis whether it is time to end."""

    def __init__(self) -> None:
        self.signal = 0  # that came; 0 where none has

    def __call__(self) -> bool:
        """Whether a signal came."""
        return self.signal != 0


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Yield what the first SIGINT or SIGTERM sets; the second does what either did before.

    One that the process was started to ignore (``nohup``, a shell's background job) stays ignored.
    """
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption  # signals are the main thread's
        return
    before: dict[signal.Signals, Any] = {}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def ask(number: int, _frame: object) -> None:
        interruption.signal = number
        restore()
        say("beamsim: stopping after the present point and saving what was found; press again to stop at once")

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) not in (signal.SIG_IGN, None):  # None: set by what is not Python
            before[number] = signal.signal(number, ask)
    try:
        yield interruption
    finally:
        restore()
