"""``beamsim run``: one structure under one excitation, from its start to the end of the run."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.gapping import contact_levels, gapping
from beamsim.analyses.limits import STANDARD_GRAVITY, margins
from beamsim.analyses.reduction import reduction_checked
from beamsim.analyses.run.convergence import (
    Convergence,
    Solution,
    check_convergence,
    followed_to_the_end,
    march_again,
    resting,
    solve_exactly,
    with_convergence,
)
from beamsim.analyses.run.derived import DerivedFigures, OutputSamples
from beamsim.analyses.run.energy import EnergyBalance, energy_of_segments, stored_energy
from beamsim.analyses.run.figures import (
    SEEDS,
    Extreme,
    Extremes,
    by_name,
    deflection_size,
    energy_extremes,
    largest,
    largest_pulls,
    motion_figures,
    refine_extremes,
    sampled_extremes,
    static_figures,
)
from beamsim.analyses.run.friction import friction_contacts, sliding_figures
from beamsim.analyses.run.histories import COMPONENTS, ExactHistories, Grace, Histories, SampledHistories
from beamsim.analyses.run.impacts import ImpactRecord, fatigue_of
from beamsim.analyses.run.low_pass import filtered
from beamsim.analyses.run.orbit_start import at_orbit, read_orbit, started
from beamsim.analyses.run.output_times import OutputTimes
from beamsim.analyses.run.outputs import (
    MOTION_SHARE,
    OutputSet,
    energies_of_rows,
    events_in_memory,
    exact_flow,
    output_groups,
    pieces_of,
    searched_outputs,
)
from beamsim.analyses.run.parting import ContactEvents
from beamsim.analyses.run.result import (
    MAIN_QUANTITY,
    ONLY_BEAM,
    BodyResult,
    ContactInstant,
    EnergyHistory,
    EventLog,
    FrictionHistory,
    OutputHistory,
    ProbeHistory,
    RunResult,
    SnubberHistory,
    Spectrum,
    SpringHistory,
    Work,
)
from beamsim.analyses.run.spectra import (
    SPECTRAL_GROUPS,
    finer_rate,
    folding_doubts,
    spectra_of_motion,
    spectra_of_samples,
)
from beamsim.analyses.run.stretches import (
    BYTES_A_PIECE,
    COMPARED_SHARE,
    SPECTRUM_SHARE,
    STRETCH_SHARE,
    LowPassed,
    StretchFigures,
    figures_of_stretches,
    station_extremes,
)
from beamsim.contacts.springs import FRICTION
from beamsim.errors import Problem, ScenarioError
from beamsim.fields import changed, later, rows_of
from beamsim.flow.long_motion import CHECKPOINT_PIECES, LongMotion
from beamsim.flow.stopping import Stopped, check_stop, heeding, never
from beamsim.flow.transient import simulate
from beamsim.inputs.streamed import KnownValues
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.scenario.excitation import Forces, Harmonic
from beamsim.scenario.quantities import INTEGRALS
from beamsim.scenario.run import OrbitStart
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.flow.exact import ExactFlow
    from beamsim.flow.reference import ReferenceTrajectory
    from beamsim.flow.trajectory import Trajectory
    from beamsim.inputs.signal import Signal
    from beamsim.scenario import Run, Scenario
    from beamsim.scenario.impacts import ImpactSettings
    from beamsim.scenario.run import ShockSpectrumSettings

MOST_SAMPLES = 50_000_000
SAMPLES_OF_A_STOPPED_RUN = 20_000
_KEPT = "interrupted: of {} output times one is kept"
SMALLEST_PULL = 1e-3  # of the largest contact force, that is worth a warning
STEPS_A_PERIOD = 20  # least number, of a structure with cubic springs and contacts


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
        third of a second is left out: energies are nan and peaks those of the samples.

    Raises
    ------
    ScenarioError
        Where the scenario cannot be run (no ``run`` section, no static equilibrium to start from, ...).
    """
    begin = clock.perf_counter()
    if scenario.run is None:
        raise ScenarioError(Problem("run", "is missing", "add for example `run: {duration: 1 s, sample_rate: 10 kHz}`"))
    settings = scenario.run
    if isinstance(settings.start, OrbitStart):
        orbit = read_orbit(settings.start, scenario.folder_of("run", "start", "orbit"))
        scenario = at_orbit(scenario, orbit, keep_excitation=settings.start.keep_excitation)
        at_rest = scenario.model_copy(update={"run": settings.model_copy(update={"start": "rest"})})
        system = started(build_system(at_rest), orbit, settings.start.factor)
    else:
        system = build_system(scenario)
    times = _output_times(settings)
    one_random = scenario.excitation.kind == "random" and not _steps_in_time(system, settings)
    in_stretches = one_random and pieces_of(system) * BYTES_A_PIECE > MOTION_SHARE * settings.memory
    if in_stretches:
        _check_stretches(system, settings)
    solve = _reference if _steps_in_time(system, settings) else _exact_in_stretches if in_stretches else _exact
    motion = solve(system, settings, times, progress, stop)
    try:
        with heeding(stop):
            spectra = _spectra(scenario, system, motion)
    except Stopped:
        whole = not motion.outcome.interrupted  # else the outcome says where in time the motion ends
        outcome = Outcome.of(OutcomeCode.INTERRUPTED, during="the spectra") if whole else motion.outcome
        motion = replace(_with_few_times(motion), trajectory=None, outcome=outcome)
        spectra = _spectra(scenario, system, motion)  # of the samples
    with_inputs = (motion.few_inputs if motion.outcome.interrupted else None) or system
    result = RunResult(
        scenario=scenario,
        method=motion.method,
        outcome=reduction_checked(motion.outcome, system.modes),
        contact=_contact(system, motion),
        base_unit="rad" if getattr(scenario.excitation, "rotates", False) else "m",
        events=motion.events,
        spectra=spectra,
        **_histories(scenario, with_inputs, motion),
        **_bodies(scenario, system, motion),
        modes=system.modes,
        work=motion.work,
        low_pass_hz=settings.low_pass,
        warnings=(
            *scenario.warnings,
            *system.warnings,
            *motion.warnings,
            *_pulls(system, motion),
            *(folding_doubts(spectra) if motion.trajectory is None else ()),  # else a bound, and lines are free of it
        ),
    )
    if scenario.excitation.kind in ("random", "sampled"):
        result = _with_statistics(result, with_inputs, stop)
    result = _with_impacts(result, system, motion, stop)
    summary = _summary(scenario, system, motion, spectra)
    spectra = {key: changed(s, lines=()) if resting(*key, summary) else s for key, s in spectra.items()}
    result = changed(result, spectra=spectra)
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
    if in_stretches:
        checked = _checked_on_first_part(scenario, system, motion, stop)
    else:
        sampled_at = np.zeros(0) if result.random is None else result.time
        of_probes = {key: spectra[key] for key in spectra if key[0] in result.probes}
        derived = DerivedFigures(scenario, of_probes, result.random, sampled_at, result.srs)
        checked = _checked(scenario, system, motion, summary, derived, stop)
    if checked is not None:
        result = with_convergence(result, checked)
        summary |= checked.summary()
    if stop():
        result = _with_few_samples(result, system, motion)
    result = result.with_summary(spectral_lines=_spectral_lines(result.spectra), **summary)
    return changed(result, wall_time_s=clock.perf_counter() - begin)


