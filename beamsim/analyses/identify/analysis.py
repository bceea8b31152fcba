"""``beamsim identify-stiffness``: parameters of a snubber, and of the structure that carries it, from measurements."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamsim.analyses.assurance import assurance
from beamsim.analyses.identify.contact_point import mode_shapes, snubber_point
from beamsim.analyses.identify.covariance import widening
from beamsim.analyses.identify.model_updating import frequency_table, update_model
from beamsim.analyses.identify.result import (
    FrequencyCurve,
    FrequencyTable,
    IdentificationResult,
    ModelUpdate,
    NonlinearEstimate,
    ParameterEstimate,
    ProfileLikelihood,
    Sensitivity,
    StiffnessEstimate,
    TableSlope,
)
from beamsim.analyses.identify.stiffness import (
    MeasuredModes,
    check_reach,
    fit_stiffness,
    individual_stiffness,
    misfit,
    thesis_loop,
)
from beamsim.analyses.identify.tables import compared, table_slope, with_factor
from beamsim.analyses.identify.uncertainty import monte_carlo, sensitivities, spread_of, stiffness_profile
from beamsim.errors import Problem, ScenarioError
from beamsim.measurements.signal import MeasuredSignal
from beamsim.outcomes import COMPLETE, Stop, never, together
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import with_values
from beamsim.scenario.studies import IdentifyStiffness
from beamsim.structures.assembly import joined_to
from beamsim.structures.secular import SpringPoint
from beamsim.typing import Floats

_HZ = 2 * np.pi
_NARROWEST = 1e-3  # the curves cover the identified stiffness times this factor to divided by it
_MIN_MODES = 3  # in the tables
_POOR_MODEL = 3.0  # percent; a larger frequency error without snubber gives a warning


def identify_stiffness(
    scenario: Scenario,
    measurements: Sequence[MeasuredSignal] = (),
    progress: Callable[[float], None] | None = None,
    stop: Stop = never,
) -> IdentificationResult:
    """Identify the parameters listed in the section ``identify_stiffness`` of a scenario.

    Parameters
    ----------
    scenario : with that section.
    measurements : one signal for each of ``identify_stiffness.nonlinear.tests``, read from their files.
    progress : called repeatedly with the fraction done.
    stop : asked after each start of a fit to vibrations, and before its profiles, whether to end with the best so far.

    Raises
    ------
    ScenarioError
        If no parameters explain the measurements, with the reason and a remedy.
    """
    try:
        return _identify(scenario, measurements, progress, stop)
    except ScenarioError as error:
        raise scenario.located(error) from None


def _identify(
    scenario: Scenario,
    measurements: Sequence[MeasuredSignal],
    progress: Callable[[float], None] | None,
    stop: Stop,
) -> IdentificationResult:
    begin, processor = clock.perf_counter(), clock.process_time()
    section = scenario.identify_stiffness
    if section is None:
        raise ScenarioError(
            Problem(
                "identify_stiffness", "is missing", "add `identify_stiffness: {snubber: tip, measured_with: [...]}`"
            )
        )
    warnings: list[str] = []
    update = update_model(scenario, section) if section.update else None
    current = scenario if update is None else update.scenario
    count = max(_MIN_MODES, len(section.measured_with), len(section.measured_without))
    point = snubber_point(current, section.snubber, count)
    rigid = int(np.sum(point.omega == 0))
    count += rigid
    _enough_modes(point, section, rigid)
    without = frequency_table(point.omega[:count] / _HZ, section.measured_without, rigid)
    mac = _mac(current, section, warnings)
    warnings += _structure_warnings(without) if update is None else update.warnings
    warnings += _others(scenario, section.snubber)
    contact = None
    if section.measured_with:
        contact = _permanent_contact(current, section, point, count, update)
        current, warnings = contact.scenario, warnings + contact.warnings
    nonlinear: NonlinearEstimate | None = None
    if section.nonlinear is not None:
        from beamsim.analyses.identify.nonlinear_fit import fit_nonlinear

        nonlinear = fit_nonlinear(current, section, measurements, progress, stop)
        warnings += nonlinear.warnings
    pad = None
    if section.pad is not None and section.pad.data is not None:
        from beamsim.analyses.identify.pad_fit import fit_pad

        pad = fit_pad(scenario, section.pad, section.pad.data)
        warnings += pad.warnings
    spent = clock.process_time() - processor
    estimate = None if contact is None else contact.estimate
    parts = [part.outcome for part in (estimate, nonlinear) if part is not None and not part.outcome.complete]
    result = IdentificationResult(
        scenario=scenario,
        outcome=together(parts),
        estimate=estimate,
        table_slope=None if contact is None else contact.resting,
        with_snubber=None if contact is None else contact.table,
        without_snubber=without,
        sensitivities=() if contact is None else contact.sensitivities,
        curves=() if contact is None else _curves(point, count, contact.estimate.stiffness),
        profile=None if contact is None else contact.profile,
        update=update,
        mac=mac,
        nonlinear=nonlinear,
        pad_modulus=_pad_modulus(section, estimate),
        pad=pad,
        warnings=tuple(warnings),
        processor_time_s=spent,
        wall_time_s=clock.perf_counter() - begin,
    )
    return result.with_summary(**_summary(result))


@dataclass(frozen=True)
class _Contact:
    """What frequencies with permanent contact say."""

    estimate: StiffnessEstimate
    table: FrequencyTable
    sensitivities: tuple[Sensitivity, ...]
    profile: ProfileLikelihood | None
    resting: TableSlope | None
    scenario: Scenario  # with the stiffness, or the scale of the table
    warnings: list[str]


def _permanent_contact(
    scenario: Scenario, section: IdentifyStiffness, point: SpringPoint, count: int, update: ModelUpdate | None
) -> _Contact:
    snubber = section.snubber
    rigid = int(np.sum(point.omega == 0))
    unconstrained = int(np.sum(point.pinned(rigid) == 0)) if rigid else 0  # rigid-body modes with the snubber closed
    resting = table_slope(scenario, snubber)
    measured = _measured(section, unconstrained)
    warnings = list(check_reach(point, measured, section.measured_without))
    measured, remarks = _widened(point, section, measured)
    warnings += remarks
    estimate = _estimate(point, section, measured)
    stiffness = estimate.stiffness
    known = {item.parameter: item.uncertainty for item in section.parameter_uncertainty}
    known |= {} if update is None else _updated(update)
    sensitive = sensitivities(scenario, point, snubber, measured, stiffness, known)
    estimate = replace(estimate, total_standard_deviation=_total(estimate, sensitive, update))
    table = frequency_table(point.frequencies(stiffness, count) / _HZ, section.measured_with, unconstrained)
    warnings += _fit_warnings(table, estimate)
    if resting is None:
        path = (*scenario.located_snubber(snubber).path, "stiffness")
        found = with_values(scenario, {path: stiffness})
    else:
        resting, remarks = compared(scenario, snubber, resting, stiffness)
        warnings += remarks
        found = with_factor(scenario, snubber, resting.factor)
    profile = stiffness_profile(point, measured, stiffness, estimate.standard_deviation)
    return _Contact(estimate, table, tuple(sensitive), profile, resting, found, warnings)


def _others(scenario: Scenario, snubber: str) -> Iterator[str]:
    """What is left out of the modes."""
    others = [s.name for s in scenario.all_snubbers if s.name != snubber]
    if others:
        yield f"the other snubbers ({', '.join(others)}) are assumed to be open"
    bodies = joined_to(scenario, scenario.located_snubber(snubber).bodies)
    if len(bodies) < len(scenario.all_bodies):
        yield (
            f"the natural frequencies are those of {' and '.join(bodies)}: the bodies that the snubber acts on, with "
            "those they are joined to"
        )


def _enough_modes(point: SpringPoint, section: IdentifyStiffness, rigid: int) -> None:
    """Refuse more measured frequencies than the model has modes."""
    size = point.omega.size - rigid
    for key in ("measured_without", "measured_with"):
        if len(getattr(section, key)) > size:
            raise ScenarioError(
                Problem(
                    f"identify_stiffness.{key}",
                    f"has {len(getattr(section, key))} frequencies, but the model has only {size} modes",
                    "increase the number of elements, or leave out the highest frequencies",
                )
            )


def _measured(section: IdentifyStiffness, unconstrained: int) -> MeasuredModes:
    return MeasuredModes(
        tuple(unconstrained + listed for listed in section.fit_to),
        _HZ * np.array([section.measured_with[listed - 1] for listed in section.fit_to]),
        np.array([section.uncertainty_of(listed) for listed in section.fit_to]),
        unconstrained,
    )


def _widened(
    point: SpringPoint, section: IdentifyStiffness, measured: MeasuredModes
) -> tuple[MeasuredModes, list[str]]:
    """The modes with uncertainties that explain what they contradict each other by, and a warning if these grow."""
    freedom = len(measured.mode) - 1
    if section.method == "thesis" or freedom < 1 or not measured.sigma.all():
        return measured, []
    largest = float(misfit(point, measured, np.array([fit_stiffness(point, measured)]))[0])
    wider = widening(largest, freedom)
    if wider == 1.0:
        return measured, []
    return replace(measured, sigma=np.sqrt(wider) * measured.sigma), [
        f"the fitted modes contradict each other by more than their uncertainty (misfit {largest:.3g} with {freedom} "
        f"degree{'s' if freedom > 1 else ''} of freedom): the intervals are widened accordingly; see what each mode "
        "alone gives, and check the model and the order of the modes"
    ]


def _estimate(point: SpringPoint, section: IdentifyStiffness, measured: MeasuredModes) -> StiffnessEstimate:
    outcome, solutions = COMPLETE, 1  # the modes of the structure without snubber
    if section.method == "thesis":
        loop = thesis_loop(
            point, measured.mode[0], float(measured.omega[0]), tolerance=section.tolerance,
            most_solutions=section.most_solutions, rigid=int(np.sum(point.omega == 0)),
        )  # fmt: skip
        k, outcome, solutions = loop.stiffness, loop.outcome, loop.solutions
    else:
        k = fit_stiffness(point, measured)
    single = individual_stiffness(point, measured)
    predicted = point.frequencies(k, max(measured.mode))[np.array(measured.mode) - 1]
    relative = (predicted - measured.omega) / measured.omega
    source = "given" if measured.sigma.all() else ""
    weighted = measured
    if not source and len(measured.mode) > 1:
        scatter = float(np.sqrt(np.sum(relative**2) / (len(measured.mode) - 1)))
        weighted = replace(measured, sigma=np.full(measured.omega.size, scatter))
        source = "scatter" if scatter > 0 else ""
    spread = spread_of(point, weighted, k, section.coverage)
    deviation, interval, unreachable = np.nan, (np.nan, np.nan), 0.0
    if source:
        deviation, interval, unreachable = monte_carlo(
            point, weighted, k, samples=section.monte_carlo.samples, coverage=section.coverage,
            generator=np.random.default_rng(section.monte_carlo.seed),
        )  # fmt: skip
    return StiffnessEstimate(
        snubber=section.snubber,
        method=section.method,
        stiffness=k,
        fit_to=measured.mode,
        individual=np.where((single > 0) & np.isfinite(single), single, np.nan),
        reach_hz=np.array([point.reach(mode) for mode in measured.mode]) / _HZ,
        condition=np.asarray(point.slope(predicted) * k / predicted),
        residual=float(np.sqrt(np.mean(relative**2))),
        standard_deviation=spread.standard_deviation,
        interval_first_order=spread.interval_first_order,
        interval=spread.interval,
        monte_carlo_standard_deviation=deviation,
        monte_carlo_interval=interval,
        monte_carlo_samples=section.monte_carlo.samples if source else 0,
        monte_carlo_unreachable=unreachable,
        coverage=section.coverage,
        total_standard_deviation=spread.standard_deviation,
        uncertainty_from=source,
        eigenvalue_solutions=solutions,
        outcome=outcome,
    )


def _updated(update: ModelUpdate) -> dict[str, float]:
    """Relative standard deviations of the parameters fitted in the update."""
    return {p.parameter: p.standard_deviation / p.value for p in update.parameters if np.isfinite(p.standard_deviation)}


def _total(estimate: StiffnessEstimate, sensitive: list[Sensitivity], update: ModelUpdate | None) -> float:
    """Standard deviation including the contributions of all parameters with known uncertainty.

    Parameters fitted together are correlated; the others are treated as independent.
    """
    fitted = {} if update is None else _updated(update)
    parts = {s.parameter: s.relative * s.uncertainty for s in sensitive if np.isfinite(s.contribution)}
    deviation = estimate.standard_deviation
    if not parts:
        return deviation
    variance = sum(part**2 for name, part in parts.items() if name not in fitted)
    if update is not None:
        names = [p.parameter for p in update.parameters]
        vector = np.array([parts.get(name, 0.0) for name in names])
        variance += float(vector @ np.nan_to_num(update.correlation) @ vector)
    return float(np.hypot(0.0 if np.isnan(deviation) else deviation, estimate.stiffness * np.sqrt(variance)))


def _curves(point: SpringPoint, count: int, stiffness: float) -> tuple[FrequencyCurve, ...]:
    """Frequency against stiffness around the identified value, in closed form on the frequencies within reach."""
    k = stiffness if 0 < stiffness < np.inf else 1.0
    share = 1 / (1 + np.exp(-np.linspace(-14, 14, 240)))
    curves = []
    for mode in range(1, min(count, point.omega.size) + 1):
        low, high = point.reach(mode)
        omega = low + (min(high, 1e3 * low + 1e3) - low) * share
        value = point.stiffness(omega)
        kept = (value > _NARROWEST * k) & (value < k / _NARROWEST)
        curves.append(FrequencyCurve(mode, value[kept], omega[kept] / _HZ))
    return tuple(curves)


def _mac(scenario: Scenario, section: IdentifyStiffness, warnings: list[str]) -> Floats | None:
    given = section.shapes_without
    if given is None:
        return None
    _, predicted = mode_shapes(scenario, section.snubber, max(len(given.shapes), _MIN_MODES), given.positions)
    mac = assurance(np.array(given.shapes).T, predicted.T)
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
    if not known.any() or np.max(np.abs(off[known])) <= _POOR_MODEL:
        return []
    worst = int(np.nanargmax(np.abs(off)))
    return [
        f"without the snubber the model's mode {worst + 1} differs by {off[worst]:+.1f} % from the measured frequency: "
        "correct the parameters of the structure first (identify_stiffness.update fits them)"
    ]


def _fit_warnings(table: FrequencyTable, estimate: StiffnessEstimate) -> list[str]:
    warnings = []
    off = table.difference_percent
    for i, mode in enumerate(table.mode):
        if np.isfinite(off[i]) and mode not in estimate.fit_to and abs(off[i]) > _POOR_MODEL:
            warnings.append(f"with this stiffness mode {mode}, which was not fitted, is off by {off[i]:+.1f} %")
    low, high = estimate.interval
    if low == 0.0 or np.isinf(high):
        warnings.append(
            "the uncertainty of the frequency extends to "
            + ("the frequency without snubber" if low == 0.0 else "the frequency with the point pinned")
            + ": the stiffness has no "
            + ("lower" if low == 0.0 else "upper")
            + " bound; use a mode whose frequency depends more on the snubber"
        )
    return warnings


def _pad_modulus(section: IdentifyStiffness, estimate: StiffnessEstimate | None) -> float:
    """E_r = k h / b, Pa (thesis, section 1.3.3)."""
    if section.pad is None or estimate is None or section.pad.height is None or section.pad.area is None:
        return float("nan")
    return estimate.stiffness * section.pad.height / section.pad.area


def _summary(result: IdentificationResult) -> dict[str, Any]:
    """What does not repeat a field of the result."""
    summary: dict[str, Any] = {}
    if result.estimate is not None:
        summary["pad_youngs_modulus_pa"] = result.pad_modulus
        summary["sensitivities"] = {s.parameter: s.relative for s in result.sensitivities}
    if result.pad is not None:
        summary["pad_yaml"] = result.pad.yaml
    update, nonlinear = result.update, result.nonlinear
    if update is not None:
        summary["updated"] = {p.parameter: _plain(p) for p in update.parameters} | dict(update.choices)
        summary["update_misfit"] = [update.misfit_before, update.misfit_after]
    if nonlinear is not None:
        summary["estimated"] = {p.parameter: _plain(p) for p in nonlinear.parameters}
        summary["nonlinear_misfit"] = [nonlinear.misfit_before, nonlinear.misfit]
        summary["starts_agreeing"] = [nonlinear.starts_agreeing, nonlinear.starts]
    return summary


def _plain(p: ParameterEstimate) -> dict[str, Any]:
    return {
        "value": p.value,
        "before": p.before,
        "standard_deviation": p.standard_deviation,
        "interval": list(p.interval),
    }
