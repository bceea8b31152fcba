"""``beamsim run``: one structure under one excitation, from its start to the end of the run.

It may start from a periodic motion stored by a continuation, with the scenario set to that point.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import numpy as np

from beamsim.analyses.run.fatigue import StressObserver, fatigue_of, fatigue_warnings
from beamsim.analyses.run.histories import (
    aliased_in_histories,
    bodies_of_run,
    contact_of_run,
    datasets_of,
    without_histories,
)
from beamsim.analyses.run.motion import (
    EVERYTHING,
    Evaluation,
    Needed,
    RunMotion,
    exact_motion_of,
    output_times,
    refuse_long_histories,
    steps_in_time,
)
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.run.shock_response import matched_spectra, shock_response
from beamsim.analyses.run.spectra import coverage_notes, spectra_of
from beamsim.analyses.run.stepped_motion import stepped_motion_of
from beamsim.analyses.run.summary import summary_entries, summary_of_run, values_of_motion
from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.files import is_as_written, reading
from beamsim.hdf5 import open_hdf5
from beamsim.inputs.statements import INPUTS, InputStatement
from beamsim.labelled import Dataset
from beamsim.outcomes import Stop, interruption
from beamsim.responses.histories import times_reached
from beamsim.responses.jumps import WithoutLimit, keys_of, without_limit
from beamsim.results.result import (
    beyond_fitted_range,
    check_reduction,
    compressed_beyond_tables,
    dashpots_of,
    deflection_warnings,
    line_warnings,
)
from beamsim.results.values import (
    DISPLACEMENT,
    FORCE,
    NO_EXTREMES,
    PENETRATION,
    RING_FORCE,
    RING_PENETRATION,
    STRESS,
    largest,
    largest_pulls,
)
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import Harmonic, MatchedInput
from beamsim.scenario.parameters import replace_values
from beamsim.scenario.run import OrbitStart, Reduction, Run, StressLife
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.signals.filters import SAMPLES_OF_OSCILLATOR
from beamsim.system.build import build_system
from beamsim.system.reduced_model import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none, of_kind

if TYPE_CHECKING:
    from beamsim.scenario.run import ShockSpectrumSettings

MISFIT_DB = 3.0  # of a matched record; within the tolerance of most specifications
SMALLEST_PULL = 1e-3  # relative to the largest contact force; smaller pulls give no warning


class Solution(NamedTuple):
    """Result of a run, with its motion."""

    motion: RunMotion
    result: RunResult  # its scenario contains the resolved start


def motion_of(
    system: StructuralSystem, settings: Run, times: Floats, progress: Callable[[float], None] | None, stop: Stop,
    needed: Needed = EVERYTHING,
) -> RunMotion:  # fmt: skip
    """Compute the motion of a built system, in closed form or by time stepping.

    Parameters
    ----------
    system, settings : system and settings of the run.
    times : (nt,) output times, s.
    progress, stop : see `solve_run`.
    needed : needed parts, which decide about the searched extremes; time stepping finds all.

    Returns
    -------
    RunMotion

    Raises
    ------
    ScenarioError
        If limits of memory or steps are exceeded.
    """
    if steps_in_time(system, settings):
        return stepped_motion_of(system, settings, times, progress, stop)
    return exact_motion_of(system, settings, times, progress, stop, needed)


def solve_run(
    scenario: Scenario, progress: Callable[[float], None] | None, stop: Stop, builds: SharedBuilds,
    entries: Collection[str] | None = None,
) -> Solution:  # fmt: skip
    """Simulate the scenario.

    Outcome, warnings, margins and values do not depend on the requested entries.

    Parameters
    ----------
    scenario : scenario with a ``run`` section.
    progress : called repeatedly with the completed fraction of the duration.
    stop : polled between blocks of events, and before each later step (spectra, statistics, fatigue). After an
    interruption the result contains the motion so far with its peaks, energies and histories, and names what is
    missing.
    builds : cache of built systems.
    entries : needed summary entries; by default everything, with histories, spectra and shapes, which are otherwise
    empty.

    Returns
    -------
    Solution
        Result and its motion.

    Raises
    ------
    ScenarioError
        If the scenario cannot be run (no ``run`` section, no static equilibrium to start from, ...).
    """
    begin = clock.perf_counter()
    scenario, system = _build(scenario, builds)
    everything, needed = entries is None, EVERYTHING if entries is None else Needed.of(scenario, entries)
    settings, times = not_none(scenario.run), output_times(scenario)
    if everything or needed.statistics:
        refuse_long_histories(system, settings, times.size)
    motion = motion_of(system, settings, times, progress, stop, needed)
    sampled = motion.histories if everything or needed.statistics else None
    evaluation = Evaluation(stop)
    if sampled is not None and sampled.time.size < times_reached(motion.source_motion.end, times).size:
        evaluation.skipped_steps.append(f"the histories after {sampled.time[-1]:.4g} s")
    datasets = without_histories() if sampled is None else datasets_of(motion, sampled, evaluation)
    values, spectra = values_of_motion(motion), None
    if everything or needed.root_mean_squares:
        spectra = evaluation.compute("the spectra", lambda: spectra_of(motion, values), spectra)
    datasets |= {} if spectra is None else {"spectra": spectra}
    datasets |= bodies_of_run(motion, evaluation) if everything else {}
    if everything and motion.contact is not None:
        datasets["contact"] = contact_of_run(system, motion.contact)
    if system.inputs:
        datasets["inputs"] = INPUTS.table(system.inputs, [{"unit": each.unit} for each in system.inputs])
    result = RunResult(
        scenario=scenario,
        outcome=check_reduction(motion.outcome, scenario, system.modes),
        datasets={**datasets, "events": motion.events, "modes": system.modes},
    )
    warnings = _warnings(motion) + ([] if evaluation.skipped_steps else coverage_notes(motion))
    warnings += [f"impacts and sliding are counted from {settings.from_:g} s on (run.from)"] if settings.from_ else []
    summary = summary_of_run(motion, values, spectra, needed, evaluation)
    if everything and sampled is not None:
        compute, unknown = partial(aliased_in_histories, motion, sampled), dict[str, float]()
        summary["aliased_in_histories"] = evaluation.compute("aliasing", compute, unknown, minor=True) or None
    if system.jumping_forces:
        found = evaluation.compute("jumps", partial(_without_limit, motion, values), list[WithoutLimit](), minor=True)
        warnings += [each.warning for each in found]
        summary["without_limit"] = [".".join(key) for each in found for key in keys_of(each.channel)] or None
    fields, notes = _requested_results(result, motion, summary, needed, evaluation)
    if evaluation.skipped_steps and result.outcome.usable:
        fields["outcome"] = interruption(f"before {', '.join(evaluation.skipped_steps)}")
    result = replace(result, **fields, warnings=(*warnings, *notes))
    result = result.with_summary(**summary, dashpots=dashpots_of(system.modes), **summary_entries(result, summary))
    return Solution(motion, replace(result, wall_time_s=clock.perf_counter() - begin))


def _build(scenario: Scenario, builds: SharedBuilds) -> tuple[Scenario, StructuralSystem]:
    """Resolve the start of a scenario and build its system; see `solve_run`."""
    if scenario.run is None:
        raise ScenarioError(Problem("run", "is missing", "add for example `run: {duration: 1 s, sample_rate: 10 kHz}`"))
    if isinstance(scenario.run.start, OrbitStart):
        return built_at_orbit(scenario, builds)
    return scenario, build_system(scenario, builds)


def _warnings(motion: RunMotion) -> list[str]:
    """Warnings about the scenario, its system and the motion."""
    system, scenario = motion.system, motion.system.scenario
    probes, peaks = [probe.name for probe in system.probes], largest(motion.extremes.get(DISPLACEMENT, NO_EXTREMES))
    snubbers = [snubber.name for snubber in system.snubbers]
    compression = dict(zip(snubbers, motion.extremes[PENETRATION][2].tolist(), strict=True)) if snubbers else {}
    return [
        *scenario.warnings,
        *system.warnings,
        *motion.warnings,
        *(pull_warnings(motion) if snubbers else []),
        *(line_warnings(system.inputs, system.modes) if system.inputs else []),
        *(compressed_beyond_tables(scenario, compression) if scenario.has_force_tables else []),
        *(_ring_warnings(motion) if system.springs and system.rings else []),
        *deflection_warnings(scenario, system.modes, [dict(zip(probes, peaks, strict=True))]),
    ]


def _ring_warnings(motion: RunMotion) -> list[str]:
    """Warnings about penetrations beyond the fitted range of rings."""
    from beamsim.system.rings import ring_columns

    channels, extremes = motion.system.channels.of_keys(RING_FORCE, RING_PENETRATION), motion.extremes
    if RING_PENETRATION not in extremes or RING_FORCE not in extremes:
        return []
    low, high = (np.hstack([extremes[key][row] for key in (RING_FORCE, RING_PENETRATION)])[None] for row in (0, 2))
    found = ring_columns(motion.system.rings, channels, high, low)
    return beyond_fitted_range(
        motion.system.scenario, dict(zip(found["ring"], found["ring_penetration"][:, 0].tolist(), strict=True))
    )


def pull_warnings(motion: RunMotion) -> list[str]:
    """Warn about each snubber whose dashpot pulls before the contact opens."""
    forces = motion.extremes[FORCE]
    pulls = largest_pulls(forces)
    return [
        f"{s.label}: its dashpot pulls with up to {pulls[j]:.3g} {s.item.units[1]} before the contact opens"
        + ("; with law: no_tension it opens before that" if not s.item.yields else "")
        for j, s in enumerate(motion.system.scenario.located_snubbers)
        if pulls[j] > SMALLEST_PULL * forces[2][j] and not s.item.latch
    ]


def _requested_results(
    result: RunResult, motion: RunMotion, values: Mapping[str, Any], needed: Needed, evaluation: Evaluation
) -> tuple[dict[str, Any], list[str]]:
    """Compute the requested results beyond the motion itself, and notes on them.

    Parameters
    ----------
    result : result of the motion.
    motion : motion of the run.
    values : values of the motion, by entry of the summary.
    needed : needed parts; the basis of notes is always computed.
    evaluation : evaluation of the motion.
    """
    scenario, system, settings = result.scenario, motion.system, not_none(result.scenario.run)
    fields: dict[str, Any] = {}
    datasets: dict[str, Dataset] = {}
    notes: list[str] = []
    if scenario.excitation.stationary and needed.statistics:
        fields |= _random(result, motion, values, evaluation, datasets)
    counted = settings.from_ < motion.source_motion.end or not settings.from_
    if (impacts := motion.impacts) is not None and counted:
        datasets |= evaluation.compute("statistics of impacts", impacts.result, dict[str, Dataset]())
    if settings.fatigue is not None and motion.stresses is not None:
        notes += _fatigue(motion, settings.fatigue, motion.stresses, evaluation, datasets)
    if settings.srs is not None:
        notes += _shock_response(motion, settings.srs, needed, evaluation, datasets)
    if settings.sensitivities:
        notes += _sensitivities(motion, evaluation, datasets)
    if any(isinstance(each, MatchedInput) for _, each in scenario.excitation.items):
        datasets["matched"] = matched_spectra(system)
        notes += _misfit(datasets["matched"])
    fields["datasets"] = result.datasets | datasets
    return fields, notes


def _random(
    result: RunResult,
    motion: RunMotion,
    values: Mapping[str, Any],
    evaluation: Evaluation,
    datasets: dict[str, Dataset],
) -> dict[str, Any]:
    """Add the statistics of the response to a random input to the datasets; returns the updated outcome."""
    from beamsim.analyses.run.random_response import random_response, with_test_outcome

    random = evaluation.compute("densities and statistics", lambda: random_response(result, motion, values), None)
    if random is None:
        return {}
    datasets["random"] = random
    return {"outcome": with_test_outcome(result.outcome, random, not_none(result.scenario.run))}


def _fatigue(
    motion: RunMotion,
    settings: StressLife,
    stresses: StressObserver,
    evaluation: Evaluation,
    datasets: dict[str, Dataset],
) -> list[str]:
    """Add the fatigue damage to the datasets; returns warnings."""
    end, extremes = motion.source_motion.end, motion.extremes[STRESS]
    compute = partial(fatigue_of, motion.system, stresses, end, extremes)
    damage = evaluation.compute("the damage of stress", compute, None)
    if damage is None:
        return []
    datasets["fatigue"] = damage
    return [*fatigue_warnings(damage, settings)]


def _shock_response(
    motion: RunMotion, settings: ShockSpectrumSettings, needed: Needed, evaluation: Evaluation,
    datasets: dict[str, Dataset],
) -> list[str]:  # fmt: skip
    """Add shock response spectra to the datasets if they are needed; returns notes on coarse samples."""
    if needed.has("srs_over_limit"):
        compute = partial(shock_response, motion.system, motion.available_motion)
        srs = evaluation.compute("shock response spectra", compute, None)
        datasets |= {} if srs is None else {"srs": srs}
    return _coarse_samples(motion, settings) + _coarse_records(motion.system.inputs, settings)


def _sensitivities(motion: RunMotion, evaluation: Evaluation, datasets: dict[str, Dataset]) -> list[str]:
    """Add the sensitivities to the datasets; returns notes."""
    from beamsim.analyses.run.sensitivities import sensitivities_of

    unknown: tuple[Dataset | None, list[str]] = None, []
    compute = partial(sensitivities_of, motion.system.scenario, motion)
    found, notes = evaluation.compute("sensitivities", compute, unknown)
    datasets |= {} if found is None else {"sensitivities": found}
    return notes


def _misfit(matched: Dataset) -> list[str]:
    """Note if a matched record deviates much from its shock response spectrum."""
    worst = float(np.nanmax(np.abs(matched["misfit_db"].values)))
    if worst <= MISFIT_DB:
        return []
    return [
        f"excitation.srs: the record is up to {worst:.1f} dB from the curve: give another seed, another "
        "duration, or a curve without steep sides and with levels that its Q allows"
    ]


def _coarse_samples(motion: RunMotion, settings: ShockSpectrumSettings) -> list[str]:
    """Note if the output times of a time-stepped motion are too coarse for shock response spectra."""
    if motion.trajectory is not None:
        return []
    time = not_none(motion.histories).time
    least = SAMPLES_OF_OSCILLATOR * settings.to
    if (time.size - 1) / time[-1] >= least:
        return []
    return [
        f"shock response spectra of a time-stepped motion are those of its samples: raise run.sample_rate to "
        f"{least:g} Hz or more for run.srs up to {settings.to:g} Hz"
    ]


def _coarse_records(inputs: Sequence[InputStatement], settings: ShockSpectrumSettings) -> list[str]:
    """Notes on measured inputs whose sample rate is too low for the oscillators of shock response spectra."""
    return [
        f"{each.path}: oscillators of run.srs from {each.sample_rate_hz / SAMPLES_OF_OSCILLATOR:.4g} to "
        f"{settings.to:g} Hz lie above a tenth of the record's sampling rate, {each.sample_rate_hz:.5g} Hz, and follow "
        "the interpolation between the samples: lower run.srs.to, or measure faster"
        for each in inputs
        if math.isnan(each.from_hz) and each.sample_rate_hz < SAMPLES_OF_OSCILLATOR * settings.to * (1 - 1e-9)
    ]


def _without_limit(motion: RunMotion, values: Mapping[str, Any]) -> list[WithoutLimit]:
    """Accelerations that diverge as the number of modes grows, from values of the motion."""
    system, filtered = motion.system, not_none(motion.system.scenario.run).low_pass is not None
    of_probes = {} if filtered else values["peak_acceleration_g"]
    peaks = {("probes", name): peak * STANDARD_GRAVITY for name, peak in of_probes.items()}
    peaks |= {("outputs", name): peak for name, peak in values.get("peak_output", {}).items()}
    return [*without_limit(system, motion.jumps, peaks)]


SAME_MODES = 1e-9  # relative difference of frequencies and shapes of the same model, built twice
_ORBIT = "run.start.orbit"


@dataclass(frozen=True)
class StoredOrbit:
    """Point of a branch or of a curve of special points in a result file."""

    parameter: str  # frequency, level, gap or stiffness; for a special curve the second parameter
    snubber: str
    value: float  # value of the parameter, SI
    frequency_hz: float
    level: float
    state: Floats  # (N,) coordinates, velocities, and internal states of the contacts, in the file's modes
    open_frequencies_hz: Floats  # (n,)
    shapes: Floats  # (n, nx) of the open modes at the stations
    kept_modes: int


def read_orbit(start: OrbitStart, folder: Path | None) -> StoredOrbit:
    """Read the point of a file that a start names.

    Raises
    ------
    ScenarioError
        If there is no such point, or the file has no continuation.
    """
    path = (folder or Path()) / start.orbit
    try:
        with reading(path, "a result", "run the continuation again"), open_hdf5(path) as file:
            if file.attrs.get("command") != "sweep" or file.attrs.get("kind") != "continuation":
                _reject(f"= {start.orbit} holds no continuation", "give the file of a sweep with kind: continuation")
            of_curves = start.special_curve is not None
            table, column, points = (
                ("special_curves", "special_curve", "special_curve_points")
                if of_curves
                else ("branches", "branch", "points")
            )
            number = not_none(start.special_curve) if of_curves else start.branch
            count = file[f"{table}/{column}"].size if table in file else 0
            if number >= count and of_curves:
                has = f"its curves of special points are 0 to {count - 1}" if count else "it has none"
                _reject(f"= {number} is not in the file", has, "run.start.special_curve")
            if number >= count:
                _reject(f"= {number} is not in the file", f"its branches are 0 to {count - 1}", "run.start.branch")
            if not is_as_written(path):
                _reject(f"= {start.orbit} was changed after it was written", "run the continuation again")
            members, rows = file[table], file[points]
            own = np.flatnonzero(rows[column][()] == number)
            if start.point > own.size:
                remedy = f"it has the points 1 to {own.size}"
                _reject(f"= {start.point} is beyond the branch", remedy, "run.start.point")
            k = int(own[start.point - 1])
            states = [rows[name][k] for name in ("coordinates", "coordinate_velocities", "internal_states")
                      if name in rows]  # fmt: skip
            parameter, snubber = (members[name].asstr()[()] for name in ("followed", "followed_snubber"))
            value = float(rows["parameter"][k])
            return StoredOrbit(
                parameter,
                snubber,
                value,
                float(rows["frequency_hz"][k]),
                value if parameter == "level" else float(members["level"][number]),
                np.concatenate(states),
                file["modes/open_frequencies_hz"][()],
                file["modes/shapes"][()],
                int(file["modes/kept_modes"][()]),
            )
    except InputFileError as error:
        remedy = "run the continuation again"
        if error.missing:
            remedy = "give its path, relative to the folder of the scenario"
        _reject(f"= {start.orbit} {error.message}", remedy)


def _scenario_at_orbit(scenario: Scenario, orbit: StoredOrbit, *, keep_excitation: bool = False) -> Scenario:
    """Scenario with the excitation and parameter of the point (unless kept), and the same number of modes.

    Raises
    ------
    ScenarioError
        If the scenario has no harmonic excitation or lacks the continued parameter.
    """
    excitation = scenario.excitation
    if not isinstance(excitation, Harmonic):
        _reject("needs the excitation of the continuation", "give a harmonic excitation", "excitation.kind")
    changed: dict[str, Any] = {}
    if scenario.reduction is None:
        changed["reduction"] = Reduction(modes=orbit.kept_modes)
    if keep_excitation:
        return scenario.model_copy(update=changed)
    changed["excitation"] = excitation.at(orbit.frequency_hz, orbit.level)
    if orbit.parameter in ("gap", "stiffness"):
        named = [located for located in scenario.listed("snubbers") if located.item.name == orbit.snubber]
        if not named:
            _reject(f"follows the {orbit.parameter} of {orbit.snubber}, which is no snubber of this scenario", "add it")
        scenario = replace_values(scenario, {(*named[0].path, orbit.parameter): orbit.value})
    elif orbit.parameter == "position":
        _reject(
            "follows a position, in coordinates that change with it", "start from a continuation in another parameter"
        )
    return scenario.model_copy(update=changed)


def built_at_orbit(scenario: Scenario, builds: SharedBuilds) -> tuple[Scenario, StructuralSystem]:
    """Scenario at the point from which its run starts, and its system with that state.

    Raises
    ------
    ScenarioError
        If there is no such point, or the scenario has another model than the file.
    """
    settings = not_none(scenario.run)
    start = of_kind(OrbitStart, settings.start)
    orbit = read_orbit(start, scenario.folder_of("run", "start", "orbit"))
    scenario = _scenario_at_orbit(scenario, orbit, keep_excitation=start.keep_excitation)
    at_rest = scenario.model_copy(update={"run": settings.model_copy(update={"start": "rest"})})
    return scenario, _start_from_orbit(build_system(at_rest, builds), orbit, start.factor)


def _start_from_orbit(system: StructuralSystem, orbit: StoredOrbit, factor: float = 1.0) -> StructuralSystem:
    """System with the state of the point times a factor; signs of modes may differ.

    Raises
    ------
    ScenarioError
        If the system has another model than the file.
    """
    n, frequencies, shapes = system.dynamics.size, system.open_frequencies_hz, system.deflection.T
    alike = frequencies.shape == orbit.open_frequencies_hz.shape and shapes.shape == orbit.shapes.shape
    if alike:
        sign = np.where(np.sum(shapes * orbit.shapes, axis=1) < 0, -1.0, 1.0)
        largest = np.abs(orbit.shapes).max()
        alike = bool(
            np.allclose(frequencies, orbit.open_frequencies_hz, rtol=SAME_MODES, atol=0.0)
            and np.abs(sign[:, None] * shapes - orbit.shapes).max() < np.sqrt(SAME_MODES) * largest
        )
    if not alike:
        _reject("is a motion of another structure", "keep structure, places and reduction of the continuation")
    state = factor * orbit.state
    state[:n] *= sign
    state[n : 2 * n] *= sign
    return replace(system, initial_state=state)


def _reject(message: str, remedy: str, path: str = _ORBIT) -> NoReturn:
    raise ScenarioError(Problem(path, message, remedy))
