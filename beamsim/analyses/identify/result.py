"""Results of the identification: frozen dataclasses with shapes and units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.fields import (
    JSON,
    ByName,
    Counter,
    Entry,
    Number,
    Pair,
    Plain,
    Text,
    as_json,
    as_text,
    attribute,
    axis,
    dataset,
    declared,
    ending,
    group,
    key,
    members,
    stored,
    table,
)
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.results.result import Result
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import unit_of
from beamsim.scenario.scenario import stored_scenario
from beamsim.typing import Complexes, Floats, Ints

SCENARIO = as_text(Scenario.to_yaml, stored_scenario)
_MODE = ("mode",)
_USED = (Counter("used_mode", "number of the mode used"),)
_OTHER = Counter("other_parameter", "number of the other parameter")
_ENDS = (Counter("end", "which end of a range", labels=("lower", "upper"), shared=True),)


@declared(along=_MODE)
class FrequencyTable:
    """Measured and predicted natural frequencies, as in tables 1.2 and 1.3 of the thesis."""

    mode: Ints = axis("1", "number of the mode")  # (m,) from 1
    measured_hz: Floats = dataset("Hz", "measured natural frequency")  # nan: not measured
    predicted_hz: Floats = dataset("Hz", "predicted natural frequency")

    @classmethod
    def of(cls, predicted_hz: Floats, measured_hz: Sequence[float], rigid: int) -> FrequencyTable:
        """Predicted frequencies beside the measured ones.

        Parameters
        ----------
        predicted_hz : (m,) from the first mode on, rigid-body modes among them.
        measured_hz : from the first mode that is no rigid-body mode.
        rigid : number of rigid-body modes.

        Returns
        -------
        FrequencyTable
            With nan where nothing was measured.
        """
        measured = np.full(predicted_hz.size, np.nan)
        measured[rigid : rigid + len(measured_hz)] = measured_hz[: predicted_hz.size - rigid]
        return cls(np.arange(1, predicted_hz.size + 1), measured, predicted_hz)

    @property
    @stored(dataset("percent", "100 (predicted - measured) / measured"))
    def difference_percent(self) -> Floats:
        """(m,) 100 (predicted - measured) / measured."""
        return 100 * (self.predicted_hz - self.measured_hz) / self.measured_hz


@declared
class StiffnessEstimate:
    """A snubber's stiffness with its uncertainty."""

    snubber: str = attribute("", "name of the snubber")
    method: str = attribute("", "secular or thesis")
    stiffness: float = attribute("N/m", "stiffness of the snubber")
    fit_to: tuple[int, ...] = dataset("1", "numbers of the modes used", along=_USED)
    individual: Floats = dataset(
        "N/m", "stiffness from each of these modes alone; NaN where it is out of reach", along=_USED
    )
    individual_interval: Floats = dataset(
        "N/m", "confidence interval of each of these; NaN where it is not known", along=(*_USED, *_ENDS)
    )
    reach_hz: Floats = dataset(
        "Hz", "for each of these modes the range of frequencies that a stiffness can reach", along=(*_USED, *_ENDS)
    )
    condition: Floats = dataset(
        "1", "k df/dk / f of each of these modes: relative change in f for one in k", along=_USED
    )
    residual: float = attribute("1", "root mean square of (predicted - measured) / measured over the modes used")
    standard_deviation: float = attribute("N/m", "standard deviation, first order; NaN where no uncertainty is known")
    interval_first_order: tuple[float, float] = attribute("N/m", "confidence interval, first order, symmetric")
    interval: tuple[float, float] = attribute(
        "N/m",
        "confidence interval: for one mode that of its frequency transformed, for several the profile likelihood",
    )
    monte_carlo_standard_deviation: float = attribute("N/m", "standard deviation of Monte Carlo samples")
    monte_carlo_interval: tuple[float, float] = attribute("N/m", "confidence interval by Monte Carlo sampling")
    monte_carlo_samples: int = attribute("1", "number of Monte Carlo samples")
    monte_carlo_unreachable: float = attribute("1", "share of samples that no stiffness explains")
    coverage: float = attribute("1", "probability of the intervals")
    total_standard_deviation: float = attribute(
        "N/m", "standard deviation with the uncertainty of the structure's parameters"
    )
    uncertainty_from: str = attribute("", "given, scatter (of the modes), or empty where it is unknown")
    eigenvalue_solutions: int = attribute("1", "eigenvalue problems solved")
    outcome: Outcome = ending("how the search ended", default=COMPLETE)


