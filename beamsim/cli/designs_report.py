"""Texts of the table of a design study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from beamsim.analyses.designs.result import Coordinate, DesignsResult
from beamsim.analyses.limits import limit_label
from beamsim.cli.report import Row, Texts, aligned, margins
from beamsim.plots.style import amount

MOST_ROWS = 24

_DESIGNS = {"grid": "grid of ", "zip": "", "latin_hypercube": "Latin-hypercube sample of ", "draws": "ensemble of "}


def _cases(result: DesignsResult, cases: int) -> Iterator[Row]:
    failed = f", {result.summary['failed']} failed" if result.summary["failed"] else ""
    size = " x ".join(map(str, result.shape)) if len(result.shape) > 1 else str(cases)
    yield "", f"{_DESIGNS[result.kind]}{size}, each a {result.analysis.replace('_', ' ')}{failed}"
    for k, coordinate in enumerate(result.coordinates):
        yield "" if k else "varied", f"{coordinate.path}: {_extent(coordinate)}"


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
            worst = ", ".join(
                f"{path} = {value if isinstance(value, str) else amount(value, units.get(path, '1'))}"
                for path, value in item["parameters"].items()
            )
            share = f"{item['cases_exceeding']} of {result.cases} cases"
            yield "", f"{limit_label(name)} exceeded in {share}, most with {worst}"


def _responses(result: DesignsResult, responses: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    texts = {}
    for name, item in list(responses.items())[:MOST_ROWS]:
        unit = result.responses[name].unit if name in result.responses else "1"
        mean = f", mean {amount(item['mean'], unit)}" if "mean" in item else ""
        label = (
            name.removeprefix("probes/")
            .removeprefix("snubbers/")
            .removeprefix("outputs/")
            .replace("/", " ")
            .removesuffix("_hz")
        )
        texts[label.replace("_", " ")] = f"{amount(item['smallest'], unit)} to {amount(item['largest'], unit)}{mean}"
    yield from aligned(texts)
    if len(responses) > MOST_ROWS:
        yield "", f"and {len(responses) - MOST_ROWS} more in the file"


TEXTS: Texts = {
    "cases": _cases,
    "margins": _margins,
    "responses": _responses,
    "processor_time_s": lambda _, time: f"processor time {amount(time, 's')}",
}
