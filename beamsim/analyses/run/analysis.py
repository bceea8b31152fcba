"""``beamsim run``: one structure under one excitation, from its start to the end of the run."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.deflections import deflection_warnings
from beamsim.analyses.reduction import reduction_checked
from beamsim.analyses.run.convergence import resting, with_convergence
from beamsim.analyses.run.derived import DerivedFigures
from beamsim.analyses.run.exact_motion import exact_motion_of
from beamsim.analyses.run.figures import by_name, largest
from beamsim.analyses.run.first_part import checked_on_first_part
from beamsim.analyses.run.impacts import fatigue_doubts, fatigue_of
from beamsim.analyses.run.jumps import jump_warnings
from beamsim.analyses.run.model_check import convergence_of
from beamsim.analyses.run.motion import (
    KEPT,
    RunMotion,
    bodies_of_run,
    contact_instant,
    histories_of,
    output_times,
    pull_warnings,
    spectra_of,
    step_of_few,
)
from beamsim.analyses.run.orbit_start import built_at_orbit
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.run.spectra import coverage_notes
from beamsim.analyses.run.stepped_motion import stepped_motion_of, steps_in_time
from beamsim.analyses.run.summary import spectral_lines, summary_of_run
from beamsim.analyses.table_reach import compressed_beyond_tables
from beamsim.errors import Problem, ScenarioError
from beamsim.fields import changed, rows_of
from beamsim.flow.stopping import Stopped, heeding, never
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.scenario.run import OrbitStart
from beamsim.system.build import build_system
from beamsim.system.shared import SharedBuilds
from beamsim.system.structural import StructuralSystem

if TYPE_CHECKING:
    from beamsim.scenario import Scenario
    from beamsim.scenario.run import ShockSpectrumSettings
    from beamsim.structures.stations import StressRows


def run(
    scenario: Scenario, progress: Callable[[float], None] | None = None, stop: Callable[[], bool] = never
) -> RunResult:
    """Simulate the scenario.

    Parameters
    ----------
    scenario : with a ``run`` section.
    progress : called from time to time with the fraction of the duration that is done.
    stop : asked several times a second whether to end; the result then holds the motion up to there. Where
        there are many output times, evenly spaced ones of them are kept. What of its evaluation takes longer than a
        fifth of a second is left out: energies are nan and peaks those of the samples.

    Raises
    ------
    ScenarioError
        Where the scenario cannot be run (no ``run`` section, no static equilibrium to start from, ...).
    """
    begin = clock.perf_counter()
    if scenario.run is None:
        raise ScenarioError(Problem("run", "is missing", "add for example `run: {duration: 1 s, sample_rate: 10 kHz}`"))
    settings, shared = scenario.run, SharedBuilds()
    if isinstance(settings.start, OrbitStart):
        scenario, system = built_at_orbit(scenario, lambda at_rest: build_system(at_rest, shared))
    else:
        system = build_system(scenario, shared)
    times = output_times(settings)
    solve = stepped_motion_of if steps_in_time(system, settings) else exact_motion_of
    motion = solve(system, settings, times, progress, stop)
    try:
        with heeding(stop):
            spectra = spectra_of(scenario, system, motion)
    except Stopped:
        whole = not motion.outcome.interrupted  # else the outcome says where in time the motion ends
        outcome = Outcome.of(OutcomeCode.INTERRUPTED, during="the spectra") if whole else motion.outcome
        motion = replace(_with_few_times(motion), trajectory=None, outcome=outcome)
        spectra = spectra_of(scenario, system, motion)  # of the samples
    probes, peaks = [probe.name for probe in system.probes], largest(motion.extremes["displacement"])
    snubbers = [snubber.name for snubber in system.snubbers]
    result = RunResult(
        scenario=scenario,
        method=motion.method,
        outcome=reduction_checked(motion.outcome, system.modes),
        contact=contact_instant(system, motion),
        base_unit="rad" if getattr(scenario.excitation, "rotates", False) else "m",
        events=motion.events,
        spectra=spectra,
        **histories_of(scenario, system, motion),
        **bodies_of_run(scenario, system, motion),
        modes=system.modes,
        work=motion.work,
        low_pass_hz=settings.low_pass,
        warnings=(
            *scenario.warnings,
            *system.warnings,
            *motion.warnings,
            *pull_warnings(system, motion),
            *compressed_beyond_tables(scenario, by_name(snubbers, motion.extremes["penetration"][2][: len(snubbers)])),
            *deflection_warnings(scenario, system.modes, [dict(zip(probes, peaks, strict=True))]),
            *coverage_notes(system, spectra, closed_form=motion.trajectory is not None),
        ),
    )
    if scenario.excitation.kind in ("random", "sampled"):
        result = _with_statistics(result, system, stop)
    result = _with_impacts(result, motion, system.stress, stop)
    summary = summary_of_run(scenario, system, motion, spectra, stop)
    jumps = jump_warnings(scenario, system, motion, summary["peak_acceleration_g"])
    result = changed(result, warnings=(*result.warnings, *jumps))
    spectra = {key: changed(s, lines=()) if resting(*key, summary) else s for key, s in spectra.items()}
    result = changed(result, spectra=spectra)
    if crushed := {s.name: s.residual_crush for s in result.snubbers.values() if s.residual_crush is not None}:
        summary["residual_crush_m"] = crushed
    if result.friction:
        summary["friction"] = {name: contact.summary() for name, contact in result.friction.items()}
    if result.impacts is not None:
        summary |= {"impacts": result.impacts.summary(), "impacts_total": result.impacts.total()}
    if result.fatigue:
        summary["fatigue"] = {name: body.summary() for name, body in result.fatigue.items()}
    if result.random is not None:
        summary["random"] = result.random.summary()
        if prediction := result.random.prediction():
            summary["random_linear"] = prediction
    if settings.srs is not None and not motion.outcome.interrupted:
        result = _with_shock_response(result, system, motion, settings.srs, stop)
        if result.srs is not None:
            summary["srs"] = result.srs.summary()
    if motion.compared_s is not None:
        checked = checked_on_first_part(scenario, system, motion, shared, stop)
    else:
        sampled_at = np.zeros(0) if result.random is None else result.time
        of_probes = {key: spectra[key] for key in spectra if key[0] in result.probes}
        derived = DerivedFigures(scenario, of_probes, result.random, sampled_at, result.srs)
        checked = convergence_of(scenario, system, motion, summary, derived, shared, stop)
    if checked is not None:
        result = with_convergence(result, checked)
        summary |= checked.summary()
    if stop():
        result = _with_few_samples(result, system, motion)
    result = result.with_summary(spectral_lines=spectral_lines(result.spectra), **summary)
    return changed(result, wall_time_s=clock.perf_counter() - begin)


def _with_few_samples(result: RunResult, system: StructuralSystem, motion: RunMotion) -> RunResult:
    """Where a stop is requested: of many output times those that are quickly sampled and written."""
    few = _with_few_times(motion)
    if few is motion:
        return result
    outcome = result.outcome
    if outcome.complete:
        outcome = Outcome.of(OutcomeCode.INTERRUPTED, during="the evaluation of the motion")
    warnings = (*result.warnings, *few.warnings[len(motion.warnings) :])
    return changed(result, outcome=outcome, warnings=warnings, **histories_of(result.scenario, system, few))


def _with_impacts(
    result: RunResult, motion: RunMotion, stress: StressRows | None, stop: Callable[[], bool]
) -> RunResult:
    """Add statistics of impacts and the damage of stress, where they are asked for."""
    settings = result.scenario.run
    assert settings is not None
    try:
        with heeding(stop):
            if settings.impacts is not None:
                if motion.impacts is None:
                    raise Stopped
                impacts = motion.impacts.statistics(stationary=result.scenario.excitation.kind == "random")
                result = changed(result, impacts=impacts)
            if settings.fatigue is not None and stress is not None:
                if motion.trajectory is None:
                    raise Stopped
                stresses = largest(motion.station_extremes())
                of_bodies = fatigue_of(motion.parts, motion.trajectory.end, stress, stresses, settings.fatigue)
                doubts = fatigue_doubts(of_bodies, settings.fatigue)
                result = changed(result, fatigue=of_bodies, warnings=(*result.warnings, *doubts))
    except Stopped:
        return _given_up(result, "statistics of impacts or the damage of stress")
    return result


def _with_few_times(motion: RunMotion) -> RunMotion:
    """The motion at those of many output times that are quickly sampled and written."""
    step = step_of_few(motion.histories.count)
    if step == 1:
        return motion
    return replace(
        motion,
        histories=motion.few or motion.histories.every(step),
        low_passed=None if motion.low_passed is None else motion.low_passed[::step],
        warnings=(*motion.warnings, KEPT.format(step)),
    )


def _given_up(result: RunResult, figures: str) -> RunResult:
    """The result without figures whose computation was interrupted; an earlier outcome stays."""
    outcome = Outcome.of(OutcomeCode.INTERRUPTED, during=f"the {figures}") if result.complete else result.outcome
    return changed(result, outcome=outcome, warnings=(*result.warnings, f"interrupted: {figures} are missing"))


def _with_statistics(result: RunResult, system: StructuralSystem, stop: Callable[[], bool]) -> RunResult:
    """Add densities, statistics and transmissibilities; those of few samples also after a request to stop."""
    from beamsim.analyses.run.linear_prediction import linear_structures
    from beamsim.analyses.run.random_response import random_response

    force = None if system.base_acceleration is not None else system.forcing.signal[0](result.time)
    stationary = result.scenario.excitation.kind == "random"
    try:
        with heeding(stop if step_of_few(rows_of(result, "time").size) > 1 else never):
            predicted = linear_structures(result.scenario, system)
            response = random_response(result, force, stationary=stationary, predicted=predicted)
            return changed(result, random=response)
    except Stopped:
        return _given_up(result, "densities and statistics")


def _with_shock_response(
    result: RunResult,
    system: StructuralSystem,
    motion: RunMotion,
    settings: ShockSpectrumSettings,
    stop: Callable[[], bool],
) -> RunResult:
    """Add shock response spectra; an interruption leaves them out and is an outcome."""
    from beamsim.analyses.run.shock_response import SAMPLES_A_PERIOD, shock_response

    warnings = result.warnings
    try:
        with heeding(stop):
            if motion.trajectory is not None:
                shock = shock_response(settings, system, motion.trajectory)
            else:
                time = motion.histories.time
                shock = shock_response(settings, system, (time, motion.histories.values["acceleration"]))
                if (time.size - 1) / time[-1] < SAMPLES_A_PERIOD * settings.to:
                    warnings += (
                        f"shock response spectra of a time-stepped motion are those of its samples: raise "
                        f"run.sample_rate to {SAMPLES_A_PERIOD * settings.to:g} Hz or more for run.srs up to "
                        f"{settings.to:g} Hz",
                    )
    except Stopped:
        return _given_up(result, "shock response spectra")
    return changed(result, srs=shock, warnings=warnings)
