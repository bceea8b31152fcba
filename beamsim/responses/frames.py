"""Deflected shapes at chosen instants of a motion, for animations: slow around contact, with the shape functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from beamsim.responses.histories import between_samples
from beamsim.scenario import Scenario
from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import ON_PLATE, BodyStations, Place, Site, Stations, ends_of
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Bools, Floats, Ints

PLATE_LINES, PLATE_POINTS = 5, 33
FRAMES = 160
CYCLES_SHOWN = 3.0
SLOWER = 6.0  # around contact
MARGIN = 0.03  # of a period, before and after contact, in slow motion as well


@dataclass(frozen=True)
class DrawnLine:
    """A line of a body: a beam, a line across a plate, a row of masses."""

    body: str
    x: Floats  # (k,) in the body's coordinate
    y: Floats | None  # (k,) m, y on a plate
    continuous: bool
    stations: Ints | None = None  # (k,) where it is not finer than these

    @property
    def places(self) -> list[Place]:
        """Places of the points of the line."""
        if self.y is None:
            return [Place(self.body, float(x)) for x in self.x]
        return [Place(self.body, (float(x), float(y))) for x, y in zip(self.x, self.y, strict=True)]


@dataclass(frozen=True)
class Frames:
    """A motion at chosen instants."""

    lines: tuple[DrawnLine, ...]
    time: Floats  # (nf,) s
    in_slow_motion: Bools  # (nf,)
    deflection: Floats  # (nf, points of all lines) m, relative to the base
    ends: Mapping[str, Floats]  # by stop (nf, 1 or 2) m, deflection of the places that it acts on
    force: Mapping[str, Floats]  # by stop (nf,) N, positive when it pushes
    opening: Mapping[str, Floats]  # by stop (nf,) m, distance to its face as it is then; 0 while it touches or is held
    # largest difference between frames from a cubic through them, over the largest deflection
    difference_between: float = 0.0
    in_space: Floats | None = None  # (nf, points of all lines, 3) m, displacements; None where they are not known


def between_frames(times: Floats) -> Floats:
    """(nf - 1,) s, a time between each two of the instants (nf,) of frames, see `between_samples`."""
    return between_samples(times)[1::2]


def frames_at(
    system: StructuralSystem, instants: tuple[Floats, Bools], q: Floats, forces: Floats, openings: Floats,
    between_values: Floats | None = None,
) -> Frames:  # fmt: skip
    """Frames of known coordinates.

    Parameters
    ----------
    system : whose motion is shown.
    instants : (nf,) s, and whether each is slow.
    q : (nf, n) coordinates of the model.
    forces : (nf, snubbers) N.
    openings : (nf, snubbers) m, distances to the faces as they are at each instant.
    between_values : (nf - 1, n) coordinates at `between_frames`, where they are known.

    Returns
    -------
    Frames
    """
    (times, slow), scenario, model = instants, system.scenario, system.model
    lines = tuple(line for part in system.stations.bodies for line in _lines_of(system.stations, part, scenario))
    sites = {located.item.name: snubber_site(located) for located in scenario.located_snubbers}
    of_lines = [model.shapes(x.places) if x.stations is None else system.deflection[x.stations] for x in lines]
    at_stops = model.shapes([end for site in sites.values() for end in ends_of(site)])
    force, opening = ({name: of[:, k] for k, name in enumerate(sites)} for of in (forces, openings))
    stations = [place for body in system.bodies for place in body.places]
    places = [
        place
        for line in lines
        for place in (line.places if line.stations is None else [stations[number] for number in line.stations])
    ]
    deflection = q @ np.vstack(of_lines).T + system.with_supports(places, times)
    missed = 0.0
    if between_values is not None:
        there = between_values @ np.vstack(of_lines).T + system.with_supports(places, between_frames(times))
        missed = _largest_difference(times, deflection, there)
    ends = values_by_stop(sites, q @ at_stops.T)
    return Frames(lines, times, slow, deflection, ends, force, opening, missed, _in_space(system, lines, q))


def _in_space(system: StructuralSystem, lines: Sequence[DrawnLine], q: Floats) -> Floats | None:
    """(nf, points, 3) m, displacements of the points of lines for coordinates (nf, n); None if they are not known."""
    numbers, shapes = [line.stations for line in lines if line.stations is not None], system.stations.in_space
    if shapes is None or system.model.moving_supports or len(numbers) < len(lines) or not np.isfinite(shapes).all():
        return None
    return np.asarray(np.einsum("pcn,fn->fpc", shapes[np.concatenate(numbers)], q))


def _largest_difference(times: Floats, deflection: Floats, between_values: Floats) -> float:
    """Largest difference of deflections between frames from cubics through the frames, over the largest deflection."""
    from scipy.interpolate import CubicSpline

    different = np.append(np.diff(times) > 0.0, True)
    if np.count_nonzero(different) < 4 or not deflection.any():
        return 0.0
    expected = CubicSpline(times[different], deflection[different])(between_frames(times))
    return float(np.abs(between_values - expected).max() / np.abs(deflection).max())


def paced_by_contact(time: Floats, forces: Floats) -> tuple[Floats, Bools]:
    """Instants between the first and the last time at which frames are shown, slow around contact, and which are slow.

    Parameters
    ----------
    time : (nt,) s.
    forces : (nt, snubbers) N there.
    """
    closed = np.any(forces > 0.0, axis=1)
    intervals = list(_intervals(time, closed)) if closed.any() else []
    return frame_times(float(time[0]), float(time[-1]), intervals, MARGIN * float(time[-1] - time[0]))


def values_by_stop(sites: Mapping[str, Site], values: Floats) -> dict[str, Floats]:
    """By stop the values (nf, 1 or 2) of the places that it acts on, from those of all (nf, places)."""
    last = np.cumsum([len(ends_of(site)) for site in sites.values()])
    return dict(zip(sites, np.split(values, last[:-1], axis=1), strict=False))  # of no stop one empty part


def _intervals(time: Floats, in_contact: Bools) -> Sequence[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], in_contact, [False]]).astype(int)))
    return [(float(time[a]), float(time[min(b, time.size - 1)])) for a, b in edges.reshape(-1, 2)]


def frame_times(
    first: float, last: float, contacts: Sequence[tuple[float, float]], margin: float
) -> tuple[Floats, Bools]:
    """`FRAMES` instants, `SLOWER` times as dense around contacts."""
    fine = np.linspace(first, last, 20 * FRAMES)
    slow = np.zeros(fine.size, dtype=bool)
    for begin, end in contacts:
        slow |= (fine >= begin - margin) & (fine <= end + margin)
    if np.all(slow):
        slow[:] = False
    shown = np.concatenate([[0.0], np.cumsum(np.where(slow, SLOWER, 1.0)[1:])])
    times = np.interp(np.linspace(0.0, shown[-1], FRAMES), shown, fine)
    return times, slow[np.clip(np.searchsorted(fine, times), 0, fine.size - 1)]


def _lines_of(stations: Stations, part: BodyStations, scenario: Scenario) -> list[DrawnLine]:
    bodies = list(scenario.all_bodies)
    name = part.body if part.body in bodies else bodies[0]  # one alone is called after its axis
    x = stations.position[part.stations]
    if part.axis is ON_PLATE and stations.position_y is not None:
        y = stations.position_y[part.stations]
        across, along = np.linspace(y.min(), y.max(), PLATE_LINES), np.linspace(x.min(), x.max(), PLATE_LINES)
        fine_x, fine_y = np.linspace(x.min(), x.max(), PLATE_POINTS), np.linspace(y.min(), y.max(), PLATE_POINTS)
        return [
            *(DrawnLine(name, fine_x, np.full(PLATE_POINTS, each), True) for each in across),
            *(DrawnLine(name, np.full(PLATE_POINTS, each), fine_y, True) for each in along),
        ]
    if part.axis.continuous:
        # 81: along a beam; its elements are cubic
        return [DrawnLine(name, np.linspace(x.min(), x.max(), 81), None, True)]
    return [
        DrawnLine(name, stations.position[numbers], None, False, numbers) for numbers in lines_of_nodes(stations, part)
    ]


def lines_of_nodes(stations: Stations, part: BodyStations) -> list[Ints]:
    """Stations of each line: one line in order; for nodes in space one line per element edge, and single nodes."""
    numbers = np.arange(part.stations.start, part.stations.stop)
    if stations.points is None or not np.all(np.isfinite(stations.points[part.stations])):
        return [numbers]
    edges = [] if stations.lines is None else list(stations.lines[np.isin(stations.lines[:, 0], numbers)])
    return [*edges, *np.setdiff1d(numbers, np.concatenate(edges) if edges else [])[:, None]]
