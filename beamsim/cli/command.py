"""Steps that all analyses share: compute, save, plot, print, and set the exit code."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, TypeVar

from beamsim.cli.screens import interpretation_text
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
WORTH_STATING_S = 10.0  # processor time of a command from which the first screen states it
Compute = Callable[[Progress, Interruption], _Result]
"""Function that computes a result, from a progress function and a stop function."""


def load_for_command(command: str, options: CommandOptions) -> tuple[Scenario, Path]:
    """Load the scenario of a command, check that it has the command's section, and return the path of the result file.

    Raises
    ------
    ScenarioError
        If the scenario is invalid, or has no limits to check.
    ResultFileError
        If the result could not be written later.
    """
    scenario = load_case(options, command)
    if options.check and scenario.limits is None:
        message = "is missing, so that --check has nothing to check"
        raise ScenarioError(Problem("limits", message, "add limits: {peak_force: 50 N}"))
    return scenario, output_file(options.output, result_stem(options), *RESULTS)


def compute_and_save(
    kind: str, target: Path, options: CommandOptions, compute: Compute[_Result], label: str, later_label: str = ""
) -> _Result:
    """Compute a result, then write, plot and print it, with handling of signals.

    Parameters
    ----------
    kind : kind of the result, from `beamsim.kinds.KINDS`.
    target : the result file; the plots are written to the same folder.
    options : shared options of commands.
    compute : function that computes the result.
    label, later_label : texts of the progress report, see `Progress`.

    Returns
    -------
    The result, whose outcome is a success.

    Raises
    ------
    ScenarioError, ResultFileError
        If the scenario or a file cannot be used.
    VerdictError
        See `plot_and_print`.
    """
    with interruptible() as interrupted:
        with progress_of(label, shown=not options.quiet, later_label=later_label) as progress:
            result = compute(progress, interrupted)
        with progress_of(f"writing {target.name}", shown=not options.quiet):
            result = replace(result, command_processor_time_s=used_processor_time())
            written = keep_result(result, target, resumed=options.resume)
        with refusing_damage(target) if options.resume else nullcontext():  # the file provides parts of the result
            plot_and_print(kind, result, written, options, interrupted)
    return result


def plot_and_print(
    kind: str, result: Result, target: Path, options: CommandOptions, interrupted: Interruption,
    others: Iterable[Path] = (),
) -> None:  # fmt: skip
    """Plot and print a written result, and raise an error for the exit code of its outcome.

    Parameters
    ----------
    kind, options : see `compute_and_save`.
    result : the written result.
    target : its file.
    interrupted : stop flag; if it is set, no plots are made.
    others : other files that were written.

    Raises
    ------
    VerdictError
        If the result is incomplete or unreliable, a signal prevented its plots, or a checked limit is not met.
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
    """Print the warnings of a result, and its summary as JSON, as a table, or not at all."""
    for warning in result.warnings:
        say(f"beamsim: warning: {warning}")
    if options.json:
        about = {"status": result.status, "understood": interpretation_text(result), "warnings": list(result.warnings)}
        times = {"wall_time_s": result.wall_time_s, "command_processor_time_s": result.command_processor_time_s}
        print_json({**about, **result.summary, **times, "files": [str(path) for path in files]})
    elif not options.quiet:
        from beamsim.cli.tables import all_rows, print_table  # which the first screen does without

        written = (("files" if k == 0 else "", str(path)) for k, path in enumerate(files))
        print_table(result.title, [*all_rows(kind, result), *written])


def _outcome_lines(result: Result, target: Path, *, interrupted: bool) -> Iterator[str]:
    """How the computation ended and where its result is; empty for a complete result."""
    if interrupted:
        what = "partial" if result.outcome.interrupted else "whole"
        yield f"interrupted; the {what} result is in {target}; `beamsim plot {target}` plots it"
    elif not result.complete:
        what = "partial result" if result.outcome.cut_short else "result"
        yield f"{result.outcome.in_display_units(scale_for)}; the {what} is in {target}"


def run_analysis(
    kind: str, options: CommandOptions, activity: str,
    finish: Callable[[Any, Interruption], Result] = lambda result, _: result,
    **analysis_options: Any,
) -> None:  # fmt: skip
    """Run the analysis whose command has the name of the kind.

    Parameters
    ----------
    kind : kind of the result.
    options : shared options.
    activity : verb for the progress report, such as "simulating".
    finish : function that derives the stored result from the computed one.
    analysis_options : arguments of the analysis.

    Raises
    ------
    BeamsimError
        See `compute_and_save`.
    """
    scenario, target = load_for_command(kind, options)

    def computed(progress: Progress, stop: Interruption) -> Result:
        with scenario.locating():
            return finish(
                resolve_name(KINDS[kind].analysis)(scenario, progress=progress, stop=stop, **analysis_options), stop
            )

    name = options.case.name
    label = f"{activity} {name}"
    swept = [part for _, part in scenario.excitation.items if part.kind == "swept_sine"]
    if kind == "run" and swept:  # whose number of cycles determines the time
        marched = not_none(scenario.run).duration
        label += f" ({max(part.cycles_in(marched) for part in swept):.0f} cycles)"
        if not options.quiet:
            _announce_time(label, scenario)
    compute_and_save(kind, target, options, computed, label, f"evaluating the motion of {name}")


def _announce_time(label: str, scenario: Scenario) -> None:
    """Announce the expected time of a swept sine, if it is long."""
    from beamsim.trust.expected_time import expected_time

    with scenario.locating():
        seconds = expected_time(scenario)
    if seconds is not None:
        say(f"beamsim: {label} takes about {duration(seconds)} of processor time")
