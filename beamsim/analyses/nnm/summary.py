"""Summary of ``beamsim nnm`` as plain values: backbone, bifurcations and comparisons."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.branch import ModeBranch
from beamsim.analyses.nnm.result import ExpansionComparison, NormalModeResult, PhaseResonanceResult, RelaxedComparison
from beamsim.analyses.run.orbit_energy import largest_error
from beamsim.typing import Bools, Floats


def nnm_summary(
    result: NormalModeResult,
    linear_frequency_hz: float,
    processor_time_s: float,
    requested: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """The backbone, what leaves it and what it is compared with; not what repeats a field of the result."""
    backbone = result.backbone
    return {
        "points": int(backbone.parameter.size),
        "energy_error": largest_error(result.branches),
        "start": _end(backbone, 0),
        "end": _end(backbone, -1),
        "period_s": 1.0 / float(backbone.frequency_hz[-1]),
        "stable_points": int(np.count_nonzero(backbone.stable)),
        "largest_residual": float(backbone.residual.max()),
        "smallest_share": float(backbone.share.min()),
        "internal_resonances": [
            {"mode": b.mode, "ratio": b.ratio, "parameter": float(b.parameter[0]), "points": int(b.parameter.size)}
            for b in result.tongues
        ],
        "jumps": [
            {"start": j.start, "end": j.end, "mode": j.mode or None, "ratio": j.ratio or None} for j in result.jumps
        ],
        "grazings": sum(1 for event in backbone.special if event.kind in ("grazing", "nonsmooth_fold")),
        "special_points": [
            {"kind": e.kind, "parameter": e.parameter, "frequency_hz": e.frequency_hz}
            for e in backbone.special
            if e.kind in ("fold", "nonsmooth_fold", "branch_point")
        ],
        "requested_points": [dict(point) for point in requested] or None,
        "linear_frequency_hz": linear_frequency_hz,
        "motion_frequency_hz": 1.0 / float(result.motion.time[-1]),
        "processor_time_s": processor_time_s,
        "full_period": None if result.half_period_difference is None else _full_period(result),
        "multiple_scales": None if result.expansion is None else expansion_summary(result.expansion),
        "thesis": None if result.relaxed is None else _relaxed(result.relaxed),
        "phase_resonance": None if result.phase_resonance is None else _phase_resonance(result.phase_resonance),
    }


def _end(branch: ModeBranch, index: int) -> dict[str, float]:
    return {
        "parameter": float(branch.parameter[index]),
        "frequency_hz": float(branch.frequency_hz[index]),
        "energy_j": float(branch.energy[index]),
    }


def _full_period(result: NormalModeResult) -> dict[str, Any]:
    """Difference of full-period from half-period shooting, and the non-brake orbits."""
    return {
        "largest_difference": float(result.backbone.half_period_difference.max(initial=0.0)),
        "symmetry_breakings": [
            {"parameter": e.parameter, "frequency_hz": e.frequency_hz}
            for e in result.backbone.special
            if e.kind == "symmetry_breaking"
        ],
        "never_at_rest": [
            {
                "mode": b.mode,
                "ratio": b.ratio,
                "points": int(b.parameter.size),
                "stable_points": int(np.count_nonzero(b.stable)),
                "start": _end(b, 0),
                "end": _end(b, -1),
                "largest_least_kinetic": float(b.least_kinetic.max()),
                "status": b.status,
            }
            for b in result.non_brake
        ],
    }


def _relaxed(relaxed: RelaxedComparison) -> dict[str, Any]:
    """Relaxed minimisation: range, accuracy and cost."""
    known = np.isfinite(relaxed.frequency_difference)
    spent = float(relaxed.processor_time_s.sum())
    return {
        "steps": relaxed.steps,
        "steps_reached": relaxed.steps_reached,
        "tolerance": relaxed.tolerance,
        "largest_functional": float(relaxed.functional.max(initial=0.0)),
        "end": {
            "parameter": float(relaxed.factor[-1]),
            "frequency_hz": float(relaxed.frequency_hz[-1]),
            "period_s": 1.0 / float(relaxed.frequency_hz[-1]),
            "exact_frequency_hz": float(relaxed.exact_frequency_hz[-1]),
        },
        "largest_frequency_difference": float(relaxed.frequency_difference[known].max(initial=0.0)),
        "largest_shape_difference": float(relaxed.shape_difference[known].max(initial=0.0)),
        "followed": {fate: relaxed.fate.count(fate) for fate in dict.fromkeys(relaxed.fate)},
        "silent_jumps": relaxed.factor[relaxed.jumped].tolist(),
        "passages": int(relaxed.passages.sum()),
        "shooting_passages": relaxed.shooting_passages,
        "processor_time_s": spent,
        "shooting_processor_time_s": relaxed.shooting_processor_time_s,
        "cost_ratio": relaxed.cost_ratio,
        "status": relaxed.status,
    }


def expansion_summary(comparison: ExpansionComparison) -> dict[str, Any]:
    """The expansion's coefficients, its errors, and the orders in which they vanish (medians over small factors)."""
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
    """Median of the observed orders at small factors; if round-off dominates there, the last one above it."""
    known = np.isfinite(orders)
    if np.any(known & small):
        return float(np.median(orders[known & small]))
    return float(orders[known][-1]) if np.any(known) else float("nan")


def _phase_resonance(result: PhaseResonanceResult) -> dict[str, Any]:
    """Forced motions at phase resonance, level by level."""
    return {
        "status": result.status,
        "quantity": result.quantity,
        "unit": result.unit,
        "probe": result.probe,
        "levels": list(_level_summaries(result)),
    }


def _level_summaries(result: PhaseResonanceResult) -> Iterator[dict[str, Any]]:
    for m in result.motions:
        peak, at = np.nan, np.nan
        if m.curve is not None:
            k = int(np.argmax(m.curve.peak_displacement[result.probe]))
            peak, at = float(m.curve.peak_displacement[result.probe][k]), float(m.curve.frequency_hz[k])
        yield {
            "level": m.level,
            "predicted_frequency_hz": m.predicted_frequency_hz,
            "predicted_energy_j": m.predicted_energy,
            "predicted_amplitude_m": m.predicted_amplitude[result.probe],
            "found": m.found,
            "frequency_hz": m.frequency_hz,
            "amplitude_m": m.amplitude[result.probe],
            "level_for_amplitude": m.level_for_amplitude,
            "energy_error": m.energy_error,
            "stable": m.stable,
            "peak_frequency_hz": at,
            "peak_amplitude_m": peak,
            "curve": "" if m.curve is None else m.curve.outcome.text,
            "periods": 0 if m.held is None else int(m.held.departure.size),
            "departure_first_period": np.nan if m.held is None else float(m.held.departure[0]),
            "departure_last_period": np.nan if m.held is None else float(m.held.departure[-1]),
            "departure_largest": np.nan if m.held is None else float(m.held.departure.max()),
        }
