"""Designs that a search tries, each solved once, and how it says that it did not come to an end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan, distributed
from beamsim.analyses.studies.table import costs
from beamsim.cases import Evaluator
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.scenario.studies import Value
from beamsim.typing import Bools, Floats

APART = 0.1  # of a range, between designs from which local searches start
RESOLUTION = 1e-3  # of the ranges, to which a best design is located
BETTER = "it still found better ones"


def unsettled(tried: int, left_out: Sequence[str] = (BETTER,)) -> Outcome:
    """The outcome of a search that ended before it was done.

    Parameters
    ----------
    tried : number of designs.
    left_out : what it did not come to, each as a clause.
    """
    sentence = f"the search ended after {tried} designs while {' and '.join(left_out)}"
    return Outcome.of(
        OutcomeKind.DOUBTFUL, "search_not_converged", sentence, remedy="give more most_cases", tried=tried
    )


class SolvedPoints(NamedTuple):
    """All designs that are solved."""

    points: Floats  # (n, parameters) of the unit cube
    values: Floats  # (n, objectives), small where good; infinite where a design has none
    beyond: Floats  # (n, limits) by which share each limit is exceeded, negative where it is met

    @property
    def excess(self) -> Floats:
        """(n,) the largest share by which a limit is exceeded, zero where all are met."""
        return np.asarray(self.beyond.max(axis=1, initial=0.0))


class Designs:
    """Designs with their objectives and by how much they exceed limits, each solved once.

    Points of the unit cube, of which each side is the range of a varied number, or a list of values or choices.

    Parameters
    ----------
    plan : of the search.
    evaluate : solves the cases.
    """

    def __init__(self, plan: StudyPlan, evaluate: Evaluator) -> None:
        self.plan, self.evaluate = plan, evaluate
        self.known: dict[tuple[Value, ...], tuple[Floats, Floats]] = {}  # (objectives,), (limits,)
        self.points: dict[tuple[Value, ...], Floats] = {}  # of the unit cube
        self._every: SolvedPoints | None = None  # where nothing was solved since
        self.free: Bools = np.array([not (p.values or p.whole) for p in plan.study.varied])  # ranges of real numbers

    def __call__(self, cube: Floats) -> tuple[Floats, Floats]:
        """Objectives (objectives, n) and excess of the limits (n,) of points (n, parameters) of the unit cube."""
        values, beyond = self.signed(cube)
        return values, beyond.max(axis=0, initial=0.0)

    def signed(self, cube: Floats) -> tuple[Floats, Floats]:
        """Objectives (objectives, n) and by which share each limit is exceeded (limits, n), negative if met."""
        rows = list(zip(*distributed(self.plan.study.varied, cube), strict=True))
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

    @property
    def every(self) -> SolvedPoints:
        """All designs that are solved, in the order in which they were tried."""
        if self._every is None:
            columns = [(self.points[row], *of) for row, of in self.known.items()]
            self._every = SolvedPoints(*(np.array([each[k] for each in columns]) for k in range(3)))
        return self._every

    @property
    def tried(self) -> int:
        """Number of designs that were asked for."""
        return len(self.evaluate.rows)

    @property
    def exhausted(self) -> bool:
        """Whether there is no other design."""
        counts = [len(p.values) or (p.high - p.low + 1.0 if p.whole else np.inf) for p in self.plan.study.varied]
        return len(self.points) >= float(np.prod(counts))

    def best_apart(self, taken: Sequence[Floats], goal: int = 0) -> Floats | None:
        """The best point by an objective that meets every limit and lies apart from others; None without one."""
        points, values, _ = self.every
        kept = np.flatnonzero((self.every.excess == 0.0) & np.isfinite(values[:, goal]))
        ranked = points[kept[np.argsort(values[kept, goal], kind="stable")]]
        return next((p for p in ranked if all(np.max(np.abs(p - other)) >= APART for other in taken)), None)

    def placed(self, design: Floats, numbers: Floats) -> Floats:
        """A point (parameters,) with other numbers in its ranges."""
        design = design.copy()
        design[self.free] = numbers
        return design
