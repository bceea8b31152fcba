"""``beamsim sweep``: response of a structure to a swept or stepped sine."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.analyses.sweep.layouts import LINEAR, PEAKS
from beamsim.analyses.sweep.outputs import LevelRun, SweepLevel
from beamsim.analyses.sweep.peaks import find_peaks
from beamsim.analyses.sweep.result import (
    PEAK_COLUMNS,
    ResponsePeak,
    SweepCurve,
    SweepResult,
    contact_levels_of,
    tables_of,
)
from beamsim.analyses.sweep.stepped import step_level
from beamsim.analyses.sweep.swept_sine import (
    combine_level_outcomes,
    sweep_level,
    with_limited_outputs,
    with_notched_tolerance,
)
from beamsim.errors import ScenarioError
from beamsim.inputs.drift import CorrectionSize
from beamsim.inputs.measured import read_profile
from beamsim.labelled import Dataset, join_tables
from beamsim.outcomes import Outcome, Progress, Where, interruption, part_of, stop_requested
from beamsim.responses.gapping import (
    accelerations_by_base,
    contact_levels,
    first_changes,
    gapping,
    gapping_ratios,
    in_their_units,
    pressed_phases,
    static_penetration,
    transfer,
)
from beamsim.responses.jumps import NOTED
from beamsim.results.result import check_reduction, dashpots_of, warnings_along
from beamsim.results.values import (
    ALWAYS,
    BY_ENTRY,
    OUTPUT,
    RESPONSE,
    ROTATIONAL,
    VALUES,
    Margins,
    hinge_key,
    margins_along,
)
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import has_level_steps
from beamsim.scenario.quantities import acceleration_amplitude, amplitude_unit
from beamsim.scenario.sweep import SteppedSine, SweptSine
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

LINEAR_POINTS = 2000  # of the curve without snubbers


def sweep(
    scenario: Scenario,
    progress: Progress = None,
    *,
    save: Callable[[SweepResult], object] | None = None,
    resume: SweepResult | None = None,
) -> SweepResult:
    """Compute the sweeps of a scenario at all its levels.

    Parameters
    ----------
    scenario : scenario with a ``sweep`` section of kind swept_sine or stepped and a harmonic excitation.
    progress : called with the completed fraction.
    save : called with the partial result after the first level and repeatedly later.
    resume : partial result of an interrupted sweep of the same scenario; its levels are not computed again.

    Returns
    -------
    SweepResult
        Curves of all completed levels, with their peaks; after an interruption (between cycles, frequencies or levels),
        as far as they were computed.

    Raises
    ------
    ScenarioError
        If the scenario cannot be swept.
    """
    settings = sweep_settings(scenario)
    begin = clock.perf_counter()
    system = sweep_system(scenario)
    levels = _levels(scenario, settings)
    limited = () if scenario.limits is None else tuple(scenario.limits.model_fields_set)
    if np.any(static_penetration(system) > 0):
        limited = tuple(dict.fromkeys((*limited, "gap")))
    runs: dict[int, LevelRun] = {}

    def current_result() -> SweepResult:
        result = _result(scenario, settings, system, runs, len(levels))
        return replace(result, wall_time_s=clock.perf_counter() - begin)

    next_save = begin
    for index, level in enumerate(levels):
        earlier = None if resume is None else _completed_level(index, resume)
        if earlier is not None:
            runs[index] = earlier
            continue
        report = part_of(progress, index / len(levels), (index + 1) / len(levels))
        one = SweepLevel(system, settings, level, index, limited)
        runs[index] = (sweep_level if isinstance(settings, SweptSine) else step_level)(one, report)
        if stop_requested():
            break
        if save is not None and clock.perf_counter() >= next_save:
            started = clock.perf_counter()
            save(current_result())
            # saving takes at most a tenth of the time
            next_save = clock.perf_counter() + max(1.0, 10.0 * (clock.perf_counter() - started))
    return current_result()


def _levels(scenario: Scenario, settings: SweptSine | SteppedSine) -> tuple[float, ...]:
    """Levels of a sweep; for a profile the factor 1."""
    by_profile = isinstance(settings, SweptSine) and settings.profile
    return settings.levels or (1.0 if by_profile else scenario.sine.level,)


def demand_consistent(result: SweepResult) -> None:
    """Check that curves and summary of a stored result belong to one sweep, before it is resumed.

    Raises
    ------
    ValueError
        If the levels are not those of the scenario, or an entry of the summary does not follow from the curves (it is
        named). Missing data of a curve cause other exceptions.
    """
    levels, computed = _levels(result.scenario, sweep_settings(result.scenario)), result["levels"].labels("level_index")
    for curve in result.curves.values():
        if curve.level_index not in computed or curve.level != levels[curve.level_index]:
            raise ValueError(f"the level of {curve.name} is {curve.level:g}")
        for name, share in curve.cycles.by_label("contact_share").items():
            if not np.all((share.values >= 0.0) & (share.values <= 1.0)):
                raise ValueError(f"contact_share of {name} in {curve.name} is not between 0 and 1")
    if not _equal_values(result.peaks, _peaks(result.curves.values(), result["modes"])):
        raise ValueError("its peaks are not those of its curves")
    for entry, value in _summary(result).items():
        if entry != "margins" and not _equal_values(
            result.summary.get(entry), value
        ):  # a check with a finer model changes these entries
            raise ValueError(f"{entry} of its summary is not that of its curves")


ROUND_OFF = 1e-9  # relative difference of values computed on another processor


def _equal_values(value: Any, other: Any) -> bool:
    """True if two summary values, with all that they contain, are equal up to round-off."""
    value, other = (math.nan if each is None or each == {} else each for each in (value, other))  # files omit these
    if isinstance(value, Mapping) and isinstance(other, Mapping):
        return all(_equal_values(value.get(key), other.get(key)) for key in {**value, **other})
    if isinstance(value, list | tuple) and isinstance(other, list | tuple):
        return len(value) == len(other) and all(map(_equal_values, value, other))
    if isinstance(value, int | float) and isinstance(other, int | float):
        return bool(np.isclose(value, other, rtol=ROUND_OFF, atol=0.0, equal_nan=True))
    return bool(value == other)


def _completed_level(index: int, previous_result: SweepResult) -> LevelRun | None:
    """Completed level of an earlier, interrupted sweep; None if it is not complete."""
    levels = previous_result["levels"]
    known = levels.labels("level_index")
    if index not in known:
        return None
    row = known.index(index)
    level = levels.isel(level_index=slice(row, row + 1))
    if not level_outcomes(level)[0].complete:
        return None
    curves, history = (curve for curve in previous_result.curves.values() if curve.level_index == index), None
    if "histories" in previous_result.datasets:
        first, end = np.searchsorted(previous_result["histories"]["level"].values, [row, row + 1]).tolist()
        history = previous_result["histories"].isel(sample=slice(first, end))
    return LevelRun(tuple(curves), level, history)


def level_outcomes(levels: Dataset) -> list[Outcome]:
    """Outcome of each level."""
    columns = {name: levels[name].values.tolist() for name in ("outcome", "outcome_numbers")}
    rows = zip(*columns.values(), strict=True)
    return [Outcome.from_texts(dict(zip(columns, row, strict=True))) for row in rows]


def _result(
    scenario: Scenario,
    settings: SweptSine | SteppedSine,
    system: StructuralSystem,
    runs: dict[int, LevelRun],
    count: int,
) -> SweepResult:
    """Result of the levels computed so far, out of ``count``."""
    curves = [curve for run in runs.values() for curve in run.curves]
    levels = join_tables([run.level for run in runs.values()], level_index=list(runs))
    unit = levels["level"].unit
    outcome = combine_level_outcomes(
        level_outcomes(levels), [Where(value, unit, "level") for value in levels["level"].values.tolist()]
    )
    if len(runs) < count:
        doubts = () if outcome.trusted else (outcome,)
        outcome = interruption(f"after {len(runs)} of {count} levels of the sweep", *doubts)
    logarithmic = isinstance(settings, SweptSine) and settings.rate.unit == "oct/s"
    peaks = _peaks(curves, system.modes)
    datasets = {
        **tables_of(curves),
        "peaks": PEAKS.table(peaks, [{"level_unit": (curves[0].level_unit if curves else "") or "1"}]),
        "levels": levels,
        "linear": _linear_response(system, settings.from_, settings.to, logarithmic),
        "modes": system.modes,
    }
    histories = [run.history for run in runs.values() if run.history is not None]
    if histories:
        number = np.repeat(np.arange(len(histories)), [of["sample"].values.size for of in histories])
        datasets["histories"] = join_tables(histories, sample=1 + np.arange(number.size), level=number)
    result = SweepResult(
        scenario=scenario,
        outcome=check_reduction(outcome, scenario, system.modes),
        datasets=datasets,
    )
    summary, correction = _summary(result), _largest_correction(levels)
    warnings = (
        *scenario.warnings,
        *system.warnings,
        *_unsupported_requests(system, summary["margins"]),
        *([] if correction is None else correction.warnings(stepped_levels=has_level_steps(settings))),
        *(warnings_along(scenario, system.modes, datasets["cycles"]) if curves else []),
    )
    return replace(result, warnings=warnings).with_summary(**summary)


def _peaks(curves: Iterable[SweepCurve], modes: Dataset) -> list[ResponsePeak]:
    """Peaks of all curves at all probes."""
    places = [(curve, probe) for curve in curves for probe in curve.places("displacement")]
    return [peak for curve, probe in places for peak in find_peaks(curve, probe, modes)]


def _largest_correction(levels: Dataset) -> CorrectionSize | None:
    """Largest correction of a swept base motion, relative to its level; None if the base is not swept."""
    if "base_correction_share" not in levels:
        return None
    at = int(np.argmax(levels["base_correction_share"].values))
    names = ("acceleration", "share", "time")
    return CorrectionSize(*(float(levels[f"base_correction_{name}"].values[at]) for name in names))


def swept_scenario(scenario: Scenario) -> Scenario:
    """Copy of the scenario with the model reduced for the highest frequency of the sweep."""
    settings = sweep_settings(scenario)
    highest = max(settings.from_, settings.to)
    # the sample rate of a run and the frequency of the excitation do not influence the reduction of a sweep
    changed = {"run": None, "excitation": scenario.sine.at(highest)}
    return with_limited_outputs(scenario.model_copy(update=changed))


def sweep_system(scenario: Scenario) -> StructuralSystem:
    """Build the system of a sweep.

    Raises
    ------
    ScenarioError
        If it has cubic springs, or cannot be built.
    """
    system = build_system(swept_scenario(scenario))
    if system.cubic is not None:
        raise ScenarioError.at(
            "chain",
            "has cubic springs, whose motion has no closed form",
            "use `beamsim run` with excitation: {kind: swept_sine, ...}, which steps through time",
        )
    return system


def _linear_response(system: StructuralSystem, low_hz: float, high_hz: float, logarithmic: bool) -> Dataset:
    """Steady linear response with all snubbers open and all closed, with points at the resonances."""
    between = np.geomspace if logarithmic else np.linspace
    modes = system.modes
    resting = modes["resting_frequencies_hz"].values if "resting_frequencies_hz" in modes else np.zeros(0)
    resonances = np.concatenate((system.open_frequencies_hz, resting))
    inside = resonances[(resonances > low_hz) & (resonances < high_hz)]
    frequency = np.unique(np.append(between(low_hz, high_hz, LINEAR_POINTS), inside))
    q, contacts, penetration = transfer(system, frequency), system.dynamics.contacts, static_penetration(system)
    omega2 = (2 * np.pi * frequency) ** 2
    shapes, names = [probe.shape for probe in system.probes], [probe.name for probe in system.probes]
    displacement = [q @ shape for shape in shapes]
    moved = accelerations_by_base(system, frequency).T
    acceleration = [base - omega2 * w for base, w in zip(moved, displacement, strict=True)]
    responses = {"displacement": displacement, "absolute_acceleration": acceleration}
    known = bool(system.snubbers) and not contacts.any_sticks_rigidly and not contacts.pressed_contacts.size
    if known:
        pressed = transfer(system, frequency, pressed_phases(system, penetration))
        responses["displacement_closed"] = [pressed @ shape for shape in shapes]
    at_rest = known and bool(names) and bool(np.all(penetration[: len(system.snubbers)] > 0.0))
    values: dict[str, Any] = {"frequency_hz": frequency, "probe": names, "closed_at_rest": at_rest}
    for name, of in responses.items():
        values |= {f"{name}_real": np.array([x.real for x in of]), f"{name}_imag": np.array([x.imag for x in of])}
    levels = contact_levels(system, frequency)
    if levels:
        values |= {"snubber": list(levels), "contact_turns": [of.gap_unit == "rad" for of in levels.values()]}
        for name in ("onset", "loss", "preload_needed", "preload_alone"):
            values[f"contact_{name}"] = np.array([getattr(of, name) for of in levels.values()])
        values["contact_valid_below"] = np.array([of.level_of_other for of in levels.values()])
    units = [{"force_unit": of.force_unit} for of in levels.values()]
    excitation = amplitude_unit(system.scenario.sine.quantity or "acceleration")
    return LINEAR.dataset(values, {"snubber": units}, excitation_unit=excitation)


def sweep_settings(scenario: Scenario) -> SweptSine | SteppedSine:
    """Section of the sweep, with the table of a profile file loaded."""
    settings = scenario.sweep
    if settings is None:
        raise ScenarioError.at(
            "sweep",
            "is missing",
            "add for example `sweep: {kind: swept_sine, from: 20 Hz, to: 400 Hz, rate: 2 oct/min}`",
        )
    if not isinstance(settings, (SweptSine, SteppedSine)):
        raise ScenarioError.at(
            "sweep.kind", f"= {settings.kind} belongs to another analysis", f"call beamsim.{settings.kind}"
        )
    if not isinstance(settings, SweptSine) or settings.profile_file is None:
        return settings
    folder = scenario.folder_of("sweep", "profile_file", "file")
    points = read_profile(settings.profile_file, folder, scenario.sine.level_quantities)
    return settings.model_copy(update={"profile": points, "between": "log_log"})


def _summary(result: SweepResult) -> dict[str, Any]:
    """Summary entries that follow from the datasets of a result."""
    scenario, curves, levels = result.scenario, result.curves, result["levels"]
    contact, correction = _gapping(scenario, result["linear"], curves), _largest_correction(levels)
    found = [
        (value, name, largest, f"{frequency:.4g} Hz {curve.direction}")
        for curve in curves.values()
        for value, name, largest, frequency in curve.largest()
    ]
    changes = contact.get("closest_to_test") or contact.get("gapping", {})
    found += [
        (BY_ENTRY["gapping_ratio"], name, ratio, f"{changes[name]['frequency_hz']:.4g} Hz")
        for name, ratio in contact.get("gapping_ratio", {}).items()
    ]
    errors = [float(np.max(curve["energy_error"].values)) for curve in curves.values()]
    return {
        **_largest(curves),
        **contact,
        "dashpots": dashpots_of(result["modes"]),
        **({} if correction is None else correction.summary()),
        "peaks": [{name: getattr(peak, name) for name in PEAK_COLUMNS} for peak in result.peaks],
        "curves": {name: _curve_summary(curve) for name, curve in curves.items()},
        "contact_share": {
            curve.name: {
                name: float(curve.weights @ share.values)
                for name, share in curve.cycles.by_label("contact_share").items()
            }
            for curve in curves.values()
        },
        "impacts": {name: of for name, curve in curves.items() if (of := _impacts(curve))} or None,
        "sliding": {name: of for name, curve in curves.items() if (of := _sliding_summary(curve))} or None,
        "notches": {name: of for name, curve in curves.items() if (of := _notches(curve))} or None,
        "energy_error": max(errors, default=None),
        "without_limit": [key for curve in curves.values() for key in _values_without_limit(curve)] or None,
        "truncation": float(levels["truncation"].values.max()),
        **{name: int(levels[name].values.sum()) for name in ("cycles", "events")},
        "processor_time_s": float(levels["processor_time_s"].values.sum()),
        "margins": with_notched_tolerance(scenario, margins_along(scenario.limits, found)),
    }


def _values_without_limit(curve: SweepCurve) -> Iterator[str]:
    """``entry.place`` of the largest values of a curve that diverge as the number of modes grows."""
    of_quantities = (
        ("acceleration_jump", "absolute_acceleration", ("peak_acceleration_g", "response_over_limit")),
        ("output_jump", "output", ("peak_output",)),
    )
    for jump, quantity, entries in of_quantities:
        for name, sizes in curve.cycles.by_label(jump).items():
            if sizes.values.max() > NOTED * np.nanmax(curve.channel(quantity, name).peak):
                yield from (f"{entry}.{curve.name} {name}" for entry in entries)


def _impacts(curve: SweepCurve) -> dict[str, dict[str, float]]:
    """Largest values of impacts along a curve, by snubber; empty if the sweep does not evaluate them."""
    entries = {
        "most_per_cycle": "impact_number", "longest_mean_contact_time_s": "impact_contact_time",
        "largest_impulse_n_s": "impact_impulse", "largest_energy_lost_j": "impact_energy_lost",
        "highest_penetration_rate_m_s": "impact_penetration_rate",
    }  # fmt: skip
    found: dict[str, dict[str, float]] = {}
    for name, rate in curve.cycles.by_label("impact_penetration_rate").items():
        called = hinge_key if rate.unit == "rad/s" else str
        values = {entry: curve[variable].sel(snubber=name).values for entry, variable in entries.items()}
        found[name] = {called(entry): float(np.nanmax(of, initial=0.0)) for entry, of in values.items()}
    return found


def _sliding_summary(curve: SweepCurve) -> dict[str, dict[str, float]]:
    """Largest values of sliding along a curve, by friction contact; empty if the sweep does not evaluate it."""
    entries = {
        "most_slides_per_cycle": "friction_slides", "largest_distance_m": "friction_distance",
        "largest_energy_lost_j": "friction_energy_lost", "largest_wear_power_w": "friction_wear_power",
    }  # fmt: skip
    names = curve.cycles.labels("friction")
    return {
        name: {
            entry: float(np.max(curve[variable].sel(friction=name).values, initial=0.0))
            for entry, variable in entries.items()
        }
        for name in names
    }


def _notches(curve: SweepCurve) -> dict[str, Any]:
    """Limits of the level by name, and the ranges with a lowered level; empty without limits."""
    notching = curve.notching
    if notching is None:
        return {}
    limits = [limit._asdict() for limit in notching.limits]
    return {
        "limits": {limit.pop("name"): limit for limit in limits},
        "ranges": [part._asdict() for part in notching.ranges],
        "points": notching.frequency_hz.size,
    }


def _largest(curves: dict[str, SweepCurve]) -> dict[str, Any]:
    """Largest values of every curve by name, and units of the outputs."""
    units = {
        name: str(unit.item())
        for curve in curves.values()
        for name, unit in curve.cycles.by_label("output_unit").items()
    }
    entries: dict[str, Any] = {
        value.entry: {name: {} for name in curves}
        for value in VALUES
        if (value.in_sweeps and value.unit not in ROTATIONAL) or (units and value is OUTPUT)
    }
    frequencies: dict[str, dict[str, dict[str, float]]] = {}
    for curve in curves.values():
        for value, name, largest, frequency in curve.largest():
            if value.in_sweeps or value is RESPONSE or value.entry in entries:
                of = entries.setdefault(value.entry, {name: {} for name in curves})
                of[curve.name][name] = largest / value.scale
                frequencies.setdefault(value.entry, {}).setdefault(curve.name, {})[name] = frequency
    return entries | {"peak_frequencies_hz": frequencies} | ({"output_unit": units} if units else {})


def _curve_summary(curve: SweepCurve) -> dict[str, Any]:
    """Direction, level and number of points of a curve; for a stepped curve, steady motions by kind."""
    steady = curve.tables.get("steady_states")
    kinds = [] if steady is None else steady["kind"].values.tolist()
    counts = {"steady": {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}} if kinds else {}
    return {"direction": curve.direction, "level": curve.level, "points": curve.frequency_hz.size, **counts}


def _gapping(scenario: Scenario, linear: Dataset, curves: dict[str, SweepCurve]) -> dict[str, Any]:
    """Summary of where the linear motion first changes contact, and where the sweep did."""
    levels, frequency_hz = contact_levels_of(linear), linear["frequency_hz"].values
    if not levels or not curves:
        return {}
    strongest = max(curves.values(), key=lambda curve: float(np.max(np.abs(curve.excitation_amplitude), initial=0.0)))
    amplitude, quantity = strongest.amplitude_at(frequency_hz), scenario.sine.quantity
    level = np.array([acceleration_amplitude(1.0, quantity, hz) for hz in frequency_hz.tolist()])
    summary = gapping(levels, frequency_hz, amplitude, level)
    turning = {name: of.gap_unit for name, of in levels.items()}
    for name, of in summary.items():
        at_rest = 1.0 if of["closed_at_rest"] else 0.0
        changed = {
            curve.name: np.flatnonzero(np.abs(curve["contact_share"].sel(snubber=name).values - at_rest) > ALWAYS)
            for curve in curves.values()
        }
        of["first_change_hz"] = {
            curve.name: float(curve.frequency_hz[changed[curve.name][0]]) if changed[curve.name].size else None
            for curve in curves.values()
        }
        gaps = [gap for c in curves.values() if not np.isnan(gap := _gap(c, name)).all()]
        of["largest_gap_m"] = max((float(np.max(gap, initial=0.0)) for gap in gaps), default=None)
    contact: dict[str, Any] = {"gapping": in_their_units(summary, turning)}
    if isinstance(scenario.sweep, SweptSine) and scenario.sweep.has_varying_level:
        summary = first_changes(levels, frequency_hz, amplitude, amplitude)
        contact["closest_to_test"] = summary
    return contact | {"gapping_ratio": gapping_ratios(summary)}


def _gap(curve: SweepCurve, snubber: str) -> Floats:
    """(C,) largest opening of a snubber in every cycle, m; NaN if it is not evaluated."""
    if "peak_gap" not in curve.cycles:
        return np.full(1, np.nan)
    return curve["peak_gap"].sel(snubber=snubber).values


def _unsupported_requests(system: StructuralSystem, margins: Margins) -> Iterator[str]:
    """Notes on requests that a sweep does not support: energies, and limits on values it does not evaluate."""
    for output in system.outputs:
        if output.squared:
            remedy = "use `beamsim run` or kind: continuation"
            yield f"outputs: {output.name} is an energy, which sweeps do not compute; {remedy}"
    for name, item in margins.items():
        if math.isnan(item["value"]):
            yield f"limits.{name} is not checked: this sweep does not compute its value"
