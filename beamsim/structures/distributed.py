r"""Loads spread over a part of a body: their work on its motion, by Gauss quadrature.

A load of the intensity :math:`A\,p(x)` has the consistent load vector :math:`A \int p\, N^T dx`. Quadrature points lie
between the nodes of the mesh, the ends of the loaded part and the corners of tables, and are as many as make the
integral exact for polynomial shapes. Each stands for a point force, from which bending moments are recovered.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beamsim.typing import Floats

_HERMITE = 3  # degree of the shape functions


@dataclass(frozen=True)
class Distributed:
    """A load of unit level on a part of a body; its row is the work of that load on a unit of each dof."""

    body: str
    shape: Any  # section of the scenario: see `beamsim.scenario.distributed`
    bounds: tuple[tuple[float, float], ...] | None  # m, along x, and along y on a plate; None for the whole body
    label: str = field(default="", compare=False)  # for people

    @property
    def mode(self) -> int | None:
        """Number of the body's mode that gives the shape; None for other shapes."""
        return self.shape.mode if self.shape.kind == "mode" else None

    def quadrature(self, sizes: Sequence[float] | Floats, cuts: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Points (k, d) in m and weights (k,) in m or m^2 of an integral over the loaded part.

        Parameters
        ----------
        sizes : length of the body in each direction, m.
        cuts : in each direction positions, m, between which the integrand is smooth.
        """
        bounds = self.bounds or tuple((0.0, size) for size in sizes)
        lines = []
        for axis, ((first, last), cut) in enumerate(zip(bounds, cuts, strict=True)):
            corners = (self.shape.x, self.shape.y)[axis] if self.shape.kind == "table" else ()
            inner = np.concatenate([cut, np.asarray(corners, dtype=float)])
            ends = np.unique(np.concatenate([[first, last], inner[(inner > first) & (inner < last)]]))
            ends = ends[np.concatenate([[True], np.diff(ends) > 1e-12 * (last - first)])]
            place, weight = np.polynomial.legendre.leggauss(self._points(axis))
            half = np.diff(ends)[:, None] / 2
            lines.append(((ends[:-1, None] + half * (place + 1)).ravel(), (half * weight).ravel()))
        grids = np.meshgrid(*(x for x, _ in lines), indexing="ij")
        weights = lines[0][1] if len(lines) == 1 else np.outer(lines[0][1], lines[1][1]).ravel()
        return np.column_stack([grid.ravel() for grid in grids]), weights

    def intensity(
        self, points: Floats, sizes: Sequence[float] | Floats, mode_at: Callable[[int, Floats], Floats]
    ) -> Floats:
        """(k,) factor of the level at points (k, d) of the loaded part, m; ``mode_at`` gives the body's mode there.

        Parameters
        ----------
        points : (k, d) of the loaded part, m.
        sizes : (d,) sides of the body, m.
        mode_at : the deflection of a mode, by its number, at points (k, d).

        Returns
        -------
        (k,) array
            Level there over that of the load.
        """
        if self.mode is not None:
            return mode_at(self.mode, points)
        bounds = self.bounds or tuple((0.0, size) for size in sizes)
        share = np.array([(points[:, i] - a) / (b - a) for i, (a, b) in enumerate(bounds)])
        shape = self.shape
        if shape.kind == "uniform":
            return np.ones(points.shape[0])
        if shape.kind == "sine":
            return np.asarray(np.prod(np.sin(np.pi * np.array(shape.half_waves)[:, None] * share), axis=0))
        if shape.kind == "table":
            return _interpolated(shape, points)
        table = np.array(shape.coefficients if shape.kind == "polynomial" else shape.values, dtype=float)
        if shape.kind == "linear":  # values at the ends to coefficients of 1 and the share
            change = np.array([[1.0, 0.0], [-1.0, 1.0]])
            table = change @ table if table.ndim == 1 else change @ table @ change.T
        if table.ndim == 1:
            return np.asarray(np.polynomial.polynomial.polyval(share[0], table))
        return np.asarray(np.polynomial.polynomial.polyval2d(share[0], share[1], table))

    def _points(self, axis: int) -> int:
        """Gauss points a piece that integrate the shape times a shape function exactly."""
        shape = self.shape
        if shape.kind == "sine":
            # exact to round-off below one half wave a piece
            return 12
        degree = {"uniform": 0, "linear": 1, "table": 1, "mode": _HERMITE}.get(shape.kind)
        if degree is None:
            degree = np.array(shape.coefficients).shape[axis] - 1
        return (degree + _HERMITE) // 2 + 1


def _interpolated(table: Any, points: Floats) -> Floats:
    """(k,) values of a table at points (k, d), linear in each direction, zero outside."""
    from scipy.interpolate import RegularGridInterpolator

    axes = [np.array(table.x)] if table.y is None else [np.array(table.x), np.array(table.y)]
    values = RegularGridInterpolator(axes, np.array(table.values, dtype=float), bounds_error=False, fill_value=0.0)
    return np.asarray(values(points), dtype=float)
