"""From a file, text or mapping to a scenario, or to a list of all errors in it, in terms of the file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from beamsim.errors import Problem, ScenarioError
from beamsim.files import protect
from beamsim.scenario.base import (
    MEANT,
    Path,
    Schema,
    closest,
    counted,
    descriptions,
    kinds_of,
    path_parts,
    plain,
    problem,
    single_line,
    suggestion,
    tag_of,
    within,
    words_of,
)
from beamsim.scenario.quantities import FieldType, Quantity, example_of
from beamsim.scenario.reporting import DisplayUnits
from beamsim.scenario.scenario import Scenario, named_files
from beamsim.scenario.tree import (
    Overrides,
    WrittenMapping,
    apply_overrides,
    from_python,
    located_problem,
    parse,
    read_file,
    resolve_extends,
)
from beamsim.scenario.units import UnitError, units_written

USED: dict[str, frozenset[str]] = {
    "run": frozenset({"run", "limits"}),
    "sweep": frozenset({"sweep", "limits"}),
    "vary": frozenset({"vary", "optimise", "sweep", "run", "limits"}),
    "nnm": frozenset({"nnm"}),
    "identify-stiffness": frozenset({"identify_stiffness"}),
}
"""Sections that each command uses, of those that not all of them use (``vary``: sweep with many cases)."""


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
        scenario = _validated(root).with_source(name, root)
        for at, file in named_files(scenario):
            protect(scenario.folder_of(*at) / file)
        return scenario
    except ScenarioError as error:
        if command not in USED:
            raise
        return _without_unused_sections(root, name, command, error)


def stored_scenario(text: str) -> Scenario:
    """The scenario that a result file holds: its complete text, from which no other file is opened.

    Raises
    ------
    ScenarioError
        If it is no valid scenario, or extends another one.
    """
    root = parse(text, "<text>")
    if isinstance(root, Mapping) and "extends" in root:
        raise ScenarioError(problem(("extends",), "is not accepted in a stored scenario, which is complete"))
    root = resolve_extends(root, "<text>", FilePath())
    return _validated(root).with_source("scenario", root)


def _without_unused_sections(root: WrittenMapping, name: str, command: str, error: ScenarioError) -> Scenario:
    """The scenario without sections that a command does not use, if only these are wrong; else raises the error."""
    used = USED["vary" if command == "sweep" and (root.get("vary") or root.get("optimise")) is not None else command]
    unused = (frozenset().union(*USED.values()) - used) & root.keys()
    if not all(path_parts(found.path)[:1] and path_parts(found.path)[0] in unused for found in error.problems):
        raise error
    kept = WrittenMapping({key: item for key, item in root.items() if key not in unused}, root.mark, root.marks)
    warnings = tuple(f"left out, since {command} does not use it: {problem}" for problem in error.problems)
    return _validated(kept).with_source(name, kept, warnings)


def _read(source: str | FilePath | Mapping[str, Any] | Scenario) -> tuple[WrittenMapping, str]:
    """Return the data, `extends` resolved, and the name for output files."""
    if isinstance(source, Scenario):
        return _tree_of(source), source.source
    if isinstance(source, Mapping):
        return resolve_extends(from_python(source), None, FilePath()), "scenario"
    if isinstance(source, str) and ("\n" in source or source.lstrip().startswith("{")):
        return resolve_extends(parse(source, "<text>"), "<text>", FilePath()), "scenario"
    path = FilePath(source)
    return resolve_extends(read_file(path), str(path), path.parent, (path.resolve(),)), path.stem


def _tree_of(scenario: Scenario) -> WrittenMapping:
    """The data of a scenario, in which files are relative to where they were written."""
    root: WrittenMapping = from_python(plain(scenario))
    for at, _ in named_files(scenario):
        owner: Any = root
        for part in at[:-1]:
            owner = owner[part]
        owner.marks[at[-1]] = str(scenario.folder_of(*at) / f"{scenario.source}.yaml"), None
    return root


def _validated(root: WrittenMapping) -> Scenario:
    """The scenario that data are; or the errors of all fields, else of all sections, else between sections, located."""
    try:
        with units_written() as written:
            scenario = Scenario.model_validate(root)
    except (ScenarioError, ValidationError) as error:
        problems = error.problems if isinstance(error, ScenarioError) else _problems_of(error)
        unique = list(dict.fromkeys(located_problem(root, each) for each in problems))
        raise ScenarioError(sorted(unique, key=lambda each: (each.file != root.mark[0], each.line or 0))) from None
    shown = (scenario.units or DisplayUnits()).filled(written)
    return scenario if not shown.scales else scenario.model_copy(update={"units": shown})


def _problems_of(error: ValidationError) -> list[Problem]:
    """What pydantic found; that a list is too short is left out where its items are wrong, too."""
    details = error.errors(include_url=False)
    wrong = [detail["loc"] for detail in details]
    return [
        problem(*describe(Scenario, detail))
        for detail in details
        if detail["type"] != "too_short"
        or not any(loc != detail["loc"] and loc[: len(detail["loc"])] == detail["loc"] for loc in wrong)
    ]


def template(kind: str = "beam") -> str:
    """Return a commented scenario that is valid as it stands, as `beamsim new` writes it.

    Parameters
    ----------
    kind : one of `beamsim.kinds.TemplateKind`.
    """
    return (files("beamsim.scenario") / "templates" / f"{kind}.yaml").read_text(encoding="utf-8")


def members(annotation: Any, tag: str = "") -> dict[str, type[Schema]]:
    """Return the classes a field may hold, by the tag that tells them apart (`""` where there is none)."""
    if get_origin(annotation) is Annotated:
        return members(get_args(annotation)[0], tag_of(annotation))
    if isinstance(annotation, type) and issubclass(annotation, Schema):
        return {tag or tag_of(annotation): annotation}
    classes: dict[str, type[Schema]] = {}
    for argument in get_args(annotation):
        classes |= members(argument, tag)
    return classes


def _is_tag(part: str | int) -> bool:
    return isinstance(part, str) and part.startswith("<") and part.endswith(">")


def _field(root: type[Schema], location: Path) -> tuple[type[Schema], FieldInfo | None]:
    """Return the class whose key the location's last part is, and the field if there is one."""
    schema, field = root, None
    choices: dict[str, type[Schema]] = {}
    within_mapping = False
    for number, part in enumerate(location, 1):
        if _is_tag(part):
            if part in choices and number < len(location):  # the last one is a form of the field itself
                schema, choices = choices[str(part)], {}
        elif within_mapping:  # the part is a name, such as a body's
            within_mapping = False
        elif isinstance(part, str):
            if field is not None and choices:
                schema, choices = next(iter(choices.values())), {}
            field = schema.model_fields.get(schema.keys().get(part, part))
            choices = {} if field is None else members(field.annotation)
            within_mapping = field is not None and any(get_origin(each) is dict for each in within(field.annotation))
    return schema, field


