"""Probability that a limit state is not positive, in the space of independent standard normal variables.

Subset simulation (S. K. Au and J. L. Beck, Probabilistic Engineering Mechanics 16, 2001) comes to rare events by
levels; its chains take steps that keep the normal distribution (I. Papaioannou et al., ibid. 41, 2015), whose length
follows their acceptance. A level is the best value that is left behind, and only what is better goes on, so that the
probability has no bias (C.-E. Bréhier et al., Annals of Applied Probability 26, 2016). OpenTURNS finds the nearest
point of the limit state.
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

KEPT = 0.1  # share of the samples of a level from which those of the next one start
ACCEPTANCE = 0.44  # of steps, at which chains move fastest
STEP, NEAR = 1e-4, 1e-5  # of differences, and errors at which the search for the nearest point ends
LEAST_SCATTER = 4  # estimates whose own scatter is known
MOST_CALLS = 20  # of the limit state for each variable, in a search for the nearest point
FOUND = 0.03  # distance from the limit, in standard deviations, from which the end of the search is no point of it


Blend = tuple[tuple[tuple[int, ...], float], ...]
"""Realisations that are blended: of each its seeds, one for each process, and its share; the squares of the shares add
up to one."""


class Points(NamedTuple):
    """Samples of standard normal variables, and of realisations of independent random processes."""

    u: Floats  # (n, d)
    blends: NDArray[np.object_]  # (n,) of `Blend`

    def select(self, which: Any) -> Points:
        """A selection of the points, by numbers or by a mask."""
        return Points(self.u[which], self.blends[which])


LimitState = Callable[[Points], Floats]
"""(n,) values, not positive beyond the limit."""


class _TooMany(Exception):
    """A search asks for more values than it may."""


class Estimate(NamedTuple):
    """A probability with its coefficient of variation."""

    probability: float
    variation: float


def points_at(u: Floats, seeds: Ints | None = None) -> Points:
    """Points of coordinates (n, d), with the realisations of seeds (n, processes)."""
    rows: list[list[int]] = [[]] * len(u) if seeds is None else seeds.tolist()
    blends: list[Blend] = [((tuple(row), 1.0),) for row in rows]
    return Points(u, np.fromiter(blends, dtype=object, count=len(u)))


def draw(generator: np.random.Generator, count: int, like: Points) -> Points:
    """Independent samples of as many variables as points have, with realisations of as many processes."""
    processes = len(like.blends[0][0][0])
    seeds = generator.integers(2**31, size=(count, processes))
    return points_at(generator.standard_normal((count, like.u.shape[1])), seeds)


def average(terms: Sequence[Floats]) -> Estimate:
    """The mean of independent numbers, whose coefficient of variation is infinite where all are zero."""
    values = np.concatenate(terms)
    mean = float(values.mean())
    return Estimate(mean, float(values.std()) / mean / math.sqrt(values.size) if mean > 0.0 else math.inf)


def mean_of(estimates: Sequence[Estimate]) -> Estimate:
    """Mean of independent estimates of equal weight.

    From four of them on their own scatter counts if it is larger than what they state.
    """
    each, count = np.array([of.probability for of in estimates]), len(estimates)
    mean = float(each.mean())
    spread = math.sqrt(sum((of.probability * of.variation) ** 2 for of in estimates)) / count
    if count >= LEAST_SCATTER:
        spread = max(spread, float(each.std(ddof=1)) / math.sqrt(count))
    return Estimate(mean, spread / mean)


class SubsetLevel(NamedTuple):
    """A level of a subset simulation."""

    estimate: Estimate  # of the probability to be within it
    inside: Points  # samples within it
    values: Floats  # of the limit state there
    ancestors: Ints  # the chains of the first level from which the samples descend
    edge: float  # value that those within do not reach; zero at the limit


def subset_levels(
    state: LimitState, generator: np.random.Generator, count: int, origin: Points
) -> Iterator[SubsetLevel]:  # fmt: skip
    """Yield the levels of a subset simulation, the last at the limit, or where most of the samples have one value.

    Parameters
    ----------
    state : the limit state.
    generator : of all random numbers.
    count : samples of a level.
    origin : a point with as many variables as there are, and with realisations of as many processes.

    Yields
    ------
    SubsetLevel
    """
    points, chains, width = draw(generator, count, origin), max(1, round(count * KEPT)), 0.6
    values, probability, variance, steps = state(points), 1.0, 0.0, 1
    before, parents, families = 0.0, np.zeros(0, dtype=int), 0  # of the level before
    ancestors = np.arange(values.size)
    while True:
        order = np.argsort(values, kind="stable")
        edge = max(0.0, float(values[order[min(chains, values.size - 1)]]))  # of the best that is left behind
        bound = math.nextafter(edge, -math.inf) if edge > max(0.0, float(values[order[0]])) else edge
        inside = values <= bound
        probability *= float(inside.mean())
        hits = inside.reshape(-1, steps).sum(axis=1)
        own = _relative_variance(hits)
        variance += own
        if parents.size:  # what two levels have in common, by the chains that descend from each chain
            variance += max(0.0, _relative_variance(np.bincount(parents, hits, minlength=families)) - own - before)
        estimate = Estimate(probability, math.sqrt(variance))
        yield SubsetLevel(estimate, points.select(inside), values[inside], ancestors[inside], edge)
        if edge == 0.0 or inside.mean() > 0.5:
            return
        first = order[: int(inside.sum())]
        if first.size > chains:  # share the value of the edge
            first = generator.choice(first, chains, replace=False)
        else:  # some that were left behind have that value, too
            first = np.append(first, generator.choice(first, chains - first.size))
        before, parents, families = own, first // steps, hits.size
        points, values, width = _chains(state, generator, points.select(first), values[first], bound, width)
        steps = values.size // chains
        ancestors = np.repeat(ancestors[first], steps)


def _relative_variance(sums: Floats | Ints) -> float:
    """Variance of the mean of independent sums over its square; infinite of a single one."""
    return float(sums.var(ddof=1)) / sums.size / float(sums.mean()) ** 2 if sums.size > 1 else math.inf


def _chains(
    state: LimitState, generator: np.random.Generator, points: Points, values: Floats, edge: float, width: float
) -> tuple[Points, Floats, float]:
    """Chains from points, one after the other, that stay within an edge; samples, their values, the width of a step."""
    count = values.size
    along, of = [points], [values]
    for step in range(1, round(1.0 / KEPT)):
        stays, new = math.sqrt(1.0 - width**2), draw(generator, count, points)
        blends = [
            (*((seeds, stays * share) for seeds, share in old), *((seeds, width * share) for seeds, share in added))
            for old, added in zip(points.blends, new.blends, strict=True)
        ]
        tried = Points(stays * points.u + width * new.u, np.fromiter(blends, dtype=object, count=count))
        reached = state(tried)
        goes = reached <= edge
        points = Points(np.where(goes[:, None], tried.u, points.u), np.where(goes, tried.blends, points.blends))
        values = np.where(goes, reached, values)
        along.append(points)
        of.append(values)
        width = min(1.0, max(0.05, width * math.exp((float(goes.mean()) - ACCEPTANCE) / math.sqrt(step))))
    order = np.arange(len(of) * count).reshape(-1, count).T.ravel()
    each = Points(np.concatenate([p.u for p in along]), np.concatenate([p.blends for p in along]))
    return each.select(order), np.concatenate(of)[order], width


def library() -> Any:
    """OpenTURNS.

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
    """The point where a limit state is zero that is nearest to the origin (A. M. Hasofer and N. C. Lind, 1974).

    Parameters
    ----------
    state : the limit state, whose gradient is found by differences.
    start : (d,) of the search by Rackwitz and Fiessler.

    Returns
    -------
    (d,) point, and whether it is one.
    """
    ot, raised, slope, calls = library(), list[Exception](), 1.0, 0

    def values(u: Any) -> Any:
        nonlocal calls
        calls += len(u)
        if calls > MOST_CALLS * (start.size + 2):
            raise _TooMany
        try:
            return state(points_at(np.asarray(u, dtype=float)))[:, None] / slope
        except Exception as error:  # OpenTURNS would make another one of it
            raised.append(error)
            raise

    function = ot.PythonFunction(start.size, 1, func_sample=values)
    function.setGradient(ot.NonCenteredFiniteDifferenceGradient([STEP] * start.size, function.getEvaluation()))
    search = ot.AbdoRackwitz(ot.NearestPointProblem(function, 0.0))
    search.setStartingPoint(start)
    search.setMaximumIterationNumber(40)
    search.setCheckStatus(False)
    for error in ("Absolute", "Relative", "Residual", "Constraint"):
        getattr(search, f"setMaximum{error}Error")(NEAR)
    try:
        slope = float(np.linalg.norm(function.gradient(start)))  # its line search counts on a slope of about one
        if not slope > 0.0:
            return start, False
        search.run()
        point = np.asarray(search.getResult().getOptimalPoint(), dtype=float)
        return point, bool(np.all(np.isfinite(point))) and abs(float(values([point])[0, 0])) < FOUND
    except Exception:
        if raised:
            raise raised[0] from None
        return start, False
