"""Channels of one level of a sweep, and the curve of their values in every cycle."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from beamsim.analyses.sweep.cycles import CycleRecord
from beamsim.analyses.sweep.layouts import CYCLES, FOLLOWED, HISTORIES, LEVELS
from beamsim.analyses.sweep.peaks import cycles_with_breakpoint
from beamsim.analyses.sweep.result import SweepCurve
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.sliders import FORWARDS, STICK, sliding_limit, snap
from beamsim.contacts.snubbers import FRICTION
from beamsim.flow.channels import outputs_of
from beamsim.flow.exact import ExactFlow
from beamsim.inputs.measured import limit_curve
from beamsim.labelled import Dataset
from beamsim.outcomes import Outcome
from beamsim.responses.jumps import ForceJumps, Waves, accelerations
from beamsim.results.values import ACCELERATION, DISPLACEMENT, FORCE, LIMITED, OPENING, STRESS, of_ring
from beamsim.scenario.quantities import amplitude_unit, level_unit
from beamsim.scenario.reporting import Limits
from beamsim.scenario.sweep import SteppedSine, SweptSine
from beamsim.system.equations import Channel, ChannelSet, Key, RowsOf, StateEquations
from beamsim.system.structural import StructuralSystem, contact_units
from beamsim.typing import Floats, Ints


@dataclass(frozen=True)
class LevelRun:
    """Results of one level in all directions."""

    curves: tuple[SweepCurve, ...]
    level: Dataset  # its row of `LEVELS`
    history: Dataset | None = None  # its rows of `HISTORIES`


def level_row(
    level: SweepLevel, outcome: Outcome, columns: Mapping[str, Any], aliased: Mapping[str, Any] | None = None
) -> Dataset:
    """Row of `LEVELS` for one level.

    Parameters
    ----------
    level : the level.
    outcome : outcome of the level.
    columns : work of the solver and other columns.
    aliased : aliased content of a stored history, see `SweepLevel.aliased_columns`.
    """
    values = {
        "level_index": level.index, "level": float(level.value), **outcome.as_texts(), "status": outcome.of_part,
        **columns,
    }  # fmt: skip
    return LEVELS.dataset(
        {name: [value] for name, value in values.items()} | dict(aliased or {}), level_unit=level.level_unit or "1"
    )


@dataclass(frozen=True)
class SweepLevel:
    """One level of a sweep with its evaluated channels, followed by the columns for impacts and sliding.

    Parameters
    ----------
    system : its probe displacements, snubber forces, and outputs other than energies are evaluated.
    settings : whether probe accelerations, and rates and losses of impacts with sliding speeds, are evaluated too.
    value : level of the excitation; with a profile, the factor on it.
    index : index of the level.
    limited : names of limited quantities: "gap" adds the openings of the snubbers, "bending_stress" the stress along
        the bodies.
    """

    system: StructuralSystem
    settings: SweptSine | SteppedSine
    value: float
    index: int
    limited_quantities: Collection[str] = ()

    @property
    def quantity(self) -> str:
        """The prescribed quantity."""
        return self.system.scenario.sine.quantity or "acceleration"

    @property
    def level_unit(self) -> str:
        """SI unit of the level; empty if it is the factor on a profile."""
        return "" if isinstance(self.settings, SweptSine) and self.settings.profile else level_unit(self.quantity)

    @cached_property
    def channels(self) -> ChannelSet:
        """Channels with extremes, means and harmonics."""
        asked = {value.key for name, value in LIMITED.items() if value.in_sweeps or name in self.limited_quantities}
        if not self.settings.accelerations:
            asked.discard(ACCELERATION)

        def is_evaluated(channel: Channel) -> bool:
            return channel.key in asked or (channel.section == "outputs" and not channel.squared) or of_ring(channel)

        return self.system.channels.select(is_evaluated)

    def rows(self, template: ExactFlow) -> RowsOf:
        """Rows of all columns as a function of the contacts' phases, in the form that a flow takes."""
        count, rubbing = len(self.system.snubbers), self.system.friction_contacts
        channels = outputs_of(template, self.channels.linear)
        if not self.settings.impacts:
            return channels

        def output_of(phases: Ints) -> Floats:
            at = template.at(phases)
            return np.vstack([channels(phases), _impact_rows(at, count), at.sliding_speeds[rubbing], _wear_rows(at)])

        return output_of

    @cached_property
    def _columns_after_channels(self) -> tuple[Ints, ...]:
        """Columns of impacts, sliding speeds and wear, which follow the channels in `rows`."""
        contacts, first = self.system.dynamics.contacts, self.channels.order.size
        impacts = len(self.system.snubbers) + loss_owner(contacts).size
        sizes = [impacts, self.system.friction_contacts.size, 2 * _dissipative_contacts(contacts).size]
        return tuple(np.split(first + np.arange(sum(sizes)), np.cumsum(sizes)[:-1]))

    @property
    def searched_columns(self) -> Ints:
        """Columns whose extremes are searched: the channels, and the rates of impacts."""
        return np.arange(self.channels.order.size + len(self.system.snubbers) * self.settings.impacts)

    def _columns_by_name(self, key: Key, unit: str = "") -> dict[str, int]:
        """Columns of one key by name of the probe, snubber or output; of one unit if it is given."""
        return {c.name: k for c, k in self.channels.first_columns if c.key == key and unit in ("", c.unit)}

    def curve(
        self, record: CycleRecord, direction: str, values: Mapping[str, Any],
        tables: Mapping[str, Dataset] | None = None,
    ) -> SweepCurve:  # fmt: skip
        """Build the curve of one direction.

        Parameters
        ----------
        record : values of the C cycles.
        direction : "up" or "down".
        values : further columns of `CYCLES`, such as frequency_hz and time.
        tables : further datasets of the curve, from `OF_CURVES`.

        Returns
        -------
        SweepCurve
        """
        snubbers, count = self.system.snubbers, record.count
        columns: dict[str, Any] = {
            "cycle": 1 + np.arange(count), "curve": np.zeros(count, dtype=np.int64), **values,
            "order": np.array(self.settings.tracked_orders), **self._quantity_columns(record, values["frequency_hz"]),
            **self._output_columns(record),
        }  # fmt: skip
        if self.system.probes:
            rest = self.system.static_equilibrium
            at_rest = [0.0 if rest is None else float(probe.shape @ rest) for probe in self.system.probes]
            columns |= {"probe": [probe.name for probe in self.system.probes], "static_displacement": at_rest}
        if snubbers:
            columns |= {
                "snubber": [snubber.name for snubber in snubbers],
                "contact_share": record.contact_share[:, : len(snubbers)].T,
                "contacts": record.closings[:, : len(snubbers)].T,
            }
        if record.contact_share.shape[1] > len(snubbers):
            columns["spring_changes"] = cycles_with_breakpoint(record.contact_share[:, len(snubbers) :])
        columns |= self._ring_columns(record) if self.system.springs and self.system.rings else {}
        columns |= self._jumps(record, values["time"]) if self.system.jumping_forces else {}
        if "gap" in self.limited_quantities:
            opening = self._columns_by_name(OPENING, "m")
            unknown = np.full(count, np.nan)
            gaps = [record.high[:, opening[s.name]] if s.name in opening else unknown for s in snubbers]
            columns["peak_gap"] = np.array(gaps).reshape(len(snubbers), count)
        if (stress := self.channels.places.get(STRESS)) is not None:
            extremes = np.abs(record.high[:, stress]), np.abs(record.low[:, stress])
            columns["peak_bending_stress"] = np.maximum(*extremes).max(axis=1)
        if self.settings.impacts:
            columns |= self._impacts(record) | self._sliding(record)
        outputs = [c for c, _ in self.channels.first_columns if c.section == "outputs"]
        of_members = {
            "snubber": [contact_units(snubber.gap_unit) for snubber in snubbers],
            "output": [{"unit": output.unit} for output in outputs],
        }
        cycles = CYCLES.dataset(columns, of_members, excitation_unit=amplitude_unit(self.quantity))
        return SweepCurve(
            name=f"{direction}_{self.index}", kind=self.settings.kind, direction=direction, level_index=self.index,
            level=float(self.value), level_unit=self.level_unit, quantity=self.quantity,
            tables={"cycles": cycles, **(tables or {})},
        )  # fmt: skip

    def _ring_columns(self, record: CycleRecord) -> dict[str, Any]:
        from beamsim.system.rings import ring_columns

        return ring_columns(self.system.rings, self.channels, record.high, record.low)

    def _quantity_columns(self, record: CycleRecord, frequency_hz: Floats) -> dict[str, Any]:
        """Extremes, means, harmonics and limits over frequency."""
        scenario, columns = self.system.scenario, dict[str, Any]()
        called = {each.unit: name for name, each in Limits.curves["response"].items()}
        for quantity, dim in FOLLOWED.items():
            located = [(c, k) for c, k in self.channels.first_columns if c.key == (f"{dim}s", quantity)]
            if not located:
                continue
            numbers = [k for _, k in located]
            columns |= {name.format(quantity): of for name, of in self._statistics(record, numbers).items()}
            limits = [
                limit_curve(scenario, "response", c.name, called.get(c.unit, ""), frequency_hz) for c, _ in located
            ]
            if any(limit is not None for limit in limits):
                unknown = np.full(frequency_hz.size, np.nan)
                columns[f"limit_{quantity}"] = np.array([unknown if each is None else each for each in limits])
        return columns

    def _jumps(self, record: CycleRecord, time: Floats) -> dict[str, Any]:
        """Jumps of accelerations, (k, C), from the jumps of contact forces."""
        system, waves = self.system, Waves.of(self.system)
        of_contacts = [force for force in system.jumping_forces if force.contact >= 0]
        jumps = [ForceJumps(force, time, *record.jumps[:, :, force.contact].T) for force in of_contacts]

        def largest(channels: list[Channel]) -> Floats:
            found = np.zeros((len(channels), record.count))
            own = np.array([channel in grows for channel in channels])
            for of in jumps if own.any() else ():
                sizes = waves.accelerations(system, [c for c in channels if c in grows], of)
                found[own] = np.maximum(found[own], sizes)
            return found

        grows = accelerations(system)
        probes, outputs = (
            [c for c, _ in self.channels.first_columns if c.section == of] for of in ("probes", "outputs")
        )
        probes = [channel for channel in probes if channel.key == ACCELERATION]
        named = {"acceleration_jump": probes, "output_jump": outputs}
        return {name: largest(of) for name, of in named.items() if of}

    def _output_columns(self, record: CycleRecord) -> dict[str, Any]:
        """Outputs with their extremes, means and harmonics."""
        outputs = [(c, k) for c, k in self.channels.first_columns if c.section == "outputs"]
        if not outputs:
            return {}
        of = self._statistics(record, [k for _, k in outputs])
        return {
            "output": [c.name for c, _ in outputs],
            "output_quantity": [c.quantity for c, _ in outputs],
            "output_unit": [c.unit for c, _ in outputs],
            "output_at": [c.at for c, _ in outputs],
            "output_maximum": of["max_{}"],
            "output_minimum": of["min_{}"],
            "output_rms": of["rms_{}"],
            "output_mean": of["mean_{}"],
            "output_harmonics_real": of["harmonic_{}_real"],
            "output_harmonics_imag": of["harmonic_{}_imag"],
        }

    def _statistics(self, record: CycleRecord, columns: list[int]) -> dict[str, Any]:
        """Statistics of k columns: extremes, root mean square and mean (k, C), harmonics (k, R, C).

        Keys are names of variables with ``{}`` in place of the quantity.
        """
        high, low, harmonic = record.high[:, columns].T, record.low[:, columns].T, record.harmonic[:, columns]
        amplitudes = np.moveaxis(harmonic[:, :, 1:], 0, 2)
        return {
            "max_{}": high, "min_{}": low, "peak_{}": np.maximum(np.abs(high), np.abs(low)),
            "rms_{}": np.sqrt(np.maximum(record.mean_square[:, columns], 0.0)).T, "mean_{}": harmonic[:, :, 0].real.T,
            "harmonic_{}_real": amplitudes.real, "harmonic_{}_imag": amplitudes.imag,
        }  # fmt: skip

    def _impacts(self, record: CycleRecord) -> dict[str, Any]:
        """Impacts at the m snubbers, (m, C) each.

        They follow from rates in contact and from outputs whose squares are the dissipated power; for a snubber that
        yields, from the product of rate and dissipated force.
        """
        force = self._columns_by_name(FORCE)
        yielding = self._mean_products(record)
        rates, losses = np.split(self._columns_after_channels[0], [len(force)])
        owner = loss_owner(self.system.dynamics.contacts)
        period, rows = record.duration / record.cycles, []
        for k, column in enumerate(force.values()):
            per_cycle = record.closings[:, k] / record.cycles
            with np.errstate(divide="ignore", invalid="ignore"):
                time = np.where(per_cycle > 0, record.contact_share[:, k] * period / per_cycle, np.nan)
            lost = yielding.get(k, record.mean_square[:, losses[owner == k]].sum(axis=1))
            rows.append({
                "impact_number": per_cycle,
                "impact_contact_time": time,
                "impact_impulse": record.harmonic[:, column, 0].real * period,
                "impact_energy_lost": np.maximum(lost, 0.0) * period,
                "impact_penetration_rate": record.high[:, rates[k]],
            })  # fmt: skip
        return _stack_rows(rows)

    def _mean_products(self, record: CycleRecord) -> dict[int, Floats]:
        """Mean dissipated powers of `_dissipative_contacts`, W; for friction under a snubber, per unit coefficient."""
        square = record.mean_square[:, self._columns_after_channels[2]]
        return dict(
            zip(
                _dissipative_contacts(self.system.dynamics.contacts).tolist(),
                (square[:, ::2] - square[:, 1::2]).T,
                strict=True,
            )
        )

    def _sliding(self, record: CycleRecord) -> dict[str, Any]:
        """Sliding of the k friction contacts, (k, C) each, from mean sliding speeds and numbers of sliding phases.

        Under the force of a snubber: from the mean of force times speed, and from the force at the start of sliding. If
        the friction force falls with speed, the loss is the mean of both.
        """
        which, contacts = self.system.friction_contacts, self.system.dynamics.contacts
        springs = [spring for spring in self.system.springs if spring.kind == FRICTION]
        _, columns, _ = self._columns_after_channels
        period, wear = record.duration / record.cycles, self._mean_products(record)
        begun = dict(zip(contacts.pressed_contacts.tolist(), record.pressing.T / record.cycles, strict=True))
        rows, names = [], []
        for column, j, spring in zip(columns.tolist(), which.tolist(), springs, strict=True):
            normal, law = spring.normal_force, contacts.laws[j]
            sliding, begins = sliding_limit(law), snap(law)
            loss, pressed_loss = law.arrays.event_loss[STICK, FORWARDS]
            slides = record.closings[:, j] / record.cycles
            moved = record.harmonic[:, column, 0].real * period
            if normal is None:  # in units of the normal force
                force, squared = begun[j]
                distance = moved + begins * force
                lost = sliding * wear[j] * period + pressed_loss * squared
                power = wear[j] + begins * squared / period
            else:
                distance = moved + slides * begins
                lost = wear[j] * period if j in wear else sliding * moved + slides * loss
                power = normal * distance / period
            names.append(spring.name)
            rows.append({
                "friction_slides": slides, "friction_distance": distance, "friction_energy_lost": lost,
                "friction_wear_power": power,
            })  # fmt: skip
        return {"friction": names, **_stack_rows(rows)} if names else {}

    def history(self, time: Floats, values: Floats) -> Dataset:
        """Time history of all columns, (nt, K)."""
        columns: dict[str, Any] = {
            "sample": 1 + np.arange(time.size), "level": np.zeros(time.size, dtype=np.int64), "time": time,
        }  # fmt: skip
        for dim, quantity, key in (
            ("probe", "displacement", DISPLACEMENT), ("probe", "absolute_acceleration", ACCELERATION),
            ("snubber", "force", FORCE),
        ):  # fmt: skip
            if located := self._columns_by_name(key):
                columns |= {dim: list(located), quantity: values[:, list(located.values())].T}
        units = [contact_units(snubber.gap_unit) for snubber in self.system.snubbers]
        return HISTORIES.dataset(columns, {"snubber": units})

    def aliased_columns(self, shares: Floats) -> dict[str, Any]:
        """Columns of `LEVELS` with the shares (K,) of each column above half the sample rate of a history."""
        located = self._columns_by_name(DISPLACEMENT)
        return {"probe": list(located), "aliased_displacement": shares[None, list(located.values())]}


