"""Estimators of the probability that a limit state is not positive, each with its own check.

They are independent of cases: a limit state is a function of independent standard normal variables and, if there are
any, realisations of random processes (`sampling.Points`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.studies import sampling
from beamsim.analyses.studies.regions import Regions, increased_scatter
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from beamsim.typing import Bools, Floats, Ints

FAILED = -1.0  # limit-state value of a failed history, which counts as exceeding the limits
MOST_EXPLORING = 512  # samples at increased scatter
EXPLORING = 100  # least number per variable, since regions of several variables are small
# share of the probability above which a region must be sampled, with 95 % certainty
SAMPLED_SHARE, HIT_DEVIATIONS = 1e-2, 1.645
UNKNOWN_DISTANCE = 4.5  # distance of regions, if a subset simulation does not give it
# standard deviations that chance explains; subset simulations that decide
LARGEST_DEVIATION, MOST_CHECKS = 2.5, 4
MOST_IN_BATCH = 250  # samples between two fits of the sampling density
MOST_RESTARTS = 3  # restarts for new regions; a curved limit has many, and later samples count more
NEW_REGION_SHARE = 0.3  # share of the probability of a new region above which earlier samples are discarded
MISSED_SHARE = 0.1  # share of the probability of a region that a subset simulation must not miss
OTHER_METHOD_REMEDY = "write method: importance_sampling"
MORE_CASES_REMEDY = "give more most_cases"
RARE_PROBABILITY = 0.1  # probability above which an event is not rare


class Round(NamedTuple):
    """Estimate of the probability after a number of histories."""

    histories: int
    level: float  # threshold of 1 - value / limit; 0 is the limit itself
    probability: float
    variation: float  # coefficient of variation; infinite or nan if there is none


class Failures(NamedTuple):
    """Samples beyond the limit."""

    points: sampling.Points
    values: Floats  # (n,) of the limit state
    weights: Floats  # (n,) contribution of each to the probability
    groups: Ints  # (n,) samples of the same group are dependent


class Estimator:
    """Estimate of a probability, its uncertainty, and the samples beyond the limit.

    Parameters
    ----------
    state : limit state. An exception of it ends the estimation; earlier results are kept.
    origin : a point with the required number of variables and processes.
    method : monte_carlo, form, subset or importance_sampling.
    samples : number of samples of each level and batch.
    target : coefficient of variation at which sampling stops.
    seed : seed of all random numbers.
    report : called with each new round at the limit.
    """

    def __init__(
        self, state: sampling.LimitState, origin: sampling.Points, *, method: str, samples: int, target: float,
        seed: int = 0, report: Callable[[Round], None] = lambda _: None,
    ) -> None:  # fmt: skip
        self.origin, self.method, self.samples, self.target = origin, method, samples, target
        self.generator, self.seed = np.random.default_rng(seed), seed
        self.evaluated_count = 0  # number of evaluated samples
        self.rounds: list[Round] = []
        self.estimate = sampling.Estimate(math.nan, math.inf)
        self.outcome = COMPLETE  # replaced if the method has no estimate, or a doubtful one
        self.check = COMPLETE  # result of the check of the regions
        self.cross_check = math.nan  # probability of the subset simulations that check another method
        self.critical: sampling.Points | None = None  # the design point
        self.regions = Regions(self, self.generator)
        self.restarts = 0
        self._batches: list[Failures] = []
        self._state, self._report = state, report
        sampling.library().RandomGenerator.SetSeed(seed)

    def __call__(self, points: sampling.Points) -> Floats:
        """(n,) values of the limit state."""
        values = self._state(points)
        self.evaluated_count += len(values)
        return values

    def sample_until_sure(self) -> None:
        """Sample until the target is reached, and check the estimate."""
        METHODS[self.method](self)
        if self.critical is None and self._batches and self.failures.weights.size:
            self._locate()

    @property
    def failures(self) -> Failures:
        """Samples beyond the limit that contribute to the estimate."""
        of, shares = self._batches, self._shares(len(self._batches))
        if not of:
            return Failures(self.origin.select([]), np.zeros(0), np.zeros(0), np.zeros(0, dtype=int))
        starts = np.cumsum([0, *(batch.groups.max(initial=-1) + 1 for batch in of)])
        points = sampling.Points(
            np.vstack([batch.points.u for batch in of]), np.concatenate([batch.points.blends for batch in of])
        )
        weights = np.concatenate([share * batch.weights for share, batch in zip(shares, of, strict=True)])
        groups = np.concatenate([start + batch.groups for start, batch in zip(starts, of, strict=False)])
        return Failures(points, np.concatenate([batch.values for batch in of]), weights, groups)

    def _shares(self, count: int) -> Floats:
        """Weights of batches in the estimate; later ones of importance sampling are surer (Owen, Zhou, 2019)."""
        sizes = np.sqrt(np.arange(1.0, count + 1.0)) if self.method == "importance_sampling" else np.ones(count)
        return np.asarray(sizes / sizes.sum()) if count else sizes

    def store(self, points: sampling.Points, values: Floats, weights: Floats, groups: Ints | None = None) -> Bools:
        """Store the samples of a batch that are beyond the limit; returns their mask.

        The sum of their weights is the probability; without ``groups`` the samples are independent.
        """
        beyond = values <= 0.0
        own = np.arange(len(values)) if groups is None else groups
        self._batches.append(Failures(points.select(beyond), values[beyond], weights[beyond], own[beyond]))
        return beyond

    def add_round(self, estimate: sampling.Estimate) -> bool:
        """Store an estimate; True if it reaches the target."""
        self.estimate = estimate
        self.rounds.append(Round(self.evaluated_count, 0.0, *estimate))
        self._report(self.rounds[-1])
        return estimate.variation <= self.target

    def level(self) -> sampling.SubsetLevel:
        """Last level of a subset simulation; earlier levels are stored as rounds."""
        for level in sampling.subset_levels(self, self.generator, self.samples, self.origin):
            if level.threshold > 0.0:
                self.rounds.append(Round(self.evaluated_count, level.threshold, *level.estimate))
        return level

    def explore(self, probability: float) -> Floats:
        """Points beyond the limit in a space-filling sample that reaches regions rarer than ``probability``."""
        from scipy.special import ndtri

        distance = UNKNOWN_DISTANCE if math.isnan(probability) else -float(ndtri(SAMPLED_SHARE * probability))
        self.scale = max(1.5, distance / HIT_DEVIATIONS)
        size = self.origin.u.shape[1]
        count = min(max(self.samples, EXPLORING * size), MOST_EXPLORING)
        u = increased_scatter(count, size, self.scale, self.seed)
        return u[self(sampling.points_at(u)) <= 0.0]

    def restart(self) -> None:
        """Discard samples that were drawn before a region was known."""
        self._batches.clear()
        self.restarts += 1

    def _locate(self) -> None:
        """Set the design point: the nearest point or, with random processes, the sample closest to the limit."""
        failures = self.failures
        if self.origin.blends[0][0][0]:
            self.critical = failures.points.select([int(np.argmax(failures.values))])
            return
        nearest = np.argsort(np.linalg.norm(failures.points.u, axis=1), kind="stable")
        self.critical = failures.points.select(nearest[:1])
        self.critical = sampling.points_at(sampling.nearest_point(self, self.critical.u[0])[0][None])


def monte_carlo(estimator: Estimator, *computed: tuple[sampling.Points, Floats]) -> None:
    """Draw independent samples, in addition to those with known values."""
    terms: list[Floats] = []
    for points, values in computed:
        terms.append(estimator.store(points, values, np.full(len(values), 1.0 / len(values))).astype(float))
    while not terms or not estimator.add_round(sampling.average(terms)):
        points = sampling.draw(estimator.generator, estimator.samples, estimator.origin)
        terms.append(
            estimator.store(points, estimator(points), np.full(estimator.samples, 1.0 / estimator.samples)).astype(
                float
            )
        )


def form(estimator: Estimator) -> None:
    """First-order estimate: probability beyond the tangent plane of the limit state at its nearest point."""
    from scipy.special import ndtr

    safe = float(estimator(estimator.origin)[0]) > 0.0
    point, found = sampling.nearest_point(estimator, estimator.origin.u[0])
    if found:
        estimator.critical, distance = sampling.points_at(point[None]), float(np.linalg.norm(point))
        estimator.add_round(sampling.Estimate(float(ndtr(-distance if safe else distance)), math.nan))
        kind, code, sentence = OutcomeKind.NOTED, "first_order", "first-order approximation, which has no interval"
    else:
        kind, code, sentence = (
            OutcomeKind.FAILED,
            "no_design_point",
            "no point of the limit was found by gradients",
        )
    estimator.outcome = Outcome.of(kind, code, sentence, remedy=OTHER_METHOD_REMEDY)


def subset(estimator: Estimator) -> None:
    """Subset simulations, repeated until the mean reaches the target, at least twice."""
    found: list[sampling.Estimate] = []
    while (level := estimator.level()).threshold == 0.0:
        found.append(level.estimate)
        weights = np.full(level.values.size, level.estimate.probability / level.values.size)
        estimator.store(level.samples, level.values, weights, level.ancestors)
        sure = estimator.add_round(sampling.mean_of(found))
        if sure and len(found) > 1:
            break
    else:
        estimator.outcome = _one_value()
        return
    if estimator.origin.blends[0][0][0]:
        return  # realisations cannot be drawn at increased scatter
    if estimator.estimate.probability > RARE_PROBABILITY:
        return
    failures = estimator.failures
    estimator.regions.locate_regions(np.vstack([failures.points.u, estimator.explore(estimator.estimate.probability)]))
    seen = np.bincount(estimator.regions.nearest(failures.points.u), failures.weights, len(estimator.regions.found))
    missed = (seen == 0.0) & (estimator.regions.tangent_probabilities() > MISSED_SHARE * estimator.estimate.probability)
    estimator.critical = estimator.regions.nearest_point()
    if missed.any():
        count = f"{int(missed.sum())} of {len(seen)} regions"
        sentence = f"the levels miss {count} that a sample at increased scatter finds"
        estimator.check = Outcome.of(OutcomeKind.UNTRUSTED, "regions", sentence, remedy=OTHER_METHOD_REMEDY)


def _one_value() -> Outcome:
    sentence = "most histories have one value, such as the force of an open stop: the search has no direction"
    return Outcome.of(OutcomeKind.UNTRUSTED, "one_value", sentence, remedy="limit a displacement")


def importance_sampling(estimator: Estimator) -> None:
    """Sample about the regions found by a subset simulation and at increased scatter, until both methods agree."""
    level = estimator.level()
    known = level.threshold == 0.0
    if known and not estimator.rounds:  # the event is not rare
        estimator.method = "monte_carlo"
        return monte_carlo(estimator, _whole_first_level(estimator, level.samples, level.values))
    inside = level.samples.u if known else level.samples.u[:0]
    bad = estimator.explore(level.estimate.probability if known else math.nan)
    estimator.regions.locate_regions(np.vstack([inside, bad]))
    if not estimator.regions.found:
        estimator.outcome = _one_value()
        return None
    checks = [level.estimate] if known else []
    if known:
        estimator.add_round(level.estimate)
        estimator.check = Outcome.of(
            OutcomeKind.UNTRUSTED, "not_checked", "the estimate is not checked", remedy=MORE_CASES_REMEDY
        )
    else:
        estimator.check = _one_value()
    estimator.critical = estimator.regions.nearest_point()
    while not (
        _sample_regions(estimator, inside) and (not known or _agrees(estimator, checks))
    ):  # repeated for every new region
        estimator.restart()
    estimator.critical = estimator.regions.nearest_point()
    return None


def _whole_first_level(estimator: Estimator, points: sampling.Points, values: Floats) -> tuple[sampling.Points, Floats]:
    """Complete the first level of a subset simulation with the samples that are not beyond the limit."""
    more = estimator.samples - len(values)
    rest = sampling.points_at(np.zeros((more, points.u.shape[1])))
    return (
        sampling.Points(np.vstack([points.u, rest.u]), np.concatenate([points.blends, rest.blends])),
        np.append(values, np.ones(more)),
    )


def _sample_regions(estimator: Estimator, u: Floats) -> bool:
    """Sample about the known regions until the target is reached; False as soon as a significant new one appears.

    Contributions of insignificant new regions are kept: discarding such batches would bias the estimate.

    ``u`` (n, d) are samples beyond the limit, whose spread the first density has.
    """
    from scipy.stats import norm

    means: list[sampling.Estimate] = []
    weights, count = np.ones(len(u)), min(estimator.samples, MOST_IN_BATCH)
    while True:
        density = estimator.regions.density(u, weights, estimator.scale)
        drawn = np.asarray(density.getSample(count))
        weight = np.exp(norm.logpdf(drawn).sum(axis=1) - np.ravel(density.computeLogPDF(drawn)))
        points = sampling.points_at(drawn)
        beyond = estimator.store(points, estimator(points), weight / count)
        means.append(_weighted_mean(weight * beyond))
        failures = estimator.failures
        u, weights = failures.points.u, failures.weights
        sure = estimator.add_round(_combine(means, estimator._shares(len(means))))
        stray = weight[beyond] @ ~estimator.regions.contains(drawn[beyond])
        new = estimator.regions.locate_regions(drawn[beyond])
        if new and stray > NEW_REGION_SHARE * (weight @ beyond) and estimator.restarts < MOST_RESTARTS:
            return False
        if sure:
            return True


def _weighted_mean(terms: Floats) -> sampling.Estimate:
    """Mean of weighted samples; its variance includes one unseen sample as heavy as the heaviest."""
    mean, variation = sampling.average([terms])
    return sampling.Estimate(mean, math.hypot(variation, terms.max() / mean / terms.size) if mean > 0.0 else variation)


def _combine(means: list[sampling.Estimate], shares: Floats) -> sampling.Estimate:
    """Weighted sum of independent estimates."""
    probabilities = np.array([mean.probability for mean in means])
    spreads = np.array([m.probability * m.variation if m.probability > 0.0 else 0.0 for m in means])
    total = float(shares @ probabilities)
    return sampling.Estimate(total, float(np.linalg.norm(shares * spreads)) / total if total > 0.0 else math.inf)


def _agrees(estimator: Estimator, checks: list[sampling.Estimate]) -> bool:
    """Compare with subset simulations, with more of them if they differ; False if these find a new region."""
    while (
        apart := _difference_in_deviations(estimator.estimate, sampling.mean_of(checks))
    ) > LARGEST_DEVIATION and len(checks) < MOST_CHECKS:
        estimate, level = estimator.estimate, estimator.level()
        if level.threshold > 0.0:
            break
        checks.append(level.estimate)
        if estimator.regions.locate_regions(level.samples.u):
            return False
        estimator.add_round(estimate)
    estimator.cross_check = sampling.mean_of(checks).probability
    if apart > LARGEST_DEVIATION:
        sentence = (
            f"subset simulations find {estimator.cross_check:.2g}, far from the estimate: a region may be missing"
        )
        estimator.check = Outcome.of(OutcomeKind.UNTRUSTED, "regions", sentence, remedy="give more samples")
    else:
        estimator.check = COMPLETE
    return True


def _difference_in_deviations(first: sampling.Estimate, second: sampling.Estimate) -> float:
    """Difference of two estimates in standard deviations of the logarithm."""
    spread = math.sqrt(math.log1p(first.variation**2) + math.log1p(second.variation**2))
    return abs(math.log(first.probability / second.probability)) / spread


METHODS: dict[str, Any] = {
    "monte_carlo": monte_carlo, "form": form, "subset": subset, "importance_sampling": importance_sampling,
}  # fmt: skip
