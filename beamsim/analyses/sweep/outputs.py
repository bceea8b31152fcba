"""The outputs of a sweep, and the curve that is made of their values in every cycle."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.run.friction import friction_contacts, sliding_speeds
from beamsim.analyses.sweep.peaks import bent
from beamsim.analyses.sweep.result import (
    CycleImpacts,
    CycleSliding,
    Envelope,
    LevelWork,
    OutputEnvelope,
    SweepCurve,
    SweepHistory,
)
from beamsim.analyses.values import ACCELERATION, DISPLACEMENT, FORCE, LIMITED, PENETRATION, STRESS
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.friction import DIRECTION, STICK, sliding_limit, snap
from beamsim.contacts.springs import FRICTION
from beamsim.flow.channels import outputs_of
from beamsim.flow.contact_state import LinearOutput, OutputOf
from beamsim.flow.exact import ExactFlow
from beamsim.system.channels import Channel, ChannelSet, Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, Ints


@dataclass(frozen=True)
class LevelRun:
    """One level, all its directions."""

    curves: tuple[SweepCurve, ...]
    work: LevelWork
    history: SweepHistory | None = None


@dataclass(frozen=True)
class CycleValues:
    """Values of K outputs at C frequencies; R orders, m contacts."""

    high: Floats  # (C, K)
    low: Floats  # (C, K)
    mean_square: Floats  # (C, K)
    mean: Floats  # (C, K)
    harmonics: Complexes  # (R, C, K) zero to peak
    contact_share: Floats  # (C, m)
    closings: Ints  # (C, m)
    period: Floats  # (C,) s, of the time that each covers: a cycle
    pressing: Floats | None = None  # (C, 2, p) per cycle, see `beamsim.flow.slide_starts`; where something snaps
    cycles: Ints | int = 1  # (C,) over which the values are taken at each frequency

    def with_rest_in_last(self) -> CycleValues:
        """Without the last row, which is not a whole cycle: the one before takes it up, but for its harmonics."""
        *_, one, rest = self.period
        weight = np.array([one, rest]) / (one + rest)

        def merged(values: NDArray[Any], last: NDArray[Any]) -> NDArray[Any]:
            return np.concatenate([values[:-2], last[None]])

        return replace(
            self,
            high=merged(self.high, self.high[-2:].max(axis=0)),
            low=merged(self.low, self.low[-2:].min(axis=0)),
            mean_square=merged(self.mean_square, weight @ self.mean_square[-2:]),
            mean=merged(self.mean, weight @ self.mean[-2:]),
            harmonics=self.harmonics[:, :-1],
            contact_share=merged(self.contact_share, weight @ self.contact_share[-2:]),
            closings=merged(self.closings, self.closings[-2:].sum(axis=0)),
            pressing=None if self.pressing is None else merged(self.pressing, self.pressing[-2:].sum(axis=0)),
            period=merged(self.period, np.asarray(one + rest)),
        )


@dataclass(frozen=True)
class SweepOutputs:
    """Channels of a system, and what impacts and sliding follow from, whose columns come after those of the channels.

    Parameters
    ----------
    system : displacements of its probes, forces of its snubbers and the outputs that are no energies are looked at.
    with_accelerations : whether the accelerations of the probes are, too.
    limited : names of the limits: penetrations of the snubbers where it holds "gap", and the stress along the bodies
        where it holds "bending_stress".
    with_impacts : whether the rates and losses of the impacts, and the sliding speeds of friction contacts, are asked
        for.
    """

    system: StructuralSystem
    with_accelerations: bool
    limited: Collection[str] = ()
    with_impacts: bool = False

    @property
    def snaps(self) -> bool:
        """Whether the sliding asked for has contacts that lose energy at once where it begins, by a snubber's force."""
        laws = [self._contacts.laws[j] for j in self._contacts.pressed]
        return self.with_impacts and any(law.arrays.event_loss[STICK].any() for law in laws)

    @cached_property
    def channels(self) -> ChannelSet:
        """Those whose extremes, means and harmonics are asked for."""
        asked = {DISPLACEMENT: True, FORCE: True, ACCELERATION: self.with_accelerations}
        asked |= {LIMITED[name].key: True for name in ("gap", "bending_stress") if name in self.limited}

        def wanted(channel: Channel) -> bool:
            return asked.get(channel.key, False) or (channel.section == "outputs" and not channel.squared)

        return self.system.channels.only(wanted)

    def rows(self, template: ExactFlow) -> OutputOf:
        """All columns by the phases of the contacts, written for a flow."""
        count, rubbing = len(self.system.snubbers), friction_contacts(self.system)
        channels = outputs_of(template, self.channels.linear)
        if not self.with_impacts:
            return channels

        def output_of(phases: Ints) -> LinearOutput:
            parts = [channels(phases), _impact_rows(template, phases, count)]
            if rubbing.size:
                parts += [sliding_speeds(template, rubbing, phases), _wear_rows(template, phases)]
            return LinearOutput.stacked(*parts)

        return output_of

    def _groups(self) -> dict[str, slice]:
        """Columns of what is no channel, in the order of `rows`."""
        losses = loss_owner(self._contacts).size
        sizes = {
            "impacts": (len(self.system.snubbers) + losses) * self.with_impacts,
            "sliding": friction_contacts(self.system).size * self.with_impacts,
            "wear": 2 * self._contacts.pressed.size * self.with_impacts,
        }
        ends = self.channels.order.size + np.cumsum(list(sizes.values()))
        return {name: slice(int(end) - size, int(end)) for (name, size), end in zip(sizes.items(), ends, strict=True)}

    @property
    def searched(self) -> Ints:
        """Numbers of the columns whose extremes are asked for: the channels, and the rates of impacts."""
        rates = len(self.system.snubbers) * self.with_impacts
        return np.arange(self.channels.order.size + rates)

    def _named(self, key: Key) -> dict[str, int]:
        """Columns of channels that are alike, by name of probe, snubber or output."""
        alike = [channel.name for channel in self.channels.channels if channel.key == key]
        return dict(zip(alike, self.channels.places.get(key, np.zeros(0, dtype=np.int64)).tolist(), strict=True))

    def column(self, section: str, item: str, quantity: str) -> int:
        """Column of a probe's displacement or acceleration, of a snubber's force, or of an output."""
        keys = {"acceleration": ACCELERATION, "displacement": DISPLACEMENT, "force": FORCE}
        if section != "outputs":
            return self._named(keys[quantity])[item]
        output = next(each for each in self.system.outputs if each.name == item)
        return self._named(output.key)[item]

    def curve(self, values: CycleValues, **fields: Any) -> SweepCurve:
        """The curve of these values; ``fields`` are the other fields of `SweepCurve`."""
        force = self._named(FORCE)

        def numbers(k: int) -> tuple[Floats, Floats, Floats, Floats, Complexes]:
            rms = np.sqrt(np.maximum(values.mean_square[:, k], 0.0))
            return values.high[:, k], values.low[:, k], rms, values.mean[:, k], values.harmonics[:, :, k]

        def envelopes(key: Key, unit: str) -> dict[str, Envelope]:
            return {name: Envelope(key[1], unit, *numbers(k)) for name, k in self._named(key).items()}

        outputs = [channel for channel in self.channels.channels if channel.section == "outputs"]
        return SweepCurve(
            displacement=envelopes(DISPLACEMENT, "m"),
            acceleration=envelopes(ACCELERATION, "m/s^2"),
            force=envelopes(FORCE, "N"),
            contact_share={name: values.contact_share[:, k] for k, name in enumerate(force)},
            contacts={name: values.closings[:, k] for k, name in enumerate(force)},
            bent=bent(values.contact_share[:, len(force) :]),
            impacts=self._impacts(values),
            sliding=self._sliding(values),
            outputs={
                each.name: OutputEnvelope(
                    each.name, each.quantity, each.unit, each.at, *numbers(self._named(each.key)[each.name])
                )
                for each in outputs
            },
            **self._of_limits(values),
            **fields,
        )

    def _impacts(self, values: CycleValues) -> dict[str, CycleImpacts]:
        """Impacts by snubber, from rates in contact and from outputs whose squares are the power lost."""
        if not self.with_impacts:
            return {}
        force = self._named(FORCE)
        first, count = self._groups()["impacts"].start, len(force)
        period, out = values.period, {}
        for k, (name, column) in enumerate(force.items()):
            lossy = first + count + np.flatnonzero(loss_owner(self._contacts) == k)
            per_cycle = values.closings[:, k] / values.cycles
            with np.errstate(divide="ignore", invalid="ignore"):
                time = np.where(per_cycle > 0, values.contact_share[:, k] * period / per_cycle, np.nan)
            out[name] = CycleImpacts(
                per_cycle=per_cycle,
                contact_time=time,
                impulse=values.mean[:, column] * period,
                energy_lost=np.maximum(values.mean_square[:, lossy].sum(axis=1), 0.0) * period,
                penetration_rate=values.high[:, first + k],
            )
        return out

    def _sliding(self, values: CycleValues) -> dict[str, CycleSliding]:
        """Sliding by friction contact, from mean speeds of sliding and from how often it ends.

        Under the force of a snubber from the mean of that force times the speed, and from that force where sliding
        begins.
        """
        if not self.with_impacts:
            return {}
        columns, which, contacts = self._groups()["sliding"], friction_contacts(self.system), self._contacts
        springs = [spring for spring in self.system.springs if spring.kind == FRICTION]
        of_wear = values.mean_square[:, self._groups()["wear"]]
        wear = dict(zip(contacts.pressed.tolist(), (of_wear[:, ::2] - of_wear[:, 1::2]).T, strict=True))
        pressing = values.pressing
        if pressing is None:
            pressing = np.zeros((values.period.size, 2, contacts.pressed.size))
        begun = dict(zip(contacts.pressed.tolist(), np.moveaxis(pressing, 2, 0), strict=True))
        out = {}
        for column, j, spring in zip(range(columns.start, columns.stop), which.tolist(), springs, strict=True):
            name, normal, law = spring.name, spring.normal_force, contacts.laws[j]
            sliding, begins, (loss, pressed_loss) = sliding_limit(law), snap(law), law.arrays.event_loss[STICK, 0]
            slides = values.closings[:, j] / values.cycles
            moved = values.mean[:, column] * values.period
            if normal is None:  # numbers are those of a unit of the force
                force, square = begun[j].T
                out[name] = CycleSliding(
                    per_cycle=slides,
                    distance=moved + begins * force,
                    energy_lost=sliding * wear[j] * values.period + pressed_loss * square,
                    wear_power=wear[j] + begins * square / values.period,
                )
                continue
            distance = moved + slides * begins
            out[name] = CycleSliding(
                per_cycle=slides,
                distance=distance,
                energy_lost=sliding * moved + slides * loss,
                wear_power=normal * distance / values.period,
            )
        return out

    @property
    def _contacts(self) -> Contacts:
        return self.system.dynamics.contacts

    def _of_limits(self, values: CycleValues) -> dict[str, Any]:
        """Fields of a curve that are computed for limits only."""
        gaps, stress = self._named(PENETRATION), self.channels.places.get(STRESS)
        fields: dict[str, Any] = {}
        if "gap" in self.limited:
            fields["peak_gap"] = {name: -values.low[:, k] for name, k in gaps.items()}
        if stress is not None:
            extremes = np.abs(values.high[:, stress]), np.abs(values.low[:, stress])
            fields["peak_bending_stress"] = np.maximum(*extremes).max(axis=1)
        return fields

    def history(self, time: Floats, values: Floats) -> SweepHistory:
        """The time history of all columns (nt, K)."""
        of_keys = (self._named(key) for key in (DISPLACEMENT, ACCELERATION, FORCE))
        return SweepHistory(time, *({name: values[:, k] for name, k in columns.items()} for columns in of_keys))


