r"""Which of several extremes is the largest where a number changes: one rule for derivatives, limits and tolerances.

A peak is the largest of many extremes: of both signs, at all times, of several probes. Each of them changes with a
number of the scenario by a derivative of its own, so that their maximum has a kink where another one takes over,

.. math:: V(p) = \max_i (v_i + s_i p).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from beamsim.typing import Floats

CLOSE = 0.01  # of the deciding extreme, within which another one competes with it whatever the tolerance is
ALIKE = 0.01  # of a derivative, by which others may differ from it
NEGLIGIBLE = 1e-6  # of a value: changes with the tolerance that are smaller are not looked at


class Competition(NamedTuple):
    """How the largest of several extremes changes with a number."""

    derivative: float  # of the one that is the largest
    derivative_below: (
        float  # derivative for smaller numbers, of the extreme that decides at the lower end of the tolerance
    )
    derivative_above: float  # for larger ones
    change_below: float  # of the largest, at the lower end of the tolerance
    change_above: float  # at the upper end
    takeover: float  # change of the number with which another extreme becomes the largest, the nearest; else infinite
    rival: int  # that extreme, -1 without one
    is_close: bool  # whether one takes over within the tolerance, or is nearly as large

    def times(self, sign: float) -> Competition:
        """The same of values of the other sign, whose smallest one decides, where ``sign`` is -1."""
        return self._replace(
            derivative=sign * self.derivative,
            derivative_below=sign * self.derivative_below, derivative_above=sign * self.derivative_above,
            change_below=sign * self.change_below, change_above=sign * self.change_above,
        )  # fmt: skip


def compete(values: Floats, slopes: Floats, tolerance: float, scale: float = 0.0) -> Competition:
    """How the largest of several extremes changes with a number.

    Parameters
    ----------
    values : (k,) the extremes; the first is the one that decides, and none is larger.
    slopes : (k,) their derivatives by the number.
    tolerance : of the number, to either side.
    scale : size of what the extremes are of, where that is larger than they are.

    Returns
    -------
    Competition
        Where no extreme takes over within the tolerance, but one that is within `CLOSE` would, the derivative on that
        side is that of the one that would do so first.
    """
    size, gain, behind = abs(float(values[0])), slopes - slopes[0], np.maximum(values[0] - values, 0.0)
    different = np.abs(gain) > ALIKE * np.minimum(np.abs(slopes), abs(slopes[0]))
    others = np.flatnonzero(different & (np.abs(gain) * tolerance > NEGLIGIBLE * max(size, scale)))
    slope, noted, sides = float(slopes[0]), False, list[tuple[float, float]]()
    for side in (-1.0, 1.0):
        ahead = others[side * gain[others] > 0.0]
        ends = side * tolerance * gain[ahead] - behind[ahead]  # over what the first one is there
        last, change = 0, side * tolerance * slope
        if ends.max(initial=0.0) > 0.0:
            last = int(ahead[ends.argmax()])
            change += float(ends.max())
        elif (near := ahead[behind[ahead] <= CLOSE * size]).size:
            last = int(near[np.argmin(behind[near] / np.abs(gain[near]))])
        noted |= last != 0
        sides.append((float(slopes[last]), change))
    (below, change_below), (above, change) = sides
    at = behind[others] / gain[others]  # where they are as large
    first = int(np.abs(at).argmin()) if others.size else -1
    takes_over, rival = (float(at[first]), int(others[first])) if others.size else (np.inf, -1)
    return Competition(slope, below, above, change_below, change, takes_over, rival, noted)
