"""The command ``sweep``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.multiple_scales import Comparison, refuse_comparison
from beamsim.cli.options import Case, Check, Debug, Json, NoPlots, Output, Overrides, Quiet

Resume = Annotated[bool, typer.Option("--resume", help="Go on with what an interrupted sweep left in the result file.")]


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
        int | None, typer.Option("--workers", min=1, help="Processes for vary (default: one a core).")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler for vary, tcp://host:port.")
    ] = None,
    compare_with: Annotated[
        Comparison | None, typer.Option("--compare", help="Lay the expansion for weak springs over a continuation.")
    ] = None,
    overlay: Annotated[
        list[Path] | None, typer.Option("--overlay", help="Lay a stored sweep over a continuation; may be repeated.")
    ] = None,
    check: Check = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Sweep the excitation's frequency, up and down, at several levels. Writes a result file and plots."""
    from beamsim.cli.conclusion import conclude, need_limits
    from beamsim.cli.output import output_file
    from beamsim.cli.progress import progress_bar
    from beamsim.cli.sweep_report import print_sweep, save_sweep
    from beamsim.scenario import load_scenario

    scenario = load_scenario(case, set_ or ())
    target = output_file(output, case.stem, ".h5", ".hdf5")
    if compare_with is not None:
        refuse_comparison(scenario)
    if overlay and scenario.vary is not None:
        refuse_overlay()
    if scenario.vary is not None:
        from beamsim.cli.designs import StudyOptions, sweep_designs

        sweep_designs(scenario, target, StudyOptions(workers, scheduler, resume, check, not no_plots, json, quiet))
        return
    from beamsim.cli.designs import refuse_study_options

    refuse_study_options(workers=workers, scheduler=scheduler)
    if check:
        need_limits(scenario)
    if scenario.sweep is not None and scenario.sweep.kind == "continuation":
        from beamsim.cli.continuation import ContinuationOptions, continue_response

        continue_response(
            scenario,
            target,
            ContinuationOptions(overlay or (), compare_with is not None, check, resume, not no_plots, json, quiet),
        )
        return
    if overlay:
        refuse_overlay()
    with progress_bar(f"sweeping {case.name}", wanted=not (json or quiet)) as progress:
        from beamsim.analyses.sweep.analysis import sweep as compute
        from beamsim.store.results import write_sweep
        from beamsim.store.sweep import earlier_sweep

        earlier = earlier_sweep(target, scenario) if resume else None
        result = compute(scenario, progress, save=lambda part: write_sweep(part, target), resume=earlier)
    files = save_sweep(result, target, plots=not no_plots)
    conclude(result, files, print_sweep, json=json, quiet=quiet, check=check)


def refuse_overlay() -> None:
    """Refuse to lay a sweep over anything but a continuation, instead of ignoring it."""
    from beamsim.errors import Problem, ScenarioError

    raise ScenarioError(
        Problem(
            "--overlay", "lays a sweep over a curve by continuation", "leave it out, or use sweep.kind: continuation"
        )
    )
