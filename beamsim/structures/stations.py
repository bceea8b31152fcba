"""Stations: where along the bodies of a structure shapes are known, and how they are drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from beamsim.fields import Counter, attribute, axis, dataset, declared
from beamsim.structures.places import DEFLECTION, Place
from beamsim.typing import Floats, Ints


@dataclass(frozen=True)
class StationAxis:
    """What the coordinate of a body's stations is, for files and plots."""

    body: str  # what a body alone is called
    long_name: str
    unit: str
    label: str
    continuous: bool  # drawn as a line through the stations, else as a dot at each


ALONG = StationAxis("beam", "position along the beam", "m", "Position", continuous=True)
IN_PLANE = StationAxis("plate", "position on the plate from its left edge", "m", "x", continuous=True)
MASSES = StationAxis("chain", "mass number", "1", "Mass", continuous=False)
NODES = StationAxis("matrices", "node number", "1", "Node", continuous=False)
AXES = {axis.long_name: axis for axis in (ALONG, IN_PLANE, MASSES, NODES)}


@dataclass(frozen=True)
class StationPart:
    """The stations of one body."""

    body: str
    axis: StationAxis
    stations: slice


@declared(along=("position",))
class Stations:
    """The stations of all bodies, body after body."""

    position: Floats = axis("{unit}", "{meaning}")  # (nx,) on each body's own axis
    unit: str = attribute("", "m along a beam, 1 where masses are numbered", name="position_unit")
    meaning: str = attribute("", "what the position is", name="position_meaning")
    # of several bodies only
    body: Ints | None = dataset("1", "number of the body, from 0", name="body_number", default=None)
    names: tuple[str, ...] | None = attribute("", "names of the bodies", name="position_bodies", default=None)
    axes: tuple[str, ...] | None = attribute("", "what the position is on each", name="position_axes", default=None)
    # where a body is a plate
    across: Floats | None = dataset(
        "m", "position on the plate from its bottom edge; NaN on other bodies", default=None
    )
    # where the table of an imported body gives them
    points: Floats | None = dataset(
        "m", "place of the nodes of imported bodies, NaN where they have none; NaN on other bodies",
        along=("position", Counter("direction", "coordinate of the place", labels=("x", "y", "z"))), default=None,
    )  # fmt: skip

    # where also the stiffness of an imported body tells what is joined
    lines: Ints | None = dataset(
        "1", "stations, from 0, between which lines are drawn: their nodes belong to one element",
        along=(Counter("drawn_line", "number of the line"), Counter("end", "end of the line")), default=None,
    )  # fmt: skip

    @classmethod
    def of_recoveries(cls, bodies: Sequence[Recovery]) -> Stations:
        """Those of each body; of none none."""
        if len(bodies) > 1:
            return cls._of_several(bodies)
        if not bodies:
            return cls(np.zeros(0), ALONG.unit, ALONG.long_name)
        (one,) = bodies
        named = one.position, one.axis.unit, one.axis.long_name
        return cls(*named, across=one.across, points=one.points, lines=one.lines)

    @classmethod
    def _of_several(cls, bodies: Sequence[Recovery]) -> Stations:
        position = np.concatenate([each.position for each in bodies])
        across = _together([each.across for each in bodies], bodies, ())
        points = _together([each.points for each in bodies], bodies, (3,))
        axes = tuple(each.axis for each in bodies)
        first = np.cumsum([0, *(each.position.size for each in bodies)])
        known = [start + each.lines for start, each in zip(first, bodies, strict=False) if each.lines is not None]
        lines = np.concatenate(known) if known else None
        same = len(set(axes)) == 1
        unit, meaning = (axes[0].unit, axes[0].long_name) if same else ("1", "position on the axis of each body")
        body = np.repeat(np.arange(len(bodies)), [each.position.size for each in bodies])
        names = tuple(each.body for each in bodies)
        return cls(position, unit, meaning, body, names, tuple(axis.long_name for axis in axes), across, points, lines)

    @cached_property
    def parts(self) -> tuple[StationPart, ...]:
        """The bodies; one alone is called after its axis."""
        if self.body is None or self.names is None or self.axes is None:
            only = AXES[self.meaning]
            return (StationPart(only.body, only, slice(0, self.position.size)),)
        ends = np.cumsum(np.bincount(self.body, minlength=len(self.names))).tolist()
        return tuple(
            StationPart(name, AXES[meaning], slice(start, end))
            for name, meaning, start, end in zip(self.names, self.axes, [0, *ends], ends, strict=False)
        )

    @property
    def axis(self) -> StationAxis:
        """That of the first body."""
        return self.parts[0].axis

    def name(self, station: int) -> str:
        """For people: 135 mm, (135, 60) mm, mass 2, and of several bodies inner 135 mm."""
        part = next(part for part in self.parts if part.stations.start <= station < part.stations.stop)
        x, y = self.position[station], np.nan if self.across is None else self.across[station]
        if np.isfinite(y):
            name = f"({1e3 * x:.3g}, {1e3 * y:.3g}) mm"
        else:
            name = f"{1e3 * x:.3g} mm" if part.axis.continuous else f"{part.axis.label.lower()} {x:g}"
        return f"{part.body} {name}" if len(self.parts) > 1 else name

    def __iter__(self) -> Iterator[StationPart]:
        return iter(self.parts)


