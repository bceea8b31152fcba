r"""Measured records that a model predicts: what every test gives a fit, and transients.

A transient is compared sample by sample with the exact motion of a run,

.. math:: \chi^2 = \sum_i \frac{(m_i - g\,x(t_i + \tau;\theta) - b)^2}{\sigma^2},

where the delay :math:`\tau`, unless it is known, and the zero b of the record are those that fit best with each
:math:`\theta` (variable projection). Unless the noise is stated, it is at most what the median of the squared sixth
differences of the record says, of which white noise has :math:`924\,\sigma^2` in the mean, and what the fit leaves
where that is less.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import nan
from typing import Any, NamedTuple, Self

import numpy as np

from beamsim.analyses.identify.fit import UnpredictableError
from beamsim.analyses.identify.result import TransientFit
from beamsim.analyses.run.exact_motion import exact_flow
from beamsim.errors import rooted
from beamsim.flow.channels import Observed
from beamsim.flow.extrema import Extrema
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.measurements.signal import MeasuredSignal, MeasurementError
from beamsim.scenario import Scenario
from beamsim.scenario.quantities import level_unit
from beamsim.scenario.run import Run
from beamsim.scenario.studies import NonlinearFit, TransientTest
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none, of_kind

MOST_EVENTS = 20_000  # of a transient, in a fit
SOUGHT_SHARE = 0.1  # of the compared duration, by which a motion may begin sooner or later than stated
FEWEST = 20  # samples of a transient
SLACK = 1.2  # factor on the square of the noise, within which the scatter of a few hundred samples has it


@dataclass(frozen=True)
class Prediction:
    """The motion of the model in a test."""

    system: StructuralSystem
    motion: Trajectory
    touching: bool  # whether contact is made and lost

    def extremes(self, quantity: str) -> Extrema:
        """Those of a quantity of every snubber."""
        channels = self.system.channels.of_keys(("snubbers", quantity))
        return Observed(self.motion.flow, channels).extrema(self.motion)


class Compared(NamedTuple):
    """A prediction beside the measurement, whose number of values is r."""

    values: Any  # predicted, in the time of the measurement and with its gain
    delay: float  # s, measured(t) = predicted(t + delay)
    residuals: Floats  # (r,) weighted differences
    by_delay: Floats  # (r,) their derivatives by the delay, 1/s


class Misfit(NamedTuple):
    """What a test has of the misfit, and the interval of its delay."""

    misfit: float
    without: float  # the misfit of a fit to the other tests alone
    delay: tuple[float, float] = (nan, nan)  # s, ends of the interval


@dataclass(frozen=True)
class Test:
    """What kinds of tests have in common: a measurement, ready to be compared."""

    __test__ = False  # not a test case, whatever its name

    number: int  # in the list of the scenario
    name: str
    probe: str
    quantity: str
    noise_known: bool
    free_phase: bool  # whether the delay is fitted

    @property
    def lost(self) -> int:
        """Number of measured values that say nothing of the parameters."""
        return int(self.free_phase)

    def doubts(self, prediction: Prediction) -> list[str]:
        """A warning where the motion says nothing of the snubbers."""
        if prediction.touching or not prediction.system.snubbers:
            return []
        return [
            f"{self.name}: contact is never made and lost; the motion is linear and contains little information about "
            "the snubber"
        ]

    def described(self, part: Misfit, found: Compared) -> dict[str, Any]:
        """The fields that the results of all tests have."""
        unit = level_unit(self.quantity.removeprefix("absolute_"))
        return {
            "name": self.name, "probe": self.probe, "quantity": self.quantity, "unit": unit, "delay_s": found.delay,
            "delay_interval": part.delay, "misfit": part.misfit, "misfit_without": part.without,
        }  # fmt: skip


@dataclass(frozen=True)
class Transient(Test):
    """A record of a motion that begins at t = 0."""

    time: Floats  # (n,) s, since the stated begin
    measured: Floats  # (n,) in SI units
    sigma: float
    stated: bool  # whether the noise is
    duration: float  # s, of the run
    reach: float  # s, how much sooner or later it may begin

    @classmethod
    def of(cls, number: int, test: TransientTest, signal: MeasuredSignal, probe: str) -> Transient:
        """A record cut to what is compared.

        Parameters
        ----------
        number : of the test in the list of the scenario.
        test, signal : what is said of it, and the record in SI units.
        probe : where it was measured.

        Returns
        -------
        Transient

        Raises
        ------
        MeasurementError
            If there is no record over time, or too little of it.
        """
        if signal.of_frequency:
            raise MeasurementError("is a spectrum", "give the record over time")
        time = signal.x - signal.x[0] - test.begin
        part = (time >= 0.0) & (time <= (test.duration or np.inf))
        if part.sum() < FEWEST:
            message = f"has {part.sum()} samples from begin = {test.begin:g} s on, of {FEWEST} at least"
            raise MeasurementError(message, "give begin since the first sample, and a longer duration")
        free, duration = test.phase == "free", float(time[part][-1])
        reach = SOUGHT_SHARE * duration if free else 0.0
        part &= time <= duration - reach  # the run lasts as long as the record, which may have begun sooner
        measured = np.asarray(signal.y, dtype=float)
        scatter = float(np.sqrt(np.median(np.diff(measured, 6) ** 2) / (0.4549 * 924)))  # median of chi^2, see above
        largest = float(np.ptp(measured[part]))
        # 1e-6: least scatter of a record without noise, over its range
        sigma = max(scatter, 1e-6 * largest)
        if test.noise is not None:
            sigma = test.noise * float(np.abs(measured[part]).max())
        if largest == 0.0:
            raise MeasurementError("does not change", "check channel, begin and duration")
        return cls(
            number, test.label, probe, test.quantity, True, free, time[part], measured[part], sigma,
            test.noise is not None, duration, reach,
        )  # fmt: skip

    def first(self, share: float) -> Self:
        """The first part of the record."""
        count = max(int(share * self.time.size), min(FEWEST, self.time.size))
        cut = float(self.time[-1] - self.time[count - 1])
        return replace(self, time=self.time[:count], measured=self.measured[:count], duration=self.duration - cut)

    def sharpened(self, misfit: float, parameters: int) -> Self:
        """With the noise that a fit of so many parameters leaves, where the record alone does not tell it as well."""
        left = misfit / max(self.size - self.lost - parameters, 1)
        return self if self.stated or left > SLACK else replace(self, sigma=self.sigma * max(left, 1e-24) ** 0.5)

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.time.size

    @property
    def lost(self) -> int:
        """The delay, and the zero of the record."""
        return super().lost + 1

    def case(self, scenario: Scenario) -> Scenario:
        """The scenario under the excitation and from the start of this test."""
        test, run = of_kind(TransientTest, fit_of(scenario).tests[self.number]), scenario.run
        start = test.start or ("static_equilibrium" if run is None else run.start)
        excitation = scenario.excitation if test.excitation is None else test.excitation
        case = scenario.model_copy(update={"excitation": excitation, "run": Run(duration=self.duration, start=start)})
        return case.with_source(scenario.source)  # without text, where keys would be those of other sections

    def predicted(self, case: Scenario, near: Prediction | None, shared: SharedBuilds) -> Prediction:
        """The exact motion.

        Parameters
        ----------
        case : with values of the parameters.
        near : the prediction for neighbouring values, which does not help.
        shared : what was built before.

        Returns
        -------
        Prediction

        Raises
        ------
        UnpredictableError
            Where it has too many events.
        """
        test, at = fit_of(case).tests[self.number], f"identify_stiffness.nonlinear.tests[{self.number}]"
        with ExitStack() as places:
            for key, section in {"excitation": "excitation", "start": "run.start"}.items():
                if getattr(test, key) is not None:
                    places.enter_context(rooted(section, f"{at}.{key}"))
            system = build_system(case, shared, recovered=False)
        if system.cubic.count:
            raise UnpredictableError("cubic springs have no exact flow")
        motion = simulate(exact_flow(system, self.duration), system.initial_state, max_events=MOST_EVENTS)
        if not motion.outcome.complete:
            raise UnpredictableError(f"{self.name}: {motion.outcome.text}")
        return Prediction(system, motion, motion.event_time.size > 0)

    def compared(self, prediction: Prediction, gain: float, near: Compared | None) -> Compared:
        """The prediction beside the measurement, with the delay that fits best.

        Parameters
        ----------
        prediction : of this test.
        gain : of the channel.
        near : the comparison for neighbouring values, near whose delay that is; else it is anywhere within reach.

        Returns
        -------
        Compared
        """
        delay, motion = 0.0 if near is None else near.delay, prediction.motion
        channels = prediction.system.channels.of_keys(("probes", self.quantity))
        observed = Observed(motion.flow, channels.only(lambda channel: channel.name == self.probe))

        def values(late: float) -> Floats:
            times = self.time + late
            found = observed.values(motion, np.clip(times, 0.0, motion.end))[:, 0]
            return gain * np.where((times < 0.0) & (self.quantity != "displacement"), 0.0, found)

        def residuals(predicted: Floats) -> Floats:
            difference = (predicted - self.measured) / self.sigma
            return np.asarray(difference - difference.mean())

        interval = float(np.median(np.diff(self.time)))
        step = 1e-4 * interval

        def slopes(late: float) -> Floats:
            change = values(late + step) - values(late - step)
            return np.asarray((change - change.mean()) / (2.0 * step * self.sigma))

        def rest(samples: Floats) -> Floats:
            return residuals(values(samples[0] * interval))

        def slope(samples: Floats) -> Floats:
            return slopes(samples[0] * interval)[:, None] * interval

        if self.free_phase:
            from scipy.optimize import least_squares

            if near is None:
                grid = np.arange(-self.reach, self.duration + interval, interval)
                known = gain * observed.values(motion, np.clip(grid, 0.0, motion.end))[:, 0]
                tried = np.linspace(-self.reach, self.reach, 401)
                misfits = [np.sum(residuals(np.interp(self.time + late, grid, known)) ** 2) for late in tried]
                delay = float(tried[np.argmin(misfits)])
            found = least_squares(rest, [delay / interval], slope, xtol=1e-9, ftol=1e-12, gtol=None)
            delay = float(found.x[0]) * interval
        predicted = values(delay)
        zero, by_delay = (
            float(np.mean(self.measured - predicted)),
            slopes(delay) if self.free_phase else predicted * 0.0,
        )
        return Compared(predicted + zero, delay, residuals(predicted), by_delay)

    def fitted(self, part: Misfit, before: Compared, found: Compared) -> TransientFit:
        """The result: its part of the misfit, and the comparison with the scenario's and with the estimated values."""
        return TransientFit(
            **self.described(part, found), time=self.time, measured=self.measured, noise=self.sigma,
            before=before.values, predicted=found.values,
        )  # fmt: skip


def fit_of(scenario: Scenario) -> NonlinearFit:
    """The section with the tests, where there is one."""
    return not_none(not_none(scenario.identify_stiffness).nonlinear)
