"""Nonlinear normal modes by half-period shooting: motions that are at rest twice a period.

The undamped, unforced system runs backwards as it runs forwards, so that a motion at rest at 0 and at T/2 has period
T. The unknowns are the shape at rest and the period, n + 1 of them:

.. math:: v(T/2;\\, q_0, p) = 0, \\qquad E(q_0, p) = E_0,

p being the factor of the contacts' stiffness, the energy, or the frequency. The energy is measured from static
equilibrium. The transition matrix over half a period, :math:`\\Phi = \\begin{pmatrix} a & b \\\\ c & d
\\end{pmatrix}` in (q, q'), gives the monodromy matrix :math:`R \\Phi^{-1} R \\Phi` (R reverses velocities), whose
multipliers come in pairs with
:math:`(\\mu + 1/\\mu)/2 = 1 + 2\\,\\mathrm{eig}(b^T c)`: the motion is stable where all these lie in [-1, 1].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np

from beamsim.flow.passage import ContactDirection, Parameter, Passage, moved_system
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.branch import BranchPoint, Orbit, SpecialPoint
from beamsim.orbits.continuation import Branch, Settings, locate
from beamsim.orbits.grazing import grazings
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats

LARGEST_LOG = 600.0  # of an energy
STABLE = 1e-7  # (mu + 1/mu)/2 may leave [-1, 1] by this much: the trivial pair and round-off


class Conservative(Protocol):
    """A family of undamped, unforced systems with mass one, by the factor of their nonlinear springs."""

    @property
    def omega(self) -> Floats:
        """(n,) natural frequencies of the linear structure, rad/s, its modes being the coordinates."""

    def flow_at(self, factor: float) -> tuple[PeriodicFlow, Parameter]:
        """The flow, and the parameter to differentiate by."""

    def potential(self, q: Floats, factor: float) -> tuple[float, Floats, float]:
        """Potential energy from static equilibrium, J, its gradient, and its derivative by the factor."""


@dataclass
class ContactStiffness:
    """One-sided springs whose stiffness is multiplied by the factor.

    ``equilibrium`` finds the static shape of a system; without it the structure must rest at q = 0 (no prestress, no
    load).
    """

    system: PiecewiseLinearSystem
    equilibrium: Callable[[PiecewiseLinearSystem], Floats] | None = None
    _last: tuple[float, VariationalFlow, Floats] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self.direction = ContactDirection.of(self.system.contacts, along=self.system.contacts)
        self.springs = self.system.contacts.one_sided_parts()

    @property
    def omega(self) -> Floats:
        """(n,) natural frequencies of the open structure, rad/s."""
        return np.asarray(np.sqrt(self.system.stiffness))

    def _at(self, factor: float) -> tuple[VariationalFlow, Floats]:
        if self._last is None or self._last[0] != factor:
            if factor < 0:
                raise ArithmeticError("the stiffness factor became negative")
            system = moved_system(self.system, self.direction, factor - 1.0)
            rest = np.zeros(system.size) if self.equilibrium is None else self.equilibrium(system)
            twin = None if self._last is None else self._last[1]
            self._last = (factor, VariationalFlow(system, twin=twin), rest)
        return self._last[1], self._last[2]

    def flow_at(self, factor: float) -> tuple[VariationalFlow, ContactDirection]:
        """The flow with its contacts' stiffness scaled, and the direction of the scaling."""
        return self._at(factor)[0], self.direction

    def rest(self, factor: float) -> Floats:
        """The static equilibrium."""
        if self.equilibrium is None:
            return np.zeros(self.system.size)
        return self._at(factor)[1]

    def period_estimate(self, mode: int, factor: float, energy: float) -> float | None:
        """Period of one mode on a bilinear spring, where there is a single contact without prestress.

        The open structure's frequency until the gap is reached, the closed structure's from there to rest: with no
        gap the bilinear rule :math:`\\pi/\\omega_1 + \\pi/\\omega_2`.
        """
        c = self.springs
        if c.count != 1 or np.any(self.system.constant_load):
            return None
        if c.gap[0] < 0:
            return self._prestressed_estimate(mode, factor, energy)
        stiff = np.diag(self.system.stiffness) + factor * c.stiffness[0] * np.outer(c.shape[0], c.shape[0])
        squared = float(np.linalg.eigvalsh(stiff)[mode])
        if squared <= 0:  # a spring that gives no more force
            return None
        w1, w2, gap = float(self.omega[mode]), float(np.sqrt(squared)), float(c.gap[0])
        reach = abs(float(c.shape[0, mode])) * float(np.sqrt(2 * energy)) / w1
        if reach <= gap:
            return 2 * np.pi / w1
        speed = w1 * float(np.sqrt(reach**2 - gap**2))
        open_for = float(np.arccos(-gap / reach)) / w1
        return 2 * (open_for + float(np.arctan2(speed / w2, gap * (w1 / w2) ** 2)) / w2)

    def _prestressed_estimate(self, mode: int, factor: float, energy: float) -> float | None:
        """The same with prestress: closed about static equilibrium, open from where the penetration vanishes."""
        c = self.springs
        if factor == 0:
            return None
        omega, vectors = self.modes_at_rest(factor)
        w1, w2 = float(self.omega[mode]), float(omega[mode])
        pressed = float(-c.gap[0] - c.sign[0] * (c.shape[0] @ self.rest(factor)))
        reach = abs(float(c.shape[0] @ vectors[:, mode])) * float(np.sqrt(2 * energy)) / w2
        if reach <= pressed:
            return 2 * np.pi / w2
        speed = w2 * float(np.sqrt(reach**2 - pressed**2))
        closed_for = float(np.arccos(-pressed / reach)) / w2
        return 2 * (closed_for + float(np.arctan2(speed / w1, pressed * (w2 / w1) ** 2)) / w1)

    def modes_at_rest(self, factor: float = 1.0) -> tuple[Floats, Floats]:
        """Frequencies (rad/s) and shapes of small motions about static equilibrium, its closed contacts closed."""
        q, c = self.rest(factor), self.springs
        closed = -c.gap - c.sign * (c.shape @ q) > 0
        phi = c.shape[closed]
        K = np.diag(self.system.stiffness) + factor * (phi.T * c.stiffness[closed]) @ phi
        values, vectors = np.linalg.eigh(K)
        return np.sqrt(np.maximum(values, 0.0)), vectors

    def _energy(self, q: Floats, factor: float) -> tuple[float, Floats, float]:
        s, c = self.system, self.springs
        delta = np.maximum(-c.gap - c.sign * (c.shape @ q), 0.0)
        push = c.stiffness * delta
        gradient = s.stiffness * q - s.constant_load - factor * (c.shape.T @ (c.sign * push))
        in_contacts = 0.5 * float(push @ delta)
        return float(0.5 * q @ (s.stiffness * q) - s.constant_load @ q) + factor * in_contacts, gradient, in_contacts

    def potential(self, q: Floats, factor: float) -> tuple[float, Floats, float]:
        """Potential energy from static equilibrium, its gradient, and its derivative by the factor."""
        value, gradient, by_factor = self._energy(q, factor)
        if self.equilibrium is not None:  # at equilibrium the gradient vanishes: only the explicit derivative counts
            value0, _, by0 = self._energy(self.rest(factor), factor)
            value, by_factor = value - value0, by_factor - by0
        return value, gradient, by_factor


