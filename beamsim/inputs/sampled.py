"""Measured inputs: samples from a file as piecewise polynomials."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.inputs.signal import MOST_PIECES, Signal
from beamsim.measurements.channels import in_si
from beamsim.measurements.read import HDF5, read_file
from beamsim.measurements.signal import MeasuredSignal, MeasurementError, column_named
from beamsim.scenario.excitation import SampledInput
from beamsim.typing import Floats


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
    if pieces > MOST_PIECES:
        _reject(
            f"has {pieces:.3g} samples for this run (at most {MOST_PIECES:.0e})",
            "shorten the run, or set excitation.resample to a lower rate",
        )
    signal = interpolate(time, samples * excitation.factor, excitation.interpolation)
    return Signal(signal.start[:pieces], signal.exponent, signal.coefficient[:pieces])


def read_samples(excitation: SampledInput, folder: Path | None = None) -> tuple[Floats, Floats]:
    """Times, s, and values in SI units from the file, checked; its path is relative to a folder, else the current one.

    Raises
    ------
    ScenarioError
        For a missing or unreadable file, values that are not finite, a time axis that does not increase, gaps, and
        where neither the file nor the excitation states a unit.
    """
    path = (folder or Path()) / excitation.file
    if not path.is_file():
        path = Path(excitation.file)
    try:
        signals = read_file(path)
        signal = _along_time(_column(signals, excitation), signals, excitation)
        if signal.y.size < 4:
            _reject(f"= {excitation.file} has only {signal.y.size} samples", "give a longer record")
        signal = _in_si(signal, excitation).checked()
    except MeasurementError as fault:
        _reject(f"= {excitation.file} {fault.message}", fault.remedy)
    time, values = signal.x, np.asarray(signal.y, dtype=float)
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
    return time, values


def _column(signals: list[MeasuredSignal], excitation: SampledInput) -> MeasuredSignal:
    """The values: by default the first on an axis, and of columns that are sampled evenly the first of all."""
    if excitation.column is not None:
        return column_named(signals, excitation.column)
    if len(signals) > 2 and excitation.file.lower().endswith(HDF5):  # which has no order
        raise MeasurementError("has several data sets", "name one in excitation.column")
    evenly = excitation.sample_rate is not None and excitation.time_column is None
    return next((each for each in signals if each.axis and not evenly), signals[0])


def _along_time(signal: MeasuredSignal, signals: list[MeasuredSignal], excitation: SampledInput) -> MeasuredSignal:
    """The values over the times that are asked for."""
    if excitation.sample_rate is not None:
        even = np.arange(signal.y.size) / excitation.sample_rate
        return replace(signal, x=even, of_frequency=False, axis="time", axis_unit="s")
    if excitation.time_column is not None:
        time = column_named(signals, excitation.time_column)
        if time.y.size != signal.y.size:
            raise MeasurementError(f"has {time.y.size} times for {signal.y.size} values", "name another column")
        signal = replace(
            signal, x=np.asarray(time.y, dtype=float), of_frequency=False, axis=time.name, axis_unit=time.unit
        )
    if not signal.axis:
        _reject(f"= {excitation.file} has no time axis", "give excitation.sample_rate", "sample_rate")
    if signal.of_frequency or np.iscomplexobj(signal.y):
        raise MeasurementError(f"has no time history in {signal.name}", "name another one in excitation.column")
    return signal


def _in_si(signal: MeasuredSignal, excitation: SampledInput) -> MeasuredSignal:
    """The values in SI units over times in s; asks for each unit that neither the file nor the scenario states."""
    problems: list[Problem] = []
    try:
        signal = in_si(signal, excitation.unit, excitation.quantity or "acceleration", "excitation.unit")
    except ScenarioError as error:
        problems += error.problems
    if not (excitation.time_unit or signal.axis_unit):
        message = f"is missing, and {excitation.file} states no unit of its times"
        problems.append(Problem("excitation.time_unit", message, "give it, for example time_unit: s"))
    if problems:
        raise ScenarioError(problems)
    return signal.on_si_axis(excitation.time_unit, "excitation.time_unit")


def _reject(message: str, remedy: str, key: str = "file") -> NoReturn:
    raise ScenarioError(Problem(f"excitation.{key}", message, remedy))
