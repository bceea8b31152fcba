"""Expansions in powers of the springs' stiffness and their remainders, to check shooting and the flow against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.errors import MethodError
from beamsim.flow.exact import ExactFlow
from beamsim.flow.passage import PeriodicForcing
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.orbits.aft import one_sided
from beamsim.orbits.expansions.forced import ResonantForcing, SteadyMotion, _states
from beamsim.orbits.expansions.free import HARMONICS, RESONANT, expand_mode, product_harmonics, weakened
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats

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
    flow = ExactFlow(weakened(system, factor), Forcing(np.zeros((0, n)), ()), duration)
    exact = simulate(flow, np.concatenate([q0, np.zeros(n)]), duration=duration).states_at(times)
    found = expansion.states(factor, times, order, frequency_order)
    return float(np.abs(exact[:, :n] - found[:, :n]).max() / abs(amplitude))


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
    c = resonant.system.contacts.one_sided_parts()
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
    values = grid * np.abs(resonant.backbones(grid) - sigma) - F
    found = [
        float(brentq(excess, grid[i], grid[i + 1], xtol=1e-15 * grid[i + 1], rtol=1e-14))
        for i in np.flatnonzero(values[:-1] * values[1:] < 0)
    ]
    if not found:
        raise MethodError(
            "frequency", "is on the backbone of an undamped structure: its response grows", "give damping"
        )
    return tuple(resonant.motion(a, sigma) for a in found)


def slow_flow(resonant: ResonantForcing, start: complex, sigma: float, times: Floats) -> Complexes:
    """Q at increasing slow times, from Q at the first of them.

    The amplitude and phase of a motion that begins near the mode, with or without force (``load`` zero) and
    damping.
    """
    from scipy.integrate import solve_ivp

    F = resonant.load[resonant.mode] / (2.0 * resonant.omega)

    def rate(_: float, y: Floats) -> Floats:
        Q = complex(y[0], y[1])
        psi = resonant.backbone(abs(Q)) if Q != 0 else 0.5j * resonant.system.damping[resonant.mode, resonant.mode]
        out = 1j * (psi - sigma) * Q - 1j * F
        return np.array([out.real, out.imag])

    found = solve_ivp(
        rate,
        (float(times[0]), float(times[-1])),
        [start.real, start.imag],
        "DOP853",
        times,
        rtol=1e-11,
        atol=1e-13 * max(abs(start), abs(F), 1e-12),
    )
    return np.asarray(found.y[0] + 1j * found.y[1])


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
    Q = slow_flow(resonant, start, sigma, factor * times)
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
