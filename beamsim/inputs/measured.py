"""Measured inputs: files of samples as piecewise polynomials, and sweep levels from tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.files import find_file
from beamsim.inputs.signal import MOST_PIECES, Signal
from beamsim.inputs.statements import InputAccount, InputStatement
from beamsim.measurements.columns import column_named, only_column
from beamsim.measurements.conditioning import (
    clipping_warnings,
    condition,
    offset_warnings,
    rounding_warnings,
    with_even_times,
)
from beamsim.measurements.functions import FunctionType
from beamsim.measurements.read import TEXT, read_file
from beamsim.measurements.signal import MeasuredSignal, axis_kind, in_si
from beamsim.scenario import Scenario
from beamsim.scenario.base import InvalidValueError, path_text
from beamsim.scenario.base import Path as Keys
from beamsim.scenario.excitation import MatchedInput, ProfilePoint, RandomInput, SampledInput, quantity_text
from beamsim.scenario.files import CurveFile
from beamsim.scenario.quantities import DENSITY_DIMENSIONS, LEVEL_DIMENSIONS, LevelValue, meant, power_of
from beamsim.scenario.reporting import Limits
from beamsim.scenario.units import (
    ACCELERATION,
    FREQUENCY,
    Dimension,
    UnitError,
    read_level,
    read_quantity,
    size_of,
)  # fmt: skip
from beamsim.typing import TINY, Floats

# cycles of the lowest frequency, and samples per cycle of the highest, in a record for a shock response spectrum
FEWEST_HALF_CYCLES, SAMPLES_A_CYCLE = 3, 20
MOST_SAMPLES = 500_000  # samples of such a record, which take minutes


def interpolate(time: Floats, samples: Floats, kind: str) -> Signal:
    """Interpolate samples; the last value is held.

    Parameters
    ----------
    time : (n,) s, increasing.
    samples : (n,) values at these times.
    kind : ``linear``, or ``cubic`` for a spline.

    Returns
    -------
    Signal
        With one piece between two samples, and one after the last.
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


def sampled_signal(
    excitation: SampledInput, duration: float | None, folder: Path | None = None
) -> tuple[Signal, InputAccount]:
    """The samples of an input as a signal from t = 0 on.

    Parameters
    ----------
    excitation : section of the scenario.
    duration : duration of the run, s; by default that of the samples.
    folder : base folder of the path; by default the current one.

    Returns
    -------
    tuple
        The signal in SI units, and its description for results.

    Raises
    ------
    ScenarioError
        If the file cannot be read, has gaps, or is shorter than the run.
    """
    record = read_record(excitation, folder)
    time, samples = record.x - record.x[0], np.asarray(record.y, dtype=float)
    if duration is not None and time[-1] < duration * (1 - 1e-9) - (time[1] - time[0]):
        _reject(
            f"= {excitation.file} ends after {time[-1]:g} s, before run.duration = {duration:g} s",
            f"run for at most {time[-1]:g} s",
        )
    # the whole record is interpolated: the input must not depend on the duration of the run
    pieces = time.size if duration is None else int(np.searchsorted(time, duration, side="left")) + 1
    if pieces > MOST_PIECES:
        _reject(
            f"has {pieces:.3g} samples for this run (at most {MOST_PIECES:.0e})",
            "shorten the run, or set excitation.resample to a lower rate",
        )
    signal = interpolate(time, samples, excitation.interpolation)
    statement = InputStatement(
        path="", quantity=excitation.quantity, unit=record.unit, rms=float(np.sqrt(np.mean(samples**2))),
        sample_rate_hz=(time.size - 1) / float(time[-1]), treatment="; ".join(record.scaling),
        peak=float(np.max(np.abs(samples))),
    )  # fmt: skip
    cut = Signal(signal.start[:pieces], signal.exponent, signal.coefficient[:pieces])
    return cut, InputAccount(statement, record.warnings)


