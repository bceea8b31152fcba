"""Texts of the table of ``beamsim nnm``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.cli.report import SHARED, Row, Texts, counted, few, pair, percent
from beamsim.orbits.branch import special_name
from beamsim.plots.style import amount, scale_for

SMALL_SHARE = 0.5  # of the energy in the mode, below which the smallest is reported
SMALL_DRIFT = 1e-6  # drift over the periods of the spectrum that is not reported
POLE_MARGIN = 3.0  # a pole further away than this multiple of the largest small factor does not affect the orders

_PARAMETERS = {
    "stiffness_factor": ("stiffness factor", ""),
    "energy": ("energy", " J"),
    "frequency": ("frequency", " Hz"),
}


def _backbone(result: NormalModeResult, mode: int) -> str:
    s = result.summary
    quantity, _ = _PARAMETERS[result.parameter]
    return f"mode {mode}, {s['points']} points in {quantity}, {s['stable_points']} of them stable"


def _at(result: NormalModeResult, value: float, digits: int = 4) -> str:
    """A value of the parameter of the path."""
    if result.parameter == "energy":
        return amount(value, "J", digits)
    return f"{value:.{digits}g}{_PARAMETERS[result.parameter][1]}"


def _end(result: NormalModeResult, end: Mapping[str, Any]) -> str:
    at = f"stiffness factor {end['parameter']:.6g}: " if result.parameter == "stiffness_factor" else ""
    return f"{at}{end['frequency_hz']:.6g} Hz, {amount(end['energy_j'], 'J')}"


def _resonances(result: NormalModeResult, tongues: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    for t in tongues:
        yield "", f"{t['ratio']}:1 with mode {t['mode']} at {_at(result, t['parameter'])}, {t['points']} points"


def _jumps(result: NormalModeResult, jumps: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """Jumps by cause: a tongue of known ratio, or one that is too narrow or of too high order to be traced."""
    for ratio, mode in dict.fromkeys((j["ratio"], j["mode"]) for j in jumps):
        same_cause = [j for j in jumps if (j["ratio"], j["mode"]) == (ratio, mode)]
        spans = few(f"{_at(result, j['start'])} to {_at(result, j['end'])}" for j in same_cause)
        why = f"{ratio}:1 with mode {mode}" if ratio and mode else "of high order, not traced"
        yield "", f"{spans} ({why})"


def _special_points(result: NormalModeResult, points: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """Places by kind."""
    _, unit = _PARAMETERS[result.parameter]
    at = "" if unit else "stiffness factor "
    for kind in dict.fromkeys(point["kind"] for point in points):
        places = few(_at(result, point["parameter"], 6) for point in points if point["kind"] == kind)
        yield "", f"{special_name(kind)} at {at}{places}"


def _requested(_: NormalModeResult, points: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """Points at the energies and frequencies asked for."""
    for p in points:
        stable, energy = "stable" if p["stable"] else "unstable", amount(p["energy_j"], "J", 6)
        yield (
            "",
            f"{p['frequency_hz']:.8g} Hz, {energy} ({stable}, {percent(p['share'])} in the mode): branch "
            f"{p['branch']}, point {p['point']}",
        )


def _full_period(result: NormalModeResult, s: Mapping[str, Any]) -> Iterator[Row]:
    _, unit = _PARAMETERS[result.parameter]
    yield "", f"differs by {s['largest_difference']:.2g} from half-period shooting"
    if s["symmetry_breakings"]:
        at = "at " if unit else "at stiffness factor "
        yield "symmetry breakings", at + few(_at(result, b["parameter"], 6) for b in s["symmetry_breakings"])
    for k, branch in enumerate(s["never_at_rest"]):
        start, end = branch["start"], branch["end"]
        yield (
            "" if k else "non-brake orbits",
            f"started in mode {branch['mode']} (about {branch['ratio']}:1), {branch['points']} points, "
            f"{branch['stable_points']} stable, from {_at(result, start['parameter'], 6)} to "
            f"{_at(result, end['parameter'], 6)}; kinetic "
            f"energy at the slowest instant up to {percent(branch['largest_least_kinetic'])} of the energy",
        )
        yield "", branch["status"]


_FOLLOWED = {
    "same": "near the motion of the backbone",
    "other": "near another motion",
    "none": "near no periodic motion",
    "between": "where a tongue interrupts the backbone",
}


def _relaxed(result: NormalModeResult, s: Mapping[str, Any]) -> Iterator[Row]:
    end = s["end"]
    yield (
        "",
        f"{s['steps_reached']} of {s['steps']} steps to stiffness factor {end['parameter']:.6g}, functional up to "
        f"{s['largest_functional']:.2g} of twice the energy (tolerance {s['tolerance']:g})",
    )
    exact = f"{end['exact_frequency_hz']:.6g} Hz by shooting"
    if not math.isfinite(end["exact_frequency_hz"]):
        exact = "shooting finds no motion of this mode at this factor"
    yield "", f"{end['frequency_hz']:.6g} Hz, period {end['period_s']:.5g} s; {exact}"
    yield (
        "",
        f"differs by up to {percent(s['largest_frequency_difference'])} in frequency and "
        f"{percent(s['largest_shape_difference'])} in shape",
    )
    yield "", ", ".join(f"{counted(n, 'step')} {_FOLLOWED[k]}" for k, n in s["followed"].items())
    if s["silent_jumps"]:
        yield "", f"undetected jumps to another motion at {few(f'{f:.4g}' for f in s['silent_jumps'])}"
    yield (
        "cost",
        f"{s['passages']} motions, processor time {s['processor_time_s']:.3g} s; shooting, including tongues, "
        f"{s['shooting_passages']} motions, {s['shooting_processor_time_s']:.3g} s "
        f"(ratio {s['cost_ratio']:.2g})",
    )
    ended = None if result.relaxed is None else result.relaxed.outcome
    if ended is not None and not ended.complete and ended != result.outcome:
        yield "", ended.text


def _expansion(_: NormalModeResult, s: Mapping[str, Any]) -> Iterator[Row]:
    frequency, initial = s["observed_order_frequency"], s["observed_order_initial"]
    expected, uniform = s["expected_order_initial"], s["observed_order_uniform"]
    series = f"{s['linear_frequency_hz']:.6g} Hz {s['first_order_hz']:+.4g} e {s['second_order_hz']:+.4g} e² Hz"
    yield "", f"{series}, for factors e well below {s['factors_well_below']:.2g}"
    first, second = s["frequency_hz"][0]
    exact = s["exact_frequency_hz"][0]
    head = f"{first:.6g} Hz at first order, {second:.6g} Hz at second"
    if math.isfinite(exact):
        off = s["initial_difference"][0]
        head += f", exact {exact:.6g} Hz; initial vector off by {off[0]:.2g} and {off[1]:.2g}"
    else:
        head += "; no exact motion found near it"
    yield f"at e = {s['factor'][0]:.4g}", head
    yield "observed orders", f"frequency {pair(frequency)} (expected 2 and 3)"
    at = f" at these factors, {s['orders_from']:.2g} to {s['orders_to']:.2g}"
    yield (
        "",
        f"initial vector {pair(initial)} (expected {pair(expected)}{at})",
    )
    if s["asymptotic_well_below"] < POLE_MARGIN * s["orders_from"]:
        pole = s["nearest_pole"]
        yield (
            "",
            f"initial vector 2 and 3 for e well below {s['asymptotic_well_below']:.2g}: harmonic {pole['harmonic']} is "
            f"close to mode {pole['mode']}; with divisors at the frequency of the motion {pair(uniform)}",
        )


def _phase_resonance(result: NormalModeResult, summary: Mapping[str, Any]) -> Iterator[Row]:
    unit = summary["unit"]
    for k, s in enumerate(summary["levels"]):
        head = f"{_level(s['level'], unit)}: "
        predicted = f"predicted {s['predicted_frequency_hz']:.6g} Hz, {amount(s['predicted_amplitude_m'], 'm')}"
        if not s["found"]:
            yield "", f"{head}{predicted}; no exact motion found"
            continue
        kind = "stable" if s["stable"] else "unstable"
        yield (
            "",
            f"{head}{predicted}; found {s['frequency_hz']:.6g} Hz, {amount(s['amplitude_m'], 'm')} at "
            f"{summary['probe']} ({kind})",
        )
        if math.isfinite(s["level_for_amplitude"]):
            off = s["level_for_amplitude"] / s["level"] - 1.0
            yield (
                "",
                f"level predicted for the computed amplitude {_level(s['level_for_amplitude'], unit)} ({off:+.2%})",
            )
        yield "", f"peak of the response {amount(s['peak_amplitude_m'], 'm')} at {s['peak_frequency_hz']:.6g} Hz"
        curve = None if result.phase_resonance is None else result.phase_resonance.motions[k].curve
        if curve is not None and not curve.outcome.complete:
            yield "", f"response curve {curve.outcome.displayed(scale_for)}"
    for k, s in enumerate(summary["levels"]):
        if s["periods"]:
            yield (
                "" if k else "in time",
                f"{_level(s['level'], unit)}: distance from the mode {s['departure_first_period']:.2g} in the first "
                f"period, {s['departure_last_period']:.2g} in the last of {s['periods']}",
            )
        else:
            yield "" if k else "in time", f"{_level(s['level'], unit)}: contacts chatter; not integrated in time"


def _level(value: float, unit: str) -> str:
    """A level of acceleration in g, others in SI."""
    return amount(value, unit, 5) if unit == "m/s^2" else f"{value:.5g} {unit}"


def _spectrum(result: NormalModeResult, drift: float) -> str:
    if drift <= SMALL_DRIFT:
        return ""
    return (
        f"after {result.summary['motion_periods']} periods the state differs by {percent(drift)}: "
        "the motion is unstable, and the spectral lines are broadened"
    )


def _share(result: NormalModeResult, smallest: float) -> str:
    if smallest >= SMALL_SHARE:
        return ""
    point = int(np.argmin(result.backbone.share))
    _, unit = _PARAMETERS[result.parameter]
    at = f"{'' if unit else 'stiffness factor '}{_at(result, float(result.backbone.parameter[point]))}"
    return f"mode {result.mode} holds {percent(smallest)} of it at {at}, where it is smallest"


def _solver(result: NormalModeResult, time: float) -> str:
    over = "full-period" if "full_period" in result.summary else "half-period"
    return f"{over} shooting, processor time {amount(time, 's')}"


TEXTS: Texts = {
    **SHARED,
    "mode": _backbone,
    "start": _end,
    "end": _end,
    "internal_resonances": _resonances,
    "jumps": _jumps,
    "special_points": _special_points,
    "requested_points": _requested,
    "full_period": _full_period,
    "multiple_scales": _expansion,
    "thesis": _relaxed,
    "phase_resonance": _phase_resonance,
    "motion_drift": _spectrum,
    "largest_residual": lambda _, residual: f"{residual:.2g}",
    "smallest_share": _share,
    "processor_time_s": _solver,
}
