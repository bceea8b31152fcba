"""Responses that a design study keeps of each case: numbers by name of quantity, probe or snubber."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from beamsim.analyses.branch import largest_of_stable
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.sweep.result import SweepResult
from beamsim.analyses.values import BY_ENTRY, DISPLACEMENT, VALUES

MODES_KEPT = 6

Responses = dict[str, float | list[float]]

_OTHERS: dict[str, tuple[str, str, str, str]] = {
    "contact_share": ("snubbers", "contact_share", "1", "share of the time in contact"),
    "contacts": ("snubbers", "contacts", "1", "number of closings"),
    "static_force": ("snubbers", "static_force_n", "N", "contact force at static equilibrium"),
    "rms_absolute_acceleration": ("probes", "rms_absolute_acceleration", "m/s^2",
                                  "root mean square of the absolute acceleration"),
    "rms_displacement": ("probes", "rms_displacement", "m",
                         "root mean square of the displacement, relative to the base"),
    "rms_force": ("snubbers", "rms_force", "N", "root mean square of the contact force"),
    "bending_stress_position": ("bodies", "largest_bending_stress_position_m", "m",
                                "where the bending stress is largest"),
    "open_frequencies_hz": ("", "open_frequencies_hz", "Hz", "natural frequencies with every contact open"),
    "closed_frequencies_hz": ("", "closed_frequencies_hz", "Hz", "natural frequencies with every contact closed"),
    "energy_error": ("", "energy_error", "1", "energy balance error"),
}  # fmt: skip
"""Responses of a run that are not extremes of channels: section, entry of the summary, unit and meaning."""
OF_RUNS: dict[str, tuple[str, str, str, str]] = {
    value.name: (value.section, value.entry, value.unit, value.meaning) for value in VALUES
} | _OTHERS
QUANTITIES: dict[str, tuple[str, str]] = {name: (unit, meaning) for name, (_, _, unit, meaning) in OF_RUNS.items()} | {
    "bilinear_frequency_hz": ("Hz", "2 f F / (f + F) of the first open (f) and closed (F) frequency"),
    "resonance_frequency": ("Hz", "frequency of the largest response"),
}
"""Unit and long name of a response, by the last part of its name."""


def describe(name: str, output_units: Mapping[str, str]) -> tuple[str, str]:
    """Unit and long name of a response; ``output_units`` by name of the scenario's outputs."""
    place, _, quantity = name.rpartition("/")
    if quantity.endswith("_output"):
        return output_units.get(place.rpartition("/")[2], "1"), QUANTITIES[quantity][1]
    return QUANTITIES.get(quantity, ("1", quantity.replace("_", " ")))


BROADBAND = ("random", "sampled")  # excitations whose responses have a root mean square
MODEL_ENTRIES = ("static_force_n", "open_frequencies_hz", "closed_frequencies_hz")
"""Entries that responses are made of whatever is asked for; the model has them anyway."""


def run_responses(figures: Mapping[str, Any], asked: Collection[str] = ()) -> Responses:
    """Responses of a run, from entries of its summary; of those that are not there, none.

    ``asked`` are quantities or whole names of responses; all of them where it is empty.
    """
    values: Responses = {}
    for owner in ("probes", "snubbers", "springs", "friction", "outputs"):
        entries = {quantity: entry for quantity, (of, entry, _, _) in OF_RUNS.items() if of == owner}
        names = dict.fromkeys(name for entry in entries.values() for name in figures.get(entry, ()))
        for name in names:
            for quantity, entry in entries.items():
                if name in figures.get(entry, ()):
                    scale = BY_ENTRY[entry].scale if entry in BY_ENTRY else 1.0
                    values[f"{owner}/{name}/{quantity}"] = float(figures[entry][name]) * scale
    for quantity, (of, entry, _, _) in OF_RUNS.items():
        if of == "bodies" and entry in figures:
            values[quantity] = figures[entry]
    snubbers = bool(figures["static_force_n"])
    values |= frequency_responses(figures["open_frequencies_hz"], figures["closed_frequencies_hz"], snubbers)
    if "energy_error" in figures:
        values["energy_error"] = figures["energy_error"]
    return {name: value for name, value in values.items() if is_asked(name, asked)}


