"""Open a result file as the result it was written from."""

from __future__ import annotations

import json
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from beamsim.analyses.results import (
    BeamResult,
    EnergyHistory,
    EventLog,
    ModeTable,
    ProbeHistory,
    RunResult,
    SnubberHistory,
    SpectralLine,
    Spectrum,
    Work,
)
from beamsim.errors import ResultFileError
from beamsim.store import schema
from beamsim.store.random_response import read_random

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

__all__ = ["StoredRun", "open_result"]


class StoredRun(RunResult):
    """A run read from a file; its scenario is parsed when it is first asked for."""

    scenario_yaml: str
    beamsim_version: str
    _title: str

    @cached_property
    def scenario(self) -> Scenario:
        """The resolved scenario the run was made with."""
        from beamsim.scenario import load_scenario

        return load_scenario(self.scenario_yaml)

    @property
    def title(self) -> str:
        """The scenario's title, known without parsing it."""
        return self._title

    @classmethod
    def _of(cls, fields: dict[str, Any]) -> StoredRun:
        stored = cls.__new__(cls)
        stored.__dict__.update(fields)  # the scenario is left out, so __init__ cannot be called
        return stored


def open_result(path: Path | str) -> StoredRun:
    """Read a result file written by ``beamsim run``.

    Raises
    ------
    ResultFileError
        When the file is missing, no HDF5 file, not one of beamsim's, damaged, or of a layout
        this version does not know.
    """
    if not Path(path).is_file():
        raise ResultFileError(f"{path}: no such result file; `beamsim run case.yaml` writes one")
    try:
        file = h5py.File(path, "r")
    except PermissionError as error:
        raise ResultFileError(f"{path}: no permission to read it") from error
    except OSError as error:
        raise ResultFileError(
            f"{path}: not an HDF5 file, or damaged; give the .h5 file that `beamsim run` wrote, or run the case again"
        ) from error
    with file:
        _check_origin(file, path)
        try:
            return StoredRun._of(_fields(file))
        except (KeyError, ValueError, TypeError, OSError, RuntimeError) as error:
            raise ResultFileError(f"{path}: damaged ({error}); run the case again") from error


def _check_origin(file: h5py.File, path: Path | str) -> None:
    try:
        version, command = file.attrs.get("schema_version"), file.attrs.get("command")
    except (OSError, RuntimeError) as error:
        raise ResultFileError(f"{path}: damaged ({error}); run the case again") from error
    if version is None or command is None:
        raise ResultFileError(f"{path}: an HDF5 file, but not one of beamsim's; give the .h5 file of `beamsim run`")
    if version != schema.SCHEMA_VERSION:
        writer = file.attrs.get("beamsim_version", "unknown")
        raise ResultFileError(
            f"{path}: schema_version {version}, written by beamsim {writer}, but this beamsim reads "
            f"{schema.SCHEMA_VERSION}; open it with that version or run its scenario again"
        )
    if command != schema.COMMAND:
        raise ResultFileError(f"{path}: holds the result of `beamsim {command}`, not of `beamsim {schema.COMMAND}`")


def _fields(file: h5py.File) -> dict[str, Any]:
    attributes = file.attrs
    return {
        "scenario_yaml": attributes["scenario"],
        "beamsim_version": attributes["beamsim_version"],
        "_title": attributes["title"],
        "method": attributes["method"],
        "status": attributes["status"],
        "created": attributes["created"],
        "wall_time_s": float(attributes["wall_time_s"]),
        "warnings": tuple(json.loads(attributes["warnings"])),
        "provenance": json.loads(attributes["provenance"]),
        "time": file["time"][()],
        "probes": {g.attrs["name"]: ProbeHistory(**_members(g, schema.PROBE)) for g in _ordered(file, "probes")},
        "snubbers": {
            g.attrs["name"]: SnubberHistory(**_members(g, schema.SNUBBER)) for g in _ordered(file, "snubbers")
        },
        "base_acceleration": file["base/acceleration"][()],
        "base_displacement": file["base/displacement"][()],
        "events": EventLog(**_datasets(file["events"], schema.EVENTS)),
        "spectra": _spectra(file),
        "beam": _beam(file),
        "energy": EnergyHistory(**_datasets(file["energy"], schema.ENERGY)),
        "modes": _modes(file["modes"]),
        "random": read_random(file),
        "work": Work(**_attributes(file["work"])),
        "summary": schema.decode_summary(dict(file["summary"].attrs)),
    }


def _datasets(group: h5py.Group, fields: tuple[schema.Field, ...]) -> dict[str, Any]:
    values = {field.name: group[field.name][()] for field in fields}
    return {field.name: values[field.name].astype(bool) if field.flags else values[field.name] for field in fields}


def _attributes(group: h5py.Group) -> dict[str, Any]:
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in group.attrs.items()}


def _members(group: h5py.Group, fields: tuple[schema.Field, ...]) -> dict[str, Any]:
    attributes = _attributes(group)
    del attributes["index"]
    return {**attributes, **_datasets(group, fields)}


def _ordered(file: h5py.File, parent: str) -> list[h5py.Group]:
    return sorted(file[parent].values(), key=lambda group: int(group.attrs["index"])) if parent in file else []


def _spectra(file: h5py.File) -> dict[tuple[str, str], Spectrum]:
    found = []
    for probe in file["spectra"].values() if "spectra" in file else ():
        groups = [probe, *(member for member in probe.values() if isinstance(member, h5py.Group))]
        found += [group for group in groups if "window" in group.attrs]
    spectra = [_spectrum(group) for group in found]
    rank = {group.attrs["name"]: int(group.attrs["index"]) for group in _ordered(file, "probes")}
    spectra.sort(key=lambda s: (rank.get(s.probe, len(rank)), s.quantity))
    return {(spectrum.probe, spectrum.quantity): spectrum for spectrum in spectra}


def _spectrum(group: h5py.Group) -> Spectrum:
    table = group["lines"]
    columns: dict[str, list[Any]] = {
        field.name: (table[field.name].asstr() if field.name == "kind" else table[field.name])[()].tolist()
        for field in schema.LINES
    }
    lines = tuple(SpectralLine(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True))
    axes = {name: group[name][()] for name in ("frequency_hz", "amplitude", "amplitude_db")}
    return Spectrum(**axes, **_attributes(group), lines=lines)


def _beam(file: h5py.File) -> BeamResult | None:
    if "beam" not in file:
        return None
    return BeamResult(**_datasets(file["beam"], schema.BEAM_SCALES + schema.BEAM))


def _modes(group: h5py.Group) -> ModeTable:
    return ModeTable(position=group["position"][()], **_datasets(group, schema.MODES), **_attributes(group))
