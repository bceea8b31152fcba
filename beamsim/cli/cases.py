"""Commands ``validate``, ``schema`` and ``new``."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from pathlib import Path

from beamsim.cli.screens import WIDTH
from beamsim.cli.session import CommandOptions, load_case, print_json, say, show
from beamsim.errors import ScenarioError
from beamsim.files import output_file, output_folder, replacement_file
from beamsim.kinds import TemplateKind
from beamsim.plots.style import use_units
from beamsim.plots.understood import interpretation
from beamsim.scenario import Scenario, template
from beamsim.scenario.jsonschema import json_schema
from beamsim.structures.matrices import summaries_of_files
from beamsim.structures.named_matrices import FileSummary
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem

SCHEMA = "beamsim.schema.json"


def validate(options: CommandOptions, *, sketch: bool) -> None:
    """Check a case, and draw its model on request.

    Parameters
    ----------
    options : shared options.
    sketch : True to draw the model.

    Raises
    ------
    ScenarioError
        With every problem.
    ResultFileError
        If the picture cannot be written.
    """
    case = options.case
    folder = output_folder(options.output, case.stem) if sketch else None
    drawn: list[Path] = []
    try:
        scenario = load_case(options)
        files, warnings, system = _inspect_inputs(scenario)
        if folder is not None:
            from beamsim.cli.html_report import draw_model  # and with it everything that draws

            drawn = draw_model(scenario, system, folder, case.stem)
    except ScenarioError as error:
        if options.json:
            print_json({"valid": False, "problems": [vars(problem) for problem in error.problems]})
        raise
    with use_units(scenario.display_scales):
        modes = None if system is None else system.modes
        inputs = () if system is None else system.inputs
        line = interpretation(scenario, modes, {each.path: vars(each) for each in inputs})
    for warning in warnings:
        say(f"beamsim: warning: {warning}")
    title = scenario.title
    if options.json:
        pictures = {"files": [str(file) for file in drawn]} if sketch else {}
        read = {"imported": {body.body: body.as_json for body in files}} if files else {}
        print_json({"valid": True, "title": title, "understood": line, "warnings": warnings, **read, **pictures})
    else:
        found = f"{case}: valid ({title})" if title else f"{case}: valid"
        show(found, *textwrap.wrap(line, WIDTH), *(body.text for body in files), *drawn)


def _inspect_inputs(scenario: Scenario) -> tuple[Sequence[FileSummary], list[str], StructuralSystem | None]:
    """Check what needs no analysis: summaries of bodies from files, warnings, and the system of a motion.

    Raises
    ------
    ScenarioError
        With every problem.
    """
    if scenario.study is not None:
        from beamsim.analyses.studies.plan import check_cases, plan_designs  # and with it every analysis

        check_cases(plan_designs(scenario))
    if scenario.run is not None or scenario.sweep is not None or scenario.nnm is not None:
        system = build_system(scenario)
        return system.files, [*scenario.warnings, *system.warnings], system
    files: Sequence[FileSummary] = ()
    if any(body.is_read_from_files for body in scenario.all_bodies.values()):
        with scenario.locating():
            files = summaries_of_files(scenario)
    return files, [*scenario.warnings, *(f"{each.body}: {remark}" for each in files for remark in each.remarks)], None


def schema_text() -> str:
    """JSON Schema of scenario files."""
    return json.dumps(json_schema(), indent=2, ensure_ascii=False)


def write_schema(output: Path | None) -> None:
    """Write the JSON Schema to a file; without one print it."""
    if output is None:
        print(schema_text())
        return
    with replacement_file(output_file(output, "beamsim.schema", ".json")) as temporary:
        temporary.write_text(schema_text() + "\n", encoding="utf-8")


def write_template(path: Path, kind: TemplateKind, *, force: bool, as_json: bool) -> None:
    """Write a template, and next to it the JSON Schema that its first line names.

    The schema of this version is always written.

    Parameters
    ----------
    path : file of the scenario.
    kind : kind of the template.
    force : True to replace an existing scenario.
    as_json : True to print JSON.

    Raises
    ------
    ScenarioError
        If the file exists, or its name has the ending of another kind of file.
    ResultFileError
        If it cannot be written.
    """
    if path.suffix.lower() not in ("", ".yaml", ".yml"):
        raise ScenarioError(f"{path} is not a name of a scenario; give one that ends with .yaml")
    if path.exists() and not force:
        raise ScenarioError(f"{path} already exists; choose another name, or use --force to replace it")
    schema = path.with_name(SCHEMA)
    scenario = f"# yaml-language-server: $schema={SCHEMA}\n{template(kind.value)}"
    for target, text in ((path, scenario), (schema, schema_text() + "\n")):
        with replacement_file(target) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if as_json:
        print_json({"files": [str(path), str(schema)]})
    else:
        show(f"{path}: written; edit it and `beamsim {kind.command} {path}`")
