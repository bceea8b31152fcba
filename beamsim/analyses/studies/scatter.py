"""The numbers that scatter in a study of reliability, with their distributions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.analyses.studies import sampling
from beamsim.analyses.studies.plan import StudyPlan, mixing
from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.files import reading
from beamsim.measurements.columns import column_named, only_column
from beamsim.measurements.tables import read_csv
from beamsim.scenario import Scenario
from beamsim.scenario.base import InvalidValueError, path_text
from beamsim.scenario.parameters import read_as
from beamsim.scenario.studies import (
    LEAST_DATA,
    MeasuredParameter,
    RandomParameter,
    Reliability,
    ScatteredParameter,
    VariedParameter,
)
from beamsim.typing import Floats


class Scatter:
    """The numbers that scatter, as functions of independent standard normal variables."""

    def __init__(self, plan: StudyPlan, vary: Reliability) -> None:
        numbers = plan.study.parameters[: len(vary.parameters)]
        pairs = enumerate(zip(vary.parameters, numbers, strict=True))
        self.data = [_data(plan.scenario, k, *pair) for k, pair in pairs]
        self.numbers = [_distribution(*of) for of in zip(vary.parameters, numbers, self.data, strict=True)]
        self.means = np.array([number.getMean()[0] for number in self.numbers])
        self.deviations = np.array([number.getStandardDeviation()[0] for number in self.numbers])
        self.mixing = mixing([number.path for number in numbers], vary.correlations)
        if numbers:
            joint = sampling.library().JointDistribution(self.numbers)
            self._standard = joint.getIsoProbabilisticTransformation()
            self._inverse = joint.getInverseIsoProbabilisticTransformation()

    def values(self, u: Floats) -> Floats:
        """(n, d) values of the numbers."""
        return np.asarray(self._inverse(u @ self.mixing.T)) if self.numbers else u

    def standard(self, x: Floats) -> Floats:
        """(n, d) standard normal variables of values."""
        return np.asarray(np.linalg.solve(self.mixing, np.asarray(self._standard(x)).T).T)

    def shift_changes(self, u: Floats, number: int, by: float) -> Floats:
        """(n, d) by how much the variables (n, d) of values change when the distribution of a number is shifted.

        ``by`` is in its standard deviations.
        """
        x = self.values(u).copy()
        x[:, number] -= by * self.deviations[number]
        return self.standard(x) - u

    def width_changes(self, u: Floats, number: int, by: float) -> Floats:
        """(n, d) the same when the distribution becomes wider about its mean, ``by`` in logarithms."""
        x = self.values(u).copy()
        x[:, number] -= by * (x[:, number] - self.means[number])
        return self.standard(x) - u


def _distribution(declared: RandomParameter, parameter: VariedParameter, data: list[float]) -> Any:
    """The distribution of a number that scatters, one of OpenTURNS."""
    ot, mean, deviation = (
        sampling.library(),
        0.5 * (parameter.low + parameter.high),
        0.5 * (parameter.high - parameter.low),
    )
    if data:
        return ot.KernelSmoothing().build([[x] for x in data])
    if isinstance(declared, ScatteredParameter) and declared.distribution == "lognormal":
        return ot.LogNormalMuSigma(mean, deviation, 0.0).getDistribution()
    if isinstance(declared, ScatteredParameter):
        return ot.Normal(mean, deviation)
    if parameter.distribution == "normal":
        return ot.TruncatedNormal(mean, deviation / 3.0, parameter.low, parameter.high)
    if parameter.spacing == "logarithmic":
        return ot.LogUniform(math.log(parameter.low), math.log(parameter.high))
    return ot.Uniform(parameter.low, parameter.high)


def _data(scenario: Scenario, index: int, declared: RandomParameter, parameter: VariedParameter) -> list[float]:
    """The measured values of parameter ``index``, in SI units; none where it has another distribution."""
    if not isinstance(declared, MeasuredParameter) or not isinstance(declared.data, str):
        return [float(x) for x in parameter.values]
    at = ("vary", "parameters", index, "data")
    try:
        file = scenario.folder_of(*at) / declared.data
        with reading(file, "a text table"):
            columns = read_csv(file, declared.decimal)
        columns = [replace(each, axis="") for each in columns]  # a first column is no axis of values
        if declared.column is None:
            column = only_column(columns, key=path_text((*at[:-1], "column")))
        else:
            column = column_named(columns, declared.column)
        if column.y.size < LEAST_DATA:
            raise InputFileError(f"has {column.y.size} values", f"measure {LEAST_DATA} or more")
        texts = [f"{x!r} {column.unit}".rstrip() for x in column.y.tolist()]
        return [float(read_as(scenario, parameter.places[0], text, at)) for text in texts]
    except InputFileError as fault:
        found = Problem(path_text(at), f"= {declared.data} {fault.message}", fault.remedy)
    except InvalidValueError as fault:
        found = fault.problem(())
    raise scenario.located(ScenarioError(found))
