"""Single-sided spectra of time histories and of motions in closed form, and the table of their lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.run.layouts import SPECTRA
from beamsim.analyses.run.motion import RunMotion
from beamsim.analyses.run.result import ALLOWED_REMAINDER, MAIN_QUANTITY
from beamsim.flow.channels import MotionPart, outputs_of
from beamsim.flow.trajectory import Trajectory
from beamsim.labelled import Dataset
from beamsim.outcomes import check_stop
from beamsim.results.values import ACCELERATION, DISPLACEMENT
from beamsim.scenario import Scenario
from beamsim.scenario.run import MOST_FREQUENCIES, SpectrumSettings
from beamsim.signals.records import (
    LOBE,
    Levels,
    MotionRecord,
    Remainder,
    SpectrumRecord,
    Window,
    amplitude_db,
    analysed_duration,
    parabola_top,
    refined,
    sampled_records,
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
# The rule for a line, see `lines_of`.
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


def resting(name: str, quantity: str, figures: Mapping[str, Any]) -> bool:
    """Whether a quantity of a probe is 0 but for round-off, of which lines and root mean squares say nothing.

    Parameters
    ----------
    name, quantity : as a spectrum names them.
    figures : values of the motion or the summary, in which such a peak is 0.

    Returns
    -------
    False of other quantities than displacement, absolute acceleration and those of outputs.
    """
    peak = {"displacement": "peak_displacement_m", MAIN_QUANTITY: "peak_acceleration_g"}.get(quantity, "peak_output")
    return bool(figures.get(peak, {}).get(name) == 0.0)


class Label(NamedTuple):
    """Of which signal a spectrum is."""

    name: str  # of the probe or output
    quantity: str
    unit: str

    @property
    def signal(self) -> str:
        """Name and quantity."""
        return f"{self.name} {self.quantity}"


def spectra_of(motion: RunMotion, figures: Mapping[str, Any]) -> Dataset | None:
    """Spectra of every probe and output, whatever the output rate; of a time-stepped motion those of its samples.

    Parameters
    ----------
    motion : of which the last part is looked at; its scenario says what is asked for.
    figures : values of the motion; what rests by them has no lines.

    Returns
    -------
    `SPECTRA`; None without a probe and an output.
    """
    system = motion.system
    settings, excitation_hz = not_none(system.scenario.run).spectrum, system.excitation_frequency_hz
    channels, trajectory = spectral(system), motion.trajectory
    labels = [Label(channel.name, channel.quantity, channel.unit) for channel in channels.channels]
    if not labels:
        return None
    if trajectory is None or trajectory.end <= 0.0:
        histories = not_none(motion.histories)
        samples = np.hstack([histories.of(key) for key in channels.places]).T
        return spectra_of_samples(histories.time, samples, labels, settings, excitation_hz, figures)
    begin = trajectory.end - analysed_duration(trajectory.end, excitation_hz, settings.last, settings.periods)
    records = records_of(system, trajectory, channels, (begin, trajectory.end))
    windows = [settings.window or _suited_window(system.scenario, record) for record in records]
    kept = system.kept_modes
    residual = (*system.open_frequencies_hz[kept:], *system.closed_frequencies_hz[kept:])
    return _spectra(labels, records, windows, excitation_hz, figures, residual, settings.frequencies)


def spectra_of_samples(
    time: Floats, samples: Floats, labels: Sequence[Label], settings: SpectrumSettings, excitation_hz: float,
    figures: Mapping[str, Any],
) -> Dataset:  # fmt: skip
    """Spectra of the last part of records of samples.

    Parameters
    ----------
    time, samples, excitation_hz : as of `sampled_records`.
    settings : which part; a Hann window if they name none.
    labels : (K,) of the signals.
    figures : as of `spectra_of`.

    Returns
    -------
    `SPECTRA`.
    """
    records = sampled_records(time, samples, excitation_hz, settings.last, settings.periods)
    windows = [settings.window or "hann"] * len(records)
    return _spectra(labels, records, windows, excitation_hz, figures, (), settings.frequencies, records[0].rate)


def _spectra(
    labels: Sequence[Label], records: Sequence[SpectrumRecord], windows: Sequence[str], excitation_hz: float,
    figures: Mapping[str, Any], residual_hz: Sequence[float], chosen_hz: Sequence[float], rate_hz: float | None = None,
) -> Dataset:  # fmt: skip
    r"""Single-sided peak-amplitude spectra of records of one part of a motion, and the table of their lines.

    With the window :math:`w` of the N samples of the record and :math:`\bar x` their weighted mean,

    .. math:: A_j = \frac{2}{\sum_n w_n} \Big| \sum_n w_n (x_n - \bar x) e^{-2 \pi i j n / N} \Big|, \quad
              A_0 = |\bar x|, \quad L_j = 20 \log_{10} \frac{A_j}{\max |x|}

    (the line at half the sample rate is not doubled); of a motion in closed form the sums are integrals. The division
    by :math:`\sum w` corrects the window's coherent gain: a sinusoid on a bin shows its own amplitude with every
    window; the mean is taken out first because it would otherwise leak into the first bins. Spectra go up to the
    highest frequency that the records cover.

    Phases of lines are those of :math:`A \sin(2 \pi f t + \varphi)` with the run's own time; that of the mean is
    0 or 180 degrees, its sign. The mean is the first line, the others follow by frequency. There are none where a
    record is not finite.

    Parameters
    ----------
    labels, records, windows : of each signal, the part that is analysed, and the window of its curve.
    excitation_hz : Hz, nan where there is no single excitation frequency.
    figures : as of `spectra_of`.
    residual_hz : Hz, frequencies that the vectors of a reduction's static deflections have, which mean nothing.
    chosen_hz : Hz, frequencies that are projected on and listed in any case, of the kind "chosen" where no order of the
        excitation has this frequency; they replace what is nearer than a bin.
    rate_hz : Hz, of samples.
    """
    forced, duration = 0.0 < excitation_hz < np.inf, records[0].duration
    curves, levels = [], [record.levels() for record in records]
    columns: dict[str, list[Any]] = {name: [] for name in SPECTRA.variables if name.startswith("line_")}
    for number, (label, record, window) in enumerate(zip(labels, records, windows, strict=True)):
        check_stop()
        shape = Window.named(window)
        curves.append(np.abs(record.amplitudes(shape)))
        if resting(label.name, label.quantity, figures) or not np.isfinite(levels[number].peak):
            continue
        fit = lines_of(record, levels[number], shape.one_sided, excitation_hz, chosen_hz)
        every, frequency = np.append(fit.mean + 0j, fit.amplitude), np.array([0.0, *fit.frequency_hz])
        size, none = np.abs(every), np.full(every.size, np.nan)
        remainder, separating = none.copy(), none.copy()
        if fit.remainder is not None:
            remainder[1:] = fit.remainder.size / size[1:]
            many = np.flatnonzero(remainder > ALLOWED_REMAINDER)
            if many.size:
                pairs, _ = fit.remainder.best_pairs([[k - 1] for k in many.tolist()], [np.nan] * many.size)
                apart = np.abs(np.diff(pairs)[:, 0])
                separating[many] = np.where(apart < LOBE, LOBE / apart * duration, np.nan)
        of_lines = {
            "signal": [number] * size.size,
            "order": frequency / excitation_hz if forced else none,
            "frequency_hz": frequency,
            "amplitude": size,
            "amplitude_db": amplitude_db(size, levels[number].peak),
            "phase_deg": np.degrees(np.angle(every)),
            "kind": ["mean", *(_kind_of(line, chosen_hz, residual_hz, 2.0 / duration) for line in fit.lines)],
            "remainder": remainder,
            "separating_duration_s": separating,
            "relative_change": none,
        }
        for name, values in of_lines.items():
            columns[f"line_{name}"].extend(values)
    amplitude = np.array(curves)
    values = {
        "excitation_hz": excitation_hz,
        "start_s": records[0].start,
        "duration_s": duration,
        "resolution_hz": LOBE / duration,
        "rate_hz": rate_hz,
        "signal": [label.signal for label in labels],
        "name": [label.name for label in labels],
        "quantity": [label.quantity for label in labels],
        "window": windows,
        "rms": [level.rms for level in levels],
        "frequency_hz": np.arange(amplitude.shape[1]) / duration,
        "amplitude": amplitude,
        "amplitude_db": np.array([amplitude_db(x, level.peak) for x, level in zip(curves, levels, strict=True)]),
        "line": 1 + np.arange(len(columns["line_signal"])),
        **columns,
    }
    return SPECTRA.dataset(values, {"signal": [{"unit": label.unit} for label in labels]})


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
    if trajectory is None or trajectory.end <= 0.0:
        return _aliasing_notes(motion)
    settings = not_none(system.scenario.run).spectrum
    duration = analysed_duration(trajectory.end, system.excitation_frequency_hz, settings.last, settings.periods)
    shown, highest = MOST_FREQUENCIES / duration, _highest_kept(system)
    if shown >= highest or _highest_shown(system, trajectory, duration) < shown or not spectral(system).channels:
        return []
    return [
        f"spectra end at {shown:.4g} Hz, their {MOST_FREQUENCIES}th frequency, and the highest mode kept has "
        f"{highest:.4g} Hz; analyse a shorter part of the run (run.spectrum.last)"
    ]


def _highest_kept(system: StructuralSystem) -> float:
    """Frequency of the highest mode kept, Hz."""
    return float(system.closed_frequencies_hz[: system.kept_modes].max(initial=0.0))


def _aliasing_notes(motion: RunMotion) -> list[str]:
    """A note where spectra are made of samples of a time-stepped motion that do not cover every mode kept."""
    time, highest = not_none(motion.histories).time, _highest_kept(motion.system)
    rate = float((time.size - 1) / (time[-1] - time[0])) if time.size > 1 else 1.0
    if rate >= 2.0 * highest or motion.trajectory is not None or not spectral(motion.system).channels:
        return []
    return [
        f"spectra are made of samples at {rate:g} Hz, and the highest mode kept has {highest:.4g} Hz: content "
        f"above {0.5 * rate:g} Hz is aliased; raise run.sample_rate"
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


class SpectralLine(NamedTuple):
    """A line that is looked for in a record."""

    order: Fraction | None  # None: belongs to no order
    frequency_hz: float  # exact for an order, interpolated otherwise
    peak_hz: float  # interpolated


class View(NamedTuple):
    """How the lines of a record are seen: its complex amplitudes (F,) under a window."""

    window: Window
    curve: Complexes


class LineFit(NamedTuple):
    """Lines that were fitted together."""

    lines: list[SpectralLine]
    mean: float
    amplitude: Complexes  # (k,) with the phases in the run's own time
    remainder: Remainder | None  # what they leave; None without lines, under half a window, and without a view

    @property
    def frequency_hz(self) -> list[float]:
        """(k,)."""
        return [line.frequency_hz for line in self.lines]


def fit_lines(record: SpectrumRecord, lines: list[SpectralLine], view: View | None) -> LineFit:
    """LineFit lines to a record by least squares, so that none leaks into another; by frequency."""
    lines = sorted(lines, key=lambda line: line.frequency_hz)
    frequency, seen = np.array([line.frequency_hz for line in lines]), view if lines else None
    mean, amplitude = record.project(frequency, None if seen is None else seen.window)
    remainder = None
    if seen is not None and not seen.window.one_sided:
        remainder = Remainder.of(record, frequency, amplitude, *seen)
    return LineFit(lines, mean, amplitude, remainder)


def view_of(record: SpectrumRecord, excitation_hz: float, one_sided: bool) -> View | None:
    """How lines are seen; None where the record holds a few periods of the excitation alone."""
    if 0.0 < excitation_hz * record.duration < 2 * LOBE:
        return None
    window = Window.named("blackmanharris", one_sided)
    return View(window, record.amplitudes(window))


def lines_of(
    record: SpectrumRecord, levels: Levels, one_sided: bool, excitation_hz: float, chosen_hz: Sequence[float]
) -> LineFit:
    """Lines of a spectrum by frequency.

    The record is examined once more with a Blackman–Harris window (side lobes at -92 dB), whatever window was asked
    for; with the falling half of it where the window is ``decaying``. A local maximum is a line when it lies less than
    60 dB below the largest one (and 86 dB below the largest deviation from the mean) and at least 20 dB above the noise
    floor around it: the lower quartile of the spectrum within one excitation frequency, at least 32 bins, on either
    side (10 dB, and an octave on either side, in a ``decaying`` window, where damping makes lines broad). It belongs to
    the order m/n (n up to 4, as long as the excitation frequency over n is at least 4 bins) when its interpolated
    frequency is within half a bin of it and it is locked to the excitation: its complex amplitudes in the two halves of
    the record differ by less than half. The fundamental need not be locked. What belongs to no order (a decaying
    transient, or everything when there is no excitation frequency) is of the kind "other", or "residual" at a frequency
    of a static vector. Amplitude and phase come from the least-squares projection on the exact frequencies of all lines
    together, so no line leaks into another, weighted by the Blackman–Harris window, so that nothing else leaks into
    them. Of a motion in closed form the projection is that of the continuous motion, see
    `beamsim.signals.records`. A record of 1 to 8 excitation periods is projected on the orders 1 to 10 directly,
    as far as its spectrum goes, with the residual as noise floor; below one period only the mean is known. The mean is
    always listed, at most 50 lines beside it.

    Parameters
    ----------
    record, levels : the part that is analysed, and how large it is.
    one_sided : whether the beginning counts most.
    excitation_hz : Hz, nan where there is no single excitation frequency.
    chosen_hz : Hz, see `_spectra`.
    """
    view = view_of(record, excitation_hz, one_sided)
    if view is None:
        fit = fit_lines(record, _orders_of_short_record(record, excitation_hz, levels.peak), None)
    else:
        lines = _peaks(record, view, excitation_hz, levels)
        if 0.0 < excitation_hz < np.inf and lines:
            lines = _only_locked(record, lines)
        fit = fit_lines(record, _refined(record, lines, view), view)
        if fit.remainder is not None:
            fit = _separated(record, fit, excitation_hz, view)
    if chosen_hz:
        fit = fit_lines(record, _with_chosen(fit.lines, chosen_hz, record), view)
    size = np.abs(fit.amplitude)
    least = WORTH_LISTING * size.max(initial=0.0)
    worth = [x >= least or line.frequency_hz in chosen_hz for line, x in zip(fit.lines, size.tolist(), strict=True)]
    if not all(worth):  # what leaks from others into the curve is no line
        fit = fit_lines(record, [line for line, listed in zip(fit.lines, worth, strict=True) if listed], view)
    return fit


def found_again(record: SpectrumRecord, known: Dataset) -> tuple[Floats, Floats]:
    """Frequencies (k,), Hz, and amplitudes (k,) of the lines of a signal, the mean first, in another record.

    The lines of the other record are found as those of the signal were. Orders of the excitation keep their frequency.
    Any other line is the nearest one of at least half its size, since a natural frequency depends on the model, but no
    nearer to another line. A line that the other record does not have is fitted at its old frequency, together with
    those found.

    Parameters
    ----------
    record : of the other motion.
    known : `SPECTRA` with the lines of the signal alone.
    """
    size, level, every_hz = (known[f"line_{name}"].values for name in ("amplitude", "amplitude_db", "frequency_hz"))
    if not size.any():  # of a signal that rests
        return every_hz, size
    excitation_hz, one_sided = known["excitation_hz"].item(), Window.named(known["window"].item()).one_sided
    peak = float(size.max() / 10.0 ** (level[size.argmax()] / 20.0))
    fit = lines_of(record, Levels(peak, peak, peak), one_sided, excitation_hz, ())
    frequency, found, kinds = every_hz[1:], np.array(fit.frequency_hz), known["line_kind"].values[1:]
    away, free = np.abs(found - frequency[:, None]), np.isin(kinds, ("other", "residual"))
    reach = np.where(free, np.maximum(NEARBY_BINS / record.duration, NEARBY * frequency), _ROUND_OFF * frequency)
    between = np.concatenate([[-np.inf], 0.5 * (frequency[1:] + frequency[:-1]), [np.inf]])[:, None]
    own = (found > between[:-1]) & (found < between[1:]) & (np.abs(fit.amplitude) >= 0.5 * size[1:, None])
    away = np.where((away <= reach[:, None]) & (own | ~free[:, None]), away, np.inf)
    partner = away.argmin(axis=1) if found.size else np.zeros(frequency.size, dtype=np.int64)
    missing, mean, amplitude = np.isinf(away.min(axis=1, initial=np.inf)), fit.mean, fit.amplitude
    if missing.any():
        partner[missing] = found.size + np.arange(np.count_nonzero(missing))
        found = np.append(found, frequency[missing])
        view = view_of(record, excitation_hz, one_sided)
        mean, amplitude = record.project(found, None if view is None else view.window)
    return np.append(0.0, found[partner]), np.abs(np.append(mean, amplitude[partner]))


def _kind_of(line: SpectralLine, chosen_hz: Sequence[float], residual_hz: Sequence[float], near_hz: float) -> str:
    """The kind of a line; one is "residual" that is near to a frequency of a static vector."""
    if line.order is not None:  # every order that is not whole is a subharmonic one
        whole = "fundamental" if line.order == 1 else "superharmonic"
        return "subharmonic" if line.order.denominator > 1 else whole
    if line.frequency_hz in chosen_hz:
        return "chosen"
    return "residual" if any(abs(line.frequency_hz - f) <= near_hz for f in residual_hz) else "other"


def _with_chosen(lines: list[SpectralLine], chosen_hz: Sequence[float], record: SpectrumRecord) -> list[SpectralLine]:
    """Chosen frequencies instead of what is nearer than a bin; an order that has one is that line."""
    bin_hz = 1.0 / record.duration
    added = [
        SpectralLine(None, f, f)
        for f in chosen_hz
        if not any(of.order is not None and abs(of.frequency_hz - f) <= _ROUND_OFF * f for of in lines)
    ]
    apart = [of for of in lines if all(abs(of.frequency_hz - other.frequency_hz) >= bin_hz for other in added)]
    return apart + added


def _refined(
    record: SpectrumRecord, lines: list[SpectralLine], view: View, near_hz: Sequence[float] = ()
) -> list[SpectralLine]:
    """The lines with the frequencies that fit best of all that belong to no order, or of those near some alone."""
    frequency = np.array([line.frequency_hz for line in lines])
    free = np.array([line.order is None for line in lines], dtype=bool)
    if near_hz:
        free &= np.abs(np.subtract.outer(frequency, near_hz)).min(axis=1) <= 2 * LOBE / record.duration
    if not free.any():
        return lines
    found = refined(record, frequency, free, view.window).tolist()
    return [line._replace(frequency_hz=f) for line, f in zip(lines, found, strict=True)]


def _separated(record: SpectrumRecord, fit: LineFit, excitation_hz: float, view: View) -> LineFit:
    """The lines, with two lines wherever two explain the curve near one that is none of a steady line."""
    tried, fits = set[float](), _MOST_PAIRS
    while fits and len(fit.lines) < min(_MOST_LINES, (record.size - 1) // 4):
        better = None
        for replaced, pair in _promising_pairs(fit, tried, record.duration):
            fits -= 1
            better = _with_pair(record, fit, replaced, pair, excitation_hz, view)
            if better is not None or not fits:
                break
        if better is None:
            break
        fit = better
    return fit


def _promising_pairs(
    fit: LineFit, tried: set[float], duration: float
) -> Iterator[tuple[list[int], tuple[float, float]]]:  # fmt: skip
    """Pairs of lines that explain much of what lies near a line, from where most is left.

    Parameters
    ----------
    fit : the lines.
    tried : Hz, maxima that were looked at before, to which these are added.
    duration : s, of the record.

    Yields
    ------
    Numbers of the lines that a pair replaces, which are one and its neighbour within a lobe, or it alone: two lines of
    opposite phase have two maxima that are farther apart than they are. Then the frequencies of the pair in bins.
    """
    lines, remainder = fit.lines, not_none(fit.remainder)
    place, least = np.array(fit.frequency_hz) * duration, WORTH_LISTING * np.abs(fit.amplitude).max(initial=0.0)
    choices: list[list[int]] = []
    for k in np.argsort(-remainder.size, kind="stable").tolist():
        if remainder.size[k] <= least or lines[k].peak_hz in tried:
            continue
        distance = np.abs(place - place[k])
        distance[k] = np.inf
        nearest = int(distance.argmin())
        both = distance[nearest] <= LOBE and (lines[k].order is None or lines[nearest].order is None)
        choices += [[k, nearest], [k]] if both else [[k]]
    if not choices:
        return
    orders = [next((k for k in replaced if lines[k].order is not None), None) for replaced in choices]
    pairs, ratios = remainder.best_pairs(choices, [np.nan if k is None else float(place[k]) for k in orders])
    for replaced, pair, ratio in zip(choices, pairs.tolist(), ratios.tolist(), strict=True):
        tried.add(lines[replaced[0]].peak_hz)
        if ratio <= _PROMISING:
            yield replaced, pair


def _with_pair(
    record: SpectrumRecord,
    fit: LineFit,
    replaced: list[int],
    pair: tuple[float, float],
    excitation_hz: float,
    view: View,
) -> LineFit | None:
    """The lines with a pair, its frequencies in bins, in place of some; None where it does not explain the curve.

    Where the fit of the frequencies near the two leaves too much, that of all does, too.
    """
    order = next((fit.lines[k] for k in replaced if fit.lines[k].order is not None), None)
    two = [SpectralLine(None, f / record.duration, f / record.duration) for f in pair]
    two[:1] = two[:1] if order is None else [order]
    lines = [*(line for k, line in enumerate(fit.lines) if k not in replaced), *two]
    for near_hz in ([line.frequency_hz for line in two], ()):
        several = _on_orders(_refined(record, lines, view, near_hz), excitation_hz, record)
        frequency = np.array([line.frequency_hz for line in several])
        amplitude = record.project(frequency, view.window)[1]
        left = Remainder.of(record, frequency, amplitude, *view, near_hz=frequency[-2:])
        if left.size.max() > _SEPARATED * not_none(fit.remainder).size[replaced[0]]:
            return None
    return fit_lines(record, several, view)


def _on_orders(lines: list[SpectralLine], excitation_hz: float, record: SpectrumRecord) -> list[SpectralLine]:
    """The lines, of which the last two belong to an order where they have its frequency and no other one does."""
    if not 0.0 < excitation_hz < np.inf:
        return lines
    named = lines[:-2]
    for line in lines[-2:]:
        order = _nearest_order(line.frequency_hz, excitation_hz, 1.0 / record.duration)
        exact = np.nan if order is None else float(order) * excitation_hz
        away = abs(exact - line.frequency_hz) * record.duration
        of_order = away <= _ON_ORDER and order not in {of.order for of in named}
        named = [*named, line._replace(order=order, frequency_hz=exact) if of_order else line]
    return named


def _peaks(record: SpectrumRecord, view: View, excitation_hz: float, levels: Levels) -> list[SpectralLine]:
    """Local maxima of a curve that are lines, strongest first, each with the order its frequency suggests."""
    amplitude, one_sided = np.abs(view.curve), view.window.one_sided
    inner = np.arange(LOBE - 1, amplitude.size - 1)
    top = inner[(amplitude[inner] > amplitude[inner - 1]) & (amplitude[inner] >= amplitude[inner + 1])]
    largest = float(amplitude[top].max(initial=0.0))
    least = max(WORTH_LISTING * largest, _OVER_SIDE_LOBES * levels.deviation, _ROUND_OFF * levels.peak)
    top = top[amplitude[top] >= least]
    top = top[np.argsort(-amplitude[top])][: 4 * _MOST_LINES]
    forced = np.isfinite(excitation_hz)
    reach = max(32, round(excitation_hz * record.duration)) if forced else 32
    lines: dict[Fraction | float, SpectralLine] = {}
    for j in top.tolist():
        low, high = (min(j - reach, j // 2), max(j + reach, 2 * j)) if one_sided else (j - reach, j + reach + 1)
        around = amplitude[max(1, low) : high]
        place = 0.25 * (around.size - 1)  # of the lower quartile; np.percentile spends ten times as long on few values
        first, second = int(place), min(int(place) + 1, around.size - 1)
        ordered = np.partition(around, (first, second))
        floor = float(ordered[first] + (place - first) * (ordered[second] - ordered[first]))
        if amplitude[j] < (_OVER_SKIRTS if one_sided else _OVER_FLOOR) * floor:
            continue
        frequency = (j + parabola_top(amplitude[j - 1 : j + 2])) / record.duration
        order = _nearest_order(frequency, excitation_hz, 1.0 / record.duration) if forced else None
        exact = frequency if order is None else float(order) * excitation_hz
        lines.setdefault(frequency if order is None else order, SpectralLine(order, exact, frequency))
        if len(lines) == min(_MOST_LINES, (record.size - 1) // 4):
            break
    return list(lines.values())


def _nearest_order(frequency: float, excitation_hz: float, bin_hz: float) -> Fraction | None:
    for n in _DENOMINATORS:
        if excitation_hz / n < LOBE * bin_hz:
            break
        m = round(frequency * n / excitation_hz)
        if m >= 1 and abs(m * excitation_hz / n - frequency) <= 0.5 * bin_hz:
            return Fraction(m, n)
    return None


def _only_locked(record: SpectrumRecord, lines: list[SpectralLine]) -> list[SpectralLine]:
    """Take the order away from what does not keep its amplitude and phase relative to the excitation."""
    frequency = np.array([line.frequency_hz for line in lines])
    (_, early), (_, late) = (half.project(frequency) for half in record.halves())
    locked = np.abs(late - early) <= 0.5 * np.maximum(np.abs(late), np.abs(early))
    return [
        line if line.order is None or line.order == 1 or steady else SpectralLine(None, line.peak_hz, line.peak_hz)
        for line, steady in zip(lines, locked.tolist(), strict=True)
    ]


def _orders_of_short_record(record: SpectrumRecord, excitation_hz: float, peak: float) -> list[SpectralLine]:
    """The orders of the excitation in a record of a few of its periods; none of less than one."""
    known = int(record.highest_hz / excitation_hz * (1 + 1e-12))
    highest = min(_ORDERS_OF_A_SHORT_RECORD, known, (record.size - 1) // 4)
    if highest < 1 or excitation_hz * record.duration < 1 - _ROUND_OFF:
        return []
    frequency = excitation_hz * np.arange(1, highest + 1, dtype=np.float64)
    amplitude = np.abs(record.project(frequency)[1])
    floor = record.residual(frequency) * float(np.sqrt(2.0 / record.size))
    limit = max(WORTH_LISTING * float(np.max(amplitude)), _OVER_FLOOR * floor, _ROUND_OFF * peak)
    every = zip(range(1, highest + 1), frequency.tolist(), amplitude.tolist(), strict=True)
    return [SpectralLine(Fraction(m), f, f) for m, f, size in every if size >= limit]
