"""Designs that a surrogate model of the known designs predicts to improve a front of two objectives.

The model interpolates objectives and limits between the solved designs by multiquadrics (R. L. Hardy, Journal of
Geophysical Research 76 (1971) 1905-1915), which also follow kinks. Of random designs near the front, those are proposed
that add the largest dominated area, one after the other (compare J. Mueller, SOCEMO, INFORMS Journal on Computing 29
(2017) 581-596).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from beamsim.analyses.studies.designs import SolvedPoints
from beamsim.analyses.studies.table import efficient
from beamsim.scenario.studies import VariedParameter
from beamsim.typing import Bools, Floats, Ints

SCALES = (0.2, 0.05, 0.0125, 0.003)  # of the ranges: distances of random designs from the front
PER_SCALE = 500  # random designs of each scale
CHANGED_SHARE = 0.7  # share of the numbers that are changed
CHANGED_CHOICES = 0.5  # share of the choices that are changed, if any
BEYOND_ENDS = 0.3  # of the distance between neighbours in the front: extrapolation along the line through them
MOST_MODELLED = 600  # number of designs in the model, those nearest to the front
SHARPNESS = 10.0  # of the multiquadrics, over the length of a range: they are smooth below a tenth of it
SMOOTHING = 1e-9  # keeps the equations regular if designs are close
FARTHEST_VALUE = 1.5  # ranges of the objectives behind the front, beyond which values are ignored
MOST_EXCESS = 0.3  # of a limit, beyond which values are ignored
LIMIT_MARGIN = 1e-4  # of a limit: margin of a proposal
REFERENCE = 1.1  # ranges of the objectives up to which the area counts
CHOICE = 0.5  # of a range, times the square root of two: distance of designs with different choices
DIGITS = 4  # of the coordinates, by which a proposal must differ from known designs


def propose_designs(
    parameters: Sequence[VariedParameter], solved: SolvedPoints, front: Ints, count: int, generator: np.random.Generator
) -> Floats:
    """Propose new designs that improve a front by the model; without a front, those nearest to the limits.

    Parameters
    ----------
    parameters : the parameters.
    solved : the solved designs.
    front : (m,) indices of the designs in the front, sorted by the first objective.
    count : largest number of proposals.
    generator : source of all random numbers.

    Returns
    -------
    (n, parameters) array
        Points of the unit cube; fewer than ``count`` if the model predicts no more improvements.
    """
    usable = np.flatnonzero(np.isfinite(solved.values).all(axis=1) & np.isfinite(solved.excesses).all(axis=1))
    if not usable.size:
        return generator.random((count, len(parameters)))
    parents = front if front.size else usable[np.argsort(solved.excess[usable], kind="stable")[:count]]
    low, ranges = solved.values[parents].min(axis=0), ranges_of(solved, parents)
    scaled = (solved.values[usable] - low) / ranges
    objectives, beyond = np.minimum(scaled, FARTHEST_VALUE), np.minimum(solved.excesses[usable], MOST_EXCESS)
    nearest = np.argsort(np.linalg.norm(np.maximum(objectives, 0.0), axis=1) + beyond.max(axis=1, initial=0.0))
    places = np.sort(nearest[:MOST_MODELLED])
    places = np.union1d(places, np.searchsorted(usable, parents))
    candidates = _unknown_candidates(
        parameters, _designs_near(parameters, solved.points[parents], generator), solved.points
    )
    modelled = solved.points[usable[places]], np.hstack([objectives, beyond])[places]
    predicted = _interpolate(parameters, modelled, candidates)
    excess = predicted[:, 2:].max(axis=1, initial=-np.inf)
    if not front.size:
        return np.asarray(candidates[np.argsort(excess, kind="stable")[:count]])
    meets = excess <= -LIMIT_MARGIN
    gaining = _largest_gains(predicted[meets, :2], (solved.values[front] - low) / ranges, count)
    return np.asarray(candidates[meets][gaining])


def ranges_of(solved: SolvedPoints, front: Ints) -> Floats:
    """(2,) ranges of the objectives on a front, or of all designs if it has none; 1 if these have none either."""
    values = solved.values[np.isfinite(solved.values).all(axis=1)]
    whole = np.ptp(values, axis=0) if len(values) else np.zeros(2)
    own = np.ptp(solved.values[front], axis=0) if len(front) else np.zeros(2)
    return np.asarray(np.where(own > 0.0, own, np.where(whole > 0.0, whole, 1.0)))


def gains(points: Floats, front: Floats) -> Floats:
    """(n,) dominated area that each point (n, 2) adds to a front (m, 2).

    Parameters
    ----------
    points : points in units of the objectives' ranges.
    front : front in the same units, sorted by the first objective; the area counts up to `REFERENCE` in both.
    """
    edges = np.append(front[:, 0], REFERENCE)
    widths = np.diff(np.maximum(edges[None, :], points[:, :1]), axis=1)
    before = np.maximum(np.minimum(edges[0], REFERENCE) - points[:, 0], 0.0)
    widths, heights = np.column_stack([before, widths]), np.append(REFERENCE, front[:, 1])
    added = np.maximum(widths, 0.0) * np.maximum(heights[None, :] - points[:, 1:], 0.0)
    return np.asarray(added.sum(axis=1))


def _largest_gains(predicted: Floats, front: Floats, count: int) -> list[int]:
    """Indices of the points that add most to a front, each with the previous ones included."""
    chosen = list[int]()
    while len(predicted) and len(chosen) < count:
        gain = gains(predicted, front)
        best = int(np.argmax(gain))
        if not gain[best] > 0.0:
            break
        chosen.append(best)
        front = np.vstack([front, predicted[best]])
        front = front[efficient(front.T, np.ones(len(front), dtype=bool))]
        front = front[np.argsort(front[:, 0])]
    return chosen


def _interpolate(parameters: Sequence[VariedParameter], solved: tuple[Floats, Floats], points: Floats) -> Floats:
    """(n, m) interpolated values at points (n, parameters), from known points and their values (k, m)."""
    from scipy.interpolate import RBFInterpolator

    places, at = np.unique(_coordinates(parameters, solved[0]), axis=0, return_index=True)
    model = RBFInterpolator(
        places, solved[1][at], kernel="multiquadric", epsilon=SHARPNESS, smoothing=SMOOTHING, degree=0
    )
    return np.asarray(model(_coordinates(parameters, points)))


def _coordinates(parameters: Sequence[VariedParameter], points: Floats) -> Floats:
    """(n, m) coordinates of designs in the model: one for each number, and one for each value of a list."""
    columns = list[Floats]()
    for parameter, u in zip(parameters, points.T, strict=True):
        count = len(parameter.values) or (int(parameter.high - parameter.low) + 1 if parameter.integers_only else 0)
        chosen = np.minimum(np.floor(u * count), count - 1)
        if parameter.values:
            columns += [CHOICE * (chosen == k) for k in range(count)]
        else:
            columns.append((chosen + 0.5) / count if parameter.integers_only else u)
    return np.column_stack(columns)


def _unknown_candidates(parameters: Sequence[VariedParameter], candidates: Floats, points: Floats) -> Floats:
    """Candidates (n, parameters) that are not among known points, each once."""
    places = np.round(np.vstack([_coordinates(parameters, each) for each in (points, candidates)]), DIGITS)
    first = np.unique(places, axis=0, return_index=True)[1]
    return candidates[np.sort(first[first >= len(points)]) - len(points)]


def _designs_near(parameters: Sequence[VariedParameter], front: Floats, generator: np.random.Generator) -> Floats:
    """(n, parameters) random designs: near the front, on lines through neighbours, with other choices, anywhere."""
    listed: Bools = np.array([bool(p.values) for p in parameters])
    made = list[Floats]()
    for scale in SCALES:
        about = front[generator.integers(len(front), size=PER_SCALE)]
        steps = scale * generator.standard_normal(about.shape) * (generator.random(about.shape) < CHANGED_SHARE)
        made.append(about + np.where(listed, 0.0, steps))
    first = generator.integers(max(len(front) - 1, 1), size=PER_SCALE)
    second = front[np.minimum(first + 1, len(front) - 1)]
    along = generator.uniform(-BEYOND_ENDS, 1.0 + BEYOND_ENDS, size=(PER_SCALE, 1))
    made.append(front[first] + np.where(listed, 0.0, along * (second - front[first])))
    if listed.any():
        about = np.vstack(made)[generator.integers(len(SCALES) * PER_SCALE, size=2 * PER_SCALE)]
        swapped = listed & (generator.random(about.shape) < CHANGED_CHOICES)
        made.append(np.where(swapped, generator.random(about.shape), about))
    made.append(generator.random((PER_SCALE, len(parameters))))
    return np.clip(np.vstack(made), 0.0, 1.0)
