"""The command line: load, call, save, print.

Never here: computing, drawing, opening files.
Begin with `app`, which has the commands with what they are given; the others hold what they do. `conclusion` is what
all analyses share: how a command ends, with which exit code. `printing` is the printer, `tables` makes rows of a
summary; `motions`, `branches`, `studies` and `measured` say what is printed of each kind of result.
"""

from __future__ import annotations

import gc
import logging
import os
import signal
import sys
import warnings
from typing import Any

from beamsim.errors import CacheWarning

__all__ = ["main"]


def main() -> None:
    """Entry point of ``beamsim``; raises `SystemExit` with one of `beamsim.outcomes.ExitCode`."""
    gc.set_threshold(500_000)  # modules being imported are no garbage; searching among them takes a tenth of a run
    # the matrices are small: more threads would make the linear algebra slower
    for library in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(library, "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # looking for them reads every installed package

    def stop(number: int, _frame: object) -> None:
        sys.exit(128 + number)  # an exception, so that temporary files are removed

    signal.signal(signal.SIGTERM, stop)
    show_notices()
    warnings.showwarning = show_warning
    if sys.platform == "win32":
        use_utf8(sys.stdout, sys.stderr)
    try:
        from beamsim.cli.app import app

        app(prog_name="beamsim")
    except KeyboardInterrupt:
        sys.exit(130)


def show_notices() -> None:
    """Print on standard error what the package logs, one line each."""
    logger = logging.getLogger("beamsim")
    if not logger.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("beamsim: %(message)s"))
        logger.addHandler(handler)
    logger.setLevel(logging.INFO)


def show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: Any = None,
    line: str | None = None,
) -> None:
    """Print a warning of this package in one line, any other with its place in the source.

    Parameters
    ----------
    message, category, filename, lineno, file, line : as of `warnings.showwarning`.
    """
    place = warnings.formatwarning(message, category, filename, lineno, line)
    print(
        f"beamsim: warning: {message}" if issubclass(category, CacheWarning) else place.rstrip(),
        file=file or sys.stderr,
        flush=True,
    )


def use_utf8(*streams: Any) -> None:
    """Switch streams to UTF-8, which is not the default of consoles and pipes on Windows."""
    for stream in streams:
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(encoding="utf-8")
