"""Swept sines, divided into windows with a polynomial times an exponential each.

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
from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.inputs.drift import TURNS_ROUND_OFF, Correction, leg_pieces, motion_without_drift
from beamsim.inputs.profiles import Leg, Profile
from beamsim.inputs.signal import Signal
from beamsim.typing import Complexes, Floats, Ints

LARGEST_DEGREE = 8


@dataclass(frozen=True)
class SweepWindows:
    """W windows with D + 1 coefficients each, about the middle of the window."""

    start: Floats  # (W,) s
    length: Floats  # (W,) s
    omega: Floats  # (W,) rad/s in the middle
    cycle: Ints  # (W,) number of the cycle the window belongs to, counted by the phase
    fraction: Floats  # (W,) of that cycle at the middle of the window
    coefficient: Complexes  # (W, D + 1) of the sine; of a base, the acceleration with its corrections
    deviation: Floats  # (W, D + 1) of delta, rad
    frequency_hz: Floats  # (C,) in the middle of each cycle of the sweep
    cycle_leg: Ints  # (C,)
    complete: bool  # whether the last cycle is complete
    truncation: float  # largest bound on the truncation error of the polynomials, relative to the amplitude
    displacement: Complexes | None = None  # (W, D + 1) displacement of a base, without drift; None for a force

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

    @cached_property
    def edge(self) -> Floats:
        """Start of each cycle, s, and the end of the last."""
        return np.append(self.start[np.flatnonzero(np.diff(self.cycle, prepend=-1))], self.duration)

    def of_cycles(self, first: int, last: int) -> SweepWindows:
        """The windows of cycles ``first`` to ``last`` - 1, with times from their start."""
        part = slice(*np.searchsorted(self.cycle, [first, last]).tolist())
        return replace(
            self, start=self.start[part] - self.start[part][0], length=self.length[part], omega=self.omega[part],
            cycle=self.cycle[part], fraction=self.fraction[part], coefficient=self.coefficient[part],
            deviation=self.deviation[part], displacement=None if self.displacement is None else self.displacement[part],
        )  # fmt: skip

    @property
    def velocity(self) -> Complexes:
        """(W, D + 1) coefficients of the base's velocity."""
        assert self.displacement is not None
        return _derivative(self.displacement, self.omega)


def _derivative(coefficient: Complexes, omega: Floats) -> Complexes:
    """Coefficients of the derivative of ``Re[e^{i omega sigma} sum_p c_p sigma^p]``."""
    out = 1j * omega[:, None] * coefficient
    out[:, :-1] += coefficient[:, 1:] * np.arange(1, coefficient.shape[1])
    return np.asarray(out)


def cut_into_windows(
    legs: Sequence[Leg],
    profile: Profile,
    *,
    phase: float = 0.0,
    corrections: Sequence[Correction] | None = None,
    tolerance: float = 1e-12,
) -> SweepWindows:
    """Windows of a swept sine with continuous phase from leg to leg.

    Parameters
    ----------
    legs : directions of the sweep, in order.
    profile : level over frequency.
    phase : of the sine at the start, rad.
    corrections : corrections of a base acceleration, see `beamsim.inputs.drift.jumps`; None for a force.
    tolerance : bound on the truncation error of the polynomials, relative to the amplitude.

    Returns
    -------
    SweepWindows
        W windows in C cycles.
    """
    parts: list[dict[str, NDArray[Any]]] = []
    turns, time = 0.0, 0.0  # before each leg
    begins = []
    for leg in legs:
        parts.append(_windows(_LegExpansion(leg, profile, phase, corrections, turns, time), tolerance))
        begins.append(turns)
        turns += leg.cycles
        time += leg.duration
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    bound = columns.pop("bound")
    middle = np.minimum(np.arange(int(columns["cycle"][-1]) + 1) + 0.5, turns)
    cycle_leg = np.maximum(np.searchsorted(begins, middle, side="right") - 1, 0)
    return SweepWindows(
        **columns,
        frequency_hz=np.choose(cycle_leg, [leg.frequency(middle - t) for leg, t in zip(legs, begins, strict=True)]),
        cycle_leg=cycle_leg.astype(np.int64),
        complete=turns >= middle.size - TURNS_ROUND_OFF,
        truncation=float(bound.max()),
    )


