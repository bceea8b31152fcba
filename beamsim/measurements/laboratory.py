"""Channels of files of data acquisition systems: TDMS, LVM and netCDF, with the libraries of the extra ``lab``.

npTDMS, lvm_read and xarray know the formats: scaling properties, conversions, blocks. This module finds the
axis of each channel, keeps invalid samples as missing ones, and refuses files that end too early, which the libraries
read as far as they go.
"""

from __future__ import annotations

import logging
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.errors import InputFileError
from beamsim.files import demand_memory, open_input, read_input, read_text
from beamsim.measurements.arrays import Array, Axis, read_hdf5, signal_of, unpack
from beamsim.measurements.signal import MeasuredSignal, axis_kind, label_unit
from beamsim.typing import Floats

_BYTES_OF_SAMPLE = 40  # of memory: as stored, as a number, and its time
_BYTES_OF_CELL = 120  # of memory, of a text table as lists of numbers
_NO_START = np.datetime64("1904-01-02")  # LabVIEW counts from 1904: an earlier start is none
_LVM = "LabVIEW Measurement"
_SPELLED = {
    "newtons": "N", "pounds": "lbf", "meters": "m", "inches": "in", "pascals": "Pa", "degrees": "deg", "radians": "rad",
}  # fmt: skip
"""Units as LabVIEW spells those of its channels."""


def read_tdms(path: Path) -> list[MeasuredSignal]:
    """The channels of a TDMS file of LabVIEW or DIAdem, scaled as the file states.

    The axis of a channel is that of its waveform properties, else the time or frequency of as many values in its group.
    Waveforms that start at different times are on one axis, from the first start.

    Raises
    ------
    InputFileError
        If npTDMS is not installed, or the file is damaged or ends too early.
    """
    demand_library("nptdms", "a TDMS file", "npTDMS")
    import nptdms
    from nptdms.log import log_manager

    log_manager.set_level(logging.CRITICAL)  # of what is refused here
    with open_input(path) as file, nptdms.TdmsFile.open(file) as tdms:
        if tdms.file_status.incomplete_final_segment:
            raise InputFileError("ends within its last segment", "export it again, or save it anew from LabVIEW")
        channels = [each for group in tdms.groups() for each in group.channels() if each.dtype.kind in "biufcM"]
        demand_memory(path, _BYTES_OF_SAMPLE * sum(map(len, channels)), "for its channels")
        starts = [start for each in channels if (start := _start(each.properties)) is not None]
        first = min(starts, default=None)
        arrays = [((each.group_name, each.name), _tdms_array(each, first)) for each in channels]
    return signals_by_group(arrays, path)


def _tdms_array(channel: Any, first: np.datetime64 | None) -> Array:
    """The values of a channel; times of day are counted in s from the first one."""
    given, values = channel.properties, np.asarray(channel[:])
    unit = _unit(str(given.get("unit_string") or given.get("NI_UnitDescription") or ""))
    if values.dtype.kind == "M":
        values, unit = (values - values[:1]) / np.timedelta64(1, "s"), "s"
    step, start = _number(given.get("wf_increment")), _start(given)
    axis = None
    if step > 0.0:
        name = str(given.get("wf_xname") or "Time")
        offset = _number(given.get("wf_start_offset", 0.0))
        if start is not None and first is not None:
            offset += float((start - first) / np.timedelta64(1, "s"))
        axis = Axis(
            name, str(given.get("wf_xunit_string") or _usual_unit(name)), offset + step * np.arange(len(values))
        )
    scaling = ("scaled by its NI_Scale properties",) if _number(given.get("NI_Number_Of_Scales")) > 0 else ()
    words = " ".join(str(given.get(key, "")) for key in ("description", "NI_ChannelName"))
    return Array(_floats(values), unit, words, scaling=scaling, axis=axis)


def _start(properties: Mapping[str, Any]) -> np.datetime64 | None:
    """When a waveform starts; None without a date."""
    start = properties.get("wf_start_time")
    return start if isinstance(start, np.datetime64) and start > _NO_START else None


def read_lvm(path: Path) -> list[MeasuredSignal]:
    """The channels of a LabVIEW measurement file; of several segments, which are records of their own, by their number.

    The axis of a channel is its column of times where it has one, else it follows from its start and increment.

    Raises
    ------
    InputFileError
        If lvm_read is not installed, or the file is none, or ends too early.
    """
    demand_library("lvm_read", "an LVM file", "lvm_read")
    import lvm_read

    text = read_text(path)
    if not text.startswith(_LVM):
        raise InputFileError(f"does not begin with {_LVM}", "export it again; a table of numbers as .txt")
    demand_memory(path, _BYTES_OF_CELL * sum(map(text.count, "\t,;\n")), "for its cells")
    segments: list[Mapping[str, Any]] = []
    for part in re.split(rf"(?m)^(?={_LVM})", text)[1:]:  # LabVIEW appends to a file with a header of its own
        found = lvm_read.read_str(re.sub(r"(\r?\n[\t,; ]*)+\Z", "\n", part))
        segments += [found[k] for k in range(found["Segments"])]
    arrays = []
    for number, segment in enumerate(segments, 1):
        title = f"segment {number}" if len(segments) > 1 else ""
        arrays += [((title, name), array) for name, array in _lvm_channels(segment)]
    return signals_by_group(arrays, path)


