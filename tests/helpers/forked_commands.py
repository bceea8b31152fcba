"""Commands that a signal reaches after a given processor time, in processes forked from one that has loaded libraries.

`ended` starts ``python -m tests.helpers.forked_commands`` once for many commands, each of which would take longer to
load them than to be interrupted.
"""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple


class Plan(NamedTuple):
    """A command that a signal interrupts."""

    arguments: list[str]
    folder: str
    """In which it runs; it is made."""
    number: int
    """Of the signal."""
    at: float
    """s; processor time of the command at which the signal comes."""


class Ending(NamedTuple):
    """How a command ended."""

    code: int
    errors: str
    """What it printed on standard error."""


def ended(plans: list[Plan], first: list[str]) -> list[Ending]:
    """How interrupted commands end.

    Parameters
    ----------
    plans : in the order in which they run.
    first : arguments of a command that runs before the processes are forked; what it loads they have at once.
    """
    child = [sys.executable, "-m", "tests.helpers.forked_commands", json.dumps([plans, first])]
    done = subprocess.run(child, check=True, capture_output=True, text=True, timeout=1800)
    codes = json.loads(done.stdout)
    return [Ending(code, (Path(plan.folder) / "errors").read_text()) for code, plan in zip(codes, plans, strict=True)]


def main(plans: list[Plan], first: list[str]) -> None:
    """Fork a process for each plan and print the exit codes; in such a process, run the command."""
    import beamsim.cli.app  # noqa: F401 - loaded once for all

    if first:
        from tests.helpers.commands import invoke

        loaded = invoke(*first)
        assert loaded.exit_code == 0, loaded.output
    codes = []
    for plan in plans:
        process = os.fork()
        if not process:
            run(plan)
        codes.append(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))
    print(json.dumps(codes))


def run(plan: Plan) -> None:
    """Become the command of a plan."""
    from beamsim.cli import main as command

    folder = Path(plan.folder)
    folder.mkdir(parents=True)
    os.chdir(folder)
    for stream, name in ((1, "output"), (2, "errors")):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT), stream)
    sys.argv = ["beamsim", *plan.arguments]
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run where it is ignored
    signal.signal(signal.SIGPROF, lambda *_: os.kill(os.getpid(), plan.number))
    signal.setitimer(signal.ITIMER_PROF, plan.at)
    try:
        command()
    finally:  # a signal that comes while Python shuts down meets no handler, and can't interrupt the command any more
        signal.setitimer(signal.ITIMER_PROF, 0)
        sys.stdout.flush()
        sys.stderr.flush()


if __name__ == "__main__":
    given, before = json.loads(sys.argv[1])
    main([Plan(*each) for each in given], before)
