"""Special points of branches of periodic motions, from any method, and the branches that leave there.

Where a contact appears or vanishes, the least value of the guard of the phase before is zero: of a stop that is open,
its gap, to the face of a pad that has not recovered too. It is a smooth function of the branch's arclength on either
side, so that its root is found to round-off, whatever corner the branch itself has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import ClassVar, Protocol

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import INTERNAL
from beamsim.flow.exact import ExactFlow
from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow
from beamsim.orbits.branch import BranchPoint, FailedSearch, SpecialPoint, record_failures
from beamsim.orbits.continuation import BranchStep, ContinuationProblem, Predictor, Settings, correct
from beamsim.orbits.period import cyclic, extrema_of
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.typing import Bools, Complexes, Floats, Ints

MOST_HALVINGS = 12
PAST_GRAZING = 1e-3  # of the distance to a neighbour, for a look at the other side of a grazing
WINDOWS = 64  # of a period, in each of which the largest penetration is looked for


class OrbitProblem(ContinuationProblem, Protocol):
    """A continuation problem whose points are periodic motions with contacts."""

    bifurcates: ClassVar[bool]  # whether multipliers may leave the unit circle anywhere

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, FlowMap]:
        """The flow at a point, and its motion over a whole period."""

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers."""


_Stay = tuple[int, int, int, float]
"""A contact beyond one of its borders over a part of a period: its number, its phases before and then, and the middle
of that time, s."""


def without_borders(contacts: Contacts) -> set[int]:
    """Contacts whose phases do not end at a penetration, by their numbers.

    Faces that hold let go by a force and begin to stick by a rate, and those that a snubber presses follow that one.
    """
    return set(np.flatnonzero(contacts.may_stick_rigidly).tolist()) | set(contacts.pressed_contacts.tolist())


def _crossings(flow_map: FlowMap) -> dict[tuple[int, int, int], list[tuple[float, int, int]]]:
    """Events by contact and border (the two phases, in order): time, phases before and after."""
    crossings: dict[tuple[int, int, int], list[tuple[float, int, int]]] = {}
    for j in np.unique(flow_map.event_contact):
        of_contact = flow_map.event_contact == j
        events = zip(*(column[of_contact].tolist() for column in
                       (flow_map.event_time, flow_map.event_before, flow_map.event_phase)), strict=True)  # fmt: skip
        for t, b, a in events:
            crossings.setdefault((int(j), min(a, b), max(a, b)), []).append((float(t), b, a))
    return crossings


def _stays(contacts: Contacts, flow_map: FlowMap, fewer: FlowMap) -> list[_Stay]:
    """By border crossed less often in the other motion the shortest stay beyond it, the shortest of all first."""
    found: list[tuple[float, _Stay]] = []
    others = _crossings(fewer)
    without = without_borders(contacts)
    for border, events in _crossings(flow_map).items():
        if border[0] in without or len(events) <= len(others.get(border, ())):
            continue
        ends = [t for t, _, _ in events[1:]] + [events[0][0] + flow_map.duration]
        of_border = [(e - t, t, b, a) for (t, b, a), e in zip(events, ends, strict=True) if b != a]
        if of_border:
            length, begin, before, after = min(of_border)
            middle = (begin + 0.5 * length) % flow_map.duration
            found.append((length, (border[0], before, after, middle)))
    return [stay for _, stay in sorted(found, key=lambda item: item[0])]


SAME_TIME = 1e-13  # of a period, within which a time is that of a window's edge


