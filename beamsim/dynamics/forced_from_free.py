"""From forced to free: the force that holds a damped structure on its nonlinear normal mode (energy balance).

On the mode, in phase quadrature, the force's work over a period pays for what damping takes:

.. math:: A \\oint f^T \\dot q\\, \\sin(\\omega t)\\, dt = \\oint \\dot q^T C \\dot q\\, dt + \\text{contacts'
dashpots}.

A single harmonic force at one place only pays in the mean: the forced motion rides the backbone to first order in the
damping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamsim.dynamics.reversible import NormalMode
from beamsim.model.system import PiecewiseLinearSystem

__all__ = ["Appropriation", "appropriate_force"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Appropriation:
    """A predicted force."""

    level: float  # N, amplitude of the sine force on the pattern given
    omega: float  # rad/s
    start: Floats  # (2n,) state at t = 0, where the force's phase begins
    dissipated: float  # J a period


def appropriate_force(
    damped: PiecewiseLinearSystem, mode: NormalMode, times: Floats, states: Floats, pattern: Floats
) -> Appropriation:
    """The level of ``pattern * sin(omega t)`` that excites a damped structure on a nonlinear mode.

    Parameters
    ----------
    damped : the structure with its damping and dashpots.
    mode : of the undamped structure.
    times, states : (nt,) and (nt, 2n), the mode's motion over one period at equal steps, both ends included, from rest.
    pattern : (n,) generalised force of a unit force.

    Raises
    ------
    ValueError : where the force does no work on the mode (it acts at a node).
    """
    n = damped.size
    v = states[:, n:]
    power = np.einsum("ti,ij,tj->t", v, damped.damping, v)
    c = damped.contacts
    delta = -c.gap - c.sign * (states[:, :n] @ c.shape.T)
    rate = -c.sign * (v @ c.shape.T)
    power = power + np.where(delta > 0, c.dashpot * rate**2, 0.0).sum(axis=1)
    period = mode.period
    step = times[1] - times[0]
    dissipated = float(np.sum(power[:-1]) * step)
    omega = 2 * np.pi / period
    # from rest at its far side, half a period on, the motion has velocities like +sin
    work = -float(np.sum((v @ pattern)[:-1] * np.sin(omega * times[:-1])) * step)
    reach = float(np.sqrt(np.sum((v @ pattern)[:-1] ** 2) * step * period))
    if reach == 0.0 or abs(work) < 1e-9 * reach:
        raise ValueError("the force does no work on this mode (it acts at a node); apply it elsewhere")
    half = states[(times.size - 1) // 2]
    return Appropriation(dissipated / work, omega, half.copy(), dissipated)
