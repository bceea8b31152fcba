"""Common parts of all commands: load the scenario; save, plot and print the result; exit code."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from beamsim.cli.failures import say
from beamsim.errors import ExitCode, LimitExceededError, Problem, ScenarioError, StoppedEarlyError
from beamsim.kinds import KINDS, named
from beamsim.outcomes import Outcome, OutcomeKind

if TYPE_CHECKING:
    from beamsim.analyses.result import Result
    from beamsim.cli.interruption import Interruption
    from beamsim.scenario import Scenario

_Result = TypeVar("_Result", bound="Result")

EXIT_CODES = {
    OutcomeKind.COMPLETE: ExitCode.SUCCESS,
    OutcomeKind.NOTED: ExitCode.SUCCESS,
    OutcomeKind.INCOMPLETE: ExitCode.NOT_CONVERGED,
    OutcomeKind.STOPPED: ExitCode.NOT_CONVERGED,
    OutcomeKind.UNTRUSTED: ExitCode.NOT_CONVERGED,
    OutcomeKind.FAILED: ExitCode.NOT_CONVERGED,
    OutcomeKind.INTERRUPTED: ExitCode.INTERRUPTED,
}


@dataclass(frozen=True)
class Reporting:
    """Options of a command that control its output."""

    plots: bool = True
    json: bool = False
    quiet: bool = False
    check: bool = False  # whether exceeding a limit is an error
    verbose: bool = False  # whether the whole table is printed

    @property
    def progress(self) -> bool:
        """Whether the command says how far it is."""
        return not self.quiet


def prepared(
    command: str, case: Path, overrides: Sequence[str] | None, output: Path | None, *, check: bool = False
) -> tuple[Scenario, Path]:
    """The scenario of a case for a command, and the path of its result file.

    Raises
    ------
    ScenarioError
        If the scenario is invalid, or has no limits to check.
    ResultFileError
        If the result could not be written.
    """
    from beamsim.cli.output import output_file
    from beamsim.scenario import load_scenario

    scenario = load_scenario(case, overrides or (), command=command)
    if check and scenario.limits is None:
        raise ScenarioError(
            Problem("limits", "is missing, so that --check has nothing to check", "add limits: {peak_force: 50 N}")
        )
    return scenario, output_file(output, case.stem, ".h5", ".hdf5")


@dataclass
class Computation:
    """What a command computes, and whether a signal asks it to end."""

    stop: Interruption
    result: Result | None = None


@contextmanager
def concluded(kind: str, target: Path, reporting: Reporting) -> Iterator[Computation]:
    """A block that computes a result; at its end the result is written, plotted and printed, all under signals.

    The block assigns ``result``. Parameters and errors are those of `keep` and `conclude`.
    """
    from beamsim.cli.interruption import interruptible

    with interruptible() as interrupted:
        computation = Computation(interrupted)
        yield computation
        assert computation.result is not None
        result = keep(kind, computation.result, target, reporting)
        conclude(kind, result, target, reporting, interrupted)


@contextmanager
def located(scenario: Scenario) -> Iterator[None]:
    """Add file and line to problems that only the analysis detects."""
    try:
        yield
    except ScenarioError as error:
        raise scenario.located(error) from None


def keep(kind: str, result: _Result, target: Path, reporting: Reporting) -> _Result:
    """Write the result file; returns the result to conclude with, of long histories as it is in the file.

    Raises
    ------
    ResultFileError
        If a file cannot be written.
    """
    from beamsim.cli.progress import progress_of
    from beamsim.fields import RowBlocks
    from beamsim.store.results import open_result, write_result

    with progress_of(f"writing {target.name}", shown=reporting.progress):
        write_result(result, target)
    return open_result(target, kind) if isinstance(vars(result).get("time"), RowBlocks) else result


def conclude(kind: str, result: Result, target: Path, reporting: Reporting, interrupted: Interruption) -> None:
    """Plot and print a result that has been written, and raise the error for the exit code of its outcome.

    Parameters
    ----------
    kind : of the result, one of `beamsim.kinds.KINDS`.
    target : the result file; the plots are written to the same folder.
    interrupted : whether a signal stopped the computation, or came while the file was written (no plots are made then).

    Raises
    ------
    StoppedEarlyError
        If the result is not complete, or a signal left out its plots.
    LimitExceededError
        If a limit is exceeded and limits are checked.
    """
    from beamsim.plots.style import shown_in

    with shown_in(result.scenario.display_scales):
        _conclude(kind, result, target, reporting, interrupted)


def _conclude(kind: str, result: Result, target: Path, reporting: Reporting, interrupted: Interruption) -> None:
    files = [target]
    if reporting.plots and not interrupted():
        files += _plots(kind, result, target, reporting, interrupted)
    left_out = reporting.plots or result.outcome.interrupted
    signal = interrupted.signal if left_out else 0
    first = bool(KINDS[kind].screen) and not (reporting.json or reporting.quiet or reporting.verbose)
    for warning in () if first else result.warnings:
        say(f"beamsim: warning: {warning}")
    if first:
        from beamsim.cli.screens import screen_text

        print(screen_text(result, named(KINDS[kind].screen)(result), [str(file) for file in files]))
    elif reporting.json or not reporting.quiet:
        print_outcome(kind, result, files, as_json=reporting.json)
    code = exit_code(result.outcome, signal)
    if signal:
        what = "partial" if result.outcome.interrupted else "whole"
        text = f"interrupted; the {what} result is in {target}; `beamsim plot {target}` plots it"
        raise StoppedEarlyError(text, code)
    if code != ExitCode.SUCCESS:
        from beamsim.plots.style import scale_for

        raise StoppedEarlyError(f"{result.outcome.displayed(scale_for)}; the partial result is in {target}", code)
    if reporting.check:
        from beamsim.analyses.limits import exceeded_limits

        exceeded = exceeded_limits(result.scenario, result.summary.get("margins", {}))
        if exceeded:
            raise LimitExceededError("; ".join(exceeded))


def _plots(kind: str, result: Result, target: Path, reporting: Reporting, interrupted: Interruption) -> Iterator[Path]:
    """Save the plots, until a signal comes."""
    from beamsim.cli.progress import progress_of
    from beamsim.plots.save import save_figures

    with progress_of(f"plotting {target.name}", shown=reporting.progress):
        for name, figure in named(KINDS[kind].figures)(result).items():
            yield from save_figures({name: figure}, target.parent, target.stem)
            if interrupted():
                return


def exit_code(outcome: Outcome, signal: int = 0) -> int:
    """Exit code of a command with this outcome, or after a signal.

    >>> from beamsim.outcomes import COMPLETE
    >>> int(exit_code(COMPLETE)), exit_code(COMPLETE, 15)
    (0, 143)
    """
    return 128 + signal if signal else EXIT_CODES[outcome.kind]


def print_outcome(kind: str, result: Result, files: Sequence[Path], *, as_json: bool) -> None:
    """Print the result of a command as JSON or as a table, with the list of files written."""
    from beamsim.cli.printing import print_json, print_table
    from beamsim.cli.report import table_rows

    if as_json:
        about = {"status": result.status, "warnings": list(result.warnings)}
        more = {"wall_time_s": result.wall_time_s, "files": [str(path) for path in files]}
        print_json({**about, **result.summary, **more})
        return
    written = (("files" if k == 0 else "", str(path)) for k, path in enumerate(files))
    print_table(result.title, [*table_rows(kind, result), *written])
