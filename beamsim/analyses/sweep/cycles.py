"""Values of a motion under a sine, cycle by cycle: extremes, mean squares, tracked harmonics, contacts and energies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.sweep.result import SweepCurve
from beamsim.flow.trajectory import Trajectory, not_finite
from beamsim.inputs.swept import SweepWindows, move
from beamsim.outcomes import Outcome, OutcomeKind, Where, first_with_others
from beamsim.responses.energies import LARGEST_ERROR, power_factors, stored_at_ends
from beamsim.responses.jumps import contact_jumps
from beamsim.system.equations import RowsOf
from beamsim.typing import Bools, Complexes, Floats, Ints

NEGLIGIBLE_POWER = 1e-11  # power of a tracking filter that is neglected


@dataclass(frozen=True)
class SinePhase:
    """Phase of a sine, ``2 pi (turns + part) + omega sigma + deviation(sigma)``, with sigma since ``time``.

    The fields describe W windows.
    """

    start: Floats  # (W,) s
    time: Floats  # (W,) s
    omega: Floats  # (W,) rad/s
    turns: Ints  # (W,) complete turns
    turn_fraction: Floats  # (W,) fraction of a turn
    deviation: Floats  # (W, D + 1) rad

    @classmethod
    def of_windows(cls, windows: SweepWindows) -> SinePhase:
        """Phase of a swept sine."""
        middle = windows.start + 0.5 * windows.length
        return cls(windows.start, middle, windows.omega, windows.cycle, windows.fraction, windows.deviation)

    @classmethod
    def constant(cls, omega: float) -> SinePhase:
        """Phase of a sine with constant frequency, from t = 0."""
        zero, none = np.zeros(1), np.zeros(1, dtype=np.int64)
        return cls(zero, zero, np.array([omega]), none, zero, zero[None])

    def filters(self, order: float, time: Floats, length: Floats) -> tuple[Complexes, Complexes]:
        """Factors of ``exp(-i order phase)`` times the phase's rate on segments: a polynomial times an exponential.

        Parameters
        ----------
        order : multiple of the phase; for order 0 the phase's rate is replaced by 1.
        time, length : (n,) start and length of segments, s, none of which crosses a window boundary. Exponents refer to
            the frequency at the middle of a segment, polynomials to the time since its start.

        Returns
        -------
        exponent : (n,) 1/s.
        polynomial : (n, D + 1) coefficients, 1/s, of increasing powers of the time in s; negligible highest powers are
        dropped.
        """
        if order == 0.0:
            return np.zeros(time.size, dtype=complex), np.ones((time.size, 1), dtype=complex)
        at = np.clip(np.searchsorted(self.start, time, side="right") - 1, 0, None)
        since, deviation = time + 0.5 * length - self.time[at], self.deviation[at]
        move(deviation, since)
        turns, omega, D = order * self.turns[at], self.omega[at], deviation.shape[1] - 1
        angle = 2 * np.pi * (turns - np.floor(turns) + order * self.turn_fraction[at]) + order * omega * since
        angle += order * deviation[:, 0]
        if D > 0:
            omega = omega + deviation[:, 1]
            deviation[:, 1] = 0.0
        powers = np.arange(1, D + 1)
        carrier, rate = np.zeros(deviation.shape, dtype=complex), np.zeros_like(deviation)
        carrier[:, 0], rate[:, 0] = np.exp(-1j * angle), omega
        rate[:, :-1] += deviation[:, 1:] * powers
        for p in range(1, D + 1):
            terms = powers[:p] * deviation[:, 1 : p + 1] * carrier[:, p - 1 :: -1][:, :p]
            carrier[:, p] = terms.sum(axis=1) * (-1j * order / p)
        polynomial = np.stack([(carrier[:, : p + 1] * rate[:, p::-1]).sum(axis=1) for p in range(D + 1)], axis=1)
        size = np.abs(polynomial) * (0.5 * length[:, None]) ** np.arange(D + 1)
        used = np.flatnonzero(np.any(size > NEGLIGIBLE_POWER * size[:, :1], axis=0))
        polynomial = polynomial[:, : int(used.max()) + 1]
        move(polynomial, -0.5 * length)
        exponent = np.asarray(-1j * order * omega)
        return exponent, np.asarray(polynomial * np.exp(-0.5 * exponent * length)[:, None])


@dataclass(frozen=True)
class CycleRecord:
    """Values of K outputs in C cycles, with R orders, m contacts, and p contacts pressed by others."""

    high: Floats  # (C, K); nan if not searched
    low: Floats  # (C, K)
    mean_square: Floats  # (C, K), time average over the cycle
    harmonic: Complexes  # (C, K, R) amplitude of cos(order phase) minus i times that of sin; for order 0 the mean
    contact_share: Floats  # (C, m)
    closings: Ints  # (C, m)
    imbalance: Floats  # (C,) J, dissipated energy plus change of the stored energy minus work of the loads
    energy: Floats  # (C,) J, largest kinetic and strain energy of the structure at ends of segments
    jumps: Floats  # (C, 2, m) largest jump of each contact's force, N, and sum of the squares of all, N^2
    pressing: Floats  # (C, 2, p) sums of the normal force where a contact begins to slide, N, and of its square
    duration: Floats  # (C,) s
    cycles: Ints  # (C,) cycles that a row represents

    @property
    def count(self) -> int:
        """Number of cycles, C."""
        return int(self.energy.size)

    @classmethod
    def join(cls, parts: Sequence[CycleRecord]) -> CycleRecord:
        """Concatenate records of successive cycles."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))

    def select(self, cycles: Ints | slice) -> CycleRecord:
        """Record of selected cycles."""
        return CycleRecord(*(getattr(self, f.name)[cycles] for f in fields(self)))

    def merge(self) -> CycleRecord:
        """Combine all cycles into one row."""
        weight = self.duration / self.duration.sum()
        return CycleRecord(
            high=self.high.max(axis=0, keepdims=True),
            low=self.low.min(axis=0, keepdims=True),
            mean_square=weight[None] @ self.mean_square,
            harmonic=np.asarray(np.tensordot(weight[None], self.harmonic, 1)),
            contact_share=weight[None] @ self.contact_share,
            closings=self.closings.sum(axis=0, keepdims=True),
            imbalance=self.imbalance.sum(keepdims=True),
            energy=self.energy.max(keepdims=True),
            jumps=np.stack([self.jumps[:, 0].max(axis=0), self.jumps[:, 1].sum(axis=0)])[None],
            pressing=self.pressing.sum(axis=0, keepdims=True),
            duration=self.duration.sum(keepdims=True),
            cycles=self.cycles.sum(keepdims=True),
        )

    def merge_incomplete_cycle(self) -> CycleRecord:
        """Merge the last, incomplete cycle into the one before (except its harmonics)."""
        whole = CycleRecord.join([self.select(slice(-2)), self.select(slice(-2, None)).merge()])
        harmonic = np.concatenate([whole.harmonic[:, :, :1], self.harmonic[:-1, :, 1:]], axis=2)
        return replace(whole, harmonic=harmonic, cycles=self.cycles[:-1])

    def tracked(self, orders: Sequence[float]) -> Complexes:
        """(R, C, K) complex amplitudes of the R orders, each over the fewest cycles in which the order repeats.

        An order p/q repeats after q cycles: row c covers the cycles c - q + 1 to c; rows before q - 1 are nan.
        """
        out = np.moveaxis(self.harmonic, 2, 0).copy()
        for one, order in zip(out, orders, strict=True):
            q = Fraction(float(order)).limit_denominator(64).denominator
            if q > 1:
                total = np.cumsum(np.concatenate([np.zeros((1, one.shape[1])), one]), axis=0)
                one[q - 1 :] = (total[q:] - total[:-q]) / q
                one[: q - 1] = complex(np.nan, np.nan)
        return out


