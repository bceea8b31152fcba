"""Results of a design study."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.designs.responses import describe, means
from beamsim.analyses.run.result import RunResult
from beamsim.errors import ScenarioError
from beamsim.fields import (
    JSON,
    ByName,
    Counter,
    Entry,
    Flag,
    Folded,
    Number,
    Plain,
    Text,
    as_text,
    attribute,
    axis,
    by_name,
    dataset,
    declared,
    key,
    list_of,
    members,
    record,
    stored,
    table,
)
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.results.result import CONVERGENCE, Result
from beamsim.results.values import Margins, limited, parameter_label
from beamsim.scenario import Scenario
from beamsim.scenario.studies import Value
from beamsim.scenario.units import Dimension, UnitError, read_quantity
from beamsim.typing import Bools, Floats, Ints

_CASES = Folded("shape", Counter("case", "number of the case"))


@dataclass(frozen=True)
class CaseOutcome:
    """One case, as a command has it that solves the case alone: responses, outcome, warnings and margins."""

    index: int  # in the order of the cases
    values: Mapping[str, float | list[float]]  # by name of the response; lists are per mode; none where it failed
    outcome: Outcome = COMPLETE
    processor_time_s: float = 0.0
    margins: Margins = field(default_factory=dict)
    given: tuple[Value, ...] = ()  # values of the varied parameters
    warnings: tuple[str, ...] = ()
    compared: bool = False  # whether its values were compared with those of a finer model

    @property
    def failed(self) -> bool:
        """Whether it did not come to its end, so that it has no responses."""
        return self.outcome.ended_early


@declared
class Coordinate:
    """A varied parameter."""

    path: str = key("path of the parameter in the scenario")
    # (nk,) the axis of a grid, or (cases,) one a case; SI numbers or words
    values: NDArray[Any] = dataset("{unit}", "varied {path}", along=(Counter("value", "number of the value"),))
    unit: str = attribute("", "its unit")

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return self.values.dtype.kind == "f"

    def summary(self) -> dict[str, Any]:
        """Its unit and its values."""
        different = list(dict.fromkeys(self.values.tolist()))
        if not self.numeric:
            return {"values": len(different), "unit": "", "chosen_from": different}
        return {"values": len(different), "unit": self.unit, "smallest": min(different), "largest": max(different)}

    @property
    def label(self) -> str:
        """The parameter in words: ``tip gap`` for ``snubbers.tip.gap``."""
        return parameter_label(self.path)


@declared
class ParameterOfCases:
    """A varied parameter in every case."""

    path: str = key("path of the parameter in the scenario")
    value: NDArray[Any] = dataset("{unit}", "value of the parameter", along=_CASES)
    unit: str  # not stored again


@declared
class Response:
    """One response of every case, or its margin."""

    name: str = attribute("", "name of the response")  # "snubbers/tip/peak_force", "up_0/snubbers/tip/peak_force"
    # the design's shape, a last axis of modes where there are several a case; nan: failed
    values: Floats = dataset(
        "{unit}", "{long_name}", name="value", along=_CASES._replace(more=Counter("mode", "mode number", shared=True))
    )
    unit: str = attribute("", "its unit")
    long_name: str = attribute("", "its meaning")

    @property
    def quantity(self) -> str:
        """Quantity, e.g. ``peak_force``."""
        return self.name.rpartition("/")[2]

    @property
    def place(self) -> str:
        """Probe or snubber, and curve: ``tip`` or ``tip up_0``; empty for the structure as a whole."""
        *path, _ = self.name.split("/")  # [curve,] [probes or snubbers, name]
        *curve, _, name = path if len(path) > 1 else (*path, "", "")
        return " ".join([name, *curve]).strip()


@declared
class LimitVerdicts:
    """The verdict on a limit in every case."""

    name: str = attribute("", "name of the limit")
    values: NDArray[Any] = dataset(  # the design's shape
        "1", "verdict on limits.{name}: ok, exceeded or not reliable", name="of_case", along=_CASES
    )


_REALISATION = Counter(
    "realisation", "number of the realisation within the tolerances; 0 is the case itself", 0, shared=True
)


@declared
class Tolerance:
    """A number with a tolerance, and its deviations, which are the same in all cases."""

    path: str = key("path of the number in the scenario")
    deviations: Floats = dataset("1", "deviation of {path} as a share of its tolerance", along=(_REALISATION,))
    tolerance: float = attribute("", "largest deviation, in SI units or as a share of the value")
    relative: bool = attribute("1", "whether the tolerance is a share of the value")
    unit: str = attribute("", "unit of the tolerance", name="unit")


@declared
class RealisedResponse(Response):
    """One response of every realisation of every case."""

    values: Floats = dataset(  # the design's shape, then realisations; nan: failed
        "{unit}", "{long_name}", name="value", along=_CASES._replace(more=_REALISATION)
    )


@declared(along=("time",))
class RunOfDesign:
    """What the run of a design shows: the motion of the first probe and the force of the stop that is hit hardest."""

    name: str = key("which design: as_it_is or best")
    probe: str = attribute("", "name of the probe")
    time: Floats = axis("s", "time")
    displacement: Floats = dataset("m", "displacement of {probe} relative to the base")
    snubber: str = attribute("", "name of the snubber, empty without one", default="")
    force: Floats | None = dataset("{unit}", "contact force of {snubber}", default=None)
    unit: str = attribute("", "unit of the force", name="force_unit", default="N")

    @classmethod
    def of(cls, name: str, run: RunResult) -> Self:
        """That of a run."""
        histories = run["histories"]
        probe, displacement = next(iter(histories.by_label("displacement").items()))
        forces = histories.by_label("snubber_force")
        hit = max(forces, key=lambda snubber: float(np.max(np.abs(forces[snubber].values))), default=None)
        force: dict[str, Any] = {}
        if hit is not None:
            force = {"snubber": hit, "force": forces[hit].values, "unit": forces[hit].unit}
        return cls(
            name=name, probe=probe, time=histories["time"].values, displacement=displacement.values, **force
        )  # fmt: skip


_PARAMETER = Counter("parameter_number", "number of the varied parameter", shared=True)


@declared(along=(_PARAMETER,))
class SobolIndices:
    """Sobol' indices of a response, one of each varied parameter, with their 95 % confidence intervals."""

    name: str = attribute("", "name of the response")
    first_order: Floats = dataset("1", "share of the variance of {name} by the parameter alone")
    total_order: Floats = dataset("1", "the same with what it causes together with others")
    first_order_low: Floats = dataset("1", "lower end of the 95 % interval of first_order")
    first_order_high: Floats = dataset("1", "upper end of the 95 % interval of first_order")
    total_order_low: Floats = dataset("1", "lower end of the 95 % interval of total_order")
    total_order_high: Floats = dataset("1", "upper end of the 95 % interval of total_order")


