"""First screen of a design study."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from beamsim.analyses.studies.dependence import SIDES
from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.responses import limited_response, matches_request
from beamsim.analyses.studies.result import StudyResult
from beamsim.analyses.studies.worst import SAMPLED
from beamsim.cli.screens import MOST_SHOWN, Screen, margins, round_with_unit
from beamsim.labelled import Dataset
from beamsim.outcomes import Verdict
from beamsim.plots.style import amount, extent, is_known, margin_text
from beamsim.results.values import VALUES, limit_label, parameter_label
from beamsim.scenario.base import count_text

MOST_BEST = 5
LEAST_IMPORTANCE = 0.1  # importance below which only an upper bound is shown

_CALLED = {"static": "static equilibrium", "swept_sine": "swept sine"}  # analyses of cases
_DESIGNS = {
    "grid": "grid of ", "zip": "", "one_at_a_time": "one parameter at a time, ",
    "optimise": "search of ", "latin_hypercube": "Latin-hypercube sample of ",
    "sobol": "Sobol' sample of ", "draws": "ensemble of ", "reliability": "",
}  # fmt: skip


_STATISTICS = {
    "smallest": "smallest", "quantile_5_percent": "5 %", "quantile_50_percent": "median", "mean": "mean",
    "quantile_95_percent": "95 %", "largest": "largest",
}  # fmt: skip


def design_screen(result: StudyResult) -> Screen:
    """Best cases, or ranges of the responses with their cases; limits, and dependence on the parameters."""
    s = result.summary
    if "reliability" in s:
        return _probability_screen(result, s["reliability"])
    lines = [f"best: {s['objective']}{_quantile_text(result)}"] if s.get("best") else []
    lines += [*_worst_lines(result), *_limit_lines(result)]
    shown = [(name, s["responses"][name]) for name in _deciding_responses(result) if name in s["responses"]]
    shown = shown or list(s["responses"].items())
    if result.kind == "optimise":
        rows = [{"": "as it is"} | row for row in _best_rows(result, [s["as_it_is"]] if "as_it_is" in s else [])]
        called = "front" if "front" in result["cases"] else "best"
        rows += [{"": f"{k}. {called}"} | row for k, row in enumerate(_best_rows(result, s.get("best", ())), 1)]
        lines += _near_lines(result)
    elif "best" in s:
        rows = [{"": f"{k}. best"} | row for k, row in enumerate(_best_rows(result, s["best"]), 1)]
        ranges = [
            f"{_response_label(result, name)} {extent(of['smallest'], of['largest'], result.units[name])}"
            for name, of in shown[:MOST_SHOWN]
        ]
        without = " without their tolerances" if "tolerances" in s else ""  # in contrast to limits and the objective
        lines += [f"all cases{without}: {', '.join(ranges)}"] if ranges else []
    elif result.kind == "one_at_a_time":
        rows = list(_swing_rows(result, [name for name, _ in shown][:MOST_SHOWN]))
    else:
        rows = [_range_row(result, name, of) for name, of in shown[:MOST_BEST]]
        more = len(s["responses"]) - len(rows)
        lines += [f"{count_text(more, 'more response')} in the table of -v"] if more else []
    within = s.get("scatter", {})
    if "probability" in within:
        case = "best case" if "best" in s else "case"
        lines.append(
            f"{case} within its tolerances: every limit met with a probability of {_odds_text(within['probability'])}"
        )
    for name, of in shown[:MOST_SHOWN]:
        lines += _remarks(result, name, within.get("responses", {}).get(name, of))
    return Screen(_cases_text(result), rows, [*lines, _comparison(result)])


def _worst_lines(result: StudyResult) -> Iterator[str]:
    """Worst realisation of the best case within its tolerances, and how it was found."""
    if (worst := result.summary.get("worst")) is None:
        return
    tolerances, count = result.summary["tolerances"]["parameters"], count_text(worst["further_cases"], "further case")
    how = "" if worst["kind"] == SAMPLED else f" with {count} of at most {worst['most_further_cases']}"
    yield f"worst of the best case within its tolerances: {worst['kind']}{how}"
    for name, of in worst["by"].items():
        at = ", ".join(_deviation_text(path, x, tolerances[path]) for path, x in of["deviations"].items() if x)
        value, sample = (round_with_unit(of[key], result.judge_units[name]) for key in ("value", "of_sample"))
        called = limit_label(name) if name in result.limits else name.replace("_", " ")
        yield f"worst {called} {value}, in the sample {sample}; at {at or 'the case itself'}"


def _deviation_text(path: str, share: float, tolerance: Mapping[str, Any]) -> str:
    """Number with its deviation, such as ``tip stiffness +15 %``."""
    size = abs(share) * tolerance["tolerance"]
    text = f"{100.0 * size:.3g} %" if tolerance["relative"] else amount(size, tolerance["unit"], 3)
    return f"{parameter_label(path)} {'-' if share < 0.0 else '+'}{text}"


def _comparison(result: StudyResult) -> str:
    """Number of cases that are compared with a finer model."""
    count, total = int(result["cases"]["compared"].values.sum()), result.count
    if count == total:
        return "all cases compared with a finer model"
    others = f", the other {f'{total - count} ' if total - count > 1 else ''}not" if count else ""
    return f"{count or 'none'} of {total} cases compared with a finer model{others}"


def _near_lines(result: StudyResult) -> Iterator[str]:
    """Range of nearly optimal designs, and the size of the front."""
    if "front" in result["cases"]:
        count = int(result["cases"]["front"].values.sum())
        yield f"{count_text(count, 'design')} of the front: none is better in both objectives"
        yield from _end_lines(result)
        yield from _gap_lines(result)
    near = result.summary.get("near_best", {})
    if near:
        ranges = [
            f"{parameter_label(p)} {extent(of['smallest'], of['largest'], result.units[p])}" for p, of in near.items()
        ]
        yield f"within 1 % of the best: {', '.join(ranges)}"
    for path in (p for p, of in near.items() if of.get("at_end")):
        yield f"the best {parameter_label(path)} is an end of its range; a wider range may have a better one"


def _end_lines(result: StudyResult) -> Iterator[str]:
    """Best design in each of two objectives, and whether a wider range may have a better one."""
    units = {name: of.unit for name, of in result["cases"].by_label("objective_value").items()}
    for end in result.summary.get("front_ends", ()):
        design = [f"{label} {value}" for label, value in _parameters(result, end["parameters"]).items()]
        values = [f"{name.replace('_', ' ')} {amount(value, units[name])}" for name, value in end["values"].items()]
        yield f"best in {end['objective'].partition(' ')[2]}: {', '.join(values)}; {', '.join(design)}"
        if labels := [parameter_label(path) for path in end["at_end"]]:
            are = (
                "is an end of its range; a wider range" if len(labels) == 1 else "are ends of their ranges; wider ones"
            )
            yield f"{' and '.join(labels)} there {are} may have a better one"


def _gap_lines(result: StudyResult) -> Iterator[str]:
    """Gaps of the front, which may consist of several parts."""
    units = {name: of.unit for name, of in result["cases"].by_label("objective_value").items()}
    for gap in result.summary.get("front_gaps", ()):
        name = next(iter(gap["from"]))
        low, high = sorted(gap[end][name] for end in ("from", "to"))
        share = f"{100.0 * gap['share']:.0f} % of its length"
        ends = f"{name.replace('_', ' ')} of {extent(low, high, units[name])}"
        yield f"the front has a gap, {share}, at a {ends}: no design found there is in it"


def _probability_screen(result: StudyResult, probability: Mapping[str, Any]) -> Screen:
    """Probability of exceeding the limits, and its dependence on the numbers."""
    p, variation = probability["probability"], probability["coefficient_of_variation"]
    lines = []
    if is_known(variation) and math.isfinite(variation):
        interval = f"95 % interval {probability['low']:.2g} to {probability['high']:.2g}"
        lines.append(f"{interval}, coefficient of variation {_share(variation)}")
    if "distance" in probability and math.isfinite(probability["reliability_index"]):
        index, method = probability["reliability_index"], probability["method"].replace("_", " ")
        lines.append(
            f"reliability index {index:.3g}, design point at a distance of {probability['distance']:.3g} ({method})"
        )
    lines += _region_line(result, probability)
    what = "every limit" if probability["event"] == "all_limits" and len(result.limits) > 1 else "a limit"
    often = f" (one in {float(f'{1.0 / p:.2g}'):,.0f})".replace(",", " ") if is_known(p) and 0.0 < p < 0.1 else ""
    failed = f", {result.summary['failed']} FAILED" if result.summary["failed"] else ""
    bound = f"below {probability['high']:.1g}" if is_known(probability["high"]) else "unknown"
    estimate = f"{p:.2g}{often}" if is_known(p) and p else bound
    verdict = f"probability of exceeding {what} {estimate}, {probability['histories']} histories{failed}"
    return Screen(verdict, list(_random_rows(result)), [*lines, _comparison(result)])


def _region_line(result: StudyResult, probability: Mapping[str, Any]) -> Iterator[str]:
    """Failure regions with their shares of the probability, and the check for missing regions."""
    agrees = f"subset simulation finds {probability['cross_check']:.2g}" if "cross_check" in probability else ""
    if "regions" not in result.datasets:
        yield from filter(None, [agrees])
        return
    shares = result["regions"]["share"].values.tolist()
    found = f"{count_text(len(shares), 'failure region')} found"
    if len(shares) > 1:
        listed = [_share(share) for share in shares[:MOST_BEST]]
        found += f", with {', '.join(listed)}{', ...' if len(shares) > MOST_BEST else ''} of the probability"
    yield f"{found}; {agrees}" if agrees else found


def _random_rows(result: StudyResult) -> Iterator[dict[str, str]]:
    """Scattering numbers, the most important one first; only values known to a factor of two."""
    if "random_numbers" not in result.datasets:
        return
    numbers = result["random_numbers"]
    for path in sorted(numbers.labels("number"), key=lambda path: -numbers["importance"].sel(number=path).item()):
        of = numbers.sel(number=path)
        unit, importance = of["mean"].unit, [of[f"importance{end}"].item() for end in ("", "_low", "_high")]
        shown = ""
        if _is_within_factor_two(*importance):
            low, high = (_share(end) if is_known(end) else "" for end in importance[1:])
            shown = _share(importance[0]) + (f" ({low} to {high})" if low != high else "")
        elif importance[2] < LEAST_IMPORTANCE:
            shown = f"below {_share(math.ceil(100 * importance[2]) / 100)}"
        yield {
            "": parameter_label(path), "mean": round_with_unit(of["mean"].item(), unit),
            "deviation": round_with_unit(of["deviation"].item(), unit),
            "design point": round_with_unit(of["design"].item(), unit),
            "importance (%)": shown.replace(" %", ""), "doubles with the mean": _doubling(of, unit),
        }  # fmt: skip


def _doubling(dependence: Dataset, unit: str) -> str:
    """Shift of the mean that doubles the probability; both directions if they are similar."""
    ways = [tuple(dependence[f"doubles{end}"].sel(side=side).item() for end in ("", "_low", "_high")) for side in SIDES]
    known = sorted(
        (way for way in ways if is_known(way[0]) and _is_within_factor_two(*way)), key=lambda way: abs(way[0])
    )
    if not known or any(is_known(way[0]) and abs(way[0]) < abs(known[0][0]) for way in ways):
        return ""  # the other direction is nearer, but uncertain
    nearest, low, high = known[0]
    if not is_known(low):
        return f"{'+' * (nearest > 0)}{round_with_unit(nearest, unit)}"
    ends = f" ({round_with_unit(abs(low), unit)} to {round_with_unit(abs(high), unit)})"
    sign = "±" if len(known) > 1 and abs(known[1][1]) < abs(high) else "+" * (nearest > 0)
    return f"{sign}{round_with_unit(abs(nearest) if sign == '±' else nearest, unit)}{ends}"


def _is_within_factor_two(value: float, low: float, high: float) -> bool:
    """True if an interval is within a factor of two of its value, or if the method gives no interval."""
    if not is_known(low):
        return True
    return abs(low) >= 0.5 * abs(value) and abs(high) <= 2.0 * abs(value)


def _cases_text(result: StudyResult) -> str:
    """Number of cases, and of those that meet the limits."""
    s = result.summary
    sides = f"{' x '.join(map(str, result.shape))} = " if len(result.shape) > 1 else ""
    solved = f", {s['solved']} solved" if s["solved"] < result.count else ""
    failed = f", {s['failed']} FAILED" if s["failed"] else ""
    failed += f", {s['not_reliable']} not reliable" if s.get("not_reliable") else ""
    passing = f", {_passing(result, s['passing'])}" if "passing" in s else ""
    analysis = _CALLED.get(s["analysis"], s["analysis"])
    cases = f"{_DESIGNS[result.kind]}{sides}{count_text(result.count, 'case')}, each a {analysis}"
    return f"{cases}{solved}{failed}{passing}"


def _remarks(result: StudyResult, name: str, statistics: Mapping[str, Any]) -> Iterator[str]:
    """Populations of a sampled response, and the parameters that it depends on most."""
    called, shares = _response_label(result, name), result.summary.get("sensitivity", {}).get(name, {})
    if "populations" in statistics:
        mean = round_with_unit(statistics["mean"], result.units[name])
        yield f"{called} has {_populations(result, name, statistics)}; its mean of {mean} describes none of them"
    key, text = ("total_order", _share) if result.kind == "sobol" else ("rank_correlation", "({:+.2f})".format)
    sure = {path: each[key] for path, each in shares.items() if key in each and each.get("p_value", 0.0) < 0.05}
    ranked = ", ".join(
        f"{parameter_label(p)} {text(sure[p])}" for p in sorted(sure, key=lambda p: -abs(sure[p]))[:MOST_SHOWN]
    )
    if ranked:
        yield f"variance of {called}: {ranked}" if result.kind == "sobol" else f"{called} goes with {ranked}"


def _swing_rows(result: StudyResult, names: Sequence[str]) -> Iterator[dict[str, str]]:
    """Responses of the unchanged scenario, and their ranges with each parameter, the largest first."""
    swings = {name: result.summary["sensitivity"][name] for name in names if name in result.summary["sensitivity"]}
    of = {name: (result.units[name], _response_label(result, name)) for name in swings}
    yield {"": "as it is"} | {
        label: amount(float(result.responses[n].values[0]), unit) for n, (unit, label) in of.items()
    }
    first: Mapping[str, Any] = next(iter(swings.values()), {})
    for path in sorted(first, key=lambda path: first[path]["smallest"] - first[path]["largest"]):
        ends = {name: swing[path] for name, swing in swings.items() if path in swing}
        ranges = {of[name][1]: extent(end["smallest"], end["largest"], of[name][0]) for name, end in ends.items()}
        yield {"": parameter_label(path)} | ranges


def _populations(result: StudyResult, name: str, statistics: Mapping[str, Any]) -> str:
    """Text of the populations of a response."""
    unit, groups = result.units[name], statistics["populations"]
    ranges = [f"{extent(g['smallest'], g['largest'], unit)} in {count_text(g['cases'], 'case')}" for g in groups]
    return f"{len(groups)} populations: {', '.join(ranges)}"


def _odds_text(estimate: Mapping[str, Any]) -> str:
    """Probability with its interval, each to two digits of the distance from 0 or 1."""
    share, low, high = (
        f"{100 * p:.{max(0, -math.floor(math.log10(min(p, 1 - p))) - 1) if 0 < p < 1 else 0}f}"
        for p in (estimate["share"], estimate["low"], estimate["high"])
    )
    return f"{share} % (95 % interval {low} to {high} %)"


def _limit_lines(result: StudyResult) -> Iterator[str]:
    compared = result.summary.get("margins", {})
    for item, (name, of) in zip(compared.values(), margins(result, compared).items(), strict=True):
        at, most = f" at {of['at']}" if of["at"] else "", ""
        if result.kind == "optimise":
            where = f"in the {'best design' if 'best' in result.summary else 'design nearest to the limits'}:"
        elif item["verdict"] == Verdict.MET:
            where = f"in all cases{_quantile_text(result)}: at most"
        else:
            counts = {Verdict.EXCEEDED: "cases_exceeding", Verdict.UNDECIDED: "cases_undecided"}
            count = item.get(counts.get(item["verdict"], "cases_not_reliable"))
            where = f"in {count or 'some'} of {result.count} cases{_quantile_text(result)}:"
            with_them = _parameters(result, item.get("parameters", {})).items()
            most = "".join(f", {label} {value}" for label, value in with_them)
        met = f", met with a probability of {_odds_text(item['probability'])}" if "probability" in item else ""
        by = f" ({item['statistic']})" if "statistic" in item else ""
        by += f" (worst {item['worst']})" if "worst" in item else ""
        limit = f"limit {of['limit']}, margin {of['margin']}"
        yield f"{name} {of['verdict']} {where} {of['value']}{by}{at}, {limit}{most}{met}"
    if "probability" in result.summary and len(result.limits) > 1:
        yield f"all limits met with a probability of {_odds_text(result.summary['probability'])}"


def _range_row(result: StudyResult, name: str, statistics: Mapping[str, Any]) -> dict[str, str]:
    """Response with its extremes and the parameters there."""
    row, unit = {"": _response_label(result, name)}, result.units[name]
    if "mean" in statistics:  # a sample
        return row | {label: round_with_unit(statistics[key], unit) for key, label in _STATISTICS.items()}
    varied = ", ".join(parameter_label(path.rpartition(".")[2]) for path in result["cases"].labels("parameter"))
    for end in ("smallest", "largest"):
        at = (
            ", ".join(_parameters(result, statistics[f"{end}_at"]).values())
            if statistics["smallest"] != statistics["largest"]
            else ""
        )
        row[f"{end} (at {varied})"] = f"{round_with_unit(statistics[end], unit)}{f' ({at})' if at else ''}"
    return row


def _deciding_responses(result: StudyResult) -> list[str]:
    """Names of the responses with limits or objectives; without any, of the peaks that could have limits."""
    asked = [limited_response(name) for name in result.limits]
    asked += [name for objective in objectives(result.scenario) for name, _ in objective.terms]
    asked = asked or [value.name for value in VALUES if value.in_sweeps]
    return list(dict.fromkeys(name for each in asked for name in result.responses if matches_request(each, name)))


def _parameters(result: StudyResult, values: Mapping[str, Any]) -> dict[str, str]:
    return {
        parameter_label(path): value if isinstance(value, str) else amount(value, result.units.get(path, "1"))
        for path, value in values.items()
    }


def _passing(result: StudyResult, passing: int) -> str:
    every = f"{'every limit' if len(result.limits) > 1 else 'the limit'}{_quantile_text(result)}"
    return f"{passing} of {result.count} cases meet {every}" if passing else f"no case meets {every}"


def _quantile_text(result: StudyResult) -> str:
    """Realisation that judges the objective and the limits of a case, as text after the judged value."""
    quantile = result.summary.get("tolerances", {}).get("quantile")
    if quantile is None:
        return ""
    return " in all realisations" if quantile == 1.0 else f" at the {_share(quantile)} quantile of its realisations"


def _best_rows(result: StudyResult, best: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Rows of the best cases."""
    known, rows = result["cases"].by_label("objective_value"), []
    for item in best[:MOST_BEST]:
        row = _parameters(result, item["parameters"])
        for (name, of), value in zip(known.items(), item.get("values", {"": item["value"]}).values(), strict=False):
            row[name.replace("_", " ")] = amount(value, of.unit)
        if "limit" in item:  # the case passes, so the margin is known; a value of zero makes it infinite
            row["margin"] = margin_text(item["margin"], 1.0 if math.isfinite(item["margin"]) else 0.0)
            row["limit"] = limit_label(item["limit"])
        if "worst" in item:
            row["worst"] = item["worst"]
        rows.append(row)
    return rows


def _share(index: float) -> str:
    """Index in percent; small samples may estimate values below zero or above one."""
    return f"{100 * max(index, 0.0):.0f} %"


def _response_label(result: StudyResult, name: str) -> str:
    """Place and quantity of a response; with the curve of a sweep if there are several."""
    *path, quantity = name.split("/")  # [curve,] [probes, snubbers or outputs, name]
    curves = {each.partition("/")[0] for each in result.responses if each.count("/") == 3}
    shown = path[:-2] if len(curves) > 1 else []
    return " ".join([*shown, *path[-1:], quantity.removesuffix("_hz").replace("_", " ")])
