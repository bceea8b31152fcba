"""The summary as people read it, and as programs do."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.analyses.run.result import RunResult
from beamsim.plots.style import scale_for
from beamsim.store.schema import plain

LINES_SHOWN = 6
Row = tuple[str, str]


def print_json(values: Mapping[str, Any]) -> None:
    """One JSON object on standard output; what is not a finite number is null."""
    print(json.dumps(plain(values), ensure_ascii=False, allow_nan=False))


def print_files(files: Sequence[Path], *, as_json: bool) -> None:
    """The files a command wrote, one a line."""
    if as_json:
        print_json({"files": [str(path) for path in files]})
    else:
        print(*files, sep="\n")


def print_table(title: str, rows: Sequence[Row]) -> None:
    """A title and aligned rows on standard output."""
    width = max((len(label) for label, _ in rows), default=0)
    print(title)
    for label, text in rows:
        print(f"  {label:<{width}}  {text}".rstrip())


def run_rows(result: RunResult) -> Iterator[Row]:
    """Label and text of every row of the table of a run."""
    s = result.summary
    yield "time", f"{result.time[0]:g} to {result.time[-1]:g} s, {result.time.size} samples"
    low, high = s["min_displacement_m"], s["max_displacement_m"]
    yield from _each(
        "peak displacement",
        {
            name: f"{_si(value, 'm')} (from {_si(low[name], 'm')} to {_si(high[name], 'm')})"
            for name, value in s["peak_displacement_m"].items()
        },
    )
    yield from _each("peak acceleration", {name: f"{v:.4g} g" for name, v in s["peak_acceleration_g"].items()})
    yield from _each("peak contact force", {name: _si(v, "N") for name, v in s["peak_force_n"].items()})
    yield from _each(
        "time in contact",
        {
            name: f"{100 * v:.3g} %, {_counted(s['contacts'][name], 'contact')}"
            for name, v in s["contact_share"].items()
        },
    )
    yield from _each(
        "peak spring force",
        {
            name: f"{_si(v, 'N')} at a stretch of {_si(s['peak_stretch_m'][name], 'm')}"
            for name, v in s.get("peak_spring_force_n", {}).items()
        },
    )
    yield from _each("preload", {name: _preload(s, name) for name in s["gap_m"]})
    if "largest_bending_stress_pa" in s:
        where = _si(s["largest_bending_stress_position_m"], "m")
        yield "largest bending stress", f"{_si(s['largest_bending_stress_pa'], 'Pa')} at x = {where}"
    yield from margin_rows(s.get("margins", {}))
    yield from _each("spectral lines", dict(_spectral_lines(s["spectral_lines"])))
    states = {"open": _frequencies(s["open_frequencies_hz"]), "closed": _frequencies(s["closed_frequencies_hz"])}
    yield from _each("natural frequencies", states if result.snubbers else {"": states["open"]})
    yield (
        "reduction",
        f"{_counted(s['kept_modes'], 'mode')} and {_counted(s['static_vectors'], 'static vector')}, "
        f"estimated error {s['reduction_error']:.2g}",
    )
    yield "energy balance error", f"{s['energy_error']:.2g}"
    bends = s.get("breakpoints_passed", 0)
    passed = f", {_counted(bends, 'breakpoint')} of springs passed" if bends else ""
    yield (
        "solver",
        f"{s['method']}, {_counted(s['events'], 'event')}{passed}, processor time {_si(s['processor_time_s'], 's')}",
    )
    yield "wall time", _si(result.wall_time_s, "s")


def _each(label: str, texts: Mapping[str, str]) -> Iterator[Row]:
    width = max((len(name) for name in texts), default=0)
    for k, (name, text) in enumerate(texts.items()):
        yield "" if k else label, f"{name:<{width}}  {text}".strip()


def margin_rows(margins: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    """A row for every limit: margin, value and limit, and where the value was found."""
    from beamsim.analyses.limits import LIMITED

    texts = {}
    for name, item in margins.items():
        unit = LIMITED[name][1]
        margin = item["margin"]
        share = "unknown" if margin is None or math.isnan(margin) else f"{100 * margin:+.3g} %"
        verdict = "EXCEEDED, " if item["exceeded"] else ""
        at = f" at {item['at']}" if item["at"] else ""
        texts[name.replace("_", " ")] = (
            f"{verdict}margin {share}: {_si(item['value'], unit)}{at}, limit {_si(item['limit'], unit)}"
        )
    yield from _each("limits", texts)


def _si(value: float, unit: str) -> str:
    """A number with its unit, scaled by an SI prefix."""
    if value is None or not math.isfinite(value):
        return "unknown"
    scale = scale_for(unit, np.array([value]))
    return f"{value * scale.factor + 0.0:.4g} {scale.unit}"  # no minus sign before zero


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _preload(s: Mapping[str, Any], name: str) -> str:
    static = s["static_force_n"][name]
    parts = [f"gap {_si(s['gap_m'][name], 'm')}"]
    if static is not None and math.isfinite(static):
        parts.append(f"{_si(static, 'N')} at equilibrium")
    parts.append(f"{_si(s['blocked_force_n'][name], 'N')} blocked")
    ratio = "k L³/EI" if "largest_bending_stress_pa" in s else "k / largest spring"
    parts.append(f"{ratio} = {s['stiffness_ratio'][name]:.4g}")
    return ", ".join(parts)


def _frequencies(values: Sequence[float]) -> str:
    shown = ", ".join(f"{value:.4g}" for value in values[:4])
    return f"{shown}{', …' if len(values) > 4 else ''} Hz"


def _spectral_lines(lines: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """The strongest lines of the first probe: order (or Hz) and level, in order of frequency."""
    first = next((line["probe"] for line in lines), None)
    for quantity in dict.fromkeys(line["quantity"] for line in lines):
        own = [line for line in lines if (line["probe"], line["quantity"]) == (first, quantity)]
        strongest = sorted((k for k in own if k["kind"] != "mean"), key=lambda k: -k["amplitude"])[:LINES_SHOWN]
        shown = sorted(strongest, key=lambda k: float(k["frequency_hz"]))
        texts = [f"{_order(line)} ({line['amplitude_db']:.0f} dB)" for line in shown]
        yield f"{first} {quantity.replace('_', ' ')}", ", ".join(texts) or "none"


def _order(line: Mapping[str, Any]) -> str:
    order = line["order"]
    if order is None or not math.isfinite(order):
        return f"{line['frequency_hz']:.4g} Hz"
    if line["kind"] == "other":
        return f"{order:.3f}"
    fraction = Fraction(order).limit_denominator(12)
    return str(fraction)
