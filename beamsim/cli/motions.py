"""First screens of runs and sweeps."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.run.result import RunResult
from beamsim.cli.screens import (
    MOST_SHOWN,
    Errors,
    Screen,
    contact_levels,
    limit_lines,
    limits_by_place,
    limits_in_test,
)
from beamsim.outcomes import first_of
from beamsim.plots.run import damage_text
from beamsim.plots.style import amount, is_known, percent, scale_for
from beamsim.results.competition import ALIKE
from beamsim.results.values import limit_label, parse_limit
from beamsim.scenario.quantities import acceleration_amplitude, power_of
from beamsim.scenario.scenario import profile_jumps
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.summaries import words

if TYPE_CHECKING:
    from beamsim.analyses.sweep.result import SweepCurve, SweepResult


def run_screen(result: RunResult) -> Screen:
    """Forces, contact, displacements, accelerations and limits by place."""
    s, errors = result.summary, Errors(result)
    limits = limits_by_place(result) if s.get("margins") else {}
    lines, stress = list[str](), s.get("largest_bending_stress_pa")
    if stress is not None and is_known(stress):
        body = f"{s['largest_bending_stress_body']}, " if "largest_bending_stress_body" in s else ""
        at = {"x": s["largest_bending_stress_position_m"]}
        if is_known(y := s.get("largest_bending_stress_y_m")):
            at["y"] = y
        where = ", ".join(f"{axis} = {amount(place, 'm') if place else '0'}" for axis, place in at.items())
        lines.append(f"bending stress {errors.number(stress, 'Pa', 'largest_bending_stress_pa')} at {body}{where}")
    histories = result["histories"]
    rings = s.get("rings") or {}
    names = list(dict.fromkeys((*rings, *histories.labels("snubber"), *histories.labels("probe"))))
    for entry, lines_of in OPTIONAL_LINES.items():
        if s.get(entry):
            lines += lines_of(result, errors)
    lines += limit_lines(result, names) if limits else []
    lines += _reference_lines(result) if s.get("against") else []
    rows = [_place(s, errors, name, limits) for name in names]
    return Screen(errors.verdict(), rows, [*lines, *errors.legend()])


def _output_peaks(result: RunResult, errors: Errors) -> Iterator[str]:
    s = result.summary
    outputs = (
        f"{name} {errors.number(peak, s['output_unit'][name], 'peak_output', name)}"
        for name, peak in s["peak_output"].items()
    )
    yield f"peaks of outputs: {first_of(list(outputs), MOST_SHOWN)}"


def _inputs(result: RunResult, _: Errors) -> Iterator[str]:
    """Inputs that were modified: clipped, filtered, corrected."""
    rows = result["inputs"].rows("number")
    stated = {row["path"] for row in rows if row["treatment"]}  # sizes are in the line with the interpretation
    yield from (f"{path}: {text}" for path, text in input_texts(result).items() if path in stated)


def _matched_lines(result: RunResult, _: Errors) -> Iterator[str]:
    of = result.summary["matched"]
    band = f"{of['from_hz']:g} to {of['to_hz']:g} Hz, Q = {of['quality']:g}"
    ends = f"{of['lowest_db']:+.1f} to {of['highest_db']:+.1f} dB"
    yield f"base motion: spectrum {ends} from the curve, {band}"


def _largest_of_test(result: RunResult, _: Errors) -> Iterator[str]:
    random = result["random"]
    limits = [parse_limit(name) for name in result.summary.get("margins", {})]

    def compared(signal: Mapping[str, Any]) -> bool:
        return any(value.on_peak_of(signal) and place in ("", signal["name"]) for value, place in limits)

    responses = [of for of in random.rows("signal") if of["section"] != "excitation"]
    signals = sorted(responses, key=lambda of: (not compared(of), of["quantity"] != "force"))
    largest = [f"{of['name']} {words(of['quantity'])} {text}" for of in signals if (text := _expected_peak(of))]
    if largest:
        shown = max(MOST_SHOWN, sum(map(compared, signals)))  # all values with limits
        yield f"largest in {amount(random['test_duration_s'].item(), 's')} of test: {first_of(largest, shown)}"
    yield from limits_in_test(result)


def _sensitivities(result: RunResult, _: Errors) -> Iterator[str]:
    changing = [(name, of) for name, of in sensitivity_texts(result).items() if name.startswith(("peak f", "peak d"))]
    yield from (f"{name}: {first_of(of, MOST_SHOWN)}" for name, of in changing[:MOST_SHOWN])


def _fatigue(result: RunResult, _: Errors) -> Iterator[str]:
    for name, body in result.summary["fatigue"].items():
        yield f"damage of {name} {damage_text(result, body)}"


def _reference_lines(result: RunResult) -> Iterator[str]:
    compared = result.summary["against"]
    apart, until = percent(compared["largest_state_difference"], 2), compared["agrees_until_s"]
    last = result["histories"]["time"].values[-1]
    diverge = "" if until >= last else f" until {until:.4g} s, where the contact sequences diverge"
    yield f"{compared['method']}: displacements differ by at most {apart}{diverge}"


OPTIONAL_LINES: Mapping[str, Callable[[RunResult, Errors], Iterable[str]]] = {
    "gapping": contact_levels,
    "peak_output": _output_peaks,
    "inputs": _inputs,
    "matched": _matched_lines,
    "random": _largest_of_test,
    "sensitivities": _sensitivities,
    "fatigue": _fatigue,
}
"""Lines that only some runs have, by entry of the summary."""


def input_texts(result: RunResult) -> dict[str, str]:
    """Size of a random input or record, sampling and treatment, by path in the excitation."""
    texts = {}
    for row in result["inputs"].rows("number"):
        band = f", {row['from_hz']:.4g} to {row['to_hz']:.4g} Hz" if is_known(row["from_hz"]) else ""
        unit, rms = "g" if row["unit"] == "m/s^2" else row["unit"], row["rms"]
        size = f"rms {rms / STANDARD_GRAVITY:.4g} g" if unit == "g" else f"rms {amount(rms, unit)}"
        rate = "" if band else f", {amount(row['sample_rate_hz'], 'Hz')}"
        texts[row["path"]] = f"{size}{band}{rate}{f'; {treatment}' if (treatment := row['treatment']) else ''}"
    return texts


def sensitivity_texts(result: RunResult) -> dict[str, list[str]]:
    """Changes of each value over the tolerance of each number, the largest first.

    If another extreme takes over, the change for smaller numbers is different and is listed, too.
    """
    texts: dict[str, list[str]] = {}

    def size(row: Mapping[str, Any]) -> float:
        return float(max(abs(row["change"]), abs(row["change_below"])))

    def change(value: float, unit: str) -> str:
        return f"{'-' if value < 0.0 else '+'}{amount(abs(value), unit, 3)}"

    for row in sorted(result["sensitivities"].rows("row"), key=size, reverse=True):
        _, *place, quantity = ("", *row["response"].split("/"))[-3:]
        tolerance, unit = amount(row["tolerance"], row["number_unit"], 3), row["value_unit"]
        text = f"{row['path']} +{tolerance}: {change(row['change'], unit)}"
        if abs(row["change"] + row["change_below"]) > ALIKE * size(row):
            text += f", -{tolerance}: {change(row['change_below'], unit)}"
        texts.setdefault(" of ".join([words(quantity), *place]), []).append(text)
    return texts


def _expected_peak(signal: Mapping[str, Any]) -> str:
    """Largest value of a test with its interval; empty if there is none."""
    if not is_known(signal.get("expected_peak")):
        return "not reliable" if signal.get("expected_peak_unknown") else ""
    names = ("expected_peak", "expected_peak_low", "expected_peak_high")
    expected, low, high = (amount(signal[name], signal["unit"], 3) for name in names)
    return f"{expected} ({low} to {high}, 95 %)"


def _place(s: Mapping[str, Any], errors: Errors, name: str, limits: Mapping[str, list[str]]) -> dict[str, str]:
    """Row of a place: a probe, a snubber or ring, or both."""
    headings = "", "peak force", "penetration", "peak moment", "in contact, times", "displacement", "acceleration"
    row = dict.fromkeys(headings, "") | {"": name}
    forces = (("peak force", "peak_force_n", "N"), ("peak moment", "peak_moment_n_m", "N m"),
              ("peak force", "peak_ring_force_n", "N"))  # fmt: skip
    for heading, entry, unit in forces:
        if name in s.get(entry, ()):
            row[heading] = errors.number(s[entry][name], unit, entry, name)
    if name in s["contact_share"]:
        share = percent(s["contact_share"][name]) + errors.mark("contact_share", name)
        row["in contact, times"] = f"{share}, {s['contacts'][name]}{errors.mark('contacts', name)}"
    if name in (s.get("rings") or {}):
        row["in contact, times"] = percent(s["rings"][name]["contact_share"])
        row["penetration"] = errors.number(s["ring_penetration_m"][name], "m", "ring_penetration_m", name)
    if name in s["max_displacement_m"]:
        low, high = (
            errors.number(s[entry][name], "m", entry, name, s["peak_displacement_m"][name])
            for entry in ("min_displacement_m", "max_displacement_m")
        )
        first, _, unit = low.partition(" ")
        row["displacement"] = f"{first if high.partition(' ')[2].startswith(unit) else low} to {high}"
        row["acceleration"] = errors.number(s["peak_acceleration_g"][name], "g", "peak_acceleration_g", name)
    return row | {"limit": "; ".join(limits.get(name, ()))}


def sweep_screen(result: SweepResult) -> Screen:
    """Largest values of each curve, with frequency and place."""
    s, errors = result.summary, Errors(result)
    of = (
        ("peak_force_n", "force", "N", "peak force"), ("peak_displacement_m", "displacement", "m", "displacement"),
        ("peak_acceleration_g", "absolute_acceleration", "g", "acceleration"),
    )  # fmt: skip
    rows = []
    for name, curve in result.curves.items():
        called, level = _curve_text(curve), scale_for(curve.level_unit, curve.level)
        row = {"": called if level.unit in ("", "g") else f"{called}{in_gravities(curve)}"}
        for entry, quantity, unit, heading in of:
            values = s.get(entry, {}).get(name, {})
            place = max(values, key=lambda at: values[at], default="")
            at = at_frequency(curve, quantity, place)
            where = f", {place}" if len(values) > 1 else ""
            row[heading] = f"{errors.number(values[place], unit, entry, f'{name} {place}')}{at}{where}" if at else ""
        shares = s.get("contact_share", {}).get(name, {})
        row["in contact"] = ", ".join(
            percent(share) + errors.mark("contact_share", f"{name} {at}") for at, share in shares.items()
        )
        rows.append(row)
    notches = [f"{name} {text}" for name, text in list(notch_texts(result).items())[:MOST_SHOWN]]
    lines = [
        *contact_levels(result, errors), *list(_output_lines(result, errors))[:MOST_SHOWN],
        *profile_jumps(result.scenario), *notches, *limit_lines(result), *_exceeded_in(result), *errors.legend(),
    ]  # fmt: skip
    return Screen(errors.verdict(), rows, lines)


def _curve_text(curve: SweepCurve) -> str:
    """Direction and level of a curve, such as ``up, 2 g``."""
    level = scale_for(curve.level_unit, curve.level)
    return f"{curve.direction}, {curve.level * level.factor:.4g} {level.unit}".rstrip()


def _exceeded_in(result: SweepResult) -> Iterator[str]:
    """Curves that exceed each limit, if there are several curves."""
    for name, of in result.summary.get("margins", {}).items() if len(result.curves) > 1 else ():
        value, place = parse_limit(name)
        by_curve = result.summary.get(value.entry, {})
        if of["exceeded"] and set(by_curve) == set(result.curves):
            largest = {
                curve: max((x for at, x in by_curve[curve].items() if place in ("", at)), default=0.0) * value.scale
                for curve in by_curve
            }
            over = [_curve_text(result.curves[curve]) for curve, x in largest.items() if x > of["limit"]]
            yield f"{limit_label(name)} exceeded in {len(over)} of {len(largest)} sweeps: " + "; ".join(
                over[:MOST_SHOWN]
            )


def in_gravities(curve: SweepCurve) -> str:
    """Base acceleration along a curve in g, as an addition to its level; empty for a force."""
    if curve.excitation_unit != "m/s^2":
        return ""
    sizes = np.abs(curve.excitation_amplitude) / STANDARD_GRAVITY
    low, high = float(sizes.min()), float(sizes.max())
    return f" ({high:.3g} g)" if high - low <= 1e-3 * high else f" ({low:.3g} to {high:.3g} g)"


def at_frequency(curve: SweepCurve, quantity: str, name: str) -> str:
    """Frequency of the largest value of a curve, as an addition to the value.

    Parameters
    ----------
    curve : curve of the sweep.
    quantity : displacement, absolute_acceleration or force.
    name : name of the probe or snubber.

    Returns
    -------
    Text; empty if nothing moves, or the place is unknown.
    """
    if name not in curve.places(quantity):
        return ""
    peak = curve.channel(quantity, name).peak
    if not np.any(np.isfinite(peak)) or not np.nanmax(peak) > 0.0:
        return ""
    where = f" at {curve.frequency_hz[np.nanargmax(peak)]:.4g} Hz"
    if quantity != "displacement" or not (offset := curve.offset(name)):
        return where
    response = curve.response(name)
    k = int(np.nanargmax(response))
    from_equilibrium = f"{amount(float(response[k]), 'm')} at {curve.frequency_hz[k]:.4g} Hz"
    return f"{where} ({from_equilibrium} from equilibrium at {amount(offset, 'm')})"


def _output_lines(result: SweepResult, errors: Errors) -> Iterator[str]:
    """Peak of each output, with its quantity and frequency, by curve."""
    for curve, peaks in result.summary.get("peak_output", {}).items():
        for name, peak in peaks.items():
            output = result["cycles"].sel(output=name)
            quantity, unit, at = (str(output[f"output_{column}"].item()) for column in ("quantity", "unit", "at"))
            size = errors.number(peak, unit, "peak_output", f"{curve} {name}")
            yield f"peak of {curve} {name} {size}, {quantity.replace('_', ' ')}, {at}"


def notch_texts(result: SweepResult) -> dict[str, str]:
    """Largest value for each limit, and the ranges with a lowered level, by curve."""
    rows = {}
    for curve in result.curves.values():
        notching = curve.notching
        if notching is None:
            continue
        for limit in notching.limits:
            largest = f"{amount(limit.largest, limit.unit)} at {limit.frequency_hz:.4g} Hz"
            ratio = f"{percent(limit.share)} of {amount(limit.limit, limit.unit)}"
            rows[f"{curve.name} {limit.name}"] = f"at most {largest}, {ratio}"
        for number, part in enumerate(notching.ranges, 1):
            level, quantity = amount(part.level, notching.unit), notching.quantity
            if power_of(quantity) and curve.excitation_unit == "m/s^2":
                level += f" or {acceleration_amplitude(part.level, quantity, part.at_hz) / STANDARD_GRAVITY:.4g} g"
            lowest = f"{level} ({part.reduction_db:.1f} dB) at {part.at_hz:.4g} Hz"
            rows[f"{curve.name} range {number}"] = (
                f"{part.from_hz:.4g} to {part.to_hz:.4g} Hz by {part.limit}, lowest level {lowest}"
            )
    return rows
