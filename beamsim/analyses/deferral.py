"""Signals that take effect between tasks of workers.

A pool of workers and its caller share locks. A handler that raises while the caller holds one leaves it locked, and the
workers wait for it for ever.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


@contextmanager
def signals_deferred() -> Iterator[Callable[[], None]]:
    """Yield a function that lets a SIGINT or SIGTERM received in the block take effect; else that waits for its end.

    A second signal takes effect at once.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None  # only the main thread receives signals
        return
    before: dict[int, Any] = {}
    waiting: list[int] = []  # the signal received
    received = False

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal received
        if received:
            before[number](number, frame)
        received = True
        waiting.append(number)

    def take_effect() -> None:
        while waiting:
            number = waiting.pop()
            before[number](number, None)

    for number in (int(signal.SIGINT), int(signal.SIGTERM)):
        if callable(handler := signal.getsignal(number)):  # what ends the process without Python leaves nothing waiting
            before[number] = handler
            signal.signal(number, handle)
    try:
        yield take_effect
    finally:
        for number, handler in before.items():
            if signal.getsignal(number) is handle:
                signal.signal(number, handler)
    take_effect()
