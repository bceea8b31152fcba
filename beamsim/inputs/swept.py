"""Swept sines, cut into windows on which they are a polynomial times an exponential.

The sine is :math:`s(t) = A(f(t)) \\sin\\varphi(t)` with :math:`\\dot\\varphi = 2\\pi f`, where the frequency grows
exponentially (octaves per minute) or linearly (Hz per second) and A is a `Profile`. On a window, with
:math:`\\sigma` the time from its middle and :math:`\\omega` the frequency there,

.. math:: s = \\mathrm{Re}\\Big[ e^{i\\omega\\sigma} \\sum_p \\alpha_p \\sigma^p \\Big], \\qquad
          \\varphi = \\varphi_m + \\omega\\sigma + \\delta(\\sigma),

where the amplitude and :math:`e^{i\\delta}` are expanded in powers of :math:`\\sigma`. The remainder of the
expansion is bounded by that of its majorant. Windows are one cycle long, or shorter where the bound would exceed the
tolerance. All quantities are relative to the window, so a long sweep does not lose accuracy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.inputs.profiles import Profile
from beamsim.inputs.signal import Signal
from beamsim.typing import Bools, Complexes, Floats, Ints

LARGEST_DEGREE = 8
TOLERANCE = 1e-12  # of the amplitude, for the truncation of the polynomials
MOST_WINDOWS = 20_000_000
PIECES_PER_CYCLE = 8  # of a sine represented by polynomials
PIECE_DEGREE = 12


@dataclass(frozen=True)
class Leg:
    """A sweep from one frequency to another: ``f' = rate * f`` (logarithmic) or ``f' = rate`` (linear)."""

    first_hz: float
    last_hz: float
    rate: float  # 1/s or Hz/s, positive
    logarithmic: bool

    @property
    def signed_rate(self) -> float:
        """The rate, negative for a downward sweep."""
        return self.rate if self.last_hz > self.first_hz else -self.rate

    @property
    def duration(self) -> float:
        """Duration, s."""
        if self.logarithmic:
            return float(np.log(self.last_hz / self.first_hz) / self.signed_rate)
        return float((self.last_hz - self.first_hz) / self.signed_rate)

    @property
    def cycles(self) -> float:
        """Number of cycles, in general not whole."""
        return float(self.turns(np.array(self.last_hz)))

    def turns(self, frequency_hz: Floats) -> Floats:
        """Cycles from the start of the leg to a frequency."""
        if self.logarithmic:
            return np.asarray((frequency_hz - self.first_hz) / self.signed_rate)
        return np.asarray((frequency_hz - self.first_hz) * (frequency_hz + self.first_hz) / (2 * self.signed_rate))

    def frequency(self, turns: Floats) -> Floats:
        """The inverse of `turns`, Hz."""
        if self.logarithmic:
            return np.asarray(self.first_hz + self.signed_rate * turns)
        return np.sqrt(np.maximum(self.first_hz**2 + 2 * self.signed_rate * turns, 0.0))

    def time_between(self, first_hz: Floats, turns: Floats) -> Floats:
        """Time, s, for a number of cycles from a given frequency; without cancellation for small numbers."""
        if self.logarithmic:
            return np.asarray(np.log1p(self.signed_rate * turns / first_hz) / self.signed_rate)
        last = np.sqrt(np.maximum(first_hz**2 + 2 * self.signed_rate * turns, 0.0))
        return np.asarray(2 * turns / (first_hz + last))

    def turns_after(self, first_hz: Floats, time: Floats) -> Floats:
        """Cycles during a time from a given frequency."""
        if self.logarithmic:
            return np.asarray(first_hz * np.expm1(self.signed_rate * time) / self.signed_rate)
        return np.asarray(time * (first_hz + 0.5 * self.signed_rate * time))

    def time_at(self, turns: Floats) -> Floats:
        """Time since the start of the leg, s."""
        return self.time_between(np.full(np.shape(turns), self.first_hz), turns)


@dataclass(frozen=True)
class SweepWindows:
    """W windows with D + 1 coefficients each, about the middle of the window (``degree`` of them in use)."""

    start: Floats  # (W,) s
    length: Floats  # (W,) s
    omega: Floats  # (W,) rad/s in the middle
    leg: Ints  # (W,)
    cycle: Ints  # (W,) number of the cycle the window belongs to, counted by the phase
    fraction: Floats  # (W,) of that cycle at the middle of the window
    degree: Ints  # (W,)
    coefficient: Complexes  # (W, D + 1) of the sine at unit phase zero
    deviation: Floats  # (W, D + 1) of delta, rad
    frequency_hz: Floats  # (C,) in the middle of each cycle
    cycle_start: Floats  # (C,) s
    cycle_leg: Ints  # (C,)
    cycle_complete: Bools  # (C,)
    truncation: float  # largest bound on the truncation of the polynomials, over the amplitude

    @property
    def count(self) -> int:
        """W."""
        return int(self.length.size)

    @property
    def cycles(self) -> int:
        """C."""
        return int(self.frequency_hz.size)

    @property
    def duration(self) -> float:
        """Duration of the sweep, s."""
        return float(self.start[-1] + self.length[-1])

    def integrated(self, times: int) -> Complexes:
        """(W, D + 1) coefficients of the sine's integral (1) or double integral (2), without drift.

        This is the particular solution that is itself a polynomial times the exponential. At a corner of the profile it
        jumps by about 1e-4 of its amplitude, where the true integral would start to drift.
        """
        alpha = self.coefficient
        D = alpha.shape[1] - 1
        nu = 1j * self.omega
        for _ in range(times):
            beta = np.zeros_like(alpha)
            for p in range(D, -1, -1):
                above = (p + 1) * beta[:, p + 1] if p < D else 0.0
                beta[:, p] = (alpha[:, p] - above) / nu
            alpha = beta
        return alpha

    def evaluate(self, coefficient: Complexes, time: Floats) -> Floats:
        """Values of the signal with these coefficients at times (any shape); the end windows are extended outside."""
        time = np.asarray(time, dtype=float)
        k = np.clip(np.searchsorted(self.start, time, side="right") - 1, 0, self.count - 1)
        sigma = time - self.start[k] - 0.5 * self.length[k]
        value = np.zeros(time.shape, dtype=complex)
        for p in range(coefficient.shape[1] - 1, -1, -1):
            value = value * sigma + coefficient[k, p]
        return np.asarray((value * np.exp(1j * self.omega[k] * sigma)).real)

    def frequency_at(self, time: Floats) -> Floats:
        """Instantaneous frequency, Hz."""
        k = np.clip(np.searchsorted(self.start, time, side="right") - 1, 0, self.count - 1)
        sigma = time - self.start[k] - 0.5 * self.length[k]
        slope = np.zeros(np.shape(time))
        for p in range(self.deviation.shape[1] - 1, 0, -1):
            slope = slope * sigma + p * self.deviation[k, p]
        return np.asarray((self.omega[k] + slope) / (2 * np.pi))


def cut_into_windows(
    legs: Sequence[Leg],
    profile: Profile,
    *,
    phase: float = 0.0,
    tolerance: float = TOLERANCE,
    degree: int = LARGEST_DEGREE,
) -> SweepWindows:
    """Windows of a swept sine with continuous phase from leg to leg.

    Parameters
    ----------
    phase : of the sine at the start, rad.
    tolerance : bound on the truncation of the polynomials on a window, over the amplitude.
    degree : highest degree of the polynomials.

    Raises
    ------
    ValueError
        If more than twenty million windows would be needed.
    """
    parts = []
    turns_before, time_before = 0.0, 0.0
    for index, leg in enumerate(legs):
        if leg.cycles > MOST_WINDOWS:
            raise ValueError(f"the sweep has {sum(leg.cycles for leg in legs):.3g} cycles")
        cuts = _cuts(leg, profile, turns_before % 1.0)
        parts.append(_windows(leg, index, profile, cuts, turns_before, time_before, tolerance, degree))
        turns_before += leg.cycles
        time_before += leg.duration
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    turn = np.exp(1j * (phase - 0.5 * np.pi))  # Re[-i e^{i phi}] = sin phi
    coefficient = columns["coefficient"] * (turn * np.exp(2j * np.pi * columns["fraction"]))[:, None]
    cycles = int(columns["cycle"][-1]) + 1
    frequency, start, cycle_leg = _cycle_table(legs, cycles)
    complete = np.ones(cycles, dtype=bool)
    complete[-1] = turns_before >= cycles - 1e-9
    length = columns["length"]
    return SweepWindows(
        start=columns["start"],
        length=length,
        omega=columns["omega"],
        leg=columns["leg"],
        cycle=columns["cycle"],
        fraction=columns["fraction"],
        degree=columns["degree"],
        coefficient=np.ascontiguousarray(coefficient),
        deviation=np.ascontiguousarray(columns["deviation"]),
        frequency_hz=frequency,
        cycle_start=start,
        cycle_leg=cycle_leg,
        cycle_complete=complete,
        truncation=float(columns["bound"].max()),
    )


def _cuts(leg: Leg, profile: Profile, fraction: float) -> Floats:
    """Boundaries of windows in cycles since the start of the leg; no window crosses one."""
    total = leg.cycles
    whole = np.arange(1, int(np.floor(total + fraction)) + 1) - fraction
    low, high = sorted((leg.first_hz, leg.last_hz))
    edges = profile.edge[(profile.edge > low) & (profile.edge < high)]
    cuts = np.unique(np.concatenate([[0.0], whole, leg.turns(edges), [total]]))
    cuts = cuts[(cuts >= 0.0) & (cuts <= total)]
    keep = np.concatenate([[True], np.diff(cuts) > 1e-9])
    cuts = cuts[keep]
    cuts[-1] = total
    return np.asarray(cuts)


def _windows(
    leg: Leg,
    index: int,
    profile: Profile,
    cuts: Floats,
    turns_before: float,
    time_before: float,
    tolerance: float,
    degree: int,
) -> dict[str, NDArray[Any]]:
    first, last = cuts[:-1], cuts[1:]
    for _ in range(60):
        expansion = _expand(leg, profile, first, last, degree)
        fine = expansion["bound"] <= tolerance
        if fine.all():
            break
        if first.size + (~fine).sum() > MOST_WINDOWS:
            raise ValueError(f"the sweep needs more than {MOST_WINDOWS:.3g} windows")
        middle = 0.5 * (first + last)[~fine]
        order = np.argsort(np.concatenate([first, middle]), kind="stable")
        last = np.concatenate([np.where(fine, last, 0.5 * (first + last)), last[~fine]])[order]
        first = np.concatenate([first, middle])[order]
    f = leg.frequency(first)
    total = turns_before + first + leg.turns_after(f, 0.5 * expansion["length"])
    cycle = np.floor(total).astype(np.int64)
    return {
        **expansion,
        "start": time_before + leg.time_at(first),
        "leg": np.full(first.size, index, dtype=np.int64),
        "cycle": cycle,
        "fraction": total - cycle,
    }


def _expand(leg: Leg, profile: Profile, first: Floats, last: Floats, degree: int) -> dict[str, NDArray[Any]]:
    """Length, frequency and polynomials of windows between turns ``first`` and ``last``."""
    f = leg.frequency(first)
    length = leg.time_between(f, last - first)
    rate, D = leg.signed_rate, degree
    middle = f * np.exp(0.5 * rate * length) if leg.logarithmic else f + 0.5 * rate * length
    omega = 2 * np.pi * middle
    power = profile.power[profile.piece(middle)]
    radius = 0.5 * length

    deviation = np.zeros((f.size, D + 1))  # of the phase
    growth = np.zeros((f.size, D + 1))  # of the amplitude, relative to that in the middle
    growth[:, 0] = 1.0
    for p in range(1, D + 1):
        if leg.logarithmic:
            growth[:, p] = growth[:, p - 1] * (power * rate) / p
            if p > 1:
                deviation[:, p] = omega * rate ** (p - 1) / _factorial(p)
        else:
            growth[:, p] = growth[:, p - 1] * (power - (p - 1)) / p * (rate / middle)
    if not leg.logarithmic:
        deviation[:, 2] = np.pi * rate
    turning = _exponential(np.asarray(1j * deviation, dtype=np.complex128))
    product = np.zeros((f.size, D + 1), dtype=complex)
    for p in range(D + 1):
        product[:, p] = np.sum(turning[:, : p + 1] * growth[:, p::-1], axis=1)

    growth_major = np.abs(growth)
    # the same with every coefficient replaced by its absolute value bounds every remainder
    swing = _deviation_majorant(leg, omega, radius)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if leg.logarithmic:
            swell = np.exp(np.abs(power * rate) * radius)
        else:
            ratio = np.minimum(np.abs(rate) / middle * radius, 1.0)
            finite = (power >= 0) & (power == np.round(power))  # a polynomial; else majorised by (1 - x)^-|power|
            swell = np.where(
                finite, (1.0 + ratio) ** power, np.where(ratio < 1.0, (1.0 - ratio) ** -np.abs(power), np.inf)
            )
            for p in range(1, D + 1):
                rising = growth_major[:, p - 1] * (np.abs(power) + p - 1) / p * np.abs(rate / middle)
                growth_major[:, p] = np.where(finite, growth_major[:, p], rising)
        major = _exponential(np.abs(deviation).astype(complex)).real
        partial = np.zeros(f.size)
        used = np.full(f.size, D, dtype=np.int64)
        whole = np.exp(swing) * swell
        bound = np.full(f.size, np.inf)
        for p in range(D + 1):
            partial = partial + np.sum(major[:, : p + 1] * growth_major[:, p::-1], axis=1) * radius**p
            remainder = np.maximum(whole - partial, 0.0)
            better = (p >= 2) & (bound > 1e-13) & np.isfinite(whole)
            bound = np.where(better, remainder, bound)
            used = np.where(better, p, used)
    cut = np.arange(D + 1)[None, :] > used[:, None]
    product[cut] = 0.0
    return {
        "length": length,
        "omega": omega,
        "degree": used,
        "coefficient": product * profile(middle)[:, None],
        "deviation": deviation,
        "bound": bound,
    }


def _exponential(series: Complexes) -> Complexes:
    """Power series of the exponential of power series without constant term, one per row."""
    out = np.zeros_like(series)
    out[:, 0] = 1.0
    for p in range(1, series.shape[1]):
        j = np.arange(1, p + 1)
        out[:, p] = np.sum(j * series[:, 1 : p + 1] * out[:, p - 1 :: -1][:, :p], axis=1) / p
    return out


def _deviation_majorant(leg: Leg, omega: Floats, radius: Floats) -> Floats:
    """Bound on |delta| from the series of absolute values."""
    if not leg.logarithmic:
        return np.pi * leg.rate * radius**2
    x = leg.rate * radius
    with np.errstate(over="ignore"):
        direct = np.expm1(x) - x
    series = x**2 / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6 * (1 + x / 7)))))
    return np.asarray(omega / leg.rate * np.where(x < 0.1, series, direct))


def _factorial(p: int) -> float:
    return float(np.prod(np.arange(1, p + 1, dtype=float)))


def _cycle_table(legs: Sequence[Leg], cycles: int) -> tuple[Floats, Floats, Ints]:
    """Frequency in the middle, start and leg of every cycle; the last one may be incomplete."""
    ends = np.cumsum([leg.cycles for leg in legs])
    times = np.concatenate([[0.0], np.cumsum([leg.duration for leg in legs])])
    begins = np.concatenate([[0.0], ends[:-1]])
    middle = np.minimum(np.arange(cycles) + 0.5, ends[-1])
    of_middle = np.minimum(np.searchsorted(ends, middle, side="right"), len(legs) - 1)
    edge = np.arange(cycles, dtype=float)
    of_edge = np.minimum(np.searchsorted(ends, edge, side="right"), len(legs) - 1)
    frequency, start = np.empty(cycles), np.empty(cycles)
    for index, leg in enumerate(legs):
        here = of_middle == index
        frequency[here] = leg.frequency(middle[here] - begins[index])
        here = of_edge == index
        start[here] = times[index] + leg.time_at(edge[here] - begins[index])
    return frequency, start, of_middle.astype(np.int64)


def swept_signals(windows: SweepWindows, times_integrated: Sequence[int]) -> tuple[Signal, ...]:
    """The sine and its integrals as polynomials on an eighth of a cycle each, for flows that accept any signal.

    The Taylor polynomials have degree twelve; their error is below 1e-11 of the amplitude.
    """
    turns = windows.omega * windows.length / (2 * np.pi)
    pieces = np.maximum(np.ceil(turns * PIECES_PER_CYCLE - 1e-9).astype(int), 1)
    window = np.repeat(np.arange(windows.count), pieces)
    within = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    offset = within * (windows.length[window] / pieces[window])
    start = windows.start[window] + offset
    start[0] = 0.0
    sigma = offset - 0.5 * windows.length[window]
    omega = windows.omega[window]
    turning = np.ones((window.size, PIECE_DEGREE + 1), dtype=complex)
    for p in range(1, PIECE_DEGREE + 1):
        turning[:, p] = turning[:, p - 1] * (1j * omega / p)
    turning *= np.exp(1j * omega * sigma)[:, None]
    signals = []
    for times in times_integrated:
        moved = windows.integrated(times)[window]
        D = moved.shape[1] - 1
        for i in range(D):  # the polynomial about the start of the piece
            for p in range(D - 1, i - 1, -1):
                moved[:, p] += sigma * moved[:, p + 1]
        piece = np.zeros((window.size, PIECE_DEGREE + 1))
        for p in range(PIECE_DEGREE + 1):
            low = min(p, D) + 1
            piece[:, p] = np.sum(moved[:, :low] * turning[:, p::-1][:, :low], axis=1).real
        signals.append(Signal.polynomial_pieces(start, piece))
    return tuple(signals)


def constant_windows(frequency_hz: float, amplitude: float, cycles: int, phase: float = 0.0) -> SweepWindows:
    """A sine of constant frequency, one window per cycle; it starts at phase 0 (plus ``phase``)."""
    period = 1.0 / frequency_hz
    omega = 2 * np.pi * frequency_hz
    ones = np.ones(cycles)
    index = np.arange(cycles)
    # the polynomials are about the middle of a cycle, where the phase is pi
    value = amplitude * np.exp(1j * (phase + np.pi - 0.5 * np.pi))
    return SweepWindows(
        start=np.asarray(index * period, dtype=float),
        length=ones * period,
        omega=ones * omega,
        leg=np.zeros(cycles, dtype=np.int64),
        cycle=index.astype(np.int64),
        fraction=0.5 * ones,
        degree=np.zeros(cycles, dtype=np.int64),
        coefficient=np.full((cycles, 1), value),
        deviation=np.zeros((cycles, 1)),
        frequency_hz=ones * frequency_hz,
        cycle_start=np.asarray(index * period, dtype=float),
        cycle_leg=np.zeros(cycles, dtype=np.int64),
        cycle_complete=np.ones(cycles, dtype=bool),
        truncation=0.0,
    )
