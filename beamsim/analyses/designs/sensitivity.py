"""Sobol' indices: the share of a response's variance that each varied parameter accounts for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.designs.result import Response, SobolIndices
from beamsim.typing import Floats

RESAMPLES = 200  # of the bootstrap
CONFIDENCE = 0.95
SMALLEST_SPREAD = 1e-9  # of a response against its size; less is round-off, which has no shares


def sensitivities(responses: Mapping[str, Response], count: int) -> tuple[tuple[SobolIndices, ...], list[str]]:
    """The indices of every response that varies and is known in all cases, and the names of those with gaps.

    Parameters
    ----------
    responses : of the cases of `beamsim.analyses.designs.sampling.sobol`, in their order.
    count : number of parameters.
    """
    indices, gaps = [], []
    for name, response in responses.items():
        if response.values.ndim != 1:
            continue
        if not np.all(np.isfinite(response.values)):
            gaps.append(name)
        elif np.ptp(response.values) > SMALLEST_SPREAD * np.max(np.abs(response.values)):
            indices.append(_indices(name, response.values.reshape(count + 2, -1)))
    return tuple(indices), gaps


def _indices(name: str, parts: Floats) -> SobolIndices:
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
        [np.arange(samples)], of_rows, vectorized=False, n_resamples=RESAMPLES, confidence_level=CONFIDENCE,
        method="percentile", rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return SobolIndices(name, first, total, spread.low[0], spread.high[0], spread.low[1], spread.high[1])
