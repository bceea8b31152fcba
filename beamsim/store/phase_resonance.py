"""The group ``phase_resonance`` of a file of ``beamsim nnm``: the damped structure held on its nonlinear mode.

``predicted`` has the level that energy balance asks for along the backbone; ``levels/<n>`` one level: what was
predicted and found as attributes, ``curve`` the response about the resonance, ``held`` the structure carried from the
predicted start.
"""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np

from beamsim.analyses.nnm.result import (
    HeldMotion,
    PhaseResonance,
    PredictedLevels,
    ResonantMotion,
    ResponseCurve,
)
from beamsim.store import schema
from beamsim.store.datasets import named_group, native, ordered, put
from beamsim.store.schema import Field

GROUP = "phase_resonance"
_POINT = Field("point", "1", "number of the point")
_AMPLITUDE = Field("amplitude", "m", "largest deflection of a period")
_FREQUENCY = Field("frequency_hz", "Hz", "frequency of the motion")
_STABLE = Field("stable", "1", "whether the motion is stable", ("unstable", "stable"))
_NUMBERS = (
    "level", "predicted_frequency_hz", "predicted_energy", "found", "frequency_hz", "level_for_amplitude", "stable",
    "residual", "quadrature",
)  # fmt: skip
_HELD = (
    Field("instants", "s", "instants in the last period at which the mode is at rest"),
    Field("shapes", "m", "deflection of the held structure then"),
    Field("mode_shapes", "m", "deflection of the mode then"),
)


def write_phase_resonance(parent: h5py.Group, result: PhaseResonance, position: h5py.Dataset) -> None:
    """Write the group; ``position`` is the scale of the stations."""
    group = parent.create_group(GROUP)
    names = ("status", "quantity", "unit", "probe", "scales")
    group.attrs.update({name: getattr(result, name) for name in names})
    _write_predicted(group.create_group("predicted"), result.predicted, result.unit)
    for index, motion in enumerate(result.motions):
        own = group.create_group(f"levels/{index}")
        own.attrs.update({name: getattr(motion, name) for name in _NUMBERS} | {"index": index})
        for k, name in enumerate(motion.amplitude):
            probe = named_group(own, "probes", name, k)
            probe.attrs.update(
                {"predicted_amplitude": motion.predicted_amplitude[name], "amplitude": motion.amplitude[name]}
            )
        count = put(own, Field("multiplier", "1", "number"), np.arange(motion.floquet_multipliers.size), scale=True)
        for part, values in (("real", motion.floquet_multipliers.real), ("imag", motion.floquet_multipliers.imag)):
            put(own, Field(f"floquet_multipliers_{part}", "1", f"Floquet multipliers, {part} part"), values, count)
        if motion.curve is not None:
            _write_curve(own.create_group("curve"), motion.curve)
        if motion.held is not None:
            _write_held(own.create_group("held"), motion.held, position)


def _write_predicted(group: h5py.Group, table: PredictedLevels, unit: str) -> None:
    number = put(group, _POINT, np.arange(1, table.energy.size + 1), scale=True)
    for field in _predicted_fields(unit):
        put(group, field, getattr(table, field.name), number)
    _write_amplitudes(group, table.amplitude, number)


def _predicted_fields(unit: str) -> tuple[Field, ...]:
    return (
        Field("energy", "J", "energy from static equilibrium"),
        _FREQUENCY,
        Field("level", unit, "level of the excitation that holds the motion"),
        Field("dissipated", "J", "energy taken by damping in a period"),
        Field("contact_share", "1", "share of it that the contacts' dashpots take"),
    )


def _write_amplitudes(group: h5py.Group, amplitude: dict[str, Any], number: h5py.Dataset) -> None:
    for k, (name, values) in enumerate(amplitude.items()):
        put(named_group(group, "probes", name, k), _AMPLITUDE, values, number)


def _write_curve(group: h5py.Group, curve: ResponseCurve) -> None:
    group.attrs["status"] = curve.status
    number = put(group, _POINT, np.arange(1, curve.frequency_hz.size + 1), scale=True)
    put(group, _FREQUENCY, curve.frequency_hz, number)
    put(group, _STABLE, curve.stable, number)
    _write_amplitudes(group, curve.amplitude, number)


def _write_held(group: h5py.Group, held: HeldMotion, position: h5py.Dataset) -> None:
    time = put(group, schema.TIME, held.time, scale=True)
    line = put(group, Field("frequency_hz", "Hz", "frequency of the line"), held.frequency_hz, scale=True)
    period = put(group, Field("period", "1", "number of the period"), np.arange(1, held.departure.size + 1), scale=True)
    put(group, Field("departure", "1", "largest distance from the mode in a period, in energy"), held.departure, period)
    instants, shapes, mode_shapes = _HELD
    instant = put(group, instants, held.instants, scale=True)
    put(group, shapes, held.shapes, instant, position)
    put(group, mode_shapes, held.mode_shapes, instant, position)
    for k, name in enumerate(held.displacement):
        probe = named_group(group, "probes", name, k)
        put(probe, Field("displacement", "m", "displacement"), held.displacement[name], time)
        put(probe, Field("line", "m", "amplitude of the line, zero to peak"), held.amplitude[name], line)


def read_phase_resonance(parent: h5py.Group) -> PhaseResonance | None:
    """Inverse of `write_phase_resonance`; None where there is no such group."""
    if GROUP not in parent:
        return None
    group = parent[GROUP]
    unit = str(group.attrs["unit"])
    table = group["predicted"]
    predicted = PredictedLevels(
        **{field.name: table[field.name][()] for field in _predicted_fields(unit)}, amplitude=_amplitudes(table)
    )
    return PhaseResonance(
        **native(group, "status", "quantity", "unit", "probe", "scales"),
        predicted=predicted,
        motions=tuple(_motion(own) for own in ordered(group, "levels")),
    )


def _motion(own: h5py.Group) -> ResonantMotion:
    probes = ordered(own, "probes")
    return ResonantMotion(
        **native(own, *_NUMBERS),
        predicted_amplitude={str(p.attrs["name"]): float(p.attrs["predicted_amplitude"]) for p in probes},
        amplitude={str(p.attrs["name"]): float(p.attrs["amplitude"]) for p in probes},
        floquet_multipliers=own["floquet_multipliers_real"][()] + 1j * own["floquet_multipliers_imag"][()],
        curve=_curve(own["curve"]) if "curve" in own else None,
        held=_held(own["held"]) if "held" in own else None,
    )


def _curve(group: h5py.Group) -> ResponseCurve:
    return ResponseCurve(
        str(group.attrs["status"]), group["frequency_hz"][()], _amplitudes(group), group["stable"][()].astype(bool)
    )


def _held(group: h5py.Group) -> HeldMotion:
    probes = ordered(group, "probes")
    return HeldMotion(
        time=group["time"][()],
        displacement={str(p.attrs["name"]): p["displacement"][()] for p in probes},
        frequency_hz=group["frequency_hz"][()],
        amplitude={str(p.attrs["name"]): p["line"][()] for p in probes},
        departure=group["departure"][()],
        **{field.name: group[field.name][()] for field in _HELD},
    )


def _amplitudes(group: h5py.Group) -> dict[str, Any]:
    return {str(p.attrs["name"]): p["amplitude"][()] for p in ordered(group, "probes")}
