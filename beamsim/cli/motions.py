"""What is printed of runs and sweeps: the first screen, and what the table tells beyond the entries of the summary."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.run.close_lines import LOBE
from beamsim.analyses.run.result import ALLOWED_CHANGE, ALLOWED_REMAINDER, RunResult, SignalStatistics
from beamsim.cli.printing import percent
from beamsim.cli.screens import SHOWN, Numbers, Screen, contact_levels, limit_lines, limits_by_place, modes, sureness
from beamsim.cli.tables import Labelled, Views, in_units, output_text, stress_text, together
from beamsim.fields import words
from beamsim.outcomes import first_of
from beamsim.plots.run import damage_place
from beamsim.plots.style import amount, is_known, scale_for
from beamsim.scenario.quantities import acceleration_amplitude, power_of
from beamsim.scenario.scenario import profile_jumps
from beamsim.scenario.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from beamsim.analyses.sweep.result import SweepCurve, SweepResult


def run_screen(result: RunResult) -> Screen:
    """Forces, contact, displacements, accelerations and limits by place."""
    s, numbers = result.summary, Numbers(result.summary)
    limits = limits_by_place(result)
    rows = [_place(s, numbers, name, limits) for name in dict.fromkeys((*result.snubbers, *result.probes))]
    facts, stress = list(modes(result)), s.get("largest_bending_stress_pa")
    if stress is not None and is_known(stress):
        facts.insert(0, f"bending stress {stress_text(s, numbers.text(stress, 'Pa', 'largest_bending_stress_pa'))}")
    lines = [*(["; ".join(facts)] if facts else []), *contact_levels(result)]
    outputs = [
        f"{name} {numbers.text(peak, s['output_unit'][name], 'peak_output', name)}"
        for name, peak in s.get("peak_output", {}).items()
    ]
    if outputs:
        lines.append(f"peaks of outputs: {first_of(outputs, SHOWN)}")
    stated = {each.path for each in result.inputs if is_known(each.from_hz) or each.treatment}
    lines += [f"{path}: {text}" for path, text in input_texts(result).items() if path in stated]
    if "matched" in s:
        of = s["matched"]
        band = f"{of['from_hz']:g} to {of['to_hz']:g} Hz, Q = {of['quality']:g}"
        ends = f"{of['lowest_db']:+.1f} to {of['highest_db']:+.1f} dB"
        lines.append(f"base motion: spectrum {ends} from the curve, {band}")
    if random := result.random:
        signals = sorted(random.signals, key=lambda signal: signal.quantity != "force")
        largest = [f"{of.name} {words(of.quantity)} {text}" for of in signals if (text := _expected_peak(of))]
        if largest:
            lines.append(f"largest in {amount(random.test_duration_s, 's')} of test: {first_of(largest, SHOWN)}")
    changing = [(name, of) for name, of in sensitivity_texts(result).items() if name.startswith(("peak f", "peak d"))]
    lines += [f"{name}: {first_of(of, SHOWN)}" for name, of in changing[:SHOWN]]
    for name, body in result.fatigue.items():
        interval = "" if body.damage_low is None else f" ({body.damage_low:.2g} to {body.damage_high:.2g}, 95 %)"
        lines.append(f"damage of {name} {body.damage:.2g}{interval} at {damage_place(body)}")
    lines += limit_lines(result, [row[""] for row in rows])
    if compared := s.get("against"):
        apart, until = percent(compared["largest_state_difference"], 2), compared["agrees_until_s"]
        diverge = "" if until >= result.time[-1] else f" until {until:.4g} s, where the contact sequences diverge"
        lines.append(f"{compared['method']}: displacements differ by at most {apart}{diverge}")
    return Screen(sureness(result, numbers.largest_change), rows, [*lines, *numbers.legend()])


def input_texts(result: RunResult, _: object = None) -> dict[str, str]:
    """By path of the excitation the size of a random input or record, its sampling, and how it was made."""
    texts = {}
    for each in result.inputs:
        band = f", {each.from_hz:.4g} to {each.to_hz:.4g} Hz" if is_known(each.from_hz) else ""
        unit = "g" if each.unit == "m/s^2" else each.unit
        size = f"rms {each.rms / STANDARD_GRAVITY:.4g} g" if unit == "g" else f"rms {amount(each.rms, unit)}"
        rate = "" if band else f", {amount(each.sample_rate_hz, 'Hz')}"
        texts[each.path] = f"{size}{band}{rate}{f'; {each.treatment}' if each.treatment else ''}"
    return texts


def sensitivity_texts(result: RunResult) -> dict[str, list[str]]:
    """By value how it changes with the tolerance of each number, the largest change first."""
    texts: dict[str, list[str]] = {}
    for row in sorted(result.sensitivities, key=lambda row: -abs(row.change)):
        _, *place, quantity = ("", *row.response.split("/"))[-3:]
        change = f"{'-' if row.change < 0.0 else '+'}{amount(abs(row.change), row.value_unit, 3)}"
        of_value = texts.setdefault(" of ".join([words(quantity), *place]), [])
        of_value.append(f"{row.path} +{amount(row.tolerance, row.number_unit, 3)}: {change}")
    return texts


def _expected_peak(signal: SignalStatistics) -> str:
    """Largest value of a test with its interval; empty where there is none."""
    if not is_known(signal.expected_peak):
        return "not reliable" if signal.expected_peak_unknown else ""
    expected, low, high = (
        amount(value, signal.unit, 3)
        for value in (signal.expected_peak, signal.expected_peak_low, signal.expected_peak_high)
    )
    return f"{expected} ({low} to {high}, 95 %)"


def _place(s: Mapping[str, Any], numbers: Numbers, name: str, limits: Mapping[str, list[str]]) -> dict[str, str]:
    """The row of a probe, of a snubber, or of both."""
    headings = "", "peak force", "peak moment", "in contact, times", "displacement", "acceleration"
    row = dict.fromkeys(headings, "") | {"": name}
    for heading, entry, unit in (("peak force", "peak_force_n", "N"), ("peak moment", "peak_moment_n_m", "N m")):
        if name in s.get(entry, ()):
            row[heading] = numbers.text(s[entry][name], unit, entry, name)
    if name in s["contact_share"]:
        row["in contact, times"] = f"{percent(s['contact_share'][name])}, {s['contacts'][name]}"
    if name in s["max_displacement_m"]:
        low, high = (
            numbers.text(s[entry][name], "m", entry, name, s["peak_displacement_m"][name])
            for entry in ("min_displacement_m", "max_displacement_m")
        )
        first, _, unit = low.partition(" ")
        row["displacement"] = f"{first if high.partition(' ')[2].startswith(unit) else low} to {high}"
        row["acceleration"] = numbers.text(s["peak_acceleration_g"][name], "g", "peak_acceleration_g", name)
    return row | {"limit": "; ".join(limits.get(name, ()))}


def sweep_screen(result: SweepResult) -> Screen:
    """The largest values of each curve, with their frequency and place."""
    s, numbers = result.summary, Numbers(result.summary)
    of = (
        ("peak_force_n", "force", "N", "peak force"), ("peak_displacement_m", "displacement", "m", "displacement"),
        ("peak_acceleration_g", "acceleration", "g", "acceleration"),
    )  # fmt: skip
    rows = []
    for name, curve in result.curves.items():
        level = scale_for(curve.level_unit, curve.level)
        said = f"{curve.direction}, {curve.level * level.factor:.4g} {level.unit}".rstrip()
        row = {"": said if level.unit in ("", "g") else f"{said}{in_gravities(curve)}"}
        for entry, field, unit, heading in of:
            values = s.get(entry, {}).get(name, {})
            place = max(values, key=lambda at: values[at], default="")
            at = at_frequency(curve, field, place)
            where = f", {place}" if len(values) > 1 else ""
            row[heading] = f"{numbers.text(values[place], unit, entry, f'{name} {place}')}{at}{where}" if at else ""
        row["in contact"] = ", ".join(percent(share) for share in s.get("contact_share", {}).get(name, {}).values())
        rows.append(row)
    notches = [f"{name} {text}" for name, text in list(notch_texts(result).items())[:SHOWN]]
    outputs = [
        f"peak of {name} {', '.join(of.values())}"
        for name, of in _outputs_of_curves(result, s.get("peak_output", {})).items()
    ]
    lines = [
        *modes(result), *contact_levels(result), *outputs[:SHOWN], *profile_jumps(result.scenario), *notches,
        *limit_lines(result), *numbers.legend(),
    ]  # fmt: skip
    return Screen(sureness(result, numbers.largest_change), rows, lines)


def in_gravities(curve: SweepCurve) -> str:
    """The acceleration of the base along a curve, in g, for the text behind its level; empty of a force."""
    if curve.excitation_unit != "m/s^2":
        return ""
    sizes = np.abs(curve.excitation_amplitude) / STANDARD_GRAVITY
    low, high = float(sizes.min()), float(sizes.max())
    return f" ({high:.3g} g)" if high - low <= 1e-3 * high else f" ({low:.3g} to {high:.3g} g)"


def _memory(result: RunResult, memory: float) -> str:
    kept = result.summary.get("contact_states_kept")
    text = f"at most {amount(memory, 'B')} for the motion and its tables"
    if kept is None:
        return text
    states, settings = result.work.states, result.scenario.run
    if settings is not None and settings.most_contact_states is not None:
        all_of_them = f"run.most_contact_states: {states}"
    else:
        all_of_them = f"run.memory: {math.ceil(1.1 * memory * states / kept / 1e9):d} GB"
    return (
        f"{text}; {kept} of {states} contact states kept at once, the others built again whenever they are needed: "
        f"{all_of_them} keeps all"
    )


def _outputs(result: RunResult, peaks: Mapping[str, float]) -> dict[str, dict[str, str]]:
    """By output its peak and range, what it is and where."""
    ends = {end: result.summary[f"{end}_output"] for end in ("min", "max")}
    return {
        name: output_text(output, peaks[name], **{end: amount(of[name], output.unit) for end, of in ends.items()})
        for name, output in result.outputs.items()
    }


def _spectral_lines(result: RunResult, lines: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Strongest and chosen lines of the first probe that moves, else output: order (or Hz) and level, by frequency.

    Orders are multiples of the excitation frequency, levels in dB of the largest value of the signal.
    """
    names = (*(line["probe"] for line in lines), *(name for name, _ in result.spectra))
    first = next(iter(names), "")
    highest, lowest = (result.summary[f"{end}_displacement_m"] for end in ("max", "min"))
    moves = first not in highest or highest[first] > lowest[first]
    texts = {}
    for quantity in (quantity for probe, quantity in result.spectra if probe == first):
        name = f"{first} {quantity}"
        resolution = LOBE / result.spectra[first, quantity].duration_s
        without = f"no distinct line, at a resolution of {resolution:.3g} Hz" if moves else "no motion"
        text = ", ".join(_strongest(lines, first, quantity))
        if text and is_known(excitation := result.spectra[first, quantity].excitation_hz):
            text = f"multiples of {excitation:.4g} Hz: {text}"
        texts[name.replace("_", " ")] = text or without
    return texts


