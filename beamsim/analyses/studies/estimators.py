"""Estimators of the probability that a limit state is not positive, each with a check of its own.

They know nothing of cases: a limit state is a function of independent standard normal variables, and of realisations
of random processes where there are any (`sampling.Points`).
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

FAILED = -1.0  # of the limit state: a history without result counts as one that exceeds the limits
MOST_EXPLORING = 512  # samples at increased scatter
EXPLORING = 100  # for each variable, at least: a region that several of them lead to together is a small part
RARER, HIT = 1e-2, 1.645  # regions of this share of the probability are to be hit by one in twenty of them
UNKNOWN_DISTANCE = 4.5  # of regions, where a subset simulation does not say it
AGREES, MOST_CHECKS = 2.5, 4  # standard deviations of a difference by chance; subset simulations that decide it
MOST_IN_BATCH = 250  # samples between two fits of the density that they are drawn from
MOST_RESTARTS = 3  # with new regions; a limit that bends has ever more of them, and later samples count more
NEW = 0.3  # share of the probability of a new region, from which samples that were drawn without it are forgotten
MISSED = 0.1  # share of the probability of a region that no sample of a subset simulation may leave out
OTHER_METHOD = "write method: importance_sampling"
MORE = "give more most_cases"
RARE = 0.1  # probability above which nothing is rare


class Round(NamedTuple):
    """Estimate of the probability after some histories."""

    histories: int
    level: float  # 1 - value / limit that is counted as exceeded; 0 is the limit itself
    probability: float
    variation: float  # its coefficient; infinite or not a number where there is none


class Failures(NamedTuple):
    """Samples beyond the limit."""

    points: sampling.Points
    values: Floats  # (n,) of the limit state
    weights: Floats  # (n,) share of each in the estimate; their sum is the probability
    groups: Ints  # (n,) samples of one group depend on each other


class Estimator:
    """A probability, how sure it is, and the samples beyond the limit.

    Parameters
    ----------
    state : limit state. What it raises ends the estimation; what is known by then is kept.
    origin : a point with as many variables and processes as the limit state has.
    method : monte_carlo, form, subset or importance_sampling.
    samples : of each level and batch.
    target : largest coefficient of variation of an estimate that is sure.
    seed : of all random numbers.
    report : called with each new round at the limit.
    """

    def __init__(
        self, state: sampling.LimitState, origin: sampling.Points, *, method: str, samples: int, target: float,
        seed: int = 0, report: Callable[[Round], None] = lambda _: None,
    ) -> None:  # fmt: skip
        self.origin, self.method, self.samples, self.target = origin, method, samples, target
        self.generator, self.seed = np.random.default_rng(seed), seed
        self.asked = 0  # samples whose values are known
        self.rounds: list[Round] = []
        self.estimate = sampling.Estimate(math.nan, math.inf)
        self.outcome = COMPLETE  # unless the method has no estimate, or says why it is in doubt
        self.check = COMPLETE  # what the check of the regions says
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
        self.asked += len(values)
        return values

    def sample_until_sure(self) -> None:
        """Sample until the estimate is sure enough, and check it."""
        METHODS[self.method](self)
        if self.critical is None and self._batches and self.failures.weights.size:
            self._locate()

    @property
    def failures(self) -> Failures:
        """The samples beyond the limit that the estimate is made of."""
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
        """Shares of batches in an estimate; later ones of importance sampling are surer (A. Owen and Y. Zhou, 2019)."""
        sizes = np.sqrt(np.arange(1.0, count + 1.0)) if self.method == "importance_sampling" else np.ones(count)
        return np.asarray(sizes / sizes.sum()) if count else sizes

    def keep(self, points: sampling.Points, values: Floats, weights: Floats, groups: Ints | None = None) -> Bools:
        """Keep the samples of a batch that are beyond the limit, and say which these are.

        The sum of the weights beyond the limit is the probability; without ``groups`` the samples are independent.
        """
        beyond = values <= 0.0
        own = np.arange(len(values)) if groups is None else groups
        self._batches.append(Failures(points.select(beyond), values[beyond], weights[beyond], own[beyond]))
        return beyond

    def note(self, estimate: sampling.Estimate) -> bool:
        """Keep an estimate, and say whether it is sure enough."""
        self.estimate = estimate
        self.rounds.append(Round(self.asked, 0.0, *estimate))
        self._report(self.rounds[-1])
        return estimate.variation <= self.target

    def level(self) -> sampling.SubsetLevel:
        """The last level of a subset simulation; a round is kept of each that is not at the limit."""
        for level in sampling.subset_levels(self, self.generator, self.samples, self.origin):
            if level.edge > 0.0:
                self.rounds.append(Round(self.asked, level.edge, *level.estimate))
        return level

    def explore(self, probability: float) -> Floats:
        """Points beyond the limit in a space-filling sample that also reaches regions rarer than a probability."""
        from scipy.special import ndtri

        distance = UNKNOWN_DISTANCE if math.isnan(probability) else -float(ndtri(RARER * probability))
        self.scale = max(1.5, distance / HIT)
        size = self.origin.u.shape[1]
        count = min(max(self.samples, EXPLORING * size), MOST_EXPLORING)
        u = increased_scatter(count, size, self.scale, self.seed)
        return u[self(sampling.points_at(u)) <= 0.0]

    def restart(self) -> None:
        """Forget the samples that were drawn without a region that is known now."""
        self._batches.clear()
        self.restarts += 1

    def _locate(self) -> None:
        """The design point: the nearest one, or with random processes that which is nearest to the limit."""
        failures = self.failures
        if self.origin.blends[0][0][0]:
            self.critical = failures.points.select([int(np.argmax(failures.values))])
            return
        nearest = np.argsort(np.linalg.norm(failures.points.u, axis=1), kind="stable")
        self.critical = failures.points.select(nearest[:1])
        self.critical = sampling.points_at(sampling.nearest_point(self, self.critical.u[0])[0][None])


def monte_carlo(of: Estimator, *known: tuple[sampling.Points, Floats]) -> None:
    """Independent samples, after those whose values are known."""
    terms: list[Floats] = []
    for points, values in known:
        terms.append(of.keep(points, values, np.full(len(values), 1.0 / len(values))).astype(float))
    while not terms or not of.note(sampling.average(terms)):
        points = sampling.draw(of.generator, of.samples, of.origin)
        terms.append(of.keep(points, of(points), np.full(of.samples, 1.0 / of.samples)).astype(float))


def form(of: Estimator) -> None:
    """First-order estimate: probability beyond the plane tangent to the limit state at its nearest point."""
    from scipy.special import ndtr

    safe = float(of(of.origin)[0]) > 0.0
    point, found = sampling.nearest_point(of, of.origin.u[0])
    if found:
        of.critical, distance = sampling.points_at(point[None]), float(np.linalg.norm(point))
        of.note(sampling.Estimate(float(ndtr(-distance if safe else distance)), math.nan))
        kind, code, sentence = OutcomeKind.NOTED, "first_order", "first-order approximation, which has no interval"
    else:
        kind, code, sentence = OutcomeKind.FAILED, "no_design_point", "gradients lead to no point of the limit"
    of.outcome = Outcome.of(kind, code, sentence, remedy=OTHER_METHOD)


def subset(of: Estimator) -> None:
    """Levels up to the limits, again until the mean is sure enough, and at least twice."""
    found: list[sampling.Estimate] = []
    while (level := of.level()).edge == 0.0:
        found.append(level.estimate)
        weights = np.full(level.values.size, level.estimate.probability / level.values.size)
        of.keep(level.inside, level.values, weights, level.ancestors)
        sure = of.note(sampling.mean_of(found))
        if sure and len(found) > 1:
            break
    else:
        of.outcome = _one_value()
        return
    if of.origin.blends[0][0][0]:
        return  # realisations cannot be drawn at increased scatter
    if of.estimate.probability > RARE:
        return
    failures = of.failures
    of.regions.look(np.vstack([failures.points.u, of.explore(of.estimate.probability)]))
    seen = np.bincount(of.regions.nearest(failures.points.u), failures.weights, len(of.regions.found))
    missed = (seen == 0.0) & (of.regions.tangent_probabilities() > MISSED * of.estimate.probability)
    of.critical = of.regions.nearest_point()
    if missed.any():
        count = f"{int(missed.sum())} of {len(seen)} regions"
        sentence = f"the levels miss {count} that a sample at increased scatter finds"
        of.check = Outcome.of(OutcomeKind.UNTRUSTED, "regions", sentence, remedy=OTHER_METHOD)


def _one_value() -> Outcome:
    sentence = "most histories have one value, such as that of a stop that is not reached: nothing leads on"
    return Outcome.of(OutcomeKind.UNTRUSTED, "one_value", sentence, remedy="limit a displacement")


def importance_sampling(of: Estimator) -> None:
    """Samples about the regions that a subset simulation and a sample at increased scatter find, until both agree."""
    level = of.level()
    known = level.edge == 0.0
    if known and not of.rounds:  # nothing is rare
        of.method = "monte_carlo"
        return monte_carlo(of, _whole_first_level(of, level.inside, level.values))
    inside = level.inside.u if known else level.inside.u[:0]
    bad = of.explore(level.estimate.probability if known else math.nan)
    of.regions.look(np.vstack([inside, bad]))
    if not of.regions.found:
        of.outcome = _one_value()
        return None
    checks = [level.estimate] if known else []
    if known:
        of.note(level.estimate)
        of.check = Outcome.of(OutcomeKind.UNTRUSTED, "not_checked", "the estimate is not checked", remedy=MORE)
    else:
        of.check = _one_value()
    of.critical = of.regions.nearest_point()
    while not (_sample_regions(of, inside) and (not known or _agrees(of, checks))):  # as often as there are new regions
        of.restart()
    of.critical = of.regions.nearest_point()
    return None


def _whole_first_level(of: Estimator, points: sampling.Points, values: Floats) -> tuple[sampling.Points, Floats]:
    """The first level of a subset simulation whole: what is not beyond the limit, whose place does not matter."""
    more = of.samples - len(values)
    rest = sampling.points_at(np.zeros((more, points.u.shape[1])))
    return (
        sampling.Points(np.vstack([points.u, rest.u]), np.concatenate([points.blends, rest.blends])),
        np.append(values, np.ones(more)),
    )


def _sample_regions(of: Estimator, u: Floats) -> bool:
    """Sample about the known regions until the estimate is sure; false as soon as a new one has much of it.

    What a new region with little of it adds is kept: to forget such batches would make the estimate too low.

    ``u`` (n, d) are samples beyond the limit, whose spread the first density has.
    """
    from scipy.stats import norm

    means: list[sampling.Estimate] = []
    weights, count = np.ones(len(u)), min(of.samples, MOST_IN_BATCH)
    while True:
        density = of.regions.density(u, weights, of.scale)
        drawn = np.asarray(density.getSample(count))
        weight = np.exp(norm.logpdf(drawn).sum(axis=1) - np.ravel(density.computeLogPDF(drawn)))
        points = sampling.points_at(drawn)
        beyond = of.keep(points, of(points), weight / count)
        means.append(_weighted_mean(weight * beyond))
        failures = of.failures
        u, weights = failures.points.u, failures.weights
        sure = of.note(_combine(means, of._shares(len(means))))
        stray = weight[beyond] @ ~of.regions.contains(drawn[beyond])
        new = of.regions.look(drawn[beyond])
        if new and stray > NEW * (weight @ beyond) and of.restarts < MOST_RESTARTS:
            return False
        if sure:
            return True


def _weighted_mean(terms: Floats) -> sampling.Estimate:
    """The mean of weighted samples, whose variance counts a sample as heavy as the heaviest that was not drawn."""
    mean, variation = sampling.average([terms])
    return sampling.Estimate(mean, math.hypot(variation, terms.max() / mean / terms.size) if mean > 0.0 else variation)


def _combine(means: list[sampling.Estimate], shares: Floats) -> sampling.Estimate:
    """The sum of independent estimates with these shares."""
    probabilities = np.array([mean.probability for mean in means])
    spreads = np.array([m.probability * m.variation if m.probability > 0.0 else 0.0 for m in means])
    total = float(shares @ probabilities)
    return sampling.Estimate(total, float(np.linalg.norm(shares * spreads)) / total if total > 0.0 else math.inf)


def _agrees(of: Estimator, checks: list[sampling.Estimate]) -> bool:
    """Compare with subset simulations, more of them where they differ; false if these find a new region."""
    while (apart := _difference_in_deviations(of.estimate, sampling.mean_of(checks))) > AGREES and len(
        checks
    ) < MOST_CHECKS:
        estimate, level = of.estimate, of.level()
        if level.edge > 0.0:
            break
        checks.append(level.estimate)
        if of.regions.look(level.inside.u):
            return False
        of.note(estimate)
    of.cross_check = sampling.mean_of(checks).probability
    if apart > AGREES:
        sentence = f"subset simulations find {of.cross_check:.2g}, far from it: a region may be missing"
        of.check = Outcome.of(OutcomeKind.UNTRUSTED, "regions", sentence, remedy="give more samples")
    else:
        of.check = COMPLETE
    return True


def _difference_in_deviations(one: sampling.Estimate, other: sampling.Estimate) -> float:
    """How far two estimates differ, in standard deviations of the logarithm."""
    spread = math.sqrt(math.log1p(one.variation**2) + math.log1p(other.variation**2))
    return abs(math.log(one.probability / other.probability)) / spread


METHODS: dict[str, Any] = {
    "monte_carlo": monte_carlo, "form": form, "subset": subset, "importance_sampling": importance_sampling,
}  # fmt: skip
