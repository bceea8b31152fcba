"""``beamsim compare``: a computed and a measured motion, aligned in phase and compared harmonic by harmonic.

The channels of a measurement are assigned to probes and snubbers by their names. Transient records are compared by
peaks, scale, correlation and response spectra.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from beamsim.analyses.compare.result import (
    ChannelComparison,
    ComparedSpectrum,
    Comparison,
    RecordComparison,
    channel_datasets,
    outcome_of_comparison,
)
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.sweep.result import SweepResult
from beamsim.errors import InputFileError, ScenarioError
from beamsim.measurements.channels import (
    channel_named,
    contains_word,
    demand_amplitudes,
    measurement_error,
    read_signals,
)
from beamsim.measurements.conditioning import condition, offset_warnings
from beamsim.measurements.functions import RATIOS, FunctionType
from beamsim.measurements.signal import MeasuredSignal, in_si, split_heading
from beamsim.results.result import demand_result
from beamsim.scenario.excitation import quantity_text
from beamsim.scenario.files import DecimalMark, RecordPreparation
from beamsim.scenario.quantities import motion_dimension
from beamsim.scenario.run import ShockSpectrumSettings
from beamsim.scenario.units import ACCELERATION, FORCE, MOMENT, Dimension
from beamsim.signals.filters import PANELS_OF_OSCILLATOR, SAMPLES_OF_OSCILLATOR, geomspaced, shock_spectra
from beamsim.signals.harmonics import Harmonics, best_phase, harmonics_of, period_multiple, steady_part
from beamsim.signals.records import Window, amplitude_db, sampled_records
from beamsim.typing import TINY, Floats

PROBE_QUANTITIES = ("absolute_acceleration", "displacement", "absolute_displacement", "velocity")
CONTACT_QUANTITIES = {
    "N": ("force", FORCE),
    "N m": ("moment", MOMENT),
}  # by unit, of snubbers and of stops of hinges
_SHOWN_PERIODS = 4


def compare(
    result: RunResult,
    pairs: Sequence[tuple[str, str, MeasuredSignal]],
    *,
    harmonics: int = 10,
    last: float | None = None,
) -> Comparison:
    """Compare measured signals with a run.

    Parameters
    ----------
    result : result of the run.
    pairs : place, quantity, and measured signal in SI units.
    harmonics : number of harmonics in the table.
    last : s, length of the final part of measured histories to use; by default as long as the part of the run that is
        used (that of ``run.spectrum``, else the part with settled motion).

    Returns
    -------
    Comparison
        Its ``channels`` has one for each pair.

    Raises
    ------
    ScenarioError
        If a measured record is too short, unevenly sampled or sampled too slowly, or neither a time history nor an
        amplitude spectrum.

    Examples
    --------
    >>> import beamsim
    >>> changes = {"run.convergence": "off", "run.duration": "0.3 s", "run.spectrum.last": "0.1 s"}
    >>> result = beamsim.run(beamsim.load_scenario("configs/one_sided_65hz.yaml", changes))
    >>> pairs = beamsim.pair_channels(result, "configs/measurements/tip_65hz_2g.csv")
    >>> comparison = beamsim.compare(result, pairs, harmonics=3)
    >>> comparison["harmonics"]["order"].values.tolist(), comparison["harmonics"]["difference_db"].unit
    ([1.0, 2.0, 3.0], 'dB')
    """
    demand_result(result)
    warnings: list[str] = []
    begin = perf_counter()
    demand_amplitudes((signal for _, _, signal in pairs), "a comparison with a run")
    channels = tuple(_channel(result, pair, harmonics, last, warnings) for pair in pairs)
    warnings += [f"{signal.name}: {text}" for _, _, signal in pairs for text in record_warnings(signal)]
    return Comparison(
        scenario=result.scenario,
        outcome=outcome_of_comparison(result),
        datasets=channel_datasets(channels),
        warnings=(*result.warnings, *warnings),
        wall_time_s=perf_counter() - begin,
    ).with_summary(
        comparisons=[_channel_summary(channel) for channel in channels],
        margins=result.summary.get("margins"), doubtful=result.summary.get("doubtful"),
    )  # fmt: skip


def record_warnings(signal: MeasuredSignal) -> list[str]:
    """Warnings about a measured signal; for an acceleration also about an offset, which runs do not have."""
    if signal.is_over_frequency or signal.unit != ACCELERATION.unit:
        return list(signal.warnings)
    return [*signal.warnings, *offset_warnings(signal, starts=False)]


def predicted_history(result: RunResult, place: str, quantity: str) -> Floats:
    """Computed history of a place.

    Parameters
    ----------
    result : result of the run.
    place : probe or output; for a force or moment a snubber.
    quantity : one of `quantities_of` the place.

    Returns
    -------
    (nt,) array
        SI units.
    """
    histories = result["histories"]
    if place in histories.labels("probe") and quantity in PROBE_QUANTITIES:
        return histories[quantity].sel(probe=place).values
    if place in histories.labels("snubber") and quantity in dict(CONTACT_QUANTITIES.values()):
        return histories["snubber_force"].sel(snubber=place).values
    return histories["output_value"].sel(output=place).values


def _channel(result: RunResult, pair: Pair, count: int, last: float | None, warnings: list[str]) -> ChannelComparison:
    """Compare a channel with the history of a run: harmonics in phase, aligned histories, spectra."""
    place, quantity, signal = pair
    excitation = result.scenario.excitation.tone_hz
    unit = quantities_of(result)[place][quantity].unit
    run = _part_of_run(result, place, quantity, excitation, warnings)
    if last is None and np.isfinite(excitation):
        last = float(run.x[-1] - run.x[0]) * (1 + TIME_ROUND_OFF)
    if not np.any(signal.y):
        what = f"{signal.label} is zero throughout"
        raise measurement_error(what, "check the channel and its cable, or leave it out with --channel")
    record = signal.last(last)
    try:
        multiple = max(period_multiple(each, excitation) for each in (run, record))
        predicted, measured = _harmonics(run, record, (excitation, multiple), count, warnings)
    except InputFileError as fault:
        raise measurement_error(f"{signal.label} {fault.message}", fault.remedy) from None
    spectra = [_spectrum(each, excitation) for each in (run, record)]
    has_phase = bool(np.isfinite(excitation)) and measured.has_phase
    phase, delay = 0.0, 0.0
    if has_phase:
        weights = np.full(measured.order.size, max(float(np.max(np.abs(measured.value))), TINY))
        phase = float(np.angle(np.exp(1j * best_phase(measured, predicted.value, weights))))
        delay = phase * multiple / (2 * np.pi * excitation)
    elif not signal.is_over_frequency:
        delay = _lag(run, record)
    time_p, history_p, time_m, history_m = _aligned_samples(run, record, delay, multiple / excitation)
    likeness = None
    if not (np.isfinite(excitation) or signal.is_over_frequency):
        settings = None if result.scenario.run is None else result.scenario.run.srs
        likeness = compare_records((time_p, history_p), (time_m, history_m), settings)
        warnings += _sign_and_offset_warnings(run, record, (time_p, history_p, time_m, history_m))
        if likeness is not None and settings is not None:
            rate = min((t.size - 1) / float(t[-1] - t[0]) for t in (time_p, time_m))
            warnings += _rate_warnings(signal.name, float(likeness.frequency_hz[-1]), settings.to, rate)
    warnings += _aliasing_warnings(result, place, quantity)
    return ChannelComparison(
        place=place,
        quantity=quantity,
        unit=unit,
        channel=signal.description,
        source=signal.source,
        excitation_hz=excitation,
        delay_s=delay,
        order=predicted.order / multiple,
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
        aliased_share=_aliased_share(result, place, quantity),
        record=likeness,
    )


# correlations above which records agree, and below which they do not
LEAST_CORRELATION, LOW_CORRELATION = 0.9, 0.7
FEWEST_COMMON_SAMPLES = 20  # common samples, at least
NOTABLE_OFFSET = 0.05  # relative to the root mean square of a history about its mean


def _sign_and_offset_warnings(
    run: MeasuredSignal, record: MeasuredSignal, aligned_histories: tuple[Floats, Floats, Floats, Floats]
) -> Iterator[str]:
    """Warn if a record agrees with the run only with opposite sign, or only without its offset.

    Parameters
    ----------
    run, record : histories, in one unit.
    aligned_histories : times and values of the run, then of the record, without the delay between them.
    """
    predicted, measured, correlation = _common_times(*aligned_histories)
    size, offset = float(np.std(predicted)), float(measured.mean() - predicted.mean())
    if correlation > LEAST_CORRELATION and record.unit != ACCELERATION.unit and abs(offset) > NOTABLE_OFFSET * size:
        share = f"{100.0 * abs(offset) / size:.2g} % of the computed root mean square"
        yield (
            f"{record.name}: its mean differs from that of the run by {offset:+.4g} {record.unit}, {share}; an offset "
            "counts as a difference; subtract the reading of the channel at rest"
        )
    if correlation < LOW_CORRELATION:
        turned = replace(record, y=-record.y)
        other = _common_times(*_aligned_samples(run, turned, _lag(run, turned), np.nan))[2]
        if other > LEAST_CORRELATION:
            yield (
                f"{record.name}: with opposite sign the correlation is {other:.4f}, and {correlation:.4f} as it is "
                "written: give --factor -1 if its sensor counts in the other direction"
            )


def _common_times(
    time: Floats, predicted: Floats, measured_time: Floats, measured: Floats
) -> tuple[Floats, Floats, float]:
    """Values of a run and of a record at their common times, and their correlation (nan without common times)."""
    both = (time >= measured_time[0]) & (time <= measured_time[-1])
    if np.count_nonzero(both) < FEWEST_COMMON_SAMPLES or not np.ptp(predicted[both]) * np.ptp(measured) > 0.0:
        return predicted, predicted, np.nan
    one, other = predicted[both], np.interp(time[both], measured_time, measured)
    return one, other, float(np.corrcoef(one, other)[0, 1])


TIME_ROUND_OFF = 1e-9  # relative round-off of times, which may lengthen the last part of a record


def _rate_warnings(name: str, highest_hz: float, requested_hz: float, rate: float) -> Iterator[str]:
    """Warn if the sample rate, 1/s, limits response spectra below the requested frequency."""
    if highest_hz < requested_hz * (1 - TIME_ROUND_OFF):
        yield (
            f"{name}: response spectra end at {highest_hz:.4g} Hz, below run.srs.to = {requested_hz:g} Hz: the records "
            f"have {rate:.4g} samples a second, and oscillators above a tenth of that follow the interpolation between "
            "samples"
        )


def _aliasing_warnings(result: RunResult, place: str, quantity: str) -> Iterator[str]:
    """Warn if a history has notable content above half its sample rate."""
    share = _aliased_share(result, place, quantity)
    if share is not None:
        times = result["histories"]["time"].values
        rate = (times.size - 1) / float(times[-1] - times[0])
        yield (
            f"{place} {quantity_text(quantity)}: {100.0 * share:.2g} % of the run's root mean square lies above half "
            f"its output rate of {rate:.5g} Hz, and is aliased in its harmonics, spectrum and response spectra: raise "
            "run.sample_rate"
        )


def _aliased_share(result: RunResult, place: str, quantity: str) -> float | None:
    """Share of the root mean square of a history above half the output rate; None if it is negligible."""
    called = {"moment": "force", "absolute_displacement": "displacement"}.get(quantity, quantity)
    shares = result.summary.get("aliased_in_histories") or {}
    share = shares.get(f"{place} {called}")
    return None if share is None else float(share)


def _part_of_run(
    result: RunResult, place: str, quantity: str, excitation: float, warnings: list[str]
) -> MeasuredSignal:
    """Part of a computed history that is compared."""
    times, values = result["histories"]["time"].values, predicted_history(result, place, quantity)
    part = slice(max(times.size - 2**21, 0), times.size)
    time, x = times[part], np.asarray(values[part], dtype=float)
    name = f"{place} {quantity.replace('_', ' ')}"
    if part.start:
        warnings.append(f"{name}: only the last {time[-1] - time[0]:.4g} s of the run are compared ({x.size} samples)")
    steady = time >= _start(result, time, x, excitation, name, warnings)
    return MeasuredSignal(place, time[steady], x[steady])


SETTLED_DIFFERENCE = 0.01  # relative rms difference of the periods of a settled motion


def _start(result: RunResult, time: Floats, values: Floats, excitation: float, name: str, warnings: list[str]) -> float:
    """Start of the compared part of a run: from `run.spectrum`, else where the motion has settled."""
    settings = None if result.scenario.run is None else result.scenario.run.spectrum
    if settings is not None and (settings.last is not None or settings.periods is not None):
        duration = result["spectra"]["duration_s"].item() if "spectra" in result.datasets else np.inf
        share = min(duration / float(time[-1] - time[0]), 1.0)
        return float(time[-round(share * (time.size - 1))])  # whole periods: one of the two end points
    if not np.isfinite(excitation):
        return float(time[0])
    start, deviation = steady_part(time, values, 1.0 / excitation)
    if deviation > SETTLED_DIFFERENCE:
        warnings.append(
            f"{name}: the run does not settle (its last periods differ by {deviation:.2g} of the motion); the last "
            f"{time[-1] - start:.4g} s are compared: run longer, or choose the part by run.spectrum.last"
        )
    return start


def _harmonics(
    predicted: MeasuredSignal, measured: MeasuredSignal, motion: tuple[float, int], count: int, warnings: list[str]
) -> tuple[Harmonics, Harmonics]:
    """Harmonics of both signals, as many as both contain; empty without an excitation frequency.

    Parameters
    ----------
    predicted, measured : the signals.
    motion : excitation frequency, Hz, and excitation periods per period of the motion.
    count : number of harmonics of the excitation.
    warnings : list to which a warning about missing harmonics is added.
    """
    excitation, multiple = motion
    if not np.isfinite(excitation):
        none = Harmonics(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=complex), np.zeros(0), False)
        return none, none
    limits = [int(0.499 * (s.x.size - 1) / (s.x[-1] - s.x[0]) / excitation) for s in (predicted, measured)]
    if measured.is_over_frequency:
        limits[1] = int(measured.x[-1] / excitation)
    possible = max(1, min(count, *limits))
    if possible < count:
        warnings.append(f"{measured.name}: the records contain {possible} harmonics of {excitation:g} Hz, not {count}")
    fundamental, every = excitation / multiple, possible * multiple
    return harmonics_of(predicted, fundamental, every), harmonics_of(measured, fundamental, every)


def _spectrum(signal: MeasuredSignal, excitation: float) -> ComparedSpectrum:
    """Spectrum of a history with a Hann window; a measured spectrum is returned unchanged."""
    if signal.is_over_frequency:
        frequency, amplitude = signal.x, np.abs(signal.y)
        peak = float(amplitude.max())
    else:
        steps = np.diff(signal.x)
        mean = float(np.mean(steps))
        at = int(np.argmax(np.abs(steps - mean)))
        if abs(steps[at] - mean) > 1e-3 * mean:
            raise measurement_error(
                f"{signal.label} is not evenly sampled (the step after sample {at + 1} is {steps[at]:.6g} s, the mean "
                f"{mean:.6g} s)",
                "resample it, or export it without gaps",
            )
        (record,) = sampled_records(signal.x, np.asarray(signal.y, dtype=float)[None], excitation)
        amplitude, peak = np.abs(record.amplitudes(Window.of_name("hann"))), record.levels().peak
        frequency = np.arange(amplitude.size) / record.duration
    return ComparedSpectrum(frequency, amplitude, amplitude_db(amplitude, peak))


def _lag(predicted: MeasuredSignal, measured: MeasuredSignal) -> float:
    """Delay of maximum correlation, for motions without an excitation frequency."""
    from scipy import signal

    length = float(measured.x[-1] - measured.x[0])
    step = length / (measured.x.size - 1)
    grid = np.arange(int(min(float(predicted.x[-1] - predicted.x[0]), length) / step) + 1) * step
    a, b = (np.interp(s.x[0] + grid, s.x, np.asarray(s.y, dtype=float)) for s in (predicted, measured))
    correlation = signal.correlate(a - a.mean(), b - b.mean(), method="fft")
    lags, best = signal.correlation_lags(grid.size, grid.size), int(np.argmax(correlation))
    before, top, after = correlation[np.clip([best - 1, best, best + 1], 0, correlation.size - 1)]
    between = 0.5 * (before - after) / min(before - 2 * top + after, -TINY)  # in samples: vertex of a parabola
    return float(predicted.x[0] + (lags[best] + between) * step - measured.x[0])


def _aligned_samples(
    predicted: MeasuredSignal, measured: MeasuredSignal, delay: float, period: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """A few periods of both signals on the time axis of the prediction.

    Parameters
    ----------
    predicted, measured : the signals.
    delay : delay of the measurement, s.
    period : period of the motion, s; infinite without an excitation frequency: both are then returned completely.
    """
    x, y = predicted.x, np.asarray(predicted.y, dtype=float)
    none = np.zeros(0)
    moved, history = (
        (none, none) if measured.is_over_frequency else (measured.x + delay, np.asarray(measured.y, dtype=float))
    )
    if not np.isfinite(period):
        return x, y, moved, history
    shown = x >= x[-1] - _SHOWN_PERIODS * period
    x, y = x[shown], y[shown]
    if moved.size:
        behind = (x[-1] - moved[-1]) / period
        covers = moved[-1] - moved[0] >= (_SHOWN_PERIODS + 1) * period
        moved = moved + (np.ceil(behind - 1e-6) if covers else np.round(behind)) * period
    kept = (moved >= x[0]) & (moved <= x[-1])
    return x, y, moved[kept], history[kept]


def _rms(predicted_time: Floats, predicted: Floats, measured_time: Floats, measured: Floats) -> float:
    inside = (
        (measured_time >= predicted_time[0]) & (measured_time <= predicted_time[-1])
        if measured_time.size
        else np.zeros(0, dtype=bool)
    )
    if not inside.any():
        return float("nan")
    difference = np.interp(measured_time[inside], predicted_time, predicted) - measured[inside]
    size = float(np.sqrt(np.mean(measured[inside] ** 2)))
    return float(np.sqrt(np.mean(difference**2)) / size) if size > 0 else float("nan")


def _channel_summary(channel: ChannelComparison) -> dict[str, Any]:
    """Summary of one channel."""
    names = ("place", "quantity", "channel", "excitation_hz", "start_s", "delay_s", "rms_difference", "aliased_share")
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
        **({} if channel.record is None else {"record": channel.record.summary()}),
    }


Pair = tuple[str, str, MeasuredSignal]
"""Place and quantity of a result, and the measured signal for them."""


@dataclass(frozen=True, kw_only=True)
class ChannelChoice:
    """Selection of channels of a file, and information that the file lacks.

    Examples
    --------
    >>> import beamsim
    >>> choice = beamsim.ChannelChoice(place="third", channel="tip", quantity="absolute_acceleration")
    >>> result = beamsim.run("configs/stops/chain_bumpers.yaml")
    >>> [(place, quantity)] = [pair[:2] for pair in beamsim.pair_channels(
    ...     result, "configs/measurements/tip_65hz_2g.csv", choice)]
    >>> place, quantity
    ('third', 'absolute_acceleration')
    """

    place: str | None = None  #: probe, snubber or output; all if neither this nor `channel` is given
    quantity: str | None = None  #: all of `quantities_of` the place if neither this nor `channel` is given
    channel: str | None = None  #: name of the channel
    unit: str | None = None  #: unit of the values
    axis_unit: str | None = None  #: unit of time or frequency
    level: str | None = None  #: excitation level at which frequency responses were measured, with unit
    decimal: DecimalMark | None = None  #: for a text file with ambiguous numbers
    preparation: RecordPreparation | None = None  #: of time histories; unchanged by default


ALL_BY_NAME = ChannelChoice()
"""All channels that are named after places and quantities."""


def pair_channels(result: RunResult | SweepResult, path: Path | str, choice: ChannelChoice = ALL_BY_NAME) -> list[Pair]:
    """Measured channels of a file, assigned to places of a result by name, in SI units.

    A chosen `channel`, or the only one of a file, is compared with `quantity` (by default from its name or unit, else
    the absolute acceleration) at `place` (by default from its name, or the only place).

    Time histories and amplitude spectra can be compared; with a sweep also frequency responses, multiplied by the level
    at which they were measured. Channels of other function types are ignored if other channels are named after the
    places.

    Parameters
    ----------
    result : run or sweep.
    path : path of the file.
    choice : selection of channels, places and quantities; by default all pairs with matching names.

    Returns
    -------
    list of tuple
        Place, quantity and signal.

    Raises
    ------
    ScenarioError
        If the file cannot be used, no channel matches, or the matching one has an unsuitable function type.

    Examples
    --------
    >>> import beamsim
    >>> changes = {"run.convergence": "off", "run.duration": "0.3 s", "run.spectrum.last": "0.1 s"}
    >>> result = beamsim.run(beamsim.load_scenario("configs/one_sided_65hz.yaml", changes))
    >>> pairs = beamsim.pair_channels(result, "configs/measurements/tip_65hz_2g.csv")
    >>> [(place, quantity, signal.unit) for place, quantity, signal in pairs]
    [('tip', 'absolute_acceleration', 'm/s^2')]
    """
    demand_result(result)
    path = Path(path)
    signals, unit = read_signals(path, choice.axis_unit, choice.decimal), choice.unit
    found, swept = quantities_of(result), isinstance(result, SweepResult)
    if choice.place is not None and choice.place not in found:
        raise ScenarioError.at("", f"--probe {choice.place} is not in the result", f"it has {', '.join(found)}")
    if choice.channel is not None or len(signals) == 1:
        named, quantity = choice.channel or signals[0].name, choice.quantity or "absolute_acceleration"
        signal = channel_named(signals, named, quantity, path, required=choice.channel is not None)
        signal = _amplitudes(signal, swept, path, choice.level)
        at, compared = _owner(signal, found, path, choice)
        return [(at, compared, _prepare(in_si(signal, unit, found[at][compared], "--unit"), path, choice.preparation))]
    usable = [each for each in signals if each.function in _functions(swept)]
    pairs = _by_name(usable or signals, found, path, choice)
    pairs = [(name, q, _amplitudes(each, swept, path, choice.level)) for name, q, each in pairs]
    try:
        in_units = [(name, q, in_si(signal, unit, found[name][q], "--unit")) for name, q, signal in pairs]
        return [(name, q, _prepare(signal, path, choice.preparation)) for name, q, signal in in_units]
    except ScenarioError as error:
        several = list(dict.fromkeys(q for _, q, _ in pairs))
        if unit is None or len(several) == 1:
            raise
        problem = error.problems[0]
        remedy = f"the file has {', '.join(several)}: choose one with --quantity, for example --quantity {several[0]}"
        raise ScenarioError.at(problem.path, problem.message, remedy) from None


def _functions(for_sweep: bool) -> tuple[FunctionType, ...]:
    """Function types that can be compared with a sweep, or with a run."""
    return (FunctionType.TIME_HISTORY, FunctionType.SPECTRUM, *(RATIOS if for_sweep else ()))


def _amplitudes(signal: MeasuredSignal, for_sweep: bool, path: Path, level: str | None) -> MeasuredSignal:
    """Time history, or amplitudes; for a frequency response, those at a level.

    Raises
    ------
    ScenarioError
        If it is none of these, or has no level.
    """
    purpose = f"a comparison with a {'sweep' if for_sweep else 'run'}"
    try:
        return signal.require(_functions(for_sweep), purpose).at_level(level, "--level")
    except InputFileError as fault:
        raise measurement_error(f"{path} {fault.message}", fault.remedy) from None


def _prepare(signal: MeasuredSignal, path: Path, preparation: RecordPreparation | None) -> MeasuredSignal:
    """Prepare a measured signal for the comparison."""
    if preparation is None:
        return signal
    try:
        return condition(signal, preparation)
    except InputFileError as fault:
        raise measurement_error(f"{path}: {signal.name} {fault.message}", fault.remedy) from None


_Quantities = Mapping[str, Mapping[str, Dimension]]  # by place and name


def _owner(signal: MeasuredSignal, quantities: _Quantities, path: Path, choice: ChannelChoice) -> tuple[str, str]:
    """Place and quantity of the only channel that is compared.

    Parameters
    ----------
    signal : the channel.
    quantities : quantities of the result.
    path, choice : see `pair_channels`.

    Raises
    ------
    ScenarioError
        If the result has no such quantity, or not at that place.
    """
    known, place, unit = _dimensions(quantities), choice.place, choice.unit
    meant = known if place is None else {**quantities[place], **known}
    compared = choice.quantity or _quantity_of(signal.name, signal.unit or unit or "", meant)
    if compared not in known:
        message = f"--quantity {compared} is not one of {', '.join(known)}"
        raise ScenarioError.at("", message, "choose one of these")
    owners = [name for name, of_place in quantities.items() if compared in of_place]
    at = place or _place_of(signal, owners, path)
    if at not in owners:
        raise ScenarioError.at("", f"--probe {at} has no {compared}", f"choose from {', '.join(owners)}")
    return at, compared


def _by_name(signals: list[MeasuredSignal], quantities: _Quantities, path: Path, choice: ChannelChoice) -> list[Pair]:
    """Places, quantities and the channels named after them, in the units of the file.

    Parameters
    ----------
    signals : signals of the file.
    quantities : quantities of the result.
    path, choice : see `pair_channels`.

    Raises
    ------
    ScenarioError
        If no channel is named after them.
    """
    place, quantity, unit = choice.place, choice.quantity, choice.unit
    pairs: list[Pair] = []
    for name in quantities if place is None else [place]:
        for q in quantities[name] if quantity is None else quantities[name].keys() & {quantity}:
            # the channel of an output need not name its quantity
            own = q in (*PROBE_QUANTITIES, *dict(CONTACT_QUANTITIES.values()))
            called = "force" if q == "moment" and all("moment" not in s.name for s in signals) else q  # as in results
            try:
                signal = channel_named(signals, name, called, path, required=own)
            except ScenarioError:
                continue
            if not (own or signal.unit or unit or place):
                continue
            place_alone = quantity is None and split_heading(signal.name)[0] == name  # its unit defines the quantity
            meant = {**quantities[name], **_dimensions(quantities)}
            if not place_alone or _quantity_of(signal.name, signal.unit or unit or "", meant) == q:
                pairs.append((name, q, signal))
    if not pairs:
        names = ", ".join(s.name for s in signals[:12])
        raise ScenarioError.at(
            "",
            f"{path} has no channel named after a probe ({', '.join(quantities)}) and a quantity",
            f"specify them: --channel NAME --probe NAME --quantity absolute_acceleration; it has {names}",
        )
    return pairs


def _dimensions(quantities: _Quantities) -> dict[str, Dimension]:
    """Dimensions of all quantities of a result, by name."""
    return {q: dimension for of_place in quantities.values() for q, dimension in of_place.items()}


def _quantity_of(channel: str, unit: str, dimensions: Mapping[str, Dimension]) -> str:
    """Quantity that a channel's name or unit indicates, among known ones; else the first."""
    words = channel.lower().replace("_", " ")
    longest_first = sorted(dimensions, key=len, reverse=True)
    by_name = next((q for q in longest_first if quantity_text(q) in words), "")
    for q, dimension in () if by_name or not unit else dimensions.items():
        try:
            in_si(MeasuredSignal(channel, np.zeros(0), np.zeros(0)), unit, dimension, "")
        except ScenarioError:
            continue
        return q
    return by_name or next(iter(dimensions))


