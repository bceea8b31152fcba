"""One level of a sweep: its channels, and the curve that is made of their values in every cycle."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from beamsim.analyses.run.impacts import friction_contacts
from beamsim.analyses.sweep.cycles import CycleRecord
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
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.sliders import FORWARDS, STICK, sliding_limit, snap
from beamsim.contacts.snubbers import FRICTION
from beamsim.flow.channels import outputs_of
from beamsim.flow.exact import ExactFlow
from beamsim.results.values import ACCELERATION, DISPLACEMENT, FORCE, LIMITED, OPENING, STRESS
from beamsim.scenario.sweep import SteppedSine, SweptSine
from beamsim.system.equations import Channel, ChannelSet, Key, RowsOf, StateEquations
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, Ints


@dataclass(frozen=True)
class LevelRun:
    """One level, all its directions."""

    curves: tuple[SweepCurve, ...]
    work: LevelWork
    history: SweepHistory | None = None


@dataclass(frozen=True)
class SweepLevel:
    """One level of a sweep, and the channels that are looked at: what impacts and sliding follow from comes after them.

    Parameters
    ----------
    system : displacements of its probes, forces of its snubbers and the outputs that are no energies are looked at.
    settings : whether the probes' accelerations are, too, and the rates and losses of impacts with the sliding speeds
        of friction contacts.
    value : of the excitation; with a profile the factor applied to it.
    index : number of the level.
    limited : names of the limits: openings of the snubbers where it holds "gap", and the stress along the bodies
        where it holds "bending_stress".
    """

    system: StructuralSystem
    settings: SweptSine | SteppedSine
    value: float
    index: int
    limited: Collection[str] = ()

    @property
    def quantity(self) -> str:
        """What is prescribed."""
        return self.system.scenario.sine.quantity or "acceleration"

    @cached_property
    def channels(self) -> ChannelSet:
        """Those whose extremes, means and harmonics are asked for."""
        asked = {value.key for name, value in LIMITED.items() if value.followed or name in self.limited}
        if not self.settings.accelerations:
            asked.discard(ACCELERATION)

        def wanted(channel: Channel) -> bool:
            return channel.key in asked or (channel.section == "outputs" and not channel.squared)

        return self.system.channels.only(wanted)

    def rows(self, template: ExactFlow) -> RowsOf:
        """All columns by the phases of the contacts, written for a flow."""
        count, rubbing = len(self.system.snubbers), friction_contacts(self.system)
        channels = outputs_of(template, self.channels.linear)
        if not self.settings.impacts:
            return channels

        def output_of(phases: Ints) -> Floats:
            at = template.at(phases)
            return np.vstack([channels(phases), _impact_rows(at, count), at.sliding_speeds[rubbing], _wear_rows(at)])

        return output_of

    @cached_property
    def _beyond(self) -> tuple[Ints, ...]:
        """Columns of impacts, sliding speeds and wear, which come after those of the channels in `rows`."""
        contacts, first = self.system.dynamics.contacts, self.channels.order.size
        impacts = len(self.system.snubbers) + loss_owner(contacts).size
        sizes = [impacts, friction_contacts(self.system).size, 2 * _rubbing(contacts).size]
        return tuple(np.split(first + np.arange(sum(sizes)), np.cumsum(sizes)[:-1]))

    @property
    def searched(self) -> Ints:
        """Numbers of the columns whose extremes are asked for: the channels, and the rates of impacts."""
        return np.arange(self.channels.order.size + len(self.system.snubbers) * self.settings.impacts)

    def _named(self, key: Key, unit: str = "") -> dict[str, int]:
        """Columns of channels that are alike, by name of probe, snubber or output; of one unit, if given."""
        return {c.name: k for c, k in self.channels.located if c.key == key and unit in ("", c.unit)}

    def curve(self, record: CycleRecord, direction: str, **fields: Any) -> SweepCurve:
        """The curve of one way from the values of its cycles; ``fields`` are the other fields of `SweepCurve`."""
        force, stress = self._named(FORCE), self.channels.places.get(STRESS)
        rest = self.system.static_equilibrium
        shapes = {(probe.name, *DISPLACEMENT): probe.shape for probe in self.system.probes}
        at_rest = {} if rest is None else {key: float(shape @ rest) for key, shape in shapes.items()}

        def numbers(k: int) -> tuple[Floats, Floats, Floats, Floats, Complexes]:
            rms, harmonic = np.sqrt(np.maximum(record.mean_square[:, k], 0.0)), record.harmonic[:, k]
            return record.high[:, k], record.low[:, k], rms, harmonic[:, 0].real, harmonic[:, 1:].T

        def envelopes(section: str) -> tuple[Envelope, ...]:
            of = [(c, k) for c, k in self.channels.located if c.section == section and c.key != OPENING]
            of.sort(key=lambda located: located[0].quantity)
            static = [at_rest.get((c.name, *c.key), 0.0) for c, _ in of]
            return tuple(
                Envelope(c.name, c.quantity, c.unit, *numbers(k), x) for (c, k), x in zip(of, static, strict=True)
            )

        if "gap" in self.limited:
            fields["peak_gap"] = {name: record.high[:, k] for name, k in self._named(OPENING, "m").items()}
        if stress is not None:
            extremes = np.abs(record.high[:, stress]), np.abs(record.low[:, stress])
            fields["peak_bending_stress"] = np.maximum(*extremes).max(axis=1)
        if self.settings.impacts:
            fields |= {"impacts": self._impacts(record), "sliding": self._sliding(record)}
        return SweepCurve(
            name=f"{direction}_{self.index}",
            direction=direction,
            level_index=self.index,
            level=self.value,
            quantity=self.quantity,
            orders=np.array(self.settings.tracked_orders),
            probes=envelopes("probes"),
            snubbers=envelopes("snubbers"),
            contact_share={name: record.contact_share[:, k] for k, name in enumerate(force)},
            contacts={name: record.closings[:, k] for k, name in enumerate(force)},
            bent=bent(record.contact_share[:, len(force) :]),
            outputs={
                c.name: OutputEnvelope(c.name, c.quantity, c.unit, c.at, *numbers(k))
                for c, k in self.channels.located
                if c.section == "outputs"
            },
            **fields,
        )

    def _impacts(self, record: CycleRecord) -> dict[str, CycleImpacts]:
        """Impacts by snubber, from rates in contact and from outputs whose squares are the power lost, or from the
        product of rate and force that a snubber which yields loses."""
        force = self._named(FORCE)
        yielding = self._mean_products(record)
        rates, losses = np.split(self._beyond[0], [len(force)])
        owner = loss_owner(self.system.dynamics.contacts)
        period, out = record.duration / record.cycles, {}
        for k, (name, column) in enumerate(force.items()):
            per_cycle = record.closings[:, k] / record.cycles
            with np.errstate(divide="ignore", invalid="ignore"):
                time = np.where(per_cycle > 0, record.contact_share[:, k] * period / per_cycle, np.nan)
            out[name] = CycleImpacts(
                turns=self.system.snubbers[k].turns,
                per_cycle=per_cycle,
                contact_time=time,
                impulse=record.harmonic[:, column, 0].real * period,
                energy_lost=np.maximum(yielding.get(k, record.mean_square[:, losses[owner == k]].sum(axis=1)), 0.0)
                * period,
                penetration_rate=record.high[:, rates[k]],
            )
        return out

    def _mean_products(self, record: CycleRecord) -> dict[int, Floats]:
        """Mean powers lost of `_rubbing`, by contact, W; of friction that a snubber presses for a coefficient of 1."""
        square = record.mean_square[:, self._beyond[2]]
        return dict(
            zip(_rubbing(self.system.dynamics.contacts).tolist(), (square[:, ::2] - square[:, 1::2]).T, strict=True)
        )

    def _sliding(self, record: CycleRecord) -> dict[str, CycleSliding]:
        """Sliding by friction contact, from mean speeds of sliding and from how often it ends.

        Under the force of a snubber from the mean of that force times the speed, and from that force where sliding
        begins; of a force that falls with the speed what is lost is the mean of both.
        """
        which, contacts = friction_contacts(self.system), self.system.dynamics.contacts
        springs = [spring for spring in self.system.springs if spring.kind == FRICTION]
        _, columns, _ = self._beyond
        period, wear = record.duration / record.cycles, self._mean_products(record)
        begun = dict(zip(contacts.pressed.tolist(), record.pressing.T / record.cycles, strict=True))
        out = {}
        for column, j, spring in zip(columns.tolist(), which.tolist(), springs, strict=True):
            name, normal, law = spring.name, spring.normal_force, contacts.laws[j]
            sliding, begins = sliding_limit(law), snap(law)
            loss, pressed_loss = law.arrays.event_loss[STICK, FORWARDS]
            slides = record.closings[:, j] / record.cycles
            moved = record.harmonic[:, column, 0].real * period
            if normal is None:  # numbers are those of a unit of the force
                force, squared = begun[j]
                out[name] = CycleSliding(
                    per_cycle=slides,
                    distance=moved + begins * force,
                    energy_lost=sliding * wear[j] * period + pressed_loss * squared,
                    wear_power=wear[j] + begins * squared / period,
                )
                continue
            distance = moved + slides * begins
            out[name] = CycleSliding(
                per_cycle=slides,
                distance=distance,
                energy_lost=wear[j] * period if j in wear else sliding * moved + slides * loss,
                wear_power=normal * distance / period,
            )
        return out

    def history(self, time: Floats, values: Floats, aliased: Floats) -> SweepHistory:
        """The time history of all columns (nt, K), with their shares (K,) above half its rate."""
        of_keys = (self._named(*key) for key in ((DISPLACEMENT,), (ACCELERATION,), (FORCE, "N"), (FORCE, "N m")))
        displacement, acceleration, force, moment = (
            {name: values[:, k] for name, k in columns.items()} for columns in of_keys
        )
        shares = aliased[list(self._named(DISPLACEMENT).values())]
        return SweepHistory(time, displacement, acceleration, force, moment, shares)


def loss_owner(contacts: Contacts) -> Ints:
    """(m + r,) contact of each output whose square is a power lost: the dashpots, then the internal states."""
    return np.concatenate([np.arange(contacts.count), np.repeat(np.arange(contacts.count), contacts.states)])


def _rubbing(contacts: Contacts) -> Ints:
    """Contacts that lose work by forces that vary: friction that a snubber presses, then what yields or falls."""
    return np.concatenate([contacts.pressed, contacts.lossy])


def _wear_rows(at: StateEquations) -> Floats:
    """Of each friction contact that a snubber presses two rows, the difference of whose squares is the normal force
    times the speed at which it slides, N m/s; of those that yield or fall the lost force times its speed."""
    contacts = at.equations.contacts
    pressed, lossy = contacts.pressed, contacts.lossy
    slides = np.abs(contacts.slides(at.phases)[pressed, None])
    force = 0.5 * np.vstack([slides * at.pressing, at.dissipation[0][lossy]])
    speed = 0.5 * np.vstack([at.sliding_speeds[pressed], at.dissipation[1][lossy]])
    pairs = np.arange(2 * speed.shape[0]).reshape(2, -1).T.ravel()
    return np.vstack([force + speed, force - speed])[pairs]


def _impact_rows(at: StateEquations, snubbers: int) -> Floats:
    """Penetration rates of the snubbers in contact, 0 elsewhere, and rows whose squares are the power lost."""
    rate = at.equations.penetration_rate
    touching = at.equations.contacts.touching(at.phases)[:snubbers, None]
    size = np.sqrt(np.maximum(at.lost_by_rate, 0.0))[:, None]
    return np.vstack([touching * rate[:snubbers], size * np.vstack([rate, at.internal_rates])])
