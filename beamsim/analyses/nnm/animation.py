"""Animation frames of the drawn motion of a nonlinear normal mode."""

from __future__ import annotations

import numpy as np

from beamsim.labelled import Dataset
from beamsim.responses.frames import DrawnLine, Frames, lines_of_nodes, paced_by_contact, values_by_stop
from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import ON_PLATE, Place, Stations, ends_of
from beamsim.system.structural import SnubberNumbers, StructuralSystem
from beamsim.typing import Floats


def frames_of_orbit(model: StructuralSystem, stations: Stations, motion: Dataset) -> Frames:
    """Frames over one period of a free periodic motion, at the stations of its result.

    Parameters
    ----------
    model : moving structure; its stops have no internal states and stand on fixed supports.
    stations, motion : stations and motion of the result, the latter as `beamsim.analyses.nnm.layouts.MOTION`.

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
    for part in stations.bodies:
        numbers = np.arange(part.stations.start, part.stations.stop)
        across = (
            None if part.axis is not ON_PLATE or stations.position_y is None else stations.position_y[part.stations]
        )
        rows = [numbers[across == y] for y in np.unique(across)] if across is not None else [numbers]
        for row in rows if part.axis.continuous else lines_of_nodes(stations, part):
            y = None if across is None or stations.position_y is None else stations.position_y[row]
            lines.append(DrawnLine(part.body, stations.position[row], y, part.axis.continuous, row))
            columns.append(row)
    places = [end for site in sites.values() for end in ends_of(site)]
    nearest = [_nearest(stations, place) for place in places]
    of_ends = at(deflection[:, nearest]) if nearest else np.zeros((times.size, 0))
    ends = values_by_stop(sites, of_ends)
    force = {name: np.interp(times, time, values) for name, values in force_at.items()}
    opening = {s.name: _opening(s, ends[s.name]) for s in model.snubbers}
    return Frames(tuple(lines), times, slow, at(deflection[:, np.concatenate(columns)]), ends, force, opening)


def _opening(stop: SnubberNumbers, ends: Floats) -> Floats:
    """(nf,) distance to the face of a stop without internal states, m, from deflections (nf, 1 or 2) of its places."""
    towards = ends[:, 0] - (ends[:, 1] if ends.shape[1] == 2 else 0.0)  # from the first place to the second
    sign = {"below": 1.0, "above": -1.0, "approach": -1.0, "separation": 1.0}[stop.side]
    return np.asarray(np.maximum(stop.gap + sign * towards, 0.0))


def _nearest(stations: Stations, place: Place) -> int:
    parts = stations.bodies
    part = next((each for each in parts if each.body == place.body), parts[0])
    distance = np.abs(stations.position[part.stations] - place.coordinate)
    if place.position_y is not None and stations.position_y is not None:
        distance = np.hypot(distance, stations.position_y[part.stations] - place.position_y)
    return int(part.stations.start + distance.argmin())
