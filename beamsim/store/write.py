"""Write a result to an HDF5 file, all of it or nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.analyses.results import RunResult, Spectrum
from beamsim.files import replacing
from beamsim.store import schema
from beamsim.store.random_response import write_random

__all__ = ["write_run"]


def write_run(result: RunResult, path: Path | str) -> Path:
    """Write ``result`` to ``path`` in the layout of `beamsim.store.schema`; returns the path.

    An existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written (no permission, disk full, a folder of that name).
    """
    with replacing(path) as temporary, h5py.File(temporary, "x") as file:
        _write_root(file, result)
        time = _put(file, schema.TIME, result.time, scale=True)
        _write_histories(file, result, time)
        _write_events(file.create_group("events"), result)
        for spectrum in result.spectra.values():
            group = file.require_group(schema.spectrum_group(spectrum.probe, spectrum.quantity))
            _write_spectrum(group, spectrum)
        _write_beam(file, result)
        _write_modes(file.create_group("modes"), result)
        write_random(file, result.random)
        file.create_group("work").attrs.update(vars(result.work))
        file.create_group("summary").attrs.update(schema.encode_summary(result.summary))
    return Path(path)


def _write_root(file: h5py.File, result: RunResult) -> None:
    from beamsim import __version__

    values = {
        "schema_version": schema.SCHEMA_VERSION,
        "beamsim_version": result.provenance.get("beamsim", __version__),
        "command": schema.COMMAND,
        "scenario": result.scenario.to_yaml(),
        "title": result.title,
        "method": result.method,
        "status": result.status,
        "created": result.created,
        "wall_time_s": result.wall_time_s,
        "warnings": json.dumps(list(result.warnings), ensure_ascii=False),
        "provenance": json.dumps(dict(result.provenance), ensure_ascii=False),
    }
    file.attrs.update({name: values[name] for name in schema.ROOT_ATTRIBUTES})


def _write_histories(file: h5py.File, result: RunResult, time: h5py.Dataset) -> None:
    for index, probe in enumerate(result.probes.values()):
        group = _named_group(file, "probes", probe.name, index)
        group.attrs["position"] = probe.position
        for field in schema.PROBE:
            _put(group, field, getattr(probe, field.name), time)
    for index, snubber in enumerate(result.snubbers.values()):
        group = _named_group(file, "snubbers", snubber.name, index)
        numbers = ("position", "side", "stiffness", "dashpot", "gap", "preload", "blocked_force", "stiffness_ratio")
        group.attrs.update({name: getattr(snubber, name) for name in numbers})
        for field in schema.SNUBBER:
            _put(group, field, getattr(snubber, field.name), time)
    for field in schema.BASE:
        _put(file.require_group("base"), field, getattr(result, f"base_{field.name}"), time)
    for field in schema.ENERGY:
        _put(file.require_group("energy"), field, getattr(result.energy, field.name), time)


def _write_events(group: h5py.Group, result: RunResult) -> None:
    number = _put(group, schema.EVENT_NUMBER, np.arange(1, result.events.time.size + 1), scale=True)
    for field in schema.EVENTS:
        _put(group, field, getattr(result.events, field.name), number)
    if result.snubbers:
        group["snubber"].attrs["names"] = list(result.snubbers)


def _write_spectrum(group: h5py.Group, spectrum: Spectrum) -> None:
    group.attrs.update(
        {name: getattr(spectrum, name) for name in ("probe", "quantity", "unit", "excitation_hz", "window")}
    )
    group.attrs.update({"start_s": spectrum.start_s, "duration_s": spectrum.duration_s})
    axis, amplitude, level = schema.spectrum_fields(spectrum.quantity, spectrum.unit)
    frequency = _put(group, axis, spectrum.frequency_hz, scale=True)
    _put(group, amplitude, spectrum.amplitude, frequency)
    _put(group, level, spectrum.amplitude_db, frequency)
    table = group.create_group("lines")
    line = _put(table, schema.LINE_NUMBER, np.arange(1, len(spectrum.lines) + 1), scale=True)
    for field in schema.LINES:
        values = [getattr(line, field.name) for line in spectrum.lines]
        dtype = h5py.string_dtype("utf-8") if field.name == "kind" else float
        _put(table, field._replace(units=field.units or spectrum.unit), np.array(values, dtype=dtype), line)


def _write_beam(file: h5py.File, result: RunResult) -> None:
    if result.beam is None:
        return
    group = file.create_group("beam")
    position, times = (_put(group, field, getattr(result.beam, field.name), scale=True) for field in schema.BEAM_SCALES)
    for field in schema.BEAM:
        values = getattr(result.beam, field.name)
        _put(group, field, values, *((times, position) if values.ndim == 2 else (position,)))


def _write_modes(group: h5py.Group, result: RunResult) -> None:
    modes = result.modes
    numbers = ("kept_modes", "static_vectors", "highest_frequency_hz", "reduction_error")
    group.attrs.update({name: getattr(modes, name) for name in numbers})
    unit, where = ("1", "mass number") if result.beam is None else ("m", "position along the beam")
    number = _put(group, schema.MODE_NUMBER, np.arange(1, modes.open_frequencies_hz.size + 1), scale=True)
    position = _put(group, schema.Field("position", unit, where), modes.position, scale=True)
    for field in schema.MODES:
        values = getattr(modes, field.name)
        _put(group, field, values, *((number, position) if values.ndim == 2 else (number,)))


def _named_group(file: h5py.File, parent: str, name: str, index: int) -> h5py.Group:
    group = file.create_group(f"{parent}/{schema.group_name(name)}")
    group.attrs.update({"name": name, "index": index})
    return group


def _put(
    group: h5py.Group, field: schema.Field, values: Any, *scales: h5py.Dataset, scale: bool = False
) -> h5py.Dataset:
    values = np.asarray(values)
    if field.flags is not None:
        values = values.astype(np.uint8)
    dataset = group.create_dataset(field.name, data=values)
    dataset.attrs.update({"units": field.units, "long_name": field.long_name})
    if field.flags is not None:
        dataset.attrs["flag_values"] = np.array([0, 1], dtype=np.uint8)
        dataset.attrs["flag_meanings"] = " ".join(field.flags)
    if scale:
        dataset.make_scale(field.name)
    for axis, dimension in enumerate(scales):
        dataset.dims[axis].attach_scale(dimension)
    return dataset
