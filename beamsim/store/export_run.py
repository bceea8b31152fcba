"""A run for other programs: CSV tables, UFF dataset 58, MATLAB."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.run.result import BodyResult, RandomResponse, RunResult
from beamsim.errors import ResultFileError
from beamsim.store import schema
from beamsim.store.csv_folder import CsvFolder, header
from beamsim.store.matlab import write_mat
from beamsim.store.uff import GENERAL, UP, Source, record_58, write_uff
from beamsim.structures.stations import Stations
from beamsim.system.structural import ModeTable


def export_run(result: RunResult, target: Path | str, form: str) -> list[Path]:
    """Write ``result`` in the format ``form`` (one of `FORMATS`); returns the files written.

    Raises
    ------
    ResultFileError
        When the format is unknown or the files cannot be written.
    """
    if form not in FORMATS:
        raise ResultFileError(f"no format {form!r}; choose one of {', '.join(FORMATS)}")
    return FORMATS[form](result, Path(target))


# --- CSV ------------------------------------------------------------------------------------------------------------


def export_csv(result: RunResult, folder: Path) -> list[Path]:
    """One table a file: an observation a row, a quantity with its unit a column, full precision.

    ``time_histories``, ``spectra``, ``harmonics``, ``events``, ``modes``, ``mode_shapes``, ``summary`` and, for
    a beam, ``beam``; ``random_densities``, ``random_statistics`` and ``random_transmissibility`` of a random input.
    """
    out = CsvFolder(folder)
    out.numbers("time_histories", dict(_channels(result)))
    out.rows(
        "spectra",
        ("probe", "quantity", "unit", "frequency_hz", "amplitude", "amplitude_db"),
        (
            (s.probe, s.quantity, s.unit, f, a, level)
            for s in result.spectra.values()
            for f, a, level in zip(s.frequency_hz.tolist(), s.amplitude.tolist(), s.amplitude_db.tolist(), strict=True)
        ),
    )
    out.rows(
        "harmonics",
        ("probe", "quantity", "unit", "order", "frequency_hz", "amplitude", "amplitude_db", "phase_deg", "kind"),
        ((s.probe, s.quantity, s.unit, *asdict(line).values()) for s in result.spectra.values() for line in s.lines),
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
    numbers = [f.name for f in fields(random.input) if f.name not in ("name", "quantity", "unit", "density")]
    out.rows(
        "random_statistics",
        ("name", "quantity", "unit", *numbers),
        ((s.name, s.quantity, s.unit, *(getattr(s, name) for name in numbers)) for s in signals),
    )
    columns = {"frequency_hz": random.frequency_hz}
    for name, value in random.transmissibility.items():
        columns[f"{name}_real"], columns[f"{name}_imag"] = value.real, value.imag
        columns[f"{name}_coherence"] = random.coherence[name]
    out.numbers("random_transmissibility", columns)


def _channels(result: RunResult) -> Iterator[tuple[str, NDArray[Any]]]:
    yield "time_s", result.time
    for field in schema.BASE:
        yield header(f"base_{field.name}", field.units), getattr(result, f"base_{field.name}")
    for probe in result.probes.values():
        for field in schema.PROBE:
            yield header(f"probe_{probe.name}_{field.name}", field.units), getattr(probe, field.name)
    for snubber in result.snubbers.values():
        for field in schema.SNUBBER:
            yield header(f"snubber_{snubber.name}_{field.name}", field.units), getattr(snubber, field.name)
    for spring in result.springs.values():
        for field in schema.SPRING:
            yield header(f"spring_{spring.name}_{field.name}", field.units), getattr(spring, field.name)
    for field in schema.ENERGY:
        yield header(f"energy_{field.name}", field.units), getattr(result.energy, field.name)


# --- UFF ------------------------------------------------------------------------------------------------------------


def export_uff(result: RunResult, path: Path) -> list[Path]:
    """Universal file: units (164), nodes (15) and every history and spectrum as dataset 58, ASCII.

    Nodes are numbered through the probes, then the snubbers, then the base (at the origin), in the order of the
    scenario; x is the position along the beam (the number of the mass in a chain) and motion is along +z. The force of
    a snubber above the structure is along -z. Time histories are of function type 1 (time response). Amplitude
    spectra are of type 0 (general), because type 12 (spectrum) is not among those pyuff writes. An equally
    spaced abscissa is stored as start and increment with 6 digits; where that would not be exact the
    dataset is stored in binary (58b) with every abscissa.
    """
    import pyuff

    source = Source(result.title, result.created, f"beamsim {result.provenance.get('beamsim', '')}, {result.method}")
    probes, snubbers = result.probes.values(), result.snubbers.values()
    places = np.array([*(p.position for p in probes), *(s.position for s in snubbers), 0.0])
    numbers = np.arange(1, places.size + 1)
    zeros = np.zeros(places.size)
    sets = [pyuff.prepare_15(node_nums=numbers, x=places, y=zeros, z=zeros)]
    base_node = int(numbers[-1])
    for node, probe in enumerate(probes, 1):
        sets += [
            record_58(source, probe.name, field.name, field.units, node, result.time, getattr(probe, field.name))
            for field in schema.PROBE
        ]
        for quantity in [q for name, q in result.spectra if name == probe.name]:
            s = result.spectra[probe.name, quantity]
            if s.frequency_hz.size > 1:
                sets.append(
                    record_58(
                        source,
                        probe.name,
                        quantity,
                        s.unit,
                        node,
                        s.frequency_hz,
                        s.amplitude,
                        kind=GENERAL,
                        label=f"{probe.name} {quantity.replace('_', ' ')} spectrum",
                    )
                )
    for node, snubber in enumerate(snubbers, len(probes) + 1):
        for field in schema.SNUBBER:
            if field.flags is None:
                direction = -UP if field.name == "force" and snubber.side == "above" else UP
                history = getattr(snubber, field.name)
                sets.append(
                    record_58(
                        source, snubber.name, field.name, field.units, node, result.time, history, direction=direction
                    )
                )
    for field in schema.BASE:
        history = getattr(result, f"base_{field.name}")
        sets.append(record_58(source, "base", field.name, field.units, base_node, result.time, history))
    write_uff(sets, path)
    return [path]


# --- MATLAB ---------------------------------------------------------------------------------------------------------


def _mode_variables(modes: ModeTable) -> dict[str, Any]:
    """The table as variables, its stations as their positions."""
    position = modes.stations.position
    return {"position" if key == "stations" else key: position if key == "stations" else value
            for key, value in vars(modes).items()}  # fmt: skip


def _known(body: BodyResult) -> dict[str, Any]:
    return {key: value for key, value in vars(body).items() if value is not None}


def station_columns(stations: Stations) -> dict[str, Any]:
    """Columns that say where stations are: the position or the number of the mass, of several bodies with the body."""
    of_body = {}
    if len(stations.parts) > 1:
        sizes = [part.stations.stop - part.stations.start for part in stations]
        of_body = {"body": np.repeat(np.arange(len(sizes)), sizes)}
    return {**of_body, "position_m" if stations.axis.continuous else "mass": stations.position}


def export_mat(result: RunResult, path: Path) -> list[Path]:
    """MATLAB file (version 5) with the structure of the result file; names become valid field names."""

    def struct(value: Any, fields: tuple[schema.Field, ...], *more: str) -> dict[str, Any]:
        return {name: getattr(value, name) for name in (*more, *(field.name for field in fields))}

    spectra: dict[str, dict[str, Any]] = {}
    for (probe, quantity), s in result.spectra.items():
        columns = {field.name: [getattr(line, field.name) for line in s.lines] for field in schema.LINES}
        kinds = np.array(columns.pop("kind"), dtype=object)
        spectra.setdefault(probe, {})[quantity] = {
            **{key: value for key, value in vars(s).items() if key != "lines"},
            "lines": {**{key: np.array(value, dtype=float) for key, value in columns.items()}, "kind": kinds},
        }
    variables = {
        "time": result.time,
        "probes": {name: struct(p, schema.PROBE, "name", "position") for name, p in result.probes.items()},
        "snubbers": {name: dict(vars(s)) for name, s in result.snubbers.items()},
        "springs": {name: dict(vars(s)) for name, s in result.springs.items()},
        "base": {field.name: getattr(result, f"base_{field.name}") for field in schema.BASE},
        "events": {**vars(result.events), "snubber": result.events.snubber + 1},  # MATLAB counts from 1
        "spectra": spectra,
        "energy": dict(vars(result.energy)),
        "modes": {**_mode_variables(result.modes)},
        "work": dict(vars(result.work)),
        "summary": result.summary,
        "info": {
            "title": result.title,
            "status": result.status,
            "method": result.method,
            "created": result.created,
            "wall_time_s": result.wall_time_s,
            "warnings": np.array(result.warnings, dtype=object),
        },
    }
    if len(result.modes.stations.parts) == 1:
        variables |= {name: _known(body) for name, body in result.bodies.items()}
    else:
        variables["bodies"] = {name: _known(body) for name, body in result.bodies.items()}
    if result.random is not None:
        variables["random"] = asdict(result.random)
    write_mat(variables, path)
    return [path]


FORMATS: dict[str, Callable[[RunResult, Path], list[Path]]] = {
    "csv": export_csv,
    "uff": export_uff,
    "mat": export_mat,
}
