r"""Least-squares fit of parameters of a scenario to measurements of any kind.

Each kind of data provides residuals, weighted by their standard deviations, as a function of x. There is one x for
each parameter: the logarithm of a factor, :math:`p = p_0 e^x`, or a shift if the parameter may be zero. A path with
``[*]`` is one factor for the whole list. Priors with a relative standard deviation :math:`\pi` add the residuals
:math:`(p/p_0 - 1)/\pi`. The sum of squares, :math:`\chi^2`, is minimised within the bounds, with derivatives by finite
differences.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.identify.layouts import ENDS
from beamsim.analyses.identify.result import ProfileLikelihood
from beamsim.errors import ScenarioError
from beamsim.labelled import Dataset, Layout
from beamsim.outcomes import MOST_LISTED, Interrupted, Outcome, OutcomeKind, first_of, stop_requested, stop_requests
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path
from beamsim.scenario.identification import ParameterToIdentify, bounds_of
from beamsim.scenario.parameters import choices_at, find_parameters, unit_of, value_at, with_values
from beamsim.typing import Bools, Floats

MOST_EVALUATIONS = 100  # of the residuals in one fit, not counting those for derivatives
_WIDEST_FACTOR = 100.0  # without bounds, the search range is this factor on either side of the scenario's value
_STEP = 1e-5  # of x, for finite differences
_PROFILE_WIDTH = 2.5  # half-width of a profile, in standard deviations
ON_BOUND = 1e-6  # distance of x from a bound
WITHOUT_INFLUENCE = 1e-9  # relative to the largest derivative of a parameter
LEAST_SINGULAR_RATIO = 1e-6  # ratio of singular values below which only a combination of parameters is determined
LEAST_COMPONENT = 0.2  # component of a parameter in such a combination, above which it is named
CORRELATED = 0.995  # correlation above which parameters can hardly be distinguished


class UnpredictableError(ArithmeticError):
    """The model has no prediction for these parameters."""


@dataclass(frozen=True)
class FitParameter:
    """Parameter to be identified, with its places in the scenario."""

    parameter: str
    places: tuple[Path, ...]
    values: tuple[float, ...]  # SI, one for each place
    bounds: tuple[float, float]  # SI, of the value at the first place; infinite if there is no bound
    prior: float  # relative standard deviation; nan without prior
    shift: float  # SI, change for x = 1; zero if x is the logarithm of a factor

    @property
    def start(self) -> float:
        """Value in the scenario, at the first place."""
        return self.values[0]

    def at(self, x: float) -> list[float]:
        """Values at all places for a given x."""
        with np.errstate(over="ignore"):  # an interval may be unbounded
            factor = float(np.exp(x))
        return [value + self.shift * x if self.shift else value * factor for value in self.values]

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds of x."""
        low, high = self.bounds
        if self.shift:
            low = low if self.is_gap else max(low, 0.0)
            return (low - self.start) / self.shift, (high - self.start) / self.shift
        if self.places[0][-1] == "position" and not np.isfinite(high):  # from the start to its present place
            return float(np.log(0.05)), 0.0
        lower = low / self.start if 0.0 < low < np.inf else 1 / _WIDEST_FACTOR
        upper = high / self.start if high < np.inf else _WIDEST_FACTOR
        return float(np.log(lower)), float(np.log(upper))

    @property
    def is_gap(self) -> bool:
        """True for a gap, which may be negative."""
        return any(place[-1] == "gap" for place in self.places)


def sought_numbers(
    scenario: Scenario, sections: Sequence[ParameterToIdentify]
) -> tuple[list[FitParameter], list[Path]]:
    """Locate the numeric parameters, and the paths of non-numeric ones (supports)."""
    numbers: list[FitParameter] = []
    words: list[Path] = []
    for item in sections:
        places = find_parameters(scenario, item.parameter)
        if choices_at(scenario, places[0]):
            words += places
            continue
        values = tuple(float(value_at(scenario, place)) for place in places)
        prior = np.nan if item.prior is None else item.prior
        shift = 0.0 if values[0] > 0.0 else 0.01
        numbers.append(FitParameter(item.parameter, tuple(places), values, bounds_of(scenario, item), prior, shift))
    return numbers, words


