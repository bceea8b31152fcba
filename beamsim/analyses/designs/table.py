"""The table of a study while it is computed: a row of numbers a case, in arrays."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from beamsim.analyses.designs.result import CaseOutcome
from beamsim.typing import Bools, Floats


class CaseTable:
    """Responses of the cases that are computed, and the outcomes of those that failed."""

    def __init__(self, cases: int, outcomes: Iterable[CaseOutcome] = ()) -> None:
        self.known: Bools = np.zeros(cases, dtype=bool)  # computed, with success or not
        self.failures: dict[int, CaseOutcome] = {}
        self.processor_time_s = 0.0
        self._columns: dict[str, Floats] = {}  # (cases,), or (cases, modes) of lists
        self._first: dict[str, tuple[int, int]] = {}  # first case with the response, and its place there
        for outcome in outcomes:
            self.add(outcome)

    @property
    def count(self) -> int:
        """Number of cases computed."""
        return int(self.known.sum())

    @property
    def solved(self) -> Bools:
        """(cases,) whether each has responses."""
        solved = self.known.copy()
        solved[list(self.failures)] = False
        return solved

    def add(self, outcome: CaseOutcome) -> None:
        """Put one case in its row."""
        index = outcome.index
        self.known[index] = True
        self.processor_time_s += outcome.processor_time_s
        if not outcome.outcome.complete:
            self.failures[index] = outcome
            return
        for place, (name, value) in enumerate(outcome.values.items()):
            self._first[name] = min(self._first.get(name, (index, place)), (index, place))
            if isinstance(value, list):
                self._wide(name, len(value))[index, : len(value)] = value
            else:
                column = self._columns.setdefault(name, np.full(self.known.size, np.nan))
                column[(index, 0)[: column.ndim]] = value

    @property
    def columns(self) -> dict[str, Floats]:
        """By name of the response its value in each case, nan where there is none; in the order of the first case."""
        return {name: self._columns[name] for name in sorted(self._first, key=lambda name: self._first[name])}

    def _wide(self, name: str, width: int) -> Floats:
        """The column of a response that has several values a case, with room for so many."""
        old = self._columns.get(name, np.zeros((self.known.size, 0)))
        old = old if old.ndim == 2 else old[:, None]
        if old.shape[1] < width:
            old = np.hstack([old, np.full((self.known.size, width - old.shape[1]), np.nan)])
        self._columns[name] = old
        return old
