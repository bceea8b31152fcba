"""Ctrl-C and SIGTERM during a command: the first sets a flag, the second ends at once."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from beamsim.cli.failures import say
from beamsim.errors import ExitCode, StoppedEarlyError

STOPPING = "beamsim: stopping, and saving what was found; press again to stop at once without saving"


class Interruption:
    """Whether a signal asked the command to end: what analyses call ``stop``."""

    def __init__(self) -> None:
        self.signal = 0  # its number, or 0; of two that of the second
        self.at_once = False  # whether there was a second one

    def __call__(self) -> bool:
        """Whether one was received."""
        return self.signal != 0


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Yield a flag that the first SIGINT or SIGTERM in the block sets; the second ends the block at once.

    Signals that the process was started to ignore (``nohup``, background jobs of a shell) stay ignored.
    """
    interruption = Interruption()
    before = {
        number: handler
        for number in (signal.SIGINT, signal.SIGTERM)
        if callable(handler := signal.getsignal(number)) or handler == signal.SIG_DFL
    }

    def request(number: int, frame: FrameType | None) -> None:
        interruption.at_once = interruption.signal != 0
        interruption.signal = number
        if interruption.at_once:
            raise KeyboardInterrupt
        say(STOPPING)

    try:
        for number in before:
            signal.signal(number, request)
        yield interruption
    except StoppedEarlyError:  # what was found is kept
        raise
    except BaseException as error:
        if not (interruption.at_once or isinstance(error, KeyboardInterrupt)):
            raise
        if interruption.signal == signal.SIGTERM:
            sys.exit(ExitCode.TERMINATED)
        raise KeyboardInterrupt from None  # libraries make errors of their own of it
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