@declared
class TableSlope:
    """A force-deflection table where it rests, for comparison with the stiffness of permanent contact."""

    force: float = attribute("N", "contact force at static equilibrium")
    deflection: float = attribute("m", "deflection of the table there")
    segment: int = attribute("1", "number of the segment of the table there, from 1")
    segments: int = attribute("1", "number of segments")
    slope: float = attribute("N/m", "slope of that segment in the scenario")
    factor: float = attribute("1", "identified stiffness over that slope")
    at_a_bend: bool = attribute("", "whether it rests where two segments meet")


_BRANCHES = (Counter("branch", "number of the Maxwell branch, in the order of relaxation times"),)
_CURVE = (Counter("pad_curve", "number of the point of the fitted curve"),)
_SAMPLES = (Counter("pad_measurement", "number of the measurement of the pad"),)


@declared(along=_SAMPLES)
class PadFit:
    """A spring and Maxwell branches fitted to measurements of the pad."""

    kind: str = attribute("", "dynamic (over frequency) or relaxation (over time)")
    stiffness: float = attribute("N/m", "stiffness after a long rest")
    stiffness_interval: tuple[float, float] = attribute("N/m", "its confidence interval; NaN where it is not known")
    misfit: float = attribute("1", "root mean square of the relative errors of the complex stiffness or the relaxation")
    least_misfit: float = attribute("1", "the same with as many branches as there could be")
    branch_stiffness: Floats = dataset("N/m", "stiffness of each branch", along=_BRANCHES)
    branch_interval: Floats = dataset("N/m", "confidence interval of the stiffness", along=(*_BRANCHES, *_ENDS))
    relaxation_time: Floats = dataset("s", "relaxation time of each branch", along=_BRANCHES)
    time_interval: Floats = dataset("s", "confidence interval of the relaxation time", along=(*_BRANCHES, *_ENDS))
    measured_stiffness: Floats = dataset("N/m", "measured storage stiffness, or force over deflection in relaxation")
    fitted_stiffness: Floats = dataset("N/m", "the same of spring and branches")
    curve_at: Floats = dataset("{unit}", "frequency or time of the fitted curve", along=_CURVE)
    curve_stiffness: Floats = dataset("N/m", "storage stiffness or relaxation there", along=_CURVE)
    curve_loss_factor: Floats = dataset("1", "loss factor there; zero in relaxation", along=_CURVE)
    unit: str = attribute("", "unit of curve_at")
    frequency_hz: Floats | None = dataset("Hz", "frequency of each measurement", default=None)
    time: Floats | None = dataset("s", "time of each measurement since the deflection began", default=None)
    measured_loss_factor: Floats | None = dataset("1", "measured loss factor", default=None)
    fitted_loss_factor: Floats | None = dataset("1", "loss factor of spring and branches", default=None)
    ramp: float | None = attribute("s", "time over which the deflection of a relaxation test rises", default=None)
    warnings: tuple[str, ...] = ()

    @property
    def yaml(self) -> str:
        """Keys of a snubber that has this spring and these branches."""
        branches = ", ".join(
            f"{{stiffness: {k:.5g} N/m, relaxation_time: {tau:.4g} s}}"
            for k, tau in zip(self.branch_stiffness, self.relaxation_time, strict=True)
        )
        return f"stiffness: {self.stiffness:.5g} N/m\nmaxwell: [{branches}]"


@declared
class Sensitivity:
    """How the identified stiffness depends on one number of the structure."""

    parameter: str = axis("1", "path of the parameter in the scenario")
    value: float = dataset("1", "value of the parameter, SI units")
    relative: float = dataset("1", "d ln k / d ln p: relative change of the stiffness for that of the parameter")
    uncertainty: float = dataset("1", "relative standard deviation of the parameter")  # nan where not given

    @property
    @stored(dataset("1", "relative standard deviation of the stiffness due to the parameter"))
    def contribution(self) -> float:
        """Relative standard deviation of k that comes from this parameter (nan where unknown)."""
        return abs(self.relative) * self.uncertainty


@declared
class ParameterEstimate:
    """A parameter estimated by a fit."""

    parameter: str = axis("1", "path of the parameter in the scenario")
    before: float = dataset("1", "value in the scenario, SI units")  # of the first item for [*]
    value: float = dataset("1", "estimated value, SI units")
    standard_deviation: float = dataset("1", "standard deviation, SI units")  # nan where unknown
    interval: tuple[float, float] = dataset(
        "1", "lower and upper end of the confidence interval, SI units", along=_ENDS
    )
    bounds: tuple[float, float] = dataset("1", "lower and upper bound of the search, SI units", along=_ENDS)
    prior: float = dataset("1", "relative standard deviation of the prior")  # nan without
    at_bound: bool = dataset("1", "whether the estimate lies on its bound", flags=("inside", "on_its_bound"))


