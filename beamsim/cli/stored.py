"""Commands ``info``, ``plot`` and ``export``."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name

from beamsim.cli.screens import interpretation_text
from beamsim.cli.session import CommandOptions, print_files, print_json, progress_of, say
from beamsim.cli.tables import all_rows, print_table
from beamsim.errors import Problem, ScenarioError
from beamsim.files import output_file, output_folder
from beamsim.kinds import KINDS
from beamsim.measurements.read import ENDINGS_OF_RECORDS
from beamsim.plots.drawing import save_figures
from beamsim.plots.style import use_units
from beamsim.store.export import FORMATS, export_result, export_target, remark_on_places
from beamsim.store.results import kind_of, stored_result


def info(options: CommandOptions) -> None:
    """Print the contents of a result file of any kind: table or summary, and its origin; of a record its channels.

    Raises
    ------
    ResultFileError
        If the file cannot be read.
    ScenarioError
        If a record cannot be read.
    """
    path = options.case
    if path.suffix.lower() in ENDINGS_OF_RECORDS:
        describe_record = resolve_name("beamsim.cli.records:describe_record")
        describe_record(path, json=options.json)
        return
    kind = kind_of(path)
    with stored_result(path) as result, use_units(result.scenario.display_scales):
        if options.json:
            about = {"kind": kind, "title": result.title, "status": result.status, "warnings": list(result.warnings)}
            made = {"created": result.created, "beamsim_version": result.beamsim_version}
            about["understood"] = interpretation_text(result)
            times = {"wall_time_s": result.wall_time_s, "command_processor_time_s": result.command_processor_time_s}
            print_json({**about, **result.summary, **times, **made})
            return
        made_by = ("written", f"{result.created} by beamsim {result.beamsim_version} {KINDS[kind].command}")
        warnings = (("warning", warning) for warning in result.warnings)
        print_table(": ".join(filter(None, (str(path), result.title))), [made_by, *all_rows(kind, result), *warnings])


def plot(options: CommandOptions, form: str) -> None:
    """Plot a result file of any kind, as png, pdf or svg.

    Raises
    ------
    ResultFileError
        If the file cannot be read or a picture cannot be written.
    """
    path = options.case
    folder = output_folder(options.output, path.stem)
    with progress_of(f"plotting {path.name}", shown=not (options.json or options.quiet)):
        figures = resolve_name(KINDS[kind_of(path)].figures)
        with stored_result(path) as result, use_units(result.scenario.display_scales):
            files = save_figures(figures(result), folder, path.stem, form)
    print_files(files, json=options.json, quiet=options.quiet)


def export(options: CommandOptions, form: str | None) -> None:
    """Write a result file of any kind in another format.

    CSV is a folder of tables: ``-o tables.csv`` names the folder ``tables_csv``.

    By default the suffix of the output decides the format.

    Raises
    ------
    ScenarioError
        If the format is missing or contradicts the suffix.
    ResultFileError
        If the file cannot be read, the format does not support it, or a file cannot be written.
    """
    path, output, form = options.case, options.output, _format(options.output, form)
    with progress_of(f"exporting {path.name}", shown=not (options.json or options.quiet)):
        if form == "csv":
            folder, stem = output, path.stem
            if output is not None and output.suffix.lower() == f".{form}" and not output.is_dir():
                folder, stem = output.parent, output.stem
            target = export_target(output_folder(folder, stem), stem, form)
        else:
            target = output_file(output, path.stem, f".{form}")
        written = export_result(path, target, form)
    remark = remark_on_places(path) if form == "uff" else ""
    if remark:
        say(f"beamsim: note: {remark}")
    print_files(written, json=options.json, quiet=options.quiet)


def _format(output: Path | None, form: str | None) -> str:
    """Format of an export, from the option or from the suffix of the ``-o`` file.

    Raises
    ------
    ScenarioError
        If both are missing, or contradict each other.
    """
    suffix = "" if output is None or output.is_dir() else output.suffix.lower().removeprefix(".")
    named = suffix if suffix in FORMATS else None
    if form is None and named is None:
        remedy = f"give one of {', '.join(FORMATS)}, or a file with such a suffix after -o"
        raise ScenarioError(Problem("--format", "is missing", remedy))
    if form is not None and named not in (None, form):
        remedy = f"leave out --format, or name a file that ends with .{form}"
        raise ScenarioError(Problem("--format", f"{form} contradicts -o {output}", remedy))
    return form or named or ""
