r"""Maxwell branches fitted to measurements of a pad: dynamic stiffness over frequency, or relaxation over time.

A spring k beside branches :math:`(k_j, \tau_j)` has the dynamic stiffness
:math:`K'(\omega)(1 + i\eta) = k + \sum_j k_j\, i\omega\tau_j / (1 + i\omega\tau_j)` and, after a sudden unit
deflection, the force :math:`k + \sum_j k_j e^{-t/\tau_j}`; where the deflection rises evenly over a time, the forces of
its parts add up. For given times both are linear in the stiffnesses, which are found by non-negative least squares of
relative errors; the logarithms of the times are found by Gauss and Newton's method about that (variable projection:
G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from beamsim.contacts.pads import MaxwellBranch
from beamsim.typing import Complexes, Floats

REACH = 10.0  # beyond the measured range, over which times are sought


@dataclass(frozen=True)
class BranchFit:
    """A spring and branches beside it, in the order of their times."""

    stiffness: float  # N/m
    branches: tuple[MaxwellBranch, ...]
    misfit: float  # root mean square of the relative errors
    least_misfit: float  # the same with as many branches as there could be
    at_limit: tuple[float, ...]  # s, times that are not determined: at the limit of what was measured


def dynamic_stiffness(stiffness: float, branches: tuple[MaxwellBranch, ...], omega: Floats) -> Complexes:
    """(w,) stiffness of a spring and branches at frequencies, rad/s."""
    k = np.array([stiffness, *(b.stiffness for b in branches)])
    return np.asarray(_dynamic(omega, np.array([b.relaxation_time for b in branches])) @ k)


def relaxation(stiffness: float, branches: tuple[MaxwellBranch, ...], time: Floats, ramp: float = 0.0) -> Floats:
    """(t,) force of a spring and branches at times, s, since a unit deflection began, which rises over ``ramp``, s."""
    k = np.array([stiffness, *(b.stiffness for b in branches)])
    return np.asarray(_relaxing(time, np.array([b.relaxation_time for b in branches]), ramp) @ k)


def fit_dynamic(omega: Floats, storage: Floats, loss_factor: Floats, branches: int | None = None) -> BranchFit:
    """Branches from storage stiffness, N/m, and loss factor at frequencies, rad/s; as few as fit by default.

    Errors are relative to the size of the complex stiffness.
    """
    measured = storage * (1.0 + 1j * loss_factor)

    def matrix(times: Floats) -> Floats:
        columns = _dynamic(omega, times) / np.abs(measured)[:, None]
        return np.vstack([columns.real, columns.imag])

    target = measured / np.abs(measured)
    span = 1.0 / (float(omega.max()) * REACH), REACH / float(omega.min())
    return _fit(matrix, np.concatenate([target.real, target.imag]), omega.size, span, branches)


def fit_relaxation(time: Floats, stiffness: Floats, branches: int | None = None, ramp: float = 0.0) -> BranchFit:
    """Branches from the force over the deflection that is held, N/m, at times, s, since the deflection began.

    It is applied suddenly, or evenly over a time ``ramp``, s; forces measured meanwhile count as well.
    """

    def matrix(times: Floats) -> Floats:
        return _relaxing(time, times, ramp) / stiffness[:, None]

    span = float(time[time > 0.0].min()) / REACH, float(time.max()) * REACH
    return _fit(matrix, np.ones(time.size), time.size, span, branches)


def _dynamic(omega: Floats, times: Floats) -> Complexes:
    turning = 1j * np.multiply.outer(omega, times)
    return np.column_stack([np.ones(omega.size), turning / (1.0 + turning)])


def _relaxing(time: Floats, times: Floats, ramp: float) -> Floats:
    if ramp == 0.0:
        return np.column_stack([np.ones(time.size), np.exp(-time[:, None] / times)])
    loaded = np.minimum(time, ramp)[:, None]  # how long the deflection has risen
    held = np.exp(-(time[:, None] - loaded) / times)
    return np.hstack([loaded / ramp, -times / ramp * np.expm1(-loaded / times) * held])


def _fit(
    matrix: Callable[[Floats], Floats], target: Floats, points: int, span: tuple[float, float], wanted: int | None
) -> BranchFit:
    low, high = np.log(span)
    # 60: relaxation times of the fit that is as good as any number of branches can be
    grid = np.linspace(low, high, 60)
    dense, size = _stiffnesses(matrix(np.exp(grid)), target)
    best, least = size / np.sqrt(points), size / np.sqrt(points)
    most = min(8, points) if wanted is None else wanted
    found: tuple[Floats, Floats, float] | None = None
    for count in range(0 if wanted is None else wanted, most + 1):
        found = _of_count(matrix, target, count, grid, dense[1:])
        # so near the best misfit further branches are not worth it
        if found[2] / np.sqrt(points) <= max(1.2 * best, best + 3e-3):
            break
    assert found is not None
    times, k, size = found
    order = np.argsort(times)
    kept = [i for i in order if k[1 + i] > 0.0]
    ends = np.exp([low, high])
    return BranchFit(
        float(k[0]),
        tuple(MaxwellBranch(float(k[1 + i]), float(times[i])) for i in kept),
        float(size / np.sqrt(points)),
        float(least),
        tuple(float(times[i]) for i in kept if times[i] < 1.01 * ends[0] or times[i] > 0.99 * ends[1]),
    )


def _of_count(
    matrix: Callable[[Floats], Floats], target: Floats, count: int, grid: Floats, spectrum: Floats
) -> tuple[Floats, Floats, float]:
    """Times, stiffnesses and size of the residual of the best fit with so many branches."""
    from scipy.optimize import least_squares

    if count == 0:
        return np.zeros(0), *_stiffnesses(matrix(np.zeros(0)), target)

    def residual(logarithms: Floats) -> Floats:
        columns = matrix(np.exp(logarithms))
        return np.asarray(columns @ _stiffnesses(columns, target)[0] - target)

    low, high = grid[0], grid[-1]
    shares = (np.arange(count) + 0.5) / count
    starts = [low + (high - low) * shares]
    if spectrum.sum() > 0.0:  # where the stiffness of the dense fit lies
        summed = np.cumsum(spectrum + 1e-6 * spectrum.sum())
        starts.append(np.interp(shares * summed[-1], summed, grid))
    fits = [least_squares(residual, start, bounds=(low - 1e-9, high + 1e-9)) for start in starts]
    best = min(fits, key=lambda fit: float(fit.cost))
    times = np.exp(best.x)
    return times, *_stiffnesses(matrix(times), target)


def _stiffnesses(columns: Floats, target: Floats) -> tuple[Floats, float]:
    """Non-negative stiffnesses and the size of the residual."""
    from scipy.optimize import nnls

    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    numbers, size = nnls(columns / scale, target)
    return np.asarray(numbers / scale), float(size)
