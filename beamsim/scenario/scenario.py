"""A complete scenario: the content of the YAML file as it was written, checked and in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any, Self

from pydantic_core import PydanticCustomError

from beamsim.errors import ScenarioError
from beamsim.scenario.base import plain, refused, walk
from beamsim.scenario.checks import problems
from beamsim.scenario.input_files import Record, SolvedFiles, records_of
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.tree import dumped, locate, located_problem
from beamsim.scenario.warnings import doubts


class Scenario(ScenarioParts):
    """A structure with its one-sided stops, its excitation and the requested analyses."""

    # The origin is not part of the scenario: equality and YAML ignore it.
    _source: str = "scenario"
    _text: Any = None  # what was read, see `beamsim.scenario.tree`
    _left_out: tuple[str, ...] = ()
    _solved: SolvedFiles | None = None  # of a result

    def check(self) -> None:
        """Check the parts against each other."""
        if found := problems(self):
            raise ScenarioError(found)

    def rechecked(self) -> Self:
        """Itself, when all of its parts pass their checks with numbers that were replaced.

        Raises
        ------
        ScenarioError
            If they do not.
        """
        for path, part in walk(self):
            try:
                part.check()
            except PydanticCustomError as error:
                raise ScenarioError(refused(error, path)) from None
        return self

    @property
    def _values(self) -> tuple[Any, ...]:
        """What makes scenarios equal: 270 mm is 0.27 m, in whatever unit it is shown."""
        return tuple(getattr(self, name) for name in self.attributes().values() if name != "units")

    @property
    def display_scales(self) -> dict[str, tuple[float, str]]:
        """By SI unit the factor and the unit of tables and plots, where one is chosen or written."""
        return {} if self.units is None else self.units.scales

    @property
    def source(self) -> str:
        """Name for output files: the scenario file's stem, or ``scenario``."""
        return self._source

    def with_source(self, source: str, text: Any = None, warnings: tuple[str, ...] = ()) -> Scenario:
        """Return the same scenario with another name for output files, and the tree and warnings from reading it."""
        copy = self.model_copy()
        copy._source = source
        copy._text = text
        copy._left_out = warnings
        return copy

    def with_solved_files(self, files: SolvedFiles) -> Scenario:
        """Return the same scenario as that of a result, whose files are looked for and compared."""
        copy = self.model_copy()
        copy._solved = files
        return copy

    def file_records(self, since: float) -> Mapping[str, Record]:
        """What the files hold that the scenario names, see `beamsim.scenario.input_files.records_of`."""
        return records_of(self, since) if self._solved is None else self._solved.records

    def located(self, error: ScenarioError) -> ScenarioError:
        """Return the error with the file and line of every path, for problems that only the model could find."""
        if self._text is None or self._solved is not None:  # nobody has seen the text in a result file
            return error
        root = self._text
        return ScenarioError([located_problem(root, problem) for problem in error.problems])

    def folder_of(self, *path: str | int) -> FilePath:
        """Folder that the name of a file at this path is relative to.

        That of the scenario's file; of the scenario of a result the one in which the file is that was solved; else the
        current one.

        Raises
        ------
        ScenarioError
            If the file that was solved is nowhere.
        """
        if self._solved is not None:
            return self._solved.folder_of(path)
        file = None if self._text is None else locate(self._text, path)[0]
        return FilePath(file).parent if file else FilePath()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about values that are allowed but questionable, one sentence each."""
        return tuple(dict.fromkeys((*self._left_out, *doubts(self))))

    def to_yaml(self) -> str:
        """Return the scenario as YAML: as it was written, numbers in SI units; it loads to an equal scenario."""
        return dumped(plain(self))
