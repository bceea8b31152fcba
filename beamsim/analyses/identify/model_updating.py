r"""Model updating: parameters of the structure from natural frequencies measured without the snubber.

Each parameter p is varied by a factor, :math:`p = p_0 e^\theta`; the estimate minimises

.. math:: \chi^2 = \sum_j \left(\frac{f_j(\theta) - m_j}{\sigma_j}\right)^2
          + \sum_i \left(\frac{e^{\theta_i} - 1}{\pi_i}\right)^2

(:math:`\pi_i` is the relative standard deviation of the prior) within the bounds. A path with ``[*]`` is one factor for
the whole list. Supports are not numbers: every combination of the four kinds is fitted and the best one kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from statistics import NormalDist
from typing import Any

import numpy as np

from beamsim.analyses.identify.contact_point import free_frequencies
from beamsim.analyses.identify.result import FrequencyTable, ModelUpdate, ParameterEstimate, ProfileLikelihood
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.identification import IdentifyStiffness, SoughtParameter
from beamsim.scenario.parameters import choices_at, find_parameters, read_as, value_at, with_values
from beamsim.typing import Floats

Place = tuple[str | int, ...]

_WIDEST_FACTOR = 100.0  # without bounds, the search range is this factor on either side of the scenario's value
_CONFOUNDED = 0.995  # correlation above which two parameters count as indistinguishable
_NULL = 1e-14  # ratio of eigenvalues below which a combination of parameters has no influence
_PART_OF_NULL = 1e-12  # square of a parameter's part in such a combination above which it is not determined
_SINGULAR = 1e-6  # ratio of singular values below which a combination is not determined
_AT_BOUND = 1e-6
_PROFILE_POINTS = 13
_PROFILE_WIDTH = 2.5  # standard deviations


@dataclass(frozen=True)
class Sought:
    """A parameter to be identified, located in its scenario."""

    parameter: str
    places: tuple[Place, ...]
    values: tuple[float, ...]  # SI, one for each place
    bounds: tuple[float, float]  # SI, of the first place's value
    prior: float  # relative standard deviation; nan without

    @property
    def start(self) -> float:
        """The scenario's value, of the first place."""
        return self.values[0]

    def at_factor(self, factor: float) -> dict[Place, object]:
        """Values at all places, multiplied by a factor."""
        return {place: value * factor for place, value in zip(self.places, self.values, strict=True)}


def sought_numbers(scenario: Scenario, items: Sequence[SoughtParameter]) -> tuple[list[Sought], list[Place]]:
    """The numeric parameters, and the places of the non-numeric ones (supports)."""
    numbers: list[Sought] = []
    words: list[Place] = []
    for item in items:
        places = find_parameters(scenario, item.parameter)
        if choices_at(scenario, places[0]):
            words += places
            continue
        values = tuple(float(value_at(scenario, place)) for place in places)
        bounds = (-np.inf, np.inf)
        if item.bounds:
            bounds = (read_as(scenario, places[0], item.bounds[0]), read_as(scenario, places[0], item.bounds[1]))
        prior = np.nan if item.prior is None else item.prior
        numbers.append(Sought(item.parameter, tuple(places), values, bounds, prior))
    return numbers, words


def frequency_table(scenario: Scenario, section: IdentifyStiffness) -> FrequencyTable:
    """Predicted frequencies without the snubber and the measured ones, which start after the rigid-body modes."""
    measured_hz = section.measured_without
    predicted = free_frequencies(scenario, section.snubber, len(measured_hz))
    measured = np.full(predicted.size, np.nan)
    rigid = int(np.sum(predicted == 0))
    count = min(predicted.size - rigid, len(measured_hz))
    measured[rigid : rigid + count] = measured_hz[:count]
    return FrequencyTable(np.arange(1, predicted.size + 1), measured, predicted)


def mac_matrix(measured: Floats, predicted: Floats) -> Floats:
    """Modal assurance criterion (a, b) of shapes (a, p) and (b, p): 1 for the same shape, 0 for orthogonal ones."""
    cross = (measured @ predicted.T) ** 2
    return np.asarray(cross / np.outer(np.sum(measured**2, axis=1), np.sum(predicted**2, axis=1)))


