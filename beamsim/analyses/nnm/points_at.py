"""Points of a backbone and its tongues at energies and frequencies that were asked for: exact motions there."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from beamsim.orbits.branch import BranchPoint, OrbitBranch
from beamsim.orbits.continuation import Settings, at_parameter, locate
from beamsim.orbits.reversible import BrakeOrbits

SETTINGS = Settings(iterations=15)
SAME = 1e-12  # relative difference from a value within which a stored point has it


@dataclass(frozen=True)
class RequestedPoint:
    """A point at a value that was asked for."""

    quantity: str  # energy or frequency
    value: float  # J or Hz
    point: BranchPoint


def with_requested_points(
    branch: OrbitBranch, energies: Sequence[float], frequencies: Sequence[float], gaps: Collection[float] = ()
) -> tuple[OrbitBranch, list[RequestedPoint]]:
    """The branch with a point wherever it passes one of the values, and these points.

    Parameters
    ----------
    branch : of half-period shooting.
    energies, frequencies : J and Hz.
    gaps : parameters of points that a jump follows; nothing is interpolated across it.
    """
    orbits: BrakeOrbits = branch.problem
    numbers: dict[str, Callable[[BranchPoint], float]] = {
        "energy": lambda p: float(p.data.energy), "frequency": lambda p: 1.0 / orbits.split(p.u)[1],
    }  # fmt: skip
    requested = [("energy", float(v)) for v in energies] + [("frequency", float(v)) for v in frequencies]
    passed: list[RequestedPoint] = []
    points: list[BranchPoint] = []
    for a, b in pairwise([*branch.points, branch.points[-1]]):
        points.append(a)
        between: list[RequestedPoint] = []
        for quantity, value in requested:
            number = numbers[quantity]
            if abs(number(a) / value - 1.0) < SAME:
                passed.append(RequestedPoint(quantity, value, a))
            elif b is not a and a.parameter not in gaps and (number(a) - value) * (number(b) - value) < 0:
                point = _located(orbits, a, b, quantity, value, number)
                between += [] if point is None else [RequestedPoint(quantity, value, point)]
        chord = (b.u - a.u) / a.scale
        between.sort(key=lambda each: float(((each.point.u - a.u) / a.scale) @ chord))
        passed += between
        points += [each.point for each in between]
    return replace(branch, points=tuple(points)), passed


def _located(
    orbits: BrakeOrbits, a: BranchPoint, b: BranchPoint, quantity: str, value: float,
    number: Callable[[BranchPoint], float],
) -> BranchPoint | None:  # fmt: skip
    """The motion between two neighbours that has the value: exactly where it is what is followed, else to round-off."""
    if quantity == orbits.parameter:
        inward = np.log(value) if quantity == "energy" else 2 * np.pi * value
        return at_parameter(orbits, a, b, float(inward), SETTINGS)
    return locate(orbits, a, b, lambda p: number(p) / value - 1.0, SETTINGS)