def windows_of_cycles(
    leg: Leg, profile: Profile, first: int, last: int, *, phase: float, base_motion: bool
) -> SweepWindows:
    """Windows of the cycles ``first`` to ``last`` - 1 of a leg, as if the sweep started there.

    Parameters
    ----------
    leg : the sweep, up or down.
    profile : level over frequency, with edges between cycles.
    first, last : numbers of cycles.
    phase : of the sine at the start, rad.
    base_motion : whether it is a base motion: without drift on each piece of the profile, and without corrections.

    Returns
    -------
    SweepWindows
        With times and cycles from the first cycle on.
    """
    begin, end = leg.frequency(np.array([first, last], dtype=float)).tolist()
    part = Leg(begin, end, leg.rate, leg.logarithmic)
    return cut_into_windows([part], profile, phase=phase, corrections=() if base_motion else None)


def _windows(expansion: _LegExpansion, tolerance: float) -> dict[str, NDArray[Any]]:
    """The windows of a leg, halved until the polynomials meet the tolerance."""
    cuts = expansion.cuts()
    at_a_time = 1 << 16  # windows at a time, to limit memory
    chunks = [cuts[i : i + at_a_time + 1] for i in range(0, cuts.size - 1, at_a_time)]
    pending = [(chunk[:-1], chunk[1:], 0) for chunk in chunks]
    done: list[dict[str, NDArray[Any]]] = []
    while pending:
        first, last, times = pending.pop()
        windows = expansion.columns_of_turns(first, last)
        fine = (windows["bound"] <= tolerance) | (times == 40)
        done.append({name: column[fine] for name, column in windows.items()})
        if not fine.all():
            middle = 0.5 * (first + last)[~fine]
            pending.append((np.concatenate([first[~fine], middle]), np.concatenate([middle, last[~fine]]), times + 1))
    columns = {name: np.concatenate([part[name] for part in done]) for name in done[0]}
    order = np.argsort(columns["start"], kind="stable")
    return {name: column[order] for name, column in columns.items()}


@dataclass(frozen=True)
class _LegExpansion:
    """Power series of the sine of a leg on windows between given cycles, with truncation bounds."""

    leg: Leg
    profile: Profile
    phase: float
    corrections: Sequence[Correction] | None
    turns_before: float
    time_before: float

    def cuts(self) -> Floats:
        """Boundaries that no window crosses, in cycles since the start of the leg."""
        leg, total, fraction = self.leg, self.leg.cycles, self.turns_before % 1.0
        whole = np.arange(1, int(np.floor(total + fraction)) + 1) - fraction
        begins, _ = leg_pieces(leg, self.profile, fraction)
        ends = [c.time - self.time_before + side * c.half_width for c in self.corrections or () for side in (-1, 1)]
        ends = [time for time in ends if 0 < time < leg.duration]
        of_corrections = leg.turns_after(np.array(leg.first_hz), np.array(ends))
        cuts = np.unique(np.concatenate([begins, whole, of_corrections, [total]]))
        cuts = cuts[(cuts >= 0.0) & (cuts <= total)]
        cuts = cuts[np.concatenate([[True], np.diff(cuts) > TURNS_ROUND_OFF])]
        cuts[-1] = total
        return np.asarray(cuts)

    def columns_of_turns(self, first: Floats, last: Floats) -> dict[str, NDArray[Any]]:
        """Columns of `SweepWindows` for windows from ``first`` to ``last``, in cycles, and their truncation bounds."""
        leg = self.leg
        f = leg.frequency(first)
        length = leg.time_between(f, last - first)
        start = self.time_before + leg.time_at(first)
        # whole cycles are separated, so that after millions of them the phase keeps its accuracy
        turns = self.turns_before % 1.0 + first % 1.0 + leg.turns_after(f, 0.5 * length)
        cycle = (np.floor(self.turns_before) + np.floor(first) + np.floor(turns)).astype(np.int64)
        fraction = turns - np.floor(turns)
        middle = leg.frequency_after(f, 0.5 * length)
        omega, radius = 2 * np.pi * middle, 0.5 * length
        piece = self.profile.piece(middle)
        amplitude = self.profile(middle)
        turn = np.exp(1j * (self.phase - 0.5 * np.pi + 2 * np.pi * fraction))  # Re[-i e^{i phi}] = sin phi
        product, deviation, remainder = _series(leg, middle, self.profile.power[piece], radius, LARGEST_DEGREE)
        series = product * (turn * amplitude)[:, None]
        windows: dict[str, NDArray[Any]] = {
            "start": start, "length": length, "omega": omega, "cycle": cycle, "fraction": fraction,
            "deviation": deviation,
        }  # fmt: skip
        if self.corrections is None:
            return {**windows, "coefficient": series, "bound": remainder}
        velocity, displacement = self._without_drift(series[:, 0], middle, piece)
        pulse = np.zeros((f.size, 9))
        for correction in self.corrections:
            if np.any(np.abs(start + radius - correction.time) < correction.half_width):
                pulse += correction.displacement_about(start + radius)
        curvature = pulse[:, 2:] * (np.arange(2, 9) * np.arange(1, 8))
        pulse_series, pulse_remainder = _modulate(curvature, omega, radius, LARGEST_DEGREE)
        series = series + pulse_series
        motion = _twice_integrated(series, omega, displacement + pulse[:, 0], velocity + pulse[:, 1])
        coefficient = _derivative(_derivative(motion, omega), omega)
        # the displacement has the highest power; its second derivative lacks the contribution of higher ones
        power = radius[:, None] ** np.arange(LARGEST_DEGREE + 1)
        left_out = remainder * amplitude + pulse_remainder + np.sum(np.abs(coefficient - series) * power, axis=1)
        scale = np.maximum(amplitude, np.sum(np.abs(curvature) * power[:, :7], axis=1))
        bound = left_out / np.where(scale > 0, scale, 1.0)
        return {**windows, "coefficient": coefficient, "displacement": motion, "bound": bound}

    def _without_drift(self, alpha: Complexes, frequency_hz: Floats, piece: Ints) -> tuple[Complexes, Complexes]:
        """Complex velocity and displacement for an acceleration alpha in the middle of each window."""
        velocity, displacement = np.empty_like(alpha), np.empty_like(alpha)
        for p in np.unique(piece):
            here = piece == p
            velocity[here], displacement[here] = motion_without_drift(
                self.leg, self.profile, int(p), frequency_hz[here], alpha[here]
            )
        return velocity, displacement


