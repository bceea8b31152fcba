"""Ctrl-C during an analysis, and while its result is written: once to keep what was found, twice to stop at once."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from beamsim.cli.failures import interruption_behind, say
from beamsim.errors import ExitCode
from beamsim.interrupts import SignalBlock, handled, kept

STOPPING = "beamsim: stopping after the current point and saving the partial result; press again to stop immediately"
WRITING = "beamsim: stopping when {file} is written; press again to stop immediately, without it"


class Interruption:
    """Called by an analysis to check whether it should stop."""

    def __init__(self) -> None:
        self.signal = 0  # number of the signal received, or 0
        self.kept = False  # whether there is something to keep: once the analysis has asked
        self.writes = ""  # name of the result file, from when it is written
        self.raised: KeyboardInterrupt | None = None  # by a signal before there is something to keep

    def __call__(self) -> bool:
        """Whether a signal was received."""
        if self.raised is not None:  # and dropped by Python, in a destructor or a callback
            raise self.raised
        self.kept = True
        return self.signal != 0

    def begin_writing(self, file: str) -> None:
        """From here on the first signal waits until the file of this name is complete; nothing is lost by it."""
        self.writes, self.kept = file, True


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Yield an object that the first SIGINT or SIGTERM sets; the second has its previous effect.

    Until the analysis asks for the first time it reads, builds its model and makes its input, of which nothing can be
    kept: the first signal ends it there at once. A file that `Interruption.begin_writing` names is written to its end.

    Signals that the process was started to ignore (``nohup``, background jobs of a shell) stay ignored.
    """
    interruption = Interruption()

    def request(block: SignalBlock, number: int, frame: FrameType | None) -> None:
        interruption.signal = number
        block.end()
        if interruption.kept:
            say(WRITING.format(file=interruption.writes) if interruption.writes else STOPPING)
            return
        interruption.raised = KeyboardInterrupt()
        raise interruption.raised

    try:
        with handled(request, also_default=True):
            yield interruption
    except BaseException as error:  # nothing was found that could be kept
        behind = error if isinstance(error, KeyboardInterrupt) else interruption_behind(error)
        if isinstance(behind, KeyboardInterrupt) and interruption.signal == signal.SIGTERM:
            sys.exit(ExitCode.TERMINATED)
        raise


@contextmanager
def raised_again() -> Iterator[Callable[[], None]]:
    """Yield a function that raises what SIGINT or SIGTERM has raised within the block, if Python dropped it."""
    raised: list[BaseException] = []

    def check() -> None:
        if raised:
            raise raised[0]

    with kept(raised.append):
        yield check
