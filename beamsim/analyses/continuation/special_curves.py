"""Curves of special points of a response in a second parameter, and the isolas that their extremes show.

Curves of folds are the border of the region with several motions; the defining equations are those of
:mod:`beamsim.orbits.special_curves`. Where a curve of folds turns back in the second parameter, a closed curve of
motions may begin that no motion at another value leads to (isola).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamsim.errors import ScenarioError
from beamsim.labelled import Dataset
from beamsim.orbits.branch import (
    BranchPoint,
    FailedSearch,
    OrbitBranch,
    SpecialKind,
    SpecialPoint,
    record_failures,
    special_name,
    with_failed_searches,
)
from beamsim.orbits.continuation import CLOSED_CURVE, Branch, BranchStep, Settings, correct_across
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.special_curves import (
    STRONG_RESONANCES,
    CurveEvent,
    CurveProblem,
    angle_of,
    events_between,
    mirror_error,
    start_of_curve,
)
from beamsim.orbits.tracing import Budget, join_directions, walk
from beamsim.outcomes import Outcome, OutcomeKind, Where, both_directions
from beamsim.responses.parameters import FollowedParameter, ResponseModel
from beamsim.responses.periodic_motion import Measurement
from beamsim.results.branch import (
    SPECIAL_CURVE_EVENTS,
    SPECIAL_CURVE_POINTS,
    SPECIAL_CURVES,
    endings,
    numbered_points,
    of_states,
    row_numbers,
)
from beamsim.results.values import DISPLACEMENT
from beamsim.structures.assembly import snubber_site
from beamsim.typing import Floats, not_none

SETTINGS = Settings(tolerance=1e-11, most_points=600)  # of one curve, in each direction
ISOLA_SETTINGS = Settings(step=5e-3, largest_step=0.02, most_points=2000)  # a closed curve may be small
CORNER = 1e-5  # relative frequency distance within which a fold coincides with a grazing
SAME = 1e-6  # relative distance within which a special point lies on a known curve
OF_STEP = 0.05  # error of an interpolated frequency, relative to the step
AT_EDGE = 1e-9  # relative distance from an end of the range within which a curve begins there
NOT_SYMMETRIC = 1e-6  # of `mirror_error`, above which a motion does not repeat with the opposite sign
TOO_CLOSE = Outcome.of(
    OutcomeKind.STOPPED, "corner_too_close", "the special point is too close to a corner of the curve"
)
LARGEST_FREQUENCY_RATIO = 3.0  # ratio by which the frequency may leave its original range
INTO_ISOLA = 0.05  # of the way back to the extreme before, or to the start, at which an isola is followed


@dataclass(frozen=True)
class SpecialCurve:
    """Curve of np special points of one kind in frequency and a second parameter, or the motions of an isola."""

    kind: str  # of the special points, or isola
    level: float  # of the excitation; NaN if it is the second parameter
    branch: int  # index of the branch with the special point
    start_hz: float  # of that point
    touching: str  # contact that grazes along the whole curve; empty for other kinds
    outcome: Outcome
    frequency_hz: Floats  # (np,)
    parameter: Floats  # (np,) second parameter, SI
    residual: Floats  # (np,)
    states: Floats  # (np, N)
    peak: Floats  # (np, probes) largest displacements in a period, m
    angle: Floats  # (np,) of the multipliers on the unit circle, rad
    events: tuple[tuple[str, float, float], ...] = ()  # kind, frequency in Hz, and second parameter in SI units
    passes_hz: tuple[tuple[float, float], ...] = ()  # frequencies at the scenario's own value, with their errors


class _Start(NamedTuple):
    """Start of a curve."""

    orbits: ForcedOrbits
    point: SpecialPoint  # a grazing, if a fold lies on one
    kind: str
    branch: int  # index of the branch with the point
    hz: float  # of the fold itself, if it lies on a grazing


def follow_special_points(
    model: ResponseModel, branches: list[OrbitBranch], level: float, budget: Budget
) -> list[SpecialCurve]:
    """Continue the requested special points of branches with the period of the excitation, each curve once.

    Parameters
    ----------
    model : response model with the second parameter.
    branches : branches in frequency, with their special points.
    level : level of the excitation on these branches.
    budget : limits of points and time.

    Returns
    -------
    list
        In the order of the branches, each curve before its isolas; a curve has no points if its special point is too
        close to a corner.

    Raises
    ------
    ScenarioError
        If branch points are to be followed, and no symmetry preserves one.
    """
    curves: list[SpecialCurve] = []
    present = _value_in_scenario(model, level)
    for start in _starts(model, branches):
        touching = model.system.contact_names[start.point.contact] if start.point.contact >= 0 else ""
        known = [curve for curve in curves if curve.touching == touching and (touching or curve.kind == start.kind)]
        hz = start.hz
        if budget.exhaustion() or any(abs(at - hz) <= off for curve in known for at, off in curve.passes_hz):
            continue
        curves += _curves(model, start, (level, present), budget)
    return curves


def _starts(model: ResponseModel, branches: list[OrbitBranch]) -> Iterator[_Start]:
    """Special points of the requested kinds on branches with the period of the excitation."""
    kinds = model.settings.follow_points
    for index, branch in enumerate(branches):
        if branch.problem.multiple != 1:
            continue
        for point in branch.special:
            hz = point.parameter / (2 * np.pi)
            if point.kind == "nonsmooth_fold" and "fold" in kinds:
                yield _Start(branch.problem, point, point.kind, index, hz)
            elif point.kind in kinds:
                grazing = _grazing_at(branch, point) if point.kind == "fold" else None
                kind = point.kind if grazing is None else "nonsmooth_fold"
                yield _Start(branch.problem, grazing or point, kind, index, hz)


def _grazing_at(branch: OrbitBranch, fold: SpecialPoint) -> SpecialPoint | None:
    """Grazing that coincides with a fold, where a stiff stop turns the curve back; None if there is none."""
    for other in branch.special:
        if other.kind == "grazing" and abs(other.parameter - fold.parameter) <= CORNER * fold.parameter:
            off = np.linalg.norm(((other.point.u - fold.point.u) / fold.point.scale)[:-1])
            if off <= np.sqrt(CORNER):
                return other
    return None


def omissions(model: ResponseModel, curves: Sequence[SpecialCurve]) -> Iterator[Outcome]:
    """Outcomes for kinds that are to be followed, and of which the branches have no point, and for early ends.

    Parameters
    ----------
    model : response model.
    curves : of all levels.
    """
    if model.second is None:
        return
    found = {"fold" if curve.kind == "nonsmooth_fold" else curve.kind for curve in curves}
    # where a stop turns the curve back, its grazing is followed as a fold
    if any(curve.kind == "nonsmooth_fold" for curve in curves):
        found.add("grazing")
    if missing := [special_name(kind) for kind in model.settings.follow_points if kind not in found]:
        sentence = f"no {' and no '.join(missing)} was found that could be followed in the {model.second.kind}"
        yield Outcome.of(OutcomeKind.NOTED, "no_special_point", sentence)
    early = [curve for curve in curves if not curve.outcome.complete]
    if early:
        first = early[0]
        what = (
            f"{len(early)} of {len(curves)} curves of special points ended early; the first ({special_name(first.kind)}"
        )
        sentence = f"{what} from {first.start_hz:.6g} Hz): {first.outcome.of_part}"
        yield Outcome.of(OutcomeKind.NOTED, "special_curve_ended", sentence, curves=len(early))


def _value_in_scenario(model: ResponseModel, level: float) -> float:
    """Value of the second parameter in the scenario."""
    second = not_none(model.second)
    if second.kind == "level":
        return level
    index = not_none(second.moved_snubber).contacts[0]
    if second.kind == "position":
        return snubber_site(model.scenario.located_snubbers[index]).coordinate
    contacts = model.system.dynamics.contacts
    return float(contacts.gap[index]) if second.kind == "gap" else contacts.laws[index].stiffness


def _at_value(half: OrbitBranch, value: float) -> Iterator[BranchPoint]:
    """Points of one direction of a curve at a value of the second parameter's unknown."""
    for a, b in pairwise(half.points):
        if a.parameter == value:
            yield a
        elif (a.parameter - value) * (b.parameter - value) < 0.0:
            with suppress(ArithmeticError, np.linalg.LinAlgError):
                point = BranchStep(half.problem, a, b, SETTINGS).locate(lambda point: point.parameter - value)
                if point is not None:
                    yield point


