"""Statistics of a sample: percentiles, populations, probability of meeting a limit, correlations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.typing import Floats

PERCENTILES = (5, 50, 95)
LARGEST_CHANCE = 0.05  # share of unimodal samples that are split into two populations, at most


def statistics(values: Floats) -> dict[str, Any]:
    """Mean, standard deviation, quantiles with 95 % intervals, and the populations if there are several."""
    from scipy.stats import quantile_test

    summary: dict[str, Any] = {
        "mean": float(values.mean()),
        "standard_deviation": float(values.std(ddof=1)) if values.size > 1 else math.nan,
    }
    for percent in PERCENTILES:
        test: Any = quantile_test(values, p=percent / 100)
        interval = test.confidence_interval(0.95)
        summary[f"quantile_{percent}_percent"] = float(np.quantile(values, percent / 100))
        summary[f"quantile_{percent}_percent_interval"] = [float(interval.low), float(interval.high)]
    groups = populations(values)
    if len(groups) > 1:
        summary["populations"] = [
            {"smallest": float(g[0]), "largest": float(g[-1]), "mean": float(g.mean()), "cases": g.size} for g in groups
        ]
    return summary


def populations(values: Floats) -> list[Floats]:
    """Sort the values and split them at gaps that a unimodal distribution hardly has.

    In a unimodal distribution the density decreases on one side of each gap. The first of the n spacings on that side,
    with the gap, is then at most as large as for uniform values, where it is a share s with the probability
    (1 - s)^(n - 1). The probability of a gap is the larger one of its two sides, times the number of gaps.
    """
    values = np.sort(values)
    distinct, counts = np.unique(values, return_counts=True)
    if distinct.size < 2:
        return [values]
    if np.sum(counts > 1) > 1:  # few distinct values; one alone may be a zero force
        counts = np.ones_like(counts)
    gaps, left = np.diff(distinct), np.cumsum(counts)[:-1] - 1  # spacings on the left of each gap
    right, below, above = counts.sum() - left - 2, distinct[:-1] - distinct[0], distinct[-1] - distinct[1:]
    chance = gaps.size * np.maximum((below / (below + gaps)) ** left, (above / (above + gaps)) ** right)
    at = int(chance.argmin())
    if chance[at] > LARGEST_CHANCE:
        return [values]
    lower = values <= distinct[at]
    return [*populations(values[lower]), *populations(values[~lower])]


def rank_correlations(values: Floats, numbers: Mapping[str, Floats]) -> dict[str, dict[str, float]]:
    """Rank correlation of a response with each varied number, and the probability of as much by chance."""
    from scipy.stats import spearmanr

    known = np.isfinite(values)
    if np.unique(values[known]).size < 4:
        return {}
    tests = {name: spearmanr(x[known], values[known]) for name, x in numbers.items() if np.ptp(x[known]) > 0.0}
    return {name: {"rank_correlation": float(t.statistic), "p_value": float(t.pvalue)} for name, t in tests.items()}


def swings(values: Floats, numbers: Mapping[str, NDArray[Any]]) -> dict[str, dict[str, Any]]:
    """Effect of one parameter at a time: the smallest and largest response, and the parameter's values there.

    Parameters
    ----------
    values : (cases,) responses, the first one of the unchanged scenario; nan if unknown.
    numbers : by path (cases,) numbers or words.
    """
    ranges = {}
    for name, x in numbers.items():
        own = np.flatnonzero(np.isfinite(values) & ((x != x[0]) | (np.arange(x.size) == 0)))
        if own.size:
            low, high = own[values[own].argmin()], own[values[own].argmax()]
            ranges[name] = {
                "smallest": float(values[low]), "smallest_at": x[low].item(),
                "largest": float(values[high]), "largest_at": x[high].item(),
            }  # fmt: skip
    return ranges


def varies(values: Floats) -> bool:
    """True if the known values differ by more than round-off."""
    known = values[np.isfinite(values)]
    return bool(known.size) and bool(np.ptp(known) > 1e-9 * np.max(np.abs(known)))


def sensitivities(responses: Mapping[str, Floats], count: int) -> tuple[dict[str, dict[str, Floats]], list[str]]:
    """Sobol' indices of every varying response that is known in all cases, and the names of responses with gaps.

    Parameters
    ----------
    responses : (cases,) responses of the cases of `beamsim.analyses.studies.plan.sobol`, in their order.
    count : number of parameters.

    Returns
    -------
    dict
        By response ``first_order`` and ``total_order``, (parameters,), with the ends ``_low`` and ``_high`` of their
        95 % intervals.
    list of str
    """
    indices, gaps = {}, []
    for name, values in responses.items():
        if not np.all(np.isfinite(values)):
            gaps.append(name)
        elif varies(values):
            indices[name] = _indices(values.reshape(count + 2, -1))
    return indices, gaps


def _indices(parts: Floats) -> dict[str, Floats]:
    """First and total indices from the responses (k + 2, n) of A, B and the k mixed samples."""
    from scipy.stats import bootstrap, sobol_indices

    count, samples = parts.shape[0] - 2, parts.shape[1]

    def of_rows(rows: NDArray[np.int64]) -> Floats:
        chosen = parts[:, rows]
        given: Any = {"f_A": chosen[:1], "f_B": chosen[1:2], "f_AB": chosen[2:, None]}
        indices = sobol_indices(func=given, n=samples)
        return np.stack([np.reshape(indices.first_order, count), np.reshape(indices.total_order, count)])

    first, total = of_rows(np.arange(samples))
    spread: Any = bootstrap(
        [np.arange(samples)], of_rows, vectorized=False, n_resamples=200, confidence_level=0.95,
        method="percentile", rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return {
        "first_order": first, "first_order_low": spread.low[0], "first_order_high": spread.high[0],
        "total_order": total, "total_order_low": spread.low[1], "total_order_high": spread.high[1],
    }  # fmt: skip
