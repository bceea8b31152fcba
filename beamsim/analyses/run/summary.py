"""Summary of a run: values of its motion by probes, snubbers and springs, and values of the model."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.run.fatigue import has_value
from beamsim.analyses.run.histories import friction_summary
from beamsim.analyses.run.layouts import OF_SNUBBERS, RANDOM
from beamsim.analyses.run.linear_prediction import gapping_of_motion, gapping_of_random
from beamsim.analyses.run.motion import Evaluation, Needed, RunMotion
from beamsim.analyses.run.result import (
    ALLOWED_REMAINDER,
    MAIN_QUANTITY,
    STATISTICS,
    RunResult,
    highest_of_srs,
    misfit_of_matched,
    over_limit,
    srs_over_limit,
)
from beamsim.inputs.signal import common_record
from beamsim.labelled import Dataset
from beamsim.responses.gapping import gapping_of_sine, gapping_ratios, in_their_units
from beamsim.results.values import (
    ACCELERATION,
    ALWAYS,
    DISPLACEMENT,
    FORCE,
    NO_EXTREMES,
    OPENING,
    STRESS,
    Extreme,
    Extremes,
    by_hinge_key,
    by_magnitude,
    hinge_key,
    largest,
    largest_at,
    margins,
    parse_limit,
    place_of_stress,
    values_of,
)
from beamsim.scenario.excitation import RandomInput, Shock
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.system.equations import Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints, not_none

ROUND_OFF = 1e-12  # relative to the motion of the structure: a smaller motion of a probe counts as rest
PRECISION = 1e-15  # relative precision of a computed deflection


STATIC_ENTRIES = frozenset({
    "static_force_n", "static_moment_n_m", "gap_m", "gap_rad", "open_frequencies_hz", "closed_frequencies_hz",
})  # fmt: skip
"""Entries of the summary that depend only on the model."""


def values_of_motion(motion: RunMotion) -> dict[str, Any]:
    """Values of the motion of a run and of its model; see `values_of_part`."""
    system, events = motion.system, motion.events
    closings = np.bincount(events["snubber"].values[events["closing"].values], minlength=len(system.snubbers))
    return values_of_part(system, motion.extremes, motion.contact_share, closings, motion.extreme_states)


def values_of_part(
    system: StructuralSystem, extremes: Extremes, contact_share: Floats, closings: Ints, states: Floats
) -> dict[str, Any]:
    """Summary values of a part of a motion, with static equilibrium and natural frequencies.

    Parameters
    ----------
    system : system with the channels.
    extremes : extremes of the channels.
    contact_share : (m,) time share of each contact.
    closings : (m,) number of closings of each contact.
    states : (k, 2n or more) states among which the deflection is largest.

    Returns
    -------
    By entry, then by name of the probe, snubber or spring.
    """
    snubbers, coordinates = [s.name for s in system.snubbers], states[:, : system.dynamics.size]
    count = len(snubbers)
    sizes = (float(np.abs(coordinates @ body.deflection.T).max(initial=0.0)) for body in system.bodies)
    settled = _without_round_off(system, extremes, contact_share[:count], max(sizes, default=0.0))
    return {
        **values_of(system.channels, settled),
        "contact_share": dict(zip(snubbers, contact_share[:count].tolist(), strict=True)),
        "contacts": dict(zip(snubbers, closings[:count].tolist(), strict=True)),
        **by_hinge_key("static_force_n", system.snubbers, lambda s: s.preload),
        **by_hinge_key("gap_m", system.snubbers, lambda s: s.gap),
        "open_frequencies_hz": system.open_frequencies_hz.tolist(),
        "closed_frequencies_hz": system.closed_frequencies_hz.tolist(),
    }


def spectral_lines(spectra: Dataset) -> list[dict[str, Any]]:
    """Lines of all spectra, for the summary."""
    columns = ("order", "frequency_hz", "amplitude", "amplitude_db", "kind", "remainder", "error")
    return [of | dict(zip(columns, line, strict=True)) for of, line in _lines(spectra, columns)]


def unresolved_lines(spectra: Dataset) -> list[dict[str, Any]]:
    """Unsteady lines, for the summary."""
    columns, resolution_hz = ("frequency_hz", "remainder", "separating_duration_s"), spectra["resolution_hz"].item()
    return [
        of | {"frequency_hz": f, "remainder": left, "resolution_hz": resolution_hz, "separating_duration_s": duration_s}
        for of, (f, left, duration_s) in _lines(spectra, columns)
        if left > ALLOWED_REMAINDER
    ]


def _lines(spectra: Dataset, columns: Sequence[str]) -> Iterator[tuple[dict[str, Any], tuple[Any, ...]]]:
    """Columns of the lines of all spectra, with probe or output and quantity of each line."""
    labels = zip(spectra["name"].values.tolist(), spectra["quantity"].values.tolist(), strict=True)
    signals = [{"probe": name, "quantity": quantity} for name, quantity in labels]
    rows = zip(*(spectra[f"line_{name}"].values.tolist() for name in columns), strict=True)
    return zip((signals[k] for k in spectra["line_signal"].values.tolist()), rows, strict=True)


def input_summary(inputs: Dataset) -> dict[str, dict[str, Any]]:
    """Properties of records and random inputs, by path in the excitation."""
    keys = ("rms", "unit", "sample_rate_hz", "treatment")
    return {row["path"]: {key: row[key] for key in keys if row[key] != ""} for row in inputs.rows("number")}


def sensitivity_summary(sensitivities: Dataset) -> dict[str, dict[str, dict[str, float]]]:
    """Derivatives, tolerances, changes and validity, by value (named as in studies) and path of the number, in SI."""
    summary: dict[str, dict[str, dict[str, float]]] = {}
    names = (
        "derivative",
        "derivative_below",
        "derivative_above",
        "tolerance",
        "change",
        "change_below",
        "holds_within",
    )
    for row in sensitivities.rows("row"):
        summary.setdefault(row["response"], {})[row["path"]] = {name: row[name] for name in names}
    return summary


def impact_summary(statistics: Dataset) -> dict[str, dict[str, Any]]:
    """Statistics of impacts with their intervals, by snubber."""
    summary = {}
    for name in statistics.labels("snubber"):
        called = _entry_namer(statistics, name)
        of_snubber = statistics.sel(snubber=name)
        summary[name] = {called(entry): of_snubber[entry].item() for entry in OF_SNUBBERS}
    if "interval" in statistics:
        for name, rows in statistics.groups("interval_snubber").items():
            if of := rows.rows("interval"):
                called = _entry_namer(statistics, name)
                summary[name]["intervals"] = {called(row["value_name"]): [row["low"], row["high"]] for row in of}
    return summary


def _entry_namer(statistics: Dataset, snubber: str) -> Callable[[str], str]:
    """Function that converts entry names for a snubber: a stop of a hinge has moments."""
    return hinge_key if statistics["peak_force_n"].sel(snubber=snubber).unit == "N m" else str


def impact_total(statistics: Dataset) -> dict[str, float]:
    """Statistics of the impacts of all snubbers together."""
    total = {name: sum(statistics[name].values.tolist()) for name in ("number", "rate_hz", "energy_lost_j")}
    alike: dict[Callable[[str], str], list[Dataset]] = {}
    for name in statistics.labels("snubber"):
        alike.setdefault(_entry_namer(statistics, name), []).append(statistics.sel(snubber=name))
    for called, of_unit in alike.items():
        total[called("peak_force_n")] = max(of["peak_force_n"].item() for of in of_unit)
        total[called("impulse_n_s")] = sum(of["impulse_n_s"].item() for of in of_unit)
    return total


def random_summary(random: Dataset) -> dict[str, dict[str, Any]]:
    """Known values of each signal, by name and quantity, with the expected peak of a test."""
    keys = (*STATISTICS, "standard_deviation", "highest", "lowest", "rms_low", "rms_high", "degrees_of_freedom",
            "expected_peak", "expected_peak_low", "expected_peak_high", "expected_peak_unknown")  # fmt: skip
    return {
        row["signal"]: {
            key: row[key] for key in keys if key in row and (has_value(row[key]) or not RANDOM.variables[key].optional)
        }
        for row in random.rows("signal")
    }


def linear_summary(random: Dataset) -> dict[str, dict[str, float]]:
    """Standard deviations of the run and of the linear structures, by name and quantity, if known."""
    return {
        row["signal"]: {
            "standard_deviation": row["standard_deviation"], "open": row["linear_open"], "closed": row["linear_closed"]
        }
        for row in random.rows("signal")
        if has_value(row.get("linear_open")) and has_value(row.get("linear_closed"))
    }  # fmt: skip


def psd_over_limit(random: Dataset) -> dict[str, tuple[float, float]]:
    """Largest ratio of each density to its limit curve, and its frequency, Hz, by name."""
    if "limit" not in random:
        return {}
    spectra = zip(random["name"].values.tolist(), random["density"].values, random["limit"].values, strict=True)
    return over_limit(random["frequency_hz"].values, spectra)


def fatigue_summary(fatigue: Dataset) -> dict[str, dict[str, Any]]:
    """Known values of the damage, by body."""
    return {
        row["body"]: {name: value for name, value in row.items() if name != "body" and has_value(value)}
        for row in fatigue.rows("body")
    }


def summary_entries(result: RunResult, summary: Mapping[str, Any]) -> dict[str, Any]:
    """Summary entries that repeat parts of a result, and its margins; None for missing parts."""
    bodies = result.datasets.get("bodies")
    von_mises = None if bodies is None else bodies.get("peak_von_mises_stress")
    crushed: dict[str, dict[str, float]] = {"residual_crush_m": {}, "residual_crush_rad": {}}
    for name, left in result["histories"].by_label("snubber_residual_crush").items():
        if not np.isnan(left.item()):
            crushed[f"residual_crush_{left.unit}"][name] = left.item()
    names = ("random", "impact_statistics", "spectra")
    random, statistics, spectra = (result.datasets.get(name) for name in names)
    srs, matched = result.datasets.get("srs"), result.datasets.get("matched")
    return {
        **{entry: of or None for entry, of in crushed.items()},
        "largest_von_mises_stress_pa": None if von_mises is None else float(np.nanmax(von_mises)),
        "inputs": input_summary(result["inputs"]) if "inputs" in result.datasets else None,
        "samples": result["histories"]["time"].values.size,
        "friction": friction_summary(result.datasets) if result["histories"].labels("friction") else None,
        "rings": _ring_summary(result["rings"]) if "rings" in result.datasets else None,
        "impacts": None if statistics is None else impact_summary(statistics),
        "impacts_total": None if statistics is None else impact_total(statistics),
        "sensitivities": sensitivity_summary(result["sensitivities"]) if "sensitivities" in result.datasets else None,
        "fatigue": fatigue_summary(result["fatigue"]) if "fatigue" in result.datasets else None,
        "random": None if random is None else random_summary(random),
        "random_linear": None if random is None else linear_summary(random) or None,
        "srs": None if srs is None else highest_of_srs(srs),
        "matched": None if matched is None else misfit_of_matched(matched),
        "spectral_lines": [] if spectra is None else spectral_lines(spectra),
        "unresolved_lines": None if spectra is None else unresolved_lines(spectra) or None,
        **(_over_limits(result, summary) if result.scenario.limits else {}),
    }


def _ring_summary(rings: Dataset) -> dict[str, dict[str, Any]]:
    """Sides, errors and contact share of each ring."""
    units = {"sliding_distance": "_m", "work_rate": "_w", "worn_volume": "_m3", "friction_energy": "_j"}
    entries = ("contact_share", *units, "sides", "gap_error", "force_error", "direction_error_deg", "impulse_error")
    return {
        row["ring"]: {f"{name}{units.get(name, '')}": row[name] for name in entries if has_value(row[name])}
        for row in rings.rows("ring")
    }


def _over_limits(result: RunResult, summary: Mapping[str, Any]) -> dict[str, Any]:
    """Ratios of spectra to their limit curves, and the margins (with root mean squares)."""
    srs, random = (result.datasets.get(name) for name in ("srs", "random"))
    over = {
        "srs_over_limit": {} if srs is None else srs_over_limit(srs),
        "psd_over_limit": {} if random is None else psd_over_limit(random),
    }
    ratios = {entry: {name: ratio for name, (ratio, _) in of.items()} or None for entry, of in over.items()}
    rms = {
        "rms_displacement": summary["rms_displacement_m"],
        "rms_absolute_acceleration": {at: x * STANDARD_GRAVITY for at, x in summary["rms_acceleration_g"].items()},
    } | result.root_mean_squares
    known = {entry: of for entry, of in ratios.items() if of}
    compared = margins(result.scenario.limits, {**summary, **rms, **known})
    for name, item in compared.items():
        value, place = parse_limit(name)
        if place in over.get(value.entry, {}):
            item["frequency_hz"] = over[value.entry][place][1]
            item["at"] = f"{place}, {item['frequency_hz']:.4g} Hz"
    if result.scenario.excitation.stationary:
        from beamsim.analyses.run.random_response import margins_in_test

        compared = margins_in_test(result.scenario, compared, random)
    return {**ratios, "margins": compared or None}


def summary_of_run(
    motion: RunMotion, values: Mapping[str, Any], spectra: Dataset | None, needed: Needed, evaluation: Evaluation
) -> dict[str, Any]:
    """Summary entries that do not repeat a field of the result.

    Parameters
    ----------
    motion : motion of the run.
    values : values of the motion and of its model.
    spectra : None if skipped; root mean squares are then nan.
    needed : needed entries; the prediction of gapping is expensive.
    evaluation : evaluation of the motion.

    Returns
    -------
    By entry, as `RunResult` declares them.
    """
    system = motion.system
    probes = [p.name for p in system.probes]
    known = {} if spectra is None else dict(zip(spectra.labels("signal"), spectra["rms"].values.tolist(), strict=True))
    rms = defaultdict(lambda: math.nan, known)
    summary: dict[str, Any] = {
        "rms_displacement_m": {p: rms[f"{p} displacement"] for p in probes},
        "rms_acceleration_g": {p: rms[f"{p} {MAIN_QUANTITY}"] / STANDARD_GRAVITY for p in probes},
        **values,
        "events": motion.events["time"].values.size,
        "linear": motion.work.events == 0 and system.cubic is None,
        "energy_error": motion.energy_error,
        "method": motion.method,
        "solver_events": motion.work.events,
        "evaluations": motion.work.evaluations,
        "segments": motion.work.segments,
        "contact_states": motion.work.states,
        "processor_time_s": motion.work.processor_time_s,
        **motion.memory,
        **by_hinge_key("blocked_force_n", system.snubbers, lambda s: s.blocked_force),
        "stiffness_ratio": {s.name: s.stiffness_ratio for s in system.snubbers},
    }
    summary["peak_times_s"] = peak_times(system, motion.extremes, summary)
    if system.outputs:
        summary["rms_output"] = {o.name: rms[f"{o.name} {o.quantity}"] for o in system.outputs if not o.squared}
        summary["output_unit"] = {output.name: output.unit for output in system.outputs}
    if system.base_correction is not None:
        summary |= system.base_correction.summary()
    if any(spring.listed_as == "springs" for spring in system.springs):
        summary["breakpoints_passed"] = motion.breakpoints
    if system.stress is not None and STRESS in motion.extremes:
        summary |= place_of_stress(system.stress, motion.extremes, several=len(system.bodies) > 1)
    predicted = needed.has("gapping_ratio") and system.snubbers
    if predicted:
        nothing, what = dict[str, dict[str, Any]](), "the level that changes contact"
        of_snubbers = evaluation.compute(what, lambda: gapping_of_run(motion, summary), nothing, minor=True)
        if of_snubbers:
            summary["gapping"] = of_snubbers
        if system.sine is not None:
            summary["gapping_ratio"] = gapping_ratios(of_snubbers)
    return summary


def gapping_of_run(motion: RunMotion, summary: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Prediction of the first contact change from the linear motion, for the summary.

    Parameters
    ----------
    motion : motion of the run.
    summary : summary with the largest gaps.

    Returns
    -------
    By snubber. Empty without a linear motion for comparison: nonlinear springs, friction that sticks rigidly or is
    pressed by a snubber, a snubber law other than stiffness and dashpot, or a motion that does not start at
    equilibrium.
    """
    system, contacts = motion.system, motion.system.dynamics.contacts
    unknown = contacts.any_sticks_rigidly or contacts.pressed_contacts.size or system.static_equilibrium is None
    if not system.snubbers or unknown or system.cubic is not None or motion.outcome.interrupted:
        return {}
    of_snubber = gapping_of_sine(system) if system.sine is not None else _gapping_of_other(motion)
    names = [snubber.name for snubber in system.snubbers]
    for name, of in of_snubber.items():
        times = motion.events["time"].values[motion.events["snubber"].values == names.index(name)]
        of["first_change_s"] = float(times[0]) if times.size else None
        of["largest_gap_m"] = {**summary["largest_gap_m"], **summary.get("largest_gap_rad", {})}[name]
    units = {snubber.name: snubber.gap_unit for snubber in system.snubbers}
    return in_their_units(of_snubber, units) if "rad" in units.values() else of_snubber


