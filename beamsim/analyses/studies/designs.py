"""Designs of a search, each solved once; a local search; and the outcome of a search that did not converge.

Source of the local search: T. M. Ragonneau, Model-based derivative-free optimization methods and software, PhD thesis,
The Hong Kong Polytechnic University, 2022.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan, distributed
from beamsim.analyses.studies.table import costs
from beamsim.cases import CaseOutcome, Evaluator
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.scenario.studies import Value
from beamsim.typing import Bools, Floats

START_DISTANCE = 0.1  # of a range: least distance of designs from which local searches start
FIRST_RADIUS = 0.03  # of a range: first steps of local searches from nearly optimal designs
RESOLUTION = 1e-3  # of the ranges: tolerance of the best design
LIMIT_MARGIN = 1e-6  # distance of a design from a limit; less is round-off
PENALTY = 10.0  # times the difference between designs: value of an unknown design
STILL_IMPROVING = "it still found better ones"


def unfinished_search(
    design_count: int, missing: Sequence[str] = (STILL_IMPROVING,), key: str = "most_cases"
) -> Outcome:
    """Outcome of a search that ended before it converged.

    Parameters
    ----------
    design_count : number of designs.
    missing : what it did not reach, each as a clause.
    key : key of the scenario that ended it.
    """
    sentence = f"the search ended after {design_count} designs while {' and '.join(missing)}"
    return Outcome.of(
        OutcomeKind.DOUBTFUL, "search_not_converged", sentence, remedy=f"give more {key}", tried=design_count
    )


def local_search(
    merit: Callable[[Floats], float], excesses: Callable[[Floats], Floats], start: Floats, most_points: int,
    radii: tuple[float, float],
) -> tuple[Floats, bool]:  # fmt: skip
    """Derivative-free local search on the unit cube with limits (COBYQA).

    Parameters
    ----------
    merit : function to minimise, of the order of one.
    excesses : (limits,) functions that must be negative, of the order of one.
    start : (numbers,) initial point.
    most_points : largest number of points.
    radii : sizes of the first and the last steps.

    Returns
    -------
    (numbers,) array
        Final point.
    bool
        True if the search converged.
    """
    from scipy.optimize import Bounds, NonlinearConstraint, minimize

    found: Any = minimize(
        merit, start, method="COBYQA", bounds=Bounds(0.0 * start, 0.0 * start + 1.0),
        constraints=NonlinearConstraint(excesses, -np.inf, 0.0) if excesses(start).size else (),
        options={"maxfev": most_points, "initial_tr_radius": radii[0], "final_tr_radius": radii[1]},
    )  # fmt: skip
    return found.x, bool(found.success)


class SolvedPoints(NamedTuple):
    """All solved designs."""

    points: Floats  # (n, parameters) of the unit cube
    values: Floats  # (n, objectives), smaller is better; infinite if a design has none
    excesses: Floats  # (n, limits) relative excess of each limit, negative if it is met

    @property
    def excess(self) -> Floats:
        """(n,) largest relative excess of a limit, zero if all are met."""
        return np.asarray(self.excesses.max(axis=1, initial=0.0))


class Designs:
    """Designs with their objectives and excesses of limits, each solved once.

    Designs are points of the unit cube, each side of which is the range of a varied number, or a list of values.

    Parameters
    ----------
    plan : plan of the search.
    evaluate : evaluator that solves the cases.
    """

    def __init__(self, plan: StudyPlan, evaluate: Evaluator) -> None:
        self.plan, self.evaluate = plan, evaluate
        self.known: dict[tuple[Value, ...], tuple[Floats, Floats]] = {}  # (objectives,), (limits,)
        self.points: dict[tuple[Value, ...], Floats] = {}  # points of the unit cube
        self._every: SolvedPoints | None = None  # None after a new design
        self.free: Bools = np.array([not (p.values or p.integers_only) for p in plan.study.parameters])  # real numbers

    def __call__(self, cube: Floats) -> tuple[Floats, Floats]:
        """Objectives (objectives, n) and excesses of the limits (n,) at points (n, parameters) of the unit cube."""
        values, beyond = self.objectives_and_excesses(cube)
        return values, beyond.max(axis=0, initial=0.0)

    def objectives_and_excesses(self, cube: Floats) -> tuple[Floats, Floats]:
        """Objectives (objectives, n) and relative excess of each limit (limits, n), negative if met."""
        rows = list(zip(*distributed(self.plan.study.parameters, cube), strict=True))
        self.points |= {row: point for row, point in zip(rows, cube, strict=True) if row not in self.known}
        new = [row for row in dict.fromkeys(rows) if row not in self.known]
        if new:
            outcomes = [outcome for of_case in self.evaluate(new) for outcome in of_case]
            values, beyond = costs(self.plan, outcomes)
            self.known |= {row: (values[:, k], beyond[:, k]) for k, row in enumerate(new)}
            self._every = None
        found = [self.known[row] for row in rows]
        count = len(objectives(self.plan.scenario))
        return np.reshape([of for of, _ in found], (len(rows), count)).T, np.transpose([of for _, of in found])

    def objective_with_further(
        self, point: Floats, further: Callable[[int], list[CaseOutcome]]
    ) -> tuple[float, Floats]:
        """First objective of a point with further realisations, and relative excesses of limits (limits,).

        Parameters
        ----------
        point : (parameters,) point of the unit cube.
        further : function from the index of a case to its further realisations.
        """
        self(point[None])
        row = tuple(column[0] for column in distributed(self.plan.study.parameters, point[None]))
        case, count = self.evaluate.rows.index(row), self.plan.study.realisations.count
        sample = [self.evaluate.outcomes[case * count + r] for r in range(count)]
        values, beyond = costs(self.plan, [*sample, *(replace(outcome, within=0) for outcome in further(case))])
        return float(values[0, 0]), beyond[:, 0]

    @property
    def all_designs(self) -> SolvedPoints:
        """All solved designs, in the order of their solution."""
        if self._every is None:
            columns = [(self.points[row], *of) for row, of in self.known.items()]
            self._every = SolvedPoints(*(np.array([each[k] for each in columns]) for k in range(3)))
        return self._every

    @property
    def design_count(self) -> int:
        """Number of requested designs."""
        return len(self.evaluate.rows)

    @property
    def exhausted(self) -> bool:
        """True if all designs have been tried."""
        counts = [
            len(p.values) or (p.high - p.low + 1.0 if p.integers_only else np.inf) for p in self.plan.study.parameters
        ]
        return len(self.points) >= float(np.prod(counts))

    def best_away_from(self, others: Sequence[Floats], goal: int = 0) -> Floats | None:
        """Best point by an objective that meets every limit and differs enough from others; None without one."""
        points, values, _ = self.all_designs
        kept = np.flatnonzero((self.all_designs.excess == 0.0) & np.isfinite(values[:, goal]))
        ranked = points[kept[np.argsort(values[kept, goal], kind="stable")]]
        return next((p for p in ranked if all(np.max(np.abs(p - other)) >= START_DISTANCE for other in others)), None)

    def with_numbers(self, design: Floats, numbers: Floats) -> Floats:
        """Design (parameters,) with other numbers in its ranges."""
        design = design.copy()
        design[self.free] = numbers
        return design
