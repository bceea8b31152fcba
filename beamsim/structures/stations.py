"""Stations: where along the bodies of a structure shapes are known, and how they are drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from beamsim.fields import attribute, axis, dataset, declared
from beamsim.typing import Floats, Ints


@dataclass(frozen=True)
class StationAxis:
    """What the coordinate of a body's stations is, for files and plots."""

    long_name: str
    unit: str
    label: str
    continuous: bool  # drawn as a line through the stations, else as a dot at each


ALONG = StationAxis("position along the beam", "m", "Position", continuous=True)
MASSES = StationAxis("mass number", "1", "Mass", continuous=False)
AXES = {axis.long_name: axis for axis in (ALONG, MASSES)}


@dataclass(frozen=True)
class StationPart:
    """The stations of one body."""

    body: str
    axis: StationAxis
    stations: slice

    def station_name(self, coordinate: float) -> str:
        """For people: 135 mm, or mass 2."""
        return f"{1e3 * coordinate:.3g} mm" if self.axis.continuous else f"mass {coordinate:g}"


@declared
class Stations:
    """The stations of all bodies, body after body."""

    position: Floats = axis("{unit}", "{meaning}")  # (nx,) on each body's own axis
    unit: str = attribute("", "m along a beam, 1 where masses are numbered", name="units", at="position")
    meaning: str = attribute("", "what the position is", name="long_name", at="position")
    # of several bodies only
    body: Ints | None = dataset("1", "number of the body, from 0, as in names", along=("position",), default=None)
    names: tuple[str, ...] | None = attribute("", "names of the bodies", at="body", default=None)
    axes: tuple[str, ...] | None = attribute("", "what the position is on each", at="body", default=None)

    @classmethod
    def of(cls, bodies: Sequence[tuple[str, StationAxis, Floats]]) -> Stations:
        """From name, axis and positions of each body; of none there are no stations."""
        if not bodies:
            return cls(np.zeros(0), ALONG.unit, ALONG.long_name)
        names, axes = tuple(name for name, _, _ in bodies), tuple(axis for _, axis, _ in bodies)
        position = np.concatenate([positions for _, _, positions in bodies])
        if len(bodies) == 1:
            return cls(position, axes[0].unit, axes[0].long_name)
        same = len(set(axes)) == 1
        unit, meaning = (axes[0].unit, axes[0].long_name) if same else ("1", "position on the axis of each body")
        body = np.repeat(np.arange(len(bodies)), [positions.size for _, _, positions in bodies])
        return cls(position, unit, meaning, body, names, tuple(axis.long_name for axis in axes))

    @cached_property
    def parts(self) -> tuple[StationPart, ...]:
        """The bodies; one alone is called after its axis."""
        if self.body is None or self.names is None or self.axes is None:
            only = AXES[self.meaning]
            return (StationPart("beam" if only.continuous else "chain", only, slice(0, self.position.size)),)
        ends = np.cumsum(np.bincount(self.body, minlength=len(self.names))).tolist()
        return tuple(
            StationPart(name, AXES[meaning], slice(start, end))
            for name, meaning, start, end in zip(self.names, self.axes, [0, *ends], ends, strict=False)
        )

    @property
    def axis(self) -> StationAxis:
        """That of the first body."""
        return self.parts[0].axis

    def part_of(self, station: int) -> StationPart:
        """The body's part that holds a station."""
        return next(part for part in self.parts if part.stations.start <= station < part.stations.stop)

    def name(self, station: int) -> str:
        """For people: 135 mm, mass 2, and of several bodies inner 135 mm."""
        part = self.part_of(station)
        name = part.station_name(float(self.position[station]))
        return f"{part.body} {name}" if len(self.parts) > 1 else name

    def __iter__(self) -> Iterator[StationPart]:
        return iter(self.parts)


@dataclass(frozen=True)
class Recovery:
    """Deflection along a body, and its bending moment where it bends, for a unit of each coordinate."""

    body: str
    axis: StationAxis
    position: Floats  # (nx,) on the axis
    deflection: Floats  # (nx, n) 1/sqrt(kg)
    bending_moment: Floats | None = None  # (nx, n) N m; E I w'', positive where the beam's top is in compression
    stress_per_moment: Floats | None = None  # (nx,) extreme_fibre / I, Pa per N m; None where no fibre is known
    base_moment: Floats | None = None  # (nx,) N m per m/s^2 of base acceleration: static share of the modes left out


@dataclass(frozen=True)
class StressRows:
    """Bending stress at the extreme fibre of every body whose section is known, station by station."""

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
            bodies.append((recovery.body, recovery.axis, recovery.position))
    if not rows:
        return None
    names = tuple(name for name, _, positions in bodies for _ in positions)
    return StressRows(Stations.of(bodies), np.vstack(rows), np.concatenate(base), names)
