"""Universal files: functions at nodal degrees of freedom (data set 58), and the other data sets that pyuff reads.

pyuff (sdypy-io reads universal files by it, too) takes text as UTF-8, stops at a data set without an end, and
returns as many samples as it finds. What a file is and states is therefore checked here: the encoding of its text, its
ends, the number of samples, the units that precede a record, directions and function types.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from beamsim.errors import InputFileError
from beamsim.files import read_input, reading
from beamsim.measurements.functions import (
    BY_NUMBER,
    RATIOS,
    FunctionType,
    function_over_frequency,
    is_unit_of,
    ratio_of,
)
from beamsim.measurements.signal import MeasuredSignal, Reference, axis_kind, label_unit
from beamsim.scenario import units as si

_MEMORY = 10  # bytes for each byte of a file, as measured
_READ = (15, 55, 58, 82, 164, 1858, 2411)  # data sets that are used

# By how many of them an SI unit is: what data set 164 states.
_LENGTHS = {1.0: "m", 1e3: "mm", 1e2: "cm", 1e6: "um", 1 / 0.0254: "in", 1 / 0.3048: "ft"}
_FORCES = {1.0: "N", 1e3: "mN", 1e2: "cN", 1e-3: "kN", 1 / 4.4482216: "lbf", 1 / 9.80665: "kgf"}


class Units(NamedTuple):
    """Units of the data sets that follow a data set 164; of those before the first one nothing is known."""

    per_metre: float | None = None
    length: str = ""  # empty where it is none of the usual ones
    force: str = ""


@dataclass(frozen=True)
class DataSet:
    """A data set of a file."""

    number: int  # such as 58
    line: int  # of the file, from 1, in which it begins
    units: Units  # that precede it
    fields: Mapping[str, Any]  # as pyuff names them

    @property
    def place(self) -> str:
        """Where it is in the file, for messages."""
        return f"data set {self.number} in line {self.line}"


_TAG = re.compile(rb" {4}-1(?=[\r\n]|\Z| {74})")
_EXPONENT = re.compile(rb"(?<=[\d.])[Dd](?=[+-]\d)")
_BLANKS = re.compile(rb"[ \t]+(?=\r?\n)")
_NUMBERS = re.compile(rb"(?m)^[ \t\d.+\-DdEe]*[Dd][+-]\d+[ \t\d.+\-DdEe]*\r?$")


def data_sets(path: Path) -> list[DataSet]:
    """The data sets of a file that are used here, in the order of the file.

    Raises
    ------
    InputFileError
        If the file ends within a data set, or one of them cannot be read: with its line.
    """
    with reading(path, "a universal file"):
        return _data_sets(read_input(path, memory=_MEMORY))


def _data_sets(content: bytes) -> list[DataSet]:
    """The data sets in the content of a file."""
    raw = re.sub(rb"(?m)^ {4}-1[ \t]+(?=\r?$)", b"    -1", content)
    tags = [match.start() for match in _TAG.finditer(raw)]
    ends_of_lines = np.flatnonzero(np.frombuffer(raw, dtype=np.uint8) == ord(b"\n"))
    lines = (1 + np.searchsorted(ends_of_lines, tags)).tolist()
    if len(tags) % 2:
        message = f"ends within the data set that begins in line {lines[-1]}: the end, a line with -1, is missing"
        raise InputFileError(message, "the file is truncated: export it again")
    if not tags:
        raise InputFileError("cannot be read as a universal file: it has no data set", "export it again")
    parts = zip([0, *tags[1::2]], [*tags[0::2], len(raw)], strict=True)
    between = [raw[begin:end] for begin, end in parts]
    inside = [raw[begin:end] for begin, end in zip(tags[0::2], tags[1::2], strict=True)]
    read = [part for pair in zip(between, map(_plain, inside), strict=False) for part in pair]
    try:
        with TemporaryDirectory() as folder:
            copy = Path(folder) / "plain.uff"
            copy.write_bytes(b"".join([*read, between[-1]]))
            return list(_read(copy, lines[0::2]))
    except OSError as error:  # as of a full disk; the file itself has been read
        message = f"cannot be read: no temporary copy can be written ({error.strerror or error})"
        remedy = "free space in the folder of temporary files, or set TMPDIR to another one"
        raise InputFileError(message, remedy) from None


def _plain(block: bytes) -> bytes:
    """A data set as pyuff reads it: text in UTF-8, numbers with the exponent E, lines that end where it expects."""
    lines = block.splitlines(keepends=True)
    number, binary = (lines[1][:6].strip(), lines[1][6:7].lower() == b"b") if len(lines) > 1 else (b"", False)
    _demand_values(number, lines, len(block))
    head, rest = b"".join(lines[:13]), b"".join(lines[13:])
    try:
        head.decode("utf-8")
    except UnicodeDecodeError:
        head = head.decode("cp1252", errors="replace").encode("utf-8")
    if binary:
        return head + rest
    if _EXPONENT.search(block):
        head, rest = (_NUMBERS.sub(lambda match: _EXPONENT.sub(b"E", match[0]), part) for part in (head, rest))
    if number == b"15":  # whose lines pyuff joins without a blank
        tag, *nodes = (head + rest).splitlines(keepends=True)
        return tag + b" ".join(nodes)
    return head + (_BLANKS.sub(b"", rest) if number in (b"55", b"58") else rest)


def _demand_values(number: bytes, lines: list[bytes], size: int) -> None:
    """Refuse a function (data set 58) that claims more values than its bytes can hold, for which room would be made."""
    if number == b"58" and len(lines) > 8 and (claimed := re.match(rb"[ ]*\d+[ ]+(\d+)", lines[8][:20])):
        values = int(claimed[1])
        if values > size:
            message = f"cannot be read as a universal file: a data set 58 claims {values} values in {size} bytes"
            raise InputFileError(message, "export it again")


def _read(path: Path, lines: list[int]) -> Iterator[DataSet]:
    import pyuff

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file, units = pyuff.UFF(str(path)), Units()
        for index, number in enumerate(map(int, file.get_set_types())):
            if number not in _READ:
                continue
            try:
                fields = file.read_sets(index)
            except Exception as error:  # pyuff raises exceptions of all types on damaged files
                message = f"cannot be read as a universal file: data set {number} in line {lines[index]} ({error})"
                remedy = "export it again" + (", complex modes by their translations alone" if number == 55 else "")
                raise InputFileError(message, remedy) from None
            if number == 164:
                units = _units_of(fields)
            yield DataSet(number, lines[index], units, fields)


def _units_of(fields: Mapping[str, Any]) -> Units:
    length = float(fields.get("length") or 0.0)
    return Units(length or None, _unit_name(length, _LENGTHS), _unit_name(float(fields.get("force") or 0.0), _FORCES))


def _unit_name(factor: float, names: Mapping[float, str]) -> str:
    """Name of the unit of which an SI unit has so many; files state few digits."""
    return next((name for known, name in names.items() if abs(factor / known - 1) < 1e-3), "")


def read_uff(path: Path) -> list[MeasuredSignal]:
    """The functions of a file.

    Raises
    ------
    InputFileError
        If it cannot be read, or has none.
    """
    sets = data_sets(path)
    records = [each for each in sets if each.number == 58]
    if not records:
        raise InputFileError("contains no dataset 58", "export functions at nodal degrees of freedom (dataset 58)")
    amplitudes = {int(each.fields.get("amplitude_units", 0)) for each in sets if each.number == 1858}
    signals = [_with_peaks(_signal(each, path), amplitudes) for each in records]
    several = Counter(signal.name for signal in signals)

    def own_name(signal: MeasuredSignal) -> str:
        place = f"{signal.name} node {signal.node} {signal.direction}".rstrip()
        return place if several[signal.name] > 1 else signal.name

    return [replace(each, name=own_name(each)) for each in signals]


# by the number of a direction, that of a negative one counted from the end
_DIRECTIONS = ("", "+X", "+Y", "+Z", "+RX", "+RY", "+RZ", "-RZ", "-RY", "-RX", "-Z", "-Y", "-X")
_QUANTITIES = {
    2: "stress", 3: "strain", 8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force",
    15: "pressure",
}  # fmt: skip
# Exponents of length and force of a quantity, in translation and in rotation.
_EXPONENTS = {
    2: ((-2, 1), (-1, 1)), 3: ((0, 0), (0, 0)), 8: ((1, 0), (0, 0)), 9: ((0, 1), (1, 1)), 11: ((1, 0), (0, 0)),
    12: ((1, 0), (0, 0)), 13: ((0, 1), (1, 1)), 15: ((-2, 1), (-1, 1)),
}  # fmt: skip
_OVER_TIME = (
    FunctionType.TIME_HISTORY, FunctionType.AUTO_CORRELATION, FunctionType.CROSS_CORRELATION, FunctionType.FILTER,
)  # fmt: skip
_OVER_FREQUENCY = (
    *RATIOS, FunctionType.SPECTRUM, FunctionType.AUTO_SPECTRUM, FunctionType.CROSS_SPECTRUM, FunctionType.COHERENCE,
    FunctionType.MULTIPLE_COHERENCE, FunctionType.PARTIAL_COHERENCE, FunctionType.POWER_DENSITY,
    FunctionType.ENERGY_DENSITY, FunctionType.SHOCK_SPECTRUM, FunctionType.MODE_INDICATOR, FunctionType.ORDER_FUNCTION,
)  # fmt: skip


def _direction(record: Mapping[str, Any], key: str) -> str:
    number = int(record.get(key, 0))
    return _DIRECTIONS[number] if abs(number) <= 6 else ""


def _signal(data_set: DataSet, path: Path) -> MeasuredSignal:
    """The channel of a record."""
    record = data_set.fields
    node, direction = int(record.get("rsp_node", 0)), _direction(record, "rsp_dir")
    texts = [str(record.get(key, "")).strip() for key in ("id1", "rsp_ent_name")]
    name = next((text for text in texts if text.upper() not in ("", "NONE")), f"node {node}")
    unit, reference = _units_of_values(data_set)
    function = _function(record, name, unit, reference)
    of_frequency, axis_unit, wrong_axis = _axis(record, function)
    if not of_frequency and reference is not None and function in (None, FunctionType.TIME_HISTORY):
        function = FunctionType.IMPULSE_RESPONSE
    x, y, remark, wrong_count = _samples(data_set)
    signal = MeasuredSignal(
        name, x, y, of_frequency, unit, str(path), f"of {name}", axis_unit, stated_function=function,
        quantity=_QUANTITIES.get(int(record.get("ordinate_spec_data_type", 0)), ""), node=node, direction=direction,
        reference=reference, scaling=remark, fault=wrong_count or wrong_axis,
    )  # fmt: skip
    return _along_positive_direction(signal)


def _along_positive_direction(signal: MeasuredSignal) -> MeasuredSignal:
    """The values along the positive direction; magnitudes have no sign."""
    places = [(signal.direction, "")]
    if signal.reference is not None:
        places = [(signal.direction, " of the response"), (signal.reference.direction, " of the reference")]
    negative = [direction + what for direction, what in places if direction.startswith("-")]
    signed = signal.function in (*_OVER_TIME, FunctionType.IMPULSE_RESPONSE) or np.iscomplexobj(signal.y)
    if not negative or not signed or signal.function is FunctionType.AUTO_CORRELATION:
        return signal
    sign = -1.0 if len(negative) == 1 else 1.0
    remark = f"sign of direction {' and '.join(negative)} applied"
    return replace(signal, y=sign * signal.y, scaling=(*signal.scaling, remark))


def _with_peaks(signal: MeasuredSignal, amplitudes: set[int]) -> MeasuredSignal:
    """An amplitude spectrum in peak values; data set 1858 says which amplitudes a file has."""
    if signal.function is not FunctionType.SPECTRUM or amplitudes <= {0, 2}:
        return signal
    if len(amplitudes) > 1:
        fault = "has spectra of different amplitudes (data sets 1858)", "export them in peak amplitudes"
        return replace(signal, fault=signal.fault or fault)
    factor, remark = {1: (2.0, "half-peak times 2"), 3: (np.sqrt(2.0), "RMS times sqrt(2)")}.get(
        amplitudes.pop(), (1.0, "amplitudes as in the file")
    )
    return replace(signal, y=signal.y * factor, scaling=(*signal.scaling, remark))


def _function(record: Mapping[str, Any], name: str, unit: str, reference: Reference | None) -> FunctionType | None:
    """Function type of a record; None where it states none, and neither name, unit nor denominator do."""
    function = BY_NUMBER.get(number := int(record.get("func_type", 0)))
    if function is None and number != 0:
        return FunctionType.OTHER
    if function is FunctionType.SPECTRUM:
        if reference is not None:
            return FunctionType.FREQUENCY_RESPONSE
        return function_over_frequency("", unit)
    return function


def _units_of_values(data_set: DataSet) -> tuple[str, Reference | None]:
    """Unit of the ordinate, and what it is divided by: labels first, then data types with the units of the file."""
    record = data_set.fields
    unit = _unit(data_set, "ordinate", _direction(record, "rsp_dir"))
    kind, label = int(record.get("orddenom_spec_data_type", 0)), _label(record, "orddenom")
    if kind in (17, 18) or label.lower() in ("hz", "s"):
        return (unit if not label or label in unit else f"{unit}/{label}"), None
    if kind in (0, 1) and not label:
        return unit, None
    below = _unit(data_set, "orddenom", _direction(record, "ref_dir"))
    if ratio := ratio_of(unit):
        unit, below = ratio
    return unit, Reference(below, int(record.get("ref_node", 0)), _direction(record, "ref_dir"))


def _label(record: Mapping[str, Any], prefix: str) -> str:
    return label_unit(str(record.get(f"{prefix}_axis_units_lab", "")))


def _unit(data_set: DataSet, prefix: str, direction: str) -> str:
    """Unit of an ordinate or of its denominator; empty if it is unknown."""
    record, units = data_set.fields, data_set.units
    if label := _label(record, prefix):
        return label
    kind = int(record.get(f"{prefix}_spec_data_type", 0))
    given = tuple(int(record.get(f"{prefix}_{what}_unit_exp", 0)) for what in ("len", "force"))
    length, force = given if kind == 1 else _EXPONENTS.get(kind, ((0, 0), (0, 0)))["R" in direction]
    per_time = {11: "/s", 12: "/s^2"}.get(kind, "")
    if (length and not units.length) or (force and not units.force) or not (length or force or per_time or kind == 8):
        return ""
    powers = [(units.force, force), (units.length, length)]
    above = " ".join(f"{name}^{power}" if power > 1 else name for name, power in powers if power > 0)
    below = "".join(f"/{name}^{-power}" if power < -1 else f"/{name}" for name, power in powers if power < 0)
    return (above or ("rad" if not (length or force) else "1")) + below + per_time


def _axis(record: Mapping[str, Any], function: FunctionType | None) -> tuple[bool, str, tuple[str, str] | None]:
    """Whether the axis is one of frequencies, its unit, and why it cannot be used, if so."""
    kind, unit = int(record.get("abscissa_spec_data_type", 0)), _label(record, "abscissa")
    label = str(record.get("abscissa_axis_lab", "")).strip()
    remedy = "export the function over time or frequency"
    if kind not in (0, 1, 17, 18) or unit.lower() in ("rpm", "order"):
        what = {8: "displacement", 13: "force", 19: "speed of rotation", 20: "order"}.get(kind, unit or f"type {kind}")
        return False, unit, (f"has an axis of {what}, not of time or frequency", remedy)
    if kind in (17, 18):
        of_frequency = kind == 18
    elif unit and (is_unit_of(unit, si.FREQUENCY) or is_unit_of(unit, si.TIME)):
        of_frequency = is_unit_of(unit, si.FREQUENCY)
    elif named := axis_kind(label):
        of_frequency = named == "frequency"
    else:
        of_frequency = function in _OVER_FREQUENCY
    wrong = function in (_OVER_TIME if of_frequency else _OVER_FREQUENCY)
    axis = "frequency" if of_frequency else "time"
    fault = (
        (f"is {function.with_article} and has an axis of {axis}", remedy) if function is not None and wrong else None
    )
    return of_frequency, unit or {17: "s", 18: "Hz"}.get(kind, ""), fault  # the format has no other units of time


def _samples(data_set: DataSet) -> tuple[Any, Any, tuple[str, ...], tuple[str, str] | None]:
    """Axis and values as many as the record states, what to remark on, and why they cannot be used, if so."""
    record = data_set.fields
    x, y = np.asarray(record["x"], dtype=float), np.asarray(record["data"])
    y = y.astype(complex if np.iscomplexobj(y) else float)
    again = "export it again"
    if record.get("binary") and int(record.get("fp_format") or 2) != 2:
        return x, y, (), (f"has numbers in a format of another machine ({data_set.place})", f"{again} in ASCII")
    count, remarks = int(record["num_pts"]), tuple[str, ...]()
    if y.size < count:
        message = f"states {count} samples and has {y.size} ({data_set.place}): it is truncated"
        return x, y, (), (message, again)
    if np.any(y[count:]):
        return x, y, (), (f"states {count} samples and has {y.size} ({data_set.place})", again)
    if y.size - count >= 6:  # more than fills a line
        remarks = (f"without {y.size - count} zeros after the {count} samples that are stated",)
    return x[:count], y[:count], remarks, None
