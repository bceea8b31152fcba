r"""Snubber stiffness from natural frequencies with permanent contact.

One mode: the secular equation solved for k gives it in closed form (`beamsim.structures.secular`). Several modes: the
k that minimises :math:`\sum_j ((f_j(k) - m_j) / \sigma_j)^2`, bracketed by the stiffnesses of the single modes
because every f_j increases with k. Algorithm 1 of the thesis (Hazim 2010) is kept for comparison.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.identify.fit import widening
from beamsim.analyses.identify.layouts import CURVES, ENDS, SENSITIVITIES, STIFFNESS, WITH
from beamsim.analyses.identify.result import ComparedModes, Findings, ProfileLikelihood
from beamsim.contacts.pads import ForceCurve
from beamsim.errors import Problem, ScenarioError
from beamsim.labelled import Dataset
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, path_text
from beamsim.scenario.identification import IdentifyStiffness, Pad
from beamsim.scenario.parameters import find_parameters, unit_at, value_at, with_values
from beamsim.structures.assembly import assemble, snubber_site
from beamsim.structures.modes import DENSE_LIMIT, closed_modes
from beamsim.structures.reduction import reduce_model
from beamsim.structures.secular import SpringPoint, stiffness_sensitivities
from beamsim.structures.structure import LoadPattern
from beamsim.system.build import build_system
from beamsim.system.force_tables import curves_of
from beamsim.typing import Floats, not_none

_HZ = 2 * np.pi
_NARROWEST = 1e-3  # the curves extend by this factor on either side of the identified stiffness
POOR_MODEL = 3.0  # percent; a larger frequency error without snubber gives a warning
AT_END = 1.01  # ratio to the end of a range within which a stiffness counts as at that end
Interval = tuple[float, float]
_UNKNOWN = (np.nan, np.nan)
_PATH = "identify_stiffness.measured_with"
_WIDEST = 1e9  # search range: this factor on either side of the inverse compliance of the structure


@dataclass(frozen=True)
class FittedModes:
    """Modes with measured frequencies, for a structure with a spring at the snubber."""

    point: SpringPoint  # modes without the spring
    mode: tuple[int, ...]  # numbers from 1, including rigid-body modes
    omega: Floats  # (m,) measured, rad/s
    sigma: Floats  # (m,) relative standard deviations; all zero if unknown
    rigid_modes: int = 0  # rigid-body modes with the snubber closed, below the first measured frequency

    @property
    def weight(self) -> Floats:
        """(m,) inverse of the absolute standard deviation, s/rad (equal relative weights if it is unknown)."""
        sigma = self.sigma if self.sigma.all() else np.ones(self.omega.size)
        return np.asarray(1.0 / (sigma * self.omega))

    def predicted_frequencies(self, stiffness: float | Floats) -> Floats:
        """(..., m) frequencies of these modes, rad/s, with springs of the given stiffnesses, N/m."""
        return np.asarray(self.point.frequencies(stiffness, max(self.mode))[..., np.array(self.mode) - 1])

    def misfit(self, stiffness: float | Floats) -> Floats:
        """(...) weighted sum of squares, chi squared, for the given stiffnesses, N/m."""
        return np.asarray(np.sum(((self.predicted_frequencies(stiffness) - self.omega) * self.weight) ** 2, axis=-1))

    def slope(self, stiffness: float) -> Floats:
        """(m,) d omega / dk over the standard deviation, m/N."""
        return np.asarray(self.point.slope(self.predicted_frequencies(stiffness)) * self.weight)

    def stiffness_at(self, number: int, omega: Floats) -> Floats:
        """Stiffnesses, N/m, that give one mode (index from 0) the angular frequencies ``omega`` of any shape.

        0 below the range of the mode, infinite above it.
        """
        low, high = self.point.reach(self.mode[number])
        inside = (omega > low) & (omega < high)
        k = self.point.stiffness(np.where(inside, omega, 0.5 * (low + min(high, 2 * low + 1.0))))
        return np.asarray(np.where(inside, k, np.where(omega <= low, 0.0, np.inf)))

    @cached_property
    def individual(self) -> Floats:
        """(m,) stiffness from each mode alone, N/m; see `stiffness_at`."""
        return np.array([float(self.stiffness_at(number, omega)) for number, omega in enumerate(self.omega)])

    @cached_property
    def range(self) -> Interval:
        """Stiffness range, N/m: below it a spring has no effect, above it it acts as a rigid stop."""
        unit = 1.0 / float(np.sum(self.point.shape**2 / np.maximum(self.point.omega, self.omega[0]) ** 2))
        return unit / _WIDEST, unit * _WIDEST

    def intervals(self, coverage: float) -> Floats:
        """(m, 2) confidence intervals of the stiffness from each mode alone, N/m.

        They follow from the interval of the frequency; 0 or infinite beyond its range, nan if no uncertainty is known.
        """
        ends = NormalDist().inv_cdf(0.5 + coverage / 2) * np.array([-1.0, 1.0])
        both = [
            self.stiffness_at(k, w * (1.0 + s * ends))
            for k, (w, s) in enumerate(zip(self.omega, self.sigma, strict=True))
        ]
        return np.array(both) if self.sigma.all() else np.full((self.omega.size, 2), np.nan)


def fit_stiffness(modes: FittedModes) -> float:
    """Stiffness, N/m, with the best fit to the measured frequencies; 0 or infinite if no stiffness reaches them."""
    low, high = float(modes.individual.min()), float(modes.individual.max())
    return low if low == high else _fit_between(modes, low, high)


BRACKET_MARGIN = 1e-6  # relative; keeps a minimum at a bound (other modes have a node at the spring) inside the bracket


def _fit_between(modes: FittedModes, low: float, high: float) -> float:
    """Fit several modes that alone give stiffnesses between ``low`` and ``high``, N/m."""
    # a mode out of reach gives no bound: search as far as the compliance of the structure matters
    lowest, highest = modes.range
    low, high = max(low * (1 - BRACKET_MARGIN), lowest), min(high * (1 + BRACKET_MARGIN), highest)
    if low >= high:
        return low
    from scipy.optimize import least_squares

    x = np.linspace(np.log(low), np.log(high), 241)
    start = x[1:-1][np.argmin(modes.misfit(np.exp(x[1:-1])))]

    def residuals(y: Floats) -> Floats:
        return np.asarray((modes.predicted_frequencies(float(np.exp(y[0]))) - modes.omega) * modes.weight)

    def slopes(y: Floats) -> Floats:
        k = float(np.exp(y[0]))
        return (modes.slope(k) * k)[:, None]

    found = least_squares(residuals, [start], jac=slopes, bounds=(x[0], x[-1]), xtol=1e-15, ftol=None, gtol=None)
    return float(np.exp(found.x[0]))


def _check_reach(modes: FittedModes, without_hz: tuple[float, ...] = ()) -> tuple[str, ...]:
    """Refuse frequencies that no stiffness reaches; with several modes, only warn if at least one is reachable.

    Raises
    ------
    ScenarioError
        With the reachable range, the likely mistake, and a remedy.
    """
    problems: list[Problem] = []
    for mode, omega in zip(modes.mode, modes.omega.tolist(), strict=True):
        at = f"{_PATH}[{mode - 1 - modes.rigid_modes}]"
        if mode > modes.point.omega.size:
            message = f"is mode {mode}, but the model has only {modes.point.omega.size} modes"
            problems.append(Problem(at, message, "leave it out of fit_to"))
            continue
        low, high = modes.point.reach(mode)
        fixed = modes.point.on_node(mode) or (np.isfinite(high) and high - low <= 1e-9 * high)
        if fixed or not low < omega < high:
            problems.append(Problem(at, *_out_of_reach(modes.point, mode, omega, without_hz, fixed=fixed)))
    if problems and (len(problems) == len(modes.mode) or any("node" in p.message for p in problems)):
        raise ScenarioError(problems)
    return tuple(f"{problem}" for problem in problems)


def _out_of_reach(
    point: SpringPoint, mode: int, omega: float, without_hz: tuple[float, ...], *, fixed: bool
) -> tuple[str, str]:
    """Message and remedy for a frequency out of reach (``fixed``: independent of the stiffness)."""
    low, high = point.reach(mode)
    if fixed:
        return (
            f"= {omega / _HZ:.6g} Hz does not depend on the snubber: it is at a node of mode {mode}, where the "
            f"structure does not move, so that the frequency is {low / _HZ:.6g} Hz for every stiffness",
            f"leave mode {mode} out of fit_to and use one with motion at the snubber",
        )
    limit = (
        f"not above the frequency without the snubber, {low / _HZ:.6g} Hz"
        if omega <= low
        else f"not below the frequency with the point pinned, {high / _HZ:.6g} Hz"
    )
    reach = "upwards without bound" if np.isinf(high) else f"to {high / _HZ:.6g} Hz"
    return (
        f"= {omega / _HZ:.6g} Hz is {limit}: a spring there can shift mode {mode} from {low / _HZ:.6g} Hz {reach}",
        _remedy(point, mode, omega, without_hz),
    )


def _remedy(point: SpringPoint, mode: int, omega: float, without_hz: tuple[float, ...]) -> str:
    """Remedy for the most likely mistake behind a frequency out of reach."""
    low, high = point.reach(mode)
    if mode <= len(without_hz) and omega <= low < _HZ * without_hz[mode - 1] < high:
        return "were measured_with and measured_without swapped?"
    hints = []
    number = point.mode_number(omega)  # mode that could have this frequency
    other = number not in (0, mode) and number <= point.omega.size
    if other and point.reach(number)[0] < omega < point.reach(number)[1]:
        hints.append(f"it fits mode {number}: list the frequencies starting with the first mode")
    for factor, unit in ((1 / _HZ, "rad/s"), (1000.0, "kHz"), (1 / 60, "1/min")):
        if low < omega * factor < high:
            hints.append(f"was the unit forgotten? write {omega / _HZ:g} {unit} if that was meant")
            break
    if hints:
        return "; or ".join(hints)
    return (
        "check the measurement, the parameters of the structure (measured_without compares them, update: fits them) "
        "and the units of its dimensions"
    )


FIRST_STIFFNESS = 0.01  # N/m; thesis, algorithm 1


STEP_OF_STIFFNESS = 1.01  # thesis, algorithm 1


def thesis_loop(modes: FittedModes, tolerance: float, most_solutions: int) -> tuple[float, Outcome, int]:
    """Algorithm 1 of the thesis: increase k by 1 % from 0.01 N/m until the frequency agrees within a tolerance.

    Every step solves the whole eigenvalue problem. A step can jump over a narrow tolerance. The frequency
    never decreases with k, so the loop then stops with that outcome instead of running forever.

    Parameters
    ----------
    modes : the modes; the first one is fitted.
    tolerance : relative difference in frequency at which the loop ends.
    most_solutions : largest number of eigenvalue solutions.

    Returns
    -------
    stiffness of the last step, N/m, how the loop ended, and the number of eigenvalue solutions.
    """
    point, omega, rigid = modes.point, float(modes.omega[0]), int(np.sum(modes.point.omega == 0))
    k, previous = FIRST_STIFFNESS, np.nan
    for count in range(1, most_solutions + 1):
        closed, _ = closed_modes(point.omega, point.shape[None, :], np.array([k]), rigid)
        predicted = float(closed[modes.mode[0] - 1])
        if abs(predicted - omega) <= tolerance * omega:
            return k, COMPLETE, count
        if predicted > omega:
            outcome = Outcome.of(
                OutcomeKind.STOPPED, "stepped_over",
                f"a 1 % step from {previous:.6g} to {k:.6g} N/m stepped over the frequency tolerance of "
                f"{100 * tolerance:g} %",
                remedy="widen identify_stiffness.tolerance, or use method: secular",
            )  # fmt: skip
            return k, outcome, count
        previous = k
        k *= STEP_OF_STIFFNESS
    outcome = Outcome.of(
        OutcomeKind.STOPPED, "solution_limit", f"not converged after {most_solutions} eigenvalue solutions",
        remedy="raise identify_stiffness.most_solutions, or use method: secular",
    )  # fmt: skip
    return previous, outcome, most_solutions


def spread_of(modes: FittedModes, stiffness: float, coverage: float) -> tuple[float, Interval, Interval]:
    """First-order standard deviation and interval, and the asymmetric interval.

    Parameters
    ----------
    modes : the fitted modes.
    stiffness : the identified value, N/m.
    coverage : probability of the intervals.

    Returns
    -------
    float, two pairs of floats
        N/m; nan if the measurement has no uncertainties.
    """
    if not modes.sigma.all():
        return np.nan, _UNKNOWN, _UNKNOWN
    deviation = float(1.0 / np.sqrt(np.sum(modes.slope(stiffness) ** 2)))
    z = NormalDist().inv_cdf(0.5 + coverage / 2)
    first = (stiffness - z * deviation, stiffness + z * deviation)
    if len(modes.mode) == 1:
        low, high = modes.stiffness_at(0, modes.omega[0] * (1 + np.array([-z, z]) * modes.sigma[0])).tolist()
        return deviation, first, (low, high)
    return deviation, first, _profile_interval(modes, stiffness, deviation / stiffness, z)


def _profile_interval(modes: FittedModes, stiffness: float, relative: float, z: float) -> Interval:
    """Interval in which chi squared stays within z^2 of its minimum."""
    from scipy.optimize import brentq

    least = float(modes.misfit(stiffness))

    def excess(log_k: float) -> float:
        return float(modes.misfit(np.exp(log_k))) - least - z * z

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
    modes: FittedModes, stiffness: float, relative: float, samples: int, coverage: float, generator: np.random.Generator
) -> tuple[float, Interval, float]:
    """Standard deviation, interval and share of unreachable samples for normally distributed frequencies.

    Every sample is identified separately: in closed form from one mode; from several by the smallest misfit in a table
    and a parabola through its three lowest points. Samples that no stiffness explains count as 0 or infinity in the
    interval and are excluded from the standard deviation.

    Parameters
    ----------
    modes : the fitted modes with their standard deviations.
    stiffness : the identified value, N/m.
    relative : its first-order standard deviation over the value.
    samples : number of samples.
    coverage : probability of the interval.
    generator : source of the random numbers.

    Returns
    -------
    float, pair of floats, float
        Standard deviation, N/m, nan for fewer than two usable samples; interval, N/m; share from 0 to 1.
    """
    omega = modes.omega * (1 + modes.sigma * generator.standard_normal((samples, modes.omega.size)))
    k = (
        modes.stiffness_at(0, omega[:, 0])
        if len(modes.mode) == 1
        else _least_on_table(modes, stiffness, relative, omega)
    )
    usable = np.isfinite(k) & (k > 0)
    low, high = np.quantile(k, [0.5 - coverage / 2, 0.5 + coverage / 2], method="nearest")
    deviation = float(np.std(k[usable], ddof=1)) if usable.sum() > 1 else np.nan
    return deviation, (float(low), float(high)), float(1 - usable.mean())


HALF_WIDTH = 8.0  # of the table of a Monte Carlo simulation, in standard deviations of ln k


STIFFNESSES = 1201  # of that table


def _least_on_table(modes: FittedModes, stiffness: float, relative: float, omega: Floats) -> Floats:
    width = min(HALF_WIDTH * relative, 20.0)
    x = np.log(stiffness) + np.linspace(-width, width, STIFFNESSES)
    table = modes.predicted_frequencies(np.exp(x))
    # chi squared up to a constant per sample: (t, m) products instead of a (samples, t, m) array.
    w2 = modes.weight**2
    value = np.sum(table**2 * w2, axis=1)[None, :] - 2 * (omega * w2) @ table.T
    best = np.argmin(value, axis=1)
    inner = np.clip(best, 1, x.size - 2)
    row = np.arange(omega.shape[0])
    a, b, c = (value[row, inner + d] for d in (-1, 0, 1))
    curvature = a - 2 * b + c
    offset = np.where(curvature > 0, 0.5 * (a - c) / np.where(curvature > 0, curvature, 1.0), 0.0)
    k = np.exp(x[inner] + np.clip(offset, -1, 1) * (x[1] - x[0]))
    return np.asarray(np.where(best == 0, 0.0, np.where(best == x.size - 1, np.inf, k)))


def stiffness_profile(modes: FittedModes, stiffness: float, deviation: float) -> list[ProfileLikelihood]:
    """Chi squared above its minimum as a function of the stiffness.

    Parameters
    ----------
    modes : the fitted modes.
    stiffness, deviation : the identified value and its standard deviation, N/m.

    Returns
    -------
    list of ProfileLikelihood
        One profile; empty without uncertainties, and for a stiffness that is 0 or infinite.
    """
    if not np.isfinite(deviation) or not 0 < stiffness < np.inf:
        return []
    width = min(4 * deviation / stiffness, 5.0)
    k = stiffness * np.exp(np.linspace(-width, width, 81))
    return [ProfileLikelihood("stiffness", k, np.maximum(modes.misfit(k) - modes.misfit(stiffness), 0.0))]


class Sensitivity(NamedTuple):
    """Dependence of the identified stiffness on one number of the structure."""

    parameter: str
    unit: str
    value: float
    relative: float  # d ln k / d ln p
    uncertainty: float  # relative standard deviation of the parameter; nan if it is not known

    @property
    def contribution(self) -> float:
        """Relative standard deviation of k due to this parameter; nan if it is not known."""
        return abs(self.relative) * self.uncertainty


def sensitivities(
    scenario: Scenario, modes: FittedModes, snubber: str, stiffness: float, relative_deviations: dict[str, float]
) -> list[Sensitivity]:
    """Logarithmic derivatives d ln k / d ln p at fixed frequencies for every number of the structure.

    One mode: exact for the finite-element model. Several: to first order in the misfit. A path with ``[*]`` is a common
    factor.

    Parameters
    ----------
    scenario : scenario with the snubber.
    modes : the fitted modes.
    snubber : name of the snubber.
    stiffness : the identified value, N/m.
    relative_deviations : relative standard deviations of parameters, by path.

    Returns
    -------
    list of Sensitivity
        Largest first; empty for a stiffness that is 0 or infinite.
    """
    if not 0 < stiffness < np.inf:
        return []
    share = modes.slope(stiffness) ** 2
    share /= share.sum()
    each = [
        stiffness_sensitivities(scenario, snubber, float(omega)) for omega in modes.predicted_frequencies(stiffness)
    ]
    relative = {
        place: float(sum(w * part.get(place, 0.0) for w, part in zip(share, each, strict=True)))
        for place in dict.fromkeys(place for part in each for place in part)
    }
    rows = {path_text(place): [place] for place in relative}
    given = {}
    for path, uncertainty in relative_deviations.items():
        places = find_parameters(scenario, path)
        name = path_text(places[0]) if len(places) == 1 else path
        rows[name], given[name] = places, uncertainty
    result = [
        Sensitivity(
            name,
            unit_at(scenario, places[0]),
            float(value_at(scenario, places[0])),
            sum(relative.get(place, 0.0) for place in places),
            given.get(name, np.nan),
        )
        for name, places in rows.items()
    ]
    return sorted(result, key=lambda s: -abs(s.relative))


def permanent_contact(
    scenario: Scenario, section: IdentifyStiffness, point: SpringPoint, count: int, update: Dataset | None
) -> tuple[Findings, dict[Path, object]]:
    """Identify the stiffness from frequencies with permanent contact.

    Parameters
    ----------
    scenario : scenario after the update of its structure.
    section : section with the measured frequencies.
    point : modes at the snubber, contacts open.
    count : number of modes in the tables.
    update : dataset of the update, for the uncertainties of its parameters; None without one.

    Returns
    -------
    Findings, and by path the values of the scenario to replace: the stiffness, or the scale of the table.
    """
    snubber = section.snubber
    located = scenario.located_snubber(snubber)
    on_table = None if located.item.force_deflection is None else _rest_on_table(scenario, snubber)
    measured = _measured_modes(section, point)
    warnings = list(_check_reach(measured, section.measured_without))
    if len(measured.mode) > 1 and section.method != "thesis" and measured.sigma.all():
        measured, remarks = _widen(measured)
        warnings += remarks
    outcome, source, values = _estimate(section, measured)
    stiffness, deviation = values["stiffness"], values["standard_deviation"]
    known = {item.parameter: item.uncertainty for item in section.parameter_uncertainty}
    sensitive = sensitivities(scenario, measured, snubber, stiffness, known | _relative_deviations(update))
    values["total_standard_deviation"] = _total(deviation, stiffness, sensitive, update)
    modes = ComparedModes.of(point.frequencies(stiffness, count) / _HZ, section.measured_with, measured.rigid_modes)
    warnings += _fit_warnings(modes, measured.mode, values["interval"])
    found: dict[Path, object] = {(*located.path, "stiffness"): stiffness}
    if on_table is not None:
        of_table, found, remarks = _table_slope(scenario, snubber, *on_table, stiffness)
        values |= of_table
        warnings += remarks
    datasets = [STIFFNESS.dataset(values), _curves(point, count, stiffness)]
    if sensitive:
        names = [each.parameter for each in sensitive]
        datasets.append(SENSITIVITIES.table(sensitive, [{"unit": each.unit} for each in sensitive], parameter=names))
    contributions = {each.parameter: each.contribution for each in sensitive if np.isfinite(each.contribution)}
    summary = {
        "snubber": snubber,
        "method": section.method,
        "uncertainty_from": source,
        "sensitivities": {each.parameter: each.relative for each in sensitive},
        "sensitivity_contributions": contributions or None,
        **_pad_modulus(section.pad, stiffness, values["interval"]),
    }
    profiles = stiffness_profile(measured, stiffness, deviation)
    return Findings(datasets, summary, warnings, profiles, {WITH: modes}, outcome), found


def _measured_modes(section: IdentifyStiffness, point: SpringPoint) -> FittedModes:
    """Modes to fit; rigid-body modes with the snubber closed are below the first measured one."""
    rigid = int(np.sum(point.omega == 0))
    unconstrained = int(np.sum(point.frequencies(np.inf, rigid) == 0)) if rigid else 0
    return FittedModes(
        point,
        tuple(unconstrained + listed for listed in section.fit_to),
        _HZ * np.array([section.measured_with[listed - 1] for listed in section.fit_to]),
        np.array([section.uncertainty_of(listed) for listed in section.fit_to]),
        unconstrained,
    )


def _relative_deviations(update: Dataset | None) -> dict[str, float]:
    """Relative standard deviations of the updated parameters, by path, where they are known."""
    if update is None or not update.labels("parameter"):
        return {}
    relative = (update["standard_deviation"].values / update["value"].values).tolist()
    named = zip(update.labels("parameter"), relative, strict=True)
    return {name: deviation for name, deviation in named if np.isfinite(deviation)}


def _pad_modulus(pad: Pad | None, stiffness: float, interval: Interval) -> dict[str, Any]:
    """Young's modulus E_r = k h / b, Pa (thesis, section 1.3.3), and its interval; nan for a pad without dimensions."""
    modulus = np.nan
    if pad is not None and pad.height is not None and pad.area is not None:
        modulus = stiffness * pad.height / pad.area
    per_stiffness = modulus / stiffness
    interval_pa = [per_stiffness * end for end in interval]
    return {"pad_youngs_modulus_pa": modulus, "pad_youngs_modulus_interval_pa": interval_pa}


