"""Fold curves of a response in a second parameter: the border of the region with several motions.

The unknowns are the state, the frequency and the second parameter. A fold satisfies the shooting equations
:math:`R = 0` and the scalar equation :math:`g = 0` of the bordered system

.. math:: \\begin{pmatrix} M - I & b \\\\ c^T & 0 \\end{pmatrix} \\begin{pmatrix} v \\\\ g \\end{pmatrix} =
          \\begin{pmatrix} 0 \\\\ 1 \\end{pmatrix},

which vanishes exactly where M has a multiplier 1 (W. Govaerts, *Numerical Methods for Bifurcations of Dynamical
Equilibria*, 2000).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from beamsim.flow.periodic_flow import ContactDirection, FlowMap, Frequency, Parameter, PeriodicFlow
from beamsim.labelled import Dataset
from beamsim.orbits.branch import BranchPoint, OrbitBranch, SpecialPoint
from beamsim.orbits.continuation import Branch, Settings, solve_at
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.special_points import lowest
from beamsim.orbits.tracing import Budget, join_directions, walk
from beamsim.outcomes import Outcome, OutcomeKind, Where, both_directions
from beamsim.responses.parameters import ResponseModel
from beamsim.responses.periodic_motion import Measurement
from beamsim.results.branch import FOLD_CURVES, FOLD_POINTS, endings, numbered_points, of_states
from beamsim.results.values import DISPLACEMENT
from beamsim.structures.assembly import snubber_site
from beamsim.typing import Floats, not_none

SecondParameter = Literal["level"] | Callable[[float], tuple[PeriodicFlow, ContactDirection]]
SETTINGS = Settings(tolerance=1e-9, most_points=600)  # of one curve, in each direction
CORNER = 1e-5  # relative frequency distance within which a fold coincides with a grazing
SAME = 1e-6  # relative distance within which a fold lies on a known curve
AT_EDGE = 1e-9  # relative distance from an end of the range within which a curve begins there
TOO_CLOSE = Outcome.of(OutcomeKind.STOPPED, "corner_too_close", "the fold is too close to a corner of the curve")
LARGEST_FREQUENCY_RATIO = 3.0  # ratio by which the frequency may leave its original range


@dataclass(frozen=True)
class FoldPath:
    """Curve of np folds, or of grazings, in frequency and a second parameter."""

    level: float  # of the excitation; NaN if it is the second parameter
    branch: int  # index of the branch with the fold
    start_hz: float  # of that fold
    touching: str  # contact that grazes along the whole curve; empty for a fold
    outcome: Outcome
    frequency_hz: Floats  # (np,)
    parameter: Floats  # (np,) second parameter, SI
    residual: Floats  # (np,)
    states: Floats  # (np, N)
    peak: Floats  # (np, probes) largest displacements in a period, m


@dataclass
class TwoParameterCurve:
    """Base of curves in frequency and a second parameter.

    The unknowns are those of the shooting problem (state, omega) and the second parameter.
    """

    orbits: ForcedOrbits  # in frequency
    second_parameter: SecondParameter

    def __post_init__(self) -> None:
        self._along = ForcedOrbits(self.orbits.flow, self.second_parameter, self.orbits.multiple)
        self._along.level = self.orbits.level

    def flow_at(self, u: Floats) -> tuple[PeriodicFlow, tuple[Parameter, Parameter]]:
        """Flow at both parameters, and the parameters as perturbations."""
        self._along.omega = float(u[-2])
        if self._along.omega <= 0:
            raise ArithmeticError("the frequency became negative")
        flow, parameter = self._along.flow_at(float(u[-1]))
        return flow, (Frequency(), parameter)

    def shoot(self, u: Floats) -> tuple[Floats, Floats, FlowMap]:
        """Shooting residual (N,), its Jacobian (N, N + 2), and the flow map."""
        flow, parameters = self.flow_at(u)
        return self._along.shoot(flow, u[:-2], parameters)

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """True always: curves in two parameters are continued without a test for corners."""
        return True

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, FlowMap]:
        """Flow at a point, and its motion over a period."""
        return self.flow_at(point.u)[0], point.data

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Scales of the unknowns and of the equations; the additional equation has scale 1."""
        scale, residual = self.orbits.scale(u[:-1])
        return np.append(scale, max(abs(u[-1]), 1e-12)), np.append(residual, 1.0)


