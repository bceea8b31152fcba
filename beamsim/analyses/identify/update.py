"""Parameters of the structure from natural frequencies measured without the snubber."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from beamsim.analyses.identify.fit import (
    Fit,
    FitParameter,
    LeastSquares,
    UnpredictableError,
    at_bounds,
    estimates_dataset,
    sought_numbers,
    with_parameters,
)
from beamsim.analyses.identify.layouts import BEFORE, UPDATE
from beamsim.analyses.identify.result import ComparedModes, Findings
from beamsim.errors import Problem, ScenarioError
from beamsim.outcomes import first_with_others
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, path_text
from beamsim.scenario.identification import IdentifyStiffness
from beamsim.scenario.parameters import choices_at, value_at, with_values, yaml_with_units
from beamsim.structures.assembly import assemble
from beamsim.structures.modes import natural_modes
from beamsim.typing import Floats

INDISTINCT_MISFIT = 4.0  # increase of chi squared up to which a support is nearly as good: two standard deviations
POINTS_OF_PROFILE = 13  # of the misfit along each parameter


def free_frequencies(scenario: Scenario, snubber: str, count: int) -> Floats:
    """Natural frequencies of the bodies that a snubber acts on, with every contact open.

    Parameters
    ----------
    scenario : scenario with the snubber.
    snubber : name of the snubber.
    count : number of modes besides rigid-body modes.

    Returns
    -------
    (m,) array
        Hz: zero for each rigid-body mode, then ``count`` others, or as many as there are.
    """
    model = assemble(scenario, scenario.located_snubber(snubber).bodies)
    count += model.rigid.shape[1]
    return np.asarray(natural_modes(model, count=count).omega[:count] * model.frequency_scale / (2 * np.pi))


def too_few_modes(key: str, measured: int, modes: int) -> Problem:
    """Problem for more measured frequencies than the model has modes."""
    return Problem(
        f"identify_stiffness.{key}",
        f"has {measured} frequencies, but the model has only {modes} modes",
        "increase the number of elements, or leave out the highest frequencies",
    )


def update_model(scenario: Scenario, section: IdentifyStiffness) -> tuple[Findings, Scenario]:
    """Fit the parameters of ``section.update`` to the frequencies ``section.measured_without``.

    Parameters
    ----------
    scenario : scenario with the initial values.
    section : section with the measured frequencies and the parameters to fit.

    Returns
    -------
    Findings with the modes before the update, and the scenario with the fitted parameters.

    Raises
    ------
    ScenarioError
        If no combination of supports is valid and has as many modes as were measured.
    """
    numbers, words = sought_numbers(scenario, section.update)
    start = np.zeros(len(numbers))
    tried, refused = _fits_of_supports(scenario, section, numbers, words)
    _, case, fit, best = tried[0]
    freedom, known = len(section.measured_without) - len(numbers), _sigma(section).all()
    # an unknown standard deviation is that of the residuals
    scale = 1.0 if known else best.misfit / freedom if freedom > 0 else np.nan
    parameters, covariance, warnings = fit.estimates(best, fit.jacobian(best.x), scale, section.coverage)
    profiles = fit.profiles(best, covariance, scale, points=POINTS_OF_PROFILE) if scale > 0.0 else ()
    if len(tried) > 1 and tried[1][3].misfit < best.misfit + INDISTINCT_MISFIT * scale:
        warnings.append(f"the supports {tried[1][0]} fit nearly as well: these frequencies do not distinguish them")
    updated = with_parameters(case, numbers, best.x)
    misfits = {text: found.misfit for text, _, _, found in tried} | dict.fromkeys(refused, np.inf) if words else {}
    misfit_before = float(np.sum(_fit(scenario, section, numbers).residuals(start) ** 2))
    more = {
        "combination": list(misfits), "combination_misfit": list(misfits.values()), "misfit_before": misfit_before,
        "misfit_after": best.misfit, "evaluations": sum(fit.evaluations for _, _, fit, _ in tried),
        "scenario": yaml_with_units(updated),
    }  # fmt: skip
    dataset = estimates_dataset(UPDATE, scenario, parameters, covariance, more)
    chosen = {path_text(place): str(value_at(updated, place)) for place in words}
    summary = {
        "updated": {each.parameter: each.summary() for each in parameters} | chosen,
        "supports_tried": misfits or None,
        "update_misfit": [misfit_before, best.misfit],
    }
    predicted = free_frequencies(scenario, section.snubber, len(section.measured_without))
    before = ComparedModes.of(predicted, section.measured_without, int(np.sum(predicted == 0)))
    outcome = first_with_others(at_bounds(scenario, parameters))
    return Findings([dataset], summary, warnings, profiles, {BEFORE: before}, outcome), updated


def _fits_of_supports(
    scenario: Scenario, section: IdentifyStiffness, numbers: list[FitParameter], supports: Sequence[Path]
) -> tuple[list[tuple[str, Scenario, Fit, LeastSquares]], dict[str, Problem]]:
    """Fits for every combination of supports, the best one first, and the problems of invalid combinations.

    Parameters
    ----------
    scenario, section : as in `update_model`.
    numbers, supports : numeric parameters, and paths of the supports.
    """
    tried, refused = [], dict[str, Problem]()
    for choice in product(*(choices_at(scenario, place) for place in supports)):
        text = ", ".join(choice)
        try:
            case = with_values(scenario, dict(zip(supports, choice, strict=True))).recheck()
            fit = _fit(case, section, numbers)
            tried.append((text, case, fit, fit.minimise(np.zeros(len(numbers)))))
        except ScenarioError as error:  # a support at the point of the snubber, for example
            refused[text] = error.problems[0]
        except UnpredictableError:
            measured = len(section.measured_without)
            modes = int(np.sum(free_frequencies(case, section.snubber, measured) > 0))
            refused[text] = too_few_modes("measured_without", measured, modes)
    if not tried:
        raise ScenarioError(next(iter(refused.values())))
    return sorted(tried, key=lambda each: each[3].misfit), refused


def _fit(scenario: Scenario, section: IdentifyStiffness, numbers: list[FitParameter]) -> Fit:
    measured, sigma = np.array(section.measured_without), _sigma(section)

    def residuals(x: Floats, _: bool) -> Floats:
        predicted = free_frequencies(with_parameters(scenario, numbers, x), section.snubber, measured.size)
        predicted = predicted[predicted > 0]
        if predicted.size < measured.size:
            raise UnpredictableError("the model has fewer modes than were measured")
        return np.asarray((predicted - measured) / (measured * (sigma if sigma.all() else 1.0)))

    return Fit(numbers, residuals)


def _sigma(section: IdentifyStiffness) -> Floats:
    return np.array([section.uncertainty_of(j + 1) for j in range(len(section.measured_without))])