def record_cycles(
    motion: Trajectory,
    cycle_ends: Floats,
    output_of: RowsOf,
    orders: Sequence[float],
    phase: SinePhase,
    searched_outputs: Ints | slice = slice(None),
) -> CycleRecord:
    """Evaluate a motion cycle by cycle.

    Parameters
    ----------
    motion : motion without segments across cycle ends.
    cycle_ends : (C + 1,) ends of the cycles, s.
    output_of : rows of the K outputs as a function of the contacts' phases.
    orders : R tracked harmonics, multiples of the instantaneous frequency.
    phase : phase of the sine.
    searched_outputs : outputs whose extremes are searched; all by default.

    Returns
    -------
    CycleRecord
        Contains only the cycles that were computed.
    """
    count = cycle_ends.size - 1
    cycle = np.clip(np.searchsorted(cycle_ends, motion.time, side="right") - 1, 0, count - 1)
    duration = np.diff(cycle_ends)[:, None]

    def sum_over_cycles(values: NDArray[Any]) -> NDArray[Any]:
        out = np.zeros((count, *values.shape[1:]), dtype=values.dtype)
        np.add.at(out, cycle, values)
        return out

    harmonic: Complexes = sum_over_cycles(_harmonics(motion, output_of, orders, phase))
    square, imbalance = _products(motion, output_of)
    high, low = np.full((2, count, square.shape[1]), np.nan)
    found = motion.extrema(lambda phases: output_of(phases)[searched_outputs], cycle_ends)
    low[:, searched_outputs], high[:, searched_outputs] = found.low, found.high
    touching = motion.flow.system.contacts.closed(motion.phases)
    closings = np.zeros((count, touching.shape[1]), dtype=np.int64)
    closes = motion.touch_changes > 0
    of_event = np.clip(np.searchsorted(cycle_ends, motion.event_time[closes], side="right") - 1, 0, count - 1)
    np.add.at(closings, (of_event, motion.event_contact[closes]), 1)
    return CycleRecord(
        high=high,
        low=low,
        mean_square=sum_over_cycles(square) / duration,
        harmonic=np.asarray(harmonic / np.where(np.asarray(orders) == 0.0, duration[:, :, None], np.pi)),
        contact_share=sum_over_cycles(touching * motion.length[:, None]) / duration,
        closings=closings,
        imbalance=sum_over_cycles(imbalance),
        energy=_largest_energy(motion, cycle, count),
        jumps=_jumps(motion, cycle_ends),
        pressing=sum_over_cycles(_normal_force_at_sliding_start(motion)),
        duration=np.diff(cycle_ends),
        cycles=np.ones(count, dtype=np.int64),
    )  # fmt: skip


