"""What ``beamsim nnm --compare multiple_scales`` adds: rows, a summary and a picture."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from beamsim.analyses.multiple_scales import ExpansionComparison
    from beamsim.scenario import Scenario

__all__ = ["compare", "expansion_rows", "expansion_summary"]


def compare(scenario: Scenario, target: Path, *, plots: bool) -> tuple[ExpansionComparison, list[Path]]:
    """Expand the scenario's mode, compare with exact motions, and draw both beside the result file."""
    from beamsim.analyses.multiple_scales import expand_nnm

    comparison = expand_nnm(scenario)
    files: list[Path] = []
    if plots:
        from beamsim.plots.multiple_scales import comparison_figure
        from beamsim.plots.save import save_figures

        files = save_figures({"multiple_scales": comparison_figure(comparison)}, target.parent, target.stem)
    return comparison, files


def _order(orders: Any) -> float:
    """Median of the observed orders that round-off has not spoilt."""
    seen = orders[np.isfinite(orders)]
    return float(np.median(seen)) if seen.size else float("nan")


def expansion_summary(comparison: ExpansionComparison) -> dict[str, Any]:
    """Numbers for ``--json``."""
    path = comparison.path
    return {
        "mode": path.mode,
        "linear_frequency_hz": path.linear_frequency_hz,
        "first_order_hz": path.first_hz,
        "second_order_hz": path.second_hz,
        "factors_well_below": path.reach,
        "factor": path.factor.tolist(),
        "frequency_hz": path.frequency_hz[:, 1:].tolist(),
        "exact_frequency_hz": comparison.exact.frequency_hz.tolist(),
        "observed_order_frequency": [_order(comparison.frequency_orders[:, k]) for k in (1, 2)],
        "observed_order_initial": [_order(comparison.initial_orders[:, k]) for k in (1, 2)],
    }


def expansion_rows(comparison: ExpansionComparison) -> Iterator[tuple[str, str]]:
    """Label and text of every row of the table."""
    s, path = expansion_summary(comparison), comparison.path
    frequency, initial = s["observed_order_frequency"], s["observed_order_initial"]
    series = f"{path.linear_frequency_hz:.6g} Hz {path.first_hz:+.4g} e {path.second_hz:+.4g} e² Hz"
    yield "multiple scales", f"{series}, for factors e well below {path.reach:.2g}"
    yield (
        "observed orders",
        f"frequency {frequency[0]:.2f} and {frequency[1]:.2f}, initial vector {initial[0]:.2f} and {initial[1]:.2f} "
        "(expected 2 and 3)",
    )
