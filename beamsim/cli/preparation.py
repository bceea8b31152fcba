"""What a command begins with: the scenario, and the paths of what it writes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from beamsim.cli.options import Given
from beamsim.errors import Problem, ScenarioError
from beamsim.files import check_writable
from beamsim.scenario import Scenario, load_scenario


def prepared(command: str, given: Given) -> tuple[Scenario, Path]:
    """The scenario of a case for a command, whose section it must have, and the path of its result file.

    Raises
    ------
    ScenarioError
        If the scenario is invalid, or has no limits to check.
    ResultFileError
        If the result could not be written.
    """
    scenario = load_scenario(given.case, given.overrides or (), command=command)
    if given.check and scenario.limits is None:
        raise ScenarioError(
            Problem("limits", "is missing, so that --check has nothing to check", "add limits: {peak_force: 50 N}")
        )
    return scenario, output_file(given.output, given.case.stem, ".h5", ".hdf5")


@contextmanager
def located(scenario: Scenario) -> Iterator[None]:
    """Add file and line to problems that only the analysis detects."""
    try:
        yield
    except ScenarioError as error:
        raise scenario.located(error) from None


def output_file(output: Path | None, stem: str, *suffixes: str) -> Path:
    """File named by ``-o``: the file itself if it has one of the suffixes, else ``stem`` in that folder.

    Raises
    ------
    ResultFileError
        If the file could not be written.
    """
    if output is not None and output.suffix.lower() in suffixes and not output.is_dir():
        path = output
    else:
        path = (output or Path()) / f"{stem}{suffixes[0]}"
    check_writable(path)
    return path


def output_folder(output: Path | None, stem: str) -> Path:
    """Folder named by ``-o``, checked; the current one by default."""
    folder = output or Path()
    check_writable(folder / f"{stem}_")
    return folder