def _passes(half: OrbitBranch, value: float) -> Iterator[tuple[float, float]]:
    """Frequencies, Hz, at a value of the second parameter's unknown, with their errors; from the chord if need be."""
    for a, b in pairwise(half.points):
        if (a.parameter - value) * (b.parameter - value) > 0.0:
            continue
        exact = next(_at_value(replace(half, points=(a, b)), value), None)
        low, high = (float(point.u[-2]) / (2 * np.pi) for point in (a, b))
        if exact is not None:
            yield float(exact.u[-2]) / (2 * np.pi), SAME * low
        elif a.parameter != b.parameter:
            share = (value - a.parameter) / (b.parameter - a.parameter)
            yield low + share * (high - low), SAME * low + OF_STEP * abs(high - low)


def _curves(
    model: ResponseModel, start: _Start, level_and_present: tuple[float, float], budget: Budget
) -> Iterator[SpecialCurve]:
    """Curve through a special point, and the isolas at its extremes if they are requested.

    Parameters
    ----------
    model, start, budget : see `follow_special_points`.
    level_and_present : level, and value of the second parameter, at which the special point was found.
    """
    level, present = level_and_present
    second = not_none(model.second)
    halves = _both_directions(model, start, present, budget)
    # the traced points come first, so that they are stored
    ordered = sorted(halves, key=lambda half: not half[0].points)
    followed = join_directions(*(half for half, _ in ordered))
    events = [event for _, of_half in halves for event in of_half]
    curve = _measured(
        model, start, followed, level if second.kind != "level" else float("nan"),
        outcome=both_directions(halves[-1][0].outcome, halves[0][0].outcome),
    )  # fmt: skip
    places = [
        (event.kind, float(event.point.u[-2]) / (2 * np.pi), float(second.from_unknown(event.point.parameter)))
        for event in events
    ]
    own = second.to_unknown(present)
    passes = tuple(place for half, _ in halves for place in _passes(half, own))
    yield replace(curve, events=tuple(places), passes_hz=passes)
    if not model.settings.follow_isolas:
        return
    for half, of_half in halves:
        for event in of_half:
            if event.kind == "isola" and not budget.exhaustion():
                yield from _isola(model, start, (half, event), curve.level, budget)


