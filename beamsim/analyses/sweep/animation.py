"""The motion at the highest peak of a sweep, for animations: the sweep is computed again up to there."""

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

SAMPLES = 1200  # of the cycles shown, which say where there is contact


def frames_of_sweep(result: SweepResult, progress: Progress = None) -> Frames | None:
    """Three cycles at the largest displacement from equilibrium of all probes, levels and directions.

    Parameters
    ----------
    result : of a swept or stepped sine; of the steady motion of a step whole periods are shown.
    progress : called with the share of the whole sweep that is done.

    Returns
    -------
    Frames or None
        None where no curve was computed.

    Raises
    ------
    ScenarioError
        If the model cannot be built again.
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
        system = replace(system, forcing=loads_at(level, f)[0])  # supports follow it
    times = np.linspace(*sampled.span, SAMPLES)
    instants = paced_by_contact(times, sampled.at(times)[1])
    return frames_at(system, instants, *sampled.at(instants[0]), sampled.at(between_frames(instants[0]))[0])


@dataclass(frozen=True)
class _ShownMotion:
    """The part of a motion that is shown.

    Parameters
    ----------
    system : that moves.
    parts : one after the other, each with the time at which its own begins, s.
    span : s, begin and end.
    """

    system: StructuralSystem
    parts: Sequence[tuple[float, Trajectory]]
    span: tuple[float, float]

    def at(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """(nt, n) coordinates, (nt, snubbers) forces, N, and openings, m, at increasing times, s, of the span."""
        number = np.searchsorted([since for since, _ in self.parts], times, side="right") - 1
        n, snubbers = self.system.dynamics.size, len(self.system.snubbers)
        rows = []
        for k in np.unique(number):
            since, motion = self.parts[k]
            here = np.minimum(times[number == k] - since, motion.end)
            forces = motion.sample(here, lambda of, flow=motion.flow: flow.at(of).force)
            openings = motion.sample(here, lambda of, flow=motion.flow: flow.at(of).openings)
            rows.append((motion.states_at(here)[:, :n], forces[:, :snubbers], openings[:, :snubbers]))
        states, forces, openings = (np.vstack(of) for of in zip(*rows, strict=True))
        return states, forces, openings


def _swept(level: SweepLevel, curve: SweepCurve, span: tuple[float, float], progress: Progress) -> _ShownMotion:
    """A part of a swept sine, as far as it goes."""
    march = swept_march(level, curve.notching, progress).motion
    parts: list[tuple[float, Trajectory]] = []
    for chunk in march.chunks():
        since, motion = float(march.windows.edge[chunk.first]), chunk.motion
        if since + motion.end > span[0]:
            parts.append((since, motion.with_all_states()))
        if since + motion.end > span[1]:
            break
    since, last = parts[-1]
    return _ShownMotion(level.system, parts, (span[0], min(span[1], since + last.end)))


def _steady_motion(level: SweepLevel, direction: str, f: float, progress: Progress) -> _ShownMotion:
    """The steady motion of a step, over whole periods where it has one."""
    steps, (stepper, motion) = steps_of(level), stepper_of(level)
    upto = steps.index((direction, f)) + 1
    period = 0
    for done, (_, hz) in enumerate(steps[:upto], 1):
        period = steady_at(level, hz, stepper, motion)[0].period
        report_progress(progress, done / upto)
    cycles = math.ceil(CYCLES_SHOWN / max(period, 1)) * max(period, 1)
    steady = stepper.trajectory(motion, cycles)
    return _ShownMotion(level.system, [(0.0, steady)], (0.0, steady.end))


def _response(curve: SweepCurve) -> Floats:
    """(C,) the largest displacement from equilibrium of any probe in each cycle; without probes the first output."""
    responses = [np.nan_to_num(curve.response(name)) for name in curve.places("displacement")]
    outputs = [np.nan_to_num(curve.channel("output", name).peak) for name in curve.places("output")[:1]]
    return np.asarray(np.max(responses or outputs or [np.zeros(curve.frequency_hz.size)], axis=0))
