"""The result file of ``beamsim sweep``.

``/<direction>_<level index>`` holds one curve: ``frequency_hz``, the orders, envelopes and tracked harmonics of every
probe and contact force against it, and of a stepped sweep what was found at every frequency. ``/linear`` is the
steady response without snubbers to a unit of excitation, ``/peaks`` the table of peaks, ``/level_<index>`` the work
and, where it was asked for, the time history of a level. Complex numbers are two datasets, ``…_real`` and ``…_imag``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from beamsim.analyses.sweep.result import (
    ContactLevels,
    Envelope,
    LevelWork,
    LinearCurve,
    ResponsePeak,
    SteadyStates,
    SweepCurve,
    SweepHistory,
    SweepResult,
    SweepWork,
)
from beamsim.errors import ResultFileError
from beamsim.store import schema
from beamsim.store.datasets import named_group, native, ordered, put, read_modes, texts, words, write_modes
from beamsim.store.outcomes import outcome_attributes, read_outcome
from beamsim.store.schema import Field
from beamsim.store.stored import LazyScenario, creating, reading, root_fields, write_root

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

COMMAND = "sweep"

_FREQUENCY = Field("frequency_hz", "Hz", "excitation frequency")
_ORDER = Field("order", "1", "order: frequency over excitation frequency")
_TIME = Field("time", "s", "time at the start of the cycle")
_AMPLITUDE = Field("excitation_amplitude", "", "amplitude of the excitation, zero to peak")
_GAP = Field("peak_gap", "m", "largest opening of the contact in the cycle")
_STRESS = Field("peak_bending_stress", "Pa", "largest bending stress along the beam in the cycle")
_PROBE = Field("probe", "1", "name of the probe")
_SHARE = Field("contact_share", "1", "share of the time in contact")
_CONTACTS = Field("contacts", "1", "number of closings")
_PROBES = {"displacement": "m", "absolute_acceleration": "m/s^2"}
_PEAKS = (
    Field("frequency_hz", "Hz", "excitation frequency of the peak"),
    Field("value_m", "m", "peak displacement"),
    Field("level", "", "level of the excitation"),
    Field("order", "1", "order of the harmonic that resonates"),
    Field("share", "1", "share of that harmonic in the peak displacement"),
)
_CONTACT = (
    Field("onset", "1", "level of the excitation, SI, at which the linear motion first makes contact"),
    Field("loss", "1", "level of the excitation, SI, at which the linear motion first loses contact"),
    Field("preload_needed", "1", "N per unit of level: contact force at equilibrium that just keeps contact"),
)
_PEAK_TEXTS = ("curve", "probe", "direction", "kind")
_STEADY = (
    Field("period_cycles", "1", "cycles after which the motion repeats, 0 where it does not"),
    Field("cycles", "1", "cycles computed until the motion was steady"),
    Field("change", "1", "change of the state over a period, over its size"),
    Field("lyapunov_exponent", "1/s", "largest Lyapunov exponent, where the motion is not periodic"),
)


def _envelope_fields(quantity: str, unit: str) -> tuple[Field, ...]:
    named = quantity.replace("_", " ")
    return (
        Field(f"peak_{quantity}", unit, f"largest magnitude of the {named} in a cycle"),
        Field(f"max_{quantity}", unit, f"largest {named} of a cycle"),
        Field(f"min_{quantity}", unit, f"smallest {named} of a cycle"),
        Field(f"rms_{quantity}", unit, f"root mean square of the {named} over a cycle"),
        Field(f"mean_{quantity}", unit, f"mean {named} of a cycle"),
        Field(f"harmonic_{quantity}_real", unit, f"amplitude of cos(order x phase) in the {named}"),
        Field(f"harmonic_{quantity}_imag", unit, f"minus the amplitude of sin(order x phase) in the {named}"),
    )


def write_sweep(result: SweepResult, path: Path | str) -> Path:
    """Write ``result`` to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with creating(path) as file:
        write_root(file, result, COMMAND, kind=result.kind, truncation=result.truncation)
        for curve in result.curves.values():
            write_curve(file.create_group(curve.name), curve)
        _write_linear(file.create_group("linear"), result.linear)
        _write_peaks(file.create_group("peaks"), result)
        for index, level in result.levels.items():
            group = file.create_group(f"level_{index}")
            group.attrs.update({"level": level.level, "truncation": level.truncation})
            group.attrs.update(outcome_attributes(level.outcome))
            group.attrs.update(vars(level.work))
            if index in result.histories:
                _write_history(group, result.histories[index])
        write_modes(file, result.modes)
        file.create_group("work").attrs.update(vars(result.work))
    return Path(path)