def _place_of(signal: MeasuredSignal, places: list[str], path: Path) -> str:
    """Probe or snubber that a channel is named after, or the only one.

    Raises
    ------
    ScenarioError
        If there are several and the channel's name contains none or more than one of them.
    """
    named = [name for name in places if contains_word(signal.name, name)]
    if len(named) == 1 or (not named and len(places) == 1):
        return (named or places)[0]
    what = f"is named after {' and '.join(named)}" if named else "is named after none of the probes"
    remedy = f"give the place of measurement: --probe {places[0]} (there are {', '.join(places)})"
    raise ScenarioError.at("", f"{path}: the channel {signal.name} {what}", remedy)


def quantities_of(result: RunResult | SweepResult) -> dict[str, dict[str, Dimension]]:
    """Comparable quantities with their dimensions by place of a result: probes, then snubbers, then outputs."""
    if isinstance(result, RunResult):
        histories = result["histories"]
        probes = histories.labels("probe")
        contacts = {name: force.unit for name, force in histories.by_label("snubber_force").items()}
        outputs = {
            name: (of.item(), histories["output_value"].sel(output=name).unit)
            for name, of in histories.by_label("output_quantity").items()
        }
    else:
        cycles = result["cycles"]
        probes = cycles.labels("probe")
        quantities, units = (cycles.by_label(f"output_{column}") for column in ("quantity", "unit"))
        outputs = {name: (quantities[name].item(), units[name].item()) for name in quantities}
        contacts = {name: force.unit for name, force in cycles.by_label("peak_force").items()}
    of_probe = {q: motion_dimension(q) for q in PROBE_QUANTITIES}
    found = {name: dict(of_probe) for name in probes}
    for name, unit in contacts.items():
        found.setdefault(name, {}).update([CONTACT_QUANTITIES[unit]])
    for name, (quantity, unit) in outputs.items():
        dimension = Dimension(quantity_text(quantity), unit, f"1 {unit}", gravity=unit == "m/s^2")
        found.setdefault(name, {}).setdefault(quantity, dimension)
    return found