def with_parameters(scenario: Scenario, numbers: Sequence[FitParameter], x: Floats) -> Scenario:
    """Copy of the scenario with other values of the parameters.

    Parameters
    ----------
    scenario : scenario in which the parameters were located.
    numbers : p parameters.
    x : (p,) logarithms of factors, or shifts.

    Returns
    -------
    Scenario
        Validated scenario.

    Raises
    ------
    UnpredictableError
        If the scenario is not valid with these values.
    """
    values: dict[Path, object] = {}
    for number, each in zip(numbers, x, strict=True):
        values |= zip(number.places, number.at(float(each)), strict=True)
    try:
        return with_values(scenario, values).recheck()
    except ScenarioError as error:
        raise UnpredictableError(str(error)) from error


class ParameterEstimate(NamedTuple):
    """Estimate of a parameter, in SI units."""

    parameter: str
    initial_value: float  # value in the scenario; of the first item for [*]
    value: float
    standard_deviation: float  # nan if it is not known
    interval: tuple[float, float]
    bounds: tuple[float, float]
    prior: float  # relative standard deviation; nan without prior
    at_bound: bool

    def summary(self) -> dict[str, Any]:
        """Entries for the summary of the result."""
        return {
            "value": self.value, "initial_value": self.initial_value, "standard_deviation": self.standard_deviation,
            "interval": list(self.interval),
        }  # fmt: skip


def estimates_dataset(
    layout: Layout,
    scenario: Scenario,
    parameters: Sequence[ParameterEstimate],
    covariance: Floats,
    more: Mapping[str, Any],
) -> Dataset:
    """Build the labelled dataset of a fit.

    Parameters
    ----------
    layout : layout of the dataset.
    scenario : scenario with the parameters.
    parameters : p estimates.
    covariance : (p, p) covariance of the estimates.
    more : further variables of the dataset, by name.

    Returns
    -------
    Dataset
    """
    names = [each.parameter for each in parameters]
    pairs = {name: np.array([getattr(each, name) for each in parameters]) for name in ("interval", "bounds")}
    known = {"parameter": names, "other_parameter": names, "correlation": correlation_of(covariance), "end": ENDS}
    return layout.table(parameters, [{"unit": unit_of(scenario, name)} for name in names], **known, **pairs, **more)


@dataclass(frozen=True)
class LeastSquares:
    """Minimum of the sum of squares."""

    x: Floats  # (p,)
    misfit: float  # chi squared
    converged: bool


UNPREDICTED_RESIDUAL = 1e6  # residual if the model has no prediction


