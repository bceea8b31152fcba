"""A scenario as plain data to be changed: as the user wrote it, so that what follows from a number goes on to follow.

In a resolved scenario a place at 100 % is a length in metres, and a default a number: replaced there, the length of the
beam would leave its stop behind. So numbers are replaced in what was written, and all is read and checked again.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from beamsim.scenario.base import Path
from beamsim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from beamsim.scenario.designs import Value

Places = Sequence[Sequence[Path]]


def written(scenario: Scenario, places: Iterable[Path] = ()) -> dict[str, Any]:
    """Plain data that loads to a scenario, as it was written; sections that Python code has changed are resolved.

    Parameters
    ----------
    scenario : read by `load_scenario`; of one that was not, all is resolved.
    places : of numbers and words that are to be replaced. What holds them is there, also where it was left out or
        written in short.

    Returns
    -------
    dict
        With levels whose quantity is named, so that a level without a unit is of the same one.
    """
    resolved: dict[str, Any] = scenario.model_dump(mode="json", by_alias=True, exclude_none=True)
    if scenario.sweep is not None and not resolved["sweep"].get("levels", True):
        del resolved["sweep"]["levels"]  # an empty list is refused
    text = scenario.text
    if text is None:
        return resolved
    as_read = Scenario.model_validate(text)
    same = {key for key, name in Scenario.keys().items() if getattr(as_read, name) == getattr(scenario, name)}
    data = {key: text[key] for key in same if text.get(key) is not None}
    data |= {key: value for key, value in resolved.items() if key not in same}
    _name_quantities(data, resolved)
    for place in places:
        _open(data, resolved, place)
    return data


def replaced(data: Mapping[str, Any], places: Places, values: Sequence[Value]) -> dict[str, Any]:
    """A copy of `written` data with values at their places, ``places`` being those of each value."""
    changed = copy.deepcopy(dict(data))
    for value, at in zip(values, places, strict=True):
        for place in at:
            owner: Any = changed
            for part in place[:-1]:
                owner = owner[part]
            owner[place[-1]] = value
    return changed


def _name_quantities(data: Any, resolved: Any) -> None:
    """Write the quantity of levels beside them."""
    if isinstance(data, dict) and isinstance(resolved, dict):
        if "quantity" in resolved:
            data["quantity"] = resolved["quantity"]
        for key in data.keys() & resolved.keys():
            _name_quantities(data[key], resolved[key])
    elif isinstance(data, list) and isinstance(resolved, list):
        for inner, of in zip(data, resolved, strict=False):
            _name_quantities(inner, of)


def _open(data: Any, resolved: Any, place: Path) -> None:
    """Write out what holds a place, as it is resolved, where it is not written as a mapping or list of this size."""
    for part in place[:-1]:
        full = resolved[part]
        inner: Any = data.get(part) if isinstance(data, dict) else data[part]
        if type(inner) is not type(full) or (isinstance(full, list) and len(inner) != len(full)):
            data[part] = inner = copy.deepcopy(full)
        data, resolved = inner, full
