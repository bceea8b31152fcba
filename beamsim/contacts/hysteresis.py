"""Measured loops of a pad: how far loading and unloading differ, and the Maxwell branch that would lose as much."""

from __future__ import annotations

import numpy as np

from beamsim.contacts.force_curve import fit_curve, fitted_numbers, hinges
from beamsim.contacts.pads import MaxwellBranch
from beamsim.typing import Floats

REACH = 30.0  # beyond the record's longest and shortest times, over which they spread


def loop_width(deflection: Floats, force: Floats) -> float:
    """Mean difference between loading and unloading over the largest force; 0 where there is no unloading."""
    step = np.diff(deflection)
    middle, push = 0.5 * (deflection[1:] + deflection[:-1]), 0.5 * (force[1:] + force[:-1])
    rising, falling = step > 0, step < 0
    try:
        # 8: of the curves that are compared
        up, down = (fit_curve(middle[way], push[way], 8)[0] for way in (rising, falling))
    except ValueError:
        return 0.0
    common = np.linspace(0.0, min(up.deflection[-1], down.deflection[-1]), 201)
    return float(np.mean(np.abs(up.at(common) - down.at(common))) / np.abs(force).max())


def fit_branch(time: Floats, deflection: Floats, force: Floats, knots: Floats) -> tuple[MaxwellBranch, float]:
    """The Maxwell branch that, beside a curve, fits a record best; it is relaxed at its beginning.

    For a given relaxation time the record is linear in the slopes and the branch's stiffness.

    Parameters
    ----------
    time, deflection, force : (t,) the record, s, m and N; times increase.
    knots : of the curve, m, the first zero.

    Returns
    -------
    MaxwellBranch, float
        The branch, and the root mean square of what curve and branch together miss, N.
    """
    from scipy.optimize import minimize_scalar

    table = hinges(deflection, knots)

    def fitted(log_time: float) -> tuple[float, float]:
        branch = deflection - relaxed_part(time, deflection, float(np.exp(log_time)))
        numbers, square = fitted_numbers(np.column_stack([table, branch]), force)
        return square, float(numbers[-1])

    longest, shortest = time[-1] - time[0], float(np.median(np.diff(time)))
    tried = np.linspace(np.log(shortest / REACH), np.log(longest * REACH), 60)
    k = int(np.argmin([fitted(each)[0] for each in tried]))
    bounds = (tried[max(k - 1, 0)], tried[min(k + 1, tried.size - 1)])
    best = float(minimize_scalar(lambda each: fitted(each)[0], bounds=bounds, method="bounded").x)
    square, stiffness = fitted(best)
    return MaxwellBranch(stiffness, float(np.exp(best))), float(np.sqrt(square / time.size))


def relaxed_part(time: Floats, deflection: Floats, relaxation_time: float) -> Floats:
    """p of ``tau p' = delta - p`` with the deflection straight between its samples, p at rest at the first.

    Parameters
    ----------
    time, deflection : (t,) samples, s and m.
    relaxation_time : tau, s.

    Returns
    -------
    (t,) m.
    """
    p = np.empty(time.size)
    p[0] = deflection[0]
    h = np.diff(time) / relaxation_time
    decay = np.exp(-h)
    ramp = -np.expm1(-h) / h  # mean of the decay over the step
    for i in range(h.size):
        p[i + 1] = decay[i] * p[i] + (ramp[i] - decay[i]) * deflection[i] + (1.0 - ramp[i]) * deflection[i + 1]
    return p
