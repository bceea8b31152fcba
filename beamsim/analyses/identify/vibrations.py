r"""Damping and contact parameters from measured nonlinear vibrations (thesis, section 1.3.4).

The harmonics :math:`m_{tk}` of test t (amplitude and phase) are compared with those of the exact periodic response,

.. math:: \chi^2 = \sum_{t,k} \frac{|m_{tk} - c_{tk}(\theta)\, e^{i k \psi_t}|^2}{\sigma_{tk}^2},

where :math:`\psi_t` is the phase lag between measurement and excitation: where it is unknown, the one that fits best
with each :math:`\theta` (variable projection). Every response is a solution of the shooting equations with the exact
monodromy matrix. It is therefore smooth in the parameters down to round-off, and its derivatives are finite differences
of neighbouring exact responses. The sum is minimised from several starting points.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.compare.analysis import Harmonics, best_phase, harmonics_of, period_multiple
from beamsim.analyses.continuation.paths import periodic_forcing
from beamsim.analyses.identify.fit import (
    MOST_EVALUATIONS,
    Best,
    Fit,
    Sought,
    UnpredictableError,
    correlation_of,
    sought_numbers,
    varied,
    widening,
)
from beamsim.analyses.identify.result import NonlinearEstimate, TestFit
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.channels import Observed, fourier_integrals, outputs_of
from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import Extrema
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.variational import VariationalFlow, motion_on
from beamsim.measurements.signal import MeasuredSignal, MeasurementError
from beamsim.orbits.shooting import ForcedOrbits, find_orbit
from beamsim.outcomes import Outcome, OutcomeKind, Stop, interruption, never, together
from beamsim.scenario import Scenario
from beamsim.scenario.base import counted
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.quantities import level_unit
from beamsim.scenario.run import Reduction
from beamsim.scenario.studies import IdentifyStiffness, MeasuredTest, NonlinearFit
from beamsim.system.build import build_system
from beamsim.system.force_tables import curves_of
from beamsim.system.parts import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats


def fit_nonlinear(
    scenario: Scenario,
    section: IdentifyStiffness,
    signals: Sequence[MeasuredSignal],
    progress: Callable[[float], None] | None = None,
    stop: Stop = never,
) -> NonlinearEstimate:
    """Fit ``section.nonlinear.estimate`` to measured signals, one per test, in SI units.

    Parameters
    ----------
    scenario : with the initial values.
    section : what is sought.
    signals : one for each test.
    progress : called with the share of the starts that is done.
    stop : asked after each start, and before the profiles, whether to end with the best so far.

    Returns
    -------
    NonlinearEstimate
        From the start with the lowest misfit.

    Raises
    ------
    ScenarioError
        If a signal cannot be used, there are more unknowns than measured numbers, a segment without slope is sought,
        or there is no steady vibration with the initial values of the scenario.
    """
    begin = processor_time()
    nonlinear = section.nonlinear
    assert nonlinear is not None
    tests = _tests(scenario, nonlinear.used, signals)
    vibrations = _Vibrations(tests, _cases(scenario, tests), sought_numbers(scenario, nonlinear.estimate)[0])
    _check_count(vibrations.numbers, tests)
    vibrations.start()
    fit = Fit(vibrations.numbers, vibrations.residuals)
    first = fit.residuals(np.zeros(len(fit.numbers)))
    before = vibrations.compared
    solutions, tried = _from_starts(fit, nonlinear, progress, stop)
    best = min(solutions, key=lambda each: each.misfit)
    agreeing = sum(each.misfit <= best.misfit + max(0.5, 1e-3 * best.misfit) for each in solutions)

    fit.residuals(best.x)
    penetration = np.array([vibration.extremes("penetration").high for vibration in vibrations.last])
    unknown = _unreached(scenario, fit.numbers, penetration)
    best = replace(best, x=np.where([i in unknown for i in range(len(fit.numbers))], 0.0, best.x))
    jacobian = fit.jacobian(best.x)
    jacobian[:, list(unknown)] = 0.0
    fit.residuals(best.x)
    predicted = vibrations.compared
    vibrations.take_out_phases(jacobian)
    freedom = first.size - sum(test.free_phase for test in tests) - (len(fit.numbers) - len(unknown))
    parts = _parts(tests, fit.residuals(best.x), jacobian)
    scale, warnings = _scatter(tests, parts, best.misfit, freedom)
    parameters, covariance, remarks = fit.estimates(best, jacobian, scale, section.coverage, unknown)
    warnings += [*remarks, *unknown.values()]
    warnings += _yielding(scenario, fit.numbers) + vibrations.without_contact()
    if agreeing == 1 < len(solutions):
        warnings.append("only one start reached the lowest misfit: there are other minima; use better initial values")
    interrupted = stop()
    without = [p.parameter for p, column in zip(parameters, jacobian.T, strict=True) if np.isnan(column).any()]
    stopped = f"after {tried} of {nonlinear.starts} starts" if interrupted else None
    return NonlinearEstimate(
        outcome=_outcome(stopped, best, without),
        parameters=parameters,
        correlation=correlation_of(covariance),
        tests=tuple(map(_test_fit, tests, parts, before, predicted)),
        misfit_before=float(first @ first),
        misfit=best.misfit,
        degrees_of_freedom=freedom,
        starts=tried,
        starts_agreeing=agreeing,
        profiles=fit.profiles(best, covariance, scale, points=7) if nonlinear.profiles and not interrupted else (),
        responses=vibrations.responses,
        processor_time_s=processor_time() - begin,
        coverage=section.coverage,
        warnings=tuple(warnings),
    )


def _outcome(stopped: str | None, best: Best, without: list[str]) -> Outcome:
    """How the fit ended: where it was stopped, and the parameters without a derivative."""
    outcomes = []
    if stopped is not None:
        outcomes.append(interruption(stopped))
    if not best.converged:
        outcomes.append(
            Outcome.of(
                OutcomeKind.STOPPED, "fit_limit", f"the limit of {MOST_EVALUATIONS} evaluations of the fit is reached",
                remedy="start from better values, or fit fewer parameters",
            )
        )  # fmt: skip
    if without:
        outcomes.append(
            Outcome.of(
                OutcomeKind.UNTRUSTED, "derivative_unknown",
                f"no steady vibration was found close to the estimate of {', '.join(without)}: no standard deviation "
                "is known",
                remedy="start from other values, or leave out tests with irregular motion",
            )
        )  # fmt: skip
    return together(outcomes)


@dataclass(frozen=True)
class _Test:
    """One measured vibration, ready to be compared."""

    number: int  # in the list of the scenario
    name: str
    probe: str
    probe_index: int
    quantity: str
    frequency_hz: float
    level: float
    multiple: int  # periods of the excitation in one of the motion, whose harmonics are compared
    harmonics: Harmonics
    sigma: Floats  # (h,)
    noise_known: bool
    free_phase: bool

    @property
    def size(self) -> int:
        """Number of real measured values."""
        return self.harmonics.order.size * (2 if self.harmonics.has_phase else 1)

    def phase(self, predicted: Complexes) -> float:
        """Phase of the measurement, rad of the motion's own period: a whole number of those of the excitation where its
        phase is known."""
        if self.free_phase:
            return best_phase(self.harmonics, predicted, self.sigma)
        turns = 2.0 * np.pi / self.multiple * np.arange(self.multiple)
        turned = predicted * np.exp(1j * np.multiply.outer(turns, self.harmonics.order))
        return float(turns[np.argmin([np.sum(self.residuals(each) ** 2) for each in turned])])

    def residuals(self, predicted: Complexes) -> Floats:
        """Weighted differences of harmonics in the time of the measurement."""
        if not self.harmonics.has_phase:
            return np.asarray((np.abs(predicted) - np.abs(self.harmonics.value)) / self.sigma)
        difference = (predicted - self.harmonics.value) / self.sigma
        return np.concatenate([difference.real, difference.imag])


def _check_count(numbers: Sequence[Sought], tests: Sequence[_Test]) -> None:
    measured, delays = sum(test.size for test in tests), sum(test.free_phase for test in tests)
    if sum(np.isnan(number.prior) for number in numbers) + delays > measured:
        raise ScenarioError.at(
            "identify_stiffness.nonlinear.estimate",
            f"asks for {len(numbers)} parameters (and {delays} delays) from {measured} measured numbers",
            "use more tests or more harmonics, estimate fewer parameters, or give them a prior",
        )


def _tests(scenario: Scenario, given: Mapping[int, MeasuredTest], signals: Sequence[MeasuredSignal]) -> list[_Test]:
    if len(signals) != len(given):
        raise ScenarioError.at(
            "identify_stiffness.nonlinear.tests",
            f"lists {len(given)} tests, and {len(signals)} measured signals were given",
            "give one signal per test",
        )
    tests, problems = [], []
    for (index, test), signal in zip(given.items(), signals, strict=True):
        try:
            tests.append(_test(scenario, index, test, signal))
        except MeasurementError as fault:
            at = f"identify_stiffness.nonlinear.tests[{index}].file"
            problems.append(Problem(at, f"= {test.file} {fault.message}", fault.remedy))
    if problems:
        raise ScenarioError(problems)
    return tests


def _test(scenario: Scenario, number: int, test: MeasuredTest, signal: MeasuredSignal) -> _Test:
    excitation: Any = scenario.excitation
    frequency = excitation.frequency if test.frequency is None else test.frequency
    if not (np.all(np.isfinite(signal.y)) and np.all(np.isfinite(signal.x))) or signal.x.size == 0:
        raise MeasurementError("has values that are not numbers", "remove them")
    multiple = period_multiple(signal.last(test.last), frequency)
    harmonics = harmonics_of(signal, frequency / multiple, test.harmonics * multiple, test.last)
    largest = float(np.max(np.abs(harmonics.value)))
    if largest == 0.0:
        message = f"has no component at {frequency:g} Hz and its harmonics"
        raise MeasurementError(message, "check channel and frequency")
    sigma, known = harmonics.noise, test.noise is not None or bool(harmonics.noise.all())
    if test.noise is not None or not known:
        # 0.01: of the largest harmonic, if the noise is unknown
        sigma = np.full(harmonics.order.size, (0.01 if test.noise is None else test.noise) * largest)
    probes = [probe.name for probe in scenario.effective_probes]
    probe = probes[0] if test.probe is None else test.probe
    return _Test(
        number=number,
        name=test.label,
        probe=probe,
        probe_index=probes.index(probe),
        quantity=test.quantity,
        frequency_hz=frequency,
        level=float(excitation.level if test.level is None else test.level),
        multiple=multiple,
        harmonics=harmonics,
        sigma=np.maximum(sigma, 1e-12 * largest),
        noise_known=known,
        free_phase=harmonics.has_phase and test.phase == "free",
    )


def _cases(scenario: Scenario, tests: Sequence[_Test]) -> list[Scenario]:
    """The scenario under the excitation of each test."""
    highest = max(test.frequency_hz * test.harmonics.order[-1] / test.multiple for test in tests)
    reduction = scenario.reduction
    if reduction is None and any(body.reduced_by_default for body in scenario.all_bodies.values()):
        # 3.0: times the highest harmonic used: modes of a fit without `reduction`
        reduction = Reduction(highest_frequency=3.0 * highest)
    harmonic = scenario.excitation
    assert isinstance(harmonic, Harmonic)
    without = {"run": None, "reduction": reduction, "sweep": None, "nnm": None}
    return [
        scenario.model_copy(update={"excitation": harmonic.at(test.frequency_hz, test.level), **without})
        for test in tests
    ]


@dataclass
class _Vibrations:
    """The steady vibration of every test, for any values of the parameters."""

    tests: Sequence[_Test]
    cases: Sequence[Scenario]
    numbers: list[Sought]
    responses: int = 0
    last: list[SteadyVibration] = field(default_factory=list)
    guesses: list[SteadyVibration] = field(default_factory=list)
    compared: list[tuple[Complexes, float]] = field(default_factory=list)  # harmonics and phase lag of each test
    shared: SharedBuilds = field(default_factory=SharedBuilds)

    def start(self) -> None:
        """Find the first vibrations, and the size of gaps, which may be zero, from them.

        Raises
        ------
        ScenarioError
            If a test has none.
        """
        try:
            self.residuals(np.zeros(len(self.numbers)))
        except UnpredictableError as error:
            raise ScenarioError.at(
                "identify_stiffness.nonlinear.tests",
                f"have no steady vibration with the initial values of the scenario: {error}",
                "start from better values, or leave out tests with irregular motion",
            ) from error
        swings = [v.extremes("displacement") for v in self.last]
        size = max((float(half) for swing in swings for half in 0.5 * (swing.high - swing.low)), default=1e-3)
        self.numbers = [replace(number, shift=max(0.3 * size, abs(number.start))) if number.is_gap else number
                        for number in self.numbers]  # fmt: skip

    def residuals(self, x: Floats, beside: bool = False) -> Floats:
        """Those of all tests; raises `UnpredictableError` where one has no steady vibration."""
        vibrations, compared, out = [], [], []
        for t, (test, case) in enumerate(zip(self.tests, self.cases, strict=True)):
            count, guess = test.harmonics.order.size, self.guesses[t].start if self.guesses else None
            case = varied(case, self.numbers, x)
            vibration = steady_vibration(case, guess, multiple=test.multiple, shared=self.shared)
            self.responses += 1
            harmonics = _gain(case, test) * vibration.harmonics(test.probe_index, test.quantity, count)
            phase = test.phase(harmonics)
            harmonics = harmonics * np.exp(1j * test.harmonics.order * phase)
            vibrations.append(vibration)
            compared.append((harmonics, phase))
            out.append(test.residuals(harmonics))
        self.last, self.compared = vibrations, compared
        if not beside:  # both sides of a difference start from the motion between: what Newton's method leaves cancels
            self.guesses = vibrations
        return np.concatenate(out)

    def take_out_phases(self, jacobian: Floats) -> None:
        """Take out of derivatives what free phases take up to first order, so that they are those of the parameters."""
        for test, rows, (harmonics, _) in zip(self.tests, _rows(self.tests), self.compared, strict=True):
            if test.free_phase:
                turned = 1j * test.harmonics.order * harmonics / test.sigma
                by_phase = np.concatenate([turned.real, turned.imag]) / np.linalg.norm(turned)
                jacobian[rows] -= np.outer(by_phase, by_phase @ jacobian[rows])

    def without_contact(self) -> list[str]:
        """Warnings about tests that say nothing of the snubbers."""
        return [
            f"{test.name}: contact is never made and lost; the vibration is linear and contains little information "
            "about the snubber"
            for test, vibration in zip(self.tests, self.last, strict=True)
            if not vibration.touching and vibration.system.snubbers
        ]


def _gain(case: Scenario, test: _Test) -> float:
    section = case.identify_stiffness
    assert section is not None
    assert section.nonlinear is not None
    return section.nonlinear.tests[test.number].gain


def _rows(tests: Sequence[_Test]) -> list[slice]:
    """Those of each test in the residuals of all."""
    ends = np.cumsum([0, *(test.size for test in tests)]).tolist()
    return [slice(first, last) for first, last in pairwise(ends)]


def _from_starts(
    fit: Fit, settings: NonlinearFit, progress: Callable[[float], None] | None, stop: Stop
) -> tuple[list[Best], int]:
    """The minima found, and the number of starts tried."""
    generator = np.random.default_rng(settings.seed)
    solutions: list[Best] = []
    for tried in range(1, settings.starts + 1):
        start = np.zeros(len(fit.numbers))  # the values of the scenario
        if tried > 1:
            start += settings.spread * generator.standard_normal(start.size)
        try:
            solutions.append(fit.best(start))
        except UnpredictableError:
            continue
        if progress is not None:
            progress(tried / (settings.starts + 1))
        if stop():
            break
    if not solutions:
        raise ScenarioError.at(
            "identify_stiffness.nonlinear",
            "found no parameters for which every test has a steady vibration",
            "start from better values, or leave out tests with irregular motion",
        )
    return solutions, tried


class _Misfit(NamedTuple):
    """What a test has of the misfit."""

    misfit: float
    without: float  # the misfit of a fit to the other tests alone


def _parts(tests: Sequence[_Test], residuals: Floats, jacobian: Floats) -> list[_Misfit]:
    """What each test has of the misfit.

    Without the rows i of a linear problem the sum of squares is less by ``r_i (1 - H_ii)^-1 r_i``, with the projection
    ``H = J (J' J)^-1 J'`` (R. D. Cook, S. Weisberg, Residuals and influence in regression, 1982).

    Parameters
    ----------
    tests : of which the residuals are, in this order.
    residuals : (r,) at the estimate, with those of the priors at the end.
    jacobian : (r, p) their derivatives.
    """
    left, size, _ = np.linalg.svd(np.nan_to_num(jacobian), full_matrices=False)
    left = left[:, size > 1e-9 * size.max()]
    parts, whole = [], float(residuals @ residuals)
    for rows in _rows(tests):
        own = residuals[rows]
        inverse = np.linalg.pinv(np.eye(own.size) - left[rows] @ left[rows].T, rcond=1e-9, hermitian=True)
        parts.append(_Misfit(float(own @ own), max(whole - float(own @ inverse @ own), 0.0)))
    return parts


def _scatter(tests: Sequence[_Test], parts: Sequence[_Misfit], misfit: float, freedom: int) -> tuple[float, list[str]]:
    """Factor on the covariance: chi^2 per degree of freedom if the noise is unknown or too small for the misfit."""
    known = all(test.noise_known for test in tests)
    wider = widening(misfit, freedom)
    if freedom <= 0 or (known and wider == 1.0):
        return 1.0, []
    warnings = []
    if known:
        warnings.append(
            f"the measurements differ from the model by more than their noise (misfit {misfit:.3g} with {freedom} "
            "degrees of freedom); the intervals are widened accordingly"
        )
    worst = min(range(len(tests)), key=lambda k: parts[k].without)
    rest = freedom - tests[worst].size + tests[worst].free_phase
    if rest > 0 and parts[worst].without / rest < 0.5 * misfit / freedom:
        warnings.append(
            f"{tests[worst].name} has {parts[worst].misfit / misfit:.0%} of the misfit of {misfit:.3g}, and without it "
            f"{parts[worst].without:.3g} would be left with {rest} degrees of freedom: check its level, frequency, "
            f"unit and sensor, estimate its gain, or fit without it, leave_out: [{tests[worst].name}]"
        )
    return misfit / freedom, warnings


def _yielding(scenario: Scenario, numbers: Sequence[Sought]) -> list[str]:
    """Warnings about gaps of snubbers that yield."""
    sought = {place[:-1] for number in numbers for place in number.places if place[-1] in ("gap", "preload")}
    return [
        f"{located.item.name} yields: a steady vibration repeats with any residual crush, so that gap and crush "
        "together are found, not the gap or preload of the new stop; measure one of them"
        for located in scenario.located_snubbers
        if located.item.hardening is not None and located.path in sought
    ]


def _test_fit(
    test: _Test, part: _Misfit, before: tuple[Complexes, float], predicted: tuple[Complexes, float]
) -> TestFit:
    return TestFit(
        name=test.name,
        probe=test.probe,
        quantity=test.quantity,
        unit=level_unit(test.quantity.removeprefix("absolute_")),
        frequency_hz=test.frequency_hz,
        order=test.harmonics.order / test.multiple,
        measured=test.harmonics.value,
        noise=test.sigma,
        before=before[0],
        predicted=predicted[0],
        misfit=part.misfit,
        misfit_without=part.without,
        delay_s=float(np.angle(np.exp(1j * predicted[1]))) * test.multiple / (2 * np.pi * test.frequency_hz),
    )


_SETTLE = 300  # most periods of transient


@dataclass(frozen=True)
class SteadyVibration:
    """A periodic response with the period of its excitation, or several of these."""

    system: StructuralSystem
    motion: Trajectory  # over one period of the response
    start: Floats  # (N,) state at t = 0, initial guess for neighbouring parameters
    touching: bool  # whether contact is made and lost

    def harmonics(self, probe: int, quantity: str, count: int) -> Complexes:
        """The first harmonics of a quantity of a probe.

        Parameters
        ----------
        probe : number of the probe, from 0.
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
        channel = self.system.channels.of_keys(("probes", quantity)).only(lambda each: each.name == name)
        table = exact.output_table(outputs_of(exact, channel.linear))
        # Re sum X e^{i k w t} = Im sum (i X) e^{i k w t}
        return np.asarray(2j / period * fourier_integrals(self.motion, table, omega)[0])

    def extremes(self, quantity: str) -> Extrema:
        """Those of a quantity of every snubber over the period."""
        channels = self.system.channels.of_keys(("snubbers", quantity))
        return Observed(self.motion.flow, channels).extrema(self.motion)


def steady_vibration(
    scenario: Scenario, guess: Floats | None = None, *, multiple: int = 1, shared: SharedBuilds | None = None
) -> SteadyVibration:
    """The periodic response, by Newton's method on the exact flow with its exact monodromy matrix.

    Parameters
    ----------
    scenario : with a harmonic excitation, without cubic springs.
    guess : state at t = 0 of a neighbouring response.
    multiple : periods of the excitation in one of the response.
    shared : keeps what was built for scenarios with the same structure.

    Returns
    -------
    SteadyVibration

    Raises
    ------
    UnpredictableError
        Where neither Newton's method nor a transient of 300 periods ends in such a motion.
    """
    system = build_system(scenario, shared, recovered=False)
    if system.cubic.count:
        raise UnpredictableError("cubic springs have no exact flow")
    assert isinstance(scenario.excitation, Harmonic)
    omega = 2 * np.pi * scenario.excitation.frequency
    flow = VariationalFlow(system.dynamics, periodic_forcing(scenario, system), omega, scenario.excitation.level)
    problem = ForcedOrbits(flow, "level", multiple=multiple)
    try:
        fits = guess is not None and guess.size == flow.size
        point = find_orbit(problem, guess, settle=_SETTLE) if fits else None
        if point is None:
            point = find_orbit(problem, None, settle=_SETTLE, stable=multiple > 1)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise UnpredictableError(str(error)) from error
    if point is None:
        raise UnpredictableError(
            f"no vibration that repeats after {counted(multiple, 'period')} of the excitation "
            f"({system.excitation_frequency_hz:g} Hz) was found"
        )
    base = () if system.base_acceleration is None else (system.base_acceleration,)
    exact = ExactFlow(system.dynamics, system.forcing, point.data.duration, base)
    motion = motion_on(exact, point.data)
    return SteadyVibration(system, motion, point.u[:-1], point.data.event_time.size > 0)


def _unreached(scenario: Scenario, numbers: Sequence[Sought], penetration: Floats) -> dict[int, str]:
    """Numbers of the parameters that are segments of a table which no test reaches, and why.

    Parameters
    ----------
    scenario : of which the parameters are numbers.
    numbers : the parameters.
    penetration : (tests, snubbers) the largest penetration of each, m.

    Raises
    ------
    ScenarioError
        For a segment without slope, which no factor changes.
    """
    remarks = {}
    for index, number in enumerate(numbers):
        if len(number.places) > 1 or number.places[0][-3:-1] != ("force_deflection", "segment_factors"):
            continue
        *path, _, _, segment = number.places[0]
        contacts = [j for j, located in enumerate(scenario.located_snubbers) if located.path == tuple(path)]
        curve = curves_of(scenario)[contacts[0]]
        assert curve is not None
        assert isinstance(segment, int)
        if curve.slopes[segment] == 0.0:
            raise ScenarioError.at(
                "identify_stiffness.nonlinear.estimate",
                f"names {number.parameter}, a segment without slope, which no factor changes",
                "leave it out, or give the table a small slope there",
            )
        begin, largest = float(curve.deflection[segment]), max(float(penetration[:, contacts].max()), 0.0)
        if largest <= begin * (1.0 + 1e-9):  # a motion that ends at the beginning is in no later segment
            remarks[index] = (
                f"{number.parameter}: no test reaches segment {segment + 1}, which begins at {1e3 * begin:.4g} mm "
                f"(largest penetration {1e3 * largest:.4g} mm): it keeps its value; add a test at a higher level, or "
                "leave it out"
            )
    return remarks
