"""Test data as responses over frequency: sine sweeps by the fundamental of each cycle, random tests by densities.

Powers become amplitudes by their square roots, so that a change has the same size in all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from beamsim.analyses.compare.sweeps import (
    ReferenceRecord,
    StatedCycles,
    check_start,
    find_start,
    frequency_error,
    moving_mean,
    track,
)
from beamsim.errors import InputFileError, ScenarioError
from beamsim.measurements.channels import channel_named, measurement_error, read_signals
from beamsim.measurements.conditioning import condition
from beamsim.measurements.functions import RATIOS, FunctionType, si_unit
from beamsim.measurements.signal import MeasuredSignal, split_heading
from beamsim.scenario import Scenario
from beamsim.scenario.before_after import BeforeAfter, ChannelPair, RecordedSweep, TestRecord
from beamsim.typing import TINY, Floats, not_none

POWERS = (FunctionType.POWER_DENSITY, FunctionType.AUTO_SPECTRUM)
USABLE = (
    FunctionType.TIME_HISTORY, FunctionType.SPECTRUM, *RATIOS, *POWERS, FunctionType.AMPLITUDE_DENSITY,
)  # fmt: skip
FEWEST_FREQUENCIES = 16  # of a response
FEWEST_AVERAGES = 8  # segments of a spectral density
OVERLAP = 0.947  # independent averages per segment with a Hann window and half overlap


@dataclass(frozen=True)
class TestResponse:
    """A response over frequency, and what limits its resolution."""

    __test__ = False  # keep pytest from collecting this class

    channel: str
    frequency_hz: Floats  # (nf,) increasing
    amplitude: Floats  # (nf,)
    unit: str
    source: str
    step_hz: Floats  # (nf,) range of frequencies of each value
    noise: Floats | None  # (nf,) relative standard deviation, where it is known
    sweep: RecordedSweep | None
    clock_error: float = 0.0  # relative error of all frequencies, since the beginning of the sweep was found
    may_be_swept: bool = False  # whether it may come from a sine sweep that is not described
    warnings: tuple[str, ...] = ()

    def extract(self, lowest_hz: float, highest_hz: float) -> TestResponse:
        """The part between two frequencies."""
        some = (self.frequency_hz >= lowest_hz) & (self.frequency_hz <= highest_hz)
        noise = None if self.noise is None else self.noise[some]
        return replace(
            self, frequency_hz=self.frequency_hz[some], amplitude=self.amplitude[some], step_hz=self.step_hz[some],
            noise=noise,
        )  # fmt: skip


# --- Channels --------------------------------------------------------------------------------------------------------


def common_responses(scenario: Scenario, section: BeforeAfter) -> Iterator[tuple[TestResponse, TestResponse]]:
    """Responses of all channels that are compared, before and after, over their common frequencies."""
    files, records = [], (section.before, section.after)
    for side, record in zip(("before", "after"), records, strict=True):
        path = scenario.folder_of("before_after", side, "file") / record.file
        with _at(f"before_after.{side}.file"):
            files.append((path, read_signals(path, record.axis_unit, record.decimal)))
    for channel in section.channels or _common_channels(files, records):
        both = []
        for (path, signals), record, side in zip(files, records, ("before", "after"), strict=True):
            name = getattr(channel, side) or channel.before
            signal = channel_named(signals, name, "", path, required=True, key="before_after.channels")
            with _at(f"before_after.{side}"):
                both.append(response_of(signal, record, signals, path))
        if both[0].unit != both[1].unit:
            message = (
                f"{channel.before} is in {both[0].unit or 'no unit'} before, and in {both[1].unit or 'no unit'} after"
            )
            raise ScenarioError.at("before_after", message, "give unit of the file with the wrong or missing one")
        lowest, highest = (edge(each.frequency_hz[k] for each in both) for edge, k in ((max, 0), (min, -1)))
        if section.within is not None:
            lowest, highest = max(lowest, section.within.from_), min(highest, section.within.to)
        first, second = (each.extract(lowest, highest) for each in both)
        for each, side in ((first, "before"), (second, "after")):
            if each.frequency_hz.size < FEWEST_FREQUENCIES:
                message = f"{each.channel} has {each.frequency_hz.size} frequencies {side} that both tests contain"
                remedy = f"at least {FEWEST_FREQUENCIES} are needed: compare tests of the same range"
                raise ScenarioError.at("before_after", message, remedy)
        yield first, second


@contextmanager
def _at(path: str) -> Iterator[None]:
    """Locate problems of a file at a key of the scenario."""
    try:
        yield
    except InputFileError as error:
        raise ScenarioError.at(path, error.message, error.remedy) from None
    except ScenarioError as error:
        raise ScenarioError([replace(each, path=each.path or path) for each in error.problems]) from None


def _common_channels(
    files: Sequence[tuple[Path, list[MeasuredSignal]]], records: Sequence[TestRecord]
) -> Sequence[ChannelPair]:
    """Channels with the same name in both files, or the only ones."""
    named = []
    for (_, signals), record in zip(files, records, strict=True):
        usable = [each for each in signals if each.function in USABLE and each.unit.lower() != "db"]
        histories = [each for each in usable if not each.is_over_frequency]
        of_histories = record.line_spacing is not None or record.reference is not None
        usable = (histories if of_histories else [each for each in usable if each.is_over_frequency]) or usable
        of = {plain_name(each.name): each.name for each in usable if not _is_named(each, record.reference)}
        named.append(of)
    before, after = named
    common = [ChannelPair(before=before[name], after=after[name]) for name in before if name in after]
    if not common and len(before) == len(after) == 1:
        common = [ChannelPair(before=next(iter(before.values())), after=next(iter(after.values())))]
    if not common:
        listed = [", ".join(list(of.values())[:12]) or "none that can be used" for of in named]
        message = f"has no channel with one name in both files: before {listed[0]}; after {listed[1]}"
        remedy = "name them, for example channels: [{before: tip, after: AI 7}], or --channel 'tip=AI 7'"
        raise ScenarioError.at("before_after.channels", message, remedy)
    return common


def plain_name(name: str) -> str:
    """Name of a channel without its unit, in small letters."""
    return split_heading(name)[0].lower()


def _is_named(signal: MeasuredSignal, name: str | None) -> bool:
    return name is not None and plain_name(name) in (plain_name(signal.name), signal.name.lower())


# --- Responses over frequency ----------------------------------------------------------------------------------------


def response_of(
    signal: MeasuredSignal, record: TestRecord, signals: Sequence[MeasuredSignal], path: Path
) -> TestResponse:
    """Response over frequency of a channel.

    Parameters
    ----------
    signal : channel, in the unit of the file.
    record : how it was recorded.
    signals : all channels of the file.
    path : of the file, for messages.

    Returns
    -------
    TestResponse

    Raises
    ------
    InputFileError, ScenarioError
        If it is of a function type without resonances, or a time history without sweep and line spacing.
    """
    signal = signal.require(USABLE, "a comparison of resonances")
    if signal.unit.lower() == "db":
        raise InputFileError(f"has levels in dB in {signal.name}", "export amplitudes, or choose another channel")
    if signal.is_over_frequency:
        return _given_response(signal, record)
    if record.sweep is None and record.line_spacing is None:
        raise InputFileError(
            f"has a time history in {signal.name}, and does not say in which test",
            "give sweep: {from: 20 Hz, to: 200 Hz, rate: 2 oct/min} of a sine sweep, or line_spacing: 1 Hz of a random "
            "test (--sweep, --line-spacing)",
        )
    reference = None
    if record.reference is not None:
        named = channel_named(signals, record.reference, "", path, required=True, key="before_after")
        reference = named.require((FunctionType.TIME_HISTORY,), "the reference of a time history")
        reference = _in_si(reference)
    history = condition(_in_si(signal, record.unit), record)
    unit = history.unit if reference is None else _ratio_unit(history.unit, reference.unit)
    of_kind = _tracked_response if record.sweep is not None else _random_response
    response = of_kind(history, reference, record)
    return replace(response, channel=signal.name, unit=unit, warnings=(*history.warnings, *response.warnings))


def _ratio_unit(unit: str, reference: str) -> str:
    """Unit of a response over its excitation."""
    return "1" if unit == reference else f"({unit})/({reference})" if unit and reference else ""


def _in_si(signal: MeasuredSignal, unit: str | None = None) -> MeasuredSignal:
    """The signal in SI units, converted from the given unit, else from that of the file; as it is without any."""
    over = "" if unit is not None or signal.reference is None else signal.reference.unit
    factor, si = si_unit(unit or signal.unit, over)
    with np.errstate(over="ignore"):  # which `check` finds
        return replace(signal, y=signal.y * factor, unit=si, reference=None, stated_function=signal.function).check()


def _given_response(signal: MeasuredSignal, record: TestRecord) -> TestResponse:
    """A function over frequency as a response."""
    unused = [name for name in ("line_spacing", "reference") if getattr(record, name) is not None]
    if unused or record.cycles > 1 or record.remove is not None or record.high_pass is not None:
        named = ", ".join(unused) or "cycles, remove or high_pass"
        message = f"has {signal.function.with_article} in {signal.name}, and {named} belongs to time histories"
        raise InputFileError(message, "leave it out")
    given = _in_si(signal, record.unit)
    amplitude, unit = np.abs(given.y) * abs(record.factor), given.unit
    if signal.function in POWERS:
        amplitude, unit = np.sqrt(amplitude), _root_unit(unit)
    step = np.gradient(given.x) if given.x.size > 1 else np.zeros(given.x.size)
    return TestResponse(
        signal.name, np.asarray(given.x, dtype=float), np.asarray(amplitude), unit, signal.source, step,
        None, record.sweep, may_be_swept=signal.function in (FunctionType.SPECTRUM, *RATIOS), warnings=signal.warnings,
    )  # fmt: skip


def _root_unit(unit: str) -> str:
    """Unit of the square root of a power."""
    return {"m^2/s^3": "m/s^2/Hz^0.5", "N^2/Hz": "N/Hz^0.5"}.get(unit, f"({unit})^0.5" if unit else "")


def _tracked_response(history: MeasuredSignal, reference: MeasuredSignal | None, record: TestRecord) -> TestResponse:
    """Fundamental of every cycle of a sweep, over that of the excitation if it was recorded."""
    sweep = not_none(record.sweep)
    cycles = StatedCycles(sweep.from_, sweep.to, sweep.rate.value, sweep.rate.unit == "oct/s")
    still = np.ones(cycles.time.size, dtype=complex)
    records = [ReferenceRecord(history, still) if reference is None else ReferenceRecord(reference)]
    start = find_start(cycles, records) if sweep.begin is None else sweep.begin
    check_start(cycles, records, start)
    response = track(cycles, history, start)
    frequency, fundamental = response.frequency_hz, response.fundamental
    if reference is not None:
        excitation = track(cycles, reference, start).fundamental
        product = moving_mean(fundamental * np.conj(excitation), record.cycles)
        fundamental = product / np.maximum(moving_mean(np.abs(excitation) ** 2, record.cycles), TINY)
    else:
        fundamental = moving_mean(fundamental, record.cycles)
    frequency = moving_mean(frequency, record.cycles)
    step = np.array([abs(sweep.rate_at(each)) for each in frequency]) * record.cycles / frequency
    error = frequency_error(cycles, records, start) if sweep.begin is None else 0.0
    return TestResponse(history.name, frequency, np.abs(fundamental), "", history.source, step, None, sweep, error)


def _random_response(history: MeasuredSignal, reference: MeasuredSignal | None, record: TestRecord) -> TestResponse:
    """Root of the spectral density of a record, or its transfer function from the excitation (H1)."""
    from beamsim.analyses.run.random_response import cross_density

    spacing = not_none(record.line_spacing)
    count, duration = history.x.size, float(history.x[-1] - history.x[0])
    rate = (count - 1) / duration
    steps = np.diff(history.x)
    if np.ptp(steps) > 1e-3 * duration / (count - 1):
        raise measurement_error(f"{history.label} is not evenly sampled", "resample it, or export it without gaps")
    length = 2 * round(0.5 * rate / spacing)
    segments = max(2 * count // max(length, 1) - 1, 0)
    if segments < FEWEST_AVERAGES or length < 2 * FEWEST_FREQUENCIES:
        least = 0.5 * (FEWEST_AVERAGES + 1) * rate / count
        message = f"{history.label} lasts {duration:.4g} s: {segments} averages at a spacing of {spacing:g} Hz"
        remedy = (
            f"give a line_spacing between {least:.2g} and {rate / (2 * FEWEST_FREQUENCIES):.2g} Hz, or a longer record"
        )
        raise measurement_error(message, remedy)
    response = np.asarray(history.y, dtype=float)
    frequency = np.arange(length // 2 + 1) * rate / length
    density = cross_density(response, response, rate, length).real
    averages = OVERLAP * segments
    amplitude, noise = np.sqrt(density), np.full(frequency.size, 0.5 / np.sqrt(averages))
    if reference is not None:
        if not np.array_equal(reference.x, history.x):
            raise measurement_error(f"{reference.label} and {history.name} have other times", "record both together")
        excitation = np.asarray(reference.y, dtype=float)
        of_input, cross = (cross_density(excitation, each, rate, length) for each in (excitation, response))
        amplitude = np.abs(cross) / np.maximum(of_input.real, TINY)
        coherence = np.clip(np.abs(cross) ** 2 / np.maximum(of_input.real * density, TINY), 1e-12, 1.0)
        noise = np.sqrt((1.0 - coherence) / (2.0 * coherence * averages))
    some = slice(2, -1)  # without the lines of the mean, which the window spreads
    step = np.full(frequency.size, rate / length)
    return TestResponse(
        history.name, frequency[some], amplitude[some], "", history.source, step[some], noise[some], None
    )
