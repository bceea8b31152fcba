"""Shooting for periodic motions of the undamped, unforced system, whose period and energy belong to the unknowns.

Unknowns are what is free of the state at t = 0, called x, the period and a parameter. To the closure of the motion,
:math:`P z(\\tau) - B x = 0` with the rows P and a matrix B, come the energy, measured from static equilibrium, and a
condition for the phase of the motion where the start does not fix it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from beamsim.flow.passage import Passage
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.spring_families import SpringFamily
from beamsim.typing import Complexes, Floats


@dataclass(frozen=True)
class FreeMotion:
    """What the residual of a free motion computes besides itself."""

    passage: Passage
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
        passage = flow.carry(start, self.closes_after * period, (direction,) if by_factor else ())
        value, gradient, slope = self.family.potential(start[:n], factor)
        value += 0.5 * float(start[n:] @ start[n:])
        (rows, closing), phase = self.closing, self.phase
        J = np.zeros((k + held + (phase is not None), u.size))
        R = np.zeros(J.shape[0])
        R[:k], J[:k, :k] = passage.end[rows] - closing @ x, passage.transition[rows, :k] - closing
        J[:k, k] = self.closes_after * passage.slope[rows]
        if not held:
            J[:k, k] *= -period / float(u[-1])
        else:
            R[k], J[k, :k] = value - energy, np.append(gradient, start[n:])[:k]
            J[k, k + 1] = slope if by_factor else -energy
        if by_factor:
            J[:k, k + 1] = passage.parameters[rows, 0]
        if phase is not None:
            R[-1], J[-1, :k] = phase[0] @ x - phase[1], phase[0]
        return R, J, FreeMotion(passage, value, flow)

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Coordinates by the amplitude that carries all the energy, velocities likewise."""
        x, period, factor, energy = self.split(u)
        if not np.isfinite(energy):
            energy = max(self.family.potential(x[: self.n], factor)[0], 1e-300)
        speed = np.full(self.n, np.sqrt(2.0 * energy))
        state = np.concatenate([speed / np.maximum(self.family.omega, 0.2 * np.pi / period), speed])
        closure = state[self.closing[0]]
        if self.parameter == "frequency":
            return np.append(state[: x.size], 2 * np.pi / period), closure
        size = [energy] if self.phase is None else [energy, float(np.abs(self.phase[0]) @ state[: x.size])]
        return np.concatenate([state[: x.size], [period, 1.0]]), np.concatenate([closure, size])

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, Passage]:
        """The flow at a point, and its motion over a whole period."""
        flow, passage = point.data.flow, point.data.passage
        return flow, passage if self.closes_after == 1.0 else flow.carry(
            passage.start, passage.duration / self.closes_after
        )


def on_unit_circle(half_traces: Complexes, tolerance: float) -> bool:
    """Whether every pair of multipliers lies on the unit circle, where (mu + 1/mu)/2 is real and within [-1, 1]."""
    return bool(np.all(np.abs(half_traces.imag) < tolerance) and np.all(np.abs(half_traces.real) < 1.0 + tolerance))