def write_curve(group: h5py.Group, curve: SweepCurve) -> None:
    """Write one curve of a sweep."""
    group.attrs.update(
        {
            "direction": curve.direction,
            "level_index": curve.level_index,
            "level": curve.level,
            "quantity": curve.quantity,
        }
    )
    frequency = put(group, _FREQUENCY, curve.frequency_hz, scale=True)
    order = put(group, _ORDER, curve.orders, scale=True)
    put(group, _TIME, curve.time, frequency)
    unit = "N" if curve.quantity == "force" else "m/s^2"
    put(group, _AMPLITUDE._replace(units=unit), curve.excitation_amplitude, frequency)
    for index, name in enumerate(curve.displacement):
        probe = named_group(group, "probes", name, index)
        _write_envelope(probe, curve.displacement[name], frequency, order)
        if name in curve.acceleration:
            _write_envelope(probe, curve.acceleration[name], frequency, order)
    for index, name in enumerate(curve.force):
        snubber = named_group(group, "snubbers", name, index)
        _write_envelope(snubber, curve.force[name], frequency, order)
        put(snubber, _SHARE, curve.contact_share[name], frequency)
        put(snubber, _CONTACTS, curve.contacts[name], frequency)
        if f"gap {name}" in curve.limited:
            put(snubber, _GAP, curve.limited[f"gap {name}"], frequency)
    if "bending_stress" in curve.limited:
        put(group, _STRESS, curve.limited["bending_stress"], frequency)
    if curve.steady is not None:
        _write_steady(group.create_group("steady"), curve.steady, frequency, list(curve.displacement))


def _write_envelope(group: h5py.Group, envelope: Envelope, frequency: h5py.Dataset, order: h5py.Dataset) -> None:
    fields = _envelope_fields(envelope.quantity, envelope.unit)
    values = (envelope.peak, envelope.maximum, envelope.minimum, envelope.rms, envelope.mean)
    for field, value in zip(fields, values, strict=False):
        put(group, field, value, frequency)
    put(group, fields[5], envelope.harmonics.real, order, frequency)
    put(group, fields[6], envelope.harmonics.imag, order, frequency)


def _write_steady(group: h5py.Group, steady: SteadyStates, frequency: h5py.Dataset, names: list[str]) -> None:
    put(group, Field("kind", "1", "periodic, quasi-periodic, chaotic or not settled"), words(steady.kind), frequency)
    for field in _STEADY:
        put(group, field, getattr(steady, field.name), frequency)
    at = Field("poincare_frequency_hz", "Hz", "excitation frequency of each point of the Poincare sections")
    axes = put(group, at, steady.poincare_frequency_hz, scale=True), put(group, _PROBE, words(names), scale=True)
    for name, unit in (("displacement", "m"), ("velocity", "m/s")):
        field = Field(f"poincare_{name}", unit, f"probes' {name} at phase 0")
        put(group, field, getattr(steady, field.name), *axes)


def _write_linear(group: h5py.Group, linear: LinearCurve) -> None:
    frequency = put(group, _FREQUENCY, linear.frequency_hz, scale=True)
    for index, name in enumerate(linear.displacement):
        probe = named_group(group, "probes", name, index)
        for part, value in (("real", linear.displacement[name].real), ("imag", linear.displacement[name].imag)):
            field = Field(f"displacement_{part}", "1", "displacement per unit of excitation, without snubbers")
            put(probe, field, value, frequency)
        for part, value in (("real", linear.acceleration[name].real), ("imag", linear.acceleration[name].imag)):
            field = Field(f"absolute_acceleration_{part}", "1", "absolute acceleration per unit of excitation")
            put(probe, field, value, frequency)

    for index, (name, levels) in enumerate(linear.contact.items()):
        snubber = named_group(group, "snubbers", name, index)
        for field in _CONTACT:
            put(snubber, field, getattr(levels, field.name), frequency)


def _write_peaks(group: h5py.Group, result: SweepResult) -> None:
    number = put(group, Field("peak", "1", "number of the peak"), np.arange(1, len(result.peaks) + 1), scale=True)
    for field in _PEAKS:
        put(group, field, np.array([getattr(p, field.name) for p in result.peaks], dtype=float), number)
    for name in _PEAK_TEXTS:
        put(group, Field(name, "1", f"{name} of the peak"), words([getattr(p, name) for p in result.peaks]), number)


def _write_history(group: h5py.Group, history: SweepHistory) -> None:
    time = put(group, schema.TIME, history.time, scale=True)
    for index, (name, values) in enumerate(history.displacement.items()):
        probe = named_group(group, "probes", name, index)
        put(probe, Field("displacement", "m", "displacement relative to the base"), values, time)
        if name in history.acceleration:
            put(probe, schema.PROBE[3], history.acceleration[name], time)
    for index, (name, values) in enumerate(history.force.items()):
        put(named_group(group, "snubbers", name, index), schema.SNUBBER[0], values, time)


class StoredSweep(LazyScenario, SweepResult):
    """A sweep read from a file."""


def open_sweep(path: Path | str) -> StoredSweep:
    """Read a result file written by ``beamsim sweep`` of one design, swept or stepped.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else.
    """
    with reading(path, "sweep") as file:
        return StoredSweep.of(_fields(file))


