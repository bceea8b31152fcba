"""Families of undamped, unforced structures by the factor that multiplies the stiffness of their nonlinear springs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import field, replace
from typing import Any

import numpy as np

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.dataclass import dataclass
from beamsim.flow.passage import ContactDirection, Parameter, SpringFactor, moved_system
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Floats


@dataclass
class SpringFamily(ABC):
    """Structures in modal coordinates of unit mass, whose nonlinear springs are multiplied by a factor.

    Parameters
    ----------
    system : the structure at a factor of one, without damping.
    equilibrium : finds the static shape of a system; without it the structure must rest at q = 0 (no prestress, no
        load).
    cubic : cubic springs, from rest at q = 0.
    """

    system: PiecewiseLinearSystem
    equilibrium: Callable[[PiecewiseLinearSystem], Floats] | None = None
    cubic: CubicSprings | None = field(default=None, kw_only=True)
    _current: tuple[float, PeriodicFlow, Floats] | None = field(
        default=None, init=False, repr=False
    )  # factor, flow, rest
    _passages: tuple[int, int] = field(default=(0, 0), init=False, repr=False)  # of earlier flows; of the current, then

    def __post_init__(self) -> None:
        self.springs = self.system.contacts.one_sided_parts()

    @abstractmethod
    def _flow(self, system: PiecewiseLinearSystem, factor: float, twin: Any) -> PeriodicFlow:
        """The flow of a system with its contacts scaled; ``twin`` is the flow before it."""

    @abstractmethod
    def _direction(self) -> Parameter:
        """The factor as a parameter to differentiate by."""

    def _scaled(self, factor: float) -> PiecewiseLinearSystem:
        """The system with its contacts scaled."""
        return replace(self.system, contacts=self.springs.scaled(factor))

    @property
    def omega(self) -> Floats:
        """(n,) natural frequencies of the structure without its nonlinear springs, rad/s; its modes are the
        coordinates."""
        return np.asarray(np.sqrt(self.system.stiffness))

    @property
    def rows(self) -> Floats:
        """(r, n) deflections that the nonlinear springs feel."""
        return self.system.contacts.shape

    @property
    def passages(self) -> int:
        """Motions computed so far: the cost of a method, not in seconds."""
        earlier, begun = self._passages
        return earlier + (0 if self._current is None else self._current[1].passages - begun)

    def _at(self, factor: float) -> tuple[PeriodicFlow, Floats]:
        if self._current is None or self._current[0] != factor:
            earlier = self.passages
            system = self._scaled(factor)
            rest = np.zeros(system.size) if self.equilibrium is None else self.equilibrium(system)
            flow = self._flow(system, factor, None if self._current is None else self._current[1])
            self._passages = (earlier, flow.passages)
            self._current = (factor, flow, rest)
        return self._current[1], self._current[2]

    def flow_at(self, factor: float) -> tuple[PeriodicFlow, Parameter]:
        """The flow with the springs scaled, and the parameter to differentiate by."""
        return self._at(factor)[0], self._direction()

    def rest(self, factor: float) -> Floats:
        """(n,) the static equilibrium."""
        return np.zeros(self.system.size) if self.equilibrium is None else self._at(factor)[1]

    def period_estimate(self, mode: int, factor: float, energy: float) -> float | None:
        """Period of one mode, s, where it is known in closed form."""
        return None

    def modes_at_rest(self, factor: float = 1.0) -> tuple[Floats, Floats]:
        """Frequencies (rad/s) and shapes of small motions about static equilibrium, its closed contacts closed."""
        q, c = self.rest(factor), self.springs
        closed = -c.gap - c.sign * (c.shape @ q) > 0
        phi = c.shape[closed]
        K = np.diag(self.system.stiffness) + factor * (phi.T * c.stiffness[closed]) @ phi
        values, vectors = np.linalg.eigh(K)
        return np.sqrt(np.maximum(values, 0.0)), vectors

    def _in_springs(self, q: Floats) -> tuple[float, Floats]:
        """Energy in the nonlinear springs at a factor of one, J, and its gradient."""
        c = self.springs
        delta = np.maximum(-c.gap - c.sign * (c.shape @ q), 0.0)
        push = c.stiffness * delta
        return 0.5 * float(push @ delta), -(c.shape.T @ (c.sign * push))

    def potential(self, q: Floats, factor: float) -> tuple[float, Floats, float]:
        """Potential energy from static equilibrium, J, its gradient, and its derivative by the factor."""
        s = self.system
        in_springs, push = self._in_springs(q)
        gradient = s.stiffness * q - s.constant_load + factor * push
        if self.equilibrium is None:
            value = float(0.5 * q @ (s.stiffness * q) - s.constant_load @ q) + factor * in_springs
            return value, gradient, in_springs
        # with x the change of a penetration from equilibrium, where the gradient vanishes, a spring adds
        # (delta^2 - delta_0^2 - 2 delta_0 x) k / 2: x^2 k / 2 while closed, so that small energies lose no digits
        c, rest = self.springs, self.rest(factor)
        still = -c.gap - c.sign * (c.shape @ rest)
        x = -c.sign * (c.shape @ (q - rest))
        before, now = np.maximum(still, 0.0), np.maximum(still + x, 0.0)
        beyond = np.where(now > 0, np.where(before > 0, x**2, now**2), -before * (before + 2.0 * x))
        value = 0.5 * float((q - rest) @ (s.stiffness * (q - rest)) + factor * (c.stiffness @ beyond))
        return value, gradient, 0.5 * float(c.stiffness @ ((now - before) * (now + before)))


@dataclass
class ContactStiffness(SpringFamily):
    """One-sided springs."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.direction = ContactDirection.of(self.system.contacts, along=self.system.contacts)

    def _scaled(self, factor: float) -> PiecewiseLinearSystem:
        if factor < 0:
            raise ArithmeticError("the stiffness factor became negative")
        return moved_system(self.system, self.direction, factor - 1.0)

    def _flow(self, system: PiecewiseLinearSystem, factor: float, twin: Any) -> VariationalFlow:
        return VariationalFlow(system) if twin is None else twin.with_system(system)

    def _direction(self) -> ContactDirection:
        return self.direction

    def period_estimate(self, mode: int, factor: float, energy: float) -> float | None:
        """Period of one mode on a bilinear spring, where there is a single contact without load.

        The open structure's frequency until the gap is reached, the closed structure's from there to rest: with no
        gap the bilinear rule :math:`\\pi/\\omega_1 + \\pi/\\omega_2`. With prestress: closed about static equilibrium,
        open from where the penetration vanishes.
        """
        c = self.springs
        if c.count != 1 or np.any(self.system.constant_load):
            return None
        if c.gap[0] < 0:
            if factor == 0:
                return None
            omega, vectors = self.modes_at_rest(factor)
            pressed = float(-c.gap[0] - c.sign[0] * (c.shape[0] @ self.rest(factor)))
            shape = float(c.shape[0] @ vectors[:, mode])
            return _bilinear_period(float(omega[mode]), float(self.omega[mode]), pressed, shape, energy)
        stiff = np.diag(self.system.stiffness) + factor * c.stiffness[0] * np.outer(c.shape[0], c.shape[0])
        squared = float(np.linalg.eigvalsh(stiff)[mode])
        if squared <= 0:  # a spring that gives no more force
            return None
        return _bilinear_period(
            float(self.omega[mode]), float(np.sqrt(squared)), float(c.gap[0]), float(c.shape[0, mode]), energy
        )


