r"""Impacts and sliding of friction in a run, from a motion in closed form.

An impact lasts from the closing of a contact to its opening; contacts separated by less than the minimum rest time are
one impact. A contact that began before the motion is cut: its approach speed is unknown. Impulses, energies and mean
squares are closed-form integrals over the segments, speeds the rate of the penetration at starts of segments, peak
forces the highest turning points of the force (for a latch, which also pulls, of its magnitude). The energy that a
released snubber loses before the next contact belongs to the previous impact.

The sliding speed is that of the face; behind a tangential spring, that of the slider. If sliding begins below the
static force, the slider moves by the spring-back of that spring, which counts as sliding.

For random inputs the values have intervals (`jackknife`), from blocks with many impacts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamsim.analyses.run.layouts import IMPACT_STATISTICS, IMPACTS, OF_SNUBBERS
from beamsim.analyses.run.observers import ChunkObserver
from beamsim.contacts.laws import NORMAL_FORCE
from beamsim.contacts.sliders import STICK
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory, TurningPoints
from beamsim.labelled import Dataset
from beamsim.outcomes import Stop
from beamsim.scenario.connections import FrictionBase, HingeElement
from beamsim.signals.rainflow import distinct_cycles, reversals
from beamsim.system.equations import RowsOf
from beamsim.system.structural import StructuralSystem, contact_units
from beamsim.typing import Bools, Floats, Ints, not_none

if TYPE_CHECKING:
    from beamsim.system.rings import RingInfo

SKIPPED_SHARE = 0.1  # share of the run that is excluded at its beginning
CONFIDENCE = 0.95
BLOCKS = 20
FEWEST_IMPACTS = 40  # impacts or slides needed for an interval

AT_REST = 1e-9  # relative to the highest approach speed; slower contacts begin at rest

Sums = Mapping[str, Floats]  # (BLOCKS,) by name


class ImpactObserver(ChunkObserver):
    """Impacts at all snubbers and rings after ``run.from``, counted as ``run.impacts`` specifies.

    Parameters
    ----------
    system : system with the snubbers.
    stop : see `ChunkObserver`.
    """

    def __init__(self, system: StructuralSystem, stop: Stop) -> None:
        super().__init__(stop)
        self._system, self._run = system, not_none(system.scenario.run)
        self._end, self._of_chunks = self._run.from_, list[list[_Contacts]]()

    def evaluate(self, chunk: Trajectory) -> None:
        """See `ChunkObserver`."""
        begin = self._run.from_
        if chunk.end > begin or not begin:
            later = chunk.extract(begin, chunk.end) if begin > chunk.time[0] else chunk
            of_snubbers = [_contacts(later, j) for j in range(len(self._system.snubbers))]
            of_rings = [_contacts_of_ring(later, ring) for ring in self._system.rings]
            self._of_chunks.append(of_snubbers + of_rings)
            self._end = chunk.end

    def result(self) -> dict[str, Dataset]:
        """Datasets of a motion that extends beyond ``run.from``, by name.

        Raises
        ------
        Interrupted
            If a part of the motion was not evaluated.
        """
        self.finish()
        return _impact_datasets(self._system, self._of_chunks, self._end)


def _impact_datasets(
    system: StructuralSystem, of_chunks: Sequence[Sequence[_Contacts]], end: float
) -> dict[str, Dataset]:
    """Impacts from the contacts by chunk and snubber, up to the end of the motion (s), and their statistics."""
    run = not_none(system.scenario.run)
    settings, begin, stationary = not_none(run.impacts), run.from_, system.scenario.excitation.stationary
    each, statistics, cycles, intervals = [], [], [], []
    for j, of_snubber in enumerate(zip(*of_chunks, strict=True)):
        contacts = _join_parts(of_snubber)
        every = _impacts(contacts, settings.minimum_rest)
        counted = every.select(every.peak_force >= settings.force_threshold)
        each.append(counted)
        statistics.append(_statistics((begin, end), every, counted))
        cycles.append(distinct_cycles(_with_rests(contacts)))
        intervals += [(j, row) for row in (_intervals(every, counted, begin, end) if stationary else ())]
    units = [contact_units(snubber.gap_unit) for snubber in system.snubbers]
    units += [contact_units("m")] * len(system.rings)
    values: dict[str, Any] = {
        "snubber": [*(snubber.name for snubber in system.snubbers), *(ring.name for ring in system.rings)],
        **{name: [of[name] for of in statistics] for name in OF_SNUBBERS},
        **columns_of_cycles(cycles, "snubber"),
    }
    if intervals:
        values |= {
            "interval": np.arange(1, len(intervals) + 1),
            "interval_snubber": [j for j, _ in intervals],
            **{name: [getattr(row, name) for _, row in intervals] for name in ValueInterval._fields},
        }
    of_cycles = " | ".join(dict.fromkeys(of["force_unit"] for of in units))
    of_statistics = IMPACT_STATISTICS.dataset(values, {"snubber": units}, force_unit=of_cycles)
    table = _table(each, settings.minimum_rest, settings.force_threshold)
    return {"impacts": table, "impact_statistics": of_statistics}


def columns_of_cycles(cycles: Sequence[Floats], owner: str) -> dict[str, Any]:
    """Counted cycles (n, 3) of each owner, ``snubber`` or ``body``, as columns of one table."""
    spans, means, counts = np.concatenate(cycles).T
    return {
        "cycle": np.arange(1, spans.size + 1),
        f"cycle_{owner}": np.repeat(np.arange(len(cycles)), [of.shape[0] for of in cycles]),
        "range": spans, "mean": means, "count": counts,
    }  # fmt: skip


def _table(impacts_of_snubbers: Sequence[_Impacts], minimum_rest: float, force_threshold: float) -> Dataset:
    """Impacts of all snubbers as one table, in order of time."""
    snubber_of = np.repeat(np.arange(len(impacts_of_snubbers)), [impacts.begin.size for impacts in impacts_of_snubbers])
    order = np.lexsort((snubber_of, np.concatenate([impacts.begin for impacts in impacts_of_snubbers])))
    columns: dict[str, Any] = {
        field.name: np.concatenate([getattr(impacts, field.name) for impacts in impacts_of_snubbers])[order]
        for field in fields(_Impacts)
        if field.name != "square"
    }
    before, after = columns["approach_speed"], columns["separation_speed"]
    begins = before > AT_REST * np.nanmax(before, initial=0.0)
    columns |= {
        "minimum_rest_s": minimum_rest,
        "force_threshold_n": force_threshold,
        "impact": np.arange(1, order.size + 1),
        "snubber": snubber_of[order],
        "restitution": np.where(begins, after / np.where(begins, before, 1.0), np.nan),
    }
    return IMPACTS.dataset(columns)


@dataclass(frozen=True)
class _Impacts:
    """Impacts, or single contacts, at one snubber in order of time; arrays (n,), see `IMPACTS`."""

    begin: Floats
    end: Floats
    contact_time: Floats
    contacts: Ints
    peak_force: Floats
    peak_time: Floats
    impulse: Floats
    square: Floats  # N^2 s, integral of the squared force
    approach_speed: Floats
    separation_speed: Floats
    energy_lost: Floats
    incomplete: Bools

    def select(self, mask: Bools) -> _Impacts:
        """Impacts selected by a mask."""
        return _Impacts(*(values[mask] for values in vars(self).values()))


@dataclass(frozen=True)
class _Contacts:
    """Contacts at one snubber."""

    rows: _Impacts
    forces: tuple[Floats, ...]  # N, at the ends and the turning points of each contact
    lost_before: float  # J, since a contact in an earlier chunk
    begins_in_contact: bool  # True if the first one began in an earlier chunk, or before the motion
    continues: bool  # True if the last one does not end in this chunk


class _Spans(NamedTuple):
    """Contacts as ranges of segments."""

    start: Floats  # s
    end: Floats  # s
    of_segment: Ints  # contact of each segment, -1 before the first

    @classmethod
    def of(cls, trajectory: Trajectory, touching: Bools) -> _Spans:
        """The contacts of a motion, from the segments (S,) in contact."""
        first = np.flatnonzero(touching & ~np.append(False, touching[:-1]))
        last = np.flatnonzero(touching & ~np.append(touching[1:], False))
        of_segment = np.cumsum(np.isin(np.arange(touching.size), first)) - 1
        return cls(trajectory.time[first], trajectory.time[last] + trajectory.length[last], of_segment)


def _contacts(trajectory: Trajectory, contact: int) -> _Contacts:
    """Contacts at one snubber in a chunk."""
    flow = trajectory.flow
    touching = flow.system.contacts.closed(trajectory.phases)[:, contact]
    start, end, of_segment = _Spans.of(trajectory, touching)
    square, impulse, lost = _integrals(trajectory, contact, touching).T
    count, since = start.size, of_segment >= 0

    def summed(values: Floats, which: Bools) -> Floats:
        return np.asarray(np.bincount(of_segment[which], values[which], minlength=count), dtype=float)

    one = np.array([contact])
    force = trajectory.turning_points(lambda phases: flow.at(phases).force[one], np.flatnonzero(touching))
    owner = of_segment[force.segment]
    sizes = force._replace(value=np.abs(force.value)) if flow.system.contacts.laws[contact].latches else force
    peak, peak_time = _largest(owner, sizes, count)
    speeds = _penetration_rates(trajectory, contact, np.concatenate([start, end]))
    forces = tuple(reversals(values) for values in np.split(force.value, np.flatnonzero(np.diff(owner)) + 1)[:count])
    rows = _Impacts(
        start, end, summed(trajectory.length, touching), np.ones(count, dtype=np.int64), peak, peak_time,
        summed(impulse, since), summed(square, since), speeds[:count], -speeds[count:], summed(lost, since),
        np.zeros(count, dtype=bool),
    )  # fmt: skip
    begins_in_contact = bool(touching[0]) and not _closes_at_start(trajectory, contact)
    return _Contacts(rows, forces, float(lost[~since].sum()), begins_in_contact, bool(touching[-1]))


def _contacts_of_ring(trajectory: Trajectory, ring: RingInfo) -> _Contacts:
    """Contacts at a ring in a chunk, from the first side that closes to the last that opens.

    The magnitude of its force is no linear output: see `RingContact`.
    """
    from beamsim.responses.rings import RingContact, radial_speeds

    of = RingContact.of(trajectory, ring)
    start, end, of_segment = _Spans.of(trajectory, of.touching)
    times, force, touching, inside = of.times, of.force, of.touching, of.segments
    owner, lost = of_segment[inside], of.energy_lost(trajectory, ring.sides)

    def summed(values: Floats, which: Ints) -> Floats:
        return np.asarray(np.bincount(which, values, minlength=start.size), dtype=float)

    owners = np.repeat(owner, times.shape[1])
    peak, peak_time = _largest(owners, TurningPoints(owners, times.ravel(), force.ravel()), start.size)
    speeds = radial_speeds(trajectory, ring, np.concatenate([start, end]))
    rows = _Impacts(
        start, end, summed(trajectory.length[inside], owner), np.ones(start.size, dtype=np.int64), peak, peak_time,
        summed(of.integrals(force), owner), summed(of.integrals(force**2), owner),
        speeds[: start.size], -speeds[start.size :], summed(lost, owner), np.zeros(start.size, dtype=bool),
    )  # fmt: skip
    forces = tuple(reversals(force[owner == k].ravel()) for k in range(start.size))
    at_start = any(_closes_at_start(trajectory, j) for j in ring.sides.tolist())
    return _Contacts(rows, forces, 0.0, bool(touching[0]) and not at_start, bool(touching[-1]))


def _join_parts(parts: Sequence[_Contacts]) -> _Contacts:
    """Concatenate the contacts of all chunks; a contact that continues in the next chunk is one contact."""
    rows = _Impacts(*map(np.concatenate, zip(*(vars(part.rows).values() for part in parts), strict=True)))
    starts = np.cumsum([0, *(part.rows.begin.size for part in parts)])[:-1]  # index of the first contact of each chunk
    begins_in_contact = np.zeros(rows.begin.size, dtype=bool)
    for number, before, part in zip(starts[1:], parts[:-1], parts[1:], strict=True):
        if before.continues and part.begins_in_contact:
            begins_in_contact[number] = True
        if number:
            rows.energy_lost[number - 1] += part.lost_before
    forces = tuple(force for part in parts for force in part.forces)
    whole = _merge(_Contacts(rows, forces, 0.0, parts[0].begins_in_contact, parts[-1].continues), ~begins_in_contact)
    return replace(whole, rows=replace(whole.rows, contacts=np.ones_like(whole.rows.contacts)))


def _merge(contacts: _Contacts, begins: Bools) -> _Contacts:
    """Merge each contact with those that follow it, up to the next that ``begins`` (n,) a new one."""
    rows, first = contacts.rows, np.flatnonzero(begins)
    last = np.append(first[1:], rows.begin.size) - 1 if first.size else first
    owner = np.cumsum(begins) - 1

    def summed(values: Floats | Ints) -> Floats:
        return np.asarray(np.bincount(owner, values, minlength=first.size), dtype=float)

    peaks = _largest(owner, TurningPoints(owner, rows.peak_time, rows.peak_force), first.size)
    merged = _Impacts(
        rows.begin[first], rows.end[last], summed(rows.contact_time), summed(rows.contacts).astype(np.int64), *peaks,
        summed(rows.impulse), summed(rows.square), rows.approach_speed[first], rows.separation_speed[last],
        summed(rows.energy_lost), rows.incomplete[first],
    )  # fmt: skip
    forces = tuple(np.concatenate(contacts.forces[i : j + 1]) for i, j in zip(first, last, strict=True))
    return replace(contacts, rows=merged, forces=forces)


def _impacts(contacts: _Contacts, minimum_rest: float) -> _Impacts:
    """Merge contacts within the minimum rest time into impacts."""
    begin, end = contacts.rows.begin, contacts.rows.end
    rest = np.append(np.inf, begin[1:] - end[:-1])[: begin.size]
    impacts = _merge(contacts, (rest >= minimum_rest) | (minimum_rest == 0.0)).rows
    if contacts.begins_in_contact:
        impacts.approach_speed[0], impacts.incomplete[0] = np.nan, True
    if contacts.continues:
        impacts.separation_speed[-1], impacts.incomplete[-1] = np.nan, True
    return impacts


def _closes_at_start(trajectory: Trajectory, contact: int) -> bool:
    """True if contact begins exactly at the start of the run."""
    at_start = (trajectory.event_time <= trajectory.time[0]) & (trajectory.event_contact == contact)
    return bool(np.any(at_start & (trajectory.touch_changes > 0)))


def _integrals(trajectory: Trajectory, contact: int, closed: Bools) -> Floats:
    """(S, 3) integrals over each segment: squared force, force, dissipated power."""
    contacts = trajectory.flow.system.contacts
    segments = np.arange(closed.size) if contacts.state_counts[contact] else np.flatnonzero(closed)
    out = np.zeros((closed.size, 3))
    if segments.size:
        out[segments] = trajectory.select(segments).segment_integrals(*_factors(trajectory.flow, contact))
    return out


def _factors(flow: ExactFlow, contact: int) -> tuple[RowsOf, RowsOf, Floats]:
    """Factors of squared force, force and dissipated power of one contact, and their weights; see `power_factors`."""
    contacts = flow.system.contacts
    first = contacts.count + int(contacts.first_state[contact])
    rows = np.append(contact, first + np.arange(contacts.state_counts[contact]))
    one = flow.equations.constant(np.ones(1))

    def left(phases: Ints) -> Floats:
        at = flow.at(phases)
        return np.vstack([at.force[contact], one, at.dissipation[0][rows]])

    def right(phases: Ints) -> Floats:
        at = flow.at(phases)
        return np.vstack([at.force[contact], at.force[contact], at.dissipation[1][rows]])

    weight = np.zeros((2 + rows.size, 3))
    weight[0, 0] = weight[1, 1] = 1.0
    weight[2:, 2] = 1.0
    return left, right, weight


def _largest(owner: Ints, points: TurningPoints, count: int) -> tuple[Floats, Floats]:
    """(count,) largest value and its time by owner, for sorted owners."""
    order = np.lexsort((points.value, owner))
    last = np.flatnonzero(np.append(np.diff(owner[order]) != 0, True)) if owner.size else order
    value, time = np.full(count, np.nan), np.full(count, np.nan)
    value[owner[order][last]], time[owner[order][last]] = points.value[order][last], points.time[order][last]
    return value, time


def _penetration_rates(trajectory: Trajectory, contact: int, times: Floats) -> Floats:
    """(nt,) penetration rates at given times."""
    rate = trajectory.flow.equations.penetration_rate[[contact]]
    if not times.size:
        return np.zeros(0)
    order = np.argsort(times, kind="stable")
    out = np.empty(times.size)
    out[order] = trajectory.sample(times[order], lambda phases: rate)[:, 0]
    return out


def _statistics(span: tuple[float, float], all_impacts: _Impacts, counted: _Impacts) -> dict[str, float]:
    """Statistics of one snubber; see `OF_SNUBBERS`."""
    duration = span[1] - span[0]
    contact = float(all_impacts.contact_time.sum())
    impulse, square = float(all_impacts.impulse.sum()), float(all_impacts.square.sum())
    return {
        "number": counted.begin.size,
        "incomplete": int(counted.incomplete.sum()),
        "below_threshold": all_impacts.begin.size - counted.begin.size,
        "rate_hz": counted.begin.size / duration if duration > 0 else np.nan,
        "contact_share": contact / duration if duration > 0 else np.nan,
        "mean_contact_time_s": _mean(counted.contact_time),
        "longest_contact_time_s": float(counted.contact_time.max(initial=0.0)),
        "peak_force_n": float(counted.peak_force.max(initial=0.0)),
        "mean_peak_force_n": _mean(counted.peak_force),
        "mean_impulse_n_s": _mean(counted.impulse),
        "highest_approach_speed_m_s": _highest(counted.approach_speed),
        "mean_approach_speed_m_s": _mean(counted.approach_speed),
        "restitution": _restitution(counted),
        "mean_energy_lost_j": _mean(counted.energy_lost),
        "impulse_n_s": impulse,
        "energy_lost_j": float(all_impacts.energy_lost.sum()),
        "mean_force_n": impulse / duration if duration > 0 else np.nan,
        "rms_force_n": float(np.sqrt(square / duration)) if duration > 0 else np.nan,
        "mean_force_in_contact_n": impulse / contact if contact > 0 else np.nan,
        "rms_force_in_contact_n": float(np.sqrt(square / contact)) if contact > 0 else np.nan,
    }


def _restitution(impacts: _Impacts) -> float:
    """Coefficients of restitution of complete impacts."""
    whole = ~impacts.incomplete
    before, after = (float(np.sum(v[whole] ** 2)) for v in (impacts.approach_speed, impacts.separation_speed))
    return float(np.sqrt(after / before)) if before > 0.0 else float("nan")


def _highest(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.max(initial=0.0)) if known.size or not values.size else float("nan")


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def _with_rests(contacts: _Contacts) -> Floats:
    """Forces, with zero before and after each contact inside the motion."""
    rest = np.zeros(1)
    parts = [each for force in contacts.forces for each in (rest, force)]
    parts = parts[1:] if contacts.begins_in_contact else parts
    return np.concatenate([*parts, rest[:0] if contacts.continues else rest])


_INTERVAL_VALUES: dict[str, Callable[[Sums], Floats]] = {
    "rate_hz": lambda s: s["number"] / s["time"],
    "mean_contact_time_s": lambda s: s["contact_time"] / s["number"],
    "mean_peak_force_n": lambda s: s["peak_force"] / s["number"],
    "mean_impulse_n_s": lambda s: s["impulse"] / s["number"],
    "mean_approach_speed_m_s": lambda s: s["approach_speed"] / s["number"],
    "mean_energy_lost_j": lambda s: s["energy_lost"] / s["number"],
    "contact_share": lambda s: s["every contact_time"] / s["time"],
    "mean_force_n": lambda s: s["every impulse"] / s["time"],
    "rms_force_n": lambda s: np.sqrt(s["every square"] / s["time"]),
}
"""Values with an interval, from sums over blocks of time; an impact belongs to the block of its beginning."""


class ValueInterval(NamedTuple):
    """Value for a random input, with its interval."""

    value_name: str
    value: float  # without the first part of the run, SI
    low: float  # 95 %
    high: float


def _intervals(all_impacts: _Impacts, counted: _Impacts, begin: float, end: float) -> tuple[ValueInterval, ...]:
    """Intervals for a random input; empty if there are too few impacts."""
    begin = max(SKIPPED_SHARE * end, begin)
    width = (end - begin) / BLOCKS

    def sums(impacts: _Impacts, name: str) -> Floats:
        block = np.floor((impacts.begin - begin) / width).astype(np.int64)
        inside = (block >= 0) & (block < BLOCKS)
        values = np.nan_to_num(getattr(impacts, name)) if name else np.ones(impacts.begin.size)
        return np.asarray(np.bincount(block[inside], values[inside], minlength=BLOCKS), dtype=float)

    if np.sum(counted.begin >= begin) < FEWEST_IMPACTS:
        return ()
    blocks = {"number": sums(counted, ""), "time": np.full(BLOCKS, width)}
    for name in ("contact_time", "peak_force", "impulse", "approach_speed", "energy_lost"):
        blocks[name] = sums(counted, name)
    for name in ("contact_time", "impulse", "square"):
        blocks[f"every {name}"] = sums(all_impacts, name)
    return jackknife(blocks, _INTERVAL_VALUES)


def jackknife(blocks: Sums, estimators: Mapping[str, Callable[[Sums], Floats]]) -> tuple[ValueInterval, ...]:
    """Jackknife confidence intervals of functions of block sums, from blocks of equal length in time.

    The jackknife leaves out one block at a time (B. Efron, The Jackknife, SIAM 1982, ch. 3), with Student's t; blocks
    must be long compared with the memory of the motion.
    """
    from scipy.special import stdtrit

    whole = {name: values.sum(keepdims=True) for name, values in blocks.items()}
    without = {name: whole[name] - values for name, values in blocks.items()}
    quantile = float(stdtrit(BLOCKS - 1, 0.5 * (1.0 + CONFIDENCE)))
    rows = []
    for name_of_value, of in estimators.items():
        value, left_out = float(of(whole)[0]), of(without)
        error = float(np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((left_out - left_out.mean()) ** 2)))
        rows.append(ValueInterval(name_of_value, value, value - quantile * error, value + quantile * error))
    return tuple(rows)


def sliding_values(
    system: StructuralSystem, trajectory: Trajectory, contacts: Sequence[FrictionBase], *, random: bool = False
) -> list[dict[str, Any]]:
    """Values of sliding of friction contacts, by the names of their variables.

    Parameters
    ----------
    system : system of the contacts.
    trajectory : motion that is counted.
    contacts : the f contacts, in the order of the scenario.
    random : True for a random input, for which the values have intervals.

    Returns
    -------
    For each contact its values about sliding, energy and wear, by name.
    """
    begin, times = float(trajectory.time[0]), np.array([trajectory.end])
    if random:
        times = np.linspace(max(SKIPPED_SHARE * trajectory.end, begin), trajectory.end, BLOCKS + 1)
    sums = _sliding(system, trajectory, contacts, times)
    duration = trajectory.end - begin if trajectory.end > begin else np.inf
    return [
        {
            "sliding_share": float(sums["time"][-1, k]) / duration,
            "sliding_distance": float(sums["distance"][-1, k]),
            "slides": int(sums["slides"][-1, k]),
            "dissipated_energy": float(sums["lost"][-1, k]),
            "dissipated_power": float(sums["lost"][-1, k]) / duration,
            "wear_power": None if isinstance(contact, HingeElement) else float(sums["wear"][-1, k]) / duration,
            "worn_volume": None if contact.wear_rate is None else contact.wear_rate * float(sums["wear"][-1, k]),
            "intervals": _sliding_intervals({name: of[:, k] for name, of in sums.items()}, times) if random else (),
        }
        for k, contact in enumerate(contacts)
    ]


def _sliding_intervals(sums: Sums, times: Floats) -> tuple[ValueInterval, ...]:
    """Confidence intervals for one contact, from sums up to given times; empty if it rarely slides."""
    blocks = {name: np.diff(of) for name, of in sums.items()} | {"duration": np.diff(times)}
    estimators = {figure: partial(_rate, name) for figure, name in _RATES.items()}
    return jackknife(blocks, estimators) if blocks["slides"].sum() >= FEWEST_IMPACTS else ()


def _rate(name: str, sums: Sums) -> Floats:
    return sums[name] / sums["duration"]


_RATES = {
    "slides_per_second": "slides",
    "sliding_share": "time",
    "mean_sliding_speed_m_s": "distance",
    "dissipated_power_w": "lost",
    "wear_power_w": "wear",
}
"""Values with an interval, by the sum whose rate they are; a slide belongs to the block of its beginning."""


def _normal_forces(flow: ExactFlow, contacts: Sequence[FrictionBase], which: Ints, phases: Ints) -> Floats:
    forces = flow.equations.constant(np.array([c.constant_force if c.pressed_by is None else 0.0 for c in contacts]))
    return np.asarray(forces + flow.at(phases).law[which, NORMAL_FORCE])


def _sliding(
    system: StructuralSystem, trajectory: Trajectory, contacts: Sequence[FrictionBase], times: Floats
) -> dict[str, Floats]:
    """Sums up to given times, (nt, f) each: sliding time, s, distance, m, wear as normal force times distance, J,
    dissipated energy, J, and number of slides."""
    flow, which = trajectory.flow, system.friction_contacts
    every = trajectory.phases
    phases = every[:, which]

    def forces(state: Ints) -> Floats:
        one, lost = flow.equations.constant(np.ones(which.size)), flow.at(state).dissipation[0][which]
        return np.vstack([one, _normal_forces(flow, contacts, which, state), lost])

    def speeds(state: Ints) -> Floats:
        at = flow.at(state)
        return np.vstack([at.sliding_speeds[which], at.sliding_speeds[which], at.dissipation[1][which]])

    begin = float(trajectory.time[0])
    integrals = trajectory.product_integrals(times, forces, speeds, np.eye(3 * which.size), begin)
    distance, wear, lost = integrals.reshape(times.size, 3, which.size).swapaxes(0, 1)
    slides = flow.system.contacts.sliding_directions(every)[:, which] != 0.0
    begins = slides.copy()
    begins[1:] &= ~slides[:-1]
    normal = trajectory.sample(trajectory.time, lambda state: _normal_forces(flow, contacts, which, state))
    drop = np.array([c.coefficients.static - c.coefficients.sliding for c in contacts])
    spring = np.array([c.stiffness or np.inf for c in contacts])
    snaps = np.zeros_like(normal)
    snaps[1:] = (begins[1:] & (phases[:-1] == STICK)) * normal[1:] * drop / spring
    begun = np.searchsorted(trajectory.time, times, side="right")

    def sums_until(events: Floats) -> Floats:
        return np.asarray(np.vstack([np.zeros(which.size), np.cumsum(events, axis=0)])[begun])

    ends = np.append(trajectory.time, trajectory.end)
    slid = np.vstack([np.zeros(which.size), np.cumsum(slides * trajectory.length[:, None], axis=0)])
    return {
        "time": np.column_stack([np.interp(times, ends, column) for column in slid.T]),
        "distance": distance + sums_until(snaps),
        "wear": wear + sums_until(snaps * normal),
        "lost": lost + sums_until(trajectory.event_losses()[:, which]),
        "slides": sums_until(begins.astype(float)),
    }
