"""Arguments and options that several commands share, and what they say about the output."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from beamsim.errors import MOST_HOURS

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
OPTIONS: dict[str, tuple[Any, Any]] = {
    "overrides": (Overrides, None),
    "output": (Output, None),
    "json": (Annotated[bool, typer.Option("--json", help="Print only one JSON object on standard output.")], False),
    "no_plots": (Annotated[bool, typer.Option("--no-plots", help="Write the result file only.")], False),
    "quiet": (Annotated[bool, typer.Option("--quiet", "-q", help="No progress report and no summary.")], False),
    "verbose": (
        Annotated[bool, typer.Option("--verbose", "-v", help="Print everything: the whole table and all notes.")],
        False,
    ),
    "allow_hours": (
        Annotated[
            float,
            typer.Option(
                "--allow-hours",
                metavar="HOURS",
                min=0.0,
                help="End with exit code 2 if it would take longer, as estimated before the start or soon after it.",
            ),
        ],
        MOST_HOURS,
    ),
    "check": (
        Annotated[bool, typer.Option("--check", help="Exit with code 4 if a limit is exceeded, 3 if it may be.")],
        False,
    ),
    "resume": (
        Annotated[
            bool,
            typer.Option("--resume", help="Go on from what an interrupted command has kept; else begin again."),
        ],
        False,
    ),
    "open_files": (
        Annotated[bool, typer.Option("--open-files", help="Open the matrices and records that the result names.")],
        False,
    ),
    "debug": (Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")], False),
}  # fmt: skip
"""By name of a field of `Given`, and ``debug``: what Typer reads, and the default."""


class Given(NamedTuple):
    """What commands are given alike: a file, numbers to replace in it, where to write, and what to print."""

    case: Path = Path()  # scenario or result
    overrides: list[str] | None = None
    output: Path | None = None
    json: bool = False
    no_plots: bool = False
    quiet: bool = False
    verbose: bool = False  # whether the whole table is printed
    allow_hours: float = MOST_HOURS  # longest time that the computation may be estimated to take
    check: bool = False  # whether exceeding a limit is an error
    resume: bool = False  # whether to go on from what an interrupted command has kept
    open_files: bool = False  # whether files that a result names may be opened to build its model again
