"""The contacts of a system as arrays: where they act, and their laws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.typing import Bools, Floats


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
    on_ground: Bools  # (m,) feels the absolute deflection, shape @ q + d(t)
    no_tension: Bools  # (m,) leaves when the force, not the penetration, reaches zero

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
