"""Consistency checks between the section identify_stiffness and the rest of the scenario."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from pydantic_core import PydanticCustomError

from beamsim.errors import Problem
from beamsim.scenario.base import path_text
from beamsim.scenario.excitation import Harmonic, level_problems

if TYPE_CHECKING:
    from beamsim.scenario.base import Schema
    from beamsim.scenario.identification import IdentifyStiffness, MeasuredShapes, SoughtParameter
    from beamsim.scenario.whole import ScenarioParts

Path = tuple[str | int, ...]
_TOP = "identify_stiffness"


def identification_problems(scenario: ScenarioParts, schema: Schema, section: IdentifyStiffness) -> Iterator[Problem]:
    """Parameters that do not exist, bounds that make no sense, tests that nothing predicts; ``schema`` holds both."""
    if section.shapes_without is not None:
        yield from _shapes(scenario, section, section.shapes_without)
    for index, known in enumerate(section.parameter_uncertainty):
        yield from _numbers(schema, known.parameter, (_TOP, "parameter_uncertainty", index, "parameter"))
    yield from _sought(schema, section.update, (_TOP, "update"), words=True)
    if section.nonlinear is None:
        return
    yield from _sought(schema, section.nonlinear.estimate, (_TOP, "nonlinear", "estimate"), words=False)
    if not isinstance(scenario.excitation, Harmonic):
        yield Problem(
            f"{_TOP}.nonlinear",
            f"needs a harmonic excitation, but this one is {scenario.excitation.kind}",
            "give excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}",
        )
    names = [probe.name for probe in scenario.effective_probes]
    for index, test in enumerate(section.nonlinear.tests):
        at = f"{_TOP}.nonlinear.tests[{index}]"
        if test.probe is not None and test.probe not in names:
            yield Problem(
                f"{at}.probe", f"= {test.probe} is not the name of a probe", f"the probes are {', '.join(names)}"
            )
        if isinstance(scenario.excitation, Harmonic):
            yield from level_problems(scenario.excitation, (_TOP, "nonlinear", "tests", index, "level"), test.level)


def _shapes(scenario: ScenarioParts, section: IdentifyStiffness, shapes: MeasuredShapes) -> Iterator[Problem]:
    """Measured shapes are those of the one body that the snubber acts on; their positions must lie on it."""
    at = (_TOP, "shapes_without")
    snubbers = [located for located in scenario.located_snubbers if located.item.name == section.snubber]
    bodies = snubbers[0].bodies if snubbers else ()
    if len(bodies) > 1:
        yield Problem(
            path_text(at),
            f"holds the shapes of one body, and {section.snubber} acts between {' and '.join(bodies)}",
            "leave it out",
        )
    elif bodies and bodies[0] in scenario.all_bodies:
        body, where = scenario.all_bodies[bodies[0]], scenario.body_path(bodies[0])
        for index, position in enumerate(shapes.positions):
            yield from body.shape_problems(where, (*at, "positions", index), position)


def _numbers(scenario: Schema, path: str, at: Path) -> Iterator[Problem]:
    from beamsim.scenario.parameters import choices_at, find_parameters, value_at

    try:
        places = find_parameters(scenario, path)
    except PydanticCustomError as error:
        context = error.context or {}
        yield Problem(path_text(at), context["message"], context["remedy"])
        return
    for place in places:
        value = value_at(scenario, place)
        if choices_at(scenario, place) or isinstance(value, str):
            yield Problem(path_text(at), f"= {path} is not a number", "name a number")


def _sought(scenario: Schema, items: Sequence[SoughtParameter], at: Path, *, words: bool) -> Iterator[Problem]:
    from beamsim.scenario.parameters import choices_at, find_parameters, read_as, value_at

    seen: dict[Path, int] = {}
    for index, item in enumerate(items):
        here = (*at, index, "parameter")
        try:
            places = find_parameters(scenario, item.parameter)
        except PydanticCustomError as error:
            context = error.context or {}
            yield Problem(path_text(here), context["message"], context["remedy"])
            continue
        for place in places:
            if place in seen:
                yield Problem(
                    path_text(here),
                    f"= {item.parameter} is listed twice, also by {path_text((*at, seen[place]))}",
                    "list every parameter once",
                )
                break
            seen[place] = index
        choices = choices_at(scenario, places[0])
        if choices:
            if not words or "supports" not in places[0]:
                yield Problem(path_text(here), f"= {item.parameter} is not a number", "name a number")
            elif item.bounds or item.prior is not None:
                yield Problem(
                    path_text(here),
                    f"= {item.parameter} is a choice between {', '.join(choices)}: it has no bounds and no prior",
                    "leave them out; every choice is tried",
                )
            continue
        values = [value_at(scenario, place) for place in places]
        if any(isinstance(value, str) for value in values):
            yield Problem(path_text(here), f"= {item.parameter} is not a number", "name a number")
            continue
        if words and not all(value > 0 for value in values):
            yield Problem(
                path_text(here),
                f"= {item.parameter} is zero in this scenario, and is varied by a factor",
                "give it a rough value to start from, or leave it out",
            )
        if not item.bounds:
            continue
        try:
            low, high = (read_as(scenario, places[0], bound) for bound in item.bounds)
        except PydanticCustomError as error:
            context = error.context or {}
            yield Problem(path_text((*at, index, "bounds")), context["message"], context["remedy"])
            continue
        if not low < high:
            yield Problem(
                path_text((*at, index, "bounds")), f"= [{low:g}, {high:g}] is empty", "give the lower bound first"
            )
        elif not low <= values[0] <= high:
            yield Problem(
                path_text((*at, index, "bounds")),
                f"= [{low:g}, {high:g}] does not hold the scenario's value {values[0]:g}, where the search starts",
                "widen the bounds, change the value, or write the unit",
            )
