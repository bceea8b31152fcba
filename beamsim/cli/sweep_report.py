"""The table of a sweep."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from beamsim.analyses.sweep.result import ResponsePeak, SweepResult
from beamsim.cli.report import Row, _si, margin_rows

PEAKS_SHOWN = 6


def sweep_rows(result: SweepResult) -> Iterator[Row]:
    """Label and text of every row of the table."""
    for curve in result.curves.values():
        first = next(iter(curve.displacement), "")
        yield f"{curve.direction}, level {curve.level:.4g}", f"{curve.frequency_hz.size} points, peaks of {first}:"
        curve_peaks = [p for p in result.peaks if p.curve == curve.name and p.probe == first]
        for peak in curve_peaks[:PEAKS_SHOWN]:
            yield "", _peak(peak)
        for name, envelope in curve.force.items():
            yield "", f"largest force of {name}: {_si(float(envelope.peak.max(initial=0.0)), 'N')}"
        if curve.steady is not None:
            kinds = curve.steady.kind
            counted = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
            yield "", f"steady states: {counted}"
    yield from margin_rows(result.summary.get("margins", {}))
    frequencies = ", ".join(f"{f:.4g}" for f in result.modes.open_frequencies_hz[:4])
    yield "natural frequencies", f"open {frequencies}, … Hz"
    frequencies = ", ".join(f"{f:.4g}" for f in result.modes.closed_frequencies_hz[:4])
    yield "", f"closed {frequencies}, … Hz"
    work = result.work
    yield (
        "solver",
        f"{work.cycles} cycles, {work.events} contact events, processor time {_si(work.processor_time_s, 's')}",
    )
    yield "wall time", _si(result.wall_time_s, "s")


def _peak(peak: ResponsePeak) -> str:
    name = peak.kind
    if peak.order != 1.0:
        name += f" of order {Fraction(peak.order).limit_denominator(12)}"
    return f"{peak.frequency_hz:8.2f} Hz  {_si(peak.value_m, 'm'):>10}  {name}"