def _widen(measured: FittedModes) -> tuple[FittedModes, list[str]]:
    """Increase the uncertainties until they explain the contradiction between modes; warn if they grow."""
    freedom = len(measured.mode) - 1
    largest = float(measured.misfit(fit_stiffness(measured)))
    wider = widening(largest, freedom)
    if wider == 1.0:
        return measured, []
    return replace(measured, sigma=np.sqrt(wider) * measured.sigma), [
        f"the fitted modes contradict each other by more than their uncertainty (misfit {largest:.3g} with {freedom} "
        f"degree{'s' if freedom > 1 else ''} of freedom): the intervals are widened accordingly; see what each mode "
        "alone gives, and check the model and the order of the modes"
    ]


def _estimate(section: IdentifyStiffness, measured: FittedModes) -> tuple[Outcome, str, dict[str, Any]]:
    """Outcome of the search, source of the uncertainty, and the variables of `STIFFNESS`."""
    point, single = measured.point, measured.individual
    outcome, solutions = COMPLETE, 1  # the eigenvalue problem without the snubber
    if section.method == "thesis":
        k, outcome, solutions = thesis_loop(measured, section.tolerance, section.most_solutions)
    else:
        k = fit_stiffness(measured)
        outcome = _at_end_of_range(measured, k)
    predicted = measured.predicted_frequencies(k)
    relative = (predicted - measured.omega) / measured.omega
    source = "given" if measured.sigma.all() else ""
    weighted = measured
    if not source and len(measured.mode) > 1:
        scatter = float(np.sqrt(np.sum(relative**2) / (len(measured.mode) - 1)))
        weighted = replace(measured, sigma=np.full(measured.omega.size, scatter))
        source = "scatter" if scatter > 0 else ""
    if not outcome.trusted:  # no confidence interval at the end of the range
        source = ""
        weighted = replace(measured, sigma=np.zeros(measured.omega.size))
    first_order, first_order_interval, interval = spread_of(weighted, k, section.coverage)
    deviation, sampled, unreachable = np.nan, _UNKNOWN, 0.0
    if source:
        deviation, sampled, unreachable = monte_carlo(
            weighted, k, first_order / k, section.monte_carlo.samples, section.coverage,
            np.random.default_rng(section.monte_carlo.seed),
        )  # fmt: skip
    values = {
        "mode": measured.mode,
        "end": ENDS,
        "stiffness": k,
        "individual": np.where((single > 0) & np.isfinite(single), single, np.nan),
        "individual_interval": weighted.intervals(section.coverage),
        "reach_hz": np.array([point.reach(mode) for mode in measured.mode]) / _HZ,
        "condition": np.asarray(point.slope(predicted) * k / predicted),
        "residual": float(np.sqrt(np.mean(relative**2))),
        "standard_deviation": first_order,
        "interval_first_order": first_order_interval,
        "interval": interval,
        "monte_carlo_standard_deviation": deviation,
        "monte_carlo_interval": sampled,
        "monte_carlo_samples": section.monte_carlo.samples if source else 0,
        "monte_carlo_unreachable": unreachable,
        "coverage": section.coverage,
        "eigenvalue_solutions": solutions,
    }
    return outcome, source, values