def entries_of(asked: Collection[str], excitation: str) -> tuple[str, ...]:
    """Entries of a run's summary that the responses asked for need, with a kind of excitation."""
    quantities = {name.rpartition("/")[2] for name in asked} or set(OF_RUNS)
    if excitation not in BROADBAND:
        quantities = {name for name in quantities if not name.startswith("rms_")}
    needed = [entry for quantity, (_, entry, _, _) in OF_RUNS.items() if quantity in quantities]
    return tuple(dict.fromkeys((*needed, *MODEL_ENTRIES)))


def entries_of_result(result: RunResult) -> dict[str, Any]:
    """The entries of a whole result, with the root mean squares of a random or sampled input."""
    entries = dict(result.summary)
    for signal in result.random.signals if result.random is not None else ():
        entries.setdefault(f"rms_{signal.quantity}", {})[signal.name] = signal.rms
    return entries


def is_asked(name: str, asked: Collection[str]) -> bool:
    """Whether a response is among those asked for, by its name or by its quantity."""
    return not asked or name in asked or name.rpartition("/")[2] in asked


def sweep_responses(result: SweepResult) -> Responses:
    """Responses of a sweep: for every curve (direction and level) the largest values and their frequencies."""
    values: Responses = {}
    for curve in result.curves.values():
        for name, envelope in curve.displacement.items():
            highest = int(np.argmax(envelope.peak))
            values[f"{curve.name}/probes/{name}/resonance_frequency"] = float(curve.frequency_hz[highest])
        for value, of in curve.peaks():
            for name, peaks in of.items():
                place = value.name if value.single else f"{value.section}/{name}/{value.name}"
                values[f"{curve.name}/{place}"] = float(peaks.max())
        for name, share in curve.contact_share.items():
            values[f"{curve.name}/snubbers/{name}/contact_share"] = float(curve.weights @ share)
        for name, count in curve.contacts.items():
            values[f"{curve.name}/snubbers/{name}/contacts"] = float(np.sum(count))
    modes = result.modes
    opened, closed = modes.open_frequencies_hz.tolist(), modes.closed_frequencies_hz.tolist()
    return values | frequency_responses(opened, closed, bool(result.scenario.all_snubbers))


def continuation_responses(result: ContinuationResult) -> Responses:
    """Responses of a continuation: for every level the largest values of the stable motions, ``stable_<index>/…``.

    Motions of all periods are included. If no motion is stable the value is nan.
    """
    values: Responses = {}
    for index, level in enumerate(dict.fromkeys(repr(b.level) for b in result.branches)):
        of_level = [b for b in result.branches if repr(b.level) == level]
        for value, name, largest, parameter in largest_of_stable(of_level):
            place = value.name if value.single else f"{value.section}/{name}/{value.name}"
            values[f"stable_{index}/{place}"] = largest
            if value.key == DISPLACEMENT and result.parameter == "frequency":
                values[f"stable_{index}/probes/{name}/resonance_frequency"] = parameter
    modes = result.modes
    return values | frequency_responses(
        modes.open_frequencies_hz.tolist(), modes.closed_frequencies_hz.tolist(), bool(result.scenario.all_snubbers)
    )


def frequency_responses(opened: list[float], closed: list[float], snubbers: bool) -> Responses:
    """The first natural frequencies, and the bilinear frequency of the first pair."""
    values: Responses = {"open_frequencies_hz": _first(opened)}
    if snubbers:
        values["closed_frequencies_hz"] = _first(closed)
        both = opened[0] + closed[0]
        values["bilinear_frequency_hz"] = 2.0 * opened[0] * closed[0] / both if both else math.nan
    return values


def _first(frequencies: list[float]) -> list[float]:
    kept = [float(f) for f in frequencies[:MODES_KEPT]]
    return kept + [math.nan] * (MODES_KEPT - len(kept))
