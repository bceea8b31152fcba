"""Results of a design study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.studies.layouts import CASES, FURTHER, RANDOM_NUMBERS, REALISATIONS, REGIONS, ROUNDS, RUNS, SOBOL
from beamsim.analyses.studies.objectives import deciding_values, objectives, worst_of
from beamsim.analyses.studies.plan import ParameterColumn
from beamsim.analyses.studies.responses import matches_request
from beamsim.analyses.studies.worst import OBJECTIVE
from beamsim.labelled import LabelledArray
from beamsim.outcomes import Outcome
from beamsim.results.result import CONVERGENCE, Result
from beamsim.summaries import (
    ByName,
    Entry,
    Flag,
    Number,
    Plain,
    Text,
    by_name,
    list_of,
    record,
)
from beamsim.typing import Floats

PROBABILITY = record({"share": Number, "low": Number, "high": Number})
RELIABILITY = record(
    {"event": Text,
     **dict.fromkeys(("probability", "coefficient_of_variation", "low", "high", "histories"), Number)},
    {"method": Text, "design_point": Plain,
     **dict.fromkeys(("distance", "reliability_index", "regions", "cross_check"), Number)},
)  # fmt: skip
VARIED = record({"values": Number, "unit": Text}, {"smallest": Number, "largest": Number, "chosen_from": list[Text]})
PLAIN_NUMBERS = (  # entries of responses that have no unit
    "cases", "p_value", "rank_correlation", "first_order", "first_order_low", "first_order_high", "total_order",
    "total_order_low", "total_order_high", "share", "low", "high", "case", "margin", "limit",
)  # fmt: skip
BEST = record(
    {"case": Number, "value": Number, "parameters": Plain},
    {"margin": Number, "limit": Text, "values": ByName, "worst": Text},
)
TOLERANCES = record({
    "parameters": by_name(record({"tolerance": Number, "relative": Flag, "unit": Text})),
    "quantile": Number, "realisations": Number,
})  # fmt: skip
RANGE = record(
    {"smallest": Number, "largest": Number},
    {"smallest_at": Plain, "largest_at": Plain, "smallest_is": Text, "largest_is": Text,
     "populations": list_of(record(dict.fromkeys(("smallest", "largest", "cases"), Number)))},
)  # fmt: skip
WORST_WITHIN = record(
    {"case": Number, "kind": Text, "further_cases": Number, "most_further_cases": Number,
     "by": by_name(record({"value": Number, "of_sample": Number, "deviations": Plain}))},
)  # fmt: skip
WORST = record(
    dict.fromkeys(("limit", "value"), Number) | {"at": Text, "verdict": Text},
    {**dict.fromkeys(("margin", "margin_db", "lowest", "highest", "case", "cases_exceeding", "cases_not_reliable",
                      "cases_undecided", "interval_low", "interval_high", "decided_after_s", "reached"), Number),
     "exceeded": Flag, "statistic": Text, "parameters": Plain, "probability": PROBABILITY, "worst": Text},
)  # fmt: skip
_SUMMARY = (
    Entry("analysis", variable="cases/analysis"),
    Entry("cases", "1", "number of cases"),
    Entry("varied", "", "by parameter its unit, the number of its values, the smallest and the largest, or the words",
             form=by_name(VARIED)),
    Entry("solved", "1", "cases with responses"),
    Entry("failed", "1", "cases that failed"),
    Entry("not_reliable", "1", "cases whose responses are not reliable"),
    Entry("compared", "1", "cases that are compared with a finer model; the others are not"),
    Entry("reliability", "", "probability that limits are exceeded, with the ends of its 95 % interval and its "
             "coefficient of variation; reliability_index; method, event, target of the coefficient and histories; "
             "the number of failure regions with more than 1 % of it, and cross_check, the probability by "
             "independent subset simulations; design_point by path with its distance in standard deviations",
             form=RELIABILITY),
    Entry("passing", "1", "cases that meet every limit"),
    Entry("objective", "", "what makes a case the best: the response that is smallest or largest, or the margin",
             form=Text),
    Entry("as_it_is", "", "of a search: the scenario as it is, as the best cases are", form=Plain),
    Entry("near_best", "", "of a search for one objective: by number its smallest and largest value in the designs "
             "that meet every limit and are within 1 % of the best one; at_end says whether the best is at an end of "
             "its range", form=by_name(record({"smallest": Number, "largest": Number}, {"at_end": Flag}))),
    Entry("front_ends", "", "of a search for two objectives: of each the design of the front that is best in it: its "
             "case, the values of both, parameters, and at_end, which of them are ends of their ranges",
             form=list_of(record({"objective": Text, "case": Number, "values": by_name(Number), "parameters": Plain,
                                  "at_end": list[Text]}))),
    Entry("front_gaps", "", "of a search for two objectives: the gaps in the front that are wider than 8 % of its "
             "length, widest first, with the range of each objective as one: share of the length, and the values of "
             "both objectives in the designs at its ends",
             form=list_of(record({"share": Number, "from": by_name(Number), "to": by_name(Number)}))),
    Entry("best", "", "the best cases that meet every limit, best first, at most 10: case, value of the objective, "
             "parameters, smallest margin and its limit", form=list_of(BEST)),
    Entry("tolerances", "", "realisations of each case, the quantile that judges it, and by path its tolerance and "
             "unit", form=TOLERANCES),
    Entry("worst", "", "of the best case, where the worst within the tolerances judges it: by limit and objective the "
             "worst value, the worst of the sample, and the deviations there as shares of the tolerances; kind says "
             "whether it is searched, searched in part (search not finished), tried where others are worst or sampled; "
             "and how many further cases all searches solved, of how many that were allowed", form=WORST_WITHIN),
    Entry("scatter", "", "by response of the best case, or of the only one: nominal, smallest and largest value and "
             "what responses have of a sample, over the realisations; whether smallest and largest are searched or "
             "sampled; and the probability that every limit is met",
             form=record({"responses": by_name(RANGE)}, {"probability": PROBABILITY})),
    Entry("margins", "", "by limit, of the worst case: limit, value, lowest and highest, margin, at, case, parameters; "
             "the verdict on all cases, the number of cases that exceed the limit and of those with the verdict not "
             "reliable and undecided, and of a sample the probability that it is met", form=by_name(WORST)),
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


@dataclass(frozen=True, kw_only=True, repr=False)
class StudyResult(Result):
    """Result of `beamsim.design_study` or `beamsim.ensemble`: one row for each case.

    ``result["cases"]`` has parameters, responses, margins and objectives of every case, ``result["realisations"]``
    those responses within tolerances; the other datasets are of some kinds of studies.

    Examples
    --------
    >>> import beamsim
    >>> gaps = {"path": "chain.snubbers.bumper.gap", "values": ["0.2 mm", "0.5 mm"]}
    >>> study = {"sweep": None, "vary": {"kind": "grid", "parameters": [gaps], "responses": ["peak_force"]}}
    >>> result = beamsim.design_study(beamsim.load_scenario("configs/stops/chain_bumpers.yaml", study))
    >>> result.kind, result.count, result.shape, result.finished, result.limits
    ('grid', 2, (2,), True, {})
    >>> {name: column.round(4).tolist() for name, column in result.table.items()}
    {'chain.snubbers.bumper.gap': [0.0002, 0.0005], 'snubbers/bumper/peak_force': [40.0613, 37.9077],
    'snubbers/cable/peak_force': [35.1175, 36.1422]}
    >>> result.units["snubbers/bumper/peak_force"], result.responses["snubbers/bumper/peak_force"].dims
    ('N', ('case',))
    >>> result.parameters[0].path, result.parameters[0].values.tolist(), result.parameters[0].unit
    ('chain.snubbers.bumper.gap', [0.0002, 0.0005], 'm')
    >>> result.deciding_values("snubbers/bumper/peak_force", "snubbers/cable/peak_force").round(2).tolist()
    [40.06, 37.91]
    """

    KIND = "designs"
    SUMMARY = _SUMMARY
    DATASETS = (CASES, REALISATIONS, FURTHER, SOBOL, RUNS, RANDOM_NUMBERS, REGIONS, ROUNDS)

    def with_outcome(self, outcome: Outcome) -> Self:
        """Copy with another outcome, also in its summary; verdicts on limits remain those of the cases."""
        summary = self.summary | ({"status": outcome.text} if "status" in self.summary else {})
        return replace(self, outcome=outcome, summary=summary)

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of values whose entry does not name it; see `Result.unit_of`."""
        if entry.name == "tolerances" and keys[-1] == "tolerance":
            return "" if record["relative"] else str(record["unit"])
        if entry.name == "worst":
            return self.judge_units[place[-1]] if keys[-1] in ("value", "of_sample") else ""
        if entry.name == "varied" and keys[-1] != "values":
            return str(record["unit"])
        if not keys or keys[-1] in PLAIN_NUMBERS or (entry.name == "margins" and keys[0] != "parameters"):
            return super().unit_of(entry, place, keys, record)
        if entry.name in ("best", "as_it_is") and keys[0] in ("value", "values"):
            return next((aim.unit for aim in self["cases"].by_label("objective_value").values()), "")
        units = self.units
        at = (*reversed(keys), *place) if entry.name != "sensitivity" else place
        return next((units[name] for name in at if name in units), "")

    @property
    def finished(self) -> bool:
        """True if nothing remains to be computed."""
        return not (self.outcome.interrupted or self.outcome.outcomes_with_code("cases_missing"))

    @property
    def kind(self) -> str:
        """Kind of study: grid, zip, one_at_a_time, latin_hypercube, sobol, optimise, reliability or draws."""
        return str(self["cases"]["kind"].item())

    @property
    def limits(self) -> dict[str, float]:
        """Limits by name, in SI units."""
        return {name: value.item() for name, value in self["cases"].by_label("limit_value").items()}

    @cached_property
    def judge_units(self) -> dict[str, str]:
        """Units of limits and objectives by name, and of "objective"."""
        aims = {name: of.unit for name, of in self["cases"].by_label("objective_value").items()}
        limits = {name: of.unit for name, of in self["cases"].by_label("limit_value").items()}
        return {OBJECTIVE: next(iter(aims.values()), "1")} | aims | limits

    @property
    def count(self) -> int:
        """Number of cases."""
        return int(self["cases"]["case"].values.size)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter of a grid (cases in C order); else the number of cases."""
        if "parameter_points" not in self["cases"]:
            return (self.count,)
        return tuple(self["cases"]["parameter_points"].values.tolist())

    @cached_property
    def parameters(self) -> tuple[ParameterColumn, ...]:
        """Varied parameters with their values in every case."""
        cases, columns = self["cases"], list[ParameterColumn]()
        texts = cases.by_label("parameter_text")
        for path, numbers in cases.by_label("parameter_value").items():
            words = texts[path].values if path in texts else np.array([""])
            columns.append(ParameterColumn(path, words if any(words) else numbers.values, numbers.unit))
        return tuple(columns)

    @property
    def responses(self) -> dict[str, LabelledArray]:
        """Responses of every case by name, along ``case``; those with a value per mode also along ``mode``."""
        return self["cases"].by_label("value") | self["cases"].by_label("modal_value")

    @cached_property
    def units(self) -> dict[str, str]:
        """Units of parameters by path and of responses by name."""
        units = {name: array.unit for name, array in self["cases"].by_label("parameter_value").items()}
        return units | {name: response.unit for name, response in self.responses.items()}

    @property
    def table(self) -> dict[str, NDArray[Any]]:
        """Table of the study: varied numbers by path, then responses by name, one row for each case.

        A response with several values per case, such as natural frequencies, has several columns: ``name_1``, ...
        """
        columns: dict[str, NDArray[Any]] = {parameter.path: parameter.values for parameter in self.parameters}
        columns |= {name: response.values for name, response in self["cases"].by_label("value").items()}
        for name, response in self["cases"].by_label("modal_value").items():
            columns |= {f"{name}_{mode}": column for mode, column in enumerate(response.values.T, 1)}
        return columns

    def deciding_values(self, *names: str) -> Floats:
        """(cases,) value that judges each case: the worst of the known ones.

        Parameters
        ----------
        names : responses with one number per case, of one quantity; within tolerances, the worst place of each
            realisation counts, and the study's quantile of these.
        """
        values = self["cases"].by_label("value")
        objective = objectives(self.scenario)[0]
        asked = objective.maximised and all(
            any(matches_request(term, name) for term, _ in objective.terms) for name in names
        )
        if "realisations" not in self.datasets:
            return worst_of([values[name].values for name in names], large_is_good=asked)
        realised, quantile = self["realisations"].by_label("value"), self.summary["tolerances"]["quantile"]
        found = deciding_values(
            worst_of([realised[name].values for name in names], large_is_good=asked), quantile, large_is_good=asked
        )
        if "further_realisations" in self.datasets:
            further, worse = self["further_realisations"], np.minimum if asked else np.maximum
            values = further.by_label("value")
            each = worst_of([values[name].values for name in names], large_is_good=asked)
            worse.at(found, further["further_case"].values, each)
        return found
