"""Realisations of every case within tolerances, and the one by which a case is judged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from beamsim.analyses.designs.result import RealisedResponse, Tolerance
from beamsim.analyses.designs.sampling import latin_hypercube
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path
from beamsim.scenario.varied import ToleratedParameter, Value, tolerances_of, tolerated_parameters
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

    @property
    def further(self) -> tuple[ToleratedParameter, ...]:
        """The numbers that have a tolerance but are not varied; their values follow the varied ones."""
        return tuple(p for p in self.parameters if p.varied is None)

    @property
    def further_places(self) -> tuple[tuple[Path, ...], ...]:
        """Where the values of these numbers go."""
        return tuple(p.number.places for p in self.further)

    def values(self, of_case: Sequence[Value], further_of_case: Sequence[float], realisation: int) -> tuple[Value, ...]:
        """The varied numbers of a realisation, then those that only have a tolerance, from what they are in the case.

        Parameters
        ----------
        of_case : the varied numbers of the case.
        further_of_case : the numbers of `further` in the case, SI; they may follow from the varied ones.
        realisation : its number, 0 for the case itself.
        """
        values, further, nominal = list(of_case), [], iter(further_of_case)
        for parameter, deviation in zip(self.parameters, self.deviations[realisation], strict=True):
            value = next(nominal) if parameter.varied is None else float(values[parameter.varied])
            value += float(deviation) * parameter.reach(value)
            if parameter.varied is None:
                further.append(value)
            else:
                values[parameter.varied] = value
        return (*values, *further)

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
            *([p.number.path, p.share, p.number.low, p.number.high, p.varied] for p in self.parameters),
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
