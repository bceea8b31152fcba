"""The motion of a long run under random input: stretch by stretch, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.run.convergence import Convergence, followed_to_the_end
from beamsim.analyses.run.derived import DerivedFigures
from beamsim.analyses.run.exact_motion import exact_motion, exact_motion_of, most_events
from beamsim.analyses.run.figures import Extreme, static_figures
from beamsim.analyses.run.friction import friction_contacts
from beamsim.analyses.run.histories import ExactHistories, Grace
from beamsim.analyses.run.impacts import ImpactRecord
from beamsim.analyses.run.model_check import convergence_of, disturbed_system
from beamsim.analyses.run.motion import RunMotion, output_times, spectra_of, with_limit
from beamsim.analyses.run.output_times import OutputTimes
from beamsim.analyses.run.outputs import exact_flow, output_groups, pieces_of, searched_outputs
from beamsim.analyses.run.parting import ContactEvents
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
from beamsim.analyses.run.summary import figures_of_motion
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.long_motion import CHECKPOINT_PIECES, LongMotion
from beamsim.flow.stopping import Stopped, check_stop, heeding
from beamsim.inputs.streamed import KnownValues
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.flow.exact import ExactFlow
    from beamsim.inputs.signal import Signal
    from beamsim.scenario import Run, Scenario
    from beamsim.system.shared import SharedBuilds


def check_stretches(system: StructuralSystem, settings: Run) -> None:
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


def long_motion_of(
    system: StructuralSystem,
    settings: Run,
    times: OutputTimes,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
) -> RunMotion:
    """A motion of more pieces of the input than fit into the memory."""
    flow, at_once = _long_flow(system, settings)
    most, limit = most_events(flow, settings)
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
    outcome = figures.balance.checked(with_limit(motion.outcome, limit))
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
        exact_motion(system, settings, motion, whole, searched, figures.extremes),
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


def checked_on_first_part(
    scenario: Scenario, system: StructuralSystem, motion: RunMotion, shared: SharedBuilds, stop: Callable[[], bool]
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
    of_part = build_system(first, shared, assessed=False)
    part = exact_motion_of(of_part, first.run, output_times(first.run), None, stop)
    if not part.outcome.complete:
        return Convergence({}, reason="interrupted" if part.outcome.interrupted else part.outcome.text)
    try:
        with heeding(stop):
            spectra = spectra_of(first, of_part, part)
    except Stopped:
        return Convergence({}, reason="interrupted")
    probes = {probe.name for probe in of_part.probes}
    of_probes = {key: spectra[key] for key in spectra if key[0] in probes}
    derived = DerivedFigures(first, of_probes, None, np.zeros(0), None)
    checked = convergence_of(first, of_part, part, figures_of_motion(of_part, part), derived, shared, stop)
    if checked is None:
        return None
    assert motion.contact_events is not None

    def disturbed(share: float, end: float) -> ContactEvents:
        again = disturbed_system(system, share)
        flow, at_once = _long_flow(again, settings)
        most = 4 * motion.work.events + 1000
        long = LongMotion(flow, again.initial_state, at_once, max_events=most, stop=stop)
        for stretch in long.stretches():
            check_stop()
            if stretch.end >= end:
                break
        return ContactEvents.of(long, len(again.snubbers)).until(min(end, long.end))

    known = static_figures(system)
    figures = {name: value for name, value in figures_of_motion(system, motion).items() if name not in known}
    try:
        with heeding(stop):
            whole = followed_to_the_end(checked, duration, motion.contact_events, disturbed, figures)
    except Stopped:
        return replace(checked, reason="interrupted")
    return replace(whole, lines={})
