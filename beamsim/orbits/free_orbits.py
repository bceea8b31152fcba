r"""Shooting for periodic motions of the undamped, unforced system, whose period and energy belong to the unknowns.

Unknowns are what is free of the state at t = 0, called x, the period and a parameter. To the closure of the motion,
:math:`P z(\tau) - B x = 0` with the rows P and a matrix B, come the energy, measured from static equilibrium, and a
condition for the phase of the motion where the start does not fix it.

*Brake orbits*, the nonlinear normal modes, are at rest twice a period. The system runs backwards as it runs forwards,
so that a motion at rest at 0 and at T/2 has period T. The unknowns are the shape at rest and the period, n + 1 of them:

.. math:: v(T/2;\, q_0, p) = 0, \qquad E(q_0, p) = E_0,

p being the factor of the contacts' stiffness, the energy, or the frequency. The transition matrix over half a period,
:math:`\Phi = \begin{pmatrix} a & b \\ c & d \end{pmatrix}` in (q, q'), gives the monodromy matrix
:math:`R \Phi^{-1} R \Phi` (R reverses velocities), whose multipliers come in pairs with
:math:`(\mu + 1/\mu)/2 = 1 + 2\,\mathrm{eig}(b^T c)`: the motion is stable where all these lie in [-1, 1].

*Free orbits* need not be at rest at any time. Unknowns are the state (2n), the period and a parameter. To
``y(T) - y(0) = 0`` come the energy and a phase condition, Poincaré's :math:`(y_0 - y_{ref})^T f(y_{ref}) = 0`. Energy
being conserved, one of these 2n + 2 equations follows from the others: Newton's method takes the least-squares solution
of a consistent system, and converges as fast.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow
from beamsim.orbits.branch import BranchPoint, Orbit
from beamsim.orbits.period import cyclic, extrema_of, phases_of_contacts
from beamsim.orbits.spring_families import SpringFamily
from beamsim.typing import TINY, Complexes, Floats


@dataclass(frozen=True)
class FreeMotion:
    """What the residual of a free motion computes besides itself."""

    flow_map: FlowMap
    energy: float  # J
    flow: Any


@dataclass
class ConservativeOrbits(ABC):
    """Free periodic motions as a continuation problem.

    Unknowns are x (k), the period, and the parameter: for ``"stiffness_factor"`` the factor at fixed ``energy``; for
    ``"energy"`` its natural logarithm at fixed ``factor``. For ``"frequency"`` (rad/s) they are x and the frequency
    only.
    """

    closes_after: ClassVar[float] = 1.0  # periods
    bifurcates: ClassVar[bool] = False  # multipliers come in pairs, on the unit circle where the motion is stable
    family: SpringFamily
    parameter: Literal["stiffness_factor", "energy", "frequency"] = "stiffness_factor"
    energy: float = 1.0  # J
    factor: float = 1.0

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return self.family.omega.size

    @property
    @abstractmethod
    def closing(self) -> tuple[slice, Floats]:
        """The rows P of the state, and the matrix B (k, k)."""

    @property
    def phase(self) -> tuple[Floats, float] | None:
        """A row (k,) on x and its value, that fix the phase."""
        return None

    def split(self, u: Floats) -> tuple[Floats, float, float, float]:
        """x, period, factor and energy (nan where it isn't held) of the unknowns."""
        if self.parameter == "frequency":
            return u[:-1], 2 * np.pi / float(u[-1]), self.factor, np.nan
        if self.parameter == "energy":
            return u[:-2], float(u[-2]), self.factor, float(np.exp(u[-1]))
        return u[:-2], float(u[-2]), float(u[-1]), self.energy

    def residual(self, u: Floats) -> tuple[Floats, Floats, FreeMotion]:
        """Closure of the motion, the energy's excess and the phase, with their Jacobian."""
        if self.parameter == "energy" and not abs(u[-1]) < 600.0:  # a logarithm
            raise ArithmeticError("the energy is outside the floating-point range")
        x, period, factor, energy = self.split(u)
        if not (np.isfinite(period) and period > 0):
            raise ArithmeticError("the period became negative")
        flow, direction = self.family.flow_at(factor)
        k, n, held = x.size, self.n, self.parameter != "frequency"
        by_factor = self.parameter == "stiffness_factor"
        start = np.append(x, np.zeros(2 * n - k))
        flow_map = flow.flow_map(start, self.closes_after * period, (direction,) if by_factor else ())
        value, gradient, slope = self.family.potential(start[:n], factor)
        value += 0.5 * float(start[n:] @ start[n:])
        (rows, closing), phase = self.closing, self.phase
        J = np.zeros((k + held + (phase is not None), u.size))
        R = np.zeros(J.shape[0])
        R[:k], J[:k, :k] = flow_map.end[rows] - closing @ x, flow_map.transition[rows, :k] - closing
        J[:k, k] = self.closes_after * flow_map.slope[rows]
        if not held:
            J[:k, k] *= -period / float(u[-1])
        else:
            R[k], J[k, :k] = value - energy, np.append(gradient, start[n:])[:k]
            J[k, k + 1] = slope if by_factor else -energy
        if by_factor:
            J[:k, k + 1] = flow_map.parameters[rows, 0]
        if phase is not None:
            R[-1], J[-1, :k] = phase[0] @ x - phase[1], phase[0]
        return R, J, FreeMotion(flow_map, value, flow)

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Coordinates by the amplitude that carries all the energy, velocities likewise."""
        x, period, factor, energy = self.split(u)
        if not np.isfinite(energy):
            energy = max(self.family.potential(x[: self.n], factor)[0], TINY)
        speed = np.full(self.n, np.sqrt(2.0 * energy))
        state = np.concatenate([speed / np.maximum(self.family.omega, 0.2 * np.pi / period), speed])
        closure = state[self.closing[0]]
        if self.parameter == "frequency":
            return np.append(state[: x.size], 2 * np.pi / period), closure
        size = [energy] if self.phase is None else [energy, float(np.abs(self.phase[0]) @ state[: x.size])]
        return np.concatenate([state[: x.size], [period, 1.0]]), np.concatenate([closure, size])

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, FlowMap]:
        """The flow at a point, and its motion over a whole period."""
        flow, flow_map = point.data.flow, point.data.flow_map
        return flow, flow_map if self.closes_after == 1.0 else flow.flow_map(
            flow_map.start, flow_map.duration / self.closes_after
        )


def on_unit_circle(half_traces: Complexes, tolerance: float) -> bool:
    """Whether every pair of multipliers lies on the unit circle, where (mu + 1/mu)/2 is real and within [-1, 1]."""
    return bool(np.all(np.abs(half_traces.imag) < tolerance) and np.all(np.abs(half_traces.real) < 1.0 + tolerance))


# By how much (mu + 1/mu)/2 may leave [-1, 1]: the trivial pair and round-off.
UNIT_CIRCLE_OF_BALANCE, UNIT_CIRCLE_OF_SHOOTING = 1e-7, 1e-6


@dataclass
class BrakeOrbits(ConservativeOrbits):
    """Half-period shooting as a continuation problem; x is the shape at rest q0 (n).

    ``basis`` holds the frequencies (rad/s) and orthonormal shapes (a column each) of the linear modes that energy is
    shared among: by default the coordinates; with prestress those about static equilibrium
    (`SpringFamily.modes_at_rest`).
    """

    closes_after = 0.5
    basis: tuple[Floats, Floats] | None = None

    def __post_init__(self) -> None:
        self.omega, self.vectors = (self.family.omega, np.eye(self.n)) if self.basis is None else self.basis
        self.idle = _idle(self.family)

    @property
    def closing(self) -> tuple[slice, Floats]:
        """At rest after half a period; rigid-body motions that no spring feels do not begin."""
        return slice(self.n, 2 * self.n), -self.idle

    def unknowns(self, q: Floats, period: float, value: float) -> Floats:
        """The reverse of `split`, ``value`` being the parameter (logarithm of the energy, factor, or rad/s).

        Parameters
        ----------
        q : (n,) shape at rest.
        period : s.
        value : of the parameter.

        Returns
        -------
        (n + 1,) or (n + 2,) unknowns.
        """
        tail = [value] if self.parameter == "frequency" else [period, value]
        return np.concatenate([q, tail])

    def share(self, q: Floats, factor: float, v: Floats | None = None) -> Floats:
        """(n,) share of each linear mode in the energy of displacements q and velocities v (at rest by default),
        without that of the nonlinear springs.

        Parameters
        ----------
        q : (n,) displacements.
        factor : of the springs, on which the equilibrium depends.
        v : (n,) velocities.

        Returns
        -------
        (n,) shares, whose sum is one.
        """
        parts = (self.omega * (self.vectors.T @ (q - self.family.static_equilibrium(factor)))) ** 2
        if v is not None:
            parts = parts + (self.vectors.T @ v) ** 2
        return np.asarray(parts / max(float(parts.sum()), TINY))

    def mode_slope(self, point: BranchPoint, mode: int) -> float:
        """Derivative of a linear mode's velocity after half a period by its amplitude at the start, over its frequency.

        (The lowest frequency takes the place of a rigid-body mode's.)
        """
        n, e = self.n, self.vectors[:, mode]
        pace = self.omega[mode] if self.omega[mode] > 0 else self.omega[self.omega > 0].min()
        return float(e @ (point.data.flow_map.transition[n : 2 * n, :n] + self.idle) @ e / pace)

    def share_at(self, point: BranchPoint) -> Floats:
        """(n,) share of each linear mode in the strain energy of a point's motion at rest."""
        q, _, factor, _ = self.split(point.u)
        return self.share(q, factor)

    def swings_once(self, point: BranchPoint, mode: int) -> bool:
        """Whether a mode has swung to its other side half a period on: a motion run through twice has not."""
        q, _, factor, _ = self.split(point.u)
        rest, shape = self.family.static_equilibrium(factor), self.vectors[:, mode]
        return float(shape @ (q - rest)) * float(shape @ (point.data.flow_map.end[: self.n] - rest)) < 0

    def half_traces(self, point: BranchPoint) -> Complexes:
        """(n,) (mu + 1/mu)/2 of each pair of multipliers, from the furthest outside [-1, 1]."""
        period = self.split(point.u)[1]
        P, n = point.data.flow_map.transition, self.n
        w = np.maximum(self.family.omega, 2 * np.pi / period * 0.1)
        b = P[:n, n : 2 * n] * w[:, None] * w  # symplectic scaling: b in units where q and q'/omega are alike
        c = P[n : 2 * n, :n] / w[:, None] / w
        a = 1.0 + 2.0 * np.linalg.eigvals(b.T @ c).astype(complex)
        return np.asarray(a[np.argsort(-np.maximum(np.abs(a.real) - 1.0, np.abs(a.imag)))])

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers in pairs."""
        a = self.half_traces(point)
        root = np.sqrt(a**2 - 1.0)
        return np.concatenate([a + root, a - root])

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        q, period, _, _ = self.split(point.u)
        stable = on_unit_circle(self.half_traces(point), UNIT_CIRCLE_OF_BALANCE)
        return Orbit(
            point.parameter, np.append(q, np.zeros(self.n)), period, self.multipliers(point), stable, point.residual,
            point.data.energy,
        )  # fmt: skip

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether contacts have the same events in two motions over half a period, from the same ones at rest."""
        pa, pb = a.data.flow_map, b.data.flow_map
        return bool(pa.signature == pb.signature) or phases_of_contacts(pa) == phases_of_contacts(pb)


def _idle(family: SpringFamily) -> Floats:
    """(n, n) 1/s, a multiple of the projector on rigid-body motions that no spring feels.

    Along them the velocity stays zero whatever the start; added to the residual it asks for no displacement instead.
    """
    omega = family.omega
    rigid = np.flatnonzero(omega == 0.0)
    out = np.zeros((omega.size, omega.size))
    if rigid.size == 0 or rigid.size == omega.size:
        return out
    rows = family.rows[:, rigid]
    if rows.shape[0] == 0:
        loose = np.eye(rigid.size)
    else:
        _, singular, turned = np.linalg.svd(rows)
        loose = turned[int(np.sum(singular > 1e-12 * max(float(singular.max()), TINY))) :]
    out[np.ix_(rigid, rigid)] = float(omega[omega > 0].min()) * loose.T @ loose
    return out


def linear_mode(orbits: BrakeOrbits, mode: int, value: float, positive_direction: Floats | None = None) -> Floats:
    """Unknowns of linear mode ``mode`` (from 0) with the energy asked for, its contacts open at rest.

    ``positive_direction`` (n,) is a direction that the shape at rest must have a positive component along.

    Parameters
    ----------
    orbits : the shooting problem.
    mode : from 0.
    value : of the parameter.
    positive_direction : see above.

    Returns
    -------
    (n + 1,) or (n + 2,) unknowns.
    """
    omega = orbits.omega
    energy = float(np.exp(value)) if orbits.parameter == "energy" else orbits.energy
    q = orbits.vectors[:, mode] * (np.sqrt(2.0 * energy) / omega[mode])
    if positive_direction is not None and float(positive_direction @ q) < 0:
        q = -q
    q = q + orbits.family.static_equilibrium(0.0 if orbits.parameter == "stiffness_factor" else orbits.factor)
    return orbits.unknowns(q, 2 * np.pi / float(omega[mode]), value)


@dataclass
class FreeOrbits(ConservativeOrbits):
    """Full-period shooting as a continuation problem; x is the state y0 (2n).

    ``reference`` is the state of the motion that fixes the phase (a motion nearby, in its own phase).
    """

    reference: Floats = field(kw_only=True)  # (2n,)
    _slope: Floats = field(init=False)

    def __post_init__(self) -> None:
        self._fix(self.factor)

    def fix_phase(self, u: Floats) -> None:
        """Fix the phase by another motion, given by its unknowns."""
        self.reference = u[: 2 * self.n].copy()
        self._fix(self.split(u)[2])

    def _fix(self, factor: float) -> None:
        _, gradient, _ = self.family.potential(self.reference[: self.n], factor)
        self._slope = np.concatenate([self.reference[self.n :], -gradient])

    @property
    def closing(self) -> tuple[slice, Floats]:
        """The whole state after a period."""
        return slice(0, 2 * self.n), np.eye(2 * self.n)

    @property
    def phase(self) -> tuple[Floats, float] | None:
        """Poincaré's condition."""
        return self._slope, float(self._slope @ self.reference)

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether each contact has the same events in two motions over a period, wherever it begins."""
        return cyclic(a.data.flow_map) == cyclic(b.data.flow_map)

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers; two are 1."""
        flow_map: FlowMap = point.data.flow_map
        return flow_map.multipliers

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        y, period, _, _ = self.split(point.u)
        mu = self.multipliers(point)
        stable = on_unit_circle(0.5 * (mu + 1.0 / mu), UNIT_CIRCLE_OF_SHOOTING)
        return Orbit(point.parameter, y, period, mu, stable, point.residual, point.data.energy)


def free_of(brake: BrakeOrbits, u: Floats) -> FreeOrbits:
    """Shooting over the whole period in the parameter of brake orbits, the phase held by one of them."""
    at_rest = np.append(u[: brake.n], np.zeros(brake.n))
    return FreeOrbits(brake.family, brake.parameter, brake.energy, brake.factor, reference=at_rest)


def slowest_instant(flow: PeriodicFlow, flow_map: FlowMap, n: int) -> tuple[float, float]:
    """When in a motion the kinetic energy is least, s, and its value, J: zero where everything is at rest at once.

    Parameters
    ----------
    flow, flow_map : the motion.
    n : number of coordinates.

    Returns
    -------
    Time, s, and kinetic energy, J.
    """

    def speeds(exact: ExactFlow) -> Floats:
        return exact.equations.rows(n, velocities=np.eye(n))

    ends = np.array([0.0, flow_map.duration])
    found = extrema_of(flow, flow_map, speeds, lambda _, y: y[:, n : 2 * n], ends, squares=np.array([0]))
    return float(found.when_low[0, 0]), float(found.low[0, 0])
