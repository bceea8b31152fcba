"""The one place where exceptions become messages and exit codes.

====  ==================================================================
code  meaning
====  ==================================================================
0     success
1     a bug: one line, the traceback only with ``--debug``
2     bad usage, scenario or file (Typer's usage errors as well)
3     stopped before the end or not to be trusted; what there is was saved
4     an allowable is exceeded, under ``--check``
130   interrupted from the keyboard
141   whoever read the output went away (``| head``)
====  ==================================================================
"""

from __future__ import annotations

import errno
import functools
import os
import sys
import traceback
from collections.abc import Callable
from typing import ParamSpec

import typer

from beamsim.errors import BeamsimError, ScenarioError

Parameters = ParamSpec("Parameters")

INTERRUPTED = 130
PIPE_CLOSED = 141
OUTPUT_REFUSED = (errno.ENOSPC, errno.EIO, errno.EFBIG, errno.EDQUOT)  # what print meets where the disk is full


def verdict(error: BaseException) -> tuple[int, str]:
    """Exit code and message for an exception."""
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "beamsim: interrupted; no file was left half-written"
    if isinstance(error, ScenarioError):
        return error.exit_code, "\n".join(
            str(problem) if problem.file else f"beamsim: {problem}" for problem in error.problems
        )
    if isinstance(error, BeamsimError):
        return error.exit_code, f"beamsim: {error}"
    if isinstance(error, MemoryError):
        return 2, "beamsim: not enough memory; shorten run.duration or lower run.sample_rate"
    if isinstance(error, OSError) and error.filename is not None:
        return 2, f"beamsim: {error.filename}: {error.strerror}"
    if isinstance(error, OSError) and error.errno in OUTPUT_REFUSED:
        return 2, f"beamsim: cannot write the output: {error.strerror}"
    text = f"{type(error).__name__}: {error}".splitlines()[0]
    return 1, f"beamsim: internal error ({text}); use --debug to see where"


def say(text: str) -> None:
    """A line for the person, on standard error."""
    print(text, file=sys.stderr, flush=True)


def guarded(command: Callable[Parameters, None]) -> Callable[Parameters, None]:
    """Make a command end with the message and exit code of what it raises."""

    @functools.wraps(command)
    def wrapper(*args: Parameters.args, **kwargs: Parameters.kwargs) -> None:
        try:
            command(*args, **kwargs)
            if sys.stdout is not None:
                sys.stdout.flush()  # here, where a full disk is told as such
        except typer.Exit:
            raise
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing fails when Python flushes at exit
            raise typer.Exit(PIPE_CLOSED) from None
        except (Exception, KeyboardInterrupt) as error:
            if kwargs.get("debug"):
                traceback.print_exception(error)
            code, message = verdict(error)
            say(message)
            raise typer.Exit(code) from None

    return wrapper
