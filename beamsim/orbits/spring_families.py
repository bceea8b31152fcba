"""Families of undamped, unforced structures by the factor that multiplies the stiffness of their nonlinear springs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.flow.periodic_flow import ContactDirection, Parameter, PeriodicFlow, shift_system
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Floats


@dataclass
class SpringFamily:
    """Structures in modal coordinates of unit mass, whose nonlinear springs are multiplied by a factor.

    Parameters
    ----------
    system : the structure at a factor of one, without damping; its contacts are one-sided springs.
    equilibrium : finds the static shape of a system; without it the structure must rest at q = 0 (no prestress, no
        load).
    cubic : cubic springs, from rest at q = 0.
    """

    system: PiecewiseLinearSystem
    equilibrium: Callable[[PiecewiseLinearSystem], Floats] | None = None
    cubic: CubicSprings | None = field(default=None, kw_only=True)
    # factor, flow, rest
    _current: tuple[float, PeriodicFlow, Floats] | None = field(default=None, init=False, repr=False)
    _earlier: int = field(default=0, init=False, repr=False)  # motions that the current flow does not count

    def __post_init__(self) -> None:
        contacts = self.system.contacts
        self.springs = contacts.one_sided_springs()
        self._along = ContactDirection.of(contacts, added_contacts=contacts)
        self._direction: Parameter = self._along
        if self.cubic is not None:
            springs = self.springs
            self._direction = ContactDirection.of(springs, stiffness=springs.stiffness, cubic=self.cubic.stiffness)

    @property
    def omega(self) -> Floats:
        """(n,) natural frequencies of the structure without its nonlinear springs, rad/s; its modes are the
        coordinates."""
        return np.asarray(np.sqrt(self.system.stiffness))

    @property
    def rows(self) -> Floats:
        """(r, n) deflections that the contacts and the cubic springs feel."""
        contacts = self.system.contacts.shape
        return contacts if self.cubic is None else np.vstack([contacts, self.cubic.shape])

    @property
    def motions_computed(self) -> int:
        """Motions computed so far: the cost of a method, not in seconds."""
        return self._earlier + (0 if self._current is None else self._current[1].motions_computed)

    def _flow_at(self, factor: float) -> tuple[PeriodicFlow, Floats]:
        """The flow, and the static equilibrium."""
        if self._current is None or self._current[0] != factor:
            if factor < 0 and self.springs.count:
                raise ArithmeticError("the stiffness factor became negative")
            system, earlier = shift_system(self.system, self._along, factor - 1.0), self.motions_computed
            rest = np.zeros(system.size) if self.equilibrium is None else self.equilibrium(system)
            flow: PeriodicFlow
            if self.cubic is not None:
                springs = replace(self.cubic, stiffness=factor * self.cubic.stiffness)
                flow = SmoothFlow(system, springs=springs)
            elif self._current is not None:
                flow = self._current[1].with_contacts(system.contacts)
            else:
                flow = VariationalFlow(system)
            self._current, self._earlier = (factor, flow, rest), earlier - flow.motions_computed
        return self._current[1], self._current[2]

    def flow_at(self, factor: float) -> tuple[PeriodicFlow, Parameter]:
        """The flow with the springs scaled, and the parameter to differentiate by."""
        return self._flow_at(factor)[0], self._direction

    def static_equilibrium(self, factor: float) -> Floats:
        """(n,) the static equilibrium."""
        return np.zeros(self.system.size) if self.equilibrium is None else self._flow_at(factor)[1]

    def modes_at_rest(self, factor: float = 1.0) -> tuple[Floats, Floats]:
        """Frequencies (rad/s) and shapes of small motions about static equilibrium, its closed contacts closed."""
        q, c = self.static_equilibrium(factor), self.springs
        closed = -c.gap - c.sign * (c.shape @ q) > 0
        phi = c.shape[closed]
        K = np.diag(self.system.stiffness) + factor * (phi.T * c.stiffness[closed]) @ phi
        values, vectors = np.linalg.eigh(K)
        return np.sqrt(np.maximum(values, 0.0)), vectors

    def period_estimate(self, mode: int, factor: float, energy: float) -> float | None:
        """Period of one mode on a bilinear spring, where there is a single contact without load.

        The open structure's frequency until the gap is reached, the closed structure's from there to rest: with no
        gap the bilinear rule :math:`\\pi/\\omega_1 + \\pi/\\omega_2`. With prestress: closed about static equilibrium,
        open from where the penetration vanishes. Near a resonance it tells the mode's own motion from that in a tongue.

        Parameters
        ----------
        mode : from 0.
        factor : of the springs.
        energy : J.

        Returns
        -------
        Period, s; None where there is no such form.
        """
        c = self.springs
        if self.cubic is not None or c.count != 1 or np.any(self.system.constant_load):
            return None
        if c.gap[0] < 0:
            if factor == 0:
                return None
            omega, vectors = self.modes_at_rest(factor)
            pressed = float(-c.gap[0] - c.sign[0] * (c.shape[0] @ self.static_equilibrium(factor)))
            shape = float(c.shape[0] @ vectors[:, mode])
            return _bilinear_period(float(omega[mode]), float(self.omega[mode]), pressed, shape, energy)
        stiff = np.diag(self.system.stiffness) + factor * c.stiffness[0] * np.outer(c.shape[0], c.shape[0])
        squared = float(np.linalg.eigvalsh(stiff)[mode])
        if squared <= 0:  # a spring that gives no more force
            return None
        return _bilinear_period(
            float(self.omega[mode]), float(np.sqrt(squared)), float(c.gap[0]), float(c.shape[0, mode]), energy
        )

    def potential(self, q: Floats, factor: float) -> tuple[float, Floats, float]:
        """Potential energy from static equilibrium, J, its gradient, and its derivative by the factor.

        With x the change of a penetration from equilibrium, where the gradient vanishes, a one-sided spring adds
        (delta^2 - delta_0^2 - 2 delta_0 x) k / 2: x^2 k / 2 while closed, so that small energies lose no digits.
        Without an equilibrium it is measured from springs without force.
        """
        s, c, rest = self.system, self.springs, self.static_equilibrium(factor)
        still = -c.gap - c.sign * (c.shape @ rest)
        x = -c.sign * (c.shape @ (q - rest))
        before, now = np.maximum(still, 0.0), np.maximum(still + x, 0.0)
        if self.equilibrium is None:
            before = np.zeros_like(still)
        beyond = np.where(now > 0, np.where(before > 0, x**2, now**2), -before * (before + 2.0 * x))
        value = 0.5 * float((q - rest) @ (s.stiffness * (q - rest)) + factor * (c.stiffness @ beyond))
        by_factor = 0.5 * float(c.stiffness @ ((now - before) * (now + before)))
        push = -(c.shape.T @ (c.sign * c.stiffness * now))
        if self.cubic is not None:
            extension, k = self.cubic.shape @ q, self.cubic.stiffness
            bent = 0.25 * float(k @ extension**4)
            value, by_factor = value + factor * bent, by_factor + bent
            push += self.cubic.shape.T @ (k * extension**3)
        return value, s.stiffness * q - s.constant_load + factor * push, by_factor


def _bilinear_period(
    inner_frequency: float, outer_frequency: float, border: float, shape: float, energy: float
) -> float:
    """Period, s, of a bilinear mode: ``inner_frequency``, rad/s, up to a deflection ``border``, ``outer_frequency``
    beyond."""
    reach = abs(shape) * float(np.sqrt(2 * energy)) / inner_frequency
    if reach <= border:
        return 2 * np.pi / inner_frequency
    speed = inner_frequency * float(np.sqrt(reach**2 - border**2))
    inside = float(np.arccos(-border / reach)) / inner_frequency
    return 2 * (
        inside
        + float(np.arctan2(speed / outer_frequency, border * (inner_frequency / outer_frequency) ** 2))
        / outer_frequency
    )