def _strongest(lines: Sequence[Mapping[str, Any]], probe: str, quantity: str) -> Iterator[str]:
    of_motion = (line for line in lines if line["kind"] not in ("mean", "residual"))
    matching = [line for line in of_motion if (line["probe"], line["quantity"]) == (probe, quantity)]
    ranked = sorted(matching, key=lambda line: -line["amplitude"])
    shown = [line for k, line in enumerate(ranked) if k < 6 or line["kind"] == "chosen"]
    for line in sorted(shown, key=lambda line: float(line["frequency_hz"])):
        change = line.get("relative_change") or 0.0
        doubt = f", change {percent(change, 2 if change < 0.995 else 3)}" if change > ALLOWED_CHANGE else ""
        remainder = line.get("remainder")  # which older files lack
        if remainder is not None and remainder > ALLOWED_REMAINDER:
            doubt += ", not resolved"
        yield f"{_order(line)} ({line['amplitude_db']:.0f} dB{doubt})"


def _order(line: Mapping[str, Any]) -> str:
    order = line["order"]
    if order is None or not math.isfinite(order) or line["kind"] == "chosen":
        return f"{line['frequency_hz']:.4g} Hz"
    return f"{order:.3f}" if line["kind"] == "other" else str(Fraction(order).limit_denominator(12))


