"""``beamsim sweep``: response of a structure to a swept or stepped sine."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.analyses.sweep.outputs import LevelRun, SweepLevel
from beamsim.analyses.sweep.peaks import find_peaks
from beamsim.analyses.sweep.result import (
    Envelope,
    LinearCurve,
    SweepCurve,
    SweepResult,
    SweepWork,
)
from beamsim.analyses.sweep.stepped import step_level
from beamsim.analyses.sweep.swept_sine import sweep_level, with_held_limits, with_limited_outputs
from beamsim.errors import ScenarioError
from beamsim.inputs.measured import limit_curve, read_profile
from beamsim.outcomes import Progress, asked_to_stop, combined, interruption, part_of
from beamsim.responses.gapping import (
    contact_levels,
    gapping,
    gapping_ratios,
    in_their_units,
    pressed_phases,
    static_penetration,
    transfer,
)
from beamsim.results.result import curve_warnings, dashpots_of, reduction_checked
from beamsim.results.values import (
    ALWAYS,
    BY_ENTRY,
    OUTPUT,
    RESPONSE,
    ROTATIONAL,
    VALUES,
    Margins,
    largest_along,
    margins_along,
)
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import holds_levels
from beamsim.scenario.reporting import Limits
from beamsim.scenario.sweep import SteppedSine, SweptSine
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem

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
    scenario : with a ``sweep`` section of kind swept_sine or stepped and a harmonic excitation.
    progress : called with the fraction done.
    save : called with the partial result after the first level and repeatedly later.
    resume : partial result of an interrupted sweep of the same scenario; its levels are not computed again.

    Returns
    -------
    SweepResult
        The curves of all levels that were computed, with their peaks; where it was asked to stop (between cycles,
        frequencies or levels), up to there, which may be none.

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

    def done() -> SweepResult:
        result = _result(scenario, settings, system, runs, len(levels))
        return replace(result, wall_time_s=clock.perf_counter() - begin)

    next_save = begin
    for index, level in enumerate(levels):
        earlier = None if resume is None else _computed_before(index, resume)
        if earlier is not None:
            runs[index] = earlier
            continue
        report = part_of(progress, index / len(levels), (index + 1) / len(levels))
        one = SweepLevel(system, settings, level, index, limited)
        runs[index] = (sweep_level if isinstance(settings, SweptSine) else step_level)(one, report)
        if asked_to_stop():
            break
        if save is not None and clock.perf_counter() >= next_save:
            started = clock.perf_counter()
            save(done())
            # saving takes at most a tenth of the time
            next_save = clock.perf_counter() + max(1.0, 10.0 * (clock.perf_counter() - started))
    return done()


def _levels(scenario: Scenario, settings: SweptSine | SteppedSine) -> tuple[float, ...]:
    """The levels of a sweep; of a profile the factor 1."""
    by_profile = isinstance(settings, SweptSine) and settings.profile
    return settings.levels or (1.0 if by_profile else scenario.sine.level,)


def demand_consistent(result: SweepResult) -> None:
    """Refuse an earlier result whose curves and summary are not those of one sweep, before it is gone on with.

    Raises
    ------
    ValueError
        If its levels are not those of its scenario, or the summary differs from what follows from its curves: says in
        which entry. Missing parts of a curve cause other exceptions.
    """
    scenario, settings = result.scenario, sweep_settings(result.scenario)
    levels = _levels(scenario, settings)
    for curve in result.curves.values():
        if curve.level != levels[curve.level_index] or curve.level_index not in result.levels:
            raise ValueError(f"the level of {curve.name} is {curve.level:g}")
        for name, share in curve.contact_share.items():
            if not np.all((share >= 0.0) & (share <= 1.0)):
                raise ValueError(f"contact_share of {name} in {curve.name} is not between 0 and 1")
    runs = {
        index: LevelRun(tuple(curve for curve in result.curves.values() if curve.level_index == index), work)
        for index, work in result.levels.items()
    }
    again = _result(scenario, settings, sweep_system(scenario), runs, len(levels)).summary
    for entry, value in again.items():
        if entry not in OF_WHOLE_SWEEP and not _alike(result.summary.get(entry), value):
            raise ValueError(f"{entry} of its summary is not that of its curves")


OF_WHOLE_SWEEP = ("status", "margins")  # entries that a check with a finer model changes
ROUND_OFF = 1e-6  # relative difference of values that are computed again on another processor


def _alike(one: Any, other: Any) -> bool:
    """Whether two values of summaries, with all that they contain, are equal but for round-off."""
    one, other = (math.nan if each is None or each == {} else each for each in (one, other))  # files leave it out
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return all(_alike(one.get(key), other.get(key)) for key in {**one, **other})
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, int | float) and isinstance(other, int | float):
        return bool(np.isclose(one, other, rtol=ROUND_OFF, atol=ROUND_OFF, equal_nan=True))
    return bool(one == other)


def _computed_before(index: int, earlier: SweepResult) -> LevelRun | None:
    """A level of an interrupted sweep, if that completed it."""
    if index not in earlier.levels or not earlier.levels[index].outcome.complete:
        return None
    curves = tuple(curve for curve in earlier.curves.values() if curve.level_index == index)
    return LevelRun(curves, earlier.levels[index], earlier.histories.get(index))


def _result(
    scenario: Scenario,
    settings: SweptSine | SteppedSine,
    system: StructuralSystem,
    runs: dict[int, LevelRun],
    count: int,
) -> SweepResult:
    """The result of the levels computed so far, of ``count`` in all."""
    work = {index: run.work for index, run in runs.items()}
    outcome = combined(level.outcome for level in work.values())
    if len(work) < count:
        doubts = () if outcome.trusted else (outcome,)
        outcome = interruption(f"after {len(work)} of {count} levels of the sweep", *doubts)
    corrections = [level.base_correction for level in work.values() if level.base_correction is not None]
    correction = max(corrections, key=lambda size: size.share, default=None)
    curves = {curve.name: _with_limits(scenario, curve) for run in runs.values() for curve in run.curves}
    logarithmic = isinstance(settings, SweptSine) and settings.rate.unit == "oct/s"
    linear = _linear_curve(system, settings.from_, settings.to, logarithmic)
    contact = _gapping(linear, curves)
    summary = _summary(scenario, curves, contact)
    return SweepResult(
        scenario=scenario,
        kind=settings.kind,
        outcome=reduction_checked(outcome, scenario, system.modes),
        curves=curves,
        linear=linear,
        peaks=tuple(
            peak
            for curve in curves.values()
            for probe in curve.displacement
            for peak in find_peaks(curve, probe, system.modes)
        ),
        datasets={"modes": system.modes},
        work=_sum([work[index].work for index in sorted(work)]),
        levels=work,
        histories={index: run.history for index, run in runs.items() if run.history is not None},
        truncation=max((level.truncation for level in work.values()), default=0.0),
        warnings=(
            *scenario.warnings,
            *system.warnings,
            *_not_followed(system, summary["margins"]),
            *([] if correction is None else correction.warnings(held=holds_levels(settings))),
            *curve_warnings(scenario, system.modes, list(curves.values())),
        ),
    ).with_summary(
        **summary,
        **contact,
        dashpots=dashpots_of(system.modes),
        **({} if correction is None else correction.summary()),
    )


def swept_scenario(scenario: Scenario) -> Scenario:
    """The scenario of whose system a sweep is: reduced for its highest frequency."""
    settings = sweep_settings(scenario)
    highest = max(settings.from_, settings.to)
    # the sample rate of a run and the frequency of the excitation do not influence the reduction of a sweep
    changed = {"run": None, "excitation": scenario.sine.at(highest)}
    return with_limited_outputs(scenario.model_copy(update=changed))


def sweep_system(scenario: Scenario) -> StructuralSystem:
    """The system of a sweep.

    Raises
    ------
    ScenarioError
        If it has cubic springs, or cannot be built.
    """
    system = build_system(swept_scenario(scenario))
    if system.cubic.count:
        raise ScenarioError.at(
            "chain",
            "has cubic springs, whose motion has no closed form",
            "use `beamsim run` with excitation: {kind: swept_sine, ...}, which steps through time",
        )
    return system


def _linear_curve(system: StructuralSystem, low_hz: float, high_hz: float, logarithmic: bool) -> LinearCurve:
    """The steady response with open and with closed snubbers; resonances of the open ones are among its points."""
    between = np.geomspace if logarithmic else np.linspace
    frequency, resonances = between(low_hz, high_hz, LINEAR_POINTS), system.open_frequencies_hz
    frequency = np.unique(np.append(frequency, resonances[(resonances > low_hz) & (resonances < high_hz)]))
    q, contacts, penetration = transfer(system, frequency), system.dynamics.contacts, static_penetration(system)
    omega2 = (2 * np.pi * frequency) ** 2
    displacement = {probe.name: q @ probe.shape for probe in system.probes}
    closed = {}
    if system.snubbers and not contacts.ever_hold and not contacts.pressed.size:
        pressed = transfer(system, frequency, pressed_phases(system, penetration))
        closed = {probe.name: pressed @ probe.shape for probe in system.probes}
    acceleration = {
        name: base - omega2 * w for base, (name, w) in zip(system.base_influence, displacement.items(), strict=True)
    }
    at_rest = bool(closed) and bool(np.all(penetration[: len(system.snubbers)] > 0.0))
    levels = contact_levels(system, frequency)
    return LinearCurve(frequency, displacement, acceleration, closed, closed_at_rest=at_rest, contact=levels)


def sweep_settings(scenario: Scenario) -> SweptSine | SteppedSine:
    """The section of the sweep, with the table of the file that it names."""
    settings = scenario.sweep
    if settings is None:
        raise ScenarioError.at(
            "sweep",
            "is missing",
            "add for example `sweep: {kind: swept_sine, from: 20 Hz, to: 400 Hz, rate: 2 oct/min}`",
        )
    if not isinstance(settings, (SweptSine, SteppedSine)):
        raise ScenarioError.at("sweep.kind", f"= {settings.kind} belongs to another analysis", "")
    if not isinstance(settings, SweptSine) or settings.profile_file is None:
        return settings
    folder = scenario.folder_of("sweep", "profile_file", "file")
    points = read_profile(settings.profile_file, folder, scenario.sine.takes)
    return settings.model_copy(update={"profile": points, "between": "log_log"})


def _sum(parts: list[SweepWork]) -> SweepWork:
    return SweepWork(
        cycles=sum(p.cycles for p in parts),
        events=sum(p.events for p in parts),
        evaluations=sum(p.evaluations for p in parts),
        segments=sum(p.segments for p in parts),
        states=max((p.states for p in parts), default=0),
        processor_time_s=sum(p.processor_time_s for p in parts),
    )


def _with_limits(scenario: Scenario, curve: SweepCurve) -> SweepCurve:
    """The curve with the limits of its responses over frequency."""
    called = {each.unit: name for name, each in Limits.curves["response"].items()}

    def limited(envelopes: tuple[Envelope, ...]) -> tuple[Envelope, ...]:
        limits = (
            limit_curve(scenario, "response", e.name, called.get(e.unit, ""), curve.frequency_hz) for e in envelopes
        )
        return tuple(replace(each, limit=limit) for each, limit in zip(envelopes, limits, strict=True))

    return replace(curve, probes=limited(curve.probes), snubbers=limited(curve.snubbers))


def _summary(scenario: Scenario, curves: dict[str, SweepCurve], contact: Mapping[str, Any]) -> dict[str, Any]:
    """What does not repeat a field of the result; ``contact`` is that of `_gapping`."""
    found = [
        (value, name, largest, f"{frequency:.4g} Hz {curve.direction}")
        for curve in curves.values()
        for value, name, largest, frequency in largest_along([curve])
    ]
    found += [
        (BY_ENTRY["gapping_ratio"], name, ratio, f"{contact['gapping'][name]['frequency_hz']:.4g} Hz")
        for name, ratio in contact.get("gapping_ratio", {}).items()
    ]
    return {
        **_largest(curves),
        "curves": {name: _described(curve) for name, curve in curves.items()},
        "contact_share": {
            curve.name: {key: float(curve.weights @ share) for key, share in curve.contact_share.items()}
            for curve in curves.values()
        },
        "impacts": {
            curve.name: {name: impacts.summary() for name, impacts in curve.impacts.items()}
            for curve in curves.values()
            if curve.impacts
        }
        or None,
        "sliding": {
            curve.name: {name: sliding.summary() for name, sliding in curve.sliding.items()}
            for curve in curves.values()
            if curve.sliding
        }
        or None,
        "notches": {curve.name: curve.notching.summary() for curve in curves.values() if curve.notching is not None}
        or None,
        "energy_error": max((float(np.max(c.energy_error)) for c in curves.values() if c.energy_error is not None),
                            default=None),
        "margins": with_held_limits(scenario, margins_along(scenario.limits, found)),
    }  # fmt: skip


def _largest(curves: dict[str, SweepCurve]) -> dict[str, Any]:
    """The largest values of every curve by name, and units of the outputs, for the summary."""
    units = {name: output.unit for curve in curves.values() for name, output in curve.outputs.items()}
    entries: dict[str, Any] = {
        value.entry: {name: {} for name in curves}
        for value in VALUES
        if (value.followed and value.unit not in ROTATIONAL) or (units and value is OUTPUT)
    }
    frequencies: dict[str, dict[str, dict[str, float]]] = {}
    for curve in curves.values():
        for value, name, largest, frequency in largest_along([curve]):
            if value.followed or value is RESPONSE or value.entry in entries:
                of = entries.setdefault(value.entry, {name: {} for name in curves})
                of[curve.name][name] = largest / value.scale
                frequencies.setdefault(value.entry, {}).setdefault(curve.name, {})[name] = frequency
    return entries | {"peak_frequencies_hz": frequencies} | ({"output_unit": units} if units else {})


def _described(curve: SweepCurve) -> dict[str, Any]:
    """Direction, level and points of a curve; of a stepped one how many steady motions of each kind it has."""
    kinds = () if curve.steady is None else curve.steady.kind
    steady = {"steady": {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}} if kinds else {}
    return {"direction": curve.direction, "level": curve.level, "points": curve.frequency_hz.size, **steady}


def _gapping(linear: LinearCurve, curves: dict[str, SweepCurve]) -> dict[str, Any]:
    """Where the linear motion first changes contact, and where the sweep did, for the summary."""
    if not linear.contact or not curves:
        return {}
    strongest = max(curves.values(), key=lambda curve: float(np.max(np.abs(curve.excitation_amplitude), initial=0.0)))
    summary = gapping(linear.contact, linear.frequency_hz, strongest.amplitude_at(linear.frequency_hz))
    for name, of in summary.items():
        at_rest = 1.0 if of["closed_at_rest"] else 0.0
        changed = {
            curve.name: np.flatnonzero(np.abs(curve.contact_share[name] - at_rest) > ALWAYS)
            for curve in curves.values()
        }
        of["first_change_hz"] = {
            curve.name: float(curve.frequency_hz[changed[curve.name][0]]) if changed[curve.name].size else None
            for curve in curves.values()
        }
        gaps = [curve.peak_gap[name] for curve in curves.values() if name in curve.peak_gap]
        of["largest_gap_m"] = max((float(np.max(gap, initial=0.0)) for gap in gaps), default=None)
    by_units = in_their_units(summary, {name: of.gap_unit for name, of in linear.contact.items()})
    return {"gapping": by_units, "gapping_ratio": gapping_ratios(summary)}


def _not_followed(system: StructuralSystem, margins: Margins) -> Iterator[str]:
    """What is asked for and not given: energies, and limits on these and on accelerations that are left out."""
    for output in system.outputs:
        if output.squared:
            remedy = "use `beamsim run` or kind: continuation"
            yield f"outputs: {output.name} is an energy, which sweeps do not follow; {remedy}"
    for name, item in margins.items():
        if math.isnan(item["value"]):
            yield f"limits.{name} is not checked: this sweep does not follow its value"
