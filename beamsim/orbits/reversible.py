"""Nonlinear normal modes by half-period shooting: motions that are at rest twice a period.

The undamped, unforced system runs backwards as it runs forwards, so that a motion at rest at 0 and at T/2 has period T.
The unknowns are the shape at rest and the period, n + 1 of them:

.. math:: v(T/2;\\, q_0, p) = 0, \\qquad E(q_0, p) = E_0,

p being the factor of the contacts' stiffness, the energy, or the frequency. The energy is measured from static
equilibrium. The transition matrix over half a period, :math:`\\Phi = \\begin{pmatrix} a & b \\\\ c & d \\end{pmatrix}`
in (q, q'), gives the monodromy matrix :math:`R \\Phi^{-1} R \\Phi` (R reverses velocities), whose multipliers come in
pairs with :math:`(\\mu + 1/\\mu)/2 = 1 + 2\\,\\mathrm{eig}(b^T c)`: the motion is stable where all these lie in [-1,
1].
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.passage import Passage
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.orbits.branch import BranchPoint, FailedSearch, Orbit, SpecialPoint, recorded
from beamsim.orbits.continuation import Settings, branch_point_between, locate
from beamsim.orbits.grazing import grazings, smooth_pieces, turned_at
from beamsim.orbits.spring_families import SpringFamily
from beamsim.typing import Complexes, Floats

LARGEST_LOG = 600.0  # of an energy
STABLE = 1e-7  # (mu + 1/mu)/2 may leave [-1, 1] by this much: the trivial pair and round-off


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
    (`SpringFamily.modes_at_rest`).
    """

    family: SpringFamily
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

    def share(self, q: Floats, factor: float, v: Floats | None = None) -> Floats:
        """(n,) share of each linear mode in the energy of displacements q and velocities v (at rest by default),
        without that of the nonlinear springs."""
        parts = (self.omega * (self.vectors.T @ (q - self.family.rest(factor)))) ** 2
        if v is not None:
            parts = parts + (self.vectors.T @ v) ** 2
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

    def swings_once(self, point: BranchPoint, mode: int) -> bool:
        """Whether a mode has swung to its other side half a period on: a motion run through twice has not."""
        q, _, factor, _ = self.split(point.u)
        rest, shape = self.family.rest(factor), self.vectors[:, mode]
        return float(shape @ (q - rest)) * float(shape @ (point.data.passage.end[: self.n] - rest)) < 0

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
    q = q + orbits.family.rest(0.0 if orbits.parameter == "stiffness_factor" else orbits.factor)
    return orbits.unknowns(q, 2 * np.pi / float(omega[mode]), value)


def mode_points(
    orbits: BrakeOrbits, a: BranchPoint, b: BranchPoint, settings: Settings, failed: list[FailedSearch] | None = None
) -> list[SpecialPoint]:
    """Folds, branch points (internal resonances among them) and grazings between two neighbours.

    ``failed`` as for :func:`beamsim.orbits.shooting.special_points`.
    """
    special: list[SpecialPoint] = []
    smooth = orbits.same_events(a, b)
    if not smooth:
        with recorded("grazing", a, failed):
            special.extend(grazings(orbits, a, b, settings))
    for left, right in smooth_pieces(a, b, special):
        if left.tangent[-1] * right.tangent[-1] < 0:
            with recorded("fold", a, failed):
                fold = locate(orbits, left, right, lambda p: float(p.tangent[-1]), settings)
                if fold is not None and abs(fold.tangent[-1]) < 1e-6:
                    special.append(SpecialPoint("fold", fold.parameter, fold))
                elif fold is not None:
                    turned_at(special, (left, right), fold)
    if smooth:
        with recorded("branch_point", a, failed):
            crossing = branch_point_between(orbits, a, b, settings)
            if crossing is not None:
                special.append(SpecialPoint("branch_point", crossing.parameter, crossing))
    return special