class Fit:
    """Least-squares problem.

    Parameters
    ----------
    numbers : p parameters.
    measured : function of (p,) x and a flag, which is True for a small step from the last x (difference quotient).
        Returns (r,) weighted residuals, or raises `UnpredictableError`.
    """

    def __init__(self, numbers: Sequence[FitParameter], residual_function: Callable[[Floats, bool], Floats]) -> None:
        self.numbers, self.measured = tuple(numbers), residual_function
        limits = np.array([number.limits for number in numbers]).reshape(-1, 2)
        self.lower, self.upper = limits[:, 0], limits[:, 1]
        self.evaluations = 0
        self._last: tuple[Floats, Floats] | None = None
        self._least: LeastSquares | None = None  # best of all evaluations so far

    def residuals(self, x: Floats, differencing: bool = False) -> Floats:
        """Residuals of the measurements, then of the priors; `differencing` as in ``measured``."""
        if self._last is None or not np.array_equal(self._last[0], x):  # differences start from the last x
            self.evaluations += 1
            priors = [
                (number.at(float(each))[0] - number.start) / (number.prior * (abs(number.start) or number.shift))
                for number, each in zip(self.numbers, x, strict=True)
                if np.isfinite(number.prior)
            ]
            self._last = (x.copy(), np.concatenate([self.measured(x, differencing), priors]))
            misfit = float(self._last[1] @ self._last[1])
            if self._least is None or misfit < self._least.misfit:
                self._least = LeastSquares(self._last[0], misfit, converged=False)
        return self._last[1]

    def jacobian(self, x: Floats) -> Floats:
        """(r, p) derivatives; nan for a parameter if the model has no prediction on either side."""
        here = self.residuals(x)
        out = np.full((here.size, x.size), np.nan)
        for i in range(x.size):
            points = [(0.0, here)]
            for step in (_STEP, -_STEP):
                shifted = x.copy()
                shifted[i] += step
                if not self.lower[i] <= shifted[i] <= self.upper[i]:
                    continue
                try:
                    points.append((step, self.residuals(shifted, True)))
                except UnpredictableError:
                    continue
            if len(points) > 1:
                (one, at_one), (other, at_other) = points[-2:]
                out[:, i] = (at_one - at_other) / (one - other)
        return out

    def minimise(self, start: Floats, fixed: Bools | None = None, tolerance: float = 1e-10) -> LeastSquares:
        """Minimise the sum of squares within the bounds.

        Parameters
        ----------
        start : (p,) where the search begins.
        fixed : (p,) True for parameters that keep their values; none by default.
        tolerance : relative tolerance of the sum and of x.

        Returns
        -------
        LeastSquares
            Not converged after `MOST_EVALUATIONS` evaluations or an interruption; it then holds the best evaluation.

        Raises
        ------
        UnpredictableError
            If the model has no prediction at the start.
        Interrupted
            If interrupted before the first evaluation.
        """
        try:
            with stop_requests(at_once=True):
                return self._search(start, fixed, tolerance)
        except Interrupted:
            if self._least is None:
                raise
            return self._least

    def _search(self, start: Floats, fixed: Bools | None, tolerance: float) -> LeastSquares:
        """Run the optimiser; see `minimise`."""
        from scipy.optimize import least_squares

        start = np.clip(start, np.nextafter(self.lower, np.inf), np.nextafter(self.upper, -np.inf))
        free = np.ones(start.size, dtype=bool) if fixed is None else ~fixed
        first = self.residuals(start)
        if not free.any():
            return LeastSquares(start, float(first @ first), True)

        def all_parameters(y: Floats) -> Floats:
            x = start.copy()
            x[free] = y
            return x

        def residuals(y: Floats) -> Floats:
            try:
                return self.residuals(all_parameters(y))
            except UnpredictableError:
                return np.full(first.size, UNPREDICTED_RESIDUAL)

        def jacobian(y: Floats) -> Floats:
            return np.nan_to_num(self.jacobian(all_parameters(y))[:, free])

        found = least_squares(
            residuals, start[free], jac=jacobian,
            bounds=(self.lower[free], self.upper[free]), x_scale="jac", xtol=tolerance, ftol=tolerance, gtol=tolerance,
            max_nfev=MOST_EVALUATIONS,
        )  # fmt: skip
        return LeastSquares(all_parameters(found.x), float(2 * found.cost), found.status != 0)

    def estimates(
        self, best: LeastSquares, jacobian: Floats, scale: float, coverage: float, undetermined: Collection[int] = ()
    ) -> tuple[tuple[ParameterEstimate, ...], Floats, list[str]]:
        """Parameters with their confidence intervals.

        Parameters
        ----------
        best : the estimate.
        jacobian : (r, p) derivatives of the residuals at the estimate; zero for those in ``undetermined``.
        scale : factor on the covariance; nan if it is unknown.
        coverage : probability of the intervals.
        undetermined : indices of parameters that the measurements cannot determine and that need no warning.

        Returns
        -------
        the parameters, their (p, p) covariance, and warnings about undetermined parameters.
        """
        covariance = inverse_information(jacobian) * scale
        z, estimates = NormalDist().inv_cdf(0.5 + coverage / 2), []
        for number, x, deviation, low, high in zip(
            self.numbers, best.x.tolist(), np.sqrt(np.diag(covariance)).tolist(), self.lower, self.upper, strict=True
        ):
            value = number.at(x)[0]
            estimates.append(
                ParameterEstimate(
                    parameter=number.parameter,
                    initial_value=number.start,
                    value=value,
                    standard_deviation=deviation * (number.shift or value),
                    interval=(number.at(x - z * deviation)[0], number.at(x + z * deviation)[0]),
                    bounds=number.bounds,
                    prior=number.prior,
                    at_bound=bool(min(abs(x - low), abs(high - x)) < ON_BOUND),
                )
            )
        determined = [i for i in range(len(self.numbers)) if i not in undetermined]
        sought = [self.numbers[i] for i in determined]
        of_determined = covariance[np.ix_(determined, determined)]
        return tuple(estimates), covariance, _confounding_warnings(sought, jacobian[:, determined], of_determined)

    def profiles(
        self, best: LeastSquares, covariance: Floats, scale: float, points: int
    ) -> tuple[ProfileLikelihood, ...]:
        r"""Profile likelihoods: :math:`\chi^2` above its minimum over each parameter, with the others fitted again.

        Parameters
        ----------
        best : the estimate.
        covariance : (p, p) covariance of the estimate.
        scale : factor in the covariance; :math:`\chi^2` is divided by it.
        points : number of values per parameter; values without a prediction are left out.

        Returns
        -------
        tuple of ProfileLikelihood
            For parameters whose standard deviation in x lies between 0 and 1; empty after an interruption.
        """
        profiles = []
        for i, number in enumerate(self.numbers):
            deviation = float(np.sqrt(covariance[i, i]))
            if not 0 < deviation < 1:
                continue
            value, misfit = [], []
            for at in best.x[i] + np.linspace(-_PROFILE_WIDTH, _PROFILE_WIDTH, points) * deviation:
                if not self.lower[i] < at < self.upper[i]:
                    continue
                start = best.x + covariance[:, i] / covariance[i, i] * (at - best.x[i])
                try:
                    again = self.minimise(start, np.arange(start.size) == i, tolerance=1e-4)
                except UnpredictableError:
                    continue
                if stop_requested():
                    return ()
                value.append(number.at(float(at))[0])
                misfit.append(max(again.misfit - best.misfit, 0.0) / scale)
            profiles.append(ProfileLikelihood(number.parameter, np.array(value), np.array(misfit)))
        return tuple(profiles)


