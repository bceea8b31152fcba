r"""Elements of a straight or curved member from the flexibility of its centreline.

A force F and a moment M on the second end of an element cause at a point s the force F and the moment
:math:`M + (r_2 - r(s)) \times F`. With B(s) these six components along the axes of the section, and c the compliance
of the section (extension, two shears, torsion, two bendings), the second end moves by

.. math:: d = \int B^T c\, B \, ds \; (F, M) = A \, (F, M)

relative to the first. The stiffness matrix is :math:`\Gamma A^{-1} \Gamma^T`, where :math:`\Gamma` gives the forces on
both ends that are in equilibrium with (F, M). It is exact for any curve without load between its ends. The integral up
to s gives the motion of the section at s for a unit of each end displacement: shape functions, exact without load,
from which the consistent mass matrix and rows of places follow. On a straight member without shear they are the cubic
Hermite polynomials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from beamsim.dofs import DIRECTIONS
from beamsim.errors import MethodError
from beamsim.scenario.frame import Centreline, FrameSection
from beamsim.typing import Floats, Ints

# Gauss points of an element: exact for polynomials of degree 15, and to 1e-13 for arcs of a quarter circle
_XI, _WEIGHT = (0.5 * each for each in np.polynomial.legendre.leggauss(8))
_XI = _XI + 0.5
MECHANISM = 1e-10  # relative stiffness below which a released end counts as loose


def cross_matrix(vectors: Floats) -> Floats:
    """(..., 3, 3) matrices X with X u = v x u, for vectors v (..., 3)."""
    zero = np.zeros(vectors.shape[:-1])
    x, y, z = np.moveaxis(vectors, -1, 0)
    rows = [np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, axis=-2)


def rigid_transfer(arms: Floats) -> Floats:
    """(..., 6, 6) motion of the end of rigid arms (..., 3) for a unit of each motion of their beginning."""
    transfer = np.zeros((*arms.shape[:-1], 6, 6))
    transfer[...] = np.eye(6)
    transfer[..., :3, 3:] = -cross_matrix(arms)
    return transfer


def points_of(curve: Centreline, s: Floats) -> Floats:
    """(k, 3) points at distances s (k,) along a curve, m."""
    start = np.array(curve.start)
    if curve.centre is None or curve.normal is None:
        return np.asarray(start + np.multiply.outer(s / curve.length, np.array(curve.end) - start))
    centre, normal, angle = np.array(curve.centre), np.array(curve.normal), curve.angle * s / curve.length
    radial = start - centre
    along = np.cross(normal, radial)
    turned = np.multiply.outer(np.cos(angle), radial) + np.multiply.outer(np.sin(angle), along)
    return np.asarray(centre + turned)


def axes_of(curve: Centreline, s: Floats, orientation: Sequence[float] | None) -> Floats:
    """(k, 3, 3) local x, y and z of the sections at distances s (k,), as rows.

    Parameters
    ----------
    curve : centreline of the member.
    s : (k,) m.
    orientation : vector whose part across the member is z; None for the default.
    """
    if curve.centre is None or curve.normal is None:
        tangent = np.tile(np.array(curve.end) - np.array(curve.start), (s.size, 1))
        default = (1.0, 0.0, 0.0) if np.hypot(*tangent[0, :2]) <= 1e-6 * curve.length else (0.0, 0.0, 1.0)
    else:
        tangent, default = np.cross(curve.normal, points_of(curve, s) - np.array(curve.centre)), curve.normal
    tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    y = np.cross(np.array(default if orientation is None else orientation), tangent)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([tangent, y, np.cross(tangent, y)], axis=1)


@dataclass(frozen=True)
class MemberElements:
    """The elements of one member; rows of an element belong to x ... rz of its first, then of its second node."""

    name: str
    curve: Centreline
    section: FrameSection
    orientation: tuple[float, float, float] | None
    flexibility_factor: float
    mass_per_length: float  # kg/m
    bounds: Floats  # (n + 1,) m, ends of the elements along the curve
    arms: tuple[tuple[float, float, float], tuple[float, float, float]]  # m, from the nodes to the ends
    released: tuple[tuple[str, ...], tuple[str, ...]]  # local directions at the first and second end

    @property
    def count(self) -> int:
        """Number of elements."""
        return int(self.bounds.size - 1)

    @cached_property
    def compliance(self) -> Floats:
        """(6,) compliance of the section for forces along and moments about x, y and z."""
        of, shears = self.section.spatial, self.section.theory == "timoshenko"
        modulus, shear_modulus, factor = (
            self.section.youngs_modulus,
            self.section.shear_modulus,
            self.flexibility_factor,
        )
        shear = [1.0 / (shear_modulus * area) if shears else 0.0 for area in (of.shear_area_y, of.shear_area_z)]
        bending = [factor / (modulus * moment) for moment in (of.second_moment_y, of.second_moment_z)]
        return np.array([1.0 / (modulus * of.area), *shear, 1.0 / (shear_modulus * of.torsion_constant), *bending])

    @cached_property
    def inertia(self) -> Floats:
        """(6,) mass per length, and mass moments of inertia per length about x, y and z."""
        of, density = self.section.spatial, self.section.density
        about = [of.second_moment_y, of.second_moment_z] if self.section.theory == "timoshenko" else [0.0, 0.0]
        rotary = density * np.array([of.second_moment_y + of.second_moment_z, *about])
        return np.concatenate([np.full(3, self.mass_per_length), rotary])

    def points(self, s: Floats) -> Floats:
        """(k, 3) points at distances s (k,) along the centreline, m."""
        return points_of(self.curve, s)

    def axes(self, s: Floats) -> Floats:
        """(k, 3, 3) local x, y and z at distances s (k,), as rows."""
        return axes_of(self.curve, s, self.orientation)

    def locate(self, s: Floats) -> Ints:
        """(k,) element in which each distance (k,) lies."""
        return np.clip(np.searchsorted(self.bounds, s, side="right") - 1, 0, self.count - 1)

    def _section_forces(self, at: Floats, loaded: Floats) -> Floats:
        """(k, 6, 6) local forces and moments at distances (k,) for a unit load at other distances (k,)."""
        axes = self.axes(at)
        rows = np.zeros((at.size, 6, 6))
        rows[:, :3, :3] = rows[:, 3:, 3:] = axes
        rows[:, 3:, :3] = axes @ cross_matrix(self.points(loaded) - self.points(at))
        return rows

    def _flexibility(self, first: Floats, last: Floats, loaded: Floats) -> Floats:
        """(k, 6, 6) motion of the second of two points (k,) for a unit load at a third, with the first at rest."""
        s = first[:, None] + np.multiply.outer(last - first, _XI)
        of_motion, of_load = (
            self._section_forces(s.ravel(), np.repeat(end, _XI.size)).reshape(*s.shape, 6, 6) for end in (last, loaded)
        )
        weight = np.multiply.outer(last - first, _WEIGHT)
        return np.asarray(np.einsum("kgia,i,kgib,kg->kab", of_motion, self.compliance, of_load, weight, optimize=True))

    @cached_property
    def _equilibrium(self) -> Floats:
        """(n, 12, 6) forces on both ends for a unit load on the second."""
        ends = self.points(self.bounds)
        transfer = rigid_transfer(ends[1:] - ends[:-1])
        return np.concatenate([-transfer.swapaxes(1, 2), np.tile(np.eye(6), (self.count, 1, 1))], axis=1)

    @cached_property
    def _forces(self) -> Floats:
        """(n, 6, 12) load on the second end for a unit of each motion of both ends."""
        a = self._flexibility(self.bounds[:-1], self.bounds[1:], self.bounds[1:])
        size = np.ones((self.count, 6))
        size[:, 3:] = np.diff(self.bounds)[:, None]  # moments over lengths: entries of one magnitude
        inner = np.linalg.inv(a * (size[:, :, None] * size[:, None, :]))
        stiffness = inner * (size[:, :, None] * size[:, None, :])
        return np.asarray(stiffness @ self._equilibrium.swapaxes(1, 2))

    @cached_property
    def ends(self) -> Floats:
        """(n, 12, 12) motion of the ends of the elements for a unit of each motion of their nodes.

        It contains rigid arms, and released ends, which follow without force.

        Raises
        ------
        MethodError
            About ``releases``: the member could move without force.
        """
        motion = np.tile(np.eye(12), (self.count, 1, 1))
        motion[0] = self._released_motion(0) @ motion[0]
        if self.count > 1:
            motion[-1] = self._released_motion(self.count - 1)
        arms = np.zeros((self.count, 2, 3))
        arms[0, 0], arms[-1, 1] = self.arms
        for end in (0, 1):
            part = slice(6 * end, 6 * end + 6)
            motion[:, :, part] = motion[:, :, part] @ rigid_transfer(arms[:, end])
        return motion

    def _released_motion(self, element: int) -> Floats:
        """(12, 12) motion of both ends of an element with the released directions of the member's ends."""
        first = self.released[0] if element == 0 else ()
        last = self.released[1] if element == self.count - 1 else ()
        loose = [DIRECTIONS.index(each) for each in first] + [6 + DIRECTIONS.index(each) for each in last]
        if not loose:
            return np.eye(12)
        local = np.zeros((12, 12))
        for k, axes in enumerate(np.repeat(self.axes(self.bounds[element : element + 2]), 2, axis=0)):
            local[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = axes
        stiffness = local @ self._equilibrium[element] @ self._forces[element] @ local.T
        rest = np.setdiff1d(np.arange(12), loose)
        inner = stiffness[np.ix_(loose, loose)]
        size = np.sqrt(np.diag(inner))
        if np.linalg.eigvalsh(inner / np.outer(size, size))[0] < MECHANISM:
            raise MethodError(
                f"members.{self.name}.releases", "leave the member loose: it can move without force",
                "release fewer directions",
            )  # fmt: skip
        follow = np.eye(12)
        follow[loose] = 0.0
        follow[np.ix_(loose, rest)] = -np.linalg.solve(inner, stiffness[np.ix_(loose, rest)])
        return np.asarray(local.T @ follow @ local)

    @property
    def stiffness(self) -> Floats:
        """(n, 12, 12) stiffness matrices."""
        forces = self._forces @ self.ends
        whole = np.einsum("eji,ejk->eik", self._equilibrium.swapaxes(1, 2) @ self.ends, forces)
        return np.asarray(0.5 * (whole + whole.swapaxes(1, 2)))

    @property
    def mass(self) -> Floats:
        """(n, 12, 12) consistent mass matrices."""
        length = np.diff(self.bounds)
        s = self.bounds[:-1, None] + np.multiply.outer(length, _XI)
        shapes = self.shapes(s.ravel()).reshape(*s.shape, 6, 12)
        axes = self.axes(s.ravel()).reshape(*s.shape, 3, 3)
        local = np.concatenate([axes @ shapes[:, :, :3], axes @ shapes[:, :, 3:]], axis=2)
        weight = np.multiply.outer(length, _WEIGHT)
        return np.asarray(np.einsum("egia,i,egib,eg->eab", local, self.inertia, local, weight, optimize=True))

    def shapes(self, s: Floats) -> Floats:
        """(k, 6, 12) displacements and rotations at distances s (k,) for a unit of each motion of the nodes."""
        e = self.locate(s)
        first = self.bounds[e]
        arm = self.points(s) - self.points(first)
        shapes = self._flexibility(first, s, self.bounds[e + 1]) @ self._forces[e]
        shapes[:, :, :6] += rigid_transfer(arm)
        return np.asarray(shapes @ self.ends[e])

    def forces(self, s: Floats) -> Floats:
        """(k, 6, 12) local forces and moments at distances s (k,) for a unit of each motion of the nodes."""
        e = self.locate(s)
        return np.asarray(self._section_forces(s, self.bounds[e + 1]) @ self._forces[e] @ self.ends[e])