@declared
class RandomNumber:
    """A number that scatters, and what it has to do with the probability of exceeding the limits."""

    path: str = key("path of the number in the scenario")
    unit: str = attribute("", "its unit")
    mean: float = attribute("{unit}", "mean of its distribution")
    deviation: float = attribute("{unit}", "standard deviation of its distribution")
    design: float = attribute("{unit}", "value at the design point")
    importance: float = attribute("1", "share of the squared derivatives by the means, each times the deviation")
    by_mean: float = attribute("1", "derivative of the logarithm of the probability by the mean, times the deviation")
    by_deviation: float = attribute("1", "the same by the deviation, times the deviation")


@declared
class Round:
    """What is known of the probability after some histories."""

    histories: int = dataset("1", "number of histories")
    level: float = dataset("1", "1 - value / limit that is counted as exceeded; 0 is the limit itself")
    probability: float = dataset("1", "probability of that")
    variation: float = dataset("1", "its coefficient of variation; infinite or not a number where there is none")


@dataclass(frozen=True)
class CaseFailure:
    """A case without responses."""

    case: int  # from 0
    values: tuple[Value, ...]  # of the coordinates
    outcome: Outcome


def _failures_text(failures: Iterable[CaseFailure]) -> str:
    rows = [[f.case, list(f.values), f.outcome.text, f.outcome.as_dict()] for f in failures]
    return json.dumps(rows, ensure_ascii=False)


def _failures(text: str) -> tuple[CaseFailure, ...]:
    return tuple(
        CaseFailure(case, tuple(values), Outcome.from_dict(outcome)) for case, values, _, outcome in json.loads(text)
    )


