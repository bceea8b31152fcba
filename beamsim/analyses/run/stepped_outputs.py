"""What a run reports of a time-stepped motion: samples, and extremes on the integrator's dense output."""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.analyses.run.figures import Extremes, sampled_extremes
from beamsim.analyses.run.low_pass import LowPassFilter
from beamsim.analyses.run.outputs import SEARCHED, bending_stress, energies_of_rows, in_every_state, output_groups
from beamsim.flow.dense_extremes import DenseExtremes
from beamsim.flow.exact import ExactFlow
from beamsim.flow.reference import ReferenceTrajectory
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints


class SteppedOutputs:
    """The outputs of a system, cubic springs included; shown a motion piece by piece, it keeps the extremes.

    Parameters
    ----------
    times : (nt,) s, of the output.
    low_pass : Hz, of the filter of the probes' accelerations.
    """

    def __init__(self, system: StructuralSystem, flow: ExactFlow, times: Floats, low_pass: float | None = None) -> None:
        self.system, self.flow, self.times = system, flow, times
        self.groups = output_groups(system, flow)
        self.stress = None if system.stress is None else in_every_state(bending_stress(flow, system.stress))
        self.probe_shapes = np.array([p.shape for p in system.probes]).reshape(-1, flow.system.size)
        self.energies: list[tuple[Floats, Floats]] = []  # times (k,) and energies (k, outputs) then
        self.dense = DenseExtremes()
        self.filter = None if low_pass is None else LowPassFilter(low_pass, len(system.probes))
        self.low_passed = None if low_pass is None else np.zeros((times.size, len(system.probes)))  # at the times
        self.lowest_state = self.highest_state = np.zeros(flow.size)  # at the extremes of the first probe

    def cubic_stretch(self, times: Floats, y: Floats) -> Floats:
        """(nt, springs) of the cubic springs."""
        cubic, base = self.system.cubic, self.system.base_displacement
        d = np.zeros(times.size) if base is None else base(times)
        return np.asarray(y[:, : self.flow.system.size] @ cubic.shape.T + d[:, None] * cubic.felt)

    def _cubic_acceleration(self, times: Floats, y: Floats) -> Floats:
        """(nt, probes) that the cubic springs take away."""
        cubic = self.system.cubic
        return np.asarray((cubic.stiffness * self.cubic_stretch(times, y) ** 3) @ (cubic.shape @ self.probe_shapes.T))

    def _cubic_outputs(self, times: Floats, y: Floats) -> Floats:
        """(nt, outputs) what the pull of the cubic springs adds, and the acceleration that it takes away."""
        cubic, rows = self.system.cubic, self.system.linear_outputs
        pull = cubic.stiffness * self.cubic_stretch(times, y) ** 3
        shares = np.vstack([each.cubic - each.acceleration @ cubic.shape.T for each in rows])
        return np.asarray(pull @ shares.T)

    def at(self, times: Floats, y: Floats, phases: Ints, since: float | None = None) -> dict[str, Floats]:
        """Values (nt, k) by group; see `ExactFlow.outputs_of_states`."""
        system, flow = self.system, self.flow
        values = self.groups.split(
            flow.outputs_of_states(times, y, phases, self.groups, since), flow.system.contacts.start
        )
        if system.cubic.count:
            values["acceleration"] = values["acceleration"] - self._cubic_acceleration(times, y)
            if system.linear_outputs:
                values["output"] = values["output"] + self._cubic_outputs(times, y)
        for i, spring in enumerate(system.springs):
            if spring.on_ground and flow.base_channel < 0 and system.base_displacement is not None:
                values["stretch"][:, i] += spring.felt * system.base_displacement(times)  # which no contact feels
        return values

    def searched(self, times: Floats, y: Floats, phases: Ints, since: float | None = None) -> dict[str, Floats]:
        """The groups whose extremes are reported."""
        known = self.at(times, y, phases, since)
        if self.system.energy_outputs:
            self._keep_energies(times, known["energy"])
        values = {name: x for name, x in known.items() if name in SEARCHED}
        if self.stress is not None:
            values["stress"] = self.flow.outputs_of_states(times, y, phases, self.stress, since)
        return values

    def observe(self, solution: Any, phases: Ints) -> None:
        """Take a piece of the solution into the extremes."""
        begin, end = float(solution.t[0]), float(solution.t[-1])

        def outputs(times: Floats, y: Floats) -> dict[str, Floats]:
            each = np.broadcast_to(phases, (times.size, phases.size))
            return self.searched(times, y[:, : self.flow.size], each, begin)

        self.dense.add(solution, outputs)
        if self.filter is not None and self.low_passed is not None:
            self._filter_piece(self.filter, self.low_passed, solution, phases)
        _, when_lowest, _, when_highest = self.dense.extremes()["displacement"]
        lowest, highest = when_lowest[0], when_highest[0]
        if begin <= lowest <= end:
            self.lowest_state = solution.sol(lowest)[: self.flow.size]
        if begin <= highest <= end:
            self.highest_state = solution.sol(highest)[: self.flow.size]

    def _filter_piece(self, low_pass: LowPassFilter, out: Floats, solution: Any, phases: Ints) -> None:
        """Lead the filter through the integrator's dense output; panels end at its steps and at the output times."""
        begin, end = float(solution.t[0]), float(solution.t[-1])
        output_of = self.groups.groups["acceleration"]

        def acceleration(times: Floats) -> Floats:
            y = solution.sol(times)[: self.flow.size].T
            each = np.broadcast_to(phases, (times.size, phases.size))
            values = self.flow.outputs_of_states(times, y, each, output_of, begin)
            return values - self._cubic_acceleration(times, y) if self.system.cubic.count else values

        here = (self.times >= begin) & (self.times <= end)
        known = np.union1d(solution.t, self.times[here])
        history = low_pass.through(known, acceleration)
        out[here] = history[np.searchsorted(known, self.times[here])]

    def extremes(self, trajectory: ReferenceTrajectory) -> Extremes:
        """Of the continuous motion; of a motion without length those of its start."""
        if self.dense.searches:
            extremes = self.dense.extremes()
        else:
            values = self.searched(trajectory.time, trajectory.y, trajectory.phases)
            extremes = {name: sampled_extremes(trajectory.time, x) for name, x in values.items()}
        if self.system.energy_outputs:
            times, energies = (np.concatenate(parts) for parts in zip(*self.energies, strict=True))
            extremes["energy"] = sampled_extremes(times, energies)
        return extremes if self.filter is None else extremes | {"acceleration": self.filter.extremes}

    def _keep_energies(self, times: Floats, values: Floats) -> None:
        """Of a piece of the motion the times of the extremes of energies, and all energies then."""
        energies = energies_of_rows(self.system.energy_outputs, values)
        kept = np.unique(np.concatenate([energies.argmin(axis=0), energies.argmax(axis=0)]))
        self.energies.append((times[kept], energies[kept]))