def _products(motion: Trajectory, output_of: RowsOf) -> tuple[Floats, Floats]:
    """Integrals over each segment of the squared outputs (S, K), and its energy imbalance (S,), J.

    A loss at the instant where the next segment begins belongs to this segment.
    """
    flow = motion.flow
    left, right, weight = power_factors(flow)
    outputs = output_of(flow.system.contacts.start).shape[0]
    weights = np.zeros((outputs + weight.shape[0], outputs + 2))
    weights[:outputs, :outputs], weights[outputs:, outputs:] = np.eye(outputs), weight

    def above(factors: RowsOf) -> RowsOf:
        def row_products(phases: Ints) -> Floats:
            return np.vstack([output_of(phases), factors(phases)])

        return row_products

    with np.errstate(over="ignore", invalid="ignore"):  # values that are not finite show in the balance
        integrals = motion.segment_integrals(above(left), above(right), weights)
        dissipated, work_in = integrals[:, outputs:].T
        lost = np.append(motion.event_losses().sum(axis=1)[1:], 0.0)
        return integrals[:, :outputs], dissipated - work_in + np.diff(stored_at_ends(motion)) + lost


def _harmonics(motion: Trajectory, output_of: RowsOf, orders: Sequence[float], phase: SinePhase) -> Complexes:
    """(S, K, R) integrals over each segment and the phase of ``output exp(-i order phase)``; over time for order 0."""
    filters = [phase.filters(order, motion.time, motion.length) for order in orders]
    longest = max((polynomial.shape[1] for _, polynomial in filters), default=1)
    exponent = np.array([exponent for exponent, _ in filters]).reshape(len(filters), motion.time.size)
    padded = [np.pad(polynomial, ((0, 0), (0, longest - polynomial.shape[1]))) for _, polynomial in filters]
    polynomial = np.array(padded).reshape(*exponent.shape, longest)
    return np.moveaxis(motion.weighted_integrals(output_of, exponent, polynomial), 0, 2)