def at_bounds(scenario: Scenario, parameters: Sequence[ParameterEstimate]) -> tuple[Outcome, ...]:
    """Outcome of a fit that ended on bounds: better values may lie beyond them, and the intervals are not valid.

    Parameters
    ----------
    scenario : scenario with the parameters.
    parameters : the estimates.

    Returns
    -------
    tuple of Outcome
        One outcome, or none if every parameter lies inside its bounds.
    """
    ended = [
        f"{p.parameter} ended on its bound, {p.value:g} {unit_of(scenario, p.parameter)}".removesuffix(" 1")
        for p in parameters
        if p.at_bound
    ]
    if not ended:
        return ()
    return (
        Outcome.of(
            OutcomeKind.UNTRUSTED, "at_bound", first_of(ended, MOST_LISTED),
            remedy="widen the bounds, or check what was measured and the rest of the model",
            parameters=tuple(p.parameter for p in parameters if p.at_bound),
        ),
    )  # fmt: skip


SMALL_PROBABILITY = 1e-3  # probability of chi squared, below which the stated noise is taken as too small


def widening(misfit: float, degrees_of_freedom: int) -> float:
    """Factor on a covariance: chi squared per degree of freedom if the stated noise hardly explains it, else 1."""
    from scipy.special import gammaincc

    unexplained = degrees_of_freedom > 0 and float(gammaincc(degrees_of_freedom / 2, misfit / 2)) < SMALL_PROBABILITY
    return misfit / degrees_of_freedom if unexplained else 1.0


