r"""Parameters of a scenario that make residuals small: one fit, whatever was measured.

Each kind of data gives its residuals, weighted by their standard deviations, as a function of x, one number for each
parameter: the logarithm of a factor, :math:`p = p_0 e^x`, or a shift where a parameter may be zero. A path with ``[*]``
is one factor for the whole list. Priors with a relative standard deviation :math:`\pi` are further residuals,
:math:`(p/p_0 - 1)/\pi`. Their sum of squares, :math:`\chi^2`, is minimised within the bounds; derivatives are
differences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from beamsim.analyses.identify.result import ParameterEstimate, ProfileLikelihood
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import choices_at, find_parameters, read_as, value_at, with_values
from beamsim.scenario.studies import SoughtParameter
from beamsim.typing import Bools, Floats

Place = tuple[str | int, ...]

MOST_EVALUATIONS = 100  # of the residuals beside derivatives, in one fit
_WIDEST_FACTOR = 100.0  # without bounds, the search range is this factor on either side of the scenario's value
_STEP = 1e-5  # of x, for differences
_PROFILE_WIDTH = 2.5  # standard deviations


class UnpredictableError(ArithmeticError):
    """With these parameters the model predicts nothing that could be compared."""


@dataclass(frozen=True)
class Sought:
    """A parameter to be identified, located in its scenario."""

    parameter: str
    places: tuple[Place, ...]
    values: tuple[float, ...]  # SI, one for each place
    bounds: tuple[float, float]  # SI, of the first place's value; infinite without
    prior: float  # relative standard deviation; nan without
    shift: float  # SI, for x = 1; zero where x is the logarithm of a factor

    @property
    def start(self) -> float:
        """The scenario's value, of the first place."""
        return self.values[0]

    def at(self, x: float) -> list[float]:
        """Values at all places."""
        factor = float(np.exp(x))
        return [value + self.shift * x if self.shift else value * factor for value in self.values]

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds of x."""
        low, high = self.bounds
        if self.shift:
            low = low if self.is_gap else max(low, 0.0)
            return (low - self.start) / self.shift, (high - self.start) / self.shift
        if self.places[0][-1] == "position" and not np.isfinite(high):  # from the start of the body to where it is
            return float(np.log(0.05)), 0.0
        lower = low / self.start if 0.0 < low < np.inf else 1 / _WIDEST_FACTOR
        upper = high / self.start if high < np.inf else _WIDEST_FACTOR
        return float(np.log(lower)), float(np.log(upper))

    @property
    def is_gap(self) -> bool:
        """Whether it is a gap, which may be negative."""
        return any(place[-1] == "gap" for place in self.places)


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
        shift = 0.0 if values[0] > 0.0 else 0.01
        numbers.append(Sought(item.parameter, tuple(places), values, bounds, prior, shift))
    return numbers, words


def varied(scenario: Scenario, numbers: Sequence[Sought], x: Floats) -> Scenario:
    """The scenario with other values of the parameters.

    Raises
    ------
    UnpredictableError
        If there is no such case.
    """
    values: dict[Place, object] = {}
    for number, each in zip(numbers, x, strict=True):
        values |= zip(number.places, number.at(float(each)), strict=True)
    try:
        return with_values(scenario, values).rechecked()
    except ScenarioError as error:
        raise UnpredictableError(str(error)) from error


@dataclass(frozen=True)
class Best:
    """Where the sum of squares is least."""

    x: Floats  # (p,)
    misfit: float  # chi squared
    converged: bool


class Fit:
    """A least-squares problem.

    Parameters
    ----------
    numbers : p parameters.
    measured : (p,) x to (r,) weighted residuals, and whether x is just beside the last place, for a difference; raises
        `UnpredictableError` where there are none.
    """

    def __init__(self, numbers: Sequence[Sought], measured: Callable[[Floats, bool], Floats]) -> None:
        self.numbers, self.measured = tuple(numbers), measured
        limits = np.array([number.limits for number in numbers]).reshape(-1, 2)
        self.lower, self.upper = limits[:, 0], limits[:, 1]
        self.evaluations = 0
        self._last: tuple[Floats, Floats] | None = None

    def residuals(self, x: Floats, beside: bool = False) -> Floats:
        """Those of the measurements, then those of the priors; `beside` as for the measurements."""
        if self._last is None or not np.array_equal(self._last[0], x):  # a derivative is asked for where they were
            self.evaluations += 1
            priors = [
                (number.at(float(each))[0] - number.start) / (number.prior * (abs(number.start) or number.shift))
                for number, each in zip(self.numbers, x, strict=True)
                if np.isfinite(number.prior)
            ]
            self._last = (x.copy(), np.concatenate([self.measured(x, beside), priors]))
        return self._last[1]

    def jacobian(self, x: Floats) -> Floats:
        """(r, p) derivatives; nan of a parameter on neither side of which the model predicts anything."""
        here = self.residuals(x)
        out = np.full((here.size, x.size), np.nan)
        for i in range(x.size):
            points = [(0.0, here)]
            for step in (_STEP, -_STEP):
                beside = x.copy()
                beside[i] += step
                if not self.lower[i] <= beside[i] <= self.upper[i]:
                    continue
                try:
                    points.append((step, self.residuals(beside, True)))
                except UnpredictableError:
                    continue
            if len(points) > 1:
                (one, at_one), (other, at_other) = points[-2:]
                out[:, i] = (at_one - at_other) / (one - other)
        return out

    def best(self, start: Floats, held: Bools | None = None, tolerance: float = 1e-10) -> Best:
        """The least sum of squares within the bounds.

        Parameters
        ----------
        start : (p,) where the search begins.
        held : (p,) which parameters keep their values; none by default.
        tolerance : relative, of the sum and of x.

        Raises
        ------
        UnpredictableError
            If the model predicts nothing at the start.
        """
        from scipy.optimize import least_squares

        start = np.clip(start, np.nextafter(self.lower, np.inf), np.nextafter(self.upper, -np.inf))
        free = np.ones(start.size, dtype=bool) if held is None else ~held
        first = self.residuals(start)
        if not free.any():
            return Best(start, float(first @ first), True)

        def whole(y: Floats) -> Floats:
            x = start.copy()
            x[free] = y
            return x

        def residuals(y: Floats) -> Floats:
            try:
                return self.residuals(whole(y))
            except UnpredictableError:
                # 1e6: residual where the model predicts nothing
                return np.full(first.size, 1e6)

        def jacobian(y: Floats) -> Floats:
            return np.nan_to_num(self.jacobian(whole(y))[:, free])

        found = least_squares(
            residuals, start[free], jac=jacobian,
            bounds=(self.lower[free], self.upper[free]), x_scale="jac", xtol=tolerance, ftol=tolerance, gtol=tolerance,
            max_nfev=MOST_EVALUATIONS,
        )  # fmt: skip
        return Best(whole(found.x), float(2 * found.cost), found.status != 0)

    def estimates(self, x: Floats, deviation: Floats, coverage: float) -> tuple[ParameterEstimate, ...]:
        """The parameters with their intervals.

        Parameters
        ----------
        x, deviation : (p,) estimates and their standard deviations, nan where unknown.
        coverage : probability of the intervals.
        """
        z = NormalDist().inv_cdf(0.5 + coverage / 2)
        return tuple(
            ParameterEstimate(
                parameter=number.parameter,
                before=number.start,
                value=number.at(float(x[i]))[0],
                standard_deviation=float(deviation[i]) * (number.shift or number.at(float(x[i]))[0]),
                interval=(number.at(float(x[i] - z * deviation[i]))[0], number.at(float(x[i] + z * deviation[i]))[0]),
                bounds=number.bounds,
                prior=number.prior,
                at_bound=bool(min(abs(x[i] - self.lower[i]), abs(self.upper[i] - x[i])) < 1e-6),
            )
            for i, number in enumerate(self.numbers)
        )

    def profiles(self, best: Best, covariance: Floats, scale: float, points: int) -> tuple[ProfileLikelihood, ...]:
        r"""How far :math:`\chi^2` is above its minimum over each parameter, the others fitted again.

        Parameters
        ----------
        best : the estimate.
        covariance : (p, p) of it.
        scale : factor in the covariance, by which :math:`\chi^2` is divided.
        points : number of values of each parameter; those for which the model predicts nothing are left out.
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
                    again = self.best(start, np.arange(start.size) == i, tolerance=1e-4)
                except UnpredictableError:
                    continue
                value.append(number.at(float(at))[0])
                misfit.append(max(again.misfit - best.misfit, 0.0) / scale)
            profiles.append(ProfileLikelihood(number.parameter, np.array(value), np.array(misfit)))
        return tuple(profiles)
