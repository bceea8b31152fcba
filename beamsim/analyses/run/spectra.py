"""Single-sided spectra of time histories and of motions in closed form, and the table of their lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from operator import attrgetter

import numpy as np

from beamsim.analyses.run.motion import RunMotion
from beamsim.analyses.run.result import ALLOWED_REMAINDER, SpectralLine, Spectrum, UnresolvedLine
from beamsim.flow.channels import MotionPart, outputs_of
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import check_stop
from beamsim.results.values import ACCELERATION, DISPLACEMENT
from beamsim.scenario import Scenario
from beamsim.scenario.run import MOST_FREQUENCIES, SpectrumSettings
from beamsim.signals.records import (
    LOBE,
    Levels,
    MotionRecord,
    Remainder,
    SampledRecord,
    SpectrumRecord,
    Window,
    parabola_top,
    refined,
)
from beamsim.system.equations import ChannelSet
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, not_none

SAMPLES_OF_A_PERIOD = 2.56  # of the highest frequency: as many as would cover a curve
HIGHEST_ORDER = 12.5  # of the excitation frequency that is shown at least
MANY_PIECES = 8  # of the inputs: more are those of a sampled signal
FLOOR_LINES = 16  # beyond the highest content: a line is told by what lies beside it
FEWEST_SAMPLES = 256
DECAYED = 0.25  # rms of the last quarter of a free motion over that of the first, below which it decays
LASTING = 0.8  # the same after a shock, from which on the motion lasts, as stick and slip on a belt that was started
FLOOR_DB = -400.0  # what stands for the level of a zero amplitude, far below round-off (about -310 dB)
# The rule for a line, see `spectrum_of`.
WORTH_LISTING = 1e-3  # of the largest line: 60 dB
_OVER_FLOOR = 10.0  # times the local noise floor: 20 dB
_OVER_SKIRTS = 10**0.5  # the same in a decaying record, whose lines are broad: 10 dB over an octave on either side
_OVER_SIDE_LOBES = 5e-5  # of the largest deviation from the mean: a drift's side lobes are no lines
_ROUND_OFF = 1e-12  # of max |x|
_DENOMINATORS = (1, 2, 3, 4)  # of the orders m/n that are looked for
_SEPARATED = 0.02  # of what one line leaves near it, that two may leave
_PROMISING = 0.3  # the same for a pair on a grid of frequencies, which is then fitted with all lines
_ON_ORDER = 0.02  # bins from an order of the excitation, of one of two lines that were separated
_MOST_PAIRS = 12  # fits of pairs in one spectrum
_MOST_LINES = 50
_ORDERS_OF_A_SHORT_RECORD = 10
NEARBY, NEARBY_BINS = 0.01, 3.0  # share of its frequency, and bins, within which a line is found again


def spectral(system: StructuralSystem) -> ChannelSet:
    """The channels of which there are spectra: of probes and of the outputs that are no energies."""
    outputs = (c.key for c in system.channels.channels if c.section == "outputs" and not c.squared)
    return system.channels.of_keys(ACCELERATION, DISPLACEMENT, *dict.fromkeys(outputs))


def spectra_of(motion: RunMotion) -> dict[tuple[str, str], Spectrum]:
    """Spectra of every probe and output, whatever the output rate; of a time-stepped motion those of its samples.

    Parameters
    ----------
    motion : of which the last part is looked at; its scenario says what is asked for.

    Returns
    -------
    By name and quantity of the channel.
    """
    system = motion.system
    settings, excitation_hz = not_none(system.scenario.run).spectrum, system.excitation_frequency_hz
    channels, trajectory = spectral(system), motion.trajectory
    labels = [(channel.name, channel.quantity, channel.unit) for channel in channels.channels]
    if trajectory is None or trajectory.end <= 0.0:
        histories = not_none(motion.histories)
        samples = np.hstack([histories.of(key) for key in channels.places]).T
        pairs = zip(labels, samples, strict=True)
        return {of[:2]: spectrum(histories.time, x, settings, excitation_hz, *of) for of, x in pairs}
    begin = trajectory.end - _duration(settings, trajectory.end, excitation_hz)
    kept = system.kept_modes
    residual = (*system.open_frequencies_hz[kept:], *system.closed_frequencies_hz[kept:])
    spectra = {}
    records = records_of(system, trajectory, channels, (begin, trajectory.end))
    for of, record in zip(labels, records, strict=True):
        check_stop()
        window = settings.window or _suited_window(system.scenario, record)
        spectra[of[:2]] = spectrum_of(
            record, window, excitation_hz, *of, residual_hz=residual, chosen_hz=settings.frequencies
        )
    return spectra


def coverage_notes(motion: RunMotion) -> list[str]:
    """A note where spectra do not cover every mode kept.

    Parameters
    ----------
    motion : of which there are, or would be, spectra.

    Returns
    -------
    One sentence, or none.
    """
    system, trajectory = motion.system, motion.trajectory
    highest = float(system.closed_frequencies_hz[: system.kept_modes].max(initial=0.0))
    if not spectral(system).channels:
        return []
    if trajectory is None or trajectory.end <= 0.0:
        time = not_none(motion.histories).time
        rate = float((time.size - 1) / (time[-1] - time[0])) if time.size > 1 else 1.0
        if rate >= 2.0 * highest or trajectory is not None:
            return []
        return [
            f"spectra are made of samples at {rate:g} Hz, and the highest mode kept has {highest:.4g} Hz: content "
            f"above {0.5 * rate:g} Hz is aliased; raise run.sample_rate"
        ]
    settings = not_none(system.scenario.run).spectrum
    duration = _duration(settings, trajectory.end, system.excitation_frequency_hz)
    shown = _highest_shown(system, trajectory, duration)
    if shown >= highest or shown < MOST_FREQUENCIES / duration:
        return []
    return [
        f"spectra end at {shown:.4g} Hz, their {MOST_FREQUENCIES}th frequency, and the highest mode kept has "
        f"{highest:.4g} Hz; analyse a shorter part of the run (run.spectrum.last)"
    ]


def records_of(
    system: StructuralSystem, trajectory: Trajectory, channels: ChannelSet, span: tuple[float, float],
    least_hz: float = 0.0,
) -> list[MotionRecord]:  # fmt: skip
    """Records of a part of a motion, whose spectra cover the modes kept.

    Parameters
    ----------
    system : whose scenario says what is asked for.
    trajectory : the motion.
    channels : linear ones.
    span : s, begin and end of the part.
    least_hz : Hz, that the spectra cover at least.

    Returns
    -------
    A record of each channel.
    """
    duration = span[1] - span[0]
    highest = max(_highest_shown(system, trajectory, duration), least_hz)
    part = MotionPart(trajectory.between(*span), outputs_of(trajectory.flow, channels.linear), 2.0 * np.pi * highest)
    size = max(int(SAMPLES_OF_A_PERIOD * highest * duration), FEWEST_SAMPLES)
    return [MotionRecord(part, k, highest, size) for k in range(channels.order.size)]


def _duration(settings: SpectrumSettings, available: float, excitation_hz: float) -> float:
    """Length of the part at the end of the run that is analysed, s."""
    if settings.last is not None:
        return min(settings.last, available)
    if settings.periods is not None and np.isfinite(excitation_hz) and excitation_hz > 0:
        whole = min(settings.periods, int(available * excitation_hz * (1 + 1e-12)))
        if whole >= 1:
            return min(available, whole / excitation_hz)
    return available


def _highest_shown(system: StructuralSystem, trajectory: Trajectory, duration: float) -> float:
    """Frequency, Hz, at which the spectra of a part of a motion, s, end: where the motion has a meaning, or as asked.

    It has one up to the modes kept, and to the excitation.
    """
    settings, kept = not_none(system.scenario.run).spectrum, system.kept_modes
    if kept == system.dynamics.size:  # no static vectors
        structure = trajectory.flow.highest_frequency / (2.0 * np.pi)
    else:
        structure = float(system.closed_frequencies_hz[kept - 1]) if kept else 0.0
    highest = max(
        1.05 * structure, structure + FLOOR_LINES / duration, 2.0 * system.scenario.excitation.highest_frequency_hz
    )
    if np.isfinite(system.excitation_frequency_hz):
        highest = max(highest, HIGHEST_ORDER * system.excitation_frequency_hz)
    pieces = np.diff(trajectory.flow.sources.start)
    if pieces.size > MANY_PIECES:
        highest = max(highest, 0.5 / float(np.median(pieces)))
    return min(max(settings.to or highest, *settings.frequencies, 0.0), MOST_FREQUENCIES / duration)


def _suited_window(scenario: Scenario, record: MotionRecord) -> str:
    """Hann for a motion that lasts, ``decaying`` after a shock and for what dies away: its beginning counts."""
    shock = scenario.excitation.shock
    if shock or scenario.excitation.highest_frequency_hz == 0.0:  # the others: none, or records
        first, last = record.deviations_of_quarters()
        if last < (LASTING if shock else DECAYED) * first:
            return "decaying"
    return "hann"


def amplitude_db(amplitude: Floats, peak: float) -> Floats:
    """``20 log10(amplitude / peak)``, dB; `FLOOR_DB` where the amplitude (or the whole signal) is zero."""
    ratio = np.asarray(amplitude, dtype=float) / peak if peak > 0 else np.zeros_like(amplitude, dtype=float)
    level: Floats = 20.0 * np.log10(np.maximum(ratio, 10.0 ** (FLOOR_DB / 20.0)))
    return level


def spectrum(time: Floats, x: Floats, settings: SpectrumSettings, excitation_hz: float, *of: str) -> Spectrum:
    """Spectrum of the last part of a record of samples, see `spectrum_of`.

    Samples are taken as they are: content beyond half the sample rate is aliased, and shows as lines of the kind
    "other".

    Parameters
    ----------
    time : (n,) s, equally spaced.
    x : (n,) the signal, in the unit.
    settings : part and window; a Hann window if it names none.
    excitation_hz : Hz, nan where there is no single excitation frequency.
    of : name of the probe, quantity and unit.

    Returns
    -------
    Spectrum

    Raises
    ------
    ValueError
        When the record is empty or its two arrays differ in length.
    """
    time = np.asarray(time, dtype=float)
    x = np.asarray(x, dtype=float)
    if x.ndim != 1 or x.size == 0 or time.shape != x.shape:
        raise ValueError(f"a spectrum needs a time history, got shapes {time.shape} and {x.shape}")
    rate = float((time.size - 1) / (time[-1] - time[0])) if time.size > 1 else 1.0
    length = _samples_analysed(time.size, rate, settings, excitation_hz)
    record = SampledRecord(time[-length:], x[-length:], rate)
    return spectrum_of(record, settings.window or "hann", excitation_hz, *of, chosen_hz=settings.frequencies)


def spectrum_of(
    record: SpectrumRecord, window: str, excitation_hz: float, *of: str, residual_hz: tuple[float, ...] = (),
    chosen_hz: tuple[float, ...] = (),
) -> Spectrum:  # fmt: skip
    r"""Single-sided peak-amplitude spectrum of a record, and its table of lines.

    With the window :math:`w` of the N samples of the record and :math:`\bar x` their weighted mean,

    .. math:: A_j = \frac{2}{\sum_n w_n} \Big| \sum_n w_n (x_n - \bar x) e^{-2 \pi i j n / N} \Big|, \quad
              A_0 = |\bar x|, \quad L_j = 20 \log_{10} \frac{A_j}{\max |x|}

    (the line at half the sample rate is not doubled); of a motion in closed form the sums are integrals. The division
    by :math:`\sum w` corrects the window's coherent gain: a sinusoid on a bin shows its own amplitude with every
    window; the mean is taken out first because it would otherwise leak into the first bins.

    Phases are those of :math:`A \sin(2 \pi f t + \varphi)` with the run's own time; that of the mean is
    0 or 180 degrees, its sign.

    Parameters
    ----------
    record : the part that is analysed.
    window : of the curve.
    excitation_hz : Hz, nan where there is no single excitation frequency.
    of : name of the probe, quantity and unit.
    residual_hz : Hz, frequencies that the vectors of a reduction's static deflections have, which mean nothing.
    chosen_hz : Hz, frequencies that are projected on and listed in any case, of the kind "chosen" where no order of the
        excitation has this frequency; they replace what is nearer than a bin.

    Returns
    -------
    Spectrum
        Up to the highest frequency that the record covers; the mean is the first line, the others follow by frequency.
        Without lines where the record is not finite.
    """
    (probe, quantity, unit), shape, levels = of, Window.named(window), record.levels()
    forced, peak = 0.0 < excitation_hz < np.inf, levels.peak
    examined = _examined(record, excitation_hz, shape.one_sided)
    curve = None if examined is None else record.amplitudes(examined)
    lines, unresolved = [], list[UnresolvedLine]()
    if np.isfinite(peak):
        candidates, mean, c = _lines(record, levels, examined, curve, excitation_hz, chosen_hz)
        remaining = np.full(c.size, np.nan)
        if curve is not None and examined is not None and c.size and not examined.one_sided:
            remainder = Remainder.of(record, np.array([k.frequency_hz for k in candidates]), c, examined, curve)
            remaining = remainder.size / np.abs(c)
            many = np.flatnonzero(remaining > ALLOWED_REMAINDER).tolist()
            unresolved = [_unresolved(remainder, k, candidates[k], record.duration, float(remaining[k])) for k in many]
        every = np.append(mean + 0j, c)
        size, phase = np.abs(every), np.degrees(np.angle(every))
        each = zip(size.tolist(), amplitude_db(size, peak).tolist(), phase.tolist(), strict=True)
        lines = [SpectralLine(0.0 if forced else np.nan, 0.0, *next(each), "mean", np.nan)]
        for k, of_line, left in zip(candidates, each, remaining.tolist(), strict=True):
            order = k.frequency_hz / excitation_hz if forced else np.nan
            kind = _kind_of(k, chosen_hz, residual_hz, 2.0 / record.duration)
            lines.append(SpectralLine(order, k.frequency_hz, *of_line, kind, left))
    amplitude = np.abs(record.amplitudes(shape))
    return Spectrum(
        probe=probe,
        quantity=quantity,
        unit=unit,
        frequency_hz=np.arange(amplitude.size) / record.duration,
        amplitude=amplitude,
        amplitude_db=amplitude_db(amplitude, peak),
        excitation_hz=excitation_hz,
        window=window,
        start_s=record.start,
        duration_s=record.duration,
        lines=tuple(lines),
        unresolved=tuple(unresolved),
        rate_hz=record.rate if isinstance(record, SampledRecord) else None,
        rms=levels.rms,
    )


def _unresolved(remainder: Remainder, k: int, line: _Candidate, duration: float, share: float) -> UnresolvedLine:
    """What is known of a line, number k, that leaves a share of its amplitude: it is several lines, or changes."""
    (low, high), _ = remainder.best_pair([k], None)
    needed = LOBE / abs(high - low) * duration if abs(high - low) < LOBE else np.nan
    return UnresolvedLine(line.frequency_hz, share, LOBE / duration, float(needed))


def found_again(record: SpectrumRecord, known: Spectrum) -> tuple[Floats, Floats]:
    """Frequencies (k,), Hz, and amplitudes (k,) of the lines of a spectrum, the mean first, in another record.

    The lines of the other record are found as those of the spectrum were. Orders of the excitation keep their
    frequency. Any other line is sought near its own, since a natural frequency depends on the model, but no nearer to
    another line. A line that the other record does not have is fitted at its old frequency, together with those found.
    """
    lines, excitation_hz = known.lines[1:], known.excitation_hz
    wanted = np.array([line.frequency_hz for line in lines])
    examined = _examined(record, excitation_hz, Window.named(known.window).one_sided)
    curve = None if examined is None else record.amplitudes(examined)
    candidates, mean, c = _lines(record, record.levels(), examined, curve, excitation_hz, ())
    found = np.array([k.frequency_hz for k in candidates])
    partner = np.full(wanted.size, -1)
    between = np.concatenate([[-np.inf], 0.5 * (wanted[1:] + wanted[:-1]), [np.inf]])  # lines are in order of frequency
    for k, line in enumerate(lines):
        away = np.abs(found - wanted[k])
        near = away <= _ROUND_OFF * wanted[k]
        if line.kind in ("other", "residual"):
            near = (away <= max(NEARBY_BINS / record.duration, NEARBY * wanted[k])) & (
                np.abs(c) >= 0.5 * line.amplitude
            )
            near &= (found > between[k]) & (found < between[k + 1])
        if near.any():
            partner[k] = np.where(near, away, np.inf).argmin()
    missing = partner < 0
    if missing.any():
        partner[missing] = found.size + np.arange(np.count_nonzero(missing))
        found = np.append(found, wanted[missing])
        mean, c = record.project(found, examined)
    return np.append(0.0, found[partner]), np.abs(np.append(mean, c[partner]))


def _examined(record: SpectrumRecord, excitation_hz: float, one_sided: bool) -> Window | None:
    """The window through which lines are seen; None where the record holds a few periods of the excitation alone."""
    short = np.isfinite(excitation_hz) and 0 < excitation_hz * record.duration < 2 * LOBE
    return None if short else Window.named("blackmanharris", one_sided)


def _samples_analysed(available: int, rate: float, settings: SpectrumSettings, excitation_hz: float) -> int:
    length = min(max(round(rate * _duration(settings, available / rate, excitation_hz)), 1), available)
    forced = np.isfinite(excitation_hz) and excitation_hz > 0
    if length < available or settings.last is not None or not forced or available == 1:
        return length
    # A record sampled at both of its ends holds one sample more than its periods do.
    periods = excitation_hz / rate
    return min((available - 1, available), key=lambda n: abs(n * periods - round(n * periods)))


@dataclass(frozen=True)
class _Candidate:
    order: Fraction | None  # None: belongs to no order
    frequency_hz: float  # exact for an order, interpolated otherwise
    peak_hz: float  # interpolated


def _lines(
    record: SpectrumRecord,
    levels: Levels,
    window: Window | None,
    curve: Complexes | None,
    excitation_hz: float,
    chosen_hz: tuple[float, ...],
) -> tuple[list[_Candidate], float, Complexes]:
    """Lines of a spectrum by frequency, the mean, and complex amplitudes (k,) of the lines; see `spectrum_of`.

    The record is examined once more with a Blackman–Harris window (side lobes at -92 dB), whatever window was asked
    for; with the falling half of it where the window is ``decaying``. A local maximum is a line when it lies less than
    60 dB below the largest one (and 86 dB below the largest deviation from the mean) and at least 20 dB above the noise
    floor around it: the lower quartile of the spectrum within one excitation frequency, at least 32 bins, on either
    side (10 dB, and an octave on either side, in a ``decaying`` window, where damping makes lines broad). It belongs to
    the order m/n (n up to 4, as long as the excitation frequency over n is at least 4 bins) when its interpolated
    frequency is within half a bin of it and it is locked to the excitation: its complex amplitudes in the two halves of
    the record differ by less than half. The fundamental need not be locked. What belongs to no order (a decaying
    transient, or everything when there is no excitation frequency) is of the kind "other", or "residual" at a frequency
    of ``residual_hz``. Amplitude and phase come from the least-squares projection on the exact frequencies of all lines
    together, so no line leaks into another, weighted by the Blackman–Harris window, so that nothing else leaks into
    them. Of a motion in closed form the projection is that of the continuous motion, see
    `beamsim.signals.records`. A record of 1 to 8 excitation periods is projected on the orders 1 to 10 directly,
    as far as its spectrum goes, with the residual as noise floor; below one period only the mean is known. The mean is
    always listed, at most 50 lines beside it.
    """
    if window is None or curve is None:
        periods = excitation_hz * record.duration
        candidates = _orders_of_short_record(record, excitation_hz, levels.peak) if periods >= 1 - _ROUND_OFF else []
    else:
        candidates = _peaks(record, window, excitation_hz, levels, np.abs(curve))
        if 0.0 < excitation_hz < np.inf and candidates:
            candidates = _only_locked(record, candidates)
        candidates = _fitted(record, candidates, window)
        if candidates and not window.one_sided:
            candidates = _separated(record, candidates, window, excitation_hz, curve)
    candidates = sorted(
        _with_chosen(candidates, chosen_hz, record) if chosen_hz else candidates, key=attrgetter("frequency_hz")
    )
    window = window if candidates else None
    mean, c = record.project(np.array([k.frequency_hz for k in candidates]), window)
    worth = np.abs(c) >= WORTH_LISTING * np.abs(c).max(initial=0.0)
    worth |= np.array([k.frequency_hz in chosen_hz for k in candidates], dtype=bool)
    if not worth.all():  # what leaks from others into the curve is no line
        candidates = [k for k, listed in zip(candidates, worth, strict=True) if listed]
        mean, c = record.project(np.array([k.frequency_hz for k in candidates]), window)
    return candidates, mean, c


def _kind_of(
    candidate: _Candidate, chosen_hz: tuple[float, ...], residual_hz: tuple[float, ...], near_hz: float
) -> str:
    """The kind of a line; one is "residual" that is near to a frequency of a static vector."""
    if candidate.order is not None:  # every order that is not whole is a subharmonic one
        whole = "fundamental" if candidate.order == 1 else "superharmonic"
        return "subharmonic" if candidate.order.denominator > 1 else whole
    if candidate.frequency_hz in chosen_hz:
        return "chosen"
    return "residual" if any(abs(candidate.frequency_hz - f) <= near_hz for f in residual_hz) else "other"


def _with_chosen(
    candidates: list[_Candidate], chosen_hz: tuple[float, ...], record: SpectrumRecord
) -> list[_Candidate]:
    """Chosen frequencies instead of what is nearer than a bin; an order that has one is that line."""
    bin_hz = 1.0 / record.duration
    added = [
        _Candidate(None, f, f)
        for f in chosen_hz
        if not any(c.order is not None and abs(c.frequency_hz - f) <= _ROUND_OFF * f for c in candidates)
    ]
    apart = [c for c in candidates if all(abs(c.frequency_hz - other.frequency_hz) >= bin_hz for other in added)]
    return apart + added


def _fitted(record: SpectrumRecord, candidates: list[_Candidate], window: Window) -> list[_Candidate]:
    """The candidates with the frequencies that fit best of all that belong to no order."""
    free = np.array([c.order is None for c in candidates], dtype=bool)
    frequency = refined(record, np.array([c.frequency_hz for c in candidates]), free, window)
    return [replace(c, frequency_hz=float(f)) for c, f in zip(candidates, frequency, strict=True)]


def _separated(
    record: SpectrumRecord, candidates: list[_Candidate], window: Window, excitation_hz: float, curve: Complexes
) -> list[_Candidate]:
    """The candidates, with two lines wherever two explain the curve near a candidate that is none of a steady line.

    The two replace it and, where they then explain the curve too, the candidate nearest to it: two lines of opposite
    phase have two maxima that are farther apart than they are.
    """

    def fit(lines: list[_Candidate]) -> tuple[Complexes, Remainder]:
        """Amplitudes (k,) of lines that are fitted together, and what they leave."""
        frequency = np.array([c.frequency_hz for c in lines])
        amplitude = record.project(frequency, window)[1]
        return amplitude, Remainder.of(record, frequency, amplitude, window, curve)

    tried, fits = set[float](), 0
    amplitude, remainder = fit(candidates)
    while fits < _MOST_PAIRS and len(candidates) < min(_MOST_LINES, (record.size - 1) // 4):
        least = WORTH_LISTING * float(np.abs(amplitude).max())
        sizes = [0.0 if c.peak_hz in tried else float(x) for c, x in zip(candidates, remainder.size, strict=True)]
        k = int(np.argmax(sizes))
        if sizes[k] <= least:
            break
        tried.add(candidates[k].peak_hz)
        for replaced in _replaceable(candidates, k, record.duration):
            order = next((candidates[number] for number in replaced if candidates[number].order is not None), None)
            known = None if order is None else order.frequency_hz * record.duration
            pair, ratio = remainder.best_pair(replaced, known)
            if ratio > _PROMISING:
                continue
            fits += 1
            two = [_Candidate(None, f / record.duration, f / record.duration) for f in pair]
            two[:1] = two[:1] if order is None else [order]
            others = [c for number, c in enumerate(candidates) if number not in replaced]
            several = _on_orders(_fitted(record, [*others, *two], window), excitation_hz, record)
            found = fit(several)
            if found[1].size[-2:].max() <= _SEPARATED * sizes[k]:
                candidates, (amplitude, remainder) = several, found
                break
    return candidates


def _replaceable(candidates: list[_Candidate], k: int, duration: float) -> Iterator[list[int]]:
    """Numbers of candidates that a pair may replace: one and its neighbour within a lobe, and it alone."""
    distance = np.array([abs(c.frequency_hz - candidates[k].frequency_hz) for c in candidates]) * duration
    distance[k] = np.inf
    nearest = int(distance.argmin())
    if distance[nearest] <= LOBE and (candidates[k].order is None or candidates[nearest].order is None):
        yield [k, nearest]
    yield [k]


def _on_orders(candidates: list[_Candidate], excitation_hz: float, record: SpectrumRecord) -> list[_Candidate]:
    """The candidates, of which the last two belong to an order where they have its frequency and no other one does."""
    if not (np.isfinite(excitation_hz) and excitation_hz > 0):
        return candidates
    named = candidates[:-2]
    for c in candidates[-2:]:
        order = _nearest_order(c.frequency_hz, excitation_hz, 1.0 / record.duration)
        exact = np.nan if order is None else float(order) * excitation_hz
        of_order = abs(exact - c.frequency_hz) * record.duration <= _ON_ORDER and order not in {n.order for n in named}
        named = [*named, replace(c, order=order, frequency_hz=exact) if of_order else c]
    return named


def _peaks(
    record: SpectrumRecord, window: Window, excitation_hz: float, levels: Levels, amplitude: Floats
) -> list[_Candidate]:
    """Local maxima of a curve (F,) that are lines, strongest first, each with the order its frequency suggests."""
    inner = np.arange(LOBE - 1, amplitude.size - 1)
    if inner.size == 0:
        return []
    bin_hz = 1.0 / record.duration
    forced = np.isfinite(excitation_hz)
    top = inner[(amplitude[inner] > amplitude[inner - 1]) & (amplitude[inner] >= amplitude[inner + 1])]
    if top.size == 0:
        return []
    side_lobes = _OVER_SIDE_LOBES * levels.deviation
    least = max(WORTH_LISTING * float(np.max(amplitude[top])), side_lobes, _ROUND_OFF * levels.peak)
    top = top[amplitude[top] >= least]
    top = top[np.argsort(-amplitude[top])][: 4 * _MOST_LINES]
    reach = max(32, round(excitation_hz / bin_hz)) if forced else 32
    candidates: dict[Fraction | float, _Candidate] = {}
    for j in top:
        low, high = (
            (j - reach, j + reach + 1) if not window.one_sided else (min(j - reach, j // 2), max(j + reach, 2 * j))
        )
        around = amplitude[max(1, low) : high]
        place = 0.25 * (around.size - 1)  # of the lower quartile; np.percentile spends ten times as long on few values
        first, second = int(place), min(int(place) + 1, around.size - 1)
        ordered = np.partition(around, (first, second))
        floor = float(ordered[first] + (place - first) * (ordered[second] - ordered[first]))
        if amplitude[j] < (_OVER_FLOOR if not window.one_sided else _OVER_SKIRTS) * floor:
            continue
        frequency = (int(j) + parabola_top(amplitude[j - 1 : j + 2])) / record.duration
        order = _nearest_order(frequency, excitation_hz, bin_hz) if forced else None
        exact = frequency if order is None else float(order) * excitation_hz
        candidates.setdefault(frequency if order is None else order, _Candidate(order, exact, frequency))
        if len(candidates) == min(_MOST_LINES, (record.size - 1) // 4):
            break
    return list(candidates.values())


def _nearest_order(frequency: float, excitation_hz: float, bin_hz: float) -> Fraction | None:
    for n in _DENOMINATORS:
        if excitation_hz / n < LOBE * bin_hz:
            break
        m = round(frequency * n / excitation_hz)
        if m >= 1 and abs(m * excitation_hz / n - frequency) <= 0.5 * bin_hz:
            return Fraction(m, n)
    return None


def _only_locked(record: SpectrumRecord, candidates: list[_Candidate]) -> list[_Candidate]:
    """Take the order away from what does not keep its amplitude and phase relative to the excitation."""
    frequency = np.array([k.frequency_hz for k in candidates])
    (_, early), (_, late) = (half.project(frequency) for half in record.halves())
    locked = np.abs(late - early) <= 0.5 * np.maximum(np.abs(late), np.abs(early))
    return [
        k if k.order is None or k.order == 1 or steady else _Candidate(None, k.peak_hz, k.peak_hz)
        for k, steady in zip(candidates, locked, strict=True)
    ]


def _orders_of_short_record(record: SpectrumRecord, excitation_hz: float, peak: float) -> list[_Candidate]:
    known = int(record.highest_hz / excitation_hz * (1 + 1e-12))
    highest = min(_ORDERS_OF_A_SHORT_RECORD, known, (record.size - 1) // 4)
    frequency = excitation_hz * np.arange(1, highest + 1, dtype=np.float64)
    if frequency.size == 0:
        return []
    _, c = record.project(frequency)
    floor = record.residual(frequency) * float(np.sqrt(2.0 / record.size))
    amplitude = np.abs(c)
    limit = max(WORTH_LISTING * float(np.max(amplitude)), _OVER_FLOOR * floor, _ROUND_OFF * peak)
    return [
        _Candidate(Fraction(m), float(f), float(f))
        for m, f, a in zip(range(1, highest + 1), frequency, amplitude, strict=True)
        if a >= limit
    ]
