"""What ``run`` does, and every command whose analysis needs no more than the case."""

from __future__ import annotations

from typing import Any

from beamsim.analyses.result import Result
from beamsim.analyses.run.result import RunResult
from beamsim.cli.conclusion import concluded
from beamsim.cli.interruption import Interruption
from beamsim.cli.options import Given
from beamsim.cli.preparation import located, prepared
from beamsim.cli.progress import Progress
from beamsim.kinds import KINDS, named
from beamsim.trust import checked


def analysed(kind: str, given: Given, doing: str, **options: Any) -> None:
    """Compute the result of a kind whose command has the same name.

    Parameters
    ----------
    kind : of the result.
    given : to the command.
    doing : what is done with the case meanwhile, "simulating".
    options : of the analysis.

    Raises
    ------
    BeamsimError
        As `concluded`.
    """
    scenario, target = prepared(kind, given)

    def computed(progress: Progress, stop: Interruption) -> Result:
        with located(scenario):
            result: Result = named(KINDS[kind].analysis)(scenario, progress=progress, stop=stop, **options)
            return result

    concluded(kind, target, given.reporting, computed, f"{doing} {given.case.name}")


def run(given: Given, against: str | None) -> None:
    """Simulate a case, and compare it with the reference integrator where ``against`` says so, ``reference[:RTOL]``."""
    if against is not None:
        from beamsim.trust import reference  # which runs without it do not load

        rtol = reference.tolerance_of(against)
    scenario, target = prepared("run", given)
    name = given.case.name

    def simulated(progress: Progress, stop: Interruption) -> RunResult:
        with located(scenario):
            result = checked.run(scenario, progress, stop)
            compared = against is not None and not result.outcome.interrupted
            return reference.against(result, rtol, stop) if compared else result

    concluded("run", target, given.reporting, simulated, f"simulating {name}", f"evaluating the motion of {name}")
