"""``beamsim sweep`` with ``kind: continuation``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.branch import special_name

if TYPE_CHECKING:
    from beamsim.analyses.branch import BranchResult
    from beamsim.analyses.response.result import FrequencyResponse
    from beamsim.cli.conclusion import Reporting
    from beamsim.scenario import Scenario

SHOWN = 12  # special points of a branch in a table
MOST_BRANCHES = 12  # in a table


def continue_response(
    scenario: Scenario, target: Path, reporting: Reporting, overlay: Sequence[Path], *, expansion: bool
) -> None:
    """Follow the response, add the requested overlays, save and print.

    Raises
    ------
    ScenarioError, ResultFileError
        Before the computation, if the scenario or a file cannot be used.
    StoppedEarlyError
        If the range was not covered, the result is not reliable, or after a signal; the partial result is saved.
    LimitExceededError
        With ``--check``.
    """
    from beamsim.cli.conclusion import finish
    from beamsim.cli.interruption import interruptible
    from beamsim.cli.progress import progress_bar
    from beamsim.store.results import open_sweep

    stored = [(path, open_sweep(path)) for path in overlay]
    bar = progress_bar("following the response", shown=reporting.progress)
    with interruptible() as interrupted, bar as progress:
        from beamsim.analyses.response.analysis import frequency_response

        result = frequency_response(scenario, progress, interrupted)
    for path, sweep in stored:
        from beamsim.analyses.response.overlay import with_overlay

        result = with_overlay(result, sweep, path.name)
    if expansion and not interrupted():
        from beamsim.cli.multiple_scales import compare_response

        result = compare_response(result)
    finish("continuation", result, target, reporting, interrupted.signal)


def response_rows(result: FrequencyResponse) -> Iterator[tuple[str, str]]:
    """Label and text of every row of the table of a response curve."""
    from beamsim.cli.report import margin_rows

    for branch in result.branches[:MOST_BRANCHES]:
        stable = int(branch.stable.sum())
        yield _label(branch), f"{branch.parameter.size} points, {stable} of them stable; {branch.status}"
        if branch.period_multiple > 1:
            continue
        for event in branch.special[:SHOWN]:
            snubber = f" of {event.snubber}" if event.snubber else ""
            yield "", f"{special_name(event.kind)}{snubber} at {event.parameter:.8g} {result.unit}"
        if len(branch.special) > SHOWN:
            yield "", f"and {len(branch.special) - SHOWN} more special points in the file"
    if len(result.branches) > MOST_BRANCHES:
        yield "", f"and {len(result.branches) - MOST_BRANCHES} more branches in the file"
    for peak in result.summary["peaks"]:
        at = f"{peak['parameter']:.6g} {result.unit}"
        yield "largest", f"{peak['probe']}: {peak['value_m']:.5g} m at {at} ({peak['kind']})"
    for curve in result.summary.get("fold_curves", []):
        if curve["points"]:
            reach = f"{curve['smallest_parameter']:.5g} to {curve['largest_parameter']:.5g} {result.second_unit}"
            yield (
                f"fold at {curve['start_hz']:.6g} Hz",
                f"{result.second_parameter} {reach}, {curve['smallest_hz']:.5g} to {curve['largest_hz']:.5g} Hz, "
                f"{curve['points']} points" + (f", {curve['touching']} grazing" if curve["touching"] else ""),
            )
        else:
            yield f"fold at {curve['start_hz']:.6g} Hz", curve["status"]
    for overlaid in result.overlay.values():
        how = "swept" if overlaid.steady is None else "stepped"
        yield "overlay", f"{how} {overlaid.direction}, level {overlaid.level:.4g} {overlaid.source}".rstrip()
    yield from margin_rows(result.summary.get("margins", {}))
    if result.expansion:
        from beamsim.cli.multiple_scales import forced_expansion_rows

        yield from forced_expansion_rows(result.expansion)
    if "neglected_harmonics" in result.summary:
        share = f"{100 * result.summary['neglected_harmonics']:.2g} %"
        yield "neglected harmonics", f"at most {share} of the motion"
    method = result.method.replace("_", " ")
    yield "solver", f"{method}, processor time {result.summary['processor_time_s']:.3g} s"


def _label(branch: BranchResult) -> str:
    level = "" if np.isnan(branch.level) else f"level {branch.level:.4g}, "
    return f"{level}period {branch.period_multiple}"
