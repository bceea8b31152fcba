"""The application: all commands. What they do is imported when they run, so that ``beamsim --help`` is instant."""

from __future__ import annotations

from typing import Annotated

import typer

from beamsim import __version__
from beamsim.cli import analysis_commands, case_commands, result_commands
from beamsim.cli.failures import guarded

app = typer.Typer(
    name="beamsim",
    help="Exact simulation of structures that vibrate against one-sided elastic stops.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(show: bool) -> None:
    if show:
        print(f"beamsim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    pass


for command in (*analysis_commands.COMMANDS, *result_commands.COMMANDS, *case_commands.COMMANDS):
    app.command()(guarded(command))
