"""Folds of a response followed in a second parameter: the border of the region with several motions."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from beamsim.analyses.branch import FoldBranch, of_states
from beamsim.analyses.continuation.branches import Budget, joined, walk
from beamsim.analyses.continuation.motion import Measurement
from beamsim.analyses.continuation.paths import ResponseModel
from beamsim.analyses.values import DISPLACEMENT
from beamsim.orbits.branch import BranchPoint, OrbitBranch, SpecialPoint
from beamsim.orbits.continuation import Branch, Settings
from beamsim.orbits.folds import start_of_curve
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.outcomes import Outcome, OutcomeKind, Where, both_directions
from beamsim.structures.assembly import snubber_site

SETTINGS = Settings(tolerance=1e-9, most_points=600)  # of one curve, in each direction
CORNER = 1e-5  # relative distance in frequency within which a fold lies on a grazing
SAME = 1e-6  # relative distance within which a fold lies on a curve that is known
TOO_CLOSE = Outcome.of(OutcomeKind.STOPPED, "corner_too_close", "the fold is too close to a corner of the curve")
BEYOND = 3.0  # how far the frequency may leave the range it was found in, as a ratio


def follow_folds(model: ResponseModel, traced: list[OrbitBranch], level: float, budget: Budget) -> list[FoldBranch]:
    """One curve for every fold of the branches of the excitation's own period, each fold on one curve only."""
    curves: list[FoldBranch] = []
    for index, branch in enumerate(traced):
        if branch.problem.multiple != 1:
            continue
        for fold in (s for s in branch.special if s.kind in ("fold", "nonsmooth_fold")):
            if budget.spent() or any(_holds(curve, fold.parameter, _present(model, level)) for curve in curves):
                continue
            touching = fold if fold.kind == "nonsmooth_fold" else _grazing_at(branch, fold)
            curves.append(_curve(model, branch.problem, fold, touching, level, index, budget))
    return curves


def _grazing_at(branch: OrbitBranch, fold: SpecialPoint) -> SpecialPoint | None:
    """The grazing on which a fold lies: a stiff stop turns the curve back where it is first touched."""
    for other in branch.special:
        if other.kind == "grazing" and abs(other.parameter - fold.parameter) <= CORNER * fold.parameter:
            off = np.linalg.norm(((other.point.u - fold.point.u) / fold.point.scale)[:-1])
            if off <= np.sqrt(CORNER):
                return other
    return None


def _present(model: ResponseModel, level: float) -> float:
    """The scenario's own value of the second parameter."""
    second = model.second
    assert second is not None
    if second.kind == "level":
        return level
    assert second.moved is not None
    if second.kind == "position":
        index = second.moved.index
        return snubber_site(model.scenario.located_snubbers[index]).coordinate
    contacts = model.system.dynamics.contacts
    index = second.moved.index
    return float(contacts.gap[index]) if second.kind == "gap" else contacts.laws[index].stiffness


def _holds(curve: FoldBranch, omega: float, present: float) -> bool:
    """Whether a curve passes a frequency at the scenario's own value of the second parameter."""
    p, f = curve.parameter - present, curve.frequency_hz
    crossing = np.flatnonzero(p[:-1] * p[1:] <= 0)
    for i in crossing:
        share = 0.0 if p[i] == p[i + 1] else p[i] / (p[i] - p[i + 1])
        at = f[i] + share * (f[i + 1] - f[i])
        off = SAME + 0.05 * abs(f[i + 1] - f[i]) / at
        if abs(at - omega / (2 * np.pi)) <= off * at:
            return True
    return False


def _curve(
    model: ResponseModel,
    orbits: ForcedOrbits,
    fold: SpecialPoint,
    touching: SpecialPoint | None,
    level: float,
    branch: int,
    budget: Budget,
) -> FoldBranch:
    second = model.second
    assert second is not None
    present = _present(model, level)
    path: Any = "level" if second.kind == "level" else second.path(orbits.flow)
    low, high = sorted((second.inward(second.first), second.inward(second.last)))

    def within(point: BranchPoint) -> Outcome | None:
        at = float(point.u[-2])
        if fold.parameter / BEYOND < at < fold.parameter * BEYOND:
            return None
        return Outcome.of(
            OutcomeKind.STOPPED, "left_range", f"a factor of {BEYOND:g} from where it started",
            at=Where(at / (2 * np.pi), "Hz"),
        )  # fmt: skip

    halves: list[OrbitBranch] = []
    for direction in (1.0, -1.0):
        edge = high if direction > 0 else low
        if abs(second.inward(present) - edge) < 1e-9 * max(abs(edge), 1.0):
            continue
        begun = None
        with suppress(ArithmeticError, np.linalg.LinAlgError):
            begun = start_of_curve(orbits, touching or fold, path, second.inward(present), direction)
        if begun is None:
            close = Outcome.of(
                OutcomeKind.STOPPED, "corner_too_close", "the fold is too close to a corner of the curve"
            )
            halves.append(OrbitBranch(None, (), close))
        else:
            curve, start = begun
            halves.append(walk(Branch(curve, start, low, high, SETTINGS), None, budget, "", within))
    # what was followed comes first, so that its points are kept
    followed = joined(*sorted(halves, key=lambda half: not half.points))
    names = [p.name for p in model.system.probes]
    measurement = Measurement(model.system, model.excitation, model.system.channels.of_keys(DISPLACEMENT))
    motions = [measurement.of(followed.problem, point) for point in followed.points]
    peak = np.array([motion.peak for motion in motions]).reshape(-1, len(names))
    points = followed.points
    states = np.array([p.u[:-2] for p in points]).reshape(len(points), orbits.flow.size)
    return FoldBranch(
        touching="" if touching is None else model.system.contact_names[touching.contact],
        level=float("nan") if second.kind == "level" else level,
        branch=branch,
        start_hz=fold.parameter / (2 * np.pi),
        outcome=second.shown(both_directions(halves[-1].outcome, halves[0].outcome)),
        frequency_hz=np.array([p.u[-2] for p in points]) / (2 * np.pi),
        parameter=np.array([second.outward(p.parameter) for p in points]),
        unit=second.unit,
        parameter_meaning=f"second parameter: {second.kind} {second.snubber}".strip(),
        peak_displacement={name: peak[:, j] for j, name in enumerate(names)},
        residual=np.array([p.residual for p in points]),
        **of_states(states, model.system.dynamics.size),
    )
