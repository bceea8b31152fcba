"""Expansions in powers of the springs' stiffness and their remainders, to check shooting and the flow against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from beamsim.errors import MethodError
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.orbits.expansions.forced import ResonantForcing, SteadyMotion
from beamsim.orbits.expansions.free import expand_mode, weaken
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Floats

SAMPLES_A_PERIOD = 32
AMPLITUDES = 2000  # points between which steady amplitudes are bracketed


def _times(duration: float, omega: float) -> Floats:
    return np.linspace(0.0, duration, 2 + int(SAMPLES_A_PERIOD * duration * omega / (2 * np.pi)))


def free_remainder(
    system: PiecewiseLinearSystem,
    mode: int,
    amplitude: float,
    factor: float,
    duration: float,
    order: int = 1,
    frequency_order: int | None = None,
) -> float:
    """Largest difference between a free motion near a mode and its expansion, coordinates against the amplitude.

    The exact motion begins at rest from the expansion's initial vector.

    Parameters
    ----------
    system : its springs are multiplied by the factor, its damping is left out.
    duration : s; a fixed one, or one that grows as 1/factor.
    order : of the motion.
    frequency_order : of its frequency (default: one more).
    """
    expansion = expand_mode(system, mode, amplitude)
    n = system.size
    q0 = expansion.initial(factor, order)
    times = _times(duration, expansion.omega)
    undamped = replace(system, damping=np.zeros_like(system.damping), contacts=system.contacts.undamped())
    flow = ExactFlow(weaken(undamped, factor), Forcing(np.zeros((0, n)), ()), duration)
    exact = simulate(flow, np.concatenate([q0, np.zeros(n)]), duration=duration).states_at(times)
    w = expansion.frequency(factor, min(order + 1, 2) if frequency_order is None else frequency_order)
    c = expansion.coefficients(factor, order)
    used = np.flatnonzero(np.any(np.abs(c) > 1e-17 * np.abs(c).max(), axis=1))
    found = np.cos(np.multiply.outer(times, used * w)) @ c[used]
    return float(np.abs(exact[:, :n] - found).max() / abs(amplitude))


def steady(resonant: ResonantForcing, sigma: float) -> tuple[SteadyMotion, ...]:
    """All steady motions at a detuning, the smallest first.

    Raises
    ------
    MethodError : without damping exactly on the backbone of a structure without gap, where no steady motion
    exists.
    """
    from scipy.optimize import brentq

    F = abs(resonant.load[resonant.mode]) / (2.0 * resonant.omega)
    if F == 0.0:
        return ()

    def excess(a: float) -> float:
        return float(a * abs(resonant.backbone(a) - sigma) - F)

    # far below and far above every gap the backbone is flat, so beyond these amplitudes excess has one sign
    c = resonant.system.contacts.one_sided_springs()
    with np.errstate(divide="ignore"):
        reach = np.where(c.shape[:, resonant.mode] != 0, np.abs(resonant.gap / c.shape[:, resonant.mode]), 0.0)
    near = float(np.max(reach[np.isfinite(reach)], initial=0.0))
    floor = abs(resonant.backbone(1e6 * (near + 1.0)) - sigma)
    if floor <= 1e-12 * abs(resonant.backbone(1.0)) or not np.isfinite(floor):
        floor = 1e-12 * max(abs(sigma), 1e-12)
    top = 2.0 * max(F / floor, 2.0 * near)
    grid = np.unique(
        np.concatenate(
            [
                np.geomspace(1e-9 * top, top, AMPLITUDES),
                np.linspace(1e-9 * top, 20.0 * near + F, AMPLITUDES),
            ]
        )
    )
    grid = grid[grid > 0]
    values = grid * np.abs(resonant.backbone(grid) - sigma) - F
    found = [
        float(brentq(excess, grid[i], grid[i + 1], xtol=1e-15 * grid[i + 1], rtol=1e-14))
        for i in np.flatnonzero(values[:-1] * values[1:] < 0)
    ]
    if not found:
        raise MethodError(
            "frequency", "is on the backbone of an undamped structure: its response grows", "give damping"
        )
    return tuple(resonant.motion(a, sigma) for a in found)
