"""What can be wrong between a continuation and the rest of the scenario."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from beamsim.errors import Problem
from beamsim.scenario.base import suggestion
from beamsim.scenario.continuation import Continuation, HarmonicBalance, LevelPath, PositionPath, SnubberPath
from beamsim.scenario.excitation import level_problems
from beamsim.scenario.tree import path_parts

if TYPE_CHECKING:
    from beamsim.scenario.body import Located
    from beamsim.scenario.whole import ScenarioParts


def continuation_problems(scenario: ScenarioParts, sweep: Continuation) -> Iterator[Problem]:
    """Inconsistencies between a continuation and its structure and excitation."""
    given: list[tuple[str, Any]] = [("follow_folds_in", sweep.follow_folds_in), ("continue_in", sweep.continue_in)]
    for key, path in given:
        if isinstance(path, LevelPath):
            for name, level in (("from", path.from_), ("to", path.to)):
                yield from level_problems(scenario.excitation, ("sweep", key, name), level)
        if isinstance(path, SnubberPath):
            yield from _snubber_problems(scenario, f"sweep.{key}", path)
    second = sweep.follow_folds_in
    if second is not None:
        present = _value_in_scenario(scenario, sweep, second)
        low, high = sorted((float(second.from_), float(second.to)))
        if present is not None and not low <= present <= high:
            yield Problem(
                "sweep.follow_folds_in",
                f"runs from {low:g} to {high:g}, which leaves out the scenario's own {second.kind} of {present:g}, "
                "where the folds are found",
                "widen the range to hold it",
            )
    if isinstance(sweep.method, HarmonicBalance) and not (scenario.all_snubbers or scenario.nonlinear_springs):
        yield Problem(
            "sweep.method", "= harmonic_balance needs a snubber or a nonlinear spring", "use shooting, or add a snubber"
        )


def _value_in_scenario(scenario: ScenarioParts, sweep: Continuation, path: Any) -> float | None:
    if isinstance(path, LevelPath):
        return float(sweep.levels[0]) if sweep.levels else getattr(scenario.excitation, "level", None)
    index = snubber_index(scenario, path)
    if index is None:
        return None
    if path.kind != "position":
        return getattr(scenario.all_snubbers[index], path.kind)  # type: ignore[no-any-return]
    return scenario.all_snubbers[index].places[0].position  # type: ignore[no-any-return]


def snubber_index(scenario: ScenarioParts, path: SnubberPath) -> int | None:
    """Which snubber a path means; None where it means none."""
    names = [snubber.name for snubber in scenario.all_snubbers]
    if path.snubber is None:
        return 0 if len(names) == 1 else None
    return names.index(path.snubber) if path.snubber in names else None


def _snubber_problems(scenario: ScenarioParts, at: str, path: Any) -> Iterator[Problem]:
    names = [snubber.name for snubber in scenario.all_snubbers]
    if not names:
        yield Problem(f"{at}.kind", f"= {path.kind} needs a snubber, and there is none", "add one to snubbers")
        return
    index = snubber_index(scenario, path)
    if index is None:
        if path.snubber is None:
            yield Problem(f"{at}.snubber", "is missing", f"there are several: choose one of {', '.join(names)}")
            return
        known = suggestion(path.snubber, names, "the snubbers are")
        yield Problem(f"{at}.snubber", f"= {path.snubber} is not the name of a snubber", known)
        return
    preloaded = [snubber.name for snubber in scenario.all_snubbers if snubber.preload is not None]
    if preloaded:
        yield Problem(
            f"{at}.kind",
            f"= {path.kind} would change the gap that the preload of {preloaded[0]} asks for at every step",
            "give its gap instead of its preload",
        )
    if isinstance(path, PositionPath):
        yield from _position_problems(scenario, at, path, scenario.located_snubbers[index])


def _position_problems(scenario: ScenarioParts, at: str, path: PositionPath, located: Located) -> Iterator[Problem]:
    if len(located.item.places) > 1:
        yield Problem(f"{at}.kind", "= position moves a snubber between two places", "follow gap or stiffness")
        return
    name = located.item.places[0].body or located.body
    body = scenario.all_bodies.get(name)
    if body is None:
        return
    for key, value in (("from", path.from_), ("to", path.to)):
        problems = list(body.movable_problems(scenario.body_path(name), (*path_parts(at), key), value))
        yield from problems
        if problems and problems[0].path.endswith(".kind"):
            return
