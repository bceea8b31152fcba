"""The result files of ``beamsim nnm`` and of ``beamsim sweep`` of kind continuation.

``/branches/<n>`` holds one branch: the backbone first and then the tongues of internal resonance, or the response at
each level with the branches of doubled period behind it. Complex numbers are two datasets, ``…_real`` and ``…_imag``.
``/branches/0/motion`` of a nonlinear mode is one period of its last point.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from beamsim.files import replacing
from beamsim.store import schema
from beamsim.store.identification import put
from beamsim.store.schema import Field

if TYPE_CHECKING:
    from beamsim.analyses.orbit_results import (
        FrequencyResponse,
        ModeBranch,
        NormalModeResult,
        OrbitEvent,
        OrbitMotion,
        ResponseBranch,
    )

__all__ = ["write_frequency_response", "write_nnm"]

_PARAMETER_UNIT = {"stiffness_factor": "1", "energy": "J", "frequency": "Hz"}
_NUMBER = Field("point", "1", "number of the point along the branch")
_EVENT = Field("event", "1", "number of the special point")


def write_nnm(result: NormalModeResult, path: Path | str) -> Path:
    """Write a nonlinear mode to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with replacing(path) as temporary, h5py.File(temporary, "x") as file:
        _root(file, result, "nnm")
        file.attrs.update({"mode": result.mode, "continued_in": result.parameter})
        where = ("m", "position along the beam") if result.scenario.beam is not None else ("1", "mass number")
        position = put(file, Field("position", *where), result.position, scale=True)
        put(file, Field("linear_shape", "m", "linear mode at the last motion's largest deflection"),
        result.linear_shape,
            position)  # fmt: skip
        instant = put(file, Field("instant", "1", "share of the period"), np.array([0.0, 0.5]), scale=True)
        put(
            file, Field("extreme_shapes", "m", "deflection of the last motion at both instants of rest"),
            result.extreme_shapes, instant, position,
        )  # fmt: skip
        for index, branch in enumerate(result.branches):
            group = file.create_group(f"branches/{index}")
            _write_mode_branch(group, branch, result.parameter, position)
            if index == 0:
                _write_motion(group.create_group("motion"), result.motion, position)
        jumps = file.create_group("jumps")
        number = put(jumps, Field("jump", "1", "number of the jump"), np.arange(1, len(result.jumps) + 1), scale=True)
        unit = _PARAMETER_UNIT[result.parameter]
        for field in (
            Field("start", unit, "parameter of the last point before"),
            Field("end", unit, "parameter of the first point beyond"),
            Field("mode", "1", "the other mode, from 1; 0 where unknown"),
            Field("ratio", "1", "n of n:1; 0 where unknown"),
        ):
            put(jumps, field, np.array([getattr(jump, field.name) for jump in result.jumps]), number)
        file.create_group("summary").attrs.update(schema.encode_summary(result.summary))
    return Path(path)


def write_frequency_response(result: FrequencyResponse, path: Path | str) -> Path:
    """Write a frequency response by continuation to ``path``, as :func:`write_nnm`."""
    with replacing(path) as temporary, h5py.File(temporary, "x") as file:
        _root(file, result, "sweep")
        file.attrs["kind"] = "continuation"
        for index, branch in enumerate(result.branches):
            _write_response(file.create_group(f"branches/{index}"), branch)
        file.create_group("summary").attrs.update(schema.encode_summary(result.summary))
    return Path(path)


def _root(file: h5py.File, result: NormalModeResult | FrequencyResponse, command: str) -> None:
    from beamsim import __version__

    file.attrs.update(
        {
            "schema_version": schema.SCHEMA_VERSION,
            "beamsim_version": result.provenance.get("beamsim", __version__),
            "command": command,
            "scenario": result.scenario.to_yaml(),
            "title": result.title,
            "status": result.status,
            "created": result.created,
            "wall_time_s": result.wall_time_s,
            "warnings": json.dumps(list(result.warnings), ensure_ascii=False),
            "provenance": json.dumps(dict(result.provenance), ensure_ascii=False),
        }
    )


def _write_mode_branch(group: h5py.Group, branch: ModeBranch, parameter: str, position: h5py.Dataset) -> None:
    group.attrs.update({"kind": branch.kind, "status": branch.status, "mode": branch.mode, "ratio": branch.ratio})
    unit = _PARAMETER_UNIT[parameter]
    number = put(group, _NUMBER, np.arange(1, branch.parameter.size + 1), scale=True)
    for field in (
        Field("parameter", unit, parameter.replace("_", " ")),
        Field("frequency_hz", "Hz", "frequency of the motion"),
        Field("energy", "J", "energy from static equilibrium"),
        Field("share", "1", "share of the energy in the mode asked for, at rest"),
        Field("residual", "1", "largest miss of periodicity, against the motion's size"),
    ):
        put(group, field, getattr(branch, field.name), number)
    put(group, Field("initial_displacement", "m", "deflection at rest"), branch.initial_displacement, number, position)
    put(group, Field("coordinates", "kg^0.5 m", "coordinates at rest"), branch.coordinates, number)
    _stability(group, branch.stable, branch.floquet_multipliers, number)
    _special(group, branch.special, unit)


