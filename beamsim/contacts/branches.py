"""Fit of Maxwell branches to pad tests (dynamic, relaxation, loops), and the force of a pad under a given
deflection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from beamsim.contacts.pads import ForceCurve, MaxwellBranch, fitted_numbers, hinges, relaxed_part
from beamsim.outcomes import COMPLETE, MOST_LISTED, Outcome, OutcomeKind, first_of
from beamsim.typing import Complexes, Floats, Ints

NEGLIGIBLE_STIFFNESS = 1e-6  # relative stiffness of the branches, below which a fitted spring counts as zero
TIME_RANGE_FACTOR = 10.0  # factor beyond the measured range in which relaxation times are searched


@dataclass(frozen=True)
class BranchFit:
    """Fitted springs, and Maxwell branches parallel to them, in the order of their times."""

    springs: Floats  # N/m: one, or the slopes of a curve
    branches: tuple[MaxwellBranch, ...]
    misfit: float  # root mean square of the relative errors
    least_misfit: float  # misfit with as many branches as possible
    undetermined_times: tuple[float, ...]  # s, relaxation times that the measurements do not determine

    @property
    def outcome(self) -> Outcome:
        """Outcome of the fit; not reliable if it ended at its bounds: undetermined times, or zero stiffness at rest."""
        ended = []
        if self.undetermined_times:
            times = first_of([f"{time:.3g} s" for time in self.undetermined_times], MOST_LISTED)
            ended.append(f"relaxation times at the limit of what was measured on the pad: {times}")
        if self.springs.max() <= NEGLIGIBLE_STIFFNESS * sum(branch.stiffness for branch in self.branches):
            ended.append("the pad has no stiffness left after a long rest in these measurements")
        if not ended:
            return COMPLETE
        remedy = "measure longer, slower or faster, or allow fewer branches"
        return Outcome.of(
            OutcomeKind.UNTRUSTED, "at_bound", "; ".join(ended), remedy=remedy, times=self.undetermined_times
        )

    @property
    def stiffness(self) -> float:
        """Stiffness of the spring, or of the first segment, N/m."""
        return float(self.springs[0])


def dynamic_stiffness(stiffness: float, branches: tuple[MaxwellBranch, ...], omega: Floats) -> Complexes:
    """Complex stiffness of a spring with Maxwell branches in parallel with it.

    Parameters
    ----------
    stiffness : stiffness of the spring, N/m.
    branches : Maxwell branches parallel to it.
    omega : (w,) angular frequencies, rad/s.

    Returns
    -------
    (w,) array
        N/m.
    """
    k = np.array([stiffness, *(b.stiffness for b in branches)])
    return np.asarray(_dynamic(omega, np.array([b.relaxation_time for b in branches])) @ k)


def relaxation(stiffness: float, branches: tuple[MaxwellBranch, ...], time: Floats, ramp: float = 0.0) -> Floats:
    """Force of a spring with parallel Maxwell branches under a constant unit deflection.

    Parameters
    ----------
    stiffness : stiffness of the spring, N/m.
    branches : Maxwell branches parallel to it.
    time : (t,) time since the start of the deflection, s.
    ramp : time over which the deflection rises linearly, s; 0 for a sudden deflection.

    Returns
    -------
    (t,) array
        N/m.
    """
    k = np.array([stiffness, *(b.stiffness for b in branches)])
    return np.asarray(_relaxing(time, np.array([b.relaxation_time for b in branches]), ramp) @ k)


def fit_dynamic(omega: Floats, storage: Floats, loss_factor: Floats, branches: int | None = None) -> BranchFit:
    """Fit Maxwell branches to a dynamic test.

    Errors are relative to the size of the complex stiffness.

    Parameters
    ----------
    omega : (w,) angular frequencies, rad/s.
    storage, loss_factor : (w,) measured storage stiffness, N/m, and loss factor.
    branches : number of branches; by default the smallest number that fits nearly as well as any larger one.

    Returns
    -------
    BranchFit
    """
    measured = storage * (1.0 + 1j * loss_factor)

    def matrix(times: Floats) -> Floats:
        columns = _dynamic(omega, times) / np.abs(measured)[:, None]
        return np.vstack([columns.real, columns.imag])

    target = measured / np.abs(measured)
    span = 1.0 / (float(omega.max()) * TIME_RANGE_FACTOR), TIME_RANGE_FACTOR / float(omega.min())
    return _fit(matrix, np.concatenate([target.real, target.imag]), omega.size, span, branches)


def fit_relaxation(time: Floats, stiffness: Floats, branches: int | None = None, ramp: float = 0.0) -> BranchFit:
    """Fit Maxwell branches to a relaxation test.

    The deflection is applied suddenly or linearly; forces measured during the rise are used too.

    Parameters
    ----------
    time : (t,) time since the start of the deflection, s.
    stiffness : (t,) force over the final deflection, N/m.
    branches : number of branches; by default the smallest number that fits nearly as well as any larger one.
    ramp : time over which the deflection rises, s.

    Returns
    -------
    BranchFit
    """

    def matrix(times: Floats) -> Floats:
        return _relaxing(time, times, ramp) / stiffness[:, None]

    span = float(time[time > 0.0].min()) / TIME_RANGE_FACTOR, float(time.max()) * TIME_RANGE_FACTOR
    return _fit(matrix, np.ones(time.size), time.size, span, branches)


def fit_loop(time: Floats, deflection: Floats, force: Floats, knots: Floats) -> BranchFit:
    """Fit slopes of a curve and Maxwell branches to a record of loading and unloading that starts relaxed.

    A loop determines branches up to about its tenth harmonic; shorter times could make the pad arbitrarily stiff in an
    impact. Errors are relative to the largest force. Samples without force, where contact may be lost, are ignored.

    Parameters
    ----------
    time, deflection, force : (t,) the record, s, m and N; times increase.
    knots : (s,) deflections at the segment ends, m, the first zero.

    Returns
    -------
    BranchFit
        With one spring for each segment.
    """
    top, pressed = float(np.abs(force).max()), np.maximum(deflection, 0.0)
    springs, held = hinges(pressed, knots), force > 0.01 * top

    def matrix(times: Floats) -> Floats:
        return np.hstack([springs, pressed[:, None] - relaxed_part(time, pressed, times)])[held] / top

    span = 1.0 / (2 * np.pi * 10.0 * loop_frequency(time, deflection)), float(time[-1] - time[0])
    return _fit(matrix, force[held] / top, int(held.sum()), span, None, knots.size)


def turning_points(deflection: Floats) -> Ints:
    """Indices at which a record of loops changes direction; noise around half the largest deflection is ignored."""
    offset = deflection / float(deflection.max()) - 0.5
    far = np.flatnonzero(np.abs(offset) > 0.1)
    passed = np.split(far, 1 + np.flatnonzero(np.diff(offset[far] > 0.0)))
    return np.array([there[np.argmax(np.abs(offset[there]))] for there in passed])


def loop_frequency(time: Floats, deflection: Floats) -> float:
    """Number of loops in a record over its duration, Hz."""
    return max(turning_points(deflection).size // 2, 1) / float(time[-1] - time[0])


def driven_force(curve: ForceCurve, branches: tuple[MaxwellBranch, ...], time: Floats, deflection: Floats) -> Floats:
    """Force of a no-tension pad under a prescribed deflection, initially relaxed; see `beamsim.contacts.pads`.

    Parameters
    ----------
    curve, branches : properties of the pad.
    time, deflection : (t,) s, increasing, and m; linear between samples.

    Returns
    -------
    (t,) array
        N.
    """
    k, tau = np.array([b.stiffness for b in branches]), np.array([b.relaxation_time for b in branches])
    far = 1e3 * curve.deflection[-1]  # larger than any deflection of the face
    knots = np.append(curve.deflection, far)
    upwards = curve.at(knots) + k.sum() * knots  # force of the pad, except for what has relaxed
    face = max(float(deflection[0]), 0.0)
    force, p = np.zeros(time.size), np.full(k.size, face)
    for i, h in enumerate(np.diff(time), start=1):
        decay, mean = np.exp(-h / tau), -np.expm1(-h / tau) * tau / h
        left = np.maximum(float(np.interp(k @ p, upwards, knots)), 0.0)
        before, face = face, max(float(deflection[i]), left)
        p = decay * p + (mean - decay) * before + (1.0 - mean) * face
        if face == deflection[i]:
            force[i] = max(float(np.interp(face, knots, upwards)) - float(k @ p), 0.0)
    return force


def _dynamic(omega: Floats, times: Floats) -> Complexes:
    turning = 1j * np.multiply.outer(omega, times)
    return np.column_stack([np.ones(omega.size), turning / (1.0 + turning)])


def _relaxing(time: Floats, times: Floats, ramp: float) -> Floats:
    if ramp == 0.0:
        return np.column_stack([np.ones(time.size), np.exp(-time[:, None] / times)])
    loaded = np.minimum(time, ramp)[:, None]  # time during which the deflection rose
    held = np.exp(-(time[:, None] - loaded) / times)
    return np.hstack([loaded / ramp, -times / ramp * np.expm1(-loaded / times) * held])


DENSE_FIT_TIMES = 60  # relaxation times in the reference fit with the smallest possible misfit


def _fit(
    matrix: Callable[[Floats], Floats], target: Floats, point_count: int, time_range: tuple[float, float],
    branch_count: int | None, springs: int = 1,
) -> BranchFit:  # fmt: skip
    low, high = np.log(time_range)
    grid = np.linspace(low, high, DENSE_FIT_TIMES)
    dense, square = fitted_numbers(matrix(np.exp(grid)), target)
    best = least = np.sqrt(square / point_count)
    most = min(8, point_count) if branch_count is None else branch_count
    found: tuple[Floats, Floats, float] | None = None
    for count in range(0 if branch_count is None else branch_count, most + 1):
        found = _of_count(matrix, target, count, grid, dense[springs:])
        # so close to the best misfit more branches are not worthwhile
        if np.sqrt(found[2] / point_count) <= max(1.2 * best, best + 3e-3):
            break
    assert found is not None
    times, k, square = found
    order = np.argsort(times)
    kept = [i for i in order if k[springs + i] > 0.0]
    ends = np.exp([low, high])
    return BranchFit(
        k[:springs],
        tuple(MaxwellBranch(float(k[springs + i]), float(times[i])) for i in kept),
        float(np.sqrt(square / point_count)),
        float(least),
        tuple(float(times[i]) for i in kept if times[i] < 1.01 * ends[0] or times[i] > 0.99 * ends[1]),
    )


def _of_count(
    matrix: Callable[[Floats], Floats], target: Floats, count: int, grid: Floats, spectrum: Floats
) -> tuple[Floats, Floats, float]:
    """Times, stiffnesses and squared misfit of the best fit with a given number of branches."""
    from scipy.optimize import least_squares

    if count == 0:
        return np.zeros(0), *fitted_numbers(matrix(np.zeros(0)), target)

    def residual(logarithms: Floats) -> Floats:
        columns = matrix(np.exp(logarithms))
        return np.asarray(columns @ fitted_numbers(columns, target)[0] - target)

    low, high = grid[0], grid[-1]
    shares = (np.arange(count) + 0.5) / count
    starts = [low + (high - low) * shares]
    if spectrum.sum() > 0.0:  # start at times where the dense fit has its stiffness
        summed = np.cumsum(spectrum + 1e-6 * spectrum.sum())
        starts.append(np.interp(shares * summed[-1], summed, grid))
    fits = [least_squares(residual, start, bounds=(low - 1e-9, high + 1e-9)) for start in starts]
    best = min(fits, key=lambda fit: float(fit.cost))
    times = np.exp(best.x)
    return times, *fitted_numbers(matrix(times), target)
