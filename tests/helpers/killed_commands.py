"""A command that kills its process at a given place, as a system that runs out of memory does.

``killed`` starts ``python -m tests.helpers.killed_commands WHERE COUNT ARGUMENTS``. No clock decides when it ends.
"""

import os
import signal
import subprocess
import sys

import psutil


def killed(where: str, count: int, *arguments: object) -> list[int]:
    """Run a command until it kills itself.

    Parameters
    ----------
    where : ``journal``, after so many solved cases; ``file``, before so many files are put in their places.
    count : from 1 on.
    arguments : of the command.

    Returns
    -------
    list
        Numbers of its worker processes at that time.
    """
    child = [sys.executable, "-m", "tests.helpers.killed_commands", where, str(count), *map(str, arguments)]
    places = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(child, check=False, capture_output=True, text=True, env=places)
    assert done.returncode == -signal.SIGKILL, done.stderr
    return [int(number) for number in done.stdout.splitlines()[-1].split()]


def main(where: str, count: int, *arguments: str) -> None:
    """Become the command, with the function at that place replaced."""
    from beamsim.cli import main as command
    from beamsim.store import studies

    def end() -> None:
        nonlocal count
        count -= 1
        if count == 0:
            print("", *(worker.pid for worker in psutil.Process().children(recursive=True)), flush=True)
            os.kill(os.getpid(), signal.SIGKILL)

    def add(self, outcome, real=studies.Journal.add):
        real(self, outcome)
        end()

    def replace(source, target, real=os.replace):
        end()
        real(source, target)

    if where == "journal":
        studies.Journal.add = add
    else:
        os.replace = replace
    sys.argv = ["beamsim", *arguments]
    command()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), *sys.argv[3:])