def _gapping_of_other(motion: RunMotion) -> dict[str, dict[str, Any]]:
    """First contact change for an excitation that is not a sine; empty without a start at equilibrium."""
    scenario, excitation = motion.system.scenario, motion.system.scenario.excitation
    if excitation.items and all(isinstance(each, RandomInput) for _, each in excitation.items):
        return gapping_of_random(motion.system)
    settings = not_none(scenario.run)
    moved = settings.start != "static_equilibrium" or scenario.starts_unrelaxed
    if moved or excitation.kind == "none" or motion.trajectory is None:
        return {}
    level = float(excitation.level) if isinstance(excitation, Shock) else None
    return gapping_of_motion(settings, motion, level)


def _without_round_off(
    system: StructuralSystem, extremes: Extremes, contact_share: Floats, size: float
) -> dict[Key, Extreme]:
    """Extremes with round-off replaced by zero.

    A probe at a node of the motion moves by round-off: its displacement is set to 0, and its acceleration if it is not
    larger than such a displacement causes at the first natural frequency. The acceleration of a probe that stays in
    place under dead loads is set to 0 if it is not larger than the round-off of its deflection causes at the highest
    natural frequency, with the base at rest; so are output velocities and accelerations if no probe moves. A contact
    that never opens has no gap.
    """
    settled = dict(extremes)
    values = np.array([[True], [False], [True], [False]])  # times are kept
    if DISPLACEMENT in extremes:
        still = largest(extremes[DISPLACEMENT]) <= ROUND_OFF * size
        settled[DISPLACEMENT] = np.where(values & still, 0.0, extremes[DISPLACEMENT])
        if ACCELERATION in extremes:
            peak, (low, _, high, _) = largest(extremes[ACCELERATION]), extremes[DISPLACEMENT]
            first_hz = min((f for f in system.open_frequencies_hz if f > 0.0), default=0.0)
            rests = still & (peak <= ROUND_OFF * size * (2.0 * np.pi * first_hz) ** 2)
            base = [moved.acceleration for moved in system.base]
            records = [of for of in base if common_record((of,)) is not None]
            if not (records or [of for of in base if of.coefficient.any()]):
                unmoved, speed = high - low <= ROUND_OFF * size, PRECISION * size * system.dynamics.fastest
                rests |= unmoved & (peak <= speed * system.dynamics.fastest)
                if system.outputs and unmoved.all():
                    settled |= _outputs_at_rest(extremes, speed, speed * system.dynamics.fastest)
            settled[ACCELERATION] = np.where(values & rests, 0.0, extremes[ACCELERATION])
    if OPENING in extremes:
        settled[OPENING] = np.where(values & (contact_share >= 1.0 - ALWAYS), 0.0, extremes[OPENING])
    return settled


