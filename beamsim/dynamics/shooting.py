"""Periodic motions of the forced system by shooting, and what happens along their branches.

A motion of period :math:`T = 2\\pi j/\\omega` solves :math:`z(T; z_0, \\lambda) - z_0 = 0`, z being the state and the
compression of the contacts' faces. The Jacobian is the monodromy matrix less one, exact
(:mod:`beamsim.dynamics.variational`).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from beamsim.dynamics.continuation import Branch, BranchPoint, Settings, correct, locate, solve_at
from beamsim.dynamics.grazing import SpecialPoint, cyclic, grazings
from beamsim.dynamics.variational import (
    ContactDirection,
    Frequency,
    Level,
    Passage,
    VariationalFlow,
    floquet_multipliers,
)

__all__ = [
    "ContactPath",
    "ForcedOrbits",
    "Orbit",
    "SpecialPoint",
    "find_orbit",
    "follow_orbits",
    "special_points",
    "switch_at_period_doubling",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

STABLE = 1e-9  # a multiplier's modulus may exceed one by this much


@dataclass(frozen=True)
class Orbit:
    """A converged periodic motion."""

    z: Floats  # (N + m,) state and faces at t = 0
    omega: float  # rad/s
    level: float
    period: float  # s
    passage: Passage
    multipliers: Complexes  # largest first
    residual: float  # largest component of z(T) - z(0), against the motion's size

    @property
    def stable(self) -> bool:
        """No multiplier outside the unit circle."""
        return bool(np.abs(self.multipliers[0]) <= 1.0 + STABLE)


@dataclass(frozen=True)
class ContactPath:
    """Systems whose contacts move along a straight line with the parameter."""

    flow: VariationalFlow  # at parameter 0
    direction: ContactDirection

    def __call__(self, parameter: float) -> tuple[VariationalFlow, ContactDirection]:
        """The flow at a parameter, and the direction there."""
        return self.flow.moved(self.direction, parameter), self.direction


@dataclass
class ForcedOrbits:
    """Shooting for periodic motions as a continuation problem.

    Parameters
    ----------
    flow : system and loads.
    parameter : what changes: ``"frequency"`` (rad/s), ``"level"``, or a path of systems (stiffness, gap, position …).
    multiple : periods of the excitation in one of the motion.
    """

    flow: VariationalFlow
    parameter: Literal["frequency", "level"] | Callable[[float], tuple[VariationalFlow, ContactDirection]] = "frequency"
    multiple: int = 1
    _moved: tuple[float, VariationalFlow, ContactDirection] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self.kept = np.flatnonzero(self.flow.free)
        self._n2 = 2 * self.flow.system.size
        # the flow may be shared: what doesn't change here is set again with what does
        self.omega, self.level = self.flow.omega, self.flow.level

    def with_multiple(self, multiple: int) -> ForcedOrbits:
        """The same problem for another multiple of the excitation's period."""
        other = ForcedOrbits(self.flow, self.parameter, multiple)
        other.omega, other.level = self.omega, self.level
        return other

    @property
    def value(self) -> float:
        """The parameter's value in the flow as it is (frequency and level)."""
        return self.omega if self.parameter == "frequency" else self.level

    def flow_at(self, value: float) -> tuple[VariationalFlow, ContactDirection | None]:
        """The flow with its parameter set."""
        if self.parameter == "frequency":
            if value <= 0:
                raise ArithmeticError("the frequency became negative")
            self.flow.set(value, self.level)
            return self.flow, None
        if self.parameter == "level":
            self.flow.set(self.omega, value)
            return self.flow, None
        if self._moved is None or self._moved[0] != value:
            flow, direction = self.parameter(value)
            flow.set(self.omega, self.level)
            self._moved = (value, flow, direction)
        return self._moved[1], self._moved[2]

    def full(self, u: Floats) -> Floats:
        """State and faces (N + m,) from the unknowns."""
        z = np.zeros(self.flow.size)
        z[self.kept] = u[:-1]
        return z

    def residual(self, u: Floats) -> tuple[Floats, Floats, Passage]:
        """``z(T) - z(0)`` with its Jacobian."""
        flow, direction = self.flow_at(float(u[-1]))
        period = 2 * np.pi * self.multiple / flow.omega
        parameter: Frequency | Level | ContactDirection
        parameter = direction if direction is not None else Frequency() if self.parameter == "frequency" else Level()
        z = self.full(u)
        passage = flow.carry(z, period, (parameter,))
        k = self.kept
        J = np.empty((k.size, k.size + 1))
        J[:, :-1] = passage.transition[np.ix_(k, k)] - np.eye(k.size)
        J[:, -1] = passage.parameters[k, 0]
        if self.parameter == "frequency":
            J[:, -1] -= passage.slope[k] * (period / flow.omega)
        return (passage.end - z)[k], J, passage

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Displacements by the largest amplitude of the state, velocities by it times omega."""
        n = self._n2 // 2
        omega = u[-1] if self.parameter == "frequency" else self.omega
        gaps = self.flow.system.contacts.gap
        size = float(np.sqrt(np.sum(u[:n] ** 2) + np.sum((u[n : 2 * n] / omega) ** 2)))
        size = max(size, 1e-3 * float(np.max(np.abs(gaps), initial=0.0)), 1e-30)
        scale = np.full(u.size, size)
        scale[n : 2 * n] *= omega
        residual = scale[:-1].copy()
        scale[-1] = abs(self.omega) if self.parameter == "frequency" else max(abs(u[-1]), 1e-12)
        return scale, residual

    def cycle(self, point: BranchPoint) -> tuple[VariationalFlow, Passage]:
        """The flow at a point, and its motion over a period."""
        return self.flow_at(point.parameter)[0], point.data

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether two motions have the same cyclic order of contacts."""
        sa, sb = a.data.signature, b.data.signature
        return bool(sa == sb) or (len(sa) == len(sb) and cyclic(a.data) == cyclic(b.data))

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        flow, _ = self.flow_at(point.parameter)
        passage: Passage = point.data
        M = passage.transition[np.ix_(self.kept, self.kept)]
        return Orbit(
            self.full(point.u),
            flow.omega,
            flow.level,
            passage.duration,
            passage,
            floquet_multipliers(M),
            point.residual,
        )

    def monodromy(self, point: BranchPoint) -> Floats:
        """The monodromy matrix over the free unknowns."""
        return np.asarray(point.data.transition[np.ix_(self.kept, self.kept)])


