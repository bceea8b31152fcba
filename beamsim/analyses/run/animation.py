"""Animation of a few periods of a run around its largest contact force.

The motion is computed again from the scenario, up to the last frame; the result is the same.
"""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.analysis import built_at_orbit, motion_of
from beamsim.analyses.run.motion import Needed
from beamsim.analyses.run.result import RunResult
from beamsim.flow.reference import ReferenceTrajectory
from beamsim.outcomes import Progress, never
from beamsim.responses.frames import CYCLES_SHOWN, MARGIN, Frames, frame_times, frames_at
from beamsim.responses.histories import between_samples
from beamsim.results.values import FORCE, OPENING
from beamsim.scenario.run import OrbitStart
from beamsim.system.build import build_system
from beamsim.system.reduced_model import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Bools, Floats, not_none, of_kind


def frames_of_run(result: RunResult, progress: Progress = None, model: StructuralSystem | None = None) -> Frames:
    """Frames of a few periods around the largest contact force of a run; of its last periods if there is no contact.

    Parameters
    ----------
    result : result of the run.
    progress : called with the completed fraction of the motion.
    model : system of the result's scenario, if it is already built.

    Returns
    -------
    Frames
        Frames up to the end of the motion.

    Raises
    ------
    ScenarioError
        If the model can no longer be built, or its input has too many pieces.
    """
    settings, system = not_none(result.scenario.run), model
    if isinstance(settings.start, OrbitStart):
        shared = SharedBuilds() if model is None else model.model.builds
        _, system = built_at_orbit(result.scenario, shared)
    system = system or build_system(result.scenario)
    times, slow = instants(result)
    until = {"duration": max(float(times[-1]), 1e-9), "low_pass": None, "srs": None}
    asked = Needed(state_times=between_samples(times))
    motion = motion_of(system, settings.model_copy(update=until), times, progress, never, asked)
    known, states, between = not_none(motion.histories), motion.states, None
    times, slow = known.time, slow[: known.time.size]
    if states is None:  # a time-stepped motion has states only at the frames
        q = of_kind(ReferenceTrajectory, motion.source_motion).y[:, : system.dynamics.size]
    else:
        q, between = (states[first : 2 * times.size - 1 : 2, : system.dynamics.size] for first in (0, 1))
    none = np.zeros((times.size, 0))
    forces, openings = (known.of(key) if system.snubbers else none for key in (FORCE, OPENING))
    return frames_at(system, (times, slow), q, forces, openings, between)


def instants(result: RunResult) -> tuple[Floats, Bools]:
    """Instants (nf,) of the frames, and True for those in slow motion; see `frames_of_run`."""
    time = result["histories"]["time"].values
    begin, end = float(time[0]), float(time[-1])
    frequencies = [result.scenario.excitation.tone_hz, *result["modes"]["open_frequencies_hz"].values]
    period = 1.0 / next((f for f in frequencies if np.isfinite(f) and f > 0.0), 1.0 / max(end - begin, 1e-9))
    peaks = [(float(force.max(initial=0.0)), float(time[force.argmax()])) for force in _forces(result) if force.size]
    force, at = max(peaks, default=(0.0, end))
    centre = at if force > 0.0 else end
    length = min(CYCLES_SHOWN * period, end - begin)  # period of the excitation or of the first mode
    first = min(max(centre - length / 2, begin), end - length)
    at_events, snubber, closing = (result["events"][name].values for name in ("time", "snubber", "closing"))
    intervals = []
    for number in range(len(result["histories"].labels("snubber"))):
        mine = snubber == number
        intervals += list(_contacts(at_events[mine], closing[mine], begin, end))
    # for a long contact, only its beginning and end are shown in slow motion
    shown = [
        each
        for start, stop in intervals
        if stop > first and start < first + length
        for each in ([(start, stop)] if stop - start < 0.25 * period else [(start, start), (stop, stop)])
    ]
    times, slow = frame_times(first, first + length, shown, MARGIN * period)
    if force > 0.0:
        times[np.abs(times - at).argmin()] = at  # include the instant of the peak
    return times, slow


def _forces(result: RunResult) -> list[Floats]:
    return [force.values for force in result["histories"].by_label("snubber_force").values()]


def _contacts(time: Floats, closing: Bools, begin: float, end: float) -> list[tuple[float, float]]:
    """Intervals of contact from the events of one stop."""
    if not time.size:
        return []
    starts = [*([] if closing[0] else [begin]), *time[closing].tolist()]
    stops = [*time[~closing].tolist(), *([end] if closing[-1] else [])]
    return list(zip(starts, stops, strict=True))