def _histories(scenario: Scenario, system: StructuralSystem, motion: _RunMotion) -> dict[str, Any]:
    """Everything at the output times, as fields of the result."""
    return {
        "time": motion.histories.signal(lambda time: time),
        "probes": _probes(system, motion),
        "snubbers": _snubbers(system, motion),
        "springs": _springs(system, motion),
        "friction": _friction(scenario, system, motion),
        "outputs": _outputs(system, motion),
        "base_acceleration": motion.histories.signal(partial(_signal, system.base_acceleration)),
        "base_displacement": motion.histories.signal(partial(_signal, system.base_displacement)),
        "energy": motion.histories.energies(),
    }


def _with_few_samples(result: RunResult, system: StructuralSystem, motion: _RunMotion) -> RunResult:
    """Where a stop is requested: of many output times those that are quickly sampled and written."""
    step = _step_of_few(motion.histories.count)
    if step == 1:
        return result
    few = _with_few_times(motion)
    system = motion.few_inputs or system
    outcome = result.outcome
    if outcome.complete:
        outcome = Outcome.of(OutcomeCode.INTERRUPTED, during="the evaluation of the motion")
    warnings = (*result.warnings, _KEPT.format(step))
    return changed(result, outcome=outcome, warnings=warnings, **_histories(result.scenario, system, few))


def _with_impacts(
    result: RunResult, system: StructuralSystem, motion: _RunMotion, stop: Callable[[], bool]
) -> RunResult:
    """Add statistics of impacts and the damage of stress, where they are asked for."""
    settings = result.scenario.run
    assert settings is not None
    if settings.impacts is None and settings.fatigue is None:
        return result
    try:
        with heeding(stop):
            if settings.impacts is not None:
                record = motion.impacts or _impacts_of(system, motion, settings.impacts)
                impacts = record.statistics(stationary=result.scenario.excitation.kind == "random")
                result = changed(result, impacts=impacts)
            if settings.fatigue is not None and system.stress is not None:
                if motion.trajectory is None:
                    raise Stopped
                stresses = largest(motion.station_extremes())
                of_bodies = fatigue_of(motion.parts, motion.trajectory.end, system.stress, stresses, settings.fatigue)
                result = changed(result, fatigue=of_bodies)
    except Stopped:
        return _given_up(result, "statistics of impacts or the damage of stress")
    return result


def _with_few_times(motion: _RunMotion) -> _RunMotion:
    """The motion at those of many output times that are quickly sampled and written."""
    step = _step_of_few(motion.histories.count)
    if step == 1:
        return motion
    return replace(
        motion,
        histories=motion.few or motion.histories.every(step),
        low_passed=None if motion.low_passed is None else motion.low_passed[::step],
        warnings=(*motion.warnings, _KEPT.format(step)),
    )


def _impacts_of(system: StructuralSystem, motion: _RunMotion, settings: ImpactSettings) -> ImpactRecord:
    if motion.trajectory is None:
        raise Stopped
    record = ImpactRecord(system, settings)
    record.add(motion.trajectory, motion.extremes["force"][2])
    return record


def _given_up(result: RunResult, figures: str) -> RunResult:
    """The result without figures whose computation was interrupted; an earlier outcome stays."""
    outcome = Outcome.of(OutcomeCode.INTERRUPTED, during=f"the {figures}") if result.complete else result.outcome
    return changed(result, outcome=outcome, warnings=(*result.warnings, f"interrupted: {figures} are missing"))


def _with_statistics(result: RunResult, system: StructuralSystem, stop: Callable[[], bool]) -> RunResult:
    """Add densities, statistics and transmissibilities; those of few samples also after a request to stop."""
    from beamsim.analyses.run.linear_prediction import linear_deviations
    from beamsim.analyses.run.random_response import random_response

    force = None if system.base_acceleration is not None else system.forcing.signal[0](result.time)
    stationary = result.scenario.excitation.kind == "random"
    try:
        with heeding(stop if rows_of(result, "time").size > SAMPLES_OF_A_STOPPED_RUN else never):
            predicted = linear_deviations(result.scenario, system)
            response = random_response(result, force, stationary=stationary, predicted=predicted)
            return changed(result, random=response)
    except Stopped:
        return _given_up(result, "densities and statistics")


