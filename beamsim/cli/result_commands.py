"""The commands about result files: what they are given, each with the import of what does it."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from beamsim.cli.options import Debug, Json, Output, Quiet, Stored


def info(result: Stored, json: Json = False, debug: Debug = False) -> None:
    """Print the contents of a result file."""
    from beamsim.cli import stored

    stored.info(result, as_json=json)


def plot(
    result: Stored,
    output: Output = None,
    form: Annotated[Literal["png", "pdf", "svg"], typer.Option("--format", help="Picture format.")] = "png",
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Plot a result file again without recomputing it."""
    from beamsim.cli import stored

    stored.plot(result, output, form, json=json, quiet=quiet)


def export(
    result: Stored,
    form: Annotated[
        Literal["csv", "uff", "mat"] | None,
        typer.Option("--format", help="csv (mostly a folder of tables), uff or mat; default: by the name after -o."),
    ] = None,
    output: Output = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write a result file in another format."""
    from beamsim.cli import stored

    stored.export(result, output, form, json=json, quiet=quiet)


def report(
    result: Stored,
    output: Output = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write one HTML file about a result. It has verdict, model, numbers, plots, animation, checks and scenario."""
    from beamsim.cli import html_report

    html_report.report(result, output, json=json, quiet=quiet)


def animate(
    result: Stored,
    output: Output = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write the motion of a result as a GIF and as HTML. It is slow around contact."""
    from beamsim.cli import html_report

    html_report.animate(result, output, json=json, quiet=quiet)


COMMANDS = (info, plot, export, report, animate)
