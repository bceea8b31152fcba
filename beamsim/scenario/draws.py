"""The same scenario with other numbers, many times: only the sections that change are checked again, then the whole."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from beamsim.errors import ScenarioError
from beamsim.scenario.base import Path, Schema
from beamsim.scenario.designs import Value
from beamsim.scenario.loading import load_scenario
from beamsim.scenario.scenario import Scenario

Places = Sequence[Sequence[Path]]


def draw_data(base: Mapping[str, Any], places: Places, values: Sequence[Value]) -> dict[str, Any]:
    """Plain data of a scenario with the values of a draw at their places, ``places`` being those of each value."""
    data = copy.deepcopy(dict(base))
    for value, at in zip(values, places, strict=True):
        for place in at:
            owner: Any = data
            for part in place[:-1]:
                owner = owner[part]
            owner[place[-1]] = value
    return data


class Draws:
    """Scenarios that differ in some numbers, each checked like one that is read from a file.

    Parameters
    ----------
    base : plain data of the scenario, in SI units; it is read and checked once.
    places : where the value of each parameter goes, in all draws.

    Raises
    ------
    ScenarioError
        If the base is invalid.
    """

    def __init__(self, base: Mapping[str, Any], places: Places) -> None:
        self._base, self._places = base, places
        self._scenario = load_scenario(base)
        if self._scenario.automatic_sample_rate and self._scenario.run is not None:  # chosen again for each draw
            run = self._scenario.run.model_copy(update={"sample_rate": None})
            self._scenario = self._scenario.model_copy(update={"run": run})

    def scenario(self, values: Sequence[Value]) -> Scenario:
        """The scenario of a draw.

        Raises
        ------
        ScenarioError
            With every problem, as `load_scenario` finds them.
        """
        changes = {place: value for value, at in zip(values, self._places, strict=True) for place in at}
        try:
            drawn: Scenario = _rebuilt(self._scenario, changes)
        except (ValidationError, PydanticCustomError, ScenarioError, KeyError, TypeError):
            return load_scenario(draw_data(self._base, self._places, values))
        return drawn


def _rebuilt(owner: Any, changes: Mapping[Path, Value]) -> Any:
    """A section, tuple or mapping of sections with values at paths below it; the sections on the way are checked."""
    below: dict[str | int, dict[Path, Value]] = {}
    for path, value in changes.items():
        below.setdefault(path[0], {})[path[1:]] = value
    if isinstance(owner, Schema):
        names = type(owner).keys()
        parts = {names.get(str(key), str(key)): rest for key, rest in below.items()}
        inner = {name: _new(owner.__dict__[name], rest) for name, rest in parts.items()}
        if any(() in rest for rest in below.values()):  # a value of its own, which its field has to read
            return type(owner).model_validate({**owner.__dict__, **inner})
        copy = owner.model_copy(update=inner)
        copy.settle()
        return copy
    if isinstance(owner, dict):
        return {**owner, **{str(key): _new(owner[key], rest) for key, rest in below.items()}}
    items = list(owner)
    for key, rest in below.items():
        items[int(key)] = _new(items[int(key)], rest)
    return tuple(items)


def _new(value: Any, changes: Mapping[Path, Value]) -> Any:
    return changes[()] if () in changes else _rebuilt(value, changes)
