"""Responses that a design study keeps of each case: numbers by name of quantity, probe or snubber."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.limits import STANDARD_GRAVITY

if TYPE_CHECKING:
    from beamsim.analyses.response.result import FrequencyResponse
    from beamsim.analyses.run.result import RunResult
    from beamsim.analyses.sweep.result import SweepResult

MODES_KEPT = 6

Responses = dict[str, float | list[float]]

QUANTITIES: dict[str, tuple[str, str]] = {
    "peak_displacement": ("m", "largest displacement, relative to the base"),
    "min_displacement": ("m", "lowest displacement, relative to the base"),
    "max_displacement": ("m", "highest displacement, relative to the base"),
    "peak_acceleration": ("m/s^2", "largest absolute acceleration"),
    "peak_force": ("N", "largest contact force"),
    "rms_displacement": ("m", "root mean square of the displacement, relative to the base"),
    "rms_absolute_acceleration": ("m/s^2", "root mean square of the absolute acceleration"),
    "rms_force": ("N", "root mean square of the contact force"),
    "contact_share": ("1", "share of the time in contact"),
    "contacts": ("1", "number of closings"),
    "largest_gap": ("m", "largest opening between structure and snubber"),
    "peak_output": ("", "largest magnitude of the output"),
    "min_output": ("", "smallest value of the output"),
    "max_output": ("", "largest value of the output"),
    "static_force": ("N", "contact force at static equilibrium"),
    "bending_stress": ("Pa", "largest bending stress"),
    "bending_stress_position": ("m", "where the bending stress is largest"),
    "open_frequencies_hz": ("Hz", "natural frequencies with every contact open"),
    "closed_frequencies_hz": ("Hz", "natural frequencies with every contact closed"),
    "bilinear_frequency_hz": ("Hz", "2 f F / (f + F) of the first open (f) and closed (F) frequency"),
    "energy_error": ("1", "energy balance error"),
    "resonance_frequency": ("Hz", "frequency of the largest response"),
}
"""Unit and long name of a response, by the last part of its name."""


def describe(name: str, output_units: Mapping[str, str]) -> tuple[str, str]:
    """Unit and long name of a response; ``output_units`` by name of the scenario's outputs."""
    place, _, quantity = name.rpartition("/")
    if quantity.endswith("_output"):
        return output_units.get(place.rpartition("/")[2], "1"), QUANTITIES[quantity][1]
    return QUANTITIES.get(quantity, ("1", quantity.replace("_", " ")))


RUN_ENTRIES: dict[str, tuple[str, str]] = {
    "peak_displacement": ("probes", "peak_displacement_m"),
    "min_displacement": ("probes", "min_displacement_m"),
    "max_displacement": ("probes", "max_displacement_m"),
    "peak_acceleration": ("probes", "peak_acceleration_g"),
    "peak_force": ("snubbers", "peak_force_n"),
    "contact_share": ("snubbers", "contact_share"),
    "contacts": ("snubbers", "contacts"),
    "largest_gap": ("snubbers", "largest_gap_m"),
    "peak_output": ("outputs", "peak_output"),
    "min_output": ("outputs", "min_output"),
    "max_output": ("outputs", "max_output"),
    "static_force": ("snubbers", "static_force_n"),
    "rms_absolute_acceleration": ("probes", "rms_absolute_acceleration"),
    "rms_displacement": ("probes", "rms_displacement"),
    "rms_force": ("snubbers", "rms_force"),
    "bending_stress": ("", "largest_bending_stress_pa"),
    "bending_stress_position": ("", "largest_bending_stress_position_m"),
    "open_frequencies_hz": ("", "open_frequencies_hz"),
    "closed_frequencies_hz": ("", "closed_frequencies_hz"),
    "energy_error": ("", "energy_error"),
}
"""By quantity of a run's responses: to what it belongs, and the entry of the summary that it is."""
BROADBAND = ("random", "sampled")  # excitations whose responses have a root mean square
MODEL_ENTRIES = ("static_force_n", "open_frequencies_hz", "closed_frequencies_hz")
"""Entries that responses are made of whatever is asked for; the model has them anyway."""


