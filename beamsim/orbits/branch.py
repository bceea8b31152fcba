"""A branch of periodic orbits, from any method: its points, what they mean, where it changes, and how it ended."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from beamsim.outcomes import Outcome, OutcomeKind, interruption
from beamsim.typing import Complexes, Floats

SpecialKind = Literal[
    "fold", "nonsmooth_fold", "period_doubling", "neimark_sacker", "branch_point", "grazing", "symmetry_breaking"
]
BranchKind = Literal["response", "backbone", "tongue", "non_brake"]

FailedSearch = tuple[SpecialKind, float]  # what was searched, and the parameter at the beginning of the step

NOT_BEGUN = Outcome.of(OutcomeKind.STOPPED, "not_begun", "not started")
INTERRUPTED = interruption()
POINT_LIMIT, REACHED_END, SEARCH_FAILED = "point_limit", "reached_end", "search_failed"


def reached_end(parameter: float) -> Outcome:
    """The outcome of a branch that was followed to the end of its range."""
    return Outcome.of(OutcomeKind.COMPLETE, REACHED_END, "reached the end of the range", at=parameter)


def too_many_points(points: int, parameter: float | None = None) -> Outcome:
    """The outcome of a branch that has the largest number of points."""
    return Outcome.of(
        OutcomeKind.STOPPED, POINT_LIMIT, f"the limit of {points} points is reached", at=parameter, points=points
    )


@dataclass(frozen=True)
class BranchPoint:
    """A converged point of a branch."""

    u: Floats
    tangent: Floats  # unit vector in scaled unknowns
    scale: Floats  # of the unknowns, to which the tangent refers
    residual: float  # largest, against its scale
    orientation: float  # sign of det [J; tangent]
    iterations: int
    data: Any  # what the problem computed there

    @property
    def parameter(self) -> float:
        """The last unknown."""
        return float(self.u[-1])

    def reverse(self) -> BranchPoint:
        """The same point with the opposite tangent."""
        return replace(self, tangent=-self.tangent, orientation=-self.orientation)

    def orient(self, forward: float) -> BranchPoint:
        """The same point, its tangent pointing to larger (``forward`` > 0) or smaller parameters."""
        return self.reverse() if self.tangent[-1] * forward < 0 else self


@dataclass(frozen=True)
class Orbit:
    """The periodic motion that a point of a branch stands for."""

    parameter: float
    state: Floats  # (2n + faces,) at t = 0
    period: float  # s
    multipliers: Complexes  # Floquet, largest first where the motion is forced
    stable: bool
    residual: float  # error of the periodicity, relative to the size of the motion
    energy: float = np.nan  # J, of a free motion

    @property
    def frequency_hz(self) -> float:
        """Oscillations per second."""
        return 1.0 / self.period


@dataclass(frozen=True)
class SpecialPoint:
    """A point at which a branch changes: a fold, a bifurcation or a grazing."""

    kind: SpecialKind
    parameter: float
    point: BranchPoint
    contact: int = -1  # for a grazing, or a nonsmooth fold, which is one at which the branch turns: which contact
    time: float = np.nan  # s, for a grazing: when in the period
    top: bool = True  # the penetration just reaches the border from below (else from above)
    level: float = 0.0  # m, penetration at the border of two phases of the contact's law


def special_name(kind: str) -> str:
    """What a kind of special point is called in messages, tables and plots."""
    return "Neimark–Sacker bifurcation" if kind == "neimark_sacker" else kind.replace("_", " ")


def curve_event_name(kind: str) -> str:
    """What a special point of a curve of special points is called on screens and in plots."""
    names = {"isola": "birth of an isola", "extremum": "extreme of the second parameter"}
    if kind.startswith("resonance_"):
        return f"{kind.removeprefix('resonance_').replace('_', ':')} resonance"
    return names.get(kind, kind.replace("_", " "))


@contextmanager
def record_failures(kind: SpecialKind, step: BranchPoint, failed: list[FailedSearch] | None) -> Iterator[None]:
    """Append to ``failed`` what ends in a numerical error, or raise it where there is no list.

    Parameters
    ----------
    kind : of special point that is searched.
    step : the point at which the step begins.
    failed : the list, if any.

    Returns
    -------
    A context manager.

    Raises
    ------
    ArithmeticError, LinAlgError : without a list.
    """
    try:
        yield
    except (ArithmeticError, np.linalg.LinAlgError):
        if failed is None:
            raise
        failed.append((kind, step.parameter))


def with_failed_searches(outcome: Outcome, failed: Sequence[FailedSearch]) -> Outcome:
    """The outcome of a branch, with the searches that failed along it."""
    if not failed:
        return outcome
    kinds = ", ".join(dict.fromkeys(special_name(kind) for kind, _ in failed))
    steps = len({parameter for _, parameter in failed})
    return outcome.copy_with(
        Outcome.of(
            OutcomeKind.INCOMPLETE, SEARCH_FAILED,
            f"special points ({kinds}) and changes of stability may be missing: the search failed in {steps} of the "
            "steps, the first",
            at=failed[0][1], remedy="follow a smaller range around it", steps=steps,
        )
    )  # fmt: skip


@dataclass(frozen=True)
class OrbitBranch:
    """A computed branch of periodic motions."""

    problem: Any  # the continuation problem; its ``orbit(point)`` is the motion of a point
    points: Sequence[BranchPoint]
    outcome: Outcome
    special: tuple[SpecialPoint, ...] = ()
    kind: BranchKind = "response"
    mode: int = -1  # of a tongue and of a non-brake branch: the other mode, from 0
    ratio: int = 0  # of the same, n of n:1: the other mode makes n oscillations in a period
    origin: float = np.nan  # of the same: the parameter where it leaves the backbone

    @cached_property
    def values(self) -> Floats:
        """(np,) the parameter."""
        return np.array([p.parameter for p in self.points])

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest value of the parameter."""
        return float(self.values.min()), float(self.values.max())

    @cached_property
    def orbits(self) -> list[Orbit]:
        """(np,) the motions."""
        return [self.problem.orbit(p) for p in self.points]
