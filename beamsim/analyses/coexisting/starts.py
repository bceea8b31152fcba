"""Motions from many starts at one frequency: where each ends, and which disturbance leaves a periodic one.

A start is a state at a phase of the excitation. It is followed cycle by cycle until it repeats; what does not repeat
has its largest Lyapunov exponent. Every start is independent of the others, so that workers may share them (P. J. Menck
et al., Nature Physics 9, 2013: the share of random starts that come to a motion is its basin stability).
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.continuation.paths import ResponseModel, response_model
from beamsim.analyses.designs.plan import Case
from beamsim.analyses.designs.result import CaseOutcome
from beamsim.errors import ScenarioError
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.steady import largest_exponent, settle, stepper_on, velocity_weights
from beamsim.outcomes import COMPLETE, Stop, interruption, never
from beamsim.scenario import Scenario
from beamsim.scenario.sweep import BoxCoordinate, Coexisting, Continuation, HistoryStarts, PhaseStarts, StateStarts
from beamsim.typing import Floats, of_kind

REACH = 1.15  # how far beyond the frequencies branches are followed, as a ratio
NEAR = 100.0  # times the tolerance at which motions count as settled: nearer states are of one motion
EXPONENT_CYCLES = 400
PHASES = 8  # of a cycle, at which a motion is disturbed
FINER, LEVELS = 2.0**0.5, 13  # ratio of two amplitudes of a disturbance, and their number
SHARP = 0.01  # relative, to which the smallest disturbance is bisected


class Destination(NamedTuple):
    """Where a start ends."""

    period: int  # cycles; 0 where the motion does not repeat
    cycles: int  # until then
    state: Floats  # (N,) at phase zero
    kind: str = "periodic"  # or that of its exponent
    exponent: float = np.nan  # 1/s, of what does not repeat

    @classmethod
    def of(cls, outcome: CaseOutcome) -> Destination:
        """That of a start."""
        values: dict[str, Any] = {**outcome.values, "state": np.array(outcome.values["state"])}
        return cls(**values)


class OrbitSection(NamedTuple):
    """A periodic motion by its states (period, N) at phase zero of every cycle."""

    states: Floats
    weight: Floats  # (N,) that make the entries of a state comparable

    def holds(self, end: Destination, within: float) -> bool:
        """Whether a start has come to this motion: within a distance, relative to the motion's size."""
        away = np.abs((self.states - end.state) * self.weight).max(axis=1).min()
        size = max(float(np.abs(self.states * self.weight).max()), 1e-300)
        return end.period == self.states.shape[0] and bool(away <= within * size)


