"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Case = Annotated[Path, typer.Argument(metavar="CASE.YAML", help="Scenario file.")]
Stored = Annotated[Path, typer.Argument(metavar="CASE.H5", help="Result file.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Override a value, e.g. beam.thickness='4 mm'; repeatable."),
]


def _not_empty(text: str) -> Path:
    if not text.strip():
        raise typer.BadParameter("it is empty; give a file or a folder, or leave it out for the current one")
    return Path(text)


Output = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="PATH",
        parser=_not_empty,
        help="File or folder for the results (default: current folder).",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print only one JSON object on standard output.")]
NoPlots = Annotated[bool, typer.Option("--no-plots", help="Write the result file only.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress report and no summary.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print everything: the whole table and all notes.")]
Check = Annotated[bool, typer.Option("--check", help="Exit with code 4 if a limit is exceeded.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
