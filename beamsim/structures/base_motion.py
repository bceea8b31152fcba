"""How the base moves: along an axis, or about an axis through a point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from beamsim.typing import Floats

TRANSLATIONS = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")


@dataclass(frozen=True)
class BaseDirection:
    """One unit of displacement along an axis, m, or of rotation about one, rad; the right-hand rule gives its sense.

    Also the direction of gravity, which acts as an acceleration of the base the other way.
    """

    direction: str = ""  # x, y, z, rx, ry or rz; empty: that of each body, z where it has none
    about: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, a point on the axis of a rotation

    @property
    def rotates(self) -> bool:
        """Whether it is a rotation."""
        return self.direction in ROTATIONS

    def moved(self, by: float) -> BaseDirection:
        """The same in coordinates of a body that begins at x = ``by``, m."""
        return replace(self, about=(self.about[0] - by, *self.about[1:])) if self.rotates else self

    def displacements(self, points: Floats) -> Floats:
        """(k, 3) displacements x, y, z of points (k, 3), m."""
        axis = np.eye(3)[(ROTATIONS if self.rotates else TRANSLATIONS).index(self.direction or "z")]
        if not self.rotates:
            return np.tile(axis, (points.shape[0], 1))
        return np.cross(axis, points - np.array(self.about))


UPWARDS = BaseDirection()
"""The deflection of beams, plates and masses, and the direction that imported matrices name."""
