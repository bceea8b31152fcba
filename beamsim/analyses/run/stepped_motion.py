"""The motion of a run by time stepping."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from beamsim.analyses.run.energy import EnergyBalance, power_factors, stored_energy
from beamsim.analyses.run.histories import SampledHistories
from beamsim.analyses.run.motion import RunMotion, breakpoints, events_of, with_limit
from beamsim.analyses.run.output_times import OutputTimes
from beamsim.analyses.run.outputs import exact_flow
from beamsim.analyses.run.result import EnergyHistory, Work
from beamsim.analyses.run.stepped_outputs import SteppedChannels, SteppedOutputs, cubic_stretch
from beamsim.analyses.values import DISPLACEMENT, STRESS
from beamsim.flow.reference import TimeStepping, integrate
from beamsim.scenario import Run
from beamsim.system.structural import StructuralSystem

STEPS_A_PERIOD = 20  # least number, of a structure with cubic springs and contacts


def steps_in_time(system: StructuralSystem, settings: Run) -> bool:
    """Whether the motion is marched in time steps."""
    return settings.method == "reference" or system.cubic.count > 0


def stepped_motion_of(
    system: StructuralSystem,
    settings: Run,
    times: OutputTimes,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
    *,
    short_steps: bool = False,
) -> RunMotion:
    """The same by time stepping; extremes on the integrator's dense output, contact from its located events.

    With ``short_steps`` a step rarely contains a whole contact; always so where springs are smooth.
    """

    flow = exact_flow(system, settings.duration, settings.most_contact_states, memory=settings.memory)
    integrator, rtol = settings.integrator, settings.rtol
    warnings: tuple[str, ...] = ()
    longest = _longest_step(system) if short_steps or settings.method != "reference" else np.inf
    if settings.method != "reference":
        integrator, rtol = "DOP853", min(rtol, 1e-10)
        warnings = (
            f"cubic springs have no closed-form motion: integrated by {integrator} with rtol = {rtol:g}; "
            "contacts are found by sign changes between steps, without certificate",
        )
    outputs = SteppedOutputs(system, flow, times.all, settings.low_pass)
    stepping = TimeStepping(
        flow, integrator, rtol, settings.atol, longest, system.cubic, power_factors(flow), settings.max_events
    )
    trajectory = integrate(
        stepping, system.initial_state, times.all, progress=progress, stop=stop, observe=outputs.observe
    )
    at = trajectory.time
    sampled = SteppedChannels(system, flow, system.channels.without(STRESS))
    values = sampled.channels.split(sampled.values(at, trajectory.y, trajectory.phases))
    penetration = flow.outputs_of_states(at, trajectory.y, trajectory.phases, lambda _: flow.penetrations[0])
    stored = stored_energy(flow, trajectory.y, penetration, trajectory.phases)
    if system.cubic.count:
        stored = stored + 0.25 * cubic_stretch(system, at, trajectory.y) ** 4 @ system.cubic.stiffness
    energy = EnergyHistory(trajectory.work_in, trajectory.dissipated, stored)
    exchanged = float(np.abs(np.diff(trajectory.work_in)).sum())
    balance = EnergyBalance.of(at, energy, exchanged)
    extremes = outputs.extremes(trajectory)
    return RunMotion(
        method=f"reference ({integrator}, rtol {rtol:g})",
        outcome=balance.checked(with_limit(trajectory.outcome), "lower run.rtol and run.atol"),
        histories=SampledHistories(at, values, flow.system.contacts.touching(trajectory.phases), energy),
        balance=balance,
        events=events_of(system, trajectory),
        marched=trajectory,
        breakpoints=breakpoints(system, trajectory),
        extremes=extremes,
        extreme_times=np.array([extremes[DISPLACEMENT][k][0] for k in (1, 3)]),
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
        warnings=warnings,
    )


def _longest_step(system: StructuralSystem) -> float:
    """A step so short that it rarely contains a whole contact: a fraction of the shortest period, contacts closed."""
    c = system.dynamics.contacts
    if c.count == 0:
        return np.inf
    fastest = system.dynamics.stiffness.max() + np.abs(c.arrays.force[:, :, 0]).max(axis=1) @ (c.shape**2).sum(axis=1)
    return float(2 * np.pi / np.sqrt(fastest) / STEPS_A_PERIOD) if fastest > 0 else np.inf
