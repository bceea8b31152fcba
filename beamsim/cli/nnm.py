"""The command ``nnm``."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamsim.cli.failures import guarded, say
from beamsim.cli.options import Case, Debug, Json, NoPlots, Output, Overrides, Quiet

if TYPE_CHECKING:
    from beamsim.analyses.nnm_results import NormalModeResult
    from beamsim.scenario import Scenario

__all__ = ["register"]

SHOWN = 12  # jumps in a table


class Comparison(StrEnum):
    """What ``beamsim nnm --compare`` lays beside the exact mode."""

    multiple_scales = "multiple_scales"


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
        Comparison | None, typer.Option("--compare", help="Lay the expansion for weak springs beside the exact mode.")
    ] = None,
    debug: Debug = False,
) -> None:
    """Follow a nonlinear normal mode in stiffness, energy or frequency. Writes a result file and plots."""
    from beamsim.cli.output import output_file
    from beamsim.cli.progress import progress_bar
    from beamsim.errors import NotTrustedError
    from beamsim.scenario import load_scenario

    scenario = load_scenario(case, set_ or ())
    target = output_file(output, case.stem, ".h5", ".hdf5")
    if scenario.nnm is not None and scenario.nnm.method == "multiple_scales":
        _expand(scenario, target, json=json, plots=not no_plots, quiet=quiet)
        return
    with progress_bar(f"following the mode of {case.name}", wanted=not (json or quiet)) as progress:
        from beamsim.analyses.nnm import nnm as follow

        result = follow(scenario, progress)
    from beamsim.store.nnm import write_nnm

    files = [write_nnm(result, target)]
    if not no_plots:
        from beamsim.plots.nnm import nnm_figures
        from beamsim.plots.save import save_figures

        files += save_figures(nnm_figures(result), target.parent, target.stem)
    for warning in result.warnings:
        say(f"beamsim: warning: {warning}")
    rows, summary = list(nnm_rows(result)), dict(result.summary)
    if compare_with is not None:
        from beamsim.cli.multiple_scales import compare, expansion_rows, expansion_summary

        comparison, pictures = compare(scenario, target, plots=not no_plots)
        files += pictures
        rows += expansion_rows(comparison)
        summary["multiple_scales"] = expansion_summary(comparison)
    if json or not quiet:
        from beamsim.cli.report import print_result

        print_result(result.title, {**summary, "wall_time_s": result.wall_time_s}, rows, files, as_json=json)
    if not result.complete:
        raise NotTrustedError(f"{result.status}; the partial result is in {target}")


def _expand(scenario: Scenario, target: Path, *, json: bool, plots: bool, quiet: bool) -> None:
    """What ``beamsim nnm`` does with ``method: multiple_scales``: the expansion, and the exact motions it is near."""
    from beamsim.cli.multiple_scales import compare, expansion_rows, expansion_summary

    comparison, files = compare(scenario, target, plots=plots)
    if json or not quiet:
        from beamsim.cli.report import print_result

        print_result(scenario.title, expansion_summary(comparison), expansion_rows(comparison), files, as_json=json)


def nnm_rows(result: NormalModeResult) -> Iterator[tuple[str, str]]:
    """Label and text of every row of the table of a nonlinear mode."""
    s = result.summary
    if not result.complete:
        yield "status", result.status
    what = result.parameter.replace("_", " ")
    yield "backbone", f"mode {s['mode']}, {s['points']} points in {what}, {s['stable_points']} of them stable"
    for name in ("start", "end"):
        end = s[name]
        yield name, f"{what} {end['parameter']:.6g}: {end['frequency_hz']:.6g} Hz, energy {end['energy_j']:.4g} J"
    yield "linear frequency", f"{s['linear_frequency_hz']:.6g} Hz"
    for k, found in enumerate(s["internal_resonances"]):
        yield (
            "" if k else "internal resonances",
            f"{found['ratio']}:1 with mode {found['mode']} at {found['parameter']:.4g}, {found['points']} points",
        )
    if s["jumps"]:
        yield "jumps", ", ".join(f"{j['start']:.4g} to {j['end']:.4g}" for j in s["jumps"][:SHOWN])
    yield "grazings", str(s["grazings"])
    yield "largest residual", f"{s['largest_residual']:.2g}"
    yield "solver", f"half-period shooting, processor time {s['processor_time_s']:.3g} s"
