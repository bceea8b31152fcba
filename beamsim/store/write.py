"""Write a result to an HDF5 file, all of it or nothing."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from beamsim.analyses.run.result import RunResult
from beamsim.store import schema
from beamsim.store.datasets import named_group, put, write_modes
from beamsim.store.random_response import write_random
from beamsim.store.spectra import write_spectrum
from beamsim.store.stored import creating, write_root


def write_run(result: RunResult, path: Path | str) -> Path:
    """Write ``result`` to ``path`` in the layout of `beamsim.store.schema`; returns the path.

    An existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written (no permission, disk full, a folder of that name).
    """
    with creating(path) as file:
        write_root(file, result, schema.COMMAND, method=result.method)
        time = put(file, schema.TIME, result.time, scale=True)
        _write_histories(file, result, time)
        _write_events(file.create_group("events"), result)
        for spectrum in result.spectra.values():
            group = file.require_group(schema.spectrum_group(spectrum.probe, spectrum.quantity))
            write_spectrum(group, spectrum)
        _write_beam(file, result)
        write_modes(file, result.modes, of_chain=result.beam is None)
        write_random(file, result.random)
        file.create_group("work").attrs.update(vars(result.work))
    return Path(path)


def _write_histories(file: h5py.File, result: RunResult, time: h5py.Dataset) -> None:
    for index, probe in enumerate(result.probes.values()):
        group = named_group(file, "probes", probe.name, index)
        group.attrs["position"] = probe.position
        for field in schema.PROBE:
            put(group, field, getattr(probe, field.name), time)
    for index, snubber in enumerate(result.snubbers.values()):
        group = named_group(file, "snubbers", snubber.name, index)
        numbers = ("position", "side", "stiffness", "dashpot", "gap", "preload", "blocked_force", "stiffness_ratio")
        group.attrs.update({name: getattr(snubber, name) for name in numbers})
        for field in schema.SNUBBER:
            put(group, field, getattr(snubber, field.name), time)
    for index, spring in enumerate(result.springs.values()):
        group = named_group(file, "springs", spring.name, index)
        group.attrs.update({"kind": spring.kind, "masses": spring.masses})
        for field in schema.SPRING:
            put(group, field, getattr(spring, field.name), time)
    for field in schema.BASE:
        put(file.require_group("base"), field, getattr(result, f"base_{field.name}"), time)
    for field in schema.ENERGY:
        put(file.require_group("energy"), field, getattr(result.energy, field.name), time)


def _write_events(group: h5py.Group, result: RunResult) -> None:
    number = put(group, schema.EVENT_NUMBER, np.arange(1, result.events.time.size + 1), scale=True)
    for field in schema.EVENTS:
        put(group, field, getattr(result.events, field.name), number)
    if result.snubbers:
        group["snubber"].attrs["names"] = list(result.snubbers)


def _write_beam(file: h5py.File, result: RunResult) -> None:
    if result.beam is None:
        return
    group = file.create_group("beam")
    position, times = (put(group, field, getattr(result.beam, field.name), scale=True) for field in schema.BEAM_SCALES)
    for field in schema.BEAM:
        values = getattr(result.beam, field.name)
        put(group, field, values, *((times, position) if values.ndim == 2 else (position,)))
