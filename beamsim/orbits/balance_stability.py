"""Harmonic balance as a problem whose special points can be found, at a cost that does not grow with the model.

Stability is that of the same motion by shooting: the balance gives the start, Newton's method corrects it, and the
transition matrix over a period has the multipliers. Where Newton comes to no motion beside it, those are of the passage
that begins as the motion does, as good as its harmonics are. At a fold, where the two branches end at slightly
different values, shooting is corrected across its branch instead of at the same value.

The structure is reduced for that: modes far above the motion's highest harmonic follow the springs statically, so that
the modes below and the residual vector of every spring are enough; the compliance that the springs see stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, MutableMapping
from dataclasses import field, replace
from typing import TYPE_CHECKING, ClassVar
from weakref import WeakKeyDictionary

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.dataclass import dataclass
from beamsim.flow.passage import Passage, PeriodicForcing
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.variational import VariationalFlow, floquet_multipliers
from beamsim.orbits.branch import BranchPoint, Orbit
from beamsim.orbits.continuation import Settings, correct_across, solve_at
from beamsim.orbits.harmonic_balance import ForcedBalance
from beamsim.orbits.shooting import STABLE, ForcedOrbits
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats

if TYPE_CHECKING:
    from beamsim.orbits.harmonic_motion import HarmonicMotion

Finder = Callable[[ForcedOrbits], BranchPoint | None]

MARGIN = 1.5  # modes up to this multiple of the motion's highest harmonic are kept
SMALL = 8  # coordinates that are kept as they are
NEAR = 0.2  # how far the motion of shooting may be from that of the balance, relative to its size


def reduced_for_stability(system: PiecewiseLinearSystem, highest: float) -> tuple[PiecewiseLinearSystem, Floats]:
    """The structure in the modes below `highest` (rad/s) and residual vectors of the contacts for those above.

    Returns the reduced system, and its coordinates (n, k) in the given ones.
    """
    n, shape = system.size, system.contacts.shape
    high = np.flatnonzero(system.stiffness > (MARGIN * highest) ** 2)
    if n <= SMALL or high.size <= shape.shape[0]:
        return system, np.eye(n)
    basis = np.delete(np.eye(n), high, axis=1)
    residual = np.zeros((n, shape.shape[0]))
    residual[high] = (shape[:, high] / system.stiffness[high]).T
    if np.any(residual):
        u, size, _ = np.linalg.svd(residual, full_matrices=False)
        basis = np.hstack([basis, u[:, size > 1e-12 * size[0]]])
    values, turn = np.linalg.eigh(basis.T @ (system.stiffness[:, None] * basis))
    basis = basis @ turn
    values[values < 1e-12 * values[-1]] = 0.0
    contacts: Contacts = replace(system.contacts, shape=shape @ basis)
    return PiecewiseLinearSystem(
        values, basis.T @ system.damping @ basis, contacts, system.constant_load @ basis
    ), basis


@dataclass
class BalancedOrbits(ForcedBalance):
    """Harmonic balance with what :func:`beamsim.orbits.special_points.special_points` asks of a problem."""

    bifurcates: ClassVar[bool] = True
    _reduced: tuple[float, ForcedOrbits, Floats] | None = field(default=None, init=False, repr=False)
    _spectra: MutableMapping[HarmonicMotion, Complexes] = field(
        default_factory=WeakKeyDictionary, init=False, repr=False
    )

    def with_harmonics(self, harmonics: int) -> ForcedBalance:
        """A plain balance with another number of harmonics."""
        return ForcedBalance(
            self.system, self.forcing, harmonics, self.parameter, self.omega, self.level, self.multiple, self.cubic
        )

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers, the largest first; computed once for each motion."""
        motion: HarmonicMotion = point.data
        values = self._spectra.get(motion)
        if values is None:
            values = self._spectra[motion] = self._multipliers(point, motion)
        return values

    def _multipliers(self, point: BranchPoint, motion: HarmonicMotion) -> Complexes:
        highest = motion.highest * motion.fundamental
        if self._reduced is None or highest > self._reduced[0]:
            # further than needed, so that the structure stays the same along a branch
            self._reduced = (1.5 * highest, *self._reduce(1.5 * highest))
        orbits = self._reduced[1]
        omega, level = self.at(point.parameter)
        orbits.omega, orbits.level = omega, level
        guess = np.append(self._state_at_start(point), omega)
        for correct in (solve_at, correct_across):
            beside = correct(orbits, guess, Settings())
            if beside is not None and float(np.max(np.abs((beside.u - guess) / beside.scale))) < NEAR:
                return orbits.multipliers(beside)
        return floquet_multipliers(orbits.flow.under(omega, level).carry(guess[:-1], motion.period).transition)

    def _reduce(self, highest: float) -> tuple[ForcedOrbits, Floats]:
        """The shooting problem of the structure reduced for motions up to a frequency, rad/s, and its coordinates."""
        flow: PeriodicFlow
        if self.cubic is not None and self.cubic.count:
            flow, basis = (
                self.flow_at(self.omega if self.parameter == "frequency" else self.level),
                np.eye(self.system.size),
            )
        else:
            system, basis = reduced_for_stability(self.system, highest)
            loads: PeriodicForcing = replace(self.forcing, force=self.forcing.force @ basis)
            flow = VariationalFlow(system, loads, self.omega, self.level)
        return ForcedOrbits(flow, multiple=self.multiple), basis

    def _state_at_start(self, point: BranchPoint) -> Floats:
        """The state of a motion at t = 0, in the reduced structure."""
        assert self._reduced is not None
        n, basis, state = self.system.size, self._reduced[2], point.data.states(np.zeros(1))[0]
        return np.concatenate([state[:n] @ basis, state[n:] @ basis])

    def first_motion(self, value: float, forward: float, find: Finder) -> BranchPoint | None:
        """A motion at a value of the parameter: from the linear response, else from one that shooting finds.

        Parameters
        ----------
        value, forward : of the parameter, and where the tangent points.
        find : finds an orbit of the reduced structure, best a stable one.
        """
        settings = Settings(iterations=20)
        if self.cubic is not None and self.cubic.count:
            return solve_at(self, self.linear_guess(value), settings, value, forward)
        local, basis = self.by_shooting(value)
        orbit = find(local)
        if orbit is not None:
            point = self.from_passage(local, basis, orbit.data, value, forward)
            if point is not None:
                return point
        return solve_at(self, self.linear_guess(value), settings, value, forward)

    def by_shooting(self, value: float) -> tuple[ForcedOrbits, Floats]:
        """The shooting problem of the reduced structure at a value, and its coordinates in the given ones."""
        omega, level = self.at(value)
        orbits, basis = self._reduce(self.harmonics * omega / self.multiple)
        return ForcedOrbits(orbits.flow.under(omega, level), multiple=self.multiple), basis

    def from_passage(
        self, local: ForcedOrbits, basis: Floats, passage: Passage, value: float, forward: float = 1.0
    ) -> BranchPoint | None:
        """The balanced motion beside one of the reduced structure over a period."""
        times = np.linspace(0.0, passage.duration, 8 * self.harmonics, endpoint=False)
        q = local.flow.states_at(passage, times)[:, : local.flow.system.size]
        return solve_at(self, self.guess(q @ basis.T, value), Settings(iterations=20), value, forward)

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        motion, mu = point.data, self.multipliers(point)
        stable = bool(np.abs(mu[0]) <= 1.0 + STABLE)
        return Orbit(point.parameter, motion.states(np.zeros(1))[0], motion.period, mu, stable, point.residual)

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Sums of harmonics have no corners."""
        return True