def run_responses(figures: Mapping[str, Any], asked: Collection[str] = ()) -> Responses:
    """Responses of a run, from entries of its summary; of those that are not there, none.

    ``asked`` are quantities or whole names of responses; all of them where it is empty.
    """
    values: Responses = {}
    for owner in ("probes", "snubbers", "outputs"):
        entries = {quantity: entry for quantity, (of, entry) in RUN_ENTRIES.items() if of == owner}
        names = dict.fromkeys(name for entry in entries.values() for name in figures.get(entry, ()))
        for name in names:
            for quantity, entry in entries.items():
                if name in figures.get(entry, ()):
                    factor = STANDARD_GRAVITY if entry.endswith("_g") else 1.0
                    values[f"{owner}/{name}/{quantity}"] = float(figures[entry][name]) * factor
    for quantity in ("bending_stress", "bending_stress_position"):
        if RUN_ENTRIES[quantity][1] in figures:
            values[quantity] = figures[RUN_ENTRIES[quantity][1]]
    snubbers = bool(figures["static_force_n"])
    values |= frequency_responses(figures["open_frequencies_hz"], figures["closed_frequencies_hz"], snubbers)
    if "energy_error" in figures:
        values["energy_error"] = figures["energy_error"]
    return {name: value for name, value in values.items() if is_asked(name, asked)}


def entries_of(asked: Collection[str], excitation: str) -> tuple[str, ...]:
    """Entries of a run's summary that the responses asked for need, with a kind of excitation."""
    quantities = {name.rpartition("/")[2] for name in asked} or set(RUN_ENTRIES)
    if excitation not in BROADBAND:
        quantities = {name for name in quantities if not name.startswith("rms_")}
    needed = [entry for quantity, (_, entry) in RUN_ENTRIES.items() if quantity in quantities]
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
            values[f"{curve.name}/probes/{name}/peak_displacement"] = float(envelope.peak[highest])
            values[f"{curve.name}/probes/{name}/resonance_frequency"] = float(curve.frequency_hz[highest])
        for name, envelope in curve.acceleration.items():
            values[f"{curve.name}/probes/{name}/peak_acceleration"] = float(envelope.peak.max())
        for name, envelope in curve.force.items():
            values[f"{curve.name}/snubbers/{name}/peak_force"] = float(envelope.peak.max())
        for name, output in curve.outputs.items():
            values[f"{curve.name}/outputs/{name}/peak_output"] = float(output.peak.max())
        for name, share in curve.contact_share.items():
            values[f"{curve.name}/snubbers/{name}/contact_share"] = float(curve.weights @ share)
        for name, reached in curve.limited.items():
            quantity, _, snubber = name.partition(" ")
            place = f"snubbers/{snubber}/largest_gap" if quantity == "gap" else quantity
            values[f"{curve.name}/{place}"] = float(reached.max())
        for name, count in curve.contacts.items():
            values[f"{curve.name}/snubbers/{name}/contacts"] = float(np.sum(count))
    modes = result.modes
    opened, closed = modes.open_frequencies_hz.tolist(), modes.closed_frequencies_hz.tolist()
    return values | frequency_responses(opened, closed, bool(result.scenario.all_snubbers))


def response_responses(result: FrequencyResponse) -> Responses:
    """Responses of a continuation: for every level the largest values of the stable motions, ``stable_<index>/…``.

    Motions of all periods are included. If no motion is stable the value is nan.
    """
    values: Responses = {}
    for index, level in enumerate(dict.fromkeys(repr(b.level) for b in result.branches)):
        branches = [b for b in result.branches if repr(b.level) == level]
        stable = np.concatenate([b.stable for b in branches])
        parameter = np.concatenate([b.parameter for b in branches])
        sources: list[tuple[str, dict[str, Any]]] = [
            (f"probes/{name}/{quantity}", {"of": quantity, "name": name})
            for quantity in ("peak_displacement", "peak_acceleration")
            for name in branches[0].peak_displacement
        ]
        sources += [
            (f"outputs/{name}/peak_output", {"of": "peak_output", "name": name}) for name in branches[0].outputs
        ]
        sources += [
            (f"snubbers/{name}/peak_force", {"of": "peak_force", "name": name}) for name in branches[0].peak_force
        ]
        sources += [
            (f"snubbers/{name.partition(' ')[2]}/largest_gap" if " " in name else name, {"of": "limited", "name": name})
            for name in branches[0].limited
        ]
        for place, source in sources:
            values_along = np.concatenate([getattr(b, source["of"])[source["name"]] for b in branches])
            best = int(np.argmax(np.where(stable, values_along, -np.inf)))
            known = bool(stable.any())
            values[f"stable_{index}/{place}"] = float(values_along[best]) if known else float("nan")
            if source["of"] == "peak_displacement" and result.parameter == "frequency":
                at = f"stable_{index}/probes/{source['name']}/resonance_frequency"
                values[at] = float(parameter[best]) if known else float("nan")
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
