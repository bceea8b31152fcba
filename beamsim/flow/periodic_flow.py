"""What shooting and continuation ask of a structure under periodic loads, whatever carries its motion.

Implemented in closed form (:mod:`beamsim.flow.variational`) and by Taylor series for cubic springs
(:mod:`beamsim.flow.smooth_flow`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
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


class PeriodicFlow(ABC):
    """A structure under periodic loads, ready to be carried over a time with all derivatives."""

    differentiates: ClassVar[tuple[type[Parameter], ...]]  # kinds of parameters that `carry` takes derivatives by

    system: PiecewiseLinearSystem
    loads: PeriodicForcing
    omega: float  # rad/s, of the loads
    level: float  # factor of the loads
    size: int  # N, of the state

    @property
    @abstractmethod
    def passages(self) -> int:
        """Motions computed so far, of this flow and of those that come from it."""

    @abstractmethod
    def under(self, omega: float | None = None, level: float | None = None) -> Self:
        """The flow of the same structure at another frequency and level."""

    @abstractmethod
    def carry(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> Passage:
        """The state after ``duration``, with its derivatives.

        Parameters
        ----------
        start : (N,) state (q, q') and the contacts' internal states.
        duration : s, positive.
        parameters : what to take derivatives by, besides the start; of the kinds in ``differentiates``.
        t : time at the start, s (the periodic loads' phase).

        Raises
        ------
        WorkExceeded : too many events (chattering).
        NotFinite : the motion leaves the range of floating-point numbers.
        """

    @abstractmethod
    def states_at(self, passage: Passage, times: Floats) -> Floats:
        """(nt, N) the state at increasing times within a passage."""

    @abstractmethod
    def with_contacts(self, contacts: Contacts) -> Self:
        """The flow of the same structure with other contacts of as many phases."""

    @abstractmethod
    def with_damping(self, damping: Floats) -> Self:
        """The flow of the same structure with another damping matrix (n, n)."""

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

    def base_motion(self, t: float) -> tuple[float, float]:
        """Displacement and velocity of the base."""
        d, v = self.loads.base_motion(self.omega, self.level, np.array([t]))
        return float(d[0]), float(v[0])

    def penetration(self, passage: Passage, times: Floats) -> tuple[Floats, Floats]:
        """Penetration and penetration rate of every contact, (nt, m) each, at times of a passage."""
        return self.penetration_of(self.states_at(passage, times), times)

    def penetration_of(self, y: Floats, times: Floats) -> tuple[Floats, Floats]:
        """The same of states (nt, N) that are known."""
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