NO_INFLUENCE = 1e-14  # ratio of eigenvalues below which a combination of parameters has no influence


def inverse_information(jacobian: Floats) -> Floats:
    """(p, p) inverse of ``jacobian.T @ jacobian``; nan for parameters that the residuals do not determine.

    These are parameters without influence, and members of a combination without influence. With an unknown (nan)
    derivative all variances are nan.
    """
    if not jacobian.size or not np.all(np.isfinite(jacobian)):
        return np.full((jacobian.shape[1],) * 2, np.nan)
    size = np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0, size, 1.0)
    scaled = jacobian / size
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    null = values <= NO_INFLUENCE * values[-1]
    inverse = np.asarray((vectors[:, ~null] / values[~null]) @ vectors[:, ~null].T / np.outer(size, size))
    undetermined = (vectors[:, null] ** 2).sum(axis=1) > 1e-12
    inverse[undetermined, :] = inverse[:, undetermined] = np.nan
    return inverse


def _confounding_warnings(parameters: Sequence[FitParameter], jacobian: Floats, covariance: Floats) -> list[str]:
    """Warn about parameters that the measurements cannot distinguish.

    Parameters
    ----------
    parameters : the p parameters.
    jacobian, covariance : (r, p) derivatives of the residuals; (p, p).

    Returns
    -------
    One sentence for each group.
    """
    names = [number.parameter for number in parameters]
    without_prior = {number.parameter for number in parameters if np.isnan(number.prior)}
    if len(names) == 0:
        return []

    def remedy(*together: str) -> str:
        return "fix one of them, or give it a prior" if without_prior.intersection(together) else "fix one of them"

    size = np.linalg.norm(jacobian, axis=0)
    warnings = [
        f"{name} has no influence on the measured quantities and cannot be identified from them"
        for name, s in zip(names, size, strict=True)
        if s <= WITHOUT_INFLUENCE * size.max()
    ]
    usable = size > WITHOUT_INFLUENCE * size.max()
    if usable.sum() > 1:
        kept = [name for name, ok in zip(names, usable, strict=True) if ok]
        _, values, directions = np.linalg.svd(jacobian[:, usable] / size[usable], full_matrices=True)
        values = np.concatenate([values, np.zeros(len(kept) - values.size)])
        for value, direction in zip(values, directions, strict=True):
            if value < LEAST_SINGULAR_RATIO * values[0]:
                together = [n for n, d in zip(kept, direction, strict=True) if abs(d) > LEAST_COMPONENT]
                warnings.append(
                    f"{' and '.join(together)} cannot be distinguished: the measurements depend only on a "
                    f"combination of them; {remedy(*together)}"
                )
        if not any("cannot be distinguished" in w for w in warnings):
            correlation = correlation_of(covariance)
            for i in range(len(names)):
                warnings += [
                    f"{names[j]} and {names[i]} can hardly be distinguished: their correlation is "
                    f"{correlation[i, j]:.4f}; measure more, {remedy(names[j], names[i])}"
                    for j in range(i)
                    if abs(correlation[i, j]) > CORRELATED
                ]
    return warnings


def correlation_of(covariance: Floats) -> Floats:
    """(p, p) correlation matrix; nan where it is unknown."""
    with np.errstate(all="ignore"):
        deviation = np.sqrt(np.diag(covariance))
        return np.asarray(covariance / np.outer(deviation, deviation))
