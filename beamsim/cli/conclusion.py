"""How a command ends once its result is saved: warnings, the summary, and the exit code that the result deserves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from beamsim.cli.failures import say
from beamsim.errors import LimitExceededError, NotTrustedError, Problem, ScenarioError

if TYPE_CHECKING:
    from beamsim.analyses.result import Result
    from beamsim.cli.interruption import Interruption
    from beamsim.scenario import Scenario

ResultT = TypeVar("ResultT", bound="Result", contravariant=True)


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
    """Tell the warnings, show the result and end the command as it deserves.

    Parameters
    ----------
    files : what was written, the result file first.
    check : whether limits count.
    interrupted : says whether a signal asked for the end.

    Raises
    ------
    StoppedEarlyError, NotTrustedError, LimitExceededError
    """
    for warning in result.warnings:
        say(f"beamsim: warning: {warning}")
    if json or not quiet:
        show(result, files, as_json=json)
    if interrupted is not None:
        interrupted.end(files[0])
    if not result.complete:
        raise NotTrustedError(f"{result.status}; the partial result is in {files[0]}")
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
