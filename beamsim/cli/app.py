"""The commands. Everything heavy is imported inside them, so that ``beamsim --help`` is instant."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from beamsim.cli.failures import guarded, say
from beamsim.cli.options import Case, Check, Debug, Json, NoPlots, Output, Overrides, Quiet, Stored, Verbose
from beamsim.kinds import KINDS, TemplateKind, named

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


def _version(show: bool) -> None:
    if show:
        from beamsim.version import __version__

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
    from beamsim.cli.conclusion import Reporting, concluded, located, prepared
    from beamsim.cli.progress import progress_of

    if against is not None:
        from beamsim.trust.reference import against as compare_with
        from beamsim.trust.reference import tolerance_of

        rtol = tolerance_of(against)
    scenario, target = prepared("run", case, set_, output, check=check)
    reporting = Reporting(not no_plots, json, quiet, check, verbose)
    bar = progress_of(
        f"simulating {case.name}", shown=reporting.progress, afterwards=f"evaluating the motion of {case.name}"
    )
    with concluded("run", target, reporting) as computation, bar as progress, located(scenario):
        from beamsim.trust.checked import run as simulate

        result = simulate(scenario, progress, computation.stop)
        if against is not None and not result.outcome.interrupted:
            result = compare_with(result, rtol, computation.stop)
        computation.result = result


@app.command()
@guarded
def validate(
    case: Case,
    set_: Overrides = None,
    sketch: Annotated[
        bool, typer.Option("--sketch", help="Draw the model: bodies, supports, masses, springs and stops.")
    ] = False,
    output: Output = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Check a case without running it. Reports every problem with file, line and remedy."""
    from beamsim.cli.output import output_folder
    from beamsim.cli.printing import print_json
    from beamsim.cli.validation import draw_model, validated
    from beamsim.errors import ScenarioError

    folder = output_folder(output, case.stem) if sketch else None
    try:
        valid = validated(case, set_ or ())
        files = [] if folder is None else draw_model(valid, folder, case.stem)
    except ScenarioError as error:
        if json:
            print_json({"valid": False, "problems": [vars(problem) for problem in error.problems]})
        raise
    for warning in valid.warnings:
        say(f"beamsim: warning: {warning}")
    title = valid.scenario.title
    if json:
        drawn = {"files": [str(file) for file in files]} if sketch else {}
        read = {"imported": {body.body: body.as_json for body in valid.files}} if valid.files else {}
        print_json({"valid": True, "title": title, "warnings": list(valid.warnings), **read, **drawn})
    else:
        found = f"{case}: valid ({title})" if title else f"{case}: valid"
        print(found, *(body.text for body in valid.files), *files, sep="\n")


@app.command()
@guarded
def schema(output: Output = None, json: Json = False, debug: Debug = False) -> None:
    """Print the JSON Schema of scenario files. Editors complete and check them by it."""
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
    """Write a commented scenario to start from. The schema by which editors check and complete it is put beside it."""
    from beamsim.cli.printing import print_json
    from beamsim.cli.template import write_template

    written = write_template(file, kind.value, force=force)
    if json:
        print_json({"files": [str(path) for path in written]})
    else:
        print(f"{file}: written; edit it and `beamsim {kind.command} {file}`")


@app.command()
@guarded
def info(result: Stored, json: Json = False, debug: Debug = False) -> None:
    """Print the contents of a result file."""
    from beamsim.cli.stored import print_stored

    print_stored(result, as_json=json)


@app.command()
@guarded
def plot(
    result: Stored,
    output: Output = None,
    form: Annotated[PictureFormat, typer.Option("--format", help="Picture format.")] = PictureFormat.png,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Plot a result file again without recomputing it."""
    from beamsim.cli.output import output_folder
    from beamsim.cli.printing import print_files
    from beamsim.cli.progress import progress_of
    from beamsim.cli.stored import plot_stored

    with progress_of(f"plotting {result.name}", shown=not (json or quiet)):
        files = plot_stored(result, output_folder(output, result.stem), form.value)
    if json or not quiet:
        print_files(files, as_json=json)


@app.command()
@guarded
def export(
    result: Stored,
    form: Annotated[
        ExportFormat | None,
        typer.Option("--format", help="csv (mostly a folder of tables), uff or mat; default: by the name after -o."),
    ] = None,
    output: Output = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write a result file in another format."""
    from beamsim.cli.printing import print_files
    from beamsim.cli.progress import progress_of
    from beamsim.cli.stored import export_format, export_stored

    chosen = export_format(output, form and form.value)
    with progress_of(f"exporting {result.name}", shown=not (json or quiet)):
        files = export_stored(result, output, chosen)
    if json or not quiet:
        print_files(files, as_json=json)


for module in dict.fromkeys(
    [
        *(kind.commands for kind in KINDS.values() if kind.commands != __name__),
        "beamsim.cli.structures",
        "beamsim.cli.pad",
        "beamsim.cli.warmup",
        "beamsim.cli.html_report",
    ]
):
    named(f"{module}:register")(app)
