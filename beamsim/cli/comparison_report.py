"""Texts of the table of ``beamsim compare``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.compare.result import ChannelComparison, Comparison
from beamsim.cli.report import Row, Texts, percent
from beamsim.plots.style import amount, scale_for


def _channels(comparison: Comparison, _: Sequence[Any]) -> Iterator[Row]:
    for c in comparison.channels:
        part = f", the run from {amount(c.start_s, 's')} on" if c.start_s is not None else ""
        yield f"{c.place} {c.quantity.replace('_', ' ')}", f"measured: {c.channel}{part}"
        if math.isfinite(c.rms_difference):
            yield "  histories", f"differ by {percent(c.rms_difference)} rms after {_delay(c)}"
        scale = scale_for(c.unit, np.abs(c.predicted), np.abs(c.measured))
        for n, p, m, d, a in zip(
            c.order, c.predicted, c.measured, c.difference_db, c.phase_difference_deg, strict=True
        ):
            text = f"predicted {abs(p) * scale.factor:9.4g}, measured {abs(m) * scale.factor:9.4g} {scale.unit}"
            phase = f", {a:+.1f} deg" if math.isfinite(a) else ""
            difference = f"difference {d:+.2f} dB{phase}" if math.isfinite(d) else "one of them is round-off"
            yield f"  harmonic {n}", f"{text}, {difference}"


def _delay(c: ChannelComparison) -> str:
    periods = abs(c.delay_s) * (c.excitation_hz if math.isfinite(c.excitation_hz) else 1.0)
    return "no delay" if periods < 1e-9 else f"a delay of {amount(c.delay_s, 's')}"


def _sweeps(comparison: Comparison, _: Sequence[Any]) -> Iterator[Row]:
    for c in comparison.sweeps:
        yield f"{c.place} {c.quantity.replace('_', ' ')}", f"measured: {c.channel}, {c.detector} of {c.curve}"
        if c.begin_s is not None:
            width = "" if c.bandwidth is None else f", bandwidth {100 * c.bandwidth:.3g} % of the frequency"
            yield "  tracked", f"from {amount(c.begin_s, 's')} of the record{width}"
        yield "  FRAC", f"{c.frac:.4f}" + ("" if c.has_phase else " (of amplitudes)")
        for number, peak in enumerate(c.peaks, 1):
            measured = (
                f"measured {peak.measured_hz:.2f} Hz, {amount(peak.measured_level, c.unit)}{_quality(peak.measured_q)}"
            )
            if not math.isfinite(peak.predicted_hz):
                yield f"  peak {number}", f"{measured}; no computed peak is near"
                continue
            predicted = (
                f"{peak.predicted_hz:.2f} Hz, {amount(peak.predicted_level, c.unit)}{_quality(peak.predicted_q)}"
            )
            difference = f"{100 * peak.frequency_difference:+.2f} %, {peak.difference_db:+.2f} dB"
            yield f"  peak {number}", f"{measured}; predicted {predicted}; difference {difference}"
    if comparison.assurance is not None:
        diagonal = np.diagonal(comparison.assurance.fdac)
        f = comparison.assurance.measured_hz
        yield (
            "FDAC",
            f"at equal frequencies {np.mean(diagonal):.3f} in the mean, lowest {np.min(diagonal):.3f} at "
            f"{f[np.argmin(diagonal)]:.4g} Hz",
        )


def _quality(q: float) -> str:
    return f", Q {q:.3g}" if math.isfinite(q) else ""


TEXTS: Texts = {"comparisons": _channels, "sweeps": _sweeps}