def update_model(scenario: Scenario, section: IdentifyStiffness) -> ModelUpdate:
    """Fit the parameters of ``section.update`` to ``section.measured_without``.

    Raises
    ------
    ValueError
        If nothing was measured without the snubber (the schema refuses that).
    """
    measured = np.array(section.measured_without)
    numbers, words = sought_numbers(scenario, section.update)
    sigma = np.array([section.uncertainty_of(j + 1) for j in range(measured.size)])
    evaluations = 0
    best: _ModelFit | None = None
    alternatives: list[tuple[str, float]] = []
    for choice in product(*(choices_at(scenario, place) for place in words)):
        text = ", ".join(choice)
        try:
            varied = with_values(scenario, dict(zip(words, choice, strict=True))).rechecked()
        except ScenarioError:  # a support that holds the snubber's point, for example
            alternatives.append((text, np.inf))
            continue
        try:
            fit = _fit(varied, numbers, measured, sigma)
        except _NotEnoughModesError:
            alternatives.append((text, np.inf))
            continue
        evaluations += fit.evaluations
        if words:
            alternatives.append((text, fit.misfit))
        if best is None or fit.misfit < best.misfit:
            best = fit
    if best is None:
        raise ValueError("the model has fewer modes than were measured")
    alternatives.sort(key=lambda pair: pair[1])
    covariance, known = covariance_of(best.jacobian, best.misfit, measured.size, bool(sigma.all()))
    deviation = np.sqrt(np.diag(covariance))
    z = NormalDist().inv_cdf(0.5 + section.coverage / 2)
    parameters = tuple(
        _estimate(number, theta, d, z) for number, theta, d in zip(numbers, best.theta, deviation, strict=True)
    )
    profiles: tuple[ProfileLikelihood, ...] = ()
    if known:
        profiles, spent = _profiles(best, numbers, deviation)
        evaluations += spent
    names = [number.parameter for number in numbers]
    warnings = confounded(names, best.jacobian, covariance)
    warnings += [f"{p.parameter} ended on its bound, {p.value:g}" for p in parameters if p.at_bound]
    if len(alternatives) > 1 and alternatives[1][1] < best.misfit + 4.0 and known:
        warnings.append(
            f"the supports {alternatives[1][0]} fit nearly as well: these frequencies do not distinguish them"
        )
    return ModelUpdate(
        parameters=parameters,
        choices={_text(place): str(value_at(best.scenario, place)) for place in words},
        alternatives=tuple(alternatives),
        correlation=_correlation(covariance),
        before=frequency_table(scenario, section),
        after=frequency_table(best.updated, section),
        misfit_before=float(np.sum(_residuals(scenario, numbers, measured, sigma)(np.zeros(len(numbers))) ** 2)),
        misfit_after=best.misfit,
        profiles=profiles,
        evaluations=evaluations,
        warnings=tuple(warnings),
        scenario=best.updated,
    )


def covariance_of(jacobian: Floats, misfit: float, measurements: int, sigma_known: bool) -> tuple[Floats, bool]:
    """Covariance of the logarithmic parameters, and whether it is meaningful.

    Unknown standard deviations are estimated from the scatter of the residuals if there are more measurements than
    unknowns.
    """
    count = jacobian.shape[1]
    if count == 0:
        return np.zeros((0, 0)), False
    covariance = inverse_information(jacobian)
    if not sigma_known:
        freedom = measurements - count
        if freedom <= 0:
            return np.full((count, count), np.nan), False
        covariance = covariance * (misfit / freedom)
    return np.asarray(covariance), True


def inverse_information(jacobian: Floats) -> Floats:
    """(p, p) inverse of ``jacobian.T @ jacobian``, nan for parameters that the residuals do not determine.

    These are parameters without influence, and those of a combination without influence. If a derivative is not known
    (nan), no variance is.
    """
    if not np.all(np.isfinite(jacobian)):
        return np.full((jacobian.shape[1],) * 2, np.nan)
    size = np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0, size, 1.0)
    scaled = jacobian / size
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    null = values <= _NULL * values[-1]
    inverse = np.asarray((vectors[:, ~null] / values[~null]) @ vectors[:, ~null].T / np.outer(size, size))
    undetermined = (vectors[:, null] ** 2).sum(axis=1) > _PART_OF_NULL
    inverse[undetermined, :] = inverse[:, undetermined] = np.nan
    return inverse


