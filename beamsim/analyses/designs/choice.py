"""Which cases meet every limit, and which of them is best."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.designs.realisations import judging
from beamsim.analyses.designs.result import Response, is_scalar, responses_of
from beamsim.scenario.studies import Vary
from beamsim.typing import Bools, Floats, Ints

MOST_LISTED = 10  # best cases in the summary


class Objective(NamedTuple):
    """What makes a case better than another."""

    response: str = ""  # a quantity, whose worst place counts, or the name of a response; empty: the smallest margin
    largest: bool = True  # whether large values are better

    @classmethod
    def of(cls, vary: Vary | None) -> Objective:
        """What a study asks for; without an objective the smallest margin of a case shall be large."""
        if vary is None or not (vary.minimise or vary.maximise):
            return cls()
        return cls(vary.minimise or vary.maximise, bool(vary.maximise))

    @property
    def text(self) -> str:
        """For people."""
        if not self.response:
            return "largest margin"
        return f"{'largest' if self.largest else 'smallest'} {self.response.replace('/', ' ').replace('_', ' ')}"

    def values(self, responses: Mapping[str, Response], shape: tuple[int, ...], quantile: float = 1.0) -> Floats | None:
        """(cases,) the response at its worst place, by which a case is judged; None if there is no such response.

        ``responses`` have the given shape, whose last axis is that of the realisations.
        """
        asked = [r.values.ravel() for r in responses_of(responses, self.response) if is_scalar(r, shape)]
        if not asked:
            return None
        worst = np.asarray((np.min if self.largest else np.max)(np.stack(asked), axis=0)).reshape(-1, shape[-1])
        deciding = judging(worst, quantile, large_is_good=self.largest)
        return np.asarray(worst[np.arange(deciding.size), deciding])


def passing_cases(margins: Mapping[str, Response], solved: Bools) -> Bools:
    """Which solved cases meet every limit; those without a margin of one of them don't."""
    passing = solved.copy()
    for margin in margins.values():
        passing &= margin.values >= 0.0
    return passing


def smallest_margins(margins: Mapping[str, Response]) -> tuple[Floats, Ints]:
    """(cases,) the smallest margin of each case, nan where one is not known, and the number of its limit."""
    values = np.stack([margin.values.ravel() for margin in margins.values()])
    return values.min(axis=0), np.where(np.isnan(values), -np.inf, values).argmin(axis=0)


def best_cases(
    values: Floats | None, margins: Mapping[str, Response], passing: Bools, *, largest: bool
) -> list[dict[str, Any]]:
    """The best of the cases that pass, best first: case, value of the objective, smallest margin and its limit.

    Parameters
    ----------
    values : (cases,) of the objective; None for the smallest margin.
    largest : whether large values are better.
    """
    smallest, decisive = smallest_margins(margins) if margins else (None, np.zeros(0, dtype=int))
    values = smallest if values is None else values
    if values is None:
        return []
    of_passing = np.flatnonzero(passing.ravel() & ~np.isnan(values))
    order = of_passing[np.argsort((-1.0 if largest else 1.0) * values[of_passing], kind="stable")]
    names = list(margins)
    return [
        {
            "case": int(case),
            "value": float(values[case]),
            **({} if smallest is None else {"margin": float(smallest[case]), "limit": names[decisive[case]]}),
        }
        for case in order[:MOST_LISTED]
    ]