def _bilinear_period(inner: float, outer: float, border: float, shape: float, energy: float) -> float:
    """Period, s, of a mode with frequency ``inner`` up to a deflection ``border``, and ``outer`` beyond it (rad/s)."""
    reach = abs(shape) * float(np.sqrt(2 * energy)) / inner
    if reach <= border:
        return 2 * np.pi / inner
    speed = inner * float(np.sqrt(reach**2 - border**2))
    inside = float(np.arccos(-border / reach)) / inner
    return 2 * (inside + float(np.arctan2(speed / outer, border * (inner / outer) ** 2)) / outer)


@dataclass
class CubicStiffness(SpringFamily):
    """Cubic springs, and contacts."""

    cubic: CubicSprings = field(kw_only=True)

    @property
    def rows(self) -> Floats:
        """(r, n) deflections that the contacts and the cubic springs feel."""
        return np.vstack([self.system.contacts.shape, self.cubic.shape])

    def _flow(self, system: PiecewiseLinearSystem, factor: float, twin: Any) -> SmoothFlow:
        return SmoothFlow(system, self.cubic.shape, factor * self.cubic.stiffness)

    def _direction(self) -> SpringFactor:
        return SpringFactor(self.cubic.stiffness, self.springs.stiffness)

    def _in_springs(self, q: Floats) -> tuple[float, Floats]:
        in_contacts, push = super()._in_springs(q)
        x, k = self.cubic.shape @ q, self.cubic.stiffness
        return 0.25 * float(k @ x**4) + in_contacts, self.cubic.shape.T @ (k * x**3) + push
