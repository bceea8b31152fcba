"""The commands that compare with measurements: ``identify-stiffness`` and ``compare``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.options import Case, Debug, Json, NoPlots, Output, Overrides, Quiet, Stored


class DetectorChoice(StrEnum):
    """Values of ``beamsim compare --detector``."""

    peak = "peak"
    fundamental = "fundamental"
    rms = "rms"


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command("identify-stiffness")(identify_stiffness)
    app.command("compare")(compare)


@guarded
def identify_stiffness(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Find stiffness and damping of stops from tests. Parameters of the structure itself can be found with them."""
    from beamsim.cli.conclusion import Reporting, concluded, prepared
    from beamsim.cli.progress import progress_of
    from beamsim.measurements.channels import read_tests

    scenario, target = prepared("identify-stiffness", case, set_, output)
    reporting = Reporting(not no_plots, json, quiet)
    bar = progress_of(f"identifying {case.name}", shown=reporting.progress)
    with concluded("identify-stiffness", target, reporting) as computation, bar as progress:
        from beamsim.analyses.identify.analysis import identify_stiffness as identify

        computation.result = identify(scenario, read_tests(scenario, case.parent), progress, computation.stop)


@guarded
def compare(
    result: Stored,
    measured: Annotated[Path, typer.Argument(metavar="MEASURED", help="Measured signals: .uff, .csv or .h5.")],
    channel: Annotated[str | None, typer.Option("--channel", help="Channel of the measurement.")] = None,
    probe: Annotated[str | None, typer.Option("--probe", help="Probe (or snubber) to compare with.")] = None,
    quantity: Annotated[str | None, typer.Option("--quantity", help="E.g. absolute_acceleration, force.")] = None,
    unit: Annotated[
        str | None, typer.Option("--unit", help="Unit of the measurement, e.g. g, where the file states none.")
    ] = None,
    axis_unit: Annotated[
        str | None, typer.Option("--axis-unit", help="Unit of its times or frequencies, e.g. ms, likewise.")
    ] = None,
    harmonics: Annotated[int, typer.Option("--harmonics", min=1, help="Number of harmonics in the table.")] = 10,
    last: Annotated[
        float | None, typer.Option("--last", min=0.0, help="Use only the last part of the measurement, s.")
    ] = None,
    curve: Annotated[str | None, typer.Option("--curve", help="Curve of a sweep, e.g. up_0.")] = None,
    detector: Annotated[
        DetectorChoice | None, typer.Option("--detector", help="What the measurement of a sweep shows of each cycle.")
    ] = None,
    reference: Annotated[
        str | None, typer.Option("--reference", help="Channel of the excitation, in a time history of a sweep.")
    ] = None,
    begin: Annotated[
        float | None, typer.Option("--begin", help="Time of such a record at which the sweep begins, s.")
    ] = None,
    cycles: Annotated[
        int, typer.Option("--cycles", min=1, help="Track such a record over so many cycles: bandwidth is f / cycles.")
    ] = 1,
    output: Output = None,
    json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Overlay a run or sweep with measured signals. Prints differences of harmonics, phase aligned; of sweeps peaks."""
    from beamsim.analyses.compare.analysis import compare as compare_with
    from beamsim.analyses.compare.sweeps import Tracking, compare_sweep
    from beamsim.analyses.run.result import RunResult
    from beamsim.cli.conclusion import Reporting, concluded
    from beamsim.cli.output import output_file
    from beamsim.cli.progress import progress_of
    from beamsim.measurements.channels import history_named
    from beamsim.store.pairing import pair_channels
    from beamsim.store.results import kind_of, open_run, open_sweep

    swept = open_sweep(result) if kind_of(result) == "sweep" else None
    stored = open_run(result) if swept is None else swept
    target = output_file(output, f"{result.stem}_compare", ".h5", ".hdf5")
    pairs = pair_channels(
        stored, measured, place=probe, quantity=quantity, channel=channel, unit=unit, axis_unit=axis_unit
    )
    reporting = Reporting(not no_plots, json, quiet)
    bar = progress_of(f"comparing with {measured.name}", shown=not (json or quiet))
    with concluded("compare", target, reporting) as computation, bar:
        if swept is not None:
            excitation = None if reference is None else history_named(measured, reference, axis_unit)
            computation.result = compare_sweep(
                swept, pairs, curve=curve, detector=None if detector is None else detector.value,
                tracking=Tracking(begin, excitation, cycles),
            )  # fmt: skip
        else:
            assert isinstance(stored, RunResult)
            _refuse_of_sweeps(curve=curve, detector=detector, reference=reference, begin=begin)
            computation.result = compare_with(stored, pairs, harmonics=harmonics, last=last)


def _refuse_of_sweeps(**options: object) -> None:
    """Refuse options that the comparison of a run does not use.

    Raises
    ------
    ScenarioError
    """
    from beamsim.errors import Problem, ScenarioError

    problems = [
        Problem(f"--{name}", "belongs to sweeps, and this is a run", "leave it out, or give the result of a sweep")
        for name, value in options.items()
        if value is not None
    ]
    if problems:
        raise ScenarioError(problems)
