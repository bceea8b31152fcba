"""Cubics from values and slopes at both ends of intervals."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.typing import Bools, Floats


@dataclass(frozen=True)
class Cubic:
    """Cubics on intervals of length one from values and slopes at their ends."""

    left: Floats
    right: Floats
    left_slope: Floats
    right_slope: Floats

    @cached_property
    def factors(self) -> tuple[Floats, Floats]:
        """Of the square and of the cube of the place."""
        rise, d, e = self.right - self.left, self.left_slope, self.right_slope
        return 3.0 * rise - 2.0 * d - e, d + e - 2.0 * rise

    def at(self, place: Floats) -> Floats:
        """Values at places from 0 to 1."""
        c, e = self.factors
        return np.asarray(self.left + place * (self.left_slope + place * (c + place * e)))

    def slope_at(self, place: Floats) -> Floats:
        """Slopes at places from 0 to 1."""
        c, e = self.factors
        return np.asarray(self.left_slope + place * (2.0 * c + place * 3.0 * e))

    def curvature_at(self, place: Floats) -> Floats:
        """Second derivatives at places from 0 to 1."""
        c, e = self.factors
        return np.asarray(2.0 * c + 6.0 * place * e)

    def top(self) -> tuple[Floats, Floats]:
        """Largest values, and the places of maxima between the ends: 0 where there is none."""
        d, (c, e) = self.left_slope, self.factors
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(c * c - 3.0 * e * d)
            place = np.where(c <= 0.0, d / (root - c), -(c + root) / (3.0 * e))
        place = np.where((place > 0.0) & (place < 1.0), place, 0.0)  # also where it is no number
        return np.maximum(self.at(place), np.maximum(self.left, self.right)), place

    def climbs(self, error: Floats) -> Bools:
        """Whether the slopes keep their signs, of sums whose slopes are within an error of the cubics'."""
        d, (c, e) = self.left_slope, self.factors
        with np.errstate(divide="ignore", invalid="ignore"):
            place = -c / (3.0 * e)
            middle = np.where((place > 0.0) & (place < 1.0), d + c * place, d)
        least = np.minimum(middle, np.minimum(d, self.right_slope))
        most = np.maximum(middle, np.maximum(d, self.right_slope))
        return np.asarray((least > error) | (most < -error))
