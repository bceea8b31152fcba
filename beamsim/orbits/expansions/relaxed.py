"""Relaxed minimisation (Hazim 2010), for comparison: the deviation from periodicity is minimised step by step.

The functional is :math:`J(q_0, T) = |q(T) - q_0|^2_\\Omega + |\\dot q(T)|^2` of a motion started at rest, energies as
weights, over twice the energy, with the energy's own excess; it is *relaxed*: a step counts as done when J falls below
a tolerance (1e-5 or 1e-6 in Hazim 2010), from the result of the step before. No stability, no tongues, and a jump to
another branch goes unnoticed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from beamsim.flow.compiled import processor_time
from beamsim.orbits.free_orbits import BrakeOrbits
from beamsim.typing import Floats

SHORTEST, LONGEST = 0.5, 1.5  # of the last step's period: J vanishes as the period does, which is no motion


@dataclass(frozen=True)
class RelaxedStep:
    """One step of the path."""

    factor: float
    shape: Floats  # (n,)
    period: float  # s
    functional: float
    motions: int  # motions computed for this step
    processor_time_s: float
    converged: bool  # whether the functional fell below the tolerance
    stalled: bool  # whether the optimiser ended by itself before that, its iterations not used up


def relaxed_path(
    orbits: BrakeOrbits, start: Floats, factors: Floats, tolerance: float = 1e-6, iterations: int = 200
) -> Iterator[RelaxedStep]:
    """Minimise J at each factor by a quasi-Newton method (L-BFGS-B), from the last result.

    ``start`` are unknowns as of :func:`~beamsim.orbits.free_orbits.linear_mode`: a motion at the factor before the
    first one.

    Parameters
    ----------
    orbits : the shooting problem, which gives structure and energy.
    start : (n + 2,) unknowns.
    factors : of the springs' stiffness, in the order of the path.
    tolerance : of the functional.
    iterations : of the optimiser, at each factor.

    Returns
    -------
    The steps, one after the other.
    """
    from scipy.optimize import minimize

    n = orbits.n
    omega = np.maximum(orbits.family.omega, 0.2 * np.pi / start[-2])  # a rigid-body mode has none of its own
    weight = np.append(np.sqrt(2 * orbits.energy) / omega, start[-2])
    x = start[: n + 1] / weight
    for factor in factors.tolist():
        begin, earlier = processor_time(), orbits.family.motions_computed
        bounds = [(None, None)] * n + [(SHORTEST * float(x[n]), LONGEST * float(x[n]))]
        value, remaining, stalls = np.inf, iterations, 0
        # 3: restarts of the optimiser, forgetting its curvature, that gained nothing: it is at a minimum
        while remaining > 0 and stalls < 3 and value > tolerance:
            done = minimize(
                _deviation, x, args=(orbits, factor, omega, weight), jac=True, method="L-BFGS-B", bounds=bounds,
                options={"maxiter": remaining, "maxfun": 20 * remaining, "gtol": 0.0, "ftol": 0.0, "maxcor": n + 1},
                callback=lambda intermediate_result: _check_reached(intermediate_result.fun, tolerance),
            )  # fmt: skip
            x, remaining = done.x, remaining - max(int(done.nit), 1)
            # 0.99: of the functional or less counts as gained
            stalls += done.fun > 0.99 * value
            value = float(done.fun)
        yield RelaxedStep(
            factor, x[:n] * weight[:n], float(x[n] * weight[n]), value, orbits.family.motions_computed - earlier,
            processor_time() - begin, value <= tolerance, remaining > 0,
        )  # fmt: skip


def _deviation(w: Floats, orbits: BrakeOrbits, factor: float, omega: Floats, weight: Floats) -> tuple[float, Floats]:
    """The functional at a factor with its gradient, of the shape and the period over their weights (n + 1,)."""
    n, energy, family = orbits.n, orbits.energy, orbits.family
    q, period = w[:n] * weight[:n], float(w[n] * weight[n])
    flow_map = family.flow_at(factor)[0].flow_map(np.append(q, np.zeros(n)), period)
    miss = np.concatenate([omega * (flow_map.end[:n] - q), flow_map.end[n : 2 * n]])
    J = np.zeros((2 * n, n + 1))
    J[:n, :n] = omega[:, None] * (flow_map.transition[:n, :n] - np.eye(n))
    J[n:, :n] = flow_map.transition[n : 2 * n, :n]
    J[:n, n], J[n:, n] = omega * flow_map.slope[:n], flow_map.slope[n : 2 * n]
    value, gradient, _ = family.potential(q, factor)
    excess = value / energy - 1.0
    total = float(miss @ miss) / (2 * energy) + excess**2
    by = (J.T @ miss) / energy
    by[:n] += 2 * excess * gradient / energy
    return total, by * weight


def _check_reached(value: float, tolerance: float) -> None:
    if value <= tolerance:
        raise StopIteration