JACKKNIFE_PARTS = 10  # of a record, each left out once for the standard error of the scale
MOST_PANELS = 100_000  # per oscillator, some seconds: spectra of longer records end at a lower frequency


def compare_records(
    predicted: tuple[Floats, Floats], measured: tuple[Floats, Floats], settings: ShockSpectrumSettings | None
) -> RecordComparison | None:
    """Measures of agreement of two aligned records over their common time.

    Parameters
    ----------
    predicted, measured : times (nt,), s, and values.
    settings : range and quality of the oscillators; by default Q = 10 and six per octave, up to the records'
        resolution.

    Returns
    -------
    RecordComparison
        None if they have fewer common samples than twice the number of parts, or one of them is zero there.
    """
    begin, end = max(predicted[0][0], measured[0][0]), min(predicted[0][-1], measured[0][-1])
    inside = (measured[0] >= begin) & (measured[0] <= end)
    if np.count_nonzero(inside) < 2 * JACKKNIFE_PARTS:
        return None
    time, y = measured[0][inside], measured[1][inside]
    begin, end = float(time[0]), float(time[-1])
    both = CubicSpline(*predicted), CubicSpline(*measured)
    own = predicted[1][(predicted[0] >= begin) & (predicted[0] <= end)]
    x = both[0](time)
    if not (np.any(own) and np.any(y)):
        return None
    first = np.linspace(0, time.size, JACKKNIFE_PARTS, endpoint=False).astype(int)
    across, power, of_measured = (np.add.reduceat(product, first) for product in (x * y, x * x, y * y))
    without = (power.sum() - power) / (across.sum() - across)
    slowest = max(float(np.diff(t).max()) for t, _ in (predicted, measured))
    highest = min(1 / (SAMPLES_OF_OSCILLATOR * slowest), MOST_PANELS / (PANELS_OF_OSCILLATOR * (end - begin)))
    lowest, quality, per_octave = 2.0 / (end - begin), 10.0, 6
    if settings is not None:
        lowest, quality, per_octave = settings.from_, settings.quality, settings.per_octave
        highest = min(highest, settings.to)
    frequency = geomspaced(min(lowest, 0.5 * highest), highest, per_octave)
    ends, values = np.array([begin, end]), lambda at: np.column_stack([spline(at) for spline in both])
    spectra = shock_spectra(frequency, quality, ends, values, 0.0).max(axis=1)
    scale, scatter = (
        power.sum() / across.sum(),
        np.sqrt((JACKKNIFE_PARTS - 1) * np.mean((without - without.mean()) ** 2)),
    )
    correlation = across.sum() / np.sqrt(power.sum() * of_measured.sum())
    return RecordComparison(
        float(np.abs(own).max()), float(np.abs(y).max()), float(scale), float(scatter), float(correlation),
        quality, frequency, spectra[0], spectra[1],
    )  # fmt: skip
