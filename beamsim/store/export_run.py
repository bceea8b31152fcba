"""A run as CSV tables: time histories, spectra, harmonics, events, modes, quantities along bodies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.run.result import RandomResponse, RunResult, SignalStatistics, SpectralLine, Spectrum
from beamsim.fields import Attribute, Dataset, members_of
from beamsim.store.csv_folder import CsvFolder, header
from beamsim.structures.stations import Stations

_OF_SPECTRUM = ("probe", "quantity", "unit")


def export_csv(result: RunResult, folder: Path) -> list[Path]:
    """One file per table: one row per observation, one column per quantity with its unit, full precision.

    ``time_histories``, ``spectra``, ``harmonics``, ``events``, ``modes``, ``mode_shapes``, ``summary`` and, for
    a beam, ``beam``; ``random_densities``, ``random_statistics`` and ``random_transmissibility`` of a random input.
    """
    out = CsvFolder(folder)
    out.numbers("time_histories", dict(_channels(result)))
    columns, of_line = _names(Spectrum, Dataset), _names(SpectralLine, Dataset)
    out.rows(
        "spectra",
        (*_OF_SPECTRUM, *columns),
        (
            (s.probe, s.quantity, s.unit, *row)
            for s in result.spectra.values()
            for row in zip(*(getattr(s, name).tolist() for name in columns), strict=True)
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
    names = list(result.snubbers)
    out.rows(
        "events",
        ("time_s", "snubber", "closing"),
        (
            (time, names[which], int(closing))
            for time, which, closing in zip(
                result.events.time.tolist(), result.events.snubber, result.events.closing, strict=True
            )
        ),
    )
    modes = result.modes
    out.numbers(
        "modes",
        {
            "mode": np.arange(1, modes.open_frequencies_hz.size + 1),
            "open_frequency_hz": modes.open_frequencies_hz,
            "closed_frequency_hz": modes.closed_frequencies_hz,
            "damping_ratio": modes.damping_ratios,
        },
    )
    out.numbers(
        "mode_shapes",
        {
            **station_columns(modes.stations),
            **{f"mode_{k}_per_sqrt_kg": shape for k, shape in enumerate(modes.shapes, 1)},
        },
    )
    for name, body in result.bodies.items():
        stress = body.peak_bending_stress
        out.numbers(
            name if len(modes.stations.parts) == 1 else f"body_{name}",
            {
                "position_m": body.position,
                **({} if stress is None else {"peak_bending_stress_pa": stress}),
                "lowest_shape_m": body.extreme_shapes[0],
                "highest_shape_m": body.extreme_shapes[1],
                "static_shape_m": body.static_shape,
            },
        )
    if result.random is not None:
        _random_tables(out, result.random)
    out.summary({name: value for name, value in result.summary.items() if name != "spectral_lines"})
    return out.written


def _random_tables(out: CsvFolder, random: RandomResponse) -> None:
    """``random_densities``, ``random_statistics`` and ``random_transmissibility``."""
    signals = (random.input, *random.signals)
    densities = {header(f"{s.name}_{s.quantity}_density", f"({s.unit})^2/Hz"): s.density for s in signals}
    out.numbers("random_densities", {"frequency_hz": random.frequency_hz, **densities})
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


def _channels(result: RunResult) -> Iterator[tuple[str, NDArray[Any]]]:
    """All quantities along the time of a run."""
    yield "time_s", result.time
    yield from _along_time("", result)
    for kind, owners in (("probe", result.probes), ("snubber", result.snubbers), ("spring", result.springs)):
        for name, owner in owners.items():
            yield from _along_time(f"{kind}_{name}_", owner)
    yield from _along_time("energy_", result.energy)


def _along_time(prefix: str, owner: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    for member in members_of(type(owner)):
        declared = member.declaration
        if isinstance(declared, Dataset) and declared.along == ("time",):
            name = f"{prefix}{member.stored_name.replace('/', '_')}"
            yield header(name, declared.unit), getattr(owner, member.name)


def station_columns(stations: Stations) -> dict[str, Any]:
    """Columns with the stations: position or number of the mass, for several bodies also the body."""
    of_body = {}
    if len(stations.parts) > 1:
        sizes = [part.stations.stop - part.stations.start for part in stations]
        of_body = {"body": np.repeat(np.arange(len(sizes)), sizes)}
    return {**of_body, "position_m" if stations.axis.continuous else "mass": stations.position}