def confounded(names: Sequence[str], jacobian: Floats, covariance: Floats) -> list[str]:
    """Warnings about parameters that the measurements cannot distinguish."""
    if len(names) == 0:
        return []
    size = np.linalg.norm(jacobian, axis=0)
    warnings = [
        f"{name} has no influence on the measured quantities and cannot be identified from them"
        for name, s in zip(names, size, strict=True)
        if s <= 1e-9 * size.max()
    ]
    usable = size > 1e-9 * size.max()
    if usable.sum() > 1:
        kept = [name for name, ok in zip(names, usable, strict=True) if ok]
        _, values, directions = np.linalg.svd(jacobian[:, usable] / size[usable], full_matrices=True)
        values = np.concatenate([values, np.zeros(len(kept) - values.size)])
        for value, direction in zip(values, directions, strict=True):
            if value < _SINGULAR * values[0]:
                together = [n for n, d in zip(kept, direction, strict=True) if abs(d) > 0.2]
                warnings.append(
                    f"{' and '.join(together)} cannot be distinguished: the measurements depend only on a "
                    "combination of them; fix one of them, or give it a prior"
                )
        if not any("cannot be distinguished" in w for w in warnings):
            correlation = _correlation(covariance)
            for i in range(len(names)):
                warnings += [
                    f"{names[j]} and {names[i]} can hardly be distinguished: their correlation is "
                    f"{correlation[i, j]:.4f}; fix one of them, give it a prior, or measure more"
                    for j in range(i)
                    if abs(correlation[i, j]) > _CONFOUNDED
                ]
    return warnings


@dataclass(frozen=True)
class _ModelFit:
    scenario: Scenario  # with its supports, before the numbers
    updated: Scenario
    theta: Floats
    misfit: float
    jacobian: Floats
    residuals: Callable[[Floats], Floats]
    limits: tuple[Floats, Floats]
    evaluations: int


class _NotEnoughModesError(ValueError):
    """A combination of supports leaves fewer modes than were measured."""


def _residuals(
    scenario: Scenario, numbers: list[Sought], measured: Floats, sigma: Floats
) -> Callable[[Floats], Floats]:
    """Residuals of frequencies and priors as a function of theta."""
    section = scenario.identify_stiffness
    assert section is not None
    weight = 1.0 / (measured * (sigma if sigma.all() else 1.0))
    prior = np.array([number.prior for number in numbers])
    informed = np.isfinite(prior)
    varied = _varied(scenario, numbers)

    def residuals(theta: Floats) -> Floats:
        predicted = free_frequencies(varied(theta), section.snubber, measured.size)
        predicted = predicted[predicted > 0]
        if predicted.size < measured.size:
            raise _NotEnoughModesError
        return np.concatenate([(predicted - measured) * weight, (np.exp(theta[informed]) - 1) / prior[informed]])

    return residuals


def _varied(scenario: Scenario, numbers: list[Sought]) -> Callable[[Floats], Scenario]:
    """The scenario as a function of theta, the logarithms of the numbers' factors."""

    def at(theta: Floats) -> Scenario:
        values: dict[Place, object] = {}
        for number, logarithm in zip(numbers, theta, strict=True):
            values |= number.at_factor(float(np.exp(logarithm)))
        return with_values(scenario, values).rechecked()

    return at


def _fit(scenario: Scenario, numbers: list[Sought], measured: Floats, sigma: Floats) -> _ModelFit:
    residuals = _residuals(scenario, numbers, measured, sigma)
    count = 0

    def counted(theta: Floats) -> Floats:
        nonlocal count
        count += 1
        return residuals(theta)

    lower, upper = _limits(numbers)
    if not numbers:
        value = counted(np.zeros(0))
        return _ModelFit(
            scenario,
            scenario,
            np.zeros(0),
            float(value @ value),
            np.zeros((value.size, 0)),
            residuals,
            (lower, upper),
            1,
        )
    solution = _solve(counted, np.zeros(len(numbers)), lower, upper)
    return _ModelFit(
        scenario,
        _varied(scenario, numbers)(solution.x),
        solution.x,
        float(2 * solution.cost),
        solution.jac,
        residuals,
        (lower, upper),
        count,
    )


