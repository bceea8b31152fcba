"""From a file, text or mapping to a scenario, or to a list of all errors in it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Any

from pydantic import ValidationError

from beamsim.errors import ScenarioError
from beamsim.scenario.base import plain, problem
from beamsim.scenario.display import DisplayUnits
from beamsim.scenario.input_files import named_files
from beamsim.scenario.merge import Overrides, apply_overrides, read_file, resolve_extends
from beamsim.scenario.messages import describe
from beamsim.scenario.scenario import Scenario
from beamsim.scenario.tree import WrittenMapping, from_python, located_problem, parse
from beamsim.scenario.units import units_written

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
        As it is written, in SI units.

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
        kept = WrittenMapping({key: item for key, item in root.items() if key not in unused}, root.mark, root.marks)
        warnings = tuple(f"left out, since {command} does not use it: {problem}" for problem in error.problems)
        return _validated(kept).with_source(name, kept, warnings)


def _unused(root: WrittenMapping, command: str) -> frozenset[str]:
    """Sections of the scenario that a command does not use."""
    if command not in USED:
        return frozenset()
    used = USED["vary" if command == "sweep" and root.get("vary") is not None else command]
    return (frozenset().union(*USED.values()) - used) & root.keys()


def _read(source: str | FilePath | Mapping[str, Any] | Scenario) -> tuple[WrittenMapping, str]:
    """Return the data, `extends` resolved, and the name for output files."""
    if isinstance(source, Scenario):
        root: WrittenMapping = from_python(plain(source))
        for at, _ in named_files(source):  # relative to where they were written
            owner: Any = root
            for part in at[:-1]:
                owner = owner[part]
            owner.marks[at[-1]] = str(source.folder_of(*at) / f"{source.source}.yaml"), None
        return root, source.source
    if isinstance(source, Mapping):
        return resolve_extends(from_python(source), None, FilePath()), "scenario"
    if isinstance(source, str) and ("\n" in source or source.lstrip().startswith("{")):
        return resolve_extends(parse(source, "<text>"), "<text>", FilePath()), "scenario"
    path = FilePath(source)
    return resolve_extends(read_file(path), str(path), path.parent, (path.resolve(),)), path.stem


def _validated(root: WrittenMapping) -> Scenario:
    """The scenario that data are; or the errors of all fields, else of all sections, else between sections, located."""
    try:
        with units_written() as written:
            scenario = Scenario.model_validate(root)
    except ScenarioError as error:
        problems = list(error.problems)
    except ValidationError as error:
        details = error.errors(include_url=False)
        wrong = [detail["loc"] for detail in details]
        # a list is too short for pydantic as well where its items are wrong
        problems = [
            problem(*describe(Scenario, detail))
            for detail in details
            if detail["type"] != "too_short"
            or not any(loc != detail["loc"] and loc[: len(detail["loc"])] == detail["loc"] for loc in wrong)
        ]
    else:
        shown = (scenario.units or DisplayUnits()).filled(written)
        return scenario if shown.is_empty else scenario.model_copy(update={"units": shown})
    unique = list(dict.fromkeys(located_problem(root, each) for each in problems))
    raise ScenarioError(sorted(unique, key=lambda each: (each.file != root.mark[0], each.line or 0)))


def template(kind: str = "beam") -> str:
    """Return a commented scenario that is valid as it stands, as `beamsim new` writes it.

    Parameters
    ----------
    kind : one of `beamsim.kinds.TemplateKind`.
    """
    return (files("beamsim.scenario") / "templates" / f"{kind}.yaml").read_text(encoding="utf-8")
