"""Each kind of result: its writer, table and plots, by name; ``info``, ``plot`` and ``export`` of a file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from beamsim.analyses.result import Result

Row = tuple[str, str]


class Stored(NamedTuple):
    """Where the functions for one kind of result are, as ``module:name``; each is imported when it is needed."""

    write: str  # of a result and a path
    rows: str  # of a result: labels and texts of its table
    plots: str  # of a result, a folder, a stem and a format: the files written


# one entry a kind, under the names of beamsim.store.stored.KINDS
TABLE = {
    "run": Stored(
        "beamsim.store.results:write_run", "beamsim.cli.report:run_rows", "beamsim.plots.run:save_run_plots"
    ),
    "sweep": Stored(
        "beamsim.store.results:write_sweep", "beamsim.cli.sweep_report:sweep_rows",
        "beamsim.plots.sweep:save_sweep_plots",
    ),
    "continuation": Stored(
        "beamsim.store.results:write_frequency_response", "beamsim.cli.continuation:response_rows",
        "beamsim.plots.continuation:save_response_plots",
    ),
    "designs": Stored(
        "beamsim.store.designs:write_designs", "beamsim.cli.designs:design_rows",
        "beamsim.plots.designs:save_design_plots",
    ),
    "identify-stiffness": Stored(
        "beamsim.store.results:write_identification", "beamsim.cli.identification_report:identification_rows",
        "beamsim.plots.identification:save_identification_plots",
    ),
    "nnm": Stored(
        "beamsim.store.results:write_nnm", "beamsim.cli.nnm_report:nnm_rows", "beamsim.plots.nnm:save_nnm_plots"
    ),
    "compare": Stored(
        "beamsim.store.results:write_comparison", "beamsim.cli.identification_report:comparison_rows",
        "beamsim.plots.comparison:save_comparison_plots",
    ),
}  # fmt: skip


def named(place: str) -> Callable[..., Any]:
    """The function at ``module:name``."""
    module, _, name = place.partition(":")
    found: Callable[..., Any] = getattr(import_module(module), name)
    return found


def table_rows(kind: str, result: Result) -> Iterator[Row]:
    """Label and text of every row of a result's table: the status first where it is not complete."""
    if not result.complete:
        yield "status", result.status
    yield from named(TABLE[kind].rows)(result)


def print_stored(path: Path, *, as_json: bool) -> None:
    """Print what a result file of any kind holds.

    Raises
    ------
    ResultFileError
        When the file cannot be read.
    """
    from beamsim.cli.report import print_json, print_table
    from beamsim.store.results import open_result
    from beamsim.store.stored import KINDS, kind_of

    kind = kind_of(path)
    result = open_result(path)
    if as_json:
        about = {"kind": kind, "title": result.title, "status": result.status, "warnings": list(result.warnings)}
        made = {"created": result.created, "beamsim_version": result.beamsim_version}
        print_json({**about, **result.summary, "wall_time_s": result.wall_time_s, **made})
        return
    rows = [
        ("written", f"{result.created} by beamsim {result.beamsim_version} {KINDS[kind].command}"),
        *table_rows(kind, result),
        *(("warning", warning) for warning in result.warnings),
    ]
    print_table(f"{path}: {result.title}", rows)


def plot_stored(path: Path, folder: Path, form: str) -> list[Path]:
    """Draw a result file of any kind; returns the pictures.

    Raises
    ------
    ResultFileError
        When the file cannot be read or a picture cannot be written.
    """
    from beamsim.store.results import open_result
    from beamsim.store.stored import kind_of

    draw = named(TABLE[kind_of(path)].plots)
    return list(draw(open_result(path), folder, path.stem, form))


def export_stored(path: Path, output: Path | None, form: str) -> list[Path]:
    """Write a result file of any kind in another format; returns the files.

    Raises
    ------
    ResultFileError
        When the file cannot be read, the format cannot hold it, or a file cannot be written.
    """
    from beamsim.cli.output import output_file, output_folder
    from beamsim.store.export import export_result, export_target, is_folder
    from beamsim.store.stored import kind_of

    if is_folder(kind_of(path), form):
        target = export_target(output_folder(output, path.stem), path.stem, form)
    else:
        target = output_file(output, path.stem, f".{form}")
    return export_result(path, target, form)
