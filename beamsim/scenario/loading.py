"""From a file, text or mapping to a scenario, or to a list of all errors in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path as FilePath
from typing import Any

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import LenientPass, Path, UnknownValueError, path_text, walk
from beamsim.scenario.display import DisplayUnits
from beamsim.scenario.input_files import named_files
from beamsim.scenario.merge import Overrides, apply_overrides, read_file, resolve_extends
from beamsim.scenario.messages import describe
from beamsim.scenario.scenario import Scenario
from beamsim.scenario.tree import Node, from_python, located, node_at, parse, path_parts
from beamsim.scenario.units import units_written
from beamsim.scenario.written import written

USED: dict[str, frozenset[str]] = {
    "run": frozenset({"run", "limits"}),
    "sweep": frozenset({"sweep", "limits"}),
    "vary": frozenset({"vary", "sweep", "run", "limits"}),
    "nnm": frozenset({"nnm"}),
    "identify-stiffness": frozenset({"identify_stiffness"}),
}
"""Sections that each command uses, of those that not all of them use (``vary``: sweep with this section)."""


def load_scenario(
    source: str | FilePath | Mapping[str, Any] | Scenario, overrides: Overrides = (), *, command: str = ""
) -> Scenario:
    """Read and check a scenario.

    Parameters
    ----------
    source : path of a YAML file; or YAML text (it has a line break, or begins with a brace); or a mapping like
        the one in such a file; or a scenario, to be varied.
    overrides : what to change, applied after `extends`: ``{"beam.thickness": "4 mm"}`` or
        ``["beam.thickness=4 mm", "snubbers[0].gap=0.1 mm"]``. An override acts like a file that extends this one:
        mappings merge, lists and a mapping whose ``kind`` changes are replaced whole, ``null`` (``None``) takes a
        key away, so that its default holds.
    command : what the scenario is for, such as ``run`` or ``sweep``: then a section that it does not use is left out
        with a warning if it is wrong. By default all sections are checked.

    Returns
    -------
    Scenario
        In SI units, with defaults resolved.

    Raises
    ------
    ScenarioError
        With every problem found: path, message, remedy, file and line.
    """
    root, name = _read(source)
    if overrides:
        root = apply_overrides(root, overrides)
    try:
        return _validated(root).with_source(name, root)
    except ScenarioError as error:
        unused = _unused(root, command)
        if not unused:
            raise
        kept = Node({key: item for key, item in root.value.items() if key not in unused}, root.file, root.line)
        warnings = tuple(f"left out, since {command} does not use it: {problem}" for problem in error.problems)
        return _validated(kept).with_source(name, kept, warnings)


def _unused(root: Node, command: str) -> frozenset[str]:
    """Sections of the scenario that a command does not use."""
    if command not in USED or not isinstance(root.value, dict):
        return frozenset()
    vary = root.value.get("vary")
    used = USED["vary" if command == "sweep" and vary is not None and vary.value is not None else command]
    return (frozenset().union(*USED.values()) - used) & root.value.keys()


def _read(source: str | FilePath | Mapping[str, Any] | Scenario) -> tuple[Node, str]:
    """Return the tree, `extends` resolved, and the name for output files."""
    if isinstance(source, Scenario):
        return _tree(source), source.source
    if isinstance(source, Mapping):
        return resolve_extends(from_python(source), FilePath()), "scenario"
    if isinstance(source, str) and ("\n" in source or source.lstrip().startswith("{")):
        return resolve_extends(parse(source, "<text>"), FilePath()), "scenario"
    path = FilePath(source)
    return resolve_extends(read_file(path), path.parent, (path.resolve(),)), path.stem


def _tree(scenario: Scenario, places: Iterable[Path] = ()) -> Node:
    """The tree of a scenario as it was written, with what holds these places."""
    files = [at for at, _ in named_files(scenario)]
    root = from_python(written(scenario, [*places, *files]))
    for at in files:  # stay relative to where they were written
        node_at(root, at).file = str(scenario.folder_of(*at) / f"{scenario.source}.yaml")
    return root


def replacing(scenario: Scenario, places: Iterable[Path]) -> Callable[[Mapping[Path, object]], Scenario]:
    """What gives the same scenario with other values at these places, many times; what follows from them follows.

    Raises
    ------
    ScenarioError
        By the function, as `load_scenario` raises it.
    """
    tree = _tree(scenario, places)

    def with_values(values: Mapping[Path, object]) -> Scenario:
        root = tree.copy()
        for place, value in values.items():
            node_at(root, place[:-1]).value[place[-1]] = from_python(value)
        return _validated(root).with_source(scenario.source, root)

    return with_values


def _validated(root: Node) -> Scenario:
    data = root.plain()
    try:
        with units_written() as written:
            scenario = Scenario.model_validate(data)
        shown = (scenario.units or DisplayUnits.model_construct()).filled(written)
        return scenario if shown.is_empty else scenario.model_copy(update={"units": shown})
    except ScenarioError as error:
        problems = [(path_parts(problem.path), problem) for problem in error.problems]
    except ValidationError as error:
        details = error.errors(include_url=False)
        wrong = [detail["loc"] for detail in details]
        # a list is too short for pydantic as well where its items are wrong
        details = [
            detail
            for detail in details
            if detail["type"] != "too_short"
            or not any(loc != detail["loc"] and loc[: len(detail["loc"])] == detail["loc"] for loc in wrong)
        ]
        problems = [_problem(*describe(Scenario, detail)) for detail in details]
        problems += _between_fields(data)
    unique = list(dict.fromkeys(located(root, path, problem) for path, problem in problems))
    raise ScenarioError(sorted(unique, key=lambda problem: (problem.file != root.file, problem.line or 0)))


def _between_fields(data: Any) -> list[tuple[Path, Problem]]:
    """Return the results of the checks between valid values if other values are invalid."""
    try:
        partial = Scenario.model_validate(data, context=LenientPass())
    except (UnknownValueError, ValidationError, ScenarioError):
        return []
    problems: list[tuple[Path, Problem]] = []
    for path, part in walk(partial):
        error = part.late_error
        if isinstance(error, ScenarioError):
            problems += [(path_parts(problem.path), problem) for problem in error.problems]
        elif isinstance(error, PydanticCustomError):
            context = error.context or {}
            problems.append(_problem((*path, *context["at"]), context["message"], context["remedy"]))
    return problems


def _problem(path: Path, message: str, remedy: str) -> tuple[Path, Problem]:
    return path, Problem(path_text(path), message, remedy)
