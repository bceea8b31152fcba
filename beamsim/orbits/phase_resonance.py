r"""From forced to free: the harmonic force that holds a damped structure on its nonlinear normal mode.

In phase quadrature the work of the force over a period equals the energy dissipated by damping (energy balance; H.
Hazim, thesis, 2010, section 4.5; M. Peeters, G. Kerschen, J. C. Golinval, J. Sound Vib. 330 (2011) 486-509):

.. math:: A \oint \mathrm{Re}(F e^{i \omega t})^T \dot q\, dt = \oint \dot q^T C \dot q\, dt
          + \sum_i \oint_{\delta_i > 0} c_i \dot\delta_i^2\, dt .

Only the fundamental :math:`Q_1` of the motion takes part in the work: at best it is :math:`\pi A |F^T \bar Q_1|` a
period, where the deflection under the force lags it by a quarter of a period. A single harmonic force balances the
dissipation over a period and not at every instant: the forced motion differs from the mode's in first order of the
damping, but in the part that is odd in time only. Frequency, amplitude at a level and shape at rest are right to second
order (contacts that never pull leave earlier than they came: with their dashpots, to first order).

Phase resonance: the forced periodic motion whose deflection lags the force by a quarter of a period.

Under :math:`A\,\mathrm{Re}(F e^{i\omega t})` the lag is that of the fundamental of the work-conjugate deflection, so
that the condition reads

.. math:: r = \frac{2}{T} \oint \mathrm{Re}(F e^{i\omega t})^T q\, dt = \mathrm{Re}(\bar F^T Q_1) = 0 .

Along a resonance the lag grows from 0 to half a turn although the frequency may turn back: it is a parameter that
is monotonic there. A periodic motion is found with the frequency free and its own phase against the force pinned
(shooting); the pinned phase is then moved until r vanishes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.continuation import Settings, correct
from beamsim.typing import Complexes, Floats

if TYPE_CHECKING:
    from beamsim.flow.passage import Passage
    from beamsim.flow.periodic_flow import PeriodicFlow
    from beamsim.orbits.shooting import ForcedOrbits
    from beamsim.system.equations import PiecewiseLinearSystem

FEWEST_PIECES, MOST_PIECES = 32, 160  # of a period
RADIANS = 3.0  # of the fastest mode in a piece, within these bounds
GAUSS = 8  # nodes a piece
NODE = 1e-9  # share of the largest possible work below which a force does none
TOLERANCE = 1e-8  # of the cosine of the lag: amplitudes are then right to its square
STEPS = 30  # of the secant
FURTHEST_TURN = 0.4  # rad, by which the phase is moved in one step


@dataclass(frozen=True)
class Appropriation:
    """A predicted force ``level * Re(load e^{i omega t})`` and the motion that it holds."""

    level: float
    omega: float  # rad/s
    shift: float  # s, instant of the mode's motion at which the force has phase zero
    start: Floats  # (2n,) state there
    by_structure: float  # J a period, taken by the structure's damping
    by_contacts: float  # J a period, taken by the contacts' dashpots

    @property
    def dissipated(self) -> float:
        """J a period."""
        return self.by_structure + self.by_contacts


def quadrature_nodes(passage: Passage, fastest: float) -> tuple[Floats, Floats]:
    """Times and weights of Gauss's rule over a passage, in pieces that no contact event interrupts.

    Parameters
    ----------
    passage : a motion, carried from t = 0.
    fastest : rad/s, of the modes.
    """
    T = passage.duration
    pieces = int(np.clip(fastest * T / RADIANS, FEWEST_PIECES, MOST_PIECES))
    edges = np.unique(np.concatenate([np.linspace(0.0, T, pieces + 1), passage.event_time]))
    edges = edges[(edges >= 0.0) & (edges <= T)]
    x, w = np.polynomial.legendre.leggauss(GAUSS)
    half = 0.5 * np.diff(edges)[:, None]
    middle = 0.5 * (edges[1:] + edges[:-1])[:, None]
    return (middle + half * x).ravel(), (half * w).ravel()


def appropriate_force(
    damped: PiecewiseLinearSystem, flow: PeriodicFlow, whole: Passage, load: Complexes
) -> Appropriation:
    """The level of ``Re(load e^{i omega t})`` that excites a damped structure on a nonlinear mode.

    Parameters
    ----------
    damped : the structure with its damping and dashpots; contacts on the ground feel no base motion here.
    flow, whole : the undamped structure's flow and the mode's motion over one period
        (:meth:`beamsim.orbits.reversible.BrakeOrbits.cycle`).
    load : (n,) complex generalised force of a level of one, at the mode's frequency.

    Raises
    ------
    ValueError : where the force does no work on the mode (it acts at a node).
    """
    n, c = damped.size, damped.contacts.split()
    period = whole.duration
    omega = 2 * np.pi / period
    t, weight = quadrature_nodes(whole, float(np.sqrt(damped.stiffness.max(initial=0.0))))
    states = flow.states_at(whole, t)
    q, v = states[:, :n], states[:, n : 2 * n]
    by_structure = float(weight @ np.einsum("ti,ij,tj->t", v, damped.damping, v))
    closed = -c.gap - c.sign * (q @ c.shape.T) > 0
    by_contacts = float(weight @ (np.where(closed, (v @ c.shape.T) ** 2, 0.0) @ c.slow[1]))
    power = v @ load
    work = complex((weight * np.exp(1j * omega * t)) @ power)
    reach = float(np.sqrt(period * (weight @ np.abs(power) ** 2)))
    size = float(np.linalg.norm(load) * np.sqrt(period * (weight @ np.sum(v**2, axis=1))))
    if abs(work) <= NODE * max(reach, size):
        raise ValueError("the force does no work on this mode (it acts at a node)")
    # a motion that is shift ahead of the mode's own takes Re(work e^{-i omega shift}) from the force
    shift = float(np.angle(work)) / omega % period
    start = flow.states_at(whole, np.array([shift]))[0]
    return Appropriation((by_structure + by_contacts) / abs(work), omega, shift, start, by_structure, by_contacts)


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


def find_phase_resonance(problem: ForcedOrbits, start: Floats, omega: float) -> BranchPoint | None:
    """The exact forced motion at phase resonance near a guess; None where none is found.

    Parameters
    ----------
    problem : shooting in frequency, at the level wanted.
    start : (2n,) state at t = 0, where the force has phase zero.
    omega : rad/s.
    """
    settings = Settings(iterations=25)
    z = np.zeros(problem.flow.size)
    z[: start.size] = start
    u = np.append(z, omega)
    scale = problem.scale(u)[0]
    try:  # the direction in which the motion moves along itself
        slope = problem.flow.under(omega, problem.level).carry(z, 2 * np.pi / omega).slope
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
