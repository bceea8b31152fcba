"""Values of the varied parameters: lists and ranges, Latin-hypercube samples, and samples for Sobol' indices."""

from __future__ import annotations

import numpy as np

from beamsim.scenario.parameters import Value, VariedParameter
from beamsim.typing import Floats

NORMAL_REACH = 3.0  # standard deviations in a tolerance


def listed_values(parameter: VariedParameter) -> list[Value]:
    """The values of a list or of an evenly spaced range."""
    if parameter.values:
        return list(parameter.values)
    spaced = np.geomspace if parameter.spacing == "logarithmic" else np.linspace
    values = spaced(parameter.low, parameter.high, parameter.points)
    values[0], values[-1] = parameter.low, parameter.high
    return [*dict.fromkeys(int(v) for v in np.rint(values))] if parameter.whole else values.tolist()


def latin_hypercube(varied: tuple[VariedParameter, ...], samples: int, seed: int) -> list[list[Value]]:
    """Columns of a Latin-hypercube sample, one a parameter."""
    from scipy.stats.qmc import LatinHypercube

    return _distributed(varied, LatinHypercube(len(varied), rng=np.random.default_rng(seed)).random(samples))


def sobol(varied: tuple[VariedParameter, ...], samples: int, seed: int) -> list[list[Value]]:
    """Columns for Sobol' indices: two independent samples A and B, then for each parameter A with its column of B.

    Source: A. Saltelli et al., Computer Physics Communications 181 (2010) 259-270.
    """
    from scipy.stats.qmc import Sobol

    count = len(varied)
    both = Sobol(2 * count, rng=np.random.default_rng(seed)).random(samples)
    a, b = both[:, :count], both[:, count:]
    parts = [a, b]
    for k in range(count):
        mixed = a.copy()
        mixed[:, k] = b[:, k]
        parts.append(mixed)
    return _distributed(varied, np.concatenate(parts))


def _distributed(varied: tuple[VariedParameter, ...], cube: Floats) -> list[list[Value]]:
    """Map each column of the unit cube by the inverse distribution of its parameter."""
    from scipy.stats import truncnorm

    columns: list[list[Value]] = []
    for parameter, u in zip(varied, cube.T, strict=True):
        low, high = parameter.low, parameter.high
        if parameter.spacing == "logarithmic":
            values = low * (high / low) ** u
        elif parameter.distribution == "normal":
            deviation = truncnorm.ppf(u, -NORMAL_REACH, NORMAL_REACH) / NORMAL_REACH
            values = 0.5 * (low + high) + 0.5 * (high - low) * deviation
        elif parameter.whole:
            values = np.minimum(np.floor(low + u * (high - low + 1.0)), high)
        else:
            values = low + u * (high - low)
        columns.append([int(v) for v in values] if parameter.whole else values.tolist())
    return columns
