"""Responses of the cases of a study: the values that every analysis reports, by quantity and place."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.statics.result import StaticResult
from beamsim.analyses.sweep.result import SweepResult
from beamsim.results.values import BY_ENTRY, BY_NAME, DISPLACEMENT, Value, largest_in, parse_limit
from beamsim.scenario import Scenario

Responses = dict[str, float | list[float]]


def describe(name: str, output_units: Mapping[str, str]) -> tuple[str, str]:
    """Unit and long name of a response; ``output_units`` by name of the scenario's outputs."""
    place, _, quantity = name.rpartition("/")
    value = BY_NAME[quantity]
    return output_units.get(place.rpartition("/")[2], "1") if value.section == "outputs" else value.unit, value.meaning


SECTIONS = frozenset(value.section for value in BY_NAME.values() if value.section)
STRUCTURE_RESPONSES = frozenset(value.name for value in BY_NAME.values() if value.single or not value.section)


def begins_response(name: str) -> bool:
    """True if a name is, or begins, the name of a response or of one of its columns (a value for each mode).

    >>> begins_response("snubbers"), begins_response("up_0"), begins_response("open_frequencies_hz_2")
    (True, True, True)
    >>> begins_response("pad"), begins_response("peak_force")
    (False, False)
    """
    stem, _, number = name.rpartition("_")
    of_curve = stem in ("up", "down", "stable") and number.isdecimal()
    return of_curve or name in SECTIONS | STRUCTURE_RESPONSES or (stem in STRUCTURE_RESPONSES and number.isdecimal())


def entries_of(requested: Collection[str], scenario: Scenario) -> tuple[str, ...]:
    """Summary entries of a run that the requested responses need; by default all but the expensive ones."""
    limits = {} if scenario.limits is None else scenario.limits.values_by_name
    quantities = {name.rpartition("/")[2] for name in requested} or set(BY_NAME) - {"gapping"}
    quantities |= {parse_limit(name)[0].name for name in limits}
    if not scenario.excitation.stationary:  # no root mean squares without a stationary excitation
        quantities = {name for name in quantities if not name.startswith("rms_")}
    quantities |= {
        "static_force",
        "static_moment",
        "open_frequencies_hz",
        "closed_frequencies_hz",
    }  # known without further computation
    return tuple(entry for entry, value in BY_ENTRY.items() if value.name in quantities)


def matches_request(request: str, name: str) -> bool:
    """True if a request refers to a response: by its quantity, or by its name with or without its curve.

    >>> [matches_request(request, "snubbers/tip/peak_force") for request in ("peak_force", "tip/peak_force", "force")]
    [True, True, False]
    """
    parts = request.split("/")
    return name.split("/")[-len(parts) :] == parts


def limited_response(limit: str) -> str:
    """End of the response names that a limit is compared with.

    >>> limited_response("gap"), limited_response("outputs.clamp")
    ('largest_gap', 'outputs/clamp/peak_output')
    """
    value, place = parse_limit(limit)
    return f"{value.section}/{place}/{value.name}" if place else value.name


def quantity_of(name: str) -> str:
    """Quantity of a response name.

    >>> quantity_of("up_0/snubbers/tip/peak_force")
    'peak_force'
    """
    return name.rpartition("/")[2]


def place_of(name: str) -> str:
    """Probe or snubber of a response name, with its curve; empty for the structure as a whole.

    >>> place_of("snubbers/tip/peak_force"), place_of("up_0/snubbers/tip/peak_force"), place_of("bending_stress")
    ('tip', 'tip up_0', '')
    """
    *path, _ = name.split("/")  # [curve,] [probes or snubbers, name]
    *curve, _, place = path if len(path) > 1 else (*path, "", "")
    return " ".join([place, *curve]).strip()