@dataclass(frozen=True)
class HalfPeriod:
    """What the residual of a brake orbit computes besides itself."""

    passage: Passage
    energy: float  # J
    flow: Any


@dataclass
class BrakeOrbits:
    """Half-period shooting as a continuation problem.

    Unknowns are q0 (n), the period, and the parameter: for ``"stiffness_factor"`` the factor at fixed ``energy``; for
    ``"energy"`` its natural logarithm at fixed ``factor``. For ``"frequency"`` (rad/s) they are q0 and the frequency
    only. ``basis`` holds the frequencies (rad/s) and orthonormal shapes (a column each) of the linear modes that
    energy is shared among: by default the coordinates; with prestress those about static equilibrium
    (:meth:`ContactStiffness.modes_at_rest`).
    """

    family: Conservative
    parameter: Literal["stiffness_factor", "energy", "frequency"] = "stiffness_factor"
    energy: float = 1.0  # J
    factor: float = 1.0
    basis: tuple[Floats, Floats] | None = None

    def __post_init__(self) -> None:
        self.n = self.family.omega.size
        if self.basis is None:
            self.omega, self.vectors = self.family.omega, np.eye(self.n)
        else:
            self.omega, self.vectors = self.basis
        self.idle = _idle(self.family)

    def split(self, u: Floats) -> tuple[Floats, float, float, float]:
        """q0, period, factor and energy (nan where it isn't held) of the unknowns."""
        q = u[: self.n]
        if self.parameter == "frequency":
            return q, 2 * np.pi / float(u[-1]), self.factor, np.nan
        if self.parameter == "energy":
            return q, float(u[-2]), self.factor, float(np.exp(u[-1]))
        return q, float(u[-2]), float(u[-1]), self.energy

    def unknowns(self, q: Floats, period: float, value: float) -> Floats:
        """The reverse, ``value`` being the parameter (logarithm of the energy, factor, or rad/s)."""
        tail = [value] if self.parameter == "frequency" else [period, value]
        return np.concatenate([q, tail])

    def residual(self, u: Floats) -> tuple[Floats, Floats, HalfPeriod]:
        """Velocities after half a period, and the energy's excess."""
        n = self.n
        if self.parameter == "energy" and not abs(u[-1]) < LARGEST_LOG:
            raise ArithmeticError("the energy is outside the floating-point range")
        q, period, factor, energy = self.split(u)
        if not (np.isfinite(period) and period > 0):
            raise ArithmeticError("the period became negative")
        flow, direction = self.family.flow_at(factor)
        start = np.zeros(2 * n)
        start[:n] = q
        by_factor = self.parameter == "stiffness_factor"
        passage = flow.carry(start, 0.5 * period, (direction,) if by_factor else ())
        value, gradient, slope = self.family.potential(q, factor)
        data = HalfPeriod(passage, value, flow)
        v = slice(n, 2 * n)
        if self.parameter == "frequency":
            J = np.zeros((n, n + 1))
            J[:, :n] = passage.transition[v, :n] + self.idle
            J[:, n] = -0.5 * passage.slope[v] * period / float(u[-1])
            return passage.end[v] + self.idle @ q, J, data
        J = np.zeros((n + 1, n + 2))
        J[:n, :n] = passage.transition[v, :n] + self.idle
        J[:n, n] = 0.5 * passage.slope[v]
        J[n, :n] = gradient
        if by_factor:
            J[:n, n + 1] = passage.parameters[v, 0]
            J[n, n + 1] = slope
        else:
            J[n, n + 1] = -energy
        return np.append(passage.end[v] + self.idle @ q, value - energy), J, data

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Coordinates by the amplitude that carries all the energy, velocities likewise."""
        q, period, factor, energy = self.split(u)
        if not np.isfinite(energy):
            energy = max(self.family.potential(q, factor)[0], 1e-300)
        omega = np.maximum(self.family.omega, 2 * np.pi / period * 0.1)
        speed = np.sqrt(2.0 * energy)
        if self.parameter == "frequency":
            return np.append(speed / omega, 2 * np.pi / period), np.full(self.n, speed)
        return np.concatenate([speed / omega, [period, 1.0]]), np.append(np.full(self.n, speed), energy)

    def share(self, q: Floats, factor: float) -> Floats:
        """(n,) share of each linear mode in the strain energy at rest, without the contacts' own."""
        rest = getattr(self.family, "rest", None)
        x = q if rest is None else q - rest(factor)
        parts = (self.omega * (self.vectors.T @ x)) ** 2
        return np.asarray(parts / max(float(parts.sum()), 1e-300))

    def mode_slope(self, point: BranchPoint, mode: int) -> float:
        """Derivative of a linear mode's velocity after half a period by its amplitude at the start, over its frequency.

        (The lowest frequency takes the place of a rigid-body mode's.)
        """
        n, e = self.n, self.vectors[:, mode]
        pace = self.omega[mode] if self.omega[mode] > 0 else self.omega[self.omega > 0].min()
        return float(e @ (point.data.passage.transition[n : 2 * n, :n] + self.idle) @ e / pace)

    def share_at(self, point: BranchPoint) -> Floats:
        """(n,) share of each linear mode in the strain energy of a point's motion at rest."""
        q, _, factor, _ = self.split(point.u)
        return self.share(q, factor)

    def half_traces(self, point: BranchPoint) -> Complexes:
        """(n,) (mu + 1/mu)/2 of each pair of multipliers, from the furthest outside [-1, 1]."""
        period = self.split(point.u)[1]
        P, n = point.data.passage.transition, self.n
        w = np.maximum(self.family.omega, 2 * np.pi / period * 0.1)
        b = P[:n, n : 2 * n] * w[:, None] * w  # symplectic scaling: b in units where q and q'/omega are alike
        c = P[n : 2 * n, :n] / w[:, None] / w
        a = 1.0 + 2.0 * np.linalg.eigvals(b.T @ c).astype(complex)
        return np.asarray(a[np.argsort(-np.maximum(np.abs(a.real) - 1.0, np.abs(a.imag)))])

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        q, period, _, _ = self.split(point.u)
        a = self.half_traces(point)
        root = np.sqrt(a**2 - 1.0)
        return Orbit(
            point.parameter, np.concatenate([q, np.zeros(self.n)]), period, np.concatenate([a + root, a - root]),
            on_unit_circle(a, STABLE), point.residual, point.data.energy,
        )  # fmt: skip

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, Passage]:
        """The flow at a point, and its motion over a whole period."""
        flow = point.data.flow
        return flow, flow.carry(point.data.passage.start, 2 * point.data.passage.duration)

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether two motions have the same order of contacts over half a period, from the same contacts at rest."""
        pa, pb = a.data.passage, b.data.passage
        return bool(pa.signature == pb.signature)


def on_unit_circle(half_traces: Complexes, tolerance: float) -> bool:
    """Whether every pair of multipliers lies on the unit circle, where (mu + 1/mu)/2 is real and within [-1, 1]."""
    return bool(np.all(np.abs(half_traces.imag) < tolerance) and np.all(np.abs(half_traces.real) < 1.0 + tolerance))


def _idle(family: Conservative) -> Floats:
    """(n, n) 1/s, a multiple of the projector on rigid-body motions that no spring feels.

    Along them the velocity stays zero whatever the start; added to the residual it asks for no displacement instead.
    """
    omega = family.omega
    rigid = np.flatnonzero(omega == 0.0)
    out = np.zeros((omega.size, omega.size))
    if rigid.size == 0 or rigid.size == omega.size:
        return out
    system: Any = getattr(family, "system", None)
    if system is None:
        return out
    rows = np.vstack([system.contacts.shape, getattr(family, "cubic_shape", np.zeros((0, omega.size)))])[:, rigid]
    if rows.shape[0] == 0:
        loose = np.eye(rigid.size)
    else:
        _, singular, turned = np.linalg.svd(rows)
        loose = turned[int(np.sum(singular > 1e-12 * max(float(singular.max()), 1e-300))) :]
    out[np.ix_(rigid, rigid)] = float(omega[omega > 0].min()) * loose.T @ loose
    return out


def linear_mode(orbits: BrakeOrbits, mode: int, value: float, away_from: Floats | None = None) -> Floats:
    """Unknowns of linear mode ``mode`` (from 0) with the energy asked for, its contacts open at rest.

    ``away_from`` (n,) is a direction that the shape at rest must have a positive component along.
    """
    omega = orbits.omega
    energy = float(np.exp(value)) if orbits.parameter == "energy" else orbits.energy
    q = orbits.vectors[:, mode] * (np.sqrt(2.0 * energy) / omega[mode])
    if away_from is not None and float(away_from @ q) < 0:
        q = -q
    rest = getattr(orbits.family, "rest", None)
    if rest is not None:
        q = q + rest(0.0 if orbits.parameter == "stiffness_factor" else orbits.factor)
    return orbits.unknowns(q, 2 * np.pi / float(omega[mode]), value)


def mode_points(orbits: BrakeOrbits, a: BranchPoint, b: BranchPoint, settings: Settings) -> list[SpecialPoint]:
    """Folds, branch points (internal resonances among them) and grazings between two neighbours."""
    found: list[SpecialPoint] = []
    smooth = orbits.same_events(a, b)
    if not smooth:
        found += list(grazings(orbits, a, b, settings))
    if a.tangent[-1] * b.tangent[-1] < 0:
        fold = locate(orbits, a, b, lambda p: float(p.tangent[-1]), settings)
        if fold is not None and abs(fold.tangent[-1]) < 1e-6:
            found.append(SpecialPoint("fold", fold.parameter, fold))
    if smooth and a.orientation * b.orientation < 0:
        branching = locate(orbits, a, b, lambda p: p.orientation, settings)
        if branching is not None:
            found.append(SpecialPoint("branch_point", branching.parameter, branching))
    return found


def follow_modes(
    orbits: BrakeOrbits, start: BranchPoint, low: float, high: float, settings: Settings | None = None
) -> Branch:
    """A branch of nonlinear normal modes, to iterate over."""
    return Branch(orbits, start, low, high, Settings() if settings is None else settings, orbits.same_events)
