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

from dataclasses import dataclass

import numpy as np
from scipy.optimize import root_scalar

from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.continuation import Predictor, Settings, correct
from beamsim.orbits.period import gauss_panels
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import TINY, Complexes, Floats

TOLERANCE = 1e-8  # of the cosine of the lag: amplitudes are then right to its square


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


LEAST_WORK = 1e-9  # share of the largest possible work below which a force does none


def appropriate_force(
    damped: PiecewiseLinearSystem, flow: PeriodicFlow, cycle: FlowMap, load: Complexes
) -> Appropriation:
    """The level of ``Re(load e^{i omega t})`` that excites a damped structure on a nonlinear mode.

    Parameters
    ----------
    damped : the structure with its damping and dashpots; contacts on the ground feel no base motion here.
    flow, cycle : the undamped structure's flow and the mode's motion over one period
        (:meth:`beamsim.orbits.free_orbits.BrakeOrbits.cycle`).
    load : (n,) complex generalised force of a level of one, at the mode's frequency.

    Returns
    -------
    The level and the state in which the motion begins under it.

    Raises
    ------
    ValueError : where the force does no work on the mode (it acts at a node).
    """
    n, c = damped.size, damped.contacts.split()
    period = cycle.duration
    omega = 2 * np.pi / period
    t, weight = gauss_panels(np.append(cycle.time, period), flow.fastest)
    states = flow.states_at(cycle, t)
    q, v = states[:, :n], states[:, n : 2 * n]
    by_structure = float(weight @ np.einsum("ti,ij,tj->t", v, damped.damping, v))
    closed = -c.gap - c.sign * (q @ c.shape.T) > 0
    by_contacts = float(weight @ (np.where(closed, (v @ c.shape.T) ** 2, 0.0) @ c.quasi_static[1]))
    power = v @ load
    work = complex((weight * np.exp(1j * omega * t)) @ power)
    reach = float(np.sqrt(period * (weight @ np.abs(power) ** 2)))
    size = float(np.linalg.norm(load) * np.sqrt(period * (weight @ np.sum(v**2, axis=1))))
    if abs(work) <= LEAST_WORK * max(reach, size):
        raise ValueError("the force does no work on this mode (it acts at a node)")
    # a motion that is shift ahead of the mode's own takes Re(work e^{-i omega shift}) from the force
    shift = float(np.angle(work)) / omega % period
    start = flow.states_at(cycle, np.array([shift]))[0]
    return Appropriation((by_structure + by_contacts) / abs(work), omega, shift, start, by_structure, by_contacts)


def quadrature(problem: ForcedOrbits, point: BranchPoint) -> tuple[float, float]:
    """Cosine of the lag behind the force, and the amplitude of the work-conjugate deflection (for a level of one)."""
    flow, flow_map = problem.cycle(point)
    n, T = flow.system.size, flow_map.duration
    loads = flow.loads.at(flow.omega, 1.0)[0]
    load = loads[flow.loads.multiple == 1].sum(axis=0)
    t, weight = gauss_panels(np.append(flow_map.time, T), flow.fastest)
    q = flow.states_at(flow_map, t)[:, :n]
    fundamental = 2.0 / T * ((weight * np.exp(-1j * flow.omega * t)) @ q)
    conjugate = complex(np.conj(load) @ fundamental)
    return float(conjugate.real) / max(abs(conjugate), TINY), abs(conjugate)


def find_phase_resonance(problem: ForcedOrbits, start: Floats, omega: float) -> BranchPoint | None:
    """The exact forced motion at phase resonance near a guess; None where none is found.

    Parameters
    ----------
    problem : shooting in frequency, at the level wanted.
    start : (2n,) state at t = 0, where the force has phase zero.
    omega : rad/s.

    Returns
    -------
    The motion, whose phase is that of the force.
    """
    settings = Settings(iterations=25)
    u = np.concatenate([start, np.zeros(problem.flow.size - start.size), [omega]])
    scale = problem.scale(u)[0]
    found: list[tuple[float, float, BranchPoint]] = []  # phase, cosine of the lag, motion

    def cosine(turn: float) -> float:
        """Of the motion whose phase is ``turn`` ahead of the guess's."""
        before, near = (0.0, u) if not found else (found[-1][0], found[-1][2].u)
        guess = near + (turn - before) * speed * row * scale
        point = correct(problem, Predictor(guess, row, scale), settings)
        if point is None:
            raise ArithmeticError("no periodic motion has this phase")
        found.append((turn, quadrature(problem, point)[0], point))
        return found[-1][1] if abs(found[-1][1]) >= TOLERANCE else 0.0

    try:
        # the direction in which the motion moves along itself
        slope = problem.flow.with_loads(omega, problem.level).flow_map(u[:-1], 2 * np.pi / omega).slope
        along = np.append(slope, 0.0) / scale
        row = along / np.linalg.norm(along)
        speed = float(np.linalg.norm(along)) / omega  # of the unknowns by the phase
        first = cosine(0.0)
        if first != 0.0:  # where the lag is less than a quarter, the motion is to be held back
            root_scalar(cosine, x0=0.0, x1=-float(np.arcsin(first)), method="secant", xtol=1e-15)
    except ArithmeticError:
        return None
    return found[-1][2] if abs(found[-1][1]) < TOLERANCE else None
