"""Responses that a design study keeps of each case: the values that every analysis reports, by quantity and place."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from beamsim.analyses.branch import largest_of_stable
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.sweep.result import SweepResult
from beamsim.analyses.values import BY_ENTRY, DISPLACEMENT, VALUES, Value

Responses = dict[str, float | list[float]]

OF_RUNS: dict[str, tuple[str, str, str, str]] = {
    value.name: (value.section, value.entry, value.unit, value.meaning) for value in VALUES
} | {
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
"""Responses of a run, extremes of channels first: section, entry of the summary, unit and meaning."""
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


def entries_of(asked: Collection[str], excitation: str) -> tuple[str, ...]:
    """Entries of a run's summary that the responses asked for need, with a kind of excitation."""
    quantities = {name.rpartition("/")[2] for name in asked} or set(OF_RUNS)
    if excitation not in ("random", "sampled"):  # whose responses have a root mean square
        quantities = {name for name in quantities if not name.startswith("rms_")}
    quantities |= {"static_force", "open_frequencies_hz", "closed_frequencies_hz"}  # which the model has anyway
    return tuple(dict.fromkeys(entry for name, (_, entry, _, _) in OF_RUNS.items() if name in quantities))


def is_asked(name: str, asked: Collection[str]) -> bool:
    """Whether a response is among those asked for, by its name or by its quantity."""
    return not asked or name in asked or name.rpartition("/")[2] in asked


def responses_of_result(result: RunResult | SweepResult | ContinuationResult) -> Responses:
    """All responses of a case that was computed as a whole."""
    if isinstance(result, RunResult):
        entries = dict(result.summary)
        for signal in result.random.signals if result.random is not None else ():
            entries.setdefault(f"rms_{signal.quantity}", {})[signal.name] = signal.rms
        return run_responses(entries)
    modes, snubbers = result.modes, bool(result.scenario.all_snubbers)
    of_curves = _of_sweep(result) if isinstance(result, SweepResult) else _of_continuation(result)
    return of_curves | _of_frequencies(
        modes.open_frequencies_hz.tolist(), modes.closed_frequencies_hz.tolist(), snubbers
    )


def run_responses(figures: Mapping[str, Any]) -> Responses:
    """Responses of a run, from entries of its summary; of those that are not there, none."""
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
    values |= _of_frequencies(figures["open_frequencies_hz"], figures["closed_frequencies_hz"], snubbers)
    return values | ({"energy_error": figures["energy_error"]} if "energy_error" in figures else {})


def _of_sweep(result: SweepResult) -> Responses:
    """For every curve (direction and level) the largest values and their frequencies."""
    values: Responses = {}
    for curve in result.curves.values():
        for value, of in curve.peaks():
            for name, peaks in of.items():
                best = int(np.argmax(peaks))
                values |= _largest(curve.name, value, name, float(peaks[best]), float(curve.frequency_hz[best]))
        for name, share in curve.contact_share.items():
            values[f"{curve.name}/snubbers/{name}/contact_share"] = float(curve.weights @ share)
        for name, count in curve.contacts.items():
            values[f"{curve.name}/snubbers/{name}/contacts"] = float(np.sum(count))
    return values


def _of_continuation(result: ContinuationResult) -> Responses:
    """For every level the largest values of the stable motions of all periods, ``stable_<index>/…``; nan of none."""
    values: Responses = {}
    for index, level in enumerate(dict.fromkeys(repr(b.level) for b in result.branches)):
        of_level = [b for b in result.branches if repr(b.level) == level]
        for value, name, largest, parameter in largest_of_stable(of_level):
            frequency = parameter if result.parameter == "frequency" else None
            values |= _largest(f"stable_{index}", value, name, largest, frequency)
    return values


def _largest(curve: str, value: Value, name: str, largest: float, frequency: float | None) -> Responses:
    """The largest value along a curve, and of displacements where it is."""
    place = value.name if value.single else f"{value.section}/{name}/{value.name}"
    values: Responses = {f"{curve}/{place}": largest}
    if value.key == DISPLACEMENT and frequency is not None:
        values[f"{curve}/probes/{name}/resonance_frequency"] = frequency
    return values


def _of_frequencies(opened: list[float], closed: list[float], snubbers: bool) -> Responses:
    """The first six natural frequencies, and the bilinear frequency of the first pair."""
    first = {"open_frequencies_hz": opened} | ({"closed_frequencies_hz": closed} if snubbers else {})
    values: Responses = {name: (of[:6] + [math.nan] * 6)[:6] for name, of in first.items()}
    if snubbers:
        both = opened[0] + closed[0]
        values["bilinear_frequency_hz"] = 2.0 * opened[0] * closed[0] / both if both else math.nan
    return values