STEP_ALONG = 1e-6  # of a finite difference, relative to the scale of the unknowns


@dataclass
class FoldCurve(TwoParameterCurve):
    """Continuation problem of a curve of folds."""

    border: tuple[Floats, Floats]  # b and c, unit vectors in scaled unknowns

    def residual(self, u: Floats) -> tuple[Floats, Floats, FlowMap]:
        """Shooting residual and g, with their Jacobian.

        Since second derivatives are symmetric, the row of g follows from the change of the first derivatives along the
        direction v: a central difference of two motions, for a model of any size.
        """
        R, A, flow_map = self.shoot(u)
        scale = self.scale(u)[0]
        k = R.size
        s = scale[:k]
        bordered = np.zeros((k + 1,) * 2)
        bordered[:-1, :-1] = A[:, :k] * s / s[:, None]
        bordered[:-1, -1], bordered[-1, :-1] = self.border
        last = np.zeros(k + 1)
        last[-1] = 1.0
        right, left = np.linalg.solve(bordered, last), np.linalg.solve(bordered.T, last)
        # of the derivative -w^T dA v of g in the unknowns' own units
        g, w, v = float(right[-1]), left[:-1] / s, right[:-1] * s
        step = STEP_ALONG / float(np.linalg.norm(v / s))
        h = np.append(v * step, np.zeros(2))
        change = self.shoot(u + h)[1] - self.shoot(u - h)[1]
        return np.append(R, g), np.vstack([A, -w @ change / (2.0 * step)]), flow_map


@dataclass
class GrazingCurve(TwoParameterCurve):
    """Continuation problem of a curve of motions that just touch a stop.

    If a stiff stop turns a response curve back, the fold nearly coincides with the grazing: the curve has a corner, and
    there is no smooth fold to continue. The border of the region with several motions is then the curve of grazings,
    where the extreme of the penetration is zero. The derivative of the extreme is that of the penetration at a fixed
    time, since the rate is zero at an extreme.
    """

    contact: int = 0
    from_below: bool = True  # True if the penetration reaches the border from below
    period_share: float = 0.0  # position in the period near which the extreme is searched
    level: float = 0.0  # m, penetration at the border

    def residual(self, u: Floats) -> tuple[Floats, Floats, FlowMap]:
        """Shooting residual and the extreme of the penetration, with their Jacobian."""
        R, A, flow_map = self.shoot(u)
        flow, parameters = self.flow_at(u)
        guard = np.zeros(flow.system.contacts.arrays.guard.shape[-1])  # positive next to the border
        guard[[0, 2]] = (-1.0, self.level) if self.from_below else (1.0, -self.level)
        height, time = lowest(flow, flow_map, self.contact, guard, self.period_share * flow_map.duration)
        if not np.isfinite(height):
            raise ArithmeticError("the penetration has no extreme near the grazing")
        self.period_share = time / flow_map.duration
        touch = flow.flow_map(flow_map.start, time, parameters)
        by_start, by_parameters = flow.penetration_derivative(touch, self.contact, parameters)
        return np.append(R, height / guard[0]), np.vstack([A, np.append(by_start, by_parameters)]), flow_map

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """As for a curve of folds; the extreme is scaled by the motion."""
        scale, residual = super().scale(u)
        residual[-1] = scale[0]
        return scale, residual