def lowest(flow: PeriodicFlow, flow_map: FlowMap, contact: int, guard: Floats, near_time: float) -> tuple[float, float]:
    """A contact's guard at its local minimum nearest to a time of a period.

    Parameters
    ----------
    flow, flow_map : the motion over a period.
    contact : its number.
    guard : (C,) factors of what its law depends on, as of `Contacts.guard`.
    near_time : s, time of the period.

    Returns
    -------
    Value and time, s; both are nan where there is none.
    """
    T, contacts = flow_map.duration, flow.system.contacts
    start, count = 2 * flow.system.size + int(contacts.first_state[contact]), int(contacts.state_counts[contact])
    centred = np.mod(near_time + (np.arange(WINDOWS) + 0.5) * (T / WINDOWS), T)
    edges = np.unique(np.concatenate([[0.0], centred, [T]]))

    def rows(exact: ExactFlow) -> Floats:
        return np.asarray(guard[None] @ exact.equations.law[contact])

    def values(times: Floats, y: Floats) -> Floats:
        motion = *(each[:, contact] for each in flow.penetration_of(y, times)), np.ones(times.size)
        internal = y[:, start : start + count] @ guard[INTERNAL : INTERNAL + count]
        return np.asarray(np.column_stack(motion) @ guard[: len(motion)] + internal)[:, None]

    found = extrema_of(flow, flow_map, rows, values, edges)
    low, when = found.low[:, 0], found.when_low[:, 0]
    apart = SAME_TIME * T
    first, last = when <= edges[:-1] + apart, when >= edges[1:] - apart
    turns = np.flatnonzero(~(first | last) | (last & np.roll(first, -1)))
    if turns.size == 0:
        return np.nan, np.nan
    distance = np.abs(np.mod(when[turns] - near_time + 0.5 * T, T) - 0.5 * T)
    nearest = turns[np.argmin(distance)]
    return float(low[nearest]), float(when[nearest] % T)


