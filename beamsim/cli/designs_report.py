"""Texts of the table of a design study."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from beamsim.analyses.designs.choice import Objective
from beamsim.analyses.designs.plan import limited_response
from beamsim.analyses.designs.result import Coordinate, DesignsResult, parameter_label, responses_of
from beamsim.analyses.limits import limit_label
from beamsim.cli.report import Row, Texts, aligned, margins
from beamsim.plots.style import amount, extent, margin_text

MOST_ROWS = 24
MOST_BEST = 5

_DESIGNS = {
    "grid": "grid of ", "zip": "", "latin_hypercube": "Latin-hypercube sample of ", "sobol": "Sobol' sample of ",
    "draws": "ensemble of ",
}  # fmt: skip


def _cases(result: DesignsResult, cases: int) -> Iterator[Row]:
    failed = f", {result.summary['failed']} failed" if result.summary["failed"] else ""
    size = " x ".join(map(str, result.shape)) if len(result.shape) > 1 else str(cases)
    yield "", f"{_DESIGNS[result.kind]}{size}, each a {result.analysis.replace('_', ' ')}{failed}"
    for k, coordinate in enumerate(result.coordinates):
        yield "" if k else "varied", f"{coordinate.label}: {_extent(coordinate)}"


def _extent(coordinate: Coordinate) -> str:
    values = coordinate.values
    if not coordinate.numeric:
        return ", ".join(dict.fromkeys(map(str, values)))
    low, high = (amount(float(value), coordinate.unit) for value in (values.min(), values.max()))
    return f"{low} to {high}, {len(values)} values"


def _margins(result: DesignsResult, compared: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    """The worst margin of each limit; of one that is exceeded also in how many cases, and in which most."""
    yield from aligned(margins(result, compared))
    units = {c.path: c.unit for c in result.coordinates}
    for name, item in compared.items():
        if item["exceeded"]:
            worst = _parameters(units, item["parameters"])
            share = f"{item['cases_exceeding']} of {result.cases} cases"
            yield "", f"{limit_label(name)} exceeded in {share}, most with {worst}"


def _parameters(units: Mapping[str, str], values: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{parameter_label(path)} {value if isinstance(value, str) else amount(value, units.get(path, '1'))}"
        for path, value in values.items()
    )


def _passing(result: DesignsResult, passing: int) -> str:
    every = "every limit" if len(result.limits) > 1 else "the limit"
    if "tolerances" in result.summary:
        quantile = result.summary["tolerances"]["quantile"]
        every += " in all realisations" if quantile == 1.0 else f" at its {_share(quantile)} quantile"
    return f"{passing} of {result.cases} cases meet {every}" if passing else f"no case meets {every}"


def _tolerances(result: DesignsResult, tolerances: Mapping[str, Any]) -> Iterator[Row]:
    """What each case is varied by, and how it is judged."""
    for k, (path, item) in enumerate(tolerances["parameters"].items()):
        reach = f"{100 * item['tolerance']:.4g} %" if item["relative"] else amount(item["tolerance"], item["unit"])
        yield "" if k else "tolerances", f"{parameter_label(path)} \u00b1{reach}"
    quantile = tolerances["quantile"]
    judged = "the worst of them" if quantile == 1.0 else f"their {_share(quantile)} quantile"
    yield "", f"{tolerances['realisations']} realisations of each case, itself among them; judged by {judged}"


def _scatter(result: DesignsResult, scatter: Mapping[str, Any]) -> Iterator[Row]:
    """The range of each response over the realisations of the best case."""
    ranges, texts = scatter["responses"], {}
    compared = [limited_response(name) for name in result.limits]
    decisive = [*compared, *filter(None, [Objective.of(result.scenario.vary).response])]
    named = {response.name for name in decisive for response in responses_of(result.responses, name)}
    shown = {name: item for name, item in ranges.items() if name in named} or ranges
    for name, item in list(shown.items())[:MOST_ROWS]:
        unit = result.responses[name].unit
        ends = extent(item["smallest"], item["largest"], unit)
        texts[_response_label(result, name)] = f"{ends}, {amount(item['nominal'], unit)} without deviations"
    yield "", "the best case" if "best" in result.summary else "the case"
    yield from aligned(texts)


def _best(result: DesignsResult, best: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """The first of the best cases, one a row."""
    objective = Objective.of(result.scenario.vary)
    units = {c.path: c.unit for c in result.coordinates}
    asked = next((response.unit for response in responses_of(result.responses, objective.response)), "1")
    for k, item in enumerate(best[:MOST_BEST]):
        value = f"{objective.text.partition(' ')[2]} {amount(item['value'], asked)}, " if objective.response else ""
        margin = ""
        if "limit" in item:  # it is known, since the case passes: what is not finite is that of a value of zero
            share = margin_text(item["margin"], 1.0 if math.isfinite(item["margin"]) else 0.0)
            margin = f"margin {share} ({limit_label(item['limit'])})"
        about = f"{value}{margin}".removesuffix(", ")
        yield f"best, {objective.text}" if k == 0 else "", f"{_parameters(units, item['parameters'])}: {about}"


def _sensitivity(result: DesignsResult, indices: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    """Shares of the parameters in the variance of each response, largest first."""
    texts = {}
    for name, shares in list(indices.items())[:MOST_ROWS]:
        order = sorted(shares.items(), key=lambda item: -item[1]["total_order"])
        texts[_response_label(result, name)] = ", ".join(
            f"{parameter_label(path)} {_share(s['total_order'])} "
            f"({_share(s['total_order_low'])} to {_share(s['total_order_high'])})"
            for path, s in order
        )
    yield "", "share of the variance by each parameter with its interactions (Sobol' total index, 95 % interval)"
    yield from aligned(texts)


def _share(index: float) -> str:
    """An index in percent; small samples estimate some below zero or above one."""
    return f"{100 * max(index, 0.0):.0f} %"


def _response_label(result: DesignsResult, name: str) -> str:
    """Place and quantity of a response; the curve of a sweep where there are several."""
    *path, quantity = name.split("/")  # [curve,] [probes, snubbers or outputs, name]
    curves = {each.partition("/")[0] for each in result.responses if each.count("/") == 3}
    shown = path[:-2] if len(curves) > 1 else []
    return " ".join([*shown, *path[-1:], quantity.removesuffix("_hz").replace("_", " ")])


def _responses(result: DesignsResult, responses: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    texts = {}
    for name, item in list(responses.items())[:MOST_ROWS]:
        unit = result.responses[name].unit if name in result.responses else "1"
        mean = f", mean {amount(item['mean'], unit)}" if "mean" in item else ""
        texts[_response_label(result, name)] = f"{extent(item['smallest'], item['largest'], unit)}{mean}"
    yield from aligned(texts)
    if len(responses) > MOST_ROWS:
        yield "", f"and {len(responses) - MOST_ROWS} more in the file"


TEXTS: Texts = {
    "cases": _cases,
    "passing": _passing,
    "best": _best,
    "tolerances": _tolerances,
    "scatter": _scatter,
    "margins": _margins,
    "sensitivity": _sensitivity,
    "responses": _responses,
    "processor_time_s": lambda _, time: f"processor time {amount(time, 's')}",
}