def linear_guess(flow: VariationalFlow) -> Floats:
    """The response of the open structure at t = 0, as a first guess."""
    n = flow.system.size
    force, _, _, _ = flow.loads.at(flow.omega, flow.level)
    z = np.zeros(flow.size)
    K = np.diag(flow.system.stiffness)
    with np.errstate(divide="ignore"):
        z[:n] = np.where(flow.system.stiffness > 0, flow.system.constant_load / flow.system.stiffness, 0.0)
    for h in range(flow.loads.count):
        w = flow.loads.multiple[h] * flow.omega
        q = np.linalg.solve(K - w**2 * np.eye(n) + 1j * w * flow.system.damping, force[h])
        z[:n] += q.real
        z[n : 2 * n] += (1j * w * q).real
    return z


def find_orbit(
    problem: ForcedOrbits,
    guess: Floats | None = None,
    *,
    settings: Settings | None = None,
    settle: int = 300,
    forward: float = 1.0,
) -> BranchPoint | None:
    """A periodic motion at the present parameter: Newton from a guess, else from the end of ever longer transients.

    Returns None where neither converges (no stable motion of this period is reached within ``settle`` periods).
    """
    settings = Settings(iterations=25) if settings is None else settings
    value = problem.value if isinstance(problem.parameter, str) else 0.0
    flow, _ = problem.flow_at(value)
    z = linear_guess(flow) if guess is None else guess.copy()
    period = 2 * np.pi * problem.multiple / flow.omega
    done = 0
    for target in (0, 3, 10, 30, 100, settle):
        while done < target:
            z = flow.carry(z, period).end
            done += 1
        u = np.append(z[problem.kept], value)
        point = solve_at(problem, u, settings, value, forward)
        if point is not None:
            return point
    return None


def _period_doubling_test(problem: ForcedOrbits) -> Callable[[BranchPoint], float]:
    def test(point: BranchPoint) -> float:
        M = problem.monodromy(point)
        mu = np.linalg.eigvals(M)
        return float(np.prod((1.0 + mu) / (1.0 + np.abs(mu))).real)

    return test


def _neimark_sacker_test(problem: ForcedOrbits) -> Callable[[BranchPoint], float]:
    def test(point: BranchPoint) -> float:
        mu = np.linalg.eigvals(problem.monodromy(point))
        i, j = np.triu_indices(mu.size, 1)
        pair = mu[i] * mu[j]
        return float(np.prod((pair - 1.0) / (1.0 + np.abs(pair))).real)

    return test


