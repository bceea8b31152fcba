"""What the mathematics needs to know of a structure: arrays in mass-normalised coordinates.

With one-sided springs closed in the set *s*, the system is linear,

.. math:: \\ddot q + C_s \\dot q + K_s q = f_0 + \\sum_l L_l\\, a_l(t) + \\text{contact constants},

where :math:`M = I` and the open structure's stiffness is diagonal. Nothing here knows files, units
or what the coordinates stand for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamsim.model.signal import Signal

__all__ = ["Contacts", "Forcing", "PiecewiseLinearSystem"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Contacts:
    """One-sided springs, m of them; penetration ``delta = -gap - sign * (shape @ q [+ d])``.

    The push on the structure along ``shape`` is ``sign * force``, with
    ``force = stiffness * delta + dashpot * delta'`` while closed, else 0.
    """

    shape: Floats  # (m, n) deflection at the contact for a unit of each coordinate
    sign: Floats  # (m,) +1 below the structure (resists negative deflection), -1 above
    stiffness: Floats  # (m,) N/m; negative where a piecewise-linear spring softens
    dashpot: Floats  # (m,) N s/m
    gap: Floats  # (m,) m; clearance positive, prestress negative
    on_ground: NDArray[np.bool_]  # (m,) feels the absolute deflection, shape @ q + d(t)
    no_tension: NDArray[np.bool_]  # (m,) leaves when the force, not the penetration, reaches zero

    @property
    def count(self) -> int:
        """m."""
        return int(self.stiffness.size)

    def take(self, which: slice) -> Contacts:
        """Some of them."""
        return Contacts(**{name: values[which] for name, values in vars(self).items()})

    def with_others(self, others: Contacts) -> Contacts:
        """These and then the others."""
        return Contacts(**{name: np.concatenate([values, vars(others)[name]]) for name, values in vars(self).items()})


@dataclass(frozen=True)
class PiecewiseLinearSystem:
    """A structure in n mass-normalised coordinates (M = I) with m one-sided springs."""

    stiffness: Floats  # (n,) diagonal of K of the open structure, rad^2/s^2; exact zeros for rigid-body modes
    damping: Floats  # (n, n) symmetric C of the open structure, 1/s
    contacts: Contacts
    constant_load: Floats  # (n,) gravity and dead loads, N per sqrt(kg)

    @property
    def size(self) -> int:
        """n."""
        return int(self.stiffness.size)


@dataclass(frozen=True)
class Forcing:
    """Time-dependent loads: ``sum_l load[l] * signal[l](t)``, and the base's own displacement d(t).

    ``base_displacement`` is needed only by contacts on the ground (``None`` means d = 0).
    """

    load: Floats  # (L, n)
    signal: tuple[Signal, ...]  # (L,)
    base_displacement: Signal | None = None
