"""The table of ``beamsim nnm``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from beamsim.analyses.nnm.result import NormalModeResult

Row = tuple[str, str]

SHOWN = 6  # items in one row
_PARAMETERS = {
    "stiffness_factor": ("stiffness factor", ""),
    "energy": ("energy", " J"),
    "frequency": ("frequency", " Hz"),
}
SMALL_DRIFT = 1e-6  # drift over the periods of the spectrum that is not reported


def nnm_rows(result: NormalModeResult) -> Iterator[Row]:
    """Label and text of every row of the table of a nonlinear mode, taken from the summary alone."""
    s = result.summary
    quantity, unit = _PARAMETERS[result.parameter]
    yield "backbone", f"mode {s['mode']}, {s['points']} points in {quantity}, {s['stable_points']} of them stable"
    for name in ("start", "end"):
        yield name, _end(result.parameter, s[name])
    yield "linear frequency", f"{s['linear_frequency_hz']:.6g} Hz"
    for k, tongue in enumerate(s["internal_resonances"]):
        yield (
            "" if k else "internal resonances",
            f"{tongue['ratio']}:1 with mode {tongue['mode']} at {tongue['parameter']:.4g}{unit}, "
            f"{tongue['points']} points",
        )
    yield from _jumps(s["jumps"], unit)
    yield "grazings", str(s["grazings"])
    if "full_period" in s:
        yield from _full_period(s["full_period"], unit)
    if "multiple_scales" in s:
        from beamsim.cli.multiple_scales import expansion_rows

        yield from expansion_rows(s["multiple_scales"])
    if "thesis" in s:
        yield from _relaxed(s["thesis"])
        ended = None if result.relaxed is None else result.relaxed.outcome
        if ended is not None and not ended.complete and ended != result.outcome:
            yield "", ended.text
    if "phase_resonance" in s:
        from beamsim.cli.phase_resonance import phase_resonance_rows

        assert result.phase_resonance is not None
        yield from phase_resonance_rows(s["phase_resonance"], result.phase_resonance)
    if s["motion_drift"] > SMALL_DRIFT:
        yield (
            "spectrum",
            f"after {s['motion_periods']} periods the state differs by {_percent(s['motion_drift'])}: "
            "the motion is unstable, and the spectral lines are broadened",
        )
    yield "largest residual", f"{s['largest_residual']:.2g}"
    over = "full-period" if "full_period" in s else "half-period"
    yield "solver", f"{over} shooting, processor time {s['processor_time_s']:.3g} s"


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def _end(parameter: str, end: Mapping[str, Any]) -> str:
    at = f"stiffness factor {end['parameter']:.6g}: " if parameter == "stiffness_factor" else ""
    return f"{at}{end['frequency_hz']:.6g} Hz, {end['energy_j']:.4g} J"


def _few(texts: Iterable[str]) -> str:
    known = list(texts)
    more = f" and {len(known) - SHOWN} more" if len(known) > SHOWN else ""
    return ", ".join(known[:SHOWN]) + more


def _jumps(jumps: list[dict[str, Any]], unit: str) -> Iterator[Row]:
    """Jumps by cause: a tongue of known ratio, or one that is too narrow or of too high order to be traced."""
    causes = dict.fromkeys((j["ratio"], j["mode"]) for j in jumps)
    for k, (ratio, mode) in enumerate(causes):
        same_cause = [j for j in jumps if (j["ratio"], j["mode"]) == (ratio, mode)]
        spans = _few(f"{j['start']:.4g} to {j['end']:.4g}{unit}" for j in same_cause)
        why = f"{ratio}:1 with mode {mode}" if ratio and mode else "of high order, not traced"
        yield "" if k else "jumps over tongues", f"{spans} ({why})"


def _full_period(s: Mapping[str, Any], unit: str) -> Iterator[Row]:
    yield "full period", f"differs by {s['largest_difference']:.2g} from half-period shooting"
    if s["symmetry_breakings"]:
        at = "at " if unit else "at stiffness factor "
        yield "symmetry breakings", at + _few(f"{b['parameter']:.6g}{unit}" for b in s["symmetry_breakings"])
    for k, branch in enumerate(s["never_at_rest"]):
        start, end = branch["start"], branch["end"]
        yield (
            "" if k else "non-brake orbits",
            f"started in mode {branch['mode']} (about {branch['ratio']}:1), {branch['points']} points, "
            f"{branch['stable_points']} stable, from {start['parameter']:.6g} to {end['parameter']:.6g}{unit}; kinetic "
            f"energy at the slowest instant up to {_percent(branch['largest_least_kinetic'])} of the energy",
        )
        yield "", branch["status"]


_FOLLOWED = {
    "same": "near the motion of the backbone",
    "other": "near another motion",
    "none": "near no periodic motion",
    "between": "where a tongue interrupts the backbone",
}


def _relaxed(s: Mapping[str, Any]) -> Iterator[Row]:
    end = s["end"]
    yield (
        "relaxed minimisation",
        f"{s['steps_reached']} of {s['steps']} steps to stiffness factor {end['parameter']:.6g}, functional up to "
        f"{s['largest_functional']:.2g} (tolerance {s['tolerance']:g})",
    )
    exact = f"{end['exact_frequency_hz']:.6g} Hz by shooting"
    if not math.isfinite(end["exact_frequency_hz"]):
        exact = "shooting finds no motion of this mode at this factor"
    yield "", f"{end['frequency_hz']:.6g} Hz, period {end['period_s']:.5g} s; {exact}"
    yield (
        "",
        f"differs by up to {_percent(s['largest_frequency_difference'])} in frequency and "
        f"{_percent(s['largest_shape_difference'])} in shape",
    )
    yield "", ", ".join(f"{n} {'step' if n == 1 else 'steps'} {_FOLLOWED[k]}" for k, n in s["followed"].items())
    if s["silent_jumps"]:
        yield "", f"undetected jumps to another motion at {_few(f'{f:.4g}' for f in s['silent_jumps'])}"
    yield (
        "cost",
        f"{s['passages']} motions, processor time {s['processor_time_s']:.3g} s; shooting, including tongues, "
        f"{s['shooting_passages']} motions, {s['shooting_processor_time_s']:.3g} s "
        f"(ratio {s['cost_ratio']:.2g})",
    )
