"""The commands ``validate`` and ``schema``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from beamsim.scenario import Scenario
    from beamsim.structures.file_summary import FileSummary
    from beamsim.system.structural import StructuralSystem


class Validated(NamedTuple):
    """A valid case."""

    scenario: Scenario
    files: tuple[FileSummary, ...]  # of bodies that are read from files
    warnings: tuple[str, ...]
    system: StructuralSystem | None  # of a case with a run


def validated(case: Path, overrides: Sequence[str]) -> Validated:
    """Load the case and, if it has a run, build its model; else read the matrices that it names.

    Raises
    ------
    ScenarioError
        With every problem found.
    """
    from beamsim.cli.conclusion import located
    from beamsim.scenario import load_scenario

    scenario = load_scenario(case, overrides)
    if scenario.vary is not None:
        from beamsim.analyses.designs.plan import check_cases, plan_designs

        check_cases(plan_designs(scenario))
    if scenario.run is not None:
        from beamsim.system.build import build_system

        system = build_system(scenario)
        return Validated(scenario, system.files, (*scenario.warnings, *system.warnings), system)
    files: tuple[FileSummary, ...] = ()
    if any(body.is_read_from_files for body in scenario.all_bodies.values()):
        from beamsim.structures.assembly import summaries_of_files

        with located(scenario):
            files = summaries_of_files(scenario)
    remarks = (f"{each.body}: {remark}" for each in files for remark in each.remarks)
    return Validated(scenario, files, (*scenario.warnings, *remarks), None)


def draw_model(valid: Validated, folder: Path, stem: str) -> list[Path]:
    """Draw the model of a valid case; returns the picture.

    Raises
    ------
    ScenarioError
        If the model cannot be built.
    ResultFileError
        If the picture cannot be written.
    """
    from beamsim.plots.model import model_figure
    from beamsim.plots.save import save_figures
    from beamsim.plots.style import shown_in
    from beamsim.system.build import build_system

    scenario = valid.scenario
    system = valid.system or build_system(scenario, assessed=False)
    with shown_in(scenario.display_scales):
        stops = {stop.name: stop for stop in system.snubbers}
        return save_figures({"sketch": model_figure(scenario, system.stations, stops)}, folder, stem)


def schema_text() -> str:
    """JSON Schema of scenario files."""
    from beamsim.scenario import json_schema

    return json.dumps(json_schema(), indent=2, ensure_ascii=False)
