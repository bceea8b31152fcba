"""The commands ``info``, ``plot`` and ``export``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from beamsim.cli.failures import say
from beamsim.kinds import KINDS, named


def print_stored(path: Path, *, as_json: bool) -> None:
    """Print the contents of a result file of any kind.

    Raises
    ------
    ResultFileError
        If the file cannot be read.
    """
    from beamsim.cli.printing import print_json, print_table
    from beamsim.plots.style import shown_in
    from beamsim.store.results import kind_of, open_result

    kind = kind_of(path)
    result = open_result(path)
    if as_json:
        print_json(_about(kind, result))
        return
    with shown_in(result.scenario.display_scales):
        print_table(f"{path}: {result.title}", _rows(kind, result))


def _about(kind: str, result: Any) -> dict[str, Any]:
    """The summary of a result, and what made it."""
    about = {"kind": kind, "title": result.title, "status": result.status, "warnings": list(result.warnings)}
    made = {"created": result.created, "beamsim_version": result.beamsim_version}
    return {**about, **result.summary, "wall_time_s": result.wall_time_s, **made}


def _rows(kind: str, result: Any) -> list[tuple[str, str]]:
    """The printed table, with who wrote the file and its warnings."""
    from beamsim.cli.report import table_rows

    return [
        ("written", f"{result.created} by beamsim {result.beamsim_version} {KINDS[kind].command}"),
        *table_rows(kind, result),
        *(("warning", warning) for warning in result.warnings),
    ]


def plot_stored(path: Path, folder: Path, form: str) -> list[Path]:
    """Plot a result file of any kind; returns the pictures.

    Raises
    ------
    ResultFileError
        If the file cannot be read or a picture cannot be written.
    """
    from beamsim.plots.save import save_figures
    from beamsim.plots.style import shown_in
    from beamsim.store.consistency import open_consistent
    from beamsim.store.results import kind_of

    figures = named(KINDS[kind_of(path)].figures)
    result = open_consistent(path)
    with shown_in(result.scenario.display_scales):
        return save_figures(figures(result), folder, path.stem, form)


def export_format(output: Path | None, form: str | None) -> str:
    """The format of an export: that given, or that of the suffix of the file named by ``-o``.

    Raises
    ------
    ScenarioError
        If there is none, or the two contradict.
    """
    from beamsim.errors import Problem, ScenarioError
    from beamsim.store.export import FORMATS

    suffix = "" if output is None or output.is_dir() else output.suffix.lower().removeprefix(".")
    named = suffix if suffix in FORMATS else None
    if form is None and named is None:
        remedy = f"give one of {', '.join(FORMATS)}, or a file with such a suffix after -o"
        raise ScenarioError(Problem("--format", "is missing", remedy))
    if form is not None and named not in (None, form):
        remedy = f"leave out --format, or name a file that ends with .{form}"
        raise ScenarioError(Problem("--format", f"{form} contradicts -o {output}", remedy))
    return form or named or ""


def export_stored(path: Path, output: Path | None, form: str) -> list[Path]:
    """Write a result file of any kind in another format; returns the files.

    CSV is a folder of tables: ``-o tables.csv`` names the folder ``tables_csv``.

    Raises
    ------
    ResultFileError
        If the file cannot be read, the format does not support it, or a file cannot be written.
    """
    from beamsim.cli.output import output_file, output_folder
    from beamsim.store.consistency import open_consistent
    from beamsim.store.export import export_result, export_target, remark_on_places

    if form == "csv":
        folder, stem = output, path.stem
        if output is not None and output.suffix.lower() == f".{form}" and not output.is_dir():
            folder, stem = output.parent, output.stem
        target = export_target(output_folder(folder, stem), stem, form)
    else:
        target = output_file(output, path.stem, f".{form}")
    open_consistent(path)
    written = export_result(path, target, form)
    remark = remark_on_places(path) if form == "uff" else ""
    if remark:
        say(f"beamsim: note: {remark}")
    return written
