"""What is measured of a periodic motion: extremes of channels, harmonics of the probes, shares of contact.

Of motions in closed form the extremes are certified; power series and sums of harmonics are polynomials on pieces of
the period, which the same search takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from beamsim.flow.channels import channel_extrema, outputs_of
from beamsim.flow.exact import ExactFlow
from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.harmonic_balance import ForcedBalance
from beamsim.orbits.period import PIECES, polynomial_extrema
from beamsim.responses.loads import harmonic_loads, sine_of
from beamsim.responses.orbit_energies import balance_error, energy_error
from beamsim.responses.stepped_channels import SteppedChannels
from beamsim.results.values import DISPLACEMENT, LIMITED
from beamsim.scenario.excitation import Sine
from beamsim.signals.records import RECTANGULAR
from beamsim.system.equations import ChannelSet
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, Ints

SAMPLES = 2048  # of a period, for harmonics that are not known in closed form


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


def measured(system: StructuralSystem, limited: Collection[str] = ()) -> ChannelSet:
    """The channels that are measured: what response curves show, what limits ask for, and the outputs.

    Parameters
    ----------
    system : of the channels.
    limited : names of the limits.
    """
    keys = {value.key for name, value in LIMITED.items() if value.followed or name in limited}
    return system.channels.only(lambda channel: channel.key in keys or channel.section == "outputs")


@dataclass
class Measurement:
    """Channels of a system on its periodic motions.

    Parameters
    ----------
    system : of the channels.
    excitation : whose frequency and level are those of each motion; None of free motions.
    channels : C columns of values.
    harmonics : H, number of the highest one.
    moved : the system whose motion a point is, from the unmoved one and the point's parameter; by default that system.
    """

    system: StructuralSystem
    excitation: Sine | None
    channels: ChannelSet
    harmonics: int = 5
    moved: Callable[[StructuralSystem, float], StructuralSystem] | None = None
    _exact: ExactFlow | None = field(default=None, init=False)  # of the motion before

    def of(self, problem: Any, point: BranchPoint) -> MeasuredMotion:
        """The motion of a point of a branch, by shooting or by harmonic balance, with its energy balance."""
        if self.moved is not None:
            return self._of_moved(self.moved(self.system, point.parameter), problem, point)
        if isinstance(problem, ForcedBalance):
            flow, motion = problem.flow_at(point.parameter), point.data
            known = self._on_pieces(flow, motion.edges, motion.phases, motion.states, max(PIECES, motion.highest))
            return replace(known, energy_error=balance_error(problem, point))
        flow, flow_map = problem.cycle(point)
        return replace(self.of_flow_map(flow, flow_map), energy_error=energy_error(flow, flow_map))

    def _of_moved(self, system: StructuralSystem, problem: Any, point: BranchPoint) -> MeasuredMotion:
        """The motion of a system whose channels are those of this one in other places, in the columns of these.

        Where a channel has other columns there, as the stress with stations where contacts act, all have the extremes
        of the whole channel.
        """
        names = {(*each.key, each.name) for each in self.channels.channels}
        there = system.channels.only(lambda each: (*each.key, each.name) in names)
        found = Measurement(system, self.excitation, there, self.harmonics).of(problem, point)
        high, low = np.split(np.zeros(2 * sum(each.columns for each in self.channels.channels)), 2)
        columns = {(*each.key, each.name): slice(k, k + each.columns) for each, k in there.located}
        for each, first in self.channels.located:
            of = columns[*each.key, each.name]
            same, to = of.stop - of.start == each.columns, slice(first, first + each.columns)
            high[to] = found.high[of] if same else found.high[of].max()
            low[to] = found.low[of] if same else found.low[of].min()
        return replace(found, high=high, low=low)

    def of_flow_map(self, flow: PeriodicFlow, flow_map: FlowMap) -> MeasuredMotion:
        """A motion over a period."""
        if isinstance(flow, VariationalFlow):
            return self._in_closed_form(flow, flow_map)
        edges = np.append(flow_map.time, flow_map.duration)
        return self._on_pieces(flow, edges, flow_map.phases, lambda times: flow.states_at(flow_map, times))

    def _under(self, flow: PeriodicFlow, duration: float) -> ExactFlow:
        """The system of a flow under its loads, as channels ask for them."""
        sine = 0.0 if self.excitation is None else sine_of(self.excitation, flow.omega, flow.level)
        forcing, observers = harmonic_loads(self.system, flow.omega, sine)
        if self._exact is None or self._exact.system is not flow.system:
            self._exact = ExactFlow(flow.system, forcing, duration, observers)
        else:
            self._exact = self._exact.with_loads(forcing, observers)
        return self._exact

    def _in_closed_form(self, flow: VariationalFlow, flow_map: FlowMap) -> MeasuredMotion:
        exact = self._under(flow, flow.exact.duration)
        motion = flow_map.trajectory(exact)
        found = channel_extrema(motion, self.channels)
        displacements = outputs_of(exact, self.channels.of_keys(DISPLACEMENT).linear)
        omega: Floats = 2.0 * np.pi / flow_map.duration * np.arange(self.harmonics + 1.0)
        spectrum = 2.0 / flow_map.duration * motion.fourier_integrals(displacements, omega)
        spectrum[:, 0] *= 0.5
        return MeasuredMotion(found.high, found.low, spectrum, motion.contact_share()[: len(self.system.snubbers)])

    def _on_pieces(
        self,
        flow: PeriodicFlow,
        edges: Floats,
        phases: Ints,
        states: Callable[[Floats], Floats],
        pieces: int = PIECES,
    ) -> MeasuredMotion:
        """A motion whose states are known, with the springs' phases (G, m) between edges (G + 1,)."""
        exact = self._under(flow, float(edges[-1]))
        owner, direction = self.system.dynamics.contacts.owners_of_parts
        first = np.diff(owner, prepend=-1) > 0  # the part that touches first, whose face is that of the contact
        sizes = self.channels.sizes
        split = sizes._replace(contacts=owner.size)

        def by_part(rows: Floats) -> Floats:
            parts = {name: sizes.part(rows, name) for name in sizes.parts}
            contact, opening = parts.pop("contact")[:, owner] * direction, parts.pop("opening")[:, owner] * first
            return split.rows(rows.shape[0], contact=contact, opening=opening, **parts)

        channels = tuple(replace(channel, rows=by_part(channel.rows)) for channel in self.channels.channels)
        base = exact.forcing.base_displacement
        known = SteppedChannels(replace(self.system, base_displacement=base), exact, ChannelSet(channels, split))

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