def start_of_curve(
    orbits: ForcedOrbits, special_point: SpecialPoint, second: SecondParameter, value: float, sign: float = 1.0
) -> tuple[FoldCurve | GrazingCurve, BranchPoint] | None:
    """Curve of folds, or of grazings, through a located point, starting at its value of the second parameter.

    Parameters
    ----------
    orbits : shooting problem in frequency.
    special_point : fold on a branch of the problem; for a curve of grazings a grazing or nonsmooth fold.
    second : the second parameter.
    value : value of the second parameter on that branch.
    sign : 1 to continue to larger values, -1 to smaller ones.

    Returns
    -------
    The problem and its first point; None if Newton's method does not converge.
    """
    curve: FoldCurve | GrazingCurve
    if special_point.kind == "fold":
        scale = orbits.scale(special_point.point.u)[0][:-1]
        A = special_point.point.data.transition - np.eye(orbits.flow.size)
        U, _, V = np.linalg.svd(A * scale / scale[:, None])
        curve = FoldCurve(orbits, second, (U[:, -1], V[-1]))
    else:
        curve = GrazingCurve(
            orbits,
            second,
            special_point.contact,
            special_point.top,
            special_point.time / special_point.point.data.duration,
            special_point.level,
        )
    settings = Settings(tolerance=1e-9, iterations=12)
    point = solve_at(curve, np.append(special_point.point.u, value), settings, value, sign)
    return None if point is None else (curve, point)


class _Corner(NamedTuple):
    """Start of a curve of folds."""

    orbits: ForcedOrbits
    fold: SpecialPoint
    grazing: SpecialPoint | None  # the grazing on which the fold lies
    branch: int  # index of the branch of both


def follow_folds(model: ResponseModel, branches: list[OrbitBranch], level: float, budget: Budget) -> list[FoldPath]:
    """Continue every fold of the branches with the period of the excitation, each curve once.

    Parameters
    ----------
    model : response model with the second parameter.
    branches : branches in frequency, with their special points.
    level : level of the excitation on these branches.
    budget : limits of points and time.

    Returns
    -------
    list
        In the order of the branches; a curve has no points if its fold is too close to a corner.
    """
    curves: list[FoldPath] = []
    for index, branch in enumerate(branches):
        if branch.problem.multiple != 1:
            continue
        for fold in (s for s in branch.special if s.kind in ("fold", "nonsmooth_fold")):
            if budget.exhaustion() or any(
                _passes_frequency(curve, fold.parameter, _value_in_scenario(model, level)) for curve in curves
            ):
                continue
            touching = fold if fold.kind == "nonsmooth_fold" else _grazing_at(branch, fold)
            curves.append(_curve(model, _Corner(branch.problem, fold, touching, index), level, budget))
    return curves


def _grazing_at(branch: OrbitBranch, fold: SpecialPoint) -> SpecialPoint | None:
    """Grazing that coincides with a fold, where a stiff stop turns the curve back; None if there is none."""
    for other in branch.special:
        if other.kind == "grazing" and abs(other.parameter - fold.parameter) <= CORNER * fold.parameter:
            off = np.linalg.norm(((other.point.u - fold.point.u) / fold.point.scale)[:-1])
            if off <= np.sqrt(CORNER):
                return other
    return None


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


def _passes_frequency(curve: FoldPath, omega: float, present: float) -> bool:
    """True if a curve passes a frequency at the scenario's value of the second parameter."""
    p, f = curve.parameter - present, curve.frequency_hz
    crossing = np.flatnonzero(p[:-1] * p[1:] <= 0)
    for i in crossing:
        share = 0.0 if p[i] == p[i + 1] else p[i] / (p[i] - p[i + 1])
        at = f[i] + share * (f[i + 1] - f[i])
        off = SAME + 0.05 * abs(f[i + 1] - f[i]) / at
        if abs(at - omega / (2 * np.pi)) <= off * at:
            return True
    return False


