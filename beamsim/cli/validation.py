"""The commands ``validate`` and ``schema``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path


def validated(case: Path, overrides: Sequence[str]) -> tuple[str, tuple[str, ...]]:
    """Load the case and, if it has a run, build its model; returns its title and the warnings.

    Raises
    ------
    ScenarioError
        With every problem found.
    """
    from beamsim.scenario import load_scenario

    scenario = load_scenario(case, overrides)
    if scenario.vary is not None:
        from beamsim.analyses.designs.plan import check_cases, plan_designs

        check_cases(plan_designs(scenario))
    if scenario.run is None:
        return scenario.title, scenario.warnings
    from beamsim.system.build import build_system

    return scenario.title, (*scenario.warnings, *build_system(scenario).warnings)


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
