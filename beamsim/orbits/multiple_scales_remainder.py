"""Remainders of the multiple-scales expansions, measured against the exact motion over short and long times."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.orbits.multiple_scales import expand_mode, weakened
from beamsim.system.equations import Forcing
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.orbits.multiple_scales_forced import ResonantForcing
    from beamsim.system.equations import PiecewiseLinearSystem

SAMPLES_A_PERIOD = 32


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
    flow = ExactFlow(weakened(system, factor), Forcing(np.zeros((0, n)), ()), duration)
    exact = simulate(flow, np.concatenate([q0, np.zeros(n)]), duration=duration).states_at(times)
    found = expansion.states(factor, times, order, frequency_order)
    return float(np.abs(exact[:, :n] - found[:, :n]).max() / abs(amplitude))


def forced_remainder(resonant: ResonantForcing, sigma: float, start: complex, factor: float, duration: float) -> float:
    """Largest difference between a motion shaken near a mode and its leading term with slow amplitude, against the
    amplitude.

    The exact motion begins with ``Re(start)`` and the velocity ``Re(i omega start)`` in the mode, everything else at
    rest.
    """
    system, j = resonant.system, resonant.mode
    n, omega = system.size, resonant.omega + factor * sigma
    y0 = np.zeros(2 * n)
    y0[j], y0[n + j] = start.real, -omega * start.imag
    times = _times(duration, omega)
    F = factor * resonant.load
    forcing = Forcing(
        np.array([F.real, F.imag]), (Signal.harmonic(1.0, omega, np.pi / 2), Signal.harmonic(-1.0, omega))
    )
    exact = simulate(ExactFlow(weakened(system, factor, factor), forcing, duration), y0, duration=duration).states_at(
        times
    )
    Q = resonant.slow_flow(start, sigma, factor * times)
    found = np.zeros((times.size, n))
    found[:, j] = (Q * np.exp(1j * omega * times)).real
    return float(np.abs(exact[:, :n] - found).max() / np.abs(Q).max())
