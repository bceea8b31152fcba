"""What a probability has to do with the numbers that scatter, over all failure regions.

Shifting the distribution of a number moves each failure region in the space of standard normal variables, by as much as
its nearest point. The normal density at the place where a sample beyond the limit is then, over that where it was, says
how the probability changes: by finite shifts, and its derivative.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from beamsim.analyses.studies.estimators import Estimator, Failures
from beamsim.analyses.studies.layouts import RANDOM_NUMBERS
from beamsim.analyses.studies.scatter import Scatter
from beamsim.labelled import Dataset
from beamsim.scenario.studies import VariedParameter
from beamsim.typing import Floats, Ints

STEP = 1e-4  # of a standard deviation, for derivatives
FARTHEST = 3.0  # deviations that a mean moves at most
DRAWS = 2000  # of derivatives, for the intervals of importance
SIDES = {"rises": 1.0, "falls": -1.0}


class _Regions:
    """Failure regions that move with the distributions of the numbers.

    Parameters
    ----------
    points : (regions, d) nearest points.
    region : (n,) of each sample beyond the limit.
    failures : these samples.
    """

    def __init__(self, points: Floats, region: Ints, failures: Failures) -> None:
        self.points, self.region, self.u = points, region, failures.points.u
        self.weights = failures.weights / failures.weights.sum()
        _, self.group = np.unique(failures.groups, return_inverse=True)

    def ratios(self, moves: Floats) -> Floats:
        """(n,) density of each sample where its region has moved to, over that where it is; moves are (regions, d)."""
        own = moves[self.region]
        return np.asarray(np.exp(-np.sum(own * (self.u + 0.5 * own), axis=1)))

    def slopes(self, moves: Floats) -> Floats:
        """(n,) derivative of that for small moves."""
        return np.asarray(-np.sum(moves[self.region] * self.u, axis=1))

    def covariance(self, terms: Floats) -> Floats:
        """(k, k) covariance of the weighted means of terms (n, k)."""
        about = self.weights[:, None] * (terms - self.weights @ terms)
        sums = np.zeros((int(self.group.max()) + 1, terms.shape[1]))
        np.add.at(sums, self.group, about)
        return np.asarray(sums.T @ sums)


def dependence(scatter: Scatter, estimator: Estimator, numbers: Sequence[VariedParameter]) -> Dataset:
    """Importance of each number, derivatives of the logarithm of the probability, and what doubles it.

    Parameters
    ----------
    scatter : the numbers that scatter.
    estimator : an estimator that has found a design point.
    numbers : as they are varied.

    Returns
    -------
    Dataset
        With 95 % intervals where the method has any.
    """
    assert estimator.critical is not None
    critical = estimator.critical.u[0]
    found = (
        _dependence_of_samples(scatter, estimator)
        if estimator.failures.weights.size
        else _beyond_a_plane(scatter, critical, estimator)
    )
    importance, low, high = found["importance"]
    unit = {"number": [{"unit": number.unit} for number in numbers]}
    sizes = scatter.deviations[:, None]
    doubles = {name: found["doubles"][k] * sizes for k, name in enumerate(("doubles", "doubles_low", "doubles_high"))}
    values = {
        "number": [number.path for number in numbers], "mean": scatter.means, "deviation": scatter.deviations,
        "design": scatter.values(critical[None])[0],
        "importance": importance, "importance_low": low, "importance_high": high,
        "by_mean": found["by_mean"][0], "by_mean_low": found["by_mean"][1], "by_mean_high": found["by_mean"][2],
        "by_deviation": found["by_deviation"], "side": list(SIDES), **doubles,
    }  # fmt: skip
    return RANDOM_NUMBERS.dataset(values, unit)


def _dependence_of_samples(scatter: Scatter, estimator: Estimator) -> dict[str, Floats]:
    """Dependence from samples beyond the limit, with intervals from their scatter."""
    failures = estimator.failures
    if estimator.origin.blends[0][0][0]:  # with random processes the mean of what fails stands for the nearest point
        points = (failures.weights @ failures.points.u / failures.weights.sum())[None]
    elif estimator.regions.found and estimator.method != "monte_carlo":
        points = np.array([region.point for region in estimator.regions.found])
    else:
        points = estimator.critical.u if estimator.critical is not None else estimator.origin.u
    one = len(points) == 1
    region = np.zeros(len(failures.weights), dtype=int) if one else estimator.regions.nearest(failures.points.u)
    regions, count = _Regions(points, region, failures), len(scatter.numbers)
    shifts = np.array([regions.slopes(scatter.shift_changes(points, k, STEP)) / STEP for k in range(count)]).T
    widths = np.array([regions.slopes(scatter.width_changes(points, k, STEP)) / STEP for k in range(count)]).T
    by_mean, covariance = regions.weights @ shifts, regions.covariance(shifts)
    spread = 1.96 * np.sqrt(np.diag(covariance))
    draws = np.random.default_rng(0).multivariate_normal(by_mean, covariance, DRAWS, method="eigh")
    ends = np.quantile(_shares(draws), [0.025, 0.975], axis=0)
    doubles = np.full((3, count, len(SIDES)), math.nan)
    for k in range(count):
        for j, sign in enumerate(SIDES.values()):
            doubles[:, k, j] = _doubling_of(regions, lambda by, k=k: scatter.shift_changes(points, k, by), sign)  # type: ignore[misc]
    return {
        "importance": np.array([_shares(by_mean[None])[0], *ends]),
        "by_mean": np.array([by_mean, by_mean - spread, by_mean + spread]),
        "by_deviation": regions.weights @ widths, "doubles": doubles,
    }  # fmt: skip


def _shares(by_mean: Floats) -> Floats:
    """(n, d) shares of the squares of derivatives (n, d)."""
    squares = by_mean**2
    return np.asarray(squares / np.maximum(squares.sum(axis=1, keepdims=True), 1e-300))


def _doubling_of(regions: _Regions, moves: Callable[[float], Floats], sign: float) -> tuple[float, float, float]:
    """The shift to one side for which the probability doubles, in deviations, and the ends of its 95 % interval."""

    def ratios(by: float) -> Floats:
        return regions.ratios(moves(by))

    by = _doubling(lambda by: float(regions.weights @ ratios(by)), sign)
    if math.isnan(by):
        return math.nan, math.nan, math.nan
    slope = float(regions.weights @ (ratios(by + STEP) - ratios(by - STEP))) / (2.0 * STEP)
    spread = math.sqrt(float(regions.covariance(ratios(by)[:, None])[0, 0]))
    factor = math.exp(min(1.96 * spread / max(abs(slope * by), 1e-300), 50.0))
    return by, by / factor, by * factor


def _doubling(ratio: Callable[[float], float], sign: float) -> float:
    """The smallest shift to one side at which a ratio that is 1 without a shift is 2; nan where there is none."""
    from scipy.optimize import brentq

    before = 0.0
    for step in np.linspace(0.0, FARTHEST, 25)[1:]:
        by = sign * float(step)
        reached = ratio(by)
        if not math.isfinite(reached):
            return math.nan
        if reached >= 2.0:
            return float(brentq(lambda x: ratio(x) - 2.0, before, by, xtol=1e-6))
        before = by
    return math.nan


def _beyond_a_plane(scatter: Scatter, point: Floats, estimator: Estimator) -> dict[str, Floats]:
    """Dependence from the half-space beyond the plane tangent to the limit state at a point; no intervals."""
    from scipy.stats import norm

    index, count = float(norm.isf(estimator.estimate.probability)), len(scatter.numbers)
    normal, at = point / index, point[None]

    def ratio(moves: Floats) -> float:
        return math.exp(norm.logsf(index + float(normal @ moves[0])) - norm.logsf(index))

    hazard = math.exp(norm.logpdf(index) - norm.logsf(index))
    by_mean = np.array([-normal @ scatter.shift_changes(at, k, STEP)[0] for k in range(count)]) / STEP * hazard
    by_width = np.array([-normal @ scatter.width_changes(at, k, STEP)[0] for k in range(count)]) / STEP * hazard
    doubles = np.full((3, count, len(SIDES)), math.nan)
    for k in range(count):
        for j, sign in enumerate(SIDES.values()):
            doubles[0, k, j] = _doubling(lambda by, k=k: ratio(scatter.shift_changes(at, k, by)), sign)  # type: ignore[misc]
    none = np.full(count, math.nan)
    return {
        "importance": np.array([_shares(by_mean[None])[0], none, none]), "by_mean": np.array([by_mean, none, none]),
        "by_deviation": by_width, "doubles": doubles,
    }  # fmt: skip
