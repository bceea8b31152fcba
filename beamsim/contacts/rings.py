r"""The law of the sides of a ring, a circular clearance.

The force of a ring of clearance g and stiffness k is radial, :math:`k (r - g)` where the distance r from the centre is
larger than g. It is made of N flat sides with normals n_i, evenly spaced, each with the same table :math:`\psi`,

.. math:: F(u) = -\sum_i \psi(n_i \cdot u - g)\, n_i .

Each side is conservative, so is the sum, and it is continuous. With many sides the sum is an integral over angles, and
:math:`\psi` has to grow as the square root of the penetration: the table is steepest where it begins. It is the
least-squares fit of the sum to the radial force up to the largest penetration. Beginning the table a few times the
clearance between polygon and circle, :math:`b = g\,(1 - \cos(\pi / N))`, before the circle makes several sides act at
once, so that light impacts do not meet a single flat side.

The table scales: forces are multiples of :math:`k g`, and it depends on N and on the largest penetration over g alone.
An elliptical clearance has the table of its radius of curvature at each side.

A dashpot c belongs to a relaxation time :math:`\tau = c / k`, by which every slope of the table has a dashpot. The sum
is :math:`k (r - g) + c \dot r` along the radius, and the small drag :math:`c (1 - g / r)` per velocity along the wall.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from beamsim.contacts.laws import ContactLaw, LawRow, piecewise_linear
from beamsim.typing import Floats

SLOPES = 3  # of the table
EARLY = 5.0  # beginning of the table before the circle, over the clearance between polygon and circle
BEYOND = 1.15  # end of the fitted range over the largest penetration: impacts along the wall go deeper
WEIGHT = 0.1  # of the largest penetration, added to the penetration that errors are relative to
FITTED_DEPTHS, FITTED_ANGLES = 40, 7
STEP = 0.02  # of the impacts that measure the error, times the period over 2 pi


class RingErrors(NamedTuple):
    """Largest errors of a ring made of sides, relative to the exact ring."""

    clearance: float  # over the clearance: where contact begins
    force: float  # over the force at the largest penetration, from a tenth of it on
    direction_deg: float  # of the force, from a tenth of the largest penetration on
    impulse: float  # over the impulse, of impacts up to the largest penetration and 45 degrees


@dataclass(frozen=True)
class RingTable:
    """The table of every side of a ring with unit clearance and stiffness."""

    sides: int  # N
    largest: float  # largest penetration
    knots: tuple[float, ...]  # penetrations at which slopes begin
    slopes: tuple[float, ...]

    def forces(self, position: Floats) -> Floats:
        """(p, 2) forces at positions (p, 2) relative to the centre."""
        normals, starts = _normals(self.sides), np.array(self.knots)
        pressed = np.maximum((position @ normals.T - 1.0)[..., None] - starts, 0.0)
        return np.asarray(-(pressed @ np.diff([0.0, *self.slopes])) @ normals)

    @property
    def errors(self) -> RingErrors:
        """Largest errors, measured at depths, angles and impacts."""
        return _errors(self)


def _normals(sides: int) -> Floats:
    angle = 2.0 * np.pi * np.arange(sides) / sides
    return np.column_stack([np.cos(angle), np.sin(angle)])


@lru_cache(maxsize=256)
def ring_table(sides: int, largest: float) -> RingTable:
    """The table of the sides of a ring.

    Parameters
    ----------
    sides : number N of sides, a multiple of 4.
    largest : largest penetration over the clearance.

    Returns
    -------
    RingTable

    Examples
    --------
    >>> table = ring_table(48, 0.05)
    >>> len(table.slopes), bool(abs(table.errors.impulse) < 0.01)
    (3, True)
    """
    from scipy.optimize import lsq_linear

    early, end = EARLY * (1.0 - np.cos(np.pi / sides)), BEYOND * largest
    knots = -early + (end + early) * np.linspace(0.0, 1.0, SLOPES + 1)[:SLOPES] ** 2
    depth, turn = (
        each.ravel()
        for each in np.meshgrid(
            end * np.linspace(0.02, 1.0, FITTED_DEPTHS), np.linspace(0.0, np.pi / sides, FITTED_ANGLES)
        )
    )
    radial = np.column_stack([np.cos(turn), np.sin(turn)])
    tangent = np.column_stack([-radial[:, 1], radial[:, 0]])
    normals, weight = _normals(sides), 1.0 / (depth + WEIGHT * end)
    pressed = ((1.0 + depth)[:, None] * radial) @ normals.T - 1.0
    ends = np.append(knots[1:], np.inf)
    parts = [np.clip(pressed, low, high) - low for low, high in zip(knots, ends, strict=True)]
    sums = np.array([part @ normals for part in parts])  # (slopes, p, 2) force of a unit of each slope
    matrix = np.vstack([np.sum(sums * along, axis=2).T * weight[:, None] for along in (radial, tangent)])
    slopes = lsq_linear(matrix, np.concatenate([depth * weight, np.zeros(depth.size)]), bounds=(0.0, np.inf)).x
    return RingTable(sides, largest, tuple(knots.tolist()), tuple(slopes.tolist()))


def acting_sides(sides: int, largest: float) -> float:
    """Number of sides that act at half of the largest penetration, given over the clearance."""
    early = EARLY * (1.0 - np.cos(np.pi / sides))
    return max(float(np.sqrt(2.0 * (0.5 * largest + early)) * sides / np.pi), 1.0)


@lru_cache(maxsize=256)
def _errors(table: RingTable) -> RingErrors:
    """See `RingTable.errors`."""
    turn, depth = np.meshgrid(np.linspace(0.0, np.pi / table.sides, 9), table.largest * np.linspace(0.1, 1.0, 37))
    radial = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    force = -table.forces((1.0 + depth)[..., None] * radial)
    along, across = np.sum(force * radial, axis=-1), force[..., 1] * radial[..., 0] - force[..., 0] * radial[..., 1]
    off = np.hypot(along - depth, across).max() / table.largest
    angle = np.degrees(np.abs(np.arctan2(across, along)).max())
    return RingErrors(max(-table.knots[0], 0.0), float(off), float(angle), _impulse_error(table))


def _impulse_error(table: RingTable) -> float:
    """Largest error of the impulse of impacts of a mass, over the impulse.

    The impacts reach a third of the largest penetration or all of it, along the normal or at 45 degrees to it, at five
    angles between sides.
    """
    depth, slope, turn = (
        each.ravel()
        for each in np.meshgrid(table.largest * np.array([1.0 / 3.0, 1.0]), [0.0, 1.0], np.arange(5) / table.sides)
    )
    turn = turn * 2.0 * np.pi / 5.0
    radial = np.column_stack([np.cos(turn), np.sin(turn)])
    tangent = np.column_stack([-radial[:, 1], radial[:, 0]])
    velocity = depth[:, None] * (radial + slope[:, None] * tangent)
    start = radial - velocity * (0.1 + max(-table.knots[0], 0.0) / depth.min())

    def exact(position: Floats) -> Floats:
        distance = np.hypot(*position.T)
        return np.asarray(-(np.maximum(distance - 1.0, 0.0) / distance)[:, None] * position)

    duration = np.pi + 4.0 * (0.1 + max(-table.knots[0], 0.0) / depth.min()) + 1.0
    ends = [_velocity_after(force, start, velocity, duration) for force in (table.forces, exact)]
    return float((np.hypot(*(ends[0] - ends[1]).T) / (2.0 * depth)).max())


def _velocity_after(force: Any, position: Floats, velocity: Floats, duration: float) -> Floats:
    """(p, 2) velocities of unit masses after a duration, by the Störmer-Verlet method."""
    position, velocity = position.copy(), velocity.copy()
    acceleration = force(position)
    for _ in range(int(duration / STEP)):
        velocity += 0.5 * STEP * acceleration
        position += STEP * velocity
        acceleration = force(position)
        velocity += 0.5 * STEP * acceleration
    return velocity


@lru_cache(maxsize=1024)
def side_law(sides: int, radius: float, largest: float, stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """The law of a side of a ring.

    Parameters
    ----------
    sides : number of sides.
    radius : radius of curvature of the clearance at the side, m.
    largest : largest penetration, m.
    stiffness, dashpot : of the ring, radial, N/m and N s/m.

    Returns
    -------
    ContactLaw
        Its penetration is zero on the side.
    """
    table = ring_table(sides, largest / radius)
    law = piecewise_linear([radius * x for x in table.knots], [0.0, *(stiffness * s for s in table.slopes)], 0)
    if not dashpot:
        return law
    time = dashpot / stiffness
    phases = tuple(replace(phase, dissipative_force=LawRow(rate=time * phase.stiffness)) for phase in law.phases)
    parts = tuple(replace(part, dashpot=time * part.stiffness) for part in law.one_sided_springs or ())
    return replace(law, phases=phases, one_sided_springs=parts)
