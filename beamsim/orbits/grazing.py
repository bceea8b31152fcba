"""Where along a branch a contact appears or vanishes: the penetration's extreme there is zero.

The extreme of the penetration during the phase that appears is a smooth function of the branch's arclength on either
side, so that its root is found to round-off, whatever corner the branch itself has.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar, Protocol

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.exact import ExactFlow
from beamsim.flow.passage import Passage
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.orbits.branch import BranchPoint, SpecialPoint
from beamsim.orbits.continuation import OrbitContinuation, Settings, between, locate
from beamsim.orbits.extrema import extrema_of
from beamsim.typing import Complexes, Floats

MOST_HALVINGS = 40
BESIDE = 1e-3  # of the distance to a neighbour, for a look at the other side of a grazing
WINDOWS = 64  # of a period, in each of which the largest penetration is looked for


class OrbitProblem(OrbitContinuation, Protocol):
    """A continuation problem whose points are periodic motions with contacts."""

    bifurcates: ClassVar[bool]  # whether multipliers may leave the unit circle anywhere

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, Passage]:
        """The flow at a point, and its motion over a whole period."""

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers."""


def cyclic(passage: Passage, without: Collection[int] = ()) -> tuple[tuple[int, int], ...]:
    """The order of events over a period, whatever event comes first, and without those of some contacts."""
    s = tuple(event for event in passage.signature if event[0] not in without)
    return min((s[i:] + s[:i] for i in range(len(s))), default=())


@dataclass(frozen=True)
class _Stay:
    """A contact beyond one of its borders, over a part of a period."""

    contact: int
    level: float  # m, penetration at the border
    top: bool  # beyond it there is more penetration
    middle: float  # s


def without_borders(contacts: Contacts) -> set[int]:
    """Contacts whose phases do not end at a penetration, by their numbers.

    Faces that hold let go by a force and begin to stick by a rate, and those that a snubber presses follow that one.
    """
    return set(np.flatnonzero(contacts.may_hold).tolist()) | set(contacts.pressed.tolist())


def _crossings(passage: Passage) -> dict[tuple[int, int, int], list[tuple[float, int, int]]]:
    """Events by contact and border (the two phases, in order): time, phases before and after."""
    crossings: dict[tuple[int, int, int], list[tuple[float, int, int]]] = {}
    for j in np.unique(passage.event_contact):
        of_contact = passage.event_contact == j
        after = passage.event_phase[of_contact]
        for t, b, a in zip(passage.event_time[of_contact], np.roll(after, 1).tolist(), after.tolist(), strict=True):
            crossings.setdefault((int(j), min(a, b), max(a, b)), []).append((float(t), b, a))
    return crossings


def _stays(contacts: Contacts, passage: Passage, few: Passage) -> list[_Stay]:
    """By border crossed less often in the other motion the shortest stay beyond it, the shortest of all first."""
    found: list[tuple[float, _Stay]] = []
    others = _crossings(few)
    without = without_borders(contacts)
    for border, events in _crossings(passage).items():
        if border[0] in without or len(events) <= len(others.get(border, ())):
            continue
        ends = [t for t, _, _ in events[1:]] + [events[0][0] + passage.duration]
        of_border = [(e - t, t, b, a) for (t, b, a), e in zip(events, ends, strict=True) if b != a]
        if of_border:
            length, begin, before, after = min(of_border)
            middle = (begin + 0.5 * length) % passage.duration
            found.append((length, _Stay(border[0], *contacts.border(border[0], before, after), middle)))
    return [stay for _, stay in sorted(found, key=lambda item: item[0])]


def extremum(
    flow: PeriodicFlow, passage: Passage, j: int, top: bool, near: float, level: float = 0.0
) -> tuple[float, float]:
    """A contact's penetration beyond a level, at its local maximum (or minimum) nearest to a time of a period.

    Parameters
    ----------
    flow, passage : the motion over a period.
    j : number of the contact.
    top : whether a maximum is looked for, or a minimum.
    near : s, time of the period.
    level : m, penetration at the border of two phases.

    Returns
    -------
    Value, m, and time, s; both are nan where there is none.
    """
    T, sign = passage.duration, 1.0 if top else -1.0
    centred = np.mod(near + (np.arange(WINDOWS) + 0.5) * (T / WINDOWS), T)
    edges = np.unique(np.concatenate([[0.0], centred, [T]]))
    border = np.array([level])

    def rows(exact: ExactFlow) -> LinearOutput:
        return (exact.penetrations[0].some(slice(j, j + 1)) + exact.constant_output(-border)).scaled(sign)

    def values(times: Floats, y: Floats) -> Floats:
        return np.asarray(sign * (flow.penetration_of(y, times)[0][:, j : j + 1] - border))

    found = extrema_of(flow, passage, rows, values, edges)
    high, when = found.high[:, 0], found.when_high[:, 0]
    # 1e-13: of a period, within which a time is that of a window's edge
    apart = 1e-13 * T
    first, last = when <= edges[:-1] + apart, when >= edges[1:] - apart
    turns = np.flatnonzero(~(first | last) | (last & np.roll(first, -1)))
    if turns.size == 0:
        return np.nan, np.nan
    distance = np.abs(np.mod(when[turns] - near + 0.5 * T, T) - 0.5 * T)
    nearest = turns[np.argmin(distance)]
    return sign * float(high[nearest]), float(when[nearest] % T)


def grazings(problem: OrbitProblem, a: BranchPoint, b: BranchPoint, settings: Settings) -> Iterator[SpecialPoint]:
    """Grazing points between two neighbours of a branch whose events differ, in the order of the branch.

    Parameters
    ----------
    problem, settings : the residual, and tolerances of its points.
    a, b : the neighbours.

    Returns
    -------
    The points, one after the other.
    """
    # 200: motions looked at between two neighbours
    yield from _within(problem, a, b, settings, 0, iter(range(200)))


