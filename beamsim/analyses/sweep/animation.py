"""The motion at the highest peak of a sweep, for animations: the sweep is computed again up to there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from beamsim.analyses.run.animation import CYCLES_SHOWN, Frames, frames_at, paced_by_contact
from beamsim.analyses.sweep.analysis import sweep_settings, swept_scenario
from beamsim.analyses.sweep.outputs import SweepLevel
from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.analyses.sweep.stepped import loads_at, steady_at, stepper_of, steps_of
from beamsim.analyses.sweep.swept_sine import swept_march
from beamsim.outcomes import Progress, tell
from beamsim.scenario.sweep import SweptSine
from beamsim.system.build import build_system
from beamsim.typing import Floats

SAMPLES = 1200  # of the cycles shown, between which frames are interpolated


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
    one = SweepLevel(system, settings, curve.level, curve.level_index)
    if isinstance(settings, SweptSine):
        times, states, forces = _swept(one, curve, cycle, progress)
    else:
        f = float(curve.frequency_hz[cycle])
        times, states, forces = _stepped(one, curve.direction, f, progress)
        system = replace(system, forcing=loads_at(one, f)[0])  # supports follow it
    at, slow = paced_by_contact(times, forces)
    states, forces = (np.array([np.interp(at, times, x) for x in of.T]).T for of in (states, forces))
    return frames_at(system, at, slow, states, forces)


_Sampled = tuple[Floats, Floats, Floats]  # (nt,) s, (nt, n) coordinates, (nt, snubbers) N


def _swept(one: SweepLevel, curve: SweepCurve, cycle: int, progress: Progress) -> _Sampled:
    """The cycles about one of a swept sine."""
    system, begin = one.system, float(curve.time[max(cycle - 1, 0)])
    times = np.linspace(begin, begin + CYCLES_SHOWN / float(curve.frequency_hz[cycle]), SAMPLES)
    march = swept_march(one, curve.notching, progress).motion
    q: list[Floats] = [np.zeros((0, system.dynamics.size))]
    force: list[Floats] = [np.zeros((0, system.dynamics.contacts.count))]
    for stretch in march.stretches():
        since, motion = float(march.windows.edge[stretch.first]), stretch.motion
        here = times[(times >= since) & (times < since + motion.end)] - since
        if here.size:
            q.append(motion.states_at(here)[:, : system.dynamics.size])
            force.append(motion.sample(here, motion.flow.contact_forces))
        if since + motion.end > times[-1]:
            break
    states = np.vstack(q)
    return times[: states.shape[0]], states, np.vstack(force)[:, : len(system.snubbers)]


def _stepped(one: SweepLevel, direction: str, f: float, progress: Progress) -> _Sampled:
    """The steady motion of a step, over whole periods where it has one."""
    steps, (stepper, motion) = steps_of(one), stepper_of(one)
    upto = steps.index((direction, f)) + 1
    period = 0
    for done, (_, hz) in enumerate(steps[:upto], 1):
        period = steady_at(one, hz, stepper, motion)[0].period
        tell(progress, done / upto)
    cycles = math.ceil(CYCLES_SHOWN / max(period, 1)) * max(period, 1)
    steady = stepper.trajectory(motion, cycles)
    times = np.linspace(0.0, steady.end, SAMPLES)
    forces = steady.sample(times, steady.flow.contact_forces)[:, : len(one.system.snubbers)]
    return times, steady.states_at(times)[:, : one.system.dynamics.size], forces


def _response(curve: SweepCurve) -> Floats:
    """(C,) the largest displacement from equilibrium of any probe in each cycle; without probes the first output."""
    responses = [np.nan_to_num(each.response) for each in curve.displacement.values()]
    outputs = [np.nan_to_num(each.peak) for each in curve.outputs.values()] or [np.zeros(curve.time.size)]
    return np.asarray(np.max(responses or outputs[:1], axis=0))