def _largest_energy(motion: Trajectory, cycle: Ints, count: int) -> Floats:
    """(C,) largest kinetic plus strain energy of the structure at ends of segments, J."""
    n, ends = motion.flow.system.size, np.vstack([motion.y[1:], motion.final_y])
    with np.errstate(over="ignore", invalid="ignore"):
        energy = 0.5 * (ends[:, n : 2 * n] ** 2).sum(axis=1) + 0.5 * ends[:, :n] ** 2 @ motion.flow.system.stiffness
        largest = np.zeros(count)
        np.maximum.at(largest, cycle, energy)
    return largest


def _jumps(motion: Trajectory, cycle_ends: Floats) -> Floats:
    """(C, 2, m) largest jump of each contact's force between cycle ends, N, and sum of all squared jumps, N^2."""
    time, size = contact_jumps(motion)
    cycle = np.clip(np.searchsorted(cycle_ends, time, side="right") - 1, 0, cycle_ends.size - 2)
    found = np.zeros((cycle_ends.size - 1, 2, size.shape[1]))
    np.maximum.at(found[:, 0], cycle, size)
    np.add.at(found[:, 1], cycle, size**2)
    return found


def _normal_force_at_sliding_start(motion: Trajectory) -> Floats:
    """(S, 2, p) normal forces, N, and their squares, where a contact begins to slide and loses spring energy.

    The loss follows the normal force at that instant. Zero for segments that begin otherwise.
    """
    contacts = motion.flow.system.contacts
    force = np.zeros((motion.time.size, contacts.pressed_contacts.size))
    if contacts.pressed_contacts.size:
        phases = motion.phases
        begins = np.zeros(force.shape, dtype=bool)
        begins[1:] = contacts.pressing_losses(phases[:-1], phases[1:]) > 0.0
        if begins.any():
            force = motion.sample(motion.time, lambda of: motion.flow.at(of).normal_force) * begins
    return np.stack([force, force**2], axis=1)


def energy_errors(imbalance: Floats, energy: Floats, complete: Bools | None = None) -> Floats:
    """Accumulated energy imbalance at each complete cycle, relative to the largest energy.

    The last complete cycle includes what follows it: a sweep may end within a cycle, which has no row.

    Parameters
    ----------
    imbalance, energy : (C,) values of all cycles, J.
    complete : (C,) True for complete cycles; all by default.

    Returns
    -------
    (n,) array
        Relative, for the complete cycles; in J if there is no energy.
    """
    missing = np.abs(np.cumsum(imbalance))
    scale = float(np.max(energy, initial=0.0))
    errors = np.asarray(missing if scale == 0.0 else missing / scale)
    if complete is None:
        return errors
    last = int(np.flatnonzero(complete)[-1])
    errors[last] = np.max(errors[last:])
    return np.asarray(errors[complete])


def check_balance(outcome: Outcome, curves: Iterable[SweepCurve]) -> Outcome:
    """Mark the outcome of a level as not reliable if a curve violates the energy balance."""
    parts = []
    for curve in curves:
        error = curve["energy_error"].values
        bad = np.flatnonzero(~(error <= LARGEST_ERROR))
        if bad.size and not np.all(np.isfinite(error)):
            parts.append(not_finite(float(curve.time[bad[0]])))
        elif bad.size:
            first = float(curve.frequency_hz[bad[0]])
            part = Outcome.of(
                OutcomeKind.UNTRUSTED, "sweep_energy_not_balanced",
                f"sweeping {curve.direction}, the energy balance is off by {error.max():.2g} of the energy, from "
                f"{first:.6g} Hz on by more than {LARGEST_ERROR:g}",
                at=Where(curve.level, curve.level_unit, "level"), remedy="sweep a smaller range around it",
                error=float(error.max()), frequency=first,
            )  # fmt: skip
            parts.append(part)
    return first_with_others([*parts, *outcome.unless_complete]) if parts else outcome
