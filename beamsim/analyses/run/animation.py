"""Deflected shapes at chosen instants of a motion, for animations: slow around contact, with the true shape functions.

The motion of a run is computed again from the scenario up to the last instant shown, which gives the same motion; a
periodic motion is in its result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from beamsim.analyses.run.analysis import built_at_orbit, motion_of
from beamsim.analyses.run.motion import Needed
from beamsim.analyses.run.result import RunResult
from beamsim.flow.reference import ReferenceTrajectory
from beamsim.labelled import Dataset
from beamsim.outcomes import Progress, never
from beamsim.responses.histories import between_samples
from beamsim.results.values import FORCE, OPENING
from beamsim.scenario import Scenario
from beamsim.scenario.run import OrbitStart
from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import IN_PLANE, Place, Site, StationPart, Stations, ends_of
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds
from beamsim.system.structural import SnubberNumbers, StructuralSystem
from beamsim.typing import Bools, Floats, Ints, not_none, of_kind

PLATE_LINES, PLATE_POINTS = 5, 33
FRAMES = 160
CYCLES_SHOWN = 3.0
SLOWER = 6.0  # around contact
MARGIN = 0.03  # of a period, before and after contact, that is slow too


@dataclass(frozen=True)
class DrawnLine:
    """A line of a body: a beam, a line across a plate, a row of masses."""

    body: str
    x: Floats  # (k,) in the body's coordinate
    across: Floats | None  # (k,) m, y on a plate
    continuous: bool
    stations: Ints | None = None  # (k,) where it is not finer than these

    @property
    def places(self) -> list[Place]:
        """Its points."""
        if self.across is None:
            return [Place(self.body, float(x)) for x in self.x]
        return [Place(self.body, (float(x), float(y))) for x, y in zip(self.x, self.across, strict=True)]


@dataclass(frozen=True)
class Frames:
    """A motion at chosen instants."""

    lines: tuple[DrawnLine, ...]
    time: Floats  # (nf,) s
    slow: Bools  # (nf,) whether the instant is shown in slow motion
    deflection: Floats  # (nf, points of all lines) m, relative to the base
    ends: Mapping[str, Floats]  # by stop (nf, 1 or 2) m, deflection of the places that it acts on
    force: Mapping[str, Floats]  # by stop (nf,) N, positive when it pushes
    opening: Mapping[str, Floats]  # by stop (nf,) m, distance to its face as it is then; 0 while it touches or is held
    missed: float = 0.0  # largest deflection between frames beside a cubic through them, over the largest of all


def frames_of_run(result: RunResult, progress: Progress = None, model: StructuralSystem | None = None) -> Frames:
    """A few periods around the largest contact force of a run; of a run without contact its last ones.

    Parameters
    ----------
    result : of the run.
    progress : called with the share of the motion that is done.
    model : the system of the result's scenario, where it was built already.

    Returns
    -------
    Frames
        Up to where the motion ends.

    Raises
    ------
    ScenarioError
        If the model cannot be built again, or its input has too many pieces.
    """
    settings, system = not_none(result.scenario.run), model
    if isinstance(settings.start, OrbitStart):
        shared = SharedBuilds() if model is None else model.parts.shared
        _, system = built_at_orbit(result.scenario, shared)
    system = system or build_system(result.scenario)
    times, slow = instants(result)
    until = {"duration": max(float(times[-1]), 1e-9), "low_pass": None, "srs": None}
    asked = Needed(state_times=between_samples(times))
    motion = motion_of(system, settings.model_copy(update=until), times, progress, never, asked)
    known, states, between = not_none(motion.histories), motion.states, None
    times, slow = known.time, slow[: known.time.size]
    if states is None:  # of a time-stepped motion they are known at the frames alone
        q = of_kind(ReferenceTrajectory, motion.marched).y[:, : system.dynamics.size]
    else:
        q, between = (states[first : 2 * times.size - 1 : 2, : system.dynamics.size] for first in (0, 1))
    none = np.zeros((times.size, 0))
    forces, openings = (known.of(key) if system.snubbers else none for key in (FORCE, OPENING))
    return frames_at(system, (times, slow), q, forces, openings, between)


def between_frames(times: Floats) -> Floats:
    """(nf - 1,) s, a time between each two of the instants (nf,) of frames, see `between_samples`."""
    return between_samples(times)[1::2]


def frames_at(
    system: StructuralSystem, instants: tuple[Floats, Bools], q: Floats, forces: Floats, openings: Floats,
    between: Floats | None = None,
) -> Frames:  # fmt: skip
    """Frames of known coordinates.

    Parameters
    ----------
    system : that moves.
    instants : (nf,) s, and whether each is slow.
    q : (nf, n) coordinates of the model.
    forces : (nf, snubbers) N.
    openings : (nf, snubbers) m, distances to the faces as they are at each instant.
    between : (nf - 1, n) coordinates at `between_frames`, where they are known.

    Returns
    -------
    Frames
    """
    (times, slow), scenario, parts = instants, system.scenario, system.parts
    lines = tuple(line for part in system.stations.parts for line in _lines_of(system.stations, part, scenario))
    sites = {located.item.name: snubber_site(located) for located in scenario.located_snubbers}
    of_lines = [parts.shapes(x.places) if x.stations is None else system.deflection[x.stations] for x in lines]
    at_stops = parts.shapes([end for site in sites.values() for end in ends_of(site)])
    force, opening = ({name: of[:, k] for k, name in enumerate(sites)} for of in (forces, openings))
    stations = [place for body in system.bodies for place in body.places]
    places = [
        place
        for line in lines
        for place in (line.places if line.stations is None else [stations[number] for number in line.stations])
    ]
    deflection = q @ np.vstack(of_lines).T + system.with_supports(places, times)
    missed = 0.0
    if between is not None:
        there = between @ np.vstack(of_lines).T + system.with_supports(places, between_frames(times))
        missed = _missed(times, deflection, there)
    return Frames(lines, times, slow, deflection, _of_stops(sites, q @ at_stops.T), force, opening, missed)


def _missed(times: Floats, deflection: Floats, between: Floats) -> float:
    """Largest difference of deflections between frames from cubics through the frames, over the largest deflection."""
    from scipy.interpolate import CubicSpline

    different = np.append(np.diff(times) > 0.0, True)
    if np.count_nonzero(different) < 4 or not deflection.any():
        return 0.0
    expected = CubicSpline(times[different], deflection[different])(between_frames(times))
    return float(np.abs(between - expected).max() / np.abs(deflection).max())


def paced_by_contact(time: Floats, forces: Floats) -> tuple[Floats, Bools]:
    """Instants between the first and the last time at which frames are shown, slow around contact, and which are slow.

    Parameters
    ----------
    time : (nt,) s.
    forces : (nt, snubbers) N there.
    """
    closed = np.any(forces > 0.0, axis=1)
    intervals = list(_intervals(time, closed)) if closed.any() else []
    return _paced(float(time[0]), float(time[-1]), intervals, MARGIN * float(time[-1] - time[0]))


def frames_of_orbit(model: StructuralSystem, stations: Stations, motion: Dataset) -> Frames:
    """One period of a free periodic motion, with the shapes at the stations of its result.

    Parameters
    ----------
    model : that moves; its stops have no memory, and nothing moves their places.
    stations, motion : of its result, the motion as `beamsim.analyses.nnm.layouts.MOTION`.

    Returns
    -------
    Frames
        On lines through the stations.
    """
    sites = {located.item.name: snubber_site(located) for located in model.scenario.located_snubbers}
    time, deflection = motion["time"].values, motion["deflection"].values
    force_at = {name: force.values for name, force in motion.by_label("force").items()}
    times, slow = paced_by_contact(time, np.array([np.zeros(time.size), *force_at.values()]).T)

    def at(values: Floats) -> Floats:
        return np.array([np.interp(times, time, column) for column in values.T]).T

    lines, columns = [], []
    for part in stations.parts:
        numbers = np.arange(part.stations.start, part.stations.stop)
        across = None if part.axis is not IN_PLANE or stations.across is None else stations.across[part.stations]
        rows = [numbers[across == y] for y in np.unique(across)] if across is not None else [numbers]
        for row in rows if part.axis.continuous else _of_nodes(stations, part):
            y = None if across is None or stations.across is None else stations.across[row]
            lines.append(DrawnLine(part.body, stations.position[row], y, part.axis.continuous, row))
            columns.append(row)
    places = [end for site in sites.values() for end in ends_of(site)]
    nearest = [_nearest(stations, place) for place in places]
    of_ends = at(deflection[:, nearest]) if nearest else np.zeros((times.size, 0))
    ends = _of_stops(sites, of_ends)
    force = {name: np.interp(times, time, values) for name, values in force_at.items()}
    opening = {s.name: _opening(s, ends[s.name]) for s in model.snubbers}
    return Frames(tuple(lines), times, slow, at(deflection[:, np.concatenate(columns)]), ends, force, opening)


def _opening(stop: SnubberNumbers, ends: Floats) -> Floats:
    """(nf,) m, distance to the face of a stop without memory, from deflections (nf, 1 or 2) of its places."""
    towards = ends[:, 0] - (ends[:, 1] if ends.shape[1] == 2 else 0.0)  # from the first place to the second
    sign = {"below": 1.0, "above": -1.0, "approach": -1.0, "separation": 1.0}[stop.side]
    return np.asarray(np.maximum(stop.gap + sign * towards, 0.0))


def _of_stops(sites: Mapping[str, Site], values: Floats) -> dict[str, Floats]:
    """By stop the values (nf, 1 or 2) of the places that it acts on, from those of all (nf, places)."""
    last = np.cumsum([len(ends_of(site)) for site in sites.values()])
    return dict(zip(sites, np.split(values, last[:-1], axis=1), strict=False))  # of no stop one empty part


def _nearest(stations: Stations, place: Place) -> int:
    parts = stations.parts
    part = next((each for each in parts if each.body == place.body), parts[0])
    distance = np.abs(stations.position[part.stations] - place.coordinate)
    if place.across is not None and stations.across is not None:
        distance = np.hypot(distance, stations.across[part.stations] - place.across)
    return int(part.stations.start + distance.argmin())


def instants(result: RunResult) -> tuple[Floats, Bools]:
    """Instants (nf,) of the frames and whether they are slow; see `frames_of_run`."""
    time = result["histories"]["time"].values
    begin, end = float(time[0]), float(time[-1])
    frequencies = [result.excitation_hz, *result["modes"]["open_frequencies_hz"].values]
    period = 1.0 / next((f for f in frequencies if np.isfinite(f) and f > 0.0), 1.0 / max(end - begin, 1e-9))
    peaks = [(float(force.max(initial=0.0)), float(time[force.argmax()])) for force in _forces(result) if force.size]
    force, at = max(peaks, default=(0.0, end))
    centre = at if force > 0.0 else end
    length = min(CYCLES_SHOWN * period, end - begin)  # of the excitation or of the first mode
    first = min(max(centre - length / 2, begin), end - length)
    at_events, snubber, closing = (result["events"][name].values for name in ("time", "snubber", "closing"))
    intervals = []
    for number in range(len(result["histories"].labels("snubber"))):
        mine = snubber == number
        intervals += list(_contacts(at_events[mine], closing[mine], begin, end))
    # a contact that lasts is no instant to be shown slowly: only its ends are
    shown = [
        each
        for start, stop in intervals
        if stop > first and start < first + length
        for each in ([(start, stop)] if stop - start < 0.25 * period else [(start, start), (stop, stop)])
    ]
    times, slow = _paced(first, first + length, shown, MARGIN * period)
    if force > 0.0:
        times[np.abs(times - at).argmin()] = at  # the peak itself is among them
    return times, slow


def _forces(result: RunResult) -> list[Floats]:
    return [force.values for force in result["histories"].by_label("snubber_force").values()]


def _contacts(time: Floats, closing: Bools, begin: float, end: float) -> list[tuple[float, float]]:
    """Intervals of contact from the events of one stop."""
    if not time.size:
        return []
    starts = [*([] if closing[0] else [begin]), *time[closing].tolist()]
    stops = [*time[~closing].tolist(), *([end] if closing[-1] else [])]
    return list(zip(starts, stops, strict=True))


def _intervals(time: Floats, closed: Bools) -> Sequence[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], closed, [False]]).astype(int)))
    return [(float(time[a]), float(time[min(b, time.size - 1)])) for a, b in edges.reshape(-1, 2)]


def _paced(first: float, last: float, contacts: Sequence[tuple[float, float]], margin: float) -> tuple[Floats, Bools]:
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


def _lines_of(stations: Stations, part: StationPart, scenario: Scenario) -> list[DrawnLine]:
    bodies = list(scenario.all_bodies)
    name = part.body if part.body in bodies else bodies[0]  # one alone is called after its axis
    x = stations.position[part.stations]
    if part.axis is IN_PLANE and stations.across is not None:
        y = stations.across[part.stations]
        across, along = np.linspace(y.min(), y.max(), PLATE_LINES), np.linspace(x.min(), x.max(), PLATE_LINES)
        fine_x, fine_y = np.linspace(x.min(), x.max(), PLATE_POINTS), np.linspace(y.min(), y.max(), PLATE_POINTS)
        return [
            *(DrawnLine(name, fine_x, np.full(PLATE_POINTS, each), True) for each in across),
            *(DrawnLine(name, np.full(PLATE_POINTS, each), fine_y, True) for each in along),
        ]
    if part.axis.continuous:
        # 81: along a beam; its elements are cubic
        return [DrawnLine(name, np.linspace(x.min(), x.max(), 81), None, True)]
    return [DrawnLine(name, stations.position[numbers], None, False, numbers) for numbers in _of_nodes(stations, part)]


def _of_nodes(stations: Stations, part: StationPart) -> list[Ints]:
    """Stations by line: all in their order; of nodes in space those of each edge of an element, and nodes alone."""
    numbers = np.arange(part.stations.start, part.stations.stop)
    if stations.points is None or not np.all(np.isfinite(stations.points[part.stations])):
        return [numbers]
    edges = [] if stations.lines is None else list(stations.lines[np.isin(stations.lines[:, 0], numbers)])
    return [*edges, *np.setdiff1d(numbers, np.concatenate(edges) if edges else [])[:, None]]
