"""Result of the identification, and the findings from which it is assembled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np

from beamsim.analyses.identify.layouts import (
    CURVES,
    FREQUENCIES,
    NONLINEAR,
    PAD,
    PROFILES,
    SENSITIVITIES,
    SHAPES,
    STIFFNESS,
    TESTS,
    UPDATE,
)
from beamsim.labelled import Dataset
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.results.result import Result
from beamsim.scenario.parameters import unit_of
from beamsim.summaries import ByName, Entry, Number, Pair, Plain, Text
from beamsim.typing import Floats, Ints


class ComparedModes(NamedTuple):
    """Measured and predicted natural frequencies of a model."""

    mode: Ints  # (m,) from 1
    measured_hz: Floats  # nan: not measured
    predicted_hz: Floats
    difference_percent: Floats  # 100 (predicted - measured) / measured

    @classmethod
    def of(cls, predicted_hz: Floats, measured_hz: Sequence[float], rigid: int) -> Self:
        """Compare predicted frequencies with measured ones.

        Parameters
        ----------
        predicted_hz : (m,) frequencies from the first mode on, with rigid-body modes.
        measured_hz : frequencies from the first mode that is not a rigid-body mode.
        rigid : number of rigid-body modes.

        Returns
        -------
        ComparedModes
        """
        measured = np.full(predicted_hz.size, np.nan)
        measured[rigid : rigid + len(measured_hz)] = measured_hz[: predicted_hz.size - rigid]
        difference = 100 * (predicted_hz - measured) / measured
        return cls(np.arange(1, predicted_hz.size + 1), measured, predicted_hz, difference)


class ProfileLikelihood(NamedTuple):
    """Profile likelihood of one parameter: misfit with all other parameters fitted again."""

    parameter: str
    value: Floats  # of the parameter, SI units
    misfit: Floats  # chi squared above its minimum


@dataclass(frozen=True)
class Findings:
    """Contribution of one kind of measurements to the result."""

    datasets: Sequence[Dataset]
    summary: Mapping[str, Any]  # entries that are not variables of the datasets
    warnings: Sequence[str] = ()
    profiles: Sequence[ProfileLikelihood] = ()
    modes: Mapping[str, ComparedModes] = field(default_factory=dict)  # by model
    outcome: Outcome = COMPLETE


_SUMMARY = (
    Entry("updated", "", "by parameter of the structure: value, standard deviation and interval, or the support chosen",
             form=dict[str, Plain | str]),
    Entry("supports_tried", "1", "by combination of supports its misfit, chi squared", form=ByName),
    Entry("frequencies_before_hz", "Hz", "predicted natural frequencies before the update", "before the update",
             form=list[Number]),
    Entry("update_misfit", "1", "chi squared before and after the update", "fit", form=Pair),
    Entry("update_eigenvalue_solutions", section="solver", variable="update/evaluations"),
    Entry("frequencies_without_hz", "Hz", "predicted natural frequencies without the snubber", "without the snubber",
             form=list[Number]),
    Entry("measured_without_hz", "Hz", "measured natural frequency", "without the snubber", form=list[Number]),
    Entry("difference_without_percent", "percent", "100 (predicted - measured) / measured", "without the snubber",
             form=list[Number]),
    Entry("mac", variable="shapes/mac"),
    Entry("snubber", "", "name of the snubber", form=Text),
    Entry("method", "", "secular or thesis", "solver", form=Text),
    Entry("fit_to", variable="stiffness/mode"),
    Entry("stiffness_n_per_m", variable="stiffness/stiffness"),
    Entry("standard_deviation_n_per_m", variable="stiffness/standard_deviation"),
    Entry("uncertainty_from", "", "its source: given, scatter (of the modes), or empty if unknown", form=Text),
    Entry("coverage", variable="stiffness/coverage"),
    Entry("interval_n_per_m", variable="stiffness/interval"),
    Entry("interval_first_order_n_per_m", variable="stiffness/interval_first_order"),
    Entry("monte_carlo_standard_deviation_n_per_m", variable="stiffness/monte_carlo_standard_deviation"),
    Entry("monte_carlo_samples", variable="stiffness/monte_carlo_samples"),
    Entry("monte_carlo_interval_n_per_m", variable="stiffness/monte_carlo_interval"),
    Entry("total_standard_deviation_n_per_m", variable="stiffness/total_standard_deviation"),
    Entry("stiffness_by_mode_n_per_m", variable="stiffness/individual"),
    Entry("stiffness_by_mode_interval_n_per_m", variable="stiffness/individual_interval"),
    Entry("reachable_hz", variable="stiffness/reach_hz"),
    Entry("residual", variable="stiffness/residual"),
    Entry("table_slope_n_per_m", variable="stiffness/table_slope", section="table at rest"),
    Entry("table_force_n", section="table at rest", variable="stiffness/table_force"),
    Entry("table_factor", section="table at rest", variable="stiffness/table_factor"),
    Entry("pad_youngs_modulus_pa", "Pa", "Young's modulus of the pad", "pad"),
    Entry("pad_youngs_modulus_interval_pa", "Pa", "confidence interval of Young's modulus of the pad", "pad",
             form=Pair),
    Entry("pad_stiffness_n_per_m", section="pad", variable="pad/stiffness"),
    Entry("pad_stiffness_interval_n_per_m", section="pad", variable="pad/stiffness_interval"),
    Entry("pad_branch_interval_n_per_m", section="pad", variable="pad/branch_interval"),
    Entry("pad_relaxation_time_interval_s", section="pad", variable="pad/time_interval"),
    Entry("pad_branch_stiffness_n_per_m", variable="pad/branch_stiffness", section="pad"),
    Entry("pad_relaxation_time_s", section="pad", variable="pad/relaxation_time"),
    Entry("pad_misfit", section="pad", variable="pad/misfit"),
    Entry("pad_yaml", "", "keys of a snubber with this spring and these branches", "pad", form=Text),
    Entry("eigenvalue_solutions", variable="stiffness/eigenvalue_solutions", section="solver"),
    Entry("frequencies_with_hz", "Hz", "predicted natural frequencies with the snubber", "with permanent contact",
             form=list[Number]),
    Entry("measured_with_hz", "Hz", "measured natural frequency", "with permanent contact", form=list[Number]),
    Entry("difference_with_percent", "percent", "100 (predicted - measured) / measured", "with permanent contact",
             form=list[Number]),
    Entry("sensitivities", "1", "by parameter, relative change of the stiffness for that of the parameter",
             form=ByName),
    Entry("sensitivity_contributions", "1", "by parameter, relative standard deviation of the stiffness by that of the "
             "parameter", form=ByName),
    Entry("estimated", "", "by parameter of the nonlinear fit: value, standard deviation and interval",
             form=dict[str, Plain]),
    Entry("nonlinear_misfit", "1", "chi squared before and after the nonlinear fit", "fit", form=Pair),
    Entry("nonlinear_degrees_of_freedom", section="fit", variable="nonlinear/degrees_of_freedom"),
    Entry("periodic_responses", section="solver", variable="nonlinear/responses"),
    Entry("test_misfits", "1", "by nonlinear test, its part of chi squared, and chi squared of a fit without it",
             form=dict[str, Pair]),
    Entry("test_delays_s", "s", "by nonlinear test whose delay is fitted, it and the ends of its interval",
             form=dict[str, list[Number]]),
    Entry("starts_agreeing", "1", "starting points that reached the best minimum, and all of them", "fit", form=Pair),
    Entry("processor_time_s", "s", "processor time", "solver"),
)  # fmt: skip


class IdentificationResult(Result):
    """Result of `beamsim.identify_stiffness`: the identified numbers with their intervals, and how well they fit.

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.identify_stiffness("configs/identify_snubber.yaml")
    >>> stiffness = result["stiffness"]
    >>> print(f"{stiffness['stiffness'].item():.4g} {stiffness['stiffness'].unit}")
    1.536e+05 N/m
    """

    KIND = "identify-stiffness"
    SUMMARY = _SUMMARY
    DATASETS = (
        FREQUENCIES, STIFFNESS, SENSITIVITIES, CURVES, PROFILES, UPDATE, NONLINEAR, TESTS, PAD, SHAPES,
    )  # fmt: skip

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of values whose entry does not name it; see `Result.unit_of`."""
        if entry.name in ("updated", "estimated") and place:
            return unit_of(self.scenario, place[0])
        return super().unit_of(entry, place, keys, record)
