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

from dataclasses import dataclass

import numpy as np

from beamsim.orbits.branch import BranchPoint, Orbit
from beamsim.orbits.conservative import ConservativeOrbits, on_unit_circle
from beamsim.orbits.spring_families import SpringFamily
from beamsim.typing import Complexes, Floats


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

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers in pairs."""
        a = self.half_traces(point)
        root = np.sqrt(a**2 - 1.0)
        return np.concatenate([a + root, a - root])

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        q, period, _, _ = self.split(point.u)
        # 1e-7: (mu + 1/mu)/2 may leave [-1, 1] by this much: the trivial pair and round-off
        stable = on_unit_circle(self.half_traces(point), 1e-7)
        return Orbit(
            point.parameter, np.append(q, np.zeros(self.n)), period, self.multipliers(point), stable, point.residual,
            point.data.energy,
        )  # fmt: skip

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether two motions have the same order of contacts over half a period, from the same contacts at rest."""
        pa, pb = a.data.passage, b.data.passage
        return bool(pa.signature == pb.signature)


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

    Parameters
    ----------
    orbits : the shooting problem.
    mode : from 0.
    value : of the parameter.
    away_from : see above.

    Returns
    -------
    (n + 1,) or (n + 2,) unknowns.
    """
    omega = orbits.omega
    energy = float(np.exp(value)) if orbits.parameter == "energy" else orbits.energy
    q = orbits.vectors[:, mode] * (np.sqrt(2.0 * energy) / omega[mode])
    if away_from is not None and float(away_from @ q) < 0:
        q = -q
    q = q + orbits.family.rest(0.0 if orbits.parameter == "stiffness_factor" else orbits.factor)
    return orbits.unknowns(q, 2 * np.pi / float(omega[mode]), value)
