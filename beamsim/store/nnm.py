"""The result file of ``beamsim nnm``.

``/branches/<n>`` holds one branch: the backbone first, then the tongues of internal resonance, then motions that are
never at rest. Complex numbers are two datasets, ``…_real`` and ``…_imag``. ``/branches/<n>/motion`` is one period of
the motion that is drawn (of the branch ``motion_branch``, its point ``motion_point``) and its spectrum. ``/thesis`` is
the thesis's method and ``/multiple_scales`` the expansion beside them, where they were asked for.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.analyses.nnm.result import BranchJump, ModeBranch, NormalModeResult, OrbitMotion
from beamsim.store import schema
from beamsim.store.datasets import (
    named_group,
    native,
    ordered,
    put,
    read_modes,
    read_stations,
    write_modes,
    write_stations,
)
from beamsim.store.mode_comparisons import read_expansion, read_relaxed, write_expansion, write_relaxed
from beamsim.store.orbit_tables import NUMBER, read_special, read_stability, write_special, write_stability
from beamsim.store.phase_resonance import read_phase_resonance, write_phase_resonance
from beamsim.store.schema import Field
from beamsim.store.stored import LazyScenario, creating, reading, root_fields, write_root

_UNITS = {"stiffness_factor": "1", "energy": "J", "frequency": "Hz"}
_ROOT = ("mode", "method", "motion_branch", "motion_point")
_BRANCH = ("kind", "status", "mode", "ratio")
_JUMP = (
    Field("start", "", "parameter of the last point before"),
    Field("end", "", "parameter of the first point beyond"),
    Field("mode", "1", "the other mode, from 1; 0 where unknown"),
    Field("ratio", "1", "n of n:1; 0 where unknown"),
)
_POINTS = (
    Field("frequency_hz", "Hz", "frequency of the motion"),
    Field("energy", "J", "energy from static equilibrium"),
    Field("share", "1", "share of the energy in the mode asked for, at the slowest instant"),
    Field("residual", "1", "largest miss of periodicity, against the motion's size"),
    Field("least_kinetic", "1", "kinetic energy at the slowest instant, share of the energy; zero at rest"),
)
_STATES = (
    Field("coordinates", "kg^0.5 m", "coordinates at the slowest instant"),
    Field("coordinate_velocities", "kg^0.5 m/s", "their velocities then; zero at rest"),
)
_SHAPE = Field("initial_displacement", "m", "deflection at the slowest instant")
_DIFFERENCE = Field("half_period_difference", "1", "from half-period shooting: largest of period and state, relative")


def write_nnm(result: NormalModeResult, path: Path | str) -> Path:
    """Write a nonlinear mode to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with creating(path) as file:
        write_root(
            file, result, "nnm", continued_in=result.parameter, **{name: getattr(result, name) for name in _ROOT}
        )
        position = write_stations(file, result.stations)
        linear = Field("linear_shape", "m", "linear mode with the largest deflection of the motion that is drawn")
        put(file, linear, result.linear_shape, position)
        count = np.arange(1, result.backbone.coordinates.shape[1] + 1)
        coordinate = put(file, Field("coordinate", "1", "number of the coordinate"), count, scale=True)
        for index, branch in enumerate(result.branches):
            group = file.create_group(f"branches/{index}")
            _write_branch(group, branch, result, (position, coordinate))
            if index == 0 and result.half_period_difference is not None:
                put(group, _DIFFERENCE, result.half_period_difference, group[NUMBER.name])
            if index == result.motion_branch:
                _write_motion(group.create_group("motion"), result.motion, position)
        _write_jumps(file.create_group("jumps"), result)
        write_modes(file, result.modes)
        if result.phase_resonance is not None:
            write_phase_resonance(file, result.phase_resonance, position)
        if result.expansion is not None:
            write_expansion(file, result.expansion, position, coordinate)
        if result.relaxed is not None:
            write_relaxed(file, result.relaxed, position, coordinate)
    return Path(path)


def _write_branch(
    group: h5py.Group, branch: ModeBranch, result: NormalModeResult, scales: tuple[h5py.Dataset, h5py.Dataset]
) -> None:
    position, coordinate = scales
    group.attrs.update({name: getattr(branch, name) for name in _BRANCH})
    unit = _UNITS[result.parameter]
    number = put(group, NUMBER, np.arange(1, branch.parameter.size + 1), scale=True)
    put(group, Field("parameter", unit, result.parameter.replace("_", " ")), branch.parameter, number)
    for field in _POINTS:
        put(group, field, getattr(branch, field.name), number)
    for field in _STATES:
        put(group, field, getattr(branch, field.name), number, coordinate)
    put(group, _SHAPE, branch.initial_displacement, number, position)
    write_stability(group, branch.stable, branch.floquet_multipliers, number)
    write_special(group, branch.special, unit)


