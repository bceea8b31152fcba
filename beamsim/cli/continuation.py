"""What ``beamsim sweep`` does with ``kind: continuation``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from beamsim.cli.failures import say

if TYPE_CHECKING:
    from beamsim.analyses.response_results import FrequencyResponse
    from beamsim.scenario import Scenario

__all__ = ["continue_response"]

SHOWN = 12  # special points in a table


def continue_response(scenario: Scenario, target: Path, *, json: bool, plots: bool, quiet: bool) -> None:
    """What ``beamsim sweep`` does with ``kind: continuation``."""
    from beamsim.cli.progress import progress_bar
    from beamsim.errors import NotTrustedError

    with progress_bar("following the response", wanted=not (json or quiet)) as progress:
        from beamsim.analyses.frequency_response import frequency_response

        result = frequency_response(scenario, progress)
    from beamsim.store.continuation import write_frequency_response

    files = [write_frequency_response(result, target)]
    if plots:
        from beamsim.plots.continuation import frequency_response_figures
        from beamsim.plots.save import save_figures

        files += save_figures(frequency_response_figures(result), target.parent, target.stem)
    for warning in result.warnings:
        say(f"beamsim: warning: {warning}")
    if json or not quiet:
        summary = {**result.summary, "wall_time_s": result.wall_time_s}
        from beamsim.cli.report import print_result

        print_result(result.title, summary, response_rows(result), files, as_json=json)
    if not result.complete:
        raise NotTrustedError(f"{result.status}; the partial result is in {target}")


def response_rows(result: FrequencyResponse) -> Iterator[tuple[str, str]]:
    """Label and text of every row of the table of a response curve."""
    if not result.complete:
        yield "status", result.status
    for branch in result.branches:
        stable = int(branch.stable.sum())
        yield (
            f"level {branch.level:.4g}, period {branch.period_multiple}",
            f"{branch.frequency_hz.size} points, {stable} of them stable; {branch.status}",
        )
        for event in branch.special[:SHOWN]:
            of = f" of {event.snubber}" if event.snubber else ""
            yield "", f"{event.kind.replace('_', ' ')}{of} at {event.frequency_hz:.8g} Hz"
    for peak in result.summary["peaks"]:
        yield "largest", f"{peak['probe']}: {peak['value_m']:.5g} m at {peak['frequency_hz']:.6g} Hz ({peak['kind']})"
    yield "solver", f"shooting, processor time {result.summary['processor_time_s']:.3g} s"