def read_record(excitation: SampledInput, folder: Path | None = None) -> MeasuredSignal:
    """Read the record of a sampled input, and check and prepare it as the scenario requires.

    Parameters
    ----------
    excitation : section of the scenario.
    folder : base folder of the path; by default the current one.

    Returns
    -------
    MeasuredSignal
        In SI units, with a description of its treatment and with warnings.

    Raises
    ------
    ScenarioError
        For a missing or unreadable file, values that are not finite, a time axis that does not increase, gaps, an
        unsuitable filter, or a missing unit.
    """
    path = find_file(excitation.file, folder)
    try:
        signal = _select_times(read_file(path, excitation.decimal), excitation)
        if signal.y.size < 4:
            _reject(f"= {excitation.file} has only {signal.y.size} samples", "give a longer record")
        raw = with_even_times(signal)
        signal = _in_si(raw, excitation).check()
        _demand_no_gaps(signal, excitation)
        used = condition(signal, excitation, excitation.resample)
    except InputFileError as fault:
        _reject(f"= {excitation.file} {fault.message}", fault.remedy)
    doubts = [*clipping_warnings(raw), *offset_warnings(used, starts=not excitation.stationary)]
    size = abs(excitation.factor) * float(np.abs(signal.y).max() / max(np.abs(raw.y).max(), TINY))
    doubts += rounding_warnings(raw, used, size, power_of(excitation.quantity))
    return replace(used, warnings=(*used.warnings, *doubts))


def _demand_no_gaps(signal: MeasuredSignal, excitation: SampledInput) -> None:
    """Refuse a record with missing samples."""
    time = signal.x
    step = np.diff(time)
    median = float(np.median(step))
    gaps = np.flatnonzero(step > 1.5 * median)
    if gaps.size:
        where = int(gaps[0])
        _reject(
            f"= {excitation.file} has a gap after sample {where + 1}: {time[where]:g} s to {time[where + 1]:g} s "
            f"while the sampling interval is {median:g} s",
            "fill the gap, or use the part before or after it",
        )


def _select_times(signals: list[MeasuredSignal], excitation: SampledInput) -> MeasuredSignal:
    """The values, with the requested time axis."""
    time = None if excitation.time_column is None else column_named(signals, excitation.time_column)
    signal = _values(signals, time, excitation)
    if excitation.sample_rate is not None:
        even = np.arange(signal.y.size) / excitation.sample_rate
        signal = replace(signal, x=even, is_over_frequency=False, axis="time", axis_unit="s")
    elif time is not None:
        if time.y.size != signal.y.size:
            raise InputFileError(f"has {time.y.size} times for {signal.y.size} values", "name another column")
        signal = replace(
            signal, x=np.asarray(time.y, dtype=float), is_over_frequency=False, axis=time.name, axis_unit=time.unit
        )
    if not signal.axis:
        remedy = "give excitation.sample_rate, or name the column of times in excitation.time_column"
        _reject(f"= {excitation.file} has no time axis of {signal.name}", remedy, "excitation.sample_rate")
    signal = signal.require((FunctionType.TIME_HISTORY,), "a sampled input")
    if np.iscomplexobj(signal.y):
        raise InputFileError(f"has complex values in {signal.name}", "name another one in excitation.column")
    return signal


def _values(signals: list[MeasuredSignal], time: MeasuredSignal | None, excitation: SampledInput) -> MeasuredSignal:
    """The requested column of values, or the only possible one."""
    if excitation.column is not None:
        signal = column_named(signals, excitation.column)
        if signal is time or (not signal.axis and axis_kind(signal.name)):
            raise InputFileError(f"has the axis {signal.name}, not values", "name another column in excitation.column")
        return signal
    if time is not None:  # in a file with several axes, the values on this one
        signals = [signal for signal in signals if signal.axis == time.name] or signals
    if excitation.sample_rate is not None or time is not None:  # the first column may then contain values
        signals = [replace(signal, axis="") if signal is not time else signal for signal in signals]
    return only_column(
        signals, LEVEL_DIMENSIONS[excitation.quantity], key="excitation.column", axis=time,
        by_unit=excitation.file.lower().endswith(TEXT),
    )  # fmt: skip


def _other_quantity(unit: str, quantities: Sequence[str]) -> str:
    """The remedy for values in a unit of another quantity than expected."""
    for quantity in quantities[1:]:
        with suppress(UnitError):
            size_of(unit, LEVEL_DIMENSIONS[quantity])
            return f", or write unit: {unit} if the file has a {quantity_text(quantity)}"
    return ""


