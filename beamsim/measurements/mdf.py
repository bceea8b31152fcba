"""Channels of MDF files (ASAM MDF 4, and 3), as vehicle and machine testing record them, with asammdf.

asammdf has compiled parts, in which a damaged file can end the process or spoil its memory. Another process reads the
file therefore, and hands over arrays.
"""

from __future__ import annotations

import json
import math
from contextlib import closing
from io import BytesIO
from pathlib import Path
from pkgutil import resolve_name
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from beamsim.errors import InputFileError
from beamsim.files import demand_memory, open_input, read_input
from beamsim.hdf5 import run_apart
from beamsim.measurements.arrays import Array, Axis
from beamsim.measurements.laboratory import demand_library, signals_by_group
from beamsim.measurements.signal import MeasuredSignal, label_unit

_BYTES_OF_SAMPLE = 60  # of memory: as stored, as numbers of both processes, and its time
_ALONG_TIME = 1  # how MDF numbers the kinds of its masters; the others are angles, distances and indices
_BEGINS = (b"MDF     ", b"UnFinMF ")
_CONVERT = "import sys; from beamsim.measurements.mdf import convert; convert(*sys.argv[1:])"


def read_mdf(path: Path) -> list[MeasuredSignal]:
    """The channels of an MDF file, converted as it states; invalid samples are nan.

    The axis of a channel is the master of its group.

    Raises
    ------
    InputFileError
        If asammdf is not installed, or the file is damaged or ends too early.
    """
    with open_input(path) as file:
        if file.read(8) not in _BEGINS:
            raise InputFileError("does not begin as an MDF file", "export it again; a table of numbers as .txt")
    demand_library("asammdf", "an MDF file", "asammdf")
    with TemporaryDirectory(prefix="beamsim") as folder:
        target = Path(folder) / "channels.npz"
        run_apart(_CONVERT, path, str(target), library="asammdf")
        with np.load(target, allow_pickle=False) as stored:
            about = json.loads(str(stored["about"]))
            if "failed" in about:
                raise ValueError(about["failed"])
            if "refused" in about:
                raise InputFileError(*about["refused"])
            arrays = [
                ((each["group"], each["name"]), _array(each, stored, number))
                for number, each in enumerate(about["channels"])
            ]
    return signals_by_group(arrays, path)


def _array(about: dict[str, Any], stored: Any, number: int) -> Array:
    """A channel that the other process read."""
    axis = about["axis"]
    along = None if axis is None else Axis(axis["name"], axis["unit"], stored[f"times {axis['group']}"])
    converted = ("converted as the file states",) if about["converted"] else ()
    return Array(stored[f"values {number}"], about["unit"], about["comment"], scaling=converted, axis=along)


def convert(path: str, target: str) -> None:
    """Write the channels of an MDF file as arrays; for a process of its own.

    Parameters
    ----------
    path : of the file.
    target : path of the NPZ file with ``values`` of each channel, ``times`` of each group, and what is ``about`` them.
    """
    try:
        about, arrays = _channels(path)
    except InputFileError as refusal:
        about, arrays = {"refused": [refusal.message, refusal.remedy]}, {}
    except MemoryError:
        raise
    except Exception as error:
        about, arrays = {"failed": " ".join((str(error) or type(error).__name__).split())[:300]}, {}
    np.savez(target, about=np.array(json.dumps(about)), **arrays)


def _channels(path: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """What is about the channels of a file, and their arrays."""
    open_mdf = resolve_name("asammdf:MDF")
    channels: list[dict[str, Any]] = []
    arrays: dict[str, Any] = {}
    content = BytesIO(read_input(path, math.inf, memory=2.0))  # asammdf completes what a logger left incomplete
    with closing(open_mdf(content)) as mdf:
        counts = [int(group.channel_group.cycles_nr) for group in mdf.groups]
        samples = sum(count * len(group.channels) for count, group in zip(counts, mdf.groups, strict=True))
        demand_memory(path, _BYTES_OF_SAMPLE * samples, "for its channels")
        for number, (count, group) in enumerate(zip(counts, mdf.groups, strict=True)):
            title = str(getattr(group.channel_group, "acq_name", "") or f"group {number + 1}")
            master = mdf.masters_db.get(number)
            for index, channel in enumerate(group.channels if count else ()):
                signal = mdf.get(group=number, index=index, ignore_invalidation_bits=True)
                if signal.samples.dtype.kind not in "biufc" or signal.samples.ndim != 1:
                    continue  # texts, frames of a bus, matrices
                if not signal.samples.size == signal.timestamps.size == count:
                    message = f"has {signal.samples.size} samples of {signal.name}, and states {count}"
                    raise InputFileError(message, "it ends too early: export it again")
                axis = None
                if master is not None and index != master:
                    kept = group.channels[master]
                    unit = label_unit(kept.unit) or ("s" if signal.master_metadata[1] == _ALONG_TIME else "")
                    axis = {"name": kept.name, "unit": unit, "group": number}
                    arrays[f"times {number}"] = np.asarray(signal.timestamps, dtype=float)
                arrays[f"values {len(channels)}"] = _values(signal)
                channels.append(
                    {"group": title, "name": signal.name, "unit": label_unit(signal.unit), "axis": axis,
                     "comment": str(signal.comment), "converted": channel.conversion is not None}
                )  # fmt: skip
    return {"channels": channels}, arrays


def _values(signal: Any) -> Any:
    """(n,) values, nan where the file marks a sample as invalid."""
    values = signal.samples.astype(complex if signal.samples.dtype.kind == "c" else float)
    if signal.invalidation_bits is not None:
        values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
    return values
