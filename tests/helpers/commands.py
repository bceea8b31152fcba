"""Commands of ``beamsim`` in this process."""

from click.testing import Result
from typer.testing import CliRunner

from beamsim.cli.app import app


def invoke(*arguments: object) -> Result:
    """What a command with these arguments prints and ends with."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])