def _in_si(signal: MeasuredSignal, excitation: SampledInput) -> MeasuredSignal:
    """Convert the values to SI units over times in s; a unit must be given in the file or the scenario."""
    problems: list[Problem] = []
    try:
        dimension = LEVEL_DIMENSIONS[excitation.quantity or "acceleration"]
        signal = in_si(signal, excitation.unit, dimension, "excitation.unit")
    except ScenarioError as error:
        hint = (
            "" if excitation.unit or excitation.quantity_ else _other_quantity(signal.unit, excitation.level_quantities)
        )
        problems += (replace(problem, remedy=problem.remedy + hint) for problem in error.problems)
    if not (excitation.time_unit or signal.axis_unit):
        message = f"is missing, and {excitation.file} states no unit of its times"
        problems.append(Problem("excitation.time_unit", message, "give it, for example time_unit: s"))
    if problems:
        raise ScenarioError(problems)
    return signal.on_si_axis(excitation.time_unit, "excitation.time_unit")


def _reject(message: str, remedy: str, key: str = "excitation.file") -> NoReturn:
    raise ScenarioError.at(key, message, remedy)


def read_profile(table: CurveFile, folder: Path, quantities: tuple[str, ...]) -> tuple[ProfilePoint, ...]:
    """Read a table of levels over frequency.

    Parameters
    ----------
    table, folder : the file, and the base folder of its path.
    quantities : allowed quantities of the levels; empty if they are factors of several forces.

    Returns
    -------
    tuple
        Points in SI units, by increasing frequency.

    Raises
    ------
    ScenarioError
        If the file cannot be read, has no unit of the levels, or does not contain increasing positive frequencies.
    """
    dimensions = {name: LEVEL_DIMENSIONS[name] for name in quantities if name in LEVEL_DIMENSIONS}
    frequency, level, quantity = _read_table(table, folder, "sweep.profile_file", dimensions)
    return tuple(
        ProfilePoint.model_construct(frequency=float(f), level=LevelValue(float(a), quantity))
        for f, a in zip(frequency, level, strict=True)
    )


def limit_curve(scenario: Scenario, limit: str, place: str, quantity: str, frequency: Floats) -> Floats | None:
    """A limit over frequency, with log-log interpolation between its points; at a step the lower value.

    Parameters
    ----------
    scenario : with or without limits.
    limit, place : ``srs``, ``psd`` or ``response``, and the name of the probe, snubber or input.
    quantity : quantity of the limited values; a curve for another quantity is ignored.
    frequency : (nf,) Hz.

    Returns
    -------
    (nf,) array or None
        In SI units, nan outside the curve; None if there is no limit.

    Raises
    ------
    ScenarioError
        If its file cannot be read, or does not contain frequencies and limits.
    """
    points, at = (getattr(scenario.limits, limit, None) or {}).get(place), ("limits", limit, place)
    if points is None:
        return None
    dimensions = Limits.curves[limit]
    along, level, stated = read_curve(points, scenario.folder_of(*at, "file"), at, dimensions, steps=True)
    if (stated or next(iter(dimensions))) != quantity:
        return None
    with np.errstate(divide="ignore"):
        limits = on_curve(frequency, along, level, np.nan)
    for k in np.flatnonzero(np.diff(along) == 0.0):
        limits[np.isclose(frequency, along[k], rtol=1e-9, atol=0.0)] = level[k : k + 2].min()
    return limits


def on_curve(
    frequency: Floats | float, curve_frequency: Floats, curve_value: Floats, log_outside: float | None = None
) -> Floats:
    """Interpolate a curve on logarithmic axes.

    Parameters
    ----------
    frequency : (nf,) Hz.
    curve_frequency, curve_value : (n,) frequencies, Hz, and positive values of its points.
    log_outside : logarithm of the value outside the points; by default that of the nearest point.

    Returns
    -------
    (nf,) array
        In the unit of the curve.
    """
    return np.asarray(
        np.exp(np.interp(np.log(frequency), np.log(curve_frequency), np.log(curve_value), log_outside, log_outside))
    )


