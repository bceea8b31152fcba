"""Motions that just touch a stop, followed in the frequency and a second parameter.

Where a stiff stop turns a response curve back, the fold lies on top of the grazing: the curve has a corner, or nearly,
and no smooth fold to follow. The border of the region with several motions is then the curve of grazings: to the
shooting equations comes that the penetration's extreme is zero. Its derivative is that of the penetration at a fixed
time, since the rate is zero at an extreme.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.flow.variational import Frequency, Passage
from beamsim.orbits.continuation import BranchPoint
from beamsim.orbits.folds import SecondParameter, TwoParameterCurve, start_of_curve
from beamsim.orbits.grazing import SpecialPoint, extremum
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.typing import Floats


@dataclass
class GrazingCurve(TwoParameterCurve):
    """Grazings as a continuation problem; unknowns as those of a curve of folds."""

    contact: int = 0
    top: bool = True  # a closed phase appears (else an open one)
    share: float = 0.0  # when in the period, near which the extreme is looked for

    def residual(self, u: Floats) -> tuple[Floats, Floats, Passage]:
        """The shooting residual and the penetration's extreme, with their Jacobian."""
        passage, A, columns = self._passage(u)
        flow, parameter = self._set(u)
        height, time = extremum(flow, passage, self.contact, self.top, self.share * passage.duration)
        if not np.isfinite(height):
            raise ArithmeticError("the penetration has no extreme near the grazing")
        self.share = time / passage.duration
        by = (Frequency(), parameter)
        touch = flow.carry(passage.start, time, by)
        by_start, by_parameters = flow.penetration_derivative(touch, self.contact, by)
        k = A.shape[0]
        J = np.zeros((k + 1, k + 2))
        J[:k, :k], J[:k, k:] = A, columns
        J[k, :k], J[k, k:] = by_start[self.orbits.kept], by_parameters
        return np.append((passage.end - passage.start)[self.orbits.kept], height), J, passage

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """As a curve of folds; the extreme against the motion."""
        scale, residual = super().scale(u)
        residual[-1] = scale[0]
        return scale, residual


def start_of_grazing_curve(
    orbits: ForcedOrbits,
    grazing: SpecialPoint,
    second: SecondParameter,
    value: float,
    forward: float = 1.0,
) -> tuple[GrazingCurve, BranchPoint] | None:
    """The curve of grazings through one that was located, from its value of the second parameter on."""
    share = grazing.time / grazing.point.data.duration
    curve = GrazingCurve(orbits, second, grazing.contact, grazing.closing, share)
    point = start_of_curve(curve, grazing, value, forward)
    return None if point is None else (curve, point)
