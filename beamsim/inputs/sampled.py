"""Measured inputs: samples from a file as piecewise polynomials."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, NoReturn

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.inputs.axes import AxisError, axis_factor, check_record, without_unit
from beamsim.inputs.csv_table import read_csv
from beamsim.inputs.headings import split_heading, stated
from beamsim.inputs.signal import Signal
from beamsim.inputs.universal_file import units_of_file, units_of_uff
from beamsim.scenario.driven import spoken
from beamsim.scenario.quantities import LEVEL_DIMENSIONS
from beamsim.scenario.units import UnitError, read_level
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario.broadband import SampledInput

MOST_SAMPLES = 4_000_000
LARGEST_GAP = 1.5  # in median steps of the time axis; a longer step is a gap


def interpolate(time: Floats, samples: Floats, kind: str) -> Signal:
    """Interpolation of samples; constant after the last one.

    Parameters
    ----------
    time : (n,) s, increasing.
    samples : (n,) there.
    kind : ``linear``, or ``cubic`` for a spline.

    Returns
    -------
    Signal
        Of a piece between each two samples, and one after the last.
    """
    if kind == "linear" or time.size < 4:
        slope = np.diff(samples) / np.diff(time)
        pieces = np.stack([samples[:-1], slope], axis=1)
    else:
        from scipy.interpolate import CubicSpline

        pieces = CubicSpline(time, samples).c[::-1].T
    last = np.zeros((1, pieces.shape[1]))
    last[0, 0] = samples[-1]
    return Signal.polynomial_pieces(time, np.concatenate([pieces, last]))


def sampled_signal(excitation: SampledInput, duration: float | None, folder: Path | None = None) -> Signal:
    """The samples as a signal from t = 0 on.

    Parameters
    ----------
    excitation : of the scenario.
    duration : s, of the run; by default of the samples.
    folder : to which the path of the file is relative, by default the current one.

    Returns
    -------
    Signal
        In SI units.

    Raises
    ------
    ScenarioError
        If the file cannot be read, has gaps, or is shorter than the run.
    """
    time, samples = read_samples(excitation, folder)
    time = time - time[0]
    if duration is not None and time[-1] < duration * (1 - 1e-9) - (time[1] - time[0]):
        _reject(
            f"= {excitation.file} ends after {time[-1]:g} s, before run.duration = {duration:g} s",
            f"run for at most {time[-1]:g} s",
        )
    if excitation.resample is not None:
        from scipy.interpolate import CubicSpline

        even = np.arange(int(np.floor(time[-1] * excitation.resample)) + 1) / excitation.resample
        samples = np.asarray(CubicSpline(time, samples)(even))
        time = even
    # the whole record is interpolated: the input must not depend on where the run ends
    pieces = time.size if duration is None else int(np.searchsorted(time, duration, side="left")) + 1
    if pieces > MOST_SAMPLES:
        _reject(
            f"has {pieces:.3g} samples for this run (at most {MOST_SAMPLES:.0e})",
            "shorten the run, or set excitation.resample to a lower rate",
        )
    signal = interpolate(time, samples * excitation.factor_to_si, excitation.interpolation)
    return Signal(signal.start[:pieces], signal.exponent, signal.coefficient[:pieces])


def read_samples(excitation: SampledInput, folder: Path | None = None) -> tuple[Floats, Floats]:
    """Times, s, and values from the file, checked. The path is relative to ``folder`` or else the current folder.

    Values of an excitation with a ``unit`` are in that unit, others are converted to SI from the unit of the file.

    Raises
    ------
    ScenarioError
        For a missing or unreadable file, values that are not finite, a time axis that does not increase, gaps, and
        where neither the file nor the excitation states a unit.
    """
    path = (folder or Path()) / excitation.file
    if not path.is_file():
        path = Path(excitation.file)
    if not path.is_file():
        _reject(f"= {excitation.file} does not exist", "give its path, relative to the folder of the scenario")
    suffix = path.suffix.lower()
    try:
        if suffix in (".h5", ".hdf5"):
            columns = _from_hdf5(path, excitation)
        elif suffix in (".uff", ".unv"):
            columns = _from_uff(path, excitation)
        else:
            columns = _from_csv(path, excitation)
    except (OSError, ValueError, UnicodeDecodeError) as error:
        _reject(f"= {excitation.file} cannot be read: {str(error).splitlines()[0]}", "check the file and its columns")
    time, values = columns.time, columns.values
    if values.size < 4:
        _reject(f"= {excitation.file} has only {values.size} samples", "give a longer record")
    _refuse_without_units(columns, excitation)
    if excitation.unit is None:
        values = values * _factor(columns.unit, excitation)
    try:
        if excitation.sample_rate is not None:
            time = np.arange(values.size) / excitation.sample_rate
        else:
            assert time is not None
            unit = excitation.time_unit or columns.time_unit
            time = time * axis_factor(unit, "excitation.time_unit", of_frequency=False)
        check_record(time, values, of_frequency=False)
    except AxisError as fault:
        _reject(f"= {excitation.file} {fault.message}", fault.remedy)
    step = np.diff(time)
    median = float(np.median(step))
    if np.any(step > LARGEST_GAP * median):
        where = int(np.flatnonzero(step > LARGEST_GAP * median)[0])
        _reject(
            f"= {excitation.file} has a gap after sample {where + 1}: {time[where]:g} s to {time[where + 1]:g} s "
            f"while the sampling interval is {median:g} s",
            "fill the gap, or use the part before or after it",
        )
    return time, values


def _factor(unit: str, excitation: SampledInput) -> float:
    """SI value of one in the file, by the unit that the file states."""
    quantity = excitation.quantity or "acceleration"
    try:
        return read_level(f"1 {unit}", (LEVEL_DIMENSIONS[quantity],))[0]
    except UnitError as error:
        _reject(
            f"is missing, and {excitation.file} has values in {unit}, which {error.message}",
            f"give the unit of the values, a unit of {quantity}, or another quantity",
            "unit",
        )


def _refuse_without_units(columns: _Columns, excitation: SampledInput) -> None:
    """Ask for the times, and for each unit that neither the file nor the scenario states."""
    if excitation.sample_rate is None and columns.time is None:
        _reject(f"= {excitation.file} has no time axis", "give excitation.sample_rate", "sample_rate")
    quantity = excitation.quantity or "acceleration"
    problems = []
    if not (excitation.unit or columns.unit):
        example = {"acceleration": "g", "displacement": "mm"}.get(quantity, LEVEL_DIMENSIONS[quantity].unit)
        message = f"is missing, and {excitation.file} states no unit of its values"
        remedy = f"give that of the {spoken(quantity)}, for example unit: {example}"
        problems.append(Problem("excitation.unit", message, remedy))
    if excitation.sample_rate is None and not (excitation.time_unit or columns.time_unit):
        message = f"is missing, and {excitation.file} {without_unit(of_frequency=False)}"
        problems.append(Problem("excitation.time_unit", message, "give it, for example time_unit: s"))
    if problems:
        raise ScenarioError(problems)


class _Columns(NamedTuple):
    """A record as it is in the file; units are empty where the file states none."""

    time: Floats | None
    values: Floats
    time_unit: str
    unit: str


def _reject(message: str, remedy: str, key: str = "file") -> NoReturn:
    raise ScenarioError(Problem(f"excitation.{key}", message, remedy))


def _from_csv(path: Path, excitation: SampledInput) -> _Columns:
    table = read_csv(path)
    has_times = excitation.time_column is not None or (table.width > 1 and excitation.sample_rate is None)
    time_at = table.column(excitation.time_column, 0) if has_times else None
    column = table.column(excitation.column, 0 if time_at is None or table.width == 1 else 1)
    time_unit = "" if time_at is None else table.units[time_at]
    times = None if time_at is None else table.values[:, time_at]
    return _Columns(times, table.values[:, column], time_unit, table.units[column])


def _from_hdf5(path: Path, excitation: SampledInput) -> _Columns:
    import h5py

    with h5py.File(path, "r") as file:
        if excitation.column is None:
            raise ValueError("give the name of the dataset in excitation.column")

        def dataset(name: str) -> tuple[Floats, str]:
            if name not in file or not isinstance(file[name], h5py.Dataset):
                raise ValueError(f"there is no dataset {name}")
            unit = stated(str(file[name].attrs.get("units", ""))) or split_heading(name)[1]
            return np.asarray(file[name][()], dtype=float).ravel(), unit

        time, time_unit = None, ""
        if excitation.time_column is not None:
            time, time_unit = dataset(excitation.time_column)
        elif excitation.sample_rate is None and "time" in file:
            time, time_unit = dataset("time")
        values, unit = dataset(excitation.column)
        if time is not None and time.size != values.size:
            raise ValueError(f"{time.size} times for {values.size} values")
        return _Columns(time, values, time_unit, unit)


def _from_uff(path: Path, excitation: SampledInput) -> _Columns:
    import pyuff

    number = 1 if excitation.column is None else int(excitation.column)
    try:
        sets = pyuff.UFF(str(path))
        kinds = [int(kind) for kind in sets.get_set_types()]
    except Exception as error:  # pyuff raises bare exceptions on damaged files
        raise ValueError(f"not a universal file ({error})") from None
    records = [i for i, kind in enumerate(kinds) if kind == 58]
    if not 1 <= number <= len(records):
        raise ValueError(f"the file has {len(records)} data sets 58")
    record = sets.read_sets(records[number - 1])
    values = np.asarray(record["data"])
    if np.iscomplexobj(values) or int(record.get("func_type", 1)) not in (0, 1):
        raise ValueError("this data set 58 is not a time history")
    time_unit, unit = units_of_uff(record, lambda: units_of_file(sets))
    return _Columns(np.asarray(record["x"], dtype=float), values.astype(float), time_unit, unit)