def _measured(
    model: ResponseModel, start: _Start, followed: OrbitBranch, level: float, outcome: Outcome,
    isola_at: float | None = None,
) -> SpecialCurve:  # fmt: skip
    """A curve with the largest displacements of its motions.

    Parameters
    ----------
    model, start : see `follow_special_points`.
    followed : points of the curve, or of an isola, whose unknowns end with the frequency.
    level : of the excitation; NaN if it is the second parameter.
    outcome : of the curve.
    isola_at : unknown of the second parameter of an isola.
    """
    second, points, grazes = not_none(model.second), followed.points, start.point.contact >= 0
    n, at = start.orbits.flow.size, -2 if isola_at is None else -1
    unknown = np.array([p.parameter if isola_at is None else isola_at for p in points])

    def system(reference: Any, value: float) -> Any:
        return second.system(reference, value if isola_at is None else isola_at)

    measurement = Measurement(
        model.system,
        model.scenario.sine,
        model.system.channels.of_keys(DISPLACEMENT),
        system_at=None if second.moved_snubber is None else system,
    )
    peaks = [motion.peak for motion in measurement.of(followed.problem, points)]
    equation = None if isola_at is not None or not points else followed.problem.equation
    return SpecialCurve(
        kind=start.kind if isola_at is None else "isola",
        level=level,
        branch=start.branch,
        start_hz=start.hz,
        touching=model.system.contact_names[start.point.contact] if grazes and isola_at is None else "",
        outcome=second.in_user_unit(outcome) if isola_at is None else _in_hertz(outcome),
        frequency_hz=np.array([p.u[at] for p in points]) / (2 * np.pi),
        parameter=np.array([float(second.from_unknown(value)) for value in unknown]),
        residual=np.array([p.residual for p in points]),
        states=np.array([p.u[:n] for p in points]).reshape(len(points), n),
        peak=np.array(peaks).reshape(-1, len(model.system.probes)),
        angle=np.array([np.nan if equation is None else angle_of(equation, p.u, n) for p in points]),
    )


