"""The command line: load, call, save, print.

Never here: computing, drawing, opening files.
Begin with `app`, then `conclusion`: how a command ends, with which exit code; `beamsim.kinds` lists the results.
"""

from __future__ import annotations

from typing import Any

__all__ = ["main", "program"]


def program() -> None:
    """Entry point of ``beamsim``: `main`, after which the process ends without freeing its objects one by one.

    That takes a twentieth of the processor time of ``beamsim validate``, for memory that the system takes back at once.
    What is to be called at the end of the process is called before. Where a tool that was there first (a debugger, the
    measurement of coverage) wants to be called as well, the process ends as any other.
    """
    import atexit

    status: list[int] = []
    if not atexit._ncallbacks():
        atexit.register(_leave, status)  # called last
    try:
        main()
        status.append(0)
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            status.append(end.code or 0)
        raise


def _leave(status: list[int]) -> None:
    """End the process if its status is known and all that it printed can be written."""
    import os
    import sys

    if status:
        try:
            for stream in (sys.stdout, sys.stderr):
                if stream is not None:
                    stream.flush()
        except (OSError, ValueError):  # closed: the interpreter says so
            return
        os._exit(status[0])


def main() -> None:
    """The command line in a process of any kind; raises `SystemExit` with one of `beamsim.errors.ExitCode`."""
    import gc
    import os
    import signal
    import sys
    import warnings

    gc.set_threshold(500_000, 20, 50)  # modules being imported are no garbage: a run with plots makes fewer objects
    # the matrices are small: more threads would make the linear algebra slower
    for library in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(library, "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # looking for them reads every installed package

    def stop(number: int, _frame: object) -> None:
        sys.exit(128 + number)  # an exception, so that temporary files are removed

    signal.signal(signal.SIGTERM, stop)
    show_notices()
    from beamsim.cli.lighter_imports import lighten_imports

    lighten_imports()
    warnings.showwarning = show_warning
    if sys.platform == "win32":
        use_utf8(sys.stdout, sys.stderr)
    try:
        from beamsim.cli.app import app_of

        app_of(sys.argv[1:])(prog_name="beamsim")
    except KeyboardInterrupt:
        sys.exit(130)


def show_notices() -> None:
    """Print on standard error what the package logs, one line each."""
    import logging
    import sys

    class Notices(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            print(f"beamsim: {record.getMessage()}", file=sys.stderr, flush=True)

    logger = logging.getLogger("beamsim")
    if not logger.handlers:
        logger.addHandler(Notices())
    logger.setLevel(logging.INFO)


def show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: Any = None,
    line: str | None = None,
) -> None:
    """Print a warning of this package in one line, any other with its place in the source."""
    import sys
    import warnings

    from beamsim.errors import CacheWarning

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
