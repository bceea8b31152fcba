"""What all analyses share: compute, save, plot and print the result; exit code."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, TypeVar

from beamsim.cli.screens import understood_of
from beamsim.cli.session import (
    RESULTS,
    CommandOptions,
    Interruption,
    Progress,
    duration,
    interruptible,
    load_case,
    print_json,
    progress_of,
    result_stem,
    say,
    show,
)
from beamsim.errors import Problem, ScenarioError, VerdictError
from beamsim.files import output_file
from beamsim.kinds import KINDS
from beamsim.outcomes import exit_code
from beamsim.plots.drawing import save_figures
from beamsim.plots.style import amount, scale_for, use_units
from beamsim.results.result import Result, used_processor_time
from beamsim.results.values import limits_not_met
from beamsim.scenario import Scenario
from beamsim.store.results import keep_result, refusing_damage
from beamsim.typing import not_none

_Result = TypeVar("_Result", bound=Result)
WORTH_STATING_S = 10.0  # processor time of a command that the first screen states
Compute = Callable[[Progress, Interruption], _Result]
"""Computes a result; called with a function of the completed fraction and one that returns whether to stop."""


def load_for_command(command: str, options: CommandOptions) -> tuple[Scenario, Path]:
    """The scenario of a case for a command, whose section it must have, and the path of its result file.

    Raises
    ------
    ScenarioError
        If the scenario is invalid, or has no limits to check.
    ResultFileError
        If the result could not be written.
    """
    scenario = load_case(options, command)
    if options.check and scenario.limits is None:
        message = "is missing, so that --check has nothing to check"
        raise ScenarioError(Problem("limits", message, "add limits: {peak_force: 50 N}"))
    return scenario, output_file(options.output, result_stem(options), *RESULTS)


def compute_and_save(
    kind: str, target: Path, options: CommandOptions, compute: Compute[_Result], label: str, afterwards: str = ""
) -> _Result:
    """Compute a result, write, plot and print it, all under signals.

    Parameters
    ----------
    kind : of the result, one of `beamsim.kinds.KINDS`.
    target : the result file; the plots are written to the same folder.
    options : to the command: what is written and printed.
    compute : the result.
    label, afterwards : what is done meanwhile, as of `Progress`.

    Returns
    -------
    The result, whose outcome is a success.

    Raises
    ------
    ScenarioError, ResultFileError
        If the scenario or a file cannot be used.
    VerdictError
        As `plot_and_print`.
    """
    with interruptible() as interrupted:
        with progress_of(label, shown=not options.quiet, afterwards=afterwards) as progress:
            result = compute(progress, interrupted)
        with progress_of(f"writing {target.name}", shown=not options.quiet):
            result = replace(result, command_processor_time_s=used_processor_time())
            written = keep_result(result, target, resumed=options.resume)
        with refusing_damage(target) if options.resume else nullcontext():  # parts of it come from a file
            plot_and_print(kind, result, written, options, interrupted)
    return result


def plot_and_print(
    kind: str,
    result: Result,
    target: Path,
    options: CommandOptions,
    interrupted: Interruption,
    others: Iterable[Path] = (),
) -> None:
    """Plot and print a result that has been written, and raise the error for the exit code of its outcome.

    Parameters
    ----------
    kind, options : as of `compute_and_save`.
    result : that was written.
    target : file to which it was written.
    interrupted : whether a signal stopped the computation, or came while the file was written (no plots are made then).
    others : files that were written with it.

    Raises
    ------
    VerdictError
        If the result is not complete or reliable, a signal left out its plots, or a limit that is checked is not met.
    """
    with use_units(result.scenario.display_scales):
        files = [target, *others]
        if not options.no_plots and not interrupted():
            with progress_of(f"plotting {target.name}", shown=not options.quiet):
                pictures = resolve_name(KINDS[kind].figures)(result)
                files += save_figures(pictures, target.parent, target.stem, stop=interrupted)
        used = used_processor_time()
        result = replace(result, command_processor_time_s=used)
        if not (options.json or options.quiet or options.verbose):
            show(resolve_name(KINDS[kind].screen)(result).text(result, [str(file) for file in files]))
            if used >= WORTH_STATING_S:
                show(f"processor time of the command {amount(used, 's')}, with its workers")
        else:
            _print_all(kind, result, files, options)
        left_out = not options.no_plots or result.outcome.interrupted
        signal = interrupted.signal if left_out else 0
        checked_limits = result.summary.get("margins", {}) if options.check else {}
        code = exit_code(result.outcome, [item["verdict"] for item in checked_limits.values()], signal)
        if signal or code:
            unmet = [] if signal else limits_not_met(result.scenario, checked_limits)
            raise VerdictError("; ".join([*_outcome_lines(result, target, interrupted=bool(signal)), *unmet]), code)


def _print_all(kind: str, result: Result, files: Sequence[Path], options: CommandOptions) -> None:
    """Print the warnings of a result, and its summary as JSON or as a table, or neither."""
    for warning in result.warnings:
        say(f"beamsim: warning: {warning}")
    if options.json:
        about = {"status": result.status, "understood": understood_of(result), "warnings": list(result.warnings)}
        times = {"wall_time_s": result.wall_time_s, "command_processor_time_s": result.command_processor_time_s}
        print_json({**about, **result.summary, **times, "files": [str(path) for path in files]})
    elif not options.quiet:
        from beamsim.cli.tables import all_rows, print_table  # which the first screen does without

        written = (("files" if k == 0 else "", str(path)) for k, path in enumerate(files))
        print_table(result.title, [*all_rows(kind, result), *written])


def _outcome_lines(result: Result, target: Path, *, interrupted: bool) -> Iterator[str]:
    """How the computation of a result ended, and where it is; nothing of a complete one."""
    if interrupted:
        what = "partial" if result.outcome.interrupted else "whole"
        yield f"interrupted; the {what} result is in {target}; `beamsim plot {target}` plots it"
    elif not result.complete:
        what = "partial result" if result.outcome.cut_short else "result"
        yield f"{result.outcome.in_display_units(scale_for)}; the {what} is in {target}"


def run_analysis(
    kind: str, options: CommandOptions, doing: str,
    then: Callable[[Any, Interruption], Result] = lambda result, _: result,
    **analysis_options: Any,
) -> None:  # fmt: skip
    """Compute the result of a kind whose command has the same name.

    Parameters
    ----------
    kind : of the result.
    options : to the command.
    doing : what is done with the case meanwhile, "simulating".
    then : makes the result that is kept of the one computed.
    analysis_options : of the analysis.

    Raises
    ------
    BeamsimError
        As `compute_and_save`.
    """
    scenario, target = load_for_command(kind, options)

    def computed(progress: Progress, stop: Interruption) -> Result:
        with scenario.locating():
            return then(
                resolve_name(KINDS[kind].analysis)(scenario, progress=progress, stop=stop, **analysis_options), stop
            )

    name = options.case.name
    label = f"{doing} {name}"
    swept = [part for _, part in scenario.excitation.items if part.kind == "swept_sine"]
    if kind == "run" and swept:  # of whose cycles the time depends
        marched = not_none(scenario.run).duration
        label += f" ({max(part.cycles_in(marched) for part in swept):.0f} cycles)"
        if not options.quiet:
            _announce_time(label, scenario)
    compute_and_save(kind, target, options, computed, label, f"evaluating the motion of {name}")


def _announce_time(label: str, scenario: Scenario) -> None:
    """Say about how long a swept sine takes, where that is worth knowing."""
    from beamsim.trust.expected_time import expected_time

    with scenario.locating():
        seconds = expected_time(scenario)
    if seconds is not None:
        say(f"beamsim: {label} takes about {duration(seconds)} of processor time")