def _curve(model: ResponseModel, corner: _Corner, level: float, budget: Budget) -> FoldPath:
    """Curve through a fold or grazing, with the largest displacements of its motions."""
    second, fold, touching = not_none(model.second), corner.fold, corner.grazing
    halves = _both_directions(model, corner, _value_in_scenario(model, level), budget)
    # the traced points come first, so that they are stored
    followed = join_directions(*sorted(halves, key=lambda half: not half.points))
    displacements = model.system.channels.of_keys(DISPLACEMENT)
    measurement = Measurement(
        model.system,
        model.scenario.sine,
        displacements,
        system_at=None if second.moved_snubber is None else second.system,
    )
    points = followed.points
    peaks = [motion.peak for motion in measurement.of(followed.problem, points)]
    return FoldPath(
        touching="" if touching is None else model.system.contact_names[touching.contact],
        level=float("nan") if second.kind == "level" else level,
        branch=corner.branch,
        start_hz=fold.parameter / (2 * np.pi),
        outcome=second.in_user_unit(both_directions(halves[-1].outcome, halves[0].outcome)),
        frequency_hz=np.array([p.u[-2] for p in points]) / (2 * np.pi),
        parameter=np.array([second.from_unknown(p.parameter) for p in points]),
        residual=np.array([p.residual for p in points]),
        states=np.array([p.u[:-2] for p in points]).reshape(len(points), corner.orbits.flow.size),
        peak=np.array(peaks).reshape(-1, len(model.system.probes)),
    )


def _both_directions(model: ResponseModel, corner: _Corner, present: float, budget: Budget) -> list[OrbitBranch]:
    """Both directions of a curve from the present value of the second parameter; one from an end of the range."""
    second, orbits, fold = not_none(model.second), corner.orbits, corner.fold
    path: Any = "level" if second.kind == "level" else second.path(orbits.flow)
    low, high = sorted((second.to_unknown(second.first), second.to_unknown(second.last)))

    def range_exit(point: BranchPoint) -> Outcome | None:
        at = float(point.u[-2])
        if fold.parameter / LARGEST_FREQUENCY_RATIO < at < fold.parameter * LARGEST_FREQUENCY_RATIO:
            return None
        return Outcome.of(
            OutcomeKind.STOPPED, "left_range", f"a factor of {LARGEST_FREQUENCY_RATIO:g} from where it started",
            at=Where(at / (2 * np.pi), "Hz"),
        )  # fmt: skip

    halves: list[OrbitBranch] = []
    for direction, edge in ((1.0, high), (-1.0, low)):
        if abs(second.to_unknown(present) - edge) < AT_EDGE * max(abs(edge), 1.0):
            continue
        begun = None
        with suppress(ArithmeticError, np.linalg.LinAlgError):
            begun = start_of_curve(orbits, corner.grazing or fold, path, second.to_unknown(present), direction)
        if begun is None:
            halves.append(OrbitBranch(None, (), TOO_CLOSE))
        else:
            curve, start = begun
            halves.append(walk(Branch(curve, start, low, high, SETTINGS), budget, range_exit, with_special=False))
    return halves


def fold_datasets(model: ResponseModel, curves: Sequence[FoldPath]) -> dict[str, Dataset]:
    """Datasets of fold curves and their points, by name; empty without curves.

    Parameters
    ----------
    model : response model with the second parameter.
    curves : the curves.
    """
    if not curves:
        return {}
    second, system = not_none(model.second), model.system
    about = {
        "fold_curve": np.arange(len(curves)),
        "level": [curve.level for curve in curves],
        "branch": [curve.branch for curve in curves],
        "start_hz": [curve.start_hz for curve in curves],
        "touching": [curve.touching for curve in curves],
        "followed": second.kind,
        "followed_snubber": second.snubber,
        **endings(curve.outcome for curve in curves),
    }
    values = {
        **numbered_points([curve.parameter.size for curve in curves], "fold_curve"),
        **of_states(np.concatenate([curve.states for curve in curves]), system.dynamics.size),
        **{
            name: np.concatenate([getattr(curve, name) for curve in curves])
            for name in ("frequency_hz", "parameter", "residual")
        },
        "probe": [probe.name for probe in system.probes],
        "peak_displacement": np.concatenate([curve.peak for curve in curves]).T,
    }
    parameter = f"second parameter: {second.kind} {second.snubber}".strip()
    return {
        "fold_curves": FOLD_CURVES.dataset(about, level_unit=model.scenario.level_unit or "1"),
        "fold_points": FOLD_POINTS.dataset(values, unit=second.unit, parameter=parameter),
    }