def _with_shock_response(
    result: RunResult,
    system: StructuralSystem,
    motion: _RunMotion,
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


@dataclass(frozen=True)
class _RunMotion:
    """The motion at the output times, from the closed form or from time stepping."""

    method: str
    outcome: Outcome
    histories: Histories
    balance: EnergyBalance
    events: EventLog
    breakpoints: int  # of piecewise-linear springs that were passed, the start left out
    extremes: Extremes
    station_extremes: Callable[[], Extreme]  # of the stress at every station
    extreme_times: Floats  # (2,) of the lowest and highest point of the first probe
    extreme_states: Floats  # (2, 2n) there
    state_at: Callable[[float], Floats]  # (2n or more,) at a time; of a time-stepped motion at the nearest output time
    contact_share: Floats
    work: Work
    low_passed: Floats | None = None  # (nt, probes) acceleration behind the filter, where there is one
    trajectory: Trajectory | None = None  # of the closed form
    parts: Callable[[], Iterable[Trajectory]] = tuple  # the same, one after the other where it is not kept
    von_mises: Mapping[str, Floats] = field(default_factory=dict)  # (nx,) Pa, largest of the samples, by plate
    memory: Mapping[str, int] = field(default_factory=dict)  # entries of the summary
    few: Histories | None = None  # evenly spaced samples, where all take as long as the march
    few_inputs: StructuralSystem | None = None  # with inputs that are known at their times alone
    impacts: ImpactRecord | None = None  # of a motion that is not kept
    finer: Mapping[str, Floats] | None = None  # samples of a time-stepped motion, a whole number for each output time
    warnings: tuple[str, ...] = ()
    contact_events: ContactEvents | None = None

    def column(self, group: str, index: int) -> Floats:
        """(nt,) one output, computed when it is read."""
        return self.histories.history(lambda time, values: values[group][:, index])


def _checked(
    scenario: Scenario,
    system: StructuralSystem,
    motion: _RunMotion,
    figures: Mapping[str, Any],
    derived: DerivedFigures,
    stop: Callable[[], bool],
) -> Convergence | None:
    """What a finer model changes; None where that is not asked for, or the run is not complete."""
    settings = scenario.run
    assert settings is not None
    if settings.convergence == "off" or not motion.outcome.complete:
        return None

    def solve(finer: StructuralSystem) -> Solution:
        if finer.cubic.count:
            again = _reference(finer, settings, _output_times(settings), None, stop)
            check_stop()
            assert again.contact_events is not None
            sampled = OutputSamples(again.histories.time, again.histories.values)
            return Solution(finer, settings, _figures(finer, again), again.contact_events, sampled=sampled)
        seeds = np.concatenate([times for _, low, _, high in motion.extremes.values() for times in (low, high)])
        return solve_exactly(finer, settings, seeds, motion.work, stop)

    kept = {name: figures[name] for name in _figures(system, motion)}
    assert motion.contact_events is not None
    first = Solution(system, settings, kept, motion.contact_events, motion.trajectory)

    def disturbed(share: float, end: float) -> ContactEvents:
        again = march_again(_disturbed(system, share), settings, end, motion.work, stop)
        return ContactEvents.of(again, len(system.snubbers))

    try:
        with heeding(stop):
            check_stop()  # before a finer model is built
            return check_convergence(
                scenario, first, derived, None if isinstance(settings.start, OrbitStart) else solve,
                None if motion.trajectory is None else disturbed,
            )  # fmt: skip
    except Stopped:
        return Convergence({}, reason="interrupted")


def _disturbed(system: StructuralSystem, share: float) -> StructuralSystem:
    """The system with its stiffness changed by a share of itself."""
    dynamics = replace(system.dynamics, stiffness=(1.0 + share) * system.dynamics.stiffness)
    return replace(system, dynamics=dynamics)


def _steps_in_time(system: StructuralSystem, settings: Run) -> bool:
    return settings.method == "reference" or system.cubic.count > 0


def _output_times(settings: Run) -> OutputTimes:
    rate = settings.output_rate
    count = int(np.floor(settings.duration * rate * (1 + 1e-12))) + 1
    if count > MOST_SAMPLES:
        raise ScenarioError(
            Problem(
                "run.sample_rate",
                f"= {rate:g} Hz over run.duration = {settings.duration:g} s gives {count:.3g} samples "
                f"(at most {MOST_SAMPLES:.3g} are kept)",
                "lower one of the two; contacts and peaks are exact whatever the sample rate",
            )
        )
    return OutputTimes(rate, count)


def _most_events(flow: ExactFlow, settings: Run) -> tuple[int, str]:
    """How many events a motion may have, and the setting that limits them."""
    room = events_in_memory(flow, settings.memory)
    return min(settings.max_events, room), "run.max_events" if settings.max_events <= room else "run.memory"


def _exact(
    system: StructuralSystem,
    settings: Run,
    times: OutputTimes,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
) -> _RunMotion:
    flow = exact_flow(system, settings.duration, settings.most_contact_states, memory=settings.memory)
    most, limit = _most_events(flow, settings)
    trajectory = simulate(flow, system.initial_state, max_events=most, progress=progress, stop=stop)
    outcome, grace = _with_limit(trajectory.outcome, limit), Grace(stop)
    warnings: tuple[str, ...] = ()
    times = times if trajectory.outcome.complete else times.until(trajectory.end)
    groups = output_groups(system, flow)
    if stop():
        times, warnings = _few(times)
    histories = ExactHistories(trajectory, groups, times, grace)
    balance = EnergyBalance.unknown()
    searched = searched_outputs(system, flow, groups)
    low_passed = filtered_acceleration = None
    acceleration = searched.pop("acceleration") if settings.low_pass is not None else None
    try:
        with heeding(grace):
            check_stop()
            balance = energy_of_segments(trajectory)
            outcome = balance.checked(outcome)
            extremes = refine_extremes(trajectory, searched, np.linspace(0.0, trajectory.end, SEEDS))
            if system.energy_outputs:
                extremes["energy"] = energy_extremes(trajectory, system.energy_outputs, groups.groups["energy"])
            if acceleration is not None and settings.low_pass is not None:
                low_passed, filtered_acceleration = filtered(trajectory, acceleration, settings.low_pass, times.all)
    except Stopped:
        missing = "the energy balance, or peaks between the samples, are missing"
        if acceleration is not None:
            searched["acceleration"] = acceleration
            missing += "; accelerations are unfiltered"
        times, thinned = _few(times)
        warnings = (*warnings, *thinned, f"interrupted during the evaluation: {missing}")
        histories = ExactHistories(trajectory, groups, times, grace)
        if outcome.complete:
            outcome = Outcome.of(OutcomeCode.INTERRUPTED, during="the evaluation of the motion")
        extremes = histories.extremes(searched)
        if system.energy_outputs:
            energies = energies_of_rows(system.energy_outputs, histories.values["energy"])
            extremes["energy"] = sampled_extremes(histories.time, energies)
    if filtered_acceleration is not None:
        extremes["acceleration"] = filtered_acceleration
    whole = _exact_motion(system, settings, trajectory, histories, searched, extremes)
    return replace(
        whole,
        outcome=outcome,
        balance=balance,
        low_passed=low_passed,
        trajectory=None if outcome.interrupted else trajectory,
        parts=lambda: (trajectory,),
        warnings=warnings,
    )


def _exact_motion(
    system: StructuralSystem,
    settings: Run,
    motion: Trajectory | LongMotion,
    histories: ExactHistories,
    searched: Mapping[str, Any],
    extremes: Extremes,
) -> _RunMotion:
    """What a motion that is kept and one that is marched in stretches have in common."""
    times = np.array([extremes["displacement"][1][0], extremes["displacement"][3][0]])
    order = np.argsort(times)
    interrupted = isinstance(motion, LongMotion) and motion.outcome.interrupted  # samples are as dear as the march
    return _RunMotion(
        method="exact",
        outcome=motion.outcome,
        histories=histories,
        balance=EnergyBalance.unknown(),
        events=_events(system, motion),
        contact_events=ContactEvents.of(motion, len(system.snubbers)),
        breakpoints=_breakpoints(system, motion),
        extremes=extremes,
        station_extremes=lambda: histories.station_extremes(searched["stress"]),
        von_mises={} if interrupted else _von_mises(system, histories, searched),
        extreme_times=times,
        extreme_states=motion.states_at(times[order])[order],
        state_at=lambda time: motion.states_at(np.array([time]))[0],
        contact_share=motion.contact_share(),
        work=Work(
            events=motion.event_time.size,
            evaluations=motion.evaluations,
            segments=motion.segments,
            states=len(motion.flow.visited),
            processor_time_s=motion.processor_time_s,
        ),
        memory=_memory(motion.flow, settings),
    )


def _check_stretches(system: StructuralSystem, settings: Run) -> None:
    """Refuse what needs the whole motion, which does not fit into the memory."""
    needed = {
        "run.srs": settings.srs,
        "friction": friction_contacts(system).tolist() or None,
    }
    problems = [
        Problem(
            name,
            f"needs the whole motion in memory, and that does not fit into run.memory = {settings.memory:.3g} bytes",
            "raise run.memory, shorten run.duration, or leave it out",
        )
        for name, value in needed.items()
        if value is not None
    ]
    if problems:
        raise ScenarioError(problems)


def _long_flow(system: StructuralSystem, settings: Run) -> tuple[ExactFlow, int]:
    """The flow on the first pieces of a long input, and how many pieces are taken at once."""
    at_once = max(int(STRETCH_SHARE * settings.memory / BYTES_A_PIECE), CHECKPOINT_PIECES)
    pieces = (0, min(at_once, pieces_of(system)))
    most_states = settings.most_contact_states
    return exact_flow(system, settings.duration, most_states, memory=settings.memory, pieces=pieces), at_once


def _exact_in_stretches(
    system: StructuralSystem,
    settings: Run,
    times: OutputTimes,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
) -> _RunMotion:
    """A motion of more pieces of the input than fit into the memory."""
    flow, at_once = _long_flow(system, settings)
    most, limit = _most_events(flow, settings)
    motion = LongMotion(flow, system.initial_state, at_once, max_events=most, progress=progress, stop=stop)
    groups, grace = output_groups(system, flow), Grace(stop)
    searched = searched_outputs(system, flow, groups)
    low_passed = impacts = None
    if settings.low_pass is not None:
        low_passed = LowPassed(searched.pop("acceleration"), settings.low_pass, times, len(system.probes))
    if settings.impacts is not None:
        impacts = ImpactRecord(system, settings.impacts)
    inputs = [s for s in (system.base_acceleration, system.base_displacement, *system.forcing.signal) if s is not None]
    figures = figures_of_stretches(
        motion, searched, system.energy_outputs, groups, times, grace, inputs, low_passed, impacts
    )
    outcome = figures.balance.checked(_with_limit(motion.outcome, limit))
    times = times if motion.outcome.complete else times.until(motion.end)
    whole = ExactHistories(motion, groups, times, grace)
    last = None
    if not outcome.interrupted:
        last = motion.within(max(motion.end - _analysed(settings, motion), 0.0), motion.end)

    def of_stations() -> Extreme:
        """The extremes at every station; those of samples, but for the largest, after a request to stop."""
        if not outcome.interrupted:
            try:
                with heeding(grace):
                    return station_extremes(motion, searched["stress"])
            except Stopped:
                pass
        return figures.extremes["stress"]

    kept = f"the motion is kept {motion.stretch_s:.3g} s at a time (run.memory = {settings.memory:.3g} bytes)"
    if last is not None:
        kept += f"; spectra and rms_* are those of the last {motion.end - float(last.time[0]):.3g} s"
        if settings.convergence != "off":
            compared = _compared_s(settings, motion.record.step)
            kept += f", a finer model is compared on the first {compared:.3g} s"
    return replace(
        _exact_motion(system, settings, motion, whole, searched, figures.extremes),
        outcome=outcome,
        histories=figures.few if outcome.interrupted else whole,
        balance=figures.balance,
        station_extremes=of_stations,
        low_passed=_at_few(figures, times) if outcome.interrupted else figures.low_passed,
        trajectory=last,
        parts=motion.again,
        few=figures.few,
        few_inputs=_known_inputs(system, inputs, figures),
        impacts=impacts,
        warnings=(kept,),
    )


def _at_few(figures: StretchFigures, times: OutputTimes) -> Floats | None:
    """(nt, probes) accelerations behind the filter at the few times that are kept, nan where it was not reached."""
    if figures.low_passed is None:
        return None
    number = np.rint(figures.few.time * times.rate).astype(np.int64)
    out = np.full((number.size, figures.low_passed.shape[1]), np.nan)
    reached = number < figures.low_passed.shape[0]
    out[reached] = figures.low_passed[number[reached]]
    return out


def _known_inputs(system: StructuralSystem, inputs: Sequence[Signal], figures: StretchFigures) -> StructuralSystem:
    """The system with inputs of which the values at few times are known alone."""
    known = {
        id(signal): KnownValues(figures.few.time, values)
        for signal, values in zip(inputs, figures.signals, strict=True)
    }
    acceleration, displacement = (
        None if signal is None else known[id(signal)] for signal in (system.base_acceleration, system.base_displacement)
    )
    forcing = replace(system.forcing, signal=tuple(known[id(signal)] for signal in system.forcing.signal))
    return replace(system, base_acceleration=acceleration, base_displacement=displacement, forcing=forcing)


def _analysed(settings: Run, motion: LongMotion) -> float:
    """Length of the last part of the motion of which there are spectra, s."""
    room = SPECTRUM_SHARE * settings.memory / BYTES_A_PIECE * motion.record.step
    return min(room, settings.spectrum.last or room)


def _compared_s(settings: Run, step: float) -> float:
    """Length of the first part of the motion that is compared with that of a finer model, s."""
    return COMPARED_SHARE * settings.memory / BYTES_A_PIECE * step


def _checked_on_first_part(
    scenario: Scenario, system: StructuralSystem, motion: _RunMotion, stop: Callable[[], bool]
) -> Convergence | None:
    """What a finer model changes in the first part of a motion that is not kept as a whole, and when a disturbance
    changes the contacts of the whole."""
    settings, excitation = scenario.run, scenario.excitation
    assert settings is not None
    assert excitation.kind == "random"
    if settings.convergence == "off" or not motion.outcome.complete:
        return None
    if stop():
        return Convergence({}, reason="interrupted")
    assert motion.trajectory is not None
    step = float(np.median(np.diff(motion.trajectory.flow.sources.start)))
    duration = _compared_s(settings, step)
    same = excitation.model_copy(update={"period": excitation.period or settings.duration})
    first = scenario.model_copy(
        update={"excitation": same, "run": settings.model_copy(update={"duration": duration, "convergence": "on"})}
    )
    assert first.run is not None
    of_part = build_system(first)
    part = _exact(of_part, first.run, _output_times(first.run), None, stop)
    if not part.outcome.complete:
        return Convergence({}, reason="interrupted" if part.outcome.interrupted else part.outcome.text)
    try:
        with heeding(stop):
            spectra = _spectra(first, of_part, part)
    except Stopped:
        return Convergence({}, reason="interrupted")
    probes = {probe.name for probe in of_part.probes}
    of_probes = {key: spectra[key] for key in spectra if key[0] in probes}
    derived = DerivedFigures(first, of_probes, None, np.zeros(0), None)
    checked = _checked(first, of_part, part, _figures(of_part, part), derived, stop)
    if checked is None:
        return None
    assert motion.contact_events is not None

    def disturbed(share: float, end: float) -> ContactEvents:
        again = _disturbed(system, share)
        flow, at_once = _long_flow(again, settings)
        most = 4 * motion.work.events + 1000
        long = LongMotion(flow, again.initial_state, at_once, max_events=most, stop=stop)
        for stretch in long.stretches():
            check_stop()
            if stretch.end >= end:
                break
        return ContactEvents.of(long, len(again.snubbers)).until(min(end, long.end))

    known = static_figures(system)
    figures = {name: value for name, value in _figures(system, motion).items() if name not in known}
    try:
        with heeding(stop):
            whole = followed_to_the_end(checked, duration, motion.contact_events, disturbed, figures)
    except Stopped:
        return replace(checked, reason="interrupted")
    return replace(whole, lines={})


def _memory(flow: ExactFlow, settings: Run) -> dict[str, int]:
    """Bounds on the memory of a run, for the summary."""
    kept = {"contact_states_kept": len(flow.states)} if flow.dropped else {}
    return {"memory_bytes": round(settings.memory), **kept}


def _few(times: OutputTimes) -> tuple[OutputTimes, tuple[str, ...]]:
    """Of many output times those that are quickly sampled and written, with a warning."""
    step = _step_of_few(times.size)
    return times.every(step), (_KEPT.format(step),) if step > 1 else ()


def _step_of_few(count: int) -> int:
    return max(-(-count // SAMPLES_OF_A_STOPPED_RUN), 1)


def _reference(
    system: StructuralSystem,
    settings: Run,
    times: OutputTimes,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
) -> _RunMotion:
    """The same by time stepping; extremes on the integrator's dense output, contact from its located events."""
    from beamsim.analyses.run.stepped_outputs import SteppedOutputs
    from beamsim.flow.reference import integrate

    flow = exact_flow(system, settings.duration, settings.most_contact_states, memory=settings.memory)
    integrator, rtol = settings.integrator, settings.rtol
    warnings: tuple[str, ...] = ()
    longest = np.inf
    if settings.method != "reference":
        integrator, rtol = "DOP853", min(rtol, 1e-10)
        longest = _longest_step(system)
        warnings = (
            f"cubic springs have no closed-form motion: integrated by {integrator} with rtol = {rtol:g}; "
            "contacts are found by sign changes between steps, without certificate",
        )
    finer = finer_rate(system, settings.output_rate, times.all.size)
    outputs = SteppedOutputs(system, flow, times.all, 1.0 / (finer * settings.output_rate), settings.low_pass)
    trajectory = integrate(
        flow, system.initial_state, times.all, integrator=integrator, rtol=rtol, atol=settings.atol,
        max_step=longest, cubic=system.cubic, max_events=settings.max_events, progress=progress, stop=stop,
        observe=outputs.observe,
    )  # fmt: skip
    at = trajectory.time
    values = outputs.at(at, trajectory.y, trajectory.phases)
    stored = stored_energy(flow, trajectory.y, values["penetration"], trajectory.phases)
    if system.cubic.count:
        stored = stored + 0.25 * outputs.cubic_stretch(at, trajectory.y) ** 4 @ system.cubic.stiffness
    energy = EnergyHistory(trajectory.work_in, trajectory.dissipated, stored)
    exchanged = float(np.trapezoid(np.abs(trajectory.power_in), at))
    balance = EnergyBalance.of(at, energy, exchanged)
    extremes = outputs.extremes(trajectory)
    return _RunMotion(
        method=f"reference ({integrator}, rtol {rtol:g})",
        outcome=balance.checked(_with_limit(trajectory.outcome), "lower run.rtol and run.atol"),
        histories=SampledHistories(at, values, flow.system.contacts.touching(trajectory.phases), energy),
        balance=balance,
        events=_events(system, trajectory),
        contact_events=ContactEvents.of(trajectory, len(system.snubbers)),
        breakpoints=_breakpoints(system, trajectory),
        extremes=extremes,
        station_extremes=lambda: extremes["stress"],
        extreme_times=np.array([extremes["displacement"][1][0], extremes["displacement"][3][0]]),
        extreme_states=np.array([outputs.lowest_state, outputs.highest_state]),
        state_at=lambda time: trajectory.y[np.abs(at - time).argmin()],
        contact_share=trajectory.contact_share,
        work=Work(
            events=trajectory.event_time.size,
            evaluations=trajectory.evaluations,
            segments=trajectory.restarts,
            states=len(np.unique(trajectory.phases, axis=0)),
            processor_time_s=trajectory.processor_time_s,
        ),
        low_passed=None if outputs.low_passed is None else outputs.low_passed[: at.size],
        finer=outputs.finer(finer * at.size),
        warnings=warnings,
    )


def _pulls(system: StructuralSystem, motion: _RunMotion) -> list[str]:
    """A warning for each snubber whose dashpot pulls before the contact opens."""
    forces = motion.extremes["force"]
    pulls = largest_pulls(forces)
    return [
        f"snubbers.{s.name}: its dashpot pulls with up to {pulls[j]:.3g} N before the contact opens; law: no_tension "
        "opens it before"
        for j, s in enumerate(system.snubbers)
        if pulls[j] > SMALLEST_PULL * forces[2][j]
    ]


def _with_limit(outcome: Outcome, limit: str = "run.max_events") -> Outcome:
    """The outcome, with the key of the scenario that limits the events."""
    return outcome.but(limit=limit) if outcome.code is OutcomeCode.EVENT_LIMIT else outcome


def _longest_step(system: StructuralSystem) -> float:
    """A step so short that it rarely contains a whole contact: a fraction of the shortest period, contacts closed."""
    c = system.dynamics.contacts
    if c.count == 0:
        return np.inf
    fastest = system.dynamics.stiffness.max() + np.abs(c.arrays.force[:, :, 0]).max(axis=1) @ (c.shape**2).sum(axis=1)
    return float(2 * np.pi / np.sqrt(fastest) / STEPS_A_PERIOD) if fastest > 0 else np.inf


def _von_mises(system: StructuralSystem, histories: ExactHistories, searched: Mapping[str, Any]) -> dict[str, Floats]:
    """(nx,) largest von Mises stress at the surface of every plate at its stations, of the samples, Pa."""
    plates = {body.body for body in system.bodies if body.moments == COMPONENTS}
    stress = system.stress
    if stress is None or not plates:
        return {}
    parts = {
        part.body if len(stress.stations.parts) > 1 else stress.bodies[0]: part.stations for part in stress.stations
    }
    return {name: histories.von_mises(searched["stress"], parts[name]) for name in plates & set(parts)}


def _signal(signal: Callable[[Floats], Floats] | None, times: Floats) -> Floats:
    return np.zeros(times.size) if signal is None else signal(times)


def _probes(system: StructuralSystem, motion: _RunMotion) -> dict[str, ProbeHistory]:
    def absolute(i: int, time: Floats, values: Mapping[str, Floats]) -> Floats:
        carried = system.carried[i] * _signal(system.base_displacement, time)
        return np.asarray(values["displacement"][:, i] + carried)

    return {
        probe.name: ProbeHistory(
            name=probe.name,
            position=probe.position,
            across=probe.across,
            displacement=motion.column("displacement", i),
            absolute_displacement=motion.histories.history(partial(absolute, i)),
            velocity=motion.column("velocity", i),
            absolute_acceleration=motion.column("acceleration", i),
            low_passed_acceleration=None
            if motion.low_passed is None
            else motion.histories.kept(motion.low_passed[:, i]),
        )
        for i, probe in enumerate(system.probes)
    }


def _snubbers(system: StructuralSystem, motion: _RunMotion) -> dict[str, SnubberHistory]:
    return {
        s.name: SnubberHistory(
            name=s.name,
            position=s.position,
            across=s.across,
            side=s.side,
            stiffness=s.stiffness,
            dashpot=s.dashpot,
            gap=s.gap,
            preload=s.preload,
            blocked_force=s.blocked_force,
            stiffness_ratio=s.stiffness_ratio,
            table_misfit=s.table_misfit,
            force=motion.column("force", j),
            penetration=motion.column("penetration", j),
            closed=motion.histories.closed(j),
            displacement=motion.column("snubber_displacement", j),
            velocity=motion.column("snubber_velocity", j),
        )
        for j, s in enumerate(system.snubbers)
    }


def _springs(system: StructuralSystem, motion: _RunMotion) -> dict[str, SpringHistory]:
    def force(i: int, time: Floats, values: Mapping[str, Floats]) -> Floats:
        if "spring_force" in values:
            return values["spring_force"][:, i]
        return system.springs[i].force(values["stretch"][:, i])

    return {
        s.name: SpringHistory(
            s.name, s.kind, s.masses, motion.column("stretch", i), motion.histories.history(partial(force, i))
        )
        for i, s in enumerate(system.springs)
        if s.kind != FRICTION
    }


def _friction(scenario: Scenario, system: StructuralSystem, motion: _RunMotion) -> dict[str, FrictionHistory]:
    contacts, number = scenario.friction, friction_contacts(system)
    columns = [i for i, spring in enumerate(system.springs) if spring.kind == FRICTION]
    figures: list[dict[str, Any]] = [{} for _ in contacts]
    if contacts and motion.trajectory is not None:
        figures = sliding_figures(system, motion.trajectory, contacts)
    return {
        c.name: FrictionHistory(
            name=c.name,
            normal_force=c.normal_force,
            static_force=c.static_force,
            sliding_force=c.sliding_force,
            stiffness=c.stiffness or np.inf,
            start_force=c.start_force,
            displacement=motion.column("stretch", i),
            force=motion.column("spring_force", i),
            stuck=motion.histories.closed(int(j)),
            sliding_share=1.0 - float(motion.contact_share[j]),
            **of_contact,
        )
        for c, i, j, of_contact in zip(contacts, columns, number, figures, strict=True)
    }


def _contact(system: StructuralSystem, motion: _RunMotion) -> ContactInstant | None:
    """The motion when a contact force is largest, for the sketch of several bodies; None without contact."""
    forces, times = motion.extremes["force"][2:]
    if len(system.bodies) < 2 or not system.snubbers or not forces[: len(system.snubbers)].max() > 0.0:
        return None
    at = int(forces[: len(system.snubbers)].argmax())
    coordinates = motion.state_at(float(times[at]))[: system.dynamics.size]
    return ContactInstant(float(times[at]), system.snubbers[at].name, float(forces[at]), coordinates)


def _outputs(system: StructuralSystem, motion: _RunMotion) -> dict[str, OutputHistory]:
    """The outputs that the run asks for, in its order."""
    number = {output.name: i for i, output in enumerate(system.linear_outputs)}
    energies = {output.name: i for i, output in enumerate(system.energy_outputs)}

    def energy(i: int, time: Floats, values: Mapping[str, Floats]) -> Floats:
        return energies_of_rows(system.energy_outputs, values["energy"])[:, i]

    return {
        output.name: OutputHistory(
            output.name, output.kind, output.unit, output.at,
            motion.histories.history(partial(energy, energies[output.name]))
            if output.squared
            else motion.column("output", number[output.name]),
        )
        for output in system.outputs
    }  # fmt: skip


def _events(system: StructuralSystem, trajectory: Trajectory | LongMotion | ReferenceTrajectory) -> EventLog:
    """Contacts of the snubbers made and ended, without breakpoints of their tables; contacts with higher numbers are
    piecewise-linear springs."""
    of_snubber = (trajectory.event_contact < len(system.snubbers)) & (trajectory.touch_changes != 0)
    times, snubbers, closing = trajectory.event_time, trajectory.event_contact, trajectory.event_closing
    return EventLog(times[of_snubber], snubbers[of_snubber], closing[of_snubber])


def _breakpoints(system: StructuralSystem, trajectory: Trajectory | LongMotion | ReferenceTrajectory) -> int:
    rubbing = np.isin(trajectory.event_contact, friction_contacts(system))
    of_spring = (trajectory.event_contact >= len(system.snubbers)) & ~rubbing
    return int(np.sum(of_spring & (trajectory.event_time > 0)))


def _bodies(scenario: Scenario, system: StructuralSystem, motion: _RunMotion) -> dict[str, Any]:
    """Results along each body that has a continuous axis, as fields of the result."""
    stress = {} if system.stress is None else {part.body: part.stations for part in system.stress.stations}

    def peaks(of_body: slice, moments: int) -> Floats:
        return np.asarray(largest(motion.station_extremes())[of_body].reshape(moments, -1).max(axis=0))

    equilibrium = system.static_equilibrium
    bodies = {
        body.body: BodyResult(
            position=body.position,
            across=body.across,
            peak_bending_stress=later(partial(peaks, stress[body.body], body.moments)) if body.body in stress else None,
            peak_von_mises_stress=motion.von_mises.get(body.body),
            extreme_shapes=motion.extreme_states[:, : system.dynamics.size] @ body.deflection.T,
            extreme_times=motion.extreme_times,
            static_shape=np.full(body.position.size, np.nan) if equilibrium is None else body.deflection @ equilibrium,
        )
        for body in system.bodies
        if body.axis.continuous
    }
    if len(scenario.all_bodies) == 1 and set(bodies) <= {ONLY_BEAM}:
        return {"only_body": bodies.get(ONLY_BEAM)}
    return {"only_body": None, "named_bodies": bodies}


def _spectra(scenario: Scenario, system: StructuralSystem, motion: _RunMotion) -> dict[tuple[str, str], Spectrum]:
    if motion.trajectory is None or motion.trajectory.end <= 0.0:
        return spectra_of_samples(scenario, system, motion.histories.time, motion.histories.values, motion.finer)
    groups = output_groups(system, motion.trajectory.flow).groups
    outputs = OutputSet({name: groups[name] for name in SPECTRAL_GROUPS if name in groups})
    return spectra_of_motion(scenario, system, motion.trajectory, outputs)


def _figures(system: StructuralSystem, motion: _RunMotion) -> dict[str, Any]:
    closings = np.bincount(motion.events.snubber[motion.events.closing], minlength=len(system.snubbers))
    return {
        **motion_figures(
            system, motion.extremes, motion.contact_share, closings, deflection_size(system, motion.extreme_states)
        ),
        **static_figures(system),
    }


def _gapping(
    scenario: Scenario, system: StructuralSystem, motion: _RunMotion, summary: Mapping[str, Any]
) -> dict[str, Any]:
    """Of a sine, the level that changes contact at its frequency, and when this run changed it, for the summary."""
    excitation = scenario.excitation
    if system.sine is None or not system.snubbers or system.cubic.count:
        return {}
    assert isinstance(excitation, Harmonic | Forces)
    frequency = np.array([excitation.frequency])
    levels = contact_levels(system, frequency)
    if not levels:
        return {}
    omega = 2.0 * np.pi * excitation.frequency
    power = INTEGRALS.get(excitation.quantity or "", 0)
    of_snubber = gapping(levels, frequency, np.array([abs(excitation.level) * omega**power]))
    names = [snubber.name for snubber in system.snubbers]
    for name, of in of_snubber.items():
        times = motion.events.time[motion.events.snubber == names.index(name)]
        of["first_change_s"] = float(times[0]) if times.size else None
        of["largest_gap_m"] = summary["largest_gap_m"][name]
    return {"gapping": of_snubber}


def _spectral_lines(spectra: Mapping[tuple[str, str], Spectrum]) -> list[dict[str, Any]]:
    """The lines of all spectra, for the summary."""
    columns = ("order", "frequency_hz", "amplitude", "amplitude_db", "kind", "relative_change")
    return [
        {"probe": s.probe, "quantity": s.quantity, **{name: getattr(line, name) for name in columns}}
        for s in spectra.values()
        for line in s.lines
    ]


def _summary(
    scenario: Scenario, system: StructuralSystem, motion: _RunMotion, spectra: dict[tuple[str, str], Spectrum]
) -> dict[str, Any]:
    """What does not repeat a field of the result."""
    probes = [p.name for p in system.probes]
    summary: dict[str, Any] = {
        "rms_displacement_m": by_name(probes, np.array([spectra[p, "displacement"].rms for p in probes])),
        "rms_acceleration_g": by_name(
            probes, np.array([spectra[p, MAIN_QUANTITY].rms for p in probes]) / STANDARD_GRAVITY
        ),
        **_figures(system, motion),
        "events": int(motion.events.time.size),
        "linear": motion.work.events == 0 and system.cubic.count == 0,
        "energy_error": motion.balance.error,
        **motion.memory,
        "blocked_force_n": {s.name: s.blocked_force for s in system.snubbers},
        "stiffness_ratio": {s.name: s.stiffness_ratio for s in system.snubbers},
    }
    if system.outputs:
        summary["rms_output"] = {o.name: spectra[o.name, o.kind].rms for o in system.linear_outputs}
        summary["output_unit"] = {output.name: output.unit for output in system.outputs}
    if system.base_correction is not None:
        summary |= system.base_correction.summary()
    if any(spring.kind != FRICTION for spring in system.springs):
        summary["breakpoints_passed"] = motion.breakpoints
    if system.stress is not None:
        where = int(largest(motion.extremes["stress"]).argmax())
        summary["largest_bending_stress_position_m"] = float(system.stress.stations.position[where])
        if system.stress.stations.across is not None:
            summary["largest_bending_stress_across_m"] = float(system.stress.stations.across[where])
        if motion.von_mises:
            summary["largest_von_mises_stress_pa"] = max(float(peaks.max()) for peaks in motion.von_mises.values())
        if len(system.bodies) > 1:
            summary["largest_bending_stress_body"] = system.stress.bodies[where]
    summary |= _gapping(scenario, system, motion, summary)
    compared = margins(scenario.limits, summary)
    return {**summary, "margins": compared} if compared else summary
