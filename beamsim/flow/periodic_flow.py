"""What shooting and continuation ask of a structure under periodic loads, whatever carries its motion.

Implemented in closed form (:mod:`beamsim.flow.variational`) and by Taylor series for cubic springs
(:mod:`beamsim.flow.smooth_flow`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.flow.passage import (
    ContactDirection,
    Level,
    Parameter,
    Passage,
    PeriodicForcing,
    StructureDirection,
    penetration_of_states,
)
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Floats, Ints


@dataclass
class PeriodicFlow(ABC):
    """A structure under periodic loads, ready to be carried over a time with all derivatives.

    Parameters
    ----------
    system : the structure.
    forcing : its periodic loads (default: none).
    omega, level : frequency, rad/s, and factor of the loads; `under` gives the flow at others.
    """

    differentiates: ClassVar[tuple[type[Parameter], ...]]  # kinds of parameters that `carry` takes derivatives by

    system: PiecewiseLinearSystem
    forcing: PeriodicForcing | None = None
    omega: float = 1.0
    level: float = 1.0
    _carried: list[int] = field(init=False, repr=False)  # shared by all flows that come from this one

    def __post_init__(self) -> None:
        self.loads = PeriodicForcing.none(self.system.size) if self.forcing is None else self.forcing
        self._carried = [0]
        self._prepare()

    @abstractmethod
    def _prepare(self) -> None:
        """What follows from the system."""

    @property
    def size(self) -> int:
        """N, of the state."""
        return 2 * self.system.size + self.system.contacts.internal_states

    @property
    def passages(self) -> int:
        """Motions computed so far, of this flow and of those that come from it."""
        return self._carried[0]

    def under(self, omega: float | None = None, level: float | None = None) -> Self:
        """The flow of the same structure at another frequency and level."""
        flow = copy(self)
        flow.omega = self.omega if omega is None else float(omega)
        flow.level = self.level if level is None else float(level)
        return flow

    def with_system(self, system: PiecewiseLinearSystem) -> Self:
        """The flow of another structure, or of other contacts with as many phases, under the same loads."""
        flow = copy(self)
        flow.system = system
        flow._prepare()
        return flow

    def with_contacts(self, contacts: Contacts) -> Self:
        """The flow of the same structure with other contacts of as many phases."""
        return self.with_system(replace(self.system, contacts=contacts))

    def with_damping(self, damping: Floats) -> Self:
        """The flow of the same structure with another damping matrix (n, n)."""
        return self.with_system(replace(self.system, damping=damping))

    @abstractmethod
    def carry(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> Passage:
        """The state after ``duration``, with its derivatives.

        Parameters
        ----------
        start : (N,) state (q, q') and the contacts' internal states.
        duration : s, positive.
        parameters : what to take derivatives by, besides the start; of the kinds in ``differentiates``.
        t : time at the start, s (the periodic loads' phase).

        Returns
        -------
        The motion with the derivatives of its end.

        Raises
        ------
        WorkExceeded : too many events (chattering).
        NotFinite : the motion leaves the range of floating-point numbers.
        """

    @abstractmethod
    def states_at(self, passage: Passage, times: Floats) -> Floats:
        """(nt, N) the state at increasing times within a passage."""

    @property
    @abstractmethod
    def fastest(self) -> float:
        """rad/s, largest rate of its motions."""

    @property
    def reversible(self) -> bool:
        """Undamped and unforced: motions run backwards as well."""
        return self.loads.count == 0 and not np.any(self.system.damping) and not self.system.contacts.damped

    @property
    def base_moves(self) -> bool:
        """Whether a contact feels the motion of the base."""
        return self.loads.count > 0 and bool(np.any(self.system.contacts.felt))

    def penetration_of(self, y: Floats, times: Floats) -> tuple[Floats, Floats]:
        """Penetration and penetration rate of every contact, (nt, m) each, of states (nt, N) at times."""
        base = self.loads.base_motion(self.omega, self.level, times) if self.base_moves else None
        return penetration_of_states(self.system.contacts, y, base)

    def contact_forces(self, phases: Ints, y: Floats, times: Floats) -> Floats:
        """Forces of the contacts along a motion.

        Parameters
        ----------
        phases : (nt, m) of the contacts.
        y : (nt, N) states.
        times : (nt,) s.

        Returns
        -------
        forces : (nt, m) N.
        """
        delta, rate = self.penetration_of(y, times)
        return self.system.contacts.forces(phases, delta, rate, y[:, 2 * self.system.size :])

    def penetration_derivative(
        self, passage: Passage, contact: int, parameters: Sequence[Parameter]
    ) -> tuple[Floats, Floats]:
        """Derivatives of a contact's penetration at the end of a passage from t = 0.

        Parameters
        ----------
        passage : carried with the parameters.
        contact : number of it.
        parameters : P of them.

        Returns
        -------
        by_start, by_parameters : (N,) and (P,).
        """
        n, c, j = self.system.size, self.system.contacts, contact
        row = -c.sign[j] * c.shape[j]
        by = row @ passage.parameters[:n]
        t, sign = passage.duration, -float(c.sign[j] * c.felt[j])
        for i, p in enumerate(parameters):
            if isinstance(p, ContactDirection):
                by[i] -= p.gap[j] + c.sign[j] * float(p.shape[j] @ passage.end[:n])
            elif sign and self.base_moves and not isinstance(p, StructureDirection):
                _, base, _, dbase = self.loads.at(self.omega, self.level)
                moving = dbase + 1j * self.loads.multiple * t * base
                if isinstance(p, Level):
                    moving = self.loads.at(self.omega, 1.0)[1]
                by[i] += sign * float((moving * np.exp(1j * self.loads.multiple * self.omega * t)).sum().real)
        return row @ passage.transition[:n], by
