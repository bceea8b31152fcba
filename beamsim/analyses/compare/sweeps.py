r"""A computed sweep compared with measured ones: response over frequency, peaks with their quality, FRAC and FDAC.

Time histories of a swept sine are tracked over the cycles of the computed sweep. The record is resampled at equal steps
of the phase (computed order tracking: K. R. Fyfe and E. D. S. Munck, "Analysis of computed order tracking", Mechanical
Systems and Signal Processing 11, 1997), so that each cycle has the same number of samples; their mean product with
:math:`2 e^{-i\varphi}` is the fundamental. Over N cycles this is a tracking filter with a bandwidth of 1/N of the
frequency.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter
from typing import Any, Literal, Protocol

import numpy as np

from beamsim.analyses.compare.result import (
    Assurance,
    Comparison,
    PeakPair,
    SweptComparison,
    outcome_of_comparison,
    sweep_datasets,
)
from beamsim.analyses.sweep.layouts import FOLLOWED
from beamsim.analyses.sweep.result import CycleValues, SweepCurve, SweepResult
from beamsim.measurements.channels import demand_amplitudes, measurement_error
from beamsim.measurements.signal import MeasuredSignal
from beamsim.scenario.quantities import amplitude_unit
from beamsim.scenario.units import FORCE, MOMENT, PRESSURE
from beamsim.signals.mac import modal_assurance
from beamsim.signals.resonance_peaks import pair_peaks, peaks_of
from beamsim.typing import TINY, Complexes, Floats, Ints, not_none

Detector = Literal["peak", "fundamental", "rms"]

FEWEST_FREQUENCIES = 8  # measured frequencies within the sweep, at least


@dataclass(frozen=True)
class Tracking:
    """How time histories of a sweep are converted to responses over frequency."""

    begin: float | None = None  # s, time in the record at which the curve begins; found from the record by default
    reference: MeasuredSignal | None = None  # excitation in the same record, which provides phases
    cycles: int = 1  # number of averaged cycles: the bandwidth of the tracking filter is the frequency over this number


def compare_sweep(
    result: SweepResult,
    pairs: Sequence[tuple[str, str, MeasuredSignal]],
    *,
    curve: str | None = None,
    detector: Detector | None = None,
    tracking: Tracking | None = None,
) -> Comparison:
    """Compare measured signals with a curve of a sweep.

    Signals are responses over frequency, or time histories of a swept sine with the range and rate of the computed one.

    Parameters
    ----------
    result : result of the sweep.
    pairs : place, quantity, and measured signal in SI units.
    curve : name of the curve; optional if there is only one.
    detector : value of each cycle: largest magnitude (peak), amplitude of the fundamental, or root mean square (rms);
        by
    default the fundamental if phases were measured or a time history is tracked, else the peak.
    tracking : settings for time histories.

    Returns
    -------
    Comparison
        With a `SweptComparison` for each pair.

    Raises
    ------
    ScenarioError
        If there is no such curve, or a record has too few common frequencies with the sweep or does not follow it.
    """
    begin = perf_counter()
    demand_amplitudes((signal for _, _, signal in pairs), "a comparison with a sweep")
    chosen = _curve(result, curve)
    tracking = _with_record_starts(result, chosen, pairs, tracking or Tracking())
    warnings = [text for _, _, signal in pairs for text in (*_level_warnings(chosen, signal), *signal.warnings)]
    channels = tuple(_channel(chosen, *pair, detector, tracking) for pair in pairs)
    assurance = _assurance(channels)
    return Comparison(
        scenario=result.scenario,
        outcome=outcome_of_comparison(result),
        datasets=sweep_datasets(channels, assurance),
        warnings=(*result.warnings, *warnings),
        wall_time_s=perf_counter() - begin,
    ).with_summary(
        sweeps=[_channel_summary(channel) for channel in channels],
        fdac=None if assurance is None else assurance.summary(),
        margins=result.summary.get("margins"), doubtful=result.summary.get("doubtful"),
    )  # fmt: skip


def _curve(result: SweepResult, name: str | None) -> SweepCurve:
    names = list(result.curves)
    if name is None and len(names) == 1:
        return result.curves[names[0]]
    if name not in result.curves:
        what = "--curve is missing, but the sweep has several curves" if name is None else f"--curve {name} is unknown"
        raise measurement_error(what, f"choose one of {', '.join(names)}")
    return result.curves[name]


SAME_LEVEL = 0.01  # relative difference of levels that count as equal


def _level_warnings(curve: SweepCurve, signal: MeasuredSignal) -> Iterator[str]:
    """Warn if a frequency response was measured at another level than that of the computed sweep.

    Raises
    ------
    ScenarioError
        If one was excited by a force and the other by base motion.
    """
    if signal.level is None:
        return
    loads = (FORCE.unit, MOMENT.unit, PRESSURE.unit)
    unit, computed = signal.level.dimension.unit, amplitude_unit(curve.quantity)
    if (unit in loads) != (computed in loads):
        raise measurement_error(
            f"{signal.label} was measured with an excitation in {unit}, but the sweep has an excitation in {computed}",
            "compute the sweep with the excitation of the test",
        )
    inside = (curve.frequency_hz >= signal.x[0]) & (curve.frequency_hz <= signal.x[-1])
    amplitude = curve.excitation_amplitude[inside]
    if unit == computed and np.any(np.abs(amplitude / signal.level.amplitude - 1.0) > SAME_LEVEL):
        most = float(amplitude[np.argmax(np.abs(amplitude / signal.level.amplitude - 1.0))])
        yield (
            f"{signal.name} was measured at {signal.level.amplitude:.4g} {unit}, but the sweep is computed at "
            f"{most:.4g} {unit}: a structure with stops responds differently at each level"
        )


def _with_record_starts(
    result: SweepResult, curve: SweepCurve, pairs: Sequence[tuple[str, str, MeasuredSignal]], tracking: Tracking
) -> Tracking:
    """Settings with the checked start of the curve in the records; unchanged without time histories."""
    histories = [pair for pair in pairs if not pair[2].is_over_frequency]
    if not histories:
        if tracking != Tracking():
            raise measurement_error(
                "--reference, --begin and --cycles belong to time histories, but the measurement is over frequency",
                "leave them out",
            )
        return tracking
    if curve.kind != "swept_sine":
        raise measurement_error(
            f"{histories[0][2].label} is a time history, which needs a swept sine, but the sweep is "
            f"{curve.kind.replace('_', ' ')}",
            "compute a sweep of kind: swept_sine with the rate of the test, or export responses over frequency",
        )
    if tracking.reference is not None:
        records = [ReferenceRecord(tracking.reference)]
    else:
        records = [
            ReferenceRecord(
                signal,
                _detector_readings(
                    curve, _computed_cycles(curve, place, quantity, signal.label), "fundamental", signal.label
                ),
            )
            for place, quantity, signal in histories
        ]
    begin = find_start(curve, records) if tracking.begin is None else tracking.begin
    check_start(curve, records, begin)
    return replace(tracking, begin=begin)


def _computed_cycles(curve: SweepCurve, place: str, quantity: str, signal_name: str) -> CycleValues:
    followed = "force" if quantity == "moment" else quantity
    if followed in FOLLOWED and place in curve.places(followed):
        return curve.channel(followed, place)
    outputs = curve.cycles.by_label("output_quantity")
    if place not in outputs or outputs[place].item() != quantity:
        raise measurement_error(
            f"{signal_name}: the sweep has no {quantity.replace('_', ' ')} of {place}",
            "compare absolute_acceleration or displacement of a probe, force of a snubber, or an output",
        )
    return curve.channel("output", place)


def _channel(
    curve: SweepCurve,
    place: str,
    quantity: str,
    signal: MeasuredSignal,
    detector: Detector | None,
    tracking: Tracking,
) -> SweptComparison:
    where = signal.label
    followed = not signal.is_over_frequency
    computed = _computed_cycles(curve, place, quantity, where)
    if detector is None:
        measured_phases = followed or signal.has_phase
        detector = "fundamental" if measured_phases and np.any(curve.orders == 1.0) else "peak"
    rising = np.argsort(curve.frequency_hz, kind="stable")
    frequency, values = curve.frequency_hz[rising], _detector_readings(curve, computed, detector, where)[rising]
    if followed:
        signal = _tracked(curve, signal, detector, tracking)
        frequency, values = moving_mean(frequency, tracking.cycles), moving_mean(values, tracking.cycles)
    inside = (signal.x >= frequency[0]) & (signal.x <= frequency[-1])
    if np.count_nonzero(inside) < FEWEST_FREQUENCIES:
        raise measurement_error(
            f"{where} has {np.count_nonzero(inside)} frequencies between {frequency[0]:.4g} and "
            f"{frequency[-1]:.4g} Hz, those of the sweep",
            f"at least {FEWEST_FREQUENCIES} are needed",
        )
    x = signal.x[inside]
    measured = np.asarray(signal.y[inside], dtype=complex)
    phase = np.unwrap(np.angle(values))
    predicted = np.interp(x, frequency, np.abs(values)) * np.exp(1j * np.interp(x, frequency, phase))
    has_phase = signal.has_phase and detector == "fundamental"
    if not has_phase:
        measured, predicted = np.abs(measured).astype(complex), np.abs(predicted).astype(complex)
    return SweptComparison(
        place=place,
        quantity=quantity,
        unit=computed.unit,
        channel=signal.description,
        source=signal.source,
        curve=curve.name,
        detector=detector,
        has_phase=has_phase,
        frequency_hz=x,
        predicted=predicted,
        measured=measured,
        frac=float(modal_assurance(predicted[:, None], measured[:, None])[0, 0]),
        peaks=tuple(_peak_pairs(curve, (frequency, np.abs(values)), (x, np.abs(measured)))),
        begin_s=tracking.begin if followed else None,
        bandwidth=1.0 / tracking.cycles if followed and detector == "fundamental" else None,
    )


def _tracked(curve: SweepCurve, signal: MeasuredSignal, detector: Detector, tracking: Tracking) -> MeasuredSignal:
    """Detector value of each cycle of a time history; with phases if the excitation was recorded."""
    begin = not_none(tracking.begin)
    of = track(curve, signal, begin)
    if detector != "fundamental":
        if tracking.cycles > 1:
            raise measurement_error(
                f"--cycles {tracking.cycles} sets the bandwidth of a tracking filter, but --detector is {detector}",
                "leave one of them out",
            )
        return replace(signal, x=of.frequency_hz, y=of.peak if detector == "peak" else of.rms, is_over_frequency=True)
    y = of.fundamental
    if tracking.reference is not None:
        excitation = track(curve, tracking.reference, begin)
        some = np.isin(excitation.frequency_hz, of.frequency_hz)
        turned = excitation.fundamental[some]
        # the excitation of the sweep is a sine: amplitude -i relative to a cosine
        y = y * -1j * np.conj(turned) / np.maximum(np.abs(turned), TINY)
    x, y = moving_mean(of.frequency_hz, tracking.cycles), moving_mean(y, tracking.cycles)
    return replace(signal, x=x, y=np.abs(y) if tracking.reference is None else y, is_over_frequency=True)


def _detector_readings(curve: SweepCurve, computed: CycleValues, detector: Detector, signal_name: str) -> Complexes:
    """(C,) value of a detector in each cycle of the computed sweep."""
    if detector == "peak":
        return computed.peak.astype(complex)
    if detector == "rms":
        return computed.rms.astype(complex)
    first = np.flatnonzero(curve.orders == 1.0)
    if not first.size:
        raise measurement_error(
            f"{signal_name} is compared with the fundamental, which the sweep did not compute",
            "add 1 to sweep.orders, or use --detector peak",
        )
    return np.asarray(computed.harmonics[first[0]])


LARGEST_FDAC = 120  # rows and columns of an FDAC matrix


def _assurance(channels: Sequence[SweptComparison]) -> Assurance | None:
    """FDAC of the channels of one quantity with common frequencies; None for fewer than two."""
    if len(channels) < 2 or len({channel.quantity for channel in channels}) > 1:
        return None
    f = channels[0].frequency_hz
    if any(not np.array_equal(channel.frequency_hz, f) for channel in channels):
        return None
    some = np.unique(np.linspace(0, f.size - 1, min(f.size, LARGEST_FDAC)).round().astype(int))
    predicted = np.array([channel.predicted[some] for channel in channels])
    measured = np.array([channel.measured[some] for channel in channels])
    return Assurance(f[some], f[some], modal_assurance(predicted, measured))


def _peak_pairs(curve: SweepCurve, predicted: tuple[Floats, Floats], recorded: tuple[Floats, Floats]) -> list[PeakPair]:
    """Pair the peaks of the measured response with computed ones.

    Both responses were swept at the rate of the computed curve.
    """
    computed, measured = (peaks_of(*each, curve.rate_at(each[0])) for each in (predicted, recorded))
    partner = pair_peaks([peak.frequency_hz for peak in measured], [peak.frequency_hz for peak in computed])
    pairs = []
    nan = float("nan")
    for i, (f, level, quality, *_) in enumerate(measured):
        of = computed[partner[i]] if i in partner else (nan, nan, nan)
        pairs.append(PeakPair(f, of[0], level, of[1], quality, of[2]))
    return pairs


def _channel_summary(channel: SweptComparison) -> dict[str, Any]:
    """Summary of one channel."""
    names = ("place", "quantity", "channel", "curve", "detector", "begin_s", "bandwidth", "frac")
    peaks = [{**peak._asdict(), "frequency_difference": peak.frequency_difference, "difference_db": peak.difference_db}
             for peak in channel.peaks]  # fmt: skip
    return {**{name: getattr(channel, name) for name in names}, "peaks": peaks}


FEWEST_SAMPLES = 5.0  # samples per cycle of the highest frequency
# largest relative frequency error of responses, whose phases turn at resonances; noise gives 0.25
LARGEST_RESPONSE_ERROR = 0.1
TRIAL_STEP = 0.15  # relative frequency step between trial starts


class SweptCycles(Protocol):
    """The cycles of a swept sine: a computed curve, or a sweep that a test was to follow."""

    @property
    def time(self) -> Floats:
        """(C,) start time of the cycles, s."""

    @property
    def frequency_hz(self) -> Floats:
        """(C,) frequency of the cycles, Hz."""

    @property
    def direction(self) -> str:
        """Up or down."""


@dataclass(frozen=True)
class StatedCycles:
    """The cycles of a swept sine of which first and last frequency and rate are known."""

    first_hz: float
    last_hz: float
    rate: float  # octaves per second of a logarithmic sweep, Hz/s of a linear one; positive
    logarithmic: bool

    @property
    def direction(self) -> str:
        """Up or down."""
        return "up" if self.last_hz > self.first_hz else "down"

    @cached_property
    def time(self) -> Floats:
        """(C,) start time of the cycles, s."""
        rate = self.rate if self.direction == "up" else -self.rate
        if self.logarithmic:
            growth = rate * np.log(2.0)  # cycles up to t: first (e^(growth t) - 1) / growth
            count = int((self.last_hz - self.first_hz) / growth)
            return np.asarray(np.log1p(np.arange(count + 1) * growth / self.first_hz) / growth)
        count = int((self.last_hz**2 - self.first_hz**2) / (2.0 * rate))
        square = np.maximum(self.first_hz**2 + 2.0 * rate * np.arange(count + 1), 0.0)
        return np.asarray((np.sqrt(square) - self.first_hz) / rate)

    @cached_property
    def frequency_hz(self) -> Floats:
        """(C,) mean frequency of the cycles, Hz; of the last one where it begins."""
        return np.append(1.0 / np.diff(self.time), self.last_hz)


@dataclass(frozen=True)
class ReferenceRecord:
    """Record from which the start of a sweep is found, with the expected phases of its fundamental."""

    signal: MeasuredSignal
    # (C,) fundamental of every cycle of the curve; None for the excitation
    expected_fundamental: Complexes | None = None


@dataclass(frozen=True)
class RecordCycles:
    """Values of a record in the cycles of a sweep."""

    cycle: Ints  # (C,) numbers of the cycles in the curve
    frequency_hz: Floats  # (C,) increasing
    fundamental: Complexes  # (C,) a - ib of a cos(phase) + b sin(phase)
    peak: Floats  # (C,) largest magnitude
    rms: Floats  # (C,) with the mean


LEAST_CORRECTION = 1e-6  # relative frequency error below which the start is not corrected


def find_start(curve: SweptCycles, records: Sequence[ReferenceRecord]) -> float:
    """Time in the records at which a curve of the sweep begins, s: their frequency is then that of the sweep.

    The phase of the fundamental drifts from cycle to cycle by the relative frequency error. Phases of responses also
    turn at resonances, as the sweep predicts; if the measured resonances differ, in a few further cycles. The error is
    therefore the median over the cycles.
    """
    start, end = records[0].signal.x[0], records[0].signal.x[-1]
    slope = np.abs(np.gradient(curve.frequency_hz, curve.time))
    step = TRIAL_STEP * float(np.min(curve.frequency_hz / slope))
    latest = max(float(end - curve.time[-1] + curve.time[0]), float(start))
    trials = np.linspace(start, latest, int(np.clip(np.ceil((latest - start) / step) + 1, 1, 200)))
    begin = min((float(b) for b in trials), key=lambda b: frequency_error(curve, records, b))
    for _ in range(20 if frequency_error(curve, records, begin) < LARGEST_RESPONSE_ERROR + TRIAL_STEP else 0):
        moves = [_delay(curve, record, begin) for record in records]
        move = float(np.nanmedian(np.concatenate(moves)))
        begin -= move
        if abs(move) * float(np.max(slope / curve.frequency_hz)) < LEAST_CORRECTION:
            break
    return begin


LARGEST_EXCITATION_ERROR = 0.03  # largest median frequency error of an excitation that follows the sweep


def check_start(curve: SweptCycles, records: Sequence[ReferenceRecord], start_s: float) -> None:
    """Refuse records that do not have the frequency of the sweep.

    Raises
    ------
    ScenarioError
        With the relative frequency error.
    """
    off = frequency_error(curve, records, start_s)
    if off > (LARGEST_EXCITATION_ERROR if records[0].expected_fundamental is None else LARGEST_RESPONSE_ERROR):
        names = ", ".join(record.signal.name for record in records)
        raise measurement_error(
            f"{records[0].signal.source or names}: {names} does not follow the sweep: from "
            f"{start_s:.4g} s of the record on its frequency is off by {100 * off:.2g} % in the median",
            "use the rate and range of the test; or give its start in the record (--begin), "
            "or which channel is the excitation (--reference)",
        )


def track(curve: SweptCycles, signal: MeasuredSignal, start_s: float) -> RecordCycles:
    """Fundamental, peak and rms of each cycle within the record.

    Parameters
    ----------
    curve : curve of the sweep, which defines the cycles.
    signal : time history.
    start_s : time in the record at which the curve begins, s.

    Returns
    -------
    RecordCycles

    Raises
    ------
    ScenarioError
        If the record has fewer than `FEWEST_SAMPLES` in a cycle of the highest frequency, or contains less than two
        cycles.
    """
    from scipy.interpolate import CubicSpline

    where = signal.label
    edges = curve.time - curve.time[0] + start_s
    inside = np.flatnonzero((edges[:-1] >= signal.x[0]) & (edges[1:] <= signal.x[-1]))
    if inside.size < 2:
        raise measurement_error(
            f"{where} contains {inside.size} cycles of the sweep, which begins at {start_s:.4g} s of the record",
            "record the whole sweep, or correct --begin",
        )
    rate = (signal.x.size - 1) / (signal.x[-1] - signal.x[0])
    highest = float(curve.frequency_hz[inside].max())
    if rate < FEWEST_SAMPLES * highest:
        raise measurement_error(
            f"{where} is sampled at {rate:.5g} Hz, {rate / highest:.2g} times a cycle at {highest:.5g} Hz",
            f"use a record of {FEWEST_SAMPLES:g} samples a cycle or more",
        )
    count = int(np.clip(2 ** np.ceil(np.log2(rate / np.median(curve.frequency_hz[inside]))), 64, 1024))
    share = (np.arange(count) + 0.5) / count  # midpoint rule, since a cycle does not end as it begins
    clock = CubicSpline(np.arange(edges.size), edges)
    turns = inside[:, None] + share
    history = CubicSpline(signal.x, np.asarray(signal.y, dtype=float))
    values = history(clock(turns))
    at_ends = np.abs(history(edges[np.stack([inside, inside + 1])])).max(axis=0)
    weight = clock(turns, 1)  # the root mean square is an average over time, as in the sweep
    weight /= weight.sum(axis=1, keepdims=True)
    fundamental = np.asarray(values @ np.exp(-2j * np.pi * share) * (2.0 / count), dtype=complex)
    rising = np.argsort(curve.frequency_hz[inside], kind="stable")
    return RecordCycles(
        cycle=inside[rising],
        frequency_hz=curve.frequency_hz[inside][rising],
        fundamental=fundamental[rising],
        peak=np.maximum(np.abs(values).max(axis=1), at_ends)[rising],
        rms=np.sqrt(np.sum(weight * values**2, axis=1))[rising],
    )


def moving_mean(values: Any, cycles: int) -> Any:
    """(C - N + 1,) mean over N successive cycles."""
    return np.convolve(values, np.full(cycles, 1.0 / cycles), mode="valid") if cycles > 1 else values


REST_SHARE = 1e-4  # relative to the largest value of a record; smaller cycles have no usable phase


def _drift(curve: SweptCycles, record: ReferenceRecord, start_s: float) -> tuple[Floats, Floats]:
    """(C - 1,) frequencies of cycles, and relative frequency errors; nan for cycles at rest."""
    of = track(curve, record.signal, start_s)
    turned = of.fundamental[1:] * np.conj(of.fundamental[:-1])
    moves = np.abs(turned) > (REST_SHARE * float(np.max(np.abs(record.signal.y)))) ** 2
    if record.expected_fundamental is not None:
        expected = record.expected_fundamental[of.cycle]
        turned = turned * np.conj(expected[1:]) * expected[:-1]
    forward = 1.0 if curve.direction == "up" else -1.0
    return of.frequency_hz[1:], np.where(moves, forward * np.angle(turned) / (2 * np.pi), np.nan)


def frequency_error(curve: SweptCycles, records: Sequence[ReferenceRecord], start_s: float) -> float:
    """Median magnitude of the relative frequency error, at most one half."""
    error = np.concatenate([_drift(curve, record, start_s)[1] for record in records])
    return float(np.median(np.nan_to_num(np.abs(error), nan=0.5)))


def _delay(curve: SweptCycles, record: ReferenceRecord, start_s: float) -> Floats:
    """(C - 1,) time by which the record is ahead of the sweep, from the frequency of each cycle, s."""
    frequency, error = _drift(curve, record, start_s)
    rising = np.argsort(curve.frequency_hz, kind="stable")
    slope = np.gradient(curve.frequency_hz, curve.time)[rising]
    return np.asarray(error * frequency / np.interp(frequency, curve.frequency_hz[rising], slope))
