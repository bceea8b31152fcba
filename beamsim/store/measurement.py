"""Measured signals from files of other programs: CSV, HDF5 (also beamsim's own), UFF dataset 58."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.compare.measured import MeasuredSignal
from beamsim.errors import Problem, ScenarioError
from beamsim.files import text_of
from beamsim.inputs.axes import AxisError, axis_factor, check_record, without_unit
from beamsim.inputs.csv_table import headings_of
from beamsim.inputs.headings import FREQUENCY_NAMES, TIME_NAMES, is_frequency, split_heading, stated
from beamsim.inputs.universal_file import UnitsOfFile, units_of_file, units_of_uff
from beamsim.scenario.driven import spoken

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

AXIS_UNIT = "axis_unit (--axis-unit)"  # where a user can give the unit of an axis
_EXAMPLES = {"absolute_acceleration": "g", "displacement": "mm", "absolute_displacement": "mm"}


def read_tests(scenario: Scenario, folder: Path | str = ".") -> list[MeasuredSignal]:
    """The signal of every test of ``identify_stiffness.nonlinear``, in SI units; paths are relative to a folder.

    Raises
    ------
    ScenarioError
        For every file that is missing or empty, has non-finite values or lacks the channel.
    """
    section = scenario.identify_stiffness
    if section is None or section.nonlinear is None:
        return []
    signals: list[MeasuredSignal] = []
    problems: list[Problem] = []
    default = scenario.effective_probes[0].name
    for index, test in enumerate(section.nonlinear.tests):
        at = f"identify_stiffness.nonlinear.tests[{index}]"
        path = Path(test.file) if Path(test.file).is_absolute() else Path(folder) / test.file
        try:
            name = test.channel or test.probe or default
            signal = channel_named(
                read_signals(path, test.axis_unit), name, test.quantity, path, required=test.channel is not None,
                at=f"{at}.channel",
            )  # fmt: skip
            signals.append(in_si(signal, test.unit, test.quantity, f"{at}.unit"))
        except ScenarioError as error:
            problems += [
                p if p.path else Problem(f"{at}.file", f"= {test.file}: {p.message}", p.remedy) for p in error.problems
            ]
    if problems:
        raise scenario.located(ScenarioError(problems))
    return signals


def read_signals(path: Path, axis_unit: str | None = None) -> list[MeasuredSignal]:
    """All channels of a file.

    Parameters
    ----------
    axis_unit : of times or frequencies; by default the one that the file states.

    Raises
    ------
    ScenarioError
        If the file is missing, empty, of an unknown format, has values that are not numbers, or an axis without unit.
    """
    if not path.is_file():
        raise _wrong(f"{path} does not exist", "check the path; it is relative to the case's file")
    if path.stat().st_size == 0:
        raise _wrong(f"{path} is empty", "export the measurement again")
    suffix = path.suffix.lower()
    if suffix in (".csv", ".txt", ".tsv", ".dat"):
        signals = _read_csv(path, axis_unit)
    elif suffix in (".h5", ".hdf5", ".hdf"):
        signals = _read_hdf5(path, axis_unit)
    elif suffix in (".uff", ".unv", ".uf", ".58"):
        signals = _read_uff(path, axis_unit)
    else:
        raise _wrong(f"{path} has an unknown format", "use .csv, .h5 or .uff")
    if not signals:
        raise _wrong(f"{path} contains no signal", "it needs a time or frequency axis and at least one channel")
    return signals


def channel_named(
    signals: Sequence[MeasuredSignal],
    name: str,
    quantity: str,
    path: Path,
    *,
    required: bool = False,
    at: str = "",
) -> MeasuredSignal:
    """The channel of that name, which may leave out the unit; else that of probe and quantity, or the only one.

    Raises
    ------
    ScenarioError
        If no channel or several match, or values are not finite.
    """
    words = spoken(quantity)
    exact = [s for s in signals if name in (s.name, split_heading(s.name)[0])]
    named = [s for s in signals if holds_name(s.name, name)]
    loose = [s for s in named if _is_of(s.name, words)]
    if not loose and quantity == "absolute_acceleration":  # accelerometers know no other
        loose = [s for s in named if _is_of(s.name, "acceleration")]
    loose = loose or ([] if required else named)
    histories = [s for s in loose if not s.of_frequency] or loose
    chosen = exact or histories or ([] if required or len(signals) > 1 else list(signals))
    if len(chosen) > 1 and all(_same(chosen[0], other) for other in chosen[1:]):
        chosen = chosen[:1]
    if len(chosen) != 1:
        names = [s.name for s in signals]
        close = get_close_matches(name, names, n=1)
        listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
        verdict = "has no channel" if not chosen else f"has {len(chosen)} channels that could be"
        remedy = f"did you mean {close[0]}?" if close and not chosen else f"name one: {listed}"
        raise ScenarioError(Problem(at, f"{path} {verdict} {name} {words}", remedy))
    return _checked(chosen[0], path)


def history_named(path: Path, name: str, axis_unit: str | None = None) -> MeasuredSignal:
    """The time history of that name.

    Raises
    ------
    ScenarioError
        If the file cannot be used, there is none, or the channel is a function of frequency.
    """
    signal = channel_named(read_signals(path, axis_unit), name, "", path, required=True)
    if signal.of_frequency:
        raise _wrong(f"{path}: {signal.name} is no time history", "choose the channel of the excitation over time")
    return signal


def in_si(signal: MeasuredSignal, unit: str | None, quantity: str, at: str) -> MeasuredSignal:
    """The signal converted to SI from the given unit, else from that of the file.

    Raises
    ------
    ScenarioError
        If neither is given, or the unit is not one of the quantity.
    """
    from dataclasses import replace

    from beamsim.scenario import units

    named = unit or signal.unit
    dimension = {"absolute_acceleration": units.ACCELERATION, "velocity": units.VELOCITY}.get(quantity, units.LENGTH)
    if quantity == "force":
        dimension = units.FORCE
    if not named:
        source = f"{signal.source} states" if signal.source else "there is"
        raise ScenarioError(
            Problem(
                at, f"is missing, and {source} no unit of {signal.name}",
                f"give the unit of the {spoken(quantity)}, for example {_EXAMPLES.get(quantity, dimension.unit)}",
            )
        )  # fmt: skip
    if named == dimension.unit:
        return signal
    try:
        factor = units.read_quantity(f"1 {named}", dimension)
    except units.UnitError as error:
        raise ScenarioError(
            Problem(at, f"= {named} {error.message}", f"the {spoken(quantity)} of {signal.name} needs its unit")
        ) from None
    return replace(signal, y=signal.y * factor, unit=dimension.unit)


def _checked(signal: MeasuredSignal, path: Path) -> MeasuredSignal:
    if signal.x.size < 2:
        raise _wrong(f"{path}: {signal.name} has {signal.x.size} samples", "export the whole signal")
    try:
        check_record(signal.x, signal.y, of_frequency=signal.of_frequency)
    except AxisError as fault:
        raise _wrong(f"{path}: {signal.name} {fault.message}", fault.remedy) from None
    return signal


def _same(a: MeasuredSignal, b: MeasuredSignal) -> bool:
    return np.array_equal(a.x, b.x) and np.array_equal(a.y, b.y)


def holds_name(name: str, part: str) -> bool:
    """Whether a channel's name holds a word."""
    return bool(
        re.search(
            rf"(?<![a-z0-9]){re.escape(part.lower().replace('_', ' '))}(?![a-z0-9])", name.lower().replace("_", " ")
        )
    )


