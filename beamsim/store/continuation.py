"""The result file of ``beamsim sweep`` of kind continuation.

``/branches/<n>`` holds one branch: the response at each level, the branches of doubled period behind it, against
``parameter`` (what is followed, named by the root's attributes ``parameter`` and ``unit``) and ``frequency_hz``.
``/fold_curves/<n>`` is a fold followed in a second parameter. A swept or stepped sine laid over the curve is stored as
in the file of a sweep, ``/<direction>_<level index>``, with the attribute ``source``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.analyses.response.result import FoldCurveResult, FrequencyResponse, OverlayCurve, ResponseBranch
from beamsim.store.datasets import named_group, native, ordered, put, read_modes, write_modes
from beamsim.store.multiple_scales import read_forced_expansion, write_forced_expansion
from beamsim.store.orbit_tables import NUMBER, read_special, read_stability, write_special, write_stability
from beamsim.store.schema import Field
from beamsim.store.stored import LazyScenario, creating, reading, root_fields, write_root
from beamsim.store.sweep import read_curve, write_curve

KIND = "continuation"

_ROOT = ("parameter", "unit", "snubber", "level_unit", "method", "second_parameter", "second_unit", "second_snubber")
_FREQUENCY = Field("frequency_hz", "Hz", "excitation frequency")
_RESIDUAL = Field("residual", "1", "largest miss of periodicity, against the motion's size")
_ORDER = Field("order", "1", "frequency over excitation frequency")
_REAL = Field("harmonic_displacement_real", "m", "amplitude of cos(order x phase)")
_IMAG = Field("harmonic_displacement_imag", "m", "minus that of sin(order x phase)")
_DISPLACEMENTS = (
    Field("peak_displacement", "m", "largest absolute displacement of a period"),
    Field("max_displacement", "m", "largest displacement of a period"),
    Field("min_displacement", "m", "smallest displacement of a period"),
)
_ACCELERATION = Field("peak_acceleration", "m/s^2", "largest absolute acceleration of a period")
_FORCE = Field("peak_force", "N", "largest contact force of a period")
_SHARE = Field("contact_share", "1", "share of the time in contact")
_GAP = Field("peak_gap", "m", "largest opening of the contact in a period")
_STRESS = Field("peak_bending_stress", "Pa", "largest bending stress along the beam in a period")
_NEGLECTED = Field("neglected_harmonics", "1", "what the harmonics left out are worth, against the motion")


class StoredResponse(LazyScenario, FrequencyResponse):
    """A response by continuation read from a file."""


def write_frequency_response(result: FrequencyResponse, path: Path | str) -> Path:
    """Write ``result`` to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with creating(path) as file:
        write_root(file, result, "sweep", kind=KIND, **{name: getattr(result, name) for name in _ROOT})
        branches = file.create_group("branches")
        for index, branch in enumerate(result.branches):
            _write_branch(branches.create_group(str(index)), branch, _followed(result), index)
        for index, curve in enumerate(result.fold_curves):
            _write_fold_curve(file.create_group(f"fold_curves/{index}"), curve, _second(result), index)
        for name, laid in result.overlay.items():
            group = file.create_group(name)
            write_curve(group, laid.curve)
            group.attrs.update({"source": laid.source, "title": laid.title})
        write_forced_expansion(file, result.expansion)
        write_modes(file, result.modes)
    return Path(path)


def _followed(result: FrequencyResponse) -> Field:
    what = "excitation frequency" if result.parameter == "frequency" else f"{result.parameter} {result.snubber}".strip()
    return Field("parameter", result.unit, f"what is followed: {what}")


def _second(result: FrequencyResponse) -> Field:
    what = f"{result.second_parameter} {result.second_snubber}".strip()
    return Field("parameter", result.second_unit, f"second parameter: {what}")


