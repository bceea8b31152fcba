"""What the tables of ``beamsim compare`` and ``beamsim compare-modes`` tell beyond the entries of the summary."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.compare.result import ChannelComparison, Comparison, PeakPair
from beamsim.analyses.compare_modes import ModeComparison
from beamsim.cli.report import Labelled, Views
from beamsim.cli.tables import lines, percent
from beamsim.plots.style import amount, scale_for


def _channels(comparison: Comparison, _: Sequence[Any]) -> Labelled:
    parts = Labelled()
    for c in comparison.channels:
        begins = f", the run from {amount(c.start_s, 's')} on" if c.start_s is not None else ""
        differ = ""
        if math.isfinite(c.rms_difference):
            differ = f"histories differ by {percent(c.rms_difference)} rms after {_delay(c)}"
        harmonics = lines("harmonics", _harmonics(c))
        texts = [f"measured: {c.channel}{begins}", differ, *harmonics]
        parts[f"{c.place} {c.quantity.replace('_', ' ')}"] = [text for text in texts if text]
    return parts


def _harmonics(c: ChannelComparison) -> list[dict[str, Any]]:
    scale = scale_for(c.unit, np.abs(c.predicted), np.abs(c.measured))
    rows = zip(c.order.tolist(), c.predicted, c.measured, c.difference_db, c.phase_difference_deg, strict=True)
    return [
        {
            "harmonic": order,
            "predicted": f"{abs(p) * scale.factor:.4g} {scale.unit}",
            "measured": f"{abs(m) * scale.factor:.4g} {scale.unit}",
            "difference": f"{d:+.2f} dB" if math.isfinite(d) else "one of them is round-off",
            "phase": f"{a:+.1f} deg" if math.isfinite(a) else "",
        }
        for order, p, m, d, a in rows
    ]


def _delay(c: ChannelComparison) -> str:
    periods = abs(c.delay_s) * (c.excitation_hz if math.isfinite(c.excitation_hz) else 1.0)
    return "no delay" if periods < 1e-9 else f"a delay of {amount(c.delay_s, 's')}"


def _sweeps(comparison: Comparison, _: Sequence[Any]) -> Labelled:
    parts = Labelled()
    for c in comparison.sweeps:
        texts = [f"measured: {c.channel}, {c.detector} of {c.curve}"]
        if c.begin_s is not None:
            width = "" if c.bandwidth is None else f", bandwidth {100 * c.bandwidth:.3g} % of the frequency"
            texts.append(f"tracked from {amount(c.begin_s, 's')} of the record{width}")
        texts.append(f"FRAC {c.frac:.4f}" + ("" if c.has_phase else " (of amplitudes)"))
        parts[f"{c.place} {c.quantity.replace('_', ' ')}"] = [*texts, *lines("peaks", _peaks(c.peaks, c.unit))]
    if comparison.assurance is not None:
        diagonal = np.diagonal(comparison.assurance.fdac)
        lowest = f"lowest {np.min(diagonal):.3f} at {comparison.assurance.measured_hz[np.argmin(diagonal)]:.4g} Hz"
        parts["FDAC"] = f"at equal frequencies {np.mean(diagonal):.3f} in the mean, {lowest}"
    return parts


def _peaks(peaks: Iterable[PeakPair], unit: str) -> list[dict[str, Any]]:
    """What was measured and what is computed near it; of the computed peak nothing where none is near."""
    rows = []
    for p in peaks:
        row = {"measured": f"{p.measured_hz:.2f} Hz", "level": amount(p.measured_level, unit), "Q": p.measured_q}
        if math.isfinite(p.predicted_hz):
            row |= {"predicted": f"{p.predicted_hz:.2f} Hz", "its level": amount(p.predicted_level, unit)}
            row |= {"its Q": p.predicted_q, "difference": f"{100 * p.frequency_difference:+.2f} %"}
            row["in level"] = f"{p.difference_db:+.2f} dB"
        rows.append(row)
    return rows


def _pairs(result: ModeComparison, pairs: Sequence[Mapping[str, Any]]) -> Labelled:
    rows = [
        {
            "measured": pair["number"], "at_hz": pair["measured_hz"], "computed": pair["predicted"] or "none fits",
            "computed_at_hz": pair["predicted_hz"],
            "difference": f"{100 * pair['difference']:+.2f} %" if pair["predicted"] else "",
            "MAC": f"{pair['mac']:.3f}",
        }
        for pair in pairs
    ]  # fmt: skip
    return Labelled(
        {"": rows, "shapes": f"of {result.source}, with those of the structure, contacts {result.contacts}"}
    )


VIEWS: Views = {"comparisons": _channels, "sweeps": _sweeps}
VIEWS_OF_MODES: Views = {
    "pairs": _pairs,
    "lowest_mac": lambda _, mac: f"{mac:.3f}",
    "largest_difference": lambda _, difference: percent(difference),
}
