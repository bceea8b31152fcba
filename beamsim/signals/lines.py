"""Lines of a spectrum: which maxima of its curve are lines, which orders of the excitation they are, and their fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from beamsim.signals.records import LOBE, Levels, Remainder, SpectrumRecord, Window, parabola_top, refine_frequencies
from beamsim.typing import Complexes, Floats, not_none

# The rule for a line, see `lines_of`.
WORTH_LISTING = 1e-3  # of the largest line: 60 dB
_OVER_FLOOR = 10.0  # times the local noise floor: 20 dB
_OVER_SKIRTS = 10**0.5  # the same in a decaying record, whose lines are broad: 10 dB over an octave on either side
_OVER_SIDE_LOBES = 5e-5  # of the largest deviation from the mean: a drift's side lobes are no lines
ROUND_OFF = 1e-12  # of max |x|
_DENOMINATORS = (1, 2, 3, 4)  # of the orders m/n that are looked for
_SEPARATED = 0.02  # of what one line leaves near it, that two may leave
_PROMISING = 0.3  # the same for a pair on a grid of frequencies, which is then fitted with all lines
_ON_ORDER = 0.02  # bins from an order of the excitation, of one of two lines that were separated
_MOST_FAILURES = 3  # pairs of one spectrum that explain nothing, before its lines are taken as not steady
_MOST_LINES = 50
_FEWEST_BINS = 32  # on either side of a maximum, whose lower quartile is the floor around it
_ORDERS_OF_A_SHORT_RECORD = 10


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
    """Fit lines to a record by least squares, so that none leaks into another; by frequency."""
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
    window = Window.of_name("blackmanharris", one_sided)
    return View(window, record.amplitudes(window))


def lines_of(
    record: SpectrumRecord, levels: Levels, one_sided: bool, excitation_hz: float, chosen_hz: Sequence[float],
    unlocked_hz: Sequence[float] | None = None,
) -> LineFit:  # fmt: skip
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
    always listed, at most 50 lines in addition to it.

    Parameters
    ----------
    record, levels : the part that is analysed, and how large it is.
    one_sided : whether the beginning counts most.
    excitation_hz : Hz, nan where there is no single excitation frequency.
    chosen_hz : Hz, frequencies that are fitted in any case; they replace what is nearer than a bin.
    unlocked_hz : Hz, of lines that are not locked to the excitation, with all others locked; by default both halves of
        the record show which are.
    """
    view = view_of(record, excitation_hz, one_sided)
    if view is None:
        fit = fit_lines(record, _orders_of_short_record(record, excitation_hz, levels.peak), None)
    else:
        lines = _peaks(record, view, excitation_hz, levels)
        if 0.0 < excitation_hz < np.inf and lines:
            lines = _only_locked(record, lines, unlocked_hz)
        fit = fit_lines(record, _refine_frequencies(record, lines, view), view)
        if fit.remainder is not None:
            fit = _separate_pairs(record, fit, excitation_hz, view)
    if chosen_hz:
        fit = fit_lines(record, _with_chosen(fit.lines, chosen_hz, record), view)
    size = np.abs(fit.amplitude)
    least = WORTH_LISTING * size.max(initial=0.0)
    worth = [x >= least or line.frequency_hz in chosen_hz for line, x in zip(fit.lines, size.tolist(), strict=True)]
    if not all(worth):  # what leaks from others into the curve is no line
        fit = fit_lines(record, [line for line, listed in zip(fit.lines, worth, strict=True) if listed], view)
    return fit


def _with_chosen(lines: list[SpectralLine], chosen_hz: Sequence[float], record: SpectrumRecord) -> list[SpectralLine]:
    """Chosen frequencies instead of what is nearer than a bin; an order that has one is that line."""
    bin_hz = 1.0 / record.duration
    added = [
        SpectralLine(None, f, f)
        for f in chosen_hz
        if not any(of.order is not None and abs(of.frequency_hz - f) <= ROUND_OFF * f for of in lines)
    ]
    apart = [of for of in lines if all(abs(of.frequency_hz - other.frequency_hz) >= bin_hz for other in added)]
    return apart + added


