"""Time histories of a swept-sine test, tracked cycle by cycle: what each cycle shows, against its frequency.

The sweep itself says when each cycle begins. The record is resampled at equal steps of the phase (computed order
tracking: K. R. Fyfe and E. D. S. Munck, "Analysis of computed order tracking", Mechanical Systems and Signal Processing
11, 1997), so that each cycle has the same number of samples, whose mean product with :math:`2 e^{-i\\varphi}` is the
fundamental. Over N cycles that is a tracking filter whose bandwidth is the N-th part of the frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamsim.analyses.sweep.result import SweepCurve
from beamsim.measurements.channels import unusable
from beamsim.measurements.signal import MeasuredSignal
from beamsim.typing import Complexes, Floats, Ints

FEWEST_SAMPLES = 5.0  # a cycle of the highest frequency
RESPONSE_OFF = 0.1  # the same of responses, whose phases turn at resonances; that of noise is 0.25
STEP = 0.15  # of the frequency, between trials of the beginning


@dataclass(frozen=True)
class Followed:
    """A record that shows where a sweep begins, and the phases that its fundamental should have."""

    signal: MeasuredSignal
    expected: Complexes | None = None  # (C,) fundamental of every cycle of the curve; None for the excitation


@dataclass(frozen=True)
class Tracked:
    """A record cut into the cycles of a sweep."""

    cycle: Ints  # (C,) their numbers in the curve
    frequency_hz: Floats  # (C,) increasing
    fundamental: Complexes  # (C,) a - ib of a cos(phase) + b sin(phase)
    peak: Floats  # (C,) largest magnitude
    rms: Floats  # (C,) mean included


def beginning(curve: SweepCurve, records: Sequence[Followed]) -> float:
    """Time of the records at which a curve of the sweep begins, s: where their frequency is that of the sweep.

    The phase of a fundamental drifts from cycle to cycle by the relative error of the frequency. Phases of responses
    turn at resonances besides, by what the sweep expects and, where its resonances are elsewhere, in a few cycles
    more: the median over the cycles is the error.
    """
    start, end = records[0].signal.x[0], records[0].signal.x[-1]
    slope = np.abs(np.gradient(curve.frequency_hz, curve.time))
    step = STEP * float(np.min(curve.frequency_hz / slope))
    latest = max(float(end - curve.time[-1] + curve.time[0]), float(start))
    trials = np.linspace(start, latest, int(np.clip(np.ceil((latest - start) / step) + 1, 1, 200)))
    begin = min((float(b) for b in trials), key=lambda b: _off(curve, records, b))
    for _ in range(20 if _off(curve, records, begin) < RESPONSE_OFF + STEP else 0):
        moves = [_delay(curve, record, begin) for record in records]
        move = float(np.nanmedian(np.concatenate(moves)))
        begin -= move
        # 1e-6: of the frequency: the beginning is not moved by less
        if abs(move) * float(np.max(slope / curve.frequency_hz)) < 1e-6:
            break
    return begin


def check_beginning(curve: SweepCurve, records: Sequence[Followed], begin: float) -> None:
    """Refuse records whose frequency is not that of the sweep.

    Raises
    ------
    ScenarioError
        With the relative error of the frequency.
    """
    off = _off(curve, records, begin)
    # 0.03: of the frequency, in the median over the cycles: then an excitation does not follow the sweep
    if off > (0.03 if records[0].expected is None else RESPONSE_OFF):
        names = ", ".join(record.signal.name for record in records)
        raise unusable(
            f"{records[0].signal.source or names}: {names} does not follow the sweep that was computed: from "
            f"{begin:.4g} s of the record on its frequency is off by {100 * off:.2g} % in the median",
            "compute the sweep with the rate and range of the test; or say when it begins in the record (--begin), "
            "or which channel is the excitation (--reference)",
        )


def track(curve: SweepCurve, signal: MeasuredSignal, begin: float) -> Tracked:
    """Fundamental, peak and rms of each cycle that lies in the record.

    Raises
    ------
    ScenarioError
        If the record has fewer than `FEWEST_SAMPLES` in a cycle of the highest frequency, or ends before two cycles.
    """
    from scipy.interpolate import CubicSpline

    where = signal.label
    edges = curve.time - curve.time[0] + begin
    inside = np.flatnonzero((edges[:-1] >= signal.x[0]) & (edges[1:] <= signal.x[-1]))
    if inside.size < 2:
        raise unusable(
            f"{where} holds {inside.size} cycles of the sweep, which begins at {begin:.4g} s of the record",
            "record the whole sweep, or correct --begin",
        )
    rate = (signal.x.size - 1) / (signal.x[-1] - signal.x[0])
    highest = float(curve.frequency_hz[inside].max())
    if rate < FEWEST_SAMPLES * highest:
        raise unusable(
            f"{where} is sampled at {rate:.5g} Hz, {rate / highest:.2g} times a cycle at {highest:.5g} Hz",
            f"use a record of {FEWEST_SAMPLES:g} samples a cycle or more",
        )
    count = int(np.clip(2 ** np.ceil(np.log2(rate / np.median(curve.frequency_hz[inside]))), 64, 1024))
    share = (np.arange(count) + 0.5) / count  # a cycle does not end as it begins: midpoint rule
    clock = CubicSpline(np.arange(edges.size), edges)
    turns = inside[:, None] + share
    history = CubicSpline(signal.x, np.asarray(signal.y, dtype=float))
    values = history(clock(turns))
    at_ends = np.abs(history(edges[np.stack([inside, inside + 1])])).max(axis=0)
    weight = clock(turns, 1)  # the root mean square is over time, as that of the sweep is
    weight /= weight.sum(axis=1, keepdims=True)
    fundamental = values @ np.exp(-2j * np.pi * share) * (2.0 / count)
    rising = np.argsort(curve.frequency_hz[inside], kind="stable")
    return Tracked(
        cycle=inside[rising],
        frequency_hz=curve.frequency_hz[inside][rising],
        fundamental=fundamental[rising],
        peak=np.maximum(np.abs(values).max(axis=1), at_ends)[rising],
        rms=np.sqrt(np.sum(weight * values**2, axis=1))[rising],
    )


def filtered(values: Complexes, cycles: int) -> Complexes:
    """(C - N + 1,) mean over each N successive cycles."""
    return np.convolve(values, np.full(cycles, 1.0 / cycles), mode="valid") if cycles > 1 else values


def _drift(curve: SweepCurve, record: Followed, begin: float) -> tuple[Floats, Floats]:
    """(C - 1,) frequencies of cycles, and relative errors of the frequency there; nan where nothing moves."""
    of = track(curve, record.signal, begin)
    turned = of.fundamental[1:] * np.conj(of.fundamental[:-1])
    # 1e-4: of the largest value of a record
    moves = np.abs(turned) > (1e-4 * float(np.max(np.abs(record.signal.y)))) ** 2
    if record.expected is not None:
        expected = record.expected[of.cycle]
        turned = turned * np.conj(expected[1:]) * expected[:-1]
    forward = 1.0 if curve.direction == "up" else -1.0
    return of.frequency_hz[1:], np.where(moves, forward * np.angle(turned) / (2 * np.pi), np.nan)


def _off(curve: SweepCurve, records: Sequence[Followed], begin: float) -> float:
    """Median magnitude of the relative error of the frequency, which cannot exceed a half."""
    error = np.concatenate([_drift(curve, record, begin)[1] for record in records])
    return float(np.median(np.nan_to_num(np.abs(error), nan=0.5)))


def _delay(curve: SweepCurve, record: Followed, begin: float) -> Floats:
    """(C - 1,) time by which the record is ahead of the sweep, by the frequency of each cycle, s."""
    frequency, error = _drift(curve, record, begin)
    rising = np.argsort(curve.frequency_hz, kind="stable")
    slope = np.gradient(curve.frequency_hz, curve.time)[rising]
    return np.asarray(error * frequency / np.interp(frequency, curve.frequency_hz[rising], slope))
