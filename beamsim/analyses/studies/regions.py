"""Failure regions in the space of independent standard normal variables: search, and sampling densities over them.

Regions are searched without gradients, in a space-filling sample at increased scatter, and each is located by its
nearest point. A sample beyond the tangent plane of a known nearest point belongs to that region (compare the
multiple design points of A. Der Kiureghian and T. Dakessian, Structural Safety 20, 1998).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.studies.sampling import LimitState, Points, library, nearest_point, points_at
from beamsim.typing import Bools, Floats, Ints

MOST_REGIONS = 12  # the widest density covers regions that are not located
MORE_THAN_FACES = 4  # factor for many variables: a limit on the magnitude of each has two faces
MOST_FAILED_SEARCHES = 3  # successive searches that end in known regions, after which the remaining samples are skipped
NEGLIGIBLE = 1e-4  # relative to the largest probability beyond a tangent plane
LEAST_SEPARATION = 0.5  # distance of the nearest points of separate regions, in standard deviations
WIDTH = 1.1  # standard deviation of the density about nearest points, where the limit state may be curved
DEFENSIVE = 0.1  # share of samples at increased scatter, which may find unknown regions
LEAST_SHARE = 0.05  # least share of the other samples about each region
STEPS, SAMPLES_PER_STEP = 3, 8  # rounds of the search without gradients, and samples of each
STEPS_WITHOUT_GRADIENTS = 10  # rounds if gradients do not lead to the region


class Region(NamedTuple):
    """Failure region, located by its point nearest to the origin."""

    point: Floats  # (d,)
    on_limit: bool  # True if the gradient search ended on the limit state

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
    """Known failure regions, sorted by distance.

    Parameters
    ----------
    state : limit state.
    generator : random numbers of the search without gradients.
    """

    def __init__(self, state: LimitState, generator: np.random.Generator) -> None:
        self.found: list[Region] = []
        self._state, self._generator = state, generator

    def contains(self, u: Floats) -> Bools:
        """(n,) True for points beyond the limit that belong to a known region."""
        if not self.found:
            return np.zeros(len(u), dtype=bool)
        return np.asarray(np.max(self._excess(u), axis=1) >= -1e-3)

    def nearest(self, u: Floats) -> Ints:
        """(n,) index of the region that each point belongs to."""
        return np.asarray(np.argmax(self._excess(u), axis=1))

    def _excess(self, u: Floats) -> Floats:
        """(n, regions) distance of points beyond the tangent plane of each region."""
        points = np.array([region.point for region in self.found])
        distances = np.maximum(np.linalg.norm(points, axis=1), 1e-9)
        return np.asarray(u @ (points / distances[:, None]).T - distances)

    def locate_regions(self, u: Floats) -> bool:
        """Locate the regions of points (n, d) beyond the limit; True if a relevant new one was found."""
        new, in_vain, most = False, 0, max(MOST_REGIONS, 2 * u.shape[1] + MORE_THAN_FACES)
        left = u[np.argsort(np.linalg.norm(u, axis=1), kind="stable")]
        while len(left := left[~self.contains(left)]) and len(self.found) < most and in_vain < MOST_FAILED_SEARCHES:
            near = self._find_nearer_point(left[0])
            left = left[1:]
            in_vain += 1
            region = self._region_by_gradients(near)
            if region is None or not self._is_separate(region):
                # gradients lead to the limit closest to being exceeded, which may not be that of the sample
                region = Region(self._find_nearer_point(near, STEPS_WITHOUT_GRADIENTS), False)
            if self._is_separate(region):
                self.found.append(region)
                new, in_vain = new or self.significant()[-1], 0
        return new

    def _is_separate(self, region: Region) -> bool:
        return all(np.linalg.norm(region.point - other.point) > LEAST_SEPARATION for other in self.found)

    def _find_nearer_point(self, start: Floats, steps: int = STEPS) -> Floats:
        """Find a point beyond the limit that is closer to the origin than ``start``, by random samples."""
        point, draw = start, self._generator
        for _ in range(steps):
            some = draw.random((SAMPLES_PER_STEP, start.size)) < 0.4  # coordinates that are reduced independently
            some[::2] = False
            each = np.where(some, draw.uniform(0.2, 1.0, some.shape), 1.0)
            whole = draw.uniform(0.4, 1.0, (SAMPLES_PER_STEP, 1)) * (draw.random(some.shape) < 0.8)
            whole[1::2] = 1.0
            tried = point * each * whole
            fails = tried[self._state(points_at(tried)) <= 0.0]
            if len(fails):
                point = fails[np.argmin(np.linalg.norm(fails, axis=1))]
        return point

    def _region_by_gradients(self, start: Floats) -> Region | None:
        """Region at the nearest point that a gradient search reaches; None if it is not on the limit or too far."""
        found, on_limit = nearest_point(self._state, start)
        near = on_limit and np.linalg.norm(found) <= np.linalg.norm(start) + LEAST_SEPARATION
        return Region(found, True) if near else None

    def tangent_probabilities(self) -> Floats:
        """(regions,) probability beyond each tangent plane."""
        from scipy.special import ndtr

        return np.asarray(ndtr(-np.array([region.distance for region in self.found])))

    def significant(self) -> Bools:
        """(regions,) True if the probability beyond the tangent plane is not negligible."""
        expected = self.tangent_probabilities()
        return np.asarray(expected >= NEGLIGIBLE * expected.max())

    def nearest_point(self) -> Points | None:
        """Nearest point of all regions; None without regions."""
        if not self.found:
            return None
        return points_at(min(self.found, key=lambda region: region.distance).point[None])

    def density(self, u: Floats, weights: Floats, scale: float) -> Any:
        """Mixture of normal distributions (OpenTURNS): one about each region, and one at increased scatter.

        Parameters
        ----------
        u, weights : (n, d), (n,) samples beyond the limit with weights, which define the spread in each region.
        scale : standard deviation of the increased scatter.
        """
        ot, size, chosen = library(), u.shape[1], np.flatnonzero(self.significant())
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
                parts.append(_normal_of_samples(own, w))
                shares.append(0.5 * float(part))
        return ot.Mixture(parts, shares)


def _normal(mean: Floats, covariance: Floats) -> Any:
    ot = library()
    return ot.Normal(mean.tolist(), ot.CovarianceMatrix(covariance.tolist()))


def _normal_of_samples(u: Floats, weights: Floats) -> Any:
    """Normal distribution with the mean and slightly more than the spread of weighted samples (n, d)."""
    share = weights / weights.sum()
    mean = share @ u
    count = 1.0 / float(share @ share)  # equivalent number of samples with equal weights
    spread = (u - mean).T @ (share[:, None] * (u - mean))
    trust = count / (count + u.shape[1] + 2.0)
    return _normal(mean, 1.1 * (trust * spread + (1.0 - trust) * np.eye(u.shape[1])) + 0.05 * np.eye(u.shape[1]))