def _stack_rows(rows: list[dict[str, Floats]]) -> dict[str, Any]:
    """Values of all rows, by name; empty without rows."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]} if rows else {}


def loss_owner(contacts: Contacts) -> Ints:
    """(m + r,) contact of each output whose square is a dissipated power: dashpots, then internal states."""
    return np.concatenate([np.arange(contacts.count), np.repeat(np.arange(contacts.count), contacts.state_counts)])


def _dissipative_contacts(contacts: Contacts) -> Ints:
    """Contacts that dissipate by varying forces: friction under a snubber, then those that yield or weaken."""
    return np.concatenate([contacts.pressed_contacts, contacts.lossy])


def _wear_rows(at: StateEquations) -> Floats:
    """Rows for the mean dissipated powers.

    For each friction contact under a snubber two rows, whose squares differ by the normal force times the sliding
    speed, N m/s; for contacts that yield or weaken, the dissipated force times their speed.
    """
    contacts = at.equations.contacts
    pressed, lossy = contacts.pressed_contacts, contacts.lossy
    slides = np.abs(contacts.sliding_directions(at.phases)[pressed, None])
    force = 0.5 * np.vstack([slides * at.normal_force, at.dissipation[0][lossy]])
    speed = 0.5 * np.vstack([at.sliding_speeds[pressed], at.dissipation[1][lossy]])
    pairs = np.arange(2 * speed.shape[0]).reshape(2, -1).T.ravel()
    return np.vstack([force + speed, force - speed])[pairs]


def _impact_rows(at: StateEquations, snubbers: int) -> Floats:
    """Penetration rates of the snubbers in contact (else 0), and rows whose squares are the dissipated power."""
    rate = at.equations.penetration_rate
    touching = at.equations.contacts.closed(at.phases)[:snubbers, None]
    size = np.sqrt(np.maximum(at.lost_by_rate, 0.0))[:, None]
    return np.vstack([touching * rate[:snubbers], size * np.vstack([rate, at.internal_rates])])
