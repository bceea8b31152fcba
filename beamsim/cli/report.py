"""Summaries as tables and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.analyses.result import Result
from beamsim.analyses.run.result import RunResult
from beamsim.plots.style import scale_for
from beamsim.store.schema import plain

LINES_SHOWN = 6
Row = tuple[str, str]
Summary = Mapping[str, Any]
Text = Callable[[Summary, str, Any], str]  # of the summary, a name in it and its value
Rows = Callable[[Summary], Mapping[str, str]]


def print_json(values: Mapping[str, Any]) -> None:
    """One JSON object on standard output; non-finite numbers are null."""
    print(json.dumps(plain(values), ensure_ascii=False, allow_nan=False))


def print_files(files: Sequence[Path], *, as_json: bool) -> None:
    """Print the files written by a command, one per line."""
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
    yield "time", f"{result.time[0]:g} to {result.time[-1]:g} s, {result.time.size} samples"
    yield from quantity_rows(result, _RUN_TEXTS, _RUN_ROWS)
    yield "wall time", _si(result.wall_time_s, "s")


def summary_rows(result: Result) -> Iterator[Row]:
    """A row for every quantity of the summary that has a label, as number and unit."""
    return quantity_rows(result, {}, {})


def quantity_rows(result: Result, texts: Mapping[str, Text], rows: Mapping[str, Rows]) -> Iterator[Row]:
    """A row for every quantity of the summary with a label, or one for each of its names.

    Parameters
    ----------
    texts : by quantity, the text of its value if that is not number and unit.
    rows : by quantity, all rows of quantities that are lists.
    """
    s = result.summary
    for quantity in type(result).SUMMARY:
        if not quantity.label or quantity.name not in s:
            continue
        value = s[quantity.name]
        text = texts.get(quantity.name, lambda _, __, number, unit=quantity.unit: _si(number, unit))
        if quantity.name in rows:
            yield from _each(quantity.label, rows[quantity.name](s))
        elif isinstance(value, Mapping):
            yield from _each(quantity.label, {name: text(s, name, item) for name, item in value.items()})
        else:
            yield quantity.label, text(s, "", value)


def _displacement(s: Summary, name: str, value: Any) -> str:
    low, high = s["min_displacement_m"][name], s["max_displacement_m"][name]
    return f"{_si(value, 'm')} (from {_si(low, 'm')} to {_si(high, 'm')})"


def _contact(s: Summary, name: str, share: Any) -> str:
    return f"{100 * share:.3g} %, {_counted(s['contacts'][name], 'contact')}"


def _spring_force(s: Summary, name: str, force: Any) -> str:
    return f"{_si(force, 'N')} at an elongation of {_si(s['peak_stretch_m'][name], 'm')}"


def _stress(s: Summary, _: str, stress: Any) -> str:
    body = f"{s['largest_bending_stress_body']}, " if "largest_bending_stress_body" in s else ""
    return f"{_si(stress, 'Pa')} at {body}x = {_si(s['largest_bending_stress_position_m'], 'm')}"


def _reduction(s: Summary, _: str, error: Any) -> str:
    kept = f"{_counted(s['kept_modes'], 'mode')} and {_counted(s['static_vectors'], 'static vector')}"
    return f"{kept}, estimated error {error:.2g}"


def _solver(s: Summary, _: str, time: Any) -> str:
    bends = s.get("breakpoints_passed", 0)
    passed = f", {_counted(bends, 'breakpoint')} of springs passed" if bends else ""
    return f"{s['method']}, {_counted(s['events'], 'event')}{passed}, processor time {_si(time, 's')}"


def _natural_frequencies(s: Summary) -> dict[str, str]:
    states = {"open": _frequencies(s["open_frequencies_hz"]), "closed": _frequencies(s["closed_frequencies_hz"])}
    return states if s["gap_m"] else {"": states["open"]}


def _each(label: str, texts: Mapping[str, str]) -> Iterator[Row]:
    width = max((len(name) for name in texts), default=0)
    for k, (name, text) in enumerate(texts.items()):
        yield "" if k else label, f"{name:<{width}}  {text}".strip()


def margin_rows(margins: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    """A row for every limit: margin, value with its place, and limit."""
    yield from _each("limits", _margins(margins))


def _margins(margins: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
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
    return texts


def _si(value: float, unit: str) -> str:
    """A number with SI prefix and unit."""
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
    parts.append(f"stiffness ratio {s['stiffness_ratio'][name]:.4g}")
    return ", ".join(parts)


def _frequencies(values: Sequence[float]) -> str:
    shown = ", ".join(f"{value:.4g}" for value in values[:4])
    return f"{shown}{', …' if len(values) > 4 else ''} Hz"


def _spectral_lines(lines: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """The strongest lines of the first probe: order (or Hz) and level, in order of frequency."""
    first = next((line["probe"] for line in lines), None)
    for quantity in dict.fromkeys(line["quantity"] for line in lines):
        matching = [line for line in lines if (line["probe"], line["quantity"]) == (first, quantity)]
        strongest = sorted((k for k in matching if k["kind"] != "mean"), key=lambda k: -k["amplitude"])[:LINES_SHOWN]
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


_RUN_TEXTS: dict[str, Text] = {
    "peak_displacement_m": _displacement,
    "peak_acceleration_g": lambda _, __, value: f"{value:.4g} g",
    "contact_share": _contact,
    "peak_spring_force_n": _spring_force,
    "gap_m": lambda s, name, _: _preload(s, name),
    "largest_bending_stress_pa": _stress,
    "reduction_error": _reduction,
    "energy_error": lambda _, __, value: f"{value:.2g}",
    "processor_time_s": _solver,
}
_RUN_ROWS: dict[str, Rows] = {
    "margins": lambda s: _margins(s["margins"]),
    "spectral_lines": lambda s: dict(_spectral_lines(s["spectral_lines"])),
    "open_frequencies_hz": _natural_frequencies,
}
