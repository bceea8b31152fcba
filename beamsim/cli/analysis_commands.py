"""The commands that compute a result: what they are given, each with the import of what does it."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from beamsim.cli.options import (
    Case,
    Check,
    Debug,
    Given,
    Json,
    NoPlots,
    Output,
    Overrides,
    Quiet,
    Reporting,
    Stored,
    Verbose,
)


class ComparedMethod(StrEnum):
    """Methods of ``beamsim nnm --compare``."""

    multiple_scales = "multiple_scales"
    relaxed_minimisation = "relaxed_minimisation"
    thesis = "thesis"  # old name of relaxed_minimisation


def run(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    check: Check = False,
    against: Annotated[
        str | None,
        typer.Option(
            "--against",
            metavar="reference[:RTOL]",
            help="Compare with the reference integrator, at a relative tolerance of 1e-8 or as given.",
        ),
    ] = None,
    debug: Debug = False,
) -> None:
    """Simulate a case. Writes a result file and plots, prints a summary."""
    from beamsim.cli import simulation

    simulation.run(Given(case, set_, output, Reporting(not no_plots, json, quiet, check, verbose)), against)


def sweep(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted sweep from its result file.")
    ] = False,
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
        Literal["multiple_scales"] | None,
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
    from beamsim.cli.sweep import swept

    options = {
        "workers": workers, "scheduler": scheduler, "resume": resume, "overlay": overlay, "compare": compare_with,
    }  # fmt: skip
    swept(Given(case, set_, output, Reporting(not no_plots, json, quiet, check, verbose)), options)


def nnm(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    compare_with: Annotated[
        list[ComparedMethod] | None,
        typer.Option("--compare", help="Compare another method with the exact mode; repeatable."),
    ] = None,
    debug: Debug = False,
) -> None:
    """Follow a nonlinear normal mode. In stiffness factor, energy or frequency. Writes a file and plots."""
    from beamsim.cli.simulation import analysed

    methods = [method.value for method in compare_with or ()]
    given = Given(case, set_, output, Reporting(not no_plots, json, quiet, verbose=verbose))
    analysed("nnm", given, "following the mode of", compare=methods)


def identify_stiffness(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> None:
    """Find stiffness and damping of stops from tests. Parameters of the structure itself can be found with them."""
    from beamsim.cli.comparisons import identify

    identify(Given(case, set_, output, Reporting(not no_plots, json, quiet, verbose=verbose)))


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
        Literal["peak", "fundamental", "rms"] | None,
        typer.Option("--detector", help="What the measurement of a sweep shows of each cycle."),
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
    verbose: Verbose = False,
    debug: Debug = False,
) -> None:
    """Overlay a run or sweep with measured signals. Prints differences of harmonics, phase aligned; of sweeps peaks."""
    from beamsim.cli.comparisons import compare_signals

    pairing = {"channel": channel, "place": probe, "quantity": quantity, "unit": unit, "axis_unit": axis_unit}
    of_runs = {"harmonics": harmonics, "last": last}
    of_sweeps = {"curve": curve, "detector": detector, "reference": reference, "begin": begin, "cycles": cycles}
    given = Given(result, None, output, Reporting(not no_plots, json, quiet, verbose=verbose))
    compare_signals(given, measured, pairing, of_runs, of_sweeps)


def compare_modes(
    case: Case,
    measured: Annotated[Path, typer.Argument(metavar="SHAPES", help="Measured mode shapes: .csv, or .uff dataset 55.")],
    set_: Overrides = None,
    closed: Annotated[bool, typer.Option("--closed", help="Compute the modes with every snubber closed.")] = False,
    least_mac: Annotated[
        float | None,
        typer.Option("--least-mac", min=0.0, max=1.0, help="Exit with code 4 if the MAC of a pair is lower."),
    ] = None,
    most_difference: Annotated[
        float | None,
        typer.Option("--most-difference", min=0.0, help="Exit with code 4 if frequencies differ by more, %."),
    ] = None,
    output: Output = None,
    json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> None:
    """Pair measured with computed modes by their MAC. Prints frequencies, differences and MAC."""
    from beamsim.cli.comparisons import compare_shapes

    given = Given(case, set_, output, Reporting(not no_plots, json, quiet, verbose=verbose))
    limits = {"least_mac": least_mac, "most_difference": most_difference}
    compare_shapes(given, measured, "closed" if closed else "open", limits)


COMMANDS = (run, sweep, nnm, identify_stiffness, compare, compare_modes)
