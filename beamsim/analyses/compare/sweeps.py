"""A computed sweep beside measured ones: response over frequency, peaks with their quality, FRAC and FDAC."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any, Literal

import numpy as np

from beamsim.analyses.compare.measured import MeasuredSignal
from beamsim.analyses.compare.result import Assurance, Comparison, PeakPair, SweptComparison
from beamsim.analyses.sweep.result import Envelope, SweepCurve, SweepResult
from beamsim.errors import Problem, ScenarioError
from beamsim.outcomes import COMPLETE
from beamsim.typing import Bools, Complexes, Floats

Detector = Literal["peak", "fundamental", "rms"]

MOST_PEAKS = 6  # of a channel, the highest
LEAST_PROMINENCE = 1.3  # smallest ratio of a peak to its surroundings
PAIRED_WITHIN = 0.15  # relative difference of the frequencies of two peaks that may be the same
FEWEST = 8  # measured frequencies within the sweep
MOST_FREQUENCIES = 120  # of an FDAC matrix, on each side


def compare_sweep(
    result: SweepResult,
    pairs: Sequence[tuple[str, str, MeasuredSignal]],
    *,
    curve: str | None = None,
    detector: Detector | None = None,
) -> Comparison:
    """Compare pairs of (place, quantity, measured response over frequency in SI units) with a curve of a sweep.

    Parameters
    ----------
    curve : name of the curve; may be left out where there is one.
    detector : what was measured in each cycle: the largest magnitude, the amplitude of the fundamental, or the root
        mean square; by default the fundamental where phases were measured, else the largest magnitude.

    Raises
    ------
    ScenarioError
        If there is no such curve, or a record is a time history or shares too few frequencies with the sweep.
    """
    begin = perf_counter()
    chosen = _curve(result, curve)
    channels = tuple(_channel(chosen, *pair, detector) for pair in pairs)
    return Comparison(
        scenario=result.scenario,
        outcome=COMPLETE,
        channels=(),
        sweeps=channels,
        assurance=_assurance(channels),
        wall_time_s=perf_counter() - begin,
    ).with_summary(sweeps=[_compared(channel) for channel in channels])


def _curve(result: SweepResult, name: str | None) -> SweepCurve:
    names = list(result.curves)
    if name is None and len(names) == 1:
        return result.curves[names[0]]
    if name not in result.curves:
        what = "--curve is missing, and the sweep has several curves" if name is None else f"--curve {name} is unknown"
        raise ScenarioError(Problem("", what, f"choose one of {', '.join(names)}"))
    return result.curves[name]


def _channel(
    curve: SweepCurve, place: str, quantity: str, signal: MeasuredSignal, detector: Detector | None
) -> SweptComparison:
    where = f"{signal.source or signal.name}: {signal.name}"
    if not signal.of_frequency:
        raise ScenarioError(
            Problem("", f"{where} is a time history, and a sweep is compared over frequency",
                    "export the response over frequency from the controller or analyser")
        )  # fmt: skip
    sources = {"force": curve.force, "displacement": curve.displacement, "absolute_acceleration": curve.acceleration}
    envelope = sources.get(quantity, {}).get(place)
    if envelope is None:
        raise ScenarioError(
            Problem("", f"{where}: the sweep holds no {quantity.replace('_', ' ')} of {place}",
                    "compare absolute_acceleration or displacement of a probe, or force of a snubber")
        )  # fmt: skip
    rising = np.argsort(curve.frequency_hz, kind="stable")
    frequency = curve.frequency_hz[rising]
    inside = (signal.x >= frequency[0]) & (signal.x <= frequency[-1])
    if np.count_nonzero(inside) < FEWEST:
        raise ScenarioError(
            Problem("", f"{where} has {np.count_nonzero(inside)} frequencies between {frequency[0]:.4g} and "
                    f"{frequency[-1]:.4g} Hz, those of the sweep", f"at least {FEWEST} are needed")
        )  # fmt: skip
    has_phase = signal.has_phase
    if detector is None:
        detector = "fundamental" if has_phase and np.any(curve.orders == 1.0) else "peak"
    values = _detected(curve, envelope, detector, where)[rising]
    x = signal.x[inside]
    measured = np.asarray(signal.y[inside], dtype=complex)
    phase = np.unwrap(np.angle(values))
    predicted = np.interp(x, frequency, np.abs(values)) * np.exp(1j * np.interp(x, frequency, phase))
    has_phase = has_phase and detector == "fundamental"
    if not has_phase:
        measured, predicted = np.abs(measured).astype(complex), np.abs(predicted).astype(complex)
    return SweptComparison(
        place=place,
        quantity=quantity,
        unit=envelope.unit,
        channel=signal.name,
        source=signal.source,
        curve=curve.name,
        detector=detector,
        has_phase=has_phase,
        frequency_hz=x,
        predicted=predicted,
        measured=measured,
        frac=assurance(predicted, measured),
        peaks=tuple(_peak_pairs(frequency, np.abs(values), x, np.abs(measured))),
    )


def _detected(curve: SweepCurve, envelope: Envelope, detector: Detector, where: str) -> Complexes:
    """(C,) what an instrument of that kind shows in each cycle."""
    if detector == "peak":
        return envelope.peak.astype(complex)
    if detector == "rms":
        return envelope.rms.astype(complex)
    first = np.flatnonzero(curve.orders == 1.0)
    if not first.size:
        raise ScenarioError(
            Problem("", f"{where} is compared with the fundamental, which the sweep did not track",
                    "add 1 to sweep.orders, or use --detector peak")
        )  # fmt: skip
    return np.asarray(envelope.harmonics[first[0]])


def assurance(one: Complexes, other: Complexes) -> float:
    """Frequency response assurance criterion: |one* other|² / (|one|² |other|²), 1 for responses that are proportional.

    W. Heylen and S. Lammens, "FRAC: a consistent way of comparing frequency response functions", 1996.
    """
    size = float(np.sum(np.abs(one) ** 2) * np.sum(np.abs(other) ** 2))
    return float(np.abs(np.vdot(one, other)) ** 2) / size if size > 0 else float("nan")


def _assurance(channels: Sequence[SweptComparison]) -> Assurance | None:
    """FDAC of the channels of one quantity that share their frequencies; None of fewer than two.

    R. Pascual, J. C. Golinval and M. Razeto, "A frequency domain correlation technique for model correlation and
    updating", IMAC 1997.
    """
    if len(channels) < 2 or len({channel.quantity for channel in channels}) > 1:
        return None
    f = channels[0].frequency_hz
    if any(not np.array_equal(channel.frequency_hz, f) for channel in channels):
        return None
    some = np.unique(np.linspace(0, f.size - 1, min(f.size, MOST_FREQUENCIES)).round().astype(int))
    predicted = np.array([channel.predicted[some] for channel in channels])
    measured = np.array([channel.measured[some] for channel in channels])
    sizes = np.outer(np.sum(np.abs(predicted) ** 2, axis=0), np.sum(np.abs(measured) ** 2, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        fdac = np.abs(predicted.conj().T @ measured) ** 2 / sizes
    return Assurance(f[some], f[some], np.asarray(fdac))


def _peak_pairs(f_p: Floats, p: Floats, f_m: Floats, m: Floats) -> list[PeakPair]:
    """Peaks of the measured response, each with a computed one: the nearest pairs first, and in the same order."""
    computed, measured = peaks_of(f_p, p), peaks_of(f_m, m)
    nearness = sorted(
        (abs(np.log(c[0] / of[0])), i, j) for i, of in enumerate(measured) for j, c in enumerate(computed)
    )
    partner: dict[int, int] = {}
    for distance, i, j in nearness:
        in_order = all((i - other) * (j - of_other) > 0 for other, of_other in partner.items())
        if distance <= PAIRED_WITHIN and in_order:
            partner[i] = j
    pairs = []
    nan = float("nan")
    for i, (f, level, quality) in enumerate(measured):
        of = computed[partner[i]] if i in partner else (nan, nan, nan)
        pairs.append(PeakPair(f, of[0], level, of[1], quality, of[2]))
    return pairs


def peaks_of(frequency: Floats, amplitude: Floats) -> list[tuple[float, float, float]]:
    """Frequency, level and Q of the highest peaks, by frequency; Q from the half-power band, nan where that is open.

    Frequency and level are those of the parabola through the three highest points.
    """
    from scipy.signal import find_peaks

    positive = np.maximum(amplitude, 1e-300 + 1e-12 * float(np.max(amplitude, initial=0.0)))
    at, _ = find_peaks(np.log(positive), prominence=np.log(LEAST_PROMINENCE))
    highest = sorted(at, key=lambda k: -amplitude[k])[:MOST_PEAKS]
    peaks = []
    for k in sorted(int(k) for k in highest):
        f, level = _vertex(frequency[k - 1 : k + 2], amplitude[k - 1 : k + 2])
        below = _crossing(frequency, amplitude < level / np.sqrt(2), amplitude, level / np.sqrt(2), k, -1)
        above = _crossing(frequency, amplitude < level / np.sqrt(2), amplitude, level / np.sqrt(2), k, 1)
        peaks.append((f, level, f / (above - below)))
    return peaks


def _vertex(x: Floats, y: Floats) -> tuple[float, float]:
    """Of the parabola through three points."""
    a, b, c = np.polyfit(x - x[1], y, 2)
    if not a < 0.0:
        return float(x[1]), float(y[1])
    shift = float(np.clip(-b / (2 * a), x[0] - x[1], x[2] - x[1]))
    return float(x[1] + shift), float(c + b * shift + a * shift**2)


def _crossing(frequency: Floats, lower: Bools, amplitude: Floats, half: float, peak: int, way: int) -> float:
    """Where the amplitude first falls below half the power on one side of a peak, interpolated; nan if nowhere."""
    side = np.flatnonzero(lower[peak:]) + peak if way > 0 else np.flatnonzero(lower[:peak])[::-1]
    if not side.size:
        return float("nan")
    k = int(side[0])
    share = (half - amplitude[k]) / (amplitude[k - way] - amplitude[k])
    return float(frequency[k] + share * (frequency[k - way] - frequency[k]))


def _compared(channel: SweptComparison) -> dict[str, Any]:
    """Summary of one channel."""
    names = ("place", "quantity", "channel", "curve", "detector", "frac")
    peaks = [{**vars(peak), "frequency_difference": peak.frequency_difference, "difference_db": peak.difference_db}
             for peak in channel.peaks]  # fmt: skip
    return {**{name: getattr(channel, name) for name in names}, "peaks": peaks}
