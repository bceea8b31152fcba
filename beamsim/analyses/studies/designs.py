"""Designs that a search tries, each solved once, a local search among them, and how a search says that it did not end.

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

APART = 0.1  # of a range, between designs from which local searches start
NEAR = 0.03  # of a range, first steps of local searches from designs that are nearly the best
RESOLUTION = 1e-3  # of the ranges, to which a best design is located
ON_A_LIMIT = 1e-6  # by which a design stays away from a limit: less is round-off
WORSE = 10.0  # of a difference between designs, as which what is not known counts
BETTER = "it still found better ones"


def unfinished_search(tried: int, left_out: Sequence[str] = (BETTER,), more: str = "most_cases") -> Outcome:
    """The outcome of a search that ended before it was done.

    Parameters
    ----------
    tried : number of designs.
    left_out : what it did not come to, each as a clause.
    more : number in the scenario that ended it.
    """
    sentence = f"the search ended after {tried} designs while {' and '.join(left_out)}"
    return Outcome.of(OutcomeKind.DOUBTFUL, "search_not_converged", sentence, remedy=f"give more {more}", tried=tried)


def local_search(
    merit: Callable[[Floats], float], beyond: Callable[[Floats], Floats], start: Floats, room: int,
    radii: tuple[float, float],
) -> tuple[Floats, bool]:  # fmt: skip
    """A local search on the unit cube without derivatives (COBYQA), with limits.

    Parameters
    ----------
    merit : to be small; of the order of one.
    beyond : (limits,) to be negative; of the order of one.
    start : (numbers,).
    room : number of points at most.
    radii : of the first steps and of the last.

    Returns
    -------
    (numbers,) array
        Where it ended.
    bool
        Whether it settled there.
    """
    from scipy.optimize import Bounds, NonlinearConstraint, minimize

    found: Any = minimize(
        merit, start, method="COBYQA", bounds=Bounds(0.0 * start, 0.0 * start + 1.0),
        constraints=NonlinearConstraint(beyond, -np.inf, 0.0) if beyond(start).size else (),
        options={"maxfev": room, "initial_tr_radius": radii[0], "final_tr_radius": radii[1]},
    )  # fmt: skip
    return found.x, bool(found.success)


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
        self.free: Bools = np.array(
            [not (p.values or p.integers_only) for p in plan.study.varied]
        )  # ranges of real numbers

    def __call__(self, cube: Floats) -> tuple[Floats, Floats]:
        """Objectives (objectives, n) and excess of the limits (n,) of points (n, parameters) of the unit cube."""
        values, beyond = self.objectives_and_excesses(cube)
        return values, beyond.max(axis=0, initial=0.0)

    def objectives_and_excesses(self, cube: Floats) -> tuple[Floats, Floats]:
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

    def signed_with(self, point: Floats, further: Callable[[int], list[CaseOutcome]]) -> tuple[float, Floats]:
        """The first objective of a point with further realisations, and by which share it exceeds limits (limits,).

        Parameters
        ----------
        point : (parameters,) of the unit cube.
        further : gives the further realisations of a case by its number.
        """
        self(point[None])
        row = tuple(column[0] for column in distributed(self.plan.study.varied, point[None]))
        case, count = self.evaluate.rows.index(row), self.plan.study.realisations.count
        sample = [self.evaluate.outcomes[case * count + r] for r in range(count)]
        values, beyond = costs(self.plan, [*sample, *(replace(outcome, within=0) for outcome in further(case))])
        return float(values[0, 0]), beyond[:, 0]

    @property
    def all_designs(self) -> SolvedPoints:
        """All designs that are solved, in the order in which they were tried."""
        if self._every is None:
            columns = [(self.points[row], *of) for row, of in self.known.items()]
            self._every = SolvedPoints(*(np.array([each[k] for each in columns]) for k in range(3)))
        return self._every

    @property
    def design_count(self) -> int:
        """Number of designs that were asked for."""
        return len(self.evaluate.rows)

    @property
    def exhausted(self) -> bool:
        """True if all designs have been tried."""
        counts = [
            len(p.values) or (p.high - p.low + 1.0 if p.integers_only else np.inf) for p in self.plan.study.varied
        ]
        return len(self.points) >= float(np.prod(counts))

    def best_apart(self, taken: Sequence[Floats], goal: int = 0) -> Floats | None:
        """The best point by an objective that meets every limit and lies apart from others; None without one."""
        points, values, _ = self.all_designs
        kept = np.flatnonzero((self.all_designs.excess == 0.0) & np.isfinite(values[:, goal]))
        ranked = points[kept[np.argsort(values[kept, goal], kind="stable")]]
        return next((p for p in ranked if all(np.max(np.abs(p - other)) >= APART for other in taken)), None)

    def placed(self, design: Floats, numbers: Floats) -> Floats:
        """A point (parameters,) with other numbers in its ranges."""
        design = design.copy()
        design[self.free] = numbers
        return design