FAILURES = as_text(_failures_text, _failures)
"""Cases that failed: number, values of the parameters, text and code of the outcome."""

PROBABILITY = record({"share": Number, "low": Number, "high": Number})
RELIABILITY = record(
    {"event": Text,
     **dict.fromkeys(("probability", "coefficient_of_variation", "low", "high", "histories"), Number)},
    {"method": Text, "distance": Number, "reliability_index": Number, "design_point": Plain},
)  # fmt: skip
VARIED = record({"values": Number, "unit": Text}, {"smallest": Number, "largest": Number, "chosen_from": list[Text]})
PLAIN_NUMBERS = (  # of responses: what has no unit
    "cases", "p_value", "rank_correlation", "first_order", "first_order_low", "first_order_high", "total_order",
    "total_order_low", "total_order_high", "share", "low", "high", "case", "margin", "limit",
)  # fmt: skip
BEST = record(
    {"case": Number, "value": Number, "parameters": Plain}, {"margin": Number, "limit": Text, "values": ByName}
)
TOLERANCES = record({
    "parameters": by_name(record({"tolerance": Number, "relative": Flag, "unit": Text})),
    "quantile": Number, "realisations": Number,
})  # fmt: skip
RANGE = record(
    {"smallest": Number, "largest": Number},
    {"smallest_at": Plain, "largest_at": Plain,
     "populations": list_of(record(dict.fromkeys(("smallest", "largest", "cases"), Number)))},
)  # fmt: skip
WORST = record(
    dict.fromkeys(("limit", "value"), Number) | {"at": Text, "verdict": Text},
    {**dict.fromkeys(("margin", "margin_db", "lowest", "highest", "case", "cases_exceeding", "cases_not_reliable"),
                     Number),
     "exceeded": Flag, "parameters": Plain, "probability": PROBABILITY},
)  # fmt: skip
_SUMMARY = (
    Entry("analysis", of="analysis"),
    Entry("cases", "1", "number of cases", of="cases"),
    Entry("varied", "", "by parameter its unit, the number of its values, the smallest and the largest, or the words",
             form=by_name(VARIED)),
    Entry("solved", "1", "cases with responses"),
    Entry("failed", "1", "cases that failed"),
    Entry("not_reliable", "1", "cases whose responses are not reliable"),
    Entry("compared", "1", "cases that are compared with a finer model; the others are not"),
    Entry("reliability", "", "probability that limits are exceeded, with the ends of its 95 % interval and its "
             "coefficient of variation; reliability_index; method, event, target of the coefficient, histories and how "
             "many of them failed; design_point by path with its distance in standard deviations; and by path what a "
             "number has to do with it", form=RELIABILITY),
    Entry("passing", "1", "cases that meet every limit"),
    Entry("objective", "", "what makes a case the best: the response that is smallest or largest, or the margin",
             form=Text),
    Entry("as_it_is", "", "of a search: the scenario as it is, as the best cases are", form=Plain),
    Entry("near_best", "", "of a search for one objective: by number its smallest and largest value in the designs "
             "that meet every limit and are within 1 % of the best one; at_end says whether the best is at an end of "
             "its range", form=by_name(record({"smallest": Number, "largest": Number}, {"at_end": Flag}))),
    Entry("best", "", "the best cases that meet every limit, best first, at most 10: case, value of the objective, "
             "parameters, smallest margin and its limit", form=list_of(BEST)),
    Entry("tolerances", "", "realisations of each case, the quantile that judges it, and by path its tolerance and "
             "unit", form=TOLERANCES),
    Entry("scatter", "", "by response of the best case, or of the only one: nominal, smallest and largest value and "
             "what responses have of a sample, over the realisations; and the probability that every limit is met",
             form=record({"responses": by_name(RANGE)}, {"probability": PROBABILITY})),
    Entry("margins", "", "by limit, of the worst case: limit, value, lowest and highest, margin, at, case, parameters; "
             "the verdict on all cases, the number of cases that exceed the limit and of those with the verdict not "
             "reliable, and of a sample the probability that it is met", form=by_name(WORST)),
    Entry("probability", "", "of a sample: share of the cases that meet every limit, with the ends of the 95 % "
             "interval of its probability", form=PROBABILITY),
    *CONVERGENCE,
    Entry("responses", "", "by response: extremes and their parameters; of a sample also mean, standard deviation, the "
             "5 %, 50 % and 95 % quantiles with their 95 % intervals, and the populations of values that are in "
             "several", form=by_name(RANGE)),
    Entry("sensitivity", "", "by response and parameter: of a sample rank_correlation and p_value; of kind: sobol "
             "first_order and total_order, each with the ends of its 95 % interval; of kind: one_at_a_time smallest "
             "and largest value, and where they are", form=dict[str, dict[str, Plain]]),
    Entry("processor_time_s", "s", "processor time of all cases", "solver"),
)  # fmt: skip


