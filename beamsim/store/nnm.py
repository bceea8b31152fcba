"""The result file of ``beamsim nnm``.

``/branches/<n>`` holds one branch: the backbone first and then the tongues of internal resonance. Complex numbers are
two datasets, ``…_real`` and ``…_imag``. ``/branches/0/motion`` is one period of the backbone's last point.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from beamsim.files import replacing
from beamsim.store import schema
from beamsim.store.identification import put
from beamsim.store.orbit_tables import NUMBER, write_root, write_special, write_stability
from beamsim.store.schema import Field

if TYPE_CHECKING:
    from beamsim.analyses.nnm_results import ModeBranch, NormalModeResult, OrbitMotion

__all__ = ["write_nnm"]

_PARAMETER_UNIT = {"stiffness_factor": "1", "energy": "J", "frequency": "Hz"}


def write_nnm(result: NormalModeResult, path: Path | str) -> Path:
    """Write a nonlinear mode to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with replacing(path) as temporary, h5py.File(temporary, "x") as file:
        write_root(file, result, "nnm")
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


def _write_mode_branch(group: h5py.Group, branch: ModeBranch, parameter: str, position: h5py.Dataset) -> None:
    group.attrs.update({"kind": branch.kind, "status": branch.status, "mode": branch.mode, "ratio": branch.ratio})
    unit = _PARAMETER_UNIT[parameter]
    number = put(group, NUMBER, np.arange(1, branch.parameter.size + 1), scale=True)
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
    write_stability(group, branch.stable, branch.floquet_multipliers, number)
    write_special(group, branch.special, unit)


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
