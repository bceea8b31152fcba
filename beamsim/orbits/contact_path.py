"""Flows along a path of systems whose contacts change: gap, stiffness, position, straight in the numbers or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from beamsim.contacts.contacts import Contacts
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import ContactDirection, VariationalFlow


@dataclass
class PathOfContacts:
    """The third kind of parameter of :class:`beamsim.orbits.shooting.ForcedOrbits`.

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
            # states are numbered alike in all flows of a path, so that a passage found with one can be read with
            # another
            flow.learn(self._last)
        self._last = VariationalFlow(system, flow.forcing, flow.omega, flow.level, twin=flow)
        return self._last, direction