def read_curve(
    curve: tuple[tuple[float, float], ...] | CurveFile,
    folder: Path,
    path: Keys,
    dimensions: Mapping[str, Dimension],
    *,
    steps: bool = False,
) -> tuple[Floats, Floats, str | None]:
    """Frequencies, Hz, and values in SI units of a curve, and the quantity of the values if a unit gives it.

    Parameters
    ----------
    curve : points, or the text file with the points.
    folder : base folder of the path.
    path : path of the key, for messages.
    dimensions : allowed dimensions of the values, by quantity.
    steps : whether two points may have the same frequency.

    Raises
    ------
    ScenarioError
        If its file cannot be read, or does not contain frequencies and values.
    """
    if isinstance(curve, CurveFile):
        return _read_table(curve, folder, path_text(path), dimensions, steps=steps)
    frequency, value = np.transpose(curve)
    return frequency, value, meant(curve[0][1])


def target_curve(excitation: MatchedInput, folder: Path | None = None) -> tuple[Floats, Floats]:
    """Frequencies, Hz, and accelerations, m/s^2, of the required spectrum; ``folder`` is the base of a relative path.

    Raises
    ------
    ScenarioError
        If its file cannot be read, or the record is too short for its lowest frequency.
    """
    known = {ACCELERATION.name: ACCELERATION}
    frequency, level, _ = read_curve(excitation.srs, folder or Path(), ("excitation", "srs"), known)
    lowest, highest, at = float(frequency[0]), float(frequency[-1]), "excitation.duration"
    if excitation.duration * lowest < 0.5 * FEWEST_HALF_CYCLES:
        message = f"is shorter than {0.5 * FEWEST_HALF_CYCLES:g} cycles of the curve's lowest frequency, {lowest:g} Hz"
        longer = f"give {FEWEST_HALF_CYCLES / lowest:.3g} s, or a curve that begins at a higher frequency"
        raise ScenarioError.at(at, f"= {excitation.duration:g} s {message}", longer)
    if (samples := SAMPLES_A_CYCLE * highest * excitation.duration) > MOST_SAMPLES:
        message = f"needs {samples:.3g} samples up to {highest:g} Hz (at most {MOST_SAMPLES:.0e})"
        raise ScenarioError.at(at, f"= {excitation.duration:g} s {message}", "shorten it")
    return frequency, level


def read_density(excitation: RandomInput, table: CurveFile, folder: Path | None = None) -> tuple[Floats, Floats]:
    """Read the density of a random input from a file.

    Parameters
    ----------
    excitation, table : the input, and the file with its density.
    folder : base folder of the path; by default the current one.

    Returns
    -------
    tuple
        Frequencies (p,), Hz, with two equal ones at a step, and densities (p,), SI.

    Raises
    ------
    ScenarioError
        If the file cannot be read, or does not contain frequencies and positive densities of this quantity.
    """
    dimensions: dict[str, Dimension] = {excitation.quantity: DENSITY_DIMENSIONS[excitation.quantity]}
    folder = folder or Path()
    if Path(table.file).suffix.lower() in TEXT:
        frequency, value, _ = _read_table(table, folder, "excitation.psd", dimensions, steps=True)
    else:
        frequency, value = _read_function(table, folder, dimensions[excitation.quantity])
    try:
        excitation.check_sample_rate(float(frequency[-1]))
    except InvalidValueError as fault:
        raise ScenarioError(fault.problem(("excitation",))) from None
    return frequency, value


