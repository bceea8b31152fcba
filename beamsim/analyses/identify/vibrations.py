r"""Damping and contact parameters from measured nonlinear vibrations (thesis, section 1.3.4).

The harmonics :math:`m_{tk}` of test t (amplitude and phase) are compared with those of the exact periodic response,

.. math:: \chi^2 = \sum_{t,k} \frac{|m_{tk} - c_{tk}(\theta)\, e^{i k \psi_t}|^2}{\sigma_{tk}^2},

where :math:`\psi_t` is the phase lag between measurement and excitation: where it is unknown, the one that fits best
with each :math:`\theta` (variable projection). Every response is a solution of the shooting equations with the exact
monodromy matrix. It is therefore smooth in the parameters down to round-off, and its derivatives are finite differences
of neighbouring exact responses. The sum is minimised from several starting points.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import gcd, nan
from statistics import NormalDist
from typing import Any

import numpy as np

from beamsim.analyses.identify.fit import (
    MOST_EVALUATIONS,
    Fit,
    FitParameter,
    LeastSquares,
    ParameterEstimate,
    UnpredictableError,
    at_bounds,
    estimates_dataset,
    sought_numbers,
    widening,
    with_parameters,
)
from beamsim.analyses.identify.layouts import NONLINEAR
from beamsim.analyses.identify.records import (
    FittedTest,
    Misfit,
    Prediction,
    SweptPeaks,
    Test,
    TestComparison,
    Transient,
    fit_of,
    sweeps_of,
    tests_dataset,
)
from beamsim.analyses.identify.result import Findings
from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.flow.channels import outputs_of
from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.measurements.conditioning import clipping_warnings
from beamsim.measurements.signal import MeasuredSignal
from beamsim.orbits.shooting import ForcedOrbits, find_orbit
from beamsim.outcomes import (
    MOST_LISTED,
    Interrupted,
    Outcome,
    OutcomeKind,
    Progress,
    check_stop,
    deferred_stop,
    first_of,
    first_with_others,
    interruption,
    report_progress,
    stop_requested,
    stop_requests,
)
from beamsim.responses.loads import periodic_forcing
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path as Keys
from beamsim.scenario.base import count_text, path_text
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.identification import IdentifyStiffness, NonlinearFit, SteadyTest, SweepTest, TransientTest
from beamsim.scenario.parameters import replace_values
from beamsim.scenario.run import Reduction
from beamsim.signals.harmonics import Harmonics, best_phase, harmonics_of, period_multiple
from beamsim.system.build import build_system
from beamsim.system.force_tables import curves_of
from beamsim.system.reduced_model import SharedBuilds
from beamsim.typing import Complexes, Floats, not_none, of_kind

LARGEST_HIGH_PASS = 0.2  # of a steady test's frequency: that high-pass changes the first harmonic by 0.07 %


def fit_nonlinear(
    scenario: Scenario,
    section: IdentifyStiffness,
    signals: Sequence[MeasuredSignal],
    progress: Progress = None,
) -> Findings:
    """Fit ``section.nonlinear.estimate`` to measured signals, one per test, in SI units.

    Parameters
    ----------
    scenario : scenario with the initial values of the parameters.
    section : section with the tests and the parameters to estimate.
    signals : one for each test.
    progress : called with the completed fraction of the starts.

    Returns
    -------
    Findings
        The fit with the lowest misfit of all starts. After an interruption, the best fit so far, without intervals.

    Raises
    ------
    ScenarioError
        If a signal cannot be used, there are more unknowns than measured values, a segment without slope is to be
        estimated, or no steady vibration exists at the initial values of the scenario.
    """
    begin = processor_time()
    nonlinear = not_none(section.nonlinear)
    tests = _tests(scenario, nonlinear, signals)
    scenario = _prepare(scenario, tests)
    vibrations = _Vibrations(tests, scenario, sought_numbers(scenario, nonlinear.estimate)[0])
    _check_count(vibrations.numbers, tests)
    search = _search_starts(vibrations, nonlinear, progress)
    found = _judge_fit(vibrations, search, section, begin)
    records = [*zip((test.label for test in nonlinear.tests_with_files.values()), signals, strict=True)]
    of_records = [f"{label}: {text}" for label, signal in records for text in signal.warnings]
    clipped = [label for label, signal in records if clipping_warnings(signal)]
    return replace(found, warnings=(*of_records, *found.warnings), outcome=_clipping_outcome(clipped, found.outcome))


def _clipping_outcome(names: Sequence[str], outcome: Outcome) -> Outcome:
    """Mark the outcome of a fit as not reliable if it uses clipped records (named in ``names``)."""
    if not names:
        return outcome
    what = f"{first_of(names, MOST_LISTED)} is clipped at the end of the sensor's range"
    remedy = "measure again with a wider range, or fit without the test (leave_out)"
    clipped = Outcome.of(OutcomeKind.UNTRUSTED, "clipped", what, remedy=remedy, tests=tuple(names))
    return first_with_others([clipped] if outcome.complete else [outcome, clipped])


@dataclass(frozen=True)
class _FitFromStarts:
    """Result of a search from several starting points."""

    fit: Fit
    best: LeastSquares
    initial_comparisons: list[TestComparison]  # at the scenario's values
    initial_misfit: float  # at the scenario's values
    starts_tried: int  # number of starting points
    starts_agreeing: int  # starting points that ended at the lowest misfit
    warnings: list[str]


def _search_starts(vibrations: _Vibrations, settings: NonlinearFit, progress: Progress) -> _FitFromStarts:
    """Minimise the misfit from every start; `vibrations.tests` then have the noise estimated from the best fit.

    Parameters
    ----------
    vibrations : the tests and parameters.
    settings : settings of the fit, with the number of starts.
    progress : see `fit_nonlinear`.

    Returns
    -------
    _Search
    """
    vibrations.start()
    fit = Fit(vibrations.numbers, vibrations.residuals)
    first, before = fit.residuals(np.zeros(len(fit.numbers))), vibrations.comparisons
    fits = [*vibrations.fits_of_beginnings(), fit]
    solutions, tried = _fit_from_starts(fits, settings, progress)
    best = min(solutions, key=lambda each: each.misfit)
    agreeing = sum(each.misfit <= best.misfit + max(0.5, 1e-3 * best.misfit) for each in solutions)
    if len(fits) > 1 and not stop_requested():  # estimate the noise of transients from the fit residual
        vibrations.tests = _with_fit_noise(vibrations.tests, fit.residuals(best.x), len(fit.numbers))
        fit = Fit(vibrations.numbers, vibrations.residuals)
        first, before = fit.residuals(np.zeros(len(fit.numbers))), vibrations.comparisons
        fit.residuals(best.x)
        best = fit.minimise(best.x)
    warnings = []
    if agreeing == 1 < len(solutions):
        warnings.append(
            "only one start reached the lowest misfit; the others ended elsewhere: improve the initial values"
        )
    return _FitFromStarts(fit, best, before, float(first @ first), tried, agreeing, warnings)


def _judge_fit(vibrations: _Vibrations, search: _FitFromStarts, section: IdentifyStiffness, start_s: float) -> Findings:
    """Compute confidence intervals at the estimate, and the contribution of each test to the misfit.

    Parameters
    ----------
    vibrations : tests and parameters as `_search_starts` left them.
    search : result of the search; parameters that no test determines get the scenario's values back.
    section : section with the probability of the intervals.
    start_s : processor time before the search, s.

    Returns
    -------
    Findings.
    """
    fit, best, tests, coverage = search.fit, search.best, vibrations.tests, section.coverage
    with deferred_stop():
        fit.residuals(best.x)
    penetration = np.array([vibration.extremes("penetration").high for vibration in vibrations.predictions])
    unknown = _unreached_parameters(vibrations.scenario, fit.numbers, penetration)
    best = replace(best, x=np.where([i in unknown for i in range(len(fit.numbers))], 0.0, best.x))
    jacobian, by_delay, complete = vibrations.jacobian(best.x, fit.residuals(best.x).size)
    jacobian[:, list(unknown)] = 0.0
    predicted = vibrations.comparisons
    vibrations.project_out_delays(jacobian)
    residuals = fit.residuals(best.x)
    freedom = residuals.size - sum(test.uninformative_count for test in tests) - (len(fit.numbers) - len(unknown))
    parts = _test_misfits(tests, residuals, jacobian, freedom)
    scale, warnings = _covariance_factor(tests, parts, best.misfit, freedom)
    parameters, covariance, remarks = fit.estimates(best, jacobian, scale, coverage, unknown)
    parts = vibrations.with_delay_intervals(parts, by_delay, covariance, scale, coverage)
    with deferred_stop():
        records = [
            t.summarise_fit(p, b, a)
            for t, p, b, a in zip(tests, parts, search.initial_comparisons, predicted, strict=True)
        ]
        doubts = [
            text for test, last in zip(tests, vibrations.predictions, strict=True) for text in test.fit_warnings(last)
        ]
    warnings += [*remarks, *unknown.values(), *_yield_warnings(vibrations.scenario, fit.numbers), *doubts]
    without = [p.parameter for p, column in zip(parameters, jacobian.T, strict=True) if np.isnan(column).any()]
    settings = not_none(section.nonlinear)
    profiles = fit.profiles(best, covariance, scale, points=7) if settings.profiles and complete else ()
    interrupted = f"after {search.starts_tried} of {settings.starts} starts" if stop_requested() else ""
    more = {
        "misfit_before": search.initial_misfit, "misfit": best.misfit, "degrees_of_freedom": freedom,
        "starts": search.starts_tried, "starts_agreeing": search.starts_agreeing, "responses": vibrations.responses[0],
        "processor_time_s": processor_time() - start_s, "coverage": coverage,
    }  # fmt: skip
    dataset = estimates_dataset(NONLINEAR, vibrations.scenario, parameters, covariance, more)
    delays = {each.name: [each.delay_s, *each.delay_interval] for each in records}
    summary = {
        "estimated": {each.parameter: each.summary() for each in parameters},
        "nonlinear_misfit": [search.initial_misfit, best.misfit],
        "test_misfits": {each.name: [each.misfit, each.misfit_without] for each in records},
        "test_delays_s": {name: each for name, each in delays.items() if np.isfinite(each).all()},
        "starts_agreeing": [search.starts_agreeing, search.starts_tried],
    }
    doubtful = [*at_bounds(vibrations.scenario, parameters)]
    if np.all(np.isfinite(jacobian)):
        doubtful += _undetermined_outcome(parameters, unknown)
    if scale > LEAST_MISFIT_OVER_NOISE:
        doubtful += _opposite_sign_outcome(vibrations.tests_with_better_opposite_sign())
    outcome = _outcome(interrupted, best, without if complete else (), doubtful)
    warnings += search.warnings
    return Findings([dataset, tests_dataset(records)], summary, warnings, profiles, outcome=outcome)


LARGEST_SIGN_RATIO = 0.25  # misfit with the opposite sign over the present one, below which the sign is doubtful
LEAST_MISFIT_OVER_NOISE = 10.0  # times the misfit that noise explains, above which the sign of a record is checked


def _undetermined_outcome(parameters: Sequence[ParameterEstimate], unreached: Collection[int]) -> list[Outcome]:
    """Outcome for parameters that the tests do not determine: their values are not reliable.

    Parameters
    ----------
    parameters : the estimates.
    unreached : indices of parameters that are table segments no test reaches; these have their own warning.
    """
    names = [p.parameter for k, p in enumerate(parameters) if np.isnan(p.standard_deviation) and k not in unreached]
    if not names:
        return []
    return [
        Outcome.of(
            OutcomeKind.UNTRUSTED, "undetermined", f"the tests do not determine {first_of(names, MOST_LISTED)}",
            remedy="add tests that depend on it, in which contact is made and lost, or take it out of estimate",
            parameters=tuple(names),
        )
    ]  # fmt: skip


def _opposite_sign_outcome(names: Sequence[str]) -> list[Outcome]:
    """Outcome for tests whose record, with the opposite sign, is much closer to the initial prediction."""
    if not names:
        return []
    what = f"{first_of(names, MOST_LISTED)} agrees much better with the initial prediction if its sign is reversed"
    remedy = "write factor: -1 in the test if its sensor has the opposite polarity"
    return [Outcome.of(OutcomeKind.UNTRUSTED, "other_sign", what, remedy=remedy, tests=tuple(names))]


def _outcome(
    interrupted: str, best_fit: LeastSquares, without_derivative: Sequence[str], doubts: Sequence[Outcome]
) -> Outcome:  # fmt: skip
    """Outcome of a fit: interrupted, evaluation limit, unreliable parameters, or parameters without a derivative."""
    if interrupted:
        return interruption(interrupted)
    outcomes = list(doubts)
    if not best_fit.converged:
        outcomes.append(
            Outcome.of(
                OutcomeKind.STOPPED, "fit_limit", f"the limit of {MOST_EVALUATIONS} evaluations of the fit is reached",
                remedy="start from better values, or fit fewer parameters",
            )
        )  # fmt: skip
    if without_derivative:
        outcomes.append(
            Outcome.of(
                OutcomeKind.UNTRUSTED, "derivative_unknown",
                f"no steady vibration was found close to the estimate of {', '.join(without_derivative)}: no "
                "standard deviation is known",
                remedy="start from other values, or leave out tests with irregular motion",
            )
        )  # fmt: skip
    return first_with_others(outcomes)


NEGLIGIBLE_LINE = 1e-6  # amplitude, relative to the fundamental, below which a motion is taken to have no component


@dataclass(frozen=True)
class _Steady(Test):
    """Measured steady vibration, compared by its harmonics."""

    probe_index: int
    frequency_hz: float
    excitation_periods: int  # excitation periods in one period of the motion
    harmonics: Harmonics
    sigma: Floats  # (h,)

    @property
    def size(self) -> int:
        """Number of real measured values."""
        return self.harmonics.order.size * (2 if self.harmonics.has_phase else 1)

    @property
    def omega(self) -> float:
        """Angular frequency of the first harmonic of the motion, rad/s."""
        return 2 * np.pi * self.frequency_hz / self.excitation_periods

    def case(self, scenario: Scenario) -> Scenario:
        """The scenario under the excitation of this test."""
        level = of_kind(SteadyTest, fit_of(scenario).tests[self.number]).level
        excitation = of_kind(Harmonic, scenario.excitation).at(self.frequency_hz, level)
        return scenario.model_copy(update={"excitation": excitation, "run": None})

    def predict(self, case: Scenario, neighbour: Any, builds: SharedBuilds) -> SteadyVibration:
        """Compute the steady vibration; see `Transient.predict`."""
        guess = None if neighbour is None else neighbour.start
        return steady_vibration(case, guess, excitation_periods=self.excitation_periods, builds=builds)

    def compare(self, prediction: Any, gain: float, neighbour: TestComparison | None) -> TestComparison:
        """Compare harmonics, shifted to the time of the measurement; see `Transient.compare`."""
        predicted = gain * prediction.harmonics(self.probe_index, self.quantity, self.harmonics.order.size)
        phase = self._phase(predicted)
        if neighbour is not None:  # avoid a jump by a full turn
            phase += 2 * np.pi * round((neighbour.delay * self.omega - phase) / (2 * np.pi))
        predicted = predicted * np.exp(1j * self.harmonics.order * phase)
        turned = 1j * self.omega * self.harmonics.order * predicted / self.sigma
        by_delay = np.concatenate([turned.real, turned.imag]) if self.harmonics.has_phase else np.zeros(self.size)
        return TestComparison(predicted, phase / self.omega, self._residuals(predicted), by_delay)

    def fit_warnings(self, prediction: Any) -> list[str]:
        """Warn if the predicted period differs from that of the record, or the motion does not reach the snubbers."""
        size = np.abs(prediction.harmonics(self.probe_index, self.quantity, self.excitation_periods))
        repeats = self.excitation_periods // gcd(
            self.excitation_periods, *(1 + np.flatnonzero(size > NEGLIGIBLE_LINE * size[-1])).tolist()
        )
        if repeats == self.excitation_periods:
            return super().fit_warnings(prediction)
        return [
            f"{self.name}: the record repeats after {count_text(self.excitation_periods, 'period')} of the excitation, "
            f"and the predicted motion after {repeats}: several motions exist, or the initial values are far off; "
            "start nearer to the truth (gap, stiffness), or leave it out"
        ]

    def _phase(self, predicted: Complexes) -> float:
        """Phase lag of the measurement, rad of the motion's own period.

        If the measured phase is known, the lag is a whole number of excitation periods.
        """
        if self.fits_delay:
            return best_phase(self.harmonics, predicted, self.sigma)
        turns = 2.0 * np.pi / self.excitation_periods * np.arange(self.excitation_periods)
        turned = predicted * np.exp(1j * np.multiply.outer(turns, self.harmonics.order))
        return float(turns[np.argmin([np.sum(self._residuals(each) ** 2) for each in turned])])

    def _residuals(self, predicted: Complexes) -> Floats:
        """Weighted differences of the harmonics, in the time of the measurement."""
        if not self.harmonics.has_phase:
            return np.asarray((np.abs(predicted) - np.abs(self.harmonics.value)) / self.sigma)
        difference = (predicted - self.harmonics.value) / self.sigma
        return np.concatenate([difference.real, difference.imag])

    def summarise_fit(self, misfit: Misfit, initial: TestComparison, fitted: TestComparison) -> FittedTest:
        """See `Transient.summarise_fit`."""
        turn = 2 * np.pi / self.omega
        shift = turn * round(fitted.delay / turn)
        misfit = misfit._replace(delay_interval=(misfit.delay_interval[0] - shift, misfit.delay_interval[1] - shift))
        harmonics = {"order": self.harmonics.order / self.excitation_periods, "noise": self.sigma}
        compared = {"measured": self.harmonics.value, "initial": initial.values, "predicted": fitted.values}
        harmonics |= {f"{name}_real": each.real for name, each in compared.items()}
        harmonics |= {f"{name}_imag": each.imag for name, each in compared.items()}
        rows = {"harmonic": harmonics}
        return self.fitted_test("steady", misfit, fitted.delay - shift, rows, frequency_hz=self.frequency_hz)


AnyTest = _Steady | Transient | SweptPeaks


def _check_count(numbers: Sequence[FitParameter], tests: Sequence[AnyTest]) -> None:
    measured, delays = sum(test.size for test in tests), sum(test.fits_delay for test in tests)
    if sum(np.isnan(number.prior) for number in numbers) + delays > measured:
        raise ScenarioError.at(
            "identify_stiffness.nonlinear.estimate",
            f"asks for {len(numbers)} parameters (and {delays} delays) from {measured} measured numbers",
            "use more tests or more harmonics, estimate fewer parameters, or give them a prior",
        )


def _tests(scenario: Scenario, settings: NonlinearFit, signals: Sequence[MeasuredSignal]) -> list[AnyTest]:
    given = settings.tests_with_files
    if len(signals) != len(given):
        raise ScenarioError.at(
            "identify_stiffness.nonlinear.tests",
            f"lists {len(given)} tests, and {len(signals)} measured signals were given",
            "give one signal per test",
        )
    tests, problems, first = list[AnyTest](), [], scenario.effective_probes[0].name
    for (index, test), signal in zip(given.items(), signals, strict=True):
        try:
            if not (np.all(np.isfinite(signal.y)) and np.all(np.isfinite(signal.x))) or signal.x.size == 0:
                raise InputFileError("has values that are not numbers", "remove them")
            if isinstance(test, TransientTest):
                tests.append(Transient.of(index, test, signal, test.probe or first))
            else:
                tests.append(_steady(scenario, index, test, signal))
        except InputFileError as fault:
            at = f"identify_stiffness.nonlinear.tests[{index}].file"
            problems.append(Problem(at, f"= {test.file} {fault.message}", fault.remedy))
    probes = [probe.name for probe in scenario.effective_probes]
    for index, table in settings.used_tests.items():
        file: Keys = ("identify_stiffness", "nonlinear", "tests", index, "file")
        try:
            rows = sweeps_of(table, scenario.folder_of(*file), probes) if isinstance(table, SweepTest) else []
            tests += [SweptPeaks.of(index, row, row.probe or first) for row in rows]
        except InputFileError as fault:
            problems.append(Problem(path_text(file), f"= {table.file} {fault.message}", fault.remedy))
    known = {*(test.name for test in tests), *(test.label for test in settings.tests)}
    if unknown := sorted({*settings.leave_out} - known):
        remedy = f"the tests are {', '.join(sorted(known))}"
        problems.append(Problem("identify_stiffness.nonlinear.leave_out", f"names {unknown[0]}, no test", remedy))
    if problems:
        raise ScenarioError(problems)
    return [test for test in tests if test.name not in settings.leave_out]


ASSUMED_NOISE = 0.01  # of the largest harmonic, where the noise is unknown


def _steady(scenario: Scenario, number: int, test: SteadyTest, signal: MeasuredSignal) -> _Steady:
    excitation: Any = scenario.excitation
    frequency = excitation.frequency if test.frequency is None else test.frequency
    if test.high_pass is not None and test.high_pass > LARGEST_HIGH_PASS * frequency:
        message = f"is high-pass filtered at {test.high_pass:g} Hz, which changes harmonics of {frequency:g} Hz"
        raise InputFileError(message, f"use high_pass up to {LARGEST_HIGH_PASS * frequency:.3g} Hz, or remove: trend")
    multiple = period_multiple(signal.last(test.last), frequency)
    harmonics = harmonics_of(signal, frequency / multiple, test.harmonics * multiple, test.last)
    largest = float(np.max(np.abs(harmonics.value)))
    if largest == 0.0:
        message = f"has no component at {frequency:g} Hz and its harmonics"
        raise InputFileError(message, "check channel and frequency")
    sigma, known = harmonics.noise, test.noise is not None or bool(harmonics.noise.all())
    if test.noise is not None or not known:
        sigma = np.full(harmonics.order.size, (ASSUMED_NOISE if test.noise is None else test.noise) * largest)
    probes = [probe.name for probe in scenario.effective_probes]
    probe = probes[0] if test.probe is None else test.probe
    return _Steady(
        number=number,
        name=test.label,
        probe=probe,
        probe_index=probes.index(probe),
        quantity=test.quantity,
        frequency_hz=frequency,
        excitation_periods=multiple,
        harmonics=harmonics,
        sigma=np.maximum(sigma, 1e-12 * largest),
        noise_known=known,
        fits_delay=harmonics.has_phase and test.phase == "free",
        treatment="; ".join(signal.scaling),
    )


MODE_RANGE_FACTOR = 3.0  # times the highest harmonic used: modes of a fit without `reduction`


def _prepare(scenario: Scenario, tests: Sequence[AnyTest]) -> Scenario:
    """Give the scenario enough modes for the steady tests, and absolute paths to files of its tests."""
    reduction, steady = scenario.reduction, [test for test in tests if isinstance(test, _Steady)]
    if steady and reduction is None and any(body.reduced_by_default for body in scenario.all_bodies.values()):
        highest = max(test.frequency_hz * test.harmonics.order[-1] / test.excitation_periods for test in steady)
        reduction = Reduction(highest_frequency=MODE_RANGE_FACTOR * highest)
    prepared = scenario.model_copy(update={"reduction": reduction, "sweep": None, "nnm": None})
    return prepared if len(steady) == len(tests) else replace_values(prepared, scenario.whole_paths(prepared))


@dataclass
class _Vibrations:
    """Predicted motions of all tests as a function of the parameters."""

    tests: list[AnyTest]
    scenario: Scenario
    numbers: list[FitParameter]
    responses: list[int] = field(default_factory=lambda: [0])  # number computed, shortened transients included
    predictions: list[Prediction] = field(default_factory=list)
    initial_predictions: list[tuple[Prediction, TestComparison]] = field(default_factory=list)
    comparisons: list[TestComparison] = field(default_factory=list)
    builds: SharedBuilds = field(default_factory=SharedBuilds)

    def start(self) -> None:
        """Compute the motions at the initial values; they also give the scale of gaps, which may be zero.

        Raises
        ------
        ScenarioError
            If a test has no predicted motion.
        """
        try:
            self.residuals(np.zeros(len(self.numbers)))
        except UnpredictableError as error:
            raise ScenarioError.at(
                "identify_stiffness.nonlinear.tests",
                f"have no steady vibration with the initial values of the scenario: {error}",
                "start from better values, or leave out tests with irregular motion",
            ) from error
        swings = [v.extremes("displacement") for v in self.predictions]
        size = max((float(half) for swing in swings for half in 0.5 * (swing.high - swing.low)), default=1e-3)
        self.numbers = [replace(number, shift=max(0.3 * size, abs(number.start))) if number.is_gap else number
                        for number in self.numbers]  # fmt: skip

    def fits_of_beginnings(self) -> list[Fit]:
        """Fits to the beginnings of the transients, in the order of their length; empty without transients.

        Over a long record the misfit has many minima, because small errors of the frequencies accumulate. Each fit
        therefore starts from the estimate of a shorter part.
        """
        shares = BEGINNING_SHARES if any(isinstance(test, Transient) for test in self.tests) else ()
        parts = [[t.beginning(share) if isinstance(t, Transient) else t for t in self.tests] for share in shares]
        return [Fit(self.numbers, replace(self, tests=tests, initial_predictions=[]).residuals) for tests in parts]

    def residuals(self, x: Floats, differencing: bool = False) -> Floats:
        """Residuals of all tests, (r,). Raises `UnpredictableError` if the model has no motion for a test."""
        scenario = with_parameters(self.scenario, self.numbers, x)
        predictions, compared, gains = [], [], [test.gain for test in fit_of(scenario).tests]
        for t, test in enumerate(self.tests):
            near, before = self.initial_predictions[t] if self.initial_predictions else (None, None)
            try:
                predictions.append(test.predict(test.case(scenario), near, self.builds))
            except UnpredictableError:
                if stop_requested():  # the branch of a sweep may have ended because of the interruption
                    raise Interrupted from None
                raise
            check_stop()
            self.responses[0] += 1
            compared.append(test.compare(predictions[t], gains[test.number], before if differencing else None))
        self.predictions, self.comparisons = predictions, compared
        if not differencing:  # differences start from one motion, so that the residual error of Newton's method cancels
            self.initial_predictions = list(zip(predictions, compared, strict=True))
        return np.concatenate([each.residuals for each in compared])

    def tests_with_better_opposite_sign(self) -> list[str]:
        """Names of transients that agree much better with the initial prediction if their sign is reversed."""
        self.residuals(np.zeros(len(self.numbers)))
        gains = [test.gain for test in fit_of(self.scenario).tests]
        return [
            test.name
            for test, motion, as_written in zip(self.tests, self.predictions, self.comparisons, strict=True)
            if isinstance(test, Transient)
            and np.sum(test.compare(motion, -gains[test.number], None).residuals ** 2)
            < LARGEST_SIGN_RATIO * np.sum(as_written.residuals**2)
        ]

    def jacobian(self, x: Floats, count: int) -> tuple[Floats, Floats, bool]:
        """Derivatives of the residuals and of the fitted delays by the parameters.

        Parameters
        ----------
        x : (p,) parameters; the last comparison must be the one at ``x``.
        count : number r of residuals of the tests.

        Returns
        -------
        (r, p) derivatives of the residuals, with the rows of the priors at the end; (t, p) derivatives of the delays
        of t tests; False after an interruption, when all derivatives are nan.
        """

        def both(x_shifted: Floats, differencing: bool) -> Floats:
            return np.concatenate([self.residuals(x_shifted, differencing), [each.delay for each in self.comparisons]])

        fit, size = Fit(self.numbers, both), sum(test.size for test in self.tests)
        there = self.predictions, self.comparisons
        try:
            with stop_requests(at_once=True):
                check_stop()
                jacobian = fit.jacobian(x)
                self.residuals(x)
        except Interrupted:
            self.predictions, self.comparisons = there
            return np.full((count, x.size), nan), np.full((len(self.tests), x.size), nan), False
        delays = slice(size, size + len(self.tests))
        return np.delete(jacobian, delays, axis=0), jacobian[delays], True

    def project_out_delays(self, jacobian: Floats) -> None:
        """Project the derivatives, in place, onto the complement of the fitted delays (variable projection)."""
        for test, rows, compared in zip(self.tests, _rows(self.tests), self.comparisons, strict=True):
            if test.fits_delay:
                by_delay = compared.by_delay / np.linalg.norm(compared.by_delay)
                jacobian[rows] -= np.outer(by_delay, by_delay @ jacobian[rows])

    def with_delay_intervals(
        self, misfits: Sequence[Misfit], delay_derivatives: Floats, covariance: Floats, scale: float, coverage: float
    ) -> list[Misfit]:
        """Add confidence intervals of the fitted delays to the misfits of the tests.

        Parameters
        ----------
        misfits : misfits of the tests.
        delay_derivatives : (t, p) derivatives of the delays.
        covariance, scale : (p, p) covariance of the parameters, and the factor that it contains.
        coverage : probability of the intervals.
        """
        z, found = NormalDist().inv_cdf(0.5 + coverage / 2), []
        for test, part, compared, slope in zip(self.tests, misfits, self.comparisons, delay_derivatives, strict=True):
            known = slope != 0.0  # the delays of other tests are fixed
            of_parameters = slope[known] @ covariance[np.ix_(known, known)] @ slope[known]
            if test.fits_delay:
                wide = z * np.sqrt(scale / np.sum(compared.by_delay**2) + of_parameters)
                part = part._replace(delay_interval=(compared.delay - wide, compared.delay + wide))
            found.append(part)
        return found


def _rows(tests: Sequence[AnyTest]) -> list[slice]:
    """Rows of each test in the residuals of all tests."""
    ends = np.cumsum([0, *(test.size for test in tests)]).tolist()
    return [slice(first, last) for first, last in pairwise(ends)]


ROUGH_TOLERANCE = 1e-3  # tolerance of a fit that only provides the starting point of the next one


def _fit_from_starts(fits: Sequence[Fit], settings: NonlinearFit, progress: Progress) -> tuple[list[LeastSquares], int]:
    """Minima of the last fit, each started from the minima of the fits before it, and the number of starts tried."""
    generator = np.random.default_rng(settings.seed)
    solutions: list[LeastSquares] = []
    for tried in range(1, settings.starts + 1):
        start = np.zeros(len(fits[-1].numbers))  # the scenario's values
        if tried > 1:
            start += settings.spread * generator.standard_normal(start.size)
        try:
            for rough in fits[:-1]:
                start = rough.minimise(start, tolerance=ROUGH_TOLERANCE).x
            solutions.append(fits[-1].minimise(start))
        except UnpredictableError:
            continue
        report_progress(progress, tried / (settings.starts + 1))
        if stop_requested():
            break
    if not solutions:
        raise ScenarioError.at(
            "identify_stiffness.nonlinear",
            "found no parameters for which every test has a steady vibration",
            "start from better values, or leave out tests with irregular motion",
        )
    return solutions, tried


def _with_fit_noise(tests: Sequence[AnyTest], residuals: Floats, parameters: int) -> list[AnyTest]:
    """Copies of the tests with the noise re-estimated from the residual of the best fit."""
    parts = zip(tests, _rows(tests), strict=True)
    return [
        test.with_fit_noise(float(np.sum(residuals[rows] ** 2)), parameters) if isinstance(test, Transient) else test
        for test, rows in parts
    ]


def _test_misfits(
    tests: Sequence[AnyTest], residuals: Floats, jacobian: Floats, degrees_of_freedom: int
) -> list[Misfit]:
    """Contribution of each test to the misfit.

    Without the rows i of a linear problem the sum of squares decreases by ``r_i (1 - H_ii)^-1 r_i``, with the matrix
    ``H = J (J' J)^-1 J'`` (R. D. Cook, S. Weisberg, Residuals and influence in regression, 1982).

    Parameters
    ----------
    tests : the tests, in the order of the residuals.
    residuals : (r,) residuals at the estimate, with those of the priors at the end.
    jacobian : (r, p) derivatives of the residuals.
    degrees_of_freedom : degrees of freedom of the fit; nan results for a test without which none remain.
    """
    left, size, _ = np.linalg.svd(np.nan_to_num(jacobian), full_matrices=False)
    left = left[:, size > 1e-9 * size.max()]
    parts, whole = [], float(residuals @ residuals)
    for test, rows in zip(tests, _rows(tests), strict=True):
        own = residuals[rows]
        directions, share, _ = np.linalg.svd(left[rows], full_matrices=False)  # H_ii has the squared shares
        along, rest = (directions.T @ own) ** 2, 1.0 - share**2
        inside = np.divide(along, rest, out=np.zeros_like(along), where=rest > 1e-9)
        removed = float(own @ own - along.sum() + inside.sum())
        judged = degrees_of_freedom - test.size + test.uninformative_count > 0
        parts.append(Misfit(float(own @ own), max(whole - removed, 0.0) if judged else nan))
    return parts


def _covariance_factor(
    tests: Sequence[AnyTest], misfits: Sequence[Misfit], misfit: float, degrees_of_freedom: int
) -> tuple[float, list[str]]:
    """Factor on the covariance: chi squared per degree of freedom, if the noise is unknown or too small; warnings."""
    known = all(test.noise_known for test in tests)
    wider = widening(misfit, degrees_of_freedom)
    if degrees_of_freedom <= 0 or (known and wider == 1.0):
        return 1.0, []
    warnings = []
    if known:
        warnings.append(
            f"the measurements differ from the model by more than their noise (misfit {misfit:.3g} with "
            f"{degrees_of_freedom} degrees of freedom); the intervals are widened accordingly"
        )
    worst = min(range(len(tests)), key=lambda k: np.nan_to_num(misfits[k].misfit_without, nan=np.inf))
    rest = degrees_of_freedom - tests[worst].size + tests[worst].uninformative_count
    if misfits[worst].misfit_without < 0.5 * misfit / degrees_of_freedom * rest:
        warnings.append(
            f"{tests[worst].name} has {misfits[worst].misfit / misfit:.0%} of the misfit of {misfit:.3g}; "
            f"without it the misfit is {misfits[worst].misfit_without:.3g} with {rest} degrees of freedom: check its "
            f"level, frequency, unit and sensor, estimate its gain, or fit without it, leave_out: [{tests[worst].name}]"
        )
    return misfit / degrees_of_freedom, warnings


def _yield_warnings(scenario: Scenario, numbers: Sequence[FitParameter]) -> list[str]:
    """Warn that the gap of a snubber that yields cannot be separated from its residual crush."""
    sought = {place[:-1] for number in numbers for place in number.places if place[-1] in ("gap", "preload")}
    return [
        f"{located.item.name} yields: a steady vibration repeats with any residual crush, so that gap and crush "
        "together are found, not the gap or preload of the new stop; measure one of them"
        for located in scenario.located_snubbers
        if located.item.yields and not getattr(located.item.unloading, "force_deflection", None)
        if located.path in sought
    ]


ROUND_OFF = 1e-9  # relative, of penetrations
BEGINNING_SHARES = (0.1, 0.3)  # shares of transients to which parameters are fitted first


@dataclass(frozen=True)
class SteadyVibration(Prediction):
    """Periodic response; ``motion`` is one period, which may contain several periods of the excitation."""

    start: Floats  # (N,) state at t = 0, initial guess for neighbouring parameters

    def harmonics(self, probe: int, quantity: str, count: int) -> Complexes:
        """First harmonics of a quantity of a probe.

        Parameters
        ----------
        probe : index of the probe, from 0.
        quantity : displacement, velocity, absolute_displacement or absolute_acceleration.
        count : number of harmonics.

        Returns
        -------
        (count,) array
            Zero to peak in m, m/s or m/s^2, as sines in the time of the excitation.
        """
        exact, period, name = self.motion.flow, self.motion.end, self.system.probes[probe].name
        omega = 2 * np.pi / period * np.arange(1.0, count + 1.0)
        if quantity == "absolute_displacement":
            return self.harmonics(probe, "absolute_acceleration", count) / -(omega**2)
        channel = self.system.channels.of_keys(("probes", quantity)).select(lambda each: each.name == name)
        output_of = outputs_of(exact, channel.linear)
        # Re sum X e^{i k w t} = Im sum (i X) e^{i k w t}
        return np.asarray(2j / period * self.motion.fourier_integrals(output_of, omega)[0])


def steady_vibration(
    scenario: Scenario, guess: Floats | None = None, *, excitation_periods: int = 1, builds: SharedBuilds | None = None
) -> SteadyVibration:
    """Compute the periodic response by Newton's method on the exact flow with its exact monodromy matrix.

    Parameters
    ----------
    scenario : scenario with a harmonic excitation and without cubic springs.
    guess : (N,) state at t = 0 of a neighbouring response.
    excitation_periods : excitation periods in one period of the response.
    builds : cache of systems built for scenarios with the same structure.

    Returns
    -------
    SteadyVibration

    Raises
    ------
    UnpredictableError
        If neither Newton's method nor a transient of 300 periods reaches such a motion.
    """
    system = build_system(scenario, builds, with_stations=False)
    if system.cubic is not None:
        raise UnpredictableError("cubic springs have no exact flow")
    omega = 2 * np.pi * scenario.sine.frequency
    flow = VariationalFlow(system.dynamics, periodic_forcing(scenario, system), omega, scenario.sine.level)
    problem = ForcedOrbits(flow, "level", multiple=excitation_periods)
    try:
        fits = guess is not None and guess.size == flow.size
        point = find_orbit(problem, guess) if fits else None
        if point is None:
            point = find_orbit(problem)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise UnpredictableError(str(error)) from error
    if point is None:
        raise UnpredictableError(
            f"no vibration that repeats after {count_text(excitation_periods, 'period')} of the excitation "
            f"({system.excitation_frequency_hz:g} Hz) was found"
        )
    exact = ExactFlow(system.dynamics, system.forcing, point.data.duration)
    motion = point.data.trajectory(exact)
    return SteadyVibration(system, motion, point.data.event_time.size > 0, point.u[:-1])


def _unreached_parameters(scenario: Scenario, numbers: Sequence[FitParameter], penetration: Floats) -> dict[int, str]:
    """Parameters that are table segments which no test reaches, as index and explanation.

    Parameters
    ----------
    scenario : scenario with the parameters.
    numbers : the p parameters.
    penetration : (tests, snubbers) largest penetrations, m.

    Raises
    ------
    ScenarioError
        For a segment without slope, which a factor cannot change.
    """
    remarks = {}
    for index, number in enumerate(numbers):
        if len(number.places) > 1 or number.places[0][-3:-1] != ("force_deflection", "segment_factors"):
            continue
        *path, _, _, last = number.places[0]
        segment = of_kind(int, last)
        contacts = [j for j, located in enumerate(scenario.located_snubbers) if located.path == tuple(path)]
        curve = not_none(curves_of(scenario)[contacts[0]])
        if curve.slopes[segment] == 0.0:
            raise ScenarioError.at(
                "identify_stiffness.nonlinear.estimate",
                f"names {number.parameter}, a segment without slope, which no factor changes",
                "leave it out, or give the table a small slope there",
            )
        begin, largest = float(curve.deflection[segment]), max(float(penetration[:, contacts].max()), 0.0)
        if largest <= begin * (1.0 + ROUND_OFF):  # it only just reaches the segment
            remarks[index] = (
                f"{number.parameter}: no test reaches segment {segment + 1}, which begins at {1e3 * begin:.4g} mm "
                f"(largest penetration {1e3 * largest:.4g} mm): it keeps its value; add a test at a higher level, or "
                "leave it out"
            )
    return remarks
