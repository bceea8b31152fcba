"""Realisations of every case within tolerances, and the one by which a case is judged."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from beamsim.analyses.designs.result import RealisedResponse, Tolerance
from beamsim.analyses.designs.sampling import latin_hypercube
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path
from beamsim.scenario.parameters import ToleratedParameter, tolerances_of, tolerated_parameters, value_at
from beamsim.typing import Floats, Ints

_LOW, _HIGH = 0.05, 0.95  # quantiles in the summary


@dataclass(frozen=True)
class Realisations:
    """The same sample of deviations about every case; without tolerances only the case itself."""

    parameters: tuple[ToleratedParameter, ...] = ()
    # (realisations, parameters) in shares of the tolerances, from -1 to 1; the first row, zero, is the case itself
    deviations: Floats = field(default_factory=lambda: np.zeros((1, 0)))
    quantile: float = 1.0  # by which a case is judged, counted from the good side

    @classmethod
    def of(cls, scenario: Scenario) -> Realisations:
        """What a scenario with ``vary`` asks for."""
        asked = tolerances_of(scenario)
        if asked is None:
            return cls()
        parameters = tolerated_parameters(scenario)
        units = tuple(replace(p.number, low=-1.0, high=1.0, spacing="linear") for p in parameters)
        sample: Any = latin_hypercube(units, asked.samples, asked.seed)
        return cls(parameters, np.vstack([np.zeros(len(parameters)), np.transpose(sample)]), asked.quantile)

    @property
    def count(self) -> int:
        """Number of realisations of each case, the case itself among them."""
        return int(self.deviations.shape[0])

    def values(self, case: Scenario, realisation: int) -> dict[Path, float]:
        """The numbers of a realisation by place; each deviates from what it is in the case, or follows from there."""
        values: dict[Path, float] = {}
        for parameter, deviation in zip(self.parameters, self.deviations[realisation], strict=True):
            nominal = float(value_at(case, parameter.number.places[0]))
            value = nominal + float(deviation) * parameter.reach(nominal)
            values |= dict.fromkeys(parameter.number.places, value)
        return values

    def tolerances(self) -> tuple[Tolerance, ...]:
        """What is stored of the tolerances."""
        return tuple(
            Tolerance(
                path=p.number.path,
                deviations=self.deviations[:, k],
                tolerance=0.5 * (p.number.high - p.number.low) if p.share is None else p.share,
                unit=p.number.unit if p.share is None else "1",
                relative=p.share is not None,
            )
            for k, p in enumerate(self.parameters)
        )

    def as_data(self) -> list[Any]:
        """Plain data of all that the cases depend on; empty without tolerances."""
        deviations = [] if self.count == 1 else self.deviations.tolist()
        return [
            *([p.number.path, p.share, p.number.low, p.number.high, p.number.places] for p in self.parameters),
            *deviations,
        ]


def judging(values: Floats, quantile: float, *, large_is_good: bool) -> Ints:
    """(cases,) the realisation at the quantile of the values (cases, realisations), or one that is not known."""
    badness = -values if large_is_good else values
    order = np.argsort(badness, axis=1, kind="stable")  # nan comes last
    place = math.ceil(quantile * (values.shape[1] - 1))
    unknown = np.isnan(badness)
    return np.where(unknown.any(axis=1), unknown.argmax(axis=1), order[:, place])


def judged(response: RealisedResponse, quantile: float, *, large_is_good: bool = False) -> Floats:
    """The value of a response by which each case is judged, of the design's shape."""
    rows = response.values.reshape(-1, response.values.shape[-1])
    chosen = judging(rows, quantile, large_is_good=large_is_good)
    return np.asarray(rows[np.arange(len(rows)), chosen].reshape(response.values.shape[:-1]))


def scatter_of(realised: Mapping[str, RealisedResponse], case: int, count: int) -> dict[str, dict[str, float]]:
    """By response what its realisations of a case range over, known ones only."""
    ranges = {}
    for name, response in realised.items():
        values = response.values.reshape(-1, count)[case]
        known = values[np.isfinite(values)]
        if known.size:
            low, high = np.quantile(known, [_LOW, _HIGH])
            ranges[name] = {
                "nominal": float(values[0]),
                "smallest": float(known.min()),
                "largest": float(known.max()),
                "quantile_5_percent": float(low),
                "quantile_95_percent": float(high),
            }
    return ranges
