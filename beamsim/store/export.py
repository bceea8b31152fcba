"""Result files for other programs: folders of CSV tables, universal files, MATLAB files; tables of pandas.

All of them are made from the datasets of a result.
"""

from __future__ import annotations

import csv
import json
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamsim.errors import ResultFileError
from beamsim.files import replacement_file
from beamsim.labelled import NAMES, OF_EACH, ROW, Item, Items, absent_in, last, parent, part_of
from beamsim.results.result import Result
from beamsim.store.results import (
    decode_summary,
    items_of,
    open_with_items,
    refusing_damage,
    stored_result,
    write_result,
)
from beamsim.store.universal import bodies_without_places, records_of, write_uff

if TYPE_CHECKING:
    import pandas
    import xarray

ROWS_AT_ONCE = 2**16  # of a table that are turned into text together
_UNITS = {"degree": "deg", "kg^-0.5": "per_sqrt_kg", "kg^0.5 m": "m_sqrt_kg"}  # at the ends of stored names


def export_target(folder: Path, stem: str, form: str) -> Path:
    """Path of the folder of tables, or of the file, that an export writes.

    Parameters
    ----------
    folder : that holds it.
    stem : of its name.
    form : csv, uff or mat.

    Returns
    -------
    Path
        ``<stem>_csv``, ``<stem>.uff`` or ``<stem>.mat``.
    """
    return folder / (f"{stem}_csv" if form == "csv" else f"{stem}.{form}")


def export_result(path: Path | str, target: Path | str, form: str) -> list[Path]:
    """Write a result file of any kind in another format: tables of text, a universal file, a MATLAB file.

    Parameters
    ----------
    path : of the result file.
    target : the folder of the tables, or the file.
    form : csv, uff or mat.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ResultFileError
        If the format is unknown or cannot hold the result, or a file cannot be read or written.

    Examples
    --------
    >>> import beamsim, pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "case.h5"
    >>> _ = beamsim.write_result(beamsim.run("configs/stops/chain_bumpers.yaml"), file)
    >>> tables = beamsim.export_result(file, file.with_name("case_csv"), "csv")
    >>> "histories_by_time.csv" in [table.name for table in tables]
    True
    >>> folder.cleanup()
    """
    if isinstance(path, Result):
        raise TypeError("the path of a result file is needed, not a result; beamsim.write_result writes one")
    if form not in FORMATS:
        raise ResultFileError(f"no format {form!r}; choose one of {', '.join(FORMATS)}")
    result, items = open_with_items(path)
    with refusing_damage(path):
        return FORMATS[form](result, items, Path(target))


# --- Tables ----------------------------------------------------------------------------------------------------------


class Column(NamedTuple):
    """Values of a table, and what they are."""

    header: str
    unit: str
    meaning: str
    values: Any  # (n,) of an axis, along all axes of an array: NumPy's, or one that is read part by part
    absent: NDArray[np.bool_] | None = None  # of the shape of the values, which integers and truth values are not known


class ExportTable(NamedTuple):
    """Arrays along the same axes."""

    name: str  # the group and the axes
    axes: list[Column]
    columns: list[Column]

    @property
    def size(self) -> int:
        """Number of rows: one for each combination of values of the axes."""
        return int(np.prod([axis.values.size for axis in self.axes], dtype=int))

    def part(self, first: int, end: int) -> list[NDArray[Any]]:
        """The values of axes and columns in the rows between two numbers; masked where they are absent."""
        shape = [axis.values.size for axis in self.axes]
        index = np.unravel_index(np.arange(first, end), shape) if shape else ()
        along = [_values_at(axis.values, k) for axis, k in zip(self.axes, index, strict=True)]
        return along + [
            values if column.absent is None else np.ma.array(values, mask=_flat_part(column.absent, first, end))
            for column in self.columns
            for values in [_flat_part(column.values, first, end)]
        ]


def _values_at(array: Any, index: NDArray[Any]) -> NDArray[Any]:
    """Values of a one-dimensional array; the part between the first and the last of them is read."""
    begin, end = (int(index.min()), int(index.max()) + 1) if index.size else (0, 0)
    values: NDArray[Any] = np.asarray(array[begin:end])
    return np.asarray(values[index - begin])


