"""A run as CSV tables: time histories, spectra, harmonics, events, modes, quantities along bodies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from beamsim.analyses.run.result import (
    RandomResponse,
    RunResult,
    ShockSpectrum,
    SignalStatistics,
    SpectralLine,
    Spectrum,
)
from beamsim.fields import Attribute, Counter, Dataset, filled, members_of, rows_of
from beamsim.store.csv_folder import CsvFolder, header
from beamsim.structures.stations import Stations

_OF_SPECTRUM = ("probe", "quantity", "unit")


def export_csv(result: RunResult, folder: Path) -> list[Path]:
    """One file per table: one row per observation, one column per quantity with its unit, full precision.

    ``time_histories``, ``spectra``, ``harmonics``, ``events``, ``modes``, ``mode_shapes``, ``summary`` and, for
    a beam, ``beam``; ``random_densities``, ``random_crossings``, ``random_statistics`` and ``random_transmissibility``
    of a random input; ``srs`` where shock response spectra were asked for.
    """
    out = CsvFolder(folder)
    out.numbers("time_histories", _channels(result))
    columns, of_line = _names(Spectrum, Dataset), _names(SpectralLine, Dataset)
    out.rows(
        "spectra",
        (*_OF_SPECTRUM, *columns),
        (
            (s.probe, s.quantity, s.unit, *row)
            for s in result.spectra.values()
            for row in zip(*(getattr(s, name) for name in columns), strict=True)
        ),
    )
    out.rows(
        "harmonics",
        (*_OF_SPECTRUM, *of_line),
        (
            (s.probe, s.quantity, s.unit, *(getattr(line, name) for name in of_line))
            for s in result.spectra.values()
            for line in s.lines
        ),
    )
    events, names = _along(result.events, "event"), list(result.snubbers)
    events["snubber"] = [names[index] for index in result.events.snubber]
    out.rows("events", tuple(events), zip(*map(list, events.values()), strict=True))
    modes = result.modes
    numbers = np.arange(1, modes.open_frequencies_hz.size + 1)
    out.numbers("modes", {"mode": numbers, **_along(modes, "mode")})
    shapes = {header(f"mode_{k}", _unit(modes, "shapes")): shape for k, shape in enumerate(modes.shapes, 1)}
    out.numbers("mode_shapes", {**station_columns(modes.stations), **shapes})
    for name, body in result.bodies.items():
        out.numbers(
            name if len(modes.stations.parts) == 1 else f"body_{name}",
            {
                header("position", _unit(body, "position")): body.position,
                **_along(body, "position"),
                **{
                    header(f"{which}_shape", _unit(body, "extreme_shapes")): shape
                    for which, shape in zip(("lowest", "highest"), body.extreme_shapes, strict=True)
                },
            },
        )
    if result.random is not None:
        _random_tables(out, result.random)
    if result.srs is not None:
        kinds = _names(ShockSpectrum, Dataset)
        curves = {header(f"{s.name}_{kind}", "m/s^2"): getattr(s, kind) for s in result.srs.signals for kind in kinds}
        out.numbers("srs", {"frequency_hz": result.srs.frequency_hz, **curves})
    out.summary({name: value for name, value in result.summary.items() if name != "spectral_lines"})
    return out.written


def _random_tables(out: CsvFolder, random: RandomResponse) -> None:
    """``random_densities``, ``random_crossings``, ``random_statistics`` and ``random_transmissibility``."""
    signals = (random.input, *random.signals)
    densities = {
        header(f"{s.name}_{s.quantity}_{name}", f"({s.unit})^2/Hz"): getattr(s, name)
        for s in signals
        for name in ("density", "density_open", "density_closed")
        if getattr(s, name) is not None
    }
    out.numbers("random_densities", {"frequency_hz": random.frequency_hz, **densities})
    if random.level is not None:
        crossings = {
            f"{s.name}_{s.quantity}_crossings_hz": s.crossings_hz for s in signals if s.crossings_hz is not None
        }
        out.numbers("random_crossings", {"level_in_standard_deviations": random.level, **crossings})
    texts = ("name", "quantity", "unit")
    columns = (*texts, *(name for name in _names(SignalStatistics, Attribute) if name not in texts))
    out.rows("random_statistics", columns, ([getattr(s, name) for name in columns] for s in signals))
    numbers = {"frequency_hz": random.frequency_hz}
    for name, value in random.transmissibility.items():
        numbers[f"{name}_real"], numbers[f"{name}_imag"] = value.real, value.imag
        numbers[f"{name}_coherence"] = random.coherence[name]
    out.numbers("random_transmissibility", numbers)


def _names(cls: type, kind: type) -> list[str]:
    """The fields of a class that are declared as this kind, in order."""
    return [member.name for member in members_of(cls) if isinstance(member.declaration, kind)]


def _channels(result: RunResult) -> dict[str, Any]:
    """All quantities along the time of a run."""
    columns = {header("time", _unit(result, "time")): rows_of(result, "time"), **_along(result, "time")}
    for kind, owners in (
        ("probe", result.probes),
        ("snubber", result.snubbers),
        ("spring", result.springs),
        ("friction", result.friction),
    ):
        for name, owner in owners.items():
            columns |= _along(owner, "time", f"{kind}_{name}_")
    return {**columns, **_along(result.energy, "time", "energy_")}


def _along(owner: Any, axis: str, prefix: str = "") -> dict[str, Any]:
    """By header, the datasets of a dataclass that are along one axis alone, and not None."""
    columns = {}
    for member in members_of(type(owner)):
        declared, values = member.declaration, rows_of(owner, member.name)
        if isinstance(declared, Dataset) and values is not None and _is_along(declared, axis):
            flags = values.astype(int) if isinstance(values, np.ndarray) and values.dtype == bool else values
            columns[header(f"{prefix}{member.stored_name.replace('/', '_')}", filled(declared.unit, [owner]))] = flags
    return columns


def _is_along(declared: Dataset, axis: str) -> bool:
    """Whether a dataset has this axis and no other."""
    if len(declared.along) != 1:
        return False
    (along,) = declared.along
    return axis == (along.name if isinstance(along, Counter) else along)


def _unit(owner: Any, name: str) -> str:
    """Unit of a field."""
    return next(str(member.declaration.unit) for member in members_of(type(owner)) if member.name == name)


def station_columns(stations: Stations) -> dict[str, Any]:
    """Columns with the stations: position or number of the mass, for several bodies also the body."""
    of_body = {}
    if len(stations.parts) > 1:
        sizes = [part.stations.stop - part.stations.start for part in stations]
        of_body = {"body": np.repeat(np.arange(len(sizes)), sizes)}
    across = {} if stations.across is None else {"across_m": stations.across}
    return {**of_body, "position_m" if stations.axis.continuous else "mass": stations.position, **across}