def _at_end_of_range(modes: FittedModes, stiffness: float) -> Outcome:
    """Outcome if contradicting modes are fitted best by no spring or by a rigid stop."""
    low, high = modes.range
    if low * AT_END < stiffness < high / AT_END:
        return COMPLETE
    none = stiffness <= low * AT_END
    return Outcome.of(
        OutcomeKind.UNTRUSTED, "at_bound",
        f"the stiffness ended at the end of its range, {stiffness:.4g} N/m: "
        f"{'no spring' if none else 'a rigid stop'} fits these frequencies best",
        remedy="check the order of the modes and the model, or leave out the modes that contradict the others (fit_to)",
        stiffness=stiffness,
    )  # fmt: skip


def _total(deviation: float, stiffness: float, sensitive: list[Sensitivity], update: Dataset | None) -> float:
    """Standard deviation with the contributions of all parameters of known uncertainty.

    Parameters fitted together are correlated; the others are treated as independent.
    """
    parts = {s.parameter: s.relative * s.uncertainty for s in sensitive if np.isfinite(s.contribution)}
    if not parts:
        return deviation
    fitted = _relative_deviations(update)
    variance = sum(part**2 for name, part in parts.items() if name not in fitted)
    if update is not None and fitted:
        vector = np.array([parts.get(name, 0.0) for name in update.labels("parameter")])
        variance += float(vector @ np.nan_to_num(update["correlation"].values) @ vector)
    return float(np.hypot(0.0 if np.isnan(deviation) else deviation, stiffness * np.sqrt(variance)))


