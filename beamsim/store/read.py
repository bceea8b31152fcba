"""Open a result file as the result it was written from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py

from beamsim.analyses.run.result import (
    BeamResult,
    EnergyHistory,
    EventLog,
    ProbeHistory,
    RunResult,
    SnubberHistory,
    Spectrum,
    SpringHistory,
    Work,
)
from beamsim.store import schema
from beamsim.store.datasets import native, ordered, read_modes
from beamsim.store.random_response import read_random
from beamsim.store.spectra import read_spectrum
from beamsim.store.stored import LazyScenario, reading, root_fields


class StoredRun(LazyScenario, RunResult):
    """A run read from a file."""


def open_run(path: Path | str) -> StoredRun:
    """Read a result file written by ``beamsim run``.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else; see `beamsim.store.stored.reading`.
    """
    with reading(path, "run") as file:
        return StoredRun.of(_fields(file))


def _fields(file: h5py.File) -> dict[str, Any]:
    return {
        **root_fields(file),
        "method": file.attrs["method"],
        "time": file["time"][()],
        "probes": {g.attrs["name"]: ProbeHistory(**_members(g, schema.PROBE)) for g in ordered(file, "probes")},
        "snubbers": {g.attrs["name"]: SnubberHistory(**_members(g, schema.SNUBBER)) for g in ordered(file, "snubbers")},
        "springs": {g.attrs["name"]: _spring(g) for g in ordered(file, "springs")},
        "base_acceleration": file["base/acceleration"][()],
        "base_displacement": file["base/displacement"][()],
        "events": EventLog(**_datasets(file["events"], schema.EVENTS)),
        "spectra": _spectra(file),
        "beam": _beam(file),
        "energy": EnergyHistory(**_datasets(file["energy"], schema.ENERGY)),
        "modes": read_modes(file),
        "random": read_random(file),
        "work": Work(**native(file["work"])),
    }


def _datasets(group: h5py.Group, fields: tuple[schema.Field, ...]) -> dict[str, Any]:
    values = {field.name: group[field.name][()] for field in fields}
    return {field.name: values[field.name].astype(bool) if field.flags else values[field.name] for field in fields}


def _members(group: h5py.Group, fields: tuple[schema.Field, ...]) -> dict[str, Any]:
    attributes = native(group)
    del attributes["index"]
    return {**attributes, **_datasets(group, fields)}


def _spring(group: h5py.Group) -> SpringHistory:
    members = _members(group, schema.SPRING)
    return SpringHistory(**{**members, "masses": tuple(int(mass) for mass in members["masses"])})


def _spectra(file: h5py.File) -> dict[tuple[str, str], Spectrum]:
    found = []
    for probe in file["spectra"].values() if "spectra" in file else ():
        groups = [probe, *(member for member in probe.values() if isinstance(member, h5py.Group))]
        found += [group for group in groups if "window" in group.attrs]
    spectra = [read_spectrum(group) for group in found]
    rank = {group.attrs["name"]: int(group.attrs["index"]) for group in ordered(file, "probes")}
    spectra.sort(key=lambda s: (rank.get(s.probe, len(rank)), s.quantity))
    return {(spectrum.probe, spectrum.quantity): spectrum for spectrum in spectra}


def _beam(file: h5py.File) -> BeamResult | None:
    if "beam" not in file:
        return None
    return BeamResult(**_datasets(file["beam"], schema.BEAM_SCALES + schema.BEAM))
