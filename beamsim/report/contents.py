"""Contents of the page about a result: two pages with question, model, limits and answer, and an appendix."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from re import fullmatch
from typing import Any, NamedTuple

from beamsim.kinds import KINDS
from beamsim.outcomes import EXIT_RULES, Verdict
from beamsim.plots.animation import Scene
from beamsim.plots.drawing import Picture
from beamsim.plots.model import model_figure
from beamsim.plots.sketch import Sketch
from beamsim.plots.style import amount, scale_for
from beamsim.plots.understood import excitation_text
from beamsim.report.interactive import interactive
from beamsim.report.page import (
    NOTE,
    Cells,
    Page,
    PageVerdict,
    caption_plot,
    label_rows,
    picture,
    preformatted_html,
    table,
)
from beamsim.results.result import MARGINS, Result
from beamsim.results.values import limit_label, limits_not_met
from beamsim.scenario import Scenario
from beamsim.scenario.base import Schema
from beamsim.scenario.parameters import field_type, yaml_with_units
from beamsim.structures.assembly import snubber_site
from beamsim.summaries import place_in_words, value_in_words
from beamsim.system.structural import SnubberNumbers
from beamsim.trust.convergence import numbers_by_place

MOST_ERRORS = 60
PICTURE_ORDER = (
    "srs", "random", "displacement", "response_.*", "contact(_force.*)?", "backbone|frequency_energy", "maps|slices",
    "acceleration", "spectrum",
)  # fmt: skip
"""Names of pictures, the most important ones first."""
METHODS = {
    "exact": "Closed form between contacts, without a time step. The search for the next contact event is certified: "
    "bounds exclude that a contact is passed over.",
    "reference": "time stepping with located events; contacts are not certified",
    "shooting": "Periodic motions of the flow in closed form, by Newton's method with exact derivatives; stability by "
    "the multipliers of one period.",
    "harmonic_balance": "Fourier series of the motion; the energy balance and the residual say what is left out.",
    "secular": "Natural frequencies as roots of an equation in the stiffness alone.",
}
CHECKS = {
    "energy balance error": "Work put in, energy stored and energy dissipated, each computed by itself; over the "
    "larger of the stored energy and the work exchanged.",
    "reduction": "modes and static vectors of the model, with a bound of what they leave out",
    "convergence": "the case solved again with a finer model; the error of every value that follows from it is in "
    "the appendix",
    "exact and reference": "the same case integrated in time by SciPy",
}
"""Meaning of rows of the printed table for the reliability of the others, by label."""
READING_NOTES = (
    '<p class="note screen">Drag to zoom, double-click to go back, click a name in a legend to hide its curve. '
    "Long curves are thinned to what a screen shows; the result file has every point.</p>"
)


class Printed(NamedTuple):
    """Output of the command line for a result."""

    screen: str  # first screen
    rows: Sequence[tuple[str, str]]  # of its table
    limits: Mapping[str, Mapping[str, str]]  # margin, value, place and verdict of each limit


def page_of(
    result: Result,
    about: str,
    printed: Printed,
    figures: Mapping[str, Picture],
    sketch: Sketch | None,
    scene: Scene | None,
) -> Page:
    """Build the page of a result.

    Parameters
    ----------
    result : of any kind.
    about : which command made it, and when.
    printed : of it.
    figures : its pictures by name.
    sketch : of its model; None where it has none, or it is not known.
    scene : an animation of its motion; None without one.

    Returns
    -------
    Sections from the question to the scenario, with the verdict above them.
    """
    page = Page(result.title or "beamsim", about, verdict_of(result), appendix="Results")
    page.add("Question", label_rows(_question(result, result.scenario if sketch is None else sketch.scenario)))
    if sketch is not None:
        page.add("Model", f"<figure>{picture(model_figure(sketch), 'model')}</figure>")
    page.add("Limits", table(Cells(("limit of", "value", "at", "limit", "margin", ""), list(_limits(printed.limits)))))
    page.add(
        "Summary",
        preformatted_html(printed.screen),
        *(caption_plot(name.removesuffix("_0"), picture(shown, name)) for name, shown in _front(figures)),
    )
    page.add("How sure", table(Cells(("what", "outcome", "meaning"), list(_reliability_rows(result, printed.rows)))))
    page.add("Results", label_rows(printed.rows))
    if sketch is not None:
        page.add("Model in numbers", *_model(sketch))
    if scene is not None:
        page.add("Motion", page.animated(scene.as_json(), NOTE))
    plots = {name: interactive(figure) for name, figure in figures.items()}
    page.add(
        "Plots",
        READING_NOTES if any(plots.values()) else "",
        *(page.plot(name, panels, figures[name].columns) for name, panels in plots.items() if panels),
        *(caption_plot(name, picture(figures[name], name)) for name, panels in plots.items() if not panels),
    )
    page.add("Why these numbers can be trusted", *_trust(result))
    page.add(
        "Scenario",
        f"<details><summary>YAML, as it was run</summary>{preformatted_html(yaml_with_units(result.scenario))}"
        "</details>",
    )
    return page


def verdict_of(result: Result) -> PageVerdict:
    """Overall verdict: first the limits, then the reliability of the values."""
    margins = result.summary.get("margins") or {}
    standing = EXIT_RULES[result.outcome.gravest_kind]
    reasons = [str(result.outcome.in_display_units(scale_for))] if standing.first_line else []
    on = {v: [limit_label(name) for name, item in margins.items() if item["verdict"] == v] for v in Verdict}
    if on[Verdict.EXCEEDED]:
        return PageVerdict("bad", f"Limit exceeded: {', '.join(on[Verdict.EXCEEDED])}", reasons)
    if standing.exit_code:
        return PageVerdict("bad", standing.first_line.capitalize(), reasons)
    if on[Verdict.NOT_RELIABLE]:
        return PageVerdict("doubt", f"Neither kept nor exceeded: {', '.join(on[Verdict.NOT_RELIABLE])}", reasons)
    if on[Verdict.UNDECIDED]:
        reasons += limits_not_met(result.scenario, {n: i for n, i in margins.items() if i["verdict"] != Verdict.MET})
        return PageVerdict("doubt", f"Undecided by a run of this length: {', '.join(on[Verdict.UNDECIDED])}", reasons)
    if reasons:
        within = " All limits are kept." if margins else ""
        return PageVerdict("doubt", f"To be read with care.{within}", reasons)
    if margins:
        return PageVerdict("good", "All limits are kept")
    if MARGINS in type(result).SUMMARY:
        limit = "peak_force: 50 N" if result.scenario.all_snubbers else "peak_displacement: 2 mm"
        return PageVerdict("", "Complete. No limits are given", [f"{limit} among the limits gives a verdict"])
    return PageVerdict("", "Complete")


def _limits(limits: Mapping[str, Mapping[str, str]]) -> Iterator[list[str]]:
    signs = {Verdict.MET: "+ ", Verdict.EXCEEDED.upper(): "! "}
    for name, of in limits.items():
        yield [name, of["value"], of["at"], of["limit"], of["margin"], signs.get(of["verdict"], "") + of["verdict"]]


def _question(result: Result, scenario: Scenario) -> Iterator[tuple[str, str]]:
    yield "asked", KINDS[result.KIND].question
    yield "excitation", excitation_text(scenario)
    if scenario.study is not None:
        yield "varied", ", ".join(parameter.path for parameter in scenario.study.parameters)


def _front(figures: Mapping[str, Picture]) -> list[tuple[str, Picture]]:
    """First panels of the most important pictures."""
    ranks = {
        name: next((k for k, x in enumerate(PICTURE_ORDER) if fullmatch(x, name)), len(PICTURE_ORDER))
        for name in figures
    }
    chosen = sorted(figures, key=lambda name: ranks[name])[:3]
    return [
        (name, figures[name]._replace(title="", panels=figures[name].panels[:1], size=(7.2, 2.3))) for name in chosen
    ]


def _reliability_rows(result: Result, rows: Iterable[tuple[str, str]]) -> Iterator[list[str]]:
    """Outcome, method, and the printed rows about the reliability of the values."""
    yield ["outcome", str(result.outcome.in_display_units(scale_for)) or "complete", "how the computation ended"]
    method, label = str(result.summary.get("method", "")), ""
    if method:
        meaning = next((text for start, text in METHODS.items() if method.startswith(start)), "")
        yield ["method", method.replace("_", " "), meaning]
    for name, text in rows:
        label = name or label
        if label in CHECKS:
            yield [name, text, CHECKS[label] if name else ""]


def _model(sketch: Sketch) -> Iterator[str]:
    scenario = sketch.scenario
    yield label_rows(_bodies(scenario))
    sites = {located.item.name: snubber_site(located).label for located in scenario.located_snubbers}
    rows = [[name, sites.get(name, ""), stop.side, *_stop(stop)] for name, stop in sketch.stops.items()]
    heading = ("stop", "at", "side", "stiffness", "dashpot", "gap", "force at rest", "k L^3 / E I")
    yield table(Cells(heading, rows, "Stops"))


def _stop(stop: SnubberNumbers) -> list[str]:
    ratio = f"{stop.stiffness_ratio:.4g}" if math.isfinite(stop.stiffness_ratio) else ""
    way, push = stop.gap_unit, stop.force_unit
    preload = amount(stop.preload, push) if math.isfinite(stop.preload) else "not unique"
    stiffness, dashpot = amount(stop.stiffness, f"{push}/{way}"), amount(stop.dashpot, f"{push} s/{way}")
    return [stiffness, dashpot, amount(stop.gap, way), preload, ratio]


def _bodies(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Given properties of each body, with units."""
    for name, body in scenario.all_bodies.items():
        yield name, ", ".join(_stated_properties(body))


