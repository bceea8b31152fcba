"""The motion at the highest peak of a swept sine, for animations: the sweep is computed again up to there."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.animation import CYCLES_SHOWN, BuiltModel, Frames, frames_at, paced_by_contact
from beamsim.analyses.sweep.analysis import sweep_settings, swept_scenario
from beamsim.analyses.sweep.outputs import SweepLevel
from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.analyses.sweep.swept_sine import swept_march
from beamsim.outcomes import Progress
from beamsim.scenario.excitation import Forces, Harmonic
from beamsim.scenario.sweep import SweptSine
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds, driven_supports
from beamsim.typing import Floats

SAMPLES = 1200  # of the cycles shown, between which frames are interpolated


def frames_of_sweep(result: SweepResult, progress: Progress = None) -> Frames | None:
    """Three cycles about the largest displacement from equilibrium of all probes, levels and directions.

    Parameters
    ----------
    result : of a swept sine.
    progress : called with the share of the whole sweep that is done.

    Returns
    -------
    Frames or None
        None of a stepped sweep, of supports that move, and where no curve was computed.

    Raises
    ------
    ScenarioError
        If the model cannot be built again.
    """
    settings, excitation = sweep_settings(result.scenario), result.scenario.excitation
    if not isinstance(settings, SweptSine) or not result.curves or any(driven_supports(result.scenario)):
        return None
    assert isinstance(excitation, Harmonic | Forces)
    scenario, shared = swept_scenario(result.scenario), SharedBuilds()
    system = build_system(scenario, shared)
    curve = max(result.curves.values(), key=lambda each: float(np.max(_response(each))))
    cycle = int(np.argmax(_response(curve)))
    begin = float(curve.time[max(cycle - 1, 0)])
    times = np.linspace(begin, begin + CYCLES_SHOWN / float(curve.frequency_hz[cycle]), SAMPLES)
    one = SweepLevel(system, settings, excitation, curve.level, curve.level_index)
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
    states, forces = np.vstack(q), np.vstack(force)[:, : len(system.snubbers)]
    times = times[: states.shape[0]]
    at, slow = paced_by_contact(times, forces)
    states, forces = (np.array([np.interp(at, times, x) for x in of.T]).T for of in (states, forces))
    return frames_at(scenario, BuiltModel(system, shared), at, slow, states, forces)


def _response(curve: SweepCurve) -> Floats:
    """(C,) the largest displacement from equilibrium of any probe in each cycle; without probes the first output."""
    responses = [np.nan_to_num(each.response) for each in curve.displacement.values()]
    outputs = [np.nan_to_num(each.peak) for each in curve.outputs.values()] or [np.zeros(curve.time.size)]
    return np.asarray(np.max(responses or outputs[:1], axis=0))