def _in_hertz(outcome: Outcome) -> Outcome:
    """An outcome whose place is an angular frequency."""
    return outcome.in_unit(lambda omega: omega / (2 * np.pi), "Hz")


def _both_directions(
    model: ResponseModel, start: _Start, present: float, budget: Budget
) -> list[tuple[OrbitBranch, list[CurveEvent]]]:
    """Both directions of a curve from the present value of the second parameter; one from an end of the range."""
    second, orbits = not_none(model.second), start.orbits
    path: Any = "level" if second.kind == "level" else second.path(orbits.flow)
    low, high = sorted((second.to_unknown(second.first), second.to_unknown(second.last)))
    halves: list[tuple[OrbitBranch, list[CurveEvent]]] = []
    for direction, edge in ((1.0, high), (-1.0, low)):
        if abs(second.to_unknown(present) - edge) < AT_EDGE * max(abs(edge), 1.0):
            continue
        if halves and halves[0][0].outcome.code == CLOSED_CURVE:
            break
        begun = None
        with suppress(ArithmeticError, np.linalg.LinAlgError):
            begun = start_of_curve(orbits, start.point, path, second.to_unknown(present), direction)
        if begun is None:
            halves.append((OrbitBranch(None, (), TOO_CLOSE), []))
            continue
        curve, first = begun
        half = walk(
            Branch(curve, first, low, high, SETTINGS), budget, _Ends(model, curve, start.point.parameter),
            with_special=False,
        )  # fmt: skip
        halves.append(_with_events(half, start.point.kind))
    return halves


@dataclass
class _Ends:
    """Test of whether a curve ends at a point: far away in frequency, at a strong resonance, or without symmetry."""

    model: ResponseModel
    curve: CurveProblem
    omega: float  # rad/s, where the curve starts
    last_cosine: float = float("nan")

    def __call__(self, point: BranchPoint) -> Outcome | None:
        """The outcome with which a point ends the curve; None if it goes on.

        Raises
        ------
        ScenarioError
            If a branch point loses the symmetry that preserves it.
        """
        at, equation = float(point.u[-2]), self.curve.equation
        if equation.half_period and mirror_error(self.curve, point) > NOT_SYMMETRIC:
            raise self.model.scenario.located(
                ScenarioError.at(
                    "sweep.follow_points",
                    f"asks for branch points, but no symmetry preserves the one at {at / (2 * np.pi):.6g} Hz: the "
                    "motion does not repeat with the opposite sign after half a period, and where a second parameter "
                    "varies, its branches separate into folds",
                    "follow folds instead, or vary what keeps the symmetry, such as the gap of a pair of stops",
                )
            )
        if not self.omega / LARGEST_FREQUENCY_RATIO < at < self.omega * LARGEST_FREQUENCY_RATIO:
            return Outcome.of(
                OutcomeKind.STOPPED, "left_range", f"a factor of {LARGEST_FREQUENCY_RATIO:g} from where it started",
                at=Where(at / (2 * np.pi), "Hz"),
            )  # fmt: skip
        if not equation.further.size:
            return None
        before, self.last_cosine = self.last_cosine, float(point.u[self.curve.n])
        for kind, cosine in STRONG_RESONANCES.items():
            if (before - cosine) * (self.last_cosine - cosine) <= 0.0:
                ratio = kind.removeprefix("resonance_").replace("_", ":")
                return Outcome.of(
                    OutcomeKind.COMPLETE, kind, f"reached the strong resonance {ratio}", at=point.parameter
                )  # fmt: skip
        return None


def _with_events(half: OrbitBranch, kind: SpecialKind) -> tuple[OrbitBranch, list[CurveEvent]]:
    """One direction of a curve of one kind with its special points among the others; a strong resonance is its end."""
    events: list[CurveEvent] = []
    failed: list[FailedSearch] = []
    points, outcome = list(half.points[:1]), half.outcome
    for a, b in pairwise(half.points):
        step: BranchStep[CurveProblem] = BranchStep(half.problem, a, b, SETTINGS)
        with record_failures(kind, a, failed):
            found = sorted(events_between(step), key=lambda event: step.share(event.point))
            events += found
            points += [event.point for event in found if event.point is not b]
            if found and found[-1].kind in STRONG_RESONANCES:
                outcome = replace(outcome, place=Where(found[-1].point.parameter))
                continue
        points.append(b)
    return replace(half, points=points, outcome=with_failed_searches(outcome, failed)), events