def _write_branch(group: h5py.Group, branch: ResponseBranch, followed: Field, index: int) -> None:
    group.attrs.update(
        {"index": index, "level": branch.level, "period_multiple": branch.period_multiple, "status": branch.status}
    )
    number = put(group, NUMBER, np.arange(1, branch.frequency_hz.size + 1), scale=True)
    put(group, _FREQUENCY, branch.frequency_hz, number)
    put(group, followed, branch.parameter, number)
    put(group, _RESIDUAL, branch.residual, number)
    count = max((c.shape[1] for c in branch.harmonics.values()), default=0)
    order = put(group, _ORDER, np.arange(count) / branch.period_multiple, scale=True)
    for k, name in enumerate(branch.peak_displacement):
        probe = named_group(group, "probes", name, k)
        for field in _DISPLACEMENTS:
            put(probe, field, getattr(branch, field.name)[name], number)
        put(probe, _REAL, branch.harmonics[name].real, number, order)
        put(probe, _IMAG, branch.harmonics[name].imag, number, order)
        put(probe, _ACCELERATION, branch.peak_acceleration[name], number)
    for k, name in enumerate(branch.peak_force):
        snubber = named_group(group, "snubbers", name, k)
        put(snubber, _FORCE, branch.peak_force[name], number)
        put(snubber, _SHARE, branch.contact_share[name], number)
        if f"gap {name}" in branch.limited:
            put(snubber, _GAP, branch.limited[f"gap {name}"], number)
    if "bending_stress" in branch.limited:
        put(group, _STRESS, branch.limited["bending_stress"], number)
    if branch.neglected_harmonics is not None:
        put(group, _NEGLECTED, branch.neglected_harmonics, number)
    write_stability(group, branch.stable, branch.floquet_multipliers, number)
    write_special(group, branch.special, followed.units)


def _write_fold_curve(group: h5py.Group, curve: FoldCurveResult, second: Field, index: int) -> None:
    names = ("level", "branch", "start_hz", "touching", "status")
    group.attrs.update({"index": index, **{name: getattr(curve, name) for name in names}})
    number = put(group, NUMBER, np.arange(1, curve.frequency_hz.size + 1), scale=True)
    put(group, _FREQUENCY._replace(long_name="excitation frequency of the fold"), curve.frequency_hz, number)
    put(group, second, curve.parameter, number)
    put(group, _RESIDUAL, curve.residual, number)
    for k, name in enumerate(curve.peak_displacement):
        put(named_group(group, "probes", name, k), _DISPLACEMENTS[0], curve.peak_displacement[name], number)


def open_response(path: Path | str) -> StoredResponse:
    """Read a result file written by ``beamsim sweep`` of kind continuation.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else.
    """
    with reading(path, KIND) as file:
        return StoredResponse.of(
            {
                **root_fields(file),
                **{name: str(file.attrs[name]) for name in _ROOT},
                "branches": tuple(_read_branch(group) for group in ordered(file, "branches", required=True)),
                "fold_curves": tuple(_read_fold_curve(group) for group in ordered(file, "fold_curves")),
                "overlay": {
                    name: OverlayCurve(str(group.attrs["source"]), str(group.attrs["title"]), read_curve(name, group))
                    for name, group in sorted(file.items(), key=_laid_order)
                    if "direction" in group.attrs
                },
                "expansion": read_forced_expansion(file),
                "modes": read_modes(file),
            }
        )


def _laid_order(item: tuple[str, Any]) -> tuple[int, bool]:
    """Up before down, by the number at the end of the name."""
    direction, _, index = item[0].rpartition("_")
    return (int(index) if index.isdigit() else -1, direction == "down")


def _columns(groups: list[h5py.Group], field: Field) -> dict[str, Any]:
    return {str(g.attrs["name"]): g[field.name][()] for g in groups if field.name in g}


def _read_branch(group: h5py.Group) -> ResponseBranch:
    probes, snubbers = ordered(group, "probes"), ordered(group, "snubbers")
    limited = {f"gap {name}": values for name, values in _columns(snubbers, _GAP).items()}
    if _STRESS.name in group:
        limited["bending_stress"] = group[_STRESS.name][()]
    return ResponseBranch(
        **native(group, "level", "period_multiple", "status"),
        **{name: group[name][()] for name in ("frequency_hz", "parameter", "residual")},
        peak_displacement=_columns(probes, _DISPLACEMENTS[0]),
        max_displacement=_columns(probes, _DISPLACEMENTS[1]),
        min_displacement=_columns(probes, _DISPLACEMENTS[2]),
        peak_acceleration=_columns(probes, _ACCELERATION),
        harmonics={str(g.attrs["name"]): g[_REAL.name][()] + 1j * g[_IMAG.name][()] for g in probes},
        peak_force=_columns(snubbers, _FORCE),
        contact_share=_columns(snubbers, _SHARE),
        limited=limited,
        neglected_harmonics=group[_NEGLECTED.name][()] if _NEGLECTED.name in group else None,
        special=read_special(group),
        **read_stability(group),
    )


def _read_fold_curve(group: h5py.Group) -> FoldCurveResult:
    return FoldCurveResult(
        **native(group, "level", "branch", "start_hz", "touching", "status"),
        **{name: group[name][()] for name in ("frequency_hz", "parameter", "residual")},
        peak_displacement=_columns(ordered(group, "probes"), _DISPLACEMENTS[0]),
    )