def _unresolved(result: RunResult, lines: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """By spectrum the lines that are several lines or change, strongest first, and what would tell two lines apart."""
    texts: dict[str, str] = {}
    for (probe, quantity), spectrum in result.spectra.items():
        size = {line.frequency_hz: line.amplitude for line in spectrum.lines}
        own = [line for line in lines if (line["probe"], line["quantity"]) == (probe, quantity)]
        own.sort(key=lambda line: -size[line["frequency_hz"]])
        shown = []
        for line in own[:SHOWN]:
            needed = line["separating_duration_s"]
            two = f"; {amount(needed, 's')} would tell two lines apart" if is_known(needed) else ""
            shown.append(f"{line['frequency_hz']:.4g} Hz ({percent(line['remainder'])} is left{two})")
        if own:
            more = f", and {len(own) - SHOWN} more" if len(own) > SHOWN else ""
            resolution = amount(own[0]["resolution_hz"], "Hz")
            texts[f"{probe} {quantity}".replace("_", " ")] = (
                f"several lines closer than {resolution}, or one that changes: {', '.join(shown)}{more}"
            )
    return texts


def _random(result: RunResult, signals: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """By signal RMS with its interval, 3 sigma, peak, largest value of the test, crest factor and kurtosis."""
    recorded = () if result.random is None else result.random.recorded
    tested = None if result.random is None else result.random.test_duration_s
    told = {}
    for signal in recorded:
        of = signals[f"{signal.name} {signal.quantity}"]  # summaries of older files have fewer values
        values = {
            "rms": of["rms"], "rms_low": of.get("rms_low"), "rms_high": of.get("rms_high"),
            "3_sigma": 3.0 * signal.standard_deviation, "peak": max(abs(signal.highest), abs(signal.lowest)),
        }  # fmt: skip
        texts = in_units(values, dict.fromkeys(values, signal.unit))
        shown = {key: texts[key] for key in ("rms", "3_sigma", "peak")}
        if is_known(values["rms_low"]):
            shown["rms"] += f" ({texts['rms_low']} to {texts['rms_high']}, 95 %)"
        if largest := _expected_peak(signal):
            shown[f"largest in {amount(tested, 's')}"] = largest
        others = {key: of[key] for key in ("crest_factor", "kurtosis")}
        told[f"{signal.name} {signal.quantity}".replace("_", " ")] = shown | others
    return told


def _linear(result: RunResult, signals: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, Any]]:
    """By signal the standard deviation, and those of the linear structures with contacts always open or closed."""
    recorded = () if result.random is None else result.random.recorded
    units = {f"{s.name} {s.quantity}": s.unit for s in recorded}
    return {name.replace("_", " "): in_units(of, dict.fromkeys(of, units[name])) for name, of in signals.items()}


def _impacts(_: RunResult, snubbers: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Statistics by snubber; above 1 the structure drives the parting, and a ratio of speeds is no restitution."""
    named = {}
    for name, of in snubbers.items():
        driven = is_known(of["restitution"]) and of["restitution"] > 1.0
        called = {"restitution": "separation / approach speed"} if driven else {}
        named[name] = {called.get(key, key): value for key, value in of.items()}
    return named


def _against(result: RunResult, compared: Mapping[str, Any]) -> list[dict[str, str]]:
    """Value and place, the run, the reference, the difference; then states, times and cost."""
    method = compared["method"]
    rows = []
    for figure, places in compared["figures"].items():
        for place, value in places.items():
            exact, stepped, unit = value["exact"], value["stepped"], value["unit"]
            apart = percent((stepped - exact) / abs(exact)) if exact else amount(stepped - exact, "1")
            shown = {"exact": amount(exact, unit, 6), method: amount(stepped, unit, 6), "difference": apart}
            rows.append({"": f"{figure.replace('_', ' ')} {place}".rstrip()} | shown)
    until = compared["agrees_until_s"]
    of = "" if until >= result.time[-1] else f" until {amount(until, 's')}, where the contact sequences diverge"
    rows.append({"": f"displacement{of}", "difference": percent(compared["largest_state_difference"])})
    if result.snubbers:
        rows.append({"": f"times of contacts{of}", "difference": amount(compared["largest_time_difference_s"], "s")})
    cost = {"exact": compared["exact_processor_time_s"], method: compared["processor_time_s"]}
    rows.append({"": "processor time"} | {name: amount(time, "s") for name, time in cost.items()})
    return [*rows, {"": "evaluations", "exact": str(result.work.evaluations), method: str(compared["evaluations"])}]


RUN_VIEWS: Views = {
    "against": _against,
    "memory_bytes": _memory,
    "method": lambda result, method: (
        f"{method}, {result.time[0]:g} to {result.time[-1]:g} s, {result.time.size} samples"
    ),
    "peak_force_n": together("peak_force_n"),
    "peak_displacement_m": together("peak_displacement_m", "min_displacement_m", "max_displacement_m"),
    "peak_acceleration_g": together("peak_acceleration_g"),
    "contact_share": together("contact_share", "contacts"),
    "peak_spring_force_n": together("peak_spring_force_n", "peak_stretch_m"),
    "peak_output": _outputs,
    "gap_m": together("gap_m", "static_force_n", "blocked_force_n", "stiffness_ratio"),
    "peak_moment_n_m": together("peak_moment_n_m"),
    "gap_rad": together("gap_rad", "static_moment_n_m", "blocked_moment_n_m"),
    "sensitivities": lambda result, _: {name: ", ".join(of) for name, of in sensitivity_texts(result).items()},
    "inputs": input_texts,
    "spectral_lines": _spectral_lines,
    "unresolved_lines": _unresolved,
    "impacts": _impacts,
    "random": _random,
    "random_linear": _linear,
}


def _curves(result: SweepResult, peaks: Sequence[Mapping[str, Any]]) -> Labelled:
    """Every curve, and the peaks of its first probe."""
    curves, shown = [], []
    for curve in result.curves.values():
        first = next(iter(curve.displacement), "")
        kinds = () if curve.steady is None else curve.steady.kind
        steady = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        level = scale_for(result.scenario.level_unit, curve.level)
        of = f"{curve.level * level.factor:.4g} {level.unit}".rstrip()
        about = {"direction": curve.direction, "level": of, "points": curve.frequency_hz.size, "steady": steady}
        curves.append({"": curve.name, **about})
        own = [p for p in peaks if p["curve"] == curve.name and p["probe"] == first]
        shown += [{"": curve.name, **_peak(peak)} for peak in own[:6]]
    offset = next((curve.displacement[first].offset for curve in result.curves.values() if first), 0.0)
    of = f"{first} from equilibrium at {amount(offset, 'm')}" if offset else first
    of_first = {f"peaks of {of}": shown or "none within the range"} if of else {}
    return Labelled({"": curves, **of_first})


def _peak(peak: Mapping[str, Any]) -> dict[str, Any]:
    plain = peak["order"] == 1.0 or peak["kind"] in ("beat", "level step")
    order = "" if plain else str(Fraction(peak["order"]).limit_denominator(12))
    return {key: peak[key] for key in ("probe", "frequency_hz", "value_m", "kind")} | {"order": order}


def _largest(quantity: str, unit: str) -> Callable[[SweepResult, Mapping[str, Mapping[str, float]]], dict[str, str]]:
    """By curve and place the largest value and the frequency of the cycle that has it."""

    def texts(result: SweepResult, curves: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
        return {
            f"{curve} {name}": f"{amount(value, unit)}{at_frequency(result.curves[curve], quantity, name)}"
            for curve, values in curves.items()
            for name, value in values.items()
        }

    return texts


def at_frequency(curve: SweepCurve, quantity: str, name: str) -> str:
    """Where a curve has its largest value, for the text behind it.

    Parameters
    ----------
    curve : of the sweep.
    quantity : displacement, acceleration or force.
    name : of the probe or snubber.

    Returns
    -------
    Text; empty where nothing moves, or nothing is known of the place.
    """
    envelope = getattr(curve, quantity).get(name)
    if envelope is None or not np.any(np.isfinite(envelope.peak)) or not np.nanmax(envelope.peak) > 0.0:
        return ""
    where = f" at {curve.frequency_hz[np.nanargmax(envelope.peak)]:.4g} Hz"
    if quantity != "displacement" or not envelope.offset:
        return where
    k = int(np.nanargmax(envelope.response))
    response = f"{amount(float(envelope.response[k]), 'm')} at {curve.frequency_hz[k]:.4g} Hz"
    return f"{where} ({response} from equilibrium at {amount(envelope.offset, 'm')})"


def _outputs_of_curves(result: SweepResult, curves: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, str]]:
    """By curve and output its peak, what it is and where."""
    return {
        f"{curve} {name}": output_text(result.curves[curve].outputs[name], peak)
        for curve, peaks in curves.items()
        for name, peak in peaks.items()
    }


def notch_texts(result: SweepResult, _: object = None) -> dict[str, str]:
    """By curve and limit the largest value, then the ranges in which the level is lowered."""
    rows = {}
    for curve in result.curves.values():
        if curve.notching is None:
            continue
        for limit in curve.notching.limits:
            largest = f"{amount(limit.largest, limit.unit)} at {limit.frequency_hz:.4g} Hz"
            ratio = f"{percent(limit.share)} of {amount(limit.limit, limit.unit)}"
            rows[f"{curve.name} {limit.name}"] = f"at most {largest}, {ratio}"
        for number, part in enumerate(curve.notching.ranges, 1):
            level, quantity = amount(part.level, curve.notching.unit), curve.notching.quantity
            if power_of(quantity) and curve.excitation_unit == "m/s^2":
                level += f" or {acceleration_amplitude(part.level, quantity, part.at_hz) / STANDARD_GRAVITY:.4g} g"
            lowest = f"{level} ({part.reduction_db:.1f} dB) at {part.at_hz:.4g} Hz"
            rows[f"{curve.name} range {number}"] = (
                f"{part.from_hz:.4g} to {part.to_hz:.4g} Hz by {part.limit}, lowest level {lowest}"
            )
    return rows


SWEEP_VIEWS: Views = {
    "notches": notch_texts,
    "peak_output": _outputs_of_curves,
    "peak_displacement_m": _largest("displacement", "m"),
    "peak_acceleration_g": _largest("acceleration", "g"),
    "peak_force_n": _largest("force", "N"),
    "peaks": _curves,
}
