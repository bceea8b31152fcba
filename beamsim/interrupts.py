"""SIGINT and SIGTERM within a block: handlers are set and taken back here and nowhere else.

A block gives its signals to a policy: those of `deferred` and `kept`, or one of its own.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

NUMBERS = (signal.SIGINT, signal.SIGTERM)

Policy = Callable[["SignalBlock", int, FrameType | None], None]
"""What a signal does in a block, given its number and the frame in which it arrived."""


class SignalBlock:
    """The handler of both signals in a block.

    Blocks may be nested, and end in any order, as those of suspended generators do: a block that has ended passes its
    signals on. What others have set in the meantime is left to them.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._before: dict[int, Any] = {}  # handler without the block, for each signal that it receives
        self._ended = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Receive a signal."""
        if self._ended:
            self.pass_on(number, frame)
        else:
            self._policy(self, number, frame)

    def begin(self, *, also_default: bool) -> None:
        """Receive the signals that are not ignored, nor handled by another language."""
        for number in NUMBERS:
            handler = signal.getsignal(number)
            if callable(handler) or (also_default and handler == signal.SIG_DFL):
                self._before[number] = handler
                signal.signal(number, self)

    def pass_on(self, number: int, frame: FrameType | None) -> None:
        """Let a signal have the effect that it would have without the block."""
        installed = signal.getsignal(number)
        handler = self._outer(number)
        if handler == signal.SIG_DFL:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        if not callable(handler):
            return
        try:
            handler(number, frame)
        finally:
            new = signal.getsignal(number)
            if new is not installed and not isinstance(new, SignalBlock):  # the program's own next one
                self._before[number] = new
                signal.signal(number, installed)

    def end(self) -> None:
        """Take the handlers back; the signals that still arrive here are passed on."""
        self._ended = True
        if not _receives_signals():
            return
        raised: BaseException | None = None
        for number in self._before:
            while self._is_installed(number):
                try:
                    signal.signal(number, self._outer(number))
                except BaseException as error:  # of a signal that has just arrived, before the handler was set
                    raised = error
        if raised is not None:
            raise raised

    def _is_installed(self, number: int) -> bool:
        return signal.getsignal(number) is self

    def _outer(self, number: int) -> Any:
        """Handler of a signal without this block and those that have ended."""
        handler = self._before[number]
        while isinstance(handler, SignalBlock) and handler._ended:
            handler = handler._before[number]
        return handler


@contextmanager
def handled(policy: Policy, *, also_default: bool = False) -> Iterator[SignalBlock]:
    """Give the signals of the block to a policy; outside of the main thread, which alone receives signals, none come.

    Signals that the process was started to ignore (``nohup``, background jobs of a shell) stay ignored. Those that end
    it without Python (`signal.SIG_DFL`) go to the policy only with `also_default`.
    """
    block = SignalBlock(policy)
    try:
        if _receives_signals():
            block.begin(also_default=also_default)
        yield block
    finally:
        block.end()


def _receives_signals() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextmanager
def deferred() -> Iterator[Callable[[], None]]:
    """Yield a function that lets a signal received in the block take effect; else that waits for the end of the block.

    A second signal takes effect at once.

    A pool of workers and its caller share locks. A handler that raises while the caller holds one leaves it locked, and
    the workers wait for it for ever.
    """
    waiting: list[int] = []  # the signal received
    received = False

    def wait(block: SignalBlock, number: int, frame: FrameType | None) -> None:
        nonlocal received
        if received:
            block.pass_on(number, frame)
        else:
            received = True
            waiting.append(number)

    def take_effect() -> None:
        if waiting:
            block.pass_on(waiting.pop(), None)

    block: SignalBlock
    try:
        with handled(wait) as block:
            yield take_effect
    finally:
        take_effect()


def never(frame: FrameType | None) -> bool:
    """In no frame."""
    return False


@contextmanager
def kept(keep: Callable[[BaseException], None], lost_in: Callable[[FrameType | None], bool] = never) -> Iterator[None]:
    """Keep what signals raise in the block, and raise it, but for frames that lose it.

    Parameters
    ----------
    keep : called with what is raised.
    lost_in : whether it would be lost in a frame, such as that of a function which compiled code calls.
    """

    def pass_on(block: SignalBlock, number: int, frame: FrameType | None) -> None:
        try:
            block.pass_on(number, frame)
        except BaseException as error:
            keep(error)
            if not lost_in(frame):
                raise

    with handled(pass_on):
        yield