def _fields(file: h5py.File) -> dict[str, Any]:
    curves = {name: read_curve(name, group) for name, group in file.items() if "direction" in group.attrs}
    levels, histories = {}, {}
    for name, group in file.items():
        if name.startswith("level_"):
            index = int(name.removeprefix("level_"))
            a = native(group)
            work = SweepWork(**{key: a[key] for key in SweepWork.__dataclass_fields__})
            levels[index] = LevelWork(a["level"], read_outcome(a), a["truncation"], work)
            if "time" in group:
                histories[index] = _read_history(group)
    return {
        **root_fields(file),
        "kind": file.attrs["kind"],
        "truncation": float(file.attrs["truncation"]),
        "curves": dict(sorted(curves.items(), key=lambda item: (item[1].level_index, item[1].direction == "down"))),
        "linear": _read_linear(file["linear"]),
        "peaks": _read_peaks(file["peaks"]),
        "modes": read_modes(file),
        "work": SweepWork(**native(file["work"])),
        "levels": dict(sorted(levels.items())),
        "histories": dict(sorted(histories.items())),
    }


def _read_envelope(group: h5py.Group, quantity: str, unit: str) -> Envelope:
    values = {name: group[f"{name}_{quantity}"][()] for name in ("max", "min", "rms", "mean")}
    harmonics = group[f"harmonic_{quantity}_real"][()] + 1j * group[f"harmonic_{quantity}_imag"][()]
    return Envelope(quantity, unit, values["max"], values["min"], values["rms"], values["mean"], harmonics)


def read_curve(name: str, group: h5py.Group) -> SweepCurve:
    """Inverse of `write_curve`."""
    probes, snubbers = ordered(group, "probes"), ordered(group, "snubbers")
    steady = None
    if "steady" in group:
        s = group["steady"]
        steady = SteadyStates(
            kind=tuple(s["kind"].asstr()[()].tolist()),
            **{field.name: s[field.name][()] for field in _STEADY},
            **{key: s[key][()] for key in ("poincare_frequency_hz", "poincare_displacement", "poincare_velocity")},
        )
    limited = {f"gap {g.attrs['name']}": g[_GAP.name][()] for g in snubbers if _GAP.name in g}
    if _STRESS.name in group:
        limited["bending_stress"] = group[_STRESS.name][()]
    return SweepCurve(
        name=name,
        direction=group.attrs["direction"],
        level_index=int(group.attrs["level_index"]),
        level=float(group.attrs["level"]),
        quantity=group.attrs["quantity"],
        frequency_hz=group["frequency_hz"][()],
        time=group["time"][()],
        excitation_amplitude=group["excitation_amplitude"][()],
        orders=group["order"][()],
        displacement={g.attrs["name"]: _read_envelope(g, "displacement", "m") for g in probes},
        acceleration={
            g.attrs["name"]: _read_envelope(g, "absolute_acceleration", "m/s^2")
            for g in probes
            if "peak_absolute_acceleration" in g
        },
        force={g.attrs["name"]: _read_envelope(g, "force", "N") for g in snubbers},
        contact_share={g.attrs["name"]: g["contact_share"][()] for g in snubbers},
        contacts={g.attrs["name"]: g["contacts"][()] for g in snubbers},
        steady=steady,
        limited=limited,
    )


def _read_linear(group: h5py.Group) -> LinearCurve:
    probes = ordered(group, "probes")

    def pair(g: h5py.Group, name: str) -> Any:
        return g[f"{name}_real"][()] + 1j * g[f"{name}_imag"][()]

    return LinearCurve(
        group["frequency_hz"][()],
        {g.attrs["name"]: pair(g, "displacement") for g in probes},
        {g.attrs["name"]: pair(g, "absolute_acceleration") for g in probes},
        {
            g.attrs["name"]: ContactLevels(**{field.name: g[field.name][()] for field in _CONTACT})
            for g in ordered(group, "snubbers")
        },
    )


def _read_peaks(group: h5py.Group) -> tuple[ResponsePeak, ...]:
    columns: dict[str, list[Any]] = {field.name: group[field.name][()].tolist() for field in _PEAKS}
    columns.update({name: texts(group[name]) for name in _PEAK_TEXTS})
    return tuple(ResponsePeak(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True))


def _read_history(group: h5py.Group) -> SweepHistory:
    probes, snubbers = ordered(group, "probes"), ordered(group, "snubbers")
    return SweepHistory(
        group["time"][()],
        {g.attrs["name"]: g["displacement"][()] for g in probes},
        {g.attrs["name"]: g["absolute_acceleration"][()] for g in probes if "absolute_acceleration" in g},
        {g.attrs["name"]: g["force"][()] for g in snubbers},
    )


def earlier_sweep(path: Path | str, scenario: Scenario) -> StoredSweep | None:
    """What an interrupted sweep of the same scenario left at ``path``; None where there is nothing.

    Raises
    ------
    ResultFileError
        When the file is of another scenario, or damaged.
    """
    if not Path(path).exists():
        return None
    stored = open_sweep(path)
    if stored.scenario_yaml != scenario.to_yaml():
        raise ResultFileError(
            f"{path}: holds a sweep of another scenario; leave out --resume, or choose another place with -o"
        )
    return stored
