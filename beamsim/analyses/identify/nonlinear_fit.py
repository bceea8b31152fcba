r"""Damping and contact parameters from measured nonlinear vibrations (thesis, section 1.3.4).

The harmonics :math:`m_{tk}` of test t (amplitude and phase) are compared with those of the exact periodic response,

.. math:: \chi^2 = \sum_{t,k} \frac{|m_{tk} - c_{tk}(\theta)\, e^{i k \psi_t}|^2}{\sigma_{tk}^2},

where :math:`\psi_t` is the unknown phase lag between measurement and excitation. Every response is a solution of the
shooting equations with the exact monodromy matrix. It is therefore smooth in the parameters down to round-off, and its
derivatives are finite differences of neighbouring exact responses. The sum is minimised by a trust-region least-squares
method from several starting points.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Any

import numpy as np

from beamsim.analyses.compare.measured import Harmonics, best_phase, harmonics_of
from beamsim.analyses.identify.model_updating import Sought, confounded, inverse_information, sought_numbers
from beamsim.analyses.identify.result import NonlinearEstimate, ParameterEstimate, ProfileLikelihood, TestFit
from beamsim.analyses.identify.steady import NoSteadyVibrationError, SteadyVibration, steady_vibration
from beamsim.analyses.identify.table_segments import SoughtSegment, segment_warnings, sought_segments, unreached
from beamsim.analyses.identify.uncertainty import widening
from beamsim.errors import Problem, ScenarioError
from beamsim.interrupts import Stop, never
from beamsim.measurements.signal import MeasuredSignal
from beamsim.outcomes import Outcome, OutcomeKind, together
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.identification import IdentifyStiffness, MeasuredTest
from beamsim.scenario.parameters import with_values
from beamsim.scenario.run import Reduction
from beamsim.system.shared import SharedBuilds
from beamsim.typing import Bools, Complexes, Floats

Place = tuple[str | int, ...]

_STEP = 1e-5  # of the scaled parameters, for differences of exact responses
_WIDEST_FACTOR = 30.0
_UNKNOWN_NOISE = 0.01  # of the largest harmonic, if the noise is unknown
_FAR = 1e6  # residual if there is no steady vibration
_MOST_EVALUATIONS = 60  # of the residuals, in one fit
_PROFILE_POINTS = 7
_PROFILE_WIDTH = 2.5
_HARMONICS_KEPT = 3.0  # times the highest harmonic used: modes of a fit without `reduction`
_UNITS = {
    "absolute_acceleration": "m/s^2", "displacement": "m", "absolute_displacement": "m", "velocity": "m/s",
}  # fmt: skip


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

    Raises
    ------
    ScenarioError
        If a signal cannot be used, there are more unknowns than measured numbers, or there is no steady vibration
        with the initial values of the scenario.
    """
    begin = clock.process_time()
    nonlinear = section.nonlinear
    assert nonlinear is not None
    tests = _tests(scenario, nonlinear.tests, signals)
    numbers, _ = sought_numbers(scenario, nonlinear.estimate)
    measured = sum(test.size for test in tests)
    free = sum(1 for number in numbers if np.isnan(number.prior))
    unknowns = free + sum(1 for test in tests if test.free_phase)
    if unknowns > measured:
        raise ScenarioError(
            Problem(
                "identify_stiffness.nonlinear.estimate",
                f"asks for {len(numbers)} parameters (and {unknowns - free} delays) from {measured} measured numbers",
                "use more tests or more harmonics, estimate fewer parameters, or give them a prior",
            )
        )
    fit = _NonlinearFit(scenario, numbers, tests)
    fit.prepare()
    start = np.zeros(len(numbers))
    first = fit.with_phases(start)
    misfit_before = float(np.sum(fit.residuals(first) ** 2))
    before = [h.copy() for h in fit.last]
    generator = np.random.default_rng(nonlinear.seed)
    solutions: list[Any] = []
    for index in range(nonlinear.starts):
        offset = start if index == 0 else _random_start(fit, nonlinear.spread, generator)
        try:
            solutions.append(_solve(fit, fit.with_phases(offset)))
        except NoSteadyVibrationError:
            continue
        if progress is not None:
            progress((index + 1) / (nonlinear.starts + 1))
        if solutions and stop():
            break
    if not solutions:
        raise ScenarioError(
            Problem(
                "identify_stiffness.nonlinear",
                "found no parameters for which every test has a steady vibration",
                "start from better values, or leave out tests with irregular motion",
            )
        )
    best = min(solutions, key=lambda r: float(r.cost))
    misfit = float(2 * best.cost)
    agreeing = sum(1 for r in solutions if 2 * r.cost <= misfit + max(0.5, 1e-3 * misfit))
    x = best.x
    unknown = np.append(fit.unreached(x), np.zeros(x.size - len(numbers), dtype=bool))
    x = np.where(unknown, 0.0, x)
    jacobian = np.where(unknown, 0.0, fit.jacobian(x, central=True))
    fit.residuals(x)
    priors = sum(1 for number in numbers if np.isfinite(number.prior))
    freedom = measured + priors - int(np.count_nonzero(~unknown))
    scale, warnings = _scatter(fit, misfit, freedom)
    covariance = inverse_information(_without_phases(jacobian, len(numbers))) * scale
    deviation = np.sqrt(np.diag(covariance))
    z = NormalDist().inv_cdf(0.5 + section.coverage / 2)
    parameters = tuple(_estimate(fit, i, float(x[i]), float(deviation[i]), z) for i in range(len(numbers)))
    known = ~unknown[: len(numbers)]
    names = [n.parameter for n, ok in zip(numbers, known, strict=True) if ok]
    warnings += confounded(names, _without_phases(jacobian, len(numbers))[:, known], covariance[np.ix_(known, known)])
    warnings += [f"{p.parameter} ended on its bound, {p.value:g}" for p in parameters if p.at_bound]
    warnings += fit.test_warnings()
    if agreeing < len(solutions) and agreeing == 1 and len(solutions) > 1:
        warnings.append("only one start reached the lowest misfit: there are other minima; use better initial values")
    predicted = [h.copy() for h in fit.last]
    interrupted = stop()
    profiles = _profiles(fit, x, covariance, misfit, scale) if nonlinear.profiles and not interrupted else ()
    with np.errstate(all="ignore"):
        correlation = covariance / np.outer(deviation, deviation)
    without = [n.parameter for n, column in zip(numbers, jacobian.T, strict=False) if np.any(np.isnan(column))]
    outcomes = []
    if interrupted:
        outcomes.append(
            Outcome.of(OutcomeKind.INTERRUPTED, "interrupted", f"after {index + 1} of {nonlinear.starts} starts")
        )
    if best.status == 0:  # of least_squares: it ran out of evaluations
        outcomes.append(
            Outcome.of(
                OutcomeKind.STOPPED, "fit_limit", f"the limit of {_MOST_EVALUATIONS} evaluations of the fit is reached",
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
    return NonlinearEstimate(
        outcome=together(outcomes),
        parameters=parameters,
        correlation=np.asarray(correlation),
        tests=tuple(
            _test_fit(test, before[t], predicted[t], fit.phase(x, t), fit.phase(first, t))
            for t, test in enumerate(tests)
        ),
        misfit_before=misfit_before,
        misfit=misfit,
        degrees_of_freedom=freedom,
        starts=index + 1,
        starts_agreeing=agreeing,
        profiles=profiles,
        responses=fit.responses,
        processor_time_s=clock.process_time() - begin,
        coverage=section.coverage,
        warnings=tuple(warnings),
    )


@dataclass(frozen=True)
class _Test:
    """One measured vibration, ready to be compared."""

    name: str
    probe: str
    probe_index: int
    quantity: str
    frequency_hz: float
    level: float
    harmonics: Harmonics
    sigma: Floats  # (h,)
    noise_known: bool
    free_phase: bool

    @property
    def size(self) -> int:
        """Number of real measured values."""
        return self.harmonics.order.size * (2 if self.harmonics.has_phase else 1)

    @property
    def omega(self) -> float:
        """Of the excitation, rad/s."""
        return 2 * np.pi * self.frequency_hz


def _tests(scenario: Scenario, given: Sequence[MeasuredTest], signals: Sequence[MeasuredSignal]) -> list[_Test]:
    if len(signals) != len(given):
        raise ScenarioError(
            Problem(
                "identify_stiffness.nonlinear.tests",
                f"lists {len(given)} tests, and {len(signals)} measured signals were given",
                "give one signal per test",
            )
        )
    probes = [probe.name for probe in scenario.effective_probes]
    tests, problems = [], []
    excitation: Any = scenario.excitation
    for index, (test, signal) in enumerate(zip(given, signals, strict=True)):
        frequency = excitation.frequency if test.frequency is None else test.frequency
        at = f"identify_stiffness.nonlinear.tests[{index}]"
        if not (np.all(np.isfinite(signal.y)) and np.all(np.isfinite(signal.x))) or signal.x.size == 0:
            problems.append(Problem(f"{at}.file", f"= {test.file} has values that are not numbers", "remove them"))
            continue
        try:
            harmonics = harmonics_of(signal, frequency, test.harmonics, test.last)
        except ValueError as error:
            problems.append(
                Problem(f"{at}.file", f"= {test.file} {error}", "check frequency, harmonics and last of this test")
            )
            continue
        largest = float(np.max(np.abs(harmonics.value)))
        if largest == 0.0:
            problems.append(
                Problem(
                    f"{at}.file",
                    f"= {test.file} has no component at {frequency:g} Hz and its harmonics",
                    "check channel and frequency",
                )
            )
            continue
        known = test.noise is not None or bool(harmonics.noise.all())
        sigma = harmonics.noise
        if test.noise is not None:
            sigma = np.full(harmonics.order.size, max(test.noise, 1e-12) * largest)
        elif not known:
            sigma = np.full(harmonics.order.size, _UNKNOWN_NOISE * largest)
        probe = probes[0] if test.probe is None else test.probe
        tests.append(
            _Test(
                name=signal.name if not test.file else test.file,
                probe=probe,
                probe_index=probes.index(probe),
                quantity=test.quantity,
                frequency_hz=frequency,
                level=float(excitation.level if test.level is None else test.level),
                harmonics=harmonics,
                sigma=np.maximum(sigma, 1e-12 * largest),
                noise_known=known,
                free_phase=harmonics.has_phase and test.phase == "free",
            )
        )
    if problems:
        raise ScenarioError(problems)
    return tests


@dataclass
class _NonlinearFit:
    """Residuals of all tests as a function of scaled parameters followed by the free phases."""

    scenario: Scenario
    numbers: list[Sought]
    tests: list[_Test]
    responses: int = 0
    last: list[Complexes] = field(default_factory=list)  # predicted harmonics of each test
    _cases: list[Scenario] = field(default_factory=list)
    _guesses: list[Floats | None] = field(default_factory=list)
    _vibrations: list[SteadyVibration] = field(default_factory=list)
    _shared: SharedBuilds = field(default_factory=SharedBuilds)
    _linear: list[bool] = field(default_factory=list)
    _scale: list[float] = field(default_factory=list)
    _segments: tuple[SoughtSegment, ...] = ()

    def prepare(self) -> None:
        """A scenario for each test, and the scaling of every parameter: a factor, or a length if it may be zero."""
        highest = max(test.frequency_hz * test.harmonics.order[-1] for test in self.tests)
        reduction = self.scenario.reduction
        if reduction is None and any(body.reduced_by_default for body in self.scenario.all_bodies.values()):
            reduction = Reduction(highest_frequency=_HARMONICS_KEPT * highest)
        without = {"run": None, "reduction": reduction, "sweep": None, "nnm": None}
        cases = []
        harmonic = self.scenario.excitation
        assert isinstance(harmonic, Harmonic)
        for test in self.tests:
            excitation = harmonic.at(test.frequency_hz, test.level)
            cases.append(self.scenario.model_copy(update={"excitation": excitation, **without}))
        self._cases = cases
        self._guesses = [None] * len(self.tests)
        try:
            self._vibrations = [steady_vibration(case, shared=self._shared) for case in cases]
        except NoSteadyVibrationError as error:
            raise ScenarioError(
                Problem(
                    "identify_stiffness.nonlinear.tests",
                    f"have no steady vibration with the initial values of the scenario: {error}",
                    "start from better values, or leave out tests with irregular motion",
                )
            ) from error
        self._guesses = [vibration.start for vibration in self._vibrations]
        self.last = [np.zeros(test.harmonics.order.size, dtype=complex) for test in self.tests]
        size = max(
            (v.largest_deflection(j) for v in self._vibrations for j in range(len(v.system.snubbers))), default=1e-3
        )
        self._segments = sought_segments(self.scenario, self.numbers)
        for number in self.numbers:
            length = any(place[-1] == "gap" for place in number.places)
            self._linear.append(length or number.start <= 0)
            self._scale.append(max(0.3 * size, abs(number.start)) if length else 0.01)

    def factor_of(self, i: int) -> tuple[bool, float]:
        """Whether parameter i is shifted (else multiplied by e^x), and the shift for x = 1."""
        return self._linear[i], self._scale[i]

    def value(self, i: int, x: float) -> float:
        """SI value of parameter i (its first place)."""
        start = self.numbers[i].start
        return start + self._scale[i] * x if self._linear[i] else start * float(np.exp(x))

    def values(self, x: Floats) -> dict[Place, object]:
        """Values at all places."""
        out: dict[Place, object] = {}
        for i, number in enumerate(self.numbers):
            for place, value in zip(number.places, number.values, strict=True):
                out[place] = value + self._scale[i] * x[i] if self._linear[i] else value * float(np.exp(x[i]))
        return out

    def limits(self) -> tuple[Floats, Floats]:
        """Bounds of the unknowns."""
        count = len(self.numbers) + sum(test.free_phase for test in self.tests)
        lower, upper = np.full(count, -np.inf), np.full(count, np.inf)
        for i, number in enumerate(self.numbers):
            low, high = number.bounds
            if self._linear[i]:
                signed = any(place[-1] == "gap" for place in number.places)
                low = low if signed else max(low, 0.0)
                lower[i], upper[i] = (low - number.start) / self._scale[i], (high - number.start) / self._scale[i]
            else:
                lower[i] = np.log(max(low, number.start / _WIDEST_FACTOR) / number.start)
                upper[i] = np.log(min(high, number.start * _WIDEST_FACTOR) / number.start)
        return lower, upper

    def predict(self, x: Floats) -> list[Complexes]:
        """Harmonics of every test with the parameters x."""
        values = self.values(x)
        predicted = []
        for t, test in enumerate(self.tests):
            varied, count = with_values(self._cases[t], values).rechecked(), test.harmonics.order.size
            vibration = steady_vibration(varied, self._guesses[t], harmonics=count, shared=self._shared)
            self.responses += 1
            self._guesses[t] = vibration.start
            self._vibrations[t] = vibration
            predicted.append(vibration.harmonics(test.probe_index, test.quantity, test.harmonics.order.size))
        return predicted

    def with_phases(self, theta: Floats) -> Floats:
        """Parameters followed by the phases that fit best."""
        predicted = self.predict(theta)
        phases = [
            best_phase(test.harmonics, harmonics, test.sigma)
            for test, harmonics in zip(self.tests, predicted, strict=True)
            if test.free_phase
        ]
        return np.concatenate([theta, phases])

    def phase(self, x: Floats, t: int) -> float:
        """Phase of test t among the unknowns; 0 if it is not free."""
        if not self.tests[t].free_phase:
            return 0.0
        return float(x[len(self.numbers) + sum(test.free_phase for test in self.tests[:t])])

    def compare(self, x: Floats, predicted: list[Complexes]) -> Floats:
        """Weighted residuals of predictions, then of priors."""
        parts: list[Floats] = []
        for t, (test, harmonics) in enumerate(zip(self.tests, predicted, strict=True)):
            if test.harmonics.has_phase:
                turned = harmonics * np.exp(1j * test.harmonics.order * self.phase(x, t))
                difference = (turned - test.harmonics.value) / test.sigma
                parts += [difference.real, difference.imag]
            else:
                parts.append((np.abs(harmonics) - np.abs(test.harmonics.value)) / test.sigma)
        for i, number in enumerate(self.numbers):
            if np.isfinite(number.prior):
                size = abs(number.start) or self._scale[i]
                parts.append(np.array([(self.value(i, float(x[i])) - number.start) / (number.prior * size)]))
        return np.concatenate(parts)

    def residuals(self, x: Floats) -> Floats:
        """Residuals of all tests and priors; very large if there is no steady vibration."""
        try:
            self.last = self.predict(x[: len(self.numbers)])
        except (NoSteadyVibrationError, ScenarioError):
            return np.full(self.compare(x, self.last).size, _FAR)
        return self.compare(x, self.last)

    def jacobian(self, x: Floats, *, central: bool = False) -> Floats:
        """Derivatives of the residuals: finite differences for parameters, exact for phases.

        A parameter without a steady vibration on either side has no derivative: nan in the ``central`` differences from
        which deviations follow; zero in those of a step of the search, which then keeps the parameter.
        """
        count = len(self.numbers)
        base = self.last if not central else self.predict(x[:count])
        here = self.compare(x, base)
        out = np.empty((here.size, x.size))
        lower, upper = self.limits()
        kept = list(self._guesses)
        for i in range(count):
            room = {1.0: x[i] + _STEP <= upper[i], -1.0: x[i] - _STEP >= lower[i]}
            there: dict[float, Floats] = {}
            for sign in (1.0, -1.0):
                if not room[sign] or (there and not central):
                    continue
                moved = x.copy()
                moved[i] += sign * _STEP
                self._guesses = list(kept)
                try:
                    there[sign] = self.compare(moved, self.predict(moved[:count]))
                except (NoSteadyVibrationError, ScenarioError):
                    continue
            if len(there) == 2:
                out[:, i] = (there[1.0] - there[-1.0]) / (2 * _STEP)
            elif there:
                ((sign, moved_residuals),) = there.items()
                out[:, i] = sign * (moved_residuals - here) / _STEP
            else:
                out[:, i] = np.nan if central else 0.0
        self._guesses = kept
        column = count
        for t, test in enumerate(self.tests):
            if not test.free_phase:
                continue
            change = np.zeros(here.size)
            first = sum(other.size for other in self.tests[:t])
            h = test.harmonics.order
            turned = 1j * h * base[t] * np.exp(1j * h * x[column]) / test.sigma
            change[first : first + h.size], change[first + h.size : first + 2 * h.size] = turned.real, turned.imag
            out[:, column] = change
            column += 1
        self.last = base
        return out

    def unreached(self, x: Floats) -> Bools:
        """Which parameters are the stiffness of a segment of a table that no test reaches with the parameters x."""
        if not self._segments:
            return np.zeros(len(self.numbers), dtype=bool)
        self.residuals(x)
        return unreached(self._segments, len(self.numbers), self._penetration)

    @property
    def _penetration(self) -> Floats:
        """(tests, m) largest penetrations of the last vibrations, m."""
        return np.array([vibration.penetration for vibration in self._vibrations])

    def test_warnings(self) -> list[str]:
        """Warnings about tests, and segments of tables, that contain no information on the contact."""
        warnings = segment_warnings(self._segments, self._penetration)
        sought = {place[:-1] for number in self.numbers for place in number.places if place[-1] in ("gap", "preload")}
        warnings += [
            f"{located.item.name} yields: a steady vibration repeats with any residual crush, so that gap and crush "
            "together are found, not the gap or preload of the new stop; measure one of them"
            for located in self.scenario.located_snubbers
            if located.item.hardening is not None and located.path in sought
        ]
        for test, vibration in zip(self.tests, self._vibrations, strict=True):
            if not vibration.touching and vibration.system.snubbers:
                warnings.append(
                    f"{test.name}: contact is never made and lost; the vibration is linear and contains little "
                    "information about the snubber"
                )
        return warnings


def _random_start(fit: _NonlinearFit, spread: float, generator: np.random.Generator) -> Floats:
    lower, upper = fit.limits()
    count = len(fit.numbers)
    offset = spread * generator.standard_normal(count)
    return np.asarray(np.clip(offset, lower[:count] + 1e-6, upper[:count] - 1e-6))


def _solve(fit: _NonlinearFit, x: Floats) -> Any:
    from scipy.optimize import least_squares

    lower, upper = fit.limits()
    x = np.clip(x, np.nextafter(lower, np.inf), np.nextafter(upper, -np.inf))
    return least_squares(
        fit.residuals, x, jac=fit.jacobian, bounds=(lower, upper), x_scale="jac", xtol=1e-8, ftol=1e-8,
        gtol=1e-10, max_nfev=_MOST_EVALUATIONS,
    )  # fmt: skip


def _without_phases(jacobian: Floats, count: int) -> Floats:
    """The columns of the parameters, orthogonal to those of the phases."""
    columns, phases = jacobian[:, :count], jacobian[:, count:]
    if phases.shape[1] == 0:
        return columns
    q, _ = np.linalg.qr(phases)
    return np.asarray(columns - q @ (q.T @ columns))


def _scatter(fit: _NonlinearFit, misfit: float, freedom: int) -> tuple[float, list[str]]:
    """Factor on the covariance: chi^2 per degree of freedom if the noise is unknown or too small for the misfit."""
    if freedom <= 0:
        return 1.0, []
    if not all(test.noise_known for test in fit.tests):
        return misfit / freedom, []
    if (wider := widening(misfit, freedom)) > 1.0:
        return wider, [
            f"the measurements differ from the model by more than their noise (misfit {misfit:.3g} with {freedom} "
            "degrees of freedom); the intervals are widened accordingly"
        ]
    return 1.0, []


def _estimate(fit: _NonlinearFit, i: int, x: float, deviation: float, z: float) -> ParameterEstimate:
    number = fit.numbers[i]
    linear, scale = fit.factor_of(i)
    value = fit.value(i, x)
    low, high = fit.limits()[0][i], fit.limits()[1][i]
    return ParameterEstimate(
        parameter=number.parameter,
        before=number.start,
        value=value,
        standard_deviation=deviation * (scale if linear else value),
        interval=(fit.value(i, x - z * deviation), fit.value(i, x + z * deviation)),
        bounds=number.bounds,
        prior=number.prior,
        at_bound=bool(min(abs(x - low), abs(high - x)) < 1e-6),
    )


def _profiles(
    fit: _NonlinearFit, x: Floats, covariance: Floats, misfit: float, scale: float
) -> tuple[ProfileLikelihood, ...]:
    """chi^2 against each parameter, the others and the phases fitted again: linear prediction and one correction."""
    count = len(fit.numbers)
    lower, upper = fit.limits()
    profiles = []
    for i in range(count):
        deviation = float(np.sqrt(covariance[i, i]))
        if not 0 < deviation < 1:
            continue
        grid = x[i] + np.linspace(-_PROFILE_WIDTH, _PROFILE_WIDTH, _PROFILE_POINTS) * deviation
        grid = grid[(grid > lower[i]) & (grid < upper[i])]
        values = []
        for at in grid:
            y = x.copy()
            y[:count] += covariance[:, i] / covariance[i, i] * (at - x[i])
            y = np.clip(y, lower, upper)
            r = fit.residuals(y)
            for _ in range(1):
                jacobian = np.delete(fit.jacobian(y), i, axis=1)
                step = np.linalg.lstsq(jacobian, -r, rcond=None)[0]
                y = np.clip(y + np.insert(step, i, 0.0), lower, upper)
                r = fit.residuals(y)
            values.append(max(float(r @ r) - misfit, 0.0) / scale)
        profiles.append(
            ProfileLikelihood(
                fit.numbers[i].parameter, np.array([fit.value(i, float(at)) for at in grid]), np.array(values)
            )
        )
    fit.residuals(x)
    return tuple(profiles)


def _test_fit(test: _Test, before: Complexes, predicted: Complexes, phase: float, phase_before: float) -> TestFit:
    order = test.harmonics.order
    return TestFit(
        name=test.name,
        probe=test.probe,
        quantity=test.quantity,
        unit=_UNITS[test.quantity],
        frequency_hz=test.frequency_hz,
        order=order.astype(float),
        measured=test.harmonics.value,
        noise=test.sigma,
        before=before * np.exp(1j * order * phase_before),
        predicted=predicted * np.exp(1j * order * phase),
        delay_s=float(np.angle(np.exp(1j * phase))) / test.omega,
    )
