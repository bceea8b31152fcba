"""Result files for other programs: CSV tables, universal files (UFF 58), MATLAB.

Runs and design studies have CSV tables made for them (`beamsim.store.export_run`, `beamsim.store.export_designs`);
everything else follows from the dimension scales of the file (`beamsim.store.tables`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.analyses.result import Result
from beamsim.errors import ResultFileError
from beamsim.store import schema
from beamsim.store.csv_folder import CsvFolder, flat, header
from beamsim.store.matlab import write_mat
from beamsim.store.results import open_result
from beamsim.store.stored import LazyScenario, kind_of, reading, root_fields
from beamsim.store.tables import ExportTable, tables_of, values_of


def export_target(folder: Path, stem: str, form: str) -> Path:
    """Path of the folder of tables or of the file: ``<stem>_csv``, ``<stem>.uff`` or ``<stem>.mat``."""
    return folder / (f"{stem}_csv" if form == "csv" else f"{stem}.{form}")


def is_folder(kind: str, form: str) -> bool:
    """Whether an export of this kind of result is a folder of tables, not one file."""
    return form == "csv" and kind != "designs"


def export_result(path: Path | str, target: Path | str, form: str) -> list[Path]:
    """Write a result file of any kind in the format ``form`` (one of `FORMATS`); returns the files written.

    Raises
    ------
    ResultFileError
        If the format is unknown or cannot hold the result, or a file cannot be read or written.
    """
    if form not in FORMATS:
        raise ResultFileError(f"no format {form!r}; choose one of {', '.join(FORMATS)}")
    path, target, kind = Path(path), Path(target), kind_of(path)
    if kind == "run" and form == "csv":
        from beamsim.store.export_run import export_csv

        return export_csv(open_result(path), target)
    if kind == "designs" and form == "csv":
        from beamsim.store.export_designs import export_designs

        return [export_designs(open_result(path), target)]
    return FORMATS[form](path, target)


def _export_csv(path: Path, folder: Path) -> list[Path]:
    """A table for every set of axes, ``columns`` that says what each column is, attributes, summary and scenario."""
    out = CsvFolder(folder)
    described: list[tuple[str, str, str, str]] = []
    with reading(path) as file:
        for table in tables_of(file):
            names, units, long_names = zip(*_columns(table), strict=True)
            out.rows(table.name, names, _rows(table))
            described += [(f"{table.name}.csv", *column) for column in zip(names, units, long_names, strict=True)]
        out.rows("columns", ("file", "column", "units", "long_name"), described)
        out.rows("attributes", ("group", "attribute", "value"), _attributes(file))
        out.summary(schema.decode_summary(dict(file["summary"].attrs)))
        out.text("scenario.yaml", str(file.attrs["scenario"]))
    return out.written


def _columns(table: ExportTable) -> Iterator[tuple[str, str, str]]:
    """Header, units and long name of every column."""
    seen: set[str] = set()
    owners = [(axis.name, axis.units, axis.long_name) for axis in table.axes]
    members = [(column.name.replace("/", "_"), column.units, column.long_name) for column in table.columns]
    for name, units, long_name in (*owners, *members):
        text = header(name, units)
        while text in seen:
            text += "_2"
        seen.add(text)
        yield text, units, long_name


def _rows(table: ExportTable) -> Iterator[tuple[Any, ...]]:
    """One row for each combination of values of the axes."""
    shape = tuple(axis.values.size for axis in table.axes)
    grid = np.meshgrid(*(np.arange(size) for size in shape), indexing="ij") if shape else []
    columns = [axis.values[index.ravel()] for axis, index in zip(table.axes, grid, strict=True)]
    columns += [np.reshape(column.values, -1) for column in table.columns]
    return zip(*(_values(column) for column in columns), strict=True)


def _values(column: Any) -> list[Any]:
    return list((column.astype(int) if column.dtype == bool else column).tolist())


def _native(owner: h5py.Group | h5py.Dataset) -> dict[str, Any]:
    """Attributes as Python values."""
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in owner.attrs.items()}


def _attributes(file: h5py.File) -> Iterator[tuple[str, str, Any]]:
    """Attributes of all groups and scalar datasets; the scenario and the summary are in separate files."""
    yield from (("/", name, value) for name, value in _native(file).items() if name != "scenario")
    listed: list[tuple[str, str, Any]] = []

    def note(name: str, item: Any) -> None:
        if name != "summary" and (isinstance(item, h5py.Group) or not item.shape):
            for key, value in _native(item).items():
                values = value.tolist() if isinstance(value, np.ndarray) else value
                listed.extend((f"/{name}", f"{key}/{at}" if at else key, v) for at, v in flat(values))

    file.visititems(note)
    yield from listed


def _export_mat(path: Path, target: Path) -> list[Path]:
    """Structs as the groups of the file; a group's ``attributes``, and the ``units`` of its datasets, in structs too.

    Pairs of datasets ``…_real`` and ``…_imag`` become one complex array.
    """
    with reading(path) as file:
        variables = _struct(file)
        variables["info"] = {
            **{
                name: value
                for name, value in _native(file).items()
                if name not in ("warnings", "provenance", "input_files")
            },
            "warnings": np.array(json.loads(file.attrs["warnings"]), dtype=object),
        }
        variables["summary"] = schema.decode_summary(dict(file["summary"].attrs))
        variables.pop("attributes", None)
        if "events" in variables:
            variables["events"]["snubber"] += 1  # MATLAB counts from 1
    write_mat(variables, target)
    return [target]


def _struct(group: h5py.Group) -> dict[str, Any]:
    struct: dict[str, Any] = {}
    units: dict[str, str] = {}
    for name, item in group.items():
        if isinstance(item, h5py.Group):
            struct[name] = _struct(item)
            continue
        values, stem = values_of(item), name.removesuffix("_real").removesuffix("_imag")
        if name.endswith("_imag") and f"{stem}_real" in group:
            continue
        if name.endswith("_real") and f"{stem}_imag" in group:
            values, name = values + 1j * values_of(group[f"{stem}_imag"]), stem
        struct[name] = str(values[()]) if values.dtype == object and not values.shape else values
        units[name] = str(item.attrs.get("units", ""))
    attributes = {
        name: value for name, value in _native(group).items() if not isinstance(value, (h5py.Reference, np.void))
    }
    if units:
        struct["units"] = units
    if attributes:
        struct["attributes"] = attributes
    return struct


class _Header(LazyScenario, Result):
    """Fields of every result file."""


def _export_uff(path: Path, target: Path) -> list[Path]:
    """Universal file: everything at a probe or snubber that is a function of time or frequency."""
    from beamsim.store.records import records_of
    from beamsim.store.uff import write_uff

    with reading(path) as file:
        records = records_of(file, _Header.of(root_fields(file)))
    if not records:
        raise ResultFileError(
            f"{path}: holds nothing over time or frequency that a universal file could carry; "
            "use --format csv or --format mat"
        )
    write_uff(records, target)
    return [target]


def remark_on_places(path: Path) -> str:
    """That nodes of imported bodies have no coordinates in a universal file of a result; empty where all have some."""
    from beamsim.store.records import bodies_without_places

    with reading(path) as file:
        bodies = bodies_without_places(file, _Header.of(root_fields(file)).scenario)
    if not bodies:
        return ""
    return (
        f"the table of {', '.join(bodies)} (dofs) gives nodes no coordinates: modes and functions are at numbers of "
        "nodes alone, and other programs cannot draw them"
    )


FORMATS: dict[str, Callable[[Path, Path], list[Path]]] = {"csv": _export_csv, "uff": _export_uff, "mat": _export_mat}
