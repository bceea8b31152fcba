"""A spectrum with its table of lines as a group of a result file."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np

from beamsim.analyses.run.result import SpectralLine, Spectrum
from beamsim.store import schema
from beamsim.store.datasets import native, put, texts, words

_NUMBERS = ("probe", "quantity", "unit", "excitation_hz", "window", "start_s", "duration_s")


def write_spectrum(group: h5py.Group, spectrum: Spectrum) -> None:
    """Write a spectrum into ``group``, and its lines into ``group/lines``."""
    group.attrs.update({name: getattr(spectrum, name) for name in _NUMBERS})
    axis, amplitude, level = schema.spectrum_fields(spectrum.quantity, spectrum.unit)
    frequency = put(group, axis, spectrum.frequency_hz, scale=True)
    put(group, amplitude, spectrum.amplitude, frequency)
    put(group, level, spectrum.amplitude_db, frequency)
    table = group.create_group("lines")
    number = put(table, schema.LINE_NUMBER, np.arange(1, len(spectrum.lines) + 1), scale=True)
    for field in schema.LINES:
        values = [getattr(line, field.name) for line in spectrum.lines]
        column = words(values) if field.name == "kind" else np.array(values, dtype=float)
        put(table, field._replace(units=field.units or spectrum.unit), column, number)


def read_spectrum(group: h5py.Group) -> Spectrum:
    """Inverse of `write_spectrum`."""
    table = group["lines"]
    columns: dict[str, list[Any]] = {
        field.name: texts(table[field.name]) if field.name == "kind" else table[field.name][()].tolist()
        for field in schema.LINES
    }
    lines = tuple(SpectralLine(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True))
    axes = {name: group[name][()] for name in ("frequency_hz", "amplitude", "amplitude_db")}
    return Spectrum(**axes, **native(group, *_NUMBERS), lines=lines)