def _outputs_at_rest(extremes: Extremes, speed: float, acceleration: float) -> dict[Key, Extreme]:
    """Extremes of output velocities and accelerations, zero up to a given speed and acceleration, SI."""
    rest = {("outputs", "velocity"): speed, ("outputs", "acceleration"): acceleration}
    values = np.array([[True], [False], [True], [False]])  # times are kept
    return {
        key: np.where(values & (largest(extremes[key]) <= least), 0.0, extremes[key])
        for key, least in rest.items()
        if key in extremes
    }


def peak_times(system: StructuralSystem, extremes: Extremes, values: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Time of the peak, s, by entry and name; for equal peaks any of them."""
    probes, forces = [probe.name for probe in system.probes], system.channels.of_keys(FORCE).channels
    when = {
        entry: dict(zip(probes, largest_at(extremes.get(key, NO_EXTREMES)).tolist(), strict=True))
        for entry, key in (("peak_displacement_m", DISPLACEMENT), ("peak_acceleration_g", ACCELERATION))
    }
    of_contacts = by_magnitude(forces, extremes[FORCE])[3].tolist() if FORCE in extremes else []
    times = {channel.name: time for channel, time in zip(forces, of_contacts, strict=False)}
    when |= {entry: times for entry in ("peak_force_n", "peak_moment_n_m") if entry in values}
    return {entry: {name: of[name] for name, peak in values[entry].items() if peak > 0.0} for entry, of in when.items()}
