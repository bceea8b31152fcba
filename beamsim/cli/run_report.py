"""Texts of the table of ``beamsim run``."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from beamsim.analyses.run.result import ALLOWED_CHANGE, RunResult
from beamsim.analyses.run.spectrum import LOBE
from beamsim.cli.report import (
    SHARED,
    Row,
    Texts,
    base_correction,
    change_of,
    change_text,
    counted,
    gapping,
    percent,
)
from beamsim.plots.style import amount, is_known

LINES_SHOWN = 6

NEGLIGIBLE = 1e-12  # of the largest displacement: round-off


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


def _at(result: RunResult, entry: str, name: str) -> str:
    """When a peak is reached; empty in files that do not know."""
    time = result.summary.get("peak_times_s", {}).get(entry, {}).get(name)
    return "" if time is None else f" at {amount(time, 's')}"


def _peaks(entry: str, unit: str) -> Callable[[RunResult, Mapping[str, float]], dict[str, str]]:
    return lambda result, peaks: {
        name: f"{amount(peak, unit)}{_at(result, entry, name)}" for name, peak in peaks.items()
    }


def _displacement(result: RunResult, peaks: Mapping[str, float]) -> dict[str, str]:
    low, high = result.summary["min_displacement_m"], result.summary["max_displacement_m"]

    def end(value: float, peak: float) -> str:
        return amount(0.0 if abs(value) < NEGLIGIBLE * peak else value, "m")

    return {
        name: f"{amount(peak, 'm')}{_at(result, 'peak_displacement_m', name)} "
        f"(from {end(low[name], peak)} to {end(high[name], peak)})"
        for name, peak in peaks.items()
    }


def _contact(result: RunResult, shares: Mapping[str, float]) -> dict[str, str]:
    contacts = result.summary["contacts"]
    return {name: f"{percent(share)}, {counted(contacts[name], 'contact')}" for name, share in shares.items()}


def _spring_force(result: RunResult, forces: Mapping[str, float]) -> dict[str, str]:
    stretch = result.summary["peak_stretch_m"]
    return {
        name: f"{amount(force, 'N')} at an elongation of {amount(stretch[name], 'm')}" for name, force in forces.items()
    }


def _friction(_: RunResult, contacts: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    """Two rows for each friction contact: how it slides, and what that loses."""
    width = max(len(name) for name in contacts)
    for name, s in contacts.items():
        start = f"starts with {amount(s['start_force_n'], 'N')}" if s["start_force_n"] else "starts unstressed"
        share = f"slides {percent(s['sliding_share'])} of the time"
        if not is_known(s["slides"]):
            yield "", f"{name:<{width}}  {share}; {start}"
            continue
        distance = f"{amount(s['sliding_distance_m'], 'm')} in {counted(s['slides'], 'slide')}"
        yield "", f"{name:<{width}}  {share}, {distance}; {start}"
        worn = f", worn volume {s['worn_volume_m3'] * 1e9:.4g} mm^3" if is_known(s["worn_volume_m3"]) else ""
        lost = f"loses {amount(s['dissipated_energy_j'], 'J')}, {amount(s['dissipated_power_w'], 'W')}"
        yield "", f"{'':<{width}}  {lost}, wear power {amount(s['wear_power_w'], 'W')}{worn}"
        if "intervals" in s:
            low, high = s["intervals"]["wear_power_w"]
            speed = " to ".join(amount(v, "m/s") for v in s["intervals"]["mean_sliding_speed_m_s"])
            wear = f"wear power {amount(low, 'W')} to {amount(high, 'W')}"
            yield "", f"{'':<{width}}  95 %: {wear}, mean sliding speed {speed}"


def _outputs(result: RunResult, peaks: Mapping[str, float]) -> dict[str, str]:
    """By output its peak and range, what it is and where."""
    low, high, units = (result.summary[name] for name in ("min_output", "max_output", "output_unit"))
    texts = {}
    for name, output in result.outputs.items():
        unit = units[name]
        ends = f"{amount(low[name], unit)} to {amount(high[name], unit)}"
        texts[name] = f"{amount(peaks[name], unit)} (from {ends}), {output.quantity.replace('_', ' ')}, {output.at}"
    return texts


def _preload(result: RunResult, gaps: Mapping[str, float]) -> dict[str, str]:
    s = result.summary
    texts = {}
    for name, gap in gaps.items():
        static = s["static_force_n"][name]
        at_equilibrium = f"{amount(static, 'N')} at equilibrium, " if is_known(static) else ""
        texts[name] = (
            f"gap {amount(gap, 'm')}, {at_equilibrium}{amount(s['blocked_force_n'][name], 'N')} with the "
            f"structure held, stiffness ratio {s['stiffness_ratio'][name]:.4g}"
        )
    return texts


def _stress(result: RunResult, stress: float) -> str:
    s = result.summary
    body = f"{s['largest_bending_stress_body']}, " if "largest_bending_stress_body" in s else ""
    y = s.get("largest_bending_stress_across_m", math.nan)
    across = "" if math.isnan(y) else f", y = {amount(y, 'm')}"
    return f"{amount(stress, 'Pa')} at {body}x = {amount(s['largest_bending_stress_position_m'], 'm')}{across}"


def _spectral_lines(result: RunResult, lines: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Strongest and chosen lines of the first probe that moves: order (or Hz) and level, in order of frequency.

    Orders are multiples of the excitation frequency, levels in dB of the largest value of the signal.
    """
    s = result.summary
    probes = (*(line["probe"] for line in lines), *(probe for probe, _ in result.spectra))
    first = next(iter(probes), "")
    changes = s.get("convergence", {}).get("spectral_lines", {})
    moves = first and result.summary["max_displacement_m"][first] > result.summary["min_displacement_m"][first]
    texts = {}
    for quantity in (quantity for probe, quantity in result.spectra if probe == first):
        name = f"{first} {quantity}"
        resolution = LOBE / result.spectra[first, quantity].duration_s
        without = f"no distinct line, at a resolution of {resolution:.3g} Hz" if moves else "no motion"
        text = ", ".join(_strongest(lines, first, quantity))
        if text and is_known(excitation := result.spectra[first, quantity].excitation_hz):
            text = f"multiples of {excitation:.4g} Hz: {text}"
        if text and name in changes:
            text += f"; {change_of(s, 'spectral_lines', name)}"
        texts[name.replace("_", " ")] = text or without
    return texts


