"""Failure regions in the space of independent standard normal variables: how they are found, and densities over them.

They are looked for without gradients, in a space-filling sample at increased scatter; each is then located by its
nearest point. A sample that lies beyond the tangent plane of a known nearest point belongs to that region (compare the
multiple design points of A. Der Kiureghian and T. Dakessian, Structural Safety 20, 1998).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.studies.sampling import LimitState, Points, library, nearest_point, points_at
from beamsim.typing import Bools, Floats, Ints

MOST_REGIONS = 12  # located; what lies between them is covered by the widest density
MORE_THAN_FACES = 4  # of many variables: a limit on the magnitude of each has two faces
IN_VAIN = 3  # searches one after the other that lead to known regions, after which the other samples are left
NEGLIGIBLE = 1e-4  # of the largest probability beyond a tangent plane
APART = 0.5  # standard deviations between nearest points of two regions
WIDTH = 1.1  # standard deviation about nearest points, where the limit state may curve
DEFENSIVE = 0.1  # share of samples at increased scatter, which find what is not known yet
LEAST_SHARE = 0.05  # of the other samples about each region
STEPS, TRIED = 3, 8  # of the search without gradients, and samples of each
STEPS_ALONE = 10  # more of them where gradients do not lead to the region


class Region(NamedTuple):
    """A failure region, located by its point that is nearest to the origin."""

    point: Floats  # (d,)
    on_limit: bool  # whether the search by gradients ended there, so that the limit state is zero

    @property
    def distance(self) -> float:
        """Distance of the point from the origin, in standard deviations."""
        return float(np.linalg.norm(self.point))


def increased_scatter(count: int, size: int, scale: float, seed: int) -> Floats:
    """A space-filling sample, (count, size), of normal variables with a standard deviation of ``scale``."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    sobol = qmc.Sobol(size, rng=np.random.default_rng(seed))
    shares = sobol.random_base2(int(np.ceil(np.log2(max(count, 2)))))[:count]
    return scale * np.asarray(ndtri(np.clip(shares, 1e-12, 1.0 - 1e-12)))


