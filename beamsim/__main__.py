"""``python -m beamsim`` and the command ``beamsim``, which heeds signals before it loads anything else."""

import os
import signal


def main() -> None:
    """Run a command; a signal that comes before it has begun ends it silently, with 130 or 143.

    Raises
    ------
    SystemExit
        As `beamsim.cli.main`.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda received, _: os._exit(128 + received))  # no file is open yet
    from beamsim.cli import main as run_command

    run_command()


if __name__ == "__main__":
    main()
