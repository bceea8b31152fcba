"""How likely it is that limits are exceeded: what scatters, the limit state of histories, and the methods."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.studies import sampling
from beamsim.analyses.studies.layouts import RANDOM_NUMBERS, ROUNDS
from beamsim.analyses.studies.plan import StudyPlan, mixing
from beamsim.analyses.studies.result import StudyResult
from beamsim.analyses.studies.table import costs
from beamsim.cases import Ended, Evaluator, probability
from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.files import reading
from beamsim.labelled import Dataset
from beamsim.measurements.columns import column_named, only_column
from beamsim.measurements.tables import read_csv
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Progress, tell
from beamsim.scenario import Scenario
from beamsim.scenario.base import Unfit, path_text
from beamsim.scenario.excitation import MatchedInput, RandomInput
from beamsim.scenario.parameters import read_as
from beamsim.scenario.studies import (
    LEAST_DATA,
    Measured,
    RandomParameter,
    Reliability,
    Scattered,
    VariedParameter,
    inputs_with_seed,
)
from beamsim.typing import Bools, Floats, of_kind

FAILED = -1.0  # of the limit state: a history without result counts as one that exceeds the limits
SHIFT = 1e-4  # of a standard deviation, for derivatives
SURE = 3.0  # standard deviations by which two estimates may differ
OTHER_METHOD = "write method: importance_sampling"


class Scatter:
    """The numbers that scatter, as functions of independent standard normal variables."""

    def __init__(self, plan: StudyPlan, vary: Reliability) -> None:
        numbers = plan.study.varied[: len(vary.parameters)]
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

    def derivatives(self, u: Floats) -> tuple[Floats, Floats]:
        """(d, d) derivatives of the variables (d,) of values that stay: by how far the distribution of each number is
        shifted, in standard deviations, and by the logarithm of its width."""
        x = self.values(u[None])[0]
        shifted, widened = x - SHIFT * np.diag(self.deviations), x - SHIFT * np.diag(x - self.means)
        return (self.standard(shifted) - u) / SHIFT, (self.standard(widened) - u) / SHIFT


def _distribution(asked: RandomParameter, varied: VariedParameter, data: list[float]) -> Any:
    """The distribution of a number that scatters, one of OpenTURNS."""
    ot, mean, deviation = sampling.library(), 0.5 * (varied.low + varied.high), 0.5 * (varied.high - varied.low)
    if data:
        return ot.KernelSmoothing().build([[x] for x in data])
    if isinstance(asked, Scattered) and asked.distribution == "lognormal":
        return ot.LogNormalMuSigma(mean, deviation, 0.0).getDistribution()
    if isinstance(asked, Scattered):
        return ot.Normal(mean, deviation)
    if varied.distribution == "normal":
        return ot.TruncatedNormal(mean, deviation / 3.0, varied.low, varied.high)
    if varied.spacing == "logarithmic":
        return ot.LogUniform(math.log(varied.low), math.log(varied.high))
    return ot.Uniform(varied.low, varied.high)


def _data(scenario: Scenario, index: int, asked: RandomParameter, varied: VariedParameter) -> list[float]:
    """The measured values of parameter ``index``, in SI units; none where it has another distribution."""
    if not isinstance(asked, Measured) or not isinstance(asked.data, str):
        return [float(x) for x in varied.values]
    at = ("vary", "parameters", index, "data")
    try:
        file = scenario.folder_of(*at) / asked.data
        with reading(file, "a text table"):
            columns = read_csv(file, asked.decimal)
        columns = [replace(each, axis="") for each in columns]  # a first column is no axis of values
        if asked.column is None:
            column = only_column(columns, key=path_text((*at[:-1], "column")))
        else:
            column = column_named(columns, asked.column)
        if column.y.size < LEAST_DATA:
            raise InputFileError(f"has {column.y.size} values", f"measure {LEAST_DATA} or more")
        texts = [f"{x!r} {column.unit}".rstrip() for x in column.y.tolist()]
        return [float(read_as(scenario, varied.places[0], text, at)) for text in texts]
    except InputFileError as fault:
        found = Problem(path_text(at), f"= {asked.data} {fault.message}", fault.remedy)
    except Unfit as fault:
        found = fault.problem(())
    raise scenario.located(ScenarioError(found))


def _default_method(inputs: list[RandomInput | MatchedInput]) -> str:
    """The method where none is written: the realisations of matched records cannot be blended."""
    if not inputs:
        return "importance_sampling"
    return "monte_carlo" if any(isinstance(item, MatchedInput) for item in inputs) else "subset"


def _seed_of(item: RandomInput | MatchedInput, k: int, blend: sampling.Blend) -> int | str:
    """The seed of random input ``k``: a blend as it is written, or a number for a matched record, which takes none."""
    if isinstance(item, MatchedInput):
        return blend[0][0][k]
    return " + ".join(f"{share:.6g}*{seeds[k]}" for seeds, share in blend)


class Round(NamedTuple):
    """What is known of the probability after some histories."""

    histories: int
    level: float  # 1 - value / limit that is counted as exceeded; 0 is the limit itself
    probability: float
    variation: float  # its coefficient; infinite or not a number where there is none


class Exceedance:
    """The limit state, not positive where the limits are exceeded, of histories that are asked for in batches.

    It is 1 - value / limit of the limit that decides, where a value counts with its change by a finer model. What the
    methods find is kept here.

    Parameters
    ----------
    plan : of a study of reliability.
    evaluate : solves cases, given by the values of the varied parameters.
    progress : called after each estimate with the fraction of histories done: that of the number allowed, or that of
        the number needed where the variance falls as one over it, whichever is larger.
    """

    def __init__(self, plan: StudyPlan, evaluate: Evaluator, progress: Progress = None) -> None:
        vary = of_kind(Reliability, plan.scenario.vary)
        self.plan, self.vary, self.scatter = plan, vary, Scatter(plan, vary)
        self.inputs = inputs = [item for _, item in inputs_with_seed(plan.scenario.excitation)]
        self.noise = bool(inputs)
        self.method = vary.method or _default_method(inputs)
        self.target = vary.coefficient_of_variation or (0.3 if self.method == "subset" else 0.1)
        self.generator = np.random.default_rng(vary.seed)
        sampling.library().RandomGenerator.SetSeed(vary.seed)
        self.origin = sampling.points_at(np.zeros((1, len(vary.parameters))), np.zeros((1, len(inputs)), dtype=int))
        self.asked = 0  # histories whose outcomes are known
        self.rounds: list[Round] = []
        self.estimate = sampling.Estimate(math.nan, math.inf)
        self.outcome = COMPLETE  # unless the method has no estimate, or says why it is in doubt
        self.beyond, self.values, self.weights = self.origin.some([]), np.zeros(0), np.zeros(0)  # of the limits
        self.critical: sampling.Points | None = None  # the design point
        self._evaluate, self._progress = evaluate, progress

    def __call__(self, points: sampling.Points) -> Floats:
        """(n,) values at points."""
        outcomes = self._evaluate(self.rows(points))
        self.asked += len(outcomes)
        _, beyond = costs(self.plan, [outcome for (outcome,) in outcomes])
        value = -(beyond.max(axis=0) if self.vary.event == "any_limit" else beyond.min(axis=0))
        return np.where(np.isfinite(beyond).all(axis=0), value, FAILED)

    def rows(self, points: sampling.Points) -> list[tuple[Any, ...]]:
        """The values of the varied parameters at points; the seed of each random input as a blend is written."""
        blended = [[_seed_of(item, k, of) for k, item in enumerate(self.inputs)] for of in points.blends]
        return [(*x, *of) for x, of in zip(self.scatter.values(points.u).tolist(), blended, strict=True)]

    def kept(self, points: sampling.Points, values: Floats, weights: Floats) -> Bools:
        """Keep those of some samples that are beyond the limits, and say which these are."""
        which = values <= 0.0
        new = points.some(which)
        self.beyond = sampling.Points(
            np.vstack([self.beyond.u, new.u]), np.concatenate([self.beyond.blends, new.blends])
        )
        self.values = np.concatenate([self.values, values[which]])
        self.weights = np.concatenate([self.weights, weights[which]])
        return which

    def noted(self, estimate: sampling.Estimate) -> bool:
        """Keep an estimate, and say whether it is sure enough."""
        self.estimate = estimate
        self.rounds.append(Round(self.asked, 0.0, *estimate))
        needed = (self.target / estimate.variation) ** 2 if estimate.variation > 0.0 else 0.0  # 0 where it is unknown
        tell(self._progress, min(1.0, max(needed, self.asked / self.vary.most_cases)))
        return estimate.variation <= self.target

    def level(self) -> sampling.SubsetLevel:
        """The last level of a subset simulation; a round is kept of each that is not at the limit."""
        for level in sampling.subset_levels(self, self.generator, self.vary.samples, self.origin):
            if level.edge > 0.0:
                self.rounds.append(Round(self.asked, level.edge, *level.estimate))
        if level.edge > 0.0:
            sentence = "most histories have one value, such as that of a stop that is not reached: nothing leads on"
            self.outcome = Outcome.of(OutcomeKind.UNTRUSTED, "one_value", sentence, remedy="limit a displacement")
        return level


def monte_carlo(histories: Exceedance, *known: Floats) -> None:
    """Independent histories, after those of which is known whether they exceed the limits."""
    terms = list(known)
    while not terms or not histories.noted(sampling.average(terms)):
        points = sampling.drawn(histories.generator, histories.vary.samples, histories.origin)
        terms.append(histories.kept(points, histories(points), np.ones(len(points.u))).astype(float))


def form(histories: Exceedance) -> None:
    """What is beyond the plane that touches the limit state where it is nearest to the medians."""
    from scipy.special import ndtr

    safe = float(histories(histories.origin)[0]) > 0.0
    point, found = sampling.nearest_point(histories, histories.origin.u[0])
    if found:
        histories.critical, distance = sampling.points_at(point[None]), float(np.linalg.norm(point))
        histories.noted(sampling.Estimate(float(ndtr(-distance if safe else distance)), math.nan))
        kind, code, sentence = OutcomeKind.NOTED, "first_order", "first-order approximation, which has no interval"
    else:
        kind, code, sentence = OutcomeKind.FAILED, "no_design_point", "gradients lead to no point of the limit"
    histories.outcome = Outcome.of(kind, code, sentence, remedy=OTHER_METHOD)


def subset(histories: Exceedance) -> None:
    """Levels up to the limits, and again until the mean is sure enough."""
    found: list[sampling.Estimate] = []
    while (level := histories.level()).edge == 0.0:
        found.append(level.estimate)
        weights = np.full(level.values.size, level.estimate.probability / level.values.size)
        histories.kept(level.inside, level.values, weights)
        if histories.noted(sampling.mean_of(found)):
            return


def importance_sampling(histories: Exceedance) -> None:
    """Samples about the design points, in the directions in which a subset simulation exceeds the limits."""
    from scipy.stats import norm

    level = histories.level()
    if level.edge > 0.0:
        return
    if not histories.rounds:  # nothing is rare
        histories.method = "monte_carlo"
        exceeds = histories.kept(level.inside, level.values, np.ones(level.values.size)).astype(float)
        return monte_carlo(histories, np.append(exceeds, np.zeros(histories.vary.samples - exceeds.size)))
    histories.noted(level.estimate)
    centres: list[Floats] = []
    for start in sampling.directions(level.inside.u):
        point, found = sampling.nearest_point(histories, start)
        centre = point if found else start
        if all(np.linalg.norm(centre - other) > 0.5 for other in centres):
            centres.append(centre)
    histories.critical = sampling.points_at(np.array([min(centres, key=lambda u: float(np.linalg.norm(u)))]))
    mixture, terms = sampling.about(np.array(centres), level.inside.u), list[Floats]()
    while not terms or not histories.noted(sampling.average(terms)):
        u = np.asarray(mixture.getSample(histories.vary.samples))
        weights = np.exp(norm.logpdf(u).sum(axis=1) - np.ravel(mixture.computeLogPDF(u)))
        points = sampling.points_at(u)
        terms.append(weights * histories.kept(points, histories(points), weights))
    apart = abs(math.log(histories.estimate.probability / level.estimate.probability))
    if apart > SURE * math.sqrt(math.log1p(level.estimate.variation**2)):
        sentence = f"the subset simulation that it began with finds {level.estimate.probability:.2g}, far from it"
        histories.outcome = Outcome.of(OutcomeKind.UNTRUSTED, "regions", sentence, remedy="write method: subset")


METHODS = {"monte_carlo": monte_carlo, "form": form, "subset": subset, "importance_sampling": importance_sampling}


def asked(plan: StudyPlan, evaluate: Evaluator, progress: Progress = None) -> Exceedance:
    """The histories that the method of a study asks for, until its estimate is sure enough or no more are allowed."""
    histories = Exceedance(plan, evaluate, progress)
    with suppress(Ended):
        METHODS[histories.method](histories)
        if histories.critical is None and histories.weights.size:
            of = -histories.values if histories.noise else np.linalg.norm(histories.beyond.u, axis=1)
            histories.critical = histories.beyond.some([int(np.argmin(of))])
            if not histories.noise:
                histories.critical = sampling.points_at(
                    sampling.nearest_point(histories, histories.critical.u[0])[0][None]
                )
    return histories


def concluded(result: StudyResult, histories: Exceedance) -> StudyResult:
    """The result of the cases with the probability, how sure it is, and what it depends on."""
    from scipy.special import ndtri

    estimate, critical = histories.estimate, histories.critical
    low, high = _interval(histories)
    said: dict[str, Any] = {
        "method": histories.method, "event": histories.vary.event, "probability": estimate.probability, "low": low,
        "high": high, "coefficient_of_variation": estimate.variation, "target": histories.target,
        "reliability_index": float(-ndtri(estimate.probability)), "histories": histories.asked,
    }  # fmt: skip
    datasets, warnings = dict(result.datasets), result.warnings
    if critical is not None:
        row = histories.rows(critical)[0]
        said |= {"design_point": dict(zip(result["cases"].labels("parameter"), row, strict=True))}
        said |= {"distance": float(np.linalg.norm(critical.u))} if not histories.noise else {}
        if histories.scatter.numbers:
            numbers = _numbers(histories, critical, said["reliability_index"])
            datasets["random_numbers"] = numbers
            warnings += tuple(
                f"{path} at the design point is beyond what was measured, in the tail of the fit"
                for (path, at), data in zip(numbers.by_label("design").items(), histories.scatter.data, strict=True)
                if data and not min(data) <= at.item() <= max(data)
            )
    if histories.rounds:
        datasets["rounds"] = ROUNDS.table(histories.rounds)
    found = replace(result, datasets=datasets, warnings=warnings)
    return replace(found, summary=result.summary | {"reliability": said}).ended(_ended(histories))


def _ended(histories: Exceedance) -> Outcome:
    """How sure the estimate is."""
    weight, variation = float(histories.weights.sum()), histories.estimate.variation
    lost = float(histories.weights[histories.values == FAILED].sum()) / weight if weight else 0.0
    if histories.outcome is not COMPLETE:
        return histories.outcome
    if histories.rounds and not histories.estimate.probability > 0.0:
        sentence, remedy = f"none of {histories.asked} histories exceeds the limits", "raise most_cases to go further"
        return Outcome.of(OutcomeKind.UNTRUSTED, "not_exceeded", sentence, remedy=remedy)
    if variation > histories.target:
        sentence = f"coefficient of variation of {_percent(variation)} after {histories.asked} histories"
        remedy = f"give more samples or most_cases, or ask for more than {_percent(histories.target)}"
        return Outcome.of(OutcomeKind.UNTRUSTED, "scatter", sentence, remedy=remedy, variation=variation)
    if lost > histories.target:
        sentence = f"{_percent(lost)} of the probability is that of histories that failed"
        return Outcome.of(OutcomeKind.UNTRUSTED, "cases_failed", sentence, remedy="see failures", share=lost)
    return COMPLETE


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %" if math.isfinite(share) else "no known size"


def _interval(histories: Exceedance) -> tuple[float, float]:
    """Ends of the 95 % interval: of Clopper and Pearson for a share of histories, else of a lognormal distribution."""
    estimate = histories.estimate
    if histories.method == "monte_carlo" and histories.rounds:
        of = probability(np.arange(histories.rounds[-1].histories) < histories.weights.size)
        return of["low"], of["high"]
    unreached = math.isnan(estimate.probability) and bool(histories.rounds)  # rarer than the last level
    if unreached:
        estimate = sampling.Estimate(histories.rounds[-1].probability, histories.rounds[-1].variation)
    factor = math.exp(1.96 * math.sqrt(math.log1p(estimate.variation**2)))
    return 0.0 if unreached else estimate.probability / factor, min(1.0, estimate.probability * factor)


def _numbers(histories: Exceedance, critical: sampling.Points, index: float) -> Dataset:
    """What each number has to do with the probability.

    Its derivatives follow from the mean of the variables beyond the limits: as the normal distribution of a variable is
    shifted, the logarithm of a probability grows by the mean of the variable in that event.
    """
    from scipy.stats import norm

    u, scatter = critical.u[0], histories.scatter
    if histories.weights.size:
        mean = histories.weights @ histories.beyond.u / histories.weights.sum()
    else:  # beyond a plane at that index
        mean = u / index * math.exp(norm.logpdf(index) - norm.logsf(index))
    shifted, widened = scatter.derivatives(mean if histories.noise else u)
    by_mean, by_width = -shifted @ mean, -widened @ mean
    importance = by_mean**2 / max(float(by_mean @ by_mean), 1e-300)
    numbers = histories.plan.study.varied[: len(scatter.numbers)]
    values = {
        "number": [number.path for number in numbers], "mean": scatter.means, "deviation": scatter.deviations,
        "design": scatter.values(u[None])[0], "importance": importance, "by_mean": by_mean, "by_deviation": by_width,
    }  # fmt: skip
    return RANDOM_NUMBERS.dataset(values, {"number": [{"unit": number.unit} for number in numbers]})
