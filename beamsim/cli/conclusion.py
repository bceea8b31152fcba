"""How a command ends once its result is saved: warnings, the summary, and the exit code that the result deserves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from beamsim.cli.failures import say
from beamsim.errors import ExitCode, LimitExceededError, Problem, ScenarioError, StoppedEarlyError
from beamsim.outcomes import Outcome, OutcomeKind

if TYPE_CHECKING:
    from beamsim.analyses.result import Result
    from beamsim.cli.interruption import Interruption
    from beamsim.scenario import Scenario

EXIT_CODES = {
    OutcomeKind.COMPLETE: ExitCode.SUCCESS,
    OutcomeKind.STOPPED: ExitCode.NOT_CONVERGED,
    OutcomeKind.UNTRUSTED: ExitCode.NOT_CONVERGED,
    OutcomeKind.FAILED: ExitCode.NOT_CONVERGED,
    OutcomeKind.INTERRUPTED: ExitCode.INTERRUPTED,
}
ResultT = TypeVar("ResultT", bound="Result", contravariant=True)


def exit_code(outcome: Outcome, signal: int = 0) -> int:
    """With what the command ends that gave this outcome, after a signal if its number is given.

    >>> from beamsim.outcomes import COMPLETE
    >>> int(exit_code(COMPLETE)), exit_code(COMPLETE, 15)
    (0, 143)
    """
    return 128 + signal if signal else EXIT_CODES[outcome.kind]


class Printer(Protocol[ResultT]):
    """Prints a result and the files it left, as JSON or as a table."""

    def __call__(self, result: ResultT, files: Sequence[Path], /, *, as_json: bool) -> None:
        """Print it."""


def conclude(
    result: ResultT,
    files: Sequence[Path],
    show: Printer[ResultT],
    *,
    json: bool,
    quiet: bool,
    check: bool = False,
    interrupted: Interruption | None = None,
) -> None:
    """Print the warnings and the result, and end the command with the exit code of its outcome.

    Parameters
    ----------
    files : what was written, the result file first.
    check : whether limits count.
    interrupted : says whether a signal asked for the end.

    Raises
    ------
    StoppedEarlyError, LimitExceededError
    """
    for warning in result.warnings:
        say(f"beamsim: warning: {warning}")
    if json or not quiet:
        show(result, files, as_json=json)
    signal, file = 0 if interrupted is None else interrupted.signal, files[0]
    code = exit_code(result.outcome, signal)
    if signal:
        raise StoppedEarlyError(
            f"interrupted; the partial result is in {file}, and `beamsim plot {file}` draws it", code
        )
    if code != ExitCode.SUCCESS:
        raise StoppedEarlyError(f"{result.status}; the partial result is in {file}", code)
    if check:
        from beamsim.analyses.limits import exceeded_limits

        exceeded = exceeded_limits(result.summary.get("margins", {}))
        if exceeded:
            raise LimitExceededError("; ".join(exceeded))


def need_limits(scenario: Scenario) -> None:
    """Refuse ``--check`` without anything to check."""
    if scenario.limits is None:
        raise ScenarioError(
            Problem("limits", "is missing, so that --check has nothing to check", "add limits: {peak_force: 50 N}")
        )
