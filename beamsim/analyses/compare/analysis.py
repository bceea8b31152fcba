"""``beamsim compare``: a computed and a measured motion, aligned in phase and compared harmonic by harmonic.

The channels of a measurement are assigned to probes and snubbers by their names. Records that do not repeat are
compared by peaks, scale, correlation and response spectra.
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

OF_PROBES = ("absolute_acceleration", "displacement", "absolute_displacement", "velocity")
OF_CONTACTS = {"N": ("force", FORCE), "N m": ("moment", MOMENT)}  # by unit: of snubbers, of stops of hinges
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
    result : the run.
    pairs : place, quantity, and measured signal in SI units.
    harmonics : number of harmonics in the table.
    last : use only this last part of measured histories, s; by default as long as the part of the run that is used:
        that of ``run.spectrum``, else the part in which its motion has settled.

    Returns
    -------
    Comparison
        With a `ChannelComparison` for each pair.

    Raises
    ------
    ScenarioError
        If a measured record is too short, unevenly sampled or sampled too slowly, or neither a time history nor an
        amplitude spectrum.
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
    """Warnings about a measured signal; for an acceleration also about an offset, which a run does not have."""
    if signal.is_over_frequency or signal.unit != ACCELERATION.unit:
        return list(signal.warnings)
    return [*signal.warnings, *offset_warnings(signal, starts=False)]


def predicted_history(result: RunResult, place: str, quantity: str) -> Floats:
    """A history that was computed.

    Parameters
    ----------
    result : the run.
    place : a probe or output; for a force or moment a snubber.
    quantity : one of `quantities_of` the place.

    Returns
    -------
    (nt,) array
        SI units.
    """
    histories = result["histories"]
    if place in histories.labels("probe") and quantity in OF_PROBES:
        return histories[quantity].sel(probe=place).values
    if place in histories.labels("snubber") and quantity in dict(OF_CONTACTS.values()):
        return histories["snubber_force"].sel(snubber=place).values
    return histories["output_value"].sel(output=place).values


def _channel(result: RunResult, pair: Pair, count: int, last: float | None, warnings: list[str]) -> ChannelComparison:
    """A channel compared with the history of a run: harmonics in phase, histories without a delay, spectra."""
    place, quantity, signal = pair
    excitation = result.scenario.excitation.tone_hz
    unit = quantities_of(result)[place][quantity].unit
    run = _part_of_run(result, place, quantity, excitation, warnings)
    if last is None and np.isfinite(excitation):
        last = float(run.x[-1] - run.x[0]) * (1 + WHOLE_PART)
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
        warnings += _of_sign_and_zero(run, record, (time_p, history_p, time_m, history_m))
        if likeness is not None and settings is not None:
            rate = min((t.size - 1) / float(t[-1] - t[0]) for t in (time_p, time_m))
            warnings += _of_rate(signal.name, float(likeness.frequency_hz[-1]), settings.to, rate)
    warnings += _of_aliasing(result, place, quantity)
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


ALIKE, UNLIKE = 0.9, 0.7  # correlation from which a record is the other one but for sign or zero, and below which not
FEWEST_OF_BOTH = 20  # samples that both have
NOTABLE_OFFSET = 0.05  # of the root mean square of a history about its mean


def _of_sign_and_zero(
    run: MeasuredSignal, record: MeasuredSignal, aligned: tuple[Floats, Floats, Floats, Floats]
) -> Iterator[str]:
    """Warnings where a record is that of the run but for its sign, or but for what it reads at rest.

    Parameters
    ----------
    run, record : the histories, in one unit.
    aligned : times and values of the run, then of the record, shifted by the delay between them.
    """
    predicted, measured, correlation = _where_both_last(*aligned)
    size, offset = float(np.std(predicted)), float(measured.mean() - predicted.mean())
    if correlation > ALIKE and record.unit != ACCELERATION.unit and abs(offset) > NOTABLE_OFFSET * size:
        share = f"{100.0 * abs(offset) / size:.2g} % of the computed root mean square"
        yield (
            f"{record.name}: its mean is {offset:+.4g} {record.unit} from that of the run, {share}: an offset counts "
            "as a difference; subtract what the channel reads at rest"
        )
    if correlation < UNLIKE:
        turned = replace(record, y=-record.y)
        other = _where_both_last(*_aligned_samples(run, turned, _lag(run, turned), np.nan))[2]
        if other > ALIKE:
            yield (
                f"{record.name}: with the other sign the correlation is {other:.4f}, and {correlation:.4f} as it is "
                "written: give --factor -1 if its sensor counts in the other direction"
            )


def _where_both_last(
    time: Floats, predicted: Floats, of_record: Floats, measured: Floats
) -> tuple[Floats, Floats, float]:
    """Values of a run and of a record at the times of the run that both have, and their correlation, nan of none."""
    both = (time >= of_record[0]) & (time <= of_record[-1])
    if np.count_nonzero(both) < FEWEST_OF_BOTH or not np.ptp(predicted[both]) * np.ptp(measured) > 0.0:
        return predicted, predicted, np.nan
    one, other = predicted[both], np.interp(time[both], of_record, measured)
    return one, other, float(np.corrcoef(one, other)[0, 1])


WHOLE_PART = 1e-9  # relative round-off of times, by which the last part of a record may be longer


def _of_rate(name: str, reached_hz: float, asked_hz: float, rate: float) -> Iterator[str]:
    """A warning where the sample rate, 1/s, ends response spectra below the frequency that is asked for."""
    if reached_hz < asked_hz * (1 - WHOLE_PART):
        yield (
            f"{name}: response spectra end at {reached_hz:.4g} Hz, below run.srs.to = {asked_hz:g} Hz: the records "
            f"have {rate:.4g} samples a second, and oscillators above a tenth of that follow the interpolation between "
            "samples"
        )


def _of_aliasing(result: RunResult, place: str, quantity: str) -> Iterator[str]:
    """A warning where a history has a notable part above half its sample rate."""
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
    """Share of the root mean square of a history above half the output rate; None where it is not notable."""
    called = {"moment": "force", "absolute_displacement": "displacement"}.get(quantity, quantity)
    shares = result.summary.get("aliased_in_histories") or {}
    share = shares.get(f"{place} {called}")
    return None if share is None else float(share)


def _part_of_run(
    result: RunResult, place: str, quantity: str, excitation: float, warnings: list[str]
) -> MeasuredSignal:
    """The part of a computed history that is compared."""
    times, values = result["histories"]["time"].values, predicted_history(result, place, quantity)
    part = slice(max(times.size - 2**21, 0), times.size)
    time, x = times[part], np.asarray(values[part], dtype=float)
    name = f"{place} {quantity.replace('_', ' ')}"
    if part.start:
        warnings.append(f"{name}: only the last {time[-1] - time[0]:.4g} s of the run are compared ({x.size} samples)")
    steady = time >= _start(result, time, x, excitation, name, warnings)
    return MeasuredSignal(place, time[steady], x[steady])


SETTLED = 0.01  # relative difference of periods of a settled motion, rms


def _start(result: RunResult, time: Floats, x: Floats, excitation: float, name: str, warnings: list[str]) -> float:
    """Start of the part of a run that is compared: as `run.spectrum` says, else where its motion has settled."""
    settings = None if result.scenario.run is None else result.scenario.run.spectrum
    if settings is not None and (settings.last is not None or settings.periods is not None):
        duration = result["spectra"]["duration_s"].item() if "spectra" in result.datasets else np.inf
        share = min(duration / float(time[-1] - time[0]), 1.0)
        return float(time[-round(share * (time.size - 1))])  # whole periods: one end of the two
    if not np.isfinite(excitation):
        return float(time[0])
    start, deviation = steady_part(time, x, 1.0 / excitation)
    if deviation > SETTLED:
        warnings.append(
            f"{name}: the run does not settle (its last periods differ by {deviation:.2g} of the motion); the last "
            f"{time[-1] - start:.4g} s are compared: run longer, or choose the part by run.spectrum.last"
        )
    return start


def _harmonics(
    predicted: MeasuredSignal, measured: MeasuredSignal, motion: tuple[float, int], count: int, warnings: list[str]
) -> tuple[Harmonics, Harmonics]:
    """Harmonics of both signals, as many as both contain; none without an excitation frequency.

    Parameters
    ----------
    predicted, measured : the signals.
    motion : frequency of the excitation, Hz, and how many of its periods one of the motion has.
    count : number of harmonics of the excitation.
    warnings : that there are fewer is added to.
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
    """Spectrum of a history under a Hann window; a measured spectrum stays as it is."""
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
    """Delay of maximum correlation, for motions without excitation frequency."""
    from scipy import signal

    length = float(measured.x[-1] - measured.x[0])
    step = length / (measured.x.size - 1)
    grid = np.arange(int(min(float(predicted.x[-1] - predicted.x[0]), length) / step) + 1) * step
    a, b = (np.interp(s.x[0] + grid, s.x, np.asarray(s.y, dtype=float)) for s in (predicted, measured))
    correlation = signal.correlate(a - a.mean(), b - b.mean(), method="fft")
    lags, best = signal.correlation_lags(grid.size, grid.size), int(np.argmax(correlation))
    before, top, after = correlation[np.clip([best - 1, best, best + 1], 0, correlation.size - 1)]
    between = 0.5 * (before - after) / min(before - 2 * top + after, -TINY)  # of samples: the top of a parabola
    return float(predicted.x[0] + (lags[best] + between) * step - measured.x[0])


