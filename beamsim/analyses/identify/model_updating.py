r"""Model updating: parameters of the structure from natural frequencies measured without the snubber.

The residuals of the fit are :math:`(f_j - m_j) / \sigma_j`. Supports are not numbers: every combination of the four
kinds is fitted and the best one kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from beamsim.analyses.identify.contact_point import free_frequencies
from beamsim.analyses.identify.covariance import confounded, correlation_of, inverse_information
from beamsim.analyses.identify.fit import Best, Fit, Place, Sought, UnpredictableError, sought_numbers, varied
from beamsim.analyses.identify.result import FrequencyTable, ModelUpdate
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.parameters import choices_at, value_at, with_values
from beamsim.scenario.studies import IdentifyStiffness
from beamsim.typing import Floats


def frequency_table(predicted_hz: Floats, measured_hz: Sequence[float], rigid: int) -> FrequencyTable:
    """Predicted frequencies and the measured ones, which start after so many rigid-body modes."""
    measured = np.full(predicted_hz.size, np.nan)
    measured[rigid : rigid + len(measured_hz)] = measured_hz[: predicted_hz.size - rigid]
    return FrequencyTable(np.arange(1, predicted_hz.size + 1), measured, predicted_hz)


def update_model(scenario: Scenario, section: IdentifyStiffness) -> ModelUpdate:
    """Fit the parameters of ``section.update`` to ``section.measured_without``.

    Raises
    ------
    ValueError
        If nothing was measured without the snubber (the schema refuses that).
    """
    numbers, words = sought_numbers(scenario, section.update)
    tried = [_with_supports(scenario, section, numbers, words, choice)
             for choice in product(*(choices_at(scenario, place) for place in words))]  # fmt: skip
    tried.sort(key=lambda each: each.misfit)
    first = tried[0]
    if first.fit is None or first.best is None:
        raise ValueError("the model has fewer modes than were measured")
    fit, best = first.fit, first.best
    jacobian = fit.jacobian(best.x)
    freedom, known = len(section.measured_without) - len(numbers), _sigma(section).all()
    # an unknown standard deviation is that of the residuals
    scale = 1.0 if known else best.misfit / freedom if freedom > 0 else np.nan
    covariance = inverse_information(jacobian) * scale
    deviation = np.sqrt(np.diag(covariance))
    parameters = fit.estimates(best.x, deviation, section.coverage)
    profiles = fit.profiles(best, covariance, scale, points=13) if scale > 0.0 else ()
    warnings = confounded([number.parameter for number in numbers], jacobian, covariance)
    warnings += [f"{p.parameter} ended on its bound, {p.value:g}" for p in parameters if p.at_bound]
    if len(tried) > 1 and tried[1].misfit < best.misfit + 4.0 * scale:
        warnings.append(f"the supports {tried[1].text} fit nearly as well: these frequencies do not distinguish them")
    updated = varied(first.scenario, numbers, best.x)
    return ModelUpdate(
        parameters=parameters,
        choices={path_text(place): str(value_at(updated, place)) for place in words},
        alternatives=tuple((each.text, each.misfit) for each in tried if words),
        correlation=correlation_of(covariance),
        before=_frequencies(scenario, section),
        after=_frequencies(updated, section),
        misfit_before=float(np.sum(_fit(scenario, section, numbers).residuals(np.zeros(len(numbers))) ** 2)),
        misfit_after=best.misfit,
        profiles=profiles,
        evaluations=sum(each.fit.evaluations for each in tried if each.fit is not None),
        warnings=tuple(warnings),
        scenario=updated,
    )


@dataclass(frozen=True)
class _Tried:
    """The fit with one combination of supports; none where that has no case or too few modes."""

    text: str
    scenario: Scenario  # with these supports, before the numbers
    fit: Fit | None = None
    best: Best | None = None

    @property
    def misfit(self) -> float:
        return np.inf if self.best is None else self.best.misfit


def _with_supports(
    scenario: Scenario, section: IdentifyStiffness, numbers: list[Sought], words: list[Place], choice: tuple[str, ...]
) -> _Tried:
    text = ", ".join(choice)
    try:
        scenario = with_values(scenario, dict(zip(words, choice, strict=True))).rechecked()
        fit = _fit(scenario, section, numbers)
        return _Tried(text, scenario, fit, fit.best(np.zeros(len(numbers))))
    except (ScenarioError, UnpredictableError):  # a support that holds the snubber's point, for example
        return _Tried(text, scenario)


def _fit(scenario: Scenario, section: IdentifyStiffness, numbers: list[Sought]) -> Fit:
    measured, sigma = np.array(section.measured_without), _sigma(section)

    def residuals(x: Floats, _: bool) -> Floats:
        predicted = free_frequencies(varied(scenario, numbers, x), section.snubber, measured.size)
        predicted = predicted[predicted > 0]
        if predicted.size < measured.size:
            raise UnpredictableError("the model has fewer modes than were measured")
        return np.asarray((predicted - measured) / (measured * (sigma if sigma.all() else 1.0)))

    return Fit(numbers, residuals)


def _sigma(section: IdentifyStiffness) -> Floats:
    return np.array([section.uncertainty_of(j + 1) for j in range(len(section.measured_without))])


def _frequencies(scenario: Scenario, section: IdentifyStiffness) -> FrequencyTable:
    predicted = free_frequencies(scenario, section.snubber, len(section.measured_without))
    return frequency_table(predicted, section.measured_without, int(np.sum(predicted == 0)))