def _strongest(lines: Sequence[Mapping[str, Any]], probe: str, quantity: str) -> Iterator[str]:
    of_motion = (line for line in lines if line["kind"] not in ("mean", "residual"))
    matching = [line for line in of_motion if (line["probe"], line["quantity"]) == (probe, quantity)]
    ranked = sorted(matching, key=lambda line: -line["amplitude"])
    shown = [line for k, line in enumerate(ranked) if k < LINES_SHOWN or line["kind"] == "chosen"]
    for line in sorted(shown, key=lambda line: float(line["frequency_hz"])):
        change = line.get("relative_change") or 0.0
        doubt = f", change {percent(change, 2 if change < 0.995 else 3)}" if change > ALLOWED_CHANGE else ""
        yield f"{_order(line)} ({line['amplitude_db']:.0f} dB{doubt})"


def _order(line: Mapping[str, Any]) -> str:
    order = line["order"]
    if order is None or not math.isfinite(order) or line["kind"] == "chosen":
        return f"{line['frequency_hz']:.4g} Hz"
    return f"{order:.3f}" if line["kind"] == "other" else str(Fraction(order).limit_denominator(12))


def _random(result: RunResult, signals: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """By signal RMS with its interval, 3 sigma, peak, crest factor and kurtosis, with their change if doubtful."""
    s = result.summary
    changes = s.get("convergence", {}).get("random", {})
    recorded = () if result.random is None else result.random.recorded
    statistics = {f"{each.name} {each.quantity}": each for each in recorded}
    texts = {}
    for name, figures in signals.items():
        signal = statistics[name]  # summaries of older files have fewer figures
        unit = signal.unit
        low, high = figures.get("rms_low"), figures.get("rms_high")
        interval = f" ({amount(low, unit)} to {amount(high, unit)}, 95 %)" if is_known(low) and is_known(high) else ""
        parts = {
            "rms": f"rms {amount(figures['rms'], unit)}{interval}",
            "3_sigma": f"3 sigma {amount(3.0 * signal.standard_deviation, unit)}",
            "peak": f"peak {amount(max(abs(signal.highest), abs(signal.lowest)), unit)}",
            "crest_factor": f"crest factor {figures['crest_factor']:.3g}",
            "kurtosis": f"kurtosis {figures['kurtosis']:.3g}",
        }
        parts = {
            key: part for key, part in parts.items() if is_known(figures.get(key, 0.0))
        }  # of no force there is none
        doubtful = [key for key in parts if f"random.{name} {key}" in s.get("doubtful", ())]
        marked = [f"{part} ({change_text(changes[f'{name} {key}'], True)})" if key in doubtful else part
                  for key, part in parts.items()]  # fmt: skip
        known = [changes[f"{name} {key}"] for key in parts if f"{name} {key}" in changes and key not in doubtful]
        after = f"random.{name} rms" in s.get("after_parting", ())
        rest = f"; {change_text(max(known), False, after)}" if known else ""
        texts[name.replace("_", " ")] = f"{', '.join(marked)}{rest}"
    return texts


def _linear(result: RunResult, signals: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """By signal the standard deviation, those of the linear structures, and how far the run is from them."""
    assert result.random is not None
    units = {f"{s.name} {s.quantity}": s.unit for s in result.random.recorded}
    texts = {}
    for name, of in signals.items():
        ours = of["standard_deviation"]

        def against(state: str, ours: float = ours, of: Mapping[str, float] = of, unit: str = units[name]) -> str:
            times = f" (the run is {ours / of[state]:.3g} times that)" if of[state] > 0 else ""
            return f"always {state} {amount(of[state], unit)}{times}"

        texts[name.replace("_", " ")] = f"sigma {amount(ours, units[name])}, {against('open')}, {against('closed')}"
    return texts


def _impacts(result: RunResult, snubbers: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    """Two rows for each snubber: the impacts, and what one of them is on average."""
    width = max(len(name) for name in snubbers)
    for name, s in snubbers.items():
        below = f", {s['below_threshold']} more below the threshold" if s["below_threshold"] else ""
        interval = s.get("intervals", {}).get("rate_hz")
        between = f" ({interval[0]:.4g} to {interval[1]:.4g} Hz)" if is_known(interval) else ""
        pressed = result.summary["contacts"][name] == 0 and result.summary["contact_share"][name] > 0.0
        which = " (pressed from the beginning)" if pressed else ""
        yield "", f"{name:<{width}}  {counted(s['number'], 'impact')}{which}, {s['rate_hz']:.4g} Hz{between}{below}"
        if s["number"]:
            units = (
                ("peak", "mean_peak_force_n", "N"),
                ("impulse", "mean_impulse_n_s", "N s"),
                ("time", "mean_contact_time_s", "s"),
                ("approach", "mean_approach_speed_m_s", "m/s"),
                ("loss", "mean_energy_lost_j", "J"),
                (_speed_ratio(s["restitution"]), "restitution", "1"),
            )
            means = ", ".join(f"{label} {amount(s[key], unit)}" for label, key, unit in units if is_known(s[key]))
            yield "", f"{'':<{width}}  mean {means}"


def _speed_ratio(value: Any) -> str:
    """What separation over approach speed is called: above 1 the structure drives the parting, no restitution does."""
    return "separation / approach speed" if is_known(value) and value > 1.0 else "restitution"


def _fatigue(_: RunResult, bodies: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    return {
        name: f"{body['cycles']:g} cycles at x = {amount(body['position'], 'm')}, ranges up to "
        f"{amount(body['largest_range_pa'], 'Pa')}, damage {body['damage']:.3g}, life {amount(body['life_s'], 's')}"
        for name, body in bodies.items()
    }


def _shock(result: RunResult, signals: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """By signal the highest point of its shock response spectrum, with its change."""
    s = result.summary
    changes = s.get("convergence", {}).get("srs", {})
    texts = {}
    for name, point in signals.items():
        text = f"{amount(point['maximax_g'], 'g')} at {point['frequency_hz']:.4g} Hz"
        if name in changes:
            text += f"; {change_of(s, 'srs', name)}"
        texts[name.replace("_", " ")] = text
    return texts


def _solver(result: RunResult, time: float) -> str:
    s = result.summary
    bends = s.get("breakpoints_passed", 0)
    passed = f", {counted(bends, 'breakpoint')} of springs passed" if bends else ""
    return f"{counted(s['events'], 'event')}{passed}, processor time {amount(time, 's')}"


def _against(result: RunResult, compared: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Columns: value and place, the run, the reference, the difference; then states, times and cost."""
    rows: list[tuple[str, ...]] = [("", "exact", compared["method"], "difference")]
    for figure, places in compared["figures"].items():
        for place, value in places.items():
            exact, stepped, unit = value["exact"], value["stepped"], value["unit"]
            name = f"{figure.replace('_', ' ')} {place}"
            rows.append(
                (name, *(_figure(figure, number, unit) for number in (exact, stepped)), _change(exact, stepped))
            )
    until = compared["agrees_until_s"]
    whole = until >= result.time[-1]
    part = "" if whole else f" until {amount(until, 's')}, where the contact sequences diverge"
    state, late = compared["largest_state_difference"], compared["largest_time_difference_s"]
    rows.append((f"displacement{part}", "", "", percent(state)))
    if result.snubbers:
        rows.append((f"times of contacts{part}", "", "", amount(late, "s")))
    costs = compared["exact_processor_time_s"], compared["processor_time_s"]
    factor = f"{costs[1] / costs[0]:.3g} times" if costs[0] > 0 else ""
    rows.append(("processor time", *(amount(cost, "s") for cost in costs), factor))
    rows.append(("evaluations", str(result.work.evaluations), str(compared["evaluations"]), ""))
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    for row in rows:
        yield "", "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()


def _figure(figure: str, value: float, unit: str) -> str:
    if figure == "contacts":
        return str(round(value))
    return percent(value, 5) if figure == "time_in_contact" else amount(value, unit, 6)


def _change(exact: float, stepped: float) -> str:
    return percent((stepped - exact) / abs(exact)) if exact else amount(stepped - exact, "1")


TEXTS: Texts = {
    "against": _against,
    **SHARED,
    "base_correction_share": base_correction,
    "memory_bytes": _memory,
    "method": _method,
    "gapping": gapping,
    "peak_force_n": _peaks("peak_force_n", "N"),
    "peak_displacement_m": _displacement,
    "peak_acceleration_g": _peaks("peak_acceleration_g", "g"),
    "contact_share": _contact,
    "peak_spring_force_n": _spring_force,
    "friction": _friction,
    "peak_output": _outputs,
    "gap_m": _preload,
    "largest_bending_stress_pa": _stress,
    "largest_von_mises_stress_pa": lambda _, stress: f"{amount(stress, 'Pa')} at the surface of a plate",
    "spectral_lines": _spectral_lines,
    "random": _random,
    "random_linear": _linear,
    "impacts": _impacts,
    "fatigue": _fatigue,
    "srs": _shock,
    "energy_error": lambda _, error: f"{error:.2g}",
    "processor_time_s": _solver,
}
