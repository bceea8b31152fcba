"""Branches of forced motions: measured values along them, their labelled datasets and largest values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.labelled import Dataset
from beamsim.orbits.branch import OrbitBranch
from beamsim.orbits.harmonic_balance import truncation
from beamsim.orbits.shooting import STABILITY_MARGIN
from beamsim.responses.jumps import ACCELERATIONS, WithoutLimit, jumps_of_motion, keys_of, without_limit
from beamsim.responses.parameters import ResponseModel
from beamsim.responses.periodic_motion import MeasuredMotion, Measurement, measured_channels
from beamsim.responses.points import ReportedMaximum, with_maxima
from beamsim.results.branch import (
    BRANCHES,
    POINTS,
    endings,
    numbered_points,
    of_multipliers,
    of_states,
    special_points_table,
    special_row,
)
from beamsim.results.values import (
    DISPLACEMENT,
    LIMITED,
    OPENING,
    OUTPUT,
    STRESS,
    Value,
    largest_in,
    margins_along,
    parse_limit,
)
from beamsim.scenario.sweep import HarmonicBalance
from beamsim.system.equations import ChannelSet
from beamsim.typing import Bools, Complexes, Floats, Ints, not_none


@dataclass(frozen=True)
class MeasuredBranch:
    """A branch of np forced motions with their measured values."""

    branch: OrbitBranch
    motions: Sequence[MeasuredMotion]
    level: float  # NaN if it is the parameter
    period_multiple: int
    multipliers: Complexes  # (np, m)
    stable: Bools  # (np,)
    truncation: Floats | None = None  # (np,) size of the neglected harmonics, of harmonic balance
    without_limit: tuple[WithoutLimit, ...] = ()  # of the largest accelerations of stable motions


def response(model: ResponseModel, branch: OrbitBranch, level: float) -> MeasuredBranch:
    """Peaks, harmonics, forces and stability along a branch.

    Parameters
    ----------
    model : whose motions they are.
    branch : the branch.
    level : of the excitation.

    Returns
    -------
    MeasuredBranch
        With points at the reported maxima.
    """
    f, system, problem = model.followed, model.system, branch.problem
    settings, limits = model.settings, model.scenario.limits
    channels = measured_channels(system, () if limits is None else limits.model_fields_set)
    moved = None if f.moved_snubber is None else f.system
    measurement = Measurement(system, model.scenario.sine, channels, settings.stored_harmonics, moved)
    branch, motions = with_maxima(
        branch, lambda points: measurement.of(problem, points), _reported_maxima(model, channels)
    )
    spectra = [problem.multipliers(point) for point in branch.points]
    count = min((mu.size for mu in spectra), default=0)
    multipliers = np.array([mu[:count] for mu in spectra])
    stable = np.abs(multipliers).max(axis=1, initial=0.0) <= 1.0 + STABILITY_MARGIN
    by_balance = isinstance(settings.method, HarmonicBalance)
    return MeasuredBranch(
        branch,
        motions,
        level=float("nan") if f.kind == "level" else level,
        period_multiple=problem.multiple,
        multipliers=multipliers,
        stable=stable,
        truncation=np.array([truncation(problem, point) for point in branch.points]) if by_balance else None,
        without_limit=tuple(_without_limit(measurement, branch, motions, stable)) if system.jumping_forces else (),
    )


def _without_limit(
    measurement: Measurement, branch: OrbitBranch, motions: Sequence[MeasuredMotion], stable: Bools
) -> Iterator[WithoutLimit]:
    """Largest accelerations of stable motions that grow with the number of modes, since forces jump.

    Empty for motions that are known by harmonics or in time steps alone.
    """
    numbers, found = np.flatnonzero(stable), dict[int, dict[tuple[str, str], float]]()
    for channel, column in measurement.channels.first_columns if numbers.size else ():
        if channel.key in ACCELERATIONS:
            peaks = [motions[number].peak[column] for number in numbers.tolist()]
            largest = int(np.argmax(peaks))
            found.setdefault(int(numbers[largest]), {})[channel.section, channel.name] = float(peaks[largest])
    for number, peaks_of in found.items():
        if (motion := measurement.trajectory(branch, number)) is None:
            return
        system, trajectory = motion
        yield from without_limit(system, [*jumps_of_motion(system, trajectory)], peaks_of)


def _reported_maxima(model: ResponseModel, channels: ChannelSet) -> list[ReportedMaximum[MeasuredMotion]]:
    """Quantities whose maxima get a point: peak displacements of probes, and limited values of stable motions."""

    def largest_of(value: Value, columns: Ints) -> Callable[[MeasuredMotion], float]:
        none, of = np.zeros(columns.size), not_none(value.from_extreme)
        return lambda m: float(of(np.array([m.low[columns], none, m.high[columns], none])).max())

    displacements, limits = channels.places[DISPLACEMENT], model.scenario.limits
    maxima = [ReportedMaximum(largest_of(LIMITED["peak_displacement"], each), False) for each in displacements[:, None]]
    for name in () if limits is None else limits.values_by_name:
        value, place = parse_limit(name)
        columns = [k for each, k in channels.first_columns if value.is_extreme_of(each) and place in ("", each.name)]
        some = [np.array(columns)] if value.single else [np.array([k]) for k in columns]
        if value.section == "rings":
            some = [*_columns_of_rings(channels, value, place)]
        maxima += [ReportedMaximum(largest_of(value, each), True) for each in some if each.size]
    return maxima


def _columns_of_rings(channels: ChannelSet, value: Value, place: str) -> Iterator[Ints]:
    """Columns of a value of each ring, or of the ring with a name."""
    for each, k in channels.first_columns:
        if value.is_extreme_of(each) and place in ("", each.name):
            yield np.arange(k, k + each.columns)


def response_datasets(model: ResponseModel, branches: Sequence[MeasuredBranch]) -> dict[str, Dataset]:
    """The datasets of branches, of their points and of their special points, by name.

    Parameters
    ----------
    model : whose motions they are.
    branches : in order.
    """
    f, system = model.followed, model.system
    followed = f.kind == "frequency"
    parameters = [np.asarray(f.from_unknown(branch.branch.values), dtype=float) for branch in branches]
    parameter, motions = np.concatenate(parameters), [motion for branch in branches for motion in branch.motions]
    special = [
        [
            special_row(each, at, at if followed else model.frequency_hz, system.contact_names)
            for each in branch.branch.special
            for at in [float(f.from_unknown(each.parameter))]
        ]
        for branch in branches
    ]
    states = np.array([orbit.state for branch in branches for orbit in branch.branch.orbits])
    harmonics = np.array([motion.harmonics for motion in motions]).swapaxes(0, 1)
    limits = model.scenario.limits
    channels = measured_channels(system, () if limits is None else limits.model_fields_set)
    by_balance = any(branch.truncation is not None for branch in branches)
    values = {
        **numbered_points([len(branch.motions) for branch in branches]),
        **of_states(states, system.dynamics.size),
        **of_multipliers([branch.multipliers for branch in branches]),
        "frequency_hz": parameter.copy() if followed else np.full(parameter.size, model.frequency_hz),
        "parameter": parameter,
        "residual": [point.residual for branch in branches for point in branch.branch.points],
        "stable": np.concatenate([branch.stable for branch in branches]),
        "energy_error": [motion.energy_error for motion in motions],
        "probe": [probe.name for probe in system.probes],
        "snubber": [snubber.name for snubber in system.snubbers],
        "contact_share": np.array([motion.contact_share for motion in motions]).T,
        "harmonic": np.arange(harmonics.shape[2]),
        "harmonic_displacement_real": harmonics.real,
        "harmonic_displacement_imag": harmonics.imag,
        "neglected_harmonics": np.concatenate([not_none(b.truncation) for b in branches]) if by_balance else None,
        **_extremes(model, channels, np.array([(motion.high, motion.low) for motion in motions])),
    }
    outputs = [each for each in channels.channels if each.section == "outputs"]
    of_members = {
        "snubber": [{"force_unit": snubber.force_unit} for snubber in system.snubbers],
        "output": [{"unit": each.unit} for each in outputs],
    }
    return {
        "branches": _branches(model, branches),
        "points": POINTS.dataset(values, of_members, unit=f.unit, parameter=f"parameter of the branch: {f.label}"),
        "special_points": special_points_table(special, f.unit),
    }


def _branches(model: ResponseModel, branches: Sequence[MeasuredBranch]) -> Dataset:
    """A row for each branch."""
    f, count = model.followed, len(branches)
    values = {
        "branch": np.arange(count),
        "kind": ["response"] * count,
        "level": [branch.level for branch in branches],
        "period_multiple": [branch.period_multiple for branch in branches],
        "followed": f.kind,
        "followed_snubber": f.snubber,
        **endings(f.in_user_unit(branch.branch.outcome) for branch in branches),
    }
    return BRANCHES.dataset(values, level_unit=model.scenario.level_unit or "1")


def _extremes(model: ResponseModel, channels: ChannelSet, ends: Floats) -> dict[str, Any]:
    """The values of extremes of channels.

    Parameters
    ----------
    model : whose motions they are.
    channels : C columns.
    ends : (points, 2, C) largest and smallest values.
    """
    values: dict[str, Any] = {}
    for section, quantity in (("probes", "displacement"), ("probes", "absolute_acceleration"), ("snubbers", "force")):
        columns = [k for each, k in channels.first_columns if each.key == (section, quantity)]
        if columns:
            high, low = ends[:, 0, columns].T, ends[:, 1, columns].T
            largest = np.maximum(np.abs(high), np.abs(low))
            values |= {f"max_{quantity}": high, f"min_{quantity}": low, f"peak_{quantity}": largest}
    opening, stress = channels.split(ends[:, 0]).get(OPENING), channels.split(np.abs(ends).max(axis=1)).get(STRESS)
    if opening is not None:
        in_metres = np.array([snubber.gap_unit == "m" for snubber in model.system.snubbers])
        values["peak_gap"] = np.where(in_metres[:, None], opening.T, np.nan)
    if model.system.springs and model.system.rings:
        from beamsim.system.rings import ring_columns

        values |= ring_columns(model.system.rings, channels, ends[:, 0], ends[:, 1])
    outputs = [(each, k) for each, k in channels.first_columns if each.section == "outputs"]
    return values | {
        "peak_bending_stress": None if stress is None else stress.max(axis=1),
        "output": [each.name for each, _ in outputs],
        "output_quantity": [each.quantity for each, _ in outputs],
        "output_unit": [each.unit for each, _ in outputs],
        "output_at": [each.at for each, _ in outputs],
        "output_maximum": ends[:, 0, [k for _, k in outputs]].T,
        "output_minimum": ends[:, 1, [k for _, k in outputs]].T,
    }


def largest_values(model: ResponseModel, points: Dataset) -> dict[str, Any]:
    """Largest values of all stable motions by name, and margins, for the summary."""
    entries: dict[str, Any] = {}
    found = list(largest_in([points], "parameter", "stable"))
    for value, name, largest, parameter in found:
        if value is OUTPUT:
            entries.setdefault(value.entry, {})[name] = {"value": largest, "parameter": parameter}
        elif value.in_sweeps and value.key != DISPLACEMENT:
            entries.setdefault(value.entry, {})[name] = largest / value.scale
    if model.system.outputs:
        entries["output_unit"] = {rows.name: rows.unit for rows in model.system.outputs}
    limits, unit = model.scenario.limits, model.followed.unit
    margins = margins_along(limits, ((value, name, size, f"{at:.4g} {unit}") for value, name, size, at in found))
    return {**entries, "margins": margins}


def growing_with_modes(branches: Sequence[MeasuredBranch]) -> list[str] | None:
    """``entry.place`` of the largest values that grow with the number of modes; None without any.

    Parameters
    ----------
    branches : whose largest values are reported.
    """
    channels = [each.channel for branch in branches for each in branch.without_limit]
    keys = [".".join(key) for channel in channels for key in keys_of(channel) if key[0].startswith("peak")]
    return list(dict.fromkeys(keys)) or None
