"""How commands end early: exceptions as messages and exit codes (`beamsim.outcomes.ExitCode`), Ctrl-C and SIGTERM.

The first signal sets a flag, the second ends at once.
"""

from __future__ import annotations

import errno
import functools
import io
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import ParamSpec

import typer

from beamsim.errors import BeamsimError, ScenarioError, VerdictError, visible
from beamsim.outcomes import ExitCode

Parameters = ParamSpec("Parameters")

NOTHING_INCOMPLETE = "beamsim: interrupted; no incomplete file was left"

# errors of print when the disk is full; not every system defines all of them
OUTPUT_REFUSED = [getattr(errno, name) for name in ("ENOSPC", "EIO", "EFBIG", "EDQUOT") if hasattr(errno, name)]


def verdict(error: BaseException) -> tuple[int, str]:
    """Exit code and message for an exception."""
    if isinstance(error, KeyboardInterrupt):
        return ExitCode.INTERRUPTED, NOTHING_INCOMPLETE
    if isinstance(error, ScenarioError):
        return error.exit_code, "\n".join(
            str(problem) if problem.file else f"beamsim: {problem}" for problem in error.problems
        )
    if isinstance(error, BeamsimError):
        return error.exit_code, f"beamsim: {error}"
    if isinstance(error, MemoryError):
        reason = f" ({error})" if str(error) else ""
        return ExitCode.USAGE, f"beamsim: not enough memory{reason}; reduce run.duration, run.sample_rate or the model"
    if isinstance(error, OSError) and error.filename is not None:
        return ExitCode.USAGE, f"beamsim: {error.filename}: {error.strerror}"
    if isinstance(error, OSError) and error.errno in OUTPUT_REFUSED:
        return ExitCode.USAGE, f"beamsim: cannot write the output: {error.strerror}"
    text = f"{type(error).__name__}: {error}".splitlines()[0]
    return ExitCode.BUG, f"beamsim: internal error ({text}); use --debug for the traceback"


def interruption_behind(error: BaseException) -> BaseException | None:
    """What SIGINT or SIGTERM raised, where a library made an error of its own of it; None for other errors.

    >>> try:
    ...     try:
    ...         raise KeyboardInterrupt
    ...     except:
    ...         raise ValueError("cannot write")
    ... except ValueError as error:
    ...     interruption_behind(error)
    KeyboardInterrupt()
    """
    if isinstance(error, VerdictError):  # the partial result is kept
        return None
    behind = error.__context__
    while behind is not None and not isinstance(behind, (KeyboardInterrupt, SystemExit)):
        behind = behind.__context__
    return behind


def say(text: str) -> None:
    """Print a message on standard error."""
    print(visible(text), file=sys.stderr, flush=True)


def show(*texts: object) -> None:
    """Print texts on standard output, a line each, with escapes in place of control characters from files."""
    print(*(visible(str(text)) for text in texts), sep="\n")


def broken_pipe(error: BaseException) -> bool:
    """Whether standard output was closed by its reader (``| head``); on Windows that is an invalid argument."""
    invalid = sys.platform == "win32" and getattr(error, "errno", None) == errno.EINVAL
    return isinstance(error, BrokenPipeError) or (isinstance(error, OSError) and invalid and error.filename is None)


def discard_output() -> None:
    """Discard buffered standard output, so that flushing it at exit does not fail."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (AttributeError, OSError, ValueError):  # no such function, or no file behind standard output
        sys.stdout = io.StringIO()


def guarded(command: Callable[Parameters, None]) -> Callable[Parameters, None]:
    """Make a command end with the message and exit code of what it raises."""

    @functools.wraps(command)
    def wrapper(*args: Parameters.args, **kwargs: Parameters.kwargs) -> None:
        try:
            command(*args, **kwargs)
            if sys.stdout is not None:
                sys.stdout.flush()  # here, where a full disk can be reported
        except typer.Exit:
            raise
        except SystemExit as end:
            if end.code == ExitCode.TERMINATED:
                say(NOTHING_INCOMPLETE)
            raise
        except (Exception, KeyboardInterrupt) as raised:
            error = interruption_behind(raised) or raised
            if isinstance(error, SystemExit):
                say(NOTHING_INCOMPLETE)
                raise error from None
            if broken_pipe(error):
                discard_output()
                raise typer.Exit(ExitCode.BROKEN_PIPE) from None
            if kwargs.get("debug"):
                traceback.print_exception(error)
            code, message = verdict(error)
            say(message)
            raise typer.Exit(code) from None

    return wrapper


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
    except VerdictError:  # what was found is kept
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