@dataclass(frozen=True)
class Marches:
    """What workers compute of a scenario: starts and disturbances, each a case.

    Parameters
    ----------
    scenario : with a ``sweep`` section of kind coexisting.
    stop : asked within a case.
    """

    scenario: Scenario
    stop: Stop = never

    @property
    def settings(self) -> Coexisting:
        """The section."""
        return of_kind(Coexisting, self.scenario.sweep)

    @cached_property
    def model(self) -> ResponseModel:
        """The structure under its loads, for all frequencies at which branches may be followed."""
        low, high = self.settings.ends
        followed = Continuation.model_construct(from_=low / REACH, to=high * REACH)
        return response_model(self.scenario.model_copy(update={"sweep": followed, "run": None}))

    @cached_property
    def flow(self) -> PeriodicFlow:
        """Of that structure at the first of these frequencies."""
        problem = of_kind(ForcedOrbits, self.model.problem(self.model.levels[0]))
        return problem.flow

    def flow_at(self, hz: float) -> PeriodicFlow:
        """The flow at a frequency, Hz."""
        return self.flow.under(2.0 * np.pi * hz)

    def drawn(self) -> Floats:
        """(starts, coordinates) that are drawn, the same at every frequency."""
        starts = self.settings.starts
        low, high = np.array([ends for _, _, *ends in starts.ranges]).T
        u = np.random.default_rng(starts.seed).random((starts.number, low.size))
        return np.asarray(low + u * (high - low))

    def __call__(self, case: Case) -> CaseOutcome:
        """A case, begun at a frequency: the destination of a start, or the smallest disturbance that leaves a motion.

        Its values are the frequency, Hz, and either 0 and what is drawn of the start, or the number of the disturbance
        from 1 and the states of the motion at phase zero.
        """
        hz, number, *values = case.values
        flow, begin, found = self.flow_at(float(hz)), clock.thread_time(), dict[str, Any]()
        if number:
            known = OrbitSection(np.reshape(values, (-1, flow.size)), velocity_weights(flow, flow.omega))
            amplitude, time = self._smallest(flow, known, self.settings.disturbances[int(number) - 1])
            found = {"amplitude": amplitude, "time": time}
        else:
            end = self._from_row(flow, np.array(values, dtype=float))
            found = end._asdict() | {"state": end.state.tolist()}
        outcome = interruption("before it was known") if self.stop() else COMPLETE
        return CaseOutcome(case.number, found, outcome, clock.thread_time() - begin, given=case.values)

    def _from_row(self, flow: PeriodicFlow, row: Floats) -> Destination:
        """Where a start with these coordinates ends."""
        starts, y = self.settings.starts, np.zeros(flow.size)
        y[: self.model.system.initial_state.size] = self.model.system.initial_state
        if isinstance(starts, HistoryStarts):
            y = self._swept(flow, y, starts, float(row[0]))
        if isinstance(starts, StateStarts):
            for moved, each in zip(row.reshape(-1, 2), starts.box, strict=True):
                y[: 2 * flow.system.size] += np.outer(moved, self._moving(flow, each)).ravel()
        return self.destination(flow, y, float(row[0]) / flow.omega if isinstance(starts, PhaseStarts) else 0.0)

    def _moving(self, flow: PeriodicFlow, each: BoxCoordinate) -> Floats:
        """(n,) coordinates in which a probe moves by a unit: of a mode, or deflected by a force.

        Raises
        ------
        ScenarioError
            Where no such coordinates exist.
        """
        row, stiffness = self._row(each.probe), flow.system.stiffness
        with np.errstate(divide="ignore", invalid="ignore"):
            shape = row / stiffness if each.mode is None else 1.0 * (np.arange(1, row.size + 1) == each.mode)
        if not abs(row @ shape) > 1e-6 * np.linalg.norm(row) * np.linalg.norm(shape) or np.isinf(shape).any():
            where = "the static deflection" if each.mode is None else f"mode {each.mode}"
            remedy = f"give a mode from 1 to {row.size} in which it moves, or another probe"
            raise ScenarioError.at("sweep.starts.box", f"has {each.probe}, which {where} does not move", remedy)
        return np.asarray(shape / (row @ shape))

    def _row(self, probe: str) -> Floats:
        return next(each.shape for each in self.model.system.probes if each.name == probe)

    def _swept(self, flow: PeriodicFlow, y: Floats, starts: HistoryStarts, hz: float) -> Floats:
        """The state where a sweep ends whose frequency stays for a cycle each; the phase goes on between them."""
        last = flow.omega / (2.0 * np.pi)
        sign = 1.0 if last > hz else -1.0
        while sign * (last - hz) > 0.0 and not self.stop():
            stepper, motion = stepper_on(flow.under(2.0 * np.pi * hz), y)
            y = stepper.carry(motion, 1)[0]
            change = sign * starts.rate.value / hz
            hz = hz * 2.0**change if starts.rate.unit == "oct/s" else hz + change
        return y

    def destination(self, flow: PeriodicFlow, y: Floats, time: float = 0.0, *, named: bool = True) -> Destination:
        """Where a state ends.

        Parameters
        ----------
        flow : at the frequency.
        y : (N,) state.
        time : s, of the excitation's cycle, at that state.
        named : whether what does not repeat gets its exponent.

        Returns
        -------
        Destination
        """
        s, period = self.settings, 2.0 * np.pi / flow.omega
        if time % period:
            y = flow.end(y, period - time % period, time % period)
        stepper, motion = stepper_on(flow, y)
        found = settle(
            stepper, motion, tolerance=s.steady_to, longest_period=s.longest_period, most_cycles=s.most_cycles
        )
        state = motion.y.copy()
        if found.period or not named:
            return Destination(found.period, found.cycles, state)
        exponent = largest_exponent(stepper, motion, EXPONENT_CYCLES)
        return Destination(found.period, found.cycles, state, exponent.kind, exponent.value)

    def _smallest(self, flow: PeriodicFlow, known: OrbitSection, disturbance: Any) -> tuple[float, float]:
        """The smallest disturbance found, over phases of the motion and both signs: by rising amplitudes, then halves.

        A disturbance is a change of the velocities at once. Between the amplitudes tried smaller ones may leave as well
        where basins are fractal.
        """
        n, period, change = flow.system.size, 2.0 * np.pi / flow.omega, np.zeros(flow.size)
        probe = disturbance.probe
        change[n : 2 * n] = self._row(probe) if probe else self.model.system.forcing.load[0]
        times = [(k, j * period / PHASES) for k in range(len(known.states)) for j in range(PHASES)]
        states = [(k * period + t, flow.end(known.states[k], t) if t else known.states[k]) for k, t in times]

        def leaving(amplitude: float) -> Iterator[tuple[float, float]]:
            for t, z in states:
                for size in (amplitude, -amplitude):
                    end = self.destination(flow, z + size * change, t, named=False)
                    if not self.stop() and not known.holds(end, NEAR * self.settings.steady_to):
                        yield size, t

        amplitudes = (disturbance.to * FINER ** np.arange(1.0 - LEVELS, 1.0)).tolist()
        low, found = next(
            ((low, first) for low, high in pairwise([0.0, *amplitudes]) for first in leaving(high)),
            (0.0, (np.nan, np.nan)),
        )
        while abs(found[0]) - low > SHARP * abs(found[0]) and not self.stop():
            middle = 0.5 * (low + abs(found[0]))
            first = next(leaving(middle), None)
            low, found = (middle, found) if first is None else (low, first)
        return found