def _lvm_channels(segment: Mapping[str, Any]) -> Iterator[tuple[str, Array]]:
    """The names and values of the channels of a segment."""
    names, table = segment["Channel names"], segment["data"]
    first = int(names[0] == "X_Value")
    times = None
    for column, name in enumerate(names[: len(names) - (names[-1] == "Comment")]):
        if name == "X_Value":
            times = table[:, column]
            continue
        about = {
            key: values[column - first]
            for key, values in segment.items()
            if isinstance(values, list) and 0 <= column - first < len(values)
        }
        count, values = _number(about.get("Samples")), table[:, column]
        if count > len(values):
            message = f"has {len(values)} samples of {name}, and states {count:.0f}"
            raise InputFileError(message, "it ends too early: export it again")
        if count > 0 and np.all(np.isnan(values[int(count) :])):  # below a channel that is shorter than others
            values = values[: int(count)]
        yield name, Array(values, _unit(about.get("Y_Unit_Label", "")), axis=_lvm_axis(about, times, len(values)))


def _lvm_axis(about: Mapping[str, Any], times: Floats | None, count: int) -> Axis | None:
    """The axis of a channel of ``count`` samples."""
    name = about.get("X_Dimension") or "Time"
    start, step = _number(about.get("X0", 0.0)), _number(about.get("Delta_X"))
    if times is not None and np.all(np.isfinite(times[:count])):
        return Axis(name, _usual_unit(name), times[:count])
    return Axis(name, _usual_unit(name), start + step * np.arange(count)) if step > 0.0 else None


def read_netcdf(path: Path) -> list[MeasuredSignal]:
    """The variables of a netCDF file, and the rows of those with a coordinate of texts.

    netCDF-4 is HDF5 and read as such; the older format, netCDF-3, is opened by xarray.

    Raises
    ------
    InputFileError
        If xarray is not installed and needed, or the file is damaged.
    """
    with open_input(path) as file:
        if file.read(3) != b"CDF":
            return read_hdf5(path)
    demand_library("xarray", "a netCDF-3 file", "xarray")
    import xarray

    content = BytesIO(read_input(path, math.inf, memory=6.0))  # of a mapped file, SciPy warns when it is discarded
    # numbers as they are stored: `unpack` scales those of both formats alike
    data = xarray.load_dataset(content, engine="scipy", mask_and_scale=False, decode_times=False)
    arrays: dict[str, Array] = {}
    labels: dict[str, str] = {}
    for name, variable in ((str(key), value) for key, value in data.variables.items()):
        values = np.asarray(variable.values)
        if values.dtype.kind not in "iuf" or values.ndim not in (1, 2) or values.shape[-1] < 2:
            continue
        texts = data.variables[variable.dims[0]].values if variable.dims[0] in data.variables else np.empty(0)
        if values.ndim == 2 and (texts.dtype.kind not in "OUS" or len(set(map(str, texts))) < len(texts)):
            continue
        scale = str(variable.dims[-1]) if variable.dims[-1] in data.variables else ""
        for label, row in zip(map(str, texts) if values.ndim == 2 else [""], np.atleast_2d(values), strict=True):
            place = f"{label}/{name}" if label else name
            plain = row.astype(row.dtype.newbyteorder("="))
            arrays[place], labels[place] = unpack(place, plain, variable.attrs, scale), f"{label} {name}".strip()
    return [signal_of(place, label, arrays, path) for place, label in labels.items()]


def signals_by_group(arrays: Sequence[tuple[tuple[str, str], Array]], path: Path) -> list[MeasuredSignal]:
    """The channels by name, with the group in front of a name that several have.

    Parameters
    ----------
    arrays : in the order of the file, each with its group and name.
    path : of the file.

    Raises
    ------
    InputFileError
        If there is none.
    """
    if not arrays:
        raise InputFileError("has no channel of numbers", "export the channels that were measured")
    several = Counter(name for (_, name), _ in arrays)
    labels: dict[str, str] = {}
    by_place: dict[str, Array] = {}
    for number, ((group, name), array) in enumerate(arrays, 1):
        place = f"{group.replace('/', ' ')}/{name.replace('/', ' ')}"
        place += f" ({number})" if place in by_place else ""
        by_place[place], labels[place] = array, f"{group} {name}".strip() if several[name] > 1 else name
    return [signal_of(place, label, by_place, path) for place, label in labels.items()]


def _unit(label: str) -> str:
    """The unit of a label of LabVIEW; empty where it says none."""
    unit = label_unit(label)
    return _SPELLED.get(unit.lower(), unit)


def _usual_unit(axis: str) -> str:
    """The unit in which LabVIEW gives an axis that states none."""
    return {"time": "s", "frequency": "Hz"}.get(axis_kind(axis), "")


def _number(value: object) -> float:
    """A property that is a number; nan for any other."""
    return float(value) if isinstance(value, int | float | np.number) else np.nan


def _floats(values: Any) -> Any:
    return values.astype(complex if values.dtype.kind == "c" else float)


def demand_library(module: str, called: str, package: str) -> None:
    """Refuse a file whose library is not installed.

    Parameters
    ----------
    module : name of the library.
    called : what the file is.
    package : name of the package that has the library.

    Raises
    ------
    InputFileError
        If it is not.
    """
    try:
        found = find_spec(module)
    except ValueError:  # of a module that was made unavailable
        found = None
    if found is None:
        message = f"is {called}, for which the package {package} is needed"
        raise InputFileError(message, "pip install 'beamsim[lab]'")
