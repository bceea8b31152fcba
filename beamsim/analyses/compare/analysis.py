"""``beamsim compare``: a computed and a measured motion, aligned in phase and compared harmonic by harmonic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from beamsim.analyses.compare.measured import Harmonics, best_phase, harmonics_of, settled_from
from beamsim.analyses.compare.result import ChannelComparison, Comparison
from beamsim.analyses.run.result import RunResult, Spectrum
from beamsim.analyses.run.spectra import amplitude_db, spectrum
from beamsim.measurements.channels import unusable
from beamsim.measurements.signal import MeasuredSignal, MeasurementError
from beamsim.outcomes import COMPLETE
from beamsim.scenario.quantities import level_unit
from beamsim.scenario.run import SpectrumSettings
from beamsim.typing import Floats

QUANTITIES = ("absolute_acceleration", "displacement", "absolute_displacement", "velocity", "force")
_SHOWN_PERIODS = 4


def compare(
    result: RunResult,
    pairs: Sequence[tuple[str, str, MeasuredSignal]],
    *,
    harmonics: int = 10,
    last: float | None = None,
) -> Comparison:
    """Compare pairs of (place, quantity, measured signal in SI units) with a run.

    Parameters
    ----------
    harmonics : number of harmonics in the table.
    last : use only this last part of measured histories, s; by default as long as the part of the run that is used:
        that of ``run.spectrum``, else the part in which its motion has settled.

    Raises
    ------
    ScenarioError
        If a measured record is too short, unevenly sampled or sampled too slowly.
    """
    warnings: list[str] = []
    begin = perf_counter()
    channels = tuple(_channel(result, *pair, harmonics, last, warnings) for pair in pairs)
    return Comparison(
        scenario=result.scenario,
        outcome=COMPLETE,
        channels=channels,
        warnings=tuple(warnings),
        wall_time_s=perf_counter() - begin,
    ).with_summary(comparisons=[_compared(channel) for channel in channels])


def predicted_history(result: RunResult, place: str, quantity: str) -> Floats:
    """(nt,) the computed history of a quantity at a probe or, for a force, at a snubber."""
    return np.asarray(getattr(result.snubbers[place] if quantity == "force" else result.probes[place], quantity))


def _channel(
    result: RunResult, place: str, quantity: str, signal: MeasuredSignal, count: int, last: float | None,
    warnings: list[str],
) -> ChannelComparison:  # fmt: skip
    excitation = next((s.excitation_hz for s in result.spectra.values()), float("nan"))
    unit = level_unit(quantity.removeprefix("absolute_"))
    run = _part_of_run(result, place, quantity, excitation, warnings)
    if last is None and np.isfinite(excitation):
        last = float(run.x[-1] - run.x[0]) * (1 + 1e-9)
    if not np.any(signal.y):
        what = f"{signal.label} is zero throughout"
        raise unusable(what, "check the channel and its cable, or leave it out with --channel")
    record = signal
    if not signal.of_frequency and last is not None:
        kept = signal.x >= signal.x[-1] - last
        record = replace(signal, x=signal.x[kept], y=signal.y[kept])
    try:
        predicted, measured = _harmonics(run, record, excitation, count, warnings)
    except MeasurementError as fault:
        raise unusable(f"{signal.label} {fault.message}", fault.remedy) from None
    spectra = [_spectrum(each, excitation, place, quantity, unit) for each in (run, record)]
    has_phase = bool(np.isfinite(excitation)) and measured.has_phase
    phase, delay = 0.0, 0.0
    if has_phase:
        weights = np.full(measured.order.size, max(float(np.max(np.abs(measured.value))), 1e-300))
        phase = float(np.angle(np.exp(1j * best_phase(measured, predicted.value, weights))))
        delay = phase / (2 * np.pi * excitation)
    elif not signal.of_frequency:
        delay = _lag(run, record)
    time_p, history_p, time_m, history_m = _aligned(run, record, delay, excitation)
    return ChannelComparison(
        place=place,
        quantity=quantity,
        unit=unit,
        channel=signal.name,
        source=signal.source,
        excitation_hz=excitation,
        delay_s=delay,
        order=predicted.order,
        predicted=predicted.value,
        measured=measured.value * np.exp(-1j * measured.order * phase),
        measured_noise=measured.noise,
        has_phase=has_phase,
        rms_difference=_rms(time_p, history_p, time_m, history_m),
        predicted_time=time_p,
        predicted_history=history_p,
        measured_time=time_m,
        measured_history=history_m,
        predicted_spectrum=spectra[0],
        measured_spectrum=spectra[1],
        start_s=float(run.x[0]),
    )


def _part_of_run(
    result: RunResult, place: str, quantity: str, excitation: float, warnings: list[str]
) -> MeasuredSignal:
    """The part of a computed history that is compared."""
    times, values = result.time, predicted_history(result, place, quantity)
    part = slice(max(times.size - 2**21, 0), times.size)
    time, x = times[part], np.asarray(values[part], dtype=float)
    name = f"{place} {quantity.replace('_', ' ')}"
    if part.start:
        warnings.append(f"{name}: only the last {time[-1] - time[0]:.4g} s of the run are compared ({x.size} samples)")
    steady = time >= _start(result, time, x, excitation, name, warnings)
    return MeasuredSignal(place, time[steady], x[steady])


def _start(result: RunResult, time: Floats, x: Floats, excitation: float, name: str, warnings: list[str]) -> float:
    """Start of the part of a run that is compared: as `run.spectrum` says, else where its motion has settled."""
    settings = None if result.scenario.run is None else result.scenario.run.spectrum
    if settings is not None and (settings.last is not None or settings.periods is not None):
        duration = max((s.duration_s for s in result.spectra.values()), default=np.inf)
        share = min(duration / float(time[-1] - time[0]), 1.0)
        return float(time[-round(share * (time.size - 1))])  # whole periods: one end of the two
    if not np.isfinite(excitation):
        return float(time[0])
    start, deviation = settled_from(time, x, 1.0 / excitation)
    # 0.01: relative difference of periods of a settled motion, rms
    if deviation > 0.01:
        warnings.append(
            f"{name}: the run does not settle (its last periods differ by {deviation:.2g} of the motion); the last "
            f"{time[-1] - start:.4g} s are compared: run longer, or choose the part by run.spectrum.last"
        )
    return start


def _harmonics(
    predicted: MeasuredSignal, measured: MeasuredSignal, excitation: float, count: int, warnings: list[str]
) -> tuple[Harmonics, Harmonics]:
    """Harmonics of both signals, as many as both contain; none without an excitation frequency."""
    if not np.isfinite(excitation):
        none = Harmonics(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=complex), np.zeros(0), False)
        return none, none
    limits = [int(0.499 * (s.x.size - 1) / (s.x[-1] - s.x[0]) / excitation) for s in (predicted, measured)]
    if measured.of_frequency:
        limits[1] = int(measured.x[-1] / excitation)
    possible = max(1, min(count, *limits))
    if possible < count:
        warnings.append(f"{measured.name}: the records contain {possible} harmonics of {excitation:g} Hz, not {count}")
    return harmonics_of(predicted, excitation, possible), harmonics_of(measured, excitation, possible)


def _spectrum(signal: MeasuredSignal, excitation: float, place: str, quantity: str, unit: str) -> Spectrum:
    """That of a history; one that was measured stays as it is."""
    if signal.of_frequency:
        amplitude = np.abs(signal.y)
        return Spectrum(
            place, quantity, unit, signal.x, amplitude, amplitude_db(amplitude, float(amplitude.max())), excitation,
            "as measured", 0.0, 0.0, (),
        )  # fmt: skip
    steps = np.diff(signal.x)
    mean = float(np.mean(steps))
    at = int(np.argmax(np.abs(steps - mean)))
    if abs(steps[at] - mean) > 1e-3 * mean:
        raise unusable(
            f"{signal.label} is not evenly sampled (the step after sample {at + 1} is {steps[at]:.6g} s, the mean "
            f"{mean:.6g} s)",
            "resample it, or export it without gaps",
        )
    return spectrum(signal.x, np.asarray(signal.y, dtype=float), SpectrumSettings(), excitation, place, quantity, unit)


def _lag(predicted: MeasuredSignal, measured: MeasuredSignal) -> float:
    """Delay of maximum correlation, for motions without excitation frequency."""
    from scipy import signal

    length = float(measured.x[-1] - measured.x[0])
    step = length / (measured.x.size - 1)
    grid = np.arange(int(min(float(predicted.x[-1] - predicted.x[0]), length) / step) + 1) * step
    a, b = (np.interp(s.x[0] + grid, s.x, np.asarray(s.y, dtype=float)) for s in (predicted, measured))
    correlation = signal.correlate(a - a.mean(), b - b.mean(), method="fft")
    lags = signal.correlation_lags(grid.size, grid.size)
    return float(predicted.x[0] + lags[np.argmax(correlation)] * step - measured.x[0])


def _aligned(
    predicted: MeasuredSignal, measured: MeasuredSignal, delay: float, excitation: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """A few periods of both in the time of the prediction (the whole record without an excitation frequency)."""
    x, y = predicted.x, np.asarray(predicted.y, dtype=float)
    none = np.zeros(0)
    moved, history = (
        (none, none) if measured.of_frequency else (measured.x + delay, np.asarray(measured.y, dtype=float))
    )
    if not np.isfinite(excitation):
        return x, y, moved, history
    period = 1 / excitation
    shown = x >= x[-1] - _SHOWN_PERIODS * period
    x, y = x[shown], y[shown]
    if moved.size:
        behind = (x[-1] - moved[-1]) / period
        covers = moved[-1] - moved[0] >= (_SHOWN_PERIODS + 1) * period
        moved = moved + (np.ceil(behind - 1e-6) if covers else np.round(behind)) * period
    kept = (moved >= x[0]) & (moved <= x[-1])
    return x, y, moved[kept], history[kept]


def _rms(time_p: Floats, history_p: Floats, time_m: Floats, history_m: Floats) -> float:
    inside = (time_m >= time_p[0]) & (time_m <= time_p[-1]) if time_m.size else np.zeros(0, dtype=bool)
    if not inside.any():
        return float("nan")
    difference = np.interp(time_m[inside], time_p, history_p) - history_m[inside]
    size = float(np.sqrt(np.mean(history_m[inside] ** 2)))
    return float(np.sqrt(np.mean(difference**2)) / size) if size > 0 else float("nan")


def _compared(channel: ChannelComparison) -> dict[str, Any]:
    """Summary of one channel."""
    names = ("place", "quantity", "channel", "excitation_hz", "start_s", "delay_s", "rms_difference")
    harmonics = {
        "order": channel.order,
        "predicted": np.abs(channel.predicted),
        "measured": np.abs(channel.measured),
        "difference_db": channel.difference_db,
        "phase_difference_deg": channel.phase_difference_deg,
        "measured_noise": channel.measured_noise,
    }
    rows = zip(*(values.tolist() for values in harmonics.values()), strict=True)
    return {
        **{name: getattr(channel, name) for name in names},
        "harmonics": [dict(zip(harmonics, row, strict=True)) for row in rows],
    }
