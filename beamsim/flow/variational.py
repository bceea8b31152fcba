"""The exact flow of a structure under periodic loads, with its derivatives: what shooting and continuation ask of it.

:meth:`VariationalFlow.carry` maps a state over a time and returns the exact derivatives by the initial state, the
duration and any parameters (:mod:`beamsim.flow.sensitivity`). The motion is that of
:class:`beamsim.flow.exact.ExactFlow` under the loads
:math:`f(t) = A\\,\\mathrm{Re} \\sum_h f_h (\\omega/\\omega_0)^{r_h} e^{i k_h \\omega t}` and, for contacts on the
ground, a base displacement of the same form.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from beamsim.flow.exact import LONGEST_WINDOW_RADIANS, ExactFlow
from beamsim.flow.march import Log, March, Motion
from beamsim.flow.passage import (
    ContactDirection,
    Frequency,
    Level,
    Parameter,
    Passage,
    StructureDirection,
    WorkExceeded,
    check_finite,
)
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.sensitivity import Change, FlowOutputs, OutputRates, SourceRates, StructureRates, sensitivity
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import COMPLETE
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats, Ints


@dataclass
class VariationalFlow(PeriodicFlow):
    """The flow in closed form; flows that come from it share the contact states' modes."""

    differentiates = (Frequency, Level, ContactDirection, StructureDirection)

    exact: ExactFlow = field(init=False, repr=False)

    def _prepare(self) -> None:
        window = LONGEST_WINDOW_RADIANS / self.omega  # for structures without a stiffness: others have their own
        longest = np.inf if self.system.stiffness.any() else window
        self.exact = ExactFlow(self.system, self.loads.signals(self.omega, self.level), longest)
        self._outputs = FlowOutputs(self.exact)

    def under(self, omega: float | None = None, level: float | None = None) -> VariationalFlow:
        """The flow of the same structure at another frequency and level, which shares the contact states' modes."""
        flow = super().under(omega, level)
        if (flow.omega, flow.level) == (self.omega, self.level):
            return self
        flow.exact = self.exact.under(self.loads.signals(flow.omega, flow.level))
        return flow

    def with_system(self, system: PiecewiseLinearSystem) -> VariationalFlow:
        """The flow of another structure, or of other contacts with as many phases, under the same loads."""
        flow = copy(self)
        flow.system, flow.exact = system, replace(self.exact, system=system)
        flow._outputs = FlowOutputs(flow.exact)
        return flow

    def carry(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> Passage:
        """The state after ``duration``, with its derivatives; see :meth:`PeriodicFlow.carry`."""
        self._carried[0] += 1
        exact = self.exact
        phases = exact.begin(start, t).phases
        begun = self._outputs.begun(phases)[: self.size] @ np.append(start, exact.inputs_at(np.array([t]))[0, 0])
        motion = Motion(begun, exact.state_index(phases), time=t)
        march = March(max_events=65_536, max_evaluations=20_000_000)
        log = march.on(exact, motion, t + duration)
        check_finite(motion.y)
        if not march.outcome.complete:
            raise WorkExceeded(march.outcome.message)
        found = sensitivity(exact, self._outputs, log, [self._change(p) for p in parameters])
        of_segment = np.array([exact.states[k].phases for k in log.state], dtype=np.int64)
        return Passage(
            start, found.end, found.by[:, : self.size], found.by[:, self.size :], found.slope, duration, log.time,
            log.length, of_segment.reshape(log.state.size, -1), log.y, log.event_time, log.event_contact,
            log.event_phase,
        )  # fmt: skip

    def _change(self, parameter: Parameter) -> Change:
        """What a parameter changes."""
        if isinstance(parameter, ContactDirection):
            return OutputRates(self.exact, parameter)
        if isinstance(parameter, StructureDirection):
            return StructureRates(self.exact, parameter)
        if not isinstance(parameter, Frequency | Level):
            raise TypeError(f"no derivative by {type(parameter).__name__}")
        amplitude, exponent = self.loads.rates_of_signals(self.omega, self.level, parameter)
        count = self.exact.sources.count - 1  # without the base where no contact feels it
        return SourceRates(self.exact, amplitude[:count], exponent[:count])

    def motion(self, passage: Passage) -> Trajectory:
        """The motion of a passage, of which every output is known in closed form."""
        return motion_on(self.exact, passage)

    @property
    def fastest(self) -> float:
        """rad/s, largest rate of any motion in the contact states so far, and of the loads."""
        return max(self.exact.largest_exponent, float(np.abs(self.loads.multiple * self.omega).max(initial=0.0)))

    def contact_forces(self, phases: Ints, y: Floats, times: Floats) -> Floats:
        """See `PeriodicFlow.contact_forces`; forces of contacts that hold or rub are included.

        Parameters
        ----------
        phases : (nt, m).
        y : (nt, N) states.
        times : (nt,) s.

        Returns
        -------
        (nt, m) array
            N.
        """
        return self.exact.outputs_of_states(times, y, phases, self.exact.contact_forces)

    def states_at(self, passage: Passage, times: Floats) -> Floats:
        """(nt, N) the state at increasing times within a passage."""
        return self.motion(passage).states_at(times)


def motion_on(exact: ExactFlow, passage: Passage) -> Trajectory:
    """The motion of a passage on a flow of the same system under the same loads, whose outputs are asked for."""
    for phases in passage.phases:
        exact.state_index(phases)
    number = {phases.tobytes(): k for k, phases in enumerate(exact.visited)}
    state = np.array([number[phases.tobytes()] for phases in passage.phases], dtype=np.int64)
    log = Log(
        passage.time, passage.length, state, np.zeros_like(state), passage.y, passage.event_time,
        passage.event_contact, passage.event_phase,
    )  # fmt: skip
    end = float(passage.time[0] + passage.duration)
    return Trajectory(exact, end, *log, passage.end, 0, COMPLETE)


def floquet_multipliers(monodromy: Floats) -> Complexes:
    """Eigenvalues of a monodromy matrix, the largest first."""
    values = np.linalg.eigvals(monodromy).astype(complex)
    return np.asarray(values[np.lexsort((-values.imag, -np.abs(values)))])
