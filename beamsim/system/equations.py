"""What the mathematics needs to know of a structure: arrays in mass-normalised coordinates.

With every contact in one phase of its law, the system is linear,

.. math:: \\ddot q + C_s \\dot q + K_s q = f_0 + \\sum_l L_l\\, a_l(t) + \\text{contact constants},

where :math:`M = I` and the open structure's stiffness is diagonal. Nothing here knows files, units
or what the coordinates stand for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.inputs.signal import Signal
from beamsim.typing import Complexes, Floats, Ints


@dataclass(frozen=True)
class PiecewiseLinearSystem:
    """A structure in n mass-normalised coordinates (M = I) with m contacts."""

    stiffness: Floats  # (n,) diagonal of K of the open structure, rad^2/s^2; exact zeros for rigid-body modes
    damping: Floats  # (n, n) symmetric C of the open structure, 1/s
    contacts: Contacts
    constant_load: Floats  # (n,) gravity and dead loads, N per sqrt(kg)

    @property
    def size(self) -> int:
        """n."""
        return int(self.stiffness.size)

    @cached_property
    def coupled_by_damping(self) -> bool:
        """Whether C of the open structure has entries beside its diagonal."""
        return bool(np.count_nonzero(self.damping) > np.count_nonzero(np.diag(self.damping)))

    def acts(self, phases: Ints) -> bool:
        """Whether contacts act on the structure in given phases, or move by themselves."""
        contacts = self.contacts
        if contacts.internal_states or contacts.force_rows(phases)[0].any():
            return True
        return bool(contacts.holds(phases).any())

    def one_sided(self) -> PiecewiseLinearSystem:
        """The same with one-sided springs as the only contacts; see `Contacts.one_sided_parts`."""
        parts = self.contacts.one_sided_parts()
        return self if parts is self.contacts else replace(self, contacts=parts)


@dataclass(frozen=True)
class Forcing:
    """Time-dependent loads: ``sum_l load[l] * signal[l](t)``, and the base's own displacement d(t).

    ``base_displacement`` is needed only by contacts on the ground (``None`` means d = 0).
    """

    load: Floats  # (L, n)
    signal: tuple[Signal, ...]  # (L,)
    base_displacement: Signal | None = None


@dataclass(frozen=True)
class SineLoads:
    """The loads of a forcing as multiples of one sine: load l is ``coefficient[l] (i omega)^power[l]`` times it.

    The sine is the acceleration of the base or of a support that moves, the force, or what multiplies several forces.
    """

    coefficient: Complexes  # (L,)
    power: Ints  # (L,)

    def at(self, omega: Floats) -> Complexes:
        """(F, L) multiples at angular frequencies (F,), rad/s."""
        return np.asarray(self.coefficient * (1j * omega[:, None]) ** self.power)
