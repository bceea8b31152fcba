"""``beamsim compare``: a computed and a measured motion, aligned in phase and compared harmonic by harmonic."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np

from beamsim.analyses.compare.measured import Harmonics, best_phase, harmonics_of, settled_from
from beamsim.analyses.compare.result import ChannelComparison, Comparison
from beamsim.analyses.run.result import RunResult, SpectralLine, Spectrum
from beamsim.analyses.run.spectrum import amplitude_db, spectrum
from beamsim.errors import Problem, ScenarioError
from beamsim.measurements.signal import MeasuredSignal
from beamsim.outcomes import COMPLETE
from beamsim.scenario.run import SpectrumSettings
from beamsim.typing import Floats

QUANTITIES = ("absolute_acceleration", "displacement", "absolute_displacement", "velocity", "force")
_UNITS = {"absolute_acceleration": "m/s^2", "velocity": "m/s", "force": "N"}
_SHOWN_PERIODS = 4
MOST_COMPARED = 2**21  # samples of a run, the last ones
SETTLED = 0.01  # relative difference of periods of a settled motion, rms
_UNEVEN = 1e-3  # relative scatter of the sampling interval


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
    times, values = result.time, predicted_history(result, place, quantity)
    part = slice(max(times.size - MOST_COMPARED, 0), times.size)
    time, x = times[part], np.asarray(values[part])
    name = f"{place} {quantity.replace('_', ' ')}"
    if part.start:
        warnings.append(f"{name}: only the last {time[-1] - time[0]:.4g} s of the run are compared ({x.size} samples)")
    unit = _UNITS.get(quantity, "m")
    excitation = next((s.excitation_hz for s in result.spectra.values()), float("nan"))
    start = _start(result, time, x, excitation, name, warnings)
    steady = time >= start
    predicted_signal = MeasuredSignal(place, time[steady], x[steady])
    if last is None and np.isfinite(excitation):
        last = float(predicted_signal.x[-1] - predicted_signal.x[0]) * (1 + 1e-9)
    if not np.any(signal.y):
        what = f"{signal.label} is zero throughout"
        raise ScenarioError(Problem("", what, "check the channel and its cable, or leave it out with --channel"))
    try:
        predicted, measured = _harmonics(predicted_signal, signal, excitation, count, last, warnings)
    except ValueError as error:
        raise ScenarioError(
            Problem(
                "",
                f"{signal.label} {error}",
                "use a longer record or a higher sample rate",
            )
        ) from None
    time_measured, history_measured = _histories(signal, last)
    settings = SpectrumSettings()
    predicted_spectrum = spectrum(
        predicted_signal.x, np.asarray(predicted_signal.y, dtype=float), settings, excitation, place, quantity, unit
    )
    if signal.of_frequency:
        measured_spectrum = _given_spectrum(signal, excitation, place, quantity, unit)
    else:
        _evenly_sampled(signal)
        measured_spectrum = spectrum(time_measured, history_measured, settings, excitation, place, quantity, unit)
    forced = bool(np.isfinite(excitation))
    has_phase = measured.has_phase
    if forced and has_phase:
        weights = np.full(measured.order.size, max(float(np.max(np.abs(measured.value))), 1e-300))
        phase = best_phase(measured, predicted.value, weights)
        phase = float(np.angle(np.exp(1j * phase)))
        delay = phase / (2 * np.pi * excitation)
    else:
        phase, delay = 0.0, 0.0 if signal.of_frequency else _lag(predicted_signal, time_measured, history_measured)
    time_p, history_p, time_m, history_m = _aligned(
        predicted_signal, time_measured, history_measured, delay, excitation, histories=not signal.of_frequency
    )
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
        has_phase=has_phase and forced,
        rms_difference=_rms(time_p, history_p, time_m, history_m),
        predicted_time=time_p,
        predicted_history=history_p,
        measured_time=time_m,
        measured_history=history_m,
        predicted_spectrum=predicted_spectrum,
        measured_spectrum=measured_spectrum,
        start_s=float(predicted_signal.x[0]),
    )


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
    if deviation > SETTLED:
        warnings.append(
            f"{name}: the run does not settle (its last periods differ by {deviation:.2g} of the motion); the last "
            f"{time[-1] - start:.4g} s are compared: run longer, or choose the part by run.spectrum.last"
        )
    return start


def _harmonics(
    predicted: MeasuredSignal, measured: MeasuredSignal, excitation: float, count: int, last: float | None,
    warnings: list[str],
) -> tuple[Harmonics, Harmonics]:  # fmt: skip
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
    return harmonics_of(predicted, excitation, possible), harmonics_of(measured, excitation, possible, last)


def _histories(signal: MeasuredSignal, last: float | None) -> tuple[Floats, Floats]:
    if signal.of_frequency:
        return np.zeros(0), np.zeros(0)
    kept = signal.x >= (signal.x[-1] - last if last is not None else -np.inf)
    return signal.x[kept], np.asarray(signal.y, dtype=float)[kept]


def _evenly_sampled(signal: MeasuredSignal) -> None:
    steps = np.diff(signal.x)
    mean = float(np.mean(steps))
    worst = float(np.max(np.abs(steps - mean)))
    if worst > _UNEVEN * mean:
        at = int(np.argmax(np.abs(steps - mean))) + 1
        raise ScenarioError(
            Problem(
                "",
                f"{signal.label} is not evenly sampled (the step after sample {at} is "
                f"{steps[at - 1]:.6g} s, the mean {mean:.6g} s)",
                "resample it, or export it without gaps",
            )
        )


def _given_spectrum(signal: MeasuredSignal, excitation: float, place: str, quantity: str, unit: str) -> Spectrum:
    amplitude = np.abs(signal.y)
    lines: tuple[SpectralLine, ...] = ()
    return Spectrum(
        place, quantity, unit, signal.x, amplitude, amplitude_db(amplitude, float(amplitude.max())), excitation,
        "as measured", 0.0, 0.0, lines,
    )  # fmt: skip


def _lag(predicted: MeasuredSignal, time: Floats, history: Floats) -> float:
    """Delay of maximum correlation, for motions without excitation frequency."""
    step = float((time[-1] - time[0]) / (time.size - 1))
    span = min(float(predicted.x[-1] - predicted.x[0]), float(time[-1] - time[0]))
    grid = np.arange(int(span / step) + 1) * step
    a = np.interp(predicted.x[0] + grid, predicted.x, np.asarray(predicted.y, dtype=float))
    b = np.interp(time[0] + grid, time, history)
    size = 2 * grid.size
    correlation = np.fft.irfft(np.fft.rfft(a - a.mean(), size) * np.conj(np.fft.rfft(b - b.mean(), size)), size)
    best = int(np.argmax(correlation))
    shift = (best if best <= size // 2 else best - size) * step
    return float(predicted.x[0] + shift - time[0])


def _aligned(
    predicted: MeasuredSignal, time: Floats, history: Floats, delay: float, excitation: float, *, histories: bool
) -> tuple[Floats, Floats, Floats, Floats]:
    """A few periods of both in the time of the prediction (the whole record without an excitation frequency)."""
    x, y = predicted.x, np.asarray(predicted.y, dtype=float)
    if not np.isfinite(excitation):
        return x, y, time + delay if histories else time, history
    period = 1 / excitation
    shown = x >= x[-1] - _SHOWN_PERIODS * period
    x, y = x[shown], y[shown]
    if not histories:
        return x, y, np.zeros(0), np.zeros(0)
    moved = time + delay
    behind = (x[-1] - moved[-1]) / period
    covers = time[-1] - time[0] >= (_SHOWN_PERIODS + 1) * period
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
