r"""Phase resonance: the forced periodic motion whose deflection lags the force by a quarter of a period.

Under :math:`A\,\mathrm{Re}(F e^{i\omega t})` the lag is that of the fundamental of the work-conjugate deflection, so
that the condition reads

.. math:: r = \frac{2}{T} \oint \mathrm{Re}(F e^{i\omega t})^T q\, dt = \mathrm{Re}(\bar F^T Q_1) = 0 .

Along a resonance the lag grows from 0 to half a turn although the frequency may turn back: it is the parameter that
never fails there. A periodic motion is found with the frequency free and its own phase against the force pinned
(shooting); the pinned phase is then moved until r vanishes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.orbits.continuation import BranchPoint, Settings, correct
from beamsim.orbits.forced_from_free import quadrature_nodes
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.orbits.shooting import ForcedOrbits

TOLERANCE = 1e-8  # of the cosine of the lag: amplitudes are then right to its square
STEPS = 30  # of the secant
FURTHEST_TURN = 0.4  # rad, by which the phase is moved in one step


def quadrature(problem: ForcedOrbits, point: BranchPoint) -> tuple[float, float]:
    """Cosine of the lag behind the force, and the amplitude of the work-conjugate deflection (for a level of one)."""
    flow, passage = problem.cycle(point)
    n, T = flow.system.size, passage.duration
    loads = flow.loads.at(flow.omega, 1.0)[0]
    load = loads[flow.loads.multiple == 1].sum(axis=0)
    t, weight = quadrature_nodes(passage, float(np.sqrt(flow.system.stiffness.max(initial=0.0))))
    q = flow.states_at(passage, t)[:, :n]
    fundamental = 2.0 / T * ((weight * np.exp(-1j * flow.omega * t)) @ q)
    conjugate = complex(np.conj(load) @ fundamental)
    return float(conjugate.real) / max(abs(conjugate), 1e-300), abs(conjugate)


def find_phase_resonance(
    problem: ForcedOrbits, start: Floats, omega: float, settings: Settings | None = None
) -> BranchPoint | None:
    """The exact forced motion at phase resonance near a guess; None where none is found.

    Parameters
    ----------
    problem : shooting in frequency, at the level wanted.
    start : (2n,) state at t = 0, where the force's clock begins.
    omega : rad/s.
    """
    settings = Settings(iterations=25) if settings is None else settings
    z = np.zeros(problem.flow.size)
    z[: start.size] = start
    u = np.append(z[problem.kept], omega)
    scale = problem.scale(u)[0]
    problem.flow.set(omega, problem.level)
    try:  # the direction in which the motion moves along itself
        slope = problem.flow.carry(z, 2 * np.pi / omega).slope[problem.kept]
    except ArithmeticError:
        return None
    along = np.append(slope, 0.0) / scale
    speed = float(np.linalg.norm(along))
    row = along / speed
    target = float(row @ (u / scale))

    def turned(turn: float, near: BranchPoint | None) -> BranchPoint | None:
        """The periodic motion whose phase is ``turn`` ahead of the guess's."""
        guess = u if near is None else near.u
        return correct(problem, guess, row, target + turn * speed / omega, scale, settings)

    before = turned(0.0, None)
    if before is None:
        return None
    x0, f0 = 0.0, quadrature(problem, before)[0]
    if abs(f0) < TOLERANCE:
        return before
    step, best = float(np.arcsin(f0)), before  # a lag of less than a quarter: the motion is to be held back
    x1, f1 = x0, f0
    for sign in (-1.0, 1.0):
        point = turned(x0 + sign * step, before)
        if point is not None:
            f = quadrature(problem, point)[0]
            if abs(f) < abs(f1):
                best, x1, f1 = point, x0 + sign * step, f
                break
    if best is before:
        return None
    for _ in range(STEPS):
        if abs(f1) < TOLERANCE:
            return best
        if f1 == f0:
            return None
        move = float(np.clip(-f1 * (x1 - x0) / (f1 - f0), -FURTHEST_TURN, FURTHEST_TURN))
        point = turned(x1 + move, best)
        if point is None:
            return None
        x0, f0 = x1, f1
        best, x1, f1 = point, x1 + move, quadrature(problem, point)[0]
    return None


def turned_back(point: BranchPoint) -> BranchPoint:
    """The same point, to be left in the other direction."""
    return replace(point, tangent=-point.tangent, orientation=-point.orientation)