def _is_of(name: str, words: str) -> bool:
    text = name.lower().replace("_", " ")
    other = {"displacement": "absolute displacement", "acceleration": "relative acceleration"}.get(words)
    return words in text and (other is None or other not in text)


def _wrong(message: str, remedy: str) -> ScenarioError:
    return ScenarioError(Problem("", message, remedy))


def _read_csv(path: Path, axis_unit: str | None) -> list[MeasuredSignal]:
    try:
        text = text_of(path)
    except UnicodeDecodeError:
        raise _wrong(f"{path} is not text", "export it as CSV again") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise _wrong(f"{path} contains no data", "export the measurement again")
    delimiter = next((mark for mark in (";", "\t", ",") if mark in lines[-1]), " ")
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter, skipinitialspace=True)]
    first = _first_sample(rows, delimiter)
    header = headings_of(rows[:first]) if first else [f"column {k + 1}" for k in range(len(rows[0]))]
    body = rows[first:]
    if not body:
        raise _wrong(f"{path} has a header but no samples", "export the measurement again")
    values = np.empty((len(body), len(header)))
    for i, row in enumerate(body):
        if len(row) != len(header):
            commas = delimiter == "," and len(row) == 2 * len(header)
            remedy = "it seems to have decimal commas: export it with decimal points" if commas else "correct the line"
            raise _wrong(f"{path}: sample {i + 1} has {len(row)} values, but there are {len(header)} columns", remedy)
        for j, cell in enumerate(row):
            try:
                values[i, j] = float(cell.replace(",", ".") if delimiter != "," else cell)
            except ValueError:
                raise _wrong(
                    f"{path}: sample {i + 1} of {header[j]} is {cell!r}, not a number",
                    "only numbers are allowed below the header",
                ) from None
    if values.shape[1] < 2:
        raise _wrong(f"{path} has only one column", "put the time in the first column and the signal in the next")
    of_frequency = is_frequency(header[0])
    unit_of_axis = axis_unit or split_heading(header[0])[1]
    x = values[:, 0] * _axis_factor(path, header[0], unit_of_axis, of_frequency=of_frequency)
    return [
        MeasuredSignal(name, x, values[:, j], of_frequency, split_heading(name)[1], str(path))
        for j, name in enumerate(header)
        if j > 0
    ]


def _first_sample(rows: list[list[str]], delimiter: str) -> int:
    """Number of the row after the headings: rows of titles and units have no number in their first cell.

    A row with numbers beside that cell, right above the samples, is a sample with a fault.
    """
    first = next((k for k, row in enumerate(rows) if _is_number(row[0], delimiter)), 1)
    while first > 1 and any(_is_number(cell, delimiter) for cell in rows[first - 1]):
        first -= 1
    return first