@declared
class ProfileLikelihood:
    """Profile likelihood of one parameter: misfit with all other parameters fitted again."""

    parameter: str = attribute("", "path of the parameter in the scenario")
    value: Floats = axis("1", "{parameter}, SI units")
    misfit: Floats = dataset("1", "chi squared above its minimum, all other parameters fitted again", along=("value",))


@declared
class ModelUpdate:
    """Parameters of the structure from frequencies measured without the snubber."""

    parameters: tuple[ParameterEstimate, ...] = table("", ParameterEstimate)
    choices: dict[str, str] = attribute("", "supports that were chosen, by path", codec=JSON)
    alternatives: tuple[tuple[str, float], ...] = attribute(
        "", "every combination of supports tried, with its misfit", codec=as_json(null=math.inf)
    )
    correlation: Floats = dataset("1", "correlation of the parameters' logarithms", along=("parameter", _OTHER))
    before: FrequencyTable = group("frequencies_before", FrequencyTable)
    after: FrequencyTable = group("frequencies_after", FrequencyTable)
    misfit_before: float = attribute("1", "chi squared with the scenario's values, priors included")
    misfit_after: float = attribute("1", "chi squared with the identified values, priors included")
    profiles: tuple[ProfileLikelihood, ...] = members("profiles", ProfileLikelihood, "profile")
    evaluations: int = attribute("1", "eigenvalue problems solved")
    scenario: Scenario = attribute("", "the scenario with the identified parameters, YAML", codec=SCENARIO)
    warnings: tuple[str, ...] = ()  # stored with those of the result

    @property
    def relative_deviations(self) -> dict[str, float]:
        """Relative standard deviations of the parameters that have one."""
        return {
            p.parameter: p.standard_deviation / p.value for p in self.parameters if np.isfinite(p.standard_deviation)
        }


@declared
class FrequencyCurve:
    """A natural frequency against the stiffness of the spring, for the plot."""

    mode: int = key("number of the mode")
    stiffness: Floats = axis("N/m", "stiffness of the snubber")  # increasing
    frequency_hz: Floats = dataset("Hz", "natural frequency with a spring of that stiffness", along=("stiffness",))


@declared(kw_only=True)
class RecordFit:
    """One nonlinear test."""

    name: str = attribute("", "name of the test")
    probe: str = attribute("", "name of the probe")
    quantity: str = attribute("", "quantity that was measured")
    unit: str = attribute("", "its unit")
    delay_s: float = attribute("s", "measured(t) = predicted(t + delay)")
    treatment: str = attribute("", "what was done to the record, in order")
    delay_interval: tuple[float, float] = dataset(
        "s", "confidence interval of the delay; NaN where it is known", along=_ENDS, default=(math.nan, math.nan)
    )
    misfit: float = attribute("1", "its part of chi squared with the estimated values", default=math.nan)
    misfit_without: float = attribute(
        "1",
        "chi squared of a fit to the other tests alone, to first order; NaN: too few",
        default=math.nan,
    )


@declared(along=("order",), kw_only=True)
class TestFit(RecordFit):
    """One steady vibration: measured and predicted harmonics."""

    __test__ = False  # not a test case, whatever its name

    # harmonics are amplitude e^{i phase} of A sin(2 pi f n t + phase), in the time of the measurement
    frequency_hz: float = attribute("Hz", "frequency of the excitation")
    order: Floats = axis("1", "frequency over excitation frequency")
    measured: Complexes = dataset("{unit}", "measured harmonic")
    noise: Floats = dataset("{unit}", "standard deviation of each part of a measured harmonic")
    before: Complexes = dataset("{unit}", "harmonic predicted with the scenario's values")
    predicted: Complexes = dataset("{unit}", "harmonic predicted with the estimated values")


@declared(along=("time",), kw_only=True)
class TransientFit(RecordFit):
    """One transient: measured and predicted samples."""

    time: Floats = axis("s", "time since the stated begin")
    measured: Floats = dataset("{unit}", "measured")
    noise: float = attribute("{unit}", "standard deviation of a sample")
    before: Floats = dataset("{unit}", "predicted with the scenario's values, with the record's mean")
    predicted: Floats = dataset("{unit}", "predicted with the estimated values, with the record's mean")


