"""Peaks of a response curve and their classification.

A peak is classified by the harmonic with the largest increase: the excitation frequency itself (a resonance, linear if
no contact opens or closes, otherwise nonlinear), a multiple of it (superharmonic resonance), or a fraction (subharmonic
resonance). A linear motion has neither; such a peak is then a beat with the free motion, which remains after a fast
passage through a resonance, or after the start of any sweep. A peak of the excitation frequency is also a beat if the
sweep has not just passed a natural frequency. Where the motion jumps off a resonance, the excitation frequency loses
more than any other harmonic gains: a hardening resonance is flat before its jump, which excites the others. At a step
of the level (edge of a notch, a stepped profile), a peak of a linear motion belongs to the step.
"""

from __future__ import annotations

import numpy as np

from beamsim.analyses.sweep.result import ResponsePeak, SweepCurve
from beamsim.labelled import Dataset
from beamsim.results.values import ALWAYS
from beamsim.signals.resonance_peaks import LEAST_PROMINENCE
from beamsim.typing import Bools, Complexes, Floats, Ints

BINS = 300  # frequency bins for the envelope of a swept response
NEIGHBOURHOOD = 1.25  # frequency ratio within which the increase of a harmonic is measured
MOST_PEAKS = 12  # in a curve
LEVEL_STEP = 1.05  # ratio of the levels of two neighbouring cycles that counts as a step
# Behind a natural frequency fn that is passed at a rate r, its free motion beats with the excitation (f - fn)² / 2 r
# times. The largest response is 0.37 beats behind it (undamped: F. M. Lewis, Trans. ASME 54 (1932) 253), the next
# maximum 1.4.
NARROWEST_RESONANCE = 0.03  # width of a resonance over its frequency


def find_peaks(curve: SweepCurve, probe: str, modes: Dataset | None) -> list[ResponsePeak]:
    """Find the peaks in the displacement of a probe from static equilibrium.

    Parameters
    ----------
    curve : curve of a swept or stepped sine.
    probe : name of the probe.
    modes : modes of the structure; without them beats are not distinguished from resonances.

    Returns
    -------
    list
        The largest first, at most `MOST_PEAKS`; empty if fewer than five values are known.
    """
    from scipy import signal

    response = curve.response(probe)
    good = np.isfinite(response) & (response > 0)
    if good.sum() < 5:
        return []
    order = np.argsort(curve.frequency_hz[good], kind="stable")
    index = np.flatnonzero(good)[order]
    frequency, peak = curve.frequency_hz[index], response[index]
    bins = np.arange(frequency.size)
    if frequency.size > 3 * BINS:
        edges = np.geomspace(frequency[0], frequency[-1], BINS + 1)
        bins = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, BINS - 1)
    first = np.flatnonzero(np.append(True, np.diff(bins) > 0))
    high = np.maximum.reduceat(peak, first)
    padded = np.concatenate([[0.0], np.log(high), [0.0]])
    padded[0] = padded[-1] = padded[1:-1].min() - 1.0
    maxima, _ = signal.find_peaks(padded, prominence=np.log(LEAST_PROMINENCE))
    last = np.append(first[1:], peak.size)
    inner = [bin_ for bin_ in maxima - 1 if 0 < bin_ < high.size - 1]  # the ends of the sweep are not peaks
    tops = [first[bin_] + int(np.argmax(peak[first[bin_] : last[bin_]])) for bin_ in inner]
    largest = sorted(tops, key=lambda at: -float(peak[at]))[:MOST_PEAKS]
    of_cycles = response, curve.channel("displacement", probe).harmonics
    return [_classify(curve, probe, modes, of_cycles, index, frequency, at) for at in largest]