def loss_owner(contacts: Contacts) -> Ints:
    """(m + r,) contact of each output whose square is a power lost: the dashpots, then the internal states."""
    return np.concatenate([np.arange(contacts.count), np.repeat(np.arange(contacts.count), contacts.states)])


def _wear_rows(flow: ExactFlow, phases: Ints) -> LinearOutput:
    """Of each friction contact that a snubber presses two outputs, the difference of whose squares is the normal force
    times the speed at which it slides, N m/s."""
    pressed = flow.system.contacts.pressed
    if not pressed.size:
        return flow.empty_output(0)
    slides = np.abs(DIRECTION[phases[pressed]])[:, None]
    normal = flow.pressing_forces(phases).scaled(0.5 * slides)
    speed = sliding_speeds(flow, pressed, phases).scaled(0.5)
    pairs = np.arange(2 * pressed.size).reshape(2, -1).T.ravel()
    return LinearOutput.stacked(normal + speed, normal + (-speed)).some(pairs)


def _impact_rows(flow: ExactFlow, phases: Ints, snubbers: int) -> LinearOutput:
    """Penetration rates of the snubbers in contact, 0 elsewhere, and outputs whose squares are the power lost."""
    contacts, rate = flow.system.contacts, flow.penetrations[1]
    moved = LinearOutput.stacked(rate, flow.internal_rates(phases)) if contacts.internal_states else rate
    rows = LinearOutput.stacked(rate.some(slice(snubbers)), moved)
    touching = contacts.touching(phases)[:snubbers].astype(float)
    factor = np.concatenate([touching, np.sqrt(np.concatenate(contacts.losses(phases)))])[:, None]
    return rows.scaled(factor)