def _write_motion(group: h5py.Group, motion: OrbitMotion, position: h5py.Dataset) -> None:
    group.attrs.update({"periods": motion.periods, "drift": motion.drift})
    time = put(group, schema.TIME, motion.time, scale=True)
    put(group, Field("displacement", "m", "deflection at the stations"), motion.stations, time, position)
    instant = put(group, Field("instant", "1", "share of the period"), np.array([0.0, 0.5]), scale=True)
    extremes = Field("extreme_shapes", "m", "deflection at the slowest instant and half a period later")
    put(group, extremes, motion.at_rest, instant, position)
    line = put(group, Field("spectrum_frequency_hz", "Hz", "frequency"), motion.spectrum_frequency_hz, scale=True)
    order = None
    for index, name in enumerate(motion.displacement):
        probe = named_group(group, "probes", name, index)
        put(probe, Field("displacement", "m", "displacement"), motion.displacement[name], time)
        put(probe, Field("velocity", "m/s", "velocity"), motion.velocity[name], time)
        put(probe, Field("spectrum", "m", "single-sided amplitude, zero to peak"), motion.spectrum[name], line)
        c = motion.harmonics[name]
        if order is None:
            order = put(group, Field("order", "1", "order of the harmonic"), np.arange(c.size), scale=True)
        put(probe, Field("harmonic_real", "m", "amplitude of cos(order x phase)"), c.real, order)
        put(probe, Field("harmonic_imag", "m", "minus the amplitude of sin(order x phase)"), c.imag, order)
    for index, (name, force) in enumerate(motion.force.items()):
        field = Field("force", "N", "contact force, positive when it pushes")
        put(named_group(group, "snubbers", name, index), field, force, time)


def _write_jumps(group: h5py.Group, result: NormalModeResult) -> None:
    count = np.arange(1, len(result.jumps) + 1)
    number = put(group, Field("jump", "1", "number of the jump"), count, scale=True)
    for field in _JUMP:
        values = np.array([getattr(jump, field.name) for jump in result.jumps], dtype=float if not field.units else int)
        put(group, field._replace(units=field.units or _UNITS[result.parameter]), values, number)


class StoredMode(LazyScenario, NormalModeResult):
    """A nonlinear mode read from a file; its scenario is parsed when it is first asked for."""


def open_nnm(path: Path | str) -> StoredMode:
    """Read a result file written by ``beamsim nnm``.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else.
    """
    with reading(path, "nnm") as file:
        branches = [file[f"branches/{index}"] for index in range(len(file["branches"]))]
        own = native(file, "continued_in", *_ROOT)
        return StoredMode.of(
            {
                **root_fields(file),
                **{name: own[name] for name in _ROOT},
                "parameter": own["continued_in"],
                "branches": tuple(_read_branch(group) for group in branches),
                "jumps": _read_jumps(file["jumps"]),
                "stations": read_stations(file),
                "linear_shape": file["linear_shape"][()],
                "motion": _read_motion(branches[own["motion_branch"]]["motion"]),
                "modes": read_modes(file),
                "phase_resonance": read_phase_resonance(file),
                "half_period_difference": branches[0][_DIFFERENCE.name][()]
                if _DIFFERENCE.name in branches[0]
                else None,
                "expansion": read_expansion(file),
                "relaxed": read_relaxed(file),
            }
        )


def _read_branch(group: h5py.Group) -> ModeBranch:
    return ModeBranch(
        **native(group, *_BRANCH),
        parameter=group["parameter"][()],
        **{field.name: group[field.name][()] for field in (*_POINTS, *_STATES, _SHAPE)},
        **read_stability(group),
        special=read_special(group),
    )


def _read_motion(group: h5py.Group) -> OrbitMotion:
    probes, snubbers = ordered(group, "probes"), ordered(group, "snubbers")

    def of(groups: list[h5py.Group], name: str) -> dict[str, Any]:
        return {str(g.attrs["name"]): g[name][()] for g in groups}

    imaginary = of(probes, "harmonic_imag")
    return OrbitMotion(
        time=group["time"][()],
        displacement=of(probes, "displacement"),
        velocity=of(probes, "velocity"),
        force=of(snubbers, "force"),
        stations=group["displacement"][()],
        harmonics={name: real + 1j * imaginary[name] for name, real in of(probes, "harmonic_real").items()},
        spectrum_frequency_hz=group["spectrum_frequency_hz"][()],
        spectrum=of(probes, "spectrum"),
        **native(group, "periods", "drift"),
    )


def _read_jumps(group: h5py.Group) -> tuple[BranchJump, ...]:
    columns = [group[field.name][()].tolist() for field in _JUMP]
    return tuple(BranchJump(*row) for row in zip(*columns, strict=True))
