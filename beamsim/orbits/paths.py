"""Paths of systems by one number: the third kind of parameter of :class:`beamsim.orbits.shooting.ForcedOrbits`.

States are numbered alike in all flows of a path, so that a passage found with one can be read with another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.flow.passage import ContactDirection, StructureDirection
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import VariationalFlow

HEAVY = 0.5  # added damping ratio at the beginning of a path of falling damping
SMALLEST_RATIO = 1e-3  # unit in which the added damping is counted where the structure has less


@dataclass
class ContactPath:
    """Systems whose contacts change: gap, stiffness, position, straight in the numbers or not.

    Parameters
    ----------
    flow : one of the same structure; its open state is shared by all others.
    at : the contacts at a value of the parameter, and their derivatives by it.
    """

    flow: VariationalFlow | SmoothFlow
    at: Callable[[float], tuple[Contacts, ContactDirection]]
    _last: VariationalFlow | None = field(default=None, repr=False)

    def __call__(self, parameter: float) -> tuple[VariationalFlow, ContactDirection]:
        """The flow at a parameter, and the direction there."""
        contacts, direction = self.at(parameter)
        flow, system = self.flow, replace(self.flow.system, contacts=contacts)
        if isinstance(flow, SmoothFlow):
            smooth = replace(flow, system=system)
            return smooth, direction  # type: ignore[return-value]  # stands in for the closed-form flow
        if self._last is not None:
            flow.learn(self._last)
        self._last = VariationalFlow(system, flow.forcing, flow.omega, flow.level, twin=flow)
        return self._last, direction


@dataclass
class DampingPath:
    """Systems with added damping, from heavy damping down to the structure's own, to find a first motion along.

    A heavily damped structure has one motion of the excitation's period, and it attracts. Followed while the added
    damping goes away it leads to the motion that continues the linear response, where transients end in chaos or in a
    motion of another period and Newton's method from a guess may end on any of many unstable ones.

    The parameter x goes from 1 (the structure itself) to ``heavy``; the ratio ``unit (e^(x - 1) - 1)`` is added to
    every mode.
    """

    flow: VariationalFlow  # the structure itself
    unit: float = field(init=False)
    heavy: float = field(init=False)
    _last: VariationalFlow | None = field(init=False, default=None, repr=False)

    def __post_init__(self) -> None:
        s = self.flow.system
        omega = np.sqrt(s.stiffness)
        elastic = omega > 0
        # a rigid-body mode is damped like the lowest elastic one
        self._critical = 2.0 * np.where(elastic, omega, omega[elastic].min() if elastic.any() else self.flow.omega)
        own = np.median(np.diag(s.damping)[elastic] / self._critical[elastic]) if elastic.any() else 0.0
        self.unit = max(float(own), SMALLEST_RATIO)
        self.heavy = 1.0 + float(np.log1p(HEAVY / self.unit))

    def __call__(self, parameter: float) -> tuple[VariationalFlow, StructureDirection]:
        """The flow at a parameter, and the direction there."""
        flow, n = self.flow, self.flow.system.size
        grown = float(np.exp(parameter - 1.0))
        direction = StructureDirection.of(n, damping=self.unit * grown * self._critical, harmonics=flow.loads.count)
        added = np.diag(self.unit * (grown - 1.0) * self._critical)
        moved = VariationalFlow(
            replace(flow.system, damping=flow.system.damping + added), flow.forcing, flow.omega, flow.level
        )
        moved.learn(flow if self._last is None else self._last)
        self._last = moved
        return moved, direction
