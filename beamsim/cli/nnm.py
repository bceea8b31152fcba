"""The command ``nnm``."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.nnm_report import nnm_rows
from beamsim.cli.options import Case, Debug, Json, NoPlots, Output, Overrides, Quiet

if TYPE_CHECKING:
    from beamsim.analyses.nnm.result import NormalModeResult


class Comparison(StrEnum):
    """What ``beamsim nnm --compare`` lays beside the exact mode."""

    multiple_scales = "multiple_scales"
    thesis = "thesis"


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
        list[Comparison] | None,
        typer.Option("--compare", help="Lay another method beside the exact mode; repeatable."),
    ] = None,
    debug: Debug = False,
) -> None:
    """Follow a nonlinear normal mode in stiffness, energy or frequency. Writes a result file and plots."""
    from beamsim.cli.conclusion import conclude
    from beamsim.cli.interruption import interruptible
    from beamsim.cli.output import output_file
    from beamsim.cli.progress import progress_bar
    from beamsim.errors import ScenarioError
    from beamsim.scenario import load_scenario

    scenario = load_scenario(case, set_ or ())
    target = output_file(output, case.stem, ".h5", ".hdf5")
    showing = progress_bar(f"following the mode of {case.name}", wanted=not (json or quiet))
    with interruptible() as interrupted, showing as progress:
        from beamsim.analyses.nnm.analysis import nnm as follow

        try:
            result = follow(scenario, progress, [c.value for c in compare_with or ()], interrupted)
        except ScenarioError as error:
            raise scenario.located(error) from None
    from beamsim.store.nnm import write_nnm

    files = [write_nnm(result, target)]
    if not (no_plots or interrupted()):
        from beamsim.plots.nnm import save_nnm_plots

        files += save_nnm_plots(result, target.parent, target.stem)
    conclude(result, files, print_nnm, json=json, quiet=quiet, interrupted=interrupted)


def print_nnm(result: NormalModeResult, files: Sequence[Path], *, as_json: bool) -> None:
    """Print a nonlinear mode as JSON, or its table with the files written below."""
    from beamsim.cli.report import print_outcome

    print_outcome(result, nnm_rows(result), files, as_json=as_json)