def _aligned_samples(
    predicted: MeasuredSignal, measured: MeasuredSignal, delay: float, period: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """A few periods of both in the time of the prediction.

    Parameters
    ----------
    predicted, measured : both.
    delay : s, of the measurement.
    period : s, of the motion; not finite without an excitation frequency, where both are returned whole.
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


def _rms(time_p: Floats, history_p: Floats, time_m: Floats, history_m: Floats) -> float:
    inside = (time_m >= time_p[0]) & (time_m <= time_p[-1]) if time_m.size else np.zeros(0, dtype=bool)
    if not inside.any():
        return float("nan")
    difference = np.interp(time_m[inside], time_p, history_p) - history_m[inside]
    size = float(np.sqrt(np.mean(history_m[inside] ** 2)))
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
"""Place and quantity of a result, and the measured signal that is compared with it."""


@dataclass(frozen=True, kw_only=True)
class ChannelChoice:
    """Which channels of a file are compared with what, and what the file does not say of them."""

    place: str | None = None  # probe, snubber or output; without it and `channel` those of all are paired
    quantity: str | None = None  # without it and `channel` all of `quantities_of` the place are paired
    channel: str | None = None  # its name
    unit: str | None = None  # of the values
    axis_unit: str | None = None  # of the time or frequency
    level: str | None = None  # with its unit, of the excitation at which frequency responses were measured
    decimal: DecimalMark | None = None  # of a text file, where its numbers leave it open
    preparation: RecordPreparation | None = None  # of time histories; by default they are taken as they are


BY_NAME = ChannelChoice()
"""All channels that are named after places and quantities."""


def pair_channels(result: RunResult | SweepResult, path: Path | str, choice: ChannelChoice = BY_NAME) -> list[Pair]:
    """The measured channels of a file that belong to places of a result by name, in SI units.

    With a chosen `channel`, or in a file with one, that one is compared with `quantity` (by default what its name or
    unit says, else the absolute acceleration) at `place` (by default the one it is named after, or the only one).

    Time histories and amplitude spectra can be compared; with a sweep frequency responses, too, times the level at
    which they were measured. Channels of other function types are left out where others are named after the places.

    Parameters
    ----------
    result : a run or a sweep.
    path : of the file.
    choice : of channels, places and quantities; by default all that are named after each other.

    Returns
    -------
    list of tuple
        Place, quantity and signal.

    Raises
    ------
    ScenarioError
        If the file cannot be used, no channel matches, or the one that does is of a function type that cannot be used.
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


def _functions(of_sweep: bool) -> tuple[FunctionType, ...]:
    """Function types that are compared with a sweep, and with a run."""
    return (FunctionType.TIME_HISTORY, FunctionType.SPECTRUM, *(RATIOS if of_sweep else ()))


def _amplitudes(signal: MeasuredSignal, of_sweep: bool, path: Path, level: str | None) -> MeasuredSignal:
    """A time history or amplitudes: those of a frequency response at a level.

    Raises
    ------
    ScenarioError
        If it is none of them, or has no level.
    """
    purpose = f"a comparison with a {'sweep' if of_sweep else 'run'}"
    try:
        return signal.require(_functions(of_sweep), purpose).at_level(level, "--level")
    except InputFileError as fault:
        raise measurement_error(f"{path} {fault.message}", fault.remedy) from None


def _prepare(signal: MeasuredSignal, path: Path, preparation: RecordPreparation | None) -> MeasuredSignal:
    """A measured signal as it is compared."""
    if preparation is None:
        return signal
    try:
        return condition(signal, preparation)
    except InputFileError as fault:
        raise measurement_error(f"{path}: {signal.name} {fault.message}", fault.remedy) from None


_Quantities = Mapping[str, Mapping[str, Dimension]]  # by place and name


def _owner(signal: MeasuredSignal, found: _Quantities, path: Path, choice: ChannelChoice) -> tuple[str, str]:
    """Place and quantity of the one channel that is compared.

    Parameters
    ----------
    signal : the channel.
    found : what the result has.
    path, choice : see `pair_channels`.

    Raises
    ------
    ScenarioError
        If the result has no such quantity, or not there.
    """
    known, place, unit = _dimensions(found), choice.place, choice.unit
    meant = known if place is None else {**found[place], **known}
    compared = choice.quantity or _quantity_of(signal.name, signal.unit or unit or "", meant)
    if compared not in known:
        message = f"--quantity {compared} is not one of {', '.join(known)}"
        raise ScenarioError.at("", message, "choose one of these")
    owners = [name for name, of_place in found.items() if compared in of_place]
    at = place or _place_of(signal, owners, path)
    if at not in owners:
        raise ScenarioError.at("", f"--probe {at} has no {compared}", f"choose from {', '.join(owners)}")
    return at, compared


def _by_name(signals: list[MeasuredSignal], found: _Quantities, path: Path, choice: ChannelChoice) -> list[Pair]:
    """Places, quantities and the channels that are named after them, in the units of the file.

    Parameters
    ----------
    signals : of the file.
    found : what the result has.
    path, choice : see `pair_channels`.

    Raises
    ------
    ScenarioError
        If no channel is.
    """
    place, quantity, unit = choice.place, choice.quantity, choice.unit
    pairs: list[Pair] = []
    for name in found if place is None else [place]:
        for q in found[name] if quantity is None else found[name].keys() & {quantity}:
            own = q in (*OF_PROBES, *dict(OF_CONTACTS.values()))  # the channel of an output need not say what it is
            called = "force" if q == "moment" and all("moment" not in s.name for s in signals) else q  # as in results
            try:
                signal = channel_named(signals, name, called, path, required=own)
            except ScenarioError:
                continue
            if not (own or signal.unit or unit or place):
                continue
            place_alone = quantity is None and split_heading(signal.name)[0] == name  # its unit says what it is
            meant = {**found[name], **_dimensions(found)}
            if not place_alone or _quantity_of(signal.name, signal.unit or unit or "", meant) == q:
                pairs.append((name, q, signal))
    if not pairs:
        names = ", ".join(s.name for s in signals[:12])
        raise ScenarioError.at(
            "",
            f"{path} has no channel named after a probe ({', '.join(found)}) and a quantity",
            f"specify them: --channel NAME --probe NAME --quantity absolute_acceleration; it has {names}",
        )
    return pairs


def _dimensions(found: _Quantities) -> dict[str, Dimension]:
    """Dimensions of all quantities of a result, by name."""
    return {q: dimension for of_place in found.values() for q, dimension in of_place.items()}


def _quantity_of(channel: str, unit: str, known: Mapping[str, Dimension]) -> str:
    """The quantity, of those known with their dimensions, that a channel's name or unit says; else the first."""
    words = channel.lower().replace("_", " ")
    longest_first = sorted(known, key=len, reverse=True)
    by_name = next((q for q in longest_first if quantity_text(q) in words), "")
    for q, dimension in () if by_name or not unit else known.items():
        try:
            in_si(MeasuredSignal(channel, np.zeros(0), np.zeros(0)), unit, dimension, "")
        except ScenarioError:
            continue
        return q
    return by_name or next(iter(known))


def _place_of(signal: MeasuredSignal, places: list[str], path: Path) -> str:
    """The probe or snubber that a channel is named after, or the only one.

    Raises
    ------
    ScenarioError
        If there are several and the channel's name says none or more than one of them.
    """
    named = [name for name in places if contains_word(signal.name, name)]
    if len(named) == 1 or (not named and len(places) == 1):
        return (named or places)[0]
    what = f"is named after {' and '.join(named)}" if named else "is named after none of the probes"
    remedy = f"say where it was measured: --probe {places[0]} (there are {', '.join(places)})"
    raise ScenarioError.at("", f"{path}: the channel {signal.name} {what}", remedy)


def quantities_of(result: RunResult | SweepResult) -> dict[str, dict[str, Dimension]]:
    """By place of a result what can be compared there, with its dimension: probes, then snubbers, then outputs."""
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
    of_probe = {q: motion_dimension(q) for q in OF_PROBES}
    found = {name: dict(of_probe) for name in probes}
    for name, unit in contacts.items():
        found.setdefault(name, {}).update([OF_CONTACTS[unit]])
    for name, (quantity, unit) in outputs.items():
        dimension = Dimension(quantity_text(quantity), unit, f"1 {unit}", gravity=unit == "m/s^2")
        found.setdefault(name, {}).setdefault(quantity, dimension)
    return found


PARTS = 10  # of a record, left out one by one for the standard error of the scale
MOST_PANELS = 100_000  # of an oscillator, which takes seconds: longer records have spectra up to a lower frequency


def compare_records(
    predicted: tuple[Floats, Floats], measured: tuple[Floats, Floats], settings: ShockSpectrumSettings | None
) -> RecordComparison | None:
    """Measures of likeness of two aligned records while both last.

    Parameters
    ----------
    predicted, measured : times (nt,), s, and values.
    settings : range and quality of the oscillators; by default Q = 10 and six an octave over what the records resolve.

    Returns
    -------
    RecordComparison
        None where they overlap in less than twice as many samples as there are parts, or one is zero there.
    """
    begin, end = max(predicted[0][0], measured[0][0]), min(predicted[0][-1], measured[0][-1])
    inside = (measured[0] >= begin) & (measured[0] <= end)
    if np.count_nonzero(inside) < 2 * PARTS:
        return None
    time, y = measured[0][inside], measured[1][inside]
    begin, end = float(time[0]), float(time[-1])
    both = CubicSpline(*predicted), CubicSpline(*measured)
    own = predicted[1][(predicted[0] >= begin) & (predicted[0] <= end)]
    x = both[0](time)
    if not (np.any(own) and np.any(y)):
        return None
    first = np.linspace(0, time.size, PARTS, endpoint=False).astype(int)
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
    scale, scatter = power.sum() / across.sum(), np.sqrt((PARTS - 1) * np.mean((without - without.mean()) ** 2))
    correlation = across.sum() / np.sqrt(power.sum() * of_measured.sum())
    return RecordComparison(
        float(np.abs(own).max()), float(np.abs(y).max()), float(scale), float(scatter), float(correlation),
        quality, frequency, spectra[0], spectra[1],
    )  # fmt: skip
