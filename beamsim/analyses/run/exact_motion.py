"""The motion of a run in closed form, marched and evaluated stretch by stretch."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from beamsim.analyses.run.friction import friction_contacts
from beamsim.analyses.run.histories import COMPONENTS, histories_of, largest_von_mises, reached
from beamsim.analyses.run.motion import RunMotion, breakpoints, events_of, memory_of, with_limit
from beamsim.analyses.run.outputs import MOTION_SHARE, events_in_memory, exact_flow, pieces_of
from beamsim.analyses.run.result import Work
from beamsim.analyses.run.stretches import StretchFigures
from beamsim.analyses.values import DISPLACEMENT, STRESS
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.channels import Observed
from beamsim.flow.stretches import CHECKPOINT_PIECES, MotionInStretches
from beamsim.flow.trajectory import Trajectory
from beamsim.scenario import Run
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

BYTES_A_PIECE = 2000  # that a motion which is kept needs for each piece of its input
STRETCH_SHARE = 0.064  # of the memory, for the pieces of a stretch
COMPARED_SHARE = 0.2  # for those of the first part, which is compared with that of a finer model
SPECTRUM_SHARE = 0.25  # for those of the last part, of which there are spectra


def motion_in_stretches(
    system: StructuralSystem,
    settings: Run,
    *,
    most_events: int | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool],
) -> tuple[MotionInStretches, str]:
    """The motion of a run, to be marched, and the setting that limits its events.

    It is one stretch where its input has no more pieces than the motion between them has room for in the memory.

    Parameters
    ----------
    system, settings : of the run.
    most_events : by default as many as the settings allow and the memory has room for.
    progress, stop : see `beamsim.flow.transient.simulate`.
    """
    pieces, at_once = pieces_of(system), None
    if pieces * BYTES_A_PIECE > MOTION_SHARE * settings.memory:
        at_once = max(int(STRETCH_SHARE * settings.memory / BYTES_A_PIECE), CHECKPOINT_PIECES)
    flow = exact_flow(
        system, settings.duration, settings.most_contact_states, settings.memory,
        None if at_once is None else (0, min(at_once, pieces)),
    )  # fmt: skip
    room = events_in_memory(flow, settings.memory)
    most = min(settings.max_events, room) if most_events is None else most_events
    motion = MotionInStretches(flow, system.initial_state, at_once, max_events=most, progress=progress, stop=stop)
    return motion, "run.max_events" if settings.max_events <= room else "run.memory"


def _refuse_what_needs_all(system: StructuralSystem, settings: Run) -> None:
    """Refuse what needs the whole motion, which does not fit into the memory."""
    needed = {"run.srs": settings.srs is not None, "friction": friction_contacts(system).size > 0}
    problems = [
        Problem(
            name,
            f"needs the whole motion in memory, and that does not fit into run.memory = {settings.memory:.3g} bytes",
            "raise run.memory, shorten run.duration, or leave it out",
        )
        for name, asked in needed.items()
        if asked
    ]
    if problems:
        raise ScenarioError(problems)


def exact_motion_of(
    system: StructuralSystem,
    settings: Run,
    times: Floats,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
) -> RunMotion:
    """The motion in closed form, with its figures, evaluated and forgotten stretch by stretch.

    Parameters
    ----------
    system, settings : of the run.
    times : (nt,) s, at which it is asked for.
    progress, stop : see `beamsim.flow.transient.simulate`.

    Raises
    ------
    ScenarioError
        Where something is asked for that needs the whole motion, which does not fit into the memory.
    """
    motion, limit = motion_in_stretches(system, settings, progress=progress, stop=stop)
    if not motion.one_stretch:
        _refuse_what_needs_all(system, settings)
    figures = StretchFigures.of_run(system, settings, motion.flow, times)
    for stretch in motion.stretches():
        figures.add(stretch)
    balance = figures.balance.result()
    extremes = figures.extremes
    of_first_probe = np.array([extremes[DISPLACEMENT][k][0] for k in (1, 3)])
    order = np.argsort(of_first_probe)
    return RunMotion(
        method="exact",
        outcome=balance.checked(with_limit(motion.outcome, limit)),
        sampled=lambda: histories_of(motion, system.channels.without(STRESS), times),
        balance=balance,
        events=events_of(system, motion),
        marched=motion,
        breakpoints=breakpoints(system, motion),
        extremes=extremes,
        extreme_times=of_first_probe,
        extreme_states=motion.states_at(of_first_probe[order])[order],
        state_at=lambda time: motion.states_at(np.array([time]))[0],
        contact_share=motion.contact_share(),
        work=Work(
            events=motion.event_time.size,
            evaluations=motion.evaluations,
            segments=motion.segments,
            states=len(motion.flow.visited),
            processor_time_s=motion.processor_time_s,
        ),
        low_passed=None if figures.low_passed is None else figures.low_passed.reached,
        trajectory=_analysed(motion, settings),
        parts=motion.again,
        von_mises=partial(_von_mises, system, motion, times),
        impacts=figures.impacts,
        memory=memory_of(motion.flow, settings),
        compared_s=None if motion.one_stretch else COMPARED_SHARE * _kept_s(motion, settings),
        warnings=() if motion.one_stretch else (_forgotten(motion, settings),),
    )


def _kept_s(motion: MotionInStretches, settings: Run) -> float:
    """Length of a motion under this input that would fit into the memory, s."""
    assert motion.flow.record is not None
    return settings.memory / BYTES_A_PIECE * motion.flow.record.step


def _analysed(motion: MotionInStretches, settings: Run) -> Trajectory:
    """The last part of the motion, of which there are spectra; all of one stretch."""
    if motion.one_stretch:
        return motion.within(0.0, motion.end)
    room = SPECTRUM_SHARE * _kept_s(motion, settings)
    return motion.within(max(motion.end - min(room, settings.spectrum.last or room), 0.0), motion.end)


def _forgotten(motion: MotionInStretches, settings: Run) -> str:
    """What becomes of a motion that does not fit into the memory."""
    kept = f"the motion is kept {motion.stretch_s:.3g} s at a time (run.memory = {settings.memory:.3g} bytes)"
    if motion.outcome.interrupted:
        return kept
    last = motion.end - float(_analysed(motion, settings).time[0])
    kept += f"; spectra and rms_* are those of the last {last:.3g} s"
    if settings.convergence != "off":
        compared = COMPARED_SHARE * _kept_s(motion, settings)
        kept += f", a finer model is compared on the first {compared:.3g} s"
    return kept


def _von_mises(system: StructuralSystem, motion: MotionInStretches, times: Floats) -> dict[str, Floats]:
    """(nx,) largest von Mises stress at the surface of every plate at its stations, of the samples, Pa."""
    plates = {body.body for body in system.bodies if body.moments == COMPONENTS}
    stress = system.stress
    if stress is None or not plates:
        return {}
    observed, times = Observed(motion.flow, system.channels.of_keys(STRESS)), reached(motion, times)
    parts = {
        part.body if len(stress.stations.parts) > 1 else stress.bodies[0]: part.stations for part in stress.stations
    }
    return {name: largest_von_mises(motion, times, observed, parts[name]) for name in plates & set(parts)}
