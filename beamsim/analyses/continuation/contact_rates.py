r"""Contacts as functions of a parameter of one snubber, with their exact derivatives.

The dashpot of a damping ratio follows, :math:`c = 2 \xi k / \Omega`, with :math:`\Omega` the first natural frequency
with the snubber closed. From its mode v, :math:`\partial\Omega^2/\partial k = (\phi^T v)^2` and
:math:`\partial\Omega^2/\partial x = 2 k\, (\phi^T v)(\phi'^T v)`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.snubbers import dashpot_from_ratio
from beamsim.flow.passage import ContactDirection
from beamsim.typing import Floats


@dataclass(frozen=True)
class MovedContact:
    """One snubber with another gap, stiffness or position.

    Parameters
    ----------
    contacts : the unchanged contacts.
    omega_squared : (n,) diagonal stiffness of the open structure, rad^2/s^2.
    index : of the snubber.
    quantity : "gap" (m), "stiffness" (N/m) or "position" (m).
    damping_ratio : of the snubber's dashpot; None if the dashpot is given by its coefficient, or there is none.
    rigid : number of rigid-body coordinates.
    shape_at : for positions, the deflection (n,) for a unit of each coordinate, and its derivative.
    """

    contacts: Contacts
    omega_squared: Floats
    index: int
    quantity: str
    damping_ratio: float | None = None
    rigid: int = 0
    shape_at: Callable[[float], tuple[Floats, Floats]] | None = None

    def __call__(self, value: float) -> tuple[Contacts, ContactDirection]:
        """The contacts at a value of the parameter, and their derivatives by it.

        Raises
        ------
        ArithmeticError : at a stiffness that is not positive.
        ValueError : where stiffness or dashpot changes, and the law is not made of these two.
        """
        c, i = self.contacts, self.index
        shape, gap = c.shape.copy(), c.gap.copy()
        stiffness, dashpot = c.laws[i].stiffness, c.laws[i].dashpot  # of slow motions
        rates = ContactDirection(np.zeros_like(gap), np.zeros_like(gap), np.zeros_like(gap), np.zeros_like(shape))
        if self.quantity == "gap":
            gap[i], rates.gap[i] = value, 1.0
        elif self.quantity == "stiffness":
            if value <= 0:
                raise ArithmeticError("the stiffness became negative")
            stiffness, rates.stiffness[i] = value, 1.0
        else:
            assert self.shape_at is not None
            shape[i], rates.shape[i] = self.shape_at(value)
        if self.damping_ratio is not None and self.quantity != "gap":
            omega, k, phi = np.sqrt(self.omega_squared), stiffness, shape[i]
            c_i = dashpot_from_ratio(self.damping_ratio, k, omega, phi, self.rigid)
            square = (2 * self.damping_ratio * k / c_i) ** 2 if c_i else 1.0
            values, vectors = np.linalg.eigh(np.diag(self.omega_squared) + k * np.outer(phi, phi))
            v = vectors[:, int(np.argmin(np.abs(values - square)))]
            moved = float(phi @ v)
            slope = moved**2 * rates.stiffness[i] + 2 * k * moved * float(rates.shape[i] @ v)
            dashpot = c_i
            rates.dashpot[i] = c_i * (rates.stiffness[i] / k - 0.5 * slope / square)
        if (stiffness, dashpot) != (c.laws[i].stiffness, c.laws[i].dashpot):
            c = c.with_numbers(i, stiffness, dashpot)
        return replace(c, shape=shape, gap=gap), rates
