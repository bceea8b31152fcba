"""Measured values of periodic motions: extremes of channels, harmonics of the probes, shares of contact.

Extremes of motions in closed form are certified; power series and sums of harmonics are polynomials on pieces of
the period and are searched in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from beamsim.flow.channels import outputs_of
from beamsim.flow.exact import ExactFlow
from beamsim.flow.harmonic_motions import HarmonicMotions
from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.branch import BranchPoint, OrbitBranch
from beamsim.orbits.harmonic_balance import ForcedBalance
from beamsim.orbits.period import PIECES, polynomial_extrema
from beamsim.responses.loads import harmonic_loads, sine_of
from beamsim.responses.orbit_energies import balance_error, energy_error, energy_errors
from beamsim.responses.stepped_channels import SteppedChannels
from beamsim.results.values import DISPLACEMENT, LIMITED, of_ring
from beamsim.scenario.excitation import Sine
from beamsim.signals.records import RECTANGULAR
from beamsim.system.equations import ChannelSet, Forcing
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, Ints

SAMPLES = 2048  # of a period, for harmonics that are not known in closed form
MOST_AT_ONCE = 256  # motions that are measured together ...
NUMBERS_AT_ONCE = 4e6  # ... and numbers in the vectors of their terms, which bound the memory


@dataclass(frozen=True)
class MeasuredMotion:
    """Measured values of one motion: extremes of C channels, and more."""

    high: Floats  # (C,)
    low: Floats  # (C,)
    harmonics: Complexes  # (probes, H + 1) of the displacements, of the motion's own frequency
    contact_share: Floats  # (snubbers,)
    energy_error: float = math.nan  # relative, of the balance over a period

    @property
    def peak(self) -> Floats:
        """(C,) largest magnitudes."""
        return np.maximum(np.abs(self.high), np.abs(self.low))


def measured_channels(system: StructuralSystem, limits: Collection[str] = ()) -> ChannelSet:
    """The measured channels: those of response curves, of limits and of outputs.

    Parameters
    ----------
    system : of the channels.
    limits : names of the limits.
    """
    keys = {value.key for name, value in LIMITED.items() if value.in_sweeps or name in limits}
    return system.channels.select(lambda each: each.key in keys or each.section == "outputs" or of_ring(each))


@dataclass
class Measurement:
    """Channels of a system on its periodic motions.

    Parameters
    ----------
    system : of the channels.
    excitation : whose frequency and level are those of each motion; None of free motions.
    channels : C columns of values.
    harmonics : H, number of the highest one.
    system_at : gives the system at a parameter of the branch from the reference system; by default the same system.
    """

    system: StructuralSystem
    excitation: Sine | None
    channels: ChannelSet
    harmonics: int = 5
    system_at: Callable[[StructuralSystem, float], StructuralSystem] | None = None
    _last_flow: ExactFlow | None = field(default=None, init=False)  # under the loads of a motion before

    def of(self, problem: Any, points: Sequence[BranchPoint]) -> list[MeasuredMotion]:
        """The motions of points of a branch, by shooting or by harmonic balance, with their energy balances."""
        if self.system_at is not None:
            moved = self.system_at
            return [self._of_moved(moved(self.system, point.parameter), problem, point) for point in points]
        if isinstance(problem, ForcedBalance):
            return [self._by_balance(problem, point) for point in points]
        cycles, found = [problem.cycle(point) for point in points], list[MeasuredMotion]()
        for _, alike in groupby(cycles, lambda cycle: id(cycle[0].system)):
            found += self._of_cycles(list(alike))
        return found

    def _of_cycles(self, cycles: Sequence[tuple[PeriodicFlow, FlowMap]]) -> list[MeasuredMotion]:
        """Motions of one system over a period, each under loads of its own, with their energy balances."""
        closed = [(flow, flow_map) for flow, flow_map in cycles if isinstance(flow, VariationalFlow)]
        if not closed:
            return [replace(self.of_flow_map(*cycle), energy_error=energy_error(*cycle)) for cycle in cycles]
        size, found = max(1, min(MOST_AT_ONCE, int(NUMBERS_AT_ONCE / closed[0][0].size ** 2))), list[MeasuredMotion]()
        for first in range(0, len(closed), size):
            motions = self._motions(closed[first : first + size])
            pairs = zip(self._in_closed_form(motions), energy_errors(motions).tolist(), strict=True)
            found += [replace(motion, energy_error=error) for motion, error in pairs]
        return found

    def _by_balance(self, problem: ForcedBalance, point: BranchPoint) -> MeasuredMotion:
        flow, motion = problem.flow_at(point.parameter), point.data
        known = self._on_pieces(flow, motion.edges, motion.phases, motion.states, max(PIECES, motion.highest))
        return replace(known, energy_error=balance_error(problem, point))

    def trajectory(self, branch: OrbitBranch, number: int) -> tuple[StructuralSystem, Trajectory] | None:
        """The motion of a point of a branch over its period, with its system; None where it has no closed form."""
        problem, point = branch.problem, branch.points[number]
        if isinstance(problem, ForcedBalance) or not isinstance((cycle := problem.cycle(point))[0], VariationalFlow):
            return None
        flow, flow_map = cycle
        system = self.system if self.system_at is None else self.system_at(self.system, point.parameter)
        exact = ExactFlow(flow.system, self._loads(flow.omega, flow.level), flow_map.duration)
        return system, simulate(exact, branch.orbits[number].state)

    def _of_moved(self, system: StructuralSystem, problem: Any, point: BranchPoint) -> MeasuredMotion:
        """Measure the motion of a system with a varied snubber, in the columns of this system's channels.

        If a channel has other columns there, as a stress with stations at contacts, all columns have the extremes of
        the whole channel.
        """
        names = {(*each.key, each.name) for each in self.channels.channels}
        there = system.channels.select(lambda each: (*each.key, each.name) in names)
        found = Measurement(system, self.excitation, there, self.harmonics).of(problem, [point])[0]
        high, low = np.split(np.zeros(2 * sum(each.columns for each in self.channels.channels)), 2)
        columns = {(*each.key, each.name): slice(k, k + each.columns) for each, k in there.first_columns}
        for each, first in self.channels.first_columns:
            of = columns[*each.key, each.name]
            same, to = of.stop - of.start == each.columns, slice(first, first + each.columns)
            high[to] = found.high[of] if same else found.high[of].max()
            low[to] = found.low[of] if same else found.low[of].min()
        return replace(found, high=high, low=low)

    def of_flow_map(self, flow: PeriodicFlow, flow_map: FlowMap) -> MeasuredMotion:
        """A motion over a period."""
        if isinstance(flow, VariationalFlow):
            return self._in_closed_form(self._motions([(flow, flow_map)]))[0]
        edges = np.append(flow_map.time, flow_map.duration)
        return self._on_pieces(flow, edges, flow_map.phases, lambda times: flow.states_at(flow_map, times))

    def _loads(self, omega: float, level: float) -> Forcing:
        """Loads at a frequency, rad/s, and level."""
        sine = 0.0 if self.excitation is None else sine_of(self.excitation, omega, level)
        return harmonic_loads(self.system, omega, sine)

    def _motions(self, cycles: Sequence[tuple[VariationalFlow, FlowMap]]) -> HarmonicMotions:
        """Motions of one system, each under the loads of its flow."""
        loads, first = [self._loads(flow.omega, flow.level) for flow, _ in cycles], cycles[0][0]
        if self._last_flow is None or self._last_flow.system is not first.system:
            self._last_flow = ExactFlow(first.system, loads[0], first.exact.duration)
        sources = [self._last_flow.sources_under(each) for each in loads]
        return HarmonicMotions(self._last_flow, [each for _, each in cycles], sources)

    def _in_closed_form(self, motions: HarmonicMotions) -> list[MeasuredMotion]:
        exact, channels = motions.flow, self.channels
        linear, squared = outputs_of(exact, channels.linear), outputs_of(exact, channels.squared)
        high, low = motions.channel_extrema(channels, linear, squared)
        displacements = outputs_of(exact, channels.of_keys(DISPLACEMENT).linear)
        omega = 2.0 * np.pi / motions.duration[:, None] * np.arange(self.harmonics + 1.0)
        spectra = 2.0 / motions.duration[:, None, None] * motions.fourier_integrals(displacements, omega)
        spectra[:, :, 0] *= 0.5
        shares = motions.contact_share()[:, : len(self.system.snubbers)]
        return [MeasuredMotion(*values) for values in zip(high, low, spectra, shares, strict=True)]

    def _on_pieces(
        self,
        flow: PeriodicFlow,
        edges: Floats,
        phases: Ints,
        states: Callable[[Floats], Floats],
        pieces: int = PIECES,
    ) -> MeasuredMotion:
        """A motion whose states are known, with the springs' phases (G, m) between edges (G + 1,)."""
        exact = ExactFlow(flow.system, self._loads(flow.omega, flow.level), float(edges[-1]))
        owner, direction = self.system.dynamics.contacts.owners_of_springs
        first = np.diff(owner, prepend=-1) > 0  # the part that touches first, whose face is that of the contact
        sizes = self.channels.sizes
        split = sizes._replace(contacts=owner.size)

        def by_part(rows: Floats) -> Floats:
            parts = {name: sizes.part(rows, name) for name in sizes.slices}
            contact, opening = parts.pop("contact")[:, owner] * direction, parts.pop("opening")[:, owner] * first
            return split.rows(rows.shape[0], contact=contact, opening=opening, **parts)

        channels = tuple(replace(channel, rows=by_part(channel.rows)) for channel in self.channels.channels)
        known = SteppedChannels(self.system, exact, ChannelSet(channels, split))

        def values(times: Floats, inside: Floats) -> Floats:
            segment = np.clip(np.searchsorted(edges, inside, side="right") - 1, 0, phases.shape[0] - 1)
            return known.of_states(times, states(times), phases[segment])

        found = polynomial_extrema(values, edges[[0, -1]], edges, pieces)
        even = np.arange(SAMPLES) * (edges[-1] / SAMPLES)
        samples = values(even, even)[:, self.channels.places[DISPLACEMENT]]
        lines = self.harmonics + 1
        spectrum = np.array([RECTANGULAR.amplitudes(x)[:lines] for x in samples.T]).reshape(-1, lines)
        touching = flow.system.contacts.closed(phases)
        by_snubber = [touching[:, owner == j].any(axis=1) for j in range(len(self.system.snubbers))]
        share = np.array([np.diff(edges) @ touches / edges[-1] for touches in by_snubber])
        return MeasuredMotion(found.high[0], found.low[0], spectrum, share)
