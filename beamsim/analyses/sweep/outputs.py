"""The outputs of a sweep, and the curve that is made of their values in every cycle."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.run.friction import friction_contacts, sliding_speeds
from beamsim.analyses.run.outputs import accelerations, asked_for, bending_stress, displacements, stack
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
from beamsim.contacts.friction import DIRECTION, STICK, sliding_limit, snap
from beamsim.contacts.springs import FRICTION
from beamsim.flow.contact_state import LinearOutput, OutputOf
from beamsim.flow.exact import ExactFlow
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

    def columns(self, which: slice) -> CycleValues:
        """The values of a selection of the outputs."""
        return replace(
            self, high=self.high[:, which], low=self.low[:, which], mean_square=self.mean_square[:, which],
            mean=self.mean[:, which], harmonics=self.harmonics[:, :, which],
        )  # fmt: skip

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
    """Displacements of the probes, forces of the snubbers, absolute accelerations of the probes, quantities of limits,
    and the outputs that the scenario asks for, which come last.

    Parameters
    ----------
    with_accelerations : whether the accelerations are among them.
    limited : names of the limits. The penetrations of the snubbers follow where it holds "gap", and then the stress
        along the beam where it holds "bending_stress".
    with_impacts : whether the rates and losses of the impacts, and the sliding speeds of friction contacts, are among
        them, before what limits ask for.
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

    def rows(self, template: ExactFlow) -> OutputOf:
        """The outputs by the phases of the contacts, written for a flow."""
        system = self.system
        shapes = np.array([p.shape for p in system.probes]).reshape(-1, system.dynamics.size)
        count = len(system.snubbers)
        displacement = displacements(template, shapes)
        rubbing = friction_contacts(system)
        of_limits: list[LinearOutput] = []
        if "gap" in self.limited:
            of_limits.append(template.penetrations[0].some(slice(count)))
        if "bending_stress" in self.limited and system.stress is not None:
            of_limits.append(bending_stress(template, system.stress))

        def output_of(phases: Ints) -> LinearOutput:
            parts = [displacement, template.contact_forces(phases).some(slice(count))]
            if self.with_accelerations:
                parts.append(accelerations(template, shapes, phases, system.carried))
            if self.with_impacts:
                parts.append(_impact_rows(template, phases, count))
                if rubbing.size:
                    parts.append(sliding_speeds(template, rubbing, phases))
                    parts.append(_wear_rows(template, phases))
            of_outputs = [asked_for(template, system.linear_outputs, phases)] if system.linear_outputs else []
            return stack(*parts, *of_limits, *of_outputs)

        return output_of

    def _groups(self) -> dict[str, slice]:
        """Columns of each group of outputs, in the order of `rows`."""
        system, probes, snubbers = self.system, len(self.system.probes), len(self.system.snubbers)
        losses = loss_owner(self._contacts).size
        stations = 0 if system.stress is None else system.stress.row.shape[0]
        sizes = {
            "displacement": probes,
            "force": snubbers,
            "acceleration": probes * self.with_accelerations,
            "impacts": (snubbers + losses) * self.with_impacts,
            "sliding": friction_contacts(system).size * self.with_impacts,
            "wear": 2 * self._contacts.pressed.size * self.with_impacts,
            "gap": snubbers * ("gap" in self.limited),
            "bending_stress": stations * ("bending_stress" in self.limited),
            "outputs": len(system.linear_outputs),
        }
        ends = np.cumsum(list(sizes.values())).tolist()
        return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}

    @property
    def searched(self) -> Ints:
        """Numbers of the outputs whose extremes are asked for: all but what losses and sliding follow from by means."""
        groups, count = self._groups(), len(self.system.snubbers)
        means = [np.arange(groups["impacts"].start + count, groups["impacts"].stop)] if self.with_impacts else []
        means += [np.arange(groups[name].start, groups[name].stop) for name in ("sliding", "wear")]
        return np.setdiff1d(np.arange(groups["outputs"].stop), np.concatenate(means))

    def _named(self, group: str) -> dict[str, int]:
        """Columns of a group by name of probe, snubber or output."""
        of = self._groups()[group]
        if group == "force":
            names = [snubber.name for snubber in self.system.snubbers]
        elif group == "outputs":
            names = [output.name for output in self.system.linear_outputs]
        else:
            names = [probe.name for probe in self.system.probes]
        return dict(zip(names, range(of.start, of.stop), strict=False))  # there may be no accelerations

    def column(self, section: str, item: str, quantity: str) -> int:
        """Column of a probe's displacement or acceleration, of a snubber's force, or of an output."""
        return self._named("outputs" if section == "outputs" else quantity)[item]

    def curve(self, values: CycleValues, **fields: Any) -> SweepCurve:
        """The curve of these values; ``fields`` are the other fields of `SweepCurve`."""
        force, outputs = self._named("force"), self.system.linear_outputs
        before = self._groups()["outputs"].start
        values, of_outputs = values.columns(slice(before)), values.columns(slice(before, None))

        def envelopes(columns: dict[str, int], quantity: str, unit: str) -> dict[str, Envelope]:
            return {
                name: Envelope(
                    quantity, unit, values.high[:, k], values.low[:, k],
                    np.sqrt(np.maximum(values.mean_square[:, k], 0.0)), values.mean[:, k], values.harmonics[:, :, k],
                )
                for name, k in columns.items()
            }  # fmt: skip

        return SweepCurve(
            displacement=envelopes(self._named("displacement"), "displacement", "m"),
            acceleration=envelopes(self._named("acceleration"), "absolute_acceleration", "m/s^2"),
            force=envelopes(force, "force", "N"),
            contact_share={name: values.contact_share[:, k] for k, name in enumerate(force)},
            contacts={name: values.closings[:, k] for k, name in enumerate(force)},
            bent=bent(values.contact_share[:, len(force) :]),
            impacts=self._impacts(values),
            sliding=self._sliding(values),
            outputs={
                output.name: OutputEnvelope(
                    output.name,
                    output.kind,
                    output.unit,
                    output.at,
                    of_outputs.high[:, k],
                    of_outputs.low[:, k],
                    np.sqrt(np.maximum(of_outputs.mean_square[:, k], 0.0)),
                    of_outputs.mean[:, k],
                    of_outputs.harmonics[:, :, k],
                )
                for k, output in enumerate(outputs)
            },
            **self._of_limits(values),
            **fields,
        )

    def _impacts(self, values: CycleValues) -> dict[str, CycleImpacts]:
        """Impacts by snubber, from rates in contact and from outputs whose squares are the power lost."""
        if not self.with_impacts:
            return {}
        force = self._named("force")
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
        gap, stress = self._groups()["gap"], self._groups()["bending_stress"]
        fields: dict[str, Any] = {}
        if "gap" in self.limited:
            fields["peak_gap"] = {name: -values.low[:, gap.start + k] for k, name in enumerate(self._named("force"))}
        if stress.stop > stress.start:
            extremes = np.abs(values.high[:, stress]), np.abs(values.low[:, stress])
            fields["peak_bending_stress"] = np.maximum(*extremes).max(axis=1)
        return fields

    def history(self, time: Floats, values: Floats) -> SweepHistory:
        """The time history of outputs (nt, K)."""
        groups = (self._named(group) for group in ("displacement", "acceleration", "force"))
        return SweepHistory(time, *({name: values[:, k] for name, k in columns.items()} for columns in groups))


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
    return (normal + speed).above(normal + (-speed)).some(pairs)


def _impact_rows(flow: ExactFlow, phases: Ints, snubbers: int) -> LinearOutput:
    """Penetration rates of the snubbers in contact, 0 elsewhere, and outputs whose squares are the power lost."""
    contacts, rate = flow.system.contacts, flow.penetrations[1]
    moved = stack(rate, flow.internal_rates(phases)) if contacts.internal_states else rate
    rows = stack(rate.some(slice(snubbers)), moved)
    touching = contacts.touching(phases)[:snubbers].astype(float)
    factor = np.concatenate([touching, np.sqrt(np.concatenate(contacts.losses(phases)))])[:, None]
    return rows.scaled(factor)