def _read_function(table: CurveFile, folder: Path, dimension: Dimension) -> tuple[Floats, Floats]:
    """Frequencies, Hz, and densities, SI, of the only density in an analyser file, without the value at 0 Hz.

    Parameters
    ----------
    table, folder : the file, and the base folder of its path.
    dimension : dimension of the density.
    """
    file = table.file
    try:
        signals = read_file(find_file(file, folder), table.decimal)
        signals = signals if table.column is None else [column_named(signals, table.column)]
        densities = [each for each in signals if each.function == FunctionType.POWER_DENSITY]
        if len(densities) != 1:
            has = f"has {len(densities)} power spectral densities" if densities else "has no power spectral density"
            raise InputFileError(has, "export one alone, or as CSV with the columns frequency (Hz) and PSD (g^2/Hz)")
        density = densities[0].on_si_axis(None, "the unit of the axis in the file").check()
        if not density.unit:
            raise InputFileError(f"states no unit of {density.name}", f"export it with its unit, {dimension.example}")
        factor = read_quantity(f"1 {density.unit}", dimension)
    except (InputFileError, UnitError) as fault:
        _reject(f"= {file} {fault.message}", fault.remedy, "excitation.psd")
    given = density.x > 0.0
    frequency, value = density.x[given], np.real(density.y[given]) * factor
    if np.any(value <= 0.0):
        at = frequency[np.argmax(value <= 0.0)]
        _reject(f"= {file} has a density of zero or less at {at:g} Hz", "cut the table off there", "excitation.psd")
    return np.asarray(frequency, dtype=float), np.asarray(value, dtype=float)


def _read_table(
    table: CurveFile, folder: Path, key: str, dimensions: Mapping[str, Dimension], *, steps: bool = False
) -> tuple[Floats, Floats, str | None]:
    """Frequencies, Hz, and levels in SI units of a table, and the quantity of the levels.

    Parameters
    ----------
    table, folder : the file, and the base folder of its path.
    key : key that names the file.
    dimensions : allowed dimensions of the levels, by quantity; empty for levels without unit.
    steps : whether two rows may have the same frequency.
    """
    file = table.file
    try:
        signal, factor, quantity = _levels(read_file(find_file(file, folder), table.decimal), table, key, dimensions)
        unit = signal.axis_unit
        if not unit:
            raise InputFileError("cannot be used: its first column states no unit", "head it frequency (Hz)")
        frequency = np.asarray(signal.x * read_quantity(f"1 {unit}", FREQUENCY), dtype=float)
    except (InputFileError, UnitError) as fault:
        _reject(f"= {file} {fault.message}", fault.remedy, key)
    level = np.asarray(signal.y * factor, dtype=float)
    if not (np.all(np.isfinite(frequency)) and np.all(np.isfinite(level)) and frequency[0] > 0):
        _reject(f"= {file} has frequencies or levels that are not positive numbers", "correct the table", key)
    rising = np.diff(frequency) > 0
    if steps and rising.size > 2:  # a step between two lines
        rising[1:-1] |= (np.diff(frequency)[1:-1] == 0) & rising[:-2] & rising[2:]
    if not rising.all():
        row = int(np.flatnonzero(~rising)[0]) + 2
        _reject(f"= {file} has frequencies that do not increase at row {row}", "sort the table", key)
    if np.any(level <= 0):
        row = int(np.flatnonzero(level <= 0)[0]) + 1
        what = f"= {file} has the level {level[row - 1]:g} in row {row}, which has no logarithm"
        _reject(what, "give a small level", key)
    return frequency, level, quantity


def _levels(
    signals: list[MeasuredSignal], table: CurveFile, key: str, dimensions: Mapping[str, Dimension]
) -> tuple[MeasuredSignal, float, str | None]:
    """The column of levels over frequency, the SI value of its unit, and the quantity of the levels.

    Raises
    ------
    InputFileError
        If there is no such column, or several, or it has no unit.
    UnitError
        If the unit has none of the dimensions.
    """
    if len(signals) < 2:
        raise InputFileError("has one column", "give a frequency and a level in each row, with their units above")
    if table.column is None:
        signal = only_column(signals, *dimensions.values(), key=f"{key}.column")
    else:
        signal = column_named(signals, table.column)
    if not signal.axis:
        raise InputFileError(f"has no frequencies of {signal.name}", "head their column frequency (Hz)")
    if not dimensions:
        return signal, 1.0, None
    if not signal.unit:
        raise InputFileError(
            f"cannot be used: {signal.name or 'its second column'} states no unit", "head it for example level (g)"
        )
    factor, dimension = read_level(f"1 {signal.unit}", tuple(dimensions.values()))
    return signal, factor, next(name for name, known in dimensions.items() if known is dimension)