def _flat_part(array: Any, first: int, end: int) -> NDArray[Any]:
    """Values of an array, row after row, between two numbers; the rows that hold them are read."""
    row = int(np.prod(array.shape[1:], dtype=int)) or 1
    begin = first // row
    rows: NDArray[Any] = np.asarray(array[begin : -(-end // row)] if array.ndim else array[()])
    return rows.reshape(-1)[first - begin * row : end - begin * row]


def tables_of(items: Items) -> list[ExportTable]:
    """All variables of all datasets of a result, as tables in the order of the items.

    Variables along the same axes are columns of one table, those of members with names a column for each name.
    """
    tables: dict[tuple[str, ...], ExportTable] = {}
    for path, item in items.items():
        if item.array is None or item.scale:
            continue
        rows = [axis for axis in item.axes if not is_text(items, axis)] or list(item.axes)
        key = (parent(path), *rows)
        name = parent(path).strip("/") + ("_by_" + "_and_".join(map(last, rows)) if rows else "_values")
        table = tables.setdefault(key, ExportTable(name, [_axis(items[axis], axis) for axis in rows], []))
        absent = _missing_mask(item)
        for labels, index, unit in columns_of(items, path, rows):
            if absent is not None and labels and absent[index].all():
                continue
            values = _replace_numbers(
                items, path, part_of(item.array, index) if len(rows) < len(item.axes) else item.array
            )
            title = header(" ".join((*labels, last(path))), unit)
            while title in {column.header for column in (*table.axes, *table.columns)}:
                title += "_2"
            missing = None if absent is None or not absent[index].any() else absent[index]
            table.columns.append(Column(title, unit, item.meaning, values, missing))
    return list(tables.values())


def is_text(items: Items, axis: str) -> bool:
    """Whether the values of an axis are texts."""
    return bool(axis) and items[axis].array.dtype == object


def columns_of(items: Items, path: str, rows: Sequence[str]) -> Iterator[tuple[tuple[str, ...], tuple[Any, ...], str]]:
    """Parts of a variable, one for each combination of values along the axes that are not rows.

    Parameters
    ----------
    items : of a result.
    path : of the variable.
    rows : those of its axes that are kept.

    Yields
    ------
    tuple
        These values, the index of the part, and its unit, empty where that differs along it.
    """
    item = items[path]
    across = [axis for axis in item.axes if axis not in rows]
    sizes = [items[axis].array.size for axis in across]
    of_each = json.loads(str(item.attributes.get(OF_EACH, "[]")))
    count = int(np.prod(sizes, dtype=int))
    for flat, numbers in enumerate(np.ndindex(*sizes)):
        known = dict(zip(across, numbers, strict=True))
        units = {unit for unit in (of_each[flat::count] if of_each else [item.unit]) if unit}
        index = tuple(known.get(axis, slice(None)) for axis in item.axes)
        labels = tuple(str(items[axis].values[k]) for axis, k in known.items())
        yield labels, index, units.pop() if len(units) == 1 else ""


def _replace_numbers(items: Items, path: str, values: Any) -> Any:
    """Names in place of their numbers; of the members that rows belong to the numbers, see `ROW`."""
    names = items.get(f"/{items[path].attributes.get(NAMES)}")
    axes = items[path].axes
    if names is None or (axes and items[axes[0]].meaning == ROW):
        return values
    return np.asarray(names.values[np.asarray(values)], dtype=object)  # of one number, too, an array


def _missing_mask(item: Item) -> NDArray[np.bool_] | None:
    """Which integers or truth values of an array are not known, in its shape; None where all are.

    Numbers and texts show by themselves that they are not.
    """
    if not item.absent or item.array.dtype.kind not in "iub":
        return None
    return absent_in(item)


def header(name: str, unit: str) -> str:
    """Heading of a column: the quantity, and its unit in brackets, in place of one at the end of the stored name.

    >>> header("peak_force", "N"), header("absolute_acceleration", "m/s^2"), header("frequency_hz", "Hz")
    ('peak_force (N)', 'absolute_acceleration (m/s^2)', 'frequency (Hz)')
    """
    if unit in ("", "1"):
        return name
    spelt = re.sub(r"\((.*)\)\^2", r"\1 squared", unit).lower().replace("/", "_per_").replace("^", "")
    suffix = _UNITS.get(unit) or re.sub(r"[^0-9a-z]+", "_", spelt).strip("_")
    return f"{name.removesuffix(f'_{suffix}')} ({unit})"


def _axis(scale: Item, path: str) -> Column:
    """The axis of one dimension."""
    return Column(header(last(path), scale.unit), scale.unit, scale.meaning, scale.array)


def _export_csv(result: Any, items: Items, folder: Path) -> list[Path]:
    """A table for every set of axes, ``columns`` that says what each column is, attributes, summary and scenario.

    Each file is written completely or not at all; numbers are read back without loss.
    """
    if folder.exists() and not folder.is_dir():
        raise ResultFileError(f"cannot write {folder}: it exists and is not a folder; choose another path with -o")
    written: list[Path] = []

    def write(name: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
        written.append(folder / f"{name}.csv")
        with replacement_file(written[-1]) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(columns)
            writer.writerows(rows)

    described = []
    for table in tables_of(items):
        columns = [*table.axes, *table.columns]
        write(table.name, [column.header for column in columns], _rows(table))
        described += [(f"{table.name}.csv", column.header, column.unit, column.meaning) for column in columns]
    write("columns", ("file", "column", "units", "long_name"), described)
    write("attributes", ("group", "attribute", "value"), _attributes(items))
    numbers = ((name, item, value) for name, values in result.summary.items() for item, value in _flat(values))
    write("summary", ("name", "item", "value"), numbers)
    written.append(folder / "scenario.yaml")
    with replacement_file(written[-1]) as temporary:
        temporary.write_text(str(items["/"].attributes["scenario"]), encoding="utf-8")
    return written


def _rows(table: ExportTable) -> Iterator[tuple[Any, ...]]:
    for first in range(0, table.size, ROWS_AT_ONCE):
        part = table.part(first, min(first + ROWS_AT_ONCE, table.size))
        yield from zip(*((x.astype(int) if x.dtype == bool else x).tolist() for x in part), strict=True)  # None: empty


def _attributes(items: Items) -> Iterator[tuple[str, str, Any]]:
    """Attributes of all groups and single numbers; the scenario and the summary are in separate files."""
    for path, item in items.items():
        if path != "/summary" and (item.array is None or not item.array.shape):
            for name, value in _native(item.attributes).items():
                if (path, name) != ("/", "scenario"):
                    values = value.tolist() if isinstance(value, np.ndarray) else value
                    yield from ((path, f"{name}/{at}" if at else name, v) for at, v in _flat(values))


def _native(attributes: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}


def _flat(values: Any, item: str = "") -> Iterator[tuple[str, Any]]:
    """Nested mappings and lists as pairs of path, separated by slashes, and value; list items are numbered from 1."""
    if isinstance(values, Mapping):
        for name, value in values.items():
            yield from _flat(value, f"{item}/{name}" if item else str(name))
    elif isinstance(values, (list, tuple)):
        for number, value in enumerate(values, 1):
            yield from _flat(value, f"{item}/{number}" if item else str(number))
    else:
        yield item, values


# --- MATLAB ----------------------------------------------------------------------------------------------------------


def _export_mat(result: Any, items: Items, target: Path) -> list[Path]:
    """A struct for each dataset, with structs ``attributes``, ``units`` and ``dimensions`` of its variables.

    Pairs of variables ``…_real`` and ``…_imag`` become one complex array. What numbers others begins at 1. Absent
    integers and truth values are NaN.
    """
    from scipy.io import savemat

    root: dict[str, Any] = {}
    for path, item in items.items():
        if path in ("/", "/summary"):
            continue
        if item.array is None:
            root[last(path)] = {"attributes": _native(item.attributes)} if item.attributes else {}
            continue
        home, name = root[last(parent(path))], last(path)
        stem = name.removesuffix("_real").removesuffix("_imag")
        pair = {part: items.get(f"{parent(path)}/{stem}_{part}") for part in ("real", "imag")}
        values: Any = item.values + 1 if NAMES in item.attributes else item.values
        if (absent := _missing_mask(item)) is not None:
            values = np.where(absent, np.nan, values)
        if pair["real"] is not None and pair["imag"] is not None and name != stem:
            name, values = stem, pair["real"].values + 1j * pair["imag"].values
        home[name] = str(values[()]) if values.dtype == object and not values.shape else values
        home.setdefault("units", {})[name] = item.unit
        home.setdefault("dimensions", {})[name] = [last(axis) for axis in item.axes]
    info = {k: v for k, v in _native(items["/"].attributes).items() if k not in ("provenance", "input_files")}
    root["info"] = info | {"warnings": np.array(json.loads(info["warnings"]), dtype=object)}
    root["summary"] = decode_summary(items["/summary"].attributes)
    with replacement_file(target) as temporary, open(temporary, "xb") as file:
        stream: Any = file  # SciPy's stubs know paths alone
        savemat(stream, _matlab(root), long_field_names=True, oned_as="column", do_compression=True)
    return [target]


def _matlab(value: Any) -> Any:
    """Mappings under valid field names; lists of numbers become columns, other lists cells, None becomes NaN."""
    if isinstance(value, Mapping):
        fields: dict[str, Any] = {}
        for name, item in value.items():
            valid = re.sub(r"[^0-9A-Za-z_]", "_", str(name))[:60]
            valid = valid if re.match(r"[A-Za-z]", valid) else f"x{valid}"
            while valid in fields:
                valid += "_"
            fields[valid] = _matlab(item)
        return fields
    if isinstance(value, (list, tuple)):
        if all(isinstance(item, (int, float)) for item in value):
            return np.array(value, dtype=float)
        cells = np.empty(len(value), dtype=object)
        cells[:] = [_matlab(item) for item in value]
        return cells
    return np.nan if value is None else value


# --- Universal files -------------------------------------------------------------------------------------------------


def _export_uff(result: Any, items: Items, target: Path) -> list[Path]:
    """Everything at a probe or snubber that is a function of time or frequency."""

    records = records_of(items, result)
    if not records:
        raise ResultFileError(
            f"{target.stem}: holds nothing over time or frequency that a universal file could carry; "
            "use --format csv or --format mat"
        )
    write_uff(records, target)
    return [target]


def remark_on_places(path: Path) -> str:
    """That nodes of imported bodies have no coordinates in a universal file of a result; empty where all have some."""
    with stored_result(path) as result:
        bodies = bodies_without_places(result)
    if not bodies:
        return ""
    return (
        f"the table of {', '.join(bodies)} (dofs) gives nodes no coordinates: modes and functions are at numbers of "
        "nodes alone, and other programs cannot draw them"
    )


FORMATS: dict[str, Callable[[Any, Items, Path], list[Path]]] = {
    "csv": _export_csv, "uff": _export_uff, "mat": _export_mat
}  # fmt: skip


def data_frames(result: Result) -> dict[str, pandas.DataFrame]:
    """Return the tables of the CSV export as data frames, by name.

    Raises
    ------
    ImportError
        If pandas is not installed.
    """
    pd = _import_module("pandas")
    frames = {}
    for table in tables_of(items_of(result)):
        headers = [column.header for column in (*table.axes, *table.columns)]
        columns = [
            pd.array(x.tolist(), dtype="boolean" if x.dtype == bool else "Int64") if np.ma.isMaskedArray(x) else x
            for x in table.part(0, table.size)
        ]
        frames[table.name] = pd.DataFrame(dict(zip(headers, columns, strict=True)))
    return frames


def data_tree(result: Result) -> xarray.DataTree:
    """Return the groups of the result file as a tree of datasets.

    Raises
    ------
    ImportError
        If xarray or h5netcdf is not installed.
    """
    xr = _import_module("xarray")
    _import_module("h5netcdf")
    with tempfile.TemporaryDirectory() as folder:
        path = write_result(result, Path(folder) / "result.h5")
        with xr.open_datatree(path, engine="h5netcdf") as tree:
            return tree.load()  # type: ignore[no-any-return]


def _import_module(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"this needs {name}, which is not installed: pip install {name}") from error
