"""Animation of the highest peak of a sweep; the sweep is computed again up to that peak."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamsim.analyses.sweep.analysis import sweep_settings, swept_scenario
from beamsim.analyses.sweep.outputs import SweepLevel
from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.analyses.sweep.stepped import loads_at, steady_at, stepper_of, steps_of
from beamsim.analyses.sweep.swept_sine import swept_march
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import Progress, report_progress
from beamsim.responses.frames import CYCLES_SHOWN, Frames, between_frames, frames_at, paced_by_contact
from beamsim.scenario.sweep import SweptSine
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

SAMPLES = 1200  # of the shown cycles, for the states of the contacts


def frames_of_sweep(result: SweepResult, progress: Progress = None) -> Frames | None:
    """Frames of three cycles at the largest displacement of all probes, levels and directions.

    Parameters
    ----------
    result : result of a swept or stepped sine; for a steady motion, whole periods are shown.
    progress : called with the completed fraction of the sweep.

    Returns
    -------
    Frames or None
        None if no curve was computed.

    Raises
    ------
    ScenarioError
        If the model can no longer be built.
    """
    settings = sweep_settings(result.scenario)
    if not result.curves:
        return None
    system = build_system(swept_scenario(result.scenario))
    curve = max(result.curves.values(), key=lambda each: float(np.max(_response(each))))
    cycle = int(np.argmax(_response(curve)))
    level = SweepLevel(system, settings, curve.level, curve.level_index)
    if isinstance(settings, SweptSine):
        begin = float(curve.time[max(cycle - 1, 0)])
        sampled = _swept(level, curve, (begin, begin + CYCLES_SHOWN / float(curve.frequency_hz[cycle])), progress)
    else:
        f = float(curve.frequency_hz[cycle])
        sampled = _steady_motion(level, curve.direction, f, progress)
        system = replace(system, forcing=loads_at(level, f))  # imposed support motion follows the forcing
    times = np.linspace(*sampled.span, SAMPLES)
    instants = paced_by_contact(times, sampled.at(times)[1])
    return frames_at(system, instants, *sampled.at(instants[0]), sampled.at(between_frames(instants[0]))[0])


@dataclass(frozen=True)
class _MotionExcerpt:
    """Part of a motion shown in an animation.

    Parameters
    ----------
    system : moving system.
    parts : trajectories in order, each with its start time, s.
    span : start and end, s.
    """

    system: StructuralSystem
    trajectories: Sequence[tuple[float, Trajectory]]
    span: tuple[float, float]

    def at(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """(nt, n) coordinates, (nt, snubbers) forces, N, and openings, m, at increasing times within the span, s."""
        number = np.searchsorted([since for since, _ in self.trajectories], times, side="right") - 1
        n, snubbers = self.system.dynamics.size, len(self.system.snubbers)
        rows = []
        for k in np.unique(number):
            since, motion = self.trajectories[k]
            here = np.minimum(times[number == k] - since, motion.end)
            forces = motion.sample(here, lambda of, flow=motion.flow: flow.at(of).force)
            openings = motion.sample(here, lambda of, flow=motion.flow: flow.at(of).openings)
            rows.append((motion.states_at(here)[:, :n], forces[:, :snubbers], openings[:, :snubbers]))
        states, forces, openings = (np.vstack(of) for of in zip(*rows, strict=True))
        return states, forces, openings


def _swept(level: SweepLevel, curve: SweepCurve, span: tuple[float, float], progress: Progress) -> _MotionExcerpt:
    """Part of a swept sine, if it reaches that far."""
    march = swept_march(level, curve.notching, progress).motion
    parts: list[tuple[float, Trajectory]] = []
    for chunk in march.chunks():
        since, motion = float(march.windows.edge[chunk.first]), chunk.motion
        if since + motion.end > span[0]:
            parts.append((since, motion.with_all_states()))
        if since + motion.end > span[1]:
            break
    since, last = parts[-1]
    return _MotionExcerpt(level.system, parts, (span[0], min(span[1], since + last.end)))


def _steady_motion(level: SweepLevel, direction: str, f: float, progress: Progress) -> _MotionExcerpt:
    """Steady motion of a step, over whole periods if it is periodic."""
    steps, (stepper, motion) = steps_of(level), stepper_of(level)
    upto = steps.index((direction, f)) + 1
    period = 0
    for done, (_, hz) in enumerate(steps[:upto], 1):
        period = steady_at(level, hz, stepper, motion)[0].period
        report_progress(progress, done / upto)
    cycles = math.ceil(CYCLES_SHOWN / max(period, 1)) * max(period, 1)
    steady = stepper.trajectory(motion, cycles)
    return _MotionExcerpt(level.system, [(0.0, steady)], (0.0, steady.end))


def _response(curve: SweepCurve) -> Floats:
    """(C,) largest displacement of any probe from equilibrium in each cycle; without probes the first output."""
    responses = [np.nan_to_num(curve.response(name)) for name in curve.places("displacement")]
    outputs = [np.nan_to_num(curve.channel("output", name).peak) for name in curve.places("output")[:1]]
    return np.asarray(np.max(responses or outputs or [np.zeros(curve.frequency_hz.size)], axis=0))
