"""What a page says about a result: verdict, model, numbers, plots, contacts, animation, trust, scenario."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from beamsim.analyses.result import MARGINS, Result
from beamsim.analyses.values import limit_label, limit_unit
from beamsim.fields import figure_in_words
from beamsim.outcomes import STANDINGS, OnLimit
from beamsim.plots.animation import Scene
from beamsim.plots.model import excitation_text, model_figure
from beamsim.plots.style import amount, margin_text
from beamsim.report.interactive import interactive_plots
from beamsim.report.page import NOTE, Cells, Page, Verdict, captioned, labelled, listing, picture, table
from beamsim.report.trust import changes, checks, doubts, versions
from beamsim.scenario import Scenario
from beamsim.scenario.base import Schema, plain
from beamsim.structures.assembly import snubber_site
from beamsim.structures.stations import Stations
from beamsim.system.structural import SnubberNumbers
from beamsim.trust.convergence import by_place

CHANGES_SHOWN = 60
HOW_TO_READ = (
    '<p class="note screen">Drag to zoom, double-click to go back, click a name in a legend to hide its curve. '
    "Long curves are thinned to what a screen shows; the result file has every point.</p>"
)


class SketchedModel(NamedTuple):
    """What the sketch and the table of stops show beside the scenario."""

    stations: Stations
    stops: Mapping[str, SnubberNumbers]


def page_of(
    result: Result,
    about: str,
    rows: Iterable[tuple[str, str]],
    figures: Mapping[str, Figure],
    model: SketchedModel | None,
    scene: Scene | None,
) -> Page:
    """The page of a result.

    Parameters
    ----------
    result : of any kind.
    about : which command made it, and when.
    rows : of its printed table.
    figures : its plots by name.
    model : of its scenario; None where it has none, or it is not known.
    scene : an animation of its motion; None without one.

    Returns
    -------
    Sections from the limits to the scenario, with the verdict above them.
    """
    page = Page(result.title or "beamsim", about, verdict_of(result))
    margins = result.summary.get("margins") or {}
    page.add(
        "Limits",
        table(Cells(("limit of", "value", "at", "limit", "margin", ""), list(_margins(result.scenario, margins)))),
    )
    if model is not None:
        page.add("Model", *_model(result.scenario, model))
    page.add("Results", labelled(rows))
    page.add("Contact", *(table(cells) for cells in contact_tables(result)))
    if scene is not None:
        page.add("Motion", page.animated(scene.as_json(), NOTE))
    plots = interactive_plots(result)
    pictures = {name: figure for name, figure in figures.items() if name not in plots}
    page.add(
        "Plots",
        HOW_TO_READ if plots else "",
        *(page.plot(name, described) for name, described in plots.items()),
        *(captioned(name, picture(figure, name)) for name, figure in pictures.items()),
    )
    page.add("Why these numbers can be trusted", *_trust(result))
    page.add(
        "Scenario", f"<details><summary>YAML, as it was run</summary>{listing(result.scenario.to_yaml())}</details>"
    )
    return page


def verdict_of(result: Result) -> Verdict:
    """Limits first, then whether the numbers can be trusted."""
    margins = result.summary.get("margins") or {}
    reasons, standing = doubts(result), STANDINGS[result.outcome.gravest]
    on = {v: [limit_label(name) for name, item in margins.items() if item["verdict"] == v] for v in OnLimit}
    if on[OnLimit.EXCEEDED]:
        return Verdict("bad", f"Limit exceeded: {', '.join(on[OnLimit.EXCEEDED])}", reasons)
    if standing.exit_code:
        return Verdict("bad", standing.first_line.capitalize(), reasons)
    if on[OnLimit.NOT_RELIABLE]:
        return Verdict("doubt", f"Neither kept nor exceeded: {', '.join(on[OnLimit.NOT_RELIABLE])}", reasons)
    if reasons:
        within = " All limits are kept." if margins else ""
        return Verdict("doubt", f"To be read with care.{within}", reasons)
    if margins:
        return Verdict("good", "All limits are kept")
    if MARGINS in type(result).SUMMARY:
        limit = "peak_force: 50 N" if result.scenario.all_snubbers else "peak_displacement: 2 mm"
        return Verdict("", "Complete. No limits are given", [f"limits: {{{limit}}} gives a verdict"])
    return Verdict("", "Complete")


def _margins(scenario: Scenario, margins: Mapping[str, Mapping[str, Any]]) -> Iterator[list[str]]:
    for name, item in margins.items():
        unit = limit_unit(scenario, name)
        share = margin_text(item["margin"], item["value"])
        kept = {OnLimit.MET: "+ kept", OnLimit.EXCEEDED: "! exceeded"}.get(item["verdict"], "not reliable")
        yield [
            limit_label(name),
            amount(item["value"], unit),
            item["at"],
            amount(item["limit"], unit),
            share,
            kept,
        ]


def _model(scenario: Scenario, model: SketchedModel) -> Iterator[str]:
    yield f"<figure>{picture(model_figure(scenario, model.stations, model.stops), 'model')}</figure>"
    yield labelled([("excitation", excitation_text(scenario)), *_bodies(scenario)])
    sites = {located.item.name: snubber_site(located).label for located in scenario.located_snubbers}
    rows = [[name, sites.get(name, ""), stop.side, *_stop(stop)] for name, stop in model.stops.items()]
    heading = ("stop", "at", "side", "stiffness", "dashpot", "gap", "force at rest", "k L^3 / E I")
    yield table(Cells(heading, rows, "Stops"))


def _stop(stop: SnubberNumbers) -> list[str]:
    ratio = f"{stop.stiffness_ratio:.4g}" if math.isfinite(stop.stiffness_ratio) else ""
    preload = amount(stop.preload, "N") if math.isfinite(stop.preload) else "not unique"
    return [amount(stop.stiffness, "N/m"), amount(stop.dashpot, "N s/m"), amount(stop.gap, "m"), preload, ratio]


def _bodies(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """What each body is given by, its numbers with their units."""
    for name, body in scenario.all_bodies.items():
        yield name, ", ".join(_given(body))


def _given(body: Any) -> Iterator[str]:
    for key in type(body).keys().values():
        value = getattr(body, key)
        if key in ("snubbers", "kind") or value is None or value == () or value == 0.0:
            continue
        unit = _unit(type(body), key)
        words = key.replace("_", " ")
        if isinstance(value, float) and unit is not None:
            yield f"{words} {amount(value, unit)}"
        elif isinstance(value, (int, str)):
            yield f"{words} {value}"
        elif isinstance(value, tuple) and all(isinstance(each, float) for each in value) and unit is not None:
            yield f"{words} {', '.join(amount(each, unit) for each in value)}"
        elif isinstance(value, tuple):
            yield f"{len(value)} {words}"
        elif isinstance(value, Schema):
            inner = ", ".join(f"{k.replace('_', ' ')} {_plain(v)}" for k, v in plain(value).items())
            yield f"{words} ({inner})" if inner else words


def _plain(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _unit(section: Any, key: str) -> str | None:
    """SI unit of a field; None where it is no quantity."""
    field = section.model_fields[key]
    return next(_units((*field.metadata, field.annotation)), None)


def _units(items: Iterable[Any]) -> Iterator[str]:
    """SI units within annotations."""
    for item in items:
        if hasattr(item, "dimension"):
            yield str(item.dimension.unit)
        else:
            yield from _units((*getattr(item, "__metadata__", ()), *getattr(item, "__args__", ())))


def contact_tables(result: Result) -> Iterator[Cells]:
    """Numbers of each stop, and statistics of its impacts."""
    entries = [entry for entry in type(result).SUMMARY if "of a snubber" in entry.meaning]
    held = [(entry, result.summary.get(entry.name)) for entry in entries]
    columns = [(entry, dict(by_place(values))) for entry, values in held if isinstance(values, Mapping) and values]
    stops = dict.fromkeys(name for _, values in columns for name in values)
    rows = [[stop, *(_cell(values.get(stop), entry.unit) for entry, values in columns)] for stop in stops]
    yield Cells(["stop", *(figure_in_words(entry.name) for entry, _ in columns)], rows)
    impacts = result.summary.get("impacts")
    if isinstance(impacts, Mapping) and impacts:
        first: Any = next(iter(impacts.values()))
        figures = [key for key, value in first.items() if isinstance(value, (int, float))]
        rows = [[key.replace("_", " "), *(_plain(of.get(key)) for of in impacts.values())] for key in figures]
        yield Cells(["impacts", *impacts], rows, "Statistics of the impacts (SI units, in the names)")


def _cell(value: Any, unit: str) -> str:
    return amount(value, unit) if isinstance(value, (int, float)) else ""


def _trust(result: Result) -> Iterator[str]:
    yield table(Cells(("what", "outcome", "meaning"), list(checks(result))))
    rows = sorted(changes(result), key=lambda row: -row[2])
    shown = [
        [figure, name, f"{'! ' if doubtful else ''}{100 * change:.2g} %"]
        for figure, name, change, doubtful in rows[:CHANGES_SHOWN]
    ]
    more = f" (the {CHANGES_SHOWN} largest of {len(rows)})" if len(rows) > CHANGES_SHOWN else ""
    yield table(Cells(("value", "of", "change"), shown, f"Change of every value with the finer model{more}"))
    yield labelled([("made with", versions(result)), ("created", result.created)])
