"""The variables of the labelled datasets of a study, see `beamsim.labelled`."""

from __future__ import annotations

from beamsim.labelled import Layout, Variable

_CASE, _PARAMETER, _RESPONSE, _MODAL, _LIMIT, _OBJECTIVE, _NUMBER, _DESIGN, _SAMPLE, _ROUND, _REGION, _SIDE = (
    ("case",), ("parameter",), ("response",), ("modal_response",), ("limit",), ("objective",), ("number",),
    ("design",), ("sample",), ("round",), ("region",), ("side",),
)  # fmt: skip
CASES = Layout(
    "cases",
    "Every case: its parameters, responses, margins and objectives. The cases of a grid are in C order over its "
    "parameters.",
    {
        "analysis": Variable((), "", "analysis of each case: run, or the kind of sweep", str),
        "kind": Variable(
            (), "", "grid, zip, one_at_a_time, latin_hypercube, sobol, optimise, reliability, or draws of an ensemble",
            str,
        ),
        "fingerprint": Variable((), "", "hash of all that the responses depend on", str),
        "case": Variable(_CASE, "1", "number of the case", int),
        "solved": Variable(
            _CASE, "1", "whether the case has responses, in all realisations", bool, flags=("missing", "solved")
        ),
        "outcome": Variable(
            _CASE, "", "how the case ended, within tolerances its gravest realisation; empty where it is missing", str
        ),
        "failure": Variable(_CASE, "", "why the case, or the first of its realisations, failed; else empty", str),
        "warnings": Variable(_CASE, "", "warnings of the case, one a line", str),
        "compared": Variable(
            _CASE, "1", "whether the values of the case are compared with those of a finer model", bool,
            flags=("not compared with a finer model", "compared with a finer model"),
        ),
        "parameter": Variable(_PARAMETER, "1", "path of the varied parameter in the scenario", str),
        "parameter_points": Variable(
            _PARAMETER, "1", "number of values of the parameter along its axis of a grid", int, optional=True
        ),
        "parameter_value": Variable(_PARAMETER + _CASE, "{unit}", "value of the parameter; NaN of words"),
        "parameter_text": Variable(
            _PARAMETER + _CASE, "", "value of a parameter that is a word; empty of numbers", str, optional=True
        ),
        "response": Variable(_RESPONSE, "1", "name of the response", str),
        "value": Variable(
            _RESPONSE + _CASE, "{unit}", "value of the response; NaN where the case has none: {long_name}"
        ),
        "modal_response": Variable(_MODAL, "1", "name of the response that has a value for each mode", str),
        "mode": Variable(("mode",), "1", "mode number", int, optional=True),
        "modal_value": Variable(
            (*_MODAL, *_CASE, "mode"), "{unit}", "value of the response; NaN where there is none: {long_name}"
        ),
        "limit": Variable(_LIMIT, "1", "name of the limit", str),
        "limit_value": Variable(_LIMIT, "{unit}", "value of the limit"),
        "margin": Variable(
            _LIMIT + _CASE, "1", "limit / value - 1, within tolerances of the realisation by which the case is judged"
        ),
        "verdict": Variable(_LIMIT + _CASE, "", "verdict on the limit: ok, exceeded, not reliable or undecided", str),
        "passing": Variable(
            _CASE, "1", "whether the case is reliable and meets every limit", bool, optional=True,
            flags=("failing", "passing"),
        ),
        "passing_share": Variable(_CASE, "1", "share of the realisations that meet every limit", optional=True),
        "objective": Variable(_OBJECTIVE, "1", "name of the objective", str),
        "objective_value": Variable(
            _OBJECTIVE + _CASE, "{unit}",
            "value of the objective, within tolerances of the realisation by which the case is judged",
        ),
        "front": Variable(
            _CASE, "1", "whether no case that meets every limit is better in one objective and not worse in the other",
            bool, optional=True, flags=("dominated", "of the front"),
        ),
    },
)  # fmt: skip
REALISATIONS = Layout(
    "realisations",
    "Every realisation of every case within its tolerances, and the deviations, which are the same in all cases.",
    {
        "case": Variable(_CASE, "1", "number of the case", int),
        "realisation": Variable(
            ("realisation",), "1", "number of the realisation within the tolerances; 0 is the case itself", int
        ),
        "response": Variable(_RESPONSE, "1", "name of the response", str),
        "value": Variable(
            (*_RESPONSE, *_CASE, "realisation"), "{unit}",
            "value of the response; NaN where the realisation has none: {long_name}",
        ),
        "number": Variable(_NUMBER, "1", "path of the number that has a tolerance", str),
        "tolerance": Variable(_NUMBER, "{unit}", "largest deviation, as a share of the value where it is relative"),
        "relative": Variable(
            _NUMBER, "1", "whether the tolerance is a share of the value", bool, flags=("absolute", "relative")
        ),
        "deviation": Variable((*_NUMBER, "realisation"), "1", "deviation of the number as a share of its tolerance"),
    },
    optional=True,
)  # fmt: skip
_FURTHER = ("further",)
FURTHER = Layout(
    "further_realisations",
    "Further realisations within the tolerances, with which the worst of the best cases was searched.",
    {
        "further": Variable(_FURTHER, "1", "number of the further realisation", int),
        "further_case": Variable(_FURTHER, "1", "number of the case, from 0", int, names="cases/case"),
        "further_outcome": Variable(_FURTHER, "", "how the realisation ended", str),
        "number": Variable(_NUMBER, "1", "path of the number that has a tolerance", str),
        "deviation": Variable(_NUMBER + _FURTHER, "1", "deviation of the number as a share of its tolerance"),
        "response": Variable(_RESPONSE, "1", "name of the response", str),
        "value": Variable(
            _RESPONSE + _FURTHER, "{unit}",
            "value of the response; NaN where the realisation has none: {long_name}",
        ),
    },
    optional=True,
)  # fmt: skip
_INDEX = (*_RESPONSE, *_PARAMETER)
SOBOL = Layout(
    "sobol",
    "Sobol' indices of the responses that vary and are known in all cases, with their 95 % confidence intervals.",
    {
        "response": Variable(_RESPONSE, "1", "name of the response", str),
        "parameter": Variable(_PARAMETER, "1", "path of the varied parameter in the scenario", str),
        "first_order": Variable(_INDEX, "1", "share of the variance of the response by the parameter alone"),
        "total_order": Variable(
            _INDEX,
            "1",
            "share of the variance of the response by the parameter, with its interactions with other parameters",
        ),
        "first_order_low": Variable(_INDEX, "1", "lower end of the 95 % interval of first_order"),
        "first_order_high": Variable(_INDEX, "1", "upper end of the 95 % interval of first_order"),
        "total_order_low": Variable(_INDEX, "1", "lower end of the 95 % interval of total_order"),
        "total_order_high": Variable(_INDEX, "1", "upper end of the 95 % interval of total_order"),
    },
    optional=True,
)
RUNS = Layout(
    "runs",
    "Of a search, what the runs of the best design and of the scenario as it is show: the motion of the first probe "
    "and the force of the stop that is hit hardest, the samples of one design after those of another.",
    {
        "design": Variable(_DESIGN, "1", "which design: as_it_is or best", str),
        "probe": Variable(_DESIGN, "", "name of the probe", str),
        "snubber": Variable(_DESIGN, "", "name of the snubber, empty without one", str),
        "sample": Variable(_SAMPLE, "1", "number of the sample", int),
        "sample_design": Variable(_SAMPLE, "1", "number of the design, from 0", int, names="runs/design"),
        "time": Variable(_SAMPLE, "s", "time"),
        "displacement": Variable(_SAMPLE, "m", "displacement of the probe relative to the base"),
        "force": Variable(_SAMPLE, "{force_unit}", "contact force of the snubber", optional=True),
    },
    optional=True,
)
RANDOM_NUMBERS = Layout(
    "random_numbers",
    "Of a study of reliability, the numbers that scatter, and what they have to do with the probability of exceeding "
    "the limits.",
    {
        "number": Variable(_NUMBER, "1", "path of the number in the scenario", str),
        "mean": Variable(_NUMBER, "{unit}", "mean of its distribution"),
        "deviation": Variable(_NUMBER, "{unit}", "standard deviation of its distribution"),
        "design": Variable(_NUMBER, "{unit}", "value at the design point"),
        "importance": Variable(_NUMBER, "1", "share of the squared derivatives by the means, each times the deviation"),
        "importance_low": Variable(_NUMBER, "1", "lower end of its 95 % interval; NaN where the method has none"),
        "importance_high": Variable(_NUMBER, "1", "upper end of the interval"),
        "by_mean": Variable(
            _NUMBER, "1", "derivative of the logarithm of the probability by the mean, times the deviation"
        ),
        "by_mean_low": Variable(_NUMBER, "1", "lower end of its 95 % interval; NaN where the method has none"),
        "by_mean_high": Variable(_NUMBER, "1", "upper end of the interval"),
        "by_deviation": Variable(
            _NUMBER, "1", "derivative of the logarithm of the probability by the deviation, times the deviation"
        ),
        "doubles": Variable(
            _NUMBER + _SIDE,
            "{unit}",
            "change of the mean for which the probability doubles; NaN without one of less than three deviations",
        ),
        "doubles_low": Variable(
            _NUMBER + _SIDE, "{unit}", "smallest magnitude in the 95 % interval; NaN if the method gives none"
        ),
        "doubles_high": Variable(_NUMBER + _SIDE, "{unit}", "largest magnitude of it"),
        "side": Variable(_SIDE, "1", "whether the mean rises or falls", str),
    },
    optional=True,
)
REGIONS = Layout(
    "regions",
    "Of a study of reliability, the failure regions with more than 1 % of the probability, the one with most first.",
    {
        "region": Variable(_REGION, "1", "number of the region", int),
        "share": Variable(_REGION, "1", "its share of the probability"),
        "distance": Variable(_REGION, "1", "distance of its nearest point from the medians, in standard deviations"),
        "on_limit": Variable(
            _REGION,
            "1",
            "whether gradients lead to the nearest point; else it is the nearest of some samples",
            bool,
            flags=("nearest of some samples", "nearest point"),
        ),
        "number": Variable(_NUMBER, "1", "path of the number in the scenario", str),
        "nearest": Variable(_NUMBER + _REGION, "{unit}", "value of the number at the nearest point"),
    },
    optional=True,
)
ROUNDS = Layout(
    "rounds",
    "Of a study of reliability, what is known of the probability after some histories.",
    {
        "round": Variable(_ROUND, "1", "number of the round", int),
        "histories": Variable(_ROUND, "1", "number of histories", int),
        "level": Variable(
            _ROUND, "1", "histories up to this 1 - value / limit count as exceeding; 0 is the limit itself"
        ),
        "probability": Variable(_ROUND, "1", "probability of that"),
        "variation": Variable(
            _ROUND, "1", "its coefficient of variation; infinite or not a number where there is none"
        ),
    },
    optional=True,
)
