"""All maxima and minima of an output on segments of a motion in closed form.

The output and its rate are evaluated on a grid that is fine against the fastest motion; a change of the rate's sign, or
a pair of them that the cubic through both ends of an interval shows, brackets a turning point, which is then located to
round-off on the closed form. Turning points that even the cubic misses differ from each other by less than the error of
this interpolation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.stopping import check_stop
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Bools, Complexes, Floats, Ints

GRID = 8  # points a period of the fastest motion
WORTH_ALL = 0.1  # share of evenly spaced points that are needed, from which on all of them are taken
POINTS_AT_ONCE = 2**18
STEPS = 9  # of the secant search; the error of the time is squared in the value


@dataclass(frozen=True)
class TurningPoints:
    """Values at both ends of every segment (limits from within) and at the turning points between them, in order."""

    segment: Ints  # (n,)
    time: Floats  # (n,) s
    value: Floats  # (n,)


def turning_points(
    trajectory: Trajectory, output_and_rate: OutputOf, segments: Ints, grid: int = GRID
) -> TurningPoints:
    """Turning points of one output.

    Parameters
    ----------
    output_and_rate : the output and its time derivative, by the phases of the contacts.
    segments : increasing numbers of those that are looked at.
    grid : points a period of the fastest motion.
    """
    parts: list[tuple[Ints, Floats, Floats]] = [(segments[:0], np.zeros(0), np.zeros(0))]
    first = 0
    for part in trajectory.parts():
        last = first + part.time.size
        inside = segments[(segments >= first) & (segments < last)] - first
        table = part.flow.output_table(output_and_rate) if inside.size else np.zeros((0, 0, 2), dtype=complex)
        for some in _blocks(part, inside, grid):
            number, time, value = _turning_points(part, table, some, grid)
            parts.append((number + first, time, value))
        first = last
    return TurningPoints(*(np.concatenate([part[k] for part in parts]) for k in range(3)))


def _step(trajectory: Trajectory, grid: int) -> float:
    """S, between points of the grid."""
    fastest = trajectory.flow.highest_frequency
    return 2.0 * np.pi / (grid * fastest) if fastest > 0.0 else np.inf


def _blocks(trajectory: Trajectory, segments: Ints, grid: int) -> Iterator[Ints]:
    """Segments that begin within so much time as `POINTS_AT_ONCE` points take."""
    block = np.floor(trajectory.time[segments] / (POINTS_AT_ONCE * _step(trajectory, grid)))
    for number in np.unique(block):
        check_stop()
        yield segments[block == number]


def _grid(trajectory: Trajectory, table: Complexes, segments: Ints, grid: int) -> tuple[Ints, Floats, Floats]:
    """Number of the segment, time, and (n, 2) output and rate, at both ends of every segment and between.

    Points between are evenly spaced in time: from one to the next no exponential is needed.
    """
    begin = trajectory.time[segments]
    end = np.maximum(np.nextafter(begin + trajectory.length[segments], begin), begin)  # still in the segment
    bounds = np.stack([begin, end], axis=1).ravel()
    step = _step(trajectory, grid)
    even = begin[0] + step * np.arange(1, int((end[-1] - begin[0]) / step) + 1) if step < np.inf else begin[:0]
    of_even = np.searchsorted(begin, even, side="right") - 1
    inside = (even > begin[of_even]) & (even < end[of_even])
    if inside.sum() > WORTH_ALL * even.size:
        between = trajectory.sample_table(even, table)[inside]
    else:
        between = trajectory.sample_table(even[inside], table)
    owner = np.concatenate([np.repeat(np.arange(segments.size), 2), of_even[inside]])
    time = np.concatenate([bounds, even[inside]])
    values = np.concatenate([trajectory.sample_table(bounds, table), between])
    order = np.lexsort((time, owner))
    return owner[order], time[order], values[order]


def _turning_points(trajectory: Trajectory, table: Complexes, segments: Ints, grid: int) -> tuple[Ints, Floats, Floats]:
    owner, time, values = _grid(trajectory, table, segments, grid)
    value, rate = values.T
    start = np.flatnonzero(owner[:-1] == owner[1:])
    low, high, at_low, at_high = _brackets(trajectory, table, time, value, rate, start)
    roots = _roots(trajectory, table, low, high, at_low, at_high)
    inner = trajectory.sample_table(roots, table)[:, 0] if roots.size else np.zeros(0)
    changes = np.flatnonzero(np.diff(owner)) + 1
    ends = np.concatenate([[0], changes, changes - 1, [time.size - 1]])
    all_times = np.concatenate([time[ends], roots])
    of_roots = owner[np.searchsorted(time, roots, side="right") - 1] if roots.size else owner[:0]
    all_owners = np.concatenate([owner[ends], of_roots])
    order = np.lexsort((np.repeat([0, 2, 1], [segments.size, segments.size, roots.size]), all_times, all_owners))
    return segments[all_owners[order]], all_times[order], np.concatenate([value[ends], inner])[order]


def _brackets(
    trajectory: Trajectory, table: Complexes, time: Floats, value: Floats, rate: Floats, start: Ints
) -> tuple[Floats, Floats, Floats, Floats]:
    """Ends of intervals in which the rate changes its sign, and the rates there."""
    width, before, after = time[start + 1] - time[start], rate[start], rate[start + 1]
    changes = before * after < 0.0
    # the cubic with these values and rates: d/ds = rise s^2 + turn s + width before
    rise = 3.0 * width * (before + after) - 6.0 * (value[start + 1] - value[start])
    turn = -width * (4.0 * before + 2.0 * after) + 6.0 * (value[start + 1] - value[start])
    with np.errstate(divide="ignore", invalid="ignore"):
        place = -0.5 * turn / rise
        lowest = width * before - 0.25 * turn**2 / rise
    pair: Bools = ~changes & (before * after > 0.0) & (place > 0.0) & (place < 1.0) & (lowest * before < 0.0)
    middle = time[start[pair]] + place[pair] * width[pair]
    at_middle = trajectory.sample_table(middle, table)[:, 1] if middle.size else middle
    true = at_middle * before[pair] < 0.0
    one, two = start[changes], start[pair][true]
    low = np.concatenate([time[one], time[two], middle[true]])
    high = np.concatenate([time[one + 1], middle[true], time[two + 1]])
    at_low = np.concatenate([rate[one], rate[two], at_middle[true]])
    at_high = np.concatenate([rate[one + 1], at_middle[true], rate[two + 1]])
    order = np.argsort(low, kind="stable")
    return low[order], high[order], at_low[order], at_high[order]


def _roots(
    trajectory: Trajectory, table: Complexes, low: Floats, high: Floats, at_low: Floats, at_high: Floats
) -> Floats:
    """Zeros of the rate between brackets, all at once, by false position with the Illinois rule."""
    low, high, at_low, at_high = low.copy(), high.copy(), at_low.copy(), at_high.copy()
    if not low.size:
        return low
    kept = np.zeros(low.size)  # which end was kept last
    root = low
    for _ in range(STEPS):
        root = np.clip(low - at_low * (high - low) / (at_high - at_low), low, high)
        at_root = trajectory.sample_table(root, table)[:, 1]
        beyond = at_root * at_high > 0.0
        exact = at_root == 0.0
        at_low = np.where(beyond & (kept == -1.0), 0.5 * at_low, at_low)
        at_high = np.where(~beyond & (kept == 1.0), 0.5 * at_high, at_high)
        kept = np.where(beyond, -1.0, 1.0)
        high, at_high = np.where(beyond, root, high), np.where(beyond, at_root, at_high)
        low, at_low = np.where(beyond, low, root), np.where(beyond, at_low, at_root)
        at_low = np.where(exact, -np.sign(at_high) * np.finfo(float).tiny, at_low)
    return root
