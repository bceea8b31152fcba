"""Channels of files that hold arrays by name: HDF5, netCDF-4 and MATLAB.

Packed values are unpacked by the conventions of netCDF (CF conventions 1.11, section 8.1; netCDF attribute
conventions): ``scale_factor``, ``add_offset``, ``_FillValue``, ``missing_value`` and the valid range.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.errors import InputFileError
from beamsim.files import demand_memory
from beamsim.hdf5 import LIST, open_hdf5, read_array, scales_of, values_size
from beamsim.labelled import ABSENT, OF_EACH
from beamsim.matrix_files import matlab_variables
from beamsim.measurements.functions import FunctionType, function_over_frequency, is_unit_of
from beamsim.measurements.signal import MeasuredSignal, axis_kind, label_of, label_unit, split_heading
from beamsim.scenario import units as si

_NETCDF_FILL = 9.969209968386869e36  # of floats that were never written
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
_SCALING = re.compile(r"scale|slope|gain|calib|sensitiv|offset|lsb", re.IGNORECASE)
_SECONDS = re.compile(r"(.+)[_ ]s(?:ec)?", re.IGNORECASE)
_SINCE = re.compile(r"(\w+) since .+", re.IGNORECASE)


@dataclass(frozen=True)
class Axis:
    """An axis that belongs to one array."""

    name: str
    unit: str  # empty where the file states none
    values: Any  # (n,)


@dataclass(frozen=True)
class Array:
    """One array of a file, unpacked."""

    values: Any  # (n,) float or complex
    unit: str = ""
    description: str = ""  # what the file calls it besides its name
    scale: str = ""  # path of its dimension scale
    scaling: tuple[str, ...] = ()
    fault: tuple[str, str] | None = None
    axis: Axis | None = None  # where it has one of its own


def read_hdf5(path: Path) -> list[MeasuredSignal]:
    """The arrays of an HDF5 or netCDF-4 file, named by their path, and the rows of those with a coordinate of texts.

    The axis of each is its dimension scale, else the time or frequency of as many values in the nearest enclosing
    group.

    Raises
    ------
    InputFileError
        If it is not an HDF5 file, or damaged.
    """
    file = open_hdf5(path)
    datasets: dict[str, h5py.Dataset] = {}
    labels: dict[str, tuple[str, ...]] = {}  # of the rows of an array, by its name

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        of_rows = _labels_of_rows(item)
        if of_rows:
            labels[name] = of_rows
        if of_rows or _is_channel(name, item):
            datasets[name] = item

    with file:
        if any("MATLAB_class" in item.attrs for item in file.values()):
            return read_matlab(path)
        file.visititems(visit)
        demand_memory(path, 3 * sum(map(values_size, datasets.values())), "for its channels")
        arrays = {name: _unpack(name, item) for name, item in datasets.items() if name not in labels}
        called = {name: label_of(name) for name in arrays}
        for name, of_rows in labels.items():
            whole = _unpack(name, datasets[name])
            folder, _, last = name.rpartition("/")
            units = _list_attribute(datasets[name], OF_EACH, str) or [whole.unit] * len(of_rows)
            absent = np.isin(np.arange(whole.values.size), _list_attribute(datasets[name], ABSENT, int))
            if len(units) != len(of_rows):
                raise InputFileError(f"is damaged ({OF_EACH} of {name})", "export it again")
            rows = zip(of_rows, _quantities(datasets[name]) or [last] * len(of_rows), units, strict=True)
            for number, (label, quantity, unit) in enumerate(rows):
                if not absent.reshape(len(of_rows), -1)[number].all():
                    own, values = f"{folder}/{label}/{quantity}", whole.values.reshape(len(of_rows), -1)[number]
                    arrays[own], called[own] = (
                        replace(whole, values=values, unit=label_unit(unit)),
                        f"{label} {quantity}",
                    )
    return [signal_of(name, called[name], arrays, path) for name in arrays]


def _list_attribute(item: h5py.Dataset, name: str, item_type: type) -> list[Any]:
    """What an attribute lists about the rows of an array of a result file, see docs/result_files.md; nothing elsewhere.

    Raises
    ------
    InputFileError
        If it is no JSON list of texts, or of numbers.
    """
    text = text_of_attribute(item.attrs.get(name, ""))
    if not text:
        return []
    try:
        listed = json.loads(text)
    except ValueError:
        listed = None
    if not isinstance(listed, list) or any(type(each) is not item_type for each in listed):
        raise InputFileError(f"is damaged ({name} of {item.name})", "export it again")
    return listed


def _labels_of_rows(item: h5py.Dataset) -> tuple[str, ...]:
    """Texts of the coordinate along the first of two axes, where the other has numbers: each row is a channel."""
    if item.shape is None or len(item.shape) != 2 or item.shape[1] < 2 or item.dtype.kind not in "iufc":
        return ()
    texts, numbers = scales_of(item)[:2]
    if texts is None or numbers is None or (*texts.shape, *numbers.shape) != item.shape:
        return ()
    if h5py.check_string_dtype(texts.dtype) is None or numbers.dtype.kind not in "iuf":
        return ()
    demand_memory(item.file.filename, values_size(texts), "for the names of its channels")
    labels = tuple(map(str, texts.asstr(errors="replace")[()]))
    return labels if len(set(labels)) == len(labels) else ()


def _quantities(item: h5py.Dataset) -> list[str]:
    """What each row of an array is, where texts along the same axis, called as it and ``_quantity``, say so."""
    along = scales_of(item)[0]
    texts = None if along is None else item.file.get(f"{along.name}_quantity")
    if texts is None or texts.shape != item.shape[:1] or h5py.check_string_dtype(texts.dtype) is None:
        return []
    return list(map(str, texts.asstr(errors="replace")[()]))


def read_matlab(path: Path) -> list[MeasuredSignal]:
    """The vectors of a MATLAB file, those of structs named ``struct.field``.

    A text ``NAME_unit`` next to a vector, or ``unit`` in a struct with one vector and its axis, is its unit.

    Raises
    ------
    InputFileError
        If it cannot be read.
    """
    variables = {name.replace(".", "/"): value for name, value in matlab_variables(path)}
    texts = {name.lower(): value for name, value in variables.items() if isinstance(value, str)}
    arrays = {
        name: np.asarray(value).ravel()
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "iufc" and 2 <= value.size == max(value.shape)
    }
    found = {
        name: Array(values.astype(complex if values.dtype.kind == "c" else float), _matlab_unit(name, arrays, texts))
        for name, values in arrays.items()
    }
    signals = (signal_of(name, name.replace("/", "."), found, path) for name in found)
    return [replace(each, axis=each.axis.replace("/", ".")) for each in signals]


def _matlab_unit(name: str, arrays: Mapping[str, Any], texts: Mapping[str, str]) -> str:
    """Unit of a vector by the texts next to it, else by its name."""
    folder, _, last = name.rpartition("/")
    siblings = [other for other in arrays if other.rpartition("/")[0] == folder and not _is_axis(other)]
    names = [f"{last}_unit", f"{last}_units", f"{last}unit", f"{last}units"]
    if siblings == [name] and folder:
        names += ["unit", "units"]
    found = (label_unit(texts.get(f"{folder}/{each}".lstrip("/").lower(), "")) for each in names)
    return next(filter(None, found), "") or _heading(name)[1]


def _is_channel(name: str, item: h5py.Dataset) -> bool:
    """Whether a data set holds numbers along one axis."""
    complex_pair = item.dtype.names is not None and set(item.dtype.names) == {"real", "imag"}
    if item.shape is None or not (item.dtype.kind in "iufc" or complex_pair):
        return False
    without_values = text_of_attribute(item.attrs.get("NAME", "")).startswith(_NO_VARIABLE)
    return 2 <= item.size == max(item.shape) and not without_values


def text_of_attribute(value: object) -> str:
    """Text of an attribute: a string, bytes as C programs write them, or an array of them; empty for anything else.

    Several strings are separated by commas; those of one character are the characters of one text.
    """
    if isinstance(value, bytes):
        try:
            text = value.decode("utf-8")
        except UnicodeDecodeError:
            text = value.decode("cp1252", errors="replace")
        return text.strip("\0 \t\r\n")
    if isinstance(value, str):
        return value.strip("\0 \t\r\n")
    if isinstance(value, np.ndarray) and value.dtype.kind in "OSU":
        if value.dtype.kind in "SU" and value.dtype.itemsize == np.dtype(f"{value.dtype.kind}1").itemsize:
            return text_of_attribute(b"".join(value.ravel()) if value.dtype.kind == "S" else "".join(value.ravel()))
        return ", ".join(dict.fromkeys(text_of_attribute(each) for each in value.ravel()))
    return ""


def _unpack(name: str, item: h5py.Dataset) -> Array:
    """The array of a data set by its attributes."""
    given = {key: item.attrs[key] for key in item.attrs if key != LIST}
    scale = scales_of(item)[_channel_axis(item)]
    of_scale = "" if scale is None or not _is_channel("", scale) else str(scale.name).lstrip("/")
    attributes = {key: value for key, value in given.items() if not isinstance(value, h5py.Empty)}
    return unpack(name, read_array(item), attributes, of_scale)


def unpack(name: str, stored: Any, given: Mapping[str, Any], scale: str) -> Array:
    """The array that stored numbers stand for by the conventions of netCDF.

    Parameters
    ----------
    name : of the array.
    stored : as in the file.
    given : attributes of the array, by name.
    scale : name of its dimension scale; empty without one.
    """
    units = {text_of_attribute(value) for key, value in given.items() if key.lower() in ("unit", "units")} - {""}
    unit = label_unit(next(iter(units), "")) or _heading(name)[1]
    again = "export the values in their unit"
    fault = (f"states several units of {name}: {', '.join(sorted(units))}", again) if len(units) > 1 else None
    raw = stored.ravel()
    if raw.dtype.names:
        raw = raw["real"] + 1j * raw["imag"]
    missing = _missing(raw, given)
    if text_of_attribute(given.get("_Unsigned", "")).lower() == "true" and raw.dtype.kind == "i":
        raw = raw.view(raw.dtype.str.replace("i", "u"))
    if match := _SINCE.fullmatch(unit):
        raw, unit = raw - raw[0], match[1]
    values = raw.astype(complex if raw.dtype.kind == "c" else float)
    values[missing] = np.nan
    scaling = []
    for key, operation, neutral in (("scale_factor", "times", 1.0), ("add_offset", "plus", 0.0)):
        number = np.asarray(given.get(key, neutral)).ravel()
        if number.size != 1 or number.dtype.kind not in "iuf" or not np.isfinite(number[0]):
            fault = fault or (f"has an attribute {key} of {name} that is not one number", again)
        elif key in given:
            values = values * float(number[0]) if operation == "times" else values + float(number[0])
            scaling.append(f"{operation} {number[0]:g} ({key})")
    unknown = next((key for key in given if _SCALING.search(key) and key not in ("scale_factor", "add_offset")), None)
    if raw.dtype.kind in "iu" and not scaling and unknown is not None:
        fault = fault or (
            f"has integers in {name} with the attribute {unknown}, which is not one of netCDF",
            "name it scale_factor or add_offset, or export the values in their unit",
        )
    values[_outside(raw, values, given)] = np.nan
    words = " ".join(text_of_attribute(given.get(key, "")) for key in ("long_name", "standard_name", "description"))
    return Array(values, unit, words, scale, tuple(scaling), fault)


def _channel_axis(item: h5py.Dataset) -> int:
    """The axis that a channel is along: the last of several channels, else the only one that is longer than 1."""
    if _labels_of_rows(item):
        return 1
    return 0 if item.shape[0] == item.size else int(np.argmax(item.shape))


def _missing(raw: Any, attributes: Mapping[str, Any]) -> Any:
    """(n,) whether a stored value is one that stands for a missing one."""
    missing = np.zeros(raw.shape, dtype=bool)
    for key in ("_FillValue", "missing_value"):
        marks = np.asarray(attributes.get(key, ())).ravel()
        if marks.dtype.kind in "iufc":
            marks = marks.astype(raw.dtype) if raw.dtype.kind == "f" else marks[np.isfinite(marks)]
            missing |= np.isin(raw, marks)
    return missing | (raw == raw.dtype.type(_NETCDF_FILL)) if raw.dtype in (np.float32, np.float64) else missing


def _outside(raw: Any, values: Any, attributes: Mapping[str, Any]) -> Any:
    """(n,) whether a value is outside the valid range: stored integers are compared with integers."""
    bounds = {
        key: np.asarray(attributes[key]).ravel()
        for key in ("valid_min", "valid_max", "valid_range")
        if key in attributes
    }
    least, most = bounds.get("valid_min"), bounds.get("valid_max")
    if "valid_range" in bounds and bounds["valid_range"].size == 2:
        least, most = bounds["valid_range"][:1], bounds["valid_range"][1:]
    outside = np.zeros(raw.shape, dtype=bool)
    for bound, beyond in ((least, np.less), (most, np.greater)):
        if bound is not None and bound.size == 1 and bound.dtype.kind in "iuf" and raw.dtype.kind != "c":
            outside |= beyond(values if bound.dtype.kind == "f" else raw, bound[0])
    return outside


def signal_of(name: str, label: str, arrays: Mapping[str, Array], path: Path) -> MeasuredSignal:
    """The channel of an array on its axis.

    Parameters
    ----------
    name : of the array, with the groups that it is in: ``group/subgroup/name``.
    label : name of the channel.
    arrays : all of the file, by name.
    path : of the file.
    """
    array = arrays[name]
    x, axis_unit, of_frequency, fault = np.arange(array.values.size, dtype=float), "", False, array.fault
    axes = list(_axes_of(name, arrays)) if array.axis is None else [array.axis.name]
    axis = axes[0] if len(axes) == 1 else None
    if array.axis is not None:
        x, axis_unit = array.axis.values, array.axis.unit
        of_frequency = axis_kind(array.axis.name) == "frequency" or is_unit_of(axis_unit, si.FREQUENCY)
        if axis_unit and not is_unit_of(axis_unit, si.TIME, si.FREQUENCY):
            fault = fault or (f"is over {array.axis.name} ({axis_unit}), not over time", "choose another channel")
    elif axis is not None:
        x, axis_unit = np.real(arrays[axis].values), arrays[axis].unit
        of_frequency = _is_of_frequency(axis, arrays[axis])
        fault = fault or arrays[axis].fault
    elif axes:
        what = f"has several axes of as many values as {name}: {', '.join(sorted(axes))}"
        fault = fault or (what, "attach the right one as its dimension scale, or remove the others")
    function = function_over_frequency(f"{label} {array.description}", array.unit) if of_frequency else None
    return MeasuredSignal(
        label, x, array.values, of_frequency, array.unit, str(path), axis or "", axis_unit,
        stated_function=None if function is FunctionType.SPECTRUM else function, scaling=array.scaling, fault=fault,
    )  # fmt: skip


def _heading(name: str) -> tuple[str, str]:
    """Name and unit of an array by its path; a time may end in its unit, which the name of a channel may not."""
    last = name.rpartition("/")[2]
    if (match := _SECONDS.fullmatch(last)) and axis_kind(match[1]) == "time":
        return match[1], "s"
    return split_heading(last)


def _is_axis(name: str) -> bool:
    return bool(axis_kind(_heading(name)[0]))


def _is_of_frequency(name: str, array: Array) -> bool:
    kind = axis_kind(_heading(name)[0])
    return kind == "frequency" if kind else is_unit_of(array.unit, si.FREQUENCY)


def _axes_of(name: str, arrays: Mapping[str, Array]) -> Iterator[str]:
    """The dimension scale, else times and frequencies in the nearest enclosing group, if they are as many."""
    array = arrays[name]
    if array.scale:
        scale = arrays.get(array.scale)
        fits = scale is not None and array.scale != name and scale.values.size == array.values.size
        if scale is not None and fits and (_is_axis(array.scale) or is_unit_of(scale.unit, si.TIME, si.FREQUENCY)):
            yield array.scale
        return
    folders = name.split("/")[:-1]
    for k in range(len(folders), -1, -1):
        group = "/".join(folders[:k])
        axes = [other for other in arrays if other.rpartition("/")[0] == group and _is_axis(other)]
        if axes:
            same = (other for other in axes if arrays[other].values.size == array.values.size)
            yield from () if name in axes else same
            return