def grazings(step: BranchStep[OrbitProblem], budget: Iterator[int], depth: int = 0) -> Iterator[SpecialPoint]:
    """Grazing points on a step whose ends have other events, in the order of the branch.

    Parameters
    ----------
    step : of a branch.
    budget : an item for each motion that may be looked at between them.
    depth : halvings of the step so far.

    Returns
    -------
    The points, one after the other.
    """
    if step.same_events or depth > MOST_HALVINGS:
        return
    flow, cycle_a = step.problem.cycle(step.a)
    contacts, cycle_b = flow.system.contacts, step.problem.cycle(step.b)[1]
    # 2: halvings where every contact keeps its number of events: borders met in another order graze nothing
    if depth >= 2 and np.array_equal(np.sort(cycle_a.event_contact), np.sort(cycle_b.event_contact)):
        return
    without = without_borders(contacts) if contacts.jointly_acting else set()
    events_a, events_b = cyclic(cycle_a, without), cyclic(cycle_b, without)
    if events_a == events_b:
        return
    ea, eb = (sum(map(len, events.values())) for events in (events_a, events_b))
    # 4: events of a phase that appears, and of its mirror image where a motion goes back the way it came
    if 0 < abs(ea - eb) <= 4 or (ea != eb and depth > MOST_HALVINGS // 2):
        more, few = (cycle_a, cycle_b) if ea > eb else (cycle_b, cycle_a)
        points = _at_one_point(step, more, few, may_be_partial=depth > MOST_HALVINGS // 2)
        if points:
            yield from points
            return
    middle = None if next(budget, None) is None else step.point_at(0.5)
    if middle is None:
        return
    yield from grazings(step.sub_step(step.a, middle), budget, depth + 1)
    yield from grazings(step.sub_step(middle, step.b), budget, depth + 1)


REMAINDER = 1e-6  # of the neighbours' values: the remainder where a guard has vanished


def _at_one_point(
    step: BranchStep[OrbitProblem], motion: FlowMap, fewer: FlowMap, *, may_be_partial: bool
) -> list[SpecialPoint]:
    """Grazings at one point that explain why one motion has more events than another; empty if not found.

    In a symmetric structure several contacts graze at once. Unless ``may_be_partial``, the point must explain the
    whole difference of the events.
    """
    contacts = step.problem.cycle(step.a)[0].system.contacts

    def nearest(point: BranchPoint, stay: _Stay) -> tuple[float, float]:
        (flow, cycle), (contact, before, after, middle) = step.problem.cycle(point), stay
        guard = contacts.guard(contact, before, after)
        return lowest(flow, cycle, contact, guard, middle / motion.duration * cycle.duration)

    # where a motion turns in another phase than the neighbour, borders are crossed more often that nothing grazes
    ends = [(stay, (nearest(step.a, stay)[0], nearest(step.b, stay)[0])) for stay in _stays(contacts, motion, fewer)]
    stays = [stay for stay, values in ends if values[0] * values[1] <= 0.0]
    values = [values for _, values in ends if values[0] * values[1] <= 0.0]
    graze = step.locate(lambda p: nearest(p, stays[0])[0], values[0]) if stays else None
    if graze is None:
        return []
    found = [nearest(graze, stay) for stay in stays]
    touching = [abs(value) <= REMAINDER * max(map(abs, pair)) for (value, _), pair in zip(found, values, strict=True)]
    if not touching[0] or not (may_be_partial or (all(touching) and _explains(step, graze))):
        return []
    return [
        SpecialPoint("grazing", graze.parameter, graze, contact, time, *contacts.boundary(contact, before, after)[::-1])
        for (contact, before, after, _), (_, time), touches in zip(stays, found, touching, strict=True)
        if touches
    ]


def _explains(step: BranchStep[OrbitProblem], graze: BranchPoint) -> bool:
    """Whether the one point explains the whole difference: motions on both sides of it have the neighbours' events.

    The point itself has the events of one side; the other side is looked at.
    """
    problem, a, b, share = step.problem, step.a, step.b, step.share(graze)
    if problem.same_events(a, graze):
        near, other = step.point_at(share + PAST_GRAZING * (1.0 - share), (share, graze, 1.0, b)), b
    elif problem.same_events(graze, b):
        near, other = step.point_at(share * (1.0 - PAST_GRAZING), (0.0, a, share, graze)), a
    else:
        return False
    return near is not None and problem.same_events(near, other)


AT_BOUNDARY = 1e-5  # distance of a multiplier from where a located point says that it is
FIRST_AMPLITUDE = 0.01  # of a motion of another branch next to the one that it leaves, over that one's size


def _doubling(mu: Complexes) -> Complexes:
    """Numbers of which one vanishes where a multiplier is -1."""
    return np.asarray((1.0 + mu) / (1.0 + np.abs(mu)))


def _turning(mu: Complexes) -> Complexes:
    """Numbers of which one vanishes where two multipliers have the product 1."""
    i, j = np.triu_indices(mu.size, 1)
    pair = mu[i] * mu[j]
    return np.asarray((pair - 1.0) / (1.0 + np.abs(pair)))


def _vanishes(step: BranchStep[OrbitProblem], test_numbers: Callable[[Complexes], Complexes]) -> BranchPoint | None:
    """The point at which the product of the test numbers vanishes, relative to its value at the left end."""

    def logarithm(point: BranchPoint) -> complex:
        with np.errstate(divide="ignore"):
            return complex(np.log(test_numbers(step.problem.multipliers(point))).sum())

    size = logarithm(step.a).real
    return step.locate(lambda point: float(np.exp(logarithm(point) - size).real))


def special_points(step: BranchStep[OrbitProblem], failed: list[FailedSearch] | None = None) -> list[SpecialPoint]:
    """Folds, period doublings, Neimark–Sacker points, branch points and grazings on a step of a branch.

    A change of stability at a corner of the branch (grazing) is no bifurcation of a smooth family and is left to the
    grazing point. A grazing at which the branch turns back, without a multiplier 1, is a nonsmooth fold. Among free
    motions there are no period doublings and Neimark–Sacker points in this sense.

    Parameters
    ----------
    step : of a branch.
    failed : searches that end in a numerical error are appended to it, and the others go on.

    Returns
    -------
    The points, grazings first.

    Raises
    ------
    ArithmeticError : where a search fails, and there is no list for it.
    """
    special: list[SpecialPoint] = []
    problem, a, b = step.problem, step.a, step.b
    if not step.same_events:
        with record_failures("grazing", a, failed):
            # 200: motions looked at between two neighbours
            special.extend(grazings(step, iter(range(200))))
            # one-sided contacts that are made and lost in one motion and not in the other
            made = (set(problem.cycle(point)[1].event_contact.tolist()) for point in (a, b))
            alone = set.symmetric_difference(*made) - without_borders(problem.cycle(a)[0].system.contacts)
            if alone - {point.contact for point in special}:
                raise ArithmeticError("a contact begins between two neighbours, and no grazing was found")
    # every piece without corners, and the part of it
    parts: list[tuple[BranchStep[OrbitProblem], BranchStep[OrbitProblem]]] = []
    corners = {id(corner.point): corner.point for corner in special}.values()
    for x, y in pairwise([a, *sorted(corners, key=step.share), b]):
        with record_failures("neimark_sacker", a, failed):
            piece = step.sub_step(x, y)
            parts += [(piece, part) for part in _parts(piece, (x is not a, y is not b))]
    for piece, part in parts:
        if step.same_events:
            with record_failures("branch_point", a, failed):
                crossing = part.branch_point()
                if crossing is not None:
                    special.append(SpecialPoint("branch_point", crossing.parameter, crossing))
        if part.a.tangent[-1] * part.b.tangent[-1] < 0:
            with record_failures("fold", a, failed):
                _add_turn(special, part, piece)
        if problem.bifurcates:
            with record_failures("period_doubling", a, failed):  # or Neimark–Sacker point
                special += _changes_of_stability(part)
    return special


def _add_turn(points: list[SpecialPoint], step: BranchStep[OrbitProblem], piece: BranchStep[OrbitProblem]) -> None:
    """Add the fold on a step, or call the grazing a nonsmooth fold at which the branch turns instead.

    That is the one at an end of the piece without corners that the step belongs to.
    """
    fold = step.locate(lambda p: float(p.tangent[-1]))
    crossings = [step.share(e.point) for e in points if e.kind == "branch_point"]
    # 1e-3: of the step, within which it is a branch that turns where another one crosses it, in a pitchfork
    if fold is None or any(abs(step.share(fold) - at) < 1e-3 for at in crossings):
        return
    # 1e-3: of the tangent's part along the parameter at the neighbours: what a fold leaves of it
    if abs(float(fold.tangent[-1])) <= 1e-3 * min(abs(float(step.a.tangent[-1])), abs(float(step.b.tangent[-1]))):
        points.append(SpecialPoint("fold", fold.parameter, fold))
        return
    ends = [k for k, event in enumerate(points) if any(event.point is end for end in (piece.a, piece.b))]
    if not ends:
        raise ArithmeticError("the branch turns back at a corner that was not found")
    at = min(ends, key=lambda k: float(np.linalg.norm((points[k].point.u - fold.u) / fold.scale)))
    points[at] = replace(points[at], kind="nonsmooth_fold")


def _changes_of_stability(step: BranchStep[OrbitProblem]) -> Iterator[SpecialPoint]:
    """Period doublings and Neimark–Sacker points on a step without corners."""
    problem = step.problem
    before, after = _outside(problem.multipliers(step.a)), _outside(problem.multipliers(step.b))
    change = after - before
    if change[0]:
        if change[0] % 2:
            point = _vanishes(step, _doubling)
        else:  # of equal parts all at once, where no product changes its sign
            at = int(min(before[0], after[0]))
            point = step.locate(lambda p: _outside_unit_circle(problem.multipliers(p), at))
        if point is not None and np.min(np.abs(problem.multipliers(point) + 1.0)) < AT_BOUNDARY:
            yield SpecialPoint("period_doubling", point.parameter, point)
    if change[1:].any():
        if change[1] == change[2]:  # by the pair's own size: the product vanishes at real pairs of product 1 as well
            at = int(min(before[1], after[1]))
            point = step.locate(lambda p: _size_of_complex(problem.multipliers(p), at) - 1.0)
        else:
            point = _vanishes(step, _turning)
        if point is not None:
            mu = problem.multipliers(point)
            circle = np.abs(np.abs(mu) - 1.0) < 0.1 * AT_BOUNDARY
            if np.any(circle & (np.abs(mu.imag) > 0.1 * AT_BOUNDARY)):
                yield SpecialPoint("neimark_sacker", point.parameter, point)


def _size_of_complex(mu: Complexes, number: int) -> float:
    """Modulus of the complex multiplier of a number, by size from 0 on; 0 of none."""
    size = np.sort(np.abs(mu[_complex(mu)]))[::-1]
    return float(size[number]) if size.size > number else 0.0


def _outside_unit_circle(mu: Complexes, number: int) -> float:
    """Distance outside the unit circle of a real negative multiplier, numbered by size from 0; -1 if there is none."""
    size = np.sort(np.abs(mu[~_complex(mu) & (mu.real < 0.0)]))[::-1]
    return float(size[number]) - 1.0 if size.size > number else -1.0


REAL_MULTIPLIER = 1e-10  # of a multiplier, up to which its imaginary part is round-off


def _complex(mu: Complexes) -> Bools:
    """Which multipliers are not real; equal ones are complex by round-off."""
    return np.asarray(np.abs(mu.imag) > REAL_MULTIPLIER * np.abs(mu))


def _outside(mu: Complexes) -> Ints:
    """(3,) numbers of multipliers outside the unit circle: real negative ones, complex ones, all."""
    out, turning = np.abs(mu) > 1.0, _complex(mu)
    return np.array([(out & ~turning & (mu.real < 0)).sum(), (out & turning).sum(), out.sum()])


def _parts(step: BranchStep[OrbitProblem], corner: tuple[bool, bool]) -> Iterator[BranchStep[OrbitProblem]]:
    """A step, or two parts of it where a pair of special points may hide between its ends.

    Two folds: where the parameter's cubic through both ends with their tangents turns, though both ends point the same
    way. Two period doublings, or two Neimark–Sacker points: where a multiplier close to -1, or a complex one to the
    unit circle, stays inside, or outside, at both ends. Next to a grazing point (``corner``, for either end)
    multipliers change with the square root of the distance: the motion a quarter away is half-way between them.
    """
    problem, a, b = step.problem, step.a, step.b
    if a is b:
        return
    share, corner = _hidden_turn(a, b), corner if problem.bifurcates else (False, False)
    if share is None and any(corner):
        share = 0.5 if all(corner) else 0.25 if corner[0] else 0.75
    elif share is None and problem.bifurcates:
        for mu in (problem.multipliers(a), problem.multipliers(b)):
            turning = mu[np.abs(mu.imag) > AT_BOUNDARY]
            # 0.1: distance of a multiplier within which a step is looked into for a pair of period doublings
            # 0.02: relative distance of complex multipliers and of two Neimark–Sacker points
            if np.any(np.abs(mu + 1.0) < 0.1) or np.any(np.abs(np.abs(turning) - 1.0) < 0.02):
                share = 0.5
    middle = None if share is None else step.point_at(share)
    if middle is None:
        yield step
        return
    for half in (step.sub_step(a, middle), step.sub_step(middle, b)):
        if any(corner):
            yield from _parts(half, (False, False))
        else:
            yield half


def _hidden_turn(a: BranchPoint, b: BranchPoint) -> float | None:
    """Where the parameter's cubic over a step has its extreme slope, if that is of another sign than both ends'."""
    scale = a.scale
    at_a, at_b = float(a.tangent[-1]), float(b.tangent[-1] * b.scale[-1] / scale[-1])
    if at_a * at_b <= 0:
        return None
    mean = float((b.u[-1] - a.u[-1]) / scale[-1]) / float(np.linalg.norm((b.u - a.u) / scale))
    bend = 3.0 * (at_a + at_b) - 6.0 * mean  # the slope is left + (…) x + bend x^2
    if bend == 0.0:
        return None
    x = (2.0 * at_a + at_b - 3.0 * mean) / bend
    if not 0.0 < x < 1.0 or (at_a - bend * x**2) * at_a > 0:
        return None
    return x


def correct_on_other_branch(
    problem: ContinuationProblem, u: Floats, row: Floats, sizes: Sequence[float], settings: Settings
) -> Iterator[BranchPoint]:
    """Motions of another branch, at given distances from a motion in a direction; their tangents point away from it.

    Parameters
    ----------
    problem : of the other branch.
    u : (n,) unknowns of the motion, as a point of this problem.
    row : (n,) unit vector in scaled unknowns.
    sizes : distances to try in turn, in scaled unknowns; where Newton's method does not converge, there is no motion.
    settings : tolerances.

    Returns
    -------
    The motions, for one size after the other.
    """
    scale = problem.scale(u)[0]
    for size in sizes:
        guess = u + size * row * scale
        # 10.0: how far the unknowns may move while the first amplitude is held, in units of it
        point = correct(problem, Predictor(guess, row, scale, row, largest_distance=10.0 * size), settings)
        if point is not None:
            yield point


def switch_at_period_doubling(problem: ForcedOrbits, special: SpecialPoint) -> tuple[ForcedOrbits, BranchPoint] | None:
    """The first motion of the branch of doubled period that leaves at a period doubling.

    The eigenvector of the multiplier -1, `FIRST_AMPLITUDE` times the motion's size, is added to the state; Newton then
    finds the parameter that belongs to this distance from the old branch. Its tangent points away from the old
    branch.
    """
    flow = problem.flow.with_loads(problem.omega, problem.level)
    doubled = replace(problem, flow=flow, multiple=2 * problem.multiple)
    mu, vectors = np.linalg.eig(special.point.data.transition)
    v = vectors[:, int(np.argmin(np.abs(mu + 1.0)))].real
    row = np.append(v, 0.0) / doubled.scale(special.point.u)[0]
    sizes = [factor * FIRST_AMPLITUDE for factor in (1.0, 0.1, 0.01, 5.0)]
    first = correct_on_other_branch(doubled, special.point.u, row / np.linalg.norm(row), sizes, Settings(iterations=15))
    return next(((doubled, point) for point in first), None)


def switch_at_branch_point(problem: ForcedOrbits, special: SpecialPoint, chord: Floats) -> list[BranchPoint]:
    """The first motions to both sides of the branch that crosses at a branch point, with tangents that point away.

    There the Jacobian has a kernel of two dimensions: the tangent, and the direction in which the other branch leaves.
    No tangent is defined by the Jacobian alone.

    Parameters
    ----------
    problem : of both branches.
    special : the branch point.
    chord : (n,) difference of the unknowns between its neighbours on the branch that is known.

    Returns
    -------
    Up to two motions.
    """
    u = special.point.u
    scale, residual_scale = problem.scale(u)
    kernel = np.linalg.svd(problem.residual(u)[1] * scale / residual_scale[:, None])[2][-2:]
    along = kernel @ (chord / scale)
    across = np.array([-along[1], along[0]]) @ kernel
    across /= np.linalg.norm(across)
    sizes = [factor * FIRST_AMPLITUDE for factor in (1.0, 0.1, 5.0)]
    sides = (correct_on_other_branch(problem, u, row, sizes, Settings(iterations=15)) for row in (across, -across))
    return [point for first in sides if (point := next(first, None)) is not None]
