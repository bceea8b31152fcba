"""Results for other programs: CSV tables, UFF dataset 58, MATLAB."""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.results import RunResult
from beamsim.errors import ResultFileError
from beamsim.files import replacing
from beamsim.store import schema

__all__ = ["FORMATS", "export_csv", "export_mat", "export_run", "export_target", "export_uff"]


def export_target(folder: Path, stem: str, form: str) -> Path:
    """Where an export goes: ``<stem>_csv`` (a folder of tables), ``<stem>.uff`` or ``<stem>.mat``."""
    return folder / (f"{stem}_csv" if form == "csv" else f"{stem}.{form}")


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
    a beam, ``beam``.
    """
    if folder.exists() and not folder.is_dir():
        raise ResultFileError(f"cannot write {folder}: a folder of tables is to go there; choose another place with -o")
    written = []

    @contextmanager
    def table(name: str, columns: Sequence[str]) -> Iterator[TextIO]:
        written.append(folder / f"{name}.csv")
        with replacing(written[-1]) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
            csv.writer(stream).writerow(columns)
            yield stream

    def rows(name: str, columns: Sequence[str], values: Iterable[Sequence[Any]]) -> None:
        with table(name, columns) as stream:
            csv.writer(stream).writerows(values)

    def numbers(name: str, columns: Mapping[str, NDArray[Any]]) -> None:
        with table(name, list(columns)) as stream:
            np.savetxt(stream, np.column_stack([*columns.values()]), fmt="%.17g", delimiter=",", newline="\r\n")

    numbers("time_histories", dict(_channels(result)))
    rows(
        "spectra",
        ("probe", "quantity", "unit", "frequency_hz", "amplitude", "amplitude_db"),
        (
            (s.probe, s.quantity, s.unit, f, a, level)
            for s in result.spectra.values()
            for f, a, level in zip(s.frequency_hz.tolist(), s.amplitude.tolist(), s.amplitude_db.tolist(), strict=True)
        ),
    )
    rows(
        "harmonics",
        ("probe", "quantity", "unit", "order", "frequency_hz", "amplitude", "amplitude_db", "phase_deg", "kind"),
        ((s.probe, s.quantity, s.unit, *asdict(line).values()) for s in result.spectra.values() for line in s.lines),
    )
    names = list(result.snubbers)
    rows(
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
    numbers(
        "modes",
        {
            "mode": np.arange(1, modes.open_frequencies_hz.size + 1),
            "open_frequency_hz": modes.open_frequencies_hz,
            "closed_frequency_hz": modes.closed_frequencies_hz,
            "damping_ratio": modes.damping_ratios,
        },
    )
    numbers(
        "mode_shapes",
        {
            "mass" if result.beam is None else "position_m": modes.position,
            **{f"mode_{k}_per_sqrt_kg": shape for k, shape in enumerate(modes.shapes, 1)},
        },
    )
    if result.beam is not None:
        numbers(
            "beam",
            {
                "position_m": result.beam.position,
                "peak_bending_stress_pa": result.beam.peak_bending_stress,
                "lowest_shape_m": result.beam.extreme_shapes[0],
                "highest_shape_m": result.beam.extreme_shapes[1],
                "static_shape_m": result.beam.static_shape,
            },
        )
    rows("summary", ("name", "item", "value"), _flat(result.summary))
    return written


def _channels(result: RunResult) -> Iterator[tuple[str, NDArray[Any]]]:
    unit = {"m": "m", "m/s": "m_per_s", "m/s^2": "m_per_s2", "N": "n", "J": "j"}
    yield "time_s", result.time
    for field in schema.BASE:
        yield f"base_{field.name}_{unit[field.units]}", getattr(result, f"base_{field.name}")
    for probe in result.probes.values():
        for field in schema.PROBE:
            yield f"probe_{probe.name}_{field.name}_{unit[field.units]}", getattr(probe, field.name)
    for snubber in result.snubbers.values():
        for field in schema.SNUBBER:
            suffix = "" if field.flags else f"_{unit[field.units]}"
            yield f"snubber_{snubber.name}_{field.name}{suffix}", getattr(snubber, field.name)
    for field in schema.ENERGY:
        yield f"energy_{field.name}_{unit[field.units]}", getattr(result.energy, field.name)


def _flat(summary: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    for name, value in summary.items():
        if isinstance(value, Mapping):
            yield from ((name, item, number) for item, number in value.items())
        elif isinstance(value, (list, tuple)):
            if not any(isinstance(item, Mapping) for item in value):  # the lines have a table of their own
                yield from ((name, item, number) for item, number in enumerate(value, 1))
        else:
            yield name, "", value


# --- UFF ------------------------------------------------------------------------------------------------------------

# Codes of the universal file format: (specific data type, length exponent, force exponent).
_ORDINATES = {
    "displacement": (8, 1, 0),
    "absolute_displacement": (8, 1, 0),
    "penetration": (8, 1, 0),
    "velocity": (11, 1, 0),
    "absolute_acceleration": (12, 1, 0),
    "acceleration": (12, 1, 0),
    "force": (9, 0, 1),
}
_TIME, _FREQUENCY = 17, 18
_GENERAL, _TIME_RESPONSE = 0, 1
_UP = 3  # +z: deflections are positive upwards


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

    probes, snubbers = result.probes.values(), result.snubbers.values()
    places = np.array([*(p.position for p in probes), *(s.position for s in snubbers), 0.0])
    numbers = np.arange(1, places.size + 1)
    zeros = np.zeros(places.size)
    sets = [
        pyuff.prepare_164(
            units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0, temp_offset=0.0
        ),
        pyuff.prepare_15(node_nums=numbers, x=places, y=zeros, z=zeros),
    ]
    base_node = int(numbers[-1])
    for node, probe in enumerate(probes, 1):
        sets += [
            _dataset_58(result, probe.name, field.name, field.units, node, result.time, getattr(probe, field.name))
            for field in schema.PROBE
        ]
        for quantity in [q for name, q in result.spectra if name == probe.name]:
            s = result.spectra[probe.name, quantity]
            if s.frequency_hz.size > 1:
                sets.append(
                    _dataset_58(
                        result, probe.name, quantity, s.unit, node, s.frequency_hz, s.amplitude, of_frequency=True
                    )
                )
    for node, snubber in enumerate(snubbers, len(probes) + 1):
        for field in schema.SNUBBER:
            if field.flags is None:
                direction = -_UP if field.name == "force" and snubber.side == "above" else _UP
                history = getattr(snubber, field.name)
                sets.append(
                    _dataset_58(
                        result, snubber.name, field.name, field.units, node, result.time, history, direction=direction
                    )
                )
    for field in schema.BASE:
        history = getattr(result, f"base_{field.name}")
        sets.append(_dataset_58(result, "base", field.name, field.units, base_node, result.time, history))
    with replacing(path) as temporary, warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves the closing of binary sets to Python
        pyuff.UFF(str(temporary)).write_sets(sets, mode="overwrite")
    return [path]


def _dataset_58(
    result: RunResult,
    name: str,
    quantity: str,
    unit: str,
    node: int,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    of_frequency: bool = False,
    direction: int = _UP,
) -> dict[str, Any]:
    kind, length_exponent, force_exponent = _ORDINATES[quantity]
    increment = (x[-1] - x[0]) / (x.size - 1)
    exact = all(abs(float(f"{v:.5e}") - v) <= 1e-12 * increment for v in (x[0], increment))
    label = f"{name} {quantity.replace('_', ' ')}{' spectrum' if of_frequency else ''}"
    return {
        "type": 58,
        "binary": 0 if exact else 1,
        "func_type": _GENERAL if of_frequency else _TIME_RESPONSE,
        "rsp_ent_name": _ascii(name, 10),
        "rsp_node": node,
        "rsp_dir": direction,
        "ref_ent_name": "NONE",
        "ref_node": 0,
        "ref_dir": 0,
        "id1": _ascii(label, 80),
        "id2": _ascii(result.title, 80),
        "id3": _date(result.created),
        "id4": _ascii(f"beamsim {result.provenance.get('beamsim', '')}, {result.method}", 80),
        "abscissa_spacing": int(exact),
        "abscissa_spec_data_type": _FREQUENCY if of_frequency else _TIME,
        "abscissa_axis_lab": "Frequency" if of_frequency else "Time",
        "abscissa_axis_units_lab": "Hz" if of_frequency else "s",
        "ordinate_spec_data_type": kind,
        "ordinate_len_unit_exp": length_exponent,
        "ordinate_force_unit_exp": force_exponent,
        "ordinate_axis_lab": _ascii(quantity.replace("_", " ").capitalize(), 20),
        "ordinate_axis_units_lab": unit,
        "orddenom_spec_data_type": 0,
        "x": np.array(x, dtype=float),
        "data": np.array(y, dtype=float),
    }


def _ascii(text: str, width: int) -> str:
    return " ".join(text.encode("ascii", "replace").decode().split())[:width] or "NONE"


def _date(created: str) -> str:
    try:
        return datetime.fromisoformat(created).strftime("%d-%b-%y %H:%M:%S").upper()
    except ValueError:
        return "NONE"


# --- MATLAB ---------------------------------------------------------------------------------------------------------


def export_mat(result: RunResult, path: Path) -> list[Path]:
    """MATLAB file (version 5) with the structure of the result file; names become valid field names."""
    from scipy.io import savemat

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
        "base": {field.name: getattr(result, f"base_{field.name}") for field in schema.BASE},
        "events": {**vars(result.events), "snubber": result.events.snubber + 1},  # MATLAB counts from 1
        "spectra": spectra,
        "energy": dict(vars(result.energy)),
        "modes": dict(vars(result.modes)),
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
    if result.beam is not None:
        variables["beam"] = dict(vars(result.beam))
    with replacing(path) as temporary:
        savemat(
            str(temporary), _matlab(variables), appendmat=False, long_field_names=True, oned_as="column",
            do_compression=True,
        )  # fmt: skip
    return [path]


def _matlab(value: Any) -> Any:
    if isinstance(value, Mapping):
        fields: dict[str, Any] = {}
        for name, item in value.items():
            field = _field_name(str(name))
            while field in fields:
                field += "_"
            fields[field] = _matlab(item)
        return fields
    if isinstance(value, (list, tuple)):
        if all(isinstance(item, (int, float)) for item in value):
            return np.array(value, dtype=float)
        cells = np.empty(len(value), dtype=object)
        cells[:] = [_matlab(item) for item in value]
        return cells
    return np.nan if value is None else value


def _field_name(name: str) -> str:
    field = re.sub(r"[^0-9A-Za-z_]", "_", name)[:60]
    return field if re.match(r"[A-Za-z]", field) else f"x{field}"


FORMATS: dict[str, Callable[[RunResult, Path], list[Path]]] = {
    "csv": export_csv,
    "uff": export_uff,
    "mat": export_mat,
}
