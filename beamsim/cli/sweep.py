"""What ``sweep`` does: a swept or stepped sine, a continuation, or many cases."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from beamsim.analyses.sweep.result import SweepResult
from beamsim.cli.conclusion import concluded
from beamsim.cli.interruption import Interruption
from beamsim.cli.options import Given, Reporting
from beamsim.cli.preparation import located, prepared
from beamsim.cli.progress import Progress
from beamsim.errors import Problem, ResultFileError, ScenarioError
from beamsim.scenario import Scenario
from beamsim.store.results import open_result, write_result
from beamsim.trust import checked

_NEEDS_VARY = "leave out the option, or add vary"
_NEEDS_CONTINUATION = "leave it out, or use sweep: {kind: continuation}"
# option -> kinds of sweep with that option; for others place (default: the option), message and remedy
_OPTIONS = {
    "workers": (("designs",), "vary", "is missing, but --workers applies to its cases", _NEEDS_VARY),
    "scheduler": (("designs",), "vary", "is missing, but --scheduler applies to its cases", _NEEDS_VARY),
    "resume": (("designs", "sweep"), "", "continues a swept or stepped sine, not a continuation", "leave it out"),
    "overlay": (("continuation",), "", "overlays a sweep on a curve by continuation", _NEEDS_CONTINUATION),
    "compare": (("continuation",), "", "compares with a curve of periodic motions", _NEEDS_CONTINUATION),
}


def swept(given: Given, options: Mapping[str, Any]) -> None:
    """Sweep the frequency, follow the response or compute many cases, whichever the scenario asks for.

    Parameters
    ----------
    given : to the command.
    options : by name without dashes: workers, scheduler, resume, overlay, compare.

    Raises
    ------
    ScenarioError
        Where an option does not apply to the kind of sweep, and as `concluded`.
    """
    scenario, target = prepared("sweep", given)
    reporting = given.reporting
    kind = _kind(scenario)
    for name, value in options.items():
        allowed, path, message, remedy = _OPTIONS[name]
        if value and kind not in allowed:
            raise ScenarioError(Problem(path or f"--{name}", message, remedy))
    if kind == "designs":
        from beamsim.cli.designs import sweep_designs

        of_study = {name: options[name] for name in ("workers", "scheduler", "resume")}
        sweep_designs(scenario, target, reporting, **of_study)
    elif kind == "continuation":
        from beamsim.cli.continuation import continue_motions

        continue_motions(scenario, target, reporting, options["overlay"] or (), expansion=bool(options["compare"]))
    else:
        _sweep_sine(scenario, target, reporting, resume=options["resume"])


def _kind(scenario: Scenario) -> str:
    """Kind of the result, as in `beamsim.kinds.KINDS`."""
    if scenario.vary is not None:
        return "designs"
    return "continuation" if scenario.sweep is not None and scenario.sweep.kind == "continuation" else "sweep"


def _sweep_sine(scenario: Scenario, target: Path, reporting: Reporting, *, resume: bool) -> None:
    """Compute a swept or stepped sine, saving partial results."""

    def computed(progress: Progress, stop: Interruption) -> SweepResult:
        with located(scenario):
            result = checked.sweep(
                scenario, progress, stop=stop, save=lambda part: write_result(part, target),
                resume=_earlier(target, scenario) if resume else None,
            )  # fmt: skip
        if not result.curves:  # it was interrupted before its first cycle
            raise KeyboardInterrupt
        return result

    concluded("sweep", target, reporting, computed, "sweeping")


def _earlier(path: Path | str, scenario: Scenario) -> SweepResult | None:
    """The partial result of an interrupted sweep of the same scenario; None if there is no file.

    Raises
    ------
    ResultFileError
        If the file is of another scenario, or damaged.
    """
    if not Path(path).exists():
        return None
    stored: SweepResult = open_result(path, "sweep")
    if getattr(stored, "scenario_yaml", "") != scenario.to_yaml():
        raise ResultFileError(
            f"{path}: contains a sweep of another scenario; leave out --resume, or choose another path with -o"
        )
    return stored