def _unstable(point: BranchPoint, problem: ForcedOrbits) -> int:
    return int(np.count_nonzero(np.abs(np.linalg.eigvals(problem.monodromy(point))) > 1.0 + STABLE))


def special_points(problem: ForcedOrbits, a: BranchPoint, b: BranchPoint, settings: Settings) -> list[SpecialPoint]:
    """Folds, period doublings, Neimark–Sacker points, branch points and grazings between two neighbours.

    A change of stability at a corner of the branch (grazing) is no bifurcation of a smooth family and is left to the
    grazing point.
    """
    found: list[SpecialPoint] = []
    smooth = problem.same_events(a, b)
    pieces = [(a, b)]
    if not smooth:
        touching = list(grazings(problem, a, b, settings))
        found += touching
        # between the corners the branch is smooth again
        w0 = a.u / a.scale
        chord = b.u / a.scale - w0
        inner = sorted(touching, key=lambda g: float((g.point.u / a.scale - w0) @ chord))
        ends = [a, *[g.point for g in inner], b]
        pieces = list(itertools.pairwise(ends))
    for left, right in pieces:
        if left is right:
            continue
        if left.tangent[-1] * right.tangent[-1] < 0:
            fold = locate(problem, left, right, lambda p: float(p.tangent[-1]), settings)
            if fold is not None:
                found.append(SpecialPoint("fold", fold.parameter, fold))
        if smooth and left.orientation * right.orientation < 0:
            branching = locate(problem, left, right, lambda p: p.orientation, settings)
            if branching is not None:
                found.append(SpecialPoint("branch_point", branching.parameter, branching))
        if _unstable(left, problem) == _unstable(right, problem):
            continue
        doubling = _period_doubling_test(problem)
        values = doubling(left), doubling(right)
        if values[0] * values[1] < 0:
            point = locate(problem, left, right, doubling, settings, values)
            if point is not None and _near(problem, point, -1.0):
                found.append(SpecialPoint("period_doubling", point.parameter, point))
        torus = _neimark_sacker_test(problem)
        values = torus(left), torus(right)
        if values[0] * values[1] < 0:
            point = locate(problem, left, right, torus, settings, values)
            if point is not None:
                mu = np.linalg.eigvals(problem.monodromy(point))
                circle = np.abs(np.abs(mu) - 1.0) < 1e-6
                if np.any(circle & (np.abs(mu.imag) > 1e-6)):
                    found.append(SpecialPoint("neimark_sacker", point.parameter, point))
    return found


def _near(problem: ForcedOrbits, point: BranchPoint, value: float) -> bool:
    return bool(np.min(np.abs(np.linalg.eigvals(problem.monodromy(point)) - value)) < 1e-5)


def follow_orbits(
    problem: ForcedOrbits, start: BranchPoint, low: float, high: float, settings: Settings | None = None
) -> Branch:
    """A branch of periodic motions, to iterate over; see :class:`beamsim.dynamics.continuation.Branch`."""
    return Branch(problem, start, low, high, Settings() if settings is None else settings, problem.same_events)


def switch_at_period_doubling(
    problem: ForcedOrbits, special: SpecialPoint, settings: Settings | None = None, amplitude: float = 0.01
) -> tuple[ForcedOrbits, BranchPoint] | None:
    """The first motion of the branch of doubled period that leaves at a period doubling.

    The eigenvector of the multiplier -1, ``amplitude`` times the motion's size, is added to the state; Newton then
    finds the parameter that belongs to this distance from the old branch. Its tangent points away from the old
    branch.
    """
    settings = Settings(iterations=15) if settings is None else settings
    doubled = problem.with_multiple(2 * problem.multiple)
    M = problem.monodromy(special.point)
    mu, vectors = np.linalg.eig(M)
    v = vectors[:, int(np.argmin(np.abs(mu + 1.0)))].real
    scale, _ = doubled.scale(special.point.u)
    row = np.append(v, 0.0) / scale
    row /= np.linalg.norm(row)
    for size in (amplitude, 0.1 * amplitude, 0.01 * amplitude, 5.0 * amplitude):
        w = special.point.u / scale + size * row
        point = correct(doubled, w * scale, row, float(row @ w), scale, settings, reference=row, furthest=10.0 * size)
        if point is not None:
            return doubled, point
    return None
