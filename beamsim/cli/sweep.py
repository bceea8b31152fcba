"""The command ``sweep``."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.options import Case, Check, Debug, Json, NoPlots, Output, Overrides, Quiet, Verbose
from beamsim.errors import Problem, ScenarioError

if TYPE_CHECKING:
    from beamsim.cli.conclusion import Reporting
    from beamsim.scenario import Scenario


class ComparedExpansion(StrEnum):
    """Methods of ``beamsim sweep --compare``."""

    multiple_scales = "multiple_scales"


_NEEDS_VARY = "leave out the option, or add vary"
_NEEDS_CONTINUATION = "leave it out, or use sweep: {kind: continuation}"
# option -> kinds of sweep with that option; for others place (default: the option), message and remedy
_OPTIONS = {
    "--workers": (("designs",), "vary", "is missing, but --workers applies to its cases", _NEEDS_VARY),
    "--scheduler": (("designs",), "vary", "is missing, but --scheduler applies to its cases", _NEEDS_VARY),
    "--resume": (("designs", "sweep"), "", "continues a swept or stepped sine, not a continuation", "leave it out"),
    "--overlay": (("continuation",), "", "overlays a sweep on a curve by continuation", _NEEDS_CONTINUATION),
    "--compare": (("continuation",), "", "compares with a curve of periodic motions", _NEEDS_CONTINUATION),
}

Resume = Annotated[bool, typer.Option("--resume", help="Continue an interrupted sweep from its result file.")]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("sweep")(sweep)


@guarded
def sweep(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    resume: Resume = False,
    json: Json = False,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", min=1, help="Number of threads (of processes for sweeps) for vary; by default one per core."
        ),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler for vary, tcp://host:port.")
    ] = None,
    compare_with: Annotated[
        ComparedExpansion | None,
        typer.Option("--compare", help="Compare a continuation with the multiple-scales expansion."),
    ] = None,
    overlay: Annotated[
        list[Path] | None, typer.Option("--overlay", help="Overlay a stored sweep on a continuation; repeatable.")
    ] = None,
    check: Check = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> None:
    """Sweep the frequency, or vary numbers of the case. Writes a result file and plots."""
    from beamsim.cli.conclusion import Reporting, prepared

    scenario, target = prepared("sweep", case, set_, output, check=check)
    kind = _kind(scenario)
    given = {"--workers": workers, "--scheduler": scheduler, "--resume": resume, "--overlay": overlay}
    _refuse_others(kind, {**given, "--compare": compare_with})
    reporting = Reporting(not no_plots, json, quiet, check, verbose)
    if kind == "designs":
        from beamsim.cli.designs import StudyOptions, sweep_designs

        sweep_designs(scenario, target, StudyOptions(workers, scheduler, resume), reporting)
    elif kind == "continuation":
        from beamsim.cli.continuation import continue_motions

        continue_motions(scenario, target, reporting, overlay or (), expansion=compare_with is not None)
    else:
        _sweep_sine(scenario, target, reporting, resume=resume)


def _kind(scenario: Scenario) -> str:
    """Kind of the result, as in `beamsim.kinds.KINDS`."""
    if scenario.vary is not None:
        return "designs"
    return "continuation" if scenario.sweep is not None and scenario.sweep.kind == "continuation" else "sweep"


def _refuse_others(kind: str, options: Mapping[str, object]) -> None:
    """Refuse options that do not apply to the kind of sweep.

    Raises
    ------
    ScenarioError
    """
    for name, value in options.items():
        allowed, path, message, remedy = _OPTIONS[name]
        if value and kind not in allowed:
            raise ScenarioError(Problem(path or name, message, remedy))


def _sweep_sine(scenario: Scenario, target: Path, reporting: Reporting, *, resume: bool) -> None:
    """Compute a swept or stepped sine, saving partial results."""
    from beamsim.cli.conclusion import concluded, located
    from beamsim.cli.progress import progress_of

    bar = progress_of("sweeping", shown=reporting.progress)
    with concluded("sweep", target, reporting) as computation, bar as progress, located(scenario):
        from beamsim.store.results import write_sweep
        from beamsim.store.sweep import earlier_sweep
        from beamsim.trust.checked import sweep as compute

        result = compute(
            scenario, progress, stop=computation.stop, save=lambda part: write_sweep(part, target),
            resume=earlier_sweep(target, scenario) if resume else None,
        )  # fmt: skip
        if not result.curves:  # it was interrupted before its first cycle
            raise KeyboardInterrupt
        computation.result = result