def _curves(point: SpringPoint, count: int, stiffness: float) -> Dataset:
    """Frequency as a function of stiffness around the identified value, in closed form."""
    k = stiffness if 0 < stiffness < np.inf else 1.0
    share = 1 / (1 + np.exp(-np.linspace(-14, 14, 240)))
    modes, values, frequencies = range(1, min(count, point.omega.size) + 1), [], []
    for mode in modes:
        low, high = point.reach(mode)
        omega = low + (min(high, 1e3 * low + 1e3) - low) * share
        value = point.stiffness(omega)
        kept = (value > _NARROWEST * k) & (value < k / _NARROWEST)
        values.append(value[kept])
        frequencies.append(omega[kept] / _HZ)
    owners = np.repeat(np.arange(len(modes)), [each.size for each in values])
    columns = {"stiffness": np.concatenate(values), "frequency_hz": np.concatenate(frequencies)}
    return CURVES.dataset({"mode": modes, "point": 1 + np.arange(owners.size), "point_mode": owners, **columns})


def _fit_warnings(modes: ComparedModes, fitted: tuple[int, ...], interval: Interval) -> list[str]:
    warnings = []
    off = modes.difference_percent
    for i, mode in enumerate(modes.mode):
        if np.isfinite(off[i]) and mode not in fitted and abs(off[i]) > POOR_MODEL:
            warnings.append(f"with this stiffness mode {mode}, which was not fitted, is off by {off[i]:+.1f} %")
    low, high = interval
    if low == 0.0:
        warnings.append(_bound_warning("the frequency without snubber", "lower"))
    elif np.isinf(high):
        warnings.append(_bound_warning("the frequency with the point pinned", "upper"))
    return warnings