def _series(leg: Leg, middle: Floats, power: Floats, radius: Floats, D: int) -> tuple[Complexes, Floats, Floats]:
    """For a sine of unit amplitude and zero phase in mid-window: coefficients (W, D + 1) of ``e^{i omega sigma}``,
    the phase deviation (W, D + 1), and a bound (W,) on the remainder."""
    rate, omega = leg.signed_rate, 2 * np.pi * middle
    deviation = np.zeros((middle.size, D + 1))  # of the phase
    growth = np.zeros((middle.size, D + 1))  # of the amplitude, relative to that in the middle
    growth[:, 0] = 1.0
    for p in range(1, D + 1):
        if leg.logarithmic:
            growth[:, p] = growth[:, p - 1] * (power * rate) / p
            if p > 1:
                deviation[:, p] = omega * rate ** (p - 1) / factorial(p)
        else:
            growth[:, p] = growth[:, p - 1] * (power - (p - 1)) / p * (rate / middle)
    if not leg.logarithmic:
        deviation[:, 2] = np.pi * rate
    product = _product(_exponential(np.asarray(1j * deviation, dtype=np.complex128)), growth, D)

    # series with the absolute values of all coefficients bound the remainders
    growth_major = np.abs(growth)
    swing = _deviation_majorant(leg, omega, radius)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if leg.logarithmic:
            swell = np.exp(np.abs(power * rate) * radius)
        else:
            ratio = np.minimum(np.abs(rate) / middle * radius, 1.0)
            finite = (power >= 0) & (power == np.round(power))  # a polynomial; otherwise bounded by (1 - x)^-|power|
            swell = np.where(
                finite, (1.0 + ratio) ** power, np.where(ratio < 1.0, (1.0 - ratio) ** -np.abs(power), np.inf)
            )
            for p in range(1, D + 1):
                rising = growth_major[:, p - 1] * (np.abs(power) + p - 1) / p * np.abs(rate / middle)
                growth_major[:, p] = np.where(finite, growth_major[:, p], rising)
        major = _product(_exponential(np.abs(deviation).astype(complex)).real, growth_major, D)
        remainder = np.exp(swing) * swell - np.sum(major * radius[:, None] ** np.arange(D + 1), axis=1)
        remainder = np.where(np.isfinite(remainder), np.maximum(remainder, 0.0), np.inf)
    return product, deviation, remainder