def _write_motion(group: h5py.Group, motion: OrbitMotion, position: h5py.Dataset) -> None:
    time = put(group, schema.TIME, motion.time, scale=True)
    put(group, Field("displacement", "m", "deflection at the stations"), motion.stations, time, position)
    order = None
    for index, name in enumerate(motion.displacement):
        probe = group.create_group(f"probes/{schema.group_name(name)}")
        probe.attrs.update({"name": name, "index": index})
        put(probe, Field("displacement", "m", "displacement"), motion.displacement[name], time)
        put(probe, Field("velocity", "m/s", "velocity"), motion.velocity[name], time)
        c = motion.harmonics[name]
        if order is None:
            order = put(group, Field("order", "1", "order of the harmonic"), np.arange(c.size), scale=True)
        put(probe, Field("harmonic_real", "m", "amplitude of cos(order x phase)"), c.real, order)
        put(probe, Field("harmonic_imag", "m", "minus the amplitude of sin(order x phase)"), c.imag, order)
    for index, (name, force) in enumerate(motion.force.items()):
        snubber = group.create_group(f"snubbers/{schema.group_name(name)}")
        snubber.attrs.update({"name": name, "index": index})
        put(snubber, Field("force", "N", "contact force, positive when it pushes"), force, time)


def _write_response(group: h5py.Group, branch: ResponseBranch) -> None:
    group.attrs.update({"level": branch.level, "period_multiple": branch.period_multiple, "status": branch.status})
    number = put(group, _NUMBER, np.arange(1, branch.frequency_hz.size + 1), scale=True)
    put(group, Field("frequency_hz", "Hz", "excitation frequency"), branch.frequency_hz, number)
    put(
        group, Field("residual", "1", "largest miss of periodicity, against the motion's size"), branch.residual, number
    )
    order = None
    for index, name in enumerate(branch.peak_displacement):
        probe = group.create_group(f"probes/{schema.group_name(name)}")
        probe.attrs.update({"name": name, "index": index})
        for kind, text in (("peak", "largest absolute"), ("max", "largest"), ("min", "smallest")):
            field = Field(f"{kind}_displacement", "m", f"{text} displacement of a period")
            put(probe, field, getattr(branch, field.name)[name], number)
        c = branch.harmonics[name]
        if order is None:
            orders = np.arange(c.shape[1]) / branch.period_multiple
            order = put(group, Field("order", "1", "frequency over excitation frequency"), orders, scale=True)
        put(probe, Field("harmonic_displacement_real", "m", "amplitude of cos(order x phase)"), c.real, number, order)
        put(probe, Field("harmonic_displacement_imag", "m", "minus that of sin(order x phase)"), c.imag, number, order)
    for index, (name, force) in enumerate(branch.peak_force.items()):
        snubber = group.create_group(f"snubbers/{schema.group_name(name)}")
        snubber.attrs.update({"name": name, "index": index})
        put(snubber, Field("peak_force", "N", "largest contact force of a period"), force, number)
    _stability(group, branch.stable, branch.floquet_multipliers, number)
    _special(group, branch.special, "Hz")


def _stability(group: h5py.Group, stable: Any, multipliers: Any, number: h5py.Dataset) -> None:
    flags = put(group, Field("stable", "1", "whether the motion is stable"), stable.astype(np.uint8), number)
    flags.attrs["flag_values"] = np.array([0, 1], dtype=np.uint8)
    flags.attrs["flag_meanings"] = "unstable stable"
    put(group, Field("floquet_multipliers_real", "1", "Floquet multipliers, real part"), multipliers.real, number)
    put(group, Field("floquet_multipliers_imag", "1", "Floquet multipliers, imaginary part"), multipliers.imag, number)


def _special(group: h5py.Group, special: Sequence[OrbitEvent], unit: str) -> None:
    own = group.create_group("special_points")
    number = put(own, _EVENT, np.arange(1, len(special) + 1), scale=True)
    text = h5py.string_dtype("utf-8")
    put(own, Field("kind", "1", "kind of special point"), np.array([e.kind for e in special], dtype=text), number)
    put(own, Field("snubber", "1", "snubber that grazes"), np.array([e.snubber for e in special], dtype=text), number)
    for field in (
        Field("parameter", unit, "parameter of the branch"), Field("frequency_hz", "Hz", "frequency"),
        Field("time_s", "s", "time in the period of a grazing"),
    ):  # fmt: skip
        put(own, field, np.array([getattr(e, field.name) for e in special], dtype=float), number)