@declared(kw_only=True)
class SweepFit(RecordFit):
    """One row of a table of sweeps: measured and predicted peaks and jump, and the branch with the estimated values."""

    level: float = attribute("", "level of the excitation, SI units")
    direction: str = attribute("", "up or down")
    what: tuple[str, ...] = axis("1", "what was measured: a jump, a frequency of a peak, or a peak of a probe")
    measured: Floats = dataset("1", "measured, Hz or units of peaks", along=("what",))
    noise: Floats = dataset("1", "standard deviation, likewise", along=("what",))
    before: Floats = dataset("1", "predicted with the scenario's values, likewise", along=("what",))
    predicted: Floats = dataset("1", "predicted with the estimated values, likewise", along=("what",))
    branch_frequency_hz: Floats = dataset(
        "Hz", "frequency along the branch", along=(Counter("point", "point of the branch"),)
    )
    branch_peak: Floats = dataset(
        "{unit}", "largest magnitude of a period along the branch, of the first peak's channel", along=("point",)
    )


@declared(kw_only=True)
class NonlinearEstimate:
    """Parameters from nonlinear tests."""

    parameters: tuple[ParameterEstimate, ...] = table("", ParameterEstimate)
    correlation: Floats = dataset("1", "correlation of the parameters' logarithms", along=("parameter", _OTHER))
    tests: tuple[TestFit, ...] = members("tests", TestFit, "test", default=())
    transients: tuple[TransientFit, ...] = members("transients", TransientFit, "test", default=())
    sweeps: tuple[SweepFit, ...] = members("sweeps", SweepFit, "test", default=())
    misfit_before: float = attribute("1", "chi squared with the scenario's values")
    misfit: float = attribute("1", "chi squared with the estimated values")
    degrees_of_freedom: int = attribute("1", "measured numbers minus parameters")
    starts: int = attribute("1", "starting points of the search")
    starts_agreeing: int = attribute("1", "starting points that ended in the best minimum")
    profiles: tuple[ProfileLikelihood, ...] = members("profiles", ProfileLikelihood, "profile")
    responses: int = attribute("1", "periodic responses and transients computed")
    processor_time_s: float = attribute("s", "processor time")
    coverage: float = attribute("1", "probability of the intervals")
    warnings: tuple[str, ...] = attribute("", "warnings", codec=JSON)
    outcome: Outcome = ending("how the search ended", default=COMPLETE)

    @property
    def records(self) -> tuple[RecordFit, ...]:
        """All tests."""
        return (*self.tests, *self.transients, *self.sweeps)