@declared(along=_CASES, repr=False)
class DesignsResult(Result):
    """Everything `beamsim sweep` computes of a scenario with ``vary``, or `ensemble`, along the axes of the design.

    These are the varied parameters in a grid; otherwise the only axis is ``case``, and the parameters are along it (CF
    ``coordinates``).
    """

    KIND = "designs"
    SUMMARY, DATASET = _SUMMARY, "cases"

    analysis: str = attribute("", "what was done with each case: run, or the kind of sweep")
    kind: str = attribute("", "grid, zip, one_at_a_time, latin_hypercube, sobol, or draws of an ensemble")
    coordinates: tuple[Coordinate, ...] = members("parameters", Coordinate, "parameter")
    # the design's shape
    solved: Bools = dataset("1", "whether the case has responses", flags=("missing", "solved"))
    responses: dict[str, Response] = members("", Response, "response")
    margins: dict[str, Response] = members("", Response, "limit", prefix="margin_")  # limit / value - 1
    verdicts: dict[str, LimitVerdicts] = members("", LimitVerdicts, "limit", prefix="verdict_")
    # the design's shape; within tolerances of the gravest realisation
    case_outcomes: NDArray[Any] = dataset("1", "how the case ended", name="outcome")
    case_warnings: NDArray[Any] = dataset("1", "warnings of the case, one a line", name="warnings")
    compared: Bools = dataset(
        "1", "whether the values of the case are compared with those of a finer model",
        flags=("not compared with a finer model", "compared with a finer model"),
    )  # fmt: skip
    limits: dict[str, float] = attribute("", "limits by name, in SI units, JSON object", codec=JSON)
    failures: tuple[CaseFailure, ...] = attribute(
        "", "cases that failed: number from 0, values of the parameters, and why; JSON list", codec=FAILURES
    )  # fmt: skip
    # the design's shape; None without limits
    passing: Bools | None = dataset(
        "1",
        "whether the case is reliable and meets every limit",
        flags=("failing", "passing"),
        default=None,
    )
    sensitivity: tuple[SobolIndices, ...] = members(
        "sensitivity", SobolIndices, "response", default=()
    )  # of a Sobol' sample
    # the design's shape; None without limits or tolerances
    passing_share: Floats | None = dataset("1", "share of the realisations that meet every limit", default=None)
    tolerances: tuple[Tolerance, ...] = members("tolerances", Tolerance, "number", default=())
    realised: dict[str, RealisedResponse] = members(
        "", RealisedResponse, "response", prefix="realised_", default_factory=dict
    )
    objectives: dict[str, Response] | None = members(  # of a search
        "", Response, "objective", prefix="objective_", default=None
    )
    front: Bools | None = dataset(  # of a search for two objectives
        "1", "whether no design that meets every limit is better in one objective and not worse in the other",
        flags=("dominated", "of the front"), default=None,
    )  # fmt: skip
    runs: dict[str, RunOfDesign] | None = members(
        "runs", RunOfDesign, "design", rows="histories", default=None
    )  # of a search: of the scenario as it is, and of the best design
    random_numbers: tuple[RandomNumber, ...] | None = members(
        "random_numbers", RandomNumber, "number", default=None
    )  # of a study of reliability
    rounds: tuple[Round, ...] | None = table("rounds", Round, Counter("round", "number of the round"), default=None)
    fingerprint: str = attribute("", "hash of all that the responses depend on", default="")

    def ended(self, outcome: Outcome) -> Self:
        """The result with another outcome, which its summary repeats; verdicts on limits are those of its cases."""
        summary = self.summary | ({"status": outcome.text} if "status" in self.summary else {})
        return replace(self, outcome=outcome, summary=summary)

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """That of values which the name does not say; see `Result.unit_of`."""
        if entry.name == "tolerances" and keys[-1] == "tolerance":
            return "" if record["relative"] else str(record["unit"])
        if entry.name == "varied" and keys[-1] != "values":
            return str(record["unit"])
        if not keys or keys[-1] in PLAIN_NUMBERS or (entry.name == "margins" and keys[0] != "parameters"):
            return super().unit_of(entry, place, keys, record)
        if entry.name in ("best", "as_it_is") and keys[0] in ("value", "values"):
            aims = (aim.of(self.responses, self.shape) for aim in objectives(self.scenario))
            return next((aim.unit for aim in aims if aim is not None), "")
        units = {each.path: each.unit for each in self.coordinates}
        units |= {name: response.unit for name, response in self.responses.items()}
        at = (*reversed(keys), *place) if entry.name != "sensitivity" else place
        return next((units[name] for name in at if name in units), "")

    @property
    def finished(self) -> bool:
        """Whether nothing is left to be computed."""
        return not (self.outcome.interrupted or self.outcome.all_of("cases_missing"))

    @property
    @stored(attribute("", "number of values of each parameter of a grid, otherwise the number of cases"))
    def shape(self) -> tuple[int, ...]:
        """Shape of the design: an axis a coordinate for a grid, else (cases,)."""
        return self.solved.shape

    @property
    def cases(self) -> int:
        """Number of cases."""
        return int(np.prod(self.shape))

    @property
    @stored(members("", ParameterOfCases, "parameter", prefix="parameter_"))
    def _parameters_of_cases(self) -> tuple[ParameterOfCases, ...]:
        values: Sequence[NDArray[Any]] = [c.values for c in self.coordinates]
        if self.kind == "grid":
            values = np.meshgrid(*values, indexing="ij")
        each = zip(self.coordinates, values, strict=True)
        return tuple(ParameterOfCases(c.path, of_cases, c.unit) for c, of_cases in each)

    @property
    def table(self) -> dict[str, NDArray[Any]]:
        """The study as columns of equal length, a row a case: the varied numbers by path, then the responses by name.

        A response with several values a case, such as natural frequencies, has a column for each: ``name_1``, ...
        """
        values = [c.values for c in self.coordinates]
        if self.kind == "grid":
            values = [grid.ravel() for grid in np.meshgrid(*values, indexing="ij")]
        columns: dict[str, NDArray[Any]] = {c.path: x for c, x in zip(self.coordinates, values, strict=True)}
        for name, response in self.responses.items():
            if is_scalar(response, self.shape):
                columns[name] = response.values.ravel()
            else:
                by_mode = response.values.reshape(self.cases, -1).T
                columns |= {f"{name}_{k}": column for k, column in enumerate(by_mode, 1)}
        return columns

    def judged(self, *responses: Response) -> Floats:
        """The value by which each case is judged, of the design's shape: the worst of those that are known.

        Parameters
        ----------
        responses : one quantity at one or several places, each one number a case; within tolerances a case has in each
            realisation the value at the worst place, and of these the one at the quantile of the study.
        """
        objective = objectives(self.scenario)[0]
        asked = {r.name for name, _ in objective.terms for r in responses_of(self.responses, name)}
        good = objective.largest and all(response.name in asked for response in responses)
        each = [self.realised.get(response.name, response) for response in responses]
        values, _ = worst_of(each, large_is_good=good)
        quantile = self.summary["tolerances"]["quantile"] if self.realised else 1.0
        deciding = judging(values, values.size // self.cases, quantile, large_is_good=good)
        return np.asarray(values[deciding].reshape(self.shape))


def responses_of(responses: Mapping[str, Response], name: str) -> list[Response]:
    """The responses of this quantity (``peak_force``), or the one of this name, with or without its curve."""
    return [response for response in responses.values() if means(name, response.name)]


def is_scalar(response: Response, shape: tuple[int, ...]) -> bool:
    """Whether a response is one number per case."""
    return response.values.shape == shape


def varies(response: Response) -> bool:
    """Whether a response differs between cases by more than round-off."""
    known = response.values[np.isfinite(response.values)]
    return bool(known.size) and bool(np.ptp(known) > 1e-9 * np.max(np.abs(known)))


def limited_response(limit: str) -> str:
    """The end of the names of the responses that a limit is compared with.

    >>> limited_response("gap"), limited_response("outputs.clamp")
    ('largest_gap', 'outputs/clamp/peak_output')
    """
    value, place = limited(limit)
    return f"{value.section}/{place}/{value.name}" if place else value.name


class Objective(NamedTuple):
    """What makes a case better than another."""

    # quantities, whose worst place counts, or names of responses, by value that counts as one where they are added up;
    # none: the smallest margin
    terms: tuple[tuple[str, float], ...] = ()
    largest: bool = True  # whether large values are better

    @property
    def sign(self) -> float:
        """By which a value is multiplied so that small ones are better."""
        return -1.0 if self.largest else 1.0

    @property
    def text(self) -> str:
        """For people."""
        return f"{'largest' if self.largest else 'smallest'} {self.label}"

    @property
    def label(self) -> str:
        """What is to be large or small."""
        return " + ".join(name.replace("/", " ").replace("_", " ") for name, _ in self.terms) or "margin"

    def of(self, responses: Mapping[str, Response], shape: tuple[int, ...]) -> Response | None:
        """Its value of every case and realisation; None where one of its responses is not known in any.

        Parameters
        ----------
        responses : by name.
        shape : of their values, those of modes apart.
        """
        total, unit = np.zeros(int(np.prod(shape))), "1"
        for name, one in self.terms:
            asked = [response for response in responses_of(responses, name) if is_scalar(response, shape)]
            if not asked:
                return None
            total = total + worst_of(asked, large_is_good=self.largest)[0] / one
            unit = asked[0].unit if len(self.terms) == 1 else "1"
        return Response(self.label.replace(" ", "_"), total.reshape(shape), unit, self.text) if self.terms else None


def objectives(scenario: Scenario) -> tuple[Objective, ...]:
    """What a study asks for, one or two; without that the smallest margin of a case shall be large.

    Raises
    ------
    ScenarioError
        If a value that counts as one is none of its response.
    """
    units, found = scenario.output_units, list[Objective]()
    for goal in ("minimise", "maximise"):
        aim = getattr(scenario.study, goal, "")
        each = [{aim: None}] if isinstance(aim, str) else [aim] if isinstance(aim, dict) else [{a: None} for a in aim]
        for terms in (terms for terms in each if terms != {"": None}):
            ones = []
            for name, one in terms.items():
                unit = describe(name, units)[0].removeprefix("1")
                dimension = Dimension(name.replace("_", " "), unit, f"1 {unit}".rstrip(), gravity=unit == "m/s^2")
                try:
                    ones.append((name, 1.0 if one is None else read_quantity(one, dimension)))
                    if not ones[-1][1] > 0.0:
                        raise UnitError("must be positive", "give the value that counts as one")
                except UnitError as error:
                    at = f"optimise.{goal}.{name}"
                    raise scenario.located(ScenarioError.at(at, f"= {one} {error.message}", error.remedy)) from None
            found.append(Objective(tuple(ones), goal == "maximise"))
    return tuple(found) or (Objective(),)


def judging(values: Floats, realisations: int, quantile: float, *, large_is_good: bool) -> Ints:
    """Which of the values each case is judged by.

    Parameters
    ----------
    values : of all realisations of each case, case after case.
    realisations : number of them of each case.
    quantile : of the values, from the good side; 1 is the worst.
    large_is_good : whether that is the side of large values.

    Returns
    -------
    (cases,) array
        Numbers of the values: at the quantile, or the first one of the case that is not known.
    """
    badness = (-values if large_is_good else values).reshape(-1, realisations)
    order = np.argsort(badness, axis=1, kind="stable")  # nan comes last
    place = math.ceil(quantile * (realisations - 1))
    unknown = np.isnan(badness)
    deciding = np.where(unknown.any(axis=1), unknown.argmax(axis=1), order[:, place])
    return np.asarray(np.arange(deciding.size) * realisations + deciding)


def worst_of(responses: Sequence[Response], *, large_is_good: bool) -> tuple[Floats, Ints]:
    """The worst of values of the same size that are known, one after the other, and which of the responses it is."""
    values = np.stack([response.values.ravel() for response in responses])
    badness = np.where(np.isnan(values), -np.inf, -values if large_is_good else values)
    which = badness.argmax(axis=0)
    return values[which, np.arange(which.size)], which
