"""The command ``nnm``."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.options import Case, Debug, Json, NoPlots, Output, Overrides, Quiet


class ComparedMethod(StrEnum):
    """Methods of ``beamsim nnm --compare``."""

    multiple_scales = "multiple_scales"
    relaxed_minimisation = "relaxed_minimisation"
    thesis = "thesis"  # old name of relaxed_minimisation


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("nnm")(nnm)


@guarded
def nnm(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    compare_with: Annotated[
        list[ComparedMethod] | None,
        typer.Option("--compare", help="Compare another method with the exact mode; repeatable."),
    ] = None,
    debug: Debug = False,
) -> None:
    """Follow a nonlinear normal mode. In stiffness factor, energy or frequency. Writes a file and plots."""
    from beamsim.cli.conclusion import Reporting, concluded, located, prepared
    from beamsim.cli.progress import progress_of

    scenario, target = prepared("nnm", case, set_, output)
    reporting = Reporting(not no_plots, json, quiet)
    bar = progress_of(f"following the mode of {case.name}", shown=reporting.progress)
    with concluded("nnm", target, reporting) as computation, bar as progress, located(scenario):
        from beamsim.trust.checked import nnm as follow

        computation.result = follow(scenario, progress, [c.value for c in compare_with or ()], computation.stop)
