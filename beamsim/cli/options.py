"""Arguments and options that several commands share, and what they say about the output."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

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
Check = Annotated[bool, typer.Option("--check", help="Exit with code 4 if a limit is exceeded, 3 if it may be.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


class Reporting(NamedTuple):
    """Options of a command that control its output."""

    plots: bool = True
    json: bool = False
    quiet: bool = False
    check: bool = False  # whether exceeding a limit is an error
    verbose: bool = False  # whether the whole table is printed

    @property
    def progress(self) -> bool:
        """Whether the command says how far it is."""
        return not self.quiet


class Given(NamedTuple):
    """What a command that computes is given: a case with its overrides, where to write, and what to print."""

    case: Path
    overrides: list[str] | None
    output: Path | None
    reporting: Reporting