def _bound_warning(limit: str, side: str) -> str:
    """Warn that the uncertainty of the frequency includes one that no finite stiffness gives."""
    return (
        f"the uncertainty of the frequency extends to {limit}: the stiffness has no {side} bound; use a mode whose "
        "frequency depends more on the snubber"
    )


def _rest_on_table(scenario: Scenario, snubber: str) -> tuple[ForceCurve, float, int]:
    """Force-deflection table of a snubber, its force at static equilibrium, N, and its segment there, from 1.

    Raises
    ------
    ScenarioError
        If the snubber is open at rest: its slope there is not that of a permanent contact.
    """
    index = [item.name for _, _, item, _ in scenario.located_snubbers].index(snubber)
    curve = not_none(curves_of(scenario)[index])
    force = build_system(scenario).snubbers[index].preload
    if not force > 0.0:
        raise ScenarioError.at(
            "identify_stiffness.measured_with",
            f"gives the slope of the table of {snubber} where it rests, but the snubber is open at rest",
            f"give {path_text(scenario.located_snubber(snubber).path)} the preload of the test, or measure "
            "vibrations (nonlinear)",
        )
    return curve, force, int(np.searchsorted(curve.force[:-1], force, side="left"))


def _table_slope(
    scenario: Scenario, snubber: str, curve: ForceCurve, force: float, segment: int, stiffness: float
) -> tuple[dict[str, Any], dict[Path, object], list[str]]:
    """Compare the slope of a table at rest with the identified stiffness.

    Returns the values of the summary, the replacement table by path, and warnings.
    """
    slope = float(curve.slopes[segment - 1])
    deflection = float(curve.deflection[segment - 1] + (force - curve.force[segment - 1]) / slope)
    at_a_bend = bool(np.any(np.abs(curve.deflection[1:-1] - deflection) < 1e-3 * deflection))
    factor, warnings = stiffness / slope, []
    if at_a_bend:
        warnings.append(
            f"{snubber} rests at a bend of its table, {1e3 * deflection:.4g} mm: its slope is that of the segment "
            "below, but a vibration uses both"
        )
    path, _, item, _ = scenario.located_snubber(snubber)
    table = not_none(item.table)
    table = table.model_copy(update={"scale": factor * table.scale})
    found: dict[Path, object] = {(*path, "force_deflection"): table}
    if 0.0 < stiffness < np.inf and _rest_on_table(with_values(scenario, found), snubber)[2] != segment:
        warnings.append(
            f"with all forces of the table multiplied by {factor:.4g} {snubber} would rest on another segment: the "
            "identified stiffness is not that of a table of this shape"
        )
    values = {
        "table_force": force,
        "table_deflection": deflection,
        "table_segment": segment,
        "table_segments": curve.slopes.size,
        "table_slope": slope,
        "table_factor": factor,
        "table_at_a_bend": at_a_bend,
    }
    return values, found, warnings


MORE_MODES = 60  # modes of a large model beyond those requested; a static vector represents the others


def snubber_point(scenario: Scenario, name: str, requested: int = 1) -> SpringPoint:
    """Modes of the bodies that a snubber acts on, with every contact open.

    A model with more degrees of freedom than `DENSE_LIMIT` gives `requested` + 60 modes and the static vector of the
    snubber, which represents the static compliance of the other modes. Smaller models give all modes.

    Parameters
    ----------
    scenario : scenario with the snubber.
    name : name of the snubber.
    requested : number of modes needed.

    Returns
    -------
    SpringPoint
    """
    snubber = scenario.located_snubber(name)
    model, site = assemble(scenario, snubber.bodies), snubber_site(snubber)
    patterns = [LoadPattern(model.row(loaded), loaded) for loaded in model.loaded_sites([site])]
    basis = reduce_model(model, patterns, count=None if model.size <= DENSE_LIMIT else requested + MORE_MODES)
    shape = model.row(site) @ basis.vectors / np.sqrt(model.mass_scale)
    return SpringPoint(basis.omega * model.frequency_scale, shape)