def _together(values: Sequence[Floats | None], bodies: Sequence[Recovery], shape: tuple[int, ...]) -> Floats | None:
    """The values of all bodies, NaN where one has none; None where no body has any."""
    if all(each is None for each in values):
        return None
    nowhere = (np.full((body.position.size, *shape), np.nan) for body in bodies)
    return np.concatenate([none if each is None else each for each, none in zip(values, nowhere, strict=True)])


COMPONENTS = ("x", "y", "xy")
"""Of the moments, stresses and strains of a plate."""


@dataclass(frozen=True)
class Recovery:
    """Deflection along a body, and its bending moment where it bends, for a unit of each coordinate.

    A plate has three moments per width, Mx, My and Mxy: all stations of one, then those of the next.
    """

    body: str
    axis: StationAxis
    position: Floats  # (nx,) on the axis
    deflection: Floats  # (nx, n) 1/sqrt(kg)
    # (moments nx, n) N m, of a plate N; E I w'', positive where the top is in compression
    bending_moment: Floats | None = None
    stress_per_moment: Floats | None = None  # (moments nx,) extreme_fibre / I, Pa per N m; None where no fibre is known
    strain_per_moment: Floats | None = None  # (nx,) extreme_fibre / (E I), 1/(N m), of a beam
    # of a plate (3, 3) strains x, y, xy of the lower surface for Mx, My, Mxy, 1/N
    strains_per_moments: Floats | None = None
    # (moments nx,) of base_moment: per m/s^2 of base acceleration, the static share of the modes left out
    base_moment: Floats | None = None
    across: Floats | None = None  # (nx,) m, y on a plate
    points: Floats | None = None  # (nx, 3) m, of nodes whose table has coordinates; NaN where it has none
    lines: Ints | None = None  # (k, 2) stations whose nodes belong to one element
    moments: int = 1  # at a station
    direction: str = DEFLECTION

    @property
    def places(self) -> list[Place]:
        """The stations."""
        if self.across is None:
            return [Place(self.body, float(x), self.direction) for x in self.position]
        return [Place(self.body, (float(x), float(y))) for x, y in zip(self.position, self.across, strict=True)]

    def moment_weights(self, x: float, y: float | None, component: str) -> Floats:
        """(moments nx,) weights of moments at a point: 1 at a beam's station, linear between the nodes of a plate.

        Parameters
        ----------
        x, y : m, the point; y None but on a plate.
        component : of a plate x, y or xy.

        Returns
        -------
        (moments nx,) array
            Their products with moments sum to the one there.
        """
        if self.across is None or y is None:
            return np.asarray(np.arange(self.position.size) == np.abs(self.position - x).argmin(), dtype=float)
        along = _linear(self.position, x) * _linear(self.across, y)
        return np.concatenate([along if each == component else np.zeros(along.size) for each in COMPONENTS])

    def strain_weights(self, x: float, y: float | None, component: str) -> Floats:
        """(moments nx,) strain of the lower surface at a point for each moment.

        Parameters
        ----------
        x, y, component : see `moment_weights`.

        Returns
        -------
        (moments nx,) array
            1/(N m), on a plate 1/N.
        """
        if self.strains_per_moments is None:
            assert self.strain_per_moment is not None
            return self.moment_weights(x, y, component) * self.strain_per_moment
        row = self.strains_per_moments[COMPONENTS.index(component)]
        return np.asarray(sum(s * self.moment_weights(x, y, each) for s, each in zip(row, COMPONENTS, strict=True)))

    @property
    def of_moments(self) -> Recovery:
        """The same with a station for each moment."""
        if self.moments == 1:
            return self
        across = None if self.across is None else np.tile(self.across, self.moments)
        return replace(self, position=np.tile(self.position, self.moments), across=across, moments=1)


def _linear(nodes: Floats, at: float) -> Floats:
    """(nx,) weights of nodes whose values are interpolated, in one direction of a grid."""
    lines = np.unique(nodes)
    i = int(np.clip(np.searchsorted(lines, at), 1, lines.size - 1))
    share = float(np.clip((at - lines[i - 1]) / (lines[i] - lines[i - 1]), 0.0, 1.0))
    return np.where(nodes == lines[i - 1], 1.0 - share, np.where(nodes == lines[i], share, 0.0))


@dataclass(frozen=True)
class StressRows:
    """Bending stress at the extreme fibre of every body whose section is known, station by station.

    On a plate sigma_x at all stations, then sigma_y, then tau_xy.
    """

    stations: Stations
    row: Floats  # (nx, n) Pa for a unit of each coordinate
    base: Floats  # (nx,) Pa per m/s^2 of base acceleration
    bodies: tuple[str, ...]  # (nx,) name of each station's body


def stress_rows(recoveries: Sequence[Recovery]) -> StressRows | None:
    """The stresses of all bodies; None where no body gives one."""
    rows, base, bodies = [], [], []
    for recovery in recoveries:
        if recovery.bending_moment is not None and recovery.stress_per_moment is not None:
            assert recovery.base_moment is not None
            rows.append(recovery.stress_per_moment[:, None] * recovery.bending_moment)
            base.append(recovery.stress_per_moment * recovery.base_moment)
            bodies.append(recovery.of_moments)
    if not rows:
        return None
    names = tuple(each.body for each in bodies for _ in each.position)
    return StressRows(Stations.of_recoveries(bodies), np.vstack(rows), np.concatenate(base), names)
