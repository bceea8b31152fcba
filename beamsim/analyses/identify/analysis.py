"""``beamsim identify-stiffness``: parameters of a snubber, and of the structure that carries it, from measurements."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from beamsim.analyses.identify.fit import (
    Fit,
    Sought,
    UnpredictableError,
    correlation_of,
    sought_numbers,
    varied,
)
from beamsim.analyses.identify.result import (
    FrequencyTable,
    IdentificationResult,
    ModelUpdate,
    NonlinearEstimate,
    ParameterEstimate,
    StiffnessEstimate,
)
from beamsim.analyses.identify.stiffness import (
    POOR_MODEL,
    permanent_contact,
    snubber_point,
)
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.compiled import processor_time
from beamsim.measurements.signal import MeasuredSignal
from beamsim.outcomes import Progress, Stop, asked_by, never, together
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.identification import IdentifyStiffness, MeasuredShapes, Pad
from beamsim.scenario.parameters import choices_at, value_at, with_values
from beamsim.signals.assurance import assurance
from beamsim.structures.assembly import assemble, joined_to
from beamsim.structures.modes import natural_modes
from beamsim.structures.places import Place
from beamsim.typing import Floats

_HZ = 2 * np.pi
_MIN_MODES = 3  # in the tables


def identify_stiffness(
    scenario: Scenario,
    measurements: Sequence[MeasuredSignal] = (),
    progress: Progress = None,
    stop: Stop = never,
) -> IdentificationResult:
    """Identify the parameters listed in the section ``identify_stiffness`` of a scenario.

    Parameters
    ----------
    scenario : with that section.
    measurements : one signal for each of ``identify_stiffness.nonlinear.tests`` that is used, read from their files.
    progress : called repeatedly with the fraction done.
    stop : asked within fits to vibrations whether to end with the best parameters so far, without their intervals.

    Returns
    -------
    IdentificationResult

    Raises
    ------
    ScenarioError
        If the section is missing, or no parameters explain the measurements: with the reason and a remedy.
    """
    with scenario.locating(), asked_by(stop):
        return _identify(scenario, measurements, progress)


def _identify(scenario: Scenario, measurements: Sequence[MeasuredSignal], progress: Progress) -> IdentificationResult:
    begin, processor = clock.perf_counter(), processor_time()
    section = scenario.identify_stiffness
    if section is None:
        raise ScenarioError.at(
            "identify_stiffness", "is missing", "add `identify_stiffness: {snubber: tip, measured_with: [...]}`"
        )
    warnings: list[str] = []
    update = update_model(scenario, section) if section.update else None
    current = scenario if update is None else update.scenario
    count = max(_MIN_MODES, len(section.measured_with), len(section.measured_without))
    point = snubber_point(current, section.snubber, count)
    rigid = int(np.sum(point.omega == 0))
    count += rigid
    for key in ("measured_without", "measured_with"):
        if (measured := len(getattr(section, key))) > point.omega.size - rigid:
            raise ScenarioError(_too_few_modes(key, measured, point.omega.size - rigid))
    without = FrequencyTable.of(point.omega[:count] / _HZ, section.measured_without, rigid)
    mac = None if section.shapes_without is None else _mac(current, section, section.shapes_without, warnings)
    warnings += _structure_warnings(without) if update is None else update.warnings
    if section.measured_with or section.measured_without or section.shapes_without is not None:
        warnings += _others(scenario, section.snubber)
    contact: dict[str, Any] = {"sensitivities": (), "curves": ()}
    if section.measured_with:
        contact, current, remarks = permanent_contact(current, section, point, count, update)
        warnings += remarks
    nonlinear: NonlinearEstimate | None = None
    if section.nonlinear is not None:
        from beamsim.analyses.identify.vibrations import fit_nonlinear

        nonlinear = fit_nonlinear(current, section, measurements, progress)
        warnings += nonlinear.warnings
    pad = None
    if section.pad is not None and section.pad.data is not None:
        from beamsim.analyses.identify.pad_fit import fit_pad

        pad = fit_pad(scenario, section.pad, section.pad.data, section.coverage)
        warnings += pad.warnings
    estimate = contact.get("estimate")
    parts = [part.outcome for part in (estimate, nonlinear) if part is not None and not part.outcome.complete]
    result = IdentificationResult(
        scenario=scenario,
        outcome=together(parts),
        **contact,
        without_snubber=without,
        update=update,
        mac=mac,
        nonlinear=nonlinear,
        pad_modulus=np.nan if section.pad is None or estimate is None else _pad_modulus(section.pad, estimate),
        pad=pad,
        warnings=tuple(warnings),
        processor_time_s=processor_time() - processor,
        wall_time_s=clock.perf_counter() - begin,
    )
    return result.with_summary(**_summary(result))


def _others(scenario: Scenario, snubber: str) -> Iterator[str]:
    """What is left out of the modes."""
    others = [s.name for s in scenario.all_snubbers if s.name != snubber]
    if others:
        yield f"the natural frequencies are those with the other snubbers ({', '.join(others)}) open"
    bodies = joined_to(scenario, scenario.located_snubber(snubber).bodies)
    if len(bodies) < len(scenario.all_bodies):
        yield (
            f"the natural frequencies are those of {' and '.join(bodies)}: the bodies that the snubber acts on, with "
            "those they are joined to"
        )


def _too_few_modes(key: str, measured: int, modes: int) -> Problem:
    """More frequencies were measured than the model has modes."""
    return Problem(
        f"identify_stiffness.{key}",
        f"has {measured} frequencies, but the model has only {modes} modes",
        "increase the number of elements, or leave out the highest frequencies",
    )


def mode_shapes(scenario: Scenario, snubber: str, count: int, positions: tuple[float, ...]) -> Floats:
    """Modes of the body that a snubber acts on, every contact open, without rigid-body modes.

    Parameters
    ----------
    scenario : with the snubber.
    snubber : its name; it acts on one body.
    count : number of modes.
    positions : p of them, m along a beam, or numbers of masses or nodes.

    Returns
    -------
    (p, count) array
        Mass-normalised.
    """
    bodies = scenario.located_snubber(snubber).bodies
    model = assemble(scenario, bodies)
    rigid = model.rigid.shape[1]
    modes = natural_modes(model, count=count + rigid)
    return np.asarray(model.rows([Place(bodies[0], x) for x in positions]) @ modes.vectors[:, rigid : rigid + count])


def _mac(scenario: Scenario, section: IdentifyStiffness, given: MeasuredShapes, warnings: list[str]) -> Floats:
    """Likeness of measured shapes and those of the model, with a warning for each that resembles another mode."""
    body = scenario.all_bodies[scenario.located_snubber(section.snubber).bodies[0]]
    positions = tuple(map(body.metres, given.positions))
    predicted = mode_shapes(scenario, section.snubber, max(len(given.shapes), _MIN_MODES), positions)
    mac = assurance(np.array(given.shapes).T, predicted)
    for i, row in enumerate(mac):
        best = int(np.argmax(row))
        if best != i:
            warnings.append(
                f"the measured shape {i + 1} resembles mode {best + 1} of the model (MAC {row[best]:.2f}) more than "
                f"mode {i + 1} (MAC {row[i]:.2f}): check the order of the modes"
            )
    return mac


def _structure_warnings(table: FrequencyTable) -> list[str]:
    off = table.difference_percent
    known = np.isfinite(off)
    if not known.any() or np.max(np.abs(off[known])) <= POOR_MODEL:
        return []
    worst = int(np.nanargmax(np.abs(off)))
    return [
        f"without the snubber the model's mode {worst + 1} differs by {off[worst]:+.1f} % from the measured frequency: "
        "correct the parameters of the structure first (identify_stiffness.update fits them)"
    ]


def _pad_modulus(pad: Pad, estimate: StiffnessEstimate) -> float:
    """E_r = k h / b, Pa (thesis, section 1.3.3); nan of a pad without dimensions."""
    if pad.height is None or pad.area is None:
        return float("nan")
    return estimate.stiffness * pad.height / pad.area


def _summary(result: IdentificationResult) -> dict[str, Any]:
    """What does not repeat a field of the result."""
    summary: dict[str, Any] = {}
    if result.estimate is not None:
        summary["pad_youngs_modulus_pa"] = result.pad_modulus
        per_stiffness = result.pad_modulus / result.estimate.stiffness
        summary["pad_youngs_modulus_interval_pa"] = [per_stiffness * end for end in result.estimate.interval]
        summary["sensitivities"] = {s.parameter: s.relative for s in result.sensitivities}
        contributions = {s.parameter: s.contribution for s in result.sensitivities if np.isfinite(s.contribution)}
        summary["sensitivity_contributions"] = contributions or None
    if result.pad is not None:
        summary["pad_yaml"] = result.pad.yaml
    if (update := result.update) is not None:
        summary["updated"] = {p.parameter: _plain(p) for p in update.parameters} | dict(update.choices)
        summary["supports_tried"] = dict(update.alternatives) or None
        summary["update_misfit"] = [update.misfit_before, update.misfit_after]
    return summary if result.nonlinear is None else summary | _summary_of_vibrations(result.nonlinear)


def _summary_of_vibrations(nonlinear: NonlinearEstimate) -> dict[str, Any]:
    """What was fitted to vibrations, and how well."""
    delays = {test.name: [test.delay_s, *test.delay_interval] for test in nonlinear.records}
    return {
        "estimated": {p.parameter: _plain(p) for p in nonlinear.parameters},
        "nonlinear_misfit": [nonlinear.misfit_before, nonlinear.misfit],
        "test_misfits": {test.name: [test.misfit, test.misfit_without] for test in nonlinear.records},
        "test_delays_s": {name: each for name, each in delays.items() if np.isfinite(each).all()},
        "starts_agreeing": [nonlinear.starts_agreeing, nonlinear.starts],
    }


def _plain(p: ParameterEstimate) -> dict[str, Any]:
    return {
        "value": p.value,
        "before": p.before,
        "standard_deviation": p.standard_deviation,
        "interval": list(p.interval),
    }


def free_frequencies(scenario: Scenario, snubber: str, count: int) -> Floats:
    """Natural frequencies, every contact open, of the bodies that a snubber acts on.

    Parameters
    ----------
    scenario : with the snubber.
    snubber : its name.
    count : number of modes beside the rigid-body modes.

    Returns
    -------
    (m,) array
        Hz: zeros of the rigid-body modes, then ``count`` others, or all there are.
    """
    model = assemble(scenario, scenario.located_snubber(snubber).bodies)
    count += model.rigid.shape[1]
    return np.asarray(natural_modes(model, count=count).omega[:count] * model.frequency_scale / (2 * np.pi))


def update_model(scenario: Scenario, section: IdentifyStiffness) -> ModelUpdate:
    """Fit the parameters of ``section.update`` to ``section.measured_without``.

    Raises
    ------
    ScenarioError
        If no combination of supports has a case with as many modes as were measured.
    """
    numbers, words = sought_numbers(scenario, section.update)
    start, tried, refused = np.zeros(len(numbers)), [], {}
    for choice in product(*(choices_at(scenario, place) for place in words)):
        text = ", ".join(choice)
        try:
            case = with_values(scenario, dict(zip(words, choice, strict=True))).rechecked()
            fit = _fit(case, section, numbers)
            tried.append((text, case, fit, fit.best(start)))
        except ScenarioError as error:  # a support that holds the snubber's point, for example
            refused[text] = error.problems[0]
        except UnpredictableError:
            measured = len(section.measured_without)
            modes = int(np.sum(free_frequencies(case, section.snubber, measured) > 0))
            refused[text] = _too_few_modes("measured_without", measured, modes)
    if not tried:
        raise ScenarioError(next(iter(refused.values())))
    tried.sort(key=lambda each: each[3].misfit)
    _, case, fit, best = tried[0]
    freedom, known = len(section.measured_without) - len(numbers), _sigma(section).all()
    # an unknown standard deviation is that of the residuals
    scale = 1.0 if known else best.misfit / freedom if freedom > 0 else np.nan
    parameters, covariance, warnings = fit.estimates(best, fit.jacobian(best.x), scale, section.coverage)
    profiles = fit.profiles(best, covariance, scale, points=13) if scale > 0.0 else ()
    misfits = {text: found.misfit for text, _, _, found in tried}
    if len(tried) > 1 and tried[1][3].misfit < best.misfit + 4.0 * scale:
        warnings.append(f"the supports {tried[1][0]} fit nearly as well: these frequencies do not distinguish them")
    updated = varied(case, numbers, best.x)
    return ModelUpdate(
        parameters=parameters,
        choices={path_text(place): str(value_at(updated, place)) for place in words},
        alternatives=tuple((misfits | dict.fromkeys(refused, np.inf)).items()) if words else (),
        correlation=correlation_of(covariance),
        before=_frequencies(scenario, section),
        after=_frequencies(updated, section),
        misfit_before=float(np.sum(_fit(scenario, section, numbers).residuals(start) ** 2)),
        misfit_after=best.misfit,
        profiles=profiles,
        evaluations=sum(fit.evaluations for _, _, fit, _ in tried),
        warnings=tuple(warnings),
        scenario=updated,
    )


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
    return FrequencyTable.of(predicted, section.measured_without, int(np.sum(predicted == 0)))