def _modulate(polynomial: Floats, omega: Floats, radius: Floats, D: int) -> tuple[Complexes, Floats]:
    """Real polynomials as power series (W, D + 1) times ``e^{i omega sigma}``, with a bound on the remainder."""
    k = polynomial.shape[1]
    spin = np.ones((omega.size, D + 1), dtype=complex)
    for p in range(1, D + 1):
        spin[:, p] = spin[:, p - 1] * (-1j * omega / p)
    padded = np.zeros((omega.size, D + 1))
    padded[:, : min(k, D + 1)] = polynomial[:, : D + 1]
    size = np.abs(polynomial) * radius[:, None] ** np.arange(k)
    major = _product(np.abs(spin), np.abs(padded), D) * radius[:, None] ** np.arange(D + 1)
    whole = np.exp(omega * radius) * size.sum(axis=1)
    return _product(spin, padded, D), np.maximum(whole - major.sum(axis=1), 0.0)


def _twice_integrated(series: Complexes, omega: Floats, value: Complexes, slope: Complexes) -> Complexes:
    """Double integral of ``Re[e^{i omega sigma} sum_p alpha_p sigma^p]`` with given value and slope at 0."""
    out = np.zeros_like(series)
    nu = 1j * omega
    out[:, 0], out[:, 1] = value, slope - nu * value
    for p in range(series.shape[1] - 2):
        out[:, p + 2] = (series[:, p] - 2 * nu * (p + 1) * out[:, p + 1] - nu**2 * out[:, p]) / ((p + 1) * (p + 2))
    return out


def _product(first: NDArray[Any], second: Floats, D: int) -> NDArray[Any]:
    """Product of power series, one per row, up to the power D."""
    return np.stack([np.sum(first[:, : p + 1] * second[:, p::-1], axis=1) for p in range(D + 1)], axis=1)


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


def swept_signals(windows: SweepWindows, carrier: float = 0.0) -> tuple[Signal, ...]:
    """The sine, and for a base its velocity and displacement, as signals for a general flow.

    The pieces are polynomials times ``exp(i carrier t)``: one per window if the carrier has the frequency of the sine,
    otherwise one per eighth of a cycle. Their error is round-off.

    Parameters
    ----------
    windows : W windows.
    carrier : rad/s.

    Returns
    -------
    tuple
        One signal; three for a base: m/s^2, m/s and m.
    """
    difference = windows.omega - carrier
    fine = np.abs(difference) * windows.length * (8 / (2 * np.pi))
    shortest = (windows.length / np.maximum(fine, 1.0)).min()
    # no piece is longer than 8 times the shortest: responses to powers of time are scaled by the longest
    fine = np.maximum(fine, np.where(fine > 1.0, windows.length / (8.0 * shortest), 1.0))
    pieces = np.maximum(np.ceil(fine - 1e-9).astype(int), 1)
    window = np.repeat(np.arange(windows.count), pieces)
    within = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    offset = within * (windows.length[window] / pieces[window])
    start = windows.start[window] + offset
    start[0] = 0.0
    half = 0.5 * windows.length[window] / pieces[window]
    sigma = offset + half - 0.5 * windows.length[window]  # relative to the middle of the window
    turn, degree, rest = float(np.max(np.abs(difference[window]) * half)), 0, 1.0
    while degree < LARGEST_DEGREE or rest * turn > 1e-15 * (degree + 1):
        degree += 1
        rest *= turn / degree
    turning = np.ones((window.size, degree + 1), dtype=complex)
    for p in range(1, degree + 1):
        turning[:, p] = turning[:, p - 1] * (1j * difference[window] / p)
    turning *= np.exp(1j * windows.omega[window] * sigma)[:, None]
    signals = []
    coefficients = [windows.coefficient]
    if windows.displacement is not None:
        coefficients += [windows.velocity, windows.displacement]
    for coefficient in coefficients:
        moved = coefficient[window]
        move(moved, sigma)
        piece = _product(np.pad(moved, ((0, 0), (0, max(degree + 1 - moved.shape[1], 0)))), turning, degree)
        if carrier == 0.0:
            piece = piece.real.astype(complex)
        move(piece, -half)  # in powers of the time since the start of the piece
        piece *= np.exp(-1j * carrier * half)[:, None]
        signals.append(Signal(start, np.array([1j * carrier]), piece[:, None, :]))
    return tuple(signals)


def move(polynomial: NDArray[Any], distance: Floats) -> None:
    """Shift polynomials (k, D + 1) to new centres at distances (k,), in place."""
    D = polynomial.shape[1] - 1
    for i in range(D):
        for p in range(D - 1, i - 1, -1):
            polynomial[:, p] += distance * polynomial[:, p + 1]
