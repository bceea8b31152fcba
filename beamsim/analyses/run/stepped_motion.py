"""The motion of a run by time stepping: samples, and extremes on the integrator's dense output."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from beamsim.analyses.run.motion import RunMotion, largest_contact, with_limit
from beamsim.flow.exact import ExactFlow, exact_flow
from beamsim.flow.reference import ReferenceTrajectory, StepExtremes, TimeStepping, integrate
from beamsim.responses.energies import EnergyBalance, EnergyHistory, power_factors, stored_energy
from beamsim.responses.histories import Histories, LowPassed
from beamsim.responses.stepped_channels import SteppedChannels
from beamsim.results.values import ACCELERATION, DISPLACEMENT, OPENING, UNSAMPLED, Extreme, searched_channels
from beamsim.scenario.run import Run
from beamsim.signals.filters import PANELS_A_PERIOD
from beamsim.system.equations import Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints, not_none


def relative_tolerance(settings: Run) -> float:
    """Relative tolerance of the time integration; a small one without run.method: reference."""
    return settings.rtol if settings.method == "reference" else min(settings.rtol, 1e-10)


def stepped_motion_of(
    system: StructuralSystem,
    settings: Run,
    times: Floats,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
) -> RunMotion:
    """Integrate a run in time; extremes from the dense output, contacts from located events.

    Parameters
    ----------
    system, settings : system and settings of the run.
    times : (nt,) output times, s.
    progress, stop : see `beamsim.flow.reference.integrate`.

    Returns
    -------
    RunMotion
        Motion up to its end.

    Raises
    ------
    ScenarioError
        If the input has too many pieces, or the filter of the accelerations needs too many panels.
    """
    flow = exact_flow(system, settings.duration, settings.most_contact_states, memory=settings.memory)
    outputs = SteppedOutputs(system, flow, times, settings.low_pass)
    stepping = _time_stepping(system, flow, settings)
    method, warnings = f"{stepping.integrator}, rtol {stepping.rtol:g}", list[str]()
    if settings.method != "reference":
        warnings.append(
            f"cubic springs have no closed-form motion: integrated by {stepping.integrator} with rtol = "
            f"{stepping.rtol:g}; contacts are found as accurately as that, without certificate"
        )
    trajectory = integrate(stepping, system.initial_state, times, progress=progress, stop=stop, observe=outputs.observe)
    at = trajectory.time
    sampled = SteppedChannels(system, flow, system.channels.without(*UNSAMPLED))
    values = sampled.of_states(at, trajectory.y, trajectory.phases)
    energy = _energies(system, flow, trajectory)
    balance = EnergyBalance()
    balance.add(at, energy, float(np.abs(np.diff(trajectory.input_work)).sum()))
    histories = Histories(at, sampled.channels, values, flow.system.contacts.closed(trajectory.phases), energy)
    extremes, contact = outputs.extremes(trajectory), None
    if len(system.bodies) > 1 and system.snubbers and (largest := largest_contact(system, extremes)) is not None:
        nearest = int(np.abs(trajectory.time - largest.time).argmin())  # output time
        contact = largest._replace(state=trajectory.y[nearest], opening=histories.of(OPENING)[nearest])
    return RunMotion(
        system=system,
        method=f"reference ({method})",
        outcome=balance.check(with_limit(trajectory.outcome), "lower run.rtol and run.atol"),
        histories=histories,
        energy_error=balance.error,
        source_motion=trajectory,
        extremes=extremes,
        extreme_states=np.array([outputs.lowest_state, outputs.highest_state]),
        contact=contact,
        contact_share=trajectory.contact_share,
        low_passed=None if outputs.low is None else outputs.low.values,
        warnings=tuple(warnings),
    )


def _time_stepping(system: StructuralSystem, flow: ExactFlow, settings: Run) -> TimeStepping:
    """Integrator settings; without run.method: reference a single integrator."""
    return TimeStepping(
        flow, settings.integrator if settings.method == "reference" else "DOP853", relative_tolerance(settings),
        settings.atol, system.cubic, power_factors(flow), settings.max_events,
    )  # fmt: skip


def _energies(system: StructuralSystem, flow: ExactFlow, trajectory: ReferenceTrajectory) -> EnergyHistory:
    """Energies at the output times, with those of cubic springs."""
    at, y, phases = trajectory.time, trajectory.y, trajectory.phases
    penetration = flow.outputs_of_states(at, y, phases, lambda _: flow.equations.penetration)
    stored = stored_energy(flow.system, y, penetration, phases)
    if system.cubic is not None:
        extension = system.cubic.extension(y[:, : system.dynamics.size], flow.forcing.base_at(at))
        stored = stored + 0.25 * extension**4 @ system.cubic.stiffness
    return EnergyHistory(trajectory.input_work, trajectory.dissipated, stored)


class SteppedOutputs:
    """Observer of a time-stepped motion that stores the extremes of the channels.

    Parameters
    ----------
    system : system with the channels.
    flow : flow of the system.
    times : (nt,) output times, s.
    low_pass : corner of the filter for probe accelerations, Hz.
    """

    def __init__(self, system: StructuralSystem, flow: ExactFlow, times: Floats, low_pass: float | None = None) -> None:
        self.flow = flow
        self.searched = SteppedChannels(system, flow, searched_channels(system.channels))
        self.dense = StepExtremes()
        self.acceleration = SteppedChannels(system, flow, system.channels.of_keys(ACCELERATION))
        self.low = None if low_pass is None else LowPassed(low_pass, times, len(system.probes))
        self.lowest_state = self.highest_state = np.zeros(flow.size)  # states at the extremes of the first probe

    def observe(self, solution: Any, phases: Ints) -> None:
        """Update the extremes with a piece of the solution."""
        begin, end = float(solution.t[0]), float(solution.t[-1])

        def values(times: Floats, y: Floats) -> Floats:
            each = np.broadcast_to(phases, (times.size, phases.size))
            return self.searched.of_states(times, y[:, : self.flow.size], each, begin)

        self.dense.add(solution, values)
        if self.low is not None:
            self._filter_piece(self.low, solution, phases)
        found = not_none(self.dense.found)
        for first in self.searched.channels.places[DISPLACEMENT][:1]:
            lowest, highest = found.when_low[first], found.when_high[first]
            if begin <= lowest <= end:
                self.lowest_state = solution.sol(lowest)[: self.flow.size]
            if begin <= highest <= end:
                self.highest_state = solution.sol(highest)[: self.flow.size]

    def _filter_piece(self, low: LowPassed, solution: Any, phases: Ints) -> None:
        """Filter a piece of the dense output; panels end at integrator steps and output times."""
        begin, longest = float(solution.t[0]), 1.0 / (PANELS_A_PERIOD * low.frequency_hz)

        def acceleration(times: Floats) -> Floats:
            y = solution.sol(times)[: self.flow.size].T
            return self.acceleration.of_states(times, y, np.broadcast_to(phases, (times.size, phases.size)), begin)

        low.add(
            float(solution.t[-1]),
            lambda times: low.filter.panels(np.union1d(solution.t, times), acceleration, longest),
        )

    def extremes(self, trajectory: ReferenceTrajectory) -> dict[Key, Extreme]:
        """Extremes of the continuous motion; for a motion of zero length those of its start."""
        channels = self.searched.channels
        if self.dense.found is not None:
            of_all = tuple(self.dense.found)
        else:
            values = self.searched.of_states(trajectory.time, trajectory.y, trajectory.phases)
            each, lowest, highest = np.arange(values.shape[1]), values.argmin(axis=0), values.argmax(axis=0)
            of_all = values[lowest, each], trajectory.time[lowest], values[highest, each], trajectory.time[highest]
        extremes = channels.split(np.array(of_all))
        if self.low is None or self.low.extremes is None:
            return extremes
        return extremes | {ACCELERATION: self.low.extremes}
