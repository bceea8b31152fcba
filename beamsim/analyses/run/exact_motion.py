"""The motion of a run in closed form, kept as a whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.run.energy import EnergyBalance, energy_of_segments
from beamsim.analyses.run.figures import (
    Extremes,
    energy_extremes,
    sampled_extremes,
    searched_extremes,
)
from beamsim.analyses.run.filtered_motion import filtered
from beamsim.analyses.run.histories import COMPONENTS, ExactHistories, Grace
from beamsim.analyses.run.motion import RunMotion, breakpoints, events_of, few_times, memory_of, with_limit
from beamsim.analyses.run.output_times import OutputTimes
from beamsim.analyses.run.outputs import energies_of_rows, events_in_memory, exact_flow, output_groups, searched_outputs
from beamsim.analyses.run.parting import ContactEvents
from beamsim.analyses.run.result import Work
from beamsim.flow.long_motion import LongMotion
from beamsim.flow.stopping import Stopped, check_stop, heeding
from beamsim.flow.transient import simulate
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.flow.exact import ExactFlow
    from beamsim.flow.trajectory import Trajectory
    from beamsim.scenario import Run


def most_events(flow: ExactFlow, settings: Run) -> tuple[int, str]:
    """How many events a motion may have, and the setting that limits them."""
    room = events_in_memory(flow, settings.memory)
    return min(settings.max_events, room), "run.max_events" if settings.max_events <= room else "run.memory"


def exact_motion_of(
    system: StructuralSystem,
    settings: Run,
    times: OutputTimes,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
) -> RunMotion:
    """The motion in closed form, with its figures."""
    flow = exact_flow(system, settings.duration, settings.most_contact_states, memory=settings.memory)
    most, limit = most_events(flow, settings)
    trajectory = simulate(flow, system.initial_state, max_events=most, progress=progress, stop=stop)
    outcome, grace = with_limit(trajectory.outcome, limit), Grace(stop)
    warnings: tuple[str, ...] = ()
    times = times if trajectory.outcome.complete else times.until(trajectory.end)
    groups = output_groups(system, flow)
    if stop():
        times, warnings = few_times(times)
    histories = ExactHistories(trajectory, groups, times, grace)
    balance = EnergyBalance.unknown()
    searched = searched_outputs(system, flow, groups)
    behind = low_passed = None
    acceleration = searched.pop("acceleration") if settings.low_pass is not None else None
    try:
        with heeding(grace):
            check_stop()
            balance = energy_of_segments(trajectory)
            outcome = balance.checked(outcome)
            extremes = searched_extremes(trajectory, searched)
            if system.energy_outputs:
                of_rows = groups.groups["energy"]
                extremes["energy"] = energy_extremes(trajectory, system.energy_outputs, of_rows)
            if acceleration is not None and settings.low_pass is not None:
                behind = filtered(trajectory, acceleration, settings.low_pass, times.all)
                low_passed, extremes["acceleration"] = behind.at(times.all), behind.extremes(0.0, trajectory.end)
    except Stopped:
        missing = "the energy balance, or peaks between the samples, are missing"
        if acceleration is not None:
            searched["acceleration"], behind, low_passed = acceleration, None, None
            missing += "; accelerations are unfiltered"
        times, thinned = few_times(times)
        warnings = (*warnings, *thinned, f"interrupted during the evaluation: {missing}")
        histories = ExactHistories(trajectory, groups, times, grace)
        if outcome.complete:
            outcome = Outcome.of(OutcomeCode.INTERRUPTED, during="the evaluation of the motion")
        extremes = histories.extremes(searched)
        if system.energy_outputs:
            energies = energies_of_rows(system.energy_outputs, histories.values["energy"])
            extremes["energy"] = sampled_extremes(histories.time, energies)
    whole = exact_motion(system, settings, trajectory, histories, searched, extremes)
    return replace(
        whole,
        outcome=outcome,
        balance=balance,
        low_passed=low_passed,
        filtered=behind,
        trajectory=None if outcome.interrupted else trajectory,
        parts=lambda: (trajectory,),
        warnings=warnings,
    )


def exact_motion(
    system: StructuralSystem,
    settings: Run,
    motion: Trajectory | LongMotion,
    histories: ExactHistories,
    searched: Mapping[str, Any],
    extremes: Extremes,
) -> RunMotion:
    """What a motion that is kept and one that is marched in stretches have in common."""
    times = np.array([extremes["displacement"][1][0], extremes["displacement"][3][0]])
    order = np.argsort(times)
    interrupted = isinstance(motion, LongMotion) and motion.outcome.interrupted  # samples are as dear as the march
    return RunMotion(
        method="exact",
        outcome=motion.outcome,
        histories=histories,
        balance=EnergyBalance.unknown(),
        events=events_of(system, motion),
        contact_events=ContactEvents.of(motion, len(system.snubbers)),
        breakpoints=breakpoints(system, motion),
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
        memory=memory_of(motion.flow, settings),
    )


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
