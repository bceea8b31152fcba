r"""Tests that a model predicts and a fit compares: transients, and peaks and jumps of slow sweeps.

A transient is compared sample by sample with the exact motion of a run,

.. math:: \chi^2 = \sum_i \frac{(m_i - g\,x(t_i + \tau;\theta) - b)^2}{\sigma^2},

where the delay :math:`\tau` (unless it is known) and the offset b of the record are those that fit best for each
:math:`\theta` (variable projection). If the noise is not stated, it is the smaller of two estimates: the residual of
the fit, and the median of the squared sixth differences of the record, whose mean for white noise is
:math:`924\,\sigma^2`.

A slow sweep follows the branch of periodic motions up to a fold and jumps to the motion at the same frequency that
comes next on the branch, and so on. Each predicted peak is the largest on the parts that the sweep follows. Folds and
maxima are located on the branch, so that they are smooth functions of the parameters. Close to those of a neighbouring
model they are located without tracing the branch again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import nan
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import ValidationError

from beamsim.analyses.identify.fit import UnpredictableError
from beamsim.analyses.identify.layouts import ENDS, TESTS
from beamsim.errors import InputFileError, prefix_problems
from beamsim.files import reading
from beamsim.flow.channels import channel_extrema, channel_values
from beamsim.flow.exact import exact_flow
from beamsim.flow.extrema import Extrema
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.flow.variational import VariationalFlow
from beamsim.labelled import Dataset
from beamsim.measurements.conditioning import PERIODS_OF_FILTER, condition
from beamsim.measurements.read import ending_of
from beamsim.measurements.signal import MeasuredSignal, split_heading
from beamsim.measurements.tables import read_named_columns
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.continuation import BranchStep, Predictor, Settings, correct, correct_across, solve_at
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.tracing import Budget, Tracer, trace_range
from beamsim.responses.loads import periodic_forcing
from beamsim.responses.periodic_motion import Measurement
from beamsim.responses.points import cut
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.files import RecordPreparation
from beamsim.scenario.identification import NonlinearFit, SweepTest, TransientTest
from beamsim.scenario.quantities import level_unit
from beamsim.scenario.run import Run
from beamsim.scenario.validation_errors import describe
from beamsim.signals.noise import white_noise
from beamsim.system.build import build_system
from beamsim.system.reduced_model import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none, of_kind

MOST_EVENTS = 20_000  # of a transient in a fit
DELAY_SHARE = 0.1  # of the compared duration: how much earlier or later than stated a motion may begin
FEWEST_SAMPLES = 20  # samples of a transient
NOISE_MARGIN = 1.2  # factor on the noise variance that covers its scatter over a few hundred samples


@dataclass(frozen=True)
class Prediction:
    """Predicted motion of a test."""

    system: StructuralSystem
    motion: Trajectory
    makes_contact: bool  # whether contact is made and lost

    def extremes(self, quantity: str) -> Extrema:
        """Extremes of a quantity of every snubber."""
        channels = self.system.channels.of_keys(("snubbers", quantity))
        return channel_extrema(self.motion, channels)


class TestComparison(NamedTuple):
    """Prediction compared with a measurement of r values."""

    values: Any  # predicted, in the time of the measurement and with its gain
    delay: float  # s, measured(t) = predicted(t + delay)
    residuals: Floats  # (r,) differences over the standard deviation
    by_delay: Floats  # (r,) derivatives by the delay, 1/s


class Misfit(NamedTuple):
    """Contribution of a test to the misfit, and the confidence interval of its delay."""

    misfit: float
    misfit_without: float  # misfit of a fit to the other tests alone
    delay_interval: tuple[float, float] = (nan, nan)  # s, ends of the interval


@dataclass(frozen=True)
class Test:
    """What all kinds of tests share: a measurement with its name, probe and quantity."""

    __test__ = False  # keep pytest from collecting this class

    number: int  # index in the list of the scenario
    name: str
    probe: str
    quantity: str
    noise_known: bool
    fits_delay: bool  # whether the delay is fitted
    treatment: str  # what was done to the record, in words

    @property
    def uninformative_count(self) -> int:
        """Number of degrees of freedom that are spent on delay and offset instead of parameters."""
        return int(self.fits_delay)

    def fit_warnings(self, prediction: Prediction) -> list[str]:
        """Warn if the motion does not reach the snubbers."""
        if prediction.makes_contact or not prediction.system.snubbers:
            return []
        return [
            f"{self.name}: no contact opens or closes; the motion is linear and contains little information about "
            "the snubber"
        ]

    def fitted_test(
        self, kind: str, misfit: Misfit, delay: float, rows: Mapping[str, Mapping[str, Any]], **more: Any
    ) -> FittedTest:
        """Collect measured and predicted values of this test.

        Parameters
        ----------
        kind, rows, more : see `FittedTest`.
        misfit : contribution of this test to the misfit.
        delay : s, see `TestComparison`.

        Returns
        -------
        FittedTest
        """
        return FittedTest(
            self.name, kind, self.probe, self.quantity, level_unit(self.quantity.removeprefix("absolute_")),
            self.treatment, delay, misfit.delay_interval, misfit.misfit, misfit.misfit_without, rows, **more,
        )  # fmt: skip


class FittedTest(NamedTuple):
    """Measured and predicted values of a test; the variables of `TESTS`."""

    name: str
    kind: str
    probe: str
    quantity: str
    unit: str
    treatment: str
    delay_s: float
    delay_interval: tuple[float, float]
    misfit: float
    misfit_without: float
    rows: Mapping[str, Mapping[str, Any]]  # columns by dimension (harmonic, sample, peak or point) and name
    frequency_hz: float | None = None
    noise: float | None = None
    level: float | None = None
    direction: str | None = None


def tests_dataset(tests: Sequence[FittedTest]) -> Dataset:
    """Build the labelled dataset of tests."""
    values: dict[str, Any] = {"end": ENDS, "delay_interval": np.array([each.delay_interval for each in tests])}
    for dim in ("harmonic", "sample", "peak", "point"):
        owners = [number for number, each in enumerate(tests) if dim in each.rows]
        if owners:
            columns = [tests[number].rows[dim] for number in owners]
            sizes = [len(next(iter(each.values()))) for each in columns]
            values |= {dim: 1 + np.arange(sum(sizes)), f"{dim}_test": np.repeat(owners, sizes)}
            values |= {f"{dim}_{name}": np.concatenate([each[name] for each in columns]) for name in columns[0]}
    return TESTS.table(tests, [{"unit": each.unit} for each in tests], **values)


LEAST_NOISE = 1e-6  # noise of a record without noise, relative to its range


@dataclass(frozen=True)
class Transient(Test):
    """Record of a motion that begins at t = 0."""

    record: MeasuredSignal  # n samples over the time since the stated beginning
    preparation: RecordPreparation  # filter of the record, applied to the predicted motion too
    sigma: float
    noise_stated: bool  # True if the scenario states the noise
    duration: float  # s, of the run
    delay_range: float  # s, how much earlier or later the motion may begin

    @classmethod
    def of(cls, number: int, test: TransientTest, signal: MeasuredSignal, probe: str) -> Transient:
        """Cut a record to the part that is compared.

        Parameters
        ----------
        number : index of the test in the list of the scenario.
        test, signal : the section of the test, and its record in SI units, unfiltered.
        probe : name of the probe where it was measured.

        Returns
        -------
        Transient

        Raises
        ------
        InputFileError
            If the signal is a spectrum, is too short or constant, or its filter does not suit it.
        """
        if signal.is_over_frequency:
            raise InputFileError("is a spectrum", "give the record over time")
        time = signal.x - signal.x[0] - test.begin
        part = (time >= 0.0) & (time <= (test.duration or np.inf))
        if part.sum() < FEWEST_SAMPLES:
            message = f"has {part.sum()} samples after begin = {test.begin:g} s, and {FEWEST_SAMPLES} are needed"
            raise InputFileError(message, "check begin, which counts from the first sample, or give a longer duration")
        free, duration = test.phase == "free", float(time[part][-1])
        reach = DELAY_SHARE * duration if free else 0.0
        part &= time <= duration - reach  # the run is as long as the record, which may have begun earlier
        preparation = RecordPreparation(remove=test.remove, high_pass=test.high_pass)
        values = np.asarray(signal.y, dtype=float)
        prepared = condition(record := replace(signal, x=time[part], y=values[part]), preparation)
        measured = prepared.y
        scatter = white_noise(values)
        largest = float(np.ptp(measured))
        sigma = max(scatter, LEAST_NOISE * largest)
        if test.noise is not None:
            sigma = test.noise * float(np.abs(measured).max())
        if largest == 0.0:
            raise InputFileError("does not change", "check channel, begin and duration")
        return cls(
            number, test.label, probe, test.quantity, True, free, "; ".join(prepared.scaling), record, preparation,
            sigma, test.noise is not None, duration, reach,
        )  # fmt: skip

    @property
    def time(self) -> Floats:
        """(n,) time since the stated beginning, s."""
        return self.record.x

    @cached_property
    def measured(self) -> Floats:
        """(n,) filtered record."""
        return self.prepare(np.asarray(self.record.y, dtype=float))

    def prepare(self, values: Floats) -> Floats:
        """Filter values (n,) as the record is filtered; the same linear operation for measurement and motion."""
        return np.asarray(condition(replace(self.record, y=values), self.preparation).y)

    def beginning(self, share: float) -> Self:
        """Copy with the beginning of the record, at least as long as the filter needs."""
        least = FEWEST_SAMPLES
        if self.preparation.high_pass is not None:
            interval = float(self.time[-1] - self.time[0]) / (self.time.size - 1)
            least = max(least, int(PERIODS_OF_FILTER / (self.preparation.high_pass * interval)) + 3)
        count = max(int(share * self.time.size), min(least, self.time.size))
        cut = float(self.time[-1] - self.time[count - 1])
        record = replace(self.record, x=self.time[:count], y=self.record.y[:count])
        return replace(self, record=record, duration=self.duration - cut)

    def with_fit_noise(self, misfit: float, parameters: int) -> Self:
        """Copy with the noise re-estimated from the fit residual, where the noise is not stated.

        Parameters
        ----------
        misfit : sum of squared weighted residuals of this test.
        parameters : number of fitted parameters.
        """
        left = misfit / max(self.size - self.uninformative_count - parameters, 1)
        return (
            self
            if self.noise_stated or left > NOISE_MARGIN
            else replace(self, sigma=self.sigma * max(left, 1e-24) ** 0.5)
        )

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.time.size

    @property
    def uninformative_count(self) -> int:
        """Two: the delay and the offset of the record."""
        return super().uninformative_count + 1

    def case(self, scenario: Scenario) -> Scenario:
        """The scenario with the excitation and the start of this test."""
        test, run = of_kind(TransientTest, fit_of(scenario).tests[self.number]), scenario.run
        start = test.start or ("static_equilibrium" if run is None else run.start)
        excitation = scenario.excitation if test.excitation is None else test.excitation
        case = scenario.model_copy(update={"excitation": excitation, "run": Run(duration=self.duration, start=start)})
        return case.with_source(scenario.source)  # without the text, whose lines belong to other sections

    def predict(self, case: Scenario, neighbour: Prediction | None, builds: SharedBuilds) -> Prediction:
        """Compute the exact motion.

        Parameters
        ----------
        case : scenario with the values of the parameters.
        neighbour : prediction for neighbouring values; not used for transients.
        builds : cache of built systems.

        Returns
        -------
        Prediction

        Raises
        ------
        UnpredictableError
            If the motion has too many events.
        """
        test, at = fit_of(case).tests[self.number], f"identify_stiffness.nonlinear.tests[{self.number}]"
        with ExitStack() as places:
            for key, section in {"excitation": "excitation", "start": "run.start"}.items():
                if getattr(test, key) is not None:
                    places.enter_context(prefix_problems(section, f"{at}.{key}"))
            system = build_system(case, builds, with_stations=False)
        if system.cubic is not None:
            raise UnpredictableError("cubic springs have no exact flow")
        motion = simulate(exact_flow(system, self.duration), system.initial_state, max_events=MOST_EVENTS)
        if not motion.outcome.complete:
            raise UnpredictableError(f"{self.name}: {motion.outcome.text}")
        return Prediction(system, motion, motion.event_time.size > 0)

    def compare(self, prediction: Prediction, gain: float, neighbour: TestComparison | None) -> TestComparison:
        """Compare a prediction with the measurement at the best-fitting delay.

        Parameters
        ----------
        prediction : prediction of this test.
        gain : gain of the channel.
        neighbour : comparison for neighbouring parameters; the search begins at its delay. None: over the whole range.

        Returns
        -------
        TestComparison
        """
        delay, motion = 0.0 if neighbour is None else neighbour.delay, prediction.motion
        channels = prediction.system.channels.of_keys(("probes", self.quantity))
        channels = channels.select(lambda channel: channel.name == self.probe)

        def values(delay: float) -> Floats:
            times = self.time + delay
            found = channel_values(motion, channels, np.clip(times, 0.0, motion.end))[:, 0]
            return gain * np.where((times < 0.0) & (self.quantity != "displacement"), 0.0, found)

        def residuals(predicted: Floats) -> Floats:
            difference = (self.prepare(predicted) - self.measured) / self.sigma
            return np.asarray(difference - difference.mean())

        interval = float(np.median(np.diff(self.time)))
        step = 1e-4 * interval

        def slopes(delay: float) -> Floats:
            change = self.prepare(values(delay + step) - values(delay - step))
            return np.asarray((change - change.mean()) / (2.0 * step * self.sigma))

        def rest(samples: Floats) -> Floats:
            return residuals(values(samples[0] * interval))

        def slope(samples: Floats) -> Floats:
            return slopes(samples[0] * interval)[:, None] * interval

        if self.fits_delay:
            from scipy.optimize import least_squares

            if neighbour is None:
                grid = np.arange(-self.delay_range, self.duration + interval, interval)
                known = gain * channel_values(motion, channels, np.clip(grid, 0.0, motion.end))[:, 0]
                tried = np.linspace(-self.delay_range, self.delay_range, 401)
                misfits = [np.sum(residuals(np.interp(self.time + late, grid, known)) ** 2) for late in tried]
                delay = float(tried[np.argmin(misfits)])
            found = least_squares(rest, [delay / interval], slope, xtol=1e-9, ftol=1e-12, gtol=None)
            delay = float(found.x[0]) * interval
        predicted = values(delay)
        shown = self.prepare(predicted)
        zero = float(np.mean(self.measured - shown))
        by_delay = slopes(delay) if self.fits_delay else shown * 0.0
        return TestComparison(shown + zero, delay, residuals(predicted), by_delay)

    def summarise_fit(self, misfit: Misfit, initial: TestComparison, fitted: TestComparison) -> FittedTest:
        """Collect its contribution to the misfit, and the comparisons before and after the fit.

        Parameters
        ----------
        misfit : contribution of this test to the misfit.
        initial, fitted : comparison at the scenario's values, and at the estimate.
        """
        samples = {
            "time": self.time, "measured": self.measured, "initial": initial.values, "predicted": fitted.values,
        }  # fmt: skip
        return self.fitted_test("transient", misfit, fitted.delay, {"sample": samples}, noise=self.sigma)


def fit_of(scenario: Scenario) -> NonlinearFit:
    """The section of the nonlinear fit, which must exist."""
    return not_none(not_none(scenario.identify_stiffness).nonlinear)


_EXACT = Settings(iterations=15)
_NEIGHBOUR_DISTANCE = 2e-2  # search distance around a feature of a neighbouring model, in the scale of a branch
_PARABOLA_STEP = 1e-3  # distance of the motions that define a peak as a parabola, in the scale of a branch


class Feature(NamedTuple):
    """Special point of a branch that a sweep shows."""

    kind: str  # jump, landing (after a jump), top, or start
    point: BranchPoint


MOST_STEPS = 20  # steps of `_APART` in one go


@dataclass
class _Curve:
    """Branch of periodic motions of a model, with the features and peaks that a sweep shows."""

    orbits: ForcedOrbits
    measurement: Measurement
    channels: tuple[int, ...]  # channel of each peak, among the measured ones
    test: SweepTest

    @property
    def direction_sign(self) -> float:
        """1 if the frequency rises, else -1."""
        return 1.0 if self.test.direction == "up" else -1.0

    @cached_property
    def points(self) -> tuple[BranchPoint, ...]:
        """Branch between the two end frequencies of a sweep, in its direction."""
        low, high = 2 * np.pi * self.test.from_, 2 * np.pi * self.test.to
        found = trace_range(Tracer(self.orbits, (0.5 * low, 2.0 * high)), low, high, Budget(4000, np.inf))
        pieces = [piece for branch in found for piece in cut(branch, low, high)]
        whole = [piece for piece in pieces if piece.span[0] <= low * (1 + 1e-9) and piece.span[1] >= high * (1 - 1e-9)]
        if not whole:
            raise UnpredictableError("the branch of periodic motions does not reach from one frequency to the other")
        points = tuple(whole[0].points)
        return points if (points[-1].parameter - points[0].parameter) * self.direction_sign > 0 else points[::-1]

    def heights(self, point: BranchPoint) -> Floats:
        """Values of the measured peaks at a point."""
        return self.measurement.of_flow_map(*self.orbits.cycle(point)).peak[list(self.channels)]

    def step_along_branch(self, point: BranchPoint, distance: float) -> BranchPoint:
        """Motion at a distance along the tangent of a point."""
        t, guess = point.tangent, point.u + distance * point.scale * point.tangent
        found = correct(self.orbits, Predictor(guess, t, point.scale, t), _EXACT)
        if found is None:
            raise UnpredictableError("a motion next to a peak or jump was not found")
        return found

    def fold(self, a: BranchPoint, b: BranchPoint) -> BranchPoint | None:
        """Locate the fold between two points."""
        return BranchStep(self.orbits, a, b, _EXACT).locate(lambda p: float(p.tangent[-1]))

    def top(self, point: BranchPoint, peak: int) -> BranchPoint | None:
        """Locate the largest peak near a point by parabolas through three motions; None if there is none."""
        for _ in range(_EXACT.iterations):
            sides = [self.heights(self.step_along_branch(point, side * _PARABOLA_STEP))[peak] for side in (-1.0, 1.0)]
            slope, bend = sides[1] - sides[0], sides[0] + sides[1] - 2.0 * self.heights(point)[peak]
            if bend >= 0.0:
                return None
            away = -0.5 * slope / bend
            point = self.step_along_branch(point, _PARABOLA_STEP * float(np.clip(away, -MOST_STEPS, MOST_STEPS)))
            if abs(away) < 1.0:
                return point
        return None

    def landing(self, neighbour: BranchPoint, frequency: float) -> BranchPoint:
        """Motion right after a jump, at the frequency of the jump."""
        point = solve_at(self.orbits, neighbour.u, _EXACT, frequency)
        if point is None:
            raise UnpredictableError("the motion after a jump was not found")
        return point

    def matching_feature(self, feature: Feature, jump: Feature | None, peak: int = 0) -> Feature:
        """Locate the feature that corresponds to a feature of a neighbouring model."""
        if feature.kind == "jump" and jump is not None:
            return jump
        centre = correct_across(self.orbits, feature.point.u, _EXACT) if feature.kind in ("jump", "top") else None
        found: BranchPoint | None = None
        if feature.kind == "landing" and jump is not None:
            found = self.landing(feature.point, jump.point.parameter)
        elif feature.kind == "start":
            found = solve_at(self.orbits, feature.point.u, _EXACT)
        elif centre is not None and feature.kind == "jump":
            found = self.fold(*(self.step_along_branch(centre, side * _NEIGHBOUR_DISTANCE) for side in (-1.0, 1.0)))
        elif centre is not None:
            found = self.top(centre, peak)
        if found is None or (feature.kind == "top" and _determinant(found) * _determinant(feature.point) < 0):
            raise UnpredictableError("a peak or jump next to a known one was not found, or lies beyond a fold")
        return Feature(feature.kind, found)

    @cached_property
    def swept_parts(self) -> tuple[list[list[Feature]], Feature | None]:
        """Parts of the branch that a sweep follows, each with its ends as features, and the first jump."""
        parts, part, first = list[list[Feature]](), list[Feature](), None
        way, rest = self.direction_sign, iter(pairwise(self.points))
        for a, b in rest:
            part.append(Feature("start", a))
            if (b.parameter - a.parameter) * way > 0 and float(b.tangent[-1]) * float(a.tangent[-1]) > 0:
                continue
            fold = self.fold(a, b)
            if fold is None:
                raise UnpredictableError("a fold of the branch was not located")
            parts, part = [*parts, [*part, Feature("jump", fold)]], []
            first = first or parts[-1][-1]
            for c, d in rest:  # up to where the branch passes the frequency of the fold again
                if (c.parameter - fold.parameter) * way <= 0 < (d.parameter - fold.parameter) * way:
                    part.append(Feature("landing", self.landing(c, fold.parameter)))
                    break
            else:
                raise UnpredictableError("after a jump there is no motion within from and to: give a wider range")
        return [*parts, [*part, Feature("start", self.points[-1])]], first

    def highest(self) -> tuple[Feature, ...]:
        """Features where each peak is largest, on the parts that a sweep follows."""
        places = [(part, k) for part in self.swept_parts[0] for k in range(len(part))]
        heights = np.array([self.heights(part[k].point) for part, k in places])
        return tuple(self._highest(places[at], peak) for peak, at in enumerate(np.argmax(heights, axis=0)))

    def _highest(self, place: tuple[Sequence[Feature], int], peak: int) -> Feature:
        part, k = place
        inner = part[max(k - 1, 0)].point, part[min(k + 1, len(part) - 1)].point
        found = self.top(part[k].point, peak)
        inside = found is not None and 0.0 <= BranchStep(self.orbits, *inner).share(found) <= 1.0
        return Feature("top", found) if found is not None and inside else part[k]


def _determinant(point: BranchPoint) -> float:
    """Number that changes its sign only at folds: the sign of the determinant of the derivative by the state."""
    return point.orientation * float(point.tangent[-1])


def sweeps_of(test: SweepTest, folder: Path, probes: Sequence[str]) -> list[SweepTest]:
    """Tests from the rows of a test's file, or the test itself if it has no file.

    Parameters
    ----------
    test : of the scenario.
    folder : folder that the path of the file is relative to.
    probes : names of probes that headings of peaks may begin with.

    Returns
    -------
    list of SweepTest
        With names from the file, or numbered; settings missing from the file are taken from ``test``.

    Raises
    ------
    InputFileError
        If the file cannot be read, or a row is not a valid test; the message gives the line.
    """
    if test.file is None:
        return [test]
    path = folder / test.file
    ending_of(path)  # reading fails early if the file does not exist
    with reading(path, "a table of sweeps"):
        table = read_named_columns(path, test.decimal, texts=("name", "direction"))
    columns = [(*split_heading(heading), heading) for heading in table.headings]
    tests = []
    for number, row in enumerate(table.rows, 1):
        keys: dict[str, Any] = {"kind": "sweep", "name": f"{test.name} {number}", "from": test.from_, "to": test.to}
        peaks = dict[str, dict[str, str]]()
        for (name, unit, written), cell in zip(columns, row.cells, strict=True):
            probe, _, key = name.replace("absolute acc", "absolute_acc").rpartition(" ")
            if not unit and name not in ("name", "direction"):
                raise InputFileError(f"states no unit in its heading {written}", "write for example jump (Hz)")
            if probe not in ("", *probes):
                raise InputFileError(f"names no probe in its heading {written}", f"probes are {', '.join(probes)}")
            value = f"{cell} {unit}".rstrip()
            of_test = not probe and key in ("name", "level", "direction", "from", "to", "rate", "jump", "scatter")
            if cell:
                (keys if of_test else peaks.setdefault(probe, {"probe": probe} if probe else {}))[key] = value
        try:
            sweep = SweepTest.model_validate({"scatter": test.scatter, **keys, "peaks": [*peaks.values()]})
        except ValidationError as error:
            at, message, remedy = describe(SweepTest, error.errors(include_url=False)[0])
            raise InputFileError(f"line {row.line}: {path_text(at)} {message}", remedy) from None
        tests.append(test.model_copy(update={key: getattr(sweep, key) for key in sweep.model_fields_set}))
    return tests


@dataclass(frozen=True)
class SweepPrediction(Prediction):
    """Prediction of a slow sweep; ``motion`` is the one of its largest peak."""

    curve: _Curve
    jump: Feature | None
    peak_features: tuple[Feature, ...]  # one for each measured peak
    predicted: Floats  # (r,) predicted values, with a gain of 1
    bandwidth: float  # Hz, half-power bandwidth from the decay at the largest peak


@dataclass(frozen=True)
class SweptPeaks(Test):
    """Measured peaks and jump of a slow sweep at one level in one direction."""

    labels: tuple[str, ...]  # of each value: "jump", "frequency of ..." or "peak of ..."
    measured: Floats  # (r,) Hz, or units of the peaks
    sigma: Floats  # (r,)
    test: SweepTest
    peak_channels: tuple[tuple[str, str], ...]  # probe and quantity of each peak

    @classmethod
    def of(cls, number: int, test: SweepTest, probe: str) -> SweptPeaks:
        """Create the test from a row of a table.

        Parameters
        ----------
        number : index of the test in the list of the scenario.
        test : section of the test.
        probe : probe of peaks that name none.
        """
        rows = [] if test.jump is None else [("jump", test.jump, test.scatter)]
        places = []
        for peak in test.peaks:
            name = peak.probe or probe
            places.append((name, peak.quantity))
            if peak.frequency is not None:
                rows.append((f"frequency of {name}", peak.frequency, test.scatter))
            rows.append((f"peak of {name}", peak.value, peak.scatter * peak.value))
        what, measured, sigma = zip(*rows, strict=True)
        places = places or [(probe, "displacement")]  # for the picture
        return cls(
            number,
            test.label,
            *places[0],
            True,
            False,
            "",
            what,
            np.array(measured),
            np.array(sigma),
            test,
            tuple(places),
        )

    @property
    def size(self) -> int:
        """Number of measured values."""
        return self.measured.size

    def case(self, scenario: Scenario) -> Scenario:
        """The scenario at the level of this test."""
        harmonic, test = of_kind(Harmonic, scenario.excitation), of_kind(SweepTest, fit_of(scenario).tests[self.number])
        level = self.test.level if test.file else test.level
        return scenario.model_copy(update={"excitation": harmonic.at(test.to, level), "run": None})

    def predict(self, case: Scenario, neighbour: Any, builds: SharedBuilds) -> SweepPrediction:
        """Compute jump and peaks; see `Transient.predict`."""
        test, curve = self.test, self._curve(case, builds)
        try:
            found = None if neighbour is None else self._matching_features(curve, neighbour)
            jump, tops = found or self._features_of_branch(curve)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise UnpredictableError(f"{self.name}: {error}") from error
        numbers = [] if test.jump is None or jump is None else [jump.point.parameter / (2 * np.pi)]
        for k, (peak, top) in enumerate(zip(test.peaks, tops, strict=False)):
            numbers += [] if peak.frequency is None else [top.point.parameter / (2 * np.pi)]
            numbers.append(float(curve.heights(top.point)[k]))
        multipliers, (flow, flow_map) = curve.orbits.multipliers(tops[0].point), curve.orbits.cycle(tops[0].point)
        bandwidth = -float(np.log(np.abs(multipliers).max())) / (np.pi * flow_map.duration)
        touching, motion = flow_map.event_time.size > 0, flow_map.trajectory(of_kind(VariationalFlow, flow).exact)
        system = curve.measurement.system
        return SweepPrediction(system, motion, touching, curve, jump, tops, np.array(numbers), bandwidth)

    def _curve(self, case: Scenario, builds: SharedBuilds) -> _Curve:
        """Branch of a case, with the channels that are measured along it."""
        system, harmonic = build_system(case, builds, with_stations=False), of_kind(Harmonic, case.excitation)
        if system.cubic is not None:
            raise UnpredictableError("cubic springs have no exact flow")
        omega, loads = 2 * np.pi * harmonic.frequency, periodic_forcing(case, system)
        orbits = ForcedOrbits(VariationalFlow(system.dynamics, loads, omega, harmonic.level), "frequency")
        keys = dict.fromkeys(("probes", quantity) for _, quantity in (*self.peak_channels, ("", "displacement")))
        channels = system.channels.of_keys(*keys)
        columns = {(each.name, each.quantity): k for each, k in channels.first_columns}
        return _Curve(
            orbits,
            Measurement(system, harmonic, channels, 1),
            tuple(columns[at] for at in self.peak_channels),
            self.test,
        )

    @staticmethod
    def _matching_features(
        curve: _Curve, neighbour: SweepPrediction
    ) -> tuple[Feature | None, tuple[Feature, ...]] | None:
        """Jump and peaks that correspond to those of a neighbouring model; None if they are not found."""
        with suppress(ArithmeticError, np.linalg.LinAlgError):
            jump = None if neighbour.jump is None else curve.matching_feature(neighbour.jump, None)
            return jump, tuple(curve.matching_feature(top, jump, k) for k, top in enumerate(neighbour.peak_features))
        return None

    def _features_of_branch(self, curve: _Curve) -> tuple[Feature | None, tuple[Feature, ...]]:
        """Jump and peaks from the complete branch."""
        _, jump = curve.swept_parts
        if self.test.jump is not None and jump is None:
            raise UnpredictableError(f"{self.name}: the model does not jump")
        return jump, curve.highest()

    def compare(self, prediction: Any, gain: float, neighbour: TestComparison | None) -> TestComparison:
        """Compare predicted values with the table; see `Transient.compare`."""
        heights = np.array([what.startswith("peak") for what in self.labels])
        numbers = prediction.predicted * np.where(heights, gain, 1.0)
        residuals = (numbers - self.measured) / self.sigma
        return TestComparison(replace(prediction, predicted=numbers), 0.0, residuals, np.zeros(self.size))

    def summarise_fit(self, misfit: Misfit, initial: TestComparison, fitted: TestComparison) -> FittedTest:
        """See `Transient.summarise_fit`."""
        prediction: SweepPrediction = fitted.values
        curve = prediction.curve
        peaks = {
            "what": self.labels, "measured": self.measured, "noise": self.sigma, "initial": initial.values.predicted,
            "predicted": prediction.predicted,
        }  # fmt: skip
        branch = {
            "frequency_hz": np.array([point.parameter for point in curve.points]) / (2 * np.pi),
            "peak": np.array([curve.heights(point)[0] for point in curve.points]),
        }
        rows = {"peak": peaks, "point": branch}
        return self.fitted_test(
            "sweep", misfit, fitted.delay, rows, level=curve.orbits.level, direction=self.test.direction
        )

    def _unstable(self, prediction: SweepPrediction) -> float | None:
        """Frequency of the first unstable motion on the part that a sweep follows, Hz; None if there is none."""
        curve, jump = prediction.curve, prediction.jump
        ends = [*(prediction.peak_features if self.test.peaks else ()), *([jump] if jump and self.test.jump else [])]
        last = max(curve.direction_sign * end.point.parameter for end in ends)
        inner = [f for part in curve.swept_parts[0] for f in part if f.kind == "start"]
        inner += [
            top for top in prediction.peak_features if top.kind == "top"
        ]  # at folds round-off decides on stability
        lost = [curve.direction_sign * f.point.parameter for f in inner if not curve.orbits.orbit(f.point).stable]
        first = min(lost, default=np.inf)
        return curve.direction_sign * first / (2 * np.pi) if first <= last else None

    def fit_warnings(self, prediction: Any) -> list[str]:
        """Warn if a real sweep would not show the prediction.

        Reasons: a peak directly after a jump, an unstable motion, or a sweep rate above 0.1 times the squared bandwidth
        (limit found by integrated sweeps).
        """
        warnings, most = [], 0.1 * prediction.bandwidth**2
        hertz = 0.0 if self.test.rate is None else self.test.rate.value
        if self.test.rate is not None and self.test.rate.unit == "oct/s":
            hertz *= np.log(2.0) * prediction.peak_features[0].point.parameter / (2 * np.pi)
        if self.test.peaks and any(top.kind == "landing" for top in prediction.peak_features):
            warnings.append(
                "its peak comes directly after the jump, where the motion overshoots at any sweep rate; give the "
                "amplitude to which it settles there, or leave peaks out"
            )
        if (lost := self._unstable(prediction)) is not None:
            warnings.append(
                f"the motion at {lost:.4g} Hz is not stable: the sweep leaves the branch before a fold, and what "
                "follows has another period; narrow from and to, or fit the time "
                "history of the sweep as a transient"
            )
        elif hertz > most:
            warnings.append(
                f"{hertz:.3g} Hz/s is fast for a bandwidth of {prediction.bandwidth:.3g} Hz: above {most:.3g} Hz/s "
                "peaks and jumps lag behind those of steady vibrations; fit the time history of the sweep as a "
                "transient"
            )
        return [*super().fit_warnings(prediction), *(f"{self.name}: {each}" for each in warnings)]