def describe(root: type[Schema], error: ErrorDetails) -> tuple[Path, str, str]:
    """Return path, message and remedy of one of pydantic's errors."""
    location = tuple(error["loc"])
    path = tuple(part for part in location if not _is_tag(part))
    context, value = error.get("ctx", {}), error.get("input")
    schema, field = _field(root, location)
    shown = f"= {single_line(value)} "
    match error["type"]:
        case "value_error":
            unfit = context["error"]
            lead = shown if isinstance(unfit, UnitError) else ""
            return (*path, *unfit.at), lead + unfit.message, unfit.remedy
        case "variants":
            return path, shown + error["msg"], context["remedy"]
        case "missing":
            return path, "is missing", _how_to_give(str(path[-1]), schema, field)
        case "extra_forbidden":
            return path, "is not a known key", _known_keys(str(path[-1]), path, schema)
        case "union_tag_invalid" | "union_tag_not_found":
            return _kind(path, value, field)
        case "literal_error":
            choices = list(words_of(field.annotation)) if field is not None else []
            return path, shown + "is not one of " + ", ".join(choices), _did_you_mean(value, choices)
        case "model_type" | "model_attributes_type" | "dict_type":
            keys = ", ".join(_class_at(schema, field, location).keys())
            return path, shown + "must be a mapping", f"its keys are {keys}"
        case "tuple_type" | "list_type":
            return path, shown + "must be a list", "write [ ... ], also for a single value"
        case "too_short" if not value:
            needed = field is None or field.is_required()
            return path, "is an empty list", "give at least one value" + ("" if needed else ", or leave it out")
        case "too_short" | "too_long":
            least, most = context.get("min_length"), context.get("max_length")
            bound = f"at most {most}" if least is None else f"at least {least}"
            return path, f"has {counted(len(value), 'value')}, and takes {bound}", _described(schema, field)
    return path, shown + "is not accepted: " + error["msg"][:1].lower() + error["msg"][1:], ""


