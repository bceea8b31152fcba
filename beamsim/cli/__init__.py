"""The command line: load, call, save, print.

Never here: computing, drawing, opening files.
Begin with `app`, which defines the commands and their options; the other modules carry them out. `session` is around
every command: messages, exit codes, signals and progress. `command` is what all analyses share: compute, save, draw
and print. `screens` has what the first screens share, `tables` the one table of summaries of all kinds; `motions`,
`branches`, `studies` and `measured` have the first screen of each kind of result.
"""

from __future__ import annotations

import gc
import io
import logging
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from typing import Any

from beamsim.cli.received import RECEIVED
from beamsim.errors import CacheWarning

__all__ = ["main"]

LEAST_ADDRESS_SPACE = 1_000_000 * 1024
"""Address space that the libraries and a small case need, in bytes; mostly compiled code."""


def main() -> None:
    """Entry point of ``beamsim``; raises `SystemExit` with one of `beamsim.outcomes.ExitCode`."""
    heeded = [number for number in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(number) != signal.SIG_IGN]

    def stop(number: int, _frame: object) -> None:
        if RECEIVED and RECEIVED[-1] in _handled_exceptions():
            return  # a second signal would interrupt the clean-up and change the exit code
        RECEIVED.append(KeyboardInterrupt() if number == signal.SIGINT else SystemExit(128 + number))
        raise RECEIVED[-1]  # raise it again if a library has swallowed the first one

    try:
        for number in heeded:  # as early as possible
            signal.signal(number, stop)
        try:
            _prepare()
            from beamsim.cli.app import app

            app(prog_name="beamsim")
        finally:
            for number in heeded:  # the exit code is final; Python removes its own handlers at exit
                signal.signal(number, signal.SIG_IGN)
            # Python remembers an interrupt that came in an ``exec`` of a library, and ``python -m`` would end by SIGINT
            # in place of the exit code; another ``exec`` clears that
            exec("")
            gc.freeze()  # memory is freed with the process; a garbage collection would take a fifth of a run
    except KeyboardInterrupt:
        sys.exit(130)


def _prepare() -> None:
    """Set up the process before any library is loaded.

    Raises
    ------
    SystemExit
        If no command can run in this environment.
    """
    gc.set_threshold(500_000)  # skip garbage collection during imports, which takes a tenth of a run
    # with small matrices, several threads would slow down linear algebra
    for library in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(library, "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # the search for plugins reads every installed package
    os.environ["MPLBACKEND"] = "agg"  # no interactive pictures; an unknown backend would stop the import
    prepare_streams()
    if obstacle := unusable_surroundings():
        print(f"beamsim: {obstacle}", file=sys.stderr)
        sys.exit(2)
    warnings.showwarning = show_warning


def _handled_exceptions() -> Iterator[BaseException]:
    """The exception being handled, if any, and the exceptions during whose handling it was raised."""
    error = sys.exception()
    while error is not None:
        yield error
        error = error.__context__


def show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: Any = None,
    line: str | None = None,
) -> None:
    """Print a warning of this package in one line, any other warning with its source location.

    Parameters
    ----------
    message, category, filename, lineno, file, line : see `warnings.showwarning`.
    """
    place = warnings.formatwarning(message, category, filename, lineno, line)
    print(
        f"beamsim: warning: {message}" if issubclass(category, CacheWarning) else place.rstrip(),
        file=file or sys.stderr,
        flush=True,
    )


def prepare_streams() -> None:
    """Prepare the standard streams for any text, and print log messages of the package to standard error.

    Closed streams (``2>&-``) are opened on the null device; otherwise the next opened files would get their
    descriptors, and messages would be written into results. Characters outside the encoding are escaped; on Windows it
    is set to UTF-8.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor, which is this one
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - until the end
        if isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8" if sys.platform == "win32" else None, errors="backslashreplace")
    logger = logging.getLogger("beamsim")
    if not logger.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("beamsim: %(message)s"))
        logger.addHandler(handler)
    logger.setLevel(logging.INFO)


def unusable_surroundings() -> str:
    """Problem of the environment that stops every command, with a remedy: no current folder, too little memory."""
    try:
        os.getcwd()
    except OSError as error:
        return f"the current folder cannot be used ({error.strerror}); change to one that exists"
    if sys.platform == "win32":
        return ""
    import resource

    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    if allowed == resource.RLIM_INFINITY or allowed >= LEAST_ADDRESS_SPACE:
        return ""
    least = LEAST_ADDRESS_SPACE // 1024
    return f"the address space is limited to {allowed / 1e6:.0f} MB, which is too little; allow more: ulimit -v {least}"