def _is_number(cell: str, delimiter: str) -> bool:
    try:
        float(cell.replace(",", ".") if delimiter != "," else cell)
    except ValueError:
        return False
    return True


def _axis_factor(path: Path, name: str, unit: str, *, of_frequency: bool) -> float:
    """Seconds or Hz in one of the axis's unit."""
    if not unit:
        example = "frequency (Hz)" if of_frequency else "time (s)"
        remedy = f"name it in the heading, {example}, or give {AXIS_UNIT}"
        raise _wrong(f"{path} {without_unit(of_frequency)} (axis {name})", remedy)
    try:
        return axis_factor(unit, AXIS_UNIT, of_frequency=of_frequency)
    except AxisError as fault:
        raise _wrong(f"{path} {fault.message}", fault.remedy) from None


def _is_axis(name: str) -> bool:
    return split_heading(name)[0].lower() in (*TIME_NAMES, *FREQUENCY_NAMES)


def _read_hdf5(path: Path, axis_unit: str | None) -> list[MeasuredSignal]:
    import h5py

    signals: list[MeasuredSignal] = []
    try:
        file = h5py.File(path, "r")
    except OSError:
        raise _wrong(f"{path} is not an HDF5 file, or is damaged", "export the measurement again") from None
    with file:
        datasets: dict[str, Any] = {}
        file.visititems(lambda name, item: datasets.__setitem__(name, item) if isinstance(item, h5py.Dataset) else None)
        for name, item in datasets.items():
            if item.ndim != 1 or item.size < 2 or not np.issubdtype(item.dtype, np.number):
                continue
            try:
                axis, of_frequency = _axis_of(name, item, datasets)
            except ValueError as error:
                raise _wrong(f"{path} is damaged: {error}", "export the measurement again") from None
            if axis is None or axis == name or datasets[axis].shape != item.shape:
                continue
            unit = str(item.attrs.get("units", "")) or split_heading(name)[1]
            unit_of_axis = axis_unit or stated(str(datasets[axis].attrs.get("units", ""))) or split_heading(axis)[1]
            x = np.asarray(datasets[axis][()], dtype=float)
            x = x * _axis_factor(path, axis, unit_of_axis, of_frequency=of_frequency)
            y = item[()]
            y = y.astype(complex) if np.iscomplexobj(y) else y.astype(float)
            label = re.sub(r"^(probes|snubbers|spectra)/", "", name).replace("/", " ")
            signals.append(MeasuredSignal(label, x, y, of_frequency, unit, str(path)))
    return signals


def _axis_of(name: str, item: Any, datasets: dict[str, Any]) -> tuple[str | None, bool]:
    """The dataset that is the axis of another: its dimension scale, else time or frequency in an enclosing group."""
    from beamsim.store.scales import scale_along

    if (attached := scale_along(item, 0)) is not None:
        scale = attached.name.lstrip("/")
        label = scale.rsplit("/", 1)[-1].lower()
        return (scale, is_frequency(label)) if _is_axis(label) else (None, False)
    folder = name.rsplit("/", 1)[0] if "/" in name else ""
    while True:
        for other in datasets:
            parent, _, last = other.rpartition("/")
            if parent == folder and _is_axis(last):
                return other, is_frequency(last)
        if not folder:
            return None, False
        folder = folder.rpartition("/")[0]


def _read_uff(path: Path, axis_unit: str | None) -> list[MeasuredSignal]:
    import warnings

    import pyuff

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = pyuff.UFF(str(path))
            kinds = file.get_set_types()
            sets = [file.read_sets(i) for i, kind in enumerate(kinds) if int(kind) == 58]
        units = units_of_file(file)
    except Exception as error:
        # pyuff raises exceptions of all types on damaged files
        raise _wrong(f"{path} cannot be read as a universal file ({error})", "export dataset 58 again") from None
    if not sets:
        raise _wrong(f"{path} contains no dataset 58", "export functions at nodal degrees of freedom (dataset 58)")
    return [_of_uff(item, path, axis_unit, units) for item in sets]


def _of_uff(item: dict[str, Any], path: Path, axis_unit: str | None, units: UnitsOfFile | None) -> MeasuredSignal:
    of_frequency = int(item.get("abscissa_spec_data_type", 17)) == 18
    y = np.asarray(item["data"])
    y = y.astype(complex) if np.iscomplexobj(y) else y.astype(float)
    stated_axis, unit = units_of_uff(item, lambda: units)
    name = next(
        (
            text
            for key in ("id1", "rsp_ent_name")
            if (text := str(item.get(key, "")).strip()) and text.upper() != "NONE"
        ),
        f"node {item.get('rsp_node', 0)}",
    )
    factor = _axis_factor(path, "of " + name, axis_unit or stated_axis, of_frequency=of_frequency)
    x = np.asarray(item["x"], dtype=float) * factor
    return MeasuredSignal(name, x, y, of_frequency, unit, str(path))