def _stated_properties(body: Any) -> Iterator[str]:
    for key, name in type(body).keys().items():
        value = getattr(body, name)
        if key in ("snubbers", "kind") or value is None or value == () or value == 0.0:
            continue
        dimension = getattr(field_type(body, key), "dimension", None)
        unit = None if dimension is None else dimension.unit
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
            inner = ", ".join(filter(None, (getattr(value, "kind", "").replace("_", " "), *_stated_properties(value))))
            yield f"{words} ({inner})" if inner else words


def _trust(result: Result) -> Iterator[str]:
    """Warnings, and the errors of all values."""
    yield label_rows(("" if k else "warnings", text) for k, text in enumerate(result.warnings))
    doubtful = set(result.summary.get("doubtful") or ())
    known = sorted(numbers_by_place(result.summary.get("convergence") or {}), key=lambda each: -each[1])
    errors = []
    for key, error in known[:MOST_ERRORS]:
        value, _, place = key.partition(".")
        mark = "! " if key in doubtful else ""
        errors.append([value_in_words(value), place_in_words(value, place), f"{mark}{100 * error:.2g} %"])
    more = f" (the {MOST_ERRORS} largest of {len(known)})" if len(known) > MOST_ERRORS else ""
    yield table(Cells(("value", "of", "error"), errors, f"Error of every value, from a finer model{more}"))
    packages = ", ".join(f"{name} {version}" for name, version in result.provenance.items())
    yield label_rows([("made with", f"beamsim {result.beamsim_version}, {packages}"), ("created", result.created)])