def _isola(
    model: ResponseModel, start: _Start, extreme: tuple[OrbitBranch, CurveEvent], level: float, budget: Budget
) -> Iterator[SpecialCurve]:
    """The closed curve of motions next to the extreme at which it begins.

    Parameters
    ----------
    model, start, budget : see `follow_special_points`.
    extreme : one direction of the curve of folds, and the extreme on it; the isola is followed at a value on the way
        back to the extreme before, or to where the curve starts.
    level : of the excitation; NaN if it is the second parameter.
    """
    half, event = extreme
    number = next(k for k, point in enumerate(half.points) if point is event.point)
    turns = [k for k in range(1, number) if half.points[k].tangent[-1] * half.points[k - 1].tangent[-1] < 0.0]
    before, born = half.points[max(turns, default=0)].parameter, event.point.parameter
    value, omega = born + INTO_ISOLA * (before - born), start.point.parameter
    *_, fold = None, *_at_value(replace(half, points=half.points[: number + 1]), value)
    first = None
    if fold is not None:
        problem = ForcedOrbits(half.problem.flow_at(fold.u)[0], multiple=start.orbits.multiple)
        first = correct_across(problem, fold.u[:-1], Settings(iterations=15))
    if first is None:
        yield _measured(model, start, OrbitBranch(None, (), TOO_CLOSE), level, TOO_CLOSE, isola_at=value)
        return
    reach = omega / LARGEST_FREQUENCY_RATIO, omega * LARGEST_FREQUENCY_RATIO
    followed = walk(Branch(problem, first, *reach, ISOLA_SETTINGS), budget, lambda _: None, with_special=False)
    yield _measured(model, start, followed, level, followed.outcome, isola_at=value)


def _curve_columns(curves: Sequence[SpecialCurve], second: FollowedParameter) -> dict[str, Any]:
    """Values of whole curves."""
    return {
        "special_curve": np.arange(len(curves)),
        "kind": [curve.kind for curve in curves],
        "level": [curve.level for curve in curves],
        "branch": [curve.branch for curve in curves],
        "start_hz": [curve.start_hz for curve in curves],
        "touching": [curve.touching for curve in curves],
        "followed": second.kind,
        "followed_snubber": second.snubber,
        **endings(curve.outcome for curve in curves),
    }


def special_curve_datasets(model: ResponseModel, curves: Sequence[SpecialCurve]) -> dict[str, Dataset]:
    """Datasets of curves of special points, their points and their events, by name; empty without curves.

    Parameters
    ----------
    model : response model with the second parameter.
    curves : the curves.
    """
    if not curves:
        return {}
    second, system = not_none(model.second), model.system
    values = {
        **numbered_points([curve.parameter.size for curve in curves], "special_curve"),
        **of_states(np.concatenate([curve.states for curve in curves]), system.dynamics.size),
        **{
            name: np.concatenate([getattr(curve, name) for curve in curves])
            for name in ("frequency_hz", "parameter", "residual", "angle")
        },
        "probe": [probe.name for probe in system.probes],
        "peak_displacement": np.concatenate([curve.peak for curve in curves]).T,
    }
    owner = row_numbers([len(curve.events) for curve in curves], "special_curve")["special_curve"]
    events = [event for curve in curves for event in curve.events]
    kinds, frequencies, parameters = zip(*events, strict=True) if events else ((), (), ())
    places = {
        "event": np.arange(1, len(events) + 1), "special_curve": owner, "kind": list(kinds),
        "frequency_hz": list(frequencies), "parameter": list(parameters),
    }  # fmt: skip
    parameter = f"second parameter: {second.kind} {second.snubber}".strip()
    about = _curve_columns(curves, second)
    return {
        "special_curves": SPECIAL_CURVES.dataset(about, level_unit=model.scenario.level_unit or "1"),
        "special_curve_points": SPECIAL_CURVE_POINTS.dataset(values, unit=second.unit, parameter=parameter),
        "special_curve_events": SPECIAL_CURVE_EVENTS.dataset(places, unit=second.unit),
    }