_SUMMARY = (
    Entry("updated", "", "by parameter of the structure: value, standard deviation and interval, or the support chosen",
             form=dict[str, Plain]),
    Entry("supports_tried", "1", "by combination of supports its misfit, chi squared", form=ByName),
    Entry("frequencies_before_hz", section="before the update", of="update.before.predicted_hz"),
    Entry("update_misfit", "1", "chi squared before and after the update", "fit", form=Pair),
    Entry("update_eigenvalue_solutions", section="solver", of="update.evaluations"),
    Entry("frequencies_without_hz", "Hz", "predicted natural frequencies without the snubber", "without the snubber",
             "without_snubber.predicted_hz"),
    Entry("measured_without_hz", section="without the snubber", of="without_snubber.measured_hz"),
    Entry("difference_without_percent", section="without the snubber", of="without_snubber.difference_percent"),
    Entry("mac", of="mac"),
    Entry("snubber", of="estimate.snubber"),
    Entry("method", section="solver", of="estimate.method"),
    Entry("fit_to", of="estimate.fit_to"),
    Entry("stiffness_n_per_m", of="estimate.stiffness"),
    Entry("standard_deviation_n_per_m", of="estimate.standard_deviation"),
    Entry("coverage", of="estimate.coverage"),
    Entry("interval_n_per_m", of="estimate.interval"),
    Entry("interval_first_order_n_per_m", of="estimate.interval_first_order"),
    Entry("monte_carlo_standard_deviation_n_per_m", of="estimate.monte_carlo_standard_deviation"),
    Entry("monte_carlo_samples", of="estimate.monte_carlo_samples"),
    Entry("monte_carlo_interval_n_per_m", of="estimate.monte_carlo_interval"),
    Entry("total_standard_deviation_n_per_m", of="estimate.total_standard_deviation"),
    Entry("stiffness_by_mode_n_per_m", of="estimate.individual"),
    Entry("stiffness_by_mode_interval_n_per_m", of="estimate.individual_interval"),
    Entry("reachable_hz", of="estimate.reach_hz"),
    Entry("residual", of="estimate.residual"),
    Entry("table_slope_n_per_m", of="table_slope.slope", section="table at rest"),
    Entry("table_force_n", section="table at rest", of="table_slope.force"),
    Entry("table_factor", section="table at rest", of="table_slope.factor"),
    Entry("pad_youngs_modulus_pa", "Pa", "Young's modulus of the pad", "pad"),
    Entry("pad_youngs_modulus_interval_pa", "Pa", "confidence interval of Young's modulus of the pad", "pad",
             form=Pair),
    Entry("pad_stiffness_n_per_m", section="pad", of="pad.stiffness"),
    Entry("pad_stiffness_interval_n_per_m", section="pad", of="pad.stiffness_interval"),
    Entry("pad_branch_interval_n_per_m", section="pad", of="pad.branch_interval"),
    Entry("pad_relaxation_time_interval_s", section="pad", of="pad.time_interval"),
    Entry("pad_branch_stiffness_n_per_m", of="pad.branch_stiffness", section="pad"),
    Entry("pad_relaxation_time_s", section="pad", of="pad.relaxation_time"),
    Entry("pad_misfit", section="pad", of="pad.misfit"),
    Entry("pad_yaml", "", "keys of a snubber with this spring and these branches", "pad", form=Text),
    Entry("eigenvalue_solutions", of="estimate.eigenvalue_solutions", section="solver"),
    Entry("frequencies_with_hz", "Hz", "predicted natural frequencies with the snubber", "with permanent contact",
             "with_snubber.predicted_hz"),
    Entry("measured_with_hz", section="with permanent contact", of="with_snubber.measured_hz"),
    Entry("difference_with_percent", section="with permanent contact", of="with_snubber.difference_percent"),
    Entry("sensitivities", "1", "by parameter, relative change of the stiffness for that of the parameter",
             form=ByName),
    Entry("sensitivity_contributions", "1", "by parameter, relative standard deviation of the stiffness by that of the "
             "parameter", form=ByName),
    Entry("estimated", "", "by parameter of the nonlinear fit: value, standard deviation and interval",
             form=dict[str, Plain]),
    Entry("nonlinear_misfit", "1", "chi squared before and after the nonlinear fit", "fit", form=Pair),
    Entry("nonlinear_degrees_of_freedom", section="fit", of="nonlinear.degrees_of_freedom"),
    Entry("periodic_responses", section="solver", of="nonlinear.responses"),
    Entry("test_misfits", "1", "by nonlinear test, its part of chi squared, and chi squared of a fit without it",
             form=dict[str, Pair]),
    Entry("test_delays_s", "s", "by nonlinear test whose delay is fitted, it and the ends of its interval",
             form=dict[str, list[Number]]),
    Entry("starts_agreeing", "1", "starting points that ended in the best minimum, and all of them", "fit", form=Pair),
    Entry("processor_time_s", of="processor_time_s", section="solver"),
)  # fmt: skip


@declared(kw_only=True, repr=False)
class IdentificationResult(Result):
    """Result of ``beamsim identify-stiffness``."""

    KIND = "identify-stiffness"
    SUMMARY, DATASET = _SUMMARY, "shapes"

    estimate: StiffnessEstimate | None = group("stiffness", StiffnessEstimate, default=None)
    table_slope: TableSlope | None = group(
        "table_slope", TableSlope, default=None
    )  # of a snubber with a force-deflection table
    with_snubber: FrequencyTable | None = group("modes", FrequencyTable, default=None)
    without_snubber: FrequencyTable = group("modes_without", FrequencyTable)
    sensitivities: tuple[Sensitivity, ...] = table("sensitivity", Sensitivity)
    curves: tuple[FrequencyCurve, ...] = members("curves", FrequencyCurve, "mode")
    profile: ProfileLikelihood | None = group("profile", ProfileLikelihood, default=None)  # of the stiffness
    update: ModelUpdate | None = group("update", ModelUpdate, default=None)
    mac: Floats | None = dataset(
        "1",
        "modal assurance criterion, measured by predicted shapes",
        along=(
            Counter("mac_measured", "number of the measured shape"),
            Counter("mac_predicted", "number of the predicted shape"),
        ),
        default=None,
    )
    nonlinear: NonlinearEstimate | None = group("nonlinear", NonlinearEstimate, default=None)
    pad: PadFit | None = group("pad", PadFit, default=None)
    pad_modulus: float = attribute(
        "Pa", "Young's modulus of the pad; NaN without one", name="pad_youngs_modulus_pa",
        default=float("nan"),
    )  # fmt: skip
    processor_time_s: float = attribute("s", "processor time", default=0.0)

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """That of values which the name does not say; see `Result.unit_of`."""
        if entry.name in ("updated", "estimated") and place:
            return unit_of(self.scenario, place[0])
        return super().unit_of(entry, place, keys, record)
