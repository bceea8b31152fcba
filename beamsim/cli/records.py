"""Contents of a file of test data, as ``beamsim info`` prints them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from beamsim.cli.session import print_json
from beamsim.cli.tables import print_table
from beamsim.errors import InputFileError
from beamsim.measurements.channels import measurement_error
from beamsim.measurements.conditioning import is_even, with_even_times
from beamsim.measurements.functions import FunctionType
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import MeasuredSignal


def describe_record(path: Path, *, json: bool) -> None:
    """Print the channels of a file of test data: name, unit, function type, samples, axis and sampling rate.

    Parameters
    ----------
    path : of the file.
    json : True to print JSON.

    Raises
    ------
    ScenarioError
        If the file cannot be read.
    """
    try:
        channels = [channel_properties(signal) for signal in read_file(path)]
    except InputFileError as fault:
        raise measurement_error(f"{path} {fault.message}", fault.remedy) from None
    if json:
        print_json({"kind": "record", "channels": channels})
        return
    count = f"{len(channels)} channel{'s' if len(channels) != 1 else ''}"
    print_table(f"{path}: {count}", [(about["name"], _channel_text(about)) for about in channels])


def channel_properties(signal: MeasuredSignal) -> dict[str, Any]:
    """What a file states about a channel; an axis itself has none."""
    about: dict[str, Any] = {"name": signal.name, "unit": signal.unit_text, "samples": signal.y.size}
    about |= {"missing": int(np.count_nonzero(~np.isfinite(signal.y))), "scaling": list(signal.scaling)}
    if signal.axis:
        x = with_even_times(signal).x
        even = x.size > 1 and not signal.is_over_frequency and x[-1] > x[0] and is_even(x)
        about |= {
            "function": str(signal.function),
            "axis": signal.axis, "axis_unit": signal.axis_unit, "from": float(x[0]), "to": float(x[-1]),
            "samples_per_axis_unit": (x.size - 1) / float(x[-1] - x[0]) if even else None,
        }  # fmt: skip
    return about | {"fault": None if signal.fault is None else signal.fault[0]}


def _channel_text(about: dict[str, Any]) -> str:
    """A channel in words."""
    words = [about["unit"] or "no unit", f"{about['samples']} samples"]
    if "axis" in about:
        unit = about["axis_unit"]
        span = f"{about['from']:g} to {about['to']:g} {unit}".rstrip()
        words += [] if about["function"] == FunctionType.TIME_HISTORY else [about["function"]]
        words[1] = f"{about['samples']} samples over {about['axis']}, {span}"
        if rate := about["samples_per_axis_unit"]:
            words.append(f"{rate:g} Hz" if unit == "s" else f"{rate:g} per {unit or 'unit of the axis'}")
    words += [f"{about['missing']} of them missing"] if about["missing"] else []
    words += about["scaling"]
    return ", ".join([*words, f"cannot be used: {about['fault']}"] if about["fault"] else words)
