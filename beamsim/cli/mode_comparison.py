"""The command ``compare-modes``, and the texts of its table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.options import Case, Debug, Json, NoPlots, Output, Overrides, Quiet

if TYPE_CHECKING:
    from beamsim.analyses.compare_modes.result import ModeComparison


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("compare-modes")(compare_modes)


@guarded
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
    debug: Debug = False,
) -> None:
    """Pair measured with computed modes by their MAC. Prints frequencies, differences and MAC."""
    from beamsim.analyses.compare_modes.analysis import compare_modes as compare_with
    from beamsim.cli.conclusion import Reporting, concluded, located
    from beamsim.cli.output import output_file
    from beamsim.errors import LimitExceededError
    from beamsim.scenario import load_scenario
    from beamsim.store.shapes import read_shapes

    scenario = load_scenario(case, set_ or ())
    target = output_file(output, f"{case.stem}_modes", ".h5", ".hdf5")
    state: Literal["open", "closed"] = "closed" if closed else "open"
    reporting = Reporting(not no_plots, json, quiet)
    with concluded("compare-modes", target, reporting) as computation, located(scenario):
        computation.result = result = compare_with(scenario, read_shapes(measured, scenario), contacts=state)
    beyond = list(_beyond(result.summary["pairs"], least_mac, most_difference))
    if beyond:
        raise LimitExceededError("; ".join(beyond))


def _beyond(
    pairs: Sequence[Mapping[str, Any]], least_mac: float | None, most_difference: float | None
) -> Iterator[str]:
    """What exceeds the limits, mode by mode; a mode without partner exceeds both."""
    for pair in pairs:
        name = f"mode measured at {pair['measured_hz']:.4g} Hz"
        if not pair["predicted"]:
            if least_mac is not None or most_difference is not None:
                yield f"{name}: no computed mode fits"
            continue
        if least_mac is not None and pair["mac"] < least_mac:
            yield f"{name}: MAC {pair['mac']:.3f} is below {least_mac:g}"
        percent = 100 * pair["difference"]
        if most_difference is not None and abs(percent) > most_difference:
            yield f"{name}: computed {pair['predicted_hz']:.4g} Hz, {percent:+.2f} %, over {most_difference:g} %"


def _pairs(result: ModeComparison, pairs: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    yield "", f"of {result.source}, with those of the structure, contacts {result.contacts}"
    for pair in pairs:
        measured = f"  measured {pair['number']}"
        if not pair["predicted"]:
            yield (
                measured,
                f"{pair['measured_hz']:9.4g} Hz   no computed mode fits, the largest MAC is {pair['mac']:.3f}",
            )
            continue
        yield (
            measured,
            (
                f"{pair['measured_hz']:9.4g} Hz   computed {pair['predicted']:<3d}{pair['predicted_hz']:9.4g} Hz   "
                f"{100 * pair['difference']:+7.2f} %   MAC {pair['mac']:.3f}"
            ),
        )


TEXTS = {"pairs": _pairs, "lowest_mac": lambda _, mac: f"{mac:.3f}"}