def _refine_frequencies(
    record: SpectrumRecord, lines: list[SpectralLine], view: View, near_hz: Sequence[float] = ()
) -> list[SpectralLine]:
    """The lines with the frequencies that fit best of all that belong to no order, or of those near some alone."""
    frequency = np.array([line.frequency_hz for line in lines])
    free = np.array([line.order is None for line in lines], dtype=bool)
    if near_hz:
        free &= np.abs(np.subtract.outer(frequency, near_hz)).min(axis=1) <= 2 * LOBE / record.duration
    if not free.any():
        return lines
    found = refine_frequencies(record, frequency, free, view.window).tolist()
    return [line._replace(frequency_hz=f) for line, f in zip(lines, found, strict=True)]


def _separate_pairs(record: SpectrumRecord, fit: LineFit, excitation_hz: float, view: View) -> LineFit:
    """The lines, with two lines wherever two explain the curve near one that is none of a steady line.

    After `_MOST_FAILURES` pairs that explain nothing, from where most is left, amplitudes change: no other is tried.
    """
    tried, failures = set[float](), 0
    while len(fit.lines) < min(_MOST_LINES, (record.size - 1) // 4):
        better = None
        for replaced, pair in _promising_pairs(fit, tried, record.duration):
            better = _with_pair(record, fit, replaced, pair, excitation_hz, view)
            failures += better is None
            if better is not None or failures == _MOST_FAILURES:
                break
        if better is None:
            break
        fit = better
    return fit


def _promising_pairs(
    fit: LineFit, examined: set[float], duration: float
) -> Iterator[tuple[list[int], tuple[float, float]]]:  # fmt: skip
    """Pairs of lines that explain much of what lies near a line, from where most is left.

    Parameters
    ----------
    fit : the lines.
    examined : Hz, maxima that were looked at before, to which these are added.
    duration : s, of the record.

    Yields
    ------
    Numbers of the lines that a pair replaces, which are one and its neighbour within a lobe, or it alone: two lines of
    opposite phase have two maxima that are farther apart than they are. Then the frequencies of the pair in bins.
    """
    lines, remainder = fit.lines, not_none(fit.remainder)
    place, least = np.array(fit.frequency_hz) * duration, WORTH_LISTING * np.abs(fit.amplitude).max(initial=0.0)
    worth = [
        k
        for k in np.argsort(-remainder.size, kind="stable").tolist()
        if remainder.size[k] > least and lines[k].peak_hz not in examined
    ]
    if worth:
        yield from _candidate_pairs(worth, fit, examined, place)


def _candidate_pairs(
    numbers: list[int], fit: LineFit, examined: set[float], bins: Floats
) -> Iterator[tuple[list[int], tuple[float, float]]]:  # fmt: skip
    """What a pair may replace at some lines, with the best pair of each, that explain much; see above."""
    lines, remainder = fit.lines, not_none(fit.remainder)
    choices: list[list[int]] = []
    for k in numbers:
        distance = np.abs(bins - bins[k])
        distance[k] = np.inf
        nearest = int(distance.argmin())
        both = distance[nearest] <= LOBE and (lines[k].order is None or lines[nearest].order is None)
        choices += [[k, nearest], [k]] if both else [[k]]
    orders = [next((k for k in replaced if lines[k].order is not None), None) for replaced in choices]
    pairs, ratios = remainder.best_pairs(choices, [np.nan if k is None else float(bins[k]) for k in orders])
    for replaced, pair, ratio in zip(choices, pairs.tolist(), ratios.tolist(), strict=True):
        examined.add(lines[replaced[0]].peak_hz)
        if ratio <= _PROMISING:
            yield replaced, pair


def _with_pair(
    record: SpectrumRecord, fit: LineFit, replaced: list[int], pair: tuple[float, float], excitation_hz: float,
    view: View,
) -> LineFit | None:  # fmt: skip
    """The lines with a pair, its frequencies in bins, in place of some; None where it does not explain the curve.

    Where the fit of the frequencies near the two leaves too much, that of all does, too.
    """
    order = next((fit.lines[k] for k in replaced if fit.lines[k].order is not None), None)
    two = [SpectralLine(None, f / record.duration, f / record.duration) for f in pair]
    two[:1] = two[:1] if order is None else [order]
    lines = [*(line for k, line in enumerate(fit.lines) if k not in replaced), *two]
    for near_hz in ([line.frequency_hz for line in two], ()):
        several = _on_orders(_refine_frequencies(record, lines, view, near_hz), excitation_hz, record)
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
    least = max(WORTH_LISTING * largest, _OVER_SIDE_LOBES * levels.deviation, ROUND_OFF * levels.peak)
    top = top[amplitude[top] >= least]
    top = top[np.argsort(-amplitude[top])][: 4 * _MOST_LINES]
    forced, reach = np.isfinite(excitation_hz), bins_around(record.duration, excitation_hz)
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


def bins_around(duration: float, excitation_hz: float) -> int:
    """Bins on either side of a maximum whose lower quartile is the floor around it, in a window with two sides.

    Parameters
    ----------
    duration : s, of the record.
    excitation_hz : Hz, not finite where there is no single excitation frequency.
    """
    return max(_FEWEST_BINS, round(excitation_hz * duration)) if np.isfinite(excitation_hz) else _FEWEST_BINS


def _nearest_order(frequency: float, excitation_hz: float, bin_hz: float) -> Fraction | None:
    for n in _DENOMINATORS:
        if excitation_hz / n < LOBE * bin_hz:
            break
        m = round(frequency * n / excitation_hz)
        if m >= 1 and abs(m * excitation_hz / n - frequency) <= 0.5 * bin_hz:
            return Fraction(m, n)
    return None


def _only_locked(
    record: SpectrumRecord, lines: list[SpectralLine], unlocked_hz: Sequence[float] | None
) -> list[SpectralLine]:  # fmt: skip
    """Take the order away from what does not keep its amplitude and phase relative to the excitation."""
    frequency = np.array([line.frequency_hz for line in lines])
    if unlocked_hz is None:
        (_, early), (_, late) = (half.project(frequency) for half in record.halves())
        locked = np.abs(late - early) <= 0.5 * np.maximum(np.abs(late), np.abs(early))
    else:
        near = np.abs(np.subtract.outer(frequency, unlocked_hz)) < 1.0 / record.duration
        locked = ~near.any(axis=1)
    return [
        line if line.order in (None, 1) or steady else line._replace(order=None, frequency_hz=line.peak_hz)
        for line, steady in zip(lines, locked.tolist(), strict=True)
    ]


def _orders_of_short_record(record: SpectrumRecord, excitation_hz: float, peak: float) -> list[SpectralLine]:
    """The orders of the excitation in a record of a few of its periods; none of less than one."""
    known = int(record.highest_hz / excitation_hz * (1 + 1e-12))
    highest = min(_ORDERS_OF_A_SHORT_RECORD, known, (record.size - 1) // 4)
    if highest < 1 or excitation_hz * record.duration < 1 - ROUND_OFF:
        return []
    frequency = excitation_hz * np.arange(1, highest + 1, dtype=np.float64)
    amplitude = np.abs(record.project(frequency)[1])
    floor = record.residual(frequency) * float(np.sqrt(2.0 / record.size))
    limit = max(WORTH_LISTING * float(np.max(amplitude)), _OVER_FLOOR * floor, ROUND_OFF * peak)
    every = zip(range(1, highest + 1), frequency.tolist(), amplitude.tolist(), strict=True)
    return [SpectralLine(Fraction(m), f, f) for m, f, size in every if size >= limit]
