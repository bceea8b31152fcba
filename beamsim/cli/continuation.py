"""``beamsim sweep`` with ``kind: continuation``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from beamsim.cli.conclusion import Reporting
    from beamsim.scenario import Scenario


def continue_motions(
    scenario: Scenario, target: Path, reporting: Reporting, overlay: Sequence[Path], *, expansion: bool
) -> None:
    """Follow periodic motions, add the requested overlays, save and print.

    Raises
    ------
    ScenarioError, ResultFileError
        Before the computation, if the scenario or a file cannot be used.
    StoppedEarlyError
        If the range was not covered, the result is not reliable, or after a signal; the partial result is saved.
    LimitExceededError
        With ``--check``.
    """
    from beamsim.cli.conclusion import concluded, located
    from beamsim.cli.progress import progress_of
    from beamsim.store.results import open_sweep

    stored = [(path, open_sweep(path)) for path in overlay]
    bar = progress_of("following periodic motions", shown=reporting.progress)
    with concluded("continuation", target, reporting) as computation, bar as progress:
        from beamsim.trust.checked import continuation

        result = continuation(scenario, progress, computation.stop)
        for path, sweep in stored:
            from beamsim.analyses.continuation.overlay import with_overlay

            result = with_overlay(result, sweep, path.name)
        if expansion and not result.outcome.interrupted:
            from beamsim.analyses.continuation.forced_expansion import with_forced_expansion

            with located(scenario):
                result = with_forced_expansion(result)
        computation.result = result
