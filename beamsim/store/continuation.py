"""The result file of ``beamsim sweep`` of kind continuation.

``/branches/<n>`` holds one branch: the response at each level, the branches of doubled period behind it.
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
    from beamsim.analyses.response_results import FrequencyResponse, ResponseBranch

__all__ = ["write_frequency_response"]


def write_frequency_response(result: FrequencyResponse, path: Path | str) -> Path:
    """Write a frequency response by continuation to ``path``, as :func:`write_nnm`."""
    with replacing(path) as temporary, h5py.File(temporary, "x") as file:
        write_root(file, result, "sweep")
        file.attrs["kind"] = "continuation"
        for index, branch in enumerate(result.branches):
            _write_response(file.create_group(f"branches/{index}"), branch)
        file.create_group("summary").attrs.update(schema.encode_summary(result.summary))
    return Path(path)


def _write_response(group: h5py.Group, branch: ResponseBranch) -> None:
    group.attrs.update({"level": branch.level, "period_multiple": branch.period_multiple, "status": branch.status})
    number = put(group, NUMBER, np.arange(1, branch.frequency_hz.size + 1), scale=True)
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
    write_stability(group, branch.stable, branch.floquet_multipliers, number)
    write_special(group, branch.special, "Hz")
