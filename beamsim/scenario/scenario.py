"""A complete scenario: the content of the YAML file as it was written, checked and in SI units.

With it go the files that it names (what they held when it was solved, and where they are when its result is opened) and
warnings about values that are allowed but questionable.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path as FilePath
from typing import Any, Self

from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.input_files import is_as_opened, open_input, state_of
from beamsim.scenario.base import Path, Schema, Unfit, path_text, plain, problem, walk, within
from beamsim.scenario.body import Body
from beamsim.scenario.excitation import level_jumps
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.quantities import FileType
from beamsim.scenario.tree import dumped, locate, located_problem

Record = Mapping[str, Any]
"""Of one file: ``file``, its name as it is written, ``folder``, where that was, ``bytes``, and ``sha256`` of its
content, which is missing where the file was changed or removed while the scenario was solved."""


def named_files(scenario: Schema) -> Iterator[tuple[Path, str]]:
    """Path of the key and name of every file that is given."""
    for path, part in walk(scenario):
        for key, name in type(part).keys().items():
            value = part.__dict__.get(name)
            if isinstance(value, str) and _names_file(type(part), name):
                yield (*path, key), value


@cache
def _names_file(section: type[Schema], name: str) -> bool:
    field = section.model_fields[name]
    return any(isinstance(item, FileType) for item in (*field.metadata, *within(field.annotation)))


def _sha256(path: FilePath) -> str:
    """Digest of the content; a file that has not changed is read once."""
    status = path.stat()
    return _digest(path.absolute(), (*state_of(status), status.st_ctime_ns))


@lru_cache(maxsize=256)
def _digest(path: FilePath, state: tuple[int, ...]) -> str:
    del state
    with open_input(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _record(folder: FilePath, name: str, *, as_read: bool) -> Record:
    """What a file holds, see `Scenario.file_records`."""
    path = folder / name
    try:
        content: dict[str, Any] = {"bytes": path.stat().st_size}
        content |= {"sha256": _sha256(path)} if not as_read or is_as_opened(path) else {}
    except (OSError, InputFileError):
        content = {}
    return {"file": name, "folder": str(folder.absolute()), **content}


@dataclass(frozen=True)
class SolvedFiles:
    """The files of a scenario that was read from a result file."""

    records: Mapping[str, Record]  # by key
    beside: FilePath  # folder of the result file
    may_be_opened: bool = True  # False where a result is only shown

    def folder_of(self, path: Path) -> FilePath:
        """Folder of the file that a key names: the current one, that of the result, or that in which it was solved.

        Raises
        ------
        ScenarioError
            If it is in none of them, or has another content than the one that was solved.
        """
        record = self.records.get(path_text(path)) or self.records.get(path_text(path[:-1]))
        if record is None:
            return FilePath()
        name = str(record["file"])
        folders = {
            FilePath(record["folder"]): "that of the case",
            self.beside: "that of the result",
            FilePath().absolute(): "the current folder",
        }  # each once, under the name that is nearest to the user
        there = [folder for folder in reversed(folders) if (folder / name).is_file()]
        for folder in there:
            same_size = (folder / name).stat().st_size == record.get("bytes")
            if same_size and _sha256(folder / name) == record.get("sha256"):
                return folder
        if there:
            reason = (
                "its content is another"
                if "sha256" in record
                else "it was changed or removed while the case was solved"
            )
            message = f"in {folders[there[0]]}, {there[0]}, is not the file that was solved: {reason}"
            remedy = "bring back the file as it was, or run the case again"
        else:
            searched = ", ".join(f"{said} ({folder})" for folder, said in reversed(folders.items()))
            message = f"is not found; searched: {searched}"
            remedy = "give the command in the folder of the case, or put the file beside the result"
        raise ScenarioError(problem(path, f"= {name} {message}", remedy))


def problems(scenario: ScenarioParts) -> list[Problem]:
    """All inconsistencies between the parts of a scenario that are written: each is asked for its own."""
    bodies = scenario.all_bodies
    if not bodies:
        remedy = "give beam:, chain: or bodies: (beamsim new writes a template)"
        return [problem((), "the scenario has no structure", remedy)]
    found = [each for name, body in bodies.items() for each in body.problems(scenario, scenario.body_path(name))]
    analyses = set() if not found else _ANALYSES  # whose rates and frequencies follow from the bodies
    for at, part in walk(scenario):
        if not isinstance(part, Body) and not analyses.intersection(at[:1]):
            found += part.problems(scenario, at)
    return found


_ANALYSES = {"run", "sweep", "nnm", "identify_stiffness", "vary", "optimise", "limits"}


def profile_jumps(scenario: ScenarioParts) -> Iterator[str]:
    """Where the level of a sweep steps."""
    for key in ("excitation", "sweep"):
        yield from level_jumps(scenario, (key,), getattr(scenario, key))


def large_deflections(scenario: ScenarioParts, peaks: Mapping[str, float]) -> list[str]:
    """A warning for each body whose computed deflection is beyond the theory of small ones.

    Parameters
    ----------
    peaks : m, by probe, of a structure that cannot move as a rigid body.
    """
    bodies = {probe.name: probe.place.body for probe in scenario.probes}
    largest: dict[str, tuple[float, str]] = {}
    for probe, peak in peaks.items():
        body = bodies.get(probe) or scenario.default_body
        largest[body] = max(largest.get(body, (0.0, "")), (peak, probe))
    return [
        f"the largest displacement at {probe} = {peak:.3g} m is not small for {path_text(scenario.body_path(name))} "
        f"(more than {allowed:.3g} m), and the theory does not hold: a unit such as mm or g may be wrong"
        for name, (peak, probe) in largest.items()
        if name in scenario.all_bodies and peak > (allowed := scenario.all_bodies[name].largest_deflection)
    ]


class Scenario(ScenarioParts):
    """A structure with its one-sided stops, its excitation and the requested analyses."""

    # The origin is not part of the scenario: equality and YAML ignore it.
    _source: str = "scenario"
    _text: Any = None  # what was read, see `beamsim.scenario.tree`
    _left_out: tuple[str, ...] = ()
    _solved: SolvedFiles | None = None  # of a result

    def check(self) -> None:
        """Check the parts against each other."""
        self.exclude("chain", "beam", remedy="keep one of the two (null removes an inherited one)")
        self.exclude("bodies", "beam", "chain", remedy="list it among the bodies")
        self.exclude("optimise", "vary")
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
            except Unfit as error:
                raise ScenarioError(error.problem(path)) from None
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
        """The same scenario under another name.

        Parameters
        ----------
        source : name for output files.
        text : the tree from which it was read.
        warnings : about what was left out when it was read.

        Returns
        -------
        Scenario
        """
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

    def file_records(self, *, as_read: bool) -> Mapping[str, Record]:
        """What the files hold that the scenario names, by the keys that name them; of those that are gone nothing.

        Parameters
        ----------
        as_read : leave out the digest of a file that was changed after this process read it: it is not what was solved.
        """
        if self._solved is not None:
            return self._solved.records
        files = {path_text(path): (self.folder_of(*path), name) for path, name in named_files(self)}
        return {key: _record(folder, name, as_read=as_read) for key, (folder, name) in files.items()}

    def located(self, error: ScenarioError) -> ScenarioError:
        """Return the error with the file and line of every path, for problems that only the model could find."""
        if self._text is None or self._solved is not None:  # nobody has seen the text in a result file
            return error
        root = self._text
        return ScenarioError([located_problem(root, problem) for problem in error.problems])

    @contextmanager
    def locating(self) -> Iterator[None]:
        """Add file and line to problems that only the model finds."""
        try:
            yield
        except ScenarioError as error:
            raise self.located(error) from None

    def folder_of(self, *path: str | int) -> FilePath:
        """Folder that the name of a file at this path is relative to.

        That of the scenario's file; of the scenario of a result the one in which the file is that was solved; else the
        current one.

        Raises
        ------
        ScenarioError
            If the file that was solved is nowhere, or is not to be opened.
        """
        if self._solved is not None:
            self._demand_consent(path)
            return self._solved.folder_of(path)
        file = None if self._text is None else locate(self._text, path)[0]
        return FilePath(file).parent if file else FilePath()

    def _demand_consent(self, path: Path) -> None:
        """Refuse to open a file at or below a path, where the scenario is that of a result that is only shown.

        Raises
        ------
        ScenarioError
            If it names one.
        """
        if self._solved is None or self._solved.may_be_opened:
            return
        for at, name in named_files(self):
            if at[: len(path)] == path or path[: len(at)] == at:
                message = f"= {name} is a file that the result names, and is not opened just because it does"
                raise ScenarioError(problem(at, message, "add --open-files if it is yours, or run the case again"))

    def whole_paths(self, part: Schema, where: Path = ()) -> dict[Path, str]:
        """By path in a part the files that it names, from the root.

        Parameters
        ----------
        part : of the scenario, or a variant of all of it.
        where : path of the part.
        """
        return {at: str((self.folder_of(*where, *at) / name).absolute()) for at, name in named_files(part)}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about values that are allowed but questionable, one sentence each."""
        doubts = (text for at, part in walk(self) for text in part.doubts(self, at))
        return tuple(dict.fromkeys((*self._left_out, *doubts)))

    def to_yaml(self) -> str:
        """Return the scenario as YAML: as it was written, numbers in SI units; it loads to an equal scenario."""
        return dumped(plain(self))