def smooth_pieces(a: BranchPoint, b: BranchPoint, corners: list[SpecialPoint]) -> list[tuple[BranchPoint, BranchPoint]]:
    """The step from a to b in pieces without a corner inside.

    Parameters
    ----------
    a, b : neighbours on a branch.
    corners : grazings between them.

    Returns
    -------
    Pairs of points, from a to b.
    """
    w0 = a.u / a.scale
    chord = b.u / a.scale - w0
    inner = {id(corner.point): corner.point for corner in corners}.values()
    return list(pairwise([a, *sorted(inner, key=lambda p: float((p.u / a.scale - w0) @ chord)), b]))


def turned_at(special: list[SpecialPoint], piece: tuple[BranchPoint, BranchPoint], near: BranchPoint) -> bool:
    """Whether a piece of a step, which turns back without a fold inside, has a grazing at an end.

    The one nearer to where the turn was sought is then called a nonsmooth fold.

    Parameters
    ----------
    special : what was found on the step; the grazing in it is renamed.
    piece : the ends of the piece.
    near : where the turn was sought.

    Returns
    -------
    Whether there is one.
    """
    ends = [k for k, event in enumerate(special) if any(event.point is end for end in piece)]
    if not ends:
        return False
    at = min(ends, key=lambda k: float(np.linalg.norm((special[k].point.u - near.u) / near.scale)))
    special[at] = replace(special[at], kind="nonsmooth_fold")
    return True


def _within(
    problem: OrbitProblem, a: BranchPoint, b: BranchPoint, settings: Settings, depth: int, budget: Iterator[int]
) -> Iterator[SpecialPoint]:
    if problem.same_events(a, b) or depth > MOST_HALVINGS:
        return
    flow, cycle_a = problem.cycle(a)
    contacts, cycle_b = flow.system.contacts, problem.cycle(b)[1]
    # 2: halvings where every contact keeps its number of events: contacts met in another order graze nothing
    if depth >= 2 and sorted(cycle_a.signature) == sorted(cycle_b.signature):
        return
    without = without_borders(contacts) if contacts.jointly_acting else set()
    events_a, events_b = cyclic(cycle_a, without), cyclic(cycle_b, without)
    if events_a == events_b:
        return
    ea, eb = len(events_a), len(events_b)
    # 4: events of a phase that appears, and of its mirror image where a motion goes back the way it came
    if 0 < abs(ea - eb) <= 4 or (ea != eb and depth > MOST_HALVINGS // 2):
        more, few = (cycle_a, cycle_b) if ea > eb else (cycle_b, cycle_a)
        points = _at_one_point(problem, a, b, more, few, settings, late=depth > MOST_HALVINGS // 2)
        if points:
            yield from points
            return
    middle = None if next(budget, None) is None else between(problem, a, b, 0.5, settings)
    if middle is None:
        return
    yield from _within(problem, a, middle, settings, depth + 1, budget)
    yield from _within(problem, middle, b, settings, depth + 1, budget)


def _at_one_point(
    problem: OrbitProblem,
    a: BranchPoint,
    b: BranchPoint,
    more: Passage,
    few: Passage,
    settings: Settings,
    *,
    late: bool,
) -> list[SpecialPoint]:
    """Grazings at one point by which one of two motions has more events than the other; none where it is not found.

    Several contacts graze at once where the structure is symmetric. Unless it is ``late``, the point must explain the
    whole difference.
    """
    stays = _stays(problem.cycle(a)[0].system.contacts, more, few)
    if not stays:
        return []

    def nearest(point: BranchPoint, stay: _Stay) -> tuple[float, float]:
        flow, cycle = problem.cycle(point)
        near = stay.middle / more.duration * cycle.duration
        return extremum(flow, cycle, stay.contact, stay.top, near, stay.level)

    values = [(nearest(a, stay)[0], nearest(b, stay)[0]) for stay in stays]
    graze = locate(problem, a, b, lambda p: nearest(p, stays[0])[0], settings, values[0])
    if graze is None:
        return []
    found = [nearest(graze, stay) for stay in stays]
    sizes = [max((abs(v) for v in ends if np.isfinite(v)), default=0.0) for ends in values]
    # 1e-6: of the neighbours' penetrations: the remainder where a penetration has vanished
    touching = [abs(value) <= 1e-6 * size for (value, _), size in zip(found, sizes, strict=True)]
    if not touching[0] or not (late or (all(touching) and _explains(problem, a, graze, b, settings))):
        return []
    return [
        SpecialPoint("grazing", graze.parameter, graze, stay.contact, time, stay.top, stay.level)
        for stay, (_, time), touches in zip(stays, found, touching, strict=True)
        if touches
    ]


def _explains(problem: OrbitProblem, a: BranchPoint, graze: BranchPoint, b: BranchPoint, settings: Settings) -> bool:
    """Whether the one point explains the whole difference: motions just beside it have the neighbours' events.

    The point itself has the events of one side; the other side is looked at.
    """
    w = a.u / a.scale
    chord = b.u / a.scale - w
    share = float((graze.u / a.scale - w) @ chord) / float(chord @ chord)
    if problem.same_events(a, graze):
        near, other = between(problem, a, b, share + BESIDE * (1.0 - share), settings, (share, graze, 1.0, b)), b
    elif problem.same_events(graze, b):
        near, other = between(problem, a, b, share * (1.0 - BESIDE), settings, (0.0, a, share, graze)), a
    else:
        return False
    return near is not None and problem.same_events(near, other)
