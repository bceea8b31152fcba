"""Expansions in powers of the springs' stiffness and their remainders, to check shooting and the flow against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.passage import PeriodicForcing
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.orbits.aft import one_sided
from beamsim.orbits.multiple_scales import HARMONICS, RESONANT, expand_mode, product_harmonics, weakened
from beamsim.orbits.multiple_scales_forced import ResonantForcing, _states
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats

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


@dataclass(frozen=True)
class ForcedExpansion:
    """Steady response away from resonance, in powers of the stiffness factor."""

    omega: float  # rad/s
    terms: tuple[Complexes, Complexes, Complexes]  # q_0, q_1, q_2: (H + 1, n) each

    def coefficients(self, factor: float, order: int = 1) -> Complexes:
        """(H + 1, n) harmonics of the motion to order 0, 1 or 2."""
        total = self.terms[0].copy()
        for power, term in enumerate(self.terms[1 : order + 1], start=1):
            total += factor**power * term
        return total

    def states(self, factor: float, times: Floats, order: int = 1) -> Floats:
        """(nt, 2n) displacements and velocities."""
        return _states(self.coefficients(factor, order), self.omega, times)


def expand_forced(
    system: PiecewiseLinearSystem,
    forcing: PeriodicForcing,
    omega: float,
    level: float = 1.0,
    harmonics: int = HARMONICS,
) -> ForcedExpansion:
    """The response to periodic loads away from resonance; the factor multiplies the springs' stiffness and dashpots.

    Parameters
    ----------
    system : the structure, its damping of any size (none is allowed).
    forcing : loads; contacts on the ground see the base's displacement.
    omega, level : of the excitation, rad/s.

    Raises
    ------
    ValueError : where an undamped mode resonates with a harmonic.
    """
    n, c, H = system.size, system.contacts, harmonics
    h = np.arange(H + 1)
    load, base, _, _ = forcing.at(omega, level)
    F = np.zeros((H + 1, n), dtype=complex)
    F[0] = system.constant_load
    np.add.at(F, forcing.multiple, load)
    d = np.zeros(H + 1, dtype=complex)
    np.add.at(d, forcing.multiple, base)

    def solve(right: Complexes) -> Complexes:
        out = np.zeros_like(right)
        scale = np.abs(right).max()
        for k in h:
            w = k * omega
            Z = np.diag(system.stiffness - w**2) + 1j * w * system.damping
            weak = np.abs(np.diag(Z)) <= RESONANT * (system.stiffness + w**2 + 1e-300)
            if np.any(weak):
                bad = weak & (np.abs(right[k]) > 1e-13 * scale)
                if np.any(bad):
                    raise ValueError(f"harmonic {k} excites undamped mode {int(np.argmax(bad)) + 1}")
                Z[weak, weak] = 1.0
                right = right.copy()
                right[k, weak] = 0.0
            out[k] = np.linalg.solve(Z, right[k])
        return out

    q0 = solve(F)
    f0, f1 = np.zeros_like(F), np.zeros_like(F)
    chi = []
    for i in range(c.count):
        s = float(c.sign[i])
        D = -s * (q0 @ c.shape[i] + (d if c.on_ground[i] else 0.0))
        D[0] = D[0].real - c.gap[i]
        last = int(np.flatnonzero(np.abs(D) > 0)[-1]) + 1 if np.any(np.abs(D[1:]) > 0) else 1
        found = one_sided(D[: max(last, 2)], 2 * H)
        chi.append(found.chi[: 2 * H + 1])
        rate = c.stiffness[i] + 1j * h * omega * c.dashpot[i]
        f0 += np.multiply.outer(rate * found.positive[: H + 1], s * c.shape[i])
    q1 = solve(f0)
    for i in range(c.count):
        rate = c.stiffness[i] + 1j * h * omega * c.dashpot[i]
        f1 -= np.multiply.outer(rate * product_harmonics(chi[i], q1 @ c.shape[i], H), c.shape[i])
    return ForcedExpansion(omega, (q0, q1, solve(f1)))
