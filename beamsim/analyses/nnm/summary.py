"""Summary of a nonlinear normal mode."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from beamsim.analyses.nnm.comparisons import ExpansionComparison, RelaxedComparison
from beamsim.analyses.nnm.phase_resonance import PhaseResonanceLevels
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.labelled import Dataset
from beamsim.typing import Bools, Floats


def nnm_summary(result: NormalModeResult) -> dict[str, Any]:
    """Compute the summary: backbone, drawn motion, other branches and comparisons.

    Parameters
    ----------
    result : result without a summary.

    Returns
    -------
    dict
        Entries of the summary; None for what was not computed.
    """
    backbone = result.branches[0]
    parameter, stable, share = (backbone[name].values for name in ("parameter", "stable", "share"))
    special = _special(result)
    jumps = result["jumps"].rows("jump", "start", "end", "mode", "ratio") if "jumps" in result.datasets else ()
    return {
        "points": parameter.size,
        "energy_error": float(result["points"]["energy_error"].values.max()),
        "start": _end(backbone, 0),
        "end": _end(backbone, -1),
        "period_s": 1.0 / float(backbone["frequency_hz"].values[-1]),
        "stable_points": int(np.count_nonzero(stable)),
        "largest_residual": float(backbone["residual"].values.max()),
        "smallest_share": float(share.min()),
        "smallest_share_at": float(parameter[share.argmin()]),
        "internal_resonances": [
            {"mode": branch["mode"].item(), "ratio": branch["ratio"].item(),
             "parameter": float(branch["parameter"].values[0]), "points": branch["parameter"].values.size}
            for branch in result.branches if branch["kind"].item() == "tongue"
        ],
        "jumps": [{**jump, "mode": jump["mode"] or None, "ratio": jump["ratio"] or None} for jump in jumps],
        "special_points": special,
        "motion_frequency_hz": 1.0 / float(result["motion"]["time"].values[-1]),
        "full_period": _full_period(result) if "half_period_difference" in result["points"] else None,
    }  # fmt: skip


def _special(result: NormalModeResult) -> list[dict[str, Any]]:
    return result["special_points"].rows("event", "kind", "parameter", "frequency_hz")


def _end(branch: Dataset, index: int) -> dict[str, float]:
    columns = {"parameter": "parameter", "frequency_hz": "frequency_hz", "energy_j": "energy"}
    return {name: float(branch[column].values[index]) for name, column in columns.items()}


def _full_period(result: NormalModeResult) -> dict[str, Any]:
    """Difference of full-period from half-period shooting, and the non-brake orbits."""
    difference = result.branches[0]["half_period_difference"].values
    return {
        "largest_difference": float(difference.max(initial=0.0)),
        "symmetry_breakings": [
            {"parameter": point["parameter"], "frequency_hz": point["frequency_hz"]}
            for point in _special(result)
            if point["kind"] == "symmetry_breaking"
        ],
        "never_at_rest": [
            {
                "mode": branch["mode"].item(),
                "ratio": branch["ratio"].item(),
                "points": branch["parameter"].values.size,
                "stable_points": int(np.count_nonzero(branch["stable"].values)),
                "start": _end(branch, 0),
                "end": _end(branch, -1),
                "largest_least_kinetic": float(branch["least_kinetic"].values.max()),
                "status": branch["status"].item(),
            }
            for branch in result.branches
            if branch["kind"].item() == "non_brake"
        ],
    }


_RELAXED_COLUMNS = ("steps", "tolerance", "shooting_motions", "shooting_processor_time_s", "cost_ratio")


def relaxed_summary(relaxed: RelaxedComparison) -> dict[str, Any]:
    """Summary of relaxed minimisation: range, accuracy and cost."""
    known = np.isfinite(relaxed.frequency_difference)
    return {
        **{name: getattr(relaxed, name) for name in _RELAXED_COLUMNS},
        "steps_converged": int(np.count_nonzero(relaxed.converged)),
        "largest_functional": float(relaxed.functional.max(initial=0.0)),
        "end": {
            "parameter": float(relaxed.factor[-1]),
            "frequency_hz": float(relaxed.frequency_hz[-1]),
            "period_s": 1.0 / float(relaxed.frequency_hz[-1]),
            "exact_frequency_hz": float(relaxed.exact_frequency_hz[-1]),
        },
        "largest_frequency_difference": float(relaxed.frequency_difference[known].max(initial=0.0)),
        "largest_shape_difference": float(relaxed.shape_difference[known].max(initial=0.0)),
        "nearby_motions": {name: relaxed.nearby_motion.count(name) for name in dict.fromkeys(relaxed.nearby_motion)},
        "silent_jumps": relaxed.factor[relaxed.jumped].tolist(),
        "motions": int(relaxed.motions.sum()),
        "processor_time_s": float(relaxed.processor_time_s.sum()),
        "status": relaxed.outcome.of_part,
    }


def expansion_summary(comparison: ExpansionComparison) -> dict[str, Any]:
    """Coefficients of the expansion, its errors, and the orders at which they vanish (medians over small factors)."""
    path = comparison.path
    small = path.factor <= path.small
    if small.sum() < 3:
        small[:] = True
    steps = small[:-1]
    return {
        "mode": path.mode,
        "linear_frequency_hz": path.linear_frequency_hz,
        "first_order_hz": path.first_hz,
        "second_order_hz": path.second_hz,
        "factors_well_below": path.reach,
        "factor": path.factor.tolist(),
        "frequency_hz": path.frequency_hz[:, 1:].tolist(),
        "exact_frequency_hz": comparison.exact.frequency_hz.tolist(),
        "frequency_difference": comparison.frequency_difference[:, 1:].tolist(),
        "initial_difference": comparison.initial_difference[:, 1:].tolist(),
        "orders_from": float(path.factor[small].max()),
        "orders_to": float(path.factor[small].min()),
        "observed_order_frequency": [_order(comparison.frequency_orders[:, k], steps) for k in (1, 2)],
        "observed_order_initial": [_order(comparison.initial_orders[:, k], steps) for k in (1, 2)],
        "expected_order_initial": [_order(comparison.expected_orders[:, k], steps) for k in (1, 2)],
        "observed_order_uniform": [_order(comparison.uniform_orders[:, k], steps) for k in (1, 2)],
        "asymptotic_well_below": path.pole,
        "nearest_pole": {"mode": path.pole_mode, "harmonic": path.pole_harmonic},
    }


def _order(orders: Floats, small: Bools) -> float:
    """Median of the observed orders at small factors; if all of these are round-off, the last order above it."""
    known = np.isfinite(orders)
    if np.any(known & small):
        return float(np.median(orders[known & small]))
    return float(orders[known][-1]) if np.any(known) else float("nan")


_LEVEL_FIELDS = (
    "level", "predicted_frequency_hz", "found", "frequency_hz", "level_for_amplitude", "energy_error", "stable",
)  # fmt: skip


def phase_resonance_summary(resonance: PhaseResonanceLevels) -> dict[str, Any]:
    """Summary of forced motions at phase resonance, level by level."""
    return {
        "quantity": resonance.quantity,
        "unit": resonance.unit,
        "probe": resonance.probes[resonance.compared_probe_index],
        "status": resonance.outcome.of_part,
        "levels": list(_level_summaries(resonance)),
    }


def _level_summaries(resonance: PhaseResonanceLevels) -> Iterator[dict[str, Any]]:
    for m in resonance.motions:
        peak, at = np.nan, np.nan
        if m.curve is not None:
            amplitude = m.curve.amplitude[resonance.compared_probe_index]
            k = int(np.argmax(amplitude))
            peak, at = float(amplitude[k]), float(m.curve.frequency_hz[k])
        yield {
            **{name: getattr(m, name) for name in _LEVEL_FIELDS},
            "predicted_energy_j": m.predicted_energy,
            "predicted_amplitude_m": float(m.predicted_amplitude[resonance.compared_probe_index]),
            "amplitude_m": float(m.amplitude[resonance.compared_probe_index]),
            "peak_frequency_hz": at,
            "peak_amplitude_m": peak,
            "curve": "" if m.curve is None else m.curve.outcome.of_part,
            "periods": 0 if m.uncontrolled is None else int(m.uncontrolled.departure.size),
            "departure_first_period": np.nan if m.uncontrolled is None else float(m.uncontrolled.departure[0]),
            "departure_last_period": np.nan if m.uncontrolled is None else float(m.uncontrolled.departure[-1]),
            "departure_largest": np.nan if m.uncontrolled is None else float(m.uncontrolled.departure.max()),
        }
