"""What forced multiple scales hand back."""

from __future__ import annotations

from dataclasses import dataclass

from beamsim.typing import Bools, Floats


@dataclass(frozen=True)
class ForcedExpansionComparison:
    """Steady motions near a mode by multiple scales, at one level, and how far they are from the exact ones.

    The small factor multiplies springs, dashpots, damping and force together; 1 is the case itself.
    """

    level: float  # SI unit of the excitation
    mode: int  # from 1
    linear_frequency_hz: float
    frequency_hz: Floats  # (np,) along the curve at a factor of one, through its tip
    stable: Bools  # (np,) by the slow flow
    leading: dict[str, Floats]  # probe -> (np,) m, largest deflection of a period, to leading order
    first: dict[str, Floats]  # probe -> (np,) m, with the first-order correction
    backbone_hz: Floats  # (np,) frequency of the nonlinear mode with the same leading amplitude, to first order
    factor: Floats  # (E,) falling
    factor_frequency_hz: Floats  # (E,) excitation's: the detuning shrinks with the factor
    difference: Floats  # (E, 2) largest of a period, against the motion's size; leading and first order; nan: none near
    orders: Floats  # (E - 1, 2) observed; 1 and 2 expected
    stability_agrees: Bools  # (E,) the exact multipliers say what the slow flow says
