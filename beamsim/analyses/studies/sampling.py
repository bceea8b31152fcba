"""Probability that a limit state is not positive, in the space of independent standard normal variables.

Subset simulation (S. K. Au and J. L. Beck, Probabilistic Engineering Mechanics 16, 2001) reaches rare events through
intermediate levels; its chains take steps that preserve the normal distribution (I. Papaioannou et al., ibid. 41,
2015), with a step size that follows their acceptance rate. Each level is the best value among the discarded samples,
and only better samples continue, so that the estimate is unbiased (C.-E. Bréhier et al., Annals of Applied Probability
26, 2016). OpenTURNS finds the nearest point of the limit state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamsim.errors import ScenarioError
from beamsim.typing import Floats, Ints

SEED_SHARE = 0.1  # share of the samples of a level from which the next level starts
ACCEPTANCE = 0.44  # target acceptance rate of the steps, at which chains mix fastest
STEP, SEARCH_TOLERANCE = 1e-4, 1e-5  # finite-difference step, and tolerance of the search for the nearest point
LEAST_SCATTER = 4  # number of estimates from which their own scatter is used
MOST_CALLS = 20  # limit-state calls per variable in a search for the nearest point
# largest distance from the limit, in standard deviations, of a point that counts as on it
LARGEST_LIMIT_DISTANCE = 0.03


Blend = tuple[tuple[tuple[int, ...], float], ...]
"""Blend of realisations: for each realisation its seeds (one for each process) and its share; the squares of the
shares add up to one."""


class Points(NamedTuple):
    """Samples of standard normal variables and of realisations of independent random processes."""

    u: Floats  # (n, d)
    blends: NDArray[np.object_]  # (n,) of `Blend`

    def select(self, selection: Any) -> Points:
        """Selected points, by indices or by a mask."""
        return Points(self.u[selection], self.blends[selection])


LimitState = Callable[[Points], Floats]
"""(n,) values, not positive beyond the limit."""


class _TooManyCalls(Exception):
    """Raised when a search exceeds its number of limit-state calls."""


class Estimate(NamedTuple):
    """A probability with its coefficient of variation."""

    probability: float
    variation: float


def points_at(u: Floats, seeds: Ints | None = None) -> Points:
    """Points at coordinates (n, d), with realisations for the seeds (n, processes)."""
    rows: list[list[int]] = [[]] * len(u) if seeds is None else seeds.tolist()
    blends: list[Blend] = [((tuple(row), 1.0),) for row in rows]
    return Points(u, np.fromiter(blends, dtype=object, count=len(u)))


def draw(generator: np.random.Generator, count: int, template: Points) -> Points:
    """Draw independent samples with as many variables and processes as ``template``."""
    processes = len(template.blends[0][0][0])
    seeds = generator.integers(2**31, size=(count, processes))
    return points_at(generator.standard_normal((count, template.u.shape[1])), seeds)


def average(terms: Sequence[Floats]) -> Estimate:
    """Mean of independent numbers; its coefficient of variation is infinite if all are zero."""
    values = np.concatenate(terms)
    mean = float(values.mean())
    return Estimate(mean, float(values.std()) / mean / math.sqrt(values.size) if mean > 0.0 else math.inf)


def mean_of(estimates: Sequence[Estimate]) -> Estimate:
    """Mean of independent estimates of equal weight.

    From four estimates on, their own scatter is used if it is larger than the stated one.
    """
    each, count = np.array([of.probability for of in estimates]), len(estimates)
    mean = float(each.mean())
    spread = math.sqrt(sum((of.probability * of.variation) ** 2 for of in estimates)) / count
    if count >= LEAST_SCATTER:
        spread = max(spread, float(each.std(ddof=1)) / math.sqrt(count))
    return Estimate(mean, spread / mean)


class SubsetLevel(NamedTuple):
    """A level of a subset simulation."""

    estimate: Estimate  # of the probability of the level
    samples: Points  # samples inside the level
    values: Floats  # of the limit state there
    ancestors: Ints  # chains of the first level from which the samples descend
    threshold: float  # threshold: samples inside the level are below it; zero at the limit


def subset_levels(
    state: LimitState, generator: np.random.Generator, count: int, origin: Points
) -> Iterator[SubsetLevel]:  # fmt: skip
    """Yield the levels of a subset simulation, ending at the limit or where most samples have the same value.

    Parameters
    ----------
    state : the limit state.
    generator : source of all random numbers.
    count : number of samples of a level.
    origin : a point with the required number of variables and processes.

    Yields
    ------
    SubsetLevel
    """
    points, chains, width = draw(generator, count, origin), max(1, round(count * SEED_SHARE)), 0.6
    values, probability, variance, steps = state(points), 1.0, 0.0, 1
    before, parents, families = 0.0, np.zeros(0, dtype=int), 0  # of the previous level
    ancestors = np.arange(values.size)
    while True:
        order = np.argsort(values, kind="stable")
        edge = max(0.0, float(values[order[min(chains, values.size - 1)]]))  # best value among the discarded samples
        bound = math.nextafter(edge, -math.inf) if edge > max(0.0, float(values[order[0]])) else edge
        inside = values <= bound
        probability *= float(inside.mean())
        hits = inside.reshape(-1, steps).sum(axis=1)
        own = _relative_variance(hits)
        variance += own
        if parents.size:  # covariance of two levels, from the chains that descend from each chain
            variance += max(0.0, _relative_variance(np.bincount(parents, hits, minlength=families)) - own - before)
        estimate = Estimate(probability, math.sqrt(variance))
        yield SubsetLevel(estimate, points.select(inside), values[inside], ancestors[inside], edge)
        if edge == 0.0 or inside.mean() > 0.5:
            return
        first = order[: int(inside.sum())]
        if first.size > chains:  # several samples have the value of the edge
            first = generator.choice(first, chains, replace=False)
        else:  # some discarded samples have that value, too
            first = np.append(first, generator.choice(first, chains - first.size))
        before, parents, families = own, first // steps, hits.size
        points, values, width = _chains(state, generator, points.select(first), values[first], bound, width)
        steps = values.size // chains
        ancestors = np.repeat(ancestors[first], steps)


def _relative_variance(sums: Floats | Ints) -> float:
    """Variance of the mean of independent sums over its square; infinite for a single sum."""
    return float(sums.var(ddof=1)) / sums.size / float(sums.mean()) ** 2 if sums.size > 1 else math.inf


def _chains(
    state: LimitState, generator: np.random.Generator, points: Points, values: Floats, threshold: float, width: float
) -> tuple[Points, Floats, float]:
    """Run chains from given points within an edge; returns samples, their values, and the step width."""
    count = values.size
    along, of = [points], [values]
    for step in range(1, round(1.0 / SEED_SHARE)):
        stays, new = math.sqrt(1.0 - width**2), draw(generator, count, points)
        blends = [
            (*((seeds, stays * share) for seeds, share in old), *((seeds, width * share) for seeds, share in added))
            for old, added in zip(points.blends, new.blends, strict=True)
        ]
        tried = Points(stays * points.u + width * new.u, np.fromiter(blends, dtype=object, count=count))
        reached = state(tried)
        goes = reached <= threshold
        points = Points(np.where(goes[:, None], tried.u, points.u), np.where(goes, tried.blends, points.blends))
        values = np.where(goes, reached, values)
        along.append(points)
        of.append(values)
        width = min(1.0, max(0.05, width * math.exp((float(goes.mean()) - ACCEPTANCE) / math.sqrt(step))))
    order = np.arange(len(of) * count).reshape(-1, count).T.ravel()
    each = Points(np.concatenate([p.u for p in along]), np.concatenate([p.blends for p in along]))
    return each.select(order), np.concatenate(of)[order], width


def library() -> Any:
    """Import OpenTURNS.

    Raises
    ------
    ScenarioError
        If it is not installed.
    """
    try:
        return import_module("openturns")
    except ImportError:
        remedy = "pip install 'beamsim[reliability]'"
        raise ScenarioError.at("vary.kind", "= reliability needs OpenTURNS, which is not installed", remedy) from None


def nearest_point(state: LimitState, start: Floats) -> tuple[Floats, bool]:
    """Find the point of the limit state nearest to the origin (A. M. Hasofer and N. C. Lind, 1974).

    Parameters
    ----------
    state : the limit state; its gradient is a finite difference.
    start : (d,) start of the search by Rackwitz and Fiessler.

    Returns
    -------
    (d,) point, and True if it lies on the limit.
    """
    ot, raised, slope, calls = library(), list[Exception](), 1.0, 0

    def values(u: Any) -> Any:
        nonlocal calls
        calls += len(u)
        if calls > MOST_CALLS * (start.size + 2):
            raise _TooManyCalls
        try:
            return state(points_at(np.asarray(u, dtype=float)))[:, None] / slope
        except Exception as error:  # OpenTURNS would replace the exception
            raised.append(error)
            raise

    function = ot.PythonFunction(start.size, 1, func_sample=values)
    function.setGradient(ot.NonCenteredFiniteDifferenceGradient([STEP] * start.size, function.getEvaluation()))
    search = ot.AbdoRackwitz(ot.NearestPointProblem(function, 0.0))
    search.setStartingPoint(start)
    search.setMaximumIterationNumber(40)
    search.setCheckStatus(False)
    for error in ("Absolute", "Relative", "Residual", "Constraint"):
        getattr(search, f"setMaximum{error}Error")(SEARCH_TOLERANCE)
    try:
        slope = float(np.linalg.norm(function.gradient(start)))  # its line search works best with a slope of about one
        if not slope > 0.0:
            return start, False
        search.run()
        point = np.asarray(search.getResult().getOptimalPoint(), dtype=float)
        return point, bool(np.all(np.isfinite(point))) and abs(float(values([point])[0, 0])) < LARGEST_LIMIT_DISTANCE
    except Exception:
        if raised:
            raise raised[0] from None
        return start, False
