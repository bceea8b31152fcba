"""``beamsim sweep`` with ``kind: continuation``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from beamsim.analyses.continuation.forced_expansion import with_forced_expansion
from beamsim.analyses.continuation.overlay import with_overlay
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.cli.conclusion import concluded
from beamsim.cli.interruption import Interruption
from beamsim.cli.options import Reporting
from beamsim.cli.preparation import located
from beamsim.cli.progress import Progress
from beamsim.scenario import Scenario
from beamsim.store.results import open_result
from beamsim.trust import checked


def continue_motions(
    scenario: Scenario, target: Path, reporting: Reporting, overlay: Sequence[Path], *, expansion: bool
) -> None:
    """Follow periodic motions, add the requested overlays, save and print.

    Parameters
    ----------
    scenario : with a continuation.
    target, reporting : as of `concluded`.
    overlay : files of sweeps.
    expansion : whether to compare with the multiple-scales expansion.

    Raises
    ------
    BeamsimError
        As `concluded`.
    """
    stored = [(path, open_result(path, "sweep")) for path in overlay]

    def followed(progress: Progress, stop: Interruption) -> ContinuationResult:
        result = checked.continuation(scenario, progress, stop)
        for path, sweep in stored:
            result = with_overlay(result, sweep, path.name)
        with located(scenario):
            return with_forced_expansion(result) if expansion and not result.outcome.interrupted else result

    concluded("continuation", target, reporting, followed, "following periodic motions")
