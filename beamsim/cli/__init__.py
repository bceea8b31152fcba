"""The command line: load, call, save, print.

Never here: computing, drawing, opening files.
Begin with `app`, the commands; `failures` has the exit codes.
"""

from __future__ import annotations

__all__ = ["main"]


def main() -> None:
    """Entry point of ``beamsim``; ends the process with the exit code of `beamsim.cli.failures`."""
    import os
    import signal
    import sys

    # the matrices are small: threads of the linear algebra would cost more than they give
    for library in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(library, "1")

    def stop(number: int, _frame: object) -> None:
        sys.exit(128 + number)  # an exception, so that temporary files are removed

    signal.signal(signal.SIGTERM, stop)
    try:
        from beamsim.cli.app import app

        app(prog_name="beamsim")
    except KeyboardInterrupt:
        sys.exit(130)
