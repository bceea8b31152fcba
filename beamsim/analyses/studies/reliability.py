"""Probability that limits are exceeded: limit state of the histories, estimate and result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.analyses.studies import sampling
from beamsim.analyses.studies.dependence import dependence
from beamsim.analyses.studies.estimators import FAILED, Estimator, Round
from beamsim.analyses.studies.layouts import REGIONS, ROUNDS
from beamsim.analyses.studies.plan import StudyPlan
from beamsim.analyses.studies.result import StudyResult
from beamsim.analyses.studies.scatter import Scatter
from beamsim.analyses.studies.table import costs
from beamsim.cases import Evaluator, StopEvaluation, probability
from beamsim.labelled import Dataset
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Progress, report_progress
from beamsim.scenario.excitation import MatchedInput, RandomInput
from beamsim.scenario.studies import Reliability, VariedParameter, inputs_with_seed
from beamsim.typing import Floats, of_kind

LEAST_LISTED_SHARE = 0.01  # share of the probability below which a region is not listed


def _seed_of(item: RandomInput | MatchedInput, k: int, blend: sampling.Blend) -> int | str:
    """Seed of random input ``k``: a blend in text form, or a number for a matched record (which allows no blend)."""
    if isinstance(item, MatchedInput):
        return blend[0][0][k]
    return " + ".join(f"{share:.6g}*{seeds[k]}" for seeds, share in blend)


class Exceedance:
    """Limit state of histories: not positive if the limits are exceeded; evaluated in batches.

    It is 1 - value / limit of the deciding limit, with the value changed by the error estimate of a finer model.

    Parameters
    ----------
    plan : plan of a study of reliability.
    evaluate : evaluator that solves cases, given by the values of the varied parameters.
    progress : called after each estimate with the completed fraction: of the allowed histories, or of those needed if
        the
    variance is inversely proportional to their number, whichever is larger.
    """

    def __init__(self, plan: StudyPlan, evaluate: Evaluator, progress: Progress = None) -> None:
        vary = of_kind(Reliability, plan.scenario.vary)
        self.plan, self.vary, self.scatter = plan, vary, Scatter(plan, vary)
        self.inputs = inputs = [item for _, item in inputs_with_seed(plan.scenario.excitation)]
        self.noise = bool(inputs)
        self._evaluate, self._progress = evaluate, progress
        method = vary.method_with(inputs)
        self.target = vary.coefficient_of_variation or (0.3 if method == "subset" else 0.1)
        self.estimator = Estimator(
            self, sampling.points_at(np.zeros((1, len(vary.parameters))), np.zeros((1, len(inputs)), dtype=int)),
            method=method, samples=vary.samples, target=self.target, seed=vary.seed, report=self._report_progress,
        )  # fmt: skip

    def __call__(self, points: sampling.Points) -> Floats:
        """(n,) values of the limit state at points."""
        outcomes = self._evaluate(self.rows(points))
        _, beyond = costs(self.plan, [outcome for (outcome,) in outcomes])
        value = -(beyond.max(axis=0) if self.vary.event == "any_limit" else beyond.min(axis=0))
        return np.where(np.isfinite(beyond).all(axis=0), value, FAILED)

    def rows(self, points: sampling.Points) -> list[tuple[Any, ...]]:
        """Values of the varied parameters at points, with the seed of each random input as a blend."""
        blended = [[_seed_of(item, k, of) for k, item in enumerate(self.inputs)] for of in points.blends]
        return [(*x, *of) for x, of in zip(self.scatter.values(points.u).tolist(), blended, strict=True)]

    def _report_progress(self, finished: Round) -> None:
        """Report the completed fraction."""
        needed = (self.target / finished.variation) ** 2 if finished.variation > 0.0 else 0.0  # 0 if unknown
        report_progress(self._progress, min(1.0, max(needed, finished.histories / self.vary.most_cases)))


def run_histories(plan: StudyPlan, evaluate: Evaluator, progress: Progress = None) -> Exceedance:
    """Compute histories by the method of a study until its target is reached or the budget is spent."""
    histories = Exceedance(plan, evaluate, progress)
    with suppress(StopEvaluation):
        histories.estimator.sample_until_sure()
    return histories


def with_probability(result: StudyResult, histories: Exceedance) -> StudyResult:
    """Add the probability, its uncertainty and its dependence on the numbers to a result."""
    from scipy.special import ndtri

    of, critical = histories.estimator, histories.estimator.critical
    low, high = interval(of)
    regions = _shares_of_regions(of)
    entry: dict[str, Any] = {
        "method": of.method, "event": histories.vary.event, "probability": of.estimate.probability, "low": low,
        "high": high, "coefficient_of_variation": of.estimate.variation, "target": histories.target,
        "reliability_index": float(-ndtri(of.estimate.probability)), "histories": of.evaluated_count,
    }  # fmt: skip
    entry |= {"regions": len(regions)} if regions else {}
    entry |= {"cross_check": of.cross_check} if math.isfinite(of.cross_check) else {}
    datasets, warnings = dict(result.datasets), result.warnings
    if critical is not None:
        row = histories.rows(critical)[0]
        entry |= {"design_point": dict(zip(result["cases"].labels("parameter"), row, strict=True))}
        entry |= {"distance": float(np.linalg.norm(critical.u))} if not histories.noise else {}
        if histories.scatter.numbers and of.estimate.probability > 0.0:
            numbers = histories.plan.study.parameters[: len(histories.scatter.numbers)]
            dataset = dependence(histories.scatter, of, numbers)
            datasets["random_numbers"] = dataset
            warnings += tuple(
                f"{path} at the design point is beyond the measured values, in the tail of the fit"
                for (path, at), data in zip(dataset.by_label("design").items(), histories.scatter.data, strict=True)
                if data and not min(data) <= at.item() <= max(data)
            )
            if regions:
                datasets["regions"] = _regions(histories, regions, numbers)
    if of.rounds:
        datasets["rounds"] = ROUNDS.table(of.rounds)
    found = replace(result, datasets=datasets, warnings=warnings)
    return replace(found, summary=result.summary | {"reliability": entry}).with_outcome(_estimate_outcome(of))


def _shares_of_regions(estimator: Estimator) -> dict[int, float]:
    """Share of the probability by region index, the largest first, for regions that are not negligible."""
    failures, found = estimator.failures, estimator.regions.found
    if not found or not failures.weights.size:
        return {}
    shares = (
        np.bincount(estimator.regions.nearest(failures.points.u), failures.weights, len(found)) / failures.weights.sum()
    )
    return {int(j): float(shares[j]) for j in np.argsort(-shares, kind="stable") if shares[j] > LEAST_LISTED_SHARE}


def _regions(histories: Exceedance, regions: dict[int, float], numbers: Sequence[VariedParameter]) -> Dataset:
    """Dataset of the failure regions: design points, and shares of the probability."""
    found = [histories.estimator.regions.found[j] for j in regions]
    values = {
        "region": np.arange(1, len(found) + 1), "share": list(regions.values()),
        "distance": [region.distance for region in found],
        "on_limit": [region.on_limit for region in found],
        "number": [number.path for number in numbers],
        "nearest": histories.scatter.values(np.array([region.point for region in found])).T,
    }  # fmt: skip
    return REGIONS.dataset(values, {"number": [{"unit": number.unit} for number in numbers]})


def _estimate_outcome(estimator: Estimator) -> Outcome:
    """Outcome of the estimate."""
    failures, variation = estimator.failures, estimator.estimate.variation
    weight = float(failures.weights.sum())
    lost = float(failures.weights[failures.values == FAILED].sum()) / weight if weight else 0.0
    if estimator.outcome is not COMPLETE:
        return estimator.outcome
    if estimator.rounds and not estimator.estimate.probability > 0.0:
        sentence, remedy = f"none of {estimator.evaluated_count} histories exceeds the limits", "raise most_cases"
        return Outcome.of(OutcomeKind.UNTRUSTED, "not_exceeded", sentence, remedy=remedy)
    if variation > estimator.target:
        sentence = f"coefficient of variation of {_percent(variation)} after {estimator.evaluated_count} histories"
        remedy = f"raise samples or most_cases, or accept more than {_percent(estimator.target)}"
        return Outcome.of(OutcomeKind.UNTRUSTED, "scatter", sentence, remedy=remedy, variation=variation)
    if lost > estimator.target:
        sentence = f"failed histories make {_percent(lost)} of the probability"
        return Outcome.of(OutcomeKind.UNTRUSTED, "cases_failed", sentence, remedy="see failures", share=lost)
    return estimator.check


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %" if math.isfinite(share) else "no known size"


def interval(estimator: Estimator) -> tuple[float, float]:
    """95 % interval: Clopper-Pearson for a share of histories, else of a lognormal distribution."""
    estimate = estimator.estimate
    if estimator.method == "monte_carlo" and estimator.rounds:
        share = probability(np.arange(estimator.rounds[-1].histories) < estimator.failures.weights.size)
        return share["low"], share["high"]
    unreached = math.isnan(estimate.probability) and bool(estimator.rounds)  # rarer than the last level
    if unreached:
        estimate = sampling.Estimate(estimator.rounds[-1].probability, estimator.rounds[-1].variation)
    factor = math.exp(1.96 * math.sqrt(math.log1p(estimate.variation**2)))
    return 0.0 if unreached else estimate.probability / factor, min(1.0, estimate.probability * factor)
