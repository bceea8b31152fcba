"""What a design study hands back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.result import Result
from beamsim.fields import Entry
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.typing import Bools, Floats

Value = float | str


@dataclass(frozen=True)
class CaseOutcome:
    """One case: its responses, or why there are none."""

    index: int  # in the order of the cases
    values: Mapping[str, float | list[float]]  # by name of the response; lists are per mode
    outcome: Outcome = COMPLETE  # or why it failed
    processor_time_s: float = 0.0


@dataclass(frozen=True)
class Coordinate:
    """A varied parameter."""

    path: str
    values: NDArray[Any]  # (nk,) the axis of a grid, or (cases,) one a case; SI numbers or words
    unit: str

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return self.values.dtype.kind == "f"


@dataclass(frozen=True)
class Response:
    """One response of every case."""

    name: str  # "snubbers/tip/peak_force", of a sweep "up_0/snubbers/tip/peak_force"
    values: Floats  # the design's shape, a last axis of modes where there are several a case; nan: failed
    unit: str
    long_name: str

    @property
    def quantity(self) -> str:
        """What it is, ``peak_force``."""
        return self.name.rpartition("/")[2]

    @property
    def place(self) -> str:
        """Whose it is, ``tip`` or ``tip up_0``; empty for the structure as a whole."""
        *path, _ = self.name.split("/")  # [curve,] [probes or snubbers, whose]
        *curve, _, who = path if len(path) > 1 else (*path, "", "")
        return " ".join([who, *curve]).strip()


@dataclass(frozen=True)
class CaseFailure:
    """A case without responses."""

    case: int  # from 0
    values: tuple[Value, ...]  # of the coordinates
    outcome: Outcome


_SUMMARY = (
    Entry("analysis", "", "what was done with each case: run, or the kind of sweep"),
    Entry("cases", "1", "number of cases"),
    Entry("solved", "1", "cases with responses"),
    Entry("failed", "1", "cases that failed"),
    Entry("margins", "", "by limit, of the worst case: limit, value, margin, at, exceeded, case, parameters; and "
             "the number of cases beyond the limit"),
    Entry("responses", "", "by response: smallest and largest, and with which parameters; of a sample also mean, "
             "standard deviation and the 5 % and 95 % quantiles"),
    Entry("processor_time_s", "s", "processor time of all cases"),
)  # fmt: skip


@dataclass(frozen=True)
class DesignsResult(Result):
    """Everything `beamsim sweep` computes of a scenario with ``vary``."""

    SUMMARY = _SUMMARY

    analysis: str  # what was done with each case: "run", or the kind of sweep
    kind: str  # "grid", "zip" or "latin_hypercube"
    shape: tuple[int, ...]  # of the design: an axis a coordinate for a grid, else (cases,)
    coordinates: tuple[Coordinate, ...]
    solved: Bools  # the design's shape
    responses: Mapping[str, Response]
    margins: Mapping[str, Response]  # limit / value - 1, by name of the limit
    limits: Mapping[str, float]  # SI
    failures: tuple[CaseFailure, ...]
    fingerprint: str = ""  # of all that the responses depend on

    @property
    def cases(self) -> int:
        """Number of cases."""
        return int(np.prod(self.shape))

    def case_values(self, case: int) -> tuple[Value, ...]:
        """Values of the coordinates in a case, numbered from 0."""
        if self.kind == "grid":
            where = np.unravel_index(case, self.shape)
            picked = [c.values[k] for c, k in zip(self.coordinates, where, strict=True)]
        else:
            picked = [c.values[case] for c in self.coordinates]
        return tuple(str(v) if isinstance(v, str) else float(v) for v in picked)


def is_scalar(response: Response, shape: tuple[int, ...]) -> bool:
    """Whether a response is one number a case."""
    return response.values.shape == shape
