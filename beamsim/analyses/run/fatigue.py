r"""Stress histories of bodies: the largest von Mises stress of plates, and fatigue.

Fatigue is the damage of the bending stress at every station. The ranges of a count add up to half the total
variation V of the stress, and none exceeds the difference R of its extremes. With an S-N line of exponent
:math:`m \ge 1` the damage of a station is therefore at most :math:`R^{m-1} V / (2 N S^m)`. Stations are counted in
the order of this bound, until it is below the largest damage.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from beamsim.analyses.run.impacts import BLOCKS, FEWEST_IMPACTS, columns_of_cycles, jackknife
from beamsim.analyses.run.layouts import FATIGUE
from beamsim.analyses.run.observers import ChunkObserver
from beamsim.flow.channels import outputs_of
from beamsim.flow.trajectory import Trajectory
from beamsim.labelled import Dataset
from beamsim.outcomes import Interrupted, Stop
from beamsim.responses.histories import times_reached
from beamsim.results.values import STRESS, Extreme
from beamsim.scenario.run import StressLife
from beamsim.signals.rainflow import damage, distinct_cycles, equivalent_range, reversals
from beamsim.structures.places import COMPONENTS
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints, not_none

SAMPLES_OF_STRESS = 2000  # samples of a run, at least, for the largest von Mises stress
STATIONS_PER_BATCH = 8  # stations counted together, after the one with the largest bound
SAME_DAMAGE = 1e-9  # relative; of stations with equal damage the first one is reported


class PlateStress(ChunkObserver):
    """Largest von Mises stress at the surface of every plate, from samples.

    Parameters
    ----------
    system : system with its plates.
    times : (nt,) output times, s.
    stop : see `ChunkObserver`.
    """

    def __init__(self, system: StructuralSystem, times: Floats, stop: Stop) -> None:
        super().__init__(stop)
        self._times, self._channels = times[:: max(1, times.size // SAMPLES_OF_STRESS)], system.channels.of_keys(STRESS)
        self._found, stress = 0, system.stress
        plates = {body.body for body in system.bodies if body.moments == len(COMPONENTS)}
        self._parts = dict[str, slice]()
        if stress is not None:
            alone = len(stress.stations.bodies) == 1
            named = {stress.bodies[0] if alone else part.body: part.stations for part in stress.stations.bodies}
            self._parts = {name: stations for name, stations in named.items() if name in plates}
        self._squares = {
            name: np.zeros((part.stop - part.start) // len(COMPONENTS)) for name, part in self._parts.items()
        }  # fmt: skip

    def evaluate(self, chunk: Trajectory) -> None:
        """See `ChunkObserver`."""
        last = times_reached(chunk.end, self._times).size
        if not self._parts or last == self._found:
            return
        at_once = 256  # samples
        output_of = outputs_of(chunk.flow, self._channels.linear)
        for first in range(self._found, last, at_once):
            times = np.minimum(self._times[first : min(first + at_once, last)], chunk.end)
            sampled = chunk.sample(times, output_of)
            for name, part in self._parts.items():
                x, y, shear = np.moveaxis(sampled[:, part].reshape(sampled.shape[0], len(COMPONENTS), -1), 1, 0)
                square = (x**2 - x * y + y**2 + 3 * shear**2).max(axis=0)
                self._squares[name] = np.maximum(self._squares[name], square)
        self._found = last

    def result(self) -> dict[str, Floats]:
        """(nx,) stress at the stations of every plate, Pa, by its name.

        Raises
        ------
        Interrupted
            If a part of the motion was not evaluated.
        """
        self.finish()
        return {name: np.sqrt(square) for name, square in self._squares.items()}


class StressObserver(ChunkObserver):
    """Input of the fatigue analysis: variation and turning points of the stresses.

    Turning points of the latest chunk are found on request, since few stations have to be counted.

    Parameters
    ----------
    system : system with stresses.
    stop : see `ChunkObserver`.
    """

    def __init__(self, system: StructuralSystem, stop: Stop) -> None:
        super().__init__(stop)
        self._rows = system.channels.of_keys(STRESS).linear
        self._variation, self._turns = np.zeros(self._rows.shape[0]), [list[Floats]() for _ in self._rows]

    def evaluate(self, chunk: Trajectory) -> None:
        """See `ChunkObserver`."""
        self._variation = self._variation + self._variation_of(chunk)
        for station, turns in enumerate(self._turns):
            turns.append(self._turns_of(chunk, station))

    def variation(self) -> Floats:
        """(nx,) upper bounds of the total variation at all stations, Pa."""
        return self._variation if self._latest is None else self._variation + self._variation_of(self._latest)

    def turns(self, station: int) -> Floats:
        """Successive turning points of the stress at a station, Pa."""
        latest = [] if self._latest is None else [self._turns_of(self._latest, station)]
        return np.concatenate([*self._turns[station], *latest])

    def check_complete(self) -> None:
        """Raise `Interrupted` if a part of the motion was not evaluated."""
        if self._interrupted:
            raise Interrupted

    def _variation_of(self, chunk: Trajectory) -> Floats:
        return chunk.variation(outputs_of(chunk.flow, self._rows))

    def _turns_of(self, chunk: Trajectory, station: int) -> Floats:
        one = outputs_of(chunk.flow, self._rows[[station]])
        return reversals(chunk.turning_points(one, np.arange(chunk.time.size)).value)


def fatigue_of(system: StructuralSystem, stresses: StressObserver, end: float, extremes: Extreme) -> Dataset:
    """Fatigue of each body at its station with the largest damage; for a plate also over the stress components.

    Parameters
    ----------
    system : system with stresses.
    stresses : observer of the motion.
    end : end of the motion, s.
    extremes : (4, nx) extremes of the stress at every station, Pa.

    Returns
    -------
    Dataset
        Layout `FATIGUE`.

    Raises
    ------
    Interrupted
        If a part of the motion was not evaluated.
    """
    stresses.check_complete()
    settings = not_none(not_none(system.scenario.run).fatigue)
    stress, variation = not_none(system.stress), stresses.variation()
    tested = not_none(system.scenario.run).test_duration
    limit, across, names = (
        settings.endurance_limit or 0.0,
        stress.stations.position_y,
        list(dict.fromkeys(stress.bodies)),
    )
    components = {body.body: COMPONENTS[: body.moments] for body in system.bodies if body.moments > 1}
    rows, counted = list[dict[str, Any]](), list[Floats]()
    for name in names:
        stations = np.flatnonzero(np.array(stress.bodies) == name)
        station, turns = _worst(stations, stresses, (extremes[2] - extremes[0], variation), settings)
        cycles, number = distinct_cycles(turns), int(np.searchsorted(stations, station))
        done = damage(cycles, settings.stress_range, settings.cycles, settings.exponent, limit)
        of_body = components.get(name)
        counted.append(cycles)
        rows.append({
            "position": float(stress.stations.position[station]),
            "position_y": np.nan if across is None else float(across[station]),
            "component": None if of_body is None else of_body[number * len(of_body) // stations.size],
            "cycles": float(cycles[:, 2].sum()),
            "largest_range_pa": float(cycles[:, 0].max(initial=0.0)),
            "equivalent_range_pa": equivalent_range(cycles, settings.exponent, limit),
            "damage": done,
            "life_s": end / done if done > 0.0 else float("inf"),
            "damage_in_test": None if tested is None else done * tested / end,
            **(damage_interval(turns, done, settings) if system.scenario.excitation.stationary else {}),
        })  # fmt: skip
    values: dict[str, Any] = {"body": names, **columns_of_cycles(counted, "body")}
    of_all = {name: [row.get(name, np.nan) for row in rows] for name in (*rows[0], "damage_low", "damage_high")}
    unknown = ("position_y", "component", "damage_low", "damage_high")
    values |= {name: None if name in unknown and not any(map(has_value, of)) else of for name, of in of_all.items()}
    return FATIGUE.dataset(values)


def has_value(value: float | str | None) -> bool:
    """True unless the value is None or NaN."""
    return value is not None and value == value  # NaN is not


def _worst(
    stations: Ints, stresses: StressObserver, ranges_and_variations: tuple[Floats, Floats], settings: StressLife
) -> tuple[int, Floats]:
    """Station of a body with the largest damage, and the turning points of its stress, Pa.

    Parameters
    ----------
    stations : stations of the body.
    stresses : observer of the motion.
    ranges_and_variations : (nx,) stress ranges, and bounds of the total variations, Pa.
    settings : S-N line.

    Returns
    -------
    Index of the station, and its turning points. Without damage, the station with the largest range.
    """
    ranges, variation = (values[stations] for values in ranges_and_variations)
    unit, exponent, limit = float(ranges.max()), settings.exponent, settings.endurance_limit or 0.0
    if not limit < unit < np.inf:
        station = int(stations[ranges.argmax()])
        return station, stresses.turns(station)
    bounds = np.where(ranges > limit, (ranges / unit) ** (exponent - 1.0) * variation / (2.0 * unit), -1.0)
    order, found = np.argsort(-bounds, kind="stable"), dict[int, tuple[float, Floats]]()
    first, count = 0, 1
    while first < order.size:
        largest = max((done for done, _ in found.values()), default=-1.0)
        group = order[first : first + count]
        group = group[bounds[group] >= max((1.0 - SAME_DAMAGE) * largest, 0.0)]
        if not group.size:
            break
        for k in group.tolist():
            turns = stresses.turns(int(stations[k]))
            found[k] = damage(distinct_cycles(turns), unit, 1.0, exponent, limit), turns
        largest = max(done for done, _ in found.values())
        found = {k: each for k, each in found.items() if each[0] >= (1.0 - SAME_DAMAGE) * largest}
        first, count = first + count, STATIONS_PER_BATCH
    worst = min(found)
    return int(stations[worst]), found[worst][1]


def damage_interval(turning_points: Floats, done: float, settings: StressLife) -> dict[str, float]:
    """95 % interval of the mean damage of stationary motions as long as this one, from parts of it.

    Parameters
    ----------
    turning_points : (n,) turning points of the stress, Pa.
    done : damage of all cycles.
    settings : S-N line.

    Returns
    -------
    Columns of `FATIGUE`, as ratios to the damage; empty for a record with few cycles.
    """
    parts, limit = np.array_split(turning_points, BLOCKS), settings.endurance_limit or 0.0
    each = np.array([
        damage(distinct_cycles(part), settings.stress_range, settings.cycles, settings.exponent, limit)
        for part in parts
    ])  # fmt: skip
    if turning_points.size < BLOCKS * FEWEST_IMPACTS or np.count_nonzero(each) < 2:
        return {}
    (found,) = jackknife({"damage": each}, {"damage": lambda sums: np.log(sums["damage"])})
    low, high = (done * float(np.exp(end - found.value)) for end in (found.low, found.high))
    return {"damage_low": low, "damage_high": high}


def fatigue_warnings(fatigue: Dataset, settings: StressLife) -> Iterator[str]:
    """Warn about each body that fails within the run (often a wrong unit), or within the test."""
    for body in fatigue.rows("body"):
        if body["damage"] < 1.0 <= (body.get("damage_in_test") or 0.0):
            tested = f"{body['damage_in_test']:.3g}"
            yield f"the damage of {body['body']} in run.test_duration = {tested} is failure in the test"
        if body["damage"] >= 1.0:
            yield (
                f"the damage of {body['body']} = {body['damage']:.3g} is failure within the run: ranges are up to "
                f"{body['largest_range_pa']:.3g} Pa, and run.fatigue.stress_range is {settings.stress_range:.3g} Pa "
                f"for {settings.cycles:.3g} cycles; a unit such as MPa may be missing"
            )