def _classify(
    curve: SweepCurve, probe: str, modes: Dataset | None, cycle_values: tuple[Floats, Complexes], index: Ints,
    frequency: Floats, peak_index: int,
) -> ResponsePeak:  # fmt: skip
    response, harmonics = cycle_values
    f = frequency[peak_index]

    def median(r: int, part: Ints) -> float:
        """Median over cycles; NaN if there is no number, as for order 1/2 in the first cycle."""
        numbers = np.abs(harmonics[r, index[part]])
        numbers = numbers[~np.isnan(numbers)]
        return float(np.median(numbers)) if numbers.size else np.nan

    here = _indices_around(frequency, f * 0.99, f * 1.01, peak_index)
    below = _indices_around(frequency, f / NEIGHBOURHOOD, f / NEIGHBOURHOOD**0.5, None)
    above = _indices_around(frequency, f * NEIGHBOURHOOD**0.5, f * NEIGHBOURHOOD, None)
    rise, fall = np.empty(curve.orders.size), np.empty(curve.orders.size)
    for r in range(curve.orders.size):
        sides = [median(r, part) for part in (below, above) if part.size]
        # use the higher of both sides: a harmonic that merely grows with frequency has no peak
        of_peak = median(r, here)
        rise[r], fall[r] = of_peak - max(sides, default=0.0), of_peak - min(sides, default=0.0)
    rise = np.where(np.isfinite(rise), rise, -np.inf)
    order, strength = 1.0, np.nan  # without tracked orders: the peak is at the excitation frequency
    if known := rise.size > 0:
        r = int(np.argmax(rise))
        off = np.flatnonzero((curve.orders == 1.0) & (rise > 0.0) & (fall > rise[r]))
        r = int(off[0]) if off.size else r
        order, strength, known = float(curve.orders[r]), median(r, here), bool(np.isfinite(rise[r]))
    linear = _linear(curve, index[here])
    if order == 1.0 or not known:
        kind = "linear resonance" if linear else "nonlinear resonance"
        if linear and modes is not None and not _has_passed_a_mode(curve, modes, int(index[peak_index])):
            kind = "beat"
    elif linear:
        kind = "beat"
    else:
        kind = "superharmonic" if order > 1 else "subharmonic"
    steps = np.diff(np.log(np.abs(curve.excitation_amplitude[index[here]])))
    if linear and np.any(np.abs(steps) > np.log(LEVEL_STEP)):
        kind = "level step"
    value = float(response[index[peak_index]])
    share = float(strength / value)
    return ResponsePeak(curve.name, probe, curve.direction, curve.level, float(f), value, kind, order, share)


def _indices_around(frequency: Floats, low: float, high: float, fallback: int | None) -> Ints:
    inside = np.flatnonzero((frequency >= low) & (frequency <= high))
    return inside if inside.size or fallback is None else np.array([fallback])


def _has_passed_a_mode(curve: SweepCurve, modes: Dataset, cycle: int) -> bool:
    """True if a peak of a linear motion belongs to a natural frequency, by its distance behind that frequency.

    A stepped sine has no beats. If some contacts stay open and others closed, the natural frequencies are unknown.
    """
    shares = curve["contact_share"].values[:, cycle] if "contact_share" in curve.cycles else np.zeros(0)
    if curve.kind == "stepped" or (min(shares.tolist(), default=0.0) < 0.5 < max(shares.tolist(), default=0.0)):
        return True
    closed = max(shares.tolist(), default=0.0) >= 0.5
    natural = modes["closed_frequencies_hz" if closed else "open_frequencies_hz"].values
    ratios = modes["closed_damping_ratios" if closed else "damping_ratios"].values
    width = natural * np.maximum(2.0 * np.nan_to_num(ratios), NARROWEST_RESONANCE)
    near = slice(max(cycle - 1, 0), cycle + 2)
    rate = np.mean(np.gradient(curve.frequency_hz[near], curve.time[near]))
    behind = np.sign(rate) * (curve.frequency_hz[cycle] - natural)
    return bool(np.any((behind > -width) & (behind < np.maximum(width, np.sqrt(2.0 * 0.9 * np.abs(rate))))))


def _linear(curve: SweepCurve, cycles: Ints) -> bool:
    """True if no contact opens or closes, and no breakpoint of a spring is passed, in these cycles."""
    if "spring_changes" in curve.cycles and np.any(curve["spring_changes"].values[cycles]):
        return False
    shares = curve["contact_share"].values[:, cycles] if "contact_share" in curve.cycles else np.zeros((0, 0))
    return bool(np.all(np.all(shares <= ALWAYS, axis=1) | np.all(shares >= 1 - ALWAYS, axis=1)))


def cycles_with_breakpoint(share: Floats) -> Bools:
    """(C,) True for cycles with a breakpoint, from the time share (C, springs) beyond it."""
    return np.asarray(np.any((share > ALWAYS) & (share < 1 - ALWAYS), axis=1))
