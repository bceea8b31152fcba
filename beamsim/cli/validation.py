"""The commands ``validate`` and ``schema``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from beamsim.structures.matrices import FileSummary


class Validated(NamedTuple):
    """A valid case."""

    title: str
    files: tuple[FileSummary, ...]  # of bodies that are read from files
    warnings: tuple[str, ...]


def validated(case: Path, overrides: Sequence[str]) -> Validated:
    """Load the case, read the matrices that it names and, if it has a run, build its model.

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
    files: tuple[FileSummary, ...] = ()
    if any(body.is_read_from_files for body in scenario.all_bodies.values()):
        from beamsim.structures.assembly import summaries_of_files

        with located(scenario):
            files = summaries_of_files(scenario)
    if scenario.run is None:
        remarks = (f"{each.body}: {remark}" for each in files for remark in each.remarks)
        return Validated(scenario.title, files, (*scenario.warnings, *remarks))
    from beamsim.system.build import build_system

    return Validated(scenario.title, files, (*scenario.warnings, *build_system(scenario).warnings))


def draw_model(case: Path, overrides: Sequence[str], folder: Path) -> list[Path]:
    """Draw the model of a valid case; returns the picture.

    Raises
    ------
    ScenarioError
        If the model cannot be built.
    ResultFileError
        If the picture cannot be written.
    """
    from beamsim.plots.model import save_model
    from beamsim.plots.style import shown_in
    from beamsim.scenario import load_scenario
    from beamsim.system.build import build_system

    scenario = load_scenario(case, overrides)
    system = build_system(scenario, assessed=False)
    with shown_in(scenario.display_scales):
        return save_model(scenario, system.stations, {stop.name: stop for stop in system.snubbers}, folder, case.stem)


def schema_text() -> str:
    """JSON Schema of scenario files."""
    from beamsim.scenario import json_schema

    return json.dumps(json_schema(), indent=2, ensure_ascii=False)
