"""Names of places that fields of a run's result have, which share a group of its file with them."""

from __future__ import annotations

from beamsim.analyses.run.result import RunResult
from beamsim.errors import Problem, ScenarioError
from beamsim.fields import names_in
from beamsim.scenario import Scenario


def refuse_names_of_fields(scenario: Scenario) -> None:
    """Refuse names of probes, snubbers and outputs whose statistics or spectra would take the place of a field.

    Parameters
    ----------
    scenario : with a ``run`` section.

    Raises
    ------
    ScenarioError
        With each of them.
    """
    run, groups = scenario.run, list[str]()
    groups += ["random"] if scenario.excitation.stationary else []
    groups += ["srs"] if run is not None and run.srs is not None else []
    taken = {name: group for group in groups for name in names_in(RunResult, group)}
    problems = [
        Problem(
            f"{section}[{k}].name",
            f"= {item.name} is the name of a field of the result, {taken[item.name]}/{item.name}",
            f"choose another name, for example {item.name}_1",
        )
        for section in ("probes", "snubbers", "outputs")
        for k, item in enumerate(getattr(scenario, section))
        if item.name in taken
    ]
    if problems:
        raise scenario.located(ScenarioError(problems))
