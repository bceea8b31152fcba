"""The commands. Everything heavy is imported inside them, so that ``beamsim --help`` is instant."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from beamsim.cli.designs import Check, check_limits, need_limits
from beamsim.cli.failures import guarded, say
from beamsim.cli.identification import register as register_identification
from beamsim.cli.nnm import register as register_nnm
from beamsim.cli.sweep import register as register_sweep

__all__ = ["app"]

app = typer.Typer(
    name="beamsim",
    help="Exact simulation of structures that vibrate against one-sided elastic stops.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class ExportFormat(StrEnum):
    """Formats of ``beamsim export``."""

    csv = "csv"
    uff = "uff"
    mat = "mat"


class PictureFormat(StrEnum):
    """Formats of ``beamsim plot``."""

    png = "png"
    pdf = "pdf"
    svg = "svg"


class TemplateKind(StrEnum):
    """Templates of ``beamsim new``."""

    beam = "beam"
    chain = "chain"


Case = Annotated[Path, typer.Argument(metavar="CASE.YAML", help="Scenario file.")]
Stored = Annotated[Path, typer.Argument(metavar="CASE.H5", help="Result file of `beamsim run`.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Override a value, e.g. beam.thickness='4 mm'; repeatable."),
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="PATH", help="File or folder for the results (default: current folder)."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else on standard output.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


def _version(wanted: bool) -> None:
    if wanted:
        from beamsim import __version__

        print(f"beamsim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    pass


@app.command()
@guarded
def run(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    json: Json = False,
    no_plots: Annotated[bool, typer.Option("--no-plots", help="Write the result file only.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no summary.")] = False,
    check: Check = False,
    debug: Debug = False,
) -> None:
    """Simulate a case. Writes a result file and plots, prints a summary."""
    from beamsim.cli.output import output_file, save_run
    from beamsim.cli.progress import progress_bar
    from beamsim.cli.report import print_run
    from beamsim.errors import NotTrustedError
    from beamsim.scenario import load_scenario

    scenario = load_scenario(case, set_ or ())
    if check:
        need_limits(scenario)
    target = output_file(output, case.stem, ".h5", ".hdf5")
    with progress_bar(f"simulating {case.name}", wanted=not (json or quiet)) as progress:
        from beamsim.analyses.run import run as simulate

        result = simulate(scenario, progress)
    files = save_run(result, target, plots=not no_plots)
    for warning in result.warnings:
        say(f"beamsim: warning: {warning}")
    if json or not quiet:
        print_run(result, files, as_json=json)
    if not result.complete:
        raise NotTrustedError(f"{result.status}; the partial result is in {target}")
    if check:
        check_limits(result.summary.get("margins", {}))


@app.command()
@guarded
def validate(case: Case, set_: Overrides = None, json: Json = False, debug: Debug = False) -> None:
    """Check a case without running it. Reports every problem with its place and a remedy."""
    from beamsim.cli.report import print_json
    from beamsim.cli.validation import validated
    from beamsim.errors import ScenarioError

    try:
        title, warnings = validated(case, set_ or ())
    except ScenarioError as error:
        if json:
            print_json({"valid": False, "problems": [vars(problem) for problem in error.problems]})
        raise
    for warning in warnings:
        say(f"beamsim: warning: {warning}")
    if json:
        print_json({"valid": True, "title": title, "warnings": list(warnings)})
    else:
        print(f"{case}: valid ({title})")


@app.command()
@guarded
def schema(output: Output = None, json: Json = False, debug: Debug = False) -> None:
    """Print the JSON Schema of scenario files. Editors complete and check with it."""
    from beamsim.cli.output import output_file
    from beamsim.cli.validation import schema_text

    if output is None:
        print(schema_text())
        return
    from beamsim.files import replacing

    with replacing(output_file(output, "beamsim.schema", ".json")) as temporary:
        temporary.write_text(schema_text() + "\n", encoding="utf-8")


@app.command()
@guarded
def new(
    file: Annotated[Path, typer.Argument(metavar="CASE.YAML", help="File to write.")] = Path("case.yaml"),
    kind: Annotated[TemplateKind, typer.Option("--kind", help="What to simulate.")] = TemplateKind.beam,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write a commented scenario to start from."""
    from beamsim.cli.report import print_json
    from beamsim.cli.template import write_template

    write_template(file, kind.value, force=force)
    if json:
        print_json({"files": [str(file)]})
    else:
        print(f"{file}: written; edit it and `beamsim run {file}`")


@app.command()
@guarded
def info(result: Stored, json: Json = False, debug: Debug = False) -> None:
    """Print what a result file holds."""
    from beamsim.cli.report import print_json, print_table, summary_rows
    from beamsim.cli.stored import print_other
    from beamsim.store.read import open_result

    if print_other(result, as_json=json):
        return
    stored = open_result(result)
    if json:
        print_json({**stored.summary, "wall_time_s": stored.wall_time_s, "created": stored.created})
        return
    rows = [
        ("written", f"{stored.created} by beamsim {stored.beamsim_version} run"),
        ("time", f"{stored.time[0]:g} to {stored.time[-1]:g} s, {stored.time.size} samples"),
        *summary_rows(stored),
        *(("warning", warning) for warning in stored.warnings),
    ]
    print_table(f"{result}: {stored.title}", rows)


@app.command()
@guarded
def plot(
    result: Stored,
    output: Output = None,
    form: Annotated[PictureFormat, typer.Option("--format", help="Kind of picture.")] = PictureFormat.png,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Draw the plots of a result file again. Nothing is recomputed."""
    from beamsim.cli.output import output_folder
    from beamsim.cli.report import print_json
    from beamsim.cli.stored import plot_other
    from beamsim.plots.run import save_run_plots
    from beamsim.store.read import open_result

    folder = output_folder(output, result.stem)
    files = plot_other(result, folder, form.value) or save_run_plots(
        open_result(result), folder, result.stem, form.value
    )
    if json:
        print_json({"files": [str(path) for path in files]})
    else:
        print(*files, sep="\n")


@app.command()
@guarded
def export(
    result: Stored,
    form: Annotated[ExportFormat, typer.Option("--format", help="csv (a folder of tables), uff or mat.")],
    output: Output = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write a result file in another format."""
    from beamsim.cli.designs import export_designs_table
    from beamsim.cli.output import output_file, output_folder
    from beamsim.cli.report import print_json
    from beamsim.cli.stored import holds_designs
    from beamsim.store.export import export_run, export_target
    from beamsim.store.read import open_result

    if holds_designs(result):
        files = [export_designs_table(result, output, form.value)]
    else:
        stored = open_result(result)
        if form is ExportFormat.csv:
            target = export_target(output_folder(output, result.stem), result.stem, form.value)
        else:
            target = output_file(output, result.stem, f".{form.value}")
        files = export_run(stored, target, form.value)
    if json:
        print_json({"files": [str(path) for path in files]})
    else:
        print(*files, sep="\n")


register_identification(app)
register_sweep(app)
register_nnm(app)
