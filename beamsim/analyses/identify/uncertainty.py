r"""Uncertainty of an identified stiffness: first order, confidence intervals, Monte Carlo, sensitivities.

First order, with :math:`s_j = \partial f_j / \partial k` and standard deviations :math:`\sigma_j`:
:math:`\mathrm{var}(k) = (\sum_j s_j^2 / \sigma_j^2)^{-1}`. One mode: k increases with the frequency, so that
quantiles transform exactly. Several: the interval in which the profile likelihood stays within its quantile.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from beamsim.analyses.identify.result import ProfileLikelihood, Sensitivity
from beamsim.analyses.identify.stiffness import MeasuredModes, misfit, reached_stiffness
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.parameters import find_parameters, value_at
from beamsim.structures.point_sensitivity import stiffness_sensitivities
from beamsim.structures.secular import SpringPoint
from beamsim.typing import Floats


@dataclass(frozen=True)
class Spread:
    """Uncertainty of a stiffness from that of its frequencies."""

    standard_deviation: float  # N/m
    interval_first_order: tuple[float, float]
    interval: tuple[float, float]


def spread_of(point: SpringPoint, measured: MeasuredModes, stiffness: float, coverage: float) -> Spread:
    """First-order standard deviation and both intervals; nan without uncertainties."""
    if not measured.sigma.all():
        return Spread(np.nan, (np.nan, np.nan), (np.nan, np.nan))
    predicted = point.frequencies(stiffness, max(measured.mode))[np.array(measured.mode) - 1]
    information = float(np.sum((point.slope(predicted) * measured.weight) ** 2))
    deviation = float(1.0 / np.sqrt(information))
    z = NormalDist().inv_cdf(0.5 + coverage / 2)
    first = (stiffness - z * deviation, stiffness + z * deviation)
    if len(measured.mode) == 1:
        ends = measured.omega[0] * (1 + np.array([-z, z]) * measured.sigma[0])
        low, high = reached_stiffness(point, measured.mode[0], ends)
        return Spread(deviation, first, (float(low), float(high)))
    return Spread(deviation, first, _profile_interval(point, measured, stiffness, deviation / stiffness, z))


def _profile_interval(
    point: SpringPoint, measured: MeasuredModes, stiffness: float, relative: float, z: float
) -> tuple[float, float]:
    """Where chi^2 stays within z^2 of its minimum."""
    from scipy.optimize import brentq

    least = float(misfit(point, measured, np.array([stiffness]))[0])

    def excess(log_k: float) -> float:
        return float(misfit(point, measured, np.exp(np.array([log_k])))[0]) - least - z * z

    centre, ends = float(np.log(stiffness)), []
    for side in (-1.0, 1.0):
        reach = 2 * z * relative
        while excess(centre + side * reach) < 0 and reach < 40:
            reach *= 2
        if excess(centre + side * reach) < 0:
            ends.append(0.0 if side < 0 else np.inf)
        else:
            ends.append(float(np.exp(brentq(excess, centre, centre + side * reach, xtol=1e-12))))
    return ends[0], ends[1]


def monte_carlo(
    point: SpringPoint,
    measured: MeasuredModes,
    stiffness: float,
    *,
    samples: int,
    coverage: float,
    generator: np.random.Generator,
) -> tuple[float, tuple[float, float], float]:
    """Standard deviation and interval of k for normally distributed frequencies, and the share of unreachable samples.

    Every sample is identified separately: in closed form from one mode; from several by the smallest misfit in a table
    and a parabola through its three lowest points. Samples that no stiffness explains count as 0 or infinity in the
    interval and are excluded from the standard deviation.
    """
    omega = measured.omega * (1 + measured.sigma * generator.standard_normal((samples, measured.omega.size)))
    if len(measured.mode) == 1:
        k = reached_stiffness(point, measured.mode[0], omega[:, 0])
    else:
        relative = spread_of(point, measured, stiffness, coverage).standard_deviation / stiffness
        k = _least_on_table(point, measured, stiffness, relative, omega)
    usable = np.isfinite(k) & (k > 0)
    low, high = np.quantile(k, [0.5 - coverage / 2, 0.5 + coverage / 2], method="nearest")
    deviation = float(np.std(k[usable], ddof=1)) if usable.sum() > 1 else np.nan
    return deviation, (float(low), float(high)), float(1 - usable.mean())


def _least_on_table(
    point: SpringPoint, measured: MeasuredModes, stiffness: float, relative: float, omega: Floats
) -> Floats:
    # 8.0: of the table, in standard deviations of ln k
    width = min(8.0 * relative, 20.0)
    # 1201: stiffnesses at which several modes are tabulated for Monte Carlo
    x = np.log(stiffness) + np.linspace(-width, width, 1201)
    table = point.frequencies(np.exp(x), max(measured.mode))[:, np.array(measured.mode) - 1]
    # chi^2 up to a constant of each sample: (t, m) products instead of a (samples, t, m) array.
    w2 = measured.weight**2
    value = np.sum(table**2 * w2, axis=1)[None, :] - 2 * (omega * w2) @ table.T
    best = np.argmin(value, axis=1)
    inner = np.clip(best, 1, x.size - 2)
    row = np.arange(omega.shape[0])
    a, b, c = (value[row, inner + d] for d in (-1, 0, 1))
    curvature = a - 2 * b + c
    offset = np.where(curvature > 0, 0.5 * (a - c) / np.where(curvature > 0, curvature, 1.0), 0.0)
    k = np.exp(x[inner] + np.clip(offset, -1, 1) * (x[1] - x[0]))
    return np.asarray(np.where(best == 0, 0.0, np.where(best == x.size - 1, np.inf, k)))


def stiffness_profile(
    point: SpringPoint, measured: MeasuredModes, stiffness: float, deviation: float
) -> ProfileLikelihood | None:
    """chi^2 above its minimum against k; None without uncertainties."""
    if not np.isfinite(deviation) or not 0 < stiffness < np.inf:
        return None
    width = min(4 * deviation / stiffness, 5.0)
    k = stiffness * np.exp(np.linspace(-width, width, 81))
    value = misfit(point, measured, k)
    least = float(misfit(point, measured, np.array([stiffness]))[0])
    return ProfileLikelihood("stiffness", k, np.maximum(value - least, 0.0))


def sensitivities(
    scenario: Scenario,
    point: SpringPoint,
    snubber: str,
    measured: MeasuredModes,
    stiffness: float,
    known: dict[str, float],
) -> list[Sensitivity]:
    """d ln k / d ln p at fixed frequencies for every number of the structure, largest first.

    One mode: exact for the finite-element model. Several: to first order in the misfit. A path with ``[*]`` is a
    common factor.

    Parameters
    ----------
    point : modes at the snubber.
    stiffness : the identified value, N/m.
    known : relative standard deviations by path.
    """
    if not 0 < stiffness < np.inf:
        return []
    number = np.array(measured.mode) - 1
    predicted = point.frequencies(stiffness, max(measured.mode))[number]
    share = (point.slope(predicted) * measured.weight) ** 2
    share /= share.sum()
    each = [stiffness_sensitivities(scenario, snubber, float(omega)) for omega in predicted]
    relative = {
        place: float(sum(w * part.get(place, 0.0) for w, part in zip(share, each, strict=True)))
        for place in dict.fromkeys(place for part in each for place in part)
    }
    rows = {path_text(place): [place] for place in relative}
    given = {}
    for path, uncertainty in known.items():
        places = find_parameters(scenario, path)
        name = path_text(places[0]) if len(places) == 1 else path
        rows[name], given[name] = places, uncertainty
    result = [
        Sensitivity(
            name,
            float(value_at(scenario, places[0])),
            sum(relative.get(place, 0.0) for place in places),
            given.get(name, np.nan),
        )
        for name, places in rows.items()
    ]
    return sorted(result, key=lambda s: -abs(s.relative))