def _solve(residuals: Callable[[Floats], Floats], start: Floats, lower: Floats, upper: Floats) -> Any:
    from scipy.optimize import least_squares

    inside = np.clip(start, lower + 1e-9, upper - 1e-9)
    return least_squares(
        residuals, inside, jac="3-point", bounds=(lower, upper), xtol=1e-12, ftol=1e-14, gtol=1e-12, max_nfev=200
    )


def _limits(numbers: list[Sought]) -> tuple[Floats, Floats]:
    lower = np.full(len(numbers), -np.log(_WIDEST_FACTOR))
    upper = -lower
    for i, number in enumerate(numbers):
        if np.isfinite(number.bounds[0]):
            lower[i] = np.log(number.bounds[0] / number.start) if number.bounds[0] > 0 else lower[i]
            upper[i] = np.log(number.bounds[1] / number.start)
        if any(place[-1] == "position" for place in number.places):
            lower[i], upper[i] = (
                max(lower[i], np.log(0.05)),
                min(upper[i], 0.0 if not number.bounds[1] < np.inf else upper[i]),
            )
    return np.asarray(lower), np.asarray(upper)


def _estimate(number: Sought, theta: float, deviation: float, z: float) -> ParameterEstimate:
    value = number.start * float(np.exp(theta))
    low, high = number.bounds
    at_bound = any(np.isfinite(b) and abs(np.log(value / b)) < _AT_BOUND for b in (low, high) if b > 0)
    return ParameterEstimate(
        parameter=number.parameter,
        before=number.start,
        value=value,
        standard_deviation=value * float(deviation),
        interval=(value * float(np.exp(-z * deviation)), value * float(np.exp(z * deviation))),
        bounds=number.bounds,
        prior=number.prior,
        at_bound=at_bound,
    )


def _profiles(fit: _ModelFit, numbers: list[Sought], deviation: Floats) -> tuple[tuple[ProfileLikelihood, ...], int]:
    """chi^2 against each parameter, the others fitted again."""
    lower, upper = fit.limits
    evaluations = 0
    profiles = []

    def residuals(theta: Floats) -> Floats:
        nonlocal evaluations
        evaluations += 1
        return fit.residuals(theta)

    for i, number in enumerate(numbers):
        if not np.isfinite(deviation[i]) or not 0 < deviation[i] < 1:
            continue
        offsets = np.linspace(-_PROFILE_WIDTH, _PROFILE_WIDTH, _PROFILE_POINTS) * deviation[i]
        grid = fit.theta[i] + offsets
        grid = grid[(grid >= lower[i]) & (grid <= upper[i])]
        others = np.delete(np.arange(len(numbers)), i)
        start = fit.theta[others]
        values = []
        for theta_i in grid:

            def fixed(rest: Floats, theta_i: float = float(theta_i), others: Any = others, i: int = i) -> Floats:
                theta = np.empty(len(numbers))
                theta[others], theta[i] = rest, theta_i
                return residuals(theta)

            if others.size == 0:
                values.append(float(np.sum(fixed(start) ** 2)))
                continue
            solution = _solve_quickly(fixed, start, lower[others], upper[others])
            values.append(float(2 * solution.cost))
        profiles.append(
            ProfileLikelihood(
                number.parameter, number.start * np.exp(grid), np.maximum(np.array(values) - fit.misfit, 0.0)
            )
        )
    return tuple(profiles), evaluations


def _solve_quickly(residuals: Callable[[Floats], Floats], start: Floats, lower: Floats, upper: Floats) -> Any:
    from scipy.optimize import least_squares

    inside = np.clip(start, lower + 1e-9, upper - 1e-9)
    return least_squares(
        residuals, inside, bounds=(lower, upper), diff_step=np.full(start.size, 1e-6), ftol=1e-8, xtol=1e-8, max_nfev=20
    )


def _correlation(covariance: Floats) -> Floats:
    with np.errstate(all="ignore"):
        deviation = np.sqrt(np.diag(covariance))
        return np.asarray(covariance / np.outer(deviation, deviation))


def _text(place: Place) -> str:
    return path_text(place)
