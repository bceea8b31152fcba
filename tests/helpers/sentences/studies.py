"""Rules of studies: counts of cases, statistics, limits, probabilities, best cases and fronts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.helpers.screens import ResultFacts, differs, rounds_to, rule
from tests.helpers.sentences.runs_and_sweeps import VERDICT, margin_of, verdict_of
from tests.helpers.sentences.values import called_name, extent, si_unit

CASES = (
    r"(grid of (?:[\d x]+ = )?|one parameter at a time, |search of |Latin-hypercube sample of |Sobol' sample of |"
    r"ensemble of |)(\d+) cases?"
)


@rule("verdict", CASES)
def _cases(facts, found):
    if int(found[2]) != facts.data["cases/case"].size:
        yield f"the table has {facts.data['cases/case'].size}"
    if (sides := re.findall(r"\d+(?= x| =)", found[1])) and math.prod(map(int, sides)) != int(found[2]):
        yield "its sides do not multiply to that"
    begins = {
        "grid": "grid of",
        "optimise": "search of",
        "latin_hypercube": "Latin",
        "sobol": "Sobol'",
        "one_at_a_time": "one parameter",
    }
    if not found[1].startswith(begins.get(str(facts.data["cases/kind"]), "")):
        yield f"the study is a {facts.data['cases/kind']}"


@rule("verdict", r"each a ([a-z ]+)")
def _each(facts, found):
    analysis = "static" if found[1] == "static equilibrium" else found[1].replace(" ", "_")
    if analysis != facts.summary["analysis"]:
        yield f"each is a {facts.summary['analysis']}"


@rule("verdict", r"(\d+) (solved|FAILED|not reliable)")
def _counts(facts, found):
    counts = {"solved": facts.data["cases/solved"].sum(), "FAILED": facts.summary["failed"],
              "not reliable": facts.summary["not_reliable"]}  # fmt: skip
    if int(found[1]) != counts[found[2]]:
        yield f"the table has {counts[found[2]]}"


@rule(
    "verdict",
    r"(?:(\d+) of (\d+) cases meet|no case meets) (the limit|every limit)(?: in all realisations| at the <N> %"
    r" quantile of its realisations)?",
)
def _passing(facts, found):
    passing = int(facts.data["cases/passing"].sum())
    if int(found[1] or 0) != passing or int(found[2] or facts.data["cases/case"].size) != facts.data["cases/case"].size:
        yield f"{passing} of {facts.data['cases/case'].size} pass"
    if (found[3] == "every limit") != (len(facts.labels("cases/limit")) > 1):
        yield f"there are {len(facts.labels('cases/limit'))} limits"
    if found[4] and not rounds_to(found[4], 100 * facts.summary["tolerances"]["quantile"]):
        yield f"the quantile is {facts.summary['tolerances']['quantile']}"


@rule("verdict", r"probability of exceeding (?:every|a) limit (.*)")
def _probability(facts, found):
    of = facts.summary["reliability"]
    number = re.match(r"(below )?([\d.e+-]+)", found[1])
    value = of["high"] if number and number[1] else of["probability"]
    if number is None or not rounds_to(number[2], value, 1):
        yield f"it is {of['probability']}"
    often = re.search(r"\(one in ([\d ]+)\)", found[1])
    if often and float(often[1].replace(" ", "")) != float(f"{1 / of['probability']:.2g}"):
        yield f"it is one in {1 / of['probability']:.4g}"


@rule("verdict", r"(\d+) histories")
def _histories(facts, found):
    if int(found[1]) != facts.summary["reliability"]["histories"]:
        yield f"there are {facts.summary['reliability']['histories']}"


@rule("line", r"95 % interval <N> to <N>, coefficient of variation <N> %")
def _interval_of_probability(facts, found):
    of = facts.summary["reliability"]
    for text, value in zip(found.groups(), (of["low"], of["high"], 100 * of["coefficient_of_variation"]), strict=True):
        if not rounds_to(text, value, 1):
            yield f"{text} is printed of {value:.4g}"
    if not of["low"] <= of["probability"] <= of["high"]:
        yield "the interval does not hold its value"


@rule("line", r"reliability index <N>, design point at a distance of <N> \((.*)\)")
def _index(facts, found):
    of = facts.summary["reliability"]
    if not rounds_to(found[1], of["reliability_index"]) or not rounds_to(found[2], of["distance"]):
        yield f"they are {of['reliability_index']:.4g} and {of['distance']:.4g}"


@rule(
    "line",
    r"(?:(\d+) failure regions? found(?:, with (.*) of the probability)?)?(?:; )?(?:subset simulation finds <N>)?",
)
def _regions(facts, found):
    shares = facts.data.get("regions/share", np.zeros(0))
    if not found[0] or (found[1] and int(found[1]) != shares.size):
        yield f"the file has {shares.size}"
    for text, share in zip(re.findall(r"(\d+) %", found[2] or ""), shares, strict=False):
        if abs(float(text) - 100 * share) > 0.5 + 1e-9:
            yield f"{text} % is printed of {share:.3%}"
    if found[3] and not rounds_to(found[3], facts.summary["reliability"]["cross_check"], 2):
        yield f"it finds {facts.summary['reliability']['cross_check']:.3g}"


@rule("line", r"(?:(\d+)|none|all)(?: of (\d+))? cases compared with a finer model(?:, the other (\d+ )?not)?")
def _compared_cases(facts, found):
    compared, count = int(facts.data["cases/compared"].sum()), facts.data["cases/case"].size
    said = count if found[0].startswith("all") else int(found[1] or 0)
    if (
        said != compared
        or int(found[2] or count) != count
        or ("other" in found[0] and int(found[3] or 1) != count - compared)
    ):
        yield f"{compared} of {count} are"


@rule("line", r"best: (.*)")
def _objective(facts, found):
    if not found[1].startswith(facts.summary["objective"]):
        yield f"it is the {facts.summary['objective']}"


def responses_called(facts: ResultFacts, label: str) -> list[str]:
    """Responses that a label stands for: place and quantity, of a sweep also the curve."""

    def called(parts: list[str]) -> str:
        return " ".join(part.removesuffix("_hz").replace("_", " ") for part in parts)

    wanted = label.replace("_", " ")
    names = {name: name.split("/") for name in facts.labels("cases/response")}
    whole = {name: called([part for part in parts if part not in SECTIONS]) for name, parts in names.items()}
    return [name for name, parts in names.items() if wanted in (called(parts[-2:]), whole[name])]


def values_called(facts: ResultFacts, label: str) -> Any:
    """(cases,) values of the response with a label; None where not exactly one has it."""
    names = responses_called(facts, label)
    return facts.data["cases/value"][facts.labels("cases/response").index(names[0])] if len(names) == 1 else None


SECTIONS = ("probes", "snubbers", "outputs", "springs", "friction")


@rule("line", r"all cases(?: without their tolerances)?: (.*)")
def _all_cases(facts, found):
    if ("tolerances" in facts.summary) != ("without their tolerances" in found[0]):
        yield "limits and the objective are compared with their quantiles, these ranges are not"
    for label, low, high in re.findall(
        r"([a-z][^,]*?) (-?[\d.e+-]+(?: [^\s,]+)?)(?: to (-?[\d.e+-]+[^,]*))?(?:, |$)", found[1]
    ):
        values = values_called(facts, label)
        if values is None:
            yield f"{label!r} is no response"
            continue
        text = f"{low} to {high}" if high else low
        yield from extent(
            facts, text, float(np.nanmin(values)), float(np.nanmax(values)), si_unit((high or low).strip())
        )


LIMIT_OF_CASES = (
    rf"(.*?) {VERDICT} in "
    r"(?:(all|\d+ of \d+) cases(?: at the \S+ % quantile of its realisations| in all realisations)?|"
    r"the best design|the design nearest to the limits):(?: at most)? "
    r"<Q>(?: \((.*?)\))?(?: at (.*?))?, limit <Q>, margin (\S+(?: %| dB)?)(.*)"
)


@rule("line", LIMIT_OF_CASES)
def _limit_of_cases(facts, found):
    label, verdict, cases, value, _, at, limit, margin, _ = found.groups()
    name, of = margin_of(facts, label, at)
    if of is None:
        yield f"no limit is called {label}"
        return
    yield from verdict_of(of, verdict.lower())
    yield from differs(facts, value, of["value"], si_unit(value))
    yield from differs(facts, limit, of["limit"], si_unit(limit))
    if margin.endswith("%") and not rounds_to(margin.split()[0], 100 * (of["limit"] / of["value"] - 1.0)):
        yield f"the margin is {of['limit'] / of['value'] - 1.0:.3%}"
    if "cases/verdict" in facts.data and cases:
        verdicts = facts.data["cases/verdict"][facts.labels("cases/limit").index(name)]
        own, count = int(np.sum(verdicts == verdict.lower())), facts.data["cases/case"].size
        if own != (count if cases == "all" else int(cases.split()[0])):
            yield f"{own} of {count} have this verdict"
    if ("quantile" in found[0]) != (
        "tolerances" in facts.summary and facts.summary["tolerances"]["quantile"] < 1.0 and bool(cases)
    ):
        yield "the value is that of a quantile" if "quantile" not in found[0] else "the value is that of no quantile"


@rule("line", r"worst of the best case within its tolerances: (.*?)(?: with (\d+) further cases? of at most (\d+))?")
def _kind_of_worst(facts, found):
    worst = facts.summary["worst"]
    if found[1] != worst["kind"] or (found[2] and int(found[2]) != worst["further_cases"]):
        yield f"it is {worst['kind']} with {worst['further_cases']}"


@rule("line", r"worst (.*) <Q>, in the sample <Q>; at (.*)")
def _worst_within(facts, found):
    of = facts.summary["worst"]["by"].get(found[1].replace(" ", "_"))
    if of is None:
        yield f"nothing that judges is called {found[1]}"
        return
    yield from differs(facts, found[2], of["value"], si_unit(found[2]))
    yield from differs(facts, found[3], of["of_sample"], si_unit(found[3]))


@rule(
    "line",
    r"all limits met with a probability of .*|best case within its tolerances: .*|case within its tolerances: .*",
)
def _met_with(facts, found):
    share, low, high = map(float, re.search(r"([\d.]+) % \(95 % interval ([\d.]+) to ([\d.]+) %\)", found[0]).groups())
    if not low <= share <= high:
        yield "the interval does not hold its value"
    of = facts.summary.get("probability") if found[0].startswith("all") else facts.summary["scatter"]["probability"]
    if not rounds_to(f"{share:g}", 100 * of["share"], 1):
        yield f"the share is {of['share']:.4%}"


@rule("line", r"(\d+) more responses? in the table of -v")
def _more_responses(facts, found):
    if int(found[1]) >= len(facts.labels("cases/response")):
        yield f"there are {len(facts.labels('cases/response'))}"


@rule("line", r"(.*) has (\d+) populations: (.*); its mean of (.*) describes none of them")
def _populations(facts, found):
    names = responses_called(facts, found[1])
    values = np.sort(facts.data["cases/value"][facts.labels("cases/response").index(names[0])])
    counts = [int(x) for x in re.findall(r"in (\d+) cases?", found[3])]
    if len(counts) != int(found[2]) or sum(counts) != values.size:
        yield f"{sum(counts)} cases in {len(counts)} populations of {values.size} cases"
        return
    begin = 0
    for count, part in zip(counts, re.split(r" in \d+ cases?(?:, |$)", found[3]), strict=False):
        yield from extent(facts, part, float(values[begin]), float(values[begin + count - 1]), si_unit(part))
        begin += count
    yield from differs(facts, found[4], float(values.mean()), si_unit(found[4]))


@rule("line", r"(.*) goes with (.*)|variance of (.*?): (.*)")
def _goes_with(facts, found):
    label, ranked = (found[1], found[2]) if found[1] else (found[3], found[4])
    shares = facts.summary["sensitivity"][responses_called(facts, label)[0]]
    key = "rank_correlation" if found[1] else "total_order"
    known = sorted((abs(each.get(key) or 0.0) for each in shares.values()), reverse=True)
    said = [float(x) for x in re.findall(r"\(?([-+]?[\d.]+)(?:\)| %)(?=, |$)", ranked)]
    said = [abs(x) if found[1] else x / 100 for x in said]
    if any(not any(abs(x - y) <= 0.0051 for y in known) for x in said) or said != sorted(said, reverse=True):
        yield f"the file has {known}"


@rule(
    "line",
    r"within 1 % of the best: .*|the best .* is an end of its range; a wider range may have a better one|\d+"
    r" designs? of the front: none is better in both objectives",
)
def _near_best(facts, found):
    if found[0].startswith("within") and "near_best" not in facts.summary:
        yield "the file has no such ranges"
    if found[0].startswith("the best") and not any(of.get("at_end") for of in facts.summary["near_best"].values()):
        yield "no best value is an end of its range"
    if "front:" in found[0] and int(found[0].split()[0]) != int(facts.data["cases/front"].sum()):
        yield f"the table has {int(facts.data['cases/front'].sum())}"


@rule("line", r"the front has a gap, (\d+) % of its length, at an? (.*?) of (.*): no design found there is in it")
def _gap_of_front(facts, found):
    front = np.asarray(facts.data["cases/front"]) == 1
    values = facts.data["cases/objective_value"][:, front]
    values = values[:, np.argsort(values[0])]
    steps = np.linalg.norm(np.diff(values / np.ptp(values, axis=1, keepdims=True), axis=1), axis=0)
    near = [k for k, share in enumerate(100 * steps / steps.sum()) if abs(share - float(found[1])) <= 0.5 + 1e-9]
    ends = [sorted(values[0, k : k + 2]) for k in near]
    if not any(not list(extent(facts, found[3], float(low), float(high), si_unit(found[3]))) for low, high in ends):
        yield f"the front has no such gap; of this share {ends}"


def best_number(facts: ResultFacts, name: str) -> dict[str, Any] | None:
    if name == "as it is":
        return facts.summary.get("as_it_is")
    return facts.summary["best"][int(name.split(".")[0]) - 1]


@rule("heading", "margin")
def _margin_of_best(facts, found, name, text):
    best = best_number(facts, name)
    if text not in ("infinite", "unknown") and not rounds_to(text.split()[0], 100 * best["margin"]):
        yield f"the margin is {best['margin']:.3%}"


@rule("heading", r"(smallest|largest|median|mean|5 %|95 %)(?: \(at (.*)\))?")
def _statistics(facts, found, name, text):
    if "random_numbers/number" in facts.data and found[1] == "mean":
        yield from _random_number(facts, "mean", name, text)
        return
    values = values_called(facts, name)
    if values is None:
        yield f"{name!r} is no response"
        return
    functions = {"smallest": np.nanmin, "largest": np.nanmax, "mean": np.nanmean, "median": np.nanmedian,
                 "5 %": lambda x: np.nanquantile(x, 0.05), "95 %": lambda x: np.nanquantile(x, 0.95)}  # fmt: skip
    size = re.sub(r" \(.*", "", text)
    yield from differs(facts, size, float(functions[found[1]](values)), si_unit(size))


@rule("heading", r"deviation|design point")
def _random_number(facts, found, name, text):
    known = {"deviation": "deviation", "design point": "design", "mean": "mean"}
    column = known[found if isinstance(found, str) else found[0]]
    yield from differs(facts, text, float(_of_number(facts, column, name)), si_unit(text))


def _of_number(facts: ResultFacts, column: str, name: str) -> Any:
    """A column of the numbers that scatter, of the one that is called so."""
    path = next(path for path in facts.labels("random_numbers/number") if called_name(path) == name)
    return facts.row(f"random_numbers/{column}", "random_numbers/number", path)


@rule("heading", r"importance \(%\)")
def _importance(facts, found, name, text):
    share, low, high = (100 * float(_of_number(facts, f"importance{end}", name)) for end in ("", "_low", "_high"))
    if text.startswith("below "):
        if float(text.split()[1]) < high:
            yield f"it may be {high:.3g} %"
        return
    for part, value in zip(re.findall(r"\d+", text), (share, low, high), strict=False):
        if abs(float(part) - max(value, 0.0)) > 0.5 + 1e-9:
            yield f"{part} is printed of {value:.4g}"
    if not math.isnan(low) and not low <= share <= high:
        yield "the interval does not hold its value"


@rule("heading", r"doubles with the mean")
def _doubles(facts, found, name, text):
    sign, size, low, high = re.fullmatch(r"([-+±]?)(\S+ \S+|\S+)(?: \((.*) to (.*)\))?", text).groups()
    ways = [_of_number(facts, f"doubles{end}", name) for end in ("", "_low", "_high")]
    unit = si_unit(size)
    unit = "kg" if facts.units["random_numbers/doubles"] == "kg" else unit
    for value, *ends in zip(*ways, strict=True):
        texts = [(size, abs(value)), *zip((low, high), map(abs, ends), strict=True)]
        if not any(list(differs(facts, each, float(x), unit)) for each, x in texts if each):
            if sign != "±" and (sign == "-") != (value < 0.0):
                yield f"it is {value:.4g}"
            if low and not abs(ends[0]) <= abs(value) <= abs(ends[1]):
                yield "the interval does not hold its value"
            return
    yield f"the file has {ways[0]}"


def other_cell(facts: ResultFacts, heading: str, name: str, text: str) -> Iterator[str]:
    """A cell below a parameter, an objective or a response of a study."""
    if name[:1].isdigit() or (name == "as it is" and "best" in facts.summary):
        best = best_number(facts, name) or {}
        path = next((p for p in best.get("parameters", ()) if called_name(p) == heading), None)
        value = best["parameters"][path] if path else best.get("value", math.nan)
        values = [value, *(best.get("values") or {}).values()]
        if isinstance(value, str):
            if value != text:
                yield f"it is {value}"
        elif not any(not list(differs(facts, text, x, si_unit(text))) for x in values):
            yield f"the file has {values}"
        return
    values = values_called(facts, heading)
    if values is None:
        yield f"{heading!r} is no response"
        return
    if name == "as it is":
        yield from differs(facts, text, float(values[0]), si_unit(text))
        return
    path = next(p for p in facts.labels("cases/parameter") if called_name(p) == name)
    own = facts.row("cases/parameter_value", "cases/parameter", path)
    varied = own != own[0]
    of = np.append(values[varied], values[0])
    yield from extent(facts, text, float(np.nanmin(of)), float(np.nanmax(of)), si_unit(text))