class Regions:
    """The failure regions that are known, the nearest one first found.

    Parameters
    ----------
    state : limit state.
    generator : of the search without gradients.
    """

    def __init__(self, state: LimitState, generator: np.random.Generator) -> None:
        self.found: list[Region] = []
        self._state, self._generator = state, generator

    def contains(self, u: Floats) -> Bools:
        """(n,) whether points beyond the limit belong to known regions."""
        if not self.found:
            return np.zeros(len(u), dtype=bool)
        return np.asarray(np.max(self._excess(u), axis=1) >= -1e-3)

    def nearest(self, u: Floats) -> Ints:
        """(n,) the region that each point belongs to."""
        return np.asarray(np.argmax(self._excess(u), axis=1))

    def _excess(self, u: Floats) -> Floats:
        """(n, regions) distance of points beyond the tangent plane of each region."""
        points = np.array([region.point for region in self.found])
        distances = np.maximum(np.linalg.norm(points, axis=1), 1e-9)
        return np.asarray(u @ (points / distances[:, None]).T - distances)

    def look(self, u: Floats) -> bool:
        """Locate the regions of points beyond the limit (n, d); whether a new one that matters was found."""
        new, in_vain, most = False, 0, max(MOST_REGIONS, 2 * u.shape[1] + MORE_THAN_FACES)
        left = u[np.argsort(np.linalg.norm(u, axis=1), kind="stable")]
        while len(left := left[~self.contains(left)]) and len(self.found) < most and in_vain < IN_VAIN:
            near = self._nearer(left[0])
            left = left[1:]
            in_vain += 1
            region = self._by_gradients(near)
            if region is None or not self._is_separate(region):
                # gradients lead to the limit that is nearest to being exceeded, which is not that of the sample
                region = Region(self._nearer(near, STEPS_ALONE), False)
            if self._is_separate(region):
                self.found.append(region)
                new, in_vain = new or self.matters()[-1], 0
        return new

    def _is_separate(self, region: Region) -> bool:
        return all(np.linalg.norm(region.point - other.point) > APART for other in self.found)

    def _nearer(self, start: Floats, steps: int = STEPS) -> Floats:
        """A point beyond the limit that is nearer to the origin than another one, by samples."""
        point, draw = start, self._generator
        for _ in range(steps):
            some = draw.random((TRIED, start.size)) < 0.4  # numbers that come nearer each by itself
            some[::2] = False
            each = np.where(some, draw.uniform(0.2, 1.0, some.shape), 1.0)
            whole = draw.uniform(0.4, 1.0, (TRIED, 1)) * (draw.random(some.shape) < 0.8)
            whole[1::2] = 1.0
            tried = point * each * whole
            fails = tried[self._state(points_at(tried)) <= 0.0]
            if len(fails):
                point = fails[np.argmin(np.linalg.norm(fails, axis=1))]
        return point

    def _by_gradients(self, start: Floats) -> Region | None:
        """The region whose nearest point a search leads to; none where that is no point of the limit, or far away."""
        found, on_limit = nearest_point(self._state, start)
        near = on_limit and np.linalg.norm(found) <= np.linalg.norm(start) + APART
        return Region(found, True) if near else None

    def tangent_probabilities(self) -> Floats:
        """(regions,) probability beyond the tangent plane of each."""
        from scipy.special import ndtr

        return np.asarray(ndtr(-np.array([region.distance for region in self.found])))

    def matters(self) -> Bools:
        """(regions,) whether the probability beyond the tangent plane of each is not negligible."""
        expected = self.tangent_probabilities()
        return np.asarray(expected >= NEGLIGIBLE * expected.max())

    def nearest_point(self) -> Points | None:
        """The nearest point of all regions; none where no region is known."""
        if not self.found:
            return None
        return points_at(min(self.found, key=lambda region: region.distance).point[None])

    def density(self, u: Floats, weights: Floats, scale: float) -> Any:
        """A mixture of normal distributions, of OpenTURNS: about each region, and at increased scatter.

        Parameters
        ----------
        u, weights : (n, d), (n,) samples beyond the limit and their weights, whose spread in each region it has.
        scale : of the increased scatter.
        """
        ot, size, chosen = library(), u.shape[1], np.flatnonzero(self.matters())
        of = self.nearest(u) if len(u) else np.zeros(0, dtype=int)
        parts, shares = [_normal(np.zeros(size), scale**2 * np.eye(size))], [DEFENSIVE]
        expected = self.tangent_probabilities()[chosen]
        seen = np.array([weights[of == j].sum() for j in chosen])
        share = expected / expected.sum() + (seen / seen.sum() if seen.sum() > 0.0 else 0.0)
        share = np.maximum(share / share.sum(), LEAST_SHARE)
        share *= (1.0 - DEFENSIVE) / share.sum()
        for j, part in zip(chosen, share, strict=True):
            own, w = u[of == j], weights[of == j]
            fitted = len(own) >= 2 * size + 2
            parts.append(_normal(self.found[j].point, WIDTH**2 * np.eye(size)))
            shares.append(float(part) * (0.5 if fitted else 1.0))
            if fitted:
                parts.append(_like(own, w))
                shares.append(0.5 * float(part))
        return ot.Mixture(parts, shares)


def _normal(mean: Floats, covariance: Floats) -> Any:
    ot = library()
    return ot.Normal(mean.tolist(), ot.CovarianceMatrix(covariance.tolist()))


def _like(u: Floats, weights: Floats) -> Any:
    """A normal distribution with mean and spread of weighted samples (n, d), somewhat wider."""
    share = weights / weights.sum()
    mean = share @ u
    count = 1.0 / float(share @ share)  # of samples of equal weight that say as much
    spread = (u - mean).T @ (share[:, None] * (u - mean))
    trust = count / (count + u.shape[1] + 2.0)
    return _normal(mean, 1.1 * (trust * spread + (1.0 - trust) * np.eye(u.shape[1])) + 0.05 * np.eye(u.shape[1]))
