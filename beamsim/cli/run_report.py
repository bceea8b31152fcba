"""What the table of ``beamsim run`` tells beyond the entries of the summary."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from beamsim.analyses.run.result import ALLOWED_CHANGE, RunResult
from beamsim.analyses.run.spectra import LOBE
from beamsim.cli.report import Views, in_units, together
from beamsim.cli.tables import counted, percent
from beamsim.plots.style import amount, is_known


def _method(result: RunResult, method: str) -> str:
    time = result.time
    first, last = time[0], time[-1]
    return f"{method}, {first:g} to {last:g} s, {time.size} samples"


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
    s = result.summary
    return {
        name: {
            **{key.partition("_")[0]: amount(s[key][name], s["output_unit"][name])
               for key in ("peak_output", "min_output", "max_output")},
            "of": output.quantity.replace("_", " "),
            "at": output.at,
        }
        for name, output in result.outputs.items()
    }  # fmt: skip


def _spectral_lines(result: RunResult, lines: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Strongest and chosen lines of the first probe that moves: order (or Hz) and level, in order of frequency.

    Orders are multiples of the excitation frequency, levels in dB of the largest value of the signal.
    """
    probes = (*(line["probe"] for line in lines), *(probe for probe, _ in result.spectra))
    first = next(iter(probes), "")
    moves = first and result.summary["max_displacement_m"][first] > result.summary["min_displacement_m"][first]
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
        yield f"{_order(line)} ({line['amplitude_db']:.0f} dB{doubt})"


def _order(line: Mapping[str, Any]) -> str:
    order = line["order"]
    if order is None or not math.isfinite(order) or line["kind"] == "chosen":
        return f"{line['frequency_hz']:.4g} Hz"
    return f"{order:.3f}" if line["kind"] == "other" else str(Fraction(order).limit_denominator(12))


def _random(result: RunResult, signals: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """By signal RMS with its interval, 3 sigma, peak, crest factor and kurtosis."""
    recorded = () if result.random is None else result.random.recorded
    told = {}
    for signal in recorded:
        of = signals[f"{signal.name} {signal.quantity}"]  # summaries of older files have fewer values
        values = {
            "rms": of["rms"], "rms_low": of.get("rms_low"), "rms_high": of.get("rms_high"),
            "3_sigma": 3.0 * signal.standard_deviation, "peak": max(abs(signal.highest), abs(signal.lowest)),
        }  # fmt: skip
        texts = in_units(values, dict.fromkeys(values, signal.unit))
        if is_known(values["rms_low"]):
            texts["rms"] += f" ({texts['rms_low']} to {texts['rms_high']}, 95 %)"
        others = {key: of[key] for key in ("crest_factor", "kurtosis")}
        told[f"{signal.name} {signal.quantity}".replace("_", " ")] = {
            k: texts[k] for k in ("rms", "3_sigma", "peak")
        } | others
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


def _solver(result: RunResult, time: float) -> str:
    s = result.summary
    bends = s.get("breakpoints_passed", 0)
    passed = f", {counted(bends, 'breakpoint')} of springs passed" if bends else ""
    return f"{counted(s['events'], 'event')}{passed}, processor time {amount(time, 's')}"


def _against(result: RunResult, compared: Mapping[str, Any]) -> list[dict[str, str]]:
    """Value and place, the run, the reference, the difference; then states, times and cost."""
    method = compared["method"]
    rows = [
        {
            "": f"{figure.replace('_', ' ')} {place}",
            "exact": _figure(figure, value["exact"], value["unit"]),
            method: _figure(figure, value["stepped"], value["unit"]),
            "difference": _change(value["exact"], value["stepped"]),
        }
        for figure, places in compared["figures"].items()
        for place, value in places.items()
    ]
    until = compared["agrees_until_s"]
    of = "" if until >= result.time[-1] else f" until {amount(until, 's')}, where the contact sequences diverge"
    rows.append({"": f"displacement{of}", "difference": percent(compared["largest_state_difference"])})
    if result.snubbers:
        rows.append({"": f"times of contacts{of}", "difference": amount(compared["largest_time_difference_s"], "s")})
    exact, stepped = compared["exact_processor_time_s"], compared["processor_time_s"]
    factor = f"{stepped / exact:.3g} times" if exact > 0 else ""
    rows.append({"": "processor time", "exact": amount(exact, "s"), method: amount(stepped, "s"), "difference": factor})
    evaluations = str(result.work.evaluations), str(compared["evaluations"])
    return [*rows, {"": "evaluations", "exact": evaluations[0], method: evaluations[1]}]


def _figure(figure: str, value: float, unit: str) -> str:
    if figure == "contacts":
        return str(round(value))
    return percent(value, 5) if figure == "time_in_contact" else amount(value, unit, 6)


def _change(exact: float, stepped: float) -> str:
    return percent((stepped - exact) / abs(exact)) if exact else amount(stepped - exact, "1")


VIEWS: Views = {
    "against": _against,
    "memory_bytes": _memory,
    "method": _method,
    "peak_force_n": together("peak_force_n"),
    "peak_displacement_m": together("peak_displacement_m", "min_displacement_m", "max_displacement_m"),
    "peak_acceleration_g": together("peak_acceleration_g"),
    "contact_share": together("contact_share", "contacts"),
    "peak_spring_force_n": together("peak_spring_force_n", "peak_stretch_m"),
    "peak_output": _outputs,
    "gap_m": together("gap_m", "static_force_n", "blocked_force_n", "stiffness_ratio"),
    "spectral_lines": _spectral_lines,
    "impacts": _impacts,
    "random": _random,
    "random_linear": _linear,
    "processor_time_s": _solver,
}