def _class_at(schema: type[Schema], field: FieldInfo | None, location: Path) -> type[Schema]:
    choices = {} if field is None else members(field.annotation)
    last = location[-1] if location else ""
    return choices.get(str(last)) or next(iter(choices.values()), schema)


def _how_to_give(key: str, schema: type[Schema], field: FieldInfo | None) -> str:
    if field is None:
        return ""
    for item in field.metadata:
        if isinstance(item, FieldType) and item.example:
            usual = example_of(key, item.dimension.unit) if isinstance(item, Quantity) else None
            return f"give for example {key}: {usual or item.example}"
    if get_origin(field.annotation) is Literal:
        return f"give {key}: " + " or ".join(str(choice) for choice in get_args(field.annotation))
    return _described(schema, field)


def _described(schema: type[Schema], field: FieldInfo | None) -> str:
    name = next((name for name, each in schema.model_fields.items() if each is field), "")
    described = descriptions(schema).get(name, "")
    return f"it is: {described[:1].lower()}{described[1:].rstrip('.')}" if described else ""


def _did_you_mean(value: object, choices: list[str]) -> str:
    meant = closest(str(value), choices)
    return f"did you mean {meant}?" if meant else "choose one of these"


def _known_keys(key: str, path: Path, schema: type[Schema]) -> str:
    if key == "extends":
        return "extends must be at the top level of a file"
    if ":" in key:
        return f"write a space after the colon: {key.replace(':', ': ', 1)}"
    if re.match(r"\s*[\d.]", key):  # what follows the comma of 0,3 mm or 90,000 N within { }
        return "a comma separates keys: write decimals with a point, and no comma between thousands"
    keys = list(schema.keys())
    if keys == ["kind"]:
        return "this kind has no other keys; remove it"
    same = key in MEANT.get(closest(key, keys), "").split()
    if not same and (home := _where_it_belongs(key, schema)):
        return home
    return suggestion(key, keys, "known keys:")


def _where_it_belongs(key: str, schema: type[Schema]) -> str:
    """Of a key that stands too far out: the section that has it, or in which it is a kind."""
    homes = []
    for section, attribute in schema.keys().items():
        annotation = schema.model_fields[attribute].annotation
        classes = members(annotation)
        if any(key in kinds_of(part) for part in classes.values()):
            named = get_origin(annotation) is dict
            return f"write {section}: " + ("{NAME: {kind: %s, ...}}" if named else "{kind: %s, ...}") % key
        if any(key in part.keys() for part in classes.values()):  # noqa: SIM118
            homes.append(section)
    return "it belongs in " + " or ".join(homes[:3]) if homes else ""


def _kind(path: Path, value: Any, field: FieldInfo | None) -> tuple[Path, str, str]:
    classes = {} if field is None else members(field.annotation)
    kinds = [kind for part in classes.values() for kind in kinds_of(part)]
    if not isinstance(value, dict):
        return path, f"= {single_line(value)} must be a mapping with a kind", f"write {{kind: {kinds[0]}, ...}}"
    if value.get("kind") is None:
        return path, "has no kind", "give kind: " + ", ".join(kinds[:-1]) + " or " + kinds[-1]
    message = f"= {single_line(value['kind'])} is not one of " + ", ".join(kinds)
    return (*path, "kind"), message, _did_you_mean(value["kind"], kinds)
