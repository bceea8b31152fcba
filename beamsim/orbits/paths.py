"""Paths of systems by one number: the third kind of parameter of :class:`beamsim.orbits.shooting.ForcedOrbits`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.flow.passage import ContactDirection, StructureDirection
from beamsim.flow.periodic_flow import PeriodicFlow


@dataclass
class ContactPath:
    """Systems whose contacts change: gap, stiffness, position, straight in the numbers or not.

    Parameters
    ----------
    flow : one of the same structure, later the one last asked for; the open state is shared by all.
    at : the contacts at a value of the parameter, and their derivatives by it.
    """

    flow: PeriodicFlow
    at: Callable[[float], tuple[Contacts, ContactDirection]]

    def __call__(self, parameter: float) -> tuple[PeriodicFlow, ContactDirection]:
        """The flow at a parameter, and the direction there."""
        contacts, direction = self.at(parameter)
        self.flow = self.flow.with_contacts(contacts)
        return self.flow, direction


@dataclass
class DampingPath:
    """Systems with added damping, from heavy damping down to the structure's own, to find a first motion along.

    A heavily damped structure has one motion of the excitation's period, and it attracts. Followed while the added
    damping goes away it leads to the motion that continues the linear response, where transients end in chaos or in a
    motion of another period and Newton's method from a guess may end on any of many unstable ones.

    The parameter x goes from 1 (the structure itself) to ``heavy``; the ratio ``unit (e^(x - 1) - 1)`` is added to
    every mode.
    """

    flow: PeriodicFlow  # the structure itself; later the one last asked for
    unit: float = field(init=False)
    heavy: float = field(init=False)

    def __post_init__(self) -> None:
        s = self.flow.system
        omega = np.sqrt(s.stiffness)
        elastic = omega > 0
        # a rigid-body mode is damped like the lowest elastic one
        self._critical = 2.0 * np.where(elastic, omega, omega[elastic].min() if elastic.any() else self.flow.omega)
        ratio = np.median(np.diag(s.damping)[elastic] / self._critical[elastic]) if elastic.any() else 0.0
        self._damping = s.damping
        # 1e-3: unit in which the added damping is counted where the structure has less
        self.unit = max(float(ratio), 1e-3)
        # 0.5: added damping ratio at the beginning of a path of falling damping
        self.heavy = 1.0 + float(np.log1p(0.5 / self.unit))

    def __call__(self, parameter: float) -> tuple[PeriodicFlow, StructureDirection]:
        """The flow at a parameter, and the direction there."""
        flow, n = self.flow, self.flow.system.size
        grown = float(np.exp(parameter - 1.0))
        direction = StructureDirection.of(n, damping=self.unit * grown * self._critical)
        added = np.diag(self.unit * (grown - 1.0) * self._critical)
        self.flow = flow.with_damping(self._damping + added)
        return self.flow, direction