def responses_of_result(result: RunResult | StaticResult | SweepResult | ContinuationResult) -> Responses:
    """All responses of a complete case."""
    if isinstance(result, StaticResult):
        about = {name: result.summary[name] for name in ("stuck_frequencies_hz", "sliding_frequencies_hz")}
        return run_responses(result.summary) | {name: _first_six(of) for name, of in about.items()}
    if isinstance(result, RunResult):
        return run_responses(result.summary | result.root_mean_squares)
    modes, snubbers = result["modes"], bool(result.scenario.all_snubbers)
    of_curves = _sweep_responses(result) if isinstance(result, SweepResult) else _continuation_responses(result)
    opened, closed = (modes[f"{state}_frequencies_hz"].values.tolist() for state in ("open", "closed"))
    return of_curves | _frequency_responses(opened, closed, snubbers)


def run_responses(summary: Mapping[str, Any]) -> Responses:
    """Responses of a run from its summary; missing entries are skipped."""
    values: Responses = {}
    for section in ("probes", "snubbers", "springs", "friction", "outputs", "supports"):
        found = [(v, summary[v.entry]) for v in BY_ENTRY.values() if v.section == section and v.entry in summary]
        for name in dict.fromkeys(name for _, of in found for name in of):
            values |= {f"{section}/{name}/{v.name}": float(of[name]) * v.scale for v, of in found if name in of}
    values |= {v.name: summary[v.entry] for v in BY_ENTRY.values() if v.single and v.entry in summary}
    snubbers = bool(summary["static_force_n"] or summary.get("static_moment_n_m"))
    values |= _frequency_responses(summary["open_frequencies_hz"], summary["closed_frequencies_hz"], snubbers)
    return values | ({"energy_error": summary["energy_error"]} if "energy_error" in summary else {})


def _sweep_responses(result: SweepResult) -> Responses:
    """Largest values and their frequencies for every curve (direction and level)."""
    values: Responses = {}
    for curve in result.curves.values():
        for value, name, largest, frequency in curve.largest():
            values |= _largest(curve.name, value, name, largest, frequency)
        for name, share in result.summary["contact_share"][curve.name].items():
            values[f"{curve.name}/snubbers/{name}/contact_share"] = share
        for name, count in curve.cycles.by_label("contacts").items():
            values[f"{curve.name}/snubbers/{name}/contacts"] = float(np.sum(count.values))
    ratios = result.summary.get("gapping_ratio", {})
    return values | {f"snubbers/{name}/gapping": ratio for name, ratio in ratios.items()}


def _continuation_responses(result: ContinuationResult) -> Responses:
    """Largest values of the stable motions of all periods at every level, ``stable_<index>/…``; nan without any."""
    values: Responses = {}
    for index, level in enumerate(dict.fromkeys(repr(b["level"].item()) for b in result.branches)):
        of_level = [b for b in result.branches if repr(b["level"].item()) == level]
        for value, name, largest, parameter in largest_in(of_level, "parameter", "stable"):
            frequency = parameter if result.parameter == "frequency" else None
            values |= _largest(f"stable_{index}", value, name, largest, frequency)
    return values


def _largest(curve: str, value: Value, name: str, largest: float, frequency: float | None) -> Responses:
    """Largest value along a curve; for displacements also its frequency."""
    place = value.name if value.single else f"{value.section}/{name}/{value.name}"
    values: Responses = {f"{curve}/{place}": largest}
    if value.key == DISPLACEMENT and frequency is not None:
        values[f"{curve}/probes/{name}/resonance_frequency"] = frequency
    return values


def _frequency_responses(opened: list[float], closed: list[float], snubbers: bool) -> Responses:
    """First six natural frequencies, and the bilinear frequency of the first pair."""
    first = {"open_frequencies_hz": opened} | ({"closed_frequencies_hz": closed} if snubbers else {})
    values: Responses = {name: _first_six(of) for name, of in first.items()}
    if snubbers:
        both = opened[0] + closed[0]
        values["bilinear_frequency_hz"] = 2.0 * opened[0] * closed[0] / both if both else math.nan
    return values


def _first_six(frequencies: list[float]) -> list[float]:
    return (frequencies[:6] + [math.nan] * 6)[:6]
